//! Where the data jump from one branch to another: the place of a fold as a datum.
//!
//! Between two neighbouring rows on different branches lies the end of the first row's branch. If
//! that is a fold (two orbits meet and vanish), its place λ is known from the model: the branch
//! is followed there by continuation. What was measured is the middle between the rows, with the
//! standard error of a place that is anywhere between them, their distance over √12.
//!
//! At a fold w (DPⁿ − 1) = 0 for a vector w, so that of Pⁿ(x; λ, θ) = x, differentiated along
//! the folds, w leaves w·∂Pⁿ/∂λ dλ + w·∂Pⁿ/∂θ dθ = 0: the derivative of the place is exact too.
//!
//! Over a sample so hard that the fold is the grazing to rounding, that place is taken.
//!
//! Fails by omission: jumps where a branch loses its stability in another way, and those at
//! which the data, not the model, are on no branch.

use nalgebra::SymmetricEigen;
use nanotap_dynamics::{
    BifurcationKind, BranchEnd, ContinuationOptions, Control, Direction, PeriodicOrbit,
    continue_orbit,
};

use crate::case::{Case, Family, Key};
use crate::map::Map;

use super::data::Swept;

/// Two neighbouring rows of a curve that lie on different branches.
#[derive(Clone, Debug)]
pub(super) struct Jump {
    /// The curve.
    pub(super) curve: usize,
    /// The rows, counted over all curves.
    pub(super) rows: [usize; 2],
    /// The first row of the run on the branch that ends.
    pub(super) first: usize,
    /// Between these places, offsets not included.
    pub(super) between: [f64; 2],
    /// How far the branch is followed beyond, at most.
    pub(super) reach: f64,
}

impl Jump {
    /// What was measured.
    pub(super) fn at(&self) -> f64 {
        0.5 * (self.between[0] + self.between[1])
    }

    /// Its standard error.
    pub(super) fn error(&self) -> f64 {
        (self.between[1] - self.between[0]).abs() / 12f64.sqrt()
    }
}

/// The end of a branch.
#[derive(Clone, Debug)]
pub(super) struct Fold {
    /// Its place as the model has it, offsets included.
    pub(super) at: f64,
    /// The branch does not end here with these parameters: it is the fold of before.
    pub(super) lost: bool,
    /// The case, and the orbit in it.
    case: Case,
    orbit: PeriodicOrbit,
}

/// Points of a branch on the way to its fold.
const POINTS: usize = 60;

impl Fold {
    /// Where the branch of an orbit at a place ends towards the jump; `base` is the case with
    /// whatever else the row sets.
    pub(super) fn beyond(
        base: &Case,
        swept: &Swept,
        (at, orbit): (f64, &PeriodicOrbit),
        (jump, offset): (&Jump, f64),
    ) -> Option<Self> {
        let [from, to] = jump.between;
        let side = (to - from).signum();
        let end = to + offset + side * jump.reach;
        if side * (end - at) <= 0.0 {
            return None;
        }
        let family = Family {
            case: base.clone(),
            key: swept.key,
        };
        let options = ContinuationOptions {
            initial_step: 1e-2,
            max_step: 0.1,
            max_angle: 0.3,
            max_points: POINTS,
            until_unstable: true,
            ..ContinuationOptions::over(at, end)
        };
        let way = if side > 0.0 {
            Direction::Increasing
        } else {
            Direction::Decreasing
        };
        let branch = continue_orbit(&family, at, orbit, way, &options, &Control::default()).ok()?;
        let stability = |kind: &BifurcationKind| !matches!(kind, BifurcationKind::Grazing { .. });
        let at = |parameter: f64, orbit: PeriodicOrbit| Self {
            at: parameter,
            lost: false,
            case: base.with(swept.key, parameter),
            orbit,
        };
        let grazing = branch.bifurcations.last().cloned();
        let mut bifurcations = branch.bifurcations.into_iter();
        // Over a stiff sample the fold is so near to the grazing that the branch's turn is not
        // seen, only that a multiplier passes +1, or nothing beyond the grazing at all.
        match bifurcations.find(|b| stability(&b.kind)) {
            Some(first) => {
                let ends = matches!(
                    first.kind,
                    BifurcationKind::Fold | BifurcationKind::Crossing
                );
                ends.then(|| at(first.parameter, first.orbit))
            }
            None => match branch.end {
                BranchEnd::Grazing { parameter } => {
                    let last = branch.points.into_iter().next_back()?;
                    Some(at(parameter, last.orbit))
                }
                BranchEnd::Unstable { .. } => grazing.map(|b| at(b.parameter, b.orbit)),
                _ => None,
            },
        }
    }

    /// The same where it is no more.
    pub(super) fn of_before(&self) -> Self {
        Self {
            lost: true,
            ..self.clone()
        }
    }

    /// How its place changes with `keys` of the case.
    pub(super) fn derivatives(&self, swept: Key, keys: &[Key]) -> Option<Vec<f64>> {
        let map = Map::new(&self.case).ok()?;
        let mut all = vec![swept];
        all.extend(keys);
        let state = self.orbit.states.first()?;
        let linear = map.linearised(state, self.orbit.period, &all).ok()?;
        let mut matrix = linear.jacobian;
        for k in 0..matrix.nrows() {
            matrix[(k, k)] -= 1.0;
        }
        let eigen = SymmetricEigen::new(&matrix * matrix.transpose());
        let (least, _) = eigen.eigenvalues.argmin();
        let left = eigen.eigenvectors.column(least).into_owned();
        let along = linear.derivatives.tr_mul(&left);
        let slopes: Vec<f64> = (1..all.len()).map(|k| -along[k] / along[0]).collect();
        slopes
            .iter()
            .all(|slope| slope.is_finite())
            .then_some(slopes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::file::Source;
    use crate::model::model_map::ModelMap;
    use nanotap_dynamics::{ClassifyOptions, MotionKind, classify};

    fn lever(overrides: &[&str]) -> Case {
        let source = Source {
            name: "lever.toml".into(),
            text: "[model]\nmodes = 2\n[cantilever]\nk = \"42 N/m\"\nf0 = \"330 kHz\"\nQ = 400\n\
                   [sample]\nstiffness = \"30 N/m\"\nloss_tangent = 0.1\n[drive]\n\
                   frequency_ratio = 1.001\nfree_amplitude = \"20 nm\"\n[gap]\ntip = \"15 nm\"\n"
                .into(),
        };
        let words: Vec<String> = overrides.iter().map(|word| (*word).to_owned()).collect();
        Case::parse(Some(source), &words).unwrap()
    }

    /// Where the motion at a distance (nm) ends as the sample is moved, with a jump between two
    /// others.
    fn end_between(case: &Case, at: f64, between: [f64; 2]) -> Option<Fold> {
        let at = 1e-9 * at;
        let case = case.with(Key::GapTip, at);
        let model = case.model().unwrap();
        let rest = vec![0.0; model.dimension()];
        let end = classify(
            &mut ModelMap::new(&model),
            &rest,
            &ClassifyOptions::default(),
        );
        let MotionKind::Periodic(orbit) = end.kind else {
            panic!("{end:?}")
        };
        let swept = Swept {
            key: Key::GapTip,
            name: "distance".into(),
            unit: "nm".into(),
            factor: 1e-9,
        };
        let jump = Jump {
            curve: 0,
            rows: [0, 1],
            first: 0,
            between: between.map(|nm| 1e-9 * nm),
            reach: 20e-9,
        };
        Fold::beyond(&case, &swept, (at, &orbit), (&jump, 0.0))
    }

    /// Where the tapping motion ends as the sample is moved away.
    fn end(case: &Case) -> Fold {
        end_between(case, 15.0, [15.0, 16.0]).unwrap()
    }

    /// The free lever swings by 20 nm about a base that moves by 20 nm/Q: it touches at 19.974 nm,
    /// and over a hard sample its motion ends there, within a picometre.
    #[test]
    fn free_motion_ends_over_samples_of_any_stiffness() {
        for stiffness in ["30 N/m", "300 N/m", "2 kN/m", "20 kN/m", "200 kN/m"] {
            let hard = lever(&[&format!("sample.stiffness={stiffness}")]);
            let fold = end_between(&hard, 21.0, [20.0, 19.5]);
            let at = fold.expect(stiffness).at;
            assert!((at - 19.974_4e-9).abs() < 2e-12, "{stiffness}: {at}");
        }
    }

    #[test]
    fn folds_move_as_their_derivatives_say() {
        let case = lever(&[]);
        let fold = end(&case);
        // The retract of docs/cases/approach-curve.md leaves the sample near 23 nm.
        assert!((22e-9..24e-9).contains(&fold.at), "{}", fold.at);
        let keys = [Key::SampleStiffness, Key::LeverQ, Key::DriveFrequency];
        let exact = fold.derivatives(Key::GapTip, &keys).unwrap();
        for (key, exact) in keys.into_iter().zip(exact) {
            let value = case.get(key);
            let step = 1e-4
                * value
                * if key == Key::DriveFrequency {
                    0.01
                } else {
                    1.0
                };
            let [a, b, c, d] =
                [-2.0, -1.0, 1.0, 2.0].map(|side| end(&case.with(key, value + side * step)).at);
            let difference = (a - 8.0 * b + 8.0 * c - d) / (12.0 * step);
            assert!(
                (exact / difference - 1.0).abs() < 1e-5,
                "{key}: {exact} {difference}"
            );
        }
    }
}
