//! The ring: its devices and the widths of their registers, and which bytes of a cycle are whose.

use super::super::identification::{self, IdWord};
use super::super::row::Device;
use super::profile::RingDevice;
use alloc::vec::Vec;

/// Devices that a ring has at most.
pub const MAX_DEVICES: usize = 512;

/// The devices of a ring, the first from the master first.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Ring {
    /// Width of each register in bits.
    widths: Vec<u16>,
    /// The ID words, where an ID cycle showed them.
    ids: Vec<u16>,
}

/// Which data of a device is meant.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Direction {
    /// From the master.
    Out,
    /// To the master.
    In,
}

impl Ring {
    /// The ring that the user described; `None` if it cannot be one.
    #[must_use]
    pub fn given(devices: &[RingDevice]) -> Option<Ring> {
        let is_possible = !devices.is_empty() && devices.len() <= MAX_DEVICES;
        let widths = devices.iter().map(|device| device.width_bits).collect();
        is_possible.then_some(Ring { widths, ids: Vec::new() })
    }

    /// The ring that an ID cycle tells, from what stood before the loopback word on the way back:
    /// the last device first. `None` if these are no ID words.
    #[must_use]
    pub fn of_identification(words: &[u8], is_turned: bool) -> Option<Ring> {
        let (words, rest) = words.as_chunks::<2>();
        if words.is_empty() || words.len() > MAX_DEVICES || !rest.is_empty() {
            return None;
        }
        let turn = |word: [u8; 2]| if is_turned { word.map(u8::reverse_bits) } else { word };
        let ids: Vec<u16> =
            words.iter().rev().map(|word| u16::from_be_bytes(turn(*word))).collect();
        let widths = ids.iter().map(|id| width_of(*id)).collect::<Option<_>>()?;
        Some(Ring { widths, ids })
    }

    /// How many devices it has.
    #[must_use]
    pub fn len(&self) -> usize {
        self.widths.len()
    }

    /// Whether it has none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.widths.is_empty()
    }

    /// The widths of the registers in bits, the first device first.
    #[must_use]
    pub fn widths(&self) -> &[u16] {
        &self.widths
    }

    /// The ID words, the first device first; none where the user described the ring.
    #[must_use]
    pub fn ids(&self) -> &[u16] {
        &self.ids
    }

    /// Whether the registers take so many bytes. How those of less than a byte are padded is not
    /// known: at the end of all, or each.
    #[must_use]
    pub fn fits(&self, bytes: usize) -> bool {
        self.bits().div_ceil(8) == bytes
            || self.widths.iter().map(|width| usize::from(width.div_ceil(8))).sum::<usize>()
                == bytes
    }

    /// Bits of all registers.
    #[must_use]
    pub fn bits(&self) -> usize {
        self.widths.iter().copied().map(usize::from).sum()
    }

    /// Whether all registers are whole bytes: then it is known where each is.
    fn is_whole(&self) -> bool {
        self.widths.iter().all(|width| width.is_multiple_of(8))
    }

    /// Where the data of a device is in a cycle with the loopback word at this offset, in bytes.
    /// `None` where the wire does not carry it, or the ring is another than this.
    #[must_use]
    pub fn place(
        &self,
        device: Device,
        direction: Direction,
        loopback: usize,
    ) -> Option<core::ops::Range<usize>> {
        let index = usize::from(device.number()) - 1;
        let width = |index: usize| usize::from(self.widths[index]) / 8;
        if index >= self.len() || !self.is_whole() {
            return None;
        }
        let upstream = self.upstream(loopback)?;
        let from = match direction {
            // IN_k … IN_1 stand before the loopback word.
            Direction::In if index < upstream => (index + 1..upstream).map(width).sum(),
            // OUT_n … OUT_k+1 stand behind it.
            Direction::Out if index >= upstream => {
                loopback + 2 + (index + 1..self.len()).map(width).sum::<usize>()
            }
            _ => return None,
        };
        Some(from..from + width(index))
    }

    /// How many devices are upstream of a tap whose loopback word is at this offset, in bytes.
    #[must_use]
    pub fn upstream(&self, loopback: usize) -> Option<usize> {
        let mut bits = 0;
        for (index, width) in self.widths.iter().enumerate() {
            if bits == loopback * 8 {
                return Some(index);
            }
            bits += usize::from(*width);
        }
        (bits == loopback * 8).then_some(self.len())
    }
}

/// The width that an ID word tells, in bits; `None` for reserved length codes, and for words of
/// devices with process data that tell no direction of it.
fn width_of(id: u16) -> Option<u16> {
    let id = IdWord::of(id);
    let has_direction = id.direction() != identification::Direction::None;
    id.length.bits().filter(|width| *width == 0 || has_direction)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(number: u16) -> Device {
        Device::new(number).unwrap()
    }

    #[test]
    fn an_id_cycle_tells_the_ring_the_last_device_first() {
        // IDs 0203, 0233, 0132: the loopback word is at 48 bits, 48 / 16 = 3 devices.
        let cycle = [0x01, 0x32, 0x02, 0x33, 0x02, 0x03, 0xB5, 0xE3];
        let ring = Ring::of_identification(&cycle[..6], false).unwrap();
        assert_eq!(ring.ids(), [0x0203, 0x0233, 0x0132]);
        assert_eq!(ring.widths(), [32, 32, 16]);
        assert_eq!(ring.len(), 48 / 16);
        assert!(ring.fits(10) && !ring.fits(8));
        let turned = cycle.map(u8::reverse_bits);
        assert_eq!(Ring::of_identification(&turned[..6], true).unwrap(), ring);
        // Length code 0C is reserved, and there is no odd half of a word.
        assert!(Ring::of_identification(&[0x0C, 0x33], false).is_none());
        assert!(Ring::of_identification(&[0x02, 0x33, 0x02], false).is_none());
    }

    /// The worked example: 16, 32 and 16 bits.
    #[test]
    fn every_tap_carries_the_registers_in_ring_order() {
        let widths = [16, 32, 16].map(|width_bits| RingDevice { width_bits, name: None });
        let ring = Ring::given(&widths).unwrap();
        let taps: [(usize, &[u8]); 4] = [
            (0, &[0xB5, 0xE3, 0xCC, 0xCC, 0xBB, 0xBB, 0xBB, 0xBB, 0xAA, 0xAA]),
            (2, &[0x11, 0x11, 0xB5, 0xE3, 0xCC, 0xCC, 0xBB, 0xBB, 0xBB, 0xBB]),
            (6, &[0x22, 0x22, 0x22, 0x22, 0x11, 0x11, 0xB5, 0xE3, 0xCC, 0xCC]),
            (8, &[0x33, 0x33, 0x22, 0x22, 0x22, 0x22, 0x11, 0x11, 0xB5, 0xE3]),
        ];
        for (upstream, (loopback, bytes)) in taps.into_iter().enumerate() {
            assert_eq!(ring.upstream(loopback), Some(upstream));
            for number in 1..=3_u16 {
                let read = |direction| {
                    let place = ring.place(device(number), direction, loopback)?;
                    Some(bytes[place].to_vec())
                };
                let length = [2, 4, 2][usize::from(number) - 1];
                let index = u8::try_from(number).unwrap();
                let is_upstream = usize::from(number) <= upstream;
                let expected_in = is_upstream.then(|| alloc::vec![0x11 * index; length]);
                let expected_out = (!is_upstream).then(|| alloc::vec![0x99 + 0x11 * index; length]);
                assert_eq!(read(Direction::In), expected_in, "tap {upstream} device {number}");
                assert_eq!(read(Direction::Out), expected_out, "tap {upstream} device {number}");
            }
        }
        assert_eq!(ring.upstream(4), None, "in the middle of a register");
        assert_eq!(ring.place(device(4), Direction::In, 8), None);
    }

    #[test]
    fn where_registers_of_less_than_a_byte_are_is_not_known() {
        let widths = [4, 4, 16].map(|width_bits| RingDevice { width_bits, name: None });
        let ring = Ring::given(&widths).unwrap();
        assert!(ring.fits(3) && ring.fits(4));
        assert_eq!(ring.place(device(3), Direction::Out, 0), None);
    }
}
