//! Detection and location of bifurcations along a branch.
//!
//! | kind | test function |
//! |---|---|
//! | fold | the parameter's component of the tangent |
//! | crossing | Π(μ − 1), where no fold explains its sign change |
//! | flip | Π(μ + 1) |
//! | Neimark–Sacker | Π_{i<j}(μ_i μ_j − 1), where the pair is complex |
//! | grazing | an extremum of a switching function, matched from point to point |
//!
//! Each product is replaced by its sign times the smallest factor: the zeros are the same, and it
//! neither overflows nor underflows. A sign change between neighbouring points is located along the
//! arc, with a Newton solution at every trial, to a bracket of 1e-12 of the parameter or rounding.
//!
//! Fails: two zeros of one function between neighbouring points cancel and are missed (shorter
//! steps find them). Extrema are matched by their times, so a grazing is missed if its time changes
//! by more than the distance to the next extremum within 1/256 of a step. Multipliers that nearly
//! coincide on the unit circle, and therefore the bifurcation point, are accurate to the square
//! root of rounding only.

use nalgebra::Complex;
use nanotap_arithmetic::ComplexFunctions as _;

use crate::continuation::criticality::{Criticality, criticality};
use crate::continuation::solver::{BranchSolver, Node, OrbitTangency};
use crate::map::MapFamily;
use crate::orbit::PeriodicOrbit;
use crate::orbit::multipliers::Multipliers;
use crate::vector::dot;

/// Kind of a bifurcation, with the quantity that its kind has: an angle or a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BifurcationKind {
    /// Saddle-node bifurcation: two orbits meet and vanish, a multiplier is +1 and the branch
    /// turns.
    Fold,
    /// Pitchfork or transcritical bifurcation: another branch of the same period crosses, a
    /// multiplier is +1 and the branch continues.
    Crossing,
    /// Period doubling: a multiplier −1.
    Flip,
    /// Neimark–Sacker bifurcation: a complex pair crosses the unit circle and a torus appears or
    /// vanishes.
    NeimarkSacker {
        /// Angle of the pair in radians, in (0, π).
        angle: f64,
    },
    /// An extremum of a switching function reaches zero: a contact appears or vanishes.
    Grazing {
        /// Time of the extremum in drive periods, from the first state of the orbit.
        time: f64,
    },
}

/// A bifurcation located on a branch.
#[derive(Clone, Debug)]
pub struct Bifurcation {
    /// Kind of the bifurcation, with its angle or time.
    pub kind: BifurcationKind,
    /// Parameter value at the bifurcation, in units of the parameter.
    pub parameter: f64,
    /// Whether the motion that a flip or a Neimark–Sacker bifurcation creates is on the unstable
    /// side; `None` for the other kinds, and where it is not known.
    pub criticality: Option<Criticality>,
    /// Width of the final bracket, in units of the parameter.
    pub uncertainty: f64,
    /// The orbit at the bifurcation. At a fold or crossing its error estimate is large, because the
    /// parameter alone does not determine it.
    pub orbit: PeriodicOrbit,
    /// Index of the branch point before it, in the direction of continuation.
    pub after_point: usize,
    /// The solution, used for branch switching.
    pub(crate) node: Node,
}

/// Values of the test functions at one point.
#[derive(Clone, Debug)]
pub(crate) struct Tests {
    pub(crate) fold: f64,
    pub(crate) crossing: f64,
    pub(crate) flip: f64,
    pub(crate) neimark_sacker: f64,
    pub(crate) tangencies: Vec<OrbitTangency>,
}

impl Tests {
    pub(crate) fn new<F: MapFamily>(
        solver: &mut BranchSolver<'_, F>,
        node: &Node,
        grazings: bool,
    ) -> Option<Self> {
        let multipliers = Multipliers::of_product(&node.jacobians).ok()?.values;
        let crossing = plus_one(&multipliers);
        Some(Self {
            fold: node.slope,
            // A doubled branch crosses itself where it begins, one stroboscopic period later.
            crossing: if node.slope == 0.0 { 0.0 } else { crossing },
            flip: minus_one(&multipliers),
            neimark_sacker: pair_on_circle(&multipliers).0,
            tangencies: if grazings {
                solver.tangencies(node).ok()?
            } else {
                Vec::new()
            },
        })
    }

    /// True if [`between`] may find a bifurcation between two neighbouring points of an orbit of
    /// period `n`.
    pub(crate) fn any_changes([a, b]: [&Self; 2], n: usize) -> bool {
        let signs = |tests: &Self| {
            [tests.fold, tests.crossing, tests.flip, tests.neimark_sacker].map(|test| test < 0.0)
        };
        let goes_on = |t: &OrbitTangency| {
            nearest(&b.tangencies, *t, n as f64)
                .is_none_or(|(k, _)| t.value * b.tangencies[k].value >= 0.0)
        };
        signs(a) != signs(b)
            || negative(&a.tangencies) != negative(&b.tangencies)
            || !a.tangencies.iter().all(goes_on)
    }
}

/// Number of extrema below zero.
fn negative(tangencies: &[OrbitTangency]) -> usize {
    tangencies.iter().filter(|t| t.value < 0.0).count()
}

/// Π(1 − μ), as sign times smallest factor.
fn plus_one(multipliers: &[Complex<f64>]) -> f64 {
    real_product(multipliers, -1.0)
}

/// Π(1 + μ) over the multipliers of an orbit with these Jacobians: negative beyond a flip.
pub(crate) fn flip_test(jacobians: &[nalgebra::DMatrix<f64>]) -> Option<f64> {
    Some(minus_one(&Multipliers::of_product(jacobians).ok()?.values))
}

/// Π(1 + μ), as sign times smallest factor.
fn minus_one(multipliers: &[Complex<f64>]) -> f64 {
    real_product(multipliers, 1.0)
}

fn real_product(multipliers: &[Complex<f64>], sign: f64) -> f64 {
    let mut negative = false;
    let mut smallest = f64::INFINITY;
    for m in multipliers {
        let factor = 1.0 + sign * m;
        // A pair contributes |factor|² > 0.
        negative ^= m.im == 0.0 && factor.re < 0.0;
        smallest = smallest.min(factor.modulus());
    }
    if negative { -smallest } else { smallest }
}

/// Π_{i<j}(μ_i μ_j − 1) as sign times smallest factor, and the pair with the
/// smallest factor among those that are complex conjugates.
fn pair_on_circle(multipliers: &[Complex<f64>]) -> (f64, Option<(Complex<f64>, f64)>) {
    let mut negative = false;
    let mut smallest = f64::INFINITY;
    let mut pair = None;
    let mut pair_factor = f64::INFINITY;
    for (i, a) in multipliers.iter().enumerate() {
        for b in &multipliers[i + 1..] {
            let conjugates = a.im != 0.0 && (a - b.conj()).modulus() <= 1e-9 * a.modulus();
            let factor = if conjugates {
                Complex::new(a.norm_sqr() - 1.0, 0.0)
            } else {
                a * b - 1.0
            };
            // Products that are not real come in conjugate pairs, whose contribution is positive.
            let real = conjugates || (a.im == 0.0 && b.im == 0.0);
            negative ^= real && factor.re < 0.0;
            smallest = smallest.min(factor.modulus());
            if conjugates && factor.modulus() < pair_factor {
                pair_factor = factor.modulus();
                pair = Some((if a.im > 0.0 { *a } else { *b }, factor.re));
            }
        }
    }
    if !smallest.is_finite() {
        return (1.0, None);
    }
    (if negative { -smallest } else { smallest }, pair)
}

/// A zero between two nodes.
struct Zero {
    at: f64,
    node: Node,
    uncertainty: f64,
    value: f64,
}

/// Part of a branch: its two ends and their positions along the tangent of `from`.
#[derive(Clone, Copy)]
struct Segment<'a> {
    from: &'a Node,
    ends: [&'a Node; 2],
    span: (f64, f64),
}

/// Locates the sign change of `test` on a part of the branch: regula falsi (Illinois) with a
/// bisection at every third trial. `None` if the corrector fails, or if the function jumps instead
/// of vanishing.
fn locate_zero<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    Segment {
        from,
        ends: [first, last],
        span,
    }: Segment<'_>,
    values: (f64, f64),
    mut test: impl FnMut(&mut BranchSolver<'_, F>, &Node, f64) -> Option<f64>,
) -> Option<Zero> {
    let (mut low, mut high) = span;
    let (mut below, mut above) = (first.clone(), last.clone());
    let mut weights = values;
    let mut ends = (f64::NAN, f64::NAN);
    let mut best: Option<Zero> = None;
    for trial in 0..100 {
        let at = if trial % 3 == 2 {
            0.5 * (low + high)
        } else {
            let t = weights.0 / (weights.0 - weights.1);
            low + (high - low) * t.clamp(0.001, 0.999)
        };
        if !(at > low && at < high) {
            break;
        }
        // The bordered system is singular where branches cross: try a point near it.
        let nearby = at + 1e-3 * (high - at);
        let Some((at, node)) = [at, nearby]
            .into_iter()
            .find_map(|at| Some((at, solver.along_cubic(from, at, [&below, &above]).ok()?)))
        else {
            break;
        };
        let value = test(solver, &node, at)?;
        let parameter = node.parameter;
        if best.as_ref().is_none_or(|b| value.abs() <= b.value.abs()) {
            best = Some(Zero {
                at,
                node: node.clone(),
                uncertainty: 0.0,
                value,
            });
        }
        if value == 0.0 {
            ends = (parameter, parameter);
            break;
        }
        if (value > 0.0) == (values.0 > 0.0) {
            (low, ends.0) = (at, parameter);
            weights = (value, 0.5 * weights.1);
            below = node;
        } else {
            (high, ends.1) = (at, parameter);
            weights = (0.5 * weights.0, value);
            above = node;
        }
        let size = parameter.abs().max(solver.parameter_scale);
        let fine = (ends.1 - ends.0).abs() <= 1e-13 * size;
        let width = high - low;
        if width <= 1e-14 * span.1 || fine && width <= 1e-9 * (span.1 - span.0) {
            break;
        }
    }
    let size = values.0.abs().max(values.1.abs());
    best.filter(|zero| zero.value.abs() <= 1e-6 * size)
        .map(|zero| Zero {
            uncertainty: (ends.1 - ends.0).abs(),
            ..zero
        })
}

/// The step along the tangent of `from` at which the difference of the states `m` periods apart
/// changes sign: there the branch meets an orbit of period `m`.
pub(crate) fn collapse<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    from: &Node,
    to: &Node,
    step: f64,
    m: usize,
) -> Option<(f64, f64)> {
    let reference = solver.gap(from, m);
    let square = dot(&reference, &reference);
    let last = dot(&reference, &solver.gap(to, m)) / square;
    if last.is_nan() || last >= 0.0 {
        return None;
    }
    let stretch = Segment {
        from,
        ends: [from, to],
        span: (0.0, step),
    };
    let zero = locate_zero(solver, stretch, (1.0, last), |solver, node, _| {
        Some(dot(&reference, &solver.gap(node, m)) / square)
    });
    if let Some(z) = zero {
        // A difference that only turns by a right angle is not such a point.
        let left = solver.gap(&z.node, m);
        return (dot(&left, &left) <= 0.01 * square).then_some((z.at, z.node.parameter));
    }
    // Both branches meet there, so the corrector may fail: interpolate.
    let t = 1.0 / (1.0 - last);
    Some((
        t * step,
        from.parameter + t * (to.parameter - from.parameter),
    ))
}

/// All bifurcations between two neighbouring nodes, in order along the arc.
pub(crate) fn between<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    [a, b]: [&Node; 2],
    [tests_a, tests_b]: [&Tests; 2],
    step: f64,
    after_point: usize,
) -> Vec<Bifurcation> {
    let mut zeros: Vec<(BifurcationKind, Zero)> = Vec::new();
    let whole = Segment {
        from: a,
        ends: [a, b],
        span: (0.0, step),
    };
    let changes = |x: f64, y: f64| x * y < 0.0;
    if changes(tests_a.fold, tests_b.fold) {
        let zero = locate_zero(solver, whole, (tests_a.fold, tests_b.fold), |_, node, _| {
            Some(node.slope)
        });
        zeros.extend(zero.map(|z| (BifurcationKind::Fold, z)));
    } else if changes(tests_a.crossing, tests_b.crossing) {
        let zero = locate_zero(
            solver,
            whole,
            (tests_a.crossing, tests_b.crossing),
            |_, node, _| of_multipliers(node, plus_one),
        );
        zeros.extend(zero.map(|z| (BifurcationKind::Crossing, z)));
    }
    if changes(tests_a.flip, tests_b.flip) {
        let zero = locate_zero(solver, whole, (tests_a.flip, tests_b.flip), |_, node, _| {
            of_multipliers(node, minus_one)
        });
        zeros.extend(zero.map(|z| (BifurcationKind::Flip, z)));
    }
    if changes(tests_a.neimark_sacker, tests_b.neimark_sacker) {
        let zero = locate_zero(
            solver,
            whole,
            (tests_a.neimark_sacker, tests_b.neimark_sacker),
            |_, node, _| of_multipliers(node, |m| pair_on_circle(m).0),
        );
        zeros.extend(zero.and_then(|z| {
            let multipliers = Multipliers::of_product(&z.node.jacobians).ok()?.values;
            // A real pair with product 1 (a neutral saddle) is not a bifurcation.
            let (pair, factor) = pair_on_circle(&multipliers).1?;
            (factor.abs() <= 1e-6).then(|| {
                let angle = nanotap_arithmetic::atan2(pair.im, pair.re);
                (BifurcationKind::NeimarkSacker { angle }, z)
            })
        }));
    }
    grazings(solver, whole, [tests_a, tests_b], 8, &mut zeros);
    zeros.sort_by(|(_, x), (_, y)| x.at.total_cmp(&y.at));
    zeros
        .into_iter()
        .filter_map(|(kind, zero)| {
            Some(Bifurcation {
                kind,
                criticality: criticality(solver, &zero.node, kind),
                parameter: zero.node.parameter,
                uncertainty: zero.uncertainty,
                orbit: solver.orbit(&zero.node).ok()?,
                after_point,
                node: zero.node,
            })
        })
        .collect()
}

fn of_multipliers(node: &Node, test: impl Fn(&[Complex<f64>]) -> f64) -> Option<f64> {
    Some(test(&Multipliers::of_product(&node.jacobians).ok()?.values))
}

/// Shortest signed time from `a` to `b` on an orbit of period `n`.
fn time_shift(a: f64, b: f64, n: f64) -> f64 {
    let shift = (b - a).rem_euclid(n);
    if shift > 0.5 * n { shift - n } else { shift }
}

/// The tangency nearest in time. If one extremum has several switching functions, the one with the
/// nearest value.
fn nearest(tangencies: &[OrbitTangency], to: OrbitTangency, n: f64) -> Option<(usize, f64)> {
    let apart = |t: &OrbitTangency| (time_shift(to.time, t.time, n), (t.value - to.value).abs());
    tangencies
        .iter()
        .map(apart)
        .enumerate()
        .min_by(|(_, x), (_, y)| (x.0.abs().total_cmp(&y.0.abs())).then(x.1.total_cmp(&y.1)))
        .map(|(k, (shift, _))| (k, shift))
}

/// Tangencies whose value changes sign on a part of the branch. Extrema are matched with their
/// nearest in time. If the numbers of negative values differ and no match explains it, the interval
/// is halved, at most `depth` times.
fn grazings<F: MapFamily>(
    solver: &mut BranchSolver<'_, F>,
    stretch: Segment<'_>,
    [first, last]: [&Tests; 2],
    depth: usize,
    zeros: &mut Vec<(BifurcationKind, Zero)>,
) {
    let n = solver.n as f64;
    let span = stretch.span;
    let mut found = 0;
    for (i, t) in first.tangencies.iter().enumerate() {
        let Some((j, shift)) = nearest(&last.tangencies, *t, n) else {
            continue;
        };
        let u = last.tangencies[j];
        let mutual = nearest(&first.tangencies, u, n).is_some_and(|(k, _)| k == i);
        if !mutual || t.value * u.value >= 0.0 {
            continue;
        }
        let zero = locate_zero(solver, stretch, (t.value, u.value), |solver, node, at| {
            let fraction = (at - span.0) / (span.1 - span.0);
            let tangencies = solver.tangencies(node).ok()?;
            let expected = OrbitTangency {
                time: t.time + shift * fraction,
                value: t.value + (u.value - t.value) * fraction,
            };
            let (k, _) = nearest(&tangencies, expected, n)?;
            Some(tangencies[k].value)
        });
        if let Some(zero) = zero {
            let time = solver.tangencies(&zero.node).ok().and_then(|list| {
                list.iter()
                    .min_by(|x, y| x.value.abs().total_cmp(&y.value.abs()))
                    .map(|x| x.time)
            });
            found += 1;
            let kind = BifurcationKind::Grazing {
                time: time.unwrap_or(t.time),
            };
            zeros.push((kind, zero));
        }
    }
    if found == 0 && depth > 0 && negative(&first.tangencies) != negative(&last.tangencies) {
        let middle = 0.5 * (span.0 + span.1);
        let Ok(node) = solver.along_cubic(stretch.from, middle, stretch.ends) else {
            return;
        };
        let Some(tests) = Tests::new(solver, &node, true) else {
            return;
        };
        let halves = [
            (
                Segment {
                    ends: [stretch.ends[0], &node],
                    span: (span.0, middle),
                    ..stretch
                },
                [first, &tests],
            ),
            (
                Segment {
                    ends: [&node, stretch.ends[1]],
                    span: (middle, span.1),
                    ..stretch
                },
                [&tests, last],
            ),
        ];
        for (half, tests) in halves {
            grazings(solver, half, tests, depth - 1, zeros);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn real(values: &[f64]) -> Vec<Complex<f64>> {
        values.iter().map(|v| Complex::new(*v, 0.0)).collect()
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-14, "{found} {expected}");
    }

    /// The sign of Π(1 ∓ μ) with the smallest factor: two negative factors, or a complex pair, give
    /// a positive product.
    #[test]
    fn products_over_real_multipliers() {
        near(plus_one(&real(&[0.75])), 0.25);
        near(plus_one(&real(&[3.0, 0.5])), -0.5);
        near(plus_one(&real(&[4.0, 3.0])), 2.0);
        near(minus_one(&real(&[-3.0, 0.5])), -1.5);
        near(minus_one(&real(&[-4.0, -1.5])), 0.5);
        let pair = [Complex::new(1.5, 2.0), Complex::new(1.5, -2.0)];
        near(plus_one(&pair), 0.5f64.hypot(2.0));
    }

    /// Π (μ_i μ_j − 1) over all pairs, for real multipliers first.
    #[test]
    fn products_over_couples_of_multipliers() {
        let sign = |values: &[f64]| pair_on_circle(&real(values));
        assert_eq!(sign(&[2.0]), (1.0, None));
        near(sign(&[2.0, 1.0]).0, 1.0);
        near(sign(&[2.0, 0.25]).0, -0.5);
        // 0.8, −0.4 and −0.88.
        near(sign(&[3.0, 0.6, 0.2]).0, 0.4);
        // −0.5, −0.8 and −0.975.
        near(sign(&[2.0, 0.25, 0.1]).0, -0.5);
        let (p, q) = (Complex::new(0.6, 0.7), Complex::new(-0.9, 0.6));
        for pair in [[p, p.conj()], [p.conj(), p]] {
            let mut values = pair.to_vec();
            // With an additional real multiplier: two pairs of complex conjugates.
            for others in [&[][..], &[0.5], &[-20.0]] {
                values.truncate(2);
                values.extend(real(others));
                let (product, found) = pair_on_circle(&values);
                near(product, -0.15);
                let (multiplier, factor) = found.unwrap();
                assert_eq!(multiplier, p);
                near(factor, -0.15);
            }
        }
        // The pair nearest the unit circle is reported: |q|² − 1 = 0.17, |p|² − 1 = −0.15, |2 q|² −
        // 1 = 3.68.
        let of = |values: [Complex<f64>; 4]| {
            let (product, found) = pair_on_circle(&values);
            (product, found.unwrap().0)
        };
        let (product, named) = of([q, q.conj(), p, p.conj()]);
        near(product, -0.15);
        assert_eq!(named, p);
        let (product, named) = of([q * 2.0, q.conj() * 2.0, q, q.conj()]);
        near(product, 0.17);
        assert_eq!(named, q);
    }

    /// Times on an orbit of period 2 are compared modulo the period.
    #[test]
    fn the_short_way_round_an_orbit() {
        for (a, b, shift) in [
            (0.25, 0.5, 0.25),
            (0.5, 0.25, -0.25),
            (1.75, 0.25, 0.5),
            (0.25, 1.75, -0.5),
            (0.0, 1.0, 1.0),
        ] {
            assert_eq!(time_shift(a, b, 2.0), shift, "{a} {b}");
        }
        let tangency = |time, value| OrbitTangency { time, value };
        let list = [
            tangency(0.75, 1.0),
            tangency(1.75, 3.0),
            tangency(1.75, -2.0),
        ];
        assert_eq!(nearest(&list, tangency(0.0, -4.0), 2.0), Some((2, -0.25)));
        assert_eq!(nearest(&list, tangency(0.0, 4.0), 2.0), Some((1, -0.25)));
        assert_eq!(nearest(&list, tangency(0.5, 9.0), 2.0), Some((0, 0.25)));
        assert_eq!(nearest(&[], tangency(0.5, 9.0), 2.0), None);
    }
}
