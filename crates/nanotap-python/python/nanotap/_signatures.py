"""The function of every study. Written by signatures.py; do not edit by hand."""
# ruff: noqa
# fmt: off

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, overload

from . import _arguments, _datasets, _motions, _studies
from ._arguments import Box, Progress, Varied
from ._case import Case, Path, Value
from ._report import Report
from ._results import Attractors, Convergence, Fit, Lyapunov, Modes, Orbit, Reconstruction

if TYPE_CHECKING:
    from distributed import Client

    from ._study_dataset import StudyDataset

__all__ = [
    "approach",
    "attractors",
    "basin",
    "bimodal",
    "branch",
    "contact_laws",
    "convergence",
    "fit",
    "fm",
    "force_curve",
    "image_states",
    "lever",
    "lyapunov",
    "modes",
    "noise",
    "orbit",
    "reconstruct",
    "scan",
    "simulate",
    "sweep",
    "window",
]

def modes(
    case: Case,
    *,
    points: int = 201,
) -> Modes:
    """Compute mode shapes and frequencies, in free flight and in contact.

    Parameters
    ----------
    case : Case
        The case.
    points : int
        Points along the beam in the table of mode shapes (2 to 1000000).

    Returns
    -------
    Frequencies of the Galerkin model (`free`, `contact`) and of the beam itself
    (`exact_free`, `exact_contact`); `shapes`, the mode shapes along the beam.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> nanotap.modes(case).free.round(3).tolist()
    [2.968, 19.385, 56.011]
    """
    options = _arguments.options("modes", locals())
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
    drive_signal: str | Path | Mapping[str, Any] | None = None,
    series: int | None = None,
    threads: int | None = None,
    progress: Progress = None,
    **parameters: Varied,
) -> "StudyDataset":
    """Simulate a motion: its steady state or its transient.

    Parameters
    ----------
    case : Case
        The case.
    periods : int
        Number of recorded drive periods (1 to 2000000).
    transient : int | None
        Drive periods of the discarded transient; default: until the motion has
        settled; 0: none (0 to 100000000).
    state : Any
        Initial state at drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v), or some
        by name, as in tip=5nm; of a physical case in m and m/s, or with units;
        default: rest.
    strobe : int
        Number of last states at drive phase 0 to keep (0 to 1000000).
    events : int
        Maximum number of listed contacts and releases (0 to 1000000).
    max_period : int
        Longest period of orbits, in drive periods (1 to 10000).
    observables : Sequence[str] | None
        Observables to measure; default: all, including the clearance of the beam.
    resolution : int
        Samples per drive period in the time series (1 to 1000000).
    method : Literal["exact", "rk4"]
        Method of computation; `exact`: The exact flow: no time step, no contact
        missed; `rk4`: The paper's method, to compare: Runge–Kutta steps that switch
        on their grid.
    steps : int | Sequence[int]
        For rk4: steps per drive period, in free flight and (after a comma) in
        contact (1 to 10000000).
    switching : Literal["step", "stage"]
        For rk4: where within a step the regime is checked; `step`: Once a step;
        `stage`: At every stage of a step.
    drive_signal : str | Path | Mapping[str, Any] | None
        Signal of one shot in place of the periodic drive: "pulse 5us", "chirp 60kHz
        90kHz 5ms", "sinc 200kHz 1ms times 40", or a file with the columns time and
        drive; its 1 is the case's drive. Then `periods` counts those after its end.
    series : int | None
        Number of periods of the time series, from the start of the recording;
        default: all, up to 100.
    threads : int | None
        Number of threads for arrays; default: one per core.
    progress : Progress
        Progress of arrays: whether to show a bar, or a function as in other
        studies.
    **parameters : Varied
        Keys of the case to change. Arrays (one-dimensional, or xarray DataArrays)
        give a Dataset with one dimension per array.

    Returns
    -------
    The observables, with the names of the terminal's JSON: `classification`,
    `period`, `tip_max` …; `strobe` over `strobe_period` and `state`; `events`
    (their times) with `event_kind`; and the time series `tip`, `gap`, `force` …
    over `tau`. Over arrays, the numeric observables of each run, and `failure` for
    a run that failed.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> run = nanotap.simulate(case, periods=4)
    >>> run.classification.item(), run.tip.dims
    ('periodic', ('tau',))
    """
    options = _arguments.options("simulate", locals())
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
    upset: bool = False,
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
    upset: bool = False,
    prove: bool = False,
    threads: int | None = None,
    progress: Progress = None,
    **parameters: Varied,
) -> "StudyDataset": ...
def orbit(
    case: Case,
    *,
    period: int | None = None,
    state: Any = None,
    harmonics: int = 20,
    observables: Sequence[str] | None = None,
    resolution: int = 200,
    derivatives: Sequence[str] | None = None,
    upset: bool = False,
    prove: bool = False,
    threads: int | None = None,
    progress: Progress = None,
    **parameters: Varied,
) -> "Orbit | StudyDataset":
    """Compute a periodic orbit by Newton's method, stable or not.

    Parameters
    ----------
    case : Case
        The case.
    period : int | None
        Period in drive periods; default: that of the motion to which a run
        converges (1 to 10000).
    state : Any
        State near the orbit, at drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v),
        or some by name, as in tip=5nm; of a physical case in m and m/s, or with
        units.
    harmonics : int
        Number of reported harmonics of the drive frequency (0 to 100000).
    observables : Sequence[str] | None
        Observables to measure; default: all, including the clearance of the beam.
    resolution : int
        Samples per drive period in the time series (1 to 1000000).
    derivatives : Sequence[str] | None
        Keys of the case for derivatives of the orbit and its observables; the same
        quantities stay constant as in a sweep.
    upset : bool
        Look for the smallest knock on the tip after which the lever goes to another
        motion.
    prove : bool
        Prove existence, local uniqueness and stability by interval arithmetic.
    threads : int | None
        Number of threads for arrays; default: one per core.
    progress : Progress
        Progress of arrays: whether to show a bar, or a function as in other
        studies.
    **parameters : Varied
        Keys of the case to change. Arrays (one-dimensional, or xarray DataArrays)
        give a Dataset with one dimension per array.

    Returns
    -------
    The orbit; over arrays, a Dataset of the observables of each, with `failure`
    where there is none.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> nanotap.orbit(case)
    Orbit(period=1, stable, largest multiplier 0.868606, W from 0.0225061 to 0.127375)
    >>> nanotap.orbit(case, omega=[2.9, 3.0]).stable.values
    array([ True,  True])
    """
    options = _arguments.options("orbit", locals())
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
    check: int = 0,
    prove: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> Attractors:
    """Find coexisting attractors by sampling initial states.

    Parameters
    ----------
    case : Case
        The case.
    starts : int | None
        Number of initial states, spread evenly over one box. Default: initial
        states at all amplitudes, from the resonant response down to below the gap,
        until the share that may lead to undiscovered motions is below `unseen`, or
        5000 initial states or 2,000,000 drive periods (600,000 under a nonlinear
        law) are reached. Under a nonlinear law an initial state is followed for at
        most 4 million steps of the approximate flow, and all together for 30
        million, or 60 where chaos is watched; two evaluations of the force in the
        exact flow count as a step (1 to 1000000).
    unseen : float | None
        Share of initial states that may lead to undiscovered motions, with 95 %
        confidence, at which sampling ends. Default: 0.01 under a nonlinear law and
        0.002 under a piecewise-linear one; a smaller value raises the limits of
        `starts`, drive periods and steps in proportion.
    seed : int
        Seed of the initial states; results do not depend on the number of threads.
    box : Box
        Sides of one box of initial states, as in {"a1": (-1, 1)} or {"v2": (-4,
        4)}; other sides follow from the linear response to the drive. 256 initial
        states unless `starts` is given.
    max_period : int
        Longest period of orbits, in drive periods (1 to 10000).
    unstable : int
        Also list unstable orbits up to this period (0 to 10000).
    check : int
        Follow this many of the initial states, chosen at random, again on the exact
        flow, and report those that go to another motion (0 to 1000000).
    prove : bool
        Prove existence, local uniqueness and stability of each orbit by interval
        arithmetic.
    threads : int | None
        Number of threads; default: one per core.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    The attractors, most frequent first.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> found = nanotap.attractors(case, starts=20, box={"a1": (-1, 1)}, progress=False)
    >>> [one.name for one in found]
    ['period 1']
    """
    options = _arguments.options("attractors", locals())
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
    event: Sequence[str] | None = None,
    max_step: float = 0.01,
    threads: int | None = None,
    progress: Progress = None,
) -> "StudyDataset":
    """Periodic orbits followed in a parameter, stable and unstable, with their
    bifurcations.

    Parameters
    ----------
    case : Case
        The case.
    parameter : str
        Parameter, by its name in the case file (omega, alpha4, gap …); for a
        physical case also a quantity (drive.frequency, gap.tip, sample.stiffness
        …).
    from_ : float | str
        Value of the parameter at the start; for a physical case also with a unit,
        as in "70 kHz".
    to : float | str
        Value of the parameter at the other end of the range.
    period : int | None
        Period of the orbit at the start; default: that of the motion to which a run
        converges (1 to 10000).
    state : Any
        State near the orbit at the start: a1,…,aN,v1,…,vN, or some by name, as in
        tip=5nm; of a physical case in m and m/s, or with units.
    switch : int | None
        Also follow doubled branches at flips, up to this number of doublings (0 to
        12).
    diagram : bool
        Find the branches of all attractors: stable orbits from a census at several
        values, followed in both directions and through two doublings (or `switch`).
    values : int
        For `diagram`: number of parameter values with a census (2 to 10000).
    starts : int
        For `diagram`: initial states at each value (1 to 100000).
    seed : int
        For `diagram`: seed of the initial states.
    second : Mapping[str, tuple[float | str, float | str]] | str | None
        Second parameter and its range, as in {"alpha4": (5, 40)}, for bifurcation
        curves in both.
    event : Sequence[str] | None
        An observable and its value, as in "F_max = 1 nN": where the orbits have it,
        and with `second` its curve in both parameters; may be repeated.
    max_step : float
        Longest step, as a fraction of the range.
    threads : int | None
        Number of threads; default: one per core.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    The orbits over `point` (`branch`, the parameter by its name, `stable`,
    `tip_max`, `states` …) and the bifurcations over `bifurcation`
    (`bifurcation_kind`, `bifurcation_parameter`, `bifurcation_states` …); curves in
    two parameters over `locus_point`. The attributes state why each branch ends,
    and list failures.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> ds = nanotap.branch(case, parameter="omega", from_=3.2, to=2.9, progress=False)
    >>> ds.bifurcation_kind.values.tolist(), ds.bifurcation_parameter.values.round(6).tolist()
    (['flip'], [2.913722])
    """
    options = _arguments.options("branch", locals())
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
) -> "StudyDataset":
    """Amplitude, phase, force and energy against the distance to the sample, both ways,
    with the branches that coexist.

    Parameters
    ----------
    case : Case
        The case.
    from_ : float | str | None
        First distance, in units of the case ("30 nm") or as alpha5; default: 1.25
        times the free swing of the tip towards the sample.
    to : float | str | None
        Last distance of the approach; default: 0.
    points : int
        Number of distances in each direction. Under a nonlinear law the lever is
        followed for at most 30 million steps of the approximate flow, and as many
        more are taken for every 100 distances; two evaluations of the force in the
        exact flow count as a step (2 to 20000).
    branches : bool
        Also continue coexisting branches, stable and unstable.
    switch : int
        Number of period doublings to follow, as far as their orbits are stable (0
        to 12).
    max_period : int
        Longest period of orbits, in drive periods (1 to 10000).
    speed : float | str | None
        Speed of approach and retract, in units of the case ("500 nm/s") or as
        alpha5 per unit of time: the distance changes each drive period; default:
        quasi-static.
    fm : bool
        Frequency modulation: keep the amplitude (the free amplitude of the case)
        and phase constant by frequency and strength of the drive, and report the
        frequency shift.
    phase : float
        Phase lag kept by frequency modulation, in degrees.
    shift : float | str | None
        Frequency shift whose distances to find under frequency modulation, in units
        of the case ("-50 Hz") or as omega.
    closest : float | str | None
        Least distance of the oscillation kept by frequency modulation, in units of
        the case ("1 nm") or as alpha5: the amplitude then changes with the
        distance.
    threads : int | None
        Number of threads; default: one per core.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    The observables over `way` (approach, retract) and the distance (with the name
    of its parameter, with `zc` in metres for a physical case): `first_harmonic`,
    `phase`, `peak_force`, `dissipation` … and in SI `physical_A`, `physical_F_max`,
    `physical_E_dis` …; the branches over `branch_point`; the jumps in the attribute
    `jumps`. With `fm=True` also `relative_shift`, `drive_ratio`,
    `sader_jarvis_force` … and in SI `physical_frequency_shift` …, with the settings
    of the loop in the attribute `modulation`.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> ds = nanotap.approach(case, points=3, branches=False, progress=False)
    >>> ds.first_harmonic.sel(way="approach").values.round(4)
    array([0.0149, 2.8522, 4.4282])
    """
    options = _arguments.options("approach", locals())
    return _studies.approach(case, options, threads, progress)

def fm(
    case: Case,
    *,
    from_: float | str | None = None,
    to: float | str | None = None,
    points: int = 80,
    phase: float = 90.0,
    shift: float | str | None = None,
    closest: float | str | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Report:
    """Frequency shift and excitation against the distance to the sample, with amplitude
    and phase held.

    Parameters
    ----------
    case : Case
        The case.
    from_ : float | str | None
        First distance, in units of the case ("30 nm") or as alpha5; default: 1.25
        times the free amplitude towards the sample.
    to : float | str | None
        Last distance of the approach; default: 0.
    points : int
        Number of distances in each direction (2 to 20000).
    phase : float
        Phase lag to keep, in degrees.
    shift : float | str | None
        Frequency shift whose distances to find, in units of the case ("-50 Hz") or
        as omega.
    closest : float | str | None
        Least distance of the oscillation to keep, in units of the case ("1 nm") or
        as alpha5: the amplitude then changes with the distance.
    threads : int | None
        Number of threads; default: one per core.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    The document, with the names of the terminal's JSON; `.to_dataframe()`, `.ds`
    and `.plot()`.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> lever = nanotap.Case(
    ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
    ...     sample={"stiffness": "5 N/m"},
    ...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
    ...     gap={"tip": "8 nm"},
    ... )
    >>> curve = nanotap.fm(lever, points=2, from_="12 nm", to="9 nm", progress=False)
    >>> row = curve.table[1]
    >>> print(f"{row.zc:.1e} m: {row.modulation_si.frequency_shift:.1f} Hz")
    9.0e-09 m: 1323.3 Hz
    """
    options = _arguments.options("fm", locals())
    return _studies.document("fm", case, options, threads, progress)

def fit(
    case: Case | Path | Any,
    *,
    data: Any = None,
    free: Sequence[str] | None = None,
    per_curve: Sequence[str] | None = None,
    convert: Sequence[str] | None = None,
    start: Sequence[str] | None = None,
    bounds: Mapping[str, tuple[float | str, float | str]] | str | None = None,
    columns: Sequence[str] | None = None,
    pixels: Sequence[str] | None = None,
    segment: Literal["approach", "retract", "both"] | None = None,
    range: Mapping[str, tuple[float | str, float | str]] | str | None = None,
    tip_radius: float | str | None = None,
    half_angle: float | str | None = None,
    spring_constant: float | str | None = None,
    poisson: float | str | None = None,
    laws: Sequence[str] | None = None,
    rows: int = 100,
    starts: int = 8,
    seed: int = 0,
    max_period: int = 4,
    jumps: bool = True,
    phase: float = 90.0,
    profile: bool = True,
    rivals: bool = True,
    evaluations: int | None = None,
    curve: int | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Fit:
    """Fit parameters of lever and sample to measured curves.

    Parameters
    ----------
    case : Case | Path | Any
        The case, or the path of its file; or, without `data`, the measured curve
        itself, of which a force curve needs no case: the file's header has the
        lever, `tip_radius` states the tip.
    data : Any
        Measured curves: tables whose columns are named as in `distance (nm)`,
        `amplitude (nm)`, `phase (deg)`.
    free : Sequence[str] | None
        Parameters to find: keys of the case, gap.offset, NAME.offset or NAME.scale
        of a column, and terms of the instrument: NAME.tilt, NAME.curvature,
        NAME.interference, NAME.drag, gap.drift, gap.backlash. Of a force curve for
        which no key is named, the sample's modulus, the contact point, the baseline
        and the adhesion of the law are found.
    per_curve : Sequence[str] | None
        Parameters to find with one value per curve.
    convert : Sequence[str] | None
        Conversions of columns, as in Amp="58 nm/V", Phase=90-x, Zsnsr=-x or
        Ch3=amplitude.
    start : Sequence[str] | None
        Initial values of free parameters, and fixed corrections of columns, as in
        gap.offset="10.3 nm".
    bounds : Mapping[str, tuple[float | str, float | str]] | str | None
        Bounds of parameters, as in {"sample.stiffness": ("1 N/m", "100 N/m")}.
    columns : Sequence[str] | None
        Columns of the data to use; default: all.
    pixels : Sequence[str] | None
        Columns that name the pixel of a force volume, as in x,y: one fit a pixel,
        into a dataset.
    segment : Literal["approach", "retract", "both"] | None
        Segment of a curve to fit; default for a force curve: its approach under an
        elastic law, both under one with adhesion or losses.
    range : Mapping[str, tuple[float | str, float | str]] | str | None
        Rows to fit: their numbers, or forces from the baseline, or indentations
        from the contact point, as in {"rows": (100, 2000)}, {"force": ("0.1 nN", "2
        nN")} or {"indentation": ("-1 um", "300 nm")}.
    tip_radius : float | str | None
        Radius of the tip, as in "40 nm", in place of the case's.
    half_angle : float | str | None
        Half angle of a conical tip, as in "20 deg", in place of the case's.
    spring_constant : float | str | None
        Stiffness of the lever, as in "0.05 N/m", in place of the case's and of the
        file's header.
    poisson : float | str | None
        Poisson's ratio of the sample, in place of the case's; without a case 0.5.
    laws : Sequence[str] | None
        Contact laws to compare, as in hertz,dmt; default: the law of the case.
    rows : int
        Average longer curves to about this many rows; 0: use every row (0 to
        1000000).
    starts : int
        Initial values to try until the data are described (1 to 1000).
    seed : int
        Seed of the further initial values.
    max_period : int
        Longest period of the orbits, in drive periods (1 to 64).
    jumps : bool
        Use the locations of jumps at folds as data.
    phase : float
        Phase lag that the loop maintains, in degrees, for curves of a frequency
        shift.
    profile : bool
        Intervals from the profile of the likelihood.
    rivals : bool
        Search for other minima that describe the data about as well.
    evaluations : int | None
        Evaluations of the whole curve after which the search ends with what is
        known; default: 60 under a nonlinear law, else no limit (1 to 1000000).
    curve : int | None
        Number of the curve of an instrument's file with several, from 0; default:
        the first.
    threads : int | None
        Number of threads; default: one per core.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    `parameters` (key, value, standard_error, interval, unit), `chi2`,
    `undetermined`, `correlations`, the `rows` with model and residuals;
    `force_curves`, what each force curve says of the sample; `best` and `errors` by
    key, and `best_case()`, the case of the best fit.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> lever = nanotap.Case(
    ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
    ...     sample={"stiffness": "5 N/m"},
    ...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
    ...     gap={"tip": "8 nm"},
    ... )
    >>> zc = [7e-9, 8e-9, 9e-9]
    >>> seen = nanotap.orbit(lever, **{"gap.tip": zc})
    >>> measured = {"zc (m)": zc, "A (m)": seen.first_harmonic, "phase": seen.phase}
    >>> guess = lever.with_({"sample.stiffness": "8 N/m"})
    >>> found = nanotap.fit(guess, data=measured, free=["sample.stiffness"], progress=False)
    >>> print(f"{found.best['sample.stiffness']:.3f} N/m")
    5.000 N/m
    """
    options = _arguments.options("fit", locals())
    return _studies.fit(case, options, curve, threads, progress)

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
    rows: int = 500,
    threads: int | None = None,
    progress: Progress = None,
) -> Reconstruction:
    """Force and dissipation against distance from a measured curve.

    Parameters
    ----------
    case : Case
        The case.
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
        Number of threads; default: one per core.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    `table` (distance, force, force_error, dissipation, dissipation_error, damping,
    damping_error), `minimum`, `closest`, the `rows`; `curve()`, the table as a
    DataFrame, and `law_table()`, the text for `sample.table`.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> import numpy as np
    >>> lever = nanotap.Case(
    ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
    ...     sample={"stiffness": "5 N/m"},
    ...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
    ...     gap={"tip": "8 nm"},
    ... )
    >>> zc = np.linspace(6e-9, 11e-9, 20)
    >>> seen = nanotap.orbit(lever, **{"gap.tip": zc})
    >>> measured = {"zc (m)": zc, "A (m)": seen.first_harmonic, "phase": seen.phase}
    >>> curve = nanotap.reconstruct(lever, data=measured, progress=False).curve()
    >>> print(f"{curve.force.iloc[0]:.2e} N at an indentation of {-curve.index[0]:.2e} m")
    1.31e-09 N at an indentation of 2.61e-10 m
    """
    options = _arguments.options("reconstruct", locals())
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
    where: Sequence[str] | None = None,
    out: Path | None = None,
    chunk: str = "1/1",
    threads: int | None = None,
    client: "Client | None" = None,
    progress: Progress = None,
) -> "StudyDataset":
    """Sweep one or two parameters, from any number of initial states.

    Parameters
    ----------
    case : Case
        The case.
    over : str | Sequence[str] | Mapping[str, Any]
        Parameter and its values, as in {"omega": nanotap.range(2, 4, 400)} (first,
        last, count), {"alpha4": nanotap.range(1, 1000, 50, log=True)} in equal
        ratios, or ascending values {"omega": [2, 2.5, 4]}; modes too; for a
        physical case also {"drive.frequency": nanotap.range("60 kHz", "80 kHz",
        200)}, or {"drive.setpoint": nanotap.range(0.5, 0.9, 9)}, for each of which
        the distance is solved; once or twice.
    starts : int | None
        Quasi-random initial states at each value, spread over a box; default: rest
        alone (1 to 1000000).
    seed : int
        Seed of the initial states.
    box : Box
        Sides of the box, as in {"a1": (-1, 1)} or {"v2": (-4, 4)}; other sides
        follow from the linear response to the drive.
    state : Any
        Start from this state at drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v),
        or some by name, as in tip=5nm; of a physical case in m and m/s, or with
        units.
    follow : Literal["off", "up", "down", "both"]
        Start each value from the last state of the previous one, along the first
        parameter: up, down or both. An interrupted line is lost; `off`: Every value
        starts anew.; `up`: From the least value to the greatest.; `down`: From the
        greatest value to the least.; `both`: Both..
    periods : int
        Number of recorded drive periods (1 to 100000000).
    strobe : int | None
        Number of last periods whose final states are kept; default: all recorded
        ones (0 to 100000000).
    transient : int | None
        Drive periods of the discarded transient; default: until the motion has
        settled (0 to 100000000).
    max_period : int
        Longest period of orbits, in drive periods (1 to 10000).
    where : Sequence[str] | None
        Condition that every motion at a value must meet, as in "F_max < 1 nN",
        "regime = attractive", "states = 1"; several: all must hold.
    out : Path | None
        The dataset, a folder with the extension .zarr; an existing one is resumed.
        Without it, everything is in memory.
    chunk : str
        Only one of n shares, as in "2/8"; `merge` merges the shares.
    threads : int | None
        Number of threads; default: one per core.
    client : "Client | None"
        A Dask client on whose workers the chunks are computed, with the same bytes.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    The dataset, as `open` opens it: lazily from `out`. After Ctrl-C, the `result`
    of the exception is the finished part of the dataset, and the same call resumes
    in `out`.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> ds = nanotap.sweep(case, over={"omega": nanotap.range(2.9, 3, 3)}, periods=2, progress=False)
    >>> ds.classification.values.ravel().tolist()
    ['periodic', 'periodic', 'periodic']
    """
    options = _arguments.options("sweep", locals())
    return _datasets.sweep(case, options, out, chunk, threads, client, progress)

def window(
    case: Case,
    *,
    over: str | Sequence[str] | Mapping[str, Any],
    starts: int = 16,
    seed: int = 1,
    max_period: int = 32,
    where: Sequence[str] | None = None,
    out: Path | None = None,
    threads: int | None = None,
    client: "Client | None" = None,
    progress: Progress = None,
) -> "StudyDataset":
    """The operating window over two parameters: where there is only one motion, and where
    a second state, subharmonics or chaos threaten.

    Parameters
    ----------
    case : Case
        The case.
    over : str | Sequence[str] | Mapping[str, Any]
        Parameter and its values, as in {"gap.tip": nanotap.range("5 nm", "25 nm",
        41)}, {"drive.free_amplitude": nanotap.range("10 nm", "60 nm", 26)},
        {"omega": nanotap.range(2, 4, 81)}, or ascending values {"omega": [2, 2.5,
        4]}; twice, first the horizontal axis. For {"drive.setpoint":
        nanotap.range(0.5, 0.9, 9)} the distance is solved at each point.
    starts : int
        Initial states at each point: rest, the linear responses, and samples at all
        amplitudes (1 to 1000000).
    seed : int
        Seed of the initial states.
    max_period : int
        Longest period of orbits, in drive periods (1 to 10000).
    where : Sequence[str] | None
        Condition that every motion found at a point must meet, as in "F_max < 1
        nN", "regime = attractive", "states = 1"; several: all must hold.
    out : Path | None
        The dataset, a folder with the extension .zarr; an existing one is resumed.
        Without it, everything is in memory.
    threads : int | None
        Number of threads; default: one per core.
    client : "Client | None"
        A Dask client on whose workers the chunks are computed, with the same bytes.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    The sweep with `condition` over both parameters: no-contact, one-period-1,
    second-state, subharmonic, irregular, undecided, or setpoint-unreached; `share`
    is the fraction of each. With `where`, `holds` says where the conditions hold;
    its attributes have their share and the largest rectangle (`region`, JSON).
    Where the case leaves its distance to a setpoint: the number of `states` at the
    setpoint, their distances, phases and the `step_height` between them over both
    parameters, with the `verdict` as an attribute.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> over = {"omega": [2.9, 3.0], "alpha4": nanotap.range(19, 20, 2)}
    >>> nanotap.window(case, over=over, starts=2, progress=False).condition.values.tolist()
    [['one-period-1', 'one-period-1'], ['subharmonic', 'one-period-1']]
    """
    options = _arguments.options("window", locals())
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
    periods: int | None = None,
    max_period: int = 64,
    out: Path | None = None,
    chunk: str = "1/1",
    threads: int | None = None,
    client: "Client | None" = None,
    progress: Progress = None,
) -> "StudyDataset":
    """Compute basins of attraction on a two-dimensional slice of initial states.

    Parameters
    ----------
    case : Case
        The case.
    x : str | Mapping[str, Any]
        Horizontal axis, as in {"a1": nanotap.range(-1, 1, 200, log=True)} entry of
        the state (a1…aN, v1…vN; oscillator: x, v), first value, last value, count.
    y : str | Mapping[str, Any]
        Vertical axis, in the same form.
    state : Any
        State with the other entries: a1,…,aN,v1,…,vN, or some by name, as in
        tip=5nm; of a physical case in m and m/s, or with units; default: 0.
    attractors : Iterable[Any] | None
        States on the attractors, or the result of a census; default: a census in
        the slice.
    starts : int
        Initial states of the census (1 to 1000000).
    seed : int
        Seed of the census.
    periods : int | None
        Drive periods after which a point counts as unsettled; default: enough for
        the orbit whose disturbances die slowest, 1000 at least (1 to 100000000).
    max_period : int
        Longest period of orbits, in drive periods (1 to 10000).
    out : Path | None
        The dataset, a folder with the extension .zarr; an existing one is resumed.
        Without it, everything is in memory.
    chunk : str
        Only one of n shares, as in "2/8"; `merge` merges the shares.
    threads : int | None
        Number of threads; default: one per core.
    client : "Client | None"
        A Dask client on whose workers the chunks are computed, with the same bytes.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    `attractor` over the two entries of the state: an index into the attractors of
    the attribute `attractors` (JSON), negative where there is none.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> sides = {"x": {"a1": nanotap.range(-1, 1, 2)}, "y": {"v1": nanotap.range(-1, 1, 2)}}
    >>> nanotap.basin(case, **sides, progress=False).attractor.values.tolist()
    [[0, 0], [0, 0]]
    """
    options = _arguments.options("basin", locals())
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
    """Compute the Lyapunov spectrum with error bars, and a Poincaré section.

    Parameters
    ----------
    case : Case
        The case.
    periods : int
        Drive periods of the average (1 to 100000000).
    transient : int
        Drive periods of the discarded transient (0 to 100000000).
    state : Any
        Initial state at drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v), or some
        by name, as in tip=5nm; of a physical case in m and m/s, or with units;
        default: rest.
    section : Literal["phase", "contact"]
        Poincaré section; `phase`: Once a drive period, at one phase; `contact`: At
        the beginning of every contact.
    phase : float
        Drive phase of the section in degrees.
    points : int
        Number of points of the section (0 to 2000000).

    Returns
    -------
    Exponents with their errors, and the points of the section.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> nanotap.lyapunov(case).exponents[:2].round(4).tolist()
    [-0.1409, -0.1409]
    """
    options = _arguments.options("lyapunov", locals())
    return _studies.lyapunov(case, options)

def convergence(
    case: Case,
    *,
    largest: int = 10,
    tolerance: float = 0.01,
    period: int | None = None,
) -> Convergence:
    """Compare the motion with 1 to K modes: how many are enough.

    Parameters
    ----------
    case : Case
        The case.
    largest : int
        Largest number of modes (2 to 50).
    tolerance : float
        Tolerance of the tip deflection, as a fraction of the amplitude.
    period : int | None
        Period of the orbit to compare; default: the motion to which a run from rest
        converges (1 to 10000).

    Returns
    -------
    The motion with each number of modes, and a verdict.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> nanotap.convergence(case, largest=4).enough
    3
    """
    options = _arguments.options("convergence", locals())
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
) -> Report:
    """Compare contact laws under the same lever and drive.

    Parameters
    ----------
    case : Case
        The case.
    period : int
        Period of the compared orbits (1 to 10000).
    arm : float | None
        Stiffness of the relaxing arm; default: that of the case, or twice alpha4.
    from_ : float | str | None
        Lowest drive frequency to which the orbits are followed.
    to : float | str | None
        Highest drive frequency to which the orbits are followed.
    threads : int | None
        Number of threads; default: one per core.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    The document, with the names of the terminal's JSON; `.to_dataframe()`, `.ds`
    and `.plot()`.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> [sample.contact for sample in nanotap.contact_laws(case, progress=False).samples]
    ['spring-damper', 'kelvin-voigt', 'standard-linear-solid']
    """
    options = _arguments.options("contact-laws", locals())
    return _studies.document("contact-laws", case, options, threads, progress)

def noise(
    case: Case,
    *,
    temperature: float = 295.0,
    time_constant: float | str | None = None,
    bandwidth: float | str | None = None,
    state: Any = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Report:
    """Compute thermal noise of amplitude and phase at a working point.

    Parameters
    ----------
    case : Case
        The case.
    temperature : float
        Temperature in kelvin.
    time_constant : float | str | None
        Time constant of the lock-in amplifier's first-order filter; default: 0.25
        ms.
    bandwidth : float | str | None
        Noise bandwidth of the lock-in amplifier, 1 over four time constants, in
        place of it.
    state : Any
        State near the orbit, at drive phase 0: a1,…,aN,v1,…,vN, or some by name, as
        in tip=5nm; of a physical case in m and m/s, or with units.
    threads : int | None
        Number of threads; default: one per core.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    The document, with the names of the terminal's JSON; `.to_dataframe()`, `.ds`
    and `.plot()`.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> lever = nanotap.Case(
    ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
    ...     sample={"stiffness": "5 N/m"},
    ...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
    ...     gap={"tip": "8 nm"},
    ... )
    >>> found = nanotap.noise(lever)
    >>> print(f"{found.thermal_rms:.3e} m, {found.amplitude_rms:.2e} m")
    4.509e-11 m, 1.08e-11 m
    """
    options = _arguments.options("noise", locals())
    return _studies.document("noise", case, options, threads, progress)

def bimodal(
    case: Case,
    *,
    first: Literal["am", "fm", "pll", "agc"] | None = None,
    second: Literal["am", "fm", "pll", "agc"] | None = None,
    phase: float = 90.0,
    second_phase: float = 90.0,
    from_: float | str | None = None,
    to: float | str | None = None,
    points: int = 30,
    threads: int | None = None,
    progress: Progress = None,
) -> Report:
    """Follow AM–FM, FM–FM and other bimodal operation against the distance.

    Parameters
    ----------
    case : Case
        The case.
    first : Literal["am", "fm", "pll", "agc"] | None
        Loop of the first tone; default: am.
    second : Literal["am", "fm", "pll", "agc"] | None
        Loop of the second tone; default: fm.
    phase : float
        Phase lag of the first tone to hold, in degrees.
    second_phase : float
        Phase lag of the second tone to hold, in degrees.
    from_ : float | str | None
        First distance, as in "30 nm"; default: where the lever is free.
    to : float | str | None
        Last distance; default: that of the case, or where its setpoint is reached.
    points : int
        Number of distances (2 to 20000).
    threads : int | None
        Number of threads; default: one per core.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    The document, with the names of the terminal's JSON; `.to_dataframe()`, `.ds`
    and `.plot()`.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> lever = nanotap.Case(
    ...     modes=2,
    ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 150},
    ...     tip={"radius": "10 nm"},
    ...     sample={"law": "hertz", "modulus": "1 GPa", "poisson": 0.3},
    ...     drive={
    ...         "actuation": "tip", "frequency_ratio": 1, "free_amplitude": "40 nm",
    ...         "second_ratio": 6.27, "second_free_amplitude": "0.1 nm", "setpoint": 0.8,
    ...     },
    ... )
    >>> last = nanotap.bimodal(lever, progress=False).table[-1]
    >>> print(f"{last.tones[1].frequency_shift:.1f} Hz, {last.estimates.reduced_modulus:.3e} Pa by the formula")
    1035.7 Hz, 1.120e+09 Pa by the formula
    """
    options = _arguments.options("bimodal", locals())
    return _studies.document("bimodal", case, options, threads, progress)

def scan(
    case: Case,
    *,
    method: Literal["exact", "fast", "quasi-static"] | None = None,
    list: Any = None,
    size: float | str | None = None,
    size_y: float | str | None = None,
    lines: int | None = None,
    pixels: int | None = None,
    settle: int | None = None,
    periods: int | None = None,
    line_rate: float | str | None = None,
    speed: float | str | None = None,
    retrace: bool | None = None,
    line_settle: int | None = None,
    mode: Literal["constant-amplitude", "constant-height"] | None = None,
    setpoint: float | str | None = None,
    integral_gain: float | str | None = None,
    integral_bandwidth: float | str | None = None,
    proportional_gain: float | None = None,
    z0: float | str | None = None,
    lock_in: Any = None,
    z_scanner: Any = None,
    delay: int | None = None,
    slew_rate: float | str | None = None,
    z_range: Any = None,
    dynamic_threshold: float | None = None,
    dynamic_gain: float | None = None,
    surface: Any = None,
    profile: Any = None,
    image: str | None = None,
    image_height: float | str | None = None,
    dilate: float | str | None = None,
    material: Any = None,
    out: Path | None = None,
    chunk: str = "1/1",
    threads: int | None = None,
    client: "Client | None" = None,
    progress: Progress = None,
) -> "StudyDataset":
    """Scan of a line or an image under feedback, drive period by period.

    Parameters
    ----------
    case : Case
        The case.
    method : Literal["exact", "fast", "quasi-static"] | None
        How the drive periods are computed.
    list : Any
        Drive periods that the JSON document lists, counted from the start of
        settling.
    size : float | str | None
        Length of a line.
    size_y : float | str | None
        Extent across the lines; without it, as long as a line.
    lines : int | None
        Lines (1 to 65536).
    pixels : int | None
        Pixels of a line (1 to 65536).
    settle : int | None
        Drive periods before the first line (0 to 10000000).
    periods : int | None
        Drive periods of a line in one direction (2 to 10000000).
    line_rate : float | str | None
        Lines a second, trace and retrace together, in place of `periods`.
    speed : float | str | None
        Speed of the tip along the line, in place of `periods`.
    retrace : bool | None
        Scan every line back, too.
    line_settle : int | None
        Drive periods that each line settles before it: lines are then independent
        and run at the same time on all cores (0 to 10000000).
    mode : Literal["constant-amplitude", "constant-height"] | None
        What the feedback does.
    setpoint : float | str | None
        Amplitude that the feedback holds: a part of the free amplitude, or a
        length.
    integral_gain : float | str | None
        Integral gain in 1/s: the crossover frequency times 2π where the amplitude
        falls as the distance does.
    integral_bandwidth : float | str | None
        The same as a frequency.
    proportional_gain : float | None
        Proportional gain.
    z0 : float | str | None
        Height at the start; without it, where the amplitude of a lever that comes
        from far has fallen to the setpoint.
    lock_in : Any
        Lock-in amplifier.
    z_scanner : Any
        Resonance of the z scanner.
    delay : int | None
        Drive periods by which the controller is late (0 to 10000).
    slew_rate : float | str | None
        Largest speed of the z command.
    z_range : Any
        Lowest and highest z command.
    dynamic_threshold : float | None
        Amplitude above which the error is amplified, a part of the free amplitude.
    dynamic_gain : float | None
        Gain on the amplitude above the threshold.
    surface : Any
        Features of the surface; their heights add up.
    profile : Any
        Measured heights of the line: a CSV file named relative to the case file.
    image : str | None
        Greyscale image of the heights, a PNG file named relative to the case file.
    image_height : float | str | None
        Height of white in the image.
    dilate : float | str | None
        Widen the sampled heights by a sphere of this radius, the tip.
    material : Any
        Stretches of the line with another sample.
    out : Path | None
        The dataset, a folder with the extension .zarr; an existing one is resumed.
        Without it, everything is in memory.
    chunk : str
        Only one of n shares, as in "2/8"; `merge` merges the shares.
    threads : int | None
        Number of threads; default: one per core.
    client : "Client | None"
        A Dask client on whose workers the chunks are computed, with the same bytes.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    `height`, `amplitude_error`, `phase`, `peak_force`, `dissipation`, `state` …
    over `direction` (trace, retrace), `y` and `x`; the listed drive periods over
    `k` (`period_z`, `period_amplitude` …). The attributes hold the `verdict`, the
    `warnings`, and as JSON the `causes` that the verdict names, the statistics of
    the `lines`, the `branch_changes` and the analysis of the feedback `loop`. With
    `out`, the lines are written into a dataset as they are finished (this needs
    `line_settle`), and a later call goes on with it.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> lever = nanotap.Case(
    ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
    ...     sample={"stiffness": "5 N/m"},
    ...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
    ...     gap={"tip": "8 nm"},
    ... )
    >>> ds = nanotap.scan(
    ...     lever, size="100 nm", periods=4000, pixels=5, settle=300, setpoint=0.8, z0="8 nm",
    ...     integral_gain=1500, lock_in={"time_constant": "20 us", "order": 1}, progress=False,
    ...     surface=[{"step": {"from": "30 nm", "to": "70 nm", "height": "2 nm"}}],
    ... )
    >>> (1e9 * ds.height.sel(direction="trace")).values.round(1).tolist()
    [[7.7, 8.8, 9.7, 8.9, 7.7]]
    """
    options = _arguments.options("scan", locals())
    return _studies.scan(case, options, out, chunk, threads, client, progress)

def image_states(
    case: Case,
    *,
    data: Any = None,
    setpoint: float | str | None = None,
    direction: Literal["trace", "retrace"] = "trace",
    height: str | None = None,
    amplitude: str | None = None,
    phase: str | None = None,
    convert: Sequence[str] | None = None,
    phase_offset: float | None = None,
    sense: Literal["lag", "lead"] | None = None,
    amplitude_noise: float | str | None = None,
    phase_noise: float | None = None,
    phase_tolerance: float = 1.0,
    amplitude_error: bool = True,
    materials: bool = False,
    confidence: float = 0.99,
    threads: int | None = None,
    progress: Progress = None,
) -> "StudyDataset":
    """The lever's state in each pixel of an image, and the false steps of its height.

    Parameters
    ----------
    case : Case
        The case.
    data : Any
        Images of one area: channels of height, amplitude and phase.
    setpoint : float | str | None
        Amplitude at which the image was taken, as a fraction of A0 or as in "8 nm";
        default: drive.setpoint of the case, or the setpoint of its [scan].
    direction : Literal["trace", "retrace"]
        Direction of the lines, where a file has both; `trace`: Lines of the trace,
        forward; `retrace`: Lines of the retrace, backward.
    height : str | None
        Channel of the height, by its name or a part of it, or none; default: by the
        name.
    amplitude : str | None
        Channel of the amplitude, or of its error from the setpoint, or none;
        default: by the name.
    phase : str | None
        Channel of the phase, or none; default: by the name.
    convert : Sequence[str] | None
        Conversions of channels, as in Amplitude="58 nm/V" or Phase=90-x.
    phase_offset : float | None
        Measured phase where the lag is zero, degrees; default: from the image.
    sense : Literal["lag", "lead"] | None
        Whether the measured phase is a lag or a lead; default: what the image
        allows.
    amplitude_noise : float | str | None
        Noise of the amplitude in a pixel, as in "20 pm"; default: from neighbouring
        pixels.
    phase_noise : float | None
        Noise of the phase in a pixel, degrees; default: from neighbouring pixels.
    phase_tolerance : float
        Error of the phases of the case, degrees.
    amplitude_error : bool
        Take the deviation of the amplitude from the setpoint from the heights, too:
        it is the part of the surface, and of a false step, that the feedback has
        not followed yet.
    materials : bool
        Look for the states above each material of the case's [scan], too: a pixel
        then has a state and a material, and is undecided if two have its phase.
    confidence : float
        Probability above which a pixel is assigned to a state.
    threads : int | None
        Number of threads; default: one per core.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    Over `y` (falling, as instruments count lines) and `x`: `state` (attractive,
    repulsive, free or undecided), `probability`, `height`, `corrected`, `amplitude`
    and `phase`. The attributes hold the `verdict`, the `reason` if the image is
    undecided, `phase_offset`, the `warnings`, and as JSON the `states` of the case,
    the `steps` of the lever and the assignments that are `possible`.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> import numpy as np
    >>> lever = nanotap.Case(
    ...     modes=1,
    ...     cantilever={"k": "40 N/m", "f0": "325 kHz", "Q": 200},
    ...     tip={"radius": "20 nm", "modulus": "170 GPa", "poisson": 0.28},
    ...     sample={"law": "dmt", "modulus": "70 GPa", "poisson": 0.17, "hamaker": "1.2e-19 J"},
    ...     drive={
    ...         "actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm", "setpoint": 0.9,
    ...     },
    ... )
    >>> image = {
    ...     "height (nm)": np.array([[9.2, 9.2, 9.2, 9.2, 8.9, 8.9, 8.9, 8.9]]),
    ...     "phase (deg)": np.array([[115.9, 115.7, 115.8, 115.9, 64.2, 64.1, 64.3, 64.1]]),
    ... }
    >>> ds = nanotap.image_states(lever, data=image, phase_offset=0, sense="lag", progress=False)
    >>> ds.state.values[0, 3:5].tolist()
    ['attractive', 'repulsive']
    >>> (1e9 * ds.corrected).values[0, 3:5].round(2).tolist()
    [9.2, 9.2]
    """
    options = _arguments.options("image-states", locals())
    return _studies.image_states(case, options, threads, progress)

def force_curve(
    case: Case,
    *,
    from_: float | str | None = None,
    to: float | str | None = None,
    peak_force: float | str | None = None,
    speed: float | str | None = None,
    frequency: float | str | None = None,
    points: int = 500,
    settle: int | None = None,
    fit_from: float = 0.2,
    fit_to: float = 0.9,
    threads: int | None = None,
    progress: Progress = None,
) -> Report:
    """Force curve of approach and retract at a finite speed, with the static branches,
    adhesion, work and fitted moduli.

    Parameters
    ----------
    case : Case
        The case.
    from_ : float | str | None
        First distance, as in "30 nm"; default: the distance of the case.
    to : float | str | None
        Distance at which the approach turns; default: as far behind the surface as
        a tenth of `from`.
    peak_force : float | str | None
        Force at which the approach turns in place of `to`, as in "5 nN": the
        distance at which the lever at rest exerts it.
    speed : float | str | None
        Speed of a ramp, as in "2 um/s"; default: 1 um/s.
    frequency : float | str | None
        Frequency of a cosine in place of a ramp, as in "2 kHz".
    points : int
        Number of points in each direction (2 to 20000).
    settle : int | None
        Drive periods at the first distance before the curve, of a driven lever;
        default: 20 time constants of the lever (0 to 100000000).
    fit_from : float
        Lowest force of the fits, as a part of the span from the lowest force of the
        retract to the peak.
    fit_to : float
        Highest force of the fits, likewise.
    threads : int | None
        Number of threads; default: one per core.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    The document, with the names of the terminal's JSON; `.to_dataframe()`, `.ds`
    and `.plot()`.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> lever = nanotap.Case(
    ...     cantilever={"k": "2 N/m", "f0": "70 kHz", "Q": 100},
    ...     sample={"stiffness": "5 N/m"},
    ...     drive={"actuation": "tip", "frequency_ratio": 1, "free_amplitude": "10 nm"},
    ...     gap={"tip": "8 nm"},
    ... )
    >>> curve = nanotap.force_curve(lever, progress=False)
    >>> print(f"{curve.peak_force:.3e} N")
    1.597e-09 N
    """
    options = _arguments.options("force-curve", locals())
    return _studies.document("force-curve", case, options, threads, progress)

def lever(
    case: Case,
    *,
    levers: Sequence[str] | None = None,
    where: Sequence[str] | None = None,
    keep_tip: bool = False,
    quality_factor: Literal["auto", "air", "case"] = "auto",
    threads: int | None = None,
    progress: Progress = None,
) -> Report:
    """Compare levers of the catalogue on the sample of a case.

    Parameters
    ----------
    case : Case
        The case.
    levers : Sequence[str] | None
        Compare only these levers of the catalogue; default: all.
    where : Sequence[str] | None
        Condition that every motion found at the setpoint must meet, as in "F_max <
        1 nN", "regime = attractive", "states = 1"; several: all must hold.
    keep_tip : bool
        Keep radius and height of the tip of the case.
    quality_factor : Literal["auto", "air", "case"]
        Take the quality factors from: air and the dimensions of each lever (Sader
        1998), or the case, the same for every lever; auto: from the fluid of the
        case, without one from air if the case has about the quality factor of its
        lever in air, otherwise from the case; `auto`: Those in the fluid of the
        case, in air, or that of the case.; `air`: Those in air.; `case`: That of
        the case, or those in its fluid..
    threads : int | None
        Number of threads; default: one per core.
    progress : Progress
        Whether to show a bar, or a function that is called with the finished and
        the total count.

    Returns
    -------
    The document, with the names of the terminal's JSON; `.to_dataframe()`, `.ds`
    and `.plot()`.

    Raises
    ------
    ValueError
        An argument is invalid; the message names it.
    RuntimeError
        The computation failed.

    Examples
    --------
    >>> case = nanotap.Case.paper(omega=3)
    >>> gel = nanotap.Case(
    ...     modes=1,
    ...     cantilever={"lever": "PPP-FM", "Q": 200},
    ...     tip={"material": "silicon"},
    ...     sample={"law": "hertz", "modulus": "20 MPa", "poisson": 0.49},
    ...     drive={
    ...         "actuation": "tip", "frequency_ratio": 1, "free_amplitude": "20 nm", "setpoint": 0.8,
    ...     },
    ... )
    >>> found = nanotap.lever(gel, levers=["PPP-FM", "PPP-CONT"], where=["F_max < 0.5 nN"], progress=False)
    >>> for row in found.levers:
    ...     print(row.lever, row.holds, f"{1e12 * row.physical.F_max:.1f} pN")
    PPP-CONT True 236.9 pN
    PPP-FM False 611.1 pN
    """
    options = _arguments.options("lever", locals())
    return _studies.document("lever", case, options, threads, progress)
