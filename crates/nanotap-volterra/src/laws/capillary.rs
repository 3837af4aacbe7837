//! A capillary bridge: it forms on approach at twice the thickness of the adsorbed film and
//! ruptures, stretched, farther out.
//!
//! `F = −4πγR/(1 + d/h)` between formation at `d = 2h` and rupture at
//! `d = V^{1/3} − V^{2/3}/(5R)`, `V = 4πRh² + (4/3)πh³ + 2πr²h`, `r³ = 3πγ_sv R²/E*` (Zitzler,
//! Herminghaus, Mugele, Phys. Rev. B 66, 2002). In contact the force is that at `a0`.
//! Whether there is a bridge is a state.

use crate::laws::elastic::reduced_modulus;
use crate::laws::entry::{
    CONTACT_DISTANCE, Entry, MODULUS, POISSON, ParameterEntry, RADIUS, Range, TIP_MODULUS,
    TIP_POISSON, own, parameters,
};
use crate::laws::formula::{Edge, Formula, Way};
use nanotap_arithmetic::Scalar;
use nanotap_quantity::Kind;
use std::f64::consts::PI;

/// Formula of a capillary bridge between a sphere and the sample; see the module.
#[derive(Clone, Copy, Debug)]
pub struct Capillary;

parameters! {
    /// Surface tension of the liquid, N/m.
    pub const SURFACE_TENSION = own("surface_tension", "surface tension γ of the liquid",
        Kind::Stiffness, Some(0.072), Range::Positive, "surface tension of the liquid (capillary)",
        0.072).assumed();
    /// Thickness of the adsorbed film, m.
    pub const FILM_THICKNESS = own("film_thickness", "thickness h of the adsorbed film", Kind::Length, None,
        Range::Positive, "thickness of the adsorbed film (capillary)", 3e-10);
    /// Surface energy of the solid, J/m².
    pub const SURFACE_ENERGY = own("surface_energy", "surface energy γ_sv of the solid",
        Kind::SurfaceEnergy, None, Range::Positive, "surface energy of the solid (capillary)", 0.07);
}

/// Table entry `capillary`: the bridge between a sphere and the sample.
pub static CAPILLARY: Entry = Entry {
    name: "capillary",
    words: "capillary bridge between a sphere and the sample, with hysteresis",
    formula: "−4πγR/(1 + d/h) from d = 2h on approach to d = V^(1/3) − V^(2/3)/(5R) on retraction",
    source: "Zitzler, Herminghaus, Mugele, Phys. Rev. B 66, 155436 (2002)",
    parameters: &[
        MODULUS,
        POISSON,
        TIP_MODULUS,
        TIP_POISSON,
        RADIUS,
        CONTACT_DISTANCE,
        SURFACE_TENSION,
        FILM_THICKNESS,
        SURFACE_ENERGY,
    ],
    parts: &[],
    attracts: true,
    conservative: false,
};

impl Formula for Capillary {
    fn entry(&self) -> &'static Entry {
        &CAPILLARY
    }

    /// Computes `a0`, `2h`, the gap of rupture, `−4πγR`, `1/h` and the force in contact, in this
    /// order.
    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        let (radius, contact, tension, film, solid) = (p[4], p[5], p[6], p[7], p[8]);
        let cube = radius.square() * solid / reduced_modulus(p) * (3.0 * PI);
        let base = cube.cbrt();
        let volume = radius * film.square() * (4.0 * PI)
            + film.square() * film * (4.0 / 3.0 * PI)
            + base.square() * film * (2.0 * PI);
        let side = volume.cbrt();
        let strength = tension * radius * (-4.0 * PI);
        let inverse = film.recip();
        vec![
            contact,
            film * 2.0,
            side - side.square() / (radius * 5.0),
            strength,
            inverse,
            strength / (contact * inverse + 1.0),
        ]
    }

    fn branches(&self) -> usize {
        3
    }

    fn branch_at(&self, c: &[f64], gap: f64, _rate: f64) -> usize {
        if gap < c[0] {
            2
        } else {
            usize::from(gap < c[1])
        }
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, _rate: S) -> S {
        match branch {
            0 => S::constant(0.0),
            1 => c[3] / (gap * c[4] + 1.0),
            _ => c[5],
        }
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        match branch {
            0 => vec![Way::new(Edge::Falls(1), 1)],
            1 => vec![Way::new(Edge::Falls(0), 2), Way::new(Edge::Rises(2), 0)],
            _ => vec![Way::new(Edge::Rises(0), 1)],
        }
    }

    /// Returns `−h`, where the force of a bridge has its pole.
    fn pole(&self, c: &[f64]) -> Option<f64> {
        Some(-c[4].recip())
    }

    /// Reports contact on branch 2 only: across the bridge of branch 1, tip and sample do not
    /// touch.
    fn touches(&self, branch: usize) -> bool {
        branch == 2
    }

    fn remembers(&self) -> bool {
        true
    }

    fn vanishes(&self, branch: usize) -> bool {
        branch == 0
    }
}
