//! The lever as the inversion knows it: how its tip responds to a force, and what a measured
//! amplitude and phase, or frequency shift and excitation, say of the force's first harmonic.

use std::f64::consts::PI;

use nanotap_arithmetic::{ComplexFunctions as _, from_polar};
use nanotap_flow::Complex;

use super::motion::HARMONICS;
use nanotap_case::Case;
use nanotap_case::physical::Scales;
use nanotap_case::physical::free_response::{free_response, response_at};
use nanotap_error::Error;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::drive_form::Actuation;
use nanotap_motions::frequency_modulation::{FreeOscillation, Held};
use nanotap_study::cantilever;

/// The lever of a case, in SI or, of a dimensionless case, in the model's units.
#[derive(Clone, Debug)]
pub(super) struct Lever {
    cantilever: Cantilever,
    scales: Option<Scales>,
    /// Response of the tip's deflection to the base's motion, dimensionless; None unless the base
    /// is driven.
    base: Option<Complex>,
    /// Phase of the free deflection behind the drive, degrees.
    pub(super) free_phase: f64,
    /// Free amplitude that the case states, m or model units.
    pub(super) free_amplitude: f64,
}

/// First harmonic of the force and amplitude of the tip, in SI or model units.
#[derive(Clone, Copy, Debug)]
pub(super) struct FirstHarmonic {
    /// (1/π) ∮ F cos θ dθ, N or model units, where the tip's first harmonic is cos θ.
    pub(super) conservative: f64,
    /// Work of the first harmonic on the tip's first harmonic, a ∮ F sin θ dθ, J or model units.
    pub(super) work: f64,
    /// Amplitude of the tip's first harmonic, m or model units, a driven base's motion included.
    pub(super) amplitude: f64,
}

/// Relation between a row's two measured values and the first harmonic of the force.
#[derive(Clone, Debug)]
pub(super) enum Method {
    /// Amplitude and phase (degrees) at a constant drive.
    Amplitude {
        /// Deflection of the free lever, m or model units; its argument is minus the phase lag.
        free: Complex,
        /// Amplitude of the driven base, m or model units; 0 if the base is at rest.
        base: f64,
        /// Displacement by a unit of force at the frequency of the drive, m/N or model units.
        gain: Complex,
    },
    /// Relative frequency shift and dissipated energy at a constant amplitude.
    Frequency {
        /// Stiffness by which force changes frequency, N/m or model units.
        stiffness: f64,
        /// Amplitude of the tip, m or model units.
        amplitude: f64,
    },
}

impl Method {
    pub(super) fn first_harmonic(&self, values: [f64; 2]) -> FirstHarmonic {
        match *self {
            Self::Amplitude { free, base, gain } => {
                let deflection = from_polar(values[0], -values[1].to_radians());
                let tip = deflection + base;
                let product = (deflection - free) / gain * tip.conj();
                let amplitude = tip.modulus();
                FirstHarmonic {
                    conservative: product.re / amplitude,
                    work: -PI * product.im,
                    amplitude,
                }
            }
            Self::Frequency {
                stiffness,
                amplitude,
            } => FirstHarmonic {
                conservative: -2.0 * stiffness * amplitude * values[0],
                work: values[1],
                amplitude,
            },
        }
    }
}

impl Lever {
    /// # Errors
    /// When the case is not a cantilever with one tone.
    pub(super) fn of(case: &Case) -> Result<Self, Error> {
        let cantilever = cantilever(case, "reconstruct")?;
        if !cantilever.further_tones.is_empty() {
            return Err(Error::input(
                "a second drive tone is not supported by `reconstruct`",
                "take a case with one tone",
            ));
        }
        let response = free_response(cantilever).map_err(nanotap_case::CaseError::from)?;
        let scales = case.physical().map(|view| view.scales);
        let length = scales.map_or(1.0, |s| s.length);
        Ok(Self {
            base: (cantilever.actuation == Actuation::Base).then_some(response),
            free_phase: -response.argument().to_degrees(),
            free_amplitude: match case.physical() {
                Some(view) => view.free_amplitude,
                None => length * cantilever.alpha2 * response.modulus(),
            },
            cantilever: cantilever.clone(),
            scales,
        })
    }

    fn length(&self) -> f64 {
        self.scales.map_or(1.0, |scales| scales.length)
    }

    /// Returns the angular frequency of the drive, rad/s or model units.
    pub(super) fn angular_frequency(&self) -> f64 {
        self.angular(self.cantilever.omega)
    }

    fn angular(&self, omega: f64) -> f64 {
        omega / self.scales.map_or(1.0, |scales| scales.time)
    }

    /// Returns the displacements of the tip by a unit of force, m/N or model units, at the
    /// multiples 0, 1, … of the frequency `omega` (model units).
    fn gains(&self, omega: f64) -> Result<Vec<Complex>, Error> {
        let driven = Cantilever {
            actuation: Actuation::Tip,
            ..self.cantilever.clone()
        };
        let unit = self
            .scales
            .map_or(1.0, |scales| scales.length / scales.force);
        let gain = |n: usize| {
            // The response at rest is a limit.
            let multiple = if n == 0 { 1e-9 } else { n as f64 };
            let response = response_at(&driven, multiple * omega);
            Ok(response.map_err(nanotap_case::CaseError::from)? * unit)
        };
        (0..=HARMONICS).map(gain).collect()
    }

    /// Amplitude modulation with this free amplitude; phases are counted so that the free lever's
    /// is [`free_phase`](Self::free_phase).
    ///
    /// # Errors
    /// When the lever has no response.
    pub(super) fn amplitude_modulation(
        &self,
        amplitude: f64,
    ) -> Result<(Method, Vec<Complex>), Error> {
        let gains = self.gains(self.cantilever.omega)?;
        let method = Method::Amplitude {
            free: from_polar(amplitude, -self.free_phase.to_radians()),
            base: self
                .base
                .map_or(0.0, |response| amplitude / response.modulus()),
            gain: gains[1],
        };
        Ok((method, gains))
    }

    /// Frequency modulation at the free amplitude of the case and a phase (degrees). The second
    /// value of a row is its dissipated energy; that of the free lever is returned too.
    ///
    /// # Errors
    /// When the free lever has no such phase.
    pub(super) fn frequency_modulation(
        &self,
        case: &Case,
        phase: f64,
    ) -> Result<(Method, Vec<Complex>, FreeLoop), Error> {
        let held = Held {
            amplitude: self.free_amplitude / self.length(),
            phase,
        };
        let free = FreeOscillation::of(case, held.check()?)?;
        let stiffness = self.scales.map_or(1.0, |scales| scales.stiffness);
        let (energy, frequency) = self
            .scales
            .map_or((1.0, 1.0), |scales| (scales.energy, scales.frequency));
        let method = Method::Frequency {
            stiffness: free.stiffness * stiffness,
            amplitude: free.swing * self.length(),
        };
        let loop_ = FreeLoop {
            frequency: free.frequency * frequency,
            angular_frequency: self.angular(free.frequency),
            loss: free.loss * energy,
        };
        Ok((method, self.gains(free.frequency)?, loop_))
    }
}

/// The free lever in the loop of frequency modulation.
#[derive(Clone, Copy, Debug)]
pub(super) struct FreeLoop {
    /// Frequency, Hz or model units.
    pub(super) frequency: f64,
    /// Angular frequency, rad/s or model units.
    pub(super) angular_frequency: f64,
    /// Energy lost in a period, J or model units.
    pub(super) loss: f64,
}
