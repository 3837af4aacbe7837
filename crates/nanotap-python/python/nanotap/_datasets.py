"""Sweeps and basins: chunked datasets, computed here or on a cluster, opened with xarray."""

import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from . import _arguments, _nanotap
from ._arguments import Box, Progress
from ._case import Case, Path
from ._interrupt import Interrupted
from ._motions import _cased
from ._progress import bar
from ._results import Record
from ._studies import _threads

if TYPE_CHECKING:
    import xarray as xr
    from distributed import Client

    from ._cluster import Plan


def sweep(
    case: Case,
    *,
    over: str | Sequence[str] | Mapping[str, Any],
    starts: int | None = None,
    seed: int = 1,
    box: Box = None,
    state: Any = None,
    follow: Literal["up", "down", "both"] | None = None,
    periods: int = 100,
    strobe: int | None = None,
    transient: int | None = None,
    max_period: int = 64,
    out: Path | None = None,
    chunk: str = "1/1",
    threads: int | None = None,
    client: "Client | None" = None,
    progress: Progress = None,
) -> "xr.Dataset":
    """How the motion changes with one or two parameters, from any number of starts.

    Args:
        case: What is swept.
        over: One or two parameters with their values: `{"omega": (2, 4, 400)}` (first, last,
            how many), `{"alpha4": (1, 1000, 50, "log")}` in equal ratios, an array in equal
            steps or ratios, or words as at the terminal, `"omega=2:4:400"`.
        starts: Quasi-random starts at each value, spread over a box of states; without it,
            one start from rest.
        seed: Their seed.
        box: Sides of the box, as in `{"a1": (-1, 1)}`; the others are derived from the
            linear response to the drive.
        state: Start from this state at drive phase 0.
        follow: Start each value from the last state of the one before, along the first
            parameter: up, down or both.
        periods: Drive periods recorded.
        strobe: States kept, at the end of each of the last periods; without it, of every
            recorded one.
        transient: Drive periods thrown away first; without it, as many as the motion is
            measured to need.
        max_period: Longest period looked for.
        out: The dataset, a folder ending in .zarr; where it is there already, the work goes
            on where it stopped. Without it, everything is in memory.
        chunk: One of n shares only, as in "2/8"; `merge` puts the shares together.
        threads: Threads; without it, one a core. The result is the same for any number.
        client: A Dask client, on whose workers the chunks are computed: the same bytes.
        progress: Whether to show a bar, or what hears of progress.

    Returns:
        The dataset, as `open` opens it: lazily from `out`.

    Raises:
        ValueError: something that was asked for is not right.
        Interrupted: Ctrl-C; its `result` is the dataset with what is finished, and the same
            call goes on in `out`.
    """
    core = _cased(case)._core
    # Looked at before the work: one start from rest and many at once make no sense.
    if starts is not None and state is not None:
        message = (
            "starts and state: the starts are drawn, or given; leave one of them away"
        )
        raise ValueError(message)
    if box and starts is None:
        message = "box: the sides are those of the starts; say how many with starts"
        raise ValueError(message)
    options: dict[str, Any] = {
        "over": _arguments.axes(over),
        "starts": _arguments.optional_count("starts", starts),
        "seed": _arguments.seed(seed),
        "sides": _arguments.box(box),
        "state": _arguments.state(state),
        "follow": follow,
        "periods": _arguments.count("periods", periods),
        "strobe": _arguments.optional_count("strobe", strobe),
        "transient": _arguments.optional_count("transient", transient),
        "max_period": _arguments.count("max_period", max_period),
    }
    recipe = _nanotap.Recipe.sweep(core, **options)
    plan = ("sweep", case, options)
    noun = "lines" if follow else "values"
    return _computed(recipe, plan, noun, out, chunk, threads, client, progress)


def basin(
    case: Case,
    *,
    x: str | Mapping[str, Any],
    y: str | Mapping[str, Any],
    state: Any = None,
    attractors: Iterable[Any] | None = None,
    starts: int = 64,
    seed: int = 1,
    periods: int = 1000,
    max_period: int = 64,
    out: Path | None = None,
    chunk: str = "1/1",
    threads: int | None = None,
    client: "Client | None" = None,
    progress: Progress = None,
) -> "xr.Dataset":
    """Basins of attraction on a two-dimensional slice of initial states.

    Args:
        case: Whose basins.
        x: The horizontal axis: `{"a1": (-1, 1, 200)}` or `"a1=-1:1:200"`: entry of the
            state, first value, last value, how many.
        y: The vertical axis.
        state: The other entries of the state, in full; without it, 0.
        attractors: States on the attractors, or what `nanotap.attractors` found; without
            them, a census in the slice finds them.
        starts: Starts of the census.
        seed: Seed of the census.
        periods: Drive periods after which a point is called unsettled.
        max_period: Longest period looked for.
        out: As in `sweep`.
        chunk: As in `sweep`.
        threads: As in `sweep`.
        client: As in `sweep`.
        progress: As in `sweep`.

    Returns:
        `attractor` over the two entries of the state: an index into the attractors of the
        attribute `attractors` (JSON), negative where there is none.

    Raises:
        ValueError: something that was asked for is not right.
        RuntimeError: nothing attracts.
        Interrupted: Ctrl-C, as in `sweep`.
    """
    core = _cased(case)._core
    known = None
    if attractors is not None:
        known = [
            _state_of(entry, f"attractors: number {k + 1}")
            for k, entry in enumerate(attractors)
        ]
    options: dict[str, Any] = {
        "x": _arguments.slice_axis("x", x),
        "y": _arguments.slice_axis("y", y),
        "state": _arguments.state(state),
        "attractors": known,
        "starts": _arguments.count("starts", starts),
        "seed": _arguments.seed(seed),
        "periods": _arguments.count("periods", periods),
        "max_period": _arguments.count("max_period", max_period),
    }
    with bar(progress, "starts") as hears:
        recipe = _nanotap.Recipe.basin(
            core, **options, threads=_threads(threads), progress=hears
        )
    plan = ("basin", case, options)
    return _computed(recipe, plan, "rows", out, chunk, threads, client, progress)


def _state_of(entry: Any, name: str) -> list[float]:
    found = getattr(entry, "state", entry)
    array = _arguments.real(found, name)
    if array.ndim != 1:
        message = f"{name}: a state is needed, not an array of {array.ndim} dimensions"
        raise ValueError(message)
    return [float(value) for value in array]


def open(path: Path) -> "xr.Dataset":
    """A sweep or basin that the terminal or Python wrote, lazily.

    Its chunks are read when they are needed: through dask where that is installed.

    Raises:
        ValueError: it is not there, or is no dataset of nanotap's.
    """
    import xarray as xr

    name = os.fspath(path)
    if not os.path.isdir(name):
        message = f"{name} is not a dataset of nanotap: it is not there"
        raise ValueError(message)
    if not os.path.isfile(os.path.join(name, ".zmetadata")):
        message = f"{name} is not a dataset of nanotap: it has no .zmetadata"
        raise ValueError(message)
    chunks: Any = {}
    try:
        import dask.array as _  # noqa: F401
    except ImportError:
        chunks = None
    ds: xr.Dataset = xr.open_zarr(name, chunks=chunks, consolidated=True)
    ds.attrs["path"] = name
    return ds


def merge(sources: Iterable[Path], out: Path) -> Record:
    """Puts together what several machines computed of one dataset with `chunk`.

    Args:
        sources: The datasets, made by the same call with different shares.
        out: The merged dataset: byte for byte what one machine would have made.

    Returns:
        `path`, `chunks`, `copied` and `missing` (chunks that are in none of them).

    Raises:
        ValueError: one is no dataset, or two do not belong together.
    """
    if isinstance(sources, str | os.PathLike):
        message = "sources: several datasets are needed, as a list"
        raise TypeError(message)
    _ending(out, "out")
    names = [os.fspath(source) for source in sources]
    return Record(json.loads(_nanotap.merge(names, out)))


def summary(ds: "xr.Dataset | Path") -> Record:
    """What the runs of a sweep, or the points of a basin, in a store came to."""
    return Record(json.loads(_nanotap.summary(_path_of(ds))))


def window(
    case: Case,
    *,
    over: Sequence[str] | Mapping[str, Any],
    starts: int = 16,
    seed: int = 1,
    max_period: int = 32,
    out: Path | None = None,
    threads: int | None = None,
    client: "Client | None" = None,
    progress: Progress = None,
) -> "xr.Dataset":
    """The operating window over two parameters: where the lever taps with one motion only,
    and where a second state, subharmonics or chaos threaten.

    Args:
        case: Whose window.
        over: Two parameters with their values, as in `sweep`; of a physical case also its
            quantities, as in `{"gap.tip": ("5 nm", "25 nm", 41)}`.
        starts: Quasi-random starts of the census at each point.
        seed: Their seed.
        max_period: Longest period looked for.
        out: The dataset of the census, as in `sweep`.
        threads: As in `sweep`.
        client: As in `sweep`.
        progress: As in `sweep`.

    Returns:
        The sweep with `condition` over both parameters: no-contact, one-period-1,
        second-state, subharmonic, irregular or undecided; `share` says how much of each
        there is.

    Raises:
        ValueError: something that was asked for is not right.
    """
    import xarray as xr

    words = _arguments.axes(over)
    if len(words) != 2:
        message = f"{len(words)} parameters make no window; two are needed"
        raise ValueError(message)
    with tempfile.TemporaryDirectory(prefix="nanotap-") as folder:
        store = (
            os.path.join(folder, "window.zarr") if out is None else _ending(out, "out")
        )
        ds = sweep(
            case,
            over=words,
            starts=starts,
            seed=seed,
            periods=1,
            strobe=1,
            max_period=max_period,
            out=store,
            threads=threads,
            client=client,
            progress=progress,
        )
        found = json.loads(_nanotap.window(store))
        if out is None:
            ds = ds.load()
            del ds.attrs["path"]
    dims = ds.classification.dims[:2]
    shares = found["shares"]
    return ds.assign(
        condition=xr.DataArray(np.array(found["conditions"], dtype=str), dims=dims),
        share=("kind_of_point", np.array(list(shares.values()))),
    ).assign_coords(kind_of_point=np.array(list(shares), dtype=str))


def _path_of(ds: "xr.Dataset | Path") -> str:
    if isinstance(ds, str | os.PathLike):
        return os.fspath(ds)
    path = ds.attrs.get("path")
    if path is None:
        message = "the dataset is in memory only; compute it with out="
        raise ValueError(message)
    return str(path)


def _ending(path: Path, name: str) -> str:
    text = os.fspath(path)
    if not text.endswith(".zarr"):
        message = f"{name} {text}: the ending says no format that is written here; end the name in .zarr"
        raise ValueError(message)
    return text


def _computed(
    recipe: "_nanotap.Recipe",
    plan: "Plan",
    noun: str,
    out: Path | None,
    chunk: str,
    threads: int | None,
    client: "Client | None",
    progress: Progress,
) -> "xr.Dataset":
    """Computes what the store lacks, then opens it."""
    if client is not None and chunk != "1/1":
        message = f"chunk {chunk}: a client computes all chunks; leave one of them away"
        raise ValueError(message)
    if out is not None:
        store = _ending(out, "out")
        stopped = _work(recipe, plan, noun, store, chunk, threads, client, progress)
        ds = open(store)
        if stopped:
            message = f"stopped; what is finished is in {store}; the same call goes on"
            raise Interrupted(message, ds)
        return ds
    folder = tempfile.mkdtemp(prefix="nanotap-")
    try:
        store = os.path.join(folder, "dataset.zarr")
        stopped = _work(recipe, plan, noun, store, chunk, threads, client, progress)
        ds = open(store).load()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    del ds.attrs["path"]
    # What was read is in memory, whatever it was read from.
    ds.close()
    if stopped:
        message = "stopped; what was not reached is missing"
        raise Interrupted(message, ds)
    return ds


def _work(
    recipe: "_nanotap.Recipe",
    plan: "Plan",
    noun: str,
    store: str,
    chunk: str,
    threads: int | None,
    client: "Client | None",
    progress: Progress,
) -> bool:
    if client is not None:
        from . import _cluster

        with bar(progress, "chunks") as hears:
            return _cluster.compute(client, recipe, plan, store, hears)
    with bar(progress, noun) as hears:
        return recipe.compute(
            store, share=chunk, threads=_threads(threads), progress=hears
        )
