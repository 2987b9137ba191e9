//! What can be drawn, written and shown of a run of any kind of study.

use super::State;
use crate::geometry::{Cells, Mesh, cell_jacobians, cell_qualities, first_two};

/// Points with values at one time, in the order of a lattice of cells
///
/// Arrays over the points have shape `cells` + 1, the second index running fastest; a periodic axis repeats its first
/// node at its end. Arrays over the cells have shape `cells`.
///
/// # Example
/// ```
/// use driftmesh::{geometry::{Lattice, Mesh}, simulation::Scene};
/// let mesh = Mesh::uniform(Lattice::new([2, 2], [true, false])?, [0.0, 0.0], [1.0, 1.0])?; // 2 × 3 nodes
/// let scene = Scene::of_mesh(0.5, 7, &mesh, vec![("u".into(), vec![0.0; 6])]);
/// assert_eq!(scene.points.len(), 9);
/// assert_eq!(scene.points[8], [1.0, 1.0]);
/// # Ok::<(), driftmesh::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Simulated time; the number of the iteration where iterations are shown one by one.
    pub t: f64,
    /// Time steps done; the number of the iteration where iterations are shown one by one.
    pub step: usize,
    /// Cells along each axis; 0 along the second axis for a line.
    pub cells: [usize; 2],
    /// Axes that go on beyond the box after its end.
    pub periodic: [bool; 2],
    /// Axes whose ends are the same curve.
    pub closed: [bool; 2],
    /// Lower corner of the box around the domain.
    pub lower: [f64; 2],
    /// Width and height of that box.
    pub extent: [f64; 2],
    /// Positions of the nodes.
    pub points: Vec<[f64; 2]>,
    /// Named values at the nodes; a picture shows the first of them.
    pub nodal: Vec<(String, Values)>,
    /// The density ρ that moves the mesh, at the nodes; none where no density does.
    pub density: Option<Vec<f64>>,
    /// Named values in the cells.
    pub in_cells: Vec<(String, Values)>,
    /// A curve over the cells, such as the front between two phases; empty where there is none.
    pub curve: Vec<[f64; 2]>,
}

/// One value for each node or cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Numbers.
    Scalars(Vec<f64>),
    /// Vectors in the plane.
    Vectors(Vec<[f64; 2]>),
    /// Whole numbers.
    Numbers(Vec<usize>),
}

impl Scene {
    /// A mesh with named values at its nodes (in lattice order, without the repeated ones), and in its cells the
    /// smallest corner Jacobian and in the plane the shape measure Q.
    pub fn of_mesh<const D: usize>(t: f64, step: usize, mesh: &Mesh<D>, nodal: Vec<(String, Vec<f64>)>) -> Self
    where
        Mesh<D>: Cells<D>,
    {
        let lattice = mesh.lattice();
        let closed = |(name, values): (String, Vec<f64>)| (name, Values::Scalars(lattice.closed(&values).into_owned()));
        let mut scene = Self {
            t,
            step,
            cells: first_two(&lattice.cells()),
            periodic: if mesh.chart().is_some() { [false; 2] } else { first_two(&lattice.periodic()) },
            closed: mesh.chart().map_or([false; 2], |chart| first_two(&chart.closed())),
            lower: first_two(&mesh.lower()),
            extent: first_two(&mesh.extent()),
            points: mesh.closed().iter().map(|x| first_two(x)).collect(),
            nodal: nodal.into_iter().map(closed).collect(),
            density: None,
            in_cells: Vec::new(),
            curve: Vec::new(),
        };
        if D > 1 {
            scene.add_to_cells("Q", Values::Scalars(cell_qualities(mesh)));
        }
        scene.add_to_cells("jacobian", Values::Scalars(cell_jacobians(mesh)));
        scene
    }

    /// Adds values in the cells; their name gives way to an unknown of the same name.
    pub fn add_to_cells(&mut self, name: &str, values: Values) {
        let name = if self.has(name) { format!("{name} of cells") } else { name.into() };
        self.in_cells.push((name, values));
    }

    /// Whether its mesh moves: by a density, or with a front.
    pub fn moves(&self) -> bool {
        self.density.is_some() || !self.curve.is_empty()
    }

    /// Whether some values at the nodes have this name.
    pub fn has(&self, name: &str) -> bool {
        self.nodal.iter().any(|(taken, _)| taken == name)
    }
}

impl<const D: usize> State<D>
where
    Mesh<D>: Cells<D>,
{
    /// The mesh with the unknowns, by their names, and with its density.
    pub fn scene(&self, unknowns: &[String]) -> Scene {
        let named = unknowns.iter().enumerate().map(|(c, name)| (name.clone(), self.u.component(c).collect()));
        let density = Some(self.mesh.lattice().closed(self.rho.largest()).into_owned());
        Scene { density, ..Scene::of_mesh(self.t, self.step, &self.mesh, named.collect()) }
    }
}
