"""The program that the tests compare the package with."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = os.path.abspath(
    os.environ.get("NANOTAP", ROOT / "target" / "release" / "nanotap")
)
