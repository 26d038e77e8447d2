//! What the makers promise, and what `auto` learns instead where nobody says whose encoder it is.
//!
//! Bit 3 of the footer, the checksum rule and the response window are three separate questions; a
//! profile answers all of them, evidence answers each on its own and for each address.

use super::checksum::{ALL, RULES, Rule, Rules};
use super::word::{ADDRESSES, Address};
use crate::protocol::Conclusion;
use alloc::{format, string::String, vec::Vec};

/// Whose encoders are on the bus.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub enum Profile {
    /// To be found out.
    #[default]
    Auto,
    /// Baumer SLIN §3: bit 3 high, `ADD`, answer within 1 ms.
    Baumer,
    /// TR SLIN §6, §7: bit 3 reserved, `ADDC`, answer after 0.1 to 0.4 ms.
    Tr,
    /// TR with the reserved bit sent high.
    TrReserveHigh,
}

impl Profile {
    /// Every profile, with its name on the command line.
    pub const NAMES: [(&'static str, Profile); 4] = [
        ("auto", Profile::Auto),
        ("baumer", Profile::Baumer),
        ("tr", Profile::Tr),
        ("tr-reserve-high", Profile::TrReserveHigh),
    ];
}

/// Which checksum rule holds.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub enum ChecksumChoice {
    /// The profile's.
    #[default]
    OfProfile,
    /// To be found out, whatever the profile.
    Auto,
    /// This one, whatever the profile.
    Rule(Rule),
}

/// What the user knows of the encoders.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Settings {
    /// Whose they are.
    pub profile: Profile,
    /// Their checksum rule.
    pub checksum: ChecksumChoice,
}

impl Settings {
    /// Whether the user said anything that only makes sense on a SLIN bus.
    #[must_use]
    pub fn speak_for_slin(&self) -> bool {
        *self != Settings::default()
    }

    /// Bit 3 of every footer, where the profile tells.
    #[must_use]
    pub fn bit3(&self) -> Option<bool> {
        match self.profile {
            Profile::Auto => None,
            Profile::Tr => Some(false),
            Profile::Baumer | Profile::TrReserveHigh => Some(true),
        }
    }

    /// The checksum rule, where the user or the profile tells.
    #[must_use]
    pub fn rule(&self) -> Option<Rule> {
        match (self.checksum, self.profile) {
            (ChecksumChoice::Rule(rule), _) => Some(rule),
            (ChecksumChoice::Auto, _) | (ChecksumChoice::OfProfile, Profile::Auto) => None,
            (ChecksumChoice::OfProfile, Profile::Baumer) => Some(Rule::Add),
            (ChecksumChoice::OfProfile, _) => Some(Rule::Addc),
        }
    }
}

/// When an answer may begin, counted from the end of the request's stop bit, in ns. (Neither
/// manual says from where; at 9600 Bd a character takes longer than 1 ms, so it cannot be the end
/// of the answer.)
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Window {
    /// Not before this.
    pub earliest: Option<i64>,
    /// Not after this.
    pub latest: i64,
}

impl Window {
    /// TR SLIN §6: "within a defined time window of 0,1 - 0,4 ms".
    pub const TR: Window = Window { earliest: Some(100_000), latest: 400_000 };
    /// Baumer SLIN §3.2: "The encoder responds within 1 ms".
    pub const BAUMER: Window = Window { earliest: None, latest: 1_000_000 };
}

/// What is expected of one encoder.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Expectation {
    /// Bit 3 of its footers; `None` while undecided.
    pub bit3: Option<bool>,
    /// Checksum rules it may follow: all that are not ruled out.
    pub rules: Rules,
    /// When its answers may begin.
    pub window: Window,
}

/// Telegrams it takes to decide a question.
const DECIDING: u32 = 3;

/// Whether so many for and against decide a question: three at least, nine in ten agreeing.
fn decides(wins: u32, losses: u32) -> bool {
    let all = u64::from(wins) + u64::from(losses);
    all >= u64::from(DECIDING) && u64::from(wins) * 10 >= all * 9
}

/// What the telegrams of one address said so far.
#[derive(Clone, Copy, Default, Debug)]
struct Evidence {
    low: u32,
    high: u32,
    /// `duels[a][b]`: telegrams that fit rule `a` and not rule `b`.
    duels: [[u32; RULES]; RULES],
}

impl Evidence {
    fn footers(&self) -> u32 {
        self.low.saturating_add(self.high)
    }

    fn bit3(&self) -> Option<bool> {
        if decides(self.high, self.low) {
            Some(true)
        } else if decides(self.low, self.high) {
            Some(false)
        } else {
            None
        }
    }

    /// Whether its footers have mostly the other bit 3.
    fn speaks_against(&self, high: bool) -> bool {
        if high { self.low > self.high } else { self.high > self.low }
    }

    /// The rules that are left, once one at least is ruled out.
    fn rules(&self) -> Option<Rules> {
        let is_beaten = |loser: &Rule| {
            ALL.into_iter().any(|winner| {
                let wins = self.duels[winner as usize][*loser as usize];
                decides(wins, self.duels[*loser as usize][winner as usize])
            })
        };
        let left = ALL.into_iter().filter(is_beaten).fold(Rules::EVERY, Rules::without);
        (left != Rules::EVERY && !left.is_empty()).then_some(left)
    }

    /// Telegrams that told rules apart: three words and four words separate different pairs.
    fn deciding(&self) -> u32 {
        let pair = |a: usize, b: usize| self.duels[a][b].saturating_add(self.duels[b][a]);
        pair(0, 1).max(pair(0, 2)).max(pair(1, 2))
    }

    fn add(&mut self, bit3: bool, fitting: Rules) {
        let footers = if bit3 { &mut self.high } else { &mut self.low };
        *footers = footers.saturating_add(1);
        if fitting == Rules::EVERY || fitting.is_empty() {
            return;
        }
        for winner in ALL.into_iter().filter(|rule| fitting.has(*rule)) {
            for loser in ALL.into_iter().filter(|rule| !fitting.has(*rule)) {
                let wins = &mut self.duels[winner as usize][loser as usize];
                *wins = wins.saturating_add(1);
            }
        }
    }
}

/// What is known of the encoders' habits: from the user, or learned as telegrams come in.
#[derive(Clone, Debug)]
pub struct Habits {
    settings: Settings,
    evidence: [Evidence; ADDRESSES],
    expectations: [Expectation; ADDRESSES],
}

impl Habits {
    /// Nothing learned yet.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        let nothing = Expectation { bit3: None, rules: Rules::EVERY, window: Window::BAUMER };
        let mut habits = Habits {
            settings,
            evidence: [Evidence::default(); ADDRESSES],
            expectations: [nothing; ADDRESSES],
        };
        habits.draw_conclusions();
        habits
    }

    /// What is expected of the encoder at this address, by what is known now.
    #[must_use]
    pub fn of(&self, address: Address) -> Expectation {
        self.expectations[address.index()]
    }

    /// When an answer may begin whose footer has this bit 3: where it is not what the others led to
    /// expect, nothing that either manual allows is wrong.
    #[must_use]
    pub fn window(&self, address: Address, footer_bit3: Option<bool>) -> Window {
        let expectation = self.of(address);
        let is_odd = footer_bit3.is_some_and(|bit3| expectation.bit3.is_some_and(|e| e != bit3));
        if is_odd && self.settings.profile == Profile::Auto {
            Window::BAUMER
        } else {
            expectation.window
        }
    }

    /// What is expected where it is not known who was asked.
    #[must_use]
    pub fn of_asked(&self, asked: Option<Address>) -> Expectation {
        let unknown = Expectation {
            bit3: self.settings.bit3(),
            rules: self.settings.rule().map_or(Rules::EVERY, Rules::only),
            window: Window::BAUMER,
        };
        asked.map_or(unknown, |address| self.of(address))
    }

    /// Whether the user said that every footer has bit 3 high: then a control word without it is
    /// a request, whatever stands around it.
    #[must_use]
    pub fn has_high_bit3_given(&self) -> bool {
        self.settings.bit3() == Some(true)
    }

    /// Learns from an undamaged answer: bit 3 of its footer and the rules its checksum fits.
    pub fn learn(&mut self, address: Address, bit3: bool, fitting: Rules) {
        let evidence = &mut self.evidence[address.index()];
        let before = (evidence.bit3(), evidence.low > evidence.high);
        evidence.add(bit3, fitting);
        let tells_rules_apart = fitting != Rules::EVERY;
        if tells_rules_apart || before != (evidence.bit3(), evidence.low > evidence.high) {
            self.draw_conclusions();
        }
    }

    fn draw_conclusions(&mut self) {
        let bus_bit3 = unanimous(self.evidence.iter().filter_map(Evidence::bit3));
        for (expectation, evidence) in self.expectations.iter_mut().zip(&self.evidence) {
            let bit3 = evidence.bit3().or(bus_bit3.filter(|high| !evidence.speaks_against(*high)));
            // Encoders that differ in bit 3 are different makers': they say nothing of each other.
            let is_alike = |other: &&Evidence| bit3.is_none_or(|high| !other.speaks_against(high));
            let alike = self.evidence.iter().filter(is_alike);
            let bus_rules = unanimous(alike.filter_map(Evidence::rules));
            let rules = evidence.rules().or(bus_rules).unwrap_or(Rules::EVERY);
            expectation.bit3 = self.settings.bit3().or(bit3);
            expectation.rules = self.settings.rule().map_or(rules, Rules::only);
            expectation.window = match (self.settings.profile, expectation.bit3) {
                (Profile::Tr | Profile::TrReserveHigh, _) | (Profile::Auto, Some(false)) => {
                    Window::TR
                }
                _ => Window::BAUMER,
            };
        }
    }

    /// What was learned, with the counts it rests on: for every address that answered.
    #[must_use]
    pub fn conclusions(&self) -> Vec<Conclusion> {
        let mut conclusions = Vec::new();
        let answering = (0..).zip(&self.evidence).filter(|(_, evidence)| evidence.footers() > 0);
        for (station, evidence) in answering {
            let footers = evidence.footers();
            let mut conclude = |subject, value: Option<&str>, evidence| {
                let value = value.map(String::from);
                conclusions.push(Conclusion { subject, station: Some(station), value, evidence });
            };
            if self.settings.bit3().is_none() {
                let (bit3, most) = (evidence.bit3(), evidence.low.max(evidence.high));
                let word = |high| if high { "high" } else { "low" };
                conclude("bit3", bit3.map(word), format!("{most} of {footers} footers agree"));
                let window = |high| if high { "up to 1 ms" } else { "0.1 to 0.4 ms" };
                conclude("window", bit3.map(window), String::from("follows bit 3"));
            }
            if self.settings.rule().is_none() {
                let deciding = evidence.deciding();
                let text = format!("{deciding} of {footers} telegrams tell the rules apart");
                conclude("checksum", evidence.rules().map(Rules::names), text);
            }
        }
        conclusions
    }
}

/// The one value all of them have; `None` where they differ or there is none.
fn unanimous<T: PartialEq>(mut values: impl Iterator<Item = T>) -> Option<T> {
    let first = values.next()?;
    values.all(|value| value == first).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn learned(telegrams: &[(u8, bool, Rules)]) -> Habits {
        let mut habits = Habits::new(Settings::default());
        for (address, bit3, fitting) in telegrams {
            habits.learn(Address::of(*address), *bit3, *fitting);
        }
        habits
    }

    #[test]
    fn bit_3_is_decided_by_three_footers_and_brings_the_window() {
        let two = learned(&[(0, true, Rules::EVERY); 2]).of(Address::of(0));
        assert_eq!((two.bit3, two.window), (None, Window::BAUMER));
        let three = learned(&[(0, false, Rules::EVERY); 3]).of(Address::of(0));
        assert_eq!((three.bit3, three.window), (Some(false), Window::TR));
    }

    #[test]
    fn one_in_ten_may_disagree_and_no_more() {
        let mut telegrams = [(0, true, Rules::EVERY); 10];
        telegrams[0].1 = false;
        assert_eq!(learned(&telegrams).of(Address::of(0)).bit3, Some(true));
        assert_eq!(learned(&telegrams[..9]).of(Address::of(0)).bit3, None);
    }

    #[test]
    fn an_unheard_address_takes_what_all_others_agree_on() {
        let mut telegrams = [(0, true, Rules::EVERY); 6];
        assert_eq!(learned(&telegrams).of(Address::of(5)).bit3, Some(true));
        for telegram in &mut telegrams[3..] {
            *telegram = (1, false, Rules::EVERY);
        }
        let mixed = learned(&telegrams);
        assert_eq!(
            [0, 1, 5].map(|address| mixed.of(Address::of(address)).bit3),
            [Some(true), Some(false), None]
        );
    }

    #[test]
    fn three_words_leave_two_rules_and_four_words_the_third() {
        // Three words that fit ADD and ADDC over those sent rule ADDC over four out.
        let three = Rules::fitting(&[0x7F, 0x7F, 0x11], 0);
        let four = Rules::fitting(&[0x7F, 0x7F, 0x02, 0x0F], 1);
        let habits = learned(&[(0, true, three); 3]);
        assert_eq!(habits.of(Address::of(0)).rules.names(), "add+addc-sent");
        // Four words that fit both ADDC rule ADD out: ADDC over those sent is left.
        let mut telegrams = [(0, true, three); 6];
        telegrams[3..].fill((0, true, four));
        assert_eq!(learned(&telegrams).of(Address::of(0)).rules.names(), "addc-sent");
    }

    #[test]
    fn a_profile_is_not_overruled_by_telegrams() {
        let baumer = Settings { profile: Profile::Baumer, checksum: ChecksumChoice::OfProfile };
        let mut habits = Habits::new(baumer);
        for _ in 0..20 {
            habits.learn(Address::of(0), false, Rules::only(Rule::Addc));
        }
        let expected = habits.of(Address::of(0));
        assert_eq!((expected.bit3, expected.rules.names()), (Some(true), "add"));
        assert_eq!(habits.conclusions(), []);
        // But the checksum rule can be left open.
        let mut habits = Habits::new(Settings { checksum: ChecksumChoice::Auto, ..baumer });
        for _ in 0..3 {
            habits.learn(Address::of(0), true, Rules::only(Rule::Addc));
        }
        assert_eq!(habits.of(Address::of(0)).rules.names(), "addc");
    }
}
