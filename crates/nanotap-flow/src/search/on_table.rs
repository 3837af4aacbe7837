//! The first zero of a tabulated guard: whole flights are certified by its table, and where it
//! falls through zero one evaluation of the guard is enough.

use super::interval::{FallingZero, Interval};
use super::steps::{RESOLUTION, quadratic_root};
use super::table::{Followed, Table};
use super::walk::Span;
use super::{BySteps, Crossing, Start, Statistics};
use crate::signal::{Jet, Signal};
use crate::simd::{Simd, Work};

/// The first crossing of a signal whose exponentials are tabulated. Exponentials of the last evaluation are kept in the signal.
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
    let search = IntervalSearch {
        table,
        length,
        start,
    };
    let Some(mut coarse) = table.coarse::<S>(signal, whole) else {
        return search
            .span::<S>(whole, signal, followed, statistics)
            .and_then(Decision::crossing);
    };
    let mut found = None;
    while found.is_none()
        && let Some(interval) = coarse.next_open(followed.amplitudes())
    {
        followed.move_to::<S>(table, &interval);
        let span = whole.within(&interval);
        found = search.span::<S>(span, signal, followed, statistics);
        followed.move_back();
    }
    statistics.points += coarse.points;
    found.and_then(Decision::crossing)
}

/// All of a signal up to `length`, for a table; `None` for a start that only the Taylor
/// series can leave.
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

/// What ends a search through intervals.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Decision {
    /// The crossing.
    Crossing(Crossing),
    /// There is one, but beyond the end.
    TooLate,
}

impl Decision {
    /// The crossing, unless it comes too late.
    fn crossing(self) -> Option<Crossing> {
        match self {
            Self::Crossing(crossing) => Some(crossing),
            Self::TooLate => None,
        }
    }
}

/// The signal itself where an interval's quintic falls through zero, and its third derivative
/// there; the exponentials are kept.
#[inline(always)]
fn evaluate_zero<S: Simd>(
    zero: &FallingZero,
    signal: &mut Signal,
    statistics: &mut Statistics,
) -> (Jet, f64) {
    statistics.evaluations += 1;
    signal.jet_keeping_factors::<S>(zero.at)
}

/// The crossing at a quintic's zero, if it is certain to be the only one in its interval and one
/// step away.
#[inline(always)]
fn confirm_zero(
    zero: &FallingZero,
    (jet, jerk): (Jet, f64),
    signal: &Signal,
    length: f64,
) -> Option<Decision> {
    // Every zero in the interval is as near as this, and the rate keeps its sign up to there.
    let near = (jet.value.abs() + 2.0 * zero.error) / zero.gentlest;
    let unique = near * signal.fastest() < 0.1
        && near * (jet.curvature.abs() + 1.2 * jet.third * near) < -jet.rate;
    if !unique {
        return None;
    }
    let crossing = last_cubic_step(&jet, jerk, zero.at, length, signal)?;
    Some(if crossing.at <= length {
        Decision::Crossing(crossing)
    } else {
        Decision::TooLate
    })
}

/// A search through the intervals of a table's fine grid.
struct IntervalSearch<'a> {
    table: &'a Table,
    length: f64,
    start: Start,
}

impl IntervalSearch<'_> {
    /// The crossing in a span.
    #[inline(always)]
    fn span<S: Simd>(
        &self,
        span: Span,
        signal: &mut Signal,
        followed: &Followed,
        statistics: &mut Statistics,
    ) -> Option<Decision> {
        let mut fine = self.table.fine::<S>(signal, span);
        let mut found = None;
        while found.is_none()
            && let Some(interval) = fine.next_open(followed.amplitudes())
        {
            found = self.interval::<S>(&interval, signal, statistics);
        }
        statistics.points += fine.points;
        found
    }

    /// The crossing in an interval that may hold one.
    #[inline(always)]
    fn interval<S: Simd>(
        &self,
        interval: &Interval,
        signal: &mut Signal,
        statistics: &mut Statistics,
    ) -> Option<Decision> {
        if let Some(zero) = interval.falling_zero() {
            let evaluated = evaluate_zero::<S>(&zero, signal, statistics);
            let confirmed = confirm_zero(&zero, evaluated, signal, self.length);
            if confirmed.is_some() {
                return confirmed;
            }
        }
        S::apart(BySteps {
            signal,
            length: self.length,
            from: interval.start,
            limit: interval.end.min(self.length),
            start: self.start,
            statistics,
        })
        .map(Decision::Crossing)
    }
}

/// The last step to a zero with the third derivative, `jerk`, known and not only bounded: the
/// cubic's zero.
#[inline(always)]
fn last_cubic_step(
    jet: &Jet,
    jerk: f64,
    at: f64,
    length: f64,
    signal: &Signal,
) -> Option<Crossing> {
    let slope = |h: f64| jet.rate + h * (jet.curvature + 0.5 * jerk * h);
    let first = quadratic_root(jet);
    let step = first - jerk * first.powi(3) / (6.0 * slope(first));
    let rate = slope(step);
    let cubic =
        jet.value + step * (jet.rate + step * (0.5 * jet.curvature + step * jerk * (1.0 / 6.0)));
    // |g(at + step)| ≤ B₄ step⁴ / 24 where the cubic vanishes, and B₄ ≤ B max|λ|.
    let error = jet.third * signal.fastest() * step.powi(4) / 24.0;
    let solved = cubic.abs() <= signal.noise();
    (solved && error <= RESOLUTION * length * rate.abs()).then_some(Crossing {
        at: at + step,
        rate: rate.min(0.0),
        grazing: false,
        refined: false,
    })
}
