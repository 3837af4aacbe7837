//! DMT contact with van der Waals attraction.
//!
//! In contact (`δ = a0 − d > 0`) `4/3 E* √R δ^{3/2} − H R/(6 a0²)`, outside `−H R/(6 d²)`
//! (Derjaguin, Muller, Toporov, J. Colloid Interface Sci. 53, 1975; as used in amplitude
//! modulation by García and San Paulo, Phys. Rev. B 60, 1999). The adhesion is `4πRγ` with
//! `γ = H/(24π a0²)`.

use crate::law::{Approach, Remark};
use crate::laws::adhesion::HAMAKER_OF_STIFF_SPHERE;
use crate::laws::elastic::{Shape, contact_ways, deep, reduced_modulus};
use crate::laws::entry::{
    CONTACT_DISTANCE, Entry, MODULUS, POISSON, Part, RADIUS, TIP_MODULUS, TIP_POISSON,
};
use crate::laws::formula::{Formula, Way};
use nanotap_arithmetic::Scalar;

/// Formula of DMT contact with van der Waals attraction; see the module.
#[derive(Clone, Copy, Debug)]
pub struct Dmt;

/// Table entry `dmt`: an elastic sphere with van der Waals attraction.
pub static DMT: Entry = Entry {
    name: "dmt",
    words: "elastic sphere with van der Waals attraction outside and constant adhesion in contact",
    formula: "4/3 E* √R δ^(3/2) − H R/(6 a0²) in contact, −H R/(6 d²) outside",
    source: "Derjaguin, Muller, Toporov, J. Colloid Interface Sci. 53, 314 (1975)",
    parameters: &[
        MODULUS,
        POISSON,
        TIP_MODULUS,
        TIP_POISSON,
        RADIUS,
        CONTACT_DISTANCE,
        HAMAKER_OF_STIFF_SPHERE,
    ],
    parts: &[Part::Elasticity, Part::Adhesion],
    attracts: true,
    conservative: true,
};

impl Formula for Dmt {
    fn entry(&self) -> &'static Entry {
        &DMT
    }

    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        let strength = p[6] * p[4] * (1.0 / 6.0);
        vec![
            p[5],
            reduced_modulus(p) * Shape::Sphere.factor(p[4]),
            strength,
            strength / p[5].square(),
        ]
    }

    #[inline]
    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, _rate: S) -> S {
        if branch == 0 {
            -c[2] * gap.square().recip()
        } else {
            c[1] * Shape::Sphere.power(c[0] - gap) - c[3]
        }
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        contact_ways(branch, Approach::ThreeHalves)
    }

    fn pole(&self, _c: &[f64]) -> Option<f64> {
        Some(0.0)
    }

    fn energy(&self, c: &[f64], branch: usize, gap: f64) -> Option<f64> {
        let delta = c[0] - gap;
        Some(if branch == 0 {
            -c[2] / gap
        } else {
            -c[2] / c[0] + 0.4 * c[1] * Shape::Sphere.power(delta) * delta - c[3] * delta
        })
    }

    fn remarks(&self, p: &[f64], least_gap: f64) -> Vec<Remark> {
        deep(p[4], p[5], least_gap)
    }
}
