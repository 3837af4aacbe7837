//! Beam clearance: the least height of any point of the beam above the sample over a
//! motion. Where it vanishes, another part than the tip touches (the paper's Fig. 2f),
//! and the model no longer holds.

use nanotap_flow::Trajectory;
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

impl Clearance {
    /// The clearance over `trajectory`; `None` if the model is no beam.
    pub fn of(model: &Model, trajectory: &Trajectory) -> Option<Self> {
        let beam = model.beam.as_ref()?;
        let at = |xi: f64| least_height(model, beam, trajectory, xi);
        let count = POSITIONS_PER_MODE * beam.modes.count();
        let grid: Vec<Self> = (0..=count)
            .filter_map(|i| at(i as f64 / count as f64))
            .collect();
        let best = (0..grid.len()).min_by(|&a, &b| grid[a].height.total_cmp(&grid[b].height))?;
        let mut low = grid[best.saturating_sub(1)].xi;
        let mut high = grid[(best + 1).min(grid.len() - 1)].xi;
        let mut least = grid[best];
        // Golden section between the neighbours.
        let golden = 0.381_966_011_250_105;
        for _ in 0..30 {
            let (a, b) = (
                at(low + golden * (high - low))?,
                at(high - golden * (high - low))?,
            );
            let lower = if a.height < b.height { a } else { b };
            if lower.height < least.height {
                least = lower;
            }
            if a.height < b.height {
                high = b.xi
            } else {
                low = a.xi
            }
            if high - low < 1e-7 {
                break;
            }
        }
        Some(least)
    }

    /// Whether another part of the beam than the tip would touch.
    pub fn touches(&self) -> bool {
        self.height <= 0.0
    }
}

fn least_height(
    model: &Model,
    beam: &BeamOutputs,
    trajectory: &Trajectory,
    xi: f64,
) -> Option<Clearance> {
    let (least, _) = trajectory.signal(&beam.height(xi)).range()?;
    Some(Clearance {
        height: least.value,
        xi,
        period: least.time / model.period(),
    })
}
