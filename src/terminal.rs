//! What goes to a terminal. Names and comments come from outside, and must not steer it.

use std::fmt;
use std::io::{self, IsTerminal, Write};

/// Adds text from outside: what would steer a terminal, a line's end included, becomes a dot.
pub fn push_clean(text: &mut String, from: &str) {
    text.extend(from.chars().map(|c| if steers(c) { '·' } else { c }));
}

/// Does the same to text from outside that was written there, from `start` on.
pub fn clean_from(text: &mut Vec<u8>, start: usize) {
    if !has_steering(&text[start..]) {
        return;
    }
    let cleaned = clean(&String::from_utf8_lossy(&text[start..]));
    text.truncate(start);
    text.extend(cleaned.into_bytes());
}

/// Whether there is any of these in a text, which nearly no text has: told by its bytes, for every
/// cell of a table passes here.
fn has_steering(text: &[u8]) -> bool {
    let after = |index: usize| text.get(index..).unwrap_or_default();
    text.iter().enumerate().any(|(index, byte)| match byte {
        0..=0x1F | 0x7F => true,
        0xC2 => matches!(after(index + 1), [0x80..=0x9F, ..]),
        0xD8 => matches!(after(index + 1), [0x9C, ..]),
        0xE2 => matches!(
            after(index + 1),
            [0x80, 0x8E | 0x8F | 0xAA..=0xAE, ..] | [0x81, 0xA6..=0xA9, ..]
        ),
        _ => false,
    })
}

/// Control characters, and the marks that change the direction of writing (Unicode UAX #9): with
/// them a name shows itself and what follows as something else.
fn steers(c: char) -> bool {
    let turns = matches!(c, '\u{61C}' | '\u{200E}' | '\u{200F}' | '\u{202A}'..='\u{202E}')
        || matches!(c, '\u{2066}'..='\u{2069}');
    c.is_control() || turns
}

/// The same as a text of its own.
pub fn clean(from: &str) -> String {
    let mut text = String::with_capacity(from.len());
    push_clean(&mut text, from);
    text
}

/// Fewest columns that lines are cut to: a terminal that says less has not been asked well.
const NARROWEST: usize = 40;

/// Columns of the terminal that standard output goes to; `None` where it goes elsewhere, and nothing
/// may be left out. COLUMNS says it where it is set.
pub fn width() -> Option<usize> {
    let out = io::stdout();
    let is_terminal = out.is_terminal();
    let said = std::env::var("COLUMNS").ok();
    width_of(is_terminal, said.as_deref(), || window(&out))
}

fn width_of(
    is_terminal: bool,
    said: Option<&str>,
    window: impl FnOnce() -> Option<usize>,
) -> Option<usize> {
    let said = || said?.trim().parse().ok();
    let known = |columns: &usize| *columns > 0;
    let columns = said().filter(known).or_else(|| window().filter(known));
    columns.filter(|_| is_terminal).map(|columns| columns.max(NARROWEST))
}

#[cfg(unix)]
fn window(out: &io::Stdout) -> Option<usize> {
    let size = rustix::termios::tcgetwinsize(out).ok()?;
    Some(usize::from(size.ws_col))
}

#[cfg(not(unix))]
fn window(_: &io::Stdout) -> Option<usize> {
    None
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_cut_for_a_terminal_alone() {
        assert_eq!(width_of(false, Some("80"), || Some(80)), None);
        assert_eq!(width_of(true, None, || Some(173)), Some(173));
        assert_eq!(width_of(true, Some("120"), || Some(173)), Some(120));
        assert_eq!(width_of(true, Some("wide"), || Some(173)), Some(173));
        assert_eq!(width_of(true, Some("0"), || Some(0)), None);
        assert_eq!(width_of(true, None, || Some(3)), Some(NARROWEST));
    }

    /// C0, DEL, C1, and every mark of direction that UAX #9 names.
    #[test]
    fn nothing_that_steers_a_terminal_is_left() {
        let marks = "\u{1B}\u{B}\u{10}\u{12}\r\n\u{7F}\u{85}\u{9B}\u{61C}\u{200E}\u{200F}\u{202A}\
                     \u{202B}\u{202C}\u{202D}\u{202E}\u{2066}\u{2067}\u{2068}\u{2069}";
        for mark in marks.chars() {
            assert_eq!(clean(&format!("can{mark}0")), "can·0", "{mark:?}");
            let mut cell = format!("{mark},can{mark}0").into_bytes();
            let start = mark.len_utf8() + 1;
            clean_from(&mut cell, start);
            assert_eq!(String::from_utf8(cell), Ok(format!("{mark},can·0")), "{mark:?}");
        }
        let names = "Größe ±3 µs → „Halle“ Ω 中 é";
        assert_eq!(clean(names), names);
    }
}
