//! A body on a viscoelastic surface (Kelvin and Voigt): contact ends when the force is zero, and
//! gap and rate are then both zero by definition.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_flow::trajectory::Recorder;
use nanotap_flow::{Drive, Flow, HarmonicVector, Onset, Output, Regime, Reset, System, Transition};

/// ẍ + 0.1 ẋ + x = 2 sin ωt above a surface with rest position 0, stiffness `k` and damper `c`.
#[derive(Clone, Copy)]
struct Body {
    omega: f64,
    k: f64,
    c: f64,
}

impl Body {
    fn force(self, x: f64, v: f64) -> f64 {
        -(self.k * x + self.c * v)
    }

    /// State (x, ẋ, s): s is the position that the surface would have without contact since the
    /// last separation. Regime 0 is flight.
    fn system(self) -> System {
        let drive = Drive::single(self.omega).unwrap();
        let (k, c, recovery) = (self.k, self.c, self.k / self.c);
        let forcing = HarmonicVector::zeros(3, 1).with_tone(
            0,
            &DVector::from_vec(vec![0.0, 2.0, 0.0]),
            &DVector::zeros(3),
        );
        let regime = |index: usize, k: f64, c: f64| {
            let rows = [0.0, 1.0, 0.0, -1.0 - k, -0.1 - c, 0.0, 0.0, 0.0, -recovery];
            let matrix = DMatrix::from_row_slice(3, 3, &rows);
            Regime::new(index, matrix, forcing.clone(), &drive).unwrap()
        };
        let gap = Output::linear(RowDVector::from_row_slice(&[1.0, 0.0, -1.0]), 1);
        let force = Output::linear(RowDVector::from_row_slice(&[-k, -c, 0.0]), 1);
        let rows = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0];
        let left = Reset {
            matrix: DMatrix::from_row_slice(3, 3, &rows),
            offset: HarmonicVector::zeros(3, 1),
        };
        let regimes = vec![regime(0, 0.0, 0.0), regime(1, k, c)];
        let met = Onset::Proportional {
            transition: 0,
            factor: -c,
        };
        let transitions = vec![
            vec![Transition::new(gap, 1).with_onset(met)],
            vec![
                Transition::new(force, 0)
                    .with_reset(left)
                    .with_onset(Onset::AtRest(0)),
            ],
        ];
        System::new(drive, regimes, transitions).unwrap()
    }

    /// Runge–Kutta of fourth order with switches located by bisection of the step; returns the
    /// state and the number of contacts.
    fn stepped(self, start: [f64; 3], periods: u32, steps: u32) -> ([f64; 3], usize) {
        let h = TAU / self.omega / f64::from(steps);
        let mut touching = start[0] <= start[2] && self.force(start[0], start[1]) > 0.0;
        let (mut y, mut touched) = (start, 0);
        if start[0] < start[2] && !touching {
            y[2] = y[0];
        }
        let field = |touching: bool, t: f64, y: [f64; 3]| {
            let push = if touching {
                self.force(y[0], y[1])
            } else {
                0.0
            };
            let pull = 2.0 * (self.omega * t).sin() - 0.1 * y[1] - y[0];
            [y[1], pull + push, -self.k / self.c * y[2]]
        };
        let step = |touching: bool, t: f64, y: [f64; 3], h: f64| {
            let along = |k: [f64; 3], h: f64| [y[0] + h * k[0], y[1] + h * k[1], y[2] + h * k[2]];
            let a = field(touching, t, y);
            let b = field(touching, t + 0.5 * h, along(a, 0.5 * h));
            let c = field(touching, t + 0.5 * h, along(b, 0.5 * h));
            let d = field(touching, t + h, along(c, h));
            [0, 1, 2].map(|i| y[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]))
        };
        let inside = |touching: bool, y: [f64; 3]| {
            if touching {
                self.force(y[0], y[1])
            } else {
                y[0] - y[2]
            }
        };
        for n in 0..periods * steps {
            let (mut t, mut left) = (f64::from(n) * h, h);
            while left > 0.0 {
                let end = step(touching, t, y, left);
                if inside(touching, end) > 0.0 {
                    y = end;
                    break;
                }
                let (mut low, mut high) = (0.0, left);
                while high - low > 1e-15 {
                    let middle = 0.5 * (low + high);
                    if inside(touching, step(touching, t, y, middle)) > 0.0 {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                y = step(touching, t, y, high);
                (t, left) = (t + high, left - high);
                if touching {
                    y[2] = y[0];
                } else {
                    touched += 1;
                }
                touching = !touching;
                if !touching {
                    // Gap and rate are zero and the gap is about to open: one small step later it
                    // has opened.
                    let on = left.min(1e-4 * h);
                    y = step(false, t, y, on);
                    (t, left) = (t + on, left - on);
                }
            }
        }
        (y, touched)
    }
}

const BODY: Body = Body {
    omega: 1.3,
    k: 20.0,
    c: 3.0,
};

/// The same motion as fine steps with located switches: no contact begins again at once, and none
/// is missed.
#[test]
fn separation_at_zero_force_agrees_with_located_runge_kutta() {
    for c in [0.3, 3.0, 30.0] {
        let body = Body { c, ..BODY };
        let mut flow = Flow::new(Arc::new(body.system()));
        let start = [0.3, -0.4, 0.0];
        flow.start(&start, 0.0).unwrap();
        let mut recorder = Recorder::default();
        for _ in 0..4 {
            flow.run_period(&mut recorder).unwrap();
        }
        let run = recorder.finish(Arc::clone(flow.system()));
        let (expected, touched) = body.stepped(start, 4, 2000);
        let mut state = [0.0; 3];
        flow.state(&mut state);
        for (exact, stepped) in state.iter().zip(expected).take(2) {
            assert!(
                (exact - stepped).abs() < 1e-8,
                "c = {c}: {state:?} {expected:?}"
            );
        }
        assert_eq!(run.events().iter().filter(|e| e.to == 1).count(), touched);
        // The force never pulls, and contacts and flights have a finite duration.
        let force = Output::linear(RowDVector::from_row_slice(&[-body.k, -c, 0.0]), 1);
        let zero = force.scaled(0.0);
        let (least, most) = run.signal_by_regime(&[zero, force]).range().unwrap();
        assert!(least.value > -1e-13 && most.value > 0.1, "{least:?}");
        assert!(
            run.events()
                .windows(2)
                .all(|e| e[1].time - e[0].time > 1e-3)
        );
    }
}

/// A start inside the surface that already moves outwards separates at once, at its rate; one that
/// presses stays in contact.
#[test]
fn every_start_has_a_motion() {
    let system = Arc::new(BODY.system());
    for start in [
        [-0.1, 2.0, 0.0],
        [-0.1, 2.0, -0.05],
        [-0.1, -1.0, 0.4],
        [0.0, 0.0, 0.0],
        [0.2, 1.0, 0.2],
        [0.2, -1.0, 0.2],
        [0.1, 0.5, 0.4],
    ] {
        let mut flow = Flow::new(Arc::clone(&system));
        flow.start(&start, 0.0).unwrap();
        flow.run_period(&mut ()).unwrap();
        let mut state = [0.0; 3];
        flow.state(&mut state);
        let (expected, _) = BODY.stepped(start, 1, 2000);
        for (exact, stepped) in state.iter().zip(expected).take(2) {
            assert!(
                (exact - stepped).abs() < 1e-8,
                "{start:?}: {state:?} {expected:?}"
            );
        }
    }
}

/// The Jacobian against differences of fourth order. The map is smooth at a grazing contact, since
/// the damper's force begins at zero there.
#[test]
fn the_jacobian_through_contact_and_separation() {
    let system = Arc::new(BODY.system());
    let run = |start: [f64; 3]| {
        let mut flow = Flow::new(Arc::clone(&system));
        flow.start(&start, 0.0).unwrap();
        let mut jacobian = DMatrix::zeros(3, 3);
        flow.run_period_with_jacobian(&mut jacobian).unwrap();
        let mut state = [0.0; 3];
        flow.state(&mut state);
        (state, jacobian)
    };
    for start in [
        [0.3, -0.4, 0.0],
        [-0.1, -1.0, 0.4],
        [-0.1, 2.0, -0.05],
        [0.1, 0.5, -0.2],
    ] {
        let (_, jacobian) = run(start);
        for j in 0..3 {
            let at = |steps: f64| {
                let mut moved = start;
                moved[j] += 1e-3 * steps;
                run(moved).0
            };
            let (a, b, c, d) = (at(-2.0), at(-1.0), at(1.0), at(2.0));
            for i in 0..3 {
                let difference = (a[i] - d[i] + 8.0 * (c[i] - b[i])) / 12e-3;
                let exact = jacobian[(i, j)];
                assert!(
                    (difference - exact).abs() < 1e-7 * (1.0 + exact.abs()),
                    "{start:?} {i} {j}: {difference} {exact}"
                );
            }
        }
    }
}
