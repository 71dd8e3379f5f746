//! Writes the reference pages and schemas that are generated from the program:
//! `cargo run -p render2mpeg-cli --example reference`.

use std::fs;
use std::path::Path;

fn main() -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference");
    fs::write(folder.join("options.md"), program::options_page())?;
    let schemas =
        [("report.schema.json", program::report_schema()), ("progress.schema.json", program::progress_schema())];
    for (name, schema) in schemas {
        fs::write(folder.join(name), serde_json::to_string_pretty(&schema)? + "\n")?;
    }
    Ok(())
}
