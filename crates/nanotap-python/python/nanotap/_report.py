"""Reports of studies: the document, and the tables and the figure that belong to it."""

import json
from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ._describe import described
from ._record import Record

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

    from ._nanotap import ReportCore


class Answer:
    """The tables of a result by name, the text of the terminal's CSV file, and the figure as JSON:
    each is made when it is first used. A pickled one has them all.
    """

    def __init__(self, core: "ReportCore | None", **known: Any) -> None:
        self._core = core
        self.__dict__.update(known)

    def _of(self, name: str) -> Any:
        return getattr(self._core, name)

    @cached_property
    def tables(self) -> dict[str, list[dict[str, Any]]]:
        """The columns of each table: `name`, `label`, `unit`, `values`."""
        found = {one["name"]: one["columns"] for one in json.loads(self._of("tables"))}
        for column in (column for columns in found.values() for column in columns):
            name = column["name"]
            column["label"] = (
                column["label"] or described(name) or name.replace("_", " ")
            )
        return found

    @cached_property
    def csv(self) -> str | None:
        """The terminal's CSV file."""
        text: str | None = self._of("csv")
        return text

    @cached_property
    def messages(self) -> list[str]:
        """What the terminal prints beside the report."""
        texts: list[str] = self._of("messages")
        return texts

    @cached_property
    def figure(self) -> str | None:
        """The description of the figure."""
        text: str | None = self._of("figure")
        return text

    def __reduce__(self) -> tuple[Any, ...]:
        names = ("tables", "csv", "figure", "messages")
        return _restored, ({name: getattr(self, name) for name in names},)


def answer_of(result: object) -> Answer | None:
    """The tables and the figure of a result that is as its study returned it."""
    answer: Answer | None = getattr(result, "_answer", None)
    return answer


def _restored(known: dict[str, Any]) -> Answer:
    return Answer(None, **known)


class Answered:
    """What every result has: its tables, the same as a Dataset, and its figure."""

    __slots__ = ()

    _answer: Answer | None

    def _known(self) -> Answer:
        if self._answer is None:
            message = f"this {type(self).__name__} is a part of a result, which has the tables"
            raise ValueError(message)
        return self._answer

    @property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """All tables by name; `attrs` of each has the `units` and `labels` of its columns."""
        return {name: frame(columns) for name, columns in self._known().tables.items()}

    def to_dataframe(self, name: str | None = None) -> "pd.DataFrame":
        """The table of this name, or the first one: the rows of the terminal's CSV file."""
        return frame(chosen(self._known().tables, name))

    @property
    def ds(self) -> "xr.Dataset":
        """All tables as one Dataset, in SI under a physical case: a dimension for each table. A
        variable of a later table whose name is taken gets that of its table in front."""
        import xarray as xr

        answer = self._known()
        variables: dict[str, Any] = {}
        for table, columns in answer.tables.items():
            by_row = any(column["name"] == "unit" for column in columns)
            for column in columns:
                own = column["name"]
                key = f"{table}_{own}" if own in variables else own
                attrs = {"units": column["unit"] or "1", "long_name": column["label"]}
                values = _values(column)
                is_text = bool(values) and isinstance(values[0], str)
                # Of numbers with a unit a row, the column `unit` says it.
                if is_text or (by_row and not column["unit"]):
                    del attrs["units"]
                variables[key] = (table, values, attrs)
        # A file has no other place for it.
        attributes = {} if answer.figure is None else {"figure": answer.figure}
        return xr.Dataset(variables, attrs=attributes)

    @property
    def messages(self) -> list[str]:
        """What the terminal prints beside this result: warnings where the model does not hold or something is
        missing, and notes on what was assumed.

        >>> import nanotap
        >>> nanotap.orbit(nanotap.Case.paper(omega=20)).messages[-1].split(":")[0]
        'note'
        """
        return list(self._known().messages)

    def plot(self, **options: Any) -> "Figure":
        """The figure of the study; options as in `nanotap.plot`."""
        figure = self._known().figure
        if figure is None:
            message = "this study has no figure"
            raise TypeError(message)
        from ._figure import draw

        return draw(figure, **options)


class Report(Answered, Record):
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

    __slots__ = ("_answer",)

    def __init__(self, entries: Mapping[str, Any], answer: Answer, *about: Any) -> None:
        super().__init__(entries, *about)
        self._answer = answer

    def __repr__(self) -> str:
        return f"{type(self).__name__}{super().__repr__().removeprefix('Record')}"

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.to_dict(), self._answer, self._scales, self._schema)


def chosen(
    tables: dict[str, list[dict[str, Any]]], name: str | None
) -> list[dict[str, Any]]:
    """The columns of the table of this name, or of the first one."""
    if not tables:
        message = "there is no table: the time series is too long; take fewer periods"
        raise ValueError(message)
    key = next(iter(tables)) if name is None else name
    if key not in tables:
        message = f"there is no table `{key}`; there are {', '.join(tables)}"
        raise KeyError(message)
    return tables[key]


def frame(columns: list[dict[str, Any]]) -> "pd.DataFrame":
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
