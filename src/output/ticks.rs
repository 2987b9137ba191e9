//! Marks of linear and logarithmic axes, and their labels.

/// Labels that would be long are differences from a round number below the axis; it may also lie above the lower end of
/// the axis, by no more than this share of its length.
const NEARLY: f64 = 0.05;
/// Leading digits of round numbers.
pub(super) const ROUND: [f64; 3] = [1.0, 2.0, 5.0];
/// Numbers that differ by less than this share of themselves count as the same on a logarithmic axis: rounding.
const SLACK: f64 = 1e-9;
/// Largest number of labelled powers of ten on a logarithmic axis; where there are more, only every second, third … has
/// a label.
const MOST_POWERS: i32 = 9;

/// Round values 1, 2 or 5 times a power of ten apart, four to nine of them, with short labels.
#[derive(Debug)]
pub(super) struct Ticks {
    /// Each mark: its place, and its label, which is (place − `less`)/`unit`.
    pub marks: Vec<(f64, String)>,
    /// The number from which labels count, as text; none where they count from 0, as short ones do.
    less: Option<String>,
    /// The power of ten that is the unit of labels, as text, where it is not 1.
    unit: Option<String>,
}

impl Ticks {
    pub(super) fn between(low: f64, high: f64) -> Self {
        let span = high - low;
        let scale = low.abs().max(high.abs());
        if !(span > 1e-12 * scale && span.is_finite()) {
            let plain = low == 0.0 || (1e-3..1e5).contains(&low.abs());
            let label = match plain {
                true => trimmed(&format!("{low:.4}")).into(),
                false => format!("{low:.3e}"),
            };
            return Self { marks: vec![(low, label)], less: None, unit: None };
        }
        let power = 10_f64.powf((span / 4.0).log10().floor());
        let step = power * [5.0, 2.0, 1.0].into_iter().find(|m| m * power <= span / 4.0).unwrap_or(1.0);
        let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
        // what all of them begin with
        let ten = 10_f64.powf(span.log10().ceil());
        let start = if span < 2e-3 * scale { (low / ten + NEARLY * span / ten).floor() } else { 0.0 };
        let less = (start != 0.0).then(|| {
            let digits = (start.abs().log10().floor() as usize).min(15);
            let decimals = (-ten.log10().round()).max(0.0) as usize;
            let plain = decimals <= 6 && scale < 1e7;
            match (plain, decimals) {
                (true, 0) => format!("{:.0}", start * ten),
                (true, _) => trimmed(&format!("{:.decimals$}", start * ten)).into(),
                (false, _) => format!("{:.digits$e}", start * ten),
            }
        });
        let size = scale.min(if start != 0.0 { 2.0 * ten } else { f64::INFINITY });
        let exponent = if (1e-2..1e5).contains(&size) { 0 } else { size.log10().floor() as i32 };
        let unit = 10_f64.powi(exponent);
        let decimals = (-(step / unit).log10().floor()).max(0.0) as usize;
        let marks = (first..=last).map(|k| {
            let value = k as f64 * step;
            (value, format!("{:.decimals$}", (value - start * ten) / unit))
        });
        let named = (exponent != 0).then(|| format!("1e{exponent}"));
        Self { marks: marks.collect(), less, unit: named }
    }

    /// Where the marks are.
    pub(super) fn places(&self) -> impl Iterator<Item = f64> {
        self.marks.iter().map(|(place, _)| *place)
    }

    /// The name of an axis with these labels.
    pub(super) fn named(&self, name: &str) -> String {
        let less = self.less.as_ref().map(|less| match less.strip_prefix('-') {
            Some(more) => format!(" + {more}"),
            None => format!(" − {less}"),
        });
        let unit = self.unit.as_ref().map(|unit| format!(", in {unit}"));
        [name, &less.unwrap_or_default(), &unit.unwrap_or_default()].concat()
    }
}

/// A time without the tail that binary fractions have; as a power of ten where it is very small or large.
pub(crate) fn moment(t: f64) -> String {
    if t == 0.0 || (1e-4..1e9).contains(&t.abs()) {
        return format!("{}", format!("{t:.9}").parse::<f64>().unwrap_or(t));
    }
    scientific(&format!("{t:.5e}"))
}

/// A decimal number without the zeros at its end.
fn trimmed(text: &str) -> &str {
    text.trim_end_matches('0').trim_end_matches('.')
}

/// A number in the form 1.50000e-7 without the zeros at the end of its digits.
fn scientific(text: &str) -> String {
    let (digits, power) = text.split_once('e').unwrap_or((text, "0"));
    format!("{}e{power}", trimmed(digits))
}

/// The largest number not above x that begins with one of these figures, which begin with 1.
pub(super) fn below(x: f64, round: &[f64]) -> f64 {
    let ten = 10_f64.powf((x.log10() + SLACK).floor());
    round.iter().map(|m| m * ten).rfind(|m| *m <= x * (1.0 + SLACK)).unwrap_or(ten)
}

/// The smallest one not below x.
pub(super) fn above(x: f64, round: &[f64]) -> f64 {
    let ten = 10_f64.powf((x.log10() + SLACK).floor());
    round.iter().chain(&[10.0]).map(|m| m * ten).find(|m| *m >= x * (1.0 - SLACK)).unwrap_or(10.0 * ten)
}

/// Where a logarithmic axis has labels, and where it has lines between them.
pub(super) fn log_marks([low, high]: [f64; 2]) -> [Vec<f64>; 2] {
    let inside = |v: &f64| (low * (1.0 - SLACK)..=high * (1.0 + SLACK)).contains(v);
    let [first, last] = [low, high].map(|end| end.log10().floor() as i32);
    let decades = (last - first).max(1);
    let beginning = |with: &[f64], every: i32| -> Vec<f64> {
        let powers = (first..=last).filter(|k| k.rem_euclid(every) == 0).map(|k| 10_f64.powi(k));
        powers.flat_map(|ten| with.iter().map(move |m| m * ten)).filter(inside).collect()
    };
    let every = (decades + MOST_POWERS - 1) / MOST_POWERS;
    let all = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
    let between = if every == 1 { beginning(&all, 1) } else { beginning(&[1.0], 1) };
    for bold in [beginning(&[1.0], every), beginning(&ROUND, 1)] {
        if bold.len() >= 3 {
            return [bold, between];
        }
    }
    [Ticks::between(low, high).places().filter(inside).collect(), Vec::new()]
}

/// A number on a logarithmic axis, as 0.001 or as 1e-4.
pub(super) fn short(x: f64) -> String {
    if (0.00099..1.1e4).contains(&x) {
        return format!("{}", (x * 1e6).round() / 1e6);
    }
    scientific(&format!("{x:.4e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_short_and_differ() {
        for (low, high, name) in [
            (0.0, 1.0, "x"),
            (-1.0, 2.5, "x"),
            (999_999.0, 1_000_001.0, "x − 999990"),
            (0.0, 1e-6, "x, in 1e-6"),
            (0.76, 0.7604, "x − 0.76, in 1e-3"),
            (-1e6, -1e6 + 1e-3, "x + 1000000"),
            (0.0, 3e9, "x, in 1e9"),
            (1e-300, 2e-300, "x, in 1e-300"),
        ] {
            let ticks = Ticks::between(low, high);
            let labels: std::collections::BTreeSet<&str> =
                ticks.marks.iter().map(|(_, label)| label.as_str()).collect();
            assert!(labels.len() == ticks.marks.len() && (3..=10).contains(&labels.len()), "{low} {high}: {ticks:?}");
            assert!(labels.iter().all(|label| label.len() <= 7), "{low} {high}: {ticks:?}");
            assert_eq!(ticks.named("x"), name, "{ticks:?}");
        }
        assert_eq!(Ticks::between(2.0, 2.0).marks.len(), 1);
    }
}
