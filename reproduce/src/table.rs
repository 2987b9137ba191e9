use std::fmt;

/// A table of results with what must be said about it.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// What it shows.
    pub title: String,
    /// Heads of the columns.
    pub columns: Vec<String>,
    /// One string a column.
    pub rows: Vec<Vec<String>>,
    /// How its verdicts are reached; empty where it has none.
    pub rule: String,
    /// Said below it.
    pub notes: Vec<String>,
}

impl Table {
    /// A table without rows.
    pub fn new(title: impl Into<String>, columns: &[&str]) -> Self {
        let columns = columns.iter().map(|c| c.to_string()).collect();
        Self { title: title.into(), columns, ..Self::default() }
    }

    /// With the rule of its verdicts.
    pub fn ruled(mut self, rule: impl Into<String>) -> Self {
        self.rule = rule.into();
        self
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// Says something below the table.
    pub fn note(&mut self, note: impl Into<String>) {
        self.notes.push(note.into());
    }
}

/// As a table in Markdown whose columns are aligned: it reads the same in a terminal and on a page.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = |text: &String| text.chars().count();
        let width = |c: usize| self.rows.iter().filter_map(|row| row.get(c)).chain([&self.columns[c]]).map(count).max();
        let widths: Vec<usize> = (0..self.columns.len()).map(|c| width(c).unwrap_or(0)).collect();
        let line = |f: &mut fmt::Formatter<'_>, cells: &[String]| -> fmt::Result {
            for (c, (cell, &width)) in cells.iter().zip(&widths).enumerate() {
                match c {
                    0 => write!(f, "| {cell:<width$} ")?,
                    _ => write!(f, "| {cell:>width$} ")?,
                }
            }
            writeln!(f, "|")
        };
        writeln!(f, "### {}\n", self.title)?;
        line(f, &self.columns)?;
        let rules =
            widths.iter().enumerate().map(|(c, &w)| if c == 0 { "-".repeat(w) } else { "-".repeat(w - 1) + ":" });
        line(f, &rules.collect::<Vec<_>>())?;
        self.rows.iter().try_for_each(|row| line(f, row))?;
        if !self.rule.is_empty() || !self.notes.is_empty() {
            writeln!(f)?;
        }
        if !self.rule.is_empty() {
            writeln!(f, "- verdict: {}", self.rule)?;
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "- {note}"))
    }
}
