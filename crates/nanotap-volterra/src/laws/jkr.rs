//! JKR: adhesion of an elastic sphere with a neck.
//!
//! `F = 4E*a³/(3R) − √(8π w E* a³)`, `δ = a²/R − √(2πwa/E*)` with the contact radius `a`
//! (Johnson, Kendall, Roberts, Proc. R. Soc. A 324, 1971). On approach contact forms at
//! `d = a0`; the neck breaks at `a³ = πwR²/(8E*)`, where at held ends `F = −(5/6)πwR`: whether the
//! tip is attached is a state, and no force acts while it is not.

use crate::law::{Approach, Remark};
use crate::laws::adhesion::WORK_OF_SOFT_SPHERE;
use crate::laws::elastic::{deep, reduced_modulus};
use crate::laws::entry::{
    CONTACT_DISTANCE, Entry, MODULUS, POISSON, Part, RADIUS, TIP_MODULUS, TIP_POISSON,
};
use crate::laws::formula::{Edge, Formula, Way};
use nanotap_arithmetic::Scalar;
use std::f64::consts::PI;

/// Formula of JKR contact with an adhesive neck; see the module.
#[derive(Clone, Copy, Debug)]
pub struct Jkr;

/// Table entry `jkr`: an elastic sphere with an adhesive neck.
pub static JKR: Entry = Entry {
    name: "jkr",
    words: "elastic sphere with an adhesive neck; attached or not is a state",
    formula: "4E*a³/(3R) − √(8π w E* a³), δ = a²/R − √(2πwa/E*), from d = a0 to a³ = πwR²/(8E*)",
    source: "Johnson, Kendall, Roberts, Proc. R. Soc. Lond. A 324, 301 (1971)",
    parameters: &[
        MODULUS,
        POISSON,
        TIP_MODULUS,
        TIP_POISSON,
        RADIUS,
        CONTACT_DISTANCE,
        WORK_OF_SOFT_SPHERE,
    ],
    parts: &[Part::Elasticity, Part::Adhesion],
    attracts: true,
    conservative: false,
};

impl Formula for Jkr {
    fn entry(&self) -> &'static Entry {
        &JKR
    }

    /// Computes `a0`, `1/R`, `√(2πw/E*)`, `√a` at the end, the gap there, `4E*/(3R)` and
    /// `√(8πwE*)`, in this order.
    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        let (modulus, radius, contact, work) = (reduced_modulus(p), p[4], p[5], p[6]);
        let tension = (work / modulus * (2.0 * PI)).sqrt();
        let cube = radius.square() * work / modulus * (PI / 8.0);
        let least = cube.cbrt();
        vec![
            contact,
            radius.recip(),
            tension,
            least.sqrt(),
            contact + least.square() / radius * 3.0,
            modulus / radius * (4.0 / 3.0),
            (work * modulus * (8.0 * PI)).sqrt(),
        ]
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, _rate: S) -> S {
        if branch == 0 {
            return S::constant(0.0);
        }
        let root = contact_radius_root(c, gap);
        let cube = root.square() * root;
        c[5] * cube.square() - c[6] * cube
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        if branch == 0 {
            vec![Way::new(Edge::Falls(0), 1)]
        } else {
            vec![Way::new(Edge::Rises(4), 0).before(Approach::Half)]
        }
    }

    /// Returns a higher cost than most laws: the contact radius is the root of an equation.
    fn cost(&self) -> u64 {
        2
    }

    fn remembers(&self) -> bool {
        true
    }

    fn vanishes(&self, branch: usize) -> bool {
        branch == 0
    }

    fn remarks(&self, p: &[f64], least_gap: f64) -> Vec<Remark> {
        deep(p[4], p[5], least_gap)
    }
}

/// Returns `√a`, the larger root of `s⁴/R − s √(2πw/E*) = δ`; beyond the end of contact, its value
/// at the end. The end is detected by the gap itself: from `δ`, rounding would sometimes put it on
/// the side of the root, where the slope, and with it the derivatives by parameters, is unbounded.
fn contact_radius_root<S: Scalar>(c: &[S], gap: S) -> S {
    if gap.value() >= c[4].value() {
        return c[3];
    }
    let indentation = c[0] - gap;
    let (curvature, tension, least) = (c[1].value(), c[2].value(), c[3].value());
    let delta = indentation.value();
    // From above the quartic, convex there, lets Newton fall on the root from one side.
    let mut s =
        (delta.max(0.0) / curvature).sqrt().sqrt() + nanotap_arithmetic::cbrt(tension / curvature);
    for _ in 0..60 {
        let cube = curvature * s * s * s;
        let slope = 4.0 * cube - tension;
        let next = s - (cube * s - tension * s - delta) / slope;
        if next >= s || next <= least || next.is_nan() {
            break;
        }
        s = next;
    }
    // One more step in numbers with derivatives differentiates the root.
    let start = S::constant(s);
    let cube = c[1] * (s * s * s);
    let slope = 4.0 * curvature * s * s * s - tension;
    if slope <= 0.0 {
        return c[3];
    }
    start - (cube * s - c[2] * s - indentation) * (1.0 / slope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap_arithmetic::Dual;

    /// Where the neck breaks the force is −(5/6)πwR whatever the modulus (Johnson, Kendall, Roberts
    /// 1971), on every scale: no rounding of the gap puts the end on the side where the force's
    /// slope has no bound.
    #[test]
    fn at_its_end_the_neck_pulls_with_what_the_work_of_adhesion_says() {
        for k in 0..400 {
            let scale = 1.0 + 0.013 * f64::from(k);
            let (radius, work) = (10.0 * scale, 0.02 / scale);
            let by = |varied: usize| {
                let parameters = [100.0, 0.3, 160.0, 0.3, radius, 0.165 * scale, work];
                let parameters: Vec<Dual<1>> = parameters
                    .iter()
                    .enumerate()
                    .map(|(i, &value)| Dual {
                        value,
                        slopes: [f64::from(u8::from(i == varied))],
                    })
                    .collect();
                let c = Jkr.constants(&parameters);
                // As the flow holds it there.
                let values: Vec<f64> = parameters.iter().map(|p| p.value).collect();
                let gap = Dual::constant(Jkr.constants(&values)[4]);
                Jkr.force(&c, 1, gap, Dual::constant(0.0))
            };
            let ends = -5.0 / 6.0 * PI * radius;
            assert!((by(6).value / (ends * work) - 1.0).abs() < 1e-13);
            assert!((by(6).slopes[0] / ends - 1.0).abs() < 1e-12, "{scale}");
            assert!(by(0).slopes[0].abs() < 1e-12 * ends.abs() * work, "{scale}");
        }
    }
}
