//! A sample that relaxes: generalised Maxwell solids under a sphere, a cone and a flat punch.
//!
//! The relaxation modulus is a Prony series, `E(t) = E∞ + Σ E_i e^{−t/τ_i}`, `E₀ = E∞ + Σ E_i`. With
//! `δ = a0 − d` and `φ = δ^m` (`m` 3/2, 2, 1) the force of a virgin surface is Lee and Radok's,
//! `F = K ∫ E(t − t') dφ(t')`, until it has fallen to zero. From then on the surface recovers free
//! of force. In one line: `K P = ∫ J(t − t') dF(t')`, `P ≥ φ`, `F ≥ 0`, `F (P − φ) = 0`, with the
//! creep compliance `J` and the surface's depth `P^{1/m}`.
//!
//! The creep compliance has as many retardation modes as there are arms: `P = u + s`,
//! `F = K E₀ u`, `s = Σ η_k`, `η̇_k = −μ_k η_k + g_k u`. The `μ_k` are the zeros of
//! `E*(−μ) = E∞ − Σ E_i μ/(1/τ_i − μ)`, one below each `1/τ_i`, and
//! `g_k = E₀/Σ E_i (1/τ_i)/(1/τ_i − μ_k)²`. In contact `u = φ − s > 0`, in flight `u = 0`; nothing
//! jumps between. The modes are those of a [`Surface`], `s` is the second argument of the law.
//!
//! An attraction acts across the gap to the moving surface, `d + s^{1/m}`, and is constant in
//! contact. The surface does not feel it (as in the theory of Derjaguin, Muller and Toporov), and
//! contact ends where the rest of the force is zero.

use crate::error::VolterraError;
use crate::law::{Approach, Exit, Force, ForceLaw, Guard, Remark, Surface};
use crate::laws::elastic::{Elastic, Shape, deep};
use crate::laws::entry::{
    CONTACT_DISTANCE, CaseKey, Entry, HALF_ANGLE, POISSON, ParameterEntry, Part, RADIUS, Range,
    factor, own, parameters, stated_by,
};
use crate::laws::formula::Law;
use crate::laws::{Make, TableLaw};
use nanotap_quantity::Kind;
use std::sync::Arc;

/// Largest number of arms.
pub const MAX_ARMS: usize = 100;
/// Relative difference of two relaxation times below which they count as one.
const SAME_TIME: f64 = 1e-9;

parameters! {
    const MODULUS = stated_by("modulus", "Young's modulus of the sample at rest, when it has relaxed",
        Kind::Pressure, Some(0.0), Range::NotNegative, CaseKey::Body("sample.modulus"));
    /// Factor of the arms' moduli.
    pub const ARM_MODULUS_FACTOR = factor("arm_modulus_factor", "factor of the arms' moduli",
        Kind::Pressure, Range::Positive, "factor of the moduli of all arms");
    /// Factor of the arms' times.
    pub const ARM_TIME_FACTOR = factor("arm_time_factor",
        "factor of the arms' times, as the shift of a time–temperature superposition", Kind::Time,
        Range::Positive, "factor of the times of all arms: the shift of a time–temperature superposition");
    /// Time beyond which slower arms count as elastic, s.
    pub const HORIZON = own("horizon", "time beyond which slower arms count as elastic", Kind::Time,
        Some(f64::INFINITY), Range::PositiveOrInfinite, "time of observation: slower arms count as elastic",
        1.0);
}

const fn parameters(size: ParameterEntry) -> [ParameterEntry; 7] {
    [
        MODULUS,
        POISSON,
        size,
        CONTACT_DISTANCE,
        ARM_MODULUS_FACTOR,
        ARM_TIME_FACTOR,
        HORIZON,
    ]
}

static ROUND: [ParameterEntry; 7] = parameters(RADIUS);
static POINTED: [ParameterEntry; 7] = parameters(HALF_ANGLE);

const fn entry(
    name: &'static str,
    words: &'static str,
    formula: &'static str,
    parameters: &'static [ParameterEntry],
) -> Entry {
    Entry {
        name,
        words,
        formula,
        source: "E. H. Lee, J. R. M. Radok, J. Appl. Mech. 27, 438 (1960)",
        parameters,
        parts: &[Part::Elasticity],
        attracts: false,
        conservative: false,
    }
}

static SPHERE: Entry = entry(
    "prony-sphere",
    "sample with any number of relaxation times under a sphere; its surface recovers",
    "4/3 √R/(1 − ν²) (E∞ δ^(3/2) + Σ E_i (δ^(3/2) − ξ_i)), τ_i dξ_i/dt = δ^(3/2) − ξ_i, while this pushes",
    &ROUND,
);
static CONE: Entry = entry(
    "prony-cone",
    "sample with any number of relaxation times under a cone; its surface recovers",
    "(2/π) tan θ/(1 − ν²) (E∞ δ² + Σ E_i (δ² − ξ_i)), τ_i dξ_i/dt = δ² − ξ_i, while this pushes",
    &POINTED,
);
static PUNCH: Entry = entry(
    "prony-punch",
    "sample with any number of relaxation times under a flat cylinder; its surface recovers",
    "2R/(1 − ν²) (E∞ δ + Σ E_i (δ − ξ_i)), τ_i dξ_i/dt = δ − ξ_i, while this pushes",
    &ROUND,
);

/// Table of the relaxing laws; their arms are given in addition to the parameters.
pub static TABLE: [TableLaw; 3] = [
    TableLaw {
        entry: &SPHERE,
        make: Make::Arms(Shape::Sphere),
    },
    TableLaw {
        entry: &CONE,
        make: Make::Arms(Shape::Cone),
    },
    TableLaw {
        entry: &PUNCH,
        make: Make::Arms(Shape::Punch),
    },
];

/// Maxwell arms: relaxation times, the shortest first, with their moduli.
#[derive(Clone, Debug, PartialEq)]
pub struct Arms {
    arms: Vec<(f64, f64)>,
    /// Whether the moduli are shear moduli.
    shear: bool,
}

impl Arms {
    /// Creates arms from `(time, modulus)` in any order, an infinite time for a modulus at rest;
    /// with `shear` the moduli are shear moduli.
    ///
    /// # Errors
    /// [`VolterraError::Arms`] for no arms, a time that is not positive, or a modulus
    /// that is negative or not finite; [`VolterraError::TooLarge`] for more than [`MAX_ARMS`].
    pub fn new(arms: &[(f64, f64)], shear: bool) -> Result<Self, VolterraError> {
        let refuse = |arm: usize, reason| {
            Err(VolterraError::Arms {
                arm: arm + 1,
                reason,
            })
        };
        if arms.is_empty() {
            return refuse(0, NO_ARMS);
        }
        if arms.len() > MAX_ARMS {
            return Err(VolterraError::TooLarge {
                what: "the number of arms",
                found: arms.len(),
                limit: MAX_ARMS,
            });
        }
        for (k, (time, modulus)) in arms.iter().enumerate() {
            if time.is_nan() || *time <= 0.0 {
                return refuse(k, "its time must be positive");
            }
            if !(*modulus >= 0.0 && modulus.is_finite()) {
                return refuse(k, "its modulus must be zero or positive, and finite");
            }
        }
        let mut arms = arms.to_vec();
        arms.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(Self { arms, shear })
    }

    /// Returns the arms `(time, modulus)`, the shortest time first.
    pub fn points(&self) -> &[(f64, f64)] {
        &self.arms
    }

    /// Reports whether the moduli are shear moduli.
    pub const fn shear(&self) -> bool {
        self.shear
    }

    /// Returns the modulus at rest and the arms `(rate, modulus)`, the slowest first, with these
    /// values of a law's parameters: Young's moduli, in the law's units.
    pub fn series(&self, parameters: &[f64; 7]) -> Series {
        let [rest, poisson, _, _, by_modulus, by_time, horizon] = *parameters;
        let by_modulus = if self.shear {
            2.0 * (1.0 + poisson) * by_modulus
        } else {
            by_modulus
        };
        let mut series = Series {
            rest,
            arms: Vec::with_capacity(self.arms.len()),
        };
        for (time, modulus) in self.arms.iter().rev() {
            let (time, modulus) = (time * by_time, modulus * by_modulus);
            let rate = 1.0 / time;
            match series.arms.last_mut() {
                _ if modulus == 0.0 => {}
                _ if time > horizon || rate == 0.0 => series.rest += modulus,
                Some((last, sum)) if rate - *last <= SAME_TIME * rate => *sum += modulus,
                _ => series.arms.push((rate, modulus)),
            }
        }
        series
    }
}

const NO_ARMS: &str = "a relaxing sample needs at least one arm";

/// A Prony series of Young's modulus, in the units of the law.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Modulus at rest `E∞`, in the law's unit of pressure (SI: Pa).
    pub rest: f64,
    /// Arms `(1/τ_i, E_i)`, the slowest first, all rates different.
    pub arms: Vec<(f64, f64)>,
}

impl Series {
    /// Returns the instantaneous modulus `E₀ = E∞ + Σ E_i`, in the same unit.
    pub fn instantaneous(&self) -> f64 {
        self.rest + self.arms.iter().map(|(_, modulus)| modulus).sum::<f64>()
    }

    /// Returns storage and loss modulus at an angular frequency, in the same unit.
    pub fn dynamic(&self, omega: f64) -> [f64; 2] {
        let mut moduli = [self.rest, 0.0];
        for (rate, modulus) in &self.arms {
            // With x = ωτ, x²/(1 + x²) and x/(1 + x²).
            let part = modulus / (rate * rate + omega * omega);
            moduli[0] += part * omega * omega;
            moduli[1] += part * omega * rate;
        }
        moduli
    }

    /// Returns the retardation modes `(μ_k, g_k)`, the slowest first.
    ///
    /// # Errors
    /// [`VolterraError::Flows`] without a modulus at rest.
    pub fn modes(&self) -> Result<Vec<(f64, f64)>, VolterraError> {
        if self.rest <= 0.0 {
            return Err(VolterraError::Flows);
        }
        let all = self.instantaneous();
        Ok((0..self.arms.len())
            .map(|k| {
                let (near, offset) = self.zero_below(k);
                let slope: f64 = self
                    .arms
                    .iter()
                    .map(|(rate, modulus)| {
                        let distance = (rate - near) - offset;
                        modulus * rate / (distance * distance)
                    })
                    .sum();
                (near + offset, all / slope)
            })
            .collect())
    }

    /// `Σ E_i μ/(1/τ_i − μ) − E∞` at `μ = near + offset`: it rises from one `1/τ_i` to the next.
    fn excess(&self, near: f64, offset: f64) -> f64 {
        let arms = self.arms.iter();
        let sum: f64 = arms
            .map(|(rate, modulus)| modulus / ((rate - near) - offset))
            .sum();
        (near + offset) * sum - self.rest
    }

    /// Returns the zero between the rate of arm `k` and that of the next slower one, or 0, as an
    /// offset from the nearer end, so that small distances from a pole keep their digits.
    fn zero_below(&self, k: usize) -> (f64, f64) {
        let high = self.arms[k].0;
        let low = k.checked_sub(1).map_or(0.0, |k| self.arms[k].0);
        let half = 0.5 * (high - low);
        let (near, sign) = if self.excess(low, half) > 0.0 {
            (low, 1.0)
        } else {
            (high, -1.0)
        };
        let (mut inner, mut outer) = (0.0, half);
        // Towards the nearer end until its side is bracketed, then halving.
        let passed = |size: f64| sign * self.excess(near, sign * size) > 0.0;
        for _ in 0..2000 {
            let middle = if inner > 0.0 {
                0.5 * (inner + outer)
            } else {
                outer * 0.25
            };
            if middle <= inner || middle >= outer || middle == 0.0 {
                break;
            }
            if passed(middle) {
                outer = middle;
            } else {
                inner = middle;
            }
        }
        (near, sign * 0.5 * (inner + outer))
    }
}

/// A relaxing sample under a tip, with or without an attraction; see the module.
#[derive(Clone, Debug)]
pub struct Prony {
    shape: Shape,
    entry: &'static Entry,
    size: f64,
    /// Gap `a0` at which contact with an undeformed surface begins.
    contact: f64,
    /// Instantaneous stiffness `K E₀` of the contact law.
    stiffness: f64,
    surface: Surface,
    attraction: Option<Attraction>,
}

/// An attraction across the gap to the surface; it is constant in contact.
#[derive(Clone, Debug)]
struct Attraction {
    law: Arc<dyn ForceLaw>,
    /// Branches of contact, and of flight at the end of a contact.
    contact: usize,
    flight: usize,
    /// Levels of the exits of its branches in flight, with 1 if the gap falls to the level and −1
    /// if it rises to it.
    guards: Vec<(f64, f64)>,
}

/// Number of the first guard of an attraction, after those of contact.
const FIRST_GUARD: usize = 2;

impl Attraction {
    /// Accepts a law that depends on the gap alone and is constant in contact, which begins at this
    /// gap; `None` for any other.
    fn of(law: &Arc<dyn ForceLaw>, contact_gap: f64) -> Option<Self> {
        if law.depends_on_rate() || law.surface().is_some() {
            return None;
        }
        // A slow approach from far on, to the branch in which they touch.
        let mut flight = law.branch_at(f64::INFINITY, -1.0);
        let falls = |exit: Exit| match exit.guard {
            Guard::Falls(level) => Some((level, exit.target)),
            _ => None,
        };
        let mut left = law.branches();
        let contact = loop {
            left = left.checked_sub(1)?;
            let next = law.exits(flight).into_iter().filter_map(falls);
            let (level, target) = next.max_by(|a, b| a.0.total_cmp(&b.0))?;
            match (law.touches(target), level == contact_gap) {
                (true, true) => break target,
                (false, false) if level > contact_gap => flight = target,
                _ => return None,
            }
        };
        let [near, deep] = [0.0, 1.0].map(|depth| law.value(contact, contact_gap - depth, 0.0));
        let mut guards = Vec::new();
        for branch in (0..law.branches()).filter(|branch| !law.touches(*branch)) {
            for exit in law.exits(branch) {
                guards.push(match exit.guard {
                    Guard::Falls(level) => (level, 1.0),
                    Guard::Rises(level) => (level, -1.0),
                    Guard::Turns | Guard::Own(_) => return None,
                });
            }
        }
        (near == deep).then(|| Self {
            law: Arc::clone(law),
            contact,
            flight,
            guards,
        })
    }

    /// Returns the number of a guard.
    fn guard(&self, guard: Guard) -> usize {
        let same = |(level, sign): &(f64, f64)| match guard {
            Guard::Falls(other) => *sign > 0.0 && *level == other,
            Guard::Rises(other) => *sign < 0.0 && *level == other,
            Guard::Turns | Guard::Own(_) => false,
        };
        FIRST_GUARD + self.guards.iter().position(same).unwrap_or(0)
    }
}

impl Prony {
    fn new(
        law: &TableLaw,
        shape: Shape,
        arms: &Arms,
        parameters: &[f64; 7],
    ) -> Result<Self, VolterraError> {
        let [_, poisson, size, contact, ..] = *parameters;
        let series = arms.series(parameters);
        let modes = series.modes()?;
        let factor = shape.factor(size) / (1.0 - poisson * poisson);
        let stiffness = factor * series.instantaneous();
        let rigid = [f64::INFINITY, 0.0];
        let relaxed = [series.rest, poisson, rigid[0], rigid[1], size, contact];
        Ok(Self {
            shape,
            entry: law.entry,
            size,
            contact,
            stiffness,
            surface: Surface {
                rates: modes.iter().map(|(rate, _)| *rate).collect(),
                gains: modes.iter().map(|(_, gain)| gain / stiffness).collect(),
                always: false,
                adhesion: 0.0,
                relaxed: Arc::new(Law::new(Elastic(shape), relaxed.to_vec())),
            },
            attraction: None,
        })
    }

    /// Returns the depth `s^{1/m}` and its slope by `s`; both are 0 for an undeformed surface.
    fn depth(&self, s: f64) -> [f64; 2] {
        if s <= 0.0 {
            return [0.0; 2];
        }
        let depth = match self.shape {
            Shape::Sphere => {
                let root = nanotap_arithmetic::cbrt(s);
                root * root
            }
            Shape::Cone => s.sqrt(),
            Shape::Punch => s,
        };
        [depth, depth / (self.shape.exponent() * s)]
    }

    /// Returns `δ^{m−1}`, continued beyond `δ = 0` so that `δ^m` stays smooth for Newton's method.
    fn root(&self, delta: f64) -> f64 {
        match self.shape {
            Shape::Sphere => delta.abs().sqrt(),
            Shape::Cone => delta.abs(),
            Shape::Punch => 1.0,
        }
    }
}

impl ForceLaw for Prony {
    fn parameters(&self) -> Vec<&'static str> {
        let own = self.entry.parameters.iter().map(|p| p.name);
        let others = self.attraction.iter().flat_map(|of| of.law.parameters());
        own.chain(others).collect()
    }

    fn branches(&self) -> usize {
        self.attraction.as_ref().map_or(2, |of| of.law.branches())
    }

    fn branch_at(&self, gap: f64, s: f64) -> usize {
        let delta = self.contact - gap;
        let touches = delta > 0.0 && self.root(delta) * delta > s;
        let Some(attraction) = &self.attraction else {
            return usize::from(touches);
        };
        if touches {
            return attraction.contact;
        }
        let branch = attraction.law.branch_at(gap + self.depth(s)[0], 0.0);
        if attraction.law.touches(branch) {
            attraction.flight
        } else {
            branch
        }
    }

    fn force(&self, branch: usize, gap: f64, s: f64) -> Force {
        if self.touches(branch) {
            let delta = self.contact - gap;
            let root = self.root(delta);
            return Force {
                value: self.stiffness * (root * delta - s) + self.surface.adhesion,
                by_gap: -self.stiffness * self.shape.exponent() * root,
                by_rate: -self.stiffness,
            };
        }
        let Some(attraction) = &self.attraction else {
            return Force::default();
        };
        let [depth, slope] = self.depth(s);
        let force = attraction.law.force(branch, gap + depth, 0.0);
        Force {
            by_rate: force.by_gap * slope,
            ..force
        }
    }

    /// Returns the wall of the attraction, as if the surface were undeformed.
    fn wall(&self) -> Option<f64> {
        self.attraction.as_ref()?.law.wall()
    }

    fn pole(&self) -> Option<f64> {
        self.attraction.as_ref()?.law.pole()
    }

    fn exits(&self, branch: usize) -> Vec<Exit> {
        // Of a virgin surface the force sets in like the power of the law.
        let onset = self.shape.approach();
        let begins = |to| Exit::new(Guard::Own(0), to).with(Approach::Analytic, onset);
        let touches = self.touches(branch);
        match &self.attraction {
            None if touches => vec![Exit::new(Guard::Own(1), 0)],
            None => vec![begins(1)],
            Some(attraction) if touches => vec![Exit::new(Guard::Own(1), attraction.flight)],
            Some(attraction) => {
                let exits = attraction.law.exits(branch).into_iter();
                let own = |exit: Exit| {
                    if attraction.law.touches(exit.target) {
                        return begins(attraction.contact);
                    }
                    Exit::new(Guard::Own(attraction.guard(exit.guard)), exit.target)
                };
                exits.map(own).collect()
            }
        }
    }

    /// Returns the gap to the surface in flight, and `δ − s/δ^{m−1}` in contact, which rises like
    /// `δ` on an undeformed surface.
    fn guard(&self, index: usize, gap: f64, s: f64) -> Force {
        if let (Some(of), Some(number)) = (&self.attraction, index.checked_sub(FIRST_GUARD)) {
            let [depth, slope] = self.depth(s);
            let (level, sign) = of.guards.get(number).copied().unwrap_or((0.0, 1.0));
            return Force {
                value: sign * (gap + depth - level),
                by_gap: sign,
                by_rate: sign * slope,
            };
        }
        if index == 0 {
            let [depth, slope] = self.depth(s);
            return Force {
                value: gap - self.contact + depth,
                by_gap: 1.0,
                by_rate: slope,
            };
        }
        let delta = self.contact - gap;
        let root = self.root(delta);
        if delta <= 0.0 || s <= 0.0 {
            return Force {
                value: delta,
                by_gap: -1.0,
                by_rate: 0.0,
            };
        }
        Force {
            value: delta - s / root,
            by_gap: -1.0 - (self.shape.exponent() - 1.0) * s / (root * delta),
            by_rate: -1.0 / root,
        }
    }

    /// Writes NaN: the arms change the surface's modes, which no derivative of the force describes.
    fn by_parameters(&self, _branch: usize, _gap: f64, _s: f64, out: &mut [f64]) {
        out.fill(f64::NAN);
    }

    fn guard_by_parameters(&self, _: usize, _: usize, _: f64, _: f64, out: &mut [f64]) {
        out.fill(f64::NAN);
    }

    fn surface(&self) -> Option<&Surface> {
        Some(&self.surface)
    }

    fn with_attraction(&self, law: &Arc<dyn ForceLaw>) -> Option<Arc<dyn ForceLaw>> {
        let attraction = Attraction::of(law, self.contact).filter(|_| self.attraction.is_none())?;
        let mut whole = self.clone();
        whole.surface.adhesion = law.value(attraction.contact, self.contact, 0.0);
        let relaxed = vec![Arc::clone(&self.surface.relaxed), Arc::clone(law)];
        whole.surface.relaxed = Arc::new(super::sum::Sum::new(relaxed));
        whole.attraction = Some(attraction);
        Some(Arc::new(whole))
    }

    fn touches(&self, branch: usize) -> bool {
        let attraction = self.attraction.as_ref();
        attraction.map_or(branch > 0, |of| of.law.touches(branch))
    }

    fn remembers(&self) -> bool {
        self.attraction
            .as_ref()
            .is_some_and(|of| of.law.remembers())
    }

    fn vanishes(&self, branch: usize) -> bool {
        let attraction = self.attraction.as_ref();
        !self.touches(branch) && attraction.is_none_or(|of| of.law.vanishes(branch))
    }

    fn remarks(&self, least_gap: f64) -> Vec<Remark> {
        if self.shape == Shape::Cone {
            return Vec::new();
        }
        deep(self.size, self.contact, least_gap)
    }
}

impl TableLaw {
    /// Reports whether the law has Maxwell arms.
    pub const fn has_arms(&self) -> bool {
        matches!(self.make, Make::Arms(_))
    }

    /// Builds the law with these arms and the parameters of its entry.
    ///
    /// # Errors
    /// As for [`TableLaw::with`]; [`VolterraError::Flows`] without a modulus at rest.
    pub fn with_arms(
        &self,
        arms: &Arms,
        parameters: &[f64],
    ) -> Result<Arc<dyn ForceLaw>, VolterraError> {
        self.check(parameters)?;
        match (self.make, <&[f64; 7]>::try_from(parameters)) {
            (Make::Arms(shape), Ok(parameters)) => {
                Ok(Arc::new(Prony::new(self, shape, arms, parameters)?))
            }
            _ => self.with(parameters),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One arm: `μ = E∞/(E₀ τ)` and `g = E₁/(E₀ τ)`.
    #[test]
    fn one_arm_has_the_retardation_time_of_its_closed_form() {
        let series = Arms::new(&[(2.0, 4.0)], false).unwrap().series(&[
            5.0,
            0.5,
            1.0,
            0.0,
            1.0,
            1.0,
            f64::INFINITY,
        ]);
        let [(rate, gain)] = series.modes().unwrap()[..] else {
            panic!("one mode")
        };
        assert!((rate - 5.0 / 9.0 / 2.0).abs() < 1e-16);
        assert!((gain - 4.0 / 9.0 / 2.0).abs() < 1e-16);
    }

    /// Over twelve decades the modes interlace the arms, and their sums are the moments of
    /// `E₀/E*`: `Σ g = Σ (E_i/E₀)/τ_i` and `Σ g/μ = E₀/E∞ − 1`.
    #[test]
    fn modes_interlace_the_arms_and_have_the_compliance_of_the_series() {
        let arms: Vec<(f64, f64)> = (0..25)
            .map(|k: i32| {
                let size = 0.3 + f64::from((7 * k) % 11);
                (10_f64.powf(0.5 * f64::from(k) - 7.0), size * 1e-3)
            })
            .collect();
        let series = Arms::new(&arms, false).unwrap().series(&[
            1e-3,
            0.5,
            1.0,
            0.0,
            1.0,
            1.0,
            f64::INFINITY,
        ]);
        let modes = series.modes().unwrap();
        for (k, (rate, gain)) in modes.iter().enumerate() {
            assert!(*gain > 0.0 && *rate < series.arms[k].0);
            assert!(k == 0 || *rate > series.arms[k - 1].0);
        }
        let all = series.instantaneous();
        let fast: f64 = series.arms.iter().map(|(r, e)| r * e / all).sum();
        let gains: f64 = modes.iter().map(|(_, g)| g).sum();
        assert!((gains / fast - 1.0).abs() < 1e-13);
        let slow: f64 = modes.iter().map(|(r, g)| g / r).sum();
        assert!((slow / (all / series.rest - 1.0) - 1.0).abs() < 1e-13);
    }

    #[test]
    fn a_sample_without_a_modulus_at_rest_is_refused_unless_slow_arms_count() {
        let arms = Arms::new(&[(1.0, 2.0), (1e6, 3.0)], true).unwrap();
        let with = |horizon: f64| arms.series(&[0.0, 0.5, 1.0, 0.0, 1.0, 1.0, horizon]);
        assert_eq!(with(f64::INFINITY).modes(), Err(VolterraError::Flows));
        let series = with(100.0);
        // Shear moduli count as E = 3 G at ν = ½.
        assert_eq!((series.rest, series.instantaneous()), (9.0, 15.0));
        assert!(Arms::new(&[(0.0, 1.0)], false).is_err());
        assert!(Arms::new(&[(1.0, -1.0)], false).is_err());
        assert!(Arms::new(&[], false).is_err());
    }
}
