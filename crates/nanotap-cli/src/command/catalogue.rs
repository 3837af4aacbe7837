//! `nanotap catalogue`: the levers and materials that a case can name.

use std::path::PathBuf;

use clap::Args;
use nanotap::case::Key;
use nanotap::case::physical::catalogue::{Lever, Material};
use nanotap::case::physical::{Catalogue, Kind};
use schemars::JsonSchema;
use serde::Serialize;

use crate::failure::Failure;
use crate::output::Output;
use crate::text_table::{Align, Table};
use crate::{given_case, number, page, style};

/// List the levers and materials that a case can name.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// List only these, by any of their names, with the sources of their numbers
    #[arg(value_name = "NAME")]
    names: Vec<String>,

    /// Additional levers and materials (TOML); may be repeated
    #[arg(long, value_name = "FILE")]
    catalogue: Vec<PathBuf>,
}

/// The requested entry, in SI.
#[derive(Serialize, JsonSchema)]
pub(super) struct Listed<'a> {
    levers: Vec<&'a Lever>,
    materials: Vec<&'a Material>,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let catalogue = given_case::catalogue(&arguments.catalogue)?;
    let listed = if arguments.names.is_empty() {
        Listed {
            levers: catalogue.levers().collect(),
            materials: catalogue.materials().collect(),
        }
    } else {
        named(&catalogue, &arguments.names)?
    };
    output.result(&listed, |listed| text(listed, !arguments.names.is_empty()))
}

/// What answers to each of these names.
fn named<'a>(catalogue: &'a Catalogue, names: &[String]) -> Result<Listed<'a>, Failure> {
    let mut listed = Listed {
        levers: Vec::new(),
        materials: Vec::new(),
    };
    for name in names {
        let lever = catalogue.lever(Key::LeverName, name);
        let material = catalogue.material(Key::SampleMaterial, name);
        if let (Err(lever), Err(material)) = (&lever, &material) {
            return Err(Failure::input(
                format!("`{name}` is neither a lever nor a material: {lever}; {material}"),
                "`nanotap catalogue` lists every name",
            ));
        }
        listed.levers.extend(lever.ok());
        listed.materials.extend(material.ok());
    }
    Ok(listed)
}

fn text(listed: &Listed<'_>, with_sources: bool) -> String {
    let mut text = String::new();
    if !listed.levers.is_empty() {
        text.push_str(&style::bold(
            "levers, as in lever = \"PPP-FM\" under [cantilever]",
        ));
        text.push_str("\n\n");
        text.push_str(&levers(&listed.levers).render());
    }
    if !listed.materials.is_empty() {
        if !text.is_empty() {
            text.push('\n');
        }
        text.push_str(&style::bold(
            "materials, as in material = \"silicon\" ([sample], [tip])",
        ));
        text.push_str("\n\n");
        text.push_str(&materials(&listed.materials).render());
    }
    if with_sources {
        let sources = listed
            .levers
            .iter()
            .map(|lever| (&lever.name, &lever.source))
            .chain(listed.materials.iter().map(|m| (&m.name, &m.source)));
        for (name, source) in sources {
            text.push('\n');
            text.push_str(&page::paragraph(&format!("{name}: {source}")));
        }
    }
    text
}

fn levers(levers: &[&Lever]) -> Table {
    let mut table = Table::new([
        ("name", Align::Left),
        ("k", Align::Point),
        ("f0", Align::Point),
        ("L × b × h", Align::Left),
        ("tip radius", Align::Point),
        ("tip height", Align::Point),
        ("or", Align::Left),
    ]);
    let length = |value: Option<f64>| value.map_or_else(String::new, |m| Kind::Length.format(m));
    for lever in levers {
        let beam = lever.geometry.map_or_else(String::new, |beam| {
            [beam.length, beam.width, beam.thickness]
                .map(|side| number::chosen((side * 1e9).round() / 1e3))
                .join(" × ")
                + " µm"
        });
        table.row([
            lever.name.clone(),
            Kind::Stiffness.format(lever.k),
            Kind::Frequency.format(lever.f0),
            beam,
            length(lever.tip_radius),
            length(lever.tip_height),
            lever.aliases.join(", "),
        ]);
    }
    table
}

fn materials(materials: &[&Material]) -> Table {
    let mut table = Table::new([
        ("name", Align::Left),
        ("E", Align::Point),
        ("ν", Align::Point),
        ("density", Align::Point),
        ("or", Align::Left),
    ]);
    for material in materials {
        table.row([
            material.name.clone(),
            Kind::Pressure.format(material.elastic.modulus),
            number::chosen(material.elastic.poisson),
            material
                .density
                .map_or_else(String::new, |density| Kind::Density.format(density)),
            material.aliases.join(", "),
        ]);
    }
    table
}
