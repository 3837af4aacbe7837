//! Systems with known properties, shared by all tests.

use std::convert::Infallible;

use nanotap_dynamics::{DMatrix, MapFamily, StroboscopicMap, Tangency};

/// A map given by formulas.
pub(crate) trait Formula: Clone + Send + Sync {
    const DIMENSION: usize;
    /// Number of trailing entries that are whole numbers set by the map.
    const DISCRETE: usize = 0;
    /// Number of motions that a census follows at a time.
    const BATCH_SIZE: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]);
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>);
    /// Derivative with respect to the family's parameter.
    fn derivative(&self, x: &[f64], out: &mut [f64]);
    /// Value of the only tangency per period, if the system has one.
    fn tangency(&self, _x: &[f64]) -> Option<f64> {
        None
    }
}

/// The stroboscopic map of a formula.
#[derive(Clone, Debug)]
pub(crate) struct System<F>(pub F);

impl<F: Formula> nanotap_dynamics::Scheduling for System<F> {
    fn batch_size(&self) -> usize {
        F::BATCH_SIZE
    }
}

impl<F: Formula> StroboscopicMap for System<F> {
    type Error = Infallible;

    fn dimension(&self) -> usize {
        F::DIMENSION
    }

    fn period(&self) -> f64 {
        1.0
    }

    fn discrete_entries(&self) -> usize {
        F::DISCRETE
    }

    fn advance(&mut self, state: &mut [f64]) -> Result<(), Infallible> {
        let mut out = [0.0; 8];
        self.0.image(state, &mut out[..F::DIMENSION]);
        state.copy_from_slice(&out[..F::DIMENSION]);
        Ok(())
    }

    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), Infallible> {
        self.0.jacobian(state, jacobian);
        self.advance(state)
    }

    fn advance_with_tangencies(
        &mut self,
        state: &mut [f64],
        tangencies: &mut Vec<Tangency>,
    ) -> Result<(), Infallible> {
        if let Some(value) = self.0.tangency(state) {
            tangencies.push(Tangency { phase: 0.5, value });
        }
        self.advance(state)
    }
}

/// A family of formulas.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Family<F>(pub fn(f64) -> F);

impl<F: Formula> MapFamily for Family<F> {
    type Map = System<F>;
    type Error = Infallible;

    fn at(&self, parameter: f64) -> Result<System<F>, Infallible> {
        Ok(System((self.0)(parameter)))
    }

    fn advance_with_derivatives(
        &self,
        _parameter: f64,
        map: &mut System<F>,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivative: &mut [f64],
    ) -> Result<(), Infallible> {
        map.0.derivative(state, derivative);
        map.advance_with_jacobian(state, jacobian)
    }
}

/// x → 1 − a x² + y, y → b x (Hénon 1976); the parameter is a.
///
/// Fixed points x = (b − 1 ± √((1−b)² + 4a))/(2a); fold at a = −(1−b)²/4, flip at
/// a = 3(1−b)²/4 (0.3675 at b = 0.3). At a = 1.4, b = 0.3: λ₁ = 0.41922 (Sprott,
/// "Chaos and Time-Series Analysis", 2003), λ₁ + λ₂ = ln b.
#[derive(Clone, Debug)]
pub(crate) struct Henon {
    pub a: f64,
    pub b: f64,
}

impl Henon {
    pub(crate) fn fixed_point(&self) -> [f64; 2] {
        let x = (self.b - 1.0 + ((1.0 - self.b).powi(2) + 4.0 * self.a).sqrt()) / (2.0 * self.a);
        [x, self.b * x]
    }
}

impl Formula for Henon {
    const DIMENSION: usize = 2;
    const BATCH_SIZE: usize = 16;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = 1.0 - self.a * x[0] * x[0] + x[1];
        out[1] = self.b * x[0];
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = -2.0 * self.a * x[0];
        out[(0, 1)] = 1.0;
        out[(1, 0)] = self.b;
        out[(1, 1)] = 0.0;
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        out[0] = -x[0] * x[0];
        out[1] = 0.0;
    }
}

/// x → r x (1 − x). Doublings at r = 3 and 1 + √6, period-3 fold at 1 + √8; at r = 4
/// λ = ln 2.
#[derive(Clone, Debug)]
pub(crate) struct Logistic(pub f64);

impl Formula for Logistic {
    const DIMENSION: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = self.0 * x[0] * (1.0 - x[0]);
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = self.0 * (1.0 - 2.0 * x[0]);
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] * (1.0 - x[0]);
    }
}

/// x → a x (1 − y), y → x (Maynard Smith 1968): x = y = 1 − 1/a has
/// trace 1, determinant a − 1: Neimark–Sacker at a = 2 with multipliers e^{±iπ/3}.
#[derive(Clone, Debug)]
pub(crate) struct DelayedLogistic(pub f64);

impl Formula for DelayedLogistic {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = self.0 * x[0] * (1.0 - x[1]);
        out[1] = x[0];
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = self.0 * (1.0 - x[1]);
        out[(0, 1)] = -self.0 * x[0];
        out[(1, 0)] = 1.0;
        out[(1, 1)] = 0.0;
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] * (1.0 - x[1]);
        out[1] = 0.0;
    }
}

/// z → e^{iθ} z (1 + g (1 − |z|²)): for 0 < g < 1 the unit circle attracts radially by 1 − 2g and
/// rotates by θ: exponents 0 and ln(1 − 2g). The parameter is θ.
#[derive(Clone, Debug)]
pub(crate) struct Turning {
    pub angle: f64,
    pub gain: f64,
}

impl Formula for Turning {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        let (s, c) = self.angle.sin_cos();
        let r = 1.0 + self.gain * (1.0 - x[0] * x[0] - x[1] * x[1]);
        out[0] = r * (c * x[0] - s * x[1]);
        out[1] = r * (s * x[0] + c * x[1]);
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        let (s, c) = self.angle.sin_cos();
        let r = 1.0 + self.gain * (1.0 - x[0] * x[0] - x[1] * x[1]);
        let turned = [c * x[0] - s * x[1], s * x[0] + c * x[1]];
        let turn = [[c, -s], [s, c]];
        for i in 0..2 {
            for j in 0..2 {
                out[(i, j)] = r * turn[i][j] - 2.0 * self.gain * turned[i] * x[j];
            }
        }
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        let (s, c) = self.angle.sin_cos();
        let r = 1.0 + self.gain * (1.0 - x[0] * x[0] - x[1] * x[1]);
        out[0] = r * (-s * x[0] - c * x[1]);
        out[1] = r * (c * x[0] - s * x[1]);
    }
}

/// A circle that rotates by 2.4 rad, and z → r z (1 − z) with r = 4 + 4e-7, which leaves [0, 1]
/// after some thousands of periods and then converges to −1.
#[derive(Clone, Debug)]
pub(crate) struct Calming;

impl Calming {
    const CIRCLE: Turning = Turning {
        angle: 2.4,
        gain: 0.2,
    };
    const R: f64 = 4.0 + 4e-7;

    pub(crate) fn step(z: f64) -> f64 {
        if z < 0.0 {
            0.5 * (z - 1.0)
        } else {
            Self::R * z * (1.0 - z)
        }
    }
}

impl Formula for Calming {
    const DIMENSION: usize = 3;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        Self::CIRCLE.image(x, out);
        out[2] = Self::step(x[2]);
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out.fill(0.0);
        Self::CIRCLE.jacobian(x, out);
        out[(2, 2)] = if x[2] < 0.0 {
            0.5
        } else {
            Self::R * (1.0 - 2.0 * x[2])
        };
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        Self::CIRCLE.derivative(x, out);
        out[2] = 0.0;
    }
}

/// x → ρ R(θ) x + (1, 0): one stable focus with multipliers ρ e^{±iθ}; ρ = 1 is an
/// undamped oscillator. The parameter is ρ.
#[derive(Clone, Debug)]
pub(crate) struct Focus {
    pub radius: f64,
    pub angle: f64,
}

impl Formula for Focus {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        let (s, c) = self.angle.sin_cos();
        out[0] = self.radius * (c * x[0] - s * x[1]) + 1.0;
        out[1] = self.radius * (s * x[0] + c * x[1]);
    }
    fn jacobian(&self, _x: &[f64], out: &mut DMatrix<f64>) {
        let (s, c) = self.angle.sin_cos();
        out.copy_from(&(DMatrix::from_row_slice(2, 2, &[c, -s, s, c]) * self.radius));
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        let (s, c) = self.angle.sin_cos();
        out[0] = c * x[0] - s * x[1];
        out[1] = s * x[0] + c * x[1];
    }
}

/// An open tent map with a gap that leads to a sink.
///
/// On [0, 1]: x → s min(x, 1 − x), s > 2, of which the fraction 2/s stays in [0, 1]. Survivors stay
/// uniformly distributed, so lifetimes are geometric with survival probability exactly 2/s. All
/// others go to the fixed point 2, which attracts by 1/2.
#[derive(Clone, Debug)]
pub(crate) struct OpenTent(pub f64);

impl Formula for OpenTent {
    const DIMENSION: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = if (0.0..=1.0).contains(&x[0]) {
            self.0 * x[0].min(1.0 - x[0])
        } else {
            2.0 + 0.5 * (x[0] - 2.0)
        };
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = if !(0.0..=1.0).contains(&x[0]) {
            0.5
        } else if x[0] < 0.5 {
            self.0
        } else {
            -self.0
        };
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        out[0] = if (0.0..=1.0).contains(&x[0]) {
            x[0].min(1.0 - x[0])
        } else {
            0.0
        };
    }
}

/// The normal form of a soft (3/2-power) grazing in one dimension,
/// x → μ + a x + b max(x, 0)^{3/2}, with the tangency of value −x. The parameter is μ.
///
/// Fixed points: x = μ/(1−a) while μ < 0, grazing at μ = 0, then
/// μ = (1−a)x − b x^{3/2}. For b > 0 a fold at √x = 2(1−a)/(3b),
/// μ = 4(1−a)³/(27b²). For b < 0 a flip where a + (3/2) b √x = −1.
#[derive(Clone, Debug)]
pub(crate) struct Grazing {
    pub mu: f64,
    pub a: f64,
    pub b: f64,
}

impl Formula for Grazing {
    const DIMENSION: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = self.mu + self.a * x[0] + self.b * x[0].max(0.0).powf(1.5);
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = self.a + 1.5 * self.b * x[0].max(0.0).sqrt();
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out[0] = 1.0;
    }
    fn tangency(&self, x: &[f64]) -> Option<f64> {
        Some(-x[0])
    }
}

/// The normal form of a hard (square-root) grazing (Nordmark 1991) in one dimension, x → μ + a x −
/// b √max(x, 0): no nearby fixed point continues smoothly past μ = 0.
#[derive(Clone, Debug)]
pub(crate) struct HardGrazing {
    pub mu: f64,
    pub a: f64,
    pub b: f64,
}

impl Formula for HardGrazing {
    const DIMENSION: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = self.mu + self.a * x[0] - self.b * x[0].max(0.0).sqrt();
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = if x[0] > 0.0 {
            self.a - 0.5 * self.b / x[0].sqrt()
        } else {
            self.a
        };
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out[0] = 1.0;
    }
    fn tangency(&self, x: &[f64]) -> Option<f64> {
        Some(-x[0])
    }
}

/// x → r x − x³, 1 < r < 2: the fixed points ±√(r−1) attract with μ = 3 − 2r, and by symmetry each
/// takes half of a symmetric box. Starts beyond |x| = √(r+1) are unbounded.
#[derive(Clone, Debug)]
pub(crate) struct Cubic(pub f64);

impl Formula for Cubic {
    const DIMENSION: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] * (self.0 - x[0] * x[0]);
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = self.0 - 3.0 * x[0] * x[0];
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0];
    }
}

/// The state `periods` periods after `start`.
pub(crate) fn advanced(map: &mut impl StroboscopicMap, start: &[f64], periods: usize) -> Vec<f64> {
    let mut x = start.to_vec();
    for _ in 0..periods {
        map.advance(&mut x).expect("the map can be followed");
    }
    x
}

/// Two scales on one line: within |x| ≤ 2s a copy of [`Cubic`] scaled by `s`, with the attractors
/// ±s √(r−1), whose basins together are |x| < s √(r+1) (exactly: starts between that and 2s grow
/// past 2s). Beyond 2s everything goes to ±2.
#[derive(Clone, Debug)]
pub(crate) struct Nested {
    pub r: f64,
    pub s: f64,
}

impl Formula for Nested {
    const DIMENSION: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        let y = x[0];
        out[0] = if y.abs() > 2.0 * self.s {
            2.0f64.copysign(y) + 0.5 * (y - 2.0f64.copysign(y))
        } else {
            let z = y / self.s;
            self.s * z * (self.r - z * z)
        };
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = if x[0].abs() > 2.0 * self.s {
            0.5
        } else {
            let z = x[0] / self.s;
            self.r - 3.0 * z * z
        };
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        out[0] = if x[0].abs() > 2.0 * self.s { 0.0 } else { x[0] };
    }
}

/// Ulam's map x → 1 − 2x² together with a number that changes sign every period and whose size
/// converges to 1 from below 3/2 and to 2 from above: two chaotic attractors with the same
/// exponents, ln 2 and −ln 2, and the same mean state, zero. Only their mean squares differ.
#[derive(Clone, Debug)]
pub(crate) struct TwoShells;

impl Formula for TwoShells {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        let shell = if x[1].abs() < 1.5 { 1.0 } else { 2.0 };
        out[0] = 1.0 - 2.0 * x[0] * x[0];
        out[1] = -(shell + 0.5 * (x[1].abs() - shell)).copysign(x[1]);
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = -4.0 * x[0];
        out[(0, 1)] = 0.0;
        out[(1, 0)] = 0.0;
        out[(1, 1)] = -0.5;
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out.fill(0.0);
    }
}

/// x → x/2 + μ/2, and a flag that is 1 if the image is above 1: the fixed point is μ, its flag 1
/// for μ > 1. With the flag set the image is larger by 1/100, as for a neck that pulls.
#[derive(Clone, Debug)]
pub(crate) struct Flagged(pub f64);

impl Formula for Flagged {
    const DIMENSION: usize = 2;
    const DISCRETE: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = 0.5 * (x[0] + self.0) + 0.01 * x[1];
        out[1] = if out[0] > 1.0 { 1.0 } else { 0.0 };
    }
    fn jacobian(&self, _x: &[f64], out: &mut DMatrix<f64>) {
        out.fill(0.0);
        out[(0, 0)] = 0.5;
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out[0] = 0.5;
        out[1] = 0.0;
    }
}

/// Ulam's map if the second number is negative (it stays negative and converges to −1); a fixed
/// point at (0, 1) for the others.
#[derive(Clone, Debug)]
pub(crate) struct ChaosAndRest;

impl Formula for ChaosAndRest {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        let side = 1f64.copysign(x[1]);
        out[0] = if side > 0.0 {
            0.5 * x[0]
        } else {
            1.0 - 2.0 * x[0] * x[0]
        };
        out[1] = side + 0.5 * (x[1] - side);
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = if x[1] > 0.0 { 0.5 } else { -4.0 * x[0] };
        out[(0, 1)] = 0.0;
        out[(1, 0)] = 0.0;
        out[(1, 1)] = 0.5;
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out.fill(0.0);
    }
}

/// [`Focus`] with the angle as parameter: the fixed point has the size
/// 1/|1 − ρ e^{iθ}|, a resonance at θ = 0.
#[derive(Clone, Debug)]
pub(crate) struct Resonance(pub Focus);

impl Formula for Resonance {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        self.0.image(x, out);
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        self.0.jacobian(x, out);
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        let (s, c) = self.0.angle.sin_cos();
        out[0] = self.0.radius * (-s * x[0] - c * x[1]);
        out[1] = self.0.radius * (c * x[0] - s * x[1]);
    }
}

/// x → a x + b |x| + μ: homogeneous of degree one in (x, μ). For 0 < 1 − a − b the fixed points are
/// μ/(1 − a − b), μ > 0, with the multiplier a + b down to μ = 0, where the map has no derivative.
/// The parameter is μ.
#[derive(Clone, Debug)]
pub(crate) struct Kinked {
    pub mu: f64,
    pub a: f64,
    pub b: f64,
}

impl Formula for Kinked {
    const DIMENSION: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = self.a * x[0] + self.b * x[0].abs() + self.mu;
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = self.a + if x[0] > 0.0 { self.b } else { -self.b };
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out[0] = 1.0;
    }
}
