//! Recorded motions of both engines behind one trait, and the curves that are read off them.

use std::fmt::Debug;
use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use nanotap_flow::extrema::Extremum;
use nanotap_flow::trajectory::{PiecewiseSignal, Recorder};
use nanotap_flow::{Complex, Event, Output, Trajectory};
use nanotap_volterra::{Flow, Sample, Trajectory as Period};

use crate::nonlinear::Nonlinear;
use crate::{Model, MotionError};

/// A stretch of motion, of whole drive periods or less, as either flow computes it. Its time begins
/// at 0.
pub trait RecordedMotion: Debug {
    /// Returns the time at the end of the motion, in model units.
    fn end(&self) -> f64;

    /// Its smooth pieces, in order of time: in one regime, or on one branch of the force law.
    fn pieces(&self) -> Vec<MotionPiece>;

    /// Its switches between regimes or branches, in order of time, with the rate of the guard or,
    /// under a nonlinear force, of the gap.
    fn switches(&self) -> Vec<Event>;

    /// The motion at time `t` (at the nearer end outside); `None` if it is empty.
    fn instant(&self, t: f64) -> Option<Instant>;

    /// The state just before a switch at time `t`.
    fn state_before(&self, t: f64) -> Option<Vec<f64>>;

    /// The state at time `t`; `None` if it is empty.
    fn state_at(&self, t: f64) -> Option<Vec<f64>> {
        Some(self.instant(t)?.state)
    }
}

/// A smooth piece of a recorded motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionPiece {
    /// Time at the start of the piece, from the start of the recording, in model units.
    pub start: f64,
    /// Length of the piece in time, in model units.
    pub length: f64,
    /// The regime, or the branch of the force law.
    pub regime: usize,
}

/// An instant of a recorded motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Instant {
    /// The state, of the model's dimension.
    pub state: Vec<f64>,
    /// Time since drive phase 0, in model units, from 0 to one drive period.
    pub phase: f64,
    /// The regime, or the branch of the force law.
    pub regime: usize,
    /// Force of the sample on the tip under a nonlinear law, in units of EI g₀/L³; `None` where the
    /// force follows from regime and state.
    pub nonlinear_force: Option<f64>,
}

/// A recorded motion of either engine.
#[derive(Clone, Debug)]
pub enum Recording {
    /// Motion of a piecewise-linear model, in closed form.
    PiecewiseLinear(Trajectory),
    /// Motion of a model under a nonlinear force, period by period.
    Nonlinear(Arc<NonlinearRecording>),
}

impl Deref for Recording {
    type Target = dyn RecordedMotion;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::PiecewiseLinear(trajectory) => trajectory,
            Self::Nonlinear(recording) => &**recording,
        }
    }
}

/// A motion under a nonlinear force, period by period.
#[derive(Clone, Debug)]
pub struct NonlinearRecording {
    nonlinear: Arc<Nonlinear>,
    periods: Vec<Period>,
    /// The samples of a quadrature, with their weights.
    samples: OnceLock<Vec<(f64, Sample)>>,
}

/// Runs and records the next drive periods of a flow, as many as the number given.
pub(crate) type RecordPeriods<'a> = dyn FnMut(usize) -> Result<Recording, MotionError> + 'a;

impl Model {
    /// Starts a flow from `state` at drive phase 0, to be recorded part by part.
    ///
    /// # Errors
    /// When a piecewise-linear model has no regime that holds the state.
    pub fn recorder(&self, state: &[f64]) -> Result<Box<RecordPeriods<'_>>, MotionError> {
        if let Some(nonlinear) = &self.nonlinear {
            let mut flow = Flow::new(Arc::clone(&nonlinear.system));
            let mut state = state.to_vec();
            return Ok(Box::new(move |periods| {
                let mut period = || {
                    nonlinear.start(&mut flow, &state)?;
                    let period = flow.record_until(nonlinear.period)?;
                    nonlinear.end(&flow, &mut state);
                    Ok::<_, MotionError>(period)
                };
                let recorded = (0..periods).map(|_| period()).collect::<Result<_, _>>()?;
                Ok(Recording::of_periods(nonlinear, recorded))
            }));
        }
        let mut flow = nanotap_flow::Flow::new(Arc::clone(&self.system));
        flow.start(state, 0.0)?;
        Ok(Box::new(move |periods| {
            let mut recorder = Recorder::default();
            for _ in 0..periods {
                flow.run_period(&mut recorder)?;
            }
            let system = Arc::clone(&self.system);
            Ok(Recording::PiecewiseLinear(recorder.finish(system)))
        }))
    }

    /// Whether tip and sample touch in a regime, or on a branch of the force law.
    pub fn touches(&self, regime: usize) -> bool {
        let nonlinear = self.nonlinear.as_ref();
        let contact = nonlinear.map_or(&self.contact, |nonlinear| &nonlinear.contact);
        contact.get(regime).copied().unwrap_or(false)
    }

    /// Writes the position of a surface with a memory into a state in contact: it is `height`,
    /// where the tip keeps the surface. The memory does not follow the tip, because the end of the
    /// contact sets it anew.
    pub fn set_surface(&self, state: &mut [f64], contact: bool, height: f64) {
        if self.memory_reset.is_some() && contact {
            state[self.dimension() - self.memory] = height;
        }
    }

    /// The force of the sample on the tip.
    pub fn force_at(&self, instant: &Instant) -> f64 {
        let linear = || {
            let force = &self.force[instant.regime];
            force.at(self.system.drive(), &instant.state, instant.phase)
        };
        instant.nonlinear_force.unwrap_or_else(linear)
    }
}

impl Recording {
    /// Runs `model` over `periods` drive periods from `state` at drive phase 0.
    ///
    /// # Errors
    /// When the flow fails.
    pub fn of(model: &Model, state: &[f64], periods: usize) -> Result<Self, MotionError> {
        model.recorder(state)?(periods)
    }

    /// Creates the recording of these periods, in sequence.
    pub fn of_periods(nonlinear: &Arc<Nonlinear>, periods: Vec<Period>) -> Self {
        Self::Nonlinear(Arc::new(NonlinearRecording {
            nonlinear: Arc::clone(nonlinear),
            periods,
            samples: OnceLock::new(),
        }))
    }

    /// The closed form, of a piecewise-linear model.
    pub const fn exact(&self) -> Option<&Trajectory> {
        match self {
            Self::PiecewiseLinear(trajectory) => Some(trajectory),
            Self::Nonlinear(_) => None,
        }
    }

    /// An output that is the same in flight and in contact.
    pub fn curve(&self, output: &Output) -> Curve {
        match self {
            Self::PiecewiseLinear(trajectory) => Curve::PiecewiseLinear(trajectory.signal(output)),
            Self::Nonlinear(recording) => recording.curve(output, 0.0),
        }
    }

    /// The force of the sample on the tip.
    pub fn force(&self, model: &Model) -> Curve {
        match self {
            Self::PiecewiseLinear(trajectory) => {
                Curve::PiecewiseLinear(trajectory.signal_by_regime(&model.force))
            }
            Self::Nonlinear(recording) => recording.curve(&model.tip.scaled(0.0), 1.0),
        }
    }

    /// Times at which the tip hits a rigid stop, and the impulses on it.
    pub fn impulses(&self, model: &Model) -> Vec<(f64, f64)> {
        let Some(stop) = model.rigid_stop else {
            return Vec::new();
        };
        let hits = self
            .switches()
            .into_iter()
            .filter(|e| !model.touches(e.from));
        hits.map(|e| (e.time, -e.rate * stop.impulse(e.from, e.to)))
            .collect()
    }
}

impl RecordedMotion for Trajectory {
    fn end(&self) -> f64 {
        self.end()
    }

    fn pieces(&self) -> Vec<MotionPiece> {
        let piece = |s: &nanotap_flow::trajectory::Segment| MotionPiece {
            start: s.start,
            length: s.length,
            regime: s.regime,
        };
        self.segments().iter().map(piece).collect()
    }

    fn switches(&self) -> Vec<Event> {
        self.events().to_vec()
    }

    fn instant(&self, t: f64) -> Option<Instant> {
        let segment = self.segment_at(t)?;
        Some(Instant {
            state: self.state_at(t)?,
            phase: t - (segment.start - segment.phase),
            regime: segment.regime,
            nonlinear_force: None,
        })
    }

    fn state_before(&self, t: f64) -> Option<Vec<f64>> {
        let (n, tones) = (
            self.system().dimension(),
            self.system().drive().frequencies().len(),
        );
        let component = |i: usize| {
            let mut row = nalgebra::RowDVector::zeros(n);
            row[i] = 1.0;
            let signal = self.signal(&Output::linear(row, tones));
            let piece = signal.pieces.iter().rev().find(|p| p.start < t)?;
            Some(piece.signal.at((t - piece.start).min(piece.length)))
        };
        (0..n).map(component).collect()
    }
}

impl RecordedMotion for NonlinearRecording {
    fn end(&self) -> f64 {
        self.offset(self.periods.len())
    }

    fn pieces(&self) -> Vec<MotionPiece> {
        let all = self.periods.iter().enumerate().flat_map(|(k, period)| {
            period.stretches().map(move |s| MotionPiece {
                start: self.offset(k) + s.start,
                length: s.length,
                regime: s.branch,
            })
        });
        all.collect()
    }

    fn switches(&self) -> Vec<Event> {
        let all = self.periods.iter().enumerate().flat_map(|(k, period)| {
            period.switches().iter().map(move |s| Event {
                time: self.offset(k) + s.time,
                from: s.from,
                to: s.to,
                rate: s.rate,
                grazing: false,
                log_determinant: None,
            })
        });
        all.collect()
    }

    fn instant(&self, t: f64) -> Option<Instant> {
        let sample = self.sample_at(t)?;
        let mut state = sample.state.as_slice().to_vec();
        if self.nonlinear.remembers {
            state.push(sample.branch as f64);
        }
        Some(Instant {
            state,
            phase: sample.time,
            regime: sample.branch,
            nonlinear_force: Some(sample.force),
        })
    }

    fn state_before(&self, t: f64) -> Option<Vec<f64>> {
        self.state_at(t)
    }
}

impl NonlinearRecording {
    /// Returns the time at the start of a period, in model units.
    fn offset(&self, period: usize) -> f64 {
        period as f64 * self.nonlinear.period
    }

    /// Returns the recorded drive periods, in order.
    pub fn periods(&self) -> &[Period] {
        &self.periods
    }

    /// Returns the engine that recorded the periods.
    pub fn nonlinear(&self) -> &Nonlinear {
        &self.nonlinear
    }

    fn sample_at(&self, t: f64) -> Option<Sample> {
        let last = self.periods.len().checked_sub(1)?;
        let period = ((t / self.nonlinear.period).max(0.0) as usize).min(last);
        let recorded = &self.periods[period];
        let (start, end) = recorded.span();
        recorded.at((t - self.offset(period)).clamp(start, end))
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

    /// The Fourier coefficients of outputs at multiples of a frequency, a row a multiple.
    fn fouriers(
        &self,
        outputs: &[&nanotap_volterra::Output],
        base: f64,
        multiples: &[usize],
    ) -> Vec<Vec<Complex>> {
        let largest = multiples.iter().copied().max().unwrap_or_default();
        let samples = self.samples_resolving(base * largest as f64);
        let scale = 2.0 / self.end().max(f64::MIN_POSITIVE);
        // e^{−ijωt} is a product of a small and a large multiple's: 2√j sines in place of j.
        let stride = 1 + largest.isqrt();
        let turned = |multiple: usize, time: f64| {
            let (sin, cos) = nanotap_arithmetic::sin_cos(base * multiple as f64 * time);
            Complex::new(cos, -sin)
        };
        let mut rows = vec![vec![Complex::new(0.0, 0.0); outputs.len()]; multiples.len()];
        for (weight, sample) in samples.iter().filter(|(weight, _)| *weight != 0.0) {
            // A sum over many lines takes long; the study reports that it was cancelled.
            if self.nonlinear.system.cancel().is_cancelled() {
                break;
            }
            let values: Vec<f64> = outputs.iter().map(|o| self.read(o, sample)).collect();
            let small: Vec<Complex> = (0..stride).map(|j| turned(j, sample.time)).collect();
            let large: Vec<Complex> = (0..=largest / stride)
                .map(|j| turned(j * stride, sample.time) * (scale * weight))
                .collect();
            for (row, multiple) in rows.iter_mut().zip(multiples) {
                let turn = large[multiple / stride] * small[multiple % stride];
                for (sum, value) in row.iter_mut().zip(&values) {
                    *sum += turn * *value;
                }
            }
        }
        rows
    }

    /// An output with a share of the nonlinear force.
    fn curve(self: &Arc<Self>, output: &Output, force: f64) -> Curve {
        Curve::Nonlinear(Arc::clone(self), self.nonlinear.output(output, force))
    }

    /// The value of an output at a sample.
    fn read(&self, output: &nanotap_volterra::Output, sample: &Sample) -> f64 {
        read(&self.nonlinear, output, sample)
    }

    fn integral(&self, integrand: impl Fn(&Sample) -> f64) -> f64 {
        let samples = self.samples().iter();
        samples.map(|(weight, s)| integrand(s) * weight).sum()
    }
}

/// The value of an output at a sample, whose time may be counted from any beginning of a drive
/// period.
pub fn read(nonlinear: &Nonlinear, output: &nanotap_volterra::Output, sample: &Sample) -> f64 {
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

/// A scalar over a recorded motion.
#[derive(Clone, Debug)]
pub enum Curve {
    /// Curve of a piecewise-linear model, in closed form.
    PiecewiseLinear(PiecewiseSignal),
    /// Output of a motion under a nonlinear force.
    Nonlinear(Arc<NonlinearRecording>, nanotap_volterra::Output),
}

/// A piece of a [`Curve`] on which it is smooth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePiece {
    /// Index of the piece in its curve, from 0.
    pub index: usize,
    /// Time at the start of the piece, from the start of the recording, in model units.
    pub start: f64,
    /// Length of the piece in time, in model units.
    pub length: f64,
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
            Self::PiecewiseLinear(signal) => {
                let all = signal.pieces.iter().map(|p| (p.start, p.length));
                all.enumerate().map(piece).collect()
            }
            Self::Nonlinear(recording, _) => {
                let all = recording.pieces().into_iter().map(|p| (p.start, p.length));
                all.enumerate().map(piece).collect()
            }
        }
    }

    /// Returns the value at the time `s` after the start of a piece, its ends included; NaN if the
    /// curve has no such piece.
    pub fn on(&self, piece: &CurvePiece, s: f64) -> f64 {
        match self {
            Self::PiecewiseLinear(signal) => signal
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

    /// Returns an upper bound on the rate at which the curve changes on a piece, per unit of time.
    pub fn fastest(&self, piece: &CurvePiece) -> f64 {
        match self {
            Self::PiecewiseLinear(signal) => signal
                .pieces
                .get(piece.index)
                .map_or(0.0, |p| p.signal.fastest()),
            Self::Nonlinear(recording, _) => recording.periods.first().map_or(0.0, Period::fastest),
        }
    }

    /// The value at time `t` (of the nearest piece outside), `None` if empty.
    pub fn at(&self, t: f64) -> Option<f64> {
        match self {
            Self::PiecewiseLinear(signal) => signal.at(t),
            Self::Nonlinear(recording, output) => {
                let sample = recording.sample_at(t)?;
                Some(recording.read(output, &sample))
            }
        }
    }

    /// Returns the minimum and the maximum with their times; `None` if the curve is empty.
    pub fn range(&self) -> Option<(Extremum, Extremum)> {
        match self {
            Self::PiecewiseLinear(signal) => signal.range(),
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

    /// Returns the length of time covered, in model units.
    pub fn duration(&self) -> f64 {
        match self {
            Self::PiecewiseLinear(signal) => signal.duration(),
            Self::Nonlinear(recording, _) => recording.end(),
        }
    }

    /// The time mean (0 if empty).
    pub fn mean(&self) -> f64 {
        match self {
            Self::PiecewiseLinear(signal) => signal.mean(),
            Self::Nonlinear(recording, output) => {
                let sum = recording.integral(|s| recording.read(output, s));
                sum / recording.end().max(f64::MIN_POSITIVE)
            }
        }
    }

    /// The Fourier coefficients ([`Curve::fourier`]) of several curves of one recording, a row a
    /// frequency.
    pub fn fouriers(curves: &[&Self], base: f64, multiples: &[usize]) -> Vec<Vec<Complex>> {
        let (mut signals, mut outputs, mut nonlinear) = (Vec::new(), Vec::new(), None);
        for curve in curves {
            match curve {
                Self::PiecewiseLinear(signal) => signals.push(signal),
                Self::Nonlinear(recording, output) => {
                    outputs.push(output);
                    nonlinear = Some(recording);
                }
            }
        }
        if let Some(recording) = nonlinear {
            recording.fouriers(&outputs, base, multiples)
        } else {
            let frequencies: Vec<f64> = multiples.iter().map(|j| base * *j as f64).collect();
            nanotap_flow::integral::fouriers(&signals, &frequencies)
        }
    }

    /// The Fourier coefficient `c = (2/D) ∫ g e^{−iωt} dt` over the duration `D`, so that the
    /// component at `ω` is `Re(c e^{iωt})`.
    pub fn fourier(&self, omega: f64) -> Complex {
        match self {
            Self::PiecewiseLinear(signal) => signal.fourier(omega),
            Self::Nonlinear(recording, output) => recording.fouriers(&[output], omega, &[1])[0][0],
        }
    }

    /// The Fourier coefficients at several frequencies: as [`fourier`](Self::fourier) of each, for
    /// less work.
    pub fn fourier_at(&self, omegas: &[f64]) -> Vec<Complex> {
        let Self::Nonlinear(recording, output) = self else {
            return omegas.iter().map(|omega| self.fourier(*omega)).collect();
        };
        let fastest = omegas.iter().fold(0.0, |m: f64, omega| m.max(*omega));
        let mut sums = vec![Complex::new(0.0, 0.0); omegas.len()];
        for (weight, sample) in recording.samples_resolving(fastest) {
            let value = weight * recording.read(output, &sample);
            for (sum, omega) in sums.iter_mut().zip(omegas) {
                let (sin, cos) = nanotap_arithmetic::sin_cos(omega * sample.time);
                *sum += Complex::new(cos, -sin) * value;
            }
        }
        let scale = 2.0 / recording.end().max(f64::MIN_POSITIVE);
        sums.into_iter().map(|sum| sum * scale).collect()
    }

    /// `∫ g h dt` with another curve of the same recording.
    pub fn product_integral(&self, other: &Self) -> f64 {
        match (self, other) {
            (Self::PiecewiseLinear(a), Self::PiecewiseLinear(b)) => a.product_integral(b),
            (Self::Nonlinear(recording, a), Self::Nonlinear(_, b)) => {
                recording.integral(|s| recording.read(a, s) * recording.read(b, s))
            }
            _ => f64::NAN,
        }
    }
}
