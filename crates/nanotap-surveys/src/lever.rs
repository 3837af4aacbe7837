//! Levers of the catalogue compared on the sample of a case, at its free amplitude and setpoint.
//!
//! Each lever replaces that of the case with its own stiffness, resonance and dimensions, and with
//! its own tip radius and height unless the tip of the case is kept. Data sheets state no quality
//! factor, since it depends on the medium: it follows from the dimensions of the lever in the fluid of
//! the case or in air by Sader's hydrodynamic function, or is that of the case where the case is
//! not one in air. The drive keeps its ratio to the free resonance, and the free amplitude stays.
//! The distance is solved for the setpoint as a feedback loop finds it
//! ([`setpoint`](nanotap_motions::setpoint)); the motion there is reported with the number of stable states
//! that were found.

use std::f64::consts::PI;
use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap_dynamics::Control;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use nanotap_case::{Case, Key};
use nanotap_error::Error;
use nanotap_motions::setpoint::solve_setpoint;
use nanotap_observe::frame::{Form, Frame, Rows, finite, frame};
use nanotap_observe::{Dimension, Observable, ObservableSet, Observables, PhysicalMotion};
use nanotap_quantity::number::significant;
use nanotap_study::Study;
use nanotap_study::request::options;
use nanotap_study::target::{Regime, Target, TargetMotion, TargetPoint, Targets};

options! {
    /// Options of the comparison of levers.
    pub struct LeverOptions {
        /// Compare only these levers of the catalogue; default: all
        #[schemars(extend("x-value" = "NAME,…"))]
        pub levers: Vec<String> = Vec::new(),
        /// Condition that every motion found at the setpoint must meet, as in "F_max < 1 nN",
        /// "regime = attractive", "states = 1"; several: all must hold
        #[serde(rename = "where")]
        #[schemars(extend("x-value" = "CONDITION"))]
        pub targets: Targets = Targets::default(),
        /// Keep radius and height of the tip of the case
        pub keep_tip: bool = false,
        /// Take the quality factors from: air and the dimensions of each lever (Sader 1998), or the case,
        /// the same for every lever; auto: from the fluid of the case, without one from air if the case
        /// has about the quality factor of its lever in air, otherwise from the case
        pub quality_factor: QualityFactor = QualityFactor::Auto,
    }
}

/// A lever on the sample, in SI.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct LeverRow {
    /// Name of the lever in the catalogue.
    pub lever: String,
    /// Spring constant, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub k: f64,
    /// Frequency of the free resonance, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub f0: f64,
    /// Quality factor of the free resonance, dimensionless.
    #[serde(rename = "Q")]
    pub quality_factor: f64,
    /// Quality factor in air at 20 °C by its dimensions (Sader 1998), if they are known.
    #[serde(rename = "Q_air", skip_serializing_if = "Option::is_none")]
    pub quality_factor_in_air: Option<f64>,
    /// Radius of the tip, m.
    #[schemars(extend("x-unit" = "m"))]
    pub tip_radius: Option<f64>,
    /// Time constant Q/(π f0) of the amplitude, s.
    #[schemars(extend("x-unit" = "s"))]
    pub time_constant: f64,
    /// The motion at the setpoint, if it is reached.
    #[serde(flatten)]
    pub motion: Option<LeverMotion>,
    /// Why the setpoint is not reached, or the lever cannot be computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Whether all conditions hold; absent without conditions, and where that is not known because
    /// states may be missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub holds: Option<bool>,
}

/// The motion of a lever at its setpoint.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct LeverMotion {
    /// Distance at which the setpoint is reached, m.
    #[schemars(extend("x-unit" = "m"))]
    pub distance: f64,
    /// Whether the mean force attracts or repels: `attractive` or `repulsive`.
    pub regime: &'static str,
    /// Number of stable states found at this distance.
    pub states: usize,
    /// Why further states may be missing, if the search for them ended at its budget.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget: Option<String>,
    /// Observables of the motion in SI.
    pub physical: PhysicalMotion,
}

/// Returns the time constant Q/(π f0) in s of the amplitude of a lever with a resonance at `f0` in Hz.
pub fn time_constant(quality_factor: f64, f0: f64) -> f64 {
    quality_factor / (PI * f0)
}

/// Pixels of the line of an image whose time is reported, there and back.
pub const LINE_PIXELS: usize = 512;

/// Returns the usual integral gain in 1/s of a feedback loop: half the rate at which the amplitude of a
/// lever with this time constant in s follows.
pub fn usual_gain(time_constant: f64) -> f64 {
    0.5 / time_constant
}

/// Shortest times in s in which a point of an image can be taken, by what limits them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointTimes {
    /// Time constant of the amplitude of the lever.
    pub lever: f64,
    /// Time in which the integral gain moves the tip by a step. Where the surface falls, the lever is
    /// free, so that the error is the free amplitude less that of the setpoint.
    pub gain: f64,
    /// Time of a step at the slew rate; 0 without a limit.
    pub slew: f64,
}

impl PointTimes {
    /// For steps of `step` in m, an integral gain in 1/s, an error of `error` in m and a slew rate in m/s,
    /// which may be infinite.
    pub fn new(time_constant: f64, step: f64, gain: f64, error: f64, slew_rate: f64) -> Self {
        Self {
            lever: time_constant,
            gain: step / (gain * error),
            slew: step / slew_rate,
        }
    }

    /// Returns the longest of the times, s, and the name of its limit: `lever`, `gain` or `slew`.
    pub fn longest(&self) -> (f64, &'static str) {
        let times = [(self.gain, "gain"), (self.slew, "slew")];
        times.into_iter().fold((self.lever, "lever"), |most, time| {
            if time.0 > most.0 { time } else { most }
        })
    }

    /// Returns the largest number of lines a second, there and back, Hz.
    pub fn line_rate(&self, pixels: usize) -> f64 {
        1.0 / (2.0 * pixels as f64 * self.longest().0)
    }
}

/// Which quality factors levers have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum QualityFactor {
    /// Those in the fluid of the case, in air, or that of the case.
    #[default]
    Auto,
    /// Those in air.
    Air,
    /// That of the case, or those in its fluid.
    Case,
}

/// Source of the quality factors of the compared levers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum QualityFactorSource {
    /// Quality factor of the case, the same for every lever.
    Case,
    /// The fluid of the case and the dimensions of each lever.
    Fluid,
    /// Air and the dimensions of each lever.
    Air,
}

impl QualityFactorSource {
    fn of(case: &Case, choice: QualityFactor) -> Self {
        let own = |case: &Case| case.physical().map(|view| view.lever.quality_factor);
        let in_air = || own(&case.in_fluid(AIR[0], AIR[1]).ok()?);
        match choice {
            QualityFactor::Air => Self::Air,
            _ if case.states_fluid() => Self::Fluid,
            QualityFactor::Case => Self::Case,
            QualityFactor::Auto => match own(case).zip(in_air()) {
                Some((own, air)) if own.max(air) <= NEAR * own.min(air) => Self::Air,
                _ => Self::Case,
            },
        }
    }
}

/// Factor within which the quality factor of a case is that of its lever in air: internal losses,
/// humidity and the sample's surface make the difference. In liquids it is far smaller.
const NEAR: f64 = 3.0;

/// Density in kg/m³ and viscosity in Pa s of dry air at 20 °C and 1013 hPa (CRC Handbook of
/// Chemistry and Physics: 1.204 kg/m³, 18.2 µPa s).
const AIR: [f64; 2] = [1.204, 18.2e-6];

/// Why a lever has no quality factor in air.
const NO_DIMENSIONS: &str =
    "the quality factor in air is not known without the dimensions of the lever";

/// Comparison of levers on the sample of a case, at its free amplitude and setpoint.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct LeverReport {
    /// Free amplitude of every lever, m.
    #[schemars(extend("x-unit" = "m"))]
    pub free_amplitude: f64,
    /// Drive frequency over the free resonance of each lever, dimensionless.
    pub frequency_ratio: f64,
    /// Source of the quality factors.
    pub quality_factor_source: QualityFactorSource,
    /// The conditions, which must all hold.
    #[serde(rename = "where", skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// The levers: those for which the conditions hold first, then those for which that is not known;
    /// in each group by peak force.
    pub levers: Vec<LeverRow>,
}

impl LeverReport {
    /// What is to be said of the table: where the quality factors come from, and why values are missing.
    /// `option` writes the name of an option as the reader types it.
    pub fn sentences(&self, option: impl Fn(&str) -> String) -> Vec<String> {
        let mut sentences = vec![
            "states: stable motions found on the way of a slowly moved lever to the setpoint; \
             `nanotap attractors` samples initial states and may find more"
                .to_owned(),
            self.on_quality_factors(option),
        ];
        // Levers with the same reason share a sentence.
        let mut reasons: Vec<(String, Vec<&str>)> = Vec::new();
        for row in &self.levers {
            let motion = row.motion.as_ref();
            let budget = motion.and_then(|motion| motion.budget.as_ref());
            let reason = match (&row.reason, budget) {
                (Some(reason), _) => reason.clone(),
                (None, Some(budget)) => format!("other states may be missing: {budget}"),
                (None, None) => continue,
            };
            match reasons.iter_mut().find(|(other, _)| *other == reason) {
                Some((_, levers)) => levers.push(&row.lever),
                None => reasons.push((reason, vec![&row.lever])),
            }
        }
        let reasons = reasons.into_iter();
        sentences
            .extend(reasons.map(|(reason, levers)| format!("{}: {reason}", levers.join(", "))));
        sentences
    }

    /// Where the quality factors come from.
    fn on_quality_factors(&self, option: impl Fn(&str) -> String) -> String {
        let source = match self.quality_factor_source {
            QualityFactorSource::Air => "of each lever in air, by its dimensions (Sader 1998)",
            QualityFactorSource::Fluid => {
                "of each lever in the fluid of the case, by its dimensions (Sader 1998)"
            }
            QualityFactorSource::Case => "that of the case for every lever",
        };
        let text = format!("Q: {source}; τ = Q/(π f0) is the time constant of the amplitude");
        let farthest = self
            .levers
            .iter()
            .filter_map(|row| {
                let air = row.quality_factor_in_air?;
                let ratio = (air / row.quality_factor).max(row.quality_factor / air);
                Some((row, air, ratio))
            })
            .max_by(|a, b| a.2.total_cmp(&b.2));
        match farthest.filter(|_| self.quality_factor_source == QualityFactorSource::Case) {
            None => text,
            Some((row, air, _)) => format!(
                "{text}. In air the dimensions of {} give Q = {}; {} air computes that of each lever",
                row.lever,
                significant(air, 3),
                option("quality_factor")
            ),
        }
    }

    /// The levers with their motions.
    pub fn lever_table<'a>(&'a self) -> Frame<'a> {
        let four = |kind| (Dimension::Si(kind), Form::Prefixed(4));
        let motion = |row: &'a LeverRow| Some(&row.motion.as_ref()?.physical.observables);
        let holds = |row: &'_ LeverRow| match row.holds {
            Some(true) => "yes",
            Some(false) => "no",
            None => "unknown",
        };
        let regime = |row: &'_ LeverRow| match &row.motion {
            Some(motion) => motion.regime,
            None if row.k.is_finite() => "not reached",
            None => "",
        };
        let unconditional: &[&str] = if self.conditions.is_empty() {
            &["holds"]
        } else {
            &[]
        };
        frame! { Rows::new("levers", &self.levers, None);
            "lever", "lever", Plain => |row| &row.lever;
            .label("Name in the catalogue");
            "holds", "fits", Plain => holds;
            .label("Whether all conditions hold");
            "k", "k", four(Kind::Stiffness) => |row| finite(row.k);
            .label("Spring constant");
            "f0", "f0", four(Kind::Frequency) => |row| finite(row.f0);
            .label("Free resonance");
            "Q", "Q", four(Kind::Number) => |row| finite(row.quality_factor);
            .label("Quality factor");
            "tip_radius", "radius", four(Kind::Length) => |row| row.tip_radius.and_then(finite);
            .label("Radius of the tip");
            "F_max", "F_max", four(Kind::Force) => move |row| finite(motion(row)?.peak_force);
            .label("Peak force at the setpoint");
            "indentation", "indentation", four(Kind::Length) =>
                move |row| finite(motion(row)?.indentation);
            "regime", "regime", Plain => regime;
            .label("Whether the mean force attracts or repels");
            "states", "states", Plain => |row| Some(row.motion.as_ref()?.states);
            .label("Stable motions found at this distance");
            "A", "A", four(Kind::Length) => move |row| finite(motion(row)?.first_harmonic);
            "phase", "phase", (Angle, Digits(4)) => move |row| Some(motion(row)?.phase);
            "time_constant", "τ", four(Kind::Time) => |row| finite(row.time_constant);
            "line_time", "line time", four(Kind::Time) =>
                |row| finite(row.time_constant * LINE_PIXELS as f64); .only_in_files();
            .label("512 pixels there and back, with one time constant Q/(π f0) of the amplitude each");
            .without(unconditional);
            .aligned(Point, Point);
        }
    }
}

/// Compares levers of the catalogue.
#[derive(Clone, Copy, Debug)]
pub struct LeverStudy;

impl Study for LeverStudy {
    const NAME: &'static str = "lever";
    const ABOUT: &'static str = "Compare levers of the catalogue on the sample of a case";
    const COUNTED: &'static str = "levers";
    const ANY_DISTANCE: bool = true;
    type Options = LeverOptions;
    type Report = LeverReport;
    const HAS_FIGURE: bool = false;

    fn frames<'a>(_: &Case, report: &'a LeverReport) -> Vec<Frame<'a>> {
        vec![report.lever_table()]
    }

    fn compute(
        case: &Case,
        options: &LeverOptions,
        control: &Control<'_>,
    ) -> Result<LeverReport, Error> {
        compare_levers(case, options, control)
    }
}

/// Compares levers on the sample of `case` at its free amplitude and setpoint.
///
/// # Errors
/// When the case has no setpoint, a lever is unknown, a condition is not valid, or the work was
/// cancelled.
pub fn compare_levers(
    case: &Case,
    options: &LeverOptions,
    control: &Control<'_>,
) -> Result<LeverReport, Error> {
    let targets = options.targets.parse(true)?;
    let LeverCases {
        free_amplitude,
        frequency_ratio,
        source,
        cases,
    } = LeverCases::of(case, options)?;
    let quiet = Control {
        progress: None,
        ..*control
    };
    let (done, total) = (AtomicUsize::new(0), cases.len());
    let mut levers: Vec<LeverRow> = cases
        .into_par_iter()
        .with_max_len(1)
        .map(|(lever, case)| {
            let in_air = in_air(&case);
            let known = in_air.as_ref().ok().and_then(Case::physical);
            let quality_factor_in_air = known.map(|view| view.lever.quality_factor);
            let row = LeverRow {
                quality_factor_in_air,
                ..match if source == QualityFactorSource::Air {
                    in_air
                } else {
                    case
                } {
                    Ok(case) => row(lever, &case, &targets, &quiet),
                    Err(reason) => LeverRow {
                        holds: (!targets.is_empty()).then_some(false),
                        reason: Some(reason),
                        ..LeverRow::unknown(lever)
                    },
                }
            };
            if let Some(progress) = control.progress {
                progress(done.fetch_add(1, Ordering::Relaxed) + 1, total);
            }
            row
        })
        .collect();
    if control.is_cancelled() {
        return Err(Error::stopped());
    }
    let force = |row: &LeverRow| {
        let force = row.motion.as_ref();
        force.map_or(f64::INFINITY, |m| m.physical.observables.peak_force)
    };
    let rank = |row: &LeverRow| match row.holds {
        Some(true) => 0,
        None => 1,
        Some(false) => 2,
    };
    levers.sort_by(|a, b| {
        let order = rank(a).cmp(&rank(b));
        order.then(force(a).total_cmp(&force(b)))
    });
    Ok(LeverReport {
        free_amplitude,
        frequency_ratio,
        quality_factor_source: source,
        conditions: targets.iter().map(Target::to_string).collect(),
        levers,
    })
}

/// Returns the case with its lever replaced by one of the catalogue, as it is compared.
///
/// # Errors
/// As [`compare_levers`], and when the lever cannot be computed.
pub fn case_with_lever(case: &Case, lever: &str, options: &LeverOptions) -> Result<Case, Error> {
    let only = LeverOptions {
        levers: vec![lever.to_owned()],
        ..options.clone()
    };
    let found = LeverCases::of(case, &only)?;
    let own = found.cases.into_iter().next().map(|(_, own)| own);
    let own = own.unwrap_or_else(|| Err(format!("no lever called `{lever}`")));
    let own = match found.source {
        QualityFactorSource::Air => in_air(&own),
        _ => own,
    };
    own.map_err(|reason| Error::option("levers", reason, "choose another lever"))
}

/// The cases of the levers to compare.
struct LeverCases {
    /// Free amplitude of every lever, m.
    free_amplitude: f64,
    frequency_ratio: f64,
    source: QualityFactorSource,
    cases: Vec<(String, Result<Case, String>)>,
}

impl LeverCases {
    fn of(case: &Case, options: &LeverOptions) -> Result<Self, Error> {
        let view = case.physical().filter(|view| view.held.is_some());
        let Some(view) = view else {
            return Err(Error::input(
                "levers are compared at a setpoint, and the case has none",
                "give drive.setpoint, as in setpoint = 0.8, in physical quantities",
            ));
        };
        if !view.cantilever.further_tones.is_empty() {
            return Err(Error::input(
                "levers are compared under one tone, and the case has a second one",
                "leave drive.second_frequency and drive.second_ratio out",
            ));
        }
        let frequency_ratio = view.scales.frequency * view.cantilever.omega / view.lever.f0;
        let cases = case.with_catalogue_levers(&options.levers, frequency_ratio, options.keep_tip);
        let cases = cases.map_err(|error| {
            Error::option("levers", error.to_string(), "name levers of the catalogue")
        })?;
        Ok(Self {
            free_amplitude: view.free_amplitude,
            frequency_ratio,
            source: QualityFactorSource::of(case, options.quality_factor),
            cases,
        })
    }
}

/// The case of a lever in air.
fn in_air(case: &Result<Case, String>) -> Result<Case, String> {
    let in_air = case.clone()?.in_fluid(AIR[0], AIR[1]);
    in_air.map_err(|_| NO_DIMENSIONS.to_owned())
}

impl LeverRow {
    fn unknown(lever: String) -> Self {
        Self {
            lever,
            k: f64::NAN,
            f0: f64::NAN,
            quality_factor: f64::NAN,
            quality_factor_in_air: None,
            tip_radius: None,
            time_constant: f64::NAN,
            motion: None,
            reason: None,
            holds: None,
        }
    }
}

/// Whether all conditions hold. The number of states is not known where the search for them ended
/// early.
fn holds(point: &TargetPoint, targets: &[Target], motion: Option<&LeverMotion>) -> Option<bool> {
    let is_cut = motion.is_some_and(|motion| motion.budget.is_some());
    let (counts, others): (Vec<Target>, Vec<Target>) =
        targets.iter().cloned().partition(Target::counts_states);
    if targets.is_empty() || (is_cut && !counts.is_empty() && point.meets(&others)) {
        return None;
    }
    Some(point.meets(targets))
}

fn row(lever: String, case: &Case, targets: &[Target], control: &Control<'_>) -> LeverRow {
    let Some(view) = case.physical() else {
        return LeverRow::unknown(lever);
    };
    let (k, f0, quality_factor) = (view.lever.k, view.lever.f0, view.lever.quality_factor);
    let solved = solve_setpoint(case, control);
    let mut point = TargetPoint::default();
    let mut take = |observables: &Observables, period: usize| {
        let seen = observables.in_si(&view.scales);
        let number = |o: &Observable| (o.of)(&seen).number().unwrap_or(f64::NAN);
        point.motions.push(TargetMotion {
            period,
            values: ObservableSet::COMMON.iter().map(number).collect(),
        });
    };
    let (motion, reason) = match solved {
        Ok(solved) => {
            let chosen = solved.solutions.get(solved.chosen);
            let motion = chosen.map(|chosen| {
                take(&chosen.observables, chosen.period);
                for other in &solved.other_states {
                    take(&other.observables, other.period);
                }
                LeverMotion {
                    distance: chosen.zc,
                    regime: Regime::of(chosen.observables.mean_force).name(),
                    states: 1 + solved.other_states.len(),
                    budget: solved.budget.clone(),
                    physical: chosen.physical.clone(),
                }
            });
            (motion, None)
        }
        Err(error) => (None, Some(error.message())),
    };
    LeverRow {
        k,
        f0,
        quality_factor,
        quality_factor_in_air: None,
        tip_radius: Some(case.get(Key::TipRadius)).filter(|radius| radius.is_finite()),
        time_constant: time_constant(quality_factor, f0),
        holds: holds(&point, targets, motion.as_ref()),
        motion,
        reason,
        lever,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slowest_part_limits_the_lines() {
        let lever = time_constant(200.0, 100e3);
        let times = |step| PointTimes::new(lever, step, usual_gain(lever), 4e-9, f64::INFINITY);
        // A step of 2 nm takes the integral gain 2 nm / 4 nm of twice the time constant.
        assert!((times(2e-9).gain / lever - 1.0).abs() < 1e-12);
        assert_eq!(times(1e-9).longest(), (lever, "lever"));
        assert_eq!(times(10e-9).longest().1, "gain");
        assert!((times(1e-9).line_rate(256) - 3.068).abs() < 1e-3);
        let slow = PointTimes::new(lever, 10e-9, usual_gain(lever), 4e-9, 1e-6);
        assert_eq!(slow.longest(), (1e-2, "slew"));
    }
}
