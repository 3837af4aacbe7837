//! nanotap on the tasks of `peers/README.md`, with the command line of all peers:
//!
//! ```text
//! peer first|long|sweep|basin [--threads K] [--seconds S]
//! ```
//!
//! `cargo xtask peers` runs it with the other programs. There are no settings: the flow has no time
//! steps.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap_flow::{Ensemble, Flow, System};

/// Modes, and the dimension of a state.
const MODES: usize = 3;
const DIMENSION: usize = 2 * MODES;
/// The sweep: 400 values of Ω with 8 starts, 500 periods each, the last 100 recorded.
const SWEEP: (usize, usize) = (400, 8);
const SWEEP_PERIODS: usize = 500;
const SWEEP_KEPT: usize = 100;
/// The basin: 200 by 200 starts, 300 periods each, the last state recorded.
const BASIN_SIDE: usize = 200;
const BASIN_PERIODS: usize = 300;

type State = [f64; DIMENSION];
type Failure = Box<dyn std::error::Error>;

/// Command-line options.
struct Options {
    work: String,
    threads: usize,
    seconds: f64,
}

impl Options {
    fn read() -> Result<Self, Failure> {
        let words: Vec<String> = std::env::args().skip(1).collect();
        let value = |key: &str| {
            let at = words.iter().position(|word| word == key)?;
            words.get(at + 1)
        };
        Ok(Self {
            work: words.first().cloned().unwrap_or_default(),
            threads: value("--threads").map_or(Ok(1), |text| text.parse())?,
            seconds: value("--seconds").map_or(Ok(1.0), |text| text.parse())?,
        })
    }
}

fn main() -> Result<(), Failure> {
    let options = Options::read()?;
    match options.work.as_str() {
        "first" => first(&options),
        "long" => long(&options),
        "sweep" => sweep(&options),
        "basin" => basin(&options),
        other => Err(format!("no work is called `{other}`: first, long, sweep or basin").into()),
    }
}

/// The model at one drive frequency.
fn model(omega: f64) -> Result<Model, Failure> {
    let case = Cantilever {
        modes: MODES,
        omega,
        ..Cantilever::paper()
    };
    Ok(Model::cantilever(&case)?)
}

/// A motion with a separate system: threads that share one count references to it and wait for each
/// other.
fn motion(model: &Model) -> Flow {
    Flow::new(Arc::new(System::clone(&model.system)))
}

/// Its state.
fn state(flow: &Flow) -> State {
    let mut state = [0.0; DIMENSION];
    flow.state(&mut state);
    state
}

/// The best time of several for `run` with motions from rest.
fn best_from_rest(
    options: &Options,
    mut run: impl FnMut(&mut Flow) -> Result<(), Failure>,
) -> Result<f64, Failure> {
    let model = model(Cantilever::paper().omega)?;
    let mut flow = motion(&model);
    let (begin, mut best, mut repeats) = (Instant::now(), f64::INFINITY, 0);
    while repeats < 3 || (repeats < 1000 && begin.elapsed().as_secs_f64() < options.seconds) {
        let start = Instant::now();
        flow.start(&[0.0; DIMENSION], 0.0)?;
        run(&mut flow)?;
        best = best.min(start.elapsed().as_secs_f64());
        repeats += 1;
    }
    Ok(best)
}

/// The first 20 periods from rest.
fn first(options: &Options) -> Result<(), Failure> {
    let mut states = Vec::new();
    let seconds = best_from_rest(options, |flow| {
        states.clear();
        for _ in 0..20 {
            flow.run_periods(1)?;
            states.push(state(flow));
        }
        Ok(())
    })?;
    println!("{{\"seconds\": {seconds:e}, \"states\": {states:?}}}");
    Ok(())
}

/// 2000 periods from rest.
fn long(options: &Options) -> Result<(), Failure> {
    const PERIODS: usize = 2000;
    let seconds = best_from_rest(options, |flow| {
        flow.run_periods(PERIODS)?;
        black_box(state(flow));
        Ok(())
    })?;
    println!("{{\"seconds\": {seconds:e}, \"periods\": {PERIODS}}}");
    Ok(())
}

/// All values of Ω, each with its model and its eight starts.
fn sweep(options: &Options) -> Result<(), Failure> {
    let starts = sweep_starts()?;
    let values = as_many_as_fit(options, SWEEP.0, |k| {
        let value = (k * 247 % SWEEP.0) as f64 / (SWEEP.0 - 1) as f64;
        let model = model(2.0 + 2.0 * value)?;
        let mut flow = motion(&model);
        for start in &starts {
            flow.start(start, 0.0)?;
            flow.run_periods(SWEEP_PERIODS - SWEEP_KEPT)?;
            let mut kept = Vec::with_capacity(SWEEP_KEPT);
            for _ in 0..SWEEP_KEPT {
                flow.run_periods(1)?;
                kept.push(state(&flow));
            }
            black_box(&kept);
        }
        Ok(())
    })?;
    println!(
        "{{\"seconds\": {:e}, \"runs\": {}}}",
        values.seconds,
        values.items * SWEEP.1
    );
    Ok(())
}

/// The grid of starts, in batches of 64.
fn basin(options: &Options) -> Result<(), Failure> {
    const PACKET: usize = 64;
    let model = model(Cantilever::paper().omega)?;
    let count = BASIN_SIDE * BASIN_SIDE;
    let along = |k: usize| k as f64 / (BASIN_SIDE - 1) as f64;
    let packets = as_many_as_fit(options, count / PACKET, |packet| {
        let mut ensemble = Ensemble::new(Arc::clone(&model.system));
        let mut starts = [0.0; PACKET * DIMENSION];
        for (k, start) in starts.chunks_mut(DIMENSION).enumerate() {
            let point = (packet * PACKET + k) * 24721 % count;
            start[0] = -1.0 + 2.0 * along(point / BASIN_SIDE);
            start[MODES] = -4.0 + 8.0 * along(point % BASIN_SIDE);
        }
        let results = ensemble.advance(&mut starts, &[BASIN_PERIODS; PACKET]);
        for result in results {
            result?;
        }
        black_box(starts);
        Ok(())
    })?;
    println!(
        "{{\"seconds\": {:e}, \"runs\": {}}}",
        packets.seconds,
        packets.items * PACKET
    );
    Ok(())
}

/// The part of a task that was done.
struct Done {
    seconds: f64,
    items: usize,
}

/// Computes items 0, 1, … of `count` until the time is up.
fn as_many_as_fit(
    options: &Options,
    count: usize,
    item: impl Fn(usize) -> Result<(), Failure> + Sync,
) -> Result<Done, Failure> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let (wall, processor) = (Instant::now(), processor_seconds());
    let worker = || -> Result<(), String> {
        while wall.elapsed().as_secs_f64() < options.seconds {
            let k = next.fetch_add(1, Ordering::Relaxed);
            if k >= count {
                break;
            }
            item(k).map_err(|error| error.to_string())?;
            done.fetch_add(1, Ordering::Relaxed);
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let others: Vec<_> = (1..options.threads).map(|_| scope.spawn(worker)).collect();
        let mine = worker();
        others
            .into_iter()
            .map(|other| other.join().unwrap_or_else(|_| Err("a thread died".into())))
            .fold(mine, Result::and)
    })?;
    // On one thread, the processor's time, which other programs disturb least.
    let seconds = match (processor, processor_seconds()) {
        (Some(start), Some(end)) if options.threads == 1 => end - start,
        _ => wall.elapsed().as_secs_f64(),
    };
    Ok(Done {
        seconds,
        items: done.into_inner(),
    })
}

/// Linux's count of the nanoseconds that this thread has run.
fn processor_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    Some(1e-9 * nanoseconds)
}

/// The starts of the sweep, from the file that all peers read.
fn sweep_starts() -> Result<Vec<State>, Failure> {
    let path = std::env::var("SWEEP_STARTS").map_err(|_| "SWEEP_STARTS names no file of starts")?;
    let text = std::fs::read_to_string(&path)?;
    text.lines()
        .map(|line| {
            let numbers: Vec<f64> = line.split(',').map(str::parse).collect::<Result<_, _>>()?;
            State::try_from(numbers).map_err(|_| format!("{path}: six numbers a line").into())
        })
        .collect()
}
