"""Figures in the style of the terminal's: one call a result, each a matplotlib Figure.

`nanotap.plot.orbit(orbit)`, `sweep(ds)`, `basin(ds)` …; `show(result)` picks by what the
result is. Lettering is that of a journal's column at final size, colours are those of Okabe
and Ito, and what a colour means is the same as at the terminal.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from . import _motions
from ._case import Case
from ._results import Attractors, Convergence, Lyapunov, Modes, Orbit

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

BLUE = "#0072b2"
VERMILLION = "#d55e00"
GREEN = "#009e73"
PURPLE = "#cc79a7"
ORANGE = "#e69f00"
SKY = "#56b4e9"
YELLOW = "#f0e442"
GREY = "#808080"
LIGHT_GREY = "#e2e2e2"

LINES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, "#000000")
"""Colours of lines, in their order."""

_FILLS = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILLION, YELLOW)
_CLASSES = {
    "periodic": BLUE,
    "quasi-periodic": GREEN,
    "chaotic": VERMILLION,
    "unbounded": "#000000",
    "undecided": GREY,
}
_MARKS = {
    "fold": ("s", "#000000", "fold"),
    "flip": ("D", VERMILLION, "period doubling"),
    "neimark-sacker": ("^", PURPLE, "Neimark–Sacker"),
    "grazing": ("o", GREEN, "grazing"),
    "crossing": ("x", "#000000", "crossing"),
}
_LABELS = {
    "tip_max": "max $W$",
    "tip_min": "min $W$",
    "amplitude": "amplitude of $W$",
    "first_harmonic": "first harmonic of $W$",
    "phase": "phase (degrees)",
    "contact_fraction": "part of the time in contact",
    "peak_force": "peak force",
    "impact_speed": "speed of impact",
    "spectral_radius": "largest multiplier $|\\mu|$",
}
_MM = 1 / 25.4
# Widths of a journal's columns, mm.
_SINGLE, _MIDDLE, _DOUBLE = 85, 120, 175

STYLE: dict[str, Any] = {
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.linewidth": 0.5,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.minor.visible": True,
    "ytick.minor.visible": True,
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
"""What the figures set of matplotlib; `matplotlib.rc_context(STYLE)` gives it to yours."""


class Picture(Figure):
    """A matplotlib Figure that a notebook shows without pyplot being set up."""

    def _repr_png_(self) -> bytes:
        stream = BytesIO()
        with mpl.rc_context(STYLE):
            self.savefig(stream, format="png", dpi=150)
        return stream.getvalue()


@contextmanager
def page(width: float, height: float, **grid: Any) -> Iterator[tuple[Picture, Any]]:
    """A page of `width` by `height` (mm) in the style of these figures, and its panels.

    `grid` is what `Figure.subplots` takes: `nrows`, `ncols`, `sharex` …
    """
    with mpl.rc_context(STYLE):
        picture = Picture(figsize=(width * _MM, height * _MM), layout="constrained")
        yield picture, picture.subplots(**grid)


def _above(axes: "Axes", **options: Any) -> None:
    """The legend above the panel, as wide as its entries."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        count = len(set(labels))
        settings = {"ncols": min(count, 4), "columnspacing": 1.2, "borderaxespad": 0.2}
        axes.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), **(settings | options)
        )


def _case_of(ds: "xr.Dataset") -> dict[str, Any]:
    return dict(json.loads(ds.attrs["case"]))


def _period_of(ds: "xr.Dataset") -> float:
    return float(2 * np.pi / _case_of(ds)["omega"])


def _time_panel(axes: "Axes", ds: "xr.Dataset", periods: float) -> None:
    time = ds.tau.values / _period_of(ds)
    inside = time <= periods + 1e-9
    time = time[inside]
    tip = ds.tip.values[inside]
    if "contact" in ds:
        contact = ds.contact.values[inside]
        axes.fill_between(
            time,
            0,
            1,
            where=contact,
            transform=axes.get_xaxis_transform(),
            color=LIGHT_GREY,
            linewidth=0,
            label="contact",
        )
    seen = [tip]
    if "gap" in ds:
        surface = tip - ds.gap.values[inside]
        seen.append(surface)
        axes.plot(
            time, surface, color=GREY, linestyle="--", linewidth=0.6, label="sample"
        )
    axes.plot(time, tip, color=BLUE, label="tip")
    axes.set(xlabel="time $\\tau / T$ (drive periods)", ylabel="tip deflection $W$")
    axes.margins(x=0)
    # The shading knows no height of its own.
    low, high = float(np.min(seen)), float(np.max(seen))
    space = 0.06 * (high - low) or 1.0
    axes.set_ylim(low - space, high + space)
    _above(axes)


def _portrait(axes: "Axes", ds: Any, endless: bool, color: str = BLUE) -> None:
    axes.plot(
        ds.tip,
        ds.tip_rate,
        color=color,
        linewidth=0.3 if endless else 0.9,
        rasterized=endless,
    )
    axes.set(xlabel="tip deflection $W$", ylabel="tip velocity $dW/d\\tau$")


def _strobe(axes: "Axes", ds: Any, **options: Any) -> None:
    """Where the motion is at drive phase 0."""
    time = ds.tau.values / _period_of(ds)
    whole = np.abs(time - np.round(time)) < 1e-9
    points = whole & (time < time.max() - 0.5)
    settings: dict[str, Any] = {
        "color": VERMILLION,
        "linestyle": "none",
        "marker": "o",
        "markersize": 3.5,
        "label": "at drive phase 0",
    } | options
    axes.plot(
        ds.tip.values[points],
        ds.tip_rate.values[points],
        **settings,
    )


def run(ds: "xr.Dataset", *, periods: float | None = None) -> Picture:
    """A run of `simulate`: time series with the contacts shaded, and phase portrait."""
    if "tau" not in ds.dims or ds.sizes["tau"] < 2:
        message = "the run has no time series; leave series= away"
        raise ValueError(message)
    recorded = float(ds.tau[-1]) / _period_of(ds)
    named = ds.get("period")
    period = np.nan if named is None else float(named)
    if not np.isfinite(period) and "apparent_period" in ds:
        period = float(ds.apparent_period)
    settled = np.isfinite(period) and float(ds.get("transient", 0)) > 0
    shown = np.clip(2 * period, 4, 16) if settled else 16
    shown = min(recorded, shown if periods is None else periods)
    with page(_DOUBLE, 66, ncols=2, width_ratios=(1.7, 1)) as (figure, (left, right)):
        _time_panel(left, ds, shown)
        if "classification" in ds:
            word = (
                f"period {period:.0f}"
                if np.isfinite(period)
                else ds.classification.item()
            )
        else:
            word = f"Runge–Kutta, {ds.attrs['steps'][0]} steps"
        left.set_title(str(word))
        _portrait(right, ds, endless=not settled)
        small = {} if settled else {"marker": ".", "markersize": 1.5}
        _strobe(right, ds, **small)
        _above(right)
    return figure


def orbit(orbit: Orbit) -> Picture:
    """An orbit: time series, phase portrait, harmonics, multipliers."""
    ds = orbit.series
    if ds is None:
        message = "only an orbit found by nanotap.orbit has a time series"
        raise ValueError(message)
    with page(_DOUBLE, 136, nrows=2, ncols=2, width_ratios=(1.7, 1)) as (
        figure,
        panels,
    ):
        _time_panel(panels[0, 0], ds, orbit.period)
        panels[0, 0].set_title(f"period {orbit.period}, {orbit.stability}")
        _portrait(panels[0, 1], ds, endless=False)
        _strobe(panels[0, 1], ds)
        _above(panels[0, 1])
        _harmonics(panels[1, 0], orbit)
        _multipliers(panels[1, 1], orbit)
    return figure


def _harmonics(axes: "Axes", orbit: Orbit) -> None:
    table = orbit.spectrum()
    # What is smaller is rounding of what is largest.
    table = table[table.tip > 1e-8 * table.tip.max()]
    floor = table.tip.min() / 3
    axes.vlines(table.index, floor, table.tip, color=BLUE, linewidth=0.9)
    axes.plot(table.index, table.tip, "o", color=BLUE, markersize=3)
    axes.set(
        yscale="log",
        xlabel="frequency / $\\Omega$",
        ylabel="amplitude $|\\hat W_n|$",
        ylim=(floor, None),
        xlim=(0, None),
    )


def _multipliers(axes: "Axes", orbit: Orbit) -> None:
    turn = np.linspace(0, 2 * np.pi, 361)
    axes.plot(np.cos(turn), np.sin(turn), color=GREY, linewidth=0.6)
    inside = np.abs(orbit.multipliers) < 1
    for part, color in ((inside, BLUE), (~inside, VERMILLION)):
        chosen = orbit.multipliers[part]
        axes.plot(chosen.real, chosen.imag, "o", color=color, markersize=3.5)
    axes.set(xlabel="Re $\\mu$", ylabel="Im $\\mu$", aspect="equal")


# Attractors that get a portrait, and drive periods of one that never repeats.
_MOST = 8
_WANDERING_PERIODS = 64


def attractors(found: Attractors) -> Picture:
    """Phase portraits and strobe points of every attractor, each in its own colour."""
    case = found.case
    shown = list(found)[:_MOST]
    series: list[Any] = []
    for one in shown:
        if one.period:
            series.append(
                _motions.orbit(case, period=one.period, state=one.state).series
            )
        else:
            series.append(
                _motions.simulate(
                    case,
                    state=one.state,
                    transient=0,
                    periods=_WANDERING_PERIODS,
                    max_period=1,
                )
            )
    # The largest first, so that it hides no other.
    order = sorted(range(len(shown)), key=lambda k: -float(np.abs(series[k].tip).max()))
    with page(_DOUBLE, 84, ncols=2) as (figure, (left, right)):
        for k in order:
            endless = not shown[k].period
            color = LINES[k % len(LINES)]
            _portrait(left, series[k], endless, color)
            left.lines[-1].set_label(
                f"{shown[k].name}, {100 * shown[k].fraction:.3g} %"
            )
            size = {"marker": ".", "markersize": 1.5} if endless else {}
            _strobe(right, series[k], color=color, **size)
        for unstable in found.unstable:
            tips = _tips(case, unstable.states)
            right.plot(
                *tips,
                "D",
                color=GREY,
                markersize=3.5,
                fillstyle="none",
                label="unstable orbits",
            )
        right.set(
            xlabel="tip deflection $W$",
            ylabel="tip velocity $dW/d\\tau$",
            title="at drive phase 0",
        )
        _above(left, ncols=2)
    return figure


def _tips(case: Case, states: Any) -> tuple[Any, Any]:
    """Tip deflection and rate of states: φ_j(1) = 2 (−1)^(j+1)."""
    half = states.shape[1] // 2
    if case.kind != "cantilever":
        return states[:, 0], states[:, half]
    ends = 2.0 * (-1.0) ** np.arange(half)
    return states[:, :half] @ ends, states[:, half : 2 * half] @ ends


def _symbol(ds: "xr.Dataset", name: str) -> str:
    return f"${_plain(str(ds[name].attrs.get('symbol', name)))}$"


_SUBSCRIPTS = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")


def _plain(symbol: str) -> str:
    """A symbol or key as matplotlib's formulas write it: α₄ and alpha4 as α_4."""
    if symbol.startswith("alpha"):
        symbol = f"α{symbol.removeprefix('alpha')}"
    elif symbol == "omega":
        symbol = "Ω"
    symbol = symbol.translate(_SUBSCRIPTS)
    head = symbol.rstrip("0123456789")
    tail = symbol[len(head) :]
    for letter, word in (("Ω", "\\Omega"), ("ω", "\\omega"), ("α", "\\alpha")):
        head = head.replace(letter, word)
    head = head.replace("_", "\\_")
    return f"{head}_{{{tail}}}" if tail else head


def sweep(ds: "xr.Dataset") -> Picture:
    """A sweep: a bifurcation diagram over one parameter, a map of motions over two."""
    dims = list(ds.classification.dims)
    return _diagram(ds) if len(dims) == 2 else _map(ds, dims)


def _diagram(ds: "xr.Dataset") -> Picture:
    name = str(ds.classification.dims[0])
    meanings = ds.classification.attrs["flag_meanings"].split()
    codes, periods, highs = (
        ds[key].values for key in ("classification", "period", "period_max")
    )
    # An orbit repeats after one turn.
    turn = np.where(periods > 0, periods, highs.shape[-1])
    once = np.arange(highs.shape[-1]) < turn[..., None]
    ways = (
        ds.direction.values
        if "direction" in ds.coords
        else np.full(ds.sizes["start"], "")
    )
    shown = [way for way in ("up", "down", "") if way in ways]
    with page(
        _DOUBLE, 20 + 58 * len(shown), nrows=len(shown), sharex=True, squeeze=False
    ) as (figure, panels):
        for axes, way in zip(panels[:, 0], shown, strict=True):
            lanes = ways == way
            # What is chaotic lies under what is periodic.
            for code in (4, 5, 3, 2, 1):
                chosen = (codes == code) & lanes
                points = once & chosen[..., None] & np.isfinite(highs)
                if not points.any():
                    continue
                x = np.broadcast_to(ds[name].values[:, None, None], highs.shape)[points]
                size = 1.0 if len(x) < 2000 else 0.5 if len(x) < 20_000 else 0.15
                axes.scatter(
                    x,
                    highs[points],
                    s=size,
                    color=_CLASSES[meanings[code]],
                    linewidths=0,
                    rasterized=True,
                    label=meanings[code],
                )
            axes.set(
                ylabel="max $W$ in a drive period",
                title=f"following {way}" if way else "",
            )
            if ds[name].attrs.get("spacing") == "log":
                axes.set_xscale("log")
            axes.margins(x=0)
            _above(axes, markerscale=4, handlelength=0.8)
        panels[-1, 0].set_xlabel(_symbol(ds, name))
    return figure


# Motions of a map that get a colour of their own.
_MOST_CATEGORIES = 12


def _map(ds: "xr.Dataset", dims: Sequence[Any]) -> Picture:
    y, x = str(dims[0]), str(dims[1])
    meanings = ds.classification.attrs["flag_meanings"].split()
    codes = ds.classification.values.astype(int)
    periods = ds.period.values.astype(int)
    keys = [
        [
            tuple(
                sorted(
                    {
                        (int(c), int(p))
                        for c, p in zip(codes[j, i], periods[j, i], strict=True)
                    }
                )
            )
            for i in range(codes.shape[1])
        ]
        for j in range(codes.shape[0])
    ]
    flat = [key for row in keys for key in row]
    frequent = sorted(set(flat), key=lambda key: (-flat.count(key), key))
    named = sorted(frequent[:_MOST_CATEGORIES])
    free = (
        color for color in _tints() if color not in {to_rgb(GREEN), to_rgb(VERMILLION)}
    )
    colors: list[Any] = []
    words: list[str] = []
    for key in named:
        single = meanings[key[0][0]] if len(key) == 1 else None
        if single in (None, "periodic"):
            colors.append(next(free))
        else:
            colors.append(_CLASSES.get(str(single), "#ffffff"))
        words.append(
            " + ".join(
                f"period {p}" if meanings[c] == "periodic" else meanings[c]
                for c, p in key
            )
        )
    if len(frequent) > len(named):
        colors.append("#c8c8c8")
        words.append("other")
    index = {key: k for k, key in enumerate(named)}
    cells = np.array([[index.get(key, len(named)) for key in row] for row in keys])
    with page(_MIDDLE, 80) as (figure, axes):
        _cells(axes, ds, x, y, cells, colors)
        axes.legend(
            handles=[
                Patch(color=color, label=word)
                for color, word in zip(colors, words, strict=True)
            ],
            loc="upper left",
            bbox_to_anchor=(1.02, 1.0),
            borderaxespad=0,
            handlelength=0.9,
            handleheight=0.9,
        )
    return figure


def _tints() -> Iterator[tuple[float, float, float]]:
    """Okabe and Ito's colours, then lighter tints of them."""
    for share in (0.0, 0.45, 0.7):
        for fill in _FILLS:
            red, green, blue = to_rgb(fill)
            yield (
                red + (1 - red) * share,
                green + (1 - green) * share,
                blue + (1 - blue) * share,
            )


def _edges(ds: "xr.Dataset", name: str) -> Any:
    """The outer edges of cells around the values of an axis."""
    values = ds[name].values.astype(float)
    log = ds[name].attrs.get("spacing") == "log"
    if len(values) == 1:
        half = 0.5 if values[0] == 0 else 0.05 * abs(values[0])
        return np.array([values[0] - half, values[0] + half])
    shown = np.log(values) if log else values
    inner = 0.5 * (shown[1:] + shown[:-1])
    first, last = 2 * shown[0] - inner[0], 2 * shown[-1] - inner[-1]
    edges = np.concatenate([[first], inner, [last]])
    return np.exp(edges) if log else edges


def _cells(
    axes: "Axes", ds: "xr.Dataset", x: str, y: str, cells: Any, colors: Sequence[Any]
) -> None:
    norm = BoundaryNorm(np.arange(len(colors) + 1) - 0.5, max(len(colors), 1))
    axes.pcolormesh(
        _edges(ds, x),
        _edges(ds, y),
        cells,
        cmap=ListedColormap(list(colors)),
        norm=norm,
        rasterized=True,
    )
    for name, scale, label in (
        (x, axes.set_xscale, axes.set_xlabel),
        (y, axes.set_yscale, axes.set_ylabel),
    ):
        if ds[name].attrs.get("spacing") == "log":
            scale("log")
        label(_symbol(ds, name))
    axes.tick_params(which="both", direction="out", top=False, right=False)


def basin(ds: "xr.Dataset") -> Picture:
    """Basins: a colour an attractor, and where the attractors' own strobe points lie."""
    y, x = (str(dim) for dim in ds.attractor.dims)
    known = json.loads(ds.attrs["attractors"])
    cells = ds.attractor.values.astype(int)
    fills = list(_tints())
    colors: list[Any] = [fills[k % len(fills)] for k in range(len(known))]
    words = [
        f"period {one['period']}" if one["period"] else one["classification"]
        for one in known
    ]
    labels = cells.copy()
    for label, word, grey in (
        (-1, "unsettled", 190),
        (-2, "unbounded", 60),
        (-3, "not followed", 120),
    ):
        if (cells == label).any():
            labels[cells == label] = len(colors)
            colors.append((grey / 255,) * 3)
            words.append(word)
    names = ds.attrs["state_entries"].split()
    with page(_MIDDLE, 80) as (figure, axes):
        _cells(axes, ds, x, y, labels, colors)
        limits = axes.get_xlim(), axes.get_ylim()
        for k, one in enumerate(known):
            states = np.array(one["states"])
            at = states[:, names.index(x)], states[:, names.index(y)]
            if one["period"]:
                axes.plot(
                    *at,
                    "o",
                    color=colors[k],
                    markersize=4.5,
                    markeredgecolor="w",
                    markeredgewidth=0.8,
                )
            else:
                axes.plot(*at, "k.", markersize=0.8)
        axes.set(xlim=limits[0], ylim=limits[1], xlabel=_entry(x), ylabel=_entry(y))
        axes.legend(
            handles=[
                Patch(color=color, label=word)
                for color, word in zip(colors, words, strict=True)
            ],
            loc="upper left",
            bbox_to_anchor=(1.02, 1.0),
            borderaxespad=0,
            handlelength=0.9,
            handleheight=0.9,
        )
    return figure


def _entry(name: str) -> str:
    """How an entry of a state is written: v1 is the rate of a1."""
    if len(name) < 2:
        return f"${name}$"
    letter, number = name[0], name[1:]
    return f"$a_{{{number}}}$" if letter == "a" else f"$\\dot a_{{{number}}}$"


def branch(ds: "xr.Dataset", *, show: str = "tip_max") -> Picture:
    """Branches against the parameter, a colour a period, with their bifurcations; beside them
    the loci of these in two parameters, if they were traced."""
    if show not in _LABELS:
        message = f"show: `{show}` is none; there are {', '.join(_LABELS)}"
        raise ValueError(message)
    name = ds.attrs["parameter"]
    loci = "locus_first" in ds
    with page(
        _DOUBLE if loci else _MIDDLE, 88, ncols=2 if loci else 1, squeeze=False
    ) as (figure, panels):
        axes = panels[0, 0]
        _branches(
            axes, ds, ds[name].values, ds[show].values, ("branch", "period", "stable")
        )
        _bifurcations(axes, ds, show)
        axes.set(
            xlabel=f"${_plain(ds.attrs['parameter_symbol'])}$", ylabel=_LABELS[show]
        )
        axes.margins(x=0)
        _above(axes, ncols=3)
        if loci:
            _loci(panels[0, 1], ds)
    return figure


def _branches(
    axes: "Axes", ds: "xr.Dataset", x: Any, y: Any, names: tuple[str, str, str]
) -> None:
    """Curves, solid where they attract."""
    branch, period, stable = (ds[name].values for name in names)
    for k, value in enumerate(np.unique(period)):
        color = LINES[k % len(LINES)]
        axes.plot([], [], color=color, label=f"period {value:.0f}")
        for one in np.unique(branch):
            chosen = np.flatnonzero((branch == one) & (period == value))
            for run, attracts in _stretches(chosen, stable):
                style = (
                    {"linewidth": 0.9}
                    if attracts
                    else {"linewidth": 0.6, "linestyle": "--"}
                )
                axes.plot(x[run], y[run], color=color, **style)
    if not stable.all():
        axes.plot([], [], color=GREY, linestyle="--", linewidth=0.6, label="unstable")


def _stretches(chosen: Any, stable: Any) -> Iterator[tuple[Any, bool]]:
    """Stretches of one stability, each beginning where the last one ended."""
    if not len(chosen):
        return
    breaks = np.flatnonzero(np.diff(stable[chosen].astype(int))) + 1
    start = 0
    for end in [*breaks, len(chosen)]:
        yield chosen[max(0, start - 1) : end], bool(stable[chosen[end - 1]])
        start = end


def _bifurcations(axes: "Axes", ds: "xr.Dataset", show: str) -> None:
    if not ds.sizes.get("bifurcation"):
        return
    kinds = ds.bifurcation_kind.values
    size = 3.2 if len(kinds) > 12 else 4.5
    for kind, (marker, color, word) in _MARKS.items():
        chosen = kinds == kind
        if chosen.any():
            axes.plot(
                ds.bifurcation_parameter.values[chosen],
                ds[f"bifurcation_{show}"].values[chosen],
                linestyle="none",
                marker=marker,
                fillstyle="none",
                color=color,
                markersize=0.7 * size if kind == "grazing" else size,
                clip_on=False,
                label=word,
            )


def _loci(axes: "Axes", ds: "xr.Dataset") -> None:
    named: set[str] = set()
    for curve in np.unique(ds.locus.values):
        part = ds.isel(locus_point=ds.locus.values == curve)
        kind, period = str(part.locus_kind.values[0]), int(part.locus_period.values[0])
        _, color, word = _MARKS.get(kind, _MARKS["fold"])
        label = f"{word}, period {period}"
        axes.plot(
            part.locus_first,
            part.locus_second,
            color=color,
            linestyle={1: "-", 2: "--"}.get(period, ":"),
            label=None if label in named else label,
        )
        named.add(label)
    first, second = ds.attrs["parameter"], ds.attrs["second"]
    axes.set(
        xlabel=f"${_plain(first)}$",
        ylabel=f"${_plain(second)}$",
    )
    _above(axes, ncols=2)


_PREFIXES = {
    -18: "a",
    -15: "f",
    -12: "p",
    -9: "n",
    -6: "µ",
    -3: "m",
    0: "",
    3: "k",
    6: "M",
}


def _prefixed(values: Any, unit: str) -> tuple[float, str]:
    """What values are to be multiplied with, and the unit with the prefix that fits."""
    size = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
    power = int(np.clip(3 * np.floor(np.log10(size) / 3), -18, 6)) if size > 0 else 0
    return 10.0**-power, f"{_PREFIXES[power]}{unit}"


def approach(ds: "xr.Dataset") -> Picture:
    """Amplitude, phase, peak force and dissipated energy against the distance, both ways."""
    physical = "physical_A" in ds
    name = ds.attrs["parameter"]
    rows = (
        [
            ("physical_A", "amplitude $A$", "m"),
            ("physical_phase", "phase (degrees)", ""),
            ("physical_F_max", "peak force", "N"),
            ("physical_E_dis_eV", "dissipation", "eV"),
        ]
        if physical
        else [
            ("first_harmonic", "first harmonic of $W$", ""),
            ("phase", "phase (degrees)", ""),
            ("peak_force", "peak force", ""),
            ("dissipation", "dissipation", ""),
        ]
    )
    distance = ds.zc.values if physical else ds[name].values
    factor, unit = _prefixed(distance, "m") if physical else (1.0, "")
    label = f"distance $z_c$ ({unit})" if physical else _symbol(ds, name)
    with page(_DOUBLE, 120, nrows=2, ncols=2, sharex=True) as (figure, panels):
        for axes, (variable, word, base) in zip(panels.flat, rows, strict=True):
            if variable not in ds:
                axes.set_visible(False)
                continue
            values = ds[variable].values
            scale, named = _prefixed(values, base) if base else (1.0, "")
            inner = variable.removeprefix("physical_")
            unstable = _branch_curve(ds, inner, variable)
            if unstable is not None and not physical:
                gaps, heights = unstable
                axes.plot(
                    gaps,
                    heights,
                    color=GREY,
                    linestyle="--",
                    linewidth=0.6,
                    label="unstable",
                )
            for way, color, marker in (
                ("approach", BLUE, "-"),
                ("retract", VERMILLION, "--"),
            ):
                curve = ds[variable].sel(way=way).values
                axes.plot(
                    factor * distance, scale * curve, marker, color=color, label=way
                )
            axes.set_ylabel(f"{word} ({named})" if named else word)
        for axes in panels[-1]:
            axes.set_xlabel(label)
        panels[0, 0].margins(x=0)
        _above(panels[0, 1])
    return figure


def _branch_curve(
    ds: "xr.Dataset", inner: str, variable: str
) -> tuple[Any, Any] | None:
    """The unstable parts of the branches, broken where they are not."""
    name = f"branch_{variable}" if f"branch_{variable}" in ds else f"branch_{inner}"
    if name not in ds or "branch_stable" not in ds:
        return None
    heights = np.where(ds.branch_stable.values.astype(bool), np.nan, ds[name].values)
    joints = np.flatnonzero(np.diff(ds.branch_branch.values)) + 1
    gaps = np.insert(ds.branch_parameter.values, joints, np.nan)
    return gaps, np.insert(heights, joints, np.nan)


def section(found: Lyapunov) -> Picture:
    """A Poincaré section: tip deflection and rate of its points."""
    with page(_MIDDLE, 88) as (figure, axes):
        cut = found.section
        size = 0.3 if cut.sizes["point"] > 2000 else 1.5
        axes.scatter(
            cut.tip,
            cut.tip_rate,
            s=size,
            color=VERMILLION,
            linewidths=0,
            rasterized=True,
        )
        axes.set(
            xlabel="tip deflection $W$",
            ylabel="tip velocity $dW/d\\tau$",
            title=f"{found.classification}, $\\lambda_1$ = {found.exponents[0]:.4g} a drive period",
        )
    return figure


def modes(found: Modes) -> Picture:
    """The mode shapes of the bare beam."""
    with page(_SINGLE, 66) as (figure, axes):
        for k, mode in enumerate(found.shapes.mode.values):
            axes.plot(
                found.shapes.xi,
                found.shapes.sel(mode=mode),
                color=LINES[k % len(LINES)],
                label=f"$\\phi_{{{mode}}}$",
            )
        axes.axhline(0, color=GREY, linewidth=0.4)
        axes.set(xlabel="place along the beam $\\xi$", ylabel="mode shape $\\phi_j$")
        axes.margins(x=0)
        _above(axes, ncols=5)
    return figure


def convergence(found: Convergence) -> Picture:
    """What the tip deflection still changes, against the number of modes."""
    with page(_SINGLE, 66) as (figure, axes):
        known = np.isfinite(found.difference) & (found.difference > 0)
        axes.plot(
            np.array(found.modes)[known], found.difference[known], "o-", color=BLUE
        )
        axes.axhline(
            found.tolerance,
            color=GREY,
            linestyle="--",
            linewidth=0.6,
            label="tolerance",
        )
        axes.set(
            xlabel="modes $N$", ylabel="difference of $W$ / amplitude", yscale="log"
        )
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.minorticks_off()
        _above(axes)
    return figure


def show(result: Any, **options: Any) -> Picture:
    """The figure of any result."""
    draw: Callable[..., Picture]
    for kind, draw in _FIGURES.items():
        if isinstance(result, kind):
            return draw(result, **options)
    for name, draw in _FIGURES_BY_VARIABLE.items():
        if name in getattr(result, "variables", ()):
            return draw(result, **options)
    message = f"there is no figure of a {type(result).__name__}"
    raise TypeError(message)


_FIGURES: dict[type, Callable[..., Picture]] = {
    Orbit: orbit,
    Attractors: attractors,
    Lyapunov: section,
    Modes: modes,
    Convergence: convergence,
}
# The first one that a Dataset has says what it is.
_FIGURES_BY_VARIABLE: dict[str, Callable[..., Picture]] = {
    "branch": branch,
    "attractor": basin,
    "period_max": sweep,
    "way": approach,
    "tau": run,
}
