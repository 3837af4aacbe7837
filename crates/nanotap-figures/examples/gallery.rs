//! Draws one figure of every kind: `cargo run -p nanotap-figures --example gallery [folder]`.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use std::f64::consts::{PI, TAU};
use std::path::PathBuf;

use nanotap_figures::{
    Axis, Band, Bars, CategoryMap, Colour, Colourmap, DOUBLE_COLUMN, Dash, Figure, FigureError,
    Heatmap, Legend, Line, Markers, Note, Panel, Place, Points, Rule, Shape, Side, Stems,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args()
        .nth(1)
        .map_or_else(|| PathBuf::from("gallery"), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    for (name, figure) in figures() {
        for ending in ["svg", "png", "pdf"] {
            figure.write(folder.join(format!("{name}.{ending}")))?;
        }
    }
    // A figure that cannot be drawn is refused with a reason.
    if let Err(FigureError::UnknownEnding { path }) = bifurcation().write(folder.join("figure.gif"))
    {
        println!("{} was refused as it should be", path.display());
    }
    Ok(())
}

fn figures() -> Vec<(&'static str, Figure)> {
    vec![
        ("time-series", time_series()),
        ("bifurcation", bifurcation()),
        ("basin", basin()),
        ("heatmap", heatmap()),
        ("harmonics", harmonics()),
        ("convergence", convergence()),
        ("four-panels", four_panels()),
        ("stacked", stacked()),
        ("extreme_input", extreme_input()),
    ]
}

/// Samples of a function.
fn sampled(from: f64, to: f64, count: usize, f: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    (0..count)
        .map(|i| from + (to - from) * i as f64 / (count - 1) as f64)
        .map(|x| (x, f(x)))
        .collect()
}

/// A motion that looks like tapping: a fundamental, a harmonic and a ringing after each contact.
fn deflection(t: f64) -> f64 {
    let phase = t.rem_euclid(1.0);
    0.8 * (TAU * t).sin()
        + 0.12 * (-6.0 * phase).exp() * (TAU * 6.0 * phase).sin()
        + 0.1 * (2.0 * TAU * t).cos()
}

fn velocity(t: f64) -> f64 {
    let h = 1e-5;
    (deflection(t + h) - deflection(t - h)) / (2.0 * h)
}

/// Intervals in which a function is at most zero.
fn below_zero(samples: &[(f64, f64)], level: f64) -> Vec<(f64, f64)> {
    let mut intervals = Vec::new();
    let mut start = None;
    for &(t, v) in samples {
        match (v <= level, start) {
            (true, None) => start = Some(t),
            (false, Some(from)) => {
                intervals.push((from, t));
                start = None;
            }
            _ => {}
        }
    }
    intervals.extend(start.zip(samples.last()).map(|(from, last)| (from, last.0)));
    intervals
}

fn time_series() -> Figure {
    let samples = sampled(0.0, 4.0, 40_001, deflection);
    let contact = below_zero(&samples, -0.6);
    let drive = sampled(0.0, 4.0, 2001, |t| -0.35 * (TAU * t).cos());
    let orbit = (0..=4000)
        .map(|i| f64::from(i) / 4000.0)
        .map(|t| (deflection(t), velocity(t)));
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .height(62.0)
        .column_widths([1.7, 1.0])
        .with(
            Panel::new(
                Axis::linear("$τ$ / $T$").tight(),
                Axis::linear("tip deflection $W$"),
            )
            .with(Band::x(contact).label("contact"))
            .with(Line::new(samples).label("tip"))
            .with(Line::new(drive).dash(Dash::Dashed).label("base"))
            .with(
                Rule::horizontal(-0.6)
                    .dash(Dash::Dotted)
                    .label("sample surface"),
            ),
        )
        .with(
            Panel::new(Axis::linear("$W$"), Axis::linear("$Ẇ$"))
                .with(Band::x([(f64::NEG_INFINITY, -0.6)]))
                .with(Line::new(orbit))
                .with(
                    Markers::new([(deflection(0.0), velocity(0.0))])
                        .colour(Colour::VERMILLION)
                        .label("stroboscopic point"),
                ),
        )
}

/// 100,000 points of the logistic map, a well-known bifurcation diagram.
fn bifurcation() -> Figure {
    let mut points = Vec::with_capacity(100_000);
    for i in 0..500 {
        let r = 2.8 + 1.2 * f64::from(i) / 499.0;
        let mut x = 0.4;
        for step in 0..700 {
            x = r * x * (1.0 - x);
            if step >= 500 {
                points.push((r, x));
            }
        }
    }
    let branch = |from: f64, to: f64| sampled(from, to, 200, |r| 1.0 - 1.0 / r);
    let fork = (3.0, 1.0 - 1.0 / 3.0);
    Figure::single(
        Panel::new(
            Axis::linear("$Ω$").tight(),
            Axis::linear("stroboscopic $a_1$"),
        )
        .with(
            Points::new(points)
                .diameter(0.16)
                .colour(Colour::BLACK)
                .label("attractors"),
        )
        .with(
            Line::new(branch(2.8, 3.0))
                .colour(Colour::BLUE)
                .label("stable"),
        )
        .with(
            Line::new(branch(3.0, 4.0))
                .colour(Colour::VERMILLION)
                .dash(Dash::Dashed)
                .label("unstable"),
        )
        .with(
            Markers::new([fork])
                .shape(Shape::Diamond)
                .open()
                .colour(Colour::VERMILLION)
                .label("flip"),
        )
        .with(
            Note::arrow((3.1, 0.9), (fork.0 + 0.01, fork.1 + 0.03))
                .text("period doubling")
                .side(Side::Above),
        ),
    )
}

/// Basins of Newton's method for z³ = 1: fractal, with known attractors.
fn basin() -> Figure {
    let roots = [(1.0, 0.0), (-0.5, 0.75f64.sqrt()), (-0.5, -0.75f64.sqrt())];
    let mut cells = Vec::with_capacity(160_000);
    for row in 0..400 {
        for column in 0..400 {
            let (mut x, mut y) = (
                -2.0 + 4.0 * (f64::from(column) + 0.5) / 400.0,
                -2.0 + 4.0 * (f64::from(row) + 0.5) / 400.0,
            );
            for _ in 0..12 {
                let (x2, y2) = (x * x - y * y, 2.0 * x * y);
                let size = x2 * x2 + y2 * y2;
                (x, y) = ((2.0 * x + x2 / size) / 3.0, (2.0 * y - y2 / size) / 3.0);
            }
            let found = roots.iter().position(|r| (r.0 - x).hypot(r.1 - y) < 0.05);
            cells.push(Some(found.unwrap_or(3)));
        }
    }
    let map = CategoryMap::new(400, 400, cells, (-2.0, 2.0), (-2.0, 2.0))
        .category("period 1, $W_{max}$ = 0.74")
        .category("period 4")
        .category("period 1, high")
        .category_in("undecided", Colour::GREY);
    Figure::single(
        Panel::new(Axis::linear("$a_1$"), Axis::linear("$\u{227}_1$"))
            .with(map)
            .with(
                Markers::new(roots)
                    .colour(Colour::BLACK)
                    .white_edge()
                    .label("attractor"),
            ),
    )
    .height(84.0)
}

fn heatmap() -> Figure {
    let (columns, rows) = (240, 160);
    let values = (0..rows).flat_map(move |row| {
        (0..columns).map(move |column| {
            let x = 2.0 + 2.0 * (f64::from(column) + 0.5) / f64::from(columns);
            let y = 0.4 * (f64::from(row) + 0.5) / f64::from(rows);
            let value = (-(x - 2.9 - y).powi(2) * 8.0).exp() * (1.0 - y)
                + 0.2 * (12.0 * x * y).sin().powi(2);
            // A corner that was not computed.
            if x > 3.6 && y < 0.05 { f64::NAN } else { value }
        })
    });
    let scale = Axis::linear("amplitude $(W_{max} - W_{min})/2$");
    Figure::single(
        Panel::new(Axis::linear("$Ω$"), Axis::linear("$α_3$"))
            .with(Heatmap::new(
                columns as usize,
                rows as usize,
                values,
                (2.0, 4.0),
                (0.0, 0.4),
                scale,
            ))
            .with(
                Line::new(sampled(2.6, 3.3, 50, |x| x - 2.9))
                    .colour(Colour::WHITE)
                    .dash(Dash::Dashed)
                    .width(1.2),
            )
            .with(Note::new((2.15, 0.36), "period 1").colour(Colour::BLACK)),
    )
}

fn harmonics() -> Figure {
    let stems = (1..=20).map(|n| {
        let n = f64::from(n);
        (
            n,
            0.8 * (-0.45 * n).exp() * (1.0 + 0.9 * (n * 1.3).sin()) + 1e-5,
        )
    });
    Figure::single(
        Panel::new(
            Axis::linear("harmonic $n$ of $Ω$"),
            Axis::log("$|Ŵ_n|$").range(1e-6, 2.0),
        )
        .with(Stems::new(stems).label("steady state"))
        .with(Rule::horizontal(1e-5).label("noise of the detector")),
    )
}

fn convergence() -> Figure {
    let steps: Vec<f64> = (4..=13).map(|k| 2f64.powi(-k)).collect();
    let series = |scale: f64, order: f64, floor: f64| {
        steps
            .iter()
            .map(move |h| (*h, scale * h.powf(order) + floor))
            .collect::<Vec<_>>()
    };
    let rk4 = series(3.0, 4.0, 1e-15);
    let events = series(0.4, 1.0, 0.0);
    Figure::single(
        Panel::new(
            Axis::log("time step $Δτ$ / $T$"),
            Axis::log("error of the state"),
        )
        .with(Line::new(rk4.clone()).label("RK4, no contact"))
        .with(Line::new(events.clone()).label("RK4, switching on the grid"))
        .with(Rule::horizontal(2e-14).label("exact flow"))
        .with(Markers::new(rk4).colour(Colour::BLUE))
        .with(
            Markers::new(events)
                .shape(Shape::Square)
                .colour(Colour::VERMILLION),
        )
        .with(Note::new((2e-3, 1.2e-9), "slope 4").side(Side::Left))
        .with(Note::new((2e-3, 2.4e-4), "slope 1").side(Side::Below)),
    )
}

fn four_panels() -> Figure {
    let power = sampled(0.5, 5.0, 800, |w| {
        1.0 / ((1.0 - w * w).powi(2) + (0.1 * w).powi(2)).sqrt()
    });
    let phase = sampled(0.5, 5.0, 800, |w| (0.1 * w).atan2(1.0 - w * w) * 180.0 / PI);
    let lyapunov = sampled(2.0, 4.0, 400, |w| {
        0.3 * (3.0 * w).sin() - 0.1 * w + 0.2 * (17.0 * w).cos()
    });
    let chaos = {
        let (mut x, mut y) = (0.1, 0.1);
        (0..60_000)
            .map(|_| {
                (x, y) = (1.0 - 1.4 * x * x + y, 0.3 * x);
                (x, y)
            })
            .collect::<Vec<_>>()
    };
    Figure::new(2, 2)
        .width(DOUBLE_COLUMN)
        .height(118.0)
        .with(
            Panel::new(Axis::log("$Ω$ / $Ω_1$"), Axis::log("amplitude (nm)"))
                .with(Line::new(power.iter().map(|p| (p.0, 10.0 * p.1))).label("free"))
                .with(
                    Line::new(power.iter().map(|p| (1.3 * p.0, 3.0 * p.1.sqrt())))
                        .label("in contact"),
                ),
        )
        .with(
            Panel::new(
                Axis::linear("$Ω$ / $Ω_1$"),
                Axis::linear("phase (°)")
                    .marks([0.0, 45.0, 90.0, 135.0, 180.0].map(|d| (d, format!("{d}")))),
            )
            .with(Line::new(phase))
            .with(Rule::horizontal(90.0)),
        )
        .with(
            Panel::new(
                Axis::linear("$Ω$").tight(),
                Axis::linear("$λ_1$ per period"),
            )
            .with(
                Band::y([(0.0, f64::INFINITY)])
                    .colour(Colour::rgb(252, 231, 219))
                    .label("chaotic"),
            )
            .with(Line::new(lyapunov))
            .with(Rule::horizontal(0.0)),
        )
        .with(
            Panel::new(Axis::linear("$a_1$"), Axis::linear("$a_2$"))
                .with(Points::new(chaos).diameter(0.1).colour(Colour::BLUE))
                .with(Note::new(
                    Place::Panel(0.03, 0.5),
                    "$λ_1$ = 0.42 per period",
                )),
        )
}

fn stacked() -> Figure {
    let free = |t: f64| 2e-4 * (TAU * t).sin() + 3e-5 * (7.0 * TAU * t).sin();
    Figure::new(3, 1)
        .height(95.0)
        .share_x()
        .title("One run, three views")
        .caption(
            "Three signals of the same run over the same time. The second is small: its labels carry a \
             common factor. The third has a gap where nothing was recorded, $0.8 < τ/T < 1.1$.",
        )
        .with(
            Panel::new(Axis::linear("$τ$ / $T$").tight(), Axis::linear("$W$"))
                .with(Line::new(sampled(0.0, 3.0, 5000, deflection))),
        )
        .with(
            Panel::new(Axis::linear("$τ$ / $T$").tight(), Axis::linear("$a_3$"))
                .with(Line::new(sampled(0.0, 3.0, 5000, free)).colour(Colour::VERMILLION)),
        )
        .with(
            Panel::new(Axis::linear("$τ$ / $T$").tight(), Axis::linear("$F$ (nN)"))
                .with(
                    Line::new(sampled(0.0, 3.0, 5000, |t| {
                        if (0.8..1.1).contains(&t) {
                            f64::NAN
                        } else {
                            25.0 * (-0.6 - deflection(t)).max(0.0)
                        }
                    }))
                    .colour(Colour::GREEN),
                ),
        )
}

/// Input that breaks plotting programs.
fn extreme_input() -> Figure {
    Figure::new(2, 3)
        .width(DOUBLE_COLUMN)
        .height(100.0)
        .with(Panel::new(Axis::linear("nothing"), Axis::linear("at all")).title("no data"))
        .with(
            Panel::new(Axis::linear("$Ω$"), Axis::linear("$a_1$"))
                .title("one point")
                .with(Markers::new([(2.6, 0.0)])),
        )
        .with(
            Panel::new(Axis::linear("$Ω$"), Axis::linear("energy (J)"))
                .title("narrow range, large offset")
                .with(Line::new(sampled(2.505_040_6, 2.505_040_9, 50, |w| {
                    3e-17 * (w - 2.505_040_7)
                }))),
        )
        .with(
            Panel::new(Axis::log("$α_4$"), Axis::log("$|W|$"))
                .title("less than a decade")
                .with(Line::new(sampled(18.7, 23.4, 50, |a| 2.0 + a / 10.0))),
        )
        .with(
            Panel::new(
                Axis::linear("distance $z_c$ (nm)").range(30.0, 0.0),
                Axis::linear("amplitude (nm)"),
            )
            .title("backwards axis")
            .legend(Legend::Right)
            .with(Line::new(sampled(0.0, 30.0, 100, |z| z.min(20.0))).label("in"))
            .with(
                Line::new(sampled(0.0, 30.0, 100, |z| (z * 0.95).min(20.0)))
                    .dash(Dash::Dotted)
                    .label("out"),
            ),
        )
        .with(
            Panel::new(
                Axis::linear("modes $N$").range(0.0, 6.0),
                Axis::linear("share (%)").range(-12.0, 100.0),
            )
            .title("bars and a diverging map")
            .with(
                Heatmap::new(
                    40,
                    1,
                    (0..40).map(|i| f64::from(i) / 20.0 - 1.0),
                    (0.0, 6.0),
                    (-12.0, -4.0),
                    Axis::linear("$λ$").range(-1.0, 1.0),
                )
                .colourmap(Colourmap::Diverging),
            )
            .with(
                Bars::new(
                    0.7,
                    [(1.0, 81.0), (2.0, 12.0), (3.0, 5.0), (4.0, 1.5), (5.0, 0.5)],
                )
                .label("of the energy"),
            ),
        )
}
