"""heyoka on a lever over a DMT sample: one integrator in flight, one in contact."""

import dmt
import heyoka as hy
import numpy as np

# The root of the indentation has no series where it begins: contact is entered and left a hair
# inside, by less than 1e-9 of the swing.
INSIDE = 1e-10


def make(count: int, tolerance: float):
    stiffness, damping, sign = dmt.modes(count)
    x = [hy.make_vars(f"x{n}") for n in range(count)]
    v = [hy.make_vars(f"v{n}") for n in range(count)]
    gap = dmt.DISTANCE + sum(float(s) * a for s, a in zip(sign, x, strict=True))
    depth = dmt.CONTACT - gap

    def integrator(force, event):
        push = dmt.AMPLITUDE / dmt.QUALITY * hy.cos(hy.time) + force / dmt.STIFFNESS
        rate = [
            float(sign[n]) * push
            - float(damping[n]) * v[n]
            - float(stiffness[n]) * x[n]
            for n in range(count)
        ]
        equations = [*zip(x, v, strict=True), *zip(v, rate, strict=True)]
        return hy.taylor_adaptive(
            equations, [0.0] * (2 * count), tol=tolerance, t_events=[event]
        )

    falls = hy.t_event(depth - INSIDE, direction=hy.event_direction.positive)
    rises = hy.t_event(depth - 0.5 * INSIDE, direction=hy.event_direction.negative)
    flight = integrator(-dmt.ATTRACTION / gap**2, falls)
    adhesion = dmt.ATTRACTION / dmt.CONTACT**2
    contact = integrator(dmt.HERTZ * depth * hy.sqrt(depth) - adhesion, rises)

    def period(state: np.ndarray) -> np.ndarray:
        touches = dmt.DISTANCE + sign @ state[:count] < dmt.CONTACT
        now = 0.0
        while now < dmt.PERIOD:
            used = contact if touches else flight
            used.time = now
            used.state[:] = state
            used.reset_cooldowns()
            used.propagate_until(dmt.PERIOD)
            state, now = used.state.copy(), used.time
            touches = not touches
        return state

    return period


if __name__ == "__main__":
    dmt.do(make)
