//! CAN interfaces: sysfs for what every network interface has, netlink for what only CAN has.

use super::Machine;
use super::tree;
use super::usable::{self, Obstacle};
use serde::Serialize;
use std::path::Path;

/// A CAN interface.
#[derive(Serialize, Clone, PartialEq, Eq, Debug)]
pub struct CanPort {
    /// As commands want it: `can:can0`.
    pub source: String,
    /// The interface: `can0`.
    pub name: String,
    /// The kernel's driver; `None` where there is no controller behind it (vcan).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub driver: Option<String>,
    /// Whether there is a controller that takes part in the traffic of a real bus.
    pub is_real: bool,
    /// Whether it is up.
    pub is_up: bool,
    /// What only netlink tells; `None` where it was refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<Link>,
    /// What the kernel counted since the interface is there.
    pub counters: Statistics,
    /// Whether nothing is known to keep it from being listened to.
    #[serde(rename = "usable")]
    pub is_usable: bool,
    /// What stands in the way, and what to know.
    pub obstacles: Vec<Obstacle>,
}

/// What the kernel says of a CAN controller.
#[derive(Serialize, Clone, Default, PartialEq, Eq, Debug)]
pub struct Link {
    /// Its error state: `error-active`, `bus-off` and so on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<&'static str>,
    /// The bit rate, in bit/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bitrate: Option<u32>,
    /// Whether it only listens: it sends neither frames nor acknowledgements.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub listen_only: Option<bool>,
    /// The controller's error counters, where the driver reads them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub errors: Option<Errors>,
}

/// The error counters of a controller (ISO 11898-1).
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
pub struct Errors {
    /// Of transmission.
    pub transmit: u16,
    /// Of reception.
    pub receive: u16,
}

/// What the kernel counted.
#[derive(Serialize, Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct Statistics {
    /// Frames received.
    pub rx_packets: u64,
    /// Errors of reception.
    pub rx_errors: u64,
    /// Frames that were dropped.
    pub rx_dropped: u64,
    /// Frames that the controller had no room for.
    pub rx_over_errors: u64,
    /// Frames sent. Stays where it is while we listen.
    pub tx_packets: u64,
}

/// ARPHRD_CAN of the kernel's if_arp.h.
const ARPHRD_CAN: u32 = 280;

/// The bit rate in commands where none is set: the slowest of DeviceNet, which is the usual one.
pub const USUAL_RATE: u32 = 125_000;

/// IFF_UP of the kernel's if.h.
const IFF_UP: u32 = 1;

impl CanPort {
    /// What it is, in a few words.
    pub fn title(&self) -> String {
        match (&self.driver, self.is_real) {
            (Some(driver), _) => format!("CAN ({driver})"),
            (None, true) => "CAN".to_owned(),
            (None, false) => "virtual CAN".to_owned(),
        }
    }
}

/// The interfaces of a machine.
#[cfg(target_os = "linux")]
pub fn ports(machine: &Machine) -> Vec<CanPort> {
    let interfaces = tree::entries(&machine.path("sys/class/net"));
    let is_can = |place: &Path| tree::number::<u32>(place, "type") == Some(ARPHRD_CAN);
    interfaces
        .into_iter()
        .filter(|(_, place)| is_can(place))
        .map(|(name, place)| port(machine, name, &place))
        .collect()
}

#[cfg(target_os = "linux")]
fn port(machine: &Machine, name: String, place: &Path) -> CanPort {
    let count = |name: &str| tree::number(&place.join("statistics"), name).unwrap_or(0);
    let link = (machine.link)(&name);
    // An slcan interface has no device, but a state: there is an adapter.
    let has_controller = link.as_ref().is_some_and(|link| link.state.is_some());
    let mut port = CanPort {
        source: format!("can:{name}"),
        driver: tree::link(&place.join("device"), "driver"),
        is_real: place.join("device").exists() || has_controller,
        is_up: tree::hex(place, "flags").is_some_and(|flags| flags & IFF_UP != 0),
        link,
        counters: Statistics {
            rx_packets: count("rx_packets"),
            rx_errors: count("rx_errors"),
            rx_dropped: count("rx_dropped"),
            rx_over_errors: count("rx_over_errors"),
            tx_packets: count("tx_packets"),
        },
        is_usable: true,
        obstacles: Vec::new(),
        name,
    };
    port.obstacles.extend(obstacle(&port));
    port.is_usable = usable::is_usable(&port.obstacles);
    port
}

/// What keeps an interface from being listened to, or is to be known.
fn obstacle(port: &CanPort) -> Option<Obstacle> {
    let CanPort { name, is_real, is_up, link, .. } = port;
    let rate = link.as_ref().and_then(|link| link.bitrate).unwrap_or(USUAL_RATE);
    let set_up = format!("ip link set {name} up type can bitrate {rate} listen-only on");
    let listens_only = link.as_ref().and_then(|link| link.listen_only);
    let is_off = link.as_ref().and_then(|link| link.state) == Some("bus-off");
    match (is_real, is_up) {
        (false, false) => Some(Obstacle::stop("it is down", format!("sudo ip link set {name} up"))),
        (false, true) => None,
        (true, false) => Some(Obstacle::stop("it is down", format!("sudo {set_up}"))),
        (true, true) if is_off => Some(Obstacle::stop(
            "it is bus-off: it hears nothing until it is restarted",
            format!("sudo ip link set {name} down && sudo {set_up}"),
        )),
        (true, true) => match listens_only {
            Some(true) => None,
            Some(false) => Some(Obstacle::stop(
                "it is not listen-only: it acknowledges frames, and so takes part in the traffic",
                format!(
                    "sudo ip link set {name} down && sudo {set_up}; or --allow-active, to take \
                     part"
                ),
            )),
            None => Some(Obstacle::warning(
                "whether it is listen-only cannot be told: netlink was refused, or the driver \
                 does not say",
                format!("ip -details link show {name}"),
            )),
        },
    }
}

/// What netlink tells of an interface. Nothing is sent to the bus, and nothing is changed.
#[cfg(target_os = "linux")]
pub fn link(name: &str) -> Option<Link> {
    use socketcan::nl::{CanCtrlMode, CanInterface, CanState};
    let told = CanInterface::open(name).ok()?.can_params().ok()?;
    Some(Link {
        state: told.state.map(|state| match state {
            CanState::ErrorActive => "error-active",
            CanState::ErrorWarning => "error-warning",
            CanState::ErrorPassive => "error-passive",
            CanState::BusOff => "bus-off",
            CanState::Stopped => "stopped",
            CanState::Sleeping => "sleeping",
        }),
        bitrate: told.bit_timing.map(|timing| timing.bitrate).filter(|rate| *rate > 0),
        listen_only: told.ctrl_mode.map(|modes| modes.has_mode(CanCtrlMode::ListenOnly)),
        errors: told
            .berr_counter
            .map(|counter| Errors { transmit: counter.txerr, receive: counter.rxerr }),
    })
}

/// Other systems have no netlink.
#[cfg(not(target_os = "linux"))]
pub fn link(_name: &str) -> Option<Link> {
    None
}
