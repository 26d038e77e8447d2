//! What Saleae Logic 2 exports (support.saleae.com: "Data export", "Binary export format").

pub mod binary;
pub mod digital;
pub mod table;
mod time;
mod value;

use super::InputFormat;
use super::rows::without_mark;

/// Which export a source is, if its first line or magic is that of one.
pub fn format_of(head: &[u8]) -> Option<InputFormat> {
    if head.starts_with(binary::MAGIC) {
        return Some(InputFormat::SaleaeBin);
    }
    let head = without_mark(head);
    let end = head.iter().position(|byte| *byte == b'\n')?;
    let line = head[..end].strip_suffix(b"\r").unwrap_or(&head[..end]);
    if table::is_header(line) {
        Some(InputFormat::SaleaeTable)
    } else if digital::is_header(line) {
        Some(InputFormat::SaleaeCsv)
    } else {
        None
    }
}
