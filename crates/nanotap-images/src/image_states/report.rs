//! What is found of an image, and its tables.

use schemars::JsonSchema;
use serde::Serialize;

use super::Sense;
use nanotap_observe::frame::{Frame, Rows, columns, finite, frame, rows};

rows! {
    in si_unit
    /// A state of the case, or free flight, with its pixels.
    #[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
    pub struct ImageState {
        /// `attractive` or `repulsive`, by the mean force at the setpoint, with the number of the material if
        /// there are several; or `free`.
        pub name: String,
        /// Number of the material, from 1 for the sample of the case; `null` for free flight.
        pub material: Option<usize>,
        /// Phase lag of the case at the setpoint, degrees; of free flight at the free amplitude.
        pub phase: f64 = Angle, "phase lag $φ$", "phase lag", Digits(4),
        /// Phase that the image has in this state at the setpoint, degrees; `null` if the image is undecided.
        pub measured_phase: Option<f64> = Angle, "phase in the image", "phase in the image", Digits(4),
        /// Distance between tip and sample at the setpoint, m; `null` for free flight.
        pub distance: Option<f64> = Length, "distance $z_c$", "zc", Prefixed(5),
        /// Height that the lever adds at the setpoint compared with the reference state, m.
        pub height: Option<f64> = Length, "height of the lever", "adds to the height", Prefixed(4),
        /// Largest force of the sample on the tip at the setpoint, N.
        pub peak_force: Option<f64> = Force, "peak force $F_{max}$", "F_max", Prefixed(4),
        /// Least amplitude of the image at which the state exists, m.
        pub amplitude_low: f64 = Length, "least amplitude", "from A", Prefixed(4),
        /// Largest amplitude of the image at which the state exists, m.
        pub amplitude_high: f64 = Length, "largest amplitude", "to A", Prefixed(4),
        /// Number of pixels in this state.
        pub pixels: usize = Count, "pixels", "pixels", Plain,
        /// Fraction of the pixels in this state, 0 to 1.
        pub share: f64 = Number, "fraction of the pixels", "pixels", Percent(4),
    }
}

rows! {
    in si_unit
    /// A change of the lever's state between pixels of a line.
    #[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
    pub struct ImageStep {
        /// Number of the line, from 0 at the top.
        pub line: usize = Count, "line", "line", Plain,
        /// Number of the last pixel in the state before, from 0 at the left.
        pub pixel: usize = Count, "last pixel", "pixel", Plain,
        /// Number of the first pixel in the state after; pixels between are free or undecided.
        pub until_pixel: usize = Count, "first pixel", "until pixel", Plain,
        /// Position of the change along the line, m; `null` if the size of the image is not known.
        pub x: Option<f64> = Length, "position $x$", "x", Prefixed(4),
        /// State before.
        pub from: String = Number, "state before", "from", Plain,
        /// State after.
        pub to: String = Number, "state after", "to", Plain,
        /// Height that the lever adds at the setpoint, once the feedback has settled, m: it is not the surface's.
        pub height: f64 = Length, "height of the lever", "adds to the height", Prefixed(4),
        /// Change of the height between the two pixels above a flat surface, by their amplitudes, m.
        pub expected: f64 = Length, "expected change of the height", "expected", Prefixed(4),
        /// Change of the height between the two pixels in the image, m.
        pub measured: Option<f64> = Length, "change of the height", "measured", Prefixed(4),
    }
}

/// An assignment of the whole image that is possible, too.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PossibleAssignment {
    /// Measured phase where the lag is zero, degrees.
    #[schemars(extend("x-unit" = "degree"))]
    pub phase_offset: f64,
    /// Whether the measured phase is a lag or a lead.
    pub sense: Sense,
    /// Fraction of the pixels that fit a state within their noise, 0 to 1.
    pub explained: f64,
    /// Fraction of the pixels in each state, in the order of `states`.
    pub shares: Vec<f64>,
    /// The heights where the state changes.
    pub check: Option<HeightCheck>,
}

/// Changes of the height where the state changes, against those above a flat surface; the sign of each
/// is that of the expected change.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct HeightCheck {
    /// Number of changes.
    pub count: usize,
    /// Mean change that is expected, m.
    #[schemars(extend("x-unit" = "m"))]
    pub expected: f64,
    /// Mean change in the image, m.
    #[schemars(extend("x-unit" = "m"))]
    pub measured: f64,
    /// Standard error of this mean, by the scatter, m.
    #[schemars(extend("x-unit" = "m"))]
    pub standard_error: f64,
}

/// The images of the report: a row a line from the top, an entry a pixel; `null` where there is no value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct StateImages {
    /// Number of the state in `states`; `null`: undecided.
    #[schemars(extend("x-unit" = "1", "x-label" = "state"))]
    pub state: Vec<Vec<Option<usize>>>,
    /// Probability of the most probable state among the states.
    #[schemars(extend("x-unit" = "1", "x-label" = "probability of the state"))]
    pub probability: Vec<Vec<f64>>,
    /// Height as measured, m.
    #[schemars(extend("x-unit" = "m", "x-label" = "height $z$"))]
    pub height: Option<Vec<Vec<f64>>>,
    /// Height without what the lever adds, m: each pixel as in the reference state at the setpoint.
    #[schemars(extend("x-unit" = "m", "x-label" = "corrected height"))]
    pub corrected: Option<Vec<Vec<f64>>>,
    /// Amplitude, m.
    #[schemars(extend("x-unit" = "m", "x-label" = "amplitude $A$"))]
    pub amplitude: Option<Vec<Vec<f64>>>,
    /// Phase as measured, degrees.
    #[schemars(extend("x-unit" = "degree", "x-label" = "phase"))]
    pub phase: Option<Vec<Vec<f64>>>,
}

/// The state of each pixel of an image, in SI.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ImageStatesReport {
    /// What is found, in sentences.
    pub verdict: String,
    /// Whether the states of the image are decided.
    pub decided: bool,
    /// Why they are not.
    pub reason: Option<String>,
    /// The channel of the height.
    pub height_channel: Option<String>,
    /// The channel of the amplitude.
    pub amplitude_channel: Option<String>,
    /// The channel of the phase.
    pub phase_channel: Option<String>,
    /// Pixels in a line, and lines.
    pub shape: [usize; 2],
    /// Width and height of the image, m.
    #[schemars(extend("x-unit" = "m"))]
    pub size: Option<[f64; 2]>,
    /// Amplitude of the free lever, m.
    #[schemars(extend("x-unit" = "m"))]
    pub free_amplitude: f64,
    /// Amplitude at the setpoint, m.
    #[schemars(extend("x-unit" = "m"))]
    pub setpoint_amplitude: f64,
    /// Noise of the amplitude in a pixel, m.
    #[schemars(extend("x-unit" = "m"))]
    pub amplitude_noise: f64,
    /// Noise of the phase in a pixel, degrees.
    #[schemars(extend("x-unit" = "degree"))]
    pub phase_noise: f64,
    /// Measured phase where the lag is zero, degrees.
    #[schemars(extend("x-unit" = "degree"))]
    pub phase_offset: Option<f64>,
    /// Standard error of this offset, degrees; zero if it is given.
    #[schemars(extend("x-unit" = "degree"))]
    pub phase_offset_error: Option<f64>,
    /// Whether the measured phase is a lag or a lead.
    pub sense: Option<Sense>,
    /// Probability above which a pixel is assigned.
    pub confidence: f64,
    /// Fraction of the measured pixels that fit a state within their noise, 0 to 1.
    pub explained: f64,
    /// Number of pixels that are assigned to no state.
    pub undecided: usize,
    /// Name of the state to which heights are corrected: the most frequent one.
    pub reference: Option<String>,
    /// The states of the case, and free flight.
    pub states: Vec<ImageState>,
    /// Number of changes of the state between pixels of a line.
    pub step_count: usize,
    /// The changes with the largest height of the lever, line by line.
    pub steps: Vec<ImageStep>,
    /// The heights where the state changes, as an independent check.
    pub check: Option<HeightCheck>,
    /// The assignments that are possible if the image is undecided.
    pub possible: Vec<PossibleAssignment>,
    /// Reasons for caution.
    pub warnings: Vec<String>,
    /// State, probability, heights, amplitude and phase of each pixel.
    pub images: StateImages,
}

impl ImageStatesReport {
    /// The pixels: line, position, what is measured, state, probability and corrected height.
    pub fn pixel_table(&self) -> Frame<'_> {
        let [points, lines] = self.shape;
        let step = self.size.map(|size| size[0] / points.max(1) as f64);
        let pixels = (0..lines).flat_map(move |line| (0..points).map(move |k| (line, k)));
        let at = |image: Option<&Vec<Vec<f64>>>, (line, k): (usize, usize)| {
            image.and_then(|rows| finite(rows[line][k]))
        };
        let images = &self.images;
        frame! { Rows::new("pixels", pixels, None);
            "line", "line", Plain => |(line, _)| line;
            "pixel", "pixel", Plain => |(_, k)| k;
            "x", "x", (Length, Prefixed(4)) => move |(_, k)| step.map(|step| (k as f64 + 0.5) * step);
            "height", "height", (Length, Prefixed(5)) => move |of| at(images.height.as_ref(), of);
            "amplitude", "amplitude", (Length, Prefixed(4)) => move |of| at(images.amplitude.as_ref(), of);
            "phase", "phase", (Angle, Digits(4)) => move |of| at(images.phase.as_ref(), of);
            "state", "state", Plain => move |(line, k)| {
                let state = images.state[line][k].and_then(|state| self.states.get(state));
                state.map_or("undecided", |state| state.name.as_str())
            };
            "probability", "probability", Digits(5) => move |(line, k)| finite(images.probability[line][k]);
            "corrected", "corrected height", (Length, Prefixed(5)) => move |of| at(images.corrected.as_ref(), of);
        }
    }

    /// The states of the case, with their pixels.
    pub fn state_table(&self) -> Frame<'_> {
        frame! { Rows::new("states", &self.states, None);
            "state", "state", Plain => |state| state.name.as_str();
            .fields(Some);
            .shown(STATES);
        }
    }

    /// The changes of the state.
    pub fn step_table(&self) -> Frame<'_> {
        columns! { Rows::new("steps", &self.steps, None);
            .fields(Some);
        }
        .frame()
    }
}

/// Columns of the states that are shown.
const STATES: &str = "state,phase,measured_phase,distance,height,peak_force,share";
