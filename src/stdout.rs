//! Standard output. Its reader may rest as long as it likes, a pager or a terminal that is held, until
//! the run is to end: then it has a moment to take what is left.

use crate::interrupt;
use std::io::{self, Write};
use std::time::{Duration, Instant};

/// How long the reader may take nothing once the user wants the run to end.
#[cfg(unix)]
const MOMENT: Duration = Duration::from_secs(1);

/// What a pipe takes at once without waiting, where it takes anything: `PIPE_BUF` (pipe(7)).
#[cfg(unix)]
const AT_ONCE: usize = 4096;

/// Standard output, without a buffer.
pub struct Stdout {
    out: io::Stdout,
    /// Whether somebody reads it who may rest: that of a file or of `/dev/null` never does.
    has_reader: bool,
    resting_since: Option<Instant>,
}

impl Stdout {
    /// That of this program.
    pub fn new() -> Self {
        let out = io::stdout();
        let has_reader = has_reader(&out);
        Stdout { out, has_reader, resting_since: None }
    }
}

impl Default for Stdout {
    fn default() -> Self {
        Stdout::new()
    }
}

#[cfg(unix)]
fn has_reader(out: &io::Stdout) -> bool {
    use rustix::fs::FileType;
    let kind = rustix::fs::fstat(out).map(|stat| FileType::from_raw_mode(stat.st_mode));
    match kind {
        Ok(FileType::Fifo | FileType::Socket) => true,
        _ => rustix::termios::isatty(out),
    }
}

#[cfg(not(unix))]
fn has_reader(_: &io::Stdout) -> bool {
    false
}

#[cfg(unix)]
impl Write for Stdout {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let bytes = match self.has_reader {
            true => &bytes[..bytes.len().min(AT_ONCE)],
            false => bytes,
        };
        if self.has_reader {
            self.wait()?;
        }
        Ok(rustix::io::write(&self.out, bytes)?)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(unix)]
impl Stdout {
    /// Waits until the reader takes something, or is gone, which writing tells.
    fn wait(&mut self) -> io::Result<()> {
        use rustix::event::{PollFd, PollFlags, Timespec, poll};
        // A signal ends the wait at once; the time is for one that comes just before it.
        let turn = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };
        loop {
            let mut waiting = [PollFd::new(&self.out, PollFlags::OUT)];
            match poll(&mut waiting, Some(&turn)) {
                Ok(0) | Err(rustix::io::Errno::INTR) => {}
                Ok(_) | Err(_) => {
                    self.resting_since = None;
                    return Ok(());
                }
            }
            if interrupt::came() {
                let since = *self.resting_since.get_or_insert_with(Instant::now);
                if since.elapsed() >= MOMENT {
                    let what = "whoever reads it takes nothing";
                    return Err(io::Error::new(io::ErrorKind::TimedOut, what));
                }
            }
        }
    }
}

#[cfg(not(unix))]
impl Write for Stdout {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
