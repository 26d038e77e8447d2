//! What the nodes of a bus share: frames that wait for the bus, and fate.

use super::explicit::Piece;
use super::fate::Fate;
use super::frame::Frame;
use crate::simulate::time::{Clock, Ps};

/// What a frame is: the generator knows what an observer has to find out.
#[derive(Clone, Debug)]
pub struct Note {
    /// The kind of its record.
    pub kind: &'static str,
    /// Who sends it.
    pub source: u8,
    /// Whom it is for, if for one.
    pub destination: Option<u8>,
    /// The slave that it is about.
    pub station: Option<u8>,
    /// Which part of a message it is.
    pub piece: Piece,
    /// The service, and what it is about, of a whole message or its last fragment.
    pub about: Option<About>,
    /// The position that it holds.
    pub position: Option<u32>,
}

/// A service, and what it is about.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct About {
    /// Service code without the R/R bit.
    pub service: u8,
    /// Class and instance.
    pub object: Option<(u8, u8)>,
    /// Attribute.
    pub attribute: Option<u8>,
}

impl Note {
    /// A frame from one node to another.
    pub fn new(kind: &'static str, source: u8, destination: Option<u8>, station: u8) -> Self {
        Note {
            kind,
            source,
            destination,
            station: Some(station),
            piece: Piece::Whole,
            about: None,
            position: None,
        }
    }

    /// The same as this part of a message.
    pub fn piece(self, piece: Piece) -> Self {
        Note { piece, ..self }
    }
}

/// A frame that waits for the bus.
#[derive(Clone)]
pub struct Sending {
    /// It is there from then on.
    pub ready: Ps,
    /// What.
    pub frame: Frame,
    /// What that is.
    pub note: Note,
    /// Whose.
    pub sender: usize,
    /// By what it is sent.
    pub clock: Clock,
    /// Attempts so far.
    pub tries: u32,
    number: u64,
}

/// A node on the bus.
pub trait Node {
    /// When it has something to do next.
    fn next(&self) -> Ps;

    /// It does what is due.
    fn wake(&mut self, now: Ps, air: &mut Air);

    /// A frame of somebody else was on the bus, up to now.
    fn hear(&mut self, frame: &Frame, now: Ps, air: &mut Air);

    /// A frame of its own was on the bus, up to now.
    fn sent(&mut self, frame: &Frame, now: Ps, air: &mut Air);

    /// By what it sends.
    fn clock(&self) -> Clock;
}

/// What a shaft does, and until when: who sets presets knows what the machine does next.
#[derive(Clone, Copy, Default)]
pub struct Pace {
    is_at_rest: bool,
    until: Ps,
}

impl Pace {
    /// Nothing is known of a shaft whose speed changes.
    pub fn new(pace: Option<(bool, Ps)>) -> Self {
        pace.map_or(Pace::default(), |(is_at_rest, until)| Pace { is_at_rest, until })
    }

    /// Whether it rests until then.
    pub fn rests(self, until: Ps) -> bool {
        self.is_at_rest && self.until > until
    }

    /// Whether it turns until then.
    pub fn turns(self, until: Ps) -> bool {
        !self.is_at_rest && self.until > until
    }
}

/// What nodes share.
pub struct Air {
    /// Whether faults strike.
    pub fate: Fate,
    /// What the encoders' shafts do, by MAC ID.
    pub paces: [Pace; 64],
    waiting: Vec<Sending>,
    number: u64,
    /// Who is at it: sends on its behalf.
    pub turn: (usize, Clock),
}

impl Air {
    /// A silent bus.
    pub fn new(fate: Fate, clock: Clock) -> Self {
        Air { fate, paces: [Pace::default(); 64], waiting: Vec::new(), number: 0, turn: (0, clock) }
    }

    /// Whoever is at it sends this as soon as the bus is free after `ready`.
    pub fn send(&mut self, ready: Ps, frame: Frame, note: Note) {
        self.number += 1;
        let ((sender, clock), number) = (self.turn, self.number);
        self.waiting.push(Sending { ready, frame, note, sender, clock, tries: 0, number });
    }

    /// A stranger sends this.
    pub fn send_as_stranger(&mut self, ready: Ps, frame: Frame, note: Note) {
        let turn = self.turn;
        self.turn.0 = usize::MAX;
        self.send(ready, frame, note);
        self.turn = turn;
    }

    /// Whoever is at it lost power: nothing of its own is sent any more.
    pub fn fall_silent(&mut self) {
        let (silent, _) = self.turn;
        self.waiting.retain(|sending| sending.sender != silent);
    }

    /// Whether such a frame waits.
    pub fn is_waiting(&self, id: u16) -> bool {
        self.waiting.iter().any(|sending| sending.frame.devicenet_id() == Some(id))
    }

    /// When the next frame begins, if the bus is free from this time on.
    pub fn next_start(&self, free: Ps) -> Option<Ps> {
        self.waiting.iter().map(|sending| sending.ready.max(free)).min()
    }

    /// Who wins the arbitration at this time.
    pub fn arbitrate(&mut self, start: Ps) -> Option<Sending> {
        let ready = self.waiting.iter().enumerate().filter(|(_, sending)| sending.ready <= start);
        let (winner, _) =
            ready.min_by_key(|(_, sending)| (sending.frame.rank(), sending.number))?;
        Some(self.waiting.swap_remove(winner))
    }

    /// It has to be sent again.
    pub fn again(&mut self, sending: Sending) {
        self.waiting.push(Sending { tries: sending.tries + 1, ..sending });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::devicenet::plan::{Mode, example};

    #[test]
    fn the_lowest_identifier_goes_first_of_those_that_are_ready() {
        let clock = Clock::exact(125_000);
        let mut air = Air::new(Fate::new(&example(Mode::Poll, &[])), clock);
        let note = || Note::new("io", 0, None, 5);
        for (ready, id) in [(10, 0x4BD), (10, 0x3D7), (20, 0x345)] {
            air.send(ready, Frame::new(id, &[]), note());
        }
        let mut next = |free| {
            let start = air.next_start(free).unwrap();
            (start, air.arbitrate(start).unwrap().frame.devicenet_id())
        };
        assert_eq!(next(0), (10, Some(0x3D7)));
        assert_eq!(next(15), (15, Some(0x4BD)));
        assert_eq!(next(15), (20, Some(0x345)));
    }
}
