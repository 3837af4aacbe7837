"""Datasets written by the terminal program, opened in Python.

Run by `cargo xtask test-python`, which installs the requirements. The environment
variable NANOTAP names the program (otherwise the release build of this checkout).
"""

import json
import subprocess
import warnings

import pytest
from program import PROGRAM, ROOT

np = pytest.importorskip("numpy")
xr = pytest.importorskip("xarray")
zarr = pytest.importorskip("zarr")

CASE = """
[model]
modes = 3
alpha1 = 0.1
alpha2 = 0.1
alpha3 = 0.1
alpha4 = 20.0
alpha5 = 0.0
alpha6 = 0.2
omega = 2.6
"""


@pytest.fixture
def nanotap(tmp_path):
    """Runs the program in a temporary folder; returns the JSON that it prints."""
    (tmp_path / "case.toml").write_text(CASE)

    def run(*arguments):
        command = [PROGRAM, *map(str, arguments), "--json"]
        done = subprocess.run(
            command,
            check=False,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    run.folder = tmp_path
    return run


def opened(path):
    """The dataset, opened with every warning as an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return xr.open_zarr(path)


def test_a_sweep_opens_with_names_units_and_its_case(nanotap):
    said = nanotap(
        "sweep",
        "case.toml",
        "--over",
        "omega=2.5:3:21",
        "--starts",
        3,
        "--periods",
        12,
        "--strobe",
        5,
    )
    data = opened(nanotap.folder / said["path"])
    assert dict(data.sizes) == {
        "omega": 21,
        "start": 3,
        "drive_period": 12,
        "strobe_period": 5,
        "state": 6,
    }
    np.testing.assert_array_equal(data.omega, np.linspace(2.5, 3, 21))
    assert list(data.state.values) == ["a1", "a2", "a3", "v1", "v2", "v3"]
    assert list(data.strobe_period.values) == [8, 9, 10, 11, 12]
    assert data.strobe.dims == ("omega", "start", "strobe_period", "state")
    for name, variable in data.variables.items():
        assert variable.attrs["long_name"], name
        assert variable.attrs["units"], name
    assert json.loads(data.attrs["case"])["alpha4"] == 20.0
    assert data.attrs["seed"] == 1
    assert data.attrs["nanotap_version"].count(".") == 2

    # Codes remain whole numbers, and their meanings are stored.
    meanings = data.classification.attrs["flag_meanings"].split()
    codes = data.classification.values
    assert codes.dtype == np.uint8 and data.period.dtype == np.int32
    for name, count in said["counts"].items():
        assert (codes == meanings.index(name)).sum() == count
    # The recordings agree with the summary of each run.
    np.testing.assert_array_equal(data.period_max.max("drive_period"), data.tip_max)
    np.testing.assert_array_equal(data.period_min.min("drive_period"), data.tip_min)
    # The tip's deflection at drive phase 0 lies between the extremes: W = 2 Σ ±a_j.
    tip = (
        data.strobe.sel(state=["a1", "a2", "a3"])
        * xr.DataArray([2, -2, 2], dims="state")
    ).sum("state")
    assert ((tip <= data.tip_max + 1e-9) & (tip >= data.tip_min - 1e-9)).all()
    # The multipliers of an orbit are inside the unit circle; a chaotic run has none.
    periodic = data.classification == meanings.index("periodic")
    assert (data.multiplier.where(periodic, 0) < 1).all()
    assert data.multiplier.where(~periodic).isnull().all()


def test_a_followed_sweep_says_its_direction(nanotap):
    said = nanotap(
        "sweep",
        "case.toml",
        "--over",
        "omega=2.8:3:5",
        "--follow",
        "both",
        "--periods",
        4,
    )
    data = opened(nanotap.folder / said["path"])
    assert list(data.direction.values) == ["up", "down"]
    assert "direction" in data.coords
    up = data.isel(start=(data.direction == "up").values)
    assert up.period.shape == (5, 1)


def test_two_parameters_make_a_map(nanotap):
    said = nanotap(
        "sweep",
        "case.toml",
        "--over",
        "omega=2.9:3.1:6",
        "--over",
        "alpha4=1:100:4:log",
        "--periods",
        4,
    )
    data = opened(nanotap.folder / said["path"])
    assert data.period.dims == ("alpha4", "omega", "start")
    np.testing.assert_allclose(data.alpha4, np.geomspace(1, 100, 4), rtol=1e-14)
    row = nanotap(
        "sweep",
        "case.toml",
        "--set",
        "alpha4=100",
        "--over",
        "omega=2.9:3.1:6",
        "--periods",
        4,
        "--out",
        "row.zarr",
    )
    alone = opened(nanotap.folder / row["path"])
    xr.testing.assert_identical(
        data.isel(alpha4=3, drop=True).tip_max.variable, alone.tip_max.variable
    )


def test_a_basin_opens_with_its_attractors(nanotap):
    said = nanotap(
        "basin", "case.toml", "--set", "omega=20", "--set", "alpha1=0",
        "--x", "a1=-1:1:12", "--y", "v1=-4:4:9", "--starts", 24,
    )  # fmt: skip
    data = opened(nanotap.folder / said["path"])
    assert data.attractor.dims == ("v1", "a1")
    attractors = json.loads(data.attrs["attractors"])
    assert sorted(a["period"] for a in attractors) == [1, 4]
    for index, attractor in enumerate(said["attractors"]):
        share = float((data.attractor == index).mean())
        assert share == pytest.approx(attractor["fraction"], abs=1e-15)
        assert len(attractors[index]["states"]) == attractor["period"]


def test_a_share_opens_with_the_rest_missing(nanotap):
    said = nanotap(
        "sweep",
        "case.toml",
        "--over",
        "omega=2.9:3.1:8",
        "--periods",
        4,
        "--chunk",
        "1/2",
    )
    data = opened(nanotap.folder / said["path"])
    missing = data.classification.isel(start=0).values == 0
    assert missing.sum() == 4
    assert data.tip_max.isel(start=0).isnull().values.tolist() == missing.tolist()


def test_plain_zarr_reads_it_too(nanotap):
    said = nanotap("sweep", "case.toml", "--over", "omega=2.9:3.1:3", "--periods", 4)
    group = zarr.open_group(nanotap.folder / said["path"], mode="r")
    assert group["period_max"].shape == (3, 1, 4)
    assert group.attrs["kind"] == "sweep"


def test_an_image_is_written_line_by_line(tmp_path):
    import nanotap

    case = nanotap.Case.from_file(ROOT / "docs" / "cases" / "scan-particle.toml")
    few = {"lines": 4, "pixels": 12, "periods": 300, "settle": 300, "line_settle": 100}
    plain = nanotap.scan(case, **few, progress=False)
    path = tmp_path / "image.zarr"
    share = nanotap.scan(case, **few, out=path, chunk="1/2", progress=False)
    assert np.isnan(share.height).sum() == share.height.size // 2
    whole = nanotap.scan(case, **few, out=path, progress=False)
    assert whole.attrs.pop("path") == str(path)
    xr.testing.assert_identical(whole, plain)
    assert nanotap.open(path).sizes == {
        "y": 4,
        "direction": 2,
        "x": 12,
        "flight": 8,
        "off": 8,
        "jump": 8,
    }
    with pytest.raises(ValueError, match="line_settle"):
        nanotap.scan(
            nanotap.Case.from_file(ROOT / "docs" / "cases" / "scan-step.toml"), out=path
        )
