//! One drive period of the lever above a sample that has moved: the exact map, and the signals of
//! the period.
//!
//! A period runs from drive phase 180° to 540°. The tip is then far from the sample whatever the
//! phase lag between 0° and 180°, so that a step of the gap does no work on the sample. Inside, the
//! drive's tone has the opposite sign and the period runs from phase 0.
//!
//! With the free lever `ẋ = A x + f(t) + b F`, the component of the deflection at the drive's
//! frequency follows from the change of the state over the period and from the force alone:
//! `(iΩ − A) ∫ x e^{−iΩt} dt = ∫ (f + b F) e^{−iΩt} dt − (x(T) − x(0))`.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::flow::{Observer, SegmentView};
use nanotap_flow::regime::ModalOutput;
use nanotap_flow::{
    Complex, Flow, HarmonicVector, Output, PreparedBasis, Regime, Reset, SpectralBasis, System,
    Transition,
};
use nanotap_volterra::{Coarse, ForceSums};

use crate::Error;
use crate::case::Case;
use crate::model::nonlinear::Nonlinear;
use crate::model::parameter::Parameter;
use crate::model::{Model, MotionError, cantilever_model_tangent};

/// Signals of one drive period, in the model's units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PeriodSignals {
    /// Complex amplitude of the deflection at the drive's frequency, counted from drive phase 0.
    pub(super) deflection: Complex,
    /// Complex amplitude of the force, counted likewise.
    pub(super) force: Complex,
    /// Mean force.
    pub(super) mean_force: f64,
    /// Mean deflection.
    pub(super) mean_deflection: f64,
    /// Largest force, at least 0.
    pub(super) peak_force: f64,
    /// Time in contact over the period.
    pub(super) contact: f64,
    /// Energy that the tip gives to the sample.
    pub(super) dissipation: f64,
}

/// How drive periods are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Engine {
    /// Exactly.
    Exact,
    /// Under a nonlinear law by the approximate flow for transients.
    Fast,
}

/// The lever above one material.
#[derive(Clone, Debug)]
pub(super) struct Lever {
    flow: LeverFlow,
    readout: Readout,
    /// State entries of the beam; the rest is the sample's.
    beam: usize,
    /// State entries that vary continuously.
    continuous: usize,
    dimension: usize,
    free_start: Vec<f64>,
    free_deflection: Complex,
}

#[derive(Clone, Debug)]
enum LeverFlow {
    Linear(Box<LinearLever>),
    Nonlinear(Box<NonlinearLever>),
    Coarse(Box<CoarseLever>),
}

/// A piecewise-linear sample: the change of the gap is one more state, which stays constant.
#[derive(Clone, Debug)]
struct LinearLever {
    flow: Flow,
    sums: LinearSums,
    state: Vec<f64>,
    /// Gap of the model.
    gap: f64,
}

/// A nonlinear law, exactly.
#[derive(Clone, Debug)]
struct NonlinearLever {
    flow: nanotap_volterra::Flow,
    law: LawState,
    /// Offset of the gap at distance 0.
    offset: f64,
}

/// A nonlinear law, approximately.
#[derive(Clone, Debug)]
struct CoarseLever {
    flow: Coarse,
    law: LawState,
    /// Gap of the model.
    gap: f64,
}

/// What a step of the period needs of a nonlinear model.
#[derive(Clone, Copy, Debug)]
struct LawState {
    dimension: usize,
    remembers: bool,
    period: f64,
    omega: f64,
}

impl LawState {
    /// The branch that the law remembers, after the beam's part of a state.
    fn branch(self, state: &[f64]) -> Option<usize> {
        let memory = state.get(self.dimension).filter(|_| self.remembers)?;
        (*memory >= 0.0).then_some(memory.round() as usize)
    }

    fn remember(self, state: &mut [f64], branch: usize) {
        if self.remembers {
            state[self.dimension] = branch as f64;
        }
    }
}

impl Lever {
    /// The lever of `case`.
    ///
    /// # Errors
    /// When the case has no model, a second tone, or a rigid sample.
    pub(super) fn new(case: &Case, engine: Engine) -> Result<Self, Error> {
        let model = case.model()?;
        let cantilever = crate::study::cantilever(case, "scan")?;
        if model.system.drive().frequencies().len() != 1 {
            return Err(Error::input(
                "a scan needs a drive of one tone",
                "leave out the second tone of the drive",
            ));
        }
        let gap = case.get(case.gap_key());
        let beam = 2 * cantilever.modes;
        let readout = Readout::new(&model, beam)?;
        let response = model.system.regimes()[0].response();
        let free: DVector<f64> = &response.constant - response.tones[0].map(|z| z.re);
        let free_deflection = model.system.regimes()[0].project(&model.tip).tones[0];
        let flow = match (&model.nonlinear, engine) {
            (None, _) => {
                let tangent = cantilever_model_tangent(cantilever, &model, Parameter::Alpha5)?;
                let system = moved_system(&model, &tangent.system)?;
                let forces: Vec<f64> = tangent.force.iter().map(|f| f.constant).collect();
                LeverFlow::Linear(Box::new(LinearLever {
                    sums: LinearSums::new(&model, &system, &forces),
                    flow: Flow::new(Arc::new(system)),
                    state: vec![0.0; model.dimension() + 1],
                    gap,
                }))
            }
            (Some(nonlinear), engine) => {
                let system = turned_system(nonlinear)?;
                let law = LawState {
                    dimension: system.dimension(),
                    remembers: nonlinear.remembers,
                    period: nonlinear.period,
                    omega: model.frequency(),
                };
                let coarse = match engine {
                    Engine::Fast => Coarse::new(&system, nonlinear.period).ok(),
                    Engine::Exact => None,
                };
                match coarse {
                    Some(flow) => LeverFlow::Coarse(Box::new(CoarseLever { flow, law, gap })),
                    None => LeverFlow::Nonlinear(Box::new(NonlinearLever {
                        offset: system.drive().offset - gap,
                        flow: nanotap_volterra::Flow::new(system),
                        law,
                    })),
                }
            }
        };
        Ok(Self {
            continuous: match flow {
                LeverFlow::Linear(_) => model.dimension(),
                LeverFlow::Nonlinear(_) | LeverFlow::Coarse(_) => beam,
            },
            flow,
            readout,
            beam,
            dimension: model.dimension(),
            free_start: free.as_slice().to_vec(),
            free_deflection,
        })
    }

    /// Whether the periods are exact.
    pub(super) const fn is_exact(&self) -> bool {
        !matches!(self.flow, LeverFlow::Coarse(_))
    }

    /// State of the steady motion far from the sample, at drive phase 180°.
    pub(super) fn free_start(&self) -> Vec<f64> {
        self.free_start.clone()
    }

    /// Complex amplitude of the deflection far from the sample.
    pub(super) const fn free_deflection(&self) -> Complex {
        self.free_deflection
    }

    /// Amplitude of a force at the drive's frequency that alone moves the lever by the free
    /// amplitude.
    pub(super) fn free_force(&self) -> f64 {
        self.free_deflection.modulus() / self.readout.turned_column.modulus().max(f64::MIN_POSITIVE)
    }

    /// Takes over the beam's part of a state from a lever above another material. The sample is
    /// relaxed, and detached where the gap allows it.
    pub(super) fn take_over(&self, state: &mut Vec<f64>) {
        let beam = self.beam;
        state.resize(self.dimension, 0.0);
        let memory = match &self.flow {
            LeverFlow::Linear(_) => 0.0,
            // No branch is remembered.
            LeverFlow::Nonlinear(_) | LeverFlow::Coarse(_) => -1.0,
        };
        state[beam..].fill(memory);
    }

    /// Replaces `state` at drive phase 180° by the state one period later, the sample at distance
    /// `gap` in the model's unit of length.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn advance(
        &mut self,
        state: &mut [f64],
        gap: f64,
    ) -> Result<PeriodSignals, MotionError> {
        let mut change: [f64; MAX_CHANGE] = [0.0; MAX_CHANGE];
        let change = &mut change[..self.beam];
        change.copy_from_slice(&state[..self.beam]);
        let sums = match &mut self.flow {
            LeverFlow::Linear(lever) => lever.advance(state, gap)?,
            LeverFlow::Nonlinear(lever) => lever.advance(state, gap)?,
            LeverFlow::Coarse(lever) => lever.advance(state, gap)?,
        };
        for (before, after) in change.iter_mut().zip(&*state) {
            *before = after - *before;
        }
        Ok(self.readout.signals(change, &sums))
    }

    /// The derivative of the map by state and gap by central differences: columns of the state,
    /// then of the gap; rows of the state, then of the real and imaginary part of the deflection.
    ///
    /// # Errors
    /// When the flow fails.
    pub(super) fn linearised(
        &mut self,
        state: &[f64],
        gap: f64,
        scale: f64,
    ) -> Result<DMatrix<f64>, MotionError> {
        let n = self.continuous;
        let step = DIFFERENCE * scale;
        let mut result = DMatrix::zeros(n + 2, n + 1);
        for column in 0..=n {
            let mut ends = [DVector::zeros(n + 2), DVector::zeros(n + 2)];
            for (end, sign) in ends.iter_mut().zip([-1.0, 1.0]) {
                let (mut state, mut gap) = (state.to_vec(), gap);
                match state.get_mut(column).filter(|_| column < n) {
                    Some(entry) => *entry += sign * step,
                    None => gap += sign * step,
                }
                let signals = self.advance(&mut state, gap)?;
                for (to, value) in end.iter_mut().zip(&state[..n]) {
                    *to = *value;
                }
                (end[n], end[n + 1]) = (signals.deflection.re, signals.deflection.im);
            }
            result.set_column(column, &((&ends[1] - &ends[0]) / (2.0 * step)));
        }
        Ok(result)
    }

    /// Number of state entries that vary continuously.
    pub(super) const fn continuous_dimension(&self) -> usize {
        self.continuous
    }
}

/// Step of a difference quotient, as a part of the free amplitude.
const DIFFERENCE: f64 = 1e-6;
/// Entries of the largest beam's state.
const MAX_CHANGE: usize = 2 * crate::model::beam::MAX_MODES;

/// Reads a period's deflection from the change of the state and the force.
#[derive(Clone, Debug)]
struct Readout {
    period: f64,
    /// `tip (iΩ − A)⁻¹`.
    turned: RowDVector<Complex>,
    turned_column: Complex,
    turned_drive: Complex,
    /// `tip A⁻¹`.
    still: RowDVector<f64>,
    still_column: f64,
    still_constant: f64,
}

impl Readout {
    fn new(model: &Model, n: usize) -> Result<Self, Error> {
        let free = &model.system.regimes()[0];
        let (period, omega) = (model.period(), model.frequency());
        let matrix = free.matrix().view((0, 0), (n, n)).into_owned();
        let tip = model.tip.row.columns(0, n).into_owned();
        let column = force_column(model, n);
        let singular = || Error::numerics("the free lever does not restore");
        let complex = matrix.map(|v| Complex::new(-v, 0.0))
            + DMatrix::from_diagonal_element(n, n, Complex::new(0.0, omega));
        let row = |of: &RowDVector<f64>| of.map(|v| Complex::new(v, 0.0)).transpose();
        let turned = complex
            .transpose()
            .lu()
            .solve(&row(&tip))
            .ok_or_else(singular)?
            .transpose();
        let still = matrix
            .transpose()
            .lu()
            .solve(&tip.transpose())
            .ok_or_else(singular)?
            .transpose();
        let tone = free.forcing().tones[0].rows(0, n).into_owned();
        let constant = free.forcing().constant.rows(0, n).into_owned();
        Ok(Self {
            period,
            turned_column: (&turned * column.map(|v| Complex::new(v, 0.0)))[0],
            // The tone's sign is turned, half a period before drive phase 0.
            turned_drive: (&turned * tone)[0] * Complex::new(-0.5 * period, 0.0),
            turned,
            still_column: (&still * column)[0],
            still_constant: (&still * constant)[0],
            still,
        })
    }

    fn signals(&self, change: &[f64], sums: &ForceSums) -> PeriodSignals {
        let period = self.period;
        let mut turned = self.turned_drive + self.turned_column * sums.harmonic;
        let mut still = -period * self.still_constant - self.still_column * sums.impulse;
        for ((change, a), b) in change.iter().zip(self.turned.iter()).zip(self.still.iter()) {
            turned -= a * *change;
            still += b * change;
        }
        PeriodSignals {
            // Half a period later by the drive's phase.
            deflection: turned * (-2.0 / period),
            force: sums.harmonic * (-2.0 / period),
            mean_force: sums.impulse / period,
            mean_deflection: still / period,
            peak_force: sums.peak,
            contact: sums.contact / period,
            dissipation: -sums.work,
        }
    }
}

/// The change of `ẋ` by a unit of force at the tip: the beam's part.
fn force_column(model: &Model, n: usize) -> DVector<f64> {
    if let Some(nonlinear) = &model.nonlinear {
        return nonlinear.system.kernel().column().rows(0, n).into_owned();
    }
    // In contact the matrix has column · row of the force added.
    let free = model.system.regimes()[0].matrix();
    let mut best = (0.0, DVector::zeros(n));
    for (regime, force) in model.system.regimes().iter().zip(&model.force) {
        for (j, weight) in force.row.iter().enumerate() {
            if weight.abs() > best.0 {
                let added = regime.matrix().column(j) - free.column(j);
                best = (weight.abs(), added.rows(0, n) / *weight);
            }
        }
    }
    best.1
}

/// The law's system with the drive half a period later.
fn turned_system(nonlinear: &Nonlinear) -> Result<Arc<nanotap_volterra::System>, Error> {
    let system = &nonlinear.system;
    let mut drive = system.drive().clone();
    for tone in &mut drive.tones {
        tone.forcing.neg_mut();
        tone.gap = -tone.gap;
    }
    let turned = nanotap_volterra::System::new(
        Arc::clone(system.kernel()),
        Arc::clone(system.law()),
        drive,
        system.options(),
    )
    .map_err(MotionError::from)?;
    Ok(Arc::new(turned.cancelled_by(system.cancel().clone())))
}

/// The model's system with the drive half a period later and one more state, the change of the
/// gap: its rate is zero, and forces and guards depend on it as on the case's gap.
fn moved_system(
    model: &Model,
    by_gap: &nanotap_flow::sensitivity::SystemTangent,
) -> Result<System, Error> {
    let system = &model.system;
    let drive = system.drive().clone();
    let n = system.dimension();
    let turned = |vector: &HarmonicVector| HarmonicVector {
        constant: vector.constant.clone().resize_vertically(n + 1, 0.0),
        tones: vector
            .tones
            .iter()
            .map(|tone| (-tone).resize_vertically(n + 1, Complex::new(0.0, 0.0)))
            .collect(),
    };
    let mut regimes = Vec::new();
    for (r, (regime, change)) in system.regimes().iter().zip(&by_gap.regimes).enumerate() {
        let column = &change.forcing.constant;
        let mut matrix = regime.matrix().clone().resize(n + 1, n + 1, 0.0);
        matrix.view_mut((0, n), (n, 1)).copy_from(column);
        // The lever at rest under a unit change of the gap.
        let steady = Regime::with_basis(
            r,
            regime.matrix().clone(),
            HarmonicVector::zeros(n, drive.frequencies().len()).with_constant(column),
            &drive,
            Arc::new(PreparedBasis::from(regime.basis().clone())),
        )?;
        let basis = with_constant_state(regime.basis(), &steady.response().constant);
        regimes.push(Regime::with_basis(
            r,
            matrix,
            turned(regime.forcing()),
            &drive,
            Arc::new(basis.into()),
        )?);
    }
    let transitions = system
        .transitions()
        .iter()
        .enumerate()
        .map(|(r, out)| {
            let each = out.iter().enumerate().map(|(e, transition)| {
                let reset = transition.reset.as_ref().map(|reset| {
                    let mut matrix = reset.matrix.clone().resize(n + 1, n + 1, 0.0);
                    if let Some(change) = &by_gap.resets[r][e] {
                        matrix
                            .view_mut((0, n), (n, 1))
                            .copy_from(&change.offset.constant);
                    }
                    matrix[(n, n)] = 1.0;
                    Reset {
                        matrix,
                        offset: turned(&reset.offset),
                    }
                });
                Transition {
                    guard: moved_output(&transition.guard, by_gap.guards[r][e].constant),
                    reset,
                    ..transition.clone()
                }
            });
            each.collect()
        })
        .collect();
    let moved = System::new(drive, regimes, transitions)?;
    Ok(moved.cancelled_by(system.cancel().clone()))
}

/// An output of the system with the moved sample.
fn moved_output(output: &Output, by_gap: f64) -> Output {
    let n = output.row.len();
    let mut row = output.row.clone().resize_horizontally(n + 1, 0.0);
    row[n] = by_gap;
    Output {
        row,
        tones: output.tones.iter().map(|z| -z).collect(),
        constant: output.constant,
    }
}

/// The basis of a regime with one more state that stays constant and holds the others at `steady`.
fn with_constant_state(basis: &SpectralBasis, steady: &DVector<f64>) -> SpectralBasis {
    let (n, m) = basis.right.shape();
    let zero = Complex::new(0.0, 0.0);
    let mut eigenvalues = basis.eigenvalues.clone();
    eigenvalues.push(zero);
    let steady = steady.map(|v| Complex::new(v, 0.0));
    let mut right = basis.right.clone().resize(n + 1, m + 1, zero);
    right.view_mut((0, m), (n, 1)).copy_from(&steady);
    right[(n, m)] = Complex::new(1.0, 0.0);
    let mut left = basis.left.clone().resize(m + 1, n + 1, zero);
    left.view_mut((0, n), (m, 1))
        .copy_from(&-(&basis.left * &steady));
    left[(m, n)] = Complex::new(1.0, 0.0);
    SpectralBasis {
        eigenvalues,
        right,
        left,
        clusters: basis.clusters.clone(),
    }
}

impl LinearLever {
    fn advance(&mut self, state: &mut [f64], gap: f64) -> Result<ForceSums, MotionError> {
        let n = state.len();
        self.state[..n].copy_from_slice(state);
        self.state[n] = gap - self.gap;
        self.flow.start(&self.state, 0.0)?;
        self.sums.begin();
        self.flow.run_period(&mut self.sums)?;
        self.flow.state(&mut self.state);
        state.copy_from_slice(&self.state[..n]);
        Ok(self.sums.sums)
    }
}

impl NonlinearLever {
    fn advance(&mut self, state: &mut [f64], gap: f64) -> Result<ForceSums, MotionError> {
        let law = self.law;
        self.flow.system_mut().set_offset(self.offset + gap)?;
        let beam = &state[..law.dimension];
        match law.branch(state) {
            Some(branch) => self.flow.start_on(beam, 0.0, branch)?,
            None => self.flow.start(beam, 0.0)?,
        }
        let sums = self.flow.run_with_force_sums(law.period, law.omega)?;
        self.flow.state(&mut state[..law.dimension]);
        law.remember(state, self.flow.branch());
        Ok(sums)
    }
}

impl CoarseLever {
    fn advance(&mut self, state: &mut [f64], gap: f64) -> Result<ForceSums, MotionError> {
        let law = self.law;
        let branch = law.branch(state);
        let beam = &mut state[..law.dimension];
        let (branch, sums) =
            self.flow
                .run_with_force_sums(beam, branch, gap - self.gap, law.omega)?;
        law.remember(state, branch);
        Ok(sums)
    }
}

/// Integrals of the force of a piecewise-linear sample, in closed form.
#[derive(Clone, Debug)]
struct LinearSums {
    omega: f64,
    /// `None` in flight.
    regimes: Vec<Option<ContactOutputs>>,
    terms: Vec<Term>,
    sums: ForceSums,
}

/// Force and rate of the tip's height in contact.
#[derive(Clone, Debug)]
struct ContactOutputs {
    force: ModalOutput,
    rate: ModalOutput,
    touches: bool,
    rates: Vec<Complex>,
    /// The largest `|λ|`.
    fastest: f64,
}

/// `e^{rate · s}` with its amplitudes in force and height rate.
#[derive(Clone, Copy, Debug)]
struct Term {
    rate: Complex,
    force: Complex,
    speed: Complex,
    /// `e^{rate · length}`.
    end: Complex,
}

impl LinearSums {
    fn new(model: &Model, moved: &System, force_by_gap: &[f64]) -> Self {
        let drive = moved.drive();
        let height = moved_output(&model.height, 1.0);
        let regimes = moved.regimes().iter().enumerate().map(|(r, regime)| {
            let force = moved_output(&model.force[r], force_by_gap[r]);
            let acts = force.row.iter().any(|w| *w != 0.0) || force.constant != 0.0;
            let rate = height.rate(regime.matrix(), regime.forcing(), drive);
            let rates = regime.basis().eigenvalues.iter().copied();
            let rates: Vec<Complex> = rates
                .chain(drive.frequencies().iter().map(|w| Complex::new(0.0, *w)))
                .collect();
            (acts || model.contact[r]).then(|| ContactOutputs {
                force: regime.project(&force),
                rate: regime.project(&rate),
                touches: model.contact[r],
                fastest: rates.iter().map(|z| z.modulus()).fold(0.0, f64::max),
                rates,
            })
        });
        Self {
            omega: model.frequency(),
            regimes: regimes.collect(),
            terms: Vec::new(),
            sums: ForceSums::default(),
        }
    }

    const fn begin(&mut self) {
        self.sums = ForceSums {
            impulse: 0.0,
            harmonic: Complex::new(0.0, 0.0),
            work: 0.0,
            peak: 0.0,
            contact: 0.0,
        };
    }

    /// Force and its rate, so long after the beginning of the stretch.
    fn force_at(&self, after: f64, constant: f64) -> (f64, f64) {
        let mut force = (constant, 0.0);
        for term in &self.terms {
            let value = term.force * exponential(term.rate * after);
            force.0 += value.re;
            force.1 += (value * term.rate).re;
        }
        force
    }

    /// Raises the peak to the largest force on a stretch.
    fn raise_peak(&mut self, length: f64, fastest: f64, constant: f64) {
        let pieces = (1.5 * fastest * length).ceil().clamp(1.0, 200.0) as usize;
        let width = length / pieces as f64;
        let mut before = self.force_at(0.0, constant);
        self.sums.peak = self.sums.peak.max(before.0);
        for k in 1..=pieces {
            let end = width * k as f64;
            let here = self.force_at(end, constant);
            self.sums.peak = self.sums.peak.max(here.0);
            if before.1 > 0.0 && here.1 < 0.0 {
                let (mut low, mut high) = (end - width, end);
                let (mut at_low, mut at_high) = (before.1, here.1);
                // Secant steps, kept inside.
                for _ in 0..20 {
                    let at = low + (high - low) * at_low / (at_low - at_high);
                    let (force, rate) = self.force_at(at, constant);
                    self.sums.peak = self.sums.peak.max(force);
                    if rate.abs() * (high - low) <= 1e-15 * force.abs() {
                        break;
                    }
                    if rate > 0.0 {
                        (low, at_low) = (at, rate);
                        at_high *= 0.5;
                    } else {
                        (high, at_high) = (at, rate);
                        at_low *= 0.5;
                    }
                }
            }
            before = here;
        }
    }
}

fn exponential(z: Complex) -> Complex {
    let (sin, cos) = nanotap_arithmetic::sin_cos(z.im);
    let size = nanotap_arithmetic::exp(z.re);
    Complex::new(size * cos, size * sin)
}

/// `∫₀^length e^{rate s} ds` with `end = e^{rate · length}`.
fn moment(rate: Complex, length: f64, end: Complex) -> Complex {
    let z = rate * length;
    if z.norm_sqr() > 0.01 {
        return (end - 1.0) / rate;
    }
    let (mut term, mut sum) = (Complex::new(1.0, 0.0), Complex::new(0.0, 0.0));
    for k in 1..12_u32 {
        sum += term / f64::from(k);
        term *= z / f64::from(k);
    }
    sum * length
}

impl Observer for LinearSums {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        let Some(outputs) = &self.regimes[segment.regime] else {
            return;
        };
        let length = segment.length;
        if length <= 0.0 {
            return;
        }
        if outputs.touches {
            self.sums.contact += length;
        }
        let drive = segment.system.drive();
        self.terms.clear();
        let modal = segment.modal.iter().zip(segment.factors).enumerate();
        for (k, (q, end)) in modal {
            self.terms.push(Term {
                rate: outputs.rates[k],
                force: outputs.force.modal[k] * q,
                speed: outputs.rate.modal[k] * q,
                end: *end,
            });
        }
        let phasor = drive.phasor(0, segment.phase);
        let turn = drive.phasor(0, length);
        self.terms.push(Term {
            rate: outputs.rates[segment.modal.len()],
            force: outputs.force.tones[0] * phasor,
            speed: outputs.rate.tones[0] * phasor,
            end: turn,
        });
        let (constant, fastest) = (outputs.force.constant, outputs.fastest);
        let moving = outputs.rate.constant;
        let minus = Complex::new(0.0, -self.omega);
        let mut impulse = constant * length;
        let mut harmonic = moment(minus, length, turn.conj()) * constant;
        let mut work = constant * moving * length;
        for (k, a) in self.terms.iter().enumerate() {
            let own = moment(a.rate, length, a.end);
            impulse += (a.force * own).re;
            work += constant * (a.speed * own).re + moving * (a.force * own).re;
            let direct = moment(a.rate + minus, length, a.end * turn.conj());
            let mirrored = moment(a.rate.conj() + minus, length, a.end.conj() * turn.conj());
            harmonic += (a.force * direct + a.force.conj() * mirrored) * 0.5;
            // ∫ Re(a e^{λs}) Re(b e^{μs}), the pairs (a, b) and (b, a) together.
            for b in &self.terms[k..] {
                let (mut sum, mut difference) = (a.force * b.speed, a.force * b.speed.conj());
                if !std::ptr::eq(a, b) {
                    sum += b.force * a.speed;
                    difference += b.force.conj() * a.speed;
                }
                let direct = moment(a.rate + b.rate, length, a.end * b.end);
                let mirrored = moment(a.rate + b.rate.conj(), length, a.end * b.end.conj());
                work += 0.5 * (sum * direct + difference * mirrored).re;
            }
        }
        self.sums.impulse += impulse;
        self.sums.harmonic += harmonic * phasor.conj();
        self.sums.work += work;
        self.raise_peak(length, fastest, constant);
    }
}
