"""Writes the coefficients of DOP853 that SciPy carries as a C++ header.

Usage: python dop853_header.py dop853.hpp
"""

import sys
from pathlib import Path

from scipy.integrate._ivp import dop853_coefficients

STAGES = 12


def array(name: str, size: str, values) -> str:
    """One constant of the header."""
    return f"static constexpr double {name}{size} = {values};\n"


def row(values) -> str:
    """Numbers in braces, every digit kept."""
    return "{" + ", ".join(repr(float(value)) for value in values) + "}"


def header() -> str:
    """The whole header."""
    a = dop853_coefficients.A[:STAGES, :STAGES]
    rows = "{" + ",\n".join(row(values) for values in a) + "}"
    return (
        "#pragma once\n"
        + array("DOP853_A", f"[{STAGES}][{STAGES}]", rows)
        + array("DOP853_B", f"[{STAGES}]", row(dop853_coefficients.B))
        + array("DOP853_C", f"[{STAGES}]", row(dop853_coefficients.C[:STAGES]))
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(header())
