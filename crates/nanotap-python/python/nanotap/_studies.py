"""What exists and how it changes: census, branches, exponents, modes enough, the paper."""

import json
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arguments, _nanotap
from ._arguments import Box, Progress
from ._case import Case, Path
from ._describe import case_attributes, describe
from ._interrupt import Interrupted
from ._motions import _cased, words
from ._progress import bar
from ._results import Attractors, Convergence, Lyapunov, Paper

if TYPE_CHECKING:
    import xarray as xr

_MOST_MODES = 50
# Points of a section: 800 MB at N = 3.
_MOST_POINTS = 10_000_000


def attractors(
    case: Case,
    *,
    starts: int | None = None,
    seed: int = 1,
    box: Box = None,
    max_period: int = 64,
    unstable: int = 0,
    threads: int | None = None,
    progress: Progress = None,
) -> Attractors:
    """Every motion that coexists: a census from starts spread over states of every size.

    Args:
        case: Whose motions.
        starts: How many starts, spread evenly over one box of states. Without it, starts
            of every size go on until the share of starts that may lead to motions not
            found is below 0.2 % (with 95 % confidence), or 5000 are done.
        seed: Their seed: the same seed gives the same answer on any number of threads.
        box: Sides of the box, as in `{"a1": (-1, 1)}`; the others are derived from the
            linear response to the drive.
        max_period: Longest period looked for.
        unstable: Also list unstable orbits up to this period.
        threads: Threads; without it, one a core.
        progress: Whether to show a bar, or what hears of progress.

    Raises:
        ValueError: something that was asked for is not right.
        Interrupted: Ctrl-C; its `result` is the census of the starts that were done.
    """
    sides = _arguments.box(box)
    with bar(progress, "starts") as hears:
        document, interrupted = _nanotap.attractors(
            _cased(case)._core,
            starts=_arguments.optional_count("starts", starts),
            seed=_arguments.seed(seed),
            sides=sides,
            max_period=_arguments.count("max_period", max_period, 1),
            unstable=_arguments.count("unstable", unstable),
            threads=_threads(threads),
            progress=hears,
        )
    found = Attractors(case, json.loads(document))
    if interrupted:
        message = (
            "stopped before all starts were done: the fractions are of what was done"
        )
        raise Interrupted(message, found)
    return found


def branch(
    case: Case,
    *,
    parameter: str,
    from_: float | str,
    to: float | str,
    period: int | None = None,
    state: Any = None,
    switch: int | None = None,
    diagram: bool = False,
    values: int = 5,
    starts: int = 48,
    seed: int = 1,
    second: Mapping[str, tuple[float | str, float | str]] | None = None,
    max_step: float = 0.01,
    threads: int | None = None,
    progress: Progress = None,
) -> "xr.Dataset":
    """Periodic orbits followed in a parameter, stable and unstable, with their bifurcations.

    Args:
        case: Whose orbits.
        parameter: The parameter, as the case calls it.
        from_: Its value at the start; of a physical case also with a unit, as in "70 kHz".
        to: The other end of its range.
        period: Period of the orbit at the start; without it, that of the motion where a run
            settles.
        state: State near which the orbit at the start is looked for.
        switch: Also follow the doubled branches at flips, so many doublings deep.
        diagram: Assemble the whole picture: every stable orbit of a census at several
            values, followed both ways and through two doublings (or as `switch` says).
        values: Of the diagram: values of the parameter at which a census is taken.
        starts: Of the diagram: starts at each.
        seed: Of the diagram: seed of the starts.
        second: A second parameter and its range, as in `{"alpha4": (5, 40)}`: the loci of
            the bifurcations are traced in both.
        max_step: Longest step, as a part of the range.
        threads: Threads; without it, one a core.
        progress: Whether to show a bar, or what hears of progress.

    Returns:
        The orbits over `point` (`branch`, the parameter by its name, `stable`, `tip_max`,
        `states` …) and the bifurcations over `bifurcation` (`bifurcation_kind`,
        `bifurcation_parameter`, `bifurcation_states` …); loci over `locus_point`. The
        attributes say of each branch why it ends, and what could not be followed.

    Raises:
        ValueError: something that was asked for is not right.
        RuntimeError: no orbit was found to follow.
        Interrupted: Ctrl-C; its `result` is what was followed until then.
    """
    _cased(case)
    if diagram and (values < 2 or starts < 1):
        message = f"diagram with values={values} and starts={starts}: at least 2 values and 1 start are needed"
        raise ValueError(message)
    locus = None
    if second is not None:
        if not isinstance(second, Mapping) or len(second) != 1:
            message = (
                'second: name one parameter with its range, as in {"alpha4": (5, 40)}'
            )
            raise TypeError(message)
        name, ends = next(iter(second.items()))
        low, high = _arguments._pair(f"second: {name}", ends)
        locus = (name, _arguments.quantity(name, low), _arguments.quantity(name, high))
    doublings = 2 if diagram and switch is None else switch or 0
    census = (
        _arguments.count("values", values),
        _arguments.count("starts", starts),
        _arguments.seed(seed),
    )
    with bar(progress, "points") as hears:
        text, interrupted = _nanotap.branch(
            case._core,
            parameter=parameter,
            from_=_arguments.quantity("from_", from_),
            to=_arguments.quantity("to", to),
            period=_arguments.optional_count("period", period),
            state=_arguments.state(state),
            doublings=_arguments.count("switch", doublings),
            census=census if diagram else None,
            second=locus,
            max_step=_arguments.number("max_step", max_step),
            threads=_threads(threads),
            progress=hears,
        )
    ds = _branch_dataset(case, json.loads(text))
    if interrupted:
        message = "stopped before it was done"
        raise Interrupted(message, ds)
    return ds


def _branch_dataset(case: Case, report: dict[str, Any]) -> "xr.Dataset":
    import xarray as xr

    name = report["parameter"]
    entries = case.state_names
    points = report["points"]
    bifurcations = report["bifurcations"]
    variables = {
        **_columns(points, "point", "", len(entries)),
        **_columns(bifurcations, "bifurcation", "bifurcation_", len(entries)),
    }
    dims, values = variables.pop("parameter", ("point", np.empty(0)))
    coords: dict[str, Any] = {name: (dims, values), "state": words(entries)}
    symbols = {key: symbol for key, symbol, _ in case._core.parameters}
    ds = xr.Dataset(variables, coords)
    loci = report.get("loci")
    if loci:
        curves = loci["curves"]
        lengths = [len(curve["first"]) for curve in curves]
        ds = ds.assign(
            locus=("locus_point", np.repeat(np.arange(len(curves)), lengths)),
            locus_kind=(
                "locus_point",
                np.repeat([str(c["kind"]) for c in curves], lengths),
            ),
            locus_period=(
                "locus_point",
                np.repeat([int(c["period"]) for c in curves], lengths),
            ),
            locus_first=("locus_point", _joined(curve["first"] for curve in curves)),
            locus_second=("locus_point", _joined(curve["second"] for curve in curves)),
        )
        ds.attrs["second"] = loci["second"]
        ds.attrs["second_symbol"] = symbols.get(loci["second"], loci["second"])
    ds.attrs.update(case_attributes(case, "branches of periodic orbits"))
    ds.attrs.update(
        parameter=name,
        parameter_symbol=symbols.get(name, name),
        branches=json.dumps(report["branches"]),
        failures=json.dumps(report["failures"]),
    )
    unit = report.get("parameter_unit")
    if unit:
        ds.attrs["parameter_unit"] = json.dumps(unit)
    return describe(ds)


def _joined(parts: Iterable[list[float]]) -> "np.typing.NDArray[np.float64]":
    arrays = [np.array(part, dtype=float) for part in parts]
    return np.concatenate(arrays) if arrays else np.empty(0)


def _columns(
    rows: list[dict[str, Any]], dim: str, prefix: str, states: int
) -> dict[str, Any]:
    """Rows of a document by column."""
    columns: dict[str, Any] = {}
    for name in dict.fromkeys(key for row in rows for key in row):
        values: list[Any] = [row.get(name) for row in rows]
        if name == "state":
            table = np.array(values, dtype=float).reshape(-1, states)
            columns[f"{prefix}states"] = ((dim, "state"), table)
        elif name == "multipliers":
            radius = [
                max((abs(complex(*pair)) for pair in pairs), default=np.nan)
                for pairs in values
            ]
            columns[f"{prefix}spectral_radius"] = (dim, np.array(radius, dtype=float))
            longest = max((len(pairs) for pairs in values), default=0)
            table = np.full((len(rows), longest), np.nan + 0j)
            for k, pairs in enumerate(values):
                table[k, : len(pairs)] = [complex(*pair) for pair in pairs]
            columns[f"{prefix}multipliers"] = ((dim, "multiplier"), table)
        elif all(isinstance(value, str) for value in values):
            columns[f"{prefix}{name}"] = (dim, np.array(values, dtype=str))
        elif all(
            value is None or isinstance(value, bool | int | float) for value in values
        ):
            filled = [np.nan if value is None else value for value in values]
            columns[f"{prefix}{name}"] = (dim, np.array(filled))
    return columns


def approach(
    case: Case,
    *,
    from_: float | str | None = None,
    to: float | str | None = None,
    points: int = 80,
    branches: bool = True,
    switch: int = 1,
    max_period: int = 32,
    threads: int | None = None,
    progress: Progress = None,
) -> "xr.Dataset":
    """Amplitude, phase, force and energy against the distance to the sample, both ways.

    Args:
        case: What approaches.
        from_: Distance at which to begin, with a unit ("30 nm") or as α5; without it, 1.25
            times what the free tip swings towards the sample.
        to: Distance at which to turn back; without it, 0.
        points: Distances each way.
        branches: Also continue the branches that coexist, stable and unstable.
        switch: Doublings of branches to follow.
        max_period: Longest period looked for.
        threads: Threads; without it, one a core.
        progress: Whether to show a bar, or what hears of progress.

    Returns:
        What is observed over `way` (approach, retract) and the distance (by the name of its
        parameter, with `zc` in metres for a physical case): `first_harmonic`, `phase`,
        `peak_force`, `dissipation` … and in SI `physical_A`, `physical_F_max`,
        `physical_E_dis` …; the branches over `branch_point`.

    Raises:
        ValueError: something that was asked for is not right.
        Interrupted: Ctrl-C; its `result` is the curve until then.
    """

    def distance(name: str, value: float | str | None) -> str | None:
        return None if value is None else _arguments.quantity(name, value)

    with bar(progress, "distances") as hears:
        text, interrupted = _nanotap.approach(
            _cased(case)._core,
            from_=distance("from_", from_),
            to=distance("to", to),
            points=_arguments.count("points", points),
            branches=bool(branches),
            doublings=_arguments.count("switch", switch),
            max_period=_arguments.count("max_period", max_period),
            threads=_threads(threads),
            progress=hears,
        )
    ds = _approach_dataset(case, json.loads(text))
    if interrupted:
        message = "stopped before it was done"
        raise Interrupted(message, ds)
    return ds


def _approach_dataset(case: Case, report: dict[str, Any]) -> "xr.Dataset":
    import xarray as xr

    name = report["parameter"]
    ways = ["approach", "retract"]
    rows: dict[tuple[str, float], dict[str, Any]] = {}
    for entry in report["table"]:
        physical = entry.pop("physical", None) or {}
        entry |= {f"physical_{key}": value for key, value in physical.items()}
        rows[entry["way"], entry["gap"]] = entry
    gaps = sorted({gap for _, gap in rows})
    flat = [rows.get((way, gap), {}) for way in ways for gap in gaps]
    for entry in flat:
        # A word that is not said is empty, not missing.
        entry.setdefault("classification", "")
        entry.setdefault("reason", "")
    columns = _columns(flat, "row", "", 0)
    variables = {
        key: (("way", name), values.reshape(len(ways), len(gaps)))
        for key, (_, values) in columns.items()
        if key not in {"way", "gap", "zc"}
    }
    coords: dict[str, Any] = {"way": words(ways), name: np.array(gaps)}
    if "zc" in columns:
        # Both ways stop at the same distances.
        zc = columns["zc"][1].reshape(len(ways), len(gaps))
        coords["zc"] = (name, np.where(np.isnan(zc[0]), zc[1], zc[0]))
    branches = report.get("branches") or {"points": []}
    entries = case.state_names
    further = _columns(branches["points"], "branch_point", "branch_", len(entries))
    ds = xr.Dataset(variables, coords)
    if further:
        coords["state"] = words(entries)
        ds = ds.assign(further).assign_coords(state=words(entries))
    for key in ("free_amplitude", "free_phase", "free_reach"):
        ds[key] = report[key]
    ds.attrs.update(case_attributes(case, "approach and retract"))
    ds.attrs.update(
        parameter=name,
        hysteresis=json.dumps(report["hysteresis"]),
        returned=int(report["returned"]),
    )
    unit = report.get("parameter_unit")
    if unit:
        ds.attrs["parameter_unit"] = json.dumps(unit)
        ds.zc.attrs.update(long_name="distance to the sample", units="m")
    ds[name].attrs.update(long_name="distance to the sample", units="g0")
    return describe(ds)


def lyapunov(
    case: Case,
    *,
    periods: int = 20_000,
    transient: int = 1000,
    state: Any = None,
    section: str = "phase",
    phase: float = 0.0,
    points: int = 5000,
) -> Lyapunov:
    """The Lyapunov spectrum with error bars, and a Poincaré section.

    Args:
        case: Whose motion.
        periods: Drive periods averaged over.
        transient: Drive periods thrown away first.
        state: State at the start, drive phase 0; without it, rest.
        section: `phase`: once a drive period, at `phase`; `contact`: at the beginning of
            every contact.
        phase: Drive phase of the section in degrees.
        points: Points of the section.

    Raises:
        ValueError: something that was asked for is not right.
    """
    import xarray as xr

    if section not in {"phase", "contact"}:
        message = f"section: `{section}` is none; there are phase and contact"
        raise ValueError(message)
    degrees = _arguments.number("phase", phase)
    if not np.isfinite(degrees):
        message = f"phase {degrees}: no phase"
        raise ValueError(message)
    if _arguments.count("points", points) > _MOST_POINTS:
        message = f"points: {points} are too many; {_MOST_POINTS} at most"
        raise ValueError(message)
    text, rows = _nanotap.lyapunov(
        _cased(case)._core,
        periods=_arguments.count("periods", periods),
        transient=_arguments.count("transient", transient),
        state=_arguments.state(state),
        phase=degrees if section == "phase" else None,
        points=_arguments.count("points", points),
    )
    entries = case.state_names
    if rows.shape[1] == 4:  # no point, so no state
        rows = np.empty((0, 4 + len(entries)))
    cut = xr.Dataset(
        {
            "phase": ("point", 360 * rows[:, 0]),
            "tip": ("point", rows[:, 1]),
            "tip_rate": ("point", rows[:, 2]),
            "gap_rate": ("point", rows[:, 3]),
            "states": (("point", "state"), rows[:, 4:]),
        },
        {"state": words(entries)},
        case_attributes(case, "a Poincaré section"),
    )
    cut.phase.attrs.update(long_name="drive phase", units="degrees")
    cut.gap_rate.attrs.update(long_name="rate of the gap", units="g0/sqrt(mL4/EI)")
    return Lyapunov.of(json.loads(text), section=describe(cut))


def convergence(
    case: Case, *, largest: int = 10, tolerance: float = 0.01, period: int | None = None
) -> Convergence:
    """The same motion with 1 … `largest` modes, and a verdict on how many are enough.

    Args:
        case: Whose motion.
        largest: Largest number of modes.
        tolerance: Difference of the tip deflection, as a part of the amplitude, that is
            small enough.
        period: Period of the orbit to compare; without it, the motion where a run from rest
            settles.

    Raises:
        ValueError: something that was asked for is not right.
    """
    many = _arguments.count("largest", largest)
    if not 2 <= many <= _MOST_MODES:
        message = f"largest {many}: nothing to compare; a number of modes from 2 to {_MOST_MODES} is needed"
        raise ValueError(message)
    small = _arguments.number("tolerance", tolerance)
    if not (small > 0 and np.isfinite(small)):
        message = f"tolerance {small}: no difference is that small; a positive part of the amplitude is needed"
        raise ValueError(message)
    text = _nanotap.convergence(
        _cased(case)._core,
        largest=many,
        tolerance=small,
        period=_arguments.optional_count("period", period),
    )
    return Convergence.of(json.loads(text))


def paper(
    *,
    out: Path = "nanotap-paper",
    only: str | Iterable[str] = (),
    quick: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> Paper:
    """Every figure and number of the paper computed again, with verdicts and evidence.

    Args:
        out: Folder for the report and its pictures; made if it is not there.
        only: Only these sections, such as "fig4".
        quick: Fewer starts and parameter values: seconds instead of minutes, wider bounds.
        threads: Threads; without it, one a core.
        progress: Whether to show a bar, or what hears of progress.

    Raises:
        ValueError: there is no such section.
        Interrupted: Ctrl-C; its `result` is the report of what was computed.
    """
    sections = [only] if isinstance(only, str) else [str(name) for name in only]
    with bar(progress, "%") as hears:
        text, interrupted = _nanotap.paper(
            out=out,
            only=sections,
            quick=bool(quick),
            threads=_threads(threads),
            progress=hears,
        )
    report = Paper.of(json.loads(text))
    if interrupted:
        message = f"stopped; the report in {report.out} is of what was computed"
        raise Interrupted(message, report)
    return report


def _threads(threads: int | None) -> int:
    return 0 if threads is None else _arguments.count("threads", threads, 1)
