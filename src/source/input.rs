//! A file or standard input, with its first bytes looked at.

use super::{Place, SourceError};
use std::fs::File;
use std::io::{self, Read};

/// Bytes that are looked at to find out what a source is.
const LOOKED_AT: usize = 4096;

/// Bytes of a capture, from a file or from standard input.
pub struct Input {
    /// As the user named it.
    pub name: String,
    head: Vec<u8>,
    given: usize,
    rest: Rest,
}

enum Rest {
    File(File),
    Stdin(io::Stdin),
}

impl Input {
    /// Opens `name`, or standard input for `-`, and looks at the first bytes.
    ///
    /// # Errors
    /// It is not there, may not be read, is a directory, or has nothing in it.
    pub fn open(name: &str) -> Result<Input, SourceError> {
        let whole = |cause| SourceError::io(name, Place::Whole, cause);
        let rest = if name == "-" {
            Rest::Stdin(io::stdin())
        } else {
            let file = File::open(name).map_err(whole)?;
            if file.metadata().map_err(whole)?.is_dir() {
                return Err(whole(io::ErrorKind::IsADirectory.into()));
            }
            Rest::File(file)
        };
        let name = if name == "-" { "standard input" } else { name }.to_owned();
        let mut input = Input { name, head: Vec::new(), given: 0, rest };
        let mut head = vec![0; LOOKED_AT];
        let mut filled = 0;
        while filled < LOOKED_AT {
            match input.read_rest(&mut head[filled..]) {
                Ok(0) => break,
                Ok(count) => filled += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(SourceError::io(&input.name, Place::Byte(0), error)),
            }
        }
        head.truncate(filled);
        input.head = head;
        if input.head.is_empty() {
            return Err(SourceError::new(&input.name, Place::Byte(0), "there is nothing in it"));
        }
        Ok(input)
    }

    /// The first bytes: all of them, if the source is short.
    pub fn head(&self) -> &[u8] {
        &self.head
    }

    /// The file, positioned anywhere; `None` for standard input, which cannot be gone back in.
    pub fn file(&self) -> Option<&File> {
        match &self.rest {
            Rest::File(file) => Some(file),
            Rest::Stdin(_) => None,
        }
    }

    fn read_rest(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match &mut self.rest {
            Rest::File(file) => file.read(buffer),
            Rest::Stdin(stdin) => stdin.read(buffer),
        }
    }
}

impl Read for Input {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let head = &self.head[self.given..];
        if head.is_empty() {
            return self.read_rest(buffer);
        }
        let count = head.len().min(buffer.len());
        buffer[..count].copy_from_slice(&head[..count]);
        self.given += count;
        Ok(count)
    }
}
