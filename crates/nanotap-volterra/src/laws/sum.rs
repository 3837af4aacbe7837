//! Laws that act together.

use crate::kernel::MAX_NODES;
use crate::law::{Exit, Force, ForceLaw, Guard, Remark};
use std::sync::Arc;

/// The sum of laws. A branch of the sum is a branch of each, counted with the first fastest.
/// Ways out of several laws at the same value of the gap are one.
#[derive(Clone, Debug)]
pub struct Sum {
    terms: Vec<Arc<dyn ForceLaw>>,
    /// How many parameters each has.
    counts: Vec<usize>,
    /// How many guards of their own the terms before each have at most.
    guards: Vec<usize>,
}

impl Sum {
    /// The sum of these laws; what must not be added is for
    /// [`build`](crate::laws::build_sum) to refuse.
    pub(crate) fn new(terms: Vec<Arc<dyn ForceLaw>>) -> Self {
        let mut guards = Vec::with_capacity(terms.len());
        let mut first = 0;
        for term in &terms {
            guards.push(first);
            first += own_guards(term.as_ref());
        }
        Self {
            counts: terms.iter().map(|t| t.parameters().len()).collect(),
            terms,
            guards,
        }
    }

    /// The terms with their own branches.
    fn split(&self, mut branch: usize) -> impl Iterator<Item = (usize, &dyn ForceLaw, usize)> {
        self.terms.iter().enumerate().map(move |(k, term)| {
            let own = branch % term.branches();
            branch /= term.branches();
            (k, term.as_ref(), own)
        })
    }

    /// The exits of a branch, each with the corresponding exits of the terms.
    fn ways(&self, branch: usize) -> Vec<(Exit, Vec<(usize, usize)>)> {
        let mut ways: Vec<(Exit, Vec<(usize, usize)>)> = Vec::new();
        let mut stride = 1;
        for (k, term, own) in self.split(branch) {
            for (number, exit) in term.exits(own).into_iter().enumerate() {
                let guard = match exit.guard {
                    Guard::Own(index) => Guard::Own(self.guards[k] + index),
                    other => other,
                };
                let change = |target: usize| target - own * stride + exit.target * stride;
                if let Some((way, members)) = ways.iter_mut().find(|(w, _)| w.guard == guard) {
                    way.target = change(way.target);
                    way.before = way.before.max(exit.before);
                    way.after = way.after.max(exit.after);
                    members.push((k, number));
                } else {
                    let way = Exit::new(guard, change(branch)).with(exit.before, exit.after);
                    ways.push((way, vec![(k, number)]));
                }
            }
            stride *= term.branches();
        }
        ways
    }
}

fn own_guards(term: &dyn ForceLaw) -> usize {
    (0..term.branches())
        .flat_map(|b| term.exits(b))
        .map(|e| match e.guard {
            Guard::Own(index) => index + 1,
            _ => 0,
        })
        .max()
        .unwrap_or(0)
}

impl ForceLaw for Sum {
    fn parameters(&self) -> Vec<&'static str> {
        self.terms.iter().flat_map(|t| t.parameters()).collect()
    }

    fn branches(&self) -> usize {
        self.terms.iter().map(|t| t.branches()).product()
    }

    fn branch_at(&self, gap: f64, rate: f64) -> usize {
        self.terms.iter().rev().fold(0, |branch, term| {
            branch * term.branches() + term.branch_at(gap, rate)
        })
    }

    fn force(&self, branch: usize, gap: f64, rate: f64) -> Force {
        let mut sum = Force::default();
        for (_, term, own) in self.split(branch) {
            let force = term.force(own, gap, rate);
            sum.value += force.value;
            sum.by_gap += force.by_gap;
            sum.by_rate += force.by_rate;
        }
        sum
    }

    fn value(&self, branch: usize, gap: f64, rate: f64) -> f64 {
        self.split(branch)
            .map(|(_, term, own)| term.value(own, gap, rate))
            .sum()
    }

    fn has_terms(&self) -> bool {
        true
    }

    fn cost(&self) -> u64 {
        self.terms.iter().map(|t| t.cost()).max().unwrap_or(1)
    }

    fn depends_on_rate(&self) -> bool {
        self.terms.iter().any(|t| t.depends_on_rate())
    }

    fn takes_signal(&self) -> bool {
        self.terms.iter().any(|t| t.takes_signal())
    }

    fn averaged(&self) -> Option<Arc<dyn ForceLaw>> {
        let terms = self.terms.iter();
        let averaged = terms.map(|t| t.averaged().unwrap_or_else(|| Arc::clone(t)));
        self.takes_signal()
            .then(|| Arc::new(Self::new(averaged.collect())) as Arc<dyn ForceLaw>)
    }

    fn forces(&self, branch: usize, gaps: &[f64], rates: &[f64], mut out: [&mut [f64]; 3]) {
        for sums in &mut out {
            sums.fill(0.0);
        }
        let n = gaps.len().min(MAX_NODES);
        let mut own_forces = [[0.0; MAX_NODES]; 3];
        for (_, term, own) in self.split(branch) {
            if term.vanishes(own) {
                continue;
            }
            let parts = own_forces.each_mut().map(|part| &mut part[..n]);
            term.forces(own, gaps, rates, parts);
            for (sums, parts) in out.iter_mut().zip(&own_forces) {
                for (sum, part) in sums.iter_mut().zip(parts) {
                    *sum += part;
                }
            }
        }
    }

    fn exits(&self, branch: usize) -> Vec<Exit> {
        self.ways(branch)
            .into_iter()
            .map(|(exit, _)| exit)
            .collect()
    }

    fn wall(&self) -> Option<f64> {
        let walls = self.terms.iter().filter_map(|t| t.wall());
        walls.reduce(f64::max)
    }

    fn pole(&self) -> Option<f64> {
        let poles = self.terms.iter().filter_map(|t| t.pole());
        poles.reduce(f64::max)
    }

    fn guard(&self, index: usize, gap: f64, rate: f64) -> Force {
        let k = self.guards.partition_point(|first| *first <= index) - 1;
        self.terms[k].guard(index - self.guards[k], gap, rate)
    }

    fn by_parameters(&self, branch: usize, gap: f64, rate: f64, out: &mut [f64]) {
        let mut first = 0;
        for (k, term, own) in self.split(branch) {
            let next = first + self.counts[k];
            term.by_parameters(own, gap, rate, &mut out[first..next]);
            first = next;
        }
    }

    /// Where several laws leave a branch at one gap, a change that parts their levels has no
    /// derivative; the first one's is taken, which is right where they move together.
    fn guard_by_parameters(
        &self,
        branch: usize,
        exit: usize,
        gap: f64,
        rate: f64,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        let ways = self.ways(branch);
        let Some((_, members)) = ways.get(exit) else {
            return;
        };
        let Some(&(member, number)) = members.first() else {
            return;
        };
        let mut first = 0;
        for (k, term, own) in self.split(branch) {
            let next = first + self.counts[k];
            if k == member {
                term.guard_by_parameters(own, number, gap, rate, &mut out[first..next]);
            }
            first = next;
        }
    }

    fn energy(&self, branch: usize, gap: f64) -> Option<f64> {
        self.split(branch)
            .map(|(_, term, own)| {
                // Out of contact a term that dissipates stores nothing.
                let stored = term.energy(own, gap);
                stored.or_else(|| term.vanishes(own).then_some(0.0))
            })
            .sum()
    }

    fn touches(&self, branch: usize) -> bool {
        self.split(branch).any(|(_, term, own)| term.touches(own))
    }

    fn remembers(&self) -> bool {
        self.terms.iter().any(|t| t.remembers())
    }

    fn vanishes(&self, branch: usize) -> bool {
        self.split(branch).all(|(_, term, own)| term.vanishes(own))
    }

    fn conservative(&self) -> bool {
        self.terms.iter().all(|t| t.conservative())
    }

    fn remarks(&self, least_gap: f64) -> Vec<Remark> {
        self.terms
            .iter()
            .flat_map(|t| t.remarks(least_gap))
            .collect()
    }
}
