//! The dimension of every part of a formula.

use nanotap_quantity::{Dimension, Kind};

use crate::error::FormulaError;
use crate::node::{Id, Node, Nodes, Operator};
use crate::parser::Memory;
use crate::program::needed;

/// Difference of two exponents below which they are equal: roots and powers are rounded.
const EQUAL: f64 = 1e-9;

/// Exponents of kilogram, metre, second and coulomb; nothing for zero, which has any dimension. An
/// angle in rad counts as a number.
type Exponents = Option<[f64; 4]>;

fn exponents(dimension: Dimension) -> [f64; 4] {
    let Dimension {
        mass,
        length,
        time,
        charge,
        ..
    } = dimension;
    [mass, length, time, charge].map(f64::from)
}

fn exponents_of(kind: Kind) -> [f64; 4] {
    exponents(kind.dimension())
}

fn same(a: [f64; 4], b: [f64; 4]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < EQUAL)
}

/// The words for a dimension: `a force`, or its base units.
fn words(exponents: [f64; 4]) -> String {
    let whole = exponents.map(|e| e.round() as i32);
    if same(exponents, whole.map(f64::from)) {
        let dimension = Dimension::new(whole[0], whole[1], whole[2]).charged(whole[3]);
        if dimension.is_none() {
            return "a number without a unit".to_owned();
        }
        return dimension.to_string();
    }
    let units = ["kg", "m", "s", "C"].iter().zip(exponents);
    let units = units.filter(|(_, exponent)| exponent.abs() > EQUAL);
    let units: Vec<String> = units.map(|(unit, e)| format!("{unit}^{e}")).collect();
    units.join(" ")
}

/// Checks that every part has a dimension, and the whole the wanted one.
pub(crate) fn check(
    (nodes, root): (&Nodes, Id),
    memory: Option<&Memory>,
    text: &str,
    parameters: &[Dimension],
    wanted: Dimension,
) -> Result<(), FormulaError> {
    let rate = Ok(exponents_of(Kind::Velocity));
    let second = memory.map_or(rate, |memory| of_memory(memory, text, parameters))?;
    let all: Vec<Id> = (0..nodes.len()).collect();
    let known = dimensions(
        nodes,
        &all,
        text,
        parameters,
        [exponents_of(Kind::Length), second],
    )?;
    let wanted = exponents(wanted);
    match known[root] {
        Some(found) if !same(found, wanted) => Err(FormulaError::new(
            text,
            nodes.place(root),
            format!("it is {}, where {} is needed", words(found), words(wanted)),
        )),
        _ => Ok(()),
    }
}

/// Reports whether a memory is a length.
pub(crate) fn is_length(
    memory: &Memory,
    text: &str,
    parameters: &[Dimension],
) -> Result<bool, FormulaError> {
    Ok(same(
        of_memory(memory, text, parameters)?,
        exponents_of(Kind::Length),
    ))
}

/// The dimension of a memory `s' = gain F − decay s`.
fn of_memory(
    memory: &Memory,
    text: &str,
    parameters: &[Dimension],
) -> Result<[f64; 4], FormulaError> {
    let nodes = &memory.nodes;
    let [force, frequency] = [Kind::Force, Kind::Frequency].map(exponents_of);
    // Gain and decay are of parameters alone.
    let known = |id: Id| {
        let all = dimensions(nodes, &needed(nodes, id), text, parameters, [force; 2])?;
        Ok(all[id].unwrap_or_default())
    };
    let decay = known(memory.decay)?;
    if !same(decay, frequency) {
        let reason = format!(
            "the factor of {} is {}, where one over a time is needed",
            memory.name,
            words(decay)
        );
        return Err(FormulaError::new(text, nodes.place(memory.decay), reason));
    }
    let gain = known(memory.gain)?;
    Ok(std::array::from_fn(|k| gain[k] + force[k] - frequency[k]))
}

/// The dimensions of these nodes, each of which stands after its parts, by node.
fn dimensions(
    nodes: &Nodes,
    ids: &[Id],
    text: &str,
    parameters: &[Dimension],
    [gap, rate]: [[f64; 4]; 2],
) -> Result<Vec<Exponents>, FormulaError> {
    let mut known: Vec<Exponents> = vec![None; nodes.len()];
    let part = |id: Id| text.get(nodes.place(id)).unwrap_or_default();
    let refused = |id: Id, reason: String| FormulaError::new(text, nodes.place(id), reason);
    // Both of one dimension; zero takes that of the other.
    let agree =
        |known: &[Exponents], [a, b]: [Id; 2], at: Id, what: &str| match (known[a], known[b]) {
            (Some(first), Some(second)) if !same(first, second) => Err(refused(
                at,
                format!(
                    "\"{}\" is {}, \"{}\" is {}: they cannot be {what}",
                    part(a),
                    words(first),
                    part(b),
                    words(second)
                ),
            )),
            (first, second) => Ok(first.or(second)),
        };
    for &id in ids {
        let own = match nodes.node(id) {
            Node::Number(bits) => (f64::from_bits(bits) != 0.0).then_some([0.0; 4]),
            Node::Parameter(number) => {
                Some(parameters.get(number).map_or([0.0; 4], |d| exponents(*d)))
            }
            Node::Gap => Some(gap),
            Node::Rate => Some(rate),
            Node::Of(function, a) => {
                use crate::node::Function::{Cbrt, Sqrt};
                let argument = known[a].unwrap_or_default();
                match function {
                    Sqrt => Some(argument.map(|e| e / 2.0)),
                    Cbrt => Some(argument.map(|e| e / 3.0)),
                    _ if same(argument, [0.0; 4]) => Some([0.0; 4]),
                    _ => {
                        return Err(refused(
                            id,
                            format!(
                                "\"{}\" is {}, where this function takes a number without a unit",
                                part(a),
                                words(argument)
                            ),
                        ));
                    }
                }
            }
            Node::Two(Operator::Plus | Operator::Minus, a, b) => {
                agree(&known, [a, b], id, "added or compared")?
            }
            Node::Two(operator @ (Operator::Times | Operator::Over), a, b) => {
                let sign = if operator == Operator::Times {
                    1.0
                } else {
                    -1.0
                };
                let (a, b) = (known[a].unwrap_or_default(), known[b].unwrap_or_default());
                Some(std::array::from_fn(|k| a[k] + sign * b[k]))
            }
            Node::Two(Operator::Power, a, b) => {
                let (base, exponent) = (known[a].unwrap_or_default(), known[b]);
                if let Some(exponent) = exponent.filter(|e| !same(*e, [0.0; 4])) {
                    let reason = format!(
                        "the exponent \"{}\" is {}, not a number without a unit",
                        part(b),
                        words(exponent)
                    );
                    return Err(refused(id, reason));
                }
                match nodes.value(b) {
                    Some(power) => Some(base.map(|e| power * e)),
                    None if same(base, [0.0; 4]) => Some([0.0; 4]),
                    None => {
                        let reason = format!(
                            "\"{}\" is {}: to an exponent that may vary only a number without a unit can \
                             be raised; divide by a length or the like first",
                            part(a),
                            words(base)
                        );
                        return Err(refused(id, reason));
                    }
                }
            }
            Node::Choice { yes, no, .. } => {
                agree(&known, [yes, no], id, "the two values of one choice")?
            }
        };
        known[id] = own;
    }
    Ok(known)
}
