//! Continuation, bifurcation points and branch switching, against closed forms.

use std::convert::Infallible;

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::{
    Bifurcation, BifurcationKind, Branch, BranchEnd, ContinuationError, ContinuationOptions,
    Control, Criticality, DMatrix, Direction, MapFamily, PeriodicOrbit, ShootingOptions, Stability,
    StroboscopicMap, Tangency, close_orbit, continue_orbit, switch_at_flip,
};

use crate::systems::{
    Cubic, DelayedLogistic, Family, Focus, Formula, Grazing, HardGrazing, Henon, Kinked, Logistic,
    Resonance,
};

fn orbit_at<F: MapFamily>(
    family: &F,
    parameter: f64,
    guess: &[f64],
    period: usize,
) -> PeriodicOrbit {
    let mut map = family.at(parameter).unwrap();
    close_orbit(&mut map, guess, period, &ShootingOptions::default()).unwrap()
}

fn branch<F: MapFamily>(
    family: &F,
    parameter: f64,
    guess: &[f64],
    period: usize,
    to: f64,
    range: (f64, f64),
) -> Branch {
    let orbit = orbit_at(family, parameter, guess, period);
    let direction = if to > parameter {
        Direction::Increasing
    } else {
        Direction::Decreasing
    };
    let options = ContinuationOptions::over(range.0, range.1);
    continue_orbit(
        family,
        parameter,
        &orbit,
        direction,
        &options,
        &Control::default(),
    )
    .unwrap()
}

fn parameters(branch: &Branch, is_wanted: fn(&BifurcationKind) -> bool) -> Vec<f64> {
    branch
        .bifurcations
        .iter()
        .filter(|b| is_wanted(&b.kind))
        .map(|b| b.parameter)
        .collect()
}

fn near(found: &[f64], exact: &[f64], tolerance: f64) {
    assert_eq!(found.len(), exact.len(), "{found:?} {exact:?}");
    for (f, e) in found.iter().zip(exact) {
        assert!((f - e).abs() < tolerance, "{found:?} {exact:?}");
    }
}

const FOLD: fn(&BifurcationKind) -> bool = |k| *k == BifurcationKind::Fold;
const FLIP: fn(&BifurcationKind) -> bool = |k| *k == BifurcationKind::Flip;
const CROSSING: fn(&BifurcationKind) -> bool = |k| *k == BifurcationKind::Crossing;
const GRAZING: fn(&BifurcationKind) -> bool = |k| matches!(k, BifurcationKind::Grazing { .. });
const TORUS: fn(&BifurcationKind) -> bool = |k| matches!(k, BifurcationKind::NeimarkSacker { .. });

const HENON: Family<Henon> = Family(|a| Henon { a, b: 0.3 });

/// Downwards from a = 0.2: through the fold at a = −(1−b)²/4 and up the unstable side, which goes
/// to infinity as a → 0.
#[test]
fn the_henon_fixed_point_branch_turns_at_its_fold() {
    let orbit = orbit_at(&HENON, 0.2, &[0.8, 0.2], 1);
    let options = ContinuationOptions {
        bound: 50.0,
        ..ContinuationOptions::over(-1.0, 1.2)
    };
    let b = continue_orbit(
        &HENON,
        0.2,
        &orbit,
        Direction::Decreasing,
        &options,
        &Control::default(),
    )
    .unwrap();
    near(&parameters(&b, FOLD), &[-0.7 * 0.7 / 4.0], 1e-12);
    assert!(matches!(b.end, BranchEnd::LeftDomain));
    let last = b.points.last().unwrap();
    let exact = (-0.7 - (0.49 + 4.0 * last.parameter).sqrt()) / (2.0 * last.parameter);
    assert!((last.orbit.states[0][0] / exact - 1.0).abs() < 1e-9);
    let unstable = Stability::Unstable {
        unstable_dimension: 1,
    };
    assert_eq!(last.orbit.stability, unstable);
    // Every point solves μ² + 2 a x μ − b = 0.
    for p in &b.points {
        let x = p.orbit.states[0][0];
        for m in &p.orbit.multipliers {
            let residual = m * m + m * 2.0 * p.parameter * x - 0.3;
            assert!(residual.modulus() < 1e-12 * (1.0 + m.norm_sqr()));
        }
    }
}

/// The fixed point 1 − 1/r of the logistic map has the multiplier 2 − r: −1.5 at r = 3.5.
#[test]
fn a_branch_ends_where_its_multiplier_exceeds_the_limit() {
    let orbit = orbit_at(&LOGISTIC, 2.5, &[0.6], 1);
    let options = ContinuationOptions {
        max_multiplier: 1.5,
        ..ContinuationOptions::over(2.0, 4.0)
    };
    let up = Direction::Increasing;
    let b = continue_orbit(&LOGISTIC, 2.5, &orbit, up, &options, &Control::default()).unwrap();
    let BranchEnd::Repelling { parameter } = b.end else {
        panic!("{}", b.end)
    };
    assert!((3.5..3.5 + 2.0 * options.max_step).contains(&parameter));
    assert!(!b.end.is_failure());
    let before = &b.points[b.points.len() - 2].orbit;
    assert!(before.spectral_radius() <= 1.5);
}

/// x → −(1 + λ) x + a x² + c x³ (x is the fixed point 0): a flip at λ = 0, supercritical for a² + c > 0
/// (Kuznetsov, section 4.5).
#[derive(Clone, Debug)]
struct Doubling {
    rate: f64,
    quadratic: f64,
    cubic: f64,
}

impl Formula for Doubling {
    const DIMENSION: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] * (-1.0 - self.rate + x[0] * (self.quadratic + self.cubic * x[0]));
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = -1.0 - self.rate + x[0] * (2.0 * self.quadratic + 3.0 * self.cubic * x[0]);
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        out[0] = -x[0];
    }
}

/// z → e^{i} z (1 + λ + s |z|²): the torus is at |z|² = −λ/s.
#[derive(Clone, Debug)]
struct Spiral {
    rate: f64,
    sign: f64,
}

impl Formula for Spiral {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        let (s, c) = 1.0f64.sin_cos();
        let r = 1.0 + self.rate + self.sign * (x[0] * x[0] + x[1] * x[1]);
        out[0] = r * (c * x[0] - s * x[1]);
        out[1] = r * (s * x[0] + c * x[1]);
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        let (s, c) = 1.0f64.sin_cos();
        let r = 1.0 + self.rate + self.sign * (x[0] * x[0] + x[1] * x[1]);
        let turned = [c * x[0] - s * x[1], s * x[0] + c * x[1]];
        let turn = [[c, -s], [s, c]];
        for i in 0..2 {
            for j in 0..2 {
                out[(i, j)] = r * turn[i][j] + 2.0 * self.sign * turned[i] * x[j];
            }
        }
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        let (s, c) = 1.0f64.sin_cos();
        out[0] = c * x[0] - s * x[1];
        out[1] = s * x[0] + c * x[1];
    }
}

fn doubling(quadratic: f64, cubic: f64, rate: f64) -> Doubling {
    Doubling {
        rate,
        quadratic,
        cubic,
    }
}

fn criticalities(branch: &Branch) -> Vec<Criticality> {
    let bifurcations = branch.bifurcations.iter();
    bifurcations.filter_map(|b| b.criticality).collect()
}

/// Where the parameter passes 0, of the fixed point 0.
fn at_zero<F: Formula>(map: fn(f64) -> F) -> Vec<Criticality> {
    let origin = vec![0.0; F::DIMENSION];
    criticalities(&branch(&Family(map), -0.1, &origin, 1, 0.1, (-0.1, 0.1)))
}

#[test]
fn the_criticality_is_that_of_the_normal_form() {
    use Criticality::{Subcritical, Supercritical};
    assert_eq!(at_zero(|rate| doubling(0.0, 1.0, rate)), [Supercritical]);
    assert_eq!(at_zero(|rate| doubling(0.0, -1.0, rate)), [Subcritical]);
    assert_eq!(at_zero(|rate| doubling(1.0, -0.9, rate)), [Supercritical]);
    assert_eq!(at_zero(|rate| doubling(1.0, -1.1, rate)), [Subcritical]);
    assert_eq!(at_zero(|rate| Spiral { rate, sign: -1.0 }), [Supercritical]);
    assert_eq!(at_zero(|rate| Spiral { rate, sign: 1.0 }), [Subcritical]);
    // Hénon's and the logistic map's cascades, and Maynard Smith's circle (Kuznetsov, example 4.2).
    let henon = branch(&HENON, 0.2, &[0.8, 0.2], 1, 1.2, (0.0, 1.2));
    assert_eq!(criticalities(&henon), [Supercritical]);
    let logistic = branch(&LOGISTIC, 2.5, &[0.6], 1, 3.6, (2.0, 3.6));
    assert_eq!(criticalities(&logistic), [Supercritical]);
    let delayed = Family(DelayedLogistic);
    let delayed = branch(&delayed, 1.8, &[0.44, 0.44], 1, 2.2, (1.5, 2.2));
    assert_eq!(criticalities(&delayed), [Supercritical]);
}

/// a = 3(1−b)²/4 for the first flip, (1−b)² + (1+b)²/4 for the second.
#[test]
fn henon_flips_and_its_doubled_branch() {
    let b = branch(&HENON, 0.2, &[0.8, 0.2], 1, 1.2, (0.0, 1.2));
    near(&parameters(&b, FLIP), &[0.3675], 1e-12);
    assert!(b.bifurcations[0].uncertainty < 1e-11);
    let options = ContinuationOptions::over(0.0, 1.2);
    let doubled =
        switch_at_flip(&HENON, &b.bifurcations[0], &options, &Control::default()).unwrap();
    assert_eq!(doubled.period, 2);
    assert!(matches!(doubled.end, BranchEnd::RangeEnd));
    near(&parameters(&doubled, FLIP), &[0.49 + 1.69 / 4.0], 1e-11);
    assert!(doubled.points[1].orbit.is_stable());
    assert!(!doubled.points.last().unwrap().orbit.is_stable());
}

const LOGISTIC: Family<Logistic> = Family(Logistic);

/// Two doublings: at 3 and 1 + √6; the period-4 orbit doubles at 3.5440903596.
#[test]
fn the_logistic_cascade() {
    let options = ContinuationOptions::over(2.0, 4.0);
    let first = branch(&LOGISTIC, 2.5, &[0.6], 1, 4.0, (2.0, 4.0));
    near(&parameters(&first, FLIP), &[3.0], 1e-12);
    let second = switch_at_flip(
        &LOGISTIC,
        &first.bifurcations[0],
        &options,
        &Control::default(),
    )
    .unwrap();
    near(&parameters(&second, FLIP), &[1.0 + 6f64.sqrt()], 1e-11);
    let third = switch_at_flip(
        &LOGISTIC,
        &second.bifurcations[0],
        &options,
        &Control::default(),
    )
    .unwrap();
    assert_eq!(third.period, 4);
    near(&parameters(&third, FLIP), &[3.5440903596], 1e-9);
}

/// The period-3 window opens in a fold at 1 + √8. Followed downwards from its stable side, the
/// branch returns upwards unstable.
#[test]
fn the_period_three_window_opens_in_a_fold() {
    let b = branch(&LOGISTIC, 3.835, &[0.5], 3, 3.0, (3.5, 4.0));
    near(&parameters(&b, FOLD), &[1.0 + 8f64.sqrt()], 1e-11);
    let last = b.points.last().unwrap();
    assert_eq!(last.parameter, 4.0);
    assert!((last.orbit.spectral_radius() - 8.0).abs() < 1e-9);
    assert_eq!(b.period, 3);
}

/// Followed downwards, the period-2 branch meets the fixed point at r = 3.
#[test]
fn a_doubled_branch_ends_at_its_flip() {
    let b = branch(&LOGISTIC, 3.3, &[0.8], 2, 2.0, (2.5, 3.5));
    let BranchEnd::Collapsed { period, parameter } = b.end else {
        panic!("{:?}", b.end)
    };
    assert_eq!(period, 1);
    assert!((parameter - 3.0).abs() < 1e-6, "{parameter}");
    assert!(b.bifurcations.is_empty(), "{:?}", b.bifurcations);
}

/// Another branch crosses the origin of the logistic map at r = 1; that of the cubic map has a
/// pitchfork at r = 1: a multiplier +1 without a fold.
#[test]
fn crossings_are_not_reported_as_folds() {
    let b = branch(&LOGISTIC, 0.4, &[0.0], 1, 2.0, (0.1, 2.0));
    near(&parameters(&b, CROSSING), &[1.0], 1e-12);
    assert!(parameters(&b, FOLD).is_empty());
    let b = branch(&Family(Cubic), 0.4, &[0.0], 1, 2.0, (0.1, 2.0));
    near(&parameters(&b, CROSSING), &[1.0], 1e-12);
}

/// The delayed logistic map: a = 2, multipliers e^{±iπ/3}.
#[test]
fn the_neimark_sacker_point_is_exact() {
    let b = branch(
        &Family(DelayedLogistic),
        1.5,
        &[0.3, 0.3],
        1,
        3.0,
        (1.4, 2.6),
    );
    near(&parameters(&b, TORUS), &[2.0], 1e-12);
    let BifurcationKind::NeimarkSacker { angle } = b.bifurcations[0].kind else {
        panic!()
    };
    assert!((angle - std::f64::consts::FRAC_PI_3).abs() < 1e-11);
    assert_eq!(b.bifurcations.len(), 1);
}

/// Two uncoupled real directions with multipliers λ and 1/(2 − λ). Their product passes 1 while
/// neither is complex: a neutral saddle, which is not a bifurcation.
#[derive(Clone, Debug)]
struct NeutralSaddle(f64);

impl Formula for NeutralSaddle {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = 2.0 * x[0];
        out[1] = self.0 * x[1];
    }
    fn jacobian(&self, _x: &[f64], out: &mut DMatrix<f64>) {
        out.fill(0.0);
        out[(0, 0)] = 2.0;
        out[(1, 1)] = self.0;
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        out[0] = 0.0;
        out[1] = x[1];
    }
}

#[test]
fn a_neutral_saddle_is_not_a_bifurcation() {
    let b = branch(&Family(NeutralSaddle), 0.3, &[0.0, 0.0], 1, 0.8, (0.2, 0.8));
    assert!(b.bifurcations.is_empty(), "{:?}", b.bifurcations);
    assert!(matches!(b.end, BranchEnd::RangeEnd));
}

const A: f64 = 0.4;

/// Grazing at μ = 0 and the nearby fold at μ = 4(1−a)³/(27b²).
#[test]
fn a_soft_grazing_and_its_fold() {
    let family = Family(|mu| Grazing { mu, a: A, b: 1.5 });
    let b = branch(&family, -0.2, &[-0.3], 1, 1.0, (-0.3, 0.3));
    near(&parameters(&b, GRAZING), &[0.0], 1e-12);
    let exact = 4.0 * (1.0 - A).powi(3) / (27.0 * 1.5 * 1.5);
    near(&parameters(&b, FOLD), &[exact], 1e-11);
    // Back down past μ = 0 on the unstable side, without another grazing.
    assert!(matches!(b.end, BranchEnd::RangeEnd));
    let last = b.points.last().unwrap();
    assert!(last.parameter < -0.299 && !last.orbit.is_stable());
    let x: f64 = last.orbit.states[0][0];
    assert!((last.parameter - ((1.0 - A) * x - 1.5 * x.powf(1.5))).abs() < 1e-12);
}

/// With b < 0 the contact causes a flip, at √x = −2(1 + a)/(3b).
#[test]
fn a_soft_grazing_and_its_flip() {
    let family = Family(|mu| Grazing { mu, a: A, b: -3.0 });
    let b = branch(&family, -0.2, &[-0.3], 1, 1.0, (-0.3, 0.5));
    near(&parameters(&b, GRAZING), &[0.0], 1e-12);
    let x = (2.0 * (1.0 + A) / 9.0f64).powi(2);
    near(
        &parameters(&b, FLIP),
        &[(1.0 - A) * x + 3.0 * x.powf(1.5)],
        1e-11,
    );
}

/// A hard grazing is found from the side on which the orbit is smooth, whether the orbit continues
/// beyond it with a vertical tangent (b > 0) or turns back in a corner (b < 0).
#[test]
fn a_hard_grazing_is_located() {
    for strength in [1.0, -1.0] {
        let family: Family<HardGrazing> = if strength > 0.0 {
            Family(|mu| HardGrazing { mu, a: A, b: 1.0 })
        } else {
            Family(|mu| HardGrazing { mu, a: A, b: -1.0 })
        };
        let b = branch(&family, -0.2, &[-0.3], 1, 1.0, (-0.3, 0.3));
        near(&parameters(&b, GRAZING), &[0.0], 1e-9);
    }
}

/// x → (x + μ)/2 with the fixed point μ, and extrema of several switching functions along the
/// orbit.
#[derive(Clone, Debug)]
struct Watched(f64);

impl nanotap_dynamics::Scheduling for Watched {}

impl StroboscopicMap for Watched {
    type Error = Infallible;

    fn dimension(&self) -> usize {
        1
    }

    fn period(&self) -> f64 {
        1.0
    }

    fn advance(&mut self, state: &mut [f64]) -> Result<(), Infallible> {
        state[0] = 0.5 * (state[0] + self.0);
        Ok(())
    }

    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), Infallible> {
        jacobian[(0, 0)] = 0.5;
        self.advance(state)
    }

    fn advance_with_tangencies(
        &mut self,
        state: &mut [f64],
        tangencies: &mut Vec<Tangency>,
    ) -> Result<(), Infallible> {
        let x = state[0];
        let mut extrema = vec![
            // Its time depends on the parameter.
            (0.2 + 0.1 * x, x - 0.3),
            // Two switching functions with one extremum.
            (0.45, x - 0.8),
            (0.45, 3.0),
            (0.7, 0.5 - x),
            // Passes the strobe at x = 0.4.
            ((0.9 + 0.25 * x) % 1.0, x - 0.62),
        ];
        // A minimum and a maximum appear, both away from zero.
        if x > 0.66 {
            extrema.extend([(0.31, 2.0), (0.33, 2.5)]);
        }
        extrema.sort_by(|a, b| a.0.total_cmp(&b.0));
        tangencies.extend(
            extrema
                .into_iter()
                .map(|(phase, value)| Tangency { phase, value }),
        );
        self.advance(state)
    }
}

struct WatchedFamily;

impl MapFamily for WatchedFamily {
    type Map = Watched;
    type Error = Infallible;

    fn at(&self, parameter: f64) -> Result<Watched, Infallible> {
        Ok(Watched(parameter))
    }

    fn advance_with_derivatives(
        &self,
        _parameter: f64,
        map: &mut Watched,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivative: &mut [f64],
    ) -> Result<(), Infallible> {
        derivative[0] = 0.5;
        map.advance_with_jacobian(state, jacobian)
    }
}

/// Each extremum grazes where its own value vanishes, at its own time, whatever other extrema are
/// near.
#[test]
fn moving_and_appearing_extrema_are_distinguished() {
    let b = branch(&WatchedFamily, 0.05, &[0.05], 1, 1.0, (0.05, 1.0));
    near(&parameters(&b, GRAZING), &[0.3, 0.5, 0.62, 0.8], 1e-12);
    assert_eq!(b.bifurcations.len(), 4);
    for (found, exact) in b.bifurcations.iter().zip([0.23, 0.7, 0.055, 0.45]) {
        let BifurcationKind::Grazing { time } = found.kind else {
            panic!()
        };
        assert!((time - exact).abs() < 1e-12, "{time} {exact}");
    }
}

/// Other threads locate them during the continuation; their positions are the same to the last
/// digit.
#[test]
fn bifurcations_do_not_depend_on_the_thread_that_locates_them() {
    let located = || {
        let watched = branch(&WatchedFamily, 0.05, &[0.05], 1, 1.0, (0.05, 1.0));
        let circle = branch(&Family(Isola), 0.1, &[1.0], 1, 1.0, (-2.0, 2.0));
        [watched, circle].map(|branch| {
            let of = |b: &Bifurcation| (b.kind, b.parameter, b.uncertainty, b.after_point);
            branch.bifurcations.iter().map(of).collect::<Vec<_>>()
        })
    };
    let alone = located();
    assert_eq!(alone.each_ref().map(Vec::len), [4, 2]);
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        assert_eq!(pool.build().unwrap().install(located), alone, "{threads}");
    }
}

/// x → x + (1 − x² − λ²)/4: the fixed points form a circle in (λ, x).
#[derive(Clone, Debug)]
struct Isola(f64);

impl Formula for Isola {
    const DIMENSION: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] + 0.25 * (1.0 - x[0] * x[0] - self.0 * self.0);
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = 1.0 - 0.5 * x[0];
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out[0] = -0.5 * self.0;
    }
}

#[test]
fn an_isola_closes() {
    let b = branch(&Family(Isola), 0.1, &[1.0], 1, 1.0, (-2.0, 2.0));
    assert!(matches!(b.end, BranchEnd::Closed), "{:?}", b.end);
    near(&parameters(&b, FOLD), &[1.0, -1.0], 1e-12);
    for p in &b.points {
        let radius = p.orbit.states[0][0].hypot(p.parameter);
        assert!((radius - 1.0).abs() < 1e-12);
    }
}

#[test]
fn bad_options_and_starts_are_refused() {
    let orbit = orbit_at(&LOGISTIC, 2.5, &[0.6], 1);
    let start = |parameter: f64, options: &ContinuationOptions| {
        continue_orbit(
            &LOGISTIC,
            parameter,
            &orbit,
            Direction::Increasing,
            options,
            &Control::default(),
        )
    };
    let good = ContinuationOptions::over(2.0, 3.0);
    assert!(matches!(
        start(5.0, &good),
        Err(ContinuationError::BadOptions(_))
    ));
    assert!(matches!(
        start(f64::NAN, &good),
        Err(ContinuationError::BadOptions(_))
    ));
    for bad in [
        ContinuationOptions {
            range: (3.0, 2.0),
            ..good.clone()
        },
        ContinuationOptions {
            min_step: 0.0,
            ..good.clone()
        },
        ContinuationOptions {
            max_step: 1e-5,
            ..good.clone()
        },
        ContinuationOptions {
            state_scale: Some(-1.0),
            ..good.clone()
        },
        ContinuationOptions {
            max_angle: f64::NAN,
            ..good.clone()
        },
    ] {
        assert!(matches!(
            start(2.5, &bad),
            Err(ContinuationError::BadOptions(_))
        ));
    }
    let b = branch(&HENON, 0.2, &[0.8, 0.2], 1, -1.0, (-1.0, 1.2));
    assert!(matches!(
        switch_at_flip(
            &HENON,
            &b.bifurcations[0],
            &ContinuationOptions::over(-1.0, 1.0),
            &Control::default()
        ),
        Err(ContinuationError::NotAFlip)
    ));
}

/// Through a resonance the orbit grows by a factor of ten thousand and shrinks again: the branch
/// reaches the other end in steps relative to its present size, not to its first one.
#[test]
fn a_branch_passes_a_resonance_in_few_steps() {
    let radius = 0.9999;
    let family = Family(|angle| {
        Resonance(Focus {
            radius: 0.9999,
            angle,
        })
    });
    let found = branch(&family, 3.0, &[0.5, 0.0], 1, -2.5, (-2.5, 3.0));
    assert!(matches!(found.end, BranchEnd::RangeEnd), "{}", found.end);
    assert!(found.points.len() < 1500, "{}", found.points.len());
    let largest = found
        .points
        .iter()
        .map(|p| p.orbit.states[0][0].hypot(p.orbit.states[0][1]))
        .fold(0.0, f64::max);
    assert!(largest > 0.5 / (1.0 - radius), "{largest}");
    assert!(found.bifurcations.is_empty());
    let last = found.points.last().unwrap();
    assert_eq!(last.parameter, -2.5);
    let (s, c) = 2.5f64.sin_cos();
    let size = 1.0 / (1.0 - radius * c).hypot(radius * s);
    let state = &last.orbit.states[0];
    assert!((state[0].hypot(state[1]) / size - 1.0).abs() < 1e-12);
}

/// Towards drive amplitude zero a homogeneous orbit shrinks to a point: the branch reaches that end
/// without leaving the range and without a bifurcation caused by rounding.
#[test]
fn a_homogeneous_branch_vanishes_at_zero_drive() {
    for (a, b) in [(0.3, 0.4), (0.3, -0.9), (-0.5, 0.2)] {
        for from in [1.0, 1e-3, 7.3e4] {
            let family = Family(match (a, b) {
                (0.3, 0.4) => |mu| Kinked { mu, a: 0.3, b: 0.4 },
                (0.3, _) => |mu| Kinked {
                    mu,
                    a: 0.3,
                    b: -0.9,
                },
                _ => |mu| Kinked {
                    mu,
                    a: -0.5,
                    b: 0.2,
                },
            });
            let found = branch(&family, from, &[from / (1.0 - a - b)], 1, 0.0, (0.0, from));
            assert!(!found.end.is_failure(), "{a} {b}: {}", found.end);
            assert!(found.bifurcations.is_empty());
            assert!(found.points.len() < 500, "{}", found.points.len());
            for p in &found.points {
                assert!((0.0..=from).contains(&p.parameter));
                let exact = p.parameter / (1.0 - a - b);
                assert!((p.orbit.states[0][0] - exact).abs() <= 1e-13 * from);
            }
            assert!(found.points.last().unwrap().parameter <= 0.05 * from);
        }
    }
}

/// A branch that is cut is a failure; one that reaches an end is not.
#[test]
fn only_a_cut_branch_is_a_failure() {
    let family = Family(Logistic);
    let orbit = orbit_at(&family, 2.0, &[0.5], 1);
    let options = ContinuationOptions {
        max_points: 5,
        ..ContinuationOptions::over(2.0, 3.5)
    };
    let control = Control::default();
    let cut = continue_orbit(
        &family,
        2.0,
        &orbit,
        Direction::Increasing,
        &options,
        &control,
    );
    assert!(cut.unwrap().end.is_failure());
    let whole = branch(&family, 2.0, &[0.5], 1, 3.5, (2.0, 3.5));
    assert!(!whole.end.is_failure());
}
