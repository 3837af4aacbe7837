"""Functions agree with the library's declarations: names, defaults and documentation."""

import importlib.util
import inspect
import json
from pathlib import Path

import nanotap
import pytest
from nanotap import _nanotap

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


def test_examples_in_docstrings_hold():
    """Every function of a study has an example, but those that need measured data or a scan."""
    import doctest

    from nanotap import _case, _map, _quantity, _signatures

    finder, runner = doctest.DocTestFinder(recurse=True), doctest.DocTestRunner()
    tested = set()
    for module in (_signatures, _case, _map, _quantity):
        globs = {**vars(module), "nanotap": nanotap}
        for test in finder.find(module, globs=globs):
            if test.examples:
                tested.add(test.name.rsplit(".", 1)[-1])
                runner.run(test)
    assert runner.summarize().failed == 0
    without = set(_signatures.__all__) - tested
    assert without <= {"fit", "reconstruct", "scan"}, without
