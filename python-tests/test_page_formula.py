"""A contact law as the user's own formula: its states, its mistakes, its parameters and its link."""

from __future__ import annotations

import json
import urllib.parse
from typing import Any

import pytest
from browsers import asked, case_file, idle
from test_page_states import shown, states, until

# DMT of the table, with the reduced modulus of sample and tip written out.
DMT = (
    "modulus = 1/((1 - nu^2)/E + (1 - nut^2)/Et); "
    "if d > a0 then -H*R/(6*d^2) else -H*R/(6*a0^2) + 4/3*modulus*sqrt(R)*max(a0 - d, 0)^1.5"
)
SET = "view=states&preset=dmt&set.drive.setpoint=0.8&"
KELVIN_VOIGT = "4/3*E*sqrt(R)*max(-d, 0)^1.5 - eta*sqrt(R)*max(-d, 0)^0.5*v"


def force(address: str, text: str, **more: Any) -> dict[str, Any]:
    case = more.pop("case", {"preset": "dmt", "set": ["sample.law=formula"]})
    body = {"case": case, "force": text, **more}
    return dict(json.loads(asked(address, "/api/force", body)))


def formula_case(address: str) -> dict[str, Any]:
    case = {"preset": "dmt", "set": ["drive.setpoint=0.8"]}
    answer = json.loads(asked(address, "/api/law", {"case": case, "law": "formula"}))
    return {
        "preset": "dmt",
        "set": [*case["set"], *(f"{k}={v}" for k, v in answer["set"].items())],
    }


def opened(page: Any, address: str) -> None:
    """The first example with a formula in place of its law."""
    states(page, address, SET)
    page.select_option("#choose-law", "formula")
    page.wait_for_selector("#formula-text")
    until(page, lambda: page.locator("#formula-curve .force").count() == 1)
    settled(page)


def settled(page: Any) -> None:
    """Waits for the rows, and for the motion that brings the fields of the case."""
    page.wait_for_timeout(50)
    page.wait_for_selector("body[data-rows=done]")
    idle(page)


def typed(page: Any, text: str) -> None:
    page.fill("#formula-text", text)
    page.locator("#formula-text").blur()


def set_in(page: Any) -> dict[str, str]:
    """The changes of the case in the page's address."""
    words = dict(urllib.parse.parse_qsl(page.url.split("#", 1)[1], True))
    return {k.removeprefix("set."): v for k, v in words.items() if k.startswith("set.")}


def test_dmt_as_a_formula_has_the_states_of_the_law(page: Any, address: str) -> None:
    states(page, address, SET)
    law = shown(page)
    assert [row["state"] for row in law].count("repulsive") == 1
    opened(page, address)
    typed(page, DMT)
    # The tip's own modulus is no quantity that a formula knows; the first formula has no attraction.
    for name, value in (("Et", "160 GPa"), ("nut", "0.3"), ("H", "30 zJ")):
        assert "no value yet" in page.inner_text(f"label[for=formula-value-{name}]")
        page.fill(f"#formula-value-{name}", value)
        page.locator(f"#formula-value-{name}").blur()
    until(page, lambda: set_in(page).get("sample.force") == DMT)
    settled(page)
    until(page, lambda: len(shown(page)) == len(law))
    page.wait_for_function("document.querySelector('#message').hidden")
    formula = shown(page)
    assert [row["state"] for row in formula] == [row["state"] for row in law]
    for row, other in zip(formula, law, strict=True):
        assert row["values"] == pytest.approx(other["values"], rel=1e-9)


def test_a_mistake_is_shown_and_the_states_stay(page: Any, address: str) -> None:
    opened(page, address)
    before, right = shown(page), set_in(page)
    for text, part, said in (
        ("4/3*E*sqrt(R)*maxx(-d, 0)^1.5", "maxx", "maxx"),
        ("E*max(-d, 0", " ", "`)` is missing"),
        ("E*max(-d, 0)", "E*max(-d, 0)", "force"),
    ):
        typed(page, text)
        until(page, lambda s=said: s in page.inner_text("#formula-wrong"))
        assert "last right formula" in page.inner_text("#formula-wrong")
        assert page.text_content("#formula-wrong mark") == part
        assert page.get_attribute("#formula-text", "aria-invalid") == "true"
        page.click("#formula-wrong .part")
        chosen = page.evaluate(
            "(() => { const f = document.querySelector('#formula-text'); "
            "return f.value.slice(f.selectionStart, f.selectionEnd) })()"
        )
        assert chosen == part.strip()
        # A pause in typing does not take it over, either.
        page.wait_for_timeout(1200)
        assert set_in(page) == right
        for row, other in zip(shown(page), before, strict=True):
            assert row["values"] == pytest.approx(other["values"], rel=1e-9)
        assert page.is_hidden("#message")
    typed(page, "4/3*E*sqrt(R)*max(-d, 0)^1.5")
    until(page, lambda: set_in(page)["sample.force"].startswith("4/3*E*sqrt"))
    assert page.is_hidden("#formula-wrong")
    assert page.get_attribute("#formula-text", "aria-invalid") is None


def test_a_parameter_gets_its_field_and_slider(page: Any, address: str) -> None:
    opened(page, address)
    # Typed without leaving the field: a pause is enough.
    page.fill("#formula-text", KELVIN_VOIGT)
    page.wait_for_selector("#formula-value-eta")
    assert page.input_value("#formula-value-E") == "1 GPa"
    page.fill("#formula-value-eta", "20 Pa")
    until(page, lambda: "v" in page.inner_text("#formula-wrong"))
    assert "sample.parameters.eta" not in set_in(page)
    page.fill("#formula-value-eta", "20 Pa s")
    until(page, lambda: set_in(page).get("sample.parameters.eta") == "20 Pa s")
    # Approaching and withdrawing differ, and nothing that the formula does not name is stated.
    assert page.locator("#formula-curve .back").count() == 1
    assert set_in(page)["sample.poisson"] == ""
    slider = page.locator("#formula-value-eta-slider")
    until(page, slider.is_visible)
    slider.focus()
    # To leave the field is no new value, whose answer would hide the slider under the hand.
    page.wait_for_timeout(500)
    assert page.evaluate("document.activeElement.id") == "formula-value-eta-slider"
    page.keyboard.press("ArrowRight")
    until(page, lambda: set_in(page)["sample.parameters.eta"] != "20 Pa s")
    value = float(set_in(page)["sample.parameters.eta"].split()[0])
    assert 20 < value < 20.2
    # In the list of all values, and among the quantities that a study varies.
    settled(page)
    page.evaluate("document.querySelector('#all').open = true")
    assert page.locator('[data-slider="sample.parameters.eta"]').count() == 1
    page.click("#views [data-view=studies]")
    page.wait_for_selector("body[data-busy=no]")
    page.click("#tab-diagram")
    offered = page.locator("#study-form option").evaluate_all(
        "(a) => a.map((o) => o.value)"
    )
    assert "sample.parameters.eta" in offered


def test_a_memory_is_said_and_no_end_without_a_level(page: Any, address: str) -> None:
    opened(page, address)
    caption = page.locator("#formula-curve figcaption")
    assert "branches end at" in caption.inner_text()
    typed(page, "s' = (F/E/R - s)*f; -E*R*(d + s)*step(-d - s)")
    page.wait_for_selector("#formula-value-f")
    page.fill("#formula-value-f", "500 kHz")
    until(page, lambda: "memory is zero" in caption.inner_text())
    # The branches of a moving surface end at no gap of their own.
    assert "branches end at" not in caption.inner_text()


def test_a_link_and_a_saved_case_hold_the_formula(page: Any, address: str) -> None:
    opened(page, address)
    typed(page, "4/3*stiff*sqrt(R)*max(-d, 0)^1.5\n  - c*v*step(-d)")
    for name, value in (("stiff", "2 GPa"), ("c", "1e-8 N s/m")):
        page.fill(f"#formula-value-{name}", value)
        page.locator(f"#formula-value-{name}").blur()
    until(page, lambda: "sample.parameters.c" in set_in(page))
    settled(page)
    until(page, lambda: page.is_hidden("#formula-wrong"))
    rows, text, link = shown(page), page.input_value("#formula-text"), page.url
    page.goto("about:blank")
    page.goto(link)
    settled(page)
    until(page, lambda: page.locator("#formula-curve .force").count() == 1)
    assert page.input_value("#formula-text") == text
    assert page.input_value("#formula-value-stiff") == "2 GPa"
    for row, other in zip(shown(page), rows, strict=True):
        assert row["values"] == pytest.approx(other["values"], rel=1e-9)
    case = {"preset": "dmt", "set": [f"{k}={v}" for k, v in set_in(page).items()]}
    saved = case_file(address, case)
    assert 'parameters.stiff = "2 GPa"' in saved
    again = {"text": saved, "set": []}
    keys = json.loads(asked(address, "/api/motion", {"case": again}))["keys"]
    value = next(key["value"] for key in keys if key["name"] == "sample.force")
    assert value.split() == text.split()


def test_another_law_and_back_keeps_what_was_typed(page: Any, address: str) -> None:
    opened(page, address)
    typed(page, "k*max(-d, 0)*(E/E)")
    page.fill("#formula-value-k", "12 N/m")
    page.locator("#formula-value-k").blur()
    until(page, lambda: set_in(page).get("sample.parameters.k") == "12 N/m")
    settled(page)
    page.select_option("#choose-law", "jkr")
    until(page, lambda: set_in(page)["sample.law"] == "jkr")
    settled(page)
    page.wait_for_selector("#formula", state="hidden")
    assert set_in(page)["sample.force"] == ""
    page.select_option("#choose-law", "formula")
    until(page, lambda: set_in(page)["sample.law"] == "formula")
    settled(page)
    assert page.input_value("#formula-text") == "k*max(-d, 0)*(E/E)"
    assert set_in(page)["sample.parameters.k"] == "12 N/m"
    assert "as before" in page.inner_text("#notice")


def test_the_curve_is_the_formula(address: str) -> None:
    case = formula_case(address)
    answer = force(
        address,
        "if d > a0 then -H*R/(6*d^2) else -H*R/(6*a0^2)",
        case=case,
        parameters={"H": "3e-20 J", "a0": "0.2 nm"},
    )
    assert answer["levels"] == pytest.approx([0.2e-9])
    assert answer["points"][0][0] < 0
    assert answer["points"][-1][0] > 4e-9
    for gap, value in answer["points"]:
        assert value == pytest.approx(
            -3e-20 * 5e-9 / (6 * max(gap, 0.2e-9) ** 2), rel=1e-6
        )
    dashpot = force(address, "-c*v", case=case, parameters={"c": "1e-8 N s/m"})
    speed = dashpot["speed"]
    # The free tip: 2π · 100 kHz · 20 nm.
    assert speed == pytest.approx(2 * 3.141592653589793 * 100e3 * 20e-9)
    for _, there, back in dashpot["points"]:
        assert (there, back) == pytest.approx((1e-8 * speed, -1e-8 * speed))
    assert force(address, "k*d + q", case=case)["missing"] == ["k", "q"]
    # Places count as the page's script does, also behind characters of two units.
    wrong = force(address, "k*max(-d, 0) + 𝛼(d)", case=case)["error"]
    text = "k*max(-d, 0) + 𝛼(d)".encode("utf-16-le")
    part = text[2 * wrong["from"] : 2 * wrong["to"]].decode("utf-16-le")
    assert part.startswith("𝛼")


@pytest.mark.parametrize(
    "text",
    [
        "(" * 4000,
        "+".join(f"p{k}" for k in range(800)),
        "*".join(f"abs(d - {k}*a0)" for k in range(250)),
        "+".join(f"if v > {k}*w then a else b" for k in range(100)),
        "x" * 100_000,
    ],
)
def test_hostile_formulas_are_answered_at_once(address: str, text: str) -> None:
    values = {"a": "1 N", "b": "2 N", "w": "1 m/s"}
    case = formula_case(address)
    answer = json.loads(
        asked(
            address,
            "/api/force",
            {"case": case, "force": text, "parameters": values},
            limit=5,
        )
    )
    assert answer["error"]["text"]
