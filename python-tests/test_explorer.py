"""The explorer in a real browser, compared with the terminal's results."""

from __future__ import annotations

import base64
import contextlib
import http.client
import json
import math
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import tomllib
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from browsers import (
    WAIT,
    address_of,
    asked,
    case_file,
    held,
    idle,
    limited,
    observed,
    printed,
    started,
    stopped,
    studied,
    until,
)
from program import PROGRAM

OWN = (
    "tip_max",
    "tip_min",
    "amplitude",
    "first_harmonic",
    "phase",
    "contact_fraction",
    "peak_force",
)


@pytest.fixture(autouse=True)
def _limit() -> Iterator[None]:
    with limited():
        yield


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
        orbit = printed(tmp_path, *command[1:])
        values = {row["name"]: row["value"] for row in shown["observables"]}
        for name in OWN:
            if name in orbit and orbit[name] is not None:
                assert values[name] == pytest.approx(orbit[name], rel=1e-12), (
                    preset,
                    name,
                )


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"", 422),
        (b"{", 422),
        (b'{"case": 1}', 422),
        (b'{"case": {"preset": "paper"}, "what": 1}', 422),
        (b'{"case": {"preset": "paper"}, "steps": -1}', 422),
        (b'{"case": {"preset": "' + b"x" * 5_000_000 + b'"}}', 413),
    ],
    ids=["empty", "broken", "no case", "unknown field", "negative", "long"],
)
def test_messages_that_are_none_are_refused(
    address: str, body: bytes, status: int
) -> None:
    base, token = address.split("/?token=")
    headers = {"x-nanotap-token": token, "content-type": "application/json"}
    request = urllib.request.Request(base + "/api/motion", data=body, headers=headers)
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(request, timeout=60)
    assert refused.value.code == status
    assert refused.value.read()


@pytest.mark.parametrize("kind", ["svg", "png", "pdf", "csv"])
def test_exports_are_what_they_are_called(address: str, kind: str) -> None:
    saved = asked(address, "/api/export", {"case": {"preset": "paper"}, "format": kind})
    begins = {"svg": b"<", "png": b"\x89PNG", "pdf": b"%PDF", "csv": b"tau,tip"}[kind]
    assert saved.startswith(begins)


def first_stage(address: str, **asked_for: Any) -> dict[str, Any]:
    """The coarsest figure of a study, which is then stopped."""
    base, token = address.split("/?token=")
    client = http.client.HTTPConnection(base.removeprefix("http://"), timeout=60)
    headers = {"x-nanotap-token": token, "content-type": "application/json"}
    wanted = {"case": {"preset": "paper"}, **asked_for}
    client.request("POST", "/api/study", json.dumps(wanted), headers)
    try:
        return dict(json.loads(client.getresponse().readline()))
    finally:
        client.close()


# A map with a value and no columns for it.
EMPTY_MAP = {
    "layers": [
        {"kind": "heatmap", "columns": 0, "rows": 0, "values": [1.0]}
        | {"x": [0, 1], "y": [0, 1], "scale": {"label": "height"}}
    ]
}


def test_a_studys_figure_is_saved_and_seen_in_part(address: str) -> None:
    study = studied(address, tab="approach", options={"to": "0"})[-1]
    begins = {"svg": b"<", "png": b"\x89PNG", "pdf": b"%PDF", "csv": b"# panel 0, x: "}
    for kind, first in begins.items():
        wish = {"figure": study["figure"], "format": kind}
        assert asked(address, "/api/figure", wish).startswith(first)
    views = [{"panel": 1, "x": [1, 2], "y": [10, 40]}]
    wish = {"figure": study["figure"], "views": views, "format": "svg"}
    part = asked(address, "/api/figure", wish)
    whole = asked(address, "/api/figure", wish | {"views": []})
    assert part.startswith(b"<") and part != whole
    for wrong in (
        {"figure": {"panels": 1}, "format": "svg"},
        {"figure": study["figure"], "format": "gif"},
        {"figure": {"rows": 1, "cols": 1, "panels": [EMPTY_MAP]}, "format": "csv"},
        wish | {"views": [{"panel": 0, "x": [1, 1], "y": [0, 1]}]},
    ):
        with pytest.raises(urllib.error.HTTPError) as refused:
            asked(address, "/api/figure", wrong)
        assert refused.value.code == 422
        assert json.loads(refused.value.read())["error"]


def test_the_first_values_of_a_form_make_sense(address: str) -> None:
    # Its tip rests on the sample: the form has a range of distances around 0 nm.
    forms = motion(address, "soft-sample")["forms"]
    options = {field["name"]: field["value"] for field in forms["map"]}
    assert options["key1"] == "gap.tip" and "nm" in options["to1"]
    first = first_stage(
        address, case={"preset": "soft-sample"}, tab="map", options=options
    )
    assert "figure" in first, first


def test_a_studys_lines_of_python_give_the_same(address: str, tmp_path: Path) -> None:
    study = first_stage(
        address, tab="resonance", options={"key": "omega", "from": "3", "to": "3.1"}
    )
    assert "nanotap sweep case.toml --over omega=3:3.1:30" in study["command"]
    body = {"case": {"preset": "paper"}, "format": "toml"}
    (tmp_path / "case.toml").write_bytes(asked(address, "/api/export", body))
    pytest.importorskip("nanotap")
    shown = (
        "import json\n"
        "print(json.dumps([sweep['omega'].values.tolist(),"
        " sweep['first_harmonic'].values[:, 0].tolist()]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", study["python"] + shown],
        check=True,
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    drawn = {round(x, 9): heights[0][0] for x, heights, _ in study["clicks"]["near"]}
    for x, y in zip(*json.loads(done.stdout), strict=True):
        assert drawn[round(x, 9)] == pytest.approx(y, rel=1e-9)


def test_the_tours_jumps_are_where_it_says(address: str) -> None:
    # docs/explorer.md: up beyond 332.1 kHz, down at 330.6 kHz.
    study = studied(
        address,
        case={"preset": "stiff-lever"},
        tab="resonance",
        options={"key": "drive.frequency", "from": "327.03 kHz", "to": "333.63 kHz"},
    )[1]
    met: dict[float, list[float]] = {}
    for x, heights, start in study["clicks"]["near"]:
        assert ":" not in start
        met.setdefault(x, []).append(heights[0][0])
    assert len(met) == 120
    apart = [
        x for x, amplitudes in met.items() if max(amplitudes) - min(amplitudes) > 1
    ]
    assert min(apart) == pytest.approx(330.6, abs=0.1)
    assert max(apart) == pytest.approx(332.1, abs=0.1)


def test_slow_and_broken_clients_hold_up_nobody(address: str) -> None:
    host = ("127.0.0.1", int(re.findall(r":(\d+)/", address)[0]))
    token = address.split("=")[1]
    head = (
        f"POST /api/motion HTTP/1.1\r\nHost: 127.0.0.1:{host[1]}\r\n"
        f"x-nanotap-token: {token}\r\ncontent-type: application/json\r\n"
        "content-length: 1000\r\n\r\n"
    )
    said = [head.encode() + b"{", head[:40].encode(), b"\x00\xff\r\n\r\n", b""]
    clients = [socket.create_connection(host, timeout=5) for _ in range(40)]
    try:
        for k, client in enumerate(clients):
            client.sendall(said[k % len(said)])
        assert motion(address)["summary"].startswith("period")
    finally:
        for client in clients:
            client.close()


def test_a_client_that_goes_away_stops_its_work_and_holds_up_nobody(
    address: str,
) -> None:
    base, token = address.split("/?token=")
    # Thousands of chaotic motions, two at a time. If a disconnected client were not noticed, each
    # would run until the limit of 300 s: twenty minutes in all.
    options = {
        "key1": "omega",
        "from1": "2.55",
        "to1": "2.65",
        "key2": "alpha1",
        "from2": "0.095",
        "to2": "0.105",
    }
    wanted = {"case": {"preset": "paper"}, "tab": "map", "options": options}
    body = json.dumps(wanted)
    for _ in range(8):
        client = http.client.HTTPConnection(base.removeprefix("http://"), timeout=60)
        headers = {"x-nanotap-token": token, "content-type": "application/json"}
        client.request("POST", "/api/study", body, headers)
        client.close()
    assert motion(address)["summary"].startswith("period")
    wanted |= {
        "tab": "resonance",
        "options": {"key": "omega", "from": "2.9", "to": "3.1"},
    }
    lines = asked(address, "/api/study", wanted).splitlines()
    words = [json.loads(text)["words"] for text in lines]
    assert words[-1].startswith("120 values and")


def test_ctrl_c_ends_it_at_once() -> None:
    with started() as server:
        address_of(server)
        server.send_signal(signal.SIGINT)
        # At once; a loaded machine may take longer.
        server.wait(10)


def test_it_ends_in_the_midst_of_work_and_leaves_no_files(tmp_path: Path) -> None:
    with started(TMPDIR=str(tmp_path)) as server:
        base, token = address_of(server).split("/?token=")
        options = {"key": "omega", "from": "2.2", "to": "4"}
        wanted = {"case": {"preset": "paper"}, "tab": "diagram", "options": options}
        client = http.client.HTTPConnection(base.removeprefix("http://"), timeout=60)
        headers = {"x-nanotap-token": token, "content-type": "application/json"}
        client.request("POST", "/api/study", json.dumps(wanted), headers)
        # Its first stage has come, the next one is being computed.
        assert "figure" in json.loads(client.getresponse().readline())
        server.terminate()
        server.wait(10)
        client.close()
    assert list(tmp_path.iterdir()) == []


def test_levers_and_laws_say_what_they_are(address: str) -> None:
    keys = {key["name"]: key for key in motion(address, "fm-lever")["keys"]}
    levers = {c["word"]: c["meaning"] for c in keys["cantilever.lever"]["choices"]}
    assert levers["PPP-FM"] == "k = 2.8 N/m, f0 = 75 kHz"
    laws = {c["word"]: c["meaning"] for c in keys["sample.law"]["choices"]}
    assert {"spring-damper", "kelvin-voigt", "hertz", "dmt", "jkr"} <= set(laws)
    assert all("F = " in meaning for meaning in laws.values())


def presets(address: str, group: str) -> list[str]:
    about = json.loads(asked(address, "/api/about"))
    return [one["name"] for one in about["presets"] if one["group"] == group]


def refusal(address: str, path: str, body: Any) -> dict[str, Any]:
    with pytest.raises(urllib.error.HTTPError) as refused:
        asked(address, path, body)
    assert refused.value.code == 422
    return dict(json.loads(refused.value.read()))


def words(changes: dict[str, str]) -> list[str]:
    return [f"{key}={text}" for key, text in changes.items()]


def test_every_law_can_be_chosen_from_every_lever(address: str) -> None:
    keys = {key["name"]: key for key in motion(address, "dmt")["keys"]}
    laws = [choice["word"] for choice in keys["sample.law"]["choices"]]
    assert len(laws) == len(set(laws)) >= 29
    for preset in presets(address, "Levers"):
        for law in [*laws, "hertz + capillary"]:
            chosen = {"case": {"preset": preset}, "law": law}
            answer = json.loads(asked(address, "/api/law", chosen))
            case = {"preset": preset, "set": words(answer["set"])}
            assert f'law = "{law}"' in case_file(address, case), (preset, law)
            for key, text in answer["set"].items():
                if key != "sample.law":
                    said = f"with {key}" if text else f"without {key}"
                    assert said in answer["words"]
    wrong = {"case": {"preset": "dmt"}, "law": "plastic"}
    assert "sample.law" in refusal(address, "/api/law", wrong)["keys"]


def test_every_contact_can_be_chosen_from_every_cantilever(address: str) -> None:
    """In the model's units: what is shown is what the case file states."""
    walked = 0
    for preset in presets(address, "Numbers of the equations"):
        keys = {key["name"]: key for key in motion(address, preset)["keys"]}
        choices = keys["contact"]["choices"] if "contact" in keys else []
        for word in [choice["word"] for choice in choices]:
            chosen = {"case": {"preset": preset}, "law": word}
            answer = json.loads(asked(address, "/api/law", chosen))
            case = {"preset": preset, "set": words(answer["set"])}
            stated = tomllib.loads(case_file(address, case))["model"]
            assert stated.get("contact", "spring-damper") == word
            case["set"].append("modes=1")
            shown = json.loads(asked(address, "/api/motion", {"case": case}))["keys"]
            named = {key["name"]: key["value"] for key in shown}
            assert named["contact"] == word
            for key, text in answer["set"].items():
                if text and key in named:
                    assert named[key] == text, (preset, word, key)
            walked += 1
    assert walked >= 15


def test_no_slider_leads_to_a_case_that_is_refused(address: str) -> None:
    groups = ("Levers", "Numbers of the equations")
    walked = 0
    for preset in [name for group in groups for name in presets(address, group)]:
        # Distances for setpoints are found by other tests; here they would take long.
        fixed = {"stiff-lever": ["gap.tip=16 nm"]}.get(preset, [])
        case = {"preset": preset, "set": fixed}
        asked_for = {"case": case, "ranges": True}
        keys = json.loads(asked(address, "/api/motion", asked_for))["keys"]
        for key in keys:
            slider = key.get("slider")
            for part in (0.05, 0.5, 0.95) if slider else ():
                low, high = slider["from"], slider["to"]
                if slider["log"]:
                    value = low * (high / low) ** part
                else:
                    value = low + part * (high - low)
                number = round(value) if key["name"] == "modes" else f"{value:.5g}"
                others = [word for word in fixed if not word.startswith(key["name"])]
                word = f"{key['name']}={number} {key['unit']}".strip()
                case = {"preset": preset, "set": [*others, word]}
                text = word.split("=")[1]
                assert states(case_file(address, case), key["name"], text), word
                walked += 1
    assert walked > 400


PREFIXES = {
    "": 0,
    **dict(zip("zafpnµmkMGT", (*range(-21, -2, 3), 3, 6, 9, 12), strict=True)),
}
UNIT = re.compile(
    r"([zafpnµmkMGT]??)(m|m/s|N/m|N s/m|N|Pa s|Pa|Hz|J|J/m\^2|s|g|W|V|kg/m\^3|rad/s|deg|)"
)


def si(text: str) -> float:
    """A quantity as text, in the unit without a prefix."""
    number, _, unit = text.strip().partition(" ")
    match = UNIT.fullmatch(unit)
    assert match is not None, text
    return float(number) * 10.0 ** PREFIXES[match[1]]


def states(file: str, key: str, text: str) -> bool:
    """Whether a case file states this value; some numbers are left out where they are zero."""
    section, _, name = key.rpartition(".")
    stated = tomllib.loads(file)[section or "model"].get(name, 0)
    return si(str(stated)) == pytest.approx(si(text), rel=1e-9, abs=1e-40)


def test_a_state_that_is_none_is_refused_and_the_server_stays(address: str) -> None:
    case = {"preset": "paper"}
    for start in (
        "4000000000:0,0,0,0,0,0",
        "18446744073709551616:0",
        "0:1",
        "-1:0",
        "1:nan",
        "1e999",
        "1:" + "0," * 9999 + "0",
        ":",
    ):
        answer = refusal(address, "/api/motion", {"case": case, "start": start})
        assert "start" in answer["keys"] or "state" in answer["error"], start
        assert len(answer["error"]) < 2000
    assert motion(address)["summary"].startswith("period")


def test_a_refusal_names_the_keys_to_correct(address: str) -> None:
    for preset, word, key in (
        ("paper", "omega=-1", "omega"),
        ("dmt", "tip.radius=-3 nm", "tip.radius"),
        ("dmt", "cantilever.Q=", "cantilever.Q"),
        ("dmt", "sample.stiffness=3 N/m", "sample.stiffness"),
    ):
        case = {"preset": preset, "set": [word]}
        assert key in refusal(address, "/api/motion", {"case": case})["keys"]


def test_half_a_request_is_not_waited_for(address: str) -> None:
    host = ("127.0.0.1", int(re.findall(r":(\d+)/", address)[0]))
    head = (
        f"POST /api/motion HTTP/1.1\r\nHost: 127.0.0.1:{host[1]}\r\n"
        f"x-nanotap-token: {address.split('=')[1]}\r\n"
        "content-type: application/json\r\ncontent-length: 1000\r\n\r\n{"
    ).encode()
    clients = [socket.create_connection(host, timeout=60) for _ in range(2)]
    for client, said in zip(clients, (head, head[:40]), strict=True):
        client.sendall(said)
    for client in clients:
        # The server answers or closes; else this would time out.
        while client.recv(4096):
            pass
        client.close()


@pytest.mark.alone
def test_newer_motions_are_not_held_up_by_slow_ones(address: str) -> None:
    # Chaos in twenty modes: two seconds each.
    slow = {"case": {"preset": "paper-chaos", "set": ["modes=20"]}}
    base, token = address.split("/?token=")
    headers = {"x-nanotap-token": token, "content-type": "application/json"}
    clients = []
    for _ in range(20):
        client = http.client.HTTPConnection(base.removeprefix("http://"), timeout=60)
        client.request("POST", "/api/motion", json.dumps(slow), headers)
        clients.append(client)
    # Until the server has read them all: one that it reads later is newer.
    time.sleep(2)
    assert motion(address)["summary"].startswith("period")
    # The first ones may have been answered before there were newer ones.
    answers = [json.loads(client.getresponse().read()) for client in clients[:10]]
    assert any("newer motions" in one.get("error", "") for one in answers)
    for client in clients:
        client.close()


def test_times_series_of_a_lever_are_in_si(address: str) -> None:
    saved = {"case": {"preset": "dmt"}, "format": "csv"}
    head, first = asked(address, "/api/export", saved).decode().splitlines()[:2]
    assert head.startswith("time (s),tip (m),tip_rate (m/s),gap (m),force (N),contact")
    # The tip moves by some nanometres (A0 = 20 nm).
    assert 1e-12 < abs(float(first.split(",")[1])) < 1e-7


def test_a_followed_motion_does_not_depend_on_the_speed(address: str) -> None:
    # The branch of period 4 at Ω = 20 without a tip mass, which runs from rest do not meet.
    base = {"preset": "paper-fast"}
    census = json.loads(asked(address, "/api/attractors", {"case": base}))
    start = next(one["start"] for one in census["motions"] if one["period"] == 4)

    def followed(values: list[float]) -> dict[str, Any]:
        shown = {"start": start}
        before = base
        for value in values:
            case = {"preset": "paper-fast", "set": [f"alpha4={value}"]}
            body = {"case": case, "start": shown["start"], "from": before}
            shown = json.loads(asked(address, "/api/motion", body))
            before = case
        return shown

    def amplitude(shown: dict[str, Any]) -> float:
        rows = {row["name"]: row["value"] for row in shown["observables"]}
        return float(rows["amplitude"])

    fast, slow = followed([18.0]), followed([19.7, 19.3, 18.8, 18.4, 18.0])
    assert fast["summary"].startswith("period 4")
    assert amplitude(fast) == pytest.approx(amplitude(slow), rel=1e-6)
    # A link to the followed motion shows it.
    case = {"preset": "paper-fast", "set": ["alpha4=18.0"]}
    body = {"case": case, "start": fast["start"]}
    assert amplitude(json.loads(asked(address, "/api/motion", body))) == pytest.approx(
        amplitude(fast), rel=1e-6
    )


def opened(page: Any, address: str, fragment: str, view: str = "studies") -> None:
    """Opens a link, and waits for its view."""
    page.goto("about:blank")
    page.goto(f"{address}#view={view}&{fragment}")
    idle(page)


def changes(page: Any, before: float) -> None:
    until(page, lambda: observed(page, "amplitude") != before)


def inked(page: Any, name: str) -> float:
    """The part of a figure's pixels that are drawn."""
    return float(
        page.evaluate(
            """(name) => {
            const one = document.querySelector(`#${name} canvas`);
            const { data } = one.getContext("2d").getImageData(0, 0, one.width, one.height);
            let drawn = 0;
            for (let k = 3; k < data.length; k += 4) drawn += data[k] > 0;
            return 4 * drawn / data.length;
        }""",
            name,
        )
    )


def draws(page: Any, name: str) -> None:
    """A figure that is in view is painted with the browser's next frame."""
    page.locator(f"#{name}").scroll_into_view_if_needed()
    until(page, lambda: inked(page, name) > 0.01)


@pytest.mark.usefixtures("films")
def test_every_panel_shows_something(page: Any, address: str) -> None:
    opened(page, address, "preset=paper")
    # Deflection, portrait, harmonics, multipliers; height, force, force against height.
    assert len(page.evaluate("document.getElementById('portrait').panels")) == 4
    assert len(page.evaluate("document.getElementById('contact').panels")) == 3
    draws(page, "portrait")
    label = page.get_attribute("#contact canvas", "aria-label")
    assert label.startswith("height over the sample")
    assert page.locator("#knobs input[data-key]").count() >= 8
    drawn = "import('/lever.js').then((m) => m.frames.drawn)"
    page.locator("#lever").scroll_into_view_if_needed()
    before = page.evaluate(drawn)
    until(page, lambda: page.evaluate(drawn) > before)


def test_an_axis_has_at_least_two_numbers(page: Any) -> None:
    ticks = "([from, to, most]) => import('/plot.js').then((m) => m.ticks({ from, to }, most).at.map(([v]) => v))"
    draw = random.Random(1)
    for _ in range(200):
        # Of widths that lie in every decade, around any middle.
        width = 10 ** draw.uniform(-3, 3)
        low = draw.uniform(-2, 1) * width
        most = draw.randint(2, 8)
        at = page.evaluate(ticks, [low, low + width, most])
        assert 2 <= len(at) <= max(most + 1, 6), (low, width, most, at)
        assert low - 1e-6 * width <= at[0] and at[-1] <= low + (1 + 1e-6) * width


def test_its_numbers_are_the_servers(page: Any, address: str) -> None:
    opened(page, address, "preset=paper")
    values = {row["name"]: row["value"] for row in motion(address)["observables"]}
    for name in OWN:
        assert observed(page, name) == values[name]


def test_a_knob_changes_the_numbers_and_the_way_back_restores_them(
    page: Any, address: str
) -> None:
    opened(page, address, "preset=paper")
    before = observed(page, "amplitude")
    page.fill("[data-key=omega]", "3.3")
    page.press("[data-key=omega]", "Enter")
    changes(page, before)
    assert "set.omega=3.3" in page.url
    after = observed(page, "amplitude")
    page.go_back()
    changes(page, after)
    assert observed(page, "amplitude") == before
    # With the keyboard only.
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
    # The browser reports the refusal itself, like every response other than 200.
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
    # Ω = 20 without a tip mass: period 1 and period 4 (the paper's Figs. 15 and 17).
    page.wait_for_selector("#attractors button >> nth=1")
    words = " ".join(page.locator("#attractors button").all_inner_texts())
    assert sorted(re.findall(r"period (\d+)", words)) == ["1", "4"]
    page.click("#attractors button:has-text('period 4')")
    until(page, lambda: "period 4" in page.inner_text("#summary"))


def middle(page: Any, name: str) -> tuple[float, float]:
    box = page.locator(name).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def spot(page: Any, name: str, panel: int, u: float, v: float) -> tuple[float, float]:
    """Positions in the window of fractions of a panel's axes."""
    page.locator(f"#{name}").scroll_into_view_if_needed()
    part = panels(page, name)[panel]
    box = page.locator(f"#{name}").bounding_box()
    return (
        box["x"] + part["left"] + u * part["width"],
        box["y"] + part["top"] + (1 - v) * part["height"],
    )


def panels(page: Any, name: str) -> list[dict[str, Any]]:
    return list(page.evaluate("(name) => document.getElementById(name).panels", name))


def test_a_dragged_slider_moves_the_numbers_on_the_way(page: Any, address: str) -> None:
    opened(page, address, "preset=paper&set.modes=5")
    x, y = middle(page, "[data-slider=omega]")
    page.mouse.move(x, y)
    page.mouse.down()
    met = {observed(page, "amplitude")}
    for k in range(1, 6):
        page.mouse.move(x + 2 * k, y)
        until(page, lambda: observed(page, "amplitude") not in met)
        met.add(observed(page, "amplitude"))
    assert "set.omega" not in page.url
    page.mouse.up()
    until(page, lambda: "set.omega=" in page.url)


def test_an_emptied_knob_takes_its_key_away(page: Any, address: str) -> None:
    opened(page, address, "preset=soft-sample")
    damped = observed(page, "amplitude")
    page.fill("[data-key='sample.damping']", "")
    page.press("[data-key='sample.damping']", "Enter")
    changes(page, damped)
    assert "set.sample.damping=" in page.url
    # Not stated any more: what is shown is the value that it then has.
    assert page.input_value("[data-key='sample.damping']").split(" ")[0] in ("", "0")
    case = {"preset": "soft-sample", "set": ["sample.damping="]}
    rows = json.loads(asked(address, "/api/motion", {"case": case}))["observables"]
    undamped = next(row["value"] for row in rows if row["name"] == "amplitude")
    assert observed(page, "amplitude") == undamped


def test_a_rectangle_zooms_and_a_double_click_shows_all_again(
    page: Any, address: str
) -> None:
    opened(page, address, "preset=paper")
    # The table of the approach curve moves the figure below it.
    page.wait_for_selector("#tables table")
    before = panels(page, "portrait")[1]
    page.mouse.move(*spot(page, "portrait", 1, 0.25, 0.25))
    page.mouse.down()
    page.mouse.move(*spot(page, "portrait", 1, 0.5, 0.5))
    # A figure that is painted again in the middle keeps the drag.
    page.evaluate(
        "import('./figure.js').then((figure) => figure.renew(window.portrait))"
    )
    page.mouse.move(*spot(page, "portrait", 1, 0.75, 0.5))
    page.mouse.up()
    until(page, lambda: "view.portrait.1=" in page.url)
    # Two hundred distances are a table that scrolls by itself.
    assert page.locator("#tables > div").bounding_box()["height"] < 400
    after = panels(page, "portrait")[1]
    for axis, low, high in (("x", 0.25, 0.75), ("y", 0.25, 0.5)):
        start = before[axis]["from"]
        reach = before[axis]["to"] - start
        assert after[axis]["from"] == pytest.approx(
            start + low * reach, abs=0.02 * reach
        )
        assert after[axis]["to"] == pytest.approx(
            start + high * reach, abs=0.02 * reach
        )
    # A link restores the view.
    opened(page, address, page.url.split("#")[1])
    assert panels(page, "portrait")[1] == after
    page.mouse.dblclick(*spot(page, "portrait", 1, 0.5, 0.5))
    until(page, lambda: "view." not in page.url)
    assert panels(page, "portrait")[1] == before


def test_a_figure_is_zoomed_and_read_by_keys(page: Any, address: str) -> None:
    opened(page, address, "preset=paper")
    before = panels(page, "contact")[0]
    page.focus("#contact")
    page.keyboard.press("ArrowRight")
    assert "height over the sample" in page.inner_text("#reading")
    page.keyboard.press("+")
    until(page, lambda: "view.contact.0=" in page.url)
    after = panels(page, "contact")[0]
    reach = [p["x"]["to"] - p["x"]["from"] for p in (before, after)]
    assert reach[1] == pytest.approx(0.5 * reach[0], rel=0.02)
    page.keyboard.press("0")
    until(page, lambda: "view." not in page.url)


@pytest.mark.parametrize(
    ("tab", "options"),
    [
        ("diagram", {"from": "2.9", "to": "3.1"}),
        ("branches", {"from": "2.9", "to": "3.1"}),
        ("resonance", {"from": "2.9", "to": "3.1"}),
        ("approach", {"to": "0"}),
    ],
)
def test_a_click_on_a_drawn_motion_shows_that_motion(
    page: Any, address: str, tab: str, options: dict[str, str]
) -> None:
    shown = {"diagram": "tip_max", "branches": "tip_max"}.get(tab, "first_harmonic")
    fields = "".join(f"&study.{name}={text}" for name, text in options.items())
    opened(page, address, f"preset=paper&tab={tab}{fields}")
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#study-figure canvas")
    stopped(page)
    # A motion in the middle of the figure, from the server's list.
    study = first_stage(address, tab=tab, options={"key": "omega", **options})
    near = study["clicks"]["near"]
    x, heights, _ = near[len(near) // 3]
    panel = panels(page, "study-figure")[0]
    u, v = (
        (at - panel[axis]["from"]) / (panel[axis]["to"] - panel[axis]["from"])
        for axis, at in (("x", x), ("y", max(heights[0])))
    )
    before = page.url
    page.mouse.click(*spot(page, "study-figure", 0, u, v))
    until(page, lambda: page.url != before)
    assert "start=" in page.url
    # That motion, or its neighbour on the same curve.
    reach = panel["y"]["to"] - panel["y"]["from"]
    assert observed(page, shown) == pytest.approx(max(heights[0]), abs=0.05 * reach)
    assert page.locator("#study-figure .base").count() == 1


def test_a_click_meets_the_motion_that_a_run_from_rest_does_not(
    page: Any, address: str
) -> None:
    # Ω = 20 without a tip mass: a run from rest leads to period 1, and period 4 coexists.
    options = {"key": "omega", "from": "19.9", "to": "20.1"}
    fields = "&study.from=19.9&study.to=20.1"
    opened(page, address, f"preset=paper-fast&tab=branches{fields}")
    period = page.inner_text("#summary").split("period ")[1][0]
    other = {"1": 4, "4": 1}[period] if period in "14" else 4
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#study-figure canvas")
    stopped(page)
    study = first_stage(
        address, case={"preset": "paper-fast"}, tab="branches", options=options
    )
    found = [
        (x, heights[0][0])
        for x, heights, start in study["clicks"]["near"]
        if start.startswith(f"{other}:") and abs(x - 20) < 0.05
    ]
    x, y = found[len(found) // 2]
    panel = panels(page, "study-figure")[0]
    u, v = (
        (at - panel[axis]["from"]) / (panel[axis]["to"] - panel[axis]["from"])
        for axis, at in (("x", x), ("y", y))
    )
    page.mouse.click(*spot(page, "study-figure", 0, u, v))
    until(page, lambda: f"period {other}" in page.inner_text("#summary"))


def test_a_click_on_a_basin_starts_a_run_there(page: Any, address: str) -> None:
    opened(page, address, "preset=paper&tab=basin&ran=yes")
    page.wait_for_selector("#study-figure canvas")
    stopped(page)
    page.mouse.click(*spot(page, "study-figure", 0, 0.6, 0.5))
    until(page, lambda: "start=" in page.url)


@pytest.mark.parametrize(
    ("shows", "legend"),
    [
        ("kinds of motion", "period 1"),
        ("peak force", ""),
        ("number of motions", "one"),
    ],
)
def test_a_map_of_two_parameters_and_a_click_on_it(
    page: Any, address: str, shows: str, legend: str
) -> None:
    ranges = "study.from1=18&study.to1=22&study.from2=3.0&study.to2=3.1"
    words = shows.replace(" ", "+")
    opened(page, address, f"preset=paper&tab=map&ran=yes&{ranges}&study.show={words}")
    page.wait_for_selector("#study-figure canvas")
    stopped(page)
    said = page.locator("#study-figure [aria-label]").evaluate_all(
        "(all) => all.map((one) => one.getAttribute('aria-label')).join(' ')"
    )
    assert legend in said
    if not legend:
        assert "peak force on the tip" in said
    page.mouse.click(*spot(page, "study-figure", 0, 0.6, 0.5))
    until(page, lambda: "set.alpha4=" in page.url and "set.omega=" in page.url)
    alpha4, omega = (
        float(re.findall(rf"set\.{key}=([\d.]+)", page.url)[0])
        for key in ("alpha4", "omega")
    )
    # Cells extend half a step beyond the ends of the ranges.
    assert alpha4 == pytest.approx(18 + 0.6 * 4, abs=0.15)
    assert omega == pytest.approx(3.05, abs=0.005)


def test_a_link_computes_its_study_again(page: Any, address: str) -> None:
    link = "preset=paper&tab=approach&ran=yes&study.to=0&view.study.0=1,2,0,3"
    opened(page, address, link)
    page.wait_for_selector("#study-figure canvas")
    panel = panels(page, "study-figure")[0]
    assert (panel["x"]["from"], panel["x"]["to"]) == (1, 2)


def test_a_motion_is_followed_as_knobs_turn(page: Any, address: str) -> None:
    opened(page, address, "preset=paper-fast&follow=yes")
    page.wait_for_selector("#attractors button >> nth=1")
    page.click("#attractors button:has-text('period 4')")
    until(page, lambda: "period 4" in page.inner_text("#summary"))
    page.fill("[data-key=omega]", "20.01")
    page.press("[data-key=omega]", "Enter")
    until(page, lambda: "set.omega=20.01" in page.url)
    assert "period 4" in page.inner_text("#summary")


@pytest.mark.parametrize("size", [(1280, 720), (1920, 1080), (800, 600), (3840, 2160)])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_runs_over_the_edge(
    page: Any, address: str, size: tuple[int, int], scheme: str
) -> None:
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": size[0], "height": size[1]})
    try:
        opened(page, address, "preset=fm-lever")
        wide = page.evaluate("document.documentElement.scrollWidth")
        assert wide <= size[0]
        ink, back = page.evaluate(
            """() => ['color', 'backgroundColor'].map(
                (what) => getComputedStyle(document.body)[what])"""
        )
        # Contrast of text of at least 7 : 1, as the guidelines for the web count it.
        bright, dim = sorted(map(luminance, (ink, back)), reverse=True)
        assert (bright + 0.05) / (dim + 0.05) > 7
    finally:
        page.emulate_media(color_scheme="light")
        page.set_viewport_size({"width": 1440, "height": 1000})


def luminance(colour: str) -> float:
    parts = [int(part) / 255 for part in re.findall(r"\d+", colour)[:3]]
    linear = [
        p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts
    ]
    return sum(w * p for w, p in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def test_the_keyboard_reaches_everything(page: Any, address: str) -> None:
    opened(page, address, "preset=paper")
    reached = set()
    page.focus("#preset")
    for _ in range(120):
        page.keyboard.press("Tab")
        reached.add(
            page.evaluate(
                "(one => one.id || one.dataset.slider || one.textContent)(document.activeElement)"
            )
        )
    for wanted in ("key-omega", "omega", "play", "contact", "portrait", "unstable"):
        assert wanted in reached
    for wanted in (
        "steps",
        "which",
        "tab-approach",
        "reset",
        "study-figure",
        "follow",
    ):
        assert wanted in reached
    # Screen readers read the name of each control.
    unnamed = page.locator("#knobs input, #knobs select").evaluate_all(
        """(all) => all.filter(
            (one) => !one.labels?.length && !one.getAttribute('aria-label')).length"""
    )
    assert unnamed == 0


def test_few_fixed_steps_show_what_is_not_there(page: Any, address: str) -> None:
    opened(page, address, "preset=paper&steps=80")
    assert "80 steps per period" in page.inner_text("#spurious")
    assert page.locator("#fixed .base").count() == 1


def read(page: Any, name: str) -> str:
    return str(page.inner_text(f"[data-read={name}]"))


def typed(page: Any, key: str, text: str) -> None:
    page.fill(f"[data-key='{key}']", text)
    page.press(f"[data-key='{key}']", "Enter")


def test_the_law_shown_is_the_law_used(page: Any, address: str) -> None:
    for preset, law in (
        ("dmt", "dmt"),
        ("capillary", "hertz + capillary"),
        ("liquid", "voigt-sphere-pulling"),
        ("two-modes", "spring-damper"),
    ):
        opened(page, address, f"preset={preset}")
        assert page.input_value("[data-key='sample.law']") == law
    opened(page, address, "preset=dmt")
    attraction = observed(page, "first_harmonic")
    page.select_option("select.law >> nth=0", "hertz")
    until(page, lambda: page.input_value("[data-key='sample.law']") == "hertz")
    assert "without sample.hamaker" in page.inner_text("#note")
    assert page.locator("[data-key='sample.hamaker']").count() == 0
    until(page, lambda: observed(page, "first_harmonic") != attraction)
    page.select_option("select.law >> nth=1", "capillary")
    until(page, lambda: "+" in page.input_value("[data-key='sample.law']"))
    assert page.input_value("[data-key='sample.film_thickness']") == "300 pm"
    assert "sample.film_thickness = 300 pm" in page.inner_text("#note")
    for _ in range(2):
        page.click("#undo")
        page.wait_for_timeout(200)
    until(page, lambda: page.input_value("[data-key='sample.law']") == "dmt")
    assert observed(page, "first_harmonic") == attraction


def test_each_law_of_the_list_is_shown_and_used(page: Any, address: str) -> None:
    """On the page every third law, and every contact; all of them by other tests."""
    for preset, key, place in (
        # Clear of the sample, where a motion is computed at once.
        ("dmt&set.gap.tip=60+nm", "sample.law", "select.law >> nth=0"),
        ("paper&set.alpha5=3", "contact", "[data-key=contact]"),
    ):
        opened(page, address, f"preset={preset}&tab=modes")
        choices = page.locator(f"{place} >> option")
        laws = [
            law
            for law in choices.evaluate_all("(all) => all.map((one) => one.value)")
            if law
        ]
        assert len(laws) >= 5
        for law in laws[:: 3 if key == "sample.law" else 1]:
            page.select_option(place, law)
            # The page asks for the parameters of the law before it takes it.
            until(
                page,
                lambda key=key, law=law, preset=preset: (
                    page.input_value(f"[data-key='{key}']") == law
                    and stated(page, address, preset.split("&")[0], key) == law
                ),
            )
            assert page.is_hidden("#message"), (law, page.inner_text("#message"))


def stated(page: Any, address: str, preset: str, key: str) -> str:
    """A law in the case file of the case that the page's link holds."""
    linked = urllib.parse.parse_qsl(page.url.split("#")[1], keep_blank_values=True)
    changed = [f"{name[4:]}={text}" for name, text in linked if name[:4] == "set."]
    file = tomllib.loads(case_file(address, {"preset": preset, "set": changed}))
    section, _, name = key.rpartition(".")
    return file[section or "model"].get(name, "spring-damper")


def test_what_says_the_same_is_one_control(page: Any, address: str) -> None:
    opened(page, address, "preset=dmt")
    amplitude = observed(page, "first_harmonic")
    page.select_option("[data-switch='drive.frequency']", "drive.frequency_ratio")
    until(page, lambda: "set.drive.frequency_ratio=1" in page.url)
    assert observed(page, "first_harmonic") == pytest.approx(amplitude, rel=1e-9)
    page.select_option("[data-switch='drive.frequency_ratio']", "drive.frequency")
    # Its own frequency again is no change.
    until(page, lambda: "frequency" not in page.url)
    assert page.input_value("[data-key='drive.frequency']") == "100 kHz"
    # From the distance to the setpoint that it has, and by its slider to another one.
    ratio = float(read(page, "ratio"))
    page.select_option("[data-switch='gap.tip']", "drive.setpoint")
    until(page, lambda: page.locator("[data-slider='drive.setpoint']").count() == 1)
    assert float(read(page, "ratio")) == pytest.approx(ratio, abs=1e-3)
    page.focus("[data-slider='drive.setpoint']")
    for _ in range(3):
        page.keyboard.press("PageDown")
    until(page, lambda: float(read(page, "ratio")) < ratio - 0.05)
    asked_for = float(page.input_value("[data-key='drive.setpoint']"))
    until(page, lambda: abs(float(read(page, "ratio")) - asked_for) < 1e-3)


def test_sliders_fields_and_history_agree(page: Any, address: str) -> None:
    opened(page, address, "preset=dmt")
    slider, field = "[data-slider='gap.tip']", "[data-key='gap.tip']"
    first = page.input_value(slider)
    typed(page, "gap.tip", "15 nm")
    until(page, lambda: "set.gap.tip=15+nm" in page.url)
    # From -5 to 30 nm, with A0 = 20 nm.
    until(page, lambda: abs(int(page.input_value(slider)) - 1000 * 20 / 35) <= 1)
    assert read(page, "distance") == "15 nm"
    page.go_back()
    until(page, lambda: page.input_value(slider) == first)
    assert page.input_value(field) == "18 nm"
    page.go_forward()
    until(page, lambda: page.input_value(field) == "15 nm")
    page.click("#reset")
    until(page, lambda: page.input_value(field) == "18 nm")
    assert "set." not in page.url


@pytest.mark.parametrize("preset", ["dmt", "stiff-lever", "liquid", "paper", "impact"])
def test_a_slider_shows_what_the_server_used(
    page: Any, address: str, preset: str
) -> None:
    """At 5, 50 or 95 % of its range: slider, field, address and the server's case agree."""
    more = "&set.gap.tip=16+nm" if preset == "stiff-lever" else ""
    opened(page, address, f"preset={preset}{more}&tab=modes")
    sliders = page.locator("[data-slider]").evaluate_all(
        "(all) => all.filter((one) => one.checkVisibility()).map((one) => one.dataset.slider)"
    )
    assert len(sliders) >= 5
    for k, name in enumerate(sliders):
        opened(page, address, f"preset={preset}{more}&tab=modes")
        slider = page.locator(f"[data-slider='{name}']")
        low, high = (int(slider.get_attribute(end)) for end in ("min", "max"))
        place = low + round((high - low) * (0.05, 0.5, 0.95)[k % 3])
        if place == int(slider.input_value()):
            place += 1
        slider.evaluate(
            """(one, place) => {
            one.value = place;
            for (const event of ["input", "change"]) one.dispatchEvent(new Event(event));
        }""",
            place,
        )
        until(page, lambda name=name: f"set.{name}=" in page.url)
        assert page.is_hidden("#message"), (name, page.inner_text("#message"))
        field = page.input_value(f"[data-key='{name}']")
        linked = urllib.parse.parse_qs(page.url.split("#")[1])
        linked = {key: text[0] for key, text in linked.items()}
        assert si(linked[f"set.{name}"]) == pytest.approx(si(field), rel=1e-9), name
        # The range may have changed; the slider is where its value is in it.
        assert slider.get_attribute("aria-valuetext") == field
        case = {
            "preset": preset,
            "set": [
                f"{key[4:]}={text}" for key, text in linked.items() if key[:4] == "set."
            ],
        }
        asked_for = {"case": case, "ranges": True}
        answer = json.loads(asked(address, "/api/motion", asked_for))
        key = next(key for key in answer["keys"] if key["name"] == name)
        assert field == key["value"], name
        assert key["si"] == pytest.approx(si(field), rel=1e-6, abs=1e-40)
        assert states(case_file(address, case), name, field), name
        if name != "modes":
            own, number = key["slider"], key["number"]
            part = (number - own["from"]) / (own["to"] - own["from"])
            if own["log"]:
                part = math.log(number / own["from"]) / math.log(
                    own["to"] / own["from"]
                )
            assert int(slider.input_value()) == pytest.approx(1000 * part, abs=1), name
        # The motion on the page is the one of these values.
        rows = {row["name"]: row["value"] for row in answer["observables"]}
        assert observed(page, "amplitude") == rows["amplitude"], name


def test_a_figure_of_other_values_says_so(page: Any, address: str) -> None:
    opened(page, address, "preset=paper&tab=resonance&study.from=2.9&study.to=3.1")
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#study-figure canvas")
    stopped(page)
    assert page.is_hidden("#stale")
    assert "ran=yes" in page.url
    page.wait_for_selector("#attractors button")
    typed(page, "alpha4", "19")
    until(page, lambda: page.is_visible("#stale"))
    assert "computed for other values" in page.inner_text("#stale")
    # A link does not show what was computed for another case.
    assert "ran=yes" not in page.url
    assert page.is_disabled("#attractors button >> nth=0")
    # A click on it does nothing: its motion is another case's.
    before = page.url
    page.mouse.click(*spot(page, "study-figure", 0, 0.5, 0.5))
    page.wait_for_timeout(200)
    assert page.url == before
    typed(page, "alpha4", "20")
    until(page, lambda: page.is_hidden("#stale"))
    until(page, lambda: page.is_enabled("#attractors button >> nth=0"))


def test_a_study_is_stopped_only_while_it_runs(page: Any, address: str) -> None:
    opened(page, address, "preset=paper&tab=map")
    assert page.is_hidden("#stop")
    page.click("#study-form button[type=submit]")
    page.click("#stop")
    page.wait_for_selector("#progress:has-text('stopped')")
    assert page.is_hidden("#stop")
    # The range of an approach is folded, and open where a link has one.
    opened(page, address, "preset=dmt&tab=approach")
    assert page.is_hidden("#study-form [name=to]")
    opened(page, address, "preset=dmt&tab=approach&study.to=1+nm")
    assert page.input_value("#study-form [name=to]") == "1 nm"
    assert page.is_visible("#study-form [name=to]")


def test_a_late_census_of_another_case_is_dropped(page: Any, address: str) -> None:
    with held(page, "/api/attractors"):
        opened(page, address, "preset=paper-chaos")
        page.wait_for_selector("#bound:has-text('searching')")
        typed(page, "omega", "3")
        until(page, lambda: "set.omega=3" in page.url)
    # Its search has ended, and another one finds what there is.
    page.wait_for_selector("#attractors button")
    assert page.locator("#attractors button").count() == 1


def clicked(page: Any, near: list[Any], k: int) -> list[float]:
    """Clicks on a drawn motion, and returns its heights in the first panel."""
    x, heights, _ = near[k]
    panel = panels(page, "study-figure")[0]
    u, v = (
        (at - panel[axis]["from"]) / (panel[axis]["to"] - panel[axis]["from"])
        for axis, at in (("x", x), ("y", heights[0][0]))
    )
    before = page.url
    page.mouse.click(*spot(page, "study-figure", 0, u, v))
    until(page, lambda: page.url != before and "start=" in page.url)
    return [float(x), float(heights[0][0])]


def test_a_click_at_a_setpoint_gives_the_clicked_motion(
    page: Any, address: str
) -> None:
    # A lever at the setpoint 0.8: its diagrams are of the distance that was solved for.
    case = {"preset": "stiff-lever", "set": ["modes=1"]}
    options = {"key": "drive.frequency", "from": "329 kHz", "to": "332 kHz"}
    fields = "&study.from=329+kHz&study.to=332+kHz"
    opened(page, address, f"preset=stiff-lever&set.modes=1&tab=resonance{fields}")
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#study-figure canvas")
    stopped(page)
    study = first_stage(address, case=case, tab="resonance", options=options)
    near = study["clicks"]["near"]
    for k in (3, len(near) // 2, len(near) - 4):
        _, height = clicked(page, near, k)
        assert "drive.setpoint" not in page.url
        # The height is in nm.
        amplitude = read(page, "first_harmonic")
        assert amplitude.endswith("nm")
        assert float(amplitude.split()[0]) == pytest.approx(height, rel=0.02)
        assert page.is_hidden("#stale")


def test_a_click_on_a_levers_basin_starts_where_it_says(
    page: Any, address: str
) -> None:
    opened(page, address, "preset=dmt&tab=basin&ran=yes")
    page.wait_for_selector("#study-figure canvas")
    stopped(page)
    x = panels(page, "study-figure")[0]["x"]
    page.mouse.click(*spot(page, "study-figure", 0, 0.6, 0.5))
    until(page, lambda: "start=" in page.url)
    a1 = float(re.findall(r"start=([^%&]+)", page.url)[0])
    # In units of the beam's distance, 10 µm of tip and 18 nm; the axis is in nm.
    assert "nm" in f"{x['label']} {x['unit']}"
    at = x["from"] + 0.6 * (x["to"] - x["from"])
    assert a1 == pytest.approx(at / 10018, abs=0.01 * (x["to"] - x["from"]) / 10018)


def test_a_plan_outlines_where_its_conditions_hold(page: Any, address: str) -> None:
    ranges = "&study.from1=28+nm&study.to1=32+nm&study.from2=0.6&study.to2=0.7"
    opened(page, address, f"preset=dmt&tab=plan&study.force=4+nN{ranges}")
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#study-figure canvas")
    words = page.inner_text("#progress")
    stopped(page)
    # A large amplitude leaves one motion, in repulsion, at a peak force between 3 and 4 nN.
    assert "all conditions hold at 100 %" in words
    command = page.text_content("#study-command")
    assert "--where 'F_max < 4 nN' --where 'states = 1'" in command
    page.mouse.click(*spot(page, "study-figure", 0, 0.5, 0.5))
    until(page, lambda: "set.drive.setpoint=" in page.url)
    assert float(read(page, "ratio")) == pytest.approx(0.65, abs=0.005)
    assert read(page, "regime") == "repulsive"
    assert read(page, "peak_force").endswith("nN")
    assert float(read(page, "peak_force").split()[0]) < 4
    assert page.is_hidden("#stale")


def test_the_approach_curve_is_drawn_at_once_with_the_motion_on_it(
    page: Any, address: str
) -> None:
    opened(page, address, "preset=dmt")
    page.wait_for_selector("#study-figure canvas")
    assert page.get_attribute("#tab-approach", "aria-selected") == "true"
    # The line is at the present distance, 18 nm.
    panel = panels(page, "study-figure")[0]

    def line() -> float:
        now = "document.getElementById('study-figure').now?.[0]?.x ?? -1"
        return float(page.evaluate(now))

    def place(distance: float) -> float:
        x = panel["x"]
        u = (distance - x["from"]) / (x["to"] - x["from"])
        return float(panel["left"] + u * panel["width"])

    assert line() == pytest.approx(place(18), abs=0.1)
    typed(page, "gap.tip", "12 nm")
    until(page, lambda: abs(line() - place(12)) < 0.1)
    assert page.is_hidden("#stale")


def test_the_motions_of_a_lever_are_listed_by_themselves(
    page: Any, address: str
) -> None:
    opened(page, address, "preset=dmt")
    assert read(page, "regime") == "repulsive"
    page.wait_for_selector("#attractors button >> nth=1")
    # The case's own file says that an attractive and a repulsive oscillation coexist.
    assert page.locator("#attractors button").count() == 2
    assert "2 stable motions coexist here" in page.inner_text("#states-here")
    pressed = page.locator("#attractors button[aria-pressed=true]")
    assert pressed.count() == 1
    assert "repulsive" in pressed.inner_text()
    page.click("#attractors button:has-text('attractive')")
    until(page, lambda: read(page, "regime") == "attractive")
    assert read(page, "peak_force") == "0 N"
    assert float(read(page, "phase").rstrip("°")) > 90
    assert "attractive" in pressed.inner_text()
    typed(page, "gap.tip", "24 nm")
    until(page, lambda: read(page, "distance") == "24 nm")
    # Clear of the sample there is one motion.
    until(page, lambda: page.locator("#attractors button").count() == 1)
    assert page.inner_text("#states-here") == ""


def test_a_curve_that_waits_is_not_drawn_in_another_tab(
    page: Any, address: str
) -> None:
    opened(page, address, "preset=dmt")
    page.click("#tab-image")
    page.wait_for_timeout(1000)
    assert page.inner_text("#progress").startswith("A line of an image")
    assert page.locator("#study-figure canvas").count() == 0


def test_a_pinned_curve_stays_behind_the_next(page: Any, address: str) -> None:
    def legend() -> str:
        return str(page.get_attribute("#study-figure canvas", "aria-label"))

    opened(page, address, "preset=dmt")
    page.wait_for_selector("#study-figure canvas")
    first = panels(page, "study-figure")[0]["y"]["to"]
    assert "pinned" not in legend()
    page.click("#pin")
    typed(page, "drive.free_amplitude", "10 nm")
    until(page, lambda: "pinned" in legend())
    # The axis reaches to the larger amplitude of the pinned curve.
    assert panels(page, "study-figure")[0]["y"]["to"] == pytest.approx(first, rel=0.05)
    page.click("#pin")
    until(page, lambda: "pinned" not in legend())
    assert panels(page, "study-figure")[0]["y"]["to"] < 0.6 * first


@pytest.mark.parametrize("preset", ["stiff-lever", "patch"])
def test_the_command_of_an_image_gives_what_is_shown(
    address: str, tmp_path: Path, preset: str
) -> None:
    case = {"preset": preset}
    form = motion(address, preset)["forms"]["image"]
    options = {field["name"]: field["value"] for field in form}
    image = studied(address, case=case, tab="image", options=options)[-1]
    assert image["figure"]["panels"][0]["y"]["label"].startswith("height")
    (tmp_path / "case.toml").write_text(case_file(address, case))
    command = image["command"].replace("nanotap scan", f"'{PROGRAM}' scan")
    done = subprocess.run(
        ["sh", "-c", command.replace("--plot scan.svg", "--json")],
        check=True,
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    verdict = json.loads(done.stdout)["verdict"]
    assert image["words"].startswith(verdict)
    if preset == "patch":
        # docs/cases/scan.md: a flat sample, and a step where the lever changes its state.
        assert "from the attractive to the repulsive state" in verdict


LESSONS = [
    "Two motions at one distance",
    "Why the phase turns",
    "Period doubling",
    "A false step in an image",
    "What a too coarse time step invents",
    "An imaging window below a peak force",
]


@pytest.mark.parametrize("name", LESSONS)
def test_a_guided_start_shows_what_it_says(page: Any, address: str, name: str) -> None:
    def lag() -> float:
        return float(read(page, "phase").rstrip("°"))

    opened(page, address, "preset=soft-sample")
    page.click("#learn summary")
    assert page.locator("#lessons a").all_inner_texts() == LESSONS
    page.click(f"#lessons a:has-text('{name}')")
    until(page, lambda: "lesson=" in page.url)
    for _ in range(10 * WAIT):
        if page.locator("#study-figure:not(.stale) canvas").count():
            break
        page.wait_for_timeout(100)
    else:
        lines = ("#progress", "#bound", "#stale")
        shown = [page.inner_text(element) for element in lines]
        pytest.fail(f"no figure: {page.url} {shown}")
    assert page.inner_text("#lesson p").startswith(name)
    assert page.is_hidden("#message")
    if name == LESSONS[0]:
        assert read(page, "peak_force").startswith("1.09")
        assert lag() < 90
    elif name == LESSONS[1]:
        assert lag() == pytest.approx(90, abs=1)
        for distance, shown in (("19 nm", 110), ("18 nm", 68)):
            typed(page, "gap.tip", distance)
            until(page, lambda d=distance: read(page, "distance") == d)
            assert lag() == pytest.approx(shown, abs=1)
    elif name == LESSONS[2]:
        # Ω = 2.8 repeats after two drive periods, Ω = 3 after one.
        for omega, period in (("2.8", "period 2"), ("3", "period 1")):
            typed(page, "omega", omega)
            until(page, lambda p=period: p in page.inner_text("#summary"))
    elif name == LESSONS[3]:
        words = page.inner_text("#progress")
        assert "from the attractive to the repulsive state" in words
    elif name == LESSONS[4]:
        assert "period 1, stable" in page.inner_text("#summary")
        assert "80 steps per period show" in page.inner_text("#spurious")
    else:
        assert "all conditions hold at" in page.inner_text("#progress")
    page.click("#lesson button")
    assert "lesson" not in page.url


def computed(page: Any, tab: str) -> None:
    """Computes a study of the present case, until its first figure."""
    page.click(f"#tab-{tab}")
    idle(page)
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#study-figure canvas")
    stopped(page)
    draws(page, "study-figure")


def test_the_tour_of_two_motions(page: Any, address: str, tmp_path: Path) -> None:
    """Step by step as in docs/explorer.md."""
    opened(page, address, "preset=dmt")
    page.select_option("#preset", "paper-fast")
    until(page, lambda: "period" in page.inner_text("#summary"))
    assert "No tip mass at Ω = 20" in page.inner_text("#summary")
    page.wait_for_selector("#attractors button >> nth=1")
    assert "elsewhere" in page.inner_text("#bound")
    before = {name: observed(page, name) for name in ("amplitude", "peak_force")}
    page.click("#attractors button[aria-pressed=false]")
    changes(page, before["amplitude"])
    assert observed(page, "peak_force") != before["peak_force"]
    computed(page, "basin")
    page.mouse.click(*spot(page, "study-figure", 0, 0.7, 0.4))
    until(page, lambda: "start=" in page.url)
    page.fill("#steps", "40")
    page.press("#steps", "Enter")
    until(page, lambda: "40 steps per period" in page.inner_text("#spurious"))
    with page.expect_download() as saved:
        page.click("[data-export=toml]")
    saved.value.save_as(tmp_path / "case.toml")
    command = page.text_content("#command").split()
    assert printed(tmp_path, *command[1:])["amplitude"] == observed(page, "amplitude")


@pytest.mark.parametrize("tab", ["branches", "diagram", "resonance", "map"])
def test_the_studies_of_the_tour(page: Any, address: str, tab: str) -> None:
    opened(page, address, "preset=paper-fast")
    computed(page, tab)


def test_the_tour_of_a_jump(page: Any, address: str) -> None:
    """Step by step as in docs/explorer.md, in the range of its figure."""
    opened(page, address, "preset=paper")
    page.select_option("#preset", "stiff-lever")
    until(page, lambda: "NCHR" in page.inner_text("#summary"))
    computed(page, "resonance")
    options = {
        name: page.input_value(f"#study-form [name={name}]")
        for name in ("key", "from", "to")
    }
    study = first_stage(
        address, case={"preset": "stiff-lever"}, tab="resonance", options=options
    )
    near = study["clicks"]["near"]
    # At 331.5 kHz there are two stable motions.
    x = min({x for x, *_ in near}, key=lambda x: abs(x - 331.5))
    there = [k for k, (other, *_) in enumerate(near) if other == x]
    heights = [near[k][1][0][0] for k in there]
    assert max(heights) - min(heights) > 1
    forces = []
    for height in (max(heights), min(heights)):
        clicked(page, near, there[heights.index(height)])
        assert read(page, "first_harmonic").endswith("nm")
        forces.append(observed(page, "peak_force"))
    assert abs(forces[0] - forces[1]) > 0.05 * max(forces)


@pytest.mark.usefixtures("films")
def test_a_surface_is_drawn_and_the_tip_follows_it(page: Any, address: str) -> None:
    opened(page, address, "preset=stiff-lever&tab=image&study.surface=drawn")
    pad = page.locator("#study-form .hand canvas").bounding_box()
    place = (pad["x"] + 0.3 * pad["width"], pad["y"] + 0.2 * pad["height"])
    page.mouse.move(*place)
    page.mouse.down()
    page.mouse.move(place[0] + 0.3 * pad["width"], place[1])
    page.mouse.up()
    idle(page)
    heights = page.input_value("#study-form [name=profile]").split(",")
    assert len(heights) == 64 and float(heights[0]) == 0
    assert float(heights[30]) == pytest.approx(0.8, abs=0.03)
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#study-figure canvas")
    surface = "document.getElementById('study-figure').figure.panels[0].layers"
    lines = [one for one in page.evaluate(surface) if one["kind"] == "line"]
    drawn, trace = (
        max(one["points"]["y"]) - min(one["points"]["y"]) for one in lines[:2]
    )
    # 10 nm times the largest height; the loop follows at the usual gain.
    assert drawn == pytest.approx(8, abs=0.3)
    assert trace == pytest.approx(drawn, rel=0.4)
    # The tip goes along the line.
    at = "document.getElementById('study-figure').now?.[0]?.x ?? -1"
    met = set()

    def moves() -> bool:
        met.add(page.evaluate(at))
        return len(met) > 5

    until(page, moves)
    # A slower scan, by its slider.
    before = page.input_value("#study-form [name=rate]")
    page.focus("#study-form [name=rate] + input")
    page.keyboard.press("PageDown")
    assert page.input_value("#study-form [name=rate]") != before


def test_a_case_file_keeps_its_scan(address: str, tmp_path: Path) -> None:
    text = case_file(address, {"preset": "patch"})
    assert "[scan]" in text and "integral_gain = 600" in text
    (tmp_path / "case.toml").write_text(text)
    assert printed(tmp_path, "scan", "case.toml", "--lines", "1")["lines"]


def about(address: str) -> dict[str, Any]:
    return dict(json.loads(asked(address, "/api/about")))


def test_a_refusal_names_a_key_once(address: str) -> None:
    case = {"preset": "dmt", "set": ["gap.tip=abc"]}
    answer = refusal(address, "/api/motion", {"case": case})
    assert answer["keys"] == ["gap.tip"]
    assert answer["error"].count("gap.tip") == 1


def cells(page: Any, row: Any) -> list[str]:
    return list(row.locator("th, td").all_inner_texts())


def test_levers_are_compared_and_a_click_takes_one(page: Any, address: str) -> None:
    opened(page, address, "preset=dmt&tab=levers&study.regime=any")
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#tables .choice")
    idle(page)
    heads = page.locator("#tables thead th").all_inner_texts()
    rows = [cells(page, row) for row in page.locator("#tables .choice").all()]
    assert len(rows) > 3
    # One with a single stable motion, which a run from rest reaches.
    states = heads.index("states")
    k = next(k for k, row in enumerate(rows) if row[states] == "1")
    page.locator("#tables .choice").nth(k).click()
    until(page, lambda: rows[k][0].replace(" ", "+") in page.url)
    until(page, lambda: read(page, "regime") == rows[k][heads.index("regime")])
    shown, listed = read(page, "peak_force"), rows[k][heads.index("F_max")]
    assert float(shown.split()[0]) == pytest.approx(float(listed.split()[0]), rel=0.01)
    assert page.is_hidden("#stale")
    assert page.is_hidden("#message")


def test_a_motion_for_which_the_model_does_not_hold_says_so(address: str) -> None:
    # The paper's case at Ω = 20, of which the terminal warns, too.
    case = {"preset": "paper", "set": ["omega=20"]}
    said = json.loads(asked(address, "/api/motion", {"case": case}))["remarks"]
    assert any("would pass through the sample" in remark for remark in said), said
    assert not any("pass through" in remark for remark in motion(address)["remarks"])


def test_every_study_of_the_registry_has_a_form_and_a_report(address: str) -> None:
    studies = about(address)["studies"]
    names = [study["name"] for study in studies]
    for wanted in ("convergence", "contact-laws", "lyapunov", "fm", "force-curve"):
        assert wanted in names
    # Those that leave a dataset are listed, too.
    assert {"sweep", "window"} <= set(names)
    quick = {"points": "6", "periods": "50", "modes": "2", "transient": "50"}
    for study in studies:
        options = {field["name"]: field["value"] for field in study["form"]}
        options |= {name: text for name, text in quick.items() if name in options}
        case = {"preset": "two-modes" if study["name"] == "convergence" else "dmt"}
        usual = motion(address, case["preset"])["forms"]["usual"].get(study["name"], {})
        # Two values of each parameter.
        options |= {name: re.sub(r":\d+\b", ":2", text) for name, text in usual.items()}
        if "starts" in options:
            options["starts"] = "1"
        stages = studied(address, case=case, tab=study["name"], options=options)
        last = stages[-1]
        if study["name"] == "bimodal":
            assert "second tone" in last["error"]
            continue
        assert "error" not in last, (study["name"], last)
        assert last["tables"], study["name"]
        assert last["command"].startswith(f"nanotap {study['name']} "), last
        # What the terminal says beside the report.
        if study["name"] in ("noise", "lyapunov"):
            assert "this is the motion from rest" in last["words"], study["name"]


def test_a_study_of_the_registry_is_computed_on_the_page(
    page: Any, address: str
) -> None:
    opened(page, address, "preset=paper")
    page.click("#tab-modes")
    page.wait_for_selector("#study-form button[type=submit]")
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#tables tbody tr")
    draws(page, "study-figure")
    opened(page, address, page.url.split("#")[1])
    assert page.get_attribute("#tab-modes", "aria-selected") == "true"
    page.wait_for_selector("#tables tbody tr")


@pytest.mark.alone
def test_a_trial_tells_how_long_a_study_takes(address: str) -> None:
    def estimated(points: int) -> tuple[float, str]:
        over = f"omega=2.9:3.1:{points},alpha4=18:22:20"
        options = {"over": over, "starts": "16"}
        (answer,) = studied(address, tab="window", options=options, estimate=True)
        return answer["estimate"], answer["command"]

    begun = time.monotonic()
    least, _ = estimated(20)
    options = {"over": "omega=2.9:3.1:20,alpha4=18:22:20", "starts": "16"}
    trial = time.monotonic() - begun
    (*_, last) = studied(address, tab="window", options=options)
    took = time.monotonic() - begun - trial
    assert trial < 6
    # The machine may be busy with other things during one of the two.
    assert least / 10 < took < 10 * least + 2
    most, command = estimated(4000)
    assert most > 20 * least
    assert command == last["command"].replace("2.9:3.1:20", "2.9:3.1:4000")


def test_a_long_study_says_so_before_it_begins(page: Any, address: str) -> None:
    over = urllib.parse.quote("omega=2.9:3.1:2000,alpha4=18:22:100")
    opened(page, address, f"preset=paper&tab=window&study.over={over}")
    page.wait_for_selector("#long pre")
    assert re.search(r"roughly \d+ (min|h) here", page.inner_text("#long"))
    assert page.inner_text("#long pre").startswith("nanotap window case.toml --over")
    # It is above the button, which begins the study all the same.
    below = page.locator("#study-form button[type=submit]").bounding_box()["y"]
    assert page.locator("#long").bounding_box()["y"] < below
    page.click("#study-form button[type=submit]")
    page.wait_for_selector("#progress:has-text('of')")
    page.click("#stop")
    # A short one says nothing.
    page.fill("#study-form [name=over]", "omega=2.9:3.1:3,alpha4=18:22:3")
    page.press("#study-form [name=over]", "Enter")
    until(page, lambda: page.inner_text("#long") == "")
    page.wait_for_timeout(2500)
    assert page.inner_text("#long") == ""


def test_a_dataset_is_shown_and_its_folder_removed(page: Any, tmp_path: Path) -> None:
    own = page.context.browser.new_page()
    own.set_default_timeout(1000 * WAIT)
    with started(TMPDIR=str(tmp_path)) as server:
        address = address_of(server)
        opened(own, address, "preset=paper&tab=sweep&study.over=omega=2.9,3,3.1")
        assert own.get_attribute("#tab-sweep", "aria-selected") == "true"
        own.click("#study-form button[type=submit]")
        own.wait_for_selector("#tables tbody tr")
        idle(own)
        draws(own, "study-figure")
        assert "period 1" in own.inner_text("#tables") or "periodic" in own.inner_text(
            "#tables"
        )
        command = own.text_content("#study-command")
        assert command.startswith("nanotap sweep case.toml --over omega=2.9,3,3.1")
        # Another case has other usual values.
        opened(own, address, "preset=dmt&tab=sweep")
        assert "drive.frequency=" in own.input_value("#study-form [name=over]")
        # Datasets of studies are in memory.
        assert list(tmp_path.glob("nanotap-explorer-*/*")) == []
    own.close()


CURVE = Path(__file__).parent.parent / "docs/cases/polystyrene-curve.csv"


def test_a_force_without_a_law_is_reconstructed(
    page: Any, address: str, tmp_path: Path
) -> None:
    opened(page, address, "preset=stiff-lever&tab=data")
    page.set_input_files("#study-form input[type=file]", CURVE)
    until(page, lambda: "rows" in page.inner_text("#progress"))
    page.click("#reconstruct")
    page.wait_for_selector("#tables button")
    command = page.text_content("#study-command").split()
    assert command[:4] == ["nanotap", "reconstruct", CURVE.name, "case.toml"]
    # The terminal gives the same: its numbers are those drawn, and those in words.
    (tmp_path / "case.toml").write_text(case_file(address, {"preset": "stiff-lever"}))
    shutil.copy(CURVE, tmp_path)
    found = printed(tmp_path, *command[1:4])
    layers = page.evaluate(
        "document.getElementById('study-figure').figure.panels[0].layers"
    )
    force = next(one for one in layers if one.get("label") == "force")
    drawn = dict(zip(force["points"]["x"], force["points"]["y"], strict=True))
    table = dict(zip(found["table"]["distance"], found["table"]["force"], strict=True))
    assert len(drawn) > 20
    scale = max(map(abs, table.values()))
    for distance, height in drawn.items():
        near = min(table, key=lambda one: abs(1e9 * one - distance))
        assert 1e9 * near == pytest.approx(distance, abs=1e-3)
        assert 1e-9 * height == pytest.approx(table[near], abs=1e-4 * scale)
    rows = dict(cells(page, row) for row in page.locator("#tables tbody tr").all())
    closest = 1e9 * found["closest"]
    assert si(rows["closest approach"]) == pytest.approx(1e-9 * closest, rel=1e-3)
    for remark in found["remarks"]:
        assert remark in page.inner_text("#progress")
    with page.expect_download() as saved:
        page.click("#tables button:has-text('CSV')")
    assert Path(saved.value.path()).read_text().startswith("distance (nm),force (nN)")
    # Of another case the figure is marked.
    typed(page, "drive.free_amplitude", "21 nm")
    until(page, lambda: page.is_visible("#stale"))
    typed(page, "drive.free_amplitude", "20 nm")
    until(page, lambda: page.is_hidden("#stale"))
    # As the law of the sample: what is shown is what is used.
    page.click("#tables button:has-text('force table')")
    until(page, lambda: page.input_value("[data-key='sample.law']") == "table")
    assert page.is_hidden("#message")
    assert "set.sample.table=" in page.url
    assert len(page.inner_text("#summary")) < 500
    assert observed(page, "peak_force") > 0


def test_a_measured_curve_is_shown_over_the_model_and_fitted(
    page: Any, address: str
) -> None:
    # The curve was made with 4 GPa and distances 0.3 nm too large (docs of the study).
    opened(page, address, "preset=stiff-lever&set.sample.modulus=3+GPa&tab=data")
    page.set_input_files("#study-form input[type=file]", CURVE)
    until(page, lambda: "rows" in page.inner_text("#progress"))
    label = "document.querySelector('#study-figure canvas').ariaLabel"
    assert "measured" in page.evaluate(label)
    page.click("#study-form summary")
    page.fill("#study-form [name=starts]", "1")
    page.click("#fit")
    page.wait_for_selector("#tables button")
    rows = [cells(page, row) for row in page.locator("#tables tbody tr").all()]
    modulus = next(row for row in rows if row[0] == "sample.modulus")
    assert float(modulus[1].split()[0]) == pytest.approx(4, rel=0.05)
    assert "to" in modulus[3]
    page.click("#tables button:has-text('Use')")
    until(page, lambda: "set.sample.modulus" in page.url)
    field = page.input_value("[data-key='sample.modulus']")
    assert float(field.split()[0]) == pytest.approx(4, rel=0.05)
    with page.expect_download() as saved:
        page.click("#tables button:has-text('Case file')")
    assert "[sample]" in Path(saved.value.path()).read_text()


def test_a_map_of_an_instrument_is_fitted(
    address: str, cell_map: tuple[Path, np.ndarray]
) -> None:
    path, moduli = cell_map
    form = motion(address, "hertz")["forms"]["data"]
    options = {field["name"]: field["value"] for field in form}
    options |= {"tip_radius": "5 um", "poisson": "0.5", "spring_constant": "0.05 N/m"}
    case = {
        "preset": "hertz",
        "set": ["sample.modulus=10 kPa"],
    }
    content = {"base64": base64.b64encode(path.read_bytes()).decode()}
    wanted = {"case": case, "tab": "data", "data": [path.name, content]}
    for curve, modulus in (("1", moduli[0, 1]), ("all", np.nanmedian(moduli))):
        chosen = options | {"curve": curve, "fit": "yes"}
        answer = studied(address, **wanted, options=chosen)[-1]
        assert "tables" in answer, answer
        rows = [row["cells"] for table in answer["tables"] for row in table["rows"]]
        cells = next(row for row in rows if row[0] == "sample.modulus")
        value, unit = cells[1].split()
        assert unit == "kPa", cells
        found = 1e3 * float(value)
        assert found == pytest.approx(modulus, rel=0.03), cells
    refused = studied(address, **wanted, options=options | {"curve": "7"})[-1]
    assert "7" in refused["error"], refused


def test_measured_data_are_bounded_and_refused_in_words(address: str) -> None:
    form = motion(address, "stiff-lever")["forms"]["data"]
    options = {field["name"]: field["value"] for field in form}
    wanted = {"case": {"preset": "stiff-lever"}, "tab": "data", "options": options}
    for text, words in (("p,q\n1\n", "fields"), ("p,q\n1,2\n", "observable")):
        answer = studied(address, **wanted, data=["x.csv", text])[-1]
        assert words in answer["error"], answer
    with pytest.raises(urllib.error.HTTPError) as refused:
        asked(address, "/api/study", wanted | {"data": ["x.csv", "1" * 36_000_000]})
    assert refused.value.code == 413


@pytest.mark.alone
def test_changed_requests_leave_no_work_and_no_memory(address: str) -> None:
    """Requests with numbers and words changed at random; their clients leave at once."""
    with started() as server:
        own = address_of(server)
        base, token = own.split("/?token=")
        process = psutil.Process(server.pid)
        bodies = {
            "/api/motion": {"case": {"preset": "dmt"}, "ranges": True},
            "/api/law": {"case": {"preset": "dmt"}, "law": "jkr"},
            "/api/attractors": {"case": {"preset": "paper-fast"}},
            "/api/study": {
                "case": {"preset": "paper"},
                "tab": "lyapunov",
                "options": {"periods": "100", "points": "10"},
            },
        }
        odd = ["-1", "1e308", "nan", "", "9" * 40, "'", "[", "null", "0", "modes=20"]
        chance = random.Random(1)
        before = 0
        for k in range(200):
            path, body = chance.choice(list(bodies.items()))
            text = json.dumps(body)
            words = re.findall(r"[\w.]+", text)
            text = text.replace(chance.choice(words), chance.choice(odd), 1)
            client = http.client.HTTPConnection(base.removeprefix("http://"), timeout=5)
            headers = {"x-nanotap-token": token, "content-type": "application/json"}
            client.request("POST", path, text.encode(), headers)
            if k % 2:
                with contextlib.suppress(OSError):
                    client.getresponse().read(100)
            client.close()
            if k == 100:
                before = process.memory_info().rss
        # What was left ends soon.
        time.sleep(2)
        used = sum(process.cpu_times()[:2])
        time.sleep(1)
        assert sum(process.cpu_times()[:2]) - used < 0.3
        assert process.memory_info().rss < before + 100e6
        assert motion(own)["summary"].startswith("period")


def test_an_ended_server_says_so(page: Any) -> None:
    other = page.context.browser.new_page()
    other.set_default_timeout(1000 * WAIT)
    with started() as server:
        other.goto(address_of(server))
        other.wait_for_selector("#rows tbody tr")
    other.select_option("#preset", "paper")
    other.wait_for_selector("#message:not([hidden])")
    assert "start it again" in other.inner_text("#message")
    other.close()


def test_nothing_leaves_the_machine_and_nothing_complains(
    page: Any, address: str
) -> None:
    own = address.split("/?")[0]
    assert len(page.asked) > 20
    assert all(url.startswith((own, "data:", "blob:", "about:")) for url in page.asked)
    # On a busy machine the browser may lose a connection that it kept, and ask again.
    lost = "net::ERR_SOCKET_NOT_CONNECTED"
    assert [words for words in page.complaints if lost not in words] == []
