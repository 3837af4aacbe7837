//! Figures in every output format.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use std::f64::consts::TAU;

use nanotap_figures::{
    Axis, Band, Bars, CategoryMap, Colour, Dash, Figure, FigureError, Heatmap, Legend, Line,
    Markers, Note, Panel, Points, Rule, Stems,
};
use proptest::prelude::*;

/// Width, height and RGB pixels of a PNG file.
fn decoded(bytes: &[u8]) -> (u32, u32, Vec<[u8; 3]>) {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().unwrap();
    let mut data = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut data).unwrap();
    assert_eq!(info.color_type, png::ColorType::Rgb);
    data.truncate(info.buffer_size());
    let pixels = data.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    (info.width, info.height, pixels)
}

fn rgb(c: Colour) -> [u8; 3] {
    [c.r, c.g, c.b]
}

fn wave(count: usize) -> Vec<(f64, f64)> {
    (0..count)
        .map(|i| i as f64 / (count - 1) as f64)
        .map(|t| (t, (TAU * t).sin()))
        .collect()
}

fn plain(layer: impl Into<nanotap_figures::Layer>) -> Panel {
    Panel::new(Axis::linear("x"), Axis::linear("y")).with(layer)
}

/// A group of an SVG file: from its opening to the closing of its panel.
fn group<'s>(svg: &'s str, class: &str) -> &'s str {
    let start = svg.find(&format!("<g class=\"{class}\"")).expect(class);
    let length = svg[start..].find("\n</g>").unwrap();
    &svg[start..start + length]
}

/// The data of the first path in a piece of SVG.
fn path_data(svg: &str) -> &str {
    let start = svg.find(" d=\"").unwrap() + 4;
    &svg[start..start + svg[start..].find('"').unwrap()]
}

fn pseudo_random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Every kind of layer at once.
fn everything() -> Figure {
    let grid = (0..30 * 20).map(|i| f64::from(i % 30));
    Figure::new(2, 2)
        .width(178.0)
        .height(120.0)
        .title("All <kinds> & more")
        .caption("A caption with $a_1$.")
        .with(
            Panel::new(Axis::linear("$τ$ / $T$").tight(), Axis::linear("$W$"))
                .with(Band::x([(0.2, 0.4)]).label("contact"))
                .with(Line::new(wave(5000)).label("tip"))
                .with(Rule::horizontal(0.0))
                .with(Note::arrow((0.5, 0.5), (0.25, 1.0)).text("peak")),
        )
        .with(
            Panel::new(Axis::linear("Ω"), Axis::linear("α₃")).with(Heatmap::new(
                30,
                20,
                grid,
                (2.0, 4.0),
                (0.0, 1.0),
                Axis::linear("amplitude"),
            )),
        )
        .with(
            Panel::new(Axis::linear("n"), Axis::log("harmonics"))
                .with(Stems::new([(1.0, 1.0), (2.0, 1e-3)]).label("stems"))
                .with(Bars::new(0.5, [(3.0, 1e-2)]).label("bars")),
        )
        .with(
            Panel::new(Axis::linear("a"), Axis::linear("b"))
                .with(
                    CategoryMap::new(2, 1, [Some(0), None], (0.0, 1.0), (0.0, 1.0))
                        .category("period 1"),
                )
                .with(Points::new(wave(10_000)).label("points"))
                .with(Markers::new([(0.5, 0.5)]).label("marker")),
        )
}

#[test]
fn every_word_is_in_the_svg() {
    let svg = everything().to_svg().unwrap();
    for word in [
        "τ / T",
        "W",
        "Ω",
        "α3",
        "amplitude",
        "harmonics",
        "contact",
        "tip",
        "peak",
        "stems",
        "bars",
        "period 1",
        "points",
        "marker",
        "(a)",
        "(d)",
        "All &lt;kinds&gt; &amp; more",
        "A caption with a1.",
        "10−3",
    ] {
        assert!(
            svg.contains(&format!("aria-label=\"{word}\"")),
            "{word} is missing"
        );
    }
    assert!(svg.contains("<title>All &lt;kinds&gt; &amp; more</title>"));
}

#[test]
fn svg_text_needs_no_fonts_and_references_are_defined_once() {
    let svg = everything().to_svg().unwrap();
    assert!(!svg.contains("<text") && !svg.contains("font-family"));
    let mut found = 0;
    for (marker, end) in [("xlink:href=\"#", '"'), ("url(#", ')')] {
        for part in svg.split(marker).skip(1) {
            let name = &part[..part.find(end).unwrap()];
            assert_eq!(svg.matches(&format!("id=\"{name}\"")).count(), 1, "{name}");
            found += 1;
        }
    }
    assert!(found > 100);
    assert_eq!(svg.matches("<g").count(), svg.matches("</g>").count());
}

#[test]
fn svgs_in_one_page_do_not_share_names() {
    let name = |figure: Figure| {
        let svg = figure.to_svg().unwrap();
        let start = svg.find("id=\"").unwrap() + 4;
        svg[start..start + 9].to_string()
    };
    assert_ne!(
        name(Figure::single(plain(Line::new(wave(10))))),
        name(Figure::single(plain(Line::new(wave(11)))))
    );
}

#[test]
fn few_points_are_drawn_one_by_one() {
    let svg = Figure::single(plain(Points::new(wave(123))))
        .to_svg()
        .unwrap();
    assert_eq!(path_data(group(&svg, "points")).matches('m').count(), 123);
    let svg = Figure::single(plain(Markers::new(wave(17))))
        .to_svg()
        .unwrap();
    assert_eq!(group(&svg, "markers").matches("<path").count(), 17);
}

#[test]
fn nan_and_infinity_leave_gaps() {
    let mut points = wave(100);
    points[20].1 = f64::NAN;
    points[60].0 = f64::INFINITY;
    let svg = Figure::single(plain(Line::new(points))).to_svg().unwrap();
    assert_eq!(path_data(group(&svg, "line")).matches('m').count(), 3);
    // On a logarithmic axis half of the wave cannot be shown.
    let panel = Panel::new(Axis::linear("x"), Axis::log("y")).with(Line::new(wave(100)));
    let svg = Figure::single(panel).to_svg().unwrap();
    assert_eq!(path_data(group(&svg, "line")).matches('m').count(), 1);
}

#[test]
fn long_lines_give_small_files() {
    let svg = Figure::single(plain(Line::new(wave(1_000_000))))
        .to_svg()
        .unwrap();
    assert!(svg.len() < 30_000, "{}", svg.len());
    // A trajectory that fills the panel cannot be thinned: pixels keep it small.
    let mut random = pseudo_random(1);
    let mut at = (0.0, 0.0);
    let wander = (0..60_000).map(|_| {
        at = (0.99 * at.0 + random() - 0.5, 0.99 * at.1 + random() - 0.5);
        at
    });
    let figure = Figure::single(plain(Line::new(wander).width(0.2)));
    let svg = figure.to_svg().unwrap();
    assert!(
        svg.contains("<image") && svg.len() < 500_000,
        "{}",
        svg.len()
    );
}

#[test]
fn all_of_very_many_bands_are_drawn() {
    let bands = (0..7000).map(|i| (f64::from(i), f64::from(i) + 0.5));
    let axis = |to: f64| Axis::linear("").range(0.0, to);
    let panel = Panel::new(axis(7000.0), axis(1.0))
        .with(Band::x(bands).colour(Colour::BLACK))
        .with(Markers::new([(0.0, 0.0)]));
    let figure = Figure::single(panel);
    let svg = figure.to_svg().unwrap();
    assert_eq!(path_data(group(&svg, "band")).matches('m').count(), 7000);
    // Half of the panel is shaded.
    let (width, height, pixels) = decoded(&figure.to_png(300.0).unwrap());
    let row = &pixels[(height / 2 * width) as usize..][..width as usize];
    let middle = &row[row.len() / 4..row.len() * 3 / 4];
    let mean = middle.iter().map(|p| f64::from(p[0])).sum::<f64>() / middle.len() as f64;
    assert!((mean / 255.0 - 0.5).abs() < 0.1, "{mean}");
}

#[test]
fn a_hundred_thousand_points_give_a_small_file() {
    let mut points = Vec::with_capacity(100_000);
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
    let figure = Figure::single(plain(Points::new(points).diameter(0.1)));
    let (svg, png, pdf) = (
        figure.to_svg().unwrap().len(),
        figure.to_png(300.0).unwrap().len(),
        figure.to_pdf().unwrap().len(),
    );
    assert!(
        svg < 500_000 && png < 500_000 && pdf < 500_000,
        "{svg} {png} {pdf}"
    );
}

#[test]
fn scattered_points_give_a_small_file() {
    // Data without structure do not compress: the hardest case.
    let mut random = pseudo_random(7);
    let points: Vec<(f64, f64)> = (0..100_000).map(|_| (random(), random())).collect();
    let figure = Figure::single(plain(Points::new(points).diameter(0.1)));
    let (svg, png) = (
        figure.to_svg().unwrap().len(),
        figure.to_png(300.0).unwrap().len(),
    );
    assert!(svg < 500_000 && png < 500_000, "{svg} {png}");
}

#[test]
fn pngs_have_the_requested_size_and_show_the_data() {
    let figure = Figure::single(plain(Line::new(wave(500))))
        .width(86.0)
        .height(60.0);
    for dpi in [72.0, 150.0, 300.0] {
        let (width, height, pixels) = decoded(&figure.to_png(dpi).unwrap());
        assert_eq!(f64::from(width), (86.0 / 25.4 * dpi).round());
        assert_eq!(f64::from(height), (60.0 / 25.4 * dpi).round());
        let blue = pixels.iter().filter(|p| **p == rgb(Colour::BLUE)).count();
        let white = pixels.iter().filter(|p| **p == [255; 3]).count();
        assert!(white > pixels.len() * 8 / 10 && white < pixels.len());
        assert!(dpi < 150.0 || blue > 500, "{blue} blue pixels at {dpi}");
    }
}

#[test]
fn a_heatmap_puts_each_cell_in_its_place() {
    // Category 1 in the corner of the largest x and smallest y: at the bottom right.
    let cells = (0..100).map(|i| Some(usize::from(i == 9)));
    let map = CategoryMap::new(10, 10, cells, (0.0, 1.0), (0.0, 1.0))
        .category_in("a", Colour::rgb(10, 200, 10))
        .category_in("b", Colour::rgb(200, 10, 200));
    let figure = |x: Axis| {
        let panel = Panel::new(x, Axis::linear(""))
            .with(map.clone())
            .legend(Legend::Hidden);
        decoded(&Figure::single(panel).to_png(300.0).unwrap())
    };
    let centre = |(width, _, pixels): (u32, u32, Vec<[u8; 3]>)| {
        let places: Vec<(f64, f64)> = pixels
            .iter()
            .enumerate()
            .filter(|(_, p)| **p == [200, 10, 200])
            .map(|(i, _)| ((i % width as usize) as f64, (i / width as usize) as f64))
            .collect();
        assert!(places.len() > 1000);
        let count = places.len() as f64;
        let rows = pixels.len() as f64 / f64::from(width);
        (
            places.iter().map(|p| p.0).sum::<f64>() / count / f64::from(width),
            places.iter().map(|p| p.1).sum::<f64>() / count / rows,
        )
    };
    let (x, y) = centre(figure(Axis::linear("")));
    assert!(x > 0.85 && y > 0.75, "{x} {y}");
    let (x, y) = centre(figure(Axis::linear("").range(1.0, 0.0)));
    assert!(x < 0.25 && y > 0.75, "{x} {y}");
}

#[test]
fn cells_without_a_number_are_white() {
    let values = [0.0, f64::NAN, 1.0];
    let map = Heatmap::new(3, 1, values, (0.0, 3.0), (0.0, 1.0), Axis::linear("z"));
    let panel = Panel::new(Axis::linear(""), Axis::linear("")).with(map);
    let (width, height, pixels) = decoded(&Figure::single(panel).to_png(300.0).unwrap());
    let row = &pixels[(height / 2 * width) as usize..][..width as usize];
    let map = nanotap_figures::Colourmap::Viridis;
    let count = |colour: [u8; 3]| row.iter().filter(|p| **p == colour).count();
    let (low, high, white) = (
        count(rgb(map.at(0.0))),
        count(rgb(map.at(1.0))),
        count([255; 3]),
    );
    assert!(
        low > 100 && low.abs_diff(high) <= 3 && white >= low,
        "{low} {high} {white}"
    );
}

#[test]
fn the_same_figure_gives_the_same_bytes() {
    let (a, b) = (everything(), everything());
    assert_eq!(a.to_svg().unwrap(), b.to_svg().unwrap());
    assert_eq!(a.to_png(150.0).unwrap(), b.to_png(150.0).unwrap());
    assert_eq!(a.to_pdf().unwrap(), b.to_pdf().unwrap());
}

#[test]
fn pdfs_have_one_page_of_the_figure_s_size() {
    let pdf = Figure::single(plain(Line::new(wave(50))))
        .width(86.0)
        .height(60.0)
        .to_pdf()
        .unwrap();
    let text = String::from_utf8_lossy(&pdf);
    assert!(text.starts_with("%PDF-1.") && text.trim_end().ends_with("%%EOF"));
    assert_eq!(text.matches("/Type /Page\n").count(), 1);
    // 86 mm and 60 mm in points of 1/72 inch.
    let media = &text[text.find("/MediaBox").unwrap()..][..40];
    assert!(
        media.contains("243.7") && media.contains("170.0"),
        "{media}"
    );
}

#[test]
fn panels_without_data_are_labelled() {
    let lines = [
        Figure::single(Panel::new(Axis::linear("x"), Axis::log("y"))),
        Figure::single(plain(Line::new([]))),
        Figure::single(plain(Points::new([(f64::NAN, 1.0)]))),
        Figure::single(
            Panel::new(Axis::linear("x"), Axis::log("y")).with(Line::new([(1.0, -1.0)])),
        ),
        Figure::single(plain(Heatmap::new(
            1,
            1,
            [f64::NAN],
            (0.0, 1.0),
            (0.0, 1.0),
            Axis::linear("z"),
        ))),
    ];
    for figure in lines {
        assert!(figure.to_svg().unwrap().contains("aria-label=\"no data\""));
        figure.to_png(100.0).unwrap();
        figure.to_pdf().unwrap();
    }
    assert!(!everything().to_svg().unwrap().contains("no data"));
}

#[test]
fn a_legend_never_hides_data() {
    // Noise fills the panel: the legend must go above it, and the panel makes space.
    let mut random = pseudo_random(3);
    let noise: Vec<(f64, f64)> = (0..5000).map(|_| (random(), random())).collect();
    let legend = |points: &[(f64, f64)]| {
        let svg = Figure::single(plain(Points::new(points.to_vec()).label("noise")))
            .to_svg()
            .unwrap();
        // Only a legend inside has a white background.
        group(&svg, "legend").contains("fill=\"#ffffff\"")
    };
    assert!(!legend(&noise));
    assert!(legend(
        &noise.iter().map(|p| (p.0, p.1 * p.0)).collect::<Vec<_>>()
    ));
}

#[test]
fn shared_axes_agree() {
    let panel = |to: f64| {
        Panel::new(Axis::linear("time").tight(), Axis::linear("y"))
            .with(Line::new([(0.0, 0.0), (to, 1.0)]))
    };
    let figure = Figure::new(2, 1)
        .height(90.0)
        .with(panel(1.0))
        .with(panel(2.0));
    let words = |svg: &str| svg.matches("role=\"text\" aria-label=\"time\"").count();
    assert_eq!(words(&figure.to_svg().unwrap()), 2);
    let svg = figure.share_x().to_svg().unwrap();
    assert_eq!(words(&svg), 1);
    // The first line ends half-way across its panel: its path is half as wide as the other's.
    let width = |piece: &str| -> f64 {
        let data = path_data(piece);
        let step = data.split('l').nth(1).unwrap();
        step.split(['-', ' ']).next().unwrap().parse().unwrap()
    };
    let second = svg.rfind("<g class=\"line\"").unwrap();
    assert!((2.0 * width(group(&svg, "line")) - width(&svg[second..])).abs() < 0.01);
}

#[test]
fn json_describes_the_whole_figure() {
    let figure = everything();
    let json = figure.to_json().unwrap();
    let read = Figure::from_json(&json).unwrap();
    assert_eq!(read.to_svg().unwrap(), figure.to_svg().unwrap());
    // All defaults of a figure are resolved, so that no other program has to do it.
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    for panel in value["panels"].as_array().unwrap() {
        assert!(panel["letter"].as_str().unwrap().starts_with('('));
        assert!(panel["x"]["range"]["fixed"].is_array(), "{}", panel["x"]);
        for layer in panel["layers"].as_array().unwrap() {
            let map = ["heatmap", "category-map"].contains(&layer["kind"].as_str().unwrap());
            assert!(map || layer["colour"].as_str().unwrap().starts_with('#'));
        }
    }
    // Gaps and open ends are preserved.
    let gaps = plain(Line::new([
        (0.0, 1.0),
        (f64::NAN, 2.0),
        (2.0, f64::NAN),
        (3.0, 0.0),
    ]))
    .with(Band::x([(f64::NEG_INFINITY, 1.0), (2.0, f64::INFINITY)]));
    let figure = Figure::single(gaps);
    let read = Figure::from_json(&figure.to_json().unwrap()).unwrap();
    assert_eq!(read.to_svg().unwrap(), figure.to_svg().unwrap());
    // A minimal description is enough.
    let short = r#"{"panels": [{"x": {"label": "t", "unit": "s"}, "layers":
        [{"kind": "line", "points": {"x": [0, 1], "y": [1, null]}, "width": 1}]}]}"#;
    let svg = Figure::from_json(short).unwrap().to_svg().unwrap();
    assert!(svg.contains("aria-label=\"t (s)\""));
    for wrong in [
        "",
        "{\"panels\": 3}",
        &short.replace("null", "null, 3"),
        &short.replace("line", "rope"),
    ] {
        let error = Figure::from_json(wrong).unwrap_err();
        assert!(matches!(error, FigureError::Json(_)), "{error}");
    }
}

#[test]
fn the_map_gives_the_position_of_each_value() {
    let log = Panel::new(
        Axis::linear("a").unit("nm").range(2.0, 4.0),
        Axis::log("b").range(1.0, 1e4),
    )
    .with(Markers::new([(3.5, 10.0)]).colour(Colour::rgb(1, 2, 3)))
    .title("title");
    let figure = Figure::new(1, 2)
        .width(178.0)
        .with(log)
        .with(plain(Line::new(wave(9))));
    let (svg, map) = figure.to_svg_with_map().unwrap();
    assert_eq!(svg, figure.to_svg().unwrap());
    assert_eq!(map.len(), 2);
    let panel = &map[0];
    assert_eq!(
        (panel.letter.as_str(), panel.title.as_str()),
        ("(a)", "title")
    );
    assert_eq!((panel.x.label.as_str(), panel.x.unit.as_str()), ("a", "nm"));
    // The marker's outline starts at its right end, 0.75 mm from its centre.
    let marker = &svg[svg.find("<g class=\"markers\"").unwrap()..];
    let data = path_data(marker).trim_start_matches('m');
    let end = data.find('c').unwrap();
    let at: Vec<f64> = data[..end].split(' ').map(|v| v.parse().unwrap()).collect();
    let along = |from: f64, to: f64, v: f64| (v - from) / (to - from);
    let x = panel.left + panel.width * along(panel.x.from, panel.x.to, 3.5);
    let y = panel.top + panel.height
        - panel.height * along(panel.y.from.ln(), panel.y.to.ln(), 10f64.ln());
    assert!(
        (at[0] - 0.75 - x).abs() < 2e-3 && (at[1] - y).abs() < 2e-3,
        "{at:?} {x} {y}"
    );
}

#[test]
fn rounding_is_not_magnified() {
    let labels = |axis: Axis, values: [f64; 3]| -> String {
        let points = values.into_iter().enumerate().map(|(i, v)| (i as f64, v));
        let panel = Panel::new(Axis::linear("x"), axis).with(Line::new(points));
        let svg = Figure::single(panel).to_svg().unwrap();
        group(&svg, "axis-y").to_owned()
    };
    // 3e-24 is rounding for an energy of natural size 1; the axis is that of 1.
    let zero = labels(Axis::linear("E").natural(1.0), [0.0, 3e-24, -1e-24]);
    assert!(
        zero.contains("\"0.5\"") && zero.contains("\"−0.5\""),
        "{zero}"
    );
    assert!(!zero.contains("×10"), "{zero}");
    // Without a natural size small numbers cannot be called rounding.
    assert!(labels(Axis::linear("E"), [0.0, 3e-24, -1e-24]).contains("×10"));
    // Data that are constant to rounding are drawn as constant.
    let flat = labels(Axis::linear("E"), [2.5, 2.5 + 4e-14, 2.5 - 4e-14]);
    assert!(flat.contains("\"2.50\"") && !flat.contains("×10"), "{flat}");
    // Data that are not rounding are drawn as they are.
    assert!(labels(Axis::linear("E").natural(1.0), [0.0, 2e-6, 1e-6]).contains("×10−6"));
}

#[test]
fn files_are_written_completely_or_not_at_all() {
    let folder = std::env::temp_dir().join(format!("nanotap-figures-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let figure = Figure::single(plain(Line::new(wave(50))));
    for (name, start) in [
        ("a.svg", &b"<svg"[..]),
        ("b.PNG", b"\x89PNG"),
        ("c.pdf", b"%PDF"),
    ] {
        figure.write(folder.join(name)).unwrap();
        assert!(std::fs::read(folder.join(name)).unwrap().starts_with(start));
    }
    assert_eq!(
        std::fs::read_dir(&folder).unwrap().count(),
        3,
        "something was left behind"
    );

    for name in ["figure", "figure.gif", ".svg"] {
        let error = figure.write(folder.join(name)).unwrap_err();
        assert!(matches!(error, FigureError::UnknownEnding { .. }));
        assert!(error.to_string().contains(".svg, .png or .pdf"), "{error}");
    }
    let error = figure.write(folder.join("nowhere/a.svg")).unwrap_err();
    assert!(matches!(error, FigureError::Write { .. }), "{error}");
    // A folder of that name cannot be replaced; no partly written file may remain.
    std::fs::create_dir(folder.join("folder.svg")).unwrap();
    assert!(figure.write(folder.join("folder.svg")).is_err());
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 4);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn invalid_figures_are_refused_with_a_reason() {
    let line = || plain(Line::new(wave(10)));
    let grid = |values: usize| {
        let cells = vec![0.0; values];
        Figure::single(plain(Heatmap::new(
            3,
            2,
            cells,
            (0.0, 1.0),
            (0.0, 1.0),
            Axis::linear("z"),
        )))
    };
    let cases: Vec<(Figure, &str)> = vec![
        (Figure::new(0, 3), "0 × 3"),
        (Figure::new(1, 1).with(line()).with(line()), "2 panels"),
        (Figure::new(usize::MAX, 2), "cells"),
        (Figure::single(line()).width(f64::NAN), "10 mm"),
        (Figure::single(line()).height(1e9), "2000 mm"),
        (Figure::single(line()).column_widths([1.0, 2.0]), "1 cells"),
        (Figure::single(line()).text_scale(0.0), "text scale"),
        (
            Figure::new(9, 9).width(80.0).height(60.0).with(line()),
            "larger",
        ),
        (
            Figure::single(plain(Line::new(wave(3)).width(-1.0))),
            "line width",
        ),
        (
            Figure::single(plain(Points::new(wave(3)).diameter(f64::INFINITY))),
            "diameter",
        ),
        (grid(5), "5 values"),
        (
            Figure::single(plain(
                CategoryMap::new(1, 1, [Some(1)], (0.0, 1.0), (0.0, 1.0)).category("a"),
            )),
            "category 1",
        ),
        (
            Figure::single(plain(
                CategoryMap::new(1, 1, [Some(0)], (1.0, 1.0), (0.0, 1.0)).category("a"),
            )),
            "differ",
        ),
        (
            Figure::single(Panel::new(
                Axis::log("x").range(-1.0, 1.0),
                Axis::linear("y"),
            )),
            "above zero",
        ),
    ];
    for (figure, words) in cases {
        let error = figure.to_svg().unwrap_err().to_string();
        assert!(error.contains(words), "{error:?} does not say {words:?}");
    }
    assert!(grid(6).to_svg().is_ok());
    for dpi in [0.0, -1.0, f64::NAN, 1e9] {
        let error = Figure::single(line()).to_png(dpi).unwrap_err();
        assert!(matches!(error, FigureError::Resolution { .. }));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// For any numbers a figure is drawn, and all its coordinates are numbers.
    #[test]
    fn no_numbers_break_a_figure(
        points in prop::collection::vec((any::<f64>(), any::<f64>()), 0..20),
        x_log: bool, y_log: bool, kind in 0..6usize
    ) {
        let axis = |log| if log { Axis::log("a") } else { Axis::linear("a") };
        let panel = Panel::new(axis(x_log), axis(y_log));
        let panel = match kind {
            0 => panel.with(Line::new(points).dash(Dash::Dashed).label("l")),
            1 => panel.with(Points::new(points).label("l")),
            2 => panel.with(Stems::new(points).label("l")),
            3 => panel.with(Bars::new(0.5, points).label("l")),
            4 => panel.with(Band::x(points.clone())).with(Line::new(points)),
            _ => panel
                .with(Rule::vertical(points.first().map_or(0.0, |p| p.0)))
                .with_all(points.iter().map(|p| Note::new(*p, "n")))
                .with(Markers::new(points)),
        };
        let figure = Figure::single(panel);
        let svg = figure.to_svg().unwrap();
        prop_assert!(!svg.contains("NaN") && !svg.contains("inf"));
        figure.to_png(50.0).unwrap();
        figure.to_pdf().unwrap();
    }
}
