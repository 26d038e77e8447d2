//! `--line-profile FILE`: what is known of the format of a ring's line, as TOML. Every key may be
//! left out: then it is found, or stays undecided. `stats --format json` shows all of them.
//!
//! ```toml
//! bitrate = 500000
//! idle_level = 1
//! flag_order = ["SL", "CR", "TYPE"]
//! id_value = 1
//! check_value = 1
//! status_value = 0
//! data_bit_order = "msb"
//! lbw = "B5E3"
//! lbw_mask = "FFF0"
//! silence_reset_ms = 25
//!
//! [crc]
//! init = "FFFF"
//! refin = false
//! refout = false
//! xorout = "0000"
//! byte_order = "hi-lo"
//! covers_lbw = true
//!
//! [[ring]]
//! width_bits = 32
//! name = "saw"
//! decoder = "la66:500mm"
//! ```

use crate::config;
use anyhow::{Context, bail};
use dissectors::device::Profile as DeviceProfile;
use dissectors::interbus::line::{BitOrder, CrcProfile, Flag, Loopback, Profile, RingDevice};
use serde::Deserialize;
use std::fs;
use std::io::Read;
use std::path::Path;

/// Bytes of a profile that are believed.
const LONGEST_FILE: u64 = 1 << 20;

/// Devices of a ring at most, and bits of a register: 32 words.
const MAX_DEVICES: usize = 512;
const MAX_WIDTH: u16 = 512;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    bitrate: Option<u32>,
    idle_level: Option<u8>,
    flag_order: Option<[String; 3]>,
    id_value: Option<u8>,
    check_value: Option<u8>,
    status_value: Option<u8>,
    data_bit_order: Option<Order>,
    stop_bits_min: Option<u8>,
    lbw: Option<String>,
    lbw_mask: Option<String>,
    #[serde(default)]
    crc: Crc,
    cntr_bytes: Option<u8>,
    silence_reset_ms: Option<u32>,
    #[serde(default)]
    ring: Vec<Device>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
enum Order {
    Msb,
    Lsb,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct Crc {
    poly: Option<String>,
    init: Option<String>,
    refin: Option<bool>,
    refout: Option<bool>,
    xorout: Option<String>,
    byte_order: Option<Bytes>,
    covers_lbw: Option<bool>,
}

#[derive(Deserialize, Clone, Copy)]
enum Bytes {
    #[serde(rename = "hi-lo")]
    HighFirst,
    #[serde(rename = "lo-hi")]
    LowFirst,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Device {
    width_bits: u16,
    name: Option<String>,
    decoder: Option<String>,
}

/// Devices of the ring that the profile names a decoder for.
pub type Named = Vec<(u16, DeviceProfile)>;

/// Reads a profile.
///
/// # Errors
/// It cannot be read, is no TOML, or says something that cannot be.
pub fn read(path: &Path) -> anyhow::Result<(Profile, Named)> {
    let file = path.display();
    let mut text = String::new();
    let read = fs::File::open(path)
        .and_then(|file| file.take(LONGEST_FILE).read_to_string(&mut text))
        .with_context(|| format!("{file}: cannot be read"))?;
    if read as u64 == LONGEST_FILE {
        bail!("{file}: this is larger than any profile of a line");
    }
    let parsed: File = config::parse(&text).with_context(|| format!("{file}: not understood"))?;
    parsed.known().with_context(|| format!("{file}: not a profile of a line"))
}

impl File {
    fn known(self) -> anyhow::Result<(Profile, Named)> {
        let bitrate = self.bitrate;
        if bitrate == Some(0) {
            bail!("bitrate: bit/s, such as 500000");
        }
        if self.ring.len() > MAX_DEVICES {
            bail!("ring: {MAX_DEVICES} devices at most");
        }
        let within = |what: &str, number: Option<u8>, range: std::ops::RangeInclusive<u8>| {
            let (first, last) = (*range.start(), *range.end());
            match number.filter(|number| !range.contains(number)) {
                Some(number) => bail!("{what} = {number}: it is from {first} to {last}"),
                None => Ok(number),
            }
        };
        let bit =
            |what, number| Ok::<_, anyhow::Error>(within(what, number, 0..=1)?.map(|it| it == 1));
        let named = self.ring.iter().zip(1..).filter_map(|(device, number)| {
            device.decoder.as_deref().map(|decoder| decoder_of(number, decoder))
        });
        let named = named.collect::<anyhow::Result<Named>>()?;
        let profile = Profile {
            bitrate,
            idle_level: bit("idle_level", self.idle_level)?,
            flag_order: self.flag_order.map(order_of).transpose()?,
            id_value: bit("id_value", self.id_value)?,
            check_value: bit("check_value", self.check_value)?,
            status_value: bit("status_value", self.status_value)?,
            data_bit_order: self.data_bit_order.map(|order| match order {
                Order::Msb => BitOrder::Msb,
                Order::Lsb => BitOrder::Lsb,
            }),
            stop_bits_min: within("stop_bits_min", self.stop_bits_min, 1..=2)?,
            loopback: loopback(self.lbw.as_deref(), self.lbw_mask.as_deref())?,
            crc: self.crc.known()?,
            cntr_bytes: within("cntr_bytes", self.cntr_bytes, 0..=4)?,
            silence_reset_ms: self.silence_reset_ms,
            ring: self.ring.into_iter().map(Device::known).collect::<anyhow::Result<_>>()?,
        };
        Ok((profile, named))
    }
}

fn decoder_of(number: u16, decoder: &str) -> anyhow::Result<(u16, DeviceProfile)> {
    match DeviceProfile::parse(decoder).filter(|profile| profile.may_be_at(number)) {
        Some(profile) => Ok((number, profile)),
        None => bail!("decoder = \"{decoder}\": it is one of {}", DeviceProfile::FORMS.join(", ")),
    }
}

fn order_of(names: [String; 3]) -> anyhow::Result<[Flag; 3]> {
    let flags: Vec<Flag> = names.iter().filter_map(|name| Flag::named(name)).collect();
    let flags: Option<[Flag; 3]> = flags.try_into().ok();
    let is_whole = |flags: &[Flag; 3]| Flag::USUAL.iter().all(|flag| flags.contains(flag));
    flags.filter(is_whole).context("flag_order: SL, CR and TYPE, in the order they are sent")
}

fn hex(what: &str, text: &str) -> anyhow::Result<u16> {
    u16::from_str_radix(text, 16).with_context(|| format!("{what}: four hex digits, such as B5E3"))
}

fn loopback(value: Option<&str>, mask: Option<&str>) -> anyhow::Result<Option<Loopback>> {
    let mask = mask.map(|mask| hex("lbw_mask", mask)).transpose()?;
    let value = value.map(|value| hex("lbw", value)).transpose()?;
    match (value, mask) {
        (None, Some(_)) => bail!("lbw_mask means nothing without lbw"),
        (value, mask) => {
            let mask = mask.unwrap_or(0xFFFF);
            Ok(value.map(|value| Loopback { value: value & mask, mask }))
        }
    }
}

impl Crc {
    fn known(self) -> anyhow::Result<CrcProfile> {
        let word = |what, text: Option<String>| text.map(|text| hex(what, &text)).transpose();
        if word("crc.poly", self.poly)?.is_some_and(|poly| poly != 0x1021) {
            bail!("crc.poly: 1021, as the documents have it");
        }
        Ok(CrcProfile {
            init: word("crc.init", self.init)?,
            refin: self.refin,
            refout: self.refout,
            xorout: word("crc.xorout", self.xorout)?,
            is_low_first: self.byte_order.map(|order| matches!(order, Bytes::LowFirst)),
            covers_loopback: self.covers_lbw,
        })
    }
}

impl Device {
    fn known(self) -> anyhow::Result<RingDevice> {
        let Device { width_bits, name, .. } = self;
        if width_bits > MAX_WIDTH {
            bail!("width_bits = {width_bits}: a register has {MAX_WIDTH} bits at most");
        }
        Ok(RingDevice { width_bits, name })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> anyhow::Result<(Profile, Named)> {
        let file = tempfile::NamedTempFile::new()?;
        fs::write(file.path(), text)?;
        read(file.path())
    }

    #[test]
    fn everything_can_be_said() {
        let (profile, named) = parse(
            "bitrate = 2000000\nidle_level = 0\nflag_order = [\"TYPE\", \"SL\", \"CR\"]\n\
             id_value = 1\ncheck_value = 0\nstatus_value = 1\ndata_bit_order = \"lsb\"\n\
             stop_bits_min = 2\nlbw = \"B5E3\"\nlbw_mask = \"FFF0\"\ncntr_bytes = 2\n\
             silence_reset_ms = 20\n[crc]\npoly = \"1021\"\ninit = \"FFFF\"\nrefin = true\n\
             byte_order = \"lo-hi\"\n[[ring]]\nwidth_bits = 16\n[[ring]]\nwidth_bits = 32\n\
             name = \"saw\"\ndecoder = \"la66:500mm\"\n",
        )
        .unwrap();
        assert_eq!((profile.bitrate, profile.idle_level), (Some(2_000_000), Some(false)));
        assert_eq!(profile.flag_order, Some([Flag::Type, Flag::Select, Flag::Control]));
        assert_eq!(profile.loopback, Some(Loopback { value: 0xB5E0, mask: 0xFFF0 }));
        assert_eq!((profile.crc.init, profile.crc.is_low_first), (Some(0xFFFF), Some(true)));
        assert_eq!(profile.ring[1].name.as_deref(), Some("saw"));
        assert_eq!(named, [(2, DeviceProfile::parse("la66:500mm").unwrap())]);
        assert_eq!(parse("").unwrap().0, Profile::default());
    }

    #[test]
    fn what_cannot_be_is_said() {
        for (text, what) in [
            ("idle_level = 2\n", "from 0 to 1"),
            ("flag_order = [\"SL\", \"SL\", \"CR\"]\n", "SL, CR and TYPE"),
            ("lbw_mask = \"FFF0\"\n", "nothing without lbw"),
            ("lbw = \"B5E3F\"\n", "four hex digits"),
            ("[crc]\npoly = \"8005\"\n", "1021"),
            ("[[ring]]\nwidth_bits = 600\n", "512 bits at most"),
            ("[[ring]]\nwidth_bits = 32\ndecoder = \"la67\"\n", "one of baumer-encoder"),
            ("bits = 12\n", "unknown field \"bits\": expected bitrate, idle_level"),
        ] {
            let error = format!("{:#}", parse(text).unwrap_err());
            assert!(error.contains(what), "{text:?}: {error}");
        }
    }
}
