//! Puts finished files on the shelf: each is on the disk before it bears its name, and the oldest of
//! a ring goes.
//!
//! After a power cut a file system may have the name of a file and not its content. So a file is
//! synced, then renamed, then its directory is synced. That takes as long as the disk takes, seconds
//! on a memory card, and is done in a thread of its own: whoever writes goes on with the next file.
//! Only where so many wait that the disk cannot be what it was bought for, the writer waits too, and
//! what is heard meanwhile waits in the queue of the tap.

use super::files::WriteError;
use super::names::Names;
use std::collections::VecDeque;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::{self, JoinHandle};

/// Files that may wait for the disk.
const WAITING: usize = 16;

/// Where finished files go.
pub struct Shelf {
    /// How many stay; all where it is not given.
    most: Option<u32>,
    /// Those that are whole and were not deleted, where some will be. The clerk has them while there
    /// is one.
    kept: VecDeque<PathBuf>,
    clerk: Option<Clerk>,
    /// Files that could not be given their names, and are there under those they were written by.
    pub unnamed: Vec<PathBuf>,
}

/// The thread that waits for the disk.
struct Clerk {
    orders: SyncSender<(File, Names)>,
    failures: Receiver<WriteError>,
    thread: JoinHandle<VecDeque<PathBuf>>,
}

impl Shelf {
    /// One on which so many files stay.
    pub fn new(most: Option<u32>) -> Self {
        Shelf { most, kept: VecDeque::new(), clerk: None, unnamed: Vec::new() }
    }

    /// Puts a file there that is written, and has not its name yet.
    pub fn put(&mut self, file: File, names: Names) {
        let Shelf { most, kept, clerk, .. } = self;
        let clerk = clerk.get_or_insert_with(|| Clerk::begin(*most, std::mem::take(kept)));
        // One that panicked has said so.
        let _ = clerk.orders.send((file, names));
    }

    /// Whether all went well so far.
    ///
    /// # Errors
    /// A file could not be synced or renamed, or the oldest not deleted.
    pub fn check(&mut self) -> Result<(), WriteError> {
        let failure = self.clerk.as_ref().and_then(|clerk| clerk.failures.try_recv().ok());
        self.outcome(failure)
    }

    /// Waits until every file that was put there bears its name.
    ///
    /// # Errors
    /// One could not be synced or renamed, or the oldest not deleted.
    pub fn settle(&mut self) -> Result<(), WriteError> {
        let Some(Clerk { orders, failures, thread }) = self.clerk.take() else { return Ok(()) };
        drop(orders);
        self.kept = thread.join().unwrap_or_default();
        let failures: Vec<WriteError> = failures.try_iter().collect();
        let outcomes = failures.into_iter().map(|failure| self.outcome(Some(failure)));
        // All are remembered, and the first is told.
        outcomes.fold(Ok(()), Result::and)
    }

    /// Remembers the file that a failure leaves without its name.
    fn outcome(&mut self, failure: Option<WriteError>) -> Result<(), WriteError> {
        let Some(failure) = failure else { return Ok(()) };
        if failure.path.extension().is_some_and(|end| end == "part") && failure.path.exists() {
            self.unnamed.push(failure.path.clone());
        }
        Err(failure)
    }
}

impl Drop for Shelf {
    fn drop(&mut self) {
        // Whoever wants to know has asked.
        let _ = self.settle();
    }
}

impl Clerk {
    fn begin(most: Option<u32>, mut kept: VecDeque<PathBuf>) -> Clerk {
        let (orders, to_do) = sync_channel::<(File, Names)>(WAITING);
        let (tell, failures): (Sender<WriteError>, _) = channel();
        let thread = thread::spawn(move || {
            for (file, names) in to_do {
                let done = name(&file, &names).and_then(|()| {
                    let Some(most) = most else { return Ok(()) };
                    kept.push_back(names.whole);
                    clear(&mut kept, most)
                });
                // Nobody asks any more where the recording is over.
                let _ = done.map_err(|failure| tell.send(failure));
            }
            kept
        });
        Clerk { orders, failures, thread }
    }
}

/// Gives a file its name once it is on the disk.
fn name(file: &File, names: &Names) -> Result<(), WriteError> {
    let named = sync(file).and_then(|()| fs::rename(&names.part, &names.whole));
    named.map_err(|cause| WriteError { path: names.part.clone(), cause })?;
    let directory = names.whole.parent().unwrap_or(Path::new("."));
    sync_directory(directory).map_err(|cause| WriteError { path: directory.to_owned(), cause })
}

/// Deletes the oldest beyond so many.
fn clear(kept: &mut VecDeque<PathBuf>, most: u32) -> Result<(), WriteError> {
    while kept.len() > most as usize {
        let Some(oldest) = kept.pop_front() else { break };
        match fs::remove_file(&oldest) {
            // The user was faster.
            Err(cause) if cause.kind() != io::ErrorKind::NotFound => {
                return Err(WriteError { path: oldest, cause });
            }
            _ => {}
        }
    }
    Ok(())
}

/// Waits until a file is on the disk. Some file systems have no such promise to give.
fn sync(file: &File) -> io::Result<()> {
    match file.sync_all() {
        Err(error) if is_never(&error) => Ok(()),
        done => done,
    }
}

fn is_never(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::Unsupported | io::ErrorKind::InvalidInput)
}

#[cfg(unix)]
fn sync_directory(directory: &Path) -> io::Result<()> {
    File::open(directory).and_then(|directory| sync(&directory))
}

/// Elsewhere directories cannot be opened to be synced.
#[cfg(not(unix))]
fn sync_directory(_: &Path) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use dissectors::event::Moment;

    #[test]
    fn files_that_cannot_be_named_are_remembered() {
        let directory = tempfile::tempdir().unwrap();
        let mut shelf = Shelf::new(None);
        let names = [1, 2].map(|number| Names::new(directory.path(), Moment::from_ns(0), number));
        for names in &names {
            let file = File::create(&names.part).unwrap();
            // No file can take the name of a folder.
            fs::create_dir(&names.whole).unwrap();
            shelf.put(file, names.clone());
        }
        assert_eq!(shelf.settle().unwrap_err().path, names[0].part);
        assert_eq!(shelf.unnamed, names.map(|names| names.part));
    }

    /// Where none will be deleted, nothing grows with a recording of months.
    #[test]
    fn names_are_remembered_only_of_files_that_a_ring_deletes() {
        for (most, remembered) in [(None, 0), (Some(2), 2), (Some(9), 3)] {
            let directory = tempfile::tempdir().unwrap();
            let mut shelf = Shelf::new(most);
            for number in 1..=3 {
                let names = Names::new(directory.path(), Moment::from_ns(0), number);
                shelf.put(File::create(&names.part).unwrap(), names);
            }
            shelf.settle().unwrap();
            assert_eq!(shelf.kept.len(), remembered);
            let there = fs::read_dir(directory.path()).unwrap().count();
            assert_eq!(there, most.map_or(3, |most| most.min(3) as usize));
        }
    }
}
