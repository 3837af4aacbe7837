"""Conversion of arguments for the extension, with error messages."""

import json
import math
import operator
import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from . import _nanotap
from ._case import existing
from ._describe import name_in_si
from ._quantity import (
    Range,
    in_si,
    many,
    mask_of,
    si_unit,
    text,
    unmasked,
    written,
)
from ._record import Record

if TYPE_CHECKING:
    import xarray as xr

Floats: TypeAlias = npt.NDArray[np.float64]
Progress: TypeAlias = bool | Callable[[int, int], object] | None
Box: TypeAlias = Mapping[str, tuple[float, float]] | None
# A key of the case: one value, or many.
Varied: TypeAlias = (
    "float | str | np.floating[Any] | np.integer[Any] | Mapping[str, Any] | Sequence[float] "
    "| Sequence[str] | npt.NDArray[Any] | xr.DataArray | None"
)
# The extension takes 64-bit numbers.
_MOST = 2**63 - 1


def whole(name: str, value: Any) -> int:
    """A whole number."""
    if isinstance(value, bool | np.bool_):
        message = f"{name}: {value} is not a number"
        raise TypeError(message)
    try:
        return operator.index(value)
    except TypeError:
        message = f"{name}: expected a whole number, got {value!r}"
        raise TypeError(message) from None


def count(name: str, value: Any, least: int = 0) -> int:
    """A whole number that is at least `least`."""
    number = whole(name, value)
    if not least <= number <= _MOST:
        message = f"{name}: {number} is out of range; expected a whole number of at least {least}"
        raise ValueError(message)
    return number


def optional_count(name: str, value: Any, least: int = 0) -> int | None:
    """A whole number, or `None`."""
    return None if value is None else count(name, value, least)


def seed(value: Any) -> int:
    """A seed, from 0 to 2⁶³ − 1."""
    return count("seed", value)


def flag(name: str, value: Any) -> bool:
    """True or False, not a text or number that Python would take for one of them."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    message = f"{name}: expected True or False, got {value!r}"
    raise TypeError(message)


def number(name: str, value: Any) -> float:
    """A real number, finite or not; the library checks its range."""
    if isinstance(value, bool | np.bool_ | str | bytes | complex):
        message = f"{name}: expected a number, got {value!r}"
        raise TypeError(message)
    try:
        return float(value)
    except (TypeError, ValueError):
        message = f"{name}: expected a number, got {value!r}"
        raise TypeError(message) from None


def state(value: Any) -> Any:
    """A state as the extension reads it: a row of numbers (of a physical case in m and m/s) or of
    texts with units, a text, entries by name; a motion with a state stands for its own state.
    """
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        named = {str(name): written(entry) for name, entry in value.items()}
        return {
            name: row("state", entry).tolist()
            if np.ndim(entry)
            else entry
            if isinstance(entry, str)
            else number(f"state: {name}", entry)
            for name, entry in named.items()
        }
    if hasattr(value, "state"):
        return {"model_units": row("state", value.state).tolist()}
    if isinstance(value, list | tuple) and any(_is_quantity(one) for one in value):
        texts = [written(one) for one in value]
        return [one if isinstance(one, str) else number("state", one) for one in texts]
    return [_finite(one) for one in row("state", value).tolist()]


def _is_quantity(value: Any) -> bool:
    """Whether a value is a text that begins with a number, or a quantity of a units package."""
    if isinstance(value, str):
        return value[:1].isdigit() or value[:1] in {"-", "+", "."}
    return hasattr(value, "to")


def row(name: str, value: Any) -> Floats:
    """One row of real numbers."""
    array = real(value, name)
    if array.ndim != 1:
        message = f"{name}: expected one row of numbers, got an array with {array.ndim} dimensions"
        raise ValueError(message)
    return array


def real(value: Any, name: str) -> Floats:
    """Real numbers as an aligned, contiguous array, which other packages may not provide."""
    try:
        array = np.asarray(unmasked(name, value))
    except ValueError as error:  # rows of different lengths, or a mask
        message = str(error) if str(error).startswith(name) else f"{name}: {error}"
        raise ValueError(message) from None
    if array.dtype.kind not in "iuf" and array.size:
        message = f"{name}: expected real numbers, got {array.dtype}"
        raise TypeError(message)
    return np.require(array, np.float64, ["C", "A"])


def _pair(name: str, value: Any) -> tuple[Any, Any]:
    if isinstance(value, str) or not isinstance(value, Iterable):
        message = f"{name}: expected a lower and an upper end, got {value!r}"
        raise TypeError(message)
    ends = tuple(value)
    if len(ends) != 2:
        message = f"{name}: expected a lower and an upper end, got {len(ends)} values"
        raise ValueError(message)
    return ends[0], ends[1]


def quantity(name: str, value: Any) -> str:
    """A number (of a physical key in SI), or a text with a unit, as the extension reads it."""
    value = in_si(name, value) if si_unit(name) else written(value)
    if isinstance(value, str):
        return value
    return text(name, number(name, value))


def axis(name: str, values: Any) -> str:
    """An axis as the terminal writes it: `omega=2:4:400`, `alpha4=1:1000:50:log`, `omega=2,2.5,4`."""
    if isinstance(values, tuple) and len(values) in (3, 4):
        values = _from_tuple(values)
    if isinstance(values, Range):
        words = [
            quantity(name, values.first),
            quantity(name, values.last),
            str(count(name, values.count)),
        ]
        return f"{name}={':'.join(words + ['log'] * values.log)}"
    values = many(name, values)
    if values.ndim == 1 and values.dtype.kind == "U":
        return f"{name}={','.join(values.tolist())}"
    array = real(values, name)
    if array.ndim != 1 or array.size == 0:
        message = f"{name}: expected a row of values, as in nanotap.range(2, 4, 400)"
        raise ValueError(message)
    first, last, size = float(array[0]), float(array[-1]), array.size
    if np.allclose(array, np.linspace(first, last, size), rtol=1e-12, atol=0):
        return f"{name}={text(name, first)}:{text(name, last)}:{size}"
    if (
        first > 0
        and last > 0
        and np.allclose(array, np.geomspace(first, last, size), rtol=1e-12, atol=0)
    ):
        return f"{name}={text(name, first)}:{text(name, last)}:{size}:log"
    return f"{name}={','.join(text(name, value) for value in array.tolist())}"


def _from_tuple(values: tuple[Any, ...]) -> "Range | tuple[Any, ...]":
    """The range that a tuple `(first, last, count)` meant until version 0.2."""
    first, last, number_of, *spacing = values
    log = spacing == ["log"]
    if isinstance(number_of, bool) or not isinstance(number_of, int | np.integer):
        return values
    if spacing and not log or number_of < 2:
        return values
    meant = Range(first, last, int(number_of), log=log)
    warnings.warn(
        f"{values} is taken for a range; write nanotap.{meant!r}: a tuple will be a list of values",
        FutureWarning,
        stacklevel=4,
    )
    return meant


def axes(over: str | Sequence[str] | Mapping[str, Any]) -> list[str]:
    """The axes of a sweep."""
    if isinstance(over, str):
        return [over]
    if isinstance(over, Mapping):
        return [axis(str(name), values) for name, values in over.items()]
    if isinstance(over, Sequence) and all(isinstance(word, str) for word in over):
        return list(over)
    message = 'over: name parameters and values, as in {"omega": nanotap.range(2, 4, 400)} or "omega=2:4:400"'
    raise TypeError(message)


def slice_axis(name: str, value: str | Mapping[str, Any]) -> str:
    """One axis of a slice of states: `"a1=-1:1:200"` or `{"a1": range(-1, 1, 200)}`."""
    if isinstance(value, Mapping):
        # Here three values are always a range.
        value = {
            name: Range(*ends) if isinstance(ends, tuple) and len(ends) == 3 else ends
            for name, ends in value.items()
        }
    words = axes(value) if isinstance(value, str | Mapping) else []
    if len(words) != 1:
        message = f'{name}: name one entry of the state, as in {{"a1": nanotap.range(-1, 1, 200)}} or "a1=-1:1:200"'
        raise TypeError(message)
    return words[0]


# Made once: making it takes longer than a request.
_written = json.JSONEncoder(allow_nan=False).encode


class _Option(NamedTuple):
    """JSON types that an option takes, the type of an array's entries, and whether the names of an object's
    fields are fixed."""

    kinds: frozenset[str]
    entries: str | None
    has_fields: bool

    @classmethod
    def of(cls, schema: Mapping[str, Any]) -> "_Option":
        items = schema.get("items", {})
        inner = _kinds(items)
        found = (kind for kind in ("string", "object") if kind in inner)
        entries = next(found, items.get("type"))
        return cls(frozenset(_kinds(schema)), entries, "properties" in schema)


@cache
def _studies() -> dict[str, tuple[str, dict[str, _Option]]]:
    """The unit of each study's progress, and the types of its options."""
    studies = {}
    for name, _, counted, schema in _nanotap.studies():
        options = json.loads(schema)["properties"].items()
        studies[name] = counted, {key: _Option.of(one) for key, one in options}
    return studies


def counted(study: str) -> str:
    """The unit of a study's progress."""
    return _studies()[study][0]


def options(study: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a study among the arguments of its function."""
    names = _studies()[study][1]
    return {name: arguments["from_" if name == "from" else name] for name in names}


def request(study: str, options: Mapping[str, Any]) -> str:
    """The request of a study, as JSON.

    A value of the wrong type is a `TypeError`; the library checks ranges and choices.
    """
    takes = _studies()[study][1]
    given = {
        name: _plain("from_" if name == "from" else name, value, takes[name])
        for name, value in options.items()
        # `None` omits an option; for a number it is passed on and refused.
        if value is not None or takes[name].kinds <= {"integer", "number"}
    }
    return _written(given)


def _kinds(schema: Mapping[str, Any]) -> set[str]:
    kinds = schema.get("type")
    if kinds is None:
        choices = [*schema.get("anyOf", ()), *schema.get("oneOf", ())]
        return {kind for choice in choices for kind in _kinds(choice)}
    return {kinds} if isinstance(kinds, str) else set(kinds)


def _plain(name: str, value: Any, takes: _Option) -> Any:
    """A value in JSON."""
    kinds = takes.kinds
    if name == "state":
        return state(value)
    if name == "data":
        return value
    if name == "drive_signal":
        return value if isinstance(value, str) else tables(value)[0]
    if "string" in kinds:
        value = written(value)
    if "boolean" in kinds:
        return flag(name, value)
    if "object" in kinds and takes.has_fields:
        if not isinstance(value, Mapping):
            message = f"{name}: expected a dictionary, got {value!r}"
            raise TypeError(message)
        return {str(field): written(one) for field, one in value.items()}
    if "object" in kinds:
        if isinstance(value, str | list) and "string" in kinds:
            return value
        return {side: list(ends) for side, *ends in _sides(name, value)}
    if "array" in kinds and "integer" in (takes.entries, *kinds):
        many = [value] if isinstance(value, int | np.integer) else list(value)
        return [whole(name, one) for one in many]
    if "array" in kinds and takes.entries in ("string", "array", "object"):
        return value
    if "array" in kinds:
        return [_finite(one) for one in row(name, value).tolist()]
    if "number" in kinds:
        if isinstance(value, str) and "string" in kinds:
            return value
        return _finite(number(name, value))
    if "integer" in kinds:
        number_of = whole(name, value)
        if not -(2**63) <= number_of < 2**64:
            message = f"{name}: {number_of} is out of range; expected a whole number of 64 bits"
            raise ValueError(message)
        return number_of
    return str(value)


def _finite(value: float) -> float | str:
    """Refuses infinity and NaN, which JSON does not have, with a remedy."""
    return value if math.isfinite(value) else str(value)


def names(name: str, value: Any) -> list[str]:
    """Names: a single text, or several; of a mapping, each as `name=value`."""
    if isinstance(value, Mapping):
        value = [f"{of}={text}" for of, text in value.items()]
    given = [value] if isinstance(value, str) else value
    if not isinstance(given, Iterable) or not all(isinstance(v, str) for v in given):
        message = f"{name}: expected names, got {value!r}"
        raise TypeError(message)
    return list(given)


def tables(data: Any, curve: int | None = None) -> list[dict[str, Any]]:
    """Measured curves as tables: files (of an instrument's file the first curve or the one with this
    number), mappings of columns, data frames, datasets, computed force curves, or several.
    """
    if isinstance(data, str | os.PathLike):
        table: dict[str, Any] = json.loads(_nanotap.table(existing(data), curve))
        return [table]
    if hasattr(data, "data_vars"):  # xarray
        return [{"columns": _of_dataset(data)}]
    if hasattr(data, "columns") and not isinstance(data, Mapping):  # pandas, polars
        notes = {str(k): str(v) for k, v in getattr(data, "attrs", {}).items()}
        columns = {str(c): column(str(c), data[c]) for c in data.columns}
        return [{"columns": columns, "notes": notes}]
    if isinstance(data, Record) and "table" in data:
        if data["driven"]:
            message = (
                "data: the lever of this force curve is driven, and a fit takes it as at "
                "rest: compute the curve with drive.free_amplitude = 0"
            )
            raise ValueError(message)
        rows = data.to_dict()["table"]
        columns = {
            header: [row[name] for row in rows]
            for name, header in _OF_FORCE_CURVE.items()
        }
        return [{"columns": columns}]
    if isinstance(data, Mapping):
        if data and all(
            isinstance(v, Mapping) or hasattr(v, "columns") or hasattr(v, "data_vars")
            for v in data.values()
        ):
            return [
                {**tables(table)[0], "name": str(name)} for name, table in data.items()
            ]
        return [{"columns": {str(c): column(str(c), v) for c, v in data.items()}}]
    if isinstance(data, np.ndarray):
        message = (
            "data: an array has no names of columns; pass a mapping, {name: values}"
        )
        raise TypeError(message)
    if isinstance(data, Iterable):
        many = [table for one in data for table in tables(one, curve)]
        return [
            {**table, "name": table.get("name", f"curve {k + 1}")}
            for k, table in enumerate(many)
        ]
    message = f"data: expected a table of columns, got {data!r}"
    raise TypeError(message)


# Entries of the rows of a computed force curve that are fitted, as headers.
_OF_FORCE_CURVE = {
    "way": "way",
    "distance": "distance (m)",
    "deflection": "deflection (m)",
}

# Units as the columns of files have them.
_COLUMN_UNITS = {"degree": "deg", "1": "", "drive periods": "", "1/drive period": ""}


def _of_result(data: "xr.Dataset") -> "xr.Dataset":
    """The motions of a result of nanotap, under the names of the columns of its CSV files: an
    approach curve, a sweep, orbits over an array.
    """
    rows = data.first_harmonic.dims
    if "zc" in rows:
        # The same distance is also given in metres.
        data = data.drop_vars("alpha5", errors="ignore")
    kept = {
        str(name): variable
        for name, variable in data.data_vars.items()
        if variable.dims == rows
        and variable.dtype.kind == "f"
        and variable.attrs.get("units", "1") not in ("1", "drive periods")
        and not str(name).startswith("physical_")
    }
    units = {"m", "N", "J", "W", "s", "m/s", "Hz"}
    in_si = data.first_harmonic.attrs.get("units") in units
    names = {name: name_in_si(name) if in_si else name for name in kept}
    # By these the table of an approach curve is recognised.
    first = ["classification", "period", "spectral_radius"] if "way" in rows else []
    plain = data[[*first, *kept]].rename({k: v for k, v in names.items() if k != v})
    others = [c for c in plain.coords if set(plain[c].dims) - set(rows)]
    return plain.drop_vars(others)


def _of_dataset(data: "xr.Dataset") -> dict[str, list[Any]]:
    if "nanotap_version" in data.attrs and "first_harmonic" in data:
        data = _of_result(data)
    units = {str(n): v.attrs.get("units", "") for n, v in data.variables.items()}
    units = {name: _COLUMN_UNITS.get(unit, unit) for name, unit in units.items()}
    frame = data.to_dataframe().reset_index()
    named = {c: f"{c} ({units[c]})" if units.get(c) else c for c in map(str, frame)}
    return {header: column(c, frame[c]) for c, header in named.items()}


def column(name: str, values: Any) -> list[Any]:
    """Entries of a column: numbers or texts; `None` where one is missing: NaN, masked, or empty."""
    array = np.asarray(values)
    masked = mask_of(values)
    if array.ndim != 1:
        message = f"{name}: expected a row of entries, got an array with {array.ndim} dimensions"
        raise ValueError(message)
    entries = array.tolist()
    if masked is not None:
        entries = [None if gone else v for gone, v in zip(masked, entries, strict=True)]
    if array.dtype.kind in "iuf":
        return [None if v is None or math.isnan(v) else _finite(v) for v in entries]
    return [None if _is_missing(v) else v for v in entries]


def _is_missing(value: Any) -> bool:
    """Whether an entry of a column is missing: `None`, an empty text, NaN, masked, or the missing
    values of pandas, which do not compare.
    """
    if value is None or value is np.ma.masked:
        return True
    if isinstance(value, str):
        return not value
    if isinstance(value, float):
        return math.isnan(value)
    return type(value).__name__ in ("NAType", "NaTType")


def _sides(name: str, value: Any) -> list[tuple[str, Any, Any]]:
    if not isinstance(value, Mapping):
        message = f'{name}: name the sides with their ends, as in {{"a1": (-1, 1)}}'
        raise TypeError(message)
    sides = []
    for side, ends in value.items():
        low, high = _pair(f"{name}: {side}", ends)
        place = f"{name}: {side}"
        sides.append((str(side), quantity(place, low), quantity(place, high)))
    return sides
