"""Who takes part, with which methods and settings."""

from dataclasses import dataclass

TOLERANCES = [10.0**-k for k in range(6, 14)]
EVENT_STEPS = [500, 1000, 2000, 4000, 8000, 12000]
NAIVE_STEPS = [1000, 10_000, 100_000]
STEPS_OF_ORDER_8 = [64, 96, 128, 192, 288, 384, 512]


@dataclass(frozen=True)
class Peer:
    """One row: a program with one method."""

    # As the table and the plot call it.
    name: str
    # The program, by the name under which `build` puts it up.
    program: str
    method: str | None = None
    # What is tried: tolerances, or steps a period; none where nothing can be set.
    settings: tuple[float, ...] = ()
    # Whether it can be given several threads.
    threads: bool = False
    # Whether the settings are steps a period.
    fixed_step: bool = False


def peer(name: str, program: str, method: str | None, settings, **more) -> Peer:
    return Peer(name, program, method, tuple(settings), **more)


PEERS = [
    peer("nanotap", "nanotap", None, [], threads=True),
    peer("heyoka", "heyoka", "one", [*TOLERANCES, 1e-15]),
    peer("heyoka, batches of 8", "heyoka", "batch", [*TOLERANCES, 1e-15]),
    peer(
        "hand-written RK8, 8 lanes",
        "lanes",
        "rk8",
        STEPS_OF_ORDER_8,
        threads=True,
        fixed_step=True,
    ),
    peer(
        "hand-written RK4, 8 lanes",
        "lanes",
        "rk4",
        EVENT_STEPS,
        threads=True,
        fixed_step=True,
    ),
    peer("Numba RK4, events", "numba", "event", EVENT_STEPS, fixed_step=True),
    peer("Numba RK4, no events", "numba", "naive", NAIVE_STEPS, fixed_step=True),
    peer("odeint rkf78", "odeint", "rkf78", TOLERANCES, threads=True),
    peer("odeint dopri5", "odeint", "dopri5", TOLERANCES, threads=True),
    peer("SUNDIALS ERK 5(4)", "sundials", "erk54", TOLERANCES),
    peer("SUNDIALS ERK 8(7)", "sundials", "erk85", TOLERANCES),
    peer("SUNDIALS CVODE Adams", "sundials", "adams", TOLERANCES),
    peer("ode_solvers dopri5", "rust", "ode_solvers", TOLERANCES),
    peer("differential-equations DOP853", "rust", "differential_equations", TOLERANCES),
    peer("diffsol tsit45", "rust", "diffsol_tsit45", TOLERANCES),
    peer("diffsol BDF", "rust", "diffsol_bdf", TOLERANCES[:5]),
    peer("SciPy DOP853", "scipy", "DOP853", TOLERANCES),
    peer("SciPy LSODA", "scipy", "LSODA", TOLERANCES),
    peer("scikit-sundae Adams", "sundae", "Adams", TOLERANCES),
]


def thinned(settings: tuple[float, ...]) -> tuple[float, ...]:
    """Three of them, for a quick look."""
    if len(settings) <= 3:
        return settings
    return (settings[0], settings[len(settings) // 2], settings[-2])
