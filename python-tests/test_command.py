"""The command ``nanotap`` that the wheel installs is the terminal program."""

import signal
import subprocess
import sys
import sysconfig
from pathlib import Path

import nanotap

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
