"""What results are: objects with the names of the terminal's JSON."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, ClassVar, Self, overload

import numpy as np
import numpy.typing as npt

from ._arguments import Floats

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

    from ._case import Case


class Record(Mapping[str, Any]):
    """A part of a document: its entries by name, as items and as attributes."""

    __slots__ = ("_entries",)

    def __init__(self, entries: Mapping[str, Any]) -> None:
        self._entries = {key: _wrapped(value) for key, value in entries.items()}

    def __getitem__(self, name: str) -> Any:
        return self._entries[name]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._entries[name]
        except KeyError:
            message = f"there is no `{name}`; there are {', '.join(self._entries)}"
            raise AttributeError(message) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._entries})

    def __repr__(self) -> str:
        inside = ", ".join(f"{key}={value!r}" for key, value in self._entries.items())
        return f"Record({inside})"

    def __reduce__(self) -> tuple[Any, ...]:
        return Record, (self.to_dict(),)

    def to_dict(self) -> dict[str, Any]:
        """The same as plain dictionaries and lists."""
        return {key: _plain(value) for key, value in self._entries.items()}


class Fit(Record):
    """What a fit found, by the names of the terminal's JSON."""

    __slots__ = ()

    @property
    def best(self) -> dict[str, float]:
        """The best values by key; of parameters one a curve, `key of curve`."""
        return {_of_curve(p): float(p["value"]) for p in self["parameters"]}

    @property
    def errors(self) -> dict[str, float]:
        """Their standard errors; not a number where the data do not determine them."""
        return {
            _of_curve(p): math.nan
            if p["standard_error"] is None
            else float(p["standard_error"])
            for p in self["parameters"]
        }

    def best_case(self) -> "Case":
        """The case of the best fit."""
        from ._case import Case

        return Case.from_toml(self["case_file"])

    def __reduce__(self) -> tuple[Any, ...]:
        return Fit, (self.to_dict(),)


def _of_curve(parameter: Mapping[str, Any]) -> str:
    key, curve = parameter["key"], parameter.get("curve")
    return str(key) if curve is None else f"{key} of {curve}"


def _wrapped(value: Any) -> Any:
    if isinstance(value, Mapping) and not isinstance(value, Record):
        return Record(value)
    if isinstance(value, list):
        return [_wrapped(entry) for entry in value]
    return value


def _plain(value: Any) -> Any:
    if isinstance(value, Record):
        return value.to_dict()
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return value


def floats(value: Sequence[Any]) -> Floats:
    """Numbers of a document; what it could not say as a number is not one."""
    return np.array(value, dtype=np.float64)


def pairs(value: Sequence[Sequence[float]]) -> npt.NDArray[np.complex128]:
    """Complex numbers of a document."""
    numbers = np.array(value, dtype=np.float64).reshape(-1, 2)
    return numbers[:, 0] + 1j * numbers[:, 1]


@dataclass(frozen=True, repr=False, eq=False)
class Result:
    """A result: its chief entries are fields, the others are found by their names too."""

    document: Record = field(kw_only=True)
    """Everything, as the terminal's JSON has it."""

    _arrays: ClassVar[frozenset[str]] = frozenset()
    _complex: ClassVar[frozenset[str]] = frozenset()

    @classmethod
    def of(cls, document: Mapping[str, Any], **beside: Any) -> Self:
        """The result that a document tells of; `beside` is what no document holds."""
        record = document if isinstance(document, Record) else Record(document)
        values: dict[str, Any] = {"document": record, **beside}
        for entry in fields(cls):
            if entry.name in values or entry.name not in record:
                continue
            value = record[entry.name]
            if value is not None and entry.name in cls._arrays:
                value = floats(value)
            elif value is not None and entry.name in cls._complex:
                value = pairs(value)
            values[entry.name] = value
        return cls(**values)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name == "document":
            raise AttributeError(name)
        return getattr(self.document, name)

    def __getitem__(self, name: str) -> Any:
        own = {entry.name for entry in fields(self)}
        return getattr(self, name) if name in own else self.document[name]

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.document})

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain dictionaries and lists."""
        return self.document.to_dict()


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:.6g}"


@dataclass(frozen=True, repr=False, eq=False)
class Modes(Result):
    """Frequencies Ω and mode shapes, free and in contact; Galerkin and of the beam itself."""

    modes: int
    """How many modes."""
    free: Floats
    """Frequencies in free flight."""
    contact: Floats
    """Frequencies in contact."""
    exact_free: Floats
    """Those of the beam itself, in free flight."""
    exact_contact: Floats
    """Those of the beam itself, in contact."""
    shapes: "xr.DataArray" = field(kw_only=True)
    """The mode shapes φ_j(ξ) of the bare beam, over `xi` and `mode`."""

    _arrays = frozenset({"free", "contact", "exact_free", "exact_contact"})

    def table(self) -> "pd.DataFrame":
        """A row a mode."""
        import pandas as pd

        columns = {
            name: self[name]
            for name in ("free", "exact_free", "contact", "exact_contact")
        }
        return pd.DataFrame(
            columns, index=pd.RangeIndex(1, self.modes + 1, name="mode")
        )

    def __repr__(self) -> str:
        shown = ", ".join(f"{value:.6g}" for value in self.free)
        return f"Modes(free=[{shown}])"


@dataclass(frozen=True, repr=False, eq=False)
class Orbit(Result):
    """A periodic orbit, closed by Newton, with its stability and what is observed of it."""

    period: int
    """Minimal period in drive periods."""
    state: Floats
    """State at drive phase 0."""
    states: Floats
    """States at phase 0 of all its periods."""
    residual: float
    """Largest entry of Pⁿ(x) − x."""
    error: float
    """Estimated distance of the state from the true orbit."""
    multipliers: npt.NDArray[np.complex128]
    """Floquet multipliers, largest modulus first."""
    stable: bool
    """Whether every multiplier is inside the unit circle."""
    stability: str
    """stable, unstable or marginal."""
    events: list[Record]
    """Contacts begun and ended: `tau`, `kind`, `gap_rate`."""
    tip_max: float
    """Greatest tip deflection W."""
    tip_min: float
    """Least tip deflection W."""
    amplitude: float
    """Half of peak to peak of W."""
    contact_fraction: float
    """Part of the time in contact."""
    peak_force: float
    """Greatest force of the sample on the tip."""
    energy_balance: Record
    """Energy fed and drained: `drive_work`, `beam_damping`, `sample_damping`, `stored`, `residual`."""
    harmonics: list[Record]
    """Components: `order`, `tip`, `tip_phase`, `force`, `force_phase`, `slope`."""
    thd: float
    """Part of the tip deflection's power outside the drive's frequency."""
    phase: float
    """Phase lag of the tip deflection behind the drive, degrees."""
    first_harmonic: float
    """Amplitude of the tip deflection at the drive's frequency."""
    physical: Record | None = None
    """The same in SI, if the case is physical."""
    derivatives: Record | None = None
    """Derivatives by the keys that were asked for: `state`, the observables, `physical`."""
    series: "xr.Dataset | None" = field(default=None, kw_only=True)
    """One repetition as a time series over `tau`; of an orbit found by `orbit`."""

    _arrays = frozenset({"state", "states"})
    _complex = frozenset({"multipliers"})

    @property
    def spectral_radius(self) -> float:
        """Largest modulus of a multiplier: below 1 the orbit attracts."""
        return float(np.abs(self.multipliers).max())

    def spectrum(self) -> "pd.DataFrame":
        """The harmonics as a table."""
        import pandas as pd

        return pd.DataFrame([entry.to_dict() for entry in self.harmonics]).set_index(
            "order"
        )

    def plot(self, **options: Any) -> "Figure":
        """The orbit as the terminal draws it; see `nanotap.plot.orbit`."""
        from . import plot

        return plot.orbit(self, **options)

    def __repr__(self) -> str:
        return (
            f"Orbit(period={self.period}, {self.stability}, largest multiplier "
            f"{_number(self.spectral_radius)}, W from {_number(self.tip_min)} to "
            f"{_number(self.tip_max)})"
        )


@dataclass(frozen=True, repr=False, eq=False)
class Attractor(Result):
    """A motion that others go to: an orbit, a torus or chaos."""

    classification: str
    """periodic, quasi-periodic or chaotic."""
    fraction: float
    """Part of the starts that go there."""
    lyapunov: Floats
    """Lyapunov exponents per drive period."""
    evidence: str
    """Why it was named so."""
    count: int | None = None
    """How many starts went there."""
    period: int | None = None
    """Minimal period, of an orbit."""
    state: Floats | None = None
    """A state on it, at drive phase 0."""
    states: Floats | None = None
    """States at phase 0 of all periods of an orbit."""
    multipliers: npt.NDArray[np.complex128] | None = None
    """Floquet multipliers, of an orbit."""
    tip_max: float | None = None
    """Greatest tip deflection W."""
    tip_min: float | None = None
    """Least tip deflection W."""
    amplitude: float | None = None
    """Half of peak to peak of W."""
    contact_fraction: float | None = None
    """Part of the time in contact."""

    _arrays = frozenset({"lyapunov", "state", "states"})
    _complex = frozenset({"multipliers"})

    @property
    def name(self) -> str:
        """What it is called: `period 4`, `chaotic`."""
        return f"period {self.period}" if self.period else self.classification

    def __repr__(self) -> str:
        return (
            f"Attractor({self.name}, {100 * self.fraction:.1f} % of the starts, W from "
            f"{_number(self.tip_min)} to {_number(self.tip_max)})"
        )


class Attractors(Sequence[Attractor]):
    """A census: the attractors as a sequence, the largest first, and what else it found."""

    def __init__(self, case: "Case", document: Mapping[str, Any]) -> None:
        self.case = case
        self.document = Record(document)
        self._list = [Attractor.of(entry) for entry in self.document["attractors"]]

    @overload
    def __getitem__(self, index: int) -> Attractor: ...
    @overload
    def __getitem__(self, index: slice) -> list[Attractor]: ...
    def __getitem__(self, index: int | slice) -> Attractor | list[Attractor]:
        return self._list[index]

    def __len__(self) -> int:
        return len(self._list)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name == "document":
            raise AttributeError(name)
        return getattr(self.document, name)

    @property
    def attractors(self) -> list[Attractor]:
        """The attractors as a list."""
        return list(self._list)

    @property
    def undecided(self) -> list[Record]:
        """Starts of which nothing could be shown: `start`, `state`, `reason`."""
        return list(self.document["undecided"])

    @property
    def unstable(self) -> list[Orbit]:
        """Unstable orbits, if they were asked for."""
        return [Orbit.of(entry) for entry in self.document.get("unstable") or []]

    def to_dict(self) -> dict[str, Any]:
        """Everything, as the terminal's `nanotap attractors --json`."""
        return self.document.to_dict()

    def table(self) -> "pd.DataFrame":
        """A row an attractor."""
        import pandas as pd

        columns = [
            "classification",
            "period",
            "fraction",
            "tip_max",
            "tip_min",
            "amplitude",
            "contact_fraction",
        ]
        rows = [[getattr(one, name) for name in columns] for one in self]
        return pd.DataFrame(rows, columns=columns)

    def plot(self, **options: Any) -> "Figure":
        """The attractors as the terminal draws them; see `nanotap.plot.attractors`."""
        from . import plot

        return plot.attractors(self, **options)

    def __repr__(self) -> str:
        lines = [f"  {one!r}" for one in self]
        if self.undecided:
            lines.append(f"  {len(self.undecided)} undecided")
        return "\n".join(
            [f"{len(self)} attractors of {self.document['starts']} starts:", *lines]
        )

    def _repr_html_(self) -> str:
        return str(self.table().to_html())


@dataclass(frozen=True, repr=False, eq=False)
class Lyapunov(Result):
    """A Lyapunov spectrum with error bars, and a Poincaré section."""

    classification: str
    """What the motion is."""
    exponents: Floats
    """Exponents per drive period, the largest first."""
    errors: Floats
    """Their standard errors."""
    sum: float
    """Their sum."""
    sum_by_trace: float
    """The same from the trace of the equations and the time in contact."""
    kaplan_yorke_dimension: float
    """Of the attractor's section."""
    evidence: str
    """Why the motion was named so."""
    period: int | None = None
    """Minimal period, if periodic."""
    section: "xr.Dataset" = field(kw_only=True)
    """The section's points: `phase`, `tip`, `tip_rate`, `gap_rate`, `state`."""

    _arrays = frozenset({"exponents", "errors"})

    def __repr__(self) -> str:
        shown = ", ".join(
            f"{value:.4g} ± {error:.1g}"
            for value, error in zip(self.exponents, self.errors, strict=True)
        )
        return f"Lyapunov({self.classification}, [{shown}] per drive period)"


@dataclass(frozen=True, repr=False, eq=False)
class Convergence(Result):
    """The same motion with 1 … K modes."""

    modes: list[int]
    """Numbers of modes."""
    difference: Floats
    """Difference of the tip deflection from that of the most modes, as a part of the amplitude."""
    enough: int | None
    """The least number of modes from which on the difference stays below the tolerance."""
    tolerance: float
    """The difference that is small enough."""
    verdict: str
    """The answer in words."""
    motions: list[Record]
    """The motions with each number of modes."""

    _arrays = frozenset({"difference"})

    def table(self) -> "pd.DataFrame":
        """A row a number of modes."""
        import pandas as pd

        table = pd.DataFrame([motion.to_dict() for motion in self.motions])
        return table.assign(difference=self.difference).set_index("modes")

    def __repr__(self) -> str:
        return f"Convergence({self.verdict})"


@dataclass(frozen=True, repr=False, eq=False)
class Paper(Result):
    """The paper computed again."""

    out: str
    """The folder of the report."""
    html: str
    """The report."""
    pictures: list[str]
    """Its pictures."""
    reproduced: int
    """Statements that are reproduced."""
    differs: int
    """Statements that differ."""
    ambiguous: int
    """Statements that can be read in more than one way."""
    checks: list[Record]
    """Each statement: `id`, `paper`, `here`, `verdict`, `evidence`, `rerun`."""

    def table(self) -> "pd.DataFrame":
        """A row a statement."""
        import pandas as pd

        return pd.DataFrame([check.to_dict() for check in self.checks]).set_index("id")

    def __repr__(self) -> str:
        return (
            f"Paper({self.reproduced} reproduced, {self.differs} differ, "
            f"{self.ambiguous} ambiguous: {self.html})"
        )
