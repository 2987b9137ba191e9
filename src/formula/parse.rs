//! Parses text into the graph of a formula by recursive descent, without a syntax tree in between.

use super::graph::{Binary, Comparison, Graph, Id, Node, Unary};
use super::table::{Table, all_named, named};
use super::tokens::{ABSENT, COMPARISONS, Token, is_letter, is_start, shortened, tokens};
use super::{MAX_DEPTH, MAX_LENGTH, Mistake};
use std::ops::Range;
use std::sync::Arc;

type Result<T, E = Mistake> = std::result::Result<T, E>;

const CONSTANTS: [(&str, f64); 2] = [("pi", std::f64::consts::PI), ("e", std::f64::consts::E)];

#[derive(Clone, Copy)]
enum Function {
    Unary(Unary),
    Binary(Binary),
    If,
}

const FUNCTIONS: [(&str, Function); 20] = [
    ("sin", Function::Unary(Unary::Sin)),
    ("cos", Function::Unary(Unary::Cos)),
    ("tan", Function::Unary(Unary::Tan)),
    ("asin", Function::Unary(Unary::Asin)),
    ("acos", Function::Unary(Unary::Acos)),
    ("atan", Function::Unary(Unary::Atan)),
    ("atan2", Function::Binary(Binary::Atan2)),
    ("sinh", Function::Unary(Unary::Sinh)),
    ("cosh", Function::Unary(Unary::Cosh)),
    ("tanh", Function::Unary(Unary::Tanh)),
    ("exp", Function::Unary(Unary::Exp)),
    ("log", Function::Unary(Unary::Log)),
    ("sqrt", Function::Unary(Unary::Sqrt)),
    ("abs", Function::Unary(Unary::Abs)),
    ("erf", Function::Unary(Unary::Erf)),
    ("floor", Function::Unary(Unary::Floor)),
    ("min", Function::Binary(Binary::Min)),
    ("max", Function::Binary(Binary::Max)),
    ("mod", Function::Binary(Binary::Modulo)),
    ("if", Function::If),
];

/// Parses a formula into a graph, and returns the node of its value as well.
pub(super) fn parse(text: &str, variables: &[&str]) -> Result<(Graph, Id)> {
    check_variables(variables)?;
    if text.len() > MAX_LENGTH {
        let message = format!("the formula has {} bytes, {MAX_LENGTH} are allowed", text.len());
        return Err(Mistake::new(0..text.len(), message));
    }
    let tokens = tokens(text)?;
    if tokens.len() == 1 {
        return Err(Mistake::new(0..text.len(), "the formula is empty").help("write a number, such as 0"));
    }
    let mut parser = Parser { text, variables, tokens, next: 0, depth: 0, graph: Graph::default() };
    let whole = parser.comparison()?;
    let root = parser.number(&whole)?;
    match parser.token() {
        Token::Symbol(")") => Err(Mistake::new(parser.span(), "this parenthesis was never opened")),
        Token::Symbol(",") => Err(parser.comma()),
        _ => Ok((parser.graph, root)),
    }
}

fn check_variables(variables: &[&str]) -> Result<()> {
    for (k, name) in variables.iter().enumerate() {
        let is_name = name.starts_with(is_start) && name.chars().all(is_letter);
        let rule = match () {
            () if !is_name => "is not a name of ASCII letters, digits and _",
            () if CONSTANTS.iter().any(|(known, _)| known == name) => "has the name of a constant",
            () if FUNCTIONS.iter().any(|(known, _)| known == name) => "has the name of a function",
            () if named(name).is_some() => "has the name of a table of [data]",
            () if variables[..k].contains(name) => "is given twice",
            () => continue,
        };
        return Err(Mistake::new(0..0, format!("the variable `{}` {rule}", shortened(name))));
    }
    Ok(())
}

/// Refuses a name that is none, or that of a function, a constant or a coordinate in every formula.
pub(super) fn check_table_name(name: &str) -> Result<(), String> {
    match check_variables(&[name]) {
        Err(mistake) => Err(mistake.message.replace("the variable", "the table")),
        Ok(()) if ["x", "y", "t", "s", "r"].contains(&name) => {
            Err(format!("the table `{name}` has the name of a variable of formulas"))
        }
        Ok(()) => Ok(()),
    }
}

#[derive(Clone, Copy)]
enum Value {
    Number(Id),
    Truth(Comparison, Id, Id),
}

/// A part of the formula, and its place in the text.
struct Part {
    value: Value,
    span: Range<usize>,
}

struct Parser<'a> {
    text: &'a str,
    variables: &'a [&'a str],
    tokens: Vec<(Token, Range<usize>)>,
    next: usize,
    depth: usize,
    graph: Graph,
}

impl Parser<'_> {
    fn token(&self) -> Token {
        self.tokens[self.next].0
    }

    fn span(&self) -> Range<usize> {
        self.tokens[self.next].1.clone()
    }

    /// Moves past a token, but not past the end, and returns its place.
    fn skip(&mut self) -> Range<usize> {
        let span = self.span();
        self.next = (self.next + 1).min(self.tokens.len() - 1);
        span
    }

    /// The token before the next one.
    fn before(&self) -> Option<(Token, Range<usize>)> {
        self.next.checked_sub(1).map(|k| self.tokens[k].clone())
    }

    fn operator<T: Copy>(&self, operators: &[(&str, T)]) -> Option<T> {
        let Token::Symbol(sign) = self.token() else { return None };
        operators.iter().find(|(known, _)| *known == sign).map(|(_, operator)| *operator)
    }

    fn part(&mut self, span: Range<usize>, node: Node) -> Part {
        Part { value: Value::Number(self.graph.push(node)), span }
    }

    /// The node of a part, which must be a number and not a comparison.
    fn number(&self, part: &Part) -> Result<Id> {
        match part.value {
            Value::Number(id) => Ok(id),
            Value::Truth(..) => {
                Err(Mistake::new(part.span.clone(), "a comparison stands only in the first place of if(…)")
                    .help("write if(x < 1, a, b)"))
            }
        }
    }

    fn comparison(&mut self) -> Result<Part> {
        let left = self.sum()?;
        let Some(comparison) = self.operator(&COMPARISONS) else { return Ok(left) };
        let a = self.number(&left)?;
        self.skip();
        let right = self.sum()?;
        let b = self.number(&right)?;
        if self.operator(&COMPARISONS).is_some() {
            return Err(Mistake::new(left.span.start..self.span().end, "comparisons cannot be chained")
                .help("put one if(…) into another"));
        }
        Ok(Part { value: Value::Truth(comparison, a, b), span: left.span.start..right.span.end })
    }

    fn sum(&mut self) -> Result<Part> {
        self.row(&[("+", Binary::Add), ("-", Binary::Subtract)], Self::product)
    }

    fn product(&mut self) -> Result<Part> {
        self.row(&[("*", Binary::Multiply), ("/", Binary::Divide)], Self::signed)
    }

    /// Operations of equal precedence, from left to right.
    fn row(&mut self, operators: &[(&str, Binary)], operand: fn(&mut Self) -> Result<Part>) -> Result<Part> {
        let mut left = operand(self)?;
        while let Some(operator) = self.operator(operators) {
            let a = self.number(&left)?;
            self.skip();
            let right = operand(self)?;
            let b = self.number(&right)?;
            left = self.part(left.span.start..right.span.end, Node::Binary(operator, a, b));
        }
        Ok(left)
    }

    /// A power with signs before it. All nesting goes through this function, which limits the depth.
    fn signed(&mut self) -> Result<Part> {
        if self.depth == MAX_DEPTH {
            let message = format!("the formula is nested deeper than {MAX_DEPTH} levels");
            return Err(Mistake::new(self.span(), message));
        }
        self.depth += 1;
        let part = match self.token() {
            Token::Symbol(sign @ ("+" | "-")) => {
                let at = self.skip();
                let inner = self.signed()?;
                let a = self.number(&inner)?;
                let span = at.start..inner.span.end;
                if sign == "-" { self.part(span, Node::Unary(Unary::Negate, a)) } else { Part { span, ..inner } }
            }
            _ => self.power()?,
        };
        self.depth -= 1;
        Ok(part)
    }

    fn power(&mut self) -> Result<Part> {
        let base = self.operand()?;
        if self.token() != Token::Symbol("^") {
            return Ok(base);
        }
        let a = self.number(&base)?;
        self.skip();
        let exponent = self.signed()?;
        let b = self.number(&exponent)?;
        Ok(self.part(base.span.start..exponent.span.end, Node::Binary(Binary::Power, a, b)))
    }

    fn operand(&mut self) -> Result<Part> {
        let part = match self.token() {
            Token::Number(value) => {
                let span = self.skip();
                self.part(span, Node::Constant(value.to_bits()))
            }
            Token::Name => self.name()?,
            Token::Symbol("(") => {
                let open = self.skip();
                if self.token() == Token::Symbol(")") {
                    return Err(Mistake::new(open.start..self.span().end, "nothing stands between the parentheses"));
                }
                let inner = self.comparison()?;
                if self.token() == Token::Symbol(",") {
                    return Err(self.comma());
                }
                let close = self.close(&open)?;
                Part { span: open.start..close.end, ..inner }
            }
            _ => return Err(self.missing()),
        };
        match self.token() {
            Token::Number(_) | Token::Name | Token::Symbol("(") => Err(self.juxtaposed()),
            _ => Ok(part),
        }
    }

    fn name(&mut self) -> Result<Part> {
        let span = self.skip();
        let name = &self.text[span.clone()];
        if let Some(k) = self.variables.iter().position(|known| *known == name) {
            return Ok(self.part(span, Node::Variable(k as u32)));
        }
        if let Some((_, value)) = CONSTANTS.iter().find(|(known, _)| *known == name) {
            return Ok(self.part(span, Node::Constant(value.to_bits())));
        }
        let function = FUNCTIONS.iter().find(|(known, _)| *known == name).map(|(_, function)| *function);
        let opens = self.token() == Token::Symbol("(");
        match (function, named(name)) {
            (Some(function), _) if opens => self.call(function, span),
            (None, Some(table)) if opens => self.look_up(&table, span),
            (None, None) => Err(self.unknown(name, span)),
            _ => {
                let argument = match self.token() {
                    Token::Number(_) | Token::Name => shortened(&self.text[self.span()]),
                    _ => "…".into(),
                };
                Err(Mistake::new(span, format!("the function `{name}` has no parentheses"))
                    .help(format!("write {name}({argument})")))
            }
        }
    }

    /// What stands between the parentheses of a function, and the place of all of it.
    fn arguments(&mut self, name: &Range<usize>) -> Result<(Vec<Part>, Range<usize>)> {
        let open = self.skip();
        let mut arguments = Vec::new();
        if self.token() != Token::Symbol(")") {
            arguments.push(self.comparison()?);
            while self.token() == Token::Symbol(",") {
                self.skip();
                arguments.push(self.comparison()?);
            }
        }
        let close = self.close(&open)?;
        Ok((arguments, name.start..close.end))
    }

    /// A table of `[data]` at a place.
    fn look_up(&mut self, table: &Arc<Table>, name: Range<usize>) -> Result<Part> {
        let (arguments, span) = self.arguments(&name)?;
        let at = match (arguments.as_slice(), table.axes()) {
            ([a], 1) => [self.number(a)?; 2],
            ([a, b], 2) => [self.number(a)?, self.number(b)?],
            (_, axes) => {
                let wanted = ["1 argument", "2 arguments"][axes - 1];
                let message = format!("the table `{}` takes {wanted}, not {}", &self.text[name], arguments.len());
                return Err(Mistake::new(span, message));
            }
        };
        self.graph.know(table);
        Ok(self.part(span, Node::Table(table.number(), at, [0; 2])))
    }

    fn call(&mut self, function: Function, name: Range<usize>) -> Result<Part> {
        let (arguments, span) = self.arguments(&name)?;
        let node = match (function, arguments.as_slice()) {
            (Function::Unary(f), [a]) => Node::Unary(f, self.number(a)?),
            (Function::Binary(f), [a, b]) => Node::Binary(f, self.number(a)?, self.number(b)?),
            (Function::If, [condition, a, b]) => {
                let Value::Truth(comparison, left, right) = condition.value else {
                    return Err(Mistake::new(condition.span.clone(), "`if` asks for a comparison in its first place")
                        .help("write if(x < 1, a, b)"));
                };
                Node::Choice(comparison, [left, right, self.number(a)?, self.number(b)?])
            }
            _ => {
                let wanted = match function {
                    Function::Unary(_) => "1 argument",
                    Function::Binary(_) => "2 arguments",
                    Function::If => "3 arguments",
                };
                let message = format!("`{}` takes {wanted}, not {}", &self.text[name], arguments.len());
                return Err(Mistake::new(span, message));
            }
        };
        Ok(self.part(span, node))
    }

    fn close(&mut self, open: &Range<usize>) -> Result<Range<usize>> {
        match self.token() {
            Token::Symbol(")") => Ok(self.skip()),
            _ => Err(Mistake::new(open.clone(), "this parenthesis is never closed")),
        }
    }

    /// The mistake of a comma outside a function call.
    fn comma(&self) -> Mistake {
        Mistake::new(self.span(), "a comma stands only between the arguments of a function")
            .help("write a point in numbers, such as 1.5")
    }

    /// The mistake of an operator, comma or parenthesis in the place of an operand.
    fn missing(&self) -> Mistake {
        let sign = |span: Range<usize>| &self.text[span];
        match (self.before(), self.token()) {
            (Some((Token::Symbol("("), open)), Token::End) => Mistake::new(open, "this parenthesis is never closed"),
            (Some((Token::Symbol("("), _)) | None, _) => {
                Mistake::new(self.span(), format!("something is missing before `{}`", sign(self.span())))
            }
            (Some((_, before)), _) => {
                Mistake::new(before.clone(), format!("something is missing after `{}`", sign(before)))
            }
        }
    }

    /// The mistake of two operands without an operator between them.
    fn juxtaposed(&self) -> Mistake {
        let (token, before) = self.before().unwrap_or((Token::End, 0..0));
        let (left, right) = (shortened(&self.text[before.clone()]), shortened(&self.text[self.span()]));
        let help = match (token, self.token()) {
            (Token::Symbol(_), Token::Symbol(_)) => "write )*(".into(),
            (Token::Symbol(_), _) => format!("write (…)*{right}"),
            (_, Token::Symbol(_)) => format!("write {left}*(…)"),
            _ => format!("write {left}*{right}"),
        };
        Mistake::new(before.start..self.span().end, "an operator is missing here").help(help)
    }

    fn unknown(&self, name: &str, span: Range<usize>) -> Mistake {
        let tables = all_named();
        let known: Vec<&str> = (self.variables.iter().copied())
            .chain(CONSTANTS.iter().map(|(name, _)| *name))
            .chain(FUNCTIONS.iter().map(|(name, _)| *name))
            .chain(tables.iter().map(|table| table.name()))
            .collect();
        let lower = name.to_ascii_lowercase();
        // short names are all similar, so a suggestion may differ in every other letter at most
        let distance = |k: &str| strsim::damerau_levenshtein(&lower, &k.to_ascii_lowercase());
        let nearest = (known.iter().map(|k| (distance(k), (!lower.starts_with(k), k.len().abs_diff(name.len())), *k)))
            .filter(|(distance, _, k)| *distance <= (k.len().min(name.len()) / 2).min(2))
            .min();
        let inverse = ["a", "arc", "ar"].iter().filter_map(|prefix| lower.strip_prefix(prefix));
        let inverse = inverse
            .map(|rest| rest.trim_end_matches('2'))
            .any(|rest| ["sin", "cos", "tan", "sinh", "cosh", "tanh"].contains(&rest));
        let help = match (ABSENT.iter().find(|(absent, _)| *absent == lower), nearest) {
            (Some((_, help)), _) => help.to_string(),
            (None, Some((_, _, nearest))) if !inverse => format!("did you mean `{nearest}`?"),
            _ => format!("known here: {}", known.join(", ")),
        };
        Mistake::new(span, format!("unknown name `{}`", shortened(name))).help(help)
    }
}
