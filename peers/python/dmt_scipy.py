"""SciPy's DOP853 on a lever over a DMT sample, with the edge of contact as an event."""

import dmt
import numpy as np
from scipy.integrate import solve_ivp


def make(count: int, tolerance: float):
    stiffness, damping, sign = dmt.modes(count)
    adhesion = dmt.ATTRACTION / dmt.CONTACT**2

    def rate(t, y):
        gap = dmt.DISTANCE + sign @ y[:count]
        depth = dmt.CONTACT - gap
        force = (
            dmt.HERTZ * depth * np.sqrt(depth) - adhesion
            if depth > 0
            else -dmt.ATTRACTION / gap**2
        )
        push = dmt.AMPLITUDE / dmt.QUALITY * np.cos(t) + force / dmt.STIFFNESS
        bent = sign * push - damping * y[count:] - stiffness * y[:count]
        return np.concatenate([y[count:], bent])

    def edge(t, y):
        return dmt.DISTANCE + sign @ y[:count] - dmt.CONTACT

    edge.terminal = True

    def period(state: np.ndarray) -> np.ndarray:
        now, touches = 0.0, edge(0.0, state) < 0
        while now < dmt.PERIOD:
            # Only the way out of where the motion is: it may begin at the edge to rounding.
            edge.direction = 1 if touches else -1
            done = solve_ivp(
                rate,
                (now, dmt.PERIOD),
                state,
                method="DOP853",
                rtol=tolerance,
                atol=tolerance,
                events=edge,
            )
            now, state = done.t[-1], done.y[:, -1]
            touches = not touches
        return state

    return period


if __name__ == "__main__":
    dmt.do(make)
