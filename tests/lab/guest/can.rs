//! CAN interfaces and what is sent on them.

use super::tap::PATIENCE;
use socketcan::{
    CanCtrlMode, CanDataFrame, CanFrame, CanInterface, CanSocket, EmbeddedFrame, Socket, StandardId,
};
use std::fs::{self, OpenOptions};
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// An interface that is gone, or down if it is of a card, when this is.
pub struct Interface {
    name: String,
    link: CanInterface,
    is_virtual: bool,
}

impl Interface {
    /// A virtual one, which is up.
    pub fn virtual_one(name: &str) -> Self {
        super::only_in_the_machine();
        let link = CanInterface::create_vcan(name, None).expect("the module is loaded");
        let interface = Interface { name: name.into(), link, is_virtual: true };
        interface.up();
        interface
    }

    /// That of an emulated card, which is up.
    pub fn card(name: &str, is_listen_only: bool) -> Self {
        super::only_in_the_machine();
        let link = CanInterface::open(name).expect("QEMU has two cards");
        link.set_bitrate(500_000, None).expect("it is down");
        link.set_ctrlmode(CanCtrlMode::ListenOnly, is_listen_only).expect("the card can do so");
        let interface = Interface { name: name.into(), link, is_virtual: false };
        interface.up();
        interface
    }

    /// Sets a card that is down.
    pub fn set_bitrate(&self, rate: u32) {
        self.link.set_bitrate(rate, None).expect("it is down");
    }

    pub fn up(&self) {
        self.link.bring_up().expect("it comes up");
    }

    pub fn down(&self) {
        self.link.bring_down().expect("it goes down");
    }

    /// Whether the card can interrupt the machine (bit 10 of its command register, PCI 3.0 §6.2.2).
    /// While it cannot, nobody takes from it what it hears.
    pub fn interrupts(&self, may: bool) {
        const COMMAND: u64 = 4;
        const DISABLE: u16 = 1 << 10;
        let place = format!("/sys/class/net/{}/device/config", self.name);
        let config = OpenOptions::new().read(true).write(true).open(place).expect("it is a card");
        let mut command = [0; 2];
        config.read_exact_at(&mut command, COMMAND).expect("it has one");
        let others = u16::from_le_bytes(command) & !DISABLE;
        let command = if may { others } else { others | DISABLE };
        config.write_all_at(&command.to_le_bytes(), COMMAND).expect("whoever is root may");
    }

    /// One of the kernel's counters.
    pub fn count(&self, of: &str) -> u64 {
        let path = format!("/sys/class/net/{}/statistics/{of}", self.name);
        let text = fs::read_to_string(&path).expect("it is counted");
        text.trim().parse().expect("a number")
    }

    /// Sends frames with these numbers, waiting where the interface is full.
    pub fn send(&self, numbers: Range<u32>) {
        let socket = CanSocket::open(&self.name).expect("it is there");
        for number in numbers {
            self.put(&socket, &numbered(number));
        }
    }

    /// The same, each once the other one has heard the one before: no machine is too slow for that.
    pub fn send_to(&self, other: &Interface, numbers: Range<u32>) {
        let begin = Instant::now();
        for number in numbers {
            let heard = other.count("rx_packets");
            self.send(number..number + 1);
            while other.count("rx_packets") == heard {
                assert!(begin.elapsed() < PATIENCE, "{} does not hear {number}", other.name);
                thread::sleep(Duration::from_micros(100));
            }
        }
    }

    /// Sends so many a second, or as many as it can. How many it were.
    pub fn send_at(&self, rate: u32, span: Duration) -> u64 {
        let socket = CanSocket::open(&self.name).expect("it is there");
        let (mut sent, begin) = (0, Instant::now());
        while begin.elapsed() < span {
            let due = begin.elapsed().as_micros() as u64 * u64::from(rate) / 1_000_000;
            // Time goes on while they are sent.
            for number in sent..due {
                self.put(&socket, &numbered(number as u32));
            }
            sent = sent.max(due);
            thread::sleep(Duration::from_millis(1));
        }
        sent
    }

    /// Sends frames with numbers from zero on, each so long after the one before, until it is told to
    /// stop. Those that the interface does not take, because it is down, are sent later.
    pub fn keep_sending(&self, pause: Duration) -> Traffic {
        let socket = CanSocket::open(&self.name).expect("it is there");
        let is_over = Arc::new(AtomicBool::new(false));
        let ends = Arc::clone(&is_over);
        let sender = thread::spawn(move || {
            let mut number = 0;
            while !ends.load(Ordering::Relaxed) {
                if socket.write_frame(&numbered(number)).is_ok() {
                    number += 1;
                }
                thread::sleep(pause);
            }
            number
        });
        Traffic { is_over, sender }
    }

    /// Sends one.
    pub fn send_frame(&self, frame: &CanFrame) {
        self.put(&CanSocket::open(&self.name).expect("it is there"), frame);
    }

    fn put(&self, socket: &CanSocket, frame: &CanFrame) {
        let begin = Instant::now();
        while let Err(error) = socket.write_frame(frame) {
            assert_eq!(error.raw_os_error(), Some(libc::ENOBUFS), "{}: {error}", self.name);
            assert!(begin.elapsed() < PATIENCE, "{} does not send", self.name);
            thread::sleep(Duration::from_micros(100));
        }
    }
}

/// Frames that are being sent.
pub struct Traffic {
    is_over: Arc<AtomicBool>,
    sender: JoinHandle<u32>,
}

impl Traffic {
    /// Ends it. How many frames it were.
    pub fn stop(self) -> u32 {
        self.is_over.store(true, Ordering::Relaxed);
        self.sender.join().expect("it sends")
    }
}

impl Drop for Interface {
    fn drop(&mut self) {
        // A test may have done so.
        let _ = self.link.bring_down();
        if self.is_virtual
            && let Ok(link) = CanInterface::open(&self.name)
        {
            let _ = link.delete();
        }
    }
}

/// A frame that carries its number.
fn numbered(number: u32) -> CanFrame {
    let id = StandardId::new(0x3C1).expect("it has eleven bits");
    CanFrame::Data(CanDataFrame::new(id, &number.to_be_bytes()).expect("four bytes fit"))
}

/// The numbers of those frames among records.
pub fn numbers(records: &[serde_json::Value]) -> Vec<u32> {
    let frames = records.iter().filter(|record| record["kind"] == "frame");
    let data = frames.map(|frame| frame["can"]["data"].as_str().expect("data"));
    data.map(|data| u32::from_str_radix(data, 16).expect("four bytes")).collect()
}
