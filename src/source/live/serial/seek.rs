//! Finds the rate of a line by listening at one after the other: SLIN's three, and TR's fourth
//! (Baumer SLIN §3.1, TR SLIN §1).
//!
//! Only the receiver's rate changes; the port stays open and nothing is sent. What was heard at the
//! rate that is settled on is kept.

use crate::source::outbox::Outbox;
use dissectors::event::{Break, Clock, Moment};
use dissectors::protocol::{Beginning, Medium, PROTOCOLS, Protocol, Settings, Speaks};
use dissectors::record::BusInfo;
use dissectors::uart::{self, Baud, Character, Format, ParityRule, Setup, Wire};
use std::time::{Duration, Instant};

/// The rates, the most common first.
pub const RATES: [Baud; 4] = [rate(115_200), rate(19_200), rate(9_600), rate(345_594)];

/// How long each is listened at.
pub const WINDOW: Duration = Duration::from_secs(2);

/// Characters that are enough to be sure before that.
const ENOUGH: usize = 16;

/// Characters that are enough to be sure afterwards: a request and its answer.
const FEW: usize = 4;

/// Characters that are judged at most.
const JUDGED: usize = 1024;

const fn rate(bits_per_second: u32) -> Baud {
    match Baud::new(bits_per_second) {
        Some(rate) => rate,
        None => panic!("no rate is 0"),
    }
}

/// Listens at one rate after the other.
pub struct Seek {
    past: Vec<Trial>,
    current: Trial,
    refused: Vec<(Baud, String)>,
    /// Characters at which the trial is looked at next.
    next_look: usize,
}

/// What is to be done next.
pub enum Step {
    /// Listen on.
    GoOn,
    /// Listen at this rate.
    Next(Baud),
    /// The rate is found, or there is none left to try.
    Settle,
}

/// What came of it.
pub struct Settled {
    /// The rate that fits best.
    pub baud: Baud,
    /// What was heard at it, beginning with what was put in the outbox first.
    pub heard: Outbox,
    /// When it was listened at for the first time.
    pub since: Instant,
    /// Whether anything was heard.
    pub was_heard: bool,
    /// The outcome at each rate, in a line.
    pub told: String,
    /// What the user should know.
    pub warning: Option<String>,
}

struct Trial {
    baud: Baud,
    since: Instant,
    heard: Outbox,
}

/// What a rate sounded like.
#[derive(PartialEq, Eq)]
enum Sound {
    Silent,
    /// Something about the set-up is wrong.
    Wrong(String),
    /// Characters that say nothing.
    Heard(usize),
    /// A protocol, with the evidence.
    Spoken(String),
}

impl Seek {
    /// Begins to listen at the first rate.
    pub fn new(since: Instant) -> Self {
        let current = Trial { baud: RATES[0], since, heard: Outbox::default() };
        Seek { past: Vec::new(), current, refused: Vec::new(), next_look: ENOUGH }
    }

    /// Goes on at the next rate.
    pub fn begin(&mut self, baud: Baud, since: Instant) {
        let next = Trial { baud, since, heard: Outbox::default() };
        self.past.push(std::mem::replace(&mut self.current, next));
        self.next_look = ENOUGH;
    }

    /// The port does not take this rate.
    pub fn refuse(&mut self, baud: Baud, why: String) {
        self.refused.push((baud, why));
    }

    /// Where what is heard belongs.
    pub fn outbox(&mut self) -> &mut Outbox {
        &mut self.current.heard
    }

    /// The rate to be tried next, if there is one left.
    pub fn next(&self) -> Step {
        let tried = self.past.len() + 1 + self.refused.len();
        RATES.get(tried).map_or(Step::Settle, |rate| Step::Next(*rate))
    }

    /// Looks at what was heard so far.
    pub fn look(&mut self, now: Instant, format: Format) -> Step {
        let count = self.current.heard.heard().len();
        let is_over = now.duration_since(self.current.since) >= WINDOW;
        if !is_over && count < self.next_look {
            return Step::GoOn;
        }
        // Looked at with 16, 32, 64 … characters: not with each anew.
        self.next_look = 2 * count.max(ENOUGH / 2);
        let is_sure = count >= FEW && matches!(self.current.sound(format), Sound::Spoken(_));
        match (is_sure, is_over) {
            (true, _) => Step::Settle,
            (false, true) => self.next(),
            (false, false) => Step::GoOn,
        }
    }

    /// Decides.
    pub fn settle(self, format: Format) -> Settled {
        let Seek { past, current, refused, .. } = self;
        let sound = current.sound(format);
        let last = format!("{} {}", current.baud, sound.say());
        let mut outcomes = Vec::new();
        let mut best = (sound, current);
        // Of rates that sound alike the first one tried is taken.
        for trial in past.into_iter().rev() {
            let sound = trial.sound(format);
            outcomes.insert(0, format!("{} {}", trial.baud, sound.say()));
            if sound.rank() >= best.0.rank() {
                best = (sound, trial);
            }
        }
        outcomes.push(last);
        outcomes.extend(refused.iter().map(|(baud, why)| format!("{baud} not possible: {why}")));
        let (sound, trial) = best;
        let was_heard = sound != Sound::Silent;
        let warning = (!was_heard).then(|| {
            format!(
                "nothing was heard at any rate: going on at {} Bd; check that the master is \
                 running and that the tap is wired A to A, B to B, ground to ground",
                trial.baud
            )
        });
        let told = format!("baud {} ({})", trial.baud, outcomes.join("; "));
        let since = trial.since;
        Settled { baud: trial.baud, heard: trial.heard, since, was_heard, told, warning }
    }
}

impl Trial {
    fn sound(&self, format: Format) -> Sound {
        let characters = self.heard.heard();
        let characters = &characters[..characters.len().min(JUDGED)];
        let breaks = self.heard.breaks();
        if characters.is_empty() && breaks == 0 {
            return Sound::Silent;
        }
        if let Some(finding) = wrong_setup(characters, breaks, format) {
            return Sound::Wrong(finding.to_owned());
        }
        match spoken(characters, self.baud, format) {
            Some(evidence) => Sound::Spoken(evidence),
            None => Sound::Heard(characters.len()),
        }
    }
}

/// What is wrong with the set-up, if enough was heard to tell.
fn wrong_setup(characters: &[Character], breaks: usize, format: Format) -> Option<&'static str> {
    let mut setup = match format.parity() {
        ParityRule::Even => Setup::with_even_parity(format),
        _ => Setup::default(),
    };
    let line_break = Break { start: Moment::UNKNOWN, uncertainty: 0, duration: None };
    let mut finding = None;
    for _ in 0..breaks {
        finding = finding.or(setup.hear_break(&line_break, None));
    }
    for character in characters {
        finding = finding.or(setup.hear(character));
    }
    let code = finding.or(setup.finish())?.code;
    Some(match code {
        code if code == &uart::SWAPPED_LINES => "swapped lines",
        code if code == &uart::WRONG_PARITY => "wrong parity",
        _ => "wrong rate",
    })
}

/// The protocol that is spoken, and the evidence.
fn spoken(characters: &[Character], baud: Baud, format: Format) -> Option<String> {
    let bus = BusInfo::new("", Some(Clock::Read));
    let (wire, settings) = (Wire::new(Some(baud), format), Settings::default());
    let beginning = Beginning { bus: &bus, wire, characters, frames: &[], settings: &settings };
    // The last one takes whatever nobody else does.
    let is_serial = |protocol: &&'static Protocol| {
        protocol.medium == Medium::Serial && **protocol != uart::PROTOCOL
    };
    PROTOCOLS.into_iter().filter(is_serial).find_map(|protocol| {
        match (protocol.speaks)(&beginning) {
            Speaks::Yes(evidence) => Some(format!("{}: {evidence}", protocol.name)),
            Speaks::No | Speaks::NoBut(_) => None,
        }
    })
}

impl Sound {
    /// The higher, the better it fits.
    fn rank(&self) -> (u8, usize) {
        match self {
            Sound::Silent => (0, 0),
            Sound::Wrong(_) => (1, 0),
            Sound::Heard(count) => (2, *count),
            Sound::Spoken(_) => (3, 0),
        }
    }

    fn say(&self) -> String {
        match self {
            Sound::Silent => "silent".to_owned(),
            Sound::Wrong(what) => what.clone(),
            Sound::Heard(1) => "heard 1 character".to_owned(),
            Sound::Heard(count) => format!("heard {count} characters"),
            Sound::Spoken(evidence) => evidence.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dissectors::uart::Parity;

    fn character(value: u16, parity: Parity) -> Character {
        Character::new(Moment::UNKNOWN, 0, value, parity)
    }

    /// What was told of a line that sounds so at each rate, and what was settled on.
    fn settled(sounds: [&[Character]; 4]) -> Settled {
        let since = Instant::now();
        let mut seek = Seek::new(since);
        for (number, sound) in sounds.into_iter().enumerate() {
            seek.outbox().characters(0, sound.iter().copied());
            if let Step::Next(baud) = seek.look(since + WINDOW, Format::FT12) {
                assert_eq!(baud, RATES[number + 1]);
                seek.begin(baud, since);
            }
        }
        seek.settle(Format::FT12)
    }

    #[test]
    fn a_silent_line_is_told_and_listened_to_at_the_usual_rate() {
        let settled = settled([&[], &[], &[], &[]]);
        assert_eq!((settled.baud.get(), settled.was_heard), (115_200, false));
        let silent = "baud 115200 (115200 silent; 19200 silent; 9600 silent; 345594 silent)";
        assert_eq!(settled.told, silent);
        assert!(settled.warning.unwrap().contains("nothing was heard at any rate"));
    }

    #[test]
    fn each_rate_is_judged_by_what_it_sounds_like() {
        // Too slow a receiver sees framing errors all over; upside down, zeros without a stop bit.
        let framing = |n: u16| character(0x60 ^ n, Parity::Ok).with_framing_error();
        let wrong: Vec<Character> = (0..60).map(framing).collect();
        let zeros = vec![character(0, Parity::Unknown).with_framing_error(); 60];
        let odd = vec![character(0x41, Parity::Error); 60];
        let few = [character(0x55, Parity::Ok); 3];
        let settled = settled([&wrong, &zeros, &odd, &few]);
        assert_eq!(settled.baud.get(), 345_594);
        assert_eq!(
            settled.told,
            "baud 345594 (115200 wrong rate; 19200 swapped lines; 9600 wrong parity; 345594 heard \
             3 characters)"
        );
    }

    #[test]
    fn a_rate_at_which_slin_is_spoken_ends_the_search() {
        // Encoder 0 answers 154 (TR SLIN §6), four times.
        let exchange = [0x80, 0x1A, 0x01, 0x90].map(|byte| character(byte, Parity::Ok));
        let since = Instant::now();
        let mut seek = Seek::new(since);
        seek.outbox().characters(0, exchange);
        assert!(matches!(seek.look(since, Format::FT12), Step::GoOn), "too few to be sure");
        for _ in 0..3 {
            seek.outbox().characters(0, exchange);
        }
        assert!(matches!(seek.look(since, Format::FT12), Step::Settle));
        assert_eq!(seek.settle(Format::FT12).heard.heard().len(), 16, "what was heard is kept");
    }

    #[test]
    fn a_rate_that_the_port_does_not_take_is_passed_over() {
        let mut seek = Seek::new(Instant::now());
        seek.refuse(RATES[1], "it stays at 9600 Bd".to_owned());
        assert!(matches!(seek.next(), Step::Next(baud) if baud == RATES[2]));
        let told = seek.settle(Format::FT12).told;
        assert_eq!(told, "baud 115200 (115200 silent; 19200 not possible: it stays at 9600 Bd)");
    }
}
