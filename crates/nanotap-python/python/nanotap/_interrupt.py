"""Ctrl-C that keeps what is finished."""

from typing import Generic, TypeVar

R = TypeVar("R")


class Interrupted(KeyboardInterrupt, Generic[R]):
    """Ctrl-C stopped the computation; `result` is the finished part.

    In a notebook it remains available: `import sys; sys.last_value.result`.
    """

    def __init__(self, message: str, result: R) -> None:
        super().__init__(message)
        self.result = result
