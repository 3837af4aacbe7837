"""Results of physical cases in SI."""

import json
import math
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ._describe import Described, name_in_si

if TYPE_CHECKING:
    import xarray as xr

    from ._case import Case


class Scales:
    """The model's units of a physical case in SI, from the document of the case."""

    def __init__(self, document: Mapping[str, Any] | Callable[[], str]) -> None:
        self._document = document

    @cached_property
    def _factors(self) -> dict[str, tuple[float, str]]:
        document = self._document
        case = json.loads(document()) if callable(document) else document
        # A case whose distance is open has no units, nor has its report numbers in them.
        return _factors(case) if case.get("physical") else {}

    def of(self, unit: str) -> tuple[float, str]:
        """Factor of numbers in one of the model's units, and their unit in SI; 1 and the unit itself
        of another."""
        return self._factors.get(unit, (1.0, unit)) if unit else (1.0, "")

    def __reduce__(self) -> tuple[Any, ...]:
        document = self._document
        case = json.loads(document()) if callable(document) else document
        return Scales, ({"physical": case.get("physical")},)


def scales(case: "Case", document: Mapping[str, Any] | None = None) -> Scales | None:
    """The units of a case, by its document as it was studied, if its results are in SI."""
    if not case.is_physical or case._core.model_units:
        return None
    core = case._core
    return Scales(document or (lambda: core.document_at_setpoint))


def _factors(case: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
    """The model's units in SI."""
    physical = case.get("physical")
    if physical is None:
        message = "the case is not in physical quantities: it has no unit of length"
        raise ValueError(message)
    length, time = physical["length_unit"], physical["time_unit"]
    force, energy = physical["force_unit"], physical["energy_unit"]
    return {
        "g0": (length, "m"),
        "sqrt(m L^4/EI)": (time, "s"),
        # Angular frequencies, shown as frequencies.
        "sqrt(EI/(m L^4))": (1 / (2 * math.pi * time), "Hz"),
        "g0 sqrt(EI/(m L^4))": (length / time, "m/s"),
        "EI g0/L^3": (force, "N"),
        "EI g0^2/L^3": (energy, "J"),
        "EI g0^2/L^3 sqrt(EI/(m L^4))": (energy / time, "W"),
    }


def answered(case: "Case", ds: Described) -> Described:
    """A result of a case as its user sees it: of a physical case in SI unless it is in the model's
    units.
    """
    return ds if scales(case) is None else in_si(ds)


def _keeps_units(ds: "xr.Dataset", key: str) -> bool:
    """Whether the model's units are those of one lever at one height while a key varies."""
    numbers = key not in ds or ds[key].dtype.kind in "iuf"
    return numbers and (key == "gap.tip" or key.startswith(("sample.", "drive.")))


def in_si(ds: Described) -> Described:
    """A result of a case in the model's units (`model_units=True`), converted to SI. States, which
    have several units, stay in the model's units. So do variables without a counterpart in SI if
    a physical quantity varies, and with it the model's units.

    Raises:
        ValueError: the case is not physical.

    >>> lever = nanotap.Case(
    ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
    ...     sample={"stiffness": "5 N/m"},
    ...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
    ...     gap={"tip": "8 nm"},
    ...     model_units=True,
    ... )
    >>> run = nanotap.simulate(lever, periods=2)
    >>> print(f"{run.tip_max.item():.3e} g0, {nanotap.in_si(run).tip_max.item():.3e} m")
    8.270e-04 g0, 8.276e-09 m
    """
    units = _factors(json.loads(ds.attrs.get("case", "{}")))
    varies = not all(
        _keeps_units(ds, key) for key in json.loads(ds.attrs.get("over", "[]"))
    )
    changed = {}
    for name, variable in ds.variables.items():
        si = f"physical_{name_in_si(str(name))}"
        if varies and si in ds:
            changed[name] = (variable.dims, ds[si].values, dict(ds[si].attrs))
        if varies:
            continue
        factor, unit = units.get(str(variable.attrs.get("units")), (1.0, ""))
        if unit:
            attrs = {**variable.attrs, "units": unit}
            changed[name] = (variable.dims, factor * variable.values, attrs)
    coords = {name: value for name, value in changed.items() if name in ds.coords}
    rest = {name: value for name, value in changed.items() if name not in ds.coords}
    return ds.assign_coords(coords).assign(rest)
