"""A nonlinear contact law: nanotap beside heyoka and SciPy on one lever over a DMT sample."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

PYTHON = Path(__file__).resolve().parent.parent / "python"
MODES = (1, 3, 10)
TOLERANCES = [10.0**-k for k in range(7, 15)]
# An error that counts as equal, in nm of a swing of 20 nm.
EQUAL = 1e-9
# What all are compared with: heyoka at its finest, which so is measured against itself.
FINEST = 1e-16


@dataclass(frozen=True)
class Row:
    """The cheapest setting of one peer that comes to the error asked for, or its best."""

    modes: int
    name: str
    setting: float
    error: float
    rate: float


def programs() -> dict[str, list[str]]:
    """What can be started here."""
    found = {
        "heyoka": [sys.executable, str(PYTHON / "dmt_heyoka.py")],
        "SciPy DOP853": [sys.executable, str(PYTHON / "dmt_scipy.py")],
    }
    own = os.environ.get("NANOTAP_LAW_PEER")
    return ({"nanotap": [own]} if own and Path(own).exists() else {}) | found


def run(command: list[str], modes: int, setting: float, seconds: float) -> dict | None:
    asked = [*command, str(modes), repr(setting), repr(seconds)]
    try:
        done = subprocess.run(
            asked, check=False, capture_output=True, text=True, timeout=120
        )
        found = json.loads(done.stdout.strip().splitlines()[-1])
    except (subprocess.TimeoutExpired, ValueError, IndexError):
        return None
    print(f"  {asked[-4:]}: {found['rate']:.0f} periods a second", flush=True)
    return found


def rows(seconds: float) -> list[Row]:
    """Everybody on every number of modes; none without heyoka, the reference."""
    there = programs()
    table = []
    for modes in MODES:
        truth = run(there["heyoka"], modes, FINEST, 0.0)
        if truth is None:
            return []
        for name, command in there.items():
            tried = []
            for setting in TOLERANCES:
                found = run(command, modes, setting, seconds)
                if found is None:
                    continue
                error = max(
                    abs(a - b)
                    for one, other in zip(found["states"], truth["states"], strict=True)
                    for a, b in zip(one, other, strict=True)
                )
                tried.append(Row(modes, name, setting, error, found["rate"]))
                if error <= EQUAL:
                    break
            if tried:
                table.append(min(tried, key=lambda row: max(row.error, EQUAL)))
    return table
