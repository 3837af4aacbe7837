//! The run along the path: points, extrema and energies.

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_dynamics::Control;
use nanotap_flow::Complex;

use super::Way;
use super::lever::{Lever, Signals};
use super::path::Plan;
use crate::Error;
use crate::model::MotionError;
use crate::observe::lag;

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
    /// Least height of the tip at points and ends of stretches.
    pub(super) least_gap: f64,
    /// Distance at which the tip first touches on the approach, and last on the retract.
    pub(super) contact_begin: Option<f64>,
    pub(super) contact_end: Option<f64>,
    /// Energy lost in the cycle, `−∮ F dz`.
    pub(super) energy_lost: f64,
    /// Work of adhesion, `−∫ F dz` where the force attracts on the retract.
    pub(super) adhesion_energy: f64,
    /// Energy that the tip gives to the sample.
    pub(super) dissipation: f64,
    /// Number of stretches of flow that were followed.
    pub(super) stretches: usize,
}

/// Runs along the path of a plan.
///
/// # Errors
/// When the motion cannot be followed.
pub(super) fn run(plan: &Plan<'_>, control: &Control<'_>) -> Result<Run, Error> {
    let path = &plan.path;
    let period = plan.model.period();
    // Of a cosine without a drive the force's component at its frequency is its work.
    let exact_work = !plan.driven && path.speed.is_none();
    let harmonic = if exact_work {
        path.omega
    } else {
        plan.model.frequency()
    };
    let mut lever = Lever::new(plan, exact_work.then_some(path.omega))?;
    let failed = |distance: f64| {
        let distance = distance * plan.view.scales.length;
        move |error: MotionError| {
            Error::numerics(format!("at the distance {distance:.6e} m: {error}"))
        }
    };
    for _ in 0..plan.settle {
        lever
            .advance(0.0, period, [path.from, 0.0, 0.0], path.omega, harmonic)
            .map_err(failed(path.from))?;
        if control.is_cancelled() {
            return Err(Error::stopped());
        }
    }
    let mut run = Run {
        rows: Vec::with_capacity(plan.points + 1),
        peak_force: 0.0,
        lowest: [0.0; 2],
        least_gap: f64::INFINITY,
        contact_begin: None,
        contact_end: None,
        energy_lost: 0.0,
        adhesion_energy: 0.0,
        dissipation: 0.0,
        stretches: 0,
    };
    let (mut time, mut periods) = (0.0, 0_u64);
    let mut over_period = None;
    for point in 1..=plan.points {
        let end = point as f64 * plan.step;
        while time < end {
            let start = periods as f64 * period;
            let next_period = (periods + 1) as f64 * period;
            // An end of a period that rounding alone keeps from the point is the point.
            let near = (next_period - end).abs() <= 1e-9 * period;
            let until = if near { end } else { end.min(next_period) };
            // As is a start that rounding alone keeps from that of a period.
            let phase = if time - start <= 1e-9 * period {
                0.0
            } else {
                time - start
            };
            let whole = near || until == next_period;
            let length = if whole { period - phase } else { until - time };
            let at = path.at(time);
            let sums = lever
                .advance(phase, length, at, path.omega, harmonic)
                .map_err(failed(at[0] + at[1]))?;
            let retract = path.way(time) == Way::Retract;
            // The mean of the distance's rate over the stretch, but exactly for a cosine.
            let work = if exact_work {
                let rotation = phase * path.omega;
                let (sin, cos) = nanotap_arithmetic::sin_cos(rotation);
                let rate = Complex::new(at[1], -at[2]) * Complex::new(cos, -sin);
                -(rate * Complex::new(0.0, path.omega) * sums.harmonic.conj()).re
            } else {
                let moved = match path.speed {
                    Some(speed) => (if retract { speed } else { -speed }) * length,
                    None => path.distance(until) - (at[0] + at[1]),
                };
                -sums.impulse * moved / length
            };
            run.energy_lost += work;
            if retract && sums.impulse < 0.0 {
                run.adhesion_energy += work;
            }
            run.dissipation -= sums.work;
            run.peak_force = run.peak_force.max(sums.peak);
            let lowest = &mut run.lowest[usize::from(retract)];
            *lowest = lowest.min(sums.lowest);
            if sums.contact > 0.0 {
                if !retract && run.contact_begin.is_none() {
                    run.contact_begin = Some(at[0] + at[1]);
                }
                if retract {
                    run.contact_end = Some(path.distance(until));
                }
            }
            if plan.driven && whole && phase == 0.0 {
                let (z, deflection) = lever.deflection(&sums);
                let means = Signals {
                    gap: path.distance(until) + deflection,
                    deflection,
                    force: sums.impulse / period,
                    contact: sums.contact > 0.0,
                };
                over_period = Some(([z.modulus(), lag(z)], means));
            }
            let here = lever.instant(if whole { 0.0 } else { phase + length });
            run.least_gap = run.least_gap.min(here.gap);
            run.stretches += 1;
            periods += u64::from(whole);
            time = until;
            if control.is_cancelled() {
                return Err(Error::stopped());
            }
        }
        let phase = time - periods as f64 * period;
        run.rows.push(Row {
            way: path.way(time - 0.5 * plan.step),
            time,
            distance: path.distance(time),
            signals: over_period.map_or_else(|| lever.instant(phase.max(0.0)), |(_, means)| means),
            oscillation: over_period.map(|(oscillation, _)| oscillation),
        });
        if let Some(progress) = control.progress {
            progress(point, plan.points);
        }
    }
    Ok(run)
}
