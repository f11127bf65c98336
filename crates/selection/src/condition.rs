//! Conditions on particles: their grammar, and their form for evaluation.
//!
//! The parser is our own and small: crates for expressions evaluate one particle at a time, call the C library for
//! functions, or do not say where an error is.
//!
//! ```text
//! condition  = and { "||" and }
//! and        = comparison { "&&" comparison }
//! comparison = sum [ ("<" | "<=" | ">" | ">=" | "==" | "!=") sum ] | name ("==" | "!=") text | name "in" list
//! list       = "(" item { "," item } ")"
//! item       = text | number
//! text       = "'" ... "'" | name without a value
//! sum        = product { ("+" | "-") product }
//! product    = unary { ("*" | "/") unary }
//! unary      = [ "-" | "+" | "!" ] unary | primary
//! primary    = number | name | "within" number "of" "(" condition ")" | name "[" number "]" | function "(" sum { "," sum } ")" | "(" condition ")"
//! ```

use std::fmt;

use super::error::ConditionError;
use super::token::{Placed, Token, tokens};

/// Maximum length of a condition in bytes.
const MAX_LENGTH: usize = 4096;

/// Maximum depth of parentheses and signs within each other.
const MAX_DEPTH: usize = 64;

/// Names of the functions.
pub(super) const FUNCTIONS: [&str; 4] = ["abs", "sqrt", "min", "max"];

/// A condition on particles, such as `speed > 2 && z < 0.5`.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    text: String,
    /// Operations in postfix order.
    pub(super) operations: Vec<Operation>,
    pub(super) names: Vec<NameUse>,
    pub(super) texts: Vec<TextUse>,
    /// Conditions on others that a particle is near.
    pub(super) neighbours: Vec<NeighbourUse>,
}

/// Others that a particle is near: `within 5 of (type == 1)`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NeighbourUse {
    pub(super) distance: f64,
    /// The condition on them, in postfix order.
    pub(super) operations: Vec<Operation>,
}

/// A text that a value is compared with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct TextUse {
    /// Index of the name of the value.
    pub(super) of: usize,
    pub(super) text: String,
    /// In characters, from 1.
    pub(super) column: usize,
    /// Whether it may be the name of a value: it is not in quotes.
    pub(super) may_be_value: bool,
    /// The list after `in` that it is in, by the place of this in the condition.
    pub(super) list: Option<usize>,
}

/// A name in a condition, and where it appears first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct NameUse {
    pub(super) name: String,
    /// In characters, from 1.
    pub(super) column: usize,
}

/// Comparison of two numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Comparison {
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    NotEqual,
}

/// Function of two numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arithmetic {
    Add,
    Subtract,
    Multiply,
    Divide,
    Min,
    Max,
}

/// An operation on two stacks, of numbers and of truth values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Operation {
    Number(f64),
    /// The value with this index among the names.
    Value(usize),
    /// The number of the text with this index.
    Text(usize),
    Negate,
    Abs,
    Sqrt,
    Arithmetic(Arithmetic),
    Compare(Comparison),
    Not,
    And,
    Or,
    /// Whether a particle is near those of [`NeighbourUse`] with this index.
    Near(usize),
}

/// The kind of a part of a condition.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Number,
    Truth,
}

impl Condition {
    /// Reads a condition.
    ///
    /// # Errors
    /// The text has a syntax error, compares conditions as numbers, is too long or too deep.
    pub fn parse(text: &str) -> Result<Self, ConditionError> {
        if text.len() > MAX_LENGTH {
            let what =
                format!("a condition may have {MAX_LENGTH} bytes, this one has {}", text.len());
            return Err(ConditionError { column: 1, what });
        }
        // Read the condition
        let mut parser = Parser {
            tokens: tokens(text)?,
            next: 0,
            end: text.chars().count() + 1,
            depth: 0,
            operations: Vec::new(),
            names: Vec::new(),
            texts: Vec::new(),
            neighbours: Vec::new(),
        };
        let kind = parser.any()?;
        // Explain what is left over
        if let Some(found) = parser.tokens.get(parser.next) {
            let what = match &found.token {
                Token::Name(name) if ["and", "or"].contains(&name.as_str()) => {
                    format!("`{name}` is not a sign of conditions: write && or ||")
                }
                token => format!("unexpected {token}"),
            };
            return Err(parser.error(found.column, what));
        }
        // A condition is true or false
        if kind == Kind::Number {
            let what =
                "this is a number, not a condition; compare it, as in `speed > 2`".to_owned();
            return Err(parser.error(1, what));
        }
        let Parser { operations, names, texts, neighbours, .. } = parser;
        Ok(Self { text: text.to_owned(), operations, names, texts, neighbours })
    }

    /// The text as it was written.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// The particles for which it does not hold.
    #[must_use]
    pub fn negated(mut self) -> Self {
        self.text = format!("!({})", self.text);
        self.operations.push(Operation::Not);
        self
    }

    /// The particles for which both hold.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        self.joined(other, "&&", Operation::And)
    }

    /// The particles for which one of both holds.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        self.joined(other, "||", Operation::Or)
    }

    /// Both conditions with an operation between them. Nothing is parsed, so that no limit of lengths and depths applies.
    fn joined(mut self, other: Self, sign: &str, operation: Operation) -> Self {
        let is_unary = matches!(self.operations.last(), Some(Operation::Not));
        let own = if is_unary { self.text } else { format!("({})", self.text) };
        // What the operations of the other refer to follows after what those of this one refer to
        let [names, texts, near] = [self.names.len(), self.texts.len(), self.neighbours.len()];
        let moved = |operation: Operation| match operation {
            Operation::Value(index) => Operation::Value(names + index),
            Operation::Text(index) => Operation::Text(texts + index),
            Operation::Near(index) => Operation::Near(near + index),
            other => other,
        };
        let place = own.chars().count() + 1;
        self.names.extend(other.names);
        self.texts.extend(other.texts.into_iter().map(|text| TextUse {
            of: names + text.of,
            list: text.list.map(|list| place + list),
            ..text
        }));
        self.neighbours.extend(other.neighbours.into_iter().map(|neighbours| NeighbourUse {
            operations: neighbours.operations.into_iter().map(moved).collect(),
            ..neighbours
        }));
        self.operations.extend(other.operations.into_iter().map(moved));
        self.operations.push(operation);
        self.text = format!("{own} {sign} ({})", other.text);
        self
    }
}

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "`{number}`"),
            Self::Name(name) => write!(f, "`{name}`"),
            Self::Text(text) => write!(f, "the text '{text}'"),
            Self::Sign(sign) => write!(f, "`{sign}`"),
        }
    }
}

struct Parser {
    tokens: Vec<Placed>,
    next: usize,
    /// Column behind the text.
    end: usize,
    depth: usize,
    operations: Vec<Operation>,
    names: Vec<NameUse>,
    texts: Vec<TextUse>,
    neighbours: Vec<NeighbourUse>,
}

type Parsed = Result<Kind, ConditionError>;

/// A level of the grammar.
type Level = fn(&mut Parser) -> Parsed;

impl Parser {
    fn error(&self, column: usize, what: impl Into<String>) -> ConditionError {
        ConditionError { column, what: what.into() }
    }

    /// Column of the next token.
    fn column(&self) -> usize {
        self.tokens.get(self.next).map_or(self.end, |placed| placed.column)
    }

    /// Takes the next token if it is one of `signs`.
    fn take(&mut self, signs: &[&str]) -> Option<&'static str> {
        match self.tokens.get(self.next)?.token {
            Token::Sign(sign) if signs.contains(&sign) => {
                self.next += 1;
                Some(sign)
            }
            _ => None,
        }
    }

    fn require(&mut self, sign: &'static str, why: &str) -> Result<(), ConditionError> {
        match self.take(&[sign]) {
            Some(_) => Ok(()),
            None => Err(self.error(self.column(), format!("expected `{sign}` {why}"))),
        }
    }

    /// Parses a part that must be of a `kind` for `sign`.
    fn part(&mut self, kind: Kind, sign: &str, level: Level) -> Result<(), ConditionError> {
        let column = self.column();
        let found = level(self)?;
        self.check(column, found, kind, sign)
    }

    fn check(
        &self,
        column: usize,
        found: Kind,
        kind: Kind,
        sign: &str,
    ) -> Result<(), ConditionError> {
        match (kind, found) {
            (Kind::Number, Kind::Truth) => {
                let what = format!("`{sign}` needs a number here, and this is a condition");
                Err(self.error(column, what))
            }
            (Kind::Truth, Kind::Number) => {
                let what =
                    format!("`{sign}` needs a condition here, and this is a number; compare it");
                Err(self.error(column, what))
            }
            _ => Ok(()),
        }
    }

    /// Parts of one `kind` with `signs` between them.
    fn chain(&mut self, kind: Kind, signs: &[(&'static str, Operation)], level: Level) -> Parsed {
        let column = self.column();
        let first = level(self)?;
        let names: Vec<&str> = signs.iter().map(|(sign, _)| *sign).collect();
        let mut result = first;
        while let Some(sign) = self.take(&names) {
            self.check(column, first, kind, sign)?;
            self.part(kind, sign, level)?;
            let operation = signs.iter().find(|(name, _)| *name == sign);
            self.operations.extend(operation.map(|(_, operation)| *operation));
            result = kind;
        }
        Ok(result)
    }

    fn any(&mut self) -> Parsed {
        self.chain(Kind::Truth, &[("||", Operation::Or)], |parser| {
            parser.chain(Kind::Truth, &[("&&", Operation::And)], Self::comparison)
        })
    }

    fn comparison(&mut self) -> Parsed {
        const SIGNS: [(&str, Comparison); 6] = [
            ("<", Comparison::Less),
            ("<=", Comparison::LessOrEqual),
            (">", Comparison::Greater),
            (">=", Comparison::GreaterOrEqual),
            ("==", Comparison::Equal),
            ("!=", Comparison::NotEqual),
        ];
        let names = SIGNS.map(|(name, _)| name);
        // Read the left side, which may be a number
        let column = self.column();
        let start = self.operations.len();
        let left = self.sum()?;
        // Only a plain value can be compared with text or a list
        let of = match self.operations[start..] {
            [Operation::Value(of)] => Some(of),
            _ => None,
        };
        if let Some(of) = of
            && matches!(self.token(0), Some(Token::Name(name)) if name == "in")
        {
            self.next += 1;
            return self.list(of);
        }
        let Some(sign) = self.take(&names) else {
            return Ok(left);
        };
        // Read the right side
        self.check(column, left, Kind::Number, sign)?;
        let is_equality = ["==", "!="].contains(&sign);
        match of.filter(|_| is_equality) {
            Some(of) if self.is_text() => self.text(of, None),
            _ => self.part(Kind::Number, sign, Self::sum)?,
        }
        // Append the comparison, and refuse a chain of them
        let found = SIGNS.iter().find(|(name, _)| *name == sign);
        self.operations.extend(found.map(|(_, comparison)| Operation::Compare(*comparison)));
        let column = self.column();
        match self.take(&names) {
            Some(_) => {
                Err(self.error(column, "comparisons have two sides; join two of them with &&"))
            }
            None => Ok(Kind::Truth),
        }
    }

    /// The token that is this many after the next.
    fn token(&self, after: usize) -> Option<&Token> {
        self.tokens.get(self.next + after).map(|placed| &placed.token)
    }

    /// Whether the next token is text, or a name that may be text: it is not part of a sum.
    fn is_text(&self) -> bool {
        let is_part =
            |token: &Token| matches!(token, Token::Sign("+" | "-" | "*" | "/" | "(" | "["));
        match self.token(0) {
            Some(Token::Text(_)) => true,
            Some(Token::Name(_)) => !self.token(1).is_some_and(is_part),
            _ => false,
        }
    }

    /// Takes the next token as text that the value `of` is compared with, perhaps in a list.
    fn text(&mut self, of: usize, list: Option<usize>) {
        let column = self.column();
        if let Some(Placed { token: token @ (Token::Text(text) | Token::Name(text)), .. }) =
            self.tokens.get(self.next)
        {
            let may_be_value = list.is_none() && matches!(token, Token::Name(_));
            self.texts.push(TextUse { of, text: text.clone(), column, may_be_value, list });
            self.operations.push(Operation::Text(self.texts.len() - 1));
            self.next += 1;
        }
    }

    /// The list of texts and numbers after `in`: the value `of` must equal one of them.
    fn list(&mut self, of: usize) -> Parsed {
        let start = self.column();
        self.require("(", "after `in`, as in `element in (C, N)`")?;
        for item in 0.. {
            if item > 0 {
                self.operations.push(Operation::Value(of));
            }
            match self.token(0) {
                Some(Token::Text(_) | Token::Name(_)) => self.text(of, Some(start)),
                _ => {
                    self.within(Self::unary)?;
                }
            }
            self.operations.push(Operation::Compare(Comparison::Equal));
            if item > 0 {
                self.operations.push(Operation::Or);
            }
            if self.take(&[","]).is_none() {
                break;
            }
        }
        self.require(")", "after the list")?;
        Ok(Kind::Truth)
    }

    fn sum(&mut self) -> Parsed {
        let signs = [
            ("+", Operation::Arithmetic(Arithmetic::Add)),
            ("-", Operation::Arithmetic(Arithmetic::Subtract)),
        ];
        self.chain(Kind::Number, &signs, Self::product)
    }

    fn product(&mut self) -> Parsed {
        let signs = [
            ("*", Operation::Arithmetic(Arithmetic::Multiply)),
            ("/", Operation::Arithmetic(Arithmetic::Divide)),
        ];
        self.chain(Kind::Number, &signs, Self::unary)
    }

    /// A part within another one, which must not be too deep.
    fn within(&mut self, level: Level) -> Parsed {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            let what = format!("more than {MAX_DEPTH} parentheses or signs within each other");
            return Err(self.error(self.column(), what));
        }
        let kind = level(self);
        self.depth -= 1;
        kind
    }

    fn unary(&mut self) -> Parsed {
        let Some(sign) = self.take(&["-", "+", "!"]) else {
            return self.primary();
        };
        let column = self.column();
        let found = self.within(Self::unary)?;
        let (kind, operation) = match sign {
            "!" => (Kind::Truth, Some(Operation::Not)),
            "-" => (Kind::Number, Some(Operation::Negate)),
            _ => (Kind::Number, None),
        };
        self.check(column, found, kind, sign)?;
        self.operations.extend(operation);
        Ok(kind)
    }

    fn primary(&mut self) -> Parsed {
        // Read a number, a name, or a condition in parentheses
        let column = self.column();
        let Some(placed) = self.tokens.get(self.next) else {
            return Err(
                self.error(column, "the condition ends here; a number or a name is missing")
            );
        };
        match placed.token.clone() {
            Token::Number(number) => {
                self.next += 1;
                self.operations.push(Operation::Number(number));
                Ok(Kind::Number)
            }
            Token::Name(name) => {
                self.next += 1;
                self.value(name, column)
            }
            Token::Sign("(") => {
                self.next += 1;
                let kind = self.within(Self::any)?;
                self.require(")", "after the part in parentheses")?;
                Ok(kind)
            }
            Token::Text(_) => {
                let what = "text is compared by == or != behind a name, as in `part == 'wall'`";
                Err(self.error(column, what))
            }
            token => Err(self.error(column, format!("expected a number or a name, found {token}"))),
        }
    }

    /// A value of particles or a function.
    fn value(&mut self, mut name: String, column: usize) -> Parsed {
        if self.take(&["("]).is_some() {
            return self.function(&name, column);
        }
        if let ("within", Some(Token::Number(distance))) = (name.as_str(), self.token(0)) {
            let distance = *distance;
            return self.neighbours(distance);
        }
        if name == "not" {
            return Err(self.error(column, "`not` is not a sign of conditions: write !"));
        }
        if self.take(&["["]).is_some() {
            match self.tokens.get(self.next).map(|placed| &placed.token) {
                Some(Token::Number(number)) => name = format!("{name}[{number}]"),
                _ => return Err(self.error(self.column(), "expected the number of a component")),
            }
            self.next += 1;
            self.require("]", "after the number of a component")?;
        }
        let known = self.names.iter().position(|used| used.name == name);
        let index = known.unwrap_or(self.names.len());
        if known.is_none() {
            self.names.push(NameUse { name, column });
        }
        self.operations.push(Operation::Value(index));
        Ok(Kind::Number)
    }

    /// The condition on others that a particle is within a distance of.
    fn neighbours(&mut self, distance: f64) -> Parsed {
        if distance <= 0.0 {
            return Err(self.error(self.column(), "`within` needs a distance above 0"));
        }
        self.next += 1;
        match self.token(0) {
            Some(Token::Name(name)) if name == "of" => self.next += 1,
            _ => {
                let what = "expected `of` and a condition, as in `within 5 of (type == 1)`";
                return Err(self.error(self.column(), what));
            }
        }
        self.require("(", "and a condition, as in `within 5 of (type == 1)`")?;
        let start = self.operations.len();
        let column = self.column();
        let found = self.within(Self::any)?;
        self.check(column, found, Kind::Truth, "within")?;
        self.require(")", "after the condition")?;
        let operations = self.operations.split_off(start);
        self.neighbours.push(NeighbourUse { distance, operations });
        self.operations.push(Operation::Near(self.neighbours.len() - 1));
        Ok(Kind::Truth)
    }

    /// The arguments of a function, and the parenthesis after them.
    fn function(&mut self, name: &str, column: usize) -> Parsed {
        // Read the arguments as numbers
        let argument = |parser: &mut Self| {
            let column = parser.column();
            let found = parser.within(Self::any)?;
            parser.check(column, found, Kind::Number, name)
        };
        // Find the function
        let pair = match name {
            "abs" | "sqrt" => None,
            "min" => Some(Arithmetic::Min),
            "max" => Some(Arithmetic::Max),
            _ => {
                let known = FUNCTIONS.join(", ");
                let what = format!("unknown function `{name}`; there are {known}");
                return Err(self.error(column, what));
            }
        };
        // Read its arguments, and append it
        argument(self)?;
        match pair {
            Some(function) => {
                self.require(",", &format!("between the two arguments of {name}"))?;
                argument(self)?;
                self.operations.push(Operation::Arithmetic(function));
            }
            None if name == "abs" => self.operations.push(Operation::Abs),
            None => self.operations.push(Operation::Sqrt),
        }
        self.require(")", &format!("after the arguments of {name}"))?;
        Ok(Kind::Number)
    }
}
