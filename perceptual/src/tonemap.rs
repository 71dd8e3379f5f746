//! Invertible tone mapping between linear radiance and display values in 0…1.
//!
//! The mapping has three steps per channel, each with an exact inverse in closed form:
//!
//! ```text
//! x = exposure · radiance            v = curve(x), 0…1, linear display light            display = transfer(v), 0…1
//! ```
//!
//! Eq. (4) of \[Herzog08\] needs the inverse, which converts a luma change by the codec to a luminance change. The
//! sources are \[Reinhard02\] for the two Reinhard curves (eqs. 3 and 4, without local adaptation), \[Hable10\] for the
//! filmic curve, and IEC 61966-2-1 for sRGB.
//!
//! # Differences from the sources
//! - Every curve maps each channel. \[Reinhard02\] scales luminance.
//! - The filmic curve has a slightly stronger toe than the published curve, and a fixed gain that preserves 18 % gray.
//!   It can replace sRGB without a change of brightness.
//! - Reinhard's global curve never reaches white, but [`ToneMap::decode`] of display white is finite. The inverse stops
//!   at a curve value of 255/256, where the last half code value of 8-bit luma begins. Pictures are therefore
//!   unaffected.

mod blend;

use crate::bounded;
use std::{fmt, str::FromStr};

pub use blend::PixelFragment;

/// Curve value at which the inverse of Reinhard's global curve stops. Decoded white is then finite (x = 255).
const REINHARD_LIMIT: f64 = 1.0 - 1.0 / 256.0;
/// Smallest exposed radiance for [`ToneMap::derivative`]. A pure power has an infinite slope at 0.
const SMALLEST_SLOPE_ARGUMENT: f64 = 1e-9;

/// Tone curve from linear light to display light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Operator {
    /// Clipping at 1, then the power `1 / gamma`. Ignores [`ToneMap::display`].
    Gamma,
    /// Clipping at 1, then the sRGB transfer curve. Ignores [`ToneMap::display`].
    Srgb,
    /// `x / (1 + x)` \[Reinhard02, eq. 3\], then the display's transfer curve. It never clips.
    Reinhard,
    /// `x (1 + x / white²) / (1 + x)` \[Reinhard02, eq. 4\], then the display's transfer curve. `white` maps to 1.
    ExtendedReinhard,
    /// A filmic curve with a slight toe and a soft shoulder \[Hable10\], then the display's transfer curve. A gray of
    /// 0.18 keeps its value, and 3.54 maps to 1.
    #[default]
    Filmic,
}

impl Operator {
    /// All operators, in the order of the help text.
    pub const ALL: [Self; 5] = [Self::Gamma, Self::Srgb, Self::Reinhard, Self::ExtendedReinhard, Self::Filmic];

    /// Name of the operator in settings files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Gamma => "gamma",
            Self::Srgb => "srgb",
            Self::Reinhard => "reinhard",
            Self::ExtendedReinhard => "extended_reinhard",
            Self::Filmic => "filmic",
        }
    }
}

impl fmt::Display for Operator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Error for a name that is not in [`Operator::ALL`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownOperator(pub String);

impl fmt::Display for UnknownOperator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let known = Operator::ALL.map(Operator::name).join(", ");
        write!(f, "unknown tone mapping operator \"{}\" (expected one of: {known})", self.0)
    }
}

impl std::error::Error for UnknownOperator {}

impl FromStr for Operator {
    type Err = UnknownOperator;

    /// Parses an operator's name. Accepts `-` instead of `_`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wanted = text.replace('-', "_");
        Self::ALL.into_iter().find(|operator| operator.name() == wanted).ok_or_else(|| UnknownOperator(text.to_owned()))
    }
}

/// Transfer curve from display light to the display value, for operators that do not define one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Display {
    /// Piecewise transfer curve of IEC 61966-2-1.
    #[default]
    Srgb,
    /// Transfer curve with the power `1 / gamma`.
    Gamma,
}

/// Tone mapping: an operator and its parameters.
///
/// Values outside their ranges are clamped, so that no setting makes a picture non-finite. [`ToneMap::check`] reports
/// values outside their ranges.
///
/// In a settings file, every field is optional:
///
/// ```toml
/// [tone_mapping]
/// operator = "extended_reinhard"
/// exposure = 1.5
/// white = 6.0
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct ToneMap {
    /// Tone curve from linear light to display light.
    pub operator: Operator,
    /// Factor applied to radiance before the curve, 1e-20…1e20. A factor of 4 is two stops. Default 1.
    pub exposure: f32,
    /// Exponent of the display, 1…4, for [`Operator::Gamma`] and [`Display::Gamma`]. Default 2.2.
    pub gamma: f32,
    /// Exposed radiance that [`Operator::ExtendedReinhard`] maps to white, 0.01…1000. Default 4.
    pub white: f32,
    /// Transfer curve applied after the Reinhard and filmic curves. Default sRGB.
    pub display: Display,
}

impl Default for ToneMap {
    fn default() -> Self {
        Self { operator: Operator::Filmic, exposure: 1.0, gamma: 2.2, white: 4.0, display: Display::Srgb }
    }
}

/// Error for a field of [`ToneMap`] outside its range.
#[derive(Clone, Debug, PartialEq)]
pub struct OutOfRange {
    /// Name of the field.
    pub field: &'static str,
    /// Value of the field.
    pub value: f32,
    /// Smallest and largest allowed value.
    pub range: (f32, f32),
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (least, most) = self.range;
        // Use exponents for large ranges, because they are shorter.
        let range = if most > 1e6 { format!("{least:e} to {most:e}") } else { format!("{least} to {most}") };
        let range = if self.value <= 0.0 { format!("be above 0 ({range})") } else { format!("lie in {range}") };
        write!(f, "{} is {}; it must {range}", self.field, self.value)
    }
}

impl std::error::Error for OutOfRange {}

const EXPOSURE_RANGE: (f32, f32) = (1e-20, 1e20);
const GAMMA_RANGE: (f32, f32) = (1.0, 4.0);
const WHITE_RANGE: (f32, f32) = (0.01, 1000.0);

/// Clamps `value` to `range`. NaN becomes `otherwise`.
fn within(value: f32, range: (f32, f32), otherwise: f32) -> f64 {
    f64::from(if value.is_nan() { otherwise } else { value.clamp(range.0, range.1) })
}

impl ToneMap {
    /// Returns a tone map that clips and applies the power `1 / gamma`, with exposure 1.
    #[must_use]
    pub fn gamma(gamma: f32) -> Self {
        Self { operator: Operator::Gamma, gamma, ..Self::default() }
    }

    /// Returns a tone map that clips and applies the sRGB curve, with exposure 1.
    #[must_use]
    pub fn srgb() -> Self {
        Self::of(Operator::Srgb)
    }

    /// Returns a tone map with this `operator` and default parameters.
    #[must_use]
    pub fn of(operator: Operator) -> Self {
        Self { operator, ..Self::default() }
    }

    /// Returns a tone map with the extended Reinhard curve and sRGB, with exposure 1.
    #[must_use]
    pub fn extended_reinhard(white: f32) -> Self {
        Self { operator: Operator::ExtendedReinhard, white, ..Self::default() }
    }

    /// Returns the same tone map with another exposure.
    #[must_use]
    pub fn with_exposure(self, exposure: f32) -> Self {
        Self { exposure, ..self }
    }

    /// Checks that each field is a number within its range.
    ///
    /// # Errors
    /// If a field is not within its range. The error describes the first such field.
    pub fn check(&self) -> Result<(), OutOfRange> {
        let fields = [
            ("exposure", self.exposure, EXPOSURE_RANGE),
            ("gamma", self.gamma, GAMMA_RANGE),
            ("white", self.white, WHITE_RANGE),
        ];
        match fields.into_iter().find(|(_, value, range)| !(range.0..=range.1).contains(value)) {
            Some((field, value, range)) => Err(OutOfRange { field, value, range }),
            None => Ok(()),
        }
    }

    /// Returns the display value, 0…1, of linear radiance.
    ///
    /// The function is monotonic in `linear` and saturates at 1. It returns 0 for negative values and NaN.
    #[must_use]
    pub fn encode(&self, linear: f32) -> f32 {
        // `max` turns NaN into 0.
        let x = self.exposure() * f64::from(linear.max(0.0));
        self.transfer().forward(self.curve().forward(x)) as f32
    }

    /// Returns the linear radiance of a display value: the inverse of [`ToneMap::encode`] below saturation.
    ///
    /// Values below 0 and NaN are replaced by 0, values above 1 by 1. Display white decodes to the smallest saturating
    /// radiance. [`Operator::Reinhard`] never saturates, and its white decodes to 255 / exposure.
    #[must_use]
    pub fn decode(&self, display: f32) -> f32 {
        let v = self.transfer().inverse(f64::from(bounded(display, 0.0, 1.0)));
        ((self.curve().inverse(v) / self.exposure()).min(f64::from(f32::MAX))) as f32
    }

    /// Returns the slope of [`ToneMap::encode`]: display value per unit of radiance. It is 0 beyond saturation.
    ///
    /// A pure power has an infinite slope at 0. For exposed radiance below 1e-9, the slope at 1e-9 is returned.
    #[must_use]
    pub fn derivative(&self, linear: f32) -> f32 {
        let x = (self.exposure() * f64::from(linear.max(0.0))).max(SMALLEST_SLOPE_ARGUMENT);
        let (curve, transfer) = (self.curve(), self.transfer());
        let slope = transfer.slope(curve.forward(x)) * curve.slope(x) * self.exposure();
        slope.min(f64::from(f32::MAX)) as f32
    }

    /// Smallest radiance that is displayed as white. It is the upper limit of [`ToneMap::decode`].
    #[must_use]
    pub fn saturation(&self) -> f32 {
        self.decode(1.0)
    }

    fn exposure(&self) -> f64 {
        within(self.exposure, EXPOSURE_RANGE, 1.0)
    }

    fn curve(&self) -> Curve {
        match self.operator {
            Operator::Gamma | Operator::Srgb => Curve::Clip,
            Operator::Reinhard => Curve::Reinhard,
            Operator::ExtendedReinhard => Curve::ExtendedReinhard { white: within(self.white, WHITE_RANGE, 4.0) },
            Operator::Filmic => Curve::Filmic,
        }
    }

    fn transfer(&self) -> Transfer {
        match (self.operator, self.display) {
            (Operator::Gamma, _) => Transfer::Power(within(self.gamma, GAMMA_RANGE, 2.2)),
            (Operator::Srgb, _) | (_, Display::Srgb) => Transfer::Srgb,
            (_, Display::Gamma) => Transfer::Power(within(self.gamma, GAMMA_RANGE, 2.2)),
        }
    }
}

/// Map from exposed radiance x ≥ 0 to display light v in 0…1.
#[derive(Clone, Copy)]
enum Curve {
    Clip,
    Reinhard,
    ExtendedReinhard { white: f64 },
    Filmic,
}

impl Curve {
    fn forward(self, x: f64) -> f64 {
        match self {
            Self::Clip => x.min(1.0),
            // This form gives 1 for infinite x.
            Self::Reinhard => 1.0 - 1.0 / (1.0 + x),
            Self::ExtendedReinhard { white } if x < white => x * (1.0 + x / (white * white)) / (1.0 + x),
            Self::Filmic if x < filmic::WHITE => filmic::forward(x),
            Self::ExtendedReinhard { .. } | Self::Filmic => 1.0,
        }
    }

    fn inverse(self, v: f64) -> f64 {
        match self {
            Self::Clip => v,
            Self::Reinhard => {
                let v = v.min(REINHARD_LIMIT);
                v / (1.0 - v)
            }
            // Compute the positive root of x²/white² + (1 − v) x − v = 0, in a form without cancellation.
            Self::ExtendedReinhard { white } => {
                let rest = 1.0 - v;
                2.0 * v / (rest + (rest * rest + 4.0 * v / (white * white)).sqrt())
            }
            Self::Filmic => filmic::inverse(v),
        }
    }

    fn slope(self, x: f64) -> f64 {
        match self {
            Self::Clip if x < 1.0 => 1.0,
            Self::Reinhard => (1.0 + x).powi(-2),
            Self::ExtendedReinhard { white } if x < white => {
                (1.0 + x * (2.0 + x) / (white * white)) / ((1.0 + x) * (1.0 + x))
            }
            Self::Filmic if x < filmic::WHITE => filmic::slope(x),
            Self::Clip | Self::ExtendedReinhard { .. } | Self::Filmic => 0.0,
        }
    }
}

/// Filmic curve of \[Hable10\], divided by its value at white.
///
/// ```text
/// h(x) = (x (A x + C B) + D E) / (x (A x + B) + D F) − E / F          v = h(GAIN x) / h(W)
/// ```
///
/// The curve is a quotient of quadratics, so its inverse is the root of a quadratic.
mod filmic {
    /// Shoulder strength, linear strength, linear angle, toe strength, toe numerator, toe denominator. All except the
    /// toe numerator are the published values of \[Hable10\].
    const A: f64 = 0.15;
    const B: f64 = 0.50;
    const C: f64 = 0.10;
    const D: f64 = 0.20;
    /// Toe numerator. The published value 0.02 leaves no toe on an sRGB display. With 0.024 the curve is up to a tenth
    /// steeper than proportional between 1 % and 5 % gray. Shadows keep depth and are not crushed to black.
    const E: f64 = 0.024;
    const F: f64 = 0.30;
    /// Linear white point, as published.
    const W: f64 = 11.2;
    /// Solution of h(0.18 · GAIN) = 0.18 · h(W), which preserves 18 % gray. It is not from the source. A test checks
    /// it.
    const GAIN: f64 = 3.160_697_751_730_8;
    /// Exposed radiance that maps to 1.
    pub const WHITE: f64 = W / GAIN;

    fn unscaled(x: f64) -> f64 {
        // Subtract E/F before the division, without cancellation near 0: h(x) = x (A (1 − E/F) x + B (C − E/F)) /
        // denominator.
        let ratio = E / F;
        x * (A * (1.0 - ratio) * x + B * (C - ratio)) / (x * (A * x + B) + D * F)
    }

    pub fn forward(x: f64) -> f64 {
        unscaled(GAIN * x) / unscaled(W)
    }

    pub fn inverse(v: f64) -> f64 {
        // Let y = h + E/F. Then A (1 − y) x² + B (C − y) x − D F h = 0, which has one positive root.
        let h = v * unscaled(W);
        let y = h + E / F;
        let (a, b, c) = (A * (1.0 - y), B * (C - y), D * F * h);
        let root = (b * b + 4.0 * a * c).sqrt();
        let x = if b > 0.0 { 2.0 * c / (b + root) } else { (root - b) / (2.0 * a) };
        x / GAIN
    }

    pub fn slope(x: f64) -> f64 {
        let x = GAIN * x;
        let ratio = E / F;
        let (p, q) = (A * (1.0 - ratio), B * (C - ratio));
        let denominator = x * (A * x + B) + D * F;
        let numerator = (2.0 * p * x + q) * denominator - x * (p * x + q) * (2.0 * A * x + B);
        GAIN * numerator / (denominator * denominator * unscaled(W))
    }
}

/// Map from display light v to the display value, both 0…1.
#[derive(Clone, Copy)]
enum Transfer {
    Srgb,
    Power(f64),
}

impl Transfer {
    fn forward(self, v: f64) -> f64 {
        match self {
            Self::Srgb if v <= 0.003_130_8 => 12.92 * v,
            Self::Srgb => 1.055 * v.powf(1.0 / 2.4) - 0.055,
            Self::Power(gamma) => v.powf(1.0 / gamma),
        }
    }

    fn inverse(self, display: f64) -> f64 {
        match self {
            Self::Srgb if display <= 12.92 * 0.003_130_8 => display / 12.92,
            Self::Srgb => ((display + 0.055) / 1.055).powf(2.4),
            Self::Power(gamma) => display.powf(gamma),
        }
    }

    fn slope(self, v: f64) -> f64 {
        match self {
            Self::Srgb if v <= 0.003_130_8 => 12.92,
            Self::Srgb => 1.055 / 2.4 * v.powf(1.0 / 2.4 - 1.0),
            Self::Power(gamma) => v.powf(1.0 / gamma - 1.0) / gamma,
        }
    }
}
