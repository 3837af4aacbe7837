//! Closed branches of subharmonic orbits, compared with closed forms.

use std::f64::consts::{FRAC_PI_4, PI};

use nanotap_dynamics::{
    BifurcationKind, BranchEnd, ContinuationOptions, Control, DMatrix, DiagramOptions, Direction,
    MapFamily, PeriodicOrbit, ShootingOptions, assemble_diagram, close_orbit, continue_orbit,
};

use crate::systems::{Family, Formula};

/// A mode-locked torus: on an ellipse with half-axes 10 and 1 the angle advances by π/4 + (λ − cos
/// 8φ)/20, and the size of the ellipse relaxes to 1. Its orbits of period 8 satisfy cos 8φ = λ: a
/// stable and an unstable one for |λ| < 1, on one closed branch. Once around the branch φ grows by
/// π/4, which is the same orbit at the next strobe.
#[derive(Clone, Debug)]
struct Tongue(f64);

const AXES: [f64; 2] = [10.0, 1.0];

impl Tongue {
    /// Size, angle, angle one period later and its derivative by the angle.
    fn polar(&self, x: &[f64]) -> [f64; 4] {
        let (a, b) = (x[0] / AXES[0], x[1] / AXES[1]);
        let angle = b.atan2(a);
        let next = angle + FRAC_PI_4 + (self.0 - (8.0 * angle).cos()) / 20.0;
        [a.hypot(b), angle, next, 1.0 + 0.4 * (8.0 * angle).sin()]
    }
}

impl Formula for Tongue {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        let [size, _, next, _] = self.polar(x);
        let size = 1.0 + 0.3 * (size - 1.0);
        out[0] = AXES[0] * size * next.cos();
        out[1] = AXES[1] * size * next.sin();
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        let [size, angle, next, rate] = self.polar(x);
        let grown = 1.0 + 0.3 * (size - 1.0);
        let [outwards, along] = [[next.cos(), next.sin()], [-next.sin(), next.cos()]];
        let by_size = [angle.cos(), angle.sin()];
        let by_angle = [-angle.sin() / size, angle.cos() / size];
        for i in 0..2 {
            for j in 0..2 {
                let entry = 0.3 * outwards[i] * by_size[j] + grown * rate * along[i] * by_angle[j];
                out[(i, j)] = AXES[i] * entry / AXES[j];
            }
        }
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        let [size, _, next, _] = self.polar(x);
        let grown = 1.0 + 0.3 * (size - 1.0);
        out[0] = -AXES[0] * grown * next.sin() / 20.0;
        out[1] = AXES[1] * grown * next.cos() / 20.0;
    }
}

const TONGUE: Family<Tongue> = Family(Tongue);

/// The orbit at λ = cos 8φ that begins at angle φ.
fn at_angle(angle: f64) -> (f64, PeriodicOrbit) {
    let parameter = (8.0 * angle).cos();
    let guess = [AXES[0] * angle.cos(), AXES[1] * angle.sin()];
    let orbit = close_orbit(
        &mut TONGUE.at(parameter).unwrap(),
        &guess,
        8,
        &ShootingOptions::default(),
    );
    (parameter, orbit.unwrap())
}

fn fold_parameters(branch: &nanotap_dynamics::Branch) -> Vec<f64> {
    let folds = branch.bifurcations.iter();
    folds
        .inspect(|b| assert_eq!(b.kind, BifurcationKind::Fold))
        .map(|b| b.parameter)
        .collect()
}

/// From any first orbit and in either direction: two folds, at λ = ±1, and an end at the first
/// orbit.
#[test]
fn a_branch_that_meets_its_first_orbit_at_another_strobe_is_closed() {
    let options = ContinuationOptions::over(-2.0, 2.0);
    for begin in [0.05, 0.3, 1.2, 1.5] {
        for (direction, sign) in [(Direction::Increasing, 1.0), (Direction::Decreasing, -1.0)] {
            let (parameter, orbit) = at_angle(begin);
            let none = Control::default();
            let branch =
                continue_orbit(&TONGUE, parameter, &orbit, direction, &options, &none).unwrap();
            assert!(matches!(branch.end, BranchEnd::Closed), "{:?}", branch.end);
            let folds = fold_parameters(&branch);
            assert_eq!(folds.len(), 2, "{folds:?}");
            assert!(
                (folds[0] - sign).abs() < 1e-12 && (folds[1] + sign).abs() < 1e-12,
                "{folds:?}"
            );
            let ends = [branch.points.first(), branch.points.last()].map(Option::unwrap);
            assert!((ends[0].parameter - ends[1].parameter).abs() < 1e-9);
            let (shift, distance) = ends[0].orbit.distance_to(&ends[1].orbit);
            assert!(shift != 0 && distance < 1e-8, "{shift} {distance}");
        }
    }
}

/// Seeds on both orbits and at several strobes, one of them near a fold with all points of the
/// branch on one side, give one branch.
#[test]
fn orbits_on_one_closed_branch_are_one_branch_of_the_diagram() {
    let options = DiagramOptions {
        stable_doublings: false,
        continuation: ContinuationOptions::over(-2.0, 2.0),
        doublings: 2,
        max_branches: 64,
    };
    let seeds = [
        0.05,
        0.05 + FRAC_PI_4,
        0.05 - PI,
        -0.05,
        0.6,
        PI / 8.0 + 1e-3,
    ]
    .map(at_angle);
    let diagram = assemble_diagram(&TONGUE, &seeds, &options, &Control::default());
    assert!(diagram.failures.is_empty(), "{:?}", diagram.failures);
    assert_eq!(diagram.branches.len(), 1);
    assert_eq!(fold_parameters(&diagram.branches[0].branch).len(), 2);
}
