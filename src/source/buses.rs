//! The buses of a source that names them one by one, as their traffic appears.

use super::outbox::Outbox;
use super::selection::Selection;
use super::{SourceError, SourceOptions};
use dissectors::bus::WireFacts;
use dissectors::protocol::Medium;
use dissectors::record::BusInfo;
use dissectors::uart::Baud;

/// Most buses that are believed.
const MOST: usize = 1024;

/// What is said of a source with more.
const TOO_MANY: &str =
    "more than 1024 interfaces, which is as many as fieldtap follows: divide the capture";

/// The buses that appeared so far, and which of them the user asked for.
pub struct Buses {
    selection: Selection,
    known: Vec<Known>,
    announced: usize,
}

struct Known {
    info: BusInfo,
    medium: Medium,
    /// The bit rate that was told last.
    bitrate: Option<Baud>,
    /// `None` where the user did not ask for it.
    number: Option<usize>,
}

impl Buses {
    /// None appeared yet.
    pub fn new(options: &SourceOptions) -> Self {
        Buses { selection: Selection::new(options), known: Vec::new(), announced: 0 }
    }

    /// What the user says about the source.
    pub fn options(&self) -> &SourceOptions {
        self.selection.options()
    }

    /// The number of a bus, which appears if it is new; `None` if the user did not ask for it. One
    /// that is told anew, with other marks of parity, is the same: a recording does that where single
    /// characters are known better or worse.
    ///
    /// # Errors
    /// There are more than anybody has.
    pub fn number(
        &mut self,
        info: BusInfo,
        medium: Medium,
        facts: WireFacts,
        out: &mut Outbox,
    ) -> Result<Option<usize>, &'static str> {
        let is_it = |known: &&Known| {
            known.info.name == info.name && known.info.clock == info.clock && known.medium == medium
        };
        if let Some(known) = self.known.iter().find(is_it) {
            return Ok(known.number);
        }
        if self.known.len() >= MOST {
            return Err(TOO_MANY);
        }
        let number = self.selection.takes(&info.name).then_some(self.announced);
        if number.is_some() {
            self.announced += 1;
            out.bus(info.clone(), WireFacts { medium: Some(medium), ..facts });
        }
        self.known.push(Known { info, medium, bitrate: facts.baud, number });
        Ok(number)
    }

    /// What is heard next on a bus of this number came at this bit rate.
    pub fn hear_at(&mut self, bus: usize, bitrate: Option<Baud>, out: &mut Outbox) {
        let known = self.known.iter_mut().find(|known| known.number == Some(bus));
        if let Some(known) = known.filter(|known| known.bitrate != bitrate) {
            known.bitrate = bitrate;
            out.bitrate(bus, bitrate);
        }
    }

    /// Whether every bus that was asked for was there. To be asked at the end of the source.
    ///
    /// # Errors
    /// One was not.
    pub fn check(&self, source: &str) -> Result<(), SourceError> {
        self.selection.check(source)
    }
}
