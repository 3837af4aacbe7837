//! Beam clearance: the least height of any point of the beam above the sample over a
//! motion. Where it vanishes, another part than the tip touches (the paper's Fig. 2f),
//! and the model no longer holds.

use nanotap_flow::regime::ModalOutput;
use nanotap_flow::signal::Signal;
use nanotap_flow::trajectory::{Piece, PiecewiseSignal, Segment};
use nanotap_flow::{Complex, Trajectory};
use serde::Serialize;

use crate::model::{BeamOutputs, Model};

/// Where a beam comes nearest to the sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Clearance {
    /// The least V(ξ, τ), in units of g₀; below zero the beam would pass through the
    /// sample.
    #[serde(rename = "beam_clearance")]
    pub height: f64,
    /// Where along the beam, 0 (clamp) to 1 (tip).
    #[serde(rename = "beam_clearance_xi")]
    pub xi: f64,
    /// When, in drive periods from the start of the recording.
    #[serde(rename = "beam_clearance_period")]
    pub period: f64,
}

/// Positions looked at for each mode; the highest mode has one bulge for each half wave.
const POSITIONS_PER_MODE: usize = 8;
/// Segments whose least height is found exactly, after a coarse look at all of them.
const CANDIDATES: usize = 6;

impl Clearance {
    /// The clearance over `trajectory`; `None` if the model is no beam.
    ///
    /// Every segment is looked at on a grid of places and times fine enough for the modes
    /// that take part in it; in the lowest few the least height is then found from roots
    /// of its rate.
    pub fn of(model: &Model, trajectory: &Trajectory) -> Option<Self> {
        let beam = model.beam.as_ref()?;
        let count = POSITIONS_PER_MODE * beam.modes.count();
        let places: Vec<f64> = (0..=count).map(|i| i as f64 / count as f64).collect();
        let lowest = lowest_segments(model, beam, trajectory, &places);
        let at = |xi: f64| least_height(model, beam, trajectory, &lowest, xi);
        let grid: Vec<Self> = places.iter().filter_map(|&xi| at(xi)).collect();
        let best = (0..grid.len()).min_by(|&a, &b| grid[a].height.total_cmp(&grid[b].height))?;
        let mut low = grid[best.saturating_sub(1)].xi;
        let mut high = grid[(best + 1).min(grid.len() - 1)].xi;
        let mut least = grid[best];
        // Golden section between the neighbours.
        let golden = 0.381_966_011_250_105;
        while high - low > 1e-7 {
            let (a, b) = (
                at(low + golden * (high - low))?,
                at(high - golden * (high - low))?,
            );
            let lower = if a.height < b.height { a } else { b };
            if lower.height < least.height {
                least = lower;
            }
            if a.height < b.height {
                high = b.xi;
            } else {
                low = a.xi;
            }
        }
        Some(least)
    }

    /// Whether another part of the beam than the tip would touch.
    pub fn touches(&self) -> bool {
        self.height <= 0.0
    }
}

/// The indices of the segments in which a coarse look sees the beam lowest.
fn lowest_segments(
    model: &Model,
    beam: &BeamOutputs,
    trajectory: &Trajectory,
    places: &[f64],
) -> Vec<usize> {
    let segments = trajectory.segments();
    if segments.len() <= CANDIDATES {
        return (0..segments.len()).collect();
    }
    let regimes = model.system.regimes();
    let heights: Vec<Vec<ModalOutput>> = regimes
        .iter()
        .map(|regime| {
            places
                .iter()
                .map(|&xi| regime.project(&beam.height(xi)))
                .collect()
        })
        .collect();
    let mut seen: Vec<(f64, usize)> = segments
        .iter()
        .enumerate()
        .map(|(i, s)| (coarse_height(model, s, &heights[s.regime]), i))
        .collect();
    seen.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    seen.truncate(CANDIDATES);
    seen.into_iter().map(|(_, i)| i).collect()
}

/// The least height on a grid of places and times of one segment; minus infinity, so
/// that it is looked at exactly, where eigenvalues coincide.
fn coarse_height(model: &Model, segment: &Segment, heights: &[ModalOutput]) -> f64 {
    let drive = model.system.drive();
    let basis = model.system.regimes()[segment.regime].basis();
    if !basis.clusters.is_empty() {
        return f64::NEG_INFINITY;
    }
    let size = |k: usize| {
        heights
            .iter()
            .map(|h| h.modal[k].norm())
            .fold(0.0, f64::max)
            * segment.modal[k].norm()
    };
    let sizes: Vec<f64> = (0..basis.len()).map(size).collect();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let fastest = (0..basis.len())
        .filter(|&k| sizes[k] > 1e-3 * largest)
        .map(|k| basis.eigenvalues[k].norm())
        .chain(drive.frequencies().iter().copied())
        .fold(0.0, f64::max);
    // Twelve looks a turn of the fastest mode that takes part.
    let steps = (2.0 * segment.length * fastest).ceil().clamp(4.0, 1000.0);
    let step = segment.length / steps;
    let factors: Vec<Complex> = basis.eigenvalues.iter().map(|l| (l * step).exp()).collect();
    let mut modal = segment.modal.clone();
    let mut least = f64::INFINITY;
    for i in 0..=steps as usize {
        let t = segment.phase + step * i as f64;
        let phasors: Vec<Complex> = (0..drive.frequencies().len())
            .map(|k| drive.phasor(k, t))
            .collect();
        for height in heights {
            let modes = height.modal.iter().zip(&modal);
            let tones = height.tones.iter().zip(&phasors);
            let sum: f64 = modes
                .chain(tones)
                .map(|(w, q)| w.re * q.re - w.im * q.im)
                .sum();
            least = least.min(height.constant + sum);
        }
        for (q, factor) in modal.iter_mut().zip(&factors) {
            *q *= factor;
        }
    }
    least
}

/// The least height of one place over the given segments, exactly.
fn least_height(
    model: &Model,
    beam: &BeamOutputs,
    trajectory: &Trajectory,
    segments: &[usize],
    xi: f64,
) -> Option<Clearance> {
    let drive = model.system.drive();
    let height = beam.height(xi);
    let pieces = segments
        .iter()
        .map(|&i| {
            let s = &trajectory.segments()[i];
            let regime = &model.system.regimes()[s.regime];
            let output = regime.project(&height);
            Piece {
                start: s.start,
                length: s.length,
                signal: Signal::of(regime, drive, &output, &s.modal, s.phase, s.length),
            }
        })
        .collect();
    let (least, _) = PiecewiseSignal { pieces }.range()?;
    Some(Clearance {
        height: least.value,
        xi,
        period: least.time / model.period(),
    })
}
