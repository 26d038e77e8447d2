//! What is known of the drivers of serial ports, from their source.

use super::rate::Divider;
use super::tree;
use dissectors::uart::ParityMarks;
use serde::Serialize;
use std::path::Path;

/// Which characters a driver marks where one has a parity error.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "kebab-case")]
pub enum Granularity {
    /// That one.
    Character,
    /// All that came in the same USB packet, at 115200 Bd up to 62.
    Packet,
    /// None: errors are at most counted.
    Never,
    /// None: the port has no parity at all.
    None,
    /// Nothing is known of this driver.
    Unknown,
}

/// Whether the driver counts parity, framing and overrun errors where a program can ask.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "kebab-case")]
pub enum Counters {
    /// It does.
    Available,
    /// It does not.
    Missing,
    /// Only the opened port tells.
    Unknown,
}

/// What is known of a driver.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Driver {
    /// Which characters it marks.
    pub granularity: Granularity,
    /// Whether it counts errors.
    pub counters: Counters,
}

/// The driver of the chips that [`UNPROVEN`] is about.
const OF_CP210X: &str = "cp210x";

/// What is to be known of a CP2102: "possibly counterfeit" ones have no event mode, which the driver
/// notices and tells in debug messages only (cp210x.c, cp2102_determine_quirks()).
pub const UNPROVEN: &str =
    "copies of the CP2102 mark no parity errors, and look like those that do";

/// How to find out: with the wrong parity set every character has an error.
pub const PROOF: &str = "to be sure, listen to the running bus with --frame 8O1 for a moment: a chip that marks errors \
     marks every character";

/// Drivers of 16550s that divide their clock as the first of them did.
const OF_8250: [&str; 5] = ["serial", "serial8250", "8250", "8250_pci", "of_serial"];

/// Drivers by their names in sysfs.
const DRIVERS: [(&[&str], Granularity, Counters); 9] = [
    // One status a USB packet, given to every character in it.
    (&["ftdi_sio"], Granularity::Packet, Counters::Available),
    // One status a URB. TIOCGICOUNT is not there (FreeRDP #2205).
    (&["pl2303", "f81232", "f81534a", "SPCP8x5"], Granularity::Packet, Counters::Missing),
    // In its event mode, which is on only while INPCK is set. Counts since Linux 5.9.
    (&[OF_CP210X], Granularity::Character, Counters::Available),
    // ch341 never marks.
    (&["ch341", "ch341-uart"], Granularity::Never, Counters::Unknown),
    // cdc-acm counts the notifications of the device, and marks nothing.
    (&["cdc_acm"], Granularity::Never, Counters::Available),
    // The Raspberry Pi's mini UART has no parity (BCM2835 ARM Peripherals, section 2.2).
    (&["bcm2835-aux-uart"], Granularity::None, Counters::Available),
    // 16550 and what is compatible, however it was found.
    (&OF_8250, Granularity::Character, Counters::Available),
    (&["exar_serial", "dw-apb-uart"], Granularity::Character, Counters::Available),
    (&["uart-pl011", "sbsa-uart"], Granularity::Character, Counters::Available),
];

impl Driver {
    /// The driver of that name.
    pub fn named(name: &str) -> Driver {
        let known = DRIVERS.iter().find(|(names, ..)| names.contains(&name));
        let (granularity, counters) =
            known.map_or((Granularity::Unknown, Counters::Unknown), |known| (known.1, known.2));
        Driver { granularity, counters }
    }

    /// What marks mean of characters heard through it, given that the port keeps the parity
    /// setting. Of a driver that is not known a mark is taken at its word.
    pub fn parity_marks(self) -> ParityMarks {
        match self.granularity {
            Granularity::Packet => ParityMarks::Packet,
            Granularity::Never | Granularity::None => ParityMarks::None,
            Granularity::Character | Granularity::Unknown => ParityMarks::Character,
        }
    }
}

/// Whether nobody knows if a chip of this driver does what the driver asks of it.
pub fn is_unproven(driver: &str) -> bool {
    driver == OF_CP210X
}

/// How a USB adapter makes its rate; `None` where that is not known. `bcd_device` is the release
/// number of the device, by which the chips of FTDI differ.
pub fn divider_of_usb(driver: &str, bcd_device: Option<u32>) -> Option<Divider> {
    match (driver, bcd_device?) {
        // ftdi_sio, ftdi_determine_type(): FT232B, FT2232C, FT232R and the X series divide 48 MHz.
        ("ftdi_sio", 0x0400 | 0x0500 | 0x0600 | 0x1000) => Some(Divider::Ftdi(3_000_000)),
        // FT2232H, FT4232H, FT232H divide 120 MHz.
        ("ftdi_sio", 0x0700 | 0x0800 | 0x0900) => Some(Divider::Ftdi(12_000_000)),
        ("ch341" | "ch341-uart", _) => Some(Divider::Ch341),
        _ => None,
    }
}

/// How a native port makes its rate; `None` where that is not known. `tty` is its folder among the
/// terminals, which has the clock of every native port.
pub fn divider_of_native(driver: &str, tty: &Path) -> Option<Divider> {
    /// Samples a bit, of all of them.
    const SAMPLES: u64 = 16;
    let clock = tree::number::<u64>(tty, "uartclk").filter(|clock| *clock >= SAMPLES)? / SAMPLES;
    match driver {
        // The mini UART takes 8 samples, and its driver states twice the clock.
        "bcm2835-aux-uart" => Some(Divider::Parts(clock, 1)),
        "uart-pl011" => Some(Divider::Parts(clock, 64)),
        driver if OF_8250.contains(&driver) => Some(Divider::Parts(clock, 1)),
        _ => None,
    }
}
