//! What an encoder tells and takes: its objects (Baumer Hübner DeviceNet manual §4 to §8).
//!
//! Connections (class 5) are in [`super::connection`]: they are the node's own business.

use super::plan::{STEPS_PER_TURN, Station, TOTAL_RESOLUTION};

/// General status codes of error responses (CIP Vol. 1, appendix B).
pub mod status {
    /// Service not supported.
    pub const SERVICE: u8 = 0x08;
    /// Invalid attribute value.
    pub const VALUE: u8 = 0x09;
    /// Attribute not settable.
    pub const NOT_SETTABLE: u8 = 0x0E;
    /// Not enough data.
    pub const TOO_LITTLE: u8 = 0x13;
    /// Attribute not supported.
    pub const ATTRIBUTE: u8 = 0x14;
    /// Object does not exist.
    pub const OBJECT: u8 = 0x16;
}

/// The encoder position object.
pub const ENCODER: u8 = 0x2F;
/// The parameter object.
pub const PARAMETER: u8 = 0x0F;

/// Attributes of the encoder position object that an instance of the parameter object points to
/// (manual §7), from instance 1 on.
const PARAMETERS: [u8; 19] = [3, 4, 5, 6, 7, 8, 9, 10, 12, 80, 81, 82, 85, 83, 84, 88, 86, 87, 89];

/// Attributes of the encoder position object (manual §8).
const ATTRIBUTES: [u8; 24] =
    [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 80, 81, 82, 83, 84, 85, 86, 87, 88, 89, 91, 95];

/// The position error, bit 0 of the alarm signals.
const POSITION_ERROR: u16 = 1 << 0;
/// The lithium cell, bit 4 of the warning messages.
const LITHIUM_CELL: u16 = 1 << 4;

/// What can be set and saved.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Parameters {
    /// Whether values increase counter-clockwise.
    pub is_ccw: bool,
    /// Steps per turn.
    pub steps: u32,
    /// Steps over all turns.
    pub total: u32,
    /// The preset that was set last.
    pub preset: u32,
    /// What is added to the position, modulo the total resolution.
    pub offset: u32,
    /// The change that makes it produce.
    pub delta: u32,
}

impl Parameters {
    /// The defaults of an encoder as it was ordered.
    pub fn of(station: &Station) -> Self {
        let Station { steps, total, .. } = *station;
        Parameters { is_ccw: false, steps, total, preset: 0, offset: 0, delta: 1 }
    }

    /// The position that the disc's own shows as (manual §4, §8).
    pub fn position(&self, disc: u32) -> u32 {
        ((u64::from(self.plain(disc)) + u64::from(self.offset)) % u64::from(self.total)) as u32
    }

    /// The same without the offset.
    fn plain(&self, disc: u32) -> u32 {
        let steps = u64::from(disc) * u64::from(self.steps) / u64::from(STEPS_PER_TURN);
        let position = steps % u64::from(self.total);
        if self.is_ccw {
            ((u64::from(self.total) - position) % u64::from(self.total)) as u32
        } else {
            position as u32
        }
    }

    /// Sets the position to the preset.
    fn set_preset(&mut self, preset: u32, disc: u32) {
        let total = u64::from(self.total);
        let plain = u64::from(self.plain(disc));
        self.preset = preset;
        self.offset = ((u64::from(preset) + total - plain) % total) as u32;
    }
}

/// The objects of an encoder but its connections.
pub struct Objects {
    /// Vendor ID.
    pub vendor: u16,
    /// Serial number.
    pub serial: u32,
    /// Product code: 0Ah multi-turn, 0Bh single-turn (manual §1.2).
    pub product: u16,
    /// What is set.
    pub parameters: Parameters,
    /// What is saved.
    pub saved: Parameters,
    defaults: Parameters,
    /// Whether there is a position error.
    pub is_alarmed: bool,
    /// Whether the lithium cell is low.
    pub is_warned: bool,
    /// Seconds between two heartbeats.
    pub heartbeat: u8,
    mac: u8,
    bitrate: u32,
}

/// The answer to a request: data, or a general status code.
pub type Answer = Result<Vec<u8>, u8>;

impl Objects {
    /// An encoder as it was delivered.
    pub fn new(station: &Station, vendor: u16, serial: u32, bitrate: u32) -> Self {
        let parameters = Parameters::of(station);
        let is_multi_turn = parameters.total > parameters.steps;
        Objects {
            vendor,
            serial,
            product: if is_multi_turn { 0x0A } else { 0x0B },
            parameters,
            saved: parameters,
            defaults: parameters,
            is_alarmed: false,
            is_warned: false,
            heartbeat: 0,
            mac: station.mac,
            bitrate,
        }
    }

    /// The I/O data of an assembly (manual §6).
    pub fn assembly(&self, instance: u8, disc: u32) -> Vec<u8> {
        let mut data = self.parameters.position(disc).to_le_bytes().to_vec();
        if instance == 2 {
            data.push(u8::from(self.is_alarmed) | u8::from(self.is_warned) << 1);
        }
        data
    }

    /// Power comes back: what was not saved is lost.
    pub fn restart(&mut self) {
        self.parameters = self.saved;
        (self.is_alarmed, self.is_warned) = (false, false);
    }

    /// Get_Attribute_Single.
    ///
    /// # Errors
    /// The general status code.
    pub fn get(&self, class: u8, instance: u8, attribute: u8, disc: u32) -> Answer {
        match (class, instance) {
            (0x01, 1) => self.identity(attribute),
            (0x03, 1) => self.devicenet(attribute),
            (0x04, 1 | 2) if attribute == 3 => Ok(self.assembly(instance, disc)),
            (0x04, 1 | 2) => Err(status::ATTRIBUTE),
            (PARAMETER, 1..=19) if attribute == 1 => {
                self.encoder(PARAMETERS[usize::from(instance) - 1], disc)
            }
            (PARAMETER, 1..=19) => Err(status::ATTRIBUTE),
            // Acknowledge timer, retry limit, producing instance.
            (0x2B, 1) => match attribute {
                1 => Ok(16_u16.to_le_bytes().to_vec()),
                2 => Ok(vec![1]),
                3 => Ok(4_u16.to_le_bytes().to_vec()),
                _ => Err(status::ATTRIBUTE),
            },
            (ENCODER, 1) => self.encoder(attribute, disc),
            _ => Err(status::OBJECT),
        }
    }

    fn identity(&self, attribute: u8) -> Answer {
        Ok(match attribute {
            1 => self.vendor.to_le_bytes().to_vec(),
            // Encoder.
            2 => 0x22_u16.to_le_bytes().to_vec(),
            3 => self.product.to_le_bytes().to_vec(),
            4 => vec![1, 1],
            // Owned.
            5 => 1_u16.to_le_bytes().to_vec(),
            6 => self.serial.to_le_bytes().to_vec(),
            7 => [&[16], &b"Absolute Encoder"[..]].concat(),
            8 => vec![3],
            10 => vec![self.heartbeat],
            _ => return Err(status::ATTRIBUTE),
        })
    }

    fn devicenet(&self, attribute: u8) -> Answer {
        let rate = match self.bitrate {
            500_000 => 2,
            250_000 => 1,
            _ => 0,
        };
        match attribute {
            1 => Ok(vec![self.mac]),
            2 => Ok(vec![rate]),
            3 | 4 => Ok(vec![0]),
            _ => Err(status::ATTRIBUTE),
        }
    }

    fn encoder(&self, attribute: u8, disc: u32) -> Answer {
        let Parameters { is_ccw, steps, total, preset, offset, delta } = self.parameters;
        let word = |value: u16| value.to_le_bytes().to_vec();
        let double = |value: u32| value.to_le_bytes().to_vec();
        Ok(match attribute {
            1 => vec![ATTRIBUTES.len() as u8],
            2 => ATTRIBUTES.to_vec(),
            3 => vec![u8::from(is_ccw)],
            4 | 6 => vec![0],
            5 => vec![1],
            7 => double(steps),
            8 => double(total),
            9 => double(0),
            10 => double(preset),
            11 => double(delta),
            12 => double(self.parameters.position(disc)),
            // Diagnosis supported, scaling on.
            80 => vec![u8::from(is_ccw) | 0b110],
            81 => double(STEPS_PER_TURN),
            // 65536 turns do not fit.
            82 => word((TOTAL_RESOLUTION / STEPS_PER_TURN) as u16),
            83 => word(if self.is_alarmed { POSITION_ERROR } else { 0 }),
            84 => word(POSITION_ERROR),
            85 => vec![u8::from(self.is_alarmed)],
            86 => word(if self.is_warned { LITHIUM_CELL } else { 0 }),
            87 => word(LITHIUM_CELL),
            88 => vec![u8::from(self.is_warned)],
            // Profile 1, software 1.01.
            89 => double(0x0101_0001),
            91 => double(offset),
            95 => word(if self.product == 0x0A { 2 } else { 1 }),
            _ => return Err(status::ATTRIBUTE),
        })
    }

    /// Set_Attribute_Single.
    ///
    /// # Errors
    /// The general status code.
    pub fn set(&mut self, class: u8, instance: u8, data: &[u8], disc: u32) -> Answer {
        let [attribute, value @ ..] = data else { return Err(status::TOO_LITTLE) };
        match (class, instance) {
            (0x01, 1) if *attribute == 10 => {
                self.heartbeat = *value.first().ok_or(status::TOO_LITTLE)?;
                Ok(Vec::new())
            }
            (PARAMETER, 1..=19) if *attribute == 1 => {
                self.set_encoder(PARAMETERS[usize::from(instance) - 1], value, disc)
            }
            (ENCODER, 1) => self.set_encoder(*attribute, value, disc),
            _ => match self.get(class, instance, *attribute, disc) {
                Ok(_) => Err(status::NOT_SETTABLE),
                Err(status) => Err(status),
            },
        }
    }

    fn set_encoder(&mut self, attribute: u8, value: &[u8], disc: u32) -> Answer {
        let double = || value.try_into().map(u32::from_le_bytes).map_err(|_| status::TOO_LITTLE);
        let within = |least: u32, most: u32| {
            double().and_then(|value| {
                if (least..=most).contains(&value) { Ok(value) } else { Err(status::VALUE) }
            })
        };
        let parameters = &mut self.parameters;
        match attribute {
            3 => match value {
                [value @ 0..=1] => parameters.is_ccw = *value == 1,
                [_] => return Err(status::VALUE),
                _ => return Err(status::TOO_LITTLE),
            },
            7 => {
                let turns = parameters.total / parameters.steps;
                parameters.steps = within(1, STEPS_PER_TURN)?;
                parameters.total = parameters.steps * turns;
            }
            8 => parameters.total = within(1, TOTAL_RESOLUTION)?,
            10 => parameters.set_preset(within(0, parameters.total - 1)?, disc),
            11 => parameters.delta = within(1, parameters.total)?,
            _ if ATTRIBUTES.contains(&attribute) => return Err(status::NOT_SETTABLE),
            _ => return Err(status::ATTRIBUTE),
        }
        Ok(Vec::new())
    }

    /// Reset, Restore and Save of the encoder's own objects (manual §7, §8).
    ///
    /// # Errors
    /// The general status code.
    pub fn serve(&mut self, service: u8, class: u8) -> Answer {
        if !matches!(class, PARAMETER | ENCODER) {
            return Err(status::SERVICE);
        }
        match service {
            super::explicit::RESET => self.parameters = self.defaults,
            super::explicit::RESTORE => self.parameters = self.saved,
            super::explicit::SAVE => self.saved = self.parameters,
            _ => return Err(status::SERVICE),
        }
        Ok(Vec::new())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::devicenet::plan::Mode;

    fn encoder(steps: u32, total: u32) -> Objects {
        let station = Station { mac: 23, mode: Mode::Poll, assembly: 1, steps, total };
        Objects::new(&station, 468, 1, 125_000)
    }

    #[test]
    fn the_manuals_example_has_256_turns_of_3600_steps() {
        let encoder = encoder(3_600, 921_600);
        assert_eq!(encoder.get(ENCODER, 1, 8, 0), Ok(vec![0x00, 0x10, 0x0E, 0x00]));
        // Half a turn of the disc is 1800 steps; 256 turns and half a one are the same.
        assert_eq!(encoder.parameters.position(4_096), 1_800);
        assert_eq!(encoder.parameters.position(256 * 8_192 + 4_096), 1_800);
        // Parameter instance 9 is attribute 12.
        assert_eq!(encoder.get(PARAMETER, 9, 1, 4_096), Ok(1_800_u32.to_le_bytes().to_vec()));
    }

    #[test]
    fn a_preset_moves_the_position_and_is_lost_without_save() {
        let mut encoder = encoder(8_192, 1 << 29);
        assert_eq!(encoder.set(ENCODER, 1, &[10, 0x45, 0x23, 0x01, 0x00], 5_000), Ok(vec![]));
        assert_eq!(encoder.parameters.position(5_000), 74_565);
        assert_eq!(encoder.parameters.position(4_999), 74_564);
        encoder.restart();
        assert_eq!(encoder.parameters.position(5_000), 5_000);
        encoder.set(ENCODER, 1, &[10, 0, 0, 0, 0], 5_000).unwrap();
        encoder.serve(super::super::explicit::SAVE, ENCODER).unwrap();
        encoder.restart();
        assert_eq!(encoder.parameters.position(5_000), 0);
    }

    #[test]
    fn values_are_checked() {
        let mut encoder = encoder(8_192, 1 << 29);
        let too_many = [7, 0x10, 0x27, 0, 0];
        assert_eq!(encoder.set(ENCODER, 1, &too_many, 0), Err(status::VALUE));
        assert_eq!(encoder.set(ENCODER, 1, &[12, 0, 0, 0, 0], 0), Err(status::NOT_SETTABLE));
        assert_eq!(encoder.get(ENCODER, 1, 99, 0), Err(status::ATTRIBUTE));
        assert_eq!(encoder.get(0x23, 1, 10, 0), Err(status::OBJECT));
        // 3600 steps: the turns stay.
        assert_eq!(encoder.set(ENCODER, 1, &[7, 0x10, 0x0E, 0, 0], 0), Ok(vec![]));
        assert_eq!(encoder.parameters.total, 3_600 * 65_536);
    }

    #[test]
    fn assembly_2_has_two_flags() {
        let mut encoder = encoder(8_192, 1 << 29);
        encoder.is_warned = true;
        assert_eq!(encoder.assembly(1, 74_565), [0x45, 0x23, 0x01, 0x00]);
        assert_eq!(encoder.assembly(2, 74_565), [0x45, 0x23, 0x01, 0x00, 0b10]);
        encoder.is_alarmed = true;
        assert_eq!(encoder.assembly(2, 0)[4], 0b11);
    }
}
