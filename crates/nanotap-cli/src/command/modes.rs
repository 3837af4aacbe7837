//! `nanotap modes`: mode shapes and frequencies, in free flight and in contact.

use std::fmt::Write as _;

use nanotap::case::Key;
use nanotap::case::physical::Kind;
use nanotap::case::units::Units;
use nanotap::figure::modes::shapes_figure;
use nanotap::model::beam::Modes;
use nanotap::model::parameter::Parameter;
use nanotap::study::modes::{ModeTable, ModesStudy, damping_ratio};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::table::{Align, Table};
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Compute mode shapes and frequencies, in free flight and in contact.
pub(crate) type Arguments = StudyArguments<ModesStudy>;

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (request, case) = arguments.read(output)?;
    let table = progress::study::<ModesStudy>(&case, &request, &ThreadsArgument::default())?;
    let beam = Modes::new(table.modes).map_err(|error| Failure::numerics(error.to_string()))?;
    arguments.out.write(|| shapes(&beam, request.points))?;
    arguments.plot.draw(|| shapes_figure(&beam))?;
    output.study(&case, &table, |table| text(&case, table))
}

/// The mode shapes φ_j(ξ) as CSV, a row a point.
fn shapes(beam: &Modes, points: usize) -> String {
    let names: Vec<String> = beam
        .iter()
        .map(|mode| format!("phi{}", mode.number))
        .collect();
    let mut csv = format!("xi,{}\n", names.join(","));
    for point in 0..points {
        let xi = point as f64 / (points - 1) as f64;
        let shapes = beam.shapes(xi);
        csv.push_str(&number::row(
            std::iter::once(xi).chain(shapes.iter().copied()),
        ));
        csv.push('\n');
    }
    csv
}

fn text(case: &GivenCase, table: &ModeTable) -> String {
    let units = case.units();
    let parameter = |which: Parameter| {
        let key = Key::of(which);
        let value = case.cantilever().map_or(f64::NAN, |c| c.get(which));
        match units {
            Units::Model => format!("{} = {}", key.symbol(), number::chosen(value)),
            Units::Si(_) => case.shown(key, value),
        }
    };
    let mut text = style::bold(&format!(
        "{}: {} of the cantilever, tip mass {}",
        case.title(),
        number::counted(table.modes, "mode", "modes"),
        parameter(Parameter::Alpha1),
    ));
    text.push('\n');
    let regimes = [
        (
            "free flight".to_owned(),
            &table.free,
            &table.exact_free,
            &table.free_eigenvalues,
        ),
        (
            format!("in contact, stiffness {}", parameter(Parameter::Alpha4)),
            &table.contact,
            &table.exact_contact,
            &table.contact_eigenvalues,
        ),
    ];
    for (name, galerkin, exact, eigenvalues) in regimes {
        let _ = write!(
            text,
            "\n  {name}\n{}",
            frequencies(galerkin, exact, eigenvalues.as_deref(), &units)
        );
    }
    text.push('\n');
    if table.exact_free.is_empty() {
        text.push_str(&motion::paragraph(
            "Galerkin: the modes as they were measured, undamped; a lever so given is not a beam.",
        ));
        return text;
    }
    text.push_str(&motion::paragraph(
        "Galerkin: these modes of the bare beam, undamped; exact: the uniform beam itself.",
    ));
    text.push_str(&motion::paragraph(&format!(
        "Against a constant force at the tip {} {} % stiffer than the beam, whose k is 3EI/L³.",
        if table.modes == 1 {
            "this mode is".to_owned()
        } else {
            format!("these {} modes together are", table.modes)
        },
        number::significant(100.0 * table.static_excess, 2)
    )));
    if let Some(quality) = table.quality.as_ref().filter(|q| q.len() > 1) {
        let value = |(k, q): (usize, &f64)| format!("Q{} = {}", k + 1, number::significant(*q, 4));
        let values: Vec<String> = quality.iter().take(3).enumerate().map(value).collect();
        text.push_str(&motion::paragraph(&format!(
            "In free flight {}. Without numbers of their own higher modes are damped in proportion \
             to their mass, which gives them several times the Q of real levers in air: \
             cantilever.Q2, Q3, f2, f3 and k2 take what was measured.",
            values.join(", ")
        )));
    }
    text
}

fn frequencies(
    galerkin: &[f64],
    exact: &[f64],
    eigenvalues: Option<&[[f64; 2]]>,
    units: &Units,
) -> String {
    let frequency = |value| number::quantity(units, Kind::Frequency, value, [7, 7]);
    let [of_modes, of_beam, damped] = match units {
        Units::Model => ["Ω Galerkin", "Ω exact", "Ω damped"],
        Units::Si(_) => ["f Galerkin", "f exact", "f damped"],
    };
    // Where each mode oscillates there is one eigenvalue a mode, shown in its row.
    let paired = eigenvalues.filter(|list| list.len() == galerkin.len());
    let mut table = Table::new([
        ("mode", Align::Right),
        (of_modes, Align::Point),
        (of_beam, Align::Point),
        ("difference", Align::Point),
        (damped, Align::Point),
        ("damping ζ", Align::Point),
    ]);
    for (index, galerkin) in galerkin.iter().enumerate() {
        // A lever whose modes were measured is not a uniform beam.
        let [exact, difference] = match exact.get(index) {
            Some(exact) => [frequency(*exact), number::percent(galerkin / exact - 1.0)],
            None => [String::new(), String::new()],
        };
        let mut row = vec![
            (index + 1).to_string(),
            frequency(*galerkin),
            exact,
            difference,
        ];
        if let Some(eigenvalue) = paired.map(|list| list[index]) {
            row.push(frequency(eigenvalue[1]));
            row.push(number::significant(damping_ratio(eigenvalue), 4));
        }
        table.row(row);
    }
    let mut text = table.render();
    match eigenvalues {
        None => {
            text.push_str("  damped: eigenvalues too close to critical damping to distinguish\n");
        }
        Some(list) if paired.is_none() => {
            text.push_str("  overdamped: not every mode oscillates; the eigenvalues are\n");
            let mut table = Table::new([("Re λ", Align::Point), ("Im λ", Align::Point)]);
            for [re, im] in list {
                table.row([number::significant(*re, 7), number::significant(*im, 7)]);
            }
            text.push_str(&table.render());
        }
        Some(_) => {}
    }
    text
}
