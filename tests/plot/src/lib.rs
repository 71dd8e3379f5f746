//! A minimal SVG writer for the crates' figures.
#![forbid(unsafe_code)]

use std::fmt::Write;

/// Blue, as an SVG color.
pub const BLUE: &str = "#2060c0";
/// Red, as an SVG color.
pub const RED: &str = "#c03028";
/// Green, as an SVG color.
pub const GREEN: &str = "#208040";
/// Gray, as an SVG color.
pub const GRAY: &str = "#909090";

/// Returns an SVG file as a data URI. Characters with a meaning in Markdown, HTML or URIs are percent-encoded.
pub fn data_uri(svg: &str) -> String {
    let mut uri = String::from("data:image/svg+xml,");
    for byte in svg.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b',' | b'/' | b':' | b'=' => uri.push(byte.into()),
            _ => write!(uri, "%{byte:02X}").expect("memory"),
        }
    }
    uri
}

/// A drawing in pixels, with y pointing down.
#[derive(Debug)]
pub struct Svg {
    body: String,
}

impl Svg {
    /// Creates a white drawing of this size \[pixels\].
    pub fn new(width: f32, height: f32) -> Self {
        let mut body = String::new();
        let size = format!(r#"width="{width}" height="{height}" viewBox="0 0 {width} {height}""#);
        writeln!(body, r#"<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif">"#).expect("memory");
        writeln!(body, r#"<rect width="{width}" height="{height}" fill="white"/>"#).expect("memory");
        Self { body }
    }

    fn add(&mut self, element: std::fmt::Arguments) {
        writeln!(self.body, "{element}").expect("memory");
    }

    /// Draws a line between two points, with a width \[pixels\].
    pub fn line(&mut self, (ax, ay): (f32, f32), (bx, by): (f32, f32), color: &str, width: f32) {
        let ends = format!(r#"x1="{ax:.1}" y1="{ay:.1}" x2="{bx:.1}" y2="{by:.1}""#);
        self.add(format_args!(r#"<line {ends} stroke="{color}" stroke-width="{width}"/>"#));
    }

    /// Draws a polyline.
    pub fn path(&mut self, points: &[(f32, f32)], color: &str) {
        let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        let points = points.join(" ");
        self.add(format_args!(r#"<polyline points="{points}" fill="none" stroke="{color}" stroke-width="1.5"/>"#));
    }

    /// Draws a faintly filled, rounded rectangle from its upper left corner and size.
    pub fn rectangle(&mut self, (x, y): (f32, f32), (width, height): (f32, f32), color: &str) {
        let place = format!(r#"x="{x:.1}" y="{y:.1}" width="{width:.1}" height="{height:.1}""#);
        self.add(format_args!(r#"<rect {place} rx="6" fill="{color}" fill-opacity="0.12" stroke="{color}"/>"#));
    }

    /// Draws a filled rectangle from its upper left corner and size.
    pub fn bar(&mut self, (x, y): (f32, f32), (width, height): (f32, f32), color: &str) {
        let place = format!(r#"x="{x:.1}" y="{y:.1}" width="{width:.1}" height="{height:.1}""#);
        self.add(format_args!(r#"<rect {place} fill="{color}"/>"#));
    }

    /// Draws a filled circle.
    pub fn circle(&mut self, (x, y): (f32, f32), radius: f32, color: &str) {
        self.add(format_args!(r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius:.1}" fill="{color}"/>"#));
    }

    /// Draws text at a point, with a size \[pixels\]; `anchor` is `start`, `middle` or `end`.
    pub fn text(&mut self, (x, y): (f32, f32), size: f32, anchor: &str, text: &str) {
        let place = format!(r#"x="{x:.1}" y="{y:.1}" font-size="{size}" text-anchor="{anchor}""#);
        self.add(format_args!("<text {place}>{text}</text>"));
    }

    /// Returns the SVG file.
    pub fn finish(mut self) -> String {
        self.body.push_str("</svg>\n");
        self.body
    }
}

#[derive(Debug)]
enum Shape {
    Line,
    /// Bars of this width, in units of x.
    Bars(f32),
}

#[derive(Debug)]
struct Series {
    name: &'static str,
    color: &'static str,
    shape: Shape,
    points: Vec<(f32, f32)>,
}

/// A diagram of lines or bars, with axes and a legend.
#[derive(Debug)]
pub struct Plot {
    title: String,
    labels: [&'static str; 2],
    logarithmic: bool,
    series: Vec<Series>,
}

const LEFT: f32 = 70.0;
const TOP: f32 = 40.0;
const WIDTH: f32 = 560.0;
const HEIGHT: f32 = 300.0;

impl Plot {
    /// Creates an empty diagram with named axes.
    pub fn new(title: &str, x: &'static str, y: &'static str) -> Self {
        Self { title: title.into(), labels: [x, y], logarithmic: false, series: Vec::new() }
    }

    /// Labels the axes as powers of ten; points are decimal logarithms.
    pub fn logarithmic(&mut self) {
        self.logarithmic = true;
    }

    /// Adds a line with its name in the legend.
    pub fn line(&mut self, name: &'static str, color: &'static str, points: Vec<(f32, f32)>) {
        self.series.push(Series { name, color, shape: Shape::Line, points });
    }

    /// Adds bars centered on points, with a width in units of x.
    pub fn bars(&mut self, name: &'static str, color: &'static str, width: f32, points: Vec<(f32, f32)>) {
        self.series.push(Series { name, color, shape: Shape::Bars(width), points });
    }

    /// Returns the SVG file.
    pub fn finish(self) -> String {
        // Ranges of the axes, and the mapping to pixels.
        let all = || self.series.iter().flat_map(|series| &series.points);
        let range = |of: fn(&(f32, f32)) -> f32| {
            let (low, high) = all().map(of).fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            if self.logarithmic { (low.floor(), high.ceil()) } else { (low.min(0.0), high * 1.05) }
        };
        let ((x0, x1), (y0, y1)) = (range(|p| p.0), range(|p| p.1));
        let place =
            |(x, y): (f32, f32)| (LEFT + (x - x0) / (x1 - x0) * WIDTH, TOP + HEIGHT - (y - y0) / (y1 - y0) * HEIGHT);

        // Grid, labels and title.
        let mut svg = Svg::new(LEFT + WIDTH + 30.0, TOP + HEIGHT + 60.0);
        svg.text((LEFT, 18.0), 15.0, "start", &self.title);
        for (x, label) in self.ticks(x0, x1) {
            let (at, _) = place((x, y0));
            svg.line((at, TOP), (at, TOP + HEIGHT), "#e0e0e0", 1.0);
            svg.text((at, TOP + HEIGHT + 18.0), 12.0, "middle", &label);
        }
        for (y, label) in self.ticks(y0, y1) {
            let (_, at) = place((x0, y));
            svg.line((LEFT, at), (LEFT + WIDTH, at), "#e0e0e0", 1.0);
            svg.text((LEFT - 8.0, at + 4.0), 12.0, "end", &label);
        }
        svg.text((LEFT + WIDTH / 2.0, TOP + HEIGHT + 42.0), 13.0, "middle", self.labels[0]);
        svg.text((LEFT, TOP - 4.0), 12.0, "start", self.labels[1]);

        // The series, each with a line in the legend.
        for (row, series) in self.series.iter().enumerate() {
            match series.shape {
                Shape::Line => {
                    svg.path(&series.points.iter().map(|&p| place(p)).collect::<Vec<_>>(), series.color);
                }
                Shape::Bars(width) => {
                    for &(x, y) in &series.points {
                        let ((left, top), (right, bottom)) =
                            (place((x - width / 2.0, y)), place((x + width / 2.0, 0.0)));
                        svg.bar((left + 0.5, top), (right - left - 1.0, bottom - top), series.color);
                    }
                }
            }
            let y = TOP + 18.0 + 18.0 * row as f32;
            svg.line((LEFT + WIDTH - 230.0, y - 4.0), (LEFT + WIDTH - 206.0, y - 4.0), series.color, 3.0);
            svg.text((LEFT + WIDTH - 200.0, y), 13.0, "start", series.name);
        }
        svg.finish()
    }

    /// Returns about five round numbers of a range, or its powers of ten.
    fn ticks(&self, low: f32, high: f32) -> Vec<(f32, String)> {
        if self.logarithmic {
            return (low as i32..=high as i32).map(|power| (power as f32, format!("{}", 10f32.powi(power)))).collect();
        }
        let rough = (high - low) / 5.0;
        let power = 10f32.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().find(|&step| step >= rough).unwrap_or(rough);
        ((low / step).ceil() as i32..=(high / step).floor() as i32)
            .map(|k| (k as f32 * step, format!("{}", (k as f32 * step * 1000.0).round() / 1000.0)))
            .collect()
    }
}
