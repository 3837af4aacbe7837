//! The lever over a sample with a nonlinear force law: the same beam, the force at its tip from
//! [`nanotap_volterra`].
//!
//! The state is that of the free beam, `(a_1 … a_N, ȧ_1 … ȧ_N)`, and where the law remembers
//! (whether the tip is attached, say) one more number: the branch of the law at drive phase 0.
//! A whole number does not vary, so that its row and column of the Jacobian are zero and one
//! multiplier is. A surface that relaxes adds its coordinates to those of the beam.

use nanotap_arithmetic::{CancelFlag, ComplexFunctions as _};
use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_dynamics::{Tangency, Wall};
use nanotap_flow::{Output, Regime};
use nanotap_volterra::averaging::{about_rest, motions};
use nanotap_volterra::{
    Coarse, Drive, Flow, ForceLaw, Guard, Kernel, Modes, Options, Parameter as Change, Remark,
    System, Tone, ToneChange, Trajectory, VolterraError,
};
use schemars::JsonSchema;
use serde::Serialize;

use crate::beam_equations::{Beam, BeamTangent};
use crate::cantilever::Cantilever;
use crate::galerkin::Galerkin;
use crate::grazed::grazed;
use crate::model_map::EngineMap;
use crate::parameter::Parameter;
use crate::sample_law::SampleLaw;
use crate::{Model, ModelError, MotionError};

/// Length, in drive periods, of the transient with which motions over a relaxing surface are
/// guessed.
const SETTLING_PERIODS: usize = 400;
/// Largest relaxation time of the surface during this transient, in drive periods.
const SLOWEST_PERIODS: f64 = 15.0;
/// Relaxation time, in drive periods, beyond which a surface counts as slow.
const SLOW_PERIODS: f64 = 1000.0;

/// Number of values of the force in a time step of the collocation method.
const NODES: usize = 20;
/// Largest error of the gap in a step, relative to the larger of the tip's free swing and its gap
/// at rest: a few units of rounding.
const TOLERANCE: f64 = 3e-15;

/// Maximum number of steps in a drive period, tens of times what tapping with twenty modes takes;
/// so many take a tenth of a second.
const MAX_STEPS: f64 = 10_000.0;

/// The lever under a nonlinear force.
#[derive(Clone, Debug)]
pub struct Nonlinear {
    /// Lever modes, drive and force law, in model units.
    pub system: Arc<System>,
    /// Whether tip and sample touch on each branch of the law.
    pub contact: Vec<bool>,
    /// Drive period, in units of √(mL⁴/(EI)).
    pub period: f64,
    /// Factor of the sample's force in the force of the clamp, dimensionless.
    pub clamp_force: f64,
    /// Whether the law remembers its branch: the last entry of the state is then its number.
    pub remembers: bool,
    /// The law averaged over time, if it depends on that.
    averaged_law: Option<Arc<dyn ForceLaw>>,
}

impl PartialEq for Nonlinear {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.system, &other.system)
    }
}

impl Nonlinear {
    /// Prepares the beam in flight, `free`, under `law`, with the gap and the effect of the force
    /// from `beam`.
    pub(crate) fn new(
        law: &SampleLaw,
        beam: &Beam<'_>,
        free: &Regime,
        drive: &nanotap_flow::Drive,
    ) -> Result<Self, ModelError> {
        let height = beam.height();
        let law = law.build()?;
        let kernel = kernel(free, &height.row, beam.kick())?;
        let tones: Vec<Tone> = drive
            .frequencies()
            .iter()
            .enumerate()
            .map(|(k, &frequency)| Tone {
                frequency,
                forcing: free.forcing().tones[k].clone(),
                gap: height.tones[k],
            })
            .collect();
        let response = free.project(height);
        let swing: f64 = response.tones.iter().map(|z| z.modulus()).sum();
        let size = swing.max(height.constant.abs());
        // Nearer, a force may have a wall, which not every motion reaches.
        let away = height.constant.abs() + swing;
        let force = law.value(law.branch_at(away, 0.0), away, 0.0);
        if !force.is_finite() {
            return Err(ModelError::Nonlinear(VolterraError::Value {
                what: "the force on the tip farthest from the sample".into(),
                found: force,
                needed: "finite",
            }));
        }
        let tolerance = TOLERANCE * if size > 0.0 { size } else { 1.0 };
        let forcing = Drive {
            constant: free.forcing().constant.clone(),
            offset: height.constant,
            tones,
        };
        // A repetition of two tones, and the window of a signal, have several of the drive's periods.
        let repetitions = (drive.period() * beam.drive_frequency() / TAU).max(1.0);
        let options = Options {
            max_steps: (MAX_STEPS * repetitions) as usize,
            ..Options::new(tolerance)
        };
        let system = System::new(kernel, Arc::clone(&law), forcing, options)?;
        Ok(Self {
            system: Arc::new(system),
            contact: (0..law.branches()).map(|b| law.touches(b)).collect(),
            period: drive.period(),
            clamp_force: beam.clamp_force(),
            remembers: law.remembers(),
            averaged_law: law.averaged(),
        })
    }

    /// Returns the engine with motions that end with an error once `cancel` is set.
    pub(crate) fn cancelled_by(mut self, cancel: &CancelFlag) -> Self {
        let system = Arc::unwrap_or_clone(self.system);
        self.system = Arc::new(system.cancelled_by(cancel.clone()));
        self
    }

    /// Sets the gap to `gap`, in units of g₀.
    ///
    /// # Errors
    /// When the law has no force at this distance.
    pub fn set_gap(&mut self, gap: f64) -> Result<(), MotionError> {
        Ok(Arc::make_mut(&mut self.system).set_offset(gap)?)
    }

    /// Returns the branch of the law in a state of the model at drive phase 0: the remembered one,
    /// if the gap allows it.
    fn branch(&self, state: &[f64]) -> usize {
        let n = self.system.dimension();
        let law = self.system.law();
        let (gap, rate) = self.system.gap(0.0, &state[..n]);
        let second = self.system.second_argument(0.0, rate, &state[..n]);
        let known = remembered(&state[n..]);
        let possible = |branch: &usize| {
            *branch < law.branches()
                && self.system.exits(*branch).iter().all(|exit| {
                    let guard = match exit.guard {
                        Guard::Falls(level) => gap - level,
                        Guard::Rises(level) => level - gap,
                        Guard::Turns => -rate,
                        Guard::Own(index) => law.guard(index, gap, second).value,
                    };
                    guard >= 0.0
                })
        };
        known
            .filter(possible)
            .unwrap_or_else(|| law.branch_at(gap, second))
    }

    /// Dimension of the state of the model: lever and surface, and the branch where it is remembered.
    pub(crate) fn dimension(&self) -> usize {
        self.system.dimension() + self.discrete_entries()
    }

    /// Returns the number of last entries of a state that are whole numbers: 1 for the branch of
    /// the law, where it is remembered, else 0.
    pub fn discrete_entries(&self) -> usize {
        usize::from(self.remembers)
    }

    /// Returns the rates of decay of the sample's entries at the end of a state, in model units: in
    /// flight those of a surface that relaxes; 1 for whole numbers.
    pub(crate) fn memory_rates(&self) -> Vec<f64> {
        let surface = self.system.law().surface().map(|surface| &*surface.rates);
        let whole = vec![1.0; self.discrete_entries()];
        [surface.unwrap_or_default(), &whole].concat()
    }

    /// Returns the law at rest: that of the relaxed surface, or the time average of a force that
    /// depends on time.
    pub fn static_law(&self) -> &Arc<dyn ForceLaw> {
        let law = self.system.law();
        let averaged = self.averaged_law.as_ref().unwrap_or(law);
        law.surface().map_or(averaged, |surface| &surface.relaxed)
    }

    /// The state of the model with these coordinates of the lever, on a branch of the law.
    fn state(&self, mut lever: Vec<f64>, branch: usize) -> Vec<f64> {
        if self.remembers {
            lever.push(branch as f64);
        }
        lever
    }

    /// Guesses of periodic motions at drive phase 0, by averaging over the drive's strongest tone
    /// and by the linear response about each rest of the lever.
    pub fn averaged_states(&self) -> Vec<Vec<f64>> {
        if self.system.law().surface().is_some() || self.averaged_law.is_some() {
            return self.settled_states().unwrap_or_default();
        }
        let rests = self.equilibria();
        let gaps: Vec<f64> = rests.iter().map(|rest| rest.gap).collect();
        let about = |rest: &Equilibrium| about_rest(&self.system, rest.branch, rest.gap);
        let motions = motions(&self.system, &gaps).into_iter();
        motions
            .chain(rests.iter().filter_map(about))
            .map(|motion| self.state(motion.state, motion.branch))
            .collect()
    }

    /// Whether a surface takes so long to settle that no run is followed to its end.
    pub fn is_slow(&self) -> bool {
        let surface = self.system.law().surface();
        let slowest = surface.and_then(|surface| surface.rates.iter().copied().reduce(f64::min));
        slowest.is_some_and(|rate| rate * self.period * SLOW_PERIODS < 1.0)
    }

    /// States after a transient from rest and from the free motion.
    fn settled_states(&self) -> Result<Vec<Vec<f64>>, VolterraError> {
        let rest = vec![0.0; self.system.dimension()];
        let starts = [rest, self.system.free_state(0.0)].into_iter();
        starts.map(|start| self.settled_from(&start)).collect()
    }

    /// The state after a transient of `SETTLING_PERIODS` over a surface whose slow coordinates are
    /// faster and have the same compliance: a guess of the motion that a run leads to.
    ///
    /// # Errors
    /// When the motion diverges, or is cancelled.
    pub fn settled_from(&self, start: &[f64]) -> Result<Vec<f64>, VolterraError> {
        let system = self
            .system
            .hastened(1.0 / (SLOWEST_PERIODS * self.period))?;
        let mut state = start[..system.dimension()].to_vec();
        let mut flow = Flow::new(Arc::new(system));
        for _ in 0..SETTLING_PERIODS {
            flow.start(&state, 0.0)?;
            flow.run_until(self.period)?;
            flow.state(&mut state);
        }
        Ok(self.state(state, flow.branch()))
    }

    /// Puts `flow` at a state of the model at drive phase 0.
    ///
    /// # Errors
    /// When the state has another length, or a number that is not finite.
    pub fn start(&self, flow: &mut Flow, state: &[f64]) -> Result<(), MotionError> {
        self.check_length(state)?;
        let n = self.system.dimension();
        if state.iter().all(|v| v.is_finite()) {
            flow.start_on(&state[..n], 0.0, self.branch(state))?;
        } else {
            // Refused with the value that is none.
            flow.start(&state[..n], 0.0)?;
        }
        Ok(())
    }

    /// Puts `flow` at a state of the model at `time`: on the branch that the state remembers, or
    /// else on that of its gap.
    ///
    /// # Errors
    /// When the state has another length, or a number that is not finite.
    pub fn resume(&self, flow: &mut Flow, state: &[f64], time: f64) -> Result<(), MotionError> {
        self.check_length(state)?;
        let (lever, memory) = state.split_at(self.system.dimension());
        match memory.first().filter(|branch| **branch >= 0.0) {
            Some(branch) => flow.start_on(lever, time, branch.round() as usize)?,
            None => flow.start(lever, time)?,
        }
        Ok(())
    }

    /// Writes the state that `flow` has reached to `state`.
    pub fn end(&self, flow: &Flow, state: &mut [f64]) {
        let n = self.system.dimension();
        flow.state(&mut state[..n]);
        if let Some(memory) = state.get_mut(n) {
            *memory = flow.branch() as f64;
        }
    }

    /// Returns the states of the model at drive phase 0 in which the gap is at the
    /// [wall](ForceLaw::wall) of the law; `None` if the law holds at every gap. Distances from it
    /// are those of the gap, in units of g₀.
    pub(crate) fn wall(&self) -> Option<Wall> {
        Some(self.at_gap(self.system.law().wall()?))
    }

    /// Returns the states at drive phase 0 in which the tip is at a pole of the law; `None` if it has
    /// none.
    pub fn pole(&self) -> Option<Wall> {
        Some(self.at_gap(self.system.law().pole()?))
    }

    /// Returns the states at drive phase 0 with this gap.
    fn at_gap(&self, gap: f64) -> Wall {
        let n = self.system.dimension();
        let mut row = self.system.kernel().row().as_slice().to_vec();
        row.resize(self.dimension(), 0.0);
        let least = gap - self.system.gap(0.0, &vec![0.0; n]).0;
        Wall { row, least }
    }

    /// Returns the gap at which contact begins from outside, in units of g₀; `None` if there is
    /// none.
    pub fn contact_gap(&self) -> Option<f64> {
        let law = self.static_law();
        let outside = (0..law.branches()).filter(|branch| !law.touches(*branch));
        let exits = outside.flat_map(|branch| law.exits(branch));
        let mut inwards = exits.filter(|exit| law.touches(exit.target));
        inwards.find_map(|exit| match exit.guard {
            Guard::Falls(level) => Some(level),
            _ => None,
        })
    }

    /// Returns the limits of the law that a motion with the smallest gap `least_gap`, in units of
    /// g₀, violates.
    pub fn remarks(&self, least_gap: f64) -> Vec<Remark> {
        self.system.law().remarks(least_gap)
    }

    /// Converts an output of the model, with `force` times the sample's force added.
    pub fn output(&self, output: &Output, force: f64) -> nanotap_volterra::Output {
        let n = self.system.dimension();
        nanotap_volterra::Output {
            row: output.row.columns(0, n).into_owned(),
            offset: output.constant,
            tones: output.tones.clone(),
            force,
        }
    }
}

/// The branch of the law after the lever's part of a state.
fn remembered(memory: &[f64]) -> Option<usize> {
    memory
        .first()
        .map(|branch| branch.round().max(0.0) as usize)
}

/// An equilibrium of the lever without a drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Equilibrium {
    /// Gap between tip and sample, in units of g₀.
    pub gap: f64,
    /// Tip deflection, in units of g₀.
    pub deflection: f64,
    /// Force of the sample on the tip, in the model's unit.
    pub force: f64,
    /// Whether tip and sample touch.
    pub contact: bool,
    /// Whether it is stable: the lever is stiffer than the attraction.
    pub stable: bool,
    /// The branch of the law.
    #[serde(skip)]
    pub branch: usize,
}

/// Number of intervals, on either side of the gap at which contact begins, in which an equilibrium
/// is looked for on each branch of the law.
const EQUILIBRIUM_POINTS: i32 = 600;

impl Nonlinear {
    /// The equilibria of the undriven lever, those with the tip farthest away first: zeros of
    /// `d − d₀ − c F(d)`, with the lever's static compliance `c`, in front of the
    /// [wall](ForceLaw::wall) of the law.
    pub fn equilibria(&self) -> Vec<Equilibrium> {
        let law = self.static_law();
        let (rest, compliance) = (self.system.drive().offset, self.compliance());
        let tip = rest.abs();
        let mut found: Vec<Equilibrium> = Vec::new();
        // From where contact begins outwards and inwards, ever farther.
        let contact = self.contact_gap().unwrap_or(0.0);
        let reach = 10.0 * (tip + contact.abs());
        let ladder = |k: i32| {
            reach * nanotap_arithmetic::powf(1e-9, f64::from(k) / f64::from(EQUILIBRIUM_POINTS))
        };
        let wall = law.wall().unwrap_or(f64::NEG_INFINITY);
        let steps: Vec<f64> = (0..=EQUILIBRIUM_POINTS).map(ladder).collect();
        let inwards = steps.iter().rev().map(|step| contact - step);
        let points: Vec<f64> = steps
            .iter()
            .map(|step| contact + step)
            .chain(inwards)
            .collect();
        for branch in 0..law.branches() {
            // None is behind the wall of the law.
            let (mut low, mut high) = (wall, f64::INFINITY);
            for exit in law.exits(branch) {
                match exit.guard {
                    Guard::Falls(level) => low = low.max(level),
                    Guard::Rises(level) => high = high.min(level),
                    Guard::Turns | Guard::Own(_) => {}
                }
            }
            let excess = |gap: f64| gap - rest - compliance * law.force(branch, gap, 0.0).value;
            // The points fall.
            let first = points.partition_point(|gap| *gap > high);
            let end = points.partition_point(|gap| *gap >= low).max(first);
            let mut gaps = points[first..end].to_vec();
            gaps.extend([low, high].into_iter().filter(|end| end.is_finite()));
            gaps.sort_by(|a, b| b.total_cmp(a));
            for pair in gaps.windows(2) {
                let (mut a, mut b) = (pair[0], pair[1]);
                let (fa, fb) = (excess(a), excess(b));
                if !(fa * fb < 0.0 || fb == 0.0 && fa != 0.0) {
                    continue;
                }
                for _ in 0..200 {
                    let middle = 0.5 * (a + b);
                    if middle >= a.max(b) || middle <= a.min(b) {
                        break;
                    }
                    if excess(middle) * fa > 0.0 {
                        a = middle;
                    } else {
                        b = middle;
                    }
                }
                // At a pole of the force the sign changes, too, but there the excess grows.
                let finite = [fa, fb].into_iter().filter(|value| value.is_finite());
                let scale = finite.fold(0.0, |most: f64, value| most.max(value.abs()));
                let left = excess(b).abs();
                if left.is_nan() || left > scale {
                    continue;
                }
                let force = law.force(branch, b, 0.0);
                found.push(Equilibrium {
                    gap: b,
                    deflection: b - rest,
                    force: force.value,
                    contact: law.touches(branch),
                    stable: compliance * force.by_gap < 1.0,
                    branch,
                });
            }
        }
        found.sort_by(|a, b| b.gap.total_cmp(&a.gap));
        found.dedup_by(|a, b| (a.gap - b.gap).abs() <= 1e-12 * tip && a.contact == b.contact);
        found
    }

    /// Returns the static deflection of the tip per force at the tip, in units of L³/(EI).
    fn compliance(&self) -> f64 {
        let kernel = self.system.kernel();
        let modes = kernel.modes();
        let source = modes.left() * kernel.column();
        let readout = kernel.row() * modes.right();
        let blocks = modes.blocks().iter();
        blocks
            .map(|block| {
                let s = block.start;
                if block.size == 1 {
                    return -readout[s] * source[s] / block.matrix[0][0];
                }
                let [[a, b], [c, d]] = block.matrix;
                let determinant = a * d - b * c;
                let x = (d * source[s] - b * source[s + 1]) / determinant;
                let y = (a * source[s + 1] - c * source[s]) / determinant;
                -(readout[s] * x + readout[s + 1] * y)
            })
            .sum()
    }

    /// Returns `[gap, force]` at each of these gaps, in units of g₀ and EI g₀/L³, evaluated
    /// quasi-statically, in this order.
    pub fn force_curve(&self, gaps: impl IntoIterator<Item = f64>) -> Vec<[f64; 2]> {
        let law = self.static_law();
        let mut last: Option<(f64, usize)> = None;
        let mut curve = Vec::new();
        for gap in gaps {
            let mut branch = match last {
                None => law.branch_at(gap, -1.0),
                Some((_, branch)) => branch,
            };
            // At most every branch is passed on the way.
            for _ in 0..law.branches() {
                let rises = last.is_some_and(|(before, _)| gap > before);
                let exit = law.exits(branch).into_iter().find(|exit| match exit.guard {
                    Guard::Falls(level) => gap < level,
                    Guard::Rises(level) => gap > level,
                    Guard::Turns => rises,
                    Guard::Own(index) => law.guard(index, gap, 0.0).value < 0.0,
                });
                let Some(exit) = exit else { break };
                branch = exit.target;
            }
            curve.push([gap, law.force(branch, gap, 0.0).value]);
            last = Some((gap, branch));
        }
        curve
    }

    /// Returns the pieces of a quasi-static motion of the gap, in units of g₀, from the first of
    /// these values to the next and so on: on each the law is on one branch, and smooth.
    pub fn sweep(&self, gaps: &[f64]) -> Vec<SweepPiece> {
        let law = self.static_law();
        let mut pieces = Vec::new();
        let Some(first) = gaps.first() else {
            return pieces;
        };
        let mut branch = law.branch_at(*first, -1.0);
        for pair in gaps.windows(2) {
            let (mut from, to) = (pair[0], pair[1]);
            let rises = to > from;
            // At most every branch is passed on the way.
            for _ in 0..=law.branches() {
                let exits = law.exits(branch).into_iter().filter_map(|exit| {
                    let at = match exit.guard {
                        Guard::Falls(level) => (!rises && level > to).then(|| level.min(from)),
                        Guard::Rises(level) => (rises && level < to).then(|| level.max(from)),
                        Guard::Turns => rises.then_some(from),
                        Guard::Own(index) => first_negative(&**law, index, [from, to]),
                    };
                    Some((at?, exit.target))
                });
                let away = |exit: &(f64, usize)| (exit.0 - from).abs();
                let Some((at, target)) = exits.min_by(|a, b| away(a).total_cmp(&away(b))) else {
                    break;
                };
                if at != from {
                    pieces.push(SweepPiece {
                        branch,
                        gaps: [from, at],
                    });
                }
                (from, branch) = (at, target);
            }
            pieces.push(SweepPiece {
                branch,
                gaps: [from, to],
            });
        }
        pieces
    }
}

/// A piece of a quasi-static motion of the gap on one branch of the law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepPiece {
    /// Number of the branch.
    pub branch: usize,
    /// Gaps at which it begins and ends, in units of g₀.
    pub gaps: [f64; 2],
}

/// Number of gaps between two at which a law's own guard is evaluated.
const GUARD_POINTS: u32 = 400;

/// Returns the first gap between two at which a law's own guard is negative at rest.
fn first_negative(law: &dyn ForceLaw, index: usize, [from, to]: [f64; 2]) -> Option<f64> {
    let value = |gap: f64| law.guard(index, gap, 0.0).value;
    let at = |k: u32| from + (to - from) * f64::from(k) / f64::from(GUARD_POINTS);
    let k = (0..=GUARD_POINTS).find(|k| value(at(*k)) < 0.0)?;
    let Some(before) = k.checked_sub(1) else {
        return Some(from);
    };
    let (mut inside, mut outside) = (at(before), at(k));
    for _ in 0..200 {
        let middle = 0.5 * (inside + outside);
        if middle == inside || middle == outside {
            break;
        }
        if value(middle) < 0.0 {
            outside = middle;
        } else {
            inside = middle;
        }
    }
    Some(outside)
}

/// Largest number of cached kernels: a study builds many models on the same lever.
const KEPT: usize = 16;

/// The bits of the numbers from which a kernel is computed.
type KernelKey = Vec<u64>;

/// Returns the kernel of the beam's modes, from the cache if it is there: it depends on neither
/// drive nor law.
fn kernel(
    free: &Regime,
    row: &RowDVector<f64>,
    kick: &DVector<f64>,
) -> Result<Arc<Kernel>, VolterraError> {
    static KNOWN: Mutex<VecDeque<(KernelKey, Arc<Kernel>)>> = Mutex::new(VecDeque::new());
    let values = free.matrix().iter().chain(row.iter()).chain(kick.iter());
    let key: KernelKey = values.map(|v| v.to_bits()).collect();
    let known = || KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, kernel)) = known().iter().find(|(other, _)| *other == key) {
        return Ok(Arc::clone(kernel));
    }
    let basis = free.basis();
    let modes = if basis.clusters.is_empty() {
        Modes::from_eigenpairs(&basis.eigenvalues, &basis.right, &basis.left)?
    } else {
        Modes::from_matrix(free.matrix())?
    };
    let slowest = modes
        .blocks()
        .iter()
        .map(nanotap_volterra::modes::Block::rate)
        .filter(|rate| *rate > 0.0)
        .fold(f64::INFINITY, f64::min);
    let longest = if slowest.is_finite() {
        0.25 * TAU / slowest
    } else {
        1.0
    };
    let kernel = Kernel::new(modes, row.clone(), kick.clone(), longest, NODES)?;
    let mut known = known();
    if known.len() >= KEPT {
        known.pop_front();
    }
    known.push_back((key, Arc::clone(&kernel)));
    Ok(kernel)
}

/// Derivative of the map with respect to a number of the case.
#[derive(Clone, Debug)]
pub enum Variation {
    /// Through drive, distance and law: from the equations, linearised.
    Linearised {
        /// Change of drive, distance and law.
        change: Change,
        /// Derivative of ln T, where T is the drive period.
        log_period: f64,
    },
    /// Through the modes of lever or surface: from the maps on both sides.
    Differences {
        /// Map at the smaller number.
        low: Arc<Nonlinear>,
        /// Map at the larger number.
        high: Arc<Nonlinear>,
        /// Difference of the numbers.
        width: f64,
    },
}

/// Step of central differences between maps, relative to the number: their error is of the order of
/// its square.
const STEP: f64 = 1e-5;
/// Smallest size that the step of a number is relative to, for numbers that may be zero.
const SMALLEST: f64 = 1e-3;

impl Variation {
    /// Computes the derivative along `slopes` of the case's numbers and `law` of its law's
    /// parameters (empty: none).
    pub(crate) fn along(
        case: &Cantilever,
        model: &Model,
        nonlinear: &Nonlinear,
        slopes: &[(Parameter, f64)],
        law: &[f64],
    ) -> Result<Self, ModelError> {
        let of_modes = |p: Parameter| {
            matches!(p, Parameter::Alpha1 | Parameter::Alpha3)
                || Parameter::MEASURED.contains(&p)
                || Parameter::Q_CONTROL.contains(&p)
        };
        if slopes
            .iter()
            .any(|(p, slope)| of_modes(*p) && *slope != 0.0)
            || nonlinear.system.law().surface().is_some() && law.iter().any(|slope| *slope != 0.0)
        {
            return Self::between(case, nonlinear.system.cancel(), slopes, law);
        }
        let galerkin = Galerkin::new(case)?;
        let drive = model.system.drive();
        let beam = Beam::new(&galerkin, drive, 0)?;
        let n = nonlinear.system.dimension();
        let still = law.iter().all(|slope| *slope == 0.0);
        let mut change = Change {
            law: if still { Vec::new() } else { law.to_vec() },
            constant: vec![0.0; n],
            tones: drive
                .frequencies()
                .iter()
                .map(|_| ToneChange {
                    forcing: vec![nanotap_flow::Complex::new(0.0, 0.0); n],
                    ..ToneChange::default()
                })
                .collect(),
            ..Change::default()
        };
        let mut log_period = 0.0;
        for &(parameter, slope) in slopes {
            add(&mut change, &beam.derivative(parameter), slope);
            if parameter == Parameter::Omega {
                log_period -= slope / case.omega;
                for (tone, frequency) in change.tones.iter_mut().zip(drive.frequencies()) {
                    tone.frequency += slope * frequency / case.omega;
                }
            }
        }
        Ok(Self::Linearised { change, log_period })
    }

    fn between(
        case: &Cantilever,
        cancel: &CancelFlag,
        slopes: &[(Parameter, f64)],
        law: &[f64],
    ) -> Result<Self, ModelError> {
        // No number moves by more than a small part of itself.
        let parts = slopes.iter();
        let parts = parts.map(|(p, slope)| (case.get(*p).abs().max(SMALLEST), *slope));
        let values = case.law.iter().flat_map(|law| law.values().iter().copied());
        // Numbers of a law have the sizes of their units.
        let sizes = values.map(|value| if value == 0.0 { SMALLEST } else { value.abs() });
        let parts = parts.chain(sizes.zip(law.iter().copied()));
        let step = parts
            .filter(|(_, slope)| *slope != 0.0)
            .map(|(size, slope)| STEP * size / slope.abs())
            .filter(|step| step.is_finite())
            .fold(f64::INFINITY, f64::min);
        let at = |side: f64| {
            let mut moved = case.clone();
            for &(parameter, slope) in slopes {
                moved = moved
                    .clone()
                    .with(parameter, case.get(parameter) + side * step * slope);
            }
            if !law.is_empty() {
                moved.law = moved.law.map(|own| own.moved(law, side * step));
            }
            Ok(Model::cantilever(&moved)?.cancelled_by(cancel))
        };
        let (low, high, width) = match (at(-1.0), at(1.0)) {
            (Ok(low), Ok(high)) => (low, high, 2.0 * step),
            (Err(_), Ok(high)) => (at(0.0)?, high, step),
            (Ok(low), Err(_)) => (low, at(0.0)?, step),
            (Err(error), Err(_)) => return Err(error),
        };
        match (low.nonlinear, high.nonlinear) {
            (Some(low), Some(high)) => Ok(Self::Differences { low, high, width }),
            // A case without a law has no such map.
            _ => Ok(Self::none()),
        }
    }

    /// Returns a variation that changes nothing.
    pub(crate) fn none() -> Self {
        Self::Linearised {
            change: Change::default(),
            log_period: 0.0,
        }
    }
}

/// Adds `slope` times the derivative of the beam's forcing and gap.
fn add(change: &mut Change, of: &BeamTangent, slope: f64) {
    let (forcing, height) = (of.forcing(), of.height());
    change.offset += slope * height.constant;
    for (sum, value) in change.constant.iter_mut().zip(forcing.constant.iter()) {
        *sum += slope * value;
    }
    for (k, tone) in change.tones.iter_mut().enumerate() {
        tone.gap += height.tones[k] * slope;
        for (sum, value) in tone.forcing.iter_mut().zip(forcing.tones[k].iter()) {
            *sum += value * slope;
        }
    }
}

/// The map of a lever under a nonlinear force.
#[derive(Clone, Debug)]
pub(crate) struct NonlinearMap {
    nonlinear: Arc<Nonlinear>,
    flow: Flow,
    variations: Arc<[Variation]>,
}

impl NonlinearMap {
    pub(crate) fn new(nonlinear: &Arc<Nonlinear>, variations: Vec<Variation>) -> Self {
        Self {
            nonlinear: Arc::clone(nonlinear),
            flow: Flow::new(Arc::clone(&nonlinear.system)),
            variations: variations.into(),
        }
    }

    /// Advances with the Jacobian and, if wanted, the derivatives by the parameters.
    fn follow(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivatives: Option<&mut DMatrix<f64>>,
    ) -> Result<(), MotionError> {
        let (n, whole) = (
            self.nonlinear.system.dimension(),
            self.nonlinear.dimension(),
        );
        let start = state.to_vec();
        let varied = derivatives.is_some();
        let changes: Vec<Change> = self
            .variations
            .iter()
            .filter(|_| varied)
            .map(|variation| match variation {
                Variation::Linearised { change, .. } => change.clone(),
                Variation::Differences { .. } => Change::default(),
            })
            .collect();
        let period = self.nonlinear.period;
        let (mut own, mut columns) = (DMatrix::zeros(n, n), DMatrix::zeros(n, changes.len()));
        self.nonlinear.start(&mut self.flow, state)?;
        self.flow
            .run_with_derivatives(period, &changes, &mut own, &mut columns)?;
        self.nonlinear.end(&self.flow, state);
        *jacobian = own.resize(whole, whole, 0.0);
        let Some(derivatives) = derivatives else {
            return Ok(());
        };
        let mut field = vec![0.0; n];
        let branch = self.flow.branch();
        self.nonlinear
            .system
            .field(period, &state[..n], branch, &mut field);
        for (k, variation) in self.variations.iter().enumerate() {
            let mut column = columns.column_mut(k);
            match variation {
                // The end of the period moves too.
                Variation::Linearised { log_period, .. } => {
                    column.axpy(period * log_period, &DVector::from_vec(field.clone()), 1.0);
                }
                Variation::Differences { low, high, width } => {
                    let end = |side: &Arc<Nonlinear>| {
                        let mut state = start.clone();
                        Self::new(side, Vec::new()).advance_by(&mut state, 1)?;
                        Ok::<_, MotionError>(state)
                    };
                    let (low, high) = (end(low)?, end(high)?);
                    for i in 0..n {
                        column[i] = (high[i] - low[i]) / width;
                    }
                }
            }
        }
        *derivatives = columns.resize(whole, self.variations.len(), 0.0);
        Ok(())
    }
}

impl EngineMap for NonlinearMap {
    fn boxed(&self) -> Box<dyn EngineMap> {
        Box::new(self.clone())
    }

    fn dimension(&self) -> usize {
        self.nonlinear.dimension()
    }

    fn period(&self) -> f64 {
        self.nonlinear.period
    }

    fn move_gap(&mut self, gap: f64, _: &mut dyn FnMut(&mut f64)) -> Result<(), MotionError> {
        Arc::make_mut(&mut self.nonlinear).set_gap(gap)?;
        Ok(self.flow.system_mut().set_offset(gap)?)
    }

    fn evaluations(&self) -> u64 {
        self.flow.statistics().evaluations
    }

    fn cost(&self) -> u64 {
        self.flow.cost()
    }

    fn add_cost(&mut self, cost: u64) {
        self.flow.add_cost(cost);
    }

    fn discrete_entries(&self) -> usize {
        self.nonlinear.discrete_entries()
    }

    fn is_costly(&self) -> bool {
        true
    }

    /// Returns the map computed by the Runge–Kutta method of [`nanotap_volterra::coarse`].
    fn coarse(&self) -> Option<Box<dyn EngineMap>> {
        // None of a surface that relaxes.
        Some(Box::new(CoarseMap {
            coarse: Coarse::new(&self.nonlinear.system, self.nonlinear.period).ok()?,
            exact: Self::new(&self.nonlinear, Vec::new()),
            nonlinear: Arc::clone(&self.nonlinear),
        }))
    }

    fn advance_by(&mut self, state: &mut [f64], periods: usize) -> Result<(), MotionError> {
        for _ in 0..periods {
            self.nonlinear.start(&mut self.flow, state)?;
            self.flow.run_until(self.nonlinear.period)?;
            self.nonlinear.end(&self.flow, state);
        }
        Ok(())
    }

    fn advance_between(
        &mut self,
        state: &mut [f64],
        [from, to]: [f64; 2],
    ) -> Result<(), MotionError> {
        self.nonlinear.resume(&mut self.flow, state, from)?;
        self.flow.run_until(to)?;
        self.nonlinear.end(&self.flow, state);
        Ok(())
    }

    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), MotionError> {
        self.follow(state, jacobian, None)
    }

    fn advance_with_derivatives(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivatives: &mut DMatrix<f64>,
    ) -> Result<(), MotionError> {
        self.follow(state, jacobian, Some(derivatives))
    }

    fn log_determinant_bound(&self) -> f64 {
        self.nonlinear.log_determinant_bound()
    }

    fn advance_with_tangencies(
        &mut self,
        state: &mut [f64],
        tangencies: &mut Vec<Tangency>,
    ) -> Result<(), MotionError> {
        self.nonlinear.start(&mut self.flow, state)?;
        let period = self.flow.record_until(self.nonlinear.period)?;
        self.nonlinear.end(&self.flow, state);
        let contact = self.nonlinear.contact_gap();
        let extrema = grazed(&self.nonlinear.system, &period, contact).into_iter();
        tangencies.extend(extrema.map(|(time, value)| Tangency {
            phase: time / self.nonlinear.period,
            value,
        }));
        Ok(())
    }
}

/// The approximate map of a lever under a nonlinear force, for transients. A period that the
/// approximate flow cannot follow is computed by the exact one, so that nothing is reported of a
/// failure of the approximation.
#[derive(Clone, Debug)]
struct CoarseMap {
    nonlinear: Arc<Nonlinear>,
    coarse: Coarse,
    exact: NonlinearMap,
}

impl CoarseMap {
    /// Replaces `state` by its image under the approximate map `coarse`, or else under the exact one.
    fn try_period(
        &mut self,
        state: &mut [f64],
        coarse: impl FnOnce(&mut Self, &mut [f64]) -> Result<(), MotionError>,
        exact: impl FnOnce(&mut NonlinearMap, &mut [f64]) -> Result<(), MotionError>,
    ) -> Result<(), MotionError> {
        let start = state.to_vec();
        let result = coarse(self, state);
        if result.is_ok() || self.nonlinear.system.cancel().is_cancelled() {
            return result;
        }
        state.copy_from_slice(&start);
        exact(&mut self.exact, state)
    }
}

impl EngineMap for CoarseMap {
    fn boxed(&self) -> Box<dyn EngineMap> {
        Box::new(self.clone())
    }

    fn dimension(&self) -> usize {
        self.nonlinear.dimension()
    }

    fn period(&self) -> f64 {
        self.nonlinear.period
    }

    fn move_gap(&mut self, gap: f64, _: &mut dyn FnMut(&mut f64)) -> Result<(), MotionError> {
        Arc::make_mut(&mut self.nonlinear).set_gap(gap)?;
        self.coarse = Coarse::new(&self.nonlinear.system, self.nonlinear.period)?;
        self.exact.move_gap(gap, &mut |_| {})
    }

    fn evaluations(&self) -> u64 {
        self.coarse.statistics().evaluations + self.exact.evaluations()
    }

    fn cost(&self) -> u64 {
        self.coarse.cost() + self.exact.cost()
    }

    fn discrete_entries(&self) -> usize {
        self.nonlinear.discrete_entries()
    }

    fn advance_by(&mut self, state: &mut [f64], periods: usize) -> Result<(), MotionError> {
        for _ in 0..periods {
            self.try_period(
                state,
                |map, state| {
                    let (lever, memory) = map.nonlinear.split(state)?;
                    let branch = remembered(memory);
                    let reached = map.coarse.run_periods(lever, branch, 1)?;
                    memory.fill(reached as f64);
                    Ok(())
                },
                |map, state| map.advance_by(state, 1),
            )?;
        }
        Ok(())
    }

    fn advance_between(&mut self, state: &mut [f64], span: [f64; 2]) -> Result<(), MotionError> {
        self.exact.advance_between(state, span)
    }

    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), MotionError> {
        let (n, whole) = (self.nonlinear.system.dimension(), state.len());
        let mut by_exact = DMatrix::zeros(0, 0);
        self.try_period(
            state,
            |map, state| {
                let (lever, memory) = map.nonlinear.split(state)?;
                let mut own = DMatrix::zeros(n, n);
                let branch = remembered(memory);
                let reached = map.coarse.run_with_jacobian(lever, branch, &mut own)?;
                memory.fill(reached as f64);
                *jacobian = own.resize(whole, whole, 0.0);
                Ok(())
            },
            |map, state| map.advance_with_jacobian(state, &mut by_exact),
        )?;
        if by_exact.nrows() > 0 {
            *jacobian = by_exact;
        }
        Ok(())
    }

    fn log_determinant_bound(&self) -> f64 {
        self.nonlinear.log_determinant_bound()
    }
}

impl Nonlinear {
    /// Splits a state of the model into the lever's part and the rest: the branch, where it is
    /// remembered.
    fn split<'a>(
        &self,
        state: &'a mut [f64],
    ) -> Result<(&'a mut [f64], &'a mut [f64]), VolterraError> {
        self.check_length(state)?;
        Ok(state.split_at_mut(self.system.dimension()))
    }

    fn check_length(&self, state: &[f64]) -> Result<(), VolterraError> {
        let (found, expected) = (state.len(), self.dimension());
        if found == expected {
            return Ok(());
        }
        Err(VolterraError::Shape {
            what: "the state",
            found,
            expected,
        })
    }

    /// log|det DP| of the lever's state where every motion has the same: a force that depends
    /// on the gap alone has no part in the trace, nor in the determinant of a switch at a gap.
    pub(crate) fn constant_log_determinant(&self) -> Option<f64> {
        let law = self.system.law();
        let turns = (0..law.branches())
            .flat_map(|branch| self.system.exits(branch))
            .any(|exit| exit.guard == Guard::Turns);
        let varies = law.depends_on_rate() && !law.takes_signal() || turns;
        (!varies).then(|| self.free_log_determinant())
    }

    /// log|det DP| where it is the same everywhere, else infinite; a law that remembers loses a
    /// direction.
    fn log_determinant_bound(&self) -> f64 {
        let known = self.constant_log_determinant();
        known.filter(|_| !self.remembers).unwrap_or(f64::INFINITY)
    }

    /// Computes log|det DP| of the lever's state over a recorded period, from the trace of the
    /// equations and the jumps of the force at turning points.
    pub fn log_determinant(&self, period: &Trajectory) -> f64 {
        if let Some(known) = self.constant_log_determinant() {
            return known;
        }
        let law = self.system.law();
        let kernel = self.system.kernel();
        let (row, column, surface) = (kernel.row(), kernel.column(), kernel.surface());
        let n = (self.system.dimension() - surface) / 2;
        // Of the force onto the law's second argument: the gap's rate, or a surface that it presses.
        let onto: f64 = if surface == 0 {
            (0..n).map(|j| row[j] * column[n + j]).sum()
        } else {
            column.rows(2 * n, surface).sum()
        };
        let by_rate = period.integrate(1, |s, out| {
            let second = self
                .system
                .second_argument(s.time, s.rate, s.state.as_slice());
            let acts = surface == 0 || self.system.presses(s.branch);
            let slope = law.force(s.branch, s.gap, second).by_rate;
            out[0] = if acts { slope } else { 0.0 };
        });
        let turns = period
            .switches()
            .iter()
            .filter(|switch| self.system.exits(switch.from)[switch.exit].guard == Guard::Turns);
        // The saltation matrix there has the ratio of the gap's accelerations as determinant.
        let jumps = turns.filter_map(|switch| {
            let sample = period.at(switch.time)?;
            let acceleration = |branch: usize| {
                let mut field = vec![0.0; 2 * n];
                let state = sample.state.as_slice();
                self.system.field(switch.time, state, branch, &mut field);
                let own: f64 = (0..n).map(|j| row[j] * field[n + j]).sum();
                let tones = self.system.drive().tones.iter();
                let forced = tones.map(|tone| {
                    let (sin, cos) = nanotap_arithmetic::sin_cos(tone.frequency * switch.time);
                    -tone.frequency.powi(2) * (tone.gap.re * cos - tone.gap.im * sin)
                });
                own + forced.sum::<f64>()
            };
            Some(nanotap_arithmetic::ln(
                (acceleration(switch.to) / acceleration(switch.from)).abs(),
            ))
        });
        self.free_log_determinant() + onto * by_rate[0] + jumps.sum::<f64>()
    }

    /// log|det DP| of the lever without a sample.
    fn free_log_determinant(&self) -> f64 {
        let blocks = self.system.kernel().modes().blocks().iter();
        let trace: f64 = blocks
            .map(|block| {
                if block.size == 1 {
                    block.matrix[0][0]
                } else {
                    block.matrix[0][0] + block.matrix[1][1]
                }
            })
            .sum();
        trace * self.period
    }
}
