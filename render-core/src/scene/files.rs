//! Reading of all files of a scene, with restricted paths, limited sizes and a checksum.
//!
//! Scenes may come from untrusted sources. File names in a scene refer only to regular files in the scene's folder,
//! after links are resolved, unless the user allows other folders. Sizes are checked before reading.

use std::cell::RefCell;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// Maximum total size of the files of a scene \[bytes\]: glTF counts the bytes of a buffer in 32 bits.
const MOST_BYTES: u64 = 1 << 32;

/// Folders in which the files of a scene may be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reach {
    /// The folder of the scene file and its subfolders, after links are resolved.
    #[default]
    Folder,
    /// Any folder, inside or outside the scene's folder.
    Anywhere,
}

/// Files from which a scene was read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Folders in which files were permitted.
    pub reach: Reach,
    /// Paths with all links resolved, in reading order.
    pub files: Vec<PathBuf>,
    /// CRC-32 of the sizes and contents of all files in reading order, and of the additional settings.
    pub sum: u32,
}

/// Reader of the files of one scene.
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
    /// Builds a reader of files for the scene at path `scene`.
    pub fn of(scene: &Path, reach: Reach) -> Self {
        let folder = scene.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let state = State { files: Vec::new(), sum: crc32fast::Hasher::new(), bytes_left: MOST_BYTES };
        Self { folder: folder.into(), reach, state: RefCell::new(state) }
    }

    /// Reads a file chosen by the user: the scene or its settings.
    ///
    /// # Errors
    /// Returns the system's message, or the reason if the file is refused.
    pub fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        let size = self.admit(path)?;
        let mut bytes = Vec::new();
        // A file that grows meanwhile is read only up to its admitted size.
        File::open(path)?.take(size).read_to_end(&mut bytes)?;
        // Include the size in the checksum, so that the split into files also affects it.
        let mut state = self.state.borrow_mut();
        state.sum.update(&size.to_le_bytes());
        state.sum.update(&bytes);
        state.files.push(fs::canonicalize(path)?);
        Ok(bytes)
    }

    /// Reads a file to which the scene refers.
    ///
    /// # Errors
    /// Returns the reason if the file may not or cannot be read.
    pub fn read_named(&self, name: &Path) -> Result<Vec<u8>, String> {
        let path = self.resolved(name)?;
        self.read(&path).map_err(|error| error.to_string())
    }

    /// Returns the path of a file to which the scene refers, if the file may be read.
    ///
    /// # Errors
    /// Returns the reason if the file may not be read.
    pub fn resolved(&self, name: &Path) -> Result<PathBuf, String> {
        let outside = "it is outside the scene's folder; move it there or pass --allow-outside";
        // Refuse parent and absolute paths even if they resolve to a file in the folder.
        let stays = name.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        let path = self.folder.join(name);
        if self.reach == Reach::Anywhere {
            return Ok(path);
        }
        if !stays {
            return Err(outside.into());
        }
        // Resolve links, because a link in the folder may point outside it.
        let real = |path: &Path| fs::canonicalize(path).map_err(|error| error.to_string());
        if real(&path)?.starts_with(real(&self.folder)?) { Ok(path) } else { Err(outside.into()) }
    }

    /// Returns the size of a file. Refuses all files except regular files: opening a pipe may block forever, and a
    /// device may be endless.
    fn admit(&self, path: &Path) -> io::Result<u64> {
        let refused = |text: String| Err(io::Error::new(io::ErrorKind::InvalidInput, text));
        let metadata = fs::metadata(path)?;
        if !metadata.is_file() {
            return refused("it is not a regular file".into());
        }
        // Subtract the size from the allowance of all files.
        let (size, state) = (metadata.len(), &mut *self.state.borrow_mut());
        if size > state.bytes_left {
            return refused(format!("it has {size} bytes; all files of a scene may have at most {MOST_BYTES}"));
        }
        state.bytes_left -= size;
        Ok(size)
    }

    /// Adds the user's additional settings to the checksum.
    pub fn note(&self, text: &str) {
        self.state.borrow_mut().sum.update(text.as_bytes());
    }

    /// Returns all files that were read, and their checksum.
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
        // A folder and a device are not regular files, regardless of `reach`.
        let anywhere = SceneFiles::of(&folder.path().join("scene/scene.gltf"), Reach::Anywhere);
        for name in ["zero", "up"] {
            assert!(anywhere.read_named(Path::new(name)).unwrap_err().contains("regular"), "{name}");
        }
        // The scene's folder itself may be a link.
        std::os::unix::fs::symlink("scene", folder.path().join("linked")).unwrap();
        let linked = SceneFiles::of(&folder.path().join("linked/scene.gltf"), Reach::Folder);
        assert_eq!(linked.read_named(Path::new("a.bin")).unwrap(), b"abc");
    }

    #[test]
    fn sizes_are_looked_at_first() {
        let (folder, files) = scene();
        // A sparse file occupies no disk space.
        let large = File::create(folder.path().join("scene/large.bin")).unwrap();
        large.set_len(MOST_BYTES + 1).unwrap();
        let why = files.read_named(Path::new("large.bin")).unwrap_err();
        assert!(why.contains("at most 4294967296"), "{why}");
        // In sum, the files are too large.
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
