//! A periodic orbit by Newton's method.

use divan::Bencher;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::model_map::ModelMap;
use nanotap_dynamics::{ShootingOptions, close_orbit};

use crate::cases::{self, MODES};

/// The period-1 orbit at Ω = 3.5 with its multipliers, from a relative distance of 0.01.
#[divan::bench(args = MODES)]
fn newton(bencher: Bencher<'_, '_>, modes: usize) {
    let case = Cantilever {
        omega: 3.5,
        ..cases::paper(modes)
    };
    let mut map = ModelMap::new(&cases::model(&case));
    let mut state = vec![0.0; 2 * modes];
    cases::settled(&case).state(&mut state);
    let options = ShootingOptions::default();
    let orbit = close_orbit(&mut map, &state, 1, &options).expect("a period-1 motion");
    let near: Vec<f64> = orbit.states[0].iter().map(|x| 1.01 * x).collect();
    bencher.bench_local(|| close_orbit(&mut map, &near, 1, &options).expect("the orbit again"));
}
