//! The derivative of the flow with respect to the state, exact through switches.

use crate::observer::{Observer, SegmentView, SwitchView};
use crate::regime::Regime;
use crate::{Complex, Flow, FlowError};
use nalgebra::{DMatrix, DVector};

/// Carries `∂q/∂x₀` along a flow, in modal coordinates: a column for each
/// component of the initial state. The default is empty: [`Jacobian::begin`] makes it the
/// identity.
#[derive(Clone, Debug)]
pub struct Jacobian {
    /// `[Re; Im]` of `∂q/∂x₀`, `2m × n`.
    columns: DMatrix<f64>,
    /// The work space of a switch.
    next: DMatrix<f64>,
    scratch: Vec<Complex>,
}

impl Default for Jacobian {
    fn default() -> Self {
        Self {
            columns: DMatrix::zeros(0, 0),
            next: DMatrix::zeros(0, 0),
            scratch: Vec::new(),
        }
    }
}

impl Jacobian {
    /// The identity, for a flow that is in `regime`.
    pub fn identity(regime: &Regime) -> Self {
        let mut identity = Self::default();
        identity.begin(regime);
        identity
    }

    /// Becomes the identity, for a flow that is in `regime`.
    pub fn begin(&mut self, regime: &Regime) {
        let left = &regime.basis().left;
        let (m, n) = left.shape();
        if self.columns.shape() != (2 * m, n) {
            self.columns = DMatrix::zeros(2 * m, n);
        }
        let columns = self.columns.as_mut_slice().chunks_exact_mut(2 * m);
        for (column, left) in columns.zip(left.as_slice().chunks_exact(m)) {
            let (real, imaginary) = column.split_at_mut(m);
            for ((re, im), z) in real.iter_mut().zip(imaginary).zip(left) {
                *re = z.re;
                *im = z.im;
            }
        }
    }

    /// `∂x/∂x₀` (`n × n`) of a flow that is in `regime` now.
    pub fn to_state(&self, regime: &Regime, jacobian: &mut DMatrix<f64>) {
        let right = &regime.basis().right;
        let (n, m) = right.shape();
        jacobian.fill(0.0);
        let columns = self.columns.as_slice().chunks_exact(2 * m);
        for (out, column) in jacobian.as_mut_slice().chunks_exact_mut(n).zip(columns) {
            let (real, imaginary) = column.split_at(m);
            let modes = right.as_slice().chunks_exact(n);
            for ((re, im), mode) in real.iter().zip(imaginary).zip(modes) {
                for (out, r) in out.iter_mut().zip(mode) {
                    *out += r.re * re - r.im * im;
                }
            }
        }
    }
}

impl Observer for Jacobian {
    #[inline(always)]
    fn segment(&mut self, segment: &SegmentView<'_>) {
        let basis = segment.regime().basis();
        let m = basis.len();
        if basis.clusters.is_empty() {
            for column in self.columns.as_mut_slice().chunks_exact_mut(2 * m) {
                let (real, imaginary) = column.split_at_mut(m);
                let parts = real.iter_mut().zip(imaginary);
                for ((re, im), factor) in parts.zip(segment.factors) {
                    let (a, b) = (*re, *im);
                    *re = a * factor.re - b * factor.im;
                    *im = a * factor.im + b * factor.re;
                }
            }
            return;
        }
        for mut column in self.columns.column_iter_mut() {
            self.scratch.clear();
            self.scratch
                .extend((0..m).map(|k| Complex::new(column[k], column[m + k])));
            basis.apply(&mut self.scratch, segment.length, segment.factors);
            for (k, q) in self.scratch.iter().enumerate() {
                column[k] = q.re;
                column[m + k] = q.im;
            }
        }
    }

    #[inline(always)]
    fn switch(&mut self, view: &SwitchView<'_>) {
        if let Some(tangent) = &view.switch.tangent {
            product(tangent, &self.columns, &mut self.next);
            std::mem::swap(&mut self.columns, &mut self.next);
            return;
        }
        self.saltate(view);
    }
}

impl Jacobian {
    /// A switch whose saltation depends on the state.
    fn saltate(&mut self, view: &SwitchView<'_>) {
        let regime = &view.system.regimes()[view.switch.from];
        let mut x = DVector::zeros(view.system.dimension());
        let modal = view.modal.iter().copied();
        regime.to_state(view.system.drive(), modal, view.phase, x.as_mut_slice());
        let saltation = view.system.saltation(
            view.switch.from,
            view.transition,
            view.stuck,
            &x,
            view.phase,
        );
        self.columns =
            &view.switch.to_modal * (saltation * (&view.switch.from_modal * &self.columns));
    }
}

/// From this size on the general matrix product is worth its set-up.
const LARGE: usize = 16;

/// Writes `a b` to `out`.
#[inline(always)]
fn product(a: &DMatrix<f64>, b: &DMatrix<f64>, out: &mut DMatrix<f64>) {
    let (rows, inner) = a.shape();
    if out.shape() != (rows, b.ncols()) {
        *out = DMatrix::zeros(rows, b.ncols());
    }
    if rows >= LARGE {
        out.gemm(1.0, a, b, 0.0);
        return;
    }
    let columns = out.as_mut_slice().chunks_exact_mut(rows);
    for (out, b) in columns.zip(b.as_slice().chunks_exact(inner)) {
        out.fill(0.0);
        for (a, &factor) in a.as_slice().chunks_exact(rows).zip(b) {
            for (out, a) in out.iter_mut().zip(a) {
                *out += a * factor;
            }
        }
    }
}

impl Flow {
    /// Runs one drive period from the present state at phase 0 and writes the
    /// period map's exact Jacobian (`n × n`) to `jacobian`.
    ///
    /// # Errors
    /// As [`Flow::run_period`].
    pub fn run_period_with_jacobian(
        &mut self,
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), FlowError> {
        let mut carried = Jacobian::identity(&self.system().regimes()[self.regime()]);
        self.run_period(&mut carried)?;
        carried.to_state(&self.system().regimes()[self.regime()], jacobian);
        Ok(())
    }
}
