"""The map of the states at a held setpoint, against orbits and a solution of each case alone."""

from pathlib import Path

import nanotap
import numpy as np
import pytest

LEVER = Path(__file__).parents[1] / "docs/cases/bistable-lever.toml"
SETPOINT = 0.9
FREE = 10e-9


@pytest.fixture(scope="module")
def case():
    lever = nanotap.Case.from_file(LEVER)
    return lever.with_(
        **{"gap.tip": None, "drive.setpoint": SETPOINT, "model.modes": 1}
    )


@pytest.fixture(scope="module")
def found(case):
    over = ["sample.modulus=2GPa,70GPa", "sample.hamaker=20zJ,140zJ"]
    return nanotap.window(case, over=over)


def test_each_state_is_an_orbit_at_the_setpoint(case, found):
    seen = 0
    for hamaker in found["sample.hamaker"].values:
        for modulus in found["sample.modulus"].values:
            point = found.sel({"sample.hamaker": hamaker, "sample.modulus": modulus})
            sample = {"sample.hamaker": hamaker, "sample.modulus": modulus}
            states = {}
            for regime in ("attractive", "repulsive"):
                distance = float(point[f"{regime}_distance"])
                if not np.isfinite(distance):
                    continue
                states[regime] = distance
                there = case.with_(
                    **sample, **{"drive.setpoint": None, "gap.tip": distance}
                )
                # One of the motions that coexist there has this amplitude and phase.
                motions = nanotap.attractors(there, starts=32)
                near = [
                    one
                    for one in motions
                    if one.physical.A == pytest.approx(SETPOINT * FREE, rel=1e-7)
                ]
                phase = float(point[f"{regime}_phase"])
                assert any(
                    one.physical.phase == pytest.approx(phase, abs=1e-4) for one in near
                ), (regime, sample)
                seen += 1
            assert int(point["states"]) == len(states)
            step = float(point["step_height"])
            if len(states) == 2:
                apart = abs(states["attractive"] - states["repulsive"])
                assert step == pytest.approx(apart, rel=1e-9)
            else:
                assert np.isnan(step)
    # More states than points.
    assert seen > found["states"].size


def test_it_says_where_false_steps_are_possible(found):
    both = int((found["states"] > 1).sum())
    assert both > 0
    assert found["step_height"].attrs["units"] == "m"
    assert f"{25 * both:.1f} % of the points" in found.attrs["verdict"]
