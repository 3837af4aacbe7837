"""Figures drawn by matplotlib from the description that the terminal program draws.

The description is JSON: panels with two axes and layers (lines, points, markers …), with all
ranges, colours and letters resolved. Nothing here depends on the subject of a figure.
"""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from . import _nanotap

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MM = 1 / 25.4
_POINTS = 72 / 25.4

STYLE: dict[str, Any] = {
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.linewidth": 0.5,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.minor.size": 1.4,
    "ytick.minor.size": 1.4,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "lines.linewidth": 0.9,
    "lines.markersize": 4,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "savefig.dpi": 300,
    "figure.dpi": 150,
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
}
"""The figures' matplotlib settings; `matplotlib.rc_context(STYLE)` applies them to yours."""

_DASHES: dict[str, Any] = {
    "solid": "-",
    "dashed": (0, (4.0, 2.2)),
    "dotted": (0, (1.0, 1.6)),
    "dash-dot": (0, (5.0, 1.8, 1.2, 1.8)),
}
_SHAPES = {
    "circle": "o",
    "square": "s",
    "triangle": "^",
    "diamond": "D",
    "cross": "x",
    "plus": "+",
}
_COLOURMAPS = {"diverging": "RdBu_r"}
_CORNERS = {
    "auto": "best",
    "top-left": "upper left",
    "top-right": "upper right",
    "bottom-left": "lower left",
    "bottom-right": "lower right",
}
# Order of drawing, as in the terminal program: maps, bands, rules, data, notes.
_DEPTHS = {"heatmap": 0.5, "category-map": 0.5, "band": 0.7, "rule": 1.2, "note": 4}


class Picture(Figure):
    """A matplotlib Figure that a notebook shows without pyplot."""

    def _repr_png_(self) -> bytes:
        stream = BytesIO()
        with mpl.rc_context(STYLE):
            self.savefig(stream, format="png", dpi=150)
        return stream.getvalue()


@contextmanager
def page(width: float, height: float, **grid: Any) -> Iterator[tuple[Picture, Any]]:
    """A page of `width` by `height` (mm) in the style of these figures, and its panels.

    `grid` is what `Figure.subplots` takes: `nrows`, `ncols`, `sharex` …

    >>> with nanotap.plot.page(180, 80, ncols=2) as (figure, panels):
    ...     lines = panels[0].plot([0, 1], [0, 1])
    """
    with mpl.rc_context(STYLE):
        picture = Picture(figsize=(width * _MM, height * _MM), layout="constrained")
        yield picture, picture.subplots(**grid)


def draw(
    description: str, axes: Any = None, ax: Any = None, panels: str | None = None
) -> Figure:
    """Draws a figure on a new page, or into `axes` (`ax`), one for each panel; `panels` selects
    panels by their letters.

    Raises:
        ValueError: there are not as many axes as panels, or no such panel.
    """
    figure = json.loads(description)
    figure["panels"] = chosen = _chosen(figure["panels"], panels)
    if panels is not None:
        figure |= {"rows": 1, "cols": len(chosen), "share_x": False}
        figure |= {"column_widths": [], "row_heights": [], "height": None}
    return _drawn_at(figure, chosen, ax if axes is None else axes)


def _chosen(panels: list[dict[str, Any]], letters: str | None) -> list[dict[str, Any]]:
    """The panels with these letters."""
    if letters is None:
        return panels
    known = {
        (panel["letter"] or "(a)").strip("()"): panel
        for panel in panels
        if panel["layers"]
    }
    missing = [letter for letter in letters if letter not in known]
    if missing or not letters:
        message = f"panels: unknown panel {''.join(missing)!r}; the panels are {''.join(known)}"
        raise ValueError(message)
    return [known[letter] for letter in letters]


def _drawn_at(
    figure: dict[str, Any], panels: list[dict[str, Any]], axes: Any
) -> Figure:
    if axes is not None:
        given = np.atleast_1d(np.asarray(axes, dtype=object)).ravel()
        if len(given) != len(panels):
            message = (
                f"axes: this figure has {len(panels)} panels, not {len(given)}; "
                'choose some of them with panels="a"'
            )
            raise ValueError(message)
        for one, panel in zip(given, panels, strict=True):
            _panel(one, panel)
        figure_given: Figure = given[0].figure
        return figure_given
    rows, cols = figure["rows"], figure["cols"]
    usual = min(max(0.68 * figure["width"] / cols, 42), 90) * rows
    with page(
        figure["width"],
        figure["height"] or usual,
        nrows=rows,
        ncols=cols,
        squeeze=False,
        sharex="col" if figure["share_x"] else False,
        width_ratios=figure["column_widths"] or None,
        height_ratios=figure["row_heights"] or None,
    ) as (picture, grid):
        flat = list(grid.flat)
        for spare in flat[len(panels) :]:
            spare.remove()
        for index, (one, panel) in enumerate(zip(flat, panels, strict=False)):
            lowest = index + cols >= len(panels)
            _panel(one, panel, last=lowest or not figure["share_x"])
            if lowest:
                # matplotlib leaves them to the panel below, which does not exist here.
                one.tick_params(labelbottom=True)
            one.annotate(
                panel["letter"] or "",
                (0, 1),
                (-6, 4),
                xycoords="axes fraction",
                textcoords="offset points",
                ha="right",
                fontweight="bold",
            )
        if figure["title"]:
            picture.suptitle(_text(figure["title"]), fontsize=9)
        if figure["caption"]:
            picture.supxlabel(_text(figure["caption"]), fontsize=7)
    return picture


def _text(words: str) -> str:
    return _nanotap.mathtext(words)


def _panel(axes: "Axes", panel: dict[str, Any], last: bool = True) -> None:
    both = ((panel["x"], "x"), (panel["y"], "y"))
    for axis, name in both:
        _scale(axis, name, axes)
        _limit(axis, name, axes)
    handles: list[Any] = []
    for layer in panel["layers"]:
        handles += _LAYERS[layer["kind"]](axes, layer) or []
    # Drawing may have changed them.
    for axis, name in both:
        _limit(axis, name, axes)
    axes.set_ylabel(_label(panel["y"]))
    if last:
        axes.set_xlabel(_label(panel["x"]))
    if not panel["layers"]:
        axes.text(0.5, 0.5, "no data", transform=axes.transAxes, ha="center")
    rows = _legend(axes, panel["legend"], handles)
    if panel["title"]:
        # The title is above a legend that is above the panel.
        axes.set_title(_text(panel["title"]), pad=4 + 12 * rows)


def _label(axis: dict[str, Any]) -> str:
    words, unit = _text(axis["label"]), _text(axis["unit"])
    return f"{words} ({unit})" if unit else words


def _scale(axis: dict[str, Any], name: str, axes: "Axes") -> None:
    getattr(axes, f"set_{name}scale")(axis["scale"])
    if axis["marks"] is not None:
        places = [value for value, _ in axis["marks"]]
        words = [_text(word) for _, word in axis["marks"]]
        getattr(axes, f"set_{name}ticks")(places, words)


def _limit(axis: dict[str, Any], name: str, axes: "Axes") -> None:
    if "fixed" in axis["range"]:
        getattr(axes, f"set_{name}lim")(axis["range"]["fixed"])


def _legend(axes: "Axes", place: str, more: list[Any]) -> int:
    """Draws the legend; in rows if it is above the panel."""
    handles, labels = axes.get_legend_handles_labels()
    # Layers with the same label share an entry.
    entries = dict(zip(reversed(labels), reversed(handles), strict=True))
    entries = dict(reversed(entries.items())) | {
        patch.get_label(): patch for patch in more
    }
    if place == "hidden" or not entries:
        return 0
    settings: dict[str, Any] = {"loc": _CORNERS.get(place)}
    if place == "right":
        settings = {
            "loc": "upper left",
            "bbox_to_anchor": (1.02, 1),
            "borderaxespad": 0,
        }
    elif place == "above":
        settings = {
            "loc": "lower left",
            "bbox_to_anchor": (0, 1),
            "ncols": _columns_above(axes, entries),
            "columnspacing": 1.2,
            "borderaxespad": 0.2,
        }
    if more:
        settings |= {"handlelength": 0.9, "handleheight": 0.9}
    legend = axes.legend(entries.values(), entries.keys(), **settings)
    for handle in legend.legend_handles:
        if isinstance(handle, mpl.collections.PathCollection):
            # A visible dot, however small those of the cloud are.
            handle.set_sizes([max(6.0, *handle.get_sizes())])
    above = place == "above"
    return -(-len(entries) // _columns_above(axes, entries)) if above else 0


def _columns_above(axes: "Axes", entries: dict[str, Any]) -> int:
    """Number of columns that fit, for letters half as wide as high."""
    bounds = axes.get_position()
    width = 72 * bounds.width * axes.figure.bbox.width / axes.figure.dpi
    columns = [30 + 3.6 * len(words) for words in entries]
    if sum(columns) <= width:
        return len(columns)
    return int(min(max(width // max(columns), 1), len(columns)))


def _columns(layer: dict[str, Any]) -> tuple[Any, Any]:
    points = layer["points"]
    return np.array(points["x"], dtype=float), np.array(points["y"], dtype=float)


def _words(layer: dict[str, Any]) -> str | None:
    return _text(layer["label"]) or None


def _line(axes: "Axes", layer: dict[str, Any]) -> None:
    x, y = _columns(layer)
    axes.plot(
        x,
        y,
        color=layer["colour"],
        linewidth=layer["width"],
        linestyle=_DASHES[layer["dash"]],
        label=_words(layer),
        rasterized=len(x) > 30_000,
    )


def _points(axes: "Axes", layer: dict[str, Any]) -> None:
    axes.scatter(
        *_columns(layer),
        s=(layer["diameter"] * _POINTS) ** 2,
        color=layer["colour"],
        linewidths=0,
        rasterized=True,
        label=_words(layer),
    )


def _markers(axes: "Axes", layer: dict[str, Any]) -> None:
    colour = layer["colour"]
    axes.plot(
        *_columns(layer),
        linestyle="none",
        marker=_SHAPES[layer["shape"]],
        color=colour,
        markersize=layer["size"]
        * _POINTS
        * (0.8 if layer["shape"] == "diamond" else 1),
        markerfacecolor="white" if layer["open"] else colour,
        markeredgecolor="white" if layer["edge"] else colour,
        markeredgewidth=0.8 if layer["edge"] or layer["open"] else 0.5,
        label=_words(layer),
        clip_on=False,
        zorder=3,
    )


def _rule(axes: "Axes", layer: dict[str, Any]) -> None:
    (axes.axvline if layer["upright"] else axes.axhline)(
        layer["at"],
        color=layer["colour"],
        linewidth=layer["width"],
        linestyle=_DASHES[layer["dash"]],
        label=_words(layer),
        zorder=_DEPTHS["rule"],
    )


def _band(axes: "Axes", layer: dict[str, Any]) -> None:
    low, high = axes.get_xlim() if layer["along_x"] else axes.get_ylim()
    label = _words(layer)
    for start, end in layer["intervals"]:
        (axes.axvspan if layer["along_x"] else axes.axhspan)(
            low if start is None else start,
            high if end is None else end,
            color=layer["colour"],
            linewidth=0,
            label=label,
            zorder=_DEPTHS["band"],
        )
        label = None


def _note(axes: "Axes", layer: dict[str, Any]) -> None:
    def place(at: dict[str, Any]) -> tuple[Any, Any]:
        return (at["data"], "data") if "data" in at else (at["panel"], "axes fraction")

    level, upright = {
        "right": ("left", "center"),
        "left": ("right", "center"),
        "above": ("center", "bottom"),
        "below": ("center", "top"),
        "centre": ("center", "center"),
    }[layer["side"]]
    at, system = place(layer["at"])
    tip, tip_system = place(layer["tip"] or layer["at"])
    axes.annotate(
        _text(layer["text"]),
        tip,
        at,
        xycoords=tip_system,
        textcoords=system,
        color=layer["colour"],
        ha=level,
        va=upright,
        fontsize=7,
        arrowprops={"arrowstyle": "-|>", "linewidth": 0.6} if layer["tip"] else None,
        zorder=_DEPTHS["note"],
    )


def _grid(axes: "Axes", layer: dict[str, Any], cells: Any, **options: Any) -> Any:
    def edges(name: str, count: int) -> Any:
        first, last = layer[name]
        log = getattr(axes, f"get_{name}scale")() == "log"
        return (np.geomspace if log else np.linspace)(first, last, count + 1)

    return axes.pcolormesh(
        edges("x", layer["columns"]),
        edges("y", layer["rows"]),
        np.array(cells, dtype=float).reshape(layer["rows"], layer["columns"]),
        rasterized=True,
        zorder=_DEPTHS["heatmap"],
        **options,
    )


def _heatmap(axes: "Axes", layer: dict[str, Any]) -> None:
    scale = layer["scale"]
    low, high = scale["range"]["fixed"]
    norm = "log" if scale["scale"] == "log" else "linear"
    image = _grid(
        axes,
        layer,
        layer["values"],
        cmap=_COLOURMAPS.get(layer["map"], layer["map"]),
        norm={"log": mpl.colors.LogNorm, "linear": mpl.colors.Normalize}[norm](
            low, high
        ),
    )
    axes.figure.colorbar(image, ax=axes, label=_label(scale))


def _category_map(axes: "Axes", layer: dict[str, Any]) -> list[Any]:
    categories = layer["categories"]
    colours = [one["colour"] for one in categories]
    _grid(
        axes,
        layer,
        layer["cells"],
        cmap=ListedColormap(colours),
        vmin=-0.5,
        vmax=len(colours) - 0.5,
    )
    return [Patch(color=one["colour"], label=_text(one["label"])) for one in categories]


def _stems(axes: "Axes", layer: dict[str, Any]) -> None:
    x, y = _columns(layer)
    foot = axes.get_ylim()[0] if axes.get_yscale() == "log" else layer["foot"] or 0.0
    axes.vlines(x, foot, y, color=layer["colour"], linewidth=0.8)
    axes.plot(x, y, "o", color=layer["colour"], markersize=3, label=_words(layer))


def _bars(axes: "Axes", layer: dict[str, Any]) -> None:
    axes.bar(
        *_columns(layer), layer["width"], color=layer["colour"], label=_words(layer)
    )


_LAYERS: dict[str, Callable[["Axes", dict[str, Any]], list[Any] | None]] = {
    "line": _line,
    "points": _points,
    "markers": _markers,
    "rule": _rule,
    "band": _band,
    "note": _note,
    "heatmap": _heatmap,
    "category-map": _category_map,
    "stems": _stems,
    "bars": _bars,
}
