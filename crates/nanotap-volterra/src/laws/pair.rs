//! Potentials of pairs of atoms and bodies, of which frequency-modulation work is made: each a formula in
//! the language of cases, with the names of its parameters.

use std::sync::LazyLock;

use nanotap_quantity::{Dimension, Display, Kind, KindEntry};

use crate::laws::adhesion::HAMAKER;
use crate::laws::electric::PERMITTIVITY;
use crate::laws::entry::{
    CONTACT_DISTANCE, Entry, HALF_ANGLE, ParameterEntry, Part, RADIUS, Range, own, parameters,
};
use crate::laws::written::Writing;
use crate::laws::{Listed, Make, TableLaw};

/// Reciprocal of a length.
const INVERSE_LENGTH: Kind = Kind::new(&KindEntry {
    name: "inverse_length",
    dimension: Dimension::new(0, -1, 0),
    si_unit: "m^-1",
    display: Display::Unit,
    noun: "the inverse of a length",
    example: "12 nm^-1",
    model_unit: None,
});
/// Electric charge.
const CHARGE: Kind = Kind::new(&KindEntry {
    name: "charge",
    dimension: Dimension::CHARGE,
    si_unit: "C",
    display: Display::Prefixed,
    noun: "an electric charge",
    example: "1.6e-19 C",
    model_unit: None,
});

parameters! {
    /// Depth of a pair potential, J.
    pub const BOND_ENERGY = own("bond_energy", "bond energy E_b, the depth of the potential", Kind::Energy,
        None, Range::NotNegative, "bond energy, the depth of a pair potential (morse, pair-lennard-jones)",
        3.6e-19);
    /// Distance at the minimum of a pair potential, m.
    pub const BOND_LENGTH = own("bond_length", "bond length σ, where the potential is least", Kind::Length,
        None, Range::Positive, "distance at the minimum of a pair potential (morse, pair-lennard-jones)",
        2.35e-10);
    /// Decay constant of a Morse potential, 1/m.
    pub const BOND_DECAY = own("bond_decay", "decay constant κ of the attraction", INVERSE_LENGTH, None,
        Range::Positive, "decay constant of the attraction (morse)", 1.5e10);
    /// Force at the reference distance of an inverse power, N; positive for an attraction.
    pub const POWER_FORCE = own("power_force", "attraction F0 at the distance d0", Kind::Force, None,
        Range::Finite, "attraction at power_distance; negative for a repulsion (inverse-power)", 1e-9);
    /// Reference distance of an inverse power, m.
    pub const POWER_DISTANCE = own("power_distance", "distance d0 at which the force is stated",
        Kind::Length, None, Range::Positive, "distance at which power_force is stated (inverse-power)", 1e-9);
    /// Power of the distance.
    pub const POWER = own("power", "power n of the distance", Kind::Number, None, Range::NotNegative,
        "power of the distance (inverse-power)", 2.0);
    /// Charge of the sample, C.
    pub const POINT_CHARGE = own("point_charge", "charge q of the sample", CHARGE, None, Range::Finite,
        "charge of the sample, a point below the tip (coulomb)", 1.602176634e-19);
    /// Charge of the tip, C.
    pub const TIP_POINT_CHARGE = own("point_charge_of_tip", "charge q_t of the tip", CHARGE, None,
        Range::Finite, "charge of the tip, a point (coulomb)", -1.602176634e-19);
}

const fn law(
    name: &'static str,
    words: &'static str,
    formula: &'static str,
    source: &'static str,
    parameters: &'static [ParameterEntry],
    parts: &'static [Part],
) -> Entry {
    Entry {
        name,
        words,
        formula,
        source,
        parameters,
        parts,
        attracts: true,
        conservative: true,
    }
}

static MORSE: Entry = law(
    "morse",
    "Morse potential of the last atoms of tip and sample",
    "2κE_b (e^(−2κ(d−σ)) − e^(−κ(d−σ)))",
    "F. J. Giessibl, Rev. Mod. Phys. 75, 949 (2003)",
    &[BOND_ENERGY, BOND_LENGTH, BOND_DECAY],
    &[Part::Elasticity],
);
static LENNARD_JONES: Entry = law(
    "pair-lennard-jones",
    "Lennard-Jones potential of the last atoms of tip and sample",
    "(12E_b/σ) ((σ/d)^13 − (σ/d)^7)",
    "F. J. Giessibl, Rev. Mod. Phys. 75, 949 (2003)",
    &[BOND_ENERGY, BOND_LENGTH],
    &[Part::Elasticity],
);
static INVERSE_POWER: Entry = law(
    "inverse-power",
    "attraction that falls like a power of the distance",
    "−F0 (d0/d)^n for d > a0, its value at a0 in contact",
    "F. J. Giessibl, Phys. Rev. B 56, 16010 (1997)",
    &[POWER_FORCE, POWER_DISTANCE, POWER, CONTACT_DISTANCE],
    &[],
);
static SPHERE_CONE: Entry = law(
    "sphere-cone",
    "van der Waals attraction of a cone that ends in a sphere",
    "−(H/6) (R/d² + tan²θ/(d + R_θ) − R_θ/(d(d + R_θ))), R_θ = R(1 − sin θ), for d > a0, its value at a0 \
     in contact",
    "M. Guggisberg et al., Phys. Rev. B 61, 11151 (2000)",
    &[HAMAKER, RADIUS, HALF_ANGLE, CONTACT_DISTANCE],
    &[Part::Adhesion],
);
static COULOMB: Entry = law(
    "coulomb",
    "Coulomb's force between a point charge of the tip and one of the sample",
    "q q_t/(4π ε d²) for d > a0, its value at a0 in contact",
    "C. A. de Coulomb, Mém. Acad. R. Sci. 569 (1785)",
    &[
        POINT_CHARGE,
        TIP_POINT_CHARGE,
        PERMITTIVITY,
        CONTACT_DISTANCE,
    ],
    &[],
);

macro_rules! formulas {
    ($($entry:ident, contact at $contact:literal: $text:literal;)*) => {
        /// The laws of this file.
        pub static TABLE: [TableLaw; [$(stringify!($entry)),*].len()] = [$({
            static LISTED: Listed = LazyLock::new(|| Writing::listed(&$entry, $text, $contact));
            TableLaw {
                entry: &$entry,
                make: Make::Listed(&LISTED),
            }
        }),*];
    };
}

formulas! {
    MORSE, contact at "bond_length":
        "x = bond_decay*(d - bond_length); 2*bond_decay*bond_energy*(exp(-2*x) - exp(-x))";
    LENNARD_JONES, contact at "bond_length":
        "x = bond_length/d; 12*bond_energy/bond_length*(x^13 - x^7)";
    INVERSE_POWER, contact at "contact_distance":
        "-power_force*(power_distance/max(d, contact_distance))^power";
    SPHERE_CONE, contact at "contact_distance":
        "x = max(d, contact_distance); r = radius*(1 - sin(half_angle)); \
         -hamaker/6*(radius/x^2 + tan(half_angle)^2/(x + r) - r/(x*(x + r)))";
    COULOMB, contact at "contact_distance":
        "point_charge*point_charge_of_tip/(4*pi*permittivity*max(d, contact_distance)^2)";
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn force(name: &str, values: &[f64], gap: f64) -> f64 {
        let law = TABLE.iter().find(|law| law.entry.name == name).unwrap();
        let law = law.with(values).unwrap();
        law.value(law.branch_at(gap, 0.0), gap, 0.0)
    }

    /// The derivative of the potential, by central differences.
    #[test]
    fn forces_are_the_slopes_of_their_potentials() {
        let (energy, length, decay, h) = (2.1, 0.3, 9.0, 1e-6);
        let morse = |d: f64| {
            let x = decay * (d - length);
            energy * ((-2.0 * x).exp() - 2.0 * (-x).exp())
        };
        let pair = |d: f64| energy * ((length / d).powi(12) - 2.0 * (length / d).powi(6));
        for gap in [0.24, 0.3, 0.37, 0.8] {
            let slope = |potential: &dyn Fn(f64) -> f64| {
                -(potential(gap + h) - potential(gap - h)) / (2.0 * h)
            };
            let found = force("morse", &[energy, length, decay], gap);
            assert!((found - slope(&morse)).abs() < 1e-7, "{gap}");
            let found = force("pair-lennard-jones", &[energy, length], gap);
            assert!(
                (found - slope(&pair)).abs() < 1e-6 * found.abs().max(1.0),
                "{gap}"
            );
        }
    }

    /// The attraction of each slice of the tip, `H/(2π z⁴)` per volume at the height z (integrated over
    /// the half space below), summed by Simpson's rule over a sphere and the cone that touches it.
    #[test]
    fn a_sphere_and_cone_attract_as_their_slices_do() {
        let (hamaker, radius, angle) = (0.7, 5.0, 0.35_f64);
        let area = |x: f64| {
            let touch = radius * (1.0 - angle.sin());
            if x < touch {
                PI * x * (2.0 * radius - x)
            } else {
                PI * (radius * angle.cos() + (x - touch) * angle.tan()).powi(2)
            }
        };
        for gap in [0.3, 1.0, 4.0] {
            // z = gap/cos² t covers all heights.
            let slice = |t: f64| {
                let z = gap / t.cos().powi(2);
                let stretch = 2.0 * gap * t.sin() / t.cos().powi(3);
                if z.is_finite() && z < 1e8 {
                    hamaker / (2.0 * PI * z.powi(4)) * area(z - gap) * stretch
                } else {
                    0.0
                }
            };
            let count = 200_000;
            let step = FRAC_PI_2 / f64::from(count);
            let sum: f64 = (0..count)
                .map(|k| {
                    let t = f64::from(k) * step;
                    (slice(t) + 4.0 * slice(t + 0.5 * step) + slice(t + step)) * step / 6.0
                })
                .sum();
            let found = force("sphere-cone", &[hamaker, radius, angle, 0.1], gap);
            assert!((found / -sum - 1.0).abs() < 1e-6, "{gap}: {found} {}", -sum);
        }
        // Far smaller than its radius the gap sees the sphere alone.
        let sphere = force(
            "sphere-cone",
            &[hamaker, radius, angle, 0.01],
            0.01 * radius,
        );
        let plain = -hamaker * radius / (6.0 * (0.01 * radius).powi(2));
        assert!((sphere / plain - 1.0).abs() < 0.02);
    }

    #[test]
    fn every_formula_is_read_and_cut_off_in_contact() {
        for law in &TABLE {
            let examples: Vec<f64> = law.entry.parameters.iter().map(example).collect();
            let built = law.with(&examples).unwrap();
            assert!(built.branches() >= 2, "{}", law.entry.name);
            assert!(built.touches(built.branch_at(-1.0, 0.0)));
        }
        let coulomb = |gap: f64| force("coulomb", &[2.0, -3.0, 0.5, 0.2], gap);
        assert!((coulomb(1.5) + 6.0 / (2.0 * PI * 2.25)).abs() < 1e-14);
        assert_eq!(coulomb(0.1), coulomb(0.2));
        let power = |gap: f64| force("inverse-power", &[2.0, 0.5, 3.0, 0.2], gap);
        assert!((power(1.0) + 2.0 / 8.0).abs() < 1e-15);
    }

    fn example(parameter: &ParameterEntry) -> f64 {
        use crate::laws::entry::CaseKey;
        parameter.default.unwrap_or(match parameter.key {
            CaseKey::Own(key) => key.example,
            CaseKey::Body(_) => 0.3,
        })
    }
}
