//! The interface between a force law and the flow: branches, on each of which the force is an
//! analytic function of the gap and its rate, and exits between them.

use std::fmt::Debug;
use std::sync::Arc;

/// A force or a guard with its derivatives by the gap and by the gap's rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Force {
    /// Value of the force, in the unit of force (repulsion is positive), or of a guard, in the unit
    /// of the guard.
    pub value: f64,
    /// Derivative by the gap, in units of the value per unit of the gap.
    pub by_gap: f64,
    /// Derivative by the gap's rate, or by the second argument that replaces the rate.
    pub by_rate: f64,
}

/// The condition under which a branch is left. A guard is positive inside its branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Guard {
    /// The gap falls to this value.
    Falls(f64),
    /// The gap rises to this value.
    Rises(f64),
    /// The gap stops falling: its rate rises to zero.
    Turns,
    /// The guard of this number in [`ForceLaw::guard`] falls to zero.
    Own(usize),
}

/// The behaviour of the force near a switch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Approach {
    /// The force is analytic up to the switch and beyond.
    Analytic,
    /// The force behaves like a power 3/2 of the distance from the switch: it is analytic in the
    /// square root of time, and its derivative by the gap stays finite.
    ThreeHalves,
    /// The force behaves like a power 1/2: its derivative by the gap is infinite at the switch.
    Half,
}

/// An exit from a branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exit {
    /// Condition under which the branch is left.
    pub guard: Guard,
    /// Number of the branch that is entered.
    pub target: usize,
    /// Behaviour of the force of the branch that is left, up to the switch. Only switches at a
    /// value of the gap may be other than analytic.
    pub before: Approach,
    /// Behaviour of the force of the branch that is entered, from the switch on.
    pub after: Approach,
}

impl Exit {
    /// Creates a switch that is analytic on both sides.
    pub const fn new(guard: Guard, target: usize) -> Self {
        Self {
            guard,
            target,
            before: Approach::Analytic,
            after: Approach::Analytic,
        }
    }

    /// Sets the behaviour of the force before and after the switch.
    #[must_use]
    pub const fn with(mut self, before: Approach, after: Approach) -> Self {
        self.before = before;
        self.after = after;
        self
    }
}

/// A remark that a motion leaves the range for which a law was derived.
#[derive(Clone, Debug, PartialEq)]
pub struct Remark {
    /// Ratio that is out of range, as a formula: `δ/R`.
    pub ratio: &'static str,
    /// Largest value of the ratio along the motion, dimensionless.
    pub value: f64,
    /// Largest value of the ratio for which the law holds, dimensionless.
    pub limit: f64,
}

/// The surface of a sample that relaxes, as decaying coordinates `η̇ = −rate η + gain F_s` that the
/// tip's force `F_s` on the surface drives, in contact or at every gap. Their sum is the surface's
/// depth to the power of the contact law, and takes the place of the gap's rate in the law.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Rates at which the coordinates decay, positive, per unit of time; one per coordinate.
    pub rates: Vec<f64>,
    /// Growth rates of the coordinates under a unit force; one per coordinate.
    pub gains: Vec<f64>,
    /// Whether the force drives the surface at every gap, and not in contact alone.
    pub always: bool,
    /// Constant part of the force in contact that does not act on the surface, in the unit of
    /// force; negative for an attraction.
    pub adhesion: f64,
    /// Law of the completely relaxed surface.
    pub relaxed: Arc<dyn ForceLaw>,
}

/// A scalar force as a function of a gap and its rate; repulsion is positive.
pub trait ForceLaw: Debug + Send + Sync {
    /// Returns the names of the parameters by which the law can be differentiated.
    fn parameters(&self) -> Vec<&'static str>;

    /// Returns the number of branches, which are numbered from 0.
    fn branches(&self) -> usize;

    /// Returns the branch of a motion without a known history.
    fn branch_at(&self, gap: f64, rate: f64) -> usize;

    /// Returns the force on a branch, also slightly beyond the exit.
    fn force(&self, branch: usize, gap: f64, rate: f64) -> Force;

    /// Returns the force on a branch without its derivatives.
    fn value(&self, branch: usize, gap: f64, rate: f64) -> f64 {
        self.force(branch, gap, rate).value
    }

    /// Reports whether the force is a sum of several terms, so that a table over the gap is faster.
    fn has_terms(&self) -> bool {
        false
    }

    /// Returns the time of an evaluation, as a multiple of that of a force in closed form.
    fn cost(&self) -> u64 {
        1
    }

    /// Reports whether the force depends on the gap's rate.
    fn depends_on_rate(&self) -> bool {
        true
    }

    /// Reports whether the second argument of the force is the signal `cos ωt` of the system's
    /// second tone, or of its only one, instead of the gap's rate.
    fn takes_signal(&self) -> bool {
        false
    }

    /// Returns the law averaged over the signal; `None` for a law without one.
    fn averaged(&self) -> Option<Arc<dyn ForceLaw>> {
        None
    }

    /// Computes the force at the nodes of a step and its derivatives by gap and rate, as
    /// [`ForceLaw::force`] at each. All slices have the same length.
    fn forces(
        &self,
        branch: usize,
        gaps: &[f64],
        rates: &[f64],
        [values, by_gap, by_rate]: [&mut [f64]; 3],
    ) {
        for (i, (gap, rate)) in gaps.iter().zip(rates).enumerate() {
            let force = self.force(branch, *gap, *rate);
            values[i] = force.value;
            by_gap[i] = force.by_gap;
            by_rate[i] = force.by_rate;
        }
    }

    /// Returns the exits of a branch.
    fn exits(&self, branch: usize) -> Vec<Exit>;

    /// Returns the gap at and behind which the law does not hold, in the unit of the gap: the
    /// largest pole of the force on a branch that reaches it, or the first row of a table. `None`
    /// if it holds at every gap.
    fn wall(&self) -> Option<f64> {
        self.pole()
    }

    /// Returns the gap of the largest pole of the force on a branch that reaches it: no motion
    /// passes it. A table has none, since it goes straight on below its first row.
    fn pole(&self) -> Option<f64> {
        None
    }

    /// Returns the law's own guard number `index`.
    fn guard(&self, index: usize, gap: f64, rate: f64) -> Force {
        let _ = (index, gap, rate);
        Force::default()
    }

    /// Writes the derivatives of the force by the parameters to `out`.
    fn by_parameters(&self, branch: usize, gap: f64, rate: f64, out: &mut [f64]);

    /// Writes the derivatives of a guard (positive inside the branch) by the parameters, at the
    /// switch, to `out`.
    fn guard_by_parameters(&self, branch: usize, exit: usize, gap: f64, rate: f64, out: &mut [f64]);

    /// Returns the energy stored at this gap, up to a constant of the law; `None` for a law without a
    /// potential. The energy is zero far away, or, of a formula, at a gap of the law's own.
    fn energy(&self, branch: usize, gap: f64) -> Option<f64> {
        let _ = (branch, gap);
        None
    }

    /// Reports whether tip and sample touch on a branch: for most laws, on all but the first.
    fn touches(&self, branch: usize) -> bool {
        branch > 0
    }

    /// Returns the surface, if it relaxes: the second argument of force and guards is then its
    /// depth to the power of the contact law, instead of the gap's rate.
    fn surface(&self) -> Option<&Surface> {
        None
    }

    /// Returns the law with an attraction across the gap to its moving surface; `None` if the law
    /// has no such surface or cannot take this attraction.
    fn with_attraction(&self, law: &Arc<dyn ForceLaw>) -> Option<Arc<dyn ForceLaw>> {
        let _ = law;
        None
    }

    /// Reports whether the branches are pieces of one smooth curve, each of little use beyond its
    /// ends.
    fn is_piecewise(&self) -> bool {
        false
    }

    /// Reports whether the law has a memory: gap and rate do not determine the branch.
    fn remembers(&self) -> bool {
        false
    }

    /// Reports whether the force on a branch is zero at any gap.
    fn vanishes(&self, branch: usize) -> bool {
        let _ = branch;
        false
    }

    /// Reports whether the force depends on the gap alone.
    fn conservative(&self) -> bool {
        false
    }

    /// Returns the ranges of validity that a motion with the least gap `least_gap` leaves.
    fn remarks(&self, least_gap: f64) -> Vec<Remark> {
        let _ = least_gap;
        Vec::new()
    }
}
