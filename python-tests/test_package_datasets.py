"""Sweeps and basins from Python: the terminal's bytes, lazily, in chunks, on a cluster."""

import filecmp
import json
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
from program import PROGRAM


def assert_same(here, there):
    """Two stores hold the same files with the same bytes."""
    names = [
        sorted(
            str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()
        )
        for root in (pathlib.Path(here), pathlib.Path(there))
    ]
    assert names[0] == names[1]
    _, differing, missing = filecmp.cmpfiles(here, there, names[0], shallow=False)
    assert not differing and not missing


def test_python_writes_the_terminals_bytes(regular, tmp_path):
    (tmp_path / "case.toml").write_text(regular.to_toml())
    command = (
        "sweep case.toml --over omega=2.8:3.2:24 --starts 2 --periods 6 --strobe 3"
    )
    subprocess.run(
        [PROGRAM, *command.split(), "--out", "terminal.zarr", "--quiet"],
        cwd=tmp_path, check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    for k, over in enumerate(
        (
            "omega=2.8:3.2:24",
            {"omega": nanotap.range(2.8, 3.2, 24)},
            {"omega": np.linspace(2.8, 3.2, 24)},
        )
    ):
        out = tmp_path / f"python{k}.zarr"
        ds = nanotap.sweep(regular, over=over, starts=2, periods=6, strobe=3, out=out)
        assert_same(tmp_path / "terminal.zarr", out)
    assert ds.tip_max.chunks is not None  # lazily
    xr.testing.assert_identical(ds.load(), nanotap.open(out).load())
    memory = nanotap.sweep(regular, over=over, starts=2, periods=6, strobe=3)
    xr.testing.assert_equal(memory, ds)
    assert "path" not in memory.attrs
    said = nanotap._datasets.summary(ds)
    assert sum(said["counts"].values()) == said.runs == 48


def test_a_logarithmic_array_is_a_logarithmic_axis(regular):
    given = np.geomspace(5, 50, 7)
    ds = nanotap.sweep(regular, over={"alpha4": given}, periods=3)
    np.testing.assert_allclose(ds.alpha4, given, rtol=1e-14)
    assert ds.alpha4.attrs["spacing"] == "log"


def test_any_values_that_ascend_are_an_axis(regular, tmp_path):
    given = np.array([5.0, 20.0, 21.5, 50.0])
    ds = nanotap.sweep(regular, over={"alpha4": given}, periods=3)
    np.testing.assert_array_equal(ds.alpha4, given)
    assert ds.alpha4.attrs["spacing"] == "listed"
    # A value has the same motion as in a separate call.
    alone = nanotap.sweep(regular.with_(alpha4=21.5), over="omega=3:3:1", periods=3)
    np.testing.assert_allclose(ds.tip_max[2], alone.tip_max[0], rtol=1e-9)
    with pytest.raises(ValueError, match="greater than the one before"):
        nanotap.sweep(regular, over={"alpha4": [1, 9, 4]})


def test_shares_merge_to_the_same_bytes(regular, tmp_path):
    call = {"over": {"omega": nanotap.range(2.8, 3.2, 9)}, "periods": 4}
    nanotap.sweep(regular, **call, out=tmp_path / "whole.zarr")
    shares = [tmp_path / f"{i}.zarr" for i in (1, 2, 3)]
    for i, share in enumerate(shares):
        nanotap.sweep(regular, **call, chunk=f"{i + 1}/3", out=share)
    part = nanotap.merge(shares[:2], tmp_path / "merged.zarr")
    assert part.copied == 6 and part.missing == [2, 5, 8]
    assert nanotap.merge(shares, tmp_path / "merged.zarr").missing == []
    # Only the continuation to neighbouring values remains to be computed.
    nanotap.sweep(regular, **call, out=tmp_path / "merged.zarr")
    assert_same(tmp_path / "whole.zarr", tmp_path / "merged.zarr")
    with pytest.raises(ValueError, match="other options: .*omega"):
        nanotap.sweep(
            regular, over={"omega": nanotap.range(2, 3, 9)}, periods=4, out=shares[0]
        )
    with pytest.raises(ValueError, match="is not a dataset of nanotap"):
        nanotap.merge([tmp_path], tmp_path / "other.zarr")
    with pytest.raises(FileNotFoundError, match="nowhere.zarr"):
        nanotap.open(tmp_path / "nowhere.zarr")


def test_basins_from_what_was_found(bistable):
    found = nanotap.attractors(bistable, starts=32)
    call = {"x": {"a1": nanotap.range(-1, 1, 12)}, "y": "v1=-20:20:9"}
    ds = nanotap.basin(bistable, **call, attractors=found)
    assert ds.attractor.dims == ("v1", "a1")
    known = json.loads(ds.attrs["attractors"])
    assert sorted(one["period"] for one in known) == [1, 4]
    same = nanotap.basin(bistable, **call, attractors=[one.state for one in found])
    np.testing.assert_array_equal(ds.attractor, same.attractor)
    # Every initial state leads to the attractor in the map.
    for i, j in ((0, 0), (4, 6), (8, 11)):
        state = np.zeros(6)
        state[0], state[3] = ds.a1[j], ds.v1[i]
        run = nanotap.simulate(bistable, state=state, periods=4, series=0)
        assert run.period == known[int(ds.attractor[i, j])]["period"]


def test_ctrl_c_keeps_what_is_finished(regular, tmp_path):
    out = tmp_path / "stopped.zarr"
    total = 500_000
    call = {
        "over": {"omega": (2.5, 3.5, total)},
        "periods": 20,
        "threads": 1,
        "out": out,
    }
    heard = []

    def progress(*now):
        heard.append(now)
        if now[0] > 100:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(nanotap.Interrupted, match="resumes") as stopped:
        nanotap.sweep(regular, **call, progress=progress)
    assert heard[-1][1] == total
    ds = stopped.value.result
    finished = int((ds.classification != "").sum())
    assert 0 <= finished < total
    assert isinstance(stopped.value, KeyboardInterrupt)


def test_ctrl_c_keeps_the_starts_that_were_done(bistable):
    def progress(done, _total):
        if done > 10:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(nanotap.Interrupted) as stopped:
        nanotap.attractors(bistable, starts=20_000, threads=1, progress=progress)
    part = stopped.value.result
    assert 0 < sum(one.count for one in part) < 20_000


# A computation of minutes that does not test for cancellation. It is interrupted once its thread
# has started, and is still running when the interrupt arrives.
NOBODY_CAN_STOP = """
import os, pathlib, signal, threading
import nanotap

def at_work():
    names = pathlib.Path("/proc/self/task").glob("*/comm")
    return any(name.read_text().strip() == "nanotap" for name in names)

def interrupt():
    while not at_work():
        pass
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=interrupt, daemon=True).start()
try:
    nanotap.simulate(nanotap.Case.paper(omega=3), transient=100_000_000)
except KeyboardInterrupt:
    print("interrupted at work" if at_work() else "interrupted after it", flush=True)
os._exit(0)
"""


@pytest.mark.skipif(not pathlib.Path("/proc/self/task").exists(), reason="Linux only")
def test_ctrl_c_stops_what_nobody_can_stop():
    command = [sys.executable, "-c", NOBODY_CAN_STOP]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    assert done.stdout.strip() == "interrupted at work"


def test_an_error_of_the_listener_is_the_callers(regular):
    def progress(_done, _total):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        nanotap.sweep(
            regular,
            over={"omega": nanotap.range(2.5, 3.5, 500)},
            periods=5,
            progress=progress,
        )


def test_others_run_meanwhile(regular):
    counted = 0

    def count():
        nonlocal counted
        while counted < 200:
            counted += 1
            time.sleep(0.001)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=count)

    def progress(_done, _total):
        if thread.ident is None:
            thread.start()

    # A computation of minutes, which ends because another thread could count in the meantime. If
    # the interpreter were locked all the time, nothing would interrupt it.
    chaotic = regular.with_(omega=2.6)
    with pytest.raises(nanotap.Interrupted):
        nanotap.attractors(chaotic, starts=20_000, threads=1, progress=progress)
    thread.join()
    assert counted == 200


@pytest.fixture(scope="module")
def cluster():
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def test_a_cluster_makes_the_same_bytes_though_a_worker_is_killed(
    cluster, regular, tmp_path
):
    call = {"over": {"omega": nanotap.range(2.4, 3.4, 128)}, "starts": 2, "periods": 20}
    nanotap.sweep(regular, **call, out=tmp_path / "here.zarr")
    killed = []

    def progress(done, total):
        if done >= total // 3 and not killed:
            victim = next(iter(cluster.cluster.workers.values()))
            killed.append(victim.pid)
            os.kill(victim.pid, signal.SIGKILL)

    ds = nanotap.sweep(
        regular, **call, out=tmp_path / "there.zarr", client=cluster, progress=progress
    )
    assert killed
    assert_same(tmp_path / "here.zarr", tmp_path / "there.zarr")
    assert (ds.classification != "").all()


def test_a_cluster_goes_on_where_it_stopped(cluster, regular, tmp_path):
    call = {"over": {"omega": nanotap.range(2.8, 3.2, 32)}, "periods": 4}
    out = tmp_path / "parts.zarr"
    nanotap.sweep(regular, **call, chunk="1/2", out=out)
    heard = []
    nanotap.sweep(
        regular,
        **call,
        out=out,
        client=cluster,
        progress=lambda *now: heard.append(now),
    )
    assert heard[0] == (0, 16) and heard[-1] == (16, 16)
    nanotap.sweep(regular, **call, out=tmp_path / "whole.zarr")
    assert_same(out, tmp_path / "whole.zarr")


def test_basins_on_a_cluster(cluster, bistable, tmp_path):
    call = {"x": "a1=-1:1:16", "y": "v1=-20:20:16", "starts": 24}
    nanotap.basin(bistable, **call, out=tmp_path / "here.zarr")
    nanotap.basin(bistable, **call, out=tmp_path / "there.zarr", client=cluster)
    assert_same(tmp_path / "here.zarr", tmp_path / "there.zarr")
