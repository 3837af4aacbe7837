"""The report of a study: its document, its tables and its figure."""

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ._record import Record

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure


class Report(Record):
    """The report of a study: its document by the names of the terminal's JSON, and its tables.

    >>> import nanotap
    >>> case = nanotap.Case(
    ...     modes=1, cantilever={"k": "2 N/m", "f0": "75 kHz", "Q": 100}, tip={"radius": "10 nm"},
    ...     sample={"law": "hertz", "modulus": "1 GPa", "poisson": 0.3},
    ...     drive={"actuation": "tip", "frequency": "75 kHz", "free_amplitude": "20 nm"},
    ...     gap={"tip": "15 nm"},
    ... )
    >>> noise = nanotap.noise(case)
    >>> noise.ds.frequency.attrs["units"]
    'Hz'
    """

    __slots__ = ("_shown",)

    def __init__(self, entries: Mapping[str, Any], shown: str) -> None:
        super().__init__(entries)
        self._shown = shown

    def _columns(self) -> dict[str, list[dict[str, Any]]]:
        """The columns of each table."""
        tables = json.loads(self._shown)["tables"]
        return {table["name"]: table["columns"] for table in tables}

    @property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """All tables by name; `attrs` of each has the `units` and `labels` of its columns."""
        return {name: _frame(columns) for name, columns in self._columns().items()}

    def to_dataframe(self, name: str | None = None) -> "pd.DataFrame":
        """The table of this name, or the first one: the rows of the terminal's CSV file."""
        tables = self._columns()
        chosen = next(iter(tables)) if name is None else name
        if chosen not in tables:
            message = f"there is no table `{name}`; there are {', '.join(tables)}"
            raise KeyError(message)
        return _frame(tables[chosen])

    @property
    def ds(self) -> "xr.Dataset":
        """All tables as one Dataset, in SI under a physical case: a dimension for each table. A
        variable of a later table whose name is taken gets that of its table in front."""
        import xarray as xr

        variables: dict[str, Any] = {}
        for name, columns in self._columns().items():
            for column in columns:
                own = column["name"]
                key = f"{name}_{own}" if own in variables else own
                attrs = {"units": column["unit"] or "1", "long_name": column["label"]}
                values = _values(column)
                is_text = bool(values) and isinstance(values[0], str)
                variables[key] = (name, values, {} if is_text else attrs)
        return xr.Dataset(variables)

    def plot(self, **options: Any) -> "Figure":
        """The figure of the study; options as in `nanotap.plot`."""
        figure = json.loads(self._shown)["figure"]
        if figure is None:
            message = "this study has no figure"
            raise TypeError(message)
        from ._figure import draw

        return draw(figure, **options)

    def __repr__(self) -> str:
        return f"Report{super().__repr__().removeprefix('Record')}"

    def __reduce__(self) -> tuple[Any, ...]:
        return Report, (self.to_dict(), self._shown)


def _frame(columns: list[dict[str, Any]]) -> "pd.DataFrame":
    """Columns as a table, with their units and labels."""
    import pandas as pd

    table = pd.DataFrame({c["name"]: _values(c) for c in columns})
    table.attrs["units"] = {c["name"]: c["unit"] for c in columns}
    table.attrs["labels"] = {c["name"]: c["label"] for c in columns}
    return table


def _values(column: Mapping[str, Any]) -> list[Any]:
    """The values of a column, NaN where a number is missing, and empty texts."""
    values: list[Any] = column["values"]
    missing = "" if any(isinstance(value, str) for value in values) else float("nan")
    return [missing if value is None else value for value in values]
