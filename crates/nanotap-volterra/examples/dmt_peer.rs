//! A lever over a DMT sample, with the command line of all peers of `peers/driver/law.py`:
//!
//! ```text
//! dmt_peer MODES TOLERANCE SECONDS
//! ```
//!
//! It prints the states after some periods and the number of periods per second as JSON.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

#[path = "../tests/common/mod.rs"]
mod common;

use std::f64::consts::TAU;
use std::sync::Arc;
use std::time::Instant;

use nanotap_volterra::{Flow, VolterraError};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let [modes, tolerance, seconds] = given.as_slice() else {
        return Err("MODES TOLERANCE SECONDS are needed".into());
    };
    let (modes, tolerance): (usize, f64) = (modes.parse()?, tolerance.parse()?);
    let seconds: f64 = seconds.parse()?;
    let system = common::beam_at(common::dmt(), modes, 0.9, 200.0, 20.0, 18.0, 20, tolerance);
    let mut flow = Flow::new(Arc::new(system));
    let mut period = |state: &mut Vec<f64>| -> Result<(), VolterraError> {
        flow.start(state, 0.0)?;
        flow.run_until(TAU)?;
        flow.state(state);
        Ok(())
    };
    let mut state = vec![0.0; 2 * modes];
    (state[0], state[modes]) = (7.0048, 17.1408);
    let mut states = Vec::new();
    for count in 1..=20 {
        period(&mut state)?;
        if [5, 10, 20].contains(&count) {
            states.push(format!("{state:?}"));
        }
    }
    let (begun, mut periods) = (Instant::now(), 0_u32);
    while begun.elapsed().as_secs_f64() < seconds {
        period(&mut state)?;
        periods += 1;
    }
    let rate = f64::from(periods) / begun.elapsed().as_secs_f64();
    println!("{{\"states\": [{}], \"rate\": {rate}}}", states.join(", "));
    Ok(())
}
