"""All measurements of one comparison, gathered into rows."""

from dataclasses import asdict, dataclass, field

from .measure import PERIODS, RUNS, Measurements
from .roster import Peer, thinned

# Errors that a setting is chosen for, the first that a peer reaches.
TARGETS = (1e-9, 1e-6)


@dataclass
class Row:
    """One peer, measured."""

    name: str
    fixed_step: bool
    # For each setting: error after 20 periods and the time they took.
    ladder: list[dict] = field(default_factory=list)
    # The setting that the other works were done with, and its error.
    setting: float | None = None
    error: float | None = None
    first_seconds: float | None = None
    periods_per_second: float | None = None
    # Seconds for the whole of a work by number of threads, and which works were told from
    # the periods a second because a single run of them would have taken too long.
    sweep_seconds: dict[int, float] = field(default_factory=dict)
    basin_seconds: dict[int, float] = field(default_factory=dict)
    told_from_long: list[str] = field(default_factory=list)


def row_of(
    peer: Peer, take: Measurements, quick: bool, threads: list[int]
) -> Row | None:
    """Measures a peer on every work."""
    row = Row(peer.name, peer.fixed_step)
    settings = thinned(peer.settings) if quick else peer.settings
    for setting in settings or (None,):
        found = take.of(peer, "first", setting, 0.1 if quick else 0.5)
        if found and found["error"] == found["error"]:
            row.ladder.append(
                {
                    "setting": setting,
                    "error": found["error"],
                    "seconds": found["seconds"],
                }
            )
    if not row.ladder:
        return None
    chosen = choice(row.ladder)
    row.setting, row.error = chosen["setting"], chosen["error"]
    row.first_seconds = chosen["seconds"]
    budget = 0.4 if quick else 3.0
    long = take.of(peer, "long", row.setting, budget)
    if not long or not long["periods"]:
        return row
    row.periods_per_second = long["periods"] / long["seconds"]
    for work, seconds in (
        ("sweep", row.sweep_seconds),
        ("basin", row.basin_seconds),
    ):
        # A single run would take much longer than it is given.
        if PERIODS[work] / row.periods_per_second > 2 * budget:
            seconds[1] = RUNS[work] * PERIODS[work] / row.periods_per_second
            row.told_from_long.append(work)
            continue
        for count in threads if peer.threads else [1]:
            found = take.of(peer, work, row.setting, budget, count)
            if found and found["runs"]:
                seconds[count] = found["seconds"] * RUNS[work] / found["runs"]
    return row


def choice(ladder: list[dict]) -> dict:
    """The cheapest setting that reaches the best target within reach."""
    for target in TARGETS:
        good = [rung for rung in ladder if rung["error"] <= target]
        if good:
            return min(good, key=lambda rung: rung["seconds"])
    return min(ladder, key=lambda rung: rung["error"])


def as_json(rows: list[Row]) -> list[dict]:
    return [asdict(row) for row in rows]
