//! Van der Waals attraction across the gap, and its value at `a0` in contact.
//!
//! Sphere `−H R/(6 d²)`, cone `−H tan²θ/(6 d)`, flat punch `−H R²/(6 d³)` (pairwise summation,
//! Hamaker, Physica 4, 1937; Israelachvili, Intermolecular and Surface Forces). In contact
//! (`d < a0`) the force is that at `a0`.

use crate::law::Approach;
use crate::laws::adhesion::{HAMAKER, HAMAKER_OF_STIFF_SPHERE};
use crate::laws::elastic::{Shape, contact_ways};
use crate::laws::entry::{CONTACT_DISTANCE, Entry, HALF_ANGLE, Part, RADIUS};
use crate::laws::formula::{Formula, Way};
use nanotap_arithmetic::Scalar;

/// Formula of the van der Waals attraction of a tip of this shape; see the module.
#[derive(Clone, Copy, Debug)]
pub struct VanDerWaals(pub Shape);

/// Table entry `van-der-waals`: the attraction of a sphere.
pub static SPHERE: Entry = Entry {
    name: "van-der-waals",
    words: "van der Waals attraction of a sphere",
    formula: "−H R/(6 d²) for d > a0, −H R/(6 a0²) in contact",
    source: "H. C. Hamaker, Physica 4, 1058 (1937)",
    parameters: &[HAMAKER_OF_STIFF_SPHERE, RADIUS, CONTACT_DISTANCE],
    parts: &[Part::Adhesion],
    attracts: true,
    conservative: true,
};

/// Table entry `van-der-waals-cone`: the attraction of a cone.
pub static CONE: Entry = Entry {
    name: "van-der-waals-cone",
    words: "van der Waals attraction of a cone",
    formula: "−H tan²θ/(6 d) for d > a0, −H tan²θ/(6 a0) in contact",
    source: "H. C. Hamaker, Physica 4, 1058 (1937)",
    parameters: &[HAMAKER, HALF_ANGLE, CONTACT_DISTANCE],
    parts: &[Part::Adhesion],
    attracts: true,
    conservative: true,
};

/// Table entry `van-der-waals-punch`: the attraction of a flat punch.
pub static PUNCH: Entry = Entry {
    name: "van-der-waals-punch",
    words: "van der Waals attraction of a flat cylinder",
    formula: "−H R²/(6 d³) for d > a0, −H R²/(6 a0³) in contact",
    source: "H. C. Hamaker, Physica 4, 1058 (1937)",
    parameters: &[HAMAKER, RADIUS, CONTACT_DISTANCE],
    parts: &[Part::Adhesion],
    attracts: true,
    conservative: true,
};

/// Returns `1/d^m` with `m` 2, 1, 3 for sphere, cone, punch.
fn fall<S: Scalar>(shape: Shape, gap: S) -> S {
    let r = gap.recip();
    match shape {
        Shape::Sphere => r * r,
        Shape::Cone => r,
        Shape::Punch => r * r * r,
    }
}

impl Formula for VanDerWaals {
    fn entry(&self) -> &'static Entry {
        match self.0 {
            Shape::Sphere => &SPHERE,
            Shape::Cone => &CONE,
            Shape::Punch => &PUNCH,
        }
    }

    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        let size = match self.0 {
            Shape::Sphere => p[1],
            Shape::Cone => p[1].tan().square(),
            Shape::Punch => p[1].square(),
        };
        let strength = p[0] * size * (1.0 / 6.0);
        vec![p[2], strength, -strength * fall(self.0, p[2])]
    }

    #[inline]
    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, _rate: S) -> S {
        if branch == 0 {
            -c[1] * fall(self.0, gap)
        } else {
            c[2]
        }
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        contact_ways(branch, Approach::Analytic)
    }

    fn pole(&self, _c: &[f64]) -> Option<f64> {
        Some(0.0)
    }

    fn energy(&self, c: &[f64], branch: usize, gap: f64) -> Option<f64> {
        let away = |d: f64| match self.0 {
            Shape::Sphere => -c[1] / d,
            // The cone's is not bounded far away: it is counted from a0.
            Shape::Cone => c[1] * nanotap_arithmetic::ln(d / c[0]),
            Shape::Punch => -c[1] / (2.0 * d * d),
        };
        Some(if branch == 0 {
            away(gap)
        } else {
            away(c[0]) - c[2] * (gap - c[0])
        })
    }
}
