//! The run along the path: points, extrema, events and energies. All but the points follow from the
//! motion itself, whose stretches do not depend on the points.

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::Control;
use nanotap_volterra::ForceSums;

use super::Way;
use super::path::{Plan, Stretch};
use super::stretches::Lever;
use crate::moving_lever::{Signals, Sums};
use nanotap_error::Error;
use nanotap_model::MotionError;
use nanotap_observe::lag;

/// Number of instants between the turn and the end of contact to which the fits go.
const FIT_POINTS: usize = 500;

/// A point of the curve, in the model's units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) way: Way,
    pub(super) time: f64,
    pub(super) distance: f64,
    /// Means over the drive period before, of a driven lever.
    pub(super) signals: Signals,
    /// Amplitude and phase lag in degrees over the drive period before, of a driven lever.
    pub(super) oscillation: Option<[f64; 2]>,
}

/// Results of a run, in model units.
#[derive(Clone, Debug)]
pub(super) struct Run {
    pub(super) rows: Vec<Row>,
    pub(super) peak_force: f64,
    /// Lowest force of approach and of retract, at most 0.
    pub(super) lowest: [f64; 2],
    /// Least height of the tip.
    pub(super) least_gap: f64,
    /// Distance at which the tip first touches on the approach, and last on the retract.
    pub(super) contact_begin: Option<f64>,
    pub(super) contact_end: Option<f64>,
    /// Whether the tip touches at the end; of a driven lever, in the last drive period.
    pub(super) ends_in_contact: bool,
    /// Energy lost in the cycle, `−∮ F dz`.
    pub(super) energy_lost: f64,
    /// Work of adhesion, `−∫ F dz` where the force attracts on the retract; of a driven lever over
    /// the drive periods in which it does so on the mean.
    pub(super) adhesion_energy: f64,
    /// Energy that the tip gives to the sample.
    pub(super) dissipation: f64,
    /// Signals at equally spaced times between the turn and the end of contact; empty for a driven
    /// lever.
    pub(super) unloading: Vec<Signals>,
    /// Number of stretches of flow that were followed.
    pub(super) stretches: usize,
}

/// The lever on its path.
#[derive(Clone)]
struct Course<'a> {
    plan: &'a Plan<'a>,
    control: &'a Control<'a>,
    lever: Lever,
}

impl Course<'_> {
    /// Advances by a stretch at the distance `at` of [`Path::at`](super::path::Path::at).
    fn advance(&mut self, stretch: &Stretch, at: [f64; 3], times: &[f64]) -> Result<Sums, Error> {
        if self.control.is_cancelled() {
            return Err(Error::stopped());
        }
        self.lever
            .advance(stretch, at, times)
            .map_err(|error: MotionError| {
                let distance = (at[0] + at[1]) * self.plan.view.scales.length;
                Error::numerics(format!("at the distance {distance:.6e} m: {error}"))
            })
    }

    /// Settles at the first distance.
    fn settle(&mut self) -> Result<(), Error> {
        let length = self.plan.model.period();
        let period = Stretch {
            start: 0.0,
            end: length,
            phase: 0.0,
            length,
            ends_period: true,
        };
        for _ in 0..self.plan.settle {
            self.advance(&period, [self.plan.path.from, 0.0, 0.0], &[])?;
        }
        Ok(())
    }

    /// Reads the signals at equally spaced times from the turn, where the lever is, to `end`.
    fn unloading(mut self, end: f64) -> Result<Vec<Signals>, Error> {
        let turn = self.plan.path.turn;
        let time = |k: usize| turn + (end - turn) * k as f64 / (FIT_POINTS - 1) as f64;
        let mut next = 0;
        let mut signals = Vec::with_capacity(FIT_POINTS);
        for stretch in self.plan.stretches(turn) {
            let first = next;
            while next < FIT_POINTS && time(next) <= stretch.end {
                next += 1;
            }
            let times: Vec<f64> = (first..next).map(time).collect();
            let at = self.plan.path.at(stretch.start);
            signals.extend(self.advance(&stretch, at, &times)?.signals);
            if next == FIT_POINTS {
                break;
            }
        }
        Ok(signals)
    }
}

/// Runs along the path of a plan.
///
/// # Errors
/// When the motion cannot be followed.
pub(super) fn run(plan: &Plan<'_>, control: &Control<'_>) -> Result<Run, Error> {
    let path = &plan.path;
    let period = plan.model.period();
    let mut course = Course {
        plan,
        control,
        lever: Lever::new(plan)?,
    };
    course.settle()?;
    let mut run = Run {
        rows: Vec::with_capacity(2 * plan.points),
        peak_force: 0.0,
        lowest: [0.0; 2],
        least_gap: f64::INFINITY,
        contact_begin: None,
        contact_end: None,
        ends_in_contact: false,
        energy_lost: 0.0,
        adhesion_energy: 0.0,
        dissipation: 0.0,
        unloading: Vec::new(),
        stretches: 0,
    };
    let total = 2 * plan.points;
    let mut points = plan.times().peekable();
    let mut at_turn = None;
    let mut unloaded_at = None;
    // Force over the drive period so far, of a driven lever.
    let mut so_far = ForceSums::default();
    for stretch in plan.stretches(0.0) {
        let retract = path.way(stretch.start) == Way::Retract;
        if retract && at_turn.is_none() && !plan.driven {
            at_turn = Some(course.clone());
        }
        let mut times = Vec::new();
        while let Some(time) = points.next_if(|time| *time <= stretch.end * (1.0 + 1e-12)) {
            times.push(time);
        }
        let read = if plan.driven { &[] } else { &times[..] };
        let sums = course.advance(&stretch, path.at(stretch.start), read)?;
        run.add(&sums, retract, plan.driven);
        if let Some(touch) = sums.surface.touch {
            let [first, last] = touch.map(|time| stretch.start + (time - stretch.phase));
            if !retract && run.contact_begin.is_none() {
                run.contact_begin = Some(path.distance(first));
            }
            if retract {
                unloaded_at = Some(last);
                run.contact_end = Some(path.distance(last));
            }
        }
        let end = stretch.phase + stretch.length;
        run.ends_in_contact = sums
            .surface
            .touch
            .is_some_and(|[_, last]| plan.driven || last >= end * (1.0 - 1e-12));
        let mut signals = sums.signals;
        let mut oscillation = None;
        if plan.driven {
            if stretch.phase == 0.0 {
                so_far = ForceSums::default();
            }
            so_far.impulse += sums.force.impulse;
            so_far.harmonic += sums.force.harmonic;
            so_far.contact += sums.force.contact;
            if stretch.ends_period {
                let (z, deflection) = course.lever.deflection(&so_far);
                oscillation = Some([z.modulus(), lag(z)]);
                signals = vec![Signals {
                    gap: path.distance(stretch.end) + deflection,
                    deflection,
                    force: so_far.impulse / period,
                    contact: so_far.contact > 0.0,
                }];
            }
        }
        for (time, signals) in times.into_iter().zip(signals) {
            run.rows.push(Row {
                // The point at the turn ends the approach.
                way: if retract { Way::Retract } else { Way::Approach },
                time,
                distance: path.distance(time),
                signals,
                oscillation,
            });
            if let Some(progress) = control.progress {
                progress(run.rows.len(), total);
            }
        }
    }
    if let (Some(course), Some(end)) = (at_turn, unloaded_at) {
        run.unloading = course.unloading(end)?;
    }
    Ok(run)
}

impl Run {
    /// Adds a stretch of the approach or retract.
    fn add(&mut self, sums: &Sums, retract: bool, driven: bool) {
        let (force, surface) = (&sums.force, &sums.surface);
        self.stretches += 1;
        self.peak_force = self.peak_force.max(force.peak);
        let lowest = &mut self.lowest[usize::from(retract)];
        *lowest = lowest.min(force.lowest);
        self.least_gap = self.least_gap.min(surface.least_gap);
        self.dissipation -= force.work;
        self.energy_lost -= surface.work;
        if retract {
            self.adhesion_energy -= match driven {
                true if force.impulse < 0.0 => surface.work,
                true => 0.0,
                false => surface.attracted_work,
            };
        }
    }
}
