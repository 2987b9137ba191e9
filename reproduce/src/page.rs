//! One page of everything that was rerun, with all it needs inside.

use super::{Document, Item, Rerun};
use base64::{Engine, engine::general_purpose::STANDARD};
use minijinja::Environment;
use serde::Serialize;

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("../../assets/report/style.css");

/// An item that was rerun.
pub struct Done {
    /// What.
    pub item: &'static Item,
    /// What it came out as, or what ended it.
    pub outcome: Result<Rerun, String>,
    /// By the clock.
    pub seconds: f64,
}

#[derive(Serialize)]
struct Page {
    version: &'static str,
    quick: bool,
    threads: usize,
    seconds: String,
    style: &'static str,
    documents: Vec<Chapter>,
}

/// A document.
#[derive(Serialize)]
struct Chapter {
    title: &'static str,
    sections: Vec<Section>,
}

/// An item.
#[derive(Serialize)]
struct Section {
    name: &'static str,
    line: &'static str,
    seconds: String,
    failure: Option<String>,
    tables: Vec<Shown>,
    pictures: Vec<Picture>,
}

#[derive(Serialize)]
struct Shown {
    title: String,
    head: Vec<Head>,
    rows: Vec<Vec<Cell>>,
    rule: String,
    notes: Vec<String>,
}

#[derive(Serialize)]
struct Head {
    name: String,
    /// Whether its cells are read as text, all of them alike.
    is_text: bool,
}

#[derive(Serialize)]
struct Cell {
    text: String,
    /// How a verdict is coloured.
    tone: &'static str,
}

#[derive(Serialize)]
struct Picture {
    /// A sentence in its place.
    alt: String,
    source: String,
}

/// What a verdict says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tone {
    Good,
    Bad,
    /// Neither, or none.
    Neither,
}

/// Verdicts by how they begin; all others are against what is published.
const GOOD: [&str; 9] =
    ["agrees", "holds", "nearer to 1", "as good", "independent of I", "sound", "second order", "confirmed", "wins"];
const NEITHER: [&str; 4] = ["no difference", "neither", "erratum", "–"];

impl Tone {
    /// Of a verdict; of several, parted by a slash, the worst.
    fn of(verdict: &str) -> Self {
        let begins = |part: &str, with: &[&str]| with.iter().any(|word| part.starts_with(word));
        let parts = || verdict.split(" / ").map(str::trim);
        match verdict.trim() {
            "" => Self::Neither,
            _ if parts().any(|part| !begins(part, &GOOD) && !begins(part, &NEITHER)) => Self::Bad,
            _ if parts().any(|part| begins(part, &GOOD)) => Self::Good,
            _ => Self::Neither,
        }
    }

    fn class(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Bad => "bad",
            Self::Neither => "",
        }
    }
}

/// The page.
pub fn page(done: &[Done], quick: bool) -> String {
    let chapter = |document: Document| {
        let of: Vec<&Done> = done.iter().filter(|done| done.item.of == document).collect();
        Chapter { title: document.title(), sections: of.into_iter().map(section).collect() }
    };
    let page = Page {
        version: env!("CARGO_PKG_VERSION"),
        quick,
        threads: rayon::current_num_threads(),
        seconds: format!("{:.0}", done.iter().map(|done| done.seconds).sum::<f64>()),
        style: STYLE,
        documents: Document::ALL.into_iter().map(chapter).filter(|chapter| !chapter.sections.is_empty()).collect(),
    };
    let environment = Environment::new();
    environment
        .render_named_str("papers.html", TEMPLATE, minijinja::value::Serde(&page))
        .expect("the template fits the page")
}

fn section(done: &Done) -> Section {
    let (tables, pictures, failure) = match &done.outcome {
        Ok(rerun) => (rerun.tables.iter().map(shown).collect(), rerun.pictures.iter().map(picture).collect(), None),
        Err(why) => (Vec::new(), Vec::new(), Some(why.clone())),
    };
    Section {
        name: done.item.name,
        line: done.item.line,
        seconds: format!("{:.1}", done.seconds),
        failure,
        tables,
        pictures,
    }
}

/// A cell of a table with more letters than this is set as text, not as a number.
const NUMBER: usize = 24;

fn shown(table: &super::Table) -> Shown {
    let judged: Vec<bool> = table.columns.iter().map(|head| head.starts_with("verdict")).collect();
    let cell = |(c, text): (usize, &String)| {
        let tone = if judged[c] { Tone::of(text).class() } else { "" };
        Cell { text: unbroken(text), tone }
    };
    let head = |(c, name): (usize, &String)| {
        let is_text = table.rows.iter().any(|row| row[c].chars().count() > NUMBER);
        Head { name: unbroken(name), is_text }
    };
    Shown {
        title: unbroken(&table.title),
        head: table.columns.iter().enumerate().map(head).collect(),
        rows: table.rows.iter().map(|row| row.iter().enumerate().map(cell).collect()).collect(),
        rule: unbroken(&table.rule),
        notes: table.notes.iter().map(|note| unbroken(note)).collect(),
    }
}

/// A number stays on a line with its per cent sign.
fn unbroken(text: &str) -> String {
    text.replace(" %", "\u{a0}%")
}

/// The smaller of drawing and image.
fn picture((name, picture): &(String, driftmesh::output::Picture)) -> Picture {
    let (mime, bytes) = match picture.svg.len() < picture.png.len() {
        true => ("image/svg+xml", picture.svg.as_bytes()),
        false => ("image/png", picture.png.as_slice()),
    };
    let alt = title(&picture.svg).unwrap_or_else(|| name.clone());
    Picture { alt: format!("{alt}."), source: format!("data:{mime};base64,{}", STANDARD.encode(bytes)) }
}

/// What a drawing writes first, which is its title.
fn title(svg: &str) -> Option<String> {
    let (_, text) = svg.split_once("<text")?.1.split_once('>')?;
    let (text, _) = text.split_once('<')?;
    let plain = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&apos;", "'"), ("&#39;", "'"), ("&amp;", "&")];
    let text = plain.iter().fold(text.trim().to_string(), |text, (from, to)| text.replace(from, to));
    (!text.is_empty()).then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ITEMS, Table};
    use driftmesh::output::Figure;

    #[test]
    fn verdicts_are_coloured_by_the_worst_part() {
        assert_eq!(Tone::of("agrees / nearer to 1 by 0.010"), Tone::Good);
        assert_eq!(Tone::of("agrees / farther from 1 by 0.020"), Tone::Bad);
        assert_eq!(Tone::of("does not hold"), Tone::Bad);
        assert_eq!(Tone::of("mesh-folded in step 1"), Tone::Bad);
        assert_eq!(Tone::of("no difference"), Tone::Neither);
        assert_eq!(Tone::of(""), Tone::Neither);
    }

    /// Text is escaped, nothing is fetched, and an item that failed says so and takes nothing else with it.
    #[test]
    fn the_page_stands_alone() {
        let mut table = Table::new("a < b", &["run", "verdict"]).ruled("by eye");
        table.row(["<b>", "agrees"]);
        let figure = Figure { title: "a & b, drawn".into(), ..Figure::default() };
        let pictures = vec![("a-b".to_string(), figure.draw())];
        let rerun = Rerun { tables: vec![table], pictures };
        let done = [
            Done { item: &ITEMS[0], outcome: Ok(rerun), seconds: 1.0 },
            Done { item: &ITEMS[1], outcome: Err("it folded".into()), seconds: 2.0 },
        ];
        let html = page(&done, true);
        assert!(html.contains("a &lt; b") && html.contains("&lt;b&gt;") && html.contains("it folded"));
        assert!(html.contains("class=\"good\"") && html.contains("by eye"));
        assert!(html.contains("alt=\"a &amp; b, drawn.\""));
        for fetches in ["http://", "https://", "<script", "<link rel=\"style", "src=\"/", "@import"] {
            assert!(!html.contains(fetches), "{fetches}");
        }
    }
}
