//! Optional features of the program, which are Cargo features with the same names.

use anyhow::{Result, bail};
use std::sync::OnceLock;

/// Cargo feature, and the commands that require it.
struct ProgramPart {
    feature: &'static str,
    is_built: bool,
    commands: &'static [&'static str],
}

const PARTS: [ProgramPart; 7] = [
    ProgramPart { feature: "textures", is_built: cfg!(feature = "textures"), commands: &[] },
    ProgramPart { feature: "webp", is_built: cfg!(feature = "webp"), commands: &[] },
    ProgramPart { feature: "basis", is_built: cfg!(feature = "basis"), commands: &[] },
    ProgramPart { feature: "meshopt", is_built: cfg!(feature = "meshopt"), commands: &[] },
    ProgramPart { feature: "draco", is_built: cfg!(feature = "draco"), commands: &[] },
    ProgramPart { feature: "bake", is_built: cfg!(feature = "bake"), commands: &["bake"] },
    ProgramPart { feature: "mpi", is_built: cfg!(feature = "mpi"), commands: &[] },
];

/// Reports that `feature` is missing, if it is `requested` and was not built.
///
/// # Errors
/// If `feature` is `requested` and was not built.
pub fn need(feature: &str, requested: bool) -> Result<()> {
    match PARTS.iter().find(|part| part.feature == feature && !part.is_built) {
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
    PARTS.iter().try_for_each(|part| need(part.feature, part.commands.contains(&command)))
}

/// Returns the version of the program, with the lists of features built and left out.
pub fn version() -> &'static str {
    static TEXT: OnceLock<String> = OnceLock::new();
    let names = |built| PARTS.iter().filter(|part| part.is_built == built).map(|part| part.feature).collect::<Vec<_>>();
    let list = |names: Vec<&str>| if names.is_empty() { "none".into() } else { names.join(", ") };
    let text = |version| format!("{version}\nbuilt with: {}\nleft out: {}", list(names(true)), list(names(false)));
    TEXT.get_or_init(|| text(env!("CARGO_PKG_VERSION")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_named_with_its_remedy() {
        for part in &PARTS {
            assert!(need(part.feature, false).is_ok());
            for needed in [need(part.feature, true), part.commands.iter().try_for_each(|command| need_for(command))] {
                match needed {
                    Ok(()) => assert!(part.is_built || part.commands.is_empty(), "{}", part.feature),
                    Err(error) => {
                        assert!(!part.is_built && error.to_string().contains(&format!("--features {}", part.feature)));
                    }
                }
            }
            assert_eq!(version().find(part.feature) < version().find("left out"), part.is_built);
        }
        assert!(need_for("render").is_ok());
    }
}
