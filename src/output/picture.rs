use super::directory::write_file;
use super::names;
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
    /// The drawing at twice its size in pixels.
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
        let [svg, png] = names::PICTURE_FORMATS.map(|format| directory.join(format!("{name}.{format}")));
        std::thread::scope(|scope| {
            let svg = scope.spawn(|| write_file(&svg, self.svg.as_bytes()));
            let png = write_file(&png, &self.png);
            svg.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)).and(png)
        })
    }
}

/// The font of all drawings.
pub(super) const FONT: &[u8] = include_bytes!("../../assets/DejaVuSans-subset.ttf");
/// Largest number of bytes in an IDAT chunk of a PNG.
const CHUNK: usize = 1 << 16;

/// Colours of an image, row by row.
#[derive(Debug, Clone)]
pub(crate) struct Pixels {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Four bytes a pixel, all opaque.
    pub rgba: Vec<u8>,
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

/// What drawings are painted on, one after the other: to get the memory of an image takes longer than to paint it.
#[derive(Default)]
pub(crate) struct Canvas(Option<tiny_skia::Pixmap>);

impl Canvas {
    /// A drawing as pixels, in its size.
    pub(crate) fn pixels(&mut self, svg: &str) -> Pixels {
        let painted = self.paint(svg, 1);
        Pixels { size: [painted.width(), painted.height()], rgba: painted.data().to_vec() }
    }

    /// A drawing as pixels, at this multiple of its size.
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
}
