"""Instruments' files as tables for `fit` and `reconstruct`."""

import json
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _nanotap
from ._case import Path, existing

if TYPE_CHECKING:
    import pandas as pd

# Beginnings of the names of Asylum Research's channels in m; their numbers are written in nm.
_LENGTHS = ("amp", "defl", "lvdt", "raw", "zsnsr")
# Other packages that read files, by their extensions.
_OTHERS = {
    ".gwy": "gwyfile",
    ".jpk-force": "afmformats",
    ".nhf": "NSFopen",
    ".nid": "NSFopen",
    ".spm": "afmformats",
}


def read(path: Path) -> "pd.DataFrame":
    """A measured curve from a file, with the instrument's names of its channels and their units.

    Asylum Research's `.ibw` files need the package igor2, which `pip install 'nanotap[readers]'`
    installs; every other file is read as text in columns. `fit` and `reconstruct` take the result as
    it is: they know the usual names, and say what they guess.

    Returns:
        A data frame with one column per channel. `attrs` has the notes of the file, such as
        "AmpInvOLS", "SpringConstant" and "ThermalQ" in SI.

    Raises:
        FileNotFoundError: it does not exist.
        ValueError: it is not a curve, or another package reads it.
        ModuleNotFoundError: igor2 is missing.
    """
    import pandas as pd

    name = existing(path)
    extension = os.path.splitext(name)[1].lower()
    if extension == ".ibw":
        return _ibw(name)
    if extension in _OTHERS:
        package = _OTHERS[extension]
        message = (
            f"{name}: {extension} files are read by the package {package}; "
            "pass its arrays as columns with their units"
        )
        raise ValueError(message)
    table = json.loads(_nanotap.table(name))
    return pd.DataFrame(table["columns"])


def _ibw(name: str) -> "pd.DataFrame":
    import pandas as pd

    try:
        from igor2.binarywave import load
    except ModuleNotFoundError as error:
        message = f"{name} needs the package igor2: pip install 'nanotap[readers]'"
        raise ModuleNotFoundError(message, name="igor2") from error
    wave: dict[str, Any] = load(name)["wave"]
    data = np.asarray(wave["wData"], dtype=float)
    labels = wave.get("labels") or []
    channels = [_text(label) for label in labels[1][1:]] if len(labels) > 1 else []
    if data.ndim != 2 or data.shape[1] != len(channels):
        shape = " × ".join(str(size) for size in data.shape)
        message = f"{name} is not a curve: expected one column per channel, got {shape} values"
        raise ValueError(message)
    frame = pd.DataFrame(
        {
            _heading(c): column * _factor(c)
            for c, column in zip(channels, data.T, strict=True)
        }
    )
    # Rows that were not recorded.
    frame = frame.dropna().reset_index(drop=True)
    frame.attrs.update(_notes(_text(wave.get("note", b""))))
    return frame


def _heading(channel: str) -> str:
    """The name of a channel with the unit of its column."""
    if channel.lower().startswith(_LENGTHS):
        return f"{channel} (nm)"
    return f"{channel} (deg)" if channel.lower().startswith("phas") else channel


def _factor(channel: str) -> float:
    """The unit in which the file has a channel, in that of its column."""
    return 1e9 if channel.lower().startswith(_LENGTHS) else 1.0


def _notes(text: str) -> dict[str, float | str]:
    """The lines `NAME: VALUE` of a note."""
    notes: dict[str, float | str] = {}
    for line in text.replace("\r", "\n").splitlines():
        name, separator, value = line.partition(":")
        if not separator or not name.strip():
            continue
        try:
            notes[name.strip()] = float(value)
        except ValueError:
            notes[name.strip()] = value.strip()
    return notes


def _text(value: Any) -> str:
    return value.decode("latin-1") if isinstance(value, bytes) else str(value)
