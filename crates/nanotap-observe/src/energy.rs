//! The energy balance of a motion: the work of the drive equals the losses of the dampers plus the
//! gain of stored energy. Over a period of a periodic orbit it closes to rounding, which checks the
//! whole computation.

use nanotap_flow::flow::SegmentView;
use nanotap_flow::trajectory::Recorder;
use nanotap_flow::{Complex, Output};
use schemars::JsonSchema;
use serde::Serialize;

use super::number::Number;
use nanotap_model::nonlinear::Nonlinear;
use nanotap_model::{Model, ModelTangent, Powers, Product};

/// Energies over a recording, in the model's units (EI g₀²/L³ for a beam) or in J.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct EnergyBalance<D = f64> {
    /// Work that the drive does over the recording.
    pub drive_work: D,
    /// Loss in the beam's damping.
    pub beam_damping: D,
    /// Loss in the sample's damping, or in the impacts on a rigid stop, without energy that the
    /// sample stores and returns.
    pub sample_damping: D,
    /// Gain of stored (kinetic and elastic) energy; zero over a period of an orbit.
    pub stored: D,
    /// Imbalance of the energies, relative to the energy converted, dimensionless.
    #[schemars(extend("x-unit" = "1"))]
    pub residual: D,
}

impl EnergyBalance {
    /// The balance of an unmeasured motion: every field is NaN.
    pub(super) const UNKNOWN: Self = Self {
        drive_work: f64::NAN,
        beam_damping: f64::NAN,
        sample_damping: f64::NAN,
        stored: f64::NAN,
        residual: f64::NAN,
    };

    /// The balance of this motion and the next one, which goes on where this one ends.
    #[must_use]
    pub fn followed_by(&self, next: &Self) -> Self {
        balance(
            self.drive_work + next.drive_work,
            self.beam_damping + next.beam_damping,
            self.sample_damping + next.sample_damping,
            self.stored + next.stored,
        )
    }

    /// An energy of the balance, or 0 if it is not above the error of the balance: its imbalance, which
    /// is that of the quadratures, and the rounding of the largest term.
    pub fn resolved(&self, energy: f64) -> f64 {
        /// Rounding of the sums over a recording, relative to the energy converted.
        const ROUNDING: f64 = 1e-12;
        let moved = self.drive_work.abs().max(self.beam_damping.abs());
        let error = moved * self.residual.abs().max(ROUNDING);
        if energy.abs() <= error { 0.0 } else { energy }
    }
}

impl<D: Copy> EnergyBalance<D> {
    /// Combines every energy with that of another balance.
    pub(super) fn with<E: Copy, F>(
        self,
        other: EnergyBalance<E>,
        residual: F,
        energy: impl Fn(D, E) -> F,
    ) -> EnergyBalance<F> {
        EnergyBalance {
            drive_work: energy(self.drive_work, other.drive_work),
            beam_damping: energy(self.beam_damping, other.beam_damping),
            sample_damping: energy(self.sample_damping, other.sample_damping),
            stored: energy(self.stored, other.stored),
            residual,
        }
    }
}

/// The balance of these energies; the last one is the gain of stored energy.
pub(super) fn balance<D: Number>(
    drive_work: D,
    beam_damping: D,
    sample_damping: D,
    stored: D,
) -> EnergyBalance<D> {
    // Works of both signs cancel; damping and stored energy measure the conversion.
    let (drive, gain) = (drive_work.value().abs(), stored.value().abs());
    let moved = drive + beam_damping.value() + sample_damping.value() + gain;
    let rest = drive_work - beam_damping - sample_damping - stored;
    EnergyBalance {
        drive_work,
        beam_damping,
        sample_damping,
        stored,
        residual: if moved > 0.0 {
            rest / moved
        } else {
            D::default()
        },
    }
}

/// A factor of one product in a sum that is a power.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PowerTerm {
    sum: Sum,
    index: usize,
    second: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sum {
    Drive,
    Beam,
    Sample,
}

impl Sum {
    fn products(self, powers: &Powers) -> &[Product] {
        match self {
            Self::Drive => &powers.drive,
            Self::Beam => &powers.beam,
            Self::Sample => &powers.sample,
        }
    }
}

impl PowerTerm {
    /// Returns the terms of the power that the drive delivers.
    pub(super) fn of_drive(model: &Model) -> Vec<Self> {
        Self::all(model, Sum::Drive)
    }

    /// Returns the terms of the power lost in the beam's damping.
    pub(super) fn of_beam(model: &Model) -> Vec<Self> {
        Self::all(model, Sum::Beam)
    }

    /// Returns the terms of the power lost in the sample's damping.
    pub(super) fn of_sample(model: &Model) -> Vec<Self> {
        Self::all(model, Sum::Sample)
    }

    /// The first factors of a sum; the sums of regimes may differ in length.
    fn all(model: &Model, sum: Sum) -> Vec<Self> {
        let lengths = model.power().iter().map(|p| sum.products(p).len());
        let first = |index| Self {
            sum,
            index,
            second: false,
        };
        (0..lengths.max().unwrap_or(0)).map(first).collect()
    }

    /// Returns the other factor of the same product.
    pub(super) const fn other(self) -> Self {
        Self {
            second: !self.second,
            ..self
        }
    }

    /// The factor in each regime; zero if the regime has no such product. The first one carries the
    /// weight.
    pub(super) fn outputs(self, model: &Model) -> Vec<Output> {
        let factor = |powers: &Powers| match self.sum.products(powers).get(self.index) {
            None => model.tip.scaled(0.0),
            Some(product) if self.second => product.b.clone(),
            Some(product) => product.a.scaled(product.weight),
        };
        model.power().iter().map(factor).collect()
    }

    /// Derivative of [`PowerTerm::outputs`] for the loss in the beam's damping.
    pub(super) fn changes(self, model: &Model, tangent: &ModelTangent) -> Vec<Output> {
        let factors = tangent.beam_power.get(self.index);
        let change = match factors.filter(|_| self.sum == Sum::Beam) {
            None => model.tip.scaled(0.0),
            Some(factors) => factors[usize::from(self.second)].clone(),
        };
        vec![change; model.system.regimes().len()]
    }

    /// Contribution of a nonlinear law's force to the factor: the clamp, whose force is the first
    /// factor of the drive's first product, also carries the force of the sample.
    pub(super) fn force_part(self, nonlinear: &Nonlinear) -> f64 {
        let clamp = Self {
            sum: Sum::Drive,
            index: 0,
            second: false,
        };
        if self == clamp {
            nonlinear.clamp_force
        } else {
            0.0
        }
    }
}

/// Energy stored in the lever for a state at a drive phase (as a time).
pub(super) fn stored_by_lever(model: &Model, state: &[f64], phase: f64) -> f64 {
    let powers = model.power().first();
    powers.map_or(0.0, |powers| total(&powers.stored, model, state, phase))
}

/// Energy stored in the sample for a state at a drive phase (as a time) in a regime.
pub(super) fn stored_by_sample(model: &Model, regime: usize, state: &[f64], phase: f64) -> f64 {
    let powers = &model.power()[regime].stored_by_sample;
    total(powers, model, state, phase)
}

/// The drive phase (as a time) at the end of a period: 0 again, but where the tones do not repeat.
pub(super) fn end_phase(model: &Model) -> f64 {
    let drive = model.system.drive();
    if drive.repeats() { 0.0 } else { drive.period() }
}

/// Sum of products for a state at a drive phase (as a time).
fn total(products: &[Product], model: &Model, state: &[f64], phase: f64) -> f64 {
    let at = |output: &Output| output.at(model.system.drive(), state, phase);
    let values = products.iter().map(|p| p.weight * at(&p.a) * at(&p.b));
    values.sum()
}

/// The first and the last segment of a motion.
#[derive(Clone, Default)]
pub(super) struct Ends {
    first: Option<Stretch>,
    last: Stretch,
}

#[derive(Clone, Default)]
struct Stretch {
    regime: usize,
    phase: f64,
    length: f64,
    modal: Vec<Complex>,
}

impl Stretch {
    fn take(&mut self, segment: &SegmentView<'_>) {
        self.regime = segment.regime;
        self.phase = segment.phase;
        self.length = segment.length;
        self.modal.clear();
        self.modal.extend_from_slice(segment.modal);
    }

    /// Energy stored at time `s` in the segment.
    fn stored(&self, model: &Model, s: f64) -> f64 {
        let mut recorder = Recorder::default();
        recorder.take_stretch(self.regime, self.phase, self.length, &self.modal);
        let stretch = recorder.finish(std::sync::Arc::clone(&model.system));
        let Some(state) = stretch.state_at(self.phase + s) else {
            return 0.0;
        };
        let powers = &model.power()[self.regime];
        [&powers.stored, &powers.stored_by_sample]
            .map(|products| total(products, model, &state, self.phase + s))
            .iter()
            .sum()
    }
}

impl Ends {
    pub(super) fn segment(&mut self, segment: &SegmentView<'_>) {
        if segment.length > 0.0 {
            self.last.take(segment);
            if self.first.is_none() {
                self.first = Some(self.last.clone());
            }
        }
    }

    /// Gain of stored energy over the motion.
    pub(super) fn gain(&self, model: &Model) -> f64 {
        self.first.as_ref().map_or(0.0, |first| {
            self.last.stored(model, self.last.length) - first.stored(model, 0.0)
        })
    }
}
