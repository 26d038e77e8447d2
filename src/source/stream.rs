//! The bytes of a binary source, looked at before they are taken.

use super::{Input, Place, SourceError};
use std::io::Read;

/// Bytes held to begin with; more only where a single item is longer.
const BUFFERED: usize = 256 * 1024;

/// A source of bytes that never holds much more than what is asked for at once, and never waits
/// for more than that.
pub struct Stream {
    input: Input,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    offset: u64,
}

impl Stream {
    /// The bytes of this input.
    pub fn new(input: Input) -> Self {
        Stream { input, buffer: vec![0; BUFFERED], start: 0, end: 0, offset: 0 }
    }

    /// The source, as the user named it.
    pub fn name(&self) -> &str {
        &self.input.name
    }

    /// How many bytes were taken.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// An error at the first byte that was not taken.
    pub fn error(&self, what: impl Into<String>) -> SourceError {
        SourceError::new(self.name(), Place::Byte(self.offset), what)
    }

    /// What comes next: at least `wanted` bytes, fewer only where the source ends. The caller
    /// bounds `wanted`; memory grows with what is really there.
    ///
    /// # Errors
    /// The source cannot be read.
    pub fn ahead(&mut self, wanted: usize) -> Result<&[u8], SourceError> {
        while self.end - self.start < wanted {
            self.make_room();
            let count = self.input.read(&mut self.buffer[self.end..]).map_err(|cause| {
                let reached = self.offset + (self.end - self.start) as u64;
                SourceError::io(&self.input.name, Place::Byte(reached), cause)
            })?;
            if count == 0 {
                break;
            }
            self.end += count;
        }
        Ok(self.held())
    }

    /// What was looked at and not taken.
    pub fn held(&self) -> &[u8] {
        &self.buffer[self.start..self.end]
    }

    /// Takes bytes that were looked at.
    pub fn take(&mut self, count: usize) {
        let count = count.min(self.end - self.start);
        self.start += count;
        self.offset += count as u64;
    }

    fn make_room(&mut self) {
        if self.start > 0 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        if self.end == self.buffer.len() {
            self.buffer.resize(2 * self.buffer.len(), 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hands out three bytes a read.
    struct Drops(u32);

    impl Read for Drops {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            let count = buffer.len().min(3);
            for byte in &mut buffer[..count] {
                *byte = self.0.to_le_bytes()[0];
                self.0 += 1;
            }
            Ok(count)
        }
    }

    #[test]
    fn what_was_not_taken_stays() {
        let mut stream = Stream::new(Input::of("test", Drops(0)).unwrap());
        assert_eq!(stream.ahead(2).unwrap()[..2], [0, 1]);
        stream.take(1);
        assert_eq!(stream.ahead(5).unwrap()[..5], [1, 2, 3, 4, 5]);
        stream.take(5);
        assert_eq!(stream.offset(), 6);
        assert_eq!(stream.ahead(1).unwrap()[0], 6);
    }

    #[test]
    fn an_item_longer_than_the_buffer_fits() {
        let mut stream = Stream::new(Input::of("test", Drops(0)).unwrap());
        stream.take(1);
        assert!(stream.ahead(BUFFERED + 1).unwrap().len() > BUFFERED);
    }

    #[test]
    fn a_source_that_ends_gives_less_than_wanted() {
        let mut stream = Stream::new(Input::of("test", &b"abc"[..]).unwrap());
        assert_eq!(stream.ahead(usize::MAX).unwrap(), b"abc");
        stream.take(usize::MAX);
        assert_eq!((stream.offset(), stream.ahead(1).unwrap().len()), (3, 0));
    }
}
