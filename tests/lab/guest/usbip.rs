//! USB devices that a program plays: the kernel's own driver of USB over IP takes a socket, and what
//! it sends and wants to be answered is in `Documentation/usb/usbip_protocol.rst`.

use super::tap::PATIENCE;
use std::collections::VecDeque;
use std::fs;
use std::io::{self, Read, Write};
use std::net::Shutdown;
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

/// Where sockets are handed over.
const HOST: &str = "/sys/devices/platform/vhci_hcd.0";

/// A bus and a device number, which nobody looks at; and the speed: full.
const DEVICE: u32 = 0x0001_0002;
const FULL_SPEED: u32 = 2;

/// An answer to a request that is not known, as a device stalls.
const STALL: i32 = -libc::EPIPE;

/// What a device says of itself: vendor and product, and what it is called.
pub struct Identity {
    pub vendor: u16,
    pub product: u16,
    pub release: u16,
    pub name: &'static str,
}

/// What a device does.
pub trait Device: Send {
    fn identity(&self) -> Identity;

    /// A request to it: the answer, cut to what was asked; none where there is no such request.
    fn ask(&mut self, setup: Setup) -> Option<Vec<u8>>;

    /// A request that tells it something.
    fn tell(&mut self, setup: Setup, data: &[u8]);
}

/// The first stage of a control transfer (USB 2.0 §9.3).
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    pub request: u8,
    pub value: u16,
    pub length: u16,
}

/// A device that is plugged in until this is dropped.
pub struct Plug<D> {
    state: Arc<Mutex<State<D>>>,
    socket: UnixStream,
    place: u32,
}

struct State<D> {
    device: D,
    answers: UnixStream,
    /// Transfers that wait for something to be received: sequence number and room.
    waiting: VecDeque<(u32, usize)>,
    /// What was received and not fetched.
    received: VecDeque<Vec<u8>>,
    /// What the driver sent to be put on the line.
    sent: Vec<u8>,
}

impl<D: Device + 'static> Plug<D> {
    /// Plugs it into this place of the host.
    pub fn into(place: u32, device: D) -> Self {
        super::only_in_the_machine();
        let (ours, kernels) = UnixStream::pair().expect("there are sockets");
        let attach = format!("{place} {} {DEVICE} {FULL_SPEED}", kernels.as_raw_fd());
        let answers = ours.try_clone().expect("it can be cloned");
        let state = State {
            device,
            answers,
            waiting: VecDeque::new(),
            received: VecDeque::new(),
            sent: Vec::new(),
        };
        let plug = Plug { state: Arc::new(Mutex::new(state)), socket: ours, place };
        let (state, mut requests) = (Arc::clone(&plug.state), plug.socket.try_clone().expect("it"));
        thread::spawn(move || while serve(&mut requests, &state).is_ok() {});
        fs::write(Path::new(HOST).join("attach"), attach).expect("the place is free");
        plug
    }

    /// Looks at the device.
    pub fn look<T>(&self, at: impl FnOnce(&D) -> T) -> T {
        at(&self.state.lock().expect("nobody panicked").device)
    }

    /// It received this, as one packet.
    pub fn receive(&self, packet: &[u8]) {
        let mut state = self.state.lock().expect("nobody panicked");
        state.received.push_back(packet.to_vec());
        state.hand_over().expect("the kernel listens");
    }

    /// What it was given to put on the line.
    pub fn sent(&self) -> Vec<u8> {
        self.state.lock().expect("nobody panicked").sent.clone()
    }
}

impl<D> Plug<D> {
    /// The host tells of each place what state it is in: 4 is free (`VDEV_ST_NULL`).
    fn wait_until_free(&self) {
        let begin = Instant::now();
        let is_free = || {
            let places = fs::read_to_string(Path::new(HOST).join("status")).unwrap_or_default();
            let place = format!("hs  {:04} 004", self.place);
            places.lines().any(|line| line.starts_with(&place))
        };
        while !is_free() && begin.elapsed() < PATIENCE {
            thread::sleep(Duration::from_millis(20));
        }
    }
}

impl<D> Drop for Plug<D> {
    fn drop(&mut self) {
        // The next one has the place once the kernel is done with this one.
        let _ = fs::write(Path::new(HOST).join("detach"), self.place.to_string());
        let _ = self.socket.shutdown(Shutdown::Both);
        self.wait_until_free();
    }
}

const SUBMIT: u32 = 1;
const UNLINK: u32 = 2;
const SUBMITTED: u32 = 3;
const UNLINKED: u32 = 4;

/// Every message begins with a header of this size: words, and for requests a setup.
const HEADER: usize = 48;

fn serve<D: Device>(requests: &mut UnixStream, state: &Mutex<State<D>>) -> io::Result<()> {
    let mut header = [0; HEADER];
    requests.read_exact(&mut header)?;
    let word = |number: usize| {
        let bytes = header[number * 4..].first_chunk().expect("the header is longer");
        u32::from_be_bytes(*bytes)
    };
    let (command, sequence, is_in, endpoint) = (word(0), word(1), word(3) == 1, word(4));
    let length = word(6) as usize;
    let mut data = vec![0; if is_in || command == UNLINK { 0 } else { length }];
    requests.read_exact(&mut data)?;

    let mut state = state.lock().expect("nobody panicked");
    match (command, endpoint) {
        (SUBMIT, 0) => {
            let setup = header.last_chunk::<8>().expect("it ends with a setup");
            state.control(sequence, setup, &data)
        }
        (SUBMIT, _) if is_in => {
            state.waiting.push_back((sequence, length));
            state.hand_over()
        }
        (SUBMIT, _) => {
            state.sent.extend(&data);
            state.answer(sequence, 0, &[], data.len())
        }
        _ => state.take_back(sequence, word(5)),
    }
}

impl<D: Device> State<D> {
    fn control(&mut self, sequence: u32, setup: &[u8; 8], data: &[u8]) -> io::Result<()> {
        let [kind, request, v0, v1, _, _, l0, l1] = *setup;
        let value = u16::from_le_bytes([v0, v1]);
        let setup = Setup { request, value, length: u16::from_le_bytes([l0, l1]) };
        if kind & 0x80 == 0 {
            self.device.tell(setup, data);
            return self.answer(sequence, 0, &[], data.len());
        }
        let answer = match (kind, request) {
            (0x80, GET_DESCRIPTOR) => descriptor(&self.device.identity(), value),
            (0x80, GET_STATUS) => Some(vec![0, 0]),
            _ => self.device.ask(setup),
        };
        match answer {
            Some(mut answer) => {
                answer.truncate(setup.length.into());
                self.answer(sequence, 0, &answer, answer.len())
            }
            None => self.answer(sequence, STALL, &[], 0),
        }
    }

    /// Answers transfers that wait with what was received.
    fn hand_over(&mut self) -> io::Result<()> {
        while let (Some((sequence, room)), Some(packet)) =
            (self.waiting.front().copied(), self.received.front())
        {
            let packet = packet[..packet.len().min(room)].to_vec();
            self.waiting.pop_front();
            self.received.pop_front();
            self.answer(sequence, 0, &packet, packet.len())?;
        }
        Ok(())
    }

    fn take_back(&mut self, sequence: u32, other: u32) -> io::Result<()> {
        let before = self.waiting.len();
        self.waiting.retain(|(waiting, _)| *waiting != other);
        let status = if self.waiting.len() < before { -libc::ECONNRESET } else { 0 };
        self.say(UNLINKED, sequence, status, 0, &[])
    }

    fn answer(&mut self, to: u32, status: i32, data: &[u8], length: usize) -> io::Result<()> {
        self.say(SUBMITTED, to, status, length, data)
    }

    fn say(
        &mut self,
        what: u32,
        to: u32,
        status: i32,
        length: usize,
        data: &[u8],
    ) -> io::Result<()> {
        let mut message = [0; HEADER].to_vec();
        let length = u32::try_from(length).expect("transfers are short");
        let words = [(0, what), (1, to), (5, status.cast_unsigned()), (6, length)];
        for (place, word) in words {
            message[place * 4..][..4].copy_from_slice(&word.to_be_bytes());
        }
        message.extend(data);
        self.answers.write_all(&message)
    }
}

const GET_STATUS: u8 = 0;
const GET_DESCRIPTOR: u8 = 6;

/// Descriptors (USB 2.0 §9.6): a device, its configuration with one interface that has an endpoint
/// in and one out, and its name.
fn descriptor(identity: &Identity, value: u16) -> Option<Vec<u8>> {
    const DEVICE: u8 = 1;
    const CONFIGURATION: u8 = 2;
    const STRING: u8 = 3;
    let [number, kind] = value.to_le_bytes();
    Some(match (kind, number) {
        (DEVICE, _) => {
            let mut bytes = vec![18, DEVICE, 0x00, 0x02, 0, 0, 0, 64];
            for word in [identity.vendor, identity.product, identity.release] {
                bytes.extend(word.to_le_bytes());
            }
            bytes.extend([0, 1, 0, 1]);
            bytes
        }
        (CONFIGURATION, _) => [
            &[9, CONFIGURATION, 32, 0, 1, 1, 0, 0x80, 50][..],
            &[9, 4, 0, 0, 2, 0xFF, 0xFF, 0xFF, 0],
            &[7, 5, 0x81, 2, 64, 0, 0],
            &[7, 5, 0x02, 2, 64, 0, 0],
        ]
        .concat(),
        (STRING, 0) => vec![4, STRING, 0x09, 0x04],
        (STRING, 1) => {
            let name = identity.name.encode_utf16().flat_map(u16::to_le_bytes);
            let mut bytes = vec![0, STRING];
            bytes.extend(name);
            bytes[0] = u8::try_from(bytes.len()).expect("names are short");
            bytes
        }
        _ => return None,
    })
}
