//! From text to nodes.

use std::ops::Range;

use crate::error::FormulaError;
use crate::node::{Function, Id, Node, Nodes, Operator, Test};
use crate::token::{Token, tokens};

/// Most bytes of a formula.
pub(crate) const MAX_BYTES: usize = 4096;
/// Most parentheses, choices and powers inside each other; keeps hostile text from overflowing the stack.
const MAX_DEPTH: usize = 48;
/// Most nodes of a formula.
const MAX_NODES: usize = 2000;
/// Names that mean something by themselves and so cannot be parameters.
pub(crate) const RESERVED: [&str; 13] = [
    "d", "v", "pi", "turned", "if", "then", "else", "and", "or", "not", "min", "max", "abs",
];

/// Name of the force in the equation of a memory.
const FORCE: &str = "F";
/// What such an equation can be.
const EQUATION: &str = "a memory is driven by the force F and decays, as in `s' = (F/k - s)/tau`: of F, of itself \
                        and of parameters, in proportion to both";

/// A memory of the force, `s' = gain F − decay s`.
#[derive(Clone, Debug)]
pub(crate) struct Memory {
    pub(crate) name: String,
    pub(crate) nodes: Nodes,
    pub(crate) gain: Id,
    pub(crate) decay: Id,
}

/// A condition as written.
enum Condition {
    Test(Test),
    Not(Box<Self>),
    And(Box<[Self; 2]>),
    Or(Box<[Self; 2]>),
}

pub(crate) struct Parser<'a> {
    text: &'a str,
    tokens: Vec<(Token, Range<usize>)>,
    at: usize,
    depth: usize,
    pub(crate) nodes: Nodes,
    pub(crate) parameters: Vec<String>,
    definitions: Vec<(String, Id)>,
    /// Name of the memory whose equation is being read.
    equation: Option<String>,
    pub(crate) memory: Option<Memory>,
}

impl<'a> Parser<'a> {
    pub(crate) fn new(text: &'a str) -> Result<Self, FormulaError> {
        if text.len() > MAX_BYTES {
            let reason = format!("a formula has at most {MAX_BYTES} bytes");
            return Err(FormulaError::new(text, 0..0, reason));
        }
        Ok(Self {
            text,
            tokens: tokens(text)?,
            at: 0,
            depth: 0,
            nodes: Nodes::default(),
            parameters: Vec::new(),
            definitions: Vec::new(),
            equation: None,
            memory: None,
        })
    }

    /// The equation of a memory, definitions `name = …;` and the force.
    pub(crate) fn formula(&mut self) -> Result<Id, FormulaError> {
        if let (Some((Token::Name(name), place)), Some((Token::Sign("'"), _))) =
            (self.tokens.get(self.at), self.tokens.get(self.at + 1))
        {
            let (name, place) = (name.clone(), place.clone());
            self.equation(name, place)?;
        }
        while let (Some((Token::Name(name), place)), Some((Token::Sign("="), _))) =
            (self.tokens.get(self.at), self.tokens.get(self.at + 1))
        {
            let (name, place) = (name.clone(), place.clone());
            if RESERVED.contains(&name.as_str()) || is_function(&name) {
                return Err(self.error(place, "this name has a meaning of its own"));
            }
            self.at += 2;
            let value = self.sum()?;
            let defined = self.definitions.iter().any(|(other, _)| *other == name)
                || self.memory_name() == Some(name.as_str());
            if defined || self.parameters.contains(&name) {
                let reason = "it has a value already: a name is defined once, before it is used";
                return Err(self.error(place, reason));
            }
            self.expect(";", "a definition ends with `;`, and the force follows")?;
            self.definitions.push((name, value));
        }
        let force = self.sum()?;
        match self.next() {
            (Token::End, _) => Ok(force),
            (Token::Sign(";"), place) => Err(self.error(
                place,
                "only definitions `name = …` end with `;`; the force stands last, without one",
            )),
            (Token::Sign("'"), place) => Err(self.error(
                place,
                "the equation of a memory stands first, as in `s' = (F/k - s)/tau; …`, and there is one",
            )),
            (Token::Sign("="), place) => {
                Err(self.error(place, "`=` defines a name, as in `x = -d; 2*x`"))
            }
            (Token::Sign("<" | ">" | "<=" | ">="), place) => Err(self.error(
                place,
                "a comparison belongs between `if` and `then`, or in step(a - b)",
            )),
            (_, place) => Err(self.error(place, "an operator such as `*` is missing before it")),
        }
    }

    /// Reads the equation `name' = …;` of a memory.
    fn equation(&mut self, name: String, place: Range<usize>) -> Result<(), FormulaError> {
        if RESERVED.contains(&name.as_str()) || is_function(&name) || name == FORCE {
            return Err(self.error(place, "this name has a meaning of its own"));
        }
        self.at += 2;
        self.expect("=", "the equation of a memory reads `s' = (F/k - s)/tau;`")?;
        self.equation = Some(name.clone());
        let outside = std::mem::take(&mut self.nodes);
        let start = self.start();
        let rate = self.sum()?;
        self.nodes.place = self.since(start);
        let whole = self.nodes.place.clone();
        self.expect(";", "an equation ends with `;`, and the force follows")?;
        let plane = self.nodes.plane(rate);
        let [gain, growth, constant] = plane.ok_or_else(|| self.error(whole.clone(), EQUATION))?;
        if self.nodes.value(constant) != Some(0.0) {
            return Err(self.error(whole, EQUATION));
        }
        let decay = self.nodes.negative(growth);
        let nodes = std::mem::replace(&mut self.nodes, outside);
        self.equation = None;
        self.memory = Some(Memory {
            name,
            nodes,
            gain,
            decay,
        });
        Ok(())
    }

    /// The name of the memory, also while its equation is being read.
    fn memory_name(&self) -> Option<&str> {
        let read = self.memory.as_ref().map(|memory| memory.name.as_str());
        self.equation.as_deref().or(read)
    }

    fn error(&self, place: Range<usize>, reason: impl Into<String>) -> FormulaError {
        FormulaError::new(self.text, place, reason)
    }

    fn peek(&self) -> &Token {
        &self.tokens[self.at].0
    }

    fn next(&mut self) -> (Token, Range<usize>) {
        let next = self.tokens[self.at].clone();
        if self.at + 1 < self.tokens.len() {
            self.at += 1;
        }
        next
    }

    fn start(&self) -> usize {
        self.tokens[self.at].1.start
    }

    /// The place from a byte to the end of the last token.
    fn since(&self, start: usize) -> Range<usize> {
        let end = self
            .at
            .checked_sub(1)
            .map_or(start, |at| self.tokens[at].1.end);
        start..end.max(start)
    }

    fn takes(&mut self, sign: &'static str) -> bool {
        let found = *self.peek() == Token::Sign(sign);
        self.at += usize::from(found);
        found
    }

    fn takes_word(&mut self, word: &str) -> bool {
        let found = matches!(self.peek(), Token::Name(name) if name == word);
        self.at += usize::from(found);
        found
    }

    fn expect(&mut self, sign: &'static str, reason: &str) -> Result<(), FormulaError> {
        if self.takes(sign) {
            return Ok(());
        }
        let place = self.tokens[self.at].1.clone();
        Err(self.error(place, reason))
    }

    /// Runs `read` one level deeper.
    fn deeper<T>(
        &mut self,
        read: impl FnOnce(&mut Self) -> Result<T, FormulaError>,
    ) -> Result<T, FormulaError> {
        let place = self.tokens[self.at].1.clone();
        if self.depth == MAX_DEPTH {
            let reason =
                format!("more than {MAX_DEPTH} levels of parentheses: define parts by names");
            return Err(self.error(place, reason));
        }
        if self.nodes.len() > MAX_NODES {
            return Err(self.error(place, format!("more than {MAX_NODES} parts")));
        }
        self.depth += 1;
        let read = read(self);
        self.depth -= 1;
        read
    }

    fn two(&mut self, start: usize, operator: Operator, a: Id, b: Id) -> Id {
        self.nodes.place = self.since(start);
        self.nodes.two(operator, a, b)
    }

    fn sum(&mut self) -> Result<Id, FormulaError> {
        let start = self.start();
        if self.takes_word("if") {
            return self.deeper(|parser| parser.choice(start));
        }
        let mut sum = self.product()?;
        loop {
            let operator = if self.takes("+") {
                Operator::Plus
            } else if self.takes("-") {
                Operator::Minus
            } else {
                return Ok(sum);
            };
            let term = self.product()?;
            sum = self.two(start, operator, sum, term);
        }
    }

    fn product(&mut self) -> Result<Id, FormulaError> {
        let start = self.start();
        let mut product = self.signed()?;
        loop {
            let operator = if self.takes("*") {
                Operator::Times
            } else if self.takes("/") {
                Operator::Over
            } else {
                return Ok(product);
            };
            let factor = self.signed()?;
            product = self.two(start, operator, product, factor);
        }
    }

    fn signed(&mut self) -> Result<Id, FormulaError> {
        let start = self.start();
        if self.takes("-") {
            let value = self.deeper(Self::signed)?;
            self.nodes.place = self.since(start);
            return Ok(self.nodes.negative(value));
        }
        if self.takes("+") {
            return self.deeper(Self::signed);
        }
        let base = self.atom()?;
        if !self.takes("^") {
            return Ok(base);
        }
        let exponent = self.deeper(Self::signed)?;
        Ok(self.two(start, Operator::Power, base, exponent))
    }

    /// The choice that follows `if`.
    fn choice(&mut self, start: usize) -> Result<Id, FormulaError> {
        let condition = self.either()?;
        if !self.takes_word("then") {
            let place = self.tokens[self.at].1.clone();
            return Err(self.error(place, "a choice reads `if d > a then … else …`"));
        }
        let yes = self.sum()?;
        if !self.takes_word("else") {
            let place = self.tokens[self.at].1.clone();
            let reason = "a choice reads `if d > a then … else …`: its `else` is missing";
            return Err(self.error(place, reason));
        }
        let no = self.sum()?;
        self.nodes.place = self.since(start);
        Ok(self.decided(&condition, yes, no))
    }

    fn decided(&mut self, condition: &Condition, yes: Id, no: Id) -> Id {
        match condition {
            Condition::Test(test) => self.nodes.choice(*test, yes, no),
            Condition::Not(inner) => self.decided(inner, no, yes),
            Condition::And(both) => {
                let yes = self.decided(&both[1], yes, no);
                self.decided(&both[0], yes, no)
            }
            Condition::Or(either) => {
                let no = self.decided(&either[1], yes, no);
                self.decided(&either[0], yes, no)
            }
        }
    }

    fn either(&mut self) -> Result<Condition, FormulaError> {
        let mut condition = self.both()?;
        while self.takes_word("or") {
            condition = Condition::Or(Box::new([condition, self.both()?]));
        }
        Ok(condition)
    }

    fn both(&mut self) -> Result<Condition, FormulaError> {
        let mut condition = self.single()?;
        while self.takes_word("and") {
            condition = Condition::And(Box::new([condition, self.single()?]));
        }
        Ok(condition)
    }

    fn single(&mut self) -> Result<Condition, FormulaError> {
        if self.takes_word("not") {
            let inner = self.deeper(Self::single)?;
            return Ok(Condition::Not(Box::new(inner)));
        }
        if self.memory_name().is_none() && self.takes_word("turned") {
            return Ok(Condition::Test(Test::Turned));
        }
        // A parenthesis begins a condition or a number.
        let before = self.at;
        if self.takes("(") {
            let inner = self.deeper(Self::either);
            if inner.is_ok() && self.takes(")") && !self.compares() {
                return inner;
            }
            self.at = before;
        }
        let start = self.start();
        let left = self.sum()?;
        let (sign, place) = self.next();
        let Token::Sign(sign @ ("<" | ">" | "<=" | ">=")) = sign else {
            let reason = "a condition compares two quantities, as in `d > a`, or is `turned`";
            return Err(self.error(place, reason));
        };
        let right = self.sum()?;
        let (more, less) = if sign.starts_with('>') {
            (left, right)
        } else {
            (right, left)
        };
        let guard = self.two(start, Operator::Minus, more, less);
        Ok(Condition::Test(Test::Positive(guard)))
    }

    /// Whether a comparison or a calculation goes on here.
    fn compares(&self) -> bool {
        matches!(self.peek(), Token::Sign(sign) if ![")", ";", ","].contains(sign))
    }

    fn atom(&mut self) -> Result<Id, FormulaError> {
        let (token, place) = self.next();
        self.nodes.place = place.clone();
        match token {
            Token::Number(value) => {
                let (next, place) = self.tokens[self.at].clone();
                if let Token::Name(word) = next
                    && !["then", "else", "and", "or"].contains(&word.as_str())
                {
                    let reason = "an operator such as `*` is missing before it; a number has no unit: \
                                  give a parameter with its unit";
                    return Err(self.error(place, reason));
                }
                Ok(self.nodes.number(value))
            }
            Token::Sign("(") => {
                let inner = self.deeper(Self::sum)?;
                self.expect(")", "a parenthesis is open: `)` is missing")?;
                Ok(inner)
            }
            Token::Name(name) => self.name(&name, place),
            Token::Sign(sign) => {
                let reason = format!("a number, a name or `(` is needed before `{sign}`");
                Err(self.error(place, reason))
            }
            Token::End => Err(self.error(place, "a number, a name or `(` is missing at the end")),
        }
    }

    fn name(&mut self, name: &str, place: Range<usize>) -> Result<Id, FormulaError> {
        if *self.peek() == Token::Sign("(") {
            return self.deeper(|parser| parser.call(name, place));
        }
        if is_function(name) || ["min", "max", "abs"].contains(&name) {
            return Err(self.error(place, format!("a function needs its argument: {name}(…)")));
        }
        match name {
            "d" | "v" | "turned" if self.equation.is_some() => Err(self.error(place, EQUATION)),
            FORCE if self.equation.is_some() => Ok(self.nodes.add(Node::Gap)),
            _ if self.memory_name() == Some(name) => Ok(self.nodes.add(Node::Rate)),
            "v" | "turned" if self.memory.is_some() => Err(self.error(
                place,
                "a force with a memory depends on the gap and the memory alone",
            )),
            "d" => Ok(self.nodes.add(Node::Gap)),
            "v" => Ok(self.nodes.add(Node::Rate)),
            "pi" => Ok(self.nodes.number(std::f64::consts::PI)),
            "turned" => Err(self.error(place, "it is a condition: `if turned then … else …`")),
            name if RESERVED.contains(&name) => {
                Err(self.error(place, "a number, a name or `(` is needed here"))
            }
            name => {
                if let Some((_, id)) = self.definitions.iter().find(|(other, _)| other == name) {
                    return Ok(*id);
                }
                let known = self.parameters.iter().position(|other| other == name);
                let number = known.unwrap_or(self.parameters.len());
                if known.is_none() {
                    self.parameters.push(name.to_owned());
                }
                Ok(self.nodes.add(Node::Parameter(number)))
            }
        }
    }

    /// The arguments of a function, and its value.
    fn call(&mut self, name: &str, place: Range<usize>) -> Result<Id, FormulaError> {
        self.takes("(");
        let mut arguments = vec![self.sum()?];
        while self.takes(",") {
            arguments.push(self.sum()?);
        }
        self.expect(")", "a parenthesis is open: `)` is missing")?;
        let whole = self.since(place.start);
        self.nodes.place = whole.clone();
        if let ("min" | "max", [first, others @ ..]) = (name, &arguments[..])
            && !others.is_empty()
        {
            return Ok(others.iter().fold(*first, |best, &other| {
                let guard = self.nodes.two(Operator::Minus, best, other);
                let [yes, no] = if name == "max" {
                    [best, other]
                } else {
                    [other, best]
                };
                self.nodes.choice(Test::Positive(guard), yes, no)
            }));
        }
        let function = Function::ALL.iter().find(|(other, _)| *other == name);
        match (name, function, &arguments[..]) {
            ("abs", _, &[x]) => {
                let negative = self.nodes.negative(x);
                Ok(self.nodes.choice(Test::Positive(x), x, negative))
            }
            ("step", _, &[x]) => {
                let [one, zero] = [1.0, 0.0].map(|value| self.nodes.number(value));
                Ok(self.nodes.choice(Test::Positive(x), one, zero))
            }
            (_, Some((_, function)), &[x]) => Ok(self.nodes.of(*function, x)),
            ("min" | "max", ..) => {
                Err(self.error(whole, format!("{name} needs two or more arguments")))
            }
            ("abs" | "step", ..) | (_, Some(_), _) => {
                Err(self.error(whole, format!("{name} has one argument")))
            }
            _ => {
                let names = Function::ALL.iter().map(|(name, _)| *name);
                let names: Vec<&str> = names.chain(["abs", "min", "max", "step"]).collect();
                let reason = format!(
                    "there is no function of this name (there are {}); a product needs its `*`",
                    names.join(", ")
                );
                Err(self.error(place, reason))
            }
        }
    }
}

/// Whether a name is that of a function of one argument.
fn is_function(name: &str) -> bool {
    name == "step" || Function::ALL.iter().any(|(other, _)| *other == name)
}
