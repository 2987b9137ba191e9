//! Conditions by side and a diffusivity for Poisson's equation, against manufactured and exact solutions.

use driftmesh::geometry::{Lattice, Mesh};
use driftmesh::laplacian::{Entry, Laplacian, Poisson, diffusion, stencils};
use driftmesh::study::{Kind, PoissonStudy, Solved, Source};

/// A study of n × n cells with more lines.
fn study(n: usize, lines: &str) -> driftmesh::Result<PoissonStudy> {
    let text = format!("[study]\nname = \"sides\"\nkind = \"poisson\"\n[grid]\ncells = [{n}, {n}]\n{lines}");
    PoissonStudy::from_source(&Source::new("sides.toml", text))
}

fn solved(n: usize, lines: &str) -> Solved {
    study(n, lines).unwrap_or_else(|error| panic!("{lines}: {error}")).solve().unwrap()
}

fn error(n: usize, lines: &str) -> f64 {
    solved(n, lines).error.unwrap().linf
}

fn refused(lines: &str) -> String {
    study(8, lines).expect_err(lines).to_string()
}

/// Meshes of equal, sheared and perturbed cells, and of a wavy channel and a quarter of a ring.
const DOMAINS: [(&str, &str); 5] = [
    ("equal", "[domain]\nx = [0, 1]\nbottom = \"0\"\ntop = \"1\"\n"),
    ("sheared", "[domain]\nx = [0, 1]\nbottom = \"0\"\ntop = \"1\"\ndistort = { shear = 0.1 }\n"),
    ("perturbed", "[domain]\nx = [0, 1]\nbottom = \"0\"\ntop = \"1\"\ndistort = { perturb = 0.2, seed = 3 }\n"),
    ("channel", "[domain]\nx = [0, 2]\nbottom = \"0.2*sin(pi*x)\"\ntop = \"1 + cos(pi*x)/4\"\n"),
    ("ring", "[domain]\nmap = { x = \"(1 + s)*cos(pi*r/2)\", y = \"(1 + s)*sin(pi*r/2)\" }\n"),
];

/// u = sin(x) eʸ has Δu = 0, and with D = 1 + x² + y the source 2x u_x + u_y.
const EXACT: &str = "[exact]\nu = \"sin(x)*exp(y)\"\n";

fn order(name: &str, lines: &str, cells: [usize; 2]) -> f64 {
    let [coarse, fine] = cells.map(|n| error(n, lines));
    let order = (coarse / fine).ln() / (cells[1] as f64 / cells[0] as f64).ln();
    println!("{name}: {coarse:.2e}, {fine:.2e}, order {order:.2}");
    order
}

/// A value, a flux that is given, Robin's condition and none, of which each has the values of u = sin(x) eʸ.
#[test]
fn conditions_by_side_are_of_second_order() {
    // on the square normals are those of the axes
    let sides = "[equation.boundary]\nleft = { flux = \"-cos(x)*exp(y)\" }\n\
                 right = { flux = \"(cos(x) + 2*sin(x))*exp(y) - 2*u\" }\n\
                 bottom = \"sin(x)\"\ntop = { flux = \"sin(x)*exp(y)\" }\n";
    for (name, domain) in &DOMAINS[..3] {
        let order = order(name, &format!("{domain}{EXACT}{sides}"), [20, 60]);
        assert!(order > 1.8, "{name}: {order}");
    }
    // along the circle x² + y² = 4 the normal is (x, y)/2, on y = 0 it is (0, −1), on x = 0 (−1, 0)
    let ring = "[equation.boundary]\nleft = \"sin(x)*exp(y)\"\n\
                right = { flux = \"(x*cos(x) + y*sin(x))*exp(y)/2 + u - sin(x)*exp(y)\" }\n\
                bottom = { flux = \"-sin(x)*exp(y)\" }\ntop = { flux = \"-cos(x)*exp(y)\" }\n";
    let order = order("ring", &format!("{}{EXACT}{ring}", DOMAINS[4].1), [20, 60]);
    assert!(order > 1.8, "ring: {order}");
}

#[test]
fn a_smooth_diffusivity_is_of_second_order() {
    for kind in ["mapped", "optimised"] {
        // the conservative form is for smooth meshes
        for (name, domain) in DOMAINS.into_iter().filter(|(name, _)| kind != "mapped" || *name != "perturbed") {
            let d = "[equation]\ndiffusivity = \"1 + x^2 + y\"\n[sides]\nneumann = [\"right\"]\n";
            let lines = format!("{domain}{EXACT}{d}[laplacian]\nkind = \"{kind}\"\n");
            let order = order(&format!("{kind} {name}"), &lines, [20, 60]);
            assert!(order > 1.7, "{kind} {name}: {order}");
        }
    }
}

/// D jumps from 1 to 100 at x = ½, a face between two nodes of an odd number of cells: u = cos(y) f with f = sinh(x) on
/// the left and the flux going on to the right, D f' the same on both sides.
#[test]
fn a_jump_of_diffusivity_at_faces_is_of_second_order() {
    let (s, c) = (0.5_f64.sinh(), 0.5_f64.cosh() / 100.0);
    let u = format!("if(x < 0.5, sinh(x), {s:?}*cosh(x - 0.5) + {c:?}*sinh(x - 0.5))*cos(y)");
    for (name, side) in [("values", ""), ("no flux", "[equation.boundary]\nbottom = \"no-flux\"\n")] {
        let lines = format!(
            "{}[exact]\nu = \"{u}\"\n[equation]\ndiffusivity = \"if(x < 0.5, 1, 100)\"\nsource = \"0\"\n{side}",
            DOMAINS[0].1
        );
        let order = order(&format!("jump, {name}"), &lines, [21, 63]);
        assert!(order > 1.8, "{name}: {order}");
    }
}

/// On a closed ring 1 < r < 2 between fluxes, u = log(r) + r² cos(2θ) up to a constant, which the mean fixes.
#[test]
fn fluxes_on_all_sides_fix_the_mean() {
    let ring = "[domain]\nmap = { x = \"(1 + s)*cos(2*pi*r)\", y = \"(1 + s)*sin(2*pi*r)\" }\nclosed = [false, true]\n";
    let exact = "[exact]\nu = \"log(x^2 + y^2)/2 + x^2 - y^2\"\n[equation]\nsource = \"0\"\n";
    let flux = |mean: &str| {
        format!(
            "{ring}{exact}{mean}[equation.boundary]\nleft = {{ flux = \"-1 - 2*(x^2 - y^2)\" }}\n\
             right = {{ flux = \"0.5 + (x^2 - y^2)\" }}\n"
        )
    };
    let order = order("ring of fluxes", &flux(""), [16, 48]);
    assert!(order > 1.8, "{order}");
    // without the exact solution the mean is what is asked for
    let lines = flux("mean = 7.0\n").replace("[exact]\nu = \"log(x^2 + y^2)/2 + x^2 - y^2\"\n", "");
    let by_mean = solved(16, &lines);
    let with = solved(16, &flux(""));
    let shifts: Vec<f64> = by_mean.u.iter().zip(&with.u).map(|(a, b)| a - b).collect();
    let [least, most] = [f64::min, f64::max].map(|f| shifts.iter().copied().fold(shifts[0], f));
    assert!((most - least).abs() < 1e-10 && (least - 7.0).abs() < 2.0, "{least} to {most}");

    let said = refused(&flux("").replace("0.5 + (x", "0.6 + (x"));
    // .1 too much over a circle of length 4π
    assert!(said.contains("defect of 1.3e0") && said.contains("nothing is steady"), "{said}");
    let square = format!("{}[equation]\nsource = \"1\"\nboundary = {{ flux = \"0.25\" }}\n", DOMAINS[0].1);
    let u = solved(10, &square).u;
    assert!(u.iter().sum::<f64>().abs() < 1.0);
    let said = refused(&square.replace("0.25", "0.3"));
    assert!(said.contains("1.2") && said.contains("equation.boundary"), "{said}");
    // Robin's condition determines the constant
    assert!(study(8, &square.replace("0.25", "0.3 - u")).is_ok());
}

#[test]
fn conditions_that_are_none_are_refused() {
    let square = DOMAINS[0].1;
    for (lines, words) in [
        ("boundary = { left = \"0\" }", vec!["not given for `right`", "left, right, bottom, top"]),
        ("boundary = { flux = \"u^2\" }", vec!["at most linear in u"]),
        ("boundary = \"0\"\ndiffusivity = \"x - 2\"", vec!["diffusivity is", "not positive"]),
        ("boundary = { flux = \"1\" }\nflux = \"1\"", vec!["equation.flux", "leave one of both out"]),
        ("boundary = \"0\"\nmean = inf", vec!["equation.mean", "finite"]),
    ] {
        let text = format!("{square}[equation]\nsource = \"0\"\n{lines}\n");
        let said = match study(8, &text) {
            Ok(study) => study.solve().map(|_| ()).expect_err(lines).to_string(),
            Err(error) => error.to_string(),
        };
        assert!(words.iter().all(|word| said.contains(word)), "{lines}: {said}");
    }
    let text = format!(
        "{square}[equation]\nsource = \"0\"\ndiffusivity = 2\nboundary = \"0\"\n[laplacian]\nkind = \"compact25\""
    );
    assert!(refused(&text).contains("mapped"));
    let text =
        format!("{square}[equation]\nsource = \"0\"\nboundary = {{ flux = \"0\" }}\n[sides]\nneumann = [\"left\"]");
    assert!(refused(&text).contains("leave one of both out"));
}

/// The entries are the equations that are solved, on every kind of side, with D and with 25 points.
#[test]
fn solutions_satisfy_the_entries() {
    let lattice = Lattice::bounded([9, 7]).unwrap();
    let mesh = Mesh::uniform(lattice, [0.0, 0.0], [1.0, 1.0]).unwrap();
    let mesh =
        mesh.moved(mesh.x().iter().map(|&[x, y]| [x + 0.1 * y * x, y + 0.05 * (3.0 * x).sin()]).collect()).unwrap();
    let of = |f: fn(f64, f64) -> f64| mesh.x().iter().map(|&[x, y]| f(x, y)).collect::<Vec<f64>>();
    let (source, side) = (of(|x, y| (3.0 * x).sin() + y), of(|x, y| x - y));
    let (robin, diffusivity) = (of(|x, _| -1.0 - x), of(|x, y| 1.0 + x * y));
    for kind in [Laplacian::Optimised, Laplacian::Mapped, Laplacian::Compact25] {
        let plain = stencils(&mesh, kind).unwrap();
        let weighted = match kind {
            Laplacian::Compact25 => plain,
            _ => diffusion(&mesh, &plain, |[x, y]| 1.0 + x * y).unwrap(),
        };
        let neumann = [[true, false], [true, false]];
        let all =
            Poisson { source: &source, side: &side, robin: &robin, diffusivity: &diffusivity, mean: 0.0, neumann };
        let u = all.solve(&mesh, &weighted).unwrap();
        let mut left: Vec<f64> = (0..u.len()).map(|k| if lattice.on_side(k) { -side[k] } else { 0.0 }).collect();
        for Entry { row, column, on_u, on_source } in all.entries(&mesh, &weighted).unwrap() {
            left[row] += on_u * u[column] - on_source * source[column];
        }
        assert!(left.iter().all(|v| v.abs() < 1e-10), "{kind:?}: {left:?}");
    }
}
