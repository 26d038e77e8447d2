//! What drives a port, as sysfs tells, and what that means for parity and times.

use crate::ports::Driver;
use dissectors::uart::ParityMarks;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What drives a port.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Adapter {
    /// Its folder in sysfs.
    folder: PathBuf,
    kind: Kind,
    /// The name of its driver, where sysfs tells.
    driver: Option<String>,
}

/// What characters come through.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    /// A pseudo terminal, which has neither line nor driver.
    Pseudo,
    /// USB, where they travel in packets.
    Usb,
    /// A receiver of the computer's own.
    Native,
    /// Nothing is known of it.
    Unknown,
}

/// Major numbers of the pseudo terminals' ports (Linux, admin-guide/devices.txt).
const PSEUDO: std::ops::RangeInclusive<u32> = 136..=143;

/// How long a USB adapter without a latency timer is taken to keep a character: two of the 1 ms
/// frames of full speed, as nothing tells more.
const USB_WAIT: Duration = Duration::from_millis(2);

/// Characters that a receiver keeps at most before it calls, where the driver does not tell: what
/// Linux sets a 16550A to.
const USUAL_TRIGGER: u32 = 8;

/// After so many characters of silence a 16550A calls, however few it has.
const FIFO_TIMEOUT: u32 = 4;

impl Adapter {
    /// The one behind a device node, by its numbers.
    pub fn of_device(major: u32, minor: u32) -> Adapter {
        let folder = PathBuf::from(format!("/sys/dev/char/{major}:{minor}"));
        match PSEUDO.contains(&major) {
            true => Adapter { folder, kind: Kind::Pseudo, driver: None },
            false => Adapter::at(folder),
        }
    }

    /// The one of this folder in sysfs.
    fn at(folder: PathBuf) -> Adapter {
        let Ok(device) = fs::canonicalize(folder.join("device")) else {
            return Adapter { folder, kind: Kind::Unknown, driver: None };
        };
        let is_usb = device.ancestors().any(|above| above.join("idVendor").exists());
        let kind = if is_usb { Kind::Usb } else { Kind::Native };
        let driver = device.ancestors().find_map(driver_of);
        Adapter { folder, kind, driver }
    }

    /// Its driver, for people.
    pub fn name(&self) -> &str {
        match (&self.driver, self.kind) {
            (Some(driver), _) => driver,
            (None, Kind::Pseudo) => "pseudo terminal",
            (None, _) => "unknown driver",
        }
    }

    /// Whether it is a pseudo terminal: nothing was heard at a wrong rate there.
    pub fn is_pseudo(&self) -> bool {
        self.kind == Kind::Pseudo
    }

    /// What it marks when it sees a parity error, given that the port keeps the parity setting.
    pub fn parity_marks(&self) -> ParityMarks {
        Driver::named(self.driver.as_deref().unwrap_or_default()).parity_marks()
    }

    /// The latency timer of an FTDI adapter.
    pub fn latency_timer(&self) -> Option<Duration> {
        self.number("device/latency_timer").map(|ms| Duration::from_millis(u64::from(ms)))
    }

    /// Sets the latency timer to its shortest. It may be refused: it is to be read back.
    pub fn shorten_latency_timer(&self) {
        // Who may not is told what the timer is.
        let _ = fs::write(self.folder.join("device/latency_timer"), "1");
    }

    /// How long it may keep a character that came before it hands it over.
    pub fn wait(&self, character: Duration) -> Duration {
        let fifo = || {
            let trigger = self.number("rx_trig_bytes").unwrap_or(USUAL_TRIGGER);
            character * trigger.max(FIFO_TIMEOUT)
        };
        match (self.latency_timer(), self.kind) {
            (Some(timer), _) => timer,
            (None, Kind::Pseudo) => Duration::ZERO,
            (None, Kind::Usb) => USB_WAIT,
            (None, Kind::Native) => fifo(),
            (None, Kind::Unknown) => fifo().max(USB_WAIT),
        }
    }

    fn number(&self, file: &str) -> Option<u32> {
        let text = fs::read_to_string(self.folder.join(file)).ok()?;
        text.trim().parse().ok()
    }
}

/// The driver of a device in sysfs. Those of the serial core, since Linux 6.5 between a port and its
/// device, drive nothing.
fn driver_of(device: &Path) -> Option<String> {
    let name = |link: &str| {
        let target = fs::read_link(device.join(link)).ok()?;
        Some(target.file_name()?.to_str()?.to_owned())
    };
    name("driver").filter(|_| name("subsystem").as_deref() != Some("serial-base"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;
    use tempfile::TempDir;

    /// A port as sysfs shows it: its folder, and that of a device with these files.
    fn port(driver: &str, files: &[(&str, &str)], is_usb: bool) -> (TempDir, Adapter) {
        let root = tempfile::tempdir().unwrap();
        let device = root.path().join("usb1/1-1/ttyX0");
        fs::create_dir_all(&device).unwrap();
        symlink(Path::new("../../../bus/drivers").join(driver), device.join("driver")).unwrap();
        if is_usb {
            fs::write(root.path().join("usb1/1-1/idVendor"), "0403\n").unwrap();
        }
        let folder = root.path().join("tty");
        fs::create_dir(&folder).unwrap();
        symlink(&device, folder.join("device")).unwrap();
        for (name, content) in files {
            fs::write(folder.join(name), content).unwrap();
        }
        let adapter = Adapter::at(folder);
        (root, adapter)
    }

    #[test]
    fn an_ftdi_adapter_marks_packets_and_keeps_characters_for_its_timer() {
        let (_root, adapter) = port("ftdi_sio", &[("device/latency_timer", "16\n")], true);
        assert_eq!(adapter.parity_marks(), ParityMarks::Packet);
        assert_eq!(adapter.wait(Duration::from_micros(95)), Duration::from_millis(16));
        adapter.shorten_latency_timer();
        assert_eq!(adapter.latency_timer(), Some(Duration::from_millis(1)));
    }

    #[test]
    fn a_native_port_keeps_what_its_fifo_holds() {
        // 4 characters of 100 µs where it calls for every one: the time-out of the FIFO.
        let character = Duration::from_micros(100);
        let (_root, adapter) = port("serial8250", &[("rx_trig_bytes", "1\n")], false);
        assert_eq!(adapter.parity_marks(), ParityMarks::Character);
        assert_eq!(adapter.wait(character), Duration::from_micros(400));
        let (_root, adapter) = port("uart-pl011", &[], false);
        assert_eq!(adapter.wait(character), Duration::from_micros(800));
    }

    #[test]
    fn some_drivers_never_mark() {
        for driver in ["cdc_acm", "ch341-uart"] {
            let (_root, adapter) = port(driver, &[], true);
            assert_eq!(adapter.parity_marks(), ParityMarks::None, "{driver}");
            assert_eq!(adapter.wait(Duration::ZERO), Duration::from_millis(2));
        }
    }

    #[test]
    fn what_the_serial_core_puts_between_is_no_driver() {
        // As Linux 6.5 and later show ttyS0.
        let root = tempfile::tempdir().unwrap();
        let core = root.path().join("pnp0/00:00/00:00:0/00:00:0.0");
        fs::create_dir_all(&core).unwrap();
        let link = |at: &Path, name: &str, to: &str| symlink(to, at.join(name)).unwrap();
        link(&core, "driver", "../bus/serial-base/drivers/port");
        link(&core, "subsystem", "../bus/serial-base");
        let device = root.path().join("pnp0/00:00");
        link(&device, "driver", "../bus/pnp/drivers/serial");
        link(&device, "subsystem", "../bus/pnp");
        let folder = root.path().join("tty");
        fs::create_dir(&folder).unwrap();
        symlink(&core, folder.join("device")).unwrap();
        assert_eq!(Adapter::at(folder).name(), "serial");
    }

    #[test]
    fn a_pseudo_terminal_keeps_nothing_and_of_the_unknown_little_is_believed() {
        let pseudo = Adapter::of_device(136, 7);
        assert_eq!((pseudo.name(), pseudo.latency_timer()), ("pseudo terminal", None));
        assert_eq!(pseudo.wait(Duration::from_secs(1)), Duration::ZERO);
        let unknown = Adapter::at(PathBuf::from("/nowhere"));
        assert_eq!(unknown.name(), "unknown driver");
        assert_eq!(unknown.wait(Duration::from_micros(100)), Duration::from_millis(2));
    }
}
