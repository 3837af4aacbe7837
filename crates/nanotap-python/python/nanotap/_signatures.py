"""The function of every study. Written by signatures.py; do not edit by hand."""
# ruff: noqa
# fmt: off

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, overload

from . import _datasets, _motions, _studies
from ._arguments import Box, Progress, Varied
from ._case import Case, Path, Value
from ._record import Record
from ._results import Attractors, Convergence, Fit, Lyapunov, Modes, Orbit, Reconstruction

if TYPE_CHECKING:
    import xarray as xr
    from distributed import Client

__all__ = [
    "approach",
    "attractors",
    "basin",
    "branch",
    "contact_laws",
    "convergence",
    "fit",
    "lyapunov",
    "modes",
    "orbit",
    "reconstruct",
    "simulate",
    "sweep",
    "window",
]

def modes(
    case: Case,
    *,
    points: int = 201,
) -> Modes:
    """Mode shapes and frequencies, in free flight and in contact.

    Parameters
    ----------
    case : Case
        What is studied.
    points : int
        Points along the beam in the table of mode shapes (2 to 1000000).

    Returns
    -------
    Frequencies of the Galerkin model (`free`, `contact`) and of the beam itself
    (`exact_free`, `exact_contact`); `shapes`, the mode shapes along the beam.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "points": points,
    }
    return _motions.modes(case, options)

def simulate(
    case: Case,
    *,
    periods: int = 50,
    transient: int | None = None,
    state: Any = None,
    strobe: int = 1,
    events: int = 50_000,
    max_period: int = 64,
    observables: Sequence[str] | None = None,
    resolution: int = 200,
    method: Literal["exact", "rk4"] = "exact",
    steps: int | Sequence[int] = 200,
    switching: Literal["step", "stage"] = "step",
    series: int | None = None,
    threads: int | None = None,
    progress: Progress = None,
    **parameters: Varied,
) -> "xr.Dataset":
    """One run: its steady state, or how it gets there.

    Parameters
    ----------
    case : Case
        What is studied.
    periods : int
        Drive periods recorded (1 to 2000000).
    transient : int | None
        Drive periods discarded first; without it, as many as the motion is measured
        to need; 0: from the start (0 to 100000000).
    state : Any
        State at the start, drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v);
        without it, rest.
    strobe : int
        How many of the last states at drive phase 0 to keep (0 to 1000000).
    events : int
        How many contacts and releases to list at most, the first ones (0 to
        1000000).
    max_period : int
        Longest period looked for (1 to 10000).
    observables : Sequence[str] | None
        Observables to measure; without it, every one that there is, the beam's
        clearance included.
    resolution : int
        Samples a drive period in the time series (1 to 1000000).
    method : Literal["exact", "rk4"]
        How the motion is computed; `exact`: The exact flow: no time step, no
        contact missed; `rk4`: The paper's method, to compare: Runge–Kutta steps
        that switch on their grid.
    steps : int | Sequence[int]
        Of rk4: steps a drive period, in free flight and (after a comma) in contact
        (1 to 10000000).
    switching : Literal["step", "stage"]
        Of rk4: where within a step the regime is looked at; `step`: Once a step;
        `stage`: At every stage of a step.
    series : int | None
        Periods of the time series, from the start of the recording; without it, all
        up to 100.
    threads : int | None
        Of arrays: threads; without it, one a core.
    progress : Progress
        Of arrays: as everywhere, a bar or a function.
    **parameters : Varied
        Keys of the case to change. Arrays (one-dimensional, or xarray's DataArrays)
        make a Dataset over them, each a dimension.

    Returns
    -------
    What was observed, by the names of the terminal's JSON: `classification`,
    `period`, `tip_max` …; `strobe` over `strobe_period` and `state`; `events`
    (their times) with `event_kind`; and the time series `tip`, `gap`, `force` …
    over `tau`. Over arrays, what is a number in each run, and `failure` where there
    is none.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "periods": periods,
        "transient": transient,
        "state": state,
        "strobe": strobe,
        "events": events,
        "max_period": max_period,
        "observables": observables,
        "resolution": resolution,
        "method": method,
        "steps": steps,
        "switching": switching,
    }
    return _motions.simulate(case, options, series, threads, progress, parameters)

@overload
def orbit(  # type: ignore[overload-overlap]
    case: Case,
    *,
    period: int | None = None,
    state: Any = None,
    harmonics: int = 20,
    observables: Sequence[str] | None = None,
    resolution: int = 200,
    derivatives: Sequence[str] | None = None,
    prove: bool = False,
    threads: int | None = None,
    progress: Progress = None,
    **parameters: Value,
) -> Orbit: ...
@overload
def orbit(
    case: Case,
    *,
    period: int | None = None,
    state: Any = None,
    harmonics: int = 20,
    observables: Sequence[str] | None = None,
    resolution: int = 200,
    derivatives: Sequence[str] | None = None,
    prove: bool = False,
    threads: int | None = None,
    progress: Progress = None,
    **parameters: Varied,
) -> "xr.Dataset": ...
def orbit(
    case: Case,
    *,
    period: int | None = None,
    state: Any = None,
    harmonics: int = 20,
    observables: Sequence[str] | None = None,
    resolution: int = 200,
    derivatives: Sequence[str] | None = None,
    prove: bool = False,
    threads: int | None = None,
    progress: Progress = None,
    **parameters: Varied,
) -> "Orbit | xr.Dataset":
    """A periodic orbit by Newton, stable or not.

    Parameters
    ----------
    case : Case
        What is studied.
    period : int | None
        Its period in drive periods; without it, that of the motion to which a run
        converges (1 to 10000).
    state : Any
        State to look near, at drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v).
    harmonics : int
        Harmonics of the drive frequency to report (0 to 100000).
    observables : Sequence[str] | None
        Observables to measure; without it, every one that there is, the beam's
        clearance included.
    resolution : int
        Samples a drive period in the time series (1 to 1000000).
    derivatives : Sequence[str] | None
        Keys of the case by which to differentiate the orbit and all that is
        observed of it; what stays is what stays in a sweep.
    prove : bool
        Prove in interval arithmetic that it exists, is alone, and is stable or not.
    threads : int | None
        Of arrays: threads; without it, one a core.
    progress : Progress
        Of arrays: as everywhere, a bar or a function.
    **parameters : Varied
        Keys of the case to change. Arrays (one-dimensional, or xarray's DataArrays)
        make a Dataset over them, each a dimension.

    Returns
    -------
    The orbit, or over arrays a Dataset of what is observed of each, with `failure`
    where there is none.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "period": period,
        "state": state,
        "harmonics": harmonics,
        "observables": observables,
        "resolution": resolution,
        "derivatives": derivatives,
        "prove": prove,
    }
    return _motions.orbit(case, options, threads, progress, parameters)

def attractors(
    case: Case,
    *,
    starts: int | None = None,
    unseen: float | None = None,
    seed: int = 1,
    box: Box = None,
    max_period: int = 64,
    unstable: int = 0,
    prove: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> Attractors:
    """Every motion that coexists: a census from many seeded starts.

    Parameters
    ----------
    case : Case
        What is studied.
    starts : int | None
        Starts, spread evenly over one box of states. Without it, starts of every
        size, from the resonant response down to below the gap, go on until the
        share of starts that may lead to motions not found is below `unseen`, or
        5000 starts or 2,000,000 drive periods (600,000 under a nonlinear law) are
        done (1 to 1000000).
    unseen : float | None
        Share of starts that may lead to motions not found, with 95 % confidence, at
        which no more are drawn. Without it, 0.01 under a nonlinear law and 0.002
        under a piecewise-linear one; a smaller one raises the limits of `starts`
        and drive periods in proportion.
    seed : int
        Seed of the starts: the same seed gives the same answer on any number of
        threads.
    box : Box
        Sides of one box of starts, as in a1=-1:1 or v2=-4:4; the others are derived
        from the linear response to the drive. 256 starts if `starts` says no
        number.
    max_period : int
        Longest period looked for (1 to 10000).
    unstable : int
        Also list unstable orbits up to this period (0 to 10000).
    prove : bool
        Prove in interval arithmetic that each orbit exists, is alone, and is stable
        or not.
    threads : int | None
        Threads; without it, one a core.
    progress : Progress
        Whether to show a bar, or a function that is called with what is done and
        the total.

    Returns
    -------
    The attractors, most frequent first.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "starts": starts,
        "unseen": unseen,
        "seed": seed,
        "box": box,
        "max_period": max_period,
        "unstable": unstable,
        "prove": prove,
    }
    return _studies.attractors(case, options, threads, progress)

def branch(
    case: Case,
    *,
    parameter: str,
    from_: float | str,
    to: float | str,
    period: int | None = None,
    state: Any = None,
    switch: int | None = None,
    diagram: bool = False,
    values: int = 65,
    starts: int = 16,
    seed: int = 1,
    second: Mapping[str, tuple[float | str, float | str]] | str | None = None,
    max_step: float = 0.01,
    threads: int | None = None,
    progress: Progress = None,
) -> "xr.Dataset":
    """Periodic orbits followed in a parameter, stable and unstable, with their
    bifurcations.

    Parameters
    ----------
    case : Case
        What is studied.
    parameter : str
        The parameter, as the case file calls it (omega, alpha4, gap …); of a
        physical case also a quantity of it (drive.frequency, gap.tip,
        sample.stiffness …).
    from_ : float | str
        Its value at the start; of a physical case also with a unit, as in "70 kHz".
    to : float | str
        The other end of its range.
    period : int | None
        Period of the orbit at the start; without it, that of the motion to which a
        run converges (1 to 10000).
    state : Any
        State near which the orbit at the start is looked for: a1,…,aN,v1,…,vN.
    switch : int | None
        Also follow the doubled branches at flips, so many doublings deep (0 to 12).
    diagram : bool
        Assemble the whole picture: every stable orbit of a census at several
        values, followed both ways and through two doublings (or as `switch` says).
    values : int
        Of the `diagram`: values of the parameter at which a census is taken (2 to
        10000).
    starts : int
        Of the `diagram`: starts at each (1 to 100000).
    seed : int
        Of the `diagram`: seed of the starts.
    second : Mapping[str, tuple[float | str, float | str]] | str | None
        A second parameter and its range, as in alpha4=5:40: the bifurcation curves
        are traced in both.
    max_step : float
        Longest step, as a part of the range.
    threads : int | None
        Threads; without it, one a core.
    progress : Progress
        Whether to show a bar, or a function that is called with what is done and
        the total.

    Returns
    -------
    The orbits over `point` (`branch`, the parameter by its name, `stable`,
    `tip_max`, `states` …) and the bifurcations over `bifurcation`
    (`bifurcation_kind`, `bifurcation_parameter`, `bifurcation_states` …); curves in
    two parameters over `locus_point`. The attributes say of each branch why it
    ends, and what could not be followed.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "parameter": parameter,
        "from": from_,
        "to": to,
        "period": period,
        "state": state,
        "switch": switch,
        "diagram": diagram,
        "values": values,
        "starts": starts,
        "seed": seed,
        "second": second,
        "max_step": max_step,
    }
    return _studies.branch(case, options, threads, progress)

def approach(
    case: Case,
    *,
    from_: float | str | None = None,
    to: float | str | None = None,
    points: int = 80,
    branches: bool = True,
    switch: int = 1,
    max_period: int = 32,
    speed: float | str | None = None,
    fm: bool = False,
    phase: float = 90.0,
    shift: float | str | None = None,
    closest: float | str | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> "xr.Dataset":
    """Amplitude, phase, force and energy against the distance to the sample, both ways,
    with the branches that coexist.

    Parameters
    ----------
    case : Case
        What is studied.
    from_ : float | str | None
        Distance at which to begin, in units of the case ("30 nm") or as alpha5;
        without it, 1.25 times what the free tip swings towards the sample.
    to : float | str | None
        Distance at which to turn back; without it, 0.
    points : int
        Distances each way (2 to 20000).
    branches : bool
        Also continue the branches that coexist, stable and unstable.
    switch : int
        Doublings of branches to follow, as far as their orbits are stable (0 to
        12).
    max_period : int
        Longest period looked for (1 to 10000).
    speed : float | str | None
        Speed of the approach and of the retraction, in units of the case ("500
        nm/s") or as alpha5 a unit of time: the distance changes each drive period
        and the lever does not settle; without it, both are so slow that it always
        does.
    fm : bool
        Frequency modulation: hold amplitude (the case's free amplitude) and phase
        by frequency and strength of the drive, and tell the frequency shift.
    phase : float
        Phase behind the drive that frequency modulation holds, in degrees.
    shift : float | str | None
        Frequency shift of frequency modulation whose distances are to be found, in
        units of the case ("-50 Hz") or as omega.
    closest : float | str | None
        Least distance of the oscillation that frequency modulation keeps, in units
        of the case ("1 nm") or as alpha5: the amplitude then changes with the
        distance.
    threads : int | None
        Threads; without it, one a core.
    progress : Progress
        Whether to show a bar, or a function that is called with what is done and
        the total.

    Returns
    -------
    What is observed over `way` (approach, retract) and the distance (by the name of
    its parameter, with `zc` in metres for a physical case): `first_harmonic`,
    `phase`, `peak_force`, `dissipation` … and in SI `physical_A`, `physical_F_max`,
    `physical_E_dis` …; the branches over `branch_point`; where the lever jumps in
    the attribute `jumps`. With `fm=True` also `relative_shift`, `drive_ratio`,
    `sader_jarvis_force` … and in SI `physical_frequency_shift` …, with what is held
    in the attribute `modulation`.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "from": from_,
        "to": to,
        "points": points,
        "branches": branches,
        "switch": switch,
        "max_period": max_period,
        "speed": speed,
        "fm": fm,
        "phase": phase,
        "shift": shift,
        "closest": closest,
    }
    return _studies.approach(case, options, threads, progress)

def fit(
    case: Case,
    *,
    data: Any = None,
    free: Sequence[str] | None = None,
    per_curve: Sequence[str] | None = None,
    bounds: Mapping[str, tuple[float | str, float | str]] | str | None = None,
    columns: Sequence[str] | None = None,
    laws: Sequence[str] | None = None,
    starts: int = 8,
    seed: int = 0,
    max_period: int = 4,
    jumps: bool = True,
    phase: float = 90.0,
    profile: bool = True,
    threads: int | None = None,
    progress: Progress = None,
) -> Fit:
    """Parameters of lever and sample from measured curves.

    Parameters
    ----------
    case : Case
        What is studied.
    data : Any
        Measured curves: tables whose columns are named as in `distance (nm)`,
        `amplitude (nm)`, `phase (deg)`.
    free : Sequence[str] | None
        Parameters to find: keys of the case, gap.offset, and NAME.offset or
        NAME.scale of a column.
    per_curve : Sequence[str] | None
        Parameters to find, one value a curve.
    bounds : Mapping[str, tuple[float | str, float | str]] | str | None
        Bounds of parameters, as in sample.stiffness="1 N/m:100 N/m".
    columns : Sequence[str] | None
        Columns of the data that count; without it, all.
    laws : Sequence[str] | None
        Contact laws to compare, as in hertz,dmt; without it, the case's own.
    starts : int
        Starts to try as long as nothing describes the data (1 to 1000).
    seed : int
        Seed of the further starts.
    max_period : int
        Longest period of the orbits looked for (1 to 64).
    jumps : bool
        The place at which the data jump from a branch that ends in a fold counts
        too.
    phase : float
        Phase behind the drive that the loop held, in degrees, of curves of a
        frequency shift.
    profile : bool
        Intervals by the profile of the likelihood.
    threads : int | None
        Threads; without it, one a core.
    progress : Progress
        Whether to show a bar, or a function that is called with what is done and
        the total.

    Returns
    -------
    `parameters` (key, value, standard_error, interval, unit), `chi2`,
    `undetermined`, `correlations`, the `rows` with model and residuals; `best` and
    `errors` by key, and `best_case()`, the case of the best fit.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "data": data,
        "free": free,
        "per_curve": per_curve,
        "bounds": bounds,
        "columns": columns,
        "laws": laws,
        "starts": starts,
        "seed": seed,
        "max_period": max_period,
        "jumps": jumps,
        "phase": phase,
        "profile": profile,
    }
    return _studies.fit(case, options, threads, progress)

def reconstruct(
    case: Case,
    *,
    data: Any = None,
    columns: Sequence[str] | None = None,
    convert: Sequence[str] | None = None,
    free_amplitude: float | str | None = None,
    free_phase: float | None = None,
    amplitude_error: float | str | None = None,
    phase_error: float | None = None,
    phase: float = 90.0,
    rows: int = 240,
    threads: int | None = None,
    progress: Progress = None,
) -> Reconstruction:
    """Force and dissipation against distance from a measured curve.

    Parameters
    ----------
    case : Case
        What is studied.
    data : Any
        Measured curves: tables whose columns are named as in `distance (nm)`,
        `amplitude (nm)`, `phase (deg)`, or `frequency_shift (Hz)`.
    columns : Sequence[str] | None
        Columns of the data that count; without it, all.
    convert : Sequence[str] | None
        Conversions of columns, as in Amp="58 nm/V", Phase=90-x, Zsnsr=-x or
        Ch3=amplitude.
    free_amplitude : float | str | None
        Free amplitude, as in "20 nm"; without it, that of the rows far from the
        sample.
    free_phase : float | None
        Free phase as measured, degrees; without it, that of the rows far from the
        sample.
    amplitude_error : float | str | None
        Standard error of an amplitude, as in "0.02 nm"; without it, from the
        scatter of the rows.
    phase_error : float | None
        Standard error of a phase, degrees; without it, from the scatter of the
        rows.
    phase : float
        Phase that was held under frequency modulation, degrees.
    rows : int
        Longer curves are averaged to about this many rows (20 to 2000).
    threads : int | None
        Threads; without it, one a core.
    progress : Progress
        Whether to show a bar, or a function that is called with what is done and
        the total.

    Returns
    -------
    `table` (distance, force, force_error, dissipation, dissipation_error, damping,
    damping_error), `minimum`, `closest`, the `rows`; `curve()`, the table as a
    DataFrame, and `law_table()`, the text for `sample.table`.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "data": data,
        "columns": columns,
        "convert": convert,
        "free_amplitude": free_amplitude,
        "free_phase": free_phase,
        "amplitude_error": amplitude_error,
        "phase_error": phase_error,
        "phase": phase,
        "rows": rows,
    }
    return _studies.reconstruct(case, options, threads, progress)

def sweep(
    case: Case,
    *,
    over: str | Sequence[str] | Mapping[str, Any],
    starts: int | None = None,
    seed: int = 1,
    box: Box = None,
    state: Any = None,
    follow: Literal["off", "up", "down", "both"] = "off",
    periods: int = 100,
    strobe: int | None = None,
    transient: int | None = None,
    max_period: int = 64,
    out: Path | None = None,
    chunk: str = "1/1",
    threads: int | None = None,
    client: "Client | None" = None,
    progress: Progress = None,
) -> "xr.Dataset":
    """How the motion changes with one or two parameters, from any number of starts.

    Parameters
    ----------
    case : Case
        What is studied.
    over : str | Sequence[str] | Mapping[str, Any]
        A parameter and its values, as in omega=2:4:400 (first, last, how many), or
        alpha4=1:1000:50:log in equal ratios, or any that ascend, omega=2,2.5,4;
        modes too; of a physical case also drive.frequency=60kHz:80kHz:200; once or
        twice.
    starts : int | None
        Quasi-random starts at each value, spread over a box of states; without it,
        one start from rest (1 to 1000000).
    seed : int
        Seed of the starts.
    box : Box
        Sides of the box, as in a1=-1:1 or v2=-4:4; the others are derived from the
        linear response to the drive.
    state : Any
        Start from this state at drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v).
    follow : Literal["off", "up", "down", "both"]
        Start each value from the last state of the one before, along the first
        parameter: up, down or both. A whole line is then one piece of work, lost
        when interrupted; `off`: Every value starts anew.; `up`: From the least
        value to the greatest.; `down`: From the greatest value to the least.;
        `both`: Both..
    periods : int
        Drive periods recorded (1 to 100000000).
    strobe : int | None
        States kept, at the end of each of the last periods; without it, of every
        recorded one (0 to 100000000).
    transient : int | None
        Drive periods discarded first; without it, as many as the motion is measured
        to need (0 to 100000000).
    max_period : int
        Longest period looked for (1 to 10000).
    out : Path | None
        The dataset, a folder ending in .zarr; where it is there already, the work
        goes on where it stopped. Without it, everything is in memory.
    chunk : str
        One of n shares only, as in "2/8"; `merge` puts the shares together.
    threads : int | None
        Threads; without it, one a core.
    client : "Client | None"
        A Dask client, on whose workers the chunks are computed: the same bytes.
    progress : Progress
        Whether to show a bar, or a function that is called with what is done and
        the total.

    Returns
    -------
    The dataset, as `open` opens it: lazily from `out`. After Ctrl-C, the `result`
    of the exception is the dataset with what is finished, and the same call goes on
    in `out`.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "over": over,
        "starts": starts,
        "seed": seed,
        "box": box,
        "state": state,
        "follow": follow,
        "periods": periods,
        "strobe": strobe,
        "transient": transient,
        "max_period": max_period,
    }
    return _datasets.sweep(case, options, out, chunk, threads, client, progress)

def window(
    case: Case,
    *,
    over: str | Sequence[str] | Mapping[str, Any],
    starts: int = 16,
    seed: int = 1,
    max_period: int = 32,
    out: Path | None = None,
    threads: int | None = None,
    client: "Client | None" = None,
    progress: Progress = None,
) -> "xr.Dataset":
    """The operating window over two parameters: where there is only one motion, and where
    a second state, subharmonics or chaos threaten.

    Parameters
    ----------
    case : Case
        What is studied.
    over : str | Sequence[str] | Mapping[str, Any]
        A parameter and its values, as in gap.tip=5nm:25nm:41,
        drive.free_amplitude=10nm:60nm:26, omega=2:4:81, or any that ascend,
        omega=2,2.5,4; twice, the first is the horizontal axis.
    starts : int
        Starts of the census at each point: rest, the linear responses, and draws of
        every size (1 to 1000000).
    seed : int
        Seed of the starts.
    max_period : int
        Longest period looked for (1 to 10000).
    out : Path | None
        The dataset, a folder ending in .zarr; where it is there already, the work
        goes on where it stopped. Without it, everything is in memory.
    threads : int | None
        Threads; without it, one a core.
    client : "Client | None"
        A Dask client, on whose workers the chunks are computed: the same bytes.
    progress : Progress
        Whether to show a bar, or a function that is called with what is done and
        the total.

    Returns
    -------
    The sweep with `condition` over both parameters: no-contact, one-period-1,
    second-state, subharmonic, irregular or undecided; `share` says how much of each
    there is.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "over": over,
        "starts": starts,
        "seed": seed,
        "max_period": max_period,
    }
    return _datasets.window(case, options, out, threads, client, progress)

def basin(
    case: Case,
    *,
    x: str | Mapping[str, Any],
    y: str | Mapping[str, Any],
    state: Any = None,
    attractors: Iterable[Any] | None = None,
    starts: int = 64,
    seed: int = 1,
    periods: int = 1000,
    max_period: int = 64,
    out: Path | None = None,
    chunk: str = "1/1",
    threads: int | None = None,
    client: "Client | None" = None,
    progress: Progress = None,
) -> "xr.Dataset":
    """Basins of attraction on a two-dimensional slice of initial states.

    Parameters
    ----------
    case : Case
        What is studied.
    x : str | Mapping[str, Any]
        The horizontal axis, as in a1=-1:1:200: entry of the state, first value,
        last value, how many (a1…aN, v1…vN; oscillator: x, v).
    y : str | Mapping[str, Any]
        The vertical axis.
    state : Any
        The other entries of the state, in full: a1,…,aN,v1,…,vN; without it, 0.
    attractors : Iterable[Any] | None
        States on the attractors, or what a census found; without it, a census in
        the slice finds them.
    starts : int
        Starts of the census (1 to 1000000).
    seed : int
        Seed of the census.
    periods : int
        Drive periods after which a point is called unsettled (1 to 100000000).
    max_period : int
        Longest period looked for (1 to 10000).
    out : Path | None
        The dataset, a folder ending in .zarr; where it is there already, the work
        goes on where it stopped. Without it, everything is in memory.
    chunk : str
        One of n shares only, as in "2/8"; `merge` puts the shares together.
    threads : int | None
        Threads; without it, one a core.
    client : "Client | None"
        A Dask client, on whose workers the chunks are computed: the same bytes.
    progress : Progress
        Whether to show a bar, or a function that is called with what is done and
        the total.

    Returns
    -------
    `attractor` over the two entries of the state: an index into the attractors of
    the attribute `attractors` (JSON), negative where there is none.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "x": x,
        "y": y,
        "state": state,
        "attractors": attractors,
        "starts": starts,
        "seed": seed,
        "periods": periods,
        "max_period": max_period,
    }
    return _datasets.basin(case, options, out, chunk, threads, client, progress)

def lyapunov(
    case: Case,
    *,
    periods: int = 20_000,
    transient: int = 1000,
    state: Any = None,
    section: Literal["phase", "contact"] = "phase",
    phase: float = 0.0,
    points: int = 5000,
) -> Lyapunov:
    """Lyapunov spectrum with error bars, and a Poincaré section.

    Parameters
    ----------
    case : Case
        What is studied.
    periods : int
        Drive periods averaged over (1 to 100000000).
    transient : int
        Drive periods discarded first (0 to 100000000).
    state : Any
        State at the start, drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v);
        without it, rest.
    section : Literal["phase", "contact"]
        Where the section is taken; `phase`: Once a drive period, at one phase;
        `contact`: At the beginning of every contact.
    phase : float
        Drive phase of the section in degrees.
    points : int
        Points of the section (0 to 2000000).

    Returns
    -------
    Exponents with their errors, and the points of the section.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "periods": periods,
        "transient": transient,
        "state": state,
        "section": section,
        "phase": phase,
        "points": points,
    }
    return _studies.lyapunov(case, options)

def convergence(
    case: Case,
    *,
    largest: int = 10,
    tolerance: float = 0.01,
    period: int | None = None,
) -> Convergence:
    """The same motion with N = 1 … K modes: how many are enough.

    Parameters
    ----------
    case : Case
        What is studied.
    largest : int
        Largest number of modes (2 to 50).
    tolerance : float
        Difference of the tip deflection, as a part of the amplitude, that is small
        enough.
    period : int | None
        Period of the orbit to compare; without it, the motion to which a run from
        rest converges (1 to 10000).

    Returns
    -------
    The motion with each number of modes, and a verdict.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "largest": largest,
        "tolerance": tolerance,
        "period": period,
    }
    return _studies.convergence(case, options)

def contact_laws(
    case: Case,
    *,
    period: int = 1,
    arm: float | None = None,
    from_: float | str | None = None,
    to: float | str | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Record:
    """The same lever and drive on every contact law: what difference the sample makes.

    Parameters
    ----------
    case : Case
        What is studied.
    period : int
        Period of the orbits compared (1 to 10000).
    arm : float | None
        Stiffness of the standard linear solid's arm; without it, the case's, or
        twice alpha4.
    from_ : float | str | None
        Lowest drive frequency to which the orbits are followed.
    to : float | str | None
        Highest drive frequency to which the orbits are followed.
    threads : int | None
        Threads; without it, one a core.
    progress : Progress
        Whether to show a bar, or a function that is called with what is done and
        the total.

    Returns
    -------
    What the terminal's JSON has, by its names.

    Raises
    ------
    ValueError
        Something that was asked for is not right.
    RuntimeError
        The computation did not succeed.
    """
    options = {
        "period": period,
        "arm": arm,
        "from": from_,
        "to": to,
    }
    return _studies.document("contact-laws", case, options, threads, progress)
