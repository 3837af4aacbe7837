//! The analytic pieces of a formula, and how one follows another.

// Only what is inlined into a function for wide registers gets their instructions.
#![allow(clippy::inline_always)]

use nanotap_arithmetic::Dual;
use std::collections::{HashMap, HashSet};

use crate::error::FormulaError;
use crate::node::{Function, Id, Node, Nodes, Operator, Test};
use crate::number::{LANES, Lanes, Number};
use crate::program::{MAX_NUMBERS, Program, needed, values_of};

/// Largest number of pieces.
const MAX_PIECES: usize = 64;
/// Relative difference below which two gaps at which pieces end are one: rounding of their formulas.
const SAME_LEVEL: f64 = 1e-13;
/// Distance behind the end of a piece at which the piece that follows is looked for, in the unit of the gap.
const BEHIND: f64 = 1e-12;
/// Speeds of the tip at which it is looked for, in the unit of the rate: small and ordinary ones.
const SPEEDS: [f64; 3] = [1e-4, 1e-2, 1.0];

/// The behaviour of a piece at one of its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Smoothness {
    /// Analytic up to the end and beyond.
    Analytic,
    /// A fractional power above 1 of the distance from the end.
    FiniteSlope,
    /// A fractional power below 1.
    InfiniteSlope,
}

/// The condition under which a piece ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The gap falls to the level of this number.
    Falls(usize),
    /// The gap rises to the level of this number.
    Rises(usize),
    /// The gap stops falling.
    Turns,
    /// The quantity of this number falls to zero ([`Pieces::guard`]).
    Guard(usize),
}

/// What follows when a piece ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exit {
    /// Why the piece ends.
    pub end: End,
    /// Number of the piece that follows.
    pub target: usize,
}

/// The second argument of a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Second {
    /// The rate of the gap.
    Rate,
    /// A memory.
    Memory,
    /// A memory that is the depth of the surface.
    Surface,
}

/// A number with its derivatives by gap and rate.
pub type Value = Dual<2>;

/// A program with the values of its fixed part.
#[derive(Clone, Debug)]
struct Evaluated {
    program: Program,
    plain: Vec<f64>,
    /// The fixed part with its derivatives by each parameter.
    varied: Vec<Vec<Dual<1>>>,
}

impl Evaluated {
    fn new(nodes: &Nodes, id: Id, values: &[f64]) -> Self {
        let program = Program::of(nodes, id);
        let plain = program.fixed(values);
        let seeded = |k: usize| {
            let seed = |i: usize, &value: &f64| Dual::new(value, f64::from(u8::from(i == k)));
            let values: Vec<_> = values.iter().enumerate().map(|(i, v)| seed(i, v)).collect();
            program.fixed(&values)
        };
        Self {
            varied: (0..values.len()).map(seeded).collect(),
            plain,
            program,
        }
    }

    fn value(&self, gap: f64, rate: f64) -> f64 {
        self.program.at(|k| self.plain[k], gap, rate)
    }

    fn at(&self, gap: f64, rate: f64) -> Dual<2> {
        let (gap, rate) = (Dual::variable(gap, 0), Dual::variable(rate, 1));
        self.program
            .at(|k| Dual::constant(self.plain[k]), gap, rate)
    }

    fn by_parameter(&self, number: usize, gap: f64, rate: f64) -> f64 {
        let (gap, rate) = (Dual::constant(gap), Dual::constant(rate));
        self.program
            .at(|k| self.varied[number][k], gap, rate)
            .slopes[0]
    }
}

/// A condition that is no level of the gap, on one piece: positive inside it.
#[derive(Clone, Debug)]
struct Guard {
    /// Node of the test that it belongs to.
    test: Id,
    truth: bool,
    quantity: Evaluated,
}

impl Guard {
    fn sign(&self) -> f64 {
        if self.truth { 1.0 } else { -1.0 }
    }
}

#[derive(Clone, Debug)]
struct Piece {
    /// Number of levels below it.
    interval: usize,
    turned: bool,
    force: Evaluated,
    /// Numbers of its guards.
    guards: Vec<usize>,
    exits: Vec<Exit>,
    /// Behaviour at its lower and upper end.
    ends: [Smoothness; 2],
    touches: bool,
    /// Its behaviour at conditions on gap and memory, by their tests.
    onsets: Vec<(Id, Smoothness)>,
}

/// A formula with values of its parameters, as analytic pieces; those at large gaps come first.
#[derive(Clone, Debug)]
pub struct Pieces {
    all: Vec<Piece>,
    guards: Vec<Guard>,
    levels: Vec<f64>,
    /// The levels' own programs; none for the level at which contact begins.
    level_programs: Vec<Option<Evaluated>>,
    /// Number of the level at which contact begins; none over a moving surface.
    contact: Option<usize>,
    second: Second,
    pole: Option<f64>,
}

/// What a test says without a look at the rate.
#[derive(Clone, Copy)]
enum TestOutcome {
    Always(bool),
    /// Positive above the level of this number, or below it.
    Level {
        number: usize,
        above: bool,
    },
}

/// A test that has to be decided before an expression is without choices.
struct Undecided {
    test: Id,
    guard: Id,
}

/// An expression on its way to one without choices.
struct Choosing<'a> {
    nodes: &'a mut Nodes,
    known: &'a HashMap<Id, TestOutcome>,
    aliases: &'a HashMap<Id, (Id, bool)>,
    interval: usize,
    turned: bool,
    decided: &'a [(Id, Id, bool)],
    done: HashMap<Id, Id>,
}

impl Choosing<'_> {
    fn chosen(&mut self, id: Id) -> Result<Id, Undecided> {
        if !self.nodes.depends(id).chooses {
            return Ok(id);
        }
        if let Some(&done) = self.done.get(&id) {
            return Ok(done);
        }
        let done = match self.nodes.node(id) {
            Node::Of(function, a) => {
                let a = self.chosen(a)?;
                self.nodes.of(function, a)
            }
            Node::Two(operator, a, b) => {
                let (a, b) = (self.chosen(a)?, self.chosen(b)?);
                self.nodes.two(operator, a, b)
            }
            Node::Choice { test, yes, no } => {
                let truth = match test {
                    Test::Turned => self.turned,
                    Test::Positive(test) => self.truth(test)?,
                };
                self.chosen(if truth { yes } else { no })?
            }
            Node::Number(_) | Node::Parameter(_) | Node::Gap | Node::Rate => id,
        };
        self.done.insert(id, done);
        Ok(done)
    }

    fn truth(&mut self, test: Id) -> Result<bool, Undecided> {
        if let Some(&(other, same)) = self.aliases.get(&test) {
            return Ok(self.truth(other)? == same);
        }
        match self.known.get(&test) {
            Some(TestOutcome::Always(truth)) => return Ok(*truth),
            Some(TestOutcome::Level { number, above }) => {
                return Ok((self.interval > *number) == *above);
            }
            None => {}
        }
        if let Some((.., truth)) = self.decided.iter().find(|(other, ..)| *other == test) {
            return Ok(*truth);
        }
        let guard = self.chosen(test)?;
        match self.nodes.value(guard) {
            Some(value) => Ok(value > 0.0),
            None => Err(Undecided { test, guard }),
        }
    }
}

impl Pieces {
    pub(crate) fn new(
        text: &str,
        mut nodes: Nodes,
        root: Id,
        values: &[f64],
        contact: f64,
        second: Second,
    ) -> Result<Self, FormulaError> {
        let refuse = |place, reason: &str| Err(FormulaError::new(text, place, reason));
        // Gaps at which a choice changes, in order, and where contact begins.
        let mut found: Vec<(f64, Option<Evaluated>)> = vec![(contact, None)];
        let remembers_force = second != Second::Rate;
        // Of conditions on gap and memory that are one, the first stands for all.
        let mut planes: Vec<(Id, [f64; 3])> = Vec::new();
        let mut aliases: HashMap<Id, (Id, bool)> = HashMap::new();
        let outside = (second == Second::Surface).then(|| {
            found.clear();
            let [gap, depth] = [Node::Gap, Node::Rate].map(|node| nodes.add(node));
            let height = nodes.two(Operator::Plus, gap, depth);
            let contact_gap = nodes.number(contact);
            let outside = nodes.two(Operator::Minus, height, contact_gap);
            planes.push((outside, [1.0, 1.0, -contact]));
            outside
        });
        let mut of_test: HashMap<Id, (f64, f64)> = HashMap::new();
        let mut known: HashMap<Id, TestOutcome> = HashMap::new();
        for id in 0..nodes.len() {
            let Node::Choice {
                test: Test::Positive(test),
                ..
            } = nodes.node(id)
            else {
                continue;
            };
            nodes.place = nodes.place(test);
            let Some([slope, constant]) = nodes.line(test) else {
                let plane = nodes.plane(test).filter(|_| remembers_force);
                if let Some(plane) =
                    plane.map(|plane| plane.map(|id| fixed_value(&nodes, id, values)))
                {
                    match planes.iter().find(|(_, other)| is_parallel(plane, *other)) {
                        Some(&(other, _)) if other == test => {}
                        Some((other, known)) => {
                            aliases.insert(test, (*other, (plane[1] > 0.0) == (known[1] > 0.0)));
                        }
                        None => planes.push((test, plane)),
                    }
                }
                continue;
            };
            let [slope_value, constant_value] =
                [slope, constant].map(|id| fixed_value(&nodes, id, values));
            if slope_value == 0.0 {
                known.insert(test, TestOutcome::Always(constant_value > 0.0));
                continue;
            }
            let quotient = nodes.two(Operator::Over, constant, slope);
            let level = nodes.negative(quotient);
            let level = Evaluated::new(&nodes, level, values);
            let gap = level.value(0.0, 0.0);
            if !gap.is_finite() {
                return refuse(nodes.place(test), "it changes its sign at no finite gap");
            }
            of_test.insert(test, (gap, slope_value));
            found.push((gap, Some(level)));
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Of equal levels one stays, which moves with the parameters as a choice does.
        found.dedup_by(|later, kept| {
            let equal = is_same(later.0, kept.0);
            if equal && kept.1.is_none() {
                kept.1 = later.1.take();
            }
            equal
        });
        let (levels, level_programs): (Vec<f64>, Vec<_>) = found.into_iter().unzip();
        let number = |gap: f64| {
            levels
                .iter()
                .position(|level| is_same(*level, gap))
                .unwrap_or(0)
        };
        for (test, (gap, slope)) in of_test {
            let (number, above) = (number(gap), slope > 0.0);
            known.insert(test, TestOutcome::Level { number, above });
        }
        let contact = outside.is_none().then(|| number(contact));
        let remembers = nodes.depends(root).turned;
        let mut pieces = Self {
            all: Vec::new(),
            guards: Vec::new(),
            levels,
            level_programs,
            contact,
            second,
            pole: None,
        };
        let mut roots = Vec::new();
        for interval in (0..=pieces.levels.len()).rev() {
            for turned in [false, true] {
                if turned && !(remembers && contact.is_some_and(|level| interval <= level)) {
                    continue;
                }
                let mut open = match outside {
                    // Those without contact come first.
                    Some(test) => vec![vec![(test, test, false)], vec![(test, test, true)]],
                    None => vec![Vec::new()],
                };
                while let Some(decided) = open.pop() {
                    let mut choosing = Choosing {
                        nodes: &mut nodes,
                        known: &known,
                        aliases: &aliases,
                        interval,
                        turned,
                        decided: &decided,
                        done: HashMap::new(),
                    };
                    match choosing.chosen(root) {
                        Err(Undecided { test, guard }) => {
                            for truth in [false, true] {
                                let mut decided = decided.clone();
                                decided.push((test, guard, truth));
                                open.push(decided);
                            }
                        }
                        Ok(force) => {
                            pieces.push(&nodes, force, (interval, turned), &decided, values);
                            roots.push(force);
                        }
                    }
                    if pieces.all.len() + open.len() > MAX_PIECES {
                        let reason = format!("its choices make more than {MAX_PIECES} pieces");
                        return refuse(0..0, &reason);
                    }
                }
            }
        }
        if pieces
            .all
            .iter()
            .any(|piece| piece.force.program.len() > MAX_NUMBERS)
        {
            return refuse(
                0..0,
                &format!("one piece has more than {MAX_NUMBERS} numbers and calculations"),
            );
        }
        for (k, root) in roots.iter().enumerate() {
            let interval = pieces.all[k].interval;
            let ends = [interval.checked_sub(1), Some(interval)];
            pieces.all[k].ends = ends.map(|level| {
                let gap = level.and_then(|level| pieces.levels.get(level));
                gap.map_or(Smoothness::Analytic, |gap| {
                    smoothness(&nodes, *root, [*gap, 1.0], values)
                })
            });
            let place = |test: Id| {
                let (_, [slope, _, constant]) = planes.iter().find(|(other, _)| *other == test)?;
                Some(-constant / slope).filter(|gap| gap.is_finite())
            };
            let tests = pieces.all[k]
                .guards
                .iter()
                .map(|&number| pieces.guards[number].test);
            pieces.all[k].onsets = tests
                .filter_map(|test| {
                    Some((test, smoothness(&nodes, *root, [place(test)?, 0.0], values)))
                })
                .collect();
            pieces.all[k].exits = pieces
                .exits_of(k)
                .map_err(|reason| FormulaError::new(text, nodes.place(*root), reason))?;
        }
        pieces.find_pole(text, &nodes, &roots, values)?;
        Ok(pieces)
    }

    fn push(
        &mut self,
        nodes: &Nodes,
        force: Id,
        (interval, turned): (usize, bool),
        decided: &[(Id, Id, bool)],
        values: &[f64],
    ) {
        let first = self.guards.len();
        self.guards
            .extend(decided.iter().map(|&(test, guard, truth)| Guard {
                test,
                truth,
                quantity: Evaluated::new(nodes, guard, values),
            }));
        self.all.push(Piece {
            interval,
            turned,
            force: Evaluated::new(nodes, force, values),
            guards: (first..self.guards.len()).collect(),
            exits: Vec::new(),
            ends: [Smoothness::Analytic; 2],
            touches: match self.contact {
                Some(level) => interval <= level,
                // Over a moving surface the first condition is that of flight.
                None => decided.first().is_some_and(|(.., flies)| !flies),
            },
            onsets: Vec::new(),
        });
    }

    /// Whether the conditions of a piece hold; those that are just zero do.
    fn holds(&self, piece: &Piece, gap: f64, rate: f64) -> bool {
        let mut guards = piece.guards.iter().map(|&number| &self.guards[number]);
        guards.all(|guard| guard.sign() * guard.quantity.value(gap, rate) >= 0.0)
    }

    fn among(&self, interval: usize, turned: bool) -> impl Iterator<Item = usize> {
        let is = move |piece: &Piece| piece.interval == interval && piece.turned == turned;
        (0..self.all.len()).filter(move |&k| is(&self.all[k]))
    }

    /// The piece that follows behind a level, for a rate of this sign.
    fn behind(
        &self,
        interval: usize,
        turned: bool,
        level: f64,
        sign: f64,
    ) -> Result<usize, String> {
        let gap = level + sign * BEHIND * level.abs().max(1.0);
        let after = |rate: f64| {
            let mut all = self.among(interval, turned);
            all.find(|&k| self.holds(&self.all[k], gap, sign * rate))
        };
        let [first, others @ ..] = SPEEDS.map(after);
        match first {
            Some(piece) if others.iter().all(|other| *other == first) => Ok(piece),
            _ => {
                let way = if sign > 0.0 { "rises" } else { "falls" };
                Err(format!(
                    "which piece follows where the gap {way} through the end of another depends on the \
                     speed: let the condition depend on the gap, or on `turned`"
                ))
            }
        }
    }

    fn exits_of(&self, k: usize) -> Result<Vec<Exit>, String> {
        let piece = &self.all[k];
        let mut exits = Vec::new();
        if let Some(level) = piece.interval.checked_sub(1) {
            let turned = piece.turned && self.contact.is_some_and(|contact| level <= contact);
            let target = self.behind(level, turned, self.levels[level], -1.0)?;
            let end = End::Falls(level);
            exits.push(Exit { end, target });
        }
        if let Some(level) = self.levels.get(piece.interval) {
            let turned =
                piece.turned && self.contact.is_some_and(|contact| piece.interval < contact);
            let target = self.behind(piece.interval + 1, turned, *level, 1.0)?;
            let end = End::Rises(piece.interval);
            exits.push(Exit { end, target });
        }
        let truth_of = |k: usize, test: Id| {
            let guards = self.all[k]
                .guards
                .iter()
                .map(|&number| &self.guards[number]);
            guards
                .filter(|guard| guard.test == test)
                .map(|guard| guard.truth)
                .next()
        };
        // Of the pieces that one changed condition leads to, all others must be the same.
        let only = |changed: Option<Id>, turned: bool| {
            let own = piece.guards.iter().map(|&number| &self.guards[number]);
            let fits = |other: &usize| {
                own.clone().all(|guard| {
                    let wanted = guard.truth != (Some(guard.test) == changed);
                    truth_of(*other, guard.test).is_none_or(|truth| truth == wanted)
                })
            };
            let mut all = self.among(piece.interval, turned).filter(fits);
            match (all.next(), all.next()) {
                (Some(target), None) => Ok(target),
                _ => Err(
                    "one condition hides another: which piece follows cannot be told; \
                          write the conditions side by side"
                        .to_owned(),
                ),
            }
        };
        let turns = self.among(piece.interval, true).next().is_some();
        if piece.touches && !piece.turned && turns {
            let target = only(None, true)?;
            let end = End::Turns;
            exits.push(Exit { end, target });
        }
        for &number in &piece.guards {
            let target = only(Some(self.guards[number].test), piece.turned)?;
            let end = End::Guard(number);
            exits.push(Exit { end, target });
        }
        Ok(exits)
    }

    /// Finds the largest gap that a piece reaches and where its force is infinite.
    fn find_pole(
        &mut self,
        text: &str,
        nodes: &Nodes,
        roots: &[Id],
        values: &[f64],
    ) -> Result<(), FormulaError> {
        let remembers_force = self.second != Second::Rate;
        for (piece, root) in self.all.iter().zip(roots) {
            let lower = piece
                .interval
                .checked_sub(1)
                .map_or(f64::NEG_INFINITY, |k| self.levels[k]);
            let upper = self
                .levels
                .get(piece.interval)
                .copied()
                .unwrap_or(f64::INFINITY);
            for (id, gap) in poles(
                nodes,
                *root,
                values,
                [lower, upper],
                &self.levels,
                remembers_force,
            ) {
                if self.pole.is_some_and(|pole| pole >= gap) {
                    continue;
                }
                let near = gap
                    + 1e-9
                        * gap
                            .abs()
                            .max(self.levels.iter().fold(0.0, |m, l| m.max(l.abs())));
                let near = if near > gap {
                    near
                } else {
                    f64::MIN_POSITIVE.sqrt()
                };
                // Beyond a condition on gap and memory the piece is not reached.
                if remembers_force && !self.holds(piece, near, 0.0) {
                    continue;
                }
                if near < upper && piece.force.value(near, 0.0) < 0.0 {
                    let part = text.get(nodes.place(id)).unwrap_or_default();
                    let reason = format!(
                        "\"{part}\" becomes zero at a gap that the tip reaches, and the force attracts \
                         there without limit: keep it away from zero, as in max(d, a0)"
                    );
                    return Err(FormulaError::new(text, nodes.place(id), reason));
                }
                self.pole = Some(gap);
            }
        }
        Ok(())
    }

    /// Returns the number of pieces.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Reports whether there is no piece; there always is one.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Returns the gaps at which pieces end, the smallest first.
    pub fn levels(&self) -> &[f64] {
        &self.levels
    }

    /// Returns the piece of a motion without a known history.
    pub fn at(&self, gap: f64, rate: f64) -> usize {
        let interval = self.levels.partition_point(|level| *level <= gap);
        let turned = rate >= 0.0 && self.among(interval, true).next().is_some();
        let mut all = self.among(interval, turned);
        let found = all.find(|&k| self.holds(&self.all[k], gap, rate));
        found
            .or_else(|| self.among(interval, turned).next())
            .unwrap_or(0)
    }

    /// Returns the function on a piece, also slightly beyond its ends, with its derivatives by gap and
    /// rate.
    pub fn force(&self, piece: usize, gap: f64, rate: f64) -> Value {
        self.all[piece].force.at(gap, rate)
    }

    /// Returns the function on a piece without derivatives.
    pub fn value(&self, piece: usize, gap: f64, rate: f64) -> f64 {
        self.all[piece].force.value(gap, rate)
    }

    /// Evaluates the function and its derivatives at many places, [`LANES`] together: by the gap, and with
    /// `K` = 2 by the rate. The results are handed to `take` with the number of the first; places that
    /// are missing in the last ones repeat the last.
    #[inline(always)]
    pub fn forces<const K: usize>(
        &self,
        piece: usize,
        gaps: &[f64],
        rates: &[f64],
        mut take: impl FnMut(usize, &Lanes<K>),
    ) {
        let lanes = |all: &[f64], first: usize| -> [f64; LANES] {
            let rest = &all[first..];
            rest.first_chunk().copied().unwrap_or_else(|| {
                let mut lanes = [rest[rest.len() - 1]; LANES];
                lanes[..rest.len()].copy_from_slice(rest);
                lanes
            })
        };
        let places = (0..gaps.len().min(rates.len()))
            .step_by(LANES)
            .map(|first| {
                let (gaps, rates) = (lanes(gaps, first), lanes(rates, first));
                [Lanes::variable(gaps, 0), Lanes::variable(rates, 1)]
            });
        let force = &self.all[piece].force;
        let fixed = |k: usize| Number::constant(force.plain[k]);
        force
            .program
            .run(fixed, places, |place, found| take(LANES * place, found));
    }

    /// Returns the derivative of the function by a parameter.
    pub fn by_parameter(&self, piece: usize, parameter: usize, gap: f64, rate: f64) -> f64 {
        self.all[piece].force.by_parameter(parameter, gap, rate)
    }

    /// Returns how a piece ends.
    pub fn exits(&self, piece: usize) -> &[Exit] {
        &self.all[piece].exits
    }

    /// Returns the behaviour of a piece at its lower and upper end.
    pub fn ends(&self, piece: usize) -> [Smoothness; 2] {
        self.all[piece].ends
    }

    /// Returns the behaviour of a piece that is entered through a condition of another.
    pub fn onset(&self, guard: usize, target: usize) -> Smoothness {
        let test = self.guards[guard].test;
        let mut onsets = self.all[target].onsets.iter();
        onsets
            .find(|(other, _)| *other == test)
            .map_or(Smoothness::Analytic, |(_, smoothness)| *smoothness)
    }

    /// Returns a condition with its derivatives by gap and rate; positive inside its piece.
    pub fn guard(&self, number: usize, gap: f64, rate: f64) -> Value {
        let guard = &self.guards[number];
        guard.quantity.at(gap, rate) * guard.sign()
    }

    /// Returns the derivative by a parameter of a condition that is positive inside its piece; `None` for
    /// the level at which contact begins, whose derivative by itself is −1 or 1.
    pub fn end_by_parameter(&self, end: End, parameter: usize, gap: f64, rate: f64) -> Option<f64> {
        let level = |k: usize| {
            let level = self.level_programs[k].as_ref()?;
            Some(level.by_parameter(parameter, 0.0, 0.0))
        };
        match end {
            End::Falls(k) => Some(-level(k)?),
            End::Rises(k) => level(k),
            End::Turns => Some(0.0),
            End::Guard(number) => {
                let guard = &self.guards[number];
                Some(guard.sign() * guard.quantity.by_parameter(parameter, gap, rate))
            }
        }
    }

    /// Reports whether a piece lies below the gap at which contact begins.
    pub fn touches(&self, piece: usize) -> bool {
        self.all[piece].touches
    }

    /// Reports whether the function is zero on a piece.
    pub fn vanishes(&self, piece: usize) -> bool {
        self.all[piece].force.program.is_zero()
    }

    /// Returns the largest gap that a piece reaches and where the function is infinite.
    pub const fn pole(&self) -> Option<f64> {
        self.pole
    }
}

/// Whether two finite gaps are one but for rounding.
fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_LEVEL * a.abs().max(b.abs())
}

/// Whether two conditions `a d + b s + c > 0` change their truth together.
fn is_parallel(first: [f64; 3], second: [f64; 3]) -> bool {
    let ratio = second[1] / first[1];
    ratio.is_finite() && (0..3).all(|k| is_same(ratio * first[k], second[k]))
}

/// The value of an expression of the parameters alone.
pub(crate) fn fixed_value(nodes: &Nodes, id: Id, values: &[f64]) -> f64 {
    values_of(nodes, &needed(nodes, id), values, [0.0; 2])[&id]
}

/// The lowest power of the distance from a gap, at a rate, and the lowest fractional one, with which an
/// expression begins there.
fn smoothness(nodes: &Nodes, root: Id, place: [f64; 2], values: &[f64]) -> Smoothness {
    let mut orders: HashMap<Id, (f64, f64)> = HashMap::new();
    let all = needed(nodes, root);
    let at = values_of(nodes, &all, values, place);
    for id in all {
        let value = at[&id];
        let small = |a: Id, b: Id| value.abs() <= 1e-12 * at[&a].abs().max(at[&b].abs());
        let smooth = if value == 0.0 && nodes.depends(id).gap {
            1.0
        } else {
            0.0
        };
        let power = |(order, part): (f64, f64), p: f64| {
            if order == 0.0 {
                (0.0, part)
            } else if (p * order).fract() == 0.0 {
                (p * order, part - order + p * order)
            } else {
                (p * order, p * order)
            }
        };
        let own = match nodes.node(id) {
            Node::Number(_) | Node::Parameter(_) | Node::Gap | Node::Rate | Node::Choice { .. } => {
                (smooth, f64::INFINITY)
            }
            Node::Of(Function::Sqrt, a) => power(orders[&a], 0.5),
            Node::Of(Function::Cbrt, a) => power(orders[&a], 1.0 / 3.0),
            Node::Of(_, a) => (smooth, orders[&a].1),
            Node::Two(Operator::Plus | Operator::Minus, a, b) => {
                let part = orders[&a].1.min(orders[&b].1);
                let order = orders[&a].0.min(orders[&b].0);
                let cancels = order == 0.0 && nodes.depends(id).gap && small(a, b);
                (if cancels { 1.0 } else { order }, part)
            }
            Node::Two(Operator::Times, a, b) => {
                let ((a, of_a), (b, of_b)) = (orders[&a], orders[&b]);
                (a + b, (of_a + b).min(of_b + a))
            }
            Node::Two(Operator::Over, a, b) => {
                let ((a, of_a), (b, of_b)) = (orders[&a], orders[&b]);
                (a - b, (of_a - b).min(of_b - 2.0 * b + a))
            }
            Node::Two(Operator::Power, a, b) => power(orders[&a], at[&b]),
        };
        orders.insert(id, own);
    }
    match orders[&root].1 {
        part if part == f64::INFINITY => Smoothness::Analytic,
        part if part < 1.0 => Smoothness::InfiniteSlope,
        _ => Smoothness::FiniteSlope,
    }
}

/// The divisors of an expression that become zero within a range of gaps, each with the gap.
fn poles(
    nodes: &Nodes,
    root: Id,
    values: &[f64],
    [lower, upper]: [f64; 2],
    levels: &[f64],
    remembers_force: bool,
) -> Vec<(Id, f64)> {
    let mut found = Vec::new();
    let mut divisors: Vec<(Id, Id)> = Vec::new();
    let mut scratch = nodes.clone();
    let all = needed(nodes, root);
    let fixed = values_of(nodes, &all, values, [0.0, 1.0]);
    for id in all {
        match nodes.node(id) {
            Node::Two(Operator::Over, _, b) => divisors.push((b, b)),
            Node::Two(Operator::Power, a, b) if fixed[&b] < 0.0 => divisors.push((a, a)),
            Node::Of(Function::Ln, a) => divisors.push((a, a)),
            _ => {}
        }
    }
    let mut seen = HashSet::new();
    while let Some((whole, id)) = divisors.pop() {
        let depends = nodes.depends(id);
        if !depends.gap || depends.rate && !remembers_force || !seen.insert(id) {
            continue;
        }
        match nodes.node(id) {
            Node::Two(Operator::Times, a, b) => divisors.extend([(whole, a), (whole, b)]),
            Node::Two(Operator::Over | Operator::Power, a, _)
            | Node::Of(Function::Sqrt | Function::Cbrt, a) => {
                divisors.push((whole, a));
            }
            _ => {
                if let Some(line) = scratch.line(id) {
                    let [slope, constant] = line.map(|part| fixed_value(&scratch, part, values));
                    let gap = -constant / slope;
                    if gap.is_finite()
                        && (gap >= lower || lower.is_finite() && is_same(gap, lower))
                        && gap < upper
                        && !(upper.is_finite() && is_same(gap, upper))
                    {
                        found.push((whole, gap));
                    }
                } else if let Some(gap) = sign_change(nodes, id, values, [lower, upper], levels) {
                    found.push((whole, gap));
                }
            }
        }
    }
    found
}

/// The largest gap of a range at which an expression changes its sign, if it does so between places at
/// distances in the ratio of [`RATIO`] from a level.
fn sign_change(
    nodes: &Nodes,
    id: Id,
    values: &[f64],
    [lower, upper]: [f64; 2],
    levels: &[f64],
) -> Option<f64> {
    /// Ratio of the distances at which a sign is looked at.
    const RATIO: f64 = 1.05;
    let expression = Evaluated::new(nodes, id, values);
    let size = levels
        .iter()
        .fold(0.0_f64, |most, level| most.max(level.abs()));
    let size = if size > 0.0 { size } else { 1.0 };
    let near = levels.iter().copied().chain([0.0]);
    let mut places: Vec<f64> = near
        .flat_map(|level| {
            let distances = std::iter::successors(Some(1e-6 * size), |d| Some(d * RATIO));
            let distances = distances.take_while(move |d| *d < 1e6 * size);
            distances.flat_map(move |d| [level - d, level + d])
        })
        .filter(|gap| *gap > lower && *gap < upper)
        .collect();
    places.sort_by(|a, b| b.total_cmp(a));
    let mut before: Option<(f64, f64)> = None;
    for gap in places {
        let value = expression.value(gap, 0.0);
        if let Some((mut high, sign)) = before.filter(|(_, other)| other * value < 0.0) {
            let mut low = gap;
            for _ in 0..100 {
                let middle = 0.5 * (low + high);
                if expression.value(middle, 0.0) * sign > 0.0 {
                    high = middle;
                } else {
                    low = middle;
                }
            }
            return Some(high);
        }
        before = Some((gap, value)).filter(|(_, value)| value.is_finite());
    }
    None
}
