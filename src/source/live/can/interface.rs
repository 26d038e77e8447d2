//! What the system knows of a CAN interface: netlink and sysfs, which anybody may ask.

use super::drops::Statistics;
use crate::ports::USUAL_RATE;
use dissectors::uart::Baud;
use socketcan::nl::{CanState, InterfaceDetails};
use socketcan::{CanCtrlMode, CanInterface};
use std::fs;
use std::io;
use std::path::PathBuf;

/// Where the system tells of network interfaces.
const DIRECTORY: &str = "/sys/class/net";

/// The kind of hardware of CAN interfaces (`ARPHRD_CAN`, `linux/if_arp.h`).
const CAN_HARDWARE: &str = "280";

/// ± of a stamp in ns. The kernel stamps in the interrupt of a controller on the board's own buses;
/// adapters on USB hand over what came within a millisecond or so at once.
const ON_BOARD_NS: u32 = 200_000;
const USB_NS: u32 = 1_000_000;

/// A CAN interface.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Interface {
    name: String,
    /// The system's number of it: another one where it was removed and came back.
    index: u32,
    is_up: bool,
    /// `None` where it is of no bus: a virtual one.
    controller: Option<Controller>,
    uncertainty: u32,
}

/// What a controller is set to, and how it is.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
struct Controller {
    /// `None` where the driver does not tell.
    is_listen_only: Option<bool>,
    /// Whether it has such a mode, if the driver tells.
    can_listen_only: Option<bool>,
    bitrate: Option<Baud>,
    /// In permille of a bit.
    sample_point: Option<u32>,
    state: Option<CanState>,
    /// Sent and received.
    error_counters: Option<(u16, u16)>,
}

/// Why an interface cannot be listened to.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Refusal {
    /// There is none of that name.
    Missing(String),
    /// It is not up.
    Down(String),
    /// It would take part in the traffic.
    Active(String),
    /// The system does not answer.
    Unknown(String),
}

impl Refusal {
    /// Why, and what to do.
    pub fn text(&self) -> &str {
        let (Refusal::Missing(text)
        | Refusal::Down(text)
        | Refusal::Active(text)
        | Refusal::Unknown(text)) = self;
        text
    }
}

impl Interface {
    /// Asks the system.
    ///
    /// # Errors
    /// There is no CAN interface of that name, or the system does not answer.
    pub fn ask(name: &str) -> Result<Interface, Refusal> {
        let kind = attribute(name, "type").map_err(|_| Refusal::Missing(missing(name)))?;
        if kind.trim() != CAN_HARDWARE {
            return Err(Refusal::Missing(format!("this is no CAN interface; {}", there())));
        }
        let refuse = |error| match was_removed(&error) {
            true => Refusal::Missing(missing(name)),
            false => Refusal::Unknown(format!("the system does not tell of it ({error})")),
        };
        let details = CanInterface::open(name).and_then(|interface| interface.details());
        let details = details.map_err(refuse)?;
        Ok(Interface::of(name, &details, bus(name)))
    }

    /// Of what netlink told, and of the bus of the board that it is on.
    fn of(name: &str, details: &InterfaceDetails, bus: Option<String>) -> Interface {
        let can = &details.can;
        // Virtual interfaces have neither a device behind them nor anything that can be set.
        let is_virtual = bus.is_none() && can.state.is_none() && can.ctrl_mode.is_none();
        let controller = (!is_virtual).then(|| Controller {
            is_listen_only: can.ctrl_mode.as_ref().map(|m| m.has_mode(CanCtrlMode::ListenOnly)),
            can_listen_only: can
                .ctrl_mode_supported
                .map(|modes| modes & CanCtrlMode::ListenOnly.mask() != 0),
            bitrate: can.bit_timing.and_then(|timing| Baud::new(timing.bitrate)),
            sample_point: can.bit_timing.map(|timing| timing.sample_point),
            state: can.state,
            error_counters: can.berr_counter.map(|counter| (counter.txerr, counter.rxerr)),
        });
        let is_on_board = is_virtual || bus.is_some_and(|bus| bus != "usb");
        let uncertainty = if is_on_board { ON_BOARD_NS } else { USB_NS };
        let (name, index) = (name.to_owned(), details.index);
        Interface { name, index, is_up: details.is_up, controller, uncertainty }
    }

    /// Whether it may be listened to.
    ///
    /// # Errors
    /// It may not, or there would be nothing to hear: the commands that set it right.
    pub fn check(&self, allow_active: bool) -> Result<(), Refusal> {
        if !self.is_up {
            let what = format!("it is down: {}", self.commands(false));
            return Err(Refusal::Down(what));
        }
        let Some(controller) = self.controller.as_ref().filter(|_| !allow_active) else {
            return Ok(());
        };
        let what = match controller {
            Controller { is_listen_only: Some(true), .. } => return Ok(()),
            Controller { can_listen_only: Some(false), .. } => {
                "it is not listen-only, and its controller has no such mode: it acknowledges what \
                 it hears, and so takes part in the traffic. Take another adapter, or add \
                 --allow-active if it may"
                    .to_owned()
            }
            Controller { is_listen_only: Some(false), .. } => format!(
                "it is not listen-only: it acknowledges what it hears, and so takes part in the \
                 traffic. Set it right with {}; or add --allow-active if it may",
                self.commands(true)
            ),
            Controller { is_listen_only: None, .. } => {
                "its driver does not tell whether it is listen-only: set it so with the driver's \
                 own tools, and then add --allow-active"
                    .to_owned()
            }
        };
        Err(Refusal::Active(what))
    }

    /// The commands that set it right.
    fn commands(&self, is_up: bool) -> String {
        let name = &self.name;
        let down = if is_up { format!("ip link set {name} down; ") } else { String::new() };
        let Some(controller) = &self.controller else {
            return format!("{down}ip link set {name} up");
        };
        let rate = controller.bitrate.map_or(USUAL_RATE, Baud::get);
        let mode = match controller.can_listen_only {
            Some(false) => "",
            Some(true) | None => " listen-only on",
        };
        format!(
            "{down}ip link set {name} type can bitrate {rate}{mode}; ip link set {name} up (with \
             the bit rate of the bus)"
        )
    }

    /// Whether it is the same, and was not removed meanwhile: then its sockets still hear it.
    pub fn is_still(&self, other: &Interface) -> bool {
        self.index == other.index
    }

    /// Whether it is up.
    pub fn is_up(&self) -> bool {
        self.is_up
    }

    /// The bit rate it is set to.
    pub fn bitrate(&self) -> Option<Baud> {
        self.controller.as_ref()?.bitrate
    }

    /// ± of its stamps in ns.
    pub fn uncertainty(&self) -> u32 {
        self.uncertainty
    }

    /// What it is set to, and how it is, for people.
    pub fn describe(&self) -> String {
        let mut words = Vec::new();
        match &self.controller {
            None => words.push("virtual".to_owned()),
            Some(controller) => {
                words.push(
                    match controller.is_listen_only {
                        Some(true) => "listen-only",
                        Some(false) => "NOT listen-only: it acknowledges what it hears",
                        None => "its driver does not tell whether it is listen-only",
                    }
                    .to_owned(),
                );
                words.extend(controller.bitrate.map(|rate| format!("{rate} bit/s")));
                words.extend(
                    controller
                        .sample_point
                        .filter(|point| *point > 0)
                        .map(|point| format!("sampled at {}.{} %", point / 10, point % 10)),
                );
                words.extend(controller.state.map(|state| name_of(state).to_owned()));
                words.extend(
                    controller
                        .error_counters
                        .map(|(tx, rx)| format!("error counters {tx} sent, {rx} received")),
                );
            }
        }
        words.push(format!("kernel stamps ±{} µs", self.uncertainty / 1_000));
        words.join(", ")
    }
}

fn name_of(state: CanState) -> &'static str {
    match state {
        CanState::ErrorActive => "error-active",
        CanState::ErrorWarning => "error-warning",
        CanState::ErrorPassive => "error-passive",
        CanState::BusOff => "bus-off",
        CanState::Stopped => "stopped",
        CanState::Sleeping => "sleeping",
    }
}

/// What the interface has lost since it was made; nothing where it does not tell.
pub fn statistics(name: &str) -> Statistics {
    let count = |of: &str| {
        let text = attribute(name, &format!("statistics/{of}")).ok();
        text.and_then(|text| text.trim().parse().ok()).unwrap_or(0)
    };
    Statistics {
        over: count("rx_over_errors"),
        fifo: count("rx_fifo_errors"),
        dropped: count("rx_dropped"),
    }
}

/// Whether there is an interface of that name.
pub fn is_there(name: &str) -> bool {
    path(name).is_some_and(|path| path.exists())
}

/// Where the system tells of it; `None` for what is no name of an interface.
fn path(name: &str) -> Option<PathBuf> {
    let is_name = !name.is_empty() && name != "." && name != ".." && !name.contains('/');
    is_name.then(|| PathBuf::from(DIRECTORY).join(name))
}

fn attribute(name: &str, of: &str) -> io::Result<String> {
    let path = path(name).ok_or(io::ErrorKind::NotFound)?;
    fs::read_to_string(path.join(of))
}

/// The bus of the board that the device of an interface is on: `usb`, `pci`, `platform`, `spi`.
fn bus(name: &str) -> Option<String> {
    let link = fs::read_link(path(name)?.join("device/subsystem")).ok()?;
    Some(link.file_name()?.to_string_lossy().into_owned())
}

/// Whether it is gone as far as netlink goes: sysfs tells of it for a while yet.
fn was_removed(error: &socketcan::Error) -> bool {
    let errno = match error {
        socketcan::Error::Io(error) => error.raw_os_error(),
        socketcan::Error::Nl(error) => error.errno(),
        _ => None,
    };
    errno == Some(libc::ENODEV)
}

fn missing(name: &str) -> String {
    format!("there is no interface {}; {}", name.escape_debug(), there())
}

/// Which CAN interfaces there are.
fn there() -> String {
    let entries = fs::read_dir(DIRECTORY).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let is_can = |name: &String| attribute(name, "type").is_ok_and(|t| t.trim() == CAN_HARDWARE);
    let mut names: Vec<String> = names.filter(is_can).collect();
    names.sort();
    if names.is_empty() {
        return "there is no CAN interface on this machine: plug the adapter in, and see with \
                `dmesg` whether its driver takes it"
            .to_owned();
    }
    format!("CAN interfaces here: {}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use socketcan::nl::{CanBerrCounter, CanCtrlModes};

    /// What netlink tells of a controller at 250 kbit/s.
    fn details(is_up: bool, is_listen_only: bool) -> InterfaceDetails {
        let mut details = InterfaceDetails { is_up, ..InterfaceDetails::new(3) };
        let mut timing = socketcan::nl::CanBitTiming::default();
        (timing.bitrate, timing.sample_point) = (250_000, 875);
        details.can.bit_timing = Some(timing);
        details.can.state = Some(CanState::ErrorActive);
        let mode = CanCtrlModes::from_mode(CanCtrlMode::ListenOnly, is_listen_only);
        details.can.ctrl_mode = Some(mode);
        details.can.berr_counter = Some(CanBerrCounter { txerr: 0, rxerr: 9 });
        details
    }

    fn on(bus: &str, details: &InterfaceDetails) -> Interface {
        Interface::of("can0", details, Some(bus.to_owned()))
    }

    #[test]
    fn an_interface_that_acknowledges_is_refused_with_the_commands_that_set_it_right() {
        let active = on("pci", &details(true, false));
        let Err(Refusal::Active(text)) = active.check(false) else { panic!("it is refused") };
        let commands = "ip link set can0 down; ip link set can0 type can bitrate 250000 \
                        listen-only on; ip link set can0 up";
        assert!(text.contains(commands), "{text}");
        assert_eq!(active.check(true), Ok(()));
        assert_eq!(on("pci", &details(true, true)).check(false), Ok(()));
    }

    #[test]
    fn an_interface_that_is_down_is_told_how_to_bring_it_up_listening_only() {
        let Err(Refusal::Down(text)) = on("usb", &details(false, false)).check(true) else {
            panic!("it is refused")
        };
        let commands = "it is down: ip link set can0 type can bitrate 250000 listen-only on; ip \
                        link set can0 up";
        assert!(text.starts_with(commands), "{text}");

        // No rate was ever set.
        let fresh = InterfaceDetails { is_up: false, ..InterfaceDetails::new(3) };
        let text = on("usb", &fresh).check(false).expect_err("it is down").text().to_owned();
        let command = format!("bitrate {USUAL_RATE} listen-only on");
        assert!(text.contains(&command), "{text}");
    }

    #[test]
    fn a_virtual_interface_needs_no_mode() {
        let mut details = InterfaceDetails { is_up: true, ..InterfaceDetails::new(4) };
        let of = |details: &_| Interface::of("vcan0", details, None);
        assert_eq!(of(&details).check(false), Ok(()));
        assert_eq!(of(&details).bitrate(), None);
        assert_eq!(of(&details).describe(), "virtual, kernel stamps ±200 µs");
        details.is_up = false;
        let refusal = of(&details).check(false).expect_err("it is down");
        assert_eq!(refusal.text(), "it is down: ip link set vcan0 up");
    }

    #[test]
    fn a_driver_that_does_not_tell_or_cannot_is_not_trusted() {
        let mut silent = details(true, false);
        silent.can.ctrl_mode = None;
        assert!(matches!(on("usb", &silent).check(false), Err(Refusal::Active(_))));
        let mut poor = details(true, false);
        poor.can.ctrl_mode_supported = Some(0);
        let refusal = on("usb", &poor).check(false).expect_err("it is active");
        assert!(refusal.text().contains("no such mode"), "{}", refusal.text());
    }

    #[test]
    fn what_it_is_set_to_is_told() {
        assert_eq!(
            on("usb", &details(true, true)).describe(),
            "listen-only, 250000 bit/s, sampled at 87.5 %, error-active, error counters 0 sent, 9 \
             received, kernel stamps ±1000 µs"
        );
        assert_eq!(on("usb", &details(true, true)).bitrate(), Baud::new(250_000));
    }

    #[test]
    fn what_is_no_can_interface_is_told() {
        let refusal = Interface::ask("nothere").expect_err("it is not there");
        assert!(refusal.text().starts_with("there is no interface nothere; "));
        assert!(matches!(Interface::ask("lo"), Err(Refusal::Missing(_))));
        assert!(matches!(Interface::ask("../net"), Err(Refusal::Missing(_))));
    }
}
