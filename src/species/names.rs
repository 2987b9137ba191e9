/// Names of the species, and of the phases from left to right with the species that each has
///
/// # Example
/// ```
/// use driftmesh::species::Names;
/// let names = Names::new(&["gas", "solid"], &[("core", &["solid"]), ("shell", &["gas", "solid"])]);
/// assert_eq!(names.inside(1), ["gas", "solid", "x", "t"]);
/// let law = ["solid_core", "solid_core_flux", "gas_shell", "gas_shell_flux", "solid_shell", "solid_shell_flux"];
/// assert_eq!(names.at_front(0)[..6], law);
/// assert_eq!(names.at_front(0)[6..], ["x", "t"]);
/// ```
#[derive(Debug, Clone)]
pub struct Names {
    species: Vec<String>,
    phases: Vec<String>,
    /// Of each phase its species by number.
    residents: Vec<Vec<usize>>,
}

impl Names {
    /// Species in the order in which all is told, and phases from left to right. A species that is not among the former
    /// is left out.
    pub fn new<S: AsRef<str>, P: AsRef<str>>(species: &[S], phases: &[(P, &[S])]) -> Self {
        let number = |name: &S| species.iter().position(|known| known.as_ref() == name.as_ref());
        let residents = phases.iter().map(|(_, has)| {
            let mut has: Vec<usize> = has.iter().filter_map(number).collect();
            has.sort_unstable();
            has
        });
        Self {
            residents: residents.collect(),
            species: species.iter().map(|name| name.as_ref().into()).collect(),
            phases: phases.iter().map(|(name, _)| name.as_ref().into()).collect(),
        }
    }

    /// The species.
    pub fn species(&self) -> &[String] {
        &self.species
    }

    /// The phases.
    pub fn phases(&self) -> &[String] {
        &self.phases
    }

    /// The species of a phase, by number.
    pub fn residents(&self, phase: usize) -> &[usize] {
        &self.residents[phase]
    }

    fn of(&self, phase: usize) -> impl Iterator<Item = String> {
        self.residents[phase].iter().map(|species| self.species[*species].clone())
    }

    /// What formulas know inside a phase and on a wall: the concentrations there, x and t.
    pub fn inside(&self, phase: usize) -> Vec<String> {
        self.of(phase).chain(["x".into(), "t".into()]).collect()
    }

    /// What the law of the k-th front knows: of each species on its left and then on its right the concentration `a_b`
    /// at the front and the flux `a_b_flux` = −D ∂c/∂x there, a being the species and b the phase; x and t.
    pub fn at_front(&self, k: usize) -> Vec<String> {
        let pair = |phase: usize| {
            let named = move |species: String| format!("{species}_{}", self.phases[phase]);
            self.of(phase).map(named).flat_map(|name| [name.clone(), format!("{name}_flux")])
        };
        pair(k).chain(pair(k + 1)).chain(["x".into(), "t".into()]).collect()
    }

    /// What a condition of a phase on the k-th front knows: the concentrations in the phase by the names of their
    /// species, then what the law knows, and the `velocity` of the front.
    pub fn beside(&self, phase: usize, k: usize) -> Vec<String> {
        self.of(phase).chain(self.at_front(k)).chain(["velocity".into()]).collect()
    }
}
