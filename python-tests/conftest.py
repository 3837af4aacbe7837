"""Fixtures of all tests. Run by `cargo xtask test-python` on the installed wheel."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nanotap
import numpy as np
import pytest
from browsers import (
    CHROMIUM,
    FLAGS,
    WAIT,
    address_of,
    limited,
    started,
    without_knocks,
)

# Files that take minutes, the longest first.
LONG = ["test_page_states", "test_explorer", "test_page_plan", "test_page_numbers"]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begins with the long files, so that two workers end at about the same time."""

    def place(item: pytest.Item) -> int:
        name = item.path.stem
        if name in LONG:
            return LONG.index(name)
        return len(LONG) + (not name.startswith("test_page"))

    items.sort(key=place)


@pytest.fixture(scope="session")
def regular():
    """A case in which every run leads to the same motion: the paper's parameters at Ω = 3."""
    return nanotap.Case.paper(omega=3)


@pytest.fixture(scope="session")
def bistable():
    """Two orbits coexist: α₁ = 0, Ω = 20."""
    return nanotap.Case.paper(omega=20, alpha1=0)


PHYSICAL = {
    "cantilever": {"lever": "PPP-FM", "Q": 200},
    "tip": {"mass_ratio": 0.1},
    "sample": {"material": "polystyrene"},
    "drive": {"frequency": "65.7 kHz", "free_amplitude": "20 nm"},
    "gap": {"tip": "18 nm"},
}


@pytest.fixture(scope="session")
def physical():
    """An FM-class lever on polystyrene: α₄ of about 25, Ω = 2.6."""
    return nanotap.Case(**PHYSICAL)


@pytest.fixture(scope="session")
def cell_map(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray]:
    """A map of 2 × 2 force curves in HDF5 of afmformats, of which one is missing, and the moduli (Pa) by row
    and column: a bead of 5 µm on a lever of 0.05 N/m, noise of 5 pN.
    """
    h5py = pytest.importorskip("h5py")
    radius, k, rng = 5e-6, 0.05, np.random.default_rng(1)
    moduli = np.array([[1e3, 2e3], [4e3, np.nan]])
    height = np.linspace(1.5e-6, -1.5e-6, 400)
    path = tmp_path_factory.mktemp("map") / "cells.h5"
    with h5py.File(path, "w") as file:
        file.attrs["software"] = "afmformats"
        for number, (y, x) in enumerate(np.argwhere(np.isfinite(moduli))):
            # Hertz in closed form: the force over the indentation, and the height of the base.
            indentation = np.linspace(0, 3e-6, 20000)
            force = 4 / 3 * moduli[y, x] / 0.75 * np.sqrt(radius) * indentation**1.5
            way = np.interp(-height, indentation + force / k, force, left=0)
            forces = np.concatenate([way, way[::-1]]) + rng.normal(0, 5e-12, 800)
            group = file.create_group(str(number))
            group.attrs.update({"spring constant": k, "imaging mode": "force-distance"})
            for name, of in (("x", x), ("y", y)):
                group.attrs.update({f"grid shape {name}": 2, f"grid size {name}": 4e-6})
                group.attrs.update(
                    {f"grid center {name}": 0.0, f"grid index {name}": int(of)}
                )
            group["force"] = forces
            group["height (measured)"] = np.concatenate([height, height[::-1]])
            group["force"].attrs["unit"] = "N"
            group["height (measured)"].attrs["unit"] = "m"
            group["segment"] = np.repeat([0, 1], 400)
    return path, moduli


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """The address of a local server."""
    with started() as server:
        yield address_of(server)


@pytest.fixture(scope="module")
def playwright() -> Iterator[Any]:
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        yield playwright


@pytest.fixture(scope="module")
def browser(playwright: Any) -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine: Debian's package is called chromium")
    browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
    yield browser
    with limited(20):
        browser.close()


@pytest.fixture(scope="module")
def page(address: str, browser: Any) -> Any:
    # The films stand still: drawing them takes half of a processor.
    page = without_knocks(
        browser.new_page(
            viewport={"width": 1440, "height": 1000}, reduced_motion="reduce"
        )
    )
    page.set_default_timeout(1000 * WAIT)
    page.complaints = []
    page.asked = []
    page.on(
        "console",
        lambda m: page.complaints.append(m.text) if m.type == "error" else None,
    )
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.on("request", lambda request: page.asked.append(request.url))
    with limited():
        page.goto(f"{address}#view=studies")
        page.wait_for_selector("td[data-observable=amplitude]")
    return page


@pytest.fixture
def films(page: Any) -> Iterator[None]:
    """A page whose films move."""
    page.emulate_media(reduced_motion="no-preference")
    yield
    page.emulate_media(reduced_motion="reduce")
