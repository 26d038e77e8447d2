//! How a line is coded: everything that is not publicly known of INTERBUS, as a
//! choice.

use crate::simulate::chance::Chance;
use crate::simulate::interbus::plan::Member;
use anyhow::{Context, Result, ensure};
use serde::{Deserialize, Serialize};

/// Streams of the seed of a random profile.
const PROFILE: u64 = 0;
const RING: u64 = 1;

/// A word as four hex digits.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Word(pub u16);

impl Serialize for Word {
    fn serialize<S: serde::Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
        out.serialize_str(&format!("{:04X}", self.0))
    }
}

impl<'de> Deserialize<'de> for Word {
    fn deserialize<D: serde::Deserializer<'de>>(input: D) -> Result<Self, D::Error> {
        let text = String::deserialize(input)?;
        let word = u16::from_str_radix(&text, 16).ok().filter(|_| text.len() == 4);
        word.map(Word)
            .ok_or(serde::de::Error::custom("a word is four hex digits, such as \"B5E3\""))
    }
}

/// The three flags of a telegram.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum Flag {
    /// Whether this is an ID cycle.
    Sl,
    /// Whether this is the check phase.
    Cr,
    /// Whether this is a data telegram.
    Type,
}

/// The levels by which flags say yes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE", deny_unknown_fields)]
pub struct Polarity {
    /// In ID cycles.
    pub sl: u8,
    /// In the check phase.
    pub cr: u8,
    /// In data telegrams.
    pub r#type: u8,
}

/// Which bit of a byte is sent first.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BitOrder {
    /// The highest.
    Msb,
    /// The lowest.
    Lsb,
}

/// Which byte of the checksum is sent first.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
pub enum ByteOrder {
    /// The high one.
    #[default]
    #[serde(rename = "hi-lo")]
    HighLow,
    /// The low one.
    #[serde(rename = "lo-hi")]
    LowHigh,
}

/// The loopback word.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Loopback {
    /// Its value in the first cycle.
    pub value: Word,
    /// The bits that never change. The others count the cycles.
    pub mask: Word,
}

impl Loopback {
    /// Its value in the cycle of this number, from 0.
    pub fn in_cycle(self, cycle: u64) -> [u8; 2] {
        let (value, mask) = (self.value.0, self.mask.0);
        let counting = !mask;
        let step = (cycle as u16) << counting.trailing_zeros().min(15);
        let counted = (value & counting).wrapping_add(step) & counting;
        (value & mask | counted).to_be_bytes()
    }
}

/// The checksum.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Crc {
    /// What the register is at first.
    pub init: Word,
    /// Bytes go in with the lowest bit first.
    pub refin: bool,
    /// The register comes out turned round.
    pub refout: bool,
    /// What is added at the end.
    pub xorout: Word,
    /// Which byte is first.
    pub byte_order: ByteOrder,
    /// Whether the loopback word is covered.
    pub covers_lbw: bool,
}

impl Default for Crc {
    fn default() -> Self {
        Crc {
            init: Word(0xFFFF),
            refin: false,
            refout: false,
            xorout: Word(0),
            byte_order: ByteOrder::HighLow,
            covers_lbw: true,
        }
    }
}

/// How a line is coded.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Profile {
    /// Bits a second: 500000, or 2000000.
    pub bitrate: u32,
    /// The level of a line on which nothing is sent. Start bits are the other one.
    pub idle_level: u8,
    /// The flags in the order in which they are sent.
    pub flag_order: [Flag; 3],
    /// Their levels.
    pub flag_polarity: Polarity,
    /// The order of the bits of a byte.
    pub data_bit_order: BitOrder,
    /// Longest gap between two characters of a frame, in bits.
    pub gap_bits: f64,
    /// The loopback word.
    pub lbw: Loopback,
    /// The checksum.
    pub crc: Crc,
    /// The control word of a healthy ring.
    pub cntr: Word,
}

impl Default for Profile {
    fn default() -> Self {
        Profile {
            bitrate: 500_000,
            idle_level: 1,
            flag_order: [Flag::Sl, Flag::Cr, Flag::Type],
            flag_polarity: Polarity { sl: 1, cr: 1, r#type: 1 },
            data_bit_order: BitOrder::Msb,
            gap_bits: 2.0,
            // The placeholder of the specification's examples.
            lbw: Loopback { value: Word(0xB5E3), mask: Word(0xFFFF) },
            crc: Crc::default(),
            cntr: Word(0),
        }
    }
}

impl Profile {
    /// Reads a profile: TOML with the names above.
    ///
    /// # Errors
    /// It is none.
    pub fn parse(text: &str) -> Result<Profile> {
        let profile: Profile = crate::config::parse(text).context("not a profile of a line")?;
        let [first, second, third] = profile.flag_order;
        ensure!(
            first != second && second != third && first != third,
            "flag_order: each of SL, CR and TYPE once"
        );
        let levels = profile.flag_polarity;
        let levels = [levels.sl, levels.cr, levels.r#type, profile.idle_level];
        ensure!(levels.iter().all(|level| *level <= 1), "a level is 0 or 1");
        ensure!((0.0..=8.0).contains(&profile.gap_bits), "gap_bits: 0 to 8");
        let rates = [500_000, 2_000_000];
        ensure!(rates.contains(&profile.bitrate), "bitrate: 500000 or 2000000");
        Ok(profile)
    }

    /// Any profile. The bit rate is left as it is.
    pub fn random(seed: u64) -> Profile {
        let chance = &mut Chance::new(seed, PROFILE);
        let mut flags = vec![Flag::Sl, Flag::Cr, Flag::Type];
        let flag_order = [3, 2, 1].map(|left| flags.remove(chance.below(left) as usize));
        let mut level = || chance.below(2) as u8;
        let idle_level = level();
        let flag_polarity = Polarity { sl: level(), cr: level(), r#type: level() };
        let is_msb = chance.happens(0.5);
        let mut word = |usual: &[u16]| match chance.one_of(usual) {
            Some(word) if chance.happens(0.6) => Word(word),
            _ => Word(chance.below(1 << 16) as u16),
        };
        let (init, xorout) = (word(&[0, 0xFFFF]), word(&[0, 0xFFFF]));
        let (cntr, value) = (word(&[0]), word(&[]));
        let mask = chance.one_of(&[0xFFFF, 0xFFFF, 0xFFF0, 0x0FFF]).unwrap_or(0xFFFF);
        let refin = chance.happens(0.5);
        let is_low_first = chance.happens(0.5);
        Profile {
            bitrate: 500_000,
            idle_level,
            flag_order,
            flag_polarity,
            data_bit_order: if is_msb { BitOrder::Msb } else { BitOrder::Lsb },
            gap_bits: chance.within(0.0, 2.0),
            lbw: Loopback { value, mask: Word(mask) },
            crc: Crc {
                init,
                refin,
                // Hardly anybody turns round one of the two only.
                refout: refin != chance.happens(0.1),
                xorout,
                byte_order: if is_low_first { ByteOrder::LowHigh } else { ByteOrder::HighLow },
                covers_lbw: chance.happens(0.7),
            },
            cntr,
        }
    }

    /// The levels of the flags of a telegram.
    pub fn flags(&self, is_id_cycle: bool, is_check: bool, is_data: bool) -> [bool; 3] {
        let polarity = self.flag_polarity;
        self.flag_order.map(|flag| match flag {
            Flag::Sl => is_id_cycle == (polarity.sl == 1),
            Flag::Cr => is_check == (polarity.cr == 1),
            Flag::Type => is_data == (polarity.r#type == 1),
        })
    }
}

/// Any ring: one to five devices, every other one an LA-66.
pub fn random_ring(seed: u64) -> Vec<Member> {
    let mut chance = Chance::new(seed, RING);
    let count = 1 + chance.below(5);
    let member = |_| {
        // One byte to five words, out, in, or both.
        let length = chance.one_of(&[0x01, 0x02, 0x03, 0x05, 0x09, 0x0B]).unwrap_or(0x02);
        let direction = 1 + chance.below(3) as u16;
        let is_encoder = chance.happens(0.5);
        let id = if is_encoder { 0x0233 } else { length << 8 | 0x30 | direction };
        Member { is_encoder, id }
    };
    (0..count).map(member).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_read_as_it_is_written() {
        for seed in 0..100 {
            let profile = Profile::random(seed);
            assert_eq!(Profile::parse(&toml::to_string(&profile).unwrap()).unwrap(), profile);
        }
        let text = "flag_order = [\"TYPE\", \"SL\", \"CR\"]\nlbw = { value = \"1234\", mask = \"FFF0\" }\n\
                    [crc]\ninit = \"5A5A\"\nbyte_order = \"lo-hi\"\n";
        let profile = Profile::parse(text).unwrap();
        assert_eq!(profile.flag_order, [Flag::Type, Flag::Sl, Flag::Cr]);
        assert_eq!((profile.crc.init, profile.lbw.mask), (Word(0x5A5A), Word(0xFFF0)));
        for wrong in ["idle_level = 2", "flag_order = [\"SL\", \"SL\", \"CR\"]", "lbw = \"B5E3\""] {
            assert!(Profile::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_loopback_word_counts_in_the_bits_of_its_mask() {
        let lbw = |mask| Loopback { value: Word(0xB5EF), mask: Word(mask) };
        assert_eq!(lbw(0xFFFF).in_cycle(7), [0xB5, 0xEF]);
        assert_eq!(lbw(0xFFF0).in_cycle(1), [0xB5, 0xE0]);
        assert_eq!(lbw(0x0FFF).in_cycle(2), [0xD5, 0xEF]);
    }

    #[test]
    fn random_profiles_differ_in_everything() {
        let profiles: Vec<Profile> = (0..200).map(Profile::random).collect();
        let orders = profiles.iter().map(|it| format!("{:?}", it.flag_order));
        assert_eq!(orders.collect::<std::collections::BTreeSet<_>>().len(), 6);
        for is_so in [
            |it: &Profile| it.idle_level == 1,
            |it: &Profile| it.crc.refin,
            |it: &Profile| it.crc.refin == it.crc.refout,
            |it: &Profile| it.lbw.mask == Word(0xFFFF),
            |it: &Profile| it.crc.covers_lbw,
        ] {
            assert!((20..200).contains(&profiles.iter().filter(|it| is_so(it)).count()));
        }
    }
}
