//! A file that is being written. It bears its name once it is whole: nobody ever sees half of it,
//! and what bore the name before is lost only to a whole one.

use anyhow::{Context, Result};
use std::fs::{self, File, OpenOptions, Permissions};
use std::io;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Where output goes.
pub enum Output {
    /// Into a new file beside its place.
    File {
        /// The file, which has no name of its own yet.
        new: NamedTempFile,
        /// Where it shall be.
        place: PathBuf,
    },
    /// Straight into what is no regular file: a device, a pipe.
    Stream(File),
}

impl Output {
    /// Begins to write what shall be at `path`.
    ///
    /// # Errors
    /// Nothing can be written there.
    pub fn create(path: &Path) -> Result<Output> {
        Output::open(path).with_context(|| format!("{}: cannot be written", path.display()))
    }

    fn open(path: &Path) -> io::Result<Output> {
        // Through links, which stay what they are.
        let place = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let there = fs::metadata(&place).ok();
        if there.as_ref().is_some_and(|there| !there.is_file()) {
            return OpenOptions::new().write(true).open(&place).map(Output::Stream);
        }
        let mut builder = tempfile::Builder::new();
        let permissions = there.map(|there| there.permissions()).or_else(usual_permissions);
        if let Some(permissions) = permissions {
            builder.permissions(permissions);
        }
        let directory = place.parent().filter(|parent| !parent.as_os_str().is_empty());
        let new = builder.tempfile_in(directory.unwrap_or(Path::new(".")))?;
        Ok(Output::File { new, place })
    }

    /// What to write to.
    pub fn file(&self) -> &File {
        match self {
            Output::File { new, .. } => new.as_file(),
            Output::Stream(file) => file,
        }
    }

    /// Gives it its name, whatever bears it now.
    ///
    /// # Errors
    /// It cannot be moved there.
    pub fn replace(self) -> Result<()> {
        if let Output::File { new, place } = self {
            let failed = || format!("{}: cannot be written", place.display());
            new.persist(&place).with_context(failed)?;
        }
        Ok(())
    }

    /// Gives it its name unless something bears it already. False if that is so.
    ///
    /// # Errors
    /// It cannot be moved there.
    pub fn keep_unless_there(self) -> Result<bool> {
        let Output::File { new, place } = self else { return Ok(true) };
        match new.persist_noclobber(&place) {
            Ok(_) => Ok(true),
            Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
            Err(error) => {
                Err(error.error).with_context(|| format!("{}: cannot be written", place.display()))
            }
        }
    }
}

/// Those of any new file: as far as the user's mask allows.
fn usual_permissions() -> Option<Permissions> {
    #[cfg(unix)]
    return Some(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    #[cfg(not(unix))]
    None
}
