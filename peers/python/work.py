"""The works that every peer does, and how their cost is measured; see peers/README.md."""

import argparse
import json
import os
import time
from collections.abc import Callable, Iterator

import cantilever
import numpy as np

SWEEP_VALUES, SWEEP_STARTS, SWEEP_PERIODS, SWEEP_KEPT = 400, 8, 500, 100
BASIN_SIDE, BASIN_PERIODS = 200, 300

# Follows as many motions at once as the peer has lanes: from drive frequencies (lanes) and
# starts (lanes x 6), the states (lanes x 6) at the end of each of so many periods.
Follow = Callable[[np.ndarray, np.ndarray, int], Iterator[np.ndarray]]


def options(*methods: str) -> argparse.Namespace:
    """What the command line asks for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("work", choices=["first", "long", "sweep", "basin"])
    parser.add_argument("--method", choices=methods, default=methods[0])
    parser.add_argument("--setting", type=float, help="tolerance, or steps a period")
    parser.add_argument("--threads", type=int, choices=[1], default=1)
    parser.add_argument("--seconds", type=float, default=1.0)
    return parser.parse_args()


def scattered(k: np.ndarray, count: int, step: int) -> np.ndarray:
    """The k-th of `count` things, so that any first few are spread over all."""
    return k * step % count


def do(asked: argparse.Namespace, follow: Follow, lanes: int = 1) -> None:
    """Does the work, as much of it as fits into the time, and prints the cost."""
    works = {"first": first, "long": long, "sweep": sweep, "basin": basin}
    print(json.dumps(works[asked.work](asked.seconds, follow, lanes)))


def from_rest(follow: Follow, lanes: int, periods: int) -> Iterator[np.ndarray]:
    return follow(
        np.full(lanes, cantilever.OMEGA),
        np.zeros((lanes, 2 * cantilever.MODES)),
        periods,
    )


def first(seconds: float, follow: Follow, lanes: int) -> dict:
    """The first 20 periods from rest, best of several."""
    best, states, repeats = float("inf"), [], 0
    until = time.perf_counter() + seconds
    # The first run may compile what it needs; two at least, but no slow peer for ever.
    while repeats < 2 or (repeats < 1000 and time.perf_counter() < until):
        start = time.process_time()
        states = [state[0].tolist() for state in from_rest(follow, lanes, 20)]
        best = min(best, time.process_time() - start)
        repeats += 1
    return {"seconds": best / lanes, "states": states}


def long(seconds: float, follow: Follow, lanes: int) -> dict:
    """Up to 2000 periods from rest."""
    for _ in from_rest(follow, lanes, 1):
        pass
    start, until, done = time.process_time(), time.perf_counter() + seconds, 0
    for _ in from_rest(follow, lanes, 2000):
        done += 1
        if time.perf_counter() > until:
            break
    return {"seconds": (time.process_time() - start) / lanes, "periods": done}


def sweep(seconds: float, follow: Follow, lanes: int) -> dict:
    """400 frequencies by 8 starts, 500 periods each, the last 100 kept."""
    starts = np.loadtxt(os.environ["SWEEP_STARTS"], delimiter=",")
    count = SWEEP_VALUES * SWEEP_STARTS
    for _ in from_rest(follow, lanes, 1):
        pass
    begin, until, done = time.process_time(), time.perf_counter() + seconds, 0
    while done < count and time.perf_counter() < until:
        runs = scattered(np.arange(done, done + lanes), count, 1979)
        omegas = 2.0 + 2.0 * (runs // SWEEP_STARTS) / (SWEEP_VALUES - 1)
        kept = []
        states = follow(omegas, starts[runs % SWEEP_STARTS], SWEEP_PERIODS)
        for period, state in enumerate(states, 1):
            if period > SWEEP_PERIODS - SWEEP_KEPT:
                kept.append(state)
        done += lanes
    return {"seconds": time.process_time() - begin, "runs": done}


def basin(seconds: float, follow: Follow, lanes: int) -> dict:
    """200 by 200 starts, 300 periods each, the last state kept."""
    count = BASIN_SIDE**2
    for _ in from_rest(follow, lanes, 1):
        pass
    begin, until, done = time.process_time(), time.perf_counter() + seconds, 0
    ends = []
    while done < count and time.perf_counter() < until:
        points = scattered(np.arange(done, done + lanes), count, 24721)
        starts = np.zeros((lanes, 2 * cantilever.MODES))
        starts[:, 0] = -1.0 + 2.0 * (points // BASIN_SIDE) / (BASIN_SIDE - 1)
        starts[:, 3] = -4.0 + 8.0 * (points % BASIN_SIDE) / (BASIN_SIDE - 1)
        state = None
        for state in follow(np.full(lanes, cantilever.OMEGA), starts, BASIN_PERIODS):
            pass
        ends.append(state)
        done += lanes
    return {"seconds": time.process_time() - begin, "runs": done}
