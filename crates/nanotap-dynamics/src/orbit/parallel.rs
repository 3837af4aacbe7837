//! Parallel computation of the periods of an orbit.
//!
//! In multiple shooting each period starts from its own point, so the periods are independent. If a
//! period is costly, they are shared among the threads of the caller's pool; outside a pool they
//! run in sequence.

use crate::failure::MapFailure;
use crate::map::StroboscopicMap;

/// Calls `one` for every item, with a clone of the map on other threads.
///
/// # Errors
/// The error of the first item that fails.
pub(crate) fn for_each_period<M: StroboscopicMap, T: Send>(
    map: &mut M,
    items: &mut [T],
    one: &(impl Fn(&mut M, &mut T) -> Result<(), MapFailure> + Sync),
) -> Result<(), MapFailure> {
    if !map.is_costly() || is_single_threaded() {
        return items.iter_mut().try_for_each(|item| one(map, item));
    }
    // Two chunks per thread, because they take different times.
    let longest = items.len().div_ceil(2 * rayon::current_num_threads());
    in_chunks(map, items, longest.max(1), one)
}

/// True if no other thread of the pool can take work from this one.
pub(crate) fn is_single_threaded() -> bool {
    rayon::current_thread_index().is_none() || rayon::current_num_threads() == 1
}

fn in_chunks<M: StroboscopicMap, T: Send>(
    map: &mut M,
    items: &mut [T],
    longest: usize,
    one: &(impl Fn(&mut M, &mut T) -> Result<(), MapFailure> + Sync),
) -> Result<(), MapFailure> {
    if items.len() <= longest {
        return items.iter_mut().try_for_each(|item| one(map, item));
    }
    let (first, second) = items.split_at_mut(items.len() / 2);
    let mut other = map.clone();
    let before = other.cost();
    let (first, second) = rayon::join(
        || in_chunks(map, first, longest, one),
        || in_chunks(&mut other, second, longest, one),
    );
    map.add_cost(other.cost() - before);
    first.and(second)
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::orbit::{ShootingOptions, close_orbit};

    /// 1 − 1.76 x², near the parameter 1.7549 of the superstable orbit of period 3; fails beyond
    /// 1.5.
    #[derive(Clone)]
    struct Quadratic {
        costly: bool,
    }

    impl crate::Scheduling for Quadratic {
        fn is_costly(&self) -> bool {
            self.costly
        }
    }

    impl StroboscopicMap for Quadratic {
        type Error = std::io::Error;

        fn dimension(&self) -> usize {
            1
        }

        fn period(&self) -> f64 {
            1.0
        }

        fn advance(&mut self, state: &mut [f64]) -> Result<(), Self::Error> {
            if state[0] > 1.5 {
                return Err(std::io::Error::other(format!("{}", state[0])));
            }
            state[0] = 1.0 - 1.76 * state[0] * state[0];
            Ok(())
        }

        fn advance_with_jacobian(
            &mut self,
            state: &mut [f64],
            jacobian: &mut DMatrix<f64>,
        ) -> Result<(), Self::Error> {
            jacobian[(0, 0)] = -3.52 * state[0];
            self.advance(state)
        }
    }

    fn in_pool<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(work)
    }

    #[test]
    fn an_orbit_is_the_same_to_the_last_digit_for_any_number_of_threads() {
        let closed = |costly: bool| {
            let options = ShootingOptions::default();
            close_orbit(&mut Quadratic { costly }, &[0.0], 3, &options).unwrap()
        };
        let alone = closed(false);
        assert_eq!(alone.period, 3);
        assert_eq!(closed(true), alone);
        for threads in [1, 2, 5] {
            assert_eq!(in_pool(threads, || closed(true)), alone);
        }
    }

    #[test]
    fn every_period_is_computed_and_the_first_failure_returned() {
        let starts: Vec<f64> = (0..37).map(|k| f64::from(k) * 0.1).collect();
        for threads in [1, 2, 5] {
            let mut ends = starts.clone();
            let result = in_pool(threads, || {
                let mut map = Quadratic { costly: true };
                for_each_period(&mut map, &mut ends, &|map, end| {
                    map.advance(std::slice::from_mut(end))
                        .map_err(MapFailure::refused)
                })
            });
            assert!(
                result.unwrap_err().to_string().ends_with("1.6"),
                "{threads}"
            );
            for (end, start) in ends.iter().zip(&starts).take(16) {
                assert_eq!(*end, 1.0 - 1.76 * start * start);
            }
        }
    }
}
