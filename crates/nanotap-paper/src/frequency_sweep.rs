//! The attractors at each drive frequency from several initial states: the columns of a bifurcation
//! diagram, of the cantilever or of an oscillator.

use nanotap_dynamics::{
    AttractorKind, CensusOptions, ClassifyOptions, Control, LyapunovOptions, StroboscopicMap as _,
    census,
};
use nanotap_figures::{Colour, Panel, Points};
use nanotap_flow::Trajectory;
use nanotap_flow::trajectory::PiecewiseSignal;
use rayon::prelude::*;

use super::PaperError;
use super::runs::{Runs, SEED};
use nanotap::case::{Case, Key};
use nanotap::model::Model;
use nanotap::model::model_map::ModelMap;
use nanotap::study::start_box::default_box;

/// Drive periods for which maxima of a motion that does not repeat are drawn.
const SHOWN_PERIODS: usize = 48;
/// Longest period that is searched for.
const MAX_PERIOD: usize = 32;
/// Initial states of a column that are followed before its attractors are known.
const INITIAL_RUNS: usize = 2;

/// Kind of a motion; a periodic one with its period in drive periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    Periodic(usize),
    Torus,
    Chaos,
    Undecided,
}

impl Kind {
    pub(super) fn words(self) -> String {
        match self {
            Self::Periodic(n) => format!("period {n}"),
            Self::Torus => "torus".to_owned(),
            Self::Chaos => "chaos".to_owned(),
            Self::Undecided => "undecided".to_owned(),
        }
    }

    pub(super) fn is_nonperiodic(self) -> bool {
        matches!(self, Self::Torus | Self::Chaos)
    }
}

/// A motion to which some initial states lead.
#[derive(Clone, Debug)]
pub(super) struct FoundMotion {
    pub(super) kind: Kind,
    /// Largest value of the drawn quantity in each of its drive periods: the deflection W of the
    /// cantilever's tip, or the distance of an oscillator from its stop.
    maxima: Vec<f64>,
}

/// All motions at one value of the parameter.
#[derive(Clone, Debug)]
pub(super) struct Column {
    pub(super) at: f64,
    pub(super) motions: Vec<FoundMotion>,
}

impl Column {
    /// The kinds of its motions, each once.
    pub(super) fn kinds(&self) -> Vec<Kind> {
        let mut kinds: Vec<Kind> = self.motions.iter().map(|m| m.kind).collect();
        kinds.sort_unstable();
        kinds.dedup();
        kinds
    }

    pub(super) fn has(&self, kind: Kind) -> bool {
        self.motions.iter().any(|m| m.kind == kind)
    }
}

/// `count` equally spaced values, including both ends.
pub(super) fn spaced(from: f64, to: f64, count: usize) -> Vec<f64> {
    (0..count)
        .map(|k| from + (to - from) * k as f64 / (count.max(2) - 1) as f64)
        .collect()
}

/// The columns at `values` of a parameter, from `starts` initial states each.
pub(super) fn sweep(
    runs: &Runs<'_>,
    subject: &Case,
    key: Key,
    values: &[f64],
    starts: usize,
) -> Result<Vec<Column>, PaperError> {
    let done = std::sync::atomic::AtomicUsize::new(0);
    runs.controlled(|control| {
        values
            .par_iter()
            .map(|&value| {
                if control.is_cancelled() {
                    return Err(PaperError::Cancelled);
                }
                let column = column(&subject.with(key, value), value, starts)?;
                let count = 1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                if let Some(progress) = control.progress {
                    progress(count, values.len());
                }
                Ok(column)
            })
            .collect()
    })
}

/// Budgets small enough for thousands of runs: exponents to a hundredth, tori to six digits.
fn budgets() -> ClassifyOptions {
    ClassifyOptions {
        max_period: MAX_PERIOD,
        max_transient: 512,
        lyapunov: LyapunovOptions {
            alignment: 50,
            min_periods: 400,
            max_periods: 1600,
            absolute_error: 5e-3,
            relative_error: 0.1,
        },
        birkhoff_periods: 1024,
        torus_digits: 6.0,
        ..ClassifyOptions::default()
    }
}

fn column(subject: &Case, at: f64, starts: usize) -> Result<Column, PaperError> {
    let model = subject.model()?;
    let area = default_box(&model).map_err(PaperError::failed("the box of initial states"))?;
    let options = CensusOptions {
        pilots: INITIAL_RUNS,
        classify: budgets(),
        ..CensusOptions::default()
    };
    let starts = area.starts(SEED, starts);
    let found = census(
        &ModelMap::new(&model),
        &starts,
        &options,
        &Control::default(),
    );
    let seen = |kind, state: &[f64], periods| -> Result<FoundMotion, PaperError> {
        let maxima = maxima(&model, state, periods)?;
        Ok(FoundMotion { kind, maxima })
    };
    let mut motions: Vec<FoundMotion> = Vec::new();
    for attractor in found.attractors {
        let state = &attractor.state;
        motions.push(match attractor.kind {
            AttractorKind::Periodic(orbit) => {
                seen(Kind::Periodic(orbit.period), &orbit.states[0], orbit.period)
            }
            AttractorKind::QuasiPeriodic(_) => seen(Kind::Torus, state, SHOWN_PERIODS),
            AttractorKind::Chaotic { .. } => seen(Kind::Chaos, state, SHOWN_PERIODS),
        }?);
    }
    if let Some((start, _)) = found.undecided.first() {
        let mut state = starts[*start].clone();
        let mut map = ModelMap::new(&model);
        for _ in 0..options.classify.max_transient {
            map.advance(&mut state).map_err(not_drawn)?;
        }
        motions.push(seen(Kind::Undecided, &state, SHOWN_PERIODS)?);
    }
    Ok(Column { at, motions })
}

fn not_drawn<E: ToString>(error: E) -> PaperError {
    PaperError::failed("a motion's maxima")(error)
}

/// Largest deflection of the tip away from the sample (for an oscillator: distance from its stop)
/// in each of `periods` drive periods from `state`.
pub(super) fn maxima(model: &Model, state: &[f64], periods: usize) -> Result<Vec<f64>, PaperError> {
    let trajectory = Trajectory::record(&model.system, state, periods).map_err(not_drawn)?;
    let signal = trajectory.signal(if model.beam.is_some() {
        &model.tip
    } else {
        &model.gap
    });
    let period_of = |start: f64| (start / model.period() + 1e-9).floor();
    Ok(signal
        .pieces
        .chunk_by(|a, b| period_of(a.start) == period_of(b.start))
        .filter_map(|pieces| {
            PiecewiseSignal {
                pieces: pieces.to_vec(),
            }
            .range()
            .map(|(_, high)| high.value)
        })
        .collect())
}

/// Labels and colours of the kinds.
const STYLES: [(&str, Colour); 8] = [
    ("period 1", Colour::BLUE),
    ("period 2", Colour::VERMILLION),
    ("period 3", Colour::GREEN),
    ("period 4", Colour::PURPLE),
    ("longer periods", Colour::ORANGE),
    ("torus", Colour::SKY),
    ("chaos", Colour::BLACK),
    ("undecided", Colour::GREY),
];

fn style_of(kind: Kind) -> usize {
    match kind {
        Kind::Periodic(n) => n.clamp(1, 5) - 1,
        Kind::Torus => 5,
        Kind::Chaos => 6,
        Kind::Undecided => 7,
    }
}

/// Adds the maxima of all columns to a panel, coloured by kind.
pub(super) fn draw(mut panel: Panel, columns: &[Column], diameter: f64) -> Panel {
    for (k, (label, colour)) in STYLES.iter().enumerate() {
        let points: Vec<(f64, f64)> = columns
            .iter()
            .flat_map(|c| {
                let motions = c.motions.iter().filter(|m| style_of(m.kind) == k);
                motions.flat_map(|m| m.maxima.iter().map(|w| (c.at, *w)))
            })
            .collect();
        if !points.is_empty() {
            let diameter = if matches!(k, 5..) {
                0.6 * diameter
            } else {
                diameter
            };
            panel = panel.with(
                Points::new(points)
                    .diameter(diameter)
                    .colour(*colour)
                    .label(*label),
            );
        }
    }
    panel
}

/// Intervals of the parameter with the same kinds of motion: (from, to, kinds).
pub(super) fn stretches(columns: &[Column]) -> Vec<(f64, f64, Vec<Kind>)> {
    columns
        .chunk_by(|a, b| a.kinds() == b.kinds())
        .filter_map(|part| Some((part.first()?.at, part.last()?.at, part.first()?.kinds())))
        .collect()
}

/// Values of the parameter at which `kind` occurs, as text: "2.65–2.91, 7.00–7.50".
pub(super) fn where_seen(columns: &[Column], kind: impl Fn(&Column) -> bool) -> String {
    let parts: Vec<String> = columns
        .chunk_by(|a, b| kind(a) == kind(b))
        .filter(|part| part.first().is_some_and(&kind))
        .filter_map(|part| {
            let (from, to) = (part.first()?.at, part.last()?.at);
            Some(if part.len() == 1 {
                format!("{from:.3}")
            } else {
                format!("{from:.3}–{to:.3}")
            })
        })
        .collect();
    if parts.is_empty() {
        "nowhere".to_owned()
    } else {
        parts.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap_dynamics::{MotionKind, classify};

    fn column(at: f64, kinds: &[Kind]) -> Column {
        let motions = kinds
            .iter()
            .map(|kind| FoundMotion {
                kind: *kind,
                maxima: vec![1.0],
            })
            .collect();
        Column { at, motions }
    }

    #[test]
    fn stretches_join_what_is_alike() {
        let (one, two) = (Kind::Periodic(1), Kind::Periodic(2));
        let columns = [
            column(1.0, &[one]),
            column(2.0, &[one]),
            column(3.0, &[two, one]),
            column(4.0, &[one, two]),
        ];
        let found = stretches(&columns);
        assert_eq!(
            found,
            vec![(1.0, 2.0, vec![one]), (3.0, 4.0, vec![one, two])]
        );
        assert_eq!(where_seen(&columns, |c| c.has(two)), "3.000–4.000");
        assert_eq!(where_seen(&columns, |c| c.has(Kind::Chaos)), "nowhere");
    }

    #[test]
    fn values_hold_both_ends() {
        assert_eq!(spaced(2.0, 3.0, 5), [2.0, 2.25, 2.5, 2.75, 3.0]);
        assert_eq!(spaced(2.0, 3.0, 1), [2.0]);
    }

    /// A period-2 orbit has two maxima, one per drive period, and repeats them.
    #[test]
    fn maxima_are_one_a_drive_period() {
        let model = Model::cantilever(
            &nanotap::model::cantilever::Cantilever::paper()
                .with(nanotap::model::parameter::Parameter::Omega, 2.8),
        )
        .unwrap();
        let classified = classify(
            &mut ModelMap::new(&model),
            &[0.0; 6],
            &ClassifyOptions::default(),
        );
        let MotionKind::Periodic(orbit) = classified.kind else {
            panic!("Ω = 2.8 is periodic")
        };
        assert_eq!(orbit.period, 2);
        let found = maxima(&model, &orbit.states[0], 4).unwrap();
        assert_eq!(found.len(), 4);
        assert!((found[0] - found[2]).abs() < 1e-9 && (found[0] - found[1]).abs() > 1e-3);
    }
}
