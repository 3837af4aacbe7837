//! `nanotap contact-laws`: the same lever and drive on every contact law.

use nanotap::case::key::kind_of;
use nanotap::case::physical::Kind;
use nanotap::model::parameter::Parameter;
use nanotap::study::contact_laws::{Comparison, ContactLawsStudy, SampleMotion};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Compare contact laws under the same lever and drive.
pub(crate) type Arguments = StudyArguments<ContactLawsStudy>;

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (request, case) = arguments.read(output)?;
    let result = progress::study::<ContactLawsStudy>(&case, &request, &ThreadsArgument::default())?;
    arguments.write(&case, &result)?;
    output.study(&case, &result, |result| text(&case, result))
}

fn text(case: &GivenCase, result: &Comparison) -> String {
    let units = case.units();
    let heading = format!(
        "{}: the period-{} orbit on each sample at {}",
        case.title(),
        result.period,
        match units.si(Kind::Frequency) {
            Some(unit) => Kind::Frequency.format_digits(unit * result.omega, 6),
            None => format!("Ω = {}", number::significant(result.omega, 6)),
        }
    );
    let table = Table::all(&result.sample_table(units));
    let mut text = format!("{}\n\n{}\n", style::bold(&heading), table.render());
    text.push_str(&followed(case, result));
    let linear = result.samples.iter().all(|s| s.case.law.is_none());
    let undamped =
        |s: &SampleMotion| s.case.arm().map_or(s.case.alpha6, |[_, damper]| damper) == 0.0;
    if linear && result.samples.iter().all(undamped) {
        text.push_str(&motion::paragraph(
            "the sample has no damper, and without one the laws are the same spring",
        ));
    } else if let Some(solid) = result
        .samples
        .iter()
        .find(|s| linear && s.case.arm().is_some())
    {
        let of_parameter = |parameter: Parameter| {
            let value = solid.case.get(parameter);
            case.physical().map_or_else(
                || number::significant(value, 5),
                |view| {
                    let unit = view.scales.of(parameter, solid.case.actuation);
                    let kind = kind_of(parameter.entry().unit, solid.case.actuation);
                    kind.format_digits(unit * value, 5)
                },
            )
        };
        let own: Vec<String> = Parameter::of_law(solid.case.contact)
            .map(of_parameter)
            .collect();
        text.push_str(&motion::paragraph(&format!(
            "all have the spring {} and the damper of the case; the solid has it in series with an arm of \
             stiffness {}, so that its force relaxes in {}. E_dis is the energy that the sample takes in one \
             drive period, F the force on the tip: negative where the sample pulls",
            match case.physical() {
                None => format!("α₄ = {}", number::significant(solid.case.alpha4, 5)),
                Some(_) => of_parameter(Parameter::Alpha4),
            },
            own[0],
            own[1],
        )));
    }
    for sample in &result.samples {
        if let Some(reason) = &sample.reason {
            text.push_str(&motion::paragraph(&format!("{}: {reason}", sample.contact)));
        }
    }
    text
}

/// How the orbits go on with the drive frequency; empty if they were not followed.
fn followed(case: &GivenCase, result: &Comparison) -> String {
    let mut text = String::new();
    for sample in &result.samples {
        let Some(branch) = &sample.branch else {
            continue;
        };
        let [from, to] = [branch.from, branch.to].map(|value| case.shown(branch.key, value));
        let mut found: Vec<String> = branch
            .bifurcations
            .iter()
            .map(|b| format!("{} at {}", b.kind, case.shown(branch.key, b.parameter)))
            .collect();
        if found.is_empty() {
            found.push("no bifurcation".into());
        }
        let cut = branch.failures.iter().map(|failure| failure.reason.clone());
        let all: Vec<String> = found.into_iter().chain(cut).collect();
        text.push_str(&motion::paragraph(&format!(
            "{} from {from} to {to}: {}",
            sample.contact,
            all.join("; ")
        )));
    }
    text
}
