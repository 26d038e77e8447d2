//! Why a recording cannot be written, and what the user may do about it.

use std::fmt;
use std::io;
use std::path::PathBuf;

/// What could not be written, and where.
#[derive(Debug)]
pub struct WriteError {
    /// The file, or the directory.
    pub path: PathBuf,
    /// Why.
    pub cause: io::Error,
}

impl WriteError {
    /// What to do, where the system's words tell enough.
    fn advice(&self) -> Option<&'static str> {
        Some(match self.cause.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                "free some space, or keep less: --ring files=10,size=100MB"
            }
            io::ErrorKind::FileTooLarge => {
                "stay below the limit on the size of files (ulimit -f): --ring size=100MB"
            }
            io::ErrorKind::ReadOnlyFilesystem => "choose a folder on a disk that takes writes",
            io::ErrorKind::PermissionDenied => "choose a folder that you may write to",
            _ => return None,
        })
    }
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let WriteError { path, cause } = self;
        write!(f, "{}: cannot be written ({cause})", path.display())?;
        self.advice().map_or(Ok(()), |advice| write!(f, ": {advice}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_said_with_what_to_do() {
        for (kind, says) in [
            (io::ErrorKind::StorageFull, "--ring files=10,size=100MB"),
            (io::ErrorKind::ReadOnlyFilesystem, "a disk that takes writes"),
        ] {
            let error = WriteError { path: PathBuf::from("tape"), cause: kind.into() };
            let said = error.to_string();
            assert!(
                said.starts_with("tape: cannot be written (") && said.ends_with(says),
                "{said}"
            );
        }
        let odd = WriteError { path: PathBuf::from("tape"), cause: io::ErrorKind::Other.into() };
        assert!(odd.to_string().ends_with(')'), "{odd}");
    }
}
