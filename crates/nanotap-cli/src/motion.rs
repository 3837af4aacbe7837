//! The text of a motion: observables, energy, spectrum, multipliers. Shared by every
//! command that shows motions.

use std::fmt::Write as _;

use nanotap::case::Case;
use nanotap::case::physical::Kind;
use nanotap::case::physical::quantity::format_electronvolts;
use nanotap::case::units::Units;
use nanotap::model::Model;
use nanotap::observe::table::shown_phase;
use nanotap::observe::{
    Derivative, Harmonic, ObservableSet, Observables, Spectrum, Value, time_series,
};
use nanotap::study::proof::ProofReport;
use nanotap::study::simulate::Classification;

pub(crate) use crate::page::paragraph;
use crate::text_table::{Align, Table};
use crate::{number, style};

/// The heading: what the motion is.
pub(crate) fn verdict(classification: Classification, period: Option<usize>) -> String {
    match period {
        Some(1) => "periodic: it repeats every drive period".to_owned(),
        Some(n) => format!("periodic: it repeats every {n} drive periods"),
        None => classification.name().to_owned(),
    }
}

/// A lag in degrees behind a tone, or how far ahead of it.
pub(crate) fn lag(phase: f64, tone: &str, digits: usize) -> String {
    let phase = shown_phase(phase);
    let way = if phase < 0.0 { "ahead of" } else { "behind" };
    format!("{}° {way} {tone}", number::significant(phase.abs(), digits))
}

/// Formats the observables: tip, gap, contact, force and energy, or one row for each selected
/// observable.
pub(crate) fn observed(o: &Observables, chosen: Option<ObservableSet>, case: &Case) -> String {
    let (units, lever) = (&case.units(), case.cantilever());
    let lost = match lever {
        Some(lever) if lever.has_q_control() => "beam damping and Q control",
        _ => "beam damping",
    };
    if let Some(chosen) = chosen {
        return choice(o, chosen, units, lost);
    }
    let table = observables(o, units, lever.is_some());
    format!("{table}\n{}", energy(o, units, lost))
}

fn choice(o: &Observables, chosen: ObservableSet, units: &Units, lost: &str) -> String {
    let mut table = Table::new([("", Align::Left); 3]);
    let mut balance = String::new();
    for observable in chosen.iter() {
        let numbers = match (observable.of)(o) {
            Value::Absent => Vec::new(),
            Value::Number(number) => vec![number],
            Value::Count(count) => vec![count as f64],
            Value::Range(ends) => ends.to_vec(),
            Value::Energies(_) => {
                balance = energy(o, units, lost);
                continue;
            }
        };
        let kind = observable.dimension.kind().unwrap_or(Kind::Number);
        let shown = |value| number::quantity(units, kind, value, [6, 4]);
        let shown: Vec<String> = numbers.into_iter().map(shown).collect();
        table.row([
            observable.name.to_owned(),
            shown.join(" … "),
            observable.words.to_owned(),
        ]);
    }
    table.render() + &balance
}

/// Formats the table of tip, gap, contact and force.
fn observables(o: &Observables, units: &Units, beam: bool) -> String {
    let shown = |kind, value, digits| number::quantity(units, kind, value, [digits, 4]);
    let range = |kind, ends| number::range(units, kind, ends, [6, 4]);
    let mut table = Table::new([("", Align::Left); 3]);
    let words = |name: &str, what: &str, note: &str| [name, what, note].map(str::to_owned);
    let row = |name: &str, value, digits, kind, note: &str| {
        words(name, &shown(kind, value, digits), note)
    };
    let length = |name, value, note: &str| row(name, value, 6, Kind::Length, note);
    let between = |name, ends, note: &str| words(name, &range(Kind::Length, ends), note);
    let tip = if beam {
        "tip deflection W"
    } else {
        "displacement x"
    };
    let mean = format!("mean {}", shown(Kind::Length, o.mean_deflection, 4));
    table.row(between(tip, [o.tip_min, o.tip_max], &mean));
    table.row(length("amplitude", o.amplitude, "half of peak to peak"));
    let behind = lag(o.phase, "the drive", 4);
    table.row(length(
        "at the drive's frequency",
        o.first_harmonic,
        &behind,
    ));
    for (what, tone) in [
        ("at the second tone", o.tone2_response.zip(o.tone2_lag)),
        ("at the third tone", o.tone3_response.zip(o.tone3_lag)),
    ] {
        if let Some((amplitude, phase)) = tone {
            table.row(length(what, amplitude, &lag(phase, "that tone", 4)));
        }
    }
    if let Some((amplitude, phase)) = o.tip_motion.zip(o.tip_motion_phase) {
        let behind = format!("{}, deflection and base", lag(phase, "the base", 4));
        table.row(length("the tip itself moves", amplitude, &behind));
    }
    table.row(between("gap", o.gap_range, ""));
    if o.contacts_per_period > 0.0 || o.contact_fraction > 0.0 {
        let grazing = match o.grazing_contacts.unwrap_or(0) {
            0 => String::new(),
            n => format!(", {n} of them grazing"),
        };
        let count = number::significant(o.contacts_per_period, 3);
        let count = format!("{count} a period{grazing}");
        // A rigid stop is touched for an instant.
        if o.contact_fraction > 0.0 {
            let percent = number::significant(100.0 * o.contact_fraction, 4);
            table.row(words(
                "contact",
                &format!("{percent} % of the time"),
                &count,
            ));
        } else {
            table.row(words("impacts", "", &count));
        }
        let greatest = "largest at which a contact begins";
        let speed = o.impact_speed;
        table.row(row("impact speed", speed, 5, Kind::Velocity, greatest));
        if o.contact_fraction > 0.0 {
            let force = format!("up to {}", shown(Kind::Force, o.peak_force, 6));
            let mean = format!("mean {}", shown(Kind::Force, o.mean_force, 4));
            table.row(words("force on the tip", &force, &mean));
            let depth = "largest depth below the surface at rest";
            table.row(row("indentation", o.indentation, 5, Kind::Length, depth));
        }
    } else {
        table.row(words("contact", "none", ""));
    }
    // An attraction acts without contact too.
    if o.least_force < 0.0 {
        let pull = format!("up to {}", shown(Kind::Force, -o.least_force, 6));
        let note = "largest force on the tip towards the sample";
        table.row(words("pull of the sample", &pull, note));
    }
    if o.peak_force > 0.0 || o.least_force < 0.0 {
        let note = "mean of force times deflection";
        table.row(row("virial ⟨F·W⟩", o.virial, 5, Kind::Energy, note));
    }
    if let Some((height, xi)) = o.beam_clearance.zip(o.beam_clearance_xi) {
        let place = if xi > 0.999 {
            "at the tip".to_owned()
        } else {
            format!("at ξ = {}", number::significant(xi, 3))
        };
        let least = format!("smallest height of the beam, {place}");
        table.row(row("beam clearance", height, 5, Kind::Length, &least));
    }
    if let Some(ends) = o.slope_range {
        table.row(words("slope at the tip", &range(Kind::Number, ends), ""));
    }
    if let Some((amplitude, phase)) = o.optical_amplitude.zip(o.optical_phase) {
        let behind = lag(phase, "the drive", 4);
        let behind = format!("{behind}, calibrated by a static force");
        table.row(length("an optical lever reads", amplitude, &behind));
    }
    table.render()
}

/// Formats the energy balance: the work of the drive and the losses, per period; `lost` names what takes
/// energy from the lever, or gives it.
fn energy(o: &Observables, units: &Units, lost: &str) -> String {
    let balance = &o.energy_balance;
    let mut table = Table::new([("", Align::Left), ("", Align::Point), ("", Align::Left)]);
    let mut row = |name: &str, value: f64, in_electronvolts: bool| {
        let value = balance.resolved(value) / o.periods;
        let joules = units.si(Kind::Energy).map(|unit| unit * value);
        let shown = joules.map_or_else(
            || number::significant(value, 6),
            |joules| Kind::Energy.format(joules),
        );
        let note = joules
            .filter(|_| in_electronvolts)
            .map(format_electronvolts);
        table.row([name.to_owned(), shown, note.unwrap_or_default()]);
    };
    row("drive work", balance.drive_work, false);
    row(lost, -balance.beam_damping, false);
    row("sample damping", -balance.sample_damping, true);
    row("stored", -balance.stored, false);
    let mut text = format!(
        "  {}\n{}",
        style::bold("energy a drive period"),
        table.render()
    );
    let _ = writeln!(
        text,
        "  the sum closes to {} of the energy moved",
        number::significant(balance.residual.abs(), 2)
    );
    text
}

/// Phase, distortion and the first harmonics.
pub(crate) fn spectrum(spectrum: &Spectrum, period: usize, units: &Units) -> String {
    const SHOWN: usize = 8;
    let mut text = format!(
        "  {}\n  phase {}, distortion {} % of the amplitude, {} % of the power\n",
        style::bold("harmonics of the tip deflection and of the force"),
        lag(spectrum.phase, "the drive", 6),
        number::significant(100.0 * spectrum.distortion(), 4),
        number::significant(100.0 * spectrum.thd, 4),
    );
    let several_tones = spectrum.harmonics.iter().any(|h| h.product.is_some());
    let mut columns = vec![
        ("order", Align::Point),
        ("tip", Align::Point),
        ("lag (°)", Align::Point),
        ("force", Align::Point),
        ("lag (°)", Align::Point),
    ];
    if several_tones {
        columns.insert(0, ("product", Align::Left));
    }
    let mut table = Table::new(columns);
    // Of a subharmonic motion the strong ones, under several tones the strongest, by size (sidebands are
    // far from the first orders), otherwise the first.
    let mut shown: Vec<&Harmonic> = spectrum.harmonics.iter().collect();
    let count = if several_tones {
        shown.sort_by(|a, b| b.tip.total_cmp(&a.tip));
        2 * SHOWN
    } else {
        let largest = shown.iter().fold(0.0, |m: f64, h| m.max(h.tip));
        let least = if period == 1 { 0.0 } else { 1e-3 * largest };
        shown.retain(|h| h.tip >= least);
        SHOWN.max(2 * period).min(2 * SHOWN)
    };
    for h in shown.into_iter().take(count) {
        // The lag of nothing is noise.
        let lag = |amplitude: f64, lag: f64| {
            if amplitude > 0.0 {
                format!("{lag:.2}")
            } else {
                String::new()
            }
        };
        let mut row = vec![
            number::chosen((h.order * 1e6).round() / 1e6),
            number::quantity(units, Kind::Length, h.tip, [5, 4]),
            lag(h.tip, h.tip_phase),
            number::quantity(units, Kind::Force, h.force, [5, 4]),
            lag(h.force, h.force_phase),
        ];
        if several_tones {
            row.insert(0, h.product.as_deref().map_or_else(String::new, product));
        }
        table.row(row);
    }
    text.push_str(&table.render());
    text
}

/// A product of several tones as it is written: 2f2 − f1.
fn product(of: &[i32]) -> String {
    let mut parts: Vec<(i32, usize)> = of.iter().copied().zip(1..).collect();
    parts.sort_by_key(|(times, _)| *times < 0);
    let mut text = String::new();
    for (times, tone) in parts.into_iter().filter(|(times, _)| *times != 0) {
        text.push_str(match (times < 0, text.is_empty()) {
            (true, true) => "−",
            (true, false) => " − ",
            (false, true) => "",
            (false, false) => " + ",
        });
        if times.abs() != 1 {
            let _ = write!(text, "{}", times.abs());
        }
        let _ = write!(text, "f{tone}");
    }
    text
}

/// Formats the table of Floquet multipliers, at most 8 of them.
pub(crate) fn multipliers(multipliers: &[[f64; 2]]) -> String {
    const SHOWN: usize = 8;
    let mut table = Table::new([
        ("|μ|", Align::Point),
        ("Re μ", Align::Point),
        ("Im μ", Align::Point),
    ]);
    for [re, im] in multipliers.iter().take(SHOWN) {
        table.row([
            number::significant(nanotap_arithmetic::hypot(*re, *im), 7),
            number::significant(*re, 7),
            number::significant(*im, 7),
        ]);
    }
    let mut text = format!(
        "  {}\n{}",
        style::bold("Floquet multipliers"),
        table.render()
    );
    if multipliers.len() > SHOWN {
        let _ = writeln!(text, "  and {} smaller", multipliers.len() - SHOWN);
    }
    text
}

/// Formats what was proved of an orbit: the theorem, and its enclosures.
pub(crate) fn proof(proof: &ProofReport, model: &Model) -> String {
    let Some(theorem) = &proof.theorem else {
        return paragraph(&proof.statement);
    };
    let mut text = format!("  {}\n", style::bold("theorem"));
    text.push_str(&paragraph(&proof.statement));
    let mut table = Table::new([
        ("", Align::Left),
        ("at least", Align::Point),
        ("at most", Align::Point),
        ("unique within, at its switches", Align::Left),
    ]);
    let alone = theorem.unique_within.as_ref();
    let mut row = |name: String, [low, high]: [f64; 2], alone: Option<f64>| {
        let alone = alone.map_or_else(String::new, |radius| format!("{radius:.1e}"));
        table.row([name, low.to_string(), high.to_string(), alone]);
    };
    let names = time_series::state_names(model);
    for (k, (name, bounds)) in names.into_iter().zip(&theorem.state).enumerate() {
        row(name, *bounds, alone.map(|a| a.state[k]));
    }
    for switch in theorem.switches.iter().take(SWITCHES_SHOWN) {
        let what = if switch.begins {
            "contact begins"
        } else {
            "contact ends"
        };
        row(what.to_owned(), switch.time, alone.map(|a| a.time));
    }
    text.push_str(&table.render());
    if theorem.switches.len() > SWITCHES_SHOWN {
        let more = theorem.switches.len() - SWITCHES_SHOWN;
        text.push_str(&paragraph(&format!(
            "and {more} more switches (--json has all)"
        )));
    }
    let mut table = Table::new([
        ("Re μ", Align::Point),
        ("Im μ", Align::Point),
        ("within", Align::Left),
        ("multipliers", Align::Right),
    ]);
    for disc in &theorem.multipliers {
        let [re, im] = disc.center.map(|x| number::significant(x, 12));
        table.row([
            re,
            im,
            format!("{:.1e}", disc.radius),
            disc.count.to_string(),
        ]);
    }
    text.push_str(&table.render());
    text
}

/// Number of switches of a theorem that are listed.
const SWITCHES_SHOWN: usize = 12;

/// The derivatives of what is observed of an orbit with respect to a key: of a physical case in
/// SI units.
pub(crate) fn derivative(key: &str, derivative: &Derivative, is_beam: bool) -> String {
    let mut table = Table::new([("", Align::Left), ("", Align::Point), ("", Align::Left)]);
    let physical = derivative.physical.as_ref();
    for (observable, change) in physical.unwrap_or(&derivative.observables) {
        let Some(change) = change.number() else {
            continue;
        };
        let (name, unit) = match physical {
            Some(_) => (observable.si_name, observable.dimension.si_unit()),
            // An oscillator has the units of its file.
            None if !is_beam && observable.dimension.kind().is_some() => (observable.name, ""),
            None => (observable.name, observable.dimension.model_unit()),
        };
        let per = derivative
            .unit
            .map_or_else(String::new, |per| format!(" / ({per})"));
        table.row([
            name.to_owned(),
            number::significant(change, 7),
            format!("{unit}{per}"),
        ]);
    }
    let heading = format!("derivatives by {key}");
    format!("  {}\n{}", style::bold(&heading), table.render())
}

/// Lyapunov exponents in one line.
pub(crate) fn exponents(exponents: &[f64], errors: Option<&[f64]>) -> String {
    let list: Vec<String> = exponents
        .iter()
        .enumerate()
        .map(|(k, value)| match errors.and_then(|e| e.get(k)) {
            Some(error) => format!(
                "{} ± {}",
                number::significant(*value, 3),
                number::significant(*error, 1)
            ),
            None => number::significant(*value, 4),
        })
        .collect();
    list.join(", ")
}
