"""Fixtures of all tests. Run by `cargo xtask test-python` on the installed wheel."""

import nanotap
import pytest


@pytest.fixture(scope="session")
def regular():
    """A case in which every run leads to the same motion: the paper's parameters at Ω = 3."""
    return nanotap.Case.paper(omega=3)


@pytest.fixture(scope="session")
def bistable():
    """Two orbits coexist: α₁ = 0, Ω = 20."""
    return nanotap.Case.paper(omega=20, alpha1=0)


PHYSICAL = {
    "cantilever": {"lever": "PPP-FM", "Q": 200},
    "tip": {"mass_ratio": 0.1},
    "sample": {"material": "polystyrene"},
    "drive": {"frequency": "65.7 kHz", "free_amplitude": "20 nm"},
    "gap": {"tip": "18 nm"},
}


@pytest.fixture(scope="session")
def physical():
    """An FM-class lever on polystyrene: α₄ of about 25, Ω = 2.6."""
    return nanotap.Case(**PHYSICAL)
