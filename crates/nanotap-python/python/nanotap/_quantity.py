"""Values of a case's keys: numbers in SI, texts with a unit, quantities of a units package."""

from typing import Any

import numpy as np

from . import _nanotap

_UNITS = {
    f"{table}.{name}": unit
    for table, keys in _nanotap.case_keys()
    for name, _, unit in keys
}


def si_unit(key: str) -> str:
    """The SI unit of a key given by its path, `gap.tip`; empty if it is dimensionless."""
    return _UNITS.get(key, "")


def in_si(key: str, value: Any) -> Any:
    """A quantity of pint, astropy or unyt as numbers in the key's SI unit; otherwise the value."""
    if isinstance(value, str | int | float | list | tuple) or not hasattr(value, "to"):
        return value
    unit = si_unit(key)
    try:
        if hasattr(value, "to_value"):
            return value.to_value(unit)
        if hasattr(value, "magnitude"):
            return value.to(unit).magnitude
    except Exception as error:  # each package has its own errors
        message = f"{key}: {value!r} has no value in {unit or 'plain numbers'}: {error}"
        raise ValueError(message) from error
    return value


def written(value: Any) -> Any:
    """A quantity of pint, astropy or unyt as a text with its unit; otherwise the value."""
    if isinstance(value, str | int | float | list | tuple) or not hasattr(value, "to"):
        return value
    if hasattr(value, "magnitude"):
        return f"{float(value.magnitude)!r} {value.units:~}"
    if hasattr(value, "unit"):
        return f"{float(value.value)!r} {value.unit}"
    if hasattr(value, "units"):
        return f"{float(value.value)!r} {value.units}"
    return value


class Range:
    """Evenly spaced values of a key, both ends included: `range(2, 4, 400)`.

    >>> nanotap.range("60 kHz", "80 kHz", 3).values("drive.frequency")
    array([60000., 70000., 80000.])

    Args:
        first: The first value: a number, a text with a unit, or a quantity of a units package.
        last: The last value.
        count: Number of values.
        log: Whether successive values have one ratio rather than one difference.
    """

    def __init__(self, first: Any, last: Any, count: int, *, log: bool = False) -> None:
        self.first, self.last, self.count, self.log = first, last, count, log

    def __repr__(self) -> str:
        log = ", log=True" if self.log else ""
        return f"range({self.first!r}, {self.last!r}, {self.count}{log})"

    def values(self, key: str) -> "np.typing.NDArray[np.float64]":
        """The values of `key`, of a physical key in SI."""
        first, last = (_number(key, in_si(key, end)) for end in (self.first, self.last))
        if self.log:
            return np.geomspace(first, last, self.count, dtype=np.float64)
        return np.linspace(first, last, self.count, dtype=np.float64)


def _number(key: str, value: Any) -> float:
    return _nanotap.in_si(key, value) if isinstance(value, str) else float(value)


def text(key: str, value: float) -> str:
    """A number as text with the SI unit of the key."""
    return f"{value!r} {si_unit(key)}".rstrip()


def many(key: str, value: Any) -> Any:
    """Values of a key, one per place: numbers in SI, or texts."""
    if isinstance(value, Range):
        return value.values(key)
    if isinstance(value, list | tuple) and any(hasattr(one, "to") for one in value):
        value = [in_si(key, one) for one in value]
    return np.asarray(unmasked(key, in_si(key, value)))


def mask_of(value: Any) -> "np.typing.NDArray[np.bool_] | None":
    """The mask of a masked array, in its shape; `None` for anything else."""
    if not isinstance(value, np.ma.MaskedArray):
        return None
    return np.broadcast_to(np.asarray(value.mask, dtype=bool), value.shape)


def unmasked(name: str, value: Any) -> Any:
    """The value, refused if an entry is masked: numpy's conversions drop masks."""
    mask = mask_of(value)
    if mask is not None and mask.any():
        place = int(np.flatnonzero(mask)[0])
        message = f"{name}: entry {place} is masked, and all entries are needed"
        raise ValueError(message)
    return value
