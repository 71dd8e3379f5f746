//! The one way in for the files of a scene: what may be read, how much of it, and a sum of all that was.
//!
//! A scene may come from a stranger. Its names lead to regular files in its own folder, after links are followed, and nowhere else
//! unless the user allows it. Sizes are looked at before anything is read.

use std::cell::RefCell;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// Most bytes of all files of a scene together: glTF counts the bytes of a buffer in 32 bits.
const MOST_BYTES: u64 = 1 << 32;

/// Folders from which files are read that a scene names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reach {
    /// In the folder of the scene file, or below it, after links are followed.
    #[default]
    Folder,
    /// Anywhere.
    Anywhere,
}

/// The files that a scene was read from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// The folders from which they could be read.
    pub reach: Reach,
    /// Paths with all links followed, in the order of reading.
    pub files: Vec<PathBuf>,
    /// CRC-32 of the sizes and contents of all of them, in that order, and of settings that were given besides.
    pub sum: u32,
}

/// Reads files for one scene.
pub(super) struct SceneFiles {
    folder: PathBuf,
    reach: Reach,
    state: RefCell<State>,
}

struct State {
    files: Vec<PathBuf>,
    sum: crc32fast::Hasher,
    bytes_left: u64,
}

impl SceneFiles {
    /// For the scene at `scene`.
    pub fn of(scene: &Path, reach: Reach) -> Self {
        let folder = scene.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let state = State { files: Vec::new(), sum: crc32fast::Hasher::new(), bytes_left: MOST_BYTES };
        Self { folder: folder.into(), reach, state: RefCell::new(state) }
    }

    /// Reads the scene file or the settings beside it, which the user has named.
    ///
    /// # Errors
    /// The message of the system, or why the file is not read.
    pub fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        let size = self.admit(path)?;
        let mut bytes = Vec::new();
        // A file that grows meanwhile is read as far as it was admitted.
        File::open(path)?.take(size).read_to_end(&mut bytes)?;
        let mut state = self.state.borrow_mut();
        state.sum.update(&size.to_le_bytes());
        state.sum.update(&bytes);
        state.files.push(fs::canonicalize(path)?);
        Ok(bytes)
    }

    /// Reads the file that the scene names so.
    ///
    /// # Errors
    /// Why it is not read.
    pub fn read_named(&self, name: &Path) -> Result<Vec<u8>, String> {
        let path = self.resolved(name)?;
        self.read(&path).map_err(|error| error.to_string())
    }

    /// The place of the file that the scene names so, where it may be read.
    ///
    /// # Errors
    /// Why it may not be.
    pub fn resolved(&self, name: &Path) -> Result<PathBuf, String> {
        let outside = "it lies outside of the scene's folder; put it there, or allow it by --allow-outside";
        let stays = name.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        let path = self.folder.join(name);
        if self.reach == Reach::Anywhere {
            return Ok(path);
        }
        if !stays {
            return Err(outside.into());
        }
        let real = |path: &Path| fs::canonicalize(path).map_err(|error| error.to_string());
        if real(&path)?.starts_with(real(&self.folder)?) { Ok(path) } else { Err(outside.into()) }
    }

    /// The size of a file, if it is one that is read: opening a pipe might wait for ever, and a device might never end.
    fn admit(&self, path: &Path) -> io::Result<u64> {
        let refused = |text: String| Err(io::Error::new(io::ErrorKind::InvalidInput, text));
        let metadata = fs::metadata(path)?;
        if !metadata.is_file() {
            return refused("it is no regular file".into());
        }
        let (size, state) = (metadata.len(), &mut *self.state.borrow_mut());
        if size > state.bytes_left {
            return refused(format!("it has {size} bytes; the files of a scene have {MOST_BYTES} at most"));
        }
        state.bytes_left -= size;
        Ok(size)
    }

    /// Adds to the sum what the user has set beside the files.
    pub fn note(&self, text: &str) {
        self.state.borrow_mut().sum.update(text.as_bytes());
    }

    /// All files that were read, and their sum.
    pub fn into_origin(self) -> Origin {
        let State { files, sum, .. } = self.state.into_inner();
        Origin { reach: self.reach, files, sum: sum.finalize() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> (tempfile::TempDir, SceneFiles) {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("scene")).unwrap();
        fs::write(folder.path().join("scene/a.bin"), b"abc").unwrap();
        fs::write(folder.path().join("secret"), b"secret").unwrap();
        let files = SceneFiles::of(&folder.path().join("scene/scene.gltf"), Reach::Folder);
        (folder, files)
    }

    #[test]
    fn names_lead_nowhere_else() {
        let (folder, files) = scene();
        assert_eq!(files.read_named(Path::new("a.bin")).unwrap(), b"abc");
        assert_eq!(files.read_named(Path::new("./a.bin")).unwrap(), b"abc");
        for name in ["../secret", "/etc/passwd", "x/../../secret"] {
            let why = files.read_named(Path::new(name)).unwrap_err();
            assert!(why.contains("outside") && why.contains("--allow-outside"), "{name}: {why}");
        }
        assert!(files.read_named(Path::new("absent")).unwrap_err().contains("No such file"));
        let anywhere = SceneFiles::of(&folder.path().join("scene/scene.gltf"), Reach::Anywhere);
        assert_eq!(anywhere.read_named(Path::new("../secret")).unwrap(), b"secret");
    }

    #[test]
    #[cfg(unix)]
    fn links_are_followed_before_that_is_judged() {
        let (folder, files) = scene();
        let link =
            |to: &str, name: &str| std::os::unix::fs::symlink(to, folder.path().join("scene").join(name)).unwrap();
        link("a.bin", "near");
        link("../secret", "far");
        link("..", "up");
        link("/dev/zero", "zero");
        assert_eq!(files.read_named(Path::new("near")).unwrap(), b"abc");
        for name in ["far", "up/secret", "zero"] {
            assert!(files.read_named(Path::new(name)).unwrap_err().contains("outside"), "{name}");
        }
        // A folder and a device are no files, wherever they may lie.
        let anywhere = SceneFiles::of(&folder.path().join("scene/scene.gltf"), Reach::Anywhere);
        for name in ["zero", "up"] {
            assert!(anywhere.read_named(Path::new(name)).unwrap_err().contains("regular"), "{name}");
        }
        // The whole folder of a scene may be a link.
        std::os::unix::fs::symlink("scene", folder.path().join("linked")).unwrap();
        let linked = SceneFiles::of(&folder.path().join("linked/scene.gltf"), Reach::Folder);
        assert_eq!(linked.read_named(Path::new("a.bin")).unwrap(), b"abc");
    }

    #[test]
    fn sizes_are_looked_at_first() {
        let (folder, files) = scene();
        // A file of holes takes no room on the disk.
        let large = File::create(folder.path().join("scene/large.bin")).unwrap();
        large.set_len(MOST_BYTES + 1).unwrap();
        let why = files.read_named(Path::new("large.bin")).unwrap_err();
        assert!(why.contains("4294967296 at most"), "{why}");
        // Together they have too much.
        files.state.borrow_mut().bytes_left = 5;
        assert!(files.read_named(Path::new("a.bin")).is_ok());
        assert!(files.read_named(Path::new("a.bin")).is_err());
    }

    #[test]
    fn the_sum_tells_contents_and_their_bounds_apart() {
        let sum = |contents: [&str; 2]| {
            let (folder, files) = scene();
            for (name, content) in ["a.bin", "b.bin"].into_iter().zip(contents) {
                fs::write(folder.path().join("scene").join(name), content).unwrap();
                files.read_named(Path::new(name)).unwrap();
            }
            let origin = files.into_origin();
            assert_eq!(origin.files.len(), 2);
            origin.sum
        };
        let first = sum(["ab", "c"]);
        assert_eq!(first, sum(["ab", "c"]));
        for other in [["a", "bc"], ["ab", "d"], ["c", "ab"], ["ab", ""]] {
            assert_ne!(first, sum(other), "{other:?}");
        }
    }
}
