"""Runs one peer on one work, keeps what was measured, and finds the error."""

import json
import os
import resource
import subprocess
from pathlib import Path

from .roster import Peer

PEERS = Path(__file__).resolve().parent.parent
# The 50-digit reference that the tests use as well.
REFERENCE = PEERS.parent / "crates/nanotap/tests/reference/W1_Om2.6_N3.json"
# Periods after which the error is taken; the largest counts.
COMPARED = (5, 10, 20)
# How many runs make up a work, and how many periods each has.
RUNS = {"sweep": 3200, "basin": 40000}
PERIODS = {"sweep": 500, "basin": 300}
# Of its processors a program on several threads must have had this part; with less, other
# programs were measured.
LEAST_SHARE = 0.95


def reference() -> dict[int, list[float]]:
    """States after so many periods."""
    states = json.loads(REFERENCE.read_text())["states"]
    return {
        int(period): [float(x) for x in state["a"] + state["adot"]]
        for period, state in states.items()
    }


def error_of(states: list[list[float]]) -> float:
    """Largest difference from the reference in any entry of the state."""
    truth = reference()
    return max(
        abs(x - y)
        for period in COMPARED
        for x, y in zip(states[period - 1], truth[period], strict=True)
    )


class Measurements:
    """What was measured, kept in a file so that a run that was stopped goes on."""

    def __init__(self, path: Path, programs: dict[str, list[str]], again: bool):
        self.path = path
        self.programs = programs
        self.again = again
        self.known = json.loads(path.read_text()) if path.exists() else {}

    def of(
        self,
        peer: Peer,
        work: str,
        setting: float | None,
        seconds: float,
        threads: int = 1,
    ) -> dict | None:
        """The best measurement of this; none where it failed."""
        key = f"{peer.program} {peer.method} {work} {setting} {threads}"
        before = self.known.get(key)
        # nanotap itself changes from run to run.
        if before is not None and not self.again and peer.program != "nanotap":
            return before
        found = self.run(peer, work, setting, seconds, threads)
        # Noise only ever adds time.
        if self.again and before and (not found or cost(before) < cost(found)):
            found = before
        if found:
            self.known[key] = found
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.write_text(json.dumps(self.known, indent=1))
        return found

    def run(self, peer, work, setting, seconds, threads) -> dict | None:
        command = [*self.programs[peer.program], work]
        if peer.method:
            command += ["--method", peer.method]
        if setting is not None:
            command += ["--setting", repr(setting)]
        command += ["--seconds", str(seconds), "--threads", str(threads)]
        label = f"{peer.name}, {work}, {setting}, {threads} thread(s)"
        environment = {
            **os.environ,
            "SWEEP_STARTS": str(PEERS / "sweep_starts.csv"),
            # One thread means one, in the libraries below too.
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "NUMBA_NUM_THREADS": "1",
        }
        before = processor_seconds()
        try:
            done = subprocess.run(
                command,
                check=False,
                capture_output=True,
                text=True,
                timeout=120,
                env=environment,
            )
            result = json.loads(done.stdout.strip().splitlines()[-1])
        except (subprocess.TimeoutExpired, ValueError, IndexError):
            print(f"  {label}: no result", flush=True)
            return None
        had = processor_seconds() - before
        if threads > 1 and had < LEAST_SHARE * threads * result["seconds"]:
            print(f"  {label}: not counted, the machine was busy", flush=True)
            return None
        if work == "first":
            result["error"] = error_of(result.pop("states"))
        print(f"  {label}: {result}", flush=True)
        return result


def processor_seconds() -> float:
    """What the programs that were run so far had of the processors."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def cost(result: dict) -> float:
    """Seconds a thing, whatever the work counts."""
    return result["seconds"] / (result.get("periods") or result.get("runs") or 1)
