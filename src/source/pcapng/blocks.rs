//! The blocks of a pcapng file, before anybody looks into them.
//!
//! `pcap_file` takes the blocks apart. It decodes what changes its own state strictly, so that one
//! name in another character set would end the capture: here the blocks stay raw, and what is in
//! them is looked at field by field.

use super::super::stream::Stream;
use super::super::{Input, SourceError};
use super::fields::Order;
use byteorder_slice::{BigEndian, LittleEndian};
use pcap_file::Endianness;
use pcap_file::pcapng::RawBlock;
use pcap_file::pcapng::blocks::SECTION_HEADER_BLOCK;

/// Type, length, and the first bytes of the body, which tell a section's byte order.
const HEAD: usize = 12;

/// Longest block that is believed, in bytes: what Wireshark takes, too.
const LONGEST: u32 = 16 * 1024 * 1024;

const BYTE_ORDER_MAGIC: u32 = 0x1A2B_3C4D;

/// A reader of blocks.
pub struct Blocks {
    stream: Stream,
    order: Order,
    number: u64,
}

/// A block: its type, and its body in the byte order of its section.
pub struct Block<'a> {
    pub kind: u32,
    pub order: Order,
    pub body: &'a [u8],
}

impl Blocks {
    /// The blocks of this input.
    pub fn new(input: Input) -> Self {
        Blocks { stream: Stream::new(input), order: Order(Endianness::Big), number: 0 }
    }

    /// The source, as the user named it.
    pub fn name(&self) -> &str {
        self.stream.name()
    }

    /// An error in the block that was looked at last.
    pub fn error(&self, what: impl std::fmt::Display) -> SourceError {
        self.stream.error(format!("block {}: {what}", self.number))
    }

    /// Makes the next block the one to look at, and returns its length; `None` at the end.
    ///
    /// # Errors
    /// It cannot be read, is damaged, or is not whole.
    pub fn find(&mut self) -> Result<Option<usize>, SourceError> {
        let head = self.stream.ahead(HEAD)?;
        if head.is_empty() {
            return Ok(None);
        }
        self.number += 1;
        let Some((&[a, b, c, d, e, f, g, h, magic @ ..], _)) = head.split_first_chunk::<HEAD>()
        else {
            return Err(self.cut(HEAD));
        };
        let is_section = u32::from_be_bytes([a, b, c, d]) == SECTION_HEADER_BLOCK;
        if is_section {
            self.order = Order(match u32::from_be_bytes(magic) {
                BYTE_ORDER_MAGIC => Endianness::Big,
                swapped if swapped.swap_bytes() == BYTE_ORDER_MAGIC => Endianness::Little,
                _ => return Err(self.error("a section without a byte order: the file is damaged")),
            });
        }
        if self.number == 1 && !is_section {
            return Err(self.error("no section begins here: this is not pcapng"));
        }
        let length = self.order.u32([e, f, g, h]);
        if !length.is_multiple_of(4) || !(HEAD as u32..=LONGEST).contains(&length) {
            let what = format!("claims to have {length} bytes: the file is damaged here");
            return Err(self.error(what));
        }
        let length = length as usize;
        if self.stream.ahead(length)?.len() < length {
            return Err(self.cut(length));
        }
        Ok(Some(length))
    }

    /// Whether the next block need not be waited for. A section's is, to learn its byte order.
    pub fn is_next_held(&self) -> bool {
        let held = self.stream.held();
        let Some((&[a, b, c, d, e, f, g, h, ..], _)) = held.split_first_chunk::<HEAD>() else {
            return false;
        };
        let is_section = u32::from_be_bytes([a, b, c, d]) == SECTION_HEADER_BLOCK;
        !is_section && held.len() >= self.order.u32([e, f, g, h]) as usize
    }

    /// The block of that length that was found.
    ///
    /// # Errors
    /// It is damaged.
    pub fn found(&self, length: usize) -> Result<Block<'_>, SourceError> {
        let whole = self.stream.held();
        let parsed = match self.order.0 {
            Endianness::Big => RawBlock::from_slice::<BigEndian>(whole),
            Endianness::Little => RawBlock::from_slice::<LittleEndian>(whole),
        };
        let body = whole.get(8..length - 4).unwrap_or_default();
        match parsed {
            Ok((_, raw)) => Ok(Block { kind: raw.type_, order: self.order, body }),
            Err(_) => Err(self.error("its length differs at its two ends: the file is damaged")),
        }
    }

    /// Goes on behind a block.
    pub fn take(&mut self, length: usize) {
        self.stream.take(length);
    }

    fn cut(&self, wanted: usize) -> SourceError {
        let there = self.stream.held().len();
        self.stream.error(format!(
            "the file ends inside block {}: {there} of {wanted} bytes are there, it was cut",
            self.number
        ))
    }
}
