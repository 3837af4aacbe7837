"""What the entries of results are called, and their units."""

import json
from typing import TYPE_CHECKING

from . import _nanotap

if TYPE_CHECKING:
    import xarray as xr

    from ._case import Case

_GLOSSARY = json.loads(_nanotap.glossary())


def describe(ds: "xr.Dataset") -> "xr.Dataset":
    """The same Dataset, every variable with `long_name` and `units` where they are known."""
    for name, variable in ds.variables.items():
        key = str(name)
        physical = key.startswith("physical_")
        words = _GLOSSARY["physical" if physical else "model"]
        inner = key.removeprefix("physical_")
        if inner in words or physical:
            entry = words.get(inner, {"words": inner, "unit": "1"})
            variable.attrs.setdefault("long_name", entry["words"])
            variable.attrs.setdefault("units", entry["unit"])
    return ds


def described(name: str, *, physical: bool) -> tuple[str, str]:
    """The words for an entry and its unit; empty where there are none."""
    entry = _GLOSSARY["physical" if physical else "model"].get(name, {})
    return str(entry.get("words", "")), str(entry.get("unit", ""))


def case_attributes(case: "Case", title: str) -> dict[str, str]:
    """What a Dataset says of its origin."""
    from ._nanotap import __version__

    return {
        "title": title,
        "nanotap_version": __version__,
        "case": case._core.document_at_setpoint,
    }
