//! What a source says, in words: for tests.

use super::{Input, InputFormat, Piece, Source, SourceOptions, reader_of};
use dissectors::bus::{Sampling, WireFacts};
use dissectors::can::{Direction, Frame, FrameKind};
use dissectors::event::{Event, Moment};
use dissectors::interbus::Row;
use dissectors::record::BusInfo;

/// Everything that is read from these bytes, a line a piece. An error ends it.
pub fn transcript(format: InputFormat, bytes: &[u8], options: &SourceOptions) -> Vec<String> {
    let input = Input::of("test", std::io::Cursor::new(bytes.to_vec()));
    match input.and_then(|input| {
        reader_of(input, &SourceOptions { format: Some(format), ..options.clone() })
    }) {
        Ok(mut source) => of_source(&mut *source),
        Err(error) => vec![error.to_string()],
    }
}

/// Everything that a source says, a line a piece.
pub fn of_source(source: &mut dyn Source) -> Vec<String> {
    let mut lines = Vec::new();
    loop {
        match source.next_piece() {
            Ok(Some(piece)) => lines.push(line(&piece)),
            Ok(None) => return lines,
            Err(error) => {
                lines.push(error.to_string());
                assert!(matches!(source.next_piece(), Ok(None)), "goes on after an error");
                return lines;
            }
        }
    }
}

fn line(piece: &Piece<'_>) -> String {
    match piece {
        Piece::Bus(info, facts) => bus(info, facts),
        Piece::Heard(bus, event) => format!("{bus}: {}", heard(event)),
        Piece::Comment(bus, time, text) => format!("{bus}: comment{} {text:?}", at(*time)),
        Piece::Bitrate(bus, rate) => format!("{bus}: at {rate:?}"),
        Piece::End(bus, time) => format!("{bus}: end{}", at(*time)),
        Piece::Note(note) => format!("note: {note}"),
        Piece::Warning(warning) => format!("warning: {warning}"),
    }
}

fn bus(info: &BusInfo, facts: &WireFacts) -> String {
    let mut words = vec!["bus".to_owned(), info.name.clone()];
    words.extend(info.clock.map(|clock| clock.name().to_owned()));
    words.extend(facts.baud.map(|baud| baud.to_string()));
    words.extend(facts.format.map(|format| format.to_string()));
    words.extend(facts.spacing_is_assumed.then(|| "assumed".to_owned()));
    words.extend(facts.sampling.map(|Sampling { ticks_per_second, uncertainty, origin }| {
        format!("{ticks_per_second}/s ±{uncertainty}{}", at(origin))
    }));
    words.join(" ")
}

fn heard(event: &Event<'_>) -> String {
    match event {
        Event::Characters(characters) => {
            let words: Vec<String> = characters.iter().map(|c| format!("{c:?}")).collect();
            words.join(", ")
        }
        Event::Rows(rows) => {
            let words: Vec<String> = rows.iter().map(row).collect();
            words.join(", ")
        }
        Event::Frames(frames) => {
            let words: Vec<String> = frames.iter().map(frame).collect();
            words.join(", ")
        }
        Event::Levels(levels) => format!(
            "{} from {} {:?} until {}",
            if levels.level { "high" } else { "low" },
            levels.from,
            levels.edges,
            levels.until
        ),
        Event::Break(event) => format!("break{}±{}", at(event.start), event.uncertainty),
        Event::Lost(loss) => {
            let count = loss.count.map_or(String::new(), |count| format!(" {count}"));
            format!("lost{count} {:?}{}", loss.cause, at(loss.start))
        }
        Event::Advance(time) => format!("nothing until{}", at(*time)),
        // What lines carry is made of levels behind the sources.
        Event::Cycle(_) | Event::Silence(_) => unreachable!("no source says so"),
    }
}

/// A row: its device, what it holds, and when.
fn row(row: &Row) -> String {
    let device = row.device.map_or(String::new(), |device| format!("{} ", device.number()));
    format!("{device}{:X?}{}±{}", row.content, at(row.start), row.uncertainty)
}

/// A frame as candump would write it, with what else is known of it.
fn frame(frame: &Frame) -> String {
    let id = frame.id.value();
    let mut text = match (frame.kind, frame.id.is_extended()) {
        (FrameKind::Error, _) => format!("error {id:X}#"),
        (_, true) => format!("{id:08X}#"),
        (_, false) => format!("{id:03X}#"),
    };
    match frame.kind {
        FrameKind::Remote => text += &format!("R{}", frame.dlc),
        FrameKind::Fd => text.push('#'),
        FrameKind::Data | FrameKind::Error => {}
    }
    frame.bytes().iter().for_each(|byte| text += &format!("{byte:02X}"));
    if frame.dlc as usize != frame.bytes().len() && frame.kind == FrameKind::Data {
        text += &format!(" dlc {}", frame.dlc);
    }
    text += frame.direction.map_or("", |direction| match direction {
        Direction::Received => " R",
        Direction::Sent => " T",
    });
    if let Some(length) = frame.original_length {
        text += &format!(" cut of {length}");
    }
    text + &format!("{}±{}", at(frame.start), frame.uncertainty)
}

fn at(time: Moment) -> String {
    time.ns().map_or(String::new(), |ns| format!(" @{ns}"))
}
