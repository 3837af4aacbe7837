"""Puts up the programs of the peers; what a machine lacks is left out, with the reason."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

PEERS = Path(__file__).resolve().parent.parent

# Tried in turn: what the machine has, in the widest registers; the same; plain.
MACHINE_FLAGS = [
    ["-march=native", "-mprefer-vector-width=512"],
    ["-march=native"],
    [],
]
SUNDIALS_LIBRARIES = [
    "-lsundials_cvode",
    "-lsundials_arkode",
    "-lsundials_nvecserial",
    "-lsundials_sunnonlinsolfixedpoint",
]
PYTHON_PEERS = {
    "scipy": ("scipy_peer.py", "scipy"),
    "numba": ("numba_peer.py", "numba"),
    "heyoka": ("heyoka_peer.py", "heyoka"),
    "sundae": ("sundae_peer.py", "sksundae"),
}


class Missing(Exception):
    """Why a program is not there."""


def last_words(text: str) -> str:
    """The line of a compiler's output that says what is wrong."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    wrong = [line for line in lines if "error" in line.lower()]
    # Where things lie on this machine is nobody else's concern.
    return re.sub(r"(?<!\w)(/[\w.+-]+)+/", "", (wrong or lines or ["no output"])[0])[
        :160
    ]


def run(command: list[str], **more) -> str:
    """The output of a command that must succeed."""
    try:
        done = subprocess.run(
            command, check=False, capture_output=True, text=True, **more
        )
    except OSError as error:
        raise Missing(f"{command[0]}: {error.strerror}") from error
    if done.returncode != 0:
        raise Missing(last_words(done.stderr))
    return done.stdout


def compiled(source: str, to: Path, *more: str) -> list[str]:
    """A C++ peer."""
    compiler = os.environ.get("CXX") or shutil.which("g++") or shutil.which("clang++")
    if not compiler:
        raise Missing("no C++ compiler was found")
    program = to / Path(source).stem
    why = None
    for flags in MACHINE_FLAGS:
        command = [compiler, "-O3", "-std=c++17", "-pthread", *flags, f"-I{to}"]
        command += [str(PEERS / "cpp" / source), "-o", str(program), *more]
        try:
            run(command)
        except Missing as error:
            why = error
        else:
            return [str(program)]
    raise Missing(f"{source} does not compile here: {why}")


def lanes(to: Path) -> list[str]:
    script = PEERS / "python" / "dop853_header.py"
    run([sys.executable, str(script), str(to / "dop853.hpp")])
    return compiled("runge_kutta_lanes.cpp", to)


def rust(to: Path) -> list[str]:
    cargo = os.environ.get("CARGO") or shutil.which("cargo")
    if not cargo:
        raise Missing("no cargo was found")
    manifest = str(PEERS / "rust" / "Cargo.toml")
    environment = {**os.environ, "CARGO_TARGET_DIR": str(to / "rust")}
    run(
        [cargo, "build", "--release", "--quiet", "--manifest-path", manifest],
        env=environment,
    )
    return [str(to / "rust" / "release" / "rust-peers")]


def python(script: str, module: str) -> list[str]:
    run([sys.executable, "-c", f"import {module}"])
    return [sys.executable, str(PEERS / "python" / script)]


def nanotap() -> list[str]:
    program = os.environ.get("NANOTAP_PEER")
    if not program or not Path(program).exists():
        raise Missing("NANOTAP_PEER names no program; `cargo xtask peers` sets it")
    return [program]


def programs(wanted: set[str], to: Path) -> tuple[dict[str, list[str]], dict[str, str]]:
    """How to start each program that could be put up, and why the others could not."""
    makers = {
        "nanotap": nanotap,
        "lanes": lambda: lanes(to),
        "odeint": lambda: compiled("odeint.cpp", to),
        "sundials": lambda: compiled("sundials.cpp", to, *SUNDIALS_LIBRARIES),
        "rust": lambda: rust(to),
    }
    for name, (script, module) in PYTHON_PEERS.items():
        makers[name] = lambda script=script, module=module: python(script, module)
    to.mkdir(parents=True, exist_ok=True)
    there, missing = {}, {}
    for name in sorted(wanted):
        try:
            there[name] = makers[name]()
        except Missing as reason:
            missing[name] = str(reason)
            print(f"  without {name}: {reason}", flush=True)
        else:
            print(f"  {name} is ready", flush=True)
    return there, missing


def versions() -> dict[str, str]:
    """Of everything that takes part and can be asked."""
    found = {"Python": sys.version.split()[0]}
    modules = ["numpy", "scipy", "numba", "heyoka", "sksundae"]
    for module in modules:
        question = f"import {module}; print({module}.__version__)"
        try:
            found[module] = run([sys.executable, "-c", question]).strip()
        except Missing:
            continue
    for name, command in [
        ("g++", ["g++", "-dumpfullversion"]),
        ("rustc", ["rustc", "-V"]),
    ]:
        try:
            found[name] = run(command).strip().removeprefix("rustc ").split(" (")[0]
        except Missing:
            continue
    headers = {
        "Boost": ("boost/version.hpp", r'BOOST_LIB_VERSION "([0-9_]+)"'),
        "SUNDIALS": ("sundials/sundials_config.h", r'SUNDIALS_VERSION "([0-9.]+)"'),
    }
    for name, (header, pattern) in headers.items():
        for root in ("/usr/include", "/usr/local/include", "/opt/homebrew/include"):
            path = Path(root) / header
            match = path.exists() and re.search(pattern, path.read_text())
            if match:
                found[name] = match.group(1).replace("_", ".")
    lock = PEERS / "rust" / "Cargo.lock"
    if lock.exists():
        for crate in ("ode_solvers", "differential-equations", "diffsol"):
            match = re.search(
                rf'name = "{crate}"\nversion = "([^"]+)"', lock.read_text()
            )
            if match:
                found[crate] = match.group(1)
    return found
