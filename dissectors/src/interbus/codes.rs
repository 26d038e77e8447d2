//! The findings of INTERBUS.

use crate::finding::Code;

/// All of them.
pub static CODES: [&Code; 0] = [];
