//! Splits text into tokens.

use super::Mistake;
use super::graph::Comparison;
use std::ops::Range;

type Result<T, E = Mistake> = std::result::Result<T, E>;

pub(super) const COMPARISONS: [(&str, Comparison); 6] = [
    ("<=", Comparison::LessEqual),
    (">=", Comparison::GreaterEqual),
    ("==", Comparison::Equal),
    ("!=", Comparison::Unequal),
    ("<", Comparison::Less),
    (">", Comparison::Greater),
];

/// Texts of other languages in the place of a symbol, with what to write instead.
const FOREIGN: [(&str, &str); 17] = [
    ("**", "write ^ for powers"),
    ("%", "write mod(…, …) for the remainder"),
    ("&", "put one if(…) into another"),
    ("|", "write abs(…) for the absolute value"),
    ("=", "write == to compare"),
    ("!", "write != for unequal"),
    ("[", "write parentheses"),
    ("]", "write parentheses"),
    ("{", "write parentheses"),
    ("}", "write parentheses"),
    ("×", "write *"),
    ("·", "write *"),
    ("÷", "write /"),
    ("−", "write -"),
    ("²", "write ^2"),
    ("³", "write ^3"),
    ("π", "write pi"),
];

/// Names from other languages for which the nearest name here would mislead, with what to write instead.
pub(super) const ABSENT: [(&str, &str); 23] = [
    ("ln", "the natural logarithm is log(…)"),
    ("log10", "write log(…)/log(10)"),
    ("log2", "write log(…)/log(2)"),
    ("lg", "write log(…)/log(10)"),
    ("pow", "write ^ for powers"),
    ("cbrt", "write (…)^(1/3)"),
    ("erfc", "write 1 - erf(…)"),
    ("ceil", "write -floor(-(…))"),
    ("round", "write floor(… + 0.5)"),
    ("sign", "write if(x < 0, -1, 1)"),
    ("sgn", "write if(x < 0, -1, 1)"),
    ("heaviside", "write if(x < 0, 0, 1)"),
    ("arcsin", "write asin(…)"),
    ("arccos", "write acos(…)"),
    ("arctan", "write atan(…)"),
    ("arctan2", "write atan2(…, …)"),
    ("cot", "write 1/tan(…)"),
    ("sec", "write 1/cos(…)"),
    ("csc", "write 1/sin(…)"),
    ("sech", "write 1/cosh(…)"),
    ("coth", "write 1/tanh(…)"),
    ("and", "put one if(…) into another"),
    ("or", "put one if(…) into another"),
];

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Token {
    Number(f64),
    Name,
    Symbol(&'static str),
    End,
}

pub(super) fn is_start(c: char) -> bool {
    c.is_ascii_alphabetic() || c == '_'
}

pub(super) fn is_letter(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// A text shortened to what a message can hold, on one line.
pub(super) fn shortened(text: &str) -> String {
    let start: String = text.chars().take(40).flat_map(char::escape_debug).collect();
    if text.chars().nth(40).is_some() { format!("{start}…") } else { start }
}

/// The tokens with their places in the text, ended by `End`.
pub(super) fn tokens(text: &str) -> Result<Vec<(Token, Range<usize>)>> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        let rest = &text[at..];
        let (token, length) = if c.is_ascii_whitespace() {
            at += 1;
            continue;
        } else if is_start(c) {
            (Token::Name, rest.find(|c| !is_letter(c)).unwrap_or(rest.len()))
        } else if c.is_ascii_digit() || c == '.' {
            number(rest, at)?
        } else {
            symbol(rest, at, c)?
        };
        tokens.push((token, at..at + length));
        at += length;
    }
    tokens.push((Token::End, at..at));
    Ok(tokens)
}

fn number(rest: &str, at: usize) -> Result<(Token, usize)> {
    let digits =
        |from: usize| rest[from..].find(|c| !matches!(c, '0'..='9' | '.' | '_')).map_or(rest.len(), |n| from + n);
    let mut end = digits(0);
    // `2exp(x)` and `2e` contain no exponent: there `e` begins a name
    let exponent = rest[end..].strip_prefix(['e', 'E']).map(|after| after.strip_prefix(['+', '-']).unwrap_or(after));
    if let Some(after) = exponent.filter(|after| after.starts_with(|c: char| c.is_ascii_digit())) {
        end = digits(rest.len() - after.len());
    }
    let found = shortened(&rest[..end]);
    match rest[..end].parse::<f64>() {
        Ok(value) if value.is_finite() => Ok((Token::Number(value), end)),
        Ok(_) => Err(Mistake::new(at..at + end, format!("the number {found} is too large"))
            .help("the largest number is 1.797e308")),
        Err(_) => Err(Mistake::new(at..at + end, format!("`{found}` is not a number"))
            .help("write digits with at most one point, such as 1.5 or 2e-3")),
    }
}

fn symbol(rest: &str, at: usize, c: char) -> Result<(Token, usize)> {
    let foreign = FOREIGN.iter().find(|(sign, _)| rest.starts_with(sign));
    let ours = (COMPARISONS.iter().map(|(sign, _)| *sign).chain(["+", "-", "*", "/", "^", "(", ")", ","]))
        .find(|sign| rest.starts_with(sign));
    match (ours, foreign) {
        (Some(sign), None) => Ok((Token::Symbol(sign), sign.len())),
        // == and != begin like signs that mean nothing alone
        (Some(sign), Some((other, _))) if sign.len() > other.len() => Ok((Token::Symbol(sign), sign.len())),
        (_, Some((sign, help))) => {
            Err(Mistake::new(at..at + sign.len(), format!("`{sign}` has no meaning in a formula")).help(*help))
        }
        (None, None) => {
            Err(Mistake::new(at..at + c.len_utf8(), format!("`{}` has no meaning in a formula", c.escape_debug())))
        }
    }
}
