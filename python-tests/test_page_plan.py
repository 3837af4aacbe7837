"""The view Plan, compared with the terminal's results."""

from __future__ import annotations

import itertools
import json
import math
import re
import urllib.parse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browsers import WAIT, Answers, asked, case_file, limited, printed
from test_page_numbers import german_is_english
from test_page_states import until

WISHES = {"force": "1.6 nN", "want": "one", "points": "256", "step": "10 nm"}
CASE = {"preset": "dmt", "set": ["drive.setpoint=0.8"]}
# A wish that nothing meets.
HARD = "&plan.force=0.2&plan.want=tap"


def terminal(command: str, path: Path, *words: str) -> dict[str, Any]:
    return printed(path.parent, command, path.name, *words)


def settings(point: dict[str, Any]) -> list[str]:
    """The terminal's options for the free amplitude and the setpoint of a point."""
    pairs = [("free_amplitude", point["free"]), ("setpoint", point["setpoint"])]
    return [word for key, text in pairs for word in ("--set", f"drive.{key}={text}")]


@pytest.fixture(scope="module")
def answers(address: str) -> Answers:
    return Answers(address)


def planned(answers: Answers, **wishes: str) -> list[dict[str, Any]]:
    """What the program says of the map, stage by stage; the page gets the same if it asks the same."""
    body = {"case": CASE, "tab": "wishes", "options": {**WISHES, **wishes}}
    stages = [json.loads(line) for line in answers.to("/api/study", body).splitlines()]
    return [stage["clicks"]["plan"] for stage in stages if "clicks" in stage]


@pytest.fixture(scope="module")
def stages(answers: Answers) -> list[dict[str, Any]]:
    return planned(answers)


@pytest.fixture(autouse=True)
def _limit() -> Iterator[None]:
    with limited():
        yield


@pytest.fixture(scope="module")
def page(browser: Any, answers: Answers, stages: list[dict[str, Any]]) -> Any:
    page = browser.new_page(viewport={"width": 1440, "height": 900})
    page.set_default_timeout(1000 * WAIT)
    answers.given(page, "/api/study", new=lambda body: body["tab"] == "levers")
    page.complaints = []
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    return page


def view(page: Any, address: str, fragment: str = "") -> None:
    page.goto("about:blank")
    page.goto(f"{address}#preset=dmt&set.drive.setpoint=0.8&view=plan{fragment}")
    page.wait_for_selector("#view-plan[data-plan=done]")
    # The lists have their values once the case is known.
    page.wait_for_selector("#plan-lever option:nth-child(9)", state="attached")


@pytest.fixture
def case(address: str, tmp_path: Path) -> Path:
    path = tmp_path / "case.toml"
    path.write_text(case_file(address, CASE))
    return path


def test_an_offered_point_has_the_terminals_numbers(
    stages: list[dict[str, Any]], case: Path
) -> None:
    plan = stages[-1]
    assert (plan["known"], plan["of"]) == (153, 153)
    best = plan["points"][plan["best"][0]]
    found = terminal("attractors", case, *settings(best))
    assert [one["stable"] for one in found["attractors"]] == [True]
    assert best["states"] == 1
    (state,) = best["motions"]
    numbers = found["attractors"][0]["physical"]
    # The point is within the wish, by the force of the terminal.
    assert numbers["F_max"] <= 1.6e-9
    assert best["force"]["value"] == pytest.approx(numbers["F_max"], rel=1e-6)
    assert best["phase"] == pytest.approx(numbers["phase"], abs=1e-5)
    assert state["amplitude"] == pytest.approx(numbers["A"], rel=1e-6)
    orbit = terminal("orbit", case, *settings(best))
    distance = orbit["case"]["physical"]["tip_gap"]
    assert best["distance"]["value"] == pytest.approx(distance, rel=1e-6)
    assert best["force"]["value"] == pytest.approx(orbit["physical"]["F_max"], rel=1e-6)


def test_where_one_state_is_offered_the_terminal_finds_one(
    stages: list[dict[str, Any]], case: Path
) -> None:
    offered = stages[-1]["best"]
    assert len(offered) > 1
    for point in (stages[-1]["points"][k] for k in offered):
        found = terminal("attractors", case, *settings(point))["attractors"]
        assert len(found) == 1, point["shown"]
        assert found[0]["physical"]["F_max"] <= 1.6e-9


def test_two_states_press_as_the_harder_of_the_terminals(
    stages: list[dict[str, Any]], case: Path
) -> None:
    points = stages[1]["points"]
    (here,) = [p for p in points if (p["free"], p["setpoint"]) == ("20 nm", "0.8")]
    found = terminal("attractors", case, *settings(here))["attractors"]
    assert here["states"] == len(found) == 2
    forces = [one["physical"]["F_max"] for one in found]
    assert here["force"]["value"] == pytest.approx(max(forces), rel=1e-6)
    assert not here["kind"]


def test_points_of_a_stage_keep_their_numbers_in_the_next(
    stages: list[dict[str, Any]],
) -> None:
    for coarse, fine in itertools.pairwise(stages):
        finer = {(p["free"], p["setpoint"]): p for p in fine["points"]}
        for point in coarse["points"]:
            again = finer[point["free"], point["setpoint"]]
            assert again["distance"]["value"] == pytest.approx(
                point["distance"]["value"], rel=1e-6
            )


def test_the_lines_a_second_follow_from_lever_gain_and_step(
    stages: list[dict[str, Any]],
    address: str,
) -> None:
    best = stages[-1]["points"][stages[-1]["best"][0]]
    free, setpoint = best["at"]
    constant = 200 / (math.pi * 100e3)
    # The gain is half the lever's rate; a falling step leaves the lever free.
    gain = 0.5 / constant
    longest = 10e-9 / (gain * free * (1 - setpoint))
    assert longest > constant
    assert best["lines"]["limit"] == "gain"
    assert float(best["lines"]["rate"]) == pytest.approx(1 / (512 * longest), rel=5e-3)
    options = {**WISHES, "step": "0 nm"}
    body = {"case": CASE, "tab": "wishes", "options": options, "quick": True}
    lines = asked(address, "/api/study", body).splitlines()
    flat = json.loads(lines[-1])["clicks"]["plan"]["points"][0]["lines"]
    assert flat["limit"] == "lever"
    assert float(flat["rate"]) == pytest.approx(1 / (512 * constant), rel=5e-3)


def test_the_notebooks_line_is_of_the_offered_point(
    stages: list[dict[str, Any]],
    page: Any,
    address: str,
) -> None:
    view(page, address)
    best = stages[-1]["points"][stages[-1]["best"][0]]
    line = page.text_content("#plan-line")
    assert line == best["line"]
    heading = page.text_content("#plan-head")
    assert heading == (
        f"Free amplitude {best['shown']['free']}, setpoint {best['shown']['setpoint']}"
    )
    _, law, drive, state, lines, version = line.split(" | ")
    assert line.startswith("k 874 mN/m, f0 100 kHz, Q 200, R 5 nm | ")
    assert law == "DMT, 1 GPa"
    assert drive.startswith(f"A0 {best['shown']['free']}, setpoint ")
    phase = re.search(r"phase lag ([\d.]+) deg", state)
    assert phase is not None
    assert float(phase[1]) == pytest.approx(best["phase"], abs=0.051)
    assert best["force"]["shown"] in state
    assert best["distance"]["shown"] in state
    assert lines == f"<= {best['lines']['rate']} lines/s at 256 px"
    assert re.fullmatch(r"nanotap [\d.]+\S*, case [0-9a-f]{4}", version)
    assert best["force"]["shown"] in page.text_content("#plan-say")
    assert not page.complaints


def test_a_wish_that_nothing_meets_has_its_nearest(
    page: Any,
    address: str,
    answers: Answers,
) -> None:
    plan = planned(answers, force="0.2 nN", want="tap")[-1]
    assert plan["best"] == []
    fails = plan["fails"]
    tapping = [p for p in plan["points"] if p.get("force") and p["kind"]]
    least = min(tapping, key=lambda point: point["force"]["value"])
    gentlest = plan["points"][fails["gentlest"]]
    assert gentlest["force"]["value"] == least["force"]["value"] > 0.2e-9
    view(page, address, HARD)
    assert page.text_content("#plan-head") == "Nothing here meets your wishes"
    assert least["force"]["shown"] in page.text_content("#plan-say")
    assert page.is_hidden("#plan-line")
    # Which lever would do: the best of the table comes first.
    page.wait_for_selector("#plan-levers tbody tr")


def test_a_changed_wish_strikes_the_answer_through_until_it_is_found_again(
    page: Any,
    address: str,
) -> None:
    view(page, address)
    page.fill("#plan-force", "3,5")
    page.press("#plan-force", "Enter")
    page.wait_for_selector("#plan-say.former")
    assert "stale" in page.get_attribute("#plan-map", "class")
    assert page.is_disabled("#plan-show")
    page.wait_for_selector("#plan-say:not(.former)")
    assert "3.5 nN" in page.text_content("#plan-say")
    assert "so far" in page.text_content("#plan-far").lower()
    page.fill("#plan-force", "soft")
    page.press("#plan-force", "Enter")
    page.wait_for_selector("#plan-wrong:not(:empty)")


def test_its_states_are_shown_with_its_values(
    stages: list[dict[str, Any]],
    page: Any,
    address: str,
) -> None:
    best = stages[-1]["points"][stages[-1]["best"][0]]
    view(page, address)
    page.click("#plan-show")
    page.wait_for_selector("body[data-view=states][data-rows=done]")
    given = urllib.parse.parse_qs(urllib.parse.urlsplit(page.url).fragment)
    assert given["set.drive.free_amplitude"] == [best["free"]]
    assert page.text_content("#states-heading") == "States at this setpoint: one"
    row = page.text_content("#rows tbody tr")
    assert best["distance"]["shown"] in row
    # The way back is the plan.
    page.click("#undo")
    page.wait_for_selector("body[data-view=plan]")


def test_a_lever_of_the_table_is_taken(page: Any, address: str) -> None:
    view(page, address, HARD)
    page.select_option("#plan-lever", label="I have no lever yet")
    page.wait_for_selector("#plan-levers tbody tr")
    name = page.text_content("#plan-levers tbody tr button")
    page.click("#plan-levers tbody tr button")
    page.wait_for_selector("#notice:not([hidden])")
    assert page.text_content("#notice p").startswith(f"{name}: ")
    assert page.is_hidden("#plan-levers")
    assert f"set.cantilever.lever={name}" in urllib.parse.unquote_plus(page.url)
    page.click("#take-back")
    until(page, lambda: "cantilever.lever" not in page.url)


def test_german_numbers_of_the_plan_are_the_english_ones(
    page: Any, address: str
) -> None:
    # Wherever a number with decimals is: with the answers of the map that was shown.
    german_is_english(page, address, "plan", "preset=dmt&set.drive.setpoint=0.8")
