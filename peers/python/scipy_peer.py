"""SciPy's solve_ivp with a terminal event on the gap, restarted in the other regime.

The setting is the tolerance, relative and absolute.
"""

from collections.abc import Iterator
from math import cos, sin

import numpy as np
import work
from cantilever import Cantilever, cantilever
from scipy.integrate import solve_ivp

# Periods asked for in one call: solve_ivp stores what it is asked for.
PERIODS_A_CALL = 50


def rates(system: Cantilever, regime: int):
    matrix, s, c = system.matrix[regime], system.sine[regime], system.cosine[regime]
    omega = system.omega
    return lambda t, y: matrix @ y + (s * sin(omega * t) + c * cos(omega * t))


def exit_of(system: Cantilever, regime: int):
    """The gap as the event that ends a regime."""

    def event(t, y):
        return system.gap(t, y)

    event.terminal = True
    event.direction = 1 if regime else -1
    return event


def follow(
    asked, omegas: np.ndarray, starts: np.ndarray, periods: int
) -> Iterator[np.ndarray]:
    system, y, t = cantilever(omegas[0]), starts[0], 0.0
    regime = system.regime_at(t, y)
    flows = [rates(system, 0), rates(system, 1)]
    exits = [exit_of(system, 0), exit_of(system, 1)]
    done = 0
    while done < periods:
        last = min(periods, done + PERIODS_A_CALL)
        ends = np.arange(done + 1, last + 1) * system.period
        result = solve_ivp(
            flows[regime],
            (t, ends[-1]),
            y,
            method=asked.method,
            rtol=asked.setting,
            atol=asked.setting,
            events=exits[regime],
            t_eval=ends,
        )
        if result.status < 0:
            raise RuntimeError(result.message)
        # What was reached before an event; nothing comes as an empty list.
        reached = np.asarray(result.y).T if len(result.t) else []
        for state in reached:
            done += 1
            yield state[np.newaxis]
        if result.status == 1:
            t, y = result.t_events[0][0], result.y_events[0][0]
            regime = 1 - regime
        else:
            t, y = ends[-1], result.y[:, -1]


if __name__ == "__main__":
    ASKED = work.options("DOP853", "RK45", "LSODA")
    work.do(ASKED, lambda *what: follow(ASKED, *what))
