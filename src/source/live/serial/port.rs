//! A serial port on Linux, open for listening.
//!
//! Nothing is ever written to it, and the modem lines that the kernel raises on opening are dropped
//! at once: RTS often switches the transmitter of an RS485 adapter.

use super::adapter::Adapter;
use super::counters::Counters;
use super::latency::Latency;
use super::settings::{Kept, Refusal, apply};
use super::{Terms, ioctl};
use crate::ports::{self, holders};
use dissectors::uart::{Baud, Format, ParityMarks, ParityRule};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::BorrowedFd;
use rustix::fs::OFlags;
use rustix::io::Errno;
use rustix::termios::{QueueSelector, tcflush};
use serialport::{ErrorKind, FlowControl, TTYPort};
use std::fs;
use std::io;
use std::path::Path;
use std::time::Duration;

/// A port that is listened to.
pub struct Port {
    port: TTYPort,
    format: Format,
    adapter: Adapter,
    kept: Kept,
    latency: Latency,
    /// Others that have it open.
    holders: Vec<String>,
    lines: Result<(), Errno>,
}

impl Port {
    /// Opens and sets a port.
    ///
    /// # Errors
    /// It cannot be listened to: why, and what to do.
    pub fn open(path: &Path, baud: Baud, format: Format) -> Result<Port, String> {
        let device = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let port = serialport::new(path.to_string_lossy(), baud.get())
            .flow_control(FlowControl::None)
            .open_native()
            .map_err(|error| refusal(&device, &error))?;
        let lines = ioctl::drop_lines(&port);
        let descriptor = ioctl::descriptor(&port);
        never_block(descriptor).map_err(|error| explain(Refusal::Failed(error)))?;
        let adapter = adapter_of(&port);
        let kept = apply(descriptor, baud, format).map_err(explain)?;
        if !adapter.is_pseudo() {
            // It was heard with whatever settings there were before. Nothing waits to be sent but
            // the echo that a terminal makes of what it hears before it is set.
            let _ = tcflush(descriptor, QueueSelector::IOFlush);
        }
        let latency = Latency::shorten(&port, &adapter, character(baud, format));
        let holders = holders(&device);
        Ok(Port { port, format, adapter, kept, latency, holders, lines })
    }

    /// Sets another rate.
    ///
    /// # Errors
    /// The port does not take it.
    pub fn set_baud(&mut self, baud: Baud) -> Result<(), String> {
        let descriptor = ioctl::descriptor(&self.port);
        self.kept = apply(descriptor, baud, self.format).map_err(explain)?;
        self.latency =
            std::mem::take(&mut self.latency).at(&self.adapter, character(baud, self.format));
        // What came before was heard at the other rate.
        let _ = tcflush(descriptor, QueueSelector::IFlush);
        Ok(())
    }

    /// Waits for characters, for this long at most, and reads what there is: 0 where nothing came.
    ///
    /// # Errors
    /// The port is gone.
    pub fn read(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        let descriptor = ioctl::descriptor(&self.port);
        let wait = Timespec { tv_sec: 0, tv_nsec: i64::from(patience.subsec_nanos()) };
        let mut waiting = [PollFd::new(&descriptor, PollFlags::IN)];
        match poll(&mut waiting, Some(&wait)) {
            Ok(0) | Err(Errno::INTR) => return Ok(0),
            Ok(_) => {}
            Err(error) => return Err(error.into()),
        }
        self.take(buffer)
    }

    /// Reads what there is. That there is something is no promise: another reader may have been
    /// faster, one that had the port before it was locked.
    fn take(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match rustix::io::read(ioctl::descriptor(&self.port), buffer) {
            // There was something, and it is the end.
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(count) => Ok(count),
            Err(Errno::INTR | Errno::AGAIN) => Ok(0),
            Err(error) => Err(error.into()),
        }
    }

    /// What the driver counted so far, where it does.
    pub fn counters(&self) -> Option<Counters> {
        ioctl::counters(&self.port).ok()
    }

    /// What can be expected of it.
    pub fn terms(&self) -> Terms {
        let has_parity = self.format.parity() != ParityRule::None;
        let marks = match self.kept.checks_parity || !has_parity {
            true => self.adapter.parity_marks(),
            false => ParityMarks::None,
        };
        Terms {
            is_marked: self.kept.marks,
            parity: marks,
            uncertainty: self.latency.uncertainty(),
            longest_wait: self.latency.longest(),
        }
    }

    /// What was found in force, in a line.
    pub fn description(&self) -> String {
        let (driver, Kept { baud, .. }) = (self.adapter.name(), &self.kept);
        format!("{driver}, {baud} {}, {}", self.format, self.latency.told)
    }

    /// What nobody can know of it, and how to find out.
    pub fn doubt(&self) -> Option<String> {
        let has_parity = self.kept.checks_parity && self.format.parity() != ParityRule::None;
        (has_parity && ports::is_unproven(self.adapter.name()))
            .then(|| format!("{}; {}", ports::UNPROVEN, ports::PROOF))
    }

    /// What the user should know before believing what is heard.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = self.kept.losses.clone();
        if self.kept.checks_parity && self.format.parity() != ParityRule::None {
            warnings.extend(self.warning_of_marks());
        }
        if !self.holders.is_empty() {
            warnings.push(format!(
                "{} has it open as well: of two readers each gets a part of the characters",
                self.holders.join(", ")
            ));
        }
        if let Err(error) = &self.lines {
            warnings.push(format!(
                "RTS and DTR cannot be dropped ({error}): an adapter whose transmitter they switch \
                 may hold the bus"
            ));
        }
        warnings
    }

    fn warning_of_marks(&self) -> Option<String> {
        let driver = self.adapter.name();
        match self.adapter.parity_marks() {
            ParityMarks::Character => None,
            ParityMarks::Packet => Some(format!(
                "{driver} marks whole packets: with one parity error all characters that came \
                 together are suspect"
            )),
            ParityMarks::None => Some(format!(
                "{driver} marks no parity errors: the parity of characters is unknown"
            )),
        }
    }
}

/// Makes reading return at once: `serialport` leaves it waiting for a character.
fn never_block(descriptor: BorrowedFd<'_>) -> Result<(), Errno> {
    let flags = rustix::fs::fcntl_getfl(descriptor)?;
    rustix::fs::fcntl_setfl(descriptor, flags | OFlags::NONBLOCK)
}

/// How long a character takes.
fn character(baud: Baud, format: Format) -> Duration {
    Duration::from_nanos(baud.bits_ns(format.bits()))
}

fn adapter_of(port: &TTYPort) -> Adapter {
    let (major, minor) = match rustix::fs::fstat(ioctl::descriptor(port)) {
        Ok(status) => (rustix::fs::major(status.st_rdev), rustix::fs::minor(status.st_rdev)),
        Err(_) => (0, 0),
    };
    Adapter::of_device(major, minor)
}

/// Why a port does not open, and what to do.
fn refusal(device: &Path, error: &serialport::Error) -> String {
    match error.kind {
        ErrorKind::Io(io::ErrorKind::NotFound) => {
            "there is no such port: is the adapter plugged in? `fieldtap ports` lists what there is"
                .to_owned()
        }
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => {
            "this port may not be opened: `sudo usermod -aG dialout $USER`, then log in anew"
                .to_owned()
        }
        ErrorKind::NoDevice => match holders(device) {
            none if none.is_empty() => {
                "another program has this port: close it there (its name is hidden, as it runs \
                 under another user: `sudo fuser -v` tells)"
                    .to_owned()
            }
            holders => {
                format!("{} has this port: close it there first", holders.join(", "))
            }
        },
        _ => format!("this is no serial port that can be listened to ({error})"),
    }
}

fn explain(refusal: Refusal) -> String {
    match refusal {
        Refusal::Failed(error) => format!("the port takes no settings ({error})"),
        Refusal::Needed(what) => format!("{what}; it cannot be listened to like that"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use std::sync::mpsc::channel;
    use std::thread;

    #[test]
    fn what_another_reader_took_is_not_waited_for() {
        let master =
            openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let path = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        let mut port =
            Port::open(Path::new(&path), Baud::new(115_200).unwrap(), Format::FT12).unwrap();
        let (sender, taken) = channel();
        thread::spawn(move || sender.send(port.take(&mut [0; 16]).unwrap()));
        assert_eq!(taken.recv_timeout(Duration::from_secs(5)), Ok(0));
    }
}
