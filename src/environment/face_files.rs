//! Six files that are the faces of a cube, found by their names.
//!
//! A face's name ends a file's name, before the extension, and stands alone or behind something that is neither letter nor digit:
//! `px.hdr`, `sky_px.hdr`, `sky-right.exr`. Upper and lower case are the same.

use std::path::{Path, PathBuf};

use super::cube::FACES;
use crate::error::{Error, Result};

/// The names of +X −X +Y −Y +Z −Z in each way of naming them.
const SCHEMES: [[&str; 6]; 3] = [
    ["px", "nx", "py", "ny", "pz", "nz"],
    ["posx", "negx", "posy", "negy", "posz", "negz"],
    ["right", "left", "top", "bottom", "front", "back"],
];

/// What a face's name is replaced by in a pattern.
pub(super) const PLACEHOLDER: &str = "%s";

/// What the user is told to do.
const WAY_OUT: &str = "name them px nx py ny pz nz, posx … negz, or right left top bottom front back";

/// A file that is named as a face.
struct Named {
    path: PathBuf,
    scheme: usize,
    face: usize,
    /// What the name has before and after the face's.
    rest: (String, String),
}

impl Named {
    fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        let (stem, extension) = name.rsplit_once('.').unwrap_or((name, ""));
        for (scheme, faces) in SCHEMES.iter().enumerate() {
            for (face, suffix) in faces.iter().enumerate() {
                let Some(at) = stem.len().checked_sub(suffix.len()).filter(|&at| stem.is_char_boundary(at)) else {
                    continue;
                };
                let (before, end) = stem.split_at(at);
                if end.eq_ignore_ascii_case(suffix) && !before.ends_with(char::is_alphanumeric) {
                    let rest = (before.to_owned(), extension.to_ascii_lowercase());
                    return Some(Self { path: path.to_owned(), scheme, face, rest });
                }
            }
        }
        None
    }

    fn same_set(&self, other: &Self) -> bool {
        self.scheme == other.scheme && self.rest == other.rest
    }
}

/// Whether a file is named as a face.
pub(super) fn is_face(path: &Path) -> bool {
    Named::of(path).is_some()
}

/// The six files of which `path` is one.
///
/// **Errors**: a name that is none of a face; others that are missing.
pub(super) fn beside(path: &Path) -> Result<[PathBuf; 6]> {
    let one = Named::of(path)
        .ok_or_else(|| Error::invalid("a name that does not end in that of a face", WAY_OUT).in_file(path))?;
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let files = named_files(folder)?.into_iter().filter(|file| file.same_set(&one)).collect();
    complete(files, one.scheme).map_err(|e| e.in_file(path))
}

/// The six files in a folder.
///
/// **Errors**: no such set of files there, an incomplete one, or several.
pub(super) fn in_folder(folder: &Path) -> Result<[PathBuf; 6]> {
    let mut files = named_files(folder)?;
    let mut sets: Vec<Vec<Named>> = vec![];
    while let Some(last) = files.pop() {
        let (mut set, others): (Vec<_>, Vec<_>) = files.into_iter().partition(|file| file.same_set(&last));
        set.push(last);
        sets.push(set);
        files = others;
    }
    let whole = |set: &Vec<Named>| set.len() >= 6;
    if sets.iter().filter(|set| whole(set)).count() > 1 {
        return Err(
            Error::invalid("a folder with the faces of several cubes", "name one of the files instead").in_file(folder)
        );
    }
    let best = sets.into_iter().max_by_key(Vec::len);
    let set = best.ok_or_else(|| Error::invalid("a folder without the faces of a cube", WAY_OUT).in_file(folder))?;
    let scheme = set[0].scheme;
    complete(set, scheme).map_err(|e| e.in_file(folder))
}

/// The six files that a pattern with [`PLACEHOLDER`] in it names.
///
/// **Errors**: some or all of them missing.
pub(super) fn of_pattern(pattern: &str) -> Result<[PathBuf; 6]> {
    let paths = |scheme: &[&str; 6]| scheme.map(|face| PathBuf::from(pattern.replace(PLACEHOLDER, face)));
    let count = |scheme: &[&str; 6]| paths(scheme).iter().filter(|path| path.exists()).count();
    let [first, second, third] = SCHEMES.each_ref().map(count);
    let best = if first >= second.max(third) {
        0
    } else if second >= third {
        1
    } else {
        2
    };
    let found = paths(&SCHEMES[best]);
    let missing: Vec<String> =
        found.iter().filter(|path| !path.exists()).map(|path| path.display().to_string()).collect();
    if missing.is_empty() {
        return Ok(found);
    }
    let what = if missing.len() == 6 {
        "none of the six faces is there".to_owned()
    } else {
        format!("no {}", missing.join(", "))
    };
    Err(Error::invalid(what, WAY_OUT).in_file(Path::new(pattern)))
}

/// Files of a folder that are named as faces, in the order of their names.
fn named_files(folder: &Path) -> Result<Vec<Named>> {
    let reading = |e| Error::reading(folder, e);
    let mut files = vec![];
    for entry in std::fs::read_dir(folder).map_err(reading)? {
        let entry = entry.map_err(reading)?;
        let name = PathBuf::from(entry.file_name());
        // Of `.` the names alone: `px.hdr`, as the user would write it.
        let path = if folder == Path::new(".") { name } else { folder.join(name) };
        files.extend(Named::of(&path).filter(|_| path.is_file()));
    }
    files.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(files)
}

/// The files by face, if each is there once.
fn complete(files: Vec<Named>, scheme: usize) -> Result<[PathBuf; 6]> {
    let mut found: [Option<PathBuf>; 6] = Default::default();
    for file in files {
        if let Some(other) = found[file.face].replace(file.path.clone()) {
            return Err(Error::invalid(
                format!("two files for face {}: {} and {}", FACES[file.face], other.display(), file.path.display()),
                "remove one of them",
            ));
        }
    }
    let missing: Vec<&str> = (0..6).filter(|&face| found[face].is_none()).map(|face| SCHEMES[scheme][face]).collect();
    if !missing.is_empty() {
        return Err(Error::invalid(
            format!("a cube of six files without {}", missing.join(", ")),
            "add what is missing, or use --input-layout panorama for this one alone",
        ));
    }
    Ok(found.map(Option::unwrap_or_default))
}
