//! A motion between its strobes, in closed form at every instant.

use std::sync::Arc;

use nanotap_flow::trajectory::Recorder;
use nanotap_flow::{Flow, FlowError, Output};

use super::{MapError, of_state};
use nanotap_model::Model;
use nanotap_model::recording::{Instant, Recording};
use nanotap_observe::{ContactEvent, Contacts, ObservableSet, RecordOptions, record};

/// Maximum number of drive periods of a [`Motion`].
pub const MAX_PERIODS: f64 = 100_000.0;

/// A motion over a span of time.
#[derive(Clone, Debug)]
pub struct Motion {
    model: Arc<Model>,
    tip_rate: Output,
    recording: Recording,
    events: Vec<ContactEvent>,
    span: [f64; 2],
    /// The only instant of a span of zero length.
    start: Instant,
}

/// An instant of a motion, in the model's units.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Time τ, model units; 0 at drive phase 0 of the first period.
    pub tau: f64,
    /// State, length n, model units.
    pub state: Vec<f64>,
    /// Tip deflection W, model units; x for an oscillator.
    pub tip: f64,
    /// Rate of the tip deflection, dW/dτ, model units; dx/dτ for an oscillator.
    pub tip_rate: f64,
    /// Height V_T of the tip above the undeformed surface, model units; minus the indentation in
    /// contact.
    pub gap: f64,
    /// Force of the sample on the tip, model units; positive when it pushes the tip away.
    pub force: f64,
    /// Guard of the present regime, model units: the gap in flight, the condition of contact in
    /// contact. The regime ends when the guard falls to zero. NaN if nothing ends the regime.
    pub guard: f64,
    /// Whether tip and sample are in contact.
    pub contact: bool,
}

impl Motion {
    pub(super) fn follow(
        model: &Arc<Model>,
        state: &[f64],
        from: f64,
        length: f64,
    ) -> Result<Self, MapError> {
        let period = model.period();
        let refused = |reason| MapError::Span {
            from,
            length,
            reason,
        };
        if !(0.0..period).contains(&from) {
            return Err(refused("it must begin within the first drive period"));
        }
        if length.is_nan() || length < 0.0 {
            return Err(refused("its length must be a number and not negative"));
        }
        if length > MAX_PERIODS * period {
            return Err(refused("more than 100000 drive periods are not kept"));
        }
        let motion = |recording, events, regime, end| Self {
            tip_rate: model.tip_rate(),
            recording,
            events,
            span: [from, end],
            start: Instant {
                state: state.to_vec(),
                phase: from,
                regime,
                nonlinear_force: None,
            },
            model: Arc::clone(model),
        };
        if model.nonlinear.is_some() {
            if from != 0.0 {
                return Err(refused(
                    "under a nonlinear force law it must begin at drive phase 0",
                ));
            }
            // Whole periods, evaluated up to the end of the span.
            let periods = ((length / period).ceil() as usize).max(1);
            let options = RecordOptions {
                recorded: periods,
                events: true,
                ..RecordOptions::default()
            };
            let recorded =
                record(model, state, periods, ObservableSet::NONE, options).map_err(of_state(0))?;
            let mut events = recorded.events;
            events.retain(|event| event.tau <= length);
            return Ok(motion(recorded.recording, events, 0, length));
        }
        let failed = |error: FlowError| of_state(0)(error.into());
        let mut flow = Flow::new(Arc::clone(&model.system));
        flow.start(state, from).map_err(failed)?;
        let regime = flow.regime();
        let (mut recorder, mut contacts) = (Recorder::default(), Contacts::of(model));
        let end = from + length;
        let whole = (end / period) as usize;
        for _ in 0..whole {
            flow.run_period(&mut (&mut recorder, &mut contacts))
                .map_err(failed)?;
        }
        let rest = end - whole as f64 * period;
        if rest > 0.0 {
            flow.run_until(rest, &mut (&mut recorder, &mut contacts))
                .map_err(failed)?;
        }
        let recording = Recording::PiecewiseLinear(recorder.finish(Arc::clone(&model.system)));
        Ok(motion(recording, contacts.events(), regime, end))
    }

    /// Beginning and end of the span, in the model's time.
    pub fn span(&self) -> [f64; 2] {
        self.span
    }

    /// Beginnings and ends of contacts, in order of time.
    pub fn events(&self) -> &[ContactEvent] {
        &self.events
    }

    /// The recording, for closed-form integrals, extrema and harmonics of any output.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// The motion at time `tau`; outside its span, at the nearer end.
    pub fn at(&self, tau: f64) -> Point {
        let tau = tau.clamp(self.span[0], self.span[1]);
        let instant = self.recording.instant(tau);
        let mut instant = instant.unwrap_or_else(|| self.start.clone());
        let model = &self.model;
        let drive = model.system.drive();
        let (phase, contact) = (instant.phase, model.touches(instant.regime));
        let at = |output: &Output| output.at(drive, &instant.state, phase);
        let (tip, tip_rate, gap) = (at(&model.tip), at(&self.tip_rate), at(&model.height));
        let force = model.force_at(&instant);
        // A nonlinear law may have guards of another kind.
        let transitions = model.system.transitions().get(instant.regime);
        let first = transitions.and_then(|out| out.first());
        let guard = first.map_or(f64::NAN, |out| at(&out.guard));
        model.set_surface(&mut instant.state, contact, gap);
        Point {
            tau,
            state: instant.state,
            tip,
            tip_rate,
            gap,
            force,
            guard,
            contact,
        }
    }
}
