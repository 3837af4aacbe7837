"""Files for other programs: CSV, Parquet, HDF5, and Gwyddion's simple fields.

>>> import nanotap
>>> ds = nanotap.sweep(nanotap.Case.paper(), over={"omega": nanotap.range(2.9, 3.1, 3)}, periods=4)
>>> nanotap.export.table(ds).columns[0]
'classification'
"""

import json
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from . import _arguments, _nanotap
from ._case import Path
from ._report import Answered, answer_of
from ._results import Attractors, Convergence, Modes, Orbit, Paper

if TYPE_CHECKING:
    import xarray as xr


def table(result: Any) -> pd.DataFrame:
    """A result as a table.

    The rows are the initial states of a sweep, the points of a basin, branch or approach curve,
    or the instants of a run or orbit; attractors, modes, convergence and paper have their own
    tables.

    >>> case = nanotap.Case.paper(omega=3)
    >>> nanotap.export.table(nanotap.modes(case)).columns.tolist()
    ['free', 'exact_free', 'contact', 'exact_contact']
    """
    if isinstance(result, Attractors | Convergence | Modes | Paper):
        return result.table()
    if isinstance(result, Orbit):
        if result.series is None:
            message = "only an orbit found by nanotap.orbit has a time series"
            raise ValueError(message)
        return _frame(result.series, ("tau",))
    if isinstance(result, Answered):
        return result.to_dataframe()
    if not hasattr(result, "data_vars"):
        message = f"a {type(result).__name__} cannot be converted to a table"
        raise TypeError(message)
    if "period_max" in result.variables:
        return _frame(result, tuple(map(str, result.classification.dims)))
    if "way" in result.dims:
        return _frame(result, tuple(map(str, result.classification.dims)))
    if "attractor" in result.variables:
        return _frame(result, tuple(map(str, result.attractor.dims)))
    for dim in ("point", "tau"):
        if dim in result.dims:
            return _frame(result, (dim,))
    longest = max((v.dims for v in result.data_vars.values()), key=len, default=())
    return _frame(result, tuple(map(str, longest)))


def _frame(ds: "xr.Dataset", dims: tuple[str, ...]) -> pd.DataFrame:
    """The variables along `dims` without codes; states with one column per entry."""
    chosen: dict[str, Any] = {}
    for key, variable in ds.data_vars.items():
        name = str(key)
        if variable.dims == dims:
            if "flag_meanings" not in variable.attrs:
                chosen[name] = variable
        elif variable.dims == (*dims, "state") and name in {"states", "orbit_state"}:
            for entry in ds.state.values:
                chosen[str(entry)] = variable.sel(state=entry, drop=True)
    part = ds[list(set(dims) & set(map(str, ds.coords)))].assign(chosen)
    coords = {
        str(name): coord
        for name, coord in ds.coords.items()
        if coord.dims and set(coord.dims) <= set(dims)
    }
    return part.assign_coords(coords).to_dataframe(dim_order=list(dims))


def csv(result: Any, path: Path) -> None:
    """A result as CSV: the terminal's file, byte for byte. What xarray made of a result, such as a
    selection of an approach curve, and results over arrays have that of `table`.

    >>> nanotap.export.csv(nanotap.modes(nanotap.Case.paper()), "modes.csv")
    """
    text = _terminal_file(result)
    if text is None:
        frame = table(result)
        _written(path, lambda name: frame.to_csv(name))
        return

    def write(name: str) -> None:
        with open(name, "w", encoding="utf-8", newline="") as file:
            file.write(text)

    _written(path, write)


def _terminal_file(result: Any) -> str | None:
    """The text of the terminal's file, if the result has one."""
    if (answer := answer_of(result)) is not None:
        return answer.csv
    if "kind" not in getattr(result, "attrs", ()):
        return None
    named = ("classification", "attractor", "result")
    main = next((name for name in named if name in result), None)
    return None if main is None else _grid(result, tuple(map(str, result[main].dims)))


# What Python adds to the variables of a store.
_ADDED = {"classification_code", "condition", "holds"}


def _grid(ds: "xr.Dataset", dims: tuple[str, ...]) -> str:
    """One row per entry of a grid: the coordinates along its axes, then the variables."""
    along = [
        (name, ds[name])
        for dim in dims
        for name in sorted(ds.coords, key=lambda name: name != dim)
        if ds[name].dims == (dim,)
    ]
    measured = [
        (name, variable)
        for name, variable in ds.data_vars.items()
        if variable.dims == dims and name not in _ADDED
    ]
    like = measured[0][1]
    columns = []
    for name, variable in along + measured:
        cells = variable.broadcast_like(like).transpose(*dims).values.ravel()
        columns.append(
            (str(name), str(variable.attrs.get("units", "")), cells.tolist())
        )
    return _nanotap.csv(columns)


def parquet(result: Any, path: Path) -> None:
    """The table of a result as Parquet; needs pyarrow.

    >>> nanotap.export.parquet(nanotap.modes(nanotap.Case.paper()), "modes.parquet")
    """
    frame = table(result).reset_index()
    _written(path, lambda name: frame.to_parquet(name, engine="pyarrow", index=False))


def hdf5(result: Any, path: Path) -> None:
    """An orbit or a Dataset as HDF5: one array per variable, `long_name` and `units` as
    attributes, the case as JSON in the attribute `case`; needs h5py.

    >>> nanotap.export.hdf5(nanotap.orbit(nanotap.Case.paper(omega=3)), "orbit.h5")
    """
    import h5py

    if isinstance(result, Orbit):
        arrays = {
            "state": result.state,
            "states": result.states,
            "multipliers": result.multipliers,
        }
        harmonics = result.spectrum().reset_index()
        series = result.series
        attributes = {
            key: value for key, value in result.document.items() if np.isscalar(value)
        }
    elif hasattr(result, "data_vars"):
        arrays, harmonics, series, attributes = {}, None, result, {}
    else:
        message = f"expected an orbit or a Dataset, got a {type(result).__name__}"
        raise TypeError(message)

    def write(target: str) -> None:
        with h5py.File(target, "w") as file:
            for key, value in attributes.items():
                file.attrs[key] = value
            for name, array in arrays.items():
                file.create_dataset(name, data=array)
            if harmonics is not None:
                group = file.create_group("harmonics")
                units = harmonics.attrs.get("units", {})
                for column in harmonics:
                    values = harmonics[column].to_numpy()
                    dataset = group.create_dataset(str(column), data=values)
                    dataset.attrs["units"] = units.get(column, "1")
            if series is not None:
                group = file.create_group("series") if arrays else file
                _datasets(group, series)
                file.attrs["case"] = series.attrs.get("case", "")

    _written(path, write)


def _datasets(group: Any, ds: "xr.Dataset") -> None:
    import h5py

    for key, variable in ds.variables.items():
        values = variable.values
        if values.dtype.kind in "UO":
            values = values.astype(object)
            dataset = group.create_dataset(
                str(key), data=values, dtype=h5py.string_dtype()
            )
        else:
            dataset = group.create_dataset(str(key), data=values)
        dataset.attrs["dimensions"] = json.dumps(list(map(str, variable.dims)))
        for name in ("long_name", "units", "flag_meanings"):
            if name in variable.attrs:
                dataset.attrs[name] = variable.attrs[name]


def gsf(
    ds: "xr.Dataset", path: Path, *, variable: str | None = None, start: int = 0
) -> None:
    """A map over two parameters, or a basin, as a Gwyddion field.

    Args:
        ds: The Dataset.
        path: The file, with the extension .gsf.
        variable: The variable; default: `attractor` of a basin, `amplitude` of a sweep.
        start: Index of the initial state of a sweep.

    Raises:
        ValueError: the map does not exist, or its axes are not equidistant and ascending.

    >>> over = {"omega": [2.9, 3.0], "alpha4": nanotap.range(19, 20, 2)}
    >>> ds = nanotap.sweep(nanotap.Case.paper(), over=over, periods=2, progress=False)
    >>> nanotap.export.gsf(ds, "map.gsf", variable="tip_max")
    """
    name = variable or ("attractor" if "attractor" in ds else "amplitude")
    if name not in ds:
        message = f"variable: unknown `{name}`; the variables are {', '.join(map(str, ds.data_vars))}"
        raise ValueError(message)
    field = ds[name]
    if "start" in field.dims:
        if not 0 <= start < field.sizes["start"]:
            message = f"start: {start} is out of range; there are {field.sizes['start']} starts"
            raise ValueError(message)
        field = field.isel(start=start)
    if field.ndim != 2:
        message = f"variable: `{name}` has the dimensions {', '.join(map(str, field.dims))}; a map has two"
        raise ValueError(message)
    y, x = field.dims
    file = _nanotap.gsf(
        f"{field.attrs.get('long_name', name)} over {x} and {y}",
        _arguments.real(ds[x].values, str(x)),
        _arguments.real(ds[y].values, str(y)),
        _arguments.real(field.values.ravel(), name),
        _shared_unit(ds[x].attrs.get("units"), ds[y].attrs.get("units")),
        _gwyddion(field.attrs.get("units")),
    )

    def write(target: str) -> None:
        with open(target, "wb") as stream:
            stream.write(file)

    _written(path, write)


def _gwyddion(unit: object) -> str:
    """A unit in Gwyddion's spelling; empty if it is not one of SI."""
    if unit == "degree":
        return "deg"
    is_si = unit == "eV" or _nanotap.axis(str(unit), 1.0)[1] != ""
    return str(unit) if is_si else ""


def _shared_unit(x: object, y: object) -> str:
    """The unit of both axes: the format has one."""
    return _gwyddion(x) if x == y else ""


def netcdf(ds: "xr.Dataset", path: Path, **options: Any) -> None:
    """A Dataset as netCDF, under a temporary name until it is complete.

    Args:
        ds: The Dataset.
        path: The file, with the extension .nc.
        **options: Options of `Dataset.to_netcdf`.

    >>> ds = nanotap.sweep(
    ...     nanotap.Case.paper(), over={"omega": nanotap.range(2.9, 3.1, 3)}, periods=4, progress=False
    ... )
    >>> nanotap.export.netcdf(ds, "sweep.nc")
    """
    _written(path, lambda target: ds.to_netcdf(target, **options))


def _written(path: Path, write: Callable[[str], object]) -> None:
    """Writes under a temporary name in the same folder, then renames."""
    name = os.fspath(path)
    folder, last = os.path.split(name)
    temporary = os.path.join(folder, f".{last}.{os.getpid()}.tmp")
    try:
        write(temporary)
        os.replace(temporary, name)
    except BaseException:
        if os.path.exists(temporary):
            os.unlink(temporary)
        raise
