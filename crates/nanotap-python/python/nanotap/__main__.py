"""The command ``nanotap``, also ``python -m nanotap``: the terminal program inside the package."""

import sys

from nanotap._nanotap import run_command_line


def main() -> int:
    """Run the terminal program with the arguments of this process; return its exit code."""
    return run_command_line(["nanotap", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
