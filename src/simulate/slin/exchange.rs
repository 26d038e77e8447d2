//! An exchange as a script: who sends what when. A fault is a change to the script.

use super::line::{Character, Line, Parity};
use super::tap::{Gap, Loss};
use crate::simulate::time::{Clock, Ps};
use std::ops::Range;

/// What is to happen from one request to the next.
#[derive(Clone, Debug)]
pub struct Script {
    /// Silence before the request, beyond the pause that was.
    pub pause: Ps,
    /// The request.
    pub request: Character,
    /// From the end of the request to the begin of the answer.
    pub delay: Ps,
    /// Data words and footer; nothing if nobody answers.
    pub answer: Vec<Character>,
    /// Silence between two of them.
    pub gap: Ps,
    /// What else is on the line.
    pub extra: Option<Extra>,
    /// How long the master waits for an answer that does not come or does not end.
    pub patience: Ps,
    /// Silence after all that.
    pub rest: Ps,
    /// Characters of request and answer that the tap misses.
    pub missed: Option<(Range<usize>, Loss)>,
}

/// Something on the line that does not belong to the exchange.
#[derive(Clone, Debug)]
pub struct Extra {
    /// From when on its delay counts.
    pub after: After,
    /// When it begins.
    pub delay: Ps,
    /// What it is.
    pub what: Disturbance,
}

/// From when on a delay counts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum After {
    /// The end of the request.
    Request,
    /// The end of the answer.
    Answer,
}

/// What disturbs an exchange.
#[derive(Clone, Debug)]
pub enum Disturbance {
    /// The line is pulled low for so long.
    Low(Ps),
    /// Somebody sends by a clock of his own.
    Sender(Vec<Character>, Clock),
}

/// When it all happened.
#[derive(Clone, Copy, Debug)]
pub struct Times {
    /// Start bit of the request, and end of its stop bit.
    pub request: (Ps, Ps),
    /// The same of the answer.
    pub answer: Option<(Ps, Ps)>,
    /// End of everything that was sent.
    pub end: Ps,
    /// When the next request may begin.
    pub next: Ps,
    /// What the tap missed.
    pub gap: Option<Gap>,
}

/// Who sends, and how.
#[derive(Clone, Copy, Debug)]
pub struct Senders {
    /// The master's clock.
    pub master: Clock,
    /// The encoder's clock.
    pub encoder: Clock,
    /// The parity of all.
    pub parity: Parity,
}

impl Script {
    /// Puts everything on the line, from this time on.
    pub fn play(&self, line: &mut Line, at: Ps, senders: Senders) -> Times {
        let start = at + self.pause;
        let asked = line.send(self.request, start, senders.master, senders.parity);
        let mut starts = vec![start];
        let mut time = asked + self.delay;
        for (number, word) in self.answer.iter().enumerate() {
            if number > 0 {
                time += self.gap;
            }
            starts.push(time);
            time = line.send(*word, time, senders.encoder, senders.parity);
        }
        let answer = starts.get(1).map(|first| (*first, time));
        let answered = if self.is_complete() { time } else { time.max(asked + self.patience) };
        let answered = if answer.is_none() { asked + self.patience } else { answered };
        let disturbed = self.extra.as_ref().map_or(answered, |extra| {
            let from = match extra.after {
                After::Request => asked,
                After::Answer => time,
            };
            extra.play(line, from + extra.delay, senders.parity)
        });
        let end = answer.map_or(asked, |(_, end)| end);
        Times {
            request: (start, asked),
            answer,
            end: if self.extra.is_some() { end.max(disturbed) } else { end },
            next: answered.max(disturbed) + self.rest,
            gap: self.gap(&starts),
        }
    }

    /// Whether the master sees that nothing more will come.
    fn is_complete(&self) -> bool {
        self.answer.last().is_some_and(|last| last.byte & 0x80 != 0)
    }

    fn gap(&self, starts: &[Ps]) -> Option<Gap> {
        let (missed, loss) = self.missed.clone()?;
        let (from, last) = (starts.get(missed.start)?, starts.get(missed.end.checked_sub(1)?)?);
        Some(Gap { from: *from, to: last + 1, loss })
    }
}

impl Extra {
    /// Puts it on the line. Returns its end.
    fn play(&self, line: &mut Line, at: Ps, parity: Parity) -> Ps {
        match &self.what {
            Disturbance::Low(length) => {
                line.pull(at, at + length);
                at + length
            }
            Disturbance::Sender(characters, clock) => characters
                .iter()
                .fold(at, |time, character| line.send(*character, time, *clock, parity)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::time::{MS, US};

    fn script() -> Script {
        Script {
            pause: 0,
            request: Character::new(0x80),
            delay: 250 * US,
            answer: [0x1A, 0x01, 0x90].map(Character::new).to_vec(),
            gap: US,
            extra: None,
            patience: 2 * MS,
            rest: MS,
            missed: None,
        }
    }

    fn play(script: &Script) -> Times {
        let clock = Clock::exact(115_200);
        let senders = Senders { master: clock, encoder: clock, parity: Parity::Even };
        script.play(&mut Line::default(), 0, senders)
    }

    #[test]
    fn an_exchange_takes_its_time() {
        let times = play(&script());
        // A character lasts 95.486 µs; three words with two gaps of 1 µs last 288.458 µs.
        assert_eq!(times.request.1 / US, 95);
        let (begin, end) = times.answer.unwrap();
        assert_eq!(begin - times.request.1, 250 * US);
        assert_eq!((end - begin) / US, 288);
        assert_eq!(times.next, end + MS);
    }

    #[test]
    fn the_master_waits_for_an_answer_that_does_not_come() {
        let silent = play(&Script { answer: Vec::new(), ..script() });
        assert_eq!(silent.next, silent.request.1 + 3 * MS);
        let torn = Script { answer: [0x1A].map(Character::new).to_vec(), ..script() };
        assert_eq!(play(&torn).next, silent.next);
    }

    #[test]
    fn a_gap_begins_with_the_first_character_it_swallows() {
        let missed = Some((2..4, Loss::Lost));
        let times = play(&Script { missed, ..script() });
        let gap = times.gap.unwrap();
        let (begin, end) = times.answer.unwrap();
        assert!(gap.from > begin + 95 * US && gap.to < end - 90 * US && gap.from < gap.to);
    }
}
