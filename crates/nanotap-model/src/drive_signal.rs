//! A drive of one shot: a signal in place of the tones.
//!
//! The signal multiplies the amplitude of the drive. It is cut into pieces, and on each it is taken as
//! a mean and a few tones that agree with it there to rounding, though not beyond. Under each piece
//! either engine computes the motion as exactly as under a periodic drive; the state goes on from one
//! to the next.

use std::f64::consts::{PI, TAU};

use nalgebra::{DMatrix, DVector};
use nanotap_flow::Complex;

/// Tones of a piece.
const TONES: usize = 12;
/// Period of the first of them over the length of the piece. The tones then need not have the value
/// of the beginning at the end.
const EXTENSION: f64 = 3.0;
/// Points at which they are fitted.
const POINTS: usize = 48;
/// Largest distance of a piece from the signal, over the signal's peak.
const CLOSE: f64 = 5e-13;
/// The same for each drive period before the piece: time, and with it the signal, is rounded.
const ROUNDED: f64 = 1e-14;
/// Largest number of halvings of a piece.
const HALVINGS: usize = 24;
/// Largest number of pieces of a signal.
pub const MAX_PIECES: usize = 200_000;
/// Largest number of oscillations of a signal: a piece holds those of its last tone at most.
pub const MAX_TURNS: f64 = MAX_PIECES as f64 * TONES as f64 / EXTENSION;

/// A piece of a signal, in units of the drive's amplitude. Its time begins at 0.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveSignal {
    /// Length, in periods of the case's drive.
    pub length: f64,
    /// Constant part.
    pub mean: f64,
    /// Frequency over that of the drive, and z of `Re(z e^{iωt})`, of each tone.
    pub tones: Vec<(f64, Complex)>,
}

impl DriveSignal {
    /// No drive, for so many drive periods.
    pub fn silence(length: f64) -> Self {
        Self {
            length,
            mean: 0.0,
            tones: vec![(1.0, Complex::new(0.0, 0.0))],
        }
    }

    /// The signal at a time in drive periods.
    pub fn at(&self, time: f64) -> f64 {
        let tone = |(multiple, z): &(f64, Complex)| {
            let (sin, cos) = nanotap_arithmetic::sin_cos(TAU * multiple * time);
            z.re * cos - z.im * sin
        };
        self.mean + self.tones.iter().map(tone).sum::<f64>()
    }
}

/// Cuts signals into pieces; the fit is prepared once.
#[derive(Debug)]
pub struct Pieces {
    /// Points of a piece, from 0 to 1.
    points: Vec<f64>,
    /// Mean, cosines and sines there, and the factors Qᵀ and R of their least squares. The tones are
    /// nearly dependent on a piece: how they are weighed against each other is uncertain by a
    /// thousandth, their sum is not.
    basis: DMatrix<f64>,
    transposed: DMatrix<f64>,
    triangle: DMatrix<f64>,
}

impl Default for Pieces {
    fn default() -> Self {
        Self::new()
    }
}

impl Pieces {
    /// Prepares the fit.
    pub fn new() -> Self {
        // Points that gather at the ends, as interpolation needs them.
        let point =
            |k: usize| 0.5 - 0.5 * nanotap_arithmetic::cos(PI * k as f64 / (POINTS - 1) as f64);
        let points: Vec<f64> = (0..POINTS).map(point).collect();
        let basis = DMatrix::from_fn(POINTS, 2 * TONES + 1, |row, column| {
            let tone = column.div_ceil(2) as f64;
            let (sin, cos) = nanotap_arithmetic::sin_cos(TAU * tone * points[row] / EXTENSION);
            if column % 2 == 1 {
                cos
            } else if column == 0 {
                1.0
            } else {
                sin
            }
        });
        let parts = basis.clone().qr();
        Self {
            points,
            transposed: parts.q().transpose(),
            triangle: parts.r(),
            basis,
        }
    }

    /// Pieces of a signal `at` a time in drive periods, smooth between the instants `knots`; `None`
    /// if there would be more than [`MAX_PIECES`].
    pub fn of(
        &self,
        at: &dyn Fn(f64) -> f64,
        knots: &[f64],
        peak: f64,
    ) -> Option<Vec<DriveSignal>> {
        let mut pieces = Vec::new();
        for ends in knots.windows(2) {
            self.add(&mut pieces, at, [ends[0], ends[1]], peak, HALVINGS);
            if pieces.len() > MAX_PIECES {
                return None;
            }
        }
        Some(pieces)
    }

    fn add(
        &self,
        pieces: &mut Vec<DriveSignal>,
        at: &dyn Fn(f64) -> f64,
        [from, to]: [f64; 2],
        peak: f64,
        halvings: usize,
    ) {
        let length = to - from;
        let values = self.points.iter().map(|x| at(from + length * x));
        let values = DVector::from_iterator(POINTS, values);
        let found = &self.transposed * &values;
        let found = self.triangle.solve_upper_triangular(&found);
        let found = found.unwrap_or_else(|| DVector::zeros(2 * TONES + 1));
        let off = (&self.basis * &found - values).amax();
        if off > (CLOSE + ROUNDED * to) * peak && halvings > 0 && pieces.len() <= MAX_PIECES {
            let middle = 0.5 * (from + to);
            self.add(pieces, at, [from, middle], peak, halvings - 1);
            self.add(pieces, at, [middle, to], peak, halvings - 1);
            return;
        }
        let tone = |k: usize| {
            let z = Complex::new(found[2 * k - 1], -found[2 * k]);
            (k as f64 / (EXTENSION * length), z)
        };
        pieces.push(DriveSignal {
            length,
            mean: found[0],
            tones: (1..=TONES).map(tone).collect(),
        });
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::ComplexField as _;

    use super::*;

    /// A signal at a time, by its pieces.
    fn value(pieces: &[DriveSignal], mut time: f64) -> f64 {
        for piece in pieces {
            if time <= piece.length {
                return piece.at(time);
            }
            time -= piece.length;
        }
        f64::NAN
    }

    #[test]
    fn pieces_are_the_signal() {
        let gauss = |t: f64| (-0.5 * ((t - 4.0) / 0.3_f64).powi(2)).exp() * (5.0 * t * t).sin();
        let pieces = Pieces::new()
            .of(&gauss, &[0.0, 1.0, 5.0, 8.0], 1.0)
            .unwrap();
        for k in 0..=800 {
            let time = 0.01 * f64::from(k);
            let off = (value(&pieces, time) - gauss(time)).abs();
            assert!(off < 1e-12, "{time}: {off}");
        }
        let largest = pieces.iter().flat_map(|piece| &piece.tones);
        let largest = largest.map(|(_, z)| z.modulus()).fold(0.0, f64::max);
        assert!(largest < 50.0, "{largest}");
        assert!(pieces.len() < 200, "{}", pieces.len());
    }

    #[test]
    fn a_cubic_needs_one_piece() {
        let cubic = |t: f64| 1.0 + t * (0.3 - t * (0.7 - 0.2 * t));
        let pieces = Pieces::new().of(&cubic, &[0.0, 1.5], 1.0).unwrap();
        assert_eq!(pieces.len(), 1);
    }

    #[test]
    fn a_signal_that_is_nowhere_smooth_ends() {
        let rough = |t: f64| (1e9 * t).sin().signum();
        assert_eq!(Pieces::new().of(&rough, &[0.0, 1.0], 1.0), None);
    }
}
