//! A line never stalls: densities of all kinds are equidistributed, and every Schwarz method converges or says why.

use crate::targets::line::{self as drawn, dice::Dice};
use driftmesh::equidistribution::{FaceDensity, Line, LineDensity};
use driftmesh::study::{EquidistributionStudy, Kind, Source};
use rayon::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

/// `[density]` of case `n` on [0, 1]: layers at an end and inside, spikes, kinks, roots, steps.
fn density(dice: &mut Dice) -> String {
    let (w, place) = (dice.between(1e-12, 1e-2), (1e3 * dice.share()).round() / 1e3);
    let a = dice.between(1e-3, 1e6);
    let arclength = |of: String| format!("kind = \"arclength\"\nof = \"{of}\"");
    let formula = |value: String| format!("kind = \"formula\"\nvalue = \"{value}\"");
    match dice.whole(0, 9) {
        0 => arclength(format!("exp(-x/{w})")),
        1 => arclength(format!("tanh(x/{w})")),
        2 => arclength(format!("tanh((x - {place})/{w})")),
        3 => formula(format!("1 + {a}/{w}*exp(-x/(2*{w}))")),
        4 => formula(format!("x^6 + {}", dice.between(1e-9, 1.0))),
        5 => formula(format!("if(x < {place}, 1, {})", dice.between(1e-13, 1e13))),
        6 => formula(format!("sqrt(abs(x - {place})) + {}", dice.between(1e-6, 1.0))),
        7 => formula(format!("1 + 1000*exp(-{}*(x - {place})^2)", dice.between(1.0, 1e7))),
        8 => formula(format!("exp({}*x)", dice.between(1e-2, 30.0))),
        _ => arclength(format!("sin({}*x) + abs(x - {place})", dice.between(1.0, 300.0))),
    }
}

fn line(density: &str, cells: usize) -> Line {
    let kind = |key: &str| density.split(&format!("{key} = \"")).nth(1).map(|text| text.split('"').next().unwrap());
    let m = match (kind("value"), kind("of")) {
        (Some(value), _) => LineDensity::formula(value),
        (_, of) => LineDensity::arclength(of.unwrap()),
    };
    Line { face: FaceDensity::Exact, ..Line::new(m.unwrap(), cells) }
}

/// Nodes in order, and ∫M the same over all cells to 1e-9, or to the rounding of their places. ∫M is measured by
/// another quadrature than the one that was inverted.
fn equidistributes(density: &str, cells: usize) -> Result<(), String> {
    let line = line(density, cells);
    let mesh = line.equidistributed(0.0).map_err(|failure| failure.to_string())?;
    if !mesh.is_sorted_by(|a, b| a < b) || [mesh[0], mesh[cells]] != line.ends {
        return Err("nodes out of order".into());
    }
    let shares = line.shares(0.0, &mesh).map_err(|failure| failure.to_string())?;
    let m = line.density.values(0.0, &mesh).map_err(|failure| failure.to_string())?;
    let mean = shares.iter().sum::<f64>() / cells as f64;
    let rounding = |i: usize| 4.0 * f64::EPSILON * (mesh[i] * m[i]).max(mesh[i + 1] * m[i + 1]);
    let of_mean = (0..cells).map(rounding).sum::<f64>() / cells as f64;
    for (i, share) in shares.iter().enumerate() {
        if (share - mean).abs() > 1e-9 * mean + rounding(i) + of_mean {
            return Err(format!("share {i} is off by {:.1e}, at x = {}", share / mean - 1.0, mesh[i]));
        }
    }
    Ok(())
}

/// Every Schwarz method with exact averages, from equal cells: optimal conditions take as many iterations as there are
/// subdomains, whatever the density, and no method stalls.
#[test]
fn schwarz_with_exact_averages_never_stalls() {
    use driftmesh::equidistribution::{Measure, Method, Robin, Stop};
    for density in [
        "value = \"x^6 + 1e-9\"",
        "value = \"if(x > 0.3, 1, 1e-6)\"",
        "value = \"sqrt(abs(x - 0.5)) + 1e-6\"",
        "value = \"1 + 1000*exp(-((x - 0.5)/1e-3)^2)\"",
        "value = \"1e-6 + exp(-x/1e-3)\"",
        "value = \"1 + 1e6*exp(-x/2e-6)\"",
        "value = \"1.0001 + tanh((x - 0.4)/1e-4)\"",
        "of = \"tanh((x - 0.3)/1e-6)\"",
    ] {
        let line = line(density, 160);
        let line = Line { density: line.density.clone().within(line.ends), ..line };
        for ranges in [vec![[0, 80], [80, 160]], vec![[0, 40], [40, 80], [80, 120], [120, 160]]] {
            let run = |method, iterations| {
                let stop = Stop { iterations, tolerance: None, measure: Measure::Error };
                line.iterate(0.0, &ranges, method, &line.uniform(), None, stop)
                    .unwrap_or_else(|e| panic!("{density}: {e}"))
            };
            let error = run(Method::Optimal { panels: None }, ranges.len()).iterates[ranges.len()].error;
            assert!(error < 1e-9, "{density} on {} subdomains: {error:.1e}", ranges.len());
            for robin in [Robin::Auto, Robin::Lagged, Robin::Value(2.0), Robin::Value(1e14)] {
                run(Method::Optimized { robin }, 20);
            }
        }
    }
}

/// Rounding of places, and noise of single precision, are not followed; nor is M asked for outside the line.
#[test]
fn rounding_is_not_followed() {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    type M = fn(f64) -> f64;
    let densities: [(M, &[f64]); 5] = [
        (|x| 1.0 + (-(1.0 - x) / 2e-8).exp() / 1e-8, &[]),
        (|x| 1.0 + (-(1.0 - x) / 2e-12).exp() / 1e-12, &[]),
        (|x| 1e-3 + 1e8 / ((x - 0.3) / 1e-8).cosh().powi(2), &[0.3]),
        (|x| 1.0 + 1e6 * (-((x - 0.3) / 1e-6).powi(2)).exp(), &[0.3]),
        (|x| f64::from((1.0 + (x * x) as f32) * 1.1_f32), &[]),
    ];
    for (k, (m, spikes)) in densities.into_iter().enumerate() {
        let asked = Arc::new(AtomicUsize::new(0));
        let counter = asked.clone();
        let density = LineDensity::on_line([0.0, 1.0], move |_, x| {
            counter.fetch_add(x.len(), Ordering::Relaxed);
            assert!(x.iter().all(|x| (0.0..=1.0).contains(x)));
            x.iter().map(|x| m(*x)).collect()
        });
        let line = Line { face: FaceDensity::Exact, ..Line::new(density.with_spikes(spikes.to_vec()), 160) };
        let mesh = line.equidistributed(0.0).unwrap();
        assert!(mesh.is_sorted_by(|a, b| a < b));
        let asked = asked.load(Ordering::Relaxed);
        assert!(asked <= 50_000, "density {k}: {asked} evaluations");
    }
}

/// Only ratios of M count: what is too large or too small for sums is refused by name, and so are lines.
#[test]
fn sizes_beyond_sums_are_refused() {
    for m in ["1e308", "5e-324", "1e-200*(1 + x)"] {
        let error = Line::new(LineDensity::formula(m).unwrap(), 20).equidistributed(0.0).unwrap_err();
        assert!(error.to_string().starts_with("M is "), "{error}");
    }
    for (ends, accepted) in [([0.0, 1e-300], false), ([-1e300, 1e300], false), ([-1e9, 1e-100], true)] {
        assert_eq!(driftmesh::equidistribution::check_ends("domain", ends).is_ok(), accepted, "{ends:?}");
    }
}

/// 200 densities at 20, 160 and 1000 cells, some of them at 10⁵.
#[test]
fn all_kinds_of_densities_are_equidistributed() {
    let mistakes: Vec<String> = (0..200_u64)
        .into_par_iter()
        .flat_map_iter(|n| {
            let density = density(&mut Dice(n));
            let cells = [20, 160, 1000, 100_000].into_iter().filter(move |cells| *cells < 100_000 || n % 10 == 0);
            let tried: Vec<String> = cells
                .filter_map(|cells| match equidistributes(&density, cells) {
                    Err(mistake) => Some(format!("{n}, {cells} cells: {mistake}\n{density}")),
                    Ok(()) => None,
                })
                .collect();
            tried
        })
        .collect();
    assert!(mistakes.is_empty(), "{} of them:\n{}", mistakes.len(), mistakes.join("\n"));
}

/// Values of a function, and arrays that jump: none is asked for outside the line, and few.
#[test]
fn functions_and_arrays() {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    for place in [0.0, 0.31, 1.0] {
        let asked = Arc::new(AtomicUsize::new(0));
        let counter = asked.clone();
        let m = LineDensity::on_line([0.0, 1.0], move |_, x| {
            counter.fetch_add(x.len(), Ordering::Relaxed);
            assert!(x.iter().all(|x| (0.0..=1.0).contains(x)));
            x.iter().map(|x| 1.0 + 1e4 * (-(x - place).abs() * 1e4).exp()).collect()
        });
        let line = Line { face: FaceDensity::Exact, ..Line::new(m, 160) };
        let mesh = line.equidistributed(0.0).unwrap();
        assert!(asked.load(Ordering::Relaxed) <= 50_000, "{asked:?} places");
        let up_to = |x: f64| x + (1.0 - (-(x - place).abs() * 1e4).exp()).copysign(x - place);
        let share = (up_to(1.0) - up_to(0.0)) / 160.0;
        assert!(mesh.windows(2).all(|x| ((up_to(x[1]) - up_to(x[0])) / share - 1.0).abs() < 1e-9));
    }
    // 1 up to 0.4, 1000 beyond: ∫M = 600.4
    let m = LineDensity::sampled(vec![0.0, 0.4, 0.4, 1.0], vec![1.0, 1.0, 1e3, 1e3]).unwrap();
    let x = Line { face: FaceDensity::Exact, ..Line::new(m, 3002) }.equidistributed(0.0).unwrap();
    assert!((x[2] - 0.4).abs() < 1e-15 && (x[1502] - 0.7).abs() < 1e-12, "{} {}", x[2], x[1502]);
    // a density that jumps has no mesh by trapezoids: the nodes of exact averages, and a word about it
    let jump = Line::new(LineDensity::formula("if(x < 0.5, 1, 1e6)").unwrap(), 10);
    let settled = jump.settled(0.0).unwrap();
    assert!(settled.stalled.is_some() && settled.mesh.is_sorted_by(|a, b| a < b));
}

/// What cannot be a density is told with its place and value.
#[test]
fn impossible_densities_are_named() {
    for (m, named) in [
        ("x - 0.4", "M is -4e-1 at x = 0"),
        ("max(x - 0.4, 0)", "M is 0e0 at x = 0"),
        ("1/x", "M is inf at x = 0"),
        ("1/sqrt(1 - x)", "M is inf at x = 1"),
        ("sqrt(x - 0.5)", "M is NaN at x = 0"),
    ] {
        let line = Line { face: FaceDensity::Exact, ..Line::new(LineDensity::formula(m).unwrap(), 40) };
        let failure = line.equidistributed(0.0).unwrap_err().to_string();
        assert!(failure.contains(named), "{m}: {failure}");
    }
    let jump = Line { face: FaceDensity::Exact, ..Line::new(LineDensity::arclength("if(x < 0.3, 0, 1)").unwrap(), 40) };
    let failure = jump.equidistributed(0.0).unwrap_err().to_string();
    assert!(failure.contains("u_x is inf at x = 0.29999") || failure.contains("u_x is inf at x = 0.3"), "{failure}");
    // thinner than numbers near 1e6 can tell apart, for so many cells
    let far = LineDensity::arclength("tanh((x - 1000000.3)/1e-8)").unwrap();
    let thin = Line { face: FaceDensity::Exact, ends: [1e6, 1e6 + 1.0], ..Line::new(far, 1000) };
    let failure = thin.equidistributed(0.0).unwrap_err();
    assert_eq!(failure.name(), "line-unresolved");
}

/// A random study of the kind.
fn study(n: u64) -> Option<(String, EquidistributionStudy)> {
    let mut dice = Dice(n.wrapping_mul(0xD1B5_4A32_D192_ED03));
    let density = density(&mut dice);
    let text = drawn::text(&mut dice, &density);
    EquidistributionStudy::from_source(&Source::new("line.toml", &text)).ok().map(|study| (text, study))
}

/// Each is completed with its nodes in order or ends by name, without a panic and within seconds.
fn sweep(numbers: std::ops::Range<u64>, most_seconds: f64) {
    let told: Vec<(String, Option<String>)> = numbers
        .into_par_iter()
        .filter_map(|n| {
            let (text, study) = study(n)?;
            let begun = Instant::now();
            let outcome = catch_unwind(AssertUnwindSafe(|| drawn::ending(&study)));
            let seconds = begun.elapsed().as_secs_f64();
            let mistake = match outcome {
                Err(_) => Some("panic".into()),
                Ok(_) if seconds > most_seconds => Some(format!("took {seconds:.1} s")),
                Ok(Err(mistake)) => Some(mistake),
                Ok(Ok(name)) => return Some((name.into(), None)),
            };
            Some((String::new(), mistake.map(|mistake| format!("study {n}: {mistake}\n{text}"))))
        })
        .collect();
    let mut counts = std::collections::BTreeMap::new();
    told.iter().for_each(|(name, _)| *counts.entry(name.as_str()).or_insert(0) += 1);
    println!("{} studies: {counts:?}", told.len());
    let mistakes: Vec<&str> = told.iter().filter_map(|(_, mistake)| mistake.as_deref()).collect();
    assert!(mistakes.is_empty(), "{} of them:\n{}", mistakes.len(), mistakes[..mistakes.len().min(5)].join("\n"));
    assert!(counts.get("completed").is_some_and(|completed| 2 * completed > told.len()), "{counts:?}");
}

#[test]
fn random_studies_complete_or_end_by_name() {
    sweep(0..200, 60.0);
}

/// 2000 of them.
#[test]
#[ignore = "takes minutes"]
fn many_random_studies_complete_or_end_by_name() {
    sweep(0..2000, 20.0);
}
