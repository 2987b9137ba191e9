//! The formulas of an equation, read from its texts.

use super::{FormulaPde, MAX_UNKNOWNS, MAX_UNKNOWNS_ON_A_LINE, Scheme};
use crate::error::{Error, Result};
use crate::formula::Formula;
use crate::physics::sides::{Condition, Conditions, Open};
use crate::physics::terms::TermFormulas;
use crate::physics::{AXES, Diffusivity, bounds, formula};
use std::collections::BTreeMap;

/// The formulas of a [`FormulaPde`], parsed.
pub(in crate::physics) struct Formulas<const D: usize> {
    pub names: Vec<String>,
    /// Formulas of x, y, the unknowns and t: F along x of all unknowns, then F along y, D and S; then the derivatives
    /// of all of these by the first unknown, by the second, and so on.
    pub nodal: Vec<Formula>,
    /// Initial values: formulas of x, y and t.
    pub initial: Vec<Formula>,
    pub exact: Vec<Option<Formula>>,
    /// What holds for each unknown at the lower and the upper end of each axis.
    pub sides: Vec<[[Open; 2]; D]>,
    pub scheme: Option<Scheme>,
    /// Terms that depend on gradients, and storages. Fluxes and sources of these unknowns are 0 in `nodal`.
    pub terms: TermFormulas<D>,
    /// The lower and the upper bound of each unknown.
    pub bounds: Vec<[Option<Formula>; 2]>,
}

/// Formulas with their keys.
type Keyed = Vec<(String, Formula)>;

impl<const D: usize> FormulaPde<D> {
    /// Reads all formulas.
    ///
    /// # Errors
    /// As [`FormulaPde::check`].
    pub(in crate::physics) fn read(&self) -> Result<Formulas<D>> {
        self.check_names()?;
        let names = &self.unknowns;
        let mut values = self.fluxes()?;
        let (diffusivities, fluxes) = self.diffusivities()?;
        let (plain, sources) = self.sources()?;
        values.extend(diffusivities.into_iter().chain(plain));
        let terms = TermFormulas { fluxes, sources, storage: self.stored()? };
        let mut all: Vec<Formula> = values.iter().map(|(_, f)| f.clone()).collect();
        for unknown in 0..names.len() {
            for (key, f) in &values {
                all.push(f.derivative(D + unknown).map_err(|mistake| mistake.of(key, f.text()))?);
            }
        }
        let read = |table: &str, texts: &BTreeMap<String, String>| -> Result<Vec<Option<Formula>>> {
            let read = |name| match texts.get(name).map(String::as_str) {
                None => Ok(None),
                Some(text) => formula::<D>(&format!("{table}.{name}"), text).map(Some),
            };
            names.iter().map(read).collect()
        };
        Ok(Formulas {
            names: names.clone(),
            nodal: all,
            initial: read("initial", &self.initial)?.into_iter().flatten().collect(),
            sides: (names.iter())
                .map(|name| self.boundary.get(name).unwrap_or(&Conditions::All(Condition::NoFlux)).read(name, names))
                .collect::<Result<_>>()?,
            exact: read("exact", &self.exact)?,
            scheme: self.scheme,
            terms,
            bounds: names.iter().map(|name| bounds::read::<D>(name, &self.bounds)).collect::<Result<_>>()?,
        })
    }

    /// F along x of all unknowns, then along y, with their keys; 0 where it takes gradients.
    fn fluxes(&self) -> Result<Keyed> {
        let mut values = Vec::new();
        for axis in 0..D {
            for name in &self.unknowns {
                let (key, text) = (format!("flux.{name}[{axis}]"), self.flux_text(name, axis));
                let steep = self.has_gradients(&self.term(&key, text)?);
                values.push((key, self.at_nodes(if steep { "0" } else { text })?));
            }
        }
        Ok(values)
    }

    /// D of all unknowns that have one in all directions, without gradients, and the fluxes by gradients of the others.
    fn diffusivities(&self) -> Result<(Keyed, Vec<Option<[Formula; D]>>)> {
        let (mut values, mut fluxes) = (Vec::new(), Vec::new());
        let none = Diffusivity::from("0");
        for (c, name) in self.unknowns.iter().enumerate() {
            let (key, of) = (format!("diffusivity.{name}"), self.diffusivity.get(name).unwrap_or(&none));
            let mut steep = of.scalar().is_none();
            for (at, text) in of.entries() {
                let formula = self.term(&format!("{key}{at}"), text)?;
                refuse_negative(&format!("{key}{at}"), &formula, of.scalar().is_some())?;
                steep |= self.has_gradients(&formula);
            }
            let plain = of.scalar().filter(|_| !steep).unwrap_or("0");
            values.push((key, self.at_nodes(plain)?));
            fluxes.push(self.steep_flux(c, steep.then_some(of))?);
        }
        Ok((values, fluxes))
    }

    /// S of all unknowns without gradients, and those with.
    fn sources(&self) -> Result<(Keyed, Vec<Option<Formula>>)> {
        let (mut values, mut sources) = (Vec::new(), Vec::new());
        for name in &self.unknowns {
            let (key, text) = (format!("source.{name}"), self.source.get(name).map_or("0", String::as_str));
            let of = self.term(&key, text)?;
            let sloped = self.has_gradients(&of);
            values.push((key, self.at_nodes(if sloped { "0" } else { text })?));
            sources.push(sloped.then_some(of));
        }
        Ok((values, sources))
    }

    /// What is stored, where it is not the unknown itself.
    fn stored(&self) -> Result<Vec<Option<Formula>>> {
        let stored = |name: &String| {
            let Some(text) = self.storage.get(name).filter(|text| *text != name) else { return Ok(None) };
            let key = format!("storage.{name}");
            let of = self.term(&key, text)?;
            if self.has_gradients(&of) {
                let message = "what is stored may not depend on gradients".to_string();
                return Err(Error::Formula { key, text: text.clone(), at: 0..text.len(), message, help: None });
            }
            Ok(Some(of))
        };
        self.unknowns.iter().map(stored).collect()
    }

    fn flux_text(&self, name: &str, axis: usize) -> &str {
        self.flux.get(name).map_or("0", |along| &along[axis])
    }

    /// A formula of x, y, the unknowns, their derivatives and t: of one unknown after the other, u_x, u_y, v_x and so
    /// on.
    fn term(&self, key: &str, text: &str) -> Result<Formula> {
        let slopes = self.unknowns.iter().flat_map(|name| AXES[..D].iter().map(move |axis| format!("{name}_{axis}")));
        let slopes: Vec<String> = slopes.collect();
        let names = self.unknowns.iter().chain(&slopes).map(String::as_str);
        let variables: Vec<&str> = AXES[..D].iter().copied().chain(names).chain(["t"]).collect();
        let formula = Formula::parse(text, &variables).map_err(|mistake| mistake.of(key, text))?;
        // that derivatives can be taken is seen here
        for variable in D..variables.len() - 1 {
            formula.derivative(variable).map_err(|mistake| mistake.of(key, text))?;
        }
        Ok(formula)
    }

    fn has_gradients(&self, term: &Formula) -> bool {
        let first = D + self.unknowns.len();
        (first..first + D * self.unknowns.len()).any(|variable| term.depends_on(variable))
    }

    /// A formula of x, y, the unknowns and t that was read before.
    fn at_nodes(&self, text: &str) -> Result<Formula> {
        let names = self.unknowns.iter().map(String::as_str);
        let variables: Vec<&str> = AXES[..D].iter().copied().chain(names).chain(["t"]).collect();
        Formula::parse(text, &variables).map_err(|mistake| mistake.of("flux", text))
    }

    /// What flows of unknown c along each axis by gradients: its flux where that takes gradients, less what diffuses.
    fn steep_flux(&self, c: usize, diffusivity: Option<&Diffusivity>) -> Result<Option<[Formula; D]>> {
        let name = &self.unknowns[c];
        let slope = |name: &str, axis: usize| format!("{name}_{}", AXES[axis]);
        let mut along = Vec::new();
        let mut is_steep = diffusivity.is_some();
        for axis in 0..D {
            let text = self.flux_text(name, axis);
            let carried = self.has_gradients(&self.term(&format!("flux.{name}[{axis}]"), text)?);
            is_steep |= carried;
            let carried = if carried { text } else { "0" };
            let spread = match diffusivity {
                None => "0".to_string(),
                Some(of) => of.flow((name, axis, D), &slope).ok_or_else(|| {
                    let rule = format!("there are {D} axes; give one formula, {D} of them, or {D} rows of {D}");
                    Error::invalid(format!("diffusivity.{name}"), "another number of formulas", rule)
                })?,
            };
            along.push(self.term(&format!("diffusivity.{name}"), &format!("({carried}) - ({spread})"))?);
        }
        Ok(is_steep.then(|| std::array::from_fn(|axis| along[axis].clone())))
    }

    /// Refuses unknowns that cannot be named in formulas, tables with keys that are no unknowns, and missing initial
    /// values.
    fn check_names(&self) -> Result<()> {
        let names = &self.unknowns;
        let most = if D == 1 { MAX_UNKNOWNS_ON_A_LINE } else { MAX_UNKNOWNS };
        if !(1..=most).contains(&names.len()) {
            let rule = format!("must be 1 to {most} names");
            return Err(Error::invalid("unknowns", format!("{names:?}"), rule));
        }
        for (k, name) in names.iter().enumerate() {
            let refused = |why: String| Err(Error::invalid(format!("unknowns[{k}]"), format!("{name:?}"), why));
            if name == "t" || AXES[..D].contains(&name.as_str()) {
                let axes = AXES[..D].join(", ");
                return refused(format!("{axes} and t are place and time in every formula; take another name"));
            }
            if name == "kind" {
                return refused("`kind` is a key of its own in every table; take another name".into());
            }
            let known: Vec<&str> = names[..=k].iter().map(String::as_str).collect();
            if let Err(mistake) = Formula::parse("0", &known) {
                return refused(format!("{}; take another name", mistake.message));
            }
        }
        let tables = [
            ("flux", self.flux.keys().collect::<Vec<_>>()),
            ("diffusivity", self.diffusivity.keys().collect()),
            ("source", self.source.keys().collect()),
            ("initial", self.initial.keys().collect()),
            ("boundary", self.boundary.keys().collect()),
            ("exact", self.exact.keys().collect()),
            ("bounds", self.bounds.keys().collect()),
            ("storage", self.storage.keys().collect()),
        ];
        for (table, keys) in tables {
            if let Some(key) = keys.into_iter().find(|key| !names.contains(key)) {
                let rule = format!("`{key}` is not among pde.unknowns = {names:?}; add it there, or leave this out");
                return Err(Error::invalid(format!("{table}.{key}"), "given", rule));
            }
        }
        for (name, of) in &self.diffusivity {
            if let Some(key) = of.names().find(|key| !names.contains(key)) {
                let rule = format!("`{key}` is not among pde.unknowns = {names:?}; add it there, or leave this out");
                return Err(Error::invalid(format!("diffusivity.{name}.{key}"), "given", rule));
            }
        }
        if let (Some(Scheme::Limited), Some(name)) = (self.scheme, self.storage.keys().next()) {
            let rule = "limited fluxes carry what is stored, which is u itself; leave the scheme out, or storage";
            return Err(Error::invalid(format!("storage.{name}"), "given with scheme = \"limited\"", rule));
        }
        match names.iter().find(|name| !self.initial.contains_key(*name)) {
            None => Ok(()),
            Some(name) => {
                let rule = format!("every unknown needs one; add {name} = \"…\"");
                Err(Error::invalid("initial", format!("not given for `{name}`"), rule))
            }
        }
    }
}

/// Refuses a diffusivity that is a negative number, where it is the only one.
fn refuse_negative(key: &str, formula: &Formula, alone: bool) -> Result<()> {
    let value = formula.eval(&[]);
    if alone && value < 0.0 {
        let message = format!("the diffusivity is {value}, and no solution lasts where it is negative");
        let (text, at) = (formula.text().to_string(), 0..formula.text().len());
        return Err(Error::Formula { key: key.into(), text, at, message, help: None });
    }
    Ok(())
}
