//! Where SLIN records leave: what all of them have in common is filled in here.

use super::PROTOCOL;
use super::judge::Verdict;
use super::telegram::{BREAK, EVENT, LOST, REQUEST, RESPONSE, Telegram};
use crate::event::{Break, Loss, Moment};
use crate::finding::Finding;
use crate::record::{BusInfo, Output, Record, Turn};
use crate::uart::{Character, Wire};

/// A bus and where its records go.
pub(super) struct Outlet<'a, 'b> {
    pub bus: &'a BusInfo,
    pub wire: Wire,
    pub out: &'a mut Output<'b>,
}

impl Outlet<'_, '_> {
    /// Tells what was made from characters. Returns the record's number.
    pub fn emit(&mut self, kind: &'static str, verdict: &Verdict, telegram: &Telegram<'_>) -> u64 {
        let mut record = Record::new(&PROTOCOL, kind, (self.bus, self.wire), telegram)
            .of_characters(telegram.characters);
        record.station = telegram.whose().map(|address| u16::from(address.get()));
        record.findings = &verdict.findings;
        record.ongoing = &verdict.ongoing;
        record.withheld = &verdict.withheld;
        record.duration = self.duration(telegram.characters);
        record.turn = match kind {
            REQUEST => Turn::Asks,
            RESPONSE => Turn::Answers,
            _ => Turn::Neither,
        };
        self.out.emit(record)
    }

    /// Tells what no telegram carries, at the end of the last character.
    pub fn event(
        &mut self,
        finding: Finding,
        about: Option<u64>,
        station: Option<u16>,
        last: Option<Character>,
    ) {
        let (findings, nothing) = ([finding], Telegram::default());
        let one = self.wire.character_ns().unwrap_or_default();
        let now = last.map_or(Moment::UNKNOWN, |last| last.start.plus(one));
        let mut event =
            Record::new(&PROTOCOL, EVENT, (self.bus, self.wire), &nothing).of_event(now, &findings);
        event.uncertainty = last.map_or(0, |last| last.uncertainty);
        event.about = about;
        event.station = station;
        self.out.emit(event);
    }

    /// Tells a break.
    pub fn line_break(&mut self, event: &Break) {
        let nothing = Telegram::default();
        self.out
            .emit(Record::new(&PROTOCOL, BREAK, (self.bus, self.wire), &nothing).of_break(*event));
    }

    /// Tells a loss.
    pub fn loss(&mut self, loss: &Loss) {
        let nothing = Telegram::default();
        self.out.emit(Record::new(&PROTOCOL, LOST, (self.bus, self.wire), &nothing).of_loss(*loss));
    }

    fn duration(&self, characters: &[Character]) -> Option<u64> {
        let ns = characters.last()?.start.since(characters.first()?.start)?;
        u64::try_from(ns + self.wire.character_ns()?).ok()
    }
}
