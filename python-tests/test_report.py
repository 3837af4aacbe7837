"""Results of every study: their tables are those of the terminal's CSV files, in SI with units, and
their figures are drawn from what was saved."""

import csv
import pickle
import subprocess

import nanotap
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from program import PROGRAM, ROOT

CASES = ROOT / "docs" / "cases"
REGULAR = {"omega": 3}

# Function, case, keys, options, and whether there is a figure.
STUDIES = [
    ("modes", "paper.toml", REGULAR, {}, True),
    ("modes", "stiff-lever.toml", {}, {"points": 5}, True),
    ("simulate", "paper.toml", REGULAR, {"periods": 3}, True),
    ("simulate", "stiff-lever.toml", {}, {"periods": 120, "transient": 3}, True),
    ("simulate", "stiff-lever.toml", {}, {"periods": 2, "method": "rk4"}, True),
    ("orbit", "paper.toml", REGULAR, {}, True),
    ("orbit", "stiff-lever.toml", {}, {"resolution": 50}, True),
    ("attractors", "paper.toml", REGULAR, {"starts": 6}, True),
    ("attractors", "stiff-lever.toml", {}, {"starts": 4}, True),
    ("branch", "paper.toml", {}, {"parameter": "omega", "from_": 3, "to": 3.05}, True),
    (
        "branch",
        "stiff-lever.toml",
        {},
        {"parameter": "gap.tip", "from_": "15 nm", "to": "14 nm"},
        True,
    ),
    ("approach", "stiff-lever.toml", {}, {"points": 4}, True),
    ("approach", "paper.toml", {"alpha5": 0}, {"points": 4}, True),
    ("fm", "fm-lever.toml", {}, {"points": 3}, True),
    ("force_curve", "force-curve-jkr.toml", {}, {"points": 20}, True),
    ("lyapunov", "paper.toml", REGULAR, {"periods": 60, "transient": 20}, True),
    ("lyapunov", "stiff-lever.toml", {}, {"periods": 60, "transient": 20}, True),
    ("convergence", "paper.toml", REGULAR, {"largest": 2}, True),
    ("convergence", "stiff-lever.toml", {}, {"largest": 2}, True),
    ("noise", "dforce-dmt.toml", {}, {}, True),
    ("contact_laws", "dforce-dmt.toml", {}, {}, True),
    ("bimodal", "bimodal-polymer.toml", {}, {"points": 3}, True),
    ("scan", "scan-step.toml", {}, {"lines": 1, "size": "20 nm"}, True),
    ("scan", "scan-particle.toml", {}, {"lines": 3, "pixels": 12}, True),
    ("sweep", "paper.toml", {}, {"over": "omega=2.9:3.1:6", "starts": 2}, True),
    ("sweep", "stiff-lever.toml", {}, {"over": "gap.tip=14nm:15nm:3"}, True),
    (
        "window",
        "paper.toml",
        REGULAR,
        {"over": ["omega=3:3.1:2", "alpha4=20:21:2"], "starts": 2},
        True,
    ),
    (
        "basin",
        "paper.toml",
        REGULAR,
        {"x": "a1=-1:1:3", "y": "v1=-1:1:3", "starts": 4},
        True,
    ),
]


@pytest.fixture(scope="module", params=STUDIES, ids=lambda study: "-".join(study[:2]))
def study(request, tmp_path_factory):
    """A result, the CSV file that the terminal writes, whether there is a figure, and what the terminal says."""
    name, file, keys, options, has_figure = request.param
    case = nanotap.Case.from_file(CASES / file, **keys)
    function = getattr(nanotap, name)
    takes = function.__code__.co_varnames
    silent = {"progress": False} if "progress" in takes else {}
    result = function(case, **options, **silent)
    words = [f"--set={key}={value}" for key, value in keys.items()]
    for key, value in options.items():
        flag = key.strip("_").replace("_", "-")
        listed = value if isinstance(value, list) else [value]
        words += [f"--{flag}={one}" for one in listed]
    out = tmp_path_factory.mktemp(name) / "table.csv"
    command = [PROGRAM, name.replace("_", "-"), str(CASES / file), *words]
    done = subprocess.run(
        [*command, "--out", str(out)], check=True, capture_output=True, text=True
    )
    return result, out.read_bytes(), has_figure, done.stderr


def test_the_csv_file_is_the_terminals(study, tmp_path):
    result, written, *_ = study
    nanotap.export.csv(result, tmp_path / "table.csv")
    assert (tmp_path / "table.csv").read_bytes() == written


def test_the_terminal_says_what_the_result_says(study):
    result, _, _, said = study
    if "kind" in getattr(result, "attrs", ()):
        pytest.skip("a dataset has attributes")
    for message in result.messages:
        assert " ".join(message.split()) in " ".join(said.split())
    # Nothing that the terminal says of the motion is missing.
    for word in ("this is the motion from rest", "Sader and Jarvis"):
        assert (word in said) == any(word in message for message in result.messages)


def test_the_first_table_is_the_terminals_file(study):
    result, written, *_ = study
    if "kind" in getattr(result, "attrs", ()):
        pytest.skip("a dataset has the rows of its grid")
    heads, *rows = csv.reader(written.decode().splitlines())
    name, table = next(iter(result.tables.items()))
    assert result.to_dataframe(name).equals(table)
    assert len(table) == len(rows) > 0
    columns: dict[str, tuple[str, list[str]]] = {}
    for head, column in zip(heads, zip(*rows, strict=True), strict=True):
        key, _, unit = head.removesuffix(")").partition(" (")
        # Energies are in J and again in eV.
        columns.setdefault(key, (unit, list(column)))
    assert list(table.columns) == list(columns)
    for key, (unit, texts) in columns.items():
        # Heads in the model's units have none.
        declared = table.attrs["units"][key]
        assert not unit or declared in {unit.replace("deg", "degree"), ""}, key
        for value, text in zip(table[key], texts, strict=True):
            if isinstance(value, str):
                assert value == text
            elif text == "":
                assert np.isnan(value)
            else:
                assert value == float(text)


def test_every_variable_has_a_unit_and_a_name(study):
    for name, variable in study[0].ds.variables.items():
        if name == "state":
            continue
        assert variable.attrs.get("long_name"), name
        assert variable.dtype.kind in "UO" or variable.attrs.get("units"), name


def test_what_was_saved_is_drawn(study, tmp_path):
    result, _, has_figure, _ = study
    if not has_figure:
        with pytest.raises(TypeError, match="no figure"):
            result.plot()
        return
    assert isinstance(result.plot(), Figure)
    assert isinstance(nanotap.plot.show(result), Figure)
    result.ds.to_netcdf(tmp_path / "saved.nc")
    with xr.open_dataset(tmp_path / "saved.nc") as saved:
        assert isinstance(nanotap.plot.show(saved), Figure)


def test_a_result_is_pickled_with_its_tables(study):
    result = study[0]
    again = pickle.loads(pickle.dumps(result))
    for name, table in result.tables.items():
        assert again.tables[name].equals(table)
    assert type(again.plot) is type(result.plot)


def test_a_table_that_is_not_there_is_refused():
    case = nanotap.Case.from_file(CASES / "dforce-dmt.toml")
    with pytest.raises(KeyError, match="there is no table `x`"):
        nanotap.noise(case).to_dataframe("x")


def records(entries, path=""):
    """All parts of a document, with where they are."""
    yield path, entries
    for name in entries:
        found = entries[name]
        for one in found if isinstance(found, list) else [found]:
            if isinstance(one, nanotap.Record):
                yield from records(one, f"{path}/{name}")


# Of several units, or none.
OF_STATES = {"state", "states", "start", "strobe", "mean"}
MODEL = ("g0", "EI", "sqrt(")


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("orbit", {"derivatives": ["gap.tip"]}),
        ("attractors", {"starts": 4}),
        ("modes", {}),
        ("convergence", {"largest": 2}),
        ("contact_laws", {}),
        ("noise", {}),
        ("fm", {"points": 3, "from_": "25 nm", "to": "19 nm"}),
    ],
)
def test_records_of_a_physical_case_are_in_si(name, options):
    """Each number that the document has in SI, too, is that one; of no other does a unit remain that
    is the model's."""
    case = nanotap.Case.from_file(CASES / "stiff-lever.toml")
    if name == "fm":
        case = nanotap.Case.from_file(CASES / "fm-lever.toml")
    result = getattr(nanotap, name)(case, **options)
    document = result if isinstance(result, nanotap.Record) else result.document
    compared = 0
    for path, part in records(document):
        for entry, unit in part.units.items():
            assert entry in OF_STATES or not unit.startswith(MODEL), (path, entry, unit)
        physical = part.to_dict().get("physical") or {}
        for entry, value in physical.items():
            is_number = isinstance(value, float | list) and entry != "harmonics"
            if entry in part and entry not in OF_STATES and is_number:
                assert part[entry] == value, (path, entry)
                compared += 1
    assert compared > 0 or name == "noise"


def test_derivatives_say_their_unit():
    case = nanotap.Case.from_file(CASES / "stiff-lever.toml")
    found = nanotap.orbit(case, derivatives=["gap.tip", "sample.loss_tangent"])
    by_distance = found.derivatives["gap.tip"]
    assert by_distance.amplitude == by_distance.physical.amplitude
    assert by_distance.units["amplitude"] == "m/m"
    assert by_distance.units["phase"] == "degree/m"
    step = 1e-13
    ends = [
        nanotap.orbit(case.with_(**{"gap.tip": case.physical.tip_gap + sign * step}))
        for sign in (-1, 1)
    ]
    slope = (ends[1].amplitude - ends[0].amplitude) / (2 * step)
    assert by_distance.amplitude == pytest.approx(slope, rel=1e-4)


MODULUS = {"sample.modulus": "60 MPa"}


@pytest.mark.parametrize(
    ("compute", "words"),
    [
        (
            lambda: nanotap.fit(
                nanotap.Case.from_file("dforce-hertz.toml", **MODULUS),
                data="hertz-curve.csv",
                free=["sample.modulus", "gap.offset"],
                progress=False,
            ),
            "fit hertz-curve.csv dforce-hertz.toml --free sample.modulus,gap.offset",
        ),
        (
            lambda: nanotap.fit_map(
                nanotap.Case.from_file("stiff-lever.toml"),
                "force-volume.csv",
                ["x", "y"],
                ["sample.modulus", "gap.offset"],
                progress=False,
            ),
            (
                "fit force-volume.csv stiff-lever.toml --free sample.modulus,gap.offset "
                "--pixels x,y"
            ),
        ),
        (
            lambda: nanotap.reconstruct(
                nanotap.Case.from_file("fm-lever.toml"),
                data="fm-curve.csv",
                progress=False,
            ),
            "reconstruct fm-curve.csv fm-lever.toml",
        ),
    ],
    ids=["fit", "fit_map", "reconstruct"],
)
def test_fits_have_the_terminals_file_and_figure(compute, words, tmp_path, monkeypatch):
    monkeypatch.chdir(CASES)
    result = compute()
    command = [PROGRAM, *words.split()]
    if "hertz" in words:
        command += [f"--set={key}={value}" for key, value in MODULUS.items()]
    written, ours = tmp_path / "terminal.csv", tmp_path / "ours.csv"
    subprocess.run(
        [*command, "--out", str(written), "--quiet"], check=True, capture_output=True
    )
    nanotap.export.csv(result, ours)
    assert ours.read_bytes() == written.read_bytes()
    assert isinstance(result.plot(), Figure)
    result.ds.to_netcdf(tmp_path / "saved.nc")
    with xr.open_dataset(tmp_path / "saved.nc") as saved:
        assert isinstance(nanotap.plot.show(saved), Figure)
