//! Diffusivities that are functions of place alone.

use crate::formula::{Formula, Program};
use crate::geometry::Mesh;
use crate::parallel;

/// Diffusivities that are functions of place alone, of B unknowns, each a formula of the P values at a node: place
/// first, then unknowns.
pub(super) struct Layers<const P: usize, const B: usize> {
    of_place: [Option<Program<P, 1>>; B],
}

/// Number of points on an edge at which a diffusivity is taken for its harmonic mean.
const SAMPLES: usize = 8;

impl<const P: usize, const B: usize> Layers<P, B> {
    pub fn new(diffusivities: [&Formula; B]) -> Self {
        let of_place = diffusivities.map(|diffusivity| {
            let place = (0..P - B).any(|d| diffusivity.depends_on(d));
            let unknowns = (P - B..P).any(|e| diffusivity.depends_on(e));
            (place && !unknowns).then(|| Program::new([diffusivity]))
        });
        Self { of_place }
    }

    pub fn are_some(&self) -> bool {
        self.of_place.iter().any(Option::is_some)
    }

    /// 1/⟨1/D⟩, the harmonic mean of D along each edge: what flows through layers in a row, as through resistances.
    pub fn through<const D: usize>(&self, t: f64, mesh: &Mesh<D>, edges: &[[[f64; D]; 2]]) -> Vec<[Option<f64>; B]> {
        let place = |[from, to]: &[[f64; D]; 2], sample: usize| -> [f64; P] {
            let share = (sample as f64 + 0.5) / SAMPLES as f64;
            let x = mesh.image(std::array::from_fn(|d| from[d] + share * (to[d] - from[d])));
            std::array::from_fn(|v| if v < D { x[v] } else { 0.0 })
        };
        let mut through = vec![[None; B]; edges.len()];
        parallel::for_each_piece(&mut through, |begin, through| {
            let edges = edges[begin..].iter().take(through.len());
            let points: Vec<[f64; P]> = edges.flat_map(|edge| (0..SAMPLES).map(|n| place(edge, n))).collect();
            let mut values = vec![[0.0]; points.len()];
            for (c, program) in self.of_place.iter().enumerate() {
                let Some(program) = program else { continue };
                program.eval_each(&points, &[t], &mut values);
                for (through, values) in through.iter_mut().zip(values.chunks_exact(SAMPLES)) {
                    let resistance: f64 = values.iter().map(|[value]| 1.0 / value).sum();
                    through[c] = Some(SAMPLES as f64 / resistance);
                }
            }
        });
        through
    }
}
