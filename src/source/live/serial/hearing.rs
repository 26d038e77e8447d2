//! From the bytes of a read to what was on the line.

use super::super::PATIENCE;
use super::Terms;
use super::counters::Counters;
use super::spread::Spread;
use crate::source::marks::{Escape, Sign};
use crate::source::outbox::Outbox;
use dissectors::event::{Break, Loss, LossCause, Moment};
use dissectors::uart::{Baud, Character, Format, Parity, ParityMarks, ParityRule};

/// Who did not look for longer, in ns, was kept from it: three times as long as a turn waits. Less
/// happens on any computer.
const AWAY: i64 = 3 * PATIENCE.as_nanos() as i64;

/// Hears what a port reads.
pub struct Hearing {
    terms: Terms,
    escape: Escape,
    spread: Spread,
    /// When nothing was left to be read last.
    looked: Option<i64>,
    /// What the driver counted and no mark has come for yet.
    uncalled: Counters,
    uncertainty: u32,
    /// What is known of the parity of a good character, and of a marked one.
    unmarked: Parity,
    marked: Parity,
    has_parity: bool,
    /// A byte stood where none can.
    has_strayed: bool,
    signs: Vec<Sign>,
    characters: Vec<Character>,
}

/// What a marked character was.
enum Verdict {
    Break,
    Framing,
    Parity,
}

impl Hearing {
    /// Hears a port that offers this.
    pub fn new(terms: Terms, baud: Baud, format: Format) -> Self {
        let has_parity = format.parity() != ParityRule::None;
        let slack = i64::try_from(terms.uncertainty.as_nanos()).unwrap_or(i64::MAX);
        Hearing {
            terms,
            escape: Escape::None,
            spread: Spread::new(baud, format, slack),
            looked: None,
            uncalled: Counters::default(),
            uncertainty: u32::try_from(slack).unwrap_or(u32::MAX),
            unmarked: match terms.parity {
                _ if !has_parity => Parity::None,
                ParityMarks::None => Parity::Unknown,
                ParityMarks::Character | ParityMarks::Packet => Parity::Ok,
            },
            marked: match terms.parity {
                ParityMarks::Packet => Parity::Suspect,
                ParityMarks::Character => Parity::Error,
                ParityMarks::None => Parity::Unknown,
            },
            has_parity,
            has_strayed: false,
            signs: Vec::new(),
            characters: Vec::new(),
        }
    }

    /// The bytes of a read that returned at `now`, and what the driver counted since the read before.
    /// Returns how many characters they are.
    pub fn hear(&mut self, bytes: &[u8], now: i64, news: &Counters, out: &mut Outbox) -> usize {
        self.uncalled = self.uncalled.plus(news);
        let mut signs = std::mem::take(&mut self.signs);
        signs.clear();
        for byte in bytes {
            if !self.terms.is_marked {
                signs.push(Sign::Good(*byte));
            } else if !self.escape.take(*byte, &mut |sign| signs.push(sign)) {
                self.has_strayed = true;
            }
        }
        if signs.is_empty() {
            self.lose(news, now.saturating_sub(self.spread.character_ns()), out);
        } else {
            self.place(&signs, now, news, out);
        }
        // A mark may come one read after its count, and no later.
        self.uncalled = self.uncalled.at_most(news);
        let count = signs.len();
        self.signs = signs;
        count
    }

    fn place(&mut self, signs: &[Sign], now: i64, news: &Counters, out: &mut Outbox) {
        self.doubt(signs.len(), now, out);
        let mut starts = self.spread.place(now, signs.len()).peekable();
        let first = starts.peek().and_then(|first| first.ns()).unwrap_or(now);
        self.lose(news, first, out);
        for (sign, start) in signs.iter().zip(starts) {
            self.sign(*sign, start, out);
        }
        out.characters(0, self.characters.drain(..));
    }

    /// A program that was stopped, or a computer that was busy, reads at once what came meanwhile.
    /// Where that does not fill the time, nobody knows when it was on the line: nothing is to be
    /// judged from what was heard before to what was heard now.
    fn doubt(&mut self, count: usize, now: i64, out: &mut Outbox) {
        let looked = self.looked.replace(now);
        if looked.is_some_and(|looked| now.saturating_sub(looked) > AWAY)
            && let Some(since) = self.spread.doubt(now, count)
        {
            lose(since, out);
        }
    }

    /// So much was read that its driver may have been told to hold back, and it does not count.
    pub fn lose_what_nobody_counts(&self, out: &mut Outbox) {
        self.spread.until().into_iter().for_each(|until| lose(until, out));
    }

    /// Nothing is there to be read at `now`. Returns until when nothing more can turn up, which is not
    /// before what was heard ends.
    pub fn silence(&mut self, now: i64) -> Moment {
        self.looked = Some(now);
        let wait = i64::try_from(self.terms.longest_wait.as_nanos()).unwrap_or(i64::MAX);
        // A character that began then has ended and arrived.
        let wait = wait.saturating_add(self.spread.character_ns());
        Moment::from_ns(self.spread.silence(now, wait))
    }

    /// Tells what the driver lost since the read before.
    fn lose(&mut self, news: &Counters, start: i64, out: &mut Outbox) {
        // An overrun of the receiver cost one character at least; of the buffer, it is counted.
        let count = (news.overrun == 0).then_some(u64::from(news.buffer_overrun));
        if news.overrun > 0 || news.buffer_overrun > 0 {
            let start = Moment::from_ns(start);
            out.lost(0, Loss { start, count, cause: LossCause::Overrun });
        }
    }

    /// Whether bytes came that cannot, with marks in force.
    pub fn has_strayed(&self) -> bool {
        self.has_strayed
    }

    fn sign(&mut self, sign: Sign, start: Moment, out: &mut Outbox) {
        let (byte, parity) = match sign {
            Sign::Good(byte) => (byte, self.unmarked),
            Sign::Stray(byte) => (byte, Parity::Unknown),
            Sign::Bad(byte) => (byte, self.marked),
        };
        let plain = Character::new(start, self.uncertainty, u16::from(byte), parity).interpolated();
        if !matches!(sign, Sign::Bad(_)) {
            return self.characters.push(plain);
        }
        match self.verdict(byte) {
            Verdict::Break => {
                out.characters(0, self.characters.drain(..));
                out.line_break(0, Break { start, uncertainty: self.uncertainty, duration: None });
            }
            Verdict::Framing => {
                let parity = if self.has_parity { Parity::Unknown } else { Parity::None };
                self.characters.push(plain.with_parity(parity).with_framing_error());
            }
            Verdict::Parity => self.characters.push(plain),
        }
    }

    /// What a mark stands for. A mark does not tell, the counters do, where there are any.
    fn verdict(&mut self, byte: u8) -> Verdict {
        let Counters { parity, framing, breaks, .. } = &mut self.uncalled;
        if byte == 0 && *breaks > 0 {
            *breaks -= 1;
            Verdict::Break
        } else if !self.has_parity || self.terms.parity == ParityMarks::None {
            // Nobody checks parity: something else was wrong.
            Verdict::Framing
        } else if *parity == 0 && *framing > 0 && self.terms.parity != ParityMarks::Packet {
            *framing -= 1;
            Verdict::Framing
        } else {
            *parity = parity.saturating_sub(1);
            Verdict::Parity
        }
    }
}

/// From here on something may be missing, or have come at another time.
fn lose(start: i64, out: &mut Outbox) {
    let start = Moment::from_ns(start);
    out.lost(0, Loss { start, count: None, cause: LossCause::Capture });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::transcript::of_source;
    use crate::source::{Piece, Source, SourceError};
    use std::time::Duration;

    struct Said(Outbox);

    impl Source for Said {
        fn next_piece(&mut self) -> Result<Option<Piece<'_>>, SourceError> {
            self.0.next().transpose()
        }
    }

    /// 8E1 at 100 kBd: a character takes 110 µs. ± 2 ms; what ended 4 ms ago was read.
    fn hearing(parity: ParityMarks) -> Hearing {
        let terms = Terms {
            is_marked: true,
            parity,
            uncertainty: Duration::from_millis(2),
            longest_wait: Duration::from_millis(4),
        };
        Hearing::new(terms, Baud::new(100_000).unwrap(), Format::FT12)
    }

    fn hear(hearing: &mut Hearing, bytes: &[u8], now: i64, news: Counters) -> Vec<String> {
        let mut out = Outbox::default();
        hearing.hear(bytes, now, &news, &mut out);
        of_source(&mut Said(out))
    }

    const NONE: Counters =
        Counters { parity: 0, framing: 0, overrun: 0, buffer_overrun: 0, breaks: 0 };

    #[test]
    fn what_a_mark_stands_for_the_counters_tell() {
        let mut hearing = hearing(ParityMarks::Character);
        let at = 10_000_000;
        assert_eq!(
            hear(&mut hearing, &[0x41, 0xFF, 0, 0x42], at, Counters { parity: 1, ..NONE }),
            ["0: 41 @9780000±2000000, 42 parity error @9890000±2000000"]
        );
        let at = 20_000_000;
        assert_eq!(
            hear(&mut hearing, &[0xFF, 0, 0x42], at, Counters { framing: 1, ..NONE }),
            ["0: 42 parity unknown framing error @19890000±2000000"]
        );
        let at = 30_000_000;
        assert_eq!(
            hear(&mut hearing, &[0xFF, 0, 0, 0xFF, 0, 0], at, Counters { breaks: 1, ..NONE }),
            ["0: break @29780000±2000000", "0: 00 parity error @29890000±2000000"],
            "one of two zeros was a break"
        );
    }

    #[test]
    fn a_count_may_come_before_its_mark_but_not_long_before() {
        let mut hearing = hearing(ParityMarks::Character);
        let framing = Counters { framing: 1, ..NONE };
        hear(&mut hearing, &[0x41, 0xFF, 0], 10_000_000, framing);
        let said = hear(&mut hearing, &[0x42], 20_000_000, NONE);
        assert!(said[0].contains("framing error"), "{said:?}");
        hear(&mut hearing, &[0x41], 30_000_000, framing);
        hear(&mut hearing, &[0x41], 40_000_000, NONE);
        let said = hear(&mut hearing, &[0xFF, 0, 0x42], 50_000_000, NONE);
        assert!(said[0].contains("parity error"), "{said:?}");
    }

    #[test]
    fn where_packets_are_marked_their_characters_are_suspect() {
        let mut hearing = hearing(ParityMarks::Packet);
        let bytes = [0xFF, 0, 0x80, 0xFF, 0, 0x1A, 0x01];
        let said = hear(&mut hearing, &bytes, 10_000_000, Counters { parity: 1, ..NONE });
        assert!(said[0].starts_with("0: 80 parity suspect @"), "{said:?}");
        assert!(said[0].contains("1A parity suspect @") && said[0].contains(", 01 @"), "{said:?}");
    }

    #[test]
    fn where_parity_is_not_checked_a_mark_is_a_framing_error() {
        let mut hearing = hearing(ParityMarks::None);
        assert_eq!(
            hear(&mut hearing, &[0x41, 0xFF, 0, 0x42], 10_000_000, NONE),
            ["0: 41 parity unknown @9780000±2000000, 42 parity unknown framing error \
                 @9890000±2000000"]
        );
    }

    #[test]
    fn what_the_receiver_lost_comes_before_what_it_heard() {
        let mut hearing = hearing(ParityMarks::Character);
        let lost = Counters { buffer_overrun: 3, ..NONE };
        assert_eq!(
            hear(&mut hearing, &[0x41], 10_000_000, lost),
            ["0: lost 3 Overrun @9890000", "0: 41 @9890000±2000000"]
        );
        let overrun = Counters { overrun: 1, ..NONE };
        assert_eq!(hear(&mut hearing, &[], 20_000_000, overrun), ["0: lost Overrun @19890000"]);
    }

    #[test]
    fn what_came_while_nobody_looked_is_not_judged_with_what_came_before() {
        let mut hearing = hearing(ParityMarks::Character);
        hear(&mut hearing, &[0x80], 10_000_000, NONE);
        // 1 s later, two characters: 220 µs of it.
        assert_eq!(
            hear(&mut hearing, &[0x1A, 0x01], 1_010_000_000, NONE),
            ["0: lost Capture @10000000", "0: 1A @1009780000±2000000, 01 @1009890000±2000000"]
        );
        // 9091 characters of 110 µs fill a second.
        let said = hear(&mut hearing, &[0x41; 9091], 2_010_000_000, NONE);
        assert_eq!((said.len(), said[0].starts_with("0: 41 @1010000000±2000000, ")), (1, true));
        // A pause in which somebody looked is one: what came after it came after it.
        hearing.silence(3_000_000_000);
        assert_eq!(hear(&mut hearing, &[0x80], 3_010_000_000, NONE).len(), 1);
    }

    #[test]
    fn silence_is_told_up_to_what_may_still_arrive() {
        // 4 ms for what has ended, 110 µs for what began before that.
        let until = hearing(ParityMarks::Character).silence(10_000_000);
        assert_eq!(until.ns(), Some(5_890_000));
    }

    #[test]
    fn bytes_without_marks_are_characters() {
        let terms = hearing(ParityMarks::None).terms;
        let terms = Terms { is_marked: false, ..terms };
        let mut hearing = Hearing::new(terms, Baud::new(100_000).unwrap(), Format::FT12);
        let said = hear(&mut hearing, &[0xFF, 0x41], 10_000_000, NONE);
        assert!(said[0].starts_with("0: FF parity unknown @"), "{said:?}");
        assert!(!hearing.has_strayed());
    }
}
