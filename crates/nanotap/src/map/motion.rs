//! A motion between its strobes: every instant of it in closed form.

use std::sync::Arc;

use nanotap_flow::trajectory::Recorder;
use nanotap_flow::{Flow, FlowError, Output};

use super::{MapError, of_state};
use crate::model::nonlinear::Nonlinear;
use crate::model::recording::Recording;
use crate::model::{Model, MotionError};
use crate::observe::{ContactEvent, Contacts, Kept, Set, watch};

/// Most drive periods that a [`Motion`] keeps.
pub const MOST_PERIODS: f64 = 100_000.0;

/// A motion over a span of time.
#[derive(Clone, Debug)]
pub struct Motion {
    model: Arc<Model>,
    tip_rate: Output,
    recording: Recording,
    events: Vec<ContactEvent>,
    span: [f64; 2],
    /// The only state of a span of no length.
    start: (usize, Vec<f64>),
}

/// An instant of a motion; the model's units.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// When, in the model's time, 0 at drive phase 0 of the first period.
    pub tau: f64,
    /// State, of length n.
    pub state: Vec<f64>,
    /// Tip deflection W, of an oscillator x.
    pub tip: f64,
    /// Its rate.
    pub tip_rate: f64,
    /// Height of the tip over the undeformed surface, V_T.
    pub gap: f64,
    /// Force of the sample on the tip.
    pub force: f64,
    /// What ends the present regime by falling to zero: in flight the gap, in contact what
    /// keeps the contact. Not a number where nothing ends it.
    pub guard: f64,
    /// Whether tip and sample touch.
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
        if length > MOST_PERIODS * period {
            return Err(refused("more than 100000 drive periods are not kept"));
        }
        if let Some(nonlinear) = &model.nonlinear {
            if from != 0.0 {
                return Err(refused(
                    "under a nonlinear force law it must begin at drive phase 0",
                ));
            }
            return Self::under(model, nonlinear, state, length).map_err(of_state(0));
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
        Ok(Self {
            tip_rate: model.tip_rate(),
            recording: Recording::Exact(recorder.finish(Arc::clone(&model.system))),
            events: contacts.events(),
            span: [from, end],
            start: (regime, state.to_vec()),
            model: Arc::clone(model),
        })
    }

    /// A motion under a nonlinear force, of whole periods that are read up to its end.
    fn under(
        model: &Arc<Model>,
        nonlinear: &Nonlinear,
        state: &[f64],
        length: f64,
    ) -> Result<Self, MotionError> {
        let periods = (length / model.period()).ceil() as usize;
        let kept = Kept {
            recorded: periods,
            events: true,
            ..Kept::default()
        };
        let seen = watch(model, state, periods, Set::NONE, kept)?;
        let mut events = seen.events;
        events.retain(|event| event.tau <= length);
        let n = nonlinear.system.dimension();
        let (gap, rate) = nonlinear.system.gap(0.0, &state[..n]);
        Ok(Self {
            tip_rate: model.tip_rate(),
            recording: seen.recording,
            events,
            span: [0.0, length],
            start: (nonlinear.system.law().branch_at(gap, rate), state.to_vec()),
            model: Arc::clone(model),
        })
    }

    /// Where it begins and ends, in the model's time.
    pub fn span(&self) -> [f64; 2] {
        self.span
    }

    /// Contacts begun and ended, in order of time.
    pub fn events(&self) -> &[ContactEvent] {
        &self.events
    }

    /// The recording itself, for closed-form integrals, extrema and harmonics of any output.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// The motion at time `tau`; outside its span, at the nearer end.
    pub fn at(&self, tau: f64) -> Point {
        let tau = tau.clamp(self.span[0], self.span[1]);
        let trajectory = match &self.recording {
            Recording::Exact(trajectory) => trajectory,
            Recording::Nonlinear(_) => return self.nonlinear_at(tau),
        };
        let (regime, start, mut state) = match trajectory.segment_at(tau) {
            Some(segment) => (
                segment.regime,
                segment.start - segment.phase,
                trajectory.state_at(tau).unwrap_or_default(),
            ),
            None => (self.start.0, 0.0, self.start.1.clone()),
        };
        let (model, phase) = (&self.model, tau - start);
        let drive = model.system.drive();
        let at = |output: &Output| output.at(drive, &state, phase);
        let out = &model.system.transitions()[regime];
        let contact = model.contact[regime];
        let (tip, tip_rate, gap) = (at(&model.tip), at(&self.tip_rate), at(&model.height));
        let force = at(&model.force[regime]);
        let guard = out.first().map_or(f64::NAN, |out| at(&out.guard));
        // In contact the surface is where the tip holds it: see `time_series`.
        if model.memory_reset.is_some() && contact {
            let memory = state.len() - model.memory;
            state[memory] = gap;
        }
        Point {
            tau,
            state,
            tip,
            tip_rate,
            gap,
            force,
            guard,
            contact,
        }
    }

    /// The same under a nonlinear force, whose law may keep its own guards.
    fn nonlinear_at(&self, tau: f64) -> Point {
        let model = &self.model;
        let phase = tau.rem_euclid(model.period());
        let state = self.recording.state_at(tau);
        let state = state.unwrap_or_else(|| self.start.1.clone());
        let at = |output: &Output| output.at(model.system.drive(), &state, phase);
        let force = self.recording.force(model).at(tau);
        let stretches = self.recording.stretches(model);
        let inside = |s: &&crate::model::recording::Stretch| s.start <= tau;
        let contact = stretches
            .iter()
            .rev()
            .find(inside)
            .is_some_and(|s| s.contact);
        Point {
            tau,
            tip: at(&model.tip),
            tip_rate: at(&self.tip_rate),
            gap: at(&model.height),
            force: force.unwrap_or(f64::NAN),
            guard: f64::NAN,
            contact,
            state,
        }
    }
}
