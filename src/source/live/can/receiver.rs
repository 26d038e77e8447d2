//! Many frames with one system call, and what the kernel says of each: `recvmmsg(2)`.

use super::control::Remarks;
use dissectors::can::Direction;
use socketcan::SocketOptions;
use std::io;
use std::os::fd::AsRawFd;

/// Most frames of one call.
const BATCH: usize = 64;

/// Of a CAN FD frame as SocketCAN hands it out: the longest one there is here.
const FRAME: usize = size_of::<libc::canfd_frame>();

/// Room for control messages: a stamp takes 32 bytes and a count 24.
const CONTROL: usize = 128;

/// Bytes that the socket may queue: at 766 a frame (measured) some 20,000, which come in 2 s of a
/// full bus of 1 Mbit/s.
const QUEUE: i32 = 16 << 20;

/// The place of the count of dropped frames in what `SO_MEMINFO` tells: `SK_MEMINFO_DROPS`
/// (`linux/sock_diag.h`).
const MEMINFO_DROPS: usize = 8;

/// A socket with what it received last.
pub struct Receiver<S> {
    socket: S,
    heard: Box<Batch>,
}

/// The kernel aligns control messages to words.
#[derive(Clone, Copy)]
#[repr(align(8))]
struct Control([u8; CONTROL]);

/// What one call received.
struct Batch {
    frames: [[u8; FRAME]; BATCH],
    controls: [Control; BATCH],
    /// How long each is, and what was said of it.
    lengths: [Lengths; BATCH],
    count: usize,
}

#[derive(Clone, Copy, Default)]
struct Lengths {
    frame: usize,
    control: usize,
    flags: i32,
}

/// A frame that was received.
#[derive(Clone, Copy, Debug)]
pub struct Received<'a> {
    /// As `linux/can.h` lays it out.
    pub bytes: &'a [u8],
    /// What the kernel says of it.
    pub remarks: Remarks,
    /// Whether a program on this host sent it.
    pub direction: Direction,
}

impl<S: SocketOptions> Receiver<S> {
    /// Has the kernel stamp what this socket receives, count what it drops, and queue much. How long
    /// [`Receiver::receive`] waits is the socket's time-out.
    ///
    /// # Errors
    /// The kernel does not do so.
    pub fn new(socket: S) -> io::Result<Self> {
        socket.set_recv_timestamp(true)?;
        socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RXQ_OVFL, 1)?;
        // Beyond the limit of the system only for those who administrate networks.
        socket
            .set_socket_option_int(libc::SOL_SOCKET, libc::SO_RCVBUFFORCE, QUEUE)
            .or_else(|_| socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RCVBUF, QUEUE))?;
        Ok(Receiver { socket, heard: Box::new(Batch::new()) })
    }

    /// Waits for frames, and takes as many as there are. None where nothing came in time.
    ///
    /// # Errors
    /// What became of the interface: it is down, or gone.
    pub fn receive(&mut self) -> io::Result<usize> {
        self.take(libc::MSG_WAITFORONE)
    }

    /// Takes what is queued, without waiting.
    ///
    /// # Errors
    /// As those of [`Receiver::receive`].
    pub fn receive_queued(&mut self) -> io::Result<usize> {
        self.take(libc::MSG_DONTWAIT)
    }

    fn take(&mut self, flags: i32) -> io::Result<usize> {
        match self.heard.fill(&self.socket, flags) {
            Err(error) if is_pause(&error) => Ok(0),
            other => other,
        }
    }

    /// What was received last.
    pub fn heard(&self) -> impl Iterator<Item = Received<'_>> {
        (0..self.heard.count).map(|index| self.heard.get(index))
    }

    /// Frames that the socket has dropped since it was opened, modulo 2³². `None` where the kernel
    /// does not tell.
    pub fn drops(&self) -> Option<u32> {
        let mut told = [0; 4 * (MEMINFO_DROPS + 1)];
        let length = self
            .socket
            .get_socket_option_bytes(libc::SOL_SOCKET, libc::SO_MEMINFO, &mut told)
            .ok()?;
        told.get(..length)?.last_chunk().copied().map(u32::from_ne_bytes)
    }
}

fn is_pause(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

impl Batch {
    fn new() -> Self {
        Batch {
            frames: [[0; FRAME]; BATCH],
            controls: [Control([0; CONTROL]); BATCH],
            lengths: [Lengths::default(); BATCH],
            count: 0,
        }
    }

    /// Takes the frames that are there, and waits for the first as the flags of `recv(2)` say.
    fn fill(&mut self, socket: &impl AsRawFd, flags: i32) -> io::Result<usize> {
        self.count = 0;
        let Batch { frames, controls, .. } = self;
        let mut places = frames
            .each_mut()
            .map(|frame| libc::iovec { iov_base: frame.as_mut_ptr().cast(), iov_len: FRAME });
        // SAFETY: all of its members may be zero: numbers, and pointers to what is not asked for.
        #[allow(unsafe_code)]
        let empty = unsafe { std::mem::zeroed::<libc::mmsghdr>() };
        let mut headers = [empty; BATCH];
        for (header, (place, control)) in
            headers.iter_mut().zip(places.iter_mut().zip(controls.iter_mut()))
        {
            header.msg_hdr.msg_iov = place;
            header.msg_hdr.msg_iovlen = 1;
            header.msg_hdr.msg_control = control.0.as_mut_ptr().cast();
            header.msg_hdr.msg_controllen = CONTROL as _;
        }
        // SAFETY: there are BATCH headers, and each points to a frame and a control buffer of the
        // length it says, of which nothing else makes use until the call is back. No crate at hand
        // makes this call with these control messages.
        #[allow(unsafe_code)]
        let count = unsafe {
            libc::recvmmsg(
                socket.as_raw_fd(),
                headers.as_mut_ptr(),
                BATCH as _,
                flags as _,
                std::ptr::null_mut(),
            )
        };
        let count = usize::try_from(count).map_err(|_| io::Error::last_os_error())?;
        for (lengths, header) in self.lengths.iter_mut().zip(&headers[..count]) {
            // Of another type in other C libraries.
            #[allow(clippy::unnecessary_cast)]
            let control = header.msg_hdr.msg_controllen as usize;
            let flags = header.msg_hdr.msg_flags;
            *lengths = Lengths { frame: header.msg_len as usize, control, flags };
        }
        self.count = count;
        Ok(count)
    }

    fn get(&self, index: usize) -> Received<'_> {
        let Lengths { frame, control, flags } = self.lengths[index];
        let is_sent = flags & libc::MSG_DONTROUTE != 0;
        Received {
            bytes: &self.frames[index][..frame.min(FRAME)],
            remarks: Remarks::of(&self.controls[index].0[..control.min(CONTROL)]),
            direction: if is_sent { Direction::Sent } else { Direction::Received },
        }
    }
}

#[cfg(test)]
pub mod tests {
    use super::super::super::super::can::packet;
    use super::super::drops::SocketDrops;
    use super::*;
    use dissectors::event::Moment;
    use std::net::UdpSocket;
    use std::os::fd::RawFd;
    use std::os::unix::net::UnixDatagram;
    use std::thread;
    use std::time::{Duration, Instant, SystemTime};

    /// Any socket of datagrams in the place of one of CAN.
    pub struct Stand<S>(pub S);

    impl<S: AsRawFd> AsRawFd for Stand<S> {
        fn as_raw_fd(&self) -> RawFd {
            self.0.as_raw_fd()
        }
    }

    impl<S: AsRawFd> SocketOptions for Stand<S> {}

    pub fn pair() -> (UnixDatagram, Receiver<Stand<UnixDatagram>>) {
        let (near, far) = UnixDatagram::pair().expect("there are sockets");
        far.set_read_timeout(Some(Duration::from_millis(10))).expect("it can wait");
        (near, Receiver::new(Stand(far)).expect("the kernel stamps"))
    }

    /// A classic frame with this number, as `linux/can.h` lays it out.
    fn frame(number: u32) -> [u8; 16] {
        let mut bytes = [0; 16];
        bytes[..4].copy_from_slice(&0x3C1_u32.to_ne_bytes());
        bytes[4] = 8;
        bytes[8..12].copy_from_slice(&number.to_ne_bytes());
        bytes
    }

    /// That of this thread so far.
    fn processor_time() -> Duration {
        use rustix::time::{ClockId, clock_gettime};
        let time = clock_gettime(ClockId::ThreadCPUTime);
        Duration::try_from(time).expect("it runs forwards")
    }

    /// A frame of eight bytes is 111 bits without stuffing, and so a full bus of 500 kbit/s has
    /// 4504 a second. Ten times that, for a second, or for as many as `FIELDTAP_SOAK` says.
    #[test]
    fn ten_times_a_full_bus_comes_whole_in_order_and_with_stamps() {
        const SECOND: u32 = 10 * (500_000 / 111);
        let soak = std::env::var("FIELDTAP_SOAK").ok();
        let seconds: u32 = soak.map_or(1, |seconds| seconds.parse().expect("seconds"));
        let count = SECOND * seconds;
        let (near, mut receiver) = pair();
        let sender = thread::spawn(move || {
            let begin = Instant::now();
            for number in 0..count {
                while begin.elapsed() < Duration::from_secs(1) * number / SECOND {
                    thread::sleep(Duration::from_micros(500));
                }
                near.send(&frame(number)).expect("there is a reader");
            }
        });
        let (mut next, mut last) = (0, Moment::UNKNOWN);
        let (begin, busy) = (Instant::now(), processor_time());
        let patience = Duration::from_secs(30 + u64::from(seconds));
        while next < count && begin.elapsed() < patience {
            receiver.receive().expect("the socket lives");
            for received in receiver.heard() {
                let stamp = received.remarks.stamp;
                let heard = packet::of_socket(received.bytes, stamp, 0).expect("a frame");
                assert_eq!(heard.bytes()[..4], next.to_ne_bytes());
                assert_eq!(received.direction, Direction::Received);
                assert!(stamp.is_known() && !last.is_after(stamp), "{stamp:?} after {last:?}");
                (next, last) = (next + 1, stamp);
            }
        }
        assert_eq!(next, count);
        let frame = (processor_time() - busy).as_nanos() / u128::from(count);
        println!(
            "soak: {count} frames in {:?}, none lost; {frame} ns of processor time a frame to receive \
             and parse",
            begin.elapsed()
        );
        sender.join().expect("it sent all of them");
        assert_eq!(receiver.drops(), Some(0));
    }

    #[test]
    fn nothing_is_no_error_and_takes_no_longer_than_patience() {
        let (_near, mut receiver) = pair();
        let begin = Instant::now();
        assert_eq!(receiver.receive().expect("it is a pause"), 0);
        assert!(begin.elapsed() >= Duration::from_millis(8));
        assert_eq!(receiver.heard().count(), 0);
    }

    #[test]
    fn a_stamp_is_the_time_of_arrival_not_of_reading() {
        let (near, mut receiver) = pair();
        let now = || SystemTime::UNIX_EPOCH.elapsed().expect("after 1970").as_nanos() as i64;
        let before = now();
        near.send(&frame(1)).expect("there is a reader");
        let after = now();
        thread::sleep(Duration::from_millis(20));
        assert_eq!(receiver.receive().expect("the socket lives"), 1);
        let stamp = receiver.heard().next().expect("one").remarks.stamp.ns().expect("a stamp");
        assert!((before..=after).contains(&stamp), "{before} {stamp} {after}");
    }

    /// CAN sockets share their accounting of drops with those of UDP: what a full queue cannot take
    /// is dropped and counted (`sock_queue_rcv_skb`).
    #[test]
    fn every_frame_comes_or_is_counted() {
        const COUNT: u32 = 40_000;
        let far = UdpSocket::bind("127.0.0.1:0").expect("there is a loopback");
        far.set_read_timeout(Some(Duration::from_millis(10))).expect("it can wait");
        let near = UdpSocket::bind("127.0.0.1:0").expect("there is a loopback");
        near.connect(far.local_addr().expect("it is bound")).expect("it can");
        let mut receiver = Receiver::new(Stand(far)).expect("the kernel stamps");
        let narrow = 8 * 1024;
        let socket = &receiver.socket;
        socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RCVBUF, narrow).expect("it can");

        let (mut next, mut came, mut lost) = (0, 0, 0);
        let mut drops = SocketDrops::default();
        for half in 1..=2 {
            for number in (half - 1) * COUNT / 2..half * COUNT / 2 {
                near.send(&frame(number)).expect("the loopback takes it");
            }
            while receiver.receive().expect("the socket lives") > 0 {
                for received in receiver.heard() {
                    let missing = received.remarks.dropped.and_then(|count| drops.until(count));
                    lost += missing.unwrap_or(0);
                    next += missing.unwrap_or(0) as u32;
                    // What is missing is told with the frame it is missing before.
                    let number = next.to_ne_bytes();
                    assert_eq!(received.bytes[8..12], number, "{came} came, {lost} lost");
                    (next, came) = (next + 1, came + 1);
                }
            }
            // The last ones have no frame after them that could tell.
            let missing = receiver.drops().and_then(|count| drops.until(count)).unwrap_or(0);
            (next, lost) = (next + missing as u32, lost + missing);
        }
        assert!(came > 0 && lost > 1000, "{came} came, {lost} lost");
        assert_eq!(came + lost, u64::from(COUNT));
    }
}
