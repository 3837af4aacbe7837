//! What the dataset of a sweep holds, and how its chunks are cut.

use serde_json::{Value, json};

use super::check::{check_size, model};
use super::distances::has_setpoint;
use super::follow::Follow;
use super::run::{Outcome, Starts};
use super::{Runs, SweepOptions};
use nanotap_case::Case;
use nanotap_case::physical::Kind as QuantityKind;
use nanotap_case::units::Units;
use nanotap_dataset::schema::Kind;
use nanotap_dataset::{Axis, Coordinate, Grid, Schema, Values, Variable, attributes};
use nanotap_error::Error;
use nanotap_motions::simulate::Classification;
use nanotap_observe::{Dimension, Observable, ObservableSet};
use nanotap_study::over::Over;

/// Chunks that a large sweep is cut into at least: enough for a job array, few enough
/// for a file system.
const CHUNKS: usize = 64;
/// Most runs of a chunk: what a kill loses at most.
const MAX_RUNS: usize = 4096;
/// Bytes that a chunk should not exceed.
const CHUNK_BYTES: usize = 16 << 20;

/// The classifications in the order of their codes; code 0 is a chunk that is missing.
pub(super) const CLASSES: [Classification; 5] = [
    Classification::Periodic,
    Classification::QuasiPeriodic,
    Classification::Chaotic,
    Classification::Unbounded,
    Classification::Undecided,
];

/// The classification of a code; none of a missing one.
pub(crate) fn class_of(code: u8) -> Option<Classification> {
    let index = usize::from(code).checked_sub(1)?;
    CLASSES.get(index).copied()
}

/// The code of a classification.
fn code(classification: Classification) -> u8 {
    CLASSES
        .iter()
        .position(|c| *c == classification)
        .map_or(0, |k| k as u8 + 1)
}

/// Names of what the recordings are over.
pub(super) const PERIODS: &str = "drive_period";
const STROBE: &str = "strobe_period";
pub(super) const STATE: &str = "state";
/// Name of the last axis of the grid.
pub(super) const START: &str = "start";

/// The distance that was solved for a setpoint, and the attribute with the reasons where there is
/// none.
pub(crate) const DISTANCE: &str = "distance";
pub(super) const UNREACHED: &str = "setpoint_unreached";

/// The attribute with what stays while the parameters vary.
pub(crate) const HELD: &str = "held";

/// What the dataset of a sweep holds.
pub(super) fn schema(runs: &Runs) -> Result<Schema, Error> {
    let Runs {
        case,
        options,
        over,
        starts,
        ..
    } = runs;
    let lanes = starts.count() * options.follow.directions().len().max(1);
    let states = state_names(case, over)?;
    let si = matches!(case.units(), Units::Si(_));
    let variables = variables(options, states.len(), si, has_setpoint(over));
    let bytes: usize = variables.iter().map(|v| v.stride() * v.kind.size()).sum();
    let x = &over[0];
    let (along_x, along_starts) = cut(runs, lanes, bytes);
    let mut axes: Vec<Axis> = over
        .iter()
        .skip(1)
        .map(|over| Axis::new(over.key.path(), over.count, 1))
        .collect();
    axes.push(Axis::new(x.key.path(), x.count, along_x));
    axes.push(Axis::new(START, lanes, along_starts));
    let grid = Grid { axes };
    check_size(grid.chunk_entries().saturating_mul(bytes), options.follow)?;
    Ok(Schema {
        grid,
        variables,
        coordinates: coordinates(runs, lanes, states),
        attributes: attributes(runs),
    })
}

/// Values of the first parameter, and starts, in one chunk.
fn cut(runs: &Runs, lanes: usize, bytes: usize) -> (usize, usize) {
    if runs.options.follow != Follow::Off {
        return (runs.over[0].count, 1);
    }
    let counts = runs.over.iter().map(|over| over.count);
    let runs = counts.product::<usize>() * lanes;
    let most = (CHUNK_BYTES / bytes.max(1)).clamp(1, MAX_RUNS);
    let target = runs.div_ceil(CHUNKS).clamp(1, most);
    let starts = lanes.min(target);
    ((target / starts).max(1), starts)
}

/// The names of the entries of a state, of the longest one that occurs.
fn state_names(case: &Case, over: &[Over]) -> Result<Vec<String>, Error> {
    let last = over
        .iter()
        .fold(case.clone(), |s, over| over.apply(&s, over.count - 1));
    let model = model(&last, "the last values")?;
    Ok(nanotap_observe::time_series::state_names(&model))
}

/// The variables; in SI where physical quantities vary, else in the model's units.
fn variables(options: &SweepOptions, states: usize, si: bool, setpoint: bool) -> Vec<Variable> {
    let unit = |dimension: Dimension| {
        if si {
            dimension.si_unit()
        } else {
            dimension.model_unit()
        }
    };
    let length = unit(Dimension::Length);
    let real = |name, long_name, units| Variable::new(name, Kind::Real, long_name, units);
    let names: Vec<&str> = CLASSES.iter().map(|c| c.name()).collect();
    let flags: Vec<usize> = (0..=CLASSES.len()).collect();
    let strobe = options.strobe();
    let mut variables = vec![
        Variable::new("classification", Kind::Code, "what the motion is", "1")
            .attribute("flag_values", json!(flags))
            .attribute("flag_meanings", format!("missing {}", names.join(" "))),
        Variable::new(
            "period",
            Kind::Whole,
            "minimal period, 0 if not periodic",
            "drive periods",
        ),
        Variable::new(
            "transient",
            Kind::Whole,
            "periods before the recording",
            "drive periods",
        ),
    ];
    variables.extend(
        ObservableSet::COMMON
            .iter()
            .map(|o| real(o.name, o.words, unit(o.dimension))),
    );
    variables.extend([
        real(
            "multiplier",
            "largest modulus of a Floquet multiplier of the orbit",
            "1",
        ),
        real("lyapunov", "largest Lyapunov exponent", "1/drive period"),
        real(
            "lyapunov_error",
            "its standard error; none for an orbit, where it is exact",
            "1/drive period",
        ),
        real(
            "period_max",
            "largest tip deflection of each recorded drive period",
            length,
        )
        .along(PERIODS, options.periods),
        real(
            "period_min",
            "smallest tip deflection of each recorded drive period",
            length,
        )
        .along(PERIODS, options.periods),
    ]);
    if setpoint {
        variables.push(real(
            DISTANCE,
            "distance at which the setpoint is first reached from far; none where it is not",
            "m",
        ));
    }
    if strobe > 0 {
        variables.push(
            real(
                "strobe",
                "state at the end of each of the last recorded drive periods",
                "model units",
            )
            .along(STROBE, strobe)
            .along(STATE, states),
        );
    }
    variables
}

fn coordinates(runs: &Runs, lanes: usize, states: Vec<String>) -> Vec<Coordinate> {
    let options = &runs.options;
    let mut coordinates: Vec<Coordinate> = runs.over.iter().map(parameter).collect();
    let whole = |from: usize, to: usize| Values::Whole((from..=to).map(|k| k as i32).collect());
    coordinates.push(Coordinate::of(
        START,
        whole(0, lanes - 1),
        "number of the start",
        "1",
    ));
    if options.follow != Follow::Off {
        let words = (0..lanes).map(|lane| if runs.lane(lane).1 { "up" } else { "down" }.to_owned());
        let mut direction = Coordinate::of(
            START,
            Values::Text(words.collect()),
            "which way the motion is followed",
            "1",
        );
        direction.name = "direction".into();
        coordinates.push(direction);
    }
    coordinates.push(Coordinate::of(
        PERIODS,
        whole(1, options.periods),
        "recorded drive period",
        "1",
    ));
    let strobe = options.strobe();
    if strobe > 0 {
        let ends = whole(options.periods - strobe + 1, options.periods);
        coordinates.push(Coordinate::of(
            STROBE,
            ends,
            "recorded drive period that has ended",
            "1",
        ));
        coordinates.push(Coordinate::of(
            STATE,
            Values::Text(states),
            "entry of the state",
            "1",
        ));
    }
    coordinates
}

pub(crate) fn parameter(over: &Over) -> Coordinate {
    let values = Values::Real(over.values());
    let unit = match over.kind {
        QuantityKind::Number => "1",
        kind => kind.si_unit(),
    };
    let mut coordinate = Coordinate::of(over.key.path(), values, over.key.meaning(), unit);
    coordinate
        .attributes
        .insert("symbol".into(), over.key.symbol().into());
    coordinate
        .attributes
        .insert("label".into(), over.label().into());
    coordinate
        .attributes
        .insert("spacing".into(), json!(over.spacing));
    coordinate
}

fn attributes(runs: &Runs) -> nanotap_dataset::schema::Attributes {
    let options = &runs.options;
    let names: Vec<&str> = runs.over.iter().map(|over| over.key.path()).collect();
    let title = format!("sweep over {}", names.join(" and "));
    let mut all = attributes::of_case(&title, "sweep", &runs.case);
    let starts = match &runs.starts {
        Starts::Rest => json!("rest"),
        Starts::Given(state) => json!({ "state": state }),
        Starts::Seeded { count, seed, sides } => {
            all.insert("seed".into(), json!(seed));
            json!({ "count": count, "seed": seed, "box": sides })
        }
        Starts::Spread { count, seed } => {
            all.insert("seed".into(), json!(seed));
            json!({ "count": count, "seed": seed, "box": [], "sizes": "spread" })
        }
    };
    let recipe: Value = json!({
        "over": runs.over,
        "starts": starts,
        "follow": options.follow,
        "periods": options.periods,
        "strobe": options.strobe(),
        "transient": options.transient,
        "max_period": options.max_period,
    });
    all.insert("sweep".into(), attributes::text(&recipe));
    if let Some(distances) = &runs.distances {
        let reasons = distances.iter().map(|found| found.as_ref().err());
        let reasons: Vec<_> = reasons.map(Option::<&String>::cloned).collect();
        all.insert(UNREACHED.into(), attributes::text(&reasons));
    }
    let keys: Vec<_> = runs.over.iter().map(|over| over.key).collect();
    let held = runs.case.held(&keys);
    if !held.is_empty() {
        all.insert(HELD.into(), attributes::text(&held));
    }
    all
}

/// The columns of a chunk, in the order of the schema's variables.
pub(super) fn columns(schema: &Schema, outcomes: &[Outcome]) -> Vec<Values> {
    let real = |value: fn(&Outcome) -> f64| Values::Real(outcomes.iter().map(value).collect());
    let whole = |value: fn(&Outcome) -> usize| {
        let fits = |o| i32::try_from(value(o)).unwrap_or(i32::MAX);
        Values::Whole(outcomes.iter().map(fits).collect())
    };
    let observed = |observable: &Observable| {
        let value = |o: &Outcome| (observable.of)(&o.observables).number();
        Values::Real(
            outcomes
                .iter()
                .map(|o| value(o).unwrap_or(f64::NAN))
                .collect(),
        )
    };
    let rows = |variable: &Variable, row: &dyn Fn(&Outcome) -> Vec<f64>| {
        let stride = variable.stride();
        let mut all = Vec::with_capacity(outcomes.len() * stride);
        for outcome in outcomes {
            let mut row = row(outcome);
            row.resize(stride, f64::NAN);
            all.extend(row);
        }
        Values::Real(all)
    };
    let states = schema.coordinate(STATE).map_or(0, |c| c.values.len());
    let strobe = |outcome: &Outcome| {
        let mut flat = Vec::new();
        for state in &outcome.strobe {
            flat.extend(in_columns(state, states));
        }
        flat
    };
    schema
        .variables
        .iter()
        .map(|variable| match variable.name.as_str() {
            "classification" => {
                Values::Code(outcomes.iter().map(|o| code(o.classification)).collect())
            }
            "period" => whole(|o| o.period),
            "transient" => whole(|o| o.transient),
            "multiplier" => real(|o| o.multiplier),
            "lyapunov" => real(|o| o.lyapunov),
            "lyapunov_error" => real(|o| o.lyapunov_error),
            DISTANCE => real(|o| o.distance),
            "period_max" => rows(variable, &|o| o.highs.clone()),
            "period_min" => rows(variable, &|o| o.lows.clone()),
            name => match Observable::named(name) {
                Some(observable) => observed(observable),
                None => rows(variable, &strobe),
            },
        })
        .collect()
}

/// A state in as many columns as the longest state has; what it lacks is missing.
fn in_columns(state: &[f64], columns: usize) -> Vec<f64> {
    let mut all = vec![f64::NAN; columns];
    // A sample's memory is one number at the end, or none.
    let (beam, memory) = state.split_at(state.len() - state.len() % 2);
    let (n, most) = (beam.len() / 2, columns / 2);
    all[..n].copy_from_slice(&beam[..n]);
    all[most..most + n].copy_from_slice(&beam[n..]);
    all[columns - memory.len()..].copy_from_slice(memory);
    all
}
