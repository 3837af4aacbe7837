//! The strength of an adhesion: Hamaker constant, work of adhesion or pull-off force, one from
//! another.
//!
//! `w = H/(12π a0²)` is twice the surface energy `γ = H/(24π a0²)`. A sphere is pulled off by `2πRw`
//! in the limit of stiff contacts (Derjaguin, Muller and Toporov), as any rigid sphere, and by
//! `(3/2)πRw` in that of soft ones (Johnson, Kendall and Roberts).

use std::f64::consts::PI;

use nanotap_quantity::Kind;

use crate::laws::entry::{
    Alternative, Alternatives, CaseKey, KeyEntry, ParameterEntry, Range, parameters, stated_by,
};

const HAMAKER_KEY: KeyEntry = KeyEntry::new(
    "hamaker",
    Kind::Energy,
    Range::Finite,
    "Hamaker constant of tip, medium and sample",
    6e-20,
)
.label("Hamaker constant $H$");
const WORK_KEY: KeyEntry = KeyEntry::new(
    "work_of_adhesion",
    Kind::SurfaceEnergy,
    Range::NotNegative,
    "work of adhesion, an energy per area",
    0.02,
)
.label("work of adhesion $w$");

/// Key of the force that pulls the tip off, N.
pub const PULL_OFF_FORCE: KeyEntry = KeyEntry::new(
    "adhesion_force",
    Kind::Force,
    Range::NotNegative,
    "force that pulls the tip off",
    1e-9,
)
.label("adhesion force");

parameters! {
    /// Hamaker constant of tip, medium and sample, J.
    pub const HAMAKER = stated_by("hamaker", "Hamaker constant of tip, medium and sample", Kind::Energy,
        None, Range::Finite, CaseKey::Own(HAMAKER_KEY));
    /// Work of adhesion per area, J/m².
    pub const WORK_OF_ADHESION = stated_by("work_of_adhesion", "work of adhesion", Kind::SurfaceEnergy,
        None, Range::Positive, CaseKey::Own(WORK_KEY));
}

const REASON: &str = "each gives the adhesion, which would be counted twice or contradict itself";

/// Hamaker constant of a rigid sphere, or one in a stiff contact.
pub(crate) const HAMAKER_OF_STIFF_SPHERE: ParameterEntry = HAMAKER.or_by(Alternatives {
    reason: REASON,
    ways: &[
        Alternative {
            key: WORK_KEY,
            needs: &["contact_distance"],
            convert: |work, others| hamaker(work, others[0]),
        },
        Alternative {
            key: PULL_OFF_FORCE,
            needs: &["radius", "contact_distance"],
            convert: |force, others| hamaker(force / (2.0 * PI * others[0]), others[1]),
        },
    ],
});

/// Work of adhesion of a sphere in a soft contact.
pub(crate) const WORK_OF_SOFT_SPHERE: ParameterEntry = WORK_OF_ADHESION.or_by(Alternatives {
    reason: REASON,
    ways: &[
        Alternative {
            key: HAMAKER_KEY,
            needs: &["contact_distance"],
            convert: |hamaker, others| work_of_adhesion(hamaker, others[0]),
        },
        Alternative {
            key: PULL_OFF_FORCE,
            needs: &["radius"],
            convert: |force, others| force / (1.5 * PI * others[0]),
        },
    ],
});

/// Computes the Hamaker constant, J, from the work of adhesion, J/m², at the intermolecular
/// distance, m.
pub fn hamaker(work: f64, distance: f64) -> f64 {
    work * (12.0 * PI * distance * distance)
}

/// Computes the work of adhesion, J/m², from the Hamaker constant, J, at the intermolecular
/// distance, m.
pub fn work_of_adhesion(hamaker: f64, distance: f64) -> f64 {
    hamaker / (12.0 * PI * distance * distance)
}
