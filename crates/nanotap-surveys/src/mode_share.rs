//! Which modes matter: what an experimenter reads with N = 1 … K modes, and the part that
//! each mode has in a motion's energy, in its tip signal and in the work of the contact.

use nanotap_flow::Output;
use schemars::JsonSchema;
use serde::Serialize;

use nanotap_case::units::NumbersInSi;
use nanotap_model::Model;
use nanotap_model::recording::Recording;
use nanotap_motions::orbit::OrbitReport;
use nanotap_observe::frame::rows;

rows! {
    in model_unit
    /// Instrument readings of an orbit, in the model's units.
    #[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
    pub struct Reading {
        /// Amplitude A at the drive frequency, in the model's unit of length.
        pub first_harmonic: f64 = Length, "amplitude $A$", "A", Quantity([5, 4]),
        /// Phase lag of the tip behind the drive, degrees.
        pub phase: f64 = Angle, "phase lag", "phase", Digits(5),
        /// Energy E_dis dissipated in the sample per drive period, in the model's unit of energy.
        pub dissipation: f64 = Energy, "dissipation $E_{dis}$", "E_dis", Quantity([5, 4]),
        /// Largest force F_max of the sample on the tip, in the model's unit of force.
        pub peak_force: f64 = Force, "peak force $F_{max}$", "F_max", Quantity([5, 4]),
        /// The same in SI, for a physical case.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub physical: Option<NumbersInSi>,
    }
}

/// Differences of a reading to that with the most modes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ReadingDifference {
    /// Difference of the amplitude A, as a fraction of A with the most modes.
    pub first_harmonic: f64,
    /// Difference of the phase, degrees in 0 … 180.
    #[schemars(extend("x-unit" = "degree"))]
    pub phase: f64,
    /// Difference of the dissipated energy E_dis, as a fraction of E_dis with the most modes.
    pub dissipation: f64,
    /// Difference of the peak force F_max, as a fraction of F_max with the most modes.
    pub peak_force: f64,
}

/// The least numbers of modes from which on a reading stays within the tolerance; `None` where the
/// computed modes do not show it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct EnoughReadings {
    /// Least number of modes for the amplitude A.
    pub first_harmonic: Option<usize>,
    /// Least number of modes for the phase, whose difference in radians is compared with the
    /// tolerance.
    pub phase: Option<usize>,
    /// Least number of modes for the dissipated energy E_dis.
    pub dissipation: Option<usize>,
    /// Least number of modes for the peak force F_max.
    pub peak_force: Option<usize>,
    /// Least number of modes for all four readings.
    pub all: Option<usize>,
}

/// The part of one mode in the motion with the most modes. The parts of all modes sum to 1;
/// those in the tip signal and in the force may be negative, where a mode works against the
/// others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ModeShare {
    /// Number of the mode, from 1.
    pub mode: usize,
    /// Part in the time mean of the modes' kinetic and elastic energy, ½ȧ² + ½β⁴a², 0 to 1.
    pub energy: f64,
    /// Part in the variance of the tip deflection: ⟨(W_j − ⟨W_j⟩) W⟩ over that of W, with W_j =
    /// φ_j(1) a_j, dimensionless.
    pub tip: f64,
    /// Part in ⟨F (W − ⟨W⟩)⟩, the covariance of tip motion and contact force, dimensionless;
    /// `None` without contact.
    pub force: Option<f64>,
}

/// Which modes matter for what an experimenter reads.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ReadingsReport {
    /// Readings with each number of modes, from 1; null where no orbit was found.
    pub readings: Vec<Option<Reading>>,
    /// Differences of these readings to those with the most modes; null where the motion is of
    /// another kind.
    pub reading_differences: Vec<Option<ReadingDifference>>,
    /// The least numbers of modes that are enough.
    pub enough_readings: EnoughReadings,
    /// The part of each mode, with the most modes.
    pub mode_shares: Vec<ModeShare>,
    /// Verdict on the readings and on which modes matter, in words.
    pub reading_verdict: String,
}

impl ReadingsReport {
    /// Compares the orbits with 1, 2 … modes, where they were found, and their models.
    pub(crate) fn of(orbits: &[Option<OrbitReport>], models: &[Model], tolerance: f64) -> Self {
        let readings: Vec<Option<Reading>> =
            orbits.iter().map(|o| o.as_ref().map(reading)).collect();
        let best = orbits.last().and_then(Option::as_ref);
        let differences: Vec<Option<ReadingDifference>> = orbits
            .iter()
            .map(|o| {
                let (o, best) = (o.as_ref()?, best?);
                (o.period == best.period).then(|| difference(&reading(o), &reading(best)))
            })
            .collect();
        let enough = EnoughReadings::of(&differences, tolerance);
        let shares = best
            .zip(models.last())
            .map_or_else(Vec::new, |(orbit, model)| shares(model, &orbit.trajectory));
        let verdict = verdict(&enough, best.is_some(), &shares, orbits.len(), tolerance);
        Self {
            readings,
            reading_differences: differences,
            enough_readings: enough,
            mode_shares: shares,
            reading_verdict: verdict,
        }
    }
}

fn reading(orbit: &OrbitReport) -> Reading {
    let o = &orbit.observables;
    Reading {
        first_harmonic: o.first_harmonic,
        phase: o.phase,
        dissipation: o.dissipation,
        peak_force: o.peak_force,
        physical: None,
    }
}

fn difference(of: &Reading, to: &Reading) -> ReadingDifference {
    // 0 vs 0: the relative difference is 0.
    let part = |a: f64, b: f64| {
        let apart = (a - b).abs();
        if apart == 0.0 { 0.0 } else { apart / b.abs() }
    };
    let turn = (of.phase - to.phase).rem_euclid(360.0);
    ReadingDifference {
        first_harmonic: part(of.first_harmonic, to.first_harmonic),
        phase: turn.min(360.0 - turn),
        dissipation: part(of.dissipation, to.dissipation),
        peak_force: part(of.peak_force, to.peak_force),
    }
}

impl EnoughReadings {
    fn of(differences: &[Option<ReadingDifference>], tolerance: f64) -> Self {
        let from = |within: &dyn Fn(&ReadingDifference) -> bool| {
            let first = differences
                .iter()
                .rposition(|d| !d.as_ref().is_some_and(within))
                .map_or(0, |last| last + 1);
            // The last entry is the reference itself and proves nothing.
            (first + 1 < differences.len()).then_some(first + 1)
        };
        let amplitude = |d: &ReadingDifference| d.first_harmonic <= tolerance;
        let phase = |d: &ReadingDifference| d.phase.to_radians() <= tolerance;
        let dissipation = |d: &ReadingDifference| d.dissipation <= tolerance;
        let force = |d: &ReadingDifference| d.peak_force <= tolerance;
        Self {
            first_harmonic: from(&amplitude),
            phase: from(&phase),
            dissipation: from(&dissipation),
            peak_force: from(&force),
            all: from(&|d| amplitude(d) && phase(d) && dissipation(d) && force(d)),
        }
    }
}

/// The part of each mode in an orbit.
fn shares(model: &Model, recording: &Recording) -> Vec<ModeShare> {
    let Some(beam) = &model.beam else {
        return Vec::new();
    };
    let duration = recording.end();
    let (dimension, tones) = (model.dimension(), model.tip.tones.len());
    let entry = |k: usize, weight: f64| {
        let mut row = nalgebra::RowDVector::zeros(dimension);
        row[k] = weight;
        recording.curve(&Output::linear(row, tones))
    };
    let tip = recording.curve(&model.tip);
    let force = recording.force(model);
    let (tip_mean, force_mean) = (tip.mean(), force.mean());
    let n = beam.modes.count();
    let parts: Vec<[f64; 3]> = (0..n)
        .map(|j| {
            let (displacement, rate) = (entry(j, 1.0), entry(n + j, 1.0));
            let energy = 0.5
                * (rate.product_integral(&rate)
                    + beam.modes.stiffness[j] * displacement.product_integral(&displacement));
            let signal = entry(j, beam.modes.tip[j]);
            let mean = signal.mean();
            let tip_part = signal.product_integral(&tip) / duration - mean * tip_mean;
            let force_part = signal.product_integral(&force) / duration - mean * force_mean;
            [energy, tip_part, force_part]
        })
        .collect();
    let total = |k: usize| parts.iter().map(|p| p[k]).sum::<f64>();
    let (energy, variance, work) = (total(0), total(1), total(2));
    let part = |value: f64, whole: f64| if whole == 0.0 { 0.0 } else { value / whole };
    parts
        .iter()
        .enumerate()
        .map(|(j, p)| ModeShare {
            mode: j + 1,
            energy: part(p[0], energy),
            tip: part(p[1], variance),
            force: (work != 0.0).then(|| p[2] / work),
        })
        .collect()
}

/// Fraction of the energy from which on the verdict names a mode.
const NAMED: f64 = 0.01;

fn verdict(
    enough: &EnoughReadings,
    found: bool,
    shares: &[ModeShare],
    largest: usize,
    tolerance: f64,
) -> String {
    if !found {
        return format!(
            "undecided: with {largest} modes the motion is no orbit, so that there are no single \
             readings to compare"
        );
    }
    let percent = 100.0 * tolerance;
    let named: Vec<String> = shares
        .iter()
        .filter(|s| s.energy >= NAMED)
        .map(|s| format!("{} ({:.1} %)", s.mode, 100.0 * s.energy))
        .collect();
    let carry = format!("the energy is in mode {}", named.join(", "));
    let one = |n: Option<usize>| n.map_or_else(|| "more".to_owned(), |n| n.to_string());
    let each = format!(
        "A needs {}, the phase {}, E_dis {}, F_max {}",
        one(enough.first_harmonic),
        one(enough.phase),
        one(enough.dissipation),
        one(enough.peak_force)
    );
    match enough.all {
        Some(n) => {
            let noun = if n == 1 { "mode keeps" } else { "modes keep" };
            format!("{n} {noun} all readings within {percent} % ({each}); {carry}")
        }
        None => format!(
            "{largest} modes are not shown to keep all readings within {percent} % ({each}): take \
             more; {carry}"
        ),
    }
}
