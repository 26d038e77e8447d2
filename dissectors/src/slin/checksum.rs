//! The checksum of a response: three bits of the sum of its data words, in three readings.
//!
//! The makers' listings differ in whether the carry of one addition goes into the next. They give
//! the same result for almost every position, so which one an encoder follows is decided by
//! evidence.

use super::word::MAX_DATA_WORDS;

/// A way to read the manuals.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Rule {
    /// Plain additions (`ADD`; Baumer SLIN §3.3).
    Add = 0,
    /// Additions with carry over four words, absent ones counting as zero (`ADDC`; TR SLIN §7,
    /// both listings).
    Addc = 1,
    /// Additions with carry over the words sent, as an 8051 does if it stops there.
    AddcSent = 2,
}

/// Number of rules.
pub const RULES: usize = 3;

/// Every rule, in the order of their names in records.
pub const ALL: [Rule; RULES] = [Rule::Add, Rule::Addc, Rule::AddcSent];

impl Rule {
    /// The name on the command line and in records.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Rule::Add => "add",
            Rule::Addc => "addc",
            Rule::AddcSent => "addc-sent",
        }
    }

    /// The rule of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        ALL.into_iter().find(|rule| rule.name() == name)
    }

    /// The checksum of these data words, 0 to 7.
    #[must_use]
    pub fn checksum(self, data: &[u8]) -> u8 {
        self.sums(data) >> 4 & 7
    }

    fn sums(self, data: &[u8]) -> u8 {
        match self {
            Rule::Add => data.iter().fold(0, |sum: u8, word| sum.wrapping_add(*word)),
            Rule::AddcSent => with_carry(data.iter()),
            Rule::Addc => {
                let missing = MAX_DATA_WORDS.saturating_sub(data.len());
                with_carry(data.iter().chain([0; MAX_DATA_WORDS].iter().take(missing)))
            }
        }
    }
}

/// `ADDC`: the carry of each addition goes into the next; that of the last is not used.
fn with_carry<'a>(words: impl Iterator<Item = &'a u8>) -> u8 {
    let (sum, _) = words.fold((0_u8, false), |(sum, carry), word| {
        let total = u16::from(sum) + u16::from(*word) + u16::from(carry);
        (total.to_le_bytes()[0], total > 0xFF)
    });
    sum
}

/// A set of rules.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Rules(u8);

impl Rules {
    /// Every rule.
    pub const EVERY: Rules = Rules(0b111);
    /// No rule.
    pub const NONE: Rules = Rules(0);

    /// The set of this one rule.
    #[must_use]
    pub const fn only(rule: Rule) -> Self {
        Rules(1 << rule as u8)
    }

    /// The rules under which `received` is right for these data words.
    #[must_use]
    pub fn fitting(data: &[u8], received: u8) -> Self {
        // All rules agree unless an addition before the last carries: the usual case by far.
        if !carries(data) {
            return if Rule::Add.checksum(data) == received { Rules::EVERY } else { Rules::NONE };
        }
        ALL.into_iter()
            .filter(|rule| rule.checksum(data) == received)
            .fold(Rules::NONE, |rules, rule| Rules(rules.0 | 1 << rule as u8))
    }

    /// Whether the rule is in the set.
    #[must_use]
    pub const fn has(self, rule: Rule) -> bool {
        self.0 & 1 << rule as u8 != 0
    }

    /// Rules in both sets.
    #[must_use]
    pub const fn and(self, other: Rules) -> Self {
        Rules(self.0 & other.0)
    }

    /// The set without this rule.
    #[must_use]
    pub const fn without(self, rule: Rule) -> Self {
        Rules(self.0 & !(1 << rule as u8))
    }

    /// Whether the set is empty.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The only rule of the set.
    #[must_use]
    pub fn single(self) -> Option<Rule> {
        ALL.into_iter().find(|rule| self == Rules::only(*rule))
    }

    /// The first rule of the set.
    #[must_use]
    pub fn first(self) -> Option<Rule> {
        ALL.into_iter().find(|rule| self.has(*rule))
    }

    /// The names joined by `+`, or `none`.
    #[must_use]
    pub const fn names(self) -> &'static str {
        match self.0 {
            0b001 => "add",
            0b010 => "addc",
            0b011 => "add+addc",
            0b100 => "addc-sent",
            0b101 => "add+addc-sent",
            0b110 => "addc+addc-sent",
            0b111 => "add+addc+addc-sent",
            _ => "none",
        }
    }
}

fn carries(data: &[u8]) -> bool {
    data.iter().take(MAX_DATA_WORDS).map(|word| u16::from(*word)).sum::<u16>() > 0xFF
        || data.len() > MAX_DATA_WORDS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_position_where_the_manuals_differ() {
        // 294911 = 7F 7F 11h: 7F+7F+11 = 10Fh. Without carry 0Fh, bits 4-6 are 0; TR's fourth
        // addition brings the carry in: 10h, bits 4-6 are 1; ADDC over the three words sent: 0.
        let data = [0x7F, 0x7F, 0x11];
        assert_eq!(ALL.map(|rule| rule.checksum(&data)), [0, 1, 0]);
        assert_eq!(Rules::fitting(&data, 0).names(), "add+addc-sent");
        assert_eq!(Rules::fitting(&data, 1).names(), "addc");
        assert_eq!(Rules::fitting(&data, 2).names(), "none");
    }

    #[test]
    fn the_carry_of_the_last_addition_is_not_used() {
        // 7F+40+30 = EFh, no carry; EF+20 = 10Fh: the ninth bit is lost under every rule.
        assert_eq!(ALL.map(|rule| rule.checksum(&[0x7F, 0x40, 0x30, 0x20])), [0, 0, 0]);
        // 7F+7F+02 = 100h carries into the fourth addition: 00+0F = 0Fh, with carry 10h.
        assert_eq!(ALL.map(|rule| rule.checksum(&[0x7F, 0x7F, 0x02, 0x0F])), [0, 1, 1]);
    }

    /// Counted exhaustively by two other programs: of the 2 097 152 combinations of
    /// three words ADD and ADDC over four differ in 17 696, ADD and ADDC over those sent in none.
    #[test]
    fn the_rules_differ_as_often_as_counted() {
        let (mut add_addc, mut add_sent, mut shortcut_is_wrong) = (0, 0, 0);
        for n in 0..128_u32 * 128 * 128 {
            let data = [n & 0x7F, n >> 7 & 0x7F, n >> 14].map(|word| word as u8);
            let [add, addc, sent] = ALL.map(|rule| rule.checksum(&data));
            add_addc += u32::from(add != addc);
            add_sent += u32::from(add != sent);
            shortcut_is_wrong +=
                u32::from(Rules::fitting(&data, add).has(Rule::Addc) != (add == addc));
        }
        assert_eq!((add_addc, add_sent, shortcut_is_wrong), (17_696, 0, 0));
    }

    #[test]
    fn up_to_two_words_decide_nothing() {
        for n in 0..128_u32 * 128 {
            let data = [n & 0x7F, n >> 7].map(|word| word as u8);
            let sums = ALL.map(|rule| rule.checksum(&data));
            assert!(sums[0] == sums[1] && sums[1] == sums[2], "{data:02X?}");
        }
    }
}
