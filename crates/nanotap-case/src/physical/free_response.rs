//! Response of the tip far from the sample, in closed form.

use nalgebra::Complex;

use nanotap_model::beam::Modes;
use nanotap_model::cantilever::{Cantilever, CantileverError, CosineTerm, Reason};
use nanotap_model::drive_form::Actuation;
use nanotap_model::galerkin::{Galerkin, Regime};

/// Complex amplitude of the tip's deflection per amplitude of the drive at its frequency Ω:
/// see [`response_at`].
///
/// # Errors
/// [`CantileverError`] if the case is not valid.
pub fn free_response(case: &Cantilever) -> Result<Complex<f64>, CantileverError> {
    response_at(case, case.omega)
}

/// Complex amplitude of the tip's deflection per amplitude of a tone of frequency w, driven
/// as the case is: the deflection is Im(z e^{iwτ}) for the tone sin wτ, so that |z| is the
/// free amplitude over the drive's and arg z the phase, near −π/2 at the first resonance.
///
/// The truncated model of the case is solved, not the exact beam, so that a simulation with
/// the same modes shows just this. With D_j = β_j⁴ − w² + iα3w the mass at the tip is a
/// rank-one term, which leaves a fraction over 1 − α1w² S₁; above it stands, with
/// S₁ = Σφ_j(1)²/D_j and S₂ = Σφ_j(1)I_j/D_j,
///
/// - α1w² S₁ + (w² − iα3w) S₂ for the base,
/// - S₁ for a force at the tip,
/// - S₂ for one spread over the beam.
///
/// `alpha2`, `alpha4`, `alpha5` and `alpha6` do not matter.
///
/// # Errors
/// [`CantileverError`] if the case is not valid.
pub fn response_at(case: &Cantilever, frequency: f64) -> Result<Complex<f64>, CantileverError> {
    case.validate()?;
    let modes = Modes::shared(case.modes).map_err(|error| CantileverError {
        key: "modes",
        value: error.given as f64,
        reason: Reason::Modes,
    })?;
    if case.is_corrected() {
        return response_of_matrices(case, frequency);
    }
    let square = frequency * frequency;
    let mut tip = Complex::new(0.0, 0.0);
    let mut load = Complex::new(0.0, 0.0);
    for mode in modes.iter() {
        let impedance = Complex::new(mode.stiffness() - square, case.alpha3 * frequency);
        tip += mode.tip().powi(2) / impedance;
        load += mode.tip() * mode.integral() / impedance;
    }
    let damping = match case.cosine_term {
        CosineTerm::Corrected => case.alpha3 * frequency,
        CosineTerm::Printed => case.alpha3,
    };
    let inertia = case.alpha1 * square;
    let driven = match case.actuation {
        Actuation::Base => inertia * tip + Complex::new(square, -damping) * load,
        Actuation::Tip => tip,
        Actuation::Distributed => load,
    };
    Ok(driven / (1.0 - inertia * tip))
}

/// The same where measured modes or Q control fill the matrices: one linear system.
fn response_of_matrices(
    case: &Cantilever,
    frequency: f64,
) -> Result<Complex<f64>, CantileverError> {
    let free = Cantilever {
        alpha2: 1.0,
        omega: frequency,
        ..case.clone().under_one_tone()
    };
    let free = Galerkin::new(&free)?;
    let r = Regime::Free.index();
    let impedance = free.stiffness[r].map(Complex::from)
        - free.mass.map(|m| Complex::from(m * frequency * frequency))
        + free.damping[r].map(|c| Complex::new(0.0, c * frequency));
    let forcing = &free.forcing[r];
    let force = forcing.sine.zip_map(&forcing.cosine, Complex::new);
    let answer = impedance.lu().solve(&force);
    // An undamped resonance answers without bound.
    let infinite = Complex::from(f64::INFINITY);
    Ok(answer.map_or(infinite, |x| {
        x.iter().zip(free.gap.tip.iter()).map(|(x, p)| x * *p).sum()
    }))
}
