use super::Monitor;
use crate::error::{Error, Failure, Result};
use crate::formula::{Formula, Program};
use crate::geometry::{Field, Mesh};

/// A monitor that follows a formula of the unknowns instead of the first of them.
pub(super) struct Following {
    monitor: Box<dyn Monitor>,
    /// Of x, y, the unknowns and t.
    of: Program<PLACES, 1>,
    unknowns: usize,
}

/// x, y, t and as many unknowns as any equation has.
const PLACES: usize = 7;

impl Following {
    pub fn new(monitor: Box<dyn Monitor>, of: &str, unknowns: &[String]) -> Result<Self> {
        let names = unknowns.iter().map(String::as_str).take(PLACES - 3);
        let variables: Vec<&str> = ["x", "y"].into_iter().chain(names).chain(["t"]).collect();
        let formula = Formula::parse(of, &variables).map_err(|mistake| Error::Formula {
            key: "of".into(),
            text: of.into(),
            at: mistake.at,
            message: mistake.message,
            help: mistake.help,
        })?;
        Ok(Self { monitor, of: Program::new([&formula]), unknowns: variables.len() - 3 })
    }
}

impl Monitor for Following {
    /// The gradient at hand is that of the first unknown, not of what is followed.
    fn density(&self, mesh: &Mesh<2>, u: &[f64], _gradient: Option<&[[f64; 2]]>) -> Result<Vec<f64>, Failure> {
        self.monitor.density(mesh, u, None)
    }

    fn followed(&self, t: f64, mesh: &Mesh<2>, unknowns: &Field) -> Result<Vec<f64>, Failure> {
        let nodes = unknowns.values().chunks(unknowns.components());
        let images = mesh.images();
        let points = images.iter().zip(nodes).map(|(x, u)| {
            let mut point = [t; PLACES];
            point[..2].copy_from_slice(x);
            point.iter_mut().skip(2).zip(&u[..self.unknowns.min(u.len())]).for_each(|(to, u)| *to = *u);
            point
        });
        let points: Vec<[f64; PLACES]> = points.collect();
        let mut values = vec![[0.0]; points.len()];
        self.of.eval_each(&points, &[], &mut values);
        match values.iter().position(|[u]| !u.is_finite()) {
            None => Ok(values.into_flattened()),
            Some(k) => Err(Failure::Formula {
                what: "`monitor.of`".into(),
                value: values[k][0],
                node: mesh.lattice().node(k),
                x: mesh.x()[k],
                given: Vec::new(),
            }),
        }
    }
}
