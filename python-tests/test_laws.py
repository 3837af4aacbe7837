"""Every kind of contact law from Python: orbits, the map, arrays, sweeps, branches."""

import nanotap
import numpy as np
import pytest

ELASTIC = {"modulus": "1 GPa", "poisson": 0.3}
LAWS = {
    "spring-damper": {"stiffness": "5 N/m", "damping": 1e-8},
    "kelvin-voigt": {"stiffness": "5 N/m", "damping": 1e-7},
    "standard-linear-solid": {
        "stiffness": "5 N/m",
        "relaxation_stiffness": "5 N/m",
        "relaxation_time": "100 ns",
    },
    "generalised-maxwell": {
        "stiffness": "5 N/m",
        "relaxation_arms": {"time (ns)": [100, 900], "stiffness (N/m)": [5, 2]},
    },
    "moving-surface": {
        "stiffness": "5 N/m",
        "damping": 1e-7,
        "surface_stiffness": "1 N/m",
        "surface_damping": 1e-6,
        "adhesion_force": "1 nN",
    },
    "hertz": ELASTIC,
    "cone": ELASTIC,
    "dmt": {**ELASTIC, "hamaker": "3e-20 J"},
    "jkr": {**ELASTIC, "work_of_adhesion": 0.02},
    "voigt-sphere": {**ELASTIC, "viscosity": 10.0},
    "lennard-jones": {"hamaker": "3e-20 J", "repulsion": 1e-76},
    "exponential-damping + hertz": {
        **ELASTIC,
        "damping": 1e-8,
        "decay_length": "1 nm",
    },
    "table": {"table": {"gap (nm)": [-5, 0, 50], "force (nN)": [25, 0, 0]}},
}


def lever(law: str) -> nanotap.Case:
    """A lever with one mode 15 nm above a sample with that law."""
    tip = {"radius": "5 nm"}
    if law == "cone":
        tip["half_angle"] = "20 deg"
    elastic = "modulus" in LAWS[law]
    if elastic:
        tip |= {"modulus": "160 GPa", "poisson": 0.3}
    return nanotap.Case(
        modes=1,
        cantilever={"k": "0.9 N/m", "f0": "100 kHz", "Q": 50},
        tip=tip,
        sample={"law": law, **LAWS[law]},
        drive={"actuation": "tip", "frequency": "100 kHz", "free_amplitude": "20 nm"},
        gap={"tip": "15 nm"},
    )


@pytest.mark.parametrize("law", LAWS)
def test_a_law_is_there_in_every_way(law):
    case = lever(law)
    orbit = nanotap.orbit(case)
    # The drive supplies what lever and sample dissipate.
    work = orbit.energy_balance
    assert abs(work.residual) < 1e-7
    assert work.drive_work == pytest.approx(work.beam_damping + work.sample_damping)
    # The sample limits the amplitude.
    assert 13e-9 < orbit.physical.amplitude < 19e-9
    # The map returns to it, and its Jacobian has its multipliers.
    step = nanotap.Map(case)
    assert np.allclose(step(orbit.state), orbit.state, rtol=1e-9, atol=1e-12)
    found = np.linalg.eigvals(step.jacobian(orbit.state))
    for multiplier in orbit.multipliers:
        assert np.min(abs(found - multiplier)) < 1e-8
    # Arrays give the same as single calls.
    distances = np.array([14e-9, 15e-9])
    many = nanotap.orbit(case, **{"gap.tip": distances})
    assert many.amplitude.values[1] == pytest.approx(orbit.physical.amplitude, rel=1e-9)


@pytest.mark.parametrize("law", ["moving-surface", "dmt", "voigt-sphere"])
def test_studies_under_a_law(law):
    case = lever(law)
    ds = nanotap.sweep(case, over={"gap.tip": ["14 nm", "15 nm"]}, periods=2)
    assert (ds.period > 0).all()
    branch = nanotap.branch(case, parameter="gap.tip", from_="14 nm", to="15 nm")
    assert branch.stable.any()
