"""Signals of one shot."""

from pathlib import Path

import nanotap
import numpy as np
import pytest

LEVER = Path(__file__).parent.parent / "docs" / "cases" / "bistable-lever.toml"


def pulse(t: np.ndarray) -> np.ndarray:
    """A Gaussian of one microsecond, 400 times the drive, over time in s."""
    sigma = 1e-6 / (2 * np.sqrt(2 * np.log(2)))
    return 400 * np.exp(-0.5 * (t / sigma - 8.5) ** 2)


def test_a_pulse_is_that_of_the_documents_and_of_its_table(tmp_path: Path) -> None:
    case = nanotap.Case.from_file(LEVER).with_(**{"gap.tip": 3e-9})
    run = nanotap.simulate(case, drive_signal="pulse 1us times 400", periods=10)
    # The numbers of docs/cases/one-shot.md, of which SciPy gives the same digits.
    assert run.classification.item() == "transient"
    assert run.first_contact.item() == pytest.approx(1.70382362, abs=1e-7)
    assert run.peak_force.item() == pytest.approx(2.19725636e-6, rel=1e-6)
    # The series has the whole run, and the extremes lie in it.
    assert run.tip.sizes["tau"] == 2471
    assert float(run.tip.max()) == pytest.approx(run.tip_max.item(), rel=1e-3)
    end = 17 * 1e-6 / (2 * np.sqrt(2 * np.log(2)))
    t = np.linspace(0, end, 2001)
    table = {"time (us)": 1e6 * t, "drive": pulse(t)}
    path = tmp_path / "pulse.csv"
    rows = np.column_stack([1e6 * t, pulse(t)])
    np.savetxt(
        path, rows, delimiter=",", header="time (us),drive", comments="", fmt="%.17g"
    )
    for signal in (table, str(path), path):
        other = nanotap.simulate(case, drive_signal=signal, periods=10)
        assert other.peak_force.item() == pytest.approx(run.peak_force.item(), rel=1e-7)
        assert other.first_contact.item() == pytest.approx(
            run.first_contact.item(), rel=1e-9
        )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"drive_signal": "pulse"}, "full width at half maximum"),
        ({"drive_signal": "pulse 0"}, "above 0"),
        ({"drive_signal": "nothing.csv"}, "neither a signal nor a file"),
        ({"drive_signal": "pulse 1us", "strobe": 3}, "one shot"),
        (
            {"drive_signal": {"time": [0, 1, 2, 3], "drive": [1, 0, 0, 0]}},
            "begins at 1",
        ),
        ({"drive_signal": {"time": [0, 1, 1, 3], "drive": [0, 1, 1, 0]}}, "increase"),
        ({"drive_signal": {"time": [0, 1, 2, 3], "drive": [0, 0, 0, 0]}}, "everywhere"),
    ],
)
def test_what_is_no_signal_is_refused(options: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        nanotap.simulate(nanotap.Case.from_file(LEVER), **options)
