//! A line of a scan by averaging: amplitude, phase and mean of the gap are slow, and the force acts on
//! them by its mean and its first harmonic over an oscillation (as in [`nanotap_volterra::averaging`]).
//!
//! With the gap `d̄ + Re(D e^{iΩt})`, the free amplitude `D₀`, the receptance `H` and the lever's
//! eigenvalue `λ` nearest to `iΩ`:
//!
//! `Ḋ = (λ − iΩ) (D − D₀ − H f D/|D|)`
//!
//! It has the lever's memory, the instrument's loop and the states of the lever, at a hundredth of the
//! time of the exact flow; higher harmonics of the motion are left out. It is a preview.

use std::collections::BTreeMap;

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_case::Case;
use nanotap_dynamics::Control;
use nanotap_error::Error;
use nanotap_flow::Complex;
use nanotap_model::Model;
use nanotap_volterra::averaging::{AveragedForce, SlowGap};

use super::electronics::{Electronics, Spot};
use super::instrument::Period;
use super::options::{Quantity, ScanOptions};
use super::plan::Plan;
use super::recorder::LineRecorder;
use super::report::{Channels, Direction, LineStatistics};
use super::state_tracker::StateTracker;
use super::tapping_period::PeriodSignals;

/// Least gaps per free amplitude at which averages are stored.
const GAPS: f64 = 2000.0;
/// Amplitudes per free amplitude at which averages are stored.
const AMPLITUDES: f64 = 40.0;
/// Fewest and most steps of a drive period.
const STEPS: [f64; 2] = [2.0, 64.0];
/// Number of steps per change of the amplitude that the slope of the force alone would make in a period,
/// as a multiple of the change.
const STEPS_OF_FORCE: f64 = 4.0;
/// Distance from which a lever comes, in free amplitudes.
const FROM: f64 = 2.0;
/// Distance by which it comes nearer in a period, in free amplitudes.
const NEARING: f64 = 2.5e-4;
/// Largest amplitude of a line that is shown, in free amplitudes.
const MAX_SWING: f64 = 3.0;
/// Number of periods between two checks of the flag that cancels the work.
const POLL: usize = 256;

/// A line by averaging, in SI.
#[derive(Clone, Debug)]
pub struct AveragedLine {
    /// Length of the line, m.
    pub size: f64,
    /// Lines a second, trace and retrace together, Hz.
    pub line_rate: f64,
    /// Number of drive periods of the line in one direction.
    pub periods_per_line: usize,
    /// Amplitude of the free lever at the drive's frequency, m.
    pub free_amplitude: f64,
    /// Amplitude that the feedback keeps, m.
    pub setpoint_amplitude: f64,
    /// Integral gain of the feedback, 1/s.
    pub integral_gain: f64,
    /// Statistics of each direction. States at the setpoint are not searched for, so that stretches off
    /// the setpoint have no height.
    pub lines: Vec<LineStatistics>,
    /// The line in the direction of rising positions.
    pub trace: Channels,
    /// The line back, if it is scanned.
    pub retrace: Option<Channels>,
}

/// The lever above a material.
struct SlowLever<'a> {
    gap: SlowGap<'a>,
    /// Gap at rest at distance 0, model units.
    offset: f64,
    /// Free deflection of the tip, model units.
    free: Complex,
    /// `(λ − iΩ) T`.
    decay: Complex,
    /// Averages by the numbers of the least gap and of the amplitude.
    known: BTreeMap<(i32, i32), AveragedForce>,
}

/// Averages between the stored ones, with the derivatives of mean and first harmonic by the least gap.
#[derive(Default)]
struct Averages {
    force: AveragedForce,
    stiffness: f64,
    harmonic_stiffness: f64,
}

/// The slow variables: complex amplitude of the gap, and the change of its mean by the force.
#[derive(Clone, Copy)]
struct Slow {
    swing: Complex,
    shift: f64,
}

impl<'a> SlowLever<'a> {
    /// The lever of a model; `None` where averaging does not describe it.
    fn new(model: &'a Model, gap: f64) -> Option<Self> {
        let free = &model.system.regimes()[0];
        let turning = Complex::new(0.0, model.frequency());
        let off = |z: &Complex| (z - turning).modulus();
        let eigenvalues = free.basis().eigenvalues.iter();
        let nearest = eigenvalues.min_by(|a, b| off(a).total_cmp(&off(b)))?;
        let slow = SlowGap::new(&model.nonlinear.as_ref()?.system)?;
        Some(Self {
            offset: slow.rest() - gap,
            free: free.project(&model.tip).tones[0],
            decay: (nearest - turning) * model.period(),
            gap: slow,
            known: BTreeMap::new(),
        })
    }

    /// The averages at a mean gap and an amplitude, linear between the stored ones.
    fn averages(&mut self, mean: f64, amplitude: f64) -> Averages {
        let size = self.gap.drive().modulus();
        let (fine, coarse) = (size / GAPS, size / AMPLITUDES);
        let least = (mean - amplitude).max(self.gap.pole() + fine);
        let (i, u) = split(least / fine);
        let (j, v) = split(amplitude / coarse);
        let mut out = Averages::default();
        for (di, dj) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let key = (i.saturating_add(di), j.saturating_add(dj));
            let gap = &self.gap;
            let stored = self.known.entry(key).or_insert_with(|| {
                let amplitude = f64::from(key.1) * coarse;
                gap.force(f64::from(key.0) * fine + amplitude, amplitude)
            });
            let across = if dj == 0 { 1.0 - v } else { v };
            let weight = across * if di == 0 { 1.0 - u } else { u };
            out.force.mean += weight * stored.mean;
            out.force.first += stored.first * weight;
            out.force.peak += weight * stored.peak;
            out.force.contact += weight * stored.contact;
            let slope = across * if di == 0 { -1.0 } else { 1.0 } / fine;
            out.stiffness += slope * stored.mean;
            out.harmonic_stiffness += slope * stored.first.modulus();
        }
        out
    }

    /// Advances the slow variables by a drive period at a distance, model units.
    fn advance(&mut self, slow: &mut Slow, distance: f64) -> PeriodSignals {
        let rest = self.offset + distance;
        let (drive, receptance) = (self.gap.drive(), self.gap.receptance());
        let compliance = self.gap.compliance();
        let reach = (receptance * self.decay).modulus();
        let here = self.averages(rest + slow.shift, slow.swing.modulus());
        let steps = (STEPS_OF_FORCE * reach * here.harmonic_stiffness.abs()).ceil();
        let steps = if steps.is_finite() { steps } else { STEPS[1] }.clamp(STEPS[0], STEPS[1]);
        let mut signals = PeriodSignals::default();
        for _ in 0..steps as usize {
            let amplitude = slow.swing.modulus();
            let here = self.averages(rest + slow.shift, amplitude);
            let yielding = 1.0 + compliance * here.stiffness.abs();
            slow.shift += (compliance * here.force.mean - slow.shift) / yielding;
            // Over a step the force is in proportion to the swing: it turns it without making it grow.
            let per_swing = here.force.first / amplitude.max(f64::MIN_POSITIVE);
            let force = slow.swing * per_swing;
            let stiffness = Complex::new(1.0, 0.0) - receptance * per_swing;
            let part = steps.recip();
            let target = drive / stiffness;
            if target.re.is_finite() && target.im.is_finite() {
                let turn = exponential(self.decay * stiffness * part);
                slow.swing = target + (slow.swing - target) * turn;
            }
            signals.force += force * part;
            signals.mean_force += here.force.mean * part;
            signals.contact += here.force.contact * part;
            signals.peak_force = signals.peak_force.max(here.force.peak);
            signals.dissipation -= std::f64::consts::PI * amplitude * here.force.first.im * part;
        }
        signals.deflection = self.free + slow.swing - drive;
        signals.mean_deflection = slow.shift;
        signals
    }
}

/// A number of a grid and the fraction behind it.
fn split(value: f64) -> (i32, f64) {
    let low = value.floor();
    (low as i32, value - low)
}

fn exponential(z: Complex) -> Complex {
    let (sin, cos) = nanotap_arithmetic::sin_cos(z.im);
    Complex::new(cos, sin) * nanotap_arithmetic::exp(z.re)
}

/// Scans a line by averaging. `None` where averaging does not describe the lever: over a
/// piecewise-linear sample, a surface that relaxes, or a force that depends on time.
///
/// # Errors
/// When an option or the case is not valid, or the work is cancelled.
pub fn averaged_line(
    case: &Case,
    options: &ScanOptions,
    control: &Control<'_>,
) -> Result<Option<AveragedLine>, Error> {
    let mut options = options.over(case)?;
    let comes_from_afar = options.z0.is_none();
    options.lines = Some(1);
    options.z0.get_or_insert(Quantity::Number(0.0));
    let mut plan = Plan::new(case, &options, control)?;
    let models = plan.materials.iter().map(|case| Ok(case.model()?));
    let models: Result<Vec<Model>, Error> = models.collect();
    let models = models?;
    let levers = models.iter().zip(&plan.materials);
    let levers = levers.map(|(model, case)| SlowLever::new(model, case.get(case.gap_key())));
    let Some(mut levers) = levers.collect::<Option<Vec<_>>>() else {
        return Ok(None);
    };
    let mut slow = Slow {
        swing: levers[0].gap.drive(),
        shift: 0.0,
    };
    if comes_from_afar {
        let Some(distance) = nearing(&mut levers[0], &mut slow, plan.setpoint) else {
            return Ok(None);
        };
        plan.z0 = distance * plan.length_unit;
    }
    let plan = &plan;
    let mut line = Line::new(plan, levers, slow);
    for k in 0..plan.settle {
        line.period(plan.position(0, false), k, control)?;
    }
    let directions = if plan.retrace {
        &[Direction::Trace, Direction::Retrace][..]
    } else {
        &[Direction::Trace]
    };
    let tracker = StateTracker::new(plan, 1.0);
    let mut lines = Vec::new();
    let mut images = Vec::new();
    for &direction in directions {
        let retrace = direction == Direction::Retrace;
        let first = plan.settle + lines.len() * plan.periods;
        let mut recorder = LineRecorder::new(plan, 0, direction, first);
        for index in 0..plan.periods {
            let period = line.period(plan.position(index, retrace), index, control)?;
            recorder.add(index, &period, &tracker);
        }
        let (statistics, pixels) = recorder.finish();
        let mut image = Channels::missing(1, plan.pixels);
        image.set_line(0, pixels);
        lines.push(statistics);
        images.push(image);
    }
    let swing = line.slow.swing.modulus() / line.levers[0].gap.drive().modulus();
    if swing.is_nan() || swing > MAX_SWING {
        return Ok(None);
    }
    let retrace = plan.retrace.then(|| images.pop()).flatten();
    Ok(images.pop().map(|trace| AveragedLine {
        size: plan.size[0],
        line_rate: plan.line_rate(),
        periods_per_line: plan.periods,
        free_amplitude: plan.free_amplitude,
        setpoint_amplitude: plan.setpoint * plan.free_amplitude,
        integral_gain: plan.integral_gain,
        lines,
        trace,
        retrace,
    }))
}

/// The distance, model units, at which the amplitude of a lever that comes from afar has fallen to the
/// setpoint.
fn nearing(lever: &mut SlowLever<'_>, slow: &mut Slow, setpoint: f64) -> Option<f64> {
    let size = lever.gap.drive().modulus();
    let steps = (FROM / NEARING) as usize;
    let mut distances = (0..steps).map(|k| size * (FROM - NEARING * k as f64));
    distances.find(|distance| {
        let amplitude = lever.advance(slow, *distance).deflection.modulus();
        amplitude <= setpoint * lever.free.modulus()
    })
}

/// The instrument with the averaged lever.
struct Line<'a> {
    plan: &'a Plan,
    levers: Vec<SlowLever<'a>>,
    slow: Slow,
    electronics: Electronics<'a>,
}

impl<'a> Line<'a> {
    fn new(plan: &'a Plan, levers: Vec<SlowLever<'a>>, slow: Slow) -> Self {
        let (free, receptance) = (levers[0].free, levers[0].gap.receptance());
        let signal = free + slow.swing - levers[0].gap.drive();
        let free_force = free.modulus() / receptance.modulus().max(f64::MIN_POSITIVE);
        Self {
            plan,
            slow,
            electronics: Electronics::new(plan, signal, free_force),
            levers,
        }
    }

    fn period(&mut self, x: f64, index: usize, control: &Control<'_>) -> Result<Period, Error> {
        if index.is_multiple_of(POLL) && control.is_cancelled() {
            return Err(Error::stopped());
        }
        let plan = self.plan;
        let spot = Spot {
            x,
            surface: plan.surface.height(x, plan.line_position(0)),
            material: plan.material(x),
        };
        let (lever, slow) = (&mut self.levers[spot.material], &mut self.slow);
        self.electronics
            .run_period(spot, |distance| Ok(lever.advance(slow, distance)))
    }
}
