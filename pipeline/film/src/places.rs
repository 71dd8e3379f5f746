//! Paths of a run's files. Outputs must differ from each other and from inputs.

use crate::error::{Error, Result};
use pipeline::streams::is_standard_output;
use render_core::scene::Scene;
use std::fs;
use std::path::{Path, PathBuf};

/// Input and output files, with names for messages.
#[derive(Clone, Debug, Default)]
pub struct FilePlaces {
    read: Vec<(String, PathBuf)>,
    /// Name, path as given, and resolved path of each output file.
    written: Vec<(String, PathBuf, PathBuf)>,
}

impl FilePlaces {
    /// Returns the input files of `scene`.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let read = scene.origin.files.iter().map(|path| ("the scene".into(), path.clone()));
        Self { read: read.collect(), written: Vec::new() }
    }

    /// Adds an input file, if given, with its `name` for messages.
    #[must_use]
    pub fn reads(mut self, name: &str, path: Option<&Path>) -> Self {
        self.read.extend(path.and_then(resolved).map(|path| (name.into(), path)));
        self
    }

    /// Adds an output file, if given, with the `name` of its option.
    #[must_use]
    pub fn writes(mut self, name: &str, path: Option<&Path>) -> Self {
        let file = path.and_then(|path| Some((path, resolved(path)?)));
        self.written.extend(file.map(|(path, file)| (name.into(), path.into(), file)));
        self
    }

    /// Checks all files. Call this function before any output is written.
    ///
    /// # Errors
    /// If an output is also an input or another output.
    pub fn check(&self) -> Result<()> {
        for (place, (name, path, file)) in self.written.iter().enumerate() {
            let fail = |of: &str| {
                let path = path.display();
                Err(Error::Options(format!("{name} {path}: this is a file of {of}; choose another name")))
            };
            // Compare resolved paths, so that links and `..` cannot hide equal files.
            if let Some((of, _)) = self.read.iter().find(|(_, other)| other == file) {
                return fail(of);
            }
            if let Some((of, ..)) = self.written[..place].iter().find(|(.., other)| other == file) {
                return fail(of);
            }
        }
        Ok(())
    }
}

/// Resolves links and `..` in a path, for existing and new files. Returns `None` for devices and pipes, which may
/// receive several outputs. Standard output counts as a file, because two outputs would mix there.
fn resolved(path: &Path) -> Option<PathBuf> {
    if is_standard_output(path) {
        return Some("-".into());
    }
    match fs::metadata(path) {
        Ok(metadata) if !metadata.is_file() => None,
        Ok(_) => Some(fs::canonicalize(path).unwrap_or_else(|_| path.into())),
        Err(_) => {
            // Resolve only the folder of a new file, because a missing file has no canonical path.
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            let folder = fs::canonicalize(folder).unwrap_or_else(|_| folder.into());
            Some(folder.join(path.file_name()?))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_file_by_any_path_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("sub")).unwrap();
        fs::write(path("scene.glb"), b"").unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink("sub", path("link")).unwrap();
        let check = |film: &str, report: &str| {
            let places = FilePlaces::default().reads("the scene", Some(&path("scene.glb")));
            places.writes("-o", Some(&path(film))).writes("--report", Some(&path(report))).check()
        };
        check("film.m2v", "film.json").unwrap();
        check("film.m2v", "sub/film.m2v").unwrap();
        check("/dev/null", "/dev/null").unwrap();
        let both = FilePlaces::default().writes("-o", Some("-".as_ref()));
        assert!(both.writes("--report", Some("/dev/stdout".as_ref())).check().is_err());
        for (film, report, words) in [
            ("film.m2v", "film.m2v", ["--report", "file of -o"]),
            ("film.m2v", "./film.m2v", ["--report", "file of -o"]),
            ("film.m2v", "sub/../film.m2v", ["--report", "file of -o"]),
            ("film.m2v", "scene.glb", ["--report", "the scene"]),
            ("sub/../scene.glb", "report.json", ["-o", "the scene"]),
            #[cfg(unix)]
            ("sub/film.m2v", "link/film.m2v", ["--report", "file of -o"]),
        ] {
            let message = check(film, report).unwrap_err().to_string();
            assert!(words.iter().all(|word| message.contains(word)), "{film} {report}: {message}");
        }
    }
}
