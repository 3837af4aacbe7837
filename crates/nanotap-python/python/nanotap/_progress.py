"""Progress bars, if tqdm is installed and output is shown."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from ._arguments import Progress

# Shorter computations show no progress, in seconds.
_PATIENCE = 0.7


@contextmanager
def bar(progress: Progress, noun: str) -> Iterator[Callable[[int, int], object] | None]:
    """The receiver of progress: a bar of tqdm, the caller's function, or none.

    `None` shows a bar on a terminal and in a notebook, `True` everywhere.
    """
    if callable(progress):
        yield progress
        return
    if progress is False or (progress is None and not _somebody_looks()):
        yield None
        return
    try:
        tqdm = _tqdm()
    except ImportError:
        if progress:
            message = "progress=True needs tqdm: pip install 'nanotap[progress]'"
            raise ImportError(message) from None
        yield None
        return
    line = tqdm(unit=f" {noun}", delay=_PATIENCE, leave=False, dynamic_ncols=True)

    def show(done: int, total: int) -> None:
        line.total = total
        line.update(done - line.n)

    try:
        yield show
    finally:
        line.close()


def _somebody_looks() -> bool:
    if "ipykernel" in sys.modules:
        return True
    return sys.stderr is not None and sys.stderr.isatty()


def _tqdm() -> Any:
    """tqdm's bar: a widget in a notebook that supports it, otherwise text."""
    if "ipykernel" in sys.modules and find_spec("ipywidgets"):
        return import_module("tqdm.notebook").tqdm
    return import_module("tqdm").tqdm
