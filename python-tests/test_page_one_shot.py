"""Signals of one shot on the page: the terminal's numbers, its refusals, and a long run that is stopped."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browsers import asked, case_file, limited, printed, studied
from test_page_states import until

CASE = {"preset": "bistable", "set": ["gap.tip=3nm"]}
SIGNAL = "pulse 1us times 400"
FIRST = "Time of the first contact"


@pytest.fixture(autouse=True)
def _limit() -> Iterator[None]:
    with limited():
        yield


def opened(page: Any, address: str, more: str = "") -> None:
    page.goto("about:blank")
    page.goto(
        f"{address}#view=studies&tab=simulate&preset=bistable&set.gap.tip=3nm{more}"
    )
    page.wait_for_selector("#study-form [name=drive_signal]")


def rows(page: Any) -> dict[str, str]:
    """The values of the first table."""
    table = page.locator("#tables table").first
    return dict(
        line.locator("th, td").all_inner_texts()
        for line in table.locator("tbody tr").all()
    )


def computed(page: Any) -> dict[str, str]:
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#tables tbody tr")
    page.wait_for_selector("#stop", state="hidden")
    return rows(page)


def number(text: str) -> float:
    return float(re.findall(r"-?[\d.]+", text)[0])


def test_a_pulse_has_the_numbers_of_the_terminal(
    page: Any, address: str, tmp_path: Path
) -> None:
    opened(page, address)
    # Without a choice the signal is one that this lever answers.
    assert page.input_value("#study-form [name=drive_signal]").startswith("pulse")
    page.fill("#study-form [name=drive_signal]", SIGNAL)
    found = computed(page)
    (tmp_path / "case.toml").write_text(case_file(address, CASE))
    words = ("simulate", "case.toml", "--drive-signal", SIGNAL)
    document = printed(tmp_path, *words)
    first = next(text for name, text in found.items() if name.startswith(FIRST))
    assert number(first) == pytest.approx(document["first_contact"], rel=3e-5)
    # As docs/cases/one-shot.md has it, together with SciPy's digits.
    assert number(first) == pytest.approx(1.70382362, rel=3e-5)
    si = document["physical"]
    assert number(found["largest tip deflection W"]) == pytest.approx(
        1e9 * si["tip_max"], rel=1e-4
    )
    assert number(found["largest force of the sample on the tip"]) == pytest.approx(
        1e6 * si["F_max"], rel=1e-4
    )
    assert found["Number of contacts begun"] == str(document["contacts"])
    # Every number in SI alone, its figure, and the command that has the same answer.
    assert len(found) == len(set(found))
    figure = "document.getElementById('study-figure').figure"
    assert page.evaluate(f"{figure}.panels.length") == 2
    command = page.text_content("#study-command")
    assert f"--drive-signal='{SIGNAL}'" in command
    assert "drive_signal=" in page.text_content("#study-python")


def test_a_decimal_comma_and_other_periods_are_understood(
    page: Any, address: str, tmp_path: Path
) -> None:
    opened(page, address, "&lang=de")
    assert page.inner_text("#tab-simulate").strip().endswith(", Chirp, Sinc")
    page.fill("#study-form [name=drive_signal]", "chirp 0,9 1,1 20 times 2")
    page.fill("#study-form [name=periods]", "30")
    found = computed(page)
    (tmp_path / "case.toml").write_text(case_file(address, CASE))
    document = printed(
        tmp_path,
        *("simulate", "case.toml", "--periods", "30"),
        *("--drive-signal", "chirp 0.9 1.1 20 times 2"),
    )
    contacts = next(text for name, text in found.items() if "contacts" in name)
    assert contacts == str(document["contacts"])
    assert document["periods"] == pytest.approx(50)


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        ("", "drive_signal"),
        ("pulse", "a pulse has one number"),
        ("pulse -1us", "above 0 is needed"),
        ("square 1us", "neither a signal nor a table"),
        ("/etc/passwd", "neither a signal nor a table"),
        ("pulse 1e9", "too long"),
        ("chirp 1 3000 90000", "more than 200000 pieces"),
        ("pulse 1us times 0", "a number follows `times`"),
    ],
)
def test_what_is_no_signal_is_refused(address: str, signal: str, words: str) -> None:
    options = {"drive_signal": signal}
    [answer] = studied(address, case=CASE, tab="simulate", options=options)
    assert words in json.dumps(answer["error"])


def test_an_oscillator_has_no_card_for_it(page: Any, address: str) -> None:
    page.goto("about:blank")
    page.goto(f"{address}#view=studies&tab=simulate&preset=impact")
    page.wait_for_selector("#tab-simulate", state="hidden")
    page.wait_for_selector("#tab-approach[aria-selected=true]")
    motion = json.loads(asked(address, "/api/motion", {"case": {"preset": "impact"}}))
    assert motion["forms"]["simulate"] == []


def test_a_long_run_is_stopped(page: Any, address: str) -> None:
    opened(page, address)
    page.fill("#study-form [name=drive_signal]", SIGNAL)
    page.fill("#study-form [name=periods]", "2000000")
    page.click("#study-form button[type=submit]")
    counted = (
        "() => / of 20000\\d\\d /.test(document.getElementById('progress').textContent)"
    )
    until(page, lambda: page.evaluate(counted))
    page.click("#stop")
    page.wait_for_selector("#stop", state="hidden", timeout=10_000)
    assert page.inner_text("#progress") == "stopped"
    # The page then computes what is short.
    page.fill("#study-form [name=periods]", "5")
    assert computed(page)
