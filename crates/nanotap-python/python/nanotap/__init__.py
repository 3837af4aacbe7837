"""What an AFM cantilever does when its tip taps a sample.

A `Case` says which cantilever, sample and drive; a function for every command of the
terminal says what it does: `modes`, `simulate`, `orbit`, `attractors`, `sweep`, `basin`,
`branch`, `lyapunov`, `convergence`, `paper`, `merge`. Results carry the names that the
terminal's JSON has, as xarray Datasets, objects and lists of objects.

>>> import nanotap
>>> case = nanotap.Case(alpha1=0.1, alpha2=0.1, alpha3=0.1, alpha4=20, alpha6=0.2, omega=3)
>>> nanotap.orbit(case).period
1
"""

from ._case import Case, catalogue
from ._datasets import basin, merge, open, sweep
from ._interrupt import Interrupted
from ._motions import modes, orbit, simulate
from ._nanotap import __version__
from ._results import (
    Attractor,
    Attractors,
    Convergence,
    Lyapunov,
    Modes,
    Orbit,
    Paper,
    Record,
)
from ._studies import attractors, branch, convergence, lyapunov, paper

__all__ = [
    "Attractor",
    "Attractors",
    "Case",
    "Convergence",
    "Interrupted",
    "Lyapunov",
    "Modes",
    "Orbit",
    "Paper",
    "Record",
    "__version__",
    "attractors",
    "basin",
    "branch",
    "catalogue",
    "convergence",
    "lyapunov",
    "merge",
    "modes",
    "open",
    "orbit",
    "paper",
    "simulate",
    "sweep",
]
