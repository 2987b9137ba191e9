mod remainders;

use super::*;
use proptest::prelude::*;

const XYT: [&str; 3] = ["x", "y", "t"];

fn formula(text: &str) -> Formula {
    Formula::parse(text, &XYT).unwrap_or_else(|mistake| panic!("{text}: {mistake:?}"))
}

fn value(text: &str) -> f64 {
    formula(text).eval(&[0.3, -1.7, 2.5])
}

fn mistake(text: &str) -> Mistake {
    Formula::parse(text, &XYT).expect_err(text)
}

/// The bits, any NaN standing for all.
fn bits(value: f64) -> u64 {
    if value.is_nan() { f64::NAN.to_bits() } else { value.to_bits() }
}

#[test]
fn operators_rank_and_associate_as_on_paper() {
    let cases = [
        ("-2^2", -4.0),
        ("2^3^2", 512.0),
        ("2^-1", 0.5),
        ("2^-1^2", 0.5),
        ("-2^-2", -0.25),
        ("(-2)^2", 4.0),
        ("2 - 3 - 4", -5.0),
        ("24/4/3", 2.0),
        ("24/4*3", 18.0),
        ("2 + 3*4^2", 50.0),
        ("2*-3", -6.0),
        ("2--3", 5.0),
        ("-+-2", 2.0),
        (".5 + 1e-3 + 2.5E+4 + 1.", 25001.501),
        ("\t1 +\n 1 ", 2.0),
        ("pi", std::f64::consts::PI),
        ("2*e", 2.0 * std::f64::consts::E),
        ("if(1 < 2, 3, 4)", 3.0),
        ("if((1 >= 2), 3, 4)", 4.0),
    ];
    for (text, expected) in cases {
        assert_eq!(value(text), expected, "{text}");
    }
    // with variables, which are not folded: x = 0.3, y = −1.7, t = 2.5
    let (x, y, t) = (0.3, -1.7_f64, 2.5);
    assert_eq!(value("-y^2"), -(y * y));
    assert_eq!(value("x - y - t"), x - y - t);
    assert_eq!(value("x/y/t"), x / y / t);
    assert_eq!(value("t^x^t"), t.powf(f64::powf(x, t)));
    assert_eq!(value("-x*y + t"), -x * y + t);
}

#[test]
fn functions_are_those_of_f64() {
    type Case = (&'static str, fn(f64) -> f64);
    let cases: [Case; 11] = [
        ("sin", f64::sin),
        ("cos", f64::cos),
        ("tan", f64::tan),
        ("sinh", f64::sinh),
        ("cosh", f64::cosh),
        ("tanh", f64::tanh),
        ("exp", f64::exp),
        ("log", f64::ln),
        ("sqrt", f64::sqrt),
        ("abs", f64::abs),
        ("x^0.5 + 0*", |x| x.powf(0.5) + 0.0 * x),
    ];
    for (name, reference) in cases {
        for x in [-1e3, -2.5, -0.0, 0.0, 1e-9, 0.7, 3.0, 800.0, f64::INFINITY, f64::NAN] {
            assert_eq!(bits(formula(&format!("{name}(x)")).eval(&[x])), bits(reference(x)), "{name}({x})");
        }
    }
    for (x, y) in [(1.0, 2.0), (2.0, 1.0), (-1.0, -1.0)] {
        assert_eq!(formula("min(x, y)").eval(&[x, y]), x.min(y));
        assert_eq!(formula("max(x, y)").eval(&[x, y]), x.max(y));
        for (sign, holds) in
            [("<", x < y), ("<=", x <= y), (">", x > y), (">=", x >= y), ("==", x == y), ("!=", x != y)]
        {
            assert_eq!(formula(&format!("if(x {sign} y, 1, 0)")).eval(&[x, y]), f64::from(u8::from(holds)), "{sign}");
        }
    }
}

/// Abramowitz and Stegun, table 7.1, with more digits.
#[test]
fn erf_has_its_tabulated_values() {
    let table = [
        (0.1, 0.112_462_916_018_284_9),
        (0.5, 0.520_499_877_813_046_5),
        (1.0, 0.842_700_792_949_714_9),
        (1.5, 0.966_105_146_475_310_7),
        (2.0, 0.995_322_265_018_952_7),
        (3.0, 0.999_977_909_503_001_4),
    ];
    for (x, erf) in table {
        assert!((formula("erf(x)").eval(&[x]) - erf).abs() < 1e-15, "erf({x})");
        assert!((formula("erf(x)").eval(&[-x]) + erf).abs() < 1e-15, "erf(-{x})");
    }
}

/// What simplification might hide: NaN times zero, the sign of zero, ∞ − ∞.
#[test]
fn values_are_never_simplified_away() {
    let nan = [f64::NAN, f64::NAN, f64::NAN];
    for text in
        ["0*x", "x - x", "x/x", "0/x", "min(x, 1)", "min(1, x)", "max(x, 1)", "max(1, x)", "x + 0", "x^1", "1*x"]
    {
        assert!(formula(text).eval(&nan).is_nan(), "{text}");
    }
    assert_eq!(formula("1/(x + 0)").eval(&[-0.0]), f64::INFINITY);
    assert_eq!(formula("1/(x - 0)").eval(&[-0.0]), f64::NEG_INFINITY);
    assert!(value("0/0").is_nan() && value("sqrt(-1)").is_nan());
    // a value that was not given
    assert!(formula("x + t").eval(&[1.0]).is_nan());
    assert!(!formula("x").depends_on(1) && formula("0*y").depends_on(1));
}

/// Known derivatives at points where a careless rule gives NaN, and on both sides of every kink.
#[test]
fn derivatives_are_exact_where_rules_meet_their_edges() {
    let cases = [
        ("x^2", 0.0, 0.0),
        ("x^2", -3.0, -6.0),
        ("x^1", 0.0, 1.0),
        ("x^3", -2.0, 12.0),
        ("x^-1", -2.0, -0.25),
        ("x^2.0", 0.0, 0.0),
        ("x^40", -1.0, -40.0),
        ("x^0.5", 4.0, 0.25),
        ("x^1.5", 0.0, 0.0),
        ("2^x", 0.0, std::f64::consts::LN_2),
        ("0^x", 2.0, 0.0),
        ("max(x, 0)^x", 0.0, f64::NAN),
        ("abs(x)", 0.0, 0.0),
        ("abs(x)", -2.0, -1.0),
        ("abs(x)", 2.0, 1.0),
        ("min(x, 2*x)", 0.0, 1.0),
        ("max(2*x, x)", 0.0, 2.0),
        ("min(x, 2*x)", -1.0, 2.0),
        ("max(x, 2*x)", -1.0, 1.0),
        ("if(x < 1, x^2, 3)", 0.5, 1.0),
        ("if(x < 1, x^2, 3)", 1.0, 0.0),
        ("if(x < 1, 2, 3)", 0.0, 0.0),
        ("x/7", 3.0, 1.0 / 7.0),
        ("7/x", -1.0, -7.0),
        ("(x^2 + 1)^3", 1.0, 24.0),
        ("y^2", 1.0, 0.0),
        ("sqrt(x)", 4.0, 0.25),
        ("erf(x)", 0.0, std::f64::consts::FRAC_2_SQRT_PI),
        ("tan(x)", 0.0, 1.0),
    ];
    for (text, x, expected) in cases {
        let found = formula(text).derivative(0).unwrap().eval(&[x, 1.0, 1.0]);
        assert_eq!(bits(found), bits(expected), "({text})′ at {x} is {found}, expected {expected}");
    }
    // the exponent depends on t, but not on the variable: no logarithm of a negative number
    assert_eq!(formula("x^t").derivative(0).unwrap().eval(&[-3.0, 0.0, 2.0]), -6.0);
    assert_eq!(formula("0^t + x").derivative(2).unwrap().eval(&[-3.0, 0.0, 2.0]), 0.0);
}

#[test]
fn derivatives_of_every_order() {
    let order = |text: &str, n: usize| (0..n).fold(formula(text), |f, _| f.derivative(0).unwrap());
    // x⁵ has the fifth derivative 120 and no sixth
    assert_eq!(order("x^5", 5).eval(&[7.0]), 120.0);
    let zero = order("x^5", 6);
    assert!(zero.eval(&[f64::NAN]) == 0.0 && !zero.depends_on(0));
    // sin repeats after four
    assert_eq!(order("sin(x)", 12).eval(&[0.7]), 0.7_f64.sin());
    // (tanh)⁗ at 0 is 0, (tanh)‴ is −2
    assert_eq!(order("tanh(x)", 3).eval(&[0.0]), -2.0);
    let mixed = formula("x^2*y^3").derivative(1).unwrap().derivative(0).unwrap();
    assert_eq!(mixed.eval(&[2.0, 3.0]), 108.0);
    assert_eq!(mixed.to_string(), "∂/∂x ∂/∂y (x^2*y^3)");
    assert_eq!(mixed.text(), "x^2*y^3");
    assert_ne!(mixed, formula("x^2*y^3"));
    assert_eq!(formula("x").derivative(3).unwrap_err().to_string(), "there is no variable 3 of 3");
}

/// A formula of x, y and t: its text, and value with first and second derivative by x in Taylor arithmetic.
#[derive(Debug, Clone)]
enum Tree {
    Number(f64),
    Variable(usize),
    Unary(&'static str, Box<Tree>),
    Binary(&'static str, Box<Tree>, Box<Tree>),
    Power(Box<Tree>, i32),
    If(&'static str, Box<[Tree; 4]>),
}

const UNARY: [&str; 13] =
    ["-", "sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "abs", "erf", "floor"];

const BINARY: [&str; 8] = ["+", "-", "*", "/", "^", "min", "max", "mod"];

fn trees() -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![
        (-30..30i32).prop_map(|n| Tree::Number(f64::from(n) / 10.0)),
        (0..3usize).prop_map(Tree::Variable),
        Just(Tree::Variable(0)),
    ];
    leaf.prop_recursive(5, 40, 4, |inner| {
        prop_oneof![
            3 => (prop::sample::select(&UNARY[..]), inner.clone()).prop_map(|(f, a)| Tree::Unary(f, a.into())),
            5 => (prop::sample::select(&BINARY[..]), inner.clone(), inner.clone())
                .prop_map(|(f, a, b)| Tree::Binary(f, a.into(), b.into())),
            1 => (inner.clone(), -3..5i32).prop_map(|(a, n)| Tree::Power(a.into(), n)),
            1 => (prop::sample::select(&["<", "<=", ">", ">="][..]), std::array::from_fn::<_, 4, _>(|_| inner.clone()))
                .prop_map(|(c, parts)| Tree::If(c, parts.into())),
        ]
    })
}

/// f, f′, f″.
type Jet = [f64; 3];

fn product(a: Jet, b: Jet) -> Jet {
    [a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2.0 * a[1] * b[1] + a[0] * b[2]]
}

/// g(a) from g, g′, g″ at a.
fn composed(g: Jet, a: Jet) -> Jet {
    [g[0], g[1] * a[1], g[2] * a[1] * a[1] + g[1] * a[2]]
}

fn inverse(a: Jet) -> Jet {
    composed([1.0 / a[0], -1.0 / a[0].powi(2), 2.0 / a[0].powi(3)], a)
}

impl Tree {
    fn text(&self) -> String {
        match self {
            Self::Number(c) => format!("({c})"),
            Self::Variable(v) => XYT[*v].into(),
            Self::Unary("-", a) => format!("(-{})", a.text()),
            Self::Unary(f, a) => format!("{f}({})", a.text()),
            Self::Binary(f @ ("min" | "max" | "mod"), a, b) => format!("{f}({}, {})", a.text(), b.text()),
            Self::Binary(f, a, b) => format!("({} {f} {})", a.text(), b.text()),
            Self::Power(a, n) => format!("(({})^{n})", a.text()),
            Self::If(c, parts) => {
                let [l, r, a, b] = &**parts;
                format!("if({} {c} {}, {}, {})", l.text(), r.text(), a.text(), b.text())
            }
        }
    }

    /// The jet at a point; `hard` grows with everything that makes comparing digits unfair.
    fn jet(&self, at: &[f64; 3], hard: &mut f64) -> Jet {
        let result = match self {
            Self::Number(c) => [*c, 0.0, 0.0],
            Self::Variable(v) => [at[*v], if *v == 0 { 1.0 } else { 0.0 }, 0.0],
            Self::Unary(f, a) => {
                let a = a.jet(at, hard);
                if ["abs", "sqrt", "log"].contains(f) {
                    *hard = hard.max(1.0 / a[0].abs());
                }
                if *f == "floor" {
                    *hard = hard.max(1.0 / from_whole(a[0]));
                }
                composed(unary(f, a[0]), a)
            }
            Self::Power(a, n) => {
                let a = a.jet(at, hard);
                let factor = if *n < 0 { inverse(a) } else { a };
                *hard = hard.max(if *n < 0 { 1.0 / a[0].abs() } else { 0.0 });
                (0..n.abs()).fold([1.0, 0.0, 0.0], |p, _| product(p, factor))
            }
            Self::Binary(f, a, b) => binary(f, a.jet(at, hard), b.jet(at, hard), hard),
            Self::If(c, parts) => {
                let [l, r, a, b] = parts.each_ref().map(|part| part.jet(at, hard));
                *hard = hard.max(1.0 / (l[0] - r[0]).abs());
                if (l[0] < r[0]) == c.starts_with('<') { a } else { b }
            }
        };
        let size = result.iter().fold(0.0, |m: f64, v| if v.is_finite() { m.max(v.abs()) } else { f64::INFINITY });
        *hard = hard.max(size);
        result
    }
}

/// g, g′, g″ of a function at x.
fn unary(name: &str, x: f64) -> Jet {
    let (tan, tanh) = (x.tan(), x.tanh());
    let bell = std::f64::consts::FRAC_2_SQRT_PI * (-x * x).exp();
    match name {
        "-" => [-x, -1.0, 0.0],
        "sin" => [x.sin(), x.cos(), -x.sin()],
        "cos" => [x.cos(), -x.sin(), -x.cos()],
        "tan" => [tan, 1.0 / x.cos().powi(2), 2.0 * tan / x.cos().powi(2)],
        "sinh" => [x.sinh(), x.cosh(), x.sinh()],
        "cosh" => [x.cosh(), x.sinh(), x.cosh()],
        "tanh" => [tanh, 1.0 / x.cosh().powi(2), -2.0 * tanh / x.cosh().powi(2)],
        "exp" => [x.exp(); 3],
        "log" => [x.ln(), 1.0 / x, -1.0 / (x * x)],
        "sqrt" => [x.sqrt(), 0.5 / x.sqrt(), -0.25 / x.powf(1.5)],
        "abs" => [x.abs(), x.signum(), 0.0],
        "erf" => [libm::erf(x), bell, -2.0 * x * bell],
        "floor" => [x.floor(), 0.0, 0.0],
        _ => unreachable!(),
    }
}

/// How far a number is from a whole one.
fn from_whole(x: f64) -> f64 {
    (x - x.round()).abs()
}

fn binary(name: &str, a: Jet, b: Jet, hard: &mut f64) -> Jet {
    match name {
        "+" => std::array::from_fn(|k| a[k] + b[k]),
        "-" => std::array::from_fn(|k| a[k] - b[k]),
        "*" => product(a, b),
        "/" => {
            *hard = hard.max(1.0 / b[0].abs());
            product(a, inverse(b))
        }
        "^" => {
            // exp(g log f), for a positive base only
            *hard = hard.max(1.0 / a[0].abs());
            if a[0] <= 0.0 {
                *hard = f64::INFINITY;
            }
            let log = composed([a[0].ln(), 1.0 / a[0], -1.0 / (a[0] * a[0])], a);
            let exponent = product(b, log);
            composed([exponent[0].exp(); 3], exponent)
        }
        "min" | "max" => {
            *hard = hard.max(1.0 / (a[0] - b[0]).abs());
            if (a[0] < b[0]) == (name == "min") { a } else { b }
        }
        "mod" => {
            let quotient = a[0] / b[0];
            *hard = hard.max(1.0 / from_whole(quotient)).max(quotient.abs());
            std::array::from_fn(|k| a[k] - b[k] * quotient.floor())
        }
        _ => unreachable!(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Symbolic derivatives against Taylor arithmetic, which knows no graph and no simplification.
    #[test]
    fn values_and_derivatives_agree_with_taylor_arithmetic(
        tree in trees(),
        points in prop::array::uniform4(prop::array::uniform3(-2.0..2.0)),
    ) {
        let f = formula(&tree.text());
        let dx = f.derivative(0).unwrap();
        let all = [&f, &dx, &dx.derivative(0).unwrap()];
        for at in points {
            let mut hard = 1.0;
            let expected = tree.jet(&at, &mut hard);
            if hard < 1e3 {
                for (k, f) in all.iter().enumerate() {
                    let found = f.eval(&at);
                    let error = (found - expected[k]).abs();
                    let text = tree.text();
                    prop_assert!(
                        error <= 1e-13 * hard.powi(3),
                        "order {k} of {text} at {at:?}: {found}, {}",
                        expected[k]
                    );
                }
            }
        }
    }

    /// Batches, whole or in part, with the time shared or not, have the bits of single evaluations.
    #[test]
    fn programs_have_the_bits_of_formulas(
        tree in trees(),
        other in trees(),
        points in prop::collection::vec(prop::array::uniform2(-2.0..2.0), 0..300),
        t in -2.0..2.0,
    ) {
        let (f, g) = (formula(&tree.text()), formula(&other.text()));
        let all = [f.clone(), g, f.derivative(0).unwrap(), f.derivative(2).unwrap()];
        let mut out = vec![[0.0; 4]; points.len()];
        Program::<2, 4>::new(all.each_ref()).eval_each(&points, &[t], &mut out);
        let three: Vec<[f64; 3]> = points.iter().map(|[x, y]| [*x, *y, t]).collect();
        let mut again = vec![[0.0; 4]; points.len()];
        Program::<3, 4>::new(all.each_ref()).eval_each(&three, &[], &mut again);
        for (k, at) in three.iter().enumerate() {
            let single = all.each_ref().map(|f| bits(f.eval(at)));
            prop_assert_eq!(out[k].map(bits), single);
            prop_assert_eq!(again[k].map(bits), single);
        }
    }

    /// Whatever is typed: no panic, and a place that can be underlined.
    #[test]
    fn any_text_is_read_or_refused(text in prop_oneof![
        any::<String>(),
        "[xyt0-9.eE+*/^(),<>=! -]{0,40}",
        prop::collection::vec(prop::sample::select(&[
            "x", "y", "2", "1e5", ".5", "pi", "sin", "if", "max", "(", ")", "(", ")", ",", "+", "-", "*", "^", "<",
            "==", " ", "²", "é",
        ][..]), 0..25).prop_map(|parts| parts.concat()),
    ]) {
        match Formula::parse(&text, &XYT) {
            Ok(f) => {
                let value = f.eval(&[0.1, 0.2, 0.3]);
                let program = Program::<3, 2>::new([&f, &f.derivative(0).unwrap()]);
                prop_assert_eq!(bits(program.eval([0.1, 0.2, 0.3], &[])[0]), bits(value));
            }
            Err(mistake) => {
                prop_assert!(text.get(mistake.at.clone()).is_some(), "{mistake:?}");
                prop_assert!(!mistake.at.is_empty() || text.is_empty(), "{mistake:?}");
            }
        }
    }
}

/// Every kind of mistake: what is marked, what is said, what is advised.
#[test]
fn mistakes_say_what_where_and_what_instead() {
    let known = "known here: x, y, t, pi, e, sin, cos, tan, asin, acos, atan, atan2, sinh, cosh, tanh, exp, log, sqrt, \
                 abs, erf, floor, min, max, mod, if";
    let stray = |sign: &str| format!("`{sign}` has no meaning in a formula");
    let cases: &[(&str, &str, &str, Option<&str>)] = &[
        ("", "", "the formula is empty", Some("write a number, such as 0")),
        (" \n", " \n", "the formula is empty", Some("write a number, such as 0")),
        ("1 + sine(x)", "sine", "unknown name `sine`", Some("did you mean `sin`?")),
        ("Sqrt(x)", "Sqrt", "unknown name `Sqrt`", Some("did you mean `sqrt`?")),
        ("x*T", "T", "unknown name `T`", Some("did you mean `t`?")),
        ("x*q", "q", "unknown name `q`", Some(known)),
        ("velocity + 1", "velocity", "unknown name `velocity`", Some(known)),
        ("ln(x)", "ln", "unknown name `ln`", Some("the natural logarithm is log(…)")),
        ("arsinh(x)", "arsinh", "unknown name `arsinh`", Some(known)),
        ("arctan2(x, y)", "arctan2", "unknown name `arctan2`", Some("write atan2(…, …)")),
        ("atan2(y)", "atan2(y)", "`atan2` takes 2 arguments, not 1", None),
        ("cot(x)", "cot", "unknown name `cot`", Some("write 1/tan(…)")),
        ("2*(x + (y)", "(", "this parenthesis is never closed", None),
        ("sin(x", "(", "this parenthesis is never closed", None),
        ("2*(", "(", "this parenthesis is never closed", None),
        ("x + y)", ")", "this parenthesis was never opened", None),
        ("x*()", "()", "nothing stands between the parentheses", None),
        ("y + 2x", "2x", "an operator is missing here", Some("write 2*x")),
        ("2 x", "2 x", "an operator is missing here", Some("write 2*x")),
        ("2exp(x)", "2exp", "an operator is missing here", Some("write 2*exp")),
        ("x(1 + y)", "x(", "an operator is missing here", Some("write x*(…)")),
        ("(x)y", ")y", "an operator is missing here", Some("write (…)*y")),
        ("(x)(y)", ")(", "an operator is missing here", Some("write )*(")),
        ("x**2", "**", &stray("**"), Some("write ^ for powers")),
        ("sin(x, y)", "sin(x, y)", "`sin` takes 1 argument, not 2", None),
        ("1 + max(x)", "max(x)", "`max` takes 2 arguments, not 1", None),
        ("exp()", "exp()", "`exp` takes 1 argument, not 0", None),
        ("if(x < 1, 2)", "if(x < 1, 2)", "`if` takes 3 arguments, not 2", None),
        ("if(x, 1, 2)", "x", "`if` asks for a comparison in its first place", Some("write if(x < 1, a, b)")),
        (
            "1 + (x < 2)",
            "(x < 2)",
            "a comparison stands only in the first place of if(…)",
            Some("write if(x < 1, a, b)"),
        ),
        ("x < 2", "x < 2", "a comparison stands only in the first place of if(…)", Some("write if(x < 1, a, b)")),
        ("if(0 < x < 1, 1, 0)", "0 < x <", "comparisons cannot be chained", Some("put one if(…) into another")),
        ("if(x = 1, 1, 0)", "=", &stray("="), Some("write == to compare")),
        ("x # y", "#", &stray("#"), None),
        ("x − y", "−", &stray("−"), Some("write -")),
        ("x²", "²", &stray("²"), Some("write ^2")),
        ("größe", "ö", &stray("ö"), None),
        (
            "1.2.3 + x",
            "1.2.3",
            "`1.2.3` is not a number",
            Some("write digits with at most one point, such as 1.5 or 2e-3"),
        ),
        ("1_000", "1_000", "`1_000` is not a number", Some("write digits with at most one point, such as 1.5 or 2e-3")),
        ("x + 1e999", "1e999", "the number 1e999 is too large", Some("the largest number is 1.797e308")),
        (
            "1,5*x",
            ",",
            "a comma stands only between the arguments of a function",
            Some("write a point in numbers, such as 1.5"),
        ),
        (
            "(1,5)*x",
            ",",
            "a comma stands only between the arguments of a function",
            Some("write a point in numbers, such as 1.5"),
        ),
        ("sin x", "sin", "the function `sin` has no parentheses", Some("write sin(x)")),
        ("2 + cos", "cos", "the function `cos` has no parentheses", Some("write cos(…)")),
        ("x +", "+", "something is missing after `+`", None),
        ("x * / y", "*", "something is missing after `*`", None),
        ("(x + )", "+", "something is missing after `+`", None),
        ("max(x,)", ",", "something is missing after `,`", None),
        ("* x", "*", "something is missing before `*`", None),
        ("(, x)", ",", "something is missing before `,`", None),
        (")", ")", "something is missing before `)`", None),
    ];
    for (text, marked, message, help) in cases {
        let mistake = mistake(text);
        assert_eq!((mistake.message.as_str(), mistake.help.as_deref()), (*message, *help), "{text}");
        assert_eq!(&text[mistake.at.clone()], *marked, "{text}");
    }
    // which of several: the unclosed one, the second x
    assert_eq!(mistake("2*(x + (y)").at, 2..3);
    assert_eq!(mistake("x + 2x").at, 4..6);
}

#[test]
fn variables_must_be_names_of_their_own() {
    let refused = |variables: &[&str]| Formula::parse("1", variables).unwrap_err().message;
    assert_eq!(refused(&["x", "e"]), "the variable `e` has the name of a constant");
    assert_eq!(refused(&["max"]), "the variable `max` has the name of a function");
    assert_eq!(refused(&["x", "x"]), "the variable `x` is given twice");
    assert_eq!(refused(&["2x"]), "the variable `2x` is not a name of ASCII letters, digits and _");
    assert_eq!(refused(&[""]), "the variable `` is not a name of ASCII letters, digits and _");
    assert_eq!(Formula::parse("u_1*xi", &["u_1", "xi"]).unwrap().eval(&[2.0, 3.0]), 6.0);
}

#[test]
fn deep_and_long_texts_are_refused() {
    let deep = format!("the formula is nested deeper than {MAX_DEPTH} levels");
    for (open, close) in
        [("(", ")"), ("-", ""), ("2^", ""), ("sin(", ")"), ("if(x < 1, 1, ", ")"), ("-(", ")"), ("+", "")]
    {
        let nested = |n: usize| format!("{}x{}", open.repeat(n), close.repeat(n));
        assert_eq!(mistake(&nested(700)).message, deep, "{open}");
        formula(&nested(MAX_DEPTH / 2 - 1));
    }
    assert_eq!(formula(&format!("{}x", "-".repeat(MAX_DEPTH - 1))).eval(&[1.0]), -1.0);
    assert_eq!(mistake(&format!("{}x", "-".repeat(MAX_DEPTH))).at, MAX_DEPTH..MAX_DEPTH + 1);

    let long = "x + ".repeat(MAX_LENGTH / 4);
    assert_eq!(mistake(&format!("{long}x")).message, "the formula has 10001 bytes, 10000 are allowed");
    let sum = format!("{}x", "x+".repeat((MAX_LENGTH - 1) / 2));
    assert_eq!(formula(&sum).eval(&[1.0]), 5000.0);
    assert_eq!(formula(&sum).derivative(0).unwrap().eval(&[1.0]), 5000.0);
    let name = mistake(&"q".repeat(MAX_LENGTH)).message;
    assert!(name.chars().count() < 60, "{name}");
}

/// Shared parts keep derivatives small: tanh of a sum of squares grows by a few operations an order, not by a factor.
#[test]
fn derivatives_share_what_is_equal() {
    let u = formula("tanh(30*(x^2 + y^2 - 1/8))");
    let third = (0..3).fold(u.clone(), |f, _| f.derivative(0).unwrap());
    assert!(third.nodes.len() < 60, "{} operations", third.nodes.len());
    // tanh itself is computed once
    let program = Program::<2, 2>::new([&u, &third]);
    let tanh = |nodes: &[Node]| nodes.iter().filter(|n| matches!(n, Node::Unary(graph::Unary::Tanh, _))).count();
    assert_eq!((tanh(&third.nodes), tanh(&program.nodes)), (1, 1));
}

/// Products without end: the limit ends them, not the memory.
#[test]
fn derivatives_beyond_the_limit_are_a_mistake() {
    let text = (1..600).map(|k| format!("sin({k}*x)")).collect::<Vec<_>>().join("*");
    let mut f = formula(&text);
    let mistake = loop {
        match f.derivative(0) {
            Ok(next) => f = next,
            Err(mistake) => break mistake,
        }
    };
    assert_eq!(mistake.message, "the derivative by x takes more than 100000 operations");
    assert_eq!(mistake.at, 0..text.len());
}

#[test]
fn programs_bear_any_size_of_slice() {
    let [f, g] = ["x + t", "7"].map(formula);
    let program = Program::<1, 2>::new([&f, &g]);
    let mut out = [[0.0; 2]; 3];
    program.eval_each(&[[1.0], [2.0]], &[0.0, 10.0], &mut out);
    assert_eq!(out, [[11.0, 7.0], [12.0, 7.0], [0.0, 0.0]]);
    program.eval_each(&[], &[], &mut out);
    assert!(program.eval([1.0], &[])[0].is_nan());
    assert_eq!(Program::<0, 1>::new([&formula("t")]).eval([], &[1.0, 2.0, 3.0]), [3.0]);
    Program::<2, 0>::new([]).eval_each(&[[0.0; 2]], &[], &mut [[]]);
}

#[test]
fn formulas_cross_threads() {
    fn crosses<T: Send + Sync + Clone>() {}
    crosses::<Formula>();
    crosses::<Program<2, 3>>();
    crosses::<Mistake>();
}
