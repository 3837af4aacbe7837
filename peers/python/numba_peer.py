"""Fixed-step fourth-order Runge-Kutta, compiled by Numba, every number a scalar.

Method `event` freezes the regime during a step and locates crossings by the Illinois
method on the length of the step; `naive` is the usual way: the gap is tested in every
stage and nothing is located. The setting is the number of steps a period.
"""

from collections.abc import Iterator
from math import cos, sin

import numpy as np
import work
from cantilever import ALPHA, BETA, INTEGRAL, TIP, cantilever
from numba import njit

K0, K1, K2 = (float(b) for b in BETA**4)
I0, I1, I2 = (float(i) for i in INTEGRAL)
A1, A2, A3, A4, A5, A6 = (ALPHA[i] for i in range(1, 7))
MASS = 2 * A1 / (1 + A1 * float(TIP @ TIP))


@njit(inline="always")
def gap_of(x0, x1, x2, s):
    """The gap where the drive's sine is `s`."""
    return 2 * (x0 - x1 + x2) + A2 * s + A5


@njit(inline="always")
def accelerations(x0, x1, x2, v0, v1, v2, omega, s, c, contact):
    sine, cosine = A2 * omega * omega * s, -A2 * A3 * omega * c
    f0 = sine * (2 * A1 + I0) + cosine * I0 - K0 * x0 - A3 * v0
    f1 = sine * (-2 * A1 + I1) + cosine * I1 - K1 * x1 - A3 * v1
    f2 = sine * (2 * A1 + I2) + cosine * I2 - K2 * x2 - A3 * v2
    if contact:
        rate = 2 * (v0 - v1 + v2) + A2 * omega * c
        pressed = 2 * (A4 * gap_of(x0, x1, x2, s) + A6 * rate)
        f0 -= pressed
        f1 += pressed
        f2 -= pressed
    tip = 2 * MASS * (f0 - f1 + f2)
    return f0 - tip, f1 + tip, f2 - tip


@njit(inline="always")
def step(x0, x1, x2, v0, v1, v2, omega, s0, c0, sm, cm, s1, c1, h, naive, contact):
    """One step; sines and cosines of the drive at its start, middle and end."""
    half = 0.5 * h
    if naive:
        contact = gap_of(x0, x1, x2, s0) <= 0
    a0, a1, a2 = accelerations(x0, x1, x2, v0, v1, v2, omega, s0, c0, contact)
    y0, y1, y2 = x0 + half * v0, x1 + half * v1, x2 + half * v2
    p0, p1, p2 = v0 + half * a0, v1 + half * a1, v2 + half * a2
    if naive:
        contact = gap_of(y0, y1, y2, sm) <= 0
    b0, b1, b2 = accelerations(y0, y1, y2, p0, p1, p2, omega, sm, cm, contact)
    y0, y1, y2 = x0 + half * p0, x1 + half * p1, x2 + half * p2
    q0, q1, q2 = v0 + half * b0, v1 + half * b1, v2 + half * b2
    if naive:
        contact = gap_of(y0, y1, y2, sm) <= 0
    d0, d1, d2 = accelerations(y0, y1, y2, q0, q1, q2, omega, sm, cm, contact)
    y0, y1, y2 = x0 + h * q0, x1 + h * q1, x2 + h * q2
    r0, r1, r2 = v0 + h * d0, v1 + h * d1, v2 + h * d2
    if naive:
        contact = gap_of(y0, y1, y2, s1) <= 0
    e0, e1, e2 = accelerations(y0, y1, y2, r0, r1, r2, omega, s1, c1, contact)
    sixth = h / 6
    return (
        x0 + sixth * (v0 + 2 * (p0 + q0) + r0),
        x1 + sixth * (v1 + 2 * (p1 + q1) + r1),
        x2 + sixth * (v2 + 2 * (p2 + q2) + r2),
        v0 + sixth * (a0 + 2 * (b0 + d0) + e0),
        v1 + sixth * (a1 + 2 * (b1 + d1) + e1),
        v2 + sixth * (a2 + 2 * (b2 + d2) + e2),
    )


@njit(cache=True)
def step_alone(y, omega, t, h, contact):
    """A step of any length from any time, and the gap at its end."""
    x0, x1, x2, v0, v1, v2 = y
    m, e = t + 0.5 * h, t + h
    s0, c0 = sin(omega * t), cos(omega * t)
    sm, cm = sin(omega * m), cos(omega * m)
    s1, c1 = sin(omega * e), cos(omega * e)
    z = step(x0, x1, x2, v0, v1, v2, omega, s0, c0, sm, cm, s1, c1, h, False, contact)
    return z, gap_of(z[0], z[1], z[2], s1)


@njit(cache=True)
def step_with_switches(y, omega, t, h, contact):
    """A step in which the regime changes, once or more; state and regime at its end."""
    left = h
    for _ in range(20):
        sign = -1.0 if contact else 1.0
        low, at_low = 0.0, sign * gap_of(y[0], y[1], y[2], sin(omega * t))
        if at_low <= 0:
            # On the surface: a moment later it must be inside.
            low = 1e-3 * left
            at_low = sign * step_alone(y, omega, t, low, contact)[1]
            if at_low <= 0:
                contact = not contact
                return step_alone(y, omega, t, left, contact)[0], contact
        high = left
        z, gap = step_alone(y, omega, t, left, contact)
        at_high = sign * gap
        if at_high > 0:
            return z, contact
        side, s = 0, high
        for _ in range(60):
            s = (low * at_high - high * at_low) / (at_high - at_low)
            if not low < s < high:
                s = 0.5 * (low + high)
            z, gap = step_alone(y, omega, t, s, contact)
            value = sign * gap
            if value > 0:
                low, at_low = s, value
                if side == 1:
                    at_high *= 0.5
                side = 1
            else:
                high, at_high = s, value
                if side == -1:
                    at_low *= 0.5
                side = -1
            if high - low < 1e-15 * h or abs(value) < 1e-16:
                break
        y = z
        t += s
        left -= s
        contact = not contact
        if left <= 1e-14 * h:
            return y, contact
    return y, contact


@njit(cache=True)
def run_period(y, omega, steps, table, naive, contact):
    """One drive period; state and regime at its end."""
    h = 2 * np.pi / omega / steps
    for i in range(steps):
        s0, c0 = table[2 * i, 0], table[2 * i, 1]
        sm, cm = table[2 * i + 1, 0], table[2 * i + 1, 1]
        s1, c1 = table[2 * i + 2, 0], table[2 * i + 2, 1]
        x0, x1, x2, v0, v1, v2 = y
        z = step(
            x0, x1, x2, v0, v1, v2, omega, s0, c0, sm, cm, s1, c1, h, naive, contact
        )
        if not naive and (gap_of(z[0], z[1], z[2], s1) <= 0) != contact:
            y, contact = step_with_switches(y, omega, i * h, h, contact)
        else:
            y = z
    return y, contact


def follow(
    asked, omegas: np.ndarray, starts: np.ndarray, periods: int
) -> Iterator[np.ndarray]:
    steps, omega = int(asked.setting), float(omegas[0])
    phases = 2 * np.pi * np.arange(2 * steps + 1) / (2 * steps)
    table = np.stack([np.sin(phases), np.cos(phases)], axis=1)
    contact = bool(cantilever(omega).regime_at(0.0, starts[0]))
    y, naive = tuple(float(x) for x in starts[0]), asked.method == "naive"
    for _ in range(periods):
        y, contact = run_period(y, omega, steps, table, naive, contact)
        yield np.array([y])


if __name__ == "__main__":
    ASKED = work.options("event", "naive")
    work.do(ASKED, lambda *what: follow(ASKED, *what))
