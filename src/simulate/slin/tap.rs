//! Where a capture is taken: the line as it goes by, in stretches.

use super::receiver::{Heard, Receiver, Setup};
use crate::simulate::level::Low;
use crate::simulate::samples::Sampler;
use crate::simulate::time::Ps;
use anyhow::Result;

/// What happened on the line during a stretch of time. Stretches follow each other without gaps.
pub struct Stretch<'a> {
    /// When the line was low, in order.
    pub spans: &'a [Low],
    /// Nothing is known of the line from here on.
    pub until: Ps,
    /// Where the tap missed what was on the line.
    pub gap: Option<Gap>,
}

/// A piece of the line that a tap missed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Gap {
    /// Start of the first character that is missing.
    pub from: Ps,
    /// Characters that begin before this are missing.
    pub to: Ps,
    /// Why.
    pub loss: Loss,
}

/// Why characters are missing.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Loss {
    /// The receiver was too slow.
    Overrun,
    /// Something behind it was.
    Lost,
}

/// Something that listens to the line and writes a capture.
pub trait Tap {
    /// Hears a stretch.
    ///
    /// # Errors
    /// The capture cannot be written.
    fn hear(&mut self, stretch: &Stretch<'_>) -> Result<()>;

    /// The capture ends here.
    ///
    /// # Errors
    /// The capture cannot be written.
    fn end(self: Box<Self>, at: Ps) -> Result<()>;
}

/// A form of capture that holds characters.
pub trait Characters {
    /// A character, or a break.
    ///
    /// # Errors
    /// It cannot be written.
    fn character(&mut self, heard: &Heard) -> Result<()>;

    /// Characters from here on are missing.
    ///
    /// # Errors
    /// It cannot be written, or the form cannot say so.
    fn loss(&mut self, loss: Loss, at: Ps) -> Result<()>;

    /// The capture ends here.
    ///
    /// # Errors
    /// It cannot be written.
    fn end(self, at: Ps) -> Result<()>;
}

/// A tap with a UART.
pub struct Uart<C> {
    receiver: Receiver,
    capture: C,
    heard: Vec<Heard>,
    /// A gap that is still to come.
    gap: Option<Gap>,
    /// Characters before this are missing.
    missing: Ps,
}

impl<C: Characters> Uart<C> {
    /// A tap with this receiver, which writes to this capture.
    pub fn new(setup: Setup, capture: C) -> Self {
        Uart { receiver: Receiver::new(setup), capture, heard: Vec::new(), gap: None, missing: 0 }
    }

    fn pass_on(&mut self) -> Result<()> {
        for heard in self.heard.drain(..) {
            if let Some(gap) = self.gap.take_if(|gap| heard.start >= gap.from) {
                self.capture.loss(gap.loss, gap.from)?;
                self.missing = gap.to;
            }
            if heard.start >= self.missing {
                self.capture.character(&heard)?;
            }
        }
        Ok(())
    }
}

impl<C: Characters> Tap for Uart<C> {
    fn hear(&mut self, stretch: &Stretch<'_>) -> Result<()> {
        self.gap = self.gap.or(stretch.gap);
        self.receiver.listen(stretch.spans, stretch.until, &mut self.heard);
        self.pass_on()
    }

    fn end(mut self: Box<Self>, at: Ps) -> Result<()> {
        self.receiver.listen(&[], at, &mut self.heard);
        self.pass_on()?;
        self.capture.end(at)
    }
}

/// A tap that looks at the line's level.
impl Tap for Sampler {
    fn hear(&mut self, stretch: &Stretch<'_>) -> Result<()> {
        self.watch(stretch.spans, stretch.until)
    }

    fn end(self: Box<Self>, at: Ps) -> Result<()> {
        self.finish(at)
    }
}
