//! Proofs of the orbits of one case.

use std::fmt::Write as _;

use nanotap_flow::Trajectory;
use nanotap_proof::{
    Candidate, EnclosedRest, Interval, ProofError, RigidStop, Stability, Switch, System, Theorem,
    prove, prove_sticking,
};

use nanotap_case::{Case, Key};
use nanotap_model::cantilever::{Cantilever, CosineTerm};
use nanotap_model::contact::ContactLaw;
use nanotap_model::drive_form::Actuation;
use nanotap_model::enclosed::{EnclosureError, enclosed, enclosed_oscillator, enclosed_stop};
use nanotap_model::oscillator::{Oscillator, OscillatorParameter};
use nanotap_model::recording::Recording;
use nanotap_quantity::number::shortest;

use super::{DiscReport, ProofReport, SwitchReport, TheoremReport, UniqueWithin};

/// Reasons why an orbit is not proved.
#[derive(Clone, Debug, thiserror::Error)]
pub enum NotProved {
    /// The case has no equations in intervals.
    #[error(transparent)]
    Equations(#[from] EnclosureError),
    /// The test of the proof failed, for the reason given.
    #[error(transparent)]
    Test(#[from] ProofError),
}

/// Prover for the orbits of one case.
#[derive(Debug)]
pub struct Prover {
    system: Result<System, EnclosureError>,
    /// The rigid stop on which an orbit may rest.
    stop: Option<RigidStop>,
    /// Parameters of the case with which a theorem begins, as text.
    about: String,
}

impl Prover {
    /// Creates the prover for a case, whose equations may have no intervals.
    pub fn new(case: &Case) -> Self {
        let (system, about) = match (case.cantilever(), case.oscillator()) {
            (Some(cantilever), _) => (enclosed(cantilever), about(cantilever)),
            (None, Some(oscillator)) => (
                enclosed_oscillator(oscillator),
                about_oscillator(oscillator),
            ),
            (None, None) => (Err(EnclosureError::NotPiecewiseLinear), String::new()),
        };
        let system = system.map(|system| system.cancelled_by(case.cancel().clone()));
        let stop = case.oscillator().and_then(enclosed_stop);
        Self {
            system,
            stop,
            about,
        }
    }

    /// Proves one orbit of this period, of which `orbit` is the recording.
    ///
    /// # Errors
    /// [`NotProved`] says why that was not possible.
    pub fn theorem(&self, orbit: &Recording, period: usize) -> Result<Theorem, NotProved> {
        let system = self.system.as_ref().map_err(Clone::clone)?;
        let Recording::PiecewiseLinear(trajectory) = orbit else {
            return Err(EnclosureError::NotPiecewiseLinear.into());
        };
        let candidate = candidate(trajectory, period);
        let released = trajectory
            .events()
            .iter()
            .rposition(|event| trajectory.system().sticks(event.from));
        Ok(match (&self.stop, released) {
            (Some(stop), Some(released)) => {
                let (before, release, impacts) = since_release(system, &candidate, released);
                let theorem = prove_sticking(system, stop, release, &impacts)?;
                counted_from(system, theorem, before)
            }
            _ => prove(system, &candidate)?,
        })
    }

    /// Proves one orbit of this period and returns the theorem, or the reason why it failed, as a
    /// report.
    pub fn report(&self, orbit: &Recording, period: usize) -> ProofReport {
        match self.theorem(orbit, period) {
            Ok(theorem) => ProofReport {
                proved: true,
                statement: statement(&theorem, &self.about),
                theorem: Some(TheoremReport::of(&theorem)),
            },
            Err(reason) => ProofReport {
                proved: false,
                statement: format!("not proved: {reason}"),
                theorem: None,
            },
        }
    }
}

/// The switches of a recorded orbit, with the states after them.
pub fn candidate(trajectory: &Trajectory, period: usize) -> Candidate {
    let transitions = trajectory.system().transitions();
    let switches = trajectory
        .events()
        .iter()
        .map(|event| Switch {
            time: event.time,
            from: event.from,
            transition: transitions[event.from]
                .iter()
                .position(|t| t.target == event.to)
                .unwrap_or_default(),
            state: trajectory.state_at(event.time).unwrap_or_default(),
        })
        .collect();
    Candidate {
        period,
        regime: trajectory.segments().first().map_or(0, |s| s.regime),
        switches,
    }
}

/// The number of whole drive periods before the switch number `released`, by which the mass leaves
/// its stop, its time within its drive period, and the switches that follow it until it comes again.
fn since_release(
    system: &System,
    candidate: &Candidate,
    released: usize,
) -> (usize, f64, Vec<Switch>) {
    let period = system.period().middle();
    let release = candidate.switches[released].time;
    let phase = release.rem_euclid(period);
    let periods_before = ((release - phase) / period).round() as usize;
    let (before, after) = candidate.switches.split_at(released);
    let whole = candidate.period as f64 * period;
    let later = |switch: &Switch, turn: f64| Switch {
        time: switch.time - release + phase + turn,
        ..switch.clone()
    };
    let following = after[1..].iter().map(|switch| later(switch, 0.0));
    let around = before.iter().map(|switch| later(switch, whole));
    (periods_before, phase, following.chain(around).collect())
}

/// The theorem about an orbit that sticks with its times and states counted from `before` drive
/// periods earlier, where the recorded orbit begins.
fn counted_from(system: &System, theorem: Theorem, before: usize) -> Theorem {
    let whole = Interval::point(theorem.period as f64) * system.period();
    let later = |time: Interval| {
        let time = time + Interval::point(before as f64) * system.period();
        if time.middle() < whole.middle() {
            time
        } else {
            time - whole
        }
    };
    let mut switches = theorem.switches;
    for switch in &mut switches {
        switch.time = later(switch.time);
    }
    switches.sort_by(|a, b| a.time.middle().total_cmp(&b.time.middle()));
    let mut states = theorem.states;
    states.rotate_right(before % theorem.period);
    Theorem {
        switches,
        states,
        rest: theorem.rest.map(|rest| EnclosedRest {
            release: later(rest.release),
            since: later(rest.since),
        }),
        ..theorem
    }
}

/// Returns the proved stability of an orbit in a word: stable, unstable or undecided.
fn stability(theorem: &Theorem) -> &'static str {
    match theorem.multipliers.stability() {
        Stability::Stable => "stable",
        Stability::Unstable => "unstable",
        Stability::Undecided => "undecided",
    }
}

/// The numbers of a case, and what of it is not as in the paper.
fn about(case: &Cantilever) -> String {
    let numbers: Vec<String> = case
        .parameters()
        .into_iter()
        .map(|parameter| format!("{} = {}", parameter.name(), shortest(case.get(parameter))))
        .collect();
    let mut text = format!("N = {}, {}", case.modes, numbers.join(", "));
    for (ratio, key) in case.further_tones.iter().zip(Key::TONE_RATIOS) {
        let _ = write!(text, ", {} = {ratio}", key.name());
    }
    if case.contact != ContactLaw::default() {
        let _ = write!(text, ", contact = {}", case.contact);
    }
    if case.actuation != Actuation::default() {
        let _ = write!(text, ", actuation = {}", case.actuation);
    }
    if case.cosine_term != CosineTerm::default() {
        let _ = write!(text, ", cosine_term = {}", case.cosine_term.name());
    }
    text
}

/// The numbers of an oscillator.
fn about_oscillator(oscillator: &Oscillator) -> String {
    let numbers: Vec<String> = OscillatorParameter::ALL
        .into_iter()
        .filter_map(|p| Some(format!("{} = {}", p.name(), shortest(oscillator.get(p)?))))
        .collect();
    numbers.join(", ")
}

/// Returns the theorem as a sentence.
fn statement(theorem: &Theorem, about: &str) -> String {
    let radius = |interval: &Interval| interval.radius();
    let largest = |all: &mut dyn Iterator<Item = f64>| all.fold(0.0, f64::max);
    let state = largest(&mut theorem.states.iter().flatten().map(radius));
    let mut text = format!(
        "for {about}, each number standing for every decimal that is read as it, an orbit of minimal period {} \
         exists; its states at drive phase 0 are known to {state:.1e}",
        theorem.period
    );
    match (&theorem.isolation, &theorem.rest) {
        (_, Some(rest)) => {
            let _ = write!(
                text,
                "; the mass leaves its stop at the time {:.6}; {} impacts later, whose times are known to {:.1e}, it is \
                 so slow and pressed so hard that infinitely many more are over by the time {:.6}; then it rests \
                 until it is released again",
                rest.release.middle(),
                theorem.switches.len(),
                largest(&mut theorem.switches.iter().map(|s| s.time.radius())),
                rest.since.hi(),
            );
        }
        (Some(alone), None) => {
            let time = largest(&mut theorem.switches.iter().map(|s| s.time.radius()));
            let _ = write!(
                text,
                ", the times of its {} switches between flight and contact to {time:.1e}, and it switches nowhere \
                 else; no other orbit of that period and that sequence of flights and contacts has all its \
                 switches within {:.1e} of these times and in states as near as `unique_within` says",
                theorem.switches.len(),
                alone.time,
            );
        }
        (None, None) => text.push_str(
            ", and it never switches; no other orbit of that period stays in the same regime",
        ),
    }
    let discs = &theorem.multipliers.discs;
    let reach = largest(&mut discs.iter().map(|d| d.radius));
    let _ = match theorem.multipliers.stability() {
        Stability::Stable if theorem.rest.is_some() => write!(
            text,
            "; every motion near it comes to rest with it and is the same from then on: its multipliers are exactly 0"
        ),
        Stability::Stable => write!(
            text,
            "; its multipliers, with an error below {reach:.1e}, are all inside the unit circle: it is asymptotically stable"
        ),
        Stability::Unstable => write!(
            text,
            "; of its multipliers, with an error below {reach:.1e}, at least one is outside the unit circle: it is unstable"
        ),
        Stability::Undecided if discs.is_empty() => {
            write!(text, "; its multipliers could not be enclosed")
        }
        Stability::Undecided => write!(
            text,
            "; its multipliers have an error of up to {reach:.1e}, which leaves its stability open"
        ),
    };
    text
}

impl TheoremReport {
    fn of(theorem: &Theorem) -> Self {
        let bounds = |x: &Interval| [x.lo(), x.hi()];
        let first = theorem.states.first();
        Self {
            period: theorem.period,
            state: first.map_or_else(Vec::new, |s| s.iter().map(bounds).collect()),
            switches: theorem
                .switches
                .iter()
                .map(|switch| SwitchReport {
                    time: bounds(&switch.time),
                    begins: switch.to != 0 || switch.from == switch.to,
                })
                .collect(),
            unique_within: theorem.isolation.as_ref().map(|alone| UniqueWithin {
                time: alone.time,
                state: alone.state.clone(),
            }),
            multipliers: theorem
                .multipliers
                .discs
                .iter()
                .map(|disc| DiscReport {
                    center: [disc.center.re, disc.center.im],
                    radius: disc.radius,
                    count: disc.count,
                })
                .collect(),
            stability: stability(theorem),
        }
    }
}
