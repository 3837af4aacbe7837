//! The energy balance of a motion: what the drive feeds in is what the dampers take
//! and what is stored. Over a period of a periodic orbit it closes to rounding, a
//! check of the whole computation.

use nanotap_flow::Trajectory;
use nanotap_flow::trajectory::Segment;
use serde::Serialize;

use crate::model::{Model, Product};

/// Energies over a recording, in the model's own units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EnergyBalance {
    /// Work of the drive.
    pub drive_work: f64,
    /// Taken by the beam's own damping.
    pub beam_damping: f64,
    /// Taken by the sample: its damping, or the impacts of a rigid stop.
    pub sample_damping: f64,
    /// Gain of stored (kinetic and elastic) energy; zero over a period of an orbit.
    pub stored: f64,
    /// What does not add up, as a part of the energy that was moved.
    pub residual: f64,
    #[serde(skip)]
    moved: f64,
}

impl EnergyBalance {
    /// The balance of `trajectory`, a recording of `model`.
    pub fn of(model: &Model, trajectory: &Trajectory) -> Self {
        let work = |select| work(model, trajectory, select);
        let drive_work = work(|p| &p.drive);
        let beam_damping = work(|p| &p.beam);
        let sample_damping = Self::sample_work(model, trajectory);
        let ends = trajectory
            .segments()
            .first()
            .zip(trajectory.segments().last());
        let (start, end) = ends.map_or((0.0, 0.0), |(first, last)| {
            (
                stored(model, trajectory, first, first.start),
                stored(model, trajectory, last, last.start + last.length),
            )
        });
        // Signed works cancel; the damping and the stored energy say how much moved.
        let moved = drive_work.abs() + beam_damping + sample_damping + (end - start).abs();
        Self::closed(drive_work, beam_damping, sample_damping, end - start, moved)
    }

    /// What the sample alone takes: its damping, and the impacts of a rigid stop.
    pub fn sample_work(model: &Model, trajectory: &Trajectory) -> f64 {
        let impacts: f64 = trajectory
            .events()
            .iter()
            .filter(|e| e.from == 0)
            .map(|e| e.rate * e.rate)
            .sum();
        work(model, trajectory, |p| &p.sample) + model.impact_loss * impacts
    }

    fn closed(
        drive_work: f64,
        beam_damping: f64,
        sample_damping: f64,
        stored: f64,
        moved: f64,
    ) -> Self {
        let rest = drive_work - beam_damping - sample_damping - stored;
        let residual = if moved > 0.0 { rest / moved } else { 0.0 };
        Self {
            drive_work,
            beam_damping,
            sample_damping,
            stored,
            residual,
            moved,
        }
    }

    /// The balance of this stretch and the next together.
    #[must_use]
    pub fn joined(&self, next: &Self) -> Self {
        Self::closed(
            self.drive_work + next.drive_work,
            self.beam_damping + next.beam_damping,
            self.sample_damping + next.sample_damping,
            self.stored + next.stored,
            self.moved + next.moved,
        )
    }
}

/// The integral of a sum of products.
fn work(
    model: &Model,
    trajectory: &Trajectory,
    select: fn(&crate::model::Powers) -> &[Product],
) -> f64 {
    let count = model
        .power()
        .iter()
        .map(|p| select(p).len())
        .max()
        .unwrap_or(0);
    (0..count)
        .map(|i| product_work(model, trajectory, select, i))
        .sum()
}

/// The integral of the `i`-th product of a sum, which may differ from regime to regime
/// (and be missing in some).
fn product_work(
    model: &Model,
    trajectory: &Trajectory,
    select: fn(&crate::model::Powers) -> &[Product],
    i: usize,
) -> f64 {
    let zero = model.tip.scaled(0.0);
    let weighted: Vec<_> = model
        .power()
        .iter()
        .map(|p| {
            select(p)
                .get(i)
                .map_or_else(|| zero.clone(), |p| p.a.scaled(p.weight))
        })
        .collect();
    let other: Vec<_> = model
        .power()
        .iter()
        .map(|p| {
            select(p)
                .get(i)
                .map_or_else(|| zero.clone(), |p| p.b.clone())
        })
        .collect();
    trajectory
        .signal_by_regime(&weighted)
        .product_integral(&trajectory.signal_by_regime(&other))
}

fn stored(model: &Model, trajectory: &Trajectory, segment: &Segment, time: f64) -> f64 {
    let drive = model.system.drive();
    let phase = segment.phase + (time - segment.start);
    let Some(state) = trajectory.state_at(time) else {
        return 0.0;
    };
    model.power()[segment.regime]
        .stored
        .iter()
        .map(|p| p.weight * p.a.at(drive, &state, phase) * p.b.at(drive, &state, phase))
        .sum()
}
