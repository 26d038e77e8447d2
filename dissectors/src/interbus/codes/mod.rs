//! The findings of INTERBUS.

mod line;

use crate::finding::Code;

pub(super) use line::{CRC, LINE, RESET};

/// All of them.
pub static CODES: [&Code; 3] = [&CRC, &RESET, &LINE];
