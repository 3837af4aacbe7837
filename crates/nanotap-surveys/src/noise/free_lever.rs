//! Thermal motion of the free lever: its spectrum, and the spring constants by the usual
//! calibrations.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::Serialize;

use super::Thermal;
use nanotap_case::key::Key;
use nanotap_case::physical::Physical;
use nanotap_case::physical::fluid::{Fluid, hydrodynamic_function};
use nanotap_observe::frame::{Frame, Rows, frame};

/// Density and viscosity of air at 300 K, as Sader, Chon and Mulvaney take them (Rev. Sci. Instrum. 70,
/// 3967, 1999).
const AIR: Fluid = Fluid {
    density: 1.18,
    viscosity: 1.86e-5,
    height: None,
};
/// Spring constant over k_B T/⟨s²⟩ of the first mode of a uniform beam, s as an optical lever reads it
/// with its static calibration (Butt and Jaschke, Nanotechnology 6, 1, 1995).
const OPTICAL: f64 = 0.817;

/// Spring constants that the usual calibrations give from the free lever's thermal motion, N/m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Calibrations {
    /// Spring constant of the case, static at the tip, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub k: f64,
    /// Spring constant by the thermal method, N/m: from the first mode's peak, read by an optical
    /// lever that was calibrated against a hard surface, with the factor 0.817 of a uniform beam.
    #[schemars(extend("x-unit" = "N/m"))]
    pub thermal: f64,
    /// Spring constant by the thermal method without this factor, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub thermal_without_factor: f64,
    /// Spring constant by Sader's method from width, length, f0 and Q in air, N/m; None if the
    /// dimensions are unknown or another fluid is given.
    #[schemars(extend("x-unit" = "N/m"))]
    pub sader: Option<f64>,
}

/// Thermal spectrum of the tip deflection of the free lever.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct ThermalSpectrum {
    /// Frequencies in Hz, dense at the resonances.
    #[schemars(extend("x-unit" = "Hz"))]
    pub frequency: Vec<f64>,
    /// One-sided density of the tip deflection in m²/Hz.
    #[schemars(extend("x-unit" = "m^2/Hz"))]
    pub density: Vec<f64>,
}

/// A resonance of the free lever, in the model's units.
struct Resonance {
    omega: f64,
    quality: f64,
    shape: DVector<f64>,
}

impl ThermalSpectrum {
    /// The spectrum as a table.
    pub fn table(&self) -> Frame<'_> {
        let rows = self.frequency.iter().zip(&self.density);
        frame! { Rows::new("spectrum", rows, None);
            "frequency", "frequency", (Frequency, Digits(5)) => |(frequency, _)| frequency;
            "density", "density", (Unit("m^2/Hz"), Digits(5)) => |(_, density)| density;
        }
    }
}

impl Thermal {
    /// Returns the resonances of the free lever, in ascending order.
    fn resonances(&self) -> Vec<Resonance> {
        let [mass, stiffness, damping] = [
            &self.equations.mass,
            &self.equations.stiffness[0],
            &self.equations.damping[0],
        ];
        let inverse = mass.clone().cholesky().and_then(|f| f.l().try_inverse());
        let Some(inverse) = inverse else {
            return Vec::new();
        };
        let eigen = (&inverse * stiffness * inverse.transpose()).symmetric_eigen();
        let mut found: Vec<Resonance> = (0..eigen.eigenvalues.len())
            .map(|k| {
                let shape = inverse.tr_mul(&eigen.eigenvectors.column(k));
                let omega = eigen.eigenvalues[k].max(0.0).sqrt();
                let quality = omega / product(damping, &shape);
                Resonance {
                    omega,
                    quality,
                    shape,
                }
            })
            .collect();
        found.sort_by(|a, b| a.omega.total_cmp(&b.omega));
        found
    }

    /// Computes the spring constants that the usual calibrations give; None without a resonance.
    pub(super) fn calibrations(&self, view: &Physical) -> Option<Calibrations> {
        let first = self.resonances().into_iter().next()?;
        let scales = &view.scales;
        // As an optical lever reads a slope that a static force at the tip would make: 3W/2.
        let reading = 2.0 / 3.0 * self.equations.modes.tip_slope.dot(&first.shape);
        let stiffness = product(&self.equations.stiffness[0], &first.shape);
        let uncorrected = stiffness / (reading * reading) * scales.stiffness;
        let size = |key| view.value(key).filter(|_| !view.is_in_fluid());
        let sader = size(Key::LeverLength)
            .zip(size(Key::LeverWidth))
            .map(|(length, width)| {
                let omega = std::f64::consts::TAU * view.lever.f0;
                let gamma = hydrodynamic_function(AIR.reynolds(width, view.lever.f0));
                0.1906
                    * AIR.density
                    * width
                    * width
                    * length
                    * view.lever.quality_factor
                    * omega
                    * omega
                    * gamma.im
            });
        Some(Calibrations {
            k: view.lever.k,
            thermal: OPTICAL * uncorrected,
            thermal_without_factor: uncorrected,
            sader,
        })
    }

    /// The spectrum: 4 k_B T |Im χ|/ω of the compliance χ, by the fluctuation–dissipation theorem.
    pub(super) fn spectrum(&self, view: &Physical) -> ThermalSpectrum {
        /// Frequencies between the resonances, and at each.
        const POINTS: [i32; 2] = [200, 60];
        /// Resonances that are shown, and half-widths to each side of one.
        const SHOWN: (usize, f64) = (5, 40.0);
        let resonances = self.resonances();
        let shown = &resonances[..resonances.len().min(SHOWN.0)];
        let (Some(first), Some(last)) = (shown.first(), shown.last()) else {
            return ThermalSpectrum::default();
        };
        let [low, high] = [0.1 * first.omega, 1.5 * last.omega];
        let between = (0..=POINTS[0]).map(|k| {
            low * nanotap_arithmetic::powf(high / low, f64::from(k) / f64::from(POINTS[0]))
        });
        let at = shown.iter().flat_map(|mode| {
            (-POINTS[1]..=POINTS[1]).map(|k| {
                let part = f64::from(k) / f64::from(POINTS[1]);
                mode.omega * (1.0 + part * part * part * SHOWN.1 / (2.0 * mode.quality))
            })
        });
        let mut omegas: Vec<f64> = between.chain(at).filter(|omega| *omega > 0.0).collect();
        omegas.sort_by(f64::total_cmp);
        omegas.dedup();
        let scales = &view.scales;
        // A density in W²τ is one in m²/Hz after a factor of the units.
        let unit = scales.length * scales.length * scales.time;
        let density =
            |omega: &f64| 4.0 * self.energy * self.compliance(*omega).im.abs() / omega * unit;
        ThermalSpectrum {
            density: omegas.iter().map(density).collect(),
            frequency: omegas
                .iter()
                .map(|omega| omega * scales.frequency)
                .collect(),
        }
    }
}

/// Returns the quadratic form vᵀ A v.
fn product(matrix: &DMatrix<f64>, vector: &DVector<f64>) -> f64 {
    vector.dot(&(matrix * vector))
}
