//! From the entries of a file to what it tells.

use super::layout::{Assembly, Carried, Content, Format, Member, Mode};
use super::lexer::{Entry, Item, Lexer};
use super::parameter::{Parameter, Scaling};
use super::warning::{Problem, Warning, Warnings};
use super::{Eds, MAX_FILE};
use crate::devicenet::cip::{DataType, Path, Target};
use alloc::collections::{BTreeMap, btree_map::Entry as Place};
use alloc::string::String;
use alloc::vec::Vec;

/// Most names of values, and most members of assemblies, that are kept of one file.
const MAX_PARTS: usize = 65_536;

/// Longest path in bytes.
const MAX_PATH: usize = 64;

/// Bits of a parameter's descriptor (CIP Vol. 1 §5-14).
const SCALED: u16 = 0x04;
const READ_ONLY: u16 = 0x10;

pub(super) fn parse(text: &str, is_cut: bool) -> (Eds, Vec<Warning>) {
    let mut lexer = Lexer::new(text);
    let mut parser = Parser::default();
    let mut section = Section::Other;
    while let Some(item) = lexer.next(&mut parser.warnings) {
        match item {
            Item::Section(name) => section = Section::of(&name),
            Item::Entry(entry) => parser.entry(section, &entry),
        }
    }
    if is_cut {
        parser.warnings.add(lexer.line(), Problem::TooLarge(MAX_FILE));
    }
    parser.finish()
}

/// Sections that tell something of use.
#[derive(Clone, Copy)]
enum Section {
    Device,
    IoInfo,
    Params,
    EnumPar,
    Assembly,
    Other,
}

impl Section {
    fn of(name: &str) -> Self {
        match name.to_ascii_lowercase().as_str() {
            "device" => Section::Device,
            "io_info" => Section::IoInfo,
            "params" => Section::Params,
            "enumpar" => Section::EnumPar,
            "assembly" => Section::Assembly,
            _ => Section::Other,
        }
    }
}

/// What the values of a parameter are called. Old files do not number them.
struct Words {
    line: u32,
    words: Vec<(Option<i64>, String)>,
}

#[derive(Default)]
struct Parser {
    eds: Eds,
    warnings: Warnings,
    words: BTreeMap<u16, Words>,
    /// Lines of what the modes carry.
    mode_lines: [u32; 4],
    parts: usize,
}

/// The fields of an entry, read with warnings.
struct Fields<'a> {
    entry: &'a Entry,
    warnings: &'a mut Warnings,
}

impl Fields<'_> {
    /// A text; an empty one where there is none.
    fn text(&self, index: usize) -> &str {
        self.entry.fields.get(index).map_or("", |field| field.text.as_str())
    }

    fn warn(&mut self, index: usize, problem: Problem) {
        let line = self.entry.fields.get(index).map_or(self.entry.line, |field| field.line);
        self.warnings.add(line, problem);
    }

    /// A whole number; `None` where the field is empty or holds none.
    fn number<T: TryFrom<i64>>(&mut self, index: usize) -> Option<T> {
        let text = self.text(index);
        if text.is_empty() {
            return None;
        }
        let Some(number) = number(text) else {
            self.warn(index, Problem::NoNumber(index + 1));
            return None;
        };
        let number = number.try_into().ok();
        if number.is_none() {
            self.warn(index, Problem::NumberOutOfRange(index + 1));
        }
        number
    }

    /// A path of hex digits, as bytes.
    fn path(&mut self, index: usize) -> Vec<u8> {
        let text = self.text(index);
        if text.is_empty() {
            return Vec::new();
        }
        let bytes = hex(text).filter(|bytes| Path::parse(bytes).is_some());
        bytes.unwrap_or_else(|| {
            self.warn(index, Problem::NoPath(index + 1));
            Vec::new()
        })
    }

    fn target(&mut self, index: usize) -> Option<Target> {
        Path::parse(&self.path(index))?.target()
    }
}

impl Parser {
    fn entry(&mut self, section: Section, entry: &Entry) {
        match section {
            Section::Device => self.device(entry),
            Section::IoInfo => self.io(entry),
            Section::Params => match numbered(&entry.keyword, "Param") {
                Some(number) => self.parameter(number, entry),
                None => self.enumeration(numbered(&entry.keyword, "Enum"), entry),
            },
            Section::EnumPar => self.old_enumeration(numbered(&entry.keyword, "Param"), entry),
            Section::Assembly => self.assembly(entry),
            Section::Other => {}
        }
    }

    fn device(&mut self, entry: &Entry) {
        let device = &mut self.eds.device;
        let mut fields = Fields { entry, warnings: &mut self.warnings };
        match entry.keyword.to_ascii_lowercase().as_str() {
            "vendcode" => device.vendor = fields.number(0),
            "vendname" => device.vendor_name = fields.text(0).into(),
            "prodtype" => device.device_type = fields.number(0),
            "prodcode" => device.product_code = fields.number(0),
            "majrev" => device.major_revision = fields.number(0),
            "minrev" => device.minor_revision = fields.number(0),
            "prodname" => device.product_name = fields.text(0).into(),
            _ => {}
        }
    }

    fn io(&mut self, entry: &Entry) {
        let io = &mut self.eds.io;
        let mut fields = Fields { entry, warnings: &mut self.warnings };
        let mode = match entry.keyword.to_ascii_lowercase().as_str() {
            "default" => return io.default = fields.number(0),
            "pollinfo" => Mode::Poll,
            "strobeinfo" => Mode::Strobe,
            "cosinfo" => Mode::Cos,
            "cyclicinfo" => Mode::Cyclic,
            keyword => {
                let (formats, number) = match numbered(keyword, "input") {
                    Some(number) => (&mut io.inputs, number),
                    None => match numbered(keyword, "output") {
                        Some(number) => (&mut io.outputs, number),
                        None => return,
                    },
                };
                let format = format(&mut fields);
                insert(formats, number, format, entry.line, &mut self.warnings);
                return;
            }
        };
        let input = fields.number(1).unwrap_or(0);
        let output = fields.number(2).unwrap_or(0);
        io.modes[mode as usize] = Some(Carried { input, output });
        self.mode_lines[mode as usize] = entry.line;
    }

    /// `ParamN = 0, path size, "path", descriptor, type, size, "name", "units", "help", min, max,
    /// default, mult, div, base, offset, four links, decimals;`
    fn parameter(&mut self, number: u16, entry: &Entry) {
        let mut fields = Fields { entry, warnings: &mut self.warnings };
        let descriptor: u16 = fields.number(3).unwrap_or(0);
        let size: Option<u16> = fields.number(5);
        let parameter = Parameter {
            target: fields.target(2),
            kind: data_type(&mut fields, size),
            size,
            name: fields.text(6).into(),
            unit: fields.text(7).into(),
            help: fields.text(8).into(),
            // Bounds of a parameter with a fraction are no whole numbers: that is no slip.
            minimum: self::number(fields.text(9)),
            maximum: self::number(fields.text(10)),
            scaling: if descriptor & SCALED != 0 { scaling(&mut fields) } else { None },
            decimals: fields.number(20).unwrap_or(0),
            is_read_only: descriptor & READ_ONLY != 0,
            words: Vec::new(),
        };
        let target = parameter.target;
        if insert(&mut self.eds.parameters, number, parameter, entry.line, &mut self.warnings)
            && let Some(target) = target
        {
            self.eds.by_target.entry(target).or_insert(number);
        }
    }

    /// `EnumN = value, "text", value, "text";`
    fn enumeration(&mut self, number: Option<u16>, entry: &Entry) {
        let Some(number) = number else { return };
        let mut fields = Fields { entry, warnings: &mut self.warnings };
        let pairs = (0..entry.fields.len() / 2).map(|pair| 2 * pair);
        let words = pairs.filter_map(|index| {
            let value = fields.number(index)?;
            Some((Some(value), String::from(fields.text(index + 1))))
        });
        let words = words.collect();
        self.keep_words(number, entry.line, words);
    }

    /// `ParamN = "text of the lowest value", "text of the next", ..;`
    fn old_enumeration(&mut self, number: Option<u16>, entry: &Entry) {
        let Some(number) = number else { return };
        let words = entry.fields.iter().map(|field| (None, field.text.clone())).collect();
        self.keep_words(number, entry.line, words);
    }

    fn keep_words(&mut self, number: u16, line: u32, mut words: Vec<(Option<i64>, String)>) {
        words.truncate(self.room(words.len(), line));
        insert(&mut self.words, number, Words { line, words }, line, &mut self.warnings);
    }

    /// How many of so many parts still have room.
    fn room(&mut self, parts: usize, line: u32) -> usize {
        let room = parts.min(MAX_PARTS - self.parts);
        if room < parts {
            self.warnings.add(line, Problem::TooMany(MAX_PARTS));
        }
        self.parts += room;
        room
    }

    /// `AssemN = "name", "path", size, descriptor, , , bits, reference, bits, reference, ..;`
    fn assembly(&mut self, entry: &Entry) {
        let Some(number) = numbered(&entry.keyword, "Assem") else { return };
        let mut fields = Fields { entry, warnings: &mut self.warnings };
        let path = fields.path(1);
        // Files that give no path number their assemblies by instance.
        let instance = Path::parse(&path).and_then(Path::assembly).unwrap_or(number);
        let name = fields.text(0).into();
        let size = fields.number(2);
        let mut members = Vec::new();
        for index in (6..entry.fields.len()).step_by(2) {
            if fields.text(index).is_empty() && fields.text(index + 1).is_empty() {
                continue;
            }
            members.push(Member {
                bits: fields.number(index),
                content: content(&mut fields, index + 1),
            });
        }
        members.truncate(self.room(members.len(), entry.line));
        let assembly = Assembly { name, instance, size, members };
        insert(&mut self.eds.assemblies, instance, assembly, entry.line, &mut self.warnings);
    }

    /// Joins what the file tells in several places.
    fn finish(mut self) -> (Eds, Vec<Warning>) {
        for (number, Words { line, words }) in core::mem::take(&mut self.words) {
            let Some(parameter) = self.eds.parameters.get_mut(&number) else {
                self.warnings.add(line, Problem::NothingReferredTo);
                continue;
            };
            let lowest = parameter.minimum.unwrap_or(0);
            let numbered = (0..).zip(words).map(|(index, (value, word))| {
                (value.unwrap_or_else(|| lowest.saturating_add(index)), word)
            });
            parameter.words = numbered.collect();
        }
        let io = &self.eds.io;
        for (carried, line) in io.modes.iter().zip(self.mode_lines) {
            let Some(Carried { input, output }) = carried else { continue };
            let is_there = |formats: &BTreeMap<u16, Format>, number| {
                number == 0 || formats.contains_key(&number)
            };
            if !is_there(&io.inputs, *input) || !is_there(&io.outputs, *output) {
                self.warnings.add(line, Problem::NothingReferredTo);
            }
        }
        if self.eds.device.vendor.is_none() || self.eds.device.product_code.is_none() {
            self.warnings.add(1, Problem::NoIdentity);
        }
        (self.eds, self.warnings.into_list())
    }
}

/// `InputN = size, bits, modes, "name", path length, "path", "help";`
fn format(fields: &mut Fields<'_>) -> Format {
    Format {
        size: fields.number(0).unwrap_or(0),
        bits: fields.number(1).unwrap_or(0),
        modes: fields.number(2).unwrap_or(0),
        name: fields.text(3).into(),
        path: fields.path(5),
    }
}

/// The data type in field 5, as far as the data size allows. Small codes are those of files from
/// before CIP.
fn data_type(fields: &mut Fields<'_>, size: Option<u16>) -> DataType {
    let by_size = match size {
        Some(1) => DataType::Usint,
        Some(2) => DataType::Uint,
        Some(4) => DataType::Udint,
        _ => DataType::Raw,
    };
    let Some(code) = fields.number::<i64>(4) else { return by_size };
    let kind = u8::try_from(code)
        .ok()
        .and_then(|code| DataType::of_code(code).or_else(|| DataType::of_old_code(code)));
    let Some(kind) = kind else {
        fields.warn(4, Problem::UnknownType(code));
        return by_size;
    };
    match (kind.size(), size) {
        (Some(own), Some(given)) if given != 0 && own != usize::from(given) => {
            fields.warn(5, Problem::TypeAgainstSize);
            by_size
        }
        _ => kind,
    }
}

/// Fields 13 to 16; a factor that is not given is 1.
fn scaling(fields: &mut Fields<'_>) -> Option<Scaling> {
    let multiplier = fields.number(12).unwrap_or(1);
    let divisor = fields.number(13).unwrap_or(1);
    let base = fields.number(14).unwrap_or(1);
    let offset = fields.number(15).unwrap_or(0);
    if multiplier == 0 || divisor == 0 || base == 0 {
        fields.warn(12, Problem::ZeroInScaling);
        return None;
    }
    Some(Scaling { multiplier, divisor, base, offset })
}

/// What a member of an assembly is: `ParamN`, a path, a number, or nothing.
fn content(fields: &mut Fields<'_>, index: usize) -> Content {
    let text = fields.text(index);
    if let Some(parameter) = numbered(text, "Param") {
        Content::Parameter(parameter)
    } else if let Some(target) = hex(text).as_deref().and_then(Path::parse).and_then(Path::target) {
        Content::Attribute(target)
    } else {
        number(text).map_or(Content::Padding, Content::Constant)
    }
}

/// Keeps what comes first; whether it did.
fn insert<T>(
    map: &mut BTreeMap<u16, T>,
    number: u16,
    value: T,
    line: u32,
    warnings: &mut Warnings,
) -> bool {
    match map.entry(number) {
        Place::Vacant(place) => {
            place.insert(value);
            true
        }
        Place::Occupied(_) => {
            warnings.add(line, Problem::Repeated);
            false
        }
    }
}

/// The number behind a keyword: 12 of `Param12`.
fn numbered(text: &str, keyword: &str) -> Option<u16> {
    let (word, number) = text.split_at_checked(keyword.len())?;
    let is_number = number.bytes().all(|byte| byte.is_ascii_digit());
    if word.eq_ignore_ascii_case(keyword) && is_number { number.parse().ok() } else { None }
}

/// A decimal or hexadecimal number.
fn number(text: &str) -> Option<i64> {
    let (sign, digits) = match text.strip_prefix('-') {
        Some(digits) => (-1, digits),
        None => (1, text.strip_prefix('+').unwrap_or(text)),
    };
    let is_digit = |c: char| c.is_ascii_hexdigit();
    let hex = digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X"));
    let number = match hex {
        Some(hex) if hex.starts_with(is_digit) => i64::from_str_radix(hex, 16).ok()?,
        None if digits.starts_with(is_digit) => digits.parse().ok()?,
        _ => return None,
    };
    Some(sign * number)
}

/// Bytes as hex digits, with or without blanks between them.
fn hex(text: &str) -> Option<Vec<u8>> {
    let mut digits = text.chars().filter(|c| !c.is_whitespace());
    let mut bytes = Vec::new();
    while let Some(high) = digits.next() {
        if bytes.len() == MAX_PATH {
            return None;
        }
        let byte = high.to_digit(16)? << 4 | digits.next()?.to_digit(16)?;
        bytes.push(byte as u8);
    }
    (!bytes.is_empty()).then_some(bytes)
}
