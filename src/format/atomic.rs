//! Writing files so that a reader finds the old content, or the new, or nothing; never a part.
//!
//! Content goes to a temporary file in the same folder, is flushed to the disk, and takes the final name at the very end.

use crate::error::{Error, Result};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tempfile::TempPath;

/// Writes `bytes` under the name `path`, replacing a file that is there.
///
/// **Errors**: what the system refuses; the name of something other than a file; a file that is read-only. Then nothing has
/// changed under that name and no temporary file is left.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut staged = Staged::default();
    staged.add(path, bytes)?;
    staged.commit()
}

/// Files that are written but do not have their names yet; dropped without [`Staged::commit`], they vanish.
#[derive(Debug, Default)]
pub struct Staged {
    files: Vec<(TempPath, PathBuf)>,
}

impl Staged {
    /// Writes `bytes` to a temporary file that is to be called `path`.
    ///
    /// **Errors**: as [`write()`].
    pub fn add(&mut self, path: &Path, bytes: &[u8]) -> Result<()> {
        self.files.push(staged(path, bytes)?);
        Ok(())
    }

    /// The same of several files, which wait for the disk together.
    ///
    /// **Errors**: as [`write()`], of the first that is refused.
    pub fn add_all<B: AsRef<[u8]> + Sync>(&mut self, files: &[(PathBuf, B)]) -> Result<()> {
        let each: Vec<Result<(TempPath, PathBuf)>> =
            files.par_iter().with_max_len(1).map(|(path, bytes)| staged(path, bytes.as_ref())).collect();
        for file in each {
            self.files.push(file?);
        }
        Ok(())
    }

    /// Gives all files their names.
    ///
    /// **Errors**: the first that the system refuses; then the files that were new are removed again, but those that
    /// replaced another before it keep their new content.
    pub fn commit(self) -> Result<()> {
        let (mut created, mut folders) = (Vec::new(), BTreeSet::new());
        for (temporary, target) in self.files {
            let is_new = !target.exists();
            if let Err(refused) = temporary.persist(&target) {
                for path in &created {
                    let _ = fs::remove_file(path); // the first error says more than a second would
                }
                return Err(Error::writing(&target, refused.error));
            }
            folders.insert(folder_of(&target).to_owned());
            if is_new {
                created.push(target);
            }
        }
        folders.iter().for_each(|folder| sync_folder(folder));
        Ok(())
    }
}

/// A temporary file that holds `bytes` and is to be called `path`, and where that leads.
fn staged(path: &Path, bytes: &[u8]) -> Result<(TempPath, PathBuf)> {
    let file = || {
        let target = resolve(path)?;
        let permissions = existing_permissions(&target)?;
        let temporary = write_beside(&target, bytes, permissions)?;
        Ok((temporary, target))
    };
    file().map_err(|source| Error::writing(path, source))
}

/// Where `path` leads: a link stays a link, and the file behind it is replaced.
fn resolve(path: &Path) -> io::Result<PathBuf> {
    match fs::canonicalize(path) {
        Ok(target) => Ok(target),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(path.to_owned()),
        Err(error) => Err(error),
    }
}

/// The permissions of the file that is to be replaced, if there is one and it may be.
fn existing_permissions(target: &Path) -> io::Result<Option<fs::Permissions>> {
    let metadata = match fs::metadata(target) {
        Ok(metadata) => metadata,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    };
    if metadata.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    if !metadata.is_file() {
        // A device or a pipe would be replaced by a file of its name.
        return Err(io::Error::other("not a regular file"));
    }
    if metadata.permissions().readonly() {
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the file that is there is read-only"));
    }
    Ok(Some(metadata.permissions()))
}

fn write_beside(target: &Path, bytes: &[u8], permissions: Option<fs::Permissions>) -> io::Result<TempPath> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".kiln-").suffix(".tmp");
    // Temporary files are made unreadable to others; this one is to look like any other file, less the umask.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder_of(target))?;
    file.write_all(bytes)?;
    if let Some(permissions) = permissions {
        file.as_file().set_permissions(permissions)?;
    }
    file.as_file().sync_all()?;
    Ok(file.into_temp_path())
}

/// The folder that a file is in.
fn folder_of(target: &Path) -> &Path {
    target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Makes renames within a folder outlast a power failure where folders can be synchronised; where they cannot, they are done nonetheless.
fn sync_folder(folder: &Path) {
    if cfg!(unix) {
        let _ = fs::File::open(folder).and_then(|folder| folder.sync_all());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_appears_with_its_content_and_nothing_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        write(&path, b"one").unwrap();
        write(&path, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(names(folder.path()), ["a.exr"]);
    }

    #[test]
    #[cfg(unix)]
    fn permissions_are_those_of_any_new_file_or_of_the_one_replaced() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [plain, ours] = ["plain", "ours"].map(|name| folder.path().join(name));
        fs::write(&plain, b"").unwrap();
        write(&ours, b"").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o7777;
        assert_eq!(mode(&ours), mode(&plain));
        fs::set_permissions(&ours, fs::Permissions::from_mode(0o640)).unwrap();
        write(&ours, b"again").unwrap();
        assert_eq!(mode(&ours), 0o640);
    }

    #[test]
    #[cfg(unix)]
    fn a_link_stays_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["file", "link"].map(|name| folder.path().join(name));
        fs::write(&file, b"old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
    }

    #[test]
    fn staged_files_appear_together_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        let mut staged = Staged::default();
        staged.add(&a, b"a").unwrap();
        staged.add(&b, b"b").unwrap();
        assert!(!a.exists() && !b.exists());
        staged.commit().unwrap();
        assert_eq!(names(folder.path()), ["a", "b"]);

        let mut dropped = Staged::default();
        dropped.add(&folder.path().join("c"), b"c").unwrap();
        drop(dropped);
        assert_eq!(names(folder.path()), ["a", "b"]);
    }

    #[test]
    fn a_refused_name_takes_the_new_files_back() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        let mut staged = Staged::default();
        staged.add(&a, b"a").unwrap();
        staged.add(&b, b"b").unwrap();
        fs::create_dir(&b).unwrap(); // somebody took the name meanwhile
        let message = staged.commit().unwrap_err().to_string();
        assert!(message.contains("writing failed") && message.contains("; "), "{message}");
        assert_eq!(names(folder.path()), ["b"]);
    }

    #[test]
    fn missing_folders_folders_and_read_only_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let read_only = folder.path().join("read_only");
        fs::write(&read_only, b"mine").unwrap();
        let mut permissions = fs::metadata(&read_only).unwrap().permissions();
        permissions.set_readonly(true);
        fs::set_permissions(&read_only, permissions).unwrap();
        for path in [&folder.path().join("missing/a"), folder.path(), &read_only] {
            let message = write(path, b"new").unwrap_err().to_string();
            assert!(message.contains("writing failed") && message.contains("; "), "{message}");
        }
        assert_eq!(names(folder.path()), ["read_only"]);
        assert_eq!(fs::read(&read_only).unwrap(), b"mine");
    }

    #[test]
    #[cfg(unix)]
    fn a_device_is_not_replaced() {
        use std::os::unix::fs::FileTypeExt;
        assert!(write(Path::new("/dev/null"), b"x").is_err());
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    }
}
