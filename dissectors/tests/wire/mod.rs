//! A small sender of CAN frames, bit by bit as CAN 2.0 part A says.

use fieldtap_dissectors::can::Identifier;

/// What is put on the line, bit by bit: `true` is recessive.
#[derive(Clone, Default, Debug)]
pub struct Wire {
    pub bits: Vec<bool>,
}

/// A frame as its sender has it.
#[derive(Clone, Debug)]
pub struct Sent {
    pub id: Identifier,
    pub is_remote: bool,
    pub dlc: u8,
    pub data: Vec<u8>,
}

impl Sent {
    pub fn data(id: u16, data: &[u8]) -> Self {
        let (id, data) = (Identifier::Standard(id), data.to_vec());
        Sent { id, is_remote: false, dlc: data.len() as u8, data }
    }

    /// From the start of frame to the last data bit.
    fn head(&self) -> Vec<bool> {
        let mut bits = vec![false];
        let mut push = |value: u64, width: u32| {
            bits.extend((0..width).rev().map(|bit| value >> bit & 1 == 1));
        };
        match self.id {
            Identifier::Standard(id) => {
                push(id.into(), 11);
                push(u64::from(self.is_remote) << 2, 3);
            }
            Identifier::Extended(id) => {
                push(u64::from(id >> 18), 11);
                push(0b11, 2);
                push(u64::from(id & 0x3_FFFF), 18);
                push(u64::from(self.is_remote) << 2, 3);
            }
        }
        push(self.dlc.into(), 4);
        self.data.iter().for_each(|byte| push(u64::from(*byte), 8));
        bits
    }

    /// The stuffed part.
    pub fn body(&self, spoil: u32) -> Vec<bool> {
        let mut bits = self.head();
        // CAN 2.0, part A §3.1.1, with the names that it has there.
        let mut crc_rg = 0_u32;
        for nxtbit in &bits {
            let crcnxt = u32::from(*nxtbit) ^ (crc_rg >> 14 & 1);
            crc_rg = crc_rg << 1 & 0x7FFF;
            if crcnxt == 1 {
                crc_rg ^= 0x4599;
            }
        }
        bits.extend((0..15).rev().map(|bit| (crc_rg ^ spoil) >> bit & 1 == 1));
        stuff(&bits)
    }
}

/// A bit of the other level behind five equal ones (CAN 2.0, part A §5).
pub fn stuff(bits: &[bool]) -> Vec<bool> {
    let mut sent: Vec<bool> = Vec::new();
    for bit in bits {
        sent.push(*bit);
        if let [.., a, b, c, d, e] = sent[..]
            && [a, b, c, d] == [e; 4]
        {
            sent.push(!e);
        }
    }
    sent
}

impl Wire {
    pub fn put(mut self, level: bool, count: usize) -> Self {
        self.bits.extend(std::iter::repeat_n(level, count));
        self
    }

    pub fn idle(self, count: usize) -> Self {
        self.put(true, count)
    }

    pub fn dominant(self, count: usize) -> Self {
        self.put(false, count)
    }

    pub fn bits(mut self, bits: &[bool]) -> Self {
        self.bits.extend(bits);
        self
    }

    /// A whole frame that somebody acknowledges, and the intermission.
    pub fn frame(self, sent: &Sent) -> Self {
        self.bits(&sent.body(0)).idle(1).dominant(1).idle(1 + 7 + 3)
    }

    /// Its level changes: of a line with so many ticks a bit by the sender's clock, the first bit
    /// beginning at `phase` ticks.
    pub fn edges(&self, ticks_a_bit: f64, phase: f64) -> Vec<u64> {
        let changes = (1..).zip(self.bits.windows(2)).filter(|(_, pair)| pair[0] != pair[1]);
        changes.map(|(n, _)| (phase + f64::from(n) * ticks_a_bit).ceil() as u64).collect()
    }
}
