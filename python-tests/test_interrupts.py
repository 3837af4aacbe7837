"""Ctrl-C during every function: `Interrupted` within a second or two, with the finished part."""

import os
import pathlib
import signal
import threading
import time

import nanotap
import numpy as np
import pytest

CASES = pathlib.Path(__file__).parents[1] / "docs" / "cases"
# Seconds until the signal, and from then to the exception: one for the work itself, the rest for a
# loaded machine.
UNTIL, WITHIN = 0.5, 3.0


def load(name, **changes):
    return nanotap.Case.from_file(CASES / name).with_(**changes)


def lever(**changes):
    return load("bistable-lever.toml", **changes)


def curve():
    return nanotap.read(CASES / "polystyrene-curve.csv")


# Work of many seconds, by function; each may be stopped before a part of it is finished.
CALLS = {
    "simulate": lambda: nanotap.simulate(lever(), periods=10_000_000, series=0),
    "simulate over an array": lambda: nanotap.simulate(
        lever(), **{"gap.tip": np.linspace(7e-9, 9e-9, 400)}, periods=20_000
    ),
    "orbit over an array": lambda: nanotap.orbit(
        lever(), **{"gap.tip": np.linspace(7e-9, 9e-9, 4000)}
    ),
    "attractors": lambda: nanotap.attractors(
        nanotap.Case.paper(omega=2.6), starts=20_000
    ),
    "branch": lambda: nanotap.branch(
        lever(), parameter="gap.tip", from_="12 nm", to="2 nm", max_step=1e-6
    ),
    "approach": lambda: nanotap.approach(lever(), points=20_000),
    "fm": lambda: nanotap.fm(load("fm-lever.toml"), points=20_000),
    "sweep": lambda: nanotap.sweep(
        nanotap.Case.paper(), over={"omega": nanotap.range(2.5, 3.5, 100_000)}
    ),
    "sweep with conditions": lambda: nanotap.sweep(
        lever(),
        over={"gap.tip": nanotap.range(7e-9, 9e-9, 20_000)},
        where=["peak_force < 5 nN"],
    ),
    "window": lambda: nanotap.window(
        lever(),
        over={
            "gap.tip": nanotap.range(7e-9, 9e-9, 100),
            "drive.free_amplitude": nanotap.range(9e-9, 11e-9, 100),
        },
    ),
    "basin": lambda: nanotap.basin(
        nanotap.Case.paper(omega=20, alpha1=0), x="a1=-1:1:2000", y="v1=-4:4:2000"
    ),
    "lyapunov": lambda: nanotap.lyapunov(
        nanotap.Case.paper(omega=2.6), periods=100_000_000
    ),
    "convergence": lambda: nanotap.convergence(
        nanotap.Case.paper(omega=2.6), largest=50
    ),
    "scan": lambda: nanotap.scan(load("scan-step.toml"), lines=200, size="500 nm"),
    "force_curve": lambda: nanotap.force_curve(
        load("force-curve.toml"), speed="10 nm/s", points=5000
    ),
    "bimodal": lambda: nanotap.bimodal(
        load("bimodal-polymer.toml"), first="am", second="fm", points=5000
    ),
    "lever": lambda: nanotap.lever(lever()),
    "fit": lambda: nanotap.fit(
        load("stiff-lever.toml"),
        data=curve(),
        free=["sample.modulus", "sample.hamaker", "gap.offset"],
        starts=200,
    ),
    "reconstruct": lambda: nanotap.reconstruct(
        load("stiff-lever.toml"), data=[curve()] * 40, rows=2000
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_ctrl_c_raises_interrupted_with_the_finished_part(name):
    sent = []

    def interrupt():
        time.sleep(UNTIL)
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    try:
        with pytest.raises(nanotap.Interrupted) as stopped:
            CALLS[name]()
            thread.join()
        assert time.monotonic() - sent[0] < WITHIN
    finally:
        thread.join()
    part = stopped.value.result
    # The part is in memory or where its message says.
    if hasattr(part, "data_vars"):
        part.load()
        assert not pathlib.Path(part.attrs.get("path", "")).is_absolute()
    elif part is not None:
        assert repr(part)


def test_partial_results_say_what_is_missing():
    def stop_at(least):
        def progress(done, _total):
            if done > least:
                signal.raise_signal(signal.SIGINT)

        return progress

    with pytest.raises(nanotap.Interrupted) as stopped:
        nanotap.approach(lever(), points=4000, threads=1, progress=stop_at(20))
    ds = stopped.value.result
    assert 0 < ds.sizes["zc"] < 4000
    assert ds.amplitude.attrs["units"] == "m"
    with pytest.raises(nanotap.Interrupted) as stopped:
        nanotap.scan(load("scan-step.toml"), lines=50, threads=1, progress=stop_at(2))
    part = stopped.value.result
    assert part is None or 0 < part.sizes["y"] < 50
