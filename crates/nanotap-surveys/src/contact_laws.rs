//! The same lever and drive on each of the samples: what difference the contact law makes.
//!
//! The samples share spring α4 and damper. Where a law has the damper in an arm, in series with a
//! spring, the stiffness of the arm is given: with an ever stiffer arm such a solid becomes the
//! Kelvin–Voigt surface. Laws whose numbers do not follow from spring, damper and arm are compared
//! where the case has them. The periodic orbit of one period on each law is compared, stable or
//! not, and its branch in the drive frequency.

use nanotap_dynamics::{
    ClassifyOptions, ContinuationOptions, Control, ShootingOptions, classify, close_orbit,
};
use nanotap_figures::Figure;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::figure::contact_laws::sample_figure;
use nanotap_case::Case;
use nanotap_case::Key;
use nanotap_case::units::Units;
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::contact::ContactLaw;
use nanotap_model::model_map::ModelMap;
use nanotap_model::parameter::Parameter;
use nanotap_model::recording::Curve;
use nanotap_model::sample_law::SampleLaw;
use nanotap_motions::branch::{BranchOptions, BranchReport, Range, branches_through};
use nanotap_motions::orbit::{OrbitOptions, OrbitReport, no_period, orbit, spectral_radius};
use nanotap_motions::simulate::{Classification, NamedMotion};
use nanotap_observe::frame::{Frame, Rows, frame};
use nanotap_observe::{Observables, PhysicalMotion};
use nanotap_study::Study;
use nanotap_study::cantilever;
use nanotap_study::limits::MAX_PERIOD;
use nanotap_study::request::options;
use nanotap_study::value::{Amount, implied};

/// The motion under one contact law.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SampleMotion {
    /// Name of the contact law.
    pub contact: String,
    /// The case with this law.
    #[schemars(with = "Map<String, Value>")]
    pub case: Cantilever,
    /// Class of the motion that a run from rest reaches.
    pub from_rest: Classification,
    /// Period in drive periods, if periodic.
    pub from_rest_period: Option<usize>,
    /// The orbit of the requested period, if any.
    #[serde(flatten)]
    pub orbit: Option<OrbitLook>,
    /// Observables of the orbit in SI, for a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<PhysicalMotion>,
    /// Reason why there is no orbit of the requested period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The branch through it in the drive frequency, if it was followed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub branch: Option<BranchReport>,
    /// Pairs (gap, force) of a nonlinear law on a slow approach and retract over the gaps of the
    /// orbits, in the model's units.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub force_curve: Vec<[f64; 2]>,
}

/// State, stability and observables of a periodic orbit.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct OrbitLook {
    /// Minimal period in drive periods.
    pub period: usize,
    /// State at drive phase 0, in the model's units. Its entries are a_1 … a_N (or x), their rates,
    /// then any memory of the sample.
    pub state: Vec<f64>,
    /// Largest modulus of the Floquet multipliers, dimensionless.
    pub spectral_radius: f64,
    /// Whether every Floquet multiplier is inside the unit circle.
    pub stable: bool,
    /// Observables in the model's units.
    #[serde(flatten)]
    pub observables: Observables,
    /// Pairs (indentation −V_T, force) along the orbit, in the model's units.
    #[serde(rename = "loop")]
    pub force_loop: Vec<[f64; 2]>,
}

/// The motions under all contact laws.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Comparison {
    /// Drive frequency Ω of all motions, dimensionless.
    pub omega: f64,
    /// Period of the compared orbits, in drive periods.
    pub period: usize,
    /// The motions, in the order of [`ContactLaw::ALL`].
    pub samples: Vec<SampleMotion>,
}

impl Comparison {
    /// The loops of force and indentation, a row a point.
    pub fn loop_table(&self, units: Units) -> Frame<'_> {
        let points = self.samples.iter().flat_map(|sample| {
            let points = sample.orbit.iter().flat_map(|orbit| &orbit.force_loop);
            points.map(move |point| (&*sample.contact, point))
        });
        frame! { Rows::new("loops", points, Some(units));
            "contact", "contact", Plain => |(contact, _)| contact;
            "indentation", "indentation", (Length, Digits(5)) => |(_, [indentation, _])| indentation;
            "force", "force", (Force, Digits(5)) => |(_, [_, force])| force;
        }
    }

    /// The orbit on each sample.
    pub fn sample_table<'a>(&'a self, units: Units) -> Frame<'a> {
        let from_rest = |s: &'_ SampleMotion| match s.from_rest_period {
            Some(n) => format!("period {n}"),
            None => s.from_rest.name().to_owned(),
        };
        let seen = |s: &'a SampleMotion| Some(&s.orbit.as_ref()?.observables);
        // What is not above rounding is no force.
        let least = move |s| {
            let o = seen(s)?;
            let is_zero = o.least_force.abs() < ROUNDING * o.peak_force;
            Some(if is_zero { 0.0 } else { o.least_force })
        };
        let radius = |s: &'_ SampleMotion| Some(s.orbit.as_ref()?.spectral_radius);
        frame! { Rows::new("samples", &self.samples, Some(units));
            "contact", "sample", Plain => |s| &s.contact;
            "from_rest", "from rest", Plain => from_rest;
            "spectral_radius", "largest |μ|", Digits(5) => radius;
            "A", "amplitude", (Length, Quantity([5, 5])) => move |s| Some(seen(s)?.first_harmonic);
            "E_dis", "E_dis", (Energy, Quantity([5, 5])) => move |s| Some(seen(s)?.dissipation);
            "F_max", "F max", (Force, Quantity([5, 5])) => move |s| Some(seen(s)?.peak_force);
            "F_min", "F min", (Force, Quantity([5, 5])) => least;
            "indentation", "indentation", (Length, Quantity([5, 5])) =>
                move |s| Some(seen(s)?.indentation);
            "contact_fraction", "contact", Percent(5) => move |s| Some(seen(s)?.contact_fraction);
            .aligned(Point, Point);
        }
    }
}

/// Least force over the peak force below which it is rounding.
const ROUNDING: f64 = 1e-10;

/// The case with each law, spring and damper the same; see the module.
///
/// # Errors
/// When the arm's stiffness is not positive.
pub fn cases(case: &Cantilever, arm: Option<f64>) -> Result<Vec<Cantilever>, Error> {
    let own = case.arm();
    let arm = arm.or(own.map(|[stiffness, _]| stiffness));
    let arm = arm.unwrap_or(2.0 * case.alpha4);
    if !(arm > 0.0 && arm.is_finite()) {
        return Err(Error::input(
            format!(
                "a relaxing arm of stiffness {arm} holds no damper: a positive, finite one is needed"
            ),
            "give {arm} a stiffness above 0",
        ));
    }
    let damper = own.map_or(case.alpha6, |[_, damper]| damper);
    let on = |law: ContactLaw| {
        let numbers = match law.entry().like {
            Some(like) => like(arm, damper),
            // Numbers that do not follow from others, only a case that has them gives.
            None if law == case.contact => case.own_numbers(),
            None => return None,
        };
        let alpha6 = if law.has_damper() { damper } else { 0.0 };
        Some(
            case.clone()
                .on(law, &numbers)
                .with(Parameter::Alpha6, alpha6),
        )
    };
    Ok(ContactLaw::ALL.into_iter().filter_map(on).collect())
}

/// Compares the motions of `case` under each contact law: its nonlinear law and the others that its
/// quantities define, or else each piecewise-linear law. A law without an orbit of the period is
/// not an error.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::control::Control;
/// use nanotap::model::cantilever::Cantilever;
/// use nanotap::study::contact_laws::{ContactLawsOptions, compare};
///
/// let case = Case::from(Cantilever { alpha6: 2.0, omega: 20.0, ..Cantilever::paper() });
/// let found = compare(&case, &ContactLawsOptions::default(), &Control::default())?;
/// let looks = found.samples.iter().filter_map(|sample| sample.orbit.as_ref());
/// let dissipation: Vec<f64> = looks.map(|look| look.observables.dissipation).collect();
/// // Spring and damper dissipate twice as much as a Kelvin-Voigt surface (docs/cases/samples.md).
/// assert!((dissipation[0] - 18.13).abs() < 0.02 && (dissipation[1] - 9.248).abs() < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the case is not a cantilever, or the options are not valid for it.
pub fn compare(
    case: &Case,
    options: &ContactLawsOptions,
    control: &Control<'_>,
) -> Result<Comparison, Error> {
    let lever = cantilever(case, ContactLawsStudy::NAME)?;
    let frequencies = options.frequencies(case)?;
    if options.period == 0 {
        return Err(no_period());
    }
    let force = case.physical().and_then(|view| {
        let force = view.sample.force.as_ref()?;
        Some((force, &view.scales))
    });
    let levers = match force {
        Some((force, scales)) => force
            .others()
            .into_iter()
            .filter_map(|force| force.in_model(scales).ok())
            .map(|law| Cantilever {
                law: Some(law),
                ..lever.clone()
            })
            .collect(),
        None => cases(lever, options.arm)?,
    };
    // The beam's part of the setpoint's motion: other laws have other memories.
    let beam = 2 * lever.modes;
    let start = case.model()?.start;
    let start = start.map(|state| state[..beam].to_vec());
    let mut samples = levers
        .into_iter()
        .map(|lever| {
            motion(
                lever,
                options.period,
                start.as_deref(),
                frequencies,
                control,
            )
        })
        .collect::<Result<Vec<_>, Error>>()?;
    if force.is_some() {
        add_force_curves(&mut samples)?;
    }
    Ok(Comparison {
        omega: lever.omega,
        period: options.period,
        samples,
    })
}

/// Adds the force curves of nonlinear laws, over the gaps of all orbits.
fn add_force_curves(samples: &mut [SampleMotion]) -> Result<(), Error> {
    let least = samples
        .iter()
        .filter_map(|s| s.orbit.as_ref())
        .map(|orbit| orbit.observables.gap_range[0])
        .fold(f64::INFINITY, f64::min);
    for sample in samples {
        let model = Model::cantilever(&sample.case)?;
        let Some(nonlinear) = &model.nonlinear else {
            continue;
        };
        let surface = nonlinear.contact_gap().unwrap_or(0.0);
        let depth = (surface - least).max(surface.abs());
        let far = surface + CURVE_REACH * depth;
        let near = surface - depth;
        let step = (far - near) / f64::from(CURVE_POINTS);
        let down = (0..=CURVE_POINTS).map(|k| far - step * f64::from(k));
        let up = (0..=CURVE_POINTS).map(|k| near + step * f64::from(k));
        sample.force_curve = nonlinear.force_curve(down.chain(up));
    }
    Ok(())
}

/// Number of steps of a force curve in each direction.
const CURVE_POINTS: u32 = 400;
/// Outward reach of a force curve, in units of the greatest indentation.
const CURVE_REACH: f64 = 2.0;

fn motion(
    case: Cantilever,
    period: usize,
    start: Option<&[f64]>,
    frequencies: Option<(f64, f64)>,
    control: &Control<'_>,
) -> Result<SampleMotion, Error> {
    let model = Model::cantilever(&case)?;
    let model = model.cancelled_by(&control.flag());
    let rest = vec![0.0; model.dimension()];
    let mut map = ModelMap::new(&model);
    let named = NamedMotion::of(&classify(&mut map, &rest, &ClassifyOptions::default()).kind);
    let options = OrbitOptions {
        period: Some(period),
        harmonics: 0,
        ..OrbitOptions::default()
    };
    let near = start.map(|beam| {
        let mut state = model.rest();
        state[..beam.len()].copy_from_slice(beam);
        let near = OrbitOptions {
            state: Some(state.into()),
            ..options.clone()
        };
        orbit(&model, &near)
    });
    let found = near
        .and_then(Result::ok)
        .map_or_else(|| orbit(&model, &options), Ok);
    let (found, reason) = match found {
        Ok(found) => (Some(found), None),
        Err(error) => (None, Some(error.message())),
    };
    let branch = match (&found, frequencies) {
        (Some(found), Some(range)) => Some(followed(&case, &mut map, found, range, control)?),
        _ => None,
    };
    Ok(SampleMotion {
        contact: case
            .law
            .as_ref()
            .map_or_else(|| case.contact.to_string(), SampleLaw::name),
        force_curve: Vec::new(),
        case,
        from_rest: named.classification,
        from_rest_period: named.orbit.map(|o| o.period),
        orbit: found.map(|found| look(&model, found)),
        physical: None,
        reason,
        branch,
    })
}

/// The branch of an orbit in the drive frequency.
fn followed(
    case: &Cantilever,
    map: &mut ModelMap,
    found: &OrbitReport,
    (from, to): (f64, f64),
    control: &Control<'_>,
) -> Result<BranchReport, Error> {
    // Closed already: this only puts it in the form that branches begin with.
    let seed = close_orbit(map, &found.state, found.period, &ShootingOptions::default())?;
    let case = Case::from(case.clone()).cancelled_by(control);
    let range = Range {
        key: Key::Omega,
        from,
        to,
    };
    branches_through(
        &case,
        range,
        &[(case.omega(), seed)],
        &BranchOptions {
            max_step: ContinuationOptions::over(from, to).max_step,
            ..BranchOptions::default()
        },
        control,
    )
}

fn look(model: &Model, found: OrbitReport) -> OrbitLook {
    let height = found.trajectory.curve(&model.height);
    let force = found.trajectory.force(model);
    OrbitLook {
        period: found.period,
        spectral_radius: spectral_radius(&found.multipliers),
        stable: found.stable,
        force_loop: force_loop(&height, &force),
        state: found.state,
        observables: found.observables,
    }
}

/// Points on each piece of a loop.
const LOOP_POINTS: u32 = 160;

/// Indentation and force, piece by piece up to its very ends, where the force may jump.
fn force_loop(height: &Curve, force: &Curve) -> Vec<[f64; 2]> {
    let pieces = height.pieces();
    let points = pieces.iter().flat_map(|piece| {
        (0..=LOOP_POINTS).map(|k| {
            let s = piece.length * f64::from(k) / f64::from(LOOP_POINTS);
            [-height.on(piece, s), force.on(piece, s)]
        })
    });
    points.collect()
}

options! {
    /// Options of the comparison of contact laws.
    pub struct ContactLawsOptions {
        /// Period of the compared orbits
        #[schemars(range(min = 1, max = MAX_PERIOD), extend("x-value" = "N"))]
        pub period: usize = 1,
        /// Stiffness of the relaxing arm; default: that of the case, or twice alpha4
        #[schemars(extend("x-value" = "K"))]
        pub arm: Option<f64> = None,
        /// Lowest drive frequency to which the orbits are followed
        #[schemars(extend("x-value" = "OMEGA"))]
        pub from: Option<Amount> = None,
        /// Highest drive frequency to which the orbits are followed
        #[schemars(extend("x-value" = "OMEGA"))]
        pub to: Option<Amount> = None,
    }
}

impl ContactLawsOptions {
    /// Drive frequencies over which the orbits are followed, if they are.
    fn frequencies(&self, case: &Case) -> Result<Option<(f64, f64)>, Error> {
        match (&self.from, &self.to) {
            (Some(_), Some(_)) => {
                let end =
                    |option, amount: &Option<_>| implied(case, Key::Omega, option, amount.as_ref());
                Ok(end("from", &self.from)?.zip(end("to", &self.to)?))
            }
            (None, None) => Ok(None),
            _ => Err(Error::input(
                "one end of the drive frequencies is missing",
                "give {from} and {to}, or neither",
            )),
        }
    }
}

/// The same lever and drive under each contact law.
#[derive(Clone, Copy, Debug)]
pub struct ContactLawsStudy;

impl Study for ContactLawsStudy {
    const NAME: &'static str = "contact-laws";
    const ABOUT: &'static str = "Compare contact laws under the same lever and drive";
    type Options = ContactLawsOptions;
    type Report = Comparison;

    fn frames<'a>(case: &Case, report: &'a Comparison) -> Vec<Frame<'a>> {
        let units = case.units();
        vec![report.loop_table(units), report.sample_table(units)]
    }

    fn figure(case: &Case, report: &Comparison) -> Option<Figure> {
        Some(sample_figure(report, &case.units()))
    }

    fn compute(
        case: &Case,
        options: &ContactLawsOptions,
        control: &Control<'_>,
    ) -> Result<Comparison, Error> {
        let mut found = compare(case, options, control)?;
        for sample in &mut found.samples {
            let orbit = sample.orbit.as_ref().zip(case.physical());
            sample.physical =
                orbit.map(|(orbit, view)| PhysicalMotion::of(&orbit.observables, view));
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The loop's area is the energy that the sample takes, less what a surface loses while
    /// it recovers.
    #[test]
    fn loops_enclose_what_the_sample_takes_in_contact() {
        let case = Cantilever::paper().with(Parameter::Omega, 20.0);
        let options = ContactLawsOptions::default();
        let found = compare(&case.into(), &options, &Control::default()).unwrap();
        let mut loss = Vec::new();
        for sample in &found.samples {
            let orbit = sample.orbit.as_ref().unwrap();
            let area: f64 = orbit
                .force_loop
                .windows(2)
                .map(|w| 0.5 * (w[0][1] + w[1][1]) * (w[1][0] - w[0][0]))
                .sum();
            let taken = orbit.observables.dissipation;
            // Work on the surface is all that the sample gets, and an orbit stores none.
            assert!((area / taken - 1.0).abs() < 1e-3, "{area} {taken}");
            loss.push(taken);
        }
        let pulls = |k: usize| {
            found.samples[k]
                .orbit
                .as_ref()
                .unwrap()
                .observables
                .least_force
        };
        assert!(pulls(0) < -0.1 && pulls(1) > -1e-12 && pulls(2) > -1e-12);
        // What the paper's damper takes from a leaving tip it takes from no free surface.
        assert!(loss[0] > loss[1]);
    }

    #[test]
    fn samples_share_spring_and_damper() {
        let all = cases(&Cantilever::paper(), None).unwrap();
        let [arm, damper] = all[2].arm().unwrap();
        assert_eq!(arm, 40.0);
        assert!((damper - 0.2).abs() < 1e-15);
        // And from a solid back to the same three.
        assert_eq!(cases(&all[2], None).unwrap()[1].alpha6, all[1].alpha6);
        assert!(all.iter().all(|case| case.validate().is_ok()));
        for arm in [0.0, -1.0, f64::NAN] {
            assert!(cases(&Cantilever::paper(), Some(arm)).is_err());
        }
    }
}
