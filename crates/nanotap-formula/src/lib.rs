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
//! let pieces = formula.pieces(&[2.0], 0.0)?;
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
use parser::{Parser, RESERVED};
pub use piece::{End, Exit, Pieces, Smoothness, Value};

/// A formula, as read.
#[derive(Clone, Debug)]
pub struct Formula {
    text: String,
    nodes: Nodes,
    root: Id,
    parameters: Vec<String>,
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

    /// Reports whether it depends on the rate.
    pub fn depends_on_rate(&self) -> bool {
        self.nodes.depends(self.root).rate
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
        dimension::check(&self.nodes, self.root, &self.text, parameters, wanted)
    }

    /// Parts the formula into analytic pieces, for values of the parameters in any consistent units.
    /// Tip and sample touch below the gap `contact`, which is the end of a piece too.
    ///
    /// # Errors
    /// If there are too many pieces, the formula has an infinite force that attracts, or what follows
    /// after a piece depends on the speed.
    pub fn pieces(&self, values: &[f64], contact: f64) -> Result<Pieces, FormulaError> {
        Pieces::new(&self.text, self.nodes.clone(), self.root, values, contact)
    }
}

#[cfg(test)]
mod tests;
