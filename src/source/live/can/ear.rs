//! What a socket hears, and the accounts of what does not reach it.

use super::super::super::can::packet;
use super::super::super::outbox::Outbox;
use super::drops::{InterfaceDrops, Lost, SocketDrops, Statistics};
use super::receiver::Receiver;
use dissectors::can::{ErrorDetail, Frame};
use dissectors::event::{Loss, LossCause, Moment};
use socketcan::SocketOptions;
use std::io;
use std::time::SystemTime;

/// There is but one bus.
pub const BUS: usize = 0;

/// A frame that was stamped this long ago has been queued, in ns: what interrupts and their
/// threads may be late on a busy machine.
const LATENCY_NS: i64 = 20_000_000;

/// Listens with a socket.
pub struct Ear<S> {
    receiver: Receiver<S>,
    socket: SocketDrops,
    interface: InterfaceDrops,
    /// ± of a stamp in ns.
    uncertainty: u32,
    /// Nothing that is queued came before.
    heard_until: Moment,
}

/// The time of the clock that stamps.
pub fn now() -> Moment {
    let since = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
    Moment::from_ns(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
}

impl<S: SocketOptions> Ear<S> {
    /// Listens from here on, with these statistics of the interface so far.
    pub fn new(receiver: Receiver<S>, so_far: Statistics, uncertainty: u32) -> Self {
        let interface = InterfaceDrops::new(so_far);
        let socket = SocketDrops::default();
        Ear { receiver, socket, interface, uncertainty, heard_until: Moment::UNKNOWN }
    }

    /// Waits for frames and says those that came, or that nothing was heard; false then.
    ///
    /// # Errors
    /// What became of the interface: it is down, or gone.
    pub fn listen(&mut self, out: &mut Outbox) -> io::Result<bool> {
        if self.receiver.receive()? > 0 {
            self.tell_heard(out);
            return Ok(true);
        }
        // This program may have been stopped since: what is said of now holds if still nothing came.
        let (quiet, dropped) = (now().plus(-LATENCY_NS), self.receiver.drops());
        if self.receiver.receive_queued()? > 0 {
            self.tell_heard(out);
            return Ok(true);
        }
        if !self.heard_until.is_after(quiet) {
            self.heard_until = quiet;
        }
        self.tell_dropped(dropped, out);
        out.silence(BUS, quiet);
        Ok(false)
    }

    fn tell_heard(&mut self, out: &mut Outbox) {
        for received in self.receiver.heard() {
            let stamp = received.remarks.stamp;
            let at = if stamp.is_known() { stamp } else { now() };
            self.heard_until = at;
            let dropped = received.remarks.dropped.and_then(|count| self.socket.until(count));
            if let Some(count) = dropped {
                lose(at, Some(count), LossCause::Capture, out);
            }
            let Some(mut frame) = packet::of_socket(received.bytes, at, self.uncertainty) else {
                continue;
            };
            frame.direction = Some(received.direction);
            if is_overrun(&frame) {
                self.interface.tell_overrun();
            }
            out.frame(BUS, frame);
        }
    }

    /// Says what the socket dropped after the last frame that was queued.
    fn tell_dropped(&mut self, count: Option<u32>, out: &mut Outbox) {
        if let Some(count) = count.and_then(|count| self.socket.until(count)) {
            lose(self.heard_until(), Some(count), LossCause::Capture, out);
        }
    }

    /// Says what came until now and is still queued, and what the socket dropped.
    pub fn tell_rest(&mut self, out: &mut Outbox) {
        let end = now();
        while !self.heard_until.is_after(end) && self.receive_rest() > 0 {
            self.tell_heard(out);
        }
        self.tell_dropped(self.receiver.drops(), out);
    }

    /// An error is told once, and what was queued before it is there all the same.
    fn receive_rest(&mut self) -> usize {
        let count = self.receiver.receive_queued().or_else(|_| self.receiver.receive_queued());
        count.unwrap_or(0)
    }

    /// The interface has stopped: says what came before. From the time that is returned on nothing
    /// is known of the bus.
    pub fn tell_before_stop(&mut self, out: &mut Outbox) -> Moment {
        let stop = now();
        self.tell_rest(out);
        if !self.heard_until.is_after(stop) {
            self.heard_until = stop;
        }
        self.heard_until
    }

    /// Says what the interface lost, and error frames did not tell.
    pub fn tell_interface_drops(&mut self, statistics: Statistics, out: &mut Outbox) {
        let Lost { overruns, frames } = self.interface.until(statistics);
        if frames > 0 {
            lose(self.heard_until(), Some(frames), LossCause::Overrun, out);
        }
        if overruns > 0 {
            // One may be many frames.
            lose(self.heard_until(), None, LossCause::Overrun, out);
        }
    }

    /// A time that nothing can come before any more, and nothing has come after.
    pub fn heard_until(&self) -> Moment {
        match self.heard_until.is_known() {
            true => self.heard_until,
            false => now().plus(-LATENCY_NS),
        }
    }
}

/// Whether an error frame tells that the controller was overrun while it received.
fn is_overrun(frame: &Frame) -> bool {
    const WHILE_RECEIVING: u8 = 0x01;
    ErrorDetail::of(frame).is_some_and(|detail| detail.is_overrun())
        && frame.bytes().get(1).is_some_and(|bits| bits & WHILE_RECEIVING != 0)
}

fn lose(start: Moment, count: Option<u64>, cause: LossCause, out: &mut Outbox) {
    out.lost(BUS, Loss { start, count, cause });
}

#[cfg(test)]
mod tests {
    use super::super::super::super::Piece;
    use super::super::receiver::tests::{Stand, pair};
    use super::*;
    use dissectors::can::{Direction, FrameKind};
    use dissectors::event::Event;
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::{SocketAddr, UnixDatagram};

    fn ear() -> (UnixDatagram, Ear<Stand<UnixDatagram>>) {
        let (near, receiver) = pair();
        (near, Ear::new(receiver, Statistics::default(), 200_000))
    }

    /// A frame as `linux/can.h` lays it out.
    fn bytes(id: u32, data: &[u8], size: usize) -> Vec<u8> {
        let mut bytes = id.to_ne_bytes().to_vec();
        bytes.extend([data.len() as u8, 0, 0, 0]);
        bytes.extend(data);
        bytes.resize(size, 0);
        bytes
    }

    /// What is in the outbox: frames, and losses in words.
    fn said(out: &mut Outbox) -> (Vec<Frame>, Vec<String>) {
        let (mut frames, mut losses) = (Vec::new(), Vec::new());
        while let Some(piece) = out.next() {
            match piece.expect("the socket lives") {
                Piece::Heard(BUS, Event::Frames(heard)) => frames.extend(heard),
                Piece::Heard(BUS, Event::Lost(loss)) => {
                    losses.push(format!("{:?} {:?}", loss.cause, loss.count));
                }
                Piece::Heard(BUS, Event::Advance(_)) => {}
                _ => panic!("nothing else is said"),
            }
        }
        (frames, losses)
    }

    #[test]
    fn every_kind_of_frame_is_heard_as_it_is() {
        let (near, mut ear) = ear();
        for sent in [
            bytes(0x7FF, &[1, 2], 16),
            bytes(0x8000_0000 | 0x1FFF_FFFF, &[], 16),
            bytes(0x4000_0123, &[], 16),
            bytes(0x2000_0040, &[0; 8], 16),
            bytes(0x321, &[7; 12], 72),
        ] {
            near.send(&sent).expect("there is a reader");
        }
        // Nothing that SocketCAN hands out.
        near.send(&[0; 9]).expect("there is a reader");
        let mut out = Outbox::default();
        assert!(ear.listen(&mut out).expect("the socket lives"));
        let (frames, losses) = said(&mut out);
        let heard: Vec<_> =
            frames.iter().map(|f| (f.kind, f.id.value(), f.bytes().len())).collect();
        assert_eq!(
            heard,
            [
                (FrameKind::Data, 0x7FF, 2),
                (FrameKind::Data, 0x1FFF_FFFF, 0),
                (FrameKind::Remote, 0x123, 0),
                (FrameKind::Error, 0x40, 8),
                (FrameKind::Fd, 0x321, 12),
            ]
        );
        assert!(frames[1].id.is_extended());
        let is_known = |frame: &Frame| {
            frame.direction == Some(Direction::Received) && frame.uncertainty == 200_000
        };
        assert!(frames.iter().all(is_known) && losses.is_empty());
    }

    #[test]
    fn an_overrun_is_told_by_its_error_frame_or_by_the_statistics_but_once() {
        let (near, mut ear) = ear();
        let mut out = Outbox::default();
        near.send(&bytes(0x2000_0004, &[0, 0x01, 0, 0, 0, 0, 0, 0], 16)).expect("it is read");
        assert!(ear.listen(&mut out).expect("the socket lives"));
        let statistics = Statistics { over: 3, fifo: 5, dropped: 5 };
        for _ in 0..3 {
            ear.tell_interface_drops(statistics, &mut out);
        }
        let (frames, losses) = said(&mut out);
        assert_eq!(frames.len(), 1);
        assert_eq!(losses, ["Overrun Some(5)", "Overrun None"]);
    }

    #[test]
    fn what_is_queued_at_the_end_is_heard() {
        let (near, mut ear) = ear();
        for _ in 0..200 {
            near.send(&bytes(0x123, &[], 16)).expect("there is a reader");
        }
        let mut out = Outbox::default();
        ear.tell_rest(&mut out);
        assert_eq!(said(&mut out).0.len(), 200);
    }

    /// An error stands before what is queued: here that the peer took another one (`ECONNRESET`), on
    /// a CAN socket that the interface is down.
    #[test]
    fn what_was_queued_before_an_error_is_heard() {
        let (near, mut ear) = ear();
        let another = SocketAddr::from_abstract_name(format!("fieldtap-{}", std::process::id()));
        let another = another.expect("it is short");
        let _peer = UnixDatagram::bind_addr(&another).expect("nobody else has it");
        for _ in 0..200 {
            near.send(&bytes(0x123, &[], 16)).expect("there is a reader");
        }
        near.connect_addr(&another).expect("it is bound");
        let (mut out, before) = (Outbox::default(), now());
        let since = ear.tell_before_stop(&mut out);
        assert_eq!(said(&mut out).0.len(), 200);
        // Nothing that was heard, and no end, is before the time that is told of the loss.
        assert!(!before.is_after(since) && ear.heard_until() == since);
    }

    #[test]
    fn silence_is_said_of_what_nothing_can_come_before_any_more() {
        let (_near, mut ear) = ear();
        let mut out = Outbox::default();
        assert!(!ear.listen(&mut out).expect("it is a pause"));
        let Some(Ok(Piece::Heard(BUS, Event::Advance(until)))) = out.next() else {
            panic!("silence is said")
        };
        let ago = now().since(until).expect("both are known");
        assert!((20_000_000..10_000_000_000).contains(&ago), "{ago}");
    }
}
