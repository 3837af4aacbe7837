//! The starts of a census: states that were given, then seeded draws from boxes of
//! several sizes around one centre.
//!
//! No single size is right. A box as wide as the resonant response contains the basin of a
//! subharmonic a hundred times smaller as one part in a million, and a box as small as that
//! subharmonic contains none of the large motions. Sizes therefore decrease logarithmically, and
//! the drawn starts take them in turn, so that any number of starts has (nearly) as many of each.
//! The fraction of the starts that goes to a motion is a property of this set, not of the motion
//! alone.
//!
//! The k-th start depends on the set and k alone.

use crate::census::start_box::{StartBox, StartBoxError};
use crate::random::mix;

/// A set of starts, given or drawn without end; it has at least one start.
#[derive(Clone, Debug, PartialEq)]
pub struct StartSet {
    seeds: Vec<(usize, Vec<f64>)>,
    given: Vec<Vec<f64>>,
    sizes: Vec<Size>,
    seed: u64,
}

#[derive(Clone, Debug, PartialEq)]
struct Size {
    scale: f64,
    sides: StartBox,
}

/// Origin of one start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartOrigin {
    /// It was given as the state with this index.
    Given(usize),
    /// It was drawn from the box with this index in the order of sizes.
    Drawn(usize),
}

impl StartSet {
    /// Creates the set of starts drawn without end from one box.
    pub fn drawn(sides: StartBox, seed: u64) -> Self {
        Self {
            seeds: Vec::new(),
            given: Vec::new(),
            sizes: vec![Size { scale: 1.0, sides }],
            seed,
        }
    }

    /// Creates the set of starts drawn from `sides` shrunk towards `centre` by each of `scales` (1
    /// is the box itself), in turn.
    ///
    /// # Errors
    /// [`StartBoxError::Centre`] if the centre has another dimension than the box,
    /// [`StartBoxError::NoScale`] without a scale, [`StartBoxError::Side`] if a shrunk
    /// side does not run upwards between finite numbers.
    pub fn spread(
        sides: &StartBox,
        centre: &[f64],
        scales: &[f64],
        seed: u64,
    ) -> Result<Self, StartBoxError> {
        if centre.len() != sides.dimension() {
            return Err(StartBoxError::Centre {
                centre: centre.len(),
                dimension: sides.dimension(),
            });
        }
        if scales.is_empty() {
            return Err(StartBoxError::NoScale);
        }
        let towards = |side: &[f64], scale: f64| -> Vec<f64> {
            side.iter()
                .zip(centre)
                .map(|(s, c)| c + scale * (s - c))
                .collect()
        };
        let sizes = scales
            .iter()
            .map(|&scale| {
                let (lower, upper) = (towards(sides.lower(), scale), towards(sides.upper(), scale));
                let mut shrunk = StartBox::new(lower, upper)?;
                if let Some(wall) = sides.wall() {
                    shrunk = shrunk.before(wall.clone())?;
                }
                Ok(Size {
                    scale,
                    sides: shrunk,
                })
            })
            .collect::<Result<_, StartBoxError>>()?;
        Ok(Self {
            seeds: Vec::new(),
            given: Vec::new(),
            sizes,
            seed,
        })
    }

    /// Creates the set of these states and no others.
    pub fn given(states: Vec<Vec<f64>>) -> Self {
        Self {
            seeds: Vec::new(),
            given: states,
            sizes: Vec::new(),
            seed: 0,
        }
    }

    /// Puts these states before the others of the set. They are followed, but do not count in the
    /// fractions of a set that is drawn.
    #[must_use]
    pub fn with_given(mut self, states: impl IntoIterator<Item = Vec<f64>>) -> Self {
        self.given.extend(states);
        self
    }

    /// Adds orbits that Newton's method closes before any start is followed, each from a period in
    /// drive periods and a state at drive phase 0 near it. Stable ones are attractors even if no
    /// start goes to them.
    #[must_use]
    pub fn with_seeds(mut self, seeds: impl IntoIterator<Item = (usize, Vec<f64>)>) -> Self {
        self.seeds.extend(seeds);
        self
    }

    /// Returns the periods (in drive periods) and states from which orbits are closed first.
    pub fn seeds(&self) -> &[(usize, Vec<f64>)] {
        &self.seeds
    }

    /// Returns the number of given states.
    pub fn given_count(&self) -> usize {
        self.given.len()
    }

    /// Returns the scale of every size, in the order in which they are drawn.
    pub fn scales(&self) -> Vec<f64> {
        self.sizes.iter().map(|s| s.scale).collect()
    }

    /// Returns the box of every size, in the order in which they are drawn.
    pub fn boxes(&self) -> impl Iterator<Item = &StartBox> {
        self.sizes.iter().map(|s| &s.sides)
    }

    /// Returns the seed of the draws.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Returns the number of starts; `None` if they can be drawn without end.
    pub fn len(&self) -> Option<usize> {
        self.sizes.is_empty().then_some(self.given.len())
    }

    /// Returns true if the set contains no start.
    pub fn is_empty(&self) -> bool {
        self.len() == Some(0)
    }

    /// Returns the origin of start number `index`; `None` if there is no such start.
    pub fn origin(&self, index: usize) -> Option<StartOrigin> {
        match index.checked_sub(self.given.len()) {
            None => Some(StartOrigin::Given(index)),
            Some(_) if self.sizes.is_empty() => None,
            Some(drawn) => Some(StartOrigin::Drawn(drawn % self.sizes.len())),
        }
    }

    /// Returns start number `index`; `None` if there is no such start.
    pub fn start(&self, index: usize) -> Option<Vec<f64>> {
        match self.origin(index)? {
            StartOrigin::Given(k) => Some(self.given[k].clone()),
            StartOrigin::Drawn(size) => {
                let turn = (index - self.given.len()) / self.sizes.len();
                // The first size has the seed itself: a set of one size draws what its
                // box would.
                let seed = match size {
                    0 => self.seed,
                    _ => mix(self.seed ^ mix(size as u64)),
                };
                Some(self.sizes[size].sides.start(seed, turn as u64))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> StartBox {
        StartBox::new(vec![-1.0, -2.0], vec![1.0, 2.0]).unwrap()
    }

    #[test]
    fn sizes_take_turns_and_hold_their_starts() {
        let set = StartSet::spread(&square(), &[0.5, 0.0], &[1.0, 0.1, 0.01], 7)
            .unwrap()
            .with_given([vec![9.0, 9.0]]);
        assert_eq!(set.start(0), Some(vec![9.0, 9.0]));
        assert_eq!(set.origin(0), Some(StartOrigin::Given(0)));
        for k in 1..100 {
            let Some(StartOrigin::Drawn(size)) = set.origin(k) else {
                panic!()
            };
            assert_eq!(size, (k - 1) % 3);
            let scale = set.scales()[size];
            let x = set.start(k).unwrap();
            assert!(x[0] >= 0.5 - 1.5 * scale && x[0] <= 0.5 + 0.5 * scale);
            assert!(x[1].abs() <= 2.0 * scale);
        }
        assert_eq!(set.len(), None);
    }

    #[test]
    fn one_size_draws_what_its_box_would() {
        let set = StartSet::drawn(square(), 3);
        for k in 0..10 {
            assert_eq!(set.start(k), Some(square().start(3, k as u64)));
        }
    }

    /// States given before do not change what is drawn, and every size has separate draws.
    #[test]
    fn given_states_leave_the_draws_as_they_are() {
        let drawn = StartSet::spread(&square(), &[0.0, 0.0], &[1.0, 1.0, 1.0], 0).unwrap();
        assert_eq!(drawn.seed(), 0);
        assert!(!drawn.is_empty());
        let more = drawn.clone().with_given([vec![9.0, 9.0], vec![8.0, 8.0]]);
        let starts: Vec<_> = (0..30).map(|k| drawn.start(k).unwrap()).collect();
        for (k, start) in starts.iter().enumerate() {
            assert_eq!(more.start(k + 2).as_ref(), Some(start));
            assert!(!starts[..k].contains(start));
        }
        assert_eq!(StartSet::drawn(square(), 3).seed(), 3);
    }

    #[test]
    fn given_states_end() {
        let set = StartSet::given(vec![vec![1.0], vec![2.0]]);
        assert_eq!((set.len(), set.start(2)), (Some(2), None));
        assert!(StartSet::given(Vec::new()).is_empty());
        assert!(StartSet::spread(&square(), &[0.0], &[1.0], 1).is_err());
        assert!(StartSet::spread(&square(), &[0.0, 0.0], &[], 1).is_err());
        assert!(StartSet::spread(&square(), &[0.0, 0.0], &[f64::NAN], 1).is_err());
    }
}
