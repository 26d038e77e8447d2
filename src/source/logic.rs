//! Packed logic samples as a source: raw from a file or a pipe, or out of a session.

use super::samples::Samples;
use super::{Input, Piece, Place, Source, SourceError, SourceOptions};
use dissectors::bus::{Sampling, WireFacts};
use dissectors::event::{Clock, Event, Moment};
use dissectors::record::BusInfo;
use std::io::Read;

/// Bytes read at a time.
const BLOCK: usize = 256 * 1024;

/// Where the bytes of samples come from.
pub trait Blocks {
    /// The next bytes, or `None` at the end.
    ///
    /// # Errors
    /// There should be more and they cannot be read.
    fn next_block(&mut self) -> Result<Option<&[u8]>, SourceError>;
}

/// A capture of packed samples.
pub struct Logic {
    name: String,
    blocks: Box<dyn Blocks>,
    samples: Samples,
    sampling: Sampling,
    /// The bus of each channel, once it had an edge.
    buses: Vec<Option<usize>>,
    announced: usize,
    /// The channel whose levels are told next.
    turn: usize,
    is_over: bool,
}

impl Logic {
    /// Samples of these channels, at `rate` in Hz.
    ///
    /// # Errors
    /// The user asked for a channel that is not there.
    pub fn new(
        name: &str,
        blocks: Box<dyn Blocks>,
        rate: u64,
        unitsize: usize,
        channels: Vec<(String, usize)>,
        options: &SourceOptions,
    ) -> Result<Logic, SourceError> {
        let channels = options
            .chosen_lines(channels, |(channel, _)| channel)
            .map_err(|what| SourceError::new(name, Place::Whole, what))?;
        let samples = Samples::new(unitsize, channels);
        let uncertainty = u32::try_from(1_000_000_000_u64.div_ceil(rate)).unwrap_or(u32::MAX);
        let origin = Moment::from_ns(0);
        Ok(Logic {
            name: name.to_owned(),
            blocks,
            sampling: Sampling { ticks_per_second: rate, uncertainty, origin },
            buses: vec![None; samples.channels()],
            announced: 0,
            turn: samples.channels(),
            samples,
            is_over: false,
        })
    }

    /// Bare samples, as `sigrok-cli -O binary` writes them.
    ///
    /// # Errors
    /// The sample rate was not given, or a channel that is not there was asked for.
    pub fn raw(input: Input, options: &SourceOptions) -> Result<Logic, SourceError> {
        let name = input.name.clone();
        let rate = options.samplerate.ok_or_else(|| {
            let what = "raw samples do not tell their rate: give it with --samplerate";
            SourceError::new(&name, Place::Whole, what)
        })?;
        let channels = (0..8 * options.unitsize).map(|bit| (format!("D{bit}"), bit)).collect();
        let blocks = Box::new(Raw { input, buffer: vec![0; BLOCK], offset: 0 });
        Logic::new(&name, blocks, rate, options.unitsize, channels, options)
    }

    fn advance(&mut self) -> Result<bool, SourceError> {
        match self.blocks.next_block()? {
            Some(block) => {
                self.samples.take(block);
                self.turn = 0;
                Ok(true)
            }
            None if self.samples.incomplete() > 0 => {
                let what = "the last sample is not whole: the capture is cut, or --unitsize is not \
                            what it was written with";
                Err(SourceError::new(&self.name, Place::Whole, what))
            }
            None => {
                self.is_over = true;
                self.turn = 0;
                Ok(false)
            }
        }
    }
}

impl Source for Logic {
    fn next_piece(&mut self) -> Result<Option<Piece<'_>>, SourceError> {
        loop {
            let channel = self.turn;
            if channel == self.samples.channels() {
                if self.is_over {
                    return Ok(None);
                }
                self.advance()?;
                continue;
            }
            let bus = self.buses[channel];
            if self.is_over {
                self.turn += 1;
                let end = self.sampling.moment(self.samples.samples());
                match bus {
                    Some(bus) => return Ok(Some(Piece::End(bus, end))),
                    None => continue,
                }
            }
            match bus {
                Some(bus) => {
                    self.turn += 1;
                    let levels = self.samples.levels(channel);
                    return Ok(Some(Piece::Heard(bus, Event::Levels(levels))));
                }
                None if self.samples.has_edges(channel) => {
                    self.buses[channel] = Some(self.announced);
                    self.announced += 1;
                    let name = self.samples.name(channel).to_owned();
                    let info = BusInfo::new(name, Some(Clock::Sample));
                    let facts = WireFacts { sampling: Some(self.sampling), ..WireFacts::default() };
                    return Ok(Some(Piece::Bus(info, facts)));
                }
                None => self.turn += 1,
            }
        }
    }
}

/// Samples straight from a file or a pipe.
struct Raw {
    input: Input,
    buffer: Vec<u8>,
    offset: u64,
}

impl Blocks for Raw {
    fn next_block(&mut self) -> Result<Option<&[u8]>, SourceError> {
        let count = loop {
            match self.input.read(&mut self.buffer) {
                Ok(count) => break count,
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(error) => {
                    return Err(SourceError::io(&self.input.name, Place::Byte(self.offset), error));
                }
            }
        };
        self.offset += count as u64;
        Ok((count > 0).then(|| &self.buffer[..count]))
    }
}
