//! Command lines that reproduce a result. Each contains its whole case, so that it can be run
//! anywhere.

use std::fmt::Write as _;

use nanotap::case::Key;
use nanotap::model::cantilever::{Cantilever, CosineTerm};
use nanotap::model::contact::ContactLaw;
use nanotap::model::drive_form::Actuation;
use nanotap::model::oscillator::{Oscillator, OscillatorParameter, Stop};

/// `nanotap command` on `case`, followed by `options`.
pub(super) fn on_case(command: &str, case: &Cantilever, options: &str) -> String {
    let mut line = format!("nanotap {command} --set modes={}", case.modes);
    for parameter in case.parameters() {
        let _ = write!(line, " --set {}={}", parameter.name(), case.get(parameter));
    }
    if case.cosine_term == CosineTerm::Printed {
        line.push_str(" --set cosine_term=printed");
    }
    if case.actuation != Actuation::default() {
        let _ = write!(line, " --set actuation={}", case.actuation);
    }
    for (ratio, key) in case.further_tones.iter().zip(Key::TONE_RATIOS) {
        let _ = write!(line, " --set {}={ratio}", key.name());
    }
    if case.contact != ContactLaw::default() {
        let _ = write!(line, " --set contact={}", case.contact);
    }
    finish(line, options)
}

/// The same for an oscillator.
pub(super) fn on_oscillator(command: &str, oscillator: &Oscillator, options: &str) -> String {
    let kind = match oscillator.stop {
        Stop::Soft { .. } => "vibro_impact",
        Stop::Rigid { .. } => "impact",
    };
    let mut line = format!("nanotap {command} --set kind={kind}");
    for parameter in OscillatorParameter::ALL {
        if let Some(value) = oscillator.get(parameter) {
            let _ = write!(line, " --set {}={value}", parameter.name());
        }
    }
    finish(line, options)
}

/// The command line that recomputes the section `id` of this report.
pub(super) fn section(id: &str) -> String {
    format!("nanotap paper --only {id}")
}

/// A state in the form of `--state`.
pub(super) fn state(state: &[f64]) -> String {
    let numbers: Vec<String> = state.iter().map(|v| format!("{v}")).collect();
    format!("--state {}", numbers.join(","))
}

fn finish(mut line: String, options: &str) -> String {
    if !options.is_empty() {
        line.push(' ');
        line.push_str(options);
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap::case::Case;
    use nanotap::model::parameter::Parameter;

    /// The arguments after `--set`, as the shell passes them.
    fn overrides(line: &str) -> Vec<String> {
        let mut words = line.split(' ');
        let mut set = Vec::new();
        while let Some(word) = words.next() {
            if word == "--set" {
                set.extend(words.next().map(str::to_owned));
            }
        }
        set
    }

    #[test]
    fn a_command_line_says_its_whole_case() {
        let mut case = Cantilever::paper()
            .with_modes(5)
            .with(Parameter::Omega, 20.0);
        case.cosine_term = CosineTerm::Printed;
        case.contact = ContactLaw::KelvinVoigt;
        case.further_tones = vec!["25/4".parse().unwrap()];
        case.further.set(Parameter::Tone2Amplitude, 0.01);
        let line = on_case("simulate", &case, "--periods 4");
        assert!(line.starts_with("nanotap simulate ") && line.ends_with(" --periods 4"));
        let read = Case::parse(None, &overrides(&line)).unwrap();
        assert_eq!(read, Case::from(case));
    }

    #[test]
    fn so_does_one_on_an_oscillator() {
        for stop in [
            Stop::Soft {
                stiffness: 20.0,
                damping: 0.2,
            },
            Stop::Rigid { restitution: 0.8 },
        ] {
            let oscillator = Oscillator {
                mass: 1.0,
                stiffness: 1.0,
                damping: 0.0,
                forcing: 1.0,
                omega: 2.5,
                gap: 0.0,
                stop,
            };
            let line = on_oscillator("orbit", &oscillator, "");
            let read = Case::parse(None, &overrides(&line)).unwrap();
            assert_eq!(read, Case::from(oscillator));
        }
    }

    #[test]
    fn states_come_back_to_the_last_digit() {
        let x = [0.1, -1.0 / 3.0, 1e-17];
        let text = state(&x);
        let back: Vec<f64> = text["--state ".len()..]
            .split(',')
            .map(|v| v.parse().unwrap())
            .collect();
        assert_eq!(back, x);
    }
}
