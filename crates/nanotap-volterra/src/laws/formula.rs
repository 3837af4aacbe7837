//! A law written once for numbers with derivatives becomes a [`ForceLaw`].

// Only what is inlined into a function for wide registers gets their instructions.
#![allow(clippy::inline_always)]

use crate::law::{Approach, Exit, Force, ForceLaw, Guard, Remark};
use crate::laws::entry::Entry;
use crate::linear::wide_registers;
use nanotap_arithmetic::{Dual, Scalar};
use std::fmt::Debug;
use std::sync::Arc;

/// The condition under which a branch is left; levels of the gap are named by their index among the
/// constants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// The gap falls to this constant.
    Falls(usize),
    /// The gap rises to this constant.
    Rises(usize),
    /// The gap stops falling: its rate rises to zero.
    Turns,
    /// The guard of this number falls to zero.
    Own(usize),
}

/// An exit from a branch: condition, target, and the behaviour of the force on either side of the
/// switch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Way {
    /// Condition under which the branch is left.
    pub edge: Edge,
    /// Number of the branch that is entered.
    pub target: usize,
    /// Behaviour of the force of the branch that is left, up to the switch.
    pub before: Approach,
    /// Behaviour of the force of the branch that is entered, from the switch on.
    pub after: Approach,
}

impl Way {
    /// Creates a switch that is analytic on both sides.
    pub const fn new(edge: Edge, target: usize) -> Self {
        Self {
            edge,
            target,
            before: Approach::Analytic,
            after: Approach::Analytic,
        }
    }

    /// Sets the behaviour of the force of the branch that is left.
    #[must_use]
    pub const fn before(mut self, approach: Approach) -> Self {
        self.before = approach;
        self
    }

    /// Sets the behaviour of the force of the branch that is entered.
    #[must_use]
    pub const fn after(mut self, approach: Approach) -> Self {
        self.after = approach;
        self
    }
}

/// The formula of a law.
pub trait Formula: Clone + Debug + Send + Sync + 'static {
    /// Returns the entry in the table of laws, with the parameters in the order of `p`.
    fn entry(&self) -> &'static Entry;
    /// Computes the constants of the force from the parameters. The gaps at which branches end are
    /// among them.
    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S>;
    /// Returns the number of branches, which are numbered from 0.
    fn branches(&self) -> usize {
        2
    }
    /// Returns the branch of a motion without a known history.
    fn branch_at(&self, c: &[f64], gap: f64, rate: f64) -> usize {
        let _ = rate;
        usize::from(gap < c[0])
    }
    /// Returns the force on a branch, in the unit of force; repulsion is positive.
    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, rate: S) -> S;
    /// Returns the time of an evaluation, as a multiple of that of a force in closed form.
    fn cost(&self) -> u64 {
        1
    }
    /// Reports whether the force depends on the gap's rate.
    fn depends_on_rate(&self) -> bool {
        false
    }
    /// Reports whether a signal replaces the gap's rate; see [`ForceLaw::takes_signal`].
    fn takes_signal(&self) -> bool {
        false
    }
    /// Returns the law averaged over the signal; see [`ForceLaw::averaged`].
    fn averaged(&self, p: &[f64]) -> Option<Arc<dyn ForceLaw>> {
        let _ = p;
        None
    }
    /// Returns the exits of a branch.
    fn ways(&self, branch: usize) -> Vec<Way>;
    /// Returns the largest gap at which the force of a branch across the gap has a pole, also if
    /// the branch ends before it; see [`ForceLaw::pole`].
    fn pole(&self, c: &[f64]) -> Option<f64> {
        let _ = c;
        None
    }
    /// Returns the law's own guard number `index`.
    fn guard<S: Scalar>(&self, c: &[S], index: usize, gap: S, rate: S) -> S {
        let _ = (c, index, rate);
        gap
    }
    /// Returns the stored energy at a gap, if there is a potential; see [`ForceLaw::energy`].
    fn energy(&self, c: &[f64], branch: usize, gap: f64) -> Option<f64> {
        let _ = (c, branch, gap);
        None
    }
    /// Reports whether tip and sample touch on a branch; see [`ForceLaw::touches`].
    fn touches(&self, branch: usize) -> bool {
        branch > 0
    }
    /// Reports whether the law has a memory; see [`ForceLaw::remembers`].
    fn remembers(&self) -> bool {
        false
    }
    /// Reports whether the force on a branch is zero; see [`ForceLaw::vanishes`].
    fn vanishes(&self, branch: usize) -> bool {
        let _ = branch;
        false
    }
    /// Returns the ranges of validity that a motion leaves; see [`ForceLaw::remarks`].
    fn remarks(&self, p: &[f64], least_gap: f64) -> Vec<Remark> {
        let _ = (p, least_gap);
        Vec::new()
    }
}

/// A law: a formula with values of its parameters.
#[derive(Clone, Debug)]
pub struct Law<F: Formula> {
    formula: F,
    parameters: Vec<f64>,
    constants: Vec<f64>,
    lifted: Vec<Dual<2>>,
    /// The constants as numbers with one derivative, for laws that depend on the gap alone.
    lifted_gap: Vec<Dual<1>>,
    /// The constants with their derivatives by each parameter.
    varied: Vec<Vec<Dual<1>>>,
}

impl<F: Formula> Law<F> {
    /// Creates the law with these values of its parameters, in the order of its entry.
    pub(crate) fn new(formula: F, parameters: Vec<f64>) -> Self {
        let constants = formula.constants(&parameters);
        let varied = (0..parameters.len())
            .map(|k| {
                let p: Vec<Dual<1>> = parameters
                    .iter()
                    .enumerate()
                    .map(|(i, &v)| {
                        if i == k {
                            Dual::variable(v, 0)
                        } else {
                            Dual::constant(v)
                        }
                    })
                    .collect();
                formula.constants(&p)
            })
            .collect();
        Self {
            lifted_gap: constants.iter().map(|&c| Dual::constant(c)).collect(),
            lifted: constants.iter().map(|&c| Dual::constant(c)).collect(),
            formula,
            parameters,
            constants,
            varied,
        }
    }
}

fn force_of(d: Dual<2>) -> Force {
    Force {
        value: d.value,
        by_gap: d.slopes[0],
        by_rate: d.slopes[1],
    }
}

/// Evaluates [`ForceLaw::forces`] of a formula, compiled also for wide registers.
#[inline(always)]
fn forces_at<F: Formula>(
    law: &Law<F>,
    branch: usize,
    gaps: &[f64],
    rates: &[f64],
    [values, by_gap, by_rate]: [&mut [f64]; 3],
) {
    let n = gaps.len();
    let (values, by_gap) = (&mut values[..n], &mut by_gap[..n]);
    let (rates, by_rate) = (&rates[..n], &mut by_rate[..n]);
    let formula = &law.formula;
    if !formula.depends_on_rate() {
        by_rate.fill(0.0);
        let constants = &law.lifted_gap;
        let mut fill = |branch: usize| {
            for i in 0..n {
                let gap = Dual::variable(gaps[i], 0);
                let force = formula.force(constants, branch, gap, Dual::constant(0.0));
                values[i] = force.value;
                by_gap[i] = force.slopes[0];
            }
        };
        // A branch known to the compiler leaves no choice inside the loop.
        match branch {
            0 => fill(0),
            1 => fill(1),
            _ => fill(branch),
        }
        return;
    }
    for i in 0..n {
        let (gap, rate) = (Dual::variable(gaps[i], 0), Dual::variable(rates[i], 1));
        let force = formula.force(&law.lifted, branch, gap, rate);
        values[i] = force.value;
        by_gap[i] = force.slopes[0];
        by_rate[i] = force.slopes[1];
    }
}

impl<F: Formula> ForceLaw for Law<F> {
    fn parameters(&self) -> Vec<&'static str> {
        self.formula.entry().parameter_names()
    }

    fn branches(&self) -> usize {
        self.formula.branches()
    }

    fn branch_at(&self, gap: f64, rate: f64) -> usize {
        self.formula.branch_at(&self.constants, gap, rate)
    }

    fn force(&self, branch: usize, gap: f64, rate: f64) -> Force {
        force_of(self.formula.force(
            &self.lifted,
            branch,
            Dual::variable(gap, 0),
            Dual::variable(rate, 1),
        ))
    }

    fn value(&self, branch: usize, gap: f64, rate: f64) -> f64 {
        self.formula.force(&self.constants, branch, gap, rate)
    }

    fn cost(&self) -> u64 {
        self.formula.cost()
    }

    fn depends_on_rate(&self) -> bool {
        self.formula.depends_on_rate()
    }

    fn takes_signal(&self) -> bool {
        self.formula.takes_signal()
    }

    fn averaged(&self) -> Option<Arc<dyn ForceLaw>> {
        self.formula.averaged(&self.parameters)
    }

    fn forces(&self, branch: usize, gaps: &[f64], rates: &[f64], out: [&mut [f64]; 3]) {
        wide_registers!([F: Formula] forces_at(
            law: &Law<F> = self,
            branch: usize = branch,
            gaps: &[f64] = gaps,
            rates: &[f64] = rates,
            out: [&mut [f64]; 3] = out,
        ));
    }

    fn exits(&self, branch: usize) -> Vec<Exit> {
        self.formula
            .ways(branch)
            .into_iter()
            .map(|way| {
                let guard = match way.edge {
                    Edge::Falls(k) => Guard::Falls(self.constants[k]),
                    Edge::Rises(k) => Guard::Rises(self.constants[k]),
                    Edge::Turns => Guard::Turns,
                    Edge::Own(k) => Guard::Own(k),
                };
                Exit::new(guard, way.target).with(way.before, way.after)
            })
            .collect()
    }

    /// Returns the pole if a branch without contact reaches it: contact that begins at a larger gap
    /// keeps every motion away from it.
    fn pole(&self) -> Option<f64> {
        let pole = self.formula.pole(&self.constants)?;
        let reaches = |branch: usize| {
            let ends = self.exits(branch).into_iter();
            let mut ends = ends.filter_map(|exit| match exit.guard {
                Guard::Falls(level) => Some(level),
                _ => None,
            });
            !self.touches(branch) && ends.all(|level| level <= pole)
        };
        (0..self.branches()).any(reaches).then_some(pole)
    }

    fn guard(&self, index: usize, gap: f64, rate: f64) -> Force {
        force_of(self.formula.guard(
            &self.lifted,
            index,
            Dual::variable(gap, 0),
            Dual::variable(rate, 1),
        ))
    }

    fn by_parameters(&self, branch: usize, gap: f64, rate: f64, out: &mut [f64]) {
        for (out, c) in out.iter_mut().zip(&self.varied) {
            let force = self
                .formula
                .force(c, branch, Dual::constant(gap), Dual::constant(rate));
            *out = force.slopes[0];
        }
    }

    fn guard_by_parameters(
        &self,
        branch: usize,
        exit: usize,
        gap: f64,
        rate: f64,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        let ways = self.formula.ways(branch);
        let Some(way) = ways.get(exit) else { return };
        for (out, c) in out.iter_mut().zip(&self.varied) {
            *out = match way.edge {
                Edge::Falls(k) => -c[k].slopes[0],
                Edge::Rises(k) => c[k].slopes[0],
                Edge::Turns => 0.0,
                Edge::Own(k) => {
                    let (gap, rate) = (Dual::constant(gap), Dual::constant(rate));
                    self.formula.guard(c, k, gap, rate).slopes[0]
                }
            };
        }
    }

    fn energy(&self, branch: usize, gap: f64) -> Option<f64> {
        self.formula.energy(&self.constants, branch, gap)
    }

    fn touches(&self, branch: usize) -> bool {
        self.formula.touches(branch)
    }

    fn remembers(&self) -> bool {
        self.formula.remembers()
    }

    fn vanishes(&self, branch: usize) -> bool {
        self.formula.vanishes(branch)
    }

    fn conservative(&self) -> bool {
        self.formula.entry().conservative
    }

    fn remarks(&self, least_gap: f64) -> Vec<Remark> {
        self.formula.remarks(&self.parameters, least_gap)
    }
}
