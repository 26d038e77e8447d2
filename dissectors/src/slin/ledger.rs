//! From exchanges to records: what is remembered of the bus, and how each exchange is told.

use super::checksum::Rules;
use super::codes;
use super::exchange::{CAPACITY, Distance, Exchange, Part};
use super::judge::{Interval, Verdict, expected_checksum, is_noise, is_sound};
use super::outlet::Outlet;
use super::profile::{Habits, Window};
use super::signature::Signature;
use super::station::Station;
use super::telegram::{PARTIAL, REQUEST, RESPONSE, STRAY, Telegram};
use super::word::{ADDRESSES, Address, Footer, MAX_DATA_WORDS, Request};
use crate::event::Moment;
use crate::finding::Finding;
use crate::motion::Jump;
use crate::protocol::Settings;
use crate::station::Stations;
use crate::uart::{Character, Wire};

/// Why an exchange is over.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum End<'a> {
    /// Its footer came.
    Footer,
    /// The next request came.
    Request(&'a Character),
    /// Nothing came for long enough, or it grew longer than any telegram.
    Silence,
    /// The capture, or what could be heard of it, ended.
    Cut,
}

/// The parts of characters that belong to no exchange.
const NOBODYS: [Part; CAPACITY] = [Part::Stray; CAPACITY];

/// The last exchange that ended with a footer.
#[derive(Clone, Copy, Debug)]
struct Told {
    request: u64,
    address: Address,
    last: Character,
}

/// Everything that is known of a bus beyond the exchange that is under way.
pub(super) struct Ledger {
    pub wire: Wire,
    pub habits: Habits,
    pub signature: Signature,
    names: Stations,
    stations: [Station; ADDRESSES],
    told: Option<Told>,
    verdict: Verdict,
}

impl Ledger {
    pub fn new(wire: Wire, settings: &Settings) -> Self {
        let resolution = |address: u16| settings.stations.get(&address)?.resolution;
        let mut addresses = 0..;
        Ledger {
            wire,
            habits: Habits::new(settings.slin),
            signature: Signature::default(),
            names: settings.stations.clone(),
            stations: core::array::from_fn(|_| Station::new(addresses.next().and_then(resolution))),
            told: None,
            verdict: Verdict::default(),
        }
    }

    /// Tells an exchange that is over, and the late answers that crossed it. Returns whether the
    /// request that ended it may as well be its empty answer.
    pub fn tell(
        &mut self,
        exchange: &Exchange,
        crossing: &[Exchange],
        end: End<'_>,
        outlet: &mut Outlet<'_, '_>,
    ) -> bool {
        let told = self.told.take();
        let Some(request) = exchange.request() else {
            self.tell_unasked(exchange, told, outlet);
            return false;
        };
        let asked = Address::of(request.byte());
        self.verdict.clear();
        self.judge_request(exchange);
        let may_be_answered =
            crossing.is_empty() && self.may_be_empty_answer(exchange, request, end);
        if !exchange.has_answer() {
            self.judge_silence(exchange, request, end, may_be_answered);
        }
        let number = self.emit_request(exchange, asked, outlet);
        for late in crossing {
            self.tell_late_answer(late, late.named().unwrap_or(asked), outlet);
        }
        if !exchange.has_answer() {
            self.tell_stray(exchange, 1, outlet);
        } else if end == End::Cut && exchange.footer().is_none() {
            self.stations[asked.index()].motion.interrupt();
            self.tell_partial(exchange, Some((number, asked)), outlet);
        } else {
            self.tell_response(exchange, request, number, asked, outlet);
        }
        may_be_answered
    }

    /// Whether a character right behind the last footer names the same station: then it is a
    /// second footer, whatever its bits 4 to 6 would mean in a request.
    pub fn is_second_footer(&self, character: &Character) -> bool {
        let Some(told) = self.told else { return false };
        let control = character.byte();
        let distance = Distance::between(&told.last, character, self.wire);
        Request::of(control).reserved != 0
            && told.address == Address::of(control)
            && distance.is_some_and(Distance::is_close)
    }

    /// Whether more words may be a second answer to the last request.
    pub const fn awaits_second_answer(&self) -> bool {
        self.told.is_some()
    }

    /// What was lost, broken off, or long ago leaves no exchange to come back to.
    pub fn forget_last(&mut self) {
        self.told = None;
    }

    /// The station whose late answer this is, if it is not that of the one asked: the footer names
    /// one that was silent before. Within the window of the one asked, it must have been heard
    /// before: else that one's footer is wrong.
    pub fn late_station(&self, exchange: &Exchange) -> Option<Address> {
        let request = exchange.request().filter(|request| !request.is_damaged())?;
        let (asked, named) = (Address::of(request.byte()), exchange.named()?);
        let station = &self.stations[named.index()];
        if named == asked || station.silent == 0 {
            return None;
        }
        let is_in_time = Interval::between(request, exchange.first_word()?, self.wire)
            .is_none_or(|taken| taken.may_lie_in(self.habits.of(asked).window, self.wire));
        (station.is_heard || !is_in_time).then_some(named)
    }

    fn tell_response(
        &mut self,
        exchange: &Exchange,
        request: &Character,
        number: u64,
        asked: Address,
        outlet: &mut Outlet<'_, '_>,
    ) {
        let response = exchange.response();
        let named = response.footer.map(|footer| footer.address);
        let address = named.unwrap_or(asked);
        let taken =
            exchange.first_word().and_then(|first| Interval::between(request, first, self.wire));
        let mut telegram = self.telegram_of(exchange);
        telegram.address = Some(address);
        telegram.request = Some((number, asked));
        telegram.response_time = taken.map(|interval| interval.ns);

        self.verdict.clear();
        self.judge_damage(exchange);
        self.verdict.judge_words(&response);
        if let Some(footer) = response.footer {
            self.verdict.judge_address(exchange, footer, asked);
            let expected = telegram.checksum_expected.unwrap_or(footer.checksum);
            self.verdict.judge_checksum(response.data, footer, expected);
        }
        let bit3 = response.footer.map(|footer| footer.bit3);
        self.verdict.judge_time(taken, self.habits.window(asked, bit3), self.wire);
        self.judge_station(exchange, asked, named);
        telegram.station = self.names.get(&u16::from(address.get()));
        let sound = is_sound(exchange, telegram.checksum_expected.unwrap_or_default());
        let n = outlet.emit(RESPONSE, &self.verdict, &telegram);

        let characters = exchange.characters().len();
        let is_plausible = response.footer.is_some() && response.data.len() <= MAX_DATA_WORDS;
        self.signature.explain(if is_plausible { characters } else { 1 });
        if let Some(last) = exchange.footer() {
            self.told = Some(Told { request: number, address: asked, last: *last });
        }
        let motion = &mut self.stations[asked.index()].motion;
        match (sound, response.position(), response.footer) {
            (true, Some(position), Some(footer)) => {
                let jump = motion.add(position, n);
                self.signature.complete();
                self.habits.learn(
                    asked,
                    footer.bit3,
                    Rules::fitting(response.data, footer.checksum),
                );
                if let Some(jump) = jump {
                    self.tell_jump(jump, asked, exchange, outlet);
                }
            }
            _ => motion.interrupt(),
        }
    }

    /// What an answer says about its station: that it is there, that its silence is over, that
    /// there are two of it.
    fn judge_station(&mut self, exchange: &Exchange, asked: Address, named: Option<Address>) {
        let damaged = damaged_words(exchange);
        let others_are_torn = (0..)
            .zip(&self.stations)
            .any(|(address, station)| address != asked.get() && station.has_torn_answers());
        let now = exchange.first_word().map_or(Moment::UNKNOWN, |first| first.start);
        let station = &mut self.stations[asked.index()];
        station.remember_damage(damaged >= 2);
        if !others_are_torn && let Some((torn, answers)) = station.begins_to_look_doubled() {
            let doubled = Finding::new(&codes::DUPLICATE_ADDRESS)
                .actual(i64::from(torn))
                .limit(i64::from(answers));
            self.verdict.add(doubled);
        }
        // Without its footer, or with another's, it may be the next request and what came of that.
        if named == Some(asked) {
            if let Some(over) = station.end_silence(now) {
                self.verdict.add(over);
            }
            station.is_heard |= damaged == 0;
        }
    }

    /// What it says that no answer came, unless the next request may be one.
    fn judge_silence(
        &mut self,
        exchange: &Exchange,
        request: &Character,
        end: End<'_>,
        may_be_answered: bool,
    ) {
        self.signature.explain(usize::from(is_plain(request)));
        let station = &mut self.stations[Address::of(request.byte()).index()];
        station.motion.interrupt();
        if may_be_answered {
            self.verdict.add(Finding::new(&codes::AMBIGUOUS));
        } else if end != End::Cut && !exchange.may_be_answer && !request.is_damaged() {
            let asked_until = request.start.plus(self.wire.character_ns().unwrap_or_default());
            station.miss(asked_until, &mut self.verdict);
        }
    }

    /// With bit 3 low, `80 80` may be a request and its answer without data words, if the second
    /// begins where an answer may.
    fn may_be_empty_answer(&self, exchange: &Exchange, request: &Character, end: End<'_>) -> bool {
        let End::Request(next) = end else { return false };
        let same = next.byte() == request.byte() && is_plain(request) && !next.is_damaged();
        let expectation = self.habits.of(Address::of(request.byte()));
        let in_time = Interval::between(request, next, self.wire)
            .is_none_or(|interval| interval.may_lie_in(Window::TR, self.wire));
        let is_alone = !exchange.has_answer() && !exchange.may_be_answer;
        same && expectation.bit3 != Some(true) && in_time && is_alone
    }

    fn tell_unasked(
        &mut self,
        exchange: &Exchange,
        told: Option<Told>,
        outlet: &mut Outlet<'_, '_>,
    ) {
        if exchange.is_beginning {
            self.tell_partial(exchange, None, outlet);
            return;
        }
        let named = exchange.footer().filter(|footer| !footer.is_damaged());
        let Some(address) = named.map(|footer| Address::of(footer.byte())) else {
            self.tell_stray(exchange, 0, outlet);
            return;
        };
        if self.stations[address.index()].silent > 0 {
            self.tell_late_answer(exchange, address, outlet);
        } else if let Some(told) = told.filter(|told| told.address == address) {
            self.tell_second_answer(exchange, told, outlet);
        } else {
            self.tell_stray(exchange, 0, outlet);
        }
    }

    /// An answer after its request was given up.
    fn tell_late_answer(
        &mut self,
        exchange: &Exchange,
        address: Address,
        outlet: &mut Outlet<'_, '_>,
    ) {
        let mut telegram = self.telegram_of(exchange);
        telegram.address = Some(address);
        self.verdict.clear();
        self.judge_damage(exchange);
        let start = exchange.first_word().map_or(Moment::UNKNOWN, |first| first.start);
        let station = &mut self.stations[address.index()];
        let mut late = Finding::new(&codes::LATE_ANSWER);
        late.actual = start.since(station.asked);
        self.verdict.add(late);
        if let Some(over) = station.end_silence(start) {
            self.verdict.add(over);
        }
        station.is_heard |= damaged_words(exchange) == 0;
        station.motion.interrupt();
        telegram.station = self.names.get(&u16::from(address.get()));
        outlet.emit(RESPONSE, &self.verdict, &telegram);
    }

    /// A second footer for one request: once may be chance.
    fn tell_second_answer(&mut self, exchange: &Exchange, told: Told, outlet: &mut Outlet<'_, '_>) {
        let station = &mut self.stations[told.address.index()];
        station.double_footers = station.double_footers.saturating_add(1);
        station.motion.interrupt();
        let times = i64::from(station.double_footers);
        if times < 2 && exchange.words() == 0 {
            self.tell_stray(exchange, 0, outlet);
            return;
        }
        let mut telegram = self.telegram_of(exchange);
        telegram.address = Some(told.address);
        telegram.request = Some((told.request, told.address));
        self.verdict.clear();
        self.judge_damage(exchange);
        self.verdict.add(if times < 2 {
            Finding::new(&codes::STRAY_DATA).actual(exchange.characters().len() as i64)
        } else {
            Finding::new(&codes::DUPLICATE_ADDRESS).actual(times)
        });
        telegram.station = self.names.get(&u16::from(told.address.get()));
        outlet.emit(RESPONSE, &self.verdict, &telegram);
    }

    /// Characters from `from` on belong to nobody.
    fn tell_stray(&mut self, exchange: &Exchange, from: usize, outlet: &mut Outlet<'_, '_>) {
        let characters = from..exchange.characters().len();
        if characters.is_empty() {
            return;
        }
        let telegram = Telegram {
            parts: &NOBODYS[..characters.len()],
            characters: &exchange.characters()[characters],
            ..Telegram::default()
        };
        self.verdict.clear();
        self.verdict.judge_damage(telegram.characters, telegram.parts);
        let noise = telegram.characters.iter().zip(telegram.parts);
        let sent = noise.filter(|(character, part)| !is_noise(character, **part)).count();
        if sent > 0 {
            self.verdict.add(Finding::new(&codes::STRAY_DATA).actual(sent as i64));
        }
        outlet.emit(STRAY, &self.verdict, &telegram);
    }

    /// What the edge of the capture cut is told and not judged.
    fn tell_partial(
        &mut self,
        exchange: &Exchange,
        request: Option<(u64, Address)>,
        outlet: &mut Outlet<'_, '_>,
    ) {
        let characters = exchange.answer_begins()..exchange.characters().len();
        let telegram = Telegram {
            address: exchange
                .footer()
                .map(|footer| Address::of(footer.byte()))
                .or(request.map(|(_, address)| address)),
            request,
            parts: &exchange.parts()[characters.clone()],
            characters: &exchange.characters()[characters.clone()],
            ..Telegram::default()
        };
        self.verdict.clear();
        outlet.emit(PARTIAL, &self.verdict, &telegram);
    }

    fn tell_jump(
        &mut self,
        jump: Jump,
        address: Address,
        exchange: &Exchange,
        outlet: &mut Outlet<'_, '_>,
    ) {
        let finding = Finding::new(&codes::POSITION_JUMP)
            .expected(i64::from(jump.expected))
            .actual(i64::from(jump.position));
        let last = exchange.last().copied();
        let station = Some(u16::from(address.get()));
        outlet.event(finding, Some(jump.record), station, last);
    }

    /// What was lost leaves a gap that no step of a position may cross.
    pub fn interrupt_motion(&mut self) {
        for station in &mut self.stations {
            station.motion.interrupt();
        }
    }

    fn judge_request(&mut self, exchange: &Exchange) {
        self.verdict.judge_damage(&exchange.characters()[..1], &exchange.parts()[..1]);
        let reserved = Request::of(exchange.characters()[0].byte()).reserved;
        if reserved != 0 {
            let finding = Finding::new(&codes::RESERVED_BITS).actual(i64::from(reserved));
            self.verdict.add(finding);
        }
    }

    fn judge_damage(&mut self, exchange: &Exchange) {
        let from = exchange.answer_begins();
        self.verdict.judge_damage(&exchange.characters()[from..], &exchange.parts()[from..]);
    }

    fn emit_request(
        &mut self,
        exchange: &Exchange,
        asked: Address,
        outlet: &mut Outlet<'_, '_>,
    ) -> u64 {
        let request = &exchange.characters()[0];
        let asked_until = request.start.plus(self.wire.character_ns().unwrap_or_default());
        self.stations[asked.index()].asked = asked_until;
        let telegram = Telegram {
            address: Some(asked),
            parts: &exchange.parts()[..1],
            characters: &exchange.characters()[..1],
            station: self.names.get(&u16::from(asked.get())),
            ..Telegram::default()
        };
        outlet.emit(REQUEST, &self.verdict, &telegram)
    }

    /// What the words of an answer say on their own.
    fn telegram_of<'e>(&self, exchange: &'e Exchange) -> Telegram<'e> {
        let response = exchange.response();
        let from = exchange.answer_begins();
        let asked = exchange.asked().or(response.footer.map(|footer| footer.address));
        let expected = |footer: Footer| {
            let expectation = self.habits.of(asked.unwrap_or(footer.address));
            expected_checksum(response.data, footer, expectation)
        };
        Telegram {
            address: response.footer.map(|footer| footer.address),
            position: response.position(),
            data_words: Some(response.data.len()),
            footer: response.footer,
            checksum_expected: response.footer.map(expected),
            fitting: response.footer.map(|footer| Rules::fitting(response.data, footer.checksum)),
            framed_by: Some(exchange.framed_by),
            parts: &exchange.parts()[from..],
            characters: &exchange.characters()[from..],
            ..Telegram::default()
        }
    }
}

/// Whether a character is a request without any oddity.
fn is_plain(request: &Character) -> bool {
    request.byte() & 0xF8 == 0x80 && !request.is_damaged()
}

/// Damaged characters of the answer, noise left out.
fn damaged_words(exchange: &Exchange) -> usize {
    let from = exchange.answer_begins();
    let words = exchange.characters()[from..].iter().zip(&exchange.parts()[from..]);
    words.filter(|(character, part)| character.is_damaged() && !is_noise(character, **part)).count()
}
