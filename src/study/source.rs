use super::common::text_of;
use crate::error::{Diagnostic, Error, Result};
use serde::de::DeserializeOwned;
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The text of a study with what the command line sets on top of it
///
/// Each `--set` is parsed as TOML of its own, preceded by as many spaces as there is text before it: all places then
/// count in one range, and a mistake is shown where the user made it.
#[derive(Debug, Clone)]
pub struct Source {
    pieces: Vec<Piece>,
    /// Where files lie that the study names.
    directory: PathBuf,
}

#[derive(Debug, Clone)]
struct Piece {
    origin: String,
    text: String,
    /// Where it begins in the common range.
    begins: usize,
    /// What the parser sees: `text`, completed and preceded by spaces.
    padded: String,
}

/// Tables in which `kind` names one of several structures, inner ones first.
const KINDED: [&str; 7] = [
    "pde",
    "density",
    "monitor",
    "mesh.generator.estimator",
    "mesh.generator",
    "compare.generator.estimator",
    "compare.generator",
];
/// Tables in which exactly one of several keys stands.
const CHOICES: [&str; 3] = ["monitor.strength", "output.frames", "output.checkpoint"];
/// Largest number of characters of a line that an error message shows.
const SHOWN: usize = 160;

impl Source {
    /// Reads a study file.
    ///
    /// # Errors
    /// [`Error::Unreadable`] where there is no such file or its text is not UTF-8.
    pub fn read(path: &Path) -> Result<Self> {
        let unreadable = |reason: String| Error::Unreadable { path: path.into(), reason };
        let open = || match path.is_dir() {
            true => Err("it is a directory, not a study file".into()),
            false => std::fs::File::open(path).map_err(|error| error.to_string()),
        };
        let text = text_of(open).map_err(unreadable)?;
        let mut source = Self::new(path.display().to_string(), text);
        // a study that is written again, in its run directory, must find the same files
        let whole = std::path::absolute(path).unwrap_or_else(|_| path.into());
        source.directory = whole.parent().map(Path::to_path_buf).unwrap_or_default();
        Ok(source)
    }

    /// Reads a study to its end; `origin` names in messages where it comes from, such as `standard input`.
    ///
    /// # Errors
    /// [`Error::Unreadable`] where nothing comes, or no UTF-8.
    pub fn from_reader(origin: &str, reader: impl Read) -> Result<Self> {
        let unreadable = |reason: String| Error::Unreadable { path: origin.into(), reason };
        let text = text_of(|| Ok(reader)).map_err(unreadable)?;
        if text.trim().is_empty() {
            return Err(unreadable("it is empty, where the text of a study must come".into()));
        }
        Ok(Self::new(origin, text))
    }

    /// A study from text; `origin` is its name in messages.
    pub fn new(origin: impl Into<String>, text: impl Into<String>) -> Self {
        let text = text.into();
        let directory = std::env::current_dir().unwrap_or_default();
        Self { pieces: vec![Piece { origin: origin.into(), padded: text.clone(), text, begins: 0 }], directory }
    }

    /// The directory in which files lie that the study names: that of its own file, or the current one.
    pub(super) fn directory(&self) -> &Path {
        &self.directory
    }

    /// Sets one key: `KEY=VALUE`, a dotted key and a TOML value, or a bare word for a string.
    ///
    /// # Errors
    /// [`Error::Study`] where it is not an assignment.
    pub fn set(&mut self, assignment: &str) -> Result<()> {
        let begins = self.pieces.iter().map(|p| p.padded.len()).max().unwrap_or(0) + 1;
        let completed = match assignment.split_once('=') {
            // the shell has eaten the quotes of a string
            Some((key, word)) if is_word(word) && DeValue::parse(word.trim()).is_err() => {
                format!("{key}=\"{}\"", word.trim())
            }
            _ => assignment.to_string(),
        };
        let padded = " ".repeat(begins) + &completed;
        let piece = Piece { origin: "--set".into(), text: assignment.into(), begins, padded };
        self.pieces.push(piece);
        let help = "write --set KEY=VALUE, such as --set time.step=5e-4";
        let failed =
            |message: &str| self.diagnostic(message, begins..begins + assignment.len().max(1), Some(help.into()));
        let only_assignment = !assignment.trim_start().starts_with(['[', '#']) && assignment.contains('=');
        match DeTable::parse(&self.pieces[self.pieces.len() - 1].padded) {
            Ok(table) if only_assignment && table.get_ref().len() == 1 => Ok(()),
            Ok(_) => Err(failed("this is not one assignment")),
            Err(error) => Err(failed(error.message())),
        }
    }

    /// The study as data.
    ///
    /// # Errors
    /// [`Error::Study`] at the place of the first mistake.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T> {
        let mut root = self.merged()?;
        let sections: Vec<String> = root.iter().map(|(name, _)| name.get_ref().to_string()).collect();
        for path in sections.iter().map(String::as_str).chain(KINDED).chain(CHOICES).chain(["mesh.coupling"]) {
            if let Some((_, value)) = entry(&mut root, path).filter(|(_, value)| !value.get_ref().is_table()) {
                let message = format!("`{path}` must be a table, but this is of type {}", value.get_ref().type_str());
                let form = match path {
                    "monitor.strength" => "{ relative = 30.0 }",
                    "output.frames" => "{ every = 50 }",
                    "output.checkpoint" => "{ seconds = 60 }",
                    "mesh.coupling" => "{ mesh_steps = 1, iterations = 1 }",
                    path if KINDED.contains(&path) => "{ kind = \"…\" }",
                    _ => return Err(self.diagnostic(&message, value.span(), Some(format!("begin it with [{path}]")))),
                };
                let name = path.rsplit('.').next().unwrap_or(path);
                return Err(self.diagnostic(&message, value.span(), Some(format!("write {name} = {form}"))));
            }
        }
        for path in KINDED {
            self.name_kind(&mut root, path)?;
        }
        let end = self.pieces[0].text.trim_end().len();
        let table = Spanned::new(0..end, root);
        T::deserialize(toml::Deserializer::from(table)).map_err(|error| self.explain(&error))
    }

    /// Turns a setting out of range into a diagnostic at the place where it is set.
    pub fn locate(&self, error: Error) -> Error {
        match &error {
            Error::Invalid { key, value, rule } => match self.place(key) {
                Some(span) => self.diagnostic(&format!("`{key}` is {value}, but {rule}"), span, None),
                None => error,
            },
            Error::Formula { key, text, at, message, help } => match self.place(key) {
                Some(span) => {
                    let span = self.inside(span, text, at);
                    self.diagnostic(&format!("`{key}`: {message}"), span, help.clone())
                }
                None => error,
            },
            _ => error,
        }
    }

    /// Where a key is set: the key itself, or the innermost table on the way to it that the study names.
    fn place(&self, key: &str) -> Option<Range<usize>> {
        let root = self.merged().ok()?;
        let mut place = None;
        let mut table = &root;
        for part in key.split('.') {
            // an entry of an array: name[2]
            let (part, entry) = match part.strip_suffix(']').and_then(|part| part.split_once('[')) {
                Some((part, number)) => (part, number.parse().ok()),
                None => (part, None::<usize>),
            };
            let Some((name, value)) = table.get_key_value(part) else { break };
            let value = value.get_ref().as_array().zip(entry).and_then(|(array, n)| array.get(n)).unwrap_or(value);
            place = Some(if value.get_ref().is_table() { name.span() } else { value.span() });
            match value.get_ref().as_table() {
                Some(inner) => table = inner,
                None => break,
            }
        }
        place
    }

    /// A part of a string, where the string stands in the study as it is, between one or three quotes.
    fn inside(&self, span: Range<usize>, text: &str, at: &Range<usize>) -> Range<usize> {
        let piece = self.pieces.iter().rev().find(|p| span.start >= p.begins).unwrap_or(&self.pieces[0]);
        let token = piece.padded.get(span.clone()).unwrap_or_default();
        // the bytes of the token that are text: a backslash at the end of a line takes the space after it along
        let mut places = Vec::with_capacity(token.len());
        let mut plain = Vec::with_capacity(token.len());
        let mut rest = token.char_indices().peekable();
        while let Some((place, c)) = rest.next() {
            if c == '\\' && token[place + 1..].starts_with(['\n', '\r']) {
                while rest.next_if(|(_, c)| c.is_whitespace()).is_some() {}
            } else {
                places.extend(place..place + c.len_utf8());
                plain.extend_from_slice(&token.as_bytes()[place..place + c.len_utf8()]);
            }
        }
        let place = |n: usize| span.start + places.get(n).copied().unwrap_or(token.len());
        match std::str::from_utf8(&plain).ok().and_then(|plain| plain.find(text)) {
            Some(offset) => place(offset + at.start)..place(offset + at.end.max(at.start + 1)),
            None => span, // written with escapes
        }
    }

    /// All pieces as one table, later ones on top.
    fn merged(&self) -> Result<DeTable<'_>> {
        let mut root = DeTable::new();
        for (n, piece) in self.pieces.iter().enumerate() {
            let table = DeTable::parse(&piece.padded).map_err(|error| self.explain(&error))?;
            if n == 0 {
                root = table.into_inner();
            } else {
                merge(&mut root, table.into_inner(), "", self.pieces[0].text.len());
            }
        }
        Ok(root)
    }

    /// Rewrites `{ kind = "name", … }` at a path to `{ name = { … } }`.
    fn name_kind(&self, root: &mut DeTable<'_>, path: &str) -> Result<()> {
        let Some((name, value)) = entry(root, path) else { return Ok(()) };
        let DeValue::Table(table) = value.get_mut() else { return Ok(()) };
        // what the mesh follows may be said of the default alone
        if path == "monitor" && table.keys().all(|key| key.get_ref() == "of") {
            table.insert(
                Spanned::new(name.clone(), "kind".into()),
                Spanned::new(name.clone(), DeValue::String("auto".into())),
            );
        }
        let Some((_, kind)) = table.remove_entry("kind") else {
            let help = format!("add kind = \"…\"; `driftmesh list` shows the kinds of {path}");
            return Err(self.diagnostic(&format!("`{path}` does not say its kind"), name, Some(help)));
        };
        let span = kind.span();
        let DeValue::String(kind) = kind.into_inner() else {
            let help = Some("write it as a string, such as kind = \"…\"".to_string());
            return Err(self.diagnostic(&format!("`{path}.kind` is not a string"), span, help));
        };
        let inner = std::mem::take(table);
        // what is missing in it is missing where its kind was set last
        let from_file = span.start <= self.pieces[0].text.len();
        let place = if from_file { name } else { span.clone() };
        table.insert(Spanned::new(span, kind), Spanned::new(place, DeValue::Table(inner)));
        Ok(())
    }

    /// A mistake that the TOML reader found, in this project's words.
    fn explain(&self, error: &toml::de::Error) -> Error {
        let message = error.message().trim();
        let span = error.span().unwrap_or(0..0);
        let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        let unknown = ["unknown field", "unknown variant"].iter().any(|m| message.starts_with(m));
        if let (true, [found, known @ ..]) = (unknown, quoted.as_slice()) {
            let what = if message.starts_with("unknown field") { "key" } else { "name" };
            let nearest = (known.iter().map(|k| (strsim::damerau_levenshtein(found, k), *k)))
                .filter(|(distance, k)| *distance <= 2.max(k.len() / 3))
                .min();
            let help = match nearest {
                Some((_, nearest)) => format!("did you mean `{nearest}`?"),
                None if known.is_empty() => "nothing can be set here".into(),
                None => format!("known here: {}", known.join(", ")),
            };
            return self.diagnostic(&format!("unknown {what} `{found}`"), span, Some(help));
        }
        if let (true, Some(missing)) = (message.starts_with("missing field"), quoted.first()) {
            let whole = span.start == 0 && span.end == self.pieces[0].text.trim_end().len();
            let message = match whole {
                true => format!("the study has no [{missing}] table"),
                false => format!("the key `{missing}` is missing here"),
            };
            let span = if whole { last_line(&self.pieces[0].text) } else { span };
            let help = match whole {
                true => format!("add [{missing}] with its keys; the studies of the same kind in studies/ have one"),
                false => format!("add {missing} = …"),
            };
            return self.diagnostic(&message, span, Some(help));
        }
        let message = if message.starts_with("wanted exactly 1 element") {
            "exactly one of its keys must be given here".to_string()
        } else {
            // Rust's words for what a user calls a number
            message
                .replace("expected f64", "expected a number")
                .replace("expected usize", "expected a whole number, 0 or more")
                .replace(" as i128", "")
                .replace("expected u64", "expected a whole number from 0 to 2^63 - 1")
                .replace("a sequence", "an array")
                .replace("a map", "a table")
                .replace("invalid type: map", "invalid type: table")
        };
        self.diagnostic(&message, span, None)
    }

    /// A message at a place in the common range.
    fn diagnostic(&self, message: &str, span: Range<usize>, help: Option<String>) -> Error {
        let piece = self.pieces.iter().rev().find(|p| span.start >= p.begins).unwrap_or(&self.pieces[0]);
        let clamp = |at: usize| {
            let mut at = at.saturating_sub(piece.begins).min(piece.text.len());
            while !piece.text.is_char_boundary(at) {
                at -= 1;
            }
            at
        };
        let (start, end) = (clamp(span.start), clamp(span.end));
        let line_start = piece.text[..start].rfind('\n').map_or(0, |n| n + 1);
        let line_end = piece.text[start..].find(['\n', '\r']).map_or(piece.text.len(), |n| start + n);
        let end = end.clamp(start, line_end);
        let column = piece.text[line_start..start].chars().count() + 1;
        // a very long line is shown around the place only
        let skipped = column.saturating_sub(SHOWN / 2).saturating_sub(1);
        let text: String = piece.text[line_start..line_end].chars().skip(skipped).take(SHOWN).map(printable).collect();
        let width = piece.text[start..end].chars().count();
        Error::Study(Box::new(Diagnostic {
            message: message.chars().map(printable).collect(),
            origin: piece.origin.clone(),
            line: piece.text[..start].matches('\n').count() + 1,
            column,
            caret: column - skipped,
            width: width.min((text.chars().count() + skipped + 1).saturating_sub(column)).max(1),
            text,
            help,
        }))
    }
}

/// A control character, a tab too, would move what is printed after it.
fn printable(c: char) -> char {
    match c {
        '\t' => ' ',
        c if c.is_control() => '\u{fffd}',
        c => c,
    }
}

/// Puts one table over another. A new `kind` drops what the file gave for the old one; a choice, and a table that is
/// given with its kind and more, is replaced whole.
fn merge<'a>(under: &mut DeTable<'a>, over: DeTable<'a>, path: &str, file: usize) {
    for (key, value) in over {
        let name = key.get_ref().to_string();
        let known = under.get(name.as_str());
        if name == "kind" && known.is_some_and(|k| k.get_ref().as_str() != value.get_ref().as_str()) {
            drop_before(under, file);
        }
        let inner = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        match (under.get_mut(name.as_str()).map(Spanned::get_mut), value.get_ref()) {
            (Some(DeValue::Table(below)), DeValue::Table(above))
                if !CHOICES.contains(&inner.as_str()) && (!above.contains_key("kind") || above.len() == 1) =>
            {
                if let DeValue::Table(above) = value.into_inner() {
                    merge(below, above, &inner, file);
                }
            }
            _ => {
                under.remove(name.as_str());
                under.insert(key, value);
            }
        }
    }
}

/// Removes the keys that stand before a place.
fn drop_before(table: &mut DeTable<'_>, place: usize) {
    let before = table.iter().filter(|(key, _)| key.span().start < place);
    let names: Vec<String> = before.map(|(key, _)| key.get_ref().to_string()).collect();
    for name in names {
        table.remove(name.as_str());
    }
}

/// The place of the name and the value at a dotted path.
fn entry<'t, 'a>(table: &'t mut DeTable<'a>, path: &str) -> Option<(Range<usize>, &'t mut Spanned<DeValue<'a>>)> {
    let (first, rest) = path.split_once('.').map_or((path, None), |(first, rest)| (first, Some(rest)));
    let name = table.get_key_value(first)?.0.span();
    let value = table.get_mut(first)?;
    match (rest, value) {
        (None, value) => Some((name, value)),
        (Some(rest), value) => match value.get_mut() {
            DeValue::Table(inner) => entry(inner, rest),
            _ => None,
        },
    }
}

fn is_word(text: &str) -> bool {
    let text = text.trim();
    !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || "-_./".contains(c))
}

fn last_line(text: &str) -> Range<usize> {
    let end = text.trim_end().len();
    text[..end].rfind('\n').map_or(0, |n| n + 1)..end
}
