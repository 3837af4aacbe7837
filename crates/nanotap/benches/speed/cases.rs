//! The timed cases.

use nanotap_arithmetic::ComplexFunctions as _;
use std::sync::Arc;

use nanotap::case::Case;
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap_flow::Flow;

/// Numbers of modes N.
pub(crate) const MODES: [usize; 6] = [1, 2, 3, 5, 10, 20];
/// Low, medium and high damping of the beam, α3.
pub(crate) const DAMPINGS: [f64; 3] = [0.01, 0.1, 1.0];
/// Periods of the transient with the lowest damping.
const TRANSIENT: usize = 400;

/// The paper's case, at Ω = 2.6 (chaotic: 2.3 switches a period at N = 3).
pub(crate) fn paper(modes: usize) -> Cantilever {
    Cantilever {
        modes,
        ..Cantilever::paper()
    }
}

/// At Ω = 20 without a tip mass, where a period-1 and a period-4 motion coexist (N ≥ 2).
pub(crate) fn coexisting(modes: usize) -> Cantilever {
    Cantilever {
        alpha1: 0.0,
        omega: 20.0,
        ..paper(modes)
    }
}

/// The model of a valid case.
pub(crate) fn model(case: &Cantilever) -> Model {
    Model::cantilever(case).expect("a valid case")
}

/// The case for sweeps and basins.
pub(crate) fn subject(case: &Cantilever) -> Case {
    Case::from(case.clone())
}

/// A flow at rest.
pub(crate) fn at_rest(model: &Model) -> Flow {
    let mut flow = Flow::new(Arc::clone(&model.system));
    flow.start(&vec![0.0; model.dimension()], 0.0)
        .expect("rest is a state");
    flow
}

/// A flow on its attractor, at phase 0.
pub(crate) fn settled(case: &Cantilever) -> Flow {
    let mut flow = at_rest(&model(case));
    run(&mut flow, TRANSIENT);
    flow
}

/// Runs `periods` drive periods.
pub(crate) fn run(flow: &mut Flow, periods: usize) {
    for _ in 0..periods {
        flow.run_period(&mut ()).expect("a bounded motion");
    }
}

/// The case N = 3, Ω = 2.6 at a distance at which the freely oscillating tip comes within `gap`
/// times its amplitude of the sample (negative: indents it), and the state of the free motion at
/// phase 0, which is an orbit of the impacting system if `gap` ≥ 0.
pub(crate) fn grazing(gap: f64) -> (Cantilever, Vec<f64>) {
    let case = paper(3);
    let model = model(&case);
    let free = &model.system.regimes()[0];
    let swing = free.project(&model.gap).tones[0].modulus();
    let state = free.response().at(model.system.drive(), 0.0);
    let case = Cantilever {
        alpha5: swing * (1.0 + gap),
        ..case
    };
    (case, state.as_slice().to_vec())
}
