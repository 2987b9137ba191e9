//! Studies of kind `stefan` with `[species]`: what is refused, and what runs.

use super::common::StudyKind;
use super::kind::{Kind, common_tables};
use super::mapped::parse;
use super::species::{SpeciesStudy, SpeciesTable};
use super::species_run::SpeciesRun;
use crate::error::{Error, Failure, Result};
use crate::physics::{Condition, Coordinates};
use crate::species::{EndCondition, Names, Rate, Resident, Species};

/// Bytes of memory that a run needs for each cell and species: unknowns, the sparse matrix and its factors.
const BYTES_PER_NODE: u128 = 4000;
/// The fewest cells of a phase.
const FEWEST: usize = 3;

impl Kind for SpeciesStudy {
    type Run = SpeciesRun;

    const KIND: StudyKind = StudyKind::Stefan;

    common_tables!();

    fn resolve(&mut self) -> Result<()> {
        self.begin()?;
        for (name, phases) in &mut self.species {
            for table in phases.values_mut() {
                table.storage.get_or_insert_with(|| name.clone());
                table.source.get_or_insert_with(|| "0".into());
            }
        }
        Ok(())
    }

    fn memory(&self) -> u128 {
        let cells = self.grid.cells.iter().map(|n| *n as u128 + 2).sum::<u128>();
        cells * self.species.len() as u128 * BYTES_PER_NODE
    }

    fn begin(&self) -> Result<SpeciesRun> {
        self.study.check_name()?;
        self.check_domain()?;
        let names = self.names()?;
        super::memory::check_memory(self.memory() / BYTES_PER_NODE, BYTES_PER_NODE, &self.grid.cells)?;
        let species = Species {
            coordinates: self.domain.coordinates,
            walls: [self.domain.lower[0], self.domain.upper[0]],
            cells: self.grid.cells.clone(),
            residents: (0..self.domain.phases.len()).map(|p| self.residents(&names, p)).collect::<Result<_>>()?,
            laws: self.laws(&names)?,
            names,
        };
        let schedule = self.time.schedule(self.time.start.unwrap_or(0.0)).map_err(|error| error.within("time"))?;
        let state = species.start(schedule.start(), &self.domain.front).map_err(|error| self.blame(error))?;
        self.check_diffusivities(&species, &state)?;
        let frames = self.output.frames_of(&schedule)?;
        self.output.check()?;
        Ok(SpeciesRun::of(&self.study.name, species, (state, schedule), frames))
    }
}

impl SpeciesStudy {
    fn check_domain(&self) -> Result<()> {
        let ([left], [right]) = (self.domain.lower, self.domain.upper);
        let distance = self.domain.coordinates != Coordinates::Cartesian;
        if !(left.is_finite() && right.is_finite() && left < right) {
            return Err(Error::invalid("domain.upper", format!("[{right}]"), "must be finite and above domain.lower"));
        }
        if distance && left < 0.0 {
            let rule = "must be 0 or more: it is a distance with these coordinates";
            return Err(Error::invalid("domain.lower", format!("[{left}]"), rule));
        }
        let phases = &self.domain.phases;
        let plain = |name: &String| {
            let mut letters = name.chars();
            letters.next().is_some_and(|c| c.is_ascii_alphabetic())
                && letters.all(|c| c.is_ascii_alphanumeric() || c == '_')
        };
        if let Some(name) = phases.iter().find(|name| !plain(name)) {
            let rule = "a phase is named by letters, digits and _, a letter first, since formulas take the name";
            return Err(Error::invalid("domain.phases", format!("{name:?}"), rule));
        }
        if let Some(name) = phases.iter().enumerate().find(|(k, name)| phases[..*k].contains(name)).map(|(_, n)| n) {
            return Err(Error::invalid("domain.phases", format!("{name:?} twice"), "each phase has a name of its own"));
        }
        if phases.len() < 2 || self.domain.front.len() + 1 != phases.len() {
            let rule = format!("there is one front between each two of the {} phases", phases.len());
            return Err(Error::invalid("domain.front", format!("{:?}", self.domain.front), rule));
        }
        if self.grid.cells.len() != phases.len() || self.grid.cells.iter().any(|n| *n < FEWEST) {
            let rule = format!("needs a number for each of the {} phases, at least {FEWEST}", phases.len());
            return Err(Error::invalid("grid.cells", format!("{:?}", self.grid.cells), rule));
        }
        let ends = [left].into_iter().chain(self.domain.front.iter().copied()).chain([right]);
        let ends: Vec<f64> = ends.collect();
        if let Some(pair) = ends.windows(2).find(|pair| pair[1] <= pair[0] || !pair[1].is_finite()) {
            let rule =
                format!("must lie between the walls, from left to right, and {} is not above {}", pair[1], pair[0]);
            return Err(Error::invalid("domain.front", format!("{:?}", self.domain.front), rule));
        }
        Ok(())
    }

    fn names(&self) -> Result<Names> {
        let phases = &self.domain.phases;
        for (species, tables) in &self.species {
            let unknown = tables.keys().find(|phase| !phases.contains(phase));
            if let Some(phase) = unknown {
                let rule = format!("there is no such phase; domain.phases has {}", phases.join(", "));
                return Err(Error::invalid(format!("species.{species}.{phase}"), "given", rule));
            }
            if tables.is_empty() {
                let rule = format!("is in no phase; add [species.{species}.{}]", phases[0]);
                return Err(Error::invalid(format!("species.{species}"), "given", rule));
            }
        }
        if self.species.is_empty() {
            return Err(Error::invalid("species", "empty", "needs at least one, such as [species.a.core]"));
        }
        let species: Vec<&str> = self.species.keys().map(String::as_str).collect();
        let of = |phase: &String| {
            let has = self.species.iter().filter(|(_, tables)| tables.contains_key(phase));
            (phase.clone(), has.map(|(name, _)| name.as_str()).collect::<Vec<&str>>())
        };
        let phases: Vec<(String, Vec<&str>)> = phases.iter().map(of).collect();
        let phases: Vec<(&str, &[&str])> = phases.iter().map(|(name, has)| (name.as_str(), &has[..])).collect();
        Ok(Names::new(&species, &phases))
    }

    fn residents(&self, names: &Names, phase: usize) -> Result<Vec<Resident>> {
        let inside = names.inside(phase);
        let resident = |&species: &usize| {
            let (name, home) = (&names.species()[species], &names.phases()[phase]);
            let table = &self.species[name][home];
            let key = |part: &str| format!("species.{name}.{home}.{part}");
            let rate = |part: &str, text: &str| rate(&key(part), text, &inside);
            let diffusivity = rate("diffusivity", &table.diffusivity)?;
            let fixed = diffusivity.is(0.0);
            let end = |end| self.end(names, (table, phase, end), (&key(["left", "right"][end]), fixed));
            Ok(Resident {
                species,
                storage: rate("storage", table.storage.as_deref().unwrap_or(name))?,
                diffusivity,
                source: rate("source", table.source.as_deref().unwrap_or("0"))?,
                initial: self::rate(&key("initial"), &table.initial, &["x".into()])?,
                ends: [end(0)?, end(1)?],
            })
        };
        names.residents(phase).iter().map(resident).collect()
    }

    /// The condition of a species at an end of a phase; `fixed` where it does not diffuse.
    fn end(
        &self,
        names: &Names,
        (table, phase, end): (&SpeciesTable, usize, usize),
        (key, fixed): (&str, bool),
    ) -> Result<EndCondition> {
        let given = [&table.left, &table.right][end].as_ref();
        let front = (phase + end).checked_sub(1).filter(|k| *k + 1 < self.domain.phases.len());
        let centre =
            phase + end == 0 && self.domain.lower == [0.0] && self.domain.coordinates != Coordinates::Cartesian;
        if centre {
            return match given {
                None | Some(Condition::NoFlux) => Ok(EndCondition::Outflow),
                Some(_) => Err(Error::invalid(key, "given", "this is the centre, which nothing passes; leave it out")),
            };
        }
        let known = match front {
            Some(k) => names.beside(phase, k),
            None => names.inside(phase),
        };
        let idle = |condition: &str| {
            let rule = "the diffusivity is 0, so that nothing flows by itself; write \"outflow\" or a concentration";
            Err(Error::invalid(key, condition, rule))
        };
        match given {
            None => {
                let rule = "write a concentration, \"no-flux\", \"outflow\" or { flux = \"…\" }";
                Err(Error::invalid(key, "not given", rule))
            }
            Some(Condition::Value(text)) => Ok(EndCondition::Value(rate(key, text, &known)?)),
            Some(Condition::Outflow) => Ok(EndCondition::Outflow),
            Some(Condition::NoFlux) if fixed && front.is_none() => Ok(EndCondition::Outflow),
            Some(Condition::NoFlux) if fixed => idle("\"no-flux\""),
            Some(Condition::Flux(_)) if fixed => idle("a flux"),
            Some(Condition::NoFlux) => Ok(EndCondition::Flux(rate(key, "0", &known)?)),
            Some(Condition::Flux(text)) => Ok(EndCondition::Flux(rate(&format!("{key}.flux"), text, &known)?)),
        }
    }

    fn laws(&self, names: &Names) -> Result<Vec<Rate>> {
        let (laws, fronts) = (&self.front.law.0, self.domain.front.len());
        if laws.len() != fronts {
            let rule = format!("there are {fronts} fronts; give one law for each, as a list");
            return Err(Error::invalid("front.law", format!("{} laws", laws.len()), rule));
        }
        let key = |k: usize| if fronts == 1 { "front.law".into() } else { format!("front.law.{k}") };
        laws.iter().enumerate().map(|(k, text)| rate(&key(k), text, &names.at_front(k))).collect()
    }

    fn check_diffusivities(&self, species: &Species, state: &crate::species::SpeciesState) -> Result<()> {
        for (phase, residents) in species.residents.iter().enumerate() {
            for (i, resident) in residents.iter().enumerate() {
                let [x, least] = species.least_diffusivity(state, phase, i);
                if !(least >= 0.0 && least.is_finite()) {
                    let [name, home] = [&species.names.species()[resident.species], &species.names.phases()[phase]];
                    let rule = format!("is {least} at x = {x} at the start; it must be finite and not below 0");
                    let text = format!("{:?}", resident.diffusivity.formula().text());
                    return Err(Error::invalid(format!("species.{name}.{home}.diffusivity"), text, rule));
                }
            }
        }
        Ok(())
    }

    /// Says which setting makes a start that no run can begin with.
    fn blame(&self, error: Error) -> Error {
        match &error {
            Error::Failed { failure: failure @ Failure::VanishingPhase { .. }, .. } => {
                let rule = format!("{failure}; begin with thicker phases");
                Error::invalid("domain.front", format!("{:?}", self.domain.front), rule)
            }
            Error::Failed { failure: failure @ Failure::Formula { .. }, .. } => {
                Error::invalid("species", "given", format!("{failure} at the start; mend its `initial`"))
            }
            _ => error,
        }
    }
}

/// A formula of these names with its derivatives.
fn rate(key: &str, text: &str, names: &[String]) -> Result<Rate> {
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let formula = parse(key, text, &names)?;
    Rate::new(formula).map_err(|mistake| mistake.of(key, text))
}
