//! A case whose tip–sample distance changes from one drive period to the next, without a new model.
//!
//! The gap enters the equations by constant forces and thresholds, linearly: no matrix, spectrum or
//! tone depends on it. So all constants at any gap follow from those of two models; under a nonlinear
//! law the gap is one offset.

use std::sync::Arc;

use nanotap_dynamics::StroboscopicMap as _;

use super::{Case, CaseError};
use nanotap_model::model_map::ModelMap;
use nanotap_model::{Model, MotionError};

/// The map and the model of a case at a gap that can be changed for the price of a few additions.
#[derive(Clone, Debug)]
pub struct MovingGap {
    map: ModelMap,
    model: Model,
    /// Present gap, in the model's unit of length, and that of `model`.
    gap: [f64; 2],
    /// Of the map: constants of the system and of the gap.
    system: Constants,
    outputs: Constants,
}

/// Numbers that depend linearly on the gap.
#[derive(Clone, Debug)]
struct Constants {
    /// Gap at which they are `base`.
    from: f64,
    base: Vec<f64>,
    slopes: Vec<f64>,
}

impl Constants {
    /// Those that `each` visits in two models, whose gaps differ by 1.
    fn between(
        from: f64,
        models: &mut [Model; 2],
        each: impl Fn(&mut Model, &mut Vec<f64>),
    ) -> Self {
        let [mut base, mut slopes] = [Vec::new(), Vec::new()];
        each(&mut models[0], &mut base);
        each(&mut models[1], &mut slopes);
        for (slope, base) in slopes.iter_mut().zip(&base) {
            *slope -= base;
        }
        Self { from, base, slopes }
    }

    /// Sets the constants, visited in the same order, to their values at a gap.
    fn at(&self, gap: f64) -> impl FnMut(&mut f64) {
        let moved = gap - self.from;
        let mut values = self.base.iter().zip(&self.slopes);
        move |constant| {
            if let Some((base, slope)) = values.next() {
                *constant = base + moved * slope;
            }
        }
    }
}

impl MovingGap {
    /// The map and the model of `case` at its own gap.
    ///
    /// # Errors
    /// As [`Case::model`].
    pub fn new(case: &Case) -> Result<Self, CaseError> {
        let gap = case.get(case.gap_key());
        let model = case.model()?;
        let mut models = [model.clone(), case.with(case.gap_key(), gap + 1.0).model()?];
        let system = Constants::between(gap, &mut models, |model, all| {
            Arc::make_mut(&mut model.system).each_constant(&mut |constant| all.push(*constant));
            all.push(model.gap.constant);
        });
        let outputs = Constants::between(gap, &mut models, |model, all| {
            model.each_output_constant(&mut |constant| all.push(*constant));
            Arc::make_mut(&mut model.system).each_constant(&mut |constant| all.push(*constant));
        });
        Ok(Self {
            map: ModelMap::new(&model),
            model,
            gap: [gap; 2],
            system,
            outputs,
        })
    }

    /// Changes the gap, given in the model's unit of length.
    ///
    /// # Errors
    /// When it is not finite.
    pub fn set(&mut self, gap: f64) -> Result<(), MotionError> {
        self.gap[0] = gap;
        self.map.move_gap(gap, &mut self.system.at(gap))
    }

    /// The drive period, in the model's unit of time.
    pub fn period(&self) -> f64 {
        self.map.period()
    }

    /// Advances a state by one drive period at the present gap.
    ///
    /// # Errors
    /// When the motion cannot be followed.
    pub fn advance(&mut self, state: &mut [f64]) -> Result<(), MotionError> {
        self.map.advance(state)
    }

    /// The model at the present gap.
    ///
    /// # Errors
    /// When the gap is not finite.
    pub fn model(&mut self) -> Result<&Model, MotionError> {
        let [gap, known] = self.gap;
        if gap != known {
            let mut visit = self.outputs.at(gap);
            self.model.each_output_constant(&mut visit);
            Arc::make_mut(&mut self.model.system).each_constant(&mut visit);
            if let Some(nonlinear) = &mut self.model.nonlinear {
                Arc::make_mut(nonlinear).set_gap(gap)?;
            }
            self.model.set_gap_of_equations(gap);
            self.gap[1] = gap;
        }
        Ok(&self.model)
    }
}
