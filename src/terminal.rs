//! What goes to a terminal. Names and comments come from outside, and must not steer it.

use std::fmt;
use std::io::{self, Write};

/// Adds text from outside: what would steer a terminal, a line's end included, becomes a dot.
pub fn push_clean(text: &mut String, from: &str) {
    text.extend(from.chars().map(|c| if c.is_control() { '·' } else { c }));
}

/// The same as a text of its own.
pub fn clean(from: &str) -> String {
    let mut text = String::with_capacity(from.len());
    push_clean(&mut text, from);
    text
}

/// Says a line on standard error. Where nobody reads it, that is no error.
pub fn say_line(words: fmt::Arguments<'_>) {
    let _ = writeln!(io::stderr(), "{}", clean(&words.to_string()));
}

/// Says a line on standard error, as `eprintln!` would.
#[macro_export]
macro_rules! say {
    ($($words:tt)*) => { $crate::terminal::say_line(format_args!($($words)*)) };
}
