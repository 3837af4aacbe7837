//! One switch between free flight and contact.

use divan::Bencher;
use nanotap::model::cantilever::Cantilever;
use nanotap_flow::{Flow, Trajectory};

use crate::cases::{self, MODES};

/// Time before and after the switch, in drive periods.
const AROUND: f64 = 1e-4;

/// From just before the beginning of a contact to just after: search, two propagations and the
/// change of basis.
#[divan::bench(args = MODES)]
fn into_contact(bencher: Bencher<'_, '_>, modes: usize) {
    switch(bencher, modes, 1);
}

/// The same at the end of a contact.
#[divan::bench(args = MODES)]
fn into_flight(bencher: Bencher<'_, '_>, modes: usize) {
    switch(bencher, modes, 0);
}

fn switch(bencher: Bencher<'_, '_>, modes: usize, into: usize) {
    let (flow, end) = before_switch(&cases::paper(modes), into);
    bencher
        .with_inputs(|| flow.clone())
        .bench_local_refs(|flow| flow.run_until(end, &mut ()).expect("a bounded motion"));
}

/// A flow shortly before the first switch of its attractor that enters regime `into`, and the end
/// time, which is after that switch and before the next one.
fn before_switch(case: &Cantilever, into: usize) -> (Flow, f64) {
    let model = cases::model(case);
    let mut flow = cases::settled(case);
    let mut state = vec![0.0; model.dimension()];
    flow.state(&mut state);
    let period = model.period();
    let around = AROUND * period;
    let trajectory = Trajectory::record(&model.system, &state, 50).expect("a bounded motion");
    let event = trajectory
        .events()
        .iter()
        .find(|event| {
            let phase = event.time % period;
            event.to == into && phase > around && phase + around < period
        })
        .expect("a tapping motion");
    let (before, phase) = ((event.time / period) as usize, event.time % period);
    cases::run(&mut flow, before);
    flow.run_until(phase - around, &mut ())
        .expect("a bounded motion");
    let switches = flow.switches();
    let mut check = flow.clone();
    check
        .run_until(phase + around, &mut ())
        .expect("a bounded motion");
    assert_eq!(check.switches(), switches + 1, "one switch is timed");
    (flow, phase + around)
}
