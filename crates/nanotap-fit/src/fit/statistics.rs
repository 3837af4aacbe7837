//! Standard errors, correlations and tests from the residuals of a fit.

use nalgebra::{DMatrix, SymmetricEigen};
use nanotap_dynamics::random::Random;

/// A direction in which the parameters can go without a change that the data would show.
pub(super) struct Direction {
    /// Change of each parameter in units of its size, of length 1 together.
    pub(super) along: Vec<f64>,
    /// Standard errors by which the residuals change together, for such a change.
    pub(super) singular_value: f64,
}

/// Standard errors and correlations that follow from the Jacobian at the minimum.
pub(super) struct Information {
    /// Standard errors of the parameters; None for those that the data do not determine.
    pub(super) errors: Vec<Option<f64>>,
    /// Correlations of those that are determined, 0 of the others.
    pub(super) correlations: DMatrix<f64>,
    /// Covariance within what is determined.
    pub(super) covariance: DMatrix<f64>,
    /// Directions in the space of the parameters that the data do not determine.
    pub(super) undetermined: Vec<Direction>,
}

/// Singular values below this part of the largest are rounding.
const ROUNDING: f64 = 1e-6;
/// A parameter with more than this part in an undetermined direction is not determined.
const PART: f64 = 1e-3;

/// Computes standard errors and correlations from a weighted Jacobian (residuals in standard
/// errors) of parameters of these sizes.
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

/// Least and largest of some values.
pub(super) fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    values.fold(none, |[low, high], value| [low.min(value), high.max(value)])
}

/// An orthonormal basis of the changes of the residuals by parameters: its rows' squared lengths
/// are the leverages.
pub(super) fn range(jacobian: &DMatrix<f64>) -> DMatrix<f64> {
    let sizes: Vec<f64> = jacobian.column_iter().map(|c| c.norm()).collect();
    let scaled = DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |i, j| {
        jacobian[(i, j)] / sizes[j].max(f64::MIN_POSITIVE)
    });
    let eigen = SymmetricEigen::new(scaled.tr_mul(&scaled));
    let kept = (0..jacobian.ncols()).filter(|k| eigen.eigenvalues[*k] > ROUNDING * ROUNDING);
    let directions = kept.map(|k| {
        let along = eigen.eigenvectors.column(k);
        &scaled * along / eigen.eigenvalues[k].sqrt()
    });
    let directions: Vec<_> = directions.collect();
    DMatrix::from_fn(jacobian.nrows(), directions.len(), |i, k| directions[k][i])
}

/// Half the width, in standard errors, of a two-sided 95 % interval with so many degrees of
/// freedom (infinitely many where the errors are given): between whole ones linear in their
/// inverse.
pub(super) fn student(freedom: f64) -> f64 {
    let (low, high) = (freedom.floor().max(1.0), freedom.ceil().max(1.0));
    if low == high || high > 1000.0 {
        return student_of_whole(freedom);
    }
    let part = (1.0 / low - 1.0 / freedom.max(1.0)) / (1.0 / low - 1.0 / high);
    let [low, high] = [low, high].map(student_of_whole);
    low + part * (high - low)
}

fn student_of_whole(freedom: f64) -> f64 {
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

/// The probability that the ratio of two variances with these degrees of freedom exceeds `value`:
/// the incomplete beta function I_x(ν₂/2, ν₁/2) at x = ν₂/(ν₂ + ν₁ F), by its continued fraction
/// (Lentz's method; DLMF 8.17.22).
pub(super) fn exceeding_ratio(value: f64, [first, second]: [f64; 2]) -> f64 {
    if !(value > 0.0 && first > 0.0 && second > 0.0) {
        return 1.0;
    }
    if value == f64::INFINITY {
        return 0.0;
    }
    let x = second / (second + first * value);
    beta(0.5 * second, 0.5 * first, x)
}

fn beta(a: f64, b: f64, x: f64) -> f64 {
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - beta(b, a, 1.0 - x);
    }
    let front = nanotap_arithmetic::exp(
        a * nanotap_arithmetic::ln(x) + b * nanotap_arithmetic::ln_1p(-x) + ln_gamma(a + b)
            - ln_gamma(a)
            - ln_gamma(b),
    ) / a;
    let bounded = |value: f64| {
        if value.abs() < 1e-300 { 1e-300 } else { value }
    };
    let (mut c, mut d) = (1.0, 1.0 / bounded(1.0 - (a + b) * x / (a + 1.0)));
    let mut h = d;
    for m in 1..10_000 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let before = h;
        for term in [even, odd] {
            d = 1.0 / bounded(1.0 + term * d);
            c = bounded(1.0 + term / c);
            h *= c * d;
        }
        if (h - before).abs() < 1e-14 * h.abs() {
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

/// Residuals of neighbouring rows: the sequences, each of one column in one direction.
pub(super) struct Sequences<'a> {
    /// Indices of the residuals, a list per sequence, grouped by column.
    pub(super) columns: &'a [Vec<Vec<usize>>],
    /// Orthonormal basis of the changes of the residuals by the parameters.
    pub(super) basis: &'a DMatrix<f64>,
}

/// Standard deviations of the persistence that no noise reaches.
const SURE: f64 = 6.0;
/// Draws of the null distribution of [`Sequences::is_chance_below`].
const DRAWS: usize = 2000;
/// Most deviates that are drawn for it.
const MAX_DEVIATES: usize = 4_000_000;

impl Sequences<'_> {
    /// √n r₁ of every column, r₁ the autocorrelation of neighbours, summed.
    fn persistence(&self, residuals: &[f64]) -> f64 {
        let of = |sequences: &Vec<Vec<usize>>| {
            let all = || sequences.iter().flatten();
            let squares: f64 = all().map(|k| residuals[*k].powi(2)).sum();
            let neighbours: f64 = sequences
                .iter()
                .flat_map(|sequence| sequence.windows(2))
                .map(|w| residuals[w[0]] * residuals[w[1]])
                .sum();
            (all().count() as f64).sqrt() * neighbours / squares.max(f64::MIN_POSITIVE)
        };
        self.columns.iter().map(of).sum()
    }

    /// Whether the probability that independent noise keeps its sign from row to row as much as these
    /// residuals do is below a level. The null distribution is simulated: the fit takes the part of the
    /// noise that the parameters can describe.
    pub(super) fn is_chance_below(&self, level: f64, residuals: &[f64]) -> bool {
        let found = self.persistence(residuals);
        // Of many rows the sum is about normal.
        if found > SURE * (self.columns.len() as f64).sqrt() {
            return true;
        }
        let count = residuals.len();
        let draws = DRAWS.min(MAX_DEVIATES / count.max(1)).max(200);
        let most = level * (draws + 1) as f64;
        let mut deviates = Random::new(0x5eed);
        let mut exceeding = 1;
        for _ in 0..draws {
            let noise = nalgebra::DVector::from_fn(count, |_, _| deviates.normal());
            let left = &noise - self.basis * self.basis.tr_mul(&noise);
            exceeding += usize::from(self.persistence(left.as_slice()) >= found);
            if exceeding as f64 >= most {
                return false;
            }
        }
        true
    }
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
    fn tails_of_ratios_of_variances_are_those_of_tables() {
        // Abramowitz & Stegun, table 26.9: the 5 % and 1 % points.
        for (freedom, value, chance) in [
            ([1.0, 10.0], 4.96, 0.05),
            ([10.0, 10.0], 2.98, 0.05),
            ([5.0, 20.0], 4.10, 0.01),
            ([30.0, 6.0], 7.23, 0.01),
        ] {
            let found = exceeding_ratio(value, freedom);
            assert!((found / chance - 1.0).abs() < 0.01, "{freedom:?} {found}");
        }
    }

    #[test]
    fn noise_keeps_its_sign_as_often_as_it_should() {
        // Of lines through 30 rows, two columns: the chance of noise is uniform.
        let jacobian = DMatrix::from_fn(60, 2, |i, j| (i / 2).pow(j as u32) as f64);
        let basis = range(&jacobian);
        assert!((basis.norm_squared() - 2.0).abs() < 1e-9);
        let columns = [0, 1].map(|c| vec![(0..30).map(|k| 2 * k + c).collect()]);
        let sequences = Sequences {
            columns: &columns,
            basis: &basis,
        };
        let mut deviates = Random::new(7);
        let mut few = 0;
        for _ in 0..100 {
            let noise = nalgebra::DVector::from_fn(60, |_, _| deviates.normal());
            let left = &noise - &basis * basis.tr_mul(&noise);
            few += usize::from(sequences.is_chance_below(0.1, left.as_slice()));
        }
        // 10 expected, three standard deviations are 9.
        assert!((1..=19).contains(&few), "{few}");
        let bent: Vec<f64> = (0..60).map(|i| ((i / 2) as f64 / 5.0).sin()).collect();
        assert!(sequences.is_chance_below(0.001, &bent));
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
        // Between whole ones it falls.
        assert!(student(2.5) < student(2.0) && student(2.5) > student(3.0));
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
