//! Whether the motion that a flip or a Neimark–Sacker bifurcation creates is stable.
//!
//! On the centre manifold the map of one period is ξ ↦ μ ξ (1 + c |ξ|² + …) with |μ| = 1, up to a
//! change of coordinates. For Re c < 0 the bifurcation is supercritical: the doubled orbit, or the
//! torus, is on the unstable side of the orbit, and stable if nothing else is unstable. For
//! Re c > 0 it is subcritical. With the eigenvectors A q = μ q and Aᴴ p = μ̄ p, ⟨p, q⟩ = 1,
//!
//! Re c ∝ Re μ̄ [⟨p, C(q, q, q̄)⟩ + 2⟨p, B(q, (1 − A)⁻¹ B(q, q̄))⟩ + ⟨p, B(q̄, (μ² − A)⁻¹ B(q, q))⟩]
//!
//! for the second and third derivatives B and C of the map (Kuznetsov, Elements of Applied
//! Bifurcation Theory, section 5.4; for a flip, where μ = −1, it is −3 times his coefficient b(0)).
//! The derivatives are differences of the exact Jacobian along the real and the imaginary part of q.
//!
//! Fails: near a grazing the map is smooth in a small neighbourhood only. The coefficient counts if
//! two steps a factor of four apart agree within a tenth; otherwise, and where μ, μ², μ³ or μ⁴ is 1
//! for a pair, nothing is known.

use nalgebra::{Complex, DMatrix, DVector};

use super::bifurcation::BifurcationKind;
use super::solver::{BranchSolver, Node};
use crate::map::MapFamily;
use crate::orbit::multipliers::eigenvector;

/// Whether the motion that appears at a bifurcation coexists with the stable or the unstable orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Criticality {
    /// The new motion appears where the orbit is unstable: the change is gradual.
    Supercritical,
    /// The new motion appears where the orbit is stable, and is unstable: the change is a jump.
    Subcritical,
}

impl Criticality {
    /// Returns the name of the variant in lower case, as in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Supercritical => "supercritical",
            Self::Subcritical => "subcritical",
        }
    }
}

/// First step of the differences, in units of the orbit's size.
const FIRST_STEP: f64 = 4e-3;
/// Number of steps of the differences, each a quarter of the one before.
const STEPS: usize = 6;
/// Relative difference of the coefficients of two steps that agree.
const AGREEMENT: f64 = 0.1;
/// Distance from a strong resonance within which the normal form has other terms.
const RESONANCE: f64 = 1e-3;

/// The criticality of a flip or a Neimark–Sacker bifurcation at its orbit.
pub(crate) fn criticality<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    node: &Node,
    kind: BifurcationKind,
) -> Option<Criticality> {
    let multiplier = match kind {
        BifurcationKind::Flip => Complex::new(-1.0, 0.0),
        BifurcationKind::NeimarkSacker { angle } => Complex::new(
            nanotap_arithmetic::cos(angle),
            nanotap_arithmetic::sin(angle),
        ),
        _ => return None,
    };
    let resonant = |power: u32| (multiplier.powu(power) - 1.0).norm_sqr() < RESONANCE * RESONANCE;
    if multiplier.im != 0.0 && (1..=4).any(resonant) {
        return None;
    }
    let middle = solver.monodromy(node, None)?;
    let form = NormalForm::new(&middle, multiplier)?;
    let mut last: Option<f64> = None;
    for k in 0..STEPS {
        let step = FIRST_STEP * 0.25f64.powi(k as i32) * solver.state_scale;
        let found = form.coefficient(step, |direction| solver.monodromy(node, Some(direction)));
        if let (Some(before), Some(now)) = (last, found)
            && (now - before).abs() <= AGREEMENT * now.abs()
        {
            return Some(if now < 0.0 {
                Criticality::Supercritical
            } else {
                Criticality::Subcritical
            });
        }
        last = found;
    }
    None
}

/// A complex vector as its real and imaginary part.
type Pair = [DVector<f64>; 2];

/// The eigenvectors and inverses of the normal form.
struct NormalForm {
    middle: DMatrix<f64>,
    multiplier: Complex<f64>,
    right: Pair,
    left: DVector<Complex<f64>>,
}

impl NormalForm {
    fn new(middle: &DMatrix<f64>, multiplier: Complex<f64>) -> Option<Self> {
        let right = eigenvector(middle, multiplier)?;
        let left = eigenvector(&middle.transpose(), multiplier.conj())?;
        let product = left.dotc(&right);
        // ⟨p, q⟩ = 1; a defective multiplier has ⟨p, q⟩ = 0.
        if product.norm_sqr() < 1e-16 {
            return None;
        }
        Some(Self {
            middle: middle.clone(),
            multiplier,
            right: [right.map(|z| z.re), right.map(|z| z.im)],
            left: left.map(|z| z / product.conj()),
        })
    }

    /// The coefficient from differences over `step`. `jacobian` is that of the map at a
    /// displacement from the orbit.
    fn coefficient(
        &self,
        step: f64,
        mut jacobian: impl FnMut(&DVector<f64>) -> Option<DMatrix<f64>>,
    ) -> Option<f64> {
        let zero = DMatrix::zeros(self.middle.nrows(), self.middle.ncols());
        let mut first = [zero.clone(), zero.clone()];
        let mut second = [zero.clone(), zero];
        for (k, part) in self.right.iter().enumerate() {
            if part.norm() == 0.0 {
                continue;
            }
            let ahead = jacobian(&(part * step))?;
            let behind = jacobian(&(part * -step))?;
            first[k] = (&ahead - &behind) / (2.0 * step);
            second[k] = (ahead + behind - &self.middle * 2.0) / (step * step);
        }
        let complex = |[re, im]: Pair| re.zip_map(&im, Complex::new);
        // B(q, w) or, with `sign` = −1, B(q̄, w).
        let quadratic = |sign: f64, w: &DVector<Complex<f64>>| {
            let w = [w.map(|z| z.re), w.map(|z| z.im)];
            complex([
                &first[0] * &w[0] - &first[1] * &w[1] * sign,
                &first[0] * &w[1] + &first[1] * &w[0] * sign,
            ])
        };
        let [a, b] = &self.right;
        let q = complex(self.right.clone());
        // C(q, q, q̄) = C(a, a, q) + C(b, b, q).
        let cubic = complex([
            &second[0] * a + &second[1] * a,
            &second[0] * b + &second[1] * b,
        ]);
        let bent = quadratic(-1.0, &q);
        let doubled = quadratic(1.0, &q);
        let by = |shift: Complex<f64>, vector: DVector<Complex<f64>>| {
            let middle = self.middle.map(|value| Complex::new(-value, 0.0));
            let n = middle.nrows();
            (middle + DMatrix::from_diagonal_element(n, n, shift))
                .lu()
                .solve(&vector)
        };
        let sum = cubic
            + quadratic(1.0, &by(Complex::new(1.0, 0.0), bent)?) * Complex::new(2.0, 0.0)
            + quadratic(-1.0, &by(self.multiplier * self.multiplier, doubled)?);
        let value = (self.multiplier.conj() * self.left.dotc(&sum)).re;
        value.is_finite().then_some(value)
    }
}
