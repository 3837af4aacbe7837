#!/usr/bin/env python3
"""Measure the processor time of a release build from nothing, crate by crate.

``build_times.py [DOCUMENT]`` builds the program and the Python extension in an empty folder, prints the
table of docs/performance.md, and fails if the total is a tenth above that in DOCUMENT. As
``RUSTC_WRAPPER`` it runs the compiler and appends the time to the file named by ``BUILD_TIMES``.
"""

import os
import re
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]
BUILD = ["build", "--release", "--locked", "-p", "nanotap-cli", "-p", "nanotap-python"]


def user_time(whose: int = resource.RUSAGE_CHILDREN) -> float:
    return resource.getrusage(whose).ru_utime


def compile_measured(command: list[str]) -> int:
    """Run the compiler; note the crate, its time, and the time of this script."""
    # The files of cargo's job server stay open.
    code = subprocess.run(command, check=False, close_fds=False).returncode
    name = (
        command[command.index("--crate-name") + 1] if "--crate-name" in command else "?"
    )
    if name == "nanotap" and "bin" in command:
        name = "nanotap (program)"
    own = user_time(resource.RUSAGE_SELF)
    # One short line is appended as a whole, whatever other compilers write at the same time.
    with open(os.environ["BUILD_TIMES"], "a", encoding="utf-8") as log:
        log.write(f"{name}\t{user_time():.3f}\t{own:.3f}\n")
    return code


def table(log: str, total: float | None = None) -> tuple[str, float]:
    """The table of own crates, dependencies and build scripts, and the total in seconds."""
    own, foreign, script = Counter[str](), Counter[str](), 0.0
    for line in log.splitlines():
        name, seconds, overhead = line.split("\t")
        is_own = re.match(r"_?nanotap|afm_", name)
        (own if is_own else foreign)[name] += float(seconds)
        script += float(overhead)
    compiled = own.total() + foreign.total()
    total = compiled if total is None else total - script
    rows = [
        *own.most_common(),
        (f"{len(foreign)} dependencies", foreign.total()),
        ("build scripts and cargo", total - compiled),
        ("total", total),
    ]
    lines = [f"| {name} | {seconds:.1f} |" for name, seconds in rows]
    return "\n".join(["| crate | user time (s) |", "|---|---:|", *lines]), total


def main(document: str | None) -> int:
    with tempfile.TemporaryDirectory(prefix="nanotap-build-") as folder:
        log = Path(folder) / "times"
        measured = {
            "CARGO_TARGET_DIR": folder,
            "RUSTC_WRAPPER": os.path.abspath(__file__),
            "BUILD_TIMES": str(log),
        }
        cargo = os.environ.get("CARGO", "cargo")
        subprocess.run([cargo, *BUILD], check=True, cwd=ROOT, env=os.environ | measured)
        text, total = table(log.read_text(encoding="utf-8"), user_time())
    print(text)
    if document is None:
        return 0
    recorded = re.search(
        r"^\| total \| ([\d.]+) \|$", Path(document).read_text("utf-8"), re.MULTILINE
    )
    if recorded is None or total > 1.1 * float(recorded[1]):
        print(f"{document} records {recorded and recorded[1]} s", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    if "BUILD_TIMES" in os.environ:
        sys.exit(compile_measured(sys.argv[1:]))
    sys.exit(main(*sys.argv[1:] or [None]))
