//! Starts at the surface, where gap, rate and higher derivatives vanish together, and systems with
//! very different time scales.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_flow::trajectory::{Recorder, Trajectory};
use nanotap_flow::{Drive, Flow, FlowError, HarmonicVector, Output, Regime, System, Transition};
use proptest::prelude::*;

/// ẍ + c ẋ + k x = F sin ωt, m = 1, with a soft stop of spring and damper at x = gap.
#[derive(Clone, Copy, Debug)]
struct SoftStop {
    stiffness: f64,
    damping: f64,
    omega: f64,
    gap: f64,
    contact_stiffness: f64,
    contact_damping: f64,
}

impl SoftStop {
    fn system(self) -> Result<Arc<System>, FlowError> {
        let drive = Drive::single(self.omega)?;
        let lower = |v: f64| DVector::from_vec(vec![0.0, v]);
        let regime = |index, k: f64, c: f64| {
            let rows = [0.0, 1.0, -self.stiffness - k, -self.damping - c];
            let forcing = HarmonicVector::zeros(2, 1)
                .with_tone(0, &lower(1.0), &lower(0.0))
                .with_constant(&lower(k * self.gap));
            Regime::new(index, DMatrix::from_row_slice(2, 2, &rows), forcing, &drive)
        };
        let regimes = vec![
            regime(0, 0.0, 0.0)?,
            regime(1, self.contact_stiffness, self.contact_damping)?,
        ];
        let x = Output::linear(RowDVector::from_row_slice(&[1.0, 0.0]), 1);
        let gap = x.scaled(-1.0).with_constant(self.gap);
        let transitions = vec![
            vec![Transition::new(gap.clone(), 1)],
            vec![Transition::new(gap.scaled(-1.0), 0)],
        ];
        Ok(Arc::new(System::new(drive, regimes, transitions)?))
    }

    fn record(self, start: [f64; 2], periods: usize) -> Result<Trajectory, FlowError> {
        let mut flow = Flow::new(self.system()?);
        flow.start(&start, 0.0)?;
        let mut recorder = Recorder::default();
        for _ in 0..periods {
            flow.run_period(&mut recorder)?;
        }
        Ok(recorder.finish(Arc::clone(flow.system())))
    }

    /// The state after integration by the classical Runge–Kutta method with this many steps per
    /// period.
    fn stepped(self, mut x: [f64; 2], periods: u32, steps: u32) -> [f64; 2] {
        let h = std::f64::consts::TAU / self.omega / f64::from(steps);
        let field = |t: f64, [x, v]: [f64; 2]| {
            let depth = x - self.gap;
            let stop = if depth > 0.0 {
                self.contact_stiffness * depth + self.contact_damping * v
            } else {
                0.0
            };
            let force = (self.omega * t).sin();
            [v, force - self.stiffness * x - self.damping * v - stop]
        };
        let along = |x: [f64; 2], k: [f64; 2], h: f64| [x[0] + h * k[0], x[1] + h * k[1]];
        for n in 0..periods * steps {
            let t = f64::from(n) * h;
            let a = field(t, x);
            let b = field(t + 0.5 * h, along(x, a, 0.5 * h));
            let c = field(t + 0.5 * h, along(x, b, 0.5 * h));
            let d = field(t + h, along(x, c, h));
            x = [0, 1].map(|i| x[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
        }
        x
    }
}

/// A case that once never ended: from rest at a stop in contact, gap, rate and acceleration vanish
/// together, and the first push of the drive, into the stop, decides.
const TOUCHING: SoftStop = SoftStop {
    stiffness: 1.0,
    damping: 3.285_167,
    omega: 3.794_180,
    gap: 0.0,
    contact_stiffness: 1.461_646,
    contact_damping: 0.081_088,
};

#[test]
fn the_first_derivative_that_does_not_vanish_decides_the_regime() {
    let run = TOUCHING.record([0.0, 0.0], 10).unwrap();
    assert_eq!(
        run.segments()[0].regime,
        1,
        "the drive pushes into the stop"
    );
    assert!(run.segments().iter().all(|s| s.length > 1e-6));
    let end = run.state_at(run.end()).unwrap();
    for (exact, stepped) in end.iter().zip(TOUCHING.stepped([0.0, 0.0], 10, 40_000)) {
        assert!((exact - stepped).abs() < 1e-7, "{end:?} {stepped}");
    }
}

/// A start with gap and rate zero and acceleration into the stop or away from it: no pair of events
/// at the same time.
#[test]
fn a_start_in_contact_at_rest_has_no_simultaneous_events() {
    for (gap, first) in [(0.1, 0), (-0.1, 1)] {
        // At rest at the stop only the spring acts: away from a stop at x > 0, into one at x < 0.
        let system = SoftStop {
            gap,
            damping: 0.1,
            ..TOUCHING
        };
        let run = system.record([gap, 0.0], 3).unwrap();
        assert_eq!(run.segments()[0].regime, first, "{gap}");
        assert!(run.segments().iter().all(|s| s.length > 1e-9), "{gap}");
        assert!(run.events().iter().all(|e| e.time > 1e-6), "{gap}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    /// 120 of 1500 such samples were once refused as chatter.
    #[test]
    fn a_soft_stop_never_chatters(
        damping in 0.0..4.0_f64,
        omega in 0.3..6.0_f64,
        contact_stiffness in 0.1..200.0_f64,
        contact_damping in 0.0..3.0_f64,
        touches in any::<bool>(),
    ) {
        let gap = if touches { 0.0 } else { 0.05 };
        let stiffness = 1.0;
        let case =
            SoftStop { stiffness, damping, omega, gap, contact_stiffness, contact_damping };
        match case.record([0.0, 0.0], 5) {
            Ok(run) => prop_assert!(run.segments().iter().all(|s| s.length > 0.0)),
            // Undamped and driven at resonance.
            Err(FlowError::Resonance { .. } | FlowError::IllConditioned { .. }) => {}
            Err(other) => return Err(TestCaseError::fail(other.to_string())),
        }
    }
}

/// A contact so viscous that its fast mode decays at once needs no more memory than another, and
/// moves like a nearly rigid stop.
#[test]
fn time_scales_may_differ_widely() {
    let mut ends = Vec::new();
    for contact_damping in [1e6, 1e7, 1e8, 1e9] {
        let case = SoftStop {
            damping: 0.1,
            gap: 0.05,
            contact_damping,
            ..TOUCHING
        };
        let run = case.record([0.0, 0.0], 3).unwrap();
        ends.push(run.state_at(run.end()).unwrap());
    }
    for pair in ends.windows(2).skip(1) {
        assert!((pair[0][0] - pair[1][0]).abs() < 1e-5, "{ends:?}");
    }
    // A mode with too many oscillations per period is refused.
    let slow = SoftStop {
        omega: 1e-29,
        damping: 0.0,
        ..TOUCHING
    };
    let refused = slow.record([0.0, 0.0], 1).unwrap_err();
    assert!(
        matches!(refused, FlowError::TooFast { regime: 0, .. }),
        "{refused}"
    );
}
