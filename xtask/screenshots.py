"""Takes the pictures of docs/explorer.md: `python xtask/screenshots.py PROGRAM`.

PROGRAM is the program `nanotap`. Needs playwright and a Chromium on the search path.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

DOCS = Path(__file__).resolve().parent.parent / "docs"
SIZE = {"width": 1440, "height": 900}


def idle(page: Any) -> None:
    """Waits until the page shows the motion."""
    page.wait_for_selector("td[data-observable=amplitude]", state="attached")
    page.wait_for_selector("body[data-busy=no]", timeout=120_000)


def opened(page: Any, address: str, fragment: str) -> None:
    """Opens the page with the case and the study of `fragment`."""
    page.goto("about:blank")
    page.goto(f"{address}#view=studies&{fragment}")
    idle(page)


def states(page: Any, address: str) -> None:
    """The first view, with the repulsive state chosen."""
    page.goto(address)
    page.wait_for_selector("#sure:has-text('Searched from')", timeout=120_000)
    page.click("#rows tr[data-state=repulsive] .name")
    page.wait_for_selector("#margin:has-text('knock')", timeout=120_000)
    taken(page, "explorer-states.png")


def compute(page: Any) -> None:
    """Computes the study and waits for its figure."""
    page.click("#study-form button:has-text('Compute')")
    page.wait_for_selector("#study-export:not([hidden])", timeout=120_000)
    # The figure becomes finer while the study goes on.
    for _ in range(600):
        if "so far" not in page.inner_text("#progress"):
            break
        page.wait_for_timeout(200)
    idle(page)
    page.wait_for_timeout(500)


def taken(page: Any, name: str) -> None:
    """Writes what the window shows."""
    path = DOCS / name
    page.screenshot(path=path)
    print(path)


def coexisting(page: Any, address: str) -> None:
    """Two motions of one case, and their basins."""
    opened(page, address, "preset=paper-fast")
    page.wait_for_selector("#study-figure canvas", timeout=120_000)
    page.click("#census")
    page.wait_for_selector("#attractors button >> nth=1", timeout=120_000)
    page.click("#attractors button:has-text('period 4')")
    page.wait_for_selector("#summary:has-text('period 4')")
    idle(page)
    page.evaluate("scrollTo(0, 0)")
    taken(page, "explorer.png")
    page.click("#tab-basin")
    compute(page)
    page.locator("#study").evaluate("one => one.scrollIntoView()")
    taken(page, "explorer-basin.png")


def resonance(page: Any, address: str) -> None:
    """A resonance curve with two branches, and a motion chosen on it."""
    opened(page, address, "preset=stiff-lever&tab=resonance")
    compute(page)
    page.locator("#study").evaluate("one => one.scrollIntoView()")
    taken(page, "explorer-resonance.png")


def main() -> None:
    """Starts the explorer and takes the pictures."""
    program = sys.argv[1]
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    command = [program, "explore", "--no-browser"]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server,
        sync_playwright() as playwright,
    ):
        assert server.stdout is not None
        address = server.stdout.readline().strip()
        flags = ["--no-sandbox", "--disable-gpu"]
        browser = playwright.chromium.launch(executable_path=chromium, args=flags)
        page = browser.new_page(viewport=SIZE)
        try:
            states(page, address)
            coexisting(page, address)
            resonance(page, address)
        finally:
            browser.close()
            server.terminate()


if __name__ == "__main__":
    main()
