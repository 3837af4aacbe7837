//! Expressions as nodes that refer to earlier ones; each stands once.

use std::collections::HashMap;
use std::ops::Range;

/// The number of a node.
pub(crate) type Id = usize;

/// A function of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Function {
    Sqrt,
    Cbrt,
    Exp,
    Ln,
    Sin,
    Cos,
    Tan,
    Atan,
    Sinh,
    Cosh,
    Tanh,
}

impl Function {
    pub(crate) const ALL: [(&'static str, Self); 11] = [
        ("sqrt", Self::Sqrt),
        ("cbrt", Self::Cbrt),
        ("exp", Self::Exp),
        ("ln", Self::Ln),
        ("sin", Self::Sin),
        ("cos", Self::Cos),
        ("tan", Self::Tan),
        ("atan", Self::Atan),
        ("sinh", Self::Sinh),
        ("cosh", Self::Cosh),
        ("tanh", Self::Tanh),
    ];
}

/// A calculation with two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Operator {
    Plus,
    Minus,
    Times,
    Over,
    Power,
}

/// What decides between two expressions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Test {
    /// A quantity is positive.
    Positive(Id),
    /// The tip has turned round since contact began.
    Turned,
}

/// Part of an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Node {
    /// A number, by its bits.
    Number(u64),
    Parameter(usize),
    Gap,
    Rate,
    Of(Function, Id),
    Two(Operator, Id, Id),
    Choice {
        test: Test,
        yes: Id,
        no: Id,
    },
}

impl Node {
    pub(crate) fn number(value: f64) -> Self {
        // One zero, so that equal numbers are one node.
        Self::Number((value + 0.0).to_bits())
    }
}

/// What an expression depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a question by itself"
)]
pub(crate) struct Depends {
    pub(crate) gap: bool,
    pub(crate) rate: bool,
    /// It has a choice in it.
    pub(crate) chooses: bool,
    /// It has a choice in it that needs to know whether the tip has turned.
    pub(crate) turned: bool,
}

impl Depends {
    /// Neither gap, nor rate, nor memory.
    pub(crate) const fn is_fixed(self) -> bool {
        !self.gap && !self.rate && !self.turned
    }

    const fn and(self, other: Self) -> Self {
        Self {
            gap: self.gap || other.gap,
            rate: self.rate || other.rate,
            chooses: self.chooses || other.chooses,
            turned: self.turned || other.turned,
        }
    }
}

/// The nodes of a formula. What does not change a value is left out: `x + 0`, `1 x`, `0 x`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Nodes {
    all: Vec<Node>,
    depends: Vec<Depends>,
    places: Vec<Range<usize>>,
    known: HashMap<Node, Id>,
    lines: HashMap<Id, Option<[Id; 2]>>,
    /// Place in the text of the nodes that are being added.
    pub(crate) place: Range<usize>,
}

impl Nodes {
    pub(crate) fn len(&self) -> usize {
        self.all.len()
    }

    pub(crate) fn node(&self, id: Id) -> Node {
        self.all[id]
    }

    pub(crate) fn depends(&self, id: Id) -> Depends {
        self.depends[id]
    }

    /// Where in the text the node stands first.
    pub(crate) fn place(&self, id: Id) -> Range<usize> {
        self.places[id].clone()
    }

    /// The value of a node that is a number.
    pub(crate) fn value(&self, id: Id) -> Option<f64> {
        match self.all[id] {
            Node::Number(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    pub(crate) fn number(&mut self, value: f64) -> Id {
        self.add(Node::number(value))
    }

    pub(crate) fn add(&mut self, node: Node) -> Id {
        if let Some(&id) = self.known.get(&node) {
            return id;
        }
        let depends = match node {
            Node::Number(_) | Node::Parameter(_) => Depends::default(),
            Node::Gap => Depends {
                gap: true,
                ..Depends::default()
            },
            Node::Rate => Depends {
                rate: true,
                ..Depends::default()
            },
            Node::Of(_, a) => self.depends[a],
            Node::Two(_, a, b) => self.depends[a].and(self.depends[b]),
            Node::Choice { test, yes, no } => {
                let of_test = match test {
                    Test::Positive(guard) => self.depends[guard],
                    Test::Turned => Depends {
                        turned: true,
                        ..Depends::default()
                    },
                };
                let own = self.depends[yes].and(self.depends[no]).and(of_test);
                Depends {
                    chooses: true,
                    ..own
                }
            }
        };
        self.all.push(node);
        self.depends.push(depends);
        self.places.push(self.place.clone());
        self.known.insert(node, self.all.len() - 1);
        self.all.len() - 1
    }

    pub(crate) fn of(&mut self, function: Function, a: Id) -> Id {
        match (function, self.value(a)) {
            (Function::Sqrt | Function::Cbrt, Some(0.0)) => a,
            _ => self.add(Node::Of(function, a)),
        }
    }

    pub(crate) fn two(&mut self, operator: Operator, a: Id, b: Id) -> Id {
        use Operator::{Minus, Over, Plus, Power, Times};
        let number = |value: Option<f64>, wanted: f64| value == Some(wanted);
        let (x, y) = (self.value(a), self.value(b));
        match operator {
            Plus if number(x, 0.0) => b,
            Plus | Minus if number(y, 0.0) => a,
            Times if number(x, 1.0) => b,
            Times | Over | Power if number(y, 1.0) => a,
            Times if number(x, 0.0) || number(y, 0.0) => self.number(0.0),
            Over if number(x, 0.0) && !number(y, 0.0) => a,
            Power if number(x, 0.0) && y.is_some_and(|y| y > 0.0) => a,
            _ => match (operator, x, y) {
                (Plus, Some(x), Some(y)) => self.number(x + y),
                (Minus, Some(x), Some(y)) => self.number(x - y),
                (Times, Some(x), Some(y)) => self.number(x * y),
                (Over, Some(x), Some(y)) if y != 0.0 => self.number(x / y),
                _ => self.add(Node::Two(operator, a, b)),
            },
        }
    }

    pub(crate) fn negative(&mut self, a: Id) -> Id {
        let zero = self.number(0.0);
        self.two(Operator::Minus, zero, a)
    }

    /// `yes` where the test is true, else `no`.
    pub(crate) fn choice(&mut self, test: Test, yes: Id, no: Id) -> Id {
        if yes == no {
            return yes;
        }
        let Test::Positive(guard) = test else {
            return self.add(Node::Choice { test, yes, no });
        };
        if let Some(value) = self.value(guard) {
            return if value > 0.0 { yes } else { no };
        }
        // A guard and its negative are one test.
        if let Node::Two(Operator::Minus, a, b) = self.all[guard]
            && (self.value(a) == Some(0.0) || a > b && self.value(b).is_none())
        {
            let guard = self.two(Operator::Minus, b, a);
            let test = Test::Positive(guard);
            return self.add(Node::Choice {
                test,
                yes: no,
                no: yes,
            });
        }
        self.add(Node::Choice { test, yes, no })
    }

    /// The coefficients `[a, b]` if the expression is `a d + b`, none of them with a gap or a choice in it.
    pub(crate) fn line(&mut self, id: Id) -> Option<[Id; 2]> {
        if let Some(known) = self.lines.get(&id) {
            return *known;
        }
        let line = self.new_line(id);
        self.lines.insert(id, line);
        line
    }

    /// The coefficients `[a, b, c]` if the expression is `a d + b v + c` with fixed ones, without a choice.
    pub(crate) fn plane(&mut self, id: Id) -> Option<[Id; 3]> {
        let depends = self.depends[id];
        if depends.chooses {
            return None;
        }
        let [zero, one] = [0.0, 1.0].map(|value| self.number(value));
        if depends.is_fixed() {
            return Some([zero, zero, id]);
        }
        match self.all[id] {
            Node::Gap => Some([one, zero, zero]),
            Node::Rate => Some([zero, one, zero]),
            Node::Two(operator @ (Operator::Plus | Operator::Minus), a, b) => {
                let (a, b) = (self.plane(a)?, self.plane(b)?);
                Some(std::array::from_fn(|k| self.two(operator, a[k], b[k])))
            }
            Node::Two(Operator::Times, a, b) => {
                let (factor, plane) = if self.depends[a].is_fixed() {
                    (a, b)
                } else {
                    (b, a)
                };
                if !self.depends[factor].is_fixed() {
                    return None;
                }
                let plane = self.plane(plane)?;
                Some(plane.map(|part| self.two(Operator::Times, factor, part)))
            }
            Node::Two(Operator::Over, a, b) if self.depends[b].is_fixed() => {
                let plane = self.plane(a)?;
                Some(plane.map(|part| self.two(Operator::Over, part, b)))
            }
            _ => None,
        }
    }

    fn new_line(&mut self, id: Id) -> Option<[Id; 2]> {
        let depends = self.depends[id];
        if depends.rate || depends.chooses {
            return None;
        }
        let zero = self.number(0.0);
        if !depends.gap {
            return Some([zero, id]);
        }
        match self.all[id] {
            Node::Gap => Some([self.number(1.0), zero]),
            Node::Two(operator @ (Operator::Plus | Operator::Minus), a, b) => {
                let ([a, c], [b, d]) = (self.line(a)?, self.line(b)?);
                Some([self.two(operator, a, b), self.two(operator, c, d)])
            }
            Node::Two(Operator::Times, a, b) => {
                let (factor, line) = if self.depends[a].gap { (b, a) } else { (a, b) };
                if self.depends[factor].gap {
                    return None;
                }
                let line = self.line(line)?;
                Some(line.map(|part| self.two(Operator::Times, factor, part)))
            }
            Node::Two(Operator::Over, a, b) if !self.depends[b].gap => {
                let line = self.line(a)?;
                Some(line.map(|part| self.two(Operator::Over, part, b)))
            }
            _ => None,
        }
    }
}
