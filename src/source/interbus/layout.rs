//! How the user says that a log is written, where its header does not.

use super::super::InputFormat;
use dissectors::interbus::Device;
use std::path::PathBuf;

/// How a log is written; the default is what the header says.
#[derive(Clone, Default, Debug)]
pub struct Layout {
    /// Which column stands for which name.
    pub columns: Mapping,
    /// The columns of several devices in one row.
    pub ring: RingMap,
    /// How words are written. By default in hex, ident and length codes in decimal.
    pub words: Option<Radix>,
    /// Which word of two stands first.
    pub word_order: Order,
    /// Which byte of a word stands first.
    pub byte_order: Order,
    /// The unit of times that are bare numbers.
    pub time_unit: TimeUnit,
    /// What length codes beside ident codes are.
    pub length_codes: LengthCodes,
    /// A second log, whose rows are joined to the first's by time.
    pub join: Option<PathBuf>,
    /// Its columns, where they are not mapped as the first's.
    pub join_columns: Option<Mapping>,
}

impl Layout {
    /// The format that these columns are of, if the user named any.
    pub fn format(&self) -> Option<InputFormat> {
        let has = |names: &[&str]| names.iter().any(|name| self.columns.column(name).is_some());
        let formats = [
            (!self.ring.0.is_empty() || self.join.is_some(), InputFormat::InterbusLog),
            (has(&["id", "ident", "length"]), InputFormat::InterbusId),
            (has(&["status", "parameter", "slave", "message"]), InputFormat::InterbusDiagnostic),
            (!self.columns.0.is_empty(), InputFormat::InterbusLog),
        ];
        formats.into_iter().find(|(is_it, _)| *is_it).map(|(_, format)| format)
    }
}

/// How words are written.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
pub enum Radix {
    /// Hex digits.
    Hex,
    /// Decimal digits, with or without a sign. What is marked as hex (0x, h, 16#) is read as such.
    Decimal,
}

/// What stands first.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, clap::ValueEnum)]
pub enum Order {
    /// The high part.
    #[default]
    HighFirst,
    /// The low part.
    LowFirst,
}

/// The unit of a time that is a bare number.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, clap::ValueEnum)]
pub enum TimeUnit {
    /// Seconds.
    #[default]
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
}

impl TimeUnit {
    /// How many powers of ten above a nanosecond it is.
    pub const fn power(self) -> u32 {
        match self {
            TimeUnit::S => 9,
            TimeUnit::Ms => 6,
            TimeUnit::Us => 3,
            TimeUnit::Ns => 0,
        }
    }
}

/// What length codes are.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, clap::ValueEnum)]
pub enum LengthCodes {
    /// Five bits, as in the ID word.
    #[default]
    Chip,
    /// Eight bits, as data sheets are reported to print them: 02 two words, 81 one byte
    DataSheet,
}

/// A column: its name in the header, or its number.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Column {
    /// As in the header.
    Name(String),
    /// From 1.
    Number(usize),
}

impl Column {
    fn parse(text: &str) -> Option<Column> {
        let text = text.trim();
        match text.parse() {
            Ok(0) => None,
            Ok(number) => Some(Column::Number(number)),
            Err(_) => (!text.is_empty()).then(|| Column::Name(text.to_owned())),
        }
    }
}

/// Names that headers may use.
pub const NAMES: [&str; 16] = [
    "time",
    "date",
    "device",
    "out",
    "in",
    "out1",
    "out2",
    "in1",
    "in2",
    "id",
    "ident",
    "length",
    "status",
    "parameter",
    "slave",
    "message",
];

/// Which columns stand for which names: `time=Timestamp,out=QD10,in=4`.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Mapping(Vec<(&'static str, Column)>);

impl Mapping {
    /// Reads names and columns.
    ///
    /// # Errors
    /// What is expected.
    pub fn parse(text: &str) -> Result<Self, String> {
        let part = |part: &str| {
            let (name, column) = part.split_once('=')?;
            let name = NAMES.into_iter().find(|known| *known == name.trim())?;
            Some((name, Column::parse(column)?))
        };
        let parts: Option<_> = text.split(',').map(part).collect();
        parts.map(Mapping).ok_or_else(|| {
            let names = NAMES.join(", ");
            format!("not columns, such as time=Timestamp,out=QD10,in=4: names are {names}")
        })
    }

    /// The column that stands for this name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.0.iter().find(|(known, _)| *known == name).map(|(_, column)| column)
    }

    /// All of its columns.
    fn columns(&self) -> impl Iterator<Item = &Column> {
        self.0.iter().map(|(_, column)| column)
    }
}

/// A word of 32 bits: one column, or two of 16 bits.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Place(pub Column, pub Option<Column>);

/// The words of one device: what the master sends, and what it receives.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Member {
    /// The device.
    pub device: Device,
    /// Master to device.
    pub out: Option<Place>,
    /// Device to master.
    pub input: Option<Place>,
}

/// The columns of each device: `1=QD10/ID10,2=QW20+QW22/IW20+IW22`.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct RingMap(pub Vec<Member>);

impl RingMap {
    /// Reads devices with their columns.
    ///
    /// # Errors
    /// What is expected.
    pub fn parse(text: &str) -> Result<Self, String> {
        let members: Option<Vec<_>> = text.split(',').map(member).collect();
        let is_once = |members: &Vec<Member>| {
            let count = |device| members.iter().filter(|other| other.device == device).count();
            members.iter().all(|member| count(member.device) == 1)
        };
        members.filter(is_once).map(RingMap).ok_or_else(|| {
            "not devices (1 to 512, each once) and their columns OUT/IN, such as \
             1=QD10/ID10,2=QW20+QW22/IW20+IW22"
                .to_owned()
        })
    }
}

fn member(text: &str) -> Option<Member> {
    let (device, columns) = text.split_once('=')?;
    let (out, input) = columns.split_once('/')?;
    let (out, input) = (place(out)?, place(input)?);
    let is_there = out.is_some() || input.is_some();
    let device = Device::new(device.trim().parse().ok()?)?;
    is_there.then_some(Member { device, out, input })
}

/// `None` where it is wrong, and a place of nothing where nothing stands.
fn place(text: &str) -> Option<Option<Place>> {
    if text.trim().is_empty() {
        return Some(None);
    }
    let (first, second) = match text.split_once('+') {
        Some((first, second)) => (first, Some(Column::parse(second)?)),
        None => (text, None),
    };
    Some(Some(Place(Column::parse(first)?, second)))
}

impl Layout {
    /// Whether the user named columns, and all by number: then there may be no header.
    pub fn is_by_number(&self) -> bool {
        let places = self.ring.0.iter().flat_map(|member| [&member.out, &member.input]);
        let of_ring = places.flatten().flat_map(|place| [Some(&place.0), place.1.as_ref()]);
        let mut columns = self.columns.columns().chain(of_ring.flatten()).peekable();
        columns.peek().is_some() && columns.all(|column| matches!(column, Column::Number(_)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_by_name_or_number() {
        let mapping = Mapping::parse("time=Timestamp,out=QD 10,in=4").unwrap();
        assert_eq!(mapping.column("time"), Some(&Column::Name("Timestamp".to_owned())));
        assert_eq!(mapping.column("out"), Some(&Column::Name("QD 10".to_owned())));
        assert_eq!(mapping.column("in"), Some(&Column::Number(4)));
        assert_eq!(mapping.column("device"), None);
        for wrong in ["", "time", "time=", "Time=1", "when=1", "time=0", "time=1,"] {
            assert!(Mapping::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_ring_is_mapped_device_by_device() {
        let ring = RingMap::parse("1=QD10/ID10,7=3+4/,512=/IW1+IW2").unwrap().0;
        let name = |text: &str| Column::Name(text.to_owned());
        assert_eq!(ring[0].out, Some(Place(name("QD10"), None)));
        assert_eq!(ring[1].out, Some(Place(Column::Number(3), Some(Column::Number(4)))));
        assert_eq!(ring[1].input, None);
        assert_eq!(ring[2].input, Some(Place(name("IW1"), Some(name("IW2")))));
        for wrong in ["", "1=a", "0=a/b", "513=a/b", "1=/", "1=a+/b", "1=a/b,1=c/d"] {
            assert!(RingMap::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_the_user_maps_tells_the_format() {
        let of = |text: &str| {
            let columns = Mapping::parse(text).unwrap();
            Layout { columns, ..Layout::default() }.format()
        };
        assert_eq!(of("time=1,out=2"), Some(InputFormat::InterbusLog));
        assert_eq!(of("device=1,ident=2"), Some(InputFormat::InterbusId));
        assert_eq!(of("time=1,slave=2"), Some(InputFormat::InterbusDiagnostic));
        assert_eq!(Layout::default().format(), None);
    }
}
