//! Listings of trees as Linux 6.1 lays them out.

use super::{Counters, Granularity, Link, Machine, Obstacle, Ports, SerialPort};
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use tempfile::TempDir;

const RATES: [u32; 2] = [115_200, 345_594];

/// A machine of the test's own.
struct Fake(TempDir);

impl Fake {
    fn new() -> Self {
        let fake = Fake(tempfile::tempdir().expect("temporary files can be made"));
        for directory in ["sys/class/tty", "sys/class/net", "dev", "proc", "etc"] {
            fake.directory(directory);
        }
        fake.write("etc/group", "root:x:0:\ndialout:x:20:\n");
        // Neither a console nor a ghost of a PC's port is one.
        fake.directory("sys/class/tty/tty1");
        fake.device("devices/platform/serial8250", "platform", "serial8250");
        fake.terminal(
            "ttyS3",
            "devices/platform/serial8250",
            &[("type", "0"), ("uartclk", "1843200")],
        );
        fake
    }

    fn path(&self, path: &str) -> std::path::PathBuf {
        self.0.path().join(path)
    }

    fn directory(&self, path: &str) {
        fs::create_dir_all(self.path(path)).expect("it can be made");
    }

    fn write(&self, path: &str, text: &str) {
        self.directory(Path::new(path).parent().and_then(Path::to_str).expect("UTF-8"));
        fs::write(self.path(path), text).expect("it can be written");
    }

    /// A device below sysfs with subsystem and driver.
    fn device(&self, place: &str, bus: &str, driver: &str) {
        self.directory(&format!("sys/{place}"));
        let link = |name: &str, to: String| {
            symlink(to, self.path(&format!("sys/{place}/{name}"))).expect("links can be made");
        };
        link("subsystem", format!("/sys/bus/{bus}"));
        link("driver", format!("/sys/bus/{bus}/drivers/{driver}"));
    }

    /// A terminal of a device, and its place among the devices.
    fn terminal(&self, name: &str, device: &str, attributes: &[(&str, &str)]) {
        let tty = format!("sys/class/tty/{name}");
        self.directory(&tty);
        let to = self.path(&format!("sys/{device}"));
        symlink(to, self.path(&format!("{tty}/device"))).expect("links can be made");
        for (attribute, value) in attributes {
            self.write(&format!("{tty}/{attribute}"), &format!("{value}\n"));
        }
        self.write(&format!("dev/{name}"), "");
    }

    /// An adapter on USB whose driver makes a terminal.
    fn adapter(&self, name: &str, driver: &str, ids: [&str; 3], product: &str) {
        let usb = "devices/pci0000:00/usb1/1-1";
        self.device(usb, "usb", "usb");
        for (attribute, value) in ["idVendor", "idProduct", "bcdDevice"].iter().zip(ids) {
            self.write(&format!("sys/{usb}/{attribute}"), &format!("{value}\n"));
        }
        self.write(&format!("sys/{usb}/product"), &format!("{product}\n"));
        self.write(&format!("sys/{usb}/serial"), "A5XK3RJT\n");
        let interface = format!("{usb}/1-1:1.0");
        self.device(&interface, "usb", driver);
        let port = format!("{interface}/{name}");
        self.device(&port, "usb-serial", driver);
        self.terminal(name, &port, &[]);
    }

    fn interface(&self, name: &str, flags: &str) {
        let place = format!("sys/class/net/{name}");
        self.write(&format!("{place}/type"), "280\n");
        self.write(&format!("{place}/flags"), flags);
        self.write(&format!("{place}/statistics/rx_packets"), "41212\n");
        self.write(&format!("{place}/statistics/rx_over_errors"), "3\n");
    }

    fn ports_with(&self, may_use: fn(&Path) -> bool, link: fn(&str) -> Option<Link>) -> Ports {
        Machine { root: self.0.path().to_owned(), may_use, link, asks_who_holds: true }
            .ports(&RATES)
    }

    /// The only port.
    fn port(&self) -> SerialPort {
        let mut ports = self.ports_with(|_| true, |_| None).serial;
        assert_eq!(ports.len(), 1, "{ports:?}");
        ports.remove(0)
    }
}

fn whats(obstacles: &[Obstacle]) -> Vec<(&str, bool)> {
    obstacles.iter().map(|obstacle| (obstacle.what.as_str(), obstacle.is_warning)).collect()
}

#[test]
fn an_ftdi_adapter_marks_packets_and_waits_for_its_latency_timer() {
    let fake = Fake::new();
    fake.adapter("ttyUSB0", "ftdi_sio", ["0403", "6001", "0600"], "FT232R USB UART");
    let port = "sys/devices/pci0000:00/usb1/1-1/1-1:1.0/ttyUSB0";
    fake.write(&format!("{port}/latency_timer"), "16\n");
    fake.directory("dev/serial/by-id");
    let by_id = fake.path("dev/serial/by-id/usb-FTDI_FT232R_A5XK3RJT-if00-port0");
    symlink("../../ttyUSB0", by_id).expect("links can be made");

    let port = fake.port();
    assert_eq!(port.source, "serial:/dev/ttyUSB0");
    let stays = port.stays.as_deref();
    assert_eq!(stays, Some("serial:/dev/serial/by-id/usb-FTDI_FT232R_A5XK3RJT-if00-port0"));
    assert_eq!(port.driver.as_deref(), Some("ftdi_sio"));
    let usb = port.usb.clone().expect("it is on USB");
    assert_eq!((usb.id.as_str(), usb.serial.as_deref()), ("0403:6001", Some("A5XK3RJT")));
    assert_eq!((port.parity, port.counters), (Granularity::Packet, Counters::Available));
    assert_eq!(port.latency_timer_ms, Some(16));
    // 3 MHz by 26 and by 8 5/8.
    let real: Vec<_> = port.rates.iter().map(|rate| rate.real).collect();
    assert_eq!(real, [Some(115_385), Some(347_826)]);
    let what = "characters come in lumps of up to 16 ms, and response times drown";
    assert_eq!(whats(&port.obstacles), [(what, true)]);
    assert!(port.obstacles[0].remedy.contains("devices/ttyUSB0/latency_timer"));
    assert!(port.is_usable);
}

#[test]
fn drivers_differ_in_what_they_tell_of_parity() {
    for (driver, parity, counters, warnings) in [
        ("pl2303", Granularity::Packet, Counters::Missing, 0),
        ("cp210x", Granularity::Character, Counters::Available, 1),
        ("ch341-uart", Granularity::Never, Counters::Unknown, 1),
        ("something_new", Granularity::Unknown, Counters::Unknown, 0),
    ] {
        let fake = Fake::new();
        fake.adapter("ttyUSB0", driver, ["067b", "2303", "0300"], "USB-Serial Controller");
        let port = fake.port();
        assert_eq!((port.parity, port.counters), (parity, counters), "{driver}");
        assert_eq!(port.obstacles.len(), warnings, "{driver}");
        assert_eq!(port.rates.len(), if driver == "ch341-uart" { 2 } else { 0 }, "{driver}");
    }
}

/// Since Linux 6.5 the port hangs on a bus of its own below the controller.
#[test]
fn a_native_port_has_a_clock_and_a_trigger() {
    let fake = Fake::new();
    fake.device("devices/pnp0/00:00", "pnp", "serial");
    fake.device("devices/pnp0/00:00/00:00:0", "serial-base", "ctrl");
    fake.device("devices/pnp0/00:00/00:00:0/00:00:0.0", "serial-base", "port");
    let attributes =
        [("type", "4"), ("uartclk", "1843200"), ("rx_trig_bytes", "8"), ("console", "Y")];
    fake.terminal("ttyS0", "devices/pnp0/00:00/00:00:0/00:00:0.0", &attributes);
    let port = fake.port();
    assert_eq!(port.driver.as_deref(), Some("serial"));
    assert_eq!((port.parity, port.rx_trigger_bytes), (Granularity::Character, Some(8)));
    // 1.8432 MHz by 16: 115200 Bd at most.
    let real: Vec<_> = port.rates.iter().map(|rate| rate.real).collect();
    assert_eq!(real, [Some(115_200), None]);
    let [(lumps, true), (console, true)] = whats(&port.obstacles)[..] else {
        panic!("{:?}", port.obstacles)
    };
    assert_eq!(lumps, "characters come in lumps of 8");
    assert!(console.starts_with("the kernel writes its messages"), "{console}");
}

#[test]
fn a_mini_uart_has_no_parity() {
    let fake = Fake::new();
    fake.device("devices/platform/soc/fe215040.serial", "platform", "bcm2835-aux-uart");
    fake.terminal("ttyS0", "devices/platform/soc/fe215040.serial", &[("type", "1")]);
    let port = fake.port();
    assert_eq!(port.parity, Granularity::None);
    assert!(port.is_usable);
    assert!(port.obstacles[0].remedy.contains("disable-bt"), "{:?}", port.obstacles);
}

/// A Raspberry Pi's full UART, at 48 MHz.
#[test]
fn a_pl011_divides_by_64ths() {
    let fake = Fake::new();
    fake.device("devices/platform/soc/fe201000.serial", "amba", "uart-pl011");
    let attributes = [("type", "32"), ("uartclk", "48000000")];
    fake.terminal("ttyAMA0", "devices/platform/soc/fe201000.serial", &attributes);
    let port = fake.port();
    assert_eq!(port.parity, Granularity::Character);
    // 3 MHz by 556/64.
    assert_eq!(port.rates[1].real, Some(345_324));
    assert!(port.obstacles.is_empty(), "{:?}", port.obstacles);
}

/// Rights are told by the group of the device, which in a test is the user's own.
#[test]
fn what_may_not_be_opened_names_the_group_that_may() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let fake = Fake::new();
    fake.adapter("ttyUSB0", "cp210x", ["10c4", "ea60", "0100"], "CP2102");
    let device = fake.path("dev/ttyUSB0");
    let group = fs::metadata(&device).expect("it is there").gid();
    fake.write("etc/group", &format!("other:x:{}:\nbus:x:{group}:me\n", group + 1));
    let told = |mode: u32| {
        fs::set_permissions(&device, fs::Permissions::from_mode(mode)).expect("it is ours");
        let ports = fake.ports_with(|_| false, |_| None);
        assert!(!ports.serial[0].is_usable);
        ports.serial[0].obstacles[0].clone()
    };
    let refused = told(0o660);
    assert_eq!(refused.what, "you may not open it: that is for group bus");
    assert_eq!(refused.remedy, "sudo usermod -aG bus $USER, then log out and in again");
    assert_eq!(told(0o600).what, "you may not open it: that is for its owner only");
}

#[test]
fn who_holds_a_port_is_told() {
    let fake = Fake::new();
    fake.adapter("ttyUSB0", "cp210x", ["10c4", "ea60", "0100"], "CP2102");
    fake.write("proc/4711/comm", "picocom\n");
    fake.directory("proc/4711/fd");
    symlink("/dev/ttyUSB0", fake.path("proc/4711/fd/3")).expect("links can be made");
    fake.directory("proc/12/fd");
    symlink("/dev/ttyUSB01", fake.path("proc/12/fd/3")).expect("links can be made");
    assert_eq!(whats(&fake.port().obstacles)[..1], [("in use by picocom (process 4711)", false)]);
}

/// Asked of the system itself, without opening anything.
#[test]
fn what_is_not_there_may_not_be_used() {
    let fake = Fake::new();
    fake.write("dev/ttyUSB0", "");
    assert!(super::usable::may_use(&fake.path("dev/ttyUSB0")));
    assert!(!super::usable::may_use(&fake.path("dev/ttyUSB1")));
    fake.adapter("ttyUSB2", "cp210x", ["10c4", "ea60", "0100"], "CP2102");
    fs::remove_file(fake.path("dev/ttyUSB2")).expect("it is there");
    assert_eq!(whats(&fake.port().obstacles)[..1], [("there is no /dev/ttyUSB2", false)]);
}

#[test]
fn ports_stand_in_the_order_of_their_numbers() {
    let fake = Fake::new();
    fake.device("devices/platform/soc/uart", "platform", "uart-pl011");
    for name in ["ttyAMA10", "ttyAMA2", "ttyAMA0"] {
        fake.terminal(name, "devices/platform/soc/uart", &[]);
    }
    let ports = fake.ports_with(|_| true, |_| None).serial;
    let names: Vec<&str> = ports.iter().map(|port| port.name.as_str()).collect();
    assert_eq!(names, ["ttyAMA0", "ttyAMA2", "ttyAMA10"]);
}

const UP: &str = "0x40041\n";
const DOWN: &str = "0x40040\n";

fn running(listen_only: bool) -> Option<Link> {
    Some(Link {
        state: Some("error-active"),
        bitrate: Some(125_000),
        listen_only: Some(listen_only),
        errors: None,
    })
}

#[test]
fn a_can_interface_must_be_up_and_listen_only() {
    let fake = Fake::new();
    fake.interface("can0", UP);
    fake.device("devices/platform/can", "platform", "mcp251x");
    symlink(fake.path("sys/devices/platform/can"), fake.path("sys/class/net/can0/device"))
        .expect("links can be made");
    fake.write("sys/class/net/eth0/type", "1\n");
    let told = |link: fn(&str) -> Option<Link>| {
        let mut can = fake.ports_with(|_| true, link).can;
        assert_eq!(can.len(), 1);
        can.remove(0)
    };
    let good = told(|_| running(true));
    assert!(good.is_usable && good.obstacles.is_empty());
    assert_eq!((good.source.as_str(), good.driver.as_deref()), ("can:can0", Some("mcp251x")));
    assert_eq!((good.counters.rx_packets, good.counters.rx_over_errors), (41_212, 3));

    let active = told(|_| running(false));
    assert!(!active.is_usable);
    let remedy = &active.obstacles[0].remedy;
    let set_up = "sudo ip link set can0 up type can bitrate 125000 listen-only on";
    assert!(remedy.contains(set_up) && remedy.contains("--allow-active"), "{remedy}");

    let refused = told(|_| None);
    assert!(refused.is_usable);
    assert!(refused.obstacles[0].what.contains("netlink was refused"));

    let off = told(|_| Some(Link { state: Some("bus-off"), ..running(true)? }));
    assert!(!off.is_usable && off.obstacles[0].remedy.contains("ip link set can0 down"));

    fake.write("sys/class/net/can0/flags", DOWN);
    assert_eq!(whats(&told(|_| running(true)).obstacles), [("it is down", false)]);
    // No rate was ever set: the one that `read can:` proposes too.
    let fresh = told(|_| Some(Link { bitrate: None, ..running(true)? }));
    let remedy = &fresh.obstacles[0].remedy;
    assert!(remedy.contains("bitrate 125000 listen-only on"), "{remedy}");
}

#[test]
fn virtual_can_takes_part_in_nothing() {
    let fake = Fake::new();
    fake.interface("vcan0", UP);
    let vcan = fake.ports_with(|_| true, |_| Some(Link::default())).can.remove(0);
    assert!(vcan.is_usable && !vcan.is_real && vcan.obstacles.is_empty());
    fake.write("sys/class/net/vcan0/flags", DOWN);
    let vcan = fake.ports_with(|_| true, |_| Some(Link::default())).can.remove(0);
    assert_eq!(vcan.obstacles[0].remedy, "sudo ip link set vcan0 up");
}
