//! The three words of SLIN, as parsers over the bytes of a telegram.
//!
//! ```text
//! request     1 0 0 0 0 a a a     control word of the master for encoder a
//! data word   0 d d d d d d d     seven bits of the position, the lowest first
//! footer      1 c c c ? a a a     control word of encoder a with the checksum c
//! ```
//!
//! Data bit 7 tells control words from data words (Baumer SLIN §3.2, TR SLIN §6).

use nom::bytes::complete::take_while;
use nom::combinator::{opt, verify};
use nom::number::complete::u8;
use nom::{IResult, Parser};

/// Data words that a telegram can have (Baumer SLIN §3.2: "max. 4 data bytes").
pub const MAX_DATA_WORDS: usize = 4;

/// Number of encoder addresses.
pub const ADDRESSES: usize = 8;

const CONTROL: u8 = 0x80;
const CHECKSUM: u8 = 0x70;
const BIT3: u8 = 0x08;
const ADDRESS: u8 = 0x07;

/// The address of an encoder, 0 to 7 (TR SLIN §5: Ident 0 to 2).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Address(u8);

impl Address {
    /// The address in the low three bits of a control word.
    #[must_use]
    pub const fn of(control: u8) -> Self {
        Address(control & ADDRESS)
    }

    /// 0 to 7.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }

    /// As an index of a table with [`ADDRESSES`] entries.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// Whether a byte is a control word; a data word otherwise.
#[must_use]
pub const fn is_control(byte: u8) -> bool {
    byte & CONTROL != 0
}

/// A master's request.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Request {
    /// Which encoder is asked.
    pub address: Address,
    /// Bits 4 to 6, which are reserved and low.
    pub reserved: u8,
}

/// The control word that ends a response.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Footer {
    /// Who answered.
    pub address: Address,
    /// Bit 3: high under Baumer ("encoder identification"), reserved under TR.
    pub bit3: bool,
    /// Bits 4 to 6 of the sum of the data words.
    pub checksum: u8,
}

impl Request {
    /// A control word read as a request.
    #[must_use]
    pub const fn of(control: u8) -> Self {
        Request { address: Address::of(control), reserved: (control & CHECKSUM) >> 4 }
    }
}

impl Footer {
    /// A control word read as a footer.
    #[must_use]
    pub const fn of(control: u8) -> Self {
        Footer {
            address: Address::of(control),
            bit3: control & BIT3 != 0,
            checksum: (control & CHECKSUM) >> 4,
        }
    }
}

/// An encoder's response: its data words and, unless the telegram is torn, its footer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Response<'a> {
    /// The data words, the lowest seven bits of the position first.
    pub data: &'a [u8],
    /// The footer.
    pub footer: Option<Footer>,
}

impl Response<'_> {
    /// The position, where the telegram carries one: up to four data words and a footer. No data
    /// word at all is position 0 (neither manual says how position 0 is sent).
    #[must_use]
    pub fn position(&self) -> Option<u32> {
        (self.footer.is_some() && self.data.len() <= MAX_DATA_WORDS).then(|| position(self.data))
    }
}

/// A request: one control word.
///
/// # Errors
/// The input does not begin with a control word.
pub fn request(input: &[u8]) -> IResult<&[u8], Request> {
    control_word.map(Request::of).parse(input)
}

/// A footer: one control word.
///
/// # Errors
/// The input does not begin with a control word.
pub fn footer(input: &[u8]) -> IResult<&[u8], Footer> {
    control_word.map(Footer::of).parse(input)
}

/// A response: data words, then a footer if one is there.
///
/// # Errors
/// None: an empty input is a response without words.
pub fn response(input: &[u8]) -> IResult<&[u8], Response<'_>> {
    let (input, data) = take_while(|byte| !is_control(byte)).parse(input)?;
    let (input, footer) = opt(footer).parse(input)?;
    Ok((input, Response { data, footer }))
}

fn control_word(input: &[u8]) -> IResult<&[u8], u8> {
    verify(u8, |word| is_control(*word)).parse(input)
}

fn position(data: &[u8]) -> u32 {
    data.iter().rev().fold(0, |position, word| position << 7 | u32::from(word & !CONTROL))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worked_example_of_the_tr_manual() {
        // TR SLIN §6: a 13-bit encoder at 0 0000 1001 1010b sends 001 1010b, then 000001b filled
        // with 0. Footer of encoder 0: sum 1Bh, bits 4 to 6 are 001b.
        let (rest, telegram) = response(&[0x1A, 0x01, 0x90, 0x81]).unwrap();
        assert_eq!(telegram.position(), Some(0b1001_1010));
        assert_eq!(
            telegram.footer,
            Some(Footer { address: Address(0), bit3: false, checksum: 0b001 })
        );
        assert_eq!(rest, [0x81]);
    }

    #[test]
    fn a_request_is_a_control_word_with_an_address() {
        assert_eq!(request(&[0x85]).unwrap().1, Request { address: Address(5), reserved: 0 });
        assert_eq!(request(&[0xB0]).unwrap().1, Request { address: Address(0), reserved: 3 });
        assert!(request(&[0x05]).is_err());
        assert!(request(&[]).is_err());
    }

    #[test]
    fn a_torn_or_overlong_response_has_no_position() {
        let torn = response(&[0x1A, 0x01]).unwrap().1;
        assert_eq!((torn.data.len(), torn.footer, torn.position()), (2, None, None));
        let overlong = response(&[1, 2, 3, 4, 5, 0x98]).unwrap().1;
        assert_eq!((overlong.data.len(), overlong.position()), (5, None));
        assert_eq!(response(&[0x88]).unwrap().1.position(), Some(0));
        assert_eq!(response(&[]).unwrap().1.footer, None);
    }

    #[test]
    fn the_largest_position_has_28_bits() {
        let telegram = response(&[0x7F, 0x7F, 0x7F, 0x7F, 0xFF]).unwrap().1;
        assert_eq!(telegram.position(), Some(268_435_455));
    }
}
