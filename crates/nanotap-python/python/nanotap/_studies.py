"""Studies: census, branches, exponents, number of modes, fits, the paper."""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from . import _arguments, _datasets, _nanotap
from ._arguments import Progress
from ._case import Case, Path, existing
from ._describe import case_attributes, declared, describe
from ._interrupt import Interrupted, part_of, stoppable
from ._motions import _cased, words
from ._progress import bar
from ._quantity import si_unit, written
from ._record import Record, plain
from ._report import Answer, Report
from ._results import (
    Attractors,
    Convergence,
    Fit,
    Lyapunov,
    Paper,
    Reconstruction,
)
from ._si import Scales, answered, scales

if TYPE_CHECKING:
    from distributed import Client

    from ._study_dataset import StudyDataset

Found = TypeVar("Found")


@stoppable()
def _run(
    name: str,
    case: Case,
    options: Mapping[str, Any],
    threads: int | None = None,
    progress: Progress = None,
) -> tuple[dict[str, Any], Answer, Scales | None, bool]:
    """The document of a study, its tables and figure, the units in which it is shown, and whether it
    was stopped by Ctrl-C."""
    core = _cased(case)._core
    request = _arguments.request(name, options)
    many = _arguments.optional_count("threads", threads)
    with bar(progress, _arguments.counted(name)) as show:
        report, interrupted = _nanotap.study(
            name, core, request, threads=many, progress=show
        )
    document = json.loads(report.document)
    units = scales(case, document.pop("case"))
    del document["version"]
    return document, Answer(report), units, interrupted


@stoppable()
def attractors(
    case: Case, options: Mapping[str, Any], threads: int | None, progress: Progress
) -> Attractors:
    """A census; the finished part if Ctrl-C stopped it."""
    document, answer, units, interrupted = _run(
        "attractors", case, options, threads, progress
    )
    record = Record(document, units, ("attractors", ""))
    found = Attractors(case, record, answer)
    if interrupted:
        message = "stopped before all starts were finished: the fractions refer to the finished ones"
        raise Interrupted(message, found)
    return found


def _finished(found: Found, interrupted: bool, *, part: bool = True) -> Found:
    """The result of a study; raises `Interrupted` if it was stopped, with the result where it has a
    finished part.
    """
    if interrupted:
        raise part_of(found, part)
    return found


@stoppable()
def branch(
    case: Case, options: Mapping[str, Any], threads: int | None, progress: Progress
) -> "StudyDataset":
    """Branches over `point`; the finished part if Ctrl-C stopped it."""
    document, answer, units, interrupted = _run(
        "branch", case, options, threads, progress
    )
    ds = _branch_dataset(case, document, units).answered_by(answer)
    return _finished(ds, interrupted)


def _branch_dataset(
    case: Case, report: dict[str, Any], units: Scales | None
) -> "StudyDataset":
    from ._study_dataset import StudyDataset

    name = report["parameter"]
    entries = case.state_names
    points = report["points"]
    bifurcations = report["bifurcations"]
    attractors = [
        {"number": row.pop("attractor"), **row} for row in report.get("attractors", [])
    ]
    events = [{"name": row.pop("event"), **row} for row in report.get("events", [])]
    variables = {
        **_columns(points, "point", "", len(entries)),
        **_columns(bifurcations, "bifurcation", "bifurcation_", len(entries)),
        **_columns(attractors, "attractor", "attractor_", len(entries)),
        **_columns(events, "event", "event_", len(entries)),
    }
    if not bifurcations:
        # Without bifurcations the columns are there, and empty.
        like = {"kind": "", "criticality": "", "uncertainty": 0.0}
        like |= points[0] if points else {}
        one = _columns([like], "bifurcation", "bifurcation_", len(entries))
        one.pop("bifurcation_stable", None)
        variables |= {key: (dims, values[:0]) for key, (dims, values) in one.items()}
    dims, values = variables.pop("parameter", ("point", np.empty(0)))
    # A number of the equations has no unit here; `parameter_unit` tells its SI value.
    for redundant in (
        "parameter_si",
        "bifurcation_parameter_si",
        "event_parameter_si",
    ):
        variables.pop(redundant, None)
    coords: dict[str, Any] = {name: (dims, values), "state": words(entries)}
    coords["part"] = words(("re", "im"))
    symbols = {key: symbol for key, symbol, _ in case._core.parameters}
    ds = StudyDataset(variables, coords)
    loci = report.get("loci")
    if loci:
        curves = loci["curves"]
        lengths = [len(curve["first"]) for curve in curves]
        ds = ds.assign(
            locus=("locus_point", np.repeat(np.arange(len(curves)), lengths))
        )
        for key, made in (("kind", str), ("event", str), ("period", int)):
            labels = [made(curve.get(key, "")) for curve in curves]
            ds[f"locus_{key}"] = ("locus_point", np.repeat(labels, lengths))
        for key, of in (("first", name), ("second", loci["second"])):
            along = _joined(curve[key] for curve in curves)
            ds[f"locus_{key}"] = ("locus_point", along, {"units": si_unit(of) or "1"})
        ds.attrs["second"] = loci["second"]
        ds.attrs["second_symbol"] = symbols.get(loci["second"], loci["second"])
    ds.attrs.update(case_attributes(case, "branches of periodic orbits"))
    ds.attrs.update(
        parameter=name,
        parameter_symbol=symbols.get(name, name),
        **_shown(units, "branch", report, ("branches", "failures")),
    )
    title = _nanotap.label(name, symbols.get(name, name)).split(" $")[0]
    ds[name].attrs.update(long_name=title, units="1")
    unit = report.get("parameter_unit")
    if unit:
        ds.attrs["parameter_unit"] = json.dumps(unit)
        for of_parameter in (
            name,
            "bifurcation_parameter",
            "bifurcation_uncertainty",
            *(["attractor_parameter"] if attractors else []),
            *(["event_parameter"] if events else []),
        ):
            ds[of_parameter].attrs["units"] = unit["unit"] if "." in name else "1"
    if report.get("held"):
        ds.attrs["held"] = json.dumps(report["held"])
    return answered(case, describe(ds))


def _shown(
    units: Scales | None, study: str, report: Mapping[str, Any], names: Iterable[str]
) -> dict[str, str]:
    """Entries of a report as attributes: JSON, in SI if the other numbers are."""
    record = Record(report, units, (study, ""))
    return {name: json.dumps(plain(record[name])) for name in names if name in record}


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
            # Real and imaginary parts: files of most formats hold no complex numbers.
            parts = np.full((len(rows), longest, 2), np.nan)
            for k, pairs in enumerate(values):
                parts[k, : len(pairs)] = pairs
            dims = (dim, "multiplier", "part")
            columns[f"{prefix}multipliers"] = (dims, parts)
        elif {type(value) for value in values} in ({str}, {str, type(None)}):
            # Empty where there is no word.
            texts = [value or "" for value in values]
            columns[f"{prefix}{name}"] = (dim, np.array(texts, dtype=str))
        elif all(
            value is None or isinstance(value, bool | int | float) for value in values
        ):
            filled = [np.nan if value is None else value for value in values]
            columns[f"{prefix}{name}"] = (dim, np.array(filled))
    return columns


@stoppable()
def approach(
    case: Case, options: Mapping[str, Any], threads: int | None, progress: Progress
) -> "StudyDataset":
    """An approach curve over `way` and distance; the finished part if Ctrl-C stopped it."""
    document, answer, units, interrupted = _run(
        "approach", case, options, threads, progress
    )
    if interrupted and not document["table"]:
        raise part_of(None, finished=False)
    ds = _approach_dataset(case, document, units).answered_by(answer)
    return _finished(ds, interrupted)


def _approach_dataset(
    case: Case, report: dict[str, Any], units: Scales | None
) -> "StudyDataset":
    from ._study_dataset import StudyDataset

    name = report["parameter"]
    kept = ("hysteresis", "jumps", "modulation")
    shown = _shown(units, "approach", report, kept)
    ways = ["approach", "retract"]
    rows: dict[tuple[str, float], dict[str, Any]] = {}
    for entry in report["table"]:
        entry |= entry.pop("modulation", None) or {}
        physical = entry.pop("physical", None) or {}
        physical |= entry.pop("modulation_si", None) or {}
        entry |= {f"physical_{key}": value for key, value in physical.items()}
        rows[entry["way"], entry["gap"]] = entry
    gaps = sorted({gap for _, gap in rows})
    flat = [rows.get((way, gap), {}) for way in ways for gap in gaps]
    for entry in flat:
        # A missing text is empty.
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
        # Approach and retract have the same distances.
        zc = columns["zc"][1].reshape(len(ways), len(gaps))
        coords["zc"] = (name, np.where(np.isnan(zc[0]), zc[1], zc[0]))
    branches = report.get("branches") or {"points": []}
    entries = case.state_names
    further = _columns(branches["points"], "branch_point", "branch_", len(entries))
    ds = StudyDataset(variables, coords)
    if further:
        coords["state"] = words(entries)
        ds = ds.assign(further).assign_coords(
            state=words(entries), part=words(("re", "im"))
        )
    for entry in report["coexisting"]:
        physical = entry.pop("physical", None) or {}
        entry |= {f"physical_{key}": value for key, value in physical.items()}
        entry.pop("way")
    ds = ds.assign(_columns(report["coexisting"], "coexisting_point", "coexisting_", 0))
    for key in ("free_amplitude", "free_phase", "free_reach"):
        ds[key] = report[key]
    ds.attrs.update(case_attributes(case, "approach and retract"))
    ds.attrs.update(
        parameter=name,
        hysteresis=shown["hysteresis"],
        jumps=shown["jumps"],
        compared=int(report["compared"]),
        returned=int(report["returned"]),
    )
    if "modulation" in report:
        ds.attrs["modulation"] = shown["modulation"]
    unit = report.get("parameter_unit")
    if unit:
        ds.attrs["parameter_unit"] = json.dumps(unit)
        ds.zc.attrs.update(long_name="distance to the sample", units="m")
    # A dimensionless number; the distance in m is another entry.
    ds[name].attrs.update(long_name="distance to the sample over g0", units="1")
    if "branch_parameter" in ds:
        ds["branch_parameter"].attrs["units"] = "g0"
    readings, in_si = (declared("fm", of) for of in ("Modulated", "ModulatedInSi"))
    for reading in map(str, ds.variables):
        bare = reading.removeprefix("physical_")
        of = readings if bare == reading else in_si
        ds[reading].attrs.update(of.get(bare, {}))
    ds = describe(ds.drop_vars("branch_parameter_si", errors="ignore"))
    if case.is_physical and not case._core.model_units:
        ds = ds.swap_dims({name: "zc"})
    return answered(case, ds)


@stoppable()
def scan(
    case: Case,
    options: Mapping[str, Any],
    out: Path | None,
    chunk: str,
    threads: int | None,
    client: "Client | None",
    progress: Progress,
) -> "StudyDataset":
    """Height, error, phase … over direction, line and pixel; the finished part if Ctrl-C stopped it."""
    if out is None and chunk == "1/1" and client is None:
        document, answer, _, interrupted = _run(
            "scan", case, options, threads, progress
        )
        found = _scan_dataset(case, document).answered_by(answer)
        return _finished(found, interrupted, part=bool(found.sizes["y"]))
    plan = ("scan", case, _arguments.request("scan", options))
    ds = _datasets.computed(plan, "lines", out, chunk, threads, client, progress)
    if out is None or chunk != "1/1":
        return ds
    whole = _scan_dataset(case, json.loads(_nanotap.summary(ds.attrs["path"])))
    return whole.assign_attrs(path=ds.attrs["path"])


def _scan_dataset(case: Case, report: dict[str, Any]) -> "StudyDataset":
    from ._study_dataset import StudyDataset

    ways = [way for way in ("trace", "retrace") if report.get(way)]
    variables: dict[str, Any] = {}
    for name in report[ways[0]] if ways else ():
        rows = np.array(_of_ways(report, ways, name))
        if rows.dtype.kind == "O":
            rows = rows.astype(float)
        attrs = declared("scan", "Channels")[name]
        variables[name] = (("direction", "y", "x"), rows, attrs)
    length = report["size"][0]
    pixels = variables["height"][1].shape[-1] if variables else 0
    y = [line["y"] for line in report["lines"] if line["direction"] == ways[0]]
    along, across = (
        {"long_name": f"position {which} the line", "units": "m"}
        for which in ("along", "across")
    )
    coords: dict[str, Any] = {
        "direction": words(ways),
        "x": ("x", (np.arange(pixels) + 0.5) * length / max(pixels, 1), along),
        "y": ("y", np.array(y), across),
    }
    for name in report["periods"][0] if report["periods"] else ():
        listed = [
            np.nan if row[name] is None else row[name] for row in report["periods"]
        ]
        entry = ("k", np.array(listed), declared("scan", "ListedPeriod")[name])
        if name == "k":
            coords["k"] = entry
        else:
            variables[f"period_{name}"] = entry
    ds = StudyDataset(variables, coords)
    ds.attrs.update(case_attributes(case, "scan"))
    describe(ds)
    for name, value in report.items():
        if name not in {"trace", "retrace", "periods"} and value is not None:
            plain = isinstance(value, str | float) and not isinstance(value, bool)
            # The scipy engine has another attribute `mode`.
            key = "scan_mode" if name == "mode" else name
            ds.attrs[key] = value if plain else json.dumps(value)
    return ds


def _of_ways(report: Mapping[str, Any], ways: list[str], name: str) -> list[Any]:
    """A channel by direction, line and pixel, of the lines whose trace is finished; missing where a
    stopped scan has no retrace.
    """
    known = [row for way in ways for row in report[way][name]]
    missing = "" if any(isinstance(v, str) for row in known for v in row) else None
    empty = [missing] * max((len(row) for row in known), default=0)
    finished = [
        line["line"] for line in report["lines"] if line["direction"] == ways[0]
    ]

    def row(way: str, line: int) -> list[Any]:
        rows = report[way][name]
        values = rows[line] if line < len(rows) else empty
        return [missing if v is None else v for v in values]

    return [[row(way, line) for line in finished] for way in ways]


@stoppable()
def image_states(
    case: Case, options: Mapping[str, Any], threads: int | None, progress: Progress
) -> "StudyDataset":
    """State, probability and corrected height over line and pixel."""
    from ._images import image_data
    from ._study_dataset import StudyDataset

    if options["data"] is None:
        message = "data: an image is needed"
        raise TypeError(message)
    asked = {**options, "data": image_data(options["data"])}
    if options["convert"] is not None:
        asked["convert"] = _arguments.names("convert", options["convert"])
    report, answer, _, interrupted = _run(
        "image-states", case, asked, threads, progress
    )
    images = report.pop("images")
    names = [*(state["name"] for state in report["states"]), "undecided"]
    variables: dict[str, Any] = {}
    for name, rows in images.items():
        if rows is None:
            continue
        attrs = declared("image-states", "StateImages")[name]
        values = np.array(rows, dtype=float)
        if name == "state":
            known = np.where(np.isnan(values), len(names) - 1, values).astype(int)
            values, attrs = np.array(names)[known], {"long_name": attrs["long_name"]}
        variables[name] = (("y", "x"), values, attrs)
    points, lines = report["shape"]
    width, height = report["size"] or (points, lines)
    unit = {"units": "m"} if report["size"] else {}
    coords: dict[str, Any] = {
        "x": ("x", (np.arange(points) + 0.5) * width / points, unit),
        # Lines begin at the top.
        "y": ("y", (np.arange(lines)[::-1] + 0.5) * height / lines, unit),
    }
    ds = StudyDataset(variables, coords)
    ds.attrs.update(case_attributes(case, "image-states"))
    describe(ds)
    for name, value in report.items():
        if value is not None:
            as_it_is = isinstance(value, str | float) and not isinstance(value, bool)
            ds.attrs[name] = value if as_it_is else json.dumps(value)
    return _finished(ds.answered_by(answer), interrupted)


@stoppable()
def lyapunov(case: Case, options: Mapping[str, Any]) -> Lyapunov:
    """The exponents, and the points of the section as a Dataset."""
    import xarray as xr

    core, rows = _nanotap.lyapunov(
        _cased(case)._core, _arguments.request("lyapunov", options)
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
    cut.gap_rate.attrs.update(long_name="rate of the gap", units="g0 sqrt(EI/(m L^4))")
    document = json.loads(core.document)
    return Lyapunov.of(
        document,
        scales(case, document.pop("case")),
        "lyapunov",
        section=answered(case, describe(cut)),
        _answer=Answer(core),
    )


@stoppable()
def convergence(case: Case, options: Mapping[str, Any]) -> Convergence:
    """The motion for each number of modes."""
    document, answer, units, interrupted = _run("convergence", case, options)
    found = Convergence.of(document, units, "convergence", _answer=answer)
    return _finished(found, interrupted)


@stoppable()
def document(
    name: str,
    case: Case,
    options: Mapping[str, Any],
    threads: int | None,
    progress: Progress,
) -> Report:
    """The report of a study: its document, with the names of the terminal's JSON, its tables and its
    figure."""
    report, answer, units, interrupted = _run(name, case, options, threads, progress)
    found = Report(report, answer, units, (name, ""))
    return _finished(found, interrupted)


@stoppable()
def fit(
    case: Any,
    options: Mapping[str, Any],
    curve: int | None,
    threads: int | None,
    progress: Progress,
) -> Fit:
    """The parameters that describe measured curves best; `case` may be a case, its file, or the data."""
    case, data = _case_and_data(case, options["data"])
    lists = {
        name: _arguments.names(name, options[name])
        for name in ("free", "per_curve", "columns", "convert", "start", "pixels")
        if options[name] is not None
    }
    number = _arguments.optional_count("curve", curve)
    asked = {**options, **lists, "data": _arguments.tables(data, number)}
    assumed: list[str] = []
    if case is None:
        case, assumed = _implied_case(asked)
    document, answer, units, interrupted = _run("fit", case, asked, threads, progress)
    if assumed:
        document["preparation"] = [*assumed, *document.get("preparation", ())]
    return _finished(Fit(document, answer, units, ("fit", "")), interrupted)


def _case_and_data(case: Any, data: Any) -> tuple[Case | None, Any]:
    """The case, None where the data imply it, and the data; `case` may be a case, its file, or the data."""
    if data is None and isinstance(case, Case):
        message = "data: expected measured curves"
        raise TypeError(message)
    if data is None:
        return None, case
    if isinstance(case, str | os.PathLike):
        return Case.from_file(case), data
    return case, data


def _implied_case(asked: Mapping[str, Any]) -> tuple[Case, list[str]]:
    """The case that options and data of a fit imply, and sentences on what is assumed."""
    words, assumed = _nanotap.implied_case(_arguments.request("fit", asked))
    return Case(**dict(word.split("=", 1) for word in words)), assumed


@stoppable()
def fit_map(
    case: Any,
    data: Any = None,
    pixels: str | Iterable[str] | None = None,
    free: str | Iterable[str] | None = None,
    *,
    out: Path | None = None,
    chunk: str = "1/1",
    threads: int | None = None,
    client: "Client | None" = None,
    progress: Progress = None,
    **options: Any,
) -> "StudyDataset":
    """Fits a force volume: one curve a pixel, each from the result of its neighbour.

    Args:
        case: Lever and sample; or the map itself, if its header has the stiffness of the lever and
            `tip_radius` or `half_angle` is given.
        data: The path of a map as an instrument wrote it, such as a .jpk-qi-data; or a table of all curves,
            as `fit` takes it, whose rows name their pixel.
        pixels: Of a table, one or two columns that name the pixel, such as `["x", "y"]`; the last
            changes slowest.
        free: Parameters to find, as in `fit`.
        out: The dataset, a folder with the extension .zarr; an existing one is resumed. Without it,
            everything is in memory.
        chunk: Only one of n shares, as in "2/8"; `merge` merges the shares.
        threads: Number of threads; default: one per core.
        client: A Dask client on whose workers the chunks are computed, with the same bytes.
        progress: Whether to show a bar, or a function that is called with the finished and the
            total count of rows of pixels.
        **options: Further options of `fit`, such as `convert`, `bounds` or `segment`.

    Returns:
        Over the pixels each parameter (`ds["sample.modulus"]`) with its standard error
        (`"sample.modulus_error"`), of force curves `contact_point`, `adhesion_force` and
        `residual_force`, `chi2_reduced`, and `result`: fits, misfit (the residuals are not noise), failed,
        or empty without data.

    Raises:
        ValueError: an option, the table or the file is not valid.
        Interrupted: Ctrl-C; its `result` is the dataset up to the last finished pixels, or with `out`
            the whole dataset with the rest missing.

    Example:
        >>> import numpy as np
        >>> lever = nanotap.Case(
        ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
        ...     sample={"stiffness": "5 N/m"},
        ...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
        ...     gap={"tip": "8 nm"},
        ... )
        >>> zc = np.array([7e-9, 8e-9, 9e-9])
        >>> amplitude = nanotap.orbit(lever, **{"gap.tip": zc}).first_harmonic.values
        >>> volume = {
        ...     "x": np.repeat([0, 1], 3),
        ...     "zc (m)": np.tile(zc, 2),
        ...     "A (m)": np.tile(amplitude, 2),
        ... }
        >>> ds = nanotap.fit_map(lever, volume, ["x"], "sample.stiffness", progress=False)
        >>> ds["sample.stiffness"].values.round(3)
        array([5., 5.])
    """
    case, data = _case_and_data(case, data)
    named = {**options, "pixels": pixels, "free": free}
    lists = {
        name: _arguments.names(name, named[name])
        for name in ("columns", "convert", "start", "pixels", "free")
        if named.get(name) is not None
    }
    is_file = pixels is None and isinstance(data, str | os.PathLike)
    if pixels is None and not is_file:
        message = "pixels: name the columns of the table that tell the pixel"
        raise TypeError(message)
    asked = {**options, **lists, "data": _arguments.tables(data)}
    if case is None:
        case, _ = _implied_case(asked)
    if is_file:
        # The curves are read when they are fitted.
        del asked["data"]
    request = _arguments.request("fit", asked)
    if is_file:
        request = json.dumps({**json.loads(request), "file": os.fspath(existing(data))})
    plan = ("fit", _cased(case), request)
    ds = _datasets.computed(plan, "rows", out, chunk, threads, client, progress)
    return ds.assign(result=_datasets.in_words(ds.result))


@stoppable()
def calibrate(
    data: Any,
    *,
    spectrum: str | int | None = None,
    column: str | None = None,
    unit: str | None = None,
    rate: float | str | None = None,
    two_sided: bool = False,
    averages: float | None = None,
    average: Literal["auto", "powers", "amplitudes"] = "auto",
    window: Literal["auto", "none", "hann", "blackman"] = "auto",
    segment: int | None = None,
    from_: float | str | None = None,
    to: float | str | None = None,
    exclude: Sequence[str] | None = None,
    frequency: float | str | None = None,
    temperature: float | None = None,
    temperature_error: float = 0.0,
    sensitivity: float | str | None = None,
    sensitivity_error: float | str | None = None,
    factor: float | None = None,
    factor_error: float | str | None = None,
    spot: float = 1.0,
    tilt: float | str | None = None,
    length: float | str | None = None,
    width: float | str | None = None,
    dimension_error: float | str | None = None,
    fluid: Literal["auto", "air", "water"] = "auto",
    density: float | str | None = None,
    viscosity: float | str | None = None,
    reference: str | None = None,
) -> Report:
    """Calibrates a lever from its thermal noise: spring constant, quality factor, resonance frequency,
    sensitivity.

    Quantities are texts with their unit or numbers in SI.

    Args:
        data: A spectrum or a record of the deflection: the path of an instrument's file or of a table, or
            a table: a mapping or data frame with columns such as "frequency (kHz)" and
            "PSD (pm^2/Hz)", or "time (s)" and "deflection (V)".
        spectrum: Spectrum of the file, by its name or counted from 0; default: `average`, else the
            first.
        column: Column of a table with the density or the deflection; default: the first with such a
            unit.
        unit: Unit of the density, as in "pm^2/Hz" or "V/sqrt(Hz)", or of the deflection, where the
            file states none.
        rate: Sampling rate of a record without times, as in "1 MHz".
        two_sided: The density is two-sided: half as high as a one-sided one.
        averages: Number of averaged periodograms; default: as the file states, else from the scatter.
        average: What was averaged; `amplitudes`: the density is low by π/4; `auto`: as the instrument
            does.
        window: Window of the periodograms; `auto`: Hann for a record; for a spectrum the correlation of
            its bins is estimated.
        segment: Samples of a segment of a record, a power of two; default: an eighth of the record.
        from_: Lower end of the fit, as in "8 kHz"; default: 0.3 f0, nearer for a narrow peak.
        to: Upper end of the fit; default: 2.2 f0, nearer for a narrow peak.
        exclude: Ranges that the fit leaves out, as in ["49 kHz:51 kHz"].
        frequency: Approximate resonance frequency; default: the highest peak in power per octave.
        temperature: Temperature of the lever, °C; default: as the file states, else 25.
        temperature_error: Standard error of the temperature, K.
        sensitivity: Sensitivity (InvOLS) of a spectrum in V, as in "40 nm/V"; default: as the file
            states.
        sensitivity_error: Relative standard error of the sensitivity, as in "3 %".
        factor: Factor k m/(kB T) that replaces 0.817, the one of a bare rectangular lever with a small
            light spot at its end.
        factor_error: Relative standard error of the factor, as in "5 %".
        spot: Position of the light spot from the clamp, as a fraction of the length.
        tilt: Angle between lever and sample, as in "11 deg": k along the sample's normal is reported
            too.
        length: Length of the rectangular lever for Sader's method, as in "225 um".
        width: Width of the rectangular lever for Sader's method.
        dimension_error: Relative standard error of length and width, as in "2 %".
        fluid: Fluid around the lever for Sader's method; `auto`: as the file states, else air.
        density: Density of another fluid, as in "785 kg/m^3".
        viscosity: Viscosity of another fluid, as in "2 mPa s".
        reference: Calibrated lever of the same shape for Sader's method, k,f0,Q as in
            "2.8 N/m,75 kHz,180".

    Returns:
        The document. `stiffness`, `quality`, `frequency`, `sader.stiffness` and `sensitivity` have
        `value`, `relative_error` and the 95 % `interval`, in SI; `cantilever` is a block for a case
        file; `warnings` lists what puts the numbers in doubt. `.to_dataframe()` is the spectrum with
        the fit, `.plot()` its figure.

    Raises:
        ValueError: an option or the data are not valid, or there is no resonance.

    Example:
        >>> import numpy as np, nanotap
        >>> f, (f0, Q) = np.arange(20e3, 150e3, 100), (75e3, 50)
        >>> psd = 1e-27 + 1e-25 / ((1 - (f / f0) ** 2) ** 2 + (f / f0 / Q) ** 2)
        >>> found = nanotap.calibrate({"f (Hz)": f, "PSD (m^2/Hz)": psd}, averages=100)
        >>> print(f"{found.quality.value:.2f}, {found.frequency.value:.0f} Hz")
        50.00, 75000 Hz
    """
    options = {name: value for name, value in locals().items() if name != "data"}
    if isinstance(spectrum, int):
        options["spectrum"] = str(spectrum)
    if isinstance(exclude, str):
        options["exclude"] = [exclude]
    request = {
        name.rstrip("_"): written(value)
        for name, value in options.items()
        if value is not None
    }
    if isinstance(data, str | os.PathLike):
        path, table = existing(data), None
    else:
        found = _arguments.tables(data)
        if len(found) != 1:
            message = f"data: expected one table, got {len(found)}"
            raise ValueError(message)
        path, table = None, json.dumps(found[0])
    core = _nanotap.calibrate(path, table, json.dumps(request))
    document = json.loads(core.document)
    return Report(document, Answer(core), None, ("calibrate", ""))


@stoppable()
def reconstruct(
    case: Case, options: Mapping[str, Any], threads: int | None, progress: Progress
) -> Reconstruction:
    """Force and dissipation against distance from measured curves."""
    if options["data"] is None:
        message = "data: measured curves are needed"
        raise TypeError(message)
    lists = {
        name: _arguments.names(name, options[name])
        for name in ("columns", "convert")
        if options[name] is not None
    }
    asked = {**options, **lists, "data": _arguments.tables(options["data"])}
    document, answer, units, interrupted = _run(
        "reconstruct", case, asked, threads, progress
    )
    found = Reconstruction(document, answer, units, ("reconstruct", ""))
    return _finished(found, interrupted)


def paper(
    *,
    out: Path = "nanotap-paper",
    only: str | Iterable[str] = (),
    quick: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> Paper:
    """Recomputes every figure and number of the paper, with verdicts and evidence.

    Args:
        out: Folder for the report and its pictures; created if necessary.
        only: Only these sections, such as "fig4".
        quick: Fewer initial states and values: seconds instead of minutes, wider bounds.
        threads: Number of threads; default: one per core.
        progress: Whether to show a bar, or a function that receives the progress.

    Raises:
        ValueError: a section does not exist.
        Interrupted: Ctrl-C; its `result` is the report of the finished sections.

    Example:
        >>> report = nanotap.paper(only="eq25", quick=True, progress=False)
        >>> [check.verdict for check in report.checks]
        ['reproduced', 'ambiguous', 'reproduced']
    """
    sections = [only] if isinstance(only, str) else [str(name) for name in only]
    with bar(progress, "%") as hears, stoppable():
        text, interrupted = _nanotap.paper(
            out=out,
            only=sections,
            quick=_arguments.flag("quick", quick),
            threads=_arguments.optional_count("threads", threads),
            progress=hears,
        )
    report = Paper.of(json.loads(text))
    if interrupted:
        message = f"stopped; the report in {report.out} contains the finished sections"
        raise Interrupted(message, report)
    return report
