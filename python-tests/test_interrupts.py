"""Ctrl-C during functions that take seconds: `Interrupted` within a second, with the finished part."""

import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

import nanotap
import numpy as np
import pytest
import xarray as xr

pytestmark = pytest.mark.alone

CASES = pathlib.Path(__file__).parents[1] / "docs" / "cases"
# Seconds until the signal, and from then to the exception. On a loaded machine the processor time counts,
# which is longer than the time wherever the work goes on.
UNTIL, WITHIN = 0.5, 1.0


def load(name, **changes):
    return nanotap.Case.from_file(CASES / name).with_(**changes)


def lever(**changes):
    return load("bistable-lever.toml", **changes)


def curve():
    return nanotap.read(CASES / "polystyrene-curve.csv")


# Work of many seconds, by function; each may be stopped before a part of it is finished.
CALLS = {
    "simulate": lambda: nanotap.simulate(lever(), periods=2_000_000, series=0),
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
    "basin": lambda: nanotap.basin(
        nanotap.Case.paper(omega=20, alpha1=0), x="a1=-1:1:2000", y="v1=-4:4:2000"
    ),
    "sweep": lambda: nanotap.sweep(
        nanotap.Case.paper(), over="omega=2:4:100000", periods=20
    ),
    "sweep of many periods": lambda: nanotap.sweep(
        nanotap.Case.paper(), over="omega=2:4:2000", periods=20_000
    ),
    "sweep with a condition": lambda: nanotap.sweep(
        nanotap.Case.paper(), over="omega=2:4:100000", where="period = 1", periods=20
    ),
    "window": lambda: nanotap.window(
        nanotap.Case.paper(), over=["omega=2:4:100", "alpha4=10:30:100"]
    ),
    "fit": lambda: nanotap.fit(
        load("stiff-lever.toml"),
        data=[curve()] * 20,
        free=["sample.modulus", "sample.loss_tangent", "gap.offset"],
        rows=0,
        starts=1000,
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
    "lever": lambda: nanotap.lever(lever(**{"drive.setpoint": 0.8, "gap.tip": None})),
    "reconstruct": lambda: nanotap.reconstruct(
        load("stiff-lever.toml"), data=[curve()] * 40, rows=2000
    ),
}


def interrupted(name):
    """The call in this process, with Ctrl-C after a while: what it raised, and how long that took."""
    sent = []

    def interrupt():
        time.sleep(UNTIL)
        sent.append((time.monotonic(), time.process_time()))
        os.kill(os.getpid(), signal.SIGINT)

    # What is imported when it is needed is imported before.
    curve()
    nanotap.sweep(nanotap.Case.paper(), over="omega=3:3.1:2", periods=1)
    threading.Thread(target=interrupt, daemon=True).start()
    try:
        CALLS[name]()
        return "finished before the signal"
    except nanotap.Interrupted as stopped:
        [(then, used)] = sent
        late = min(time.monotonic() - then, time.process_time() - used)
        part = stopped.result
        if hasattr(part, "data_vars"):
            # The part is in memory, not in a folder that is gone.
            part.load()
            assert "path" not in part.attrs
        return "interrupted" if late < WITHIN else f"interrupted {late:.1f} s late"
    except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001
        return f"{type(error).__name__}: {error}"


@pytest.mark.parametrize("name", CALLS)
def test_ctrl_c_raises_interrupted_with_the_finished_part(name):
    # A signal that comes too early or late would end pytest: each call has a process.
    code = f"import test_interrupts as t; print(t.interrupted({name!r}), flush=True)"
    command = [sys.executable, "-c", code + "; import os; os._exit(0)"]
    done = subprocess.run(
        command,
        cwd=pathlib.Path(__file__).parent,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.stdout.strip() == "interrupted", done.stderr[-2000:]


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
    sweep = {"over": "omega=2.9:3.1:640", "periods": 3}
    with pytest.raises(nanotap.Interrupted) as stopped:
        nanotap.sweep(nanotap.Case.paper(), **sweep, threads=1, progress=stop_at(100))
    part = stopped.value.result
    whole = nanotap.sweep(nanotap.Case.paper(), **sweep)
    finished = part.sizes["omega"]
    assert 100 <= finished < 640
    xr.testing.assert_identical(
        part.drop_attrs(), whole.isel(omega=slice(finished)).drop_attrs()
    )
    assert "path" not in part.attrs
    with pytest.raises(nanotap.Interrupted) as stopped:
        nanotap.scan(load("scan-step.toml"), lines=50, threads=1, progress=stop_at(2))
    part = stopped.value.result
    assert part is None or 0 < part.sizes["y"] < 50
