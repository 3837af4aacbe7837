"""Values of physical keys: numbers in SI, texts with units, quantities of other packages."""

import nanotap
import numpy as np
import pytest
from conftest import PHYSICAL
from nanotap import _arguments


class Nanometres:
    """Like a pint quantity: a magnitude, and `to` another unit."""

    def __init__(self, magnitude):
        self.magnitude = magnitude

    def to(self, unit):
        if unit != "m":
            raise ValueError(f"nm is no {unit}")
        return Nanometres(1e-9 * np.asarray(self.magnitude))


def gap(value):
    case = nanotap.Case(**PHYSICAL).with_(**{"gap.tip": value, "gap.beam": "12 um"})
    return case.alpha5


def test_one_value_may_be_a_text_a_number_in_si_or_a_quantity():
    for value in (9e-9, np.float64(9e-9), Nanometres(9.0)):
        assert gap(value) == pytest.approx(gap("9 nm"), rel=1e-15)
    with pytest.raises(ValueError, match=r"drive\.frequency.*nm is no Hz"):
        nanotap.Case(**PHYSICAL).with_(**{"drive.frequency": Nanometres(3.0)})


def test_arrays_likewise():
    case = nanotap.Case(**PHYSICAL).with_(**{"drive.frequency": 75e3})
    distances = [8e-9, 9e-9]
    of = [
        nanotap.orbit(case, **{"gap.tip": values})
        for values in (
            ["8 nm", "9 nm"],
            distances,
            np.array(distances),
            Nanometres([8.0, 9.0]),
        )
    ]
    for ds in of[1:]:
        assert ds["gap.tip"].attrs["units"] == "m"
        np.testing.assert_allclose(
            ds.amplitude.values, of[0].amplitude.values, rtol=1e-9
        )


def test_axes_of_sweeps_likewise():
    frequencies = np.linspace(60e3, 70e3, 3)
    expected = "drive.frequency=60000.0 Hz:70000.0 Hz:3"
    assert _arguments.axis("drive.frequency", frequencies) == expected
    assert _arguments.axis("gap.tip", ["8 nm", "9 nm"]) == "gap.tip=8 nm,9 nm"
    assert _arguments.axis("gap.tip", (8e-9, 9e-9, 2)) == "gap.tip=8e-09 m:9e-09 m:2"
    assert _arguments.axis("omega", [2, 2.5, 4]) == "omega=2.0,2.5,4.0"


def test_cases_with_different_numbers_of_modes_have_room_for_all_states():
    case = nanotap.Case(
        alpha1=0.1, alpha2=0.1, alpha3=0.1, alpha4=20.0, alpha6=0.2, omega=3.0
    )
    ds = nanotap.orbit(case, modes=[1, 2])
    assert list(ds.state.values) == ["a1", "a2", "v1", "v2"]
    one, two = ds.orbit_state.values
    assert np.isfinite(two).all()
    assert np.isnan(one[[1, 3]]).all() and np.isfinite(one[[0, 2]]).all()


def test_what_a_case_says_makes_it_again():
    case = nanotap.Case.paper(omega=3.0)
    assert nanotap.Case(**case.to_dict()) == case
    with pytest.raises(AttributeError, match="with_"):
        case.omega = 4.0
