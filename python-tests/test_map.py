"""The map, compared with orbits and runs, references and finite differences."""

import json
import os
import pathlib
import pickle
from concurrent.futures import ThreadPoolExecutor

import nanotap
import numpy as np
import pytest

REFERENCES = (
    pathlib.Path(__file__).resolve().parent.parent / "crates/nanotap/tests/reference"
)


@pytest.fixture(scope="module")
def map_(regular):
    return nanotap.Map(regular)


@pytest.fixture(scope="module")
def orbit(regular):
    return nanotap.orbit(regular)


def central(f, h):
    """A fourth-order central difference of f about 0."""
    return (f(-2 * h) - 8 * f(-h) + 8 * f(h) - f(2 * h)) / (12 * h)


def test_states_and_contacts_of_a_fifty_digit_reference():
    reference = json.loads((REFERENCES / "W1_Om2.6_N3.json").read_text())
    map_ = nanotap.Map(nanotap.Case.paper())
    for periods, state in reference["states"].items():
        found = map_(np.zeros(6), periods=int(periods))
        expected = np.array(state["a"] + state["adot"], dtype=float)
        assert np.abs(found - expected).max() < 1e-11
    motion = map_.flow(np.zeros(6), 20 * map_.period)
    times = [float(event["tau"]) for event in reference["events"]]
    assert np.abs(np.array([e.tau for e in motion.events]) - times).max() < 1e-11


def test_an_orbit_is_a_fixed_point(map_, orbit):
    assert map_.dimension == 6
    assert map_.period == pytest.approx(2 * np.pi / 3)
    assert np.abs(map_(orbit.state) - orbit.state).max() < 1e-13
    closed = map_.orbit(orbit.state + 1e-3)
    assert closed.period == 1
    assert closed.stable
    assert np.abs(closed.state - orbit.state).max() < 1e-12
    assert np.allclose(closed.multipliers, orbit.multipliers, atol=1e-10)


def test_arrays_are_as_their_states_alone(map_, orbit):
    rng = np.random.default_rng(1)
    z = orbit.state + 0.05 * rng.standard_normal((5, 7, 6))
    together = map_(z, periods=300)
    assert together.shape == z.shape
    alone = np.array([[map_(one, periods=300) for one in row] for row in z])
    # Many states at once agree with single ones to rounding.
    assert np.abs(together - alone).max() < 1e-13
    assert np.array_equal(together[2:4], map_(z[2:4], periods=300))
    assert np.array_equal(together, map_(z, periods=300, threads=1))
    assert np.array_equal(map_(z, periods=0), z)
    assert map_(np.empty((0, 6))).shape == (0, 6)


def test_iterates(map_):
    z = np.zeros(6)
    every = map_.iterate(z, 12)
    assert every.shape == (13, 6)
    assert np.abs(every[12] - map_(z, periods=12)).max() < 1e-13
    assert np.abs(map_.iterate(z, 12, every=5) - every[::5]).max() < 1e-13


@pytest.mark.parametrize("periods", [1, 3])
def test_derivatives_are_those_of_high_order_differences(regular, map_, orbit, periods):
    rng = np.random.default_rng(2)
    z = orbit.state + 0.01 * rng.standard_normal(6)

    def from_state(direction):
        return lambda h: map_(z + h * direction, periods)

    def by_key(key):
        return lambda h: nanotap.Map(regular, **{key: regular[key] + h})(z, periods)

    jacobian = map_.jacobian(z, periods)
    for column, direction in zip(jacobian.T, np.eye(6), strict=True):
        slope = central(from_state(direction), 1e-5)
        assert np.abs(column - slope).max() < 1e-7 * np.abs(jacobian).max()
    keys = ["alpha1", "alpha4", "alpha5", "omega"]
    for key, column in zip(keys, map_.derivative(z, keys, periods).T, strict=True):
        slope = central(by_key(key), 1e-5 * max(regular[key], 1))
        assert np.abs(column - slope).max() < 1e-7 * np.abs(slope).max()
        assert np.array_equal(column, map_.derivative(z, key, periods))
    two = map_.jacobian(np.array([z, orbit.state]), periods)
    assert np.array_equal(two[0], jacobian)


def test_derivatives_by_physical_quantities(physical):
    modulus = 3.5e9

    def map_of(change):
        words = {"sample.modulus": f"{modulus * (1 + change)!r} Pa"}
        return nanotap.Map(physical, **words)

    z = map_of(0)(np.zeros(6), periods=20)
    slope = central(lambda h: map_of(h)(z), 1e-5) / modulus
    exact = map_of(0).derivative(z, "sample.modulus")
    assert np.abs(exact - slope).max() < 1e-6 * np.abs(slope).max()


def test_a_motion_between_its_strobes(regular, map_, orbit):
    run = nanotap.simulate(
        regular, periods=3, transient=0, state=orbit.state, series=3, resolution=50
    )
    seen = map_.flow(orbit.state, run.tau.values)
    for name in ("tip", "tip_rate", "gap", "force"):
        assert np.abs(getattr(seen, name) - run[name].values).max() < 1e-11
    assert np.array_equal(seen.contact, run.contact.values)
    assert np.abs(seen.state - run.states.values).max() < 1e-11
    assert [event.kind for event in seen.events] == list(run.event_kind.values)
    assert np.abs([e.tau for e in seen.events] - run.events.values).max() < 1e-12
    # A whole period is the map; a part of it and the rest make the whole.
    end = map_.flow(orbit.state, map_.period)
    assert end.state.shape == (6,)
    assert np.abs(end.state - map_(orbit.state)).max() < 1e-13
    half = map_.flow(orbit.state, 0.4).state
    rest = map_.flow(half, map_.period, start=0.4)
    assert np.abs(rest.state - map_(orbit.state)).max() < 1e-12
    # In flight the guard is the gap; at every switch it vanishes.
    flight = ~seen.contact
    assert np.array_equal(seen.guard[flight], seen.gap[flight])
    for event in seen.events:
        assert abs(seen(event.tau).gap) < 1e-12


def test_maps_and_motions_can_be_pickled_and_shared(map_, orbit):
    again = pickle.loads(pickle.dumps(map_))
    assert np.array_equal(again(orbit.state, 50), map_(orbit.state, 50))
    motion = map_.flow(orbit.state, [0.1, 0.5])
    copy = pickle.loads(pickle.dumps(motion))
    assert np.array_equal(copy.state, motion.state)
    starts = orbit.state * np.linspace(0.9, 1.1, 16)[:, None]
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda z: map_(z, periods=400), starts))
    assert np.abs(np.array(found) - map_(starts, periods=400)).max() < 1e-13
    with ThreadPoolExecutor(4) as threads:
        halves = threads.map(lambda z: map_(z, periods=400), [starts[:8], starts[8:]])
    assert np.array_equal(np.concatenate(list(halves)), map_(starts, periods=400))


def test_what_makes_no_sense_is_refused(map_):
    z = np.zeros(6)
    with pytest.raises(ValueError, match="last axis"):
        map_(np.zeros(5))
    with pytest.raises(ValueError, match="state 1"):
        map_(np.array([z, z * np.nan]))
    with pytest.raises(ValueError, match="periods"):
        map_(z, periods=-1)
    with pytest.raises(ValueError, match="alpha4"):
        map_.derivative(z, "alpha44")
    with pytest.raises(ValueError, match="are too many"):
        map_.iterate(z, 10**12)
    with pytest.raises(ValueError, match="100000 drive periods"):
        map_.flow(z, 1e9)
    with pytest.raises(ValueError, match="first drive period"):
        map_.flow(z, 20.0, start=10.0)
    with pytest.raises(ValueError, match="known from"):
        map_.flow(z, 1.0)(2.0)
    assert map_.orbit(z, period=7).period == 1
    with pytest.raises(TypeError):
        nanotap.Map("case.toml")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_child_has_threads_of_its_own(map_, regular, orbit):
    starts = orbit.state * np.linspace(0.9, 1.1, 64)[:, None]
    there = map_(starts, periods=200)
    census = nanotap.attractors(regular, starts=16)
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            same = np.array_equal(map_(starts, periods=200), there)
            again = nanotap.attractors(regular, starts=16)
            code = 0 if same and len(again) == len(census) else 2
        finally:
            os.write(writer, bytes([code]))
            os._exit(0)
    os.close(writer)
    import select

    ready, _, _ = select.select([reader], [], [], 60)
    if not ready:
        os.kill(child, 9)
    os.waitpid(child, 0)
    assert ready, "the child hangs"
    assert os.read(reader, 1) == b"\0"


def test_derivatives_of_what_is_observed_of_an_orbit(regular):
    orbit = nanotap.orbit(regular, derivatives=["alpha4", "omega"])

    def amplitude(h):
        return nanotap.orbit(regular, alpha4=20 + h, state=orbit.state, period=1)

    by = orbit.derivatives["alpha4"]
    for name in ("first_harmonic", "phase", "tip_max", "peak_force", "mean_deflection"):
        slope = central(lambda h, name=name: getattr(amplitude(h), name), 0.02)
        assert abs(by[name] - slope) < 1e-6 * abs(slope)
    state = central(lambda h: amplitude(h).state, 0.02)
    assert np.abs(np.array(by["state"]) - state).max() < 1e-6 * np.abs(state).max()
    with pytest.raises(ValueError, match="alpha44"):
        nanotap.orbit(regular, derivatives=["alpha44"])
