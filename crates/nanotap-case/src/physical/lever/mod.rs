//! The lever: stiffness, beam mass and tip mass from the data sheet and the measured spectrum, or
//! from dimensions and material.
//! With k = 3EI/L³ and T = √(mL⁴/EI) the beam's mass is mL = kT²/3, and its first free frequency,
//! measured with the tip on it, is f₀ = Ω₁(α1)/(2πT) with tip mass α1 = M/(mL). Ω₁ is that of the
//! model's modes, a little above the exact beam's (without a tip mass they are the same), so that a
//! drive at f₀ excites the resonance of the model that is solved. Any two of k, mL and f₀ give the
//! third once the tip's mass is known. The ratio f₂/f₁ of the exact beam depends on α1 alone and
//! therefore determines it.

mod in_fluid;

use std::f64::consts::TAU;

use serde::Serialize;

use crate::key::Key;
use crate::lever_modes::LeverModes;
pub use crate::physical::beam_geometry::BeamGeometry;
use crate::physical::error::PhysicalError;
use crate::physical::fluid::Fluid;
use crate::physical::reader::Reader;
use crate::physical::remark::Remark;
use crate::physical::tip::TipMass;
use crate::quantity::Kind;
use nanotap_model::exact_beam;

/// Data of a lever; SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeverData {
    /// Static spring constant k at the tip, N/m; `None` if it is unknown.
    pub k: Option<f64>,
    /// Modal stiffness of the first mode at the tip, from which k follows, N/m; `None` if not
    /// stated.
    pub k1: Option<f64>,
    /// First free resonance in Hz, with the tip, f₀.
    pub f0: Option<f64>,
    /// Quality factor of the first free resonance, Q.
    pub quality_factor: Option<f64>,
    /// The fluid around it, which determines Q; f₀ and f₂ are then those in vacuum.
    pub fluid: Option<Fluid>,
    /// Dimensions of the beam, m; `None` if they are unknown.
    pub geometry: Option<BeamGeometry>,
    /// Young's modulus along the beam, Pa.
    pub modulus: Option<f64>,
    /// Density of the beam, kg/m³; `None` if not stated.
    pub density: Option<f64>,
    /// Mass at the end of the beam.
    pub tip_mass: TipMass,
    /// Length of the lever, m, where it is known without the other dimensions.
    pub length: Option<f64>,
    /// Number of beam modes of the model.
    pub modes: usize,
}

impl LeverData {
    /// The data of a lever whose modes were measured: its model has the units of the uniform beam with its
    /// static spring constant and first resonance.
    fn of_modes(modes: &LeverModes, length: Option<f64>) -> Self {
        let first = modes.modes().first();
        Self {
            k: Some(modes.static_stiffness()),
            k1: None,
            f0: first.map(|mode| mode.frequency),
            quality_factor: first.map(|mode| mode.quality),
            fluid: None,
            geometry: None,
            modulus: None,
            density: None,
            tip_mass: TipMass::Absolute(0.0),
            length,
            modes: modes.modes().len(),
        }
    }

    /// The spring constant that follows from dimensions and modulus, N/m.
    fn bending(&self) -> Option<f64> {
        Some(self.geometry?.stiffness(self.modulus?))
    }

    /// The mass of the beam that follows from dimensions and density, kg.
    fn weight(&self) -> Option<f64> {
        Some(self.geometry?.mass(self.density?))
    }
}

/// A complete lever; SI units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Lever {
    /// Static spring constant at the tip, k = 3EI/L³, in N/m.
    pub k: f64,
    /// Mass of the beam without the tip, mL, in kg.
    pub beam_mass: f64,
    /// Mass of the tip as a fraction of the mass of the beam, α1, dimensionless.
    pub tip_mass_ratio: f64,
    /// First free resonance in Hz, with the tip.
    pub f0: f64,
    /// Quality factor of the first free resonance.
    pub quality_factor: f64,
    /// Length of the beam, m, if known; only slopes need it.
    pub length: Option<f64>,
    /// Number of beam modes of the model.
    #[serde(skip)]
    pub modes: usize,
}

/// A free mode of the exact beam.
struct Mode {
    /// Frequency of the mode, Hz.
    frequency: f64,
    /// Wavenumber times the length of the beam, β, dimensionless.
    wavenumber: f64,
    /// Square of the mode at the tip over its mean square along the beam, φ(1)²/∫φ².
    tip_share: f64,
}

/// The largest tip mass ratio considered. Beyond it the beam is a massless spring to six
/// digits.
const LARGEST_RATIO: f64 = 1e6;

impl Lever {
    /// Determines the lever from the data.
    ///
    /// # Errors
    /// [`PhysicalError`] if the data do not determine a lever or describe an impossible one;
    /// it says in which range the value would have to lie.
    pub fn resolve(data: &LeverData) -> Result<Self, PhysicalError> {
        check(data)?;
        let weight = data.weight();
        let modes = data.modes;
        let bare = exact_beam::frequencies(0.0, 0.0, modes)?;
        let (k, beam_mass, ratio) = match (data.k.or(data.bending()), data.f0, weight) {
            (Some(k), Some(f0), _) => {
                let ratio = ratio_from_resonance(data.tip_mass, k, f0, &bare)?;
                let time = first_frequency(ratio, &bare) / (TAU * f0);
                (k, k * time * time / 3.0, ratio)
            }
            (Some(k), None, Some(mass)) => (k, mass, ratio_to_beam(data.tip_mass, mass)?),
            (None, Some(f0), Some(mass)) => {
                let ratio = match data.tip_mass {
                    TipMass::SecondMode(f2) => ratio_from_second_mode(f2, f0)?,
                    other => ratio_to_beam(other, mass)?,
                };
                let time = first_frequency(ratio, &bare) / (TAU * f0);
                (3.0 * mass / (time * time), mass, ratio)
            }
            (Some(_), None, None) => {
                return Err(PhysicalError::missing(
                    Key::LeverF0,
                    "the beam's mass follows from it; else give length, width, thickness and \
                     density",
                ));
            }
            (None, _, _) => {
                return Err(PhysicalError::missing(
                    Key::LeverK,
                    "give it, or length, width, thickness and modulus, or a lever of the \
                     catalogue",
                ));
            }
        };
        let time = (3.0 * beam_mass / k).sqrt();
        let lever = Self {
            k,
            beam_mass,
            tip_mass_ratio: ratio,
            f0: data
                .f0
                .unwrap_or(first_frequency(ratio, &bare) / (TAU * time)),
            quality_factor: data.quality_factor.unwrap_or(f64::INFINITY),
            length: data
                .length
                .or(data.geometry.map(|geometry| geometry.length)),
            modes,
        };
        match (data.fluid, data.geometry) {
            (Some(fluid), Some(geometry)) => fluid.around(&lever, geometry.width, geometry.length),
            (Some(_), None) => Err(PhysicalError::missing(
                Key::LeverWidth,
                "what a fluid adds follows from the lever's width and length",
            )),
            (None, _) => Ok(lever),
        }
    }

    /// The same beam with a tip of this mass in kg at its end.
    pub(super) fn with_tip(self, mass: f64) -> Result<Self, PhysicalError> {
        let ratio = bounded(mass / self.beam_mass)?;
        let bare = exact_beam::frequencies(0.0, 0.0, self.modes)?;
        Ok(Self {
            tip_mass_ratio: ratio,
            f0: first_frequency(ratio, &bare) / (TAU * self.time_unit()),
            ..self
        })
    }

    /// Returns the stiffness of the first mode at the tip, N/m; `None` if the mode cannot be
    /// computed.
    pub fn modal_stiffness(&self) -> Option<f64> {
        let factor = modal_factor(TipMass::Ratio(self.tip_mass_ratio), None, self.modes);
        Some(self.k * factor.ok()?)
    }

    /// Mass of the tip, M = α1 mL, in kg.
    pub fn tip_mass(&self) -> f64 {
        self.tip_mass_ratio * self.beam_mass
    }

    /// The model's unit of time, T = √(mL⁴/EI) = √(3mL/k), in s.
    pub fn time_unit(&self) -> f64 {
        (3.0 * self.beam_mass / self.k).sqrt()
    }

    /// Ω₁ of the model's free beam with the tip: 2πf₀T.
    pub fn first_frequency(&self) -> f64 {
        TAU * self.f0 * self.time_unit()
    }

    /// The beam's damping α3 that gives the first free resonance its quality factor.
    ///
    /// The damping acts along the beam and not on the tip's mass, so the mode that has
    /// modal mass ∫φ² + α1φ(1)² is damped by α3∫φ² only, and Q = Ω₁(1 + α1φ(1)²/∫φ²)/α3:
    /// for the bare beam α3 = ω₀₁/Q. Corrections are of order 1/Q².
    pub fn damping(&self) -> f64 {
        let omega = self.first_frequency();
        let share = model_tip_share(omega, self.tip_mass_ratio, self.modes);
        omega * (1.0 + self.tip_mass_ratio * share) / self.quality_factor
    }

    /// The free mode `k` (0 is the first) for a beam of mass `beam_mass` in kg, including added mass, and
    /// the tip's mass.
    fn mode(&self, k: usize, beam_mass: f64) -> Result<Mode, PhysicalError> {
        let ratio = bounded(self.tip_mass() / beam_mass)?;
        let omega = exact_beam::frequencies(ratio, 0.0, k + 1)?[k];
        let time = (3.0 * beam_mass / self.k).sqrt();
        let wavenumber = omega.sqrt();
        Ok(Mode {
            frequency: omega / (TAU * time),
            wavenumber,
            tip_share: tip_share(wavenumber, ratio),
        })
    }

    /// Assumptions and warnings about the lever.
    pub(crate) fn remarks(&self, data: &LeverData) -> Vec<Remark> {
        let mut remarks = Vec::new();
        if let (Some(measured), Some(computed)) = (data.k, data.bending()) {
            remarks.push(comparison(
                "spring constant",
                Kind::Stiffness,
                measured,
                computed,
            ));
        }
        if let Some(k1) = data.k1 {
            remarks.push(Remark::note(format!(
                "k1 = {} is the first mode's stiffness at the tip: the static spring constant is \
                 k = k1/{} = {}",
                Kind::Stiffness.format(k1),
                Kind::Number.format_digits(k1 / self.k, 5),
                Kind::Stiffness.format(self.k)
            )));
        }
        if let (Some(_), Some(_), Some(weight), None) = (
            data.k.or(data.bending()),
            data.f0,
            data.weight(),
            data.fluid,
        ) {
            remarks.push(comparison("beam mass", Kind::Mass, self.beam_mass, weight));
        }
        if let TipMass::SecondMode(f2) = data.tip_mass {
            let error = data.f0.map_or(f64::NAN, |f0| {
                ratio_from_second_mode(1.01 * f2, f0).unwrap_or(f64::NAN) - self.tip_mass_ratio
            });
            remarks.push(Remark::note(format!(
                "f2/f1 tells a tip mass of {} ({} of the beam's); 1 % more in f2 would add {} \
                 to that fraction",
                Kind::Mass.format(self.tip_mass()),
                Kind::Number.format(self.tip_mass_ratio),
                Kind::Number.format_digits(error, 2)
            )));
        }
        if self.tip_mass_ratio > 1.0 {
            remarks.push(Remark::warning(format!(
                "the tip is {} times as heavy as the beam",
                Kind::Number.format(self.tip_mass_ratio)
            )));
        }
        if let (Some(fluid), Some(geometry)) = (data.fluid, data.geometry) {
            remarks.push(fluid.remark(self, geometry.width));
        } else if self.quality_factor < 5.0 {
            remarks.push(Remark::warning(
                "at a quality factor below 5 the free amplitude peaks away from f0, and \
                 damping by a liquid adds mass that this model does not have",
            ));
        }
        if let Some(geometry) = data.geometry
            && geometry.thickness > 0.1 * geometry.length
        {
            remarks.push(Remark::warning(
                "the beam is thicker than a tenth of its length: shear, which is left out, \
                 lowers its higher modes",
            ));
        }
        remarks
    }
}

fn check(data: &LeverData) -> Result<(), PhysicalError> {
    let positive = |key: Key, value: Option<f64>| match value {
        Some(value) if !(value > 0.0 && value.is_finite()) => Err(PhysicalError::impossible(
            key,
            key.kind().format(value),
            "it must be above zero",
        )),
        _ => Ok(()),
    };
    positive(Key::LeverK, data.k)?;
    positive(Key::LeverF0, data.f0)?;
    positive(Key::LeverQ, data.quality_factor)?;
    positive(Key::LeverModulus, data.modulus)?;
    positive(Key::LeverDensity, data.density)?;
    if let Some(geometry) = data.geometry {
        positive(Key::LeverLength, Some(geometry.length))?;
        positive(Key::LeverWidth, Some(geometry.width))?;
        positive(Key::LeverThickness, Some(geometry.thickness))?;
    }
    let (key, kind, value) = match data.tip_mass {
        TipMass::Absolute(mass) => (Key::TipMass, Kind::Mass, mass),
        TipMass::Ratio(ratio) => (Key::TipMassRatio, Kind::Number, ratio),
        TipMass::SecondMode(f2) => (Key::LeverF2, Kind::Frequency, f2),
    };
    if value >= 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(PhysicalError::impossible(
        key,
        kind.format(value),
        "it must not be negative",
    ))
}

fn comparison(what: &str, kind: Kind, used: f64, other: f64) -> Remark {
    let text = format!(
        "{what}: {} is used; dimensions and material give {}",
        kind.format(used),
        kind.format(other)
    );
    if nanotap_arithmetic::ln(used / other).abs() > nanotap_arithmetic::ln(2.0_f64) {
        Remark::warning(text)
    } else {
        Remark::note(text)
    }
}

/// α1 from the tip's mass where k and f₀ are known: α1Ω₁²(α1) = 3Mω₀²/k, which grows from 0
/// to 3.
fn ratio_from_resonance(tip: TipMass, k: f64, f0: f64, bare: &[f64]) -> Result<f64, PhysicalError> {
    let mass = match tip {
        TipMass::Ratio(ratio) => return bounded(ratio),
        TipMass::SecondMode(f2) => return ratio_from_second_mode(f2, f0),
        TipMass::Absolute(mass) => mass,
    };
    let heaviest = k / (TAU * f0).powi(2);
    let wanted = 3.0 * mass / heaviest;
    let carries = |ratio: f64| Ok(ratio * first_frequency(ratio, bare).powi(2) >= wanted);
    ratio_where(carries)?.ok_or_else(|| {
        PhysicalError::impossible(
            Key::TipMass,
            Kind::Mass.format(mass),
            format!(
                "with this k and f0 it must be below k/(2 pi f0)^2 = {}, which a beam without \
                 mass would carry",
                Kind::Mass.format(heaviest)
            ),
        )
    })
}

/// α1 where the beam's mass is known.
fn ratio_to_beam(tip: TipMass, beam_mass: f64) -> Result<f64, PhysicalError> {
    match tip {
        TipMass::Ratio(ratio) => bounded(ratio),
        TipMass::Absolute(mass) => bounded(mass / beam_mass),
        TipMass::SecondMode(_) => Err(PhysicalError::missing(
            Key::LeverF0,
            "f2 tells the tip's mass only together with f0",
        )),
    }
}

/// The tip mass that f₂ states where no other key states one. None follows from a ratio f₂/f₁ below
/// that of the bare beam, or where k₂ is stated too, which with f₂ states the whole second mode. In a
/// fluid f₂ is that in vacuum, so that only a tip mass can explain it.
fn tip_mass_from(
    f2: f64,
    f0: Option<f64>,
    in_fluid: bool,
    has_stiffness: bool,
) -> Result<Option<TipMass>, PhysicalError> {
    let is_lower = |f0: f64| Ok::<_, PhysicalError>(f2 / f0 < frequency_ratio(0.0)?);
    let is_measured = has_stiffness || f0.map(is_lower).transpose()?.unwrap_or(false);
    Ok((in_fluid || !is_measured).then_some(TipMass::SecondMode(f2)))
}

/// Stiffness of the first mode of the model's `modes` at the tip over the static one,
/// `(∫φ²/φ(1)² + α1) Ω₁²/3`: β₁⁴/12 = 1.0302 without a tip's mass, nearer to 1 with it.
fn modal_factor(tip: TipMass, f0: Option<f64>, modes: usize) -> Result<f64, PhysicalError> {
    let ratio = match (tip, f0) {
        (TipMass::Ratio(ratio), _) => bounded(ratio)?,
        (TipMass::Absolute(0.0), _) => 0.0,
        (TipMass::SecondMode(f2), Some(f0)) => ratio_from_second_mode(f2, f0)?,
        (TipMass::SecondMode(_), None) => {
            return Err(PhysicalError::missing(
                Key::LeverF0,
                "f2 tells the tip's mass only together with f0",
            ));
        }
        (TipMass::Absolute(_), _) => {
            return Err(PhysicalError::missing(
                Key::TipMassRatio,
                "the modal stiffness k1 leads to k only with the tip's mass as a part of the \
                 beam's; else give k",
            ));
        }
    };
    let omega = first_frequency(ratio, &exact_beam::frequencies(0.0, 0.0, modes)?);
    let share = model_tip_share(omega, ratio, modes);
    Ok((1.0 / share + ratio) * omega * omega / 3.0)
}

fn bounded(ratio: f64) -> Result<f64, PhysicalError> {
    if ratio <= LARGEST_RATIO {
        return Ok(ratio);
    }
    Err(PhysicalError::impossible(
        Key::TipMassRatio,
        Kind::Number.format(ratio),
        format!("a tip more than {LARGEST_RATIO:e} times as heavy as the beam is not a lever"),
    ))
}

/// α1 from the measured f₂/f₁, which grows with α1 from that of the bare beam, 6.2669: at first
/// with its square, so that light tips cannot be distinguished from none.
fn ratio_from_second_mode(f2: f64, f0: f64) -> Result<f64, PhysicalError> {
    let measured = f2 / f0;
    let bare = frequency_ratio(0.0)?;
    let refused = |reason: String| {
        PhysicalError::impossible(
            Key::LeverF2,
            format!(
                "{} (f2/f1 = {})",
                Kind::Frequency.format(f2),
                Kind::Number.format_digits(measured, 5)
            ),
            reason,
        )
    };
    if measured < bare {
        return Err(refused(format!(
            "in a fluid f2 tells the tip's mass, and a uniform beam with a tip has f2/f1 of at \
             least {bare:.4}, reached without tip mass; leave f2 out if the difference is within \
             its error, or give the tip's mass too (tip.mass_ratio): the second mode then has \
             this frequency in the fluid"
        )));
    }
    ratio_where(|ratio| Ok(frequency_ratio(ratio)? >= measured))?.ok_or_else(|| {
        refused(format!(
            "it must lie above {bare:.4} f1 and below {:.0} f1",
            frequency_ratio(LARGEST_RATIO).unwrap_or(f64::INFINITY)
        ))
    })
}

/// The α1 up to [`LARGEST_RATIO`] at which a condition begins to hold that, once it holds,
/// holds for all larger ones; none if it never does.
fn ratio_where(
    holds: impl Fn(f64) -> Result<bool, PhysicalError>,
) -> Result<Option<f64>, PhysicalError> {
    if holds(0.0)? {
        return Ok(Some(0.0));
    }
    if !holds(LARGEST_RATIO)? {
        return Ok(None);
    }
    // α1 = t/(1 − t) keeps full relative accuracy for light tips and reaches heavy ones.
    let ratio = |t: f64| t / (1.0 - t);
    let (mut low, mut high) = (0.0, LARGEST_RATIO / (1.0 + LARGEST_RATIO));
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return Ok(Some(ratio(high)));
        }
        if holds(ratio(middle))? {
            high = middle;
        } else {
            low = middle;
        }
    }
}

/// Ω₁ of the free beam with the tip in the modes of the bare beam with these frequencies ω_j: the root
/// below ω₁ of 1 = α1Ω² Σφ_j(1)²/(ω_j² − Ω²), whose right side rises from 0 to infinity.
fn first_frequency(ratio: f64, bare: &[f64]) -> f64 {
    if ratio == 0.0 {
        return bare[0];
    }
    let excess = |omega: f64| ratio * omega * omega * receptances(bare, omega)[0] >= 1.0;
    let (mut low, mut high) = (0.0, bare[0]);
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return middle;
        }
        if excess(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
}

/// Σφ_j(1)²/(ω_j² − Ω²) and Σφ_j(1)²/(ω_j² − Ω²)² over bare modes, whose φ_j(1)² is 4.
fn receptances(bare: &[f64], omega: f64) -> [f64; 2] {
    let terms = bare.iter().map(|own| 1.0 / (own * own - omega * omega));
    terms.fold([0.0; 2], |[once, twice], term| {
        [once + 4.0 * term, twice + 4.0 * term * term]
    })
}

/// φ(1)²/∫φ² of the model's first free mode with frequency Ω: its shape has the parts
/// φ_j(1)/(ω_j² − Ω²) of the bare modes, and 4 without a tip's mass.
fn model_tip_share(omega: f64, ratio: f64, modes: usize) -> f64 {
    match exact_beam::frequencies(0.0, 0.0, modes) {
        Ok(bare) if ratio > 0.0 => {
            let [once, twice] = receptances(&bare, omega);
            once * once / twice
        }
        _ => 4.0,
    }
}

/// Ω₂/Ω₁ of the exact free beam.
fn frequency_ratio(ratio: f64) -> Result<f64, PhysicalError> {
    let frequencies = exact_beam::frequencies(ratio, 0.0, 2)?;
    Ok(frequencies[1] / frequencies[0])
}

/// φ(1)²/∫φ² of the exact beam's free mode of wave number β with tip mass α1:
/// 4/(1 − 3α1 + 2α1q) with q = β sin β sinh β/D, D = sin β cosh β − cos β sinh β.
///
/// By Rayleigh's principle d ln ω²/dα1 = −φ(1)²/(∫φ² + α1φ(1)²); the left side follows from
/// 1 + cos β cosh β = α1 β D.
fn tip_share(beta: f64, ratio: f64) -> f64 {
    let q = if beta < 1.0 {
        // Both cancel to third order: q = (3/2)(1 − x/360 …)/(1 − x/840 …), x = 4β⁴.
        let x = 4.0 * beta.powi(4);
        let upper = 1.0 - x / 360.0 * (1.0 - x / 5040.0 * (1.0 - x / 24024.0));
        let lower = 1.0 - x / 840.0 * (1.0 - x / 7920.0 * (1.0 - x / 32760.0));
        1.5 * upper / lower
    } else {
        let (sin, cos) = nanotap_arithmetic::sin_cos(beta);
        beta * sin * nanotap_arithmetic::sinh(beta)
            / (sin * nanotap_arithmetic::cosh(beta) - cos * nanotap_arithmetic::sinh(beta))
    };
    4.0 / (1.0 - 3.0 * ratio + 2.0 * ratio * q)
}

impl LeverData {
    /// Reads `[cantilever]` and `[tip]`; other data come from a lever of the catalogue.
    pub(crate) fn read(
        reader: Reader<'_>,
        lever: Option<&super::catalogue::Lever>,
        tip_mass: Option<TipMass>,
    ) -> Result<Self, PhysicalError> {
        if let Some(modes) = reader.lever_modes() {
            return Ok(Self::of_modes(modes, reader.number(Key::LeverLength)?));
        }
        // Only its range matters here: fits read it.
        reader.number(Key::LeverKError)?;
        let fluid = Fluid::read(reader)?;
        let quality_factor = reader.number(Key::LeverQ)?;
        if quality_factor.is_none() && fluid.is_none() {
            return Err(PhysicalError::missing(
                Key::LeverQ,
                "it depends on what surrounds the lever: a few hundred in air, a few in \
                 water, tens of thousands in vacuum; take it from the free resonance",
            ));
        }
        let f0 = reader
            .number(Key::LeverF0)?
            .or_else(|| lever.map(|lever| lever.f0));
        let second = match reader.number(Key::LeverF2)? {
            Some(f2) => tip_mass_from(f2, f0, fluid.is_some(), reader.has(Key::LeverK2))?,
            None => None,
        };
        let tip_mass = tip_mass.or(second).unwrap_or(TipMass::Absolute(0.0));
        let modes = crate::file::modes(reader.stated);
        let k1 = reader.number(Key::LeverK1)?;
        let from_modal = k1
            .map(|k1| Ok::<_, PhysicalError>(k1 / modal_factor(tip_mass, f0, modes)?))
            .transpose()?;
        Ok(Self {
            fluid,
            quality_factor,
            k: reader
                .number(Key::LeverK)?
                .or(from_modal)
                .or_else(|| lever.map(|lever| lever.k)),
            k1,
            f0,
            geometry: read_geometry(reader)?.or_else(|| lever.and_then(|lever| lever.geometry)),
            modulus: reader.number(Key::LeverModulus)?,
            density: reader.number(Key::LeverDensity)?,
            tip_mass,
            length: None,
            modes,
        })
    }
}

fn read_geometry(reader: Reader<'_>) -> Result<Option<BeamGeometry>, PhysicalError> {
    let keys = [Key::LeverLength, Key::LeverWidth, Key::LeverThickness];
    if !keys.into_iter().any(|key| reader.has(key)) {
        return Ok(None);
    }
    let needed = |key: Key| {
        reader.number(key)?.ok_or_else(|| {
            PhysicalError::missing(
                key,
                "length, width and thickness are given together or not at all",
            )
        })
    };
    Ok(Some(BeamGeometry {
        length: needed(Key::LeverLength)?,
        width: needed(Key::LeverWidth)?,
        thickness: needed(Key::LeverThickness)?,
    }))
}
