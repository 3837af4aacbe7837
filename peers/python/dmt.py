"""A lever of N modes over a DMT sample, as `dmt_peer` of nanotap-volterra has it.

x_n'' + (β_n/β_1)²/Q x_n' + (β_n/β_1)⁴ x_n = s_n (A₀/Q cos t + F(d)/k), d = zc + Σ s_n x_n,
s_n = ±1 in turn; lengths in nm, forces in nN, times in 1/ω₀. F is Hertz's less H R/(6 a0²) for
d < a0, and −H R/(6 d²) beyond.
"""

import json
import sys
import time
from collections.abc import Callable

import numpy as np

STIFFNESS, QUALITY, AMPLITUDE, DISTANCE = 0.9, 200.0, 20.0, 18.0
RADIUS, CONTACT, HAMAKER = 5.0, 0.169, 0.03
MODULUS = 1 / ((1 - 0.3**2) / 1.0 + (1 - 0.3**2) / 160.0)
HERTZ = 4 / 3 * MODULUS * RADIUS**0.5
ATTRACTION = HAMAKER * RADIUS / 6
PERIOD = 2 * np.pi
START = (7.0048, 17.1408)
COMPARED = (5, 10, 20)

# Roots of cos β cosh β = −1; beyond the fourth (n − ½)π to rounding.
ROOTS = [1.875104068711961, 4.694091132974175, 7.854757438237613, 10.995540734875467]


def modes(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stiffness and damping over mass, and the sign at the tip, of every mode."""
    roots = [ROOTS[n] if n < 4 else (n + 0.5) * np.pi for n in range(count)]
    ratio = (np.array(roots) / roots[0]) ** 2
    return ratio**2, ratio / QUALITY, (-1.0) ** np.arange(count)


def do(make: Callable[[int, float], Callable[[np.ndarray], np.ndarray]]) -> None:
    """Runs what `make` makes for a number of modes and a tolerance: a period from a state."""
    count, tolerance, seconds = int(sys.argv[1]), *map(float, sys.argv[2:4])
    period = make(count, tolerance)
    state = np.zeros(2 * count)
    state[0], state[count] = START
    states = []
    for k in range(1, COMPARED[-1] + 1):
        state = period(state)
        if k in COMPARED:
            states.append(state.tolist())
    begun, periods = time.process_time(), 0
    while time.process_time() - begun < seconds:
        state = period(state)
        periods += 1
    rate = periods / (time.process_time() - begun)
    print(json.dumps({"states": states, "rate": rate}))
