//! The stable states of a case over the amplitudes of an image: phase and distance of each.

use nanotap_case::Case;
use nanotap_case::quantity::Kind;
use nanotap_dynamics::Control;
use nanotap_error::Error;
use nanotap_fit::fit::instrument::wrapped;
use nanotap_motions::setpoint::{NearOrbit, SetpointSolution, orbit_at_setpoint, solve_setpoint};

/// Step of the amplitude from orbit to orbit, over the free amplitude.
const STEP: f64 = 0.01;
/// Shortest step with which the end of a state is looked for, over the free amplitude.
const SHORTEST: f64 = 0.002;
/// Amplitudes around the setpoint that are always followed, over the free amplitude.
const LEAST_RANGE: f64 = 0.02;
/// Least and largest amplitude at which states are looked for, over the free amplitude.
const ENDS: [f64; 2] = [0.02, 0.995];

/// A stable state over the amplitude.
#[derive(Clone, Debug)]
pub(super) struct StateCurve {
    /// `attractive` or `repulsive` by the mean force at the setpoint, with a number if there are several.
    pub(super) name: String,
    /// Number of the material: 0 is the case's own sample.
    pub(super) material: usize,
    /// Distance at the setpoint, m.
    pub(super) distance: f64,
    /// Phase lag at the setpoint, degrees.
    pub(super) phase: f64,
    /// Peak force at the setpoint, N.
    pub(super) peak_force: f64,
    /// Amplitude (m), phase lag (degrees, without jumps) and distance (m), by rising amplitude.
    points: Vec<[f64; 3]>,
}

/// A state at an amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct At {
    /// Phase lag, degrees.
    pub(super) phase: f64,
    /// Change of the phase with the amplitude, degrees/m.
    pub(super) slope: f64,
    /// Distance, m.
    pub(super) distance: f64,
}

impl StateCurve {
    /// The amplitudes at which the state exists, m.
    pub(super) fn range(&self) -> [f64; 2] {
        [self.points[0][0], self.points[self.points.len() - 1][0]]
    }

    /// The state at an amplitude, which may be outside of its range by `margin`, m.
    pub(super) fn at(&self, amplitude: f64, margin: f64) -> Option<At> {
        let [low, high] = self.range();
        if !(amplitude >= low - margin && amplitude <= high + margin) {
            return None;
        }
        let inside = amplitude.clamp(low, high);
        let next = self.points.partition_point(|point| point[0] < inside);
        let next = next.clamp(1, self.points.len() - 1);
        let [[a, phase, distance], [b, next_phase, next_distance]] =
            [self.points[next - 1], self.points[next]];
        let share = (inside - a) / (b - a);
        Some(At {
            phase: phase + share * (next_phase - phase),
            slope: (next_phase - phase) / (b - a),
            distance: distance + share * (next_distance - distance),
        })
    }
}

/// The stable states of cases above several materials; the warnings. See [`states_above`].
///
/// # Errors
/// When there is no state above the first material, or the work was cancelled.
pub(super) fn state_curves(
    materials: &[Case],
    free_amplitude: f64,
    range: [f64; 2],
    control: &Control<'_>,
) -> Result<(Vec<StateCurve>, Vec<String>), Error> {
    let (mut curves, mut warnings) = (Vec::new(), Vec::new());
    for (material, case) in materials.iter().enumerate() {
        let missing = |reason: &str| {
            let of = if materials.len() > 1 {
                format!(" above material {}", material + 1)
            } else {
                String::new()
            };
            format!("states of the case{of} may be missing: {reason}")
        };
        match states_above(case, free_amplitude, range, control) {
            Ok((found, budget)) => {
                curves.extend(found.into_iter().map(|curve| StateCurve {
                    name: if materials.len() > 1 {
                        format!("{}, material {}", curve.name, material + 1)
                    } else {
                        curve.name
                    },
                    material,
                    ..curve
                }));
                warnings.extend(budget.map(|budget| missing(&budget)));
            }
            Err(error) if material == 0 || control.is_cancelled() => return Err(error),
            Err(error) => warnings.push(missing(&error.message())),
        }
    }
    Ok((curves, warnings))
}

/// The stable states of a case at its setpoint of the amplitude, each followed over a range of
/// amplitudes, m, as far as it exists.
fn states_above(
    case: &Case,
    free_amplitude: f64,
    range: [f64; 2],
    control: &Control<'_>,
) -> Result<(Vec<StateCurve>, Option<String>), Error> {
    let found = solve_setpoint(case, control)?;
    let stable: Vec<&SetpointSolution> = found.solutions.iter().filter(|s| s.stable).collect();
    let mut curves: Vec<StateCurve> = Vec::with_capacity(stable.len());
    for (k, solution) in stable.iter().enumerate() {
        if let Some(progress) = control.progress {
            progress(k, stable.len());
        }
        let ratio = found.ratio;
        let low = (range[0] / free_amplitude)
            .min(ratio - LEAST_RANGE)
            .max(ENDS[0]);
        let high = (range[1] / free_amplitude)
            .max(ratio + LEAST_RANGE)
            .min(ENDS[1]);
        let mut points: Vec<[f64; 3]> = vec![point(solution)];
        for end in [high, low] {
            follow(case, solution, (ratio, end), control, &mut points);
        }
        if control.is_cancelled() {
            return Err(Error::stopped());
        }
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points.dedup_by(|a, b| a[0] <= b[0]);
        if points.len() < 2 {
            continue;
        }
        let mut last = points[0][1];
        for point in &mut points {
            point[1] = last + wrapped(point[1] - last);
            last = point[1];
        }
        let same = curves
            .iter()
            .filter(|of| of.name.starts_with(solution.branch));
        let name = match same.count() {
            0 => solution.branch.to_owned(),
            others => format!("{} {}", solution.branch, others + 1),
        };
        curves.push(StateCurve {
            name,
            material: 0,
            distance: solution.zc,
            phase: solution.observables.phase,
            peak_force: solution.physical.observables.peak_force,
            points,
        });
    }
    if curves.is_empty() {
        return Err(Error::numerics(
            "no state of the case at the setpoint is stable: change the setpoint",
        ));
    }
    Ok((curves, found.budget))
}

fn point(solution: &SetpointSolution) -> [f64; 3] {
    [
        solution.physical.observables.first_harmonic,
        solution.observables.phase,
        solution.zc,
    ]
}

/// Follows a state from one amplitude to another, both over the free amplitude, as far as it exists.
fn follow(
    case: &Case,
    from: &SetpointSolution,
    (mut ratio, end): (f64, f64),
    control: &Control<'_>,
    points: &mut Vec<[f64; 3]>,
) {
    let near = |solution: &SetpointSolution| NearOrbit {
        gap: solution.gap,
        period: solution.period,
        state: solution.state.clone(),
        stable: true,
    };
    let mut last = near(from);
    let mut step = STEP;
    while (end - ratio).abs() > 1e-9 && step >= SHORTEST && !control.is_cancelled() {
        let next = ratio + (end - ratio).clamp(-step, step);
        match orbit_at_setpoint(&case.with_setpoint(next, Kind::Number), &last) {
            Ok(found) if found.stable => {
                ratio = next;
                points.push(point(&found));
                last = near(&found);
            }
            _ => step *= 0.5,
        }
    }
}
