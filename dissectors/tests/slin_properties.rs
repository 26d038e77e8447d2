//! What holds for every SLIN bus, whatever its encoders, rates and damages.

use fieldtap_dissectors::bus::{Bus, Sampling, WireFacts};
use fieldtap_dissectors::event::{Clock, Event, Levels, Moment};
use fieldtap_dissectors::field::{Role, Value};
use fieldtap_dissectors::protocol::Settings;
use fieldtap_dissectors::record::{BusInfo, Output, Record, Sink};
use fieldtap_dissectors::slin::{self, ChecksumChoice, Profile, checksum::Rule};
use fieldtap_dissectors::uart::{Baud, Character, Parity};
use proptest::collection::vec;
use proptest::prelude::*;

/// What is compared of a record.
#[derive(Clone, PartialEq, Debug)]
struct Told {
    kind: &'static str,
    station: Option<u16>,
    start: Option<i64>,
    bytes: Vec<u8>,
    position: Option<i64>,
    response_time: Option<i64>,
    codes: Vec<&'static str>,
}

#[derive(Default)]
struct Recorder(Vec<Told>);

impl Sink for Recorder {
    fn record(&mut self, record: &Record<'_>) {
        let number = |value: Value<'_>| match value {
            Value::Int(value) => Some(value),
            _ => None,
        };
        self.0.push(Told {
            kind: record.kind,
            station: record.station,
            start: record.start.ns(),
            bytes: record.characters().iter().map(Character::byte).collect(),
            position: number(record.by_role(Role::Position)),
            response_time: number(record.by_role(Role::ResponseTime)),
            codes: record.findings.iter().map(|finding| finding.code.name).collect(),
        });
    }
}

/// An encoder's habits and the rate of its bus.
#[derive(Clone, Copy, Debug)]
struct Line {
    baud: u32,
    profile: Profile,
    rule: Rule,
    bit3: bool,
    /// Leading zero words are kept.
    is_fixed: bool,
}

/// A request and its answer.
#[derive(Clone, Copy, Debug)]
struct Exchange {
    address: u8,
    /// Nothing if nobody is there.
    position: Option<u32>,
    /// From the request's end to the answer, in ns.
    response_time: i64,
    /// From the answer's end to the next request.
    pause: Pause,
}

/// How long a master waits before it asks again.
#[derive(Clone, Copy, Debug)]
struct Pause {
    bits: i64,
    ns: i64,
}

/// How long a master waits for an answer that does not come, in ns.
const WAIT: i64 = 1_500_000;

impl Line {
    fn character_ns(self) -> i64 {
        11_000_000_000 / i64::from(self.baud)
    }

    /// The footer's checksum, computed as TR SLIN §7 and Baumer SLIN §3.3 list it.
    fn checksum(self, words: &[u8]) -> u8 {
        let (mut sum, mut carry) = (0_u32, 0);
        let count = if self.rule == Rule::Addc { 4 } else { words.len() };
        for index in 0..count {
            sum += u32::from(*words.get(index).unwrap_or(&0));
            sum += if self.rule == Rule::Add { 0 } else { carry };
            carry = sum >> 8;
            sum &= 0xFF;
        }
        sum as u8 & 0x70
    }

    fn answer(self, address: u8, position: u32) -> Vec<u8> {
        let mut words = vec![(position & 0x7F) as u8];
        let mut left = position >> 7;
        while left > 0 || self.is_fixed && words.len() < 4 {
            words.push((left & 0x7F) as u8);
            left >>= 7;
        }
        let footer = 0x80 | self.checksum(&words) | u8::from(self.bit3) << 3 | address;
        words.push(footer);
        words
    }

    /// The characters of these exchanges, each exchange's apart.
    fn characters(self, exchanges: &[Exchange]) -> Vec<Vec<Character>> {
        let one = self.character_ns();
        let mut now = 50_000_000;
        let character = |ns: i64, byte: u8| {
            Character::new(Moment::from_ns(ns), 100, u16::from(byte), Parity::Ok)
        };
        let mut heard = Vec::new();
        for exchange in exchanges {
            let mut characters = vec![character(now, 0x80 | exchange.address)];
            now += one;
            if let Some(position) = exchange.position {
                now += exchange.response_time;
                for byte in self.answer(exchange.address, position) {
                    characters.push(character(now, byte));
                    now += one;
                }
            } else {
                now += WAIT;
            }
            now += exchange.pause.bits * one / 11 + exchange.pause.ns;
            heard.push(characters);
        }
        heard
    }

    /// The line's edges in ticks of [`TICK_NS`], from high, and its end: characters as 8E1.
    fn edges(self, exchanges: &[Exchange]) -> (Vec<u64>, u64) {
        let bit_ns = 1e9 / f64::from(self.baud);
        let (mut edges, mut level, mut end) = (Vec::new(), true, 0);
        for character in self.characters(exchanges).concat() {
            let start = character.start.ns().expect("it has a time") as f64;
            let byte = u32::from(character.byte());
            let bits = byte << 1 | (byte.count_ones() & 1) << 9 | 1 << 10;
            for index in 0..11 {
                let tick = ((start + f64::from(index) * bit_ns) / TICK_NS) as u64;
                if (bits >> index & 1 == 1) != level {
                    edges.push(tick);
                    level = !level;
                }
                end = tick;
            }
        }
        (edges, end + 1_000_000)
    }

    fn settings(self) -> Settings {
        let mut settings = Settings {
            protocol: Some(&slin::PROTOCOL),
            slin: slin::Settings { profile: self.profile, checksum: ChecksumChoice::OfProfile },
            ..Settings::default()
        };
        settings.line.baud = Baud::new(self.baud);
        settings
    }
}

/// Decodes characters that come in these pieces, with an advance behind each of them.
fn decode(settings: Settings, pieces: &[&[Character]], advance: bool) -> Vec<Told> {
    let info = BusInfo::new("bus", Some(Clock::Hardware));
    let mut bus = Bus::new(info, WireFacts::default(), settings);
    let (mut recorder, mut number) = (Recorder::default(), 0);
    for (index, piece) in pieces.iter().enumerate() {
        bus.hear(Event::Characters(piece), &mut Output::new(&mut number, &mut recorder));
        let next = pieces.get(index + 1).and_then(|piece| piece.first());
        if let (true, Some(next)) = (advance, next) {
            let until = next.start.plus(-1);
            bus.hear(Event::Advance(until), &mut Output::new(&mut number, &mut recorder));
        }
    }
    bus.finish(Moment::UNKNOWN, &mut Output::new(&mut number, &mut recorder));
    recorder.0
}

/// 10 MHz.
const TICK_NS: f64 = 100.0;

/// Decodes line levels that come in pieces, divided at these ticks.
fn decode_levels(settings: Settings, edges: &[u64], cuts: &[u64]) -> Vec<Told> {
    let info = BusInfo::new("bus", Some(Clock::Sample));
    let sampling =
        Sampling { ticks_per_second: 10_000_000, uncertainty: 100, origin: Moment::from_ns(0) };
    let facts = WireFacts { sampling: Some(sampling), ..WireFacts::default() };
    let mut bus = Bus::new(info, facts, settings);
    let (mut recorder, mut number) = (Recorder::default(), 0);
    let mut level = true;
    for cut in cuts.windows(2) {
        let (from, until) = (cut[0], cut[1]);
        let first = edges.partition_point(|edge| *edge < from);
        let behind = edges.partition_point(|edge| *edge < until);
        let piece = Levels { edges: &edges[first..behind], level, from, until };
        bus.hear(Event::Levels(piece), &mut Output::new(&mut number, &mut recorder));
        level ^= (behind - first) % 2 == 1;
    }
    bus.finish(Moment::UNKNOWN, &mut Output::new(&mut number, &mut recorder));
    recorder.0
}

fn lines() -> impl Strategy<Value = Line> {
    let rates = prop::sample::select(vec![9_600, 19_200, 115_200, 345_594]);
    let profiles = prop::sample::select(vec![
        (Profile::Baumer, Rule::Add, true),
        (Profile::Tr, Rule::Addc, false),
        (Profile::TrReserveHigh, Rule::Addc, true),
        (Profile::Auto, Rule::Add, true),
        (Profile::Auto, Rule::Addc, false),
        (Profile::Auto, Rule::AddcSent, true),
    ]);
    (rates, profiles, any::<bool>()).prop_map(|(baud, (profile, rule, bit3), is_fixed)| Line {
        baud,
        profile,
        rule,
        bit3,
        is_fixed,
    })
}

/// Exchanges of stations that stay where they are, so that they cannot jump; at some addresses is
/// nobody. Masters pause as they like.
fn exchanges(pauses: impl Strategy<Value = Pause>) -> impl Strategy<Value = Vec<Exchange>> {
    let positions = prop_oneof![0..128_u32, 0..16_384_u32, 0..33_554_432_u32, 294_900..294_920_u32];
    let stations = vec(prop::option::weighted(0.75, positions), 8);
    let one = (0..8_u8, 150_000..350_000_i64, pauses);
    (stations, vec(one, 1..40)).prop_map(|(positions, all)| {
        let exchange = |(address, response_time, pause)| Exchange {
            address,
            position: positions[usize::from(address)],
            response_time,
            pause,
        };
        all.into_iter().map(exchange).collect()
    })
}

/// From well above the two bits by which words may be apart to a few milliseconds.
fn busy() -> impl Strategy<Value = Pause> {
    prop_oneof![
        (3..6_i64).prop_map(|bits| Pause { bits, ns: 0 }),
        (11..44_i64, 100_000..3_000_000_i64).prop_map(|(bits, ns)| Pause { bits, ns }),
    ]
}

/// The same, and now and then for seconds.
fn sparse() -> impl Strategy<Value = Pause> {
    let long = (0..5_000_000_000_i64).prop_map(|ns| Pause { bits: 3, ns });
    prop_oneof![3 => busy(), 1 => long]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// What an encoder sends is what is told, with nothing found.
    #[test]
    fn what_is_sent_is_told(line in lines(), exchanges in exchanges(sparse())) {
        let heard = line.characters(&exchanges);
        let pieces: Vec<&[Character]> = heard.iter().map(Vec::as_slice).collect();
        let told = decode(line.settings(), &pieces, false);
        let mut told = told.iter();
        for exchange in &exchanges {
            let request = told.next().expect("each request is told");
            prop_assert_eq!((request.kind, request.station), ("request", Some(u16::from(exchange.address))));
            let Some(position) = exchange.position else {
                prop_assert!(request.codes.iter().all(|code| *code == "slin.never-answered"), "{request:?}");
                continue;
            };
            let answer = told.next().expect("each answer is told");
            prop_assert_eq!((answer.kind, answer.station), ("response", Some(u16::from(exchange.address))));
            prop_assert_eq!(answer.position, Some(i64::from(position)));
            let time = answer.response_time.unwrap_or_default();
            prop_assert!((time - exchange.response_time).abs() < 20, "{time}");
            prop_assert!(request.codes.is_empty() && answer.codes.is_empty(), "{request:?} {answer:?}");
        }
        prop_assert_eq!(told.next(), None);
    }

    /// However the characters come, and however often time is said to pass, the records are the
    /// same.
    #[test]
    fn the_division_of_the_input_does_not_matter(
        line in lines(),
        exchanges in exchanges(sparse()),
        is_auto in any::<bool>(),
        cuts in vec(any::<prop::sample::Index>(), 0..20),
    ) {
        let heard: Vec<Character> = line.characters(&exchanges).concat();
        let mut settings = line.settings();
        if is_auto {
            settings.protocol = None;
            settings.line.baud = None;
        }
        let whole = decode(settings.clone(), &[&heard], false);
        let mut cuts: Vec<usize> = cuts.iter().map(|cut| cut.index(heard.len())).collect();
        cuts.extend([0, heard.len()]);
        cuts.sort_unstable();
        let pieces: Vec<&[Character]> = cuts.windows(2).map(|cut| &heard[cut[0]..cut[1]]).collect();
        prop_assert_eq!(&decode(settings.clone(), &pieces, false), &whole);
        let single: Vec<&[Character]> = heard.chunks(1).collect();
        prop_assert_eq!(&decode(settings, &single, true), &whole);
    }

    /// Nor does it matter how the levels of a line are divided, be it between two edges of a bit.
    #[test]
    fn the_division_of_the_line_does_not_matter(
        line in lines(),
        exchanges in exchanges(busy()),
        cuts in vec(any::<prop::sample::Index>(), 0..200),
        is_found in any::<bool>(),
    ) {
        let (edges, end) = line.edges(&exchanges);
        let mut settings = line.settings();
        if is_found {
            settings = Settings::default();
        }
        let whole = decode_levels(settings.clone(), &edges, &[0, end]);
        let responses = whole.iter().filter(|told| told.kind == "response").count();
        let answers = exchanges.iter().filter(|exchange| exchange.position.is_some()).count();
        prop_assert!(is_found || responses == answers, "{responses}");
        let mut cuts: Vec<u64> = cuts.iter().map(|cut| cut.index(end as usize) as u64).collect();
        cuts.extend([0, end]);
        cuts.sort_unstable();
        prop_assert_eq!(&decode_levels(settings.clone(), &edges, &cuts), &whole);
        let each: Vec<u64> = [0].iter().chain(&edges).copied().chain([end]).collect();
        prop_assert_eq!(&decode_levels(settings, &edges, &each), &whole);
    }

    /// A damaged character, whichever of its bits is wrong, costs its own exchange and no other.
    #[test]
    fn damage_stays_in_its_exchange(
        line in lines(),
        exchanges in exchanges(sparse()),
        hit in any::<prop::sample::Index>(),
        which in any::<prop::sample::Index>(),
        bit in 0..9_u32,
    ) {
        let healthy = line.characters(&exchanges);
        let mut heard = healthy.clone();
        let hit = hit.index(heard.len());
        let which = which.index(heard[hit].len());
        let character = &mut heard[hit][which];
        let byte = character.byte() ^ (1_u32 << bit) as u8;
        *character = Character::new(
            character.start, character.uncertainty, u16::from(byte), Parity::Error,
        );
        let found = codes_found(line, &healthy, &heard, hit)?;
        // What the edges of the capture cut is not judged.
        let is_cut = hit == 0 || hit + 1 == heard.len();
        prop_assert!(is_cut || found.contains(&"slin.parity") || found.contains(&"slin.glitch"), "{found:?}");
    }

    /// So does a footer that names another station, whether anybody is there or not.
    #[test]
    fn a_wrong_footer_stays_in_its_exchange(
        line in lines(),
        exchanges in exchanges(sparse()),
        hit in any::<prop::sample::Index>(),
        other in 1..8_u16,
    ) {
        let healthy = line.characters(&exchanges);
        let mut heard = healthy.clone();
        let answered: Vec<usize> =
            (0..exchanges.len()).filter(|at| exchanges[*at].position.is_some()).collect();
        if answered.is_empty() {
            return Ok(());
        }
        let hit = *hit.get(&answered);
        let footer = heard[hit].last_mut().expect("an answer ends with it");
        *footer = Character::new(
            footer.start, footer.uncertainty, footer.value() ^ other, Parity::Ok,
        );
        let found = codes_found(line, &healthy, &heard, hit)?;
        prop_assert_eq!(found, ["slin.address-mismatch"]);
    }
}

/// The codes found where one exchange was hit. Nothing else may be told in another way; but that
/// nobody answers at an address is told once, and can be told later.
fn codes_found(
    line: Line,
    healthy: &[Vec<Character>],
    heard: &[Vec<Character>],
    hit: usize,
) -> Result<Vec<&'static str>, TestCaseError> {
    let told = |exchanges: &[Vec<Character>]| {
        let pieces: Vec<&[Character]> = exchanges.iter().map(Vec::as_slice).collect();
        let mut told = decode(line.settings(), &pieces, false);
        for told in &mut told {
            told.codes.retain(|code| *code != "slin.never-answered");
        }
        told
    };
    let from = heard[hit][0].start.ns();
    let to = heard.get(hit + 1).and_then(|next| next[0].start.ns());
    let is_here = |told: &Told| told.start >= from && to.is_none_or(|to| told.start < Some(to));
    let (here, still): (Vec<Told>, Vec<Told>) = told(heard).into_iter().partition(is_here);
    let unharmed: Vec<Told> = told(healthy).into_iter().filter(|told| !is_here(told)).collect();
    prop_assert_eq!(still, unharmed);
    Ok(here.into_iter().flat_map(|told| told.codes).collect())
}
