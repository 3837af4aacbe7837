//! The branches through the motions of a walk, followed while it goes on.
//!
//! Of one thread nothing is asked before the walk is over. Another that has nothing else to do
//! follows what the walk has met so far. Seeds are taken in the order of the walk, so that the
//! branches are the same however far they were followed meanwhile.

use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{self, ThreadId};
use std::time::Duration;

use nanotap_dynamics::{Control, PeriodicOrbit};

use crate::study::branch::BranchesThrough;

/// A periodic motion and the distance at which it was met.
pub(super) type Seed = (f64, PeriodicOrbit);

/// How long to wait before it is looked again whether anything was met.
const PAUSE: Duration = Duration::from_micros(50);

/// How often to wait in vain, for a tenth of a second or two. Where several walks share threads,
/// two that waited for each other's would wait for ever.
const PATIENCE: usize = 1000;

/// Does `work`, which sends what it meets, and follows branches through that as threads are free.
pub(super) fn following<T: Send>(
    branches: &mut BranchesThrough<'_>,
    work: impl FnOnce(Sender<Seed>) -> T + Send,
    control: &Control<'_>,
) -> T {
    let (sender, mut met) = channel();
    let worker = OnceLock::new();
    let (done, ()) = rayon::join(
        || {
            worker.get_or_init(|| thread::current().id());
            work(sender)
        },
        || follow_until_done(branches, &mut met, &worker, control),
    );
    branches.follow(met.try_iter(), control);
    done
}

/// Follows what is met until nothing more can come.
fn follow_until_done(
    branches: &mut BranchesThrough<'_>,
    met: &mut Receiver<Seed>,
    worker: &OnceLock<ThreadId>,
    control: &Control<'_>,
) {
    // The walk's own thread, which comes here only while it waits for others, would wait for itself.
    let mut waited = 0;
    while worker.get() != Some(&thread::current().id()) && waited < PATIENCE {
        match met.try_recv() {
            Ok(seed) => {
                branches.follow(std::iter::once(seed).chain(met.try_iter()), control);
                waited = 0;
            }
            Err(TryRecvError::Disconnected) => return,
            Err(TryRecvError::Empty) if rayon::yield_now() == Some(rayon::Yield::Executed) => {
                waited = 0;
            }
            Err(TryRecvError::Empty) => {
                thread::sleep(PAUSE);
                waited += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use super::*;
    use crate::case::{Case, Key};
    use crate::model::cantilever::Cantilever;
    use crate::model::strobe::Strobe;
    use crate::study::branch::BranchOptions;
    use nanotap_dynamics::{ShootingOptions, close_orbit_from_points};

    /// Period 1 of the paper's case, at which runs there arrive.
    fn met_at(case: &Case, omega: f64) -> Seed {
        let mut map = Strobe::new(&case.with(Key::Omega, omega).model().unwrap());
        let orbit = close_orbit_from_points(&mut map, &[0.0; 6], 1, &ShootingOptions::default());
        (omega, orbit.unwrap())
    }

    /// Branches as text, from several walks at once on so many threads. With more walks than
    /// threads, one that waits for a walk to go on may keep another walk from it.
    fn branches_of(walks: usize, threads: usize) -> Vec<String> {
        let case = Case::from(Cantilever::paper());
        let options = BranchOptions::over(Key::Omega, 3.0, 3.02);
        let seeds: Vec<Seed> = [3.0, 3.01, 3.02].map(|o| met_at(&case, o)).into();
        let quiet = Control::default();
        let one = |_| {
            let mut branches = BranchesThrough::new(&case, &options).unwrap();
            let walk = |met: Sender<Seed>| {
                for seed in &seeds {
                    rayon::join(
                        || thread::sleep(Duration::from_millis(1)),
                        || met.send(seed.clone()).unwrap(),
                    );
                }
            };
            following(&mut branches, walk, &quiet);
            serde_json::to_string(&branches.report(&quiet)).unwrap()
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let walks = || {
            (0..walks)
                .into_par_iter()
                .with_max_len(1)
                .map(one)
                .collect()
        };
        pool.build().unwrap().install(walks)
    }

    #[test]
    fn branches_are_the_same_when_walks_share_threads() {
        let alone = branches_of(1, 1).remove(0);
        assert!(alone.contains("\"branches\":[{"));
        for threads in [1, 2, 4] {
            for branches in branches_of(8, threads) {
                assert_eq!(branches, alone);
            }
        }
    }
}
