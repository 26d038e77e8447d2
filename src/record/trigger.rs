//! What an event is, and the thread that looks for events.
//!
//! It decodes what the recorder has taken already, and so keeps nobody waiting. Where it falls
//! behind a live tap for long, it is told of a loss, and says so: the recording has none.

use crate::clock::Clock;
use crate::pipeline::{Consumer, Pipeline};
use crate::say;
use crate::source::{Outbox, Piece, Source, SourceError};
use crate::tally::Tally;
use crate::verdict::{Cut, Verdict};
use dissectors::event::{Loss, LossCause, Moment};
use dissectors::finding::{Code, Finding, Severity, State};
use dissectors::protocol::{Medium, PROTOCOLS, Protocol, Settings, codes_named};
use dissectors::record::{BusInfo, Record, Sink};
use std::str::FromStr;
use std::sync::mpsc::{Receiver, Sender, SyncSender, TrySendError, channel, sync_channel};
use std::thread::{self, JoinHandle};

/// Pieces that may wait to be decoded.
const AHEAD: usize = 4096;

/// The same where the source waits for the decoder: such pieces are larger.
const SHORT_AHEAD: usize = 16;

/// A kind of event.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Trigger {
    /// A finding of this code.
    Code(&'static Code),
    /// A finding that is at least this bad.
    Severity(Severity),
}

impl FromStr for Trigger {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let severities = [Severity::Info, Severity::Warning, Severity::Error];
        if let Some(severity) = severities.into_iter().find(|severity| severity.name() == text) {
            return Ok(Trigger::Severity(severity));
        }
        match codes_named(text)[..] {
            [code] => Ok(Trigger::Code(code)),
            [] => Err(format!(
                "{text} is neither a finding's code nor error, warning or info: `fieldtap explain` \
                 lists the codes"
            )),
            ref several => {
                let names: Vec<&str> = several.iter().map(|code| code.name).collect();
                Err(format!("{text} may be {}", names.join(" or ")))
            }
        }
    }
}

impl Trigger {
    /// Why no such event can ever come of a bus of this protocol, or on a tap of this medium, where
    /// they are known.
    pub fn obstacle(
        self,
        protocol: Option<&'static Protocol>,
        medium: Option<Medium>,
    ) -> Option<String> {
        let Trigger::Code(code) = self else { return None };
        let finders = || PROTOCOLS.into_iter().filter(|protocol| protocol.may_find(code));
        let owner = finders().next()?;
        if finders().all(|protocol| protocol.medium == Medium::Words) {
            return Some(format!("{} is of a ring, and rings are not recorded", code.name));
        }
        if let Some(chosen) = protocol.filter(|chosen| !chosen.may_find(code)) {
            let (name, owner) = (code.name, owner.name);
            return Some(format!(
                "{name} is a finding of {owner}, and of --protocol {} it never comes",
                chosen.name
            ));
        }
        let carries = medium.filter(|medium| finders().all(|it| it.medium != *medium))?.carries();
        Some(format!("{} never comes on a tap that hears {carries}", code.name))
    }

    /// Whether no such event can come where the parity of characters is not known.
    pub fn needs_parity(self) -> bool {
        matches!(self, Trigger::Code(code) if code.name == "slin.parity")
    }

    /// Whether a finding is such an event. The end of a state is none.
    fn holds(self, finding: &Finding) -> bool {
        let is_end = matches!(finding.state, Some(State::End(_)));
        !is_end
            && match self {
                Trigger::Code(code) => finding.code == code,
                Trigger::Severity(severity) => finding.severity() >= severity,
            }
    }
}

/// What the watch has to say.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Told {
    /// There was an event.
    Event(Moment),
    /// Everything up to here was decoded.
    Decoded(Moment),
}

/// What is sent to be decoded: what a source said, and up to when that reaches; or that another
/// source begins.
enum Order {
    Heard(Outbox, Moment),
    NextSource,
}

/// A thread that looks for events.
pub struct Watch {
    orders: Option<SyncSender<Order>>,
    told: Receiver<Told>,
    empty: Receiver<Outbox>,
    thread: Option<JoinHandle<Watcher>>,
    /// What comes cannot wait.
    is_live: bool,
    /// Pieces were left out since the last one that was sent.
    is_gap: bool,
    /// Pieces that were left out.
    pub missed: u64,
    buses: usize,
}

/// What a watch has seen, at its end.
pub struct Watcher {
    triggers: Vec<Trigger>,
    told: Sender<Told>,
    tally: Tally,
    clock: Clock,
    pipeline: Option<Pipeline>,
}

impl Watcher {
    /// The last four lines.
    pub fn verdict(&self, has_failed: bool) -> Option<Verdict> {
        let pipeline = self.pipeline.as_ref()?;
        Some(Verdict::of(&self.tally, pipeline, &self.clock, has_failed.then_some(Cut::Failure)))
    }
}

impl Watch {
    /// Begins to look for these events. What is live comes whether it is decoded in time or not.
    pub fn begin(triggers: Vec<Trigger>, settings: Settings, clock: Clock, is_live: bool) -> Watch {
        let (orders, to_do) = sync_channel(if is_live { AHEAD } else { SHORT_AHEAD });
        let (say, told) = channel();
        let (give_back, empty) = sync_channel(AHEAD);
        let watcher =
            Watcher { triggers, told: say.clone(), tally: Tally::default(), clock, pipeline: None };
        let begin = move || {
            let orders = Orders {
                orders: to_do,
                give_back,
                told: say,
                current: Outbox::default(),
                reach: Moment::UNKNOWN,
                has_more: true,
            };
            watch(orders, watcher, Pipeline::new(settings))
        };
        let (orders, thread) = (Some(orders), Some(thread::spawn(begin)));
        Watch { orders, told, empty, thread, is_live, is_gap: false, missed: 0, buses: 0 }
    }

    /// An outbox to be filled.
    pub fn outbox(&mut self) -> Outbox {
        let mut outbox = self.empty.try_recv().unwrap_or_default();
        outbox.forget();
        outbox
    }

    /// Has this decoded, which reaches up to `reach`.
    pub fn decode(&mut self, heard: Outbox, reach: Moment) {
        let Some(orders) = &self.orders else { return };
        let mut heard = heard;
        if self.is_gap {
            let mut with_gap = Outbox::default();
            for bus in 0..self.buses {
                let loss = Loss { start: reach, count: None, cause: LossCause::Capture };
                with_gap.lost(bus, loss);
            }
            while let Some(Ok(piece)) = heard.next() {
                with_gap.pass_on(piece);
            }
            heard = with_gap;
        }
        let order = Order::Heard(heard, reach);
        if !self.is_live {
            // It is there for as long as orders can come.
            let _ = orders.send(order);
            return;
        }
        match orders.try_send(order) {
            Err(TrySendError::Full(_)) => {
                if self.missed == 0 {
                    say!(
                        "fieldtap: warning: decoding falls behind the bus: events may be missed \
                         (the recording misses nothing)"
                    );
                }
                self.is_gap = true;
                self.missed += 1;
            }
            Ok(()) => self.is_gap = false,
            Err(TrySendError::Disconnected(_)) => {}
        }
    }

    /// Another bus appeared.
    pub fn add_bus(&mut self) {
        self.buses += 1;
    }

    /// Another source begins.
    pub fn begin_source(&mut self) {
        self.buses = 0;
        if let Some(orders) = &self.orders {
            let _ = orders.send(Order::NextSource);
        }
    }

    /// What it has to say now.
    pub fn told(&mut self) -> Option<Told> {
        self.told.try_recv().ok()
    }

    /// Nothing comes any more: the rest of what it has to say, and what it has seen.
    pub fn finish(&mut self) -> (Vec<Told>, Option<Watcher>) {
        self.orders = None;
        // A thread that panicked has said so.
        let watcher = self.thread.take().and_then(|thread| thread.join().ok());
        (self.told.try_iter().collect(), watcher)
    }
}

fn watch(mut orders: Orders, mut watcher: Watcher, mut pipeline: Pipeline) -> Watcher {
    while orders.has_more {
        // Errors end a source, and whoever reads it says so.
        let _ = pipeline.pass(&mut orders, &mut watcher);
    }
    pipeline.finish(&mut watcher);
    watcher.pipeline = Some(pipeline);
    watcher
}

/// What is to be decoded, as a source.
struct Orders {
    orders: Receiver<Order>,
    give_back: SyncSender<Outbox>,
    told: Sender<Told>,
    current: Outbox,
    reach: Moment,
    has_more: bool,
}

impl Source for Orders {
    fn next_piece(&mut self) -> Result<Option<Piece<'_>>, SourceError> {
        while self.current.is_empty() {
            if self.reach.is_known() {
                // Nobody listens where the recording has ended.
                let _ = self.told.send(Told::Decoded(self.reach));
            }
            match self.orders.recv() {
                Ok(Order::Heard(next, reach)) => {
                    let used = std::mem::replace(&mut self.current, next);
                    self.reach = reach;
                    // Nobody needs it where there are enough.
                    let _ = self.give_back.try_send(used);
                }
                Ok(Order::NextSource) => return Ok(None),
                Err(_) => {
                    self.has_more = false;
                    return Ok(None);
                }
            }
        }
        self.current.next().transpose()
    }
}

impl Sink for Watcher {
    fn record(&mut self, record: &Record<'_>) {
        self.clock.begin(record.start);
        self.tally.record(record);
        let is_event = |finding: &Finding| self.triggers.iter().any(|one| one.holds(finding));
        if record.findings.iter().any(is_event) {
            let _ = self.told.send(Told::Event(record.start));
        }
    }
}

impl Consumer for Watcher {
    fn goes_on(&mut self) -> bool {
        true
    }

    fn comment(&mut self, _: &BusInfo, _: Moment, _: &str) {}

    fn warn(&mut self, warning: &SourceError) {
        self.tally.unread += warning.left_out;
    }

    fn note(&mut self, _: &str) {}

    fn end(&mut self, _: &BusInfo, _: Moment) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use dissectors::protocol::codes;

    #[test]
    fn a_trigger_is_a_code_or_a_severity() {
        assert_eq!("error".parse(), Ok(Trigger::Severity(Severity::Error)));
        let parity = codes().find(|code| code.name == "slin.parity").unwrap();
        assert_eq!("slin.parity".parse(), Ok(Trigger::Code(parity)));
        assert_eq!("parity".parse(), Ok(Trigger::Code(parity)));
        // A severity, though there is an encoder.warning.
        assert_eq!("warning".parse(), Ok(Trigger::Severity(Severity::Warning)));
        let several = "position-jump".parse::<Trigger>().unwrap_err();
        assert!(several.contains("slin.position-jump or interbus.position-jump"), "{several}");
        assert!("slin.nonsense".parse::<Trigger>().is_err_and(|what| what.contains("explain")));
    }

    #[test]
    fn what_can_never_come_is_known_beforehand() {
        let obstacle = |trigger: &str, protocol: &str, medium| {
            trigger.parse::<Trigger>().unwrap().obstacle(Protocol::named(protocol), medium)
        };
        for (trigger, protocol, medium) in [
            ("slin.parity", "slin", None),
            ("slin.parity", "auto", Some(Medium::Serial)),
            ("uart.framing", "slin", Some(Medium::Serial)),
            ("encoder.alarm", "devicenet", Some(Medium::Can)),
            ("can.error-frame", "devicenet", None),
            ("error", "slin", Some(Medium::Can)),
        ] {
            assert_eq!(obstacle(trigger, protocol, medium), None);
        }
        for (trigger, protocol, medium, why) in [
            ("encoder.alarm", "slin", None, "a finding of devicenet"),
            ("slin.parity", "uart", None, "--protocol uart"),
            ("slin.parity", "auto", Some(Medium::Can), "hears CAN frames"),
            ("interbus.crc", "auto", None, "rings are not recorded"),
        ] {
            let told = obstacle(trigger, protocol, medium);
            assert!(told.as_ref().is_some_and(|told| told.contains(why)), "{trigger}: {told:?}");
        }
    }

    #[test]
    fn the_end_of_a_state_is_no_event() {
        let alarm = codes().find(|code| code.name == "encoder.alarm").unwrap();
        let (begin, end) = (Finding::new(alarm).state(State::Begin), State::End(None));
        let end = Finding::new(alarm).state(end);
        for trigger in ["encoder.alarm", "error", "warning", "info"] {
            let trigger: Trigger = trigger.parse().unwrap();
            assert!(trigger.holds(&begin) && !trigger.holds(&end));
        }
        let written = codes().find(|code| code.name == "encoder.written").unwrap();
        assert!("encoder.written".parse::<Trigger>().unwrap().holds(&Finding::new(written)));
        assert!(!"warning".parse::<Trigger>().unwrap().holds(&Finding::new(written)));
    }
}
