//! Evaluates a condition for blocks of particles: each operation runs over a whole block before the next one, so that
//! its loop is the same for all conditions and the compiler makes vector instructions of it.

use spherule_frame::Attribute;
use spherule_frame::values::Value;

use super::condition::{Arithmetic, Comparison, Operation};
use super::texts::TextValue;
use super::values::FileContext;

/// Particles in a block; its values stay in the cache.
pub(super) const BLOCK: usize = 1024;

/// Memory for the evaluation of a condition: its two stacks of blocks.
#[derive(Default)]
pub(super) struct Stacks {
    numbers: Vec<[f64; BLOCK]>,
    truths: Vec<[bool; BLOCK]>,
    /// How many blocks of each are in use.
    used: [usize; 2],
}

/// What the operations of a condition work on.
#[derive(Clone, Copy)]
pub(super) struct Operands<'a> {
    /// The values of the names.
    pub(super) values: &'a [Value<&'a Attribute>],
    pub(super) texts: &'a [TextValue<Value<&'a Attribute>>],
    /// Which particles are near others.
    pub(super) near: &'a [Vec<bool>],
}

impl Stacks {
    /// Evaluates `operations` for the particles from `first` on, at most a block of them.
    pub(super) fn evaluate(
        &mut self,
        operations: &[Operation],
        Operands { values, texts, near }: Operands<'_>,
        context: FileContext<'_>,
        first: usize,
        to: &mut [bool],
    ) {
        // Operate on stacks of blocks: each operation works on all particles of a block
        self.used = [0; 2];
        let mut operations = operations.iter();
        while let Some(operation) = operations.next() {
            match *operation {
                Operation::Number(value) => match operations.as_slice().first() {
                    Some(Operation::Compare(comparison)) => {
                        self.compare_with(*comparison, value);
                        operations.next();
                    }
                    _ => self.push_number().fill(value),
                },
                Operation::Value(index) => {
                    let count = to.len();
                    let block = self.push_number();
                    context.load(values[index], first, &mut block[..count]);
                }
                Operation::Text(index) => match texts[index] {
                    TextValue::Code(code) => self.push_number().fill(code),
                    TextValue::Value(value) => {
                        let count = to.len();
                        context.load(value, first, &mut self.push_number()[..count]);
                    }
                },
                Operation::Negate => self.change(|a| -a),
                Operation::Abs => self.change(f64::abs),
                Operation::Sqrt => self.change(f64::sqrt),
                Operation::Arithmetic(function) => self.combine(function),
                Operation::Compare(comparison) => self.compare(comparison),
                Operation::Not => {
                    let top = self.used[1] - 1;
                    self.truths[top].iter_mut().for_each(|truth| *truth = !*truth);
                }
                Operation::And => self.join(|a, b| a & b),
                Operation::Or => self.join(|a, b| a | b),
                Operation::Near(index) => {
                    let top = self.push_truth();
                    let count = to.len();
                    self.truths[top][..count].copy_from_slice(&near[index][first..first + count]);
                }
            }
        }
        // The last truth is the result
        let result = &self.truths[self.used[1] - 1];
        to.copy_from_slice(&result[..to.len()]);
    }

    fn push_number(&mut self) -> &mut [f64; BLOCK] {
        let top = self.used[0];
        self.used[0] += 1;
        if self.numbers.len() == top {
            self.numbers.push([0.0; BLOCK]);
        }
        &mut self.numbers[top]
    }

    fn change(&mut self, function: impl Fn(f64) -> f64) {
        let top = self.used[0] - 1;
        for value in &mut self.numbers[top] {
            *value = function(*value);
        }
    }

    /// The two topmost blocks of numbers; the upper one is released.
    fn pop_pair(&mut self) -> (&mut [f64; BLOCK], &[f64; BLOCK]) {
        self.used[0] -= 1;
        let (below, above) = self.numbers.split_at_mut(self.used[0]);
        (&mut below[self.used[0] - 1], &above[0])
    }

    fn combine(&mut self, function: Arithmetic) {
        fn each(pair: (&mut [f64; BLOCK], &[f64; BLOCK]), function: impl Fn(f64, f64) -> f64) {
            for (a, b) in pair.0.iter_mut().zip(pair.1) {
                *a = function(*a, *b);
            }
        }
        let pair = self.pop_pair();
        match function {
            Arithmetic::Add => each(pair, |a, b| a + b),
            Arithmetic::Subtract => each(pair, |a, b| a - b),
            Arithmetic::Multiply => each(pair, |a, b| a * b),
            Arithmetic::Divide => each(pair, |a, b| a / b),
            // The result is NaN if one of the two is, as in numpy
            Arithmetic::Min => each(pair, |a, b| if a < b || a.is_nan() { a } else { b }),
            Arithmetic::Max => each(pair, |a, b| if a > b || a.is_nan() { a } else { b }),
        }
    }

    /// The topmost block of truth values after one has been added.
    fn push_truth(&mut self) -> usize {
        let top = self.used[1];
        self.used[1] += 1;
        if self.truths.len() == top {
            self.truths.push([false; BLOCK]);
        }
        top
    }

    fn compare(&mut self, comparison: Comparison) {
        let to = self.push_truth();
        self.used[0] -= 2;
        let [a, b] = [&self.numbers[self.used[0]], &self.numbers[self.used[0] + 1]];
        let pairs = self.truths[to].iter_mut().zip(a.iter().zip(b));
        compare(comparison, pairs.map(|(to, (a, b))| (to, *a, *b)));
    }

    /// Compares with a constant, which needs no block.
    fn compare_with(&mut self, comparison: Comparison, constant: f64) {
        let to = self.push_truth();
        self.used[0] -= 1;
        let numbers = &self.numbers[self.used[0]];
        let pairs = self.truths[to].iter_mut().zip(numbers);
        compare(comparison, pairs.map(|(to, a)| (to, *a, constant)));
    }

    fn join(&mut self, function: impl Fn(bool, bool) -> bool) {
        self.used[1] -= 1;
        let (below, above) = self.truths.split_at_mut(self.used[1]);
        for (a, b) in below[self.used[1] - 1].iter_mut().zip(&above[0]) {
            *a = function(*a, *b);
        }
    }
}

/// Stores whether each pair of numbers compares as asked.
#[expect(clippy::float_cmp, reason = "what the user asks for")]
fn compare<'a>(comparison: Comparison, pairs: impl Iterator<Item = (&'a mut bool, f64, f64)>) {
    match comparison {
        Comparison::Less => pairs.for_each(|(to, a, b)| *to = a < b),
        Comparison::LessOrEqual => pairs.for_each(|(to, a, b)| *to = a <= b),
        Comparison::Greater => pairs.for_each(|(to, a, b)| *to = a > b),
        Comparison::GreaterOrEqual => pairs.for_each(|(to, a, b)| *to = a >= b),
        Comparison::Equal => pairs.for_each(|(to, a, b)| *to = a == b),
        Comparison::NotEqual => pairs.for_each(|(to, a, b)| *to = a != b),
    }
}
