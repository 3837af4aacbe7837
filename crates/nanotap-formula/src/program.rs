//! Straight-line programs: an expression without choices, evaluated for numbers with or without
//! derivatives, several at once.

// Only what is inlined into a function for wide registers gets their instructions.
#![allow(clippy::inline_always)]

use std::collections::HashMap;

use crate::node::{Function, Id, Node, Nodes, Operator};
use crate::number::Number;

/// A calculation with one or two earlier numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Calculation {
    Of(Function),
    Plus,
    Minus,
    Times,
    Over,
    /// To a whole power.
    Whole(i32),
    /// To half of this odd number.
    Half(i32),
    Power,
}

/// A step: a calculation with the numbers at two addresses.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    calculation: Calculation,
    a: usize,
    b: usize,
}

/// Where a number that no step computes comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Input {
    Number(f64),
    Parameter(usize),
}

/// A program. Its fixed part needs the parameters only, and is evaluated once for all gaps.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Program {
    /// The first addresses: numbers and parameters.
    inputs: Vec<Input>,
    /// The addresses after them.
    fixed: Vec<Step>,
    /// The addresses after gap and rate.
    steps: Vec<Step>,
    result: usize,
}

/// Largest whole or half power that is computed by products.
const MAX_POWER: f64 = 16.0;
/// Largest number of numbers in a program.
pub(crate) const MAX_NUMBERS: usize = 512;

/// The program of one expression as it is being written.
struct Writer<'a> {
    nodes: &'a Nodes,
    inputs: Vec<Input>,
    fixed: Vec<Draft>,
    steps: Vec<Draft>,
    places: HashMap<Id, Place>,
}

/// A step before the lengths of the parts are known, which tell the addresses.
struct Draft {
    calculation: Calculation,
    a: Place,
    b: Place,
}

/// The part of a program in which a number is, and its place there.
#[derive(Clone, Copy)]
enum Place {
    Input(usize),
    Fixed(usize),
    Gap,
    Rate,
    Step(usize),
}

impl Program {
    /// Writes the program of an expression without choices.
    pub(crate) fn of(nodes: &Nodes, root: Id) -> Self {
        let mut writer = Writer {
            nodes,
            inputs: Vec::new(),
            fixed: Vec::new(),
            steps: Vec::new(),
            places: HashMap::new(),
        };
        for id in needed(nodes, root) {
            let place = writer.place(id);
            writer.places.insert(id, place);
        }
        let (inputs, known) = (
            writer.inputs.len(),
            writer.inputs.len() + writer.fixed.len(),
        );
        let address = |place: Place| match place {
            Place::Input(k) => k,
            Place::Fixed(k) => inputs + k,
            Place::Gap => known,
            Place::Rate => known + 1,
            Place::Step(k) => known + 2 + k,
        };
        let step = |draft: Draft| Step {
            calculation: draft.calculation,
            a: address(draft.a),
            b: address(draft.b),
        };
        Self {
            result: address(writer.places[&root]),
            inputs: writer.inputs,
            fixed: writer.fixed.into_iter().map(step).collect(),
            steps: writer.steps.into_iter().map(step).collect(),
        }
    }

    /// Number of its numbers, gap and rate included.
    pub(crate) fn len(&self) -> usize {
        self.inputs.len() + self.fixed.len() + 2 + self.steps.len()
    }

    /// Whether the result is a number that depends on nothing.
    pub(crate) fn is_zero(&self) -> bool {
        self.inputs.get(self.result) == Some(&Input::Number(0.0))
    }

    /// Evaluates the fixed part for values of the parameters.
    pub(crate) fn fixed<N: Number>(&self, parameters: &[N]) -> Vec<N> {
        let mut numbers: Vec<N> = Vec::with_capacity(self.inputs.len() + self.fixed.len());
        numbers.extend(self.inputs.iter().map(|input| match *input {
            Input::Number(value) => N::constant(value),
            Input::Parameter(number) => parameters[number],
        }));
        for step in &self.fixed {
            let mut value = N::constant(0.0);
            calculate(
                step.calculation,
                &numbers[step.a],
                &numbers[step.b],
                &mut value,
            );
            numbers.push(value);
        }
        numbers
    }

    /// Evaluates the program at gaps and rates one after the other, with what [`fixed`](Self::fixed) gave, and
    /// hands each result with its number to `take`.
    #[inline(always)]
    pub(crate) fn run<N: Number>(
        &self,
        fixed: impl Fn(usize) -> N,
        places: impl Iterator<Item = [N; 2]>,
        mut take: impl FnMut(usize, &N),
    ) {
        let (mut small, mut middle, mut large);
        let known = self.inputs.len() + self.fixed.len();
        let zero = N::constant(0.0);
        let numbers: &mut [N] = match self.len() {
            0..=12 => {
                small = [zero; 12];
                &mut small
            }
            13..=40 => {
                middle = [zero; 40];
                &mut middle
            }
            length => {
                large = vec![zero; length];
                &mut large
            }
        };
        for k in 0..known {
            numbers[k] = fixed(k);
        }
        for (place, [gap, rate]) in places.enumerate() {
            numbers[known] = gap;
            numbers[known + 1] = rate;
            for (k, step) in self.steps.iter().enumerate() {
                let (before, after) = numbers.split_at_mut(known + 2 + k);
                calculate(
                    step.calculation,
                    &before[step.a],
                    &before[step.b],
                    &mut after[0],
                );
            }
            take(place, &numbers[self.result]);
        }
    }

    /// Evaluates the program at one gap and rate.
    #[inline]
    pub(crate) fn at<N: Number>(&self, fixed: impl Fn(usize) -> N, gap: N, rate: N) -> N {
        match self.steps.len() {
            0..=8 => self.at_in(&mut [gap; 8], fixed, gap, rate),
            9..=40 => self.at_in(&mut [gap; 40], fixed, gap, rate),
            count => self.at_in(&mut vec![gap; count], fixed, gap, rate),
        }
    }

    /// As [`at`](Self::at), with room for the results of the steps. The fixed numbers stay where they are,
    /// which is faster for one place.
    #[inline]
    fn at_in<N: Number>(
        &self,
        results: &mut [N],
        fixed: impl Fn(usize) -> N,
        gap: N,
        rate: N,
    ) -> N {
        let known = self.inputs.len() + self.fixed.len();
        let at = |results: &[N], address: usize| {
            if address >= known + 2 {
                results[address - known - 2]
            } else if address < known {
                fixed(address)
            } else if address == known {
                gap
            } else {
                rate
            }
        };
        for (k, step) in self.steps.iter().enumerate() {
            let (a, b) = (at(results, step.a), at(results, step.b));
            calculate(step.calculation, &a, &b, &mut results[k]);
        }
        at(results, self.result)
    }
}

impl Writer<'_> {
    fn input(&mut self, input: Input) -> Place {
        let known = self.inputs.iter().position(|other| *other == input);
        Place::Input(known.unwrap_or_else(|| {
            self.inputs.push(input);
            self.inputs.len() - 1
        }))
    }

    fn step(&mut self, is_fixed: bool, calculation: Calculation, a: Place, b: Place) -> Place {
        let step = Draft { calculation, a, b };
        if is_fixed {
            self.fixed.push(step);
            Place::Fixed(self.fixed.len() - 1)
        } else {
            self.steps.push(step);
            Place::Step(self.steps.len() - 1)
        }
    }

    /// Writes a node whose parts are written.
    fn place(&mut self, id: Id) -> Place {
        let is_fixed = self.nodes.depends(id).is_fixed();
        match self.nodes.node(id) {
            Node::Number(bits) => self.input(Input::Number(f64::from_bits(bits))),
            Node::Parameter(number) => self.input(Input::Parameter(number)),
            Node::Gap => Place::Gap,
            Node::Rate => Place::Rate,
            Node::Of(function, a) => {
                let a = self.places[&a];
                self.step(is_fixed, Calculation::Of(function), a, a)
            }
            Node::Two(operator, a, b) => {
                let power = self.nodes.value(b).filter(|_| operator == Operator::Power);
                let fixed_divisor = !is_fixed && self.nodes.depends(b).is_fixed();
                let (a, b) = (self.places[&a], self.places[&b]);
                let calculation = match (operator, power) {
                    (Operator::Plus, _) => Calculation::Plus,
                    (Operator::Minus, _) => Calculation::Minus,
                    (Operator::Times, _) => Calculation::Times,
                    (Operator::Over, _) if fixed_divisor => {
                        // One division for all gaps.
                        let one = self.input(Input::Number(1.0));
                        let inverse = self.step(true, Calculation::Over, one, b);
                        return self.step(false, Calculation::Times, a, inverse);
                    }
                    (Operator::Over, _) => Calculation::Over,
                    (Operator::Power, Some(n)) if n.fract() == 0.0 && n.abs() <= MAX_POWER => {
                        Calculation::Whole(n as i32)
                    }
                    (Operator::Power, Some(n))
                        if (2.0 * n).fract() == 0.0 && n.abs() <= MAX_POWER =>
                    {
                        Calculation::Half((2.0 * n) as i32)
                    }
                    (Operator::Power, _) => Calculation::Power,
                };
                self.step(is_fixed, calculation, a, b)
            }
            // Pieces have none.
            Node::Choice { no, .. } => self.places[&no],
        }
    }
}

/// The nodes that an expression needs, each after its parts.
pub(crate) fn needed(nodes: &Nodes, root: Id) -> Vec<Id> {
    let mut is_needed = vec![false; nodes.len()];
    is_needed[root] = true;
    // Parts have smaller numbers than what is made of them.
    for id in (0..=root).rev() {
        if !is_needed[id] {
            continue;
        }
        match nodes.node(id) {
            Node::Of(_, a) => is_needed[a] = true,
            Node::Two(_, a, b) | Node::Choice { yes: a, no: b, .. } => {
                is_needed[a] = true;
                is_needed[b] = true;
            }
            Node::Number(_) | Node::Parameter(_) | Node::Gap | Node::Rate => {}
        }
    }
    (0..=root).filter(|id| is_needed[*id]).collect()
}

/// The values of expressions without choices, each after its parts, at one gap and rate.
pub(crate) fn values_of(
    nodes: &Nodes,
    all: &[Id],
    parameters: &[f64],
    [gap, rate]: [f64; 2],
) -> HashMap<Id, f64> {
    let mut values: HashMap<Id, f64> = HashMap::with_capacity(all.len());
    for &id in all {
        let value = match nodes.node(id) {
            Node::Number(bits) => f64::from_bits(bits),
            Node::Parameter(number) => parameters[number],
            Node::Gap => gap,
            Node::Rate => rate,
            Node::Of(function, a) => function.at(values[&a]),
            Node::Two(operator, a, b) => {
                let (a, b) = (values[&a], values[&b]);
                match operator {
                    Operator::Plus => a + b,
                    Operator::Minus => a - b,
                    Operator::Times => a * b,
                    Operator::Over => a / b,
                    Operator::Power => power(a, b),
                }
            }
            Node::Choice { no, .. } => values[&no],
        };
        values.insert(id, value);
    }
    values
}

#[inline(always)]
fn calculate<N: Number>(calculation: Calculation, a: &N, b: &N, out: &mut N) {
    match calculation {
        Calculation::Plus => *out = *a + *b,
        Calculation::Minus => *out = *a - *b,
        Calculation::Times => *out = *a * *b,
        Calculation::Over => *out = *a / *b,
        Calculation::Whole(2) => *out = *a * *a,
        Calculation::Whole(n) => *out = whole_power(*a, n),
        Calculation::Half(1) => *out = a.of(sqrt),
        Calculation::Half(3) => *out = *a * a.of(sqrt),
        Calculation::Half(n) => *out = whole_power(*a, n.div_euclid(2)) * a.of(sqrt),
        Calculation::Power => *out = power(*a, *b),
        Calculation::Of(function) => *out = function.at(*a),
    }
}

/// Value and slope of a square root; for zero and below, where a contact ends, 0 with slope 0.
#[inline(always)]
fn sqrt(x: f64) -> [f64; 2] {
    let root = x.max(0.0).sqrt();
    [root, if root > 0.0 { 0.5 / root } else { 0.0 }]
}

fn whole_power<N: Number>(x: N, n: i32) -> N {
    let mut product = N::constant(1.0);
    let mut square = if n < 0 { product / x } else { x };
    let mut rest = n.unsigned_abs();
    while rest > 0 {
        if rest & 1 == 1 {
            product = product * square;
        }
        rest >>= 1;
        if rest > 0 {
            square = square * square;
        }
    }
    product
}

/// Any power; of zero and below, where a contact ends, 0 with slope 0, unless the power is whole.
fn power<N: Number>(x: N, n: N) -> N {
    x.of_both(n, |base, exponent| {
        let is_whole = exponent.fract() == 0.0;
        if base <= 0.0 && !is_whole {
            return [0.0; 3];
        }
        let value = nanotap_arithmetic::powf(base, exponent);
        let slope = exponent * nanotap_arithmetic::powf(base, exponent - 1.0);
        let ln = if base > 0.0 {
            nanotap_arithmetic::ln(base)
        } else {
            0.0
        };
        [value, slope, value * ln]
    })
}

impl Function {
    #[inline]
    fn at<N: Number>(self, x: N) -> N {
        use nanotap_arithmetic as m;
        match self {
            Self::Sqrt => x.of(sqrt),
            Self::Cbrt => x.of(|x| {
                let root = m::cbrt(x.max(0.0));
                [root, if root > 0.0 { root / (3.0 * x) } else { 0.0 }]
            }),
            Self::Exp => x.of(|x| [m::exp(x); 2]),
            Self::Ln => x.of(|x| [m::ln(x), x.recip()]),
            Self::Sin => x.of(|x| {
                let (sin, cos) = m::sin_cos(x);
                [sin, cos]
            }),
            Self::Cos => x.of(|x| {
                let (sin, cos) = m::sin_cos(x);
                [cos, -sin]
            }),
            Self::Tan => x.of(|x| {
                let tan = m::tan(x);
                [tan, 1.0 + tan * tan]
            }),
            Self::Atan => x.of(|x| [m::atan(x), 1.0 / (1.0 + x * x)]),
            Self::Sinh => x.of(|x| [m::sinh(x), m::cosh(x)]),
            Self::Cosh => x.of(|x| [m::cosh(x), m::sinh(x)]),
            Self::Tanh => x.of(|x| {
                let tanh = m::tanh(x);
                [tanh, 1.0 - tanh * tanh]
            }),
        }
    }
}
