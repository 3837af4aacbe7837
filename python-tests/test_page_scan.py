"""The view Scan in a real browser, compared with the terminal's scan."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browsers import WAIT, case_file, printed

# What the page proposes for the DMT lever: 5000 drive periods a line, half the lever's rate.
STEP = """
[scan]
size = "500 nm"
line_rate = "10 Hz"
setpoint = 0.8
integral_gain = 785
surface = [{ step = { from = "125 nm", to = "325 nm", height = "10 nm" } }]
"""
DMT = "view=scan&preset=dmt"


@pytest.fixture(scope="module")
def page(browser: Any) -> Any:
    page = browser.new_page(viewport={"width": 1440, "height": 1000})
    page.set_default_timeout(1000 * WAIT)
    return page


def terminal(file: str, folder: Path, **changes: str) -> dict[str, Any]:
    """The scan of a case file, one line, at the terminal."""
    (folder / "case.toml").write_text(file)
    words = [f"--{name.replace('_', '-')}={text}" for name, text in changes.items()]
    return printed(folder, "scan", "case.toml", "--lines=1", *words)


def shown(page: Any, address: str, fragment: str) -> dict[str, Any]:
    """Opens the view, and waits for its exact line."""
    page.goto("about:blank")
    page.goto(f"{address}#{fragment}")
    return exact(page)


def exact(page: Any) -> dict[str, Any]:
    page.wait_for_selector("#strips[data-line=exact]")
    return page.evaluate("document.getElementById('strips').line")


def sentence(page: Any) -> str:
    return page.inner_text("#scan-say")


def expected(report: dict[str, Any], direction: str) -> dict[str, Any]:
    image = report[direction]
    error = np.array(image["amplitude_error"][0], dtype=float)
    amplitude = error + report["setpoint_amplitude"]
    mean = np.array(image["mean_deflection"][0], dtype=float)
    return {
        "surface": image["surface"][0],
        "height": image["height"][0],
        "phase": image["phase"][0],
        "force": image["peak_force_max"][0],
        "amplitude": amplitude,
        "low": mean - amplitude,
        "high": mean + amplitude,
    }


def same(line: dict[str, Any], report: dict[str, Any]) -> None:
    for direction in ("trace", "retrace"):
        for name, values in expected(report, direction).items():
            np.testing.assert_allclose(
                line[direction][name], values, rtol=1e-12, atol=1e-21, err_msg=name
            )
        assert line[direction]["state"] == report[direction]["state"][0]


def percent(share: float) -> str:
    return f"{float(f'{100 * share:.2g}'):g} %"


def test_the_strips_of_the_patch_are_the_terminals(
    page: Any, address: str, tmp_path: Path
) -> None:
    line = shown(page, address, "view=scan&preset=patch")
    report = terminal(case_file(address, {"preset": "patch"}), tmp_path)
    same(line, report)
    # The curves are drawn of these numbers.
    drawn = page.evaluate(
        """() => document.getElementById('strips').figure.panels.map(({ layers }) =>
        layers.filter((one) => one.kind === 'line').map((one) => one.points.y))"""
    )
    amplitude = expected(report, "trace")["amplitude"]
    np.testing.assert_allclose(drawn[2][0], 1e9 * amplitude, rtol=1e-12)
    height = np.array(report["trace"]["height"][0])
    # In pm: the surface is flat, and the image shows less than 2 nm.
    picture = 1e12 * (height - line["level"])
    np.testing.assert_allclose(drawn[4][0], picture, rtol=1e-9, atol=1e-9)


def test_the_sentence_of_the_patch_names_the_change_of_state(
    page: Any, address: str, tmp_path: Path
) -> None:
    shown(page, address, "view=scan&preset=patch")
    report = terminal(case_file(address, {"preset": "patch"}), tmp_path)
    (change,) = report["branch_changes"]
    words = sentence(page)
    assert "feedback lags" not in words
    place = f"{1e9 * change['x']:.3g} nm (trace)"
    assert f"from the {change['from']} to the {change['to']} state at {place}" in words
    # The shift is the difference of the two states' distances, nothing that the image shows.
    shift = abs(change["distance_to"] - change["distance_from"])
    assert f"shifts the height by {1e12 * shift:.3g} pm" in words
    gain = report["integral_gain"] / report["loop"]["largest_stable_gain"]
    assert f"you are at {percent(gain)} of that" in words


def test_a_step_lags_and_is_no_change_of_state(
    page: Any, address: str, tmp_path: Path
) -> None:
    # Without attraction there is one state.
    line = shown(page, address, "view=scan&preset=hertz&study.setpoint=0.8")
    report = terminal(case_file(address, {"preset": "hertz"}) + STEP, tmp_path)
    same(line, report)
    off = [part for one in report["lines"] for part in one["off_setpoint"]]
    share = sum(part["periods"] for part in off) / (2 * report["periods_per_line"])
    words = sentence(page)
    assert f"off its setpoint over {percent(share)} of the line" in words
    assert report["branch_changes"] == [] and "keeps its state" in words
    gain = report["integral_gain"] / report["loop"]["largest_stable_gain"]
    assert f"you are at {percent(gain)} of that" in words


def test_a_step_may_throw_the_lever_into_the_other_state(
    page: Any, address: str, tmp_path: Path
) -> None:
    # It comes from far in attraction, and the rising edge presses it out of that state.
    line = shown(page, address, DMT)
    report = terminal(case_file(address, {"preset": "dmt"}) + STEP, tmp_path)
    same(line, report)
    assert line["trace"]["state"][0] == "attractive"
    (change,) = report["branch_changes"]
    assert 125e-9 < change["x"] < 325e-9
    place = f"{1e9 * change['x']:.3g} nm (trace)"
    assert f"from the attractive to the repulsive state at {place}" in sentence(page)


def test_above_the_largest_gain_the_loop_rings(page: Any, address: str) -> None:
    line = shown(page, address, f"{DMT}&study.gain=6000&study.surface=flat")
    assert line["rings"]["multiplier"] > 1
    assert "The loop rings: its gain of 6000/s is above" in sentence(page)


def test_a_dragged_knob_answers_by_averaging_then_exactly(
    page: Any, address: str, tmp_path: Path
) -> None:
    shown(page, address, DMT)
    before = page.input_value("#scan-gain")
    seen: list[str] = []
    slider = page.locator("#scan-gain-slider")
    slider.evaluate(
        "(one) => { one.value = 560; one.dispatchEvent(new Event('input')); }"
    )
    # What is shown is grey, and of the former gain, until the averaged line is there.
    seen.append(page.inner_text("#scan-state"))
    page.wait_for_selector("#strips[data-line=approximate]")
    assert page.inner_text("#scan-state").startswith("≈")
    assert sentence(page).startswith("≈")
    near = page.evaluate("document.getElementById('strips').line")
    slider.evaluate("(one) => one.dispatchEvent(new Event('change'))")
    line = exact(page)
    gain = page.input_value("#scan-gain")
    assert gain != before and f"gain (1/s) {before}" in seen[0]
    assert f"study.gain={gain}" in page.url
    file = case_file(address, {"preset": "dmt"}) + STEP
    same(line, terminal(file, tmp_path, integral_gain=gain))
    # The averaged lever has the exact one's memory: the heights differ by a fraction of the step.
    for direction in ("trace", "retrace"):
        ours, theirs = (np.array(one[direction]["height"]) for one in (near, line))
        assert np.sqrt(np.mean((ours - theirs) ** 2)) < 0.1 * 10e-9


def test_trace_and_retrace_are_toggles(page: Any, address: str) -> None:
    shown(page, address, DMT)

    def curves() -> int:
        return page.evaluate(
            """() => document.getElementById('strips').figure.panels[4].layers
            .filter((one) => one.kind === 'line').length"""
        )

    assert curves() == 2
    page.uncheck("#scan-retrace")
    assert curves() == 1
    # One of both is always shown.
    page.uncheck("#scan-trace")
    assert page.is_checked("#scan-retrace") and curves() == 1
    page.check("#scan-trace")


def test_a_click_on_a_strip_shows_the_states_there(page: Any, address: str) -> None:
    line = shown(page, address, DMT)
    page.locator("#strips").scroll_into_view_if_needed()
    box = page.locator("#strips").bounding_box()
    panel = page.evaluate("document.getElementById('strips').panels[4]")
    x = box["x"] + panel["left"] + 0.2 * panel["width"]
    page.mouse.click(x, box["y"] + panel["top"] + 0.5 * panel["height"])
    page.wait_for_selector("#view-states:not([hidden])")
    k = int(0.2 * len(line["x"]))
    gaps = np.array(line["trace"]["height"]) - np.array(line["trace"]["surface"])
    at = page.evaluate("new URLSearchParams(location.hash.slice(1)).get('set.gap.tip')")
    near = gaps[k - 1 : k + 2]
    # The distance has five digits.
    assert near.min() - 1e-12 <= 1e-9 * float(at.split()[0]) <= near.max() + 1e-12


@pytest.mark.parametrize("preset", ["paper", "impact"])
def test_only_a_lever_makes_images(page: Any, address: str, preset: str) -> None:
    page.goto("about:blank")
    page.goto(f"{address}#view=scan&preset={preset}")
    page.wait_for_selector("#strips[data-line=none]", state="attached")
    assert sentence(page).startswith("Only a lever makes images")
    assert page.is_hidden("#strips")


def test_a_wrong_value_is_said_in_place_of_the_sentence(
    page: Any, address: str
) -> None:
    shown(page, address, DMT)
    page.fill("#scan-size", "much")
    page.press("#scan-size", "Enter")
    page.wait_for_selector("#strips[data-line=failed]")
    assert "much" in sentence(page)
