use crate::terminal::{say, use_threads};
use clap::Args;
use driftmesh::Error;
use driftmesh::reproduce::{ITEMS, Options, Rerun};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(Args)]
pub struct Reproduce {
    /// What to rerun; everything where nothing is named.
    #[arg(value_name = "ITEM", value_parser = clap::builder::PossibleValuesParser::new(ITEMS.iter().map(|item| item.name)))]
    items: Vec<String>,
    /// Fewer rows and samples: everything in a minute or two.
    #[arg(long)]
    quick: bool,
    /// Threads to use; all cores where nothing is said.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Directory for the tables, one Markdown file an item, and for plots as SVG and PNG.
    #[arg(long, value_name = "DIR", default_value = "out/reproduce")]
    out: PathBuf,
}

impl Reproduce {
    pub fn execute(&self) -> driftmesh::Result<ExitCode> {
        use_threads(self.threads)?;
        std::fs::create_dir_all(&self.out)
            .map_err(|error| Error::Unwritable { path: self.out.clone(), reason: error.to_string() })?;
        for item in ITEMS.iter().filter(|item| self.items.is_empty() || self.items.iter().any(|name| name == item.name))
        {
            let Rerun { tables, pictures } = item.run(Options { quick: self.quick })?;
            let text = tables.iter().map(|table| table.to_string()).collect::<Vec<_>>().join("\n");
            say(&text);
            self.write(&format!("{}.md", item.name), text.as_bytes())?;
            for (name, picture) in pictures {
                self.write(&format!("{name}.svg"), picture.svg.as_bytes())?;
                self.write(&format!("{name}.png"), &picture.png)?;
            }
        }
        Ok(ExitCode::SUCCESS)
    }

    fn write(&self, name: &str, bytes: &[u8]) -> driftmesh::Result<()> {
        let path = self.out.join(name);
        std::fs::write(&path, bytes).map_err(|error| Error::Unwritable { path, reason: error.to_string() })
    }
}
