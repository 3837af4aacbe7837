"""The page's view of a measured image: the states of its pixels, compared with the terminal's and with the truth."""

from __future__ import annotations

import json
import re
import struct
import tomllib
from pathlib import Path
from typing import Any

import nanotap
import numpy as np
import pytest
from browsers import printed, until

CASE = Path(__file__).parent.parent / "docs" / "cases" / "scan-plateaus.toml"


def gwyddion(channels: dict[str, tuple[str, np.ndarray]], size: list[float]) -> bytes:
    """A Gwyddion file of these channels: unit and rows from the top."""

    def named(name: str, letter: str, value: bytes) -> bytes:
        return name.encode() + b"\0" + letter.encode() + value

    def text(of: str) -> bytes:
        return of.encode() + b"\0"

    def boxed(kind: str, *parts: bytes) -> bytes:
        content = b"".join(parts)
        return text(kind) + struct.pack("<I", len(content)) + content

    def unit(of: str) -> bytes:
        return boxed("GwySIUnit", named("unitstr", "s", text(of)))

    parts = []
    for k, (name, (of, rows)) in enumerate(channels.items()):
        numbers = struct.pack("<I", rows.size) + rows.astype("<f8").tobytes()
        field = boxed(
            "GwyDataField",
            named("xres", "i", struct.pack("<i", rows.shape[1])),
            named("yres", "i", struct.pack("<i", rows.shape[0])),
            named("xreal", "d", struct.pack("<d", size[0])),
            named("yreal", "d", struct.pack("<d", size[1])),
            named("si_unit_xy", "o", unit("m")),
            named("si_unit_z", "o", unit(of)),
            named("data", "D", numbers),
        )
        parts += [
            named(f"/{k}/data", "o", field),
            named(f"/{k}/data/title", "s", text(name)),
        ]
    return b"GWYP" + boxed("GwyContainer", *parts)


@pytest.fixture(scope="module")
def scanned() -> Any:
    return nanotap.scan(nanotap.Case.from_file(CASE), lines=4, progress=False)


@pytest.fixture(scope="module")
def folder(scanned: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the case, and an image of it with four lines."""
    folder = tmp_path_factory.mktemp("image")
    trace = scanned.sel(direction="trace")
    case = tomllib.loads(CASE.read_text())
    free = nanotap.Case.from_file(CASE).physical["free_amplitude"]
    setpoint = case["scan"]["setpoint"] * free
    channels = {
        "Height": ("m", trace.height.values[::-1]),
        "Amplitude": ("m", trace.amplitude_error.values[::-1] + setpoint),
        "Phase": ("deg", trace.phase.values[::-1]),
    }
    size = [float(trace[axis].values[-1] + trace[axis].values[0]) for axis in "xy"]
    (folder / "image.gwy").write_bytes(gwyddion(channels, size))
    (folder / "case.toml").write_text(CASE.read_text())
    return folder


def opened(page: Any, address: str, folder: Path, language: str = "en") -> None:
    page.goto("about:blank")
    page.goto(f"{address}#view=data&preset=dmt&lang={language}")
    page.wait_for_selector("#study-form input[type=file]")
    page.set_input_files("#open", folder / "case.toml")
    until(page, lambda: "case=" in page.url)
    until(page, lambda: page.locator("#study-form input[type=file]").count() == 1)
    page.set_input_files("#study-form input[type=file]", folder / "image.gwy")
    page.wait_for_selector("#study-form [name=phase_offset]")


def decided(page: Any) -> None:
    page.fill("#study-form [name=phase_offset]", "0")
    page.select_option("#study-form [name=sense]", "lag")
    page.click("#image-again")
    page.wait_for_selector("#image-files")
    until(page, lambda: "Shares of the pixels" in page.inner_text("#progress"))


def shares(page: Any) -> dict[str, float]:
    rows = page.locator("#image-shares tbody tr").all()
    return {
        row.locator("th").inner_text(): float(
            row.locator("td").first.get_attribute("data-value")
        )
        for row in rows
    }


def test_the_states_of_an_image_are_those_of_the_terminal_and_of_the_scan(
    page: Any, address: str, folder: Path, scanned: Any
) -> None:
    opened(page, address, folder)
    decided(page)
    options = ("--phase-offset", "0", "--sense", "lag")
    found = printed(folder, "image-states", "image.gwy", "case.toml", *options)
    assert found["decided"]
    read = shares(page)
    pixels = found["shape"][0] * found["shape"][1]
    expected = {state["name"]: state["share"] for state in found["states"]}
    assert read.pop("undecided") == pytest.approx(found["undecided"] / pixels)
    assert {
        ("free" if name == "free flight" else name): share
        for name, share in read.items()
    } == pytest.approx(expected)
    # The truth of the scan: the same to the part of the pixels that the edges take.
    truth = scanned.sel(direction="trace").state.values
    for name in ("attractive", "repulsive"):
        assert read[name] == pytest.approx(
            (truth == name).mean(), abs=found["undecided"] / pixels
        )
    assert min(read["attractive"], read["repulsive"]) > 0.2
    heights = [
        float(cell.get_attribute("data-value"))
        for cell in page.locator("#image-steps tbody tr td:nth-child(4)").all()
    ]
    assert len(heights) == min(20, found["step_count"])
    assert heights == pytest.approx([step["height"] for step in found["steps"][:20]])
    # The command gives the same.
    command = page.text_content("#study-command")
    assert command.startswith("nanotap image-states image.gwy case.toml")
    assert "--sense=lag" in command
    # Height, states and corrected height, with the shares in the legend.
    panels = page.evaluate("document.getElementById('study-figure').figure.panels")
    assert len(panels) == 3
    labels = [one["label"] for one in panels[1]["layers"][0]["categories"]]
    assert f"attractive ({100 * read['attractive']:.0f} %)" in labels


def test_the_files_of_an_image_are_saved(page: Any, address: str, folder: Path) -> None:
    opened(page, address, folder)
    decided(page)
    saved = {}
    for button in page.locator("#image-files button").all():
        with page.expect_download() as download:
            button.click()
        saved[download.value.suggested_filename] = Path(
            download.value.path()
        ).read_bytes()
    assert set(saved) == {"image-states.csv", "image-corrected.gsf"}
    found = printed(
        folder,
        "image-states",
        "image.gwy",
        "case.toml",
        "--phase-offset",
        "0",
        "--sense",
        "lag",
    )
    corrected = np.array(found["images"]["corrected"], dtype=float)
    values = np.frombuffer(saved["image-corrected.gsf"][-4 * corrected.size :], "<f4")
    assert values.reshape(corrected.shape) == pytest.approx(
        corrected, rel=1e-6, abs=1e-16
    )
    head, *rows = saved["image-states.csv"].decode().splitlines()
    assert "state" in head
    assert len([row for row in rows if not row.startswith("#")]) == corrected.size


def test_an_image_whose_offset_is_not_known_says_so_in_both_languages(
    page: Any, address: str, folder: Path
) -> None:
    for language, words in (("en", "does not tell"), ("de", "verrät nicht")):
        opened(page, address, folder, language)
        page.wait_for_selector("#image-shares")
        found = printed(folder, "image-states", "image.gwy", "case.toml")
        assert (words in page.inner_text("#progress")) == (not found["decided"])
        figure = page.evaluate(
            "JSON.stringify(document.getElementById('study-figure').figure.panels)"
        )
        heads = page.locator("#image-shares thead").inner_text()
        if language == "de":
            assert "Anteil am Bild" in heads
            assert "unentschieden" in figure
            assert not re.search("undecided|attractive|corrected", figure)
        assert json.loads(figure)
