use super::{Density, Monitor};
use crate::error::{Failure, Result};
use crate::formula::{Formula, Program};
use crate::geometry::{Field, Mesh};

/// A monitor that follows a formula of the unknowns instead of the first of them.
pub(super) struct Following<const D: usize> {
    monitor: Box<dyn Monitor<D>>,
    /// The formula that is followed, of the place, the unknowns and t.
    of: Program<PLACES, 1>,
    unknowns: usize,
}

/// Number of values that a formula takes at a place: x, y, t, and as many unknowns as any equation has.
const PLACES: usize = 12;

impl<const D: usize> Following<D> {
    pub fn new(monitor: Box<dyn Monitor<D>>, of: &str, unknowns: &[String]) -> Result<Self> {
        let names = unknowns.iter().map(String::as_str).take(PLACES - 1 - D);
        let variables: Vec<&str> = ["x", "y", "z"].into_iter().take(D).chain(names).chain(["t"]).collect();
        let formula = Formula::parse(of, &variables).map_err(|mistake| mistake.of("of", of))?;
        Ok(Self { monitor, of: Program::new([&formula]), unknowns: variables.len() - 1 - D })
    }
}

impl<const D: usize> Monitor<D> for Following<D> {
    /// The gradient at hand is that of the first unknown, not of what is followed.
    fn density(&self, mesh: &Mesh<D>, u: &[f64], _gradient: Option<&[[f64; D]]>) -> Result<Density, Failure> {
        self.monitor.density(mesh, u, None)
    }

    fn followed(&self, t: f64, mesh: &Mesh<D>, unknowns: &Field) -> Result<Vec<f64>, Failure> {
        let nodes = unknowns.values().chunks(unknowns.components());
        let images = mesh.images();
        let points = images.iter().zip(nodes).map(|(x, u)| {
            let mut point = [t; PLACES];
            point[..D].copy_from_slice(x);
            point.iter_mut().skip(D).zip(&u[..self.unknowns.min(u.len())]).for_each(|(to, u)| *to = *u);
            point
        });
        let points: Vec<[f64; PLACES]> = points.collect();
        let mut values = vec![[0.0]; points.len()];
        self.of.eval_each(&points, &[], &mut values);
        match values.iter().position(|[u]| !u.is_finite()) {
            None => Ok(values.into_flattened()),
            Some(k) => {
                let (at, what, value) = (mesh.node_place(k), "`monitor.of`".into(), values[k][0]);
                Err(Failure::Formula { what, value, at, given: Vec::new() })
            }
        }
    }
}
