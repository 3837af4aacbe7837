//! The report of a scan.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::instrument::Interaction;
use super::options::{Method, Mode};
use nanotap_observe::Dimension;
use nanotap_observe::frame::rows;

/// Direction in which a line is scanned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// From left to right: the positions rise
    Trace,
    /// From right to left: the positions fall
    Retrace,
}

rows! {
    in si_unit
    /// Signals of a listed drive period, in SI.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    pub struct ListedPeriod {
        /// Number of the period, from the start of settling.
        pub k: usize = Periods, "drive period",
        /// Position along the line, m.
        pub x: f64 = Length, "position $x$",
        /// Height of the surface, m.
        pub surface: f64 = Length, "height of the surface",
        /// Height of the lever's base, m.
        pub z: f64 = Length, "height $z$ of the base",
        /// Amplitude of the deflection at the drive's frequency, m.
        pub amplitude: f64 = Length, "amplitude",
        /// Phase lag of the deflection behind the drive, degrees.
        pub phase: f64 = Angle, "phase lag",
        /// Amplitude at the output of the lock-in amplifier, m.
        pub amplitude_lockin: f64 = Length, "amplitude of the lock-in amplifier",
        /// Phase lag at the output of the lock-in amplifier, degrees.
        pub phase_lockin: f64 = Angle, "phase lag of the lock-in amplifier",
        /// Amplitude at the output of the lock-in amplifier minus the setpoint, m.
        pub error: f64 = Length, "amplitude error",
        /// Largest force of the sample on the tip, N.
        pub peak_force: f64 = Force, "peak force",
        /// Mean deflection of the tip over the period, m.
        pub mean_deflection: f64 = Length, "mean deflection",
        /// Time in contact over the period, 0 to 1.
        pub contact_fraction: f64 = Number, "contact time / period",
        /// Energy that the tip gives to the sample in the period, J.
        pub dissipation: f64 = Energy, "dissipated energy",
        /// Force that governs the motion in the period.
        pub state: Interaction = Number, "governing force",
    }
}

rows! {
    in si_unit
    /// A stretch on which the tip flies above the surface.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    pub struct Parachuting {
        /// Number of the first drive period of the stretch, from the start of settling.
        pub first_period: usize = Periods, "first period",
        /// Number of drive periods of the stretch.
        pub periods: usize = Periods, "periods",
        /// Duration of the stretch, s.
        pub time: f64 = Time, "duration",
        /// Length of the stretch along the line, m.
        pub length: f64 = Length, "length",
    }
}

rows! {
    in si_unit
    /// A stretch on which the feedback lags: the amplitude is off the setpoint by more than half of the way
    /// from the setpoint to the free amplitude or to 0, whichever is shorter.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    pub struct OffSetpoint {
        /// Number of the first drive period of the stretch, from the start of settling.
        pub first_period: usize = Periods, "first period",
        /// Number of drive periods of the stretch.
        pub periods: usize = Periods, "periods",
        /// Position along the line where the stretch starts, m.
        pub x: f64 = Length, "start",
        /// Position along the line of the last period of the stretch, m.
        pub until_x: f64 = Length, "end",
        /// Amplitude minus setpoint where its modulus is largest, m: above the setpoint the tip flies,
        /// below it presses.
        pub error: f64 = Length, "amplitude error",
        /// Largest deviation of the height from that of the surface and the distance of the lever's state
        /// at the setpoint, m; `null` where that distance is not known.
        pub height: Option<f64> = Length, "deviation of the height",
        /// Number of the material in the last period of the stretch: 0 is the case's own sample.
        pub material: usize = Unit("count"), "material",
        /// Whether the surface or the sample changed under the tip in the stretch or shortly before it.
        pub moved: bool = Unit("flag"), "surface or sample changed",
    }
}

rows! {
    in si_unit
    /// Statistics of a line in one direction, in SI.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    pub struct LineStatistics {
        /// Number of the line, from 0.
        pub line: usize = Count, "line", "line", Plain,
        /// Direction in which the line was scanned.
        pub direction: Direction,
        /// Position across the lines, m.
        pub y: f64 = Length, "position $y$",
        /// Number of the first drive period of the line, from the start of settling.
        pub first_period: usize = Periods, "first period",
        /// Mean height of the lever's base, m.
        pub height_mean: f64 = Length, "mean height",
        /// Standard deviation of this height, m.
        pub height_rms: f64 = Length, "standard deviation of the height", "height rms", Scaled(-9, 4),
        /// Largest height of the lever's base, m.
        pub height_max: f64 = Length, "largest height",
        /// Least height of the lever's base, m.
        pub height_min: f64 = Length, "least height",
        /// Root mean square of the amplitude error, m: the amplitude minus the setpoint.
        pub error_rms: f64 = Length, "root mean square of the amplitude error", "error rms", Scaled(-9, 4),
        /// Largest amplitude error, m: above the setpoint, if positive.
        pub error_max: f64 = Length, "largest amplitude error",
        /// Least amplitude error, m: below the setpoint, if negative.
        pub error_min: f64 = Length, "least amplitude error",
        /// Largest force of the sample on the tip in the line, N.
        pub peak_force_max: f64 = Force, "largest peak force", "largest peak force", Scaled(-9, 4),
        /// Number of the drive period with the largest force.
        pub peak_force_max_period: usize = Periods, "period of the largest force",
        /// Position of the largest force along the line, m.
        pub peak_force_max_x: f64 = Length, "position of the largest force",
        /// Mean of the periods' largest forces, N.
        pub peak_force_mean: f64 = Force, "mean peak force",
        /// Mean energy that the tip gives to the sample in a period, J.
        pub dissipation_mean: f64 = Energy, "mean dissipated energy",
        /// Standard deviation of the height minus that of the surface, m.
        pub tracking_rms: f64 = Length, "standard deviation of height minus surface", "tracking rms", Scaled(-9, 4),
        /// Standard deviation of the height of the surface, m.
        pub surface_rms: f64 = Length, "standard deviation of the surface",
        /// Excess of the largest height over the highest point of the surface, m, beyond their mean
        /// difference where the error is small; at least 0.
        pub overshoot: f64 = Length, "overshoot", "overshoot", Scaled(-9, 3),
        /// Stretches on which the tip flies above the surface.
        pub parachuting: Vec<Parachuting>,
        /// Stretches on which the feedback lags, the 8 with the largest deviation of the height.
        pub off_setpoint: Vec<OffSetpoint>,
    }
}

/// A channel of an image.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Name in tables, files and Python.
    pub name: &'static str,
    /// Title, without symbol and unit.
    pub title: &'static str,
    /// Label of an axis, without the unit.
    pub label: &'static str,
    /// Dimension of the values, which are in SI.
    pub dimension: Dimension,
    /// Power of ten of the SI unit in which figures show it.
    pub power: i32,
    /// Returns the values from the channels of an image: one vector per line, one entry per pixel.
    pub values: fn(&Channels) -> &Vec<Vec<f64>>,
}

/// Declares the channels of an image, each with its dimension, title, label and power of ten.
macro_rules! channels {
    ($($(#[$about:meta])* $name:ident: $dimension:ident, $title:literal, $label:literal, $power:literal;)*) => {
        /// Channels of an image: a row a line, an entry a pixel; `null` where no period falls on a
        /// pixel.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
        pub struct Channels {
            $(
                $(#[$about])*
                #[schemars(extend("x-unit" = Dimension::$dimension.si_unit(), "x-label" = $label))]
                pub $name: Vec<Vec<f64>>,
            )*
            /// Force that governs the motion in most periods of a pixel.
            #[schemars(extend("x-unit" = "1", "x-label" = "governing force"))]
            pub state: Vec<Vec<Option<Interaction>>>,
        }

        /// Pixels of a line in one direction, by channel.
        #[derive(Clone, Debug, Default)]
        pub(super) struct PixelRow {
            $(pub(super) $name: Vec<f64>,)*
            pub(super) state: Vec<Option<Interaction>>,
        }

        impl Channels {
            /// Returns an image without a scanned line.
            pub(super) fn missing(lines: usize, pixels: usize) -> Self {
                Self {
                    $($name: vec![vec![f64::NAN; pixels]; lines],)*
                    state: vec![vec![None; pixels]; lines],
                }
            }

            /// Replaces a line of the image.
            pub(super) fn set_line(&mut self, line: usize, pixels: PixelRow) {
                if line < self.state.len() {
                    $(self.$name[line] = pixels.$name;)*
                    self.state[line] = pixels.state;
                }
            }
        }

        impl PixelRow {
            /// Returns the pixels from the numbers of each channel by its name.
            pub(super) fn read(of: impl Fn(&str) -> Vec<f64>, state: Vec<Option<Interaction>>) -> Self {
                Self { $($name: of(stringify!($name)),)* state }
            }
        }

        /// All channels except the state.
        pub const CHANNELS: &[Channel] = &[$(Channel {
            name: stringify!($name),
            title: $title,
            label: $label,
            dimension: Dimension::$dimension,
            power: $power,
            values: |image| &image.$name,
        }),*];
    };
}

channels! {
    /// Mean height of the surface itself in a pixel, m.
    surface: Length, "surface", "surface", -9;
    /// Mean height of the lever's base in a pixel, m.
    height: Length, "height", "height $z$", -9;
    /// Mean of amplitude minus setpoint in a pixel, m.
    amplitude_error: Length, "amplitude error", "amplitude error", -9;
    /// Phase of the mean output of the lock-in amplifier, degrees.
    phase: Angle, "phase lag", "phase lag", 0;
    /// Mean peak force in a pixel, N: the mean of the periods' largest forces.
    peak_force: Force, "mean peak force", "mean peak force", -9;
    /// Largest peak force in a pixel, N.
    peak_force_max: Force, "largest peak force", "largest peak force", -9;
    /// Mean energy that the tip gives to the sample in a period, J.
    dissipation: Energy, "dissipated energy", "dissipated energy", -18;
    /// Mean fraction of a period in contact, 0 to 1.
    contact_fraction: Number, "contact time / period", "contact time / period", 0;
    /// Mean deflection of the tip in a pixel, m.
    mean_deflection: Length, "mean deflection", "mean deflection", -9;
}

rows! {
    in si_unit
    /// A permanent change of the lever's state: from there on it stays at the setpoint in the other state.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    pub struct BranchChange {
        /// Number of the drive period, from the start of settling.
        pub k: usize = Periods, "drive period",
        /// Number of the line, from 0.
        pub line: usize,
        /// Direction in which the line is scanned.
        pub direction: Direction,
        /// Position along the line, m.
        pub x: f64 = Length, "position $x$",
        /// Force that governed the motion before.
        pub from: Interaction = Number, "state before",
        /// Force that governs the motion from there on.
        pub to: Interaction = Number, "state after",
        /// Change of the height that is not the surface's, m: `distance_to` minus `distance_from`.
        pub height_change: f64 = Length, "change of the height",
        /// Distance of the state before at the setpoint, m.
        pub distance_from: f64 = Length, "distance before",
        /// Distance of the state after it at the setpoint, m.
        pub distance_to: f64 = Length, "distance after",
        /// Number of the material above which both distances are: 0 is the case's own sample; `null` where
        /// each state exists above another material.
        pub material: Option<usize> = Unit("count"), "material",
        /// Number of the drive period in which the lever leaves the state again; `null` if it stays in it
        /// to the end of the scan, or of the line if lines are independent.
        pub until_k: Option<usize> = Periods, "last drive period",
        /// Position along the line where the lever leaves the state again, m.
        pub until_x: Option<f64> = Length, "end",
    }
}

/// Why the image shows something that is not the surface's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// The loop oscillates, or is so near its limit of stability that it hunts after large errors
    LoopRings,
    /// The lever changes its state permanently
    StateChange,
    /// The amplitude is off the setpoint while the surface moves
    FeedbackLags,
}

/// A cause with the place where its effect is largest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImageCause {
    /// Why the image shows something that is not the surface's.
    pub cause: Cause,
    /// Number of the line, from 0; `null` where the cause acts in the whole image.
    pub line: Option<usize>,
    /// Direction in which the line is scanned; `null` where the cause acts in both.
    pub direction: Option<Direction>,
    /// Number of the drive period in which it starts, from the start of settling.
    pub k: Option<usize>,
    /// Position along the line where it starts, m.
    #[schemars(extend("x-unit" = "m"))]
    pub x: Option<f64>,
    /// Number of the drive period with which it ends; `null` if it lasts.
    pub until_k: Option<usize>,
    /// Position along the line where it ends, m; `null` if it lasts.
    #[schemars(extend("x-unit" = "m"))]
    pub until_x: Option<f64>,
    /// Change of the height that is not the surface's, m; `null` where it is not known.
    #[schemars(extend("x-unit" = "m"))]
    pub height: Option<f64>,
    /// Number of the material above which it acts: 0 is the case's own sample.
    pub material: Option<usize>,
    /// Largest modulus of the multipliers of the loop that rings; `null` for another cause.
    pub multiplier: Option<f64>,
    /// The cause in words.
    pub sentence: String,
}

/// The feedback loop linearised at the setpoint, on the flat surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LoopReport {
    /// Distance at which the motion has the setpoint amplitude, m.
    #[schemars(extend("x-unit" = "m"))]
    pub distance: f64,
    /// Force that governs the motion there.
    pub state: Interaction,
    /// Slope of the amplitude over the distance, m/m.
    pub slope: f64,
    /// Number of periods in which a disturbance of the lever falls by the factor e.
    pub lever_memory: f64,
    /// Largest modulus of the multipliers of the whole loop, dimensionless; above 1 the loop
    /// oscillates.
    pub spectral_radius: f64,
    /// Integral gain at which the loop starts to oscillate, 1/s; `null` if none makes it oscillate.
    #[schemars(extend("x-unit" = "1/s"))]
    pub largest_stable_gain: Option<f64>,
    /// Frequency in Hz at which the height lags the surface by 45°.
    #[schemars(extend("x-unit" = "Hz"))]
    pub bandwidth_45: Option<f64>,
    /// Frequency in Hz at which the height follows with 1/√2 of the surface's amplitude.
    #[schemars(extend("x-unit" = "Hz"))]
    pub bandwidth_3db: Option<f64>,
    /// Largest ratio of the height to the surface over all frequencies, dimensionless.
    pub peaking: f64,
    /// Rule of thumb for the bandwidth in Hz: 1/16 of the inverse of all delays.
    #[schemars(extend("x-unit" = "Hz"))]
    pub rule_of_thumb: f64,
    /// Integral gain in 1/s with the largest bandwidth for a peaking of at most 1.1.
    #[schemars(extend("x-unit" = "1/s"))]
    pub suggested_gain: Option<f64>,
    /// Bandwidth in Hz at 45° with the suggested gain.
    #[schemars(extend("x-unit" = "Hz"))]
    pub suggested_bandwidth: Option<f64>,
}

/// Report of a scan, in SI.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanReport {
    /// Method by which the drive periods were computed.
    pub method: Method,
    /// Mode of the feedback.
    pub mode: Mode,
    /// Fraction of the drive periods that was computed exactly, 0 to 1.
    pub exact_share: f64,
    /// Extent along and across the lines, m.
    #[schemars(extend("x-unit" = "m"))]
    pub size: [f64; 2],
    /// Number of drive periods of a line in one direction.
    pub periods_per_line: usize,
    /// Number of drive periods of the scan, with settling.
    pub total_periods: usize,
    /// Lines a second, trace and retrace together, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub line_rate: f64,
    /// Speed of the tip along a line, m/s.
    #[schemars(extend("x-unit" = "m/s"))]
    pub speed: f64,
    /// Amplitude of the free lever at the drive's frequency, m.
    #[schemars(extend("x-unit" = "m"))]
    pub free_amplitude: f64,
    /// Amplitude that the feedback keeps, m.
    #[schemars(extend("x-unit" = "m"))]
    pub setpoint_amplitude: f64,
    /// Height of the lever's base at the start, m.
    #[schemars(extend("x-unit" = "m"))]
    pub z0: f64,
    /// Integral gain of the feedback, 1/s.
    #[schemars(extend("x-unit" = "1/s"))]
    pub integral_gain: f64,
    /// Whether each line settled anew, so that lines are independent.
    pub independent_lines: bool,
    /// Largest force of the sample on the tip in the scan, N.
    #[schemars(extend("x-unit" = "N"))]
    pub peak_force_max: f64,
    /// Signals of the drive periods that the options list.
    pub periods: Vec<ListedPeriod>,
    /// Statistics of each line and direction.
    pub lines: Vec<LineStatistics>,
    /// Root mean square of the difference between the heights of trace and retrace, m.
    #[schemars(extend("x-unit" = "m"))]
    pub trace_retrace_rms: Option<f64>,
    /// Image of the trace: lines in the direction of rising positions.
    pub trace: Channels,
    /// Image of the retrace; None if lines are scanned in one direction only.
    pub retrace: Option<Channels>,
    /// Permanent changes of the lever's state at the setpoint.
    pub branch_changes: Vec<BranchChange>,
    /// The feedback loop at the setpoint; `null` where no steady motion has it.
    #[serde(rename = "loop")]
    pub feedback: Option<LoopReport>,
    /// Reasons to doubt the image.
    pub warnings: Vec<String>,
    /// Why the image shows something that is not the surface's: of each cause the largest effect.
    pub causes: Vec<ImageCause>,
    /// What the image shows, in sentences: those of the causes.
    pub verdict: String,
}
