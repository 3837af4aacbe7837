"""Images for `image_states`: files, datasets of scans, Datasets and arrays."""

import json
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _nanotap
from ._case import existing
from ._quantity import mask_of
from ._read import read

if TYPE_CHECKING:
    import xarray as xr


def image_data(data: Any) -> dict[str, Any]:
    """Channels of an image: of a file of an instrument, a dataset (.zarr) of a scan, the result of
    `scan` or of `read(…, images=True)`, or a mapping of arrays, each name with its unit.
    """
    if isinstance(data, str | os.PathLike):
        name = existing(data)
        if not os.path.isdir(name):
            return {"name": name, **_of_dataset(read(name, images=True))}
        report = json.loads(_nanotap.summary(name))
        channels = []
        for prefix, way in (("", "trace"), ("retrace ", "retrace")):
            for channel in _SCANNED if report.get(way) else ():
                rows = report[way][channel][::-1]
                channels.append(_channel(prefix + channel, rows, report["size"]))
        return {"name": name, "channels": channels, "computed": True}
    if hasattr(data, "data_vars"):
        return _of_dataset(data)
    if isinstance(data, Mapping):
        return {"channels": [_of_array(str(k), v) for k, v in data.items()]}
    message = f"data: expected a file, a Dataset or a mapping of arrays, got {data!r}"
    raise TypeError(message)


# Channels of a scan that count, with their units.
_SCANNED = {"height": "m", "amplitude_error": "m", "phase": "deg"}
# Units of Datasets as files have them.
_UNITS = {"degree": "deg", "degrees": "deg", "1": ""}


def _channel(name: str, rows: Any, size: Any) -> dict[str, Any]:
    unit = _SCANNED[name.split()[-1]]
    return {"name": name, "unit": unit, "size": size, "rows": rows}


def _rows(name: str, values: Any) -> list[list[float | None]]:
    array = np.asarray(values, dtype=float)
    if array.ndim != 2:
        message = f"{name}: expected lines of pixels, got an array with {array.ndim} dimensions"
        raise ValueError(message)
    masked = mask_of(values)
    missing = ~np.isfinite(array) if masked is None else masked | ~np.isfinite(array)
    pixels = array.astype(object)
    pixels[missing] = None
    rows: list[list[float | None]] = pixels.tolist()
    return rows


def _of_array(header: str, values: Any) -> dict[str, Any]:
    name, _, unit = header.partition(" (")
    if not unit and hasattr(values, "attrs"):
        unit = str(values.attrs.get("units", ""))
    unit = unit.rstrip(")")
    return {"name": name, "unit": _UNITS.get(unit, unit), "rows": _rows(name, values)}


def _of_dataset(data: "xr.Dataset") -> dict[str, Any]:
    scanned = "direction" in data.dims and "amplitude_error" in data
    channels = []
    ways = [str(way) for way in data.direction.values] if scanned else [""]
    for way in ways:
        prefix = "retrace " if way == "retrace" else ""
        one = data.sel(direction=way) if scanned else data
        for name, values in one.data_vars.items():
            if (
                values.ndim != 2
                or values.dtype.kind not in "fiu"
                or (scanned and name not in _SCANNED)
            ):
                continue
            lines, points = (
                one[dim] if dim in one.coords else None for dim in values.dims
            )
            table = values.values
            # The first line is the top one.
            if (
                lines is not None
                and lines.size > 1
                and lines.values[0] < lines.values[-1]
            ):
                table = table[::-1]
            unit = str(values.attrs.get("units", ""))
            channel: dict[str, Any] = {
                "name": prefix + str(name),
                "unit": _UNITS.get(unit, unit),
                "rows": _rows(str(name), table),
            }
            if (
                lines is not None
                and points is not None
                and points.attrs.get("units") == "m"
            ):
                channel["size"] = [
                    _extent(points.values),
                    _extent(lines.values, points.values),
                ]
            channels.append(channel)
    return {"channels": channels, "computed": scanned}


def _extent(centres: Any, other: Any = None) -> float:
    """The length that pixels with these centres cover; of one line, the width of a pixel of the other."""
    if len(centres) > 1:
        return float(abs(centres[-1] - centres[0]) * len(centres) / (len(centres) - 1))
    if other is not None and len(other) > 1:
        return float(abs(other[1] - other[0]))
    return float(2 * abs(centres[0])) or 1.0
