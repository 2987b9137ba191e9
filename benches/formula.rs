//! Five rings and their gradient at many points: seconds of the compiled formulas over those of code written by hand.

use driftmesh::formula::{Formula, Program};
use std::hint::black_box;
use std::time::Instant;

const CENTRES: [[f64; 2]; 5] = [[0.0, 0.0], [0.5, 0.5], [0.5, -0.5], [-0.5, 0.5], [-0.5, -0.5]];

fn by_hand(points: &[[f64; 2]], out: &mut [[f64; 3]]) {
    for ([x, y], out) in points.iter().zip(out) {
        *out = [0.0; 3];
        for [a, b] in CENTRES {
            let (dx, dy) = (x - a, y - b);
            let wave = (30.0 * (dx * dx + dy * dy - 0.125)).tanh();
            let slope = 60.0 * (1.0 - wave * wave);
            *out = [out[0] + wave, out[1] + slope * dx, out[2] + slope * dy];
        }
    }
}

/// The shortest of several times, in nanoseconds a point.
fn best(points: &[[f64; 2]], mut work: impl FnMut(&[[f64; 2]], &mut [[f64; 3]])) -> (f64, Vec<[f64; 3]>) {
    let mut out = vec![[0.0; 3]; points.len()];
    let times = (0..15).map(|_| {
        let start = Instant::now();
        work(black_box(points), black_box(&mut out));
        start.elapsed().as_secs_f64()
    });
    (times.fold(f64::INFINITY, f64::min) * 1e9 / points.len() as f64, out)
}

fn main() {
    let ring = |[a, b]: [f64; 2]| format!("tanh(30*((x - {a:?})^2 + (y - {b:?})^2 - 1/8))").replace("- -", "+ ");
    let text = CENTRES.map(ring).join(" + ");
    let u = Formula::parse(&text, &["x", "y"]).unwrap();
    let gradient = [0, 1].map(|v| u.derivative(v).unwrap());
    let program = Program::<2, 3>::new([&u, &gradient[0], &gradient[1]]);
    let n = 300;
    let points: Vec<[f64; 2]> =
        (0..n * n).map(|k| [k % n, k / n].map(|i| 2.0 * i as f64 / (n - 1) as f64 - 1.0)).collect();

    let (hand, expected) = best(&points, by_hand);
    let (batch, found) = best(&points, |points, out| program.eval_each(points, &[], out));
    let (single, _) = best(&points, |points, out| {
        points.iter().zip(out).for_each(|(x, out)| *out = [u.eval(x), gradient[0].eval(x), gradient[1].eval(x)]);
    });
    let errors = found.as_flattened().iter().zip(expected.as_flattened()).map(|(a, b)| (a - b).abs());
    println!("five rings with gradient at {} points, largest difference {:.1e}", n * n, errors.fold(0.0, f64::max));
    println!("by hand        {hand:6.1} ns a point");
    println!("Program        {batch:6.1} ns a point, {:.2} of it", batch / hand);
    println!("Formula::eval  {single:6.1} ns a point, {:.2} of it", single / hand);
}
