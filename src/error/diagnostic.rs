//! Mistakes in a text.

/// A mistake at a place in a text, shown as the line with a caret under it.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnostic {
    /// What is wrong.
    pub message: String,
    /// Name of the text: a file, or `--set`.
    pub origin: String,
    /// The line, without its end; of a very long line the part around the place.
    pub text: String,
    /// Line number from 1.
    pub line: usize,
    /// Column of the first marked character, from 1, in characters.
    pub column: usize,
    /// Where that character stands in `text`, from 1.
    pub caret: usize,
    /// Number of marked characters, at least 1.
    pub width: usize,
    /// The remedy.
    pub help: Option<String>,
}

impl std::fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let number = self.line.to_string();
        let gutter = " ".repeat(number.len());
        writeln!(f, "{}", self.message)?;
        writeln!(f, "{gutter}--> {}:{}:{}", self.origin, self.line, self.column)?;
        writeln!(f, "{gutter} |")?;
        writeln!(f, "{number} | {}", self.text)?;
        write!(f, "{gutter} | {}{}", " ".repeat(self.caret - 1), "^".repeat(self.width))
    }
}
