"""Measures nanotap beside general solvers. `cargo xtask peers` sets up and starts this.

A run that was stopped goes on where it was; nanotap itself is measured anew every time.
"""

import argparse
import os
from dataclasses import asdict
from pathlib import Path

from driver import build, law, machine, report
from driver.compare import row_of
from driver.measure import Measurements
from driver.roster import PEERS

ROOT = Path(__file__).resolve().parent.parent


def main() -> None:
    parser = argparse.ArgumentParser(prog="cargo xtask peers", description=__doc__)
    parser.add_argument(
        "--quick",
        action="store_true",
        help="fewer settings and shorter samples, in under two minutes; docs/ stays as it is",
    )
    parser.add_argument(
        "--again",
        action="store_true",
        help="measure everything once more and keep the better of old and new",
    )
    parser.add_argument(
        "--fresh", action="store_true", help="forget what was measured before"
    )
    parser.add_argument("--only", help="peers whose name holds this")
    parser.add_argument(
        "--build", type=Path, default=ROOT / "target" / "peers", help="where to build"
    )
    asked = parser.parse_args()
    peers = [
        peer
        for peer in PEERS
        if not asked.only or asked.only in (peer.name, peer.program)
    ]
    print("Setting up")
    programs, missing = build.programs({peer.program for peer in peers}, asked.build)
    kept = asked.build / ("quick.json" if asked.quick else "measured.json")
    if asked.fresh:
        kept.unlink(missing_ok=True)
    take = Measurements(kept, programs, asked.again)
    threads = [1, 2] if (os.cpu_count() or 1) > 1 else [1]
    print("Measuring")
    rows = [
        row
        for peer in peers
        if peer.program in programs
        and (row := row_of(peer, take, asked.quick, threads)) is not None
    ]
    # A nonlinear law is a comparison of its own.
    laws = [] if asked.only else law.rows(0.3 if asked.quick else 2.0)
    result = {
        "laws": [asdict(row) for row in laws],
        "machine": machine.description(),
        "versions": build.versions(),
        "missing": missing,
    }
    # Only a whole run belongs into the documentation.
    whole = not asked.quick and not asked.only
    report.write(result, rows, threads, ROOT / "docs" if whole else asked.build)


if __name__ == "__main__":
    main()
