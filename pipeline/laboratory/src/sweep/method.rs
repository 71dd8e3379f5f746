//! Rendering methods that a sweep compares.

use render2mpeg::Options;
use render2mpeg::settings::Switch;
use renderer::settings::{Lighting, PixelShading, Stopping, Thresholds};

/// Way in which a method makes its frames.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Way {
    /// Rendering as a film, with the given changes to the default options.
    Film(fn(&mut Options)),
    /// Path tracing with the given number of paths per pixel.
    Paths(u32),
}

/// Rendering method; one row of [`METHODS`].
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// Name on the command line and in files.
    pub name: &'static str,
    /// Label of the method in plots; `{κ}` is replaced by the multiplier in use.
    pub label: &'static str,
    /// Way in which the method makes frames.
    pub way: Way,
    /// True if indirect light is cached and interpolated.
    pub cache: bool,
    /// True if rendering depends on the quantiser.
    pub steered: bool,
    /// Number of the method's own color and mark in plots.
    pub color: usize,
}

/// All methods, in the order of plots and tables. To add a method, add a row to this table.
///
/// Without the cache, every pixel has its own lightcut, and light is not compensated, as in \[Herzog08\].
pub const METHODS: &[Method] = &[
    film("lightcuts", "2 %", 6, |w| w.thresholds = Some(Thresholds::Fixed(0.02))),
    film("paper", "κ = 1", 3, |w| masking(w).kappa = Some(1.0)).steered(),
    film("paper-calibrated", "κ = 1, 99 % within", 9, |w| {
        masking(w).kappa = Some(1.0);
        w.within = Some(0.99);
    })
    .steered(),
    film("perceptual", "κ = {κ}", 0, |w| _ = masking(w)).steered(),
    film("calibrated", "calibrated", 4, |w| masking(w).stopping = Some(Stopping::Calibrated)).steered(),
    film("codec", "codec", 5, |w| w.thresholds = Some(Thresholds::Codec)).steered(),
    film("codec-calibrated", "codec, calibrated", 7, |w| {
        w.thresholds = Some(Thresholds::Codec);
        w.stopping = Some(Stopping::Calibrated);
    })
    .steered(),
    film("lightcuts-cache", "2 %, cache", 12, |w| full(w).thresholds = Some(Thresholds::Fixed(0.02))).cached(),
    film("paper-cache", "κ = 1, cache", 8, |w| masking(full(w)).kappa = Some(1.0)).cached().steered(),
    film("perceptual-cache", "κ = {κ}, cache", 14, |w| _ = masking(w)).cached().steered(),
    film("calibrated-cache", "calibrated, cache", 15, |w| masking(w).stopping = Some(Stopping::Calibrated))
        .cached()
        .steered(),
    film("codec-cache-full", "codec, cache, every pixel lit", 10, |w| full(w).thresholds = Some(Thresholds::Codec))
        .cached()
        .steered(),
    film("codec-cache", "codec, cache", 1, |w| w.thresholds = Some(Thresholds::Codec)).cached().steered(),
    paths("paths-4", "4 paths", 4, 11),
    paths("paths-16", "16 paths", 16, 13),
    paths("paths-64", "64 paths", 64, 2),
];

/// Name of the method with the default options of films.
pub const DEFAULT_METHOD: &str = "codec-cache";

/// Selects the thresholds of the masking model.
fn masking(options: &mut Options) -> &mut Options {
    options.thresholds = Some(Thresholds::Perceptual);
    options
}

/// Selects full shading, which shades every pixel of each frame.
fn full(options: &mut Options) -> &mut Options {
    options.shading = Some(PixelShading::Full);
    options
}

/// Returns a method that renders films without cache and does not depend on the quantiser.
const fn film(name: &'static str, label: &'static str, color: usize, change: fn(&mut Options)) -> Method {
    Method { name, label, way: Way::Film(change), cache: false, steered: false, color }
}

const fn paths(name: &'static str, label: &'static str, spp: u32, color: usize) -> Method {
    Method { name, label, way: Way::Paths(spp), cache: true, steered: false, color }
}

/// Error for the name of a method that does not exist. The message lists all methods.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("\"{name}\" is not a method; methods are {}", all_names())]
pub struct UnknownMethod {
    /// Name that the user typed.
    pub name: String,
}

fn all_names() -> String {
    METHODS.iter().map(|method| method.name).collect::<Vec<_>>().join(", ")
}

impl Method {
    const fn cached(self) -> Self {
        Self { cache: true, ..self }
    }

    const fn steered(self) -> Self {
        Self { steered: true, ..self }
    }

    /// Returns the method called `name`.
    ///
    /// # Errors
    /// If no method has this name.
    pub fn named(name: &str) -> Result<&'static Method, UnknownMethod> {
        METHODS.iter().find(|method| method.name == name).ok_or_else(|| UnknownMethod { name: name.into() })
    }

    /// Returns the baseline for speed-ups: fixed thresholds of 2 %, with or without cache like this method. `None` for
    /// path tracing.
    pub fn baseline(&self) -> Option<&'static Method> {
        let name = if self.cache { "lightcuts-cache" } else { "lightcuts" };
        match self.way {
            Way::Film(_) => METHODS.iter().find(|method| method.name == name),
            Way::Paths(_) => None,
        }
    }

    /// Returns whether the method renders films rather than path tracing.
    pub fn is_film(&self) -> bool {
        matches!(self.way, Way::Film(_))
    }

    /// Returns whether lost short-range light is compensated: with the cache, and for path tracing, which loses no
    /// light.
    pub fn compensates(&self) -> bool {
        self.cache
    }

    /// Returns the options of a film rendered with this method, given the options `common` to all methods.
    pub fn options(&self, common: &Options) -> Options {
        let switch = |on| Some(if on { Switch::On } else { Switch::Off });
        let mut options =
            Options { cache: switch(self.cache), compensation: switch(self.compensates()), ..common.clone() };
        // Apply the method's changes last, so that they override the common options.
        if let Way::Film(change) = self.way {
            change(&mut options);
        }
        options
    }

    /// Returns the approximate time per frame relative to a frame with the cache, measured on `cornell` at 160×160.
    /// Only progress reports use it.
    pub fn weight(&self) -> u64 {
        match self.way {
            Way::Film(_) if self.cache => 1,
            Way::Film(_) => 2,
            Way::Paths(spp) => u64::from(spp / 5).max(1),
        }
    }
}

/// [`Method::weight`] of the reference films.
pub const REFERENCE_WEIGHT: u64 = 20;

/// Returns the options of the reference, with every light, and with compensation if `compensates`.
pub fn reference_options(common: &Options, compensates: bool) -> Options {
    let compensation = Some(if compensates { Switch::On } else { Switch::Off });
    let (lighting, cache) = (Some(Lighting::AllLights), Some(Switch::Off));
    // Use the finest quantiser, which requires the most photons.
    Options { lighting, cache, compensation, qscale: Some(1), ..common.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_has_a_color_of_its_own() {
        let mut colors: Vec<usize> = METHODS.iter().map(|method| method.color).collect();
        colors.sort_unstable();
        assert_eq!(colors, (0..METHODS.len()).collect::<Vec<usize>>());
    }

    #[test]
    fn names_are_found_or_told() {
        for method in METHODS {
            assert_eq!(Method::named(method.name).unwrap().label, method.label);
            assert!(method.baseline().is_none_or(|base| base.cache == method.cache && !base.steered));
        }
        assert!(Method::named("photons").unwrap_err().to_string().contains("perceptual-cache"));
    }
}
