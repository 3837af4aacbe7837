"""The panels of the page while they are empty, partial, refused or of former values; and a minute of dragging."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browsers import held, limited
from test_page_states import NUMBERS, solved, until

CURVE = Path(__file__).parent.parent / "docs/cases/polystyrene-curve.csv"
DMT = "preset=dmt&set.drive.setpoint=0.8"
# Seconds for which a slider is dragged.
DRAGGED = 30


@pytest.fixture(autouse=True)
def _limit() -> Iterator[None]:
    with limited():
        yield


def opened(page: Any, address: str, fragment: str) -> None:
    page.goto("about:blank")
    page.goto(f"{address}#{fragment}")


def words(page: Any, place: str) -> str:
    return str(page.inner_text(place))


def has_class(page: Any, place: str, name: str) -> bool:
    return name in (page.get_attribute(place, "class") or "").split()


def test_the_states_are_never_without_words(page: Any, address: str) -> None:
    # Empty: another example than the first has no rows before the program answers.
    with held(page, "/api/states"):
        opened(page, address, "preset=hertz&set.drive.setpoint=0.8")
        until(page, lambda: "looking" in words(page, "#states-heading"))
        assert page.locator("#rows tbody tr").count() == 0
        assert words(page, "#scope-heading") == "Choose a state."
    page.wait_for_selector("#rows tbody tr")
    # Partial: the curve is followed, then the search goes on.
    with held(page, "/api/attractors"):
        with held(page, "/api/curve"):
            opened(page, address, DMT)
            page.wait_for_selector("body[data-rows=done]")
            until(page, lambda: "following the states" in words(page, "#curve-words"))
        until(page, lambda: "A click sets" in words(page, "#curve-words"))
        until(page, lambda: "searching" in words(page, "#sure"))
        assert page.locator("#rows tbody tr").count() == 3
    until(page, lambda: "Searched from" in words(page, "#sure"))
    # Stale: rows of another free amplitude are grey until the new ones come.
    with held(page, "/api/states"):
        page.fill("#free", "22 nm")
        page.press("#free", "Enter")
        until(page, lambda: has_class(page, "#rows", "stale"))
        assert page.locator("#rows tbody tr").count() == 3
    until(page, lambda: not has_class(page, "#rows", "stale"))
    # Refused: the reason and its field; the former rows stay, grey.
    page.click("#all > summary")
    page.fill("[data-key='tip.radius']", "-5 nm")
    page.press("[data-key='tip.radius']", "Enter")
    page.wait_for_selector("#message:not([hidden])")
    assert "tip.radius" in words(page, "#message")
    assert page.get_attribute("[data-key='tip.radius']", "aria-invalid") == "true"
    assert has_class(page, "#rows", "stale")
    page.click("#undo")
    until(page, lambda: not has_class(page, "#rows", "stale"))
    until(page, lambda: page.is_hidden("#message"))


def test_the_plan_says_how_far_it_is(page: Any, address: str) -> None:
    with held(page, "/api/study"):
        opened(page, address, f"view=plan&{DMT}")
        page.wait_for_selector("#plan-head")
        assert words(page, "#plan-head").startswith("Looking near")
        assert page.is_hidden("#plan-map")
    # Partial: an answer, so far.
    page.wait_for_selector("#plan-line")
    assert words(page, "#plan-far").startswith("So far:")
    # Refused by the page, with what would be accepted.
    page.fill("#plan-force", "much")
    page.press("#plan-force", "Enter")
    until(page, lambda: "How many nN" in words(page, "#plan-wrong"))
    assert page.get_attribute("#plan-force", "aria-invalid") == "true"
    # Stale: the answer to the former wish is struck through.
    assert has_class(page, "#plan-say", "former")
    assert has_class(page, "#plan-map", "stale")
    assert words(page, "#plan-far") == "of the former values"
    page.fill("#plan-force", "1.6")
    page.press("#plan-force", "Enter")
    until(page, lambda: not has_class(page, "#plan-say", "former"))
    # Refused by the program: an equation without units has no wishes.
    opened(page, address, "view=plan&preset=paper")
    page.wait_for_selector("#view-plan[data-plan=refused]")
    assert words(page, "#plan-say")
    assert page.is_hidden("#plan-map")


def test_the_scan_says_what_it_shows(page: Any, address: str) -> None:
    # Empty, then partial: the averaged line until the exact one comes.
    exact = "view=scan&preset=dmt"
    with held(page, "/api/study"):
        opened(page, address, exact)
        page.wait_for_selector("#strips[data-line=stale]")
        until(page, lambda: "computing the line" in words(page, "#scan-state"))
    page.wait_for_selector("#strips[data-line=approximate]")
    assert words(page, "#scan-state").startswith("≈")
    page.wait_for_selector("#strips[data-line=exact]")
    # Stale: of the former value of a knob.
    with held(page, "/api/study"):
        page.fill("#scan-gain", "300")
        page.press("#scan-gain", "Enter")
        page.wait_for_selector("#strips[data-line=stale]")
        assert "of the former value: gain" in words(page, "#scan-state")
    page.wait_for_selector("#strips[data-line=exact]")
    # Refused.
    page.fill("#scan-height", "high")
    page.press("#scan-height", "Enter")
    page.wait_for_selector("#strips[data-line=failed]")
    assert "high" in words(page, "#scan-say")
    page.select_option("#scan-surface", "drawn")
    until(page, lambda: "Draw the surface" in words(page, "#scan-say"))
    # An equation without units makes no image.
    opened(page, address, "view=scan&preset=paper")
    page.wait_for_selector("#strips[data-line=none]", state="attached")
    assert "no lever" in words(page, "#scan-say")


def test_my_data_say_what_is_wrong_with_a_file(
    page: Any, address: str, tmp_path: Path
) -> None:
    file = "#study-form input[type=file]"
    # Empty.
    opened(page, address, f"view=data&{DMT}")
    page.wait_for_selector(file)
    assert "Drop a file" in words(page, "#view-data")
    assert page.is_hidden("#study-figure")
    # Partial.
    page.set_input_files(file, CURVE)
    until(page, lambda: "100 rows" in words(page, "#progress"))
    with held(page, "/api/study"):
        page.click("#fit")
        until(page, lambda: "computing" in words(page, "#progress"))
        assert page.is_visible("#stop")
        page.click("#stop")
        until(page, lambda: words(page, "#progress") == "stopped")
    # What was there is still there.
    assert page.is_visible("#study-figure")
    # Refused, with the place in the file.
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("distance (nm),amplitude (nm)\n18,17\n17,many\n16,15\n")
    page.set_input_files(file, wrong)
    until(page, lambda: "many" in words(page, "#progress"))
    assert "3" in words(page, "#progress")
    # Stale: a fit of other values stays, grey.
    page.set_input_files(file, CURVE)
    until(page, lambda: "100 rows" in words(page, "#progress"))
    page.click("#reconstruct")
    page.wait_for_selector("#tables button")
    page.fill("#free", "21 nm")
    page.press("#free", "Enter")
    until(page, lambda: page.is_visible("#stale"))
    assert words(page, "#stale") == "computed for other values"
    assert has_class(page, "#study-figure", "stale")


def test_a_study_says_how_far_it_is(page: Any, address: str) -> None:
    # Empty: what the study shows, and no figure.
    opened(page, address, "preset=paper&tab=map")
    page.wait_for_selector("#study-form button[type=submit]")
    assert "over two parameters" in words(page, "#progress")
    assert page.is_hidden("#study-figure")
    # Partial.
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#study-figure canvas")
    until(page, lambda: "values" in words(page, "#progress"))
    until(page, lambda: words(page, "#progress") == "2304 values")
    # Stale.
    page.fill("[data-key=alpha1]", "0.12")
    page.press("[data-key=alpha1]", "Enter")
    until(page, lambda: page.is_visible("#stale"))
    assert has_class(page, "#study-figure", "stale")
    # Refused: the field and what would be accepted.
    page.fill("#study-form [name=from1]", "")
    page.press("#study-form [name=from1]", "Enter")
    page.click("#study-form button[type=submit]")
    until(page, lambda: "from1" in words(page, "#progress"))
    assert has_class(page, "#study-figure", "stale")


def test_a_late_answer_does_not_take_the_slider(page: Any, address: str) -> None:
    late = []

    def later(route: Any) -> None:
        late.append(route)

    # The motion of the chosen state is answered after its setpoint has moved on, and before the states there.
    page.route("**/api/motion*", later)
    page.goto("about:blank")
    page.goto(f"{address}#preset=dmt&set.drive.setpoint=0.8")
    until(page, lambda: bool(late))
    late.pop().continue_()
    page.wait_for_selector("body[data-rows=done]")
    until(page, lambda: bool(late))
    box = page.locator("#setpoint-slider").bounding_box()
    y = box["y"] + box["height"] / 2

    def move(part: float) -> float:
        page.mouse.move(box["x"] + part * box["width"], y)
        return float(page.input_value("#setpoint").removesuffix(" %"))

    page.mouse.move(box["x"] + 0.78 * box["width"], y)
    page.mouse.down()
    page.route("**/api/states*", lambda route: None)
    seen = [move(0.7)]
    for part in (0.6, 0.5, 0.4):
        while late:
            late.pop().continue_()
        page.wait_for_timeout(300)
        seen.append(move(part))
    page.mouse.up()
    page.unroute_all(behavior="ignoreErrors")
    assert all(high > low for high, low in itertools.pairwise(seen)), seen


@pytest.mark.alone
def test_a_slider_is_dragged_for_long(page: Any, address: str, tmp_path: Path) -> None:
    opened(page, address, "preset=dmt&set.modes=3&set.drive.setpoint=0.8")
    until(page, lambda: "A click sets" in words(page, "#curve-words"))
    page.complaints.clear()
    page.evaluate(
        "() => { window.frames_ = 0; const next = () => { window.frames_ += 1; requestAnimationFrame(next); }; next(); }"
    )
    # Every exact row that is drawn, however short it is seen.
    page.evaluate(
        """() => {
          window.exact_ = new Set();
          new MutationObserver(() => {
            const row = document.querySelector('#rows tbody tr');
            if (row && !row.classList.contains('approximate')) window.exact_.add(row.querySelector('td.distance').dataset.value);
          }).observe(document.body, { childList: true, subtree: true, attributes: true, attributeFilter: ['class'] });
        }"""
    )
    client = page.context.new_cdp_session(page)
    client.send("Performance.enable")

    def measured() -> dict[str, float]:
        client.send("HeapProfiler.collectGarbage")
        values = client.send("Performance.getMetrics")["metrics"]
        return {one["name"]: one["value"] for one in values}

    box = page.locator("#setpoint-slider").bounding_box()
    y = box["y"] + box["height"] / 2

    def at(part: float) -> float:
        return float(box["x"] + part * box["width"])

    page.mouse.move(at(0.78), y)
    page.mouse.down()
    paused: dict[str, dict[str, float]] = {}
    before = None
    begun = time.monotonic()
    frames = page.evaluate("window.frames_")
    read = """() => {
      const row = document.querySelector('#rows tbody tr');
      if (!row || row.classList.contains('approximate')) return null;
      const value = (name) => Number(row.querySelector('td.' + name).dataset.value);
      return { distance: value('distance'), phase: value('phase'), force: value('force') };
    }"""
    k = 0
    while time.monotonic() - begun < DRAGGED:
        # To and fro between 40 % and 90 %.
        part = 0.4 + 0.5 * abs((k / 100) % 2 - 1)
        page.mouse.move(at(part), y)
        page.wait_for_timeout(30)
        if k % 150 == 149:
            # The slider is still held.
            page.wait_for_selector("body[data-rows=done]")
            paused[page.input_value("#setpoint")] = page.evaluate(read)
        if before is None and time.monotonic() - begun > DRAGGED / 4:
            before = measured()
        k += 1
    took = time.monotonic() - begun
    frames = page.evaluate("window.frames_") - frames
    page.mouse.up()
    page.wait_for_selector("body[data-rows=done]")
    after = measured()
    # Smooth, exact on the way, without complaints, and without growth.
    assert frames / took > 15, frames / took
    exact = page.evaluate("window.exact_.size")
    assert exact > 2 * len(paused), (exact, paused)
    assert page.complaints == []
    assert before is not None
    grown = after["JSHeapUsedSize"] - before["JSHeapUsedSize"]
    assert grown < 4e6, (before["JSHeapUsedSize"], grown)
    for name in ("Nodes", "JSEventListeners"):
        assert after[name] < 1.3 * before[name] + 100, (name, before[name], after[name])
    # Rows on the way are the terminal's at these setpoints.
    assert len(paused) > 1
    for setpoint, row in paused.items():
        part = float(setpoint.removesuffix(" %")) / 100
        case = {"preset": "dmt", "set": ["modes=3", f"drive.setpoint={part:g}"]}
        near = [
            one
            for one in solved(address, case, tmp_path)
            if one["zc"] == pytest.approx(row["distance"], rel=1e-8)
        ]
        assert near, (setpoint, row)
        assert near[0][NUMBERS["force"]] == pytest.approx(
            row["force"], rel=1e-6, abs=1e-15
        )
