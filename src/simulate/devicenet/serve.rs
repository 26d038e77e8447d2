//! How an encoder answers explicit messages: allocation, and the services of its objects.

use super::air::{About, Air, Note};
use super::encoder::{Encoder, Task};
use super::explicit::{
    ALLOCATE, Arrival, GET, Outgoing, PATIENCE, Piece, RELEASE, RESPONSE, SET, TOO_MUCH,
    acknowledge, error,
};
use super::fault::Fault;
use super::frame::id;
use super::object::{Answer, status};
use crate::simulate::time::{MS, Ps, US};

/// Errors of allocation (spoken by a slave that passed the conformance test): general status and
/// additional code.
mod refusal {
    /// Another master has it.
    pub const OWNED: (u8, u8) = (0x0C, 0x01);
    /// The choice asks for nothing, or for what excludes each other.
    pub const INVALID: (u8, u8) = (0x09, 0x02);
    /// It is allocated, or was not.
    pub const STATE: (u8, u8) = (0x0B, 0x02);
    /// The port does nothing else.
    pub const PORT: (u8, u8) = (0x02, 0x03);
}

/// No additional code.
const NONE: u8 = 0xFF;

impl Encoder {
    /// A request to the Group 2 only unconnected port. Its body format is always 8/8.
    pub(super) fn hear_unconnected(&mut self, data: &[u8], now: Ps, air: &mut Air) {
        let [header, body @ ..] = data else { return };
        let answer = match body {
            [ALLOCATE | RELEASE, 3, 1, ..] => self.allocation(header & 0x3F, body, now),
            _ => Err(refusal::PORT),
        };
        let body = answer.unwrap_or_else(|(general, additional)| error(general, additional));
        let ready = now + self.some(MS, 4 * MS);
        let note = self.response_note("unconnected-response", header & 0x3F, data);
        let message = Outgoing::new(id::response(self.mac()), *header, body);
        air.send(ready, message.frame(), note);
    }

    /// Allocate or Release, by whichever way it came.
    fn allocation(&mut self, master: u8, body: &[u8], now: Ps) -> Result<Vec<u8>, (u8, u8)> {
        let [service, _, _, choice, rest @ ..] = body else { return Err(refusal::INVALID) };
        if self.owner.is_some_and(|owner| owner != master) {
            return Err(refusal::OWNED);
        }
        if *service == RELEASE {
            return self.release(*choice);
        }
        if rest.first().is_some_and(|allocator| allocator & 0x3F != master) {
            return Err(refusal::INVALID);
        }
        self.allocate(*choice, master, now)
    }

    fn allocate(&mut self, choice: u8, master: u8, now: Ps) -> Result<Vec<u8>, (u8, u8)> {
        let has_explicit = self.owner.is_some() || choice & 0x01 != 0;
        let is_suppressed = choice & 0x40 != 0;
        let is_produced = choice & 0x30 != 0;
        let is_invalid = choice & 0x3F == 0
            || choice & 0x88 != 0
            || choice & 0x30 == 0x30
            || is_suppressed && !is_produced
            || !has_explicit;
        if is_invalid {
            return Err(refusal::INVALID);
        }
        let wanted = |instance: u8| match instance {
            1 => choice & 0x01 != 0,
            2 => choice & 0x02 != 0,
            3 => choice & 0x04 != 0,
            _ => is_produced,
        };
        let is_taken = |instance: u8| {
            let state = self.connections[usize::from(instance) - 1].state;
            wanted(instance) && state != super::connection::State::Nonexistent
        };
        if (1..=4).any(is_taken) {
            return Err(refusal::STATE);
        }
        self.owner = Some(master);
        self.production.is_cyclic = choice & 0x20 != 0;
        for instance in (1..=4).filter(|instance| wanted(*instance)) {
            if let Some(connection) = self.connection(instance) {
                connection.allocate(master, !is_suppressed, now);
            }
        }
        // The body format of explicit messages: 8/8.
        Ok(vec![ALLOCATE | RESPONSE, 0])
    }

    fn release(&mut self, choice: u8) -> Result<Vec<u8>, (u8, u8)> {
        if choice & 0x3F == 0 {
            return Err(refusal::INVALID);
        }
        let released = [(1, 0x01), (2, 0x02), (3, 0x04), (4, 0x30)];
        for (instance, bits) in released {
            if choice & bits == 0 {
                continue;
            }
            if instance == 4 {
                self.production.stop();
                self.agenda.cancel(Task::Look);
            }
            if let Some(connection) = self.connection(instance) {
                connection.release();
            }
        }
        let is_free = |connection: &super::connection::Connection| {
            connection.state == super::connection::State::Nonexistent
        };
        if self.connections.iter().all(is_free) {
            self.owner = None;
        }
        Ok(vec![RELEASE | RESPONSE])
    }

    /// A frame of the explicit connection, which belongs to the owner.
    pub(super) fn hear_explicit(&mut self, data: &[u8], now: Ps, air: &mut Air) {
        let other = data.first().map(|header| header & 0x3F);
        let [explicit, ..] = &mut self.connections;
        if self.owner != other || !explicit.is_established() {
            return;
        }
        explicit.hear(now);
        let is_fragment = data[0] & 0x80 != 0;
        let is_data = is_fragment && data.get(1).is_some_and(|kind| kind & 0xC0 != 0xC0);
        if is_data && self.is_deaf_to(data, now, air) {
            return;
        }
        match self.incoming.take(data) {
            Arrival::Message(header, body) => self.serve(header, &body, now, air),
            Arrival::Fragment(count, body) => {
                self.acknowledge_fragment(data[0], count, 0, now, air);
                if let Some(body) = body {
                    self.serve(data[0] & 0x7F, &body, now, air);
                }
            }
            Arrival::Acknowledge(count, status) => self.hear_fragment(count, status, now, air),
            Arrival::Nothing => {}
        }
    }

    /// Whether this fragment is not heard, or refused.
    fn is_deaf_to(&mut self, data: &[u8], now: Ps, air: &mut Air) -> bool {
        let mac = self.mac();
        if self.deaf > 0 {
            self.deaf -= 1;
            return true;
        }
        if air.fate.strikes(Fault::FragmentRetry, mac, now) {
            return true;
        }
        if air.fate.strikes(Fault::FragmentUnacknowledged, mac, now) {
            self.deaf = 1;
            return true;
        }
        let is_refused = air.fate.strikes(Fault::FragmentRejected, mac, now);
        if is_refused {
            self.incoming.reset();
            self.acknowledge_fragment(data[0], data[1] & 0x3F, TOO_MUCH, now, air);
        }
        is_refused
    }

    fn acknowledge_fragment(&mut self, header: u8, count: u8, status: u8, now: Ps, air: &mut Air) {
        let ready = now + self.some(300 * US, 2 * MS);
        let frame = acknowledge(id::response(self.mac()), header & 0x7F, count, status);
        air.send(ready, frame, self.note("explicit-request").piece(Piece::Acknowledge));
    }

    /// The next fragment of an answer, if this one was taken.
    fn hear_fragment(&mut self, count: u8, status: u8, now: Ps, air: &mut Air) {
        let Some((message, _)) = &mut self.outgoing else { return };
        let has_more = if status == 0 { message.advance(count) } else { Some(false) };
        match has_more {
            Some(true) => {
                let ready = now + self.some(300 * US, 2 * MS);
                self.send_fragment(ready, air);
            }
            Some(false) => {
                self.outgoing = None;
                self.agenda.cancel(Task::RepeatFragment);
            }
            None => {}
        }
    }

    fn send_fragment(&mut self, ready: Ps, air: &mut Air) {
        let Some((message, note)) = &self.outgoing else { return };
        let piece = message.piece();
        let is_end = matches!(piece, Piece::Whole | Piece::Last);
        let about = note.about.filter(|_| is_end);
        air.send(ready, message.frame(), Note { piece, about, ..note.clone() });
    }

    /// A fragment of an answer is on its way: it is waited for its acknowledge.
    pub(super) fn sent_fragment(&mut self, now: Ps) {
        if self.outgoing.is_some() {
            self.agenda.set(now + PATIENCE, Task::RepeatFragment);
        }
    }

    /// Nobody acknowledged: once more, and then no more.
    pub(super) fn repeat_fragment(&mut self, now: Ps, air: &mut Air) {
        let Some((message, _)) = &mut self.outgoing else { return };
        if std::mem::replace(&mut message.is_second, true) {
            self.outgoing = None;
        } else {
            self.send_fragment(now, air);
        }
    }

    fn serve(&mut self, header: u8, body: &[u8], now: Ps, air: &mut Air) {
        let mac = self.mac();
        let data = [&[header], body].concat();
        let note = self.response_note("explicit-response", header & 0x3F, &data);
        let answer = self.answer(header & 0x3F, body, now);
        if air.fate.strikes(Fault::NoResponse, mac, now) {
            return;
        }
        let mut ready = now + self.some(MS, 6 * MS);
        if air.fate.strikes(Fault::LateResponse, mac, now) {
            ready = now + self.some(600 * MS, 900 * MS);
        }
        ready = ready.max(self.answered + US);
        self.answered = ready;
        let message = Outgoing::new(id::response(mac), header, answer);
        if message.is_fragmented() {
            self.outgoing = Some((message, note));
            self.send_fragment(ready, air);
            return;
        }
        air.send(ready, message.frame(), note.clone());
        if air.fate.strikes(Fault::UnsolicitedResponse, mac, now) {
            // Right behind it, before the next request, whose answer it might be taken for.
            air.send(ready + 100 * US, message.frame(), note);
        }
    }

    /// The body of the answer to a request.
    fn answer(&mut self, master: u8, body: &[u8], now: Ps) -> Vec<u8> {
        let [service, rest @ ..] = body else { return error(status::TOO_LITTLE, NONE) };
        if let [ALLOCATE | RELEASE, 3, 1, ..] = body {
            let answer = self.allocation(master, body, now);
            return answer.unwrap_or_else(|(general, additional)| error(general, additional));
        }
        let [class, instance, data @ ..] = rest else { return error(status::TOO_LITTLE, NONE) };
        match self.service(*service, *class, *instance, data, now) {
            Ok(data) => [&[service | RESPONSE], &data[..]].concat(),
            Err(general) => error(general, NONE),
        }
    }

    fn service(&mut self, service: u8, class: u8, instance: u8, data: &[u8], now: Ps) -> Answer {
        let disc = self.shaft.position_at(now);
        match (service, class) {
            (GET, 5) => {
                let attribute = *data.first().ok_or(status::TOO_LITTLE)?;
                self.connection(instance).ok_or(status::OBJECT)?.get(attribute)
            }
            (SET, 5) => {
                let [attribute, value @ ..] = data else { return Err(status::TOO_LITTLE) };
                let connection = self.connection(instance).ok_or(status::OBJECT)?;
                let answer = connection.set(*attribute, value, now)?;
                if instance == 4 && *attribute == 9 {
                    self.start_production(now);
                }
                Ok(answer)
            }
            (GET, _) => {
                let attribute = *data.first().ok_or(status::TOO_LITTLE)?;
                self.objects.get(class, instance, attribute, disc)
            }
            (SET, _) => self.objects.set(class, instance, data, disc),
            _ => self.objects.serve(service, class),
        }
    }

    fn response_note(&self, kind: &'static str, master: u8, data: &[u8]) -> Note {
        let about = data.get(1..).and_then(about);
        Note { destination: Some(master), about, ..self.note(kind) }
    }
}

/// What a request is about, from its body.
pub fn about(body: &[u8]) -> Option<About> {
    let [service, rest @ ..] = body else { return None };
    let object = match rest {
        [class, instance, ..] => Some((*class, *instance)),
        _ => None,
    };
    let has_attribute = matches!(*service, GET | SET);
    let attribute = rest.get(2).copied().filter(|_| has_attribute);
    Some(About { service: *service, object, attribute })
}
