//! Jumps of the data from one branch to another: the location of a fold as a datum.
//!
//! Between two neighbouring rows on different branches the branch of the first row ends. If it ends
//! in a fold, the location λ of the fold is known from the model, by continuation of the branch.
//! The measured value is the middle between the rows. Its standard error is that of a uniform
//! distribution between them, their distance over √12.
//!
//! At a fold w (DPⁿ − 1) = 0 for a vector w. Differentiating Pⁿ(x; λ, θ) = x along the folds and
//! multiplying by w gives w·∂Pⁿ/∂λ dλ + w·∂Pⁿ/∂θ dθ = 0: the derivative of the location is exact
//! too.
//!
//! On a very hard sample the fold coincides with the grazing to rounding; the location of the
//! grazing is then used.
//!
//! Fails by omission: jumps where a branch loses stability in another way, and jumps at which the
//! data, but not the model, leave a branch.

use nalgebra::SymmetricEigen;
use nanotap_dynamics::{
    BifurcationKind, BranchEnd, ContinuationOptions, Control, Direction, PeriodicOrbit,
    continue_orbit,
};

use nanotap_case::{Case, Family, Key};
use nanotap_motions::map::Map;

use super::data::SweptKey;

/// Two neighbouring rows of a curve on different branches.
#[derive(Clone, Debug)]
pub(super) struct Jump {
    /// Index of the curve on which the jump lies.
    pub(super) curve: usize,
    /// The rows, counted over all curves.
    pub(super) rows: [usize; 2],
    /// The first row of the sequence on the branch that ends.
    pub(super) first: usize,
    /// Positions of the rows, without offsets.
    pub(super) between: [f64; 2],
    /// Largest distance beyond the jump over which the branch is followed.
    pub(super) reach: f64,
}

impl Jump {
    /// Returns the measured location of the jump: the middle of its rows, in the unit of the swept
    /// key.
    pub(super) fn at(&self) -> f64 {
        0.5 * (self.between[0] + self.between[1])
    }

    /// Returns the standard error of the measured location, in the unit of the swept key.
    pub(super) fn error(&self) -> f64 {
        (self.between[1] - self.between[0]).abs() / 12f64.sqrt()
    }
}

/// The end of a branch.
#[derive(Clone, Debug)]
pub(super) struct Fold {
    /// Location of the fold in the model, with offsets.
    pub(super) at: f64,
    /// True if the branch does not end here for these parameters; the fold is then the previous one.
    pub(super) lost: bool,
    /// The case, and the orbit at the fold.
    case: Case,
    orbit: PeriodicOrbit,
}

/// Largest number of points of a branch up to its fold.
const POINTS: usize = 60;

impl Fold {
    /// The fold of the branch through an orbit, in the direction of the jump; `base` is the case
    /// with the other values that the row sets.
    pub(super) fn beyond(
        base: &Case,
        swept: &SweptKey,
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
        // On a stiff sample the fold is so close to the grazing that the turn of the branch is not
        // resolved: a multiplier passes +1, or the branch ends at the grazing.
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

    /// Returns the same fold, marked as lost.
    pub(super) fn of_before(&self) -> Self {
        Self {
            lost: true,
            ..self.clone()
        }
    }

    /// Derivatives of the location with respect to `keys` of the case.
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
    use nanotap_case::file::Source;
    use nanotap_dynamics::{ClassifyOptions, MotionKind, classify};
    use nanotap_model::model_map::ModelMap;

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

    /// The end of the motion at a distance (nm) when the sample is moved, with a jump between two
    /// other distances.
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
        let swept = SweptKey {
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

    /// The end of the tapping motion when the sample is moved away.
    fn end(case: &Case) -> Fold {
        end_between(case, 15.0, [15.0, 16.0]).unwrap()
    }

    /// The amplitude of the free lever is 20 nm on a base that moves by 20 nm/Q: it reaches the
    /// sample at 19.974 nm, and on a hard sample its motion ends there, within a picometre.
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
