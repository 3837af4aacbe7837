"""The Datasets that studies return: those of xarray, with the study's tables and figure."""

from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Any, Self

import xarray as xr
from xarray.plot.accessor import DatasetPlotAccessor

from ._report import Answer, answer_of, chosen, frame

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


class _Plot(DatasetPlotAccessor):
    """The figure of the study, called; and xarray's own figures as methods."""

    __slots__ = ()

    def __call__(self, **options: Any) -> "Figure":  # type: ignore[override]
        from . import plot

        return plot.show(self._ds, **options)


class StudyDataset(xr.Dataset):  # type: ignore[no-untyped-call]
    """A Dataset with the tables and the figure of its study.

    What xarray makes of it, such as a selection, is drawn as well; its table is made of its
    variables.
    """

    __slots__ = ("_answer",)

    _answer: Answer

    @classmethod
    def of(cls, ds: xr.Dataset) -> Self:
        """The same variables and attributes."""
        made = cls(ds.data_vars, ds.coords, ds.attrs)
        made.set_close(ds._close)
        return made

    def answered_by(self, answer: Answer) -> Self:
        """The same Dataset, which has these tables and this figure."""
        self._answer = answer
        return self

    @property
    def plot(self) -> _Plot:  # type: ignore[override]
        """The figure of the study, called with options as in `nanotap.plot`; its methods are those of
        xarray."""
        return _Plot(self)

    @property
    def ds(self) -> Self:
        """The Dataset itself, as other results have it."""
        return self

    @property
    def messages(self) -> list[str]:
        """What the terminal prints beside this result, as of other results; empty for what xarray makes of it."""
        answer = answer_of(self)
        return [] if answer is None else list(answer.messages)

    @property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """All tables by name, first that of the terminal's CSV file; `attrs` of each has the `units`
        and `labels` of its columns."""
        if (answer := answer_of(self)) is not None:
            return {name: frame(columns) for name, columns in answer.tables.items()}
        from .export import table

        return {"table": table(self)}

    def to_dataframe(
        self, dim_order: Sequence[Hashable] | None = None
    ) -> "pd.DataFrame":
        """The table of a name (`tables` has them all), or xarray's table over all dimensions in an
        order."""
        answer = answer_of(self)
        if isinstance(dim_order, str) and answer is not None:
            return frame(chosen(answer.tables, dim_order))
        return super().to_dataframe(dim_order)
