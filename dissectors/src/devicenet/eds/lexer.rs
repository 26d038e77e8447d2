//! Sections, entries and fields of a file.
//!
//! ```text
//! $ comment to the end of the line
//! [Section]
//!     Keyword = field, "text " "and more of it", , 0x1F;
//! ```

use super::warning::{Problem, Warnings};
use alloc::string::String;
use alloc::vec::Vec;

/// Most fields of one entry that are kept.
const MAX_FIELDS: usize = 4096;

/// What a file consists of.
#[derive(PartialEq, Eq, Debug)]
pub(super) enum Item {
    /// A section begins.
    Section(String),
    /// An entry of it.
    Entry(Entry),
}

/// `Keyword = field, field;`
#[derive(PartialEq, Eq, Debug)]
pub(super) struct Entry {
    /// Line of the keyword.
    pub line: u32,
    /// What stands before the equals sign.
    pub keyword: String,
    /// What stands between it and the semicolon.
    pub fields: Vec<Field>,
}

/// One field. An empty one has no text.
#[derive(PartialEq, Eq, Debug)]
pub(super) struct Field {
    /// Line where it begins.
    pub line: u32,
    /// What it says, without quotation marks.
    pub text: String,
}

/// Reads a file from its beginning to its end.
pub(super) struct Lexer<'a> {
    rest: &'a str,
    line: u32,
}

impl<'a> Lexer<'a> {
    pub fn new(text: &'a str) -> Self {
        Lexer { rest: text, line: 1 }
    }

    /// The line that has been reached.
    pub fn line(&self) -> u32 {
        self.line
    }

    /// The next section or entry.
    pub fn next(&mut self, warnings: &mut Warnings) -> Option<Item> {
        loop {
            self.skip_blanks();
            if self.peek()? == '[' {
                return Some(self.section(warnings));
            }
            let line = self.line;
            let keyword = self.take_until(&['=', ';', '[', '$', '"', '\n', '\r']).trim();
            if !keyword.is_empty() && self.peek() == Some('=') {
                let keyword = String::from(keyword);
                self.advance();
                let fields = self.fields(warnings);
                return Some(Item::Entry(Entry { line, keyword, fields }));
            }
            warnings.add(line, Problem::NotUnderstood);
            self.take_until(&['\n']);
        }
    }

    fn section(&mut self, warnings: &mut Warnings) -> Item {
        self.advance();
        let name = self.take_until(&[']', '\n', '$']).trim();
        match self.peek() {
            Some(']') => self.advance(),
            _ => warnings.add(self.line, Problem::MissingBracket),
        }
        Item::Section(name.into())
    }

    /// The fields after the equals sign, and the semicolon. Where it is missing, the entry ends
    /// before the line that begins another one.
    fn fields(&mut self, warnings: &mut Warnings) -> Vec<Field> {
        let mut fields = Vec::new();
        let mut left_out = false;
        let mut field = Field { line: self.line, text: String::new() };
        loop {
            let before = self.line;
            self.skip_blanks();
            let is_new_line = self.line != before;
            match self.peek() {
                Some(';') => {
                    self.advance();
                    break;
                }
                Some(',') => {
                    self.advance();
                    let next = Field { line: self.line, text: String::new() };
                    left_out |= !keep(&mut fields, core::mem::replace(&mut field, next));
                }
                Some(c) if !(is_new_line && (c == '[' || self.is_at_entry())) => {
                    self.part(&mut field, warnings);
                }
                _ => {
                    warnings.add(before, Problem::MissingSemicolon);
                    break;
                }
            }
        }
        if !(fields.is_empty() && field.text.is_empty()) {
            left_out |= !keep(&mut fields, field);
        }
        if left_out {
            warnings.add(self.line, Problem::TooMany(MAX_FIELDS));
        }
        fields
    }

    /// A text or a bare word, which goes on what the field says already.
    fn part(&mut self, field: &mut Field, warnings: &mut Warnings) {
        if field.text.is_empty() {
            field.line = self.line;
        }
        if self.peek() == Some('"') {
            return self.quoted(&mut field.text, warnings);
        }
        let word = self.take_until(&[',', ';', '"', '$', '\n', '\r']).trim();
        if !field.text.is_empty() {
            field.text.push(' ');
        }
        field.text.extend(word.chars().map(printable));
    }

    fn quoted(&mut self, text: &mut String, warnings: &mut Warnings) {
        self.advance();
        loop {
            match self.peek() {
                Some('"') => return self.advance(),
                Some('\n' | '\r') | None => return warnings.add(self.line, Problem::MissingQuote),
                Some('\\') => {
                    self.advance();
                    match self.peek() {
                        Some(c @ ('"' | '\\')) => {
                            text.push(c);
                            self.advance();
                        }
                        Some('n' | 't') => {
                            text.push(' ');
                            self.advance();
                        }
                        _ => text.push('\\'),
                    }
                }
                Some(c) => {
                    text.push(printable(c));
                    self.advance();
                }
            }
        }
    }

    /// Whether `Keyword =` stands here.
    fn is_at_entry(&self) -> bool {
        let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let after = self.rest.trim_start_matches(is_part);
        after.len() < self.rest.len() && after.trim_start_matches([' ', '\t']).starts_with('=')
    }

    /// Skips what is between things: blanks, line ends, comments.
    fn skip_blanks(&mut self) {
        loop {
            match self.peek() {
                Some('$') => {
                    self.take_until(&['\n']);
                }
                // A DOS end-of-file mark is a blank too.
                Some(c) if c.is_whitespace() || c.is_control() => self.advance(),
                _ => return,
            }
        }
    }

    fn peek(&self) -> Option<char> {
        self.rest.chars().next()
    }

    fn advance(&mut self) {
        let mut characters = self.rest.chars();
        if characters.next() == Some('\n') {
            self.line = self.line.saturating_add(1);
        }
        self.rest = characters.as_str();
    }

    /// What stands before any of these characters, none of which may be passed over silently: lines
    /// are counted where they are passed.
    fn take_until(&mut self, ends: &[char]) -> &'a str {
        let end = self.rest.find(ends).unwrap_or(self.rest.len());
        let (taken, rest) = self.rest.split_at(end);
        self.rest = rest;
        taken
    }
}

/// Keeps a field while there is room; whether there was.
fn keep(fields: &mut Vec<Field>, field: Field) -> bool {
    let has_room = fields.len() < MAX_FIELDS;
    if has_room {
        fields.push(field);
    }
    has_room
}

/// Texts come from outside: a blank stands for what could steer a terminal.
fn printable(c: char) -> char {
    if c.is_control() { ' ' } else { c }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::format;
    use alloc::string::ToString;
    use proptest::prelude::*;

    /// A file's items, one a line, and its warnings.
    fn read(text: &str) -> Vec<String> {
        let (mut lexer, mut warnings, mut told) =
            (Lexer::new(text), Warnings::default(), Vec::new());
        while let Some(item) = lexer.next(&mut warnings) {
            told.push(match item {
                Item::Section(name) => format!("[{name}]"),
                Item::Entry(entry) => {
                    let fields: Vec<&str> = entry.fields.iter().map(|f| f.text.as_str()).collect();
                    format!("{} {}={}", entry.line, entry.keyword, fields.join("|"))
                }
            });
        }
        told.extend(warnings.into_list().iter().map(ToString::to_string));
        told
    }

    #[test]
    fn sections_entries_comments_and_fields() {
        let text = "$ made by hand\r\n[Device] $ who\r\n\tVendCode = 468;\r\n\
                    \tProdName = \"AMG \" $ first half\r\n\t\t\"11\", , 0x0A;";
        assert_eq!(read(text), ["[Device]", "3 VendCode=468", "4 ProdName=AMG 11||0x0A"]);
    }

    #[test]
    fn marks_inside_of_texts_are_text() {
        assert_eq!(read("A = \"1; 2, $3 \\\"x\\\" C:\\eds\";"), ["1 A=1; 2, $3 \"x\" C:\\eds"]);
        assert_eq!(read("A = \"a\tb\x1B[0m\";"), ["1 A=a b [0m"]);
    }

    #[test]
    fn an_entry_without_end_ends_where_another_begins() {
        assert_eq!(
            read("A = 1, 2\nB = 3;\nC = 4\n[D]"),
            [
                "1 A=1|2",
                "2 B=3",
                "3 C=4",
                "[D]",
                "line 1: entry without ;",
                "line 3: entry without ;"
            ]
        );
        assert_eq!(read("A = 1,"), ["1 A=1|", "line 1: entry without ;"]);
        assert_eq!(read("A = ;"), ["1 A="]);
    }

    #[test]
    fn what_is_not_understood_costs_its_own_line() {
        assert_eq!(
            read("[File\nhello\n= 3;\nA = 1;\nB = \"open\nC = 2;"),
            [
                "[File]",
                "4 A=1",
                "5 B=open",
                "6 C=2",
                "line 1: section without ]",
                "line 2: not understood",
                "line 3: not understood",
                "line 5: text without its second \"",
                "line 5: entry without ;",
            ]
        );
    }

    #[test]
    fn fields_and_warnings_are_bounded() {
        let read = read(&format!("A = {}1;", "1,".repeat(2 * MAX_FIELDS)));
        assert_eq!(read[0].matches('|').count(), MAX_FIELDS - 1);
        assert_eq!(read[1], "line 1: more than 4096, the rest is left out");
        assert_eq!(self::read(&"?\n".repeat(1000)).len(), 100);
    }

    proptest! {
        #[test]
        fn any_text_is_read_to_its_end(text in "[\\[\\]=;,$\"\\\\ \n\r\tA1µ]{0,60}") {
            read(&text);
        }
    }
}
