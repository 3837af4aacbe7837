//! `nanotap case`: check a case and print it resolved.

use std::path::PathBuf;

use clap::Args;
use nanotap::ErrorKind;
use nanotap::case::document::equilibria;
use nanotap::case::file as case_file;
use nanotap::case::physical::Held;
use nanotap::case::physical::force::SampleForce;
use nanotap::case::physical::{Kind, Physical};
use nanotap::case::{Case, Key};
use nanotap::frame::Frame;
use nanotap::model::beam::Modes;
use nanotap::model::cantilever::{Cantilever, CosineTerm};
use nanotap::model::nonlinear::Equilibrium;
use nanotap::model::oscillator::{Oscillator, Stop};
use nanotap::model::parameter::Parameter;
use nanotap::study::modes::ModeTable;
use nanotap::study::setpoint::{
    CaseReport, SetpointReport, SolvedCase, UnsolvedCase, case_tables, note_of_several_tones,
};

use crate::arguments::CaseArguments;
use crate::failure::{Failure, flag};
use crate::given_case::{at_setpoint, case_of};
use crate::output::Output;
use crate::text_table::{Align, Table};
use crate::{file, motion, number, style};

/// Check a case and print it resolved.
#[derive(Args, Clone, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,
    /// Write the case to this file (.toml) with its units, what --set changes and the distance of a
    /// setpoint; with --model-units as numbers of the equations
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let read = case_of(&arguments.case)?;
    if let Some(path) = &arguments.out {
        file::claim(path, &["toml"])?;
    }
    if let Some(note) = note_of_several_tones(&read) {
        output.note(&note);
        let note = Some(note);
        return unsolved(
            &read,
            UnsolvedCase {
                note,
                ..UnsolvedCase::of(&read)
            },
            arguments,
            output,
        );
    }
    // The case is shown also where no distance has the setpoint, which ends every study of it.
    let (case, setpoint_solved) = match at_setpoint(read.clone()) {
        Ok(solved) => solved,
        Err(error) if error.kind == ErrorKind::Numerics => {
            let document = Some(error.clone().written(flag).document());
            let document = UnsolvedCase {
                error: document,
                ..UnsolvedCase::of(&read)
            };
            let arguments = Arguments {
                out: None,
                ..arguments.clone()
            };
            unsolved(&read, document, &arguments, output)?;
            return Err(error);
        }
        Err(other) => return Err(other),
    };
    write_out(arguments, &case)?;
    let solved = setpoint_solved.as_ref().map_or_else(String::new, setpoint);
    // A case without a model is no case, though its numbers could be shown.
    case.model()?;
    let document = SolvedCase::of(&case, setpoint_solved);
    if let Some(numbers) = case.cantilever() {
        case.remarks()
            .iter()
            .for_each(|remark| output.remark(remark));
        note_oddities(numbers, output);
    }
    for beyond in &document.out_of_range {
        output.warning(&format!("where the lever rests, {beyond}"));
    }
    output.result(&CaseReport::Solved(Box::new(document)), |_| {
        match (case.physical(), &case_tables(&case)[..]) {
            (Some(view), [mapping, rest @ ..]) => {
                let rest = rest.first();
                let rest = rest.map_or_else(String::new, |rest| rests(&case, view, rest));
                let given = physical(case.title(), view, Some(mapping));
                format!("{given}{rest}{solved}")
            }
            (_, [numbers, ..]) => match (case.cantilever(), case.oscillator()) {
                (Some(given), _) => cantilever(case.title(), given, numbers),
                (None, Some(given)) => oscillator(&case, given, numbers),
                (None, None) => String::new(),
            },
            (_, []) => String::new(),
        }
    })
}

/// Prints and writes a case whose setpoint was not solved for, as far as it is known.
fn unsolved(
    case: &Case,
    document: UnsolvedCase,
    arguments: &Arguments,
    output: &Output,
) -> Result<(), Failure> {
    write_out(arguments, case)?;
    case.remarks()
        .iter()
        .for_each(|remark| output.remark(remark));
    output.result(&CaseReport::Unsolved(Box::new(document)), |_| {
        let view = case.physical();
        view.map_or_else(String::new, |view| physical(case.title(), view, None))
    })
}

/// Writes the case where `--out` says: a physical one in its quantities, or with `--model-units` as
/// numbers of the equations.
fn write_out(arguments: &Arguments, case: &Case) -> Result<(), Failure> {
    let Some(path) = &arguments.out else {
        return Ok(());
    };
    let Some(numbers) = case.cantilever().filter(|_| case.is_in_model_units()) else {
        return file::write_case(path, &case.to_toml());
    };
    if numbers.law.is_some() {
        return Err(Failure::input(
            format!(
                "--out {}: a nonlinear force law has no dimensionless case file",
                path.display()
            ),
            "omit --model-units, which writes the physical case, or use --json, which has the law in \
             the model's units",
        ));
    }
    if case.leaves_distance_to_setpoint() {
        return Err(Failure::input(
            format!(
                "--out {}: a case without a distance has no numbers of the equations",
                path.display()
            ),
            "omit --model-units, which writes the physical case, or give gap.tip",
        ));
    }
    file::write_case(path, &case_file::to_toml(numbers))
}

/// Notes what is unusual about the numbers of a beam.
fn note_oddities(case: &Cantilever, output: &Output) {
    if case.cosine_term == CosineTerm::Printed {
        output.note("the cosine term of Eq. (14) is taken as printed, without its Ω");
    }
    if case.alpha2 == 0.0 {
        output.note("drive_amplitude is 0: nothing drives the beam");
    }
}

fn cantilever(title: &str, case: &Cantilever, numbers: &Frame<'_>) -> String {
    let heading = format!(
        "{title}: a dimensionless cantilever, {}",
        number::counted(case.modes, "mode", "modes")
    );
    let period = number::significant(case.period(), 7);
    let formula = match case.further_tones.len() {
        0 => "2π/Ω".to_owned(),
        _ if !case.further_tones.iter().all(|tone| tone.repeats()) => {
            "2π/Ω of the first tone (both never repeat together)".to_owned()
        }
        tones => format!(
            "{}·2π/Ω, after which {} tones repeat,",
            case.repetition(),
            if tones == 1 { "both" } else { "all" }
        ),
    };
    format!(
        "{}\n\n{}\n  drive period {formula} = {period}\n",
        style::bold(&heading),
        Table::all(numbers).render()
    )
}

/// The quantities of the case; those that depend on the distance where the `mapping` to numbers is known.
fn physical(title: &str, view: &Physical, mapping: Option<&Frame<'_>>) -> String {
    let Physical {
        cantilever: case,
        scales,
        ..
    } = view;
    let mut given = Table::new([("", Align::Left), ("", Align::Left), ("", Align::Left)]);
    lever_rows(&mut given, view);
    let free = Kind::Length.format(view.free_amplitude);
    let phase = format!(
        "free amplitude of the tip, {}",
        motion::lag(
            view.free_phase,
            &format!("the {}", view.phase_reference()),
            4
        )
    );
    given.row(["A0", &free, &phase]);
    if let Some(setpoint) = view.setpoint {
        let ratio = number::significant(setpoint, 4);
        given.row(["A/A0", &ratio, "setpoint"]);
    }
    match view.held {
        Some(Held::PeakForce(force)) => {
            given.row(["", &Kind::Force.format(force), "setpoint of the peak force"]);
        }
        Some(Held::Phase(phase)) => {
            let phase = format!("{}°", number::significant(phase, 4));
            given.row(["", &phase, "setpoint of the phase lag"]);
        }
        Some(Held::Shift(shift)) => {
            given.row([
                "",
                &Kind::Frequency.format(shift),
                "setpoint of the frequency shift",
            ]);
        }
        Some(Held::Amplitude(_)) | None => {}
    }
    if mapping.is_some() {
        given.row([
            "g0",
            &Kind::Length.format(scales.length),
            "gap of the beam, the unit of length",
        ]);
    }
    given.row([
        "T",
        &format!("{:.4e} s", scales.time),
        "unit of time, √(mL⁴/(EI))",
    ]);
    let tones = view.further_free_amplitudes.iter().zip(&case.further_tones);
    for ((free, ratio), (symbol, word)) in tones.zip([("A02", "second"), ("A03", "third")]) {
        let what = format!("free amplitude at the {word} tone, {ratio} of the first's frequency");
        given.row([symbol, &Kind::Length.format(*free), &what]);
    }
    given.row(["", case.actuation.name(), case.actuation.meaning()]);
    match &view.sample.force {
        None => {
            given.row(["", case.contact.name(), case.contact.meaning()]);
        }
        Some(force) => force_rows(&mut given, force, view.parameters.get(Parameter::Omega)),
    }
    let heading = format!(
        "{title}: a physical cantilever, {}",
        number::counted(case.modes, "mode", "modes")
    );
    let heading = style::bold(&heading);
    let given = format!("{heading}\n\n{}", given.render());
    match mapping {
        Some(mapping) => format!("{given}\n{}", Table::all(mapping).render()),
        None => given,
    }
}

/// The rows of the lever: of a beam, or of the modes that were measured.
fn lever_rows(given: &mut Table, view: &Physical) {
    let (lever, case) = (&view.lever, &view.cantilever);
    let measured = view.lever_modes();
    if !measured.is_empty() {
        let count = number::counted(measured.len(), "measured mode", "measured modes");
        given.row([
            "k",
            &Kind::Stiffness.format(lever.k),
            &format!("static spring constant at the tip, of {count} together"),
        ]);
        for (j, mode) in measured.iter().enumerate() {
            let j = j + 1;
            let [f, k, q] = ["f", "k", "Q"].map(|name| format!("{name}{j}"));
            given.row([&f, &Kind::Frequency.format(mode.frequency), "as measured"]);
            given.row([&k, &Kind::Stiffness.format(mode.stiffness), "at the tip"]);
            given.row([&q, &number::significant(mode.quality, 4), "quality factor"]);
        }
        return;
    }
    given.row([
        "k",
        &Kind::Stiffness.format(lever.k),
        &format!(
            "static spring constant at the tip, 3EI/L³; {} {} % stiffer",
            if case.modes == 1 {
                "1 mode is".to_owned()
            } else {
                format!("{} modes are", case.modes)
            },
            number::significant(100.0 * static_excess(case.modes), 2)
        ),
    ]);
    given.row([
        "f0",
        &Kind::Frequency.format(lever.f0),
        "first resonance, with the tip",
    ]);
    given.row([
        "Q",
        &number::significant(lever.quality_factor, 4),
        "quality factor of the first mode",
    ]);
    let table = ModeTable::new(case).ok();
    let first = table.as_ref().and_then(|table| {
        let [real, imaginary] = *table.free_eigenvalues.as_ref()?.first()?;
        Some((
            (real * real + imaginary * imaginary).sqrt(),
            *table.quality.as_ref()?.first()?,
        ))
    });
    if let (true, Some((resonance, quality))) = (case.has_q_control(), first) {
        let frequency = Kind::Frequency.format(resonance * view.scales.frequency);
        given.row([
            "closed loop",
            &frequency,
            &format!(
                "first resonance under Q control, Q = {}",
                number::significant(quality, 4)
            ),
        ]);
    }
    if let Some(quality) = table.and_then(|table| table.quality) {
        let measured = [Parameter::Mode2Quality, Parameter::Mode3Quality].map(|of| case.get(of));
        for (k, quality) in quality.iter().enumerate().skip(1).take(2) {
            let source = if measured[k - 1] > 0.0 && view.is_in_fluid() {
                "in the fluid, at its own frequency"
            } else if measured[k - 1] > 0.0 {
                "as given"
            } else if case.has_q_control() {
                "in the closed loop"
            } else {
                "by damping in proportion to mass, several times that of real levers in air"
            };
            given.row([
                &format!("Q{}", k + 1),
                &number::significant(*quality, 4),
                source,
            ]);
        }
    }
    given.row([
        "mL",
        &Kind::Mass.format(lever.beam_mass),
        "mass of the beam",
    ]);
}

/// By how much so many modes are stiffer than the beam, see [`Modes::static_excess`].
fn static_excess(modes: usize) -> f64 {
    Modes::shared(modes).map_or(f64::NAN, |modes| modes.static_excess())
}

/// Where the undriven lever can rest.
fn rests(case: &Case, view: &Physical, table: &Frame<'_>) -> String {
    let mut text = format!(
        "\n  {}\n{}",
        style::bold("where the lever rests without a drive"),
        Table::all(table).render()
    );
    let all = equilibria(case);
    let drawn_in = |e: &Equilibrium| e.contact && e.deflection < 0.0;
    let mut stable = all.iter().filter(|e| e.stable).peekable();
    if view.cantilever.alpha5 > 0.0 && stable.peek().is_some() && stable.all(drawn_in) {
        text.push_str(&motion::paragraph(
            "the sample pulls harder than the lever holds back: it snaps in, and rests in contact only",
        ));
    }
    text
}

/// The force laws with their quantities, at a drive frequency in Hz.
fn force_rows(table: &mut Table, force: &SampleForce, frequency: f64) {
    for term in &force.terms {
        table.row(["", term.entry.name, term.entry.words]);
        table.row(["", "", &format!("F = {}", term.entry.formula)]);
    }
    if let Some(points) = force.table.as_ref().map(|table| table.rows().points())
        && let [(first, _), .., (last, _)] = points
    {
        let rows = number::counted(points.len(), "row", "rows");
        let gap = |gap: f64| Kind::Length.format(gap);
        table.row([
            "",
            &rows,
            &format!("of gap and force, from {} to {}", gap(*first), gap(*last)),
        ]);
    }
    let mut shown = Vec::new();
    for (parameter, key, value) in force.parameters() {
        if shown.contains(&key) {
            continue;
        }
        shown.push(key);
        let value = if value.is_infinite() && key == Key::SampleHorizon {
            "none".to_owned()
        } else if value.is_infinite() {
            "rigid".to_owned()
        } else {
            key.kind().format(value)
        };
        table.row(["", &value, parameter.words]);
    }
    if let Some(arms) = &force.arms {
        let arms = arms.arms().points();
        let number = arms.len();
        let time = |(time, _): &(f64, f64)| Kind::Time.format(*time);
        if let (Some(first), Some(last)) = (arms.first(), arms.last()) {
            let range = format!("relaxing arms, from {} to {}", time(first), time(last));
            table.row(["", &number.to_string(), &range]);
        }
        if let Some([storage, loss]) = force.dynamic_modulus(frequency) {
            for (symbol, value, words) in [
                (
                    "E'",
                    Kind::Pressure.format(storage),
                    "storage modulus at the drive frequency",
                ),
                (
                    "E''",
                    Kind::Pressure.format(loss),
                    "loss modulus at the drive frequency",
                ),
                (
                    "tan δ",
                    number::significant(loss / storage, 4),
                    "loss tangent E''/E'",
                ),
            ] {
                table.row([symbol, &value, words]);
            }
        }
    }
    if let Some(tabor) = force.tabor_parameter() {
        let value = number::significant(tabor, 3);
        let words = "Tabor's parameter (R w²/(E*² a0³))^(1/3): below about 1 DMT, above it JKR";
        table.row(["μ", &value, words]);
    }
}

/// The distances at which an orbit is at the setpoint, and what may be missing.
fn setpoint(report: &SetpointReport) -> String {
    let heading = format!("where {}", report.held_value());
    let table = Table::all(&report.solution_table()).render();
    let open = motion::paragraph(
        "States that neither the approach nor averaging meets may be missing: `window` over a range of \
         distances, or `attractors` at one, searches for more.",
    );
    format!("\n  {}\n{table}{open}", style::bold(&heading))
}

fn oscillator(case: &Case, oscillator: &Oscillator, numbers: &Frame<'_>) -> String {
    let what = match oscillator.stop {
        Stop::Soft { .. } => "an oscillator with a soft stop",
        Stop::Rigid { .. } => "an oscillator with a rigid stop",
    };
    format!(
        "{}\n\n{}",
        style::bold(&format!("{}: {what}", case.title())),
        Table::all(numbers).render()
    )
}
