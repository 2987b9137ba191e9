//! Tables of `[data]` are functions in the formulas of every kind of study; and functions that give angles.

use driftmesh::formula::{Formula, Interpolation, Table, with_tables};
use driftmesh::study::{Begin, Source, Study};
use ndarray_npy::NpzReader;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn table(places: &[f64], values: &[f64], interpolation: Interpolation) -> Arc<Table> {
    Arc::new(Table::new("bed", vec![places.to_vec()], values.to_vec(), interpolation).unwrap())
}

/// Values and derivatives of monotone cubics as SciPy gives them: `python tests/python/monotone.py`.
#[test]
fn monotone_cubics_are_those_of_scipy() {
    let (places, values) = ([0.0, 1.0, 1.5, 3.0, 4.0, 6.0], [0.0, 0.5, 2.0, 2.0, -1.0, 3.0]);
    let table = table(&places, &values, Interpolation::Monotone);
    let known: [(f64, [f64; 4]); 6] = [
        (0.3, [0.04934482758620689, 0.32275862068965516, 1.013793103448276, -0.41379310344827536]),
        (1.2, [1.0950344827586205, 4.208275862068965, 4.220689655172414, -121.6551724137931]),
        (2.2, [2.0, 0.0, 0.0, 0.0]),
        (3.7, [-0.3520000000000012, -3.7799999999999976, 7.200000000000006, 36.0]),
        (5.1, [-0.15300000000000047, 1.9433333333333325, 2.866666666666666, 1.9999999999999996]),
        (6.0, [3.0, 5.333333333333333, 4.666666666666666, 1.9999999999999996]),
    ];
    with_tables(&[table], || {
        let mut formula = Formula::parse("bed(x)", &["x"]).unwrap();
        for order in 0..4 {
            for (x, expected) in &known {
                let found = formula.eval(&[*x]);
                let size = expected[order].abs().max(1.0);
                assert!((found - expected[order]).abs() < 1e-13 * size, "order {order} at {x}: {found}");
            }
            formula = formula.derivative(0).unwrap();
        }
        assert_eq!(formula.eval(&[0.3]), 0.0);
    });
}

/// By hand: bed is 2x up to 1 and 3 − x from there to 3; beyond it is 0, with no slope.
#[test]
fn derivatives_go_through_tables() {
    let table = table(&[0.0, 1.0, 3.0], &[0.0, 2.0, 0.0], Interpolation::Linear);
    with_tables(std::slice::from_ref(&table), || {
        let f = Formula::parse("u^2*bed(2*x)", &["x", "u"]).unwrap();
        let [by_x, by_u] = [0, 1].map(|variable| f.derivative(variable).unwrap());
        assert_eq!([f.eval(&[0.25, 3.0]), by_x.eval(&[0.25, 3.0]), by_u.eval(&[0.25, 3.0])], [9.0, 36.0, 6.0]);
        assert_eq!([f.eval(&[1.0, 3.0]), by_x.eval(&[1.0, 3.0]), by_u.eval(&[1.0, 3.0])], [9.0, -18.0, 6.0]);
        assert_eq!(table.outside(), [[None, None]]);
        assert_eq!([f.eval(&[2.0, 3.0]), by_x.eval(&[2.0, 3.0])], [0.0, 0.0]);
        assert_eq!(table.outside(), [[None, Some(4.0)]]);
        assert!(f.eval(&[f64::NAN, 1.0]).is_nan());
    });
    // a raster of (1 + 2x)(3 − y), which bilinear functions have exactly
    let plane = |x: f64, y: f64| (1.0 + 2.0 * x) * (3.0 - y);
    let places = [vec![0.0, 0.3, 1.0], vec![-1.0, 2.0]];
    let values = places[0].iter().flat_map(|x| places[1].iter().map(|y| plane(*x, *y))).collect();
    let raster = Arc::new(Table::new("h", places.to_vec(), values, Interpolation::Linear).unwrap());
    with_tables(&[raster], || {
        let f = Formula::parse("h(x, y)", &["x", "y"]).unwrap();
        let mixed = f.derivative(0).unwrap().derivative(1).unwrap();
        assert!((f.eval(&[0.6, 0.5]) - plane(0.6, 0.5)).abs() < 1e-14);
        assert!((mixed.eval(&[0.6, 0.5]) + 2.0).abs() < 1e-14);
        let mistake = Formula::parse("1 + h(x)", &["x", "y"]).unwrap_err();
        assert_eq!((mistake.at, mistake.message.as_str()), (4..8, "the table `h` takes 2 arguments, not 1"));
    });
    // outside of the scope nothing is left of the names
    assert!(Formula::parse("h(x, y)", &["x", "y"]).is_err());
}

fn angle(text: &str) -> Formula {
    Formula::parse(text, &["x", "y", "t"]).unwrap()
}

/// x = .3, y = −1.7, t = 2.5 unless said otherwise: known values, and derivatives by their rules on paper.
#[test]
fn angles_and_their_derivatives() {
    let at = [0.3, -1.7, 2.5];
    for (text, expected) in [
        ("asin(x)", 0.304692654015398),
        ("acos(x)", 1.266103672779499),
        ("atan(t)", 1.190289949682532),
        ("atan2(y, x)", -1.396124127786657),
        ("atan2(y, -x)", -1.745468525803136),
        ("atan2(0, -1)", std::f64::consts::PI),
        ("4*atan(1)", std::f64::consts::PI),
    ] {
        let found = angle(text).eval(&at);
        assert!((found - expected).abs() < 1e-14, "{text} is {found}");
    }
    // 1/√(1 − x²), 1/(1 + x²); the angle of (x, y) turns by x/(x² + y²) with y and by −y/(x² + y²) with x
    let (root, square) = (0.91_f64.sqrt(), 0.09 + 1.7 * 1.7);
    for (text, by, expected) in [
        ("asin(x)", 0, 1.0 / root),
        ("acos(x)", 0, -1.0 / root),
        ("atan(3*x)", 0, 3.0 / 1.81),
        ("atan2(y, x)", 1, 0.3 / square),
        ("atan2(y, x)", 0, 1.7 / square),
        ("atan2(x*t, 2)", 2, 0.6 / (4.0 + 0.75 * 0.75)),
    ] {
        let found = angle(text).derivative(by).unwrap().eval(&at);
        assert!((found - expected).abs() < 1e-14, "{text}: {found} for {expected}");
    }
    assert!(angle("asin(t)").eval(&at).is_nan());
}

/// A directory of its own for the files of a test.
fn directory(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("data-{name}"));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// A study of this text, whose files lie in a directory.
fn study(directory: &Path, text: &str) -> driftmesh::Result<Study> {
    let path = directory.join("study.toml");
    std::fs::write(&path, text).unwrap();
    let mut source = Source::read(&path)?;
    source.set("output.report=false")?;
    Study::from_source(&source)
}

/// Positions and unknowns at the end of a run; of a line without unknowns its mesh.
fn result(directory: &Path, text: &str) -> Vec<f64> {
    let study = study(directory, text).unwrap_or_else(|error| panic!("{text}: {error}"));
    let out = directory.join("out");
    let failure = study.run(&out, Begin::Anew, &mut []).unwrap();
    assert!(failure.is_none(), "{failure:?}");
    let mut numbers = Vec::new();
    if let Ok(file) = File::open(out.join("final.npz")) {
        let mut npz = NpzReader::new(file).unwrap();
        for name in npz.names().unwrap() {
            // what is no number of the solution is of another type
            if let Ok(array) = npz.by_name::<ndarray::OwnedRepr<f64>, ndarray::IxDyn>(&name) {
                numbers.extend(array);
            }
        }
    } else {
        let summary: serde_json::Value =
            serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap();
        numbers.extend(summary["mesh"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()));
    }
    assert!(numbers.len() > 10);
    numbers
}

const LINE: &str = r#"
[study]
name = "line"
kind = "moving-mesh"
[domain]
lower = [0.0]
upper = [1.0]
[grid]
cells = [20]
DATA
[time]
start = 0.0
end = 0.2
step = 0.01
[pde]
kind = "formula"
unknowns = ["u"]
flux = { u = ["u^2/2"] }
diffusivity = { u = "0.02*STIFF(u^2)" }
source = { u = "STIFF(x)*u - TIME(t)" }
initial = { u = "0.3*sin(2*pi*x)" }
boundary = { u = { left = "TIME(t)", right = { flux = "TIME(t) - u" } } }
"#;
const PLANE: &str = r#"
[study]
name = "plane"
kind = "moving-mesh"
[grid]
cells = [8, 8]
DATA
[time]
start = 0.0
end = 0.05
step = 0.01
[pde]
kind = "formula"
unknowns = ["u"]
diffusivity = { u = "BED(x, y)" }
initial = { u = "BED(y, x)" }
boundary = { u = "no-flux" }
[monitor]
kind = "auto"
of = "u*BED(x, y)"
"#;
const POISSON: &str = r#"
[study]
name = "poisson"
kind = "poisson"
DATA
[domain]
x = [0.0, 1.0]
bottom = "0"
top = "STIFF(x)"
[grid]
cells = [8, 8]
[equation]
source = "BED(x, y)"
boundary = "STIFF(x)"
"#;
const FRONT: &str = r#"
[study]
name = "front"
kind = "stefan"
DATA
[domain]
x = [0.0, 1.0]
bottom = "0"
top = "2"
front = "1"
[grid]
cells = [6, 6, 6]
[phase.lower]
initial = "1 - y"
boundary = "1 + TIME(t)"
[phase.upper]
initial = "1 - y"
boundary = "-1"
[time]
end = 0.05
step = 0.01
"#;
const EVEN: &str = r#"
[study]
name = "even"
kind = "equidistribution"
DATA
[grid]
cells = [20]
[density]
kind = "formula"
value = "STIFF(x)"
"#;

/// The same study with formulas in place of its tables has the same result, to rounding.
#[test]
fn every_kind_of_study_takes_tables() {
    let directory = directory("kinds");
    // 1 + x, by a kink at .3 that is none; a kink at .04; (1 + 2x)(3 − y)
    std::fs::write(directory.join("stiff.csv"), "# measured\nx, value\n-3, -2\n0.3, 1.3\n4, 5\n").unwrap();
    std::fs::write(directory.join("time.csv"), "0;0\n0.04;0.2\n1;0.2\n").unwrap();
    std::fs::write(directory.join("bed.csv"), "3,2,1\n6,4,2\n9,6,3\n").unwrap();
    let data = "[data]\nstiff = \"stiff.csv\"\ntime_of = \"time.csv\"\n\
                bed = { file = \"bed.csv\", lower = [0.0, 0.0], upper = [1.0, 2.0] }";
    for (kind, text) in [("line", LINE), ("plane", PLANE), ("poisson", POISSON), ("front", FRONT), ("even", EVEN)] {
        let named = text.replace("DATA", data).replace("STIFF", "stiff").replace("TIME", "time_of");
        let by_tables = result(&directory, &named.replace("BED", "bed"));
        let mut written = text.replace("DATA", "");
        for (call, formula) in [
            ("STIFF(u^2)", "(1 + u^2)"),
            ("STIFF(x)", "(1 + x)"),
            ("TIME(t)", "(5*min(t, 0.04))"),
            ("BED(x, y)", "((1 + 2*x)*(3 - y))"),
            ("BED(y, x)", "((1 + 2*y)*(3 - x))"),
        ] {
            written = written.replace(call, formula);
        }
        let by_formulas = result(&directory, &written);
        let off = by_tables.iter().zip(&by_formulas).fold(0.0_f64, |off, (a, b)| off.max((a - b).abs()));
        assert!(by_tables.len() == by_formulas.len() && off < 1e-9, "{kind}: {off:e}");
    }
}

/// One line each: what is wrong, and what to do.
#[test]
fn tables_that_are_none_are_refused() {
    let directory = directory("refused");
    let write = |name: &str, text: &str| std::fs::write(directory.join(name), text).unwrap();
    write("good.csv", "0,1\n1,2\n");
    write("words.csv", "t,value\n0,1\n1,many\n");
    write("falls.csv", "0,1\n2,2\n1,3\n");
    write("nan.csv", "0,1\n1,nan\n");
    write("wide.csv", "0,1,2\n1,2,3\n");
    write("ragged.csv", "0,1\n1,2\n3\n");
    write("empty.csv", "t,value\n");
    for (data, words) in [
        ("bed = \"none.csv\"", ["`data.bed`", "cannot be read"]),
        ("bed = \".\"", ["`data.bed`", "is no file"]),
        ("bed = \"words.csv\"", ["`data.bed`", "\"many\" in line 3"]),
        ("bed = \"falls.csv\"", ["places must rise", "2 is followed by 1"]),
        ("bed = \"nan.csv\"", ["`data.bed`", "value 2 is NaN"]),
        ("bed = \"wide.csv\"", ["3 numbers", "give both"]),
        ("bed = { file = \"good.csv\", lower = 0 }", ["one of `lower` and `upper`", "give both"]),
        ("bed = { file = \"wide.csv\", lower = 0, upper = 1 }", ["raster", "two numbers in `lower`"]),
        ("bed = { file = \"good.csv\", lower = [0, 1], upper = [1, 0] }", ["`lower` 1.0 to `upper` 0.0", "above"]),
        ("bed = \"ragged.csv\"", ["1 numbers in row 3", "2 in the first"]),
        ("bed = \"empty.csv\"", ["`data.bed`", "has no numbers"]),
        ("sin = \"good.csv\"", ["has the name of a function", "take another name"]),
        ("x = \"good.csv\"", ["has the name of a variable", "take another name"]),
        ("u = \"good.csv\"", ["`u` has the name of a table of [data]", "take another name"]),
        ("bed = { file = \"good.csv\", order = 2 }", ["`data.bed.order` is 2", "must be 1"]),
        ("bed = { file = \"good.csv\", content = \"0\" }", ["`data.bed.content`", "another one now"]),
        ("bed = 3", ["invalid type", "the name of a file"]),
    ] {
        let text = LINE.replace("DATA", &format!("[data]\n{data}")).replace("STIFF", "").replace("TIME", "");
        let said = study(&directory, &text).expect_err(data).to_string();
        assert!(words.iter().all(|word| said.contains(word)) && said.contains("study.toml"), "{data}: {said}");
    }
    let text = LINE.replace("DATA", "[data]\nbed = \"good.csv\"").replace("STIFF", "bet").replace("TIME", "");
    let said = study(&directory, &text).unwrap_err().to_string();
    assert!(said.contains("unknown name `bet`"), "{said}");
}

/// A run goes on with its tables, also where they lie elsewhere now, and not with others.
#[test]
fn a_run_does_not_go_on_with_another_table() {
    let directory = directory("resumed");
    let text = LINE.replace("DATA", "[data]\nstiff = \"a.csv\"\npath = \"b.csv\"");
    let text = text.replace("STIFF", "stiff").replace("TIME", "path");
    std::fs::write(directory.join("a.csv"), "-3,-2\n4,5\n").unwrap();
    std::fs::write(directory.join("b.csv"), "0,0\n0.1,0.2\n").unwrap();
    let out = directory.join("out");
    study(&directory, &text).unwrap().run(&out, Begin::Anew, &mut []).unwrap();
    let summary = std::fs::read_to_string(out.join("summary.json")).unwrap();
    assert!(summary.contains("`data.path` reaches from 0.0 to 0.1, and formulas asked for 0.2"), "{summary}");

    let elsewhere = directory.join("elsewhere");
    std::fs::create_dir_all(&elsewhere).unwrap();
    for file in ["a.csv", "b.csv"] {
        std::fs::copy(directory.join(file), elsewhere.join(file)).unwrap();
    }
    let longer = text.replace("end = 0.2", "end = 0.3");
    let failure = study(&elsewhere, &longer).unwrap().run(&out, Begin::Resumed, &mut []).unwrap();
    assert!(failure.is_none(), "{failure:?}");

    std::fs::write(elsewhere.join("b.csv"), "0,0\n0.1,0.3\n").unwrap();
    let longest = text.replace("end = 0.2", "end = 0.4");
    let refused = study(&elsewhere, &longest).unwrap().run(&out, Begin::Resumed, &mut []).unwrap_err().to_string();
    assert!(refused.contains("data.path.content"), "{refused}");
}
