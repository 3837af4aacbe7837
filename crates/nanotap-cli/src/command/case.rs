//! `nanotap case`: the case, checked and resolved.

use clap::Args;
use nanotap::ErrorKind;
use nanotap::case::document::CaseDocument;
use nanotap::case::file as case_file;
use nanotap::case::physical::quantity::format_electronvolts;
use nanotap::case::physical::{Kind, Resolved, Severity};
use nanotap::case::subject::Subject;
use nanotap::model::cantilever::{Cantilever, CosineTerm};
use nanotap::model::oscillator::{Oscillator, OscillatorParameter, Stop};
use nanotap::observe::table::shown_phase;
use nanotap::study::setpoint::SetpointReport;

use crate::arguments::{CaseArguments, OutArgument};
use crate::failure::Failure;
use crate::output::Output;
use crate::studied::at_setpoint;
use crate::table::{Align, Table};
use crate::{file, number, style};

/// Check a case and show it resolved.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,
    #[command(flatten)]
    out: OutArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let read = super::studied(&arguments.case)?;
    // The case is shown also where no distance has the setpoint.
    let studied = match at_setpoint(read.clone(), output) {
        Ok(studied) => studied,
        Err(error) if error.kind == ErrorKind::Numerics => {
            output.warning(&error.to_string());
            read
        }
        Err(other) => return Err(other),
    };
    let document = CaseDocument::of(&studied);
    if let Subject::Oscillator(given) = &studied.subject {
        if let Some(path) = &arguments.out.out {
            return Err(Failure::input(
                format!("--out {}: an oscillator is not written out", path.display()),
                "leave --out away, or take --json",
            ));
        }
        return output.result(&document, |_| oscillator(&studied.title, given));
    }
    let case = super::cantilever_of(&studied, "nanotap case")?;
    write_out(&arguments.out, &case)?;
    for remark in studied.resolved.iter().flat_map(|r| &r.remarks) {
        match remark.severity {
            Severity::Note => output.note(&remark.text),
            Severity::Warning => output.warning(&remark.text),
        }
    }
    remark(&case, output);
    output.result(&document, |_| {
        studied.resolved.as_ref().map_or_else(
            || cantilever(&studied.title, &case),
            |resolved| {
                let solved = studied.setpoint.as_ref().map_or_else(String::new, setpoint);
                format!("{}{solved}", physical(&studied.title, resolved))
            },
        )
    })
}

/// Writes the dimensionless case where `--out` says.
fn write_out(out: &OutArgument, case: &Cantilever) -> Result<(), Failure> {
    let Some(path) = &out.out else { return Ok(()) };
    file::ending(path, &["toml"])?;
    file::write(path, case_file::to_toml(case).as_bytes())
}

fn remark(case: &Cantilever, output: &Output) {
    if case.cosine_term == CosineTerm::Printed {
        output.note("the cosine term of Eq. (14) is taken as printed, without its Ω");
    }
    if case.alpha2 == 0.0 {
        output.note("drive_amplitude is 0: nothing drives the beam");
    }
}

fn cantilever(title: &str, case: &Cantilever) -> String {
    let mut table = Table::new([
        ("", Align::Left),
        ("key", Align::Left),
        ("or", Align::Left),
        ("value", Align::Point),
        ("meaning", Align::Left),
    ]);
    table.row(["N", "modes", "", &case.modes.to_string(), "beam modes"]);
    for parameter in case.parameters() {
        table.row([
            parameter.symbol(),
            parameter.name(),
            parameter.alias(),
            &number::chosen(case.get(parameter)),
            parameter.meaning(),
        ]);
    }
    table.row([
        "",
        "contact",
        "",
        case.contact.name(),
        case.contact.meaning(),
    ]);
    let heading = format!(
        "{title}: a dimensionless cantilever, {}",
        number::counted(case.modes, "mode", "modes")
    );
    let period = number::significant(case.period(), 7);
    let formula = case.tone2_ratio.map_or_else(
        || "2π/Ω".to_owned(),
        |ratio| {
            format!(
                "{}·2π/Ω, after which both tones repeat,",
                ratio.denominator()
            )
        },
    );
    format!(
        "{}\n\n{}\n  drive period {formula} = {period}\n",
        style::bold(&heading),
        table.render()
    )
}

fn physical(title: &str, resolved: &Resolved) -> String {
    let Resolved {
        case,
        lever,
        scales,
        ..
    } = resolved;
    let mut given = Table::new([("", Align::Left), ("", Align::Left), ("", Align::Left)]);
    given.row([
        "k",
        &Kind::Stiffness.format(lever.k),
        "spring constant at the tip",
    ]);
    given.row([
        "f0",
        &Kind::Frequency.format(lever.f0),
        "first resonance, with the tip",
    ]);
    given.row([
        "Q",
        &number::significant(lever.quality_factor, 4),
        "quality factor",
    ]);
    given.row([
        "mL",
        &Kind::Mass.format(lever.beam_mass),
        "mass of the beam",
    ]);
    let free = Kind::Length.format(resolved.free_amplitude);
    let phase = format!(
        "free amplitude of the tip, {:.1}° behind the {}",
        resolved.free_phase,
        resolved.phase_reference()
    );
    given.row(["A0", &free, &phase]);
    if let Some(setpoint) = resolved.setpoint {
        let ratio = number::significant(setpoint, 4);
        given.row(["A/A0", &ratio, "setpoint"]);
    }
    given.row([
        "g0",
        &Kind::Length.format(scales.length),
        "gap of the beam, the unit of length",
    ]);
    given.row([
        "T",
        &format!("{:.4e} s", scales.time),
        "unit of time, √(mL⁴/(EI))",
    ]);
    if let (Some(free), Some(ratio)) = (resolved.second_free_amplitude, case.tone2_ratio) {
        let what = format!("free amplitude at the second tone, {ratio} of the first's frequency");
        given.row(["A02", &Kind::Length.format(free), &what]);
    }
    given.row(["", case.actuation.name(), case.actuation.meaning()]);
    given.row(["", case.contact.name(), case.contact.meaning()]);
    let mut mapping = Table::new([
        ("", Align::Left),
        ("key", Align::Left),
        ("value", Align::Point),
        ("is", Align::Left),
        ("of", Align::Left),
        ("", Align::Left),
    ]);
    for row in resolved.mapping() {
        mapping.row([
            row.parameter.symbol(),
            row.parameter.name(),
            &number::significant(row.value, 6),
            row.formula,
            row.quantity,
            &row.kind.format(row.si),
        ]);
    }
    let heading = format!(
        "{title}: a physical cantilever, {}",
        number::counted(case.modes, "mode", "modes")
    );
    format!(
        "{}\n\n{}\n{}",
        style::bold(&heading),
        given.render(),
        mapping.render()
    )
}

/// Every distance at which an orbit has the setpoint amplitude.
fn setpoint(report: &SetpointReport) -> String {
    let mut table = Table::new([
        ("gap.tip", Align::Right),
        ("period", Align::Right),
        ("phase (°)", Align::Point),
        ("E_dis", Align::Right),
        ("F_max", Align::Right),
        ("", Align::Left),
    ]);
    for s in &report.solutions {
        let stability = if s.stable { "stable" } else { "unstable" };
        let reached = if s.reached {
            ", reached on approach"
        } else {
            ""
        };
        table.row([
            Kind::Length.format_digits(s.zc, 5),
            s.period.to_string(),
            number::significant(shown_phase(s.observables.phase), 4),
            format_electronvolts(s.physical.observables.dissipation),
            Kind::Force.format(s.physical.observables.peak_force),
            format!("{stability}{reached}"),
        ]);
    }
    format!(
        "\n  {}\n{}",
        style::bold(&format!(
            "where the amplitude is {}, {} of A0",
            Kind::Length.format(report.amplitude),
            number::significant(report.ratio, 4)
        )),
        table.render()
    )
}

fn oscillator(title: &str, oscillator: &Oscillator) -> String {
    let mut table = Table::new([
        ("", Align::Left),
        ("key", Align::Left),
        ("value", Align::Point),
        ("meaning", Align::Left),
    ]);
    for parameter in OscillatorParameter::ALL {
        let Some(value) = oscillator.get(parameter) else {
            continue;
        };
        let (symbol, meaning) = match parameter {
            OscillatorParameter::Mass => ("m", "mass"),
            OscillatorParameter::Stiffness => ("k", "spring"),
            OscillatorParameter::Damping => ("c", "damper"),
            OscillatorParameter::Forcing => ("F", "amplitude of the force F cos ωt"),
            OscillatorParameter::Omega => ("ω", "frequency of the force"),
            OscillatorParameter::Gap => ("g", "where the stop stands; contact at x ≥ g"),
            OscillatorParameter::ContactStiffness => ("kc", "spring of the stop"),
            OscillatorParameter::ContactDamping => ("cc", "damper of the stop"),
            OscillatorParameter::Restitution => ("r", "speed after an impact over speed before"),
        };
        table.row([symbol, parameter.name(), &number::chosen(value), meaning]);
    }
    let what = match oscillator.stop {
        Stop::Soft { .. } => "an oscillator with a soft stop",
        Stop::Rigid { .. } => "an oscillator with a rigid stop",
    };
    format!(
        "{}\n\n{}",
        style::bold(&format!("{title}: {what}")),
        table.render()
    )
}
