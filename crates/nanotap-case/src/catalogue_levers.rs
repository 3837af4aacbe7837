//! The same sample under another lever of the catalogue, or in another fluid.

use super::key::{Key, Section};
use super::physical::{CatalogueLever, PhysicalError};
use super::quantities::Quantities;
use super::stated::Value;
use super::{Case, CaseKind};

/// The name of a lever of the catalogue, and the case with it or why that is impossible.
pub(crate) type CaseOfLever = (String, Result<Case, String>);

impl Case {
    /// Whether a fluid around the lever is stated, which determines the quality factor.
    pub fn states_fluid(&self) -> bool {
        let CaseKind::Quantities(quantities) = &self.what else {
            return false;
        };
        quantities.stated.has(Key::FluidDensity)
    }

    /// The case with each of these levers of its catalogue, all of it if none is named: driven at
    /// `frequency_ratio` of the free resonance with the same free amplitude. With `keep_tip` radius and
    /// height of the tip stay; otherwise a stated adhesion force is multiplied by the ratio of the
    /// radii. Quality factor or fluid stay. The reason where a lever is impossible.
    ///
    /// # Errors
    /// If a name is not in the catalogue.
    pub fn with_catalogue_levers(
        &self,
        names: &[String],
        frequency_ratio: f64,
        keep_tip: bool,
    ) -> Result<Vec<CaseOfLever>, PhysicalError> {
        const KEPT: [Key; 9] = [
            Key::LeverQ,
            Key::FluidDensity,
            Key::FluidViscosity,
            Key::LeverHeight,
            Key::TipMaterial,
            Key::TipModulus,
            Key::TipPoisson,
            Key::TipCharge,
            Key::TipHalfAngle,
        ];
        let (CaseKind::Quantities(quantities), Some(view)) = (&self.what, self.physical()) else {
            return Ok(Vec::new());
        };
        let catalogue = quantities.catalogue();
        let mut levers: Vec<&CatalogueLever> = Vec::new();
        for name in names {
            let lever = catalogue.lever(Key::LeverName, name)?;
            if !levers.contains(&lever) {
                levers.push(lever);
            }
        }
        if names.is_empty() {
            levers = catalogue.levers().collect();
        }
        let with = |lever: &CatalogueLever| {
            let mut stated = quantities.stated.clone();
            let of_lever = |key: &Key| {
                matches!(
                    key.section(),
                    Section::Cantilever | Section::Tip | Section::Gap
                ) && !KEPT.contains(key)
            };
            for key in Key::all().filter(of_lever) {
                stated.remove(key);
            }
            let radius = self.get(Key::TipRadius);
            for (key, known) in [
                (Key::TipRadius, lever.tip_radius),
                (Key::TipHeight, lever.tip_height),
            ] {
                let value = self.get(key);
                if (keep_tip || known.is_none()) && value.is_finite() {
                    stated.set(key, value);
                }
            }
            if let Some(other) = lever.tip_radius.filter(|_| !keep_tip && radius.is_finite())
                && stated.has(Key::SampleAdhesionForce)
            {
                let force = self.get(Key::SampleAdhesionForce) * other / radius;
                stated.set(Key::SampleAdhesionForce, force);
            }
            stated.put(Key::LeverName, Value::Name(lever.name.as_str().into()));
            stated.set(Key::DriveFrequencyRatio, frequency_ratio);
            stated.set(Key::DriveFreeAmplitude, view.free_amplitude);
            let quantities = Quantities::new(stated, quantities.catalogue()).validated();
            quantities.map(|quantities| self.with_quantities(quantities))
        };
        let all = levers.into_iter().map(|lever| {
            let case = with(lever).map_err(|error| error.to_string());
            (lever.name.clone(), case)
        });
        Ok(all.collect())
    }

    /// The same case in a fluid of `density` in kg/m³ and `viscosity` in Pa s, which determines the
    /// quality factors in place of the stated ones; the reason if that is impossible.
    ///
    /// # Errors
    /// The reason why the case is not valid there.
    pub fn in_fluid(&self, density: f64, viscosity: f64) -> Result<Self, String> {
        let CaseKind::Quantities(quantities) = &self.what else {
            return Ok(self.clone());
        };
        let mut stated = quantities.stated.clone();
        for key in [Key::LeverQ, Key::LeverQ2, Key::LeverQ3] {
            stated.remove(key);
        }
        stated.set(Key::FluidDensity, density);
        stated.set(Key::FluidViscosity, viscosity);
        let quantities = Quantities::new(stated, quantities.catalogue()).validated();
        let quantities = quantities.map_err(|error| error.to_string())?;
        Ok(self.with_quantities(quantities))
    }
}
