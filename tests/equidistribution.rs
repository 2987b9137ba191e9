//! Studies of kind `equidistribution`: what they leave, and what they refuse.

use driftmesh::study::{Begin, EquidistributionStudy, Finished, Kind, LineRun, Source, Study};
use driftmesh::{Error, Failure};
use serde_json::Value;
use std::path::Path;

fn source(name: &str) -> Source {
    Source::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("studies").join(format!("{name}.toml"))).unwrap()
}

/// Runs a study of `studies/` with settings on top, and reads its summary.
fn run(name: &str, set: &[&str]) -> (Finished<LineRun>, Value) {
    let mut source = source(name);
    set.iter().for_each(|assignment| source.set(assignment).unwrap());
    let Study::Equidistribution(study) = Study::from_source(&source).unwrap() else {
        panic!("{name} is of another kind")
    };
    let out = tempfile::tempdir().unwrap();
    let finished = study.run(&out.path().join("run"), Begin::Anew, &mut []).unwrap();
    let at = |file: &str| out.path().join("run").join(file);
    let files = ["study.toml", "history.csv", "final.npz", "mesh.png", "mesh.svg"];
    files.into_iter().for_each(|file| assert!(at(file).is_file(), "{name} leaves no {file}"));
    // what it leaves runs again
    let again = Source::read(&at("study.toml")).unwrap();
    assert_eq!(EquidistributionStudy::from_source(&again).unwrap().to_toml(), study.to_toml());
    let summary = serde_json::from_str(&std::fs::read_to_string(at("summary.json")).unwrap()).unwrap();
    (finished, summary)
}

#[test]
fn summaries_have_what_the_contract_says() {
    let (_, summary) = run("table-8-1-nonlinear", &[]);
    assert_eq!(summary["status"], "completed");
    assert_eq!(summary["iterations"].as_array().unwrap().len(), 11);
    let second = &summary["iterations"][2];
    assert_eq!(second["n"], 2);
    assert!((second["largest_jump"].as_f64().unwrap() - 0.052048).abs() < 1e-6);
    for key in ["error_linf", "interpolation_error", "linear_solves"] {
        assert!(second[key].is_number(), "{key}");
    }
    assert!((summary["rate"]["predicted"].as_f64().unwrap() - 0.85207).abs() < 1e-5);
    assert_eq!(summary["rate"]["stride"], 2);
    assert!(summary["rate"]["observed"].is_number() && summary["rate"]["bound"].is_number());
    // no tolerance was asked for
    assert!(summary["converged"].is_null() && summary["iterations_to_tolerance"].is_null());
    assert_eq!(summary["mesh"].as_array().unwrap().len(), 101);
    let (_, summary) =
        run("table-8-1-nonlinear", &["stop.tolerance=1e-10", "stop.iterations=500", "density.of=\"x^3/3\""]);
    assert_eq!(summary["converged"], true);
    assert_eq!(
        summary["iterations_to_tolerance"].as_u64().unwrap() as usize,
        summary["iterations"].as_array().unwrap().len() - 1
    );
}

/// The continuous mesh is met to second order, and without subdomains there are no iterations.
#[test]
fn one_domain() {
    let error = |cells: &str| run("boundary-layer", &[cells]).1["quality"]["error_linf"].as_f64().unwrap();
    let [coarse, fine] = [error("grid.cells=[80]"), error("grid.cells=[160]")];
    assert!((coarse / fine).log2() > 1.9, "{coarse:e} {fine:e}");
    let (_, summary) = run("boundary-layer", &["equidistribution.face_density=exact", "domain.lower=[-1.0]"]);
    assert!(summary["quality"]["error_linf"].as_f64().unwrap() < 1e-12);
    assert_eq!(summary["mesh"][0], -1.0);
    assert_eq!(summary["iterations"], serde_json::json!([]));
    // a long line begins with short ones
    let (_, summary) = run("boundary-layer", &["grid.cells=[20001]"]);
    assert!(summary["quality"]["error_linf"].as_f64().unwrap() < 1e-7);
    assert!(summary["work"]["linear_solves"].as_u64().unwrap() <= 6, "{}", summary["work"]);
}

/// A line of any length and place converges alike; what the cells do not see is told.
#[test]
fn other_lines() {
    let count = |set: &[&str]| {
        let begin = ["stop.tolerance=1e-10", "stop.iterations=500", "density.kind=formula"];
        run("table-8-1-nonlinear", &[&begin, set].concat()).1["iterations_to_tolerance"].as_u64().unwrap()
    };
    let unit = count(&["density.value=\"x^2 + 1\""]);
    assert_eq!(unit, 259);
    let long = ["domain.lower=[-1e6]", "domain.upper=[1e6]", "density.value=\"((x + 1e6)/2e6)^2 + 1\""];
    let short = ["domain.upper=[1e-6]", "density.value=\"(1e6*x)^2 + 1\""];
    assert!(count(&long).abs_diff(unit) <= 1 && count(&short).abs_diff(unit) <= 1);
    // a layer that lies between two nodes of equal cells has its share of the nodes all the same
    let (_, summary) = run("boundary-layer", &["density.of=\"tanh(2000*(x - 0.3125))\""]);
    let mesh = summary["mesh"].as_array().unwrap();
    let within = mesh.iter().filter(|x| (x.as_f64().unwrap() - 0.3125).abs() < 2e-3).count();
    assert!(3 * within > mesh.len(), "{within} of {}", mesh.len());
    let nothing = serde_json::json!([]);
    assert_eq!([&summary, &run("boundary-layer", &[]).1].map(|summary| &summary["warnings"]), [&nothing; 2]);
}

/// What is said of an iteration that misses its tolerance is true: one that swings is not said to contract, whenever it
/// ends; rounding is named; the remedy is one of the method.
#[test]
fn advice_is_true() {
    let said = |study: &str, set: &[&str]| {
        let (finished, summary) = run(study, set);
        (finished.failure.unwrap().to_string(), summary["failure"]["help"].as_str().unwrap().to_string())
    };
    for count in [100, 101, 150, 601, 1000, 1001] {
        let (said, _) = said("schwarz-not-converged", &[&format!("stop.iterations={count}")]);
        assert!(said.contains("need not converge") && !said.contains("more would do"), "{said}");
    }
    let square = ["stop.tolerance=1e-10", "density.kind=formula", "density.value=\"x^2 + 1\""];
    let (slow, _) = said("table-8-1-nonlinear", &[&square[..], &["stop.iterations=100"]].concat());
    assert!(slow.contains("contracts by 0.852") && slow.contains("about 1"), "{slow}");
    let (rounding, help) =
        said("table-8-1-nonlinear", &[&square[1..], &["stop.tolerance=1e-20", "stop.iterations=500"]].concat());
    assert!(rounding.contains("that is rounding") && help.starts_with("raise stop.tolerance (now "), "{rounding}");
    let (_, help) = said("schwarz-robin", &[&square[..], &["schwarz.subdomains=2", "schwarz.robin=0.01"]].concat());
    assert!(help.contains("lagged") && !help.contains("overlap"), "{help}");
}

/// Given ends stay to the last bit, also where M falls to 1e-11 of its largest there.
#[test]
fn ends_stay() {
    for value in ["exp(-100*(x-0.5)^2)", "1e-12+exp(-100*(x-0.5)^2)", "1+1e10*exp(-1000*(x-0.5)^2)", "exp(-20*x)"] {
        let set = format!("density={{ kind = \"formula\", value = \"{value}\" }}");
        let set = [set.as_str(), "schwarz.overlap=[0.45, 0.55]", "stop.tolerance=1e-10", "stop.iterations=300"];
        let mesh = run("table-8-1-nonlinear", &set).1["mesh"].clone();
        assert_eq!((mesh[0].as_f64().unwrap(), mesh[100].as_f64().unwrap()), (0.0, 1.0), "{value}");
    }
    run("moving-front-1d", &["density={ kind = \"arclength\", of = \"tanh(30*(x - 0.3 - t))\" }"]);
}

/// The quality is against the mesh that is, however thin the layer.
#[test]
fn thin_layers() {
    for k in ["1e3", "1e4"] {
        let set = format!("density={{ kind = \"arclength\", of = \"tanh({k}*(x-0.3012345))\" }}");
        let summary = run("boundary-layer", &[&set, "equidistribution.face_density=\"exact\""]).1;
        let quality = &summary["quality"];
        let warned = summary["warnings"].as_array().unwrap();
        assert!(quality["error_linf"].as_f64().unwrap() < 1e-10 && warned.is_empty(), "{summary}");
        assert!((quality["equidistribution"].as_f64().unwrap() - 1.0).abs() < 1e-6, "{quality}");
    }
    // a hole in M between the nodes is found in the end
    let hole = "density={ kind = \"formula\", value = \"if(abs(x - 0.31415926) < 1e-4, -1, 1)\" }";
    let (finished, summary) = run("boundary-layer", &[hole]);
    assert!(finished.failure.unwrap().to_string().contains("M is -1e0 at x = 0.314") && summary["status"] == "failed");
}

#[test]
fn subdomains() {
    for (coarse, expected) in [("integral", 2), ("galerkin", 9)] {
        let (_, summary) = run("schwarz-coarse", &[&format!("schwarz.coarse={coarse}")]);
        assert!(summary["iterations_to_tolerance"].as_u64().unwrap().abs_diff(expected) <= 1, "{coarse}");
    }
    let (_, summary) = run("schwarz-robin", &[]);
    assert!(summary["iterations_to_tolerance"].as_u64().unwrap() <= 20);
    // every way to divide the same line
    let count = |set: &[&str]| run("table-8-1-nonlinear", set).1["iterations_to_tolerance"].clone();
    let until = ["stop.tolerance=1e-8", "stop.iterations=500"];
    let halves = ["--", "schwarz.method=optimized"];
    let by = |replaced: &str, more: &[&str]| {
        let mut text =
            std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("studies/table-8-1-nonlinear.toml"))
                .unwrap();
        text = text.replace("overlap = [0.48, 0.52]", replaced);
        let mut source = Source::new("divided", text);
        until.iter().chain(more).for_each(|assignment| source.set(assignment).unwrap());
        let study = EquidistributionStudy::from_source(&source).unwrap();
        study.decomposition().unwrap().unwrap().1
    };
    assert_eq!(by("overlap = [0.48, 0.52]", &[]), by("intervals = [[0.0, 0.52], [0.48, 1.0]]", &[]));
    assert_eq!(by("overlap = [0.48, 0.52]", &[]), by("subdomains = 2\noverlap_cells = 4", &[]));
    assert_eq!(by("cut = 0.5", &halves[1..]), by("subdomains = 2", &halves[1..]));
    assert_eq!(by("cuts = [0.25, 0.5, 0.75]", &halves[1..]), by("subdomains = 4", &halves[1..]));
    assert!(count(&until).as_u64().unwrap() > 100);
}

/// Theorem 3.4 says that it converges.
#[test]
fn what_does_not_converge_is_no_success() {
    let (finished, summary) = run("schwarz-not-converged", &[]);
    assert_eq!(summary["status"], "not-converged");
    assert_eq!(summary["converged"], false);
    assert!(summary["iterations_to_tolerance"].is_null());
    assert_eq!(summary["failure"]["kind"], "not-converged");
    let Some(Error::Failed { failure: failure @ Failure::NotConverged { iterations: 600, .. }, .. }) = finished.failure
    else {
        panic!("{:?}", finished.failure)
    };
    assert!(failure.to_string().contains("the linearised iteration need not converge"), "{failure}");
    // others help here, this one helps always
    assert_eq!(summary["failure"]["help"], "set schwarz.linearized (now true) to false");
    for cure in [
        "schwarz.linearized=false",
        "schwarz.sweep=alternating",
        "schwarz.coarse=galerkin",
        "schwarz.overlap=[0.4, 0.6]",
    ] {
        assert_eq!(run("schwarz-not-converged", &[cure]).1["status"], "completed", "{cure}");
    }
    // one that is only slow says how slow
    let (finished, _) = run("table-8-1-nonlinear", &["stop.tolerance=1e-10", "stop.iterations=100"]);
    let told = finished.failure.unwrap().to_string();
    let more: f64 = told.split("about ").nth(1).and_then(|t| t.split(' ').next()).unwrap().parse().unwrap();
    assert!((100.0 + more - 276.0).abs() < 10.0, "{told}");
}

/// Figure 8.6.
#[test]
fn in_time() {
    let (finished, summary) = run("moving-front-1d", &["output.frames.every=1"]);
    let per = &summary["iterations_per_step"];
    assert!((per["mean"].as_f64().unwrap() - 75.5).abs() < 0.5, "{per}");
    assert_eq!(finished.run.evolution.meshes.len(), 101);
    for (n, expected) in [(0, [0.4031, 0.4379]), (50, [0.4465, 0.4617]), (100, [0.4967, 0.5032])] {
        let mesh = &finished.run.evolution.meshes[n];
        assert!((mesh[45] - expected[0]).abs() < 6e-5 && (mesh[55] - expected[1]).abs() < 6e-5, "{n}");
    }
    assert!(finished.run.evolution.meshes.iter().all(|mesh| mesh.windows(2).all(|x| x[1] > x[0])));
    // the same mesh without subdomains
    let text =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("studies/moving-front-1d.toml")).unwrap();
    let (before, after) = (text.find("[schwarz]").unwrap(), text.find("[time]").unwrap());
    let study =
        EquidistributionStudy::from_source(&Source::new("whole", format!("{}{}", &text[..before], &text[after..])))
            .unwrap();
    let (whole, failure) = study.compute().unwrap();
    assert!(failure.is_none());
    let off = whole
        .evolution
        .mesh()
        .iter()
        .zip(finished.run.evolution.mesh())
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert!(off < 1e-7, "{off:e}");
    // a step that misses its tolerance names itself
    let (finished, _) = run("moving-front-1d", &["stop.iterations=70"]);
    let told = finished.failure.unwrap().to_string();
    assert!(told.contains("step ") && told.contains("not converged"), "{told}");
}

/// Every mistake is one error that names its place and the remedy.
#[test]
fn bad_settings_are_refused() {
    const BEGIN: &str = "[study]\nname = \"bad\"\nkind = \"equidistribution\"\n[grid]\ncells = [100]\n";
    const M: &str = "[density]\nkind = \"formula\"\nvalue = \"x^2 + 1\"\n";
    let m = |value: &str| format!("[density]\nkind = \"formula\"\nvalue = \"{value}\"\n");
    let schwarz = |table: &str| format!("{M}[schwarz]\n{table}\n");
    let cases: Vec<(String, &[&str])> = vec![
        (m("x - 0.5"), &["density.value", "M is -5.0e-1 at x = 0", "above 0"]),
        (m("(x - 1/3)^2"), &["density.value", "at x = 0.3333", "above 0"]),
        (m("1/(x - 0.3)^2"), &["density.value", "at x = 0.3"]),
        (m("1 + sqrt(x - 0.25)"), &["density.value", "NaN at x = 0"]),
        (m("1 + y"), &["density.value", "unknown name `y`"]),
        ("[density]\nkind = \"arc\"\n".into(), &["unknown name `arc`", "arclength"]),
        (format!("{M}[domain]\nlower = [1.0]\nupper = [1.0]\n"), &["domain.upper", "above domain.lower"]),
        (schwarz("overlap = [0.55, 0.45]"), &["schwarz.overlap", "the first number is the lower one"]),
        (schwarz("overlap = [0.5, 0.5]"), &["schwarz.overlap", "would never learn of each other", "optimized"]),
        (schwarz("overlap = [0.455, 0.55]"), &["schwarz.overlap[0]", "0.45 and 0.46"]),
        (schwarz("overlap = [-0.1, 0.55]"), &["from 0 to 1"]),
        (schwarz("overlap = [0.45, 1.0]"), &["go from left to right, none inside another"]),
        (schwarz(""), &["schwarz.overlap", "exactly one of"]),
        (schwarz("overlap = [0.4, 0.6]\ncut = 0.5"), &["schwarz.cut", "overlap is too"]),
        (schwarz("cut = 0.5"), &["do not overlap", "optimized"]),
        (schwarz("intervals = [[0.0, 0.4], [0.5, 1.0]]"), &["nothing covers the line"]),
        (schwarz("intervals = [[0.0, 0.6], [0.3, 0.9], [0.5, 1.0]]"), &["are no neighbours"]),
        (schwarz("intervals = [[0.1, 0.6], [0.5, 1.0]]"), &["must begin at 0"]),
        (schwarz("subdomains = 0"), &["schwarz.subdomains"]),
        (schwarz("method = \"optimal\"\ncuts = [0.7, 0.3]"), &["schwarz.cuts", "runs from right to left"]),
        (
            schwarz("method = \"optimal\"\ncut = 0.5\nintegral = { trapezoid = 1000000000 }"),
            &["1000000 panels at most"],
        ),
        (m("1 + t*x"), &["density.value", "must not depend on t without [time]"]),
        (m("exp(-50*x)"), &["density.value", "above 0 by more than 1e-14 of its largest"]),
        ("[density]\nkind = \"arclength\"\nof = \"if(x < 0.3, 0, 1)\"\n".into(), &["density.of", "u jumps there"]),
        (schwarz("subdomains = 200\noverlap_cells = 1"), &["schwarz.subdomains", "number of cells, 100"]),
        (schwarz("subdomains = 3\noverlap_cells = 2"), &["must be whole", "98 and 101"]),
        (schwarz("subdomains = 50\noverlap_cells = 100"), &["no wider than its overlap"]),
        (schwarz("overlap = [0.4, 0.6]\noverlap_cells = 3"), &["goes with schwarz.subdomains only"]),
        (schwarz("method = \"optimized\"\ncut = 0.5\nrobin = 0.0"), &["schwarz.robin", "above 0"]),
        (schwarz("method = \"optimized\"\ncut = 0.5\nrobin = -2"), &["schwarz.robin", "above 0"]),
        (schwarz("method = \"optimized\"\ncut = 0.5\nrobin = \"none\""), &["auto", "lagged"]),
        (schwarz("method = \"optimized\"\ncut = 0.01"), &["has no node inside"]),
        (schwarz("method = \"optimized\"\noverlap = [0.4, 0.6]"), &["needs cuts", "classical"]),
        (
            schwarz("method = \"optimal\"\ncut = 0.5\nsweep = \"alternating\""),
            &["schwarz.sweep", "no option of the method optimal"],
        ),
        (schwarz("method = \"optimal\"\ncut = 0.5\nintegral = { trapezoid = 0 }"), &["1 panel or more"]),
        (
            schwarz("overlap = [0.4, 0.6]\nsweep = \"alternating\"\ncoarse = \"galerkin\""),
            &["schwarz.coarse", "parallel"],
        ),
        (schwarz("overlap = [0.4, 0.6]\n[stop]\ntolerance = 0.0"), &["stop.tolerance", "above 0"]),
        (schwarz("overlap = [0.4, 0.6]\n[stop]\niterations = 0"), &["stop.iterations"]),
        (
            schwarz("overlap = [0.4, 0.6]\n[start]\nmesh = { formula = \"2*xi\" }"),
            &["start.mesh.formula", "from 0 to 1"],
        ),
        (schwarz("overlap = [0.4, 0.6]\n[start]\nmesh = { formula = \"xi + sin(2*pi*xi)\" }"), &["start.mesh.formula"]),
        (
            schwarz(
                "method = \"optimal\"\ncut = 0.5\nintegral = { trapezoid = 20 }\n[time]\nstart = 0.0\nend = 1.0\n\
                 step = 0.1\nrelaxation = 1.0",
            ),
            &["schwarz.integral", "no integral"],
        ),
        (format!("{M}[time]\nstart = 0.0\nend = 1.0\nstep = 0.1\nrelaxation = 0.0"), &["time.relaxation", "above 0"]),
        (format!("{M}[time]\nstart = 0.0\nend = 1.0\nstep = -0.1\nrelaxation = 1.0"), &["time.step", "above 0"]),
        (format!("{M}[output]\nframes = {{ every = 2 }}"), &["output.frames", "needs [time]"]),
    ];
    for (rest, expected) in cases {
        let error = EquidistributionStudy::from_source(&Source::new("bad", format!("{BEGIN}{rest}"))).unwrap_err();
        let told = format!("{error}\n{}", error.help().unwrap_or_default());
        assert!(!error.is_failure(), "{told}");
        for part in expected {
            assert!(told.contains(part), "{part:?} is not in:\n{told}");
        }
    }
    for cells in ["[1]", "[0]", "[10, 10]", "[100000000000]"] {
        let text = format!("{}{M}", BEGIN.replace("[100]", cells));
        assert!(EquidistributionStudy::from_source(&Source::new("bad", text)).is_err(), "{cells}");
    }
}
