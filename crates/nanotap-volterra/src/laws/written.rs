//! A force that is written as a formula of the gap `d` and its rate `v`, with parameters of its own.
//!
//! The formula is parted into analytic branches at its conditions ([`nanotap_formula`]); derivatives
//! are those of the formula. Tip and sample touch below the contact distance.
//!
//! A memory `s' = a F − b s` is a coordinate of a [`Surface`] that the force drives at every gap. It takes
//! the place of the rate in the law.
//!
//! What is written is kept for as long as the program runs, each text with its parameters once, so that
//! its law is one of the table's for all that read the table.

// Only what is inlined into a function for wide registers gets their instructions.
#![allow(clippy::inline_always)]

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use nanotap_formula::{
    End, Exit as PieceExit, Formula, FormulaError, LANES, Lanes, Pieces, Smoothness,
};
use nanotap_quantity::{Dimension, Kind};

use crate::error::VolterraError;
use crate::law::{Approach, Exit, Force, ForceLaw, Guard, Surface};
use crate::laws::adhesion::HAMAKER;
use crate::laws::entry::{
    CONTACT_DISTANCE, CaseKey, Entry, KeyEntry, MODULUS, POISSON, ParameterEntry, RADIUS, Range,
    own,
};
use crate::laws::{Make, TableLaw};
use crate::linear::wide_registers;
use crate::quadrature::gauss_legendre;

/// Names that stand for quantities of tip and sample unless the case gives them another value.
pub static KNOWN: [(&str, ParameterEntry); 5] = [
    ("R", RADIUS),
    ("E", MODULUS),
    ("nu", POISSON),
    ("H", HAMAKER),
    ("a0", CONTACT),
];

/// Gap at which contact begins; without a value in the case the surfaces meet there.
const CONTACT: ParameterEntry = ParameterEntry {
    words: "gap at which tip and sample touch",
    default: Some(0.0),
    assumed: false,
    ..CONTACT_DISTANCE
};

/// What precedes the name of a formula's parameter in its key.
pub const PARAMETERS: &str = "parameters.";

/// Table entry of a force that is written as a formula, which tells the further parameters.
pub static FORMULA: TableLaw = TableLaw {
    entry: &Entry {
        name: "formula",
        words: "force as a formula of gap d and rate v, with parameters of its own",
        formula: "as written in the case",
        source: "the case",
        parameters: &[CONTACT],
        parts: &[],
        attracts: false,
        conservative: true,
    },
    make: Make::Text,
};

/// Largest number of formulas and of names, each kept for as long as the program runs.
const MAX_KEPT: usize = 10_000;

/// A formula with the places of its parameters among those of its law.
#[derive(Debug)]
pub struct Writing {
    formula: Formula,
    /// For each parameter of the formula the number of that of the law.
    places: Vec<usize>,
    /// Number of the law's parameter that tells where contact begins; without one the surfaces meet there.
    contact: Option<usize>,
    /// Whether the formula's memory is the depth of the surface.
    moves: bool,
    entry: &'static Entry,
}

/// Returns the law of a formula, whose parameters have these dimensions; those of [`KNOWN`] that have
/// none here are quantities of tip and sample.
///
/// # Errors
/// If the formula cannot be read, a parameter has no value, or the result is not a force; each with its
/// place in the text.
pub fn law(
    text: &str,
    parameters: &[(&str, Dimension)],
) -> Result<&'static TableLaw, FormulaError> {
    type Written = (String, Vec<(String, Dimension)>);
    static LAWS: LazyLock<Mutex<HashMap<Written, &'static TableLaw>>> =
        LazyLock::new(Mutex::default);
    let own = |(name, dimension): &(&str, Dimension)| ((*name).to_owned(), *dimension);
    let key = (text.to_owned(), parameters.iter().map(own).collect());
    let laws = || LAWS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(law) = laws().get(&key) {
        return Ok(law);
    }
    let formula = Formula::parse(text)?;
    let full = |formula: &Formula, name: &str| {
        formula.without_value(name, "no room for more formulas: start the program again")
    };
    let mut entries = vec![CONTACT];
    let mut places = Vec::new();
    let mut dimensions = Vec::new();
    for name in formula.parameters() {
        let given = parameters.iter().find(|(other, _)| other == name);
        let known = KNOWN.iter().find(|(other, _)| other == name);
        let entry = match (given, known) {
            (Some((_, dimension)), _) => {
                parameter(name, *dimension).ok_or_else(|| full(&formula, name))?
            }
            (None, Some((_, entry))) => *entry,
            (None, None) => {
                let example = example(&formula, name, parameters);
                let reason =
                    format!("it has no value: state it under [sample.parameters]{example}");
                return Err(formula.without_value(name, reason));
            }
        };
        dimensions.push(entry.kind.dimension());
        let place = entries.iter().position(|other| other.name == entry.name);
        places.push(place.unwrap_or_else(|| {
            entries.push(entry);
            entries.len() - 1
        }));
    }
    formula.check(&dimensions, Kind::Force.dimension())?;
    let moves = formula.moves_surface(&dimensions)?;
    let mut laws = laws();
    if laws.len() >= MAX_KEPT {
        return Err(full(&formula, ""));
    }
    let entry: &'static Entry = Box::leak(Box::new(Entry {
        formula: text.to_owned().leak(),
        parameters: entries.leak(),
        conservative: !takes_second(&formula) && !formula.remembers(),
        ..*FORMULA.entry
    }));
    let writing = Box::leak(Box::new(Writing {
        formula,
        places,
        contact: Some(0),
        moves,
        entry,
    }));
    let law = Box::leak(Box::new(TableLaw {
        entry,
        make: Make::Written(writing),
    }));
    laws.insert(key, law);
    Ok(law)
}

/// How the value of a parameter is stated: with the unit that makes the formula a force, if this parameter is
/// the only one without a value.
fn example(formula: &Formula, name: &str, given: &[(&str, Dimension)]) -> String {
    let dimension = |other: &String, own: Kind| {
        let given = given.iter().find(|(of, _)| of == other);
        let known = KNOWN.iter().find(|(of, _)| of == other);
        match (given, known) {
            (Some((_, dimension)), _) => Some(*dimension),
            (None, Some((_, entry))) => Some(entry.kind.dimension()),
            (None, None) => (other == name).then(|| own.dimension()),
        }
    };
    let fits = |kind: &&Kind| {
        let all = formula.parameters().iter();
        let dimensions: Option<Vec<_>> = all.map(|other| dimension(other, **kind)).collect();
        dimensions.is_some_and(|all| formula.check(&all, Kind::Force.dimension()).is_ok())
    };
    match Kind::ALL.iter().find(fits) {
        Some(kind) => format!(", as in {name} = \"{}\"", kind.example()),
        None => " with its unit".to_owned(),
    }
}

/// The parameter of a formula that a case states under `[sample.parameters]`.
fn parameter(name: &str, dimension: Dimension) -> Option<ParameterEntry> {
    type FormulaParameter = (String, Dimension);
    static PARAMETERS_OF_ALL: LazyLock<Mutex<HashMap<FormulaParameter, ParameterEntry>>> =
        LazyLock::new(Mutex::default);
    let mut all = PARAMETERS_OF_ALL
        .lock()
        .unwrap_or_else(PoisonError::into_inner);
    let key = (name.to_owned(), dimension);
    if let Some(entry) = all.get(&key) {
        return Some(*entry);
    }
    if all.len() >= MAX_KEPT {
        return None;
    }
    let key_name: &'static str = format!("{PARAMETERS}{name}").leak();
    let words: &'static str = format!("parameter {name} of the formula").leak();
    let label: &'static str = format!("parameter ${name}$").leak();
    let kind = Kind::of(dimension)?;
    let entry = own(key_name, words, kind, None, Range::Finite, words, 1.0);
    let entry = match entry.key {
        CaseKey::Own(own) => ParameterEntry {
            key: CaseKey::Own(KeyEntry { label, ..own }),
            ..entry
        },
        CaseKey::Body(_) => entry,
    };
    all.insert(key, entry);
    Some(entry)
}

/// The key of a parameter of a formula, for all that is not a law: name and dimension tell it.
pub fn key(name: &str, dimension: Dimension) -> Option<KeyEntry> {
    match parameter(name, dimension)?.key {
        CaseKey::Own(key) => Some(key),
        CaseKey::Body(_) => None,
    }
}

impl Writing {
    /// Reads a law of the table that is a formula, in which the law's parameters have their names. Contact
    /// begins at the parameter `contact`.
    pub(crate) fn listed(
        entry: &'static Entry,
        text: &str,
        contact: &str,
    ) -> Result<Self, FormulaError> {
        let formula = Formula::parse(text)?;
        let place = |name: &str| entry.parameters.iter().position(|p| p.name == name);
        let found = |name: &String| {
            place(name).ok_or_else(|| formula.without_value(name, "the law has no such parameter"))
        };
        let places: Vec<usize> = formula
            .parameters()
            .iter()
            .map(found)
            .collect::<Result<_, _>>()?;
        let dimension = |&place: &usize| entry.parameters[place].kind.dimension();
        let dimensions: Vec<_> = places.iter().map(dimension).collect();
        formula.check(&dimensions, Kind::Force.dimension())?;
        Ok(Self {
            places,
            contact: place(contact),
            moves: formula.moves_surface(&dimensions)?,
            formula,
            entry,
        })
    }

    /// Returns the text of the formula.
    pub const fn text(&self) -> &'static str {
        self.entry.formula
    }

    /// Builds the law with values of its parameters.
    pub(crate) fn law(
        &'static self,
        parameters: &[f64],
    ) -> Result<Arc<dyn ForceLaw>, VolterraError> {
        let values: Vec<f64> = self.places.iter().map(|&place| parameters[place]).collect();
        let contact = self.contact.map_or(0.0, |place| parameters[place]);
        let pieces = self.formula.pieces(&values, contact, self.moves)?;
        let surface = self.formula.memory(&values)?.map(|[gain, decay]| Surface {
            rates: vec![decay],
            gains: vec![gain],
            always: true,
            adhesion: 0.0,
            relaxed: Arc::new(AtRest {
                pieces: pieces.clone(),
                compliance: gain / decay,
                contact,
                entry: self.entry,
            }),
        });
        Ok(Arc::new(Written {
            writing: self,
            pieces,
            surface,
        }))
    }
}

/// Reports whether a formula depends on the rate or on a memory.
fn takes_second(formula: &Formula) -> bool {
    formula.depends_on_rate() || formula.has_memory()
}

/// The law of a formula; see the module.
#[derive(Clone, Debug)]
struct Written {
    writing: &'static Writing,
    pieces: Pieces,
    surface: Option<Surface>,
}

/// Evaluates [`ForceLaw::forces`] of a formula, compiled also for wide registers.
#[inline(always)]
fn forces_at(
    law: &Written,
    branch: usize,
    gaps: &[f64],
    rates: &[f64],
    [values, by_gap, by_rate]: [&mut [f64]; 3],
) {
    let count = gaps.len();
    let put = |to: &mut [f64], first: usize, from: &[f64; LANES]| {
        let to = &mut to[first..count.min(first + LANES)];
        to.copy_from_slice(&from[..to.len()]);
    };
    if takes_second(&law.writing.formula) {
        law.pieces
            .forces(branch, gaps, rates, |first, forces: &Lanes<2>| {
                put(values, first, &forces.values);
                put(by_gap, first, &forces.slopes[0]);
                put(by_rate, first, &forces.slopes[1]);
            });
    } else {
        law.pieces
            .forces(branch, gaps, rates, |first, forces: &Lanes<1>| {
                put(values, first, &forces.values);
                put(by_gap, first, &forces.slopes[0]);
            });
        by_rate.fill(0.0);
    }
}

const fn approach(smoothness: Smoothness) -> Approach {
    match smoothness {
        Smoothness::Analytic => Approach::Analytic,
        Smoothness::FiniteSlope => Approach::ThreeHalves,
        Smoothness::InfiniteSlope => Approach::Half,
    }
}

impl ForceLaw for Written {
    fn parameters(&self) -> Vec<&'static str> {
        self.writing.entry.parameter_names()
    }

    fn branches(&self) -> usize {
        self.pieces.len()
    }

    fn branch_at(&self, gap: f64, rate: f64) -> usize {
        self.pieces.at(gap, rate)
    }

    fn force(&self, branch: usize, gap: f64, rate: f64) -> Force {
        let force = self.pieces.force(branch, gap, rate);
        Force {
            value: force.value,
            by_gap: force.slopes[0],
            by_rate: force.slopes[1],
        }
    }

    fn value(&self, branch: usize, gap: f64, rate: f64) -> f64 {
        self.pieces.value(branch, gap, rate)
    }

    fn depends_on_rate(&self) -> bool {
        takes_second(&self.writing.formula)
    }

    fn surface(&self) -> Option<&Surface> {
        self.surface.as_ref()
    }

    fn forces(&self, branch: usize, gaps: &[f64], rates: &[f64], out: [&mut [f64]; 3]) {
        wide_registers!([] forces_at(
            law: &Written = self,
            branch: usize = branch,
            gaps: &[f64] = gaps,
            rates: &[f64] = rates,
            out: [&mut [f64]; 3] = out,
        ));
    }

    fn exits(&self, branch: usize) -> Vec<Exit> {
        let exit = |PieceExit { end, target }: &PieceExit| {
            let [lower, upper] = self.pieces.ends(branch).map(approach);
            let [lower_after, upper_after] = self.pieces.ends(*target).map(approach);
            match *end {
                End::Falls(level) => {
                    let guard = Guard::Falls(self.pieces.levels()[level]);
                    Exit::new(guard, *target).with(lower, upper_after)
                }
                End::Rises(level) => {
                    let guard = Guard::Rises(self.pieces.levels()[level]);
                    Exit::new(guard, *target).with(upper, lower_after)
                }
                End::Turns => Exit::new(Guard::Turns, *target),
                End::Guard(number) => {
                    let onset = match self.pieces.onset(number, *target) {
                        Smoothness::Analytic => Approach::Analytic,
                        // No switch pins the gap here, so that a power below 1 is like one above.
                        _ => Approach::ThreeHalves,
                    };
                    Exit::new(Guard::Own(number), *target).with(Approach::Analytic, onset)
                }
            }
        };
        self.pieces.exits(branch).iter().map(exit).collect()
    }

    fn pole(&self) -> Option<f64> {
        self.pieces.pole()
    }

    fn guard(&self, index: usize, gap: f64, rate: f64) -> Force {
        let guard = self.pieces.guard(index, gap, rate);
        Force {
            value: guard.value,
            by_gap: guard.slopes[0],
            by_rate: guard.slopes[1],
        }
    }

    fn by_parameters(&self, branch: usize, gap: f64, rate: f64, out: &mut [f64]) {
        if self.surface.is_some() {
            // The memory's own equation changes, too, which no derivative of the force describes.
            return out.fill(f64::NAN);
        }
        out.fill(0.0);
        for (parameter, &place) in self.writing.places.iter().enumerate() {
            out[place] = self.pieces.by_parameter(branch, parameter, gap, rate);
        }
    }

    fn guard_by_parameters(
        &self,
        branch: usize,
        exit: usize,
        gap: f64,
        rate: f64,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        let Some(PieceExit { end, .. }) = self.pieces.exits(branch).get(exit) else {
            return;
        };
        for (parameter, &place) in self.writing.places.iter().enumerate() {
            let Some(slope) = self.pieces.end_by_parameter(*end, parameter, gap, rate) else {
                if let Some(place) = self.writing.contact {
                    out[place] = contact_slope(*end);
                }
                return;
            };
            out[place] = slope;
        }
    }

    fn energy(&self, branch: usize, gap: f64) -> Option<f64> {
        if !self.conservative() {
            return None;
        }
        // Without a rate and a memory there is one piece between two levels.
        let levels = self.pieces.levels();
        let pole = self.pole();
        // No motion comes to a pole.
        let reference = levels
            .last()
            .copied()
            .filter(|level| pole.is_none_or(|pole| *level > pole))
            .unwrap_or_else(|| 1.0 + pole.map_or(0.0, |pole| pole.max(0.0)));
        let (low, high) = (gap.min(reference), gap.max(reference));
        if pole.is_some_and(|pole| low <= pole) {
            return None;
        }
        let inside = levels
            .iter()
            .filter(|level| **level > low && **level < high);
        let ends: Vec<f64> = std::iter::once(low)
            .chain(inside.copied())
            .chain(std::iter::once(high))
            .collect();
        let work = ends.windows(2).map(|ends| {
            let middle = 0.5 * (ends[0] + ends[1]);
            let is_last = (ends[0]..=ends[1]).contains(&gap);
            let piece = if is_last {
                branch
            } else {
                self.pieces.at(middle, 0.0)
            };
            let force = |gap: f64| self.pieces.value(piece, gap, 0.0);
            integral(&force, ends[0], ends[1])
        });
        let work: f64 = work.sum();
        let energy = if gap <= reference { work } else { -work };
        energy.is_finite().then_some(energy)
    }

    fn touches(&self, branch: usize) -> bool {
        self.pieces.touches(branch)
    }

    fn remembers(&self) -> bool {
        self.writing.formula.remembers()
    }

    fn vanishes(&self, branch: usize) -> bool {
        self.pieces.vanishes(branch)
    }

    fn conservative(&self) -> bool {
        self.writing.entry.conservative
    }
}

/// The force of a formula whose memory has settled, `s = compliance F`.
#[derive(Clone, Debug)]
struct AtRest {
    pieces: Pieces,
    compliance: f64,
    contact: f64,
    entry: &'static Entry,
}

/// Factor by which the size of a force is increased in search of one that holds itself.
const LARGER: f64 = 1.25;
/// Largest number of times.
const MAX_LARGER: usize = 200;

impl AtRest {
    /// The smallest force that the memory it leaves behind confirms, with its slope.
    fn settled(&self, gap: f64) -> Force {
        let at = |force: f64| {
            let memory = self.compliance * force;
            self.pieces.force(self.pieces.at(gap, memory), gap, memory)
        };
        let first = at(0.0).value;
        let exceeds = |force: f64| (at(force).value - force) * first.signum() > 0.0;
        let (mut low, mut high) = (0.0, first);
        for _ in 0..MAX_LARGER {
            if !exceeds(high) {
                break;
            }
            (low, high) = (high, LARGER * high);
        }
        loop {
            let middle = 0.5 * (low + high);
            if middle == low || middle == high || !middle.is_finite() {
                break;
            }
            *(if exceeds(middle) { &mut low } else { &mut high }) = middle;
        }
        let force = at(high);
        Force {
            value: high,
            by_gap: force.slopes[0] / (1.0 - self.compliance * force.slopes[1]),
            by_rate: 0.0,
        }
    }
}

impl ForceLaw for AtRest {
    fn parameters(&self) -> Vec<&'static str> {
        self.entry.parameter_names()
    }

    fn branches(&self) -> usize {
        2
    }

    fn branch_at(&self, gap: f64, _: f64) -> usize {
        usize::from(gap < self.contact)
    }

    fn force(&self, _: usize, gap: f64, _: f64) -> Force {
        self.settled(gap)
    }

    fn depends_on_rate(&self) -> bool {
        false
    }

    fn exits(&self, branch: usize) -> Vec<Exit> {
        vec![match branch {
            0 => Exit::new(Guard::Falls(self.contact), 1),
            _ => Exit::new(Guard::Rises(self.contact), 0),
        }]
    }

    /// Writes NaN: the memory's equation changes, too.
    fn by_parameters(&self, _: usize, _: f64, _: f64, out: &mut [f64]) {
        out.fill(f64::NAN);
    }

    fn guard_by_parameters(&self, _: usize, _: usize, _: f64, _: f64, out: &mut [f64]) {
        out.fill(f64::NAN);
    }
}

/// Points of the quadrature on an interval and on each of its halves.
const QUADRATURE_POINTS: usize = 16;
/// Error of the quadrature on an interval, as a part of the whole integral of the force's modulus.
const QUADRATURE_ERROR: f64 = 1e-14;
/// Largest number of times that an interval is halved.
const MAX_HALVINGS: usize = 60;

/// Integral of a force that is analytic between two gaps, or like a power of a half at one of them.
fn integral(force: &dyn Fn(f64) -> f64, low: f64, high: f64) -> f64 {
    let middle = 0.5 * (low + high);
    // The square of the variable removes the root at an end.
    let half = |end: f64| {
        let width = middle - end;
        let at = move |t: f64| 2.0 * width.abs() * t * force(end + width * t * t);
        let (_, size) = quadrature(&at, 0.0, 1.0);
        adaptive(&at, 0.0, 1.0, QUADRATURE_ERROR * size, MAX_HALVINGS)
    };
    half(low) + half(high)
}

/// Integral of a function and of its modulus by the Gauss–Legendre rule.
fn quadrature(of: &dyn Fn(f64) -> f64, low: f64, high: f64) -> (f64, f64) {
    let (nodes, weights) = gauss_legendre(QUADRATURE_POINTS);
    let width = high - low;
    let values = nodes.iter().zip(weights);
    values.fold((0.0, 0.0), |(sum, size), (node, weight)| {
        let value = width * weight * of(low + width * node);
        (sum + value, size + value.abs())
    })
}

/// The integral with an absolute error, or one at the limit of the arithmetic.
fn adaptive(of: &dyn Fn(f64) -> f64, low: f64, high: f64, error: f64, halvings: usize) -> f64 {
    let middle = 0.5 * (low + high);
    let (whole, _) = quadrature(of, low, high);
    let [(a, a_size), (b, b_size)] =
        [(low, middle), (middle, high)].map(|(a, b)| quadrature(of, a, b));
    let off = (a + b - whole).abs();
    if off <= error.max(f64::EPSILON * (a_size + b_size)) || halvings == 0 || off.is_nan() {
        return a + b;
    }
    adaptive(of, low, middle, error, halvings - 1) + adaptive(of, middle, high, error, halvings - 1)
}

/// Derivative by the contact distance of a guard at that distance.
const fn contact_slope(end: End) -> f64 {
    match end {
        End::Falls(_) => -1.0,
        _ => 1.0,
    }
}
