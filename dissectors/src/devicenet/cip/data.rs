//! Data types: their codes, their sizes, and how their bytes read (CIP Vol. 1, appendix C).

use super::{Allocation, List, Path, Revision, Text, Value, little_endian};

/// How the bytes of an attribute are to be read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[expect(missing_docs, reason = "elementary types have the names of CIP")]
pub enum DataType {
    Bool,
    Sint,
    Int,
    Dint,
    Lint,
    Usint,
    Uint,
    Udint,
    Ulint,
    Real,
    Lreal,
    Stime,
    Date,
    TimeOfDay,
    DateAndTime,
    String,
    Byte,
    Word,
    Dword,
    Lword,
    String2,
    Ftime,
    Ltime,
    Itime,
    StringN,
    ShortString,
    Time,
    Epath,
    Engunit,
    Stringi,
    /// USINT[], as long as the data.
    UsintList,
    /// UINT[], as long as the data.
    UintList,
    /// A UINT count and so many UINT.
    CountedUintList,
    /// A BYTE count and so many UINT.
    ByteCountedUintList,
    /// USINT major, USINT minor.
    Revision,
    /// BYTE choice, USINT MAC ID of the master.
    Allocation,
    /// So many bytes.
    Bytes(u8),
    /// Whatever comes: the type stands in other attributes, or is not known.
    Raw,
}

/// The data is too short or too long for its type.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct WrongLength {
    /// Bytes that the type takes; where that depends on the data, on what there is of it.
    pub expected: usize,
    /// Bytes that there are.
    pub actual: usize,
}

impl WrongLength {
    /// Whether there is too much data; too little otherwise.
    #[must_use]
    pub const fn is_excess(&self) -> bool {
        self.actual > self.expected
    }
}

/// One elementary type.
struct Elementary {
    kind: DataType,
    /// Its code in CIP.
    code: u8,
    /// Its code in EDS files from before DeviceNet became part of CIP; 0 where it is not known.
    old: u8,
    name: &'static str,
    /// Bytes; `None` where the data tells.
    size: Option<usize>,
}

/// Codes of CIP: Vol. 1, C-6.1. Old codes are seen in files, not in a specification.
static ELEMENTARY: [Elementary; 30] = [
    elementary(DataType::Bool, 0xC1, 4, "BOOL", Some(1)),
    elementary(DataType::Sint, 0xC2, 5, "SINT", Some(1)),
    elementary(DataType::Int, 0xC3, 3, "INT", Some(2)),
    elementary(DataType::Dint, 0xC4, 6, "DINT", Some(4)),
    elementary(DataType::Lint, 0xC5, 7, "LINT", Some(8)),
    elementary(DataType::Usint, 0xC6, 8, "USINT", Some(1)),
    elementary(DataType::Uint, 0xC7, 2, "UINT", Some(2)),
    elementary(DataType::Udint, 0xC8, 9, "UDINT", Some(4)),
    elementary(DataType::Ulint, 0xC9, 10, "ULINT", Some(8)),
    elementary(DataType::Real, 0xCA, 11, "REAL", Some(4)),
    elementary(DataType::Lreal, 0xCB, 12, "LREAL", Some(8)),
    elementary(DataType::Stime, 0xCC, 0, "STIME", None),
    elementary(DataType::Date, 0xCD, 0, "DATE", Some(2)),
    elementary(DataType::TimeOfDay, 0xCE, 0, "TIME_OF_DAY", Some(4)),
    elementary(DataType::DateAndTime, 0xCF, 0, "DATE_AND_TIME", None),
    elementary(DataType::String, 0xD0, 0, "STRING", None),
    elementary(DataType::Byte, 0xD1, 24, "BYTE", Some(1)),
    elementary(DataType::Word, 0xD2, 1, "WORD", Some(2)),
    elementary(DataType::Dword, 0xD3, 25, "DWORD", Some(4)),
    elementary(DataType::Lword, 0xD4, 0, "LWORD", Some(8)),
    elementary(DataType::String2, 0xD5, 0, "STRING2", None),
    elementary(DataType::Ftime, 0xD6, 0, "FTIME", Some(4)),
    elementary(DataType::Ltime, 0xD7, 0, "LTIME", Some(8)),
    elementary(DataType::Itime, 0xD8, 13, "ITIME", Some(2)),
    elementary(DataType::StringN, 0xD9, 0, "STRINGN", None),
    elementary(DataType::ShortString, 0xDA, 23, "SHORT_STRING", None),
    elementary(DataType::Time, 0xDB, 0, "TIME", Some(4)),
    elementary(DataType::Epath, 0xDC, 0, "EPATH", None),
    elementary(DataType::Engunit, 0xDD, 0, "ENGUNIT", Some(2)),
    elementary(DataType::Stringi, 0xDE, 0, "STRINGI", None),
];

const fn elementary(
    kind: DataType,
    code: u8,
    old: u8,
    name: &'static str,
    size: Option<usize>,
) -> Elementary {
    Elementary { kind, code, old, name, size }
}

impl DataType {
    /// The elementary type with this code.
    #[must_use]
    pub fn of_code(code: u8) -> Option<Self> {
        ELEMENTARY.iter().find(|row| row.code == code).map(|row| row.kind)
    }

    /// The elementary type with this code of EDS files from before CIP (1 WORD to 25 DWORD).
    #[must_use]
    pub fn of_old_code(code: u8) -> Option<Self> {
        let mut rows = ELEMENTARY.iter().filter(|row| row.old != 0);
        rows.find(|row| row.old == code).map(|row| row.kind)
    }

    fn elementary(self) -> Option<&'static Elementary> {
        ELEMENTARY.iter().find(|row| row.kind == self)
    }

    /// Its code in CIP: C1h to DEh. Structures have none.
    #[must_use]
    pub fn code(self) -> Option<u8> {
        self.elementary().map(|row| row.code)
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            DataType::UsintList => "USINT[]",
            DataType::UintList => "UINT[]",
            DataType::CountedUintList => "UINT count, UINT[]",
            DataType::ByteCountedUintList => "BYTE count, UINT[]",
            DataType::Revision => "USINT major, USINT minor",
            DataType::Allocation => "BYTE choice, USINT master",
            DataType::Bytes(_) => "bytes",
            _ => self.elementary().map_or("any", |row| row.name),
        }
    }

    /// How many bytes it takes; `None` where the data tells.
    #[must_use]
    pub fn size(self) -> Option<usize> {
        match self {
            DataType::Revision | DataType::Allocation => Some(2),
            DataType::Bytes(size) => Some(size.into()),
            _ => self.elementary()?.size,
        }
    }

    /// The value in these bytes, all of them, the lowest first.
    ///
    /// # Errors
    /// Data is missing or left over.
    pub fn decode(self, data: &[u8]) -> Result<Value<'_>, WrongLength> {
        Ok(match self {
            DataType::Bool => match exactly::<1>(data)? {
                // CIP Vol. 1, appendix C: 0 or 1. What is neither must not look like either.
                [byte @ 0..=1] => Value::Bool(byte == 1),
                [byte] => Value::Unsigned(u64::from(byte)),
            },
            DataType::Sint => Value::Signed(i8::from_le_bytes(exactly(data)?).into()),
            DataType::Int | DataType::Itime => {
                Value::Signed(i16::from_le_bytes(exactly(data)?).into())
            }
            DataType::Dint | DataType::Time | DataType::Ftime => {
                Value::Signed(i32::from_le_bytes(exactly(data)?).into())
            }
            DataType::Lint | DataType::Ltime => Value::Signed(i64::from_le_bytes(exactly(data)?)),
            DataType::Usint => unsigned::<1>(data)?,
            DataType::Uint | DataType::Date => unsigned::<2>(data)?,
            DataType::Udint | DataType::TimeOfDay => unsigned::<4>(data)?,
            DataType::Ulint => unsigned::<8>(data)?,
            DataType::Real => Value::Real(f32::from_le_bytes(exactly(data)?).into()),
            DataType::Lreal => Value::Real(f64::from_le_bytes(exactly(data)?)),
            DataType::Byte => bits::<1>(data)?,
            DataType::Word | DataType::Engunit => bits::<2>(data)?,
            DataType::Dword => bits::<4>(data)?,
            DataType::Lword => bits::<8>(data)?,
            DataType::ShortString => Value::Text(Text(counted(data, 1, 1)?)),
            DataType::String => Value::Text(Text(counted(data, 2, 1)?)),
            DataType::Epath => Path::parse(data).map_or(Value::Bytes(data), Value::Path),
            DataType::UsintList => Value::List(List::of_bytes(data)),
            DataType::UintList => Value::List(List::of_words(even(data)?)),
            DataType::CountedUintList => Value::List(List::of_words(counted(data, 2, 2)?)),
            DataType::ByteCountedUintList => Value::List(List::of_words(counted(data, 1, 2)?)),
            DataType::Revision => {
                let [major, minor] = exactly(data)?;
                Value::Revision(Revision { major: major & 0x7F, minor })
            }
            DataType::Allocation => {
                let [choice, master] = exactly(data)?;
                Value::Allocation(Allocation { choice, master })
            }
            DataType::Bytes(size) => Value::Bytes(of_size(data, size.into())?),
            DataType::Stime
            | DataType::DateAndTime
            | DataType::String2
            | DataType::StringN
            | DataType::Stringi
            | DataType::Raw => Value::Bytes(data),
        })
    }
}

fn of_size(data: &[u8], expected: usize) -> Result<&[u8], WrongLength> {
    if data.len() == expected {
        Ok(data)
    } else {
        Err(WrongLength { expected, actual: data.len() })
    }
}

fn exactly<const N: usize>(data: &[u8]) -> Result<[u8; N], WrongLength> {
    data.try_into().map_err(|_| WrongLength { expected: N, actual: data.len() })
}

fn unsigned<const N: usize>(data: &[u8]) -> Result<Value<'_>, WrongLength> {
    of_size(data, N).map(|bytes| Value::Unsigned(little_endian(bytes)))
}

fn bits<const N: usize>(data: &[u8]) -> Result<Value<'_>, WrongLength> {
    of_size(data, N).map(|bytes| Value::Bits { bits: little_endian(bytes), bytes: N as u8 })
}

fn even(data: &[u8]) -> Result<&[u8], WrongLength> {
    of_size(data, data.len().next_multiple_of(2))
}

/// Items of so many bytes behind their count, which takes `prefix` bytes.
fn counted(data: &[u8], prefix: usize, item: usize) -> Result<&[u8], WrongLength> {
    let Some((count, items)) = data.split_at_checked(prefix) else {
        return Err(WrongLength { expected: prefix, actual: data.len() });
    };
    let size = little_endian(count) as usize * item;
    of_size(items, size).map_err(|_| WrongLength { expected: prefix + size, actual: data.len() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use alloc::vec::Vec;
    use proptest::prelude::*;

    #[test]
    fn codes_are_those_of_cip() {
        assert_eq!(DataType::of_code(0xC1), Some(DataType::Bool));
        assert_eq!(DataType::of_code(0xC8), Some(DataType::Udint));
        assert_eq!(DataType::of_code(0xDA), Some(DataType::ShortString));
        assert_eq!((DataType::of_code(0xC0), DataType::of_code(0xDF)), (None, None));
        let codes: Vec<u8> = ELEMENTARY.iter().map(|row| row.code).collect();
        assert_eq!(codes, (0xC1..=0xDE).collect::<Vec<_>>());
        assert_eq!(DataType::Dint.code(), Some(0xC4));
        assert_eq!(DataType::Allocation.code(), None);
    }

    #[test]
    fn old_files_have_small_codes() {
        let names = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 23, 24, 25]
            .map(|code| DataType::of_old_code(code).unwrap().name());
        assert_eq!(
            names,
            [
                "WORD",
                "UINT",
                "INT",
                "BOOL",
                "SINT",
                "DINT",
                "LINT",
                "USINT",
                "UDINT",
                "ULINT",
                "REAL",
                "LREAL",
                "ITIME",
                "SHORT_STRING",
                "BYTE",
                "DWORD"
            ]
        );
        assert_eq!(DataType::of_old_code(0), None);
    }

    /// Values of the vendor manuals' worked frames.
    #[test]
    fn the_manuals_values() {
        // X01: vendor 36 00 is 54.
        assert_eq!(DataType::Uint.decode(&[0x36, 0x00]), Ok(Value::Unsigned(54)));
        // X03: INT 3FFF behind the exception status.
        assert_eq!(DataType::Int.decode(&[0xFF, 0x3F]), Ok(Value::Signed(0x3FFF)));
        // X09: 4096 steps a turn; X10: total resolution; X11: preset 74565.
        assert_eq!(DataType::Int.decode(&[0x00, 0x10]), Ok(Value::Signed(4096)));
        assert_eq!(DataType::Dint.decode(&[0, 0, 0, 1]), Ok(Value::Signed(1 << 24)));
        assert_eq!(DataType::Dint.decode(&[0x45, 0x23, 0x01, 0x00]), Ok(Value::Signed(74565)));
        // X14: the rate asked for is 3594 ms, the one in use 3600 ms.
        assert_eq!(DataType::Uint.decode(&[0x0A, 0x0E]), Ok(Value::Unsigned(3594)));
        assert_eq!(DataType::Uint.decode(&[0x10, 0x0E]), Ok(Value::Unsigned(3600)));
        // X16: vendor 803, serial 1.
        assert_eq!(DataType::Uint.decode(&[0x23, 0x03]), Ok(Value::Unsigned(803)));
        assert_eq!(DataType::Udint.decode(&[1, 0, 0, 0]), Ok(Value::Unsigned(1)));
        // X20: EPR 256 ms, serial 60603992h, revision 2.2.
        assert_eq!(DataType::Uint.decode(&[0x00, 0x01]), Ok(Value::Unsigned(256)));
        let serial = DataType::Udint.decode(&[0x92, 0x39, 0x60, 0x60]);
        assert_eq!(serial, Ok(Value::Unsigned(0x6060_3992)));
        assert_eq!(DataType::Revision.decode(&[2, 2]).unwrap().to_string(), "2.2");
        // X24: serial 05060708h, configuration consistency value 1234h; X25: 0715h.
        let serial = DataType::Udint.decode(&[8, 7, 6, 5]);
        assert_eq!(serial, Ok(Value::Unsigned(0x0506_0708)));
        assert_eq!(DataType::Uint.decode(&[0x34, 0x12]), Ok(Value::Unsigned(0x1234)));
        assert_eq!(DataType::Uint.decode(&[0x15, 0x07]), Ok(Value::Unsigned(0x0715)));
        // X21: a count of four and the characters 0200.
        let text = DataType::String.decode(&[0x04, 0x00, 0x30, 0x32, 0x30, 0x30]);
        assert_eq!(text, Ok(Value::Text(Text(b"0200"))));
    }

    #[test]
    fn signs_fractions_and_bits() {
        assert_eq!(DataType::Sint.decode(&[0xFF]), Ok(Value::Signed(-1)));
        assert_eq!(DataType::Dint.decode(&[0xFE, 0xFF, 0xFF, 0xFF]), Ok(Value::Signed(-2)));
        assert_eq!(DataType::Lint.decode(&[0xFF; 8]), Ok(Value::Signed(-1)));
        assert_eq!(DataType::Ulint.decode(&[0xFF; 8]), Ok(Value::Unsigned(u64::MAX)));
        // 1.5 is 3FC00000h, 3FF8000000000000h.
        assert_eq!(DataType::Real.decode(&[0, 0, 0xC0, 0x3F]), Ok(Value::Real(1.5)));
        assert_eq!(DataType::Lreal.decode(&[0, 0, 0, 0, 0, 0, 0xF8, 0x3F]), Ok(Value::Real(1.5)));
        assert_eq!(DataType::Word.decode(&[0x04, 0x00]).unwrap().to_string(), "0004h");
        assert_eq!(DataType::Bool.decode(&[1]), Ok(Value::Bool(true)));
        assert_eq!(DataType::Bool.decode(&[2]), Ok(Value::Unsigned(2)));
    }

    #[test]
    fn lists_and_structures() {
        let list = DataType::UsintList.decode(&[3, 7, 8, 95]).unwrap();
        assert_eq!(list.to_string(), "3 7 8 95");
        let counted = [2, 0, 0x0F, 0, 0x2F, 0];
        assert_eq!(DataType::CountedUintList.decode(&counted).unwrap().to_string(), "15 47");
        let acks = DataType::ByteCountedUintList.decode(&[1, 4, 0]).unwrap();
        assert_eq!(acks.to_string(), "4");
        let owned = DataType::Allocation.decode(&[0x51, 0x0A]).unwrap();
        assert_eq!(owned.to_string(), "master 10: explicit, cos, without acknowledge");
        assert_eq!(DataType::Allocation.decode(&[0, 0xFF]).unwrap().to_string(), "not owned");
        // Bit 7 of the major revision is reserved.
        assert_eq!(DataType::Revision.decode(&[0x81, 3]).unwrap().to_string(), "1.3");
    }

    #[test]
    fn missing_and_excess_data_is_told() {
        let wrong = |expected, actual| Err(WrongLength { expected, actual });
        assert_eq!(DataType::Udint.decode(&[1, 2, 3]), wrong(4, 3));
        assert_eq!(DataType::Uint.decode(&[1, 2, 3]), wrong(2, 3));
        assert_eq!(DataType::Bool.decode(&[]), wrong(1, 0));
        assert_eq!(DataType::ShortString.decode(&[5, b'A', b'M', b'G']), wrong(6, 4));
        assert_eq!(DataType::ShortString.decode(&[1, b'A', b'M']), wrong(2, 3));
        assert_eq!(DataType::String.decode(&[5]), wrong(2, 1));
        assert_eq!(DataType::UintList.decode(&[1, 0, 2]), wrong(4, 3));
        assert!(WrongLength { expected: 2, actual: 3 }.is_excess());
    }

    #[test]
    fn texts_of_devices_are_made_harmless() {
        let text = DataType::ShortString.decode(&[5, b'a', 0x1B, b'[', 0xB5, b'm']).unwrap();
        assert_eq!(text.to_string(), "a.[µm");
    }

    proptest! {
        #[test]
        fn any_bytes_may_come(data in proptest::collection::vec(any::<u8>(), 0..40)) {
            let structures = [
                DataType::UsintList, DataType::UintList, DataType::CountedUintList,
                DataType::ByteCountedUintList, DataType::Revision, DataType::Allocation,
                DataType::Bytes(8), DataType::Raw,
            ];
            for kind in ELEMENTARY.iter().map(|row| row.kind).chain(structures) {
                match kind.decode(&data) {
                    Ok(value) => {
                        let _ = (value.to_string(), value.number());
                        prop_assert!(!value.field().is_absent());
                    }
                    Err(wrong) => {
                        prop_assert_eq!(wrong.actual, data.len());
                        prop_assert_ne!(wrong.expected, data.len());
                    }
                }
                // A type of fixed size is wrong exactly where the size is.
                if let Some(size) = kind.size() {
                    prop_assert_eq!(kind.decode(&data).is_ok(), data.len() == size);
                }
            }
        }
    }
}
