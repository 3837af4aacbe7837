//! Bifurcations located by other threads while the branch goes on.
//!
//! A step along a branch waits for the one before it; what lies between two of its points does not.

use std::sync::{Mutex, PoisonError};

use rayon::Scope;

use crate::continuation::bifurcation::{Bifurcation, Tests, between};
use crate::continuation::solver::{BranchSolver, Node};
use crate::control::{CancelFlag, Control};
use crate::map::MapFamily;
use crate::orbit::side_by_side::is_alone;

/// Who locates the bifurcations of one branch.
pub(crate) struct Locating<'s, 'scope> {
    pub(crate) scope: &'s Scope<'scope>,
    /// What other threads have found, in whatever order.
    pub(crate) found: &'scope Mutex<Vec<Bifurcation>>,
    pub(crate) control: &'scope Control<'scope>,
}

impl<'scope> Locating<'_, 'scope> {
    /// Whether the work is counted, and so must not run beside that of the branch.
    fn has_budget(&self) -> bool {
        self.control.cancel.is_some_and(CancelFlag::has_budget)
    }

    /// The bifurcations between two neighbouring nodes, or none, where another thread is to find
    /// them.
    pub(crate) fn between<'a: 'scope, F: MapFamily + 'scope>(
        &self,
        solver: &mut BranchSolver<'a, F>,
        nodes: [&Node; 2],
        tests: [&Tests; 2],
        step: f64,
        after_point: usize,
    ) -> Vec<Bifurcation> {
        if is_alone() || self.has_budget() || !Tests::any_changes(tests, solver.n) {
            return between(solver, nodes, tests, step, after_point);
        }
        let mut solver = solver.another();
        let (nodes, tests) = (nodes.map(Node::clone), tests.map(Tests::clone));
        let Self { found, control, .. } = *self;
        self.scope.spawn(move |_| {
            if control.is_cancelled() {
                return;
            }
            let located = between(
                &mut solver,
                nodes.each_ref(),
                tests.each_ref(),
                step,
                after_point,
            );
            if control.is_cancelled() {
                return;
            }
            let mut found = found.lock().unwrap_or_else(PoisonError::into_inner);
            found.extend(located);
        });
        Vec::new()
    }
}
