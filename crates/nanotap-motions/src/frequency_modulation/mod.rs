//! Frequency modulation: a loop holds amplitude and phase of the tip's oscillation, by the
//! frequency and the strength of the drive.
//!
//! What the instrument settles on is a periodic orbit whose frequency and drive strength are
//! unknowns in addition to its state: [`HeldOrbit`]. How far the frequency is from that of the free lever
//! at the same amplitude and phase ([`FreeOscillation`]) is the frequency shift; how much stronger
//! the drive is than there, the excitation, tells what the sample takes.
//!
//! [`Averages`] are the usual approximations of the shift, and
//! [`sader_jarvis`](average::sader_jarvis) gives the force back from a curve of shifts.

pub mod average;
mod curve;
pub mod free;
pub mod held;
pub mod walk;

pub use average::Averages;
pub use curve::frequency_modulation;
pub use free::FreeOscillation;
pub use held::{Driven, Held, HeldOrbit};

use nanotap_case::physical::Remark;
use nanotap_dynamics::Control;
use nanotap_figures::Figure;
use schemars::JsonSchema;
use serde::Serialize;

use crate::approach::{ApproachPoint, ApproachReport, Way};
use crate::figure::approach::approach_figure;
use nanotap_case::Case;
use nanotap_case::physical::Physical;
use nanotap_case::physical::quantity::JOULES_PER_ELECTRONVOLT;
use nanotap_error::Error;
use nanotap_model::parameter::Parameter;
use nanotap_observe::frame::Frame;
use nanotap_observe::frame::rows;
use nanotap_study::Study;
use nanotap_study::limits::MAX_DISTANCES;
use nanotap_study::request::options;
use nanotap_study::value::Amount;

rows! {
    in model_unit
    /// Readings of frequency modulation at one distance, in model units.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
    pub struct Modulated {
        /// Angular frequency of the drive, model units.
        #[schemars(extend("x-unit" = nanotap_observe::Dimension::Frequency.model_unit()))]
        pub drive_frequency: f64,
        /// Strength of the drive, model units: its force, or a driven base's amplitude.
        pub drive_strength: f64,
        /// Shift 2πΔf of the angular frequency from that of the free lever, model units.
        pub frequency_shift: f64 = Frequency, "frequency shift $Δf$", "Δf", Quantity([5, 4]),
        /// Frequency shift Δf over the free lever's frequency f₀, dimensionless.
        pub relative_shift: f64 = Number, "relative shift $Δf/f_0$", "Δf/f0", Digits(5),
        /// Strength of the drive over that of the free lever, dimensionless: the excitation channel.
        pub drive_ratio: f64 = Number, "drive / free drive", "drive/free", Digits(5),
        /// Energy that the sample takes in a period, from the excitation: E₀ (drive ratio − f/f₀) with
        /// the loss E₀ of the free lever in a period, model units.
        pub drive_dissipation: f64 = Energy, "dissipation from the drive", "E_drive", Quantity([4, 4]),
        /// Least distance of a sinusoidal oscillation, a driven base's motion included, model units.
        #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
        pub closest: f64,
        /// Relative shift Δf/f₀ to first order in the law's static force, dimensionless; None for a
        /// rigid stop and a surface that moves, which have no static force.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub first_order_shift: Option<f64> = Number, "$Δf/f_0$ to first order", "first order", Digits(5),
        /// Relative shift Δf/f₀ by Giessibl's formula for an amplitude that is large against the
        /// force's range, dimensionless.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub giessibl_shift: Option<f64> = Number, "$Δf/f_0$ for a large amplitude",
        /// Static force of the law where the oscillation is closest, model units; positive if it
        /// repels.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub static_force: Option<f64> = Force, "force", "force", Quantity([5, 4]),
        /// Force where the oscillation is closest, by the formula of Sader and Jarvis from the shifts
        /// of the curve, model units; positive if it repels.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub sader_jarvis_force: Option<f64> = Force, "force (Sader–Jarvis)", "force", Quantity([5, 4]),
    }
}

impl Modulated {
    /// Computes the readings of an orbit with the tip at rest at `gap`, model units.
    pub fn of(
        orbit: &HeldOrbit,
        free: &FreeOscillation,
        averages: Option<&Averages>,
        gap: f64,
    ) -> Self {
        let known = averages.map(|averages| averages.at(gap));
        let own = [free.frequency, free.strength, free.loss];
        Self {
            closest: gap - free.reach,
            first_order_shift: known.map(|k| k.first_order),
            giessibl_shift: known.map(|k| k.giessibl),
            static_force: known.map(|k| k.force),
            ..Self::of_drive([orbit.frequency, orbit.strength], own)
        }
    }

    /// Computes the readings of a drive's frequency and strength, compared with those of the free
    /// lever and its loss.
    pub fn of_drive(
        [frequency, strength]: [f64; 2],
        [free_frequency, free_strength, free_loss]: [f64; 3],
    ) -> Self {
        let relative = (frequency - free_frequency) / free_frequency;
        let ratio = strength / free_strength;
        Self {
            drive_frequency: frequency,
            drive_strength: strength,
            frequency_shift: frequency - free_frequency,
            relative_shift: relative,
            drive_ratio: ratio,
            drive_dissipation: free_loss * (ratio - 1.0 - relative),
            closest: f64::NAN,
            first_order_shift: None,
            giessibl_shift: None,
            static_force: None,
            sader_jarvis_force: None,
        }
    }
}

rows! {
    in si_unit
    /// Readings of frequency modulation at one distance, in SI.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
    pub struct ModulatedInSi {
        /// Frequency of the drive, Hz.
        pub frequency: f64 = Frequency, "drive frequency",
        /// Strength of the drive: its force, N, or a driven base's amplitude, m.
        pub drive_strength: f64,
        /// Frequency shift Δf from the free lever, Hz.
        pub frequency_shift: f64 = Frequency, "frequency shift $Δf$",
        /// Energy dissipated in the sample per period, from the excitation, J.
        pub drive_dissipation: f64 = Energy, "dissipation from the drive",
        /// Energy dissipated in the sample per period, from the excitation, eV.
        #[serde(rename = "drive_dissipation_eV")]
        #[schemars(extend("x-unit" = "eV"))]
        pub drive_dissipation_ev: f64,
        /// Least distance of a sinusoidal oscillation, m.
        pub closest: f64 = Length, "least distance",
        /// Static force of the law where the oscillation is closest, N; positive if it repels.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub static_force: Option<f64> = Force, "force",
        /// Force where the oscillation is closest, by the formula of Sader and Jarvis, N; positive if
        /// it repels.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub sader_jarvis_force: Option<f64> = Force, "force (Sader–Jarvis)",
    }
}

impl Modulated {
    /// Converts the readings to SI.
    pub fn in_si(&self, view: &Physical) -> ModulatedInSi {
        let scales = &view.scales;
        let strength = scales.of(Parameter::Alpha2, view.cantilever.actuation);
        let energy = self.drive_dissipation * scales.energy;
        ModulatedInSi {
            frequency: self.drive_frequency * scales.frequency,
            drive_strength: self.drive_strength * strength,
            frequency_shift: self.frequency_shift * scales.frequency,
            drive_dissipation: energy,
            drive_dissipation_ev: energy / JOULES_PER_ELECTRONVOLT,
            closest: self.closest * scales.length,
            static_force: self.static_force.map(|force| force * scales.force),
            sader_jarvis_force: self.sader_jarvis_force.map(|force| force * scales.force),
        }
    }
}

/// Frequency modulation along a curve.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ModulationReport {
    /// Amplitude of the tip's deflection that the loop keeps, model units.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Length.model_unit()))]
    pub amplitude: f64,
    /// Phase lag kept by the feedback, degrees.
    #[schemars(extend("x-unit" = "degree"))]
    pub phase: f64,
    /// Angular frequency of the free lever at this phase, model units.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Frequency.model_unit()))]
    pub free_frequency: f64,
    /// Frequency of the free lever at this phase, Hz; only of a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "Hz"))]
    pub free_frequency_hz: Option<f64>,
    /// Strength of the drive of the free lever, model units.
    pub free_strength: f64,
    /// Stiffness by which the frequency responds to the sample, model units: of the mode at the
    /// tip, if the base is at rest.
    pub stiffness: f64,
    /// Energy that the free lever loses in a period at this amplitude, model units.
    pub free_loss: f64,
    /// Least distance that is kept, model units: the amplitude changes with the distance, and
    /// amplitude, strength and loss here are those of the first distance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closest: Option<f64>,
    /// Sentence that explains the multipliers: they are those at constant frequency and strength.
    pub multipliers: &'static str,
    /// Distances at which the frequency shift has the requested value, in each direction in the
    /// order of the curve, with the motion there: the first is where a loop that keeps the shift
    /// stops.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub setpoints: Option<Vec<ApproachPoint>>,
    /// Ranges of distances over which the motion changed by a jump.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub jumps: Vec<Jump>,
    /// Early ends of a direction, with the reason.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub ended: Vec<Ended>,
}

/// Explanation of the multipliers under frequency modulation, for reports.
pub const OPEN_LOOP: &str = "multipliers are those of the orbit at constant frequency and \
                             strength of the drive; under the loop stability is the loop's matter";

/// A range of distances over which no orbit with the amplitude and phase could be followed, with an
/// orbit at its end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Jump {
    /// Direction in which the distance changes.
    pub way: Way,
    /// Last distance with an orbit before the range, model units.
    pub from: f64,
    /// First distance with an orbit after the range, model units.
    pub to: f64,
}

/// An early end of a curve.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Ended {
    /// Direction that ended early.
    pub way: Way,
    /// Last distance with an orbit, model units.
    pub gap: f64,
    /// Reason of the end, as a sentence.
    pub reason: String,
}

options! {
    /// Options of a curve under frequency modulation.
    pub struct FrequencyModulationOptions {
        /// First distance, in units of the case ("30 nm") or as alpha5; default: 1.25 times the
        /// free amplitude towards the sample
        #[schemars(extend("x-value" = "DISTANCE"))]
        pub from: Option<Amount> = None,
        /// Last distance of the approach; default: 0
        #[schemars(extend("x-value" = "DISTANCE"))]
        pub to: Option<Amount> = None,
        /// Number of distances in each direction
        #[schemars(range(min = 2, max = MAX_DISTANCES), extend("x-value" = "P"))]
        pub points: usize = 80,
        /// Phase lag to keep, in degrees
        #[schemars(range(min = -180, max = 180), extend("x-value" = "DEGREES"))]
        pub phase: f64 = 90.0,
        /// Frequency shift whose distances to find, in units of the case ("-50 Hz") or as omega
        #[schemars(extend("x-value" = "SHIFT"))]
        pub shift: Option<Amount> = None,
        /// Least distance of the oscillation to keep, in units of the case ("1 nm") or as alpha5: the
        /// amplitude then changes with the distance
        #[schemars(extend("x-value" = "DISTANCE"))]
        pub closest: Option<Amount> = None,
    }
}

/// Study of approach and retract curves under frequency modulation.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::case::physical::Catalogue;
/// use nanotap::control::Control;
/// use nanotap::study::Study as _;
/// use nanotap::study::frequency_modulation::{FrequencyModulationOptions, FrequencyModulationStudy};
/// use std::path::Path;
///
/// let file = Path::new("../../docs/cases/fm-lever.toml");
/// let case = Case::load(Some(file), &[], &Catalogue::shared())?;
/// let options = FrequencyModulationOptions {
///     from: Some("14 nm".into()),
///     to: Some("11 nm".into()),
///     points: 4,
///     ..FrequencyModulationOptions::default()
/// };
/// let curve = FrequencyModulationStudy::run(&case, &options, &Control::default())?;
/// let nearest = curve.table.iter().filter_map(|point| point.modulation_si.as_ref()).nth(3);
/// // 1 nm from the surface (docs/cases/frequency-modulation.md).
/// assert!(nearest.is_some_and(|row| (row.frequency_shift + 8.664588).abs() < 1e-5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FrequencyModulationStudy;

impl Study for FrequencyModulationStudy {
    const NAME: &'static str = "fm";
    const ABOUT: &'static str = "Frequency shift and excitation against the distance to the sample, \
                                 with amplitude and phase held";
    const COUNTED: &'static str = "distances";
    const ANY_DISTANCE: bool = true;
    const PARTIAL: bool = true;
    type Options = FrequencyModulationOptions;
    type Report = ApproachReport;

    fn frames<'a>(case: &Case, report: &'a ApproachReport) -> Vec<Frame<'a>> {
        report.tables(case.units())
    }

    fn figure(case: &Case, report: &ApproachReport) -> Option<Figure> {
        Some(approach_figure(report, &case.units()))
    }

    fn remarks(_: &Case, report: &ApproachReport) -> Vec<Remark> {
        report.remarks()
    }

    fn compute(
        case: &Case,
        options: &FrequencyModulationOptions,
        control: &Control<'_>,
    ) -> Result<ApproachReport, Error> {
        frequency_modulation(case, options, control)
    }
}
