//! A small ring for tests: from a profile to the levels of its two wires. It shares nothing with
//! what is tested.
#![allow(dead_code, unused_imports)]

mod listener;
mod tape;

pub use listener::{Heard, hear, hear_wires, settings};
pub use tape::Recording;
use tape::Tape;

/// Numbers without a pattern (xorshift).
pub struct Chance(u64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        let mut chance = Chance(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        (0..8).for_each(|_| {
            chance.next();
        });
        chance
    }

    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11
    }

    pub fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }

    pub fn flip(&mut self) -> bool {
        self.below(2) == 1
    }

    pub fn pick<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len() as u64) as usize]
    }
}

/// A device of the ring.
#[derive(Clone, Debug)]
pub struct Device {
    pub id: u16,
    pub bits: usize,
}

/// Everything about a line.
#[derive(Clone, Debug)]
pub struct Plan {
    pub bitrate: u32,
    pub samples: f64,
    pub is_inverted: bool,
    /// Places of SL, CR and TYPE.
    pub places: [usize; 3],
    pub id_value: bool,
    pub check_value: bool,
    pub status_value: bool,
    /// Status telegrams carry SL too.
    pub status_has_select: bool,
    pub is_lsb: bool,
    pub lbw: u16,
    /// Its low nibble counts.
    pub counts: bool,
    pub refin: bool,
    pub refout: bool,
    pub init: u16,
    pub xorout: u16,
    pub is_low_first: bool,
    pub covers_lbw: bool,
    pub devices: Vec<Device>,
    pub control: u16,
    /// Largest pause between characters, and jitter of edges, in bits.
    pub pause: f64,
    pub jitter: f64,
    pub id_cycles: usize,
    pub is_standing: bool,
    /// Devices between the master and the tap.
    pub upstream: usize,
}

/// What goes wrong, and in which cycle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Fault {
    /// A bit of the data on a wire is another.
    Bit(usize),
    /// The stop bit of a character is none.
    Stop,
    /// A wire stops in the middle.
    Cut(usize),
    /// A character of a wire is lost.
    Lost(usize),
    /// A character too many on a wire.
    Extra(usize),
    /// The wire that comes back carries nothing.
    Missing,
    /// The control word is another.
    Control,
    /// The loopback word comes back as another.
    Loopback,
    /// Silence before it, in bits.
    Silence(f64),
    /// From here on the last device is gone.
    Shorter,
}

impl Plan {
    /// A plain one.
    pub fn plain() -> Self {
        Plan {
            bitrate: 500_000,
            samples: 8.0,
            is_inverted: false,
            places: [0, 1, 2],
            id_value: true,
            check_value: true,
            status_value: false,
            status_has_select: false,
            is_lsb: false,
            lbw: 0xB5E3,
            counts: false,
            refin: false,
            refout: false,
            init: 0xFFFF,
            xorout: 0,
            is_low_first: false,
            covers_lbw: true,
            devices: vec![
                Device { id: 0x0203, bits: 32 },
                Device { id: 0x0233, bits: 32 },
                Device { id: 0x0132, bits: 16 },
            ],
            control: 0,
            pause: 0.0,
            jitter: 0.0,
            id_cycles: 4,
            is_standing: false,
            upstream: 0,
        }
    }

    pub fn random(chance: &mut Chance) -> Self {
        const ORDERS: [[usize; 3]; 6] =
            [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let devices = (0..=chance.below(8)).map(|_| {
            let (code, bits) =
                chance.pick(&[(1, 16), (2, 32), (3, 48), (9, 8), (0x0B, 24), (4, 64)]);
            let ident = chance.pick(&[0x01, 0x02, 0x03, 0x31, 0x32, 0x33, 0x37]);
            Device { id: code << 8 | ident, bits }
        });
        let devices: Vec<Device> = devices.collect();
        let refin = chance.flip();
        Plan {
            devices,
            bitrate: chance.pick(&[500_000, 2_000_000]),
            samples: chance.pick(&[8.0, 9.3, 12.5, 16.0, 31.7]),
            is_inverted: chance.flip(),
            places: chance.pick(&ORDERS),
            id_value: chance.flip(),
            check_value: chance.flip(),
            status_value: chance.flip(),
            status_has_select: chance.flip(),
            is_lsb: chance.flip(),
            lbw: chance.next() as u16,
            counts: chance.flip(),
            refin,
            refout: if chance.below(4) == 0 { !refin } else { refin },
            init: chance.pick(&[0, 0xFFFF, 0x5A5A, 0x1D0F]),
            xorout: chance.pick(&[0, 0xFFFF, 0x0F0F]),
            is_low_first: chance.flip(),
            covers_lbw: chance.flip(),
            control: chance.pick(&[0, 0x8000, 0x1234]),
            pause: chance.pick(&[0.0, 0.7, 2.3]),
            jitter: chance.pick(&[0.0, 0.05]),
            id_cycles: 3 + chance.below(6) as usize,
            is_standing: false,
            upstream: 0,
        }
    }

    /// What is to be found out: the keys of the profile and their values. What the wire does not
    /// tell is left out: of equal profiles the default is told.
    pub fn truth(&self) -> Vec<(&'static str, String)> {
        let mut order = ["", "", ""];
        for (place, name) in self.places.into_iter().zip(["SL", "CR", "TYPE"]) {
            order[place] = name;
        }
        let digit = |value: bool| u8::from(value).to_string();
        let ring: Vec<String> =
            self.devices.iter().map(|it| format!("{}:{:04X}", it.bits, it.id)).collect();
        // The same bits as with bytes read from the end that is the default.
        vec![
            ("bitrate", self.bitrate.to_string()),
            ("idle_level", digit(!self.is_inverted)),
            ("flag_order", order.join(" ")),
            ("status_value", digit(self.status_value)),
            ("check_value", digit(self.check_value)),
            ("id_value", digit(self.id_value)),
            ("data_bit_order", if self.is_lsb { "lsb" } else { "msb" }.to_owned()),
            ("lbw_bit", self.upstream_bits().to_string()),
            ("lbw", format!("{:04X}", if self.counts { self.lbw & 0xFFF0 } else { self.lbw })),
            ("ring", ring.join(" ")),
            ("crc.poly", "1021".to_owned()),
            ("crc.refin", self.refin.to_string()),
            ("crc.refout", self.refout.to_string()),
            ("crc.byte_order", if self.is_low_first { "lo-hi" } else { "hi-lo" }.to_owned()),
            ("crc.covers_lbw", self.covers_lbw.to_string()),
        ]
    }

    fn upstream_bits(&self) -> usize {
        self.devices[..self.upstream].iter().map(|device| device.bits).sum()
    }

    fn checksum(&self, bytes: impl Iterator<Item = u8>) -> u16 {
        let mut register = self.init;
        for byte in bytes {
            let byte = if self.refin { byte.reverse_bits() } else { byte };
            for bit in (0..8).rev() {
                let feedback = (register >> 15 & 1) as u8 ^ (byte >> bit & 1);
                register <<= 1;
                if feedback == 1 {
                    register ^= 0x1021;
                }
            }
        }
        (if self.refout { register.reverse_bits() } else { register }) ^ self.xorout
    }

    fn frame(&self, before: &[u8], lbw: u16, behind: &[u8]) -> Vec<u8> {
        let lbw = lbw.to_be_bytes();
        let mut bytes = [before, &lbw, behind].concat();
        let sum = if self.covers_lbw {
            self.checksum(bytes.iter().copied())
        } else {
            self.checksum(before.iter().chain(behind).copied())
        };
        bytes.extend(if self.is_low_first { sum.to_le_bytes() } else { sum.to_be_bytes() });
        bytes.extend(self.control.to_be_bytes());
        bytes
    }

    /// The two wires with so many data cycles behind some ID cycles.
    pub fn record(&self, cycles: usize, chance: &mut Chance) -> Recording {
        self.record_with(cycles, &[], chance).0
    }

    /// The same with faults; and what device 2, or the only one, sent and received, by data cycle.
    pub fn record_with(
        &self,
        cycles: usize,
        faults: &[(usize, Fault)],
        chance: &mut Chance,
    ) -> (Recording, Vec<String>) {
        let mut told = Vec::new();
        let mut plan = self.clone();
        let mut tape = Tape::new(self);
        tape.idle(60 + chance.below(40) as usize, true, chance);
        let mut words: Vec<(u32, u32)> =
            self.devices.iter().map(|_| (chance.next() as u32, chance.next() as u32)).collect();
        for number in 0..self.id_cycles + cycles {
            let is_now = |fault: Fault| faults.contains(&(number, fault));
            let resets = faults.iter().filter_map(|(at, fault)| match fault {
                Fault::Silence(bits) => Some((*at, *bits)),
                _ => None,
            });
            let mut is_id = number < self.id_cycles;
            for (at, bits) in resets {
                if at == number {
                    tape.silence(bits);
                    tape.idle(40, true, chance);
                }
                is_id |= (at..at + 4).contains(&number);
            }
            if is_now(Fault::Shorter) {
                plan.devices.pop();
                words.pop();
            }
            let count = if self.counts { number as u16 % 16 } else { 0 };
            let lbw = if self.counts { self.lbw & 0xFFF0 | count } else { self.lbw };
            for (out, input) in &mut words {
                if !self.is_standing {
                    *input = input.wrapping_add(chance.below(300) as u32);
                    if chance.below(5) == 0 {
                        *out = chance.next() as u32;
                    }
                }
            }
            let (mut out, mut input) = (Vec::new(), Vec::new());
            let mut passed = Vec::new();
            let mut own = [String::new(), String::new()];
            for (index, (device, words)) in plan.devices.iter().zip(&words).enumerate().rev() {
                let is_upstream = index < self.upstream;
                if is_id {
                    input.extend(device.id.to_be_bytes());
                    match is_upstream {
                        true => passed.extend(device.id.to_be_bytes()),
                        false => out.extend([0, 0]),
                    }
                } else {
                    let fill = |word: u32| {
                        let bytes = word.to_be_bytes();
                        (0..device.bits / 8).map(move |n| bytes[(n + 4 - device.bits / 8 % 4) % 4])
                    };
                    input.extend(fill(words.1));
                    match is_upstream {
                        true => passed.extend(fill(words.1)),
                        false => out.extend(fill(words.0)),
                    }
                    if index == 1.min(plan.devices.len() - 1) {
                        let hex = |word| fill(word).map(|byte| format!("{byte:02X}")).collect();
                        own = [hex(words.0), hex(words.1)];
                    }
                }
            }
            if !is_id {
                told.push(own.join(" "));
            }
            let mut plan = plan.clone();
            if is_now(Fault::Control) {
                plan.control ^= 0x0040;
            }
            let back = if is_now(Fault::Loopback) { lbw ^ 0x0100 } else { lbw };
            let mut frames = [plan.frame(&passed, lbw, &out), plan.frame(&input, back, &[])];
            for (wire, frame) in frames.iter_mut().enumerate() {
                if is_now(Fault::Bit(wire)) {
                    frame[3] ^= 0x10;
                }
                if is_now(Fault::Cut(wire)) {
                    frame.truncate(5);
                }
                if is_now(Fault::Lost(wire)) {
                    frame.remove(4);
                }
                if is_now(Fault::Extra(wire)) {
                    frame.insert(4, 0x55);
                }
            }
            if is_now(Fault::Missing) {
                frames[1].clear();
            }
            tape.has_bad_stop = is_now(Fault::Stop);
            tape.cycle(&frames, is_id, chance);
            tape.idle(20 + chance.below(20) as usize, is_id, chance);
        }
        (tape.recording(), told)
    }
}
