//! One motion: its figures, its film, its observables, and equivalent commands.

use std::sync::PoisonError;

use nanotap::ErrorKind;
use nanotap::case::quantity::Kind;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::figure::contact::contact_figure;
use nanotap::figure::motion::{fixed_step_figure, orbit_figure, simulation_figure};
use nanotap::model::Model;
use nanotap::observe::table::shown_phase;
use nanotap::observe::{Dimension, OBSERVABLES, Observable, Observables};
use nanotap::study::orbit::{OrbitOptions, OrbitReport, orbit, spectral_radius};
use nanotap::study::registry::Study as _;
use nanotap::study::request::read;
use nanotap::study::simulate::{
    SimulateOptions, SimulateReport, SimulateStudy, Simulation, simulate,
};
use nanotap_figures::Figure;
use serde_json::{Value, json};

use crate::api_error::ApiError;
use crate::figures::drawn;
use crate::film::film;
use crate::motion_request::{MotionRequest, Start, model_of};
use crate::readout::readout;
use crate::row::limits;
use crate::{Explorer, commands, forms, knobs};

/// Largest number of drive periods in the film and the figures of a motion without a period.
const LONGEST: usize = 16;
/// Step with which a motion is followed, as a part of the value that changes.
const STEP: f64 = 0.005;
/// Most steps from one motion to the next.
const MAX_STEPS: f64 = 200.0;
/// Drive periods of a run of fixed steps.
const FIXED_PERIODS: usize = 64;

/// A motion that was found.
pub(crate) enum Motion {
    Orbit(Box<OrbitReport>),
    /// A motion that does not close.
    Run(Box<Simulation>),
}

impl Motion {
    pub(crate) fn find(model: &Model, start: &Start) -> Result<Self, ApiError> {
        let request = OrbitOptions {
            period: start.period,
            state: start.state.clone().map(Into::into),
            ..OrbitOptions::default()
        };
        match orbit(model, &request) {
            Ok(found) => Ok(Self::Orbit(Box::new(found))),
            Err(error) if start.period.is_none() && error.kind == ErrorKind::Numerics => {
                let request = SimulateOptions {
                    state: start.state.clone().map(Into::into),
                    ..SimulateOptions::default()
                };
                let run = simulate(model, &request).map_err(ApiError::of)?;
                Ok(Self::Run(Box::new(run)))
            }
            Err(error) => Err(ApiError::of(error)),
        }
    }

    /// Where the model does not hold for it.
    fn limits(&self, case: &Case) -> Vec<String> {
        let beyond = match self {
            Self::Orbit(orbit) => &orbit.out_of_range,
            Self::Run(run) => &run.out_of_range,
        };
        limits(case, self.observables(), beyond)
    }

    pub(crate) fn observables(&self) -> &Observables {
        match self {
            Self::Orbit(orbit) => &orbit.observables,
            Self::Run(run) => &run.observables,
        }
    }

    /// Time series, phase portrait, harmonics and multipliers, as the terminal draws them.
    pub(crate) fn figure(&self, model: &Model, case: &Case) -> Figure {
        match self {
            Self::Orbit(orbit) => orbit_figure(model, orbit, &case.units()),
            Self::Run(run) => simulation_figure(model, run, &case.units()),
        }
    }

    /// Height and force against time, force against height.
    pub(crate) fn contact_figure(&self, model: &Model, case: &Case) -> Figure {
        let trajectory = match self {
            Self::Orbit(orbit) => &orbit.trajectory,
            Self::Run(run) => &run.trajectory,
        };
        contact_figure(model, trajectory, self.periods(), &case.units())
    }

    pub(crate) fn state(&self) -> &[f64] {
        match self {
            Self::Orbit(orbit) => &orbit.state,
            Self::Run(run) => &run.start,
        }
    }

    pub(crate) fn periods(&self) -> usize {
        match self {
            Self::Orbit(orbit) => orbit.period.min(LONGEST),
            Self::Run(_) => LONGEST,
        }
    }

    /// The study that computes it at the terminal.
    const fn study(&self) -> &'static str {
        match self {
            Self::Orbit(_) => "orbit",
            Self::Run(_) => "simulate",
        }
    }

    /// A sentence that describes the motion.
    fn words(&self) -> String {
        match self {
            Self::Orbit(orbit) => {
                format!(
                    "period {}, {}; largest |multiplier| {}",
                    orbit.period,
                    orbit.stability,
                    Kind::Number.format_digits(spectral_radius(&orbit.multipliers), 4)
                )
            }
            Self::Run(run) => format!("{}: {}", run.classification.name(), run.evidence),
        }
    }
}

/// The motion of a request and all that the page shows of it.
pub(crate) fn answer(
    app: &Explorer,
    request: &MotionRequest,
    control: &Control<'_>,
) -> Result<Value, ApiError> {
    let (case, base) = (
        request.case.case(app, control)?,
        request.case.base(app, control)?,
    );
    let model = model_of(&case)?;
    *app.shown.lock().unwrap_or_else(PoisonError::into_inner) = Some(request.case.clone());
    let mut start = Start::parse(&request.start)?;
    if let Some(from) = &request.from {
        start = followed(&from.case(app, control)?, &case, start)?;
    }
    let motion = Motion::find(&model, &start)?;
    let accepts = |word: String| request.case.with_word(app, word).is_some();
    let accepts = request.ranges.then_some(&accepts as knobs::Accepts<'_>);
    // The commands start where the followed motion does.
    let mut said = request.clone();
    if let (Some(_), Some(state)) = (&request.from, &start.state) {
        said.start = Start::text(start.period, state);
    }
    let mut remarks = motion.limits(&case);
    remarks.extend(case.remarks().into_iter().map(|remark| remark.text));
    Ok(json!({
        "title": case.title(),
        "summary": motion.words(),
        "remarks": remarks,
        "keys": knobs::knobs_of(&case, &base, accepts),
        "readout": readout(&case, motion.observables()),
        "distance": case.physical().map(|_| Kind::Length.format_digits(case.get(Key::GapTip), 5)),
        "observables": rows(&case, motion.observables()),
        "start": Start::text(None, motion.state()),
        "figure": drawn(&motion.figure(&model, &case))?,
        "contact": drawn(&motion.contact_figure(&model, &case))?,
        "film": film(&case, &model, motion.state(), motion.periods())?,
        "fixed_step": fixed_step(&case, &model, request.steps, start.state, control)?,
        "forms": forms::forms(&case, &base, &model),
        "command": commands::command(app, &said, motion.study())?,
        "python": commands::python(app, &said, motion.study())?,
    }))
}

/// The start of a motion of `case` that is followed from a motion of `from` which starts at `start`. One
/// number that differs changes in small steps, so that the motion that is reached depends on the way and
/// not on how fast it was gone.
fn followed(from: &Case, case: &Case, start: Start) -> Result<Start, ApiError> {
    let differs = |key: &Key| {
        let [before, after] = [from, case].map(|case| case.get(*key));
        before.is_finite() && after.is_finite() && before != after && key.cannot_vary().is_none()
    };
    let [had, has] = [from, case].map(Case::units);
    let (Some(mut state), None) = (start.state.clone(), start.period) else {
        return Ok(start);
    };
    // With another number of modes the state has another length: the motion begins at rest.
    let [had_size, has_size] = [from.model()?.dimension(), case.model()?.dimension()];
    if state.len() != had_size || had_size != has_size {
        return Ok(Start::default());
    }
    let changed: Vec<Key> = knobs::keys(case).filter(differs).collect();
    let stated = changed
        .iter()
        .find(|key| case.stated(**key) != from.stated(**key));
    let key = if case.is_physical() {
        stated
    } else {
        changed.first()
    };
    if let Some(&key) = key {
        let (before, after) = (from.get(key), case.get(key));
        let step = STEP * before.abs().max(after.abs());
        let (first, last) = ((before / step).round(), (after / step).round());
        let count = (last - first).abs().min(MAX_STEPS) as usize;
        let mut period = None;
        for k in 1..count {
            let value = step * (first + (last - first) * k as f64 / count as f64);
            let there = from.with(key, value);
            let Ok(model) = there.model() else { break };
            if let Some(found) = near(&model, &state, &mut period)? {
                state = found;
            }
        }
    }
    // States are in units of a length that may follow from the distance.
    if let (Some(had), Some(has)) = (had.si(Kind::Length), has.si(Kind::Length)) {
        for number in &mut state {
            *number *= had / has;
        }
    }
    Ok(Start {
        period: None,
        state: Some(state),
    })
}

/// The state of the stable orbit to which a motion from `state` leads, if there is one. From an orbit of
/// `period` nearby it is closed at once.
fn near(
    model: &Model,
    state: &[f64],
    period: &mut Option<usize>,
) -> Result<Option<Vec<f64>>, ApiError> {
    for tried in [*period, None] {
        let options = OrbitOptions {
            period: tried,
            state: Some(state.to_vec().into()),
            ..OrbitOptions::default()
        };
        match orbit(model, &options) {
            Ok(found) if found.stable => {
                *period = Some(found.period);
                return Ok(Some(found.state));
            }
            Err(error) if error.kind == ErrorKind::Stopped => return Err(error.into()),
            _ => *period = None,
        }
        if tried.is_none() {
            break;
        }
    }
    Ok(None)
}

/// Every scalar observable of the motion: as in the terminal's `--json`, and as text with its unit.
fn rows(case: &Case, observables: &Observables) -> Vec<Value> {
    OBSERVABLES
        .iter()
        .filter_map(|observable| {
            Some(json!({
                "name": observable.name,
                "words": observable.words,
                "value": (observable.of)(observables).number()?,
                "shown": shown(case, observable, observables)?,
            }))
        })
        .collect()
}

/// A scalar observable as text with its unit.
pub(crate) fn shown(
    case: &Case,
    observable: &Observable,
    observables: &Observables,
) -> Option<String> {
    shown_digits(case, observable, observables, 5)
}

/// The same with this number of digits.
pub(crate) fn shown_digits(
    case: &Case,
    observable: &Observable,
    observables: &Observables,
    digits: usize,
) -> Option<String> {
    let mut value = (observable.of)(observables).number()?;
    let balance = &observables.energy_balance;
    // A conservative force loses no energy.
    if observable.name == "dissipation" && balance.resolved(balance.sample_damping) == 0.0 {
        value = 0.0;
    }
    let dimension = observable.dimension;
    let units = case.units();
    let si = dimension
        .kind()
        .and_then(|kind| Some((kind, units.si(kind)?)));
    Some(match (dimension, si) {
        // Harmonics have their lags as in the data, in (−180°, 180°].
        (Dimension::Angle, _) if observable.name != "phase" => format!("{value:.2}°"),
        (Dimension::Angle, _) => format!("{:.2}°", shown_phase(value)),
        (_, Some((kind, unit))) => kind.format_digits(unit * value, digits),
        (_, None) => {
            let number = Kind::Number.format_digits(value, digits);
            // The numbers of an oscillator have the units of its equation, which are not named.
            match dimension.model_unit() {
                _ if case.oscillator().is_some() => number,
                "1" => number,
                "1/drive period" => format!("{number} per drive period"),
                unit => format!("{number} {unit}"),
            }
        }
    })
}

/// The result of fixed Runge–Kutta steps; empty if not requested.
fn fixed_step(
    case: &Case,
    model: &Model,
    steps: u32,
    state: Option<Vec<f64>>,
    control: &Control<'_>,
) -> Result<Option<Value>, ApiError> {
    if steps == 0 {
        return Ok(None);
    }
    let request = json!({ "method": "rk4", "steps": steps, "periods": FIXED_PERIODS });
    let mut request: SimulateOptions = read(request).map_err(|e| ApiError::of(e).about("steps"))?;
    request.state = state.map(Into::into);
    let run = match SimulateStudy::run(case, &request, control) {
        Ok(SimulateReport::FixedStep(run)) => run,
        Ok(SimulateReport::Exact(_) | SimulateReport::OneShot(_)) => return Ok(None),
        // With too few steps only the exact motion is shown.
        Err(error) => return Ok(Some(json!({ "words": error.to_string() }))),
    };
    let shown = run.apparent_period.map_or_else(
        || format!("no period up to {}", run.longest_apparent),
        |n| format!("period {n}"),
    );
    Ok(Some(json!({
        "words": format!(
            "{steps} steps per period show {shown}. From the same state the exact flow reaches: {}",
            run.exact.evidence
        ),
        "figure": drawn(&fixed_step_figure(model, &run, &case.units()))?,
    })))
}
