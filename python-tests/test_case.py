"""Cases: their values, changes to them, and error messages."""

import json
import pickle
import subprocess

import nanotap
import numpy as np
import pandas as pd
import pytest
from conftest import PHYSICAL
from program import PROGRAM, ROOT

GIVEN = {
    "modes": 3,
    "alpha1": 0.1,
    "alpha2": 0.1,
    "alpha3": 0.1,
    "alpha4": 20.0,
    "alpha6": 0.2,
    "omega": 2.6,
}


def test_a_case_says_what_the_terminal_says():
    words = [f"--set={key}={value}" for key, value in GIVEN.items()]
    said = subprocess.run(
        [PROGRAM, "case", *words, "--json"], capture_output=True, check=True, text=True
    )
    assert nanotap.Case(**GIVEN).to_dict() == json.loads(said.stdout)


def test_readable_names_are_the_same_keys():
    case = nanotap.Case(**GIVEN)
    assert case.with_(drive_frequency=5) == case.with_(omega=5)
    assert case.with_(omega=4).with_(drive_frequency=5).omega == 5
    assert case.contact_stiffness == case.alpha4 == case["contact_stiffness"] == 20
    assert case.with_() is case
    assert case.with_({"drive_frequency": 5}) == case.with_(omega=5)
    with pytest.raises(TypeError, match="model_units: expected True or False"):
        case.with_(model_units="yes")
    assert "omega=2.6" in repr(case)
    assert "Ω" in case._repr_html_()


def test_a_case_comes_back_from_its_own_file(tmp_path):
    case = nanotap.Case(**GIVEN).with_(alpha5=-0.25, modes=7)
    path = tmp_path / "case.toml"
    path.write_text(case.to_toml())
    assert nanotap.Case.from_file(path) == case
    assert nanotap.Case.from_toml(case.to_toml(), omega=20).omega == 20
    assert nanotap.Case.from_file(path, omega=20) == case.with_(omega=20)


FOLDERS = ["docs/cases", "crates/nanotap-explorer/cases"]
FILES = sorted(path for folder in FOLDERS for path in (ROOT / folder).glob("*.toml"))


@pytest.mark.parametrize(
    "path", FILES, ids=lambda path: f"{path.parent.name}-{path.stem}"
)
def test_a_case_is_the_same_from_its_own_inputs(path):
    case = nanotap.Case.from_file(path)
    again = nanotap.Case(**case.inputs)
    assert again == case and again.inputs == case.inputs
    if not case._core.leaves_distance_to_setpoint:
        assert nanotap.Case.from_toml(case.to_toml()) == case
        assert again.to_toml() == case.to_toml()


def test_a_solved_setpoint_is_part_of_the_case():
    # The distance of docs/cases/stiff-lever.md: 15.201 nm.
    case = nanotap.Case.from_file(ROOT / "docs" / "cases" / "stiff-lever.toml")
    distance = case.setpoint_distances.solutions[0].zc
    assert distance == pytest.approx(15.201e-9, rel=1e-4)
    assert (
        case.mapping.si["alpha5"] == distance == case.to_dict()["physical"]["tip_gap"]
    )
    assert case.tables["mapping"].set_index("parameter").si["alpha5"] == distance
    assert case.tables["solutions"]["gap.tip"][0] == distance
    assert list(nanotap.Case(**GIVEN).tables) == ["numbers"]
    assert case.alpha5 == pytest.approx(distance / case.physical.beam_gap, rel=1e-14)
    saved = nanotap.Case.from_toml(case.to_toml())
    assert saved.physical.tip_gap == distance
    assert (
        nanotap.orbit(saved).document.to_dict()
        == nanotap.orbit(case).document.to_dict()
    )
    # A state of a physical case is in SI; a motion stands for its own state.
    found = nanotap.orbit(case)
    same = nanotap.orbit(case, state=found, period=1)
    assert same.first_harmonic == pytest.approx(found.first_harmonic, rel=1e-12)
    with pytest.raises(ValueError, match="write the unit"):
        nanotap.orbit(case, state=found.state)


def test_a_case_does_not_need_its_file_again(tmp_path):
    path, levers = tmp_path / "case.toml", tmp_path / "levers.toml"
    levers.write_text(
        '[lever."MINE"]\nk = "3 N/m"\nf0 = "75 kHz"\nsource = "measured"\n'
    )
    path.write_text(
        '[cantilever]\nlever = "MINE"\nQ = 200\n[sample]\nstiffness = "20 N/m"\n'
        '[drive]\nfrequency = "65.7 kHz"\namplitude = "1 nm"\n[gap]\ntip = "1 nm"\n'
    )
    case = nanotap.Case.from_file(path, catalogue=levers)
    path.unlink()
    levers.unlink()
    again = pickle.loads(pickle.dumps(case))
    assert again == case and hash(again) == hash(case)
    further = again.with_(**{"gap.tip": "2 nm"})
    assert further.physical.tip_gap == pytest.approx(2e-9, rel=1e-12)


def test_a_physical_case_maps_both_ways(physical):
    # K₁ and k as stated: α4 = 3 K₁/k (Eq. 7).
    mapping = physical.mapping
    assert physical.is_physical and not nanotap.Case(**GIVEN).is_physical
    assert mapping.si["alpha4"] == pytest.approx(
        physical.alpha4 * physical.physical.k / 3, rel=1e-12
    )
    assert mapping.si["omega"] == pytest.approx(65.7e3, rel=1e-12)
    assert physical.physical.free_amplitude == pytest.approx(20e-9, rel=1e-9)
    assert physical.alpha4 == pytest.approx(25.65, abs=0.01)
    assert any(kind == "note" for kind, _ in physical.remarks)
    assert list(mapping.columns) == ["value", "formula", "quantity", "si", "unit"]
    assert nanotap.Case(**GIVEN).mapping.empty
    assert "polystyrene" in set(nanotap.catalogue().name)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"omgea": 2}, "did you mean `omega`?"),
        ({"omega": float("nan")}, "must be a finite number"),
        ({"omega": float("inf")}, "must be a finite number"),
        ({"omega": 0}, "omega"),
        ({"omega": "2.6"}, "is text, not a number"),
        ({"modes": -1}, "outside 1 … 50"),
        ({"modes": 2**70}, "outside 1 … 50"),
        ({"modes": 2.5}, "whole number"),
        ({"alpha4": 1e300}, "alpha4"),
        ({"alpha1": -1}, "alpha1"),
        ({"cosine_term": "x"}, "cosine_term"),
        ({"": 1}, "no key"),
        ({"sample": {"stiffness": "20 N/m"}}, "one or the other"),
    ],
)
def test_what_makes_no_sense_is_refused_in_the_terminals_words(keys, words):
    with pytest.raises(ValueError, match=".") as refused:
        nanotap.Case(**(GIVEN | keys))
    said = str(refused.value)
    assert words in said
    assert "--set" not in said
    # The terminal prints the same, except for the origin of a key.
    typed = []
    for key, value in (GIVEN | keys).items():
        inner = value if isinstance(value, dict) else {None: value}
        for name, one in inner.items():
            written = json.dumps(one) if isinstance(one, str) else repr(one)
            typed.append(f"--set={key if name is None else f'{key}.{name}'}={written}")
    shown = subprocess.run(
        [PROGRAM, "case", *typed], capture_output=True, text=True, check=False
    )
    assert shown.returncode == 2
    for line in said.splitlines():
        problem = line.split(": ", 1)[-1].split("; ")[0]
        assert problem in shown.stderr, (problem, shown.stderr)


@pytest.mark.parametrize("value", [True, 1j, [1], object(), b"2", np.array([1, 2])])
def test_what_is_no_number_is_a_type_error(value):
    with pytest.raises(TypeError, match="omega: expected a number or a text"):
        nanotap.Case(**(GIVEN | {"omega": value}))


def test_none_takes_a_key_away():
    with pytest.raises(ValueError, match="missing: omega"):
        nanotap.Case(**(GIVEN | {"omega": None}))
    case = nanotap.Case(**GIVEN)
    assert case.with_(alpha5=0.7).with_(gap=None).alpha5 == case.alpha5 == 0


def test_numbers_of_numpy_are_numbers():
    given = GIVEN | {"modes": np.int64(3), "omega": np.float32(2.5)}
    assert nanotap.Case(**given).omega == 2.5
    assert nanotap.Case(**(GIVEN | {"omega": np.array(2.5)})).omega == 2.5


def test_dimensions_are_named(physical):
    tables = {key: dict(table) for key, table in PHYSICAL.items()}
    tables["drive"]["frequency"] = "65.7 nm"
    with pytest.raises(ValueError, match="frequency"):
        nanotap.Case(**tables)
    with pytest.raises(FileNotFoundError, match="nowhere.toml"):
        nanotap.Case.from_file("nowhere.toml")
    with pytest.raises(FileNotFoundError, match="nowhere.toml"):
        nanotap.Case(catalogue="nowhere.toml", **GIVEN)
    with pytest.raises(AttributeError, match="the case has no `omgea`"):
        _ = physical.omgea


def test_an_oscillator_is_a_case_too():
    text = (
        '[model]\nkind = "impact"\nstiffness = 1\ndamping = 0.1\nforcing = 1\n'
        "omega = 2.5\ngap = 1\nrestitution = 0.8\n"
    )
    case = nanotap.Case.from_toml(text)
    assert case.kind == "impact" and case.state_names == ["x", "v"]
    assert case.with_(restitution=0.5).restitution == 0.5
    ds = nanotap.simulate(case, periods=5, transient=0, strobe=5)
    assert ds.strobe.shape == (5, 2)
    assert nanotap.Case.from_toml(case.to_toml()) == case
    assert nanotap.Case(**case.inputs) == case
    for refused in (
        lambda: nanotap.modes(case),
        lambda: nanotap.convergence(case),
    ):
        with pytest.raises(ValueError, match="oscillator"):
            refused()


def test_a_force_curve_is_a_file_columns_or_rows(tmp_path):
    lever = {
        "cantilever": {"k": "1 N/m", "f0": "100 kHz", "Q": 200},
        "drive": {"frequency": "100 kHz", "free_amplitude": "20 nm"},
        "gap": {"tip": "15 nm"},
    }
    gaps, forces = np.array([-1.0, 0.0, 5.0]), np.array([20.0, 0.0, 0.0])
    columns = {"gap (nm)": gaps, "force (nN)": forces}
    rows = [["gap (m)", "force (N)"], *zip(1e-9 * gaps, 1e-9 * forces, strict=True)]
    path = tmp_path / "curve.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    exact = nanotap.orbit(nanotap.Case(**lever, sample={"stiffness": "20 N/m"}))
    for table in (columns, pd.DataFrame(columns), rows, str(path)):
        case = nanotap.Case(**lever, sample={"law": "table", "table": table})
        assert np.allclose(case.physical["force_table"], 1e-9 * np.c_[gaps, forces])
        found = nanotap.orbit(case)
        assert found.first_harmonic == pytest.approx(exact.first_harmonic, rel=1e-9)
    with pytest.raises(ValueError, match="turns back"):
        nanotap.Case(
            **lever,
            sample={
                "law": "table",
                "table": {"gap (nm)": [0, 1, 0.5], "force (nN)": [1, 0, 0]},
            },
        )


SETPOINT = {
    "cantilever": {"k": "2 N/m", "f0": "70 kHz", "Q": 100},
    "sample": {"stiffness": "5 N/m"},
    "drive": {
        "actuation": "tip",
        "frequency_ratio": 1,
        "free_amplitude": "10 nm",
        "setpoint": 0.8,
    },
}


def test_a_distance_replaces_a_setpoint_in_with_and_in_calls():
    case = nanotap.Case(**SETPOINT)
    distance = {"gap.tip": "8.5 nm"}
    moved = case.with_(distance)
    assert moved.inputs["gap"] == {"tip": "8.5 nm"}
    assert "setpoint" not in moved.inputs["drive"]
    found = nanotap.orbit(moved).first_harmonic
    assert nanotap.orbit(case, **distance).first_harmonic == pytest.approx(found)
    # And back: another setpoint replaces the distance.
    back = moved.with_({"drive.setpoint": 0.7})
    assert "gap" not in back.inputs
    assert nanotap.orbit(back).first_harmonic == pytest.approx(7e-9, rel=1e-6)
    again = nanotap.orbit(case, **{"drive.setpoint": 0.7})
    assert again.first_harmonic == pytest.approx(7e-9, rel=1e-6)
    with pytest.raises(ValueError, match="cannot both be given"):
        case.with_({"gap.tip": "8 nm", "drive.setpoint": 0.7})


def test_completion_offers_the_keys_of_a_physical_case():
    case = nanotap.Case(**SETPOINT)
    keys = case._ipython_key_completions_()
    assert {"sample.stiffness", "drive.setpoint", "alpha4", "physical"} <= set(keys)
    assert {"cantilever", "sample", "drive"} <= set(dir(case))
    assert all(case[key] is not None or key in case for key in keys)
    assert case["drive.free_amplitude"] == case.drive.free_amplitude == "10 nm"
    assert "f0" in dir(case.cantilever)
    for wrong in ("drive.frequency", "drive.", "gap.tip", "nothing.k", "nothing"):
        with pytest.raises(KeyError, match=wrong):
            case[wrong]
    dimensionless = nanotap.Case.paper()
    assert dimensionless._ipython_key_completions_() == list(dimensionless)
