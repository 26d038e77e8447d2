//! Where events come from: one file a format.

mod ahead;
mod buses;
mod bytes;
mod can;
mod chars;
#[cfg(test)]
mod damage;
mod error;
mod input;
pub mod interbus;
mod lanes;
mod lines;
mod link;
pub mod live;
mod logic;
mod marks;
mod misnamed;
mod numbers;
mod outbox;
mod parmrk;
mod pcap;
mod pcapng;
mod recognize;
mod rows;
mod rtac;
mod saleae;
mod samples;
mod selection;
mod sr;
mod stream;
pub mod tap_note;
#[cfg(test)]
mod transcript;
mod uart9;
mod vcd;

pub use error::{Place, SourceError};
pub use input::Input;
pub use live::LiveOptions;
pub use numbers::{frequency, seconds_in_ns};

pub(crate) use outbox::{Outbox, Reader, Reading};

use ahead::ReadingAhead;
use interbus::Layout;

use dissectors::bus::WireFacts;
use dissectors::event::{Event, Moment};
use dissectors::record::BusInfo;
use dissectors::uart::{Baud, Format};
use std::io::Read;

/// What a source has to say, in the order it was heard.
pub enum Piece<'a> {
    /// A bus appears. Its number is how many appeared before it.
    Bus(BusInfo, WireFacts),
    /// Something was heard on a bus.
    Heard(usize, Event<'a>),
    /// A bus of frames is listened to at this bit rate from here on, or at one that is not known.
    Bitrate(usize, Option<Baud>),
    /// Somebody's comment on what was heard at this time, to be kept in conversions.
    Comment(usize, Moment, &'a str),
    /// The capture of a bus ends here; unknown where the source does not tell.
    End(usize, Moment),
    /// Something about the source that the user should know, and that does not keep it from going
    /// on: what, where, and what to do.
    Warning(SourceError),
    /// What the user may want to know about the source, and need not worry about.
    Note(&'a str),
}

/// A capture that is being read.
pub trait Source {
    /// The next piece, or `None` at the end.
    ///
    /// # Errors
    /// The source cannot go on. What came before is good.
    fn next_piece(&mut self) -> Result<Option<Piece<'_>>, SourceError>;

    /// Nobody wants more than what is left to say where something that goes on ends here. Whether
    /// that is so: then the pieces up to the end are to be taken. A saved capture has none.
    fn stop(&mut self) -> bool {
        false
    }
}

/// A capture format, as `--input-format` names it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
#[value(rename_all = "kebab-case")]
pub enum InputFormat {
    /// Packet capture with serial characters (link type 250) or CAN frames (227, 113, 276)
    Pcap,
    /// Packet capture of several interfaces, serial or CAN
    Pcapng,
    /// sigrok session
    Sr,
    /// Value change dump
    Vcd,
    /// Saleae Logic 2: raw digital data as CSV
    SaleaeCsv,
    /// Saleae Logic 2: raw digital data in binary form
    SaleaeBin,
    /// Saleae Logic 2: characters of the Async Serial analyzer
    SaleaeTable,
    /// Bytes alone, parity unknown
    Bytes,
    /// Bytes of a Linux tty that marks parity errors (INPCK and PARMRK)
    Parmrk,
    /// 16-bit words, low byte first: data and the parity bit received
    Uart9,
    /// Bare logic samples, as sigrok-cli -O binary writes them
    Logic,
    /// Characters as text: time,byte,parity
    Chars,
    /// CAN: the log of candump (-l, -L)
    Candump,
    /// CAN: what candump prints on a terminal
    CandumpText,
    /// CAN: trace of PEAK's programs
    Trc,
    /// CAN: log of Vector's programs, or BUSMASTER's
    Asc,
    /// INTERBUS: process words as a controller logged them, as CSV
    InterbusLog,
    /// INTERBUS: the ID words of a ring
    InterbusId,
    /// INTERBUS: diagnostic registers and host messages
    InterbusDiagnostic,
}

/// Most channels of a logic analyzer that are believed: those of a sample of 64 bytes.
const MOST_CHANNELS: usize = 512;

/// What the user says about a source.
#[derive(Clone, Default, Debug)]
pub struct SourceOptions {
    /// Its format, instead of finding it from the content.
    pub format: Option<InputFormat>,
    /// The channels or interfaces to decode; all with traffic if empty.
    pub channels: Vec<String>,
    /// Sample rate in Hz, where the source does not tell it.
    pub samplerate: Option<u64>,
    /// Bytes a sample in raw logic captures.
    pub unitsize: usize,
    /// The rate, where the source needs one to place characters and does not tell it.
    pub baud: Option<Baud>,
    /// The character format, where the source needs one and does not tell it.
    pub frame: Option<Format>,
    /// How live taps are listened to.
    pub live: LiveOptions,
    /// How logs of INTERBUS are written.
    pub interbus: Layout,
}

impl SourceOptions {
    /// Those of a source's channels that the user asked for: all, unless some were named.
    ///
    /// # Errors
    /// One that was named is not there: which ones are.
    pub fn chosen<T>(&self, there: Vec<T>, name: impl Fn(&T) -> &str) -> Result<Vec<T>, String> {
        let missing = self
            .channels
            .iter()
            .find(|wanted| !there.iter().any(|channel| name(channel) == *wanted));
        if let Some(missing) = missing {
            // Names come from the capture, and this goes to a terminal.
            let names: Vec<String> =
                there.iter().map(|channel| name(channel).escape_debug().to_string()).collect();
            return Err(format!("there is no channel {missing}: there is {}", names.join(", ")));
        }
        let is_wanted = |channel: &T| self.channels.iter().any(|wanted| wanted == name(channel));
        Ok(there.into_iter().filter(|c| self.channels.is_empty() || is_wanted(c)).collect())
    }

    /// Of the channels of a logic analyzer, those that the user asked for.
    ///
    /// # Errors
    /// One that was named is not there, or there are more than any analyzer has.
    fn chosen_lines<T>(&self, there: Vec<T>, name: impl Fn(&T) -> &str) -> Result<Vec<T>, String> {
        if there.len() > MOST_CHANNELS {
            return Err(format!("there are {} channels, more than any analyzer has", there.len()));
        }
        self.chosen(there, name)
    }

    /// Checks the channels asked for where a source has only this one.
    ///
    /// # Errors
    /// Another one was asked for.
    fn choose_only(&self, channel: &str, source: &str) -> Result<(), SourceError> {
        match self.chosen(vec![channel], |channel| channel) {
            Ok(_) => Ok(()),
            Err(what) => Err(SourceError::new(source, Place::Whole, what)),
        }
    }
}

/// Opens a source, a live tap or a saved capture. The format of a capture is found from its content
/// unless it is given.
///
/// # Errors
/// It cannot be read, or nothing tells what it is.
pub fn open(name: &str, options: &SourceOptions) -> Result<Box<dyn Source>, SourceError> {
    match live::open(name, options) {
        Some(tap) => Ok(Box::new(live::Listening::begin(name, tap?))),
        None => reader_of(Input::open(name)?, options),
    }
}

/// Sources without the files among them that have nothing in them, and a warning of each: whoever
/// reads a folder of recorded files wants the others. Where there is nothing else, that is an error,
/// for whoever opens the first to find.
pub fn without_empty(names: &[String]) -> (Vec<&String>, Vec<SourceError>) {
    let has_nothing = |name: &&String| {
        std::fs::metadata(name).is_ok_and(|file| file.is_file() && file.len() == 0)
    };
    let (empty, filled): (Vec<_>, Vec<_>) = names.iter().partition(has_nothing);
    if filled.is_empty() {
        return (empty, Vec::new());
    }
    let what = "there is nothing in it: it is left out";
    let warnings = empty.into_iter().map(|name| SourceError::new(name, Place::Whole, what));
    (filled, warnings.collect())
}

/// Reads a stream that cannot be gone back in, as [`open`] does a file.
///
/// # Errors
/// It cannot be read, or nothing tells what it is.
pub fn open_stream(
    stream: impl Read + Send + 'static,
    options: &SourceOptions,
) -> Result<Box<dyn Source>, SourceError> {
    reader_of(Input::of("stream", stream)?, options)
}

fn reader_of(mut input: Input, options: &SourceOptions) -> Result<Box<dyn Source>, SourceError> {
    let format = match options.format.or_else(|| options.interbus.format()) {
        Some(format) => format,
        None => recognize::format_of(&mut input)?,
    };
    let is_saved = input.file().is_some();
    Ok(match format {
        InputFormat::Chars => Box::new(chars::Chars::new(input)),
        InputFormat::Candump => log(input, options, can::candump::Candump),
        InputFormat::CandumpText => {
            let grammar = can::console::Console::new(input.head());
            log(input, options, grammar)
        }
        InputFormat::Trc => log(input, options, can::trc::Trc::new()),
        InputFormat::Asc => log(input, options, can::asc::Asc::new()),
        InputFormat::InterbusLog => reading(is_saved, interbus::log::Log::new(input, options)?),
        InputFormat::InterbusId => {
            reading(is_saved, interbus::identification::List::new(input, options)?)
        }
        InputFormat::InterbusDiagnostic => {
            reading(is_saved, interbus::diagnostic::Registers::new(input, options)?)
        }
        InputFormat::Pcap => reading(is_saved, pcap::Pcap::new(input, options)),
        InputFormat::Pcapng => reading(is_saved, pcapng::PcapNg::new(input, options)),
        InputFormat::Sr => Box::new(sr::open(input, options)?),
        InputFormat::Vcd => Box::new(vcd::Vcd::new(input, options)?),
        InputFormat::Logic => Box::new(logic::Logic::raw(input, options)?),
        InputFormat::Bytes => reading(is_saved, bytes::Bytes::new(input, options)?),
        InputFormat::Parmrk => reading(is_saved, parmrk::Parmrk::new(input, options)?),
        InputFormat::Uart9 => reading(is_saved, uart9::Uart9::new(input, options)?),
        InputFormat::SaleaeCsv => reading(is_saved, saleae::digital::Digital::new(input, options)),
        InputFormat::SaleaeBin => reading(is_saved, saleae::binary::Binary::new(input, options)?),
        InputFormat::SaleaeTable => reading(is_saved, saleae::table::Table::new(input, options)),
    })
}

/// Everything of a saved capture is there to be read ahead.
fn reading(is_saved: bool, reader: impl Reader + Send + 'static) -> Box<dyn Source> {
    match is_saved {
        true => Box::new(ReadingAhead::begin(reader)),
        false => Box::new(Reading::new(reader)),
    }
}

fn log<G: can::Grammar + Send + 'static>(
    input: Input,
    options: &SourceOptions,
    grammar: G,
) -> Box<dyn Source> {
    reading(input.file().is_some(), can::Log::new(input, options, grammar))
}
