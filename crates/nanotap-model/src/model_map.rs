//! The stroboscopic map of a model: the interface between the engines, the exact flow and that
//! under a nonlinear force, and the analysis of motions.

use std::fmt::Debug;
use std::sync::Arc;

use nalgebra::DMatrix;
use nanotap_dynamics::map::{in_sequence, in_sequence_through};
use nanotap_dynamics::{AfterReset, PeriodicOrbit, Scheduling, StroboscopicMap, Tangency};
use nanotap_flow::flow::{Observer, SegmentView, SwitchView};
use nanotap_flow::jacobian::Jacobian;
use nanotap_flow::search::sign_changes;
use nanotap_flow::sensitivity::SystemTangent;
use nanotap_flow::system::{Switch, Transition};
use nanotap_flow::{Ensemble, Flow, FlowError, Output, System};

use crate::nonlinear::NonlinearMap;
use crate::release::{Release, ReleaseMotion};
use crate::{Model, MotionError, RigidStop, Tangent, TangentKind};

/// The stroboscopic map as an engine computes it.
pub(crate) trait EngineMap: Debug + Send + Sync {
    /// A clone, whose work space is separate.
    fn boxed(&self) -> Box<dyn EngineMap>;
    /// Returns the dimension of the state.
    fn dimension(&self) -> usize;
    /// Returns the drive period, in model units of time.
    fn period(&self) -> f64;
    /// Implements [`ModelMap::move_gap`].
    fn move_gap(&mut self, gap: f64, visit: &mut dyn FnMut(&mut f64)) -> Result<(), MotionError>;
    /// Evaluations so far: of the gap in searches for switches, or of a nonlinear force.
    fn evaluations(&self) -> u64;
    /// Implements [`StroboscopicMap::discrete_entries`].
    fn discrete_entries(&self) -> usize {
        0
    }
    /// Implements [`Scheduling::is_costly`].
    fn is_costly(&self) -> bool {
        false
    }
    /// Implements [`Scheduling::cost`].
    fn cost(&self) -> u64 {
        0
    }
    /// Implements [`Scheduling::add_cost`].
    fn add_cost(&mut self, cost: u64) {
        let _ = cost;
    }
    /// Implements [`Scheduling::coarse`].
    fn coarse(&self) -> Option<Box<dyn EngineMap>> {
        None
    }
    /// Implements [`Scheduling::batch_size`].
    fn batch_size(&self) -> usize {
        1
    }
    /// The work space of a batch; `None` where states are advanced in sequence.
    fn ensemble(&mut self) -> Option<&mut Ensemble> {
        None
    }
    /// Implements [`StroboscopicMap::advance`].
    fn advance(&mut self, state: &mut [f64]) -> Result<(), MotionError> {
        self.advance_by(state, 1)
    }
    /// Implements [`StroboscopicMap::advance_by`].
    fn advance_by(&mut self, state: &mut [f64], periods: usize) -> Result<(), MotionError>;
    /// Implements [`ModelMap::advance_between`].
    fn advance_between(&mut self, state: &mut [f64], span: [f64; 2]) -> Result<(), MotionError>;
    /// Implements [`StroboscopicMap::advance_with_jacobian`].
    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), MotionError>;
    /// Implements [`ModelMap::advance_with_derivatives`]; the default has no derivatives.
    fn advance_with_derivatives(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivatives: &mut DMatrix<f64>,
    ) -> Result<(), MotionError> {
        *derivatives = DMatrix::zeros(state.len(), 0);
        self.advance_with_jacobian(state, jacobian)
    }
    /// Implements [`StroboscopicMap::advance_with_jacobian_and_determinant`].
    fn advance_with_determinant(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<Option<f64>, MotionError> {
        self.advance_with_jacobian(state, jacobian)?;
        Ok(Some(self.log_determinant_bound()).filter(|log| log.is_finite()))
    }
    /// Implements [`StroboscopicMap::log_determinant_bound`].
    fn log_determinant_bound(&self) -> f64;
    /// Implements [`StroboscopicMap::pass_touches`].
    fn pass_touches(&mut self) {}
    /// Implements [`StroboscopicMap::across_impact`].
    fn across_impact(&self, state: &[f64]) -> Option<Vec<f64>> {
        let _ = state;
        None
    }
    /// Implements [`StroboscopicMap::resets`].
    fn resets(&self) -> u64 {
        0
    }
    /// Implements [`StroboscopicMap::after_reset`].
    fn after_reset(&self) -> Option<Arc<AfterReset>> {
        None
    }
    /// Implements [`StroboscopicMap::advance_with_tangencies`].
    fn advance_with_tangencies(
        &mut self,
        state: &mut [f64],
        tangencies: &mut Vec<Tangency>,
    ) -> Result<(), MotionError> {
        let _ = tangencies;
        self.advance(state)
    }
}

/// The map from the state at drive phase 0 to the state one drive period later.
#[derive(Debug)]
pub struct ModelMap(Box<dyn EngineMap>);

impl Clone for ModelMap {
    fn clone(&self) -> Self {
        Self(self.0.boxed())
    }
}

impl ModelMap {
    /// Creates the map of `model`, without derivatives by parameters.
    pub fn new(model: &Model) -> Self {
        Self::with_tangents(model, Vec::new())
    }

    /// Creates the map of `model` with its derivatives along `tangents`, in their order.
    pub fn with_tangents(model: &Model, tangents: Vec<Tangent>) -> Self {
        let (mut exact, mut nonlinear) = (Vec::new(), Vec::new());
        for tangent in tangents {
            match tangent.0 {
                TangentKind::PiecewiseLinear(tangent) => exact.push(tangent),
                TangentKind::Nonlinear(variation) => nonlinear.push(variation),
            }
        }
        Self(match &model.nonlinear {
            None => Box::new(ExactMap::new(model, exact)),
            Some(engine) => Box::new(NonlinearMap::new(engine, nonlinear)),
        })
    }

    /// Changes the gap. For a piecewise-linear model, calls `visit` with the constants of its
    /// system in turn and then with that of its gap; under a nonlinear force, sets the gap to
    /// `gap`, in units of g₀. The next motion starts anew.
    ///
    /// # Errors
    /// When the gap is not finite.
    pub fn move_gap(
        &mut self,
        gap: f64,
        visit: &mut dyn FnMut(&mut f64),
    ) -> Result<(), MotionError> {
        self.0.move_gap(gap, visit)
    }

    /// Evaluations so far: of the gap in searches for switches, or of a nonlinear force.
    pub fn evaluations(&self) -> u64 {
        self.0.evaluations()
    }

    /// Replaces the state at the first of two times after drive phase 0, at most a drive period, by
    /// the state at the second.
    ///
    /// # Errors
    /// When the flow fails.
    pub fn advance_between(
        &mut self,
        state: &mut [f64],
        span: [f64; 2],
    ) -> Result<(), MotionError> {
        self.0.advance_between(state, span)
    }

    /// Replaces `state` by `P(state)`, `jacobian` by `∂P/∂state` and `derivatives`
    /// (`n × p`) by the derivative of `P` with respect to each of the map's parameters, of which
    /// a coarse map has none.
    ///
    /// # Errors
    /// When the flow fails.
    pub fn advance_with_derivatives(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivatives: &mut DMatrix<f64>,
    ) -> Result<(), MotionError> {
        self.0
            .advance_with_derivatives(state, jacobian, derivatives)
    }
}

impl Scheduling for ModelMap {
    fn cost(&self) -> u64 {
        self.0.cost()
    }

    fn add_cost(&mut self, cost: u64) {
        self.0.add_cost(cost);
    }

    fn is_costly(&self) -> bool {
        self.0.is_costly()
    }

    fn coarse(&self) -> Option<Self> {
        self.0.coarse().map(Self)
    }

    fn batch_size(&self) -> usize {
        self.0.batch_size()
    }

    fn advance_each(
        &mut self,
        states: &mut [f64],
        periods: &[usize],
    ) -> Vec<Result<(), MotionError>> {
        let Some(ensemble) = self.0.ensemble() else {
            return in_sequence(self, states, periods);
        };
        let advanced = ensemble.advance(states, periods).into_iter();
        advanced.map(|result| Ok(result?)).collect()
    }

    fn advance_each_through(
        &mut self,
        states: &mut [f64],
        periods: &[usize],
        passed: &mut [Vec<f64>],
    ) -> Vec<Result<(), MotionError>> {
        let Some(ensemble) = self.0.ensemble() else {
            return in_sequence_through(self, states, periods, passed);
        };
        let advanced = ensemble.advance_through(states, periods, passed);
        advanced.into_iter().map(|result| Ok(result?)).collect()
    }
}

impl StroboscopicMap for ModelMap {
    type Error = MotionError;

    fn dimension(&self) -> usize {
        self.0.dimension()
    }

    fn period(&self) -> f64 {
        self.0.period()
    }

    fn discrete_entries(&self) -> usize {
        self.0.discrete_entries()
    }

    fn advance(&mut self, state: &mut [f64]) -> Result<(), MotionError> {
        self.0.advance(state)
    }

    fn advance_by(&mut self, state: &mut [f64], periods: usize) -> Result<(), MotionError> {
        self.0.advance_by(state, periods)
    }

    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), MotionError> {
        self.0.advance_with_jacobian(state, jacobian)
    }

    /// Computes log|det DP| from the trace of the equations and the time in each regime, and from
    /// switches at which the motion jumps or turns.
    fn advance_with_jacobian_and_determinant(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<Option<f64>, MotionError> {
        self.0.advance_with_determinant(state, jacobian)
    }

    fn log_determinant_bound(&self) -> f64 {
        self.0.log_determinant_bound()
    }

    fn pass_touches(&mut self) {
        self.0.pass_touches();
    }

    fn across_impact(&self, state: &[f64]) -> Option<Vec<f64>> {
        self.0.across_impact(state)
    }

    fn resets(&self) -> u64 {
        self.0.resets()
    }

    fn after_reset(&self) -> Option<Arc<AfterReset>> {
        self.0.after_reset()
    }

    fn advance_with_tangencies(
        &mut self,
        state: &mut [f64],
        tangencies: &mut Vec<Tangency>,
    ) -> Result<(), MotionError> {
        self.0.advance_with_tangencies(state, tangencies)
    }
}

/// The longest touch of a rigid stop that is passed through near a grazing, in drive periods.
const LONGEST_TOUCH: f64 = 0.1;

/// Longest time between an impact and drive phase 0, in drive periods, for which `across_impact`
/// gives the state on the other side of the impact.
const IMPACT_AT_STROBE: f64 = 1e-2;

/// The maximum number of states that are advanced in a batch.
const MAX_BATCH: usize = 64;

/// Returns how many of `count` states to give a thread of the present pool at a time.
pub fn together(map: &ModelMap, count: usize) -> usize {
    count
        .div_ceil(rayon::current_num_threads())
        .clamp(1, map.batch_size())
}

/// Steps that an evaluation of the exact motion takes from a budget, in proportion to its time.
const EVALUATION_STEPS: u64 = 10;

/// The exact map of a piecewise-linear model.
#[derive(Clone, Debug)]
struct ExactMap {
    flow: Flow,
    /// A batch of motions, set up when first used.
    ensemble: Option<Box<Ensemble>>,
    /// The state that the flow was last left in, from which it can go on without a new start.
    last: Vec<f64>,
    /// Work space of a Jacobian.
    carried: Jacobian,
    gap: Arc<Output>,
    /// Whether tip and surface part at equal speeds.
    parts_at_rest: bool,
    /// The rigid stop, if the sample is one.
    stop: Option<RigidStop>,
    /// The release from it after sticking.
    release: Option<Arc<Release>>,
    /// Derivatives of the system with respect to the parameters of a family.
    tangents: Arc<[SystemTangent]>,
}

impl ExactMap {
    fn new(model: &Model, tangents: Vec<SystemTangent>) -> Self {
        Self {
            flow: Flow::new(Arc::clone(&model.system)),
            ensemble: None,
            last: Vec::new(),
            carried: Jacobian::default(),
            gap: Arc::new(model.gap.clone()),
            parts_at_rest: model.memory_reset.is_some(),
            stop: model.rigid_stop,
            release: model.release.clone(),
            tangents: tangents.into(),
        }
    }

    /// Starts the flow at `state`, unless it is already there.
    fn begin(&mut self, state: &[f64]) -> Result<(), FlowError> {
        let goes_on = !self.last.is_empty() && self.last == state;
        // Whatever happens on the way, the flow is no longer there.
        self.last.clear();
        if goes_on {
            Ok(())
        } else {
            self.flow.start(state, 0.0)
        }
    }

    /// Runs the flow from `state` by `run`, and replaces `state` by the state reached.
    fn run<R>(
        &mut self,
        state: &mut [f64],
        run: impl FnOnce(&mut Self) -> Result<R, FlowError>,
    ) -> Result<R, MotionError> {
        self.begin(state)?;
        let before = self.evaluations();
        let result = run(self);
        let steps = EVALUATION_STEPS * (self.evaluations() - before);
        self.flow.system().cancel().spend(steps);
        let result = result?;
        self.end(state);
        Ok(result)
    }

    /// Runs a period with `observer` and writes its Jacobian.
    fn run_with_jacobian<O: Observer>(
        &mut self,
        observer: &mut O,
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), FlowError> {
        // Threads that share the system count no references to it every period.
        let flow = &mut self.flow;
        self.carried.begin(flow.system(), flow.regime());
        flow.run_period(&mut (&mut self.carried, observer))?;
        let regime = &flow.system().regimes()[flow.regime()];
        self.carried.to_state(regime, jacobian);
        Ok(())
    }

    /// What motions come to that stick to the rigid stop.
    fn after_release(&self, motion: &ReleaseMotion) -> AfterReset {
        let tip = self.stop.map_or(0.0, |stop| stop.tip);
        let states = match motion {
            ReleaseMotion::Rests => vec![vec![tip, 0.0]],
            ReleaseMotion::Sticks { states, .. } => {
                states.iter().map(|state| state.to_vec()).collect()
            }
            ReleaseMotion::Open {
                periods,
                is_resolved,
                state,
            } => {
                let limit = if *is_resolved {
                    "the longest that is followed"
                } else {
                    "beyond which its errors are too large even in twice double precision"
                };
                let sticks =
                    "the motion sticks to the rigid stop, and leaves it in one known state";
                return AfterReset::Open {
                    state: state.to_vec(),
                    is_reset_again: format!(
                        "{sticks}: it is superstable, but its period is not determined (> {periods} drive                          periods, {limit})"
                    ),
                    is_not_reset_again: format!(
                        "{sticks}; no second stick within {periods} drive periods, {limit}: undecided"
                    ),
                };
            }
        };
        let mut map = self.clone();
        let mut residual = 0.0_f64;
        let mut scale = 0.0_f64;
        for (k, state) in states.iter().enumerate() {
            let mut end = state.clone();
            // A state on the stop is followed like any other; where that fails there is no residual.
            if map.advance(&mut end).is_ok() {
                let next = &states[(k + 1) % states.len()];
                let apart = end.iter().zip(next).map(|(a, b)| (a - b).abs());
                residual = residual.max(apart.fold(0.0, f64::max));
            }
            scale = state.iter().fold(scale, |most, x| most.max(x.abs()));
        }
        AfterReset::Closes(PeriodicOrbit::superstable(
            states,
            residual,
            f64::EPSILON * scale,
        ))
    }

    /// Writes the state that the flow has reached to `state`, and remembers it in `last`.
    fn end(&mut self, state: &mut [f64]) {
        self.flow.state(state);
        self.last.extend_from_slice(state);
    }
}

impl EngineMap for ExactMap {
    fn boxed(&self) -> Box<dyn EngineMap> {
        Box::new(self.clone())
    }

    fn dimension(&self) -> usize {
        self.flow.system().dimension()
    }

    fn period(&self) -> f64 {
        self.flow.system().drive().period()
    }

    fn move_gap(&mut self, gap: f64, visit: &mut dyn FnMut(&mut f64)) -> Result<(), MotionError> {
        if !gap.is_finite() {
            return Err(FlowError::NotFinite { what: "the gap" }.into());
        }
        self.last.clear();
        self.ensemble = None;
        self.flow.system_mut().each_constant(visit);
        let constant = &mut Arc::make_mut(&mut self.gap).constant;
        visit(constant);
        if let Some(stop) = &mut self.stop {
            stop.tip = *constant;
            let moved = self.release.take();
            self.release = moved.and_then(|release| release.moved_to(stop.tip));
        }
        Ok(())
    }

    fn evaluations(&self) -> u64 {
        self.flow.statistics().evaluations
    }

    /// Returns [`MAX_BATCH`] for a piecewise-linear model with one contact, else 1: eight motions
    /// are advanced at a time, and others take the place of those that reach a switch.
    fn batch_size(&self) -> usize {
        if Ensemble::fits(self.flow.system()) {
            MAX_BATCH
        } else {
            1
        }
    }

    fn ensemble(&mut self) -> Option<&mut Ensemble> {
        let system = self.flow.system();
        if self.ensemble.is_none() && Ensemble::fits(system) {
            self.ensemble = Some(Box::new(Ensemble::new(Arc::clone(system))));
        }
        self.ensemble.as_deref_mut()
    }

    fn advance(&mut self, state: &mut [f64]) -> Result<(), MotionError> {
        self.run(state, |map| map.flow.run_period(&mut ()))
    }

    fn advance_by(&mut self, state: &mut [f64], periods: usize) -> Result<(), MotionError> {
        self.run(state, |map| map.flow.run_periods(periods))
    }

    fn advance_between(
        &mut self,
        state: &mut [f64],
        [from, to]: [f64; 2],
    ) -> Result<(), MotionError> {
        self.last.clear();
        self.flow.start(state, from)?;
        if to < self.period() {
            self.flow.run_until(to, &mut ())?;
        } else {
            self.flow.run_period(&mut ())?;
        }
        self.flow.state(state);
        Ok(())
    }

    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), MotionError> {
        self.run(state, |map| map.run_with_jacobian(&mut (), jacobian))
    }

    fn advance_with_derivatives(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivatives: &mut DMatrix<f64>,
    ) -> Result<(), MotionError> {
        self.run(state, |map| {
            map.flow
                .run_period_with_sensitivities(&map.tangents, jacobian, derivatives)
        })
    }

    fn advance_with_determinant(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<Option<f64>, MotionError> {
        let sum = self.run(state, |map| {
            let sticks = map.flow.system().sticks(map.flow.regime());
            let mut sum = LogDeterminant(if sticks { f64::NAN } else { 0.0 });
            map.run_with_jacobian(&mut sum, jacobian)?;
            Ok(sum.0)
        })?;
        Ok(Some(sum).filter(|log| !log.is_nan()))
    }

    fn log_determinant_bound(&self) -> f64 {
        let system = self.flow.system();
        let mut transitions = system
            .transitions()
            .iter()
            .enumerate()
            .flat_map(|(r, out)| {
                let all = 0..out.len();
                all.map(move |transition| (r, transition, &out[transition]))
            });
        let expands = |(r, transition, taken): (usize, usize, &Transition)| {
            let keeps = || {
                let switch = system.switch_of(r, transition);
                switch.is_some_and(Switch::keeps_volume)
            };
            log_impact(taken).map_or_else(|| !keeps(), |log| log > 0.0)
        };
        if transitions.any(expands) {
            return f64::INFINITY;
        }
        // Where nothing moves the motion sticks, and its volume is gone.
        let fastest = system
            .regimes()
            .iter()
            .filter(|r| r.matrix().amax() > 0.0)
            .map(|r| r.matrix().trace())
            .fold(f64::NEG_INFINITY, f64::max);
        fastest * system.drive().period()
    }

    fn pass_touches(&mut self) {
        self.flow.pass_touches(LONGEST_TOUCH * self.period());
    }

    fn across_impact(&self, state: &[f64]) -> Option<Vec<f64>> {
        let (stop, &[x, v]) = (self.stop?, state) else {
            return None;
        };
        let behind = x - stop.tip;
        let factor = if v > 0.0 {
            stop.restitution
        } else {
            stop.restitution.recip()
        };
        let is_near = behind > 0.0 && behind <= IMPACT_AT_STROBE * v.abs() * self.period();
        (is_near && factor.is_finite()).then(|| vec![stop.tip - factor * behind, -factor * v])
    }

    fn resets(&self) -> u64 {
        if self.release.is_some() {
            self.flow.releases()
        } else {
            0
        }
    }

    fn after_reset(&self) -> Option<Arc<AfterReset>> {
        let release = self.release.as_ref()?;
        Some(release.outcome(|| self.after_release(release.motion())))
    }

    fn advance_with_tangencies(
        &mut self,
        state: &mut [f64],
        tangencies: &mut Vec<Tangency>,
    ) -> Result<(), MotionError> {
        self.begin(state)?;
        let mut collector = GapExtrema {
            gap: &self.gap,
            parts_at_rest: self.parts_at_rest,
            is_rigid: self.stop.is_some(),
            switched: false,
            tangencies,
        };
        self.flow.run_period(&mut collector)?;
        self.end(state);
        Ok(())
    }
}

/// Returns log|det| of the volume change by an impact: that of the reset, and the same again for
/// the times at which neighbouring motions meet the stop. `None` for a continuous switch.
fn log_impact(transition: &Transition) -> Option<f64> {
    let reset = transition.reset.as_ref()?;
    Some(2.0 * nanotap_arithmetic::ln(reset.matrix.determinant().abs()))
}

/// Sums log|det| over a period: tr A · t in every regime, and the switches. NaN for a motion that
/// sticks, because volumes vanish there.
struct LogDeterminant(f64);

impl Observer for LogDeterminant {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        self.0 += segment.regime().matrix().trace() * segment.length;
    }

    fn switch(&mut self, switch: &SwitchView<'_>) {
        if switch.stuck {
            self.0 = f64::NAN;
            return;
        }
        let transitions = &switch.system.transitions()[switch.switch.from];
        let impact = transitions.get(switch.transition).and_then(log_impact);
        let continuous = || switch.switch.log_determinant(switch.rate);
        self.0 += impact.or_else(continuous).unwrap_or(f64::NAN);
    }
}

/// Collects the local extrema of the gap over a period.
struct GapExtrema<'a> {
    gap: &'a Output,
    /// Whether tip and surface part at equal speeds, as when the tip leaves a rigid stop to which
    /// it stuck: the gap then has a minimum, zero, where they part, which is not a grazing.
    parts_at_rest: bool,
    /// Whether only minima of the gap count as grazings, as at a rigid stop: the maxima of the ever
    /// lower flights of a chatter fall below rounding.
    is_rigid: bool,
    /// Whether the stretch begins with a switch.
    switched: bool,
    tangencies: &'a mut Vec<Tangency>,
}

/// Time after the parting, in drive periods, within which an extremum of the gap is the parting
/// itself.
const PARTING: f64 = 1e-6;

impl Observer for GapExtrema<'_> {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        let system: &System = segment.system;
        let signal = segment.signal(&segment.regime().project(self.gap));
        let rate = signal.differentiated(segment.length);
        let period = system.drive().period();
        for s in sign_changes(&rate, segment.length) {
            let parts_at_rest = self.parts_at_rest || self.is_rigid;
            if parts_at_rest && self.switched && s < PARTING * period {
                continue;
            }
            if self.is_rigid && rate.differentiated(segment.length).at(s) <= 0.0 {
                continue;
            }
            let phase = (segment.phase + s) / period;
            self.tangencies.push(Tangency {
                phase,
                value: signal.at(s),
            });
        }
    }

    /// Adds an extremum at impacts, and at switches that end a grazing contact: there the gap has
    /// none beyond a grazing. It is the extremum that the gap would have had without the switch, of
    /// the value −ġ²/(2g̈).
    fn switch(&mut self, switch: &SwitchView<'_>) {
        self.switched = true;
        let (from, to) = (switch.switch.from, switch.switch.to);
        if !(switch.switch.breaks_grazing() || from == to) {
            return;
        }
        let (system, regime) = (switch.system, switch.from());
        let (drive, period) = (system.drive(), system.drive().period());
        let rate_of = |output: &Output| output.rate(regime.matrix(), regime.forcing(), drive);
        let at = |output: &Output| {
            let own = regime.project(output);
            own.at(drive, switch.modal, switch.phase)
        };
        let rate = rate_of(self.gap);
        let (speed, turn) = (at(&rate), at(&rate_of(&rate)));
        let ahead = -speed / turn;
        if ahead >= 0.0 && ahead < NEARBY * period {
            self.tangencies.push(Tangency {
                phase: switch.phase / period,
                value: 0.5 * speed * ahead,
            });
        }
    }
}

/// Longest time ahead, in drive periods, over which the gap is extrapolated beyond a switch.
const NEARBY: f64 = 0.1;
