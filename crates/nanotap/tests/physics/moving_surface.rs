//! The moving surface with adhesion: compared with an independent integration by Taylor series,
//! limits, similarity, and the effect of a discontinuous force on orbits.

use nalgebra::{DMatrix, DVector};
use nanotap::case::document::equilibria;
use nanotap::case::{Case, Key};
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap::model::galerkin::Galerkin;
use nanotap::model::model_map::ModelMap;
use nanotap::model::parameter::Parameter;
use nanotap::study::branch::{BranchOptions, BranchReport, branch};
use nanotap::study::orbit::{OrbitOptions, orbit};
use nanotap_dynamics::{Control, StroboscopicMap};
use proptest::prelude::*;

use crate::contact_laws::parameter;
use crate::derivatives::{advance, worst, worst_over};
use crate::{stated, taylor};

/// A lever on a moving surface, driven as in the paper.
fn lever(modes: usize, omega: f64, surface: MovingSurface) -> Cantilever {
    let case = Cantilever {
        modes,
        omega,
        alpha5: 0.05,
        ..Cantilever::paper()
    };
    case.on(ContactLaw::MovingSurface, &surface.numbers())
}

/// The numbers that only this law has.
#[derive(Clone, Copy)]
pub(crate) struct MovingSurface {
    pub(crate) stiffness: f64,
    pub(crate) damping: f64,
    pub(crate) adhesion: f64,
}

impl MovingSurface {
    pub(crate) fn of(case: &Cantilever) -> Self {
        let of = |name| case.get(parameter(name));
        Self {
            stiffness: of("surface_stiffness"),
            damping: of("surface_damping"),
            adhesion: of("adhesion_force"),
        }
    }

    fn numbers(self) -> [f64; 3] {
        [self.stiffness, self.damping, self.adhesion]
    }
}

const SURFACE: MovingSurface = MovingSurface {
    stiffness: 60.0,
    damping: 8.0,
    adhesion: 0.4,
};

/// The equations ẏ = B y in flight and in contact, y = (a, ȧ, s, sin Ωτ, cos Ωτ, 1), derived from
/// the mechanics, with the row of the gap; solved by Taylor series of order 24 with switches at
/// zeros of the series of the gap.
struct Taylor {
    flight: DMatrix<f64>,
    contact: DMatrix<f64>,
    gap: DVector<f64>,
    /// Largest step.
    step: f64,
    period: f64,
}

const ORDER: usize = 24;

impl Taylor {
    fn new(case: &Cantilever) -> Self {
        let galerkin = Galerkin::new(case).unwrap();
        let n = case.modes;
        let (sine, cosine, one) = (2 * n + 1, 2 * n + 2, 2 * n + 3);
        let size = 2 * n + 4;
        let give = galerkin.mass.clone().try_inverse().unwrap();
        let p = galerkin.modes.tip.clone();
        let free = &galerkin.forcing[0];
        let mut flight = DMatrix::zeros(size, size);
        flight.view_mut((0, n), (n, n)).fill_with_identity();
        let put = |matrix: &mut DMatrix<f64>, column: usize, of: &DVector<f64>| {
            matrix
                .view_mut((n, column), (n, 1))
                .copy_from(&(&give * of));
        };
        flight
            .view_mut((n, 0), (n, n))
            .copy_from(&-(&give * &galerkin.stiffness[0]));
        flight
            .view_mut((n, n), (n, n))
            .copy_from(&-(&give * &galerkin.damping[0]));
        put(&mut flight, sine, &free.sine);
        put(&mut flight, cosine, &free.cosine);
        put(&mut flight, one, &free.constant);
        (flight[(sine, cosine)], flight[(cosine, sine)]) = (case.omega, -case.omega);
        // V_T and its rate as rows.
        let mut height = DVector::zeros(size);
        height.rows_mut(0, n).copy_from(&p);
        (height[sine], height[one]) = (case.alpha2, case.alpha5);
        let mut rate = DVector::zeros(size);
        rate.rows_mut(n, n).copy_from(&p);
        rate[cosine] = case.alpha2 * case.omega;
        let own = MovingSurface::of(case);
        let mut gap = height;
        gap[2 * n] -= 1.0;
        // In contact η_s ṡ + k_s s = F + k_v g + η_v (V̇ − ṡ) = −f.
        let mut unit = DVector::zeros(size);
        unit[one] = own.adhesion;
        let mut surface =
            (&gap * case.alpha4 + &rate * case.alpha6 + unit) / (own.damping + case.alpha6);
        surface[2 * n] -= own.stiffness / (own.damping + case.alpha6);
        let mut force = &surface * -own.damping;
        force[2 * n] -= own.stiffness;
        let mut contact = flight.clone();
        contact.row_mut(2 * n).tr_copy_from(&surface);
        let push = &give * &p * force.transpose();
        let mut rows = contact.view_mut((n, 0), (n, size));
        rows += push;
        flight[(2 * n, 2 * n)] = -own.stiffness / own.damping;
        let fastest = flight.norm().max(contact.norm());
        // ‖B‖ is far above the spectral radius √‖K‖ of a stiff beam. The rate of the surface in
        // contact, (k_s + k_v)/(η_s + η_v), may be larger.
        let rates = [
            fastest.sqrt(),
            own.stiffness / own.damping,
            (own.stiffness + case.alpha4) / (own.damping + case.alpha6),
        ];
        Self {
            flight,
            contact,
            gap,
            step: 1.0 / rates.into_iter().fold(0.0, f64::max),
            period: case.period(),
        }
    }

    /// Taylor coefficients of the motion.
    fn series(matrix: &DMatrix<f64>, y: &DVector<f64>) -> Vec<DVector<f64>> {
        let mut terms = vec![y.clone()];
        for k in 0..ORDER {
            terms.push(matrix * &terms[k] / (k as f64 + 1.0));
        }
        terms
    }

    /// One period from `state` at drive phase 0; `None` if rounding decides about a very light
    /// contact.
    fn period(&self, state: &[f64]) -> Option<Vec<f64>> {
        let size = self.gap.len();
        let mut y = DVector::zeros(size);
        y.rows_mut(0, state.len()).copy_from_slice(state);
        (y[size - 2], y[size - 1]) = (1.0, 1.0);
        let mut t = 0.0;
        let mut touching = self.gap.dot(&y) < 0.0;
        let mut switched = false;
        while t < self.period {
            let matrix = if touching {
                &self.contact
            } else {
                &self.flight
            };
            let length = self.step.min(self.period - t);
            let series = Self::series(matrix, &y);
            // The coefficients of the gap as fractions of the step.
            let mut power = if touching { -1.0 } else { 1.0 };
            let along: Vec<f64> = series
                .iter()
                .map(|term| {
                    let c = power * self.gap.dot(term);
                    power *= length;
                    c
                })
                .collect();
            let noise = 1e-13 * self.gap.abs().dot(&y.abs());
            let root = taylor::first_root(&along, noise, switched)?;
            switched = root <= 1.0;
            let part = length * root.min(1.0);
            y = taylor::at(&series, part);
            t += part;
            if !switched {
                continue;
            }
            touching = !touching;
        }
        Some(y.as_slice()[..state.len()].to_vec())
    }
}

/// Three periods from a deflection, a velocity and a position of the surface, each from the final
/// state of the independent integration: errors grow where motions diverge.
fn agrees_with_taylor_series(case: &Cantilever, start: [f64; 3]) -> Result<(), TestCaseError> {
    let modes = case.modes;
    let mut map = ModelMap::new(&Model::cantilever(case).unwrap());
    let independent = Taylor::new(case);
    let mut state = vec![0.0; 2 * modes + 1];
    [state[0], state[modes], state[2 * modes]] = start;
    for _ in 0..3 {
        let Some(expected) = independent.period(&state) else {
            return Err(TestCaseError::reject("rounding decides on a touch"));
        };
        map.advance(&mut state).unwrap();
        for (found, expected) in state.iter().zip(&expected) {
            prop_assert!((found - expected).abs() < 1e-9, "{state:?}\n{expected:?}");
        }
        state = expected;
    }
    Ok(())
}

/// A surface that is much slower in flight than in contact, which a random case had.
#[test]
fn a_surface_that_is_fast_in_contact_agrees_with_taylor_series() {
    let surface = MovingSurface {
        stiffness: 1.0,
        damping: 0.5,
        adhesion: 0.0,
    };
    let case = Cantilever {
        alpha4: 98.64580280337232,
        alpha5: 0.0,
        alpha6: 0.0,
        ..lever(1, 16.82298048636555, surface)
    };
    let start = [0.31840475061436807, -1.9478145129489097, 0.0];
    agrees_with_taylor_series(&case, start).unwrap();
}

/// Near a contact that does not occur the derivatives are those without it; a random case had
/// differences that included it.
#[test]
fn derivatives_near_a_missed_contact_are_those_without_it() {
    let surface = MovingSurface {
        damping: 2.131293070042266,
        adhesion: 0.2833583176635725,
        ..SURFACE
    };
    let case = Cantilever {
        alpha6: 0.8821265667685139,
        ..lever(4, 12.37112293626098, surface)
    };
    let mut state = vec![0.0; 9];
    (state[0], state[4]) = (0.05, -1.3688043576034572);
    let case = Case::from(case);
    assert_eq!(worst_over(&case, &state, 1e-5), None);
    let error = worst_over(&case, &state, 1e-6).unwrap();
    assert!(error < 1e-6, "{error:e}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Levers with one to ten modes over any surface, from any state, compared with Taylor series.
    #[test]
    fn motions_agree_with_taylor_series(
        modes in 1..=10_usize, omega in 3.0..25.0_f64,
        stiffness in 1.0..100.0_f64, damping in 0.0..2.0_f64,
        own_stiffness in 1.0..100.0_f64, own_damping in 0.5..10.0_f64,
        adhesion in 0.0..2.0_f64, gap in -0.1..0.2_f64,
        a in -0.2..0.2_f64, v in -1.0..1.0_f64, s in -0.2..0.05_f64,
    ) {
        let surface = MovingSurface { stiffness: own_stiffness, damping: own_damping, adhesion };
        let case = Cantilever {
            alpha4: stiffness,
            alpha5: gap,
            alpha6: damping,
            ..lever(modes, omega, surface)
        };
        agrees_with_taylor_series(&case, [a, v, s])?;
    }

    /// Jacobians and derivatives with respect to every key, with contacts, compared with
    /// differences.
    #[test]
    fn derivatives_agree_with_differences(
        modes in 1..5_usize, omega in 3.0..25.0_f64, adhesion in 0.1..1.0_f64,
        damping in 0.0..1.0_f64, own_damping in 2.0..10.0_f64, v in -2.0..-1.0_f64,
    ) {
        let surface = MovingSurface { damping: own_damping, adhesion, ..SURFACE };
        let case = Cantilever { alpha6: damping.max(0.05), ..lever(modes, omega, surface) };
        let mut state = vec![0.0; 2 * modes + 1];
        (state[0], state[modes]) = (0.05, v);
        // A switch near a grazing or near the end of the period gives a kink within the difference.
        let run = nanotap_flow::Trajectory::record(
            &Model::cantilever(&case).unwrap().system, &state, 1,
        ).unwrap();
        prop_assume!(!run.events().is_empty());
        prop_assume!(run.events().iter().all(|e| e.rate.abs() > 0.3
            && run.end() - e.time > 0.01 && e.time > 0.01));
        // For short contacts the error is that of the difference, up to about 1e-6.
        let error = worst(&Case::from(case), &state);
        prop_assume!(error.is_some());
        prop_assert!(error.unwrap() < 1e-4, "{error:?}");
    }

    /// Ten times the lengths and forces give the same motion.
    #[test]
    fn the_motion_scales_with_lengths_and_forces(factor in 0.01..100.0_f64, v in -1.0..1.0_f64) {
        let case = lever(3, 20.0, SURFACE);
        let scaled = Cantilever {
            alpha2: factor * case.alpha2,
            alpha5: factor * case.alpha5,
            ..case.clone().with(parameter("adhesion_force"), factor * SURFACE.adhesion)
        };
        let start = [0.05, 0.0, 0.0, v, 0.0, 0.0, 0.0];
        let large = start.map(|x| factor * x);
        let (one, other) = (advance(&case.into(), &start), advance(&scaled.into(), &large));
        for (one, other) in one.iter().zip(&other) {
            prop_assert!((factor * one - other).abs() < 1e-11 * factor);
        }
    }

    /// Any numbers give a model or an error with the name of a key, and a model runs or fails with
    /// a reason.
    #[test]
    fn any_numbers_run_or_are_refused(
        numbers in prop::array::uniform5(prop_oneof![
            3 => 1e-6..1e3_f64,
            1 => prop_oneof![Just(0.0), Just(-1.0), Just(1e9), Just(2e9), Just(1e-300), Just(f64::NAN), Just(f64::INFINITY)],
        ]),
        v in -3.0..3.0_f64, s in -1.0..1.0_f64,
    ) {
        let [alpha4, alpha6, stiffness, damping, adhesion] = numbers;
        let surface = MovingSurface { stiffness, damping, adhesion };
        let case = Cantilever { alpha4, alpha6, ..lever(2, 3.0, surface) };
        let keys = ["alpha4", "alpha6", "surface_stiffness", "surface_damping", "adhesion_force"];
        match Model::cantilever(&case) {
            Err(error) => {
                let words = error.to_string();
                let slow = damping >= 1e-15 * stiffness.max(1.0);
                let sound = numbers.iter().all(|x| (0.0..=1e9).contains(x)) && stiffness > 0.0 && slow;
                prop_assert!(sound || keys.iter().any(|key| words.contains(key)), "{words}");
            }
            Ok(model) => {
                prop_assert!(stiffness > 0.0 && damping >= 1e-15 && adhesion >= 0.0);
                let mut state = vec![0.1, 0.0, v, 0.0, s];
                if ModelMap::new(&model).advance(&mut state).is_ok() {
                    prop_assert!(state.iter().all(|x| x.is_finite()), "{state:?}");
                }
            }
        }
    }
}

/// In the limit of large stiffness and speed the surface does not move: the paper's sample with an
/// additional adhesion, to first order in 1/k_s.
#[test]
fn a_stiff_surface_is_the_papers_sample() {
    let paper = Cantilever {
        alpha5: 0.05,
        omega: 20.0,
        ..Cantilever::paper()
    };
    let start = [0.05, 0.0, 0.0, -0.5, 0.0, 0.0];
    let run = |case: Cantilever, start: &[f64]| {
        let case = Case::from(case);
        (0..5).fold(start.to_vec(), |state, _| advance(&case, &state))
    };
    let expected = run(paper.clone(), &start);
    let distance = |stiffness: f64| {
        let surface = MovingSurface {
            stiffness,
            damping: 1e-3 * stiffness,
            adhesion: 0.0,
        };
        let found = run(lever(3, 20.0, surface), &[&start[..], &[0.0]].concat());
        let pairs = found.iter().zip(&expected);
        pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
    };
    let far = [1e4, 1e5, 1e6].map(distance);
    for pair in far.windows(2) {
        assert!((pair[0] / pair[1] - 10.0).abs() < 1.0, "{far:?}");
    }
    assert!(far[2] < 1e-3, "{far:?}");
}

/// The volume of states changes by ġ⁺/ġ⁻ at every switch, as the product of the multipliers,
/// computed from the Jacobian alone, must show; the dissipated energy is that of the dampers.
#[test]
fn orbits_keep_their_volumes_and_energies() {
    let mut contacts = 0.0;
    for (adhesion, omega) in [
        (0.0, 20.0),
        (0.4, 20.0),
        (2.0, 20.0),
        (0.4, 3.0),
        (0.4, 24.0),
    ] {
        let surface = MovingSurface {
            adhesion,
            ..SURFACE
        };
        let model = Model::cantilever(&lever(3, omega, surface)).unwrap();
        let options = OrbitOptions {
            period: Some(1),
            ..OrbitOptions::default()
        };
        let found = orbit(&model, &options).unwrap();
        let seen = &found.observables;
        contacts += seen.contacts_per_period;
        assert!(seen.energy_balance.residual.abs() < 1e-11);
        assert!(
            found.determinant_defect < 1e-8,
            "{:e}",
            found.determinant_defect
        );
        let mut map = ModelMap::new(&model);
        let mut jacobian = DMatrix::zeros(7, 7);
        let mut state = found.state.clone();
        let reported = map.advance_with_jacobian_and_determinant(&mut state, &mut jacobian);
        let plain = jacobian.determinant().abs().ln();
        assert!((reported.unwrap().unwrap() - plain).abs() < 1e-8 * plain.abs());
        assert_eq!(map.log_determinant_bound(), f64::INFINITY);
    }
    assert!(contacts > 2.0);
}

/// At a slight contact the tip is pulled in by a force that does not begin at zero: the map departs
/// from free flight by the square root of the depth, not by its power 3/2.
#[test]
fn grazing_is_of_the_square_root_type() {
    let far = Cantilever {
        alpha5: 1.0,
        ..lever(3, 3.1, SURFACE)
    };
    let start = [0.03, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0];
    let model = Model::cantilever(&far).unwrap();
    let run = nanotap_flow::Trajectory::record(&model.system, &start, 1).unwrap();
    let (lowest, _) = run.signal(&model.gap).range().unwrap();
    let unhindered = run.state_at(run.end()).unwrap();
    let after = |depth: f64| {
        let case = Cantilever {
            alpha5: 1.0 - lowest.value - depth,
            ..far.clone()
        };
        advance(&case.into(), &start)
    };
    for (missed, free) in after(-1e-9).iter().zip(&unhindered) {
        assert!((missed - free).abs() < 1e-13);
    }
    // The effect of a contact even at depth zero.
    let touched = after(1e-15);
    let jump = (touched[0] - unhindered[0]).abs();
    assert!(jump > 1e-4, "{jump}");
    let beyond = |depth: f64| {
        let state = after(depth);
        let pairs = state.iter().zip(&touched);
        pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    };
    for decade in 6..11 {
        let depth = 10.0_f64.powi(-decade);
        let slope = (beyond(depth) / beyond(0.25 * depth)).ln() / 4.0_f64.ln();
        assert!((slope - 0.5).abs() < 0.05, "depth {depth:e}: slope {slope}");
    }
}

/// The lever of docs/cases/moving-surface.md. On retract its orbit jumps between two folds and then
/// ends at a grazing, with an unbounded multiplier. From large distances the free orbit ends where
/// the tip reaches the surface.
#[test]
fn branches_end_where_their_orbits_graze() {
    let case = stated(include_str!("../../../../docs/cases/moving-surface.toml"));
    let key = case.key("gap.tip").unwrap();
    let followed = |from: f64, to: f64| {
        let options = BranchOptions::over(key, from, to);
        branch(&case, &options, &Control::default()).unwrap()
    };
    let grazes = |found: &BranchReport| {
        assert!(found.branches[0].complete, "{}", found.branches[0].end);
        let mut kinds = found.bifurcations.iter().filter(|b| b.kind == "grazing");
        let grazing = kinds.next_back().unwrap().parameter;
        let beyond = found.points.last().unwrap().parameter - grazing;
        assert!(beyond.abs() < 1e-15, "{beyond:e}");
        grazing
    };
    let touching = followed(25e-9, 31e-9);
    let at = grazes(&touching);
    assert!((at - 29.2595e-9).abs() < 1e-13, "{at:e}");
    let last = touching.points.last().unwrap();
    assert!(last.multipliers[0][0] > 1e3 && last.observables.contacts_per_period == 1.0);
    let folds = touching.bifurcations.iter().filter(|b| b.kind == "fold");
    assert_eq!(folds.count(), 2);

    let at = grazes(&followed(40e-9, 25e-9));
    let view = case.physical().unwrap();
    // The base moves by the drive's amplitude; the tip lags by 90°.
    let base = view.parameters.get(Parameter::Alpha2) * view.free_phase.to_radians().cos();
    assert!((at - view.free_amplitude - base).abs() < 1e-13, "{at:e}");
}

/// At rest the springs of lever, contact and surface are in series: the tip is free above the
/// sample, or is held by the adhesion while F (1/k + 1/k_s) exceeds the gap.
#[test]
fn the_rest_position_follows_from_springs_in_series() {
    for (gap, adhesion, count) in [(0.05, 0.4, 2), (0.05, 0.02, 1), (-0.05, 0.4, 1)] {
        let surface = MovingSurface {
            adhesion,
            ..SURFACE
        };
        let case = Cantilever {
            alpha5: gap,
            ..lever(3, 3.0, surface)
        };
        let galerkin = Galerkin::new(&case).unwrap();
        let (p, k) = (&galerkin.modes.tip, &galerkin.stiffness[0]);
        let give = p.dot(&k.clone().try_inverse().map(|inverse| inverse * p).unwrap());
        let both = give + 1.0 / surface.stiffness;
        let rests = equilibria(&Case::from(case.clone()));
        assert_eq!(rests.len(), count, "{rests:?}");
        let held = rests.last().unwrap();
        assert_eq!(
            (held.contact, rests[0].contact),
            (count == 2 || gap < 0.0, gap < 0.0)
        );
        assert!(rests.iter().all(|rest| rest.stable));
        if !held.contact {
            assert!((held.gap - gap).abs() < 1e-14 && held.force.abs() < 1e-14);
            continue;
        }
        // g (1 + k_v C) = d − C F, f = −F − k_v g, V_T = d + c f.
        let depth = (gap - both * adhesion) / (1.0 + case.alpha4 * both);
        let force = -adhesion - case.alpha4 * depth;
        assert!((held.force - force).abs() < 1e-12, "{held:?}");
        assert!((held.gap - gap - give * force).abs() < 1e-12);
        assert!((held.deflection - give * force).abs() < 1e-12);
    }
}

/// Invalid numbers of a surface are refused by their names, and so are those of another law.
#[test]
fn invalid_moving_surfaces_are_refused() {
    let refused = |case: Cantilever| Model::cantilever(&case).unwrap_err().to_string();
    for (number, value) in [
        (parameter("surface_stiffness"), 0.0),
        (parameter("surface_stiffness"), -1.0),
        (parameter("surface_damping"), 0.0),
        (parameter("adhesion_force"), -0.1),
        (parameter("adhesion_force"), f64::NAN),
    ] {
        let words = refused(lever(2, 3.0, SURFACE).with(number, value));
        assert!(words.contains(number.name()), "{words}");
    }
    let words = refused(Cantilever::paper().with(parameter("adhesion_force"), 0.1));
    assert!(words.contains("moving-surface"), "{words}");
    let case = Case::from(lever(2, 3.0, SURFACE));
    let keys: Vec<&str> = case.keys().iter().map(|key| key.name()).collect();
    for key in [
        "alpha6",
        "surface_stiffness",
        "surface_damping",
        "adhesion_force",
    ] {
        assert!(keys.contains(&key), "{key}");
    }
    assert!(!keys.contains(&"relaxation_time"));
    assert_eq!(case.get(Key::of(parameter("adhesion_force"))), 0.4);
}
