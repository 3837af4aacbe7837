//! Formulas of a gap `d` and its rate `v` as a case states them: `4/3*E*sqrt(R)*max(-d, 0)^1.5`.
//!
//! A formula is read once ([`Formula::parse`]), its dimensions are checked ([`Formula::check`]), and with
//! values of its parameters it becomes pieces ([`Formula::pieces`]): on each the function is analytic, and
//! a short program evaluates it with any derivatives. Choices (`if`, `min`, `max`, `abs`, `step`) are the
//! ends of pieces, which a computation locates; nothing is smoothed.
//!
//! ```
//! use nanotap_formula::Formula;
//! use nanotap_quantity::Kind;
//!
//! let formula = Formula::parse("k*max(-d, 0)")?;
//! assert_eq!(formula.parameters(), ["k"]);
//! formula.check(&[Kind::Stiffness.dimension()], Kind::Force.dimension())?;
//! let pieces = formula.pieces(&[2.0], 0.0, false)?;
//! assert_eq!(pieces.levels(), [0.0]);
//! let contact = pieces.at(-3.0, 0.0);
//! assert_eq!(pieces.force(contact, -3.0, 0.0).value, 6.0);
//!
//! let error = Formula::parse("k*max(-d, 0").unwrap_err();
//! assert_eq!(error.to_string(), "at character 12: a parenthesis is open: `)` is missing");
//! # Ok::<(), nanotap_formula::FormulaError>(())
//! ```

mod dimension;
mod error;
mod node;
mod number;
mod parser;
mod piece;
mod program;
mod token;

use nanotap_quantity::Dimension;

pub use error::FormulaError;
use node::{Id, Nodes};
pub use number::{LANES, Lanes};
use parser::{Memory, Parser, RESERVED};
pub use piece::{End, Exit, Pieces, Smoothness, Value};
use piece::{Second, fixed_value};

/// A formula, as read.
#[derive(Clone, Debug)]
pub struct Formula {
    text: String,
    nodes: Nodes,
    root: Id,
    parameters: Vec<String>,
    memory: Option<Memory>,
}

impl Formula {
    /// Reads a formula. Names that mean nothing else are its parameters.
    ///
    /// # Errors
    /// The first mistake, with its place.
    pub fn parse(text: &str) -> Result<Self, FormulaError> {
        let mut parser = Parser::new(text)?;
        let root = parser.formula()?;
        Ok(Self {
            text: text.to_owned(),
            root,
            nodes: parser.nodes,
            parameters: parser.parameters,
            memory: parser.memory,
        })
    }

    /// Reports whether a text can be the name of a parameter.
    pub fn is_name(text: &str) -> bool {
        let mut characters = text.chars();
        let part = |c: char| c.is_alphanumeric() || c == '_';
        characters
            .next()
            .is_some_and(|c| c.is_alphabetic() || c == '_')
            && characters.all(part)
            && !RESERVED.contains(&text)
    }

    /// Returns the text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the names of the parameters, in the order in which they stand first.
    pub fn parameters(&self) -> &[String] {
        &self.parameters
    }

    /// Returns gain `a` and decay `b` of the memory `s' = a F − b s`, for values of the parameters in any
    /// consistent units; `None` for a formula without a memory.
    ///
    /// # Errors
    /// If the gain is not finite, or the decay not positive and finite.
    pub fn memory(&self, values: &[f64]) -> Result<Option<[f64; 2]>, FormulaError> {
        let Some(memory) = &self.memory else {
            return Ok(None);
        };
        let nodes = &memory.nodes;
        let [gain, decay] = [memory.gain, memory.decay].map(|id| fixed_value(nodes, id, values));
        if !(gain.is_finite() && decay > 0.0 && decay.is_finite()) {
            let reason = format!("{} must decay at a positive rate", memory.name);
            return Err(FormulaError::new(
                &self.text,
                nodes.place(memory.decay),
                reason,
            ));
        }
        Ok(Some([gain, decay]))
    }

    /// Reports whether the formula has a memory that is a length, which counts as the depth of a moving
    /// surface: tip and sample then touch where gap and depth together are below the contact gap.
    ///
    /// # Errors
    /// If the equation of the memory has parts that do not fit together.
    pub fn moves_surface(&self, parameters: &[Dimension]) -> Result<bool, FormulaError> {
        let of = |memory| dimension::is_length(memory, &self.text, parameters);
        self.memory.as_ref().map_or(Ok(false), of)
    }

    /// Reports whether it depends on the rate.
    pub fn depends_on_rate(&self) -> bool {
        self.memory.is_none() && self.nodes.depends(self.root).rate
    }

    /// Reports whether it has a memory with an equation of its own, which then takes the place of the rate.
    pub const fn has_memory(&self) -> bool {
        self.memory.is_some()
    }

    /// Reports whether it depends on whether the tip has turned round in contact.
    pub fn remembers(&self) -> bool {
        self.nodes.depends(self.root).turned
    }

    /// The error that a parameter has no value, at the place where it stands first.
    pub fn without_value(&self, parameter: &str, reason: impl Into<String>) -> FormulaError {
        let number = self.parameters.iter().position(|other| other == parameter);
        let is = |id: &Id| number.is_some_and(|n| self.nodes.node(*id) == node::Node::Parameter(n));
        let place = (0..self.nodes.len())
            .find(is)
            .map_or(0..0, |id| self.nodes.place(id));
        FormulaError::new(&self.text, place, reason)
    }

    /// Checks that all parts fit together, with these dimensions of the parameters, and that the whole
    /// has dimension `wanted`. An angle in rad counts as a number.
    ///
    /// # Errors
    /// The first part that does not fit, with its place.
    pub fn check(&self, parameters: &[Dimension], wanted: Dimension) -> Result<(), FormulaError> {
        let (nodes, memory) = (&self.nodes, self.memory.as_ref());
        dimension::check((nodes, self.root), memory, &self.text, parameters, wanted)
    }

    /// Parts the formula into analytic pieces, for values of the parameters in any consistent units.
    /// Tip and sample touch below the gap `contact`, which is the end of a piece too; with `moves`, where
    /// gap and memory together are below it ([`Formula::moves_surface`]).
    ///
    /// # Errors
    /// If there are too many pieces, the formula has an infinite force that attracts, or what follows
    /// after a piece depends on the speed.
    pub fn pieces(
        &self,
        values: &[f64],
        contact: f64,
        moves: bool,
    ) -> Result<Pieces, FormulaError> {
        let nodes = self.nodes.clone();
        let second = match &self.memory {
            Some(_) if moves => Second::Surface,
            Some(_) => Second::Memory,
            None => Second::Rate,
        };
        Pieces::new(&self.text, nodes, self.root, values, contact, second)
    }
}

#[cfg(test)]
mod tests;
