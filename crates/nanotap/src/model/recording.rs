//! A recorded motion, of either engine, and the curves that are read off it.

use std::sync::{Arc, OnceLock};

use nanotap_flow::extrema::Extremum;
use nanotap_flow::trajectory::PiecewiseSignal;
use nanotap_flow::{Complex, Output, Trajectory};
use nanotap_volterra::{Flow, Sample, Trajectory as Period};

use crate::model::nonlinear::Nonlinear;
use crate::model::{Model, MotionError};

/// A recorded motion.
#[derive(Clone, Debug)]
pub enum Recording {
    /// Of a piecewise-linear model, in closed form.
    Exact(Trajectory),
    /// Under a nonlinear force.
    Nonlinear(Arc<NonlinearRecording>),
}

/// A motion under a nonlinear force, period by period.
#[derive(Clone, Debug)]
pub struct NonlinearRecording {
    nonlinear: Arc<Nonlinear>,
    periods: Vec<Period>,
    /// Where in time the samples of a quadrature stand, with their weights.
    samples: OnceLock<Vec<(f64, Sample)>>,
}

/// A stretch of a recording in flight or in contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// When it begins.
    pub start: f64,
    /// How long it lasts.
    pub length: f64,
    /// Whether tip and sample touch.
    pub contact: bool,
}

/// A scalar over a recorded motion.
#[derive(Clone, Debug)]
pub enum Curve {
    /// In closed form.
    Exact(PiecewiseSignal),
    /// Under a nonlinear force.
    Nonlinear(Arc<NonlinearRecording>, nanotap_volterra::Output),
}

/// A stretch of a [`Curve`] on which it is smooth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePiece {
    /// Its number.
    pub index: usize,
    /// When it begins.
    pub start: f64,
    /// How long it lasts.
    pub length: f64,
}

/// Runs a nonlinear model period by period from `state`, which ends where the motion does.
pub(crate) fn each_period(
    nonlinear: &Nonlinear,
    state: &mut [f64],
    periods: usize,
    mut take: impl FnMut(&[f64], Period),
) -> Result<(), MotionError> {
    let mut flow = Flow::new(Arc::clone(&nonlinear.system));
    for _ in 0..periods {
        nonlinear.start(&mut flow, state)?;
        let period = flow.record_until(nonlinear.period)?;
        nonlinear.end(&flow, state);
        take(state, period);
    }
    Ok(())
}

impl Recording {
    /// Runs `model` over `periods` drive periods from `state` at drive phase 0.
    ///
    /// # Errors
    /// When the flow fails.
    pub fn of(model: &Model, state: &[f64], periods: usize) -> Result<Self, MotionError> {
        let Some(nonlinear) = &model.nonlinear else {
            let trajectory = Trajectory::record(&model.system, state, periods)?;
            return Ok(Self::Exact(trajectory));
        };
        let mut recorded = Vec::with_capacity(periods);
        let mut state = state.to_vec();
        each_period(nonlinear, &mut state, periods, |_, period| {
            recorded.push(period);
        })?;
        Ok(Self::of_periods(nonlinear, recorded))
    }

    /// These periods, one after the other.
    pub(crate) fn of_periods(nonlinear: &Arc<Nonlinear>, periods: Vec<Period>) -> Self {
        Self::Nonlinear(Arc::new(NonlinearRecording {
            nonlinear: Arc::clone(nonlinear),
            periods,
            samples: OnceLock::new(),
        }))
    }

    /// The closed form, of a piecewise-linear model.
    pub const fn exact(&self) -> Option<&Trajectory> {
        match self {
            Self::Exact(trajectory) => Some(trajectory),
            Self::Nonlinear(_) => None,
        }
    }

    /// Time at the end; the start is 0.
    pub fn end(&self) -> f64 {
        match self {
            Self::Exact(trajectory) => trajectory.end(),
            Self::Nonlinear(recording) => recording.end(),
        }
    }

    /// The lever's state at time `t`, `None` of an empty recording.
    pub fn state_at(&self, t: f64) -> Option<Vec<f64>> {
        match self {
            Self::Exact(trajectory) => trajectory.state_at(t),
            Self::Nonlinear(recording) => recording.state_at(t),
        }
    }

    /// An output that is the same in flight and in contact.
    pub fn curve(&self, output: &Output) -> Curve {
        match self {
            Self::Exact(trajectory) => Curve::Exact(trajectory.signal(output)),
            Self::Nonlinear(recording) => Curve::Nonlinear(
                Arc::clone(recording),
                recording.nonlinear.output(output, 0.0),
            ),
        }
    }

    /// The force of the sample on the tip.
    pub fn force(&self, model: &Model) -> Curve {
        match self {
            Self::Exact(trajectory) => Curve::Exact(trajectory.signal_by_regime(&model.force)),
            Self::Nonlinear(recording) => {
                let nothing = model.tip.scaled(0.0);
                Curve::Nonlinear(
                    Arc::clone(recording),
                    recording.nonlinear.output(&nothing, 1.0),
                )
            }
        }
    }

    /// When the tip hits a rigid stop, and the impulses on it.
    pub fn impulses(&self, model: &Model) -> Vec<(f64, f64)> {
        let (Self::Exact(trajectory), Some(stop)) = (self, model.rigid_stop) else {
            return Vec::new();
        };
        let hits = trajectory
            .events()
            .iter()
            .filter(|e| !model.contact[e.from]);
        hits.map(|e| (e.time, -e.rate * stop.impulse(e.from, e.to)))
            .collect()
    }

    /// Flights and contacts, in order; a flight or a contact may be in several pieces.
    pub fn stretches(&self, model: &Model) -> Vec<Stretch> {
        match self {
            Self::Exact(trajectory) => trajectory
                .segments()
                .iter()
                .map(|s| Stretch {
                    start: s.start,
                    length: s.length,
                    contact: model.contact[s.regime],
                })
                .collect(),
            Self::Nonlinear(recording) => recording
                .pieces()
                .map(|(start, s)| Stretch {
                    start,
                    length: s.length,
                    contact: recording.nonlinear.contact[s.branch],
                })
                .collect(),
        }
    }
}

impl NonlinearRecording {
    /// Where a period begins.
    fn offset(&self, period: usize) -> f64 {
        period as f64 * self.nonlinear.period
    }

    fn end(&self) -> f64 {
        self.offset(self.periods.len())
    }

    /// The periods.
    pub(crate) fn periods(&self) -> &[Period] {
        &self.periods
    }

    /// The engine.
    pub(crate) fn nonlinear(&self) -> &Nonlinear {
        &self.nonlinear
    }

    fn sample_at(&self, t: f64) -> Option<Sample> {
        let last = self.periods.len().checked_sub(1)?;
        let period = ((t / self.nonlinear.period).max(0.0) as usize).min(last);
        let recorded = &self.periods[period];
        let (start, end) = recorded.span();
        recorded.at((t - self.offset(period)).clamp(start, end))
    }

    fn state_at(&self, t: f64) -> Option<Vec<f64>> {
        let sample = self.sample_at(t)?;
        let mut state = sample.state.as_slice().to_vec();
        if self.nonlinear.remembers {
            state.push(sample.branch as f64);
        }
        Some(state)
    }

    /// All stretches, each with its beginning counted from that of the recording.
    fn pieces(&self) -> impl Iterator<Item = (f64, nanotap_volterra::trajectory::Stretch)> + '_ {
        self.periods.iter().enumerate().flat_map(|(k, period)| {
            let offset = self.offset(k);
            period.stretches().map(move |s| (offset + s.start, s))
        })
    }

    /// The samples of a quadrature over everything, with their weights; times are counted from
    /// the beginning of the recording.
    fn samples(&self) -> &[(f64, Sample)] {
        self.samples.get_or_init(|| self.samples_resolving(0.0))
    }

    /// The same, dense enough for a factor that oscillates with the angular frequency `omega`.
    fn samples_resolving(&self, omega: f64) -> Vec<(f64, Sample)> {
        let mut all = Vec::new();
        for (k, period) in self.periods.iter().enumerate() {
            for mut node in period.nodes_resolving(omega) {
                node.sample.time += self.offset(k);
                all.push((node.weight, node.sample));
            }
        }
        all
    }

    /// The Fourier coefficients of outputs, a row a frequency.
    fn fouriers(
        &self,
        outputs: &[&nanotap_volterra::Output],
        frequencies: &[f64],
    ) -> Vec<Vec<Complex>> {
        let fastest = frequencies.iter().fold(0.0, |m: f64, omega| m.max(*omega));
        let samples = self.samples_resolving(fastest);
        let scale = 2.0 / self.end().max(f64::MIN_POSITIVE);
        let mut rows = vec![vec![Complex::new(0.0, 0.0); outputs.len()]; frequencies.len()];
        for (weight, sample) in samples.iter().filter(|(weight, _)| *weight != 0.0) {
            let values: Vec<f64> = outputs.iter().map(|o| self.read(o, sample)).collect();
            for (row, omega) in rows.iter_mut().zip(frequencies) {
                let (sin, cos) = nanotap_arithmetic::sin_cos(omega * sample.time);
                for (sum, value) in row.iter_mut().zip(&values) {
                    *sum += Complex::new(cos, -sin) * (scale * weight * value);
                }
            }
        }
        rows
    }

    /// The value of an output at a sample.
    fn read(&self, output: &nanotap_volterra::Output, sample: &Sample) -> f64 {
        read(&self.nonlinear, output, sample)
    }

    fn integral(&self, mut integrand: impl FnMut(&Sample) -> Complex) -> Complex {
        let samples = self.samples().iter();
        samples.map(|(weight, s)| integrand(s) * *weight).sum()
    }
}

/// The value of an output at a sample, whose time may be counted from any beginning of a drive
/// period.
pub(crate) fn read(
    nonlinear: &Nonlinear,
    output: &nanotap_volterra::Output,
    sample: &Sample,
) -> f64 {
    let linear: f64 = output
        .row
        .iter()
        .zip(sample.state.iter())
        .map(|(r, x)| r * x)
        .sum();
    let tones = nonlinear.system.drive().tones.iter().zip(&output.tones);
    let harmonic: f64 = tones
        .map(|(tone, z)| {
            let (sin, cos) = nanotap_arithmetic::sin_cos(tone.frequency * sample.time);
            z.re * cos - z.im * sin
        })
        .sum();
    output.offset + linear + harmonic + output.force * sample.force
}

impl Curve {
    /// The stretches on which it is smooth.
    pub fn pieces(&self) -> Vec<CurvePiece> {
        let piece = |(index, (start, length))| CurvePiece {
            index,
            start,
            length,
        };
        match self {
            Self::Exact(signal) => {
                let all = signal.pieces.iter().map(|p| (p.start, p.length));
                all.enumerate().map(piece).collect()
            }
            Self::Nonlinear(recording, _) => {
                let all = recording.pieces().map(|(start, s)| (start, s.length));
                all.enumerate().map(piece).collect()
            }
        }
    }

    /// The value `s` after the beginning of a piece, at its very ends too.
    pub fn on(&self, piece: &CurvePiece, s: f64) -> f64 {
        match self {
            Self::Exact(signal) => signal
                .pieces
                .get(piece.index)
                .map_or(f64::NAN, |p| p.signal.at(s)),
            Self::Nonlinear(recording, output) => {
                let mut index = piece.index;
                for period in &recording.periods {
                    if index < period.steps() {
                        let sample = period.on_stretch(index, s);
                        return sample.map_or(f64::NAN, |s| recording.read(output, &s));
                    }
                    index -= period.steps();
                }
                f64::NAN
            }
        }
    }

    /// The fastest rate at which it may turn on a piece.
    pub fn fastest(&self, piece: &CurvePiece) -> f64 {
        match self {
            Self::Exact(signal) => signal
                .pieces
                .get(piece.index)
                .map_or(0.0, |p| p.signal.fastest()),
            Self::Nonlinear(recording, _) => recording.periods.first().map_or(0.0, Period::fastest),
        }
    }

    /// The value at time `t` (of the nearest piece outside), `None` if empty.
    pub fn at(&self, t: f64) -> Option<f64> {
        match self {
            Self::Exact(signal) => signal.at(t),
            Self::Nonlinear(recording, output) => {
                let sample = recording.sample_at(t)?;
                Some(recording.read(output, &sample))
            }
        }
    }

    /// When it is least and when it is greatest, with the values; `None` if empty.
    pub fn range(&self) -> Option<(Extremum, Extremum)> {
        match self {
            Self::Exact(signal) => signal.range(),
            Self::Nonlinear(recording, output) => {
                let ends = recording.periods.iter().enumerate().map(|(k, period)| {
                    period
                        .ends_of_range(&period.nodes(), output)
                        .map(|(time, value)| Extremum {
                            time: recording.offset(k) + time,
                            value,
                        })
                });
                ends.reduce(|a, b| {
                    [
                        if b[0].value < a[0].value { b[0] } else { a[0] },
                        if b[1].value > a[1].value { b[1] } else { a[1] },
                    ]
                })
                .map(|[least, greatest]| (least, greatest))
            }
        }
    }

    /// Length of time covered.
    pub fn duration(&self) -> f64 {
        match self {
            Self::Exact(signal) => signal.duration(),
            Self::Nonlinear(recording, _) => recording.end(),
        }
    }

    /// The time mean (0 if empty).
    pub fn mean(&self) -> f64 {
        match self {
            Self::Exact(signal) => signal.mean(),
            Self::Nonlinear(recording, output) => {
                let sum = recording.integral(|s| recording.read(output, s).into());
                sum.re / recording.end().max(f64::MIN_POSITIVE)
            }
        }
    }

    /// The same of several curves of one recording, a row a frequency.
    pub fn fouriers(curves: &[&Self], frequencies: &[f64]) -> Vec<Vec<Complex>> {
        let exact: Option<Vec<&PiecewiseSignal>> = curves
            .iter()
            .map(|curve| match curve {
                Self::Exact(signal) => Some(signal),
                Self::Nonlinear(..) => None,
            })
            .collect();
        if let Some(signals) = exact {
            return nanotap_flow::integral::fouriers(&signals, frequencies);
        }
        let nonlinear = curves.iter().filter_map(|curve| match curve {
            Self::Exact(_) => None,
            Self::Nonlinear(recording, output) => Some((recording, output)),
        });
        let outputs: Vec<_> = nonlinear.clone().map(|(_, output)| output).collect();
        match nonlinear.clone().next() {
            Some((recording, _)) => recording.fouriers(&outputs, frequencies),
            None => Vec::new(),
        }
    }

    /// The Fourier coefficient `c = (2/D) ∫ g e^{−iωt} dt` over the duration `D`, so that the
    /// component at `ω` is `Re(c e^{iωt})`.
    pub fn fourier(&self, omega: f64) -> Complex {
        match self {
            Self::Exact(signal) => signal.fourier(omega),
            Self::Nonlinear(recording, output) => recording.fouriers(&[output], &[omega])[0][0],
        }
    }

    /// `∫ g h dt` with another curve of the same recording.
    pub fn product_integral(&self, other: &Self) -> f64 {
        match (self, other) {
            (Self::Exact(a), Self::Exact(b)) => a.product_integral(b),
            (Self::Nonlinear(recording, a), Self::Nonlinear(_, b)) => {
                let product = |s: &Sample| recording.read(a, s) * recording.read(b, s);
                recording.integral(|s| product(s).into()).re
            }
            _ => f64::NAN,
        }
    }
}
