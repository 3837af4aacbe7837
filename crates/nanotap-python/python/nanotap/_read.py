"""Instruments' files: tables for `fit` and `reconstruct`, and Datasets of all that they hold."""

import json
import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
import numpy.typing as npt

from . import _nanotap
from ._case import Path, existing

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

# Other packages that read files, by their extensions.
_OTHERS = {".nhf": "NSFopen"}
# Most numbers of a Dataset of curves: 2 GB.
_MAX_NUMBERS = 1 << 28

_Curves = int | Iterable[int] | Literal["all"]


@overload
def read(path: Path) -> "pd.DataFrame": ...
@overload
def read(path: Path, *, curve: _Curves) -> "xr.Dataset": ...
@overload
def read(path: Path, *, images: Literal[True]) -> "xr.Dataset": ...
@overload
def read(path: Path, *, spectra: Literal[True]) -> "xr.Dataset": ...
def read(
    path: Path,
    *,
    curve: _Curves | None = None,
    images: bool = False,
    spectra: bool = False,
) -> "pd.DataFrame | xr.Dataset":
    """A file of an instrument, or a table of measured values.

    Files of JPK, Bruker, Asylum Research, Nanosurf, Gwyddion, AFM Workshop, NT-MDT, Optics11 and
    afmformats are read as they are, recognised by their content; every other file as text in columns.

    Without further arguments it is a table of one curve, of a map the first one, which `fit` and
    `reconstruct` take as it is: they know the usual names, and say what they guess.

    Args:
        path: the file.
        curve: curves as a Dataset: the number of one, counted from 0, several, or "all". Each channel
            is a variable in SI along `point`; `segment` says of each point whether it belongs to an
            approach, a pause or a retract. Several curves lie along `curve`, each filled up with NaN,
            with their positions `x` and `y`.
        images: all images as a Dataset, each along `y` and `x`.
        spectra: all spectra as a Dataset.

    Returns:
        A data frame with one column per channel; `attrs` has the notes of the file, such as
        "AmpInvOLS", "InvOLS", "SpringConstant" and "ThermalQ" in SI. Or a Dataset, whose `attrs` have
        spring constant and sensitivity, the channels that are distance and deflection, the
        instrument's notes and settings; `to_netcdf` writes it.

    Raises:
        FileNotFoundError: it does not exist.
        ValueError: it is not such a file, has no such curve, or another package reads it.

    >>> with open("curve.csv", "w") as file:
    ...     size = file.write("distance (nm),amplitude (nm)\\n8,7.5\\n9,8.5\\n")
    >>> nanotap.read("curve.csv")["amplitude (nm)"].tolist()
    [7.5, 8.5]
    """
    name = existing(path)
    extension = os.path.splitext(name)[1].lower()
    if extension in _OTHERS:
        package = _OTHERS[extension]
        message = (
            f"{name}: {extension} files are read by the package {package}; "
            "pass its arrays as columns with their units"
        )
        raise ValueError(message)
    if curve is not None or images or spectra:
        file = _nanotap.FileCore(name)
        about = json.loads(file.about)
        if curve is not None:
            return _curves(name, file, about, curve)
        return _images(file, about) if images else _spectra(file, about)
    import pandas as pd

    table = json.loads(_nanotap.table(name))
    frame = pd.DataFrame(table["columns"])
    notes = table.get("notes", {})
    frame.attrs.update({note: _number(value) for note, value in notes.items()})
    return frame


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _attributes(about: dict[str, Any], notes: Sequence[str]) -> dict[str, Any]:
    """What a Dataset says of its file."""
    known = {"format": about["format"], "kind": about["kind"]}
    known["notes"] = "\n".join([*about["notes"], *notes])
    known["settings"] = json.dumps(dict(about["settings"])) if about["settings"] else ""
    return {name: value for name, value in known.items() if value}


def _units(unit: str, name: str) -> dict[str, str]:
    return {"units": unit, "long_name": name} if unit else {"long_name": name}


def _curves(
    name: str, file: _nanotap.FileCore, about: dict[str, Any], which: _Curves
) -> "xr.Dataset":
    count = about["curves"]
    if which == "all":
        which = range(count)
    if isinstance(which, int | np.integer):
        number = int(which)
        return _curve(file, about, number + count if number < 0 else number)
    import xarray as xr

    curves = []
    size = 0
    for number in which:
        curves.append(_curve(file, about, int(number)))
        size = max(size, len(curves[-1].data_vars) * curves[-1].sizes["point"])
        if size * len(curves) > _MAX_NUMBERS:
            message = (
                f"{name}: {count} curves are too many numbers at once; "
                "take some of them, as in curve=range(100)"
            )
            raise ValueError(message)
    if not curves:
        raise ValueError(f"{name}: no curve; it has {count}")
    # Curves of a map may have different lengths.
    joined = xr.concat(
        curves, "curve", join="outer", combine_attrs="drop_conflicts", fill_value=np.nan
    )
    joined["segment"] = joined["segment"].fillna("").astype(str)
    if about["grid"]:
        joined.attrs["grid_shape"] = about["grid"]["shape"]
        joined.attrs["grid_size"] = about["grid"]["size"]
    return joined


def _curve(file: _nanotap.FileCore, about: dict[str, Any], number: int) -> "xr.Dataset":
    import xarray as xr

    text, arrays = file.curve(number)
    curve = json.loads(text)
    segments = curve["segments"]
    units: dict[str, str] = {}
    for segment in segments:
        units |= dict(segment["channels"])
    variables = {}
    for channel, unit in units.items():
        parts = []
        for segment, values in zip(segments, arrays, strict=True):
            names = [own for own, _ in segment["channels"]]
            there = values[names.index(channel)] if channel in names else None
            absent = np.full(segment["points"], np.nan)
            parts.append(absent if there is None else there)
        numbers = np.concatenate(parts) if parts else np.empty(0)
        variables[channel] = ("point", numbers, _units(unit, channel))
    styles = [segment["style"] for segment in segments]
    points = [segment["points"] for segment in segments]
    coordinates: dict[str, Any] = {
        "curve": number,
        "point": np.arange(sum(points)),
        "segment": ("point", np.repeat(np.array(styles, dtype=str), points)),
    }
    if curve["position"] is not None:
        for axis, place in zip("xy", curve["position"], strict=True):
            coordinates[axis] = ((), place, _units("m", f"lateral position {axis}"))
    attributes = _attributes(about, curve["notes"])
    for own in ("spring_constant", "sensitivity", "distance", "distance_source"):
        if curve[own] is not None:
            attributes[own] = curve[own]
    if curve["deflection"] is not None:
        attributes["deflection"] = curve["deflection"]
    return xr.Dataset(variables, coordinates, attributes)


def _images(file: _nanotap.FileCore, about: dict[str, Any]) -> "xr.Dataset":
    import xarray as xr

    variables = {}
    shapes: dict[tuple[int, int, tuple[float, ...]], str] = {}
    coordinates: dict[str, Any] = {}
    for text, values in file.images():
        image = json.loads(text)
        columns, lines = image["shape"]
        size = tuple(image["size"] or (columns, lines))
        # Images of another size have axes of their own.
        end = shapes.setdefault((columns, lines, size), f"_{len(shapes) + 1}")
        end = "" if end == "_1" else end
        unit = "m" if image["size"] else ""
        for axis, points, length in (("x", columns, size[0]), ("y", lines, size[1])):
            places = (np.arange(points) + 0.5) * length / points
            # Lines begin at the top.
            places = places if axis == "x" else places[::-1]
            coordinates[axis + end] = (axis + end, places, _units(unit, axis))
        name = image["name"]
        while name in variables:
            name += "'"
        table = values.reshape(lines, columns)
        attributes = _units(image["unit"], image["name"])
        variables[name] = ((f"y{end}", f"x{end}"), table, attributes)
    return xr.Dataset(variables, coordinates, _attributes(about, []))


def _spectra(file: _nanotap.FileCore, about: dict[str, Any]) -> "xr.Dataset":
    import xarray as xr

    variables = {}
    coordinates: dict[str, Any] = {}
    known: list[npt.NDArray[np.float64]] = []
    for text, frequency, values in file.spectra():
        spectrum = json.loads(text)
        same = [k for k, other in enumerate(known) if np.array_equal(other, frequency)]
        if not same:
            known.append(frequency)
        number = same[0] if same else len(known) - 1
        axis = "frequency" if number == 0 else f"frequency_{number + 1}"
        coordinates[axis] = (axis, frequency, _units("Hz", "frequency"))
        name = spectrum["name"] or "spectrum"
        while name in variables:
            name += "'"
        variables[name] = (axis, values, _units(spectrum["unit"], name))
    return xr.Dataset(variables, coordinates, _attributes(about, []))
