//! Exchanges that are easily taken for others: what is told of each character, word for word.

use fieldtap_dissectors::bus::{Bus, WireFacts};
use fieldtap_dissectors::event::{Clock, Event, Moment};
use fieldtap_dissectors::field::{Role, Value};
use fieldtap_dissectors::protocol::Settings;
use fieldtap_dissectors::record::{BusInfo, Output, Record, Sink};
use fieldtap_dissectors::slin::{self, ChecksumChoice, Profile};
use fieldtap_dissectors::uart::{Baud, Character, Parity};

/// Records in words: number, kind, station, position, the request answered, codes.
#[derive(Default)]
struct Words(Vec<String>);

impl Sink for Words {
    fn record(&mut self, record: &Record<'_>) {
        let mut words = format!("{} {}", record.n, record.kind);
        if let Some(station) = record.station {
            words += &format!(" {station}");
        }
        for (role, before) in [(Role::Position, "at"), (Role::Request, "to")] {
            if let Value::Int(value) = record.by_role(role) {
                words += &format!(" {before} {value}");
            }
        }
        for finding in record.findings {
            words += &format!(" {}", finding.code.name);
        }
        for code in record.withheld {
            words += &format!(" ?{}", code.name);
        }
        self.0.push(words);
    }
}

/// A tap on a bus.
struct Tap {
    bus: Bus,
    words: Words,
    records: u64,
    baud: u32,
    /// When the last character ended, in ns.
    now: f64,
}

impl Tap {
    fn new(profile: Profile, baud: u32) -> Self {
        let info = BusInfo::new("bus", Some(Clock::Hardware));
        let mut settings = Settings {
            protocol: Some(&slin::PROTOCOL),
            slin: slin::Settings { profile, checksum: ChecksumChoice::OfProfile },
            ..Settings::default()
        };
        settings.line.baud = Baud::new(baud);
        let bus = Bus::new(info, WireFacts::default(), settings);
        Tap { bus, words: Words::default(), records: 0, baud, now: 1e9 }
    }

    /// Hears hex bytes; `12*` has a parity error, `12^` may have one, `00#` no stop bit, `+250` is a pause in µs, and so
    /// is `~250`, which is told to the bus when half of it is over.
    fn hear(mut self, text: &str) -> Self {
        let character_ns = 11e9 / f64::from(self.baud);
        for token in text.split_whitespace() {
            let out = &mut Output::new(&mut self.records, &mut self.words);
            if let Some(pause) = token.strip_prefix(['+', '~']) {
                let ns = pause.parse::<f64>().expect("a pause is a number") * 1e3;
                if token.starts_with('~') {
                    let half = Moment::from_ns((self.now + ns / 2.0) as i64);
                    self.bus.hear(Event::Advance(half), out);
                }
                self.now += ns;
                continue;
            }
            let byte = u16::from_str_radix(&token[..2], 16).expect("a byte has two hex digits");
            let parity = match token.chars().last() {
                Some('*') => Parity::Error,
                Some('^') => Parity::Suspect,
                _ => Parity::Ok,
            };
            let mut character = Character::new(Moment::from_ns(self.now as i64), 100, byte, parity);
            if token.ends_with('#') {
                character = character.with_framing_error();
            }
            self.bus.hear(Event::Characters(&[character]), out);
            self.now += character_ns;
        }
        self
    }

    /// What was told of a capture that goes on for a second.
    fn told(self) -> Vec<String> {
        self.told_until(1e9)
    }

    /// What was told of a capture that ends so many ns after the last character.
    fn told_until(mut self, ns: f64) -> Vec<String> {
        let end = Moment::from_ns((self.now + ns) as i64);
        self.bus.finish(end, &mut Output::new(&mut self.records, &mut self.words));
        self.words.0
    }
}

/// Asserts what is told last.
fn check(tap: Tap, text: &str, expected: &[&str]) {
    let told = tap.hear(text).told();
    assert_eq!(told[told.len().saturating_sub(expected.len())..], *expected, "{text}");
}

/// Stations 0 and 1 are there; each exchange ends with a pause of 1 ms. Position 5 is the one
/// word 05h with checksum 0, position 100 is 64h with checksum 6 (64h = 110 0100b).
const BOTH: &str = "80 +250 64 E8 +1000 81 +250 05 89 +1000";

#[test]
fn the_set_up_is_told_at_the_same_place_however_time_is_told_to_pass() {
    // The 256th character settles that the parity is wrong: a request after one that nobody
    // answered.
    let text = "80* +250 05* 88* +1000 ".repeat(84) + &"80* ~20000 ".repeat(4);
    let advancing = Tap::new(Profile::Baumer, 115_200).hear(&text).told();
    let place = advancing.iter().position(|words| words.contains("uart.wrong-parity"));
    // 84 exchanges are two records each, then come three requests.
    assert_eq!(place, Some(171));
    let text = text.replace('~', "+");
    assert_eq!(Tap::new(Profile::Baumer, 115_200).hear(&text).told(), advancing);
}

#[test]
fn a_request_that_a_late_answer_crosses_takes_its_own_answer() {
    check(
        Tap::new(Profile::Baumer, 115_200).hear(BOTH),
        "80 +12000 81 +300 05 88 +300 05 89 +1000",
        &[
            "5 request 0 slin.no-response",
            "6 request 1",
            "7 response 0 at 5 slin.late-answer",
            "8 response 1 at 5 to 6",
        ],
    );
}

#[test]
fn a_request_that_only_a_late_answer_follows_is_not_answered() {
    check(
        Tap::new(Profile::Baumer, 115_200).hear(BOTH),
        "80 +12000 81 +300 05 88 +12000 81 +300 05 89 +1000",
        &[
            "5 request 0 slin.no-response",
            "6 request 1 slin.no-response",
            "7 response 0 at 5 slin.late-answer",
            "8 request 1",
            "9 response 1 at 5 to 8",
        ],
    );
}

#[test]
fn two_late_answers_cross_one_request() {
    let three = format!("{BOTH} 82 +250 05 8A +1000");
    check(
        Tap::new(Profile::Baumer, 115_200).hear(&three),
        "80 +12000 81 +12000 82 +100 05 88 +100 05 89 +100 05 8A +1000",
        &[
            "7 request 0 slin.no-response",
            "8 request 1 slin.no-response",
            "9 request 2",
            "10 response 0 at 5 slin.late-answer",
            "11 response 1 at 5 slin.late-answer",
            "12 response 2 at 5 to 9",
        ],
    );
}

#[test]
fn the_end_of_the_capture_judges_no_request_that_was_crossed() {
    let tap = Tap::new(Profile::Baumer, 115_200).hear(BOTH).hear("80 +12000 81 +300 05 88");
    let told = tap.told_until(1e6);
    assert_eq!(told[5..], ["6 request 1", "7 response 0 at 5 slin.late-answer"]);
}

#[test]
fn a_damaged_request_makes_no_address_heard() {
    // Nobody is at 3. At 9600 Bd the next request, 81h for 80h, follows within half a character
    // and is taken for a data word of 3's answer.
    let exchange = "80 +250 64 E8 +3000";
    check(
        Tap::new(Profile::Baumer, 9_600)
            .hear(&format!("{exchange} {exchange} 83 +3000 {exchange}")),
        &format!("83 +300 81* +250 64 E8 +3000 83 +3000 {exchange}"),
        &[
            "8 request 3",
            "9 response 0 at 12801 to 8 slin.parity slin.address-mismatch",
            "10 request 3",
            "11 request 0",
            "12 response 0 at 100 to 11",
        ],
    );
}

#[test]
fn a_damaged_request_asks_nobody_in_vain() {
    // It may have been for somebody else.
    check(
        Tap::new(Profile::Baumer, 115_200).hear(BOTH),
        "81* +15000 87* +15000 87 +15000",
        &["5 request 1 slin.parity", "6 request 7 slin.parity", "7 request 7 slin.never-answered"],
    );
}

#[test]
fn a_footer_that_lost_its_bit_7_is_one_though_the_next_request_is_close() {
    // At 9600 Bd a bit takes 104 µs and half a character 573 µs. 02+23+04 = 29h: checksum 2.
    let tap = || Tap::new(Profile::Tr, 9_600).hear("82 +250 02 23 04 A2 +3000");
    let told = tap().hear("82 +250 02 23 04 22* +300 83 +250 05 83 +3000").told();
    // 02h + 23h * 2^7 + 04h * 2^14
    assert_eq!(told[3], "4 response 2 at 70018 to 3 slin.parity ?slin.early-response");
    assert_eq!(told[4], "5 request 3");
    // What follows without a pause belongs to the same answer: here 22h was sent as 23h.
    // 02+23+23 = 48h: checksum 4.
    let told = tap().hear("82 +250 02 23 22* C2 +3000 83 +250 05 83 +3000").told();
    // 02h + 23h * 2^7 + 22h * 2^14
    assert_eq!(told[3], "4 response 2 at 561538 to 3 slin.parity ?slin.early-response");
    assert_eq!(told[4], "5 request 3");
}

#[test]
fn a_request_that_lost_its_bit_7_is_one_though_another_follows() {
    // Nobody is at 0, and nothing is known of bit 3: 80 00 80 could be the answer of position 0,
    // if its words were not so far apart.
    check(
        Tap::new(Profile::Auto, 9_600),
        "80 +1800 00* +1800 80 +1800 81 +1800",
        &[
            "1 request 0 slin.never-answered",
            "2 request 0 slin.parity",
            "3 request 0",
            "4 request 1 slin.never-answered",
        ],
    );
}

#[test]
fn a_damaged_footer_is_one_though_the_next_request_is_close() {
    // 74+7F+11 = 104h: checksum 0, and a footer like a request. With 82h for 83h, 02h could be a
    // fourth word and the next request the footer, if that were joined to it.
    check(
        Tap::new(Profile::Auto, 9_600),
        "83 +150 74 7F 11 82* +300 83 +150 74 7F 11 83 +3000",
        &[
            "1 request 3",
            "2 response 3 at 294900 to 1 slin.parity slin.address-mismatch",
            "3 request 3",
            "4 response 3 at 294900 to 3",
        ],
    );
}

#[test]
fn a_wrong_footer_in_time_is_the_asked_stations() {
    // 3 was asked in vain; 0's footer names it.
    check(
        Tap::new(Profile::Baumer, 115_200).hear(&format!("{BOTH} 83 +15000")),
        "80 +250 05 8B +1000 83 +15000 80 +250 05 88 +1000",
        &[
            "6 request 0",
            "7 response 3 at 5 to 6 slin.address-mismatch",
            "8 request 3",
            "9 request 0",
            "10 response 0 at 5 to 9",
        ],
    );
}

/// An adapter that marks whole packets marked one: 80h was sent, or another footer.
#[test]
fn addresses_that_differ_where_either_may_be_damaged_are_not_judged() {
    for (text, judged) in [
        ("81^ +250 64 E8 +1000", "?slin.address-mismatch"),
        ("81 +250 64 E8^ +1000", "?slin.address-mismatch"),
        ("81 +250 64^ E8 +1000", "slin.address-mismatch"),
    ] {
        let last = format!("6 response 0 at 100 to 5 {judged}");
        let tap = Tap::new(Profile::Baumer, 115_200).hear(BOTH);
        let told = tap.hear(text).told();
        assert_eq!(told.last(), Some(&last), "{text}");
    }
}

#[test]
fn an_answer_long_after_an_exchange_is_no_second_one_to_it() {
    let late = "80 +250 05 88 +5000000 05 88 +1000";
    let told = Tap::new(Profile::Baumer, 115_200).hear(BOTH).hear(late).hear(late).told();
    assert_eq!(
        told[4..],
        [
            "5 request 0",
            "6 response 0 at 5 to 5",
            "7 stray slin.stray-data",
            "8 request 0",
            "9 response 0 at 5 to 8",
            "10 stray slin.stray-data",
        ]
    );
    // Right behind it, it is one.
    let twice = "80 +250 05 88 +300 05 88 +1000";
    let told = Tap::new(Profile::Baumer, 115_200).hear(BOTH).hear(twice).hear(twice).told();
    assert_eq!(told[6], "7 response 0 at 5 to 5 slin.stray-data");
    assert_eq!(told[9], "10 response 0 at 5 to 8 slin.duplicate-address");
}

#[test]
fn a_lower_limit_under_one_bit_time_is_not_judged() {
    // At 9600 Bd a bit takes 104 µs, more than the 100 µs of TR SLIN §6: even words that overlap
    // the request by 200 µs are not told to be early. At 19200 Bd it takes 52 µs.
    for (baud, expected) in [
        (9_600, "2 response 0 at 5 to 1 ?slin.early-response"),
        (19_200, "2 response 0 at 5 to 1 slin.early-response"),
    ] {
        let told = Tap::new(Profile::Tr, baud).hear("80 +-200 05 80 +3000").told();
        assert_eq!(told[1], expected);
    }
}

#[test]
fn a_low_pulse_is_no_request() {
    // The line was low for a character: all bits 0, the parity fits, the stop bit is missing.
    check(
        Tap::new(Profile::Baumer, 115_200).hear(BOTH),
        "00# +1000 80 +250 05 88 +1000",
        &["5 stray uart.framing slin.stray-data", "6 request 0", "7 response 0 at 5 to 6"],
    );
    check(
        Tap::new(Profile::Baumer, 115_200),
        "00# +1000 80 +250 05 88 +1000",
        &["1 partial", "2 request 0", "3 response 0 at 5 to 2"],
    );
    // A request that lost its bit 7 is one, and so is one without its stop bit.
    for request in ["00*", "80#"] {
        let told = Tap::new(Profile::Baumer, 115_200)
            .hear(BOTH)
            .hear(&format!("{request} +250 05 88 +1000"))
            .told();
        assert_eq!(told[5], "6 response 0 at 5 to 5", "{told:?}");
    }
}
