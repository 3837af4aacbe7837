//! Beam clearance: the least height of any point of the beam above the sample over a motion. Where
//! it vanishes, a part other than the tip is in contact (the paper's Fig. 2f), and the model is not
//! valid.
//!
//! # The bound
//! With s = φ₁(ξ)/φ₁(1), which grows from 0 to 1 along the beam, the height is
//!
//! V(ξ) = (1 − s) V(0) + s V(1) + Σ_{j≥2} a_j (φ_j(ξ) − s φ_j(1)),
//!
//! Over any interval of time it is therefore at least min(V(0), V(1)) − Σ_{j≥2} c_j max|a_j| with
//! c_j = max_ξ |φ_j(ξ) − s φ_j(1)|. The largest amplitudes are bounded by those of the modal
//! coordinates at the start of the interval, which decay. The clearance is computed exactly only
//! for periods whose bound is below the least height found so far.

use nanotap_arithmetic::ComplexFunctions as _;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use nanotap_flow::accumulate::{Accumulator, Functional, Request};
use nanotap_flow::flow::SegmentView;
use nanotap_flow::trajectory::Recorder;
use nanotap_flow::{Complex, Flow, FlowError, Output, Trajectory};
use schemars::JsonSchema;
use serde::Serialize;

use nanotap_model::beam::Modes;
use nanotap_model::nonlinear::Nonlinear;
use nanotap_model::recording::{Recording, read};
use nanotap_model::{BeamOutputs, Model};

/// The lowest point of a beam over a motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Clearance<D = f64> {
    /// Least V(ξ, τ), in units of g₀; negative if the beam would pass through the sample.
    pub height: D,
    /// Position along the beam as a fraction of its length, 0 (clamp) to 1 (tip).
    pub xi: f64,
    /// Time from the start of the recording, in drive periods.
    pub period: f64,
}

/// Number of grid positions per mode; the highest mode has one antinode per half wave.
const PLACES_PER_MODE: usize = 8;
/// Final width of the interval of positions in which the beam is lowest, as a fraction of its
/// length.
const PLACE: f64 = 1e-9;
/// The position nearest to the clamp at which the slope is evaluated, as a fraction of the beam's
/// length.
const CLAMP: f64 = 1e-6;
/// Magnitude of the slope dW/dξ, in units of g₀, up to which a beam counts as level.
const LEVEL: f64 = 1e-13;
/// Largest number of Newton steps to the time of a least height.
const MAX_STEPS: usize = 12;
/// Length of the last Newton step, in drive periods.
const SAME_MOMENT: f64 = 1e-9;
/// Accuracy to which a least height found by Newton agrees with a search over all time.
const FOLLOWED: f64 = 1e-11;

impl Clearance {
    /// True if a part of the beam other than the tip would be in contact.
    pub fn touches(&self) -> bool {
        self.height <= 0.0
    }
}

/// The beam in a short recording.
struct RecordedBeam<'a> {
    model: &'a Model,
    beam: &'a BeamOutputs,
    recording: &'a Recording,
}

impl RecordedBeam<'_> {
    /// The least height over all positions, from the least heights on the grid of positions
    /// (infinite where a position does not matter).
    ///
    /// The beam is lowest in one of the valleys of the grid, which need not be the one with the
    /// lowest grid value.
    fn lowest(&self, heights: &[f64]) -> Option<Clearance> {
        let mut best: Option<Clearance> = None;
        for valley in valleys(heights) {
            if best.is_some_and(|known| known.height <= valley.bound) {
                continue;
            }
            let bottom = self.bottom(&valley)?;
            if best.is_none_or(|known| bottom.height < known.height) {
                best = Some(bottom);
            }
        }
        best
    }

    /// The lowest point of a valley: the position where the beam is level at the time when it is
    /// lowest there. The derivative of the least height with respect to the position is that of the
    /// height at that time.
    fn bottom(&self, valley: &Valley) -> Option<Clearance> {
        let first = self.least_height(valley.place)?;
        // The time of the least height is followed from position to position; at the end it is
        // searched for over the whole motion.
        if let Some(near) = self.level(first, valley, |xi, from| self.least_near(xi, from)) {
            let certain = if near.xi == first.xi {
                first
            } else {
                self.least_height(near.xi)?
            };
            if (certain.height - near.height).abs() <= FOLLOWED * (1.0 + near.height.abs()) {
                return Some(certain);
            }
        }
        self.level(first, valley, |xi, _| self.least_height(xi))
    }

    /// The position in a valley where the beam is level at the time when it is lowest there,
    /// downhill from `first`. `least` finds the least height at a position, given a time near it.
    /// Returns the end of the valley if the beam slopes towards it everywhere.
    fn level(
        &self,
        first: Clearance,
        valley: &Valley,
        least: impl Fn(f64, f64) -> Option<Clearance>,
    ) -> Option<Clearance> {
        let mut best = first;
        let mut near = (first.xi, self.slope(&first)?);
        // Every beam is level at the clamp.
        let end = if near.1 < 0.0 {
            valley.high
        } else {
            valley.low.max(CLAMP)
        };
        if end == near.0 {
            return Some(best);
        }
        let mut far: Option<(f64, f64)> = None;
        let mut far_xi = end;
        for step in 0..200 {
            if near.1.abs() <= LEVEL || (far_xi - near.0).abs() <= PLACE {
                break;
            }
            let middle = 0.5 * (near.0 + far_xi);
            let xi = match far {
                // First the end, then the middle until the beam rises beyond it.
                None if step == 0 => end,
                None => middle,
                Some((far, rises)) => {
                    let secant = near.0 - near.1 * (far - near.0) / (rises - near.1);
                    let inside = (secant - near.0) * (secant - far) < 0.0;
                    if inside && step % 3 < 2 {
                        secant
                    } else {
                        middle
                    }
                }
            };
            let here = least(xi, best.period)?;
            let slope = self.slope(&here)?;
            let lower = here.height < best.height;
            if lower {
                best = here;
            }
            if slope * near.1 <= 0.0 {
                far = Some((xi, slope));
                far_xi = xi;
            } else if lower || far.is_some() {
                near = (xi, slope);
            } else {
                // On the other side of a ridge.
                far_xi = xi;
            }
        }
        Some(best)
    }

    /// The least height at one position near the time `from`, in drive periods: Newton's method on
    /// its rate. Only for exact motions.
    fn least_near(&self, xi: f64, from: f64) -> Option<Clearance> {
        let Recording::PiecewiseLinear(trajectory) = self.recording else {
            return None;
        };
        let height = self.beam.height(xi);
        let mut time = from * self.model.period();
        let mut piece = trajectory.piece_at(&height, time)?;
        for _ in 0..MAX_STEPS {
            let jet = piece.signal.jet(time - piece.start);
            if jet.curvature <= 0.0 {
                return None;
            }
            let step = -jet.rate / jet.curvature;
            if step.abs() <= SAME_MOMENT * self.model.period() {
                return Some(Clearance {
                    height: jet.value,
                    xi,
                    period: time / self.model.period(),
                });
            }
            time += step;
            if time < 0.0 || time > trajectory.end() {
                return None;
            }
            if time < piece.start || time > piece.start + piece.length {
                piece = trajectory.piece_at(&height, time)?;
            }
        }
        None
    }

    /// The least height at one position.
    fn least_height(&self, xi: f64) -> Option<Clearance> {
        let least = self.recording.curve(&self.beam.height(xi)).range()?.0;
        Some(Clearance {
            height: least.value,
            xi,
            period: least.time / self.model.period(),
        })
    }

    /// The slope of the beam at its `lowest` point.
    fn slope(&self, lowest: &Clearance) -> Option<f64> {
        let time = lowest.period * self.model.period();
        let state = self.recording.state_at(time)?;
        let slopes = self.beam.modes.slopes(lowest.xi);
        Some(slopes.iter().zip(&state).map(|(slope, a)| slope * a).sum())
    }
}

/// A grid position that is not higher than its neighbours.
struct Valley {
    place: f64,
    /// Neighbouring grid positions, as fractions of the beam's length.
    low: f64,
    high: f64,
    /// Lower bound of the height in the valley.
    bound: f64,
}

/// The valleys of the least heights on the grid of positions, lowest first.
///
/// The least height over time is the lower envelope of smooth curves and is therefore smooth at its
/// minima. The parabola through a position and its neighbours, with second difference a + c − 2b,
/// goes at most (a + c − 2b)/8 below the middle one; four times that is allowed here.
fn valleys(heights: &[f64]) -> Vec<Valley> {
    let last = heights.len() - 1;
    let place = |i: usize| i as f64 / last as f64;
    let mut valleys: Vec<(f64, Valley)> = (0..=last)
        .filter_map(|i| {
            let (left, right) = (i.saturating_sub(1), (i + 1).min(last));
            let (a, b, c) = (heights[left], heights[i], heights[right]);
            (b.is_finite() && b <= a && b <= c).then(|| {
                let bound = b - 0.5 * (a + c - 2.0 * b);
                let (low, high) = (place(left), place(right));
                (
                    b,
                    Valley {
                        place: place(i).max(CLAMP),
                        low,
                        high,
                        bound,
                    },
                )
            })
        })
        .collect();
    valleys.sort_by(|a, b| a.0.total_cmp(&b.0));
    valleys.into_iter().map(|(_, valley)| valley).collect()
}

/// Largest number of periods whose least height is computed exactly, those with the lowest bounds
/// first. Motions with more such periods repeat.
const MAX_PERIODS: usize = 64;
/// Two periods are the same if their modal coordinates at the start differ by less than this,
/// relative to the largest.
const SAME: f64 = 1e-10;

/// Search for the clearance during a run.
#[derive(Clone)]
pub(super) struct ClearanceSearch {
    /// Height of the beam's end above the apex of the tip.
    above_tip: f64,
    /// Least height of the clamp.
    clamp: f64,
    bounds: Vec<RegimeBound>,
    start: Option<Start>,
    /// Bound on the contribution of the higher modes in the current period.
    higher: f64,
    periods: usize,
    /// Least height of the beam's end so far.
    end: f64,
    candidates: Vec<Candidate>,
}

/// Bounds Σ_{j≥2} c_j |a_j| in one regime.
#[derive(Clone)]
struct RegimeBound {
    /// Weights of the modal coordinates.
    weights: Vec<f64>,
    /// Bound of the response to the drive.
    response: f64,
    /// Whether the modal coordinates are simple exponentials that do not grow.
    simple: bool,
}

#[derive(Clone)]
struct Start {
    regime: usize,
    modal: Vec<Complex>,
}

#[derive(Clone)]
struct Candidate {
    /// Lower bound of the beam's height.
    bound: f64,
    period: usize,
    start: Start,
}

impl ClearanceSearch {
    /// Prepares the search for a motion of `model`; `None` if it is not a beam.
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
                        *sum += share * weight.modulus();
                    }
                    let tones: f64 = amplitude.tones.iter().map(|tone| tone.modulus()).sum();
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
            clamp: clamp.constant - clamp.tones.iter().map(|tone| tone.modulus()).sum::<f64>(),
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

    /// Ends a period with the least height `tip` of the tip.
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
        if self.candidates.len() >= 4 * MAX_PERIODS {
            self.candidates = self.lowest();
        }
        self.higher = 0.0;
        self.periods += 1;
    }

    /// The candidates that matter, lowest bounds first; of equal periods the first one.
    fn lowest(&mut self) -> Vec<Candidate> {
        let end = self.end;
        let mut all = std::mem::take(&mut self.candidates);
        all.retain(|candidate| candidate.bound <= end);
        all.sort_by(|a, b| a.bound.total_cmp(&b.bound).then(a.period.cmp(&b.period)));
        let mut kept: Vec<Candidate> = Vec::new();
        for candidate in all {
            let same = |known: &&mut Candidate| known.start.is(&candidate.start);
            if let Some(known) = kept.iter_mut().find(same) {
                if candidate.period < known.period {
                    let bound = known.bound;
                    *known = Candidate { bound, ..candidate };
                }
            } else if kept.len() < MAX_PERIODS {
                kept.push(candidate);
            }
        }
        kept
    }

    /// The clearance over the finished periods.
    pub(super) fn finish(mut self, model: &Model) -> Result<Option<Clearance>, FlowError> {
        let Some(beam) = &model.beam else {
            return Ok(None);
        };
        let mut least: Option<Clearance> = None;
        for candidate in self.lowest() {
            if least.is_some_and(|known| known.height <= candidate.bound) {
                break;
            }
            let Some(state) = candidate.start.state(model) else {
                continue;
            };
            let period = Trajectory::record(&model.system, &state, 1)?;
            let beam = RecordedBeam {
                model,
                beam,
                recording: &Recording::PiecewiseLinear(period),
            };
            let heights = least_heights(model, beam.beam, &state)?;
            let Some(here) = beam.lowest(&heights) else {
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

/// The least heights at the grid positions over one drive period from a state.
fn least_heights(model: &Model, beam: &BeamOutputs, state: &[f64]) -> Result<Vec<f64>, FlowError> {
    let count = PLACES_PER_MODE * beam.modes.count();
    let mut request = Request::new();
    let keys: Vec<_> = (0..=count)
        .map(|i| {
            let height = request.output(&beam.height(i as f64 / count as f64));
            request.add(Functional::Least(height))
        })
        .collect();
    let mut heights = Accumulator::new(&request.plan(&model.system)?);
    let mut flow = Flow::new(Arc::clone(&model.system));
    flow.start(state, 0.0)?;
    flow.run_period(&mut heights)?;
    Ok(keys.iter().map(|key| heights.values()[*key].re).collect())
}

/// Search for the clearance under a nonlinear force: grid positions are sampled at the quadrature
/// nodes of the motion, and the period with the lowest sample is searched exactly at the positions
/// that came near.
pub(super) struct SampledClearance {
    heights: Vec<nanotap_volterra::Output>,
    lowest: Option<LowestPeriod>,
}

/// The period in which the beam was lowest so far.
struct LowestPeriod {
    number: usize,
    period: nanotap_volterra::Trajectory,
    /// Least sampled height at each position.
    places: Vec<f64>,
    /// Range of the height at the lowest position.
    swing: f64,
}

impl LowestPeriod {
    fn least(&self) -> f64 {
        self.places.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// Largest error of sampled heights, as a fraction of the range.
const BETWEEN_SAMPLES: f64 = 0.01;

impl SampledClearance {
    /// Prepares the search for motions of `model`; `None` if it is not a beam.
    pub(super) fn new(model: &Model, nonlinear: &Nonlinear) -> Option<Self> {
        let beam = model.beam.as_ref()?;
        let count = PLACES_PER_MODE * beam.modes.count();
        let height = |i: usize| nonlinear.output(&beam.height(i as f64 / count as f64), 0.0);
        Some(Self {
            heights: (0..=count).map(height).collect(),
            lowest: None,
        })
    }

    /// Adds period `number` with its quadrature nodes.
    pub(super) fn period(
        &mut self,
        nonlinear: &Nonlinear,
        number: usize,
        period: &nanotap_volterra::Trajectory,
        nodes: &[nanotap_volterra::Node],
    ) {
        let range = |height: &nanotap_volterra::Output| {
            let values = nodes
                .iter()
                .map(|node| read(nonlinear, height, &node.sample));
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            })
        };
        let ranges: Vec<(f64, f64)> = self.heights.iter().map(range).collect();
        let found = LowestPeriod {
            number,
            period: period.clone(),
            places: ranges.iter().map(|r| r.0).collect(),
            swing: ranges.iter().map(|r| r.1 - r.0).fold(0.0, f64::max),
        };
        if self
            .lowest
            .as_ref()
            .is_none_or(|known| found.least() < known.least())
        {
            self.lowest = Some(found);
        }
    }

    /// The clearance over the added periods.
    pub(super) fn finish(self, model: &Model, nonlinear: &Arc<Nonlinear>) -> Option<Clearance> {
        let lowest = self.lowest?;
        let near = lowest.least() + BETWEEN_SAMPLES * lowest.swing;
        let last = lowest.places.len() - 1;
        let recording = Recording::of_periods(nonlinear, vec![lowest.period]);
        let beam = RecordedBeam {
            model,
            beam: model.beam.as_ref()?,
            recording: &recording,
        };
        let exact = |(i, sampled): (usize, &f64)| {
            if *sampled > near {
                return Some(f64::INFINITY);
            }
            Some(beam.least_height(i as f64 / last as f64)?.height)
        };
        let heights: Option<Vec<f64>> = lowest.places.iter().enumerate().map(exact).collect();
        let found = beam.lowest(&heights?)?;
        Some(Clearance {
            period: found.period + lowest.number as f64,
            ..found
        })
    }
}

impl Start {
    fn is(&self, other: &Self) -> bool {
        let size = self
            .modal
            .iter()
            .map(nalgebra::Complex::norm_sqr)
            .fold(0.0, f64::max);
        let apart = self.modal.iter().zip(&other.modal);
        self.regime == other.regime
            && apart.map(|(a, b)| (a - b).norm_sqr()).fold(0.0, f64::max) <= SAME * SAME * size
    }

    fn state(&self, model: &Model) -> Option<Vec<f64>> {
        let mut recorder = Recorder::default();
        recorder.take_stretch(self.regime, 0.0, model.period(), &self.modal);
        recorder.finish(Arc::clone(&model.system)).state_at(0.0)
    }
}

/// c_j of the bound for each mode; the first is 0.
fn shares(modes: &Modes) -> Arc<Vec<f64>> {
    static KNOWN: Mutex<BTreeMap<usize, Arc<Vec<f64>>>> = Mutex::new(BTreeMap::new());
    /// Number of positions per mode: between them a share changes by less than (π/32)²/4 of the
    /// largest deflection, 2.
    const PLACES: usize = 32;
    /// Bound of this change of a share.
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
