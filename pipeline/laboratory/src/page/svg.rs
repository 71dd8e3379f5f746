//! Basic shapes of SVG drawings.

use super::{marks, palette};
use std::fmt::Write;

/// Drawing of fixed size that scales with the page.
#[derive(Clone, Debug)]
pub struct Svg {
    width: f64,
    height: f64,
    title: String,
    body: String,
}

/// Point of a drawing; y points down.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub x: f64,
    pub y: f64,
}

/// Returns the point (x, y).
pub(super) fn at(x: f64, y: f64) -> Point {
    Point { x, y }
}

/// Rectangle of a drawing, given by upper left corner and size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rectangle {
    pub x: f64,
    pub y: f64,
    pub width: f64,
    pub height: f64,
}

/// Style of text in a drawing.
#[derive(Clone, Copy, Debug)]
pub(super) struct TextStyle {
    /// CSS class with the text's color.
    pub class: &'static str,
    /// Anchor of the text at its position: start, middle or end.
    pub anchor: &'static str,
    /// Font size of the text \[pixels\].
    pub size: f64,
}

/// CSS rules for drawings in files, without line colors. Pages have their own rules.
const FILE_STYLE: &str =
    ".ink,.entry{fill:#1d2129}.soft{fill:#5a6270}.grid{stroke:#d9dde3}.axis{stroke:#7c8592}.hollow{fill:#ffffff}";

/// Escapes text for use in XML.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Returns a tooltip element; an empty string for empty text.
fn titled(about: &str) -> String {
    if about.is_empty() { String::new() } else { format!("<title>{}</title>", escaped(about)) }
}

impl Svg {
    /// Returns an empty drawing. Screen readers read `title`.
    pub(super) fn new(width: f64, height: f64, title: &str) -> Self {
        Self { width, height, title: title.into(), body: String::new() }
    }

    fn draw(&mut self, arguments: std::fmt::Arguments<'_>) {
        self.body.write_fmt(arguments).expect("writing into memory cannot fail");
        self.body.push('\n');
    }

    /// Draws a straight line with a CSS class.
    pub(super) fn rule(&mut self, from: Point, to: Point, class: &str) {
        self.draw(format_args!(
            r#"<line class="{class}" x1="{:.1}" y1="{:.1}" x2="{:.1}" y2="{:.1}" stroke-width="1"/>"#,
            from.x, from.y, to.x, to.y
        ));
    }

    /// Draws a line through points, in a color of the palette.
    pub(super) fn polyline(&mut self, points: &[Point], color: usize, dashed: bool) {
        let list: Vec<String> = points.iter().map(|Point { x, y }| format!("{x:.1},{y:.1}")).collect();
        let dash = if dashed { r#" stroke-dasharray="5 4""# } else { "" };
        let (list, color) = (list.join(" "), palette::stroke_class(color));
        self.draw(format_args!(
            r#"<polyline class="{color}" points="{list}" fill="none" stroke-width="2" stroke-linejoin="round"{dash}/>"#
        ));
    }

    /// Draws the mark of a color, filled or hollow, with the tooltip `about`.
    pub(super) fn point(&mut self, place: Point, color: usize, filled: bool, about: &str) {
        let fill = if filled { palette::fill_class(color) } else { "hollow".into() };
        let outline = marks::outline(color, place.x, place.y, 4.2);
        let (about, stroke) = (titled(about), palette::stroke_class(color));
        self.draw(format_args!(r#"<path class="{stroke} {fill}" d="{outline}" stroke-width="1.5">{about}</path>"#));
    }

    /// Draws a cross for a point that is not counted, with the tooltip `about`.
    pub(super) fn cross(&mut self, place: Point, color: usize, about: &str) {
        let (about, stroke, r) = (titled(about), palette::stroke_class(color), 4.2);
        let (left, right, top, bottom) = (place.x - r, place.x + r, place.y - r, place.y + r);
        self.draw(format_args!(
            r#"<path class="{stroke}" d="M{left:.1} {top:.1}L{right:.1} {bottom:.1}M{left:.1} {bottom:.1}L{right:.1} {top:.1}" fill="none" stroke-width="2">{about}</path>"#
        ));
    }

    /// Draws a rectangle in a color of the palette, with the tooltip `about`.
    pub(super) fn bar(&mut self, bar: Rectangle, color: usize, about: &str) {
        let class = palette::fill_class(color);
        self.rectangle(bar, &format!(r#"class="{class}""#), about);
    }

    /// Draws a square of a map in a gray level of 0 to 255.
    pub(super) fn gray(&mut self, square: Rectangle, gray: u8, about: &str) {
        self.rectangle(square, &format!(r##"fill="#{gray:02x}{gray:02x}{gray:02x}""##), about);
    }

    fn rectangle(&mut self, rectangle: Rectangle, fill: &str, about: &str) {
        let (Rectangle { x, y, width, height }, about) = (rectangle, titled(about));
        self.draw(format_args!(
            r#"<rect {fill} x="{x:.2}" y="{y:.2}" width="{width:.2}" height="{height:.2}">{about}</rect>"#
        ));
    }

    /// Draws text from left to right.
    pub(super) fn text(&mut self, place: Point, style: TextStyle, text: &str) {
        let (Point { x, y }, TextStyle { class, anchor, size }) = (place, style);
        let text = escaped(text);
        self.draw(format_args!(
            r#"<text class="{class}" x="{x:.1}" y="{y:.1}" font-size="{size}" text-anchor="{anchor}">{text}</text>"#
        ));
    }

    /// Draws text that runs upward.
    pub(super) fn text_upward(&mut self, place: Point, class: &str, size: f64, text: &str) {
        let (Point { x, y }, text) = (place, escaped(text));
        self.draw(format_args!(
            r#"<text class="{class} up" transform="translate({x:.1} {y:.1}) rotate(-90)" font-size="{size}" text-anchor="middle">{text}</text>"#
        ));
    }

    /// Returns the drawing for embedding in a page.
    pub fn inline(&self) -> String {
        let Self { width, height, title, body } = self;
        let title = escaped(title);
        format!(r#"<svg class="plot" viewBox="0 0 {width} {height}" role="img" aria-label="{title}">{body}</svg>"#)
    }

    /// Returns the drawing as a file with a white background.
    pub fn file(&self) -> String {
        let Self { width, height, title, body } = self;
        let (title, colors) = (escaped(title), palette::rules_for_files());
        format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="DejaVu Sans, Verdana, sans-serif">
<title>{title}</title><style>{FILE_STYLE}{colors}</style><rect width="{width}" height="{height}" fill="#ffffff"/>
{body}</svg>
"##
        )
    }
}
