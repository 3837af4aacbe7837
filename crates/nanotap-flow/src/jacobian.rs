//! The derivative of the flow with respect to the state, exact through switches.

use crate::observer::{Observer, SegmentView, SwitchView};
use crate::regime::Regime;
use crate::simd::linear::{LinearMap, scale};
use crate::simd::{ComplexVector, WIDTH, layout};
use crate::system::System;
use crate::{Complex, Flow, FlowError};
use nalgebra::DMatrix;

/// Observer that carries `∂q/∂x₀` along a flow, in modal coordinates: one column per component of
/// the initial state. The default is empty; [`Jacobian::begin`] initialises it.
#[derive(Clone, Debug, Default)]
pub struct Jacobian {
    /// Derivative `∂q/∂x₀` in packed modal coordinates, column by column.
    columns: Vec<ComplexVector>,
    /// The work space of a switch.
    next: Vec<ComplexVector>,
    scratch: Vec<Complex>,
}

impl Jacobian {
    /// Creates the Jacobian at the beginning of a flow of `system` that is in `regime`.
    pub fn at_start(system: &System, regime: usize) -> Self {
        let mut start = Self::default();
        start.begin(system, regime);
        start
    }

    /// Sets the identity, for a flow of `system` that is in `regime`; zero if the motion sticks to
    /// a rigid stop, to which every neighbour returns.
    pub fn begin(&mut self, system: &System, regime: usize) {
        let identity = system.regimes()[regime].prepared().packed_left();
        self.columns.clear();
        if system.sticks(regime) {
            self.columns
                .resize(identity.len(), ComplexVector::default());
        } else {
            self.columns.extend_from_slice(identity);
        }
    }

    /// Writes `∂x/∂x₀` (`n × n`) of a flow that is in `regime` now to `jacobian`.
    pub fn to_state(&mut self, regime: &Regime, jacobian: &mut DMatrix<f64>) {
        regime
            .prepared()
            .packed_right()
            .apply(&self.columns, &mut self.next);
        let n = jacobian.nrows();
        let vectors = regime.prepared().packed_right().vectors();
        let columns = jacobian.as_mut_slice().chunks_exact_mut(n);
        for (column, packed) in columns.zip(self.next.chunks_exact(vectors)) {
            let (first, second) = column.split_at_mut(n.div_ceil(2));
            for (part, half) in [first, second].into_iter().enumerate() {
                for (values, vector) in half.chunks_mut(WIDTH).zip(packed) {
                    values.copy_from_slice(&vector[part][..values.len()]);
                }
            }
        }
    }

    /// Applies a switch whose saltation depends on the state.
    fn saltate(&mut self, view: &SwitchView<'_>) {
        let saltation = view.saltation(&view.state());
        let (from, to) = (view.from(), &view.system.regimes()[view.switch.to]);
        let tangent = to.prepared().stacked_left() * (saltation * from.prepared().stacked_right());
        LinearMap::of(&tangent).apply(&self.columns, &mut self.next);
    }
}

impl Observer for Jacobian {
    #[inline(always)]
    fn segment(&mut self, segment: &SegmentView<'_>) {
        let basis = segment.regime().basis();
        if basis.clusters.is_empty() {
            scale(
                &mut self.columns,
                &segment.turns[..layout::vectors_for(basis.len())],
            );
            return;
        }
        for column in self
            .columns
            .chunks_exact_mut(layout::vectors_for(basis.len()))
        {
            self.scratch.clear();
            self.scratch
                .extend((0..basis.len()).map(|k| layout::get(column, k)));
            basis.apply(&mut self.scratch, segment.length, segment.factors);
            for (k, q) in self.scratch.iter().enumerate() {
                layout::set(column, k, *q);
            }
        }
    }

    #[inline(always)]
    fn switch(&mut self, view: &SwitchView<'_>) {
        match &view.switch.tangent {
            Some(tangent) => tangent.apply(&self.columns, &mut self.next),
            None => self.saltate(view),
        }
        std::mem::swap(&mut self.columns, &mut self.next);
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
        let mut carried = Jacobian::at_start(self.system(), self.regime());
        self.run_period(&mut carried)?;
        carried.to_state(&self.system().regimes()[self.regime()], jacobian);
        Ok(())
    }
}
