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

fn main() {
    let ring = |[a, b]: [f64; 2]| format!("tanh(30*((x - {a:?})^2 + (y - {b:?})^2 - 1/8))").replace("- -", "+ ");
    let text = CENTRES.map(ring).join(" + ");
    let u = Formula::parse(&text, &["x", "y"]).unwrap();
    let gradient = [0, 1].map(|v| u.derivative(v).unwrap());
    let program = Program::<2, 3>::new([&u, &gradient[0], &gradient[1]]);
    let n = 300;
    let points: Vec<[f64; 2]> =
        (0..n * n).map(|k| [k % n, k / n].map(|i| 2.0 * i as f64 / (n - 1) as f64 - 1.0)).collect();

    let single = |points: &[[f64; 2]], out: &mut [[f64; 3]]| {
        points.iter().zip(out).for_each(|(x, out)| *out = [u.eval(x), gradient[0].eval(x), gradient[1].eval(x)]);
    };
    let batch = |points: &[[f64; 2]], out: &mut [[f64; 3]]| program.eval_each(points, &[], out);
    type Work<'a> = &'a dyn Fn(&[[f64; 2]], &mut [[f64; 3]]);
    let works: [(&str, Work); 3] =
        [("by hand", &|points, out| by_hand(points, out)), ("Program", &batch), ("Formula::eval", &single)];

    // in turns, so that a change of the clock's rate meets all of them
    let mut best = [f64::INFINITY; 3];
    let mut out = vec![vec![[0.0; 3]; points.len()]; 3];
    for _ in 0..20 {
        for (((_, work), best), out) in works.iter().zip(&mut best).zip(&mut out) {
            let start = Instant::now();
            work(black_box(&points), black_box(out));
            *best = best.min(start.elapsed().as_secs_f64() * 1e9 / points.len() as f64);
        }
    }
    let errors = out[1].as_flattened().iter().zip(out[0].as_flattened()).map(|(a, b)| (a - b).abs());
    println!("five rings with gradient at {} points, largest difference {:.1e}", n * n, errors.fold(0.0, f64::max));
    for ((name, _), time) in works.iter().zip(best) {
        println!("{name:<14} {time:6.1} ns a point, {:.2} of that by hand", time / best[0]);
    }
}
