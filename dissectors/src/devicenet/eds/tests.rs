//! Files written here after the forms that makers use.

use super::*;
use crate::devicenet::cip::{DataType, Value};
use alloc::format;
use alloc::string::ToString;
use proptest::prelude::*;

/// An encoder's file of today: parameters with numbered words, assemblies with members.
const ENCODER: &str = r#"$ An encoder as it could be
[File]
    DescText = "Multiturn encoder";  Revision = 1.1;
[Device]
    VendCode = 468;          VendName = "Baumer";
    ProdType = 0x22;         ProdTypeStr = "Encoder";
    ProdCode = 10;           MajRev = 1;   MinRev = 1;
    ProdName = "AMG 11 "
               "D29";
[IO_Info]
    Default = 0x0001;
    PollInfo = 0x000D, 1, 0;
    COSInfo  = 0x000D, 2, 0;
    Input1 = 4, 0, 0x000D, "Position", 6, "20 04 24 01 30 03", "";
    Input2 = 5, 34, 0x000D, "Position and flags", 4, "20 04 24 02", "";
[Params]
    Param1 = 0, 6, "20 2F 24 01 30 03", 0x0002, 0xC1, 1, "Sense of rotation", "", "",
        0, 1, 0, , , , , , , , , 0;
    Enum1 = 0, "CW", 1, "CCW";
    Param9 = 0, 6, "20 2F 24 01 30 0C", 0x0030, 0xC4, 4, "Position value", "steps", "",
        0, 536870911, 0, 1, 1, 1, 0, 0, 0, 0, 0, 0;
    Param20 = 0, 6, "20 64 24 01 30 05", 0x0004, 0xC7, 2, "Speed", "rpm", "help",
        0, 60000, 0, 1, 100, 3, -50, 0, 0, 0, 0, 2;
    Param21 = 0, 6, "20 64 24 01 30 06", 0x0012, 0xD1, 1, "Flags", "", "", 0, 3, 0;
    Enum21 = 0, "Alarm", 1, "Warning";
[Assembly]
    Assem2 = "Position and flags", "20 04 24 02", 5, 0x0000, , ,
        32, Param9, 1, "20 64 24 01 30 06", 1, , 6, 0;
"#;

/// The same device in a file of the nineties.
const OLD: &str = "[Device]\r\n\tVendCode = 468;\r\n\tProdCode = 0x000A;\r\n[Params]\r\n\
    \tParam1 = 0,6,\"202F24013003\",2,8,1,\"Sense\",\"\",\"\",100,102,100;\r\n\
    [EnumPar]\r\n\tParam1 = \"100\",\"n.a.\",\"102\";\r\n";

fn read(text: &str) -> Eds {
    let (eds, warnings) = parse(text.as_bytes());
    assert_eq!(warnings, []);
    eds
}

/// The warnings of a file that would be without any but for what the test adds.
fn warnings(text: &str) -> Vec<String> {
    let text = format!("[Device] VendCode=1; ProdCode=1;\n{text}");
    parse(text.as_bytes()).1.iter().map(ToString::to_string).collect()
}

#[test]
fn a_file_belongs_to_a_device() {
    let eds = read(ENCODER);
    assert_eq!(eds.device.product_name, "AMG 11 D29");
    let identity = Identity {
        vendor: 468,
        device_type: Some(0x22),
        product_code: 10,
        major_revision: Some(1),
    };
    assert!(eds.describes(&identity));
    for other in [
        Identity { vendor: 1, ..identity },
        Identity { device_type: Some(0), ..identity },
        Identity { product_code: 11, ..identity },
        Identity { major_revision: Some(2), ..identity },
    ] {
        assert!(!eds.describes(&other), "{other:?}");
    }
    // A file that does not tell type and revision is of all of them.
    let old = read(OLD);
    assert!(old.describes(&Identity { major_revision: Some(7), ..identity }));
    let other = read(&ENCODER.replace("MajRev = 1", "MajRev = 2"));
    assert_eq!(find(&[old.clone(), eds.clone()], &Identity { vendor: 1, ..identity }), None);
    assert_eq!(find(&[other.clone(), eds.clone()], &identity), Some(1));
    // Until the device tells its revision, it may be either.
    let unknown = Identity { major_revision: None, ..identity };
    assert_eq!(find(&[other, eds.clone()], &unknown), None);
    assert_eq!(find(&[eds.clone(), eds], &unknown), Some(0));
}

#[test]
fn a_parameter_is_found_by_its_path_and_by_its_number() {
    let eds = read(ENCODER);
    let position = eds.parameter(0x2F, 1, 12).unwrap();
    assert_eq!((position.name.as_str(), position.kind), ("Position value", DataType::Dint));
    assert!(position.is_read_only);
    assert_eq!(eds.parameter(0x0F, 9, 1), Some(position));
    assert_eq!(eds.parameter(0x0F, 9, 2), None);
    assert_eq!(eds.parameter(0x2F, 1, 4), None);
    assert!(eds.has_class(0x2F) && !eds.has_class(0x23));
    assert_eq!(eds.parameters().map(|(number, _)| number).collect::<Vec<_>>(), [1, 9, 20, 21]);
}

#[test]
fn values_in_the_words_of_the_file() {
    let eds = read(ENCODER);
    let said = |class, attribute, data: &[u8]| {
        let parameter = eds.parameter(class, 1, attribute).unwrap();
        parameter.in_words(parameter.kind.decode(data).unwrap()).to_string()
    };
    assert_eq!(said(0x2F, 3, &[1]), "1 (CCW)");
    assert_eq!(said(0x2F, 12, &[0x45, 0x23, 0x01, 0x00]), "74565 steps");
    // (1050 - 50) x 1 x 3 / 100 = 30.
    assert_eq!(said(0x64, 5, &[0x1A, 0x04]), "30.00 rpm");
    // Of a word of bits, each bit has its name.
    assert_eq!(said(0x64, 6, &[3]), "03h (Alarm, Warning)");
    assert_eq!(said(0x64, 6, &[0]), "00h");
}

#[test]
fn old_files_number_their_words_from_the_minimum() {
    let eds = read(OLD);
    let parameter = eds.parameter(0x2F, 1, 3).unwrap();
    let words = [99, 100, 101, 102, 103].map(|number| parameter.word(number));
    assert_eq!(words, [None, Some("100"), Some("n.a."), Some("102"), None]);
    // Old code 8 is USINT.
    assert_eq!(parameter.kind, DataType::Usint);
}

#[test]
fn sizes_of_connections() {
    let io = read(ENCODER).io;
    assert_eq!(io.default, Some(1));
    let produced = |mode| io.defaults(mode).0.map(|format| (format.size, format.assembly()));
    assert_eq!(produced(Mode::Poll), Some((4, Some(1))));
    assert_eq!(produced(Mode::Cos), Some((5, Some(2))));
    assert_eq!(produced(Mode::Strobe), None);
    assert_eq!(io.defaults(Mode::Poll).1, None);
    assert_eq!(io.produced().map(|format| format.size).collect::<Vec<_>>(), [4, 5]);
    assert_eq!(io.consumed().count(), 0);
}

#[test]
fn the_size_of_data_tells_its_format_where_one_has_it() {
    let io = read(
        "[Device] VendCode=1; ProdCode=1;\n[IO_Info] PollInfo = 1, 2, 0;\n\
         Input1=4,0,1,\"A\"; Input2=4,0,1,\"B\"; Input3=5,0,1,\"C\"; Input4=6; Input5=6;",
    )
    .io;
    let name = |mode, size| {
        let format = format_of_size(io.produced(), io.defaults(mode).0, size)?;
        Some(format.name.as_str())
    };
    // Of several the default of the mode; of none but those, no one knows.
    assert_eq!([4, 5, 6, 7].map(|size| name(Mode::Poll, size)), [Some("B"), Some("C"), None, None]);
    assert_eq!(name(Mode::Cyclic, 4), None);
}

#[test]
fn members_of_an_assembly() {
    let eds = read(ENCODER);
    let assembly = eds.assembly(2).unwrap();
    assert_eq!((assembly.size, assembly.members.len()), (Some(5), 4));
    let cells: Vec<_> = eds.cells(assembly).collect();
    assert_eq!(
        cells.iter().map(|cell| (cell.offset, cell.bits)).collect::<Vec<_>>(),
        [(0, 32), (32, 1), (33, 1), (34, 6)]
    );
    let names: Vec<_> = cells.iter().map(Cell::name).collect();
    assert_eq!(names, [Some("Position value"), Some("Flags"), None, None]);
    let data = [0x45, 0x23, 0x01, 0x00, 0b1000_0011];
    assert_eq!(cells[0].value(&data), Some(Value::Signed(74565)));
    assert_eq!(cells[1].value(&data), Some(Value::Unsigned(1)));
    assert_eq!(cells[3].value(&data), Some(Value::Unsigned(0b10_0000)));
    assert_eq!(cells[3].content, Content::Constant(0));
    // A DINT in twelve bits: FFFh is -1.
    let narrow = read(&ENCODER.replace("32, Param9", "12, Param9"));
    let cell = narrow.cells(narrow.assembly(2).unwrap()).next().unwrap();
    assert_eq!(cell.value(&[0xFF, 0x7F]), Some(Value::Signed(-1)));
    assert_eq!(cell.value(&[0xFF, 0x77]), Some(Value::Signed(0x7FF)));
    assert_eq!(cells[3].value(&data[..4]), None);
    assert!(eds.assembly(1).is_none());
}

#[test]
fn the_size_of_a_member_may_be_its_parameters() {
    let eds = read(
        "[Device] VendCode=1; ProdCode=1;\n[Params] Param1=0,,,0,0xC7,2,\"A\";\n\
         [Assembly] Assem100=\"Data\",,,,,,,Param1,8,Param1;",
    );
    let cells: Vec<_> = eds.cells(eds.assembly(100).unwrap()).map(|c| (c.offset, c.bits)).collect();
    assert_eq!(cells, [(0, 16), (16, 8)]);
    // Behind one whose size nobody tells, no place is known.
    let eds = read(
        "[Device] VendCode=1; ProdCode=1;\n[Assembly] Assem1=\"Data\",,,,,,8,Param1,,Param2,8,3;",
    );
    assert_eq!(eds.cells(eds.assembly(1).unwrap()).count(), 1);
}

#[test]
fn slips_are_told_with_their_lines() {
    assert_eq!(warnings("[Device]\nMajRev = one;"), ["line 3: field 1 is no number"]);
    assert_eq!(warnings("[Device]\nMajRev = 300;"), ["line 3: number of field 1 out of range"]);
    assert_eq!(
        warnings("[Params]\nParam1 = 0, 6,\n\"20 2F 24\", 0, 0xC7, 2;"),
        ["line 4: field 3 is no path"]
    );
    assert_eq!(warnings("[Params]\nParam1=0,,,0,0x99,2;"), ["line 3: unknown data type 153"]);
    assert_eq!(
        warnings("[Params]\nParam1=0,,,0,0xC8,2;"),
        ["line 3: data type and data size differ"]
    );
    assert_eq!(
        warnings("[Params]\nParam1=0,,,4,0xC7,2,,,,,,,1,0,1,0;"),
        ["line 3: scaling with 0, left out"]
    );
    assert_eq!(
        warnings("[Params]\nParam1=;\nParam1=;\nEnum7=0,\"a\";"),
        ["line 4: there was such an entry before", "line 5: refers to what is not in the file"]
    );
    assert_eq!(
        warnings("[IO_Info]\nPollInfo = 1, 1, 0;"),
        ["line 3: refers to what is not in the file"]
    );
}

#[test]
fn what_is_no_eds_file_is_of_no_device() {
    let (eds, warnings) = parse(b"\x89PNG\r\n\x1A\n");
    assert_eq!(eds, Eds::default());
    assert_eq!(warnings.last().unwrap().problem, Problem::NoIdentity);
    let nobody = Identity { vendor: 0, device_type: None, product_code: 0, major_revision: None };
    assert!(!eds.describes(&nobody));
}

#[test]
fn bytes_that_are_no_utf_8_are_read() {
    let (eds, _) = parse(b"[Device] VendName = \"M\xFCller\x92s\";");
    assert_eq!(eds.device.vendor_name, "Müller’s");
}

#[test]
fn a_file_is_read_up_to_a_bound() {
    let mut file = ENCODER.as_bytes().to_vec();
    file.resize(MAX_FILE + 1, b' ');
    let (eds, warnings) = parse(&file);
    assert_eq!(warnings.len(), 1);
    assert_eq!(warnings[0].problem, Problem::TooLarge(MAX_FILE));
    assert_eq!(eds.device.vendor, Some(468));
    // Names of values are bounded too: 40 parameters with 2048 each are more than are kept.
    let mut text = String::from("[Params]\n");
    for number in 0..40 {
        text += &format!("Param{number}=;Enum{number}={};\n", "1,a,".repeat(2048));
    }
    let (eds, warnings) = parse(text.as_bytes());
    assert_eq!(eds.parameters().map(|(_, parameter)| parameter.words.len()).sum::<usize>(), 65_536);
    assert!(warnings.iter().any(|warning| warning.problem == Problem::TooMany(65_536)));
}

/// Asks a file for everything, of data that may be too short.
fn exercise(file: &[u8]) {
    let (eds, _) = parse(file);
    for (_, parameter) in eds.parameters() {
        let value = parameter.kind.decode(&[0x5A; 4]).unwrap_or(Value::Signed(i64::MIN));
        let _ = parameter.in_words(value).to_string();
    }
    for instance in 0..4 {
        let Some(assembly) = eds.assembly(instance) else { continue };
        for cell in eds.cells(assembly) {
            let _ = (cell.name(), cell.value(&[0xFF; 5]));
        }
    }
    let _ = format_of_size(eds.io.produced(), eds.io.defaults(Mode::Cyclic).0, 5);
}

proptest! {
    #[test]
    fn any_bytes_may_come(file in proptest::collection::vec(any::<u8>(), 0..300)) {
        exercise(&file);
    }

    #[test]
    fn a_damaged_file_is_read(
        damages in proptest::collection::vec((0..ENCODER.len(), any::<u8>(), any::<bool>()), 1..20),
    ) {
        let mut file = ENCODER.as_bytes().to_vec();
        for (place, byte, is_cut) in damages {
            let place = place % file.len().max(1);
            if is_cut && place < file.len() {
                file.remove(place);
            } else if let Some(old) = file.get_mut(place) {
                *old = byte;
            }
        }
        exercise(&file);
    }
}
