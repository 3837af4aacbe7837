//! Electrostatic attraction of a biased sphere, and DLVO interaction in an electrolyte.
//!
//! `−π ε U² R²/(d (d + R))` (Hudlet, Saint Jean, Guthmann, Berger, Eur. Phys. J. B 2, 1998);
//! `(4πR/ε) σ_tσ_s λ_D e^{−d/λ_D} − H R/(6 d²)` (Butt, Cappella, Kappl, Surf. Sci. Rep. 59,
//! 2005), `ε` the absolute permittivity of the medium. In contact (`d < a0`) each stays as it
//! is at `a0`, so that neither jumps there.

use crate::law::{Approach, ForceLaw};
use crate::laws::adhesion::HAMAKER;
use crate::laws::elastic::contact_ways;
use crate::laws::entry::{
    CONTACT_DISTANCE, CaseKey, Entry, KeyEntry, ParameterEntry, Part, RADIUS, Range, own,
    parameters, stated_by,
};
use crate::laws::formula::{Formula, Law, Way};
use nanotap_arithmetic::Scalar;
use nanotap_quantity::{Dimension, Display, Kind, KindEntry};
use std::f64::consts::PI;
use std::sync::Arc;

/// Permittivity of free space, F/m.
const VACUUM: f64 = 8.854_187_812_8e-12;

parameters! {
    /// Voltage between tip and sample, V.
    pub const VOLTAGE = own("voltage", "voltage U between tip and sample", Kind::Voltage, None,
        Range::Finite, "dc voltage between tip and sample (electrostatic, electrostatic-ac)", 1.0);
}

/// Absolute permittivity of the medium, F/m.
pub const PERMITTIVITY: ParameterEntry = stated_by(
    "permittivity",
    "absolute permittivity of the medium",
    Kind::new(&KindEntry {
        name: "permittivity",
        dimension: Dimension::new(-1, -3, 2).charged(2),
        si_unit: "F/m",
        display: Display::Unit,
        noun: "a permittivity",
        example: "8.85e-12 C^2/(N m^2)",
        model_unit: None,
    }),
    Some(VACUUM),
    Range::Positive,
    CaseKey::Own(
        KeyEntry::new(
            "permittivity",
            Kind::Number,
            Range::Positive,
            "permittivity of the medium over that of free space",
            1.0,
        )
        .multiple_of(VACUUM),
    ),
)
.assumed();

const fn charge(
    name: &'static str,
    words: &'static str,
    of_tip: bool,
    meaning: &'static str,
) -> ParameterEntry {
    let key = KeyEntry {
        of_tip,
        ..KeyEntry::new("charge", Kind::ChargeDensity, Range::Finite, meaning, -0.02)
    };
    stated_by(
        name,
        words,
        Kind::ChargeDensity,
        None,
        Range::Finite,
        CaseKey::Own(key),
    )
}

/// Formula of the electrostatic attraction of a biased sphere; see the module.
#[derive(Clone, Copy, Debug)]
pub struct Electrostatic;

/// Table entry `electrostatic`: a biased sphere above a conducting sample.
pub static ELECTROSTATIC: Entry = Entry {
    name: "electrostatic",
    words: "electrostatic attraction of a biased sphere and a conducting sample",
    formula: "−π ε U² R²/(d (d + R)) for d > a0, its value at a0 in contact",
    source: "Hudlet, Saint Jean, Guthmann, Berger, Eur. Phys. J. B 2, 5 (1998)",
    parameters: &[VOLTAGE, RADIUS, CONTACT_DISTANCE, PERMITTIVITY],
    parts: &[],
    attracts: true,
    conservative: true,
};

impl Formula for Electrostatic {
    fn entry(&self) -> &'static Entry {
        &ELECTROSTATIC
    }

    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        let strength = p[3] * p[0].square() * p[1].square() * (-PI);
        vec![p[2], strength, p[1], strength / (p[2] * (p[2] + p[1]))]
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, _rate: S) -> S {
        if branch == 0 {
            c[1] / (gap * (gap + c[2]))
        } else {
            c[3]
        }
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        contact_ways(branch, Approach::Analytic)
    }

    fn pole(&self, _c: &[f64]) -> Option<f64> {
        Some(0.0)
    }

    fn energy(&self, c: &[f64], branch: usize, gap: f64) -> Option<f64> {
        let away = |d: f64| c[1] / c[2] * nanotap_arithmetic::ln_1p(c[2] / d);
        Some(if branch == 0 {
            away(gap)
        } else {
            away(c[0]) - c[3] * (gap - c[0])
        })
    }
}

/// Formula of the electrostatic attraction of a sphere under dc and ac voltage.
#[derive(Clone, Copy, Debug)]
pub struct ElectrostaticAc {
    /// Whether the force is averaged over the ac voltage.
    pub averaged: bool,
}

parameters! {
    /// Amplitude of the ac voltage, V.
    pub const AC_VOLTAGE = own("ac_voltage", "amplitude V of the ac voltage", Kind::Voltage, None,
        Range::Finite,
        "amplitude of an ac voltage between tip and sample at the frequency of the second tone of the drive (electrostatic-ac)",
        1.0);
    /// Contact potential difference, V.
    pub const CONTACT_POTENTIAL = own("contact_potential", "contact potential difference U_c",
        Kind::Voltage, Some(0.0), Range::Finite,
        "contact potential difference, which the voltage compensates (electrostatic-ac)", 1.0);
}

/// Table entry `electrostatic-ac`: a sphere under dc and ac voltage.
pub static ELECTROSTATIC_AC: Entry = Entry {
    name: "electrostatic-ac",
    words: "electrostatic attraction under dc and ac voltage (KPFM, EFM)",
    formula: "−π ε R² (U − U_c + V cos ωt)²/(d (d + R)) for d > a0, its value at a0 in contact; ω is the \
              frequency of the second tone of the drive",
    source: "Hudlet, Saint Jean, Guthmann, Berger, Eur. Phys. J. B 2, 5 (1998); Nonnenmacher, O'Boyle, \
             Wickramasinghe, Appl. Phys. Lett. 58, 2921 (1991)",
    parameters: &[
        VOLTAGE,
        AC_VOLTAGE,
        CONTACT_POTENTIAL,
        RADIUS,
        CONTACT_DISTANCE,
        PERMITTIVITY,
    ],
    parts: &[],
    attracts: true,
    conservative: false,
};

impl Formula for ElectrostaticAc {
    fn entry(&self) -> &'static Entry {
        &ELECTROSTATIC_AC
    }

    /// Computes `a0`, `−π ε R²`, `R`, `−π ε R²/(a0 (a0 + R))`, `U − U_c` and `V`, in this order.
    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        let strength = p[5] * p[3].square() * (-PI);
        let contact = strength / (p[4] * (p[4] + p[3]));
        vec![p[4], strength, p[3], contact, p[0] - p[2], p[1]]
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, signal: S) -> S {
        let square = if self.averaged {
            c[4].square() + c[5].square() * 0.5
        } else {
            (c[4] + c[5] * signal).square()
        };
        let unit = if branch == 0 {
            c[1] / (gap * (gap + c[2]))
        } else {
            c[3]
        };
        unit * square
    }

    fn depends_on_rate(&self) -> bool {
        !self.averaged
    }

    fn takes_signal(&self) -> bool {
        !self.averaged
    }

    fn averaged(&self, p: &[f64]) -> Option<Arc<dyn ForceLaw>> {
        let law = Law::new(Self { averaged: true }, p.to_vec());
        (!self.averaged).then(|| Arc::new(law) as Arc<dyn ForceLaw>)
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        contact_ways(branch, Approach::Analytic)
    }

    fn pole(&self, _c: &[f64]) -> Option<f64> {
        Some(0.0)
    }
}

/// Formula of double-layer force and van der Waals attraction in an electrolyte.
#[derive(Clone, Copy, Debug)]
pub struct Dlvo;

parameters! {
    /// Surface charge density of the tip, C/m².
    pub const TIP_CHARGE = charge("tip_charge", "surface charge density of the tip", true,
        "surface charge density of the tip (dlvo)");
    /// Surface charge density of the sample, C/m².
    pub const SAMPLE_CHARGE = charge("sample_charge", "surface charge density of the sample", false,
        "surface charge density of the sample (dlvo)");
    /// Debye length of the electrolyte, m.
    pub const DEBYE_LENGTH = own("debye_length", "Debye length λ_D", Kind::Length, None, Range::Positive,
        "Debye length of the electrolyte (dlvo)", 3e-9);
}

/// Table entry `dlvo`: a sphere in an electrolyte.
pub static DLVO: Entry = Entry {
    name: "dlvo",
    words: "double-layer force and van der Waals attraction of a sphere in an electrolyte",
    formula: "(4πR/ε) σ_t σ_s λ_D e^(−d/λ_D) − H R/(6 d²) for d > a0, its value at a0 in contact",
    source: "Butt, Cappella, Kappl, Surf. Sci. Rep. 59, 1 (2005)",
    parameters: &[
        HAMAKER,
        RADIUS,
        CONTACT_DISTANCE,
        TIP_CHARGE,
        SAMPLE_CHARGE,
        DEBYE_LENGTH,
        PERMITTIVITY,
    ],
    parts: &[Part::Adhesion],
    attracts: true,
    conservative: true,
};

impl Formula for Dlvo {
    fn entry(&self) -> &'static Entry {
        &DLVO
    }

    /// Computes `a0`, the strength of the double layer, `−1/λ_D`, `H R/6` and the force in contact,
    /// in this order.
    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        let layer = p[1] / p[6] * p[3] * p[4] * p[5] * (4.0 * PI);
        let decay = -p[5].recip();
        let attraction = p[0] * p[1] * (1.0 / 6.0);
        vec![
            p[2],
            layer,
            decay,
            attraction,
            layer * (decay * p[2]).exp() - attraction / p[2].square(),
        ]
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, _rate: S) -> S {
        if branch == 0 {
            c[1] * (c[2] * gap).exp() - c[3] * gap.square().recip()
        } else {
            c[4]
        }
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        contact_ways(branch, Approach::Analytic)
    }

    fn pole(&self, _c: &[f64]) -> Option<f64> {
        Some(0.0)
    }

    fn energy(&self, c: &[f64], branch: usize, gap: f64) -> Option<f64> {
        let away = |d: f64| -c[1] / c[2] * nanotap_arithmetic::exp(c[2] * d) - c[3] / d;
        Some(if branch == 0 {
            away(gap)
        } else {
            away(c[0]) - c[4] * (gap - c[0])
        })
    }
}
