"""Single motions: `modes`, `simulate`, `orbit`, and both over arrays of parameters."""

import json
from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from . import _arguments, _nanotap
from ._arguments import Floats, Progress
from ._case import Case
from ._describe import case_attributes, describe
from ._interrupt import Interrupted
from ._progress import bar
from ._results import Modes, Orbit

if TYPE_CHECKING:
    import xarray as xr

# Periods of a time series that nobody asked for in full.
_SHOWN_PERIODS = 100
# Rows that a time series may have: 800 MB at N = 3.
_MOST_ROWS = 8_000_000


def modes(case: Case, *, points: int = 201) -> Modes:
    """Mode shapes and frequencies, in free flight and in contact.

    Frequencies are those of the Galerkin model (`free`, `contact`) and of the beam itself
    (`exact_free`, `exact_contact`); `shapes` holds the mode shapes at `points` places.

    Raises:
        ValueError: the case is an oscillator.
    """
    import xarray as xr

    many = _arguments.count("points", points, 2)
    if many > _MOST_ROWS:
        message = f"points: {many} are too many; {_MOST_ROWS} at most"
        raise ValueError(message)
    document, xi, shapes = _nanotap.modes(_cased(case)._core, many)
    table = xr.DataArray(
        shapes,
        dims=("xi", "mode"),
        coords={"xi": xi, "mode": np.arange(1, shapes.shape[1] + 1)},
        name="phi",
        attrs={"long_name": "mode shape of the bare beam", "units": "1"},
    )
    table.xi.attrs.update(long_name="place along the beam, clamp 0 to tip 1", units="L")
    return Modes.of(json.loads(document), shapes=table)


def simulate(
    case: Case,
    *,
    periods: int = 50,
    transient: int | None = None,
    state: Any = None,
    strobe: int = 1,
    max_period: int = 64,
    series: int | None = None,
    resolution: int = 200,
    method: Literal["exact", "rk4"] = "exact",
    steps: int | Sequence[int] = 200,
    switching: Literal["step", "stage"] = "step",
    threads: int | None = None,
    progress: Progress = None,
    **parameters: Any,
) -> "xr.Dataset":
    """One run from a state; with arrays as `parameters`, one for each of their values.

    Args:
        case: What is run.
        periods: Drive periods recorded.
        transient: Drive periods thrown away first; without it, as many as the motion is
            measured to need; 0: from the start.
        state: State at the start, drive phase 0: a1 … aN, v1 … vN (oscillator: x, v);
            without it, rest.
        strobe: How many of the last states at drive phase 0 to keep.
        max_period: Longest period looked for.
        series: Periods of the time series, from the start of the recording; without it,
            all up to 100.
        resolution: Samples a drive period in the time series.
        method: `exact`, or `rk4`: the paper's fixed-step method, to compare.
        steps: Of rk4: steps a drive period, or those in free flight and in contact.
        switching: Of rk4: whether the regime is looked at once a step or at every stage.
        threads: Of arrays: threads; without it, one a core.
        progress: Of arrays: whether to show a bar, or what hears of progress.
        **parameters: Keys of the case to change. Arrays (one-dimensional, or xarray's
            DataArrays) make a Dataset over them, each a dimension.

    Returns:
        What was observed, by the names of the terminal's JSON: `classification`, `period`,
        `tip_max` …; `strobe` over `strobe_period` and `state`; `events` (their times) with
        `event_kind`; and the time series `tip`, `gap`, `force` … over `tau`. Over arrays,
        what is a number in each run, and `failure` where there is none.

    Raises:
        ValueError: something that was asked for is not right.
        RuntimeError: the run did not work out.
    """
    fixed, varied = _split(parameters)
    case = _cased(case).with_(**fixed)
    count = _arguments.count
    options: dict[str, Any] = {
        "periods": count("periods", periods),
        "transient": _arguments.optional_count("transient", transient),
        "state": _arguments.state(state),
        "strobe": min(count("strobe", strobe), count("periods", periods)),
        "max_period": count("max_period", max_period, 1),
    }
    if method == "rk4":
        if varied:
            message = "rk4 runs one case at a time; leave the arrays away"
            raise ValueError(message)
        return _fixed_step(case, options, steps, switching)
    if method != "exact":
        message = f"method: `{method}` is none; there are exact and rk4"
        raise ValueError(message)
    if varied:
        return _over(
            case,
            varied,
            False,
            {**options, "period": None, "harmonics": 1},
            threads,
            progress,
        )
    shown = (
        min(options["periods"], _SHOWN_PERIODS)
        if series is None
        else count("series", series)
    )
    _refuse_rows(shown, count("resolution", resolution, 1))
    document, (names, values) = _nanotap.simulate(
        case._core, **options, series_periods=shown, resolution=resolution
    )
    return _run_dataset(case, json.loads(document), names, values)


@overload
def orbit(
    case: Case,
    *,
    period: int | None = None,
    state: Any = None,
    harmonics: int = 20,
    resolution: int = 200,
) -> Orbit: ...
@overload
def orbit(
    case: Case,
    *,
    period: int | None = None,
    state: Any = None,
    harmonics: int = 20,
    resolution: int = 200,
    threads: int | None = None,
    progress: Progress = None,
    **parameters: Any,
) -> "Orbit | xr.Dataset": ...
def orbit(
    case: Case,
    *,
    period: int | None = None,
    state: Any = None,
    harmonics: int = 20,
    resolution: int = 200,
    threads: int | None = None,
    progress: Progress = None,
    **parameters: Any,
) -> "Orbit | xr.Dataset":
    """A periodic orbit by Newton, stable or not; with arrays, one for each of their values.

    Args:
        case: Whose orbit.
        period: Its period in drive periods; without it, that of the motion where a run
            settles.
        state: State to look near, at drive phase 0.
        harmonics: Harmonics of the drive's frequency to tell.
        resolution: Samples a drive period in its time series, `orbit.series`.
        threads: Of arrays: threads; without it, one a core.
        progress: Of arrays: whether to show a bar, or what hears of progress.
        **parameters: Keys of the case to change; see `simulate`.

    Returns:
        The orbit, or over arrays a Dataset of what is observed of each, with `failure`
        where there is none.

    Raises:
        ValueError: something that was asked for is not right.
        RuntimeError: no orbit was found.
    """
    fixed, varied = _split(parameters)
    case = _cased(case).with_(**fixed)
    shared: dict[str, Any] = {
        "period": _arguments.optional_count("period", period),
        "state": _arguments.state(state),
        "harmonics": _arguments.count("harmonics", harmonics),
    }
    if varied:
        options = {"periods": 1, "transient": None, "strobe": 0, "max_period": 64}
        return _over(case, varied, True, {**shared, **options}, threads, progress)
    _refuse_rows(1, _arguments.count("resolution", resolution, 1))
    document, (names, values) = _nanotap.orbit(
        case._core, **shared, resolution=resolution
    )
    series = _series(names, values)
    series.attrs.update(case_attributes(case, "a periodic orbit"))
    return Orbit.of(json.loads(document), series=series)


def words(names: Sequence[str]) -> "np.typing.NDArray[np.str_]":
    """Labels as numpy holds them: in a plain list, "a1" would be taken for a type."""
    return np.array(names, dtype=str)


def _cased(case: Any) -> Case:
    if not isinstance(case, Case):
        message = f"case: a nanotap.Case is needed, not {type(case).__name__}"
        raise TypeError(message)
    return case


def _refuse_rows(periods: int, resolution: int) -> None:
    if periods * resolution > _MOST_ROWS:
        message = (
            f"resolution: {resolution} samples in each of {periods} periods are too many; "
            f"{_MOST_ROWS} in all at most"
        )
        raise ValueError(message)


def _split(parameters: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Keys with one value, and keys with many."""
    fixed: dict[str, Any] = {}
    varied: dict[str, Any] = {}
    for key, value in parameters.items():
        many = np.ndim(value) > 0 if not isinstance(value, str | Mapping) else False
        (varied if many else fixed)[key] = value
    return fixed, varied


def _series(names: list[str], values: Floats) -> "xr.Dataset":
    """A time series: its columns over `tau`, those of the state together."""
    import xarray as xr

    tau = values[:, 0]
    plain = [name for name in names[1:6] if name in names]
    entries = names[6:]
    variables: dict[str, Any] = {
        name: ("tau", values[:, names.index(name)])
        for name in plain
        if name != "contact"
    }
    if "contact" in names:
        variables["contact"] = ("tau", values[:, names.index("contact")] > 0)
    coords: dict[str, Any] = {"tau": tau}
    if entries:
        variables["states"] = (("tau", "state"), values[:, 6:])
        coords["state"] = words(entries)
    return describe(xr.Dataset(variables, coords))


def _run_dataset(
    case: Case, document: dict[str, Any], names: list[str], values: Floats
) -> "xr.Dataset":
    import xarray as xr

    entries = case.state_names
    strobe = np.array(document.pop("strobe"), dtype=float).reshape(-1, len(entries))
    events = document.pop("events")
    variables, attributes = _variables(document, entries)
    last = document["periods"]
    ds = _series(names, values)
    ds = ds.assign(variables).assign(
        strobe=(("strobe_period", "state"), strobe),
        events=("event", np.array([event["tau"] for event in events], dtype=float)),
        event_kind=("event", np.array([event["kind"] for event in events], dtype=str)),
    )
    if all("gap_rate" in event for event in events):
        rates = np.array([event["gap_rate"] for event in events], dtype=float)
        ds = ds.assign(event_gap_rate=("event", rates))
    ds = ds.assign_coords(
        strobe_period=np.arange(last - len(strobe) + 1, last + 1), state=words(entries)
    )
    ds.strobe_period.attrs.update(
        long_name="end of this recorded period", units="drive periods"
    )
    ds.attrs.update(case_attributes(case, "one run"), **attributes)
    assert isinstance(ds, xr.Dataset)
    return describe(ds)


def _variables(
    document: Mapping[str, Any], entries: list[str]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """The entries of a document as variables, and those that are words to be read."""
    variables: dict[str, Any] = {}
    attributes: dict[str, Any] = {}
    for name, value in document.items():
        if name == "evidence":
            attributes[name] = value
        elif name == "energy_balance":
            names = list(value)
            index = ("energy", words(names))
            variables[name] = (
                "energy",
                np.array([value[key] for key in names], dtype=float),
            )
            variables["energy"] = index
        elif isinstance(value, Mapping):
            inner, _ = _variables(value, entries)
            # What has a shape of its own belongs to single results.
            flat = {key: entry for key, entry in inner.items() if entry[0] == ()}
            variables |= {f"{name}_{key}": entry for key, entry in flat.items()}
        elif isinstance(value, list):
            variable = _vector(name, value, entries)
            if variable is not None:
                # `state` is the dimension along which states lie.
                variables["orbit_state" if name == "state" else name] = variable
        elif isinstance(value, bool | str):
            variables[name] = ((), value)
        else:
            variables[name] = ((), np.nan if value is None else value)
    return variables, attributes


def _vector(name: str, value: list[Any], entries: list[str]) -> Any:
    if not all(isinstance(entry, int | float) for entry in value):
        return None
    if name.endswith("_range"):
        return ("bound", np.array(value, dtype=float))
    if len(value) == len(entries):
        dimension = "exponent" if name.startswith("lyapunov") else "state"
        return (dimension, np.array(value, dtype=float))
    return None


def _fixed_step(
    case: Case, options: dict[str, Any], steps: int | Sequence[int], switching: str
) -> "xr.Dataset":
    import xarray as xr

    given = [steps] if isinstance(steps, int | np.integer) else list(steps)
    if len(given) not in (1, 2):
        message = (
            f"steps: {len(given)} numbers; one, or those in free flight and in contact"
        )
        raise ValueError(message)
    if switching not in {"step", "stage"}:
        message = f"switching: `{switching}` is none; there are step and stage"
        raise ValueError(message)
    each = [_arguments.count("steps", one, 1) for one in given]
    if max(each) > 10_000_000:
        message = f"steps: {max(each)} a drive period are too many; 10000000 at most"
        raise ValueError(message)
    document, (names, values) = _nanotap.fixed_step(
        case._core,
        **options,
        steps=[each[0], each[-1]],
        every_stage=switching == "stage",
    )
    parsed = json.loads(document)
    entries = case.state_names
    exact = parsed.pop("exact")
    strobe = np.array(parsed.pop("strobe"), dtype=float).reshape(-1, len(entries))
    events = parsed.pop("events")
    parsed.pop("steps")
    variables, attributes = _variables(parsed, entries)
    last = parsed["periods"]
    ds = xr.Dataset(
        {name: ("tau", values[:, k]) for k, name in enumerate(names) if k},
        {"tau": values[:, 0], "state": words(entries)},
    )
    ds = ds.assign(variables).assign(
        strobe=(("strobe_period", "state"), strobe),
        events=("event", np.array([event["tau"] for event in events], dtype=float)),
        event_kind=("event", np.array([event["kind"] for event in events], dtype=str)),
    )
    ds = ds.assign_coords(strobe_period=np.arange(last - len(strobe) + 1, last + 1))
    ds.attrs.update(case_attributes(case, "one run with time steps"), **attributes)
    ds.attrs.update(
        steps=each if len(each) == 2 else each * 2,
        exact_classification=exact["classification"],
        exact_period=exact["period"] or 0,
        exact_evidence=exact["evidence"],
    )
    return describe(ds)


def _over(
    case: Case,
    varied: Mapping[str, Any],
    orbits: bool,
    options: dict[str, Any],
    threads: int | None,
    progress: Progress,
) -> "xr.Dataset":
    """A Dataset over the product of arrays, or over the dimensions of DataArrays."""
    import xarray as xr

    arrays = {key: _as_array(key, value) for key, value in varied.items()}
    broadcast = dict(zip(arrays, xr.broadcast(*arrays.values()), strict=True))
    first = next(iter(broadcast.values()))
    shape, dims = first.shape, first.dims
    cases = [
        case.with_(**{key: array.values[index] for key, array in broadcast.items()})
        for index in product(*map(range, shape))
    ]
    many = 0 if threads is None else _arguments.count("threads", threads, 1)
    with bar(progress, "orbits" if orbits else "runs") as hears:
        found, interrupted = _nanotap.observe(
            [one._core for one in cases],
            orbits=orbits,
            threads=many,
            progress=hears,
            **options,
        )
    coords: dict[str, Any] = {}
    for key, array in arrays.items():
        coords.update(
            {str(name): coord for name, coord in array.coords.items() if name in dims}
        )
        if key not in dims:
            coords[key] = array
    documents = [None if text is None else json.loads(text) for text, _ in found]
    entries = case.state_names
    ds = _stacked(documents, entries, shape, tuple(map(str, dims))).assign_coords(
        coords
    )
    failures = np.array([reason for _, reason in found], dtype=object).reshape(shape)
    ds = ds.assign(failure=(dims, failures.astype(str)))
    ds.failure.attrs.update(
        long_name="why there is none, empty where there is one", units="1"
    )
    # What the case says of a parameter that varies does not matter.
    ds.attrs.update(case_attributes(case, "orbits" if orbits else "runs"))
    ds.attrs["over"] = json.dumps(list(varied))
    ds = describe(ds)
    if interrupted:
        done = sum(document is not None for document in documents)
        message = f"stopped; {done} of {len(documents)} are done"
        raise Interrupted(message, ds)
    return ds


def _as_array(key: str, value: Any) -> "xr.DataArray":
    import xarray as xr

    if isinstance(value, xr.DataArray):
        return value
    array = np.asarray(value)
    if array.ndim != 1 or array.size == 0:
        message = (
            f"{key}: a row of values is needed, not an array of shape {array.shape}; for more "
            "dimensions give an xarray.DataArray, which names them"
        )
        raise ValueError(message)
    if array.dtype.kind not in "iuf":
        message = f"{key}: real numbers are needed, not {array.dtype}"
        raise TypeError(message)
    return xr.DataArray(array, dims=key, coords={key: array}, name=key)


def _stacked(
    documents: list[dict[str, Any] | None],
    entries: list[str],
    shape: tuple[int, ...],
    dims: tuple[str, ...],
) -> "xr.Dataset":
    """What is a number, a word or a vector of one length in every document."""
    import xarray as xr

    rows: list[dict[str, Any]] = []
    for document in documents:
        if document is None:
            rows.append({})
            continue
        multipliers = document.pop("multipliers", None)
        if multipliers:
            document["spectral_radius"] = max(
                abs(complex(*pair)) for pair in multipliers
            )
        strobe = document.pop("strobe", None)
        row = _variables(document, entries)[0]
        if strobe:
            row["strobe"] = (("strobe_period", "state"), np.array(strobe, dtype=float))
        rows.append(row)
    names = list(dict.fromkeys(name for row in rows for name in row))
    variables: dict[str, Any] = {}
    coords: dict[str, Any] = {}
    for name in names:
        inner_dims, model = next(row[name] for row in rows if name in row)
        if name == "energy":
            coords[name] = model
            continue
        inner = (inner_dims,) if isinstance(inner_dims, str) else tuple(inner_dims)
        size = np.shape(model)
        word = isinstance(model, str)
        missing: Any = "" if word else np.full(size, np.nan)
        column = [row[name][1] if name in row else missing for row in rows]
        if any(np.shape(value) != size for value in column):
            continue
        array = np.array(column, dtype=str if word else None).reshape(shape + size)
        variables[name] = (dims + inner, array)
    if "strobe" in variables:
        periods = next(document["periods"] for document in documents if document)
        kept = variables["strobe"][1].shape[-2]
        coords["strobe_period"] = np.arange(periods - kept + 1, periods + 1)
    if any("state" in variable[0] for variable in variables.values()):
        coords["state"] = words(entries)
    return xr.Dataset(variables, coords)
