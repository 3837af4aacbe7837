//! Eigenvalues and eigenvectors of the equations of motion in either regime, and the
//! modal coordinates in which each regime's motion falls apart.
//!
//! (λ²M + λC + K)u = 0 with M = 1 + α1 ppᵀ, C = α3 + α6 ppᵀ, K = diag(κ) + α4 ppᵀ is a
//! diagonal problem changed by one rank: u_j = p_j/D_j(λ) with D_j = λ² + α3λ + κ_j, and
//! λ solves the scalar characteristic equation of [`TipLoad`]'s beam. That costs O(N²)
//! for all pairs and loses no digits at any N. (A tip mass far above the beam's costs the
//! lowest frequency's digits in proportion: relative errors are about ε(1 + 4α1).)

mod recent;
mod secular;

use nalgebra::{Complex, DMatrix};
use nanotap_arithmetic::ComplexFunctions as _;

pub(crate) use recent::eigenbasis;
pub use secular::TipLoad;
use secular::{Factor, Roots, Secular};

use crate::beam::Modes;
use crate::cantilever::Cantilever;
use crate::galerkin::{Galerkin, Regime};

/// Smallest [`Spectrum::separation`] that is accepted. Quantities computed from modal coordinates
/// have a relative error of about the rounding error over the separation; at this one four digits
/// are lost.
const LEAST_SEPARATION: f64 = 1e-4;

/// Separation below which uᵀ(2λM + C)u is taken as a product instead of a sum.
const CANCELLING: f64 = 0.3;

impl TipLoad {
    /// The load in one regime of a case: the mass always, spring and damper in contact.
    pub const fn of(case: &Cantilever, regime: Regime) -> Self {
        let (damping, stiffness) = match regime {
            Regime::Free => (0.0, 0.0),
            Regime::Contact => (case.alpha6, case.alpha4),
        };
        Self {
            mass: case.alpha1,
            damping,
            stiffness,
        }
    }
}

/// Why a regime has no usable eigenbasis.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SpectrumError {
    /// An eigenvector is missing, or nearly so.
    #[error(
        "the eigenvalue {eigenvalue} is (nearly) defective: separation {separation:.1e}, at \
         least {LEAST_SEPARATION:e} needed. A mode is close to critical damping; use a method \
         that needs no eigenvectors"
    )]
    Defective {
        /// Defective eigenvalue, in units of √(EI/(mL⁴)).
        eigenvalue: Complex<f64>,
        /// Value that [`Spectrum::separation`] would have, dimensionless, below the limit of 10⁻⁴.
        separation: f64,
    },
    /// The eigenvalues could not be distinguished, or the load is not valid.
    #[error(
        "the eigenvalues could not be separated: some (nearly) coincide, or mass, damping or \
         stiffness are not finite numbers ≥ 0. Use a method that needs no eigenvectors"
    )]
    NotSeparated,
}

impl From<SpectrumError> for nanotap_error::Error {
    fn from(error: SpectrumError) -> Self {
        Self::numerics(error.to_string())
    }
}

/// The eigenbasis of one regime, m eigenvalues for N modes: one of each conjugate pair
/// and every real one, N ≤ m ≤ 2N, by ascending modulus.
///
/// With modal coordinates q = `left_state`·(x, v) the state is (x, v) =
/// Re(`right_state`·q), and free motion is q_k(t) = e^{λ_k t} q_k(0).
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// λ_k, with Im λ_k ≥ 0.
    pub eigenvalues: Vec<Complex<f64>>,
    /// w_k, dimensionless, length m: 2 for a conjugate pair, 1 for a real eigenvalue.
    pub weights: Vec<f64>,
    /// u_k, displacement shapes as columns, N×m, their largest entry 1 in size.
    pub right: DMatrix<Complex<f64>>,
    /// p·u_k, the tip's displacement in each shape.
    pub tip: Vec<Complex<f64>>,
    /// Columns w_k (u_k, λ_k u_k), 2N×m.
    pub right_state: DMatrix<Complex<f64>>,
    /// Rows u_kᵀ(λ_k M + C, M) / u_kᵀ(2λ_k M + C)u_k, m×2N.
    pub left_state: DMatrix<Complex<f64>>,
    /// The smallest |uᵀ(2λM + C)u| / (2|λ| ū·Mu): 1 without damping, 0 where an
    /// eigenvector is missing.
    pub separation: f64,
}

impl Spectrum {
    /// The eigenbasis of a beam with damping α3 and a load at its tip.
    ///
    /// # Errors
    /// [`SpectrumError`] where there is none, or too bad a one to work with, or where a
    /// parameter is not finite or negative.
    pub fn of_beam(modes: &Modes, beam_damping: f64, load: TipLoad) -> Result<Self, SpectrumError> {
        let parameters = [beam_damping, load.mass, load.damping, load.stiffness];
        if !parameters.iter().all(|x| x.is_finite() && *x >= 0.0) {
            return Err(SpectrumError::NotSeparated);
        }
        let secular = Secular {
            stiffness: &modes.stiffness,
            tip: modes.tip.as_slice(),
            beam_damping,
            load,
        };
        let factors = secular.factors().ok_or(SpectrumError::NotSeparated)?;
        let mut eigenvalues = Vec::with_capacity(factors.len());
        for (k, &factor) in factors.iter().enumerate() {
            match secular.roots(k, factor) {
                Roots::Conjugate(root) => eigenvalues.push((root, 2.0, k)),
                Roots::Real(pair) => {
                    let real = |root| (Complex::new(root, 0.0), 1.0, k);
                    eigenvalues.extend(pair.map(real));
                }
            }
        }
        eigenvalues.sort_by(|x, y| x.0.norm_sqr().total_cmp(&y.0.norm_sqr()));
        Self::with_vectors(&secular, &factors, &eigenvalues)
    }

    /// Eigenvectors for eigenvalues given with their weight and their factor's index.
    fn with_vectors(
        secular: &Secular,
        factors: &[Factor],
        eigenvalues: &[(Complex<f64>, f64, usize)],
    ) -> Result<Self, SpectrumError> {
        let (count, number) = (secular.tip.len(), eigenvalues.len());
        let zero = Complex::new(0.0, 0.0);
        let mut spectrum = Self {
            eigenvalues: eigenvalues.iter().map(|entry| entry.0).collect(),
            weights: eigenvalues.iter().map(|entry| entry.1).collect(),
            right: DMatrix::from_element(count, number, zero),
            tip: vec![zero; number],
            right_state: DMatrix::from_element(2 * count, number, zero),
            left_state: DMatrix::from_element(number, 2 * count, zero),
            separation: f64::INFINITY,
        };
        let TipLoad { mass, damping, .. } = secular.load;
        for (column, &(root, weight, k)) in eigenvalues.iter().enumerate() {
            let mut shape = spectrum.right.column_mut(column);
            let tip = secular.vector(k, factors[k], root, shape.as_mut_slice());
            spectrum.tip[column] = tip;

            let norm =
                shape.iter().map(nalgebra::Complex::norm_sqr).sum::<f64>() + mass * tip.norm_sqr();
            let square: Complex<f64> = shape.iter().map(|u| u * u).sum();
            let mut normaliser = (root * 2.0 + secular.beam_damping) * square
                + (root * (2.0 * mass) + damping) * tip * tip;
            let size = 2.0 * root.modulus() * norm;
            if normaliser.modulus() < CANCELLING * size {
                normaliser = secular.normaliser(k, factors, root, shape[k], tip);
            }
            let separation = normaliser.modulus() / size;
            if separation.is_nan() || separation < LEAST_SEPARATION {
                return Err(SpectrumError::Defective {
                    eigenvalue: root,
                    separation,
                });
            }
            spectrum.separation = spectrum.separation.min(separation);

            let inverse = normaliser.inv();
            let tip_momentum = tip * mass;
            let tip_force = tip * (root * mass + damping);
            for (j, u) in shape.iter().enumerate() {
                let p = secular.tip[j];
                spectrum.right_state[(j, column)] = u * weight;
                spectrum.right_state[(count + j, column)] = u * root * weight;
                let force = u * (root + secular.beam_damping) + tip_force * p;
                spectrum.left_state[(column, j)] = force * inverse;
                spectrum.left_state[(column, count + j)] = (u + tip_momentum * p) * inverse;
            }
        }
        Ok(spectrum)
    }

    /// N, the number of modes.
    pub fn modes(&self) -> usize {
        self.right.nrows()
    }

    /// m, the number of modal coordinates.
    pub fn count(&self) -> usize {
        self.eigenvalues.len()
    }
}

/// The N natural frequencies of undamped equations of any shape, ascending.
pub fn dense_frequencies(galerkin: &Galerkin, regime: Regime) -> Vec<f64> {
    let stiffness = &galerkin.stiffness[regime.index()];
    let Some(factor) = galerkin.mass.clone().cholesky() else {
        return vec![f64::NAN; galerkin.modes.count()];
    };
    let lower = factor.l();
    let half = lower.solve_lower_triangular(stiffness);
    let whole = half.and_then(|half| lower.solve_lower_triangular(&half.transpose()));
    let squares = whole.map(|whole| whole.symmetric_eigenvalues());
    let squares = squares.map_or_else(Vec::new, |values| values.iter().copied().collect());
    let mut frequencies: Vec<f64> = squares
        .into_iter()
        .map(|x: f64| x.max(0.0).sqrt())
        .collect();
    frequencies.sort_by(f64::total_cmp);
    frequencies
}

/// The eigenvalues, Im ≥ 0, of damped equations of any shape, by ascending size.
pub fn dense_eigenvalues(galerkin: &Galerkin, regime: Regime) -> Vec<Complex<f64>> {
    let (n, r) = (galerkin.modes.count(), regime.index());
    let Some(mass) = galerkin.mass.clone().cholesky() else {
        return Vec::new();
    };
    let mut companion = DMatrix::zeros(2 * n, 2 * n);
    companion.view_mut((0, n), (n, n)).fill_with_identity();
    let stiffness = -mass.solve(&galerkin.stiffness[r]);
    let damping = -mass.solve(&galerkin.damping[r]);
    companion.view_mut((n, 0), (n, n)).copy_from(&stiffness);
    companion.view_mut((n, n), (n, n)).copy_from(&damping);
    let all = companion.complex_eigenvalues();
    let mut upper: Vec<Complex<f64>> = all.iter().copied().filter(|z| z.im >= 0.0).collect();
    upper.sort_by(|a, b| a.modulus().total_cmp(&b.modulus()));
    upper
}

/// The N natural frequencies of the undamped Galerkin equations with tip mass and
/// spring, ascending: √μ with 1 + (α4 − α1μ) Σ p_j²/(κ_j − μ) = 0. Damping in `load` is
/// left out.
///
/// # Errors
/// [`SpectrumError::NotSeparated`] if mass or stiffness is not finite or negative.
pub fn frequencies(modes: &Modes, load: TipLoad) -> Result<Vec<f64>, SpectrumError> {
    if ![load.mass, load.stiffness]
        .iter()
        .all(|x| x.is_finite() && *x >= 0.0)
    {
        return Err(SpectrumError::NotSeparated);
    }
    let secular = Secular {
        stiffness: &modes.stiffness,
        tip: modes.tip.as_slice(),
        beam_damping: 0.0,
        load,
    };
    Ok(modes
        .stiffness
        .iter()
        .enumerate()
        .map(|(k, kappa)| (kappa + secular.undamped_shift(k)).sqrt())
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DVector, Schur};
    use proptest::prelude::*;

    type C = Complex<f64>;

    fn load(mass: f64, damping: f64, stiffness: f64) -> TipLoad {
        TipLoad {
            mass,
            damping,
            stiffness,
        }
    }

    fn spectrum(modes: usize, alpha3: f64, load: TipLoad) -> Result<Spectrum, SpectrumError> {
        Spectrum::of_beam(&Modes::new(modes).unwrap(), alpha3, load)
    }

    /// M, C and K.
    fn matrices(modes: &Modes, alpha3: f64, load: TipLoad) -> [DMatrix<f64>; 3] {
        let count = modes.count();
        let tip = &modes.tip * modes.tip.transpose();
        let identity = DMatrix::<f64>::identity(count, count);
        let bending = DMatrix::from_diagonal(&DVector::from_column_slice(&modes.stiffness));
        [
            &identity + &tip * load.mass,
            identity * alpha3 + &tip * load.damping,
            bending + tip * load.stiffness,
        ]
    }

    fn both_of_each_pair(spectrum: &Spectrum) -> Vec<C> {
        let mut all = Vec::new();
        for (root, weight) in spectrum.eigenvalues.iter().zip(&spectrum.weights) {
            all.push(*root);
            if *weight == 2.0 {
                all.push(root.conj());
            }
        }
        all
    }

    /// Largest error of (λ²M + λC + K)u = 0 relative to the terms that cancel, row by row.
    fn residual(spectrum: &Spectrum, [mass, damping, stiffness]: &[DMatrix<f64>; 3]) -> f64 {
        let mut worst: f64 = 0.0;
        for (k, &root) in spectrum.eigenvalues.iter().enumerate() {
            let shape = spectrum.right.column(k);
            for row in 0..spectrum.modes() {
                let (mut sum, mut size) = (C::new(0.0, 0.0), 0.0);
                for (column, u) in shape.iter().enumerate() {
                    let at = (row, column);
                    for term in [
                        root * root * u * mass[at],
                        root * u * damping[at],
                        u * stiffness[at],
                    ] {
                        sum += term;
                        size += term.modulus();
                    }
                }
                worst = worst.max(sum.modulus() / size);
            }
        }
        worst
    }

    /// Largest entry of Re(right · left) − 1 with displacements in units of velocity.
    fn incompleteness(spectrum: &Spectrum, modes: &Modes) -> f64 {
        let count = modes.count();
        let unit = |i: usize| {
            if i < count {
                modes.stiffness[i].sqrt()
            } else {
                1.0
            }
        };
        let product = (&spectrum.right_state * &spectrum.left_state).map(|z| z.re);
        let mut worst: f64 = 0.0;
        for i in 0..2 * count {
            for j in 0..2 * count {
                let expected = f64::from(u8::from(i == j));
                worst = worst.max((product[(i, j)] * unit(i) / unit(j) - expected).abs());
            }
        }
        worst
    }

    #[test]
    fn eigenvalues_agree_with_high_precision_ones() {
        // mpmath 1.3, 60 digits: secant iteration on the characteristic equation with
        // 60-digit β_j. Here (N, α3, load) and (index, Re λ, Im λ).
        let paper = load(0.1, 0.2, 20.0);
        let reference = [
            (3, 0.1, paper, 0, -0.2697430480737249, 7.802178205615048),
            (3, 0.1, paper, 1, -0.25454307293976414, 20.330385930062054),
            (3, 0.1, paper, 2, -0.14389569716832917, 56.180060577004745),
            (
                3,
                0.1,
                load(0.1, 0.0, 0.0),
                0,
                -0.035543810661119175,
                2.9678095280166157,
            ),
            (
                3,
                0.1,
                load(0.1, 0.0, 0.0),
                1,
                -0.04183443436300496,
                19.385097707899533,
            ),
            (
                3,
                0.1,
                load(0.1, 0.0, 0.0),
                2,
                -0.04534902770314859,
                56.01078830260549,
            ),
            (10, 0.1, paper, 0, -0.26780511674375074, 7.788883108608931),
            (10, 0.1, paper, 9, -0.05967941584562503, 862.2601588022324),
            (
                50,
                1.0,
                load(0.0, 5.0, 250.0),
                0,
                -0.7465515422076842,
                14.567969904464489,
            ),
            (
                50,
                1.0,
                load(0.0, 5.0, 250.0),
                25,
                -10.480198981072897,
                6417.130524533326,
            ),
            (
                50,
                1.0,
                load(0.0, 5.0, 250.0),
                49,
                -10.457151918004648,
                24182.330645187896,
            ),
            // A tip held by its damper: creeping, swinging, and coming to a stop.
            (20, 0.0, load(0.5, 1e6, 0.0), 0, -3.000015379852085e-06, 0.0),
            (
                20,
                0.0,
                load(0.5, 1e6, 0.0),
                1,
                -1.4581434821495143e-05,
                15.4185899170623,
            ),
            (20, 0.0, load(0.5, 1e6, 0.0), 20, -1951219.4733126797, 0.0),
        ];
        for (modes, alpha3, load, index, real, imaginary) in reference {
            let root = spectrum(modes, alpha3, load).unwrap().eigenvalues[index];
            for (ours, reference) in [(root.re, real), (root.im, imaginary)] {
                let error = (ours - reference).abs();
                // Real parts too, which are a millionth of λ in places.
                assert!(
                    error <= 5e-15 * reference.abs(),
                    "N = {modes}, {index}: {ours:e} {reference:e}"
                );
            }
        }
    }

    #[test]
    fn one_mode_solves_its_quadratic() {
        let kappa = Modes::new(1).unwrap().stiffness[0];
        for (alpha3, load) in [
            (0.1, load(0.1, 0.2, 20.0)),
            (0.0, load(0.3, 0.0, 5.0)),
            (0.1, load(0.1, 60.0, 20.0)),
            (50.0, load(0.0, 0.0, 0.0)),
            (0.0, load(0.0, 1e9, 0.0)),
        ] {
            let (m, c, k) = (
                1.0 + 4.0 * load.mass,
                alpha3 + 4.0 * load.damping,
                kappa + 4.0 * load.stiffness,
            );
            let discriminant = c * c - 4.0 * m * k;
            let roots = spectrum(1, alpha3, load).unwrap().eigenvalues;
            let expected = if discriminant < 0.0 {
                vec![C::new(-c, (-discriminant).sqrt()) / (2.0 * m)]
            } else {
                let q = 0.5 * (c + discriminant.sqrt());
                vec![C::from(-k / q), C::from(-q / m)]
            };
            assert_eq!(roots.len(), expected.len());
            for (root, expected) in roots.iter().zip(expected) {
                assert!(
                    (root - expected).modulus() < 4e-15 * expected.modulus(),
                    "{root} {expected}"
                );
            }
        }
    }

    #[test]
    fn without_load_the_modes_are_the_beams_own() {
        let modes = Modes::new(6).unwrap();
        // α3 = 10 makes mode 1 (κ = 12.4) overdamped and leaves the others swinging.
        let spectrum = spectrum(6, 10.0, load(0.0, 0.0, 0.0)).unwrap();
        assert_eq!(spectrum.weights, [1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0]);
        for (k, root) in spectrum.eigenvalues.iter().enumerate() {
            let mode = k.saturating_sub(1);
            let pole = root * (root + 10.0) + modes.stiffness[mode];
            assert!(pole.modulus() < 1e-14 * modes.stiffness[mode]);
            for j in 0..6 {
                let expected = f64::from(u8::from(j == mode));
                assert_eq!(spectrum.right[(j, k)], C::from(expected));
            }
        }
        assert!(incompleteness(&spectrum, &modes) < 1e-14);
    }

    /// κ_2 = α4/α1 exactly and no damping: the load's force vanishes at the second
    /// frequency, a root that coincides with a pole.
    #[test]
    fn a_root_on_a_pole_is_found() {
        let modes = Modes::new(4).unwrap();
        let load = load(0.125, 0.0, 0.125 * modes.stiffness[1]);
        let spectrum = spectrum(4, 0.0, load).unwrap();
        assert_eq!(
            spectrum.eigenvalues[1],
            C::new(0.0, modes.stiffness[1].sqrt())
        );
        assert!(residual(&spectrum, &matrices(&modes, 0.0, load)) < 1e-14);
        assert!(incompleteness(&spectrum, &modes) < 1e-13);
    }

    #[test]
    fn critical_damping_is_reported_as_defective() {
        let kappa = Modes::new(1).unwrap().stiffness[0];
        let critical = 2.0 * kappa.sqrt();
        for modes in [1, 2, 10] {
            for off in [0.0, 1e-14, -1e-14, 1e-10, -1e-10] {
                let error =
                    spectrum(modes, critical * (1.0 + off), load(0.0, 0.0, 0.0)).unwrap_err();
                assert!(
                    matches!(error, SpectrumError::Defective { separation, .. } if separation < 1e-4)
                );
            }
        }
    }

    /// Towards the contact damping at which a coupled mode turns overdamped, the basis
    /// stays good in proportion to its separation, and then it is refused.
    #[test]
    fn near_critical_contact_damping_the_basis_is_good_or_refused() {
        let modes = Modes::new(3).unwrap();
        let at = |damping: f64| Spectrum::of_beam(&modes, 0.1, load(0.1, damping, 20.0));
        let (mut swinging, mut overdamped) = (1.0, 40.0);
        let (mut smallest, mut refused): (f64, _) = (1.0, false);
        while overdamped - swinging > 1e-13 {
            let middle = 0.5 * (swinging + overdamped);
            match at(middle) {
                Ok(spectrum) => {
                    let error = incompleteness(&spectrum, &modes);
                    assert!(error < 1e-14 / spectrum.separation, "{error:e}");
                    smallest = smallest.min(spectrum.separation);
                    if spectrum.count() == 3 {
                        swinging = middle;
                    } else {
                        overdamped = middle;
                    }
                }
                Err(error) => {
                    assert!(matches!(error, SpectrumError::Defective { .. }));
                    refused = true;
                    break;
                }
            }
        }
        assert!(refused && smallest < 1e-2);
    }

    #[test]
    fn both_regimes_of_the_papers_case() {
        for case in [Cantilever::paper(), Cantilever::paper_eq24()] {
            let galerkin = Galerkin::new(&case).unwrap();
            for regime in Regime::ALL {
                let r = regime.index();
                let load = TipLoad::of(&case, regime);
                let spectrum = Spectrum::of_beam(&galerkin.modes, case.alpha3, load).unwrap();
                let matrices = [
                    galerkin.mass.clone(),
                    galerkin.damping[r].clone(),
                    galerkin.stiffness[r].clone(),
                ];
                assert!(residual(&spectrum, &matrices) < 1e-14);
            }
        }
    }

    /// Free motion by modal coordinates against the matrix exponential.
    #[test]
    fn modal_motion_is_the_matrix_exponential() {
        let modes = Modes::new(3).unwrap();
        for (alpha3, load) in [(0.1, load(0.1, 0.2, 20.0)), (0.1, load(0.1, 8.0, 20.0))] {
            let [mass, damping, stiffness] = matrices(&modes, alpha3, load);
            let inverse = mass.try_inverse().unwrap();
            let mut system = DMatrix::zeros(6, 6);
            system.view_mut((0, 3), (3, 3)).fill_with_identity();
            system
                .view_mut((3, 0), (3, 3))
                .copy_from(&-(&inverse * stiffness));
            system
                .view_mut((3, 3), (3, 3))
                .copy_from(&-(&inverse * damping));
            let start = DVector::from_vec(vec![0.4, -0.1, 0.03, 1.0, -2.0, 5.0]);
            let time = 0.37;
            let expected = nanotap_arithmetic::matrix_exp(&(system * time)) * &start;

            let spectrum = Spectrum::of_beam(&modes, alpha3, load).unwrap();
            let mut q = &spectrum.left_state * start.map(C::from);
            for (q, root) in q.iter_mut().zip(&spectrum.eigenvalues) {
                *q *= (root * time).exponential();
            }
            let end = (&spectrum.right_state * q).map(|z| z.re);
            assert!((end - expected).amax() < 1e-12);
        }
    }

    #[test]
    fn frequencies_in_contact_of_eq_25() {
        // The Galerkin values for N = 3 in the model's notes, to their digits.
        let ours = frequencies(&Modes::new(3).unwrap(), load(0.1, 0.0, 20.0)).unwrap();
        for (ours, reference) in ours.iter().zip([7.805, 20.337, 56.182]) {
            assert!((ours - reference).abs() < 5e-4, "{ours}");
        }
        // The paper's printed digits are those of N = 5.
        let ours = frequencies(&Modes::new(5).unwrap(), load(0.1, 0.0, 20.0)).unwrap();
        for (ours, printed) in ours.iter().zip([7.79, 20.33, 55.81]) {
            assert!((ours - printed).abs() < 5e-3 + 1e-9, "{ours}");
        }
    }

    #[test]
    fn nonsense_is_refused() {
        let modes = Modes::new(3).unwrap();
        for bad in [f64::NAN, f64::INFINITY, -1.0] {
            for load in [
                load(bad, 0.2, 20.0),
                load(0.1, bad, 20.0),
                load(0.1, 0.2, bad),
            ] {
                let refused = Err(SpectrumError::NotSeparated);
                assert_eq!(Spectrum::of_beam(&modes, 0.1, load), refused);
            }
            assert!(Spectrum::of_beam(&modes, bad, load(0.1, 0.2, 20.0)).is_err());
            assert!(frequencies(&modes, load(bad, 0.0, 1.0)).is_err());
            assert!(frequencies(&modes, load(0.1, 0.0, bad)).is_err());
        }
    }

    /// Eigenvalues of the equations as a matrix, displacements in units of velocity.
    fn dense_eigenvalues(modes: &Modes, [mass, damping, stiffness]: &[DMatrix<f64>; 3]) -> Vec<C> {
        let count = modes.count();
        let lu = mass.clone().lu();
        let unit = DVector::from_iterator(count, modes.stiffness.iter().map(|k| k.sqrt()));
        let mut system = DMatrix::zeros(2 * count, 2 * count);
        let force = lu.solve(stiffness).unwrap() * DMatrix::from_diagonal(&unit.map(f64::recip));
        system
            .view_mut((0, count), (count, count))
            .set_diagonal(&unit);
        system
            .view_mut((count, 0), (count, count))
            .copy_from(&-force);
        system
            .view_mut((count, count), (count, count))
            .copy_from(&-lu.solve(damping).unwrap());
        Schur::new(system).complex_eigenvalues().as_slice().to_vec()
    }

    fn ordinary() -> impl Strategy<Value = (usize, f64, TipLoad)> {
        (
            1..=20_usize,
            0.0..1.0_f64,
            0.0..1.0_f64,
            0.0..250.0_f64,
            0.0..5.0_f64,
        )
            .prop_map(|(modes, alpha1, alpha3, alpha4, alpha6)| {
                (modes, alpha3, load(alpha1, alpha6, alpha4))
            })
    }

    /// Zero or any size from 10⁻⁹ to 10⁹.
    fn any_size() -> impl Strategy<Value = f64> {
        prop_oneof![1 => Just(0.0), 6 => (-9.0..9.0_f64).prop_map(|e| 10_f64.powf(e))]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        #[test]
        fn basis_is_complete_and_solves_the_equations((count, alpha3, load) in ordinary()) {
            let modes = Modes::new(count).unwrap();
            let matrices = matrices(&modes, alpha3, load);
            let spectrum = match Spectrum::of_beam(&modes, alpha3, load) {
                Ok(spectrum) => spectrum,
                // Allowed on the way to overdamping only, and rare.
                Err(error) => {
                    let defective = matches!(error, SpectrumError::Defective { .. });
                    prop_assert!(defective);
                    return Ok(());
                }
            };
            prop_assert!(residual(&spectrum, &matrices) < 1e-13);
            prop_assert!(incompleteness(&spectrum, &modes) < 1e-12 / spectrum.separation);
            for k in 0..spectrum.count() {
                let shape = spectrum.right.column(k);
                let tip: C = shape.iter().zip(modes.tip.iter()).map(|(u, p)| u * p).sum();
                prop_assert!((tip - spectrum.tip[k]).modulus() < 1e-13);
                prop_assert!(shape.iter().all(|u| u.modulus() <= 1.0 + 1e-12));
            }
            // left · Re(right q) = q, in units in which each shape has energy one.
            let q = DVector::from_fn(spectrum.count(), |k, _| {
                let size = spectrum.eigenvalues[k].modulus().recip();
                if spectrum.weights[k] == 2.0 { C::new(0.6, -0.8) * size } else { C::from(size) }
            });
            let state = (&spectrum.right_state * &q).map(|z| C::from(z.re));
            let back = &spectrum.left_state * state;
            for k in 0..spectrum.count() {
                let error = (back[k] - q[k]).modulus() * spectrum.eigenvalues[k].modulus();
                prop_assert!(error < 1e-12 / spectrum.separation, "{error:e}");
            }
        }

        #[test]
        fn eigenvalues_agree_with_schur((count, alpha3, load) in ordinary()) {
            let modes = Modes::new(count).unwrap();
            let Ok(spectrum) = Spectrum::of_beam(&modes, alpha3, load) else { return Ok(()) };
            let mut dense = dense_eigenvalues(&modes, &matrices(&modes, alpha3, load));
            let ours = both_of_each_pair(&spectrum);
            prop_assert_eq!(ours.len(), dense.len());
            for root in ours {
                let distance = |k: &usize| (dense[*k] - root).modulus();
                let nearest = (0..dense.len()).min_by(|i, j| distance(i).total_cmp(&distance(j))).unwrap();
                let error = distance(&nearest) / root.modulus();
                prop_assert!(error < 1e-9 / spectrum.separation, "{root}: {error:e}");
                dense.swap_remove(nearest);
            }
        }

        #[test]
        fn trace_and_determinant((count, alpha3, load) in ordinary()) {
            let modes = Modes::new(count).unwrap();
            let Ok(spectrum) = Spectrum::of_beam(&modes, alpha3, load) else { return Ok(()) };
            let [mass, damping, stiffness] = matrices(&modes, alpha3, load);
            let roots = both_of_each_pair(&spectrum);
            let trace: C = roots.iter().sum();
            let expected = -mass.clone().lu().solve(&damping).unwrap().trace();
            prop_assert!((trace.re - expected).abs() <= 1e-12 * expected.abs());
            let product: f64 = roots.iter().map(|root| root.modulus().ln()).sum();
            let logarithm = |m: DMatrix<f64>| {
                2.0 * m.cholesky().unwrap().l().diagonal().iter().map(|d| d.ln()).sum::<f64>()
            };
            let expected = logarithm(stiffness) - logarithm(mass);
            prop_assert!((product - expected).abs() < 1e-11 * (1.0 + expected.abs()));
        }

        #[test]
        fn frequencies_are_those_of_the_symmetric_problem(
            count in 1..=20_usize, alpha1 in 0.0..1.0_f64, alpha4 in 0.0..250.0_f64,
        ) {
            let modes = Modes::new(count).unwrap();
            let load = load(alpha1, 0.0, alpha4);
            let [mass, _, stiffness] = matrices(&modes, 0.0, load);
            let factor = mass.cholesky().unwrap().unpack();
            let half = factor.solve_lower_triangular(&stiffness).unwrap().transpose();
            let full = factor.solve_lower_triangular(&half).unwrap();
            let mut dense: Vec<f64> = full.symmetric_eigen().eigenvalues.iter().copied().collect();
            dense.sort_by(f64::total_cmp);
            let ours = frequencies(&modes, load).unwrap();
            let exact = crate::exact_beam::frequencies(alpha1, alpha4, count).unwrap();
            for ((ours, dense), exact) in ours.iter().zip(&dense).zip(exact) {
                prop_assert!((ours * ours - dense).abs() < 1e-13 * dense + 1e-14 * modes.stiffness[count - 1]);
                // Galerkin frequencies are upper bounds (Rayleigh–Ritz).
                prop_assert!(*ours >= exact * (1.0 - 1e-14));
            }
        }

        /// Whatever the sizes: no panic, and what is returned is finite and right.
        #[test]
        fn any_load_gives_a_basis_or_a_reason(
            count in 1..=50_usize, alpha1 in any_size(), alpha3 in any_size(),
            alpha4 in any_size(), alpha6 in any_size(),
        ) {
            let modes = Modes::new(count).unwrap();
            let load = load(alpha1, alpha6, alpha4);
            if let Ok(spectrum) = Spectrum::of_beam(&modes, alpha3, load) {
                prop_assert_eq!(both_of_each_pair(&spectrum).len(), 2 * count);
                prop_assert!(spectrum.left_state.iter().all(|z| z.re.is_finite() && z.im.is_finite()));
                prop_assert!(spectrum.eigenvalues.iter().all(|z| z.re <= 0.0));
            }
        }
    }

    #[test]
    fn galerkin_frequencies_converge_to_the_exact_beams() {
        let load = load(0.1, 0.0, 20.0);
        let exact = crate::exact_beam::frequencies(0.1, 20.0, 3).unwrap();
        let error = |count: usize| {
            let galerkin = frequencies(&Modes::new(count).unwrap(), load).unwrap();
            [0, 1, 2].map(|k| galerkin[k] / exact[k] - 1.0)
        };
        let (coarse, fine) = (error(25), error(50));
        for k in 0..3 {
            // The tip's shear force is missing from every mode: third order in 1/N.
            let ratio = coarse[k] / fine[k];
            assert!((6.0..11.0).contains(&ratio), "{ratio}");
        }
    }
}
