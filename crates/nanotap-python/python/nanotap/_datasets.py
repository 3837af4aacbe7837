"""Sweeps and basins: chunked datasets, computed here or on a cluster, opened with xarray."""

import importlib
import json
import os
import tempfile
import threading
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arguments, _nanotap
from ._arguments import Progress
from ._case import Case, Path, missing
from ._describe import describe
from ._interrupt import Interrupted, nothing, stoppable
from ._motions import _cased
from ._progress import bar
from ._record import Record

if TYPE_CHECKING:
    import xarray as xr
    from distributed import Client

    from ._cluster import Plan
    from ._study_dataset import StudyDataset


@stoppable()
def sweep(
    case: Case,
    options: Mapping[str, Any],
    out: Path | None,
    chunk: str,
    threads: int | None,
    client: "Client | None",
    progress: Progress,
) -> "StudyDataset":
    """The runs over the parameters, lazily from `out` or in memory."""
    request = _arguments.request(
        "sweep", {**options, "over": _arguments.axes(options["over"])}
    )
    noun = "values" if options["follow"] in (None, "off") else "lines"
    plan = ("sweep", _cased(case), request)
    if not options["where"] or chunk != "1/1":
        return computed(plan, noun, out, chunk, threads, client, progress)
    with _stored(out) as (store, read):
        recipe = _recipe(plan, threads, progress)
        stopped = _work(recipe, plan, noun, store, chunk, threads, client, progress)
        ds = read(store, stopped)
        targets = json.loads(_nanotap.summary(store))["targets"]
    return _judged(ds, ds.classification.dims[:-1], targets)


@stoppable()
def basin(
    case: Case,
    options: Mapping[str, Any],
    out: Path | None,
    chunk: str,
    threads: int | None,
    client: "Client | None",
    progress: Progress,
) -> "StudyDataset":
    """The points of the slice, lazily from `out` or in memory."""
    known = options["attractors"]
    if known is not None:
        known = [
            _state_of(entry, f"attractors: number {k + 1}")
            for k, entry in enumerate(known)
        ]
    axes = {name: _arguments.slice_axis(name, options[name]) for name in ("x", "y")}
    request = _arguments.request("basin", {**options, **axes, "attractors": known})
    plan = ("basin", _cased(case), request)
    return computed(plan, "rows", out, chunk, threads, client, progress)


def _state_of(entry: Any, name: str) -> list[float]:
    found = getattr(entry, "state", entry)
    array = _arguments.real(found, name)
    if array.ndim != 1:
        message = f"{name}: expected a state, got an array with {array.ndim} dimensions"
        raise ValueError(message)
    return [float(value) for value in array]


def open(path: Path) -> "StudyDataset":
    """A sweep or basin written by the terminal or Python, loaded lazily.

    Its chunks are read when needed, through dask if it is installed.

    Raises:
        FileNotFoundError: it does not exist.
        ValueError: it is not a dataset of nanotap.

    >>> over = {"omega": nanotap.range(2.9, 3.1, 3)}
    >>> ds = nanotap.sweep(
    ...     nanotap.Case.paper(), over=over, periods=4, out="sweep.zarr", progress=False
    ... )
    >>> nanotap.open("sweep.zarr").period.values.ravel().tolist()
    [2, 1, 1]
    """
    name = os.fspath(path)
    if not os.path.exists(name):
        raise missing(name)
    if not os.path.isfile(os.path.join(name, ".zmetadata")):
        message = f"{name} is not a dataset of nanotap: it has no .zmetadata"
        raise ValueError(message)
    chunks: Any = {}
    try:
        import dask.array as _  # noqa: F401
    except ImportError:
        chunks = None
    import xarray as xr

    ds: xr.Dataset = xr.open_zarr(name, chunks=chunks, consolidated=True)
    ds.attrs["path"] = name
    # It may be written elsewhere, where the compression of this store does not apply.
    return _worded(ds.drop_encoding())


def _worded(whole: "xr.Dataset") -> "StudyDataset":
    """The Dataset of a store: `classification` in words, as in every other result, and as codes in the store; empty
    where a run is missing.
    """
    from ._study_dataset import StudyDataset

    ds = StudyDataset.of(whole)
    codes = ds.get("classification")
    if codes is None:
        return ds
    return ds.assign(classification=in_words(codes), classification_code=codes)


def in_words(codes: "xr.DataArray") -> "xr.DataArray":
    """The meanings of the codes of a store; empty where there is none."""
    import xarray as xr

    meanings = codes.attrs["flag_meanings"].split()
    words = np.array([word if word != "missing" else "" for word in meanings])
    named: xr.DataArray = xr.apply_ufunc(
        words.__getitem__, codes, dask="parallelized", output_dtypes=[words.dtype]
    )
    return named.assign_attrs({key: codes.attrs[key] for key in ("long_name", "units")})


def merge(sources: Iterable[Path], out: Path) -> Record:
    """Merges partial datasets computed on several machines with `chunk`.

    Args:
        sources: The datasets, written by the same call with different values of `chunk`.
        out: The merged dataset, identical to that of a single machine.

    Returns:
        `path`, `chunks`, `copied`, `missing_count` (chunks in none of the sources) and `missing`
        (the first 100,000 of these).

    Raises:
        ValueError: one is not a dataset, or two do not belong together.

    >>> case, over = nanotap.Case.paper(), {"omega": nanotap.range(2.9, 3.1, 4)}
    >>> for share in "12":
    ...     ds = nanotap.sweep(
    ...         case, over=over, periods=2, out=f"share-{share}.zarr", chunk=f"{share}/2", progress=False
    ...     )
    >>> nanotap.merge(["share-1.zarr", "share-2.zarr"], "all.zarr").missing
    []
    """
    if isinstance(sources, str | os.PathLike):
        message = "sources: expected a list of datasets"
        raise TypeError(message)
    _ending(out, "out")
    names = [os.fspath(source) for source in sources]
    for name in names:
        if not os.path.exists(name):
            raise missing(name)
    return Record(json.loads(_nanotap.merge(names, out)))


def summary(ds: "xr.Dataset | Path") -> Record:
    """The results of the runs of a sweep, or of the points of a basin, in a store."""
    return Record(json.loads(_nanotap.summary(_path_of(ds))))


@stoppable()
def window(
    case: Case,
    options: Mapping[str, Any],
    out: Path | None,
    threads: int | None,
    client: "Client | None",
    progress: Progress,
) -> "StudyDataset":
    """The census at every point, with the consequences for imaging."""
    import xarray as xr

    request = _arguments.request(
        "window", {**options, "over": _arguments.axes(options["over"])}
    )
    plan = ("window", _cased(case), request)
    with _stored(out) as (store, read):
        recipe = _recipe(plan, threads, progress)
        stopped = _work(recipe, plan, "values", store, "1/1", threads, client, progress)
        ds = read(store, stopped)
        found = json.loads(_nanotap.window(store))
        if (setpoint := found.get("setpoint")) is not None:
            figure = _nanotap.figure(store, "json").decode()
            ds = ds.assign_attrs(verdict=setpoint["verdict"], figure=figure)
    dims = ds[next(iter(ds.data_vars))].dims[:2]
    shares = found["shares"]
    if (targets := found.get("targets")) is not None:
        ds = _judged(ds, dims, targets)
    ds = ds.assign(
        condition=xr.DataArray(np.array(found["conditions"], dtype=str), dims=dims),
        share=("kind_of_point", np.array(list(shares.values())), _SHARE),
    ).assign_coords(kind_of_point=np.array(list(shares), dtype=str))
    return describe(ds)


def _judged(
    ds: "StudyDataset", dims: "tuple[Hashable, ...]", targets: Mapping[str, Any]
) -> "StudyDataset":
    """Where the conditions of `where` hold; the region and the share as attributes."""
    import xarray as xr

    holds = np.array(targets["holds"], dtype=bool).reshape(
        [ds.sizes[dim] for dim in dims]
    )
    attrs = {
        "long_name": "whether the conditions hold",
        "where": targets["where"],
        "share": targets["share"],
        "region": json.dumps(targets.get("region")),
    }
    return ds.assign(holds=xr.DataArray(holds, dims=dims, attrs=attrs))


_SHARE = {"long_name": "part of all points", "units": "1"}


def _path_of(ds: "xr.Dataset | Path") -> str:
    if isinstance(ds, str | os.PathLike):
        name = os.fspath(ds)
        if not os.path.exists(name):
            raise missing(name)
        return name
    path = ds.attrs.get("path")
    if path is None:
        message = "the dataset is in memory only; compute it with out="
        raise ValueError(message)
    return str(path)


@contextmanager
def _stored(
    out: Path | None, parent: str | None = None
) -> "Iterator[tuple[str, Callable[[str, bool], StudyDataset]]]":
    """The store of a dataset, `out` or one in a folder that is deleted afterwards, and what reads
    it: from the store and whether the work was stopped.
    """
    if out is not None:
        yield _ending(out, "out"), _lazy
        return
    with tempfile.TemporaryDirectory(prefix="nanotap-", dir=parent) as folder:
        # During the work, which leaves the interpreter free: after Ctrl-C it would take seconds, and
        # on this thread a Ctrl-C during an import may be lost.
        threading.Thread(target=_import_readers).start()
        yield os.path.join(folder, "dataset.zarr"), _in_memory


def _import_readers() -> None:
    """Imports what reads a store, the packages that xarray looks for included."""
    import xarray as xr

    importlib.import_module("zarr")
    importlib.import_module("nanotap._study_dataset")
    xr.Dataset(coords={"x": [0.0]})


def _lazy(store: str, stopped: bool) -> "StudyDataset":
    ds = open(store)
    if stopped:
        message = f"stopped; the finished part is in {store}; the same call resumes"
        raise Interrupted(message, ds)
    return ds


def _in_memory(store: str, stopped: bool) -> "StudyDataset":
    """The values of a store; of stopped work, those up to the last finished chunk."""
    import xarray as xr

    found = _nanotap.load(store, part=stopped)
    if found is None:
        raise nothing()
    ranges, columns = found
    with xr.open_zarr(store, chunks=None, consolidated=True) as whole:
        ds = whole.isel({name: slice(start, end) for name, start, end in ranges})
        for name, values in columns:
            old = ds[name]
            ds[name] = old.copy(data=np.reshape(values, old.shape))
        ds = _worded(ds.load())
        # Xarray's `drop_encoding` would copy all values.
        ds.encoding = {}
        for variable in ds.variables.values():
            variable.encoding = {}
    if stopped:
        raise Interrupted("stopped; unfinished values are missing", ds)
    return ds


def _ending(path: Path, name: str) -> str:
    text = os.fspath(path)
    if not text.endswith(".zarr"):
        message = f"{name} {text}: unsupported file extension; use .zarr"
        raise ValueError(message)
    return text


@stoppable()
def computed(
    plan: "Plan",
    noun: str,
    out: Path | None,
    chunk: str,
    threads: int | None,
    client: "Client | None",
    progress: Progress,
) -> "StudyDataset":
    """Computes the missing chunks of the store, then opens it."""
    if client is not None and chunk != "1/1":
        message = f"chunk {chunk}: a client computes all chunks; omit one of the two"
        raise ValueError(message)
    recipe = _recipe(plan, threads, progress)

    def run(parent: str | None) -> "StudyDataset":
        with _stored(out, parent) as (store, read):
            stopped = _work(recipe, plan, noun, store, chunk, threads, client, progress)
            return read(store, stopped)

    *faster, usual = [None] if out is not None else _temporary_folders()
    for parent in faster:
        # It may be too small.
        with suppress(OSError):
            return run(parent)
    return run(usual)


def _temporary_folders() -> list[str | None]:
    """Where a store is written that is read at once: in memory if the system has such a folder,
    else where temporary files are (`None`)."""
    memory = "/dev/shm"
    return [memory, None] if os.access(memory, os.W_OK | os.X_OK) else [None]


def _recipe(plan: "Plan", threads: int | None, progress: Progress) -> "_nanotap.Recipe":
    """The plan of the computation; for basins, including the census of attractors."""
    study, case, request = plan
    many = _arguments.optional_count("threads", threads)
    with bar(progress if study == "basin" else False, "starts") as show:
        return _nanotap.Recipe(study, case._core, request, threads=many, progress=show)


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
            store,
            share=chunk,
            threads=_arguments.optional_count("threads", threads),
            progress=hears,
        )
