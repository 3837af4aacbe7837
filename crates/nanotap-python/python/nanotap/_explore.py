"""The explorer of a case, in a cell of a notebook or a browser."""

import os
import subprocess
import sys
import tempfile
import urllib.request
import weakref
from html import escape
from types import TracebackType
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from ._case import Case


class Explorer:
    """A running explorer, from `Case.explore`. At the end of a cell it shows its page there.

    The server runs on this machine until `close`, the end of a `with` block, or of Python.
    """

    def __init__(self, case: "Case", browser: bool) -> None:
        self._start = case
        self._folder = tempfile.TemporaryDirectory(prefix="nanotap-")
        path = os.path.join(self._folder.name, "case.toml")
        with open(path, "w", encoding="utf-8") as file:
            file.write(case.to_toml())
        command = [sys.executable, "-m", "nanotap", "explore", path]
        self._server = subprocess.Popen(
            command if browser else [*command, "--no-browser"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            # Ctrl-C of a study in the same notebook does not end the page.
            start_new_session=True,
        )
        self._end = weakref.finalize(self, _end, self._server, self._folder)
        assert self._server.stdout is not None
        assert self._server.stderr is not None
        self._url = self._server.stdout.readline().strip()
        if not self._url:
            message = self._server.stderr.read().strip()
            self.close()
            raise RuntimeError(message)

    @property
    def url(self) -> str:
        """The address of the page, for a browser on this machine. It contains the token of the server."""
        return self._url

    @property
    def case(self) -> "Case":
        """The case as the page shows it now.

        Raises:
            RuntimeError: the explorer is closed.
        """
        if not self._end.alive:
            message = "the explorer is closed; case.explore() starts another"
            raise RuntimeError(message)
        address, token = self._url.split("/?token=")
        headers = {"x-nanotap-token": token}
        request = urllib.request.Request(f"{address}/api/case", headers=headers)
        # A proxy would not reach this machine's own address.
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with opener.open(request, timeout=30) as answer:
            text = answer.read().decode()
        if not text:
            return self._start
        case = type(self._start).from_toml(text)
        return case.with_(model_units=self._start._core.model_units)

    def close(self) -> None:
        """Ends the server."""
        self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Explorer({self._url if self._end.alive else 'closed'})"

    def _repr_html_(self) -> str:
        if not self._end.alive:
            return "<p>closed</p>"
        url = escape(self._url)
        return (
            f'<iframe src="{url}" title="nanotap" width="100%" height="800" style="border: 0">'
            f'</iframe><p><a href="{url}" target="_blank">Open in a tab</a></p>'
        )


def _end(
    server: "subprocess.Popen[str]", folder: "tempfile.TemporaryDirectory[str]"
) -> None:
    server.terminate()
    try:
        server.wait(5)
    except subprocess.TimeoutExpired:
        server.kill()
        server.wait()
    for pipe in (server.stdout, server.stderr):
        if pipe is not None:
            pipe.close()
    folder.cleanup()
