"""The page without a server in Firefox, which is steered by its own protocol, Marionette."""

from __future__ import annotations

import contextlib
import json
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from test_page import FOLDER, served

FIREFOX = shutil.which("firefox") or shutil.which("firefox-esr")
PORT = 2828
LONGEST = 90  # seconds until the first motion is shown on a loaded machine


class Marionette:
    """A connection: messages are `length:JSON`, commands `[0, number, name, parameters]`."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.rest = b""
        self.number = 0
        self.received()

    def received(self) -> Any:
        while b":" not in self.rest:
            self.rest += self.connection.recv(1 << 16)
        size, self.rest = self.rest.split(b":", 1)
        while len(self.rest) < int(size):
            self.rest += self.connection.recv(1 << 16)
        text, self.rest = self.rest[: int(size)], self.rest[int(size) :]
        return json.loads(text)

    def command(self, name: str, **parameters: Any) -> Any:
        self.number += 1
        text = json.dumps([0, self.number, name, parameters]).encode()
        self.connection.sendall(b"%d:%s" % (len(text), text))
        _, _, error, result = self.received()
        assert error is None, error
        return result

    def value(self, script: str) -> Any:
        return self.command(
            "WebDriver:ExecuteScript", script=f"return {script}", args=[]
        )["value"]


@contextlib.contextmanager
def firefox(profile: Path) -> Iterator[Marionette]:
    assert FIREFOX is not None
    arguments = ["--headless", "--marionette", "--no-remote", "--profile", str(profile)]
    process = subprocess.Popen(
        [FIREFOX, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        for _ in range(LONGEST):
            with contextlib.suppress(OSError):
                connection = socket.create_connection(("127.0.0.1", PORT), LONGEST)
                break
            time.sleep(1)
        else:
            pytest.fail("Firefox did not start")
        with connection:
            browser = Marionette(connection)
            browser.command("WebDriver:NewSession")
            yield browser
    finally:
        process.terminate()
        process.wait(30)


@pytest.mark.skipif(FIREFOX is None, reason="no Firefox on this machine")
def test_the_page_shows_its_first_motion_from_a_server_and_from_the_disk(
    tmp_path: Path,
) -> None:
    if not (FOLDER / "nanotap.html").exists():
        pytest.skip(f"no page in {FOLDER}: cargo xtask page builds it")
    # The rows of the first view, once the program has closed their orbits.
    rows = "[...document.querySelectorAll('#rows td.distance, #rows td.phase')]"
    shown = f"{rows}.map((cell) => cell.innerText).join(' ')"
    done = "document.body.dataset.rows"
    with served(FOLDER) as site, firefox(tmp_path) as browser:
        found = []
        for address in (site, (FOLDER / "nanotap.html").as_uri()):
            browser.command("WebDriver:Navigate", url=address)
            end = time.monotonic() + LONGEST
            while browser.value(done) != "done" or not browser.value(shown):
                assert time.monotonic() < end, browser.value("document.body.innerText")
                time.sleep(0.2)
            assert browser.value("document.getElementById('message').innerText") == ""
            found.append(browser.value(shown))
    # The states at 80 %: as in test_page_states.py, which compares them with the terminal's.
    assert found[0] == "16.18 nm 126.9° 15.44 nm 53.1° 15.69 nm 126.9°"
    assert found[1] == found[0]
