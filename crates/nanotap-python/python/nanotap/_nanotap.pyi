"""The compiled part; see the package for what each is for."""

import os
from collections.abc import Callable, Sequence
from typing import Self, TypeAlias

import numpy as np
import numpy.typing as npt

__version__: str

_Floats: TypeAlias = npt.NDArray[np.float64]
_Progress: TypeAlias = Callable[[int, int], object] | None
_Table: TypeAlias = tuple[list[str], _Floats]
_Path: TypeAlias = str | os.PathLike[str]

class CaseCore:
    def __new__(
        cls,
        source: tuple[str, str] | None,
        overrides: list[str],
        catalogues: list[tuple[str, str]],
    ) -> Self: ...
    @staticmethod
    def from_file(
        path: _Path, overrides: list[str], catalogues: list[str]
    ) -> CaseCore: ...
    @property
    def made_of(
        self,
    ) -> tuple[tuple[str, str] | None, list[str], list[tuple[str, str]]]: ...
    @property
    def document(self) -> str: ...
    @property
    def document_at_setpoint(self) -> str: ...
    @property
    def setpoint(self) -> str | None: ...
    @property
    def mapping(self) -> str: ...
    @property
    def remarks(self) -> list[tuple[str, str]]: ...
    @property
    def toml(self) -> str | None: ...
    @property
    def is_physical(self) -> bool: ...
    @property
    def parameters(self) -> list[tuple[str, str, float]]: ...
    @property
    def state_names(self) -> list[str]: ...

class Receiver:
    @property
    def missing(self) -> list[int]: ...
    def take(self, chunk: int, files: list[bytes]) -> None: ...
    def tidy(self) -> bool: ...

class Recipe:
    @staticmethod
    def sweep(
        case: CaseCore,
        *,
        over: list[str],
        starts: int | None,
        seed: int,
        sides: list[tuple[str, float, float]],
        state: _Floats | None,
        follow: str | None,
        periods: int,
        strobe: int | None,
        transient: int | None,
        max_period: int,
    ) -> Recipe: ...
    @staticmethod
    def basin(
        case: CaseCore,
        *,
        x: str,
        y: str,
        state: _Floats | None,
        attractors: Sequence[Sequence[float]] | None,
        starts: int,
        seed: int,
        periods: int,
        max_period: int,
        threads: int,
        progress: _Progress,
    ) -> Recipe: ...
    @property
    def chunks(self) -> int: ...
    def compute(
        self, path: _Path, *, share: str, threads: int, progress: _Progress
    ) -> bool: ...
    def chunk_files(self, chunk: int) -> list[bytes]: ...
    def receiver(self, path: _Path) -> Receiver: ...

def case_keys() -> list[tuple[str, list[tuple[str, str, list[str]]]]]: ...
def catalogue() -> list[tuple[str, str, str]]: ...
def modes(case: CaseCore, points: int) -> tuple[str, _Floats, _Floats]: ...
def simulate(
    case: CaseCore,
    *,
    periods: int,
    transient: int | None,
    state: _Floats | None,
    strobe: int,
    max_period: int,
    series_periods: int,
    resolution: int,
) -> tuple[str, _Table]: ...
def fixed_step(
    case: CaseCore,
    *,
    periods: int,
    transient: int | None,
    state: _Floats | None,
    strobe: int,
    max_period: int,
    steps: list[int],
    every_stage: bool,
) -> tuple[str, _Table]: ...
def orbit(
    case: CaseCore,
    *,
    period: int | None,
    state: _Floats | None,
    harmonics: int,
    resolution: int,
) -> tuple[str, _Table]: ...
def observe(
    cases: list[CaseCore],
    *,
    orbits: bool,
    periods: int,
    transient: int | None,
    period: int | None,
    state: _Floats | None,
    strobe: int,
    max_period: int,
    harmonics: int,
    threads: int,
    progress: _Progress,
) -> tuple[list[tuple[str | None, str]], bool]: ...
def glossary() -> str: ...
def attractors(
    case: CaseCore,
    *,
    starts: int | None,
    seed: int,
    sides: list[tuple[str, float, float]],
    max_period: int,
    unstable: int,
    threads: int,
    progress: _Progress,
) -> tuple[str, bool]: ...
def branch(
    case: CaseCore,
    *,
    parameter: str,
    from_: str,
    to: str,
    period: int | None,
    state: _Floats | None,
    doublings: int,
    census: tuple[int, int, int] | None,
    second: tuple[str, str, str] | None,
    max_step: float,
    threads: int,
    progress: _Progress,
) -> tuple[str, bool]: ...
def approach(
    case: CaseCore,
    *,
    from_: str | None,
    to: str | None,
    points: int,
    branches: bool,
    doublings: int,
    max_period: int,
    threads: int,
    progress: _Progress,
) -> tuple[str, bool]: ...
def lyapunov(
    case: CaseCore,
    *,
    periods: int,
    transient: int,
    state: _Floats | None,
    phase: float | None,
    points: int,
) -> tuple[str, _Floats]: ...
def convergence(
    case: CaseCore, *, largest: int, tolerance: float, period: int | None
) -> str: ...
def paper(
    *, out: _Path, only: list[str], quick: bool, threads: int, progress: _Progress
) -> tuple[str, bool]: ...
def paper_sections() -> list[str]: ...
def merge(sources: list[str], out: _Path) -> str: ...
def summary(path: _Path) -> str: ...
def window(path: _Path) -> str: ...
def figure(path: _Path, format: str) -> bytes: ...
def mathtext(label: str) -> str: ...
def colours() -> tuple[list[str], list[str], dict[str, str]]: ...
def describe(study: str, facts: str, columns: dict[str, _Floats]) -> str: ...
def write_table(path: _Path, out: _Path) -> None: ...
def gsf(
    title: str,
    x: _Floats,
    y: _Floats,
    values: _Floats,
    axis_unit: str,
    value_unit: str,
) -> bytes: ...
