//! `serial:`: a serial port.
//!
//! [`Port`] is opened and set, and never written to; [`Hearing`] turns what it reads into characters
//! with their times ([`spread`]) and marks; [`Seek`] finds the rate where it was not given.

mod counters;
mod hearing;
mod seek;
mod spread;

#[cfg(target_os = "linux")]
mod adapter;
#[cfg(target_os = "linux")]
mod ioctl;
#[cfg(target_os = "linux")]
mod latency;
#[cfg(target_os = "linux")]
mod settings;

#[cfg_attr(not(target_os = "linux"), path = "elsewhere.rs")]
mod port;

#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests;

use super::super::outbox::{Outbox, Reader};
use super::super::{Place, SourceError, SourceOptions};
use super::{PATIENCE, Tap};
use counters::Tally;
use dissectors::bus::WireFacts;
use dissectors::event::{Clock, Loss, LossCause, Moment};
use dissectors::protocol::Medium;
use dissectors::record::BusInfo;
use dissectors::uart::{Baud, Format, ParityMarks};
use hearing::Hearing;
use port::Port;
use seek::{RATES, Seek, Step};
use std::io;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// What is read in a turn at most: what the kernel holds for a port that is not read, 64 KiB, and
/// what its line discipline has.
const QUEUE: usize = 72 << 10;

/// So many bytes that wait make the line discipline ask the driver to hold back (`n_tty.c`: 4096,
/// less 128). What finds no room in the adapter then is gone.
const THROTTLED: usize = 4096 - 128;

/// How often the counters are looked at while nothing comes.
const COUNTING: Duration = Duration::from_secs(1);

/// Rates that serial ports have, in Bd: from the slowest one that POSIX names (`termios.h`: B50) to
/// the fastest one of a USB adapter (FT2232H: 12 MBd).
const POSSIBLE: RangeInclusive<u32> = 50..=12_000_000;

/// How often a port that is gone is looked for.
const LOOKING: Duration = Duration::from_millis(200);

/// What can be expected of a port.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Terms {
    /// It puts marks among the characters.
    is_marked: bool,
    /// What a mark covers.
    parity: ParityMarks,
    /// ± of a stamp against others.
    uncertainty: Duration,
    /// What ended longer ago was read.
    longest_wait: Duration,
}

/// Opens it.
///
/// # Errors
/// It cannot be listened to.
pub fn open(path: &str, options: &SourceOptions) -> Result<Box<dyn Tap>, SourceError> {
    Ok(Box::new(Serial::open(path, options)?))
}

/// What is said of a path that [`makes_terminals`].
pub const NO_PORT: &str = "this is no serial port: each who opens it is given a new terminal, with \
                           nobody at the other side";

/// Whether a path is the device that makes pseudo terminals, by its number (Linux,
/// `devices.txt`: 5, 2). It takes all settings, as a port does.
#[cfg(target_os = "linux")]
pub fn makes_terminals(path: &Path) -> bool {
    use std::os::unix::fs::{FileTypeExt, MetadataExt};
    std::fs::metadata(path)
        .is_ok_and(|of| of.file_type().is_char_device() && of.rdev() == rustix::fs::makedev(5, 2))
}

/// Whether a path is the device that makes pseudo terminals.
#[cfg(not(target_os = "linux"))]
pub fn makes_terminals(path: &Path) -> bool {
    path == Path::new("/dev/ptmx")
}

/// A serial port that is listened to.
struct Serial {
    /// As the user named it.
    name: String,
    path: PathBuf,
    bus: String,
    baud: Baud,
    format: Format,
    may_reconnect: bool,
    /// `None` while it is gone.
    port: Option<Port>,
    hearing: Hearing,
    /// The rate is not known yet.
    seek: Option<Seek>,
    is_announced: bool,
    has_warned_of_strays: bool,
    tally: Tally,
    /// When counters, or the port, were looked for.
    looked: Instant,
    buffer: Vec<u8>,
}

/// The short name of a port: that of its device, where the path is a link to it (such as those in
/// /dev/serial/by-id). Devices have no two alike, as links in different folders may have.
fn bus_name(path: &str) -> String {
    let device = std::fs::canonicalize(path).ok();
    let device = device.as_deref().and_then(|it| it.strip_prefix("/dev").ok());
    let is_direct = path.strip_prefix("/dev/").filter(|name| !name.starts_with("serial/"));
    match (is_direct, device) {
        (None, Some(device)) => device.to_string_lossy().into_owned(),
        (direct, _) => direct.unwrap_or(path).to_owned(),
    }
}

impl Serial {
    fn open(path: &str, options: &SourceOptions) -> Result<Serial, SourceError> {
        let name = format!("serial:{path}");
        let bus = bus_name(path);
        options.choose_only(&bus, &name)?;
        let format = options.frame.unwrap_or(Format::FT12);
        let fail = |what: String| SourceError::new(&name, Place::Whole, what);
        if format.data_bits() > 8 {
            return Err(fail(format!("no serial port receives {format}: 8 data bits at most")));
        }
        let (baud, seek) = match options.baud {
            Some(baud) => (baud, None),
            None => (RATES[0], Some(Seek::new(Instant::now()))),
        };
        if let Some(baud) = options.baud.filter(|baud| !POSSIBLE.contains(&baud.get())) {
            let (least, most) = (POSSIBLE.start(), POSSIBLE.end());
            return Err(fail(format!(
                "no serial port has {baud} Bd: they have {least} to {most} Bd"
            )));
        }
        let path = PathBuf::from(path);
        if makes_terminals(&path) {
            return Err(fail(NO_PORT.to_owned()));
        }
        let port = Port::open(&path, baud, format).map_err(fail)?;
        Ok(Serial {
            bus,
            baud,
            format,
            may_reconnect: options.live.reconnect,
            hearing: Hearing::new(port.terms(), baud, format),
            seek,
            is_announced: false,
            has_warned_of_strays: false,
            tally: Tally::begin(port.counters()),
            looked: Instant::now(),
            buffer: vec![0; QUEUE],
            port: Some(port),
            path,
            name,
        })
    }

    fn warn(&self, what: impl Into<String>, out: &mut Outbox) {
        out.warning(SourceError::new(&self.name, Place::Whole, what));
    }

    fn note(&self, what: &str, out: &mut Outbox) {
        out.note(&format!("{}: {what}", self.name));
    }

    /// Says what the port is worth.
    fn introduce(&self, out: &mut Outbox) {
        let Some(port) = &self.port else { return };
        let uncertainty = port.terms().uncertainty.as_secs_f64() * 1_000.0;
        let stamps = format!("stamps ±{uncertainty:.1} ms, taken when a read returns");
        self.note(&format!("{}; {stamps}", port.description()), out);
        port.doubt().into_iter().for_each(|what| self.note(&what, out));
        port.warnings().into_iter().for_each(|what| self.warn(what, out));
    }

    /// The bus appears, at the rate that is set.
    fn announce(&self, out: &mut Outbox) {
        let parity = self.port.as_ref().map_or(ParityMarks::None, |port| port.terms().parity);
        let info = BusInfo::new(&self.bus, Some(Clock::Read)).with_parity(parity);
        let (baud, format) = (Some(self.baud), Some(self.format));
        let medium = Some(Medium::Serial);
        out.bus(info, WireFacts { baud, format, medium, ..WireFacts::default() });
    }

    /// Says what there is to say before anything is heard.
    fn begin(&mut self, out: &mut Outbox) {
        self.introduce(out);
        match self.seek.take() {
            None => self.announce(out),
            Some(mut seek) => {
                let rates = RATES.map(|rate| rate.to_string()).join(", ");
                let window = seek::WINDOW.as_secs();
                self.note(
                    &format!("looking for the rate: {rates} Bd, {window} s each at most"),
                    out,
                );
                self.announce(seek.outbox());
                self.seek = Some(seek);
            }
        }
    }

    /// Hears what there is, or waits for it.
    fn listen(&mut self, patience: Duration, out: &mut Outbox) -> Result<(), io::Error> {
        let Some(port) = &mut self.port else { return Ok(()) };
        let (count, now) = fetch(port, &mut self.buffer, patience)?;
        let is_due = count > 0 || self.looked.elapsed() >= COUNTING;
        if is_due && self.tally.counts() {
            let news = self.tally.advance(port.counters());
            self.looked = Instant::now();
            self.hearing.hear(&self.buffer[..count], now, &news, out);
        } else if count > 0 {
            self.hearing.hear(&self.buffer[..count], now, &Default::default(), out);
        }
        if count >= THROTTLED && !self.tally.counts() {
            self.hearing.lose_what_nobody_counts(out);
        }
        if count == 0 {
            out.silence(0, self.hearing.silence(now));
        } else if self.hearing.has_strayed() && !self.has_warned_of_strays {
            self.has_warned_of_strays = true;
            self.warn(
                "FFh is followed by neither FFh nor 00h: the port does not mark errors as asked, \
                 and parity is not to be relied on",
                out,
            );
        }
        Ok(())
    }

    /// Listens while the rate is looked for.
    fn look_for_rate(&mut self, mut seek: Seek, out: &mut Outbox) -> Result<(), io::Error> {
        let listened = self.listen(PATIENCE, seek.outbox());
        if listened.is_err() {
            self.settle(seek, out);
            return listened;
        }
        let mut step = seek.look(Instant::now(), self.format);
        while let Step::Next(baud) = step {
            step = match self.set_baud(baud) {
                Ok(()) => {
                    seek.begin(baud, Instant::now());
                    self.announce(seek.outbox());
                    Step::GoOn
                }
                Err(what) => {
                    seek.refuse(baud, what);
                    seek.next()
                }
            };
        }
        match step {
            Step::Settle => self.settle(seek, out),
            _ => self.seek = Some(seek),
        }
        Ok(())
    }

    fn set_baud(&mut self, baud: Baud) -> Result<(), String> {
        let Some(port) = &mut self.port else { return Ok(()) };
        port.set_baud(baud)?;
        self.baud = baud;
        self.hearing = Hearing::new(port.terms(), baud, self.format);
        Ok(())
    }

    /// Goes on at the rate that fits best, with what was heard at it.
    fn settle(&mut self, seek: Seek, out: &mut Outbox) {
        let settled = seek.settle(self.format);
        let (baud, is_last) = (settled.baud, settled.baud == self.baud);
        *out = settled.heard;
        self.note(&settled.told, out);
        settled.warning.into_iter().for_each(|what| self.warn(what, out));
        if is_last {
            return;
        }
        if let Err(what) = self.set_baud(baud) {
            // It is what the bus was announced with, and what is set when the port comes back.
            self.baud = baud;
            self.warn(what, out);
        }
        if settled.was_heard {
            let start = Moment::from_ns(now());
            let elsewhere = settled.since.elapsed().saturating_sub(seek::WINDOW);
            let ns = i64::try_from(elsewhere.as_nanos()).unwrap_or(i64::MAX);
            out.lost(0, Loss { start, count: None, cause: LossCause::Sought(ns) });
        }
    }

    /// The port is gone.
    fn vanish(&mut self, cause: io::Error, out: &mut Outbox) -> Result<bool, SourceError> {
        self.port = None;
        // What the adapter still had went with it.
        let start = self.hearing.silence(now());
        if self.may_reconnect {
            self.warn("the port is gone: waiting for it to come back", out);
            out.lost(0, Loss { start, count: None, cause: LossCause::Deaf });
            return Ok(true);
        }
        self.note(&self.tally.to_string(), out);
        out.end(0, start);
        let what = "the port is gone: was the adapter unplugged? --reconnect waits for it";
        Err(SourceError { cause: Some(cause), ..SourceError::new(&self.name, Place::Whole, what) })
    }

    /// Looks now and then whether the port is back.
    fn wait(&mut self, out: &mut Outbox) {
        thread::sleep(PATIENCE);
        if self.looked.elapsed() < LOOKING {
            return;
        }
        self.looked = Instant::now();
        // It may be there before it can be used: until then it is gone.
        if let Ok(port) = Port::open(&self.path, self.baud, self.format) {
            self.hearing = Hearing::new(port.terms(), self.baud, self.format);
            self.tally.go_on(port.counters());
            self.port = Some(port);
            self.note("the port is back", out);
            self.introduce(out);
        }
    }
}

impl Reader for Serial {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        if !std::mem::replace(&mut self.is_announced, true) {
            self.begin(out);
            return Ok(true);
        }
        if self.port.is_none() {
            self.wait(out);
            return Ok(true);
        }
        let listened = match self.seek.take() {
            Some(seek) => self.look_for_rate(seek, out),
            None => self.listen(PATIENCE, out),
        };
        match listened {
            Ok(()) => Ok(true),
            Err(cause) => self.vanish(cause, out),
        }
    }
}

impl Tap for Serial {
    fn end(&mut self, out: &mut Outbox) {
        if let Some(seek) = self.seek.take() {
            self.settle(seek, out);
        }
        // What came while somebody listened, and was not read. A port that is gone has none.
        let _ = self.listen(Duration::ZERO, out);
        let now = now();
        if let Some(port) = self.port.take() {
            let news = self.tally.advance(port.counters());
            self.hearing.hear(&[], now, &news, out);
        }
        self.note(&self.tally.to_string(), out);
        out.end(0, self.hearing.silence(now));
    }

    /// Its characters tell: they come without times, or are so many that the driver held back.
    fn was_kept(&mut self, _: Moment, _: &mut Outbox) {}
}

/// Reads all that waits, and tells how many bytes it is and when the last of them had come. What is
/// read in parts is one piece for who places it: this program may have been stopped for long.
fn fetch(port: &mut Port, buffer: &mut [u8], patience: Duration) -> io::Result<(usize, i64)> {
    let mut count = port.read(buffer, patience)?;
    let mut at = now();
    // It may have been stopped since the wait was over, too: nothing is what is seen from now.
    while count < buffer.len() {
        match port.read(&mut buffer[count..], Duration::ZERO) {
            Ok(0) => break,
            Ok(more) => count += more,
            Err(error) if count == 0 => return Err(error),
            // It comes again once what was read is heard.
            Err(_) => break,
        }
        at = now();
    }
    Ok((count, at))
}

/// Nanoseconds since the Unix epoch.
fn now() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
