"""Instruments' files as tables for `fit` and `reconstruct`."""

import json
import os
from typing import TYPE_CHECKING

from . import _nanotap
from ._case import Path, existing

if TYPE_CHECKING:
    import pandas as pd

# Other packages that read files, by their extensions.
_OTHERS = {
    ".gwy": "gwyfile",
    ".nhf": "NSFopen",
}


def read(path: Path) -> "pd.DataFrame":
    """A measured curve from a file, with the instrument's names of its channels and their units.

    Curves of JPK, Bruker, Asylum Research, Nanosurf, AFM Workshop, NT-MDT and Optics11 are read as
    they are, of a map the first one; every other file is read as text in columns. `fit` and
    `reconstruct` take the result as it is: they know the usual names, and say what they guess.

    Returns:
        A data frame with one column per channel. `attrs` has the notes of the file, such as
        "AmpInvOLS", "InvOLS", "SpringConstant" and "ThermalQ" in SI.

    Raises:
        FileNotFoundError: it does not exist.
        ValueError: it is not a curve, or another package reads it.
    """
    import pandas as pd

    name = existing(path)
    extension = os.path.splitext(name)[1].lower()
    if extension in _OTHERS:
        package = _OTHERS[extension]
        message = (
            f"{name}: {extension} files are read by the package {package}; "
            "pass its arrays as columns with their units"
        )
        raise ValueError(message)
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
