//! Values of a character as Logic displays them, and so exports them.

use super::super::numbers::whole;
use nom::IResult;
use nom::Parser;
use nom::branch::alt;
use nom::bytes::complete::{tag, take_while1};
use nom::character::complete::digit1;
use nom::combinator::map_opt;
use nom::sequence::{delimited, preceded};

/// Most data bits of a character.
const MOST_BITS: u32 = 9;

/// How values are displayed, where they do not show it themselves.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Display {
    /// As numbers: `7` is 7.
    Numbers,
    /// As ASCII text: `7` is 37h.
    Text,
}

/// Reads `0x36`, `0b00110110`, `54` or `6`, and the names of what cannot be seen: `\n`, `'10'`,
/// `COMMA`. `None` for anything else, or more than nine bits.
pub fn value(field: &[u8], display: Display) -> Option<u16> {
    let value = match display {
        Display::Numbers => whole(number, field).or_else(|| text(field)),
        Display::Text => text(field).or_else(|| whole(number, field)),
    };
    value.filter(|value| value >> MOST_BITS == 0)
}

/// Whether a value can only be a number, whatever the display.
pub fn is_number(field: &[u8]) -> bool {
    whole(number, field).is_some()
}

fn number(field: &[u8]) -> IResult<&[u8], u16> {
    alt((
        preceded(tag("0x"), digits(16)),
        preceded(tag("0X"), digits(16)),
        preceded(tag("0b"), digits(2)),
        digits(10),
    ))
    .parse(field)
}

fn digits<'a>(
    radix: u32,
) -> impl Parser<&'a [u8], Output = u16, Error = nom::error::Error<&'a [u8]>> {
    let digits = take_while1(move |byte: u8| char::from(byte).is_digit(radix));
    map_opt(digits, move |digits: &[u8]| {
        u16::from_str_radix(std::str::from_utf8(digits).ok()?, radix).ok()
    })
}

fn text(field: &[u8]) -> Option<u16> {
    match field {
        [byte] => return Some(u16::from(*byte)),
        b"\\0" => return Some(0),
        b"\\t" => return Some(9),
        b"\\n" => return Some(10),
        b"\\r" => return Some(13),
        b"\\\\" => return Some(u16::from(b'\\')),
        b"' '" => return Some(u16::from(b' ')),
        b"COMMA" => return Some(u16::from(b',')),
        _ => {}
    }
    let quoted = |field| delimited(tag("'"), map_opt(digit1, decimal), tag("'")).parse(field);
    let escaped = |field| preceded(tag("\\x"), digits(16)).parse(field);
    whole(quoted, field).or_else(|| whole(escaped, field)).or_else(|| latin(field))
}

fn decimal(digits: &[u8]) -> Option<u16> {
    std::str::from_utf8(digits).ok()?.parse().ok()
}

/// One character behind ASCII, such as `µ`: its number in Unicode and ISO 8859-1.
fn latin(field: &[u8]) -> Option<u16> {
    let mut characters = std::str::from_utf8(field).ok()?.chars();
    let only = characters.next().filter(|_| characters.next().is_none())?;
    u8::try_from(only).ok().map(u16::from)
}
