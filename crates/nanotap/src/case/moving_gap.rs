//! A case whose tip–sample distance changes from one drive period to the next, without a new model.
//!
//! The gap enters the equations by constant forces and thresholds, linearly: no matrix, spectrum or
//! tone depends on it. So all constants at any gap follow from those of two models; under a nonlinear
//! law the gap is one offset.

use std::sync::Arc;

use nanotap_dynamics::StroboscopicMap as _;

use super::{Case, CaseError};
use crate::model::model_map::ModelMap;
use crate::model::{Model, MotionError};

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::cantilever::Cantilever;
    use crate::model::contact::ContactLaw;
    use crate::model::oscillator::{Oscillator, Stop};
    use crate::observe::{ObservableSet, measure};

    /// Every contact law, a nonlinear law, and both stops.
    fn cases() -> Vec<Case> {
        let paper = Cantilever::paper();
        let mut cases: Vec<Case> = ContactLaw::ALL
            .into_iter()
            .map(|law| {
                let numbers: &[f64] = match law.entry().numbers.len() {
                    0 => &[],
                    2 => &[40.0, 0.05],
                    _ => &[60.0, 8.0, 0.4],
                };
                let alpha6 = if law.has_damper() { 0.2 } else { 0.0 };
                let case = Cantilever {
                    alpha6,
                    ..paper.clone()
                };
                let mut case = case.on(law, numbers);
                if law.entry().arms {
                    case.arms = vec![[1.0, 0.5], [8.0, 0.2]];
                }
                Case::from(case)
            })
            .collect();
        for stop in [
            Stop::Soft {
                stiffness: 20.0,
                damping: 0.2,
            },
            Stop::Rigid { restitution: 0.8 },
        ] {
            cases.push(Case::from(Oscillator {
                mass: 1.0,
                stiffness: 1.0,
                damping: 0.1,
                forcing: 1.0,
                omega: 2.5,
                gap: 0.1,
                stop,
            }));
        }
        let words = [
            "cantilever.k=2 N/m",
            "cantilever.f0=70 kHz",
            "cantilever.Q=200",
            "tip.radius=10 nm",
            "sample.law=dmt",
            "sample.modulus=1 GPa",
            "sample.hamaker=1e-19 J",
            "drive.frequency=70 kHz",
            "drive.free_amplitude=10 nm",
            "gap.tip=1 nm",
        ];
        cases.push(Case::parse(None, &words.map(str::to_owned)).unwrap());
        cases
    }

    /// A moved gap is the model of the case at that gap: motions, outputs and energies.
    #[test]
    fn a_moved_gap_is_that_of_a_new_model() {
        for case in cases() {
            let start = case.get(case.gap_key());
            let mut moving = MovingGap::new(&case).unwrap();
            let mut state = moving.model().unwrap().rest();
            let other = state.clone();
            let mut contacts = 0.0;
            for k in 0..12 {
                let gap = start * (1.0 - 0.03 * f64::from(k)) + 1e-3 * f64::from(k % 3);
                let fresh = case.with(case.gap_key(), gap).model().unwrap();
                let mut expected = state.clone();
                ModelMap::new(&fresh).advance(&mut expected).unwrap();
                moving.set(gap).unwrap();
                let here = moving.model().unwrap();
                let [seen, known] = [here, &fresh]
                    .map(|model| measure(model, &state, 1, ObservableSet::ALL).unwrap());
                let size = known.peak_force.abs() + 1e-3;
                assert!((seen.peak_force - known.peak_force).abs() < 1e-10 * size);
                let [sample, other] = [&seen, &known].map(|of| of.energy_balance.sample_damping);
                assert!((sample - other).abs() < 1e-10 * size);
                contacts += known.contacts_per_period;
                moving.advance(&mut state).unwrap();
                for (found, expected) in state.iter().zip(&expected) {
                    assert!((found - expected).abs() < 1e-11 * (1.0 + expected.abs()));
                }
            }
            assert!(contacts > 0.0);
            // Back at the first gap all is as before.
            moving.set(start).unwrap();
            let [mut state, mut expected] = [other.clone(), other];
            moving.advance(&mut state).unwrap();
            let first = case.model().unwrap();
            ModelMap::new(&first).advance(&mut expected).unwrap();
            assert_eq!(state, expected);
            assert!(moving.set(f64::NAN).is_err());
        }
    }
}
