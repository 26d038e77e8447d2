//! The data of I/O connections: fragments, sizes, idle masters, and the time since the last.

use super::codes;
use super::connection::{Connection, Direction, Flow, Habit, Instance, State as Stands};
use super::defect::Defect;
use super::eds::Eds;
use super::fragment::{Key, Step};
use super::identifier::MacId;
use super::layer::{Assumed, Bytes, Facts};
use super::ledger::{Judgement, Ledger, Now};
use super::members::{carried, default, formats};
use super::message::{Fragment, Part};
use super::timing::Verdict;
use crate::event::Moment;
use crate::finding::{Finding, State};

/// Most bytes of a message that is not fragmented.
const MAX_FRAME: u16 = 8;

/// Complete messages after which it is believed that I/O is fragmented where no size says so.
const BELIEVED: u8 = 3;

/// Longest time between fragments, where no size says that they are some, in ns: a sender has
/// them ready and sends them as fast as the bus lets it.
const FRAGMENT_GAP_NS: i64 = 10_000_000;

/// Which data: whose, on which connection, and from where to where.
pub(super) type At = (MacId, Instance, Direction);

/// What a frame is of an I/O message.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Piece {
    /// All of it: so many bytes.
    Whole(usize),
    /// Its first fragment.
    First,
    /// A fragment in the middle.
    Middle,
    /// Its last fragment: so many bytes in all.
    Last(usize),
    /// A fragment of a message that is not put together.
    Nothing,
}

impl Piece {
    /// Whether a message begins with it.
    pub const fn begins(self) -> bool {
        matches!(self, Piece::Whole(_) | Piece::First)
    }

    /// The length of the message that it completes.
    pub const fn length(self) -> Option<usize> {
        match self {
            Piece::Whole(length) | Piece::Last(length) => Some(length),
            _ => None,
        }
    }
}

impl Ledger {
    /// The assembly that a connection carries, where its path was read or written.
    pub fn assembly_of(&self, (slave, instance, direction): At) -> Option<u16> {
        let connection = &self.nodes[slave.index()].connections[instance.index()];
        match direction {
            Direction::Produced => connection.produced.assembly,
            Direction::Consumed => connection.consumed.assembly,
        }
    }

    /// Judges the size of a message by the maker's description, where the capture did not show the
    /// connection's own. Files list several formats, and which of them is used is set up elsewhere:
    /// only data that fits none is wrong. Where any goes in fragments, so may the frame.
    pub fn judge_by_description(&mut self, now: &Now<'_>, facts: &mut Facts, eds: &Eds) {
        let Some((slave, instance, direction, mode)) = carried(facts) else { return };
        let Some(at) = facts.io.filter(|_| !now.frame.is_cut()) else { return };
        let assembly = at.assembly.and_then(|place| self.assemblies.get(place));
        let length = assembly.map_or(now.data.len(), |assembly| assembly.data().len());
        let connection = self.nodes[slave.index()].connection(instance);
        let is_judged = connection.is_judged();
        let flow = connection.flow(direction);
        let mut listed = Listed::default();
        default(eds, direction, mode).into_iter().for_each(|format| listed.take(format.size));
        formats(eds, direction).for_each(|format| listed.take(format.size));
        let may_be_part = assembly.is_none() && listed.largest > MAX_FRAME;
        let Some(usual) = listed.first.filter(|_| is_judged && !may_be_part) else { return };
        if flow.size.is_some() {
            return;
        }
        let is_size = |size: u16| usize::from(size) == length;
        let fits = formats(eds, direction).any(|format| is_size(format.size))
            || eds.assemblies().any(|assembly| assembly.size.is_some_and(is_size));
        if fits {
            if let Some((_, since)) = flow.wrong.take() {
                self.judgement.end(&codes::SIZE_MISMATCH, since, now.mark.start);
            }
        } else if flow.wrong.is_none_or(|(other, _)| other != length) {
            flow.wrong = Some((length, now.mark.start));
            facts.assumed.add(Assumed::SIZE);
            let finding = Finding::new(&codes::SIZE_MISMATCH).state(State::Begin);
            self.judgement.find(finding.expected(i64::from(usual)).actual(length as i64));
        }
    }

    /// Shows the data of a frame that is a whole message.
    pub fn show(&self, now: &Now<'_>, facts: &mut Facts) {
        facts.io = (!now.data.is_empty()).then_some(Bytes { assembly: None, start: 0 });
    }

    fn flow_of(&mut self, (slave, instance, direction): At) -> &mut Flow {
        self.node(slave).connection(instance).flow(direction)
    }

    /// Finds out what a frame is of its message. Nothing in it says that it is a fragment: the
    /// size of the connection does or, where that was not read, frames that follow each other
    /// like fragments. `may_go_on`: this frame belongs to the same cycle as the one before.
    pub fn piece(&mut self, now: &Now<'_>, at: At, may_go_on: bool, facts: &mut Facts) -> Piece {
        let may_go_on = may_go_on && self.follows(now, at);
        let flow = self.flow_of(at);
        let is_known = flow.size.is_some_and(|size| size > MAX_FRAME);
        let is_guessed = flow.size.is_none() && flow.habit.messages > 0;
        if now.data.is_empty() || !(is_known || is_guessed) {
            let candidate = flow.habit.candidate.take().filter(|_| may_go_on);
            if flow.size.is_none() && !now.data.is_empty() {
                if candidate.is_some_and(|_| continues(now.data)) {
                    return self.discover(now, at, candidate, facts);
                }
                self.flow_of(at).habit.candidate = begins(now.data).map(|data| (now.mark.n, data));
            }
            self.show(now, facts);
            return Piece::Whole(now.data.len());
        }
        if is_guessed {
            facts.assumed.add(Assumed::SIZE);
        }
        self.put_together(now, at, facts)
    }

    /// Whether the frame comes so soon after the one before, and before the next is due, that both
    /// may be of one message.
    fn follows(&mut self, now: &Now<'_>, (slave, instance, direction): At) -> bool {
        let connection = self.node(slave).connection(instance);
        let limit = connection.rate_ns().map_or(FRAGMENT_GAP_NS, |rate| rate.min(FRAGMENT_GAP_NS));
        let last = connection.flow(direction).last;
        last.and_then(|last| now.mark.start.since(last.start)).is_some_and(|gap| gap <= limit)
    }

    /// The frame before this one was a first fragment, as this one tells.
    fn discover(
        &mut self,
        now: &Now<'_>,
        at: At,
        candidate: Option<(u64, [u8; 8])>,
        facts: &mut Facts,
    ) -> Piece {
        let Some((n, [_, first @ ..])) = candidate else { return Piece::Nothing };
        self.flow_of(at).habit.messages = 1;
        facts.assumed.add(Assumed::SIZE);
        let place = self.assemblies.of(Key::io(now.id));
        if let Some(assembly) = self.assemblies.get_mut(place) {
            assembly.reset();
            assembly.take((Fragment { part: Part::First, count: 0 }, &first), n, true, false);
        }
        self.put_together(now, at, facts)
    }

    fn put_together(&mut self, now: &Now<'_>, at: At, facts: &mut Facts) -> Piece {
        let Some((byte, data)) = now.data.split_first() else { return Piece::Whole(0) };
        let fragment = Fragment::of(*byte);
        let was_heard = self.flow_of(at).last.is_some();
        let place = self.assemblies.of(Key::io(now.id));
        let Some(assembly) = self.assemblies.get_mut(place) else { return Piece::Nothing };
        facts.fragment = Some(fragment);
        if fragment.part == Part::Acknowledge {
            assembly.give_up();
            if self.is_certain(at) {
                facts.blame(Some(Defect::ReservedValue));
            } else {
                return self.disbelieve(now, at, facts);
            }
            return Piece::Nothing;
        }
        match assembly.take((fragment, data), now.mark.n, was_heard, false) {
            Step::Begins => Piece::First,
            Step::Continues => Piece::Middle,
            Step::Completes => {
                let length = assembly.data().len();
                facts.completes = Some(place);
                facts.io = Some(Bytes { assembly: Some(place), start: 0 });
                let habit = &mut self.flow_of(at).habit;
                habit.messages = habit.messages.saturating_add(1);
                if fragment.part == Part::First {
                    Piece::Whole(length)
                } else {
                    Piece::Last(length)
                }
            }
            Step::Unseen => {
                if let (Part::Last, Some(assembly)) =
                    (fragment.part, self.assemblies.get_mut(place))
                {
                    assembly.reset();
                }
                facts.assumed.add(Assumed::START);
                Piece::Nothing
            }
            Step::BeginsAnew { expected } | Step::OutOfSequence { expected } => {
                if !self.is_certain(at) {
                    return self.disbelieve(now, at, facts);
                }
                let finding = Finding::new(&codes::FRAGMENT_SEQUENCE);
                let finding = finding.expected(i64::from(expected)).actual(i64::from(*byte));
                self.judgement.find(finding);
                if fragment.part == Part::First { Piece::First } else { Piece::Nothing }
            }
            Step::TooLong => {
                facts.blame(Some(Defect::TooLong));
                Piece::Nothing
            }
            Step::Repeats | Step::Ignored => Piece::Nothing,
        }
    }

    /// Whether the connection's size, or its habit, leaves no doubt that it is fragmented.
    fn is_certain(&mut self, at: At) -> bool {
        let flow = self.flow_of(at);
        flow.size.is_some() || flow.habit.messages > BELIEVED
    }

    /// It only looked like fragments.
    fn disbelieve(&mut self, now: &Now<'_>, at: At, facts: &mut Facts) -> Piece {
        self.flow_of(at).habit = Habit::default();
        facts.fragment = None;
        self.show(now, facts);
        Piece::Whole(now.data.len())
    }

    /// Takes note of a message: its size, whether it is empty, and that it came.
    pub fn flow(&mut self, now: &Now<'_>, at: At, piece: Piece) {
        let (slave, instance, direction) = at;
        let Ledger { nodes, judgement, timing, .. } = self;
        let connection = nodes[slave.index()].connection(instance);
        if let Some(length) = piece.length() {
            judge_idle(connection.flow(direction), length, now.mark.start, judgement);
            judge_size(connection, direction, length, now.mark.start, judgement);
        }
        if !piece.begins() {
            return;
        }
        let limit = connection.limit().filter(|_| connection.state == Stands::Established);
        let is_timed = is_timed(instance, direction);
        let flow = connection.flow(direction);
        let before = flow.last.replace(now.mark);
        let Some(limit) = limit.filter(|_| is_timed) else { return };
        if let Some(before) = before
            && let Some(gap) = now.mark.start.since(before.start)
        {
            let uncertainty = i64::from(before.uncertainty) + i64::from(now.mark.uncertainty);
            if timing.above(gap, limit, uncertainty) == Verdict::Withheld {
                judgement.judge(Verdict::Withheld, Finding::new(&codes::CONNECTION_TIMEOUT));
            }
        }
        self.wait(Some(slave), now.mark.start.plus(limit));
    }
}

/// Sizes that a maker lists; 0 is none.
#[derive(Clone, Copy, Default)]
struct Listed {
    first: Option<u16>,
    largest: u16,
}

impl Listed {
    fn take(&mut self, size: u16) {
        self.first = self.first.or((size > 0).then_some(size));
        self.largest = self.largest.max(size);
    }
}

/// Whether a connection times out for want of data in that direction. Acknowledgements of
/// change-of-state messages have a timer of their own.
pub(super) const fn is_timed(instance: Instance, direction: Direction) -> bool {
    match instance {
        Instance::Poll | Instance::Strobe | Instance::Multicast => true,
        Instance::Production => matches!(direction, Direction::Produced),
        // Whoever sends: requests and answers keep it alive.
        Instance::Explicit => matches!(direction, Direction::Consumed),
    }
}

/// A first fragment is a full frame with count 0.
fn begins(data: &[u8]) -> Option<[u8; 8]> {
    <[u8; 8]>::try_from(data).ok().filter(|data| data[0] == 0)
}

/// The second fragment: a full frame in the middle, or the last.
fn continues(data: &[u8]) -> bool {
    matches!(data, [0x41, ..] if data.len() == 8) || matches!(data, [0x81, _, ..])
}

/// An empty message where others carry data: the master is idle, or the slave has nothing to
/// tell.
fn judge_idle(flow: &mut Flow, length: usize, now: Moment, judgement: &mut Judgement) {
    let carries = flow.has_data || flow.size.is_some_and(|size| size > 0);
    if length > 0 {
        flow.has_data = true;
        if let Some(since) = flow.idle.take() {
            judgement.end(&codes::IDLE, since, now);
        }
    } else if carries && flow.idle.is_none() {
        flow.idle = Some(now);
        judgement.find(Finding::new(&codes::IDLE).state(State::Begin));
    }
}

fn judge_size(
    connection: &mut Connection,
    direction: Direction,
    length: usize,
    now: Moment,
    judgement: &mut Judgement,
) {
    let is_judged = connection.is_judged();
    let flow = connection.flow(direction);
    let Some(size) = flow.size.filter(|_| is_judged && length > 0) else { return };
    let wrong = flow.wrong;
    if length == usize::from(size) {
        if let Some((_, since)) = flow.wrong.take() {
            judgement.end(&codes::SIZE_MISMATCH, since, now);
        }
    } else if wrong.is_none_or(|(other, _)| other != length) {
        flow.wrong = Some((length, now));
        let finding = Finding::new(&codes::SIZE_MISMATCH).state(State::Begin);
        judgement.find(finding.expected(i64::from(size)).actual(length as i64));
    }
}
