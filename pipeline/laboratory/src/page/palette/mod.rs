//! Colors of lines and bars, for light and dark pages.
//!
//! Colors are distinguishable with deficient color vision. With protanopia, deuteranopia or tritanopia \[Machado09\],
//! any two colors differ by at least ΔE*ab = 12. Each color also differs from its background by at least 12. A test
//! computes these differences.

#[cfg(test)]
mod color_vision;

/// Number of colors in the palette; higher color numbers wrap around.
pub(super) const COLORS: usize = 17;

/// Colors on a white background. The first nine have distinct names, such as blue and orange.
const LIGHT: [&str; COLORS] = [
    "#013c89", "#fb4f09", "#567650", "#591b04", "#972df4", "#419999", "#3a3c3e", "#86531b", "#e40bd2", "#6f4176",
    "#0c006e", "#fa4293", "#02001f", "#210202", "#4268b9", "#4c0052", "#0208fa",
];
/// Colors on a black background.
const DARK: [&str; COLORS] = [
    "#525ce8", "#fad103", "#6ab685", "#b34c3b", "#d6a6f5", "#7cfffe", "#83757c", "#9f7500", "#e203b5", "#63d2b5",
    "#e18751", "#f9ffe0", "#bef5a1", "#d3a00d", "#d2d863", "#9888f2", "#f760bd",
];

/// Returns the CSS class of a line in color `number`.
pub(super) fn stroke_class(number: usize) -> String {
    format!("s{}", number % COLORS)
}

/// Returns the CSS class of an area in color `number`.
pub(super) fn fill_class(number: usize) -> String {
    format!("f{}", number % COLORS)
}

/// Returns the CSS rules of the classes for files, which have a white background.
pub(super) fn rules_for_files() -> String {
    let rule = |(i, color): (usize, &&str)| format!(".s{i}{{stroke:{color}}}.f{i}{{fill:{color}}}");
    LIGHT.iter().enumerate().map(rule).collect()
}

/// Returns the CSS rules of the classes for pages, with the light or dark background of the reader's browser.
pub(super) fn rules_for_pages() -> String {
    let values = |colors: [&str; COLORS]| -> String {
        colors.iter().enumerate().map(|(i, color)| format!("--c{i}:{color};")).collect()
    };
    let rules: String = (0..COLORS).map(|i| format!(".s{i}{{stroke:var(--c{i})}}.f{i}{{fill:var(--c{i})}}")).collect();
    let (light, dark) = (values(LIGHT), values(DARK));
    format!(":root{{{light}}}\n@media (prefers-color-scheme:dark){{:root{{{dark}}}}}\n{rules}")
}

#[cfg(test)]
mod tests {
    use super::color_vision::{contrast, least_difference};
    use super::*;

    /// Minimum difference between two colors, and between a color and its background (ΔE*ab).
    const LEAST: f64 = 12.0;
    /// Minimum contrast between lines and their background: WCAG 2.2, success criterion 1.4.11.
    const LEAST_CONTRAST: f64 = 3.0;

    #[test]
    fn all_eyes_tell_each_two_colors_apart() {
        // Check the backgrounds of pages and plots that the template contains.
        let template = include_str!("../templates/base.html");
        for (name, colors, backgrounds) in
            [("light", LIGHT, ["#ffffff", "#f5f6f8"]), ("dark", DARK, ["#14171c", "#1d2128"])]
        {
            let mut smallest = f64::INFINITY;
            for (i, color) in colors.iter().enumerate() {
                for other in colors[..i].iter().chain(&backgrounds) {
                    let (difference, vision) = least_difference(color, other);
                    assert!(difference >= LEAST, "{color} and {other}, {vision}: {difference}");
                    smallest = smallest.min(difference);
                }
                for background in backgrounds {
                    assert!(template.contains(background), "{background} is not the template's");
                    assert!(contrast(color, background) >= LEAST_CONTRAST, "{color} on {background}");
                }
            }
            println!("{name}: smallest difference {smallest:.2}");
        }
    }

    #[test]
    fn each_color_has_its_rules() {
        let (files, pages) = (rules_for_files(), rules_for_pages());
        for number in 0..COLORS {
            for class in [stroke_class(number), fill_class(number)] {
                assert!(files.contains(&format!(".{class}{{")) && pages.contains(&format!(".{class}{{")), "{class}");
            }
        }
        assert_eq!(stroke_class(COLORS), stroke_class(0));
    }
}
