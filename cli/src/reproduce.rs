use crate::terminal::{DONE, FAILED, Status, say, use_threads};
use clap::Args;
use clap::builder::PossibleValuesParser;
use driftmesh::Error;
use driftmesh_reproduce::{Done, ITEMS, Item, Options, Rerun, page};
use std::path::PathBuf;
use std::time::Instant;

#[derive(Args)]
pub struct Reproduce {
    /// What to rerun; everything where nothing is named.
    #[arg(value_name = "ITEM", value_parser = PossibleValuesParser::new(ITEMS.iter().map(|item| item.name)))]
    items: Vec<String>,
    /// Rerun everything, and write one page of all results that needs no other file: index.html in the directory.
    #[arg(long, conflicts_with = "items")]
    all: bool,
    /// Use fewer rows and samples: everything then takes about five minutes.
    #[arg(long)]
    quick: bool,
    /// Number of threads; all cores by default.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Directory for the tables, one Markdown file an item, and for plots as SVG and PNG.
    #[arg(long, value_name = "DIR", default_value = "out/reproduce")]
    out: PathBuf,
}

impl Reproduce {
    pub fn execute(&self) -> driftmesh::Result<Status> {
        use_threads(self.threads)?;
        std::fs::create_dir_all(&self.out)
            .map_err(|error| Error::Unwritable { path: self.out.clone(), reason: error.to_string() })?;
        let mut done = Vec::new();
        for item in ITEMS.iter().filter(|item| self.items.is_empty() || self.items.iter().any(|name| name == item.name))
        {
            let started = Instant::now();
            let outcome = self.rerun(item);
            let seconds = started.elapsed().as_secs_f64();
            match outcome {
                Ok(rerun) if self.all => done.push(Done { item, outcome: Ok(rerun), seconds }),
                Ok(_) => {}
                // one item that ends takes no other with it where there is a page to say so
                Err(error) if self.all && !matches!(error, Error::Unwritable { .. }) => {
                    say(format!("{}: {error}", item.name));
                    done.push(Done { item, outcome: Err(error.to_string()), seconds });
                }
                Err(error) => return Err(error),
            }
        }
        if !self.all {
            return Ok(DONE);
        }
        self.write("index.html", page(&done, self.quick).as_bytes())?;
        say(self.out.join("index.html").display());
        let failed = done.iter().any(|done| done.outcome.is_err());
        Ok(if failed { FAILED } else { DONE })
    }

    /// Reruns an item, prints its tables and writes them with its pictures.
    fn rerun(&self, item: &Item) -> driftmesh::Result<Rerun> {
        let rerun = item.run(Options { quick: self.quick })?;
        let text = rerun.tables.iter().map(|table| table.to_string()).collect::<Vec<_>>().join("\n");
        say(&text);
        self.write(&format!("{}.md", item.name), text.as_bytes())?;
        for (name, picture) in &rerun.pictures {
            self.write(&format!("{name}.svg"), picture.svg.as_bytes())?;
            self.write(&format!("{name}.png"), &picture.png)?;
        }
        Ok(rerun)
    }

    fn write(&self, name: &str, bytes: &[u8]) -> driftmesh::Result<()> {
        let path = self.out.join(name);
        std::fs::write(&path, bytes).map_err(|error| Error::Unwritable { path, reason: error.to_string() })
    }
}
