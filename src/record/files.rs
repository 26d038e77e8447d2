//! The files of a recording: one after the other, each of whole blocks.
//!
//! What is written reaches the system at least each half second, so that a program that is killed
//! loses no more. A full disk ends the recording, and what was written stays readable.

pub use super::failure::WriteError;
use super::names::Names;
use super::ring::Ring;
use super::shelf::Shelf;
use dissectors::event::Moment;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Bytes that wait to be written at most.
const BUFFERED: usize = 64 * 1024;

/// How long they wait at most.
const LONGEST_WAIT: Duration = Duration::from_millis(500);

/// How often it is looked whether the file that is being written is still there.
const LOOKED_EACH: Duration = Duration::from_secs(1);

/// Files in a directory.
pub struct Files {
    directory: PathBuf,
    ring: Ring,
    number: u32,
    /// Those that are finished.
    shelf: Shelf,
    open: Option<Open>,
    /// Something could not be written: nothing more is.
    is_broken: bool,
    /// Something was to be written, and is in no file.
    pub is_cut: bool,
    /// Files that were finished, deleted ones included.
    pub finished: u64,
    /// Bytes that were written, those of deleted files included.
    pub bytes: u64,
}

/// The file that is being written.
struct Open {
    names: Names,
    file: File,
    buffer: Vec<u8>,
    /// Bytes in the file.
    written: u64,
    /// When the first byte of the buffer came.
    waiting_since: Option<Instant>,
    /// When it was last seen under its name.
    seen: Instant,
    /// When its first block began, by a clock that is never set back.
    begin: Moment,
    /// How many heads it has.
    heads: usize,
}

impl Files {
    /// Files of a recording in this directory, which is made if it is not there.
    ///
    /// # Errors
    /// It cannot be made, or nothing can be written in it.
    pub fn new(directory: &Path, ring: Ring) -> Result<Files, WriteError> {
        let failed = |cause| WriteError { path: directory.to_owned(), cause };
        fs::create_dir_all(directory).map_err(failed)?;
        // Better now than when the first event comes.
        tempfile::tempfile_in(directory).map_err(failed)?;
        Ok(Files {
            directory: directory.to_owned(),
            ring,
            number: 0,
            shelf: Shelf::new(ring.files),
            open: None,
            is_broken: false,
            is_cut: false,
            finished: 0,
            bytes: 0,
        })
    }

    /// Where they are.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Whether one that was finished is there: nobody deleted them all, or moved them away.
    pub fn are_there(&self) -> bool {
        let is_one = |entry: io::Result<fs::DirEntry>| {
            entry.is_ok_and(|entry| entry.path().extension().is_some_and(|end| end == "pcapng"))
        };
        self.finished > 0 && fs::read_dir(&self.directory).is_ok_and(|mut all| all.any(is_one))
    }

    /// Those that could not be given their names: they are there all the same.
    pub fn unnamed(&self) -> &[PathBuf] {
        &self.shelf.unnamed
    }

    /// Whether one is being written.
    pub fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Whether the file that is being written is to end, as the ring wants it, before so many bytes
    /// that were heard at this time; or at this time, where there are none. By a clock that is never
    /// set back: by one that is, the file would not end before it has caught up.
    pub fn is_full_for(&self, from: Moment, bytes: usize) -> bool {
        let Some(open) = &self.open else { return false };
        let length = open.length() + bytes as u64;
        let covered = from.since(open.begin).unwrap_or(0);
        self.ring.size.is_some_and(|size| length > size)
            || self.ring.duration.is_some_and(|duration| covered >= duration)
    }

    /// Writes blocks that begin at `from`, by a clock that is never set back, and bear `stamp`: in a
    /// new file where none is open, behind the heads that they need. Once something could not be
    /// written, nothing more is.
    ///
    /// # Errors
    /// It cannot be written. The file ends with the last whole block.
    pub fn write(
        &mut self,
        from: Moment,
        stamp: Moment,
        bytes: &[u8],
        heads: &[Vec<u8>],
    ) -> Result<(), WriteError> {
        if self.is_broken {
            self.is_cut = true;
            return Ok(());
        }
        self.check()?;
        let is_new = self.open.is_none();
        if is_new {
            self.begin(from, stamp)?;
        }
        let Some(open) = &mut self.open else { return Ok(()) };
        for head in heads.iter().skip(open.heads) {
            open.buffer.extend_from_slice(head);
        }
        open.heads = heads.len();
        open.buffer.extend_from_slice(bytes);
        open.waiting_since.get_or_insert_with(Instant::now);
        // A file without its head is no capture, should the program be killed now.
        if is_new || open.buffer.len() >= BUFFERED { self.flush() } else { Ok(()) }
    }

    /// Writes what has waited long enough, and looks whether it is still there.
    ///
    /// # Errors
    /// It cannot be written, or somebody deleted the file.
    pub fn attend(&mut self) -> Result<(), WriteError> {
        self.check()?;
        if self.open.as_ref().is_some_and(|open| open.seen.elapsed() >= LOOKED_EACH) {
            self.look_for_open()?;
        }
        let since = self.open.as_ref().and_then(|open| open.waiting_since);
        match since {
            Some(since) if since.elapsed() >= LONGEST_WAIT => self.flush(),
            _ => Ok(()),
        }
    }

    /// Ends the file that is being written with these blocks. It gets its name as soon as it is on
    /// the disk.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn finish(&mut self, ends: &[u8]) -> Result<(), WriteError> {
        let Some(open) = &mut self.open else { return Ok(()) };
        open.buffer.extend_from_slice(ends);
        self.flush()?;
        self.look_for_open()?;
        self.shelve();
        Ok(())
    }

    /// Waits until every file that is finished is on the disk and bears its name.
    ///
    /// # Errors
    /// One could not be brought there, or not be renamed.
    pub fn settle(&mut self) -> Result<(), WriteError> {
        self.shelf.settle().inspect_err(|_| self.is_broken = true)
    }

    /// Whether files that were finished got where they belong.
    fn check(&mut self) -> Result<(), WriteError> {
        self.shelf.check().inspect_err(|_| self.is_broken = true)
    }

    /// Whether the file that is being written is still there. A file without a name takes all that is
    /// written, and is gone when it is closed: nobody shall listen for days for that.
    fn look_for_open(&mut self) -> Result<(), WriteError> {
        let Some(open) = &mut self.open else { return Ok(()) };
        open.seen = Instant::now();
        // What cannot be looked at may be there.
        if !matches!(open.names.part.try_exists(), Ok(false)) {
            return Ok(());
        }
        (self.is_broken, self.is_cut) = (true, true);
        self.bytes -= open.written;
        let path = open.names.part.clone();
        self.open = None;
        let what = "somebody deleted or moved it while it was being written";
        Err(WriteError { path, cause: io::Error::new(io::ErrorKind::NotFound, what) })
    }

    fn begin(&mut self, begin: Moment, stamp: Moment) -> Result<(), WriteError> {
        let names = loop {
            self.number = self.number.saturating_add(1);
            let names = Names::new(&self.directory, stamp, self.number);
            // Another recording in the same second.
            if names.are_free() || self.number == u32::MAX {
                break names;
            }
        };
        let file = OpenOptions::new().write(true).create_new(true).open(&names.part);
        let file = file.map_err(|cause| {
            (self.is_broken, self.is_cut) = (true, true);
            WriteError { path: names.part.clone(), cause }
        })?;
        let buffer = Vec::with_capacity(2 * BUFFERED);
        let (written, waiting_since, seen, heads) = (0, None, Instant::now(), 0);
        self.open = Some(Open { names, file, buffer, written, waiting_since, seen, begin, heads });
        Ok(())
    }

    fn flush(&mut self) -> Result<(), WriteError> {
        let Some(open) = &mut self.open else { return Ok(()) };
        let before = open.written;
        let flushed = open.flush();
        let Open { written, names, .. } = open;
        self.bytes += *written - before;
        let Err(cause) = flushed else { return Ok(()) };
        (self.is_broken, self.is_cut) = (true, true);
        let path = names.part.clone();
        if *written > 0 {
            // What is whole is worth its name, and no more will come. Where it cannot be renamed
            // either it stays where it is, to be read all the same.
            self.shelve();
        } else {
            // A name without content would pass for a capture. Where it cannot be deleted, it has
            // no such name.
            let _ = fs::remove_file(&path);
            self.open = None;
        }
        Err(WriteError { path, cause })
    }

    fn shelve(&mut self) {
        if let Some(Open { names, file, .. }) = self.open.take() {
            self.finished += 1;
            self.shelf.put(file, names);
        }
    }
}

impl Open {
    fn length(&self) -> u64 {
        self.written + self.buffer.len() as u64
    }

    /// Writes the buffer. Where not all of it has room, whole blocks stay.
    fn flush(&mut self) -> io::Result<()> {
        self.waiting_since = None;
        let mut done = 0;
        while done < self.buffer.len() {
            match self.file.write(&self.buffer[done..]) {
                Ok(0) => return self.cut(done, io::ErrorKind::WriteZero.into()),
                Ok(count) => done += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return self.cut(done, error),
            }
        }
        self.written += done as u64;
        self.buffer.clear();
        Ok(())
    }

    fn cut(&mut self, done: usize, error: io::Error) -> io::Result<()> {
        self.written += whole_blocks(&self.buffer, done) as u64;
        self.buffer.clear();
        // Where even this fails, the file ends inside a block, and readers say so.
        let _ = self.file.set_len(self.written);
        Err(error)
    }
}

/// How many of the first `done` bytes are blocks that are whole.
fn whole_blocks(blocks: &[u8], done: usize) -> usize {
    let mut whole = 0;
    // Type and length, both little-endian.
    while let Some(&[_, _, _, _, a, b, c, d]) = blocks[whole..].first_chunk::<8>() {
        let end = whole + u32::from_le_bytes([a, b, c, d]) as usize;
        if end > done || end == whole {
            break;
        }
        whole = end;
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_room_ends_with_a_whole_block() {
        // Blocks of 12 and 16 bytes: type, length, body, length.
        let block = |length: u32| {
            let mut bytes = vec![6, 0, 0, 0];
            bytes.extend(length.to_le_bytes());
            bytes.resize(length as usize - 4, 0);
            bytes.extend(length.to_le_bytes());
            bytes
        };
        let blocks = [block(12), block(16)].concat();
        let cuts = [0, 11, 12, 27, 28].map(|done| whole_blocks(&blocks, done));
        assert_eq!(cuts, [0, 0, 12, 12, 28]);
    }

    fn at(second: i64) -> Moment {
        Moment::from_ns(second * 1_000_000_000)
    }

    fn write(files: &mut Files, second: i64) {
        if files.is_full_for(at(second), 1_000) {
            files.finish(&[]).unwrap();
        }
        files.write(at(second), at(second), &[0; 1_000], &[vec![1; 500]]).unwrap();
    }

    #[test]
    fn a_ring_ends_files_by_size_and_deletes_the_oldest() {
        let directory = tempfile::tempdir().unwrap();
        let ring = "files=2,size=4k".parse().unwrap();
        let mut files = Files::new(directory.path(), ring).unwrap();
        // 500 + 3 x 1000 bytes fit into 4000.
        (0..10).for_each(|second| write(&mut files, second));
        files.finish(&[]).unwrap();
        files.settle().unwrap();
        assert_eq!((files.finished, files.bytes), (4, 12_000));
        let mut sizes: Vec<_> = fs::read_dir(directory.path())
            .unwrap()
            .map(|entry| entry.unwrap())
            .map(|entry| {
                (entry.file_name().into_string().unwrap(), entry.metadata().unwrap().len())
            })
            .collect();
        sizes.sort();
        assert_eq!(sizes.iter().map(|(_, size)| *size).collect::<Vec<_>>(), [3_500, 1_500]);
        assert!(sizes[0].0.ends_with("-0003.pcapng") && sizes[1].0.ends_with("-0004.pcapng"));
    }

    #[test]
    fn a_ring_ends_files_by_duration() {
        let directory = tempfile::tempdir().unwrap();
        let mut files = Files::new(directory.path(), "duration=3s".parse().unwrap()).unwrap();
        (10..17).for_each(|second| write(&mut files, second));
        assert!(!files.is_full_for(at(18), 0) && files.is_full_for(at(19), 0));
        files.finish(&[]).unwrap();
        // 10 to 12, 13 to 15, 16.
        assert_eq!(files.finished, 3);
    }

    #[test]
    fn a_file_that_somebody_deleted_is_missed() {
        let directory = tempfile::tempdir().unwrap();
        let mut files = Files::new(directory.path(), Ring::default()).unwrap();
        write(&mut files, 1);
        files.finish(&[]).unwrap();
        files.settle().unwrap();
        assert!(files.are_there());
        write(&mut files, 2);
        fs::remove_dir_all(directory.path()).unwrap();
        let error = files.finish(&[]).unwrap_err();
        assert!(error.cause.to_string().contains("deleted"), "{error:?}");
        // The first had 1500 bytes.
        assert_eq!((files.finished, files.bytes, files.are_there()), (1, 1_500, false));
        assert!(!files.is_open());
    }

    #[test]
    fn what_is_being_written_is_no_capture_yet() {
        let directory = tempfile::tempdir().unwrap();
        let mut files = Files::new(directory.path(), Ring::default()).unwrap();
        write(&mut files, 1);
        let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name();
        let names: Vec<_> = fs::read_dir(directory.path()).unwrap().map(name).collect();
        assert!(names.len() == 1 && names[0].to_string_lossy().ends_with(".pcapng.part"));
        // And yet its head of 500 bytes and the first blocks are there, whatever ends the program.
        let part = directory.path().join(&names[0]);
        assert_eq!(fs::metadata(part).unwrap().len(), 1_500);
    }
}
