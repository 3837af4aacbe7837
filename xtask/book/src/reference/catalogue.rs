//! The catalogue of levers and materials.

use nanotap::case::physical::Catalogue;

use super::{code, head, row};

const INTRODUCTION: &str = "\
# The catalogue

The names that `cantilever.lever`, `sample.material` and `tip.material` accept. `nanotap catalogue`
prints the same list; `--catalogue FILE` adds entries. A lever's constants are the maker's typical
values. Those of an individual lever differ, the spring constant by a factor of two or more.

## Levers

";

pub(super) fn page() -> String {
    let catalogue = Catalogue::shared();
    let mut text = INTRODUCTION.to_owned();
    text += &head(&[
        "name",
        "also",
        "k (N/m)",
        "f0 (kHz)",
        "tip radius (nm)",
        "source",
    ]);
    for lever in catalogue.levers() {
        text += &row(&[
            code(&lever.name),
            lever.aliases.join(", "),
            rounded(lever.k),
            rounded(lever.f0 / 1e3),
            lever
                .tip_radius
                .map_or(String::new(), |radius| rounded(radius * 1e9)),
            lever.source.clone(),
        ]);
    }
    text += "\n## Materials\n\n";
    text += &head(&["name", "also", "modulus (GPa)", "Poisson's ratio", "source"]);
    for material in catalogue.materials() {
        text += &row(&[
            code(&material.name),
            material.aliases.join(", "),
            rounded(material.elastic.modulus / 1e9),
            rounded(material.elastic.poisson),
            material.source.clone(),
        ]);
    }
    text
}

/// The number without the rounding error of a conversion of units.
fn rounded(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
