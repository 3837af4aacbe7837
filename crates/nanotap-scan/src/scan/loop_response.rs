//! The feedback loop linearised at the setpoint: stability, bandwidth, and the gain to choose.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_arithmetic::eigenvalues;
use nanotap_flow::Complex;

use super::feedback::oscillator_map;
use super::instrument::{Instrument, Interaction};
use super::options::Mode;
use super::plan::Plan;
use super::report::LoopReport;
use super::tapping_period::{Lever, PeriodSignals};

/// Newton steps to the steady motion at the setpoint.
const MAX_ITERATIONS: usize = 40;
/// Periods that the lever settles first.
const MAX_SETTLING: usize = 5000;
/// Residual of the steady motion, as a part of the free amplitude.
const TOLERANCE: f64 = 1e-9;
/// Longest delay of a loop that is analysed, in periods.
const MAX_DELAY: usize = 100;
/// Peaking that the suggested gain allows.
const SUGGESTED_PEAKING: f64 = 1.1;
/// Frequencies at which the loop's response is evaluated.
const FREQUENCIES: usize = 300;

/// A steady motion with the setpoint amplitude, and its derivatives.
struct SteadyMotion {
    /// State at drive phase 180°, model units.
    state: Vec<f64>,
    gap: f64,
    signals: PeriodSignals,
    /// Jacobian of state and deflection (re, im) by state and gap, model units.
    derivative: DMatrix<f64>,
}

/// A stable steady motion of the lever with the setpoint amplitude.
#[derive(Clone, Debug)]
pub(super) struct SetpointState {
    pub(super) interaction: Interaction,
    /// State at drive phase 180°, model units.
    pub(super) state: Vec<f64>,
    /// Distance, model units.
    pub(super) gap: f64,
}

impl SetpointState {
    /// The one that Newton's method finds from a state and a distance, in the model's units.
    pub(super) fn near(plan: &Plan, lever: &mut Lever, state: &[f64], gap: f64) -> Option<Self> {
        let motion = steady_motion(lever, state.to_vec(), gap, plan.setpoint)?;
        let n = lever.continuous_dimension();
        let map = motion.derivative.view((0, 0), (n, n)).into_owned();
        let is_stable = spectral_radius(&map).is_some_and(|radius| radius < 1.0);
        is_stable.then(|| Self {
            interaction: Interaction::governing(&motion.signals),
            state: motion.state,
            gap: motion.gap,
        })
    }
}

/// Stability of the loop above one material.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoopStability {
    pub(super) material: usize,
    /// Largest modulus of the multipliers of the whole loop.
    pub(super) spectral_radius: f64,
    /// Integral gain at which the loop starts to oscillate, 1/s; `None` if none does.
    pub(super) largest_stable_gain: Option<f64>,
}

impl LoopStability {
    fn of(response: &LinearLoop<'_>, material: usize) -> Self {
        let plan = response.plan;
        let radius = |gain: f64| spectral_radius(&response.matrix(gain));
        let stable = |gain: f64| radius(gain).is_some_and(|radius| radius < 1.0);
        Self {
            material,
            spectral_radius: radius(plan.gains.integral).unwrap_or(f64::NAN),
            largest_stable_gain: largest_gain(stable).map(|gain| gain / plan.period),
        }
    }
}

/// Largest modulus of the eigenvalues.
fn spectral_radius(matrix: &DMatrix<f64>) -> Option<f64> {
    let all = eigenvalues(matrix)?.into_iter();
    Some(all.map(Complex::modulus).fold(0.0, f64::max))
}

/// Most materials above which the loop is examined.
const MAX_MATERIALS: usize = 16;

/// The loop at the setpoint above the first material, and its stability above each material; `None`
/// where no steady motion was found.
pub(super) fn loop_report(
    plan: &Plan,
    settled: &Instrument<'_>,
    gap: f64,
    quality_factor: f64,
) -> Option<(LoopReport, Vec<LoopStability>)> {
    if plan.mode == Mode::ConstantHeight || plan.gains.delay > MAX_DELAY {
        return None;
    }
    let own = settled.material();
    let mut lever = settled.lever_above(own);
    // From where the scan is, and for a loop that hunts from the motion at the start.
    let starts = [
        (settled.lever_state().to_vec(), gap),
        (
            lever.start(plan.start.as_deref()),
            plan.z0 / plan.length_unit,
        ),
    ];
    let mut found = starts
        .into_iter()
        .filter_map(|(state, gap)| steady_motion(&mut lever, state, gap, plan.setpoint));
    let motion = found.next()?;
    drop(found);
    let n = lever.continuous_dimension();
    let map = motion.derivative.view((0, 0), (n, n)).into_owned();
    let radius = spectral_radius(&map)?;
    let response = LinearLoop::new(plan, &motion, n);
    let stability = LoopStability::of(&response, own);
    let slope = response.slope();
    let largest = stability.largest_stable_gain.map(|gain| gain * plan.period);
    let response_now = response.bandwidths(plan.gains.integral);
    let suggested = largest.and_then(|largest| response.suggested(largest));
    let period = plan.period;
    let delays = quality_factor * period / std::f64::consts::PI
        + 0.5 * period
        + plan.lock_in.0 * plan.lock_in.1 as f64
        + plan
            .z_scanner
            .map_or(0.0, |[f, q]| q / (std::f64::consts::PI * f))
        + plan.gains.delay as f64 * period;
    let report = LoopReport {
        distance: motion.gap * plan.length_unit,
        state: Interaction::governing(&motion.signals),
        slope,
        lever_memory: -1.0 / nanotap_arithmetic::ln(radius),
        spectral_radius: stability.spectral_radius,
        largest_stable_gain: stability.largest_stable_gain,
        bandwidth_45: response_now.lag_45,
        bandwidth_3db: response_now.half_power,
        peaking: response_now.peaking,
        rule_of_thumb: 1.0 / (16.0 * delays),
        suggested_gain: suggested.map(|gain| gain / period),
        suggested_bandwidth: suggested.and_then(|gain| response.bandwidths(gain).lag_45),
    };
    let others = (0..plan.materials.len()).filter(|material| *material != own);
    let others = others.take(MAX_MATERIALS).filter_map(|material| {
        let mut lever = settled.lever_above(material);
        let mut state = motion.state.clone();
        lever.take_over(&mut state);
        let motion = steady_motion(&mut lever, state, motion.gap, plan.setpoint)?;
        let response = LinearLoop::new(plan, &motion, lever.continuous_dimension());
        Some(LoopStability::of(&response, material))
    });
    let all = std::iter::once(stability).chain(others).collect();
    Some((report, all))
}

/// Newton's method on state and gap for `P(x, g) = x` and the setpoint amplitude.
fn steady_motion(
    lever: &mut Lever,
    mut state: Vec<f64>,
    start: f64,
    setpoint: f64,
) -> Option<SteadyMotion> {
    let free = lever.free_deflection().modulus();
    let wanted = setpoint * free;
    let n = lever.continuous_dimension();
    let mut gap = start;
    let mut before = f64::INFINITY;
    // Near the steady motion at this distance first.
    for _ in 0..MAX_SETTLING {
        let signals = lever.advance(&mut state, gap).ok()?;
        let amplitude = signals.deflection.modulus();
        if (amplitude - before).abs() < 1e-6 * free {
            break;
        }
        before = amplitude;
    }
    for _ in 0..MAX_ITERATIONS {
        let derivative = lever.linearised(&state, gap, free).ok()?;
        let mut end = state.clone();
        let signals = lever.advance(&mut end, gap).ok()?;
        let amplitude = signals.deflection.modulus();
        let mut residual = DVector::zeros(n + 1);
        for i in 0..n {
            residual[i] = end[i] - state[i];
        }
        residual[n] = amplitude - wanted;
        if residual.amax() < TOLERANCE * free {
            return Some(SteadyMotion {
                state,
                gap,
                signals,
                derivative,
            });
        }
        let direction = signals.deflection / amplitude;
        let mut matrix = DMatrix::zeros(n + 1, n + 1);
        matrix
            .view_mut((0, 0), (n, n + 1))
            .copy_from(&derivative.view((0, 0), (n, n + 1)));
        for i in 0..n {
            matrix[(i, i)] -= 1.0;
        }
        for j in 0..=n {
            matrix[(n, j)] =
                direction.re * derivative[(n, j)] + direction.im * derivative[(n + 1, j)];
        }
        let step = matrix.lu().solve(&residual)?;
        // No farther than a twentieth of the free amplitude at once.
        let damping = (0.05 * free / step[n].abs()).min(1.0);
        for (value, step) in state.iter_mut().zip(step.iter().take(n)) {
            *value -= damping * step;
        }
        gap -= damping * step[n];
        if !gap.is_finite() {
            return None;
        }
        if damping < 1.0 {
            for _ in 0..200 {
                lever.advance(&mut state, gap).ok()?;
            }
        }
    }
    None
}

/// The largest gain up to which the loop is stable; `None` where it always is.
fn largest_gain(stable: impl Fn(f64) -> bool) -> Option<f64> {
    let (lowest, factor) = (1e-6, 1.25);
    if !stable(lowest) {
        return Some(0.0);
    }
    let mut low = lowest;
    while low < 100.0 {
        let next = low * factor;
        if stable(next) {
            low = next;
            continue;
        }
        let mut high = next;
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if stable(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        return Some(low);
    }
    None
}

/// Lever, lock-in amplifier, controller and scanner as one linear map over a period. A state is
/// (lever, stages, scanner, sum, command, late errors).
struct LinearLoop<'a> {
    plan: &'a Plan,
    n: usize,
    derivative: &'a DMatrix<f64>,
    /// Derivatives of the amplitude by the real and imaginary part of the lock-in's output.
    direction: [f64; 2],
    scanner: Option<[[f64; 2]; 2]>,
}

/// Bandwidths of the response of the height to the surface.
struct Bandwidths {
    lag_45: Option<f64>,
    half_power: Option<f64>,
    peaking: f64,
}

impl<'a> LinearLoop<'a> {
    fn new(plan: &'a Plan, motion: &'a SteadyMotion, n: usize) -> Self {
        let unit = motion.signals.deflection / motion.signals.deflection.modulus();
        Self {
            plan,
            n,
            derivative: &motion.derivative,
            direction: [unit.re, unit.im],
            scanner: plan
                .z_scanner
                .map(|resonance| oscillator_map(resonance, plan.period)),
        }
    }

    fn dimension(&self) -> usize {
        self.n + 2 * self.plan.lock_in.1 + 4 + self.plan.gains.delay
    }

    /// The state one period later under a surface of this height, and the height of the lever.
    fn step(&self, state: &DVector<f64>, surface: f64, gain: f64) -> (DVector<f64>, f64) {
        let (n, order) = (self.n, self.plan.lock_in.1);
        let mut next = state.clone();
        let scanner = n + 2 * order;
        let command = state[scanner + 3];
        let z = match self.scanner {
            // A scanner without a resonance has no rate: kept, it would be a multiplier of 1.
            None => {
                next[scanner + 1] = 0.0;
                command
            }
            Some([[a, b], [c, d]]) => {
                let (x, v) = (state[scanner] - command, state[scanner + 1]);
                next[scanner + 1] = c * x + d * v;
                command + a * x + b * v
            }
        };
        next[scanner] = z;
        let mut input = DVector::zeros(n + 1);
        input.rows_mut(0, n).copy_from(&state.rows(0, n));
        input[n] = z - surface;
        let out = self.derivative * input;
        next.rows_mut(0, n).copy_from(&out.rows(0, n));
        let part = self.plan.lock_in_part();
        let mut amplitude = 0.0;
        for (i, direction) in self.direction.iter().enumerate() {
            let mut signal = out[n + i];
            for stage in 0..order {
                let at = n + 2 * stage + i;
                next[at] = state[at] + part * (signal - state[at]);
                signal = next[at];
            }
            amplitude += direction * signal;
        }
        let late = scanner + 4;
        let error = match self.plan.gains.delay {
            0 => amplitude,
            delay => {
                for k in 1..delay {
                    next[late + k - 1] = state[late + k];
                }
                next[late + delay - 1] = amplitude;
                state[late]
            }
        };
        let sum = state[scanner + 2] + gain * error;
        next[scanner + 2] = sum;
        next[scanner + 3] = -(self.plan.gains.proportional * error + sum);
        (next, z)
    }

    fn matrix(&self, gain: f64) -> DMatrix<f64> {
        let dimension = self.dimension();
        let mut matrix = DMatrix::zeros(dimension, dimension);
        let mut unit = DVector::zeros(dimension);
        for j in 0..dimension {
            unit[j] = 1.0;
            matrix.set_column(j, &self.step(&unit, 0.0, gain).0);
            unit[j] = 0.0;
        }
        matrix
    }

    /// Steady change of the amplitude by the distance.
    fn slope(&self) -> f64 {
        let n = self.n;
        let map = self.derivative.view((0, 0), (n, n));
        let matrix = DMatrix::identity(n, n) - map;
        let column = self.derivative.view((0, n), (n, 1)).into_owned();
        let Some(state) = matrix.lu().solve(&column) else {
            return f64::NAN;
        };
        let direction = self.direction.iter().enumerate();
        direction
            .map(|(i, weight)| {
                let row = self.derivative.row(n + i);
                let by_state: f64 = row.iter().zip(state.iter()).map(|(a, b)| a * b).sum();
                weight * (by_state + row[n])
            })
            .sum()
    }

    /// The complex ratio of height and surface at a frequency in Hz.
    fn ratio(&self, matrix: &DMatrix<f64>, gain: f64, frequency: f64) -> Option<Complex> {
        let dimension = self.dimension();
        let zero = DVector::zeros(dimension);
        let (forced, _) = self.step(&zero, 1.0, gain);
        let (sin, cos) = nanotap_arithmetic::sin_cos(TAU * frequency * self.plan.period);
        let turn = Complex::new(cos, sin);
        let system = DMatrix::from_diagonal_element(dimension, dimension, turn)
            - matrix.map(|v| Complex::new(v, 0.0));
        let state = system.lu().solve(&forced.map(|v| Complex::new(v, 0.0)))?;
        // The scanner's entry is the position one period later.
        Some(state[self.n + 2 * self.plan.lock_in.1] * turn)
    }

    fn bandwidths(&self, gain: f64) -> Bandwidths {
        let matrix = self.matrix(gain);
        let top = 0.5 / self.plan.period;
        let lowest = 1e-6 * top;
        let at = |k: usize| {
            let part = k as f64 / FREQUENCIES as f64;
            lowest * nanotap_arithmetic::powf(top / lowest, part)
        };
        let ratio = |frequency: f64| self.ratio(&matrix, gain, frequency);
        let mut found = Bandwidths {
            lag_45: None,
            half_power: None,
            peaking: 0.0,
        };
        let lags = |z: Complex| z.im < -z.re.max(0.0) || z.re < 0.0;
        let is_low = |z: Complex| z.norm_sqr() < 0.5;
        for k in 0..=FREQUENCIES {
            let Some(here) = ratio(at(k)) else { continue };
            found.peaking = found.peaking.max(here.modulus());
            let refine = |passed: &dyn Fn(Complex) -> bool| {
                if k == 0 {
                    return None;
                }
                let (mut low, mut high) = (at(k - 1), at(k));
                for _ in 0..40 {
                    let middle = 0.5 * (low + high);
                    if ratio(middle).is_some_and(passed) {
                        high = middle;
                    } else {
                        low = middle;
                    }
                }
                Some(high)
            };
            if found.lag_45.is_none() && lags(here) {
                found.lag_45 = refine(&lags);
            }
            if found.half_power.is_none() && is_low(here) {
                found.half_power = refine(&is_low);
            }
        }
        found
    }

    /// The largest gain below `largest` with little peaking.
    fn suggested(&self, largest: f64) -> Option<f64> {
        let good = |gain: f64| self.bandwidths(gain).peaking <= SUGGESTED_PEAKING;
        let mut low = 1e-3 * largest;
        if !(largest > 0.0 && good(low)) {
            return None;
        }
        let mut high = largest;
        for _ in 0..12 {
            let middle = (low * high).sqrt();
            if good(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(low)
    }
}
