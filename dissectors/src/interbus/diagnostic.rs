//! What masters and couplers report of a ring: diagnostic registers, and a byte for each slave.

use crate::field::{List, Value};
use core::fmt;
use nom::combinator::opt;
use nom::number::complete::be_u16;
use nom::{IResult, Parser};

/// The generation of a master, which its registers and messages depend on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Generation {
    /// The third.
    Three,
    /// The fourth, whose registers are published bit by bit.
    Four,
}

/// The bits of a register that are set, by name; lowest bit first.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Flags {
    names: [&'static str; 16],
    count: usize,
}

impl Flags {
    /// The names of the bits that are set in a register; bits without a name are left out.
    #[must_use]
    pub fn of(register: u16, bits: &[&'static str]) -> Self {
        let mut flags = Flags { names: [""; 16], count: 0 };
        let is_set = |bit: &(usize, &&'static str)| register >> bit.0 & 1 != 0;
        for (free, (_, name)) in
            flags.names.iter_mut().zip(bits.iter().enumerate().take(16).filter(is_set))
        {
            *free = name;
            flags.count += 1;
        }
        flags
    }

    /// The names.
    #[must_use]
    pub fn names(&self) -> &[&'static str] {
        &self.names[..self.count.min(16)]
    }

    /// What they tell of trouble on the line: a bit for each.
    #[must_use]
    pub fn line_trouble(&self) -> u8 {
        let bits = LINE.iter().enumerate().filter(|(_, name)| self.has(name));
        bits.fold(0, |bits, (place, _)| bits | 1 << place)
    }

    /// Whether the bit of this name is set.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.names().contains(&name)
    }
}

impl List for Flags {
    fn len(&self) -> usize {
        self.names().len()
    }

    fn get(&self, index: usize) -> Value<'_> {
        self.names().get(index).copied().into()
    }
}

impl fmt::Display for Flags {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.names().is_empty() {
            return f.write_str("no bit set");
        }
        let mut separator = "";
        self.names().iter().try_for_each(|name| {
            let written = write!(f, "{separator}{name}");
            separator = " ";
            written
        })
    }
}

/// Bits 0 to 15 of the diagnostic status register of generation 4 (order: pierre-quelin/ibsdrv and
/// Phoenix Contact's AXL register; names and meanings: Phoenix Contact 5756B, KUKA Interbus 1.1).
const FOURTH: [&str; 16] = [
    "USER", "PF", "BUS", "CTRL", "DETECT", "RUN", "ACTIVE", "READY", "BSA", "SYSFAIL", "RESULT",
    "SYRESULT", "DCRESULT", "WARNING", "QUALITY", "SDSI",
];

/// What bits of either generation report, worst first. Those that only say what the master is doing
/// are not among them.
const MEANINGS: [(&str, &str); 13] = [
    ("CTRL", "controller error"),
    ("BUS", "bus error"),
    ("RB", "remote bus error"),
    ("LB", "local bus error"),
    ("USER", "operating error"),
    ("PF", "peripheral fault, the bus runs on"),
    ("MOD", "module error"),
    ("DETECT", "being located"),
    ("BSA", "a segment is switched off"),
    ("SYSFAIL", "system failure: outputs blocked"),
    ("BASP", "outputs blocked"),
    ("RESULT", "standard function failed"),
    ("QUALITY", "transmission quality not reached"),
];

/// Bits of the diagnostic register of generation 3, by name (PN5003B p. 4-23).
pub const THIRD: [&str; 8] = ["MOD", "LB", "RB", "CTRL", "BSA", "RUN", "BASP", "READY"];

/// Bits of either generation, and of slaves, that tell of trouble on the line: transmission. Not
/// among them are errors of the master itself (CTRL), of its host (SYSFAIL, USER) and of what hangs
/// on a device (PF, MOD): no cable cures those.
const LINE: [&str; 6] = ["BUS", "RB", "LB", "QUALITY", "W2Err", "W1Err"];

/// Which bit of the register of generation 3 is which: its positions are not published, so that the
/// user may say them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Order {
    names: [&'static str; 8],
    /// Whether the user said so.
    is_known: bool,
}

impl Default for Order {
    fn default() -> Self {
        Order { names: THIRD, is_known: false }
    }
}

impl Order {
    /// Reads all eight names, from bit 0 on, with commas between them. `None` where one is missing
    /// or unknown.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let mut names = [""; 8];
        let mut parts = text.split(',').map(str::trim);
        for free in &mut names {
            let part = parts.next()?;
            *free = THIRD.into_iter().find(|name| name.eq_ignore_ascii_case(part))?;
        }
        let has_all = THIRD.iter().all(|name| names.contains(name));
        (has_all && parts.next().is_none()).then_some(Order { names, is_known: true })
    }
}

/// The diagnostic registers of a master.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Registers {
    /// The status register.
    pub status: u16,
    /// The parameter register, where it was logged.
    pub parameter: Option<u16>,
}

/// Registers: two bytes of status and perhaps two of the parameter.
///
/// # Errors
/// There are fewer than two bytes.
pub fn registers(input: &[u8]) -> IResult<&[u8], Registers> {
    (be_u16, opt(be_u16)).map(|(status, parameter)| Registers { status, parameter }).parse(input)
}

impl Order {
    /// Whether it is certain.
    #[must_use]
    pub const fn is_known(&self) -> bool {
        self.is_known
    }
}

/// What a parameter register holds (Phoenix Contact ILC 170 p. 4-3, AXC F p. 79).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Parameter {
    /// An error code.
    Code(u16),
    /// A device: its segment, and its place there.
    Place {
        /// The segment.
        segment: u8,
        /// The device in it; `None` where it could not be found.
        device: Option<u8>,
    },
    /// A code or a place: the status does not tell which.
    Either(u16),
}

impl Registers {
    /// The status bits that are set.
    #[must_use]
    pub fn flags(&self, generation: Generation, third: &Order) -> Flags {
        match generation {
            Generation::Four => Flags::of(self.status, &FOURTH),
            Generation::Three => Flags::of(self.status, &third.names),
        }
    }

    /// What the parameter says. A peripheral fault is at a device; the master's and the user's
    /// errors have a code; a bus error has either.
    #[must_use]
    pub fn parameter(&self, generation: Generation) -> Option<Parameter> {
        let (word, flags) = (self.parameter?, Flags::of(self.status, &FOURTH));
        let (has_code, has_place) = (flags.has("USER") || flags.has("CTRL"), flags.has("PF"));
        let is_sure = generation == Generation::Four && !flags.has("BUS");
        match (has_code, has_place) {
            _ if word == 0 => None,
            (true, false) if is_sure => Some(Parameter::Code(word)),
            (false, true) if is_sure => Some(Parameter::place(word)),
            _ => Some(Parameter::Either(word)),
        }
    }

    /// Writes what they say.
    ///
    /// # Errors
    /// Only where `out` fails.
    pub fn say(
        &self,
        generation: Generation,
        third: &Order,
        out: &mut dyn fmt::Write,
    ) -> fmt::Result {
        let flags = self.flags(generation, third);
        let mut separator = "";
        for (_, meaning) in MEANINGS.iter().filter(|(name, _)| flags.has(name)) {
            write!(out, "{separator}{meaning}")?;
            separator = ", ";
        }
        if separator.is_empty() {
            out.write_str(if flags.has("RUN") { "the ring runs" } else { "no fault" })?;
        }
        if let Some(parameter) = self.parameter(generation) {
            write!(out, "; {parameter}")?;
        }
        let doubt = match generation {
            Generation::Three if !third.is_known => "; order of bits assumed",
            _ => "",
        };
        write!(out, " ({flags}{doubt})")
    }
}

impl Parameter {
    /// A place: the segment in the high byte, the device in the low one, whose bit 7 says that it
    /// could not be found.
    #[must_use]
    pub const fn place(word: u16) -> Self {
        let [segment, device] = word.to_be_bytes();
        let device = if device & 0x80 == 0 { Some(device) } else { None };
        Parameter::Place { segment, device }
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Parameter::Code(0x0A50) => f.write_str("code 0A50h: I/O address assigned twice"),
            Parameter::Code(code) => write!(f, "code {code:04X}h"),
            Parameter::Place { segment, device: Some(device) } => {
                write!(f, "device {segment}.{device}")
            }
            Parameter::Place { segment, device: None } => {
                write!(f, "segment {segment}, device not found")
            }
            Parameter::Either(word) => {
                write!(f, "{}, or code {word:04X}h", Parameter::place(*word))
            }
        }
    }
}

/// Bits 0 to 5 of the byte that couplers keep of a slave (Beckhoff BK40x0, Hilscher).
const SLAVE: [&str; 6] = ["Rec", "Mod", "W2Err", "W1Err", "W2 inactive", "W1 inactive"];

const SLAVE_MEANINGS: [&str; 6] = [
    "reconfiguration requested",
    "module error",
    "error at interface W2",
    "error at interface W1",
    "interface W2 inactive",
    "interface W1 inactive",
];

/// The byte that a coupler keeps of a slave.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Slave(pub u8);

impl Slave {
    /// The bits that are set, by name.
    #[must_use]
    pub fn flags(self) -> Flags {
        Flags::of(self.0.into(), &SLAVE)
    }
}

impl fmt::Display for Slave {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 == 0 {
            return f.write_str("no error");
        }
        let mut separator = "";
        for meaning in Flags::of(self.0.into(), &SLAVE_MEANINGS).names() {
            write!(f, "{separator}{meaning}")?;
            separator = ", ";
        }
        match self.0 & 0xC0 {
            0 => Ok(()),
            unknown => write!(f, "{separator}unknown bits {unknown:02X}h"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::{String, ToString};

    fn said(generation: Generation, status: u16, parameter: Option<u16>) -> String {
        let mut text = String::new();
        Registers { status, parameter }.say(generation, &Order::default(), &mut text).unwrap();
        text
    }

    #[test]
    fn worked_registers_of_generation_4() {
        let said = |status, parameter| said(Generation::Four, status, parameter);
        assert_eq!(said(0x00E0, None), "the ring runs (RUN ACTIVE READY)");
        assert_eq!(
            said(0x00E2, Some(0x0301)),
            "peripheral fault, the bus runs on; device 3.1 (PF RUN ACTIVE READY)"
        );
        assert_eq!(said(0x00C4, None), "bus error (BUS ACTIVE READY)");
        assert_eq!(said(0x00D4, None), "bus error, being located (BUS DETECT ACTIVE READY)");
        assert_eq!(
            said(0x40E0, None),
            "transmission quality not reached (RUN ACTIVE READY QUALITY)"
        );
        assert_eq!(said(0, None), "no fault (no bit set)");
    }

    #[test]
    fn the_parameter_is_a_code_or_a_place() {
        let said = |status, parameter| said(Generation::Four, status, Some(parameter));
        assert!(said(0x00E1, 0x0A50).contains("; code 0A50h: I/O address assigned twice (USER "));
        assert!(said(0x00E2, 0x0380).contains("; segment 3, device not found (PF "));
        // A bus error has either.
        assert!(said(0x00C4, 0x0301).contains("; device 3.1, or code 0301h (BUS "));
        // CTRL is bit 3, not bit 0 as one driver has it.
        assert!(said(0x0008, 0x1234).contains("; code 1234h (CTRL)"));
        assert_eq!(said(0x00E0, 0), "the ring runs (RUN ACTIVE READY)");
    }

    #[test]
    fn the_order_of_generation_3_is_assumed_unless_it_is_said() {
        assert_eq!(
            said(Generation::Three, 0b1010_0100, None),
            "remote bus error (RB RUN READY; order of bits assumed)"
        );
        let order = Order::parse("ready,basp,run,bsa,ctrl,rb,lb,mod").unwrap();
        let mut text = String::new();
        let registers = Registers { status: 0b0010_0101, parameter: None };
        registers.say(Generation::Three, &order, &mut text).unwrap();
        assert_eq!(text, "remote bus error (READY RUN RB)");
        for wrong in ["", "mod", "mod,mod,rb,ctrl,bsa,run,basp,ready", "a,b,c,d,e,f,g,h"] {
            assert_eq!(Order::parse(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn trouble_on_the_line_is_that_of_transmission() {
        let of = |status| Flags::of(status, &FOURTH).line_trouble() != 0;
        // Bits 2 and 14: bus error, and transmission quality not reached.
        let telling = (0..16).filter(|bit| of(1 << bit));
        assert!(telling.eq([2, 14]));
        assert_eq!(
            Flags::of(0x00C4, &FOURTH).line_trouble(),
            Flags::of(0x00D4, &FOURTH).line_trouble()
        );
        let slaves = (0..8).filter(|bit| Slave(1 << bit).flags().line_trouble() != 0);
        assert!(slaves.eq([2, 3]), "W2Err and W1Err");
    }

    #[test]
    fn every_bit_of_a_slave() {
        let bits = [
            "reconfiguration requested",
            "module error",
            "error at interface W2",
            "error at interface W1",
            "interface W2 inactive",
            "interface W1 inactive",
            "unknown bits 40h",
            "unknown bits 80h",
        ];
        for (bit, expected) in bits.into_iter().enumerate() {
            assert_eq!(Slave(1 << bit).to_string(), expected);
        }
        assert_eq!(Slave(0).to_string(), "no error");
        assert_eq!(Slave(0x0A).to_string(), "module error, error at interface W1");
        assert_eq!(Slave(0x0A).flags().names(), ["Mod", "W1Err"]);
    }
}
