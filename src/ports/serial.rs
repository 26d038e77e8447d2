//! Serial ports, as sysfs has them.

use super::Machine;
use super::driver::{self, Counters, Driver, Granularity};
use super::rate::Rate;
use super::tree;
use super::usable::{self, Obstacle};
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};

/// A serial port.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct SerialPort {
    /// As commands want it: `serial:/dev/ttyUSB0`.
    pub source: String,
    /// Its name among the devices: `ttyUSB0`.
    pub name: String,
    /// A name that stays when other adapters are plugged in, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stays: Option<String>,
    /// The kernel's driver.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub driver: Option<String>,
    /// The adapter, where it is on USB.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub usb: Option<Usb>,
    /// Which characters are marked where one has a parity error.
    pub parity: Granularity,
    /// Whether errors are counted.
    pub counters: Counters,
    /// How long an FTDI chip collects characters before it hands them over, in ms, as set now.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latency_timer_ms: Option<u32>,
    /// How many characters a 16550 collects before it hands them over, as set now.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rx_trigger_bytes: Option<u32>,
    /// What comes of usual rates: computed, not measured. Empty where the chip is not known.
    pub rates: Vec<Rate>,
    /// Whether nothing is known to keep it from being listened to.
    #[serde(rename = "usable")]
    pub is_usable: bool,
    /// What stands in the way, and what to know.
    pub obstacles: Vec<Obstacle>,
}

/// An adapter on USB.
#[derive(Serialize, Clone, PartialEq, Eq, Debug)]
pub struct Usb {
    /// Vendor and product, such as `0403:6001`.
    pub id: String,
    /// What it says to be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub product: Option<String>,
    /// Its serial number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub serial: Option<String>,
}

impl SerialPort {
    /// What it is, in a few words.
    pub fn title(&self) -> String {
        let product = self.usb.as_ref().and_then(|usb| usb.product.clone());
        product.unwrap_or_else(|| "serial port".to_owned())
    }
}

/// Latency above which a SLIN answer cannot be timed: half a character at 115200 Bd is far less,
/// but USB has frames of 1 ms.
const LEAST_LATENCY_MS: u32 = 1;

/// The ports of a machine.
#[cfg(target_os = "linux")]
pub fn ports(machine: &Machine, rates: &[u32]) -> Vec<SerialPort> {
    let terminals = tree::entries(&machine.path("sys/class/tty"));
    terminals.into_iter().filter_map(|(name, tty)| port(machine, name, &tty, rates)).collect()
}

/// Where systems do not tell more.
#[cfg(not(target_os = "linux"))]
pub fn ports_of_others() -> Vec<SerialPort> {
    let found = serialport::available_ports().unwrap_or_default();
    let port = |found: serialport::SerialPortInfo| {
        let usb = match found.port_type {
            serialport::SerialPortType::UsbPort(usb) => Some(Usb {
                id: format!("{:04x}:{:04x}", usb.vid, usb.pid),
                product: usb.product,
                serial: usb.serial_number,
            }),
            _ => None,
        };
        SerialPort {
            source: format!("serial:{}", found.port_name),
            name: found.port_name,
            stays: None,
            driver: None,
            usb,
            parity: Granularity::Unknown,
            counters: Counters::Unknown,
            latency_timer_ms: None,
            rx_trigger_bytes: None,
            rates: Vec::new(),
            is_usable: true,
            obstacles: Vec::new(),
        }
    };
    found.into_iter().map(port).collect()
}

/// The port behind a terminal; `None` where there is none: consoles have no device, and the
/// kernel keeps terminals for ports that a PC might have (type 0).
#[cfg(target_os = "linux")]
fn port(machine: &Machine, name: String, tty: &Path, rates: &[u32]) -> Option<SerialPort> {
    let device = fs::canonicalize(tty.join("device")).ok()?;
    if tree::number::<u32>(tty, "type") == Some(0) {
        return None;
    }
    let driver = tree::upwards(&device).take(DEEPEST).find_map(driver_at);
    let driver_name = driver.as_deref().unwrap_or_default();
    let known = Driver::named(driver_name);
    let usb_device =
        tree::upwards(&device).take(DEEPEST).find(|place| place.join("idVendor").exists());
    let divider = match usb_device {
        Some(usb) => driver::divider_of_usb(driver_name, tree::hex(usb, "bcdDevice")),
        None => driver::divider_of_native(driver_name, tty),
    };
    let mut port = SerialPort {
        source: format!("serial:/dev/{name}"),
        stays: stays(machine, &name),
        usb: usb_device.and_then(usb),
        driver,
        parity: known.granularity,
        counters: known.counters,
        latency_timer_ms: tree::number(&device, "latency_timer"),
        rx_trigger_bytes: tree::number(tty, "rx_trig_bytes"),
        rates: divider.map_or(Vec::new(), |by| rates.iter().map(|rate| by.rate(*rate)).collect()),
        is_usable: true,
        obstacles: usable::obstacle(machine, &machine.path("dev").join(&name))
            .into_iter()
            .collect(),
        name,
    };
    let console = tree::text(tty, "console");
    port.obstacles.extend(known_troubles(&port, console.as_deref() == Some("Y")));
    port.is_usable = usable::is_usable(&port.obstacles);
    Some(port)
}

/// Folders from a terminal's device up to its USB device or its controller, at most.
const DEEPEST: usize = 6;

/// The driver bound at a place. Newer kernels put a bus of their own between port and controller.
fn driver_at(place: &Path) -> Option<String> {
    let driver = tree::link(place, "driver")?;
    let subsystem = tree::link(place, "subsystem");
    (subsystem.as_deref() != Some("serial-base")).then_some(driver)
}

fn usb(device: &Path) -> Option<Usb> {
    let (vendor, product) = (tree::hex(device, "idVendor")?, tree::hex(device, "idProduct")?);
    Some(Usb {
        id: format!("{vendor:04x}:{product:04x}"),
        product: tree::text(device, "product"),
        serial: tree::text(device, "serial"),
    })
}

/// The name that udev gave the port by what it is.
#[cfg(target_os = "linux")]
fn stays(machine: &Machine, name: &str) -> Option<String> {
    let names = tree::entries(&machine.path("dev/serial/by-id"));
    let leads_there = |(_, path): &(String, PathBuf)| {
        fs::read_link(path).is_ok_and(|target| target.file_name().is_some_and(|at| at == name))
    };
    let (by_id, _) = names.into_iter().find(leads_there)?;
    Some(format!("serial:/dev/serial/by-id/{by_id}"))
}

/// What to know of a port before listening on it.
fn known_troubles(port: &SerialPort, is_console: bool) -> Vec<Obstacle> {
    let mut troubles = Vec::new();
    match port.parity {
        Granularity::None => troubles.push(Obstacle::warning(
            "a mini UART has no parity: every parity stays unknown",
            "use the full UART: dtoverlay=disable-bt (or miniuart-bt) in config.txt, then \
             serial:/dev/ttyAMA0; or a USB adapter",
        )),
        Granularity::Never => troubles.push(Obstacle::warning(
            "the driver marks no parity errors",
            "where parity matters, use an adapter that marks characters: cp210x, or a native port",
        )),
        Granularity::Character | Granularity::Packet | Granularity::Unknown => {}
    }
    if port.driver.as_deref().is_some_and(driver::is_unproven) {
        troubles.push(Obstacle::warning(driver::UNPROVEN, driver::PROOF));
    }
    if let Some(latency) = port.latency_timer_ms.filter(|latency| *latency > LEAST_LATENCY_MS) {
        troubles.push(Obstacle::warning(
            format!("characters come in lumps of up to {latency} ms, and response times drown"),
            format!(
                "echo 1 | sudo tee /sys/bus/usb-serial/devices/{}/latency_timer (fieldtap sets it \
                 itself where it may)",
                port.name
            ),
        ));
    }
    if let Some(bytes) = port.rx_trigger_bytes.filter(|bytes| *bytes > 1) {
        troubles.push(Obstacle::warning(
            format!("characters come in lumps of {bytes}"),
            format!("echo 1 | sudo tee /sys/class/tty/{}/rx_trig_bytes", port.name),
        ));
    }
    if is_console {
        troubles.push(Obstacle::warning(
            "the kernel writes its messages to this port: they would go out on the bus",
            "take console= with this port from the kernel's command line, or use another port",
        ));
    }
    troubles
}
