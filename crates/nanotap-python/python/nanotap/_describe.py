"""Names and units of the entries of results."""

import json
from collections.abc import Mapping
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from . import _nanotap

if TYPE_CHECKING:
    import xarray as xr
    from xarray.indexes import PandasIndex

    from ._case import Case
    from ._study_dataset import StudyDataset

Described = TypeVar("Described", bound="xr.Dataset")

_GLOSSARY = json.loads(_nanotap.glossary())


@cache
def name_in_si(name: str) -> str:
    """Name of an entry among quantities in SI."""
    words = _GLOSSARY["model"].get(name, {}).get("words")
    others = (
        si for si, entry in _GLOSSARY["physical"].items() if entry["words"] == words
    )
    return next(others, name)


@cache
def _attributes(name: str) -> dict[str, str]:
    """`long_name` and `units` of an entry; empty if unknown."""
    # The points of branches and of bifurcations have the observables of motions.
    prefixes = (
        "bifurcation_",
        "branch_",
        "coexisting_",
        "attractor_",
        "event_",
        "locus_",
    )
    for before in prefixes:
        if name not in _GLOSSARY["model"]:
            name = name.removeprefix(before)
    physical = name.startswith("physical_")
    words = _GLOSSARY["physical" if physical else "model"]
    inner = name.removeprefix("physical_")
    if inner not in words and not physical:
        return {}
    entry = words.get(inner, {"words": inner, "unit": "1"})
    return {"long_name": entry["words"], "units": entry["unit"]}


def describe(ds: Described) -> Described:
    """The same Dataset, every variable with `long_name` and `units` if known."""
    for name, variable in ds.variables.items():
        for key, text in _attributes(str(name)).items():
            variable.attrs.setdefault(key, text)
    return ds


@cache
def _schema(study: str) -> dict[str, Any]:
    """The JSON schema of a study's report."""
    schema: dict[str, Any] = json.loads(_nanotap.report_schema(study))
    return schema


@cache
def declared(study: str, rows: str) -> dict[str, dict[str, str]]:
    """`long_name` and `units` of the columns of a report's rows, as Rust declares them."""
    return {
        name: {"long_name": one["x-label"].split(" $")[0], "units": one["x-unit"]}
        for name, one in _schema(study)["$defs"][rows]["properties"].items()
        if "x-label" in one
    }


@cache
def fields(study: str, part: str) -> dict[str, tuple[str, str]]:
    """The entries of a part of a report (the report itself without a name): the unit of each and
    the part that describes it, as Rust declares them; empty where there is none."""
    whole = _schema(study)
    name, *inside = part.split("/")
    node = whole["$defs"].get(name, {}) if name else whole
    for entry in inside:
        node = node["properties"][entry]
    found: dict[str, tuple[str, str]] = {}
    for choice in node.get("anyOf", ()):
        found |= fields(study, _part(choice)) if _part(choice) else {}
    for name, one in node.get("properties", {}).items():
        inner = f"{part}/{name}" if "properties" in one else _part(one)
        # Energies have the unit of their balance.
        found[name] = (one.get("x-unit", node.get("x-unit", "")), inner)
    return found


def _part(node: Mapping[str, Any]) -> str:
    """The part of a schema that describes a value or its items, or with a star each entry of it."""
    if isinstance(inner := node.get("items"), dict):
        return _part(inner)
    if isinstance(inner := node.get("additionalProperties"), dict):
        return f"*{_part(inner)}"
    choices = [*node.get("anyOf", ()), *node.get("oneOf", ())]
    names = (node.get("$ref", ""), *(choice.get("$ref", "") for choice in choices))
    return next((name.rsplit("/", 1)[-1] for name in names if name), "")


def observable_unit(name: str, in_si: bool) -> str:
    """The unit of an observable in SI or in the model's units; empty if it is none."""
    words = _GLOSSARY["physical" if in_si else "model"]
    return str(words.get(name_in_si(name) if in_si else name, {}).get("unit", ""))


@lru_cache(maxsize=64)
def _labels(dim: str, names: tuple[str, ...]) -> "PandasIndex":
    """A cached index of labels: making one takes longer than many motions."""
    import pandas as pd
    from xarray.indexes import PandasIndex

    return PandasIndex(pd.Index(np.array(names)), dim)


def dataset(
    variables: Mapping[str, Any],
    coords: Mapping[str, Any],
    attributes: Mapping[str, Any],
) -> "StudyDataset":
    """A described Dataset of variables and coordinates, each as `(dims, values)` or
    `(dims, values, attributes)`; a plain array is the coordinate of a dimension. Its parts
    are prepared here, which takes half the time of xarray.
    """
    import pandas as pd
    import xarray as xr
    from xarray.indexes import PandasIndex

    from ._study_dataset import StudyDataset

    made: dict[str, xr.Variable] = {}
    own: dict[str, xr.Variable] = {}
    indexes: dict[str, PandasIndex] = {}
    for name, given in (*variables.items(), *coords.items()):
        dims, values, *more = given if isinstance(given, tuple) else (name, given)
        variable = xr.Variable(dims, values, _attributes(name) | dict(*more))
        if variable.dims == (name,):
            array = np.asarray(values)
            if array.dtype.kind == "U":
                index = _labels(name, tuple(array.tolist()))
            else:
                index = PandasIndex(pd.Index(array), name)
            indexes[name] = index
            own |= index.create_variables({name: variable})
        elif name in coords:
            own[name] = variable
        else:
            made[name] = variable
    return StudyDataset(made, xr.Coordinates(own, indexes), attributes)


def described(name: str) -> str:
    """Description of an entry; empty if there is none."""
    return str(_GLOSSARY["model"].get(name, {}).get("words", ""))


def case_attributes(case: "Case", title: str) -> dict[str, str]:
    """Attributes of a Dataset that state its origin."""
    from ._nanotap import __version__

    return {
        "title": title,
        "nanotap_version": __version__,
        "case": case._core.document_at_setpoint,
    }
