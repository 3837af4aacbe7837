//! Proof that guards keep their sign between two switches.

use crate::complex::Rectangle;
use crate::interval::Interval;
use crate::system::{ModalOutput, Regime, System};

/// One output along one flight: g(s) = Re Σ c_k e^{λ_k s} + Re Σ z_k e^{iω_k s} + constant.
struct Signal {
    /// c_k and λ_k of the terms of the motion and of the tones.
    terms: Vec<(Rectangle, Rectangle)>,
    constant: Interval,
}

/// Known zeros of a guard at the ends of its flight.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ends {
    /// Number of derivatives, including the guard itself, that are zero at the start.
    pub(crate) zeros_at_start: usize,
    /// Whether the guard is zero at the end.
    pub(crate) zero_at_end: bool,
}

/// Largest number of pieces into which a flight is divided.
const MAX_PIECES: usize = 100_000;
/// Smallest length of a piece, relative to the flight.
const SHORTEST: f64 = 1e-12;

/// Location at which a guard's sign remained undecided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Undecided {
    /// Time since the start of the flight.
    pub(crate) at: f64,
}

/// Proves that a guard is positive strictly between the ends of a flight that starts with the modal
/// coordinates `modal` at time `start` and lasts at most `duration`.
pub(crate) fn stays_positive(
    system: &System,
    regime: &Regime,
    guard: usize,
    modal: &[Rectangle],
    start: Interval,
    duration: Interval,
    ends: Ends,
) -> Result<(), Undecided> {
    let signal = Signal::of(system, regime, &regime.guards[guard], modal, start);
    let whole = duration.hi();
    let mut open = vec![(0.0, whole)];
    let mut pieces = 0;
    while let Some((from, to)) = open.pop() {
        let (at_start, at_end) = (
            from == 0.0 && ends.zeros_at_start > 0,
            to >= duration.lo() && ends.zero_at_end,
        );
        // At a zero the first derivative that does not vanish decides.
        let decided = match (at_start, at_end) {
            (false, false) => signal.range(0, from, to).is_positive(),
            (true, false) => signal.range(ends.zeros_at_start, from, to).is_positive(),
            (false, true) => (-signal.range(1, from, to)).is_positive(),
            (true, true) => false,
        };
        if decided {
            continue;
        }
        pieces += 1;
        let middle = 0.5 * (from + to);
        let is_over = pieces > MAX_PIECES || to - from <= SHORTEST * whole;
        if is_over || system.check_cancel().is_err() {
            return Err(Undecided { at: middle });
        }
        open.push((middle, to));
        open.push((from, middle));
    }
    Ok(())
}

impl Signal {
    fn of(
        system: &System,
        regime: &Regime,
        output: &ModalOutput,
        modal: &[Rectangle],
        start: Interval,
    ) -> Self {
        let own = output.weights.iter().zip(modal).zip(&regime.basis.values);
        let phasors = system.phasors(start);
        let tones = output.tones.iter().zip(phasors).zip(&system.frequencies);
        Self {
            terms: own
                .map(|((&w, &q), &rate)| (w * q, rate))
                .chain(tones.map(|((&z, e), &w)| (z * e, Rectangle::imaginary(w))))
                .collect(),
            constant: output.constant,
        }
    }

    /// The range of the derivative of this order (0: the signal) over an interval of time, by
    /// Taylor's formula at the centre with a bound of its second derivative.
    fn range(&self, order: usize, from: f64, to: f64) -> Interval {
        let middle = 0.5 * (from + to);
        let radius = (to - middle).max(middle - from).next_up();
        let (s, d) = (Interval::point(middle), Interval::point(radius));
        let mut value = if order == 0 {
            self.constant
        } else {
            Interval::ZERO
        };
        let (mut slope, mut bend) = (Interval::ZERO, Interval::ZERO);
        for &(weight, rate) in &self.terms {
            let mut term = weight * rate.scale(s).exp();
            for _ in 0..order {
                term = term * rate;
            }
            value += term.re;
            slope += (term * rate).re;
            let speed = rate.modulus();
            let growth = (Interval::point(rate.re.magnitude()) * d).exp();
            bend += term.modulus() * speed.square() * growth;
        }
        value
            + slope * Interval::around_zero(radius)
            + Interval::around_zero((bend * d.square()).hi()) * Interval::point(0.5)
    }
}
