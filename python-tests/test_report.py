"""Reports of studies: their tables are those of the terminal's CSV files, in SI with units."""

import csv
import os
import pickle
import subprocess
from pathlib import Path

import nanotap
import numpy as np
import pytest
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("NANOTAP", str(ROOT / "target" / "release" / "nanotap"))
CASES = ROOT / "docs" / "cases"

# Study, case, options, and whether it has a figure.
STUDIES = [
    ("fm", "fm-lever.toml", {"points": 3}, True),
    ("force_curve", "force-curve-jkr.toml", {"points": 20}, True),
    ("noise", "dforce-dmt.toml", {}, False),
    ("contact_laws", "dforce-dmt.toml", {}, True),
    ("bimodal", "bimodal-polymer.toml", {"points": 3}, True),
]


@pytest.fixture(scope="module", params=STUDIES, ids=lambda study: study[0])
def study(request, tmp_path_factory):
    """A report, the heads and rows of the CSV file that the terminal writes, and whether there is a
    figure.
    """
    name, file, options, has_figure = request.param
    case = nanotap.Case.from_file(CASES / file)
    report = getattr(nanotap, name)(case, **options, progress=False)
    out = tmp_path_factory.mktemp(name) / "table.csv"
    words = [f"--{key.replace('_', '-')}={value}" for key, value in options.items()]
    command = [PROGRAM, name.replace("_", "-"), str(CASES / file), *words]
    subprocess.run(
        [*command, "--out", str(out), "--quiet"], check=True, capture_output=True
    )
    with out.open() as lines:
        heads, *rows = csv.reader(lines)
    return report, heads, rows, has_figure


def test_the_first_table_is_the_terminals_file(study):
    report, heads, rows, _ = study
    table = report.to_dataframe()
    assert len(table) == len(rows) > 0
    written: dict[str, tuple[str, list[str]]] = {}
    for head, column in zip(heads, zip(*rows, strict=True), strict=True):
        name, _, unit = head.removesuffix(")").partition(" (")
        # Energies are in J and again in eV.
        written.setdefault(name, (unit, list(column)))
    assert list(table.columns) == list(written)
    for name, (unit, texts) in written.items():
        assert table.attrs["units"][name] in {unit, ""}
        for value, text in zip(table[name], texts, strict=True):
            if isinstance(value, str):
                assert value == text
            elif text == "":
                assert np.isnan(value)
            else:
                assert value == float(text)


def test_all_tables_are_a_dataset_with_units(study, tmp_path):
    report, *_ = study
    ds = report.ds
    assert set(ds.dims) == set(report.tables)
    for name, variable in ds.data_vars.items():
        is_text = variable.dtype.kind in "UO"
        assert is_text or {"units", "long_name"} <= set(variable.attrs), name
    ds.to_netcdf(tmp_path / "report.nc")
    nanotap.export.csv(report, tmp_path / "table.csv")
    assert (tmp_path / "table.csv").read_text().count("\n") == len(
        report.to_dataframe()
    ) + 1


def test_a_report_draws_its_figure_and_is_pickled(study):
    report, _, _, has_figure = study
    if has_figure:
        assert isinstance(report.plot(), Figure)
        assert isinstance(nanotap.plot.show(report), Figure)
    else:
        with pytest.raises(TypeError, match="no figure"):
            report.plot()
    again = pickle.loads(pickle.dumps(report))
    assert again == report
    assert again.to_dataframe().equals(report.to_dataframe())
    with pytest.raises(KeyError, match="there is no table `x`"):
        report.to_dataframe("x")
