//! `nanotap bimodal`: two tones with their loops against the distance.

use nanotap::case::physical::Kind;
use nanotap::study::bimodal::{BimodalPoint, BimodalReport, BimodalStudy};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::{Align, Table};
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Bimodal operation against the distance: amplitude, phase, frequency and drive of both tones as their
/// loops hold them (AM–FM by default), and what the usual formulas make of them. The frequencies need
/// no common period.
pub(crate) type Arguments = StudyArguments<BimodalStudy>;

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (request, case) = arguments.read(output)?;
    let report = progress::study::<BimodalStudy>(&case, &request, &ThreadsArgument::default())?;
    arguments.write(&case, &report)?;
    output.study(&case, &report, |report| text(&case, report))
}

fn length(value: f64) -> String {
    Kind::Length.format_digits(value, 4)
}

fn text(case: &GivenCase, report: &BimodalReport) -> String {
    let heading = format!(
        "{}: {}, {}–{}",
        case.title(),
        case.summary(),
        report.loops[0].name(),
        report.loops[1].name()
    );
    let mut text = format!("{}\n\n", style::bold(&heading));
    text.push_str(&Table::all(&report.free_table()).render());
    text.push('\n');
    text.push_str(&Table::all(&report.point_table()).render());
    for jump in &report.jumps {
        text.push_str(&motion::paragraph(&format!(
            "Between {} and {} the motion jumps to another.",
            length(jump.from),
            length(jump.to)
        )));
    }
    if let Some(reason) = &report.ended {
        text.push_str(&motion::paragraph(reason));
    }
    if let Some(last) = report.table.last() {
        text.push('\n');
        text.push_str(&at(last, report));
    }
    text
}

/// The last motion, and the values of the formulas.
fn at(point: &BimodalPoint, report: &BimodalReport) -> String {
    let mut table = Table::new([
        ("", Align::Left),
        ("exact", Align::Left),
        ("by formula", Align::Left),
    ]);
    for (name, tone) in ["first tone", "second tone"].into_iter().zip(&point.tones) {
        let energy = |value| Kind::Energy.format_digits(value, 4);
        table.row([
            format!("virial, {name}"),
            energy(tone.virial),
            energy(tone.estimates.virial),
        ]);
        table.row([
            format!("energy lost a period, {name}"),
            energy(tone.dissipation),
            energy(tone.estimates.dissipation),
        ]);
    }
    let estimates = &point.estimates;
    let row = |exact: Option<f64>, formula: Option<f64>, kind: Kind| {
        [exact, formula].map(|value| value.map_or_else(String::new, |v| kind.format_digits(v, 4)))
    };
    let mut pair = |name: &str, [exact, formula]: [String; 2]| {
        if !formula.is_empty() {
            table.row([name.to_owned(), exact, formula]);
        }
    };
    let relaxes = report.dynamic_moduli.is_some();
    pair(
        if relaxes {
            "reduced modulus E*, relaxed"
        } else {
            "reduced modulus E*"
        },
        row(
            report.reduced_modulus,
            estimates.reduced_modulus,
            Kind::Pressure,
        ),
    );
    pair(
        "indentation",
        row(Some(-point.closest), estimates.indentation, Kind::Length),
    );
    let of_tone = |k: usize| report.dynamic_moduli.map(|moduli| moduli[k]);
    pair(
        "loss tangent, first tone",
        row(
            of_tone(0).map(|[storage, loss]| loss / storage),
            estimates.loss_tangent,
            Kind::Number,
        ),
    );
    if let Some([storage, loss]) = of_tone(1) {
        let modulus = |value| Kind::Pressure.format(value);
        table.row([
            "storage, loss modulus, second tone".to_owned(),
            format!("{}, {}", modulus(storage), modulus(loss)),
            String::new(),
        ]);
    }
    format!(
        "  {}\n{}{}",
        style::bold(&format!("at {}", length(point.zc))),
        table.render(),
        motion::paragraph(&format!(
            "A small disturbance at constant drives changes by {} in a period. The phases of the second \
             tone leave out {:.0e} of the motion.",
            number::significant(point.growth, 6),
            point.error
        ))
    )
}
