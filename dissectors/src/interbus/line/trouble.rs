//! What is wrong with a cycle beyond its checksum.

use super::cycle::{Cycle, Frame, Select, Trouble, WIRES};

/// Cycles in which a control word has to stay as it is for a change to be worth telling: what it
/// means is not known, and it may change all the time.
const STEADY: u32 = 20;

/// How long cycles are.
#[derive(Clone, Copy, Debug)]
struct Length {
    /// Those before.
    usual: u16,
    /// The last one.
    last: u16,
}

/// Compares cycles with those before.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    /// A cycle without trouble was heard: a capture may begin anywhere.
    is_begun: bool,
    /// Bytes of cycles with these flags.
    length: [Option<Length>; 8],
    /// The control word of each wire in cycles with these flags, and for how many cycles.
    control: [[Option<(u16, u32)>; 8]; WIRES],
}

impl Watch {
    /// What is wrong. `has_partner`: every cycle is to be on both wires.
    pub fn judge(&mut self, cycle: &Cycle, has_partner: bool) -> Option<Trouble> {
        let damage = self.damage(cycle, has_partner);
        if damage.is_some() {
            let is_sure = cycle.frames().all(|frame| !frame.raw.is_doubtful);
            return damage.filter(|_| self.is_begun && is_sure);
        }
        self.is_begun = true;
        let control = self.control(cycle);
        self.length(cycle).or(Self::loopback(cycle)).or(control)
    }

    /// The line was not heard for a while.
    pub fn forget(&mut self) {
        self.is_begun = false;
    }

    fn damage(&self, cycle: &Cycle, has_partner: bool) -> Option<Trouble> {
        let bad: u16 = cycle.frames().map(|frame| frame.raw.bad).fold(0, u16::saturating_add);
        let cut = cycle.frames().find(|frame| !frame.raw.is_whole);
        match (bad, cut) {
            (1.., _) => Some(Trouble::StopBits(bad)),
            (0, Some(cut)) => Some(Trouble::Cut(cut.bytes().len() as u16)),
            (0, None) if has_partner && cycle.frames().count() < WIRES => Some(Trouble::Missing),
            (0, None) => cycle.uneven().map(|(sent, back)| Trouble::Uneven { sent, back }),
        }
    }

    /// A length that is another. One cycle alone may have a character too many: the next one is
    /// compared with those before it.
    fn length(&mut self, cycle: &Cycle) -> Option<Trouble> {
        if cycle.select != Select::Data {
            return None;
        }
        let now = cycle.frames().map(|frame| frame.registers().len()).max()? as u16;
        let known = &mut self.length[kind(cycle)];
        let Length { usual: before, last } = known.unwrap_or(Length { usual: now, last: now });
        let usual = if now == last { now } else { before };
        *known = Some(Length { usual, last: now });
        let is_new = now != before && now != last;
        let [before, now] = [before, now].map(|length| length.saturating_sub(2));
        is_new.then_some(Trouble::Length { before, now })
    }

    fn loopback(cycle: &Cycle) -> Option<Trouble> {
        let mut words = cycle.frames().filter_map(Frame::loopback);
        let (sent, back) = (words.next()?, words.next()?);
        (sent != back).then_some(Trouble::Loopback { sent, back })
    }

    fn control(&mut self, cycle: &Cycle) -> Option<Trouble> {
        let kind = kind(cycle);
        let mut change = None;
        for (known, frame) in self.control.iter_mut().zip(&cycle.wires) {
            let Some(now) = frame.as_ref().and_then(Frame::control) else { continue };
            let known = &mut known[kind];
            *known = match *known {
                Some((word, count)) if word == now => Some((word, count.saturating_add(1))),
                Some((before, count)) => {
                    if count >= STEADY {
                        change = change.or(Some(Trouble::Control { before, now }));
                    }
                    Some((now, 1))
                }
                None => Some((now, 1)),
            };
        }
        change
    }
}

/// Cycles with the same flags are of the same kind, whatever it is.
fn kind(cycle: &Cycle) -> usize {
    cycle.frames().next().map_or(0, |frame| usize::from(frame.raw.flags & 7))
}
