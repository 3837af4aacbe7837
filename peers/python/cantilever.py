"""The cantilever with three modes, Eqs. (10)-(18), for the Python peers.

Regime 0 is free flight, regime 1 contact; a state is (a_1, a_2, a_3, and their rates).
"""

from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np

MODES = 3
OMEGA = 2.6
ALPHA = {1: 0.1, 2: 0.1, 3: 0.1, 4: 20.0, 5: 0.0, 6: 0.2}

BETA = np.array([1.8751040687119611664, 4.6940911329741745764, 7.8547574382376125649])
SIGMA = (np.cosh(BETA) + np.cos(BETA)) / (np.sinh(BETA) + np.sin(BETA))
TIP = np.array([2.0, -2.0, 2.0])
INTEGRAL = 2 * SIGMA / BETA


@dataclass
class Cantilever:
    """x' = matrix x + sine sin(omega t) + cosine cos(omega t), by regime."""

    omega: float
    matrix: list[np.ndarray]
    sine: list[np.ndarray]
    cosine: list[np.ndarray]

    @property
    def period(self) -> float:
        return 2 * pi / self.omega

    def gap(self, t: float, y: np.ndarray) -> float:
        """Eq. (8)."""
        w = 2 * (y[0] - y[1] + y[2])
        return w + ALPHA[2] * sin(self.omega * t) + ALPHA[5]

    def gap_rate(self, t: float, y: np.ndarray) -> float:
        w = 2 * (y[3] - y[4] + y[5])
        return w + ALPHA[2] * self.omega * cos(self.omega * t)

    def regime_at(self, t: float, y: np.ndarray) -> int:
        """On the surface the gap's rate decides (from rest: free flight)."""
        gap = self.gap(t, y)
        return int(self.gap_rate(t, y) <= 0 if gap == 0 else gap < 0)


def cantilever(omega: float = OMEGA) -> Cantilever:
    """The paper's parameters, Eq. (26), with a tip mass."""
    load = np.outer(TIP, TIP)
    mass = np.linalg.inv(np.eye(MODES) + ALPHA[1] * load)
    stiffness, damping = np.diag(BETA**4), ALPHA[3] * np.eye(MODES)
    sine = ALPHA[2] * omega**2 * (ALPHA[1] * TIP + INTEGRAL)
    cosine = -ALPHA[2] * ALPHA[3] * omega * INTEGRAL
    result = Cantilever(omega, [], [], [])
    for contact in (0.0, 1.0):
        k = stiffness + contact * ALPHA[4] * load
        c = damping + contact * ALPHA[6] * load
        s = sine - contact * ALPHA[2] * ALPHA[4] * TIP
        o = cosine - contact * ALPHA[2] * ALPHA[6] * omega * TIP
        top = np.hstack([np.zeros((MODES, MODES)), np.eye(MODES)])
        result.matrix.append(np.vstack([top, np.hstack([-mass @ k, -mass @ c])]))
        result.sine.append(np.concatenate([np.zeros(MODES), mass @ s]))
        result.cosine.append(np.concatenate([np.zeros(MODES), mass @ o]))
    return result
