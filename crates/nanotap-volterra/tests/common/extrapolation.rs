//! An independent integrator: Gragg's modified midpoint rule extrapolated to order 16. Switches of
//! the law are located by solving for the length of the step that ends on them.

use nanotap_volterra::{ForceLaw, Guard};

const COLUMNS: usize = 8;

/// The chain of modes of [`super::beam`], written as equations of motion.
pub(crate) struct Plain<'a> {
    pub(crate) law: &'a dyn ForceLaw,
    /// Stiffness and damping of every mode over its mass, and its sign at the tip.
    pub(crate) modes: Vec<(f64, f64, f64)>,
    pub(crate) k: f64,
    /// Drive force over mass.
    pub(crate) drive: f64,
    pub(crate) zc: f64,
}

impl Plain<'_> {
    pub(crate) fn gap(&self, x: &[f64]) -> (f64, f64) {
        let n = self.modes.len();
        let mut gap = (self.zc, 0.0);
        for (k, mode) in self.modes.iter().enumerate() {
            gap.0 += mode.2 * x[k];
            gap.1 += mode.2 * x[n + k];
        }
        gap
    }

    fn field(&self, t: f64, x: &[f64], branch: usize, out: &mut [f64]) {
        let n = self.modes.len();
        let (gap, rate) = self.gap(x);
        let second = if self.law.takes_signal() {
            t.cos()
        } else {
            rate
        };
        let push = self.drive * t.cos() + self.law.force(branch, gap, second).value / self.k;
        for (k, (stiffness, damping, sign)) in self.modes.iter().enumerate() {
            out[k] = x[n + k];
            out[n + k] = -stiffness * x[k] - damping * x[n + k] + sign * push;
        }
    }

    fn guard(&self, guard: Guard, x: &[f64]) -> f64 {
        let (gap, rate) = self.gap(x);
        match guard {
            Guard::Falls(level) => gap - level,
            Guard::Rises(level) => level - gap,
            Guard::Turns => -rate,
            Guard::Own(index) => self.law.guard(index, gap, rate).value,
        }
    }

    /// One extrapolated step and its error.
    fn step(&self, t: f64, x: &[f64], branch: usize, h: f64) -> (Vec<f64>, f64) {
        let n = x.len();
        let mut table: Vec<Vec<f64>> = Vec::with_capacity(COLUMNS);
        let mut error = f64::INFINITY;
        let mut slope = vec![0.0; n];
        for j in 0..COLUMNS {
            let count = 2 * (j + 1);
            let small = h / count as f64;
            self.field(t, x, branch, &mut slope);
            let mut before = x.to_vec();
            let mut here: Vec<f64> = x.iter().zip(&slope).map(|(x, s)| x + small * s).collect();
            for m in 1..count {
                self.field(t + m as f64 * small, &here, branch, &mut slope);
                let next: Vec<f64> = before
                    .iter()
                    .zip(&slope)
                    .map(|(b, s)| b + 2.0 * small * s)
                    .collect();
                before = here;
                here = next;
            }
            table.push(here);
            for i in (0..j).rev() {
                let ratio = (count as f64 / (2 * (i + 1)) as f64).powi(2) - 1.0;
                let (low, high) = table.split_at_mut(i + 1);
                for (low, high) in low[i].iter_mut().zip(&high[0]) {
                    *low = high + (high - *low) / ratio;
                }
            }
            if j + 1 == COLUMNS {
                error = table[0]
                    .iter()
                    .zip(&table[1])
                    .map(|(a, b)| (a - b).abs())
                    .fold(0.0, f64::max);
            }
        }
        (table.swap_remove(0), error)
    }

    /// If a level is crossed in both directions within a step of length `h`: the fraction of the
    /// step after which the gap turns, and the guard there.
    fn dip(
        &self,
        guard: Guard,
        ends: (&[f64], &[f64]),
        h: f64,
        to: impl Fn(f64) -> Vec<f64>,
    ) -> Option<(f64, f64)> {
        let sign = match guard {
            Guard::Falls(_) => 1.0,
            Guard::Rises(_) => -1.0,
            Guard::Turns | Guard::Own(_) => return None,
        };
        let falls = |x: &[f64]| sign * self.gap(x).1 < 0.0;
        if !falls(ends.0) || falls(ends.1) {
            return None;
        }
        let (mut low, mut high) = (0.0, h);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if falls(&to(middle)) {
                low = middle;
            } else {
                high = middle;
            }
        }
        let least = self.guard(guard, &to(low));
        (least < 0.0).then_some((low, least))
    }

    /// The state at `end` from `x` at time 0, and the number of switches.
    pub(crate) fn run(&self, x: &mut Vec<f64>, end: f64) -> usize {
        let tolerance = 1e-14 * x.iter().fold(1.0, |m: f64, v| m.max(v.abs()));
        let (gap, rate) = self.gap(x);
        let mut branch = self.law.branch_at(gap, rate);
        let (mut t, mut h, mut switches): (f64, f64, usize) = (0.0, 0.05, 0);
        while t < end {
            let tried = h.min(end - t);
            let (mut next, error) = self.step(t, x, branch, tried);
            let shrink = (tolerance / error.max(1e-3 * tolerance)).powf(1.0 / 15.0);
            if error > tolerance && tried > 1e-10 {
                h = tried * (0.9 * shrink).clamp(0.1, 0.9);
                continue;
            }
            let mut taken = tried;
            let mut first: Option<usize> = None;
            for (number, exit) in self.law.exits(branch).iter().enumerate() {
                let value = |x: &[f64]| self.guard(exit.guard, x);
                let beyond = if value(&next) < 0.0 {
                    (taken, value(&next))
                } else {
                    let to = |h: f64| self.step(t, x, branch, h).0;
                    match self.dip(exit.guard, (x, &next), taken, to) {
                        Some(dip) => dip,
                        None => continue,
                    }
                };
                // The step that ends on the guard.
                let (mut a, mut b) = ((0.0, value(x).max(0.0)), beyond);
                for _ in 0..200 {
                    let middle = if a.1 == 0.0 {
                        0.5 * (a.0 + b.0)
                    } else {
                        (a.0 * b.1 - b.0 * a.1) / (b.1 - a.1)
                    };
                    let g = value(&self.step(t, x, branch, middle).0);
                    if g * b.1 < 0.0 {
                        a = b;
                    } else {
                        a.1 *= 0.5;
                    }
                    b = (middle, g);
                    if (a.0 - b.0).abs() < 1e-15 || g.abs() < 1e-16 {
                        break;
                    }
                }
                taken = b.0;
                next = self.step(t, x, branch, taken).0;
                first = Some(number);
            }
            *x = next;
            t += taken;
            h = tried * shrink.clamp(0.2, 2.0);
            if let Some(number) = first {
                branch = self.law.exits(branch)[number].target;
                switches += 1;
                h = 1e-3;
            }
        }
        switches
    }
}
