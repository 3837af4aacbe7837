"""Single motions: `modes`, `simulate`, `orbit`, and both over arrays of parameters."""

import json
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arguments, _nanotap
from ._arguments import Floats, Progress
from ._case import Case, key_words
from ._describe import case_attributes, dataset
from ._interrupt import Interrupted, stoppable
from ._progress import bar
from ._quantity import Range, in_si, many, si_unit
from ._report import Answer
from ._results import Modes, Orbit
from ._si import answered, scales

if TYPE_CHECKING:
    import xarray as xr

    from ._study_dataset import StudyDataset

# Largest number of periods of a time series by default.
_SHOWN_PERIODS = 100
# Largest number of rows of a time series: 800 MB at N = 3.
_MAX_ROWS = 8_000_000


@stoppable()
def modes(case: Case, options: Mapping[str, Any]) -> Modes:
    """Frequencies, and the mode shapes as a DataArray."""
    import xarray as xr

    request = _arguments.request("modes", options)
    core, xi, shapes = _nanotap.modes(_cased(case)._core, request)
    table = xr.DataArray(
        shapes,
        dims=("xi", "mode"),
        coords={"xi": xi, "mode": np.arange(1, shapes.shape[1] + 1)},
        name="phi",
        attrs={"long_name": "mode shape of the bare beam", "units": "1"},
    )
    table.xi.attrs.update(
        long_name="position along the beam, clamp 0 to tip 1", units="L"
    )
    document = json.loads(core.document)
    units, answer = scales(case, document.pop("case")), Answer(core)
    return Modes.of(document, units, "modes", shapes=table, _answer=answer)


@stoppable()
def simulate(
    case: Case,
    options: Mapping[str, Any],
    series: int | None,
    threads: int | None,
    progress: Progress,
    parameters: Mapping[str, Any],
) -> "StudyDataset":
    """One run, or one for each value of the arrays in `parameters`."""
    case, varied = _split(case, options, parameters)
    _arguments.optional_count("threads", threads)
    states = _states(options)
    if varied or states is not None:
        if options["method"] == "rk4":
            message = "rk4 runs one case at a time; omit the arrays"
            raise ValueError(message)
        return _over(case, varied, "simulate", options, states, threads, progress)
    request = _arguments.request("simulate", options)
    periods = _arguments.count("periods", options["periods"])
    shown = (
        min(periods, _SHOWN_PERIODS)
        if series is None
        else _arguments.count("series", series)
    )
    _refuse_rows(shown, _arguments.count("resolution", options["resolution"]))
    document, columns, core, curve = _nanotap.simulate(case._core, request, shown)
    made = _fixed_step if options["method"] == "rk4" else _run_dataset
    return made(case, document, columns, *curve).answered_by(Answer(core))


@stoppable()
def orbit(
    case: Case,
    options: Mapping[str, Any],
    threads: int | None,
    progress: Progress,
    parameters: Mapping[str, Any],
) -> "Orbit | StudyDataset":
    """A periodic orbit, or one for each value of the arrays in `parameters`."""
    case, varied = _split(case, options, parameters)
    _arguments.optional_count("threads", threads)
    states = _states(options)
    if varied or states is not None:
        return _over(case, varied, "orbit", options, states, threads, progress)
    request = _arguments.request("orbit", options)
    resolution = _arguments.count("resolution", options["resolution"])
    _refuse_rows(1, resolution)
    document, core = _nanotap.orbit(case._core, request)
    state, period = document["state"], document["period"]

    def series() -> "xr.Dataset":
        table = _nanotap.series(case._core, state, period, resolution)
        variables, coords = _columns(*table)
        attributes = case_attributes(case, "a periodic orbit")
        return answered(case, dataset(variables, coords, attributes))

    answer = Answer(core)
    return Orbit.of(document, scales(case), "orbit", made_series=series, _answer=answer)


def words(names: Sequence[str]) -> "np.typing.NDArray[np.str_]":
    """Labels as a numpy array: in a list, "a1" would be taken for a type."""
    return np.array(names, dtype=str)


def _cased(case: Any) -> Case:
    if not isinstance(case, Case):
        message = f"case: expected a nanotap.Case, got {type(case).__name__}"
        raise TypeError(message)
    return case


def _refuse_rows(periods: int, resolution: int) -> None:
    if periods * resolution > _MAX_ROWS:
        message = (
            f"resolution: {resolution} samples in each of {periods} periods are too many; "
            f"the limit is {_MAX_ROWS} in total"
        )
        raise ValueError(message)


def _split(
    case: Case, options: Mapping[str, Any], parameters: Mapping[str, Any]
) -> tuple[Case, dict[str, Any]]:
    """The case with the keys that have one value, and the keys that have many."""
    fixed: dict[str, Any] = {}
    varied: dict[str, Any] = {}
    for key, value in parameters.items():
        near = get_close_matches(key, options, 1, 0.8)
        if near:
            message = f"{key}: unknown argument or key; did you mean {near[0]}?"
            raise TypeError(message)
        one = isinstance(value, str | Mapping) or np.ndim(in_si(key, value)) == 0
        (varied if isinstance(value, Range) or not one else fixed)[key] = value
    return _cased(case)._varied(fixed), varied


def _columns(names: list[str], values: Floats) -> tuple[dict[str, Any], dict[str, Any]]:
    """Variables and coordinates of a time series."""
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
    return variables, coords


def _recorded(
    document: dict[str, Any], entries: list[str]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Variables and coordinates of strobe points and events, removed from the document."""
    strobe = np.array(document.pop("strobe"), dtype=float).reshape(-1, len(entries))
    events = document.pop("events")
    variables = {
        "strobe": (("strobe_period", "state"), strobe),
        "events": ("event", np.array([e["tau"] for e in events], dtype=float)),
        "event_kind": ("event", np.array([e["kind"] for e in events], dtype=str)),
    }
    if all("gap_rate" in event for event in events):
        rates = np.array([event["gap_rate"] for event in events], dtype=float)
        variables["event_gap_rate"] = ("event", rates)
    last = document["periods"]
    attrs = {"long_name": "end of this recorded period", "units": "drive periods"}
    ends = np.arange(last - len(strobe) + 1, last + 1)
    return variables, {
        "strobe_period": ("strobe_period", ends, attrs),
        "state": words(entries),
    }


def _run_dataset(
    case: Case,
    document: dict[str, Any],
    columns: list[tuple[str, str, Any]],
    names: list[str],
    values: Floats,
) -> "StudyDataset":
    series, times = _columns(names, values)
    recorded, coords = _recorded(document, case.state_names)
    attributes = case_attributes(case, "one run")
    attributes["evidence"] = document["evidence"]
    attributes["notes"] = "\n".join(document.get("notes", ()))
    variables = _variables(columns)
    if "energy_balance" in variables:
        coords["energy"] = words(list(document["energy_balance"]))
    found = dataset(series | variables | recorded, times | coords, attributes)
    return answered(case, found)


def _variables(columns: list[tuple[str, str, Any]]) -> dict[str, Any]:
    """The only row of columns as variables; strobe points have coordinates of their own."""
    return {
        name: ((along,) if along else (), values[0])
        for name, along, values in columns
        if name not in {"strobe", "evidence"}
    }


def _fixed_step(
    case: Case,
    document: dict[str, Any],
    columns: list[tuple[str, str, Any]],
    names: list[str],
    values: Floats,
) -> "StudyDataset":
    exact = document["exact"]
    recorded, coords = _recorded(document, case.state_names)
    series = {name: ("tau", values[:, k]) for k, name in enumerate(names) if k}
    attributes = {
        **case_attributes(case, "one run with time steps"),
        "notes": "\n".join(document.get("notes", ())),
        "steps": document["steps"],
        "exact_classification": exact["classification"],
        "exact_period": exact["period"] or 0,
        "exact_evidence": exact["evidence"],
    }
    variables = {
        name: value
        for name, value in _variables(columns).items()
        if not name.startswith(("exact_", "steps"))
    }
    times = {"tau": values[:, 0]}
    found = dataset(series | variables | recorded, coords | times, attributes)
    return answered(case, found)


def _states(options: Mapping[str, Any]) -> Floats | None:
    """Several initial states, one per row; `None` if there is one or none."""
    given = options["state"]
    if given is None or isinstance(given, str | Mapping) or hasattr(given, "state"):
        return None
    if isinstance(given, list | tuple) and any(isinstance(one, str) for one in given):
        return None
    states = _arguments.real(given, "state")
    if states.ndim < 2:
        return None
    if states.ndim != 2 or states.size == 0:
        message = f"state: expected one state, or one per row, got an array of shape {states.shape}"
        raise ValueError(message)
    return states


@stoppable()
def _over(
    case: Case,
    varied: Mapping[str, Any],
    study: str,
    options: Mapping[str, Any],
    states: Floats | None,
    threads: int | None,
    progress: Progress,
) -> "StudyDataset":
    """A Dataset over the product of arrays, or over the dimensions of DataArrays; with several
    initial states also over `start`."""
    import xarray as xr

    arrays = {key: _as_array(key, value) for key, value in varied.items()}
    if states is not None:
        if "start" in arrays:
            message = (
                "start: this name is reserved for the dimension of the initial states"
            )
            raise ValueError(message)
        starts = np.arange(len(states))
        arrays["start"] = xr.DataArray(starts, dims="start", coords={"start": starts})
        requests = [
            _arguments.request(study, {**options, "state": state}) for state in states
        ]
    else:
        requests = [_arguments.request(study, options)]
    broadcast = dict(zip(arrays, xr.broadcast(*arrays.values()), strict=True))
    first = next(iter(broadcast.values()))
    shape, dims = first.shape, tuple(map(str, first.dims))
    order = broadcast.pop("start").values.ravel() if states is not None else None
    rows = [array.values.ravel().tolist() for array in broadcast.values()]
    named = [dict(zip(broadcast, row, strict=True)) for row in zip(*rows, strict=True)]
    named = named or [{} for _ in range(first.size)]
    texts = [key_words(keys, case.kind) for keys in named]
    # An error in a key is reported for its first value.
    case._varied(named[0])
    asked = requests if order is None else [requests[k] for k in order]
    most = _arguments.optional_count("threads", threads)
    noun = "orbits" if study == "orbit" else "runs"
    with bar(progress, noun) as show:
        columns, failures, labels, interrupted = _nanotap.observe(
            case._core,
            list(texts[0]),
            [list(one.values()) for one in texts],
            study,
            asked,
            threads=most,
            progress=show,
        )
    names = dict(labels)
    entries = names["state"]
    variables: dict[str, Any] = {}
    for name, along, values in columns:
        if name == "strobe":
            values = values.reshape(len(failures), -1, len(entries))
        inner = ("strobe_period", "state") if name == "strobe" else (along,)
        array = np.array(values).reshape(shape + np.shape(values)[1:])
        variables[name] = (dims + inner * bool(along), array)
    failed = np.array(failures, dtype=str).reshape(shape)
    why = {"long_name": "reason of the failure, empty if there is none", "units": "1"}
    variables["failure"] = (dims, failed, why)
    coords = _coords(arrays, variables, names, options)
    if states is not None:
        attrs = {"long_name": "initial state, from 0", "units": "1"}
        coords["start"] = ("start", np.arange(len(states)), attrs)
        if states.shape[1] == len(entries):
            in_si = case.is_physical and not case._core.model_units
            units = "m, m/s" if in_si else "model units"
            attrs = {"long_name": "initial state", "units": units}
            variables["initial_state"] = (("start", "state"), states, attrs)
            coords["state"] = words(entries)
    # The value in the case of a parameter that varies does not matter.
    attributes = case_attributes(case, noun) | {
        "over": json.dumps(list(varied)),
        "held": case._core.held(list(texts[0])),
    }
    ds = answered(case, dataset(variables, coords, attributes))
    if interrupted:
        done = failures.count("")
        message = f"stopped; {done} of {len(failures)} are finished"
        raise Interrupted(message, ds)
    return ds


def _coords(
    arrays: "Mapping[str, xr.DataArray]",
    variables: Mapping[str, Any],
    names: Mapping[str, list[str]],
    options: Mapping[str, Any],
) -> dict[str, Any]:
    """The coordinates of results over arrays: of the arrays, and of the entries."""
    coords: dict[str, Any] = {}
    for key, array in arrays.items():
        for name, coord in array.coords.items():
            coords[str(name)] = (coord.dims, coord.values, coord.attrs)
        if key not in array.dims:
            coords[key] = (array.dims, array.values, array.attrs)
    for along, entries in names.items():
        if any(along in dims for dims, *_ in variables.values()):
            coords[along] = words(entries)
    if "strobe" in variables:
        kept = variables["strobe"][1].shape[-2]
        last = _arguments.count("periods", options["periods"])
        coords["strobe_period"] = np.arange(last - kept + 1, last + 1)
    return coords


def _as_array(key: str, value: Any) -> "xr.DataArray":
    import xarray as xr

    if isinstance(value, xr.DataArray):
        return value
    array = many(key, value)
    if array.ndim != 1 or array.size == 0:
        message = (
            f"{key}: expected a row of values, got an array of shape {array.shape}; for more "
            "dimensions pass an xarray.DataArray, which names them"
        )
        raise ValueError(message)
    if array.dtype.kind not in "iufU":
        message = f"{key}: expected real numbers, got {array.dtype}"
        raise TypeError(message)
    values = xr.DataArray(array, dims=key, coords={key: array}, name=key)
    if si_unit(key) and array.dtype.kind != "U":
        values[key].attrs["units"] = si_unit(key)
    return values
