//! Bifurcations located by other threads during the continuation of a branch.
//!
//! Each step along a branch needs the one before it, but the search between two known points does
//! not.

use std::sync::{Mutex, PoisonError};

use rayon::Scope;

use crate::continuation::bifurcation::{Bifurcation, Tests, between};
use crate::continuation::solver::{BranchSolver, Node};
use crate::control::{CancelFlag, Control};
use crate::map::MapFamily;
use crate::orbit::parallel::is_single_threaded;

/// Spawns tasks that locate the bifurcations of one branch.
pub(crate) struct BifurcationTasks<'s, 'scope> {
    pub(crate) scope: &'s Scope<'scope>,
    /// Results of the tasks, in no particular order.
    pub(crate) found: &'scope Mutex<Vec<Bifurcation>>,
    pub(crate) control: &'scope Control<'scope>,
}

impl<'scope> BifurcationTasks<'_, 'scope> {
    /// True if steps are counted, so that no task may run in parallel with the branch.
    fn has_budget(&self) -> bool {
        self.control.cancel.is_some_and(CancelFlag::has_budget)
    }

    /// Returns the bifurcations between two neighbouring nodes, or an empty list if a spawned task
    /// will find them.
    pub(crate) fn between<'a: 'scope, F: MapFamily + 'scope>(
        &self,
        solver: &mut BranchSolver<'a, F>,
        nodes: [&Node; 2],
        tests: [&Tests; 2],
        step: f64,
        after_point: usize,
    ) -> Vec<Bifurcation> {
        if is_single_threaded() || self.has_budget() || !Tests::any_changes(tests, solver.n) {
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
