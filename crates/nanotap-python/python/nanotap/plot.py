"""Figures of results: those of the terminal program, drawn with matplotlib.

`nanotap.plot.orbit(orbit)`, `sweep(ds)`, `basin(ds)` …; `show(result)` chooses by the type of the
result. Each returns a matplotlib Figure; with `axes=` (one for each panel) or `ax=` it draws into
your axes instead. `panels=` selects panels by their letters: `"a"`, `"bd"`. Layers, colours and
labels are described once, for the terminal and for Python; this module only provides the data.
"""

import json
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np

from . import _nanotap
from ._describe import name_in_si
from ._figure import STYLE, Picture, draw, page
from ._report import Answered, answer_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from ._results import (
        Attractors,
        Convergence,
        Fit,
        Lyapunov,
        Modes,
        Orbit,
        Reconstruction,
    )

__all__ = [
    "LINES",
    "MOTIONS",
    "PERIODS",
    "STYLE",
    "Picture",
    "approach",
    "attractors",
    "basin",
    "branch",
    "convergence",
    "fit",
    "fit_map",
    "modes",
    "orbit",
    "orbits",
    "page",
    "reconstruct",
    "run",
    "scan",
    "section",
    "show",
    "sweep",
]


class Where(TypedDict, total=False):
    """Axes for a figure, and the selection of its panels."""

    axes: Any
    ax: Any
    panels: str | None


LINES, PERIODS, MOTIONS = _nanotap.colours()
"""Colours of lines in order, of the periods 1 to 16, and of the other motions by name."""
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, _ = LINES
YELLOW, GREY, LIGHT_GREY = "#f0e442", "#808080", "#e2e2e2"

_LABELS = _nanotap.labels()


def _drawn(
    study: str,
    facts: Mapping[str, Any],
    where: Where,
    columns: Mapping[str, Any] | None = None,
) -> "Figure":
    """The figure of a study, from its document and its large columns."""
    arrays = {
        name: np.require(np.ravel(values), np.float64, ["C", "A"])
        for name, values in (columns or {}).items()
    }
    return draw(_nanotap.describe(study, json.dumps(facts), arrays), **where)


def _whole(ds: "xr.Dataset") -> str | None:
    """The figure of a result that is as its study returned it."""
    answer = answer_of(ds)
    return None if answer is None else answer.figure


def _points(x: Any, y: Any) -> list[list[float]]:
    """Points with finite coordinates."""
    table = np.column_stack([np.asarray(x, float), np.asarray(y, float)])
    return list(table[np.isfinite(table).all(axis=1)].tolist())


def _case_of(ds: "xr.Dataset") -> dict[str, Any]:
    return dict(json.loads(ds.attrs["case"]))


def _period_of(ds: "xr.Dataset") -> float:
    """The drive's period in the unit of the times."""
    case = _case_of(ds)
    period = float(2 * np.pi / case["omega"])
    in_seconds = ds.tau.attrs.get("units") == "s"
    return period * case["physical"]["time_unit"] if in_seconds else period


def _scale(*variables: "xr.DataArray", natural: float = 0.0) -> tuple[float, str]:
    """What multiplies variables of one unit where they are drawn, and the unit: with the prefix
    that fits if it is one of SI. A natural size replaces values that are rounding.
    """
    unit = str(variables[0].attrs.get("units", "1"))
    values = np.abs(np.concatenate([np.ravel(v.values) for v in variables]))
    size = float(np.max(values, initial=0.0, where=np.isfinite(values)))
    if size <= 1e-9 * natural:
        size = natural
    of_taps = unit == "eV"
    factor, shown = _nanotap.axis("J" if of_taps else unit, size)
    shown = f"{shown.removesuffix('J')}eV" if of_taps else shown
    return factor, shown


def _motion(
    ds: "xr.Dataset", title: str, periods: float, endless: bool
) -> dict[str, Any]:
    """A time series as curves."""
    time = ds.tau.values / _period_of(ds)
    shown = time <= periods + 1e-9
    (length, length_unit), (speed, speed_unit) = _scale(ds.tip), _scale(ds.tip_rate)
    tip, rate = length * ds.tip.values, speed * ds.tip_rate.values
    contact = np.append(False, np.append(ds.contact.values[shown], False)).astype(int)
    begun, ended = (
        np.flatnonzero(np.diff(contact) == 1),
        np.flatnonzero(np.diff(contact) == -1),
    )
    whole = (np.abs(time - np.round(time)) < 1e-9) & (time < time.max() - 0.5)
    return {
        "axes": {
            "beam": "stiffness" not in _case_of(ds),
            "length": length_unit,
            "velocity": speed_unit,
        },
        "title": title,
        "contacts": _points(time[begun], time[ended - 1]),
        "surface": _points(time[shown], (tip - length * ds.gap.values)[shown])
        if "gap" in ds
        else [],
        "tip": _points(time[shown], tip[shown]),
        "portrait": _points(tip, rate),
        "strobe": _points(tip[whole], rate[whole]),
        "endless": endless,
    }


def run(
    ds: "xr.Dataset", *, periods: float | None = None, **where: Unpack[Where]
) -> "Figure":
    """A run of `simulate`: time series with the contacts shaded, and phase portrait.

    >>> figure = nanotap.plot.run(nanotap.simulate(nanotap.Case.paper(omega=3), periods=4))
    """
    if "tau" not in ds.dims or ds.sizes["tau"] < 2:
        message = "the run has no time series; omit series="
        raise ValueError(message)
    if periods is None and (figure := _whole(ds)) is not None:
        return draw(figure, **where)
    recorded = float(ds.tau[-1]) / _period_of(ds)
    named = ds.get("period", ds.get("apparent_period"))
    period = np.nan if named is None else float(named)
    repeats = np.isfinite(period) and float(ds.get("transient", 0)) > 0
    shown = np.clip(2 * period, 4, 16) if repeats else 16
    shown = min(recorded, shown if periods is None else periods)
    if "classification" in ds:
        word = str(ds.classification.item())
        title = f"period {period:.0f}" if np.isfinite(period) else word
    else:
        title = f"Runge–Kutta, {ds.attrs['steps'][0]} steps per period"
    if "contact" not in ds:
        ds = ds.assign(contact=("tau", np.zeros(ds.sizes["tau"], bool)))
    return _drawn("motion", _motion(ds, title, shown, endless=not repeats), where)


def orbit(orbit: "Orbit", **where: Unpack[Where]) -> "Figure":
    """An orbit: time series, phase portrait, harmonics, multipliers.

    >>> figure = nanotap.plot.orbit(nanotap.orbit(nanotap.Case.paper(omega=3)))
    >>> figure.savefig("orbit.pdf")
    """
    return orbit.plot(**where)


def attractors(found: "Attractors", **where: Unpack[Where]) -> "Figure":
    """Phase portraits and strobe points of every attractor, in different colours.

    >>> found = nanotap.attractors(nanotap.Case.paper(omega=3), starts=8, progress=False)
    >>> figure = nanotap.plot.attractors(found)
    """
    return found.plot(**where)


def _grid_axis(ds: "xr.Dataset", name: str) -> dict[str, Any]:
    said = ds[name].attrs
    units = str(said.get("units", ""))
    return {
        "label": str(said.get("label", said.get("long_name", name))),
        "units": units,
        "log": said.get("spacing") == "log",
    }


def _axis_of(
    ds: "xr.Dataset", name: str, shown: str = "", natural: float | None = None
) -> dict[str, Any]:
    """The axis of a variable, with the unit in which it is shown."""
    said = ds[name].attrs
    label = _LABELS.get(name, str(said.get("long_name", name)))
    unit = str(said.get("units", "1"))
    unit = shown or ("" if unit == "1" else unit)
    return {"label": label, "unit": unit, "natural": natural}


def _over_one(
    ds: "xr.Dataset", name: str, show: str, branch: Any, where: Where
) -> "Figure":
    """One variable over one parameter, one colour per period."""
    import xarray as xr

    if show not in ds or ds[show].dtype.kind not in "iuf":
        known = (str(n) for n, v in ds.data_vars.items() if v.dtype.kind in "iuf")
        message = (
            f"show: `{show}` is not a numeric variable; available: {', '.join(known)}"
        )
        raise ValueError(message)
    shown = ds[show]
    x, branch, shown = xr.broadcast(ds[name], branch, shown)
    period, stable = (
        ds[key].broadcast_like(shown) if key in ds else xr.full_like(shown, default)
        for key, default in (("period", 1), ("stable", 1))
    )
    columns = {
        "branch": branch,
        "period": period.fillna(0).clip(0),
        "stable": stable,
        "x": x,
        "y": shown,
    }
    rows = _rows(
        **{
            k: v.transpose(*shown.dims).stack(row=shown.dims)
            for k, v in columns.items()
        }
    )
    for row in rows:
        row.update(
            branch=int(row["branch"]),
            period=int(row["period"]),
            stable=bool(row["stable"]),
        )
    (x_scale, x_unit), (y_scale, y_unit) = _scale(x), _scale(shown)
    for row in rows:
        row.update(x=x_scale * row["x"], y=y_scale * row["y"])
    facts = {
        "x": _axis_of(ds, name, x_unit),
        "y": _axis_of(ds, show, y_unit),
        "points": rows,
        "bifurcations": [],
        "curves": None,
    }
    figure = json.loads(_nanotap.describe("branch", json.dumps(facts), {}))
    for layer in figure["panels"][0]["layers"]:
        # Neighbouring values may belong to different motions: points, not lines.
        layer |= {"kind": "markers", "shape": "circle", "size": 0.6}
        layer |= {"open": False, "edge": False}
        if layer["label"] == "period 0":
            layer |= {"label": "not periodic", "colour": GREY}
    return draw(json.dumps(figure), **where)


def orbits(
    ds: "xr.Dataset", *, show: str = "first_harmonic", **where: Unpack[Where]
) -> "Figure":
    """Orbits or runs over an array of one parameter: any scalar variable.

    Raises:
        ValueError: the variable does not exist, or there are several parameters.

    >>> ds = nanotap.orbit(nanotap.Case.paper(omega=3), omega=[2.95, 3.0])
    >>> figure = nanotap.plot.orbits(ds, show="phase")
    """
    names = [name for name in json.loads(ds.attrs.get("over", "[]")) if name in ds.dims]
    if len(names) != 1:
        message = "orbits: the figure needs one parameter; select values of the others"
        raise ValueError(message)
    starts = ds.start if "start" in ds.dims else ds[names[0]] * 0
    return _over_one(ds, names[0], show, starts, where)


def sweep(
    ds: "xr.Dataset", *, show: str | None = None, **where: Unpack[Where]
) -> "Figure":
    """A sweep: a bifurcation diagram over one parameter, a map of motions over two; with `show`
    any variable over one parameter.

    >>> ds = nanotap.sweep(
    ...     nanotap.Case.paper(), over={"omega": nanotap.range(2.9, 3.1, 3)}, periods=4, progress=False
    ... )
    >>> figure = nanotap.plot.sweep(ds, show="amplitude")
    """
    if show is not None:
        names = [str(d) for d in ds.classification.dims if d != "start"]
        if len(names) != 1:
            message = (
                "show: the figure needs one parameter; select values of the others"
            )
            raise ValueError(message)
        starts = ds.start if "start" in ds.dims else ds[names[0]] * 0
        return _over_one(ds, names[0], show, starts, where)
    if "start" not in ds.dims:
        ds = ds.expand_dims("start", axis=-1)
    names = [str(dim) for dim in ds.classification.dims if dim != "start"]
    order = (*names, "start")
    directions = (
        np.atleast_1d(ds.direction.values) if "direction" in ds.coords else None
    )
    facts = {
        "axes": [_grid_axis(ds, name) for name in names],
        "directions": [""] * ds.sizes["start"]
        if directions is None
        else [str(way) for way in directions],
        "units": str(ds.period_max.attrs.get("units", ""))
        if "period_max" in ds
        else "",
    }
    columns = {f"axis{k}": ds[name].values for k, name in enumerate(names)}
    columns |= {
        name: ds[key].transpose(*order).values
        for name, key in (
            ("classification", "classification_code"),
            ("period", "period"),
        )
    }
    if len(names) == 1:
        columns["period_max"] = ds.period_max.transpose(*order, ...).values
    return _drawn("sweep", facts, where, columns)


def basin(ds: "xr.Dataset", **where: Unpack[Where]) -> "Figure":
    """Basins: one colour per attractor, with the strobe points of the attractors.

    >>> sides = {"x": {"a1": (-1, 1, 3)}, "y": {"v1": (-1, 1, 3)}}
    >>> ds = nanotap.basin(nanotap.Case.paper(omega=3), **sides, progress=False)
    >>> figure = nanotap.plot.basin(ds)
    """
    y, x = (str(dim) for dim in ds.attractor.dims)
    recipe = json.loads(ds.attrs["basin"])
    facts = {
        "x": x,
        "y": y,
        "si": [recipe[side].get("si", 1.0) for side in ("x", "y")],
        "attractors": json.loads(ds.attrs["attractors"]),
        "entries": ds.attrs["state_entries"].split(),
    }
    columns = {"x": ds[x].values, "y": ds[y].values, "labels": ds.attractor.values}
    return _drawn("basin", facts, where, columns)


def branch(
    ds: "xr.Dataset", *, show: str | None = None, **where: Unpack[Where]
) -> "Figure":
    """Branches against the parameter, one colour per period, with their bifurcations, and the
    bifurcation curves in two parameters, if they were traced; `show` is an observable, by default
    that of the terminal.

    >>> ds = nanotap.branch(nanotap.Case.paper(omega=3), parameter="omega", from_=3, to=2.95, progress=False)
    >>> figure = nanotap.plot.branch(ds, show="peak_force")
    """
    if show is None and (figure := _whole(ds)) is not None:
        return draw(figure, **where)
    show = show or "tip_max"
    known = [str(n) for n, v in ds.data_vars.items() if v.dims == ("point",)]
    if show not in known or ds[show].dtype.kind not in "iuf":
        message = f"show: unknown variable `{show}`; available: {', '.join(known)}"
        raise ValueError(message)
    name = ds.attrs["parameter"]
    (x_scale, x_unit), (y_scale, y_unit) = _scale(ds[name]), _scale(ds[show])
    marks: list[dict[str, Any]] = []
    if ds.sizes.get("bifurcation"):
        marks = _rows(
            kind=ds.bifurcation_kind,
            x=x_scale * ds.bifurcation_parameter,
            y=y_scale
            * ds.get(f"bifurcation_{show}", ds.bifurcation_parameter * np.nan),
        )
    x = {
        "label": _nanotap.label(name, ds.attrs["parameter_symbol"]),
        "unit": x_unit,
    }
    facts = {
        "x": x,
        "y": _axis_of(ds, show, y_unit),
        "points": _rows(
            branch=ds.branch,
            period=ds.period,
            stable=ds.stable,
            x=x_scale * ds[name],
            y=y_scale * ds[show],
        ),
        "bifurcations": marks,
        "curves": _curves(ds, name, x) if "locus_first" in ds else None,
    }
    return _drawn("branch", facts, where)


def _rows(**columns: Any) -> list[dict[str, Any]]:
    """Columns as rows, without rows that have missing numbers."""
    lists = [column.values.tolist() for column in columns.values()]
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*lists, strict=True)]
    return [row for row in rows if np.isfinite(row["x"]) and np.isfinite(row["y"])]


def _curves(ds: "xr.Dataset", name: str, x: dict[str, Any]) -> dict[str, Any]:
    parts = [
        ds.isel(locus_point=ds.locus.values == one)
        for one in np.unique(ds.locus.values)
    ]
    (x_scale, _), (y_scale, y_unit) = _scale(ds[name]), _scale(ds.locus_second)
    first, second = x_scale * ds[name].values, y_scale * ds.locus_second.values
    symbol = ds.attrs.get("second_symbol", ds.attrs["second"])
    y = {"label": _nanotap.label(ds.attrs["second"], symbol), "unit": y_unit}
    return {
        "x": x | {"range": {"fixed": [float(first.min()), float(first.max())]}},
        "y": y | {"range": {"fixed": [float(second.min()), float(second.max())]}},
        "curves": [
            {
                "kind": str(part.locus_kind.values[0]),
                "period": int(part.locus_period.values[0]),
                "x": (x_scale * part.locus_first.values).tolist(),
                "y": (y_scale * part.locus_second.values).tolist(),
            }
            for part in parts
        ],
    }


def approach(ds: "xr.Dataset", **where: Unpack[Where]) -> "Figure":
    """Amplitude, phase, dissipated energy and peak force against distance, approach and retract.

    Under frequency modulation: frequency shift, drive, dissipated energy, and the force from
    the shifts.

    >>> case = nanotap.Case.paper(omega=3)
    >>> ds = nanotap.approach(case, points=3, branches=False, progress=False)
    >>> figure = nanotap.plot.approach(ds, panels="ab")
    """
    if (figure := _whole(ds)) is not None:
        return draw(figure, **where)
    distance = ds.zc if "zc" in ds.dims else ds[ds.attrs["parameter"]]
    in_si = distance.name == "zc"
    rows = [
        ("first_harmonic", "amplitude $A$"),
        ("phase", "phase lag"),
        ("dissipation", "dissipation $E_{dis}$"),
        ("peak_force", "peak force $F_{max}$"),
    ]
    if "modulation" in ds.attrs:
        rows = [
            ("frequency_shift", "frequency shift $Δf$"),
            ("drive_ratio", "drive / free drive"),
            rows[2],
            ("sader_jarvis_force", "force (Sader–Jarvis)"),
        ]
    # With a constant least distance the amplitude grows with the distance.
    kept = "closest" in json.loads(ds.attrs.get("modulation", "{}"))
    if kept:
        rows = rows[:3]
        amplitude = ds.first_harmonic.max("way")
        distance = amplitude.assign_attrs(ds.first_harmonic.attrs)
    factor, unit = _scale(distance)
    jumps = json.loads(ds.attrs.get("jumps", "[]"))
    panels = []
    for name, label in rows:
        values = _in_electronvolts(ds[name])
        natural = None
        if name == "dissipation":
            # The work of the force over the amplitude: less is rounding.
            work = float(np.nanmax(np.abs(ds.first_harmonic * ds.peak_force)))
            natural = work / _ELECTRONVOLT if in_si else work
        scale, named = _scale(values, natural=natural or 0.0)

        def curve(
            way: str,
            values: "xr.DataArray" = values,
            scale: float = scale,
            name: str = name,
        ) -> list[list[float]]:
            points = _points(
                factor * distance.values, scale * values.sel(way=way).values
            )
            # The ends of a jump belong to the curve.
            ends = (jump[end] for jump in jumps if jump["way"] == way for end in _ENDS)
            at = (_point_of(end, name, in_si) for end in ends)
            return points + [[factor * x, scale * y] for x, y in filter(None, at)]

        def points(
            prefix: str, x: str, name: str = name, scale: float = scale, **more: Any
        ) -> Any:
            if f"{prefix}{name}" not in ds:
                return []
            y = scale * _in_electronvolts(ds[f"{prefix}{name}"])
            return _rows(
                x=factor * ds[x], y=y, **{key: ds[f"{prefix}{key}"] for key in more}
            )

        at = "coexisting_zc" if in_si else "coexisting_gap"
        panels.append(
            {
                "y": {
                    "label": label,
                    "unit": named,
                    "natural": None if natural is None else natural * scale,
                },
                "phase": name == "phase",
                "approach": curve("approach"),
                "retract": curve("retract"),
                "coexisting": [[p["x"], p["y"]] for p in points("coexisting_", at)],
                "branches": points(
                    "branch_", "branch_parameter", branch=1, period=1, stable=1
                ),
                "bifurcations": points("bifurcation_", "bifurcation_parameter", kind=1),
            }
        )
    symbol = "distance $z_c$" if in_si else "distance $α₅$"
    if kept:
        symbol = "amplitude $A$"
    ends = factor * distance.values
    facts = {
        "x": {
            "label": symbol,
            "unit": unit,
            "scale": "log" if kept else "linear",
            "range": {"fixed": [float(ends.min()), float(ends.max())]},
        },
        "panels": panels,
    }
    return _drawn("approach", facts, where)


_ELECTRONVOLT = 1.602176634e-19
_ENDS = ("before", "after")


def _in_electronvolts(values: "xr.DataArray") -> "xr.DataArray":
    """Energies of one tap are shown in electronvolts."""
    if values.attrs.get("units") != "J":
        return values
    return (values / _ELECTRONVOLT).assign_attrs(values.attrs, units="eV")


def _point_of(
    motion: Mapping[str, Any], name: str, in_si: bool
) -> tuple[float, float] | None:
    """Distance of a motion, and what it shows."""
    if not in_si:
        value = motion.get(name)
        return None if value is None else (motion["gap"], value)
    physical = (motion.get("physical") or {}) | (motion.get("modulation_si") or {})
    value = physical.get(name_in_si(name))
    if value is None:
        return None
    if name == "dissipation":
        value /= _ELECTRONVOLT
    return motion["zc"], value


def section(found: "Lyapunov", **where: Unpack[Where]) -> "Figure":
    """A Poincaré section, and the exponents with their errors.

    >>> figure = nanotap.plot.section(nanotap.lyapunov(nanotap.Case.paper(omega=3)))
    """
    return found.plot(**where)


def fit(found: "Fit", **where: Unpack[Where]) -> "Figure":
    """Measured curves, the fit through them, and the residuals.

    >>> lever = nanotap.Case(
    ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
    ...     sample={"stiffness": "5 N/m"},
    ...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
    ...     gap={"tip": "8 nm"},
    ... )
    >>> zc = [7e-9, 8e-9, 9e-9]
    >>> seen = nanotap.orbit(lever, **{"gap.tip": zc})
    >>> measured = {"zc (m)": zc, "A (m)": seen.first_harmonic, "phase": seen.phase}
    >>> found = nanotap.fit(lever, data=measured, free="sample.stiffness", progress=False)
    >>> figure = nanotap.plot.fit(found)
    """
    return found.plot(**where)


def reconstruct(found: "Reconstruction", **where: Unpack[Where]) -> "Figure":
    """Reconstructed force and dissipation against distance.

    >>> lever = nanotap.Case(
    ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
    ...     sample={"stiffness": "5 N/m"},
    ...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
    ...     gap={"tip": "8 nm"},
    ... )
    >>> zc = np.linspace(6e-9, 11e-9, 20)
    >>> seen = nanotap.orbit(lever, **{"gap.tip": zc})
    >>> measured = {"zc (m)": zc, "A (m)": seen.first_harmonic, "phase": seen.phase}
    >>> found = nanotap.reconstruct(lever, data=measured, progress=False)
    >>> figure = nanotap.plot.reconstruct(found)
    """
    return found.plot(**where)


def modes(found: "Modes", **where: Unpack[Where]) -> "Figure":
    """The mode shapes of the bare beam.

    >>> figure = nanotap.plot.modes(nanotap.modes(nanotap.Case.paper(omega=3)))
    """
    return found.plot(**where)


def convergence(found: "Convergence", **where: Unpack[Where]) -> "Figure":
    """Change of the tip deflection against the number of modes.

    >>> figure = nanotap.plot.convergence(nanotap.convergence(nanotap.Case.paper(omega=3), largest=3))
    """
    return found.plot(**where)


def scan(ds: "xr.Dataset", **where: Unpack[Where]) -> "Figure":
    """A line or an image: height, amplitude error, phase, peak force.

    >>> lever = nanotap.Case(
    ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
    ...     sample={"stiffness": "5 N/m"},
    ...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
    ...     gap={"tip": "8 nm"},
    ... )
    >>> ds = nanotap.scan(
    ...     lever, size="100 nm", periods=500, pixels=5, settle=300, setpoint=0.8, z0="8 nm",
    ...     integral_gain=1500, lock_in={"time_constant": "20 us", "order": 1}, progress=False,
    ... )
    >>> figure = nanotap.plot.scan(ds)
    """
    if (figure := _whole(ds)) is not None:
        return draw(figure, **where)
    facts: dict[str, Any] = {}
    for name, value in ds.attrs.items():
        key = "mode" if name == "scan_mode" else name
        facts[key] = _loaded(value)
    channels = [str(n) for n, v in ds.data_vars.items() if v.dims[-1:] == ("x",)]
    for way in map(str, ds.direction.values):
        rows = ds.sel(direction=way)
        facts[way] = {name: _cells(rows[name].values) for name in channels}
    listed = {
        str(name): _cells(v.values)
        for name, v in ds.variables.items()
        if v.dims == ("k",)
    }
    columns = {name.removeprefix("period_"): cells for name, cells in listed.items()}
    facts["periods"] = [
        dict(zip(columns, row, strict=True))
        for row in zip(*columns.values(), strict=True)
    ]
    return _drawn("scan", facts, where)


def fit_map(ds: "xr.Dataset", **where: Unpack[Where]) -> "Figure":
    """A map of each fitted parameter of a force volume; of one row of pixels, its values.

    >>> lever = nanotap.Case(
    ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
    ...     sample={"stiffness": "5 N/m"},
    ...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
    ...     gap={"tip": "8 nm"},
    ... )
    >>> zc = np.array([7e-9, 8e-9, 9e-9])
    >>> amplitude = nanotap.orbit(lever, **{"gap.tip": zc}).first_harmonic.values
    >>> volume = {
    ...     "x": np.repeat([0, 1], 3),
    ...     "zc (m)": np.tile(zc, 2),
    ...     "A (m)": np.tile(amplitude, 2),
    ... }
    >>> ds = nanotap.fit_map(lever, volume, ["x"], "sample.stiffness", progress=False)
    >>> figure = nanotap.plot.fit_map(ds)
    """

    def column(name: str) -> dict[str, Any]:
        units = str(ds[name].attrs.get("units", "1"))
        return {"name": name, "units": units, "values": _cells(ds[name].values.ravel())}

    names = [str(name) for name in ds.data_vars if f"{name}_error" in ds]
    dims = map(str, ds[names[0]].dims)
    facts = {"axes": list(map(column, dims)), "maps": list(map(column, names))}
    return _drawn("fit-map", facts, where)


def _loaded(value: Any) -> Any:
    """An attribute of a Dataset, which is JSON unless it is a word or a number."""
    if not isinstance(value, str):
        return np.asarray(value).tolist()
    try:
        return json.loads(value)
    except json.JSONDecodeError:
        return value


def _cells(values: Any) -> Any:
    """Values as in a document, without NaN."""
    if values.dtype.kind != "f":
        return values.tolist()
    cells = values.astype(object)
    cells[np.isnan(values)] = None
    return cells.tolist()


def show(result: Any, **options: Any) -> "Figure":
    """The figure of any result.

    >>> figure = nanotap.plot.show(nanotap.orbit(nanotap.Case.paper(omega=3)))
    """
    if isinstance(result, Answered):
        return result.plot(**options)
    draw_it: Callable[..., Figure]
    if "figure" in getattr(result, "attrs", ()):
        return draw(result.attrs["figure"], **options)
    for name, draw_it in _FIGURES_BY_VARIABLE.items():
        if name in getattr(result, "variables", ()):
            return draw_it(result, **options)
    if (figure := _whole(result)) is not None:
        return draw(figure, **options)
    message = f"there is no figure for a {type(result).__name__}"
    raise TypeError(message)


# The first of these that a Dataset has determines its type.
_FIGURES_BY_VARIABLE: dict[str, Callable[..., "Figure"]] = {
    "branch": branch,
    "attractor": basin,
    "period_max": sweep,
    "way": approach,
    "surface": scan,
    "chi2_reduced": fit_map,
    "tau": run,
    "failure": orbits,
}
