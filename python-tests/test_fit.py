"""Fits from Python: tables of any kind, and their results."""

import pickle

import nanotap
import numpy as np
import pytest

LEVER = """
[model]
modes = 2
[cantilever]
k = "42 N/m"
f0 = "330 kHz"
Q = 400
[sample]
stiffness = "30 N/m"
loss_tangent = 0.1
[drive]
frequency_ratio = 1.001
free_amplitude = "20 nm"
[gap]
tip = "15 nm"
"""
FREE = ["sample.stiffness", "gap.offset"]


@pytest.fixture(scope="module")
def curve() -> dict[str, np.ndarray]:
    """Amplitude and phase over the distance, without noise."""
    case = nanotap.Case.from_toml(LEVER)
    ds = nanotap.approach(case, from_="18 nm", to="4 nm", points=8, branches=False).sel(
        way="approach"
    )
    return {
        "distance (nm)": 1e9 * ds.zc.values,
        "amplitude (nm)": 1e9 * ds.physical_A.values,
        "phase (deg)": ds.phase.values,
    }


def test_exact_data_give_the_exact_values(curve: dict[str, np.ndarray]) -> None:
    case = nanotap.Case.from_toml(LEVER.replace("30 N/m", "24 N/m"))
    found = nanotap.fit(case, data=curve, free=FREE)
    assert found.fits
    assert found.best["sample.stiffness"] == pytest.approx(30, rel=1e-5)
    assert abs(found.best["gap.offset"]) < 1e-12
    assert set(found.errors) == set(FREE)
    assert found.best_case() is not None
    again = pickle.loads(pickle.dumps(found))
    assert again.best == found.best


def test_frames_datasets_and_files_are_tables(
    curve: dict[str, np.ndarray], tmp_path: object
) -> None:
    pandas = pytest.importorskip("pandas")
    xarray = pytest.importorskip("xarray")
    case = nanotap.Case.from_toml(LEVER)
    frame = pandas.DataFrame(curve)
    path = f"{tmp_path}/curve.csv"
    frame.to_csv(path, index=False)
    names = {"distance": "nm", "amplitude": "nm", "phase": "deg"}
    columns = {
        name: ("distance", curve[f"{name} ({unit})"], {"units": unit})
        for name, unit in names.items()
    }
    distance = columns.pop("distance")
    dataset = xarray.Dataset(columns, {"distance": distance})
    values = [
        nanotap.fit(case, data=data, free=FREE, profile=False).best
        for data in (curve, frame, path, dataset)
    ]
    for other in values[1:]:
        assert other["sample.stiffness"] == pytest.approx(
            values[0]["sample.stiffness"], rel=1e-9
        )


def test_what_is_no_table_is_refused(curve: dict[str, np.ndarray]) -> None:
    case = nanotap.Case.from_toml(LEVER)
    with pytest.raises(TypeError, match="data"):
        nanotap.fit(case, free=FREE)
    with pytest.raises(ValueError, match="amplitudo"):
        wrong = {**curve, "amplitudo (nm)": curve["amplitude (nm)"]}
        nanotap.fit(case, data=wrong, free=FREE)
    with pytest.raises(ValueError, match=r"sample\.stifness"):
        nanotap.fit(case, data=curve, free="sample.stifness")


def test_laws_are_compared(curve: dict[str, np.ndarray]) -> None:
    case = nanotap.Case.from_toml(LEVER.replace("30 N/m", "24 N/m"))
    laws = ["spring-damper", "kelvin-voigt"]
    found = nanotap.fit(case, data=curve, free=FREE, laws=laws, profile=False)
    assert found.law == "spring-damper"
    table = found.compared()
    assert list(table.index) == laws and table.above_best["spring-damper"] == 0
    assert table.weight.sum() == pytest.approx(1)
    assert nanotap.fit(case, data=curve, free=FREE, profile=False).compared().empty


def test_each_curve_has_its_case(curve: dict[str, np.ndarray]) -> None:
    case = nanotap.Case.from_toml(LEVER)
    shifted = {**curve, "distance (nm)": curve["distance (nm)"] + 0.2}
    found = nanotap.fit(
        case,
        data={"one": curve, "two": shifted},
        free="sample.stiffness",
        per_curve=["cantilever.Q", "gap.offset"],
        profile=False,
    )
    assert found.best["gap.offset of two"] == pytest.approx(-2e-10, rel=1e-3)
    best = found.best_case("two")
    assert best.physical is not None
    assert best.physical.Q == pytest.approx(found.best["cantilever.Q of two"])
    with pytest.raises(KeyError):
        found.best_case("three")
