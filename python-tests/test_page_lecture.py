"""The lecture in a real browser: its numbers against the terminal's, its keys and links, and the German words."""

from __future__ import annotations

import base64
import json
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browsers import WAIT, asked, case_file, printed, without_knocks
from test_page_states import until

LETTERS = 28  # CSS pixels of the smallest letters on a projector


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    page = without_knocks(
        browser.new_page(viewport={"width": 1280, "height": 720}, locale="en")
    )
    page.set_default_timeout(1000 * WAIT)
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    yield page
    page.close()
    assert not complaints


def answers(page: Any) -> list[str]:
    return [
        " ".join(one.split())
        for one in page.locator("#show-answers button").all_inner_texts()
    ]


def known(page: Any) -> None:
    """Waits for the numbers of a step."""
    page.wait_for_selector("#show-answers button")
    until(page, lambda: not any(re.search("…", words) for words in answers(page)))


def says(page: Any) -> str:
    """The words of the answer, once its numbers are there."""
    return str(page.inner_text("#show-says"))


def shown(page: Any) -> str:
    page.keyboard.press("PageDown")
    until(page, lambda: says(page) not in ("", "computing …", "wird berechnet …"))
    return says(page)


def terminal(tmp_path: Path, address: str, preset: str, *words: str) -> Any:
    (tmp_path / "case.toml").write_text(case_file(address, {"preset": preset}))
    return printed(tmp_path, "-q", words[0], "case.toml", *words[1:])


def held(setpoint: str, **more: str) -> list[str]:
    keys = {"drive.setpoint": setpoint} | {
        key.replace("__", "."): text for key, text in more.items()
    }
    return [word for key, text in keys.items() for word in ("--set", f"{key}={text}")]


def of_states(run: Any, said: list[str]) -> None:
    gap = re.findall(r"to ([\d.]+ nm)", said[2])[0]
    found = run("dmt", "attractors", "--set", f"gap.tip={gap}")["attractors"]
    force = max(one["physical"]["F_max"] for one in found)
    assert number(said[2], "presses with", "nN") == pytest.approx(1e9 * force, rel=2e-3)


def of_phase(run: Any, said: list[str]) -> None:
    orbit = run("dmt", "orbit", *held("0.8"))
    assert number(said[1], "grows to", "°") == pytest.approx(orbit["phase"], abs=0.06)


def of_image(run: Any, said: list[str]) -> None:
    verdict = run("patch", "scan")["verdict"]
    below = float(re.findall(r"the height is ([\d.]+) pm lower", verdict)[0])
    assert number(said[0], "A step of", "pm") == pytest.approx(below, abs=0.6)


def of_force(run: Any, said: list[str]) -> None:
    orbit = run("hertz", "orbit", *held("0.8", drive__free_amplitude="30 nm"))
    force = 1e12 * orbit["physical"]["F_max"]
    # The lesson rounds the spring constant to three digits.
    assert number(said[1], "to", "pN") == pytest.approx(force, rel=1e-3)


def of_vacuum(run: Any, said: list[str]) -> None:
    distance = ["--set", "gap.tip=100 nm", "--set", "cantilever.Q=20000"]
    periods = run("dmt", "orbit", *distance)["decay_periods"]
    assert number(said[1], "It takes", "ms") == pytest.approx(periods / 100, rel=2e-3)


def of_doubling(run: Any, said: list[str]) -> None:
    for words, omega in zip(said, (2.8, 2.7), strict=False):
        orbit = run("paper", "orbit", "--set", f"omega={omega}")
        assert number(words, "After", "periods") == orbit["period"]
    exponents = run("paper", "lyapunov", "--set", "omega=2.6")["exponents"]
    assert number(said[2], "exponent", "per") == pytest.approx(
        max(exponents), rel=0.1
    ), exponents


def of_steps(run: Any, said: list[str]) -> None:
    for words, steps in zip(said, (60, 100, 120, 400), strict=True):
        options = ("--method", "rk4", "--steps", str(steps))
        coarse = run("paper", "simulate", "--set", "omega=3", *options)
        assert number(words, "It shows period", "") == coarse["apparent_period"]


def number(words: str, before: str, after: str) -> float:
    found = re.findall(rf"{before} ([\d.]*\d) ?{after}", words)
    assert found, words
    return float(found[0])


LESSONS = {
    "states": of_states,
    "phase": of_phase,
    "image": of_image,
    "force": of_force,
    "vacuum": of_vacuum,
    "doubling": of_doubling,
    "steps": of_steps,
}


@pytest.mark.parametrize("name", LESSONS)
def test_a_lessons_numbers_are_the_terminals(
    page: Any, address: str, tmp_path: Path, name: str
) -> None:
    page.goto(f"{address}#lesson={name}.1")
    said = []
    while page.locator(".lessons").count() == 0:
        known(page)
        question = page.inner_text("#show-heading")
        said.append(shown(page))
        for words in (question, *answers(page), said[-1]):
            assert not re.search("–|{|}|NaN|undefined", words), words
        assert sum("✓" in words for words in answers(page)) == 1
        page.keyboard.press("PageDown")
    assert 3 <= len(said) <= 5
    LESSONS[name](lambda preset, *w: terminal(tmp_path, address, preset, *w), said)


def test_keys_lead_through_a_lesson_and_out_of_it(page: Any, address: str) -> None:
    page.goto(address)
    page.wait_for_selector("#rows tbody tr")
    page.keyboard.press("l")
    assert page.locator(".lessons button").count() == len(LESSONS)
    page.locator(".lessons button").first.click()
    known(page)
    page.keyboard.press("b")
    assert page.locator("#show-answers [aria-pressed=true]").count() == 1
    assert "lesson=states.1" in page.url
    words = shown(page)
    page.keyboard.press("i")
    paper = "getComputedStyle(document.getElementById('show')).backgroundColor"
    assert page.evaluate(paper) == "rgb(0, 0, 0)"
    page.keyboard.press("i")
    assert page.evaluate(paper) == "rgb(255, 255, 255)"
    # The lecturer takes the sliders; Back restores the step.
    page.keyboard.press("w")
    slider = page.locator("#show-answers input").first
    slider.focus()
    before = says(page)
    for _ in range(20):
        page.keyboard.press("ArrowLeft")
    until(page, lambda: says(page) != before)
    page.keyboard.press("PageUp")
    assert says(page) == words
    page.keyboard.press("ArrowRight")
    assert "lesson=states.2" in page.url
    page.keyboard.press("ArrowLeft")
    assert "lesson=states.1" in page.url and says(page) == words
    page.keyboard.press("Escape")
    assert page.is_hidden("#show") and "lesson" not in page.url
    page.wait_for_selector("#rows tbody tr")


def test_letters_are_large_on_a_projector(page: Any, address: str) -> None:
    page.goto(f"{address}#lesson=states.3")
    known(page)
    for _ in range(2):
        sizes = page.evaluate(
            """[...document.querySelectorAll('#show *')]
            .filter((one) => one.offsetParent && one.textContent.trim() && one.tagName !== 'svg')
            .map((one) => [one.id || one.tagName, parseFloat(getComputedStyle(one).fontSize)])"""
        )
        assert sizes
        assert all(size >= LETTERS for _, size in sizes), sizes
        figure = page.evaluate("document.getElementById('show-figure').size")
        assert figure is None or figure >= LETTERS - 0.01
        high = page.evaluate("document.getElementById('show').scrollHeight")
        assert high <= 720
        if not says(page):
            shown(page)
            until(page, lambda: page.locator("#show-figure canvas").count() > 0)


def test_a_phone_opens_the_step_and_shows_its_letter(
    browser: Any, address: str
) -> None:
    phone = browser.new_page(
        viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True
    )
    phone.set_default_timeout(1000 * WAIT)
    phone.goto(f"{address}#lesson=phase.2")
    known(phone)
    assert phone.inner_text("#show-place") == "2 of 4"
    phone.tap("#show-answers button:nth-child(3)")
    assert phone.inner_text(".letter") == "C"
    phone.tap(".letter")
    assert phone.locator(".letter").count() == 0
    wide = phone.evaluate("document.documentElement.scrollWidth")
    assert wide <= 390
    phone.close()


def packed(text: str) -> str:
    raw = zlib.compressobj(wbits=-15)
    letters = base64.urlsafe_b64encode(raw.compress(text.encode()) + raw.flush())
    return "1" + letters.decode().rstrip("=")


OWN = {
    "title": "Mine",
    "preset": "hertz",
    "figure": "states",
    "set": {"drive.setpoint": "0.8"},
    "steps": [
        {
            "ask": "How hard at {drive.setpoint}?",
            "answers": ["{force}", "not at all"],
            "right": 0,
            "says": "With {force}.",
        }
    ],
}


def test_a_lesson_of_ones_own_travels_in_a_link(
    page: Any, address: str, tmp_path: Path
) -> None:
    page.goto(f"{address}#lecture={packed(json.dumps(OWN))}")
    known(page)
    assert page.inner_text("#show-heading") == "How hard at 80 %?"
    orbit = terminal(tmp_path, address, "hertz", "orbit", *held("0.8"))
    force = 1e12 * orbit["physical"]["F_max"]
    assert number(shown(page), "With", "pN") == pytest.approx(force, rel=1e-3)


@pytest.mark.parametrize(
    ("word", "words"),
    [
        ("1abc", "This link is damaged: it contains no lesson."),
        (packed("no JSON"), "This link is damaged: it contains no lesson."),
        (packed("null"), "This lesson is damaged: title is missing or wrong."),
        (
            packed(json.dumps(OWN | {"steps": [OWN["steps"][0] | {"right": 2}]})),  # type: ignore[index]
            "This lesson is damaged: steps.1.right is missing or wrong.",
        ),
        (
            packed(json.dumps(OWN | {"set": {"drive.setpoint": 0.8}})),
            "This lesson is damaged: set is missing or wrong.",
        ),
    ],
    ids=["letters", "text", "nothing", "answer", "values"],
)
def test_a_damaged_lesson_is_said_in_one_sentence(
    page: Any, address: str, word: str, words: str
) -> None:
    page.goto(f"{address}#lecture={word}")
    page.wait_for_selector(".lessons")
    assert page.inner_text("#show-note") == words


def test_the_pattern_is_a_lesson_that_is_read(page: Any, address: str) -> None:
    page.goto(f"{address}#lesson=list")
    with page.expect_download() as saved:
        page.locator(".own button").nth(1).click()
    pattern = Path(saved.value.path()).read_text()
    page.locator("#show input[type=file]").set_input_files(
        {
            "name": "lesson.json",
            "mimeType": "application/json",
            "buffer": pattern.encode(),
        }
    )
    known(page)
    assert "lesson=own.1" in page.url and "lecture=1" in page.url


def leaves(words: Any, path: tuple[str, ...] = ()) -> dict[tuple[str, ...], str]:
    if isinstance(words, str):
        return {path: words}
    pairs = words.items() if isinstance(words, dict) else enumerate(words)
    found: dict[tuple[str, ...], str] = {}
    for name, one in pairs:
        found |= leaves(one, (*path, str(name)))
    return found


@pytest.fixture
def tongues(page: Any, address: str) -> dict[str, Any]:
    page.goto(f"{address}#lesson=list")
    page.wait_for_selector(".lessons")
    return dict(page.evaluate("import('./words.js').then((words) => words.tongues)"))


def test_every_word_is_there_in_german(tongues: dict[str, Any]) -> None:
    english, german = leaves(tongues["en"]), leaves(tongues["de"])
    assert english.keys() <= german.keys()
    # What the program says itself in English has words only in German.
    of_program = (
        ("fields",),
        ("cards",),
        ("studies", "about"),
        ("quantities",),
        ("sentences",),
    )
    for path in german.keys() - english.keys():
        assert any(path[: len(of)] == of for of in of_program), path
    for path, words in english.items():
        placeholders = [
            sorted(set(re.findall(r"{[\w.]+}", one))) for one in (words, german[path])
        ]
        assert placeholders[0] == placeholders[1], path
        # Two words or more are never the same in both; names of the language of formulas are.
        plain = re.sub(r"{[\w.]+}|[^\w ]", "", words)
        if (
            path != ("formula", "language", "2")
            and len(re.findall(r"[a-z]{3,}", plain)) > 1
        ):
            assert words != german[path], path


PAGE = Path(__file__).parents[1] / "crates/nanotap-page/page/index.html"
# Names of formats and languages, and of the program.
TITLE = "nanotap: what a tapping lever does"
NAMES = {"SVG", "PNG", "PDF", "CSV", "Python", "nanotap", TITLE}


def test_the_page_itself_has_no_words() -> None:
    """Words are in the files of words, so that none stays in English."""
    text = re.sub(
        r"<(script|style|noscript).*?</\1>|<!--.*?-->",
        "",
        PAGE.read_text(),
        flags=re.DOTALL,
    )
    for words in re.findall(r">([^<>]*[A-Za-z]{2,}[^<>]*)<", text):
        assert words.strip() in NAMES, words
    assert re.findall(r'aria-label="([^"]*)"', text) == []


def test_a_motion_is_described_in_german(page: Any, address: str) -> None:
    quantity = "([name, words, list]) => import('./words.js').then((all) => all.quantity(name, words, list))"
    sentences = "(text) => import('./words.js').then((all) => all.sentences(text))"
    page.goto("about:blank")
    page.goto(f"{address}#lang=de&view=studies&preset=dmt")
    page.wait_for_selector("#readout dd")
    cases = [{"preset": name} for name in ("dmt", "paper", "impact", "liquid")]
    cases.append({"preset": "bistable", "set": ["drive.setpoint=0.8"]})
    cases.append({"preset": "dmt", "set": ["gap.tip=100 nm"]})
    for case in cases:
        asked_for = {"case": case, "start": "", "steps": 0, "ranges": False}
        motion = json.loads(asked(address, "/api/motion", asked_for))
        for list_, rows in (
            ("", motion["observables"]),
            ("readout", motion["readout"]["lines"]),
        ):
            for row in rows:
                german = page.evaluate(quantity, [row["name"], row["words"], list_])
                assert german != row["words"], row
        said = motion["readout"]["words"]
        german = page.evaluate(sentences, said)
        assert not re.search(r"\b(the|The|On)\b", german), german
        # With the numbers of the English sentence.
        numbers = [one.replace(".", ",") for one in re.findall(r"\d+(?:\.\d+)?", said)]
        assert re.findall(r"\d+(?:,\d+)?", german) == numbers
    for place, words in (
        ("#known", "Diese Bewegung"),
        ("#readout", "Maximalkraft"),
        ("#observables", "größte Kraft der Probe"),
        ("#phase", "Anregungsperiode"),
        ("#lessons", "Periodenverdopplung"),
    ):
        assert words in page.text_content(place), place


# Abbreviations, and the names of windows, are the same in both languages.
SAME = {"am", "fm", "pll", "agc", "hann", "blackman", ""}


def cards(browser: Any, page: Any) -> dict[str, tuple[str, str]]:
    """The words of the cards and their sentences, in English, on a page of its own."""
    other = browser.new_page()
    other.goto(re.sub("lang=de", "lang=en", page.url))
    other.wait_for_selector("#study-form [name=from]", state="attached")
    tabs = other.locator("#tabs [role=tab]").all()
    found = {
        str(tab.get_attribute("id")).removeprefix("tab-"): (
            tab.inner_text().strip(),
            str(tab.get_attribute("title")),
        )
        for tab in tabs
    }
    other.close()
    return found


def test_every_field_of_a_study_has_german_words(
    browser: Any, page: Any, address: str
) -> None:
    """Label, sentence and choices of each field of each form, as the page has them in German, against the program's."""
    about = json.loads(asked(address, "/api/about"))
    forms: dict[str, Any] = {one["name"]: one["form"] for one in about["studies"]}
    for preset in ("dmt", "paper"):
        case = {"case": {"preset": preset}}
        more = json.loads(asked(address, "/api/motion", case))["forms"]
        del more["usual"]
        for name, form in more.items():
            known = {one["name"] for one in forms.get(name, [])}
            new = [one for one in form if one["name"] not in known]
            forms[name] = [*forms.get(name, []), *new]
    page.goto("about:blank")
    page.goto(f"{address}#lang=de&view=studies&preset=dmt")
    page.wait_for_selector("#tabs [role=tab]")
    worded = "([form, field]) => import('./words.js').then((words) => words.worded(form, field))"
    count = 0
    for form, fields in forms.items():
        for field in fields:
            # Keys of a case and coordinates are names.
            names = field["name"].startswith(("key", "entry"))
            german = page.evaluate(worded, [form, field])
            place = f"{form}: {field['name']}"
            for part in ("words", "about"):
                if field.get(part):
                    assert german[part].lower() != field[part].lower() or (
                        part == "words" and field[part] == "parameter"
                    ), place
                    count += 1
            for one, own in zip(
                field.get("choices", []), german["choices"], strict=True
            ):
                assert names or one in SAME or one != own, f"{place}: {one}"
    assert count > 200
    # The forms show these words, and the cards their own.
    page.wait_for_selector("#study-form [name=from]", state="attached")
    for name, (words, sentence) in cards(browser, page).items():
        tab = page.locator(f"#tab-{name}")
        # A scan is called so in both languages.
        same = tab.inner_text().strip().lower() == words.lower()
        assert same == (name == "image"), name
        assert tab.get_attribute("title") != sentence, name
        if name == "data":
            continue
        tab.click()
        for field in forms[name]:
            if not field.get("words"):
                continue
            german = page.evaluate(worded, [name, field])
            place = f"#study-form label:has(> [name='{field['name']}'])"
            label = page.locator(place)
            assert label.get_attribute("title") == german["about"]
            assert str(label.text_content()).startswith(german["words"])


def test_the_page_in_german_shows_its_words(
    page: Any, address: str, tongues: dict[str, Any]
) -> None:
    german = leaves(tongues["de"])
    page.goto("about:blank")
    page.goto(f"{address}#lang=de&set.drive.setpoint=0.8&preset=dmt")
    page.wait_for_selector("#rows tbody tr")
    assert page.get_attribute("html", "lang") == "de"
    named = page.eval_on_selector_all(
        "[data-t]", "all => all.map((one) => [one.dataset.t, one.textContent])"
    )
    assert len(named) > 10
    for path, text in named:
        assert text == german[tuple(path.split("."))], path
    heading = german["states", "heading"].replace("{count}", "zwei")
    until(page, lambda: page.inner_text("#states-heading") == heading)
    heads = page.locator("#rows thead th").all_inner_texts()
    assert heads[:4] == [
        german["states", "heads", name]
        for name in ("state", "film", "distance", "phase")
    ]
    names = page.locator("#rows .name").all_inner_texts()
    assert [german["states", "names", "attractive"], "Repulsiv"] == names[:2]
    page.click("#lecture")
    titles = page.locator(".lessons button").all_inner_texts()
    assert titles == [german["lessons", name, "title"] for name in LESSONS]
