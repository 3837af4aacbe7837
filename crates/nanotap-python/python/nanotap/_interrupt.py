"""Ctrl-C that keeps what is finished."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Generic, TypeVar

R = TypeVar("R")


class Interrupted(KeyboardInterrupt, Generic[R]):
    """Ctrl-C stopped the computation; `result` is the finished part, or `None` if nothing was finished.

    In a notebook it remains available: `import sys; sys.last_value.result`.
    """

    def __init__(self, message: str, result: R) -> None:
        super().__init__(message)
        self.result = result


@contextmanager
def stoppable() -> Iterator[None]:
    """Raises `Interrupted` where Ctrl-C stops work of which no part is finished."""
    try:
        yield
    except Interrupted:
        raise
    except KeyboardInterrupt:
        raise nothing() from None


def nothing() -> "Interrupted[None]":
    return Interrupted("stopped before a part was finished", None)


def part_of(result: R, finished: bool) -> "Interrupted[R] | Interrupted[None]":
    """What a study raises that Ctrl-C stopped: `finished` says whether `result` contains anything."""
    return (
        Interrupted("stopped before it was finished", result) if finished else nothing()
    )
