"""Laws written as formulas, in Python."""

import nanotap
import numpy as np
import pytest

LEVER = {
    "model": {"modes": 3},
    "cantilever": {"k": "2.8 N/m", "f0": "75 kHz", "Q": 200},
    "tip": {"radius": "8 nm"},
    "drive": {"frequency": "75 kHz", "free_amplitude": "20 nm"},
    "gap": {"tip": "16 nm"},
}
SAMPLE = {
    "modulus": "1.5 GPa",
    "poisson": 0.35,
    "hamaker": "8e-20 J",
    "intermolecular_distance": "0.17 nm",
}
DMT = "4/3*E/(1 - nu^2)*sqrt(R)*max(a0 - d, 0)^1.5 - H*R/(6*max(d, a0)^2)"


def test_a_formula_is_the_law_that_it_states():
    own = nanotap.Case(**LEVER, sample={"law": "formula", "force": DMT, **SAMPLE})
    short = nanotap.Case(**LEVER, sample=SAMPLE, sample_force=DMT)
    assert own == short
    built_in = nanotap.Case(**LEVER, sample={"law": "dmt", **SAMPLE})
    for name in ("amplitude", "phase", "peak_force"):
        found = [nanotap.orbit(case)[name] for case in (own, built_in)]
        assert found[0] == pytest.approx(found[1], rel=1e-11)
    assert nanotap.Case(**own.inputs) == own
    assert nanotap.Case.from_toml(own.to_toml()) == own


def test_parameters_are_quantities_of_the_case():
    parameters = {"k": "20 N/m", "c": "2e-7 N s/m"}
    case = nanotap.Case(
        **LEVER,
        sample={"law": "formula", "force": "k*max(-d, 0) - c*v*step(-d)", "parameters": parameters},
    )  # fmt: skip
    assert case["sample.parameters.k"] == "20 N/m"
    assert "sample.parameters.k" in case._ipython_key_completions_()
    spring = nanotap.Case(
        **LEVER, sample={"law": "spring-damper", "stiffness": "20 N/m", "damping": "2e-7 N s/m"}
    )  # fmt: skip
    assert nanotap.orbit(case).amplitude == pytest.approx(
        nanotap.orbit(spring).amplitude, rel=1e-11
    )
    # A number is in SI, and a swept one too.
    stiffer = case.with_({"sample.parameters.k": 30.0})
    assert stiffer == case.with_(sample={"parameters": {"k": "30 N/m"}})
    values = [20.0, 30.0]
    swept = nanotap.orbit(case, **{"sample.parameters.k": values})
    np.testing.assert_allclose(
        swept.amplitude,
        [nanotap.orbit(one).amplitude for one in (case, stiffer)],
        rtol=1e-9,
    )
    assert (
        nanotap.range("20 N/m", "30 N/m", 2).values("sample.parameters.k").tolist()
        == values
    )


def test_mistakes_are_said():
    with pytest.raises(ValueError, match="at character 1.*it is an energy"):
        nanotap.Case(**LEVER, sample=SAMPLE, sample_force="H*R/d")
    with pytest.raises(ValueError, match="it has no value"):
        nanotap.Case(**LEVER, sample=SAMPLE, sample_force="k*d")
