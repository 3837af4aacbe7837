//! Means of a correlated sequence with error bars from block averages.
//!
//! Values are summed in blocks. When 64 blocks are full, neighbouring blocks are merged, so the
//! memory is fixed and the block length grows with the run. The error of the mean is the standard
//! deviation of the block means over the root of their number; it is computed at two block lengths
//! and the larger one is returned (Flyvbjerg and Petersen, J. Chem. Phys. 91, 461, 1989). The error
//! is too small while the correlation time is longer than a block, which is why there are never
//! more than 64 blocks.

/// Largest number of blocks.
const BLOCKS: usize = 64;

/// Running block averages of a fixed number of quantities.
#[derive(Clone, Debug)]
pub(crate) struct BlockAverage {
    width: usize,
    block_length: usize,
    filled: usize,
    current: Vec<f64>,
    /// Sums of the finished blocks, `width` values each.
    blocks: Vec<f64>,
    total: Vec<f64>,
    count: usize,
}

impl BlockAverage {
    pub(crate) fn new(width: usize) -> Self {
        Self {
            width,
            block_length: 1,
            filled: 0,
            current: vec![0.0; width],
            blocks: Vec::with_capacity(BLOCKS * width),
            total: vec![0.0; width],
            count: 0,
        }
    }

    #[inline]
    pub(crate) fn push(&mut self, values: &[f64]) {
        for ((c, t), v) in self.current.iter_mut().zip(&mut self.total).zip(values) {
            *c += v;
            *t += v;
        }
        self.count += 1;
        self.filled += 1;
        if self.filled == self.block_length {
            self.blocks.extend_from_slice(&self.current);
            self.current.fill(0.0);
            self.filled = 0;
            if self.blocks.len() == BLOCKS * self.width {
                self.merge();
            }
        }
    }

    fn merge(&mut self) {
        let w = self.width;
        for k in 0..BLOCKS / 2 {
            for i in 0..w {
                self.blocks[k * w + i] =
                    self.blocks[2 * k * w + i] + self.blocks[(2 * k + 1) * w + i];
            }
        }
        self.blocks.truncate(BLOCKS / 2 * w);
        self.block_length *= 2;
    }

    pub(crate) fn count(&self) -> usize {
        self.count
    }

    pub(crate) fn mean(&self) -> Vec<f64> {
        let n = self.count.max(1) as f64;
        self.total.iter().map(|t| t / n).collect()
    }

    /// Standard error of each mean; infinite with fewer than 8 blocks.
    pub(crate) fn standard_error(&self) -> Vec<f64> {
        (0..self.width)
            .map(|i| self.error_at(i, 1).max(self.error_at(i, 2)))
            .collect()
    }

    fn error_at(&self, quantity: usize, group: usize) -> f64 {
        let blocks = self.blocks.len() / self.width / group;
        if blocks < 4 {
            return f64::INFINITY;
        }
        let length = (self.block_length * group) as f64;
        let mean_of = |k: usize| -> f64 {
            (0..group)
                .map(|g| self.blocks[(k * group + g) * self.width + quantity])
                .sum::<f64>()
                / length
        };
        let mean = (0..blocks).map(mean_of).sum::<f64>() / blocks as f64;
        let variance = (0..blocks)
            .map(|k| (mean_of(k) - mean).powi(2))
            .sum::<f64>()
            / (blocks - 1) as f64;
        (variance / blocks as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::unit;

    /// Uniform noise: mean 1/2, standard error √(1/12n).
    #[test]
    fn white_noise_has_the_error_that_statistics_says() {
        let mut average = BlockAverage::new(1);
        let n = 100_000;
        for k in 0..n {
            average.push(&[unit(k)]);
        }
        let expected = (1.0 / (12.0 * n as f64)).sqrt();
        let error = average.standard_error()[0];
        assert!(error > 0.6 * expected && error < 1.7 * expected);
        assert!((average.mean()[0] - 0.5).abs() < 4.0 * expected);
    }

    /// An autoregressive sequence with correlation time 50 has √100 times the error of white noise
    /// with the same variance.
    #[test]
    fn correlation_widens_the_error() {
        let (a, n) = (1.0 - 1.0 / 50.0, 200_000);
        let mut average = BlockAverage::new(1);
        let mut x = 0.0;
        for k in 0..n {
            x = a * x + (unit(k) - 0.5);
            average.push(&[x]);
        }
        let expected = (1.0f64 / 12.0 / n as f64).sqrt() / (1.0 - a);
        let error = average.standard_error()[0];
        assert!(error > 0.6 * expected && error < 1.7 * expected);
    }

    /// Sixteen zeros and ones: in equal pairs, the means of two have the larger variance (2/7 of
    /// eight); alternating, the values themselves do (4/15 of sixteen). The larger error is
    /// returned.
    #[test]
    fn both_block_lengths_count() {
        let error = |pattern: [f64; 4]| {
            let mut average = BlockAverage::new(1);
            for k in 0..16 {
                average.push(&[pattern[k % 4]]);
            }
            average.standard_error()[0]
        };
        let by_pairs = (2.0_f64 / 7.0 / 8.0).sqrt();
        let by_values = (4.0_f64 / 15.0 / 16.0).sqrt();
        assert!((error([0.0, 0.0, 1.0, 1.0]) - by_pairs).abs() < 1e-15);
        assert!((error([0.0, 1.0, 0.0, 1.0]) - by_values).abs() < 1e-15);
    }
}
