//! What the residuals say of the parameters.

use nalgebra::{DMatrix, SymmetricEigen};

/// A direction in which the parameters can go without a change that the data would show.
pub(super) struct Direction {
    /// Change of each parameter in units of its size, of length 1 together.
    pub(super) along: Vec<f64>,
    /// Standard errors by which the residuals change together, for such a change.
    pub(super) singular_value: f64,
}

/// What follows from the Jacobian at the minimum.
pub(super) struct Information {
    /// Standard errors; `None` of what the data do not determine.
    pub(super) errors: Vec<Option<f64>>,
    /// Correlations of those that are determined, 0 of the others.
    pub(super) correlations: DMatrix<f64>,
    /// Covariance within what is determined.
    pub(super) covariance: DMatrix<f64>,
    /// What is not determined.
    pub(super) undetermined: Vec<Direction>,
}

/// Singular values below this part of the largest are rounding.
const ROUNDING: f64 = 1e-6;
/// A parameter with more than this part in an undetermined direction is not determined.
const PART: f64 = 1e-3;

/// Of a weighted Jacobian (residuals in standard errors) of parameters of these sizes.
///
/// With J S = U Σ Vᵀ, S the sizes, the covariance is S V Σ⁻² Vᵀ S. A column of V whose singular
/// value is below 1 is a change by a whole size that the data would not show; one that is zero
/// to rounding is a change that shows in nothing measured.
pub(super) fn information(jacobian: &DMatrix<f64>, sizes: &[f64]) -> Information {
    let count = sizes.len();
    let scaled = DMatrix::from_fn(jacobian.nrows(), count, |i, j| jacobian[(i, j)] * sizes[j]);
    let eigen = SymmetricEigen::new(scaled.tr_mul(&scaled));
    let values: Vec<f64> = eigen
        .eigenvalues
        .iter()
        .map(|v| v.max(0.0).sqrt())
        .collect();
    let largest = values.iter().copied().fold(0.0, f64::max);
    let lost = |value: f64| value <= 1.0 || value <= ROUNDING * largest;
    let mut covariance = DMatrix::zeros(count, count);
    let mut undetermined = Vec::new();
    for (k, value) in values.iter().enumerate() {
        let along = eigen.eigenvectors.column(k);
        if lost(*value) {
            undetermined.push(Direction {
                along: along.iter().copied().collect(),
                singular_value: *value,
            });
        } else {
            covariance += along * along.transpose() / (value * value);
        }
    }
    let determined = |j: usize| undetermined.iter().all(|d| d.along[j].abs() < PART);
    let covariance = DMatrix::from_fn(count, count, |i, j| {
        sizes[i] * covariance[(i, j)] * sizes[j]
    });
    let errors: Vec<Option<f64>> = (0..count)
        .map(|j| determined(j).then(|| covariance[(j, j)].sqrt()))
        .collect();
    let correlations = DMatrix::from_fn(count, count, |i, j| match (errors[i], errors[j]) {
        _ if i == j => 1.0,
        (Some(a), Some(b)) if a > 0.0 && b > 0.0 => covariance[(i, j)] / (a * b),
        _ => 0.0,
    });
    Information {
        errors,
        correlations,
        covariance,
        undetermined,
    }
}

/// Half the width, in standard errors, of a two-sided 95 % interval with so many degrees of
/// freedom (infinitely many where the errors are given).
pub(super) fn student(freedom: f64) -> f64 {
    const Z: f64 = 1.959_963_984_540_054;
    /// Above it two terms of the expansion (Abramowitz & Stegun 26.7.5) are good to 1e−8.
    const MANY: f64 = 1000.0;
    if freedom > MANY {
        let cube = Z.powi(3);
        return Z
            + (cube + Z) / (4.0 * freedom)
            + (5.0 * Z.powi(5) + 16.0 * cube + 3.0 * Z) / (96.0 * freedom * freedom);
    }
    let freedom = freedom.round().max(1.0);
    let (mut low, mut high) = (Z, 13.0);
    while high - low > 1e-12 {
        let middle = 0.5 * (low + high);
        if within(middle, freedom) < 0.95 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// The probability that Student's t is between −t and t: finite sums for whole degrees of
/// freedom (Abramowitz & Stegun 26.7.3 and 26.7.4).
fn within(t: f64, freedom: f64) -> f64 {
    let angle = nanotap_arithmetic::atan(t / freedom.sqrt());
    let (sine, cosine) = nanotap_arithmetic::sin_cos(angle);
    let odd = freedom % 2.0 == 1.0;
    let (mut term, mut sum, mut k) = if odd {
        (cosine, 0.0, 1.0)
    } else {
        (1.0, 0.0, 0.0)
    };
    while k < freedom - 1.0 {
        sum += term;
        term *= cosine * cosine * (k + 1.0) / (k + 2.0);
        k += 2.0;
    }
    if odd {
        std::f64::consts::FRAC_2_PI * (angle + sine * sum)
    } else {
        sine * sum
    }
}

/// The probability that χ² with so many degrees of freedom exceeds `value`: the incomplete gamma
/// function Q(ν/2, χ²/2), by its series or its continued fraction.
pub(super) fn exceeding(value: f64, freedom: f64) -> f64 {
    let (a, x) = (0.5 * freedom, 0.5 * value);
    if x.is_nan() || x <= 0.0 {
        return 1.0;
    }
    let front = nanotap_arithmetic::exp(a * nanotap_arithmetic::ln(x) - x - ln_gamma(a));
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > 1e-16 * sum {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return (1.0 - front * sum).clamp(0.0, 1.0);
    }
    // Lentz's method.
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut h = d;
    for i in 1..100_000 {
        let i = f64::from(i);
        let an = -i * (i - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= c * d;
        if (c * d - 1.0).abs() < 1e-15 {
            break;
        }
    }
    (front * h).clamp(0.0, 1.0)
}

/// ln Γ(a) by Stirling's series, above its range by recurrence.
fn ln_gamma(mut a: f64) -> f64 {
    let mut shift = 0.0;
    while a < 16.0 {
        shift -= nanotap_arithmetic::ln(a);
        a += 1.0;
    }
    let b = 1.0 / (a * a);
    shift + (a - 0.5) * nanotap_arithmetic::ln(a) - a
        + 0.5 * nanotap_arithmetic::ln(std::f64::consts::TAU)
        + (1.0 / 12.0 - b * (1.0 / 360.0 - b * (1.0 / 1260.0 - b / 1680.0))) / a
}

/// How far the residuals of a curve keep their sign from one row to the next: √n r₁, r₁ the
/// autocorrelation of neighbours. It is of order 1 for independent noise.
pub(super) fn persistence(residuals: &[f64]) -> f64 {
    let squares: f64 = residuals.iter().map(|r| r * r).sum();
    let neighbours: f64 = residuals.windows(2).map(|w| w[0] * w[1]).sum();
    (residuals.len() as f64).sqrt() * neighbours / squares.max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_of_chi_squared_are_those_of_tables() {
        // Abramowitz & Stegun, table 26.8: the 5 % points.
        for (freedom, value) in [(1.0, 3.841_46), (10.0, 18.3070), (100.0, 124.342)] {
            assert!((exceeding(value, freedom) - 0.05).abs() < 1e-6, "{freedom}");
        }
        // Two degrees of freedom: e^{−x/2}.
        for x in [0.1, 3.0, 40.0] {
            assert!((exceeding(x, 2.0) / (-0.5f64 * x).exp() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn student_is_that_of_tables() {
        // Abramowitz & Stegun, table 26.10.
        let table = [
            (1.0, 12.706),
            (2.0, 4.303),
            (3.0, 3.182),
            (5.0, 2.571),
            (10.0, 2.228),
            (30.0, 2.042),
            (120.0, 1.980),
        ];
        for (freedom, t) in table {
            assert!((student(freedom) - t).abs() <= 5e-4, "{freedom}");
        }
        // The sums and the expansion meet.
        assert!((student(1000.0) - student(1000.0 + 1e-9)).abs() < 1e-8);
    }

    #[test]
    fn what_only_stands_as_a_sum_is_not_determined() {
        // r = (a + b) t − y, and c alone.
        let jacobian = DMatrix::from_fn(20, 3, |i, j| match j {
            2 => 50.0 * (i as f64).cos(),
            _ => 10.0 * i as f64,
        });
        let found = information(&jacobian, &[1.0, 1.0, 1.0]);
        assert_eq!(found.undetermined.len(), 1);
        let along = &found.undetermined[0].along;
        assert!((along[0] + along[1]).abs() < 1e-9 && along[2].abs() < 1e-9);
        assert!(found.errors[0].is_none() && found.errors[1].is_none());
        assert!(found.errors[2].is_some());
    }
}
