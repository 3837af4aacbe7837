"""Functions agree with the library's declarations: names, defaults and documentation."""

import builtins
import doctest
import importlib.util
import inspect
import json
from pathlib import Path

import matplotlib.pyplot
import nanotap
import pytest
from nanotap import _nanotap, export, plot

_WRITER = Path(__file__).parents[1] / "crates" / "nanotap-python" / "signatures.py"
_SPEC = importlib.util.spec_from_file_location("signatures", _WRITER)
_MODULE = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_MODULE)
in_python = _MODULE.in_python

STUDIES = {
    name: (about, json.loads(schema)) for name, about, _, schema in _nanotap.studies()
}


@pytest.mark.parametrize("name", STUDIES)
def test_a_function_has_the_options_that_the_study_declares(name):
    about, schema = STUDIES[name]
    function = getattr(nanotap, name.replace("-", "_"))
    parameters = inspect.signature(function).parameters
    documentation = " ".join(inspect.getdoc(function).split())
    assert documentation.startswith(" ".join(about.split()))
    for option, declared in schema["properties"].items():
        argument = parameters["from_" if option == "from" else option]
        words = " ".join(declared["description"].split())
        words = words.replace("{", "`").replace("}", "`")
        assert in_python(words) in documentation
        if option in schema.get("required", ()):
            assert argument.default is inspect.Parameter.empty
        elif isinstance(declared.get("default"), int | float | str):
            assert argument.default == (declared["default"] or argument.default)


def test_misspelt_arguments_are_told_as_such(regular):
    with pytest.raises(TypeError, match="did you mean period"):
        nanotap.orbit(regular, perod=2)
    with pytest.raises(TypeError, match="startz"):
        nanotap.attractors(regular, startz=2)


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("simulate", {"periods": 10**15}, "from 1 to 2000000"),
        ("orbit", {"period": 2**64 - 1}, "from 1 to 10000"),
        ("attractors", {"threads": 10**9}, "from 1 to 1024"),
        ("attractors", {"max_period": 10**9}, "from 1 to 10000"),
    ],
)
def test_absurd_sizes_are_refused_with_the_limit(regular, name, arguments, words):
    with pytest.raises(ValueError, match=words):
        getattr(nanotap, name)(regular, **arguments)


def test_contact_laws_compares_the_samples(regular):
    found = nanotap.contact_laws(regular)
    assert len(found.samples) >= 2


def public():
    """Every public function, the classes with which a study begins, and the package, by name."""
    found = {name: getattr(nanotap, name) for name in {*nanotap.__all__, "open"}}
    found |= {f"plot.{name}": getattr(plot, name) for name in plot.__all__}
    found |= {
        f"export.{name}": one
        for name, one in vars(export).items()
        if not name.startswith("_")
        and getattr(one, "__module__", "") == export.__name__
    }
    found = {name: one for name, one in found.items() if inspect.isfunction(one)}
    for name in ("Case", "Map", "Report", "range"):
        found[name] = getattr(nanotap, name)
    return found | {"package": nanotap, "export": export}


@pytest.mark.parametrize("name", sorted(public()))
def test_a_public_function_has_an_example_that_holds(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    one = public()[name]
    module = inspect.getmodule(inspect.unwrap(one))
    finder = doctest.DocTestFinder(recurse=inspect.isclass(one))
    names = {**vars(module), "nanotap": nanotap}
    tests = finder.find(one, name, module=module, globs=names)
    examples = [example for test in tests for example in test.examples]
    assert examples, f"{name} has no example"
    assert not any(doctest.SKIP in example.options for example in examples)
    runner = doctest.DocTestRunner()
    failed = [test.name for test in tests if runner.run(test).failed]
    assert not failed
    matplotlib.pyplot.close("all")


def test_import_all_hides_no_builtin():
    assert not set(nanotap.__all__) & set(dir(builtins))
    assert {"open", "range"} <= set(dir(nanotap))
