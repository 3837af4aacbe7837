//! Means of the strobe states, by which non-periodic motions are compared.

use super::block_average::BlockAverage;

/// Largest standard error of a mean, as a fraction of the standard deviation, at which motions may
/// be compared.
const MAX_RELATIVE_ERROR: f64 = 0.2;

/// Means of the d entries of the strobe states, then of their squares.
#[derive(Clone, Debug, PartialEq)]
pub struct StrobeMeans {
    /// The 2 d means, in units of the state and their squares.
    pub means: Vec<f64>,
    /// Standard errors of the 2 d means, in the unit of each mean.
    pub errors: Vec<f64>,
    /// Number of drive periods in the means.
    pub periods: usize,
}

impl StrobeMeans {
    /// Means of `states`, `d` entries each, in order of time.
    pub(crate) fn of(states: &[f64], d: usize) -> Self {
        let mut average = BlockAverage::new(2 * d);
        let mut sample = vec![0.0; 2 * d];
        for state in states.chunks_exact(d) {
            write_sample(state, &mut sample);
            average.push(&sample);
        }
        Self {
            means: average.mean(),
            errors: average.standard_error(),
            periods: average.count(),
        }
    }

    /// The mean state: the first d means.
    pub fn mean_state(&self) -> &[f64] {
        &self.means[..self.means.len() / 2]
    }

    /// Standard deviation of each entry of the states, at least 1e-6 of the largest, so that it can
    /// be used as a divisor.
    pub(crate) fn deviations(&self) -> Vec<f64> {
        let (means, squares) = self.means.split_at(self.means.len() / 2);
        let variances = means.iter().zip(squares).map(|(m, s)| s - m * m);
        let deviations: Vec<f64> = variances.map(|v| v.max(0.0).sqrt()).collect();
        let least = 1e-6 * deviations.iter().fold(0.0f64, |m, v| m.max(*v));
        deviations.into_iter().map(|v| v.max(least)).collect()
    }

    /// True if the errors of the mean state are small enough to compare motions.
    pub(crate) fn is_comparable(&self) -> bool {
        let deviations = self.deviations();
        let mut pairs = deviations.iter().zip(&self.errors);
        pairs.all(|(deviation, error)| *error <= MAX_RELATIVE_ERROR * deviation)
    }

    /// True if all means agree within six standard errors of the difference and a term that
    /// converges like 1/T.
    pub(crate) fn agree_with(&self, other: &Self) -> bool {
        let d = self.means.len() / 2;
        let length = self.periods.min(other.periods).max(1) as f64;
        [0..d, d..2 * d].into_iter().all(|range| {
            let largest = self.means[range.clone()]
                .iter()
                .fold(0.0f64, |m, v| m.max(v.abs()));
            range.into_iter().all(|i| {
                let error = nanotap_arithmetic::hypot(self.errors[i], other.errors[i]);
                agree(self.means[i] - other.means[i], error, largest, length)
            })
        })
    }
}

/// Writes a state and its squares to `sample`.
pub(crate) fn write_sample(state: &[f64], sample: &mut [f64]) {
    let (entries, squares) = sample.split_at_mut(state.len());
    entries.copy_from_slice(state);
    for (square, x) in squares.iter_mut().zip(state) {
        *square = x * x;
    }
}

/// True if a difference of two means over this many periods is within six standard errors plus
/// `scale` over the number of periods (averages without scatter converge like 1/T).
pub(crate) fn agree(difference: f64, error: f64, scale: f64, periods: f64) -> bool {
    difference.abs() <= 6.0 * error + 20.0 * scale / periods
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10 ± 30 and a constant: the mean state, a standard deviation of 30, and 1e-6 of it for the
    /// constant.
    #[test]
    fn means_and_deviations_of_two_states() {
        let states: Vec<f64> = (0..64)
            .flat_map(|k| [if k % 2 == 0 { 40.0 } else { -20.0 }, 5.0])
            .collect();
        let means = StrobeMeans::of(&states, 2);
        assert_eq!(means.mean_state(), [10.0, 5.0]);
        let deviations = means.deviations();
        assert!((deviations[0] - 30.0).abs() < 1e-12);
        assert!((deviations[1] - 30e-6).abs() < 1e-12, "{}", deviations[1]);
    }
}
