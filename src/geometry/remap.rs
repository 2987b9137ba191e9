use super::{Cells, DualCells, Mesh, check_finite, check_unfolded, padded};
use crate::error::Failure;
use crate::parallel::map;

mod parabolic;

/// Carries a nodal field from one mesh to another over the same lattice and domain and keeps its integral
///
/// ```text
/// A′ u′ = A u + Σ_faces s u_f
/// A, A′ = areas of the dual cell before and after,   s = the area that a face sweeps outward
/// ```
///
/// On a line areas are lengths, and a face sweeps the way that it goes.
///
/// Σ A u ([`DualCells::areas`]) is conserved to round-off, and constants stay exactly. u_f is the upwind value with van
/// Leer's limited slope: of second order in the mean where u is smooth, of first order at nodes on sides and at
/// extrema, and within the range of the neighbours. The nodes move from one mesh to the other along straight lines, in
/// so many steps that the faces of a dual cell sweep at most half of its area in each; meshes that differ by a time
/// step take one. On periodic axes the nodes of the first mesh are renumbered so that they start nearest to those of
/// the second in the mean: the meshes may have drifted apart by any number of periods.
///
/// # Errors
/// [`Failure::Folded`] or [`Failure::NonFinite`] where one of the meshes, or one on the way between them, has folded
/// cells or nodes that are not finite, and where values are not finite or so large that their integrals overflow.
///
/// # Example
/// ```
/// use driftmesh::geometry::{DualCells, Lattice, Mesh, remap};
/// let a = Mesh::uniform(Lattice::bounded([8, 8])?, [0.0, 0.0], [1.0, 1.0])?;
/// let b = a.moved(a.x().iter().map(|&[x, y]| [x * x, y]).collect())?;
/// let u: Vec<f64> = a.x().iter().map(|[x, _]| x.exp()).collect();
/// let v = remap(&a, &u, &b)?;
/// let sum = |mesh: &Mesh<2>, u: &[f64]| -> f64 {
///     DualCells::new(mesh).areas().iter().zip(u).map(|(a, u)| a * u).sum()
/// };
/// assert!((sum(&a, &u) - sum(&b, &v)).abs() < 1e-14);
/// # Ok::<(), driftmesh::Error>(())
/// ```
///
/// # Panics
/// If the two meshes have different lattices or `values` has not one value a node.
///
/// # Source
/// van Leer, *Towards the ultimate conservative difference scheme V* (1979), with faces that move through a field at
/// rest.
pub fn remap<const D: usize>(from: &Mesh<D>, values: &[f64], to: &Mesh<D>) -> Result<Vec<f64>, Failure>
where
    Mesh<D>: Cells<D>,
{
    let mut carried = remap_all(from, &[values], to, Remap::Limited)?;
    Ok(carried.swap_remove(0))
}

/// How a field is carried by [`remap_all`].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Remap {
    /// As [`remap`] does: second order where u is smooth, first at extrema, within the range of the neighbours.
    #[default]
    Limited,
    /// Parabolas along each axis, third order there also at extrema, which hardly lose height; within the range of all
    /// values or within these bounds.
    Parabolic(Option<[f64; 2]>),
}

/// Carries many fields as [`remap`] does, by limited slopes or by parabolas.
///
/// # Errors
/// As [`remap`].
///
/// # Panics
/// As [`remap`].
pub fn remap_all<const D: usize>(
    from: &Mesh<D>,
    fields: &[&[f64]],
    to: &Mesh<D>,
    how: Remap,
) -> Result<Vec<Vec<f64>>, Failure>
where
    Mesh<D>: Cells<D>,
{
    assert_eq!(from.lattice(), to.lattice(), "both meshes need the same lattice");
    assert!(fields.iter().all(|u| u.len() == from.lattice().len()), "one value a node");
    check_unfolded(from)?;
    check_unfolded(to)?;
    let (begin, mut fields) = counted_from_near(from, fields, to)?;
    let from = &begin;
    // the difference of the two largest numbers may overflow
    let ranges: Vec<[f64; 2]> = fields.iter().map(|u| range(u, [0.0; 2])).collect();
    let unit = |[low, high]: [f64; 2]| if high.max(-low) > LARGE { LARGE.recip() } else { 1.0 };
    for (u, range) in fields.iter_mut().zip(&ranges) {
        u.iter_mut().for_each(|u| *u *= unit(*range));
    }
    let bounds: Vec<[f64; 2]> = fields.iter().map(|u| within(u, how)).collect();
    let (mut cells, last) = (DualCells::new(from), DualCells::new(to));
    let steps = (largest_share(&cells, &last) / SHARE).ceil().max(1.0);
    let mut mesh = from.clone();
    for step in 1..=steps as usize {
        let next_mesh = if step as f64 == steps { to.clone() } else { between(from, to, step as f64 / steps)? };
        let next = DualCells::new(&next_mesh);
        let widths = (how != Remap::Limited).then(|| parabolic::Widths::of(&mesh, &cells));
        fields = map(&fields.into_iter().zip(&bounds).collect::<Vec<_>>(), |(u, bounds)| match &widths {
            None => stepped(from, u, &cells, &next),
            Some(widths) => parabolic::stepped(from.lattice(), u, [&cells, &next], widths, **bounds),
        });
        (mesh, cells) = (next_mesh, next);
    }
    let finished = |(u, range): (Vec<f64>, [f64; 2])| {
        check_finite(["the carried field"], to, u.as_chunks().0)?;
        Ok(match unit(range) {
            1.0 => u,
            unit => u.into_iter().map(|u| (u / unit).clamp(range[0], range[1])).collect(),
        })
    };
    fields.into_iter().zip(ranges).map(finished).collect()
}

/// The smallest and the largest of some values and of `known`.
fn range(u: &[f64], known: [f64; 2]) -> [f64; 2] {
    u.iter().fold(known, |[low, high], &u| [low.min(u), high.max(u)])
}

/// The bounds that a field is kept in: those given, but for what it has itself beyond them.
fn within(u: &[f64], how: Remap) -> [f64; 2] {
    match how {
        Remap::Parabolic(Some(bounds)) => range(u, bounds),
        _ => range(u, [f64::INFINITY, f64::NEG_INFINITY]),
    }
}

/// The same mesh and values with the nodes along periodic axes numbered from those nearest, in the mean, to the first
/// ones of `to`.
fn counted_from_near<const D: usize>(
    from: &Mesh<D>,
    fields: &[&[f64]],
    to: &Mesh<D>,
) -> Result<(Mesh<D>, Vec<Vec<f64>>), Failure> {
    let (there, to) = (from.parameters(), to.parameters());
    let (lattice, extent) = (there.lattice(), there.extent());
    let (nodes, periodic) = (lattice.nodes(), lattice.periodic());
    // by how many nodes the numbering is shifted
    let first: [i64; D] = std::array::from_fn(|d| {
        let ways = there.x().iter().zip(to.x()).map(|(a, b)| b[d] - a[d]);
        let cells = ways.sum::<f64>() / (there.x().len() as f64) / extent[d] * nodes[d] as f64;
        if periodic[d] { cells.round() as i64 } else { 0 }
    });
    if first == [0; D] {
        return Ok((from.clone(), fields.iter().map(|u| u.to_vec()).collect()));
    }
    let (mut x, mut order) = (Vec::with_capacity(lattice.len()), Vec::with_capacity(lattice.len()));
    for k in 0..lattice.len() {
        let node = lattice.node(k);
        // the node on each axis, and the turns that lead there
        let [places, turns] = [i64::rem_euclid, i64::div_euclid]
            .map(|part| std::array::from_fn::<i64, D, _>(|d| part(node[d] as i64 + first[d], nodes[d] as i64)));
        let k = lattice.index(places.map(|place| place as usize));
        x.push(std::array::from_fn(|d| there.x()[k][d] + turns[d] as f64 * extent[d]));
        order.push(k);
    }
    let fields = fields.iter().map(|u| order.iter().map(|&k| u[k]).collect()).collect();
    Ok((from.placed(x)?, fields))
}

/// Values larger than this are divided by it while they are carried, so that sums of their products do not overflow. It
/// is a power of two, so that they keep their bits.
const LARGE: f64 = (1_u128 << 127) as f64;
/// The largest area that the faces of a dual cell may sweep in one step, as a share of its area. Up to a half, limited
/// slopes and Heun's method keep values within the range of their neighbours.
const SHARE: f64 = 0.5;

/// The mesh at a share of the way from one to another.
fn between<const D: usize>(from: &Mesh<D>, to: &Mesh<D>, share: f64) -> Result<Mesh<D>, Failure> {
    let mesh = from.between(to, share)?;
    check_unfolded(&mesh)?;
    Ok(mesh)
}

/// The largest area that the faces of a dual cell sweep, as a share of the smaller of its two areas.
fn largest_share<const D: usize>(old: &DualCells<D>, new: &DualCells<D>) -> f64
where
    Mesh<D>: Cells<D>,
{
    let (swept, strides) = (old.swept(new), old.patch().padded_strides());
    let areas = old.areas().iter().zip(new.areas()).map(|(a, b)| a.min(*b));
    let shares = old
        .patch()
        .places()
        .zip(areas)
        .map(|(k, area)| (0..D).map(|d| swept[k][d].abs() + swept[k - strides[d]][d].abs()).sum::<f64>() / area);
    shares.fold(0.0, f64::max)
}

/// A u + Σ s u_f by Heun's method. Both stages use the same swept areas, so that constants stay.
fn stepped<const D: usize>(mesh: &Mesh<D>, values: &[f64], old: &DualCells<D>, new: &DualCells<D>) -> Vec<f64>
where
    Mesh<D>: Cells<D>,
{
    let swept = old.swept(new);
    let first = carried(mesh, values, old, &swept);
    let areas = || values.iter().zip(old.areas()).zip(new.areas());
    let middle: Vec<f64> = areas().zip(&first).map(|(((u, before), after), c)| (before * u + c) / after).collect();
    let second = carried(mesh, &middle, old, &swept);
    let changes = first.iter().zip(&second).map(|(a, b)| 0.5 * (a + b));
    areas().zip(changes).map(|(((u, before), after), change)| (before * u + change) / after).collect()
}

/// The amount of u that the faces of each dual cell bring in.
fn carried<const D: usize>(mesh: &Mesh<D>, values: &[f64], cells: &DualCells<D>, swept: &[[f64; D]]) -> Vec<f64> {
    let patch = cells.patch();
    let strides = patch.padded_strides();
    let nodal: Vec<[f64; 1]> = values.iter().map(|u| [*u]).collect();
    let u: Vec<f64> = padded(mesh.lattice(), &nodal, [[0.0]; D]).into_flattened();
    // beyond a bounded side the value of the side is repeated, which makes the slope there 0
    let mut slopes = vec![[0.0; D]; u.len()];
    for k in patch.places() {
        slopes[k] = strides.map(|s| limited(u[k] - u[k - s], u[k + s] - u[k]));
    }
    patch.wrap(&mut slopes);
    let through = |k: usize, d: usize| {
        let (s, above) = (swept[k][d], k + strides[d]);
        // a face that moves up takes in the value above it
        s * if s > 0.0 { u[above] - 0.5 * slopes[above][d] } else { u[k] + 0.5 * slopes[k][d] }
    };
    patch.places().map(|k| (0..D).map(|d| through(k, d) - through(k - strides[d], d)).sum()).collect()
}

/// Van Leer's limiter of two differences: their harmonic mean where they agree in sign, else 0.
fn limited(below: f64, above: f64) -> f64 {
    if (below > 0.0) == (above > 0.0) && below != 0.0 && above != 0.0 {
        below * (2.0 * (above / (below + above)))
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Lattice;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn bent(n: usize, periodic: bool, amount: f64) -> Mesh<2> {
        let mesh = Mesh::uniform(Lattice::new([n, n], [periodic; 2]).unwrap(), [0.0; 2], [1.0; 2]).unwrap();
        let wave = |s: f64| (2.0 * PI * s).sin();
        let shift = |a: f64, b: f64| amount * wave(a) * if periodic { (2.0 * PI * b).cos() } else { (PI * b).sin() };
        mesh.moved(mesh.x().iter().map(|&[x, y]| [x + shift(x, y), y - shift(y, x)]).collect()).unwrap()
    }

    fn sum(mesh: &Mesh<2>, u: &[f64]) -> f64 {
        DualCells::new(mesh).areas().iter().zip(u).map(|(area, u)| area * u).sum()
    }

    proptest! {
        /// The integral is kept to round-off and the range is not left, for any values, motion, sides and periodic
        /// axes.
        #[test]
        fn keeps_the_integral_and_the_range(
            n in 3_usize..14, periodic: bool, there in -0.1..0.1, back in -0.1..0.1, seed: u64,
        ) {
            let [from, to] = [there, back].map(|amount| bent(n, periodic, amount));
            let mut state = seed;
            let u: Vec<f64> = from.x().iter().map(|_| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                (state >> 11) as f64 / (1_u64 << 53) as f64
            }).collect();
            let v = remap(&from, &u, &to).unwrap();
            prop_assert!((sum(&from, &u) - sum(&to, &v)).abs() < 1e-13);
            let range = |u: &[f64]| [u.iter().copied().fold(1.0, f64::min), u.iter().copied().fold(0.0, f64::max)];
            let ([low, high], [new_low, new_high]) = (range(&u), range(&v));
            prop_assert!(new_low >= low - 1e-13 && new_high <= high + 1e-13, "[{low}, {high}] [{new_low}, {new_high}]");
            let constant = remap(&from, &vec![3.7; u.len()], &to).unwrap();
            prop_assert!(constant.iter().all(|u| (u - 3.7).abs() < 1e-13));
        }
    }

    /// Second order in the mean over a periodic box, for a smooth field and a motion of half the box's wave.
    #[test]
    fn smooth_fields_are_carried_with_second_order() {
        let error = |n: usize| {
            let [from, to] = [bent(n, true, -0.05), bent(n, true, 0.05)];
            let exact = |mesh: &Mesh<2>| -> Vec<f64> {
                mesh.x().iter().map(|[x, y]| (2.0 * PI * x).sin() * (2.0 * PI * y).cos()).collect()
            };
            let v = remap(&from, &exact(&from), &to).unwrap();
            v.iter().zip(exact(&to)).map(|(v, e)| (v - e).abs()).sum::<f64>() / v.len() as f64
        };
        let order = (error(32) / error(128)).log(4.0);
        assert!((1.7..2.3).contains(&order), "observed order {order:.2}, expected 2");
    }

    /// The largest numbers there are can be carried, too: the same bits, shifted.
    #[test]
    fn large_values_are_carried() {
        let [from, to] = [bent(8, false, -0.05), bent(8, false, 0.05)];
        let u: Vec<f64> = from.x().iter().map(|[x, y]| (5.0 * x).sin() * (3.0 * y).cos()).collect();
        let large = |u: &[f64]| u.iter().map(|u| u * 2.0_f64.powi(1000)).collect::<Vec<f64>>();
        assert_eq!(remap(&from, &large(&u), &to).unwrap(), large(&remap(&from, &u, &to).unwrap()));
        let most = vec![f64::MAX; u.len()];
        let carried = remap(&from, &most, &to).unwrap();
        assert!(carried.iter().all(|u| u / f64::MAX > 1.0 - 1e-14));
    }

    /// A periodic mesh that went around any number of times, and by whole cells, has the very values of the nodes that
    /// it meets.
    #[test]
    fn meshes_that_drifted_by_periods_are_carried_to() {
        let mesh = bent(16, true, 0.0);
        let wave = |mesh: &Mesh<2>| -> Vec<f64> {
            mesh.x().iter().map(|[x, y]| (2.0 * PI * x).sin() + (2.0 * PI * y).cos()).collect()
        };
        for shift in [[0.3125, 0.0], [0.5, 0.0625], [1.0, -0.75], [4.25, 2.5], [-7.6875, 0.0]] {
            let drifted = mesh.moved(mesh.x().iter().map(|x| [x[0] + shift[0], x[1] + shift[1]]).collect()).unwrap();
            for (from, to) in [(&mesh, &drifted), (&drifted, &mesh)] {
                let carried = remap(from, &wave(from), to).unwrap();
                let off = carried.iter().zip(wave(to)).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
                assert!(off < 1e-12, "off by {off:e} after {shift:?}");
            }
        }
    }

    /// On a line: the integral to round-off, second order in the mean, and periods.
    #[test]
    fn fields_of_lines_are_carried() {
        let bent = |n: usize, wraps: bool, amount: f64, shift: f64| {
            let mesh = Mesh::uniform(Lattice::new([n], [wraps]).unwrap(), [0.0], [1.0]).unwrap();
            mesh.moved(mesh.x().iter().map(|[x]| [x + amount * (2.0 * PI * x).sin() + shift]).collect()).unwrap()
        };
        let wave = |mesh: &Mesh<1>| -> Vec<f64> { mesh.x().iter().map(|[x]| (2.0 * PI * x).cos()).collect() };
        let sum =
            |mesh: &Mesh<1>, u: &[f64]| DualCells::new(mesh).areas().iter().zip(u).map(|(a, u)| a * u).sum::<f64>();
        for (wraps, shift) in [(false, 0.0), (true, 0.0), (true, -3.3)] {
            let error = |n: usize| {
                let (from, to) = (bent(n, wraps, -0.05, 0.0), bent(n, wraps, 0.05, shift));
                let v = remap(&from, &wave(&from), &to).unwrap();
                assert!((sum(&from, &wave(&from)) - sum(&to, &v)).abs() < 1e-13);
                v.iter().zip(wave(&to)).map(|(v, e)| (v - e).abs()).sum::<f64>() / v.len() as f64
            };
            let order = (error(32) / error(128)).log(4.0);
            assert!((1.5..2.5).contains(&order), "observed order {order:.2}, expected 2, after {shift}");
        }
    }

    /// Meshes that are no meshes are named instead of being carried to.
    #[test]
    fn a_folded_mesh_is_refused() {
        let from = bent(8, false, 0.0);
        let to = bent(8, false, 0.5);
        assert!(matches!(remap(&from, &vec![1.0; 81], &to), Err(Failure::Folded { .. })));
    }

    /// Fields that are carried by parabolas: a bump that goes a hundred times to another mesh and back keeps its peak
    /// but for a hundredth, its integral to round-off, and its range.
    #[test]
    fn a_bump_survives_the_journey() {
        let bump = |mesh: &Mesh<2>| -> Vec<f64> {
            mesh.x().iter().map(|[x, y]| (-((x - 0.5).powi(2) + (y - 0.5).powi(2)) / 0.02).exp()).collect()
        };
        let start = bent(40, false, 0.0);
        let mut meshes: Vec<Mesh<2>> = (0..100).map(|k| bent(40, false, 0.03 * (k as f64).sin())).collect();
        meshes.push(start.clone());
        let journey = |how: Remap| {
            let (mut mesh, mut u) = (start.clone(), bump(&start));
            for next in &meshes {
                u = remap_all(&mesh, &[&u], next, how).unwrap().swap_remove(0);
                mesh = next.clone();
            }
            let before = bump(&start);
            assert!((sum(&start, &before) - sum(&mesh, &u)).abs() < 1e-14);
            assert!(u.iter().all(|u| (0.0..=1.0).contains(u)));
            1.0 - u.iter().copied().fold(0.0, f64::max)
        };
        let [limited, parabolic] = [Remap::Limited, Remap::Parabolic(Some([0.0, 1.0]))].map(journey);
        println!("{limited:e} {parabolic:e}");
        assert!(parabolic <= 0.01 && parabolic < 0.2 * limited, "lost {parabolic:e}, limited {limited:e}");
    }
}
