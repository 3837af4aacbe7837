"""Numbers of the page in German: the English ones with a decimal comma, and a comma in a field gives the same case."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from browsers import Answers, idle
from test_page_states import until

CASE = "preset=dmt&set.drive.setpoint=0.8&set.drive.free_amplitude=20.5+nm"
# Texts that are copied into a terminal, a script or a notebook.
COPIED = "pre, .line, #link, script, style"
# Views, and what ends their computation.
VIEWS = {
    "states": (
        "",
        "document.body.dataset.search === 'done' && document.querySelector('#margin')?.textContent.includes('m/s')",
    ),
    "plan": ("", "document.querySelector('#view-plan').dataset.plan === 'done'"),
    "scan": ("", "document.querySelector('#strips')?.dataset.line === 'exact'"),
    "studies": (
        "&tab=events&ran=yes",
        "document.querySelector('#tables td') && document.querySelector('#bound').textContent.includes('%') && document.querySelector('#stop').hidden",
    ),
}


def texts(page: Any) -> list[str]:
    """Every text that the page shows, that of its fields included."""
    return list(
        page.evaluate(
            """(copied) => {
                const all = [];
                const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
                for (let node = walk.nextNode(); node; node = walk.nextNode()) {
                    if (!node.parentElement.closest(copied) && node.parentElement.checkVisibility()) all.push(node.data);
                }
                for (const field of document.querySelectorAll('input[type=text], #study-form input')) if (field.checkVisibility()) all.push(field.value);
                return all;
            }""",
            COPIED,
        )
    )


def numbers(page: Any, decimal: str) -> list[str]:
    found = [
        one for text in texts(page) for one in re.findall(rf"\d+{decimal}\d+", text)
    ]
    return sorted(one.replace(",", ".") for one in found)


def steady(page: Any, decimal: str) -> list[str]:
    """The numbers once they stay the same for a second."""
    found: list[list[str]] = []

    def stay() -> bool:
        found.append(numbers(page, decimal))
        page.wait_for_timeout(1000)
        return numbers(page, decimal) == found[-1]

    until(page, stay)
    return found[-1]


def opened(page: Any, address: str, view: str, case: str, language: str) -> None:
    more, done = VIEWS[view]
    page.goto("about:blank")
    page.goto(f"{address}#view={view}&{case}{more}&lang={language}")
    until(page, lambda: page.evaluate(f"Boolean({done})"))
    # The fields come with the motion, which may be answered later.
    idle(page)
    # What moves has other numbers at each moment.
    page.evaluate("document.querySelector('#phase')?.remove()")


# The answers that take longest: they are numbers without words, the same ones for both languages.
LONG = ("/api/study", "/api/knock", "/api/margins", "/api/attractors", "/api/curve")


def german_is_english(page: Any, address: str, view: str, case: str) -> None:
    """The numbers of a view are the same in both languages, but for the decimal comma."""
    opened(page, address, view, case, "en")
    english = steady(page, r"\.")
    assert len(english) > 5
    opened(page, address, view, case, "de")
    assert steady(page, ",") == english
    assert [text for text in texts(page) if re.search(r"\d\.\d", text)] == []


# The numbers of the plan are compared in test_page_plan.py, where its map is known.
@pytest.mark.parametrize("view", ["states", "scan", "studies"])
def test_german_numbers_are_the_english_ones(
    page: Any, address: str, view: str
) -> None:
    answers = Answers(address)
    for path in LONG:
        answers.given(page, path)
    try:
        german_is_english(page, address, view, CASE)
    finally:
        page.unroute_all(behavior="wait")


def case_of(page: Any) -> list[str]:
    return list(
        page.evaluate("import('./state.js').then((state) => state.theCase().set)")
    )


@pytest.mark.parametrize("language", ["de", "en"])
def test_a_comma_and_a_point_give_the_same_case(
    page: Any, address: str, language: str
) -> None:
    cases = []
    for free, setpoint in (("18,3 nm", "72,5 %"), ("18.3 nm", "72.5 %")):
        page.goto("about:blank")
        page.goto(f"{address}#preset=dmt&set.drive.setpoint=0.8&lang={language}")
        page.wait_for_selector("body[data-rows=done]")
        for field, text in (
            ("#setpoint", setpoint),
            ("#free", free),
        ):
            page.fill(field, text)
            page.press(field, "Enter")
        page.wait_for_timeout(300)
        page.wait_for_selector("body[data-rows=done]")
        page.locator("h1").click()
        cases.append(case_of(page))
        shown = "18,3 nm" if language == "de" else "18.3 nm"
        until(page, lambda shown=shown: page.input_value("#free") == shown)
        assert page.input_value("#setpoint") == (
            "72,5 %" if language == "de" else "72.5 %"
        )
    assert cases[0] == cases[1]
    assert "drive.free_amplitude=18.3 nm" in cases[0]
    assert "drive.setpoint=0.725" in cases[0]
    # The address, the case file and the commands keep the point.
    assert "18.3" in page.url
    assert "18,3" not in page.url
    assert "18,3" not in page.inner_text("#command")


def test_a_field_of_a_study_takes_a_comma_and_a_list_keeps_its_own(
    page: Any, address: str
) -> None:
    page.goto("about:blank")
    page.goto(f"{address}#view=studies&preset=dmt&tab=image&lang=de")
    page.wait_for_selector("#study-form [name=rate]")
    page.fill("#study-form [name=rate]", "8,5 Hz")
    page.press("#study-form [name=rate]", "Tab")
    assert "study.rate=8.5" in page.url
    words = "import('./words.js').then((words) => %s.map((text) => words.local(text)))"
    same = ["nanotap 0.2.1", "127.0.0.1:8080", "dmt-1.2.csv", "0.5,1.5", "E = 2.5*x0.1"]
    shown = page.evaluate(words % json.dumps([*same, "1.24 nN.", "(0.8, 1.5e-3)"]))
    assert shown[:4] == same[:4]
    assert shown[5:] == ["1,24 nN.", "(0,8, 1,5e-3)"]
