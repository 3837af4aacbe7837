//! A contact law as equations: two regimes, free surface and contact, with any number of internal
//! variables of the surface.

use nanotap_flow::Onset;

use super::dual::Dual;

/// `height · V_T + rate · V̇_T + Σ internal_k · s_k + constant`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LinearForm {
    pub(crate) height: Dual,
    pub(crate) rate: Dual,
    /// Factors of the internal variables; missing ones are 0.
    pub(crate) internal: Vec<Dual>,
    pub(crate) constant: Dual,
}

impl LinearForm {
    pub(crate) fn height(factor: Dual) -> Self {
        Self {
            height: factor,
            ..Self::default()
        }
    }

    pub(crate) fn rate(factor: Dual) -> Self {
        Self {
            rate: factor,
            ..Self::default()
        }
    }

    /// Returns the linear form `factor · s_k`.
    pub(crate) fn internal(k: usize, factor: Dual) -> Self {
        let mut internal = vec![Dual::default(); k + 1];
        internal[k] = factor;
        Self {
            internal,
            ..Self::default()
        }
    }

    pub(crate) fn constant(constant: Dual) -> Self {
        Self {
            constant,
            ..Self::default()
        }
    }

    pub(crate) fn plus(&self, other: &Self) -> Self {
        let (longer, shorter) = if self.internal.len() < other.internal.len() {
            (&other.internal, &self.internal)
        } else {
            (&self.internal, &other.internal)
        };
        let mut internal = longer.clone();
        for (sum, more) in internal.iter_mut().zip(shorter) {
            *sum = *sum + *more;
        }
        Self {
            height: self.height + other.height,
            rate: self.rate + other.rate,
            internal,
            constant: self.constant + other.constant,
        }
    }

    pub(crate) fn times(&self, factor: Dual) -> Self {
        Self {
            height: self.height * factor,
            rate: self.rate * factor,
            internal: self.internal.iter().map(|&by| by * factor).collect(),
            constant: self.constant * factor,
        }
    }

    /// Returns true if the form depends on `s_k` only, apart from its constant.
    pub(crate) fn is_internal(&self, k: usize) -> bool {
        let others = self.internal.iter().enumerate().filter(|(j, _)| *j != k);
        let zero = |dual: &Dual| dual.value == 0.0;
        others.map(|(_, by)| by).all(zero) && zero(&self.height) && zero(&self.rate)
    }
}

/// `weight · one · other`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bilinear {
    pub(crate) weight: f64,
    pub(crate) one: LinearForm,
    pub(crate) other: LinearForm,
}

impl Bilinear {
    /// Returns the product `weight · form · form`.
    pub(crate) fn square(weight: f64, form: &LinearForm) -> Self {
        Self {
            weight,
            one: form.clone(),
            other: form.clone(),
        }
    }
}

/// How the sample responds in one regime.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SampleResponse {
    /// Force of the sample on the tip, positive when it pushes the tip away, in units of EI g₀/L³.
    pub(crate) force: LinearForm,
    /// ṡ_k of each internal variable.
    pub(crate) rates: Vec<LinearForm>,
    /// Power dissipated in the sample, a sum of these products, in model units.
    pub(crate) dissipated: Vec<Bilinear>,
    /// Energy stored in the sample, a sum of these products, in units of EI g₀²/L³.
    pub(crate) stored: Vec<Bilinear>,
}

/// The equations of a contact law.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Law {
    /// Number of internal variables of the surface.
    pub(crate) internal: usize,
    /// Height of the tip above the free surface; contact begins where it falls to zero.
    pub(crate) gap: LinearForm,
    /// Contact ends where this falls to zero.
    pub(crate) release_guard: LinearForm,
    /// Internal variables after contact ends, if they jump.
    pub(crate) release_reset: Option<Vec<LinearForm>>,
    /// How the guards start when contact begins and ends, if they are not each other's negatives.
    pub(crate) onsets: Option<[Onset; 2]>,
    /// Motion of the free surface in flight, where the force on the tip is zero.
    pub(crate) flight: SampleResponse,
    /// Force and motion of the surface in contact.
    pub(crate) contact: SampleResponse,
    /// Whether in contact the beam moves as one with spring α4 and damper α6 at its tip, apart
    /// from the internal variables, so that its spectrum is known.
    pub(crate) plain_contact: bool,
}
