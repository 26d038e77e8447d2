//! Where events come from: one file a format.

mod chars;
mod error;
mod input;
mod lines;
mod logic;
mod numbers;
mod samples;
mod sr;
mod vcd;

pub use error::{Place, SourceError};
pub use input::Input;

pub use numbers::{frequency, seconds_in_ns};

use dissectors::bus::WireFacts;
use dissectors::event::{Event, Moment};
use dissectors::record::BusInfo;
use dissectors::uart::Baud;

/// What a source has to say, in the order it was heard.
pub enum Piece<'a> {
    /// A bus appears. Its number is how many appeared before it.
    Bus(BusInfo, WireFacts),
    /// Something was heard on a bus.
    Heard(usize, Event<'a>),
    /// Somebody's comment on what was heard at this time, to be kept in conversions.
    Comment(usize, Moment, &'a str),
    /// The capture of a bus ends here; unknown where the source does not tell.
    End(usize, Moment),
}

/// A capture that is being read.
pub trait Source {
    /// The next piece, or `None` at the end.
    ///
    /// # Errors
    /// The source cannot go on. What came before is good.
    fn next_piece(&mut self) -> Result<Option<Piece<'_>>, SourceError>;
}

/// A capture format, as `--input-format` names it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
#[value(rename_all = "kebab-case")]
pub enum InputFormat {
    /// sigrok session
    Sr,
    /// Value change dump
    Vcd,
    /// Bare logic samples, as sigrok-cli -O binary writes them
    Logic,
    /// Characters as text: time,byte,parity
    Chars,
}

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
            let names: Vec<&str> = there.iter().map(&name).collect();
            return Err(format!("there is no channel {missing}: there is {}", names.join(", ")));
        }
        let is_wanted = |channel: &T| self.channels.iter().any(|wanted| wanted == name(channel));
        Ok(there.into_iter().filter(|c| self.channels.is_empty() || is_wanted(c)).collect())
    }
}

/// Opens a source. Its format is found from its content unless it is given.
///
/// # Errors
/// It cannot be read, or nothing tells what it is.
pub fn open(name: &str, options: &SourceOptions) -> Result<Box<dyn Source>, SourceError> {
    let input = Input::open(name)?;
    let format = options.format.or_else(|| recognize(input.head())).ok_or_else(|| {
        SourceError::new(
            &input.name,
            Place::Byte(0),
            "nothing tells which format this is: name it with --input-format",
        )
    })?;
    match format {
        InputFormat::Chars => Ok(Box::new(chars::Chars::new(input))),
        InputFormat::Sr => Ok(Box::new(sr::open(input, options)?)),
        InputFormat::Vcd => Ok(Box::new(vcd::Vcd::new(input, options)?)),
        InputFormat::Logic => Ok(Box::new(logic::Logic::raw(input, options)?)),
    }
}

fn recognize(head: &[u8]) -> Option<InputFormat> {
    let formats = [
        (sr::is_zip(head), InputFormat::Sr),
        (vcd::is_dump(head), InputFormat::Vcd),
        (chars::is_header(head), InputFormat::Chars),
    ];
    formats.into_iter().find(|(is_it, _)| *is_it).map(|(_, format)| format)
}
