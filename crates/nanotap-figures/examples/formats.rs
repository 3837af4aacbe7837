//! Draws typical figures in every format and prints the time and the size of each: `cargo run
//! --release -p nanotap-figures --example formats FOLDER`.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use std::error::Error;
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::time::Instant;

use nanotap_figures::{
    Axis, Band, Bars, CategoryMap, Colour, DOUBLE_COLUMN, Dash, Figure, Heatmap, Legend, Line,
    Markers, Note, Panel, Points, Rule, Shape, Stems,
};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "formats".into()));
    std::fs::create_dir_all(&folder)?;
    println!("figure        format    ms      bytes");
    for (name, figure) in [
        ("typical", typical()),
        ("cloud", cloud()),
        ("scatter", scatter()),
        ("maps", maps()),
        ("trajectory", trajectory()),
    ] {
        for ending in ["svg", "png", "pdf"] {
            let start = Instant::now();
            let path = folder.join(name).with_extension(ending);
            figure.write(&path)?;
            let took = start.elapsed().as_secs_f64() * 1e3;
            println!(
                "{name:13} {ending} {took:9.1} {:10}",
                std::fs::metadata(&path)?.len()
            );
        }
    }
    Ok(())
}

/// Time series with contacts, phase portrait, harmonics, multipliers.
fn typical() -> Figure {
    let tip = |t: f64| (TAU * t).cos() + 0.05 * (17.0 * TAU * t).sin();
    let rate = |t: f64| -TAU * (TAU * t).sin() + 0.05 * 17.0 * TAU * (17.0 * TAU * t).cos();
    let time = || (0..=4000).map(|i| f64::from(i) / 1000.0);
    let circle = (0..=360).map(|d| {
        (
            f64::from(d).to_radians().cos(),
            f64::from(d).to_radians().sin(),
        )
    });
    Figure::new(2, 2)
        .width(DOUBLE_COLUMN)
        .height(136.0)
        .column_widths([1.7, 1.0])
        .with(
            Panel::new(
                Axis::linear("time $τ / T$ (drive periods)").tight(),
                Axis::linear("tip deflection $W$"),
            )
            .title("period 1, stable")
            .legend(Legend::Above)
            .with(
                Band::x((0..4).map(|k| (f64::from(k) + 0.4, f64::from(k) + 0.6))).label("contact"),
            )
            .with(
                Line::new(time().map(|t| (t, -0.8)))
                    .colour(Colour::GREY)
                    .dash(Dash::Dashed)
                    .width(0.6)
                    .label("sample"),
            )
            .with(
                Line::new(time().map(|t| (t, tip(t))))
                    .colour(Colour::BLUE)
                    .label("tip"),
            ),
        )
        .with(
            Panel::new(
                Axis::linear("tip deflection $W$"),
                Axis::linear("tip velocity $dW/dτ$"),
            )
            .legend(Legend::Above)
            .with(Line::new(time().map(|t| (tip(t), rate(t)))).colour(Colour::BLUE))
            .with(
                Markers::new([(tip(0.0), rate(0.0))])
                    .colour(Colour::VERMILLION)
                    .label("at drive phase 0"),
            ),
        )
        .with(
            Panel::new(
                Axis::linear("frequency / $Ω$").range(0.0, 20.5),
                Axis::log("amplitude $|Ŵ_n|$"),
            )
            .with(
                Stems::new((1..=20).map(|n| (f64::from(n), (-f64::from(n)).exp())))
                    .colour(Colour::BLUE),
            ),
        )
        .with(
            Panel::new(
                Axis::linear("Re $μ$").range(-1.2, 1.2),
                Axis::linear("Im $μ$").range(-1.2, 1.2),
            )
            .with(Line::new(circle).colour(Colour::GREY).width(0.6))
            .with(Markers::new([(0.5, 0.3), (0.5, -0.3), (0.1, 0.0)]).colour(Colour::BLUE))
            .with(
                Markers::new([(-1.1, 0.0)])
                    .shape(Shape::Diamond)
                    .colour(Colour::VERMILLION),
            ),
        )
}

/// A bifurcation diagram of 100,000 points.
fn cloud() -> Figure {
    let mut points = Vec::new();
    for column in 0..1000 {
        let r = 3.5 + 0.5 * f64::from(column) / 1000.0;
        let mut x = 0.3;
        for step in 0..150 {
            x = r * x * (1.0 - x);
            if step >= 50 {
                points.push((r, x));
            }
        }
    }
    Figure::single(
        Panel::new(
            Axis::linear("parameter $r$").tight(),
            Axis::linear("max $W$ in a drive period"),
        )
        .legend(Legend::Above)
        .with(Points::new(points).diameter(0.13).label("chaotic")),
    )
    .width(DOUBLE_COLUMN)
}

/// 100,000 points without structure, translucent.
fn scatter() -> Figure {
    let mut state = 7_u64;
    let mut random = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let points: Vec<_> = (0..100_000)
        .map(|_| ((TAU * random()).cos() * random(), random()))
        .collect();
    Figure::single(
        Panel::new(Axis::linear("$x$"), Axis::linear("$y$")).with(
            Points::new(points)
                .diameter(0.2)
                .colour(Colour::BLUE.alpha(0.3)),
        ),
    )
}

/// A heatmap, categories, bars and notes.
fn maps() -> Figure {
    let grid = (0..120 * 80).map(|i| (f64::from(i % 120) / 20.0).sin() * f64::from(i / 120));
    let cells = (0..200 * 200).map(|i| {
        let (x, y) = (
            f64::from(i % 200) / 100.0 - 1.0,
            f64::from(i / 200) / 100.0 - 1.0,
        );
        Some(((x * x - y * y + 0.3 * (9.0 * x * y).sin()) * 3.0).abs() as usize % 4)
    });
    Figure::new(1, 2)
        .width(DOUBLE_COLUMN)
        .with(
            Panel::new(Axis::linear("Ω"), Axis::linear("α₃")).with(Heatmap::new(
                120,
                80,
                grid,
                (2.0, 4.0),
                (0.0, 1.0),
                Axis::linear("amplitude"),
            )),
        )
        .with(
            Panel::new(Axis::linear("$a_1$"), Axis::linear("$a_2$"))
                .legend(Legend::Right)
                .with(
                    CategoryMap::new(200, 200, cells, (-1.0, 1.0), (-1.0, 1.0))
                        .category("period 1")
                        .category("period 2")
                        .category("period 4")
                        .category("chaotic"),
                )
                .with(Markers::new([(0.5, 0.5)]).white_edge().colour(Colour::BLUE))
                .with(Bars::new(0.05, [(0.0, 0.2)]).label("bar"))
                .with(Rule::horizontal(0.0))
                .with(Note::arrow((0.2, 0.4), (0.5, 0.5)).text("here")),
        )
}

/// A line of 100,000 points that fills its panel.
fn trajectory() -> Figure {
    let line = (0..100_000).map(|i| {
        let t = f64::from(i) / 50.0;
        (
            (1.37 * t).sin() + 0.2 * (11.1 * t).sin(),
            (t * 1.37).cos() + 0.3 * (7.3 * t).cos(),
        )
    });
    Figure::single(
        Panel::new(Axis::linear("$W$"), Axis::linear("$Ẇ$")).with(Line::new(line).width(0.25)),
    )
}
