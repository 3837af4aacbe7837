"""The page without a server: from static files, from one file, and by links, in a real browser."""

from __future__ import annotations

import contextlib
import functools
import http.server
import os
import threading
import urllib.parse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nanotap
import numpy as np
import pytest
from browsers import WAIT, idle, limited, observed, until
from program import ROOT

FOLDER = Path(os.environ.get("NANOTAP_PAGE", ROOT / "target" / "page"))
CASE = """# A stiff lever on mica.
[cantilever]
k = "26 N/m"
f0 = "300 kHz"
Q = 400

[tip]
radius = "10 nm"

[sample]
law = "dmt"
modulus = "60 GPa"
hamaker = "1e-19 J"

[drive]
frequency = "300 kHz"
free_amplitude = "10 nm"

[gap]
tip = "8 nm"
"""
# In place of WebAssembly.Instance in a worker: no answer to requests of coexisting motions.
BROKEN = """
const Instance = WebAssembly.Instance;
WebAssembly.Instance = function (module, imports) {
  const { exports } = new Instance(module, imports);
  const answer = (start, length, path) => {
    const name = new TextDecoder().decode(new Uint8Array(exports.memory.buffer, start, path));
    if (name === "/api/attractors") throw new WebAssembly.RuntimeError("unreachable");
    exports.answer(start, length, path);
  };
  return { exports: { memory: exports.memory, room: exports.room, answer } };
};
"""


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        pass


@contextlib.contextmanager
def served(folder: Path) -> Iterator[str]:
    """The address of a plain web server, which has ended after this."""
    handler = functools.partial(Quiet, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}/"
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture(scope="module")
def folder() -> Path:
    if not (FOLDER / "index.html").exists():
        pytest.skip(f"no page in {FOLDER}: cargo xtask page builds it")
    return FOLDER


@pytest.fixture(scope="module")
def site(folder: Path) -> Iterator[str]:
    with served(folder) as address:
        yield address


@pytest.fixture(autouse=True)
def _limit() -> Iterator[None]:
    with limited():
        yield


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    """A page of a browser that knows nothing yet. It loads nothing from elsewhere, and neither its code nor
    its policy complains.
    """
    context = browser.new_context(viewport={"width": 1440, "height": 1000})
    page = context.new_page()
    page.set_default_timeout(1000 * WAIT)
    complaints: list[str] = []
    loaded: list[str] = []
    page.on(
        "console",
        lambda m: complaints.append(m.text) if m.type in ("error", "warning") else None,
    )
    page.on("pageerror", lambda error: complaints.append(str(error)))
    context.on("request", lambda request: loaded.append(request.url))
    yield page
    context.close()
    assert complaints == []
    assert loaded
    hosts = {urllib.parse.urlsplit(url).hostname for url in loaded}
    assert hosts <= {"127.0.0.1", None}


def opened(page: Any, address: str) -> None:
    """Opens a link in the view of all studies, and waits for its motion."""
    if "view=" not in address:
        base, _, fragment = address.partition("#")
        address = f"{base}#view=studies&{fragment}"
    page.goto("about:blank")
    page.goto(address)
    idle(page)


def amplitude(case: nanotap.Case) -> float:
    return float(nanotap.orbit(case)["amplitude"])


def shared(page: Any) -> str:
    """The link to the view of a page."""
    page.click("#share")
    page.wait_for_selector("#link-copied:not(:empty)")
    link = str(page.input_value("#link-address"))
    page.click("#link-close")
    return link


def open_case(page: Any, path: Path) -> None:
    page.set_input_files("#open", path)


@pytest.fixture
def case_file(tmp_path: Path) -> Path:
    path = tmp_path / "mica.toml"
    path.write_text(CASE)
    return path


def test_static_files_compute(page: Any, site: str, regular: nanotap.Case) -> None:
    opened(page, f"{site}#preset=paper")
    assert observed(page, "amplitude") == pytest.approx(amplitude(regular), rel=1e-12)
    page.wait_for_selector("#study-figure canvas")
    page.wait_for_selector("#attractors button")


def test_one_file_from_the_disk_computes(
    page: Any, folder: Path, regular: nanotap.Case
) -> None:
    opened(page, f"{(folder / 'nanotap.html').as_uri()}#preset=paper")
    assert observed(page, "amplitude") == pytest.approx(amplitude(regular), rel=1e-12)
    page.wait_for_selector("#study-figure canvas")


def test_a_browser_that_rounds_twice_runs_the_other_module(
    page: Any, site: str, regular: nanotap.Case
) -> None:
    page.add_init_script(
        "WebAssembly.Instance = class extends WebAssembly.Instance"
        " { get exports() { return { f: () => 0 }; } };"
    )
    modules: list[str] = []
    page.on("request", lambda r: modules.append(r.url) if ".wasm" in r.url else None)
    opened(page, f"{site}#preset=paper")
    assert [url.rsplit("/", 1)[1] for url in modules] == ["nanotap-exact.wasm"]
    assert observed(page, "amplitude") == pytest.approx(amplitude(regular), rel=1e-12)


def test_the_second_part_of_the_module_comes_once_a_study_needs_it(
    page: Any, site: str
) -> None:
    modules: list[str] = []
    page.on("request", lambda r: modules.append(r.url) if ".wasm" in r.url else None)
    page.goto(f"{site}#preset=dmt&set.drive.setpoint=0.8")
    page.wait_for_selector("body[data-rows=done]")
    page.wait_for_selector("body[data-search=done]")
    assert [url.rsplit("/", 1)[1] for url in modules] == ["nanotap.wasm"]
    # Two studies in workers of their own: the second has the module of the first.
    for study in ("modes", "lever"):
        page.goto("about:blank")
        page.goto(f"{site}#preset=dmt&tab={study}&ran=yes")
        page.wait_for_selector("#tables td")
    names = [url.rsplit("/", 1)[1] for url in modules]
    assert "nanotap-second.wasm" in names
    assert set(names) == {"nanotap.wasm", "nanotap-second.wasm"}
    assert page.is_hidden("#message")


def test_a_link_to_an_opened_case_opens_it_anywhere(
    page: Any, site: str, folder: Path, case_file: Path
) -> None:
    opened(page, f"{site}#preset=paper&tab=diagram")
    open_case(page, case_file)
    until(page, lambda: page.input_value("[data-key='gap.tip']") == "8 nm")
    page.fill("[data-key='gap.tip']", "9 nm")
    page.press("[data-key='gap.tip']", "Enter")
    until(page, lambda: "set.gap.tip=9" in page.url)
    page.click("#tab-basin")
    page.fill("#study-form [name=fromx]", "-3 nm")
    page.press("#study-form [name=fromx]", "Tab")
    numbers = observed(page, "amplitude"), page.inner_text("#summary")
    case = nanotap.Case.from_file(case_file).with_(gap={"tip": "9 nm"})
    shown = page.inner_text("td[data-observable=amplitude]").removesuffix(" nm")
    assert float(shown) == pytest.approx(1e9 * amplitude(case), rel=1e-4)
    link = shared(page)
    assert link.startswith(f"{site}#view=studies&case=1")
    single = f"{(folder / 'nanotap.html').as_uri()}#{link.split('#')[1]}"
    for address in (link, single):
        other = page.context.new_page()
        other.set_default_timeout(1000 * WAIT)
        opened(other, address)
        assert (observed(other, "amplitude"), other.inner_text("#summary")) == numbers
        assert other.get_attribute("#tab-basin", "aria-selected") == "true"
        assert other.input_value("#study-form [name=fromx]") == "-3 nm"
        other.close()
    # Back to a case of the list, and again to the file.
    page.select_option("#preset", "paper")
    until(page, lambda: page.locator("[data-key=omega]").count() == 1)
    assert "case=" not in page.url
    page.select_option("#preset", label="mica.toml")
    until(page, lambda: page.locator("[data-key='gap.tip']").count() == 1)
    assert page.input_value("[data-key='gap.tip']") == "8 nm"


def test_a_link_to_a_case_of_the_list_names_it(page: Any, site: str) -> None:
    opened(page, f"{site}#preset=two-modes&set.gap.tip=19+nm")
    link = shared(page)
    assert "preset=two-modes" in link
    assert "case=" not in link


@pytest.mark.parametrize(
    ("word", "words"),
    [
        ("1", "damaged"),
        ("1%21%21", "damaged"),
        ("1S0z", "damaged"),
        ("9S0xM", "another version"),
        # "omga = 3"
        ("1y89NT1SwVTAGAA", "omga"),
    ],
)
def test_a_wrong_link_says_so_and_the_page_goes_on(
    page: Any, site: str, word: str, words: str
) -> None:
    opened(page, f"{site}#case={word}&set.omega=3&tab=diagram")
    assert words in page.inner_text("#note")
    assert page.is_hidden("#message")
    page.select_option("#preset", "paper")
    until(page, lambda: page.locator("[data-key=omega]").count() == 1)
    assert page.inner_text("#note") == ""


def test_a_wrong_case_file_says_so_and_the_page_goes_on(
    page: Any, site: str, tmp_path: Path
) -> None:
    opened(page, f"{site}#preset=paper&tab=diagram")
    before = observed(page, "amplitude")
    wrong = tmp_path / "wrong.toml"
    long = tmp_path / "long.toml"
    wrong.write_text("omga = 3")
    long.write_text("#" * 2_000_000)
    for path, words in ((wrong, "omga"), (long, "2000000 bytes")):
        open_case(page, path)
        page.wait_for_selector(f"#message:has-text('{words}')")
        assert path.name in page.inner_text("#message")
        assert observed(page, "amplitude") == before
    page.fill("[data-key=omega]", "3.1")
    page.press("[data-key=omega]", "Enter")
    until(page, lambda: observed(page, "amplitude") != before)
    assert page.is_hidden("#message")


def test_a_dropped_file_of_two_gigabytes_is_not_read(
    page: Any, site: str, tmp_path: Path
) -> None:
    path = tmp_path / "curve.jpk-force"
    with path.open("wb") as file:
        file.truncate(2 << 30)
    opened(page, f"{site}#preset=dmt&tab=data")
    page.set_input_files("#study-form input[type=file]", path)
    page.wait_for_selector("#progress:has-text('2147483648 bytes')")
    page.set_input_files("#study-form input[type=file]", [])
    path.unlink()


def test_it_opens_without_a_network_after_the_first_visit(
    page: Any, folder: Path
) -> None:
    with served(folder) as address:
        opened(page, f"{address}#preset=paper")
        before = observed(page, "amplitude")
        page.evaluate("navigator.serviceWorker.ready.then(() => true)")
    opened(page, f"{address}#preset=paper")
    assert observed(page, "amplitude") == before
    opened(page, f"{address}index.html#preset=paper&set.omega=3.1")
    assert observed(page, "amplitude") != before
    # With the part that studies need.
    opened(page, f"{address}#preset=paper&tab=modes&ran=yes")
    page.wait_for_selector("#tables td")
    assert page.is_hidden("#message")


def test_it_can_be_installed(page: Any, site: str) -> None:
    opened(page, f"{site}#preset=paper&tab=diagram")
    client = page.context.new_cdp_session(page)
    page.evaluate("navigator.serviceWorker.ready.then(() => true)")
    # A window without a profile keeps nothing.
    assert client.send("Page.getAppManifest")["errors"] == []
    found = client.send("Page.getInstallabilityErrors")["installabilityErrors"]
    assert {error["errorId"] for error in found} <= {"in-incognito"}


def decoded(picture: Any) -> str:
    zxingcpp = pytest.importorskip("zxingcpp")
    [code] = zxingcpp.read_barcodes(picture)
    return str(code.text)


def test_the_code_is_that_of_the_link(page: Any, site: str, tmp_path: Path) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    opened(page, f"{site}#preset=paper&set.omega=3.1")
    page.click("#share")
    path = tmp_path / "code.png"
    page.locator("#link-code svg").screenshot(path=path)
    picture = np.uint8(255 * pyplot.imread(path)[..., :3].mean(axis=2))
    assert decoded(picture) == page.input_value("#link-address")
    make = "(text) => import('./qr.js').then(({ code }) => code(text))"
    for length in (*range(20, 200, 11), *range(200, 2500, 127), 2953):
        text = "".join(chr(33 + (k * k + length) % 90) for k in range(length))
        rows = np.array(page.evaluate(make, text))
        assert (len(rows) - 17) % 4 == 0
        picture = np.kron(np.pad(~rows, 4, constant_values=True), np.ones((4, 4)))
        assert decoded(np.uint8(255 * picture)) == text
    assert page.evaluate(make, "x" * 2954) is None


def test_a_stopped_study_ends_at_once(page: Any, site: str) -> None:
    opened(page, f"{site}#preset=paper&tab=diagram")
    page.click("#study-form button:has-text('Compute')")
    page.wait_for_selector("#study-figure canvas")
    page.click("#study-form button:has-text('Stop')")
    page.wait_for_selector("#progress:has-text('stopped')")
    page.click("#tab-resonance")
    page.click("#study-form button:has-text('Compute')")
    page.wait_for_selector("#progress:has-text('values')")


def test_a_failed_computation_says_so_and_the_page_goes_on(
    page: Any, folder: Path, tmp_path: Path
) -> None:
    for path in folder.iterdir():
        (tmp_path / path.name).symlink_to(path)
    (tmp_path / "worker.js").unlink()
    (tmp_path / "worker.js").write_text(BROKEN + (folder / "worker.js").read_text())
    with served(tmp_path) as address:
        opened(page, f"{address}#preset=paper&tab=diagram")
        page.wait_for_selector("#bound:has-text('the page goes on')")
        assert "MiB of memory" in page.inner_text("#bound")
        before = observed(page, "amplitude")
        page.fill("[data-key=omega]", "3.3")
        page.press("[data-key=omega]", "Enter")
        until(page, lambda: observed(page, "amplitude") != before)


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("WebAssembly.validate = () => false", "cannot run nanotap"),
        ("delete globalThis.WebAssembly", "cannot run nanotap"),
        (
            "WebAssembly.compileStreaming = async () => { throw new RangeError('none'); }",
            "memory: none",
        ),
    ],
)
def test_a_browser_that_cannot_run_it_says_so(
    page: Any, site: str, script: str, words: str
) -> None:
    page.add_init_script(script)
    page.goto(site)
    page.wait_for_selector(f"#message:has-text('{words}')")
    assert page.inner_text("#message").count("\n") == 0


def test_a_slow_phone_shows_everything(page: Any, site: str) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    client = page.context.new_cdp_session(page)
    client.send("Emulation.setCPUThrottlingRate", {"rate": 4})
    opened(page, f"{site}#preset=dmt")
    page.wait_for_selector("#study-figure canvas")
    before = observed(page, "amplitude")
    page.focus("[data-slider='gap.tip']")
    page.keyboard.press("PageDown")
    until(page, lambda: observed(page, "amplitude") != before)
    page.click("#share")
    page.wait_for_selector("#link-code svg")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.click("#link-close")
