"""Simulation of an AFM cantilever whose tip taps a sample.

A `Case` describes cantilever, sample and drive. There is a function for every command of the
terminal: `modes`, `simulate`, `orbit`, `attractors`, `sweep`, `basin`, `branch`, `approach`,
`fm`, `force_curve`, `lever`, `scan`, `calibrate`, `fit`, `fit_map`, `reconstruct`, `image_states`, `window`, `lyapunov`, `convergence`,
`contact_laws`, `paper`, `merge`. Results are xarray Datasets, objects and lists of objects, with the names of the terminal's
JSON. A `Map` is the exact stroboscopic map, for your own algorithms.

>>> import nanotap
>>> case = nanotap.Case(alpha1=0.1, alpha2=0.1, alpha3=0.1, alpha4=20, alpha6=0.2, omega=3)
>>> nanotap.orbit(case).period
1
"""

from importlib import import_module
from typing import TYPE_CHECKING

from . import _signatures
from ._case import Case, catalogue
from ._datasets import merge
from ._datasets import open as open
from ._interrupt import Interrupted
from ._map import Map, Motion, PeriodicOrbit
from ._nanotap import __version__
from ._quantity import Range
from ._read import read
from ._record import Record
from ._report import Report
from ._results import (
    Attractor,
    Attractors,
    Convergence,
    Fit,
    Lyapunov,
    Modes,
    Orbit,
    Paper,
    Reconstruction,
)
from ._si import in_si
from ._signatures import *
from ._studies import calibrate, fit_map, paper

# Like `open` not in `__all__`: `import *` would hide the builtin.
range = Range

if TYPE_CHECKING:
    from . import export, plot
    from ._study_dataset import StudyDataset

__all__ = [
    "Attractor",
    "Attractors",
    "Case",
    "Convergence",
    "Fit",
    "Interrupted",
    "Lyapunov",
    "Map",
    "Modes",
    "Motion",
    "Orbit",
    "Paper",
    "PeriodicOrbit",
    "Reconstruction",
    "Record",
    "Report",
    "StudyDataset",
    "__version__",
    "calibrate",
    "catalogue",
    "export",
    "fit_map",
    "in_si",
    "merge",
    "paper",
    "plot",
    "read",
]


__all__ += _signatures.__all__


def __getattr__(name: str) -> object:
    # Nor is xarray loaded before it is used.
    if name == "StudyDataset":
        return import_module("._study_dataset", __name__).StudyDataset
    # matplotlib and pyarrow take longer to import than everything else together.
    if name in {"plot", "export"}:
        try:
            return import_module(f".{name}", __name__)
        except ModuleNotFoundError as error:
            # Reported as a missing attribute, so that `help` and `dir` work without it.
            message = f"nanotap.{name} needs {error.name}: pip install {error.name}"
            raise AttributeError(message) from error
    message = f"module 'nanotap' has no attribute {name!r}"
    raise AttributeError(message)


def __dir__() -> list[str]:
    return sorted([*__all__, "open", "range"])
