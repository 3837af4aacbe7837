//! The works that every peer does, and how their cost is measured; see peers/README.md.

use std::time::Instant;

use crate::cantilever::{Cantilever, OMEGA, State};

const SWEEP: (usize, usize) = (400, 8);
const SWEEP_PERIODS: usize = 500;
const SWEEP_KEPT: usize = 100;
const BASIN_SIDE: usize = 200;
const BASIN_PERIODS: usize = 300;

/// What the command line asks for.
pub struct Options {
    pub work: String,
    pub method: String,
    pub tolerance: f64,
    pub seconds: f64,
}

impl Options {
    pub fn read() -> Self {
        let words: Vec<String> = std::env::args().skip(1).collect();
        let value = |key: &str| {
            let at = words.iter().position(|word| word == key)?;
            words.get(at + 1).cloned()
        };
        let number =
            |key: &str, default| value(key).map_or(default, |text| text.parse().expect("a number"));
        Self {
            work: words.first().cloned().unwrap_or_default(),
            method: value("--method").unwrap_or_default(),
            tolerance: number("--setting", 1e-9),
            seconds: number("--seconds", 1.0),
        }
    }
}

/// Hears the number of a finished period, from 1, and the state; says whether to go on.
pub type AtPeriodEnd<'a> = &'a mut dyn FnMut(usize, &[f64]) -> bool;

/// Does the work with a peer that follows a motion from a start for so many periods.
pub fn work(options: &Options, follow: &dyn Fn(&Cantilever, State, usize, AtPeriodEnd<'_>)) {
    match options.work.as_str() {
        "first" => first(options, follow),
        "long" => long(options, follow),
        "sweep" => sweep(options, follow),
        "basin" => basin(options, follow),
        other => panic!("no work is called `{other}`"),
    }
}

type Follow<'a> = &'a dyn Fn(&Cantilever, State, usize, AtPeriodEnd<'_>);

fn first(options: &Options, follow: Follow<'_>) {
    let cantilever = Cantilever::new(OMEGA);
    let (begin, mut best, mut repeats) = (Instant::now(), f64::INFINITY, 0);
    let mut states: Vec<Vec<f64>> = Vec::new();
    while repeats < 3 || (repeats < 1000 && begin.elapsed().as_secs_f64() < options.seconds) {
        states.clear();
        let start = Instant::now();
        follow(&cantilever, [0.0; 6], 20, &mut |_, y| {
            states.push(y.to_vec());
            true
        });
        best = best.min(start.elapsed().as_secs_f64());
        repeats += 1;
    }
    println!("{{\"seconds\": {best:e}, \"states\": {states:?}}}");
}

fn long(options: &Options, follow: Follow<'_>) {
    let (clock, start, mut done) = (Clock::start(), Instant::now(), 0);
    follow(&Cantilever::new(OMEGA), [0.0; 6], 2000, &mut |k, _| {
        done = k;
        start.elapsed().as_secs_f64() < options.seconds
    });
    println!(
        "{{\"seconds\": {:e}, \"periods\": {done}}}",
        clock.seconds()
    );
}

fn sweep(options: &Options, follow: Follow<'_>) {
    let starts = sweep_starts();
    as_many_as_fit(options, SWEEP.0 * SWEEP.1, 1979, |run| {
        let value = (run / SWEEP.1) as f64 / (SWEEP.0 - 1) as f64;
        let mut kept = Vec::new();
        let start = starts[run % SWEEP.1];
        follow(
            &Cantilever::new(2.0 + 2.0 * value),
            start,
            SWEEP_PERIODS,
            &mut |k, y| {
                if k > SWEEP_PERIODS - SWEEP_KEPT {
                    kept.push(y.to_vec());
                }
                true
            },
        );
        std::hint::black_box(kept);
    });
}

fn basin(options: &Options, follow: Follow<'_>) {
    let cantilever = Cantilever::new(OMEGA);
    let along = |k: usize| k as f64 / (BASIN_SIDE - 1) as f64;
    as_many_as_fit(options, BASIN_SIDE * BASIN_SIDE, 24721, |point| {
        let mut start = [0.0; 6];
        start[0] = -1.0 + 2.0 * along(point / BASIN_SIDE);
        start[3] = -4.0 + 8.0 * along(point % BASIN_SIDE);
        let mut end = Vec::new();
        follow(&cantilever, start, BASIN_PERIODS, &mut |k, y| {
            if k == BASIN_PERIODS {
                end = y.to_vec();
            }
            true
        });
        std::hint::black_box(end);
    });
}

/// Does items until the time is up, in an order in which any first few are spread over all.
fn as_many_as_fit(options: &Options, count: usize, step: usize, mut item: impl FnMut(usize)) {
    let (clock, start, mut done) = (Clock::start(), Instant::now(), 0);
    while done < count && start.elapsed().as_secs_f64() < options.seconds {
        item(done * step % count);
        done += 1;
    }
    println!("{{\"seconds\": {:e}, \"runs\": {done}}}", clock.seconds());
}

/// The starts of the sweep, from the file that all peers read.
fn sweep_starts() -> Vec<State> {
    let path = std::env::var("SWEEP_STARTS").expect("SWEEP_STARTS names the file of starts");
    let text = std::fs::read_to_string(path).expect("the file of starts");
    text.lines()
        .map(|line| {
            let numbers: Vec<f64> = line
                .split(',')
                .map(|word| word.parse().expect("a number"))
                .collect();
            numbers.try_into().expect("six numbers a line")
        })
        .collect()
}

/// Processor time of this thread where the system tells it, which a busy machine disturbs
/// least; else the wall's.
struct Clock {
    processor: Option<f64>,
    wall: Instant,
}

impl Clock {
    fn start() -> Self {
        Self {
            processor: processor_seconds(),
            wall: Instant::now(),
        }
    }

    fn seconds(&self) -> f64 {
        match (self.processor, processor_seconds()) {
            (Some(start), Some(end)) => end - start,
            _ => self.wall.elapsed().as_secs_f64(),
        }
    }
}

/// Linux's count of the nanoseconds that this thread has run.
fn processor_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    Some(1e-9 * nanoseconds)
}
