use super::directory::write_file;
use crate::error::Result;
use base64::{Engine, engine::general_purpose::STANDARD};
use resvg::{tiny_skia, usvg};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::sync::{Arc, LazyLock};

/// A drawing as SVG and PNG.
pub struct Picture {
    /// The drawing.
    pub svg: String,
    /// The same at twice its size in pixels.
    pub png: Vec<u8>,
}

impl Picture {
    /// A drawing in both formats: as SVG with its font inside, and as PNG.
    pub(crate) fn of(svg: &str, canvas: &mut Canvas) -> Self {
        let png = encoded(canvas.paint(svg, 2)).expect("writing to memory cannot fail");
        let font = format!(
            "<style>@font-face{{font-family:\"DejaVu Sans\";src:url(data:font/ttf;base64,{})}}</style>\n",
            STANDARD.encode(FONT)
        );
        let open = svg.find('>').map_or(0, |end| end + 1);
        Self { svg: [&svg[..open], "\n", &font, &svg[open..]].concat(), png }
    }

    /// Writes `name.svg` and `name.png`. Both wait for the disk, side by side.
    ///
    /// # Errors
    /// [`Error::Unwritable`](crate::Error::Unwritable).
    pub fn write(&self, directory: &Path, name: &str) -> Result<()> {
        let [svg, png] = ["svg", "png"].map(|ending| directory.join(format!("{name}.{ending}")));
        std::thread::scope(|scope| {
            let svg = scope.spawn(|| write_file(&svg, self.svg.as_bytes()));
            let png = write_file(&png, &self.png);
            svg.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)).and(png)
        })
    }
}

/// The font of all drawings.
pub(super) const FONT: &[u8] = include_bytes!("../../assets/DejaVuSans-subset.ttf");
/// Longer edge of the box in the drawing.
pub(super) const LONGER: f64 = 640.0;
pub(super) const SHORTER_AT_LEAST: f64 = 160.0;
pub(super) const LEFT: f64 = 76.0;
pub(super) const TOP: f64 = 48.0;
pub(super) const RIGHT: f64 = 116.0;
pub(super) const BOTTOM: f64 = 64.0;
/// From the box to the colour bar.
pub(super) const BAR: f64 = 24.0;
/// Width of a letter, as a share of the size of its font.
const WIDE: f64 = 0.64;
/// An axis that begins so little below a round number, as a share of its length, counts from there.
const NEARLY: f64 = 0.05;
/// Bytes of a part of a PNG.
const CHUNK: usize = 1 << 16;
/// Colours of an image, row by row.
#[derive(Debug, Clone)]
pub(crate) struct Pixels {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Four bytes a pixel, all opaque.
    pub rgba: Vec<u8>,
}

/// The title, over the box; over the whole drawing where it is too wide for that, and as small as it needs to be; in
/// two lines where that would be too small to read.
pub(super) fn heading(s: &mut String, title: &str, width: f64) {
    const SIZE: f64 = 15.0;
    const LEGIBLE: f64 = 10.0;
    let whole = LEFT + width + RIGHT;
    let letters = |line: &str| line.chars().count();
    let fitting = |line: &str| SIZE.min((whole - 20.0) / (WIDE * letters(line) as f64));
    let middle = |(place, _): &(usize, &str)| letters(&title[..*place]).abs_diff(letters(title) / 2);
    let (head, tail) = match title.match_indices([' ', '-', '_', '.']).min_by_key(middle) {
        Some((place, _)) if fitting(title) < LEGIBLE => title.split_at(place + 1),
        _ => (title, ""),
    };
    let lines: &[(&str, f64)] = if tail.is_empty() { &[(head, 20.0)] } else { &[(head, 12.0), (tail, 24.0)] };
    let largest = if tail.is_empty() { SIZE } else { LEGIBLE };
    for (line, y) in lines {
        let size = fitting(line).min(largest);
        let centre = if size * WIDE * letters(line) as f64 <= width { LEFT + 0.5 * width } else { 0.5 * whole };
        let _ = writeln!(
            s,
            "<text x=\"{centre:.1}\" y=\"{y}\" text-anchor=\"middle\" font-size=\"{size:.1}\">{}</text>",
            escape(line.trim())
        );
    }
}

pub(super) fn axes(
    s: &mut String,
    lower: [f64; 2],
    extent: [f64; 2],
    [width, height]: [f64; 2],
    names: &[impl AsRef<str>],
) {
    let bottom = TOP + height;
    let _ = writeln!(
        s,
        "<g stroke=\"#222\" fill=\"none\"><rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{width:.1}\" \
         height=\"{height:.1}\"/></g>"
    );
    let [along, up] = [0, 1].map(|d| Ticks::between(lower[d], lower[d] + extent[d]));
    for (value, label) in &along.marks {
        let x = LEFT + (value - lower[0]) / extent[0] * width;
        let _ = writeln!(
            s,
            "<path d=\"M{x:.1} {bottom:.1}v5\" stroke=\"#222\"/><text x=\"{x:.1}\" y=\"{:.1}\" \
             text-anchor=\"middle\">{label}</text>",
            bottom + 20.0
        );
    }
    for (value, label) in &up.marks {
        let y = bottom - (value - lower[1]) / extent[1] * height;
        let _ = writeln!(
            s,
            "<path d=\"M{LEFT} {y:.1}h-5\" stroke=\"#222\"/><text x=\"{:.1}\" y=\"{:.1}\" \
             text-anchor=\"end\">{label}</text>",
            LEFT - 9.0,
            y + 4.5
        );
    }
    let (x, y) = (LEFT + 0.5 * width, TOP + 0.5 * height);
    let name = along.named(names[0].as_ref());
    let below = bottom + 44.0;
    let _ = writeln!(s, "<text x=\"{x:.1}\" y=\"{below:.1}\" text-anchor=\"middle\" font-size=\"14\">{name}</text>");
    let (name, beside) = (up.named(names[1].as_ref()), y + 5.0);
    let turned = if name.len() == 1 { String::new() } else { format!(" transform=\"rotate(-90 20 {beside:.1})\"") };
    let _ =
        writeln!(s, "<text x=\"20\" y=\"{beside:.1}\" text-anchor=\"middle\" font-size=\"14\"{turned}>{name}</text>");
}

pub(super) fn colour_bar(s: &mut String, unknown: &str, low: f64, high: f64, x: f64, height: f64) {
    const BANDS: usize = 64;
    let band = height / BANDS as f64;
    for k in 0..BANDS {
        let y = TOP + height - (k + 1) as f64 * band;
        let fill = colour((k as f64 + 0.5) / BANDS as f64);
        let _ =
            writeln!(s, "<rect x=\"{x:.1}\" y=\"{y:.2}\" width=\"16\" height=\"{:.2}\" fill=\"{fill}\"/>", band + 0.3);
    }
    let _ = writeln!(
        s,
        "<rect x=\"{x:.1}\" y=\"{TOP}\" width=\"16\" height=\"{height:.1}\" fill=\"none\" stroke=\"#222\"/>"
    );
    let ticks = Ticks::between(low, high);
    for (value, label) in &ticks.marks {
        let y = if high > low { TOP + height - (value - low) / (high - low) * height } else { TOP + 0.5 * height };
        let _ = writeln!(
            s,
            "<path d=\"M{:.1} {y:.1}h5\" stroke=\"#222\"/><text x=\"{:.1}\" y=\"{:.1}\">{label}</text>",
            x + 16.0,
            x + 25.0,
            y + 4.5
        );
    }
    // over the bar, or up to the edge of the drawing where it is too wide for that
    let name = ticks.named(unknown);
    let right = x - BAR + RIGHT - 10.0;
    let length = 14.0 * WIDE * name.chars().count() as f64;
    let (place, anchor) = if x + 8.0 + 0.5 * length < right { (x + 8.0, "middle") } else { (right, "end") };
    let _ = writeln!(
        s,
        "<text x=\"{place:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\" font-size=\"{:.1}\">{}</text>",
        TOP - 12.0,
        14.0 * ((right - 10.0) / length).min(1.0),
        escape(&name)
    );
}

/// Round values 1, 2 or 5 times a power of ten apart, four to nine of them, with short labels.
#[derive(Debug)]
pub(super) struct Ticks {
    marks: Vec<(f64, String)>,
    /// What the labels are less, and the unit they are in, where they would be long.
    less: Option<String>,
    unit: Option<String>,
    /// The same as numbers.
    start: f64,
    size: f64,
}

impl Ticks {
    pub(super) fn between(low: f64, high: f64) -> Self {
        let span = high - low;
        let scale = low.abs().max(high.abs());
        if !(span > 1e-12 * scale && span.is_finite()) {
            let plain = low == 0.0 || (1e-3..1e5).contains(&low.abs());
            let label = match plain {
                true => format!("{low:.4}").trim_end_matches('0').trim_end_matches('.').into(),
                false => format!("{low:.3e}"),
            };
            return Self { marks: vec![(low, label)], less: None, unit: None, start: 0.0, size: 1.0 };
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
                (true, _) => format!("{:.decimals$}", start * ten).trim_end_matches('0').trim_end_matches('.').into(),
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
        Self { marks: marks.collect(), less, unit: named, start: start * ten, size: unit }
    }

    /// Where the marks are.
    pub(super) fn places(&self) -> impl Iterator<Item = f64> {
        self.marks.iter().map(|(place, _)| *place)
    }

    /// The label of any place on the axis.
    pub(super) fn label(&self, value: f64) -> String {
        // a sum of steps has rounding in it
        let text = format!("{:.6}", (value - self.start) / self.size);
        let text = text.trim_end_matches('0').trim_end_matches('.');
        if text == "-0" { "0".into() } else { text.into() }
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
    let text = format!("{t:.5e}");
    let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
    format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.'))
}

pub(super) fn colour(fraction: f64) -> String {
    let c = colorous::VIRIDIS.eval_continuous(if fraction.is_finite() { fraction.clamp(0.0, 1.0) } else { 0.5 });
    format!("#{c:x}")
}

pub(super) fn point(p: [f64; 2]) -> String {
    let mut text = String::new();
    add_point(&mut text, p);
    text
}

/// A point of the drawing to a hundredth, by whole numbers: `format` of floating point takes longer than the rest of a
/// picture.
pub(super) fn add_point(text: &mut String, point: [f64; 2]) {
    for (value, end) in point.into_iter().zip([",", ""]) {
        let hundredths = (100.0 * value).round() as i64;
        let sign = if hundredths < 0 { "-" } else { "" };
        let [whole, rest] = [hundredths.unsigned_abs() / 100, hundredths.unsigned_abs() % 100];
        let _ = match rest {
            0 => write!(text, "{sign}{whole}{end}"),
            _ => write!(text, "{sign}{whole}.{rest:02}{end}"),
        };
    }
}

pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// What drawings are painted on, one after the other: to get the memory of an image takes longer than to paint it.
#[derive(Default)]
pub(crate) struct Canvas(Option<tiny_skia::Pixmap>);

impl Canvas {
    /// A drawing as pixels, in its size.
    pub(crate) fn pixels(&mut self, svg: &str) -> Pixels {
        let painted = self.paint(svg, 1);
        Pixels { size: [painted.width(), painted.height()], rgba: painted.data().to_vec() }
    }

    /// A drawing as pixels, so many times its size.
    fn paint(&mut self, svg: &str, times: u32) -> &tiny_skia::Pixmap {
        static FONTS: LazyLock<Arc<usvg::fontdb::Database>> = LazyLock::new(|| {
            let mut fonts = usvg::fontdb::Database::new();
            fonts.load_font_data(FONT.to_vec());
            Arc::new(fonts)
        });
        let options = usvg::Options { fontdb: FONTS.clone(), font_family: "DejaVu Sans".into(), ..Default::default() };
        let tree = usvg::Tree::from_str(svg, &options).expect("the drawing is well-formed");
        let size = tree.size().to_int_size();
        let [width, height] = [size.width(), size.height()].map(|length| times * length);
        let blank = match self.0.take() {
            Some(mut painted) if [painted.width(), painted.height()] == [width, height] => {
                painted.fill(tiny_skia::Color::TRANSPARENT);
                painted
            }
            _ => tiny_skia::Pixmap::new(width, height).expect("the drawing has a size"),
        };
        let pixels = self.0.insert(blank);
        resvg::render(&tree, tiny_skia::Transform::from_scale(times as f32, times as f32), &mut pixels.as_mut());
        pixels
    }
}

/// Pixels as PNG, without their opacity, which is full; compressed fast, since writing must not take longer than
/// computing.
fn encoded(pixels: &tiny_skia::Pixmap) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, pixels.width(), pixels.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Paeth);
    let mut writer = encoder.write_header()?;
    let mut stream = writer.stream_writer_with_size(CHUNK)?;
    let mut rgb = vec![0; 3 * pixels.width() as usize];
    for row in pixels.data().chunks_exact(4 * pixels.width() as usize) {
        let opaque = row.as_chunks::<4>().0.iter().zip(rgb.as_chunks_mut::<3>().0);
        opaque.for_each(|(&[r, g, b, _], to)| *to = [r, g, b]);
        stream.write_all(&rgb)?;
    }
    stream.finish()?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was painted before does not shine through.
    #[test]
    fn a_canvas_is_blank_for_each_drawing() {
        let drawing = |inside: &str| {
            format!("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"30\" height=\"20\">{inside}</svg>")
        };
        let [dark, clear] =
            ["<rect width=\"30\" height=\"9\"/>", "<rect width=\"9\" height=\"20\" fill=\"red\"/>"].map(drawing);
        let mut canvas = Canvas::default();
        canvas.paint(&dark, 2);
        assert_eq!(canvas.paint(&clear, 2).data(), Canvas::default().paint(&clear, 2).data());
        assert_eq!(canvas.paint(&clear, 1).data(), Canvas::default().paint(&clear, 1).data());
    }

    #[test]
    fn points_stand_to_a_hundredth() {
        for (p, text) in [([1.0, -2.0], "1,-2"), ([0.054, -0.006], "0.05,-0.01"), ([-0.001, 715.996], "0,716")] {
            assert_eq!(point(p), text);
        }
    }

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
