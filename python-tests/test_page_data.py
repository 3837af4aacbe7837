"""The page's view of measured data: calibration of a lever, compared with the terminal's."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browsers import printed, until

SPECTRUM = Path(__file__).parent.parent / "docs/cases/thermal-spectrum.csv"
PREFIXES = {"n": 1e-9, "µ": 1e-6, "m": 1e-3, "": 1, "k": 1e3}


def opened(page: Any, address: str, path: Path) -> None:
    page.goto("about:blank")
    page.goto(f"{address}#view=data&preset=dmt&set.drive.setpoint=0.8")
    page.set_input_files("#study-form input[type=file]", path)
    page.wait_for_selector("#tables tbody tr")


def estimates(page: Any) -> dict[str, list[float]]:
    """The rows of the calibration: value, relative error and interval, in SI."""
    read = {}
    for row in page.locator("#tables tbody tr").all():
        name, value, error, interval = row.locator("th, td").all_inner_texts()
        texts = [value, *interval.split(" to ")]
        numbers = [re.match(r"([\d.]+) ?([nµmk]?)", text) for text in texts]
        value, low, high = (float(m[1]) * PREFIXES[m[2]] for m in numbers if m)
        read[name] = [value, float(error.removesuffix(" %")) / 100, low, high]
    return read


def shown_as_printed(page: Any, folder: Path, *options: str) -> None:
    name = page.text_content("#study-command").split()[2]
    found = printed(folder, "calibrate", name, *options)
    read = estimates(page)
    rows = {
        "resonance f0": "frequency",
        "quality factor Q": "quality",
        "spring constant k": "stiffness",
        "sensitivity (InvOLS)": "sensitivity",
    }
    for row, key in rows.items():
        assert (row in read) == (found[key] is not None), row
        if row in read:
            expected = [
                found[key]["value"],
                found[key]["relative_error"],
                *found[key]["interval"],
            ]
            value, error, low, high = read[row]
            assert value == pytest.approx(expected[0], rel=1e-3), row
            assert error == pytest.approx(expected[1], rel=0.06), row
            assert [low, high] == pytest.approx(expected[2:], rel=1e-3), row
    for warning in found["warnings"]:
        assert warning in page.inner_text("#progress")


def test_a_thermal_spectrum_calibrates_the_lever(
    page: Any, address: str, tmp_path: Path
) -> None:
    shutil.copy(SPECTRUM, tmp_path)
    opened(page, address, SPECTRUM)
    shown_as_printed(page, tmp_path)
    # Measured and fitted density, and their ratio.
    figure = "document.getElementById('study-figure').figure"
    assert page.evaluate(f"{figure}.panels.length") == 2
    # Without a sensitivity there is no spring constant: with it there is one.
    page.fill("#study-form [name=sensitivity]", "62 nm/V")
    page.press("#study-form [name=sensitivity]", "Enter")
    until(page, lambda: "spring constant k" in page.inner_text("#tables"))
    shown_as_printed(page, tmp_path, "--sensitivity", "62 nm/V")
    assert "--sensitivity='62 nm/V'" in page.text_content("#study-command")
    # The lever of the synthetic spectrum: 2.8 N/m at 75 kHz.
    _, _, low, high = estimates(page)["spring constant k"]
    assert low < 2.8 < high
    # The case takes the values, and the drive follows the resonance.
    page.click("#tables button:has-text('Use these values')")
    until(page, lambda: "set.cantilever.k=" in page.url)
    until(
        page, lambda: page.input_value("[data-key='drive.frequency']") == "75.0072 kHz"
    )
    assert page.is_hidden("#message")
    # It is not of the case: other values do not make it stale.
    assert page.is_hidden("#stale")


def test_sader_gives_the_sensitivity(page: Any, address: str, tmp_path: Path) -> None:
    shutil.copy(SPECTRUM, tmp_path)
    opened(page, address, SPECTRUM)
    page.fill("#study-form [name=length]", "225 um")
    page.fill("#study-form [name=width]", "36 um")
    page.press("#study-form [name=width]", "Enter")
    until(page, lambda: "InvOLS" in page.inner_text("#tables"))
    shown_as_printed(page, tmp_path, "--length", "225 um", "--width", "36 um")


def test_a_record_of_noise_calibrates_the_lever(
    page: Any, address: str, tmp_path: Path
) -> None:
    # A lever of 10 kHz, Q = 20, sampled at 100 kHz: noise through a resonant filter.
    rate, f0, quality = 1e5, 1e4, 20.0
    phase = 2 * np.pi * f0 / rate
    decay = np.exp(-phase / (2 * quality))
    noise = np.random.default_rng(7).normal(0, 1e-2, 1 << 15)
    turn = phase * np.sqrt(1 - 1 / (4 * quality**2))
    record = [0.0, 0.0]
    for force in noise:
        record.append(
            2 * decay * np.cos(turn) * record[-1] - decay**2 * record[-2] + force
        )
    path = tmp_path / "noise.csv"
    rows = "".join(f"{k / rate:.5e},{value:.6e}\n" for k, value in enumerate(record))
    path.write_text(f"time (s),deflection (nm)\n{rows}")
    opened(page, address, path)
    shown_as_printed(page, tmp_path)
    assert estimates(page)["resonance f0"][0] == pytest.approx(f0, rel=0.01)
    # A curve that is opened next has its own form again.
    page.set_input_files(
        "#study-form input[type=file]", SPECTRUM.parent / "polystyrene-curve.csv"
    )
    page.wait_for_selector("#fit")
    until(page, lambda: "rows" in page.inner_text("#progress"))
    # A curve has no noise to calibrate from.
    page.click("#calibrate")
    until(page, lambda: "rate" in page.inner_text("#progress"))
    assert page.is_visible("#fit")
