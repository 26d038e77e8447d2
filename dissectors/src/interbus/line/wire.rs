//! One wire of a line: finds out how it is set up, then makes frames of its levels.

use super::find::{Check, Found, Given, find};
use super::frames::{Assembler, RawFrame, TELEGRAM};
use super::receiver::{Receiver, Telegram};
use crate::bus::Sampling;
use crate::edges::Edges;
use crate::event::Levels;
use alloc::{collections::VecDeque, vec::Vec};

/// Edges that are held back to find out what a wire is; more, if these do not tell, and at most so
/// many, or for so long, in s.
const ENOUGH: usize = 1 << 14;
const MOST: usize = 1 << 17;
const ENOUGH_SECONDS: u64 = 2;

/// Frames that wait for those of the other wire at most.
const MOST_WAITING: usize = 1 << 13;

/// What a wire carried, in order.
#[derive(Clone, Debug)]
pub enum Item {
    /// A frame.
    Frame(RawFrame),
    /// Nothing was heard from one tick to the other, which is long enough to reset all devices.
    Silence(u64, u64),
}

impl Item {
    /// When it is told.
    pub fn start(&self) -> u64 {
        match self {
            Item::Frame(frame) => frame.start,
            Item::Silence(_, deadline) => *deadline,
        }
    }
}

/// Whether it is time to find out how a wire is set up.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Pace {
    /// Not now.
    Fine,
    /// If what was heard says so already.
    Early,
    /// It is.
    Due,
}

/// A wire.
#[derive(Debug)]
pub struct Wire {
    stage: Stage,
    enough: usize,
    /// How it is set up, once that is known.
    pub found: Option<Found>,
    /// What was not used yet.
    pub waiting: VecDeque<Item>,
    /// Nothing is heard for so many ticks: all devices reset.
    silence: u64,
    /// The tick behind the last telegram.
    last: Option<u64>,
    is_silent: bool,
    /// Status telegrams and data telegrams without stop bit.
    pub bad: u64,
    pub telegrams: u64,
}

#[derive(Debug)]
enum Stage {
    Finding(Edges),
    Receiving {
        receiver: Receiver,
        assembler: Assembler,
    },
    /// It is not what it was said to be.
    Deaf {
        until: u64,
        edges: u64,
    },
}

impl Wire {
    /// A wire on which nothing was heard yet.
    pub fn new(silence: u64) -> Self {
        Wire {
            stage: Stage::Finding(Edges::default()),
            enough: ENOUGH,
            found: None,
            waiting: VecDeque::new(),
            silence,
            last: None,
            is_silent: false,
            bad: 0,
            telegrams: 0,
        }
    }

    /// Takes the next piece. Returns whether it may be time to find out how it is set up.
    pub fn hear(&mut self, levels: &Levels<'_>, ticks_per_second: u64) -> Pace {
        match &mut self.stage {
            Stage::Finding(held) => {
                held.add(levels);
                let first = held.ticks.first().copied().unwrap_or(held.until);
                let time = held.until.saturating_sub(first) / ticks_per_second.max(1);
                match () {
                    () if held.ticks.len() >= MOST || time >= ENOUGH_SECONDS => Pace::Due,
                    () if held.ticks.len() >= self.enough => Pace::Early,
                    () => Pace::Fine,
                }
            }
            Stage::Deaf { until, edges } => {
                *until = (*until).max(levels.until);
                *edges += levels.edges.len() as u64;
                Pace::Fine
            }
            Stage::Receiving { .. } => {
                self.receive(levels);
                Pace::Fine
            }
        }
    }

    /// Whether it is not known yet how it is set up, though levels were heard.
    pub fn is_finding(&self) -> bool {
        matches!(&self.stage, Stage::Finding(held) if !held.ticks.is_empty())
    }

    /// Level changes of which no telegrams could be made.
    pub fn strange(&self) -> u64 {
        match self.stage {
            Stage::Deaf { edges, .. } => edges,
            _ => 0,
        }
    }

    /// Finds out how it is set up, and receives what was held.
    pub fn find_out(&mut self, sampling: Sampling, given: Given, pace: Pace) {
        let Stage::Finding(held) = &mut self.stage else { return };
        let mut found = None;
        // In the same steps, however the line comes in pieces.
        while held.ticks.len() >= self.enough && self.enough < MOST {
            let convincing = find(&first(held, self.enough), sampling, given);
            found = convincing.filter(Found::is_convincing);
            self.enough *= 2;
            if found.is_some() {
                break;
            }
        }
        if found.is_none() && pace == Pace::Due {
            found = find(&first(held, MOST), sampling, given);
        } else if found.is_none() {
            return;
        }
        let held = core::mem::take(held);
        self.found = found;
        let Some(found) = self.found else {
            self.stage = Stage::Deaf { until: held.until, edges: held.ticks.len() as u64 };
            return;
        };
        self.begin(&found, found.check, given.check_length);
        self.receive(&held.levels());
    }

    fn begin(&mut self, found: &Found, check: Option<Check>, check_length: u16) {
        let receiver = Receiver::new(found.shape);
        let assembler = Assembler::new(found.shape.bit, check, check_length);
        self.stage = Stage::Receiving { receiver, assembler };
    }

    fn receive(&mut self, levels: &Levels<'_>) {
        let Stage::Receiving { receiver, assembler } = &mut self.stage else { return };
        let Some(found) = self.found else { return };
        let bit = found.shape.bit;
        let (waiting, silence) = (&mut self.waiting, self.silence);
        let (last, is_silent) = (&mut self.last, &mut self.is_silent);
        let (bad, telegrams) = (&mut self.bad, &mut self.telegrams);
        receiver.hear(levels, &mut |telegram: Telegram| {
            if let Some(deadline) = last.map(|last| last.saturating_add(silence))
                && telegram.start > deadline
                && !*is_silent
            {
                assembler.pass(telegram.start, &mut |frame| push(waiting, Item::Frame(frame)));
                push(waiting, Item::Silence(deadline - silence, deadline));
            }
            *is_silent = false;
            let bits = if telegram.data.is_some() { TELEGRAM } else { 5 };
            *last = Some(telegram.start.saturating_add((bits as f64 * bit) as u64));
            *bad += u64::from(!telegram.is_good);
            *telegrams += 1;
            assembler.take(telegram, &mut |frame| push(waiting, Item::Frame(frame)));
        });
        let known = receiver.open().unwrap_or(receiver.until);
        assembler.pass(known, &mut |frame| push(waiting, Item::Frame(frame)));
        if let Some(deadline) = last.map(|last| last.saturating_add(silence))
            && known > deadline
            && !*is_silent
        {
            *is_silent = true;
            push(waiting, Item::Silence(deadline - silence, deadline));
        }
    }

    /// Everything that begins before this tick is among what waits.
    pub fn known(&self) -> u64 {
        match &self.stage {
            Stage::Finding(_) => 0,
            Stage::Deaf { .. } => u64::MAX,
            Stage::Receiving { receiver, assembler } => {
                let open = [receiver.open(), assembler.open()];
                open.into_iter().flatten().fold(receiver.until, u64::min)
            }
        }
    }

    /// So many frames wait that the other wire must be dead.
    pub fn is_full(&self) -> bool {
        self.waiting.len() >= MOST_WAITING
    }

    /// What may tell status telegrams, by what was seen so far.
    pub fn status(&self) -> Option<u8> {
        match &self.stage {
            Stage::Receiving { receiver, .. } => Some(receiver.status()),
            _ => None,
        }
    }

    /// Takes a frame back.
    pub fn reuse(&mut self, frame: RawFrame) {
        if let Stage::Receiving { assembler, .. } = &mut self.stage {
            assembler.reuse(frame);
        }
    }

    /// The line is not heard any further, or not for a while.
    pub fn end(&mut self) {
        self.last = None;
        self.is_silent = false;
        if let Stage::Receiving { receiver, assembler } = &mut self.stage {
            receiver.end();
            assembler.end();
        }
    }

    /// Another capture begins: ticks are others.
    pub fn go_on(&mut self, factor: f64, silence: u64, check_length: u16) {
        self.silence = silence;
        if let Some(found) = &mut self.found {
            found.shape.bit *= factor;
        }
        match (self.found, &mut self.stage) {
            (Some(found), _) => self.begin(&found, found.check, check_length),
            (None, stage) => *stage = Stage::Finding(Edges::default()),
        }
    }
}

/// The first edges, so many at most.
fn first(held: &Edges, count: usize) -> Edges {
    let ticks: Vec<u64> = held.ticks.iter().copied().take(count).collect();
    let until = match held.ticks.get(count) {
        Some(_) => ticks.last().map_or(held.until, |last| last + 1),
        None => held.until,
    };
    Edges { ticks, until, ..*held }
}

fn push(waiting: &mut VecDeque<Item>, item: Item) {
    waiting.push_back(item);
}

/// What two wires carried at the same time.
pub struct Pair {
    /// Both, or one.
    pub items: [Option<Item>; 2],
    /// The other wire is known to have carried nothing then.
    pub is_known: bool,
}

/// Two wires' items in pairs: those of the same cycle together.
pub fn next_pair(wires: &mut [Wire], is_end: bool) -> Option<Pair> {
    let [first, rest @ ..] = wires else { return None };
    let Some(second) = rest.first_mut() else {
        let item = first.waiting.pop_front()?;
        return Some(Pair { items: [Some(item), None], is_known: false });
    };
    let is_forced = is_end || first.is_full() || second.is_full();
    let (a, b) = (first.waiting.front(), second.waiting.front());
    let is_known = match (a, b) {
        (Some(a), None) => second.known() > end_of(a),
        (None, Some(b)) => first.known() > end_of(b),
        _ => true,
    };
    let take = match (a, b) {
        (None, None) => return None,
        (Some(Item::Frame(a)), Some(Item::Frame(b))) if is_same_cycle(a, b) => [true, true],
        (Some(a), Some(b)) => [a.start() <= b.start(), a.start() > b.start()],
        (Some(_), None) if is_forced || is_known => [true, false],
        (None, Some(_)) if is_forced || is_known => [false, true],
        _ => return None,
    };
    let [first, second] = [(first, take[0]), (second, take[1])];
    let take = |(wire, is_taken): (&mut Wire, bool)| {
        if is_taken { wire.waiting.pop_front() } else { None }
    };
    Some(Pair { items: [first, second].map(take), is_known })
}

fn end_of(item: &Item) -> u64 {
    match item {
        Item::Frame(frame) => frame.end,
        Item::Silence(_, deadline) => *deadline,
    }
}

/// What goes out and what comes back at the same time is one cycle.
fn is_same_cycle(a: &RawFrame, b: &RawFrame) -> bool {
    let overlap = a.end.min(b.end).saturating_sub(a.start.max(b.start));
    let length = |frame: &RawFrame| frame.end.saturating_sub(frame.start);
    let shorter = length(a).min(length(b));
    overlap > shorter / 2
}

/// What one wire found out that holds for the other: nothing of it is to be tried there.
pub fn hints(given: Given, wires: &[Wire]) -> Given {
    let known: Vec<&Found> = wires.iter().filter_map(|wire| wire.found.as_ref()).collect();
    let Some(found) = known.first() else { return given };
    Given {
        bitrate: given.bitrate.or(Some(found.bitrate)),
        status: given.status & found.shape.status,
        check: given.check.or(found.check),
        ..given
    }
}
