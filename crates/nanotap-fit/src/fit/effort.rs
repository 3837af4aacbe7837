//! A limit to the work of a fit under a nonlinear law, whose orbits take milliseconds: once so many
//! were computed, the search ends with what is known and says what it left out. The limit counts
//! orbits, not time, so that a result does not depend on the machine.

use std::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

/// Evaluations of all rows after which a fit under a nonlinear law ends.
const EVALUATIONS: usize = 60;

/// Fewest rows whose evaluations are counted: a scan over offsets takes as many orbits.
const MIN_ROWS: usize = 36;

/// Parts of a fit that may be left out.
#[derive(Clone, Copy, Debug)]
pub(super) enum Part {
    Starts,
    Rivals,
    Intervals,
}

const PARTS: [(Part, &str); 3] = [
    (Part::Starts, "further initial values"),
    (Part::Rivals, "other minima"),
    (Part::Intervals, "profiles of the intervals"),
];

/// Orbits computed so far, with a limit.
#[derive(Debug)]
pub(super) struct Effort {
    orbits: AtomicUsize,
    limit: usize,
    left_out: AtomicU8,
}

impl Effort {
    /// A limit of `evaluations` of all rows, of few rows of 36; default: none under a piecewise-linear law.
    pub(super) fn new(evaluations: Option<usize>, rows: usize, is_nonlinear: bool) -> Self {
        let default = is_nonlinear.then_some(EVALUATIONS);
        let evaluations = evaluations.or(default);
        Self {
            orbits: AtomicUsize::new(0),
            limit: evaluations.map_or(usize::MAX, |count| count.saturating_mul(rows.max(MIN_ROWS))),
            left_out: AtomicU8::new(0),
        }
    }

    pub(super) fn add_orbit(&self) {
        self.orbits.fetch_add(1, Ordering::Relaxed);
    }

    /// Whether the limit is reached, so that this part ends.
    pub(super) fn ends(&self, part: Part) -> bool {
        let ends = self.orbits.load(Ordering::Relaxed) >= self.limit;
        if ends {
            self.left_out.fetch_or(1 << part as u8, Ordering::Relaxed);
        }
        ends
    }

    /// Says what was left out.
    pub(super) fn words(&self) -> Option<String> {
        let bits = self.left_out.load(Ordering::Relaxed);
        let parts = PARTS
            .iter()
            .filter(|(part, _)| bits >> *part as u8 & 1 == 1);
        let parts: Vec<&str> = parts.map(|(_, words)| *words).collect();
        (!parts.is_empty()).then(|| {
            format!(
                "the search ended after {} orbits: {} were not followed to the end; the option \
                 `evaluations` sets another limit",
                self.orbits.load(Ordering::Relaxed),
                parts.join(", ")
            )
        })
    }
}
