//! Beam clearance: the least height of any point of the beam above the sample over a
//! motion. Where it vanishes, another part than the tip touches (the paper's Fig. 2f),
//! and the model no longer holds.
//!
//! # The bound
//! With s = φ₁(ξ)/φ₁(1), which grows from 0 to 1 along the beam, the height is
//!
//! V(ξ) = (1 − s) V(0) + s V(1) + Σ_{j≥2} a_j (φ_j(ξ) − s φ_j(1)),
//!
//! so that over any stretch it is at least min(V(0), V(1)) − Σ_{j≥2} c_j max|a_j| with
//! c_j = max_ξ |φ_j(ξ) − s φ_j(1)|. The greatest amplitudes are bounded by those of the modal
//! coordinates at the start of the stretch, which decay. Exactly computed are only periods
//! whose bound is below the least height already found.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use nanotap_flow::flow::{Observer as _, SegmentView};
use nanotap_flow::regime::ModalOutput;
use nanotap_flow::signal::Signal;
use nanotap_flow::trajectory::{Piece, PiecewiseSignal, Recorder, Segment};
use nanotap_flow::{Complex, FlowError, Output, Trajectory};
use serde::Serialize;

use super::measure::measure_clearance;
use crate::model::beam::Modes;
use crate::model::{BeamOutputs, Model};

/// Where a beam comes nearest to the sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Clearance {
    /// The least V(ξ, τ), in units of g₀; below zero the beam would pass through the
    /// sample.
    pub height: f64,
    /// Where along the beam, 0 (clamp) to 1 (tip).
    pub xi: f64,
    /// When, in drive periods from the start of the recording.
    pub period: f64,
}

/// Positions looked at for each mode; the highest mode has one bulge for each half wave.
const POSITIONS_PER_MODE: usize = 8;
/// Segments whose least height is found exactly, after a coarse look at all of them.
const CANDIDATES: usize = 6;

impl Clearance {
    /// Over `periods` drive periods from `state` at drive phase 0; `None` if the model is no
    /// beam.
    ///
    /// # Errors
    /// When the flow fails.
    pub fn of(model: &Model, state: &[f64], periods: usize) -> Result<Option<Self>, FlowError> {
        measure_clearance(model, state, periods)
    }

    /// The clearance over `trajectory`; `None` if the model is no beam.
    ///
    /// Every segment is looked at on a grid of places and times fine enough for the modes
    /// that take part in it; in the lowest few the least height is then found from roots
    /// of its rate.
    fn over(model: &Model, trajectory: &Trajectory) -> Option<Self> {
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

/// Periods whose least height is found exactly, those with the lowest bounds first; the rest
/// of the motions that need more is as the ones before it.
const MOST_PERIODS: usize = 64;
/// Two periods whose modal coordinates at the start differ by less than this, as a part of
/// the greatest, are one.
const SAME: f64 = 1e-10;

/// Looks for the clearance while a motion runs.
pub(super) struct ClearanceSearch {
    /// What is added to the height of the tip for that of the beam's end.
    above_tip: f64,
    /// The least height of the clamped end.
    clamp: f64,
    bounds: Vec<RegimeBound>,
    start: Option<Start>,
    /// The bound on what modes from the second on contribute in the period under way.
    higher: f64,
    periods: usize,
    /// The least height of the beam's end so far.
    end: f64,
    candidates: Vec<Candidate>,
}

/// Bounds Σ_{j≥2} c_j |a_j| in one regime.
struct RegimeBound {
    /// By modal coordinate.
    weights: Vec<f64>,
    /// Of the response to the drive.
    response: f64,
    /// Modal coordinates that do not grow alone, as simple exponentials.
    simple: bool,
}

#[derive(Clone)]
struct Start {
    regime: usize,
    modal: Vec<Complex>,
}

struct Candidate {
    bound: f64,
    period: usize,
    start: Start,
}

impl ClearanceSearch {
    /// In a motion of `model`; `None` if it is no beam.
    pub(super) fn new(model: &Model) -> Option<Self> {
        let beam = model.beam.as_ref()?;
        let shares = shares(&beam.modes);
        let bounds = model
            .system
            .regimes()
            .iter()
            .map(|regime| {
                let mut weights = vec![0.0; regime.basis().len()];
                let mut response = 0.0;
                for (j, share) in shares.iter().enumerate().skip(1) {
                    let mut row = nalgebra::RowDVector::zeros(model.dimension());
                    row[j] = 1.0;
                    let amplitude = regime.project(&Output::linear(row, beam.base.tones.len()));
                    for (sum, weight) in weights.iter_mut().zip(&amplitude.modal) {
                        *sum += share * weight.norm();
                    }
                    let tones: f64 = amplitude.tones.iter().map(|tone| tone.norm()).sum();
                    response += share * (amplitude.constant.abs() + tones);
                }
                RegimeBound {
                    weights,
                    response,
                    simple: regime.basis().clusters.is_empty()
                        && regime.basis().eigenvalues.iter().all(|l| l.re <= 0.0),
                }
            })
            .collect();
        let end = beam.height(1.0);
        let clamp = beam.height(0.0);
        Some(Self {
            above_tip: end.constant - model.height.constant,
            clamp: clamp.constant - clamp.tones.iter().map(|tone| tone.norm()).sum::<f64>(),
            bounds,
            start: None,
            higher: 0.0,
            periods: 0,
            end: f64::INFINITY,
            candidates: Vec::new(),
        })
    }

    pub(super) fn segment(&mut self, segment: &SegmentView<'_>) {
        if segment.length <= 0.0 {
            return;
        }
        if self.start.is_none() {
            self.start = Some(Start {
                regime: segment.regime,
                modal: segment.modal.to_vec(),
            });
        }
        let bound = &self.bounds[segment.regime];
        let modes: f64 = bound
            .weights
            .iter()
            .zip(segment.modal)
            .map(|(weight, q)| weight * q.norm_sqr().sqrt())
            .sum();
        let all = if bound.simple {
            modes + bound.response
        } else {
            f64::INFINITY
        };
        self.higher = self.higher.max(all);
    }

    /// A period has ended in which the tip's least height was `tip`.
    pub(super) fn period_end(&mut self, tip: f64) {
        let end = tip + self.above_tip;
        self.end = self.end.min(end);
        let bound = end.min(self.clamp) - self.higher;
        if let Some(start) = self.start.take()
            && bound <= self.end
        {
            self.candidates.push(Candidate {
                bound,
                period: self.periods,
                start,
            });
        }
        if self.candidates.len() >= 4 * MOST_PERIODS {
            self.candidates = self.lowest();
        }
        self.higher = 0.0;
        self.periods += 1;
    }

    /// The candidates that matter, those with the lowest bounds first.
    fn lowest(&mut self) -> Vec<Candidate> {
        let end = self.end;
        let mut all = std::mem::take(&mut self.candidates);
        all.retain(|candidate| candidate.bound <= end);
        all.sort_by(|a, b| a.bound.total_cmp(&b.bound).then(a.period.cmp(&b.period)));
        let mut kept: Vec<Candidate> = Vec::new();
        for candidate in all {
            if kept.len() == MOST_PERIODS {
                break;
            }
            if !kept.iter().any(|known| known.start.is(&candidate.start)) {
                kept.push(candidate);
            }
        }
        kept
    }

    /// The clearance of the periods that have ended.
    pub(super) fn found(mut self, model: &Model) -> Result<Option<Clearance>, FlowError> {
        let mut least: Option<Clearance> = None;
        for candidate in self.lowest() {
            if least.is_some_and(|known| known.height <= candidate.bound) {
                break;
            }
            let Some(state) = candidate.start.state(model) else {
                continue;
            };
            let period = Trajectory::record(&model.system, &state, 1)?;
            let Some(here) = Clearance::over(model, &period) else {
                continue;
            };
            if least.is_none_or(|known| here.height < known.height) {
                least = Some(Clearance {
                    period: here.period + candidate.period as f64,
                    ..here
                });
            }
        }
        Ok(least)
    }
}

impl Start {
    fn is(&self, other: &Self) -> bool {
        let size = self.modal.iter().map(|q| q.norm_sqr()).fold(0.0, f64::max);
        let apart = self.modal.iter().zip(&other.modal);
        self.regime == other.regime
            && apart.map(|(a, b)| (a - b).norm_sqr()).fold(0.0, f64::max) <= SAME * SAME * size
    }

    fn state(&self, model: &Model) -> Option<Vec<f64>> {
        let mut recorder = Recorder::default();
        recorder.segment(&SegmentView {
            system: &model.system,
            regime: self.regime,
            phase: 0.0,
            length: model.period(),
            modal: &self.modal,
            factors: &[],
        });
        recorder.finish(Arc::clone(&model.system)).state_at(0.0)
    }
}

/// c_j of the bound, by mode; the first is 0.
fn shares(modes: &Modes) -> Arc<Vec<f64>> {
    static KNOWN: Mutex<BTreeMap<usize, Arc<Vec<f64>>>> = Mutex::new(BTreeMap::new());
    /// Places for each mode: between them a share grows by less than (π/32)²/4 of the
    /// greatest deflection, 2.
    const PLACES: usize = 32;
    const BETWEEN: f64 = 0.005;
    let count = modes.count();
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let shares = known.entry(count).or_insert_with(|| {
        let mut shares = vec![0.0_f64; count];
        for place in 0..=PLACES * count {
            let shapes = modes.shapes(place as f64 / (PLACES * count) as f64);
            let along = shapes[0] / modes.tip[0];
            for j in 1..count {
                shares[j] = shares[j].max((shapes[j] - along * modes.tip[j]).abs() + BETWEEN);
            }
        }
        Arc::new(shares)
    });
    Arc::clone(shares)
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
