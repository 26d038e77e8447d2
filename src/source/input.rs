//! A file or standard input, with its first bytes looked at.

use super::{Place, SourceError, misnamed};
use crate::interrupt::Live;
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
    Stream(Box<dyn Read + Send>),
}

impl Input {
    /// Opens `name`, or standard input for `-`, and looks at the first bytes.
    ///
    /// # Errors
    /// It is not there, may not be read, is a directory or a serial port, or has nothing in it.
    pub fn open(name: &str) -> Result<Input, SourceError> {
        if name == "-" {
            return Input::of("standard input", Live(io::stdin()));
        }
        if let Some(what) = misnamed::serial_port(name) {
            return Err(SourceError::new(name, Place::Whole, what));
        }
        let whole = |cause| SourceError::io(name, Place::Whole, cause);
        let file = open(name).map_err(|cause| absent(name, whole(cause)))?;
        let kind = file.metadata().map_err(whole)?.file_type();
        if kind.is_dir() {
            return Err(whole(io::ErrorKind::IsADirectory.into()));
        }
        if kind.is_file() {
            Input::begin(name, Rest::File(file))
        } else {
            Input::of(name, Live(file))
        }
    }

    /// Looks at the first bytes of a stream that cannot be gone back in.
    ///
    /// # Errors
    /// It cannot be read, or there is nothing in it.
    pub fn of(name: &str, stream: impl Read + Send + 'static) -> Result<Input, SourceError> {
        Input::begin(name, Rest::Stream(Box::new(stream)))
    }

    fn begin(name: &str, rest: Rest) -> Result<Input, SourceError> {
        let mut input = Input { name: name.to_owned(), head: Vec::new(), given: 0, rest };
        if input.look_further()? {
            Ok(input)
        } else {
            Err(SourceError::new(name, Place::Byte(0), "there is nothing in it"))
        }
    }

    /// The bytes that were looked at: from the start of the source.
    pub fn head(&self) -> &[u8] {
        &self.head
    }

    /// Looks at more bytes; false if there are no more, or 4096 were looked at. This waits for a
    /// live stream, and is to be asked only where the first bytes do not tell enough.
    ///
    /// # Errors
    /// The source cannot be read.
    pub fn look_further(&mut self) -> Result<bool, SourceError> {
        let seen = self.head.len();
        let mut more = [0; LOOKED_AT];
        let count = self
            .read_rest(&mut more[seen..])
            .map_err(|cause| SourceError::io(&self.name, Place::Byte(seen as u64), cause))?;
        self.head.extend_from_slice(&more[seen..seen + count]);
        Ok(count > 0)
    }

    /// The file, positioned anywhere; `None` for standard input, which cannot be gone back in.
    pub fn file(&self) -> Option<&File> {
        match &self.rest {
            Rest::File(file) => Some(file),
            Rest::Stream(_) => None,
        }
    }

    fn read_rest(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let read = match &mut self.rest {
                Rest::File(file) => file.read(buffer),
                Rest::Stream(stream) => stream.read(buffer),
            };
            match read {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                read => return read,
            }
        }
    }
}

/// Opens a file. To open a pipe that nobody writes to would wait, and no signal end that: it is
/// waited for when it is read.
fn open(name: &str) -> io::Result<File> {
    let mut options = File::options();
    options.read(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
        if std::fs::metadata(name)?.file_type().is_fifo() {
            options.custom_flags(rustix::fs::OFlags::NONBLOCK.bits().cast_signed());
        }
    }
    options.open(name)
}

/// What is not there may be a tap that was named like a file.
fn absent(name: &str, error: SourceError) -> SourceError {
    let is_absent =
        error.cause.as_ref().is_some_and(|cause| cause.kind() == io::ErrorKind::NotFound);
    match misnamed::tap(name).filter(|_| is_absent) {
        Some(instead) => {
            let what = format!("there is no such file: {instead}");
            SourceError::new(name, Place::Whole, what)
        }
        None => error,
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
