//! Where events come from: one file a format.

mod chars;
mod error;
mod input;
mod lines;
mod numbers;

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
    }
}

fn recognize(head: &[u8]) -> Option<InputFormat> {
    chars::is_header(head).then_some(InputFormat::Chars)
}
