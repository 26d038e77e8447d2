//! What goes wrong with an encoder as a whole, or around it.

use super::air::{Air, Note};
use super::encoder::{Encoder, INCIDENTS, Task, mac_check};
use super::explicit::{ALLOCATE, GET};
use super::fault::Fault;
use super::frame::{Frame, Id, id};
use super::serve::about;
use crate::simulate::time::{MS, Ps};

/// A configuration tool that should not be there.
const TOOL: u8 = 62;
/// How long an alarm lasts (manual §8).
const ALARM: Ps = 2_500 * MS;
/// How long the lithium cell is low here: as long as an observer may need to see it.
const WARNING: Ps = 3_000 * MS;

impl Encoder {
    /// See whether something goes wrong now.
    pub(super) fn incident(&mut self, now: Ps, air: &mut Air) {
        self.agenda.set(now + INCIDENTS, Task::Incident);
        let mac = self.mac();
        let cut = air.fate.power_cycles.iter().position(|(of, at)| *of == mac && *at <= now);
        if let Some(cut) = cut {
            air.fate.power_cycles.swap_remove(cut);
            self.lose_power(now, air);
            return;
        }
        if !self.is_at_work() {
            return;
        }
        let kinds = [
            Fault::NodeRestart,
            Fault::Shutdown,
            Fault::DuplicateMac,
            Fault::Alarm,
            Fault::Warning,
            Fault::ForeignFrame,
            Fault::ReservedId,
            Fault::AllocationRefused,
            Fault::AllocationInvalid,
            Fault::Malformed,
        ];
        let has_flags = self.connections[1..].iter().any(|connection| connection.assembly == 2);
        let can = |fault: &Fault| has_flags || !matches!(fault, Fault::Alarm | Fault::Warning);
        let struck = kinds.into_iter().filter(can).find(|fault| air.fate.strikes(*fault, mac, now));
        if let Some(fault) = struck {
            self.suffer(fault, now, air);
        }
    }

    fn suffer(&mut self, fault: Fault, now: Ps, air: &mut Air) {
        let mac = self.mac();
        match fault {
            Fault::NodeRestart => self.lose_power(now, air),
            Fault::Shutdown => {
                self.say_goodbye(now, air);
                air.fate.power_cycles.push((mac, now + 20 * MS));
            }
            Fault::DuplicateMac => {
                // The other one has the next serial number but one, and gives up when it is told.
                let twin = mac_check(mac, 0, self.objects.vendor, self.objects.serial ^ 2);
                air.send_as_stranger(now, twin, Note::new("dup-mac-request", mac, None, mac));
            }
            Fault::Alarm => {
                self.objects.is_alarmed = true;
                self.agenda.set(now + ALARM, Task::Calm);
            }
            Fault::Warning => {
                self.objects.is_warned = true;
                self.agenda.set(now + WARNING, Task::Calm);
            }
            Fault::ForeignFrame => {
                let id = Id::Extended(0x18EB_FF00 | u32::from(mac));
                let frame = if air.fate.chance().happens(0.5) {
                    Frame::of(id, &[1, 0xA0, 0x0F])
                } else {
                    Frame::remote(Id::Standard(id::poll_response(mac)), 4)
                };
                air.send_as_stranger(now, frame, stranger("foreign", mac));
            }
            Fault::ReservedId => {
                let number = air.fate.chance().below(0x2C + 0x10) as u16;
                // 7C0h to 7EBh, and 7F0h to 7FFh.
                let id = if number < 0x2C { 0x7C0 + number } else { 0x7F0 + number - 0x2C };
                air.send_as_stranger(now, Frame::new(id, &[mac]), stranger("reserved", mac));
            }
            Fault::AllocationRefused => self.be_asked_by(TOOL, 0x03, now, air),
            Fault::AllocationInvalid => {
                let choices = [0x00, 0x81, 0x31, 0x41];
                let choice = air.fate.chance().one_of(&choices).unwrap_or(0);
                self.be_asked_by(TOOL, choice, now, air);
            }
            // The unconnected port allocates and releases, and does nothing else.
            Fault::Malformed => self.be_told(&[TOOL, GET, 1, 1, 1], now, air),
            _ => {}
        }
    }

    /// Another master asks for an allocation.
    fn be_asked_by(&mut self, master: u8, choice: u8, now: Ps, air: &mut Air) {
        self.be_told(&[master, ALLOCATE, 3, 1, choice, master], now, air);
    }

    fn be_told(&mut self, data: &[u8], now: Ps, air: &mut Air) {
        let mac = self.mac();
        let frame = Frame::new(id::unconnected(mac), data);
        let note = Note::new("unconnected-request", data[0], Some(mac), mac);
        air.send_as_stranger(now, frame, Note { about: about(&data[1..]), ..note });
    }
}

/// A frame of nobody that DeviceNet knows.
fn stranger(kind: &'static str, mac: u8) -> Note {
    Note { station: None, ..Note::new(kind, mac, None, mac) }
}
