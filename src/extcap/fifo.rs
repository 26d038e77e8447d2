//! The pipe that Wireshark reads packets from.

use crate::interrupt;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;

/// The pipe. Whoever is told to stop while nobody reads must be able to: writing waits for the
/// reader no longer than until a signal comes.
pub struct Fifo(File);

impl Fifo {
    /// Opens it, and waits until somebody reads it.
    ///
    /// # Errors
    /// It is not there, or may not be written.
    pub fn open(path: &Path) -> io::Result<Fifo> {
        // Not created: a pipe that is gone would become a file that grows until the disk is full.
        let file = OpenOptions::new().write(true).truncate(true).open(path)?;
        #[cfg(unix)]
        rustix::fs::fcntl_setfl(
            &file,
            rustix::fs::fcntl_getfl(&file)? | rustix::fs::OFlags::NONBLOCK,
        )?;
        Ok(Fifo(file))
    }

    /// The same pipe once more.
    ///
    /// # Errors
    /// There are too many files open.
    pub fn again(&self) -> io::Result<Fifo> {
        self.0.try_clone().map(Fifo)
    }

    /// Fails once nobody reads it any more, which writing alone tells only when there is something
    /// to be written.
    ///
    /// # Errors
    /// Nobody reads it.
    #[cfg(unix)]
    pub fn check(&self) -> io::Result<()> {
        use rustix::event::PollFlags;
        let gone = PollFlags::ERR | PollFlags::HUP;
        match poll(&self.0, PollFlags::empty(), 0)?.intersects(gone) {
            true => Err(io::ErrorKind::BrokenPipe.into()),
            false => Ok(()),
        }
    }

    /// Other systems tell only when something is written.
    #[cfg(not(unix))]
    pub fn check(&self) -> io::Result<()> {
        Ok(())
    }
}

/// Waits for events of a file, in ms at most.
#[cfg(unix)]
fn poll(
    file: &File,
    events: rustix::event::PollFlags,
    wait_ms: i64,
) -> io::Result<rustix::event::PollFlags> {
    use rustix::event::{PollFd, Timespec};
    let wait = Timespec { tv_sec: 0, tv_nsec: wait_ms * 1_000_000 };
    let mut waiting = [PollFd::new(file, events)];
    match rustix::event::poll(&mut waiting, Some(&wait)) {
        Ok(_) => Ok(waiting[0].revents()),
        Err(rustix::io::Errno::INTR) => Ok(rustix::event::PollFlags::empty()),
        Err(error) => Err(error.into()),
    }
}

#[cfg(unix)]
impl Write for Fifo {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        use rustix::event::PollFlags;
        loop {
            // What is at hand is still written after a signal, if there is room.
            let is_over = interrupt::came();
            let told = poll(&self.0, PollFlags::OUT, if is_over { 0 } else { 100 })?;
            if told.is_empty() {
                if is_over {
                    return Err(io::ErrorKind::BrokenPipe.into());
                }
                continue;
            }
            match rustix::io::write(&self.0, bytes) {
                Err(rustix::io::Errno::AGAIN | rustix::io::Errno::INTR) => {}
                written => return Ok(written?),
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(not(unix))]
impl Write for Fifo {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if interrupt::came() {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::process::Command;

    /// An idle bus writes nothing that would fail.
    #[test]
    fn who_reads_no_more_is_noticed_without_writing() {
        let scratch = tempfile::tempdir().expect("temporary files can be made");
        let path = scratch.path().join("pipe");
        assert!(Command::new("mkfifo").arg(&path).status().expect("mkfifo is there").success());
        let reading = path.clone();
        let reader = std::thread::spawn(move || File::open(reading).expect("it was made"));
        let fifo = Fifo::open(&path).expect("somebody reads");
        let reader = reader.join().expect("it does not panic");
        assert!(fifo.check().is_ok());
        drop(reader);
        let error = fifo.check().expect_err("nobody reads");
        assert_eq!(error.kind(), io::ErrorKind::BrokenPipe);
    }

    #[test]
    fn a_file_will_do() {
        let scratch = tempfile::tempdir().expect("temporary files can be made");
        let path = scratch.path().join("file");
        assert!(Fifo::open(&path).is_err() && !path.exists(), "it was made by nobody else");
        std::fs::write(&path, "").expect("it can be written");
        let mut fifo = Fifo::open(&path).expect("it is there");
        fifo.write_all(b"packets").expect("there is room");
        assert!(fifo.check().is_ok());
        assert_eq!(std::fs::read(&path).expect("it is there"), b"packets");
    }
}
