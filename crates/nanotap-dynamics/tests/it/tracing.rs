//! Curves of bifurcations in two parameters, and assembled diagrams.

use std::convert::Infallible;

use nanotap_dynamics::{
    Bifurcation, BifurcationCurve, BifurcationKind, CensusOptions, ContinuationOptions, Control,
    CurveEnd, CurveOptions, DMatrix, Diagram, DiagramOptions, Direction, MapFamily,
    ShootingOptions, StartBox, TwoParameterFamily, assemble_diagram, census, close_orbit,
    continue_orbit, trace_curve,
};

use crate::systems::{Cubic, Family, Formula, Grazing, Henon, Logistic, System};

/// A family in two parameters with its second derivative.
struct Plane<F> {
    make: fn(f64, f64) -> F,
    second: fn(&F, &[f64], &mut [f64]),
}

impl<F: Formula> TwoParameterFamily for Plane<F> {
    type Map = System<F>;
    type Error = Infallible;

    fn at(&self, first: f64, second: f64) -> Result<System<F>, Infallible> {
        Ok(System((self.make)(first, second)))
    }

    fn advance_with_derivatives(
        &self,
        _parameters: [f64; 2],
        map: &mut System<F>,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
        derivatives: [&mut [f64]; 2],
    ) -> Result<(), Infallible> {
        use nanotap_dynamics::StroboscopicMap;
        let [first, second] = derivatives;
        map.0.derivative(state, first);
        (self.second)(&map.0, state, second);
        map.advance_with_jacobian(state, jacobian)
    }
}

const HENON: Plane<Henon> = Plane {
    make: |a, b| Henon { a, b },
    second: |_, x, out| {
        out[0] = 0.0;
        out[1] = x[0];
    },
};

fn first_of<F: MapFamily>(
    family: &F,
    parameter: f64,
    guess: &[f64],
    direction: Direction,
    range: (f64, f64),
    wanted: fn(&BifurcationKind) -> bool,
) -> Bifurcation {
    let mut map = family.at(parameter).unwrap();
    let orbit = close_orbit(&mut map, guess, 1, &ShootingOptions::default()).unwrap();
    let options = ContinuationOptions::over(range.0, range.1);
    let branch = continue_orbit(
        family,
        parameter,
        &orbit,
        direction,
        &options,
        &Control::default(),
    );
    branch
        .unwrap()
        .bifurcations
        .into_iter()
        .find(|b| wanted(&b.kind))
        .unwrap()
}

fn check(locus: &BifurcationCurve, second: (f64, f64), exact: impl Fn(f64) -> f64, tolerance: f64) {
    assert!(locus.points.len() > 20);
    for p in &locus.points {
        let e = exact(p.second);
        assert!(
            (p.first - e).abs() < tolerance,
            "{} {} {e}",
            p.second,
            p.first
        );
    }
    let (low, high) = locus
        .points
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| {
            (l.min(p.second), h.max(p.second))
        });
    assert_eq!((low, high), second, "{:?}", locus.ends);
    assert!(locus.ends.iter().all(|e| *e == CurveEnd::Window));
}

/// The Hénon map's fold a = −(1−b)²/4 and flip a = 3(1−b)²/4, for all b.
#[test]
fn henon_folds_and_flips_follow_their_parabolas() {
    let family: Family<Henon> = Family(|a| Henon { a, b: 0.3 });
    let options = CurveOptions::over((-1.0, 1.5), (-0.2, 0.6));
    let fold = first_of(
        &family,
        0.2,
        &[0.8, 0.2],
        Direction::Decreasing,
        (-0.5, 0.3),
        |k| *k == BifurcationKind::Fold,
    );
    let locus = trace_curve(&HENON, &fold, 0.3, &options, &Control::default()).unwrap();
    check(&locus, (-0.2, 0.6), |b| -(1.0 - b).powi(2) / 4.0, 1e-11);
    let flip = first_of(
        &family,
        0.2,
        &[0.8, 0.2],
        Direction::Increasing,
        (0.0, 0.6),
        |k| *k == BifurcationKind::Flip,
    );
    let locus = trace_curve(&HENON, &flip, 0.3, &options, &Control::default()).unwrap();
    check(
        &locus,
        (-0.2, 0.6),
        |b| 3.0 * (1.0 - b).powi(2) / 4.0,
        1e-11,
    );
}

/// The grazing normal form in (μ, b): the fold μ = 4(1−a)³/(27b²); the grazing μ = 0.
#[test]
fn soft_grazing_loci() {
    let plane: Plane<Grazing> = Plane {
        make: |mu, b| Grazing { mu, a: 0.4, b },
        second: |_, x, out| out[0] = x[0].max(0.0).powf(1.5),
    };
    let family: Family<Grazing> = Family(|mu| Grazing { mu, a: 0.4, b: 1.5 });
    let options = CurveOptions::over((-0.3, 0.3), (0.8, 3.0));
    let start = |wanted| {
        first_of(
            &family,
            -0.2,
            &[-0.3],
            Direction::Increasing,
            (-0.3, 0.3),
            wanted,
        )
    };
    let fold = start(|k| *k == BifurcationKind::Fold);
    let locus = trace_curve(&plane, &fold, 1.5, &options, &Control::default()).unwrap();
    check(
        &locus,
        (0.8, 3.0),
        |b| 4.0 * 0.6f64.powi(3) / (27.0 * b * b),
        1e-11,
    );
    let grazing = start(|k| matches!(k, BifurcationKind::Grazing { .. }));
    let locus = trace_curve(&plane, &grazing, 1.5, &options, &Control::default()).unwrap();
    check(&locus, (0.8, 3.0), |_| 0.0, 1e-12);
}

/// x → a x (1 − y) + c, y → x: det = a x = 1 on the Neimark–Sacker curve, so x = 1/a
/// and, from x = a x (1 − x) + c, c = 2/a − 1.
#[derive(Clone, Debug)]
struct Shifted(f64, f64);

impl Formula for Shifted {
    const DIMENSION: usize = 2;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        out[0] = self.0 * x[0] * (1.0 - x[1]) + self.1;
        out[1] = x[0];
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = self.0 * (1.0 - x[1]);
        out[(0, 1)] = -self.0 * x[0];
        out[(1, 0)] = 1.0;
        out[(1, 1)] = 0.0;
    }
    fn derivative(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] * (1.0 - x[1]);
        out[1] = 0.0;
    }
}

#[test]
fn a_neimark_sacker_locus() {
    let plane: Plane<Shifted> = Plane {
        make: Shifted,
        second: |_, _, out| {
            out[0] = 1.0;
            out[1] = 0.0;
        },
    };
    let family: Family<Shifted> = Family(|a| Shifted(a, 0.0));
    let point = first_of(
        &family,
        1.6,
        &[0.3, 0.3],
        Direction::Increasing,
        (1.4, 2.6),
        |k| matches!(k, BifurcationKind::NeimarkSacker { .. }),
    );
    let options = CurveOptions::over((1.2, 3.0), (-0.2, 0.3));
    let locus = trace_curve(&plane, &point, 0.0, &options, &Control::default()).unwrap();
    check(&locus, (-0.2, 0.3), |c| 2.0 / (1.0 + c), 1e-11);
}

/// The trace on it is a − 1: both multipliers reach 1 at a = 3, c = −1/3, where the curve ends.
#[test]
fn a_neimark_sacker_curve_ends_at_its_resonance() {
    let plane: Plane<Shifted> = Plane {
        make: Shifted,
        second: |_, _, out| {
            out[0] = 1.0;
            out[1] = 0.0;
        },
    };
    let family: Family<Shifted> = Family(|a| Shifted(a, 0.0));
    let point = first_of(
        &family,
        1.6,
        &[0.3, 0.3],
        Direction::Increasing,
        (1.4, 2.6),
        |k| matches!(k, BifurcationKind::NeimarkSacker { .. }),
    );
    let options = CurveOptions::over((1.2, 4.0), (-0.6, 0.3));
    let locus = trace_curve(&plane, &point, 0.0, &options, &Control::default()).unwrap();
    let resonance = locus.ends.iter().find_map(|end| match end {
        CurveEnd::CodimensionTwo {
            what,
            first,
            second,
        } => Some((*what, *first, *second)),
        _ => None,
    });
    let (what, a, c) = resonance.unwrap();
    assert_eq!(what, "1:1 resonance");
    assert!(
        (a - 3.0).abs() < 1e-2 && (c + 1.0 / 3.0).abs() < 1e-2,
        "{a} {c}"
    );
    assert!(locus.ends.contains(&CurveEnd::Window));
}

/// x → x + (1 − a² − b² − (x − c)²)/4: the fixed points meet at c on the circle a² + b² = 1.
#[derive(Clone, Debug)]
struct Sphere {
    a: f64,
    b: f64,
    c: f64,
}

impl Formula for Sphere {
    const DIMENSION: usize = 1;
    fn image(&self, x: &[f64], out: &mut [f64]) {
        let rest = 1.0 - self.a * self.a - self.b * self.b;
        out[0] = x[0] + 0.25 * (rest - (x[0] - self.c).powi(2));
    }
    fn jacobian(&self, x: &[f64], out: &mut DMatrix<f64>) {
        out[(0, 0)] = 1.0 - 0.5 * (x[0] - self.c);
    }
    fn derivative(&self, _x: &[f64], out: &mut [f64]) {
        out[0] = -0.5 * self.a;
    }
}

/// Once around in each direction, wherever the orbits are; at the origin they have no size.
#[test]
fn a_closed_curve_of_folds_closes() {
    type Make = fn(f64, f64) -> Sphere;
    let at_two: (Make, fn(f64) -> Sphere) = (
        |a, b| Sphere { a, b, c: 2.0 },
        |a| Sphere { a, b: 0.25, c: 2.0 },
    );
    let at_origin: (Make, fn(f64) -> Sphere) = (
        |a, b| Sphere { a, b, c: 0.0 },
        |a| Sphere { a, b: 0.25, c: 0.0 },
    );
    for ((make, line), c) in [(at_two, 2.0), (at_origin, 0.0)] {
        check_closed_curve(make, line, c);
    }
}

fn check_closed_curve(make: fn(f64, f64) -> Sphere, line: fn(f64) -> Sphere, c: f64) {
    let plane: Plane<Sphere> = Plane {
        make,
        second: |map, _, out| out[0] = -0.5 * map.b,
    };
    let fold = first_of(
        &Family(line),
        0.1,
        &[c + 0.9],
        Direction::Increasing,
        (-2.0, 2.0),
        |k| *k == BifurcationKind::Fold,
    );
    let options = CurveOptions::over((-2.0, 2.0), (-3.0, 3.0));
    let locus = trace_curve(&plane, &fold, 0.25, &options, &Control::default()).unwrap();
    assert_eq!(locus.ends, [CurveEnd::Closed, CurveEnd::Closed]);
    let mut turned: f64 = 0.0;
    for pair in locus.points.windows(2) {
        let (p, q) = (&pair[0], &pair[1]);
        assert!((q.first.hypot(q.second) - 1.0).abs() < 1e-11);
        turned += (p.first * q.second - q.first * p.second).asin();
    }
    // At most one step beyond, in either direction.
    let rounds = turned.abs() / std::f64::consts::TAU;
    assert!((1.9..2.2).contains(&rounds), "{rounds}");
}

#[test]
fn boxes_that_do_not_contain_the_start_are_refused() {
    let family: Family<Henon> = Family(|a| Henon { a, b: 0.3 });
    let flip = first_of(
        &family,
        0.2,
        &[0.8, 0.2],
        Direction::Increasing,
        (0.0, 0.6),
        |k| *k == BifurcationKind::Flip,
    );
    for (first, second) in [
        ((0.5, 1.0), (0.0, 1.0)),
        ((0.0, 1.0), (0.3, 0.3)),
        ((1.0, 0.0), (0.0, 1.0)),
    ] {
        let options = CurveOptions::over(first, second);
        assert!(trace_curve(&HENON, &flip, 0.3, &options, &Control::default()).is_err());
    }
    let good = CurveOptions::over((0.0, 1.0), (0.0, 1.0));
    let with = |min_step, initial_step, max_step| CurveOptions {
        min_step,
        initial_step,
        max_step,
        ..good.clone()
    };
    for bad in [
        CurveOptions::over((0.0, f64::INFINITY), (0.0, 1.0)),
        with(0.0, 1e-3, 1e-2),
        with(1e-2, 1e-3, 1e-2),
        with(1e-8, 1e-1, 1e-2),
        with(1e-8, 1e-3, f64::INFINITY),
        with(f64::NAN, 1e-3, 1e-2),
    ] {
        assert!(trace_curve(&HENON, &flip, 0.3, &bad, &Control::default()).is_err());
    }
}

/// From a census at r = 3.2 (one period-2 attractor): the doubled branch, the fixed point from
/// which it bifurcates, and two more doublings, each once.
#[test]
fn the_logistic_diagram_assembles_from_one_attractor() {
    let family: Family<Logistic> = Family(Logistic);
    let starts = StartBox::new(vec![0.0], vec![1.0]).unwrap().starts(1, 10);
    let found = census(
        &System(Logistic(3.2)),
        &starts,
        &CensusOptions::default(),
        &Control::default(),
    );
    let nanotap_dynamics::AttractorKind::Periodic(orbit) = &found.attractors[0].kind else {
        panic!()
    };
    let options = DiagramOptions {
        stable_doublings: false,
        continuation: ContinuationOptions::over(1.2, 3.6),
        doublings: 3,
        max_branches: 100,
    };
    // The same orbit twice is followed once.
    let seeds = vec![(3.2, orbit.clone()), (3.2, orbit.clone())];
    let diagram = assemble_diagram(&family, &seeds, &options, &Control::default());
    assert!(diagram.failures.is_empty(), "{:?}", diagram.failures);
    let mut periods: Vec<usize> = diagram.branches.iter().map(|b| b.branch.period).collect();
    periods.sort_unstable();
    // Two halves of period 2 and of period 1, then 4, 8 and 16.
    assert_eq!(periods, [1, 1, 2, 2, 4, 8, 16]);
    let mut flips: Vec<f64> = diagram
        .branches
        .iter()
        .flat_map(|b| &b.branch.bifurcations)
        .filter(|b| b.kind == BifurcationKind::Flip)
        .map(|b| b.parameter)
        .collect();
    flips.sort_by(f64::total_cmp);
    // 3, 1 + √6, 3.5440903596, 3.5644072661, 3.5687594195 (Briggs 1991's cascade).
    let known = [
        3.0,
        1.0 + 6f64.sqrt(),
        3.5440903596,
        3.5644072661,
        3.5687594195,
    ];
    assert_eq!(flips.len(), known.len(), "{flips:?}");
    for (f, k) in flips.iter().zip(known) {
        assert!((f - k).abs() < 2e-10, "{f} {k}");
    }
}

/// Idle threads follow seeds of other periods in advance, including those that turn out to lie on a
/// known branch: a period-2 orbit on the doubled branch of the first seed, a period-4 orbit on that
/// of the second, and a period-3 orbit twice.
#[test]
fn a_diagram_does_not_depend_on_the_number_of_threads() {
    let family: Family<Logistic> = Family(Logistic);
    let seed = |r: f64, period: usize| {
        let mut map = family.at(r).unwrap();
        let mut x = [0.4];
        for _ in 0..10_000 {
            x[0] *= r * (1.0 - x[0]);
        }
        let orbit = close_orbit(&mut map, &x, period, &ShootingOptions::default()).unwrap();
        assert_eq!(orbit.period, period);
        (r, orbit)
    };
    // Windows of the logistic map: period 3 opens at 1 + √8, period 5 at 3.738 (May 1976).
    let seeds = [
        seed(2.5, 1),
        seed(3.2, 2),
        seed(3.83, 3),
        seed(3.5, 4),
        seed(3.8318, 3),
        seed(3.7389, 5),
    ];
    let options = DiagramOptions {
        stable_doublings: false,
        continuation: ContinuationOptions::over(1.2, 3.9),
        doublings: 1,
        max_branches: 100,
    };
    let assembled = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        pool.install(|| assemble_diagram(&family, &seeds, &options, &Control::default()))
    };
    let alone = assembled(1);
    let periods: Vec<usize> = alone.branches.iter().map(|b| b.branch.period).collect();
    for (period, expected) in [(1, 2), (2, 1), (3, 2), (5, 2)] {
        let found = periods.iter().filter(|p| **p == period).count();
        assert_eq!(found, expected, "{period} of {periods:?}");
    }
    for threads in [2, 4] {
        assert_eq!(format!("{:?}", assembled(threads)), format!("{alone:?}"));
    }
    // Seeds that are added later give the same result as seeds at the end of the list.
    let mut later = Diagram::default();
    for part in [&seeds[..2], &seeds[2..]] {
        later.extend(&family, part, &options, &Control::default());
    }
    assert_eq!(format!("{later:?}"), format!("{alone:?}"));
}

/// The two fixed points ±√(r − 1) of the cubic map are mirror images with the same multiplier 3 −
/// 2r, on separate branches; a seed that is given twice is followed once.
#[test]
fn mirror_images_are_separate_branches() {
    let family: Family<Cubic> = Family(Cubic);
    let seed = |x: f64| {
        let mut map = family.at(1.5).unwrap();
        let orbit = close_orbit(&mut map, &[x], 1, &ShootingOptions::default()).unwrap();
        (1.5, orbit)
    };
    let options = DiagramOptions {
        stable_doublings: false,
        continuation: ContinuationOptions::over(1.2, 1.9),
        doublings: 0,
        max_branches: 100,
    };
    let seeds = [seed(0.7), seed(-0.7), seed(0.7)];
    let diagram = assemble_diagram(&family, &seeds, &options, &Control::default());
    let mut ends: Vec<f64> = diagram
        .branches
        .iter()
        .map(|b| b.branch.points.last().unwrap().orbit.states[0][0])
        .collect();
    ends.sort_by(f64::total_cmp);
    let exact = [-0.9f64.sqrt(), -0.2f64.sqrt(), 0.2f64.sqrt(), 0.9f64.sqrt()];
    assert_eq!(ends.len(), 4, "{ends:?}");
    for (end, exact) in ends.iter().zip(exact) {
        assert!((end - exact).abs() < 1e-12, "{end} {exact}");
    }
}
