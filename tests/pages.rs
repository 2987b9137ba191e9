//! What the pages say of study files is so: their examples are valid, and no key is missing.

use driftmesh::study::{Source, Study};
use serde_json::{Map, Value};
use std::collections::BTreeSet;

const README: &str = include_str!("../README.md");
const STUDY: &str = include_str!("../docs/study.md");
const EQUATION: &str = include_str!("../docs/own-equation.md");
const SUBDOMAINS: &str = include_str!("../docs/subdomains.md");
const LINE: &str = include_str!("../docs/one-dimension.md");
const LAPLACIAN: &str = include_str!("../docs/laplacian.md");
const FRONTS: &str = include_str!("../docs/fronts.md");
const RESUME: &str = include_str!("../docs/resume.md");
const DOMAINS: &str = include_str!("../docs/domains.md");
const SAFETY: &str = include_str!("../docs/safety.md");

#[test]
fn studies_on_the_pages_are_valid() {
    let mut kinds = BTreeSet::new();
    let pages = [
        ("README", README),
        ("study", STUDY),
        ("one-dimension", LINE),
        ("own-equation", EQUATION),
        ("laplacian", LAPLACIAN),
        ("fronts", FRONTS),
        ("domains", DOMAINS),
    ];
    for (page, text) in pages {
        let blocks = text.split("```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap_or_default());
        for block in blocks.filter(|block| block.starts_with("[study]")) {
            let study = Study::from_source(&Source::new(page, block)).unwrap_or_else(|error| panic!("{page}: {error}"));
            kinds.insert(study.to_toml().parse::<toml::Table>().unwrap()["study"]["kind"].to_string());
        }
    }
    assert_eq!(kinds.len(), 4, "{kinds:?}");
}

/// Names of the keys of a table and of all tables within.
fn keys(schema: &Value, definitions: &Map<String, Value>, out: &mut BTreeSet<String>) {
    match schema {
        Value::Object(map) => {
            if let Some(Value::String(reference)) = map.get("$ref") {
                keys(&definitions[reference.rsplit('/').next().unwrap()], definitions, out);
            }
            if let Some(Value::Object(properties)) = map.get("properties") {
                out.extend(properties.keys().cloned());
                properties.values().for_each(|value| keys(value, definitions, out));
            }
            let within = map.iter().filter(|(key, _)| *key != "properties");
            within.for_each(|(_, value)| keys(value, definitions, out));
        }
        Value::Array(values) => values.iter().for_each(|value| keys(value, definitions, out)),
        _ => {}
    }
}

#[test]
fn pages_name_every_key() {
    let schema = Study::schema();
    let definitions = schema["$defs"].as_object().unwrap();
    let of_output = [STUDY, RESUME].concat();
    for (kind, page) in [
        ("MovingMesh", [STUDY, EQUATION, SUBDOMAINS, SAFETY, DOMAINS].concat()),
        ("PoissonStudy", LAPLACIAN.to_string()),
        ("StefanStudy", [FRONTS, LAPLACIAN].concat()),
        ("SpeciesStudy", FRONTS.to_string()),
        ("EquidistributionStudy", LINE.to_string()),
    ] {
        let mut names = BTreeSet::new();
        keys(&definitions[kind], definitions, &mut names);
        assert!(names.len() > 15, "{kind}: {names:?}");
        let words: BTreeSet<&str> = page.split(|c: char| !(c.is_alphanumeric() || c == '_')).collect();
        let more: BTreeSet<&str> = of_output.split(|c: char| !(c.is_alphanumeric() || c == '_')).collect();
        let missing: Vec<&String> =
            names.iter().filter(|name| !words.contains(name.as_str()) && !more.contains(name.as_str())).collect();
        assert!(missing.is_empty(), "{kind}: {missing:?} are on no page");
    }
}
