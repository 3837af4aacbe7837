"""The local server, the browser and the terminal as the tests of the page use them."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
from program import PROGRAM

CHROMIUM = next(
    (
        path
        for name in ("chromium", "chromium-browser", "google-chrome")
        if (path := shutil.which(name))
    ),
    None,
)
# Seconds that a test may take at most; most take less than three.
LIMIT = 300
# Seconds in which what a page computes is there. On a busy machine a map takes more than one minute.
WAIT = 150
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


def end_all() -> None:
    """Ends every process that this one started, and so every wait for one of them."""
    for process in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            process.kill()


@contextlib.contextmanager
def limited(seconds: float = LIMIT) -> Iterator[None]:
    """Waits within end after some seconds: servers, browsers and programs are ended."""
    timer = threading.Timer(seconds, end_all)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@contextlib.contextmanager
def started(**surroundings: str) -> Iterator[subprocess.Popen[str]]:
    """A server, which has ended after this."""
    server = subprocess.Popen(
        [PROGRAM, "explore", "--no-browser"],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, **surroundings},
    )
    try:
        yield server
    finally:
        server.terminate()
        try:
            server.wait(10)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait(10)
        assert server.stdout is not None
        server.stdout.close()


def address_of(server: subprocess.Popen[str]) -> str:
    assert server.stdout is not None
    with limited(30):
        return server.stdout.readline().strip()


def asked(
    address: str, path: str, body: Any = None, limit: float = LIMIT, **headers: str
) -> bytes:
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
    with urllib.request.urlopen(request, timeout=limit) as answer:
        return bytes(answer.read())


class Answers:
    """Answers of the server to requests that take long, each asked for once."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.known: dict[str, bytes] = {}

    def to(self, path: str, body: dict[str, Any]) -> bytes:
        question = json.dumps([path, body], sort_keys=True)
        if question not in self.known:
            self.known[question] = asked(self.address, path, body)
        return self.known[question]

    def given(
        self, page: Any, path: str, new: Callable[[dict[str, Any]], bool] | None = None
    ) -> None:
        """Gives them to a page that makes the same requests; new ones are made now, or left to the server where
        `new` says no: their stages then come one by one.
        """

        def give(route: Any) -> None:
            body = route.request.post_data_json
            question = json.dumps([path, body], sort_keys=True)
            if question not in self.known and new is not None and not new(body):
                route.continue_()
                return
            answer = self.to(path, body)
            # A request that a newer one replaced has ended.
            with contextlib.suppress(Exception):
                route.fulfill(body=answer, content_type="application/json")

        page.route(f"**{path}", give)


def without_knocks(page: Any) -> Any:
    """A page whose search for the smallest knock is not begun: it takes as long as all else that a view computes.
    A test that shows it has a route of its own for it.
    """
    page.context.route("**/api/knock", lambda _: None)
    return page


@contextlib.contextmanager
def held(page: Any, path: str) -> Iterator[None]:
    """Answers to requests of a path come only after this."""
    waiting: list[Any] = []
    page.route(f"**{path}", lambda route: waiting.append(route))
    try:
        yield
    finally:
        for route in waiting:
            # A request that a newer one replaced has ended.
            with contextlib.suppress(Exception):
                route.continue_()
        page.unroute(f"**{path}")


def case_file(address: str, case: dict[str, Any]) -> str:
    return asked(address, "/api/export", {"case": case, "format": "toml"}).decode()


def studied(address: str, **asked_for: Any) -> list[dict[str, Any]]:
    wanted = {"case": {"preset": "paper"}, **asked_for}
    lines = asked(address, "/api/study", wanted).splitlines()
    return [json.loads(line) for line in lines]


def printed(folder: Path, *words: str) -> dict[str, Any]:
    """What the terminal prints for these words, in a folder."""
    done = subprocess.run(
        [PROGRAM, *words, "--json"],
        check=True,
        capture_output=True,
        text=True,
        cwd=folder,
    )
    return dict(json.loads(done.stdout))


def until(page: Any, condition: Callable[[], bool]) -> None:
    """Waits here: the page's policy forbids code from strings."""
    end = time.monotonic() + WAIT
    while time.monotonic() < end:
        if condition():
            idle(page)
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"nothing changed in {WAIT} s")


def idle(page: Any) -> None:
    page.wait_for_selector("td[data-observable=amplitude]", state="attached")
    page.wait_for_selector("body[data-busy=no]")


def observed(page: Any, name: str) -> float:
    return float(page.get_attribute(f"td[data-observable={name}]", "data-value"))


def stopped(page: Any) -> None:
    """Ends the study if it still computes: then only the button is shown."""
    page.evaluate("document.getElementById('stop').click()")
    page.wait_for_selector("#stop", state="hidden")
