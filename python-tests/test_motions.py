"""Runs, orbits, censuses: the terminal's numbers as Python objects."""

import json
import pickle
import subprocess

import nanotap
import numpy as np
import pytest
import xarray as xr
from conftest import PHYSICAL
from program import PROGRAM


def terminal(tmp_path, case, *arguments):
    (tmp_path / "case.toml").write_text(case.to_toml())
    command = [PROGRAM, arguments[0], "case.toml", *map(str, arguments[1:]), "--json"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    document = json.loads(done.stdout)
    # Entries that a Python caller has anyway.
    assert document.pop("version") == nanotap.__version__
    assert document.pop("case") == case.to_dict()
    return document


def test_a_run_has_the_terminals_numbers(regular, tmp_path):
    said = terminal(
        tmp_path, regular, "simulate", "--periods", 20, "--transient", 0, "--strobe", 20
    )
    ds = nanotap.simulate(regular, periods=20, transient=0, strobe=20)
    assert ds.strobe.dims == ("strobe_period", "state")
    assert ds.state.values.tolist() == ["a1", "a2", "a3", "v1", "v2", "v3"]
    np.testing.assert_array_equal(ds.strobe, said["strobe"])
    np.testing.assert_array_equal(ds.events, [event["tau"] for event in said["events"]])
    assert ds.event_kind.values.tolist() == [event["kind"] for event in said["events"]]
    assert ds.classification.item() == said["classification"] == "periodic"
    for name in (
        "period",
        "tip_max",
        "tip_min",
        "amplitude",
        "contact_fraction",
        "beam_clearance",
    ):
        assert ds[name].item() == said[name], name
    for key, value in said["energy_balance"].items():
        assert ds.energy_balance.sel(energy=key) == value
    assert json.loads(ds.attrs["case"])["omega"] == 3
    for name, variable in ds.variables.items():
        if name in {"tip", "gap", "force", "strobe", "tau", "amplitude", "events"}:
            assert variable.attrs["long_name"] and variable.attrs["units"], name


def test_observables_are_those_that_are_named(regular):
    """One orbit, many, and a run: requested observables equal those of a full call; no others."""
    asked = {"observables": ["A", "phase", "gap_range"]}
    every = nanotap.orbit(regular)
    some = nanotap.orbit(regular, **asked)
    assert some.first_harmonic == pytest.approx(every.first_harmonic, rel=1e-13)
    assert some.gap_range == every.gap_range
    with pytest.raises(AttributeError, match="there is no `tip_max`"):
        _ = some.tip_max
    assert "W from" in repr(every) and "W from" not in repr(some)
    many = nanotap.orbit(regular, omega=[3.0, 3.01], **asked)
    assert {"first_harmonic", "phase", "gap_range"} <= set(many)
    assert not {"tip_max", "beam_clearance", "dissipation"} & set(many)
    run = nanotap.simulate(regular, periods=3, observables=["E_dis"])
    assert "dissipation" in run.attrs or "dissipation" in run
    assert "first_harmonic" not in run and "first_harmonic" not in run.attrs
    with pytest.raises(ValueError, match="did you mean `phase`"):
        nanotap.orbit(regular, observables=["phas"])


def test_orbits_are_proved(regular, tmp_path):
    said = terminal(tmp_path, regular, "orbit", "--prove")
    proof = nanotap.orbit(regular, prove=True).proof
    assert proof.to_dict() == said["proof"]
    assert proof.proved and proof.stability == "stable"
    orbit = nanotap.orbit(regular)
    assert orbit.proof is None
    for (low, high), value in zip(proof.state, orbit.state, strict=True):
        assert low - 1e-9 < value < high + 1e-9
    assert nanotap.attractors(regular, starts=4, prove=True)[0].proof.proved


def test_a_time_series_fits_its_run(regular):
    ds = nanotap.simulate(regular, periods=4, resolution=500)
    assert ds.sizes["tau"] == 4 * 500 + 1
    # W = 2 Σ ±a_j (the modes' ends), and no sample passes the exact extrema.
    signs = xr.DataArray([2, -2, 2], dims="state")
    tip = (ds.states.isel(state=slice(3)).drop_vars("state") * signs).sum("state")
    np.testing.assert_allclose(tip, ds.tip, atol=1e-14)
    assert ds.tip.max() <= ds.tip_max + 1e-14 and ds.tip.max() > ds.tip_max - 1e-4
    # The gap: W + α2 sin Ωτ + α5; contact where it is closed.
    np.testing.assert_allclose(ds.gap, ds.tip + 0.1 * np.sin(3 * ds.tau), atol=1e-13)
    assert ((ds.gap < -1e-12) <= ds.contact).all()
    assert float(ds.contact.mean()) == pytest.approx(
        ds.contact_fraction.item(), abs=2e-3
    )
    assert (
        nanotap.simulate(regular, periods=300, transient=0).sizes["tau"]
        == 100 * 200 + 1
    )
    assert nanotap.simulate(regular, periods=3, series=0, transient=0).sizes["tau"] == 0


def test_an_orbit_has_the_terminals_numbers(regular, tmp_path):
    said = terminal(tmp_path, regular, "orbit")
    orbit = nanotap.orbit(regular)
    assert orbit.to_dict() == said
    np.testing.assert_array_equal(orbit.state, said["state"])
    assert orbit.multipliers.tolist() == [
        complex(*pair) for pair in said["multipliers"]
    ]
    # numpy's size of a complex number may differ in the last digit.
    assert orbit.stable
    assert orbit.spectral_radius == pytest.approx(abs(orbit.multipliers[0]), rel=1e-15)
    assert abs(orbit.energy_balance.residual) < 1e-11
    assert orbit.thd == orbit["thd"] == said["thd"]
    assert orbit.harmonics[0].tip == said["harmonics"][0]["tip"]
    assert orbit.rms_deflection == said["rms_deflection"]
    assert list(orbit.spectrum().columns[:2]) == ["tip", "tip_phase"]
    # The motion is periodic: the series ends where it begins.
    np.testing.assert_allclose(
        orbit.series.states[0], orbit.series.states[-1], atol=1e-12
    )


def test_a_physical_orbit_is_told_in_si(physical):
    orbit = nanotap.orbit(physical)
    scale = physical.physical.length_unit
    plain = orbit.to_dict()["amplitude"]
    assert orbit.amplitude == orbit.physical.amplitude
    assert orbit.amplitude == pytest.approx(plain * scale, rel=1e-12)
    assert orbit.units["amplitude"] == "m" and orbit.first_harmonic == orbit.physical.A
    model = nanotap.orbit(physical.with_(model_units=True))
    assert model.amplitude == plain and model.units["amplitude"] == "g0"
    assert orbit.physical.frequency == pytest.approx(65.7e3, rel=1e-9)
    ds = nanotap.simulate(physical, periods=5)
    assert ds.physical_amplitude.attrs["units"] == "m"
    assert ds.physical_amplitude == pytest.approx(orbit.physical.amplitude, rel=1e-6)


def test_arrays_are_many_runs(regular):
    omega = np.linspace(2.9, 3.1, 3)
    ds = nanotap.orbit(regular, omega=omega, alpha6=[0.1, 0.2])
    assert ds.tip_max.dims == ("omega", "alpha6")
    np.testing.assert_array_equal(ds.omega, omega)
    for k in range(3):
        alone = nanotap.orbit(regular, omega=omega[k], alpha6=0.2)
        assert ds.tip_max[k, 1] == alone.tip_max
        assert float(ds.spectral_radius[k, 1]) == pytest.approx(
            alone.spectral_radius, rel=1e-15
        )
        np.testing.assert_array_equal(ds.orbit_state[k, 1], alone.state)
    runs = nanotap.simulate(regular, periods=6, strobe=2, transient=3, omega=omega)
    assert runs.strobe.dims == ("omega", "strobe_period", "state")
    assert runs.strobe_period.values.tolist() == [5, 6]
    one = nanotap.simulate(regular, periods=6, strobe=2, transient=3, omega=omega[0])
    np.testing.assert_array_equal(runs.strobe[0], one.strobe)
    assert (runs.failure == "").all()


def test_arrays_with_named_dimensions_go_together(regular):
    # A path through two parameters, not their product.
    path = np.linspace(0, 1, 4)
    omega = xr.DataArray(3 + 0.1 * path, dims="step", coords={"step": path})
    alpha4 = xr.DataArray(20 - 5 * path, dims="step", coords={"step": path})
    ds = nanotap.orbit(regular, omega=omega, alpha4=alpha4)
    assert ds.amplitude.dims == ("step",)
    np.testing.assert_array_equal(ds.alpha4, alpha4)
    assert ds.amplitude[3] == nanotap.orbit(regular, omega=3.1, alpha4=15).amplitude


def test_an_orbit_says_which_knock_upsets_it(regular):
    alone = nanotap.orbit(regular, upset=True).upset
    assert alone.smallest is None and alone.largest_tried > 0
    # The free motion of a lever that taps after a knock (crates/nanotap/tests/experiments/upset.rs).
    bistable = nanotap.Case(
        model={"modes": 1},
        cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
        sample={"stiffness": "8 N/m", "damping": "0 N s/m"},
        drive={
            "actuation": "tip",
            "frequency_ratio": 1.01,
            "free_amplitude": "6.6 nm",
        },
        gap={"tip": "14 nm"},
    )
    found = nanotap.orbit(bistable, upset=True).upset.smallest
    assert found.leads_to == "periodic" and found.period == 1
    assert found.physical.A > 14e-9
    # m v²/2 of the mass k₁/ω₁², where k₁ = 1.0302 k.
    energy = 1.030197 * (found.physical.tip_speed / (2 * np.pi * 70e3)) ** 2
    assert found.physical.energy == pytest.approx(energy, rel=1e-3)
    assert nanotap.orbit(regular).upset is None


def test_a_motion_says_from_which_start_it_follows(regular):
    for found in (
        nanotap.orbit(regular),
        nanotap.lyapunov(regular, periods=10, transient=10),
    ):
        assert "from rest" in found.notes[0] and "`attractors`" in found.notes[0]
        assert found.to_dict()["notes"] == found.notes
    run = nanotap.simulate(regular)
    assert "from rest" in run.attrs["notes"] and "`attractors`" in run.attrs["notes"]
    given = nanotap.orbit(regular, state=nanotap.orbit(regular).state)
    assert "from the given state" in given.notes[0]


def test_where_there_is_no_orbit_the_reason_stands(regular):
    ds = nanotap.orbit(regular, omega=[2.6, 3.0])
    assert "not periodic" in ds.failure.values[0] and ds.failure.values[1] == ""
    assert np.isnan(ds.tip_max[0]) and ds.tip_max[1] > 0


def test_a_census_has_the_terminals_numbers(bistable, tmp_path):
    said = terminal(tmp_path, bistable, "attractors", "--starts", 48)
    found = nanotap.attractors(bistable, starts=48, threads=1)
    assert found.to_dict() == said
    assert sorted(one.period for one in found) == [1, 4]
    assert sum(one.fraction for one in found) == pytest.approx(1)
    assert found[0].states.shape == (found[0].period, 6)
    assert len(found.attractors) == len(found) == 2 and not found.undecided
    assert list(found.table().period) == [one.period for one in found]
    check = nanotap.attractors(bistable, starts=24, check=5).check
    assert (check.starts, check.agreed, check.disagreements) == (5, 5, [])
    assert found.check is None
    fixed = nanotap.attractors(
        bistable, starts=8, box={name: (0, 0) for name in bistable.state_names}
    )
    assert len(fixed) == 1 and fixed[0].fraction == 1


def test_modes_have_the_terminals_numbers(regular, tmp_path):
    said = terminal(tmp_path, regular, "modes")
    modes = nanotap.modes(regular)
    for name in ("free", "contact", "exact_free", "exact_contact"):
        np.testing.assert_array_equal(modes[name], said[name])
    # φ_j(1) = 2 (−1)^(j+1), clamped at 0.
    np.testing.assert_allclose(modes.shapes[-1], [2, -2, 2], rtol=1e-12)
    np.testing.assert_allclose(modes.shapes[0], 0, atol=1e-12)
    assert modes.table().shape == (3, 4)


def test_exponents_and_section(regular):
    chaos = nanotap.lyapunov(regular.with_(omega=2.6), periods=2000, points=200)
    assert chaos.classification == "chaotic" and chaos.exponents[0] > 0.1
    # They differ only by the ends of the average.
    assert chaos.sum == pytest.approx(chaos.sum_by_trace, abs=0.01)
    assert chaos.section.states.shape == (200, 6)
    contact = nanotap.lyapunov(regular, periods=500, points=50, section="contact")
    # At the beginning of a contact the gap closes.
    assert (contact.section.gap_rate < 0).all()


def test_more_modes(regular):
    found = nanotap.convergence(regular, largest=4)
    assert found.modes == [1, 2, 3, 4]
    assert found.difference[-1] == 0 and found.difference[0] > found.difference[1]
    assert found.table().index.name == "modes"


def test_branches_have_the_terminals_numbers(regular, tmp_path):
    said = terminal(
        tmp_path, regular, "branch", "--parameter", "omega", "--from", 3.0, "--to", 2.9
    )
    ds = nanotap.branch(regular, parameter="omega", from_=3.0, to=2.9)
    np.testing.assert_array_equal(
        ds.omega, [point["parameter"] for point in said["points"]]
    )
    np.testing.assert_array_equal(
        ds.tip_max, [point["tip_max"] for point in said["points"]]
    )
    np.testing.assert_array_equal(
        ds.states, [point["state"] for point in said["points"]]
    )
    assert ds.bifurcation_kind.values.tolist() == [
        b["kind"] for b in said["bifurcations"]
    ]
    flip = ds.bifurcation_parameter.values[0]
    assert ds.bifurcation_kind.values[0] == "flip" and 2.9 < flip < 3.0
    # Stable on one side of the flip, not on the other.
    assert bool(ds.stable[0]) and not bool(ds.stable[-1])
    np.testing.assert_array_equal(ds.spectral_radius < 1, ds.stable)


def test_the_time_steps_of_the_paper(regular):
    ds = nanotap.simulate(regular, method="rk4", steps=200, periods=10, strobe=10)
    assert ds.attrs["exact_classification"] == "periodic"
    assert ds.strobe.shape == (10, 6)
    exact = nanotap.orbit(regular)
    assert ds.tip_max.item() == pytest.approx(exact.tip_max, abs=0.02)


def test_a_distance_left_to_the_setpoint_is_solved_for(physical):
    tables = {
        "cantilever": {"lever": "PPP-FM", "Q": 200},
        "tip": {"mass_ratio": 0.1},
        "sample": {"material": "polystyrene"},
        "drive": {"frequency": "65.7 kHz", "free_amplitude": "20 nm", "setpoint": 0.9},
    }
    case = nanotap.Case(**tables)
    report = case.setpoint_distances
    assert report.ratio == 0.9
    # There the first harmonic is nine tenths of A₀.
    orbit = nanotap.orbit(case)
    assert orbit.physical.A == pytest.approx(0.9 * 20e-9, rel=1e-6)
    ds = nanotap.simulate(case, periods=2)
    gap = json.loads(ds.attrs["case"])["physical"]["tip_gap"]
    assert gap == pytest.approx(report.solutions[report.chosen].zc, rel=1e-9)
    assert physical.setpoint_distances is None


def test_a_diagram_has_the_shares_of_its_attractors(regular):
    ds = nanotap.branch(
        regular, parameter="omega", from_=3.0, to=3.1, diagram=True, values=3, starts=8
    )
    assert ds.attractor_number.dims == ("attractor",)
    first = ds.attractor_number.values == ds.attractor_number.values[0]
    assert ds.attractor_parameter.values[first] == pytest.approx([3.0, 3.05, 3.1])
    assert set(ds.attractor_classification.values[first]) == {"periodic"}
    assert ds.attractor_share.attrs["units"] == "1"
    assert (ds.attractor_share.values <= 1).all()


def test_events_are_located_on_branches(regular):
    value = float(nanotap.orbit(regular.with_(omega=3.1)).tip_max)
    ds = nanotap.branch(
        regular,
        parameter="omega",
        from_=3.0,
        to=3.2,
        event=f"tip_max = {value!r}",
        second="alpha4=19:21",
    )
    assert 3.1 == pytest.approx(float(ds.event_parameter[0]), abs=1e-9)
    assert ds.event_name.values[0].startswith("tip_max")
    of_event = ds.locus_kind.values == "event"
    assert of_event.any()
    assert float(np.abs(ds.locus_second.values[of_event] - 20).min()) < 1e-9


def test_physical_quantities_vary(physical):
    ds = nanotap.branch(
        physical, parameter="gap.tip", from_="19 nm", to="18 nm", max_step=0.1
    )
    low, high = float(ds["gap.tip"].min()), float(ds["gap.tip"].max())
    assert (low, high) == pytest.approx((18e-9, 19e-9), rel=1e-6)
    swept = nanotap.sweep(
        physical, over={"gap.tip": nanotap.range("17 nm", "19 nm", 3)}, periods=3
    )
    middle = nanotap.orbit(physical.with_(**{"gap.tip": "18 nm"}))
    np.testing.assert_allclose(swept["gap.tip"], [17e-9, 18e-9, 19e-9], rtol=1e-9)
    # Over physical quantities, observables are in SI.
    assert float(swept.tip_max[1, 0]) == pytest.approx(
        middle.physical.tip_max, rel=1e-3
    )
    window = nanotap.window(
        physical,
        over={
            "gap.tip": nanotap.range("15 nm", "30 nm", 3),
            "drive.frequency": nanotap.range("65 kHz", "66 kHz", 2),
        },
        starts=3,
    )
    assert window.condition.shape == (2, 3)
    assert float(window.share.sum()) == pytest.approx(1)
    # Beyond its free amplitude the tip touches nothing.
    assert window.condition.values[1, 2] == "no-contact"
    with pytest.raises(ValueError, match="a window has two parameters"):
        nanotap.window(physical, over="gap.tip=15nm:30nm:3")
    # The distance of a setpoint is solved, and the motion there has its amplitude.
    swept = nanotap.sweep(
        physical,
        over={"drive.setpoint": [0.85, 0.9]},
        where="regime = repulsive",
        periods=2,
    )
    np.testing.assert_allclose(swept.first_harmonic[:, 0], [17e-9, 18e-9], rtol=1e-6)
    assert float(swept.distance[0, 0]) < float(swept.distance[1, 0])
    assert swept.holds.values.tolist() == [True, True]
    with pytest.raises(ValueError, match="did you mean `F_max`"):
        nanotap.sweep(physical, over="drive.setpoint=0.8,0.9", where=["F_mx < 1 nN"])
    with pytest.raises(ValueError, match=r"gap\.tap"):
        nanotap.sweep(physical, over="gap.tap=15nm:30nm:3")


def test_rows_of_states_are_runs_of_their_own(regular):
    states = np.zeros((3, 6))
    states[1, 0], states[2, 0] = 0.1, -0.1
    many = nanotap.simulate(regular, state=states, periods=5, transient=0)
    assert many.sizes["start"] == 3
    np.testing.assert_array_equal(many.initial_state, states)
    for k, state in enumerate(states):
        one = nanotap.simulate(regular, state=state, periods=5, transient=0)
        assert float(one.tip_max) == float(many.tip_max[k])
    both = nanotap.orbit(regular, state=states, omega=[2.9, 3.0])
    assert both.tip_max.dims == ("omega", "start")
    with pytest.raises(ValueError, match="one per row"):
        nanotap.simulate(regular, state=np.zeros((2, 2, 6)))


def test_an_orbit_of_a_physical_case_is_seen_in_si():
    case = nanotap.Case(**PHYSICAL)
    orbit = nanotap.orbit(case)
    assert orbit.series is not None and orbit.physical is not None
    series = orbit.series_in_si
    assert series.tip.attrs["units"] == "m" and series.tau.attrs["units"] == "s"
    # A drive period, and the largest deflection, as in the document.
    period = float(series.tau[-1]) / orbit.period
    assert period == pytest.approx(1 / case.physical.drive_frequency, rel=1e-9)
    assert float(series.tip.max()) <= orbit.physical.tip_max * (1 + 1e-9)
    assert "largest tip deflection" in orbit._repr_html_()
    assert "cantilever.lever" in case._repr_html_() and "PPP-FM" in case._repr_html_()
    again = pickle.loads(pickle.dumps(orbit))
    assert again.series.equals(orbit.series)
    with pytest.raises(ValueError, match="unit of length"):
        nanotap.orbit(nanotap.Case.paper(omega=3)).series_in_si  # noqa: B018


def test_arrays_have_what_single_orbits_have(physical):
    """All numbers, texts and vectors, under the same names and with the same bits."""
    keys = {"gap.tip": [17e-9, 18e-9], "drive.free_amplitude": ["20 nm", "21 nm"]}
    many = nanotap.orbit(physical, **keys)
    assert many.amplitude.dims == ("gap.tip", "drive.free_amplitude")
    alone = nanotap.orbit(
        physical.with_(**{"gap.tip": 18e-9, "drive.free_amplitude": "20 nm"})
    )
    one = many.sel({"gap.tip": 18e-9, "drive.free_amplitude": "20 nm"})
    np.testing.assert_array_equal(one.orbit_state, alone.state)
    np.testing.assert_array_equal(one.gap_range, alone.gap_range)
    assert int(one.period) == alone.period and bool(one.stable) is alone.stable
    assert one.stability.item() == alone.stability and one.failure.item() == ""
    assert float(one.physical_A) == alone.physical["A"]
    assert float(one.spectral_radius) == pytest.approx(alone.spectral_radius)
    assert dict(zip(one.energy.values, one.energy_balance.values, strict=True)) == (
        alone.energy_balance.to_dict()
    )
    assert many.amplitude.attrs["units"] == "m"
    # The unit of length follows from the distance, which varies here.
    for name, si in (("amplitude", "amplitude"), ("first_harmonic", "A")):
        np.testing.assert_array_equal(nanotap.in_si(many)[name], many[f"physical_{si}"])
    run = nanotap.simulate(physical, periods=2)
    assert float(nanotap.in_si(run).peak_force) == pytest.approx(
        float(run.physical_F_max), rel=1e-12
    )


def test_arrays_of_modes_leave_room_for_every_state(regular):
    many = nanotap.orbit(regular, modes=[1, 2])
    assert list(many.state.values) == ["a1", "a2", "v1", "v2"]
    states = many.orbit_state.values
    np.testing.assert_array_equal(np.isnan(states[0]), [False, True, False, True])
    alone = nanotap.orbit(regular.with_(modes=1)).state
    np.testing.assert_array_equal(states[0, [0, 2]], alone)
    assert not np.isnan(states[1]).any()
