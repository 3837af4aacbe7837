//! Steps of the height that are the lever's, and the heights without them.

use super::assign::Decision;
use super::curves::StateCurve;
use super::image::Image;
use super::report::{HeightCheck, ImageStep};

/// Most steps that are reported, those with the largest heights.
const MAX_STEPS: usize = 1000;
/// Most pixels from one state to the other of a step whose height is compared with that of the lever.
const NEAR: usize = 4;
/// Fewest such steps.
const LEAST_STEPS: usize = 3;

/// Which pixels count as decided, and what is taken from their heights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Correction {
    pub(super) confidence: f64,
    /// Whether the deviation of the amplitude from the setpoint is taken from the heights, too.
    pub(super) amplitude_error: bool,
}

/// The decided pixels of an image, the lever's steps and the corrected heights.
#[derive(Debug)]
pub(super) struct Steps {
    /// Number of the state of each pixel; `None`: undecided.
    pub(super) states: Vec<Option<usize>>,
    /// Probability of the most probable state of each pixel.
    pub(super) probability: Vec<f64>,
    /// Heights as in the reference state at the setpoint, m.
    pub(super) corrected: Option<Vec<f64>>,
    /// The most frequent state with contact.
    pub(super) reference: Option<usize>,
    /// Changes of the state, line by line.
    pub(super) changes: Vec<ImageStep>,
}

impl Steps {
    /// Of an image without decided pixels.
    pub(super) fn undecided(pixels: usize, image: &Image) -> Self {
        Self {
            states: vec![None; pixels],
            probability: vec![f64::NAN; pixels],
            corrected: image.height.as_ref().map(|height| height.values.clone()),
            reference: None,
            changes: Vec::new(),
        }
    }

    /// Of the most probable states of pixels, each with its number.
    pub(super) fn of(
        curves: &[StateCurve],
        image: &Image,
        amplitude: &[f64],
        correction: Correction,
        decisions: impl Iterator<Item = (usize, Option<Decision>)>,
    ) -> Self {
        let mut found = Self::undecided(amplitude.len(), image);
        for (place, decision) in decisions {
            let Some(decision) = decision else { continue };
            found.probability[place] = decision.probability;
            let is_probable = decision.probability >= correction.confidence;
            let is_decided = is_probable && decision.fits() && !decision.is_ambiguous;
            found.states[place] = is_decided.then_some(decision.state);
        }
        let counts = found.counts(curves.len());
        found.reference = (0..curves.len())
            .filter(|state| counts[*state] > 0)
            .max_by_key(|state| (counts[*state], std::cmp::Reverse(*state)));
        let Some(reference) = found.reference.map(|state| &curves[state]) else {
            return found;
        };
        // Distance in the state of a pixel, and that of the reference at the same amplitude, unless it is
        // free or undecided.
        let distances = |place: usize| -> Option<[f64; 2]> {
            let curve = curves.get(found.states[place]?)?;
            let at = |of: &StateCurve| of.at(amplitude[place], f64::INFINITY).map(|at| at.distance);
            Some([at(curve)?, at(reference)?])
        };
        let distances: Vec<Option<[f64; 2]>> = (0..amplitude.len()).map(distances).collect();
        let points = image.shape[0].max(1);
        let height = image.height.as_ref().map(|height| &height.values);
        for (line, states) in found.states.chunks(points).enumerate() {
            let mut last: Option<(usize, usize, [f64; 2])> = None;
            for (pixel, state) in states.iter().enumerate() {
                let place = line * points + pixel;
                let (Some(state), Some(own)) = (*state, distances[place]) else {
                    continue;
                };
                if let Some((before, from, other)) = last
                    && from != state
                {
                    let measured = height.map(|of| of[place] - of[line * points + before]);
                    let middle = 0.5 * (before + pixel + 1) as f64;
                    found.changes.push(ImageStep {
                        line,
                        pixel: before,
                        until_pixel: pixel,
                        x: image.size.map(|size| middle * size[0] / points as f64),
                        from: curves[from].name.clone(),
                        to: curves[state].name.clone(),
                        height: curves[state].distance - curves[from].distance,
                        expected: own[0] - other[0],
                        measured: measured.filter(|change| change.is_finite()),
                    });
                }
                last = Some((pixel, state, own));
            }
        }
        if let Some(corrected) = &mut found.corrected {
            for (height, distances) in corrected.iter_mut().zip(&distances) {
                let of_reference = |at_amplitude| {
                    if correction.amplitude_error {
                        reference.distance
                    } else {
                        at_amplitude
                    }
                };
                *height -= distances.map_or(0.0, |[own, other]| own - of_reference(other));
            }
        }
        found
    }

    /// Number of pixels in each of so many states.
    pub(super) fn counts(&self, states: usize) -> Vec<usize> {
        let mut counts = vec![0; states];
        for state in self.states.iter().flatten() {
            if let Some(count) = counts.get_mut(*state) {
                *count += 1;
            }
        }
        counts
    }

    /// The steps with the largest heights, line by line.
    pub(super) fn largest(&self) -> Vec<ImageStep> {
        let mut order: Vec<usize> = (0..self.changes.len()).collect();
        let height = |k: &usize| self.changes[*k].height.abs();
        order.sort_by(|a, b| height(b).total_cmp(&height(a)));
        order.truncate(MAX_STEPS);
        order.sort_unstable();
        order.into_iter().map(|k| self.changes[k].clone()).collect()
    }

    /// Heights of the image where the state changes within a few pixels.
    pub(super) fn check(&self) -> Option<HeightCheck> {
        let near = self
            .changes
            .iter()
            .filter(|of| of.until_pixel - of.pixel <= NEAR);
        let pairs: Vec<[f64; 2]> = near
            .filter_map(|step| Some([step.expected.abs(), step.measured? * step.expected.signum()]))
            .collect();
        let count = pairs.len();
        if count < LEAST_STEPS {
            return None;
        }
        let mean = |which: usize| pairs.iter().map(|of| of[which]).sum::<f64>() / count as f64;
        let [expected, measured] = [mean(0), mean(1)];
        let scatter = pairs
            .iter()
            .map(|of| (of[1] - measured).powi(2))
            .sum::<f64>();
        Some(HeightCheck {
            count,
            expected,
            measured,
            standard_error: (scatter / (count * (count - 1)) as f64).sqrt(),
        })
    }
}
