//! Frames, of the parts that VIPA 200V p. 4-5 and Phoenix Contact show: the ring is one shift
//! register, into which the master shifts the loopback word and what it sends, the last device's
//! first, and out of which come what the devices have to say, the last device's first, and the
//! loopback word.

use super::profile::Profile;
use std::collections::VecDeque;

/// The bytes of a cycle on the two wires at the master's connector.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Frame {
    /// Away from the master: loopback word, data, checksum, control word.
    pub out: Vec<u8>,
    /// Towards it: data, loopback word, checksum, control word.
    pub input: Vec<u8>,
}

/// The registers of the devices.
struct Registers(Vec<VecDeque<u8>>);

impl Registers {
    /// Registers that hold these bytes, from the first device on.
    fn new<'a>(inputs: impl Iterator<Item = &'a [u8]>) -> Self {
        Registers(inputs.map(|bytes| bytes.iter().copied().collect()).collect())
    }

    /// Shifts a byte in. Returns what is on the wire behind each device in this time.
    fn shift(&mut self, byte: u8) -> Vec<u8> {
        let mut passed = byte;
        let pass = |register: &mut VecDeque<u8>| {
            register.push_back(passed);
            passed = register.pop_front().unwrap_or(passed);
            passed
        };
        self.0.iter_mut().map(pass).collect()
    }
}

impl Frame {
    /// The frame of a cycle with this loopback word, in which the devices are sent and send these
    /// bytes, from the first device on.
    pub fn new(profile: &Profile, lbw: [u8; 2], devices: &[(&[u8], &[u8])]) -> Self {
        let outs = devices.iter().rev().flat_map(|(out, _)| out.iter().copied());
        let mut out: Vec<u8> = lbw.into_iter().chain(outs).collect();
        let mut registers = Registers::new(devices.iter().map(|(_, input)| *input));
        let last = |byte: &u8| registers.shift(*byte).last().copied().unwrap_or(*byte);
        let mut input: Vec<u8> = out.iter().map(last).collect();
        // Each hop has its own checksum.
        let covers = profile.crc.covers_lbw;
        let skipped = if covers { 0 } else { lbw.len() };
        let (of_out, of_input) =
            (profile.crc.sent(&out[skipped..]), profile.crc.sent(&input[..input.len() - skipped]));
        let control = profile.cntr.0.to_be_bytes();
        out.extend([of_out, control].concat());
        input.extend([of_input, control].concat());
        Frame { out, input }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::interbus::line::crc::tests::named;

    const LBW: [u8; 2] = [0xB5, 0xE3];

    #[test]
    fn the_ring_of_the_specification() {
        // Three devices of 16, 32 and 16 bit: what is sent enters the first register, and every
        // register pushes its content on.
        let (out, input) =
            ([&[0xAA; 2][..], &[0xBB; 4], &[0xCC; 2]], [&[0x11; 2][..], &[0x22; 4], &[0x33; 2]]);
        let devices: Vec<(&[u8], &[u8])> = out.into_iter().zip(input).collect();
        let frame = Frame::new(&Profile::default(), LBW, &devices);
        let sent = [0xB5, 0xE3, 0xCC, 0xCC, 0xBB, 0xBB, 0xBB, 0xBB, 0xAA, 0xAA];
        assert_eq!(frame.out[..10], sent);
        assert_eq!(frame.input[..10], [0x33, 0x33, 0x22, 0x22, 0x22, 0x22, 0x11, 0x11, 0xB5, 0xE3]);
        // Behind each device.
        let mut registers = Registers::new(input.into_iter());
        let taps: Vec<Vec<u8>> = sent.iter().map(|byte| registers.shift(*byte)).collect();
        let behind = |device: usize| taps.iter().map(|tap| tap[device]).collect::<Vec<u8>>();
        assert_eq!(behind(0), [0x11, 0x11, 0xB5, 0xE3, 0xCC, 0xCC, 0xBB, 0xBB, 0xBB, 0xBB]);
        assert_eq!(behind(1), [0x22, 0x22, 0x22, 0x22, 0x11, 0x11, 0xB5, 0xE3, 0xCC, 0xCC]);
        // And every device has what was meant for it.
        assert_eq!(registers.0, out.map(|bytes| bytes.iter().copied().collect::<VecDeque<u8>>()));
    }

    #[test]
    fn id_words_come_last_device_first() {
        // IDs 0203, 0233, 0132, the last one first.
        let ids = [[0x02, 0x03], [0x02, 0x33], [0x01, 0x32]];
        let devices: Vec<(&[u8], &[u8])> = ids.iter().map(|id| (&[0, 0][..], &id[..])).collect();
        let frame = Frame::new(&Profile::default(), LBW, &devices);
        assert_eq!(frame.input[..8], [0x01, 0x32, 0x02, 0x33, 0x02, 0x03, 0xB5, 0xE3]);
    }

    #[test]
    fn an_encoder_alone() {
        // CRC-16/XMODEM of these bytes, with and without the loopback word.
        let device: (&[u8], &[u8]) = (&[0x81, 0, 0, 0], &[0, 1, 0x23, 0x45]);
        let mut profile = Profile { crc: named(0, false, 0), ..Profile::default() };
        let frame = Frame::new(&profile, LBW, &[device]);
        assert_eq!(frame.out, [0xB5, 0xE3, 0x81, 0, 0, 0, 0xC6, 0xFF, 0, 0]);
        assert_eq!(frame.input, [0, 1, 0x23, 0x45, 0xB5, 0xE3, 0xDC, 0x2B, 0, 0]);
        profile.crc.covers_lbw = false;
        let frame = Frame::new(&profile, LBW, &[device]);
        assert_eq!(frame.out[6..8], [0xAB, 0x8C]);
        assert_eq!(frame.input[6..8], [0x7C, 0xE4]);
    }
}
