//! The modes of a uniform clamped-free beam of length 1.
//!
//! φ_j is normalised by ∫₀¹φ_j² dξ = 1 and its wave number β_j is the j-th root of
//! cos β cosh β = −1. Written with hyperbolic functions the shapes lose all digits
//! above about j = 12; here every formula is free of cancellation and overflow.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::{Arc, OnceLock};

use nalgebra::DVector;

use crate::cantilever::Cantilever;
use crate::lever_mode::LeverMode;

/// The largest number of modes this crate works with.
pub const MAX_MODES: usize = 50;

/// A mode number or a number of modes outside 1 … 50.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{given} is not a number of beam modes: 1 to {MAX_MODES} are provided")]
pub struct ModeCountError {
    /// Refused mode number or number of modes.
    pub given: usize,
}

/// One mode of the clamped-free beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// j = 1, 2, …
    pub number: usize,
    /// Wave number β_j, a root of cos β cosh β = −1.
    pub beta: f64,
    /// σ_j = (sinh β − sin β)/(cosh β + cos β).
    pub sigma: f64,
    /// β_j less (j − ½)π, to full relative precision; it vanishes like e^{−β}.
    excess: f64,
}

impl Mode {
    /// The mode with the given number, 1 to 50.
    ///
    /// # Errors
    /// [`ModeCountError`] for any other number.
    pub fn new(number: usize) -> Result<Self, ModeCountError> {
        if !(1..=MAX_MODES).contains(&number) {
            return Err(ModeCountError { given: number });
        }
        let sign = alternating(number);
        let half_turns = number as f64 - 0.5;
        let centre = half_turns * PI;
        let excess = excess(centre, sign);
        let beta = centre + excess;
        // At a root cos β = −sech β and sin β = ±tanh β, which turns σ into
        // tanh(β/2) for odd and coth(β/2) for even modes.
        let half = nanotap_arithmetic::tanh(0.5 * beta);
        Ok(Self {
            number,
            beta,
            sigma: if sign > 0.0 { half } else { half.recip() },
            excess,
        })
    }

    /// +1 for odd, −1 for even modes: the sign of the tip's deflection.
    fn sign(&self) -> f64 {
        alternating(self.number)
    }

    /// Returns φ_j(1) = 2(−1)^(j+1), the tip's deflection in the mode, dimensionless.
    pub fn tip(&self) -> f64 {
        2.0 * self.sign()
    }

    /// Returns φ_j′(1) = 2(−1)^(j+1) σ_j β_j, the slope dφ_j/dξ at the tip, dimensionless.
    pub fn tip_slope(&self) -> f64 {
        2.0 * self.sign() * self.sigma * self.beta
    }

    /// Returns ∫₀¹φ_j dξ = 2σ_j/β_j, by which a force spread evenly over the beam drives the mode.
    pub fn integral(&self) -> f64 {
        2.0 * self.sigma / self.beta
    }

    /// Returns β_j⁴ = ∫₀¹φ_j φ_j'''' dξ, dimensionless: the modal stiffness, and the squared
    /// natural frequency, because the modal mass is 1.
    pub fn stiffness(&self) -> f64 {
        (self.beta * self.beta).powi(2)
    }

    /// φ_j(ξ) for ξ in [0, 1]; NaN outside.
    pub fn shape(&self, xi: f64) -> f64 {
        if !(0.0..=1.0).contains(&xi) {
            return f64::NAN;
        }
        let x = self.beta * xi;
        if x < 1.0 {
            // cosh x − cos x − σ(sinh x − sin x), as sums of positive terms.
            return cosh_minus_cos(x) - self.sigma * sinh_minus_sin(x);
        }
        let (sin, cos) = self.sin_cos(xi);
        self.clamp_wave(x) + self.tip_wave(xi) - cos + self.sigma * sin
    }

    /// φ_j′(ξ) for ξ in [0, 1]; NaN outside.
    pub fn slope(&self, xi: f64) -> f64 {
        if !(0.0..=1.0).contains(&xi) {
            return f64::NAN;
        }
        let x = self.beta * xi;
        if x < 1.0 {
            return self.beta
                * (nanotap_arithmetic::sinh(x) + nanotap_arithmetic::sin(x)
                    - self.sigma * cosh_minus_cos(x));
        }
        let (sin, cos) = self.sin_cos(xi);
        self.beta * (self.tip_wave(xi) - self.clamp_wave(x) + sin + self.sigma * cos)
    }

    /// φ_j″(ξ) for ξ in [0, 1]; NaN outside.
    ///
    /// φ″ solves the beam equation with the ends exchanged, so
    /// φ_j″(ξ) = (−1)^(j+1) β_j² φ_j(1 − ξ).
    pub fn curvature(&self, xi: f64) -> f64 {
        self.sign() * self.beta.powi(2) * self.shape(1.0 - xi)
    }

    /// φ_j‴(ξ) = −(−1)^(j+1) β_j² φ_j′(1 − ξ) for ξ in [0, 1]; NaN outside.
    pub fn third_derivative(&self, xi: f64) -> f64 {
        -self.sign() * self.beta.powi(2) * self.slope(1.0 - xi)
    }

    /// The part of cosh x − σ sinh x that decays from the clamp: (1 + σ)/2 · e^{−x}.
    fn clamp_wave(&self, x: f64) -> f64 {
        0.5 * (1.0 + self.sigma) * nanotap_arithmetic::exp(-x)
    }

    /// The part of cosh x − σ sinh x that decays from the tip, (1 − σ)/2 · e^x, with
    /// (1 − σ)/2 = s/(e^β + s), s = (−1)^(j+1).
    fn tip_wave(&self, xi: f64) -> f64 {
        self.sign() * nanotap_arithmetic::exp(-self.beta * (1.0 - xi))
            / (1.0 + self.sign() * nanotap_arithmetic::exp(-self.beta))
    }

    /// sin β_jξ and cos β_jξ. The product β_jξ, rounded, would cost two digits at
    /// j = 50; whole turns are taken off exactly instead.
    fn sin_cos(&self, xi: f64) -> (f64, f64) {
        let half_turns = self.number as f64 - 0.5;
        let product = half_turns * xi;
        let rest = half_turns.mul_add(xi, -product);
        let reduced = product - 2.0 * (0.5 * product).round();
        nanotap_arithmetic::sin_cos(PI * reduced + (PI * rest + self.excess * xi))
    }
}

/// Returns (−1)^(number+1): 1 for odd, −1 for even numbers.
fn alternating(number: usize) -> f64 {
    if number % 2 == 1 { 1.0 } else { -1.0 }
}

/// The root e of cos β + sech β = 0 with β = centre + e, centre = (j − ½)π, where the
/// equation reads sin e = ± sech(centre + e): Newton from the asymptotic value.
fn excess(centre: f64, sign: f64) -> f64 {
    let mut excess = nanotap_arithmetic::asin(
        (sign * nanotap_arithmetic::cosh(centre).recip()).clamp(-1.0, 1.0),
    );
    for _ in 0..20 {
        let beta = centre + excess;
        let sech = sign * nanotap_arithmetic::cosh(beta).recip();
        let step = (nanotap_arithmetic::sin(excess) - sech)
            / (nanotap_arithmetic::cos(excess) + sech * nanotap_arithmetic::tanh(beta));
        excess = (excess - step).clamp(-FRAC_PI_2, FRAC_PI_2);
        if step.abs() <= f64::EPSILON * excess.abs() {
            break;
        }
    }
    excess
}

/// cosh x − cos x without cancellation.
fn cosh_minus_cos(x: f64) -> f64 {
    2.0 * (nanotap_arithmetic::sinh(0.5 * x).powi(2) + nanotap_arithmetic::sin(0.5 * x).powi(2))
}

/// sinh x − sin x for |x| < 1, by its Taylor series 2 Σ x^{4k+3}/(4k+3)!.
fn sinh_minus_sin(x: f64) -> f64 {
    let x4 = x.powi(4);
    let series = 1.0 + x4 / 840.0 * (1.0 + x4 / 7920.0 * (1.0 + x4 / 32760.0));
    x.powi(3) / 3.0 * series
}

/// The first N modes, with the vectors that the Galerkin equations need. Index 0 of every vector
/// belongs to mode 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Modes {
    all: Vec<Mode>,
    /// Wave numbers β_j, ascending, dimensionless, length N.
    pub beta: Vec<f64>,
    /// Shape coefficients σ_j = (sinh β_j − sin β_j)/(cosh β_j + cos β_j), length N.
    pub sigma: Vec<f64>,
    /// Modal stiffnesses β_j⁴, which are the squared natural frequencies, dimensionless, length N.
    pub stiffness: Vec<f64>,
    /// Tip deflections p_j = φ_j(1), dimensionless, length N.
    pub tip: DVector<f64>,
    /// Tip slopes φ_j′(1) = dφ_j/dξ at ξ = 1, dimensionless, length N.
    pub tip_slope: DVector<f64>,
    /// Integrals I_j = ∫₀¹φ_j dξ over the beam, dimensionless, length N: the modes' part in the motion
    /// of the base.
    pub integral: DVector<f64>,
    /// Generalised forces L_j of a unit force that is spread evenly over the beam, length N: I_j, except
    /// for a lever whose modes were measured.
    pub even_load: DVector<f64>,
    /// Factors of the uniform beam's shapes φ_j, length N: 1, except for a lever whose modes were measured.
    scale: Vec<f64>,
}

impl Modes {
    /// The first `count` modes, 1 to 50.
    ///
    /// # Errors
    /// [`ModeCountError`] for any other count.
    pub fn new(count: usize) -> Result<Self, ModeCountError> {
        if !(1..=MAX_MODES).contains(&count) {
            return Err(ModeCountError { given: count });
        }
        let modes = (1..=count).map(Mode::new).collect::<Result<Vec<_>, _>>()?;
        let vector = |of: fn(&Mode) -> f64| DVector::from_iterator(count, modes.iter().map(of));
        Ok(Self {
            beta: modes.iter().map(|mode| mode.beta).collect(),
            sigma: modes.iter().map(|mode| mode.sigma).collect(),
            stiffness: modes.iter().map(Mode::stiffness).collect(),
            tip: vector(Mode::tip),
            tip_slope: vector(Mode::tip_slope),
            integral: vector(Mode::integral),
            even_load: vector(Mode::integral),
            scale: vec![1.0; count],
            all: modes,
        })
    }

    /// Returns the modes of a lever as they were measured, frequency and stiffness in model units, in
    /// coordinates with a modal mass of 1; see [`lever_mode`](crate::lever_mode).
    ///
    /// # Errors
    /// As [`Modes::new`].
    pub fn measured(measured: &[LeverMode]) -> Result<Self, ModeCountError> {
        let mut modes = Self::new(measured.len())?;
        for (j, mode) in measured.iter().enumerate() {
            let deflection = mode.frequency / mode.stiffness.sqrt();
            let scale = deflection / modes.tip[j].abs();
            modes.stiffness[j] = mode.frequency * mode.frequency;
            modes.tip[j] = deflection.copysign(modes.tip[j]);
            modes.tip_slope[j] *= scale;
            modes.integral[j] = mode.participation_of(j + 1)? / modes.tip[j];
            modes.even_load[j] *= scale;
            modes.scale[j] = scale;
        }
        Ok(modes)
    }

    /// Returns the modes of a case: those of the uniform beam, or of a lever whose modes were measured.
    ///
    /// # Errors
    /// As [`Modes::new`].
    pub fn of(case: &Cantilever) -> Result<Arc<Self>, ModeCountError> {
        match case.lever_modes.get(..case.modes) {
            Some(measured) if !case.lever_modes.is_empty() => {
                Self::measured(measured).map(Arc::new)
            }
            _ => Self::shared(case.modes),
        }
    }

    /// Returns by which fraction these modes are stiffer than the beam against a static force at
    /// the tip: EI/L³ over Σφ_j(1)²/β_j⁴, relative to 3EI/L³, less 1.
    pub fn static_excess(&self) -> f64 {
        let modes = self.tip.iter().zip(&self.stiffness);
        let give: f64 = modes.map(|(tip, stiffness)| tip.powi(2) / stiffness).sum();
        1.0 / (3.0 * give) - 1.0
    }

    /// Returns the first `count` modes, computed once per run of the program and shared: they
    /// depend on nothing else, and a fine sweep needs them at each of its values.
    ///
    /// # Errors
    /// As [`Modes::new`].
    pub fn shared(count: usize) -> Result<Arc<Self>, ModeCountError> {
        static KNOWN: [OnceLock<Arc<Modes>>; MAX_MODES] = [const { OnceLock::new() }; MAX_MODES];
        let Some(known) = count.checked_sub(1).and_then(|k| KNOWN.get(k)) else {
            return Err(ModeCountError { given: count });
        };
        if let Some(modes) = known.get() {
            return Ok(Arc::clone(modes));
        }
        let modes = Arc::new(Self::new(count)?);
        Ok(Arc::clone(known.get_or_init(|| modes)))
    }

    /// The number of modes N.
    pub fn count(&self) -> usize {
        self.all.len()
    }

    /// The modes in order, mode 1 first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Mode> {
        self.all.iter()
    }

    /// (φ_1(ξ) … φ_N(ξ)); NaN where ξ is outside [0, 1].
    pub fn shapes(&self, xi: f64) -> DVector<f64> {
        let scaled = self.iter().zip(&self.scale);
        DVector::from_iterator(
            self.count(),
            scaled.map(|(mode, scale)| mode.shape(xi) * scale),
        )
    }

    /// (φ_1′(ξ) … φ_N′(ξ)); NaN where ξ is outside [0, 1].
    pub fn slopes(&self, xi: f64) -> DVector<f64> {
        let scaled = self.iter().zip(&self.scale);
        DVector::from_iterator(
            self.count(),
            scaled.map(|(mode, scale)| mode.slope(xi) * scale),
        )
    }

    /// The deflection Σ a_j φ_j(ξ) for modal amplitudes a_1 …; amplitudes beyond the
    /// N-th are ignored, missing ones are zero.
    pub fn deflection(&self, amplitudes: &[f64], xi: f64) -> f64 {
        let shapes = self.shapes(xi);
        let parts = shapes.iter().zip(amplitudes);
        parts.map(|(shape, amplitude)| amplitude * shape).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn modes() -> Modes {
        Modes::new(MAX_MODES).unwrap()
    }

    fn assert_relative(value: f64, reference: f64, tolerance: f64, what: &str) {
        assert!(
            (value - reference).abs() <= tolerance * reference.abs(),
            "{what}: {value:e} instead of {reference:e}"
        );
    }

    #[test]
    fn roots_agree_with_high_precision_ones() {
        // mpmath 1.3, 160 digits: findroot(lambda b: cos(b) + sech(b), (j - 1/2)*pi), and
        // (sinh(b) - sin(b))/(cosh(b) + cos(b)) there.
        let reference = [
            (1, 1.8751040687119611, 0.7340955137589128),
            (2, 4.694091132974175, 1.0184673187592195),
            (3, 7.854757438237613, 0.9992244965174283),
            (7, 20.42035225104125, 0.9999999972924051),
            (12, 36.12831551628262, 1.0000000000000004),
            (25, 76.96902001294994, 1.0),
            (50, 155.50883635269477, 1.0),
        ];
        for (number, beta, sigma) in reference {
            let mode = Mode::new(number).unwrap();
            assert_relative(mode.beta, beta, f64::EPSILON, "beta");
            assert_relative(mode.sigma, sigma, f64::EPSILON, "sigma");
        }
    }

    #[test]
    fn all_roots_satisfy_the_frequency_equation_and_none_is_missing() {
        let beta = modes().beta;
        for (index, &root) in beta.iter().enumerate() {
            // cos is steep at a root: an ulp of β is an ulp of β in the residual.
            assert!((root.cos() + root.cosh().recip()).abs() <= f64::EPSILON * root);
            // One root between consecutive extrema of cos β, and no other fits.
            assert!((root - (index as f64 + 0.5) * PI).abs() < 0.31);
        }
    }

    #[test]
    fn shapes_agree_with_high_precision_ones_everywhere_along_the_beam() {
        // mpmath 1.3, 160 digits: the textbook form cosh y − cos y − σ(sinh y − sin y)
        // with y = β ξ, and its first three derivatives. The last two rows lie where
        // the shape, or its curvature, is small.
        let reference = [
            (
                1,
                0.5,
                [
                    0.6790462257306479,
                    2.326108900682365,
                    2.387536897686358,
                    -8.178634410993297,
                ],
            ),
            (
                1,
                0.0009765625,
                [
                    3.35163098155568e-06,
                    0.006862601714694692,
                    7.022577774696403,
                    -9.679628589076499,
                ],
            ),
            (
                3,
                0.75,
                [
                    -1.162903256412033,
                    5.331510278116294,
                    89.39924683368362,
                    -195.6481071965824,
                ],
            ),
            (
                12,
                0.375,
                [
                    0.27590068567961934,
                    50.11136595626014,
                    -360.11738935077176,
                    -65408.24333380612,
                ],
            ),
            (
                25,
                0.90625,
                [
                    -0.20677337806476784,
                    107.72904885575936,
                    1233.6798863030635,
                    -637541.5115717488,
                ],
            ),
            (
                50,
                0.375,
                [
                    1.1758756024193586,
                    122.1825087069572,
                    -28436.197557645868,
                    -2954739.3861487103,
                ],
            ),
            (
                50,
                0.0009765625,
                [
                    0.02189527200334196,
                    43.6461680790791,
                    41021.97728722696,
                    -7517116.046738434,
                ],
            ),
            (
                50,
                0.9990234375,
                [
                    -1.696314781794075,
                    -310.84301415461647,
                    -529.4933230899512,
                    1055495.203384855,
                ],
            ),
        ];
        for (number, xi, values) in reference {
            let mode = Mode::new(number).unwrap();
            let ours = [
                mode.shape(xi),
                mode.slope(xi),
                mode.curvature(xi),
                mode.third_derivative(xi),
            ];
            for (order, (value, reference)) in ours.into_iter().zip(values).enumerate() {
                assert_relative(
                    value,
                    reference,
                    1e-14,
                    &format!("φ_{number}, derivative {order}"),
                );
            }
        }
    }

    #[test]
    fn modes_are_orthonormal() {
        let modes = modes();
        // 50 panels with 20 nodes each: β = 155 has half a wave in a panel.
        let (nodes, weights) = gauss_legendre(20);
        let panels = 50;
        let mut gram = nalgebra::DMatrix::<f64>::zeros(MAX_MODES, MAX_MODES);
        for panel in 0..panels {
            for (node, weight) in nodes.iter().zip(&weights) {
                let xi = (panel as f64 + 0.5 + 0.5 * node) / panels as f64;
                let shapes = modes.shapes(xi);
                gram.ger(0.5 * weight / panels as f64, &shapes, &shapes, 1.0);
            }
        }
        let error = (gram - nalgebra::DMatrix::identity(MAX_MODES, MAX_MODES)).amax();
        assert!(error < 1e-12, "{error:e}");
    }

    #[test]
    fn closed_forms_agree_with_the_shapes() {
        let (nodes, weights) = gauss_legendre(20);
        for mode in modes().iter() {
            assert_relative(mode.shape(1.0), mode.tip(), 1e-14, "tip");
            assert_relative(mode.slope(1.0), mode.tip_slope(), 1e-14, "tip slope");
            let panels = mode.number;
            let integral: f64 = (0..panels)
                .flat_map(|panel| nodes.iter().zip(&weights).map(move |pair| (panel, pair)))
                .map(|(panel, (node, weight))| {
                    let xi = (panel as f64 + 0.5 + 0.5 * node) / panels as f64;
                    0.5 * weight / panels as f64 * mode.shape(xi)
                })
                .sum();
            assert!(
                (integral - mode.integral()).abs() < 1e-14,
                "integral of mode {}",
                mode.number
            );
        }
    }

    #[test]
    fn boundary_conditions_hold() {
        for mode in modes().iter() {
            assert_eq!(mode.shape(0.0), 0.0);
            assert_eq!(mode.slope(0.0), 0.0);
            assert_eq!(mode.curvature(1.0), 0.0);
            assert_eq!(mode.third_derivative(1.0), 0.0);
        }
    }

    /// Each derivative is the derivative of the one before, and the fourth is β⁴φ:
    /// with sampled values that is the beam equation.
    #[test]
    fn shapes_solve_the_beam_equation() {
        type Function = fn(&Mode, f64) -> f64;
        let chain: [(Function, Function, i32); 4] = [
            (Mode::shape, Mode::slope, 1),
            (Mode::slope, Mode::curvature, 2),
            (Mode::curvature, Mode::third_derivative, 3),
            (
                Mode::third_derivative,
                |mode, xi| mode.stiffness() * mode.shape(xi),
                4,
            ),
        ];
        for mode in modes().iter() {
            let step = 1e-3 / mode.beta;
            for (function, derivative, order) in chain {
                for xi in [0.01, 0.2, 0.37, 0.5, 0.731, 0.99] {
                    // Central differences of fourth order.
                    let at = |offset: f64| function(mode, xi + offset * step);
                    let difference =
                        (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step);
                    let error = difference - derivative(mode, xi);
                    assert!(
                        error.abs() < 2e-10 * mode.beta.powi(order),
                        "mode {}, derivative {order}, ξ = {xi}: {error:e}",
                        mode.number
                    );
                }
            }
        }
    }

    #[test]
    fn deflection_is_the_sum_of_the_shapes() {
        let modes = Modes::new(3).unwrap();
        let expected = 0.3 * modes.shapes(0.8)[0] - 2.0 * modes.shapes(0.8)[2];
        assert!((modes.deflection(&[0.3, 0.0, -2.0], 0.8) - expected).abs() < 1e-15);
        assert_eq!(modes.deflection(&[1.0], 1.0), modes.shapes(1.0)[0]);
    }

    #[test]
    fn nonsense_is_refused() {
        for count in [0, 51, usize::MAX] {
            let error = ModeCountError { given: count };
            assert_eq!(Modes::new(count), Err(error));
            assert_eq!(Mode::new(count), Err(error));
            assert!(error.to_string().contains("1 to 50"));
        }
        let mode = Mode::new(2).unwrap();
        for xi in [-1e-9, 1.0 + 1e-9, f64::NAN, f64::INFINITY] {
            assert!(mode.shape(xi).is_nan() && mode.slope(xi).is_nan());
            assert!(mode.third_derivative(xi).is_nan());
        }
    }

    /// Nodes and weights on [−1, 1], by Newton on the Legendre polynomial.
    fn gauss_legendre(count: usize) -> (Vec<f64>, Vec<f64>) {
        let legendre = |x: f64| {
            let (mut previous, mut current) = (1.0, x);
            for n in 1..count {
                let n = n as f64;
                (previous, current) = (
                    current,
                    ((2.0 * n + 1.0) * x * current - n * previous) / (n + 1.0),
                );
            }
            let slope = count as f64 * (x * current - previous) / (x * x - 1.0);
            (current, slope)
        };
        (0..count)
            .map(|i| {
                let mut x = (PI * (i as f64 + 0.75) / (count as f64 + 0.5)).cos();
                for _ in 0..10 {
                    let (value, slope) = legendre(x);
                    x -= value / slope;
                }
                let (_, slope) = legendre(x);
                (x, 2.0 / ((1.0 - x * x) * slope * slope))
            })
            .unzip()
    }
}
