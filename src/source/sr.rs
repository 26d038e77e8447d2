//! sigrok sessions, `.sr`: a ZIP archive of packed logic samples.
//!
//! Members are `version` (`1` or `2`), `metadata` (an INI text) and the samples: one `logic-1`, or
//! `logic-1-1`, `logic-1-2` … until one is missing. They are unpacked block by block in a thread
//! of their own, so that a session may unpack to any size.

use super::logic::{Blocks, Logic};
use super::{Input, MOST_CHANNELS, Place, SourceError, SourceOptions, frequency};
use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use zip::ZipArchive;
use zip::read::read_zipfile_from_stream;
use zip::result::ZipError;

/// Bytes unpacked at a time.
const BLOCK: usize = 256 * 1024;

/// Blocks that may wait to be looked at.
const AHEAD: usize = 4;

/// Longest text member that is read.
const LONGEST_TEXT: u64 = 1 << 20;

/// Whether a source begins as a ZIP archive does.
pub fn is_zip(head: &[u8]) -> bool {
    head.starts_with(b"PK\x03\x04")
}

/// Opens a session.
///
/// # Errors
/// It is no session, or lacks what is needed to read its samples.
pub fn open(input: Input, options: &SourceOptions) -> Result<Logic, SourceError> {
    let name = input.name.clone();
    let wrong = |what: &str| SourceError::new(&name, Place::Whole, what);
    let mut archive = Archive::open(input)?;
    let session = Session::parse(&archive.text("metadata")?);
    let capture = session
        .capture
        .ok_or_else(|| wrong("the session has no logic channels; analog ones are not read"))?;
    let rate = options.samplerate.or(session.samplerate).ok_or_else(|| {
        wrong("the session does not tell its sample rate: give it with --samplerate")
    })?;
    let unitsize = session
        .unitsize
        .filter(|size| (1..=64).contains(size))
        .ok_or_else(|| wrong("the metadata has no usable unitsize: the session is damaged"))?;
    if session.channels.is_empty() {
        return Err(wrong("the session has no logic channels"));
    }
    if let Some((channel, bit)) = session.channels.iter().find(|(_, bit)| *bit >= 8 * unitsize) {
        let channel = channel.escape_debug();
        return Err(wrong(&format!(
            "channel {channel} is bit {bit} of samples of {unitsize} bytes: the metadata is damaged"
        )));
    }
    let (sender, blocks) = sync_channel(AHEAD);
    let (give_back, empty) = sync_channel(AHEAD + 2);
    thread::spawn(move || archive.unpack(&capture, &Unpacking { sender, empty }));
    let blocks = Unpacked { blocks, give_back, block: Vec::new() };
    Logic::new(&name, Box::new(blocks), rate, unitsize, session.channels, options)
}

/// What the metadata say about the samples.
#[derive(Default, Debug)]
struct Session {
    capture: Option<String>,
    samplerate: Option<u64>,
    unitsize: Option<usize>,
    /// Names and bits.
    channels: Vec<(String, usize)>,
}

impl Session {
    /// Reads the metadata of the first device that has samples. `unitsize` and the number of
    /// probes do not depend on each other; only probes in use are listed.
    fn parse(metadata: &str) -> Session {
        let mut session = Session::default();
        for line in metadata.lines().map(str::trim) {
            if line.starts_with("[device") && session.capture.is_some() {
                break;
            }
            let Some((key, value)) = line.split_once('=') else { continue };
            let (key, value) = (key.trim(), value.trim());
            match key {
                "capturefile" => session.capture = Some(value.to_owned()),
                "samplerate" => session.samplerate = frequency(value),
                "unitsize" => session.unitsize = value.parse().ok(),
                _ => {
                    let number = key.strip_prefix("probe").and_then(|n| n.parse::<usize>().ok());
                    let bit = number.and_then(|number| number.checked_sub(1));
                    // So many that it is refused, and not one more.
                    if let Some(bit) = bit.filter(|_| session.channels.len() <= MOST_CHANNELS) {
                        session.channels.push((value.to_owned(), bit));
                    }
                }
            }
        }
        session
    }
}

/// The archive of a session.
struct Archive {
    name: String,
    members: Members,
}

enum Members {
    Whole(Box<ZipArchive<BufReader<File>>>),
    /// The directory at the end is missing: members are read in the order they were written.
    Cut(File),
}

/// Refuses a stream that is no archive before all of it is copied: it need not have an end.
fn check_beginning(input: &mut Input) -> Result<(), SourceError> {
    const MARK: &[u8] = b"PK";
    while input.head().len() < MARK.len() && input.look_further()? {}
    if input.head().starts_with(MARK) {
        return Ok(());
    }
    let what = "this is no zip archive, and so no sigrok session";
    Err(SourceError::new(&input.name, Place::Byte(0), what))
}

impl Archive {
    fn open(mut input: Input) -> Result<Archive, SourceError> {
        let name = input.name.clone();
        let failed = |error| SourceError::io(&name, Place::Whole, error);
        // An archive needs to be gone back in: standard input is copied to a temporary file.
        let file = match input.file() {
            Some(file) => file.try_clone().map_err(failed)?,
            None => {
                check_beginning(&mut input)?;
                let mut spool = tempfile::tempfile().map_err(failed)?;
                io::copy(&mut input, &mut spool).map_err(failed)?;
                spool
            }
        };
        let copy = file.try_clone().map_err(failed)?;
        let members = match ZipArchive::new(BufReader::new(copy)) {
            Ok(archive) => Members::Whole(Box::new(archive)),
            Err(ZipError::Io(error)) if error.kind() != io::ErrorKind::UnexpectedEof => {
                return Err(failed(error));
            }
            Err(_) => Members::Cut(file),
        };
        Ok(Archive { name, members })
    }

    /// A member that is a text.
    fn text(&mut self, member: &str) -> Result<String, SourceError> {
        let mut text = Vec::new();
        match &mut self.members {
            Members::Whole(archive) => {
                let missing = |_| {
                    let what =
                        format!("the archive has no member {member}: this is not a sigrok session");
                    SourceError::new(&self.name, Place::Whole, what)
                };
                let file = archive.by_name(member).map_err(missing)?;
                file.take(LONGEST_TEXT)
                    .read_to_end(&mut text)
                    .map_err(|error| SourceError::io(&self.name, Place::Whole, error))?;
            }
            Members::Cut(file) => {
                let found = in_order(file, |name, reader| {
                    if name != member {
                        return Ok(true);
                    }
                    reader.take(LONGEST_TEXT).read_to_end(&mut text)?;
                    Ok(false)
                });
                if text.is_empty() {
                    let (offset, _) = found.unwrap_or((0, String::new()));
                    let what = format!(
                        "the session is cut before its {member}, without which nothing can be read"
                    );
                    return Err(SourceError::new(&self.name, Place::Byte(offset), what));
                }
            }
        }
        // A name that is no UTF-8 is still a channel.
        Ok(String::from_utf8_lossy(&text).into_owned())
    }

    /// Unpacks the samples block by block, until nobody takes them any more.
    fn unpack(self, capture: &str, unpacking: &Unpacking) {
        let Archive { name, members } = self;
        match members {
            Members::Whole(mut archive) => {
                if let Err((member, error)) = unpack_whole(&mut archive, capture, unpacking) {
                    let what = format!("{member} cannot be unpacked: {error}");
                    unpacking.fail(SourceError::new(&name, Place::Whole, what));
                }
            }
            Members::Cut(mut file) => {
                let stopped = in_order(&mut file, |member, reader| {
                    let is_samples = member == capture
                        || member.strip_prefix(capture).is_some_and(|n| n.starts_with('-'));
                    if is_samples { unpacking.send_all(reader) } else { Ok(true) }
                });
                if let Some((offset, reason)) = stopped {
                    let what = format!("the session is cut here: {reason}");
                    unpacking.fail(SourceError::new(&name, Place::Byte(offset), what));
                }
            }
        }
    }
}

/// Unpacks the one member of that name, or the numbered ones.
fn unpack_whole(
    archive: &mut ZipArchive<BufReader<File>>,
    capture: &str,
    unpacking: &Unpacking,
) -> Result<(), (String, String)> {
    let chunks = (1_u64..).map(|number| format!("{capture}-{number}"));
    let single = archive.index_for_name(capture).map(|_| capture.to_owned());
    let names: Box<dyn Iterator<Item = String>> = match single {
        Some(single) => Box::new(std::iter::once(single)),
        None => Box::new(chunks),
    };
    for (count, member) in names.enumerate() {
        let Some(index) = archive.index_for_name(&member) else {
            let start = format!("{capture}-");
            let names = archive.file_names().filter_map(Result::ok);
            let chunks = names.filter(|name| name.starts_with(&start)).count();
            return match count {
                0 => Err((capture.to_owned(), "it is missing".to_owned())),
                _ if count < chunks => Err((member, "it is missing, and others follow".to_owned())),
                _ => Ok(()),
            };
        };
        let file = archive.by_index(index).map_err(|error| (member.clone(), error.to_string()))?;
        match unpacking.send_all(&mut { file }) {
            Ok(true) => {}
            Ok(false) => return Ok(()),
            Err(error) => return Err((member, error.to_string())),
        }
    }
    Ok(())
}

/// Reads the members of an archive without a directory one after the other, for as long as `visit`
/// wants. Returns where and why it could not go on.
fn in_order(
    file: &mut File,
    mut visit: impl FnMut(&str, &mut dyn Read) -> io::Result<bool>,
) -> Option<(u64, String)> {
    if let Err(error) = file.seek(SeekFrom::Start(0)) {
        return Some((0, error.to_string()));
    }
    let count = Cell::new(0);
    let mut reader = Counted { reader: BufReader::new(file), count: &count };
    loop {
        let outcome = match read_zipfile_from_stream(&mut reader) {
            Ok(None) => return Some((count.get(), "its directory is missing".to_owned())),
            Ok(Some(mut member)) => {
                let name = member.name().map(|name| name.into_owned()).unwrap_or_default();
                visit(&name, &mut member)
            }
            Err(error) => return Some((count.get(), error.to_string())),
        };
        match outcome {
            Ok(true) => {}
            Ok(false) => return None,
            Err(error) => return Some((count.get(), error.to_string())),
        }
    }
}

/// A reader that tells how far it is, to those who cannot ask it.
struct Counted<'a, R> {
    reader: R,
    count: &'a Cell<u64>,
}

impl<R: Read> Read for Counted<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.reader.read(buffer)?;
        self.count.set(self.count.get() + count as u64);
        Ok(count)
    }
}

/// The unpacking side: blocks go out, used ones come back.
struct Unpacking {
    sender: SyncSender<Result<Vec<u8>, SourceError>>,
    empty: Receiver<Vec<u8>>,
}

impl Unpacking {
    /// Sends all that is left in a member. Returns false once nobody listens.
    fn send_all(&self, reader: &mut dyn Read) -> io::Result<bool> {
        loop {
            let mut block = self.empty.try_recv().unwrap_or_default();
            block.resize(BLOCK, 0);
            let mut filled = 0;
            let mut outcome = Ok(());
            while filled < BLOCK {
                match reader.read(&mut block[filled..]) {
                    Ok(0) => break,
                    Ok(count) => filled += count,
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                    Err(error) => {
                        outcome = Err(error);
                        break;
                    }
                }
            }
            block.truncate(filled);
            if filled > 0 && self.sender.send(Ok(block)).is_err() {
                return Ok(false);
            }
            outcome?;
            if filled < BLOCK {
                return Ok(true);
            }
        }
    }

    fn fail(&self, error: SourceError) {
        // Nobody listens any more: nobody needs to know.
        let _ = self.sender.send(Err(error));
    }
}

/// The other side: blocks as they come.
struct Unpacked {
    blocks: Receiver<Result<Vec<u8>, SourceError>>,
    give_back: SyncSender<Vec<u8>>,
    block: Vec<u8>,
}

impl Blocks for Unpacked {
    fn next_block(&mut self) -> Result<Option<&[u8]>, SourceError> {
        let used = std::mem::take(&mut self.block);
        // The unpacking side may be done already.
        let _ = self.give_back.try_send(used);
        match self.blocks.recv() {
            Ok(block) => {
                self.block = block?;
                Ok(Some(&self.block))
            }
            Err(_) => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_of_the_second_version() {
        let session = Session::parse(
            "[global]\nsigrok version=0.5.2\n\n[device 1]\ncapturefile=logic-1\ntotal probes=8\n\
             samplerate=4 MHz\ntotal analog=0\nprobe3=RXTX\nprobe8=7\nunitsize=1\n",
        );
        assert_eq!(session.capture.as_deref(), Some("logic-1"));
        assert_eq!((session.samplerate, session.unitsize), (Some(4_000_000), Some(1)));
        assert_eq!(session.channels, [("RXTX".to_owned(), 2), ("7".to_owned(), 7)]);
    }

    #[test]
    fn metadata_of_the_first_version_have_blanks_and_indented_lines() {
        let session = Session::parse(
            "[global]\nsigrok version = 0.2.0\n[device 1]\ndriver = ols\ncapturefile = logic-1\n\
             unitsize = 4\ntotal probes = 32\nsamplerate = 500 kHz\nprobe1 = RX\n trigger1 = 0\n\
             probe2 = TX\n",
        );
        assert_eq!((session.samplerate, session.unitsize), (Some(500_000), Some(4)));
        assert_eq!(session.channels, [("RX".to_owned(), 0), ("TX".to_owned(), 1)]);
    }
}
