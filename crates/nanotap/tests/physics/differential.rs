//! Random beams compared with an independent integrator: one to twenty modes, every regime of
//! damping, gaps of both signs, contact stiffness from 1e-3 to 1e6, every piecewise-linear contact
//! law.

use std::f64::consts::TAU;

use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap_flow::{System, Trajectory};

use crate::taylor;
#[path = "../../../nanotap-volterra/tests/common/random.rs"]
mod random;
use random::Random;

impl Random {
    /// Between 0 and 1.
    fn part(&mut self) -> f64 {
        0.5 * (self.next() + 1.0)
    }

    /// Between two bounds, uniform in the logarithm.
    fn log(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.part())
    }
}

/// None, light, heavy, or close to critical damping of one of the first two modes of the bare beam
/// (α3 = 2 Ω_j, Ω₁ = 3.51601526850015, Ω₂ = 22.0344915646668) to a few digits.
fn damping(random: &mut Random) -> f64 {
    let kind = random.part();
    if kind < 0.15 {
        0.0
    } else if kind < 0.75 {
        random.log(1e-4, 10.0)
    } else if kind < 0.85 {
        random.log(10.0, 1e3)
    } else {
        let frequency = [3.516_015_268_500_15, 22.034_491_564_666_8][usize::from(kind > 0.92)];
        let off = [0.0, 1e-12, -1e-9, 1e-6][(4.0 * random.part()) as usize % 4];
        2.0 * frequency * (1.0 + off)
    }
}

fn beam(random: &mut Random, number: usize) -> Cantilever {
    let alpha3 = damping(random);
    let contact = ContactLaw::ALL[number % ContactLaw::ALL.len()];
    let solid = !contact.has_damper();
    let alpha4 = random.log(1e-3, 1e6);
    let mut case = Cantilever {
        modes: 1 + (20.0 * random.part().powi(2)) as usize,
        alpha1: if random.next() > 0.0 {
            random.log(1e-3, 1.0)
        } else {
            0.0
        },
        alpha2: random.log(1e-2, 1.0),
        alpha3,
        alpha4,
        alpha5: 0.5 * random.next(),
        alpha6: if solid {
            0.0
        } else {
            alpha4.sqrt() * random.log(0.05, 1.0)
        },
        omega: random.log(0.5, 60.0),
        ..Cantilever::paper()
    };
    case = case.on(
        contact,
        &match contact {
            ContactLaw::StandardLinearSolid => {
                vec![alpha4 * random.log(0.1, 10.0), random.log(1e-2, 1.0)]
            }
            ContactLaw::MovingSurface => vec![
                alpha4 * random.log(0.1, 10.0),
                alpha4.sqrt() * random.log(0.05, 1.0),
                alpha4 * random.log(1e-4, 1e-1),
            ],
            ContactLaw::GeneralisedMaxwell => vec![1.0, 1.0],
            _ => Vec::new(),
        },
    );
    if contact == ContactLaw::GeneralisedMaxwell {
        let mut arm = || [random.log(1e-2, 1.0), alpha4 * random.log(0.1, 10.0)];
        case.arms = vec![arm(), arm(), arm()];
    }
    case
}

/// Deflections of the size of the gap, less for fast modes; the sample at rest and the tip above
/// it.
fn start(random: &mut Random, model: &Model, modes: usize) -> Vec<f64> {
    let mut x = vec![0.0; model.dimension()];
    loop {
        for j in 0..modes {
            let size = 1.0 / ((j + 1) * (j + 1)) as f64;
            x[j] = size * random.next();
            x[modes + j] = size * 10.0 * random.next();
        }
        if model.height.at(model.system.drive(), &x, 0.0) > 0.0 {
            return x;
        }
    }
}

/// A bound on all rates from the norms of powers of A: ‖A^{2^k}‖^{2^{-k}} after scaling positions
/// and velocities alike.
fn fastest(system: &System) -> f64 {
    let bound = |matrix: &nalgebra::DMatrix<f64>| {
        let (mut power, mut log) = (matrix.clone(), 0.0_f64);
        let mut weight = 1.0;
        for _ in 0..8 {
            let size = power.norm();
            if size == 0.0 {
                return 0.0;
            }
            log += weight * size.ln();
            power /= size;
            power = &power * &power;
            weight *= 0.5;
        }
        log.exp() * power.norm().powf(weight)
    };
    let rates = system.regimes().iter().map(|r| bound(r.matrix()));
    let tones = system.drive().frequencies().iter().copied();
    rates.chain(tones).fold(0.0, f64::max)
}

/// Largest product of the fastest rate and the duration of a run.
const MAX_STEPS: f64 = 1e4;

/// Error of the state at the end of a period, positions and velocities relative to their sizes,
/// over the growth of errors in the period. `None` if rounding decides about a very light contact.
fn error(random: &mut Random, case: &Cantilever) -> Option<(f64, usize)> {
    let model = Model::cantilever(case).unwrap();
    let x = start(random, &model, case.modes);
    let exact = Trajectory::record(&model.system, &x, 1).unwrap();
    let regime = exact.segments()[0].regime;
    let rate = fastest(&model.system);
    // A period, or the part of it that the series computes quickly.
    let until = (TAU / case.omega).min(MAX_STEPS / rate);
    let taylor = taylor::run(&model.system, &x, regime, rate, until)?;
    // The same from a state with a relative error of 1e-8: the growth of errors.
    let scale = x.iter().map(|v| v.abs()).fold(0.0, f64::max);
    let perturbed: Vec<f64> = x.iter().map(|v| v + 1e-8 * scale * random.next()).collect();
    let perturbed = taylor::run(&model.system, &perturbed, regime, rate, until)?;
    let switches = taylor.switches.len();
    if perturbed.switches.len() != switches {
        return None;
    }
    let end = exact.state_at(until).unwrap();
    let n = case.modes;
    let apart = |other: &[f64]| {
        [0..n, n..2 * n]
            .map(|range| {
                let size = taylor.state.as_slice()[range.clone()].iter();
                let size = size.map(|v| v.abs()).fold(1e-3, f64::max);
                range
                    .map(|i| (taylor.state[i] - other[i]).abs() / size)
                    .fold(0.0, f64::max)
            })
            .into_iter()
            .fold(0.0, f64::max)
    };
    let stretched = (apart(perturbed.state.as_slice()) / 1e-8).max(1.0);
    let times = exact.events().iter().map(|event| event.time);
    let times: Vec<f64> = times.filter(|time| *time <= until).collect();
    assert_eq!(
        times.len(),
        switches,
        "{times:?} {:?}: {case:?} from {x:?}",
        taylor.switches
    );
    Some((apart(&end) / stretched, switches))
}

/// Runs `count` cases and prints a summary.
fn check(count: usize, mut random: Random) {
    let (mut worst, mut touched, mut left) = (0.0_f64, 0, 0);
    for number in 0..count {
        let case = beam(&mut random, number);
        let Some((error, switches)) = error(&mut random, &case) else {
            left += 1;
            continue;
        };
        assert!(error < 1e-9, "case {number}: {error:e}: {case:?}");
        worst = worst.max(error);
        touched += usize::from(switches > 0);
    }
    println!(
        "{count} beams, {touched} of them with switches, {left} too near to grazing: worst \
         error {worst:e}"
    );
    assert!(5 * touched > 2 * count && 30 * left <= count);
}

#[test]
fn random_beams_agree_with_taylor_series() {
    check(100, Random(20_261_101));
}

#[test]
#[ignore = "minutes; run it with --run-ignored only"]
fn ten_thousand_beams_agree_with_taylor_series() {
    check(10_000, Random::of_a_long_run(20_261_102));
}
