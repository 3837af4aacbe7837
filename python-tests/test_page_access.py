"""The page for everyone: axe's rules on every view, zoom, reduced motion, the keyboard alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from test_page_states import settled, states, until

RULES = ["wcag2a", "wcag2aa", "wcag21aa", "wcag22aa", "best-practice"]
VIEWS = [
    "",
    "view=plan&preset=dmt",
    "view=scan&preset=patch",
    "view=data&preset=dmt",
    "view=studies&preset=dmt",
    "view=studies&preset=paper&tab=basin",
]


def axe() -> str:
    package = pytest.importorskip("axe_playwright_python")
    return (Path(package.__file__).parent / "axe.min.js").read_text()


@pytest.mark.parametrize(
    ("size", "scheme"),
    [((1440, 900), "light"), ((1440, 900), "dark"), ((390, 844), "light")],
)
@pytest.mark.parametrize("view", VIEWS)
def test_axe_finds_no_fault(
    page: Any, address: str, view: str, size: tuple[int, int], scheme: str
) -> None:
    rules = axe()
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": size[0], "height": size[1]})
    try:
        page.goto("about:blank")
        page.goto(f"{address}#{view}")
        page.wait_for_timeout(1500)
        page.evaluate(rules)
        found = page.evaluate("(rules) => axe.run(document, { runOnly: rules })", RULES)
        faults = [
            (one["id"], [node["target"] for node in one["nodes"]])
            for one in found["violations"]
        ]
        assert faults == []
    finally:
        page.emulate_media(color_scheme="light")
        page.set_viewport_size({"width": 1440, "height": 1000})


def test_at_four_times_the_size_nothing_scrolls_sideways(
    page: Any, address: str
) -> None:
    # 400 % of a window of 1280 by 1024 are 320 by 256 CSS pixels.
    page.set_viewport_size({"width": 320, "height": 256})
    try:
        states(page, address, "")
        assert page.evaluate("document.documentElement.scrollWidth") <= 320
    finally:
        page.set_viewport_size({"width": 1440, "height": 1000})


def test_with_reduced_motion_the_films_stand_still(page: Any, address: str) -> None:
    states(page, address, "")
    assert page.inner_text("#hold") == "Play"
    picture = "document.querySelector('#rows canvas').toDataURL()"
    before = page.evaluate(picture)
    page.wait_for_timeout(500)
    assert page.evaluate(picture) == before


@pytest.mark.usefixtures("films")
def test_a_film_moves_while_it_is_on_the_screen(page: Any, address: str) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    try:
        states(page, address, "")
        assert page.inner_text("#hold") == "Pause"
        picture = "document.querySelector('#rows canvas').toDataURL()"
        page.locator("#rows canvas").first.scroll_into_view_if_needed()
        before = page.evaluate(picture)
        until(page, lambda: page.evaluate(picture) != before)
        page.evaluate("scrollTo(0, document.body.scrollHeight)")
        page.wait_for_timeout(200)
        before = page.evaluate(picture)
        page.wait_for_timeout(500)
        assert page.evaluate(picture) == before
    finally:
        page.set_viewport_size({"width": 1440, "height": 1000})


def test_keys_alone_choose_a_state_and_change_the_setpoint(
    page: Any, address: str
) -> None:
    states(page, address, "preset=dmt&set.drive.setpoint=0.8")
    page.focus("#preset")
    reached = []
    for _ in range(60):
        page.keyboard.press("Tab")
        reached.append(
            page.evaluate(
                "(document.activeElement.id || document.activeElement.className)"
            )
        )
    assert {
        "setpoint",
        "setpoint-slider",
        "free",
        "choose-law",
        "name",
        "curve",
        "scope",
    } <= set(reached)
    page.focus("#rows tbody tr[data-state=repulsive] .name")
    page.keyboard.press("Enter")
    page.wait_for_function(
        "() => document.querySelector('#rows tr[data-state=repulsive]').ariaSelected === 'true'"
    )
    page.focus("#setpoint-slider")
    page.keyboard.press("ArrowLeft")
    settled(page)
    spoken = page.get_attribute("#setpoint-slider", "aria-valuetext")
    assert spoken is not None and "%" in spoken and "nm" in spoken
