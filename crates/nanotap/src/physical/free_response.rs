//! What the tip does far from the sample, in closed form.

use nalgebra::Complex;

use crate::beam::Modes;
use crate::case::{Case, CaseError, CosineTerm, Reason};

/// Complex amplitude of the tip's deflection per amplitude of the base: the deflection is
/// Im(z e^{iΩτ}) for the base motion sin Ωτ, so |z| is the free amplitude over the drive's
/// and arg z the phase, near −π/2 at resonance.
///
/// The truncated model of the case is solved, not the exact beam, so that a simulation with
/// the same modes shows just this. With D_j = β_j⁴ − Ω² + iα3Ω the mass at the tip is a
/// rank-one term, which leaves
/// z = (α1Ω² S₁ + (Ω² − iα3Ω) S₂)/(1 − α1Ω² S₁), S₁ = Σφ_j(1)²/D_j, S₂ = Σφ_j(1)I_j/D_j.
/// `alpha2`, `alpha4`, `alpha5` and `alpha6` do not matter.
///
/// # Errors
/// [`CaseError`] if the case is not valid.
pub fn free_response(case: &Case) -> Result<Complex<f64>, CaseError> {
    case.validate()?;
    let modes = Modes::new(case.modes).map_err(|error| CaseError {
        key: "modes",
        value: error.given as f64,
        reason: Reason::Modes,
    })?;
    let square = case.omega * case.omega;
    let mut tip = Complex::new(0.0, 0.0);
    let mut load = Complex::new(0.0, 0.0);
    for mode in modes.iter() {
        let impedance = Complex::new(mode.stiffness() - square, case.alpha3 * case.omega);
        tip += mode.tip().powi(2) / impedance;
        load += mode.tip() * mode.integral() / impedance;
    }
    let damping = match case.cosine_term {
        CosineTerm::Corrected => case.alpha3 * case.omega,
        CosineTerm::Printed => case.alpha3,
    };
    let inertia = case.alpha1 * square;
    Ok((inertia * tip + Complex::new(square, -damping) * load) / (1.0 - inertia * tip))
}
