"""Every document of the terminal is one of its schema (`nanotap schema`)."""

import functools
import json
import re
import subprocess

import jsonschema
import pytest
from program import PROGRAM, ROOT

FOLDERS = ["docs/cases", "crates/nanotap-explorer/cases"]
CASES = sorted(path for folder in FOLDERS for path in (ROOT / folder).glob("*.toml"))
#: Cases on which a single motion takes long.
SLOW = {
    "bimodal-polymer.toml",
    "epoxy.toml",
    "force-limit-stiff.toml",
    "polyisobutylene.toml",
}

#: Studies of one motion, on every case.
ALONE = {
    "case": [],
    "modes": [],
    "orbit": ["--harmonics", "3"],
    "simulate": ["--periods", "3", "--transient", "20", "--strobe", "2"],
    "lyapunov": ["--periods", "40", "--transient", "20"],
}

#: Other studies, each on a case that they fit.
OTHERS = [
    ("attractors", "paper.toml", ["--starts", "4", "--set", "omega=20", "--set", "alpha1=0"]),
    ("attractors", "jkr-soft.toml", ["--starts", "2"]),
    ("attractors", "stiff-lever.toml", ["--starts", "3"]),
    ("branch", "paper.toml", ["--parameter", "omega", "--from", "3", "--to", "3.05"]),
    ("approach", "stiff-lever.toml", ["--points", "4"]),
    ("fm", "fm-polystyrene.toml", ["--points", "3"]),
    ("force-curve", "force-curve.toml", ["--points", "20"]),
    ("force-curve", "force-curve-jkr.toml", ["--points", "20"]),
    ("lever", "stiff-lever.toml", ["--levers", "PPP-NCHR"]),
    ("noise", "stiff-lever.toml", ["--time-constant", "1 ms"]),
    ("convergence", "paper.toml", ["--largest", "2", "--set", "omega=3"]),
    ("contact-laws", "paper.toml", ["--set", "omega=3"]),
    ("sweep", "paper.toml", ["--over", "omega=3:3.1:2", "--periods", "5"]),
    ("window", "paper.toml", ["--over", "omega=3:3.1:2", "--over", "alpha4=20:21:2", "--starts", "2"]),
    ("simulate", "paper.toml", ["--method", "rk4", "--periods", "3", "--set", "omega=3"]),
    ("simulate", "stiff-lever.toml", ["--method", "rk4", "--periods", "2", "--set", "gap.tip=15 nm", "--set", "drive.setpoint="]),
    ("bimodal", "bimodal-polymer.toml", ["--points", "3"]),
    ("scan", "scan-step.toml", ["--lines", "1", "--size", "20 nm"]),
    ("basin", "paper.toml", ["--x", "a1=-1:1:3", "--y", "v1=-1:1:3", "--starts", "4", "--set", "omega=3"]),
]  # fmt: skip


@functools.cache
def schemas():
    """The schemas by name, as validators."""
    said = subprocess.run([PROGRAM, "schema"], capture_output=True, check=True)
    found = json.loads(said.stdout)
    return {
        name: jsonschema.Draft202012Validator(one["report"])
        for name, one in found.items()
        if "report" in one
    }


def check(name, arguments, folder, codes=(0, 1)):
    """Runs a command with `--json` and checks its document."""
    line = [PROGRAM, *arguments, "--json", "-q"]
    run = subprocess.run(line, capture_output=True, cwd=folder, check=False)
    assert run.returncode in codes, (line, run.stderr[-500:])
    document = json.loads(run.stdout)
    # An orbit has an `error` too: that of its state, a number.
    if isinstance(document.get("error"), dict) and name != "case-report":
        name = "failure"
    problems = [
        (list(problem.absolute_path), problem.message[:200])
        for problem in schemas()[name].iter_errors(document)
    ]
    assert not problems, (line, problems[:5])
    # Options in braces are written as the reader types them; those of a shell are its own.
    text = run.stdout.decode() + run.stderr.decode()
    assert name == "generate" or not re.search(r"\{[a-z_]+\}", text), line
    return document


@pytest.mark.parametrize(
    "path", CASES, ids=lambda path: f"{path.parent.name}-{path.stem}"
)
def test_documents_of_shipped_cases_are_those_of_the_schema(path, tmp_path):
    for study, options in ALONE.items():
        if path.name in SLOW and study not in {"case", "modes"}:
            continue
        name = "case-report" if study == "case" else study
        kinds = (0, 1, 2) if study == "modes" else (0, 1)
        line = [PROGRAM, study, str(path), "--json", "-q"]
        if study == "modes" and path.name in {"rigid-stop.toml", "soft-stop.toml"}:
            run = subprocess.run(line, capture_output=True, check=False)
            assert run.returncode == 2
            continue
        check(name, [study, str(path), *options], tmp_path, kinds)


@pytest.mark.parametrize(("study", "case", "options"), OTHERS)
def test_documents_of_other_studies_are_those_of_the_schema(
    study, case, options, tmp_path
):
    path = ROOT / "docs" / "cases" / case
    document = check(study, [study, str(path), *options], tmp_path, (0,))
    assert not isinstance(document.get("error"), dict)


def test_documents_of_measured_curves_are_those_of_the_schema(tmp_path):
    cases = ROOT / "docs" / "cases"
    lever = str(cases / "stiff-lever.toml")
    free = ["--free", "gap.offset", "--starts", "1", "--no-profile"]
    curves = str(cases / "polystyrene-curve.csv")
    document = check("fit", ["fit", curves, lever, *free], tmp_path)
    assert document["parameters"]
    volume = [str(cases / "force-volume.csv"), lever, "--pixels", "x,y", *free]
    check("fit-map", ["fit", *volume, "--out", "volume.zarr"], tmp_path)
    check("reconstruct", ["reconstruct", curves, lever], tmp_path)


def test_other_documents_are_those_of_the_schema(tmp_path):
    assert check("catalogue", ["catalogue"], tmp_path, (0,))["levers"]
    case = str(ROOT / "docs" / "cases" / "paper.toml")
    sweep = ["sweep", case, "--over", "omega=3:3.1:2", "--periods", "5"]
    check("sweep", [*sweep, "--chunk", "1/1", "--out", "one.zarr"], tmp_path)
    check("merge", ["merge", "one.zarr", "--out", "all.zarr"], tmp_path)
    paper = ["paper", "--quick", "--only", "eq25", "--out", "paper"]
    assert check("paper", paper, tmp_path, (0,))["checks"]
    assert "nanotap" in check("generate", ["generate", "bash"], tmp_path, (0,))["text"]
    pages = ["generate", "man", "--out", "man"]
    assert check("generate", pages, tmp_path, (0,))["files"]
    scan = ["scan", str(ROOT / "docs" / "cases" / "scan-step.toml"), "--lines", "2"]
    scan += ["--size", "20 nm", "--line-settle", "200", "--out", "scan.zarr"]
    check("scan-lines", scan, tmp_path, (0,))
    low = [
        str(ROOT / "docs" / "cases" / "stiff-lever.toml"),
        "--set",
        "drive.setpoint=1e-4",
    ]
    assert check("case-report", ["case", *low], tmp_path, (1,))["error"]
    assert check("orbit", ["orbit", *low], tmp_path, (1,))["error"]


@pytest.mark.parametrize(
    "options",
    [
        # No free amplitude: A/A0 does not exist.
        ["--set", "drive.free_amplitude=0 nm"],
        # Numbers that overflow.
        ["--set", "drive.free_amplitude=1e-300 nm"],
    ],
)
def test_numbers_that_do_not_exist_are_null(options, tmp_path):
    path = str(ROOT / "docs" / "cases" / "stiff-lever.toml")
    given = ["--set", "gap.tip=15 nm", *options]
    document = check("orbit", ["orbit", path, *given, "--harmonics", "2"], tmp_path)
    if "physical" in document:
        assert document["physical"]["A_ratio"] is None or document["physical"]["A"] > 0
    check("simulate", ["simulate", path, *given, "--periods", "2"], tmp_path)
    check("attractors", ["attractors", path, *given, "--starts", "2"], tmp_path)
