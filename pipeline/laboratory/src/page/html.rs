//! Rendering of HTML templates.

use base64::Engine;
use minijinja::{Environment, Value, context};
use render2mpeg::error::{Context, Error, Result};

/// Returns `bytes` in base64.
pub(super) fn base64(bytes: &[u8]) -> String {
    base64::engine::general_purpose::STANDARD.encode(bytes)
}

/// Returns `bytes` as a data URI.
pub fn data_uri(mime: &str, bytes: &[u8]) -> String {
    format!("data:{mime};base64,{}", base64(bytes))
}

/// Renders `template` with `values`. Values are escaped unless the template marks them as safe.
///
/// # Errors
/// If the template fails, which is a bug.
pub fn render_template(template: &str, values: Value) -> Result<String> {
    let mut environment = Environment::new();
    // Use a name that ends in `.html`, which enables escaping.
    environment.add_template("base.html", include_str!("templates/base.html")).map_err(Error::other)?;
    environment.add_template("player.html", include_str!("templates/player.html")).map_err(Error::other)?;
    environment.add_template("sweep.html", include_str!("templates/sweep.html")).map_err(Error::other)?;
    environment.add_template("run.html", include_str!("templates/run.html")).map_err(Error::other)?;
    let program = concat!("render2mpeg ", env!("CARGO_PKG_VERSION"));
    let template = environment.get_template(template).map_err(Error::other)?;
    let colors = super::palette::rules_for_pages();
    template.render(context! { program, colors, ..values }).context("the page cannot be rendered")
}
