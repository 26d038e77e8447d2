//! Adapters that are played, byte by byte: what is said of them.

use super::super::super::super::Piece;
use super::super::adapter::Rate;
use super::*;
use dissectors::event::Event;
use std::io;
use std::time::Duration;

/// What is said of these bytes of an adapter, a word a piece.
fn hear(bytes: &[u8], has_stamps: bool) -> Vec<String> {
    struct Port<'a>(&'a [u8]);
    impl Read for Port<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            match self.0.read(buffer) {
                Ok(0) => Err(io::ErrorKind::TimedOut.into()),
                other => other,
            }
        }
    }
    impl Write for Port<'_> {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let rate = Rate::new(500_000).expect("adapters have it");
    let setting = Setting { name: String::new(), rate, has_stamps, is_confirmed: true };
    let (mut ear, mut out) = (Ear::new("tty", "slcan:tty"), Outbox::default());
    let mut port = Adapter::new(Port(bytes));
    ear.announce(&setting, &mut out);
    ear.listen(&mut port, &setting, &mut out).expect("the port is there");
    ear.listen(&mut port, &setting, &mut out).expect("the port is there");
    ear.end(&mut out);
    let mut said = Vec::new();
    let mut first = None;
    while let Some(piece) = out.next() {
        match piece.expect("it goes on") {
            Piece::Bus(info, facts) => {
                let clock = info.clock.map(Clock::name);
                said.push(format!("{} {clock:?} {:?}", info.name, facts.baud.map(Baud::get)));
            }
            Piece::Heard(_, Event::Frames(frames)) => {
                for frame in frames {
                    let begin = *first.get_or_insert(frame.start);
                    let ms = frame.start.since(begin).expect("times are known") / 1_000_000;
                    said.push(format!("{:X} +{ms}", frame.id.value()));
                }
            }
            Piece::Heard(_, Event::Lost(loss)) => said.push(format!("lost {:?}", loss.count)),
            Piece::Heard(_, Event::Advance(_)) => said.push("silence".to_owned()),
            Piece::Warning(warning) => said.push(warning.to_string()),
            Piece::Note(note) => said.push(note.to_owned()),
            Piece::End(..) => {}
            _ => panic!("nothing else is said"),
        }
    }
    said
}

#[test]
fn frames_have_the_adapters_times() {
    let said = hear(b"t1230EA5A\rt45600003\rT000001230000D\r", true);
    let note = "slcan:tty: adapter of no name, listen-only, 500000 bit/s, its own time stamps \
                ±1 ms";
    let frames = ["123 +0", "456 +9", "123 +19", "silence"];
    assert_eq!(said[..2], ["tty Some(\"hardware\") Some(500000)", note]);
    assert_eq!(said[2..], frames);
}

/// A thread that waits for the processor after a read that found nothing.
#[test]
fn silence_is_said_of_what_was_waited_for_and_not_of_what_came_since() {
    /// A frame, then nothing for long, then one that came 60 ms after the first.
    struct Held(u32);
    impl Read for Held {
        fn read(&mut self, mut buffer: &mut [u8]) -> io::Result<usize> {
            self.0 += 1;
            match self.0 {
                1 => buffer.write(b"t12300000\r"),
                2 => {
                    std::thread::sleep(Duration::from_millis(150));
                    Err(io::ErrorKind::TimedOut.into())
                }
                _ => buffer.write(b"t4560003C\r"),
            }
        }
    }
    impl Write for Held {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let rate = Rate::new(500_000).expect("adapters have it");
    let setting = Setting { name: String::new(), rate, has_stamps: true, is_confirmed: true };
    let (mut ear, mut out) = (Ear::new("tty", "slcan:tty"), Outbox::default());
    let mut port = Adapter::new(Held(0));
    for _ in 0..3 {
        ear.listen(&mut port, &setting, &mut out).expect("the port is there");
    }
    let (mut silent_until, mut starts) = (Moment::UNKNOWN, Vec::new());
    while let Some(piece) = out.next() {
        match piece.expect("it goes on") {
            Piece::Heard(_, Event::Frames(frames)) => starts.extend(frames.iter().map(|f| f.start)),
            Piece::Heard(_, Event::Advance(until)) => silent_until = until,
            _ => panic!("nothing else is said"),
        }
    }
    assert_eq!(starts[1].since(starts[0]), Some(60_000_000));
    assert!(starts[1].is_after(silent_until), "{starts:?} {silent_until:?}");
}

/// Which ± holds instead of the one that was told is told.
#[test]
fn an_adapter_that_does_not_stamp_after_all_is_told_once_with_what_holds() {
    let said = hear(b"t1230\rt4560\r", true);
    assert!(said[1].ends_with("its own time stamps ±1 ms"), "{said:?}");
    let told = |line: &&String| line.ends_with("the time when they were read, ±10 ms");
    assert_eq!(said.iter().filter(told).count(), 1, "{said:?}");
}

/// Nothing can be read a second before it was heard.
#[test]
fn a_clock_that_cannot_be_right_begins_anew_with_a_note() {
    let said = hear(b"t12300000\rt456003E8\r", true);
    let begins = "slcan:tty: the adapter's clock was 99";
    let ends = " ms ahead of this host's: times begin anew with the host's";
    assert!(said[4].starts_with(begins) && said[4].ends_with(ends), "{said:?}");
    assert_eq!((said[2].as_str(), said.len()), ("123 +0", 6));
}

/// 20 s ahead and 20 s back, again and again.
#[test]
fn stamps_that_jump_are_given_up_with_a_warning() {
    let said = hear(&b"t12300000\rt45604E20\r".repeat(50), true);
    let count = |what: &str| said.iter().filter(|said| said.contains(what)).count();
    assert_eq!(count("times begin anew"), MOST_JUMPS as usize - 1, "{said:?}");
    assert_eq!(count("jump again and again"), 1, "{said:?}");
    let frames = said.iter().filter(|said| said.contains(" +"));
    let is_near = |said: &String| said.ends_with(" +0") || said.ends_with(" +1");
    assert_eq!((frames.clone().count(), frames.clone().all(is_near)), (100, true), "{said:?}");
}

#[test]
fn without_stamps_the_time_of_reading_is_taken() {
    let said = hear(b"t1230\rt4560\r", false);
    assert_eq!(said[0], "tty Some(\"read\") Some(500000)");
    assert_eq!(said[2..], ["123 +0", "456 +0", "silence"]);
    // One that promised stamps is told once.
    let said = hear(b"t1230\rt4560\r", true);
    assert!(said[2].contains("does not"), "{said:?}");
    assert_eq!(said[3..], ["123 +0", "456 +0", "silence"]);
}

#[test]
fn garbage_is_a_warning_and_one_loss_until_a_good_line_comes() {
    let said = hear(b"t1230\rt12\x80\rgarbage\rt4560\rt4561\r\r\x07", false);
    let told = |line: &str| format!("slcan:tty: not a frame: {line}. Bytes are lost on the port");
    assert_eq!(said[2..4], ["123 +0", "lost None"]);
    assert!(said[4].starts_with("slcan:tty: not a frame: "), "{said:?}");
    assert_eq!(said[5], told(&shown(b"garbage")));
    assert_eq!(said[6..8], ["456 +0", "lost None"]);
    assert_eq!(said[8], told(&shown(b"t4561")));
    assert_eq!(said[9..], ["silence"]);
}

#[test]
fn one_that_never_ends_a_line_is_told_once_and_something_is_lost() {
    let said = hear(&[b'x'; 4000], false);
    assert_eq!((said[2].as_str(), said.len()), ("lost None", 5));
    assert!(said[3].contains("it sends, but not slcan"), "{said:?}");
}

/// FFFh is an overrun, error passive and a bus error: three error frames.
#[test]
fn a_flood_of_states_is_told_once_and_counted() {
    let said = hear(&b"F00\rFFF\r".repeat(400), false);
    let [errors @ .., silence, note] = &said[2..] else { panic!("{said:?}") };
    assert_eq!((errors.len(), silence.as_str()), (3, "silence"), "{said:?}");
    assert!(note.contains(": 798 lines about the adapter's own state"), "{said:?}");
    let said = hear(&b"e1s\r".repeat(400), false);
    assert_eq!(said.len(), 2 + 400 + 1, "each is an error on the bus");
}

#[test]
fn a_line_that_is_cut_is_a_loss() {
    let said = hear(b"t1230\rt45\x07t4560\r", false);
    assert_eq!(said[2..4], ["123 +0", "lost None"]);
    assert!(said[4].contains("a line that BEL cuts"), "{said:?}");
    assert_eq!(said[5..], ["456 +0", "silence"]);
}

#[test]
fn what_was_begun_when_the_adapter_is_unplugged_is_a_loss() {
    struct Unplugged(&'static [u8]);
    impl Read for Unplugged {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            self.0.read(buffer)
        }
    }
    impl Write for Unplugged {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let rate = Rate::new(500_000).expect("adapters have it");
    let setting = Setting { name: String::new(), rate, has_stamps: true, is_confirmed: true };
    for (told, losses) in [(&b"t12381122"[..], 1), (b"t1230\r", 0)] {
        let (mut ear, mut out) = (Ear::new("tty", "slcan:tty"), Outbox::default());
        let mut port = Adapter::new(Unplugged(told));
        ear.listen(&mut port, &setting, &mut out).expect("there is something");
        ear.listen(&mut port, &setting, &mut out).expect_err("it is gone");
        let mut lost = 0;
        while let Some(piece) = out.next() {
            lost += i32::from(matches!(piece, Ok(Piece::Heard(_, Event::Lost(_)))));
        }
        assert_eq!(lost, losses, "{told:?}");
    }
}

#[test]
fn garbage_without_end_is_not_told_without_end() {
    // Noise has refusals among it, and empty lines.
    let said = hear(&b"x\r\x07\r".repeat(1000), false);
    // The bus, how it is set, the loss, the lines, the silence, what the end says.
    assert_eq!(said.len(), 3 + MOST_TOLD as usize + 2);
    assert!(said[2 + MOST_TOLD as usize].ends_with("More such lines are not told"));
    assert!(said[4 + MOST_TOLD as usize].contains("980 more lines are no frames: it sends, but"));
}
