//! The lever at rest at any distance, in SI, for fits of force curves.

use super::path::physical;
use super::statics::{Piece, Rest, StaticCurve};
use nanotap_case::Case;
use nanotap_error::Error;

/// The lever of a case at rest against the sample.
#[derive(Clone, Debug)]
pub struct RestLever {
    statics: StaticCurve,
    /// Sizes of the model's units in SI.
    length: f64,
    force: f64,
}

/// Stable rests that continue each other.
#[derive(Clone, Debug)]
pub struct Chain(Vec<Piece>);

/// A stable rest of the lever.
#[derive(Clone, Copy, Debug)]
pub struct StableRest {
    rest: Rest,
    /// Deflection away from the sample, m.
    pub deflection: f64,
    /// Force that repels the tip, N.
    pub force: f64,
}

impl RestLever {
    /// The lever of a case; its drive does not count.
    ///
    /// # Errors
    /// When the case has no model or no units.
    pub fn of(case: &Case) -> Result<Self, Error> {
        let view = physical(case)?;
        Ok(Self {
            statics: StaticCurve::new(case, &case.model()?, true)?,
            length: view.scales.length,
            force: view.scales.force,
        })
    }

    /// Chains of stable rests between two distances in m, first the one farthest from the sample.
    pub fn chains(&self, between: [f64; 2]) -> Vec<Chain> {
        let [near, far] = between.map(|z| z / self.length);
        let mut pieces = self.statics.pieces(near, far);
        pieces.retain(|piece| piece.stable);
        pieces.sort_by(|a, b| b.high().gap.total_cmp(&a.high().gap));
        let mut chains: Vec<Chain> = Vec::new();
        for piece in pieces {
            let ends = |chain: &&mut Chain| {
                let last = chain.0.last();
                last.is_some_and(|last| last.low().meets(&piece.high(), far - near))
            };
            match chains.iter_mut().find(ends) {
                Some(chain) => chain.0.push(piece),
                None => chains.push(Chain(vec![piece])),
            }
        }
        chains
    }

    /// The rest of a chain at a distance in m.
    pub fn at(&self, chain: &Chain, distance: f64) -> Option<StableRest> {
        let distance = distance / self.length;
        let mut found = chain.0.iter().filter_map(|p| self.statics.at(p, distance));
        found.next().map(|rest| self.in_si(rest))
    }

    /// The end of a chain that is nearest to a distance in m beyond it.
    pub fn end(&self, chain: &Chain, distance: f64) -> Option<StableRest> {
        let distance = distance / self.length;
        let ends = chain.0.iter().flat_map(|piece| [piece.high(), piece.low()]);
        let away = |rest: &Rest| (rest.distance - distance).abs();
        let nearest = ends.min_by(|a, b| away(a).total_cmp(&away(b)));
        nearest.map(|rest| self.in_si(rest))
    }

    /// The first distance in m at which a quantity of a chain has a value, coming from far.
    pub fn distance_of(
        &self,
        chain: &Chain,
        of: impl Fn(&StableRest) -> f64,
        value: f64,
    ) -> Option<f64> {
        let of = |rest: &Rest| of(&self.in_si(*rest));
        let mut found = chain
            .0
            .iter()
            .filter_map(|p| self.statics.between(&p.rests, of, value));
        found.next().map(|rest| rest.distance * self.length)
    }

    /// The rest of the lowest force in contact, of a lever that goes to the sample and back between
    /// two distances.
    pub fn pull_off(&self, between: [f64; 2]) -> Option<StableRest> {
        let [near, far] = between.map(|z| z / self.length);
        let found = self.statics.branches_and_jumps(near, far).pull_off;
        // At an end of the range the force may fall further beyond it.
        let found = found.filter(|rest| near < rest.distance && rest.distance < far);
        found.map(|rest| self.in_si(rest))
    }

    /// The rest of this lever at a distance near the rest of another lever, to first order in the
    /// difference of both.
    pub fn near(&self, known: &StableRest, of: &Self, distance: f64) -> StableRest {
        let mut rest = known.rest;
        rest.gap *= of.length / self.length;
        let (rest, slopes) = self.statics.nearby(&rest, distance / self.length);
        let mut found = self.in_si(rest);
        let own = of.statics.nearby(&known.rest, distance / of.length).1;
        // The slopes of the other lever, so that those of two levers differ in nothing else.
        if let (Some([by_gap, stiffness]), true) = (own, slopes.is_some()) {
            let change = (distance - rest.distance * self.length) / by_gap;
            found.deflection = rest.gap * self.length + change - distance;
            found.force += stiffness * (of.force / of.length) * change;
        }
        found
    }

    fn in_si(&self, rest: Rest) -> StableRest {
        StableRest {
            rest,
            deflection: (rest.gap - rest.distance) * self.length,
            force: rest.force * self.force,
        }
    }
}
