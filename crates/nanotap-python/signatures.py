"""Writes `_signatures.py`: the public function of every study, from the studies' JSON schemas.

    python crates/nanotap-python/signatures.py target/release/nanotap [--check]

Names, defaults, documentation and ranges come from the library; only extra arguments and return
values of Python are stated here.
"""

import json
import re
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

TARGET = Path(__file__).parent / "python" / "nanotap" / "_signatures.py"

THREADS = ("threads", "int | None", "None", "Number of threads; default: one per core.")
PROGRESS = (
    "progress",
    "Progress",
    "None",
    "Whether to show a bar, or a function that is called with the finished and the total count.",
)
ARRAYS = (
    (
        "threads",
        "int | None",
        "None",
        "Number of threads for arrays; default: one per core.",
    ),
    (
        "progress",
        "Progress",
        "None",
        "Progress of arrays: whether to show a bar, or a function as in other studies.",
    ),
)
SERIES = (
    "series",
    "int | None",
    "None",
    "Number of periods of the time series, from the start of the recording; default: all, up to 100.",
)

DATASET = (
    (
        "out",
        "Path | None",
        "None",
        (
            "The dataset, a folder with the extension .zarr; an existing one is resumed. "
            "Without it, everything is in memory."
        ),
    ),
    (
        "chunk",
        "str",
        '"1/1"',
        'Only one of n shares, as in "2/8"; `merge` merges the shares.',
    ),
    THREADS,
    (
        "client",
        '"Client | None"',
        "None",
        "A Dask client on whose workers the chunks are computed, with the same bytes.",
    ),
    PROGRESS,
)

# Additions of Python to a study: further arguments, the type of the result and its contents.
PYTHON: dict[str, tuple[tuple[tuple[str, str, str, str], ...], str, str]] = {
    "modes": (
        (),
        "Modes",
        (
            "Frequencies of the Galerkin model (`free`, `contact`) and of the beam itself "
            "(`exact_free`, `exact_contact`); `shapes`, the mode shapes along the beam."
        ),
    ),
    "simulate": (
        (SERIES, *ARRAYS),
        "StudyDataset",
        (
            "The observables, with the names of the terminal's JSON: `classification`, `period`, "
            "`tip_max` …; `strobe` over `strobe_period` and `state`; `events` (their times) with "
            "`event_kind`; and the time series `tip`, `gap`, `force` … over `tau`. Over arrays, "
            "the numeric observables of each run, and `failure` for a run that failed."
        ),
    ),
    "orbit": (
        ARRAYS,
        "Orbit | StudyDataset",
        (
            "The orbit; over arrays, a Dataset of the observables of each, with `failure` where "
            "there is none."
        ),
    ),
    "attractors": (
        (THREADS, PROGRESS),
        "Attractors",
        "The attractors, most frequent first.",
    ),
    "branch": (
        (THREADS, PROGRESS),
        "StudyDataset",
        (
            "The orbits over `point` (`branch`, the parameter by its name, `stable`, `tip_max`, "
            "`states` …) and the bifurcations over `bifurcation` (`bifurcation_kind`, "
            "`bifurcation_parameter`, `bifurcation_states` …); curves in two parameters over "
            "`locus_point`. The attributes state why each branch ends, and list failures."
        ),
    ),
    "approach": (
        (THREADS, PROGRESS),
        "StudyDataset",
        (
            "The observables over `way` (approach, retract) and the distance (with the name of its "
            "parameter, with `zc` in metres for a physical case): `first_harmonic`, `phase`, "
            "`peak_force`, `dissipation` … and in SI `physical_A`, `physical_F_max`, "
            "`physical_E_dis` …; the branches over `branch_point`; the jumps in the "
            "attribute `jumps`. With `fm=True` also "
            "`relative_shift`, `drive_ratio`, `sader_jarvis_force` … and in SI "
            "`physical_frequency_shift` …, with the settings of the loop in the attribute `modulation`."
        ),
    ),
    "sweep": (
        DATASET,
        "StudyDataset",
        (
            "The dataset, as `open` opens it: lazily from `out`. After Ctrl-C, the `result` of the "
            "exception is the finished part of the dataset, and the same call resumes in `out`."
        ),
    ),
    "window": (
        tuple(entry for entry in DATASET if entry[0] != "chunk"),
        "StudyDataset",
        (
            "The sweep with `condition` over both parameters: no-contact, one-period-1, "
            "second-state, subharmonic, irregular, undecided, or setpoint-unreached; `share` is the "
            "fraction of each. With `where`, `holds` says where the conditions hold; its attributes "
            "have their share and the largest rectangle (`region`, JSON). Where the case leaves its "
            "distance to a setpoint: the number of `states` at the setpoint, their distances, phases and "
            "the `step_height` between them over both parameters, with the `verdict` as an attribute."
        ),
    ),
    "basin": (
        DATASET,
        "StudyDataset",
        (
            "`attractor` over the two entries of the state: an index into the attractors of the "
            "attribute `attractors` (JSON), negative where there is none."
        ),
    ),
    "fit": (
        (
            (
                "curve",
                "int | None",
                "None",
                "Number of the curve of an instrument's file with several, from 0; default: the first.",
            ),
            THREADS,
            PROGRESS,
        ),
        "Fit",
        (
            "`parameters` (key, value, standard_error, interval, unit), `chi2`, `undetermined`, "
            "`correlations`, the `rows` with model and residuals; `force_curves`, what each force curve "
            "says of the sample; `best` and `errors` by key, and `best_case()`, the case of the best fit."
        ),
    ),
    "reconstruct": (
        (THREADS, PROGRESS),
        "Reconstruction",
        (
            "`table` (distance, force, force_error, dissipation, dissipation_error, damping, "
            "damping_error), `minimum`, `closest`, the `rows`; `curve()`, the table as a "
            "DataFrame, and `law_table()`, the text for `sample.table`."
        ),
    ),
    "scan": (
        DATASET,
        "StudyDataset",
        (
            "`height`, `amplitude_error`, `phase`, `peak_force`, `dissipation`, `state` … over "
            "`direction` (trace, retrace), `y` and `x`; the listed drive periods over `k` "
            "(`period_z`, `period_amplitude` …). The attributes hold the `verdict`, the `warnings`, "
            "and as JSON the `causes` that the verdict names, the statistics of the `lines`, the "
            "`branch_changes` and the analysis of "
            "the feedback `loop`. With `out`, the lines are written into a dataset as they are "
            "finished (this needs `line_settle`), and a later call goes on with it."
        ),
    ),
    "image-states": (
        (THREADS, PROGRESS),
        "StudyDataset",
        (
            "Over `y` (falling, as instruments count lines) and `x`: `state` (attractive, repulsive, free or "
            "undecided), `probability`, `height`, `corrected`, `amplitude` and `phase`. The attributes hold "
            "the `verdict`, the `reason` if the image is undecided, `phase_offset`, the `warnings`, and as "
            "JSON the `states` of the case, the `steps` of the lever and the assignments that are `possible`."
        ),
    ),
    "lyapunov": (
        (),
        "Lyapunov",
        "Exponents with their errors, and the points of the section.",
    ),
    "convergence": (
        (),
        "Convergence",
        "The motion with each number of modes, and a verdict.",
    ),
}

CASE = ">>> case = nanotap.Case.paper(omega=3)"

# One call of each study with the answer, after `case = nanotap.Case.paper(omega=3)`; the tests run
# them.
LEVER = """>>> lever = nanotap.Case(
...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
...     sample={"stiffness": "5 N/m"},
...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
...     gap={"tip": "8 nm"},
... )"""
EXAMPLES = {
    "modes": """
>>> nanotap.modes(case).free.round(3).tolist()
[2.968, 19.385, 56.011]
""",
    "simulate": """
>>> run = nanotap.simulate(case, periods=4)
>>> run.classification.item(), run.tip.dims
('periodic', ('tau',))
""",
    "orbit": """
>>> nanotap.orbit(case)
Orbit(period=1, stable, largest multiplier 0.868606, W from 0.0225061 to 0.127375)
>>> nanotap.orbit(case, omega=[2.9, 3.0]).stable.values
array([ True,  True])
""",
    "attractors": """
>>> found = nanotap.attractors(case, starts=20, box={"a1": (-1, 1)}, progress=False)
>>> [one.name for one in found]
['period 1']
""",
    "branch": """
>>> ds = nanotap.branch(case, parameter="omega", from_=3.2, to=2.9, progress=False)
>>> ds.bifurcation_kind.values.tolist(), ds.bifurcation_parameter.values.round(6).tolist()
(['flip'], [2.913722])
""",
    "approach": """
>>> ds = nanotap.approach(case, points=3, branches=False, progress=False)
>>> ds.first_harmonic.sel(way="approach").values.round(4)
array([0.0149, 2.8522, 4.4282])
""",
    "sweep": """
>>> ds = nanotap.sweep(case, over={"omega": nanotap.range(2.9, 3, 3)}, periods=2, progress=False)
>>> ds.classification.values.ravel().tolist()
['periodic', 'periodic', 'periodic']
""",
    "window": """
>>> over = {"omega": [2.9, 3.0], "alpha4": nanotap.range(19, 20, 2)}
>>> nanotap.window(case, over=over, starts=2, progress=False).condition.values.tolist()
[['one-period-1', 'one-period-1'], ['subharmonic', 'one-period-1']]
""",
    "basin": """
>>> sides = {"x": {"a1": nanotap.range(-1, 1, 2)}, "y": {"v1": nanotap.range(-1, 1, 2)}}
>>> nanotap.basin(case, **sides, progress=False).attractor.values.tolist()
[[0, 0], [0, 0]]
""",
    "lyapunov": """
>>> nanotap.lyapunov(case).exponents[:2].round(4).tolist()
[-0.1409, -0.1409]
""",
    "convergence": """
>>> nanotap.convergence(case, largest=4).enough
3
""",
    "contact-laws": """
>>> [sample.contact for sample in nanotap.contact_laws(case, progress=False).samples]
['spring-damper', 'kelvin-voigt', 'standard-linear-solid']
""",
    "noise": f"""
{LEVER}
>>> found = nanotap.noise(lever)
>>> print(f"{{found.thermal_rms:.3e}} m, {{found.amplitude_rms:.2e}} m")
4.509e-11 m, 1.08e-11 m
""",
    "fm": f"""
{LEVER}
>>> curve = nanotap.fm(lever, points=2, from_="12 nm", to="9 nm", progress=False)
>>> row = curve.table[1]
>>> print(f"{{row.zc:.1e}} m: {{row.modulation_si.frequency_shift:.1f}} Hz")
9.0e-09 m: 1323.3 Hz
""",
    "force-curve": f"""
{LEVER}
>>> curve = nanotap.force_curve(lever, progress=False)
>>> print(f"{{curve.peak_force:.3e}} N")
1.597e-09 N
""",
    "bimodal": """
>>> lever = nanotap.Case(
...     modes=2,
...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 150},
...     tip={"radius": "10 nm"},
...     sample={"law": "hertz", "modulus": "1 GPa", "poisson": 0.3},
...     drive={
...         "actuation": "tip", "frequency_ratio": 1, "free_amplitude": "40 nm",
...         "second_ratio": 6.27, "second_free_amplitude": "0.1 nm", "setpoint": 0.8,
...     },
... )
>>> last = nanotap.bimodal(lever, progress=False).table[-1]
>>> print(f"{last.tones[1].frequency_shift:.1f} Hz, {last.estimates.reduced_modulus:.3e} Pa by the formula")
1035.7 Hz, 1.120e+09 Pa by the formula
""",
    "fit": f"""
{LEVER}
>>> zc = [7e-9, 8e-9, 9e-9]
>>> seen = nanotap.orbit(lever, **{{"gap.tip": zc}})
>>> measured = {{"zc (m)": zc, "A (m)": seen.first_harmonic, "phase": seen.phase}}
>>> guess = lever.with_({{"sample.stiffness": "8 N/m"}})
>>> found = nanotap.fit(guess, data=measured, free=["sample.stiffness"], progress=False)
>>> print(f"{{found.best['sample.stiffness']:.3f}} N/m")
5.000 N/m
""",
    "reconstruct": f"""
>>> import numpy as np
{LEVER}
>>> zc = np.linspace(6e-9, 11e-9, 20)
>>> seen = nanotap.orbit(lever, **{{"gap.tip": zc}})
>>> measured = {{"zc (m)": zc, "A (m)": seen.first_harmonic, "phase": seen.phase}}
>>> curve = nanotap.reconstruct(lever, data=measured, progress=False).curve()
>>> print(f"{{curve.force.iloc[0]:.2e}} N at an indentation of {{-curve.index[0]:.2e}} m")
1.31e-09 N at an indentation of 2.61e-10 m
""",
    "scan": f"""
{LEVER}
>>> ds = nanotap.scan(
...     lever, size="100 nm", periods=4000, pixels=5, settle=300, setpoint=0.8, z0="8 nm",
...     integral_gain=1500, lock_in={{"time_constant": "20 us", "order": 1}}, progress=False,
...     surface=[{{"step": {{"from": "30 nm", "to": "70 nm", "height": "2 nm"}}}}],
... )
>>> (1e9 * ds.height.sel(direction="trace")).values.round(1).tolist()
[[7.7, 8.8, 9.7, 8.9, 7.7]]
""",
    "image-states": """
>>> import numpy as np
>>> lever = nanotap.Case(
...     modes=1,
...     cantilever={"k": "40 N/m", "f0": "325 kHz", "Q": 200},
...     tip={"radius": "20 nm", "modulus": "170 GPa", "poisson": 0.28},
...     sample={"law": "dmt", "modulus": "70 GPa", "poisson": 0.17, "hamaker": "1.2e-19 J"},
...     drive={
...         "actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm", "setpoint": 0.9,
...     },
... )
>>> image = {
...     "height (nm)": np.array([[9.2, 9.2, 9.2, 9.2, 8.9, 8.9, 8.9, 8.9]]),
...     "phase (deg)": np.array([[115.9, 115.7, 115.8, 115.9, 64.2, 64.1, 64.3, 64.1]]),
... }
>>> ds = nanotap.image_states(lever, data=image, phase_offset=0, sense="lag", progress=False)
>>> ds.state.values[0, 3:5].tolist()
['attractive', 'repulsive']
>>> (1e9 * ds.corrected).values[0, 3:5].round(2).tolist()
[9.2, 9.2]
""",
    "lever": """
>>> gel = nanotap.Case(
...     modes=1,
...     cantilever={"lever": "PPP-FM", "Q": 200},
...     tip={"material": "silicon"},
...     sample={"law": "hertz", "modulus": "20 MPa", "poisson": 0.49},
...     drive={
...         "actuation": "tip", "frequency_ratio": 1, "free_amplitude": "20 nm", "setpoint": 0.8,
...     },
... )
>>> found = nanotap.lever(gel, levers=["PPP-FM", "PPP-CONT"], where=["F_max < 0.5 nN"], progress=False)
>>> for row in found.levers:
...     print(row.lever, row.holds, f"{1e12 * row.physical.F_max:.1f} pN")
PPP-CONT True 236.9 pN
PPP-FM False 611.1 pN
""",
}

# A study without additions: its report.
DOCUMENT = (
    (THREADS, PROGRESS),
    "Report",
    "The document, with the names of the terminal's JSON; `.to_dataframe()`, `.ds` and `.plot()`.",
)

# The first argument of a study, where it may be something else than a case.
FIRST = {
    "fit": (
        "Case | Path | Any",
        (
            "The case, or the path of its file; or, without `data`, the measured curve itself, of which "
            "a force curve needs no case: the file's header has the lever, `tip_radius` states the tip."
        ),
    ),
}

# Studies that run over arrays of parameters.
OVER_ARRAYS = {"simulate", "orbit"}

HEAD = '''"""The function of every study. Written by signatures.py; do not edit by hand."""
# ruff: noqa
# fmt: off

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, overload

from . import _arguments, _datasets, _motions, _studies
from ._arguments import Box, Progress, Varied
from ._case import Case, Path, Value
from ._report import Report
from ._results import Attractors, Convergence, Fit, Lyapunov, Modes, Orbit, Reconstruction

if TYPE_CHECKING:
    from distributed import Client

    from ._study_dataset import StudyDataset
'''


def main() -> int:
    program, *rest = sys.argv[1:]
    schemas = json.loads(subprocess.check_output([program, "schema"], text=True))
    text = written(schemas)
    if "--check" in rest:
        if TARGET.read_text(encoding="utf-8") == text:
            return 0
        print(
            f"{TARGET} is not what the library declares: run `cargo xtask signatures`"
        )
        return 1
    TARGET.write_text(text, encoding="utf-8")
    return 0


def written(schemas: dict[str, Any]) -> str:
    """The whole module."""
    studies = {name: study for name, study in schemas.items() if "request" in study}
    functions = [
        function(name, study["about"], study["request"])
        for name, study in studies.items()
    ]
    names = "".join(f'    "{python_name(name)}",\n' for name in sorted(studies))
    head = HEAD.rstrip("\n") + f"\n\n__all__ = [\n{names}]"
    return "\n\n".join([head, *functions]) + "\n"


def python_name(study: str) -> str:
    """The function of a study."""
    return study.replace("-", "_")


def argument_name(option: str) -> str:
    """The keyword argument of an option: `from` is a keyword of Python."""
    return "from_" if option == "from" else option


def function(name: str, about: str, schema: dict[str, Any]) -> str:
    options = schema["properties"]
    required = set(schema.get("required", ()))
    extra, result, returns = PYTHON.get(name, DOCUMENT)
    first = FIRST.get(name, ("Case", "The case."))
    arguments, documents = [], []
    for option, declared in options.items():
        argument = argument_name(option)
        default = None if option in required else python_default(declared)
        kind = annotation(option, declared, default)
        arguments.append(
            f"    {argument}: {kind}" + (f" = {default}" if default else "") + ","
        )
        documents.append((argument, kind, documentation(declared)))
    for argument, kind, default, text in extra:
        arguments.append(f"    {argument}: {kind} = {default},")
        documents.append((argument, kind, text))
    python = python_name(name)
    arrays = name in OVER_ARRAYS
    if arrays:
        documents.append(
            (
                "**parameters",
                "Varied",
                (
                    "Keys of the case to change. Arrays (one-dimensional, or xarray DataArrays) "
                    "give a Dataset with one dimension per array."
                ),
            )
        )
    quoted = f'"{result}"' if "Dataset" in result else result

    def signature(keys: str, type_: str) -> str:
        tail = [f"    **parameters: {keys},"] if keys else []
        star = ["    *,"] if arguments else []
        lines = [f"    case: {first[0]},", *star, *arguments, *tail]
        return "\n".join([f"def {python}(", *lines, f") -> {type_}:"])

    module = "_studies"
    if name in {"modes", *OVER_ARRAYS}:
        module = "_motions"
    # A scan is a dataset only where it is written line by line.
    if extra[:1] == DATASET[:1] and name != "scan":
        module = "_datasets"
    further = "".join(f", {argument}" for argument, *_ in extra)
    called = f"{python}(" if name in PYTHON else f'document("{name}", '
    call = f"    return {module}.{called}case, options{further}"
    call += ", parameters)" if arrays else ")"
    body = "\n".join(
        [
            docstring(about, first, documents, returns, EXAMPLES.get(name, "")),
            f'    options = _arguments.options("{name}", locals())',
            call,
        ]
    )
    if name == "orbit":
        single = signature("Value", "Orbit")
        many = signature("Varied", '"StudyDataset"')
        whole = signature("Varied", quoted)
        single = single.replace("(\n", "(  # type: ignore[overload-overlap]\n", 1)
        return f"@overload\n{single} ...\n@overload\n{many} ...\n{whole}\n{body}"
    return f"{signature('Varied' if arrays else '', quoted)}\n{body}"


def kinds(declared: dict[str, Any]) -> list[str]:
    found = declared.get("type")
    if found is None:
        options = declared.get("anyOf", []) + declared.get("oneOf", [])
        return [kind for option in options for kind in kinds(option)]
    return [found] if isinstance(found, str) else list(found)


def words(declared: dict[str, Any]) -> list[str]:
    """The names of a choice."""
    found = list(declared.get("enum", []))
    if "const" in declared:
        found.append(declared["const"])
    for option in declared.get("anyOf", []) + declared.get("oneOf", []):
        found += words(option)
    return [word for word in found if isinstance(word, str)]


def annotation(option: str, declared: dict[str, Any], default: str | None) -> str:
    choices = words(declared)
    known = kinds(declared)
    if choices:
        kind = f"Literal[{', '.join(json.dumps(word) for word in choices)}]"
    elif option == "box":
        return "Box"
    elif option == "over":
        return "str | Sequence[str] | Mapping[str, Any]"
    elif "object" not in known and declared.get("items") == {"type": "string"}:
        return "Sequence[str] | None"
    elif declared.get("x-own") and "object" in known:
        return "Any"
    elif option in {"x", "y"}:
        return "str | Mapping[str, Any]"
    elif option == "attractors":
        return "Iterable[Any] | None"
    elif option == "state":
        return "Any"
    elif option == "drive_signal":
        return "str | Path | Mapping[str, Any] | None"
    elif "object" in known:
        kind = "Mapping[str, tuple[float | str, float | str]] | str"
    elif "integer" in known and "array" in known:
        kind = "int | Sequence[int]"
    elif "array" in known:
        return "Any"
    elif "number" in known and "string" in known:
        kind = "float | str"
    else:
        named = {
            "integer": "int",
            "number": "float",
            "boolean": "bool",
            "string": "str",
        }
        kind = next(named[k] for k in known if k in named)
    return f"{kind} | None" if default == "None" else kind


def python_default(declared: dict[str, Any]) -> str:
    default = declared.get("default")
    if isinstance(default, dict) or default in ([], ""):
        return "None"
    if isinstance(default, list) and len(set(default)) == 1:
        default = default[0]  # the same in both regimes
    if isinstance(default, int) and not isinstance(default, bool) and default >= 10_000:
        return f"{default:_}"
    return json.dumps(default) if isinstance(default, str) else repr(default)


def documentation(declared: dict[str, Any]) -> str:
    text = " ".join(declared.get("description", "").split())
    for mark in "{}":
        text = text.replace(mark, "`")
    text = in_python(text)
    low, high = declared.get("minimum"), declared.get("maximum")
    if high is not None and "integer" in kinds(declared):
        text += f" ({low or 0} to {high})"
    meanings = [
        f"`{option['const']}`: {option['description']}"
        for option in declared.get("oneOf", [])
        if "const" in option and "description" in option
    ]
    return "; ".join([text, *meanings]) + "."


# A key with its values as the terminal takes them: ends with a count, ends, or a list.
AT_THE_TERMINAL = re.compile(
    r"(?P<key>[a-z][\w.]*)=(?:\"(?P<quoted>[^\"]*)\"|(?P<plain>[^\s;\"]*[^\s;,.)\"]))"
)


def in_python(text: str) -> str:
    """Values of keys in the words of Python: `{"omega": range(2, 4, 400)}` for omega=2:4:400."""

    def quantity(word: str) -> str:
        try:
            float(word)
        except ValueError:
            spaced = re.sub(r"(?<=\d)(?=[a-zA-Zµ])", " ", word)
            return json.dumps(spaced, ensure_ascii=False)
        return word

    def value(match: re.Match[str]) -> str:
        written = match["quoted"] if match["quoted"] is not None else match["plain"]
        parts = written.split(":")
        if len(parts) == 2:
            ends = ", ".join(map(quantity, parts))
            return f'{{"{match["key"]}": ({ends})}}'
        if len(parts) in (3, 4):
            first, last, count, *log = parts
            spaced = ", log=True" if log else ""
            ends = f"{quantity(first)}, {quantity(last)}, {count}{spaced}"
            return f'{{"{match["key"]}": nanotap.range({ends})}}'
        if "," in written:
            return f'{{"{match["key"]}": [{", ".join(written.split(","))}]}}'
        return match[0]

    return AT_THE_TERMINAL.sub(value, text)


def docstring(
    about: str,
    first: tuple[str, str],
    documents: list[tuple[str, str, str]],
    returns: str,
    example: str,
) -> str:
    """In numpy's style."""

    def indented(text: str) -> str:
        return textwrap.fill(
            text, 84, initial_indent=" " * 8, subsequent_indent=" " * 8
        )

    lines = [
        "    Parameters",
        "    ----------",
        f"    case : {first[0]}",
        indented(first[1]),
    ]
    for argument, kind, text in documents:
        lines += [f"    {argument} : {kind}", indented(text)]
    lines += [
        "",
        "    Returns",
        "    -------",
        textwrap.fill(returns, 84, initial_indent="    ", subsequent_indent="    "),
    ]
    lines += [
        "",
        "    Raises",
        "    ------",
        "    ValueError",
        "        An argument is invalid; the message names it.",
        "    RuntimeError",
        "        The computation failed.",
    ]
    if example:
        shown = example.strip().splitlines()
        lines += ["", "    Examples", "    --------"]
        lines += [f"    {line}".rstrip() for line in (CASE, *shown)]
    first = textwrap.fill(f"{about}.", 84, subsequent_indent="    ")
    return f'    """{first}\n\n' + "\n".join(lines) + '\n    """'


if __name__ == "__main__":
    sys.exit(main())
