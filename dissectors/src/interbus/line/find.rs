//! Bit rate, polarity and flags of a wire, found from its first level changes.
//!
//! Every setting is tried on the same piece of line. Right is the one under which status telegrams
//! and data telegrams have their stop bits, and one flag of a cycle's data telegrams is another in
//! its last characters: the check phase.

use super::receiver::{Flags, Receiver, Shape, StatusFlag, Telegram, bit};
use crate::bus::Sampling;
use crate::edges::{Edges, shortest_pulses};
use crate::event::Levels;
use alloc::{format, string::String, vec::Vec};

/// The rates there are (Beckhoff, Schneider): 2 Mbit/s with some devices.
const RATES: [u32; 2] = [500_000, 2_000_000];

/// Fewest samples of a bit.
const FEWEST_SAMPLES: f64 = 1.9;

/// How far a rate may be off one of the usual ones to be taken for it, in percent.
const SNAP: f64 = 3.0;

/// Edges after which it is asked whether a setting is worth going on with.
const CHUNK: usize = 512;

/// So long after a character, in bits, the next belongs to another cycle.
pub const PAUSE: u64 = 40;

/// Fewest telegrams of either kind, and cycles, to know a line by.
const ENOUGH: u32 = 8;
const ENOUGH_CYCLES: u32 = 2;

/// The flag that tells the check phase of a cycle, and its value there.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Check {
    /// Its place, from 0.
    pub place: u8,
    /// Its value.
    pub value: bool,
}

impl Check {
    /// Whether a character with these flags is part of a check phase.
    #[must_use]
    pub const fn is_in(self, flags: Flags) -> bool {
        bit(flags, self.place) == self.value
    }
}

/// What the user decided about a wire.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Given {
    /// Bit/s.
    pub bitrate: Option<u32>,
    /// The line idles low.
    pub inverted: Option<bool>,
    /// What may tell status telegrams, as in [`Shape::status`].
    pub status: u8,
    /// What tells the check phase.
    pub check: Option<Check>,
    /// Stop bits.
    pub stop_bits: u8,
    /// Characters of the check phase.
    pub check_length: u16,
}

/// What was found about a wire.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Found {
    /// The rate, as it is usual.
    pub bitrate: u32,
    /// How its characters are sent.
    pub shape: Shape,
    /// What tells the check phase, if anything does.
    pub check: Option<Check>,
    /// Status and data telegrams with a stop bit, and telegrams without.
    pub status: u32,
    pub data: u32,
    pub bad: u32,
    /// Cycles with a check phase.
    pub cycles: u32,
    /// Flags that status telegrams have.
    pub status_flags: u8,
}

impl Found {
    /// Whether 99 in 100 characters have their stop bits, of status and data telegrams.
    #[must_use]
    pub fn is_convincing(&self) -> bool {
        self.is_good() && self.data >= ENOUGH && self.cycles >= ENOUGH_CYCLES
    }

    /// Whether it is status telegrams and nothing else: what comes later may be cycles.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.bad == 0 && self.data == 0 && self.status >= 64
    }

    fn is_good(&self) -> bool {
        let all = self.status + self.data + self.bad;
        self.status >= ENOUGH && self.bad * 100 <= all
    }

    fn rank(&self) -> (bool, u32, i64) {
        let good = i64::from(self.status) + i64::from(self.data);
        (self.is_good(), self.cycles, good - 50 * i64::from(self.bad))
    }

    /// What it rests on.
    #[must_use]
    pub fn evidence(&self) -> String {
        format!(
            "stop bits of {} in the first {} characters: {} status, {} data",
            self.status + self.data,
            self.status + self.data + self.bad,
            self.status,
            self.data
        )
    }
}

/// Finds what is open. `None` if nothing gives characters with their stop bits.
pub fn find(edges: &Edges, sampling: Sampling, given: Given) -> Option<Found> {
    let polarities = match given.inverted {
        Some(is_inverted) => &[is_inverted][..],
        None => &[false, true],
    };
    let mut best: Option<Found> = None;
    for (bit, bitrate) in bits(edges, sampling, given) {
        for is_inverted in polarities.iter().copied() {
            for place in (0..StatusFlag::ALL.len()).filter(|place| given.status >> place & 1 == 1) {
                let shape =
                    Shape { bit, is_inverted, status: 1 << place, stop_bits: given.stop_bits };
                let found = attempt(edges, shape, bitrate, given);
                if best.as_ref().is_none_or(|best| found.rank() > best.rank()) {
                    best = Some(found);
                }
            }
        }
    }
    best.filter(Found::is_good)
}

/// How long a bit may be, in ticks, and the rate that it stands for.
fn bits(edges: &Edges, sampling: Sampling, given: Given) -> Vec<(f64, u32)> {
    let bit_of = |rate: u32| (sampling.ticks_per_second as f64 / f64::from(rate), rate);
    if let Some(rate) = given.bitrate {
        return alloc::vec![bit_of(rate)];
    }
    let usual = RATES.into_iter().map(bit_of);
    let measured = shortest_pulses(&edges.ticks).into_iter().take(2).map(|bit| {
        let rate = sampling.ticks_per_second as f64 / bit;
        let is_near = |usual: &&u32| (rate - f64::from(**usual)).abs() * 100.0 <= rate * SNAP;
        (bit, RATES.iter().find(is_near).copied().unwrap_or((rate + 0.5) as u32))
    });
    usual.chain(measured).filter(|(bit, rate)| *bit >= FEWEST_SAMPLES && *rate > 0).collect()
}

fn attempt(edges: &Edges, shape: Shape, bitrate: u32, given: Given) -> Found {
    let mut count = Count::new(shape, given);
    let mut receiver = Receiver::new(shape);
    let mut level = edges.level;
    // The last run may be cut, and is not counted.
    for ticks in edges.ticks.chunks(CHUNK) {
        let until = ticks.last().map_or(edges.until, |last| last + 1);
        let levels = Levels { edges: ticks, level, from: edges.from, until };
        receiver.hear(&levels, &mut |telegram| count.take(telegram));
        level ^= ticks.len() % 2 == 1;
        if count.is_hopeless() {
            break;
        }
    }
    let mut found = Found {
        bitrate,
        shape,
        check: given.check,
        status: count.status,
        data: count.data,
        bad: count.bad,
        cycles: 0,
        status_flags: count.status_flags,
    };
    if let Some((check, cycles)) = count.check(given.check) {
        (found.check, found.cycles) = (Some(check), cycles);
    }
    // Whatever tells the same telegrams apart may be the flag.
    found.shape.status = count.alike() & given.status | shape.status;
    found
}

/// What the telegrams of an attempt are like.
struct Count {
    bit: f64,
    check_length: u16,
    is_synchronized: bool,
    in_a_row: u8,
    status: u32,
    data: u32,
    bad: u32,
    status_flags: u8,
    data_flags: u8,
    /// Characters of the run at hand, and where the last of them began.
    run: u16,
    last: u64,
    blocks: [Block; 6],
}

/// Characters of a run in which a flag has a value.
#[derive(Clone, Copy, Default)]
struct Block {
    length: u16,
    /// There were others before it in the run.
    is_behind: bool,
    good: u32,
    wrong: u32,
}

impl Block {
    fn close(&mut self, check_length: u16) {
        if self.length > 0 {
            let is_good = self.length == check_length && self.is_behind;
            self.good += u32::from(is_good);
            self.wrong += u32::from(!is_good);
            self.length = 0;
        }
    }
}

impl Count {
    fn new(shape: Shape, given: Given) -> Self {
        Count {
            bit: shape.bit,
            check_length: given.check_length,
            is_synchronized: false,
            in_a_row: 0,
            status: 0,
            data: 0,
            bad: 0,
            status_flags: 0,
            data_flags: 0,
            run: 0,
            last: 0,
            blocks: [Block::default(); 6],
        }
    }

    fn take(&mut self, telegram: Telegram) {
        let is_status = telegram.data.is_none();
        if !self.is_synchronized {
            // A capture may begin anywhere in a character.
            self.in_a_row = if is_status && telegram.is_good { self.in_a_row + 1 } else { 0 };
            self.is_synchronized = self.in_a_row >= 3;
            self.bad += u32::from(!telegram.is_good && self.last > 0);
            self.last = telegram.start;
            return;
        }
        let is_apart =
            telegram.start.saturating_sub(self.last) as f64 > self.bit * (PAUSE + 13) as f64;
        if is_status || is_apart {
            self.end_run();
        }
        self.last = telegram.start;
        if !telegram.is_good {
            self.bad += 1;
        } else if is_status {
            self.status += 1;
            self.status_flags |= 1 << telegram.flags;
        } else {
            self.data += 1;
            self.data_flags |= 1 << telegram.flags;
        }
        if is_status {
            return;
        }
        for (place, block) in self.blocks.iter_mut().enumerate() {
            let check = Check { place: (place / 2) as u8, value: place % 2 == 1 };
            if !check.is_in(telegram.flags) {
                block.close(self.check_length);
                continue;
            }
            if block.length == 0 {
                block.is_behind = self.run >= 2;
            }
            block.length = block.length.saturating_add(1);
        }
        self.run = self.run.saturating_add(1);
    }

    /// One in five characters has no stop bit.
    fn is_hopeless(&self) -> bool {
        self.bad > 40 && self.bad * 4 > self.status + self.data
    }

    fn end_run(&mut self) {
        self.run = 0;
        self.blocks.iter_mut().for_each(|block| block.close(self.check_length));
    }

    /// The flag that tells the check phase: nearly all of its blocks are one.
    fn check(&self, given: Option<Check>) -> Option<(Check, u32)> {
        let all = self.blocks.iter().enumerate().map(|(place, block)| {
            (Check { place: (place / 2) as u8, value: place % 2 == 1 }, block)
        });
        let is_it = |(check, block): &(Check, &Block)| {
            let is_plain = block.good >= ENOUGH_CYCLES && block.wrong * 10 <= block.good;
            is_plain && given.is_none_or(|given| given == *check)
        };
        all.filter(is_it).max_by_key(|(_, block)| block.good).map(|(check, it)| (check, it.good))
    }

    /// The flags that would have told the same telegrams apart.
    fn alike(&self) -> u8 {
        let mut alike = 0;
        for (place, flag) in StatusFlag::ALL.iter().enumerate() {
            let seen = |all: u8| (0..8).filter(move |flags| all >> flags & 1 == 1);
            let is_alike = seen(self.status_flags).all(|flags| flag.is_status(flags))
                && seen(self.data_flags).all(|flags| !flag.is_status(flags));
            alike |= u8::from(is_alike) << place;
        }
        alike
    }
}
