"""The page's first view: the states at a setpoint, compared with the terminal's."""

from __future__ import annotations

import json
import re
import subprocess
import time
import urllib.parse
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browsers import WAIT, Answers, asked, case_file, printed
from program import PROGRAM

SIZES = [(1440, 900), (1280, 720), (390, 844)]
# Levers of the catalogue with a free amplitude and a setpoint that fit them.
LEVERS = [
    ("", "20 nm", "0.8"),
    ("PPP-NCHR", "30 nm", "0.7"),
    ("AC40TS", "10 nm", "0.85"),
]
# A quantity of a row, and its name among the solutions of a setpoint.
NUMBERS = {
    "distance": "zc",
    "phase": "phase",
    "force": "F_max",
    "indentation": "indentation",
}


def until(page: Any, ready: Callable[[], bool]) -> None:
    end = time.monotonic() + WAIT
    while time.monotonic() < end:
        if ready():
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"not ready after {WAIT} s: {shown(page)}")


def states(page: Any, address: str, fragment: str, wait: str = "rows") -> None:
    """Opens the view, and waits for its exact rows, or for the curve and the search, too."""
    page.goto("about:blank")
    page.goto(f"{address}#{fragment}")
    settled(page, wait)


# What the view computes beside its rows.
BESIDE = ("/api/curve", "/api/attractors", "/api/margins", "/api/knock")


@pytest.fixture
def rows_alone(page: Any) -> Iterator[None]:
    """Nothing beside the rows is computed: these requests stay without an answer."""
    for path in BESIDE:
        page.route(f"**{path}", lambda _: None)
    yield
    for path in BESIDE:
        page.unroute(f"**{path}")


def left(page: Any) -> None:
    """Ends what the view still computes: it would slow down what the terminal computes next."""
    page.goto("about:blank")


def settled(page: Any, wait: str = "rows") -> None:
    page.wait_for_selector("body[data-rows=done]")
    if wait == "all":
        until(
            page,
            lambda: (
                "Searched from" in page.inner_text("#sure")
                and page.get_attribute("body", "data-search") == "done"
                and page.get_attribute("body", "data-rows") == "done"
            ),
        )


def shown(page: Any) -> list[dict[str, Any]]:
    """The rows as the page shows them: their state, their numbers and their words."""
    rows = page.locator("#rows tbody tr").all()
    read = []
    for row in rows:
        values = {
            name: float(row.locator(f"td.{name}").get_attribute("data-value"))
            for name in (*NUMBERS, "amplitude")
            if row.locator(f"td.{name}").count()
        }
        texts = {
            cell.get_attribute("class"): cell.inner_text()
            for cell in row.locator("td").all()
        }
        read.append(
            {
                "state": row.get_attribute("data-state"),
                "stable": row.get_attribute("data-stable") == "true",
                "chosen": row.get_attribute("aria-selected") == "true",
                "values": values,
                "texts": texts,
            }
        )
    return read


def solved(address: str, case: dict[str, Any], folder: Path) -> list[dict[str, Any]]:
    """What the terminal finds at the setpoint of the case."""
    body = {"case": case, "format": "toml"}
    (folder / "case.toml").write_bytes(asked(address, "/api/export", body))
    done = subprocess.run(
        [PROGRAM, "case", "case.toml", "--json"],
        capture_output=True,
        text=True,
        cwd=folder,
        check=False,
    )
    if done.returncode:
        return []
    found = json.loads(done.stdout)["setpoint_solved"]["solutions"]
    return [one | one["physical"] for one in found]


def agree(rows: list[dict[str, Any]], solutions: list[dict[str, Any]]) -> None:
    """Each solution of the terminal is a row, with the same numbers."""
    assert solutions
    for solution in solutions:
        near = [
            row
            for row in rows
            if row["values"]["distance"] == pytest.approx(solution["zc"], rel=1e-8)
        ]
        assert near, (solution["zc"], rows)
        row = min(
            near, key=lambda one: abs(one["values"]["phase"] - solution["phase"] % 360)
        )
        assert row["stable"] == solution["stable"]
        for name, key in NUMBERS.items():
            # Forces are differences of larger ones; a phase is shown from 0° to 360°.
            expected = solution[key] % 360 if name == "phase" else solution[key]
            assert row["values"][name] == pytest.approx(
                expected, rel=1e-6, abs=1e-15
            ), name


def fragment(case: dict[str, Any]) -> str:
    changes = dict(word.split("=", 1) for word in case["set"])
    named = {f"set.{key}": value for key, value in changes.items()}
    return urllib.parse.urlencode({"preset": case["preset"], **named})


def test_the_first_screen_answers(page: Any, address: str) -> None:
    states(page, address, "", "all")
    # The states of the preset at 80 %: docs/cases, and an independent program's in the reference.
    assert page.inner_text("#states-heading") == "States at this setpoint: two"
    rows = shown(page)
    assert [(row["state"], row["stable"]) for row in rows] == [
        ("attractive", True),
        ("repulsive", True),
        ("unstable", False),
    ]
    texts = [
        [row["texts"][name] for name in ("distance", "phase", "force")] for row in rows
    ]
    assert texts == [
        ["16.18 nm", "126.9°", "0"],
        ["15.44 nm", "53.1°", "1.24 nN"],
        ["15.69 nm", "126.9°", "221.6 pN"],
    ]
    assert rows[0]["chosen"]
    assert "coming from afar" in rows[0]["texts"]["how"]
    assert "press, then draw back" in rows[1]["texts"]["how"]
    said = page.inner_text("#verdict")
    for part in (
        "attractive state, which does not touch",
        "1.24 nN",
        "739.3 pm",
        "73.7°",
    ):
        assert part in said
    # No panel of zeros, no column of zeros.
    assert "energy" not in rows[0]["texts"]
    assert "No state loses energy" in page.inner_text("#sure")
    # The search was at the distance of another row than the one that is chosen now.
    page.click("#rows tbody tr[data-state=repulsive] .name")
    assert "Searched from" in page.inner_text("#sure")
    assert "In addition to" not in page.inner_text("#sure")


@pytest.mark.parametrize("setpoint", ["0.3", "0.55", "0.9", "0.97"])
def test_rows_at_a_setpoint_are_the_terminals(
    page: Any, address: str, tmp_path: Path, setpoint: str
) -> None:
    case = {"preset": "dmt", "set": [f"drive.setpoint={setpoint}"]}
    states(page, address, fragment(case), "all")
    rows = shown(page)
    left(page)
    agree(rows, solved(address, case, tmp_path))


def laws(address: str) -> list[str]:
    keys = json.loads(asked(address, "/api/motion", {"case": {"preset": "dmt"}}))[
        "keys"
    ]
    choices = next(key["choices"] for key in keys if key["name"] == "sample.law")
    return [choice["word"] for choice in choices]


def changed(
    address: str, path: str, case: dict[str, Any], **more: str
) -> dict[str, Any]:
    answer = json.loads(asked(address, path, {"case": case, **more}))
    kept = dict(word.split("=", 1) for word in case["set"])
    kept.update(answer["set"])
    return {**case, "set": [f"{key}={value}" for key, value in kept.items()]}


# Every third law, since the page takes the states of all from one study; in parts, so that none takes longer than
# a test may.
@pytest.mark.usefixtures("rows_alone")
@pytest.mark.parametrize("part", range(4))
def test_a_law_shows_the_terminals_states(
    page: Any, address: str, tmp_path: Path, part: int
) -> None:
    for number, law in list(enumerate(laws(address)[::3]))[part::4]:
        lever, amplitude, setpoint = LEVERS[number % 3]
        wide, high = SIZES[number % 3]
        case = {
            "preset": "dmt",
            "set": [f"drive.free_amplitude={amplitude}", f"drive.setpoint={setpoint}"],
        }
        if lever:
            case = changed(
                address, "/api/choice", case, key="cantilever.lever", name=lever
            )
        case = changed(address, "/api/law", case, law=law)
        solutions = solved(address, case, tmp_path)
        page.set_viewport_size({"width": wide, "height": high})
        try:
            states(page, address, fragment(case))
            if solutions:
                agree(shown(page), solutions)
            else:
                # What the terminal refuses, the page does not show either.
                assert page.inner_text("#message") or not shown(page), law
        finally:
            left(page)
            page.set_viewport_size({"width": 1440, "height": 1000})
            page.complaints[:] = [w for w in page.complaints if "422" not in w]


def test_a_state_for_which_the_model_does_not_hold_says_so(
    page: Any, address: str, tmp_path: Path
) -> None:
    # The tip sinks into a soft sample by more than its radius, for which Hertz's law is not derived.
    given = {"preset": "dmt", "set": ["drive.setpoint=0.7"]}
    case = changed(address, "/api/law", given, law="hertz")
    kept = [word for word in case["set"] if not word.startswith("sample.modulus")]
    case = {**case, "set": [*kept, "sample.modulus=1 MPa"]}
    states(page, address, fragment(case))
    (tmp_path / "case.toml").write_text(case_file(address, case))
    command = [PROGRAM, "orbit", str(tmp_path / "case.toml"), "--json"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    said = [line for line in done.stderr.splitlines() if "δ/R reaches" in line]
    assert len(said) == 1
    until(page, lambda: "δ/R reaches" in page.inner_text("#limits"))
    assert said[0].removeprefix("warning: ") in page.inner_text("#limits")
    states(page, address, "")
    assert page.inner_text("#limits") == ""


def test_each_law_is_in_one_family(page: Any, address: str) -> None:
    states(page, address, "")
    # The fields come with the motion, which may be answered after the rows.
    page.wait_for_selector("#choose-law option", state="attached")
    offered = page.locator("#choose-law option").evaluate_all(
        "(all) => all.map((one) => one.value)"
    )
    assert sorted(offered) == sorted(laws(address))
    named = page.locator("#choose-law option").all_inner_texts()
    assert len(set(named)) == len(named)
    assert not set(named) & set(offered)


@pytest.mark.alone
def test_a_dragged_setpoint_shows_exact_states_on_the_way(
    page: Any, address: str, tmp_path: Path
) -> None:
    # Three modes under DMT.
    states(page, address, "preset=dmt&set.modes=3&set.drive.setpoint=0.8", "all")
    box = page.locator("#setpoint-slider").bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.78 * box["width"], y)
    page.mouse.down()
    met: set[float] = set()
    begun = time.monotonic()
    for k in range(60):
        page.mouse.move(box["x"] + (0.78 - 0.008 * k) * box["width"], y)
        page.wait_for_timeout(30)
        first = page.locator("#rows tbody tr").first
        if "approximate" not in (first.get_attribute("class") or ""):
            met.add(float(first.locator("td.distance").get_attribute("data-value")))
    assert "setpoint=0.8&" in page.url + "&"
    page.mouse.up()
    # The exact rows of most positions, while the slider moved.
    assert len(met) > 15, (len(met), time.monotonic() - begun)
    until(page, lambda: "set.drive.setpoint=0.8&" not in page.url + "&")
    settled(page)
    setpoint = re.findall(r"set\.drive\.setpoint=([\d.]+)", page.url)[0]
    case = {"preset": "dmt", "set": ["modes=3", f"drive.setpoint={setpoint}"]}
    agree(shown(page), solved(address, case, tmp_path))


def test_a_row_is_chosen_and_its_link_shows_it(page: Any, address: str) -> None:
    states(page, address, "preset=dmt&set.drive.setpoint=0.8", "all")
    page.click("#rows tbody tr[data-state=repulsive] .name")
    until(page, lambda: "repulsive" in page.inner_text("#scope-heading"))
    page.wait_for_selector("body[data-busy=no]")
    before = shown(page)
    # The detail is that of the chosen state: its phase, and the command that computes it.
    page.click("#detail > summary")
    until(page, lambda: page.inner_text("td[data-observable=phase]") == "53.13°")
    assert "--state=" in page.text_content("#command")
    link = page.url.split("#")[1]
    states(page, address, link)
    again = shown(page)
    assert [row["chosen"] for row in again] == [row["chosen"] for row in before]
    for one, other in zip(again, before, strict=True):
        assert one["values"] == pytest.approx(other["values"], rel=1e-9)


def differences(page: Any) -> dict[str, float]:
    """The differences of the two states that are shown side by side."""
    rows = page.locator("#compare tbody tr").all()
    return {
        row.get_attribute("data-quantity"): float(
            row.locator("td").last.get_attribute("data-value")
        )
        for row in rows
    }


def test_two_states_are_compared(page: Any, address: str, tmp_path: Path) -> None:
    case = {"preset": "dmt", "set": ["drive.setpoint=0.8"]}
    states(page, address, fragment(case), "all")
    assert page.is_hidden("#compare")
    page.click("#rows tr[data-state=repulsive] .name", modifiers=["Shift"])
    # The first of the two stays chosen.
    assert [row["chosen"] for row in shown(page)] == [True, False, False]
    one, other = sorted(
        (row for row in solved(address, case, tmp_path) if row["stable"]),
        key=lambda row: -row["zc"],
    )
    for name, change in differences(page).items():
        key = NUMBERS[name]
        scale = max(abs(one[key]), abs(other[key]))
        assert change == pytest.approx(other[key] - one[key], abs=1e-6 * scale), name
    assert (
        page.inner_text("#compare caption") == "Attractive and Repulsive, side by side"
    )
    assert "−739.3 pm" in page.inner_text("#compare")
    assert page.locator("#compare canvas").count() == 2
    before = differences(page)
    link = page.url.split("#")[1]
    # Choosing the other one turns the comparison round; a changed setpoint keeps it.
    page.click("#rows tr[data-state=repulsive] .name")
    assert differences(page)["force"] == pytest.approx(-before["force"])
    page.fill("#setpoint", "70")
    page.press("#setpoint", "Enter")
    until(page, lambda: "drive.setpoint=0.7" in page.url)
    settled(page)
    assert page.inner_text("#compare caption").startswith("Repulsive and Attractive")
    states(page, address, link, "all")
    assert differences(page) == pytest.approx(before, rel=1e-6)
    # By the keyboard, and back.
    box = page.locator("#rows tr[data-state=unstable] .compare input")
    box.focus()
    page.keyboard.press("Space")
    assert page.inner_text("#compare caption").startswith("Attractive and Unstable")
    page.keyboard.press("Space")
    assert page.is_hidden("#compare")


def test_the_saved_case_is_the_chosen_state(
    page: Any, address: str, tmp_path: Path
) -> None:
    states(page, address, "preset=dmt&set.drive.setpoint=0.8", "all")
    page.click("#rows tbody tr[data-state=repulsive] .name")
    page.wait_for_selector("body[data-busy=no]")
    with page.expect_download() as download:
        page.click("#save-case")
    download.value.save_as(tmp_path / "case.toml")
    page.click("#detail > summary")
    page.click("#head-export ~ details > summary")
    command = page.inner_text("#command").split()
    orbit = printed(tmp_path, *command[1:])
    # The repulsive state at 80 %, not the one that the approach reaches.
    assert orbit["physical"]["F_max"] == pytest.approx(1.24e-9, rel=1e-3)
    assert orbit["phase"] == pytest.approx(53.13, abs=0.01)


@pytest.mark.parametrize(
    ("typed", "setpoint"),
    [("60", "0.6"), ("60 %", "0.6"), ("0,6", "0.6"), ("12 nm", "12 nm")],
)
def test_setpoints_are_understood(
    page: Any, address: str, typed: str, setpoint: str
) -> None:
    states(page, address, "preset=dmt&set.drive.setpoint=0.8")
    page.fill("#setpoint", typed)
    page.press("#setpoint", "Enter")
    words = urllib.parse.quote_plus(setpoint)
    until(page, lambda: f"set.drive.setpoint={words}" in page.url)
    settled(page)
    until(page, lambda: "12 nm of 20 nm" in page.inner_text("#setpoint-hint"))


def test_bare_numbers_take_the_unit_and_absurd_ones_are_asked_about(
    page: Any, address: str
) -> None:
    states(page, address, "preset=dmt&set.drive.setpoint=0.8")
    page.fill("#free", "30")
    page.press("#free", "Enter")
    until(page, lambda: "set.drive.free_amplitude=30+nm" in page.url)
    settled(page)
    page.fill("#free", "25 m")
    page.press("#free", "Enter")
    assert "25 nm instead" in page.inner_text(".asks")
    assert "30+nm" in page.url
    page.click(".asks button >> nth=0")
    until(page, lambda: "set.drive.free_amplitude=25+nm" in page.url)
    # The list of all values understands the same.
    page.click("#all > summary")
    page.fill("[data-key='tip.radius']", "12")
    page.press("[data-key='tip.radius']", "Enter")
    until(page, lambda: "set.tip.radius=12+nm" in page.url)


def test_a_lever_replaces_values_and_is_taken_back(page: Any, address: str) -> None:
    states(page, address, "preset=dmt&set.drive.setpoint=0.8")
    before = shown(page)
    page.select_option("#choose-cantilever-lever", "PPP-NCHR")
    page.wait_for_selector("#notice:not([hidden])")
    said = page.inner_text("#notice p")
    # Its data sheet: 42 N/m, 330 kHz.
    for part in ("→ 42 N/m", "→ 330 kHz", "Q stays 200", "follows the resonance"):
        assert part in said
    until(page, lambda: "cantilever.lever=PPP-NCHR" in page.url)
    settled(page)
    assert shown(page)[0]["values"] != before[0]["values"]
    page.click("#take-back")
    until(page, lambda: "cantilever.lever" not in page.url)
    settled(page)
    until(page, lambda: len(shown(page)) == 3)
    for one, other in zip(shown(page), before, strict=True):
        assert one["values"] == pytest.approx(other["values"], rel=1e-6)


def test_a_state_that_ends_is_said(page: Any, address: str) -> None:
    # With 30 nm the attractive state ends at 81.2 %.
    start = "preset=dmt&set.drive.free_amplitude=30+nm&set.drive.setpoint=0.83"
    states(page, address, start, "all")
    assert page.inner_text("#states-heading").endswith("two")
    page.fill("#setpoint", "79")
    page.press("#setpoint", "Enter")
    until(page, lambda: "lever jumps" in page.inner_text("#verdict"))
    assert page.inner_text("#states-heading").endswith("one")


def test_motions_without_units_are_rows_too(page: Any, address: str) -> None:
    # Ω = 20 without a tip mass: period 1 and period 4 (the paper's Figs. 15 and 17).
    states(page, address, "preset=paper-fast", "all")
    stable = [row for row in shown(page) if row["stable"]]
    assert len(stable) == 2
    assert "every 4 drive periods" in page.inner_text("#rows")
    listed = json.loads(
        asked(address, "/api/attractors", {"case": {"preset": "paper-fast"}})
    )
    amplitudes = sorted(
        one["row"]["first_harmonic"]["value"] for one in listed["motions"]
    )
    seen = sorted(row["values"]["amplitude"] for row in stable)
    assert seen == pytest.approx(amplitudes, rel=1e-9)


def test_an_unknown_example_of_a_link_is_said(page: Any, address: str) -> None:
    states(page, address, "preset=nothing")
    assert "nothing" in page.inner_text("#note")
    assert page.inner_text("#states-heading").startswith("States at this setpoint")


# What the view asks for after its rows.
PARTS = ("/api/curve", "/api/attractors")


@pytest.fixture(scope="module")
def answers(address: str) -> Answers:
    return Answers(address)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_view_fits_every_screen(
    page: Any, address: str, answers: Answers, size: tuple[int, int], scheme: str
) -> None:
    for path in PARTS:
        answers.given(page, path)
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": size[0], "height": size[1]})
    try:
        states(page, address, "", "all")
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
        if size[0] > 1000:
            # The answer and both figures are above the fold.
            box = page.locator("#scope").bounding_box()
            assert box["y"] + box["height"] <= size[1] + 12
    finally:
        for path in PARTS:
            page.unroute(f"**{path}")
        page.emulate_media(color_scheme="light")
        page.set_viewport_size({"width": 1440, "height": 1000})


def test_a_case_is_opened_with_its_files(
    page: Any, address: str, tmp_path: Path
) -> None:
    case = asked(
        address, "/api/export", {"case": {"preset": "patch"}, "format": "toml"}
    )
    head = case.decode().split("[scan]")[0]
    lever = tmp_path / "lever.toml"
    lever.write_text(f'{head}[scan]\nsize = "100 nm"\nprofile = "folder/step.csv"\n')
    step = tmp_path / "step.csv"
    step.write_text("0\n0\n5e-9\n5e-9\n")
    states(page, address, "preset=dmt")
    page.set_input_files("#open", [lever])
    page.wait_for_selector("#message:not([hidden])")
    # Answers for the case before do not end it.
    settled(page, "all")
    assert "open step.csv together" in page.inner_text("#message")
    page.set_input_files("#open", [lever, step])
    until(page, lambda: "case=1" in page.url)
    settled(page)
    assert "lever.toml" in page.inner_text("#yours")
    page.complaints[:] = [words for words in page.complaints if "422" not in words]


def solutions(path: Path, **changes: str) -> list[dict[str, Any]]:
    """The terminal's orbits at a setpoint, under other values; none where the setpoint is not reached."""
    words = [
        word for key, text in changes.items() for word in ("--set", f"{key}={text}")
    ]
    found = subprocess.run(
        [PROGRAM, "case", str(path), "--json", "-q", *words],
        capture_output=True,
        text=True,
        check=False,
    )
    if found.returncode:
        return []
    return list(
        json.loads(found.stdout).get("setpoint_solved", {}).get("solutions", [])
    )


def test_the_margins_at_a_setpoint_end_where_the_terminal_finds_no_state(
    page: Any, address: str, tmp_path: Path
) -> None:
    states(page, address, "preset=dmt&set.drive.setpoint=0.8")
    until(page, lambda: "drive frequency" in page.inner_text("#margin"))
    words = page.inner_text("#margin")
    assert "while the feedback holds an amplitude of 16 nm" in words
    assert "At this distance: " in words
    low, high = (
        float(one)
        for one in re.search(
            r"free amplitude from ([\d.]+) nm to ([\d.]+) nm", words
        ).groups()
    )
    _, highest = (
        float(one)
        for one in re.search(
            r"frequency from ([\d.]+) kHz to ([\d.]+) kHz", words
        ).groups()
    )
    path = tmp_path / "case.toml"
    path.write_text(case_file(address, {"preset": "dmt", "set": []}))
    held = {"drive.setpoint": "16 nm", "gap.tip": ""}

    def attractive(**changes: str) -> list[float]:
        found = solutions(path, **held, **changes)
        return [
            one["zc"]
            for one in found
            if one["stable"] and one["branch"] == "attractive"
        ]

    # Near the end the terminal may pass both orbits that meet there. The amplitude is held in metres: below it a free lever is nowhere at the setpoint.
    assert low == pytest.approx(16, abs=1e-3)
    for value, exists in (
        (high - 0.03, 1),
        (high + 0.01, 0),
        (low + 0.01, 1),
        (low - 0.01, 0),
    ):
        assert len(attractive(**{"drive.free_amplitude": f"{value} nm"})) == exists, (
            value
        )
    # Another frequency keeps the strength of the drive.
    force = printed(tmp_path, "case", path.name)["physical"]["drive_amplitude"]
    drive = {"drive.free_amplitude": "", "drive.force": f"{force!r} N"}
    for value, exists in ((highest - 0.005, 1), (highest + 0.015, 0)):
        found = attractive(**drive, **{"drive.frequency": f"{value} kHz"})
        assert len(found) == exists, value
