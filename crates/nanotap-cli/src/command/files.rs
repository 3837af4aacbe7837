//! `nanotap files`: what the files of instruments hold.

use std::path::PathBuf;

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::figure::files::item_figure;
use nanotap::files::{FileContents, FileList, Which, item, list};

use crate::arguments::PlotArgument;
use crate::failure::Failure;
use crate::output::Output;
use crate::text_table::{Align, Table};
use crate::{number, page, style};

/// Most files that are listed with their notes and images.
const DETAILED: usize = 3;

/// List what the files of instruments hold.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// A file of any name, or a folder, which is listed with all its folders
    #[arg(value_name = "PATH", required = true)]
    paths: Vec<PathBuf>,

    #[command(flatten)]
    plot: PlotArgument,

    /// Draw this curve, counted from 0
    #[arg(long, value_name = "K", requires = "plot", group = "item")]
    curve: Option<usize>,

    /// Draw this image, counted from 0
    #[arg(long, value_name = "K", requires = "plot", group = "item")]
    image: Option<usize>,

    /// Draw this spectrum, counted from 0
    #[arg(long, value_name = "K", requires = "plot", group = "item")]
    spectrum: Option<usize>,
}

impl Arguments {
    fn which(&self) -> Which {
        let curve = self.curve.map(Which::Curve);
        let image = self.image.map(Which::Image);
        let spectrum = self.spectrum.map(Which::Spectrum);
        curve.or(image).or(spectrum).unwrap_or(Which::First)
    }
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    arguments.plot.check()?;
    if arguments.plot.plot.is_some() {
        let [path] = &arguments.paths[..] else {
            return Err(Failure::input(
                "`--plot` draws an item of one file",
                "name one file",
            ));
        };
        let item = item(path, arguments.which())?;
        arguments.plot.draw(|| item_figure(&item))?;
    }
    output.result(&list(&arguments.paths)?, text)
}

fn text(listed: &FileList) -> String {
    let mut table = Table::new([
        ("file", Align::Left),
        ("format", Align::Left),
        ("curves", Align::Right),
        ("grid", Align::Left),
        ("segments", Align::Left),
        ("distance", Align::Left),
        ("k", Align::Point),
        ("InvOLS", Align::Point),
        ("images", Align::Right),
        ("spectra", Align::Right),
    ]);
    for file in &listed.files {
        table.row(row(file));
    }
    let mut text = table.render();
    let is_detailed = listed.files.len() <= DETAILED;
    for file in &listed.files {
        if let Some(error) = &file.error {
            text.push_str(&page::paragraph(&format!(
                "{}: not read: {error}",
                file.path
            )));
        }
        if is_detailed {
            text.push_str(&details(file));
        }
    }
    if listed.others > 0 {
        let others = number::counted(listed.others, "other file", "other files");
        text.push_str(&page::paragraph(&format!("{others} of no known format")));
    }
    text
}

fn row(file: &FileContents) -> [String; 10] {
    let count = |count: usize| {
        if count == 0 {
            String::new()
        } else {
            count.to_string()
        }
    };
    let styles: Vec<&str> = file.segments.iter().map(|of| of.style.as_str()).collect();
    let source = file.distance_source.as_deref();
    let distance = file.distance.as_deref().zip(source);
    [
        file.path.clone(),
        file.format.clone().unwrap_or_else(|| "unknown".to_owned()),
        count(file.curve_count),
        file.grid
            .map_or_else(String::new, |[x, y]| format!("{x} × {y}")),
        styles.join(", "),
        distance.map_or_else(String::new, |(name, source)| format!("{name} ({source})")),
        file.spring_constant
            .map_or_else(String::new, |of| Kind::Stiffness.format(of)),
        file.sensitivity.map_or_else(String::new, |of| {
            format!("{} nm/V", number::significant(1e9 * of, 4))
        }),
        count(file.images.len()),
        count(file.spectra.len()),
    ]
}

/// Segments, images, spectra and notes of a file.
fn details(file: &FileContents) -> String {
    let mut text = format!("\n{}\n", style::bold(&file.path));
    let mut table = Table::new([
        ("", Align::Left),
        ("", Align::Right),
        ("", Align::Left),
        ("", Align::Left),
    ]);
    for segment in &file.segments {
        table.row([
            segment.style.clone(),
            number::counted(segment.points, "point", "points"),
            segment
                .duration
                .map_or_else(String::new, |of| Kind::Time.format(of)),
            segment.channels.join(", "),
        ]);
    }
    for image in &file.images {
        let [points, lines] = image.shape;
        let size = image.size.map_or_else(String::new, |[x, y]| {
            format!("{} × {}", Kind::Length.format(x), Kind::Length.format(y))
        });
        table.row([
            "image".to_owned(),
            format!("{points} × {lines}"),
            size,
            with_unit(&image.name, &image.unit),
        ]);
    }
    for spectrum in &file.spectra {
        let largest = spectrum
            .largest_frequency
            .map_or_else(String::new, |of| Kind::Frequency.format(of));
        let points = number::counted(spectrum.points, "point", "points");
        table.row([
            "spectrum".to_owned(),
            points,
            format!("to {largest}"),
            with_unit(&spectrum.name, &spectrum.unit),
        ]);
    }
    text.push_str(&table.render());
    for note in &file.notes {
        text.push_str(&page::paragraph(note));
    }
    text
}

fn with_unit(name: &str, unit: &str) -> String {
    if unit.is_empty() {
        name.to_owned()
    } else {
        format!("{name} ({unit})")
    }
}
