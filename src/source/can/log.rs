//! A log of CAN frames, one a line, in whatever words.

use super::super::buses::Buses;
use super::super::lines::Lines;
use super::super::outbox::{Outbox, Reader};
use super::super::rows::shown;
use super::super::{Input, Place, SourceError, SourceOptions};
use dissectors::bus::WireFacts;
use dissectors::can::Frame;
use dissectors::event::{Clock, Loss, LossCause, Moment};
use dissectors::protocol::Medium;
use dissectors::record::BusInfo;

/// Most lines that are told of one by one.
const MOST_TOLD: u64 = 20;

/// How the lines of a format are read.
pub trait Grammar {
    /// What the format is called in messages.
    const NAME: &'static str;

    /// Reads the next line.
    fn read<'a>(&mut self, line: &'a [u8]) -> Said<'a>;
}

/// What a line says.
pub enum Said<'a> {
    /// Nothing of the bus.
    Nothing,
    /// It is of another kind: text, or a frame that no dissector here knows.
    Foreign,
    /// It should be a frame, and is not: this is wrong with it.
    Bad(&'static str),
    /// A frame on the bus of this name.
    Frame(Name<'a>, Frame),
    /// So many frames were lost on this bus, if they were counted.
    Lost(Name<'a>, Option<u64>),
    /// Something that people may want to know about a bus at this time.
    Remark(Name<'a>, Moment, &'a [u8]),
    /// The log cannot be read any further, for this reason.
    End(&'static str),
}

/// What a format calls a bus.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Name<'a> {
    /// A name.
    Text(&'a [u8]),
    /// A channel by its number.
    Number(u32),
    /// There is but one.
    Only,
}

impl Name<'_> {
    fn is(self, name: &str) -> bool {
        match self {
            // Names that are no UTF-8 are known by what is shown of them.
            Name::Text(text) => match std::str::from_utf8(text) {
                Ok(text) => text == name,
                Err(_) => String::from_utf8_lossy(text) == name,
            },
            Name::Number(_) | Name::Only => self.to_text() == name,
        }
    }

    fn to_text(self) -> String {
        match self {
            Name::Text(text) => String::from_utf8_lossy(text).into_owned(),
            Name::Number(number) => format!("can{number}"),
            Name::Only => "can".to_owned(),
        }
    }
}

/// A log that is being read.
pub struct Log<G> {
    lines: Lines<Input>,
    source: String,
    grammar: G,
    directory: Directory,
    counts: Counts,
}

/// What the lines were so far.
#[derive(Default)]
struct Counts {
    /// Lines that the format has.
    good: u64,
    bad: u64,
    foreign: u64,
    first_foreign: Option<String>,
}

/// The buses that were named.
struct Directory {
    buses: Buses,
    heard: Vec<Heard>,
}

/// A bus that was named.
struct Heard {
    name: String,
    /// `None` where the user did not ask for it.
    number: Option<usize>,
    /// When its last frame was heard: losses have no time of their own.
    last: Option<Moment>,
    /// What was lost before its first frame, to be told with it.
    early: Option<Loss>,
}

impl Directory {
    /// The bus of that name, which appears if it is new, with a clock if it has times.
    fn find(
        &mut self,
        name: Name<'_>,
        has_times: bool,
        out: &mut Outbox,
    ) -> Result<&mut Heard, &'static str> {
        let known = self.heard.iter().position(|heard| name.is(&heard.name));
        let index = known.unwrap_or(self.heard.len());
        if known.is_none() {
            let (name, clock) = (name.to_text(), has_times.then_some(Clock::Log));
            let info = BusInfo::new(name.clone(), clock);
            let number = self.buses.number(info, Medium::Can, WireFacts::default(), out)?;
            self.heard.push(Heard { name, number, last: None, early: None });
        }
        Ok(&mut self.heard[index])
    }
}

/// Why a line is left out.
enum Problem {
    /// It is not what it should be.
    Bad(&'static str),
    /// Nor can any other be read.
    Fatal(&'static str),
}

impl From<&'static str> for Problem {
    fn from(what: &'static str) -> Self {
        Problem::Fatal(what)
    }
}

impl<G: Grammar> Log<G> {
    /// Reads lines from this input.
    pub fn new(input: Input, options: &SourceOptions, grammar: G) -> Self {
        let source = input.name.clone();
        let directory = Directory { buses: Buses::new(options), heard: Vec::new() };
        let lines = Lines::new(&source, input);
        Log { lines, source, grammar, directory, counts: Counts::default() }
    }

    /// Reads a line; false where there is none.
    fn line(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        let Log { lines, grammar, directory, counts, .. } = self;
        let Some(line) = lines.next_line()? else { return Ok(false) };
        let taken = take(grammar.read(line), line, directory, counts, out);
        let is_whole = lines.has_end();
        match taken {
            Ok(is_cut) if is_whole || !is_cut => {}
            Err(Problem::Fatal(what)) => return Err(lines.error(what)),
            Err(Problem::Bad(what)) if is_whole => {
                counts.bad += 1;
                if counts.bad <= MOST_TOLD {
                    out.warning(lines.error(format!("{what}: left out")).leaving_out(1));
                }
            }
            _ => return Err(lines.error("the file ends inside this line: it was cut")),
        }
        Ok(true)
    }

    /// Tells what was left out. A log of which nothing is known is none.
    fn finish(&self, out: &mut Outbox) -> Result<(), SourceError> {
        for Heard { number, early, .. } in &self.directory.heard {
            if let (Some(bus), Some(loss)) = (number, early) {
                out.lost(*bus, *loss);
            }
        }
        let Counts { good, bad, foreign, first_foreign } = &self.counts;
        let whole = |what: String| SourceError::new(&self.source, Place::Whole, what);
        if *good == 0 && bad + foreign > 0 {
            let first = first_foreign.as_deref().unwrap_or("what was told");
            let what = format!("no line of it is of a {} log: it begins with {first}", G::NAME);
            return Err(whole(what));
        }
        if let more @ 1.. = bad.saturating_sub(MOST_TOLD) {
            let what = format!("{more} more lines are no frames: left out");
            out.warning(whole(what).leaving_out(more));
        }
        if let Some(first) = first_foreign {
            let lines = if *foreign == 1 { "line that holds" } else { "lines that hold" };
            let what = format!("left out {foreign} {lines} no CAN or CAN FD frame");
            out.warning(whole(format!("{what}, the first is {first}")));
        }
        self.directory.buses.check(&self.source)
    }
}

/// Puts what a line says in the outbox. True if it is a frame with fewer bytes than it says.
fn take(
    said: Said<'_>,
    line: &[u8],
    directory: &mut Directory,
    counts: &mut Counts,
    out: &mut Outbox,
) -> Result<bool, Problem> {
    let is_good = !matches!(said, Said::Foreign | Said::Bad(_)) && !line.is_empty();
    counts.good += u64::from(is_good);
    match said {
        Said::Nothing => {}
        Said::Foreign => {
            counts.foreign += 1;
            counts.first_foreign.get_or_insert_with(|| shown(line));
        }
        Said::Bad(what) => return Err(Problem::Bad(what)),
        Said::End(what) => return Err(Problem::Fatal(what)),
        Said::Frame(name, frame) => {
            let heard = directory.find(name, frame.start.is_known(), out)?;
            heard.last = Some(frame.start);
            if let Some(bus) = heard.number {
                if let Some(loss) = heard.early.take() {
                    out.lost(bus, Loss { start: frame.start, ..loss });
                }
                out.frame(bus, frame);
            }
            return Ok(frame.is_cut());
        }
        Said::Lost(name, count) => {
            let heard = directory.find(name, true, out)?;
            let loss = Loss { start: Moment::UNKNOWN, count, cause: LossCause::Capture };
            match (heard.number, heard.last) {
                (Some(bus), Some(start)) => out.lost(bus, Loss { start, ..loss }),
                (Some(_), None) => {
                    heard.early = heard.early.map_or(Some(loss), |early| {
                        let count = early.count.zip(count).map(|(a, b)| a.saturating_add(b));
                        Some(Loss { count, ..loss })
                    })
                }
                (None, _) => {}
            }
        }
        Said::Remark(name, at, text) => {
            if let Some(bus) = directory.find(name, at.is_known(), out)?.number {
                out.comment(bus, at, &String::from_utf8_lossy(text));
            }
        }
    }
    Ok(false)
}

impl<G: Grammar> Reader for Log<G> {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        loop {
            if !self.line(out)? {
                self.finish(out)?;
                return Ok(false);
            }
            if out.is_full() || self.lines.may_wait() {
                return Ok(true);
            }
        }
    }
}
