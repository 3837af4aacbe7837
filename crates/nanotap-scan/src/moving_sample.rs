//! The lever over a sample that moves: a piecewise-linear system with the motion of the sample as
//! further states, and what a stretch of its flow says of force and deflection.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::flow::{Observer, SegmentView};
use nanotap_flow::regime::ModalOutput;
use nanotap_flow::sensitivity::SystemTangent;
use nanotap_flow::trajectory::{Piece, PiecewiseSignal};
use nanotap_flow::{
    Complex, Drive, HarmonicVector, Output, PreparedBasis, Regime, Reset, SpectralBasis, System,
    Transition,
};
use nanotap_volterra::{ForceSums, SurfaceSums};

use nanotap_error::Error;
use nanotap_model::Model;

/// Reads a period's deflection from the change of the state and the force.
#[derive(Clone, Debug)]
pub(super) struct Readout {
    period: f64,
    /// −1 where the period begins half a period before drive phase 0, else 1.
    sign: f64,
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
    /// Prepares the readout from the first `n` entries of the state, those of the beam.
    ///
    /// # Errors
    /// When the free lever does not restore.
    pub(super) fn new(model: &Model, n: usize, sign: f64) -> Result<Self, Error> {
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
            sign,
            turned_drive: (&turned * tone)[0] * Complex::new(sign * 0.5 * period, 0.0),
            turned,
            still_column: (&still * column)[0],
            still_constant: (&still * constant)[0],
            still,
        })
    }

    /// Complex amplitude of the deflection at the drive's frequency, counted from drive phase 0, and
    /// its mean, from the change of the state over a period.
    pub(super) fn deflection(&self, change: &[f64], sums: &ForceSums) -> (Complex, f64) {
        let period = self.period;
        let mut turned = self.turned_drive + self.turned_column * sums.harmonic;
        let mut still = -period * self.still_constant - self.still_column * sums.impulse;
        for ((change, a), b) in change.iter().zip(self.turned.iter()).zip(self.still.iter()) {
            turned -= a * *change;
            still += b * change;
        }
        (self.at_phase_zero(turned), still / period)
    }

    /// Complex amplitude, counted from drive phase 0, of a signal by its harmonic over the period.
    pub(super) fn at_phase_zero(&self, harmonic: Complex) -> Complex {
        harmonic * (self.sign * 2.0 / self.period)
    }

    pub(super) const fn period(&self) -> f64 {
        self.period
    }

    /// Deflection at the drive's frequency that a unit of force at that frequency causes.
    pub(super) fn compliance(&self) -> f64 {
        self.turned_column.modulus()
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

/// Derivatives by the rate of the gap, from those by the rate of the first mode.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TipRate {
    modes: usize,
    /// Shape of the first mode at the tip.
    shape: f64,
}

impl TipRate {
    fn of(model: &Model) -> Self {
        let modes = model.beam.as_ref().map_or(1, |beam| beam.modes.tip.len());
        Self {
            modes,
            shape: model.height.row[0],
        }
    }

    fn of_output(self, output: &Output) -> f64 {
        output.row[self.modes] / self.shape
    }

    /// Returns the derivative of the equations in a regime, less the part of the beam itself, which
    /// is the same in flight.
    fn of_matrix(self, matrix: &DMatrix<f64>, flight: &DMatrix<f64>) -> DVector<f64> {
        let mut change = matrix.column(self.modes) / self.shape;
        for row in 0..2 * self.modes {
            change[row] -= flight[(row, self.modes)] / self.shape;
        }
        change
    }
}

/// Motion of a sample, as further states after those of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SampleMotion {
    /// −1 where the flow begins half a period before drive phase 0, else 1.
    pub(super) sign: f64,
    /// Angular frequency of a motion within the period, if there is one: the gap then changes by
    /// `c + s`, with `ċ = 0`, `ṡ = ω u`, `u̇ = −ω s`; else by `c`.
    pub(super) omega: Option<f64>,
}

impl SampleMotion {
    /// Returns the number of states that the motion adds.
    pub(super) const fn states(self) -> usize {
        if self.omega.is_some() { 3 } else { 1 }
    }

    /// Writes the changes by the gap and by its rate into a matrix of `n` columns and the added.
    fn add_columns(self, matrix: &mut DMatrix<f64>, n: usize, [gap, rate]: [&DVector<f64>; 2]) {
        let rows = gap.len();
        matrix.view_mut((0, n), (rows, 1)).copy_from(gap);
        if let Some(omega) = self.omega {
            matrix.view_mut((0, n + 1), (rows, 1)).copy_from(gap);
            matrix
                .view_mut((0, n + 2), (rows, 1))
                .copy_from(&(rate * omega));
        }
    }

    /// An output of the model's system, which changes by so much with the gap.
    pub(super) fn output(self, model: &Model, output: &Output, by_gap: f64) -> Output {
        let n = output.row.len();
        let mut row = output
            .row
            .clone()
            .resize_horizontally(n + self.states(), 0.0);
        row[n] = by_gap;
        if let Some(omega) = self.omega {
            row[n + 1] = by_gap;
            row[n + 2] = omega * TipRate::of(model).of_output(output);
        }
        Output {
            row,
            tones: output.tones.iter().map(|z| z * self.sign).collect(),
            constant: output.constant,
        }
    }

    fn vector(self, vector: &HarmonicVector) -> HarmonicVector {
        let rows = vector.constant.len() + self.states();
        let zero = Complex::new(0.0, 0.0);
        let tones = vector.tones.iter();
        HarmonicVector {
            constant: vector.constant.clone().resize_vertically(rows, 0.0),
            tones: tones
                .map(|tone| (tone * Complex::new(self.sign, 0.0)).resize_vertically(rows, zero))
                .collect(),
        }
    }

    /// The basis of a regime with the added states, whose forcing changes so with the gap and with
    /// its rate.
    fn basis(
        self,
        r: usize,
        regime: &Regime,
        [change, by_rate]: [&DVector<f64>; 2],
    ) -> Result<SpectralBasis, Error> {
        let n = change.len();
        let zero = Complex::new(0.0, 0.0);
        let forced = |drive: &Drive, forcing: HarmonicVector| {
            let basis = Arc::new(PreparedBasis::from(regime.basis().clone()));
            Regime::with_basis(r, regime.matrix().clone(), forcing, drive, basis)
        };
        // The lever at rest under a unit change of the gap.
        let drive = Drive::single(self.omega.unwrap_or(1.0))?;
        let constant = HarmonicVector::zeros(n, 1).with_constant(change);
        let rest = forced(&drive, constant)?.response().constant.clone();
        let rest = rest.map(|v| Complex::new(v, 0.0));
        let basis = regime.basis();
        let m = basis.eigenvalues.len();
        let (rows, modes) = (n + self.states(), m + 1 + usize::from(self.omega.is_some()));
        let mut eigenvalues = basis.eigenvalues.clone();
        let mut right = basis.right.clone().resize(rows, modes, zero);
        let mut left = basis.left.clone().resize(modes, rows, zero);
        let one = Complex::new(1.0, 0.0);
        eigenvalues.push(zero);
        right.view_mut((0, m), (n, 1)).copy_from(&rest);
        right[(n, m)] = one;
        left.view_mut((0, n), (m, 1))
            .copy_from(&-(&basis.left * &rest));
        left[(m, n)] = one;
        if let Some(omega) = self.omega {
            // x = Re(response q), s = Re q, u = Re(i q).
            let i = Complex::new(0.0, 1.0);
            let mut forcing = HarmonicVector::zeros(n, 1);
            forcing.tones[0] = change.zip_map(by_rate, |c, r| Complex::new(c, omega * r));
            let response = forced(&drive, forcing)?.response().tones[0].clone();
            eigenvalues.push(i * omega);
            right.view_mut((0, m + 1), (n, 1)).copy_from(&response);
            right[(n + 1, m + 1)] = one;
            right[(n + 2, m + 1)] = i;
            // q = s − i u.
            let parts = [response.map(|z| z.re), response.map(|z| z.im)];
            for (k, part) in parts.iter().enumerate() {
                let own = &basis.left * part.map(|v| Complex::new(v, 0.0));
                left.view_mut((0, n + 1 + k), (m, 1)).copy_from(&-own);
            }
            left[(m + 1, n + 1)] = one;
            left[(m + 1, n + 2)] = -i;
        }
        Ok(SpectralBasis {
            eigenvalues,
            right,
            left,
            clusters: basis.clusters.clone(),
        })
    }
}

/// The model's system with the motion of the sample as further states: forces and guards depend on
/// it as on the case's gap.
///
/// # Errors
/// When the lever or the sample's motion is undamped at the other's frequency.
pub(super) fn moved_system(
    model: &Model,
    by_gap: &SystemTangent,
    motion: SampleMotion,
) -> Result<System, Error> {
    let system = &model.system;
    let drive = system.drive().clone();
    let n = system.dimension();
    let rows = n + motion.states();
    let rate = TipRate::of(model);
    let flight = system.regimes()[0].matrix();
    let mut regimes = Vec::new();
    for (r, (regime, change)) in system.regimes().iter().zip(&by_gap.regimes).enumerate() {
        let by_rate = rate.of_matrix(regime.matrix(), flight);
        let change = [&change.forcing.constant, &by_rate];
        let mut matrix = regime.matrix().clone().resize(rows, rows, 0.0);
        motion.add_columns(&mut matrix, n, change);
        if let Some(omega) = motion.omega {
            matrix[(n + 1, n + 2)] = omega;
            matrix[(n + 2, n + 1)] = -omega;
        }
        regimes.push(Regime::with_basis(
            r,
            matrix,
            motion.vector(regime.forcing()),
            &drive,
            Arc::new(motion.basis(r, regime, change)?.into()),
        )?);
    }
    let transitions = system
        .transitions()
        .iter()
        .enumerate()
        .map(|(r, out)| {
            let each = out.iter().enumerate().map(|(e, transition)| {
                let reset = transition.reset.as_ref().map(|reset| {
                    let mut matrix = reset.matrix.clone().resize(rows, rows, 0.0);
                    if let Some(change) = &by_gap.resets[r][e] {
                        let identity = DMatrix::identity(n, n);
                        let by_rate = rate.of_matrix(&reset.matrix, &identity);
                        motion.add_columns(&mut matrix, n, [&change.offset.constant, &by_rate]);
                    }
                    for added in n..rows {
                        matrix[(added, added)] = 1.0;
                    }
                    Reset {
                        matrix,
                        offset: motion.vector(&reset.offset),
                    }
                });
                Transition {
                    guard: motion.output(model, &transition.guard, by_gap.guards[r][e].constant),
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

/// Integrals of the force of a piecewise-linear sample, in closed form.
#[derive(Clone, Debug)]
pub(super) struct LinearSums {
    /// Force and height rate by regime; `None` where no force acts and nothing touches.
    regimes: Vec<Option<ContactOutputs>>,
    terms: Vec<Term>,
    pub(super) sums: ForceSums,
    /// Height of the tip by regime, and the motion of the surface: what [`SurfaceSums`] are of.
    surface: Option<MovingSurface>,
}

/// A surface that moves as `Re(amplitude · e^{iωt})`, with `t` from drive phase 0.
#[derive(Clone, Debug)]
struct MovingSurface {
    heights: Vec<ModalOutput>,
    frequency: f64,
    amplitude: Complex,
    sums: SurfaceSums,
}

/// Force and rate of the tip's height in contact.
#[derive(Clone, Debug)]
struct ContactOutputs {
    force: ModalOutput,
    rate: ModalOutput,
    touches: bool,
    rates: Vec<Complex>,
}

/// `e^{rate · s}` with its amplitudes in force and height rate.
#[derive(Clone, Copy, Debug)]
struct Term {
    rate: Complex,
    force: Complex,
    speed: Complex,
    /// `e^{rate · length}`, the factor at the end of the stretch.
    end: Complex,
}

impl LinearSums {
    /// Prepares the sums of the forces of a model along motions of `moved`. The force changes with
    /// the gap by `force_by_gap` in each regime; the harmonic is at the drive frequency.
    pub(super) fn new(
        model: &Model,
        moved: &System,
        force_by_gap: &[f64],
        motion: SampleMotion,
    ) -> Self {
        let drive = moved.drive();
        let height = motion.output(model, &model.height, 1.0);
        let regimes = moved.regimes().iter().enumerate().map(|(r, regime)| {
            let force = motion.output(model, &model.force[r], force_by_gap[r]);
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
                rates,
            })
        });
        let heights = moved.regimes().iter().map(|regime| regime.project(&height));
        Self {
            regimes: regimes.collect(),
            terms: Vec::new(),
            sums: ForceSums::default(),
            surface: motion.omega.map(|frequency| MovingSurface {
                heights: heights.collect(),
                frequency,
                amplitude: Complex::new(0.0, 0.0),
                sums: SurfaceSums::default(),
            }),
        }
    }

    /// Sets all sums to zero before a run over a surface that moves with this complex amplitude,
    /// counted from drive phase 0.
    pub(super) fn begin(&mut self, amplitude: Complex) {
        self.sums = ForceSums::default();
        if let Some(surface) = &mut self.surface {
            surface.sums = SurfaceSums::default();
            surface.amplitude = amplitude;
        }
    }

    /// Returns the sums of the surface that moves; empty without one.
    pub(super) fn surface(&self) -> SurfaceSums {
        self.surface
            .as_ref()
            .map_or_else(SurfaceSums::default, |surface| surface.sums)
    }

    /// Returns the force at the time `after` from the beginning of the stretch.
    fn force_at(&self, after: f64, constant: f64) -> f64 {
        let terms = self.terms.iter();
        let of = |term: &Term| (term.force * exponential(term.rate * after)).re;
        constant + terms.map(of).sum::<f64>()
    }

    /// Returns `∫ F e^{−iωt} dt` between two times after the beginning of the stretch, which is at
    /// drive phase `phase`.
    fn harmonic(&self, [from, to]: [f64; 2], phase: f64, constant: f64, omega: f64) -> Complex {
        let minus = Complex::new(0.0, -omega);
        let length = to - from;
        let own = |rate: Complex| moment(rate, length, exponential(rate * length));
        let mut sum = own(minus) * constant;
        for term in &self.terms {
            let force = term.force * exponential(term.rate * from);
            let mirrored = own(term.rate.conj() + minus);
            sum += (force * own(term.rate + minus) + force.conj() * mirrored) * 0.5;
        }
        sum * exponential(minus * (phase + from))
    }

    /// Adds the work of the force on the surface over a stretch, split where the force changes its
    /// sign; `turns` are the times after its beginning at which the force has extrema.
    fn add_work(&mut self, length: f64, phase: f64, constant: f64, turns: &[f64]) {
        let Some(surface) = &self.surface else {
            return;
        };
        let (omega, mut sums) = (surface.frequency, surface.sums);
        let by_rate = surface.amplitude * Complex::new(0.0, omega);
        let mut ends = Vec::new();
        let mut last = (0.0, self.force_at(0.0, constant));
        for end in turns.iter().copied().chain([length]) {
            let here = (end, self.force_at(end, constant));
            if last.1 * here.1 < 0.0 {
                let (mut low, mut high) = (last.0, here.0);
                loop {
                    let middle = 0.5 * (low + high);
                    if middle <= low || middle >= high {
                        break;
                    }
                    if self.force_at(middle, constant) * last.1 > 0.0 {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                ends.push(high);
            }
            last = here;
        }
        ends.push(length);
        let mut from = 0.0;
        for end in ends {
            let harmonic = self.harmonic([from, end], phase, constant, omega);
            let work = (by_rate * harmonic.conj()).re;
            sums.work += work;
            if self.force_at(0.5 * (from + end), constant) < 0.0 {
                sums.attracted_work += work;
            }
            from = end;
        }
        if let Some(surface) = &mut self.surface {
            surface.sums = sums;
        }
    }
}

/// Returns an output of a stretch, to find its extrema.
fn signal(segment: &SegmentView<'_>, output: &ModalOutput) -> PiecewiseSignal {
    PiecewiseSignal {
        pieces: vec![Piece {
            start: 0.0,
            length: segment.length,
            signal: segment.signal(output),
        }],
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
        let length = segment.length;
        if length <= 0.0 {
            return;
        }
        let outputs = self.regimes[segment.regime].as_ref();
        if let Some(surface) = &mut self.surface {
            let height = signal(segment, &surface.heights[segment.regime]);
            if let Some((least, _)) = height.range() {
                surface.sums.least_gap = surface.sums.least_gap.min(least.value);
            }
            if outputs.is_some_and(|outputs| outputs.touches) {
                let end = segment.phase + length;
                surface.sums.add_touch([segment.phase, end]);
            }
        }
        let Some(outputs) = outputs else {
            return;
        };
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
        let constant = outputs.force.constant;
        let moving = outputs.rate.constant;
        let minus = Complex::new(0.0, -drive.frequencies()[0]);
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
        let force = signal(segment, &outputs.force);
        let extrema = force.local_extrema();
        self.sums.include(self.force_at(0.0, constant));
        self.sums.include(self.force_at(length, constant));
        for extremum in &extrema {
            self.sums.include(extremum.value);
        }
        let turns: Vec<f64> = extrema.iter().map(|extremum| extremum.time).collect();
        self.add_work(length, segment.phase, constant, &turns);
    }
}
