//! `nanotap modes`: mode shapes and frequencies, in free flight and in contact.

use std::fmt::Write as _;

use nanotap::case::Key;
use nanotap::case::units::Units;
use nanotap::figure::modes::shapes_figure;
use nanotap::model::beam::Modes;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::parameter::Parameter;
use nanotap::study::Document;
use nanotap::study::modes::{ModeTable, ModesStudy, shape_table};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::{Align, Table};
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Compute mode shapes and frequencies, in free flight and in contact.
pub(crate) type Arguments = StudyArguments<ModesStudy>;

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (request, case) = arguments.read(output)?;
    let table = progress::study::<ModesStudy>(&case, &request, &ThreadsArgument::default())?;
    let beam = Modes::new(table.modes).map_err(|error| Failure::numerics(error.to_string()))?;
    arguments
        .out
        .write(|| shape_table(&beam, request.points).csv())?;
    arguments.plot.draw(|| shapes_figure(&beam))?;
    let document = Document::of::<ModesStudy>(&table, &case);
    output.result(&document, |_| text(&case, &table))
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
    let contact = format!("in contact, stiffness {}", parameter(Parameter::Alpha4));
    let free = ("free flight".to_owned(), &table.free_eigenvalues);
    for (k, (name, eigenvalues)) in [free, (contact, &table.contact_eigenvalues)]
        .into_iter()
        .enumerate()
    {
        let _ = write!(
            text,
            "\n  {name}\n{}{}",
            Table::all(&table.frequency_table(k == 1, units)).render(),
            without_frequencies(eigenvalues.as_deref(), table.modes)
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
        let looped = case.cantilever().is_some_and(Cantilever::has_q_control);
        let place = if looped {
            "In free flight, under Q control,"
        } else {
            "In free flight"
        };
        text.push_str(&motion::paragraph(&format!(
            "{place} {}. Without numbers of their own higher modes are damped in proportion \
             to their mass, which gives them several times the Q of real levers in air: \
             cantilever.Q2, Q3, f2, f3 and k2 take what was measured.",
            values.join(", ")
        )));
    }
    text
}

/// What is shown in place of frequencies where not every mode oscillates.
fn without_frequencies(eigenvalues: Option<&[[f64; 2]]>, modes: usize) -> String {
    match eigenvalues {
        None => "  damped: eigenvalues too close to critical damping to distinguish\n".to_owned(),
        Some(list) if list.len() != modes => {
            let mut table = Table::new([("Re λ", Align::Point), ("Im λ", Align::Point)]);
            for [re, im] in list {
                table.row([number::significant(*re, 7), number::significant(*im, 7)]);
            }
            let words = "  overdamped: not every mode oscillates; the eigenvalues are\n";
            words.to_owned() + &table.render()
        }
        Some(_) => String::new(),
    }
}
