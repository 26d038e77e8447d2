//! A recording that is read gives the records that a live tap gave, whatever it heard.

#[cfg(target_os = "linux")]
mod live;

use super::*;
use crate::export::{Export, Json};
use crate::pipeline::{Consumer, Pipeline};
use crate::source::{self, Outbox, Reader, Reading, Source, SourceError};
use dissectors::bus::WireFacts;
use dissectors::can::{Direction, Frame, Identifier};
use dissectors::event::{Break, Clock, Loss, LossCause, Moment};
use dissectors::protocol::{Medium, Settings};
use dissectors::record::{BusInfo, Record, Sink};
use dissectors::uart::{Baud, Character, Format, Parity, ParityMarks};
use std::path::PathBuf;

/// 2026-11-22, 08:15 UTC.
const BEGIN: i64 = 1_795_335_300_000_000_000;

/// A tap that says, delivery by delivery, what is written here.
struct Script<F>(Vec<F>);

impl<F: FnOnce(&mut Outbox)> Reader for Script<F> {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        if self.0.is_empty() {
            return Ok(false);
        }
        self.0.remove(0)(out);
        Ok(true)
    }
}

type Delivery = Box<dyn FnOnce(&mut Outbox)>;

fn json_of(sources: impl IntoIterator<Item = Box<dyn Source>>) -> String {
    let mut pipeline = Pipeline::new(Settings::default());
    let mut out = Vec::new();
    let mut trace = Lines(&mut out);
    for mut source in sources {
        pipeline.pass(&mut *source, &mut trace).unwrap();
    }
    pipeline.finish(&mut trace);
    String::from_utf8(out).unwrap()
}

/// Records as JSON, a line each.
struct Lines<'a>(&'a mut Vec<u8>);

impl Sink for Lines<'_> {
    fn record(&mut self, record: &Record<'_>) {
        let mut json = Json::new(&mut *self.0);
        json.record(record);
        json.flush().unwrap();
    }
}

impl Consumer for Lines<'_> {
    fn goes_on(&mut self) -> bool {
        true
    }

    fn comment(&mut self, _: &BusInfo, _: Moment, _: &str) {}

    fn warn(&mut self, warning: &SourceError) {
        panic!("{warning}");
    }

    fn note(&mut self, _: &str) {}

    fn end(&mut self, _: &BusInfo, _: Moment) {}
}

fn record(mut source: Box<dyn Source>, directory: &Path, ring: &str) -> Vec<PathBuf> {
    let ring = if ring.is_empty() { Ring::default() } else { ring.parse().unwrap() };
    let files = Files::new(directory, ring).unwrap();
    let mut recorder = Recorder::new(&SourceOptions::default(), files, None).unwrap();
    while let Some(piece) = source.next_piece().unwrap() {
        recorder.take(&piece).unwrap();
    }
    recorder.finish().unwrap();
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// What the tap said is recorded, read, and compared with what it said.
fn compare(script: fn() -> Vec<Delivery>, ring: &str) -> (String, usize) {
    let source = || Box::new(Reading::new(Script(script()))) as Box<dyn Source>;
    let directory = tempfile::tempdir().unwrap();
    let files = record(source(), directory.path(), ring);
    let live = json_of([source()]);
    let options = SourceOptions::default();
    let read = files.iter().map(|file| source::open(file.to_str().unwrap(), &options).unwrap());
    let saved = json_of(read);
    for (saved, live) in saved.lines().zip(live.lines()) {
        assert_eq!(saved, live);
    }
    assert_eq!(saved.lines().count(), live.lines().count());
    (live, files.len())
}

/// A serial tap behind an FTDI adapter: reads every 16 ms, parity marked by the packet.
fn serial() -> Vec<Delivery> {
    let info = BusInfo::new("ttyUSB0", Some(Clock::Read)).with_parity(ParityMarks::Packet);
    let facts = WireFacts {
        baud: Baud::new(115_200),
        format: Some(Format::FT12),
        medium: Some(Medium::Serial),
        ..WireFacts::default()
    };
    let mut script: Vec<Delivery> = vec![Box::new(move |out| out.bus(info, facts))];
    for read in 0..400_i64 {
        script.push(Box::new(move |out| {
            let at = BEGIN + read * 16_000_000;
            // 154 from encoder 0, as TR's manual has it (TR SLIN §6), two requests a read.
            let bytes = [0x80, 0x1A, 0x01, 0x98, 0x80, 0x1A, 0x01, 0x98];
            let is_bad = read % 50 == 49;
            let parity = if is_bad { Parity::Suspect } else { Parity::Ok };
            // 11 bits at 115200 Bd are 95486.1 ns.
            let start = |n: i64| Moment::from_ns(at + (n * 11_000_000_000 + 57_600) / 115_200);
            let character = |(n, byte): (i64, &u8)| {
                Character::new(start(n), 16_000_000, u16::from(*byte), parity).interpolated()
            };
            out.characters(0, (0..).zip(&bytes).map(character));
            let now = Moment::from_ns(at + 15_000_000);
            match read % 100 {
                10 => out.lost(0, Loss { start: now, count: Some(3), cause: LossCause::Overrun }),
                20 => out.lost(0, Loss { start: now, count: None, cause: LossCause::Capture }),
                40 => {
                    let cause = LossCause::Sought(3_200_000_000);
                    out.lost(0, Loss { start: now, count: None, cause });
                }
                30 => {
                    out.line_break(0, Break { start: now, uncertainty: 16_000_000, duration: None })
                }
                _ => {}
            }
            out.silence(0, now);
        }));
    }
    // The port is gone for a while. A request that nobody answers, and then nothing for a second.
    script.push(Box::new(|out| {
        let at = Moment::from_ns(BEGIN + 7_000_000_000);
        let start = at.plus(-500_000_000);
        out.lost(0, Loss { start, count: None, cause: LossCause::Deaf });
        out.characters(0, [Character::new(at, 16_000_000, 0x80, Parity::Ok).interpolated()]);
        out.silence(0, at.plus(1_000_000_000));
    }));
    script
}

#[test]
fn a_serial_tap() {
    let (live, files) = compare(serial, "");
    assert_eq!(files, 1);
    for word in [
        "\"clock\":\"read\"",
        "\"uncertainty_ns\":16000000",
        "\"interpolated\":true",
        "\"suspect\"",
        "\"lost\":3",
        "uart.overrun",
        "uart.break",
        "nobody listened",
        "the rate was being looked for during the 3.20 s before this",
    ] {
        assert!(live.contains(word), "{word} is in what is compared");
    }
}

/// That the tap looked for the rate is no loss: nobody has to record again for it.
#[test]
fn looking_for_the_rate_loses_nothing() {
    let script = || -> Vec<Delivery> {
        let mut script = serial();
        script.truncate(2);
        script.push(Box::new(|out| {
            let start = Moment::from_ns(BEGIN + 4_000_000_000);
            let cause = LossCause::Sought(3_200_000_000);
            out.lost(0, Loss { start, count: None, cause });
        }));
        script
    };
    let directory = tempfile::tempdir().unwrap();
    let files = Files::new(directory.path(), Ring::default()).unwrap();
    let mut recorder = Recorder::new(&SourceOptions::default(), files, None).unwrap();
    let mut source = Reading::new(Script(script()));
    while let Some(piece) = source.next_piece().unwrap() {
        recorder.take(&piece).unwrap();
    }
    recorder.finish().unwrap();
    assert!(Summary::of(&recorder, 0).to_string().ends_with("nothing lost"));
    assert!(!undecoded(&recorder, false).line.contains("loss"));
    let (live, _) = compare(script, "");
    assert!(!live.contains("uart.lost"), "{live}");
}

#[test]
fn files_of_a_ring_are_one_stream() {
    let (_, files) = compare(serial, "duration=1s");
    // Each begins with the first read a second after the one before: every 63 reads of 16 ms.
    assert_eq!(files, 7);
    // 400 blocks of some 52 bytes are 21 kB.
    assert!(compare(serial, "size=5k").1 > 4);
}

/// The same tap on a machine whose clock is set back by a year after 3.2 s.
fn set_back() -> Vec<Delivery> {
    const YEAR: i64 = 31_536_000_000_000_000;
    let mut script = serial();
    script.truncate(1);
    for read in 0..400_i64 {
        script.push(Box::new(move |out| {
            let behind = if read < 200 { 0 } else { YEAR };
            let at = Moment::from_ns(BEGIN + read * 16_000_000 - behind);
            out.characters(0, [Character::new(at, 16_000_000, 0x80, Parity::Ok).interpolated()]);
            out.silence(0, at.plus(8_000_000));
        }));
    }
    script
}

#[test]
fn files_of_a_ring_end_though_the_clock_is_set_back() {
    let directory = tempfile::tempdir().unwrap();
    let tap = || Box::new(Reading::new(Script(set_back()))) as Box<dyn Source>;
    let mut files = record(tap(), directory.path(), "duration=1s");
    // As with a clock that goes on: every 63 reads of 16 ms, of 400.
    assert_eq!(files.len(), 7);
    files.sort_by_key(|file| file.to_string_lossy().rsplit_once('-').unwrap().1.to_owned());
    let options = SourceOptions::default();
    let saved = json_of(files.iter().map(|f| source::open(f.to_str().unwrap(), &options).unwrap()));
    assert_eq!(saved, json_of([tap()]));
}

/// A tap that tells `marks`, and yet says this of single characters: bytes that cannot stand where
/// marks are in force, and then another adapter of the same name.
fn odd(marks: ParityMarks) -> Vec<Delivery> {
    let info = BusInfo::new("ttyUSB0", Some(Clock::Read)).with_parity(marks);
    let facts = WireFacts {
        baud: Baud::new(115_200),
        format: Some(Format::FT12),
        medium: Some(Medium::Serial),
        ..WireFacts::default()
    };
    let mut script: Vec<Delivery> = vec![Box::new(move |out| out.bus(info, facts))];
    let said = [Parity::Unknown, Parity::Ok, Parity::Error, Parity::Suspect, Parity::Unknown];
    for read in 0..20_i64 {
        script.push(Box::new(move |out| {
            let start = Moment::from_ns(BEGIN + read * 16_000_000);
            let character = |(n, parity): (i64, &Parity)| {
                // 11 bits at 115200 Bd are 95486.1 ns.
                let start = start.plus((n * 11_000_000_000 + 57_600) / 115_200);
                Character::new(start, 16_000_000, 0x1A, *parity).interpolated()
            };
            out.characters(0, (0..).zip(&said).map(character));
            let start = start.plus(8_000_000);
            let unframed = Character::new(start, 16_000_000, 0x1A, Parity::Unknown);
            out.characters(0, [unframed.interpolated().with_framing_error()]);
            out.silence(0, start.plus(1_000_000));
        }));
    }
    script.push(Box::new(|out| out.end(0, Moment::from_ns(BEGIN + 1_000_000_000))));
    script
}

#[test]
fn a_tap_that_contradicts_itself() {
    compare(|| odd(ParityMarks::None), "");
    compare(|| odd(ParityMarks::Packet), "");
    let (live, files) = compare(|| odd(ParityMarks::Character), "size=4k");
    assert!(files > 1);
    for word in ["\"unknown\"", "\"error\"", "uart.framing"] {
        assert!(live.contains(word), "{word} is in what is compared");
    }
}

/// A CAN tap: frames of a poll, both directions, losses with and without a frame behind them.
fn can() -> Vec<Delivery> {
    let info = BusInfo::new("can0", Some(Clock::Kernel));
    let facts =
        WireFacts { baud: Baud::new(125_000), medium: Some(Medium::Can), ..WireFacts::default() };
    let mut script: Vec<Delivery> = vec![Box::new(move |out| out.bus(info, facts))];
    for n in 0..500_i64 {
        script.push(Box::new(move |out| {
            let at = Moment::from_ns(BEGIN + n * 10_000_000);
            // The command and the response of MAC ID 5 (DeviceNet: 101 101b group 2, 1111b group 1).
            let frame = |id: u32, at, side| {
                let id = Identifier::standard(id).unwrap();
                let mut frame = Frame::data(at, 50_000, id, &[0x9A, 1, 0, 0]);
                frame.direction = Some(side);
                frame
            };
            match n % 100 {
                40 => out.lost(0, Loss { start: at, count: Some(7), cause: LossCause::Capture }),
                60 => {
                    let start = at.plus(-1_000_000);
                    out.lost(0, Loss { start, count: None, cause: LossCause::Capture });
                }
                _ => {}
            }
            out.frame(0, frame(0x42D, at, Direction::Received));
            out.frame(0, frame(0x3C5, at.plus(1_234_567), Direction::Sent));
            out.silence(0, at.plus(9_000_000));
        }));
    }
    // The interface goes down, comes back with another bit rate, and goes down again.
    for (after_s, rate) in [(6, Some(250_000)), (7, None), (8, Some(125_000))] {
        script.push(Box::new(move |out| {
            let start = Moment::from_ns(BEGIN + after_s * 1_000_000_000);
            out.lost(0, Loss { start, count: None, cause: LossCause::Deaf });
            out.bitrate(0, rate.and_then(Baud::new));
            let id = Identifier::standard(0x42D).unwrap();
            let frame = Frame::data(start.plus(500_000_000), 50_000, id, &[0x9A, 1, 0, 0]);
            out.frame(0, frame);
        }));
    }
    script.push(Box::new(|out| {
        let start = Moment::from_ns(BEGIN + 9_000_000_000);
        out.lost(0, Loss { start, count: None, cause: LossCause::Deaf });
        out.end(0, start.plus(500_000_000));
    }));
    script
}

#[test]
fn a_can_tap() {
    let (live, _) = compare(can, "");
    let lost = live.lines().filter(|line| line.contains("\"kind\":\"lost\"")).count();
    assert_eq!(lost, 14, "{live}");
    // The same frame takes half the time at twice the bit rate.
    let last = live.lines().filter(|line| line.contains("\"can\":{\"id\":1069")).rev();
    let times: Vec<Option<u64>> = last
        .take(4)
        .map(|line| {
            serde_json::from_str::<serde_json::Value>(line).unwrap()["duration_ns"].as_u64()
        })
        .collect();
    let whole = times[3].unwrap();
    assert_eq!(times, [Some(whole), None, Some(whole / 2), Some(whole)], "latest first");
    assert!(live.contains("\"direction\":\"tx\"") && live.contains("\"lost\":7"));
    assert!(live.contains("nobody listened: the interface was down or gone"), "{live}");
    assert!(compare(can, "size=20k").1 > 2);
}

#[test]
fn a_silent_bus_is_recorded_as_such() {
    let script = || -> Vec<Delivery> {
        let mut script = can();
        script.truncate(1);
        script.push(Box::new(|out| out.silence(0, Moment::from_ns(BEGIN))));
        script
    };
    let directory = tempfile::tempdir().unwrap();
    let files = record(Box::new(Reading::new(Script(script()))), directory.path(), "");
    let mut saved = source::open(files[0].to_str().unwrap(), &SourceOptions::default()).unwrap();
    let bus = saved.next_piece().unwrap();
    assert!(matches!(bus, Some(Piece::Bus(info, _)) if info.name == "can0"));
    let end = saved.next_piece().unwrap();
    assert!(matches!(end, Some(Piece::End(0, at)) if at == Moment::from_ns(BEGIN)));
}

/// A tap that never knows its ± beforehand.
fn varying() -> Vec<Delivery> {
    let info = BusInfo::new("can0", Some(Clock::Kernel));
    let facts = WireFacts { medium: Some(Medium::Can), ..WireFacts::default() };
    let mut script: Vec<Delivery> = vec![Box::new(move |out| out.bus(info, facts))];
    for n in 0..12_i64 {
        script.push(Box::new(move |out| {
            let id = Identifier::standard(0x42D).unwrap();
            let at = Moment::from_ns(BEGIN + n * 10_000_000);
            let uncertainty = 50_000 + u32::try_from(n % 6).unwrap();
            out.frame(0, Frame::data(at, uncertainty, id, &[1]));
        }));
    }
    script
}

#[test]
fn every_stamp_keeps_what_it_is_worth() {
    let (live, _) = compare(varying, "");
    assert!(live.contains("\"uncertainty_ns\":50005"));
}
