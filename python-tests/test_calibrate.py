"""Thermal calibration: the closed form of equipartition, tables and files, and refusals."""

import inspect
import re
import subprocess
from pathlib import Path

import nanotap
import numpy as np
import pytest
from matplotlib.figure import Figure
from program import PROGRAM

CASES = Path(__file__).resolve().parent.parent / "docs" / "cases"
F0, Q, K = 75e3, 60.0, 2.8
# k = 0.817435 kB T/m (Butt and Jaschke 1995; Proksch et al. 2004).
MEAN_SQUARE = 0.8174348 * 1.380649e-23 * 298.15 / K


def density(frequency):
    """The one-sided power density of an oscillator over a white floor, m²/Hz."""
    r = frequency / F0
    peak = 2 * MEAN_SQUARE / (np.pi * F0 * Q)
    return peak * (1 / ((1 - r**2) ** 2 + (r / Q) ** 2) + 1e-3 * Q**2)


@pytest.fixture
def columns():
    frequency = np.arange(10e3, 200e3, 100)
    return {
        "frequency (kHz)": frequency / 1e3,
        "PSD (pm^2/Hz)": 1e24 * density(frequency),
    }


def test_a_table_has_the_stiffness_of_equipartition(columns):
    found = nanotap.calibrate(columns, averages=100, temperature=25)
    assert found.stiffness.value == pytest.approx(K, rel=1e-5)
    assert found.frequency.value == pytest.approx(F0, rel=1e-7)
    assert found.quality.value == pytest.approx(Q, rel=1e-5)
    low, high = found.stiffness.interval
    assert low < K < high
    assert found.factor.chi == pytest.approx(1.0897, abs=1e-4)
    assert found.cantilever.startswith("[cantilever]\nk = ")


def test_the_spectrum_is_a_table_and_a_figure(columns):
    found = nanotap.calibrate(columns, averages=100)
    table = found.to_dataframe()
    assert list(table) == ["frequency", "density", "fit", "ratio"]
    assert table.attrs["units"]["density"] == "m^2/Hz"
    np.testing.assert_allclose(table["density"], density(table["frequency"]), rtol=1e-9)
    np.testing.assert_allclose(table["ratio"], 1, rtol=1e-4)
    # The estimates are a table, too, each with its unit.
    rows = found.tables["estimates"].set_index("quantity")
    assert rows.loc["spring constant k", "value"] == found.stiffness.value
    assert rows.loc["spring constant k", "unit"] == "N/m"
    assert rows.loc["resonance f0", "low"] == found.frequency.interval[0]
    assert found.units["stiffness"] == "N/m"
    assert found.units["frequency"] == "Hz"
    assert isinstance(found.plot(), Figure)


def test_a_file_and_its_table_are_the_same():
    options = {
        "averages": 50,
        "sensitivity": "62 nm/V",
        "from_": "60 kHz",
        "to": "90 kHz",
    }
    file = CASES / "thermal-spectrum.csv"
    of_file = nanotap.calibrate(file, **options)
    of_table = nanotap.calibrate(nanotap.read(file), **options)
    assert of_file.stiffness == of_table.stiffness
    low, high = of_file.stiffness.interval
    # The lever of the synthetic spectrum.
    assert low < 2.8 < high
    assert any("82.00 kHz" in warning for warning in of_file.warnings)


def test_the_options_are_those_of_the_terminal():
    run = [PROGRAM, "calibrate", "--help"]
    text = subprocess.run(run, capture_output=True, text=True, check=True).stdout
    terminal = set(re.findall(r"^\s+(?:-\w, )?--([a-z-]+)", text, re.MULTILINE))
    terminal -= {"json", "quiet", "force", "out", "plot", "help"}
    data, *options = inspect.signature(nanotap.calibrate).parameters
    assert data == "data"
    assert {one.rstrip("_").replace("_", "-") for one in options} == terminal
    described = inspect.getdoc(nanotap.calibrate)
    assert all(f"    {one}: " in described for one in options)


def test_faulty_requests_are_refused(columns):
    with pytest.raises(ValueError, match="not that of a spectral density"):
        nanotap.calibrate(columns, unit="N")
    with pytest.raises(TypeError, match="sensitivty"):
        nanotap.calibrate(columns, sensitivty="40 nm/V")
    with pytest.raises(ValueError, match="neither a time nor a frequency"):
        nanotap.calibrate({"distance (nm)": [1.0, 2.0]})
    with pytest.raises(FileNotFoundError):
        nanotap.calibrate("none.tnd")
