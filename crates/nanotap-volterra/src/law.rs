//! What a force law is to the flow: branches, on each of which the force is an analytic
//! function of the gap and its rate, and exits between them.

use std::fmt::Debug;
use std::sync::Arc;

/// A value with its derivatives by the gap and by the gap's rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Force {
    /// The value.
    pub value: f64,
    /// By the gap.
    pub by_gap: f64,
    /// By the gap's rate.
    pub by_rate: f64,
}

/// When a branch is left. A guard is positive inside its branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Guard {
    /// When the gap falls to this value.
    Falls(f64),
    /// When the gap rises to this value.
    Rises(f64),
    /// When the gap stops falling.
    Turns,
    /// When a quantity of the law's own, [`ForceLaw::guard`], falls to zero.
    Own(usize),
}

/// How the force comes up to a switch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Approach {
    /// Analytic up to the switch and beyond.
    Analytic,
    /// As a power 3/2 of the distance from the switch: twice the square root of time is the
    /// right variable, and the derivative of the force by the gap stays finite.
    ThreeHalves,
    /// As a power 1/2: the derivative of the force by the gap is infinite at the switch.
    Half,
}

/// A way out of a branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exit {
    /// When.
    pub guard: Guard,
    /// The branch after it.
    pub target: usize,
    /// How the force of the branch that is left comes up to the switch. Only switches at a
    /// value of the gap may be other than analytic.
    pub before: Approach,
    /// How the force of the target sets in.
    pub after: Approach,
}

impl Exit {
    /// A switch that is analytic on both sides.
    pub const fn new(guard: Guard, target: usize) -> Self {
        Self {
            guard,
            target,
            before: Approach::Analytic,
            after: Approach::Analytic,
        }
    }

    /// The same with the behaviour of the force before and after the switch.
    #[must_use]
    pub const fn with(mut self, before: Approach, after: Approach) -> Self {
        self.before = before;
        self.after = after;
        self
    }
}

/// Where a motion leaves the range for which a law was derived.
#[derive(Clone, Debug, PartialEq)]
pub struct Remark {
    /// What is out of range, as a formula: `δ/R`.
    pub ratio: &'static str,
    /// Its largest value.
    pub value: f64,
    /// The value up to which the law holds.
    pub limit: f64,
}

/// The surface of a sample that relaxes, as decaying coordinates `η̇ = −rate η + gain F_s` that the
/// tip's force `F_s` on the surface drives in contact. Their sum is the surface's depth to the
/// power of the contact law, and takes the place of the gap's rate in the law.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Rates of recovery.
    pub rates: Vec<f64>,
    /// Growth for a unit of force.
    pub gains: Vec<f64>,
    /// The constant part of the force in contact that does not act on the surface.
    pub adhesion: f64,
    /// The law of the surface at rest, when it has relaxed.
    pub relaxed: Arc<dyn ForceLaw>,
}

/// A scalar force of a gap and its rate, repulsive positive.
pub trait ForceLaw: Debug + Send + Sync {
    /// Names of the parameters that the law can be differentiated by.
    fn parameters(&self) -> Vec<&'static str>;

    /// Number of branches.
    fn branches(&self) -> usize;

    /// The branch of a motion whose history is not known.
    fn branch_at(&self, gap: f64, rate: f64) -> usize;

    /// The force on a branch, also a little beyond where it is left.
    fn force(&self, branch: usize, gap: f64, rate: f64) -> Force;

    /// The force on a branch without its derivatives.
    fn value(&self, branch: usize, gap: f64, rate: f64) -> f64 {
        self.force(branch, gap, rate).value
    }

    /// Whether the force is a sum of several, so that a table in the gap takes less time.
    fn has_terms(&self) -> bool {
        false
    }

    /// Time that an evaluation takes, in that of a force in closed form.
    fn cost(&self) -> u64 {
        1
    }

    /// Whether the force depends on the gap's rate.
    fn depends_on_rate(&self) -> bool {
        true
    }

    /// Whether the second argument of the force is the signal `cos ωt` of the system's second tone, or of its
    /// only one, in place of the gap's rate.
    fn takes_signal(&self) -> bool {
        false
    }

    /// The law averaged over the signal, of laws that take one.
    fn averaged(&self) -> Option<Arc<dyn ForceLaw>> {
        None
    }

    /// The force at the nodes of a step and its derivatives by gap and rate, as
    /// [`ForceLaw::force`] at each. All slices are of one length.
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

    /// The ways out of a branch.
    fn exits(&self, branch: usize) -> Vec<Exit>;

    /// The law's own guard number `index`.
    fn guard(&self, index: usize, gap: f64, rate: f64) -> Force {
        let _ = (index, gap, rate);
        Force::default()
    }

    /// The derivatives of the force by the parameters, written to `out`.
    fn by_parameters(&self, branch: usize, gap: f64, rate: f64, out: &mut [f64]);

    /// The derivatives by the parameters of a guard (positive inside the branch) at the
    /// switch, written to `out`.
    fn guard_by_parameters(&self, branch: usize, exit: usize, gap: f64, rate: f64, out: &mut [f64]);

    /// The energy stored at this gap, zero far away; none where the law has no potential.
    fn energy(&self, branch: usize, gap: f64) -> Option<f64> {
        let _ = (branch, gap);
        None
    }

    /// Whether tip and sample touch on a branch: of most laws all but the first.
    fn touches(&self, branch: usize) -> bool {
        branch > 0
    }

    /// The surface, if it relaxes: the second argument of force and guards is then its depth to the
    /// power of the contact law, in place of the gap's rate.
    fn surface(&self) -> Option<&Surface> {
        None
    }

    /// The same law with an attraction across the gap to its surface, if it can have one; of laws
    /// with a surface of their own.
    fn with_attraction(&self, law: &Arc<dyn ForceLaw>) -> Option<Arc<dyn ForceLaw>> {
        let _ = law;
        None
    }

    /// Whether branches are pieces of one smooth curve, each of little use beyond its ends.
    fn is_piecewise(&self) -> bool {
        false
    }

    /// Whether the law has a memory: gap and rate do not determine the branch.
    fn remembers(&self) -> bool {
        false
    }

    /// Whether the force on a branch is zero at any gap.
    fn vanishes(&self, branch: usize) -> bool {
        let _ = branch;
        false
    }

    /// Whether the force depends on the gap alone.
    fn conservative(&self) -> bool {
        false
    }

    /// What a motion that came as close as `least_gap` violates.
    fn remarks(&self, least_gap: f64) -> Vec<Remark> {
        let _ = least_gap;
        Vec::new()
    }
}
