//! No contact is missed, however brief.

use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap_flow::trajectory::Recorder;
use nanotap_flow::{Flow, Trajectory};

/// Contacts of any short duration: α5 is chosen so that the lowest point of an otherwise free
/// period is below the sample by the depth whose contact lasts a given fraction of a period, down
/// to 1e-8. In free flight the motion does not depend on α5, so the depth that double precision
/// gives is known from the same closed form in twice double precision. A depth above one rounding
/// error must give a contact, with the duration that follows from depth and curvature; a near miss
/// must give none.
#[test]
fn contacts_down_to_1e_minus_8_of_a_period_are_all_found() {
    let (mut touches, mut misses, mut evaluations, mut worst) = (0_u32, 0_u32, 0_u64, 0.0_f64);
    let mut shortest: f64 = 1.0;
    for i in 0..1500_u32 {
        let u = |k: usize| (f64::from(i) * [0.754_877_67, 0.569_840_29, 0.430_159_71][k]).fract();
        let modes = 1 + (i % 5) as usize;
        let far = Cantilever {
            omega: 1.0 + 20.0 * u(0),
            modes,
            alpha5: 3.0,
            ..Cantilever::paper()
        };
        let mut start = vec![0.0; 2 * modes];
        start[0] = 0.4 * u(1) - 0.2;
        start[modes] = 2.0 * u(2) - 1.0;
        if modes > 1 {
            start[1] = 0.02 * u(2);
        }
        let model = Model::cantilever(&far).unwrap();
        let period = model.period();
        let free = Trajectory::record(&model.system, &start, 1).unwrap();
        let gap = free.signal(&model.gap);
        let (lowest, _) = gap.range().unwrap();
        if !free.events().is_empty() || !(0.02..0.98).contains(&(lowest.time / period)) {
            continue;
        }
        let curvature = gap.pieces[0].signal.jet(lowest.time).curvature;
        let rounding = 0.25 * gap.pieces[0].signal.noise();
        for exponent in 0..13 {
            let part = 10.0_f64.powf(-2.0 - 0.5 * f64::from(exponent));
            let depth = curvature * (part * period).powi(2) / 8.0;
            let case = Cantilever {
                alpha5: far.alpha5 - lowest.value - depth,
                ..far.clone()
            };
            let mut shifted = model.gap.clone();
            shifted.constant = case.alpha5;
            let dip = -free.signal(&shifted).pieces[0]
                .signal
                .accurate_at(lowest.time);

            let near = Model::cantilever(&case).unwrap();
            let mut flow = Flow::new(near.system.clone());
            flow.start(&start, 0.0).unwrap();
            let mut recorder = Recorder::default();
            flow.run_period(&mut recorder).unwrap();
            evaluations += flow.statistics().evaluations;
            let run = recorder.finish(near.system.clone());
            let found = run.events().windows(2).find(|e| e[0].to == 1);
            if dip.abs() <= rounding {
                // With its amplitudes rounded differently, the same motion touches or misses.
                continue;
            }
            if dip <= 0.0 {
                misses += 1;
                assert!(
                    found.is_none(),
                    "invented: case {i}, missed by {:e}, {case:?}",
                    -dip
                );
                continue;
            }
            let found = found.unwrap_or_else(|| panic!("missed: case {i}, dip {dip:e}, {case:?}"));
            touches += 1;
            let duration = found[1].time - found[0].time;
            shortest = shortest.min(duration / period);
            let expected = (8.0 * dip / curvature).sqrt();
            // Times are doubles: near 1e-8 of a period the difference of two keeps seven digits.
            // The force of the contact and the next order are of the size of the phase of the
            // fastest mode; the depth itself is known to rounding.
            let angle = gap.pieces[0].signal.fastest() * part * period;
            let allowed = (2.0 * angle).max(rounding / dip).max(1e-6);
            let error = (duration / expected - 1.0).abs() / allowed;
            worst = worst.max(error);
        }
    }
    println!(
        "{touches} short contacts found, none missed, the shortest {shortest:.1e} of a period; {misses} near \
         misses distinguished; {:.1} evaluations per period",
        evaluations as f64 / f64::from(touches + misses)
    );
    assert!(touches > 2000 && shortest < 2e-8, "{touches} {shortest:e}");
    assert!(worst < 1.0, "{worst}");
}

/// The gap is brought within rounding of grazing by bisection on the initial state: at the last
/// representable state with a contact, the contact is found, and its duration is of the order of
/// the square root of rounding.
#[test]
fn the_shortest_representable_contacts_are_found() {
    let mut shortest: f64 = 1.0;
    for i in 0..40_u32 {
        let omega = 2.0 + 0.37 * f64::from(i);
        let model = Model::cantilever(&Cantilever {
            omega,
            alpha5: 0.6,
            ..Cantilever::paper()
        })
        .unwrap();
        let contacts = |v: f64| -> Vec<f64> {
            let run = Trajectory::record(&model.system, &[0.0, 0.0, 0.0, v, 0.0, 0.0], 1).unwrap();
            run.events()
                .windows(2)
                .filter(|e| e[0].to == 1)
                .map(|e| e[1].time - e[0].time)
                .collect()
        };
        let (mut miss, mut touch) = (0.0, -40.0);
        if !contacts(miss).is_empty() || contacts(touch).is_empty() {
            continue;
        }
        while (0.5 * (miss + touch) != miss) && (0.5 * (miss + touch) != touch) {
            let middle = 0.5 * (miss + touch);
            if contacts(middle).is_empty() {
                miss = middle;
            } else {
                touch = middle;
            }
        }
        let durations = contacts(touch);
        shortest = durations
            .iter()
            .map(|d| d / model.period())
            .fold(shortest, f64::min);
    }
    println!("shortest contact found: {shortest:.1e} of a period");
    assert!(shortest < 1e-7, "{shortest:e}");
}
