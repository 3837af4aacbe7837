//! Motions that no start of a sweep met at a value, but that those of the neighbouring
//! values lead to.
//!
//! Starts are drawn; an attractor whose basin is small is met at some values and missed at
//! others. So each stable orbit that the runs ended on is tried at the neighbouring values,
//! both ways along every parameter, and what is new there at its neighbours in turn
//! ([`nanotap_dynamics::share_orbits`]). Where starts of all sizes are drawn at each value, the
//! states of a slowly moved lever there ([`states_near`]) are tried as well: one approach
//! serves all distances of a line of values, along which the branches of the orbits that runs
//! ended on are followed too. What that finds is stored with the dataset, in
//! `neighbours.json`: the runs stay what they are.
//!
//! Fails: where the number of modes varies, or no strobe states were kept, nothing is tried;
//! an orbit that no run at any value ended on is not found.

use std::collections::BTreeMap;

use nanotap_dynamics::{
    AttractorKind, Control, PeriodicOrbit, ShootingOptions, close_orbit, grid_neighbours,
    share_orbits,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::run::is_on;
use super::{Runs, Starts};
use nanotap_case::{Case, Key};
use nanotap_dataset::{Store, StoreError, WorkError};
use nanotap_model::model_map::ModelMap;
use nanotap_motions::approach::{states_at, states_near};
use nanotap_motions::short_run::short_run;
use nanotap_observe::{ObservableSet, measure};

/// File of a sweep's dataset that holds these motions.
const FILE: &str = "neighbours.json";

/// A stable orbit that no start met at a value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FromNeighbour {
    /// Index of the value of each parameter, in the order in which they were given.
    pub at: Vec<usize>,
    /// Value of each parameter, in the unit of its key and in the order in which they were given.
    pub values: Vec<f64>,
    /// Period in drive periods; 0 for a motion that does not repeat.
    pub period: usize,
    /// State on the motion at drive phase 0, in the model's units. Its entries are a_1 … a_N (or
    /// x), their rates, then any memory of the sample.
    pub state: Vec<f64>,
    /// Amplitude at the drive's frequency, in the dataset's unit of length.
    pub first_harmonic: f64,
    /// Largest tip deflection, in the dataset's unit of length.
    pub tip_max: f64,
    /// Contact time / period, 0 to 1.
    pub contact_fraction: f64,
    /// Observables by name, in the dataset's units.
    #[serde(default)]
    pub observables: BTreeMap<String, f64>,
}

impl Runs {
    /// Tries the orbits of a finished dataset of this sweep at the neighbouring values, and
    /// stores with it what no start had met there; nothing if that was done.
    pub(super) fn share(&self, store: &Store, control: &Control<'_>) -> Result<(), WorkError> {
        if store.read_beside(FILE)?.is_some() {
            return Ok(());
        }
        let found = match store.schema().index_of("strobe") {
            Some(strobe) if self.over.iter().all(|o| o.key != Key::Modes) => {
                self.gained(store, strobe, control)?
            }
            _ => Vec::new(),
        };
        if control.is_cancelled() {
            return Err(WorkError::Neighbours);
        }
        let text = serde_json::to_string(&found).unwrap_or_default();
        Ok(store.write_beside(FILE, text.as_bytes())?)
    }

    fn gained(
        &self,
        store: &Store,
        strobe: usize,
        control: &Control<'_>,
    ) -> Result<Vec<FromNeighbour>, StoreError> {
        let shape: Vec<usize> = self.over.iter().map(|over| over.count).collect();
        let count: usize = shape.iter().product();
        let place = |k: usize| [k % shape[0], k / shape[0]];
        let map_at = |k: usize| {
            let case = self.case_of(k).ok_or("the setpoint is not reached")?;
            let model = case.model().map_err(|error| error.to_string())?;
            Ok::<_, String>(ModelMap::new(&model))
        };
        let neighbours = grid_neighbours(&shape);
        let states = self.orbit_states(store, strobe, count)?;
        let met: Vec<Vec<PeriodicOrbit>> = states
            .into_par_iter()
            .with_max_len(1)
            .enumerate()
            .map(|(k, met)| match map_at(k) {
                Ok(mut map) if !control.is_cancelled() => closed(&mut map, Vec::new(), &met),
                _ => Vec::new(),
            })
            .collect();
        let quasistatic = match self.starts {
            Starts::Spread { .. } => self.quasistatic(&shape, &met, control),
            _ => vec![Vec::new(); count],
        };
        // How many orbits runs ended on, and all that are known.
        let own: Vec<usize> = met.iter().map(Vec::len).collect();
        let known: Vec<Vec<PeriodicOrbit>> = met
            .into_par_iter()
            .zip(quasistatic)
            .with_max_len(1)
            .enumerate()
            .map(|(k, (met, further))| match map_at(k) {
                Ok(mut map) if !control.is_cancelled() => closed(&mut map, met, &further),
                _ => met,
            })
            .collect();
        let classify = short_run(self.options.max_period);
        let values = share_orbits(known, map_at, neighbours, &classify, control);
        let mut found = Vec::new();
        for (k, value) in values.into_iter().enumerate() {
            let gained = value.attractors.into_iter().skip(own[k]);
            for attractor in gained.map(|a| a.attractor) {
                let period = match &attractor.kind {
                    AttractorKind::Periodic(orbit) => orbit.period,
                    _ => 0,
                };
                let Some(case) = self.case_of(k) else {
                    continue;
                };
                let turn = if period == 0 { UNREPEATED } else { period };
                let Ok(model) = case.model() else { continue };
                let Ok(seen) = measure(&model, &attractor.state, turn, ObservableSet::COMMON)
                else {
                    continue;
                };
                let seen = case
                    .physical()
                    .map_or(seen, |view| seen.in_si(&view.scales));
                let at = &place(k)[..shape.len()];
                found.push(FromNeighbour {
                    at: at.to_vec(),
                    values: at
                        .iter()
                        .zip(&self.over)
                        .map(|(&index, over)| over.value(index))
                        .collect(),
                    period,
                    state: attractor.state,
                    first_harmonic: seen.first_harmonic,
                    tip_max: seen.tip_max,
                    contact_fraction: seen.contact_fraction,
                    observables: ObservableSet::COMMON
                        .iter()
                        .filter_map(|o| Some((o.name.to_owned(), (o.of)(&seen).number()?)))
                        .collect(),
                });
            }
        }
        Ok(found)
    }

    /// Periods and states of the orbits on which a slowly moved lever may be, and of those on the
    /// branches of the orbits that runs ended on, at every value: what is found at one must not depend
    /// on how many others there are.
    fn quasistatic(
        &self,
        shape: &[usize],
        met: &[Vec<PeriodicOrbit>],
        control: &Control<'_>,
    ) -> Vec<Vec<OrbitState>> {
        let quiet = Control {
            progress: None,
            ..*control
        };
        let gap = self.case.gap_key();
        let distances = self.over.iter();
        let distances =
            distances.map(|over| [gap, Key::GapTip, Key::DriveSetpoint].contains(&over.key));
        let distances: Vec<bool> = distances.collect();
        let columns = shape[0];
        let rows = shape.get(1).copied().unwrap_or(1);
        // One approach serves a line of values of the distance.
        let lines: Vec<Vec<usize>> = match distances[..] {
            [true, ..] => (0..rows)
                .map(|y| (0..columns).map(|x| y * columns + x).collect())
                .collect(),
            [false, true] => (0..columns)
                .map(|x| (0..rows).map(|y| y * columns + x).collect())
                .collect(),
            _ => (0..columns * rows).map(|k| vec![k]).collect(),
        };
        let found: Vec<(Vec<usize>, Vec<Vec<PeriodicOrbit>>)> = lines
            .into_par_iter()
            .with_max_len(1)
            .map(|line| {
                // Where a setpoint is not reached there is no distance.
                let reached = line.into_iter().filter_map(|k| Some((k, self.case_of(k)?)));
                let (line, cases): (Vec<usize>, Vec<Case>) = reached.unzip();
                let Some(case) = cases.first() else {
                    return (line, Vec::new());
                };
                let most = self.options.max_period;
                let states = if line.len() == 1 {
                    states_near(case, most, &quiet).map(|states| vec![states])
                } else {
                    let gaps: Vec<f64> = cases.iter().map(|case| case.get(gap)).collect();
                    let known = line.iter().zip(&gaps);
                    let known = known.flat_map(|(&k, &gap)| {
                        met[k].iter().map(move |orbit| (gap, orbit.clone()))
                    });
                    states_at(case, &gaps, &known.collect::<Vec<_>>(), most, &quiet)
                };
                (line, states.unwrap_or_default())
            })
            .collect();
        let mut states = vec![Vec::new(); columns * rows];
        for (line, orbits) in found {
            for (k, orbits) in line.into_iter().zip(orbits) {
                let own = orbits
                    .into_iter()
                    .filter_map(|orbit| Some((orbit.period, orbit.states.into_iter().next()?)));
                states[k].extend(own);
            }
        }
        states
    }

    /// Period and state of every run that ended on an orbit, value by value, the first
    /// parameter fastest.
    fn orbit_states(
        &self,
        store: &Store,
        strobe: usize,
        count: usize,
    ) -> Result<Vec<Vec<OrbitState>>, StoreError> {
        let schema = store.schema();
        let stride = schema.variables[strobe].stride();
        let columns = schema.coordinate(super::dataset::STATE);
        let columns = columns.map_or(stride, |c| c.values.len());
        let of_chunk = |chunk: usize| -> Result<Vec<(usize, OrbitState)>, StoreError> {
            let block = schema.grid.block(chunk);
            let periods = match schema.index_of("period") {
                Some(period) => store.read_chunk(&block, period)?.numbers(),
                None => Vec::new(),
            };
            let rows = store.read_chunk(&block, strobe)?.numbers();
            let mut found = Vec::new();
            for (flat, entry) in block.entries().enumerate() {
                let period = periods.get(flat).map_or(0, |period| *period as usize);
                let end = (flat + 1) * stride;
                let state = rows.get(end - columns..end).unwrap_or_default();
                if period > 0 && state.iter().all(|v| v.is_finite()) {
                    let axis = self.axis();
                    let first = entry[axis];
                    let second = if axis > 0 { entry[0] } else { 0 };
                    let width = self.over[0].count;
                    found.push((second * width + first, (period, state.to_vec())));
                }
            }
            Ok(found)
        };
        let chunks = (0..store.chunks()).into_par_iter().map(of_chunk);
        let mut states = vec![Vec::new(); count];
        for (value, state) in chunks.collect::<Result<Vec<_>, _>>()?.into_iter().flatten() {
            states[value].push(state);
        }
        Ok(states)
    }
}

/// Period and state of an orbit on which a run ended.
type OrbitState = (usize, Vec<f64>);

/// Drive periods over which a motion that does not repeat is measured.
const UNREPEATED: usize = 64;

/// These orbits, and the other stable ones among the states that runs ended in, each once.
fn closed(
    map: &mut ModelMap,
    mut orbits: Vec<PeriodicOrbit>,
    states: &[OrbitState],
) -> Vec<PeriodicOrbit> {
    for (period, state) in states {
        let known = orbits.iter().filter(|o| o.period == *period);
        if known.into_iter().any(|orbit| is_on(orbit, state)) {
            continue;
        }
        let Ok(orbit) = close_orbit(map, state, *period, &ShootingOptions::default()) else {
            continue;
        };
        if orbit.is_stable() && !orbits.iter().any(|o| o.is_same_as(&orbit)) {
            orbits.push(orbit);
        }
    }
    orbits
}

/// The motions stored with a dataset; none where nothing was tried.
///
/// # Errors
/// When the file cannot be read or is damaged.
pub fn from_neighbours(store: &Store) -> Result<Vec<FromNeighbour>, StoreError> {
    let Some(bytes) = store.read_beside(FILE)? else {
        return Ok(Vec::new());
    };
    serde_json::from_slice(&bytes).map_err(|error| StoreError::NotAStore {
        path: store.path().into(),
        what: format!("its {FILE} is damaged: {error}"),
    })
}
