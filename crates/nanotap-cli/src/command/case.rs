//! `nanotap case`: the case, checked and resolved.

use clap::Args;
use nanotap::case::{Case, CosineTerm};
use nanotap::case_file::{self, CaseFile, OscillatorFields, Stop};
use nanotap::parameter::Parameter;
use serde::Serialize;

use crate::arguments::{CaseArguments, OutArgument};
use crate::failure::Failure;
use crate::output::Output;
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

/// The JSON of a dimensionless case.
#[derive(Serialize)]
struct Resolved<'a> {
    kind: &'static str,
    #[serde(flatten)]
    case: &'a Case,
    period: f64,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let title = super::title(&arguments.case);
    match super::case_file(&arguments.case)? {
        CaseFile::Dimensionless(case) => {
            if let Some(path) = &arguments.out.out {
                file::ending(path, &["toml"])?;
                file::write(path, case_file::to_toml(&case).as_bytes())?;
            }
            if case.cosine_term == CosineTerm::Printed {
                output.note("the cosine term of Eq. (14) is taken as printed, without its Ω");
            }
            if case.alpha2 == 0.0 {
                output.note("drive_amplitude is 0: nothing drives the beam");
            }
            let resolved = Resolved {
                kind: "cantilever",
                case: &case,
                period: case.period(),
            };
            output.result(&resolved, |resolved| cantilever(&title, resolved))
        }
        CaseFile::Oscillator(fields) => {
            if let Some(path) = &arguments.out.out {
                return Err(Failure::request(
                    format!("--out {}: an oscillator is not written out", path.display()),
                    "leave --out away, or take --json",
                ));
            }
            output.result(&fields, |fields| oscillator(&title, fields))
        }
        CaseFile::Physical(_) => Err(super::physical_not_yet(&arguments.case)),
    }
}

fn cantilever(title: &str, resolved: &Resolved<'_>) -> String {
    let case = resolved.case;
    let mut table = Table::new([
        ("", Align::Left),
        ("key", Align::Left),
        ("or", Align::Left),
        ("value", Align::Point),
        ("meaning", Align::Left),
    ]);
    table.row(["N", "modes", "", &case.modes.to_string(), "beam modes"]);
    for parameter in Parameter::ALL {
        table.row([
            parameter.symbol(),
            parameter.name(),
            parameter.alias(),
            &number::chosen(case.get(parameter)),
            parameter.meaning(),
        ]);
    }
    format!(
        "{}\n\n{}\n  drive period 2π/Ω = {}\n",
        style::bold(&format!(
            "{title}: a dimensionless cantilever, {}",
            number::counted(case.modes, "mode", "modes")
        )),
        table.render(),
        number::significant(resolved.period, 7),
    )
}

fn oscillator(title: &str, fields: &OscillatorFields) -> String {
    let mut table = Table::new([
        ("", Align::Left),
        ("key", Align::Left),
        ("value", Align::Point),
        ("meaning", Align::Left),
    ]);
    let mut row = |symbol: &str, key: &str, value: f64, meaning: &str| {
        table.row([symbol, key, &number::chosen(value), meaning]);
    };
    row("m", "mass", fields.mass, "mass");
    row("k", "stiffness", fields.stiffness, "spring");
    row("c", "damping", fields.damping, "damper");
    row(
        "F",
        "forcing",
        fields.forcing,
        "amplitude of the force F cos ωt",
    );
    row("ω", "omega", fields.omega, "frequency of the force");
    row(
        "g",
        "gap",
        fields.gap,
        "where the stop stands; contact at x ≥ g",
    );
    let what = match fields.stop {
        Stop::Soft {
            contact_stiffness,
            contact_damping,
        } => {
            row(
                "kc",
                "contact_stiffness",
                contact_stiffness,
                "spring of the stop",
            );
            row(
                "cc",
                "contact_damping",
                contact_damping,
                "damper of the stop",
            );
            "an oscillator with a soft stop"
        }
        Stop::Rigid { restitution } => {
            row(
                "r",
                "restitution",
                restitution,
                "speed after an impact over speed before",
            );
            "an oscillator with a rigid stop"
        }
    };
    format!(
        "{}\n\n{}",
        style::bold(&format!("{title}: {what}")),
        table.render()
    )
}
