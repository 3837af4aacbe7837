//! What the tip does far from the sample, of any model, from the steady response of its
//! regime of free flight.

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::Complex;

use nanotap_model::Model;
use nanotap_observe::lag;

/// Free motion of the tip far from the sample: amplitude, phase and reach, in the model's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeMotion {
    /// Amplitude A₀ of the tip deflection at the drive frequency, in the model's unit of length.
    pub amplitude: f64,
    /// Phase lag behind the drive, degrees in (−180, 180].
    pub phase: f64,
    /// Largest swing of the tip towards the sample, the motion of the base included, in the model's
    /// unit of length: contact begins at this distance. For two tones it is the sum of both
    /// amplitudes.
    pub reach: f64,
}

impl FreeMotion {
    /// Computes the free motion of `model` from the steady response of its first regime.
    pub fn of(model: &Model) -> Self {
        let Some(free) = model.system.regimes().first() else {
            return Self {
                amplitude: 0.0,
                phase: 0.0,
                reach: 0.0,
            };
        };
        let tones = |output| free.project(output).tones;
        let first = tones(&model.tip)
            .first()
            .copied()
            .unwrap_or(Complex::new(0.0, 0.0));
        Self {
            amplitude: first.modulus(),
            phase: lag(first),
            reach: tones(&model.gap).iter().map(|tone| tone.modulus()).sum(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap_case::physical::free_response::free_response;
    use nanotap_model::cantilever::Cantilever;

    /// The closed form for the cantilever, solved otherwise.
    #[test]
    fn agrees_with_the_closed_form() {
        for omega in [1.0, 2.6, 3.4, 20.0] {
            let case = Cantilever {
                omega,
                ..Cantilever::paper()
            };
            let z = free_response(&case).unwrap();
            let free = FreeMotion::of(&Model::cantilever(&case).unwrap());
            assert!((free.amplitude / (case.alpha2 * z.modulus()) - 1.0).abs() < 1e-11);
            assert!((free.phase + z.argument().to_degrees()).abs() < 1e-9);
            let reach = case.alpha2 * (z + 1.0).modulus();
            assert!((free.reach / reach - 1.0).abs() < 1e-11);
        }
    }
}
