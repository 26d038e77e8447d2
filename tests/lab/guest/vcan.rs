//! A virtual CAN interface: nothing is lost unsaid, and everything keeps its order.

use super::tap::{Tap, lost, of_kind};
use socketcan::{
    CanDataFrame, CanFrame, CanInterface, CanSocket, EmbeddedFrame, Socket, StandardId,
};

/// An interface that is there as long as this is.
struct Vcan(Option<CanInterface>);

impl Vcan {
    fn new(name: &str) -> Self {
        let interface = CanInterface::create_vcan(name, None).expect("the module is loaded");
        interface.bring_up().expect("it comes up");
        Vcan(Some(interface))
    }

    fn interface(&self) -> &CanInterface {
        self.0.as_ref().expect("it is there")
    }
}

impl Drop for Vcan {
    fn drop(&mut self) {
        if let Some(interface) = self.0.take() {
            let _ = interface.delete();
        }
    }
}

/// A frame that carries its number.
fn numbered(number: u32) -> CanFrame {
    let id = StandardId::new(0x3C1).expect("it has eleven bits");
    CanFrame::Data(CanDataFrame::new(id, &number.to_be_bytes()).expect("four bytes fit"))
}

/// Sends so many, waiting where the interface is full.
fn send(name: &str, numbers: std::ops::Range<u32>) {
    let socket = CanSocket::open(name).expect("it is up");
    for number in numbers {
        while let Err(error) = socket.write_frame(&numbered(number)) {
            assert_eq!(error.raw_os_error(), Some(libc::ENOBUFS), "{error}");
            std::thread::yield_now();
        }
    }
}

#[test]
#[ignore = "runs in the virtual machine"]
fn vcan_frames_come_whole_in_order_and_with_times() {
    const COUNT: u32 = 2000;
    super::only_in_the_machine();
    let _vcan = Vcan::new("vcan0");
    let mut tap = Tap::listen(&["can:vcan0", "--protocol", "can"], "virtual");
    send("vcan0", 0..COUNT);
    tap.wait_for(COUNT as usize, "frame");
    let run = tap.stop();

    let frames = of_kind(&run.records, "frame");
    let numbers: Vec<String> =
        frames.iter().map(|frame| frame["can"]["data"].as_str().expect("data").into()).collect();
    let sent: Vec<String> = (0..COUNT).map(|number| format!("{number:08X}")).collect();
    assert_eq!(numbers, sent);
    assert_eq!(lost(&run.records), 0);
    assert!(frames.is_sorted_by_key(|frame| frame["time_ns"].as_u64().expect("a time")));
    assert!(frames.iter().all(|frame| frame["clock"] == "kernel"));
    // Another program on this host sent them.
    assert!(frames.iter().all(|frame| frame["can"]["direction"] == "tx"), "{:?}", frames[0]);
    assert_eq!(run.status, Some(130), "{}", run.stderr);
}
