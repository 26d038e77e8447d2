//! Two adapters, as far as Linux's drivers ask them.

use super::usbip::{Device, Identity, Plug, Setup};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

/// What was the matter with a character: as a 16550's line status has it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Line {
    Good,
    Overrun = 0x02,
    Parity = 0x04,
    Framing = 0x08,
    Break = 0x10,
}

/// Modem lines that were set: request to send and data terminal ready.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Lines {
    pub rts: bool,
    pub dtr: bool,
}

/// Plugs it in, and waits for its port.
pub fn plug<D: Device + 'static>(place: u32, device: D) -> Plug<D> {
    let plug = Plug::into(place, device);
    let begin = Instant::now();
    while !Path::new(PORT).exists() {
        assert!(begin.elapsed() < super::tap::PATIENCE, "{PORT} does not appear");
        thread::sleep(Duration::from_millis(50));
    }
    plug
}

/// The port of the only adapter that is plugged in.
pub const PORT: &str = "/dev/ttyUSB0";

/// An FT232R (the driver knows it by its release): two bytes of status precede each packet, and its
/// errors are those of any character in it (`ftdi_sio.h`).
#[derive(Default)]
pub struct Ftdi {
    pub latency: u8,
    pub lines: Lines,
    /// The rate's divisor, as it was set last.
    pub divisor: u16,
    /// Characters and parity, as they were set last.
    pub format: u16,
}

impl Ftdi {
    /// With its timer at what it is when it is plugged in, in ms.
    pub fn new() -> Self {
        Ftdi { latency: 16, ..Ftdi::default() }
    }
}

impl Plug<Ftdi> {
    /// It received these characters in a packet.
    pub fn hear(&self, line: Line, characters: &[u8]) {
        const MODEM: u8 = 0x01;
        const TRANSMITTER_EMPTY: u8 = 0x60;
        let status = [MODEM, TRANSMITTER_EMPTY | line as u8];
        self.receive(&[&status, characters].concat());
    }
}

impl Device for Ftdi {
    fn identity(&self) -> Identity {
        Identity { vendor: 0x0403, product: 0x6001, release: 0x0600, name: "FT232R" }
    }

    fn ask(&mut self, setup: Setup) -> Option<Vec<u8>> {
        const MODEM_STATUS: u8 = 5;
        const LATENCY: u8 = 10;
        Some(match setup.request {
            MODEM_STATUS => vec![0x01, 0x60],
            LATENCY => vec![self.latency],
            // Its memory, which nobody wrote.
            _ => vec![0xFF; setup.length.into()],
        })
    }

    fn tell(&mut self, setup: Setup, _: &[u8]) {
        const MODEM: u8 = 1;
        const BAUD: u8 = 3;
        const FORMAT: u8 = 4;
        const LATENCY: u8 = 9;
        match setup.request {
            MODEM => {
                let [set, which] = setup.value.to_le_bytes();
                self.lines.dtr = if which & 1 != 0 { set & 1 != 0 } else { self.lines.dtr };
                self.lines.rts = if which & 2 != 0 { set & 2 != 0 } else { self.lines.rts };
            }
            BAUD => self.divisor = setup.value,
            FORMAT => self.format = setup.value,
            LATENCY => self.latency = setup.value.to_le_bytes()[0],
            _ => {}
        }
    }
}

/// A CP2102: it can tell the status of each character, in sequences that an escape begins
/// (application note AN571, "embedded events"), as Linux's driver has it do while it is to look for
/// errors (`cp210x.c`).
#[derive(Default)]
pub struct Cp210x {
    pub lines: Lines,
    pub baud: u32,
    /// Data bits, parity, stop bits: a nibble each, the first one above.
    pub format: u16,
    /// The escape of events; 0 while there are none.
    pub escape: u8,
    flow: Vec<u8>,
}

impl Cp210x {
    pub fn new() -> Self {
        Cp210x { format: 0x0800, flow: vec![0; 16], ..Cp210x::default() }
    }
}

impl Plug<Cp210x> {
    /// It received these characters in a packet.
    pub fn hear(&self, characters: &[(Line, u8)]) {
        const STATUS_AND_DATA: u8 = 1;
        const ITSELF: u8 = 0;
        let escape = self.look(|device| device.escape);
        let mut packet = Vec::new();
        for (line, byte) in characters {
            match line {
                Line::Good if *byte == escape && escape != 0 => packet.extend([escape, ITSELF]),
                Line::Good => packet.push(*byte),
                _ if escape == 0 => packet.push(*byte),
                line => packet.extend([escape, STATUS_AND_DATA, *line as u8, *byte]),
            }
        }
        self.receive(&packet);
    }
}

impl Device for Cp210x {
    fn identity(&self) -> Identity {
        Identity { vendor: 0x10C4, product: 0xEA60, release: 0x0100, name: "CP2102" }
    }

    fn ask(&mut self, setup: Setup) -> Option<Vec<u8>> {
        const FORMAT: u8 = 0x04;
        const MODEM_STATUS: u8 = 0x08;
        const COMM_STATUS: u8 = 0x10;
        const FLOW: u8 = 0x14;
        const BAUD: u8 = 0x1D;
        const VENDOR: u8 = 0xFF;
        const PART_NUMBER: u16 = 0x370B;
        Some(match (setup.request, setup.value) {
            (FORMAT, _) => self.format.to_le_bytes().to_vec(),
            (MODEM_STATUS, _) => vec![u8::from(self.lines.dtr) | u8::from(self.lines.rts) << 1],
            (COMM_STATUS, _) => vec![0; 19],
            (FLOW, _) => self.flow.clone(),
            (BAUD, _) => self.baud.to_le_bytes().to_vec(),
            // Asked for two bytes, counterfeits answer with one: the driver knows them by that, and
            // does without events.
            (VENDOR, PART_NUMBER) => vec![0x02, 0],
            _ => return None,
        })
    }

    fn tell(&mut self, setup: Setup, data: &[u8]) {
        const FORMAT: u8 = 0x03;
        const MODEM: u8 = 0x07;
        const FLOW: u8 = 0x13;
        const EVENTS: u8 = 0x15;
        const BAUD: u8 = 0x1E;
        match setup.request {
            FORMAT => self.format = setup.value,
            MODEM => {
                let [set, which] = setup.value.to_le_bytes();
                self.lines.dtr = if which & 1 != 0 { set & 1 != 0 } else { self.lines.dtr };
                self.lines.rts = if which & 2 != 0 { set & 2 != 0 } else { self.lines.rts };
            }
            FLOW => self.flow = data.to_vec(),
            EVENTS => self.escape = setup.value.to_le_bytes()[0],
            BAUD => self.baud = data.first_chunk().map_or(0, |rate| u32::from_le_bytes(*rate)),
            _ => {}
        }
    }
}
