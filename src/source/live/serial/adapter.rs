//! What drives a port, as sysfs tells, and what that means for parity and times.

use dissectors::uart::ParityMarks;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What drives a port.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Adapter {
    /// Its folder in sysfs; `None` for a pseudo terminal, which nothing drives.
    folder: Option<PathBuf>,
    /// The name of its driver, where sysfs tells.
    pub driver: Option<String>,
    /// It hangs on USB, where characters travel in packets.
    is_usb: bool,
}

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
        Adapter::at(Path::new(&format!("/sys/dev/char/{major}:{minor}")))
    }

    /// The one of this folder in sysfs.
    fn at(folder: &Path) -> Adapter {
        let device = fs::canonicalize(folder.join("device")).ok();
        let driver = device.as_ref().and_then(|device| {
            let link = fs::read_link(device.join("driver")).ok()?;
            Some(link.file_name()?.to_str()?.to_owned())
        });
        let is_usb = device
            .is_some_and(|device| device.ancestors().any(|above| above.join("idVendor").exists()));
        Adapter { folder: folder.exists().then(|| folder.to_owned()), driver, is_usb }
    }

    /// What it marks when it sees a parity error, given that the port keeps the parity setting.
    pub fn parity_marks(&self) -> ParityMarks {
        match self.driver.as_deref() {
            // One status for every packet or URB, applied to all characters in it.
            Some("ftdi_sio" | "pl2303" | "f81232" | "SPCP8x5" | "spcp8x5") => ParityMarks::Packet,
            // The one only counts, the other never looks.
            Some("cdc_acm" | "ch341" | "ch341-uart") => ParityMarks::None,
            _ => ParityMarks::Character,
        }
    }

    /// The latency timer of an FTDI adapter.
    pub fn latency_timer(&self) -> Option<Duration> {
        self.number("device/latency_timer").map(|ms| Duration::from_millis(u64::from(ms)))
    }

    /// Sets the latency timer to its shortest. It may be refused: it is to be read back.
    pub fn shorten_latency_timer(&self) {
        if let Some(folder) = &self.folder {
            // Who may not is told what the timer is.
            let _ = fs::write(folder.join("device/latency_timer"), "1");
        }
    }

    /// How long it may keep a character that came before it hands it over.
    pub fn wait(&self, character: Duration) -> Duration {
        if let Some(timer) = self.latency_timer() {
            timer
        } else if self.is_usb {
            USB_WAIT
        } else if self.driver.is_some() {
            let trigger = self.number("rx_trig_bytes").unwrap_or(USUAL_TRIGGER);
            character * trigger.max(FIFO_TIMEOUT)
        } else {
            Duration::ZERO
        }
    }

    fn number(&self, file: &str) -> Option<u32> {
        let text = fs::read_to_string(self.folder.as_ref()?.join(file)).ok()?;
        text.trim().parse().ok()
    }
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
        let adapter = Adapter::at(&folder);
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
    fn nothing_drives_a_pseudo_terminal() {
        let adapter = Adapter::at(Path::new("/nowhere"));
        assert_eq!((adapter.driver.as_deref(), adapter.latency_timer()), (None, None));
        assert_eq!(adapter.wait(Duration::from_secs(1)), Duration::ZERO);
    }
}
