"""A physical case is answered in SI by every function, every Dataset can be saved and loaded, and
arrays of values give what single calls give."""

import inspect
import json

import nanotap
import numpy as np
import pytest
import xarray as xr

CASE = {
    "model": {"modes": 1},
    "cantilever": {"k": "2.8 N/m", "f0": "75 kHz", "Q": 200},
    "sample": {"stiffness": "20 N/m", "loss_tangent": 0.1},
    "drive": {
        "actuation": "tip",
        "frequency": "75 kHz",
        "free_amplitude": "20 nm",
    },
    "gap": {"tip": "15 nm"},
}

# What each function needs beyond the case, so that it is quick.
ARGUMENTS = {
    "approach": {"points": 5},
    "attractors": {"starts": 12},
    "basin": {
        "x": {"a1": nanotap.range("-1 nm", "1 nm", 3)},
        "y": {"v1": nanotap.range(-1e-3, 1e-3, 3)},
    },
    "branch": {"parameter": "gap.tip", "from_": "30 nm", "to": "10 nm"},
    "convergence": {"largest": 2},
    "fm": {"points": 3, "from_": "25 nm", "to": "19 nm"},
    "simulate": {"periods": 2},
    "sweep": {"over": {"gap.tip": [14e-9, 15e-9]}, "periods": 2, "starts": 2},
    "window": {
        "over": {"gap.tip": [14e-9, 15e-9], "drive.frequency": [74e3, 75e3]},
        "starts": 2,
    },
}
# They need measured data, a table [scan], a second tone, or no case.
ELSEWHERE = {
    "bimodal",
    "calibrate",
    "fit",
    "fit_map",
    "image_states",
    "reconstruct",
    "scan",
    "paper",
    "merge",
    "catalogue",
    "open",
    "read",
    "in_si",
    "lever",
}


@pytest.fixture(scope="module")
def lever():
    return nanotap.Case(**CASE)


def functions():
    """The functions that take a case."""
    for name in nanotap.__all__:
        function = getattr(nanotap, name)
        if inspect.isfunction(function) and name not in ELSEWHERE:
            yield name, function


@pytest.fixture(scope="module")
def datasets(lever):
    found = {}
    for name, function in functions():
        silent = (
            {"progress": False}
            if "progress" in inspect.signature(function).parameters
            else {}
        )
        result = function(lever, **ARGUMENTS.get(name, {}), **silent)
        if isinstance(result, xr.Dataset):
            found[name] = result
    found["orbit's series"] = nanotap.orbit(lever).series
    found["orbit over arrays"] = nanotap.orbit(lever, **{"gap.tip": [14e-9, 15e-9]})
    found["section"] = nanotap.lyapunov(lever).section
    return found


def test_there_are_datasets_of_most_functions(datasets):
    assert len(datasets) >= 9, sorted(datasets)


def test_every_number_has_a_unit_of_si(datasets):
    """States have several units; they stay in the model's and say so."""
    odd = {}
    for study, ds in datasets.items():
        for name, variable in ds.variables.items():
            unit = variable.attrs.get("units")
            is_model = (
                unit is not None
                and unit.startswith(("g0", "EI", "sqrt(m"))
                and unit != "g0/L"
            )
            if variable.dtype.kind == "f" and (unit is None or is_model):
                odd[f"{study}: {name}"] = unit
    assert odd == {}


def test_every_dataset_is_saved_and_loaded(datasets, tmp_path):
    for k, (study, ds) in enumerate(datasets.items()):
        ds.to_netcdf(tmp_path / f"{k}.nc")
        with xr.open_dataset(tmp_path / f"{k}.nc") as back:
            _same(study, ds, back)
        ds.to_zarr(tmp_path / f"{k}.zarr")
        with xr.open_zarr(tmp_path / f"{k}.zarr") as back:
            _same(study, ds, back)


def _same(study, ds, back):
    assert set(map(str, ds.variables)) == set(map(str, back.variables)), study
    for name, variable in ds.variables.items():
        values, loaded = variable.values, back[name].values
        if values.dtype.kind in "US" or loaded.dtype.kind in "OSU":
            assert list(map(str, values.ravel())) == list(map(str, loaded.ravel())), (
                study,
                name,
            )
        else:
            np.testing.assert_array_equal(values, loaded, f"{study}: {name}")


@pytest.mark.parametrize(
    "key", ["drive.frequency", "cantilever.Q", "gap.tip", "sample.stiffness"]
)
def test_arrays_sweeps_branches_and_derivatives_hold_the_same(lever, key):
    """The drive's own force stays in every study."""
    here = {
        "drive.frequency": 75e3,
        "cantilever.Q": 200.0,
        "gap.tip": 15e-9,
        "sample.stiffness": 20.0,
    }[key]
    values = [0.999 * here, here, 1.001 * here]
    many = nanotap.orbit(lever, **{key: values})
    single = [nanotap.orbit(lever, **{key: value}).physical.A for value in values]
    np.testing.assert_array_equal(many.first_harmonic, single)
    np.testing.assert_array_equal(many.physical_A, single)
    swept = nanotap.sweep(
        lever, over={key: values}, periods=3, transient=4000, progress=False
    )
    np.testing.assert_allclose(swept.first_harmonic.values.ravel(), single, rtol=1e-9)
    branch = nanotap.branch(
        lever, parameter=key, from_=values[0], to=values[2], progress=False
    )
    ends = branch.first_harmonic.values[np.argsort(branch[key].values)][[0, -1]]
    np.testing.assert_allclose(ends, [single[0], single[2]], rtol=1e-9)
    slope = nanotap.orbit(lever, derivatives=[key]).derivatives[key].physical.A
    assert slope == pytest.approx(
        (single[2] - single[0]) / (values[2] - values[0]), rel=1e-2
    )
    # Each states what was held.
    held = json.loads(many.attrs["held"])
    assert held == json.loads(branch.attrs["held"]) == json.loads(swept.attrs["held"])
    assert ("drive.force" in held) == (key != "drive.force")


def test_the_free_amplitude_may_be_held_instead(lever):
    key = "drive.frequency"
    free = lever.with_(**{"gap.tip": "100 nm"})
    values = [74e3, 75e3, 76e3]
    drive = nanotap.orbit(free, **{key: values}).first_harmonic
    assert drive.values[1] == pytest.approx(20e-9) and drive.values[0] < 5e-9
    held = free.with_(**{"drive.hold": "free_amplitude"})
    amplitude = nanotap.orbit(held, **{key: values}).first_harmonic
    np.testing.assert_allclose(amplitude, 20e-9, rtol=1e-9)
    swept = nanotap.sweep(held, over={key: values}, periods=2, progress=False)
    np.testing.assert_allclose(swept.first_harmonic.values.ravel(), 20e-9, rtol=1e-6)
    slope = nanotap.orbit(held, derivatives=[key]).derivatives[key].physical.A
    assert abs(slope) < 1e-18


def test_curves_of_two_levers_are_put_together_exactly(lever):
    other = lever.with_(**{"cantilever.k": "3.1 N/m", "gap.beam": "7 um"})
    call = {
        "from_": "30 nm",
        "to": "1 nm",
        "points": 13,
        "branches": False,
        "progress": False,
    }
    both = [nanotap.approach(case, **call) for case in (lever, other)]
    kept = ["first_harmonic", "phase"]
    joined = xr.concat([ds[kept] for ds in both], dim="lever", join="exact")
    assert joined.first_harmonic.dims == ("lever", "way", "zc")
    assert joined.sizes["zc"] == 13


def test_model_units_are_to_be_had(lever):
    plain = lever.with_(model_units=True)
    si, model = nanotap.simulate(lever, periods=2), nanotap.simulate(plain, periods=2)
    length = lever.physical.length_unit
    assert model.tip.attrs["units"] == "g0" and si.tip.attrs["units"] == "m"
    np.testing.assert_allclose(si.tip, length * model.tip, rtol=1e-12)
    np.testing.assert_array_equal(nanotap.in_si(model).tip, si.tip)
    swept = nanotap.sweep(plain, over={"gap.tip": [15e-9]}, periods=2, progress=False)
    assert swept.first_harmonic.attrs["units"] == "g0"
    assert plain != lever and plain.with_(model_units=False) == lever


def test_a_tuple_warns_where_it_was_a_range(lever):
    with pytest.warns(FutureWarning, match=r"nanotap\.range\(1.4e-08, 1.5e-08, 2\)"):
        swept = nanotap.sweep(
            lever, over={"gap.tip": (14e-9, 15e-9, 2)}, periods=2, progress=False
        )
    assert swept.sizes["gap.tip"] == 2
    values = nanotap.orbit(lever, **{"gap.tip": nanotap.range("14 nm", "15 nm", 2)})[
        "gap.tip"
    ]
    np.testing.assert_array_equal(values, [14e-9, 15e-9])


def of_pint(number, unit):
    return pytest.importorskip("pint").UnitRegistry().Quantity(number, unit)


def of_astropy(number, unit):
    return pytest.importorskip("astropy.units").Quantity(number, unit)


def of_unyt(number, unit):
    return pytest.importorskip("unyt").unyt_quantity(number, unit)


@pytest.mark.parametrize("quantity", [of_pint, of_astropy, of_unyt])
def test_quantities_are_taken_wherever_a_float_is(lever, quantity):
    call = {"points": 3, "branches": False, "progress": False}
    expected = nanotap.approach(lever, from_=25e-9, to=5e-9, **call)
    ends = {"from_": quantity(25, "nm"), "to": quantity(0.005, "um")}
    found = nanotap.approach(lever, **ends, **call)
    np.testing.assert_allclose(found.zc, expected.zc, rtol=1e-12)
    branch = nanotap.branch(
        lever, parameter="sample.stiffness", from_=quantity(20, "N/m"), to=21.0
    )
    assert float(branch["sample.stiffness"].min()) == pytest.approx(20)


def test_what_is_missing_is_not_found(tmp_path):
    missing = tmp_path / "no.toml"
    for call in (
        lambda: nanotap.Case.from_file(missing),
        lambda: nanotap.open(tmp_path / "no.zarr"),
        lambda: nanotap.merge([tmp_path / "no.zarr"], tmp_path / "all.zarr"),
        lambda: nanotap.fit(
            nanotap.Case(**CASE), data=tmp_path / "no.csv", free=["sample.stiffness"]
        ),
    ):
        with pytest.raises(FileNotFoundError, match=r"no\.(toml|zarr|csv)"):
            call()


def test_results_are_shown_briefly_and_compared(lever):
    orbit = nanotap.orbit(lever)
    assert "stable" in repr(orbit) and " m" in repr(orbit)
    assert "largest multiplier" in repr(
        nanotap.orbit(lever, observables=["first_harmonic"])
    )
    assert orbit == nanotap.orbit(lever) and orbit != nanotap.orbit(
        lever, **{"gap.tip": 16e-9}
    )
    closed = nanotap.Map(lever).orbit(orbit.state)
    assert closed == nanotap.Map(lever).orbit(orbit.state)
    shown = repr(lever)
    assert (
        "k = 2.8 N/m" in shown
        and "stiffness = 20 N/m" in shown
        and "tip = 15 nm" in shown
    )


def test_an_oscillator_takes_its_keys_as_keywords():
    stop = nanotap.Case(
        kind="impact",
        gap=1,
        stiffness=1,
        damping=0.1,
        forcing=1,
        omega=2.5,
        restitution=0.8,
    )
    assert stop.gap == 1
    assert nanotap.simulate(stop, gap=[0.5, 1.0], periods=2).sizes["gap"] == 2


def test_lengths_without_a_unit_are_remarked_upon():
    case = nanotap.Case(**{**CASE, "gap": {"tip": 18}})
    assert any("did you mean 18 nm" in text for _, text in case.remarks)
    # Other quantities, and another prefix.
    for section, key, value, meant in (
        ("cantilever", "f0", 325.0, "325 kHz"),
        ("cantilever", "k", "40 kN/m", "40 N/m"),
        ("gap", "tip", "15 mm", "15 nm"),
    ):
        given = {**CASE, section: {**CASE.get(section, {}), key: value}}
        remarks = [text for _, text in nanotap.Case(**given).remarks]
        assert any(f"did you mean {meant}?" in text for text in remarks), remarks


def test_a_curve_from_metres_away_is_refused():
    with pytest.raises(ValueError, match="5 m without a unit; did you mean 5 nm"):
        nanotap.approach(nanotap.Case(**CASE), from_=5)


def test_without_bifurcations_their_columns_are_empty(lever):
    ds = nanotap.branch(
        lever, parameter="gap.tip", from_="15 nm", to="14.9 nm", progress=False
    )
    assert ds.bifurcation_parameter.shape == (0,) and ds.bifurcation_kind.shape == (0,)
