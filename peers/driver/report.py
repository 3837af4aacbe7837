"""The table, the plot and the machine-readable result."""

import json
from pathlib import Path

from .compare import Row, as_json

# Colours that are told apart with every kind of colour vision (Okabe and Ito).
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"]
MARKERS = "osD^vPX"
STYLES = ["-", "--", ":"]


def number(value: float | None) -> str:
    """Two significant digits below a hundred, three above."""
    if value is None:
        return "–"
    if value < 100:
        return f"{value:.2g}"
    return f"{round(value, 3 - len(str(int(value)))):,.0f}"


def error(value: float | None) -> str:
    return "–" if value is None else f"{value:.0e}".replace("e-0", "e-")


def table(rows: list[Row], threads: list[int]) -> str:
    """A Markdown table."""
    head = ["program", "setting", "error", "20 periods, ms", "periods per second"]
    for work in ("sweep", "basin"):
        head += [f"{work}, s" + (f" ({n} threads)" if n > 1 else "") for n in threads]
    lines = [" | ".join(["", *head, ""]).strip()]
    lines.append("|" + "---|" * 2 + "---:|" * (len(head) - 2))
    for row in rows:
        unit = " steps" if row.fixed_step else ""
        setting = "–" if row.setting is None else f"{row.setting:g}{unit}"
        cells = [
            f"**{row.name}**" if row.name.startswith("nanotap") else row.name,
            setting,
            error(row.error),
            number(row.first_seconds and 1e3 * row.first_seconds),
            number(row.periods_per_second),
        ]
        for work, seconds in (
            ("sweep", row.sweep_seconds),
            ("basin", row.basin_seconds),
        ):
            mark = " ¹" if work in row.told_from_long else ""
            cells += [
                number(seconds[n]) + mark if n in seconds else "–" for n in threads
            ]
        lines.append(" | ".join(["", *cells, ""]).strip())
    return "\n".join(lines)


def law_table(rows: list[dict]) -> list[str]:
    """The section on a nonlinear law."""
    if not rows:
        return []
    lines = [
        "## A nonlinear law",
        "",
        "A lever with N modes over a DMT sample with van der Waals attraction (the reference case of",
        "`docs/cases/dforce.md`: 20 nm free amplitude, 18 nm above the sample), from one initial state.",
        "The error is the largest in any entry of the state after 5, 10 and 20 periods, in nm, relative",
        "to heyoka with the finest setting. Each program is listed with its fastest setting whose error is",
        "at most 1e-9 nm, or with its most accurate one. heyoka enters contact slightly inside the",
        "surface, since the root of the indentation has no Taylor series at zero.",
        "",
        "| modes | program | tolerance | error | periods per second |",
        "|---:|---|---:|---:|---:|",
    ]
    for row in rows:
        name = row["name"]
        cells = [
            str(row["modes"]),
            f"**{name}**" if name == "nanotap" else name,
            f"{row['setting']:g}",
            error(row["error"]),
            number(row["rate"]),
        ]
        lines.append(" | ".join(["", *cells, ""]).strip())
    return [*lines, ""]


def page(result: dict, rows: list[Row], threads: list[int], plot: bool) -> str:
    """The Markdown page."""
    machine, versions = result["machine"], result["versions"]
    vectors = machine["vector_registers"]
    lines = [
        "# Comparison with general solvers",
        "",
        "<!-- Written by `cargo xtask peers`; edit peers/driver/report.py instead. -->",
        "",
        "nanotap and general-purpose solvers on the same tasks, measured in one run of",
        "`cargo xtask peers` (`peers/README.md` lists the programs and the rules). Every",
        "task is the paper's cantilever with three modes, α1 = 0.1:",
        "",
        "- **20 periods**: the first 20 drive periods from rest at Ω = 2.6, 46 switches.",
        "  The error is the largest in any entry of the state after 5, 10 and 20 periods,",
        "  relative to a 50-digit reference. The motion is chaotic: errors grow by a",
        "  factor of 240 in 20 periods.",
        "- **periods per second**: as many of 2000 such periods as fit into the time limit.",
        "- **sweep**: 400 values of Ω from 2 to 4, 8 initial states each, 500 periods per",
        "  run, the states of the last 100 recorded: 1.6 million periods.",
        "- **basin**: 200 by 200 initial states at Ω = 2.6, 300 periods each: 12 million",
        "  periods.",
        "",
        "Each program is listed with its fastest setting whose error is at most 1e-9; if",
        "none reaches that, at most 1e-6; otherwise with its most accurate setting. Sweeps",
        "and basins are extrapolated from evenly spread samples. Times are processor time",
        "on one thread and wall time on several (a dash where other programs kept the",
        "machine busy), without compilation and start-up.",
        "",
        table(rows, threads),
        "",
    ]
    if any(row.told_from_long for row in rows):
        lines += [
            "¹ computed from the periods per second: a single run exceeded the time limit.",
            "",
        ]
    if plot:
        lines += ["![Error against time](peers.svg)", ""]
    lines += law_table(result["laws"])
    lines += [
        "## Machine and versions",
        "",
        f"{machine['processor']}, {machine['cores']} cores"
        + (f", {vectors}" if vectors else "")
        + f", {machine['system']}. "
        + ", ".join(f"{name} {version}" for name, version in versions.items())
        + ".",
        "",
    ]
    if result["missing"]:
        lines += ["Left out, because this machine lacks something:", ""]
        lines += [f"- {name}: {why}" for name, why in result["missing"].items()]
        lines.append("")
    return "\n".join(lines)


def draw(rows: list[Row], path: Path) -> bool:
    """The plot of error against time; False where nothing was measured, or can draw."""
    if not rows:
        return False
    try:
        import matplotlib
    except ImportError:
        return False
    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    # The same measurements give the same bytes.
    plt.rcParams.update({"svg.hashsalt": "peers", "font.size": 8})
    figure, axes = plt.subplots(figsize=(7.2, 4.4), layout="constrained")
    others = 0
    for row in rows:
        times = [1e3 * rung["seconds"] for rung in row.ladder]
        errors = [rung["error"] for rung in row.ladder]
        if row.name.startswith("nanotap"):
            # One at a time filled, several side by side hollow.
            face = "none" if "ensemble" in row.name else "black"
            axes.plot(
                times,
                errors,
                "k*",
                markersize=13,
                markerfacecolor=face,
                label=row.name,
                zorder=3,
            )
            continue
        # Neither colour with marker nor colour with line comes twice.
        turn = others // len(COLOURS)
        axes.plot(
            times,
            errors,
            color=COLOURS[others % len(COLOURS)],
            marker=MARKERS[(others + turn) % len(MARKERS)],
            linestyle=STYLES[turn],
            markersize=4,
            linewidth=1,
            label=row.name,
        )
        others += 1
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="time for the first 20 drive periods (ms)",
        ylabel="largest error of the state",
    )
    axes.grid(which="major", linewidth=0.3, color="#cccccc")
    figure.legend(loc="outside right upper", frameon=False)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)
    return True


def write(result: dict, rows: list[Row], threads: list[int], to: Path) -> None:
    """Everything into one folder."""
    to.mkdir(parents=True, exist_ok=True)
    plot = draw(rows, to / "peers.svg")
    result = {**result, "rows": as_json(rows)}
    (to / "peers.json").write_text(json.dumps(result, indent=1) + "\n")
    (to / "peers.md").write_text(page(result, rows, threads, plot))
    print(table(rows, threads))
    print(f"\nwritten: {to / 'peers.md'}" + ("" if plot else " (no plot)"))
