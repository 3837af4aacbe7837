"""Results of physical cases in SI."""

import json
from typing import TYPE_CHECKING

from ._describe import name_in_si

if TYPE_CHECKING:
    import xarray as xr


def _units(ds: "xr.Dataset") -> dict[str, tuple[float, str]]:
    """The model's units in SI."""
    physical = json.loads(ds.attrs.get("case", "{}")).get("physical")
    if physical is None:
        message = "the case is not in physical quantities: it has no unit of length"
        raise ValueError(message)
    length, time = physical["length_unit"], physical["time_unit"]
    force, energy = physical["force_unit"], physical["energy_unit"]
    return {
        "g0": (length, "m"),
        "sqrt(m L^4/EI)": (time, "s"),
        "g0 sqrt(EI/(m L^4))": (length / time, "m/s"),
        "EI g0/L^3": (force, "N"),
        "EI g0^2/L^3": (energy, "J"),
        "EI g0^2/L^3 sqrt(EI/(m L^4))": (energy / time, "W"),
    }


def in_si(ds: "xr.Dataset") -> "xr.Dataset":
    """A result with its variables converted from the model's units to SI, as in sweeps of physical
    cases: a run, an orbit's series, observables over arrays of parameters, approach curves,
    branches. States, which have several units, stay in the model's units. So do variables without
    a counterpart in SI if a physical quantity varies, and with it the model's units.

    Raises:
        ValueError: the case is not physical.
    """
    units = _units(ds)
    varies = any("." in key for key in json.loads(ds.attrs.get("over", "[]")))
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
