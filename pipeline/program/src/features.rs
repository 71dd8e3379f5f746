//! Optional features of the program, which are Cargo features with the same names.

use anyhow::{Result, bail};
use std::sync::OnceLock;

/// Cargo feature, and the commands that require it.
struct ProgramFeature {
    name: &'static str,
    is_built: bool,
    commands: &'static [&'static str],
}

const FEATURES: [ProgramFeature; 8] = [
    ProgramFeature { name: "textures", is_built: cfg!(feature = "textures"), commands: &[] },
    ProgramFeature { name: "webp", is_built: cfg!(feature = "webp"), commands: &[] },
    ProgramFeature { name: "basis", is_built: cfg!(feature = "basis"), commands: &[] },
    ProgramFeature { name: "meshopt", is_built: cfg!(feature = "meshopt"), commands: &[] },
    ProgramFeature { name: "draco", is_built: cfg!(feature = "draco"), commands: &[] },
    ProgramFeature { name: "bake", is_built: cfg!(feature = "bake"), commands: &["bake"] },
    ProgramFeature { name: "serve", is_built: cfg!(feature = "serve"), commands: &["serve"] },
    ProgramFeature { name: "mpi", is_built: cfg!(feature = "mpi"), commands: &[] },
];

/// Reports that `feature` is missing, if it is `requested` and was not built.
///
/// # Errors
/// If `feature` is `requested` and was not built.
pub fn need(feature: &str, requested: bool) -> Result<()> {
    match FEATURES.iter().find(|one| one.name == feature && !one.is_built) {
        Some(_) if requested => {
            bail!("this build lacks the feature {feature}; build with cargo build --release --features {feature}")
        }
        _ => Ok(()),
    }
}

/// Reports the missing feature of a command. A build without the feature may not even parse the command.
///
/// # Errors
/// If the command's feature was not built.
pub fn need_for(command: &str) -> Result<()> {
    FEATURES.iter().try_for_each(|feature| need(feature.name, feature.commands.contains(&command)))
}

/// Returns the version of the program, with the lists of features built and left out.
pub fn version() -> &'static str {
    static TEXT: OnceLock<String> = OnceLock::new();
    let names = |built| {
        FEATURES.iter().filter(|feature| feature.is_built == built).map(|feature| feature.name).collect::<Vec<_>>()
    };
    let list = |names: Vec<&str>| if names.is_empty() { "none".into() } else { names.join(", ") };
    let text = |version| format!("{version}\nbuilt with: {}\nleft out: {}", list(names(true)), list(names(false)));
    TEXT.get_or_init(|| text(env!("CARGO_PKG_VERSION")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_named_with_its_remedy() {
        for feature in &FEATURES {
            assert!(need(feature.name, false).is_ok());
            for needed in [need(feature.name, true), feature.commands.iter().try_for_each(|command| need_for(command))]
            {
                match needed {
                    Ok(()) => assert!(feature.is_built || feature.commands.is_empty(), "{}", feature.name),
                    Err(error) => {
                        assert!(
                            !feature.is_built && error.to_string().contains(&format!("--features {}", feature.name))
                        );
                    }
                }
            }
            assert_eq!(version().find(feature.name) < version().find("left out"), feature.is_built);
        }
        assert!(need_for("render").is_ok());
    }
}
