//! The other end of a serial port: the master of a pseudo terminal.

use rustix::fd::OwnedFd;
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

/// A line, and the port that hangs on it.
pub struct Line {
    master: OwnedFd,
    /// The path of the port.
    pub port: String,
}

impl Line {
    pub fn new() -> Self {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).expect("a pseudo terminal");
        grantpt(&master).expect("it is ours");
        unlockpt(&master).expect("it is ours");
        rustix::io::ioctl_fionbio(&master, true).expect("it need not wait");
        let port = ptsname(&master, Vec::new()).expect("it has a name");
        Line { port: port.into_string().expect("UTF-8"), master }
    }

    /// Puts bytes on it: as many as it takes, which are few where nobody reads.
    pub fn put(&self, bytes: &[u8]) -> usize {
        match rustix::io::write(&self.master, bytes) {
            Ok(count) => count,
            Err(Errno::AGAIN) => 0,
            Err(error) => panic!("{}: {error}", self.port),
        }
    }

    /// What was written to the port and not fetched yet, if anything.
    pub fn fetch(&self) -> Vec<u8> {
        let mut buffer = [0; 256];
        // It is an error where nobody has the port open.
        let count = rustix::io::read(&self.master, &mut buffer).unwrap_or(0);
        buffer[..count].to_vec()
    }
}
