//! A moving surface with adhesion (Thorén, Haviland and others: the sample of intermodulation
//! AFM): the surface has a height s of its own, a spring k_s and a damper η_s to it, and the tip
//! touches it through the spring α4, the damper α6 and a constant adhesion F.
//!
//! With g = V_T − s the tip's height over the surface, in contact (g < 0)
//!
//! `f = −F − α4 g − α6 ġ`, `η_s ṡ + k_s s = −f`, so that
//! `(η_s + α6) ṡ = F + α4 V_T + α6 V̇_T − (α4 + k_s) s`,
//!
//! and in flight f = 0 and η_s ṡ + k_s s = 0. Contact begins and ends where g = 0; s is the
//! memory, which never jumps. The force does, and with it ṡ and the gap's rate: of ġ⁻ in flight
//! and ġ⁺ in contact at the same state
//!
//! `(η_s + α6) ġ⁺ = η_s ġ⁻ − F`.
//!
//! So a tip that meets the surface is pulled in (ġ⁻ ≤ 0 makes ġ⁺ < 0), and one that is let go is
//! left behind at once (ġ⁺ ≥ 0 makes ġ⁻ > 0, at least F/η_s): no motion slides along g = 0, and no
//! switch is followed at once by the next. States with g = 0 and 0 < ġ⁻ < F/η_s could go on
//! either way; no motion arrives at one, and a start there is in flight, since contact is g < 0.
//! A touch that only grazes is pulled in by a force that does not begin at zero: the map has a
//! square root there, and an orbit does not survive its grazing.
//!
//! Stored in contact is ½ α4 g² + F g beside the surface's own ½ k_s s²; the adhesion gives on
//! the way in what it takes on the way out, and all that is lost is lost in the two dampers.

use serde::{Serialize, Serializer};

use super::dual::Dual;
use super::law::{Answer, Bilinear, Combination, Law, Square};
use crate::model::parameter::Parameter;

/// What a moving surface has beside α4 and α6, in the model's units (or in SI among physical
/// quantities); all zero of other samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MovingSurface {
    /// Its own stiffness k_s, above zero.
    pub stiffness: f64,
    /// Its own damping η_s, above zero.
    pub damping: f64,
    /// Force F that pulls the touching tip to it, ≥ 0.
    pub adhesion: f64,
}

impl MovingSurface {
    /// Of a sample that has no such surface.
    pub const NONE: Self = Self {
        stiffness: 0.0,
        damping: 0.0,
        adhesion: 0.0,
    };
}

/// The keys of a case for what is there, nothing of other samples.
impl Serialize for MovingSurface {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let numbers = [
            (Parameter::SurfaceStiffness, self.stiffness),
            (Parameter::SurfaceDamping, self.damping),
            (Parameter::AdhesionForce, self.adhesion),
        ];
        let any = numbers.iter().filter(|_| *self != Self::NONE);
        serializer.collect_map(any.map(|(parameter, number)| (parameter.name(), number)))
    }
}

/// The law.
pub(super) fn law(
    [stiffness, damping]: [Dual; 2],
    [own_stiffness, own_damping, adhesion]: [Dual; 3],
) -> Law {
    let one = Dual::constant(1.0);
    let both = own_damping + damping;
    let gap = Combination::height(one).plus(Combination::memory(-one));
    let recovers = Combination::memory(-(own_stiffness / own_damping));
    let moves = Combination::constant(adhesion)
        .plus(Combination::height(stiffness))
        .plus(Combination::rate(damping))
        .plus(Combination::memory(-(stiffness + own_stiffness)))
        .times(one / both);
    let gap_rate = Combination::rate(one).plus(moves.times(-one));
    let lost = |weight: Dual, of| Square {
        weight: weight.value,
        of,
    };
    let of_surface = Bilinear::from(Square {
        weight: 0.5 * own_stiffness.value,
        of: Combination::memory(one),
    });
    Law {
        has_memory: true,
        gap,
        hold: gap.times(-one),
        left: None,
        onsets: None,
        flight: Answer {
            force: Combination::default(),
            memory_rate: recovers,
            dissipated: vec![lost(own_damping, recovers)],
            stored: vec![of_surface],
        },
        contact: Answer {
            force: moves
                .times(-own_damping)
                .plus(Combination::memory(-own_stiffness)),
            memory_rate: moves,
            dissipated: vec![lost(own_damping, moves), lost(damping, gap_rate)],
            stored: vec![
                of_surface,
                Bilinear {
                    weight: 1.0,
                    one: gap,
                    other: gap
                        .times(0.5 * stiffness)
                        .plus(Combination::constant(adhesion)),
                },
            ],
        },
        plain_contact: false,
    }
}
