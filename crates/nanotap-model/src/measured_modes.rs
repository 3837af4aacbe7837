//! Measured modes in the Galerkin equations, in place of those of the uniform beam, and Q control.
//!
//! Damping proportional to mass gives the higher modes a quality factor in proportion to their
//! frequency, several times that of real levers in air; and no lever is uniform. With the free
//! modes v of the Galerkin equations, K v = ω² M v and vᵀMv = 1, and u = Mv, a mode with its own
//! frequency and quality factor gets
//!
//! ```text
//! M + (s − 1) uuᵀ,   C + (sω′/Q − vᵀCv) uuᵀ,   K + (sω′² − ω²) uuᵀ,
//! ```
//!
//! ω′ is its measured frequency, Q its quality factor, and s = k (p·v)²/ω′² the modal mass that
//! follows from the stiffness k₂ or k₃ at the tip (1 without a stiffness; without Q the damping
//! stays in proportion to the modal mass). The shape of the mode stays the same, and so do all
//! other modes, except for the coupling by C, which has no part in the tip's mass. A base that
//! moves by y carries the mode along by (α₁p + I)·v y: mass and damping act on the sum.
//!
//! Limitation: measured numbers of a mode that the case does not have are ignored.
//!
//! The modes of a lever that was measured as a whole (see [`lever_mode`](crate::lever_mode)) are
//! already those of the equations; only the damping of each is corrected here.
//!
//! Q control feeds the deflection `w = p·X` of the tip back to a force at the tip, through a gain `G` and
//! a phase `θ` at the first free resonance `Ω₁`: `G (w cos θ + ẇ sin θ/Ω₁)`. That is a term of rank one in
//! each matrix, too: `C − (G sin θ/Ω₁) ppᵀ` and `K − (G cos θ) ppᵀ`.

use std::cell::LazyCell;
use std::ops::Deref;

use nalgebra::{DMatrix, DVector};

use crate::beam::Modes;
use crate::cantilever::Cantilever;
use crate::contact::dual::Dual;
use crate::lever_mode::LeverMode;
use crate::parameter::Parameter;
use nanotap_arithmetic::Scalar as _;

/// Correction by a measured mode or by Q control: a term of rank one in each matrix, with its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Correction {
    /// u = Mv of the free mode v, or p of Q control, length N.
    pub(crate) row: DVector<f64>,
    /// Derivative of u by the parameter, length N.
    pub(crate) row_change: DVector<f64>,
    /// (α₁p + I)·v, by which the mode moves with the base; 0 of Q control.
    pub(crate) base: Dual,
    /// Factor s − 1 of uuᵀ in M, dimensionless.
    pub(crate) mass: Dual,
    /// Factor of uuᵀ in C, dimensionless.
    pub(crate) damping: Dual,
    /// Factor of uuᵀ in K, dimensionless.
    pub(crate) stiffness: Dual,
}

impl Correction {
    /// Computes the corrections of a case, with derivatives by `parameter`.
    pub(crate) fn all(case: &Cantilever, beam: &Modes, parameter: Option<Parameter>) -> Vec<Self> {
        if !case.is_corrected() {
            return Vec::new();
        }
        let dual = |number| case.dual(number, parameter);
        let free = LazyCell::new(|| FreeModes::of(case, beam));
        let mut all = Self::of_measured_modes(case, beam, &free, &dual);
        if case.has_q_control() {
            all.push(Self::of_q_control(beam, &free, &dual));
        }
        all
    }

    fn of_measured_modes(
        case: &Cantilever,
        beam: &Modes,
        free: &impl Deref<Target = FreeModes>,
        dual: &impl Fn(Parameter) -> Dual,
    ) -> Vec<Self> {
        if !case.lever_modes.is_empty() {
            let modes = case.lever_modes.iter().take(case.modes).enumerate();
            let damped = modes.filter(|(_, mode)| mode.quality > 0.0);
            let correction = |(j, mode): (usize, &LeverMode)| {
                Self::of_damping(beam, j, mode, dual(Parameter::Alpha3))
            };
            return damped.map(correction).collect();
        }
        let measured = |p| Some(dual(p)).filter(|number| number.value != 0.0);
        let of_mode = |k: usize, [frequency, quality]: [Parameter; 2], stiffness: Option<Dual>| {
            let frequency = measured(frequency);
            let quality = measured(quality);
            let any = frequency.is_some() || quality.is_some() || stiffness.is_some();
            (any && k < free.squares.len())
                .then(|| free.correction(case, beam, k, dual, [frequency, quality, stiffness]))
        };
        [
            of_mode(
                1,
                [Parameter::Mode2Frequency, Parameter::Mode2Quality],
                measured(Parameter::Mode2Stiffness),
            ),
            of_mode(
                2,
                [Parameter::Mode3Frequency, Parameter::Mode3Quality],
                measured(Parameter::Mode3Stiffness),
            ),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// The damping of mode `j` of a measured lever, in place of α₃.
    fn of_damping(beam: &Modes, j: usize, mode: &LeverMode, alpha3: Dual) -> Self {
        let mut row = DVector::zeros(beam.count());
        row[j] = 1.0;
        Self {
            row_change: DVector::zeros(beam.count()),
            row,
            base: Dual::constant(beam.integral[j]),
            mass: Dual::constant(0.0),
            damping: Dual::constant(mode.frequency / mode.quality) - alpha3,
            stiffness: Dual::constant(0.0),
        }
    }

    /// Gain and phase of Q control; see the module.
    fn of_q_control(beam: &Modes, free: &FreeModes, dual: &impl Fn(Parameter) -> Dual) -> Self {
        let [gain, phase] = Parameter::Q_CONTROL.map(dual);
        let (sine, cosine) = phase.to_radians().sin_cos();
        let none = Dual::constant(0.0);
        let resonance = free.square(0, &beam.tip, dual(Parameter::Alpha1)).sqrt();
        Self {
            row: beam.tip.clone(),
            row_change: DVector::zeros(beam.count()),
            base: none,
            mass: none,
            damping: none - gain * sine / resonance,
            stiffness: none - gain * cosine,
        }
    }

    /// `number` times uuᵀ, or the derivative of that.
    pub(crate) fn square(&self, number: Dual, derivative: bool) -> DMatrix<f64> {
        let (u, du) = (&self.row, &self.row_change);
        if !derivative {
            return u * u.transpose() * number.value;
        }
        u * u.transpose() * number.derivative()
            + (u * du.transpose() + du * u.transpose()) * number.value
    }

    /// `number` times u, or the derivative of that.
    pub(crate) fn vector(&self, number: Dual, derivative: bool) -> DVector<f64> {
        if derivative {
            &self.row * number.derivative() + &self.row_change * number.value
        } else {
            &self.row * number.value
        }
    }
}

/// The free modes of the uniform beam with its tip.
struct FreeModes {
    /// Squared natural frequencies ω², ascending, in units of EI/(mL⁴).
    squares: Vec<f64>,
    /// Mode shapes v as columns, normalised to vᵀMv = 1.
    shapes: DMatrix<f64>,
}

impl FreeModes {
    fn of(case: &Cantilever, beam: &Modes) -> Self {
        let n = beam.count();
        let (p, root) = (&beam.tip, |j: usize| beam.stiffness[j].sqrt());
        // K^(−1/2) M K^(−1/2) has 1/ω² as eigenvalues, the lowest modes the most exact.
        let flexibility = DMatrix::from_fn(n, n, |i, j| {
            let mass = f64::from(u8::from(i == j)) + case.alpha1 * p[i] * p[j];
            mass / (root(i) * root(j))
        });
        let eigen = flexibility.symmetric_eigen();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let shapes = DMatrix::from_fn(n, n, |i, k| {
            let k = order[k];
            eigen.eigenvectors[(i, k)] / (root(i) * eigen.eigenvalues[k].sqrt())
        });
        Self {
            squares: order.iter().map(|k| 1.0 / eigen.eigenvalues[*k]).collect(),
            shapes,
        }
    }

    /// Squared natural frequency of mode `k`, of which only the tip's mass is varied.
    fn square(&self, k: usize, tip: &DVector<f64>, mass: Dual) -> Dual {
        let square = self.squares[k];
        let at_tip = self.shapes.column(k).dot(tip);
        Dual::new(square, -square * at_tip.powi(2) * mass.derivative())
    }

    fn correction(
        &self,
        case: &Cantilever,
        beam: &Modes,
        k: usize,
        dual: &impl Fn(Parameter) -> Dual,
        [frequency, quality, stiffness]: [Option<Dual>; 3],
    ) -> Correction {
        let (p, ratio) = (&beam.tip, dual(Parameter::Alpha1));
        let v = self.shapes.column(k).into_owned();
        let at_tip = |k: usize| self.shapes.column(k).dot(p);
        let square = self.squares[k];
        // Only the tip's mass changes the modes: ∂M = ppᵀ.
        let mut change = &v * (-0.5 * at_tip(k).powi(2));
        for (j, other) in self.squares.iter().enumerate().filter(|(j, _)| *j != k) {
            let part = -square * at_tip(j) * at_tip(k) / (square - other);
            change.axpy(part, &self.shapes.column(j), 1.0);
        }
        change *= ratio.derivative();
        let loaded = |x: &DVector<f64>| x + p * (case.alpha1 * p.dot(x));
        let carried = p * case.alpha1 + &beam.integral;
        let deflection = Dual::new(at_tip(k), change.dot(p));
        let own = self.square(k, p, ratio);
        let squared = frequency.map_or(own, |f| f * f);
        let mass = stiffness.map_or(Dual::constant(1.0), |stiffness| {
            stiffness * deflection * deflection / squared
        });
        let natural = dual(Parameter::Alpha3) * Dual::new(v.dot(&v), 2.0 * v.dot(&change));
        let one = Dual::constant(1.0);
        Correction {
            base: Dual::new(
                v.dot(&carried),
                change.dot(&carried) + ratio.derivative() * v.dot(p),
            ),
            mass: mass - one,
            damping: quality.map_or((mass - one) * natural, |quality| {
                mass * squared.sqrt() / quality - natural
            }),
            stiffness: mass * squared - own,
            row: loaded(&v),
            row_change: loaded(&change) + p * (at_tip(k) * ratio.derivative()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::galerkin::{Galerkin, Regime};
    use crate::parameter::Numbers;
    use crate::spectrum::{dense_eigenvalues, dense_frequencies};
    use nanotap_arithmetic::ComplexFunctions as _;

    /// Measured numbers in the order of [`Parameter::MEASURED`].
    fn numbers(measured: [f64; 6]) -> Numbers {
        let pairs = Parameter::MEASURED.into_iter().zip(measured);
        pairs.fold(Numbers::ZERO, |all, (of, number)| all.with(of, number))
    }

    /// A tip, a moving base, four modes; f2, Q2, k2, f3 and Q3 away from the beam's own.
    fn measured() -> Cantilever {
        Cantilever {
            modes: 4,
            alpha1: 0.13,
            further: numbers([21.0, 58.0, 90.0, 120.0, 110.0, 800.0]),
            ..Cantilever::paper()
        }
    }

    /// The corrected equations have the frequencies that were given, and the second mode the
    /// stiffness at the tip, ω²/(p·v)²; the first and the fourth mode stay.
    #[test]
    fn measured_modes_are_what_was_measured() {
        let case = measured();
        let equations = Galerkin::new(&case).unwrap();
        let found = dense_frequencies(&equations, Regime::Free);
        let plain = Cantilever {
            further: Numbers::ZERO,
            ..case
        };
        let beam = dense_frequencies(&Galerkin::new(&plain).unwrap(), Regime::Free);
        for (found, expected) in found.iter().zip([beam[0], 21.0, 58.0, beam[3]]) {
            assert!((found / expected - 1.0).abs() < 1e-11, "{found} {expected}");
        }
        // Far above all but the second mode's own resonance, X = (K − ω²M)⁻¹ p: the residue of
        // p·X at ω = 21 is (p·v)².
        let near = 21.0 * (1.0 + 1e-7);
        let dynamic = &equations.stiffness[0] - &equations.mass * (near * near);
        let tip = &equations.gap.tip;
        let give = tip.dot(&dynamic.lu().solve(tip).unwrap());
        let stiffness = 21.0 * 21.0 / (give * (21.0 * 21.0 - near * near));
        assert!((stiffness / 110.0 - 1.0).abs() < 1e-5, "{stiffness}");
    }

    /// Without a tip's mass the modes do not couple: |λ| = ω and 2|Re λ| = ω/Q.
    #[test]
    fn quality_factors_are_those_of_the_eigenvalues() {
        let mut case = measured();
        case.alpha1 = 0.0;
        let equations = Galerkin::new(&case).unwrap();
        let values = dense_eigenvalues(&equations, Regime::Free);
        for (k, (omega, quality)) in [(21.0, 90.0), (58.0, 120.0)].into_iter().enumerate() {
            let value = values[k + 1];
            assert!((value.modulus() / omega - 1.0).abs() < 1e-11);
            assert!((-0.5 * value.modulus() / value.re / quality - 1.0).abs() < 1e-10);
        }
    }

    /// Numbers that are the beam's own change nothing.
    #[test]
    fn the_beams_own_numbers_change_nothing() {
        let plain = Cantilever {
            further: Numbers::ZERO,
            alpha1: 0.0,
            ..measured()
        };
        let beam = Galerkin::new(&plain).unwrap();
        let frequencies = dense_frequencies(&beam, Regime::Free);
        let mut own = plain.clone();
        let [second, third] = [frequencies[1], frequencies[2]];
        own.further = numbers([
            second,
            third,
            second / plain.alpha3,
            third / plain.alpha3,
            // β⁴/φ(1)² with φ(1)² = 4.
            second.powi(2) / 4.0,
            third.powi(2) / 4.0,
        ]);
        let same = Galerkin::new(&own).unwrap();
        let far = |a: &DMatrix<f64>, b: &DMatrix<f64>| (a - b).amax() / a.amax();
        assert!(far(&beam.mass, &same.mass) < 1e-11);
        assert!(far(&beam.damping[0], &same.damping[0]) < 1e-10);
        assert!(far(&beam.stiffness[1], &same.stiffness[1]) < 1e-11);
        let force = |g: &Galerkin| g.forcing[0].sine.clone();
        assert!((force(&beam) - force(&same)).amax() < 1e-10 * force(&beam).amax());
    }

    #[test]
    fn derivatives_agree_with_central_differences() {
        let case = measured();
        let all = |g: &Galerkin| -> Vec<f64> {
            let matrices = [&g.mass, &g.damping[1], &g.stiffness[1]].into_iter();
            let matrices = matrices.flat_map(|m| m.iter().copied());
            let forcing = [&g.forcing[1].sine, &g.forcing[1].cosine].into_iter();
            matrices
                .chain(forcing.flat_map(|v| v.iter().copied()))
                .collect()
        };
        for parameter in Parameter::every() {
            let here = case.get(parameter);
            let step = 1e-5 * here;
            if here == 0.0 {
                continue;
            }
            let at = |value| all(&Galerkin::new(&case.clone().with(parameter, value)).unwrap());
            let change = Galerkin::new(&case).unwrap().derivative(parameter);
            let exact = all(&Galerkin {
                mass: change.mass,
                damping: change.damping,
                stiffness: change.stiffness,
                forcing: change.forcing,
                ..Galerkin::new(&case).unwrap()
            });
            let (low, high) = (at(here - step), at(here + step));
            for ((low, high), exact) in low.iter().zip(&high).zip(exact) {
                let difference = (high - low) / (2.0 * step);
                let size = (high.abs() + low.abs()) / here + exact.abs();
                assert!(
                    (difference - exact).abs() <= 1e-8 * size,
                    "{parameter}: {difference} {exact}"
                );
            }
        }
    }
}
