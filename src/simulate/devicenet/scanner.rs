//! The scanner: a master with a scan list, which brings its slaves to work, scans them, and asks
//! them this and that in between. What it does with one slave is in [`super::link`].

use super::agenda::Agenda;
use super::air::{About, Air, Node, Note};
use super::encoder::mac_check;
use super::explicit::ALLOCATE;
use super::fault::Fault;
use super::frame::{Frame, id};
use super::link::Link;
use super::plan::{Mode, Plan};
use crate::simulate::chance::Chance;
use crate::simulate::time::{Clock, MS, Ps, S, US};

/// Streams of the seed.
const SCANNER: u64 = 0;
const SCANNERS_CLOCK: u64 = 1;

/// The scanner's vendor: 1 is Rockwell's, whose start-up is imitated.
const VENDOR: u16 = 1;
const SERIAL: u32 = 0x6060_3992;

/// What the scanner has to do. Slaves are told by their place in the scan list.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Task {
    /// Send the duplicate MAC ID check for the first or second time.
    Check(u8),
    /// Go on line and begin with the slaves.
    GoOnline,
    /// Try an open at the slave's message manager, for the first or second time.
    Open(usize, u8),
    /// Allocate the slave's explicit connection.
    Allocate(usize),
    /// Ask it the next that is to be asked.
    Ask(usize),
    /// It did not answer.
    Unanswered(usize),
    /// It did not acknowledge a fragment.
    RepeatFragment(usize),
    /// Connect its I/O anew.
    Reconnect(usize),
    /// Send polls and strobes.
    Scan,
    /// Ask somebody something.
    Errand,
}

/// The scanner.
pub struct Scanner {
    pub(super) plan: Plan,
    clock: Clock,
    pub(super) chance: Chance,
    pub(super) agenda: Agenda<Task>,
    pub(super) links: Vec<Link>,
    is_online: bool,
    checks: u8,
    /// Whose turn it is to be asked something.
    turn: usize,
    /// Slaves whose answers are still to come in this scan.
    awaited: u32,
    scanned_at: Ps,
}

impl Scanner {
    /// A scanner that is switched on now or a little later.
    pub fn new(plan: &Plan) -> Self {
        let mut chance = Chance::new(plan.seed, SCANNER);
        let mut agenda = Agenda::new();
        agenda.add(chance.between(MS, 100 * MS), Task::Check(0));
        Scanner {
            clock: plan.some_clock(&mut Chance::new(plan.seed, SCANNERS_CLOCK)),
            links: plan.stations.iter().map(|station| Link::new(*station)).collect(),
            plan: plan.clone(),
            chance,
            agenda,
            is_online: false,
            checks: 0,
            turn: 0,
            awaited: 0,
            scanned_at: 0,
        }
    }

    pub(super) fn some(&mut self, least: Ps, most: Ps) -> Ps {
        self.chance.between(least, most)
    }

    /// A frame of its own to a slave.
    pub(super) fn note(&self, kind: &'static str, link: usize) -> Note {
        let slave = self.links[link].mac();
        Note::new(kind, self.plan.master, Some(slave), slave)
    }

    fn check(&mut self, number: u8, now: Ps, air: &mut Air) {
        self.checks = number;
        let master = self.plan.master;
        let note = Note::new("dup-mac-request", master, None, master);
        air.send(now, mac_check(master, 0, VENDOR, SERIAL), note);
    }

    fn go_online(&mut self, now: Ps) {
        self.is_online = true;
        for link in 0..self.links.len() {
            let soon = self.some(2 * MS, 40 * MS);
            self.agenda.add(now + soon, Task::Open(link, 0));
        }
        self.agenda.add(now + S, Task::Scan);
        let soon = self.some(0, self.plan.errands);
        self.agenda.add(now + 3 * S + soon, Task::Errand);
    }

    /// An open of the message manager, body format 16/16, group 3, source message id 4. A Group 2
    /// only server does not answer it.
    fn open(&mut self, link: usize, number: u8, now: Ps, air: &mut Air) {
        let frame = Frame::new(
            id::ucmm_request(self.plan.master),
            &[self.links[link].mac(), ALLOCATE, 2, 0x34],
        );
        let about = About { service: ALLOCATE, object: None, attribute: None };
        air.send(now, frame, Note { about: Some(about), ..self.note("ucmm-request", link) });
        let second = S + self.some(0, 4 * MS);
        let next = if number == 0 { Task::Open(link, 1) } else { Task::Allocate(link) };
        self.agenda.set(now + second, next);
    }

    /// Sends poll and strobe commands to those at work.
    fn scan(&mut self, now: Ps, air: &mut Air) {
        self.scanned_at = now;
        self.awaited = 0;
        let mut strobed = [0_u8; 8];
        for link in 0..self.links.len() {
            if !self.links[link].is_scanned(now) {
                continue;
            }
            let slave = self.links[link].mac();
            match self.links[link].station.mode {
                Mode::Poll => {
                    self.awaited += 1;
                    let frame = Frame::new(id::poll_command(slave), &[]);
                    air.send(now, frame, self.note("poll-command", link));
                }
                Mode::Strobe => {
                    self.awaited += 1;
                    strobed[usize::from(slave / 8)] |= 1 << (slave % 8);
                }
                Mode::Cos | Mode::Cyclic => {}
            }
        }
        if strobed != [0; 8] {
            let master = self.plan.master;
            let note = Note::new("strobe-command", master, None, master);
            let frame = Frame::new(id::strobe_command(master), &strobed);
            air.send(now, frame, Note { station: None, ..note });
        }
        let period = self.period();
        self.agenda.set(now + period, Task::Scan);
    }

    /// To the next scan, unless all answers are there before.
    fn period(&mut self) -> Ps {
        if self.plan.scan == 0 {
            return 10 * MS;
        }
        let jitter = self.plan.scan / 20;
        self.plan.scan + self.some(-jitter, jitter)
    }

    /// An answer is there. Who is in a hurry begins anew with the last.
    fn hear_io(&mut self, link: usize, data: &[u8], now: Ps) {
        self.links[link].hear_io(data, now);
        self.awaited = self.awaited.saturating_sub(1);
        if self.plan.scan == 0 && self.awaited == 0 {
            let soon = self.some(20 * US, 100 * US);
            self.agenda.set(now + soon, Task::Scan);
        }
    }

    fn hear_production(&mut self, link: usize, data: &[u8], now: Ps, air: &mut Air) {
        self.links[link].hear_io(data, now);
        let slave = self.links[link].mac();
        if !self.links[link].is_allocated {
            return;
        }
        let acknowledges = if self.plan.is_acknowledged {
            !air.fate.strikes(Fault::IoUnacknowledged, slave, now)
        } else {
            air.fate.strikes(Fault::UnexpectedAck, slave, now)
        };
        if acknowledges {
            let ready = now + self.some(100 * US, MS);
            air.send(ready, Frame::new(id::acknowledge(slave), &[]), self.note("io-ack", link));
        }
    }

    /// Asks a slave something, in turn; a fault may decide what.
    fn run_errand(&mut self, now: Ps, air: &mut Air) {
        let pause = self.plan.errands;
        let next = self.some(pause * 3 / 4, pause * 5 / 4);
        self.agenda.set(now + next, Task::Errand);
        self.turn = (self.turn + 1) % self.links.len();
        let turn = self.turn;
        if self.links[turn].is_idle() && self.links[turn].is_working {
            self.give_errand(turn, now, air);
            self.agenda.set(now, Task::Ask(turn));
        }
    }

    /// Brings a slave to work, from the beginning.
    pub(super) fn begin_anew(&mut self, link: usize, has_restarted: bool, at: Ps) {
        self.links[link].forget(has_restarted);
        for task in [Task::Open(link, 1), Task::Allocate(link), Task::Ask(link)] {
            self.agenda.cancel(task);
        }
        for task in [Task::Unanswered(link), Task::RepeatFragment(link), Task::Reconnect(link)] {
            self.agenda.cancel(task);
        }
        self.agenda.set(at, Task::Open(link, 0));
    }

    /// Gives up slaves of which nothing was heard for four packet rates.
    fn watch(&mut self, now: Ps) {
        let patience = (4 * Ps::from(self.plan.packet_rate) * MS).max(300 * MS);
        for link in 0..self.links.len() {
            if self.links[link].is_lost(now, patience) {
                self.begin_anew(link, false, now + S);
            }
        }
    }

    fn hear_check(&mut self, link: usize, data: &[u8], now: Ps) {
        let is_request = data.first().is_some_and(|byte| byte & 0x80 == 0);
        let serial = data.get(3..7).map(<[u8]>::to_vec);
        if !is_request || serial.is_none() {
            return;
        }
        let known =
            self.links[link].serial.get_or_insert_with(|| serial.clone().unwrap_or_default());
        // It restarts: it is online two seconds after its first check.
        if Some(&*known) == serial.as_ref() && self.is_online {
            let soon = self.some(1_500 * MS, 2_500 * MS);
            self.begin_anew(link, true, now + soon);
        }
    }
}

impl Node for Scanner {
    fn next(&self) -> Ps {
        self.agenda.next()
    }

    fn wake(&mut self, now: Ps, air: &mut Air) {
        while let Some(task) = self.agenda.due(now) {
            match task {
                Task::Check(number) => self.check(number, now, air),
                Task::GoOnline => self.go_online(now),
                Task::Open(link, number) => self.open(link, number, now, air),
                Task::Allocate(link) => self.allocate(link, now, air),
                Task::Ask(link) => self.ask(link, now, air),
                Task::Unanswered(link) => self.give_up(link, now),
                Task::RepeatFragment(link) => self.repeat_fragment(link, now, air),
                Task::Reconnect(link) => self.reconnect(link, now),
                Task::Scan => {
                    self.watch(now);
                    self.scan(now, air);
                }
                Task::Errand => self.run_errand(now, air),
            }
        }
        if self.links.iter().all(|link| link.is_working) {
            air.fate.all_at_work(now);
        }
    }

    fn hear(&mut self, frame: &Frame, now: Ps, air: &mut Air) {
        let Some(id) = frame.devicenet_id() else { return };
        for link in 0..self.links.len() {
            let slave = self.links[link].mac();
            if id == id::poll_response(slave) || id == id::strobe_response(slave) {
                self.hear_io(link, frame.bytes(), now);
            } else if id == id::production(slave) {
                self.hear_production(link, frame.bytes(), now, air);
            } else if id == id::response(slave) {
                self.hear_response(link, frame.bytes(), now, air);
            } else if id == id::mac_check(slave) {
                self.hear_check(link, frame.bytes(), now);
            }
        }
    }

    fn sent(&mut self, frame: &Frame, now: Ps, _: &mut Air) {
        let Some(id) = frame.devicenet_id() else { return };
        if id == id::mac_check(self.plan.master) && !self.is_online {
            let next = if self.checks == 0 { Task::Check(1) } else { Task::GoOnline };
            let second = S + self.some(0, 3 * MS);
            self.agenda.set(now + second, next);
        }
        let asked = |link: &Link| id == id::request(link.mac());
        if let Some(link) = self.links.iter().position(asked) {
            self.sent_request(link, now);
        }
    }

    fn clock(&self) -> Clock {
        self.clock
    }
}
