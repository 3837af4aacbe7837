"""The stroboscopic map of a case, for your own algorithms."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _arguments, _nanotap
from ._arguments import Floats
from ._case import Case
from ._record import Record


class Map:
    """The exact map of a case from the state at drive phase 0 to the state one period later.

    A state is (a₁ … a_N, ȧ₁ … ȧ_N) for a cantilever and (x, ẋ) for an oscillator, in the model's
    units; `state_names` lists the entries. Every function that takes a state also takes an array
    of states, whose last axis is that of the state. A map is immutable: threads may share it, and
    it can be pickled. It releases the interpreter lock while it computes.

    >>> case = Case.paper(omega=3)
    >>> map = Map(case)
    >>> z = map([0.0] * map.dimension, periods=200)
    >>> bool(abs(map(z) - z).max() < 1e-12)
    True
    >>> map.jacobian(z).shape, map.derivative(z, "alpha4").shape
    ((6, 6), (6,))

    Args:
        case: The case. A distance that follows from a setpoint is solved for.
        **keys: Keys of the case to change.
    """

    __slots__ = ("_core", "case")
    case: Case

    def __init__(self, case: Case, **keys: Any) -> None:
        if not isinstance(case, Case):
            message = f"case: expected a nanotap.Case, got {type(case).__name__}"
            raise TypeError(message)
        self.case = case.with_(**keys)
        self._core = _nanotap.MapCore(self.case._core)

    @property
    def dimension(self) -> int:
        """Number of entries of a state."""
        return self._core.dimension

    @property
    def period(self) -> float:
        """The drive period, in the model's unit of time."""
        return self._core.period

    @property
    def state_names(self) -> list[str]:
        """The names of a state's entries."""
        return self.case.state_names

    def __call__(
        self, z: npt.ArrayLike, periods: int = 1, *, threads: int | None = None
    ) -> Floats:
        """The states that `z` reaches after `periods` drive periods.

        Many states are distributed over all cores, or `threads` threads; the result does not
        depend on their number.

        Raises:
            ValueError: `z` is neither a state nor an array of states.
            RuntimeError: a motion could not be followed; the message names it.
        """
        rows, shape = self._rows(z)
        found = self._core.apply(
            rows, _arguments.count("periods", periods), _threads(threads)
        )
        return found.reshape(shape)

    def iterate(self, z: npt.ArrayLike, periods: int, *, every: int = 1) -> Floats:
        """`z` and the states that it reaches after every `every` drive periods.

        Returns:
            `periods // every + 1` rows, the first of which is `z`.
        """
        every = _arguments.count("every", every, 1)
        many = _arguments.count("periods", periods) // every + 1
        return self._core.iterate(self._one(z, "z"), many, every)

    def jacobian(
        self, z: npt.ArrayLike, periods: int = 1, *, threads: int | None = None
    ) -> Floats:
        """The derivative ∂Pᵏ/∂z of the map over k = `periods` drive periods: `… × n × n`."""
        rows, shape = self._rows(z)
        k = _arguments.count("periods", periods)
        _, jacobians, _ = self._core.linearised(rows, k, [], _threads(threads))
        return jacobians.reshape((*shape, self.dimension))

    def derivative(
        self,
        z: npt.ArrayLike,
        key: str | Sequence[str],
        periods: int = 1,
        *,
        threads: int | None = None,
    ) -> Floats:
        """The derivative ∂Pᵏ/∂key at constant `z`, exact through every switch.

        Args:
            z: States.
            key: A key of the case, `"alpha4"`, `"sample.stiffness"`, or several. For a physical
                quantity the derivative is per SI unit, with the same quantities constant as when
                that quantity is varied in a sweep.
            periods: k.
            threads: Number of threads for many states; default: one per core.

        Returns:
            `… × n`; for several keys `… × n × keys`.
        """
        rows, shape = self._rows(z)
        keys = [key] if isinstance(key, str) else list(key)
        k = _arguments.count("periods", periods)
        _, _, found = self._core.linearised(rows, k, keys, _threads(threads))
        return found.reshape(shape if isinstance(key, str) else (*shape, len(keys)))

    def orbit(self, z0: npt.ArrayLike, period: int = 1) -> "PeriodicOrbit":
        """The periodic orbit that Newton's method finds from `z0`, stable or not.

        `nanotap.orbit(case, state=…)` also computes its observables.

        Raises:
            RuntimeError: no orbit was found, or none that is isolated to rounding.
        """
        many = _arguments.count("period", period, 1)
        states, multipliers, stability, residual, error = self._core.orbit(
            self._one(z0, "z0"), many
        )
        return PeriodicOrbit(
            len(states), states, multipliers, stability, residual, error
        )

    def flow(
        self, z: npt.ArrayLike, tau: npt.ArrayLike, *, start: float = 0.0
    ) -> "Motion":
        """The motion from the state `z` at τ = `start` to the last of the times `tau`.

        Args:
            z: One state.
            tau: A time or an array of times, in the model's unit; 0 is drive phase 0.
            start: Time at which the motion begins, within the first drive period.

        Returns:
            The motion. Its entries are those at the times `tau`; call it for other times in
            between.
        """
        return Motion(self, self._one(z, "z"), tau, _arguments.number("start", start))

    def __reduce__(self) -> tuple[Any, ...]:
        return Map, (self.case,)

    def __repr__(self) -> str:
        return f"Map({self.case!r})"

    def _rows(self, z: npt.ArrayLike) -> tuple[Floats, tuple[int, ...]]:
        array = _arguments.real(z, "z")
        n = self.dimension
        if array.ndim == 0 or array.shape[-1] != n:
            message = f"z: the last axis of an array of states must have length {n}, got shape {array.shape}"
            raise ValueError(message)
        return array.reshape(-1, n), array.shape

    def _one(self, z: npt.ArrayLike, name: str) -> Floats:
        array = _arguments.real(z, name)
        if array.shape != (self.dimension,):
            message = f"{name}: expected one state of {self.dimension} numbers, got shape {array.shape}"
            raise ValueError(message)
        return array


@dataclass(frozen=True, eq=False)
class PeriodicOrbit:
    """A periodic orbit of a map, with its multipliers.

    Attributes:
        period: Minimal period in drive periods.
        states: Its states at drive phase 0, `period × n`.
        multipliers: Floquet multipliers, largest modulus first.
        stability: stable, unstable or marginal.
        residual: Largest entry of P(z_k) − z_{k+1}.
        error: Estimated distance of the states from the true orbit.
    """

    period: int
    states: Floats
    multipliers: npt.NDArray[np.complex128]
    stability: str
    residual: float
    error: float

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PeriodicOrbit):
            return NotImplemented
        mine, others = ((o.states, o.multipliers) for o in (self, other))
        same = (np.array_equal(a, b) for a, b in zip(mine, others, strict=True))
        words = (self.period, self.stability, self.residual, self.error)
        return all(same) and words == (
            other.period,
            other.stability,
            other.residual,
            other.error,
        )

    __hash__ = object.__hash__

    @property
    def state(self) -> Floats:
        """The first of its states."""
        first: Floats = self.states[0]
        return first

    @property
    def stable(self) -> bool:
        """Whether every multiplier is inside the unit circle."""
        return self.stability == "stable"


class Motion:
    """A motion between its strobes, in closed form at every time.

    Its entries are those at the requested times; calling it gives them at other times. Numbers
    are in the model's units.

    Attributes:
        tau: The times, 0 at drive phase 0.
        state: States there, `… × n`.
        tip: Tip deflection W; for an oscillator x.
        tip_rate: Its rate.
        gap: Height V_T of the tip over the undeformed surface.
        force: Force of the sample on the tip.
        guard: The quantity that ends the present regime when it falls to zero: in flight the gap,
            in contact the condition of contact.
        contact: Whether tip and sample touch.
        events: Beginnings and ends of contacts: `tau`, `kind`, `gap_rate`.
    """

    __slots__ = (
        "_core",
        "_made_of",
        "contact",
        "events",
        "force",
        "gap",
        "guard",
        "state",
        "tau",
        "tip",
        "tip_rate",
    )
    tau: Floats
    state: Floats
    tip: Floats
    tip_rate: Floats
    gap: Floats
    force: Floats
    guard: Floats
    contact: npt.NDArray[np.bool_]
    events: list[Record]

    def __init__(self, map: Map, z: Floats, tau: npt.ArrayLike, start: float) -> None:
        times = _arguments.real(tau, "tau")
        if times.size == 0:
            message = "tau: expected at least one time"
            raise ValueError(message)
        self._made_of = (map, z, times, start)
        self._core = map._core.flow(z, start, float(times.max()) - start)
        self.events = [Record(event) for event in json.loads(self._core.events)]
        self._look(times)

    def __call__(self, tau: npt.ArrayLike) -> "Motion":
        """The same motion at other times."""
        times = _arguments.real(tau, "tau")
        seen = Motion.__new__(Motion)
        seen._made_of, seen._core, seen.events = self._made_of, self._core, self.events
        seen._look(times)
        return seen

    def _look(self, times: Floats) -> None:
        _, _, known, start = self._made_of
        end = float(known.max())
        if times.size and not start <= times.min() <= times.max() <= end:
            message = f"tau: the motion is known from τ = {start} to {end}"
            raise ValueError(message)
        rows = self._core.at(times.ravel())
        self.tau = times
        self.tip, self.tip_rate, self.gap, self.force, self.guard, contact = (
            rows[:, k].reshape(times.shape) for k in range(6)
        )
        self.contact = contact > 0
        self.state = rows[:, 6:].reshape((*times.shape, rows.shape[1] - 6))

    def __reduce__(self) -> tuple[Any, ...]:
        map, z, known, start = self._made_of
        return _seen, (map, z, known, start, self.tau)

    def __repr__(self) -> str:
        _, _, known, start = self._made_of
        return f"Motion(τ from {start:g} to {known.max():g}, {len(self.events)} events)"


def _seen(map: Map, z: Floats, known: Floats, start: float, tau: Floats) -> Motion:
    return Motion(map, z, known, start)(tau)


def _threads(threads: int | None) -> int | None:
    return None if threads is None else _arguments.count("threads", threads, 1)
