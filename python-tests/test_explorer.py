"""The explorer in a real browser: what it shows is what the terminal says."""

from __future__ import annotations

import http.client
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = next(
    (
        path
        for name in ("chromium", "chromium-browser", "google-chrome")
        if (path := shutil.which(name))
    ),
    None,
)
PROGRAM = os.environ.get("NANOTAP", "nanotap")
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
OWN = (
    "tip_max",
    "tip_min",
    "amplitude",
    "first_harmonic",
    "phase",
    "contact_fraction",
    "peak_force",
)


def started(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [PROGRAM, "explore", "--no-browser", *words], stdout=subprocess.PIPE, text=True
    )


def line(server: subprocess.Popen[str]) -> str:
    assert server.stdout is not None
    return server.stdout.readline().strip()


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with started() as server:
        yield line(server)
        server.terminate()


def asked(address: str, path: str, body: Any = None, **headers: str) -> bytes:
    base, token = address.split("/?token=")
    request = urllib.request.Request(
        base + path,
        data=None if body is None else json.dumps(body).encode(),
        headers={
            "x-nanotap-token": token,
            "content-type": "application/json",
            **headers,
        },
    )
    with urllib.request.urlopen(request, timeout=120) as answer:
        return bytes(answer.read())


def status(address: str, path: str, **headers: str) -> int:
    try:
        asked(address, path, **headers)
    except urllib.error.HTTPError as error:
        return error.code
    return 200


def motion(address: str, preset: str = "paper", **more: Any) -> dict[str, Any]:
    answer = asked(address, "/api/motion", {"case": {"preset": preset}, **more})
    return dict(json.loads(answer))


def test_only_who_started_it_may_ask(address: str) -> None:
    wrong = {"x-nanotap-token": "0" * 32}
    assert status(address, "/api/about") == 200
    assert status(address, "/api/about", **wrong) == 403
    assert status(address, "/api/about", Origin="http://example.org") == 403
    assert status(address, "/api/about", Host="example.org") == 421
    assert status(address, "/nothing") == 404
    assert status(address, "/") == 403
    with urllib.request.urlopen(address, timeout=30) as page:
        policy = page.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(address.split("=")[0] + "=wrong", timeout=30)
    assert refused.value.code == 403
    assert "nanotap explore" in refused.value.read().decode()


def test_it_listens_on_loopback_only(address: str) -> None:
    port = int(re.findall(r":(\d+)/", address)[0])
    outside = [entry[4][0] for entry in socket.getaddrinfo(socket.gethostname(), port)]
    for host in {str(host) for host in outside} - {"127.0.0.1", "::1"}:
        with pytest.raises(OSError, match="."):
            socket.create_connection((host, port), timeout=2).close()


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"case": {"preset": "none"}}, "no case called"),
        ({"case": {"preset": "paper", "set": ["omgea=3"]}}, "omega"),
        ({"case": {"preset": "paper", "set": ["omega=0"]}}, "omega"),
        ({"case": {"preset": "paper", "set": ["modes=50"]}}, "modes"),
        ({"case": {"preset": "paper"}, "start": "1,2"}, "state"),
        ({"case": {"preset": "paper"}, "start": "a"}, "state"),
    ],
)
def test_what_is_wrong_gets_words(address: str, body: Any, words: str) -> None:
    with pytest.raises(urllib.error.HTTPError) as refused:
        asked(address, "/api/motion", body)
    assert refused.value.code == 422
    assert words in json.loads(refused.value.read())["error"]


def test_its_case_file_and_command_give_the_same_numbers(
    address: str, tmp_path: Path
) -> None:
    for preset in ("paper", "fm-lever", "impact"):
        shown = motion(address, preset)
        body = {"case": {"preset": preset}, "format": "toml"}
        (tmp_path / "case.toml").write_bytes(asked(address, "/api/export", body))
        command = shown["command"].split()
        assert command[0] == "nanotap"
        done = subprocess.run(
            [PROGRAM, *command[1:], "--json"],
            check=True,
            capture_output=True,
            text=True,
            cwd=tmp_path,
        )
        orbit = json.loads(done.stdout)
        values = {row["name"]: row["value"] for row in shown["observables"]}
        for name in OWN:
            if name in orbit and orbit[name] is not None:
                assert values[name] == pytest.approx(orbit[name], rel=1e-12), (
                    preset,
                    name,
                )


@pytest.mark.parametrize("kind", ["svg", "png", "pdf", "csv"])
def test_exports_are_what_they_are_called(address: str, kind: str) -> None:
    saved = asked(address, "/api/export", {"case": {"preset": "paper"}, "format": kind})
    begins = {"svg": b"<", "png": b"\x89PNG", "pdf": b"%PDF", "csv": b"tau,tip"}[kind]
    assert saved.startswith(begins)


def test_a_client_that_goes_away_stops_its_work_and_holds_up_nobody(
    address: str,
) -> None:
    base, token = address.split("/?token=")
    options = {"key": "omega", "from": "2.2", "to": "4"}
    wanted = {"case": {"preset": "paper"}, "tab": "diagram", "options": options}
    body = json.dumps(wanted)
    for _ in range(6):
        client = http.client.HTTPConnection(base.removeprefix("http://"), timeout=60)
        headers = {"x-nanotap-token": token, "content-type": "application/json"}
        client.request("POST", "/api/study", body, headers)
        client.close()
    begun = time.monotonic()
    assert motion(address)["summary"].startswith("period")
    wanted |= {
        "tab": "resonance",
        "options": {"key": "omega", "from": "2.9", "to": "3.1"},
    }
    lines = asked(address, "/api/study", wanted).splitlines()
    assert [json.loads(text)["words"] for text in lines][-1] == "120 values"
    assert time.monotonic() - begun < 100


def test_ctrl_c_ends_it_at_once() -> None:
    with started() as server:
        line(server)
        server.send_signal(signal.SIGINT)
        # At once; a loaded machine may take longer to say so.
        server.wait(10)


@pytest.fixture(scope="module")
def page(address: str) -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine: Debian's package is called chromium")
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": 1440, "height": 1000})
        page.complaints = []
        page.asked = []
        page.on(
            "console",
            lambda m: page.complaints.append(m.text) if m.type == "error" else None,
        )
        page.on("pageerror", lambda error: page.complaints.append(str(error)))
        page.on("request", lambda request: page.asked.append(request.url))
        page.goto(address)
        page.wait_for_selector("td[data-observable=amplitude]")
        yield page
        browser.close()


def opened(page: Any, address: str, fragment: str) -> None:
    """Goes to a link, and waits for what it shows."""
    page.goto("about:blank")
    page.goto(f"{address}#{fragment}")
    idle(page)


def idle(page: Any) -> None:
    page.wait_for_selector("td[data-observable=amplitude]")
    page.wait_for_selector("body[data-busy=no]")


def value(page: Any, name: str) -> float:
    return float(page.get_attribute(f"td[data-observable={name}]", "data-value"))


def until(page: Any, condition: Callable[[], bool]) -> None:
    """Waits from here: the page's policy lets no string become code in it."""
    for _ in range(300):
        if condition():
            idle(page)
            return
        page.wait_for_timeout(100)
    raise AssertionError("nothing changed in 30 s")


def changes(page: Any, before: float) -> None:
    until(page, lambda: value(page, "amplitude") != before)


def test_every_panel_shows_something(page: Any, address: str) -> None:
    opened(page, address, "preset=paper")
    # Deflection, portrait, harmonics, multipliers; height, force, force against height.
    assert len(page.evaluate("document.getElementById('portrait').panels")) == 4
    assert len(page.evaluate("document.getElementById('contact').panels")) == 3
    assert page.locator("#portrait svg path").count() > 5
    assert page.locator("#knobs input[data-key]").count() >= 8
    drawn = "import('/lever.js').then((m) => m.frames.drawn)"
    before = page.evaluate(drawn)
    page.wait_for_timeout(700)
    assert page.evaluate(drawn) > before


def test_its_numbers_are_the_servers(page: Any, address: str) -> None:
    opened(page, address, "preset=paper")
    values = {row["name"]: row["value"] for row in motion(address)["observables"]}
    for name in OWN:
        assert value(page, name) == values[name]


def test_a_knob_changes_the_numbers_and_the_way_back_restores_them(
    page: Any, address: str
) -> None:
    opened(page, address, "preset=paper")
    before = value(page, "amplitude")
    page.fill("[data-key=omega]", "3.3")
    page.press("[data-key=omega]", "Enter")
    changes(page, before)
    assert "set.omega=3.3" in page.url
    after = value(page, "amplitude")
    page.go_back()
    changes(page, after)
    assert value(page, "amplitude") == before
    # By the keyboard alone.
    page.focus("[data-slider=alpha2]")
    page.keyboard.press("ArrowRight")
    changes(page, before)


def test_a_wrong_value_is_said_beside_its_knob(page: Any, address: str) -> None:
    opened(page, address, "preset=paper")
    page.fill("[data-key=omega]", "-1")
    page.press("[data-key=omega]", "Enter")
    page.wait_for_selector("#message:not([hidden])")
    assert "omega" in page.inner_text("#message")
    assert page.get_attribute("[data-key=omega]", "aria-invalid") == "true"
    # The browser reports the refusal itself, as of every answer that is not 200.
    page.complaints[:] = [words for words in page.complaints if "422" not in words]


def test_a_link_restores_the_view(page: Any, address: str) -> None:
    opened(page, address, "preset=paper-fast&set.alpha4=15&tab=basin&study.fromx=-0.5")
    assert page.input_value("#preset") == "paper-fast"
    assert page.input_value("[data-key=alpha4]") == "15"
    assert page.get_attribute("#tab-basin", "aria-selected") == "true"
    assert page.input_value("#study-form [name=fromx]") == "-0.5"


def test_the_census_lists_what_coexists_and_a_click_shows_it(
    page: Any, address: str
) -> None:
    opened(page, address, "preset=paper-fast")
    page.click("#census")
    # Ω = 20 without a tip mass: period 1 and period 4 (the paper's Figs. 15 and 17).
    page.wait_for_selector("#attractors button >> nth=1", timeout=60_000)
    words = " ".join(page.locator("#attractors button").all_inner_texts())
    assert sorted(re.findall(r"period (\d+)", words)) == ["1", "4"]
    page.click("#attractors button:has-text('period 4')")
    until(page, lambda: "period 4" in page.inner_text("#summary"))


@pytest.mark.parametrize(
    ("tab", "options"),
    [
        ("diagram", {"from": "2.2", "to": "2.4"}),
        ("branches", {"from": "2.9", "to": "3.1"}),
        ("resonance", {"from": "2.9", "to": "3.1"}),
        ("approach", {"to": "0"}),
        ("basin", {}),
        ("map", {"from2": "2.9", "to2": "3.1"}),
    ],
)
def test_a_click_on_a_study_goes_to_the_motion_there(
    page: Any, address: str, tab: str, options: dict[str, str]
) -> None:
    opened(page, address, f"preset=paper&tab={tab}")
    for name, text in options.items():
        page.fill(f"#study-form [name={name}]", text)
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#study-figure svg", timeout=90_000)
    page.click("#study-form button:has-text('Stop')")
    panel = page.evaluate("document.getElementById('study-figure').panels[0]")
    drawn = page.locator("#study-figure svg").bounding_box()
    view = page.evaluate(
        "(({width}) => width)(document.querySelector('#study-figure svg').viewBox.baseVal)"
    )
    scale = drawn["width"] / view
    before = page.url
    # Scrolls to it, where it lies below the window.
    page.locator("#study-figure svg").click(
        position={
            "x": scale * (panel["left"] + 0.6 * panel["width"]),
            "y": scale * (panel["top"] + 0.5 * panel["height"]),
        }
    )
    until(page, lambda: page.url != before)
    moved = (
        "start="
        if tab == "basin"
        else "set.alpha5="
        if tab == "approach"
        else "set.omega="
    )
    assert moved in page.url
    if tab in ("diagram", "branches", "resonance"):
        value = float(re.findall(r"set\.omega=([\d.]+)", page.url)[0])
        assert float(options["from"]) <= value <= float(options["to"])


def test_few_fixed_steps_show_what_is_not_there(page: Any, address: str) -> None:
    opened(page, address, "preset=paper&steps=80")
    assert "80 steps a period show" in page.inner_text("#spurious")
    assert page.locator("#fixed svg").count() == 1


def test_nothing_leaves_the_machine_and_nothing_complains(
    page: Any, address: str
) -> None:
    own = address.split("/?")[0]
    assert len(page.asked) > 20
    assert all(url.startswith((own, "data:", "blob:", "about:")) for url in page.asked)
    assert page.complaints == []
