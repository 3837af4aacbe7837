//! Dense output: a run recorded step by step, read at any time, with extrema and integrals.

use crate::flow::{Flow, Observer, Switch};
use crate::kernel::TimeMap;
use crate::law::Exit;
use crate::quadrature::{derivative, gauss_legendre, series};
use crate::step::{Solver, Step};
use crate::system::System;
use crate::{Complex, VolterraError};
use nalgebra::{DVector, RowDVector};
use std::sync::Arc;

/// Number of points of the Gauss–Legendre rule of one panel of an integral.
const POINTS: usize = 24;
/// Largest angle, in radians, through which the fastest mode turns within a panel.
const REACH: f64 = 6.0;
/// Largest angle, in radians, through which the phase of a factor turns in a panel: up to it
/// Gauss's rule of [`POINTS`] points is accurate to rounding.
const OSCILLATION: f64 = 36.0;
/// Largest number of steps in a trajectory.
pub const MAX_RECORDED_STEPS: usize = 4_000_000;

/// A scalar function of the motion: `row · x + offset + Re Σ tones e^{iωt} + force F`.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Row that multiplies the state, of the length of the state.
    pub row: RowDVector<f64>,
    /// Constant part, in the unit of the output.
    pub offset: f64,
    /// Complex amplitudes in the unit of the output, one per tone of the drive (empty: none).
    pub tones: Vec<Complex>,
    /// Factor of the law's force in the output, in units of the output per unit of force.
    pub force: f64,
}

impl Output {
    /// Creates a component of the state.
    pub fn component(dimension: usize, index: usize) -> Self {
        let mut row = RowDVector::zeros(dimension);
        row[index] = 1.0;
        Self {
            row,
            offset: 0.0,
            tones: Vec::new(),
            force: 0.0,
        }
    }
}

/// The motion at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Time of the sample, in the system's unit of time.
    pub time: f64,
    /// State at that time, of length `n`.
    pub state: DVector<f64>,
    /// Gap at that time, in the unit of the gap.
    pub gap: f64,
    /// Rate of the gap, in units of the gap per unit of time.
    pub rate: f64,
    /// Force of the law, in the unit of force; repulsion is positive.
    pub force: f64,
    /// Rate of the force, in units of force per unit of time; infinite where the force begins or
    /// ends like a square root of time.
    pub force_rate: f64,
    /// Number of the present branch of the law.
    pub branch: usize,
}

/// The motion at a node of a trajectory's quadrature, or at an end of one of its steps.
#[derive(Clone, Debug)]
pub struct Node {
    /// Weight in integrals over time, in the system's unit of time; 0 at the ends of steps.
    pub weight: f64,
    /// State, gap and force at the node.
    pub sample: Sample,
    /// Rate `ẋ` of the state.
    field: Vec<f64>,
    piece: usize,
    /// Value of the step's variable `u`.
    u: f64,
}

/// A stretch of a trajectory on one branch of the law, one step long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Time of its start, in the system's unit of time.
    pub start: f64,
    /// Length in time, in the system's unit of time.
    pub length: f64,
    /// Number of the branch of the law.
    pub branch: usize,
}

/// A stretch of motion between two steps' ends.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    pub(crate) map: TimeMap,
    pub(crate) start: f64,
    pub(crate) length: f64,
    pub(crate) end: f64,
    pub(crate) branch: usize,
    pub(crate) modal: Vec<f64>,
    pub(crate) coefficients: Vec<f64>,
}

/// A recorded run, which can be evaluated at any time.
#[derive(Clone, Debug)]
pub struct Trajectory {
    pub(crate) system: Arc<System>,
    pub(crate) pieces: Vec<Piece>,
    switches: Vec<Switch>,
    overflow: bool,
}

impl Observer for Trajectory {
    fn step(&mut self, _: &System, _: &mut Solver, step: &Step, _: &[f64]) {
        if self.pieces.len() >= MAX_RECORDED_STEPS {
            self.overflow = true;
            return;
        }
        self.pieces.push(Piece {
            map: step.map,
            start: step.start,
            length: step.length,
            end: step.end,
            branch: step.branch,
            modal: step.modal.clone(),
            coefficients: step.coefficients.clone(),
        });
    }

    fn switch(&mut self, _: &System, switch: &Switch, _: &Exit, _: &[f64]) {
        self.switches.push(*switch);
    }
}

impl Flow {
    /// Runs to time `end` and records the motion.
    ///
    /// # Errors
    /// As for [`Flow::run_until`]; [`VolterraError::TooLarge`] beyond [`MAX_RECORDED_STEPS`].
    pub fn record_until(&mut self, end: f64) -> Result<Trajectory, VolterraError> {
        let mut trajectory = Trajectory::empty(self.system.clone());
        self.run(end, &mut trajectory)?;
        trajectory.whole()
    }
}

impl Piece {
    fn end_time(&self) -> f64 {
        self.start + self.map.time(self.length, self.end)
    }

    /// Returns the derivative of the force's series by `u`.
    fn force_slope(&self) -> Vec<f64> {
        let mut slope = vec![0.0; self.coefficients.len()];
        derivative(&self.coefficients, &mut slope);
        slope
    }

    pub(crate) fn sample(&self, system: &System, u: f64) -> Sample {
        let mut modal = vec![0.0; system.dimension()];
        system.kernel_on(self.branch).partial(
            self.map,
            self.length,
            u,
            &self.modal,
            &self.coefficients,
            &mut modal,
        );
        system.spare_surface(self.branch, self.map.time(self.length, u), &mut modal);
        self.sample_of(system, u, &modal, &self.force_slope())
    }

    /// Returns the motion at `u`, where the modal coordinates are `modal`.
    fn sample_of(&self, system: &System, u: f64, modal: &[f64], force_slope: &[f64]) -> Sample {
        let time = self.start + self.map.time(self.length, u);
        let mut state = DVector::zeros(system.dimension());
        system.to_state(time, modal, state.as_mut_slice());
        let (gap, rate) = system.gap_of(time, modal);
        let slope = series(force_slope, u);
        Sample {
            time,
            state,
            gap,
            rate,
            force: series(&self.coefficients, u),
            force_rate: if slope == 0.0 {
                0.0
            } else {
                slope / self.map.rate(self.length, u)
            },
            branch: self.branch,
        }
    }
}

/// A local extremum of an output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extremum {
    /// Time of the extremum, in the system's unit of time.
    pub time: f64,
    /// Value of the output there, in the unit of the output.
    pub value: f64,
    /// Whether it is a maximum; otherwise it is a minimum.
    pub largest: bool,
    /// Number of the branch of the law there.
    pub branch: usize,
}

/// The position of an extremum of an output.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extreme {
    pub(crate) piece: usize,
    /// Value of the piece's variable `u`.
    pub(crate) u: f64,
    time: f64,
    pub(crate) value: f64,
    /// Whether the output falls after it; without meaning at the ends of steps.
    falls_after: bool,
}

impl Trajectory {
    pub(crate) fn empty(system: Arc<System>) -> Self {
        Self {
            system,
            pieces: Vec::new(),
            switches: Vec::new(),
            overflow: false,
        }
    }

    /// Returns the trajectory, or an error if it has too many steps.
    pub(crate) fn whole(self) -> Result<Self, VolterraError> {
        if self.overflow {
            return Err(VolterraError::TooLarge {
                what: "the number of recorded steps",
                found: MAX_RECORDED_STEPS + 1,
                limit: MAX_RECORDED_STEPS,
            });
        }
        Ok(self)
    }

    /// Returns the switches of the law, in order of time.
    pub fn switches(&self) -> &[Switch] {
        &self.switches
    }

    /// Returns the times of start and end (0 and 0 for an empty trajectory).
    pub fn span(&self) -> (f64, f64) {
        match (self.pieces.first(), self.pieces.last()) {
            (Some(first), Some(last)) => (first.start, last.end_time()),
            _ => (0.0, 0.0),
        }
    }

    /// Returns the stretches, one per step, in order of time.
    pub fn stretches(&self) -> impl Iterator<Item = Stretch> + '_ {
        self.pieces.iter().map(|p| Stretch {
            start: p.start,
            length: p.end_time() - p.start,
            branch: p.branch,
        })
    }

    /// Returns the number of recorded steps.
    pub fn steps(&self) -> usize {
        self.pieces.len()
    }

    /// Returns the motion at a time; `None` outside the span.
    pub fn at(&self, time: f64) -> Option<Sample> {
        let (start, end) = self.span();
        if !(time >= start && time <= end) {
            return None;
        }
        let k = self
            .pieces
            .partition_point(|p| p.end_time() < time)
            .min(self.pieces.len().checked_sub(1)?);
        let piece = &self.pieces[k];
        let u = piece
            .map
            .variable(piece.length, time - piece.start)
            .min(piece.end);
        Some(piece.sample(&self.system, u))
    }

    /// Returns the motion on stretch number `index` at a time `after` its start; also at its very
    /// ends, where the force of the next stretch may differ.
    pub fn on_stretch(&self, index: usize, after: f64) -> Option<Sample> {
        let piece = self.pieces.get(index)?;
        let u = piece.map.variable(piece.length, after).min(piece.end);
        Some(piece.sample(&self.system, u))
    }

    /// Returns the fastest rate of modes and drive, without those of a surface that relaxes, per
    /// unit of time.
    pub fn fastest(&self) -> f64 {
        let kernel = self.system.kernel();
        let blocks = kernel.modes().blocks();
        let lever = &blocks[..blocks.len() - kernel.surface()];
        let modes = lever.iter().map(crate::modes::Block::rate);
        let tones = self.system.drive().tones.iter().map(|t| t.frequency);
        modes.chain(tones).fold(0.0, f64::max)
    }

    /// Returns the value of an output and its rate at a sample.
    pub fn read(&self, output: &Output, sample: &Sample) -> (f64, f64) {
        self.read_with(output, sample, &self.field(sample))
    }

    /// Returns the rate of the state at a sample.
    fn field(&self, sample: &Sample) -> Vec<f64> {
        let mut field = vec![0.0; self.system.dimension()];
        let state = sample.state.as_slice();
        self.system
            .field(sample.time, state, sample.branch, &mut field);
        field
    }

    fn read_with(&self, output: &Output, sample: &Sample, field: &[f64]) -> (f64, f64) {
        let mut value = output.offset + (&output.row * &sample.state)[0];
        let mut rate: f64 = output.row.iter().zip(field).map(|(r, f)| r * f).sum();
        if output.force != 0.0 {
            value += output.force * sample.force;
            rate += output.force * sample.force_rate;
        }
        for (tone, z) in self.system.drive().tones.iter().zip(&output.tones) {
            let (sin, cos) = nanotap_arithmetic::sin_cos(tone.frequency * sample.time);
            value += z.re * cos - z.im * sin;
            rate -= tone.frequency * (z.re * sin + z.im * cos);
        }
        (value, rate)
    }

    /// Returns the nodes of a quadrature of the whole motion and the ends of its steps, in order of
    /// time. Integrals and extrema are computed from them.
    pub fn nodes(&self) -> Vec<Node> {
        self.nodes_resolving(0.0)
    }

    /// Returns such nodes, dense enough for a factor that oscillates with the angular frequency
    /// `omega`.
    pub fn nodes_resolving(&self, omega: f64) -> Vec<Node> {
        let mut all = Vec::new();
        for (index, piece) in self.pieces.iter().enumerate() {
            let slope = piece.force_slope();
            let mut modal = piece.modal.clone();
            let mut last = 0.0;
            for (u, weight) in self.places(piece, omega) {
                self.system.kernel_on(piece.branch).between(
                    piece.map,
                    piece.length,
                    [last, u],
                    &mut modal,
                    &piece.coefficients,
                );
                let time = piece.map.time(piece.length, u) - piece.map.time(piece.length, last);
                self.system.spare_surface(piece.branch, time, &mut modal);
                last = u;
                let sample = piece.sample_of(&self.system, u, &modal, &slope);
                all.push(Node {
                    weight: weight * piece.map.rate(piece.length, u),
                    field: self.field(&sample),
                    sample,
                    piece: index,
                    u,
                });
            }
        }
        all
    }

    /// Returns the integrals over time of `count` functions of the motion, which `integrand`
    /// writes.
    pub fn integrate(
        &self,
        count: usize,
        mut integrand: impl FnMut(&Sample, &mut [f64]),
    ) -> Vec<f64> {
        let mut sums = vec![0.0; count];
        let mut values = vec![0.0; count];
        for node in self.nodes().iter().filter(|node| node.weight != 0.0) {
            integrand(&node.sample, &mut values);
            for (sum, value) in sums.iter_mut().zip(&values) {
                *sum += node.weight * value;
            }
        }
        sums
    }

    /// Returns the time mean of an output.
    pub fn mean(&self, output: &Output) -> f64 {
        let (start, end) = self.span();
        self.integrate(1, |s, out| out[0] = self.read(output, s).0)[0] / (end - start)
    }

    /// Returns the Fourier coefficient `c = (2/D) ∫ g e^{−iωt} dt` over the span `D`, so that the
    /// component at `ω` is `Re(c e^{iωt})`.
    pub fn fourier(&self, output: &Output, omega: f64) -> Complex {
        let (start, end) = self.span();
        let nodes = self.nodes_resolving(omega);
        let parts = nodes.iter().filter(|node| node.weight != 0.0).map(|node| {
            let value = node.weight * self.read(output, &node.sample).0;
            let (sin, cos) = nanotap_arithmetic::sin_cos(omega * node.sample.time);
            Complex::new(value * cos, -value * sin)
        });
        parts.sum::<Complex>() * (2.0 / (end - start))
    }

    /// Returns `∫ F ḋ dt`, the work of the law's force on the gap: it contains stored energy and,
    /// negative over a closed motion, dissipated energy.
    pub fn work(&self) -> f64 {
        self.integrate(1, |s, out| out[0] = s.force * s.rate)[0]
    }

    /// Returns the time spent on the branches for which `inside` is true, in the system's unit of
    /// time.
    pub fn time_on(&self, inside: impl Fn(usize) -> bool) -> f64 {
        let stretches = self.stretches().filter(|s| inside(s.branch));
        stretches.map(|s| s.length).sum()
    }

    /// Returns the same time as a fraction of the span, 0 to 1.
    pub fn fraction(&self, inside: impl Fn(usize) -> bool) -> f64 {
        let (start, end) = self.span();
        self.time_on(inside) / (end - start)
    }

    /// Returns the local extrema of an output inside the span, in order of time.
    pub fn extrema(&self, output: &Output) -> Vec<Extremum> {
        let found = self.extrema_among(&self.nodes(), output).into_iter();
        found
            .map(|e| Extremum {
                time: e.time,
                value: e.value,
                largest: e.falls_after,
                branch: self.pieces[e.piece].branch,
            })
            .collect()
    }

    fn extrema_among(&self, nodes: &[Node], output: &Output) -> Vec<Extreme> {
        let rate = |node: &Node| self.read_with(output, &node.sample, &node.field).1;
        let mut found = Vec::new();
        for nodes in nodes.chunk_by(|a, b| a.piece == b.piece) {
            let piece = &self.pieces[nodes[0].piece];
            let rate_at = |u: f64| self.read(output, &piece.sample(&self.system, u)).1;
            let mut last = (0.0, rate(&nodes[0]));
            for node in &nodes[1..] {
                let here = (node.u, rate(node));
                if last.1 * here.1 < 0.0 || (last.1 != 0.0 && here.1 == 0.0) {
                    let u = bisect(&rate_at, last, here);
                    let sample = piece.sample(&self.system, u);
                    found.push(Extreme {
                        piece: nodes[0].piece,
                        u,
                        time: sample.time,
                        value: self.read(output, &sample).0,
                        falls_after: last.1 > 0.0,
                    });
                }
                last = here;
            }
        }
        found
    }

    /// Returns the least and the largest value of an output over the span, ends included.
    pub fn range(&self, output: &Output) -> (f64, f64) {
        let [least, largest] = self.ends_of_range(&self.nodes(), output);
        (least.1, largest.1)
    }

    /// Returns the times at which an output is least and largest, each with its value; `nodes` are
    /// the trajectory's own ([`Trajectory::nodes`]).
    pub fn ends_of_range(&self, nodes: &[Node], output: &Output) -> [(f64, f64); 2] {
        self.extremes(nodes, output).map(|e| (e.time, e.value))
    }

    /// Returns the least and the largest value with their places.
    pub(crate) fn extremes(&self, nodes: &[Node], output: &Output) -> [Extreme; 2] {
        let mut ends = [f64::INFINITY, f64::NEG_INFINITY].map(|value| Extreme {
            piece: 0,
            u: 0.0,
            time: 0.0,
            value,
            falls_after: false,
        });
        let edges = nodes.iter().filter(|node| node.weight == 0.0);
        let edges = edges.map(|node| Extreme {
            piece: node.piece,
            u: node.u,
            time: node.sample.time,
            value: self.read_with(output, &node.sample, &node.field).0,
            falls_after: false,
        });
        for one in edges.chain(self.extrema_among(nodes, output)) {
            if one.value < ends[0].value {
                ends[0] = one;
            }
            if one.value > ends[1].value {
                ends[1] = one;
            }
        }
        ends
    }

    /// Returns the gap as an output.
    pub fn gap_output(&self) -> Output {
        let drive = self.system.drive();
        Output {
            row: self.system.kernel().row().clone(),
            offset: drive.offset,
            tones: drive.tones.iter().map(|t| t.gap).collect(),
            force: 0.0,
        }
    }

    /// Returns the places `u` of a quadrature of a piece, with their weights by `u`, and its ends
    /// with weight 0, in order: dense enough for a factor that oscillates with the angular
    /// frequency `omega`.
    pub(crate) fn places(&self, piece: &Piece, omega: f64) -> Vec<(f64, f64)> {
        let (places, weights) = gauss_legendre(POINTS);
        let fastest = self
            .fastest()
            .max((self.fastest() + omega) * REACH / OSCILLATION);
        let steepest = piece
            .map
            .rate(piece.length, 0.0)
            .max(piece.map.rate(piece.length, piece.end));
        let panels = ((fastest * steepest * piece.end / REACH).ceil() as usize).max(1);
        let width = piece.end / panels as f64;
        let mut all = vec![(0.0, 0.0)];
        for panel in 0..panels {
            let nodes = places.iter().zip(weights);
            all.extend(nodes.map(|(x, w)| (width * (panel as f64 + x), w * width)));
        }
        all.push((piece.end, 0.0));
        all
    }
}

/// Finds the zero between two points of opposite sign: the Illinois rule, then halving.
pub(crate) fn bisect(f: &impl Fn(f64) -> f64, mut a: (f64, f64), mut b: (f64, f64)) -> f64 {
    for _ in 0..60 {
        let u = (a.0 * b.1 - b.0 * a.1) / (b.1 - a.1);
        let u = if u > a.0.min(b.0) && u < a.0.max(b.0) {
            u
        } else {
            0.5 * (a.0 + b.0)
        };
        let value = f(u);
        if value == 0.0 || (b.0 - a.0).abs() < 1e-15 {
            return u;
        }
        if value * b.1 < 0.0 {
            a = b;
        } else {
            a.1 *= 0.5;
        }
        b = (u, value);
        if (a.0 - b.0).abs() < 1e-15 {
            break;
        }
    }
    b.0
}
