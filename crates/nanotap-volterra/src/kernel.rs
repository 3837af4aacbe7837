//! The response of the gap to a unit force: the Green's function of the modes, integrated once
//! against the polynomials of a step.
//!
//! On a step the force is a polynomial in `u ∈ [0, 1]`, given by its values at `n` Chebyshev
//! nodes. Its effect on the gap and the gap's rate at the nodes, at a few check points
//! between them, and on the modal coordinates at the end depends on the step's length and on
//! how `u` runs with time, and on nothing else. Lengths are `h₀ 2^{−k/2}`.

// Only what is inlined into a function for wide registers gets their instructions.
#![allow(clippy::inline_always)]

use crate::Complex;
use crate::VolterraError;
pub use crate::linear::MAX_NODES;
use crate::linear::{dot_body, wide_registers};
use crate::modes::{Block, Modes};
use crate::quadrature::{
    chebyshev_basis, chebyshev_coefficients, chebyshev_nodes, gauss_legendre, series_at,
};
use nalgebra::{DVector, RowDVector};
use std::f64::consts::SQRT_2;
use std::sync::{Arc, OnceLock};

/// Number of tabulated step lengths: the shortest is `h₀ 2^{−(LENGTHS − 1)/2}`.
pub(crate) const LENGTHS: usize = 72;
/// Number of points between the nodes at which the law is compared with the polynomial.
pub(crate) const CHECKS: usize = 4;
/// Number of points of the Gauss–Legendre rule of one panel.
const PANEL_POINTS: usize = 24;
/// Number of points of the rule between two nodes of a trajectory's quadrature. These are so close
/// that its error is rounding: modes turn by less than half a radian between them, and the force's
/// polynomials by less than half a turn.
const SHORT_POINTS: usize = 10;
/// Largest angle, in radians, of a mode that may be replaced by its tangent: half its square is far
/// below rounding.
const TANGENT: f64 = 3e-9;
/// Largest error of a perturbation's part in the force on a step, as a fraction of the
/// perturbation.
const PERTURBATION: f64 = 1e-13;
/// Upper limit of the strength of any coupling on a step: steeper forces are refused.
const STRONGEST: f64 = 1e3;
/// Time over the decay time above which the short rule does not resolve a decay.
const SHORT_DECAY: f64 = 0.5;
/// Decay exponent above which nothing is left in double precision: e⁻⁵⁰ is 2e-22.
const FORGOTTEN: f64 = 50.0;
/// Largest angle or decay exponent of a mode within one panel.
const PANEL_REACH: f64 = 8.0;

/// The relation between time and the variable `u` of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeMap {
    /// `t = h u`: time is proportional to the variable.
    Plain,
    /// `t = h u²`: the force begins like a power of `√t`.
    Start,
    /// `t = h (1 − (1 − u)²)`: the force ends like a power of `√(h − t)`.
    End,
}

impl TimeMap {
    /// Returns the time since the step's start.
    #[inline]
    pub(crate) fn time(self, h: f64, u: f64) -> f64 {
        match self {
            Self::Plain => h * u,
            Self::Start => h * u * u,
            Self::End => h * u * (2.0 - u),
        }
    }

    /// Returns the derivative of time by `u`.
    #[inline]
    pub(crate) fn rate(self, h: f64, u: f64) -> f64 {
        match self {
            Self::Plain => h,
            Self::Start => 2.0 * h * u,
            Self::End => 2.0 * h * (1.0 - u),
        }
    }

    /// Returns the `u` of a time `0 ≤ t ≤ h`.
    #[inline]
    pub(crate) fn variable(self, h: f64, t: f64) -> f64 {
        let x = (t / h).clamp(0.0, 1.0);
        match self {
            Self::Plain => x,
            Self::Start => x.sqrt(),
            // 1 − √(1 − x) without cancellation.
            Self::End => x / (1.0 + (1.0 - x).sqrt()),
        }
    }
}

/// The kind of the law's second argument.
#[derive(Clone, Copy, Debug)]
enum Second {
    /// The rate of the gap.
    Rate,
    /// A given signal, which does not depend on the state.
    Signal,
    /// The depth of a surface with this number of coordinates.
    Surface(usize),
}

/// The modes, with a row that gives the gap and a column by which the force enters.
#[derive(Debug)]
pub struct Kernel {
    modes: Modes,
    /// Row `row · R` that gives the gap from the modal coordinates.
    pub(crate) readout: Vec<f64>,
    /// Row `row · R B` that gives the gap's rate from the modal coordinates.
    pub(crate) rate_readout: Vec<f64>,
    /// Row of the law's second argument: `rate_readout`, that of the depth of a surface that
    /// relaxes, or 0.
    pub(crate) second_readout: Vec<f64>,
    /// Number of coordinates at the end of the state that belong to the surface.
    surface: usize,
    /// Modal source `L p` of a unit force.
    pub(crate) source: Vec<f64>,
    row: RowDVector<f64>,
    column: DVector<f64>,
    pub(crate) nodes: usize,
    /// Values of `u` at the nodes, then at the check points.
    pub(crate) points: Vec<f64>,
    /// Matrix from values at the nodes to Chebyshev coefficients, column-major.
    pub(crate) coefficients: Vec<f64>,
    /// Last two rows of `coefficients`: they give the tail of a series.
    pub(crate) last_coefficients: [Vec<f64>; 2],
    /// Bound of the absolute eigenvalues of each block, per unit of time.
    pub(crate) rates: Vec<f64>,
    longest: f64,
    /// Bound of the amplitude in the gap under a unit impulse of force.
    pub(crate) reach: f64,
    /// Strength, per unit of time, with which a force with a unit slope by the gap, and by its
    /// rate, couples each block to the others.
    couplings: Vec<[f64; 2]>,
    /// Length number from which on steps resolve perturbations under any force.
    always_resolving: usize,
    panel: Rule<PANEL_POINTS>,
    short: Rule<SHORT_POINTS>,
    tables: [Vec<OnceLock<Box<Table>>>; 3],
}

/// Quantities of a step that depend on its length and map only. Matrices are column-major.
#[derive(Debug)]
pub(crate) struct Table {
    pub(crate) length: f64,
    /// Times of the points from the start of the step.
    pub(crate) times: Vec<f64>,
    /// Gap at the points from the modal coordinates at the start, points × dimension.
    pub(crate) gap: Vec<f64>,
    /// Second argument of the law (the gap's rate or the depth of the surface) at the points from
    /// the modal coordinates at the start, points × dimension.
    pub(crate) rate: Vec<f64>,
    /// Gap at the points from the forces at the nodes, points × nodes.
    pub(crate) gap_force: Vec<f64>,
    /// Second argument of the law at the points from the forces at the nodes, points × nodes.
    pub(crate) rate_force: Vec<f64>,
    /// Force at the check points from the forces at the nodes, checks × nodes.
    pub(crate) between: Vec<f64>,
    /// Modal coordinates at the end from the forces at the nodes, dimension × nodes.
    pub(crate) carry: Vec<f64>,
    /// Exponentials `e^{Bh}` of the blocks over the whole step.
    pub(crate) exponentials: Vec<[[f64; 2]; 2]>,
    /// Gap at the points from a constant unit force.
    pub(crate) gap_unit: Vec<f64>,
    /// Second argument of the law at the points from a constant unit force.
    pub(crate) rate_unit: Vec<f64>,
    /// Sums of the absolute values in the rows of `gap_force`, at the nodes.
    pub(crate) gap_sums: Vec<f64>,
    /// Sums of the absolute values in the rows of `rate_force`, at the nodes.
    pub(crate) rate_sums: Vec<f64>,
}

/// Nodes and weights of a Gauss–Legendre rule on [0, 1].
type Rule<const POINTS: usize> = ([f64; POINTS], [f64; POINTS]);

fn rule<const POINTS: usize>() -> Rule<POINTS> {
    let (nodes, weights) = gauss_legendre(POINTS);
    (
        std::array::from_fn(|i| nodes[i]),
        std::array::from_fn(|i| weights[i]),
    )
}

/// A part of a step with the points of a Gauss–Legendre rule.
#[derive(Debug)]
struct Panel<const POINTS: usize> {
    /// Time of its end since the start of the step.
    end: f64,
    /// Values of `u` at the points of the rule.
    places: [f64; POINTS],
    /// Times from the points to its end.
    rests: [f64; POINTS],
    /// Weights of the points in integrals over time.
    weights: [f64; POINTS],
}

impl<const POINTS: usize> Panel<POINTS> {
    fn new(rule: &Rule<POINTS>, map: TimeMap, h: f64, [from, to]: [f64; 2]) -> Self {
        let end = map.time(h, to);
        let places = rule.0.map(|x| from + (to - from) * x);
        Self {
            end,
            places,
            rests: places.map(|u| end - map.time(h, u)),
            weights: std::array::from_fn(|i| rule.1[i] * (to - from) * map.rate(h, places[i])),
        }
    }

    /// Returns the weights times a series in the step's variable.
    fn weighted(&self, coefficients: &[f64]) -> [f64; POINTS] {
        wide_registers!([const POINTS: usize] weighted(
            panel: &Panel<POINTS> = self,
            coefficients: &[f64] = coefficients,
        ) -> [f64; POINTS])
    }

    /// Returns `∫ (C, S) F` over the panel for a force times its weights, with `C` and `S` as in
    /// [`Block::short_exps`].
    fn response(&self, block: &Block, force: &[f64; POINTS]) -> [f64; 2] {
        wide_registers!([const POINTS: usize] response(
            panel: &Panel<POINTS> = self,
            block: &Block = block,
            force: &[f64; POINTS] = force,
        ) -> [f64; 2])
    }

    /// Returns `(C, S)` of [`Block::short_exps`] from the points to the end.
    fn exponentials(&self, block: &Block) -> ([f64; POINTS], [f64; POINTS]) {
        wide_registers!([const POINTS: usize] exponentials(
            panel: &Panel<POINTS> = self,
            block: &Block = block,
        ) -> ([f64; POINTS], [f64; POINTS]))
    }

    /// Computes `∫ (C, S) T_j` over the panel for each polynomial `T_j` of the step's variable,
    /// weights included.
    fn moments(&self, block: &Block, out: &mut [[f64; 2]]) {
        wide_registers!([const POINTS: usize] moments(
            panel: &Panel<POINTS> = self,
            block: &Block = block,
            out: &mut [[f64; 2]] = out,
        ));
    }
}

#[inline(always)]
fn weighted<const POINTS: usize>(panel: &Panel<POINTS>, coefficients: &[f64]) -> [f64; POINTS] {
    let mut values = series_at(coefficients, &panel.places);
    for (value, weight) in values.iter_mut().zip(&panel.weights) {
        *value *= weight;
    }
    values
}

/// Applies a block's exponential to its coordinates.
#[inline(always)]
fn applied(e: [[f64; 2]; 2], y: &[f64]) -> [f64; 2] {
    let second = y.get(1).copied().unwrap_or(0.0);
    [
        e[0][0] * y[0] + e[0][1] * second,
        e[1][0] * y[0] + e[1][1] * second,
    ]
}

#[inline(always)]
fn exponentials<const POINTS: usize>(
    panel: &Panel<POINTS>,
    block: &Block,
) -> ([f64; POINTS], [f64; POINTS]) {
    block.short_exps(&panel.rests)
}

#[inline(always)]
fn response<const POINTS: usize>(
    panel: &Panel<POINTS>,
    block: &Block,
    force: &[f64; POINTS],
) -> [f64; 2] {
    let (even, odd) = block.short_exps(&panel.rests);
    [dot_body(&even, force), dot_body(&odd, force)]
}

#[inline(always)]
fn moments<const POINTS: usize>(panel: &Panel<POINTS>, block: &Block, out: &mut [[f64; 2]]) {
    let (mut even, mut odd) = block.short_exps(&panel.rests);
    for i in 0..POINTS {
        even[i] *= panel.weights[i];
        odd[i] *= panel.weights[i];
    }
    let x = panel.places.map(|u| 2.0 * u - 1.0);
    // T₋₁ = T₁.
    let (mut before, mut basis) = (x, [1.0; POINTS]);
    for out in out {
        *out = [dot_body(&even, &basis), dot_body(&odd, &basis)];
        for i in 0..POINTS {
            let next = 2.0 * x[i] * basis[i] - before[i];
            before[i] = basis[i];
            basis[i] = next;
        }
    }
}

/// Computes `√(g_k g)` of each block, where `g_k` is the amplitude in the gap, and in its rate,
/// under a unit impulse of force on the block, and `g` the largest.
fn couplings(modes: &Modes, gap: &[f64], rate: &[f64], source: &[f64]) -> Vec<[f64; 2]> {
    let excited: Vec<[f64; 2]> = modes
        .blocks()
        .iter()
        .map(|block| {
            let part = block.start..block.start + block.size;
            let norm = |v: &[f64]| dot_body(&v[part.clone()], &v[part.clone()]).sqrt();
            [gap, rate].map(|readout| norm(readout) * norm(source))
        })
        .collect();
    let largest = |k: usize| excited.iter().map(|e| e[k]).fold(0.0, f64::max);
    let most = [largest(0), largest(1)];
    excited
        .iter()
        .map(|e| [(e[0] * most[0]).sqrt(), (e[1] * most[1]).sqrt()])
        .collect()
}

impl Kernel {
    /// Prepares the modes with the gap `row · x` and the force entering as `column · F`.
    /// `longest` is the longest step, a fraction of the slowest mode's period or of the
    /// drive's; `nodes` (8 to [`MAX_NODES`]) is the number of forces a step.
    ///
    /// # Errors
    /// When sizes do not fit, a value is not finite or out of range, or the force acts on the
    /// gap's rate without inertia.
    pub fn new(
        modes: Modes,
        row: RowDVector<f64>,
        column: DVector<f64>,
        longest: f64,
        nodes: usize,
    ) -> Result<Arc<Self>, VolterraError> {
        Self::with_second(modes, row, column, longest, nodes, Second::Rate)
    }

    /// Returns the same lever with a second argument of the law that does not depend on the state.
    pub(crate) fn with_signal(&self) -> Result<Arc<Self>, VolterraError> {
        let (row, column) = (self.row.clone(), self.column.clone());
        let modes = self.modes.clone();
        Self::with_second(modes, row, column, self.longest, self.nodes, Second::Signal)
    }

    /// Returns the same lever over a surface whose modes decay at `rates` and grow with the force
    /// at `gains`; the sum of these modes is the second argument of the law.
    pub(crate) fn over_surface(
        &self,
        rates: &[f64],
        gains: &[f64],
    ) -> Result<Arc<Self>, VolterraError> {
        let (n, count) = (self.modes.dimension(), rates.len());
        let row = self.row.clone().resize_horizontally(n + count, 0.0);
        let mut column = self.column.clone().resize_vertically(n + count, 0.0);
        column.rows_mut(n, count).copy_from_slice(gains);
        let modes = self.modes.with_decays(rates)?;
        let second = Second::Surface(count);
        Self::with_second(modes, row, column, self.longest, self.nodes, second)
    }

    fn with_second(
        modes: Modes,
        row: RowDVector<f64>,
        column: DVector<f64>,
        longest: f64,
        nodes: usize,
        second: Second,
    ) -> Result<Arc<Self>, VolterraError> {
        let n = modes.dimension();
        for (what, found) in [
            ("the row of the gap", row.len()),
            ("the column of the force", column.len()),
        ] {
            if found != n {
                return Err(VolterraError::Shape {
                    what,
                    found,
                    expected: n,
                });
            }
        }
        if let Some(&found) = row.iter().chain(column.iter()).find(|v| !v.is_finite()) {
            return Err(VolterraError::Value {
                what: "an entry of the gap's row or the force's column".into(),
                found,
                needed: "finite",
            });
        }
        if !(longest > 0.0 && longest.is_finite()) {
            return Err(VolterraError::Value {
                what: "the longest step".into(),
                found: longest,
                needed: "positive and finite",
            });
        }
        if !(8..=MAX_NODES).contains(&nodes) {
            return Err(VolterraError::Value {
                what: "the number of nodes".into(),
                found: nodes as f64,
                needed: "between 8 and 32",
            });
        }
        let readout: Vec<f64> = (&row * modes.right()).iter().copied().collect();
        let source: Vec<f64> = (modes.left() * &column).iter().copied().collect();
        let mut reach = 0.0;
        let mut rate_readout = vec![0.0; n];
        let rates = modes.blocks().iter().map(Block::rate).collect();
        for block in modes.blocks() {
            let s = block.start;
            let norm = |v: &[f64]| {
                v[s..s + block.size]
                    .iter()
                    .map(|x| x * x)
                    .sum::<f64>()
                    .sqrt()
            };
            reach += norm(&readout) * norm(&source);
            for j in 0..block.size {
                for i in 0..block.size {
                    rate_readout[s + j] += readout[s + i] * block.matrix[i][j];
                }
            }
        }
        let (surface, second_readout) = match second {
            Second::Rate => (0, rate_readout.clone()),
            Second::Signal => (0, vec![0.0; n]),
            Second::Surface(count) => {
                let of_surface = |k: usize| if k + count < n { 0.0 } else { 1.0 };
                (count, (0..n).map(of_surface).collect())
            }
        };
        let couplings = couplings(&modes, &readout, &second_readout, &source);
        let direct: f64 = readout.iter().zip(&source).map(|(r, b)| r * b).sum();
        if direct.abs() > 1e-9 * reach {
            return Err(VolterraError::Inertialess);
        }
        let coefficients = chebyshev_coefficients(nodes);
        let mut points = chebyshev_nodes(nodes);
        // Between the nodes, where the polynomial's error is largest, spread over the step.
        for k in 0..CHECKS {
            let i = (2 * k + 1) * (nodes - 1) / (2 * CHECKS);
            points.push(0.5 * (points[i] + points[i + 1]));
        }
        let mut kernel = Self {
            modes,
            readout,
            rate_readout,
            second_readout,
            surface,
            source,
            row,
            column,
            nodes,
            points,
            last_coefficients: [2, 1].map(|from_end| {
                coefficients
                    .chunks_exact(nodes)
                    .map(|column| column[nodes - from_end])
                    .collect()
            }),
            coefficients,
            rates,
            longest,
            reach,
            couplings,
            always_resolving: LENGTHS,
            panel: rule(),
            short: rule(),
            tables: std::array::from_fn(|_| (0..LENGTHS).map(|_| OnceLock::new()).collect()),
        };
        // In square-root time a mode turns twice as fast at the end.
        let fastest = 2.0 * kernel.rates.iter().copied().fold(0.0, f64::max);
        let always =
            |index| STRONGEST * kernel.beyond(fastest * kernel.length(index)) <= PERTURBATION;
        kernel.always_resolving = (0..LENGTHS).find(|index| always(*index)).unwrap_or(LENGTHS);
        Ok(Arc::new(kernel))
    }

    /// Returns the linear modes of the kernel.
    pub fn modes(&self) -> &Modes {
        &self.modes
    }

    /// Returns the row `row` of the gap `row · x`, of length `n`.
    pub fn row(&self) -> &RowDVector<f64> {
        &self.row
    }

    /// Returns the column by which the force enters, of length `n`.
    pub fn column(&self) -> &DVector<f64> {
        &self.column
    }

    /// Returns the number of coordinates at the end of the state that belong to the surface.
    pub const fn surface(&self) -> usize {
        self.surface
    }

    /// Reports whether the modal coordinates follow their tangent, up to rounding, over this time.
    pub(crate) fn along_tangent(&self, time: f64) -> bool {
        let fastest = self.rates.iter().copied().fold(0.0, f64::max);
        time.abs() * fastest < TANGENT
    }

    /// Returns the length of the steps number `index`.
    pub(crate) fn length(&self, index: usize) -> f64 {
        let half = if index % 2 == 1 { 1.0 / SQRT_2 } else { 1.0 };
        self.longest * half * 0.5_f64.powi((index / 2) as i32)
    }

    /// Whether the nodes of steps number `index` resolve what a perturbation of every mode does to a
    /// force with these slopes by gap and rate: the coefficients of `cos ωt` beyond the last are below
    /// `(z/2)ⁿ/n!` with `z` half the angle that the mode turns by on the step.
    pub(crate) fn resolves(&self, map: TimeMap, index: usize, [gap, rate]: [f64; 2]) -> bool {
        if index >= self.always_resolving {
            return true;
        }
        let length = self.length(index);
        let fastest = map.rate(length, 0.0).max(map.rate(length, 1.0));
        self.rates
            .iter()
            .zip(&self.couplings)
            .all(|(turns, [by_gap, by_rate])| {
                let strength = length * (gap * by_gap + rate * by_rate);
                strength <= PERTURBATION || strength * self.beyond(turns * fastest) <= PERTURBATION
            })
    }

    /// Returns a bound of the error of the nodes for a mode that turns by this angle, with
    /// Stirling's `n!`.
    fn beyond(&self, angle: f64) -> f64 {
        let n = self.nodes as f64;
        let reach = std::f64::consts::E * angle / (4.0 * n);
        reach.powi(self.nodes as i32) / (std::f64::consts::TAU * n).sqrt()
    }

    /// Returns the number of the longest tabulated step that is not longer than `length`, if there
    /// is one.
    pub(crate) fn index_below(&self, length: f64) -> Option<usize> {
        if length <= 0.0 || length.is_nan() {
            return None;
        }
        let guess = (2.0 * nanotap_arithmetic::log2(self.longest / length)).floor() as i64 - 1;
        let first = guess.clamp(0, LENGTHS as i64) as usize;
        (first..LENGTHS).find(|&k| self.length(k) <= length)
    }

    /// Returns the table of steps of length number `index` under `map`.
    pub(crate) fn table(&self, map: TimeMap, index: usize) -> &Table {
        self.tables[map as usize][index].get_or_init(|| Box::new(self.build(map, index)))
    }

    fn build(&self, map: TimeMap, index: usize) -> Table {
        let (h, n, dimension) = (self.length(index), self.nodes, self.modes.dimension());
        let rows = self.points.len();
        let mut table = Table {
            length: h,
            times: self.points.iter().map(|&u| map.time(h, u)).collect(),
            gap: vec![0.0; rows * dimension],
            rate: vec![0.0; rows * dimension],
            gap_force: vec![0.0; rows * n],
            rate_force: vec![0.0; rows * n],
            between: vec![0.0; CHECKS * n],
            carry: vec![0.0; dimension * n],
            exponentials: self.modes.blocks().iter().map(|b| b.exp(h)).collect(),
            gap_unit: vec![0.0; rows],
            rate_unit: vec![0.0; rows],
            gap_sums: vec![0.0; n],
            rate_sums: vec![0.0; n],
        };
        let mut moments = vec![[0.0; 2]; n];
        let (mut of_gap, mut of_rate) = (vec![0.0; n], vec![0.0; n]);
        for (i, &u) in self.points.iter().enumerate() {
            let time = table.times[i];
            of_gap.fill(0.0);
            of_rate.fill(0.0);
            for block in self.modes.blocks() {
                let s = block.start;
                let e = block.exp(time);
                for j in 0..block.size {
                    for k in 0..block.size {
                        table.gap[(s + j) * rows + i] += self.readout[s + k] * e[k][j];
                        table.rate[(s + j) * rows + i] += self.second_readout[s + k] * e[k][j];
                    }
                }
                self.moments(block, map, h, u, &mut moments);
                for (j, moment) in moments.iter().enumerate() {
                    for k in 0..block.size {
                        of_gap[j] += self.readout[s + k] * moment[k];
                        of_rate[j] += self.second_readout[s + k] * moment[k];
                    }
                }
                if i + 1 == n {
                    for k in 0..block.size {
                        for node in 0..n {
                            let column = &self.coefficients[node * n..(node + 1) * n];
                            table.carry[node * dimension + s + k] =
                                moments.iter().zip(column).map(|(m, c)| m[k] * c).sum();
                        }
                    }
                }
            }
            for node in 0..n {
                let column = &self.coefficients[node * n..(node + 1) * n];
                let dot = |v: &[f64]| v.iter().zip(column).map(|(a, c)| a * c).sum::<f64>();
                table.gap_force[node * rows + i] = dot(&of_gap);
                table.rate_force[node * rows + i] = dot(&of_rate);
            }
            table.gap_unit[i] = of_gap[0];
            table.rate_unit[i] = of_rate[0];
            if i < n {
                let sum = |m: &[f64]| (0..n).map(|node| m[node * rows + i].abs()).sum::<f64>();
                table.gap_sums[i] = sum(&table.gap_force);
                table.rate_sums[i] = sum(&table.rate_force);
            }
        }
        let mut basis = vec![0.0; n];
        for (i, &u) in self.points[n..].iter().enumerate() {
            chebyshev_basis(u, &mut basis);
            for node in 0..n {
                let column = &self.coefficients[node * n..(node + 1) * n];
                table.between[node * CHECKS + i] =
                    basis.iter().zip(column).map(|(b, c)| b * c).sum();
            }
        }
        table
    }

    /// Returns the number of panels for the integral of a block over `[0, u]`.
    fn panels(block: &Block, map: TimeMap, h: f64, u: f64) -> usize {
        let fastest = map.rate(h, 0.0).max(map.rate(h, u)) * u;
        ((block.rate() * fastest / PANEL_REACH).ceil() as usize).max(1)
    }

    /// Returns the first of these panels whose force still affects a decaying coordinate at their
    /// end.
    fn first_panel(block: &Block, map: TimeMap, h: f64, width: f64, panels: usize) -> usize {
        let rate = block.matrix[0][0];
        if block.size == 2 || rate >= 0.0 {
            return 0;
        }
        let time = |panel: usize| map.time(h, width * panel as f64);
        let (end, mut low, mut high) = (time(panels), 0, panels - 1);
        while low < high {
            let middle = usize::midpoint(low, high);
            if -rate * (end - time(middle + 1)) > FORGOTTEN {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        low
    }

    /// Computes `∫₀^{t(u)} e^{B(t(u) − s)} b T_j(s) ds` of one block for all `j`, in `out`.
    pub(crate) fn moments(
        &self,
        block: &Block,
        map: TimeMap,
        h: f64,
        u: f64,
        out: &mut [[f64; 2]],
    ) {
        out.fill([0.0; 2]);
        if u == 0.0 {
            return;
        }
        let panels = Self::panels(block, map, h, u);
        let width = u / panels as f64;
        let source = self.source_of(block);
        let mut sums = [[0.0; 2]; MAX_NODES];
        let sums = &mut sums[..out.len()];
        for panel in Self::first_panel(block, map, h, width, panels)..panels {
            let ends = [width * panel as f64, width * (panel + 1) as f64];
            let panel = Panel::new(&self.panel, map, h, ends);
            panel.moments(block, sums);
            let e = block.exp(map.time(h, u) - panel.end);
            for (out, [even, odd]) in out.iter_mut().zip(sums.iter()) {
                let [x, y] = block.turn(*even, *odd, source);
                out[0] += e[0][0] * x + e[0][1] * y;
                out[1] += e[1][0] * x + e[1][1] * y;
            }
        }
    }

    fn source_of(&self, block: &Block) -> [f64; 2] {
        let s = block.start;
        let second = if block.size == 2 {
            self.source[s + 1]
        } else {
            0.0
        };
        [self.source[s], second]
    }

    /// Writes to `out` the modal coordinates at `u` of a step that starts from `y` and whose force
    /// has the given coefficients.
    pub(crate) fn partial(
        &self,
        map: TimeMap,
        h: f64,
        u: f64,
        y: &[f64],
        coefficients: &[f64],
        out: &mut [f64],
    ) {
        let end = map.time(h, u);
        // The panels of the block before, with the force on them times the weights.
        let mut panels: Vec<(Panel<PANEL_POINTS>, [f64; PANEL_POINTS])> = Vec::new();
        let mut range = 0..0;
        for block in self.modes.blocks() {
            let s = block.start;
            let e = block.exp(end);
            let mut value = applied(e, &y[s..s + block.size]);
            let needed = Self::panels(block, map, h, u);
            let width = u / needed as f64;
            let first = Self::first_panel(block, map, h, width, needed);
            if range != (first..needed) {
                range = first..needed;
                panels.clear();
                panels.extend(range.clone().map(|panel| {
                    let ends = [width * panel as f64, width * (panel + 1) as f64];
                    let panel = Panel::new(&self.panel, map, h, ends);
                    let weighted = panel.weighted(coefficients);
                    (panel, weighted)
                }));
            }
            let source = self.source_of(block);
            for (panel, force) in &panels {
                let [even, odd] = panel.response(block, force);
                let [x, y] = block.turn(even, odd, source);
                let e = block.exp(end - panel.end);
                value[0] += e[0][0] * x + e[0][1] * y;
                value[1] += e[1][0] * x + e[1][1] * y;
            }
            out[s..s + block.size].copy_from_slice(&value[..block.size]);
        }
    }

    /// Returns the gap of a complex state in modal coordinates.
    pub(crate) fn read(&self, state: &DVector<Complex>) -> Complex {
        let terms = self.readout.iter().zip(state.iter());
        terms.map(|(r, z)| z * *r).sum()
    }

    /// Advances motions in modal coordinates, one per column, from one place of a step to the next
    /// of a trajectory's quadrature; the coefficients of their forces are empty if these vanish.
    pub(crate) fn between(
        &self,
        map: TimeMap,
        h: f64,
        [from, to]: [f64; 2],
        y: &mut [f64],
        coefficients: &[f64],
    ) {
        if from == to {
            return;
        }
        let panel = Panel::new(&self.short, map, h, [from, to]);
        let time = panel.end - map.time(h, from);
        let columns = coefficients.chunks_exact(self.nodes);
        let mut forces: Vec<_> = columns.map(|column| panel.weighted(column)).collect();
        if forces.iter().flatten().all(|force| *force == 0.0) {
            forces.clear();
        }
        for block in self.modes.blocks() {
            let e = block.exp(time);
            if block.size == 1 && -block.matrix[0][0] * time > SHORT_DECAY {
                let columns = y.chunks_exact_mut(self.modes.dimension());
                for (y, column) in columns.zip(coefficients.chunks_exact(self.nodes)) {
                    let own = &mut y[block.start];
                    *own = e[0][0] * *own + self.decayed(block, map, h, [from, to], column);
                }
                continue;
            }
            let (even, odd) = if forces.is_empty() {
                ([0.0; SHORT_POINTS], [0.0; SHORT_POINTS])
            } else {
                panel.exponentials(block)
            };
            let source = self.source_of(block);
            for (k, y) in y.chunks_exact_mut(self.modes.dimension()).enumerate() {
                let y = &mut y[block.start..block.start + block.size];
                let mut value = applied(e, y);
                if let Some(force) = forces.get(k) {
                    let (even, odd) = (dot_body(&even, force), dot_body(&odd, force));
                    let [x, y] = block.turn(even, odd, source);
                    value[0] += x;
                    value[1] += y;
                }
                y.copy_from_slice(&value[..block.size]);
            }
        }
    }

    /// Returns the contribution of the force between two places of a step to a coordinate that
    /// decays.
    fn decayed(
        &self,
        block: &Block,
        map: TimeMap,
        h: f64,
        [from, to]: [f64; 2],
        coefficients: &[f64],
    ) -> f64 {
        let rate = -block.matrix[0][0];
        let end = map.time(h, to);
        let start = map.time(h, from).max(end - FORGOTTEN / rate);
        let panels = (rate * (end - start) / PANEL_REACH).ceil().max(1.0) as usize;
        let place = |k: usize| {
            let time = start + (end - start) * k as f64 / panels as f64;
            map.variable(h, time)
        };
        (0..panels)
            .map(|k| {
                let ends = [place(k), if k + 1 == panels { to } else { place(k + 1) }];
                let panel = Panel::new(&self.panel, map, h, ends);
                let [sum, _] = panel.response(block, &panel.weighted(coefficients));
                sum * self.source[block.start] * block.exp(end - panel.end)[0][0]
            })
            .sum()
    }

    /// Computes `∂y(u)/∂forces` (dimension × nodes, column-major) of a step cut at `u`.
    pub(crate) fn partial_carry(&self, map: TimeMap, h: f64, u: f64, out: &mut [f64]) {
        let (n, dimension) = (self.nodes, self.modes.dimension());
        let mut moments = [[0.0; 2]; MAX_NODES];
        for block in self.modes.blocks() {
            self.moments(block, map, h, u, &mut moments[..n]);
            for node in 0..n {
                let column = &self.coefficients[node * n..(node + 1) * n];
                for k in 0..block.size {
                    out[node * dimension + block.start + k] =
                        moments[..n].iter().zip(column).map(|(m, c)| m[k] * c).sum();
                }
            }
        }
    }
}
