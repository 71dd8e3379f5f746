//! Places of the files of a run: no two are the same, and none that is read is written.

use crate::error::{Error, Result};
use pipeline::streams::is_standard_output;
use render_core::scene::Scene;
use std::fs;
use std::path::{Path, PathBuf};

/// Files that are read and written, with what they are called in messages.
#[derive(Clone, Debug, Default)]
pub struct FilePlaces {
    read: Vec<(String, PathBuf)>,
    /// Names, paths as they were stated, and the files that these lead to.
    written: Vec<(String, PathBuf, PathBuf)>,
}

impl FilePlaces {
    /// The files that `scene` was read from.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let read = scene.origin.files.iter().map(|path| ("the scene".into(), path.clone()));
        Self { read: read.collect(), written: Vec::new() }
    }

    /// A file that is read, if there is one: `name` says of what.
    #[must_use]
    pub fn reads(mut self, name: &str, path: Option<&Path>) -> Self {
        self.read.extend(path.and_then(resolved).map(|path| (name.into(), path)));
        self
    }

    /// A file that is written, if there is one: `name` is its option.
    #[must_use]
    pub fn writes(mut self, name: &str, path: Option<&Path>) -> Self {
        let file = path.and_then(|path| Some((path, resolved(path)?)));
        self.written.extend(file.map(|(path, file)| (name.into(), path.into(), file)));
        self
    }

    /// Checks all of them, before any work is done.
    ///
    /// # Errors
    /// A file would be written that is read, or that something else is written to.
    pub fn check(&self) -> Result<()> {
        for (place, (name, path, file)) in self.written.iter().enumerate() {
            let fail = |of: &str| {
                let path = path.display();
                Err(Error::Options(format!("{name} {path}: that is a file of {of}; choose another name")))
            };
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

/// The file that a path leads to, links and `..` followed, whether it is there or not yet; none for devices and pipes, which any number
/// of outputs may go to. Standard output counts as a file: two outputs would get mixed up there.
fn resolved(path: &Path) -> Option<PathBuf> {
    if is_standard_output(path) {
        return Some("-".into());
    }
    match fs::metadata(path) {
        Ok(metadata) if !metadata.is_file() => None,
        Ok(_) => Some(fs::canonicalize(path).unwrap_or_else(|_| path.into())),
        Err(_) => {
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
