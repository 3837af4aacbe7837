//! Bimodal operation: two tones, each with its own loop, against the distance.
//!
//! Amplitude modulation leaves a tone's drive as it is; frequency modulation holds phase and amplitude
//! by its frequency and strength; there are loops of one of them alone. The two frequencies have no
//! common period, so that the motion is not an orbit but a torus (`torus.rs`), which the exact map of
//! a period and Newton close; the loops are further equations (`loops.rs`). From far on, where the
//! lever is free, the motion is followed towards the sample.
//!
//! The report also has the numbers that the usual formulas give from what an instrument reads
//! (`formulas.rs`), so that one sees where they hold.

mod follow;
mod formulas;
mod loops;
mod torus;

use nanotap_figures::Figure;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use formulas::{Estimates, ToneEstimates};

use crate::figure::bimodal::bimodal_figure;
use nanotap_case::Case;
use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_observe::frame::{Frame, Rows, frame, rows};
use nanotap_study::Study;
use nanotap_study::cantilever;
use nanotap_study::limits::MAX_DISTANCES;
use nanotap_study::request::options;
use nanotap_study::value::Amount;

/// What the loop of a tone holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Loop {
    /// Nothing: frequency and strength of the drive are constant (amplitude modulation)
    #[default]
    Am,
    /// Phase and amplitude, by frequency and strength (frequency modulation)
    Fm,
    /// The phase alone, by the frequency (phase-locked loop at a constant strength)
    Pll,
    /// The amplitude alone, by the strength (gain control at a constant frequency)
    Agc,
}

impl Loop {
    /// Whether it holds the phase.
    pub const fn holds_phase(self) -> bool {
        matches!(self, Self::Fm | Self::Pll)
    }

    /// Whether it holds the amplitude.
    pub const fn holds_amplitude(self) -> bool {
        matches!(self, Self::Fm | Self::Agc)
    }

    /// Returns the abbreviation of the loop for tables and figures, as in `AM`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Am => "AM",
            Self::Fm => "FM",
            Self::Pll => "PLL",
            Self::Agc => "AGC",
        }
    }
}

options! {
    /// Options of bimodal operation.
    pub struct BimodalOptions {
        /// Loop of the first tone; default: am
        pub first: Option<Loop> = None,
        /// Loop of the second tone; default: fm
        pub second: Option<Loop> = None,
        /// Phase lag of the first tone to hold, in degrees
        #[schemars(range(min = -180, max = 180), extend("x-value" = "DEGREES"))]
        pub phase: f64 = 90.0,
        /// Phase lag of the second tone to hold, in degrees
        #[schemars(range(min = -180, max = 180), extend("x-value" = "DEGREES"))]
        pub second_phase: f64 = 90.0,
        /// First distance, as in "30 nm"; default: where the lever is free
        #[schemars(extend("x-value" = "DISTANCE"))]
        pub from: Option<Amount> = None,
        /// Last distance; default: that of the case, or where its setpoint is reached
        #[schemars(extend("x-value" = "DISTANCE"))]
        pub to: Option<Amount> = None,
        /// Number of distances
        #[schemars(range(min = 2, max = MAX_DISTANCES), extend("x-value" = "P"))]
        pub points: usize = 30,
    }
}

rows! {
    in si_unit
    /// The free lever at a tone. All quantities are in SI.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
    pub struct FreeTone {
        /// Amplitude of the tip deflection in m.
        #[serde(rename = "A")]
        pub amplitude: f64 = Length, "amplitude $A$", "A", Prefixed(4),
        /// Phase lag behind the drive in degrees.
        pub phase: f64 = Angle, "phase lag", "lag (°)", Decimals(2),
        /// Frequency of the drive, Hz.
        pub frequency: f64 = Frequency, "frequency", "frequency", Prefixed(7),
        /// Strength of the drive: its force in N, or a driven base's amplitude in m.
        pub drive_strength: f64,
        /// Stiffness of the mode at the tip in N/m.
        pub stiffness: f64 = Si(Kind::Stiffness), "stiffness of the mode", "stiffness", Prefixed(4),
        /// Frequency at which the free lever lags by the phase of the loop, by default 90°, in Hz.
        #[schemars(extend("x-unit" = "Hz"))]
        pub resonance: f64,
    }
}

rows! {
    in si_unit
    /// Readings of one tone. All quantities are in SI.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
    pub struct ToneReading {
        /// Amplitude of the tip deflection in m.
        #[serde(rename = "A")]
        pub amplitude: f64 = Length, "amplitude $A$", "A", Prefixed(4),
        /// Phase lag behind the drive in degrees.
        pub phase: f64 = Angle, "phase lag", "lag (°)", Decimals(2),
        /// Frequency of the drive, Hz.
        #[schemars(extend("x-unit" = "Hz"))]
        pub frequency: f64,
        /// Frequency less that of the free lever in Hz.
        pub frequency_shift: f64 = Frequency, "frequency shift $Δf$", "Δf", Prefixed(4),
        /// Strength of the drive: its force in N, or a driven base's amplitude in m.
        pub drive_strength: f64,
        /// Strength of the drive over that of the free lever, dimensionless.
        pub drive_ratio: f64 = Number, "drive / free drive", "drive", Digits(4),
        /// Mean of the force times the tone's part of the deflection, in J.
        pub virial: f64 = Energy, "virial",
        /// Energy that the force takes from the tone's part of the motion in a period of the tone, in J.
        #[serde(rename = "E_dis")]
        pub dissipation: f64 = Energy, "dissipation $E_{dis}$",
        /// Virial and dissipation that the usual formulas give for this tone.
        pub estimates: ToneEstimates,
    }
}

rows! {
    in si_unit
    /// The motion at one distance. All quantities are in SI.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
    pub struct BimodalPoint {
        /// Distance of the tip at rest from the sample in m.
        #[schemars(extend("x-unit" = "m"))]
        pub zc: f64,
        /// The readings of both tones.
        pub tones: [ToneReading; 2],
        /// Time mean of the force on the tip in N.
        #[schemars(extend("x-unit" = "N"))]
        pub mean_force: f64,
        /// Largest force with which the sample pushes the tip in N; 0 where it only pulls.
        #[serde(rename = "F_max")]
        pub peak_force: f64 = Force, "peak force $F_{max}$", "F_max", Prefixed(4),
        /// Lowest force on the tip in N.
        #[serde(rename = "F_min")]
        #[schemars(extend("x-unit" = "N"))]
        pub least_force: f64,
        /// Least height of the tip over the undeformed surface in m.
        #[schemars(extend("x-unit" = "m"))]
        pub closest: f64,
        /// Factor by which a small disturbance grows in a period of the first tone at constant drives.
        pub growth: f64 = Number, "growth of a small disturbance",
        /// Largest of the last two harmonics of the second tone's phase, relative to the motion: an
        /// estimate of the truncation error.
        pub error: f64 = Number, "truncation error",
        /// Sample properties that the usual formulas give at this distance.
        pub estimates: Estimates,
    }
}

/// A jump from one motion to another. All quantities are in SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct BimodalJump {
    /// Last distance of the motion before the jump, m.
    #[schemars(extend("x-unit" = "m"))]
    pub from: f64,
    /// First distance of the motion after the jump, m.
    #[schemars(extend("x-unit" = "m"))]
    pub to: f64,
}

/// Bimodal operation against the distance.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct BimodalReport {
    /// The loops of both tones.
    pub loops: [Loop; 2],
    /// Amplitude, phase and drive of the free lever at both tones.
    pub free: [FreeTone; 2],
    /// Amplitude of the first tone at which the approach ends, in m, if the case has a setpoint.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m"))]
    pub setpoint: Option<f64>,
    /// Reduced modulus E* of tip and sample of the case in Pa, if its law has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "Pa"))]
    pub reduced_modulus: Option<f64>,
    /// Storage and loss modulus, in Pa, of a sample that relaxes, at the free frequency of each tone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dynamic_moduli: Option<[[f64; 2]; 2]>,
    /// The motion at each distance, from far on; with a setpoint, the last is where it is reached.
    pub table: Vec<BimodalPoint>,
    /// Jumps to another motion, at distances where the previous one does not continue.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub jumps: Vec<BimodalJump>,
    /// Why the approach ended before its last distance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ended: Option<String>,
    /// Sentence that explains [`BimodalPoint::growth`]: below 1 the motion is stable without loops.
    pub stability: &'static str,
}

impl BimodalReport {
    /// The free lever at both tones.
    pub fn free_table(&self) -> Frame<'_> {
        let tones = ["first tone", "second tone"].into_iter().zip(&self.free);
        frame! { Rows::new("free", tones, None);
            "tone", "free lever", Plain => |(name, _)| name;
            .fields(|(_, tone)| Some(tone));
            .aligned(Left, Point);
        }
    }

    /// What the usual formulas give at the last distance, and what is exact; `None` without a motion.
    pub fn formula_table(&self) -> Option<Frame<'_>> {
        let last = self.table.last()?;
        let (tones, estimates) = (&last.tones, &last.estimates);
        let moduli = move |k: usize| self.dynamic_moduli.map(|moduli| moduli[k]);
        let tangent = move || moduli(0).map(|[storage, loss]| loss / storage);
        let relaxes = self.dynamic_moduli.is_some();
        let modulus = if relaxes {
            "reduced modulus E*, relaxed"
        } else {
            "reduced modulus E*"
        };
        let unknown = [
            ("reduced_modulus", estimates.reduced_modulus.is_none()),
            ("indentation", estimates.indentation.is_none()),
            ("loss_tangent", estimates.loss_tangent.is_none()),
            ("storage_modulus_2", !relaxes),
            ("loss_modulus_2", !relaxes),
        ];
        let unknown: Vec<&str> = (unknown.into_iter())
            .filter_map(|(name, is_unknown)| is_unknown.then_some(name))
            .collect();
        let exact = |exact: bool, value, estimate| if exact { value } else { estimate };
        Some(frame! { Rows::new("formulas", [true, false], None);
            "source", "", Plain => |of| if of { "exact" } else { "by formula" };
            "virial_1", "virial, first tone", (Energy, Prefixed(4)) =>
                move |of| exact(of, tones[0].virial, tones[0].estimates.virial);
            "E_dis_1", "energy lost a period, first tone", (Energy, Prefixed(4)) =>
                move |of| exact(of, tones[0].dissipation, tones[0].estimates.dissipation);
            "virial_2", "virial, second tone", (Energy, Prefixed(4)) =>
                move |of| exact(of, tones[1].virial, tones[1].estimates.virial);
            "E_dis_2", "energy lost a period, second tone", (Energy, Prefixed(4)) =>
                move |of| exact(of, tones[1].dissipation, tones[1].estimates.dissipation);
            "reduced_modulus", modulus, (Si(Kind::Pressure), Prefixed(4)) =>
                move |of| if of { self.reduced_modulus } else { estimates.reduced_modulus };
            "indentation", "indentation", (Length, Prefixed(4)) =>
                move |of| if of { Some(-last.closest) } else { estimates.indentation };
            "loss_tangent", "loss tangent, first tone", Prefixed(4) =>
                move |of| if of { tangent() } else { estimates.loss_tangent };
            "storage_modulus_2", "storage modulus, second tone", (Si(Kind::Pressure), Prefixed(4)) =>
                move |of| moduli(1).filter(|_| of).map(|[storage, _]| storage);
            "loss_modulus_2", "loss modulus, second tone", (Si(Kind::Pressure), Prefixed(4)) =>
                move |of| moduli(1).filter(|_| of).map(|[_, loss]| loss);
            .without(&unknown);
            .turned();
        })
    }

    /// The motion at each distance. A loop decides which quantities of a tone vary and are shown.
    pub fn point_table(&self) -> Frame<'_> {
        let varying = |k: usize| {
            let own = self.loops[k];
            let all = [
                (!own.holds_amplitude(), ["amplitude_1", "amplitude_2"]),
                (!own.holds_phase(), ["phase_1", "phase_2"]),
                (
                    own.holds_phase(),
                    ["frequency_shift_1", "frequency_shift_2"],
                ),
                (own.holds_amplitude(), ["drive_ratio_1", "drive_ratio_2"]),
            ];
            all.into_iter()
                .filter(|(varies, _)| *varies)
                .map(move |(_, names)| names[k])
        };
        let shown = ["distance"].into_iter().chain(varying(0)).chain(varying(1));
        let shown: Vec<&str> = shown.chain(["peak_force", "formula_modulus"]).collect();
        frame! { Rows::new("table", &self.table, None);
            "distance", "distance", (Length, Prefixed(4)) => |p| p.zc;
            .fields_of(0, |p| Some(&p.tones[0]));
            .fields_of(1, |p| Some(&p.tones[1]));
            .fields(Some);
            "formula_modulus", "E* by formula", (Si(Kind::Pressure), Prefixed(4)) =>
                |p| p.estimates.reduced_modulus;
            .shown(shown.join(","));
            .aligned(Left, Left);
        }
    }
}

/// Explanation of [`BimodalPoint::growth`], for reports.
const OPEN_LOOP: &str = "growth is that of a small disturbance at constant frequency and strength of both \
                         drives: below 1 the motion is stable without loops; with loops stability \
                         also depends on their gains";

/// Study of bimodal operation against the distance.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::control::Control;
/// use nanotap::study::Study;
/// use nanotap::study::bimodal::{BimodalOptions, BimodalStudy};
///
/// let words = [
///     "modes=2", "cantilever.k=2 N/m", "cantilever.f0=70 kHz", "cantilever.Q=200",
///     "tip.radius=10 nm", "sample.law=hertz", "sample.modulus=1 GPa",
///     "drive.actuation=tip", "drive.frequency_ratio=1", "drive.free_amplitude=40 nm",
///     "drive.second_ratio=6.27", "drive.second_free_amplitude=1 nm",
///     "drive.setpoint=0.8",
/// ];
/// let case = Case::parse(None, &words.map(str::to_owned))?;
/// let report = BimodalStudy::run(&case, &BimodalOptions::default(), &Control::default())?;
/// let last = &report.table[report.table.len() - 1];
/// assert!((last.tones[0].amplitude - 0.8 * 40e-9).abs() < 1e-17);
/// # Ok::<(), nanotap::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct BimodalStudy;

impl Study for BimodalStudy {
    const NAME: &'static str = "bimodal";
    const ABOUT: &'static str =
        "Follow AM–FM, FM–FM and other bimodal operation against the distance";
    const COUNTED: &'static str = "distances";
    const ANY_DISTANCE: bool = true;
    const ANY_RATIO: bool = true;
    type Options = BimodalOptions;
    type Report = BimodalReport;

    fn frames<'a>(_: &Case, report: &'a BimodalReport) -> Vec<Frame<'a>> {
        let mut frames = vec![report.point_table(), report.free_table()];
        frames.extend(report.formula_table());
        frames
    }

    fn figure(_: &Case, report: &BimodalReport) -> Option<Figure> {
        Some(bimodal_figure(report))
    }

    fn compute(
        case: &Case,
        options: &BimodalOptions,
        control: &Control<'_>,
    ) -> Result<BimodalReport, Error> {
        let lever = cantilever(case, Self::NAME)?;
        nanotap_study::without_signal(case, "bimodal operation")?;
        let view = case.physical().ok_or_else(|| {
            Error::input(
                "the readings of an instrument are in physical units, and this case has none",
                "give lever, sample and drive in physical quantities",
            )
        })?;
        if lever.further_tones.len() != 1 {
            return Err(Error::input(
                "bimodal operation needs a second tone, and no third",
                "give drive.second_ratio, near 6.27 for the second mode, and drive.second_free_amplitude",
            ));
        }
        follow::follow(case, lever, view, options, control)
    }
}
