//! Characters in pcapng: LINKTYPE_RTAC_SERIAL.
//!
//! A 12-byte header (seconds, microseconds, event, line state, all big-endian) and the bytes. A
//! block is a run of good characters that follow each other; a bad character is a block of its own.
//! The block's stamp, in ns, is the first start bit.

use super::blocks::{duration, unsupported};
use dissectors::event::{LossCause, Moment};
use dissectors::record::BusInfo;
use dissectors::uart::{Character, Format, Parity, ParityMarks, Wire};
use std::io;

/// Events of the RTAC header.
const DATA: u8 = 0x02;
const LOST: u8 = 0x05;
const FRAMING_ERROR: u8 = 0x07;
const PARITY_ERROR: u8 = 0x08;
/// A break.
pub const BREAK: u8 = 0x09;
const OVERFLOW: u8 = 0x0A;

/// What the interface's comment says of the characters, whose format may not be known.
///
/// # Errors
/// They do not fit into this form.
pub fn note(bus: &BusInfo, parity: ParityMarks, format: Option<Format>) -> io::Result<String> {
    let mut note = format!(" parity={}", parity.name());
    if let Some(format) = format {
        if format.data_bits() > 8 {
            return Err(unsupported(format!(
                "{} has {} data bits a character, and serial pcapng holds eight: write CSV or JSON",
                bus.name,
                format.data_bits()
            )));
        }
        note.push_str(&format!(" format={format}"));
    }
    Ok(note)
}

/// What an interface must tell of parity so that this character is read as what it is: what its bus
/// tells, where that will do.
pub fn marks_for(character: &Character, bus: ParityMarks) -> ParityMarks {
    use ParityMarks::{Character, None, Packet};
    match (character.parity(), bus) {
        // With a framing error nothing is told of parity.
        _ if character.has_framing_error() => bus,
        (Parity::None, bus) => bus,
        (Parity::Unknown, _) => None,
        (Parity::Ok, Packet) | (Parity::Suspect, _) => Packet,
        // A mark is an error even where a good character is not known to be one.
        (Parity::Error, None) => None,
        (Parity::Ok | Parity::Error, _) => Character,
    }
}

/// Checks that the interface can tell what these characters say, once it told what is known of
/// parity.
///
/// # Errors
/// It cannot.
pub fn check(characters: &[Character], bus: &BusInfo) -> io::Result<()> {
    if characters.iter().all(|character| marks_for(character, bus.parity) == bus.parity) {
        return Ok(());
    }
    let what = "parity is known of some characters and not of others, which serial pcapng cannot \
                hold: write chars, CSV or JSON";
    Err(unsupported(what.to_owned()))
}

/// The bytes of a block with a run of characters.
///
/// # Errors
/// Its time does not fit into this form.
pub fn compose(run: &[Character], data: &mut Vec<u8>) -> io::Result<()> {
    let Some(first) = run.first() else { return Ok(()) };
    let event = match (first.has_framing_error(), first.parity()) {
        (true, _) => FRAMING_ERROR,
        (false, Parity::Error | Parity::Suspect) => PARITY_ERROR,
        (false, _) => DATA,
    };
    compose_event(first.start, event, data)?;
    data.extend(run.iter().map(Character::byte));
    Ok(())
}

/// The bytes of a block without characters.
///
/// # Errors
/// Its time does not fit into this form.
pub fn compose_event(start: Moment, event: u8, data: &mut Vec<u8>) -> io::Result<()> {
    let stamp = duration(start)?;
    let seconds = u32::try_from(stamp.as_secs()).unwrap_or(u32::MAX);
    data.clear();
    data.extend_from_slice(&seconds.to_be_bytes());
    data.extend_from_slice(&stamp.subsec_micros().to_be_bytes());
    data.extend_from_slice(&[event, 0, 0, 0]);
    Ok(())
}

/// The event that tells of a loss.
pub const fn event_of(cause: LossCause) -> u8 {
    match cause {
        LossCause::Overrun => OVERFLOW,
        _ => LOST,
    }
}

/// Characters divided into the runs that a block each can hold. A start may be off by `off_by` ns
/// from the time that a reader of the block gives it, by the stamp's ± and by half a bit: the least of
/// these counts.
pub fn runs(mut rest: &[Character], wire: Wire, off_by: i64) -> impl Iterator<Item = &[Character]> {
    std::iter::from_fn(move || {
        let (run, behind) = rest.split_at(length_of_run(rest, wire, off_by));
        rest = behind;
        (!run.is_empty()).then_some(run)
    })
}

/// How many characters from the first on can be told by one stamp: good ones that follow each
/// other at the frame's length.
fn length_of_run(characters: &[Character], wire: Wire, off_by: i64) -> usize {
    let [first, others @ ..] = characters else { return 0 };
    let is_plain =
        |character: &Character| !character.is_damaged() && character.parity() != Parity::Suspect;
    let (Some(baud), true) = (wire.baud(), is_plain(first)) else { return 1 };
    let half_bit = baud.bits_ns(1).cast_signed() / 2;
    let off_by = i64::from(first.uncertainty).min(half_bit).min(off_by);
    let follows = |(index, character): &(u32, &Character)| {
        let rebuilt = baud.bits_ns(wire.format().bits() * (index + 1)).cast_signed();
        let start = character.start.since(first.start);
        is_plain(character) && start.is_some_and(|start| (start - rebuilt).abs() <= off_by)
    };
    1 + (0..).zip(others).take_while(follows).count()
}
