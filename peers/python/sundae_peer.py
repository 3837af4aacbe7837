"""scikit-sundae: SUNDIALS' CVODE from Python, with an event function on the gap.

The setting is the tolerance, relative and absolute.
"""

from collections.abc import Iterator
from math import cos, sin

import numpy as np
import work
from cantilever import cantilever
from sksundae.cvode import CVODE

PERIODS_A_CALL = 20


def follow(
    asked, omegas: np.ndarray, starts: np.ndarray, periods: int
) -> Iterator[np.ndarray]:
    system, y, t = cantilever(omegas[0]), starts[0], 0.0
    regime = system.regime_at(t, y)

    def rates(t, y, dy):
        s, c = sin(system.omega * t), cos(system.omega * t)
        dy[:] = system.matrix[regime] @ y + (
            system.sine[regime] * s + system.cosine[regime] * c
        )

    def gap(t, y, value):
        value[0] = system.gap(t, y)

    gap.terminal = [True]
    done = 0
    while done < periods:
        gap.direction = [1 if regime else -1]
        solver = CVODE(
            rates,
            method=asked.method,
            rtol=asked.setting,
            atol=asked.setting,
            eventsfn=gap,
            num_events=1,
            max_num_steps=1_000_000,
        )
        last = min(periods, done + PERIODS_A_CALL)
        times = np.concatenate([[t], np.arange(done + 1, last + 1) * system.period])
        result = solver.solve(times, y)
        for time, state in zip(result.t[1:], result.y[1:], strict=True):
            # The event itself may stand in the list too.
            if abs(time - (done + 1) * system.period) < 1e-10 and done < periods:
                done += 1
                yield state[np.newaxis]
        t, y = float(result.t[-1]), np.array(result.y[-1])
        if result.t_events is not None and len(result.t_events):
            t = float(result.t_events[-1])
            y = np.array(result.y_events[-1]).ravel()
            regime = 1 - regime


if __name__ == "__main__":
    ASKED = work.options("Adams", "BDF")
    work.do(ASKED, lambda *what: follow(ASKED, *what))
