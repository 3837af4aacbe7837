"""heyoka: a Taylor integrator compiled for the model, with an event on the gap.

Method `one` follows a motion at a time, `batch` eight side by side. The setting is the
tolerance.
"""

from collections.abc import Iterator

import heyoka
import numpy as np
import work
from cantilever import ALPHA, BETA, INTEGRAL, MODES, TIP, cantilever

BATCH = 8


def equations():
    """The equations of motion and the gap; par[0] is 1 in contact, par[1] is omega."""
    x = [heyoka.make_vars(f"x{i}") for i in range(MODES)]
    v = [heyoka.make_vars(f"v{i}") for i in range(MODES)]
    contact, omega = heyoka.par[0], heyoka.par[1]
    s, c = heyoka.sin(omega * heyoka.time), heyoka.cos(omega * heyoka.time)
    tip, stiffness = [float(p) for p in TIP], [float(b) for b in BETA**4]
    integral = [float(i) for i in INTEGRAL]
    gap = sum(p * a for p, a in zip(tip, x, strict=True)) + ALPHA[2] * s + ALPHA[5]
    rate = sum(p * a for p, a in zip(tip, v, strict=True)) + ALPHA[2] * omega * c
    pressed = contact * (ALPHA[4] * gap + ALPHA[6] * rate)
    force = [
        ALPHA[2] * omega * omega * (ALPHA[1] * tip[i] + integral[i]) * s
        - ALPHA[2] * ALPHA[3] * integral[i] * omega * c
        - stiffness[i] * x[i]
        - ALPHA[3] * v[i]
        - tip[i] * pressed
        for i in range(MODES)
    ]
    share = ALPHA[1] / (1 + ALPHA[1] * float(TIP @ TIP))
    mass = share * sum(p * f for p, f in zip(tip, force, strict=True))
    motion = [(x[i], v[i]) for i in range(MODES)]
    motion += [(v[i], force[i] - tip[i] * mass) for i in range(MODES)]
    return motion, gap


def regime_at(omega: float, y: np.ndarray) -> float:
    return float(cantilever(omega).regime_at(0.0, y))


class One:
    """One motion at a time."""

    lanes = 1

    def __init__(self, tolerance: float):
        motion, gap = equations()

        def switch(integrator, direction):
            integrator.pars[0] = 1.0 if direction < 0 else 0.0
            return True

        self.integrator = heyoka.taylor_adaptive(
            motion,
            [0.0] * (2 * MODES),
            pars=[0.0, 1.0],
            tol=tolerance,
            t_events=[heyoka.t_event(gap, callback=switch)],
            compact_mode=False,
        )

    def follow(
        self, omegas: np.ndarray, starts: np.ndarray, periods: int
    ) -> Iterator[np.ndarray]:
        integrator, omega = self.integrator, omegas[0]
        integrator.time = 0.0
        integrator.state[:] = starts[0]
        integrator.pars[:] = [regime_at(omega, starts[0]), omega]
        integrator.reset_cooldowns()
        for k in range(1, periods + 1):
            integrator.propagate_until(k * 2 * np.pi / omega)
            yield integrator.state[np.newaxis].copy()


class Batch:
    """Eight motions in vector lanes, each with its own time and events."""

    lanes = BATCH

    def __init__(self, tolerance: float):
        motion, gap = equations()

        def switch(integrator, direction, lane):
            integrator.pars[0, lane] = 1.0 if direction < 0 else 0.0
            return True

        self.integrator = heyoka.taylor_adaptive_batch(
            motion,
            np.zeros((2 * MODES, BATCH)),
            pars=np.array([[0.0] * BATCH, [1.0] * BATCH]),
            tol=tolerance,
            t_events=[heyoka.t_event_batch(gap, callback=switch)],
        )

    def follow(
        self, omegas: np.ndarray, starts: np.ndarray, periods: int
    ) -> Iterator[np.ndarray]:
        integrator = self.integrator
        integrator.set_time(0.0)
        integrator.state[:] = starts.T
        for lane in range(BATCH):
            integrator.pars[0, lane] = regime_at(omegas[lane], starts[lane])
            integrator.pars[1, lane] = omegas[lane]
        integrator.reset_cooldowns()
        for k in range(1, periods + 1):
            integrator.propagate_until(list(k * 2 * np.pi / omegas))
            yield integrator.state.T.copy()


if __name__ == "__main__":
    ASKED = work.options("one", "batch")
    PEER = (One if ASKED.method == "one" else Batch)(ASKED.setting)
    work.do(ASKED, PEER.follow, PEER.lanes)
