"""The command ``nanotap`` that the wheel installs is the terminal program."""

import os
import signal
import subprocess
import sys
import sysconfig
from pathlib import Path

import nanotap
import pytest

ROOT = Path(__file__).parents[1]
COMMAND = Path(sysconfig.get_path("scripts")) / "nanotap"


def run(*arguments: str, program: tuple[str, ...] = (str(COMMAND),)):
    return subprocess.run(
        [*program, *arguments], check=False, capture_output=True, text=True
    )


def test_the_command_is_the_program_of_this_version():
    assert run("--version").stdout.split()[:2] == ["nanotap", nanotap.__version__]
    module = run("--version", program=(sys.executable, "-m", "nanotap"))
    assert module.stdout == run("--version").stdout


def test_it_answers_and_fails_as_the_program_does():
    case = str(ROOT / "docs" / "cases" / "paper.toml")
    answer = run("orbit", case)
    assert answer.returncode == 0
    assert "a period-1 orbit, stable" in answer.stdout
    unknown = run("orbit", case, "--set", "omgea=2")
    assert unknown.returncode == 2
    assert "did you mean `omega`?" in unknown.stderr


def test_ctrl_c_ends_it_with_130():
    case = str(ROOT / "docs" / "cases" / "paper.toml")
    options = ["attractors", case, "--starts", "1000000"]
    with subprocess.Popen(
        [COMMAND, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as work:
        # Progress is reported once the handler of signals is installed.
        assert work.stderr is not None
        work.stderr.readline()
        work.send_signal(signal.SIGINT)
        work.communicate(timeout=20)
        assert work.returncode == 130


def printed_on_a_terminal(periods: int) -> str:
    """What `lyapunov` of a chaotic motion over these periods prints on a terminal, but for its answer."""
    pty = pytest.importorskip("pty")
    case = str(ROOT / "docs" / "cases" / "paper.toml")
    ours, its = pty.openpty()
    command = [
        COMMAND,
        "lyapunov",
        case,
        "--set",
        "omega=2.6",
        "--periods",
        str(periods),
    ]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=its) as work:
        os.close(its)
        text = b""
        # Reading from a terminal whose program has ended fails.
        with os.fdopen(ours, "rb", buffering=0) as terminal:
            try:
                while part := terminal.read(1000):
                    text += part
            except OSError:
                pass
        assert work.wait(timeout=20) == 0
    return text.decode()


def test_on_a_terminal_a_line_shows_that_it_works_until_the_answer():
    # On a faster machine more periods, until the work is long enough for a line.
    texts = (printed_on_a_terminal(200_000 << doubled) for doubled in range(10))
    said = next(text for text in texts if "so far" in text)
    assert "lyapunov: 1 s so far" in said
    assert "\r\x1b[K" in said
