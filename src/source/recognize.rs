//! What a source is, from its first bytes.

use super::{Input, InputFormat, Place, SourceError};
use super::{chars, pcap, pcapng, saleae, sr, vcd};

/// Finds the format of a source from as few bytes as tell it.
///
/// # Errors
/// Nothing tells it, or it cannot be read.
pub fn format_of(input: &mut Input) -> Result<InputFormat, SourceError> {
    loop {
        if let Some(format) = recognize(input.head()) {
            return Ok(format);
        }
        if !input.look_further()? {
            let what = "nothing tells which format this is: name it with --input-format";
            return Err(SourceError::new(&input.name, Place::Byte(0), what));
        }
    }
}

fn recognize(head: &[u8]) -> Option<InputFormat> {
    let formats = [
        (pcapng::is_pcapng(head), InputFormat::Pcapng),
        (pcap::is_pcap(head), InputFormat::Pcap),
        (sr::is_zip(head), InputFormat::Sr),
        (vcd::is_dump(head), InputFormat::Vcd),
        (chars::is_header(head), InputFormat::Chars),
    ];
    let found = formats.into_iter().find(|(is_it, _)| *is_it).map(|(_, format)| format);
    found.or_else(|| saleae::format_of(head))
}
