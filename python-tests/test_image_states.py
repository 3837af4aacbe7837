"""`nanotap.image_states`: images of a scan as a Dataset, a dataset on disk, arrays and a file."""

import json
from pathlib import Path

import nanotap
import numpy as np
import pytest

CASES = Path(__file__).parent.parent / "docs" / "cases"


@pytest.fixture(scope="module")
def case():
    return nanotap.Case.from_file(CASES / "scan-plateaus.toml")


@pytest.fixture(scope="module")
def scanned(case):
    return nanotap.scan(case, lines=2, progress=False)


@pytest.fixture(scope="module")
def found(case, scanned):
    return nanotap.image_states(case, data=scanned, progress=False)


def test_the_states_are_those_of_the_scan(scanned, found):
    # The lines of an image begin at the top.
    assert found.y.values[0] > found.y.values[-1]
    np.testing.assert_allclose(found.y.values[::-1], scanned.y.values)
    np.testing.assert_allclose(found.x.values, scanned.x.values)
    truth = scanned.sel(direction="trace").state.values[::-1]
    states = found.state.values
    decided = states != "undecided"
    assert decided.mean() > 0.85
    assert (states[decided] == truth[decided]).mean() > 0.99
    assert found.state.dims == ("y", "x")
    assert found.corrected.attrs["units"] == "m"
    steps = json.loads(found.attrs["steps"])
    assert {(step["from"], step["to"]) for step in steps} == {
        ("attractive", "repulsive"),
        ("repulsive", "attractive"),
    }


def test_heights_come_nearer_to_the_surface(scanned, found):
    surface = scanned.sel(direction="trace").surface.values[::-1]
    contact = found.state.isin(["attractive", "repulsive"]).values

    def spread(height):
        return (height.values - surface)[contact].std()

    assert spread(found.corrected) < 0.25 * spread(found.height)


def test_arrays_and_datasets_on_disk_give_the_same(case, scanned, found, tmp_path):
    trace = scanned.sel(direction="trace")
    image = {
        "height (nm)": 1e9 * trace.height.values[::-1],
        "amplitude error (nm)": 1e9 * trace.amplitude_error.values[::-1],
        "phase (deg)": np.ma.masked_invalid(trace.phase.values[::-1]),
    }
    given = {"phase_offset": 0, "sense": "lag", "progress": False}
    arrays = nanotap.image_states(case, data=image, **given)
    assert (arrays.state.values == found.state.values).all()
    path = tmp_path / "scan.zarr"
    nanotap.scan(case, lines=2, out=path, progress=False)
    on_disk = nanotap.image_states(case, data=path, progress=False)
    assert (on_disk.state.values == found.state.values).all()
    retrace = nanotap.image_states(
        case,
        data=scanned.drop_sel(direction="trace"),
        direction="retrace",
        progress=False,
    )
    assert retrace.attrs["phase_channel"] == "retrace phase"


def test_bad_images_are_refused(case):
    lines = np.full((2, 3), 115.0)
    with pytest.raises(ValueError, match="the same in all pixels"):
        nanotap.image_states(case, data={"phase (deg)": lines}, progress=False)
    with pytest.raises(ValueError, match="1 dimensions"):
        nanotap.image_states(case, data={"phase (deg)": lines[0]}, progress=False)
    with pytest.raises(TypeError, match="an image is needed"):
        nanotap.image_states(case, progress=False)
    with pytest.raises(TypeError, match="expected a file"):
        nanotap.image_states(case, data=3, progress=False)


def test_the_figure_is_drawn(found, tmp_path):
    found.plot().savefig(tmp_path / "states.png")
    assert (tmp_path / "states.png").stat().st_size > 1000
