//! `.sr`: a sigrok session of version 2, with the samples in pieces of 4 MiB as libsigrok writes
//! them.

use super::samples::{Levels, Samples, rate_in_words};
use anyhow::{Context, Result};
use std::io::{Seek, Write};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Samples in a member, one byte each.
const PIECE: usize = 4 * 1024 * 1024;

/// A capture of this form.
pub struct Sr<W: Write + Seek> {
    archive: ZipWriter<W>,
    piece: Vec<u8>,
    pieces: u32,
}

impl<W: Write + Seek> Sr<W> {
    /// Begins a session with these channels, eight at most.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(out: W, channels: &[&str], rate: u64) -> Result<Self> {
        let mut session =
            Sr { archive: ZipWriter::new(out), piece: Vec::with_capacity(PIECE), pieces: 0 };
        let probes = (1..).zip(channels).map(|(probe, name)| format!("probe{probe}={name}\n"));
        let metadata = format!(
            "[global]\nsigrok version=0.5.2\n\n[device 1]\ncapturefile=logic-1\n\
             total probes={}\nsamplerate={}\ntotal analog=0\n{}unitsize=1\n",
            channels.len(),
            rate_in_words(rate),
            probes.collect::<String>()
        );
        session.add("version", b"2")?;
        session.add("metadata", metadata.as_bytes())?;
        Ok(session)
    }

    fn add(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        // Without the time of day, the same seed makes the same file.
        let options = SimpleFileOptions::default()
            .compression_method(zip::CompressionMethod::Deflated)
            .last_modified_time(zip::DateTime::default());
        self.archive.start_file(name, options).with_context(|| format!("cannot begin {name}"))?;
        self.archive.write_all(bytes).with_context(|| format!("cannot write {name}"))
    }

    fn add_piece(&mut self) -> Result<()> {
        self.pieces += 1;
        let piece = std::mem::take(&mut self.piece);
        self.add(&format!("logic-1-{}", self.pieces), &piece)?;
        self.piece = piece;
        self.piece.clear();
        Ok(())
    }
}

impl<W: Write + Seek> Samples for Sr<W> {
    fn run(&mut self, levels: Levels, mut samples: u64) -> Result<()> {
        while samples > 0 {
            let room = PIECE - self.piece.len();
            let now = usize::try_from(samples).map_or(room, |samples| samples.min(room));
            self.piece.resize(self.piece.len() + now, levels);
            samples -= now as u64;
            if self.piece.len() == PIECE {
                self.add_piece()?;
            }
        }
        Ok(())
    }

    fn end(mut self: Box<Self>) -> Result<()> {
        if !self.piece.is_empty() {
            self.add_piece()?;
        }
        self.archive.finish().context("cannot write the directory")?.flush()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Cursor, Read};

    #[test]
    fn samples_are_split_into_pieces() {
        let mut file = Cursor::new(Vec::new());
        let mut session = Box::new(Sr::new(&mut file, &["BUS"], 4_000_000).unwrap());
        session.run(1, PIECE as u64 - 1).unwrap();
        session.run(0, 3).unwrap();
        session.end().unwrap();
        let mut archive = zip::ZipArchive::new(file).unwrap();
        let mut member = |name: &str| {
            let mut bytes = Vec::new();
            archive.by_name(name).unwrap().read_to_end(&mut bytes).unwrap();
            bytes
        };
        assert_eq!(member("version"), b"2");
        let metadata = String::from_utf8(member("metadata")).unwrap();
        assert!(metadata.contains("total probes=1\nsamplerate=4 MHz\n"));
        assert!(metadata.contains("probe1=BUS\nunitsize=1\n"));
        assert_eq!(member("logic-1-1").len(), PIECE);
        assert_eq!(member("logic-1-1")[PIECE - 2..], [1, 0]);
        assert_eq!(member("logic-1-2"), [0, 0]);
    }
}
