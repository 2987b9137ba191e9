use super::{bits, formula, mistake, value};

/// As Python's `%` and `math.floor` give them.
#[test]
fn remainders_have_the_sign_of_the_divisor() {
    for (a, b, rest) in [
        (7.0, 3.0, 1.0),
        (-7.0, 3.0, 2.0),
        (7.0, -3.0, -2.0),
        (-7.0, -3.0, -1.0),
        (6.0, -3.0, -0.0),
        (-6.0, 3.0, 0.0),
        (-0.25, 1.0, 0.75),
        (1e17, 3.0, 1.0),
        (1.0, 0.1, 0.09999999999999995),
        (1.0, 0.0, f64::NAN),
    ] {
        // folded, and of variables
        let found = [value(&format!("mod({a:e}, {b:e})")), formula("mod(x, y)").eval(&[a, b, 0.0])];
        assert_eq!(found.map(bits), [bits(rest); 2], "mod({a}, {b}) is {found:?}");
    }
    for (text, expected) in [("floor(2.5)", 2.0), ("floor(-2.5)", -3.0), ("floor(y)", -2.0), ("floor(-0.0)", -0.0)] {
        assert_eq!(value(text).to_bits(), f64::to_bits(expected), "{text}");
    }
    // x = 0.3, y = −1.7, t = 2.5: t/x is 8.33, by hand
    let by = |text: &str, variable: usize| formula(text).derivative(variable).unwrap().eval(&[0.3, -1.7, 2.5]);
    let found = [by("mod(t, x)", 2), by("mod(t, x)", 0), by("mod(y, x)", 0), by("floor(t)", 2), by("mod(3*t, 2)", 2)];
    assert_eq!(found, [1.0, -8.0, 6.0, 0.0, 3.0]);
    assert_eq!(mistake("x % y").help.unwrap(), "write mod(…, …) for the remainder");
    assert_eq!(mistake("ceil(x)").help.unwrap(), "write -floor(-(…))");
}
