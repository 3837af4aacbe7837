//! The first zero of a tabulated guard: whole flights are certified by its table, and where it
//! falls through zero one evaluation of the guard is enough.

use super::interval::{Cubic, Interval};
use super::near::Near;
use super::tabulated::{Followed, Table};
use super::walk::Span;
use super::{BySteps, Crossing, Start, Statistics};
use crate::signal::Signal;
use crate::simd::{Simd, Single, Work};

/// Returns the first crossing of a signal whose exponentials are tabulated. The signal keeps the
/// exponentials of the last evaluation.
#[inline(always)]
pub(crate) fn first_crossing<S: Simd>(
    table: &Table,
    signal: &mut Signal,
    followed: &mut Followed,
    length: f64,
    start: Start,
    statistics: &mut Statistics,
) -> Option<Crossing> {
    let Some(whole) = whole_span(signal, length, start) else {
        return BySteps {
            signal,
            length,
            from: 0.0,
            limit: length,
            start,
            statistics,
        }
        .run::<S>();
    };
    followed.follow::<S>(table, signal);
    let mut search = IntervalSearch {
        table,
        signal,
        length,
        start,
        statistics,
    };
    let Some(mut coarse) = table.coarse::<S>(search.signal, whole) else {
        return search
            .span::<S>(whole, followed)
            .and_then(Decision::crossing);
    };
    let mut found = None;
    while found.is_none()
        && let Some(interval) = coarse.next_open(followed.amplitudes())
    {
        followed.move_to::<S>(table, &interval);
        found = search.span::<S>(whole.within(&interval), followed);
        followed.move_back();
    }
    search.statistics.points += coarse.points;
    found.and_then(Decision::crossing)
}

/// Returns the whole of a signal up to `length` as the span to search on a table; `None` for a
/// start that only the Taylor series can leave.
#[inline(always)]
fn whole_span(signal: &Signal, length: f64, start: Start) -> Option<Span> {
    let surface = match start {
        Start::Inside => None,
        Start::Surface { rate } => Some(rate.unwrap_or_else(|| signal.first_jet().rate)),
        Start::Release | Start::Flat { .. } => return None,
    };
    Some(Span {
        start: 0.0,
        end: length,
        surface,
    })
}

/// The result of a search through intervals.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Decision {
    /// The first crossing, certified.
    Crossing(Crossing),
    /// There is a crossing, but beyond the end of the search.
    TooLate,
}

impl Decision {
    /// Returns the crossing, unless it lies beyond the end.
    fn crossing(self) -> Option<Crossing> {
        match self {
            Self::Crossing(crossing) => Some(crossing),
            Self::TooLate => None,
        }
    }
}

/// Number of evaluations of the signal near a quintic's zero, after which certified steps take
/// over.
const MAX_EVALUATIONS: usize = 4;

/// A search through the intervals of a table's fine grid.
struct IntervalSearch<'a> {
    table: &'a Table,
    signal: &'a mut Signal,
    length: f64,
    start: Start,
    statistics: &'a mut Statistics,
}

impl IntervalSearch<'_> {
    /// Searches for the crossing in a span.
    #[inline(always)]
    fn span<S: Simd>(&mut self, span: Span, followed: &Followed) -> Option<Decision> {
        let table = self.table;
        let mut fine = table.fine::<S>(self.signal, span);
        let mut found = None;
        while found.is_none()
            && let Some(interval) = fine.next_open(followed.amplitudes())
        {
            let rate_error = fine.rate_error();
            let from_zero = interval.point == 0 && span.surface.is_some();
            // What starts at zero and rises all the way is certified as well.
            if !(from_zero && interval.quintic().rates()[0] > rate_error) {
                found = self.interval::<S>(&interval, rate_error);
            }
        }
        self.statistics.points += fine.points;
        found
    }

    /// Searches for the crossing in an interval that may contain one.
    #[inline(always)]
    fn interval<S: Simd>(&mut self, interval: &Interval, rate_error: f64) -> Option<Decision> {
        if interval.crosses()
            && let Some(decision) = self.zero::<S>(interval, rate_error)
        {
            return Some(decision);
        }
        S::apart(BySteps {
            signal: self.signal,
            length: self.length,
            from: interval.start,
            limit: interval.end.min(self.length),
            start: self.start,
            statistics: self.statistics,
        })
        .map(Decision::Crossing)
    }

    /// Returns the signal's zero near that of an interval's quintic, by Newton's method with two
    /// more derivatives, if it is certain to be the only one. The signal keeps the exponentials of
    /// the last evaluation.
    #[inline(always)]
    fn zero<S: Simd>(&mut self, interval: &Interval, rate_error: f64) -> Option<Decision> {
        let quintic = interval.quintic();
        let gentlest = -quintic.rates()[1];
        if gentlest <= 0.0 {
            return None;
        }
        // The signal too falls all the way.
        let falls = gentlest > rate_error;
        let mut at = interval.start + quintic.zero() * interval.width;
        for evaluated in 0..MAX_EVALUATIONS {
            self.statistics.evaluations += 1;
            let (jet, jerk) = self.signal.jet_keeping_factors::<S>(at);
            let near = Near::<Single> {
                cubic: Cubic {
                    value: jet.value,
                    rate: jet.rate,
                    curvature: jet.curvature,
                    jerk,
                },
                third: jet.third,
                fastest: self.signal.fastest(),
                noise: self.signal.noise(),
                length: self.length,
            };
            if evaluated == 0 && !falls && near.not_unique(gentlest, interval.error) != 0 {
                return None;
            }
            let step = near.cubic.step();
            let rate = near.cubic.slope(step);
            let crossing = Crossing {
                at: at + step,
                rate: rate.min(0.0),
                grazing: false,
                refined: false,
            };
            if near.goes_on(step, rate) == 0 {
                return Some(if crossing.at <= self.length {
                    Decision::Crossing(crossing)
                } else {
                    Decision::TooLate
                });
            }
            at = crossing.at;
            let inside = at >= interval.start && at <= interval.end;
            if !inside {
                return None;
            }
        }
        None
    }
}
