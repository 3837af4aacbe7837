"""Results: objects with the names of the terminal's JSON."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any, ClassVar, Self, overload

import numpy as np
import numpy.typing as npt

from ._arguments import Floats
from ._record import Record, plain
from ._report import Answer, Answered, Report

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from ._case import Case
    from ._si import Scales


class Fit(Report):
    """The result of a fit, with the names of the terminal's JSON."""

    __slots__ = ()

    @property
    def best(self) -> dict[str, float]:
        """The best values by key; for parameters with one value per curve, `key of curve`."""
        return {_of_curve(p): float(p["value"]) for p in self["parameters"]}

    @property
    def errors(self) -> dict[str, float]:
        """Their standard errors; NaN where the data do not determine them."""
        return {
            _of_curve(p): math.nan
            if p["standard_error"] is None
            else float(p["standard_error"])
            for p in self["parameters"]
        }

    def best_case(self, curve: str | None = None) -> "Case":
        """The case of the best fit; if parameters differ between curves, that of `curve`.

        Raises:
            KeyError: no curve has this name.
        """
        from ._case import Case

        if curve is None:
            return Case.from_toml(self["case_file"])
        files = {one["curve"]: one["case_file"] for one in self.get("case_files", ())}
        return Case.from_toml(files[curve])

    def compared(self) -> "pd.DataFrame":
        """The compared contact laws, one per row: `fits`, `aic`, `bic`, `above_best`,
        `weight` …; empty if none were requested.

        The law with the smaller criterion describes the data better for its number of
        parameters; a difference of some ten is more than chance. It does not prove that a law
        is right.
        """
        import pandas as pd

        columns = [
            "law",
            "fits",
            "aic",
            "bic",
            "above_best",
            "weight",
            "rows_without_orbit",
            "chi2",
            "reason",
        ]
        rows = [{c: law.get(c) for c in columns} for law in self.get("laws", ())]
        return pd.DataFrame(rows, columns=columns).set_index("law")

    def __repr__(self) -> str:
        return "\n".join(self._report())

    def _repr_html_(self) -> str:
        rows = "".join(
            "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
            for row in self._table()
        )
        rest = escape("\n".join(self._goodness()))
        names = ("parameter", "value", "standard error", "95 % interval", "began at")
        head = "".join(f"<th>{name}</th>" for name in names)
        return f"<table><caption>fit</caption><tr>{head}</tr>{rows}</table><pre>{rest}</pre>"

    def _report(self, most: int = 25) -> list[str]:
        """At most so many lines: warnings first, then parameters, correlations and goodness."""
        rows = self._table()
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  " + "  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        fewest = 1 + len(lines)
        rest = self._goodness()[: max(most - fewest, 1)]
        return ["Fit", *lines, *rest]

    def _table(self) -> list[list[str]]:
        """One row per parameter: name, value, error, interval, start."""
        return [
            [
                _of_curve(p),
                _quantity(p["value"], p["unit"]),
                "not determined"
                if p["standard_error"] is None
                else f"± {_number(p['standard_error'])}",
                ""
                if p["interval"] is None
                else " to ".join(_number(end) for end in p["interval"]),
                f"began at {_number(p['start'])}"
                + (", at a bound" if p["at_bound"] else ""),
            ]
            for p in self["parameters"]
        ]

    def _goodness(self) -> list[str]:
        lines = [f"  warning: {remark}" for remark in self["remarks"]]
        for one in self["undetermined"]:
            lines.insert(0, f"  warning: not determined: {one['words']}")
        if not self["fits"]:
            lines.insert(0, "  warning: the law does not describe the data")
        if self["cancelled"]:
            lines.insert(0, "  warning: stopped before it was finished")
        freedom = self["degrees_of_freedom"]
        lines.append(
            f"  chi² = {_number(self['chi2'])} with {freedom:g} degrees of freedom, "
            f"{len(self['rows'])} rows"
        )
        for column in self["columns"]:
            how = "estimated from the residuals" if column["estimated"] else "stated"
            size = _quantity(column["standard_error"], column["unit"])
            lines.append(f"  standard error of {column['name']}: {size} ({how})")
        lines += [f"  rival minimum: {_rival(one)}" for one in self.get("rivals", ())]
        for one in self.get("suggestions", ()):
            lines.append(f"  {one['words']}: free={','.join(one['free'])!r}")
        names = list(self.best)
        table = self["correlations"]
        pairs_ = [
            (
                abs(table[i][j]),
                f"  correlation of {names[i]} and {names[j]}: {table[i][j]:.3f}",
            )
            for i in range(len(table))
            for j in range(i)
            if table[i][j] is not None
        ]
        strong = sorted((pair for pair in pairs_ if pair[0] >= 0.1), reverse=True)
        return lines + [text for _, text in strong]


class Reconstruction(Report):
    """A reconstructed force, with the names of the terminal's JSON."""

    __slots__ = ()

    def curve(self) -> "pd.DataFrame":
        """Force, dissipation and damping with their standard errors, by distance."""
        import pandas as pd

        return pd.DataFrame(dict(self["table"])).set_index("distance")

    def law_table(self) -> str:
        """The force as text for the key `sample.table` of a case with `law = "table"`."""
        units = [" (m)", " (N)"] if self["physical"] else ["", ""]
        rows = [[f"gap{units[0]}", f"force{units[1]}"]]
        table = self["table"]
        pairs = zip(table["distance"], table["force"], strict=True)
        return json.dumps([*rows, *map(list, pairs)])


def _of_curve(parameter: Mapping[str, Any]) -> str:
    key, curve = parameter["key"], parameter.get("curve")
    return str(key) if curve is None else f"{key} of {curve}"


def _rival(rival: Mapping[str, Any]) -> str:
    values = [
        f"{_of_curve(p)} = {_quantity(p['value'], p['unit'])}"
        for p in rival["parameters"]
    ]
    return f"{', '.join(values)}: {rival['words']}"


def floats(value: Sequence[Any]) -> Floats:
    """Numbers of a document; `null` becomes NaN."""
    return np.array(value, dtype=np.float64)


def pairs(value: Sequence[Sequence[float]]) -> npt.NDArray[np.complex128]:
    """Complex numbers of a document."""
    numbers = np.array(value, dtype=np.float64).reshape(-1, 2)
    return numbers[:, 0] + 1j * numbers[:, 1]


@dataclass(frozen=True, repr=False, eq=False)
class Result(Answered):
    """A result: its main entries are fields, the others are accessible by name too.

    Of a physical case numbers are in SI, except states; `units` has the unit of each, and
    `to_dict()` the document as the terminal writes it.

    Attributes:
        document: The whole document, as in the terminal's JSON.
        notes: Notes on the result, such as the initial state that was followed and how to list
            the motions that others lead to.
    """

    document: Record = field(kw_only=True)
    notes: list[str] = field(default_factory=list, kw_only=True)
    _answer: Answer | None = field(default=None, kw_only=True)

    _arrays: ClassVar[frozenset[str]] = frozenset()
    _complex: ClassVar[frozenset[str]] = frozenset()

    @classmethod
    def of(
        cls,
        document: Mapping[str, Any],
        scales: "Scales | None" = None,
        study: str = "",
        **further: Any,
    ) -> Self:
        """The result of a document; `further` has fields that are not in the document."""
        record = (
            document
            if isinstance(document, Record)
            else Record(document, scales, (study, "") if study else None)
        )
        values: dict[str, Any] = {"document": record, **further}
        for name in cls.__dataclass_fields__:
            if name in values or name not in record._entries:
                continue
            if name in cls._arrays or name in cls._complex:
                value = record[name]
                made = floats if name in cls._arrays else pairs
                values[name] = None if value is None else made(value)
            else:
                values[name] = record[name]
        return cls(**values)

    if not TYPE_CHECKING:
        # A checker of types knows the names that are declared, and finds misspelt ones.
        def __getattr__(self, name: str) -> Any:
            if name.startswith("_") or name == "document":
                raise AttributeError(name)
            return getattr(self.document, name)

    def __getitem__(self, name: str) -> Any:
        own = name in self.__dataclass_fields__ or name == "series"
        return getattr(self, name) if own else self.document[name]

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.document})

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, type(self)):
            return NotImplemented
        return self.document == other.document

    __hash__ = object.__hash__

    @property
    def units(self) -> dict[str, str]:
        """The units of the entries that have one."""
        return self.document.units

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain dictionaries and lists, as in the terminal's JSON."""
        return self.document.to_dict()


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:.6g}"


def _quantity(value: float | None, unit: str) -> str:
    return _number(value) + ("" if unit in ("", "1") else f" {unit}")


@dataclass(frozen=True, repr=False, eq=False)
class Modes(Result):
    """Frequencies Ω and mode shapes, free and in contact; Galerkin and of the beam itself.

    Attributes:
        modes: Number of modes.
        free: Frequencies in free flight (N): Ω, of a physical case in Hz.
        contact: Frequencies in contact (N), likewise.
        exact_free: Those of the beam itself, in free flight (N); empty where the modes of the
            lever were measured.
        exact_contact: Those of the beam itself, in contact (N); empty likewise.
        shapes: The mode shapes φ_j(ξ) of the bare beam, over `xi` and `mode`.
    """

    modes: int
    free: Floats
    contact: Floats
    exact_free: Floats
    exact_contact: Floats
    shapes: "xr.DataArray" = field(kw_only=True)

    _arrays = frozenset({"free", "contact", "exact_free", "exact_contact"})

    def table(self) -> "pd.DataFrame":
        """One row per mode."""
        import pandas as pd

        columns = {
            name: self[name]
            for name in ("free", "exact_free", "contact", "exact_contact")
            if len(self[name]) == self.modes
        }
        return pd.DataFrame(
            columns, index=pd.RangeIndex(1, self.modes + 1, name="mode")
        )

    def __repr__(self) -> str:
        shown = ", ".join(f"{value:.6g}" for value in self.free)
        return f"Modes(free=[{shown}])"


class _Observed:
    """Observables of an orbit from its document, which has only the requested ones."""

    tip_max: float
    tip_min: float
    amplitude: float
    first_harmonic: float
    phase: float
    contact_fraction: float
    peak_force: float
    energy_balance: Record
    mean_deflection: float
    indentation: float
    mean_force: float
    dissipation: float
    virial: float
    contacts_per_period: float
    impact_speed: float
    contact_time: float
    rms_deflection: float
    gap_range: list[float]
    least_force: float
    contact_force: float
    drive_power: float
    sample_power: float
    slope_range: list[float]
    optical_amplitude: float
    optical_phase: float
    tip_motion: float
    tip_motion_phase: float
    beam_clearance: float
    beam_clearance_xi: float
    beam_clearance_period: float
    grazing_contacts: int
    tone2_response: float
    tone2_lag: float
    tone3_response: float
    tone3_lag: float
    first_sideband: float
    first_sideband_phase: float
    second_sideband: float
    second_sideband_phase: float
    determinant_defect: float
    decay_periods: float


@dataclass(frozen=True, repr=False, eq=False)
class Orbit(_Observed, Result):
    """A periodic orbit, closed by Newton's method, with its stability and observables.

    Attributes:
        period: Minimal period in drive periods.
        state: State at drive phase 0 (n).
        states: States at phase 0 of all its periods (period × n).
        residual: Largest entry of P(x_k) − x_(k+1) over the states of the orbit.
        error: Estimated distance of the state from the true orbit.
        multipliers: Floquet multipliers, largest modulus first (n).
        stable: Whether every multiplier is inside the unit circle.
        stability: stable, unstable or marginal.
        events: Contacts begun and ended: `tau`, `kind`, `gap_rate`.
        tip_max: Largest tip deflection W (g0 or m).
        tip_min: Smallest tip deflection W (g0 or m).
        amplitude: Half of the peak-to-peak value of W (g0 or m).
        contact_fraction: Contact time / period.
        peak_force: Largest force of the sample on the tip (EI g0/L³ or N).
        energy_balance: Energy input and losses: `drive_work`, `beam_damping`,
            `sample_damping`, `stored`, `residual`.
        harmonics: Components: `order`, `tip`, `tip_phase`, `force`, `force_phase`,
            `slope`.
        thd: Fraction of the tip deflection's power outside the drive's frequency.
        phase: Phase lag of the tip deflection behind the drive, degrees.
        first_harmonic: Amplitude of the tip deflection at the drive's frequency (g0 or m).
        physical: Observables in SI, if the case is physical.
        derivatives: Derivatives by the requested keys: `state`, the
            observables, `physical`.
        upset: The smallest knock found on the tip that upsets it, if requested: `smallest`
            (`tip_speed`, `impulse`, `energy`, `drive_phase`, `leads_to`, `physical` in SI, or
            None), `smaller_tried`, `size_ratio`, `instants` and `largest_tried`.
        proof: Result of the proof, if requested: `proved`, `statement`, and if proved
            enclosures of `state`, `switches` and `multipliers`, `stability`,
            `unique_within`.
        made_series: Function that computes the time series.

    Lengths and forces are in the model's units, of a physical case in SI.
    """

    period: int
    state: Floats
    states: Floats
    residual: float
    error: float
    multipliers: npt.NDArray[np.complex128]
    stable: bool
    stability: str
    events: list[Record]
    harmonics: list[Record]
    thd: float
    physical: Record | None = None
    derivatives: Record | None = None
    upset: Record | None = None
    proof: Record | None = None
    made_series: "Callable[[], xr.Dataset] | xr.Dataset | None" = field(
        default=None, kw_only=True
    )

    _arrays = frozenset({"state", "states"})
    _complex = frozenset({"multipliers"})

    @property
    def series(self) -> "xr.Dataset | None":
        """One repetition as a time series over `tau`, for an orbit computed by `orbit`."""
        made = self.made_series
        if callable(made):
            made = made()
            # A frozen object may cache a result.
            object.__setattr__(self, "made_series", made)
        return made

    @property
    def series_in_si(self) -> "xr.Dataset":
        """The time series in SI: `tau` in s, `tip` and `gap` in m, `force` in N …

        Raises:
            ValueError: the case is not physical, or the orbit has no time series.
        """
        from ._si import in_si

        if self.series is None:
            message = "only an orbit found by nanotap.orbit has a time series"
            raise ValueError(message)
        return in_si(self.series)

    def __reduce__(self) -> tuple[Any, ...]:
        return _orbit_again, (self.document, self.series, self._answer)

    @property
    def spectral_radius(self) -> float:
        """Largest modulus of a multiplier; below 1 the orbit is stable."""
        return float(np.abs(self.multipliers).max())

    def spectrum(self) -> "pd.DataFrame":
        """The harmonics as a table."""
        import pandas as pd

        table = pd.DataFrame([plain(entry) for entry in self.harmonics])
        if self.harmonics:
            table.attrs["units"] = self.harmonics[0].units
        return table.set_index("order")

    def __repr__(self) -> str:
        return (
            f"Orbit(period={self.period}, {self.stability}, largest multiplier "
            f"{_number(self.spectral_radius)}{_swing(self)})"
        )

    def _repr_html_(self) -> str:
        """A table for notebooks, in SI if the case is physical."""
        from ._describe import described

        rows = [
            ("period", str(self.period), "drive periods"),
            ("stability", self.stability, ""),
            ("largest multiplier", _number(self.spectral_radius), ""),
        ]
        for name, unit in self.units.items():
            words, value = described(name), self.document[name]
            if words and isinstance(value, float):
                rows.append((words, _number(value), "" if unit == "1" else unit))
        cells = "".join(
            f"<tr><td>{escape(words)}</td><td style='text-align:right'>{escape(value)}</td>"
            f"<td>{escape(unit)}</td></tr>"
            for words, value, unit in rows
        )
        return f"<table><caption>periodic orbit</caption>{cells}</table>"


def _swing(motion: "Orbit | Attractor") -> str:
    """The range of the tip deflection; chosen observables may lack it."""
    low, high = motion.document.get("tip_min"), motion.document.get("tip_max")
    if low is None or high is None:
        return ""
    unit = motion.units.get("tip_max", "")
    shown = f" {unit}" if unit == "m" else ""
    return f", W from {_number(low)} to {_number(high)}{shown}"


def _orbit_again(
    document: Record, series: "xr.Dataset | None", answer: Answer | None
) -> Orbit:
    return Orbit.of(document, made_series=series, _answer=answer)


@dataclass(frozen=True, repr=False, eq=False)
class Attractor(Result):
    """An attractor: an orbit, a torus or chaos.

    Attributes:
        classification: periodic, quasi-periodic or chaotic.
        fraction: Fraction of the initial states that lead to it.
        lyapunov: Lyapunov exponents per drive period (n).
        evidence: Evidence for the classification.
        count: Number of initial states that lead to it.
        period: Minimal period of an orbit, in drive periods.
        state: A state on it, at drive phase 0 (n).
        states: States at phase 0 of all periods of an orbit (period × n).
        multipliers: Floquet multipliers of an orbit (n).
        tip_max: Largest tip deflection W (g0 or m).
        tip_min: Smallest tip deflection W (g0 or m).
        amplitude: Half of the peak-to-peak value of W (g0 or m).
        contact_fraction: Contact time / period.
        proof: Result of the proof for an orbit, if requested, as in `Orbit`.
    """

    classification: str
    fraction: float
    lyapunov: Floats
    evidence: str
    count: int | None = None
    period: int | None = None
    state: Floats | None = None
    states: Floats | None = None
    multipliers: npt.NDArray[np.complex128] | None = None
    tip_max: float | None = None
    tip_min: float | None = None
    amplitude: float | None = None
    contact_fraction: float | None = None
    proof: Record | None = None

    _arrays = frozenset({"lyapunov", "state", "states"})
    _complex = frozenset({"multipliers"})

    @property
    def name(self) -> str:
        """Name of the motion: `period 4`, `chaotic`."""
        return f"period {self.period}" if self.period else self.classification

    def __repr__(self) -> str:
        share = f"{100 * self.fraction:.1f} % of the starts"
        return f"Attractor({self.name}, {share}{_swing(self)})"


class Attractors(Answered, Sequence[Attractor]):
    """A census: the attractors as a sequence, largest share first, and its other results."""

    def __init__(
        self, case: "Case", document: Record, answer: Answer | None = None
    ) -> None:
        self.case = case
        self.document = document
        self._answer = answer
        self._list = [Attractor.of(entry) for entry in self.document["attractors"]]

    @overload
    def __getitem__(self, index: int) -> Attractor: ...
    @overload
    def __getitem__(self, index: slice) -> list[Attractor]: ...
    def __getitem__(self, index: int | slice) -> Attractor | list[Attractor]:
        return self._list[index]

    def __len__(self) -> int:
        return len(self._list)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Attractors):
            return NotImplemented
        return self.document == other.document

    __hash__ = object.__hash__

    if not TYPE_CHECKING:
        # A checker of types knows the names that are declared, and finds misspelt ones.
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
        """Initial states that were not classified: `start`, `state`, `reason`."""
        return list(self.document["undecided"])

    @property
    def check(self) -> Record | None:
        """Initial states that were followed again on the exact flow, if requested: `starts`,
        `agreed`, `undecided`, `disagreements`."""
        return self.document.get("check")

    @property
    def unstable(self) -> list[Orbit]:
        """Unstable orbits, if requested."""
        return [Orbit.of(entry) for entry in self.document.get("unstable") or []]

    def to_dict(self) -> dict[str, Any]:
        """The whole document, as the terminal's `nanotap attractors --json`."""
        return self.document.to_dict()

    def table(self) -> "pd.DataFrame":
        """One row per attractor."""
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
        table = pd.DataFrame(rows, columns=columns)
        units = self[0].units if len(self) else {}
        table.attrs["units"] = {name: units[name] for name in columns if name in units}
        return table

    def __repr__(self) -> str:
        lines = [f"  {one!r}" for one in self]
        if self.undecided:
            lines.append(f"  {len(self.undecided)} undecided")
        return "\n".join(
            [f"{len(self)} attractors of {self.document['starts']} starts:", *lines]
        )

    def _repr_html_(self) -> str:
        table = self.table()
        units = table.attrs["units"]
        heads = {
            name: f"{name} ({unit})" for name, unit in units.items() if unit != "1"
        }
        return str(table.rename(columns=heads).to_html())


@dataclass(frozen=True, repr=False, eq=False)
class Lyapunov(Result):
    """A Lyapunov spectrum with error bars, and a Poincaré section.

    Attributes:
        classification: Kind of the motion.
        exponents: Exponents per drive period, largest first (n); NaN where one is −∞, as of a
            motion that sticks to a rigid stop.
        errors: Standard errors of the exponents (n); 0 of a closed orbit.
        sum: Sum of the exponents.
        sum_by_trace: The same from the trace of the equations and the time in contact.
        kaplan_yorke_dimension: Kaplan–Yorke dimension of the attractor's section.
        evidence: Evidence for the classification.
        period: Minimal period, if periodic.
        section: The section's points: `phase`, `tip`, `tip_rate`, `gap_rate`, `state`.
    """

    classification: str
    exponents: Floats
    errors: Floats
    sum: float
    sum_by_trace: float
    kaplan_yorke_dimension: float
    evidence: str
    period: int | None = None
    section: "xr.Dataset" = field(kw_only=True)

    _arrays = frozenset({"exponents", "errors"})

    def __repr__(self) -> str:
        shown = ", ".join(
            f"{value:.4g} ± {error:.1g}"
            for value, error in zip(self.exponents, self.errors, strict=True)
        )
        return f"Lyapunov({self.classification}, [{shown}] per drive period)"


@dataclass(frozen=True, repr=False, eq=False)
class Convergence(Result):
    """The same motion with 1 … K modes.

    Attributes:
        modes: Numbers of modes.
        difference: Difference of the tip deflection from that with the most modes, relative
            to the amplitude (K).
        enough: The smallest number of modes from which on the difference stays below the
            tolerance.
        tolerance: Tolerance of the difference.
        verdict: The result as text.
        motions: The motion for each number of modes.
    """

    modes: list[int]
    difference: Floats
    enough: int | None
    tolerance: float
    verdict: str
    motions: list[Record]

    _arrays = frozenset({"difference"})

    def table(self) -> "pd.DataFrame":
        """One row per number of modes."""
        import pandas as pd

        table = pd.DataFrame([plain(motion) for motion in self.motions])
        return table.assign(difference=self.difference).set_index("modes")

    def __repr__(self) -> str:
        return f"Convergence({self.verdict})"


@dataclass(frozen=True, repr=False, eq=False)
class Paper(Result):
    """Reproduction of the paper.

    Attributes:
        out: The folder of the report.
        html: Path of the report.
        pictures: Paths of its pictures.
        reproduced: Statements that are reproduced.
        differs: Statements that differ.
        ambiguous: Statements that can be read in more than one way.
        checks: Each statement: `id`, `paper`, `here`, `verdict`, `evidence`, `rerun`.
    """

    out: str
    html: str
    pictures: list[str]
    reproduced: int
    differs: int
    ambiguous: int
    checks: list[Record]

    def table(self) -> "pd.DataFrame":
        """One row per statement."""
        import pandas as pd

        return pd.DataFrame([check.to_dict() for check in self.checks]).set_index("id")

    def __repr__(self) -> str:
        return (
            f"Paper({self.reproduced} reproduced, {self.differs} differ, "
            f"{self.ambiguous} ambiguous: {self.html})"
        )
