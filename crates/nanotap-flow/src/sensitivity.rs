//! The derivative of the flow with respect to parameters, exact through switches.
//!
//! Inside a regime the sensitivity `s = ∂x/∂θ` obeys `ṡ = A s + (∂A x + ∂f)`, whose
//! right-hand side is again a sum of exponentials: it is integrated in closed
//! form, mode by mode, with divided differences of exponentials. A parameter that
//! changes the drive's period is treated in time measured by the drive's phase,
//! where only `A` and `f` (times the period) change.

use crate::harmonic::{HarmonicVector, Output};
use crate::observer::{Observer, SegmentView, SwitchView};
use crate::rate::phi1;
use crate::system::{Reset, System};
use crate::{Complex, Drive, Flow, FlowError, PreparedBasis, Regime};
use nalgebra::{DMatrix, DVector};
use nanotap_arithmetic::ComplexFunctions as _;

/// The derivative of a [`System`] with respect to one parameter: the same shape
/// with a derivative in place of every entry. Harmonic terms are differentiated at
/// fixed drive phase.
#[derive(Clone, Debug, PartialEq)]
pub struct SystemTangent {
    /// Derivatives `∂A` and `∂f` of each regime.
    pub regimes: Vec<RegimeTangent>,
    /// Derivatives of the guards, by regime and transition.
    pub guards: Vec<Vec<Output>>,
    /// Derivatives of the resets, by regime and transition; `None` for a transition without a
    /// reset.
    pub resets: Vec<Vec<Option<Reset>>>,
    /// Derivative `∂ ln T` of the drive period, per unit of the parameter.
    pub log_period: f64,
}

/// The derivative of a regime with respect to one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct RegimeTangent {
    /// Derivative `∂A` of the regime's matrix, `n × n`.
    pub matrix: DMatrix<f64>,
    /// Derivative `∂f` of the regime's forcing, of length `n`, at fixed drive phase.
    pub forcing: HarmonicVector,
}

impl SystemTangent {
    /// Creates a derivative of which every entry is zero.
    pub fn zeros(system: &System) -> Self {
        let (n, tones) = (system.dimension(), system.drive().frequencies().len());
        let regime = RegimeTangent {
            matrix: DMatrix::zeros(n, n),
            forcing: HarmonicVector::zeros(n, tones),
        };
        Self {
            regimes: vec![regime; system.regimes().len()],
            guards: system
                .transitions()
                .iter()
                .map(|e| e.iter().map(|e| e.guard.scaled(0.0)).collect())
                .collect(),
            resets: system
                .transitions()
                .iter()
                .map(|e| vec![None; e.len()])
                .collect(),
            log_period: 0.0,
        }
    }

    /// Adds `factor · other`, where `other` is the derivative with respect to another parameter:
    /// the chain rule.
    pub fn add(&mut self, factor: f64, other: &Self) {
        for (regime, more) in self.regimes.iter_mut().zip(&other.regimes) {
            regime.matrix += factor * &more.matrix;
            regime.forcing = regime.forcing.plus(factor, &more.forcing);
        }
        for (guard, more) in self
            .guards
            .iter_mut()
            .flatten()
            .zip(other.guards.iter().flatten())
        {
            *guard = guard.plus(factor, more);
        }
        for (reset, more) in self
            .resets
            .iter_mut()
            .flatten()
            .zip(other.resets.iter().flatten())
        {
            let Some(more) = more else { continue };
            let sum = reset.get_or_insert_with(|| Reset {
                matrix: 0.0 * &more.matrix,
                offset: more.offset.plus(-1.0, &more.offset),
            });
            sum.matrix += factor * &more.matrix;
            sum.offset = sum.offset.plus(factor, &more.offset);
        }
        self.log_period += factor * other.log_period;
    }
}

/// Observer that carries `∂x/∂θ` of several parameters along a flow.
#[derive(Clone, Debug)]
pub struct Sensitivity<'a> {
    tangents: &'a [SystemTangent],
    /// `source[p][r]`: right-hand side of the sensitivity to parameter `p` in regime `r`.
    sources: Vec<Vec<Source>>,
    /// `∂q/∂θ_p` in the present regime.
    modal: Vec<Vec<Complex>>,
    /// Work space of a stretch.
    responses: Responses,
    phasors: Vec<Complex>,
}

/// The right-hand side `∂A x + ∂f` of the sensitivity (including the change of the period) in modal
/// coordinates.
#[derive(Clone, Debug)]
struct Source {
    /// Multiplies `e^{λ_j s} q_j`, `m × m`.
    direct: DMatrix<Complex>,
    /// Multiplies `e^{λ̄_j s} q̄_j`, `m × m`.
    mirrored: DMatrix<Complex>,
    /// Multiplies `e^{iω_k t}` and `e^{−iω_k t}` of tone `k`.
    tones: Vec<[DVector<Complex>; 2]>,
    constant: DVector<Complex>,
    /// `∂A + A ∂ln T` and `∂f + f ∂ln T`.
    matrix: DMatrix<f64>,
    forcing: HarmonicVector,
}

impl Source {
    fn new(regime: &Regime, tangent: &RegimeTangent, log_period: f64) -> Self {
        let matrix = &tangent.matrix + regime.matrix() * log_period;
        let forcing = tangent.forcing.plus(log_period, regime.forcing());
        let left = &regime.basis().left;
        let half = Complex::new(0.5, 0.0);
        let [direct, mirrored] = driven(regime.prepared(), &matrix);
        // Along the forced response, ∂A x_p + ∂f.
        let harmonic = regime.response().mapped(&matrix).plus(1.0, &forcing);
        Self {
            direct,
            mirrored,
            tones: harmonic
                .tones
                .iter()
                .map(|z| [left * z * half, left * z.map(|z| z.conj()) * half])
                .collect(),
            constant: left * harmonic.constant.map(|v| Complex::new(v, 0.0)),
            matrix,
            forcing,
        }
    }
}

/// Computes `½ L ∂A R` and `½ L ∂A R̄` from products of real matrices.
fn driven(prepared: &PreparedBasis, matrix: &DMatrix<f64>) -> [DMatrix<Complex>; 2] {
    let m = prepared.basis().len();
    // [Re R, −Im R], and [Re L; Im L] ∂A of it.
    let moved = matrix * prepared.stacked_right();
    let products = prepared.stacked_left() * moved;
    let entry = |sign: f64| {
        DMatrix::from_fn(m, m, |k, j| {
            let (a, b) = (products[(k, j)], products[(k, m + j)]);
            let (c, d) = (products[(m + k, j)], products[(m + k, m + j)]);
            Complex::new(0.5 * (a + sign * d), 0.5 * (c - sign * b))
        })
    };
    [entry(1.0), entry(-1.0)]
}

/// Value of `|μ − λ| L` from which the difference of two exponentials loses almost no digit.
const APART: f64 = 0.5;

/// Computes `∫₀^L e^{λ(L−τ)} e^{μτ} dτ` without overflow or cancellation; λ and μ are given with
/// `e^{λL}` and `e^{μL}`.
fn response(
    (lambda, from): (Complex, Complex),
    (mu, to): (Complex, Complex),
    length: f64,
) -> Complex {
    let apart = mu - lambda;
    if apart.norm_sqr() * length * length >= APART * APART {
        return (to - from) / apart;
    }
    let (slow, apart) = if lambda.re >= mu.re {
        (from, apart)
    } else {
        (to, -apart)
    };
    slow * phi1(apart * length) * length
}

/// The responses of all modes, over one length of time, to the terms that drive sensitivities.
#[derive(Clone, Debug, Default)]
struct Responses {
    /// One row per mode: the responses to μ = λ_j and its conjugate, to the tones and their
    /// conjugates, and to a constant. Empty where eigenvalues coincide.
    rows: Vec<Complex>,
    /// The exponentials that drive: μ and `e^{μL}`, in this order.
    drivers: Vec<(Complex, Complex)>,
}

impl Responses {
    /// Sets the responses for a length of time over which the modes are multiplied by `factors`.
    fn set(&mut self, regime: &Regime, drive: &Drive, length: f64, factors: &[Complex]) {
        self.rows.clear();
        self.drivers.clear();
        if !regime.basis().clusters.is_empty() {
            return;
        }
        let modes = regime
            .basis()
            .eigenvalues
            .iter()
            .copied()
            .zip(factors.iter().copied());
        let tones = drive.frequencies().iter().map(|&frequency| {
            let rate = Complex::new(0.0, frequency);
            (rate, (rate * length).exponential())
        });
        let both = |(mu, factor): (Complex, Complex)| [(mu, factor), (mu.conj(), factor.conj())];
        let constant = (Complex::new(0.0, 0.0), Complex::new(1.0, 0.0));
        self.drivers
            .extend(modes.clone().chain(tones).flat_map(both));
        self.drivers.push(constant);
        for mode in modes {
            let of = |driver: &(Complex, Complex)| response(mode, *driver, length);
            self.rows.extend(self.drivers.iter().map(of));
        }
    }

    /// Advances `modal`, the sensitivity that belongs to `source`, by that length of time; the
    /// motion began at `q` and the tones at `phasors`.
    fn carry(
        &self,
        modal: &mut [Complex],
        source: &Source,
        factors: &[Complex],
        q: &[Complex],
        phasors: &[Complex],
    ) {
        let rows = self.rows.chunks_exact(self.drivers.len());
        for (k, ((sigma, factor), row)) in modal.iter_mut().zip(factors).zip(rows).enumerate() {
            let (modes, rest) = row.split_at(2 * q.len());
            let mut sum = *sigma * factor;
            for (j, (q, [direct, mirrored])) in q.iter().zip(modes.as_chunks::<2>().0).enumerate() {
                sum += source.direct[(k, j)] * q * direct;
                sum += source.mirrored[(k, j)] * q.conj() * mirrored;
            }
            let (turning, constant) = rest.split_at(2 * phasors.len());
            let turning = turning.as_chunks::<2>().0.iter().zip(phasors);
            for ([a, b], ([direct, mirrored], phasor)) in source.tones.iter().zip(turning) {
                sum += a[k] * phasor * direct;
                sum += b[k] * phasor.conj() * mirrored;
            }
            *sigma = sum + source.constant[k] * constant[0];
        }
    }
}

impl<'a> Sensitivity<'a> {
    /// Creates zero sensitivities to the parameters of `tangents`, for a flow of `system` in regime
    /// `regime` at phase 0; if the motion sticks to a rigid stop, those of the stop.
    pub fn new(system: &System, tangents: &'a [SystemTangent], regime: usize) -> Self {
        let sources = tangents
            .iter()
            .map(|t| {
                let pairs = system.regimes().iter().zip(&t.regimes);
                pairs
                    .map(|(r, tangent)| Source::new(r, tangent, t.log_period))
                    .collect()
            })
            .collect();
        let m = system.regimes()[regime].basis().len();
        let mut start = Self {
            tangents,
            sources,
            modal: vec![vec![Complex::new(0.0, 0.0); m]; tangents.len()],
            responses: Responses::default(),
            phasors: Vec::new(),
        };
        if let Some((from, stop)) = system.stop_of(regime) {
            let row = &system.transitions()[from][stop].guard.row;
            let zero = vec![0.0; system.dimension()];
            for (p, tangent) in tangents.iter().enumerate() {
                let moved = tangent.guards[from][stop].at(system.drive(), &zero, 0.0);
                let state = row * (-moved / row.norm_squared());
                start.begin(&system.regimes()[regime], p, state.as_slice());
            }
        }
        start
    }

    /// Sets `∂x/∂θ_p` to `derivative` (length `n`) in `regime`, instead of zero.
    pub fn begin(&mut self, regime: &Regime, p: usize, derivative: &[f64]) {
        let left = &regime.basis().left;
        self.modal[p] = (0..left.nrows())
            .map(|k| {
                left.row(k)
                    .iter()
                    .zip(derivative)
                    .map(|(l, d)| l * *d)
                    .sum()
            })
            .collect();
    }

    /// Returns `∂q/∂θ_p` in the present regime.
    pub(crate) fn modal(&self, p: usize) -> &[Complex] {
        &self.modal[p]
    }

    /// Returns `∂q/∂θ_0` at time `s` of a stretch that is not completed yet.
    pub(crate) fn after(&self, segment: &SegmentView<'_>, s: f64) -> Vec<Complex> {
        let (regime, drive) = (segment.regime(), segment.system.drive());
        Propagator::new(regime, drive, s).sensitivity(
            self,
            segment.regime,
            segment.phase,
            segment.modal,
            &self.modal[0],
        )
    }

    /// Writes `∂x/∂θ_p` (length `n`) of a flow that is in `regime` now to `derivative`.
    pub fn to_state(&self, regime: &Regime, p: usize, derivative: &mut [f64]) {
        derivative.fill(0.0);
        for (k, q) in self.modal[p].iter().enumerate() {
            for (d, r) in derivative
                .iter_mut()
                .zip(regime.basis().right.column(k).iter())
            {
                *d += r.re * q.re - r.im * q.im;
            }
        }
    }
}

impl Observer for Sensitivity<'_> {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        let (regime, drive) = (segment.regime(), segment.system.drive());
        let (factors, q) = (segment.factors, segment.modal);
        let simple = regime.basis().clusters.is_empty();
        if simple {
            self.responses.set(regime, drive, segment.length, factors);
            let tones = 0..drive.frequencies().len();
            self.phasors.clear();
            self.phasors
                .extend(tones.map(|t| drive.phasor(t, segment.phase)));
        }
        for (modal, sources) in self.modal.iter_mut().zip(&self.sources) {
            let source = &sources[segment.regime];
            if simple {
                self.responses
                    .carry(modal, source, factors, q, &self.phasors);
            } else {
                augmented_stretch(
                    modal,
                    source,
                    regime,
                    drive,
                    segment.phase,
                    segment.length,
                    q,
                );
            }
        }
    }

    fn switch(&mut self, view: &SwitchView<'_>) {
        let (system, from, transition) = (view.system, view.from(), view.transition());
        let x = view.state();
        let (saltation, reset) = (view.saltation(&x), view.reset());
        let n = system.dimension();
        let jump = reset.map_or_else(|| DMatrix::identity(n, n), |r| r.matrix.clone());
        let mut before = DVector::zeros(n);
        for p in 0..self.tangents.len() {
            self.to_state(from, p, before.as_mut_slice());
            let tangent = &self.tangents[p];
            let guard = tangent.guards[view.switch.from][view.transition].at(
                system.drive(),
                x.as_slice(),
                view.phase,
            );
            let mut after = &saltation * &before;
            // The part of the saltation beyond the jump is u hᵀ with h s + ∂g in place
            // of h s: the switch moves with the guard as well.
            if guard != 0.0 {
                let along = &transition.guard.row;
                let size = along.norm_squared();
                let u = (&saltation - &jump) * along.transpose() / size;
                after += u * guard;
            }
            if let (Some(change), false) = (
                &tangent.resets[view.switch.from][view.transition],
                view.stuck,
            ) {
                after += &change.matrix * &x + change.offset.at(system.drive(), view.phase);
            }
            let to = &view.system.regimes()[view.switch.to];
            let stacked = to.prepared().stacked_left() * after;
            let m = stacked.len() / 2;
            self.modal[p] = (0..m)
                .map(|k| Complex::new(stacked[k], stacked[m + k]))
                .collect();
        }
    }
}

/// The map of modal coordinates and their sensitivity over one length of time in one regime, from
/// any start.
pub(crate) struct Propagator<'a> {
    regime: &'a Regime,
    drive: &'a Drive,
    length: f64,
    /// Factors `e^{λ_k · length}` of the modal coordinates.
    factors: Vec<Complex>,
    responses: Responses,
}

impl<'a> Propagator<'a> {
    pub(crate) fn new(regime: &'a Regime, drive: &'a Drive, length: f64) -> Self {
        let lambdas = regime.basis().eigenvalues.iter();
        let factors: Vec<Complex> = lambdas.map(|l| (l * length).exponential()).collect();
        let mut responses = Responses::default();
        responses.set(regime, drive, length, &factors);
        Self {
            regime,
            drive,
            length,
            factors,
            responses,
        }
    }

    /// Returns the modal coordinates at the end of a stretch that starts at `q`.
    pub(crate) fn modal(&self, q: &[Complex]) -> Vec<Complex> {
        let mut later = q.to_vec();
        self.regime
            .basis()
            .apply(&mut later, self.length, &self.factors);
        later
    }

    /// Returns the sensitivity to the first parameter at the end of a stretch; it is `s` at the
    /// start, where the coordinates are `q` and the phase is `phase`. `number` is the regime's.
    pub(crate) fn sensitivity(
        &self,
        of: &Sensitivity<'_>,
        number: usize,
        phase: f64,
        q: &[Complex],
        s: &[Complex],
    ) -> Vec<Complex> {
        let source = &of.sources[0][number];
        let mut later = s.to_vec();
        if !self.regime.basis().clusters.is_empty() {
            augmented_stretch(
                &mut later,
                source,
                self.regime,
                self.drive,
                phase,
                self.length,
                q,
            );
            return later;
        }
        let tones = self.drive.frequencies().len();
        let phasors: Vec<Complex> = (0..tones).map(|t| self.drive.phasor(t, phase)).collect();
        self.responses
            .carry(&mut later, source, &self.factors, q, &phasors);
        later
    }
}

/// Advances the state, its sensitivity and the drive by the exponential of one linear system, for
/// regimes whose eigenvalues coincide.
fn augmented_stretch(
    modal: &mut [Complex],
    source: &Source,
    regime: &Regime,
    drive: &Drive,
    phase: f64,
    length: f64,
    q: &[Complex],
) {
    let n = regime.matrix().nrows();
    let (extended, start) = augmented(regime.matrix(), regime.forcing(), source, drive, phase);
    let mut z = start;
    regime.to_state(
        drive,
        q.iter().copied(),
        phase,
        &mut z.as_mut_slice()[n..2 * n],
    );
    for (k, q) in modal.iter().enumerate() {
        for (i, r) in regime.basis().right.column(k).iter().enumerate() {
            z[i] += r.re * q.re - r.im * q.im;
        }
    }
    let end = nanotap_arithmetic::matrix_exp(&(extended * length)) * z;
    for (k, sigma) in modal.iter_mut().enumerate() {
        *sigma = regime
            .basis()
            .left
            .row(k)
            .iter()
            .zip(end.iter())
            .map(|(l, s)| l * *s)
            .sum();
    }
}

/// Returns the matrix of `(s, x, cos, sin, …, 1)` and its initial value, with zeros for `s` and
/// `x`.
fn augmented(
    a: &DMatrix<f64>,
    f: &HarmonicVector,
    source: &Source,
    drive: &Drive,
    phase: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let n = a.nrows();
    let tones = drive.frequencies().len();
    let size = 2 * n + 2 * tones + 1;
    let mut g = DMatrix::zeros(size, size);
    let mut start = DVector::zeros(size);
    g.view_mut((0, 0), (n, n)).copy_from(a);
    g.view_mut((n, n), (n, n)).copy_from(a);
    g.view_mut((0, n), (n, n)).copy_from(&source.matrix);
    for (offset, forcing) in [(0, &source.forcing), (n, f)] {
        for (k, tone) in forcing.tones.iter().enumerate() {
            for (i, z) in tone.iter().enumerate() {
                g[(offset + i, 2 * n + 2 * k)] = z.re;
                g[(offset + i, 2 * n + 2 * k + 1)] = -z.im;
            }
        }
        for (i, c) in forcing.constant.iter().enumerate() {
            g[(offset + i, size - 1)] = *c;
        }
    }
    for (k, &omega) in drive.frequencies().iter().enumerate() {
        let c = 2 * n + 2 * k;
        g[(c, c + 1)] = -omega;
        g[(c + 1, c)] = omega;
        let phasor = drive.phasor(k, phase);
        start[c] = phasor.re;
        start[c + 1] = phasor.im;
    }
    start[size - 1] = 1.0;
    (g, start)
}

impl Flow {
    /// Runs one drive period from phase 0 and writes the period map's Jacobian
    /// (`n × n`) and its derivative with respect to each parameter of `tangents` (one
    /// column each, `n × p`).
    ///
    /// # Errors
    /// As [`Flow::run_period`].
    pub fn run_period_with_sensitivities(
        &mut self,
        tangents: &[SystemTangent],
        jacobian: &mut DMatrix<f64>,
        derivatives: &mut DMatrix<f64>,
    ) -> Result<(), FlowError> {
        let Self { system, motion } = self;
        let start = motion.regime;
        let mut carried = crate::jacobian::Jacobian::at_start(system, start);
        let mut sensitivity = Sensitivity::new(system, tangents, start);
        motion.run_period(system, &mut (&mut carried, &mut sensitivity))?;
        let regime = &system.regimes()[motion.regime];
        carried.to_state(regime, jacobian);
        let mut column = vec![0.0; system.dimension()];
        for p in 0..tangents.len() {
            sensitivity.to_state(regime, p, &mut column);
            derivatives.column_mut(p).copy_from_slice(&column);
        }
        Ok(())
    }
}
