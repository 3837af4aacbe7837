//! The signals of a motion and the functionals from which observables are computed.

use nanotap_flow::{Output, accumulate};

use super::energy::PowerTerm;
use super::measured::Measured;
use super::table::{ObservableSet, Observables};
use nanotap_model::Model;
use nanotap_model::nonlinear::Nonlinear;

/// A functional of signals, at frequencies of the drive if it has one.
pub(super) type Functional = accumulate::Functional<Signal, Tone>;

/// A scalar along a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Signal {
    /// Tip deflection W relative to the base.
    Tip,
    /// Height V_T of the tip above the undeformed surface.
    Height,
    /// Rate V̇_T of the tip's height over the undeformed surface.
    HeightRate,
    /// Force of the sample on the tip.
    Force,
    /// Force of the sample on the tip while both touch, else 0.
    ContactForce,
    /// Slope at the tip; 0 for an oscillator.
    Slope,
    /// A factor of a power.
    Power(PowerTerm),
}

impl Signal {
    /// Returns the factor with which a nonlinear law's force enters the signal, in addition to its
    /// output; dimensionless.
    pub(super) fn force_part(self, nonlinear: &Nonlinear) -> f64 {
        match self {
            Self::Force | Self::ContactForce => 1.0,
            Self::Power(term) => term.force_part(nonlinear),
            _ => 0.0,
        }
    }

    /// Whether a signal is 0 unless tip and sample touch.
    pub(super) const fn is_of_contact(self) -> bool {
        matches!(self, Self::ContactForce)
    }

    /// The signal as outputs of the state, one per regime.
    pub(super) fn outputs(self, model: &Model) -> Vec<Output> {
        let same = |output: &Output| vec![output.clone(); model.system.regimes().len()];
        match self {
            Self::Tip => same(&model.tip),
            Self::Height => same(&model.height),
            Self::HeightRate => {
                let drive = model.system.drive();
                let rate =
                    |r: &nanotap_flow::Regime| model.height.rate(r.matrix(), r.forcing(), drive);
                model.system.regimes().iter().map(rate).collect()
            }
            Self::Force => model.force.clone(),
            Self::ContactForce => in_contact(model, &model.force),
            Self::Slope => same(
                &model
                    .beam
                    .as_ref()
                    .map_or_else(|| model.tip.scaled(0.0), |beam| beam.slope.clone()),
            ),
            Self::Power(term) => term.outputs(model),
        }
    }
}

/// Outputs, one per regime, that are 0 unless tip and sample touch.
pub(super) fn in_contact(model: &Model, outputs: &[Output]) -> Vec<Output> {
    let each = outputs.iter().zip(&model.contact);
    let masked = each.map(|(output, touches)| output.scaled(f64::from(u8::from(*touches))));
    masked.collect()
}

/// A frequency of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tone {
    /// The drive frequency; with several tones, that of the first.
    First,
    /// Frequency of a further tone, by its index among these, from 0.
    Further(usize),
    /// A multiple of the drive frequency.
    Harmonic(u32),
    /// 2ω₁ − ω₂, next to the first of two tones.
    FirstSideband,
    /// 2ω₂ − ω₁, next to the second.
    SecondSideband,
}

impl Tone {
    /// Returns the angular frequency in model units.
    pub(super) fn frequency(self, model: &Model) -> f64 {
        match self {
            Self::First => model.frequency(),
            Self::Further(k) => {
                let further = model.system.drive().frequencies().get(k + 1).copied();
                further.unwrap_or_else(|| model.frequency())
            }
            Self::Harmonic(order) => f64::from(order) * model.frequency(),
            Self::FirstSideband => 2.0 * model.frequency() - Self::Further(0).frequency(model),
            Self::SecondSideband => 2.0 * Self::Further(0).frequency(model) - model.frequency(),
        }
    }
}

/// The measurements that a set of observables requires.
#[derive(Clone, Debug, Default)]
pub(super) struct Requirements {
    pub(super) functionals: Vec<Functional>,
    /// The signals of the functionals, each once.
    pub(super) signals: Vec<Signal>,
    /// Whether the least height of the beam is required.
    pub(super) clearance: bool,
    /// Whether the gain of stored energy is required.
    pub(super) stored: bool,
}

impl Requirements {
    /// The measurements that `set` requires.
    pub(super) fn of(model: &Model, set: ObservableSet) -> Self {
        let mut measured = Measured::<f64>::of(model, None);
        Observables::read(set, &mut measured);
        measured.required
    }

    /// Adds a functional if it is new.
    pub(super) fn add(&mut self, functional: Functional) {
        if self.functionals.contains(&functional) {
            return;
        }
        self.functionals.push(functional);
        functional.map(
            |signal| {
                if !self.signals.contains(&signal) {
                    self.signals.push(signal);
                }
            },
            |_| (),
        );
    }

    /// The functionals, in order, with their signals as indices.
    pub(super) fn numbered(&self, model: &Model) -> Vec<accumulate::Functional> {
        // Every signal of a functional was added with it.
        let number = |signal| self.signals.iter().position(|s| *s == signal).unwrap_or(0);
        let all = self.functionals.iter();
        all.map(|f| f.map(number, |tone| tone.frequency(model)))
            .collect()
    }
}
