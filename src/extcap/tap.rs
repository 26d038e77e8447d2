//! The interfaces that Wireshark shows: one for each port, and one for all, on which a port can be
//! chosen that was plugged in later, or any source named.

use super::Call;
use crate::ports::{Machine, Ports};

/// The interface for all.
pub const ANY: &str = "fieldtap";

/// How the names of interfaces of serial ports and of CAN begin.
const SERIAL: &str = "fieldtap-serial-";
const CAN: &str = "fieldtap-can-";

/// What Wireshark calls `--tap` where there is no port.
pub const NO_PORT: &str = "none";

/// An interface.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Tap<'a> {
    /// Whatever is chosen.
    Any,
    /// A serial port, by its name.
    Serial(&'a str),
    /// A CAN interface, by its name.
    Can(&'a str),
}

impl<'a> Tap<'a> {
    /// The interface of that name.
    pub fn named(interface: &'a str) -> Option<Tap<'a>> {
        if interface == ANY {
            return Some(Tap::Any);
        }
        let serial = interface.strip_prefix(SERIAL).map(Tap::Serial);
        serial.or_else(|| interface.strip_prefix(CAN).map(Tap::Can))
    }

    /// Its name.
    pub fn interface(self) -> String {
        match self {
            Tap::Any => ANY.to_owned(),
            Tap::Serial(port) => format!("{SERIAL}{port}"),
            Tap::Can(interface) => format!("{CAN}{interface}"),
        }
    }

    /// Whether characters can come of it.
    pub const fn may_be_serial(self) -> bool {
        matches!(self, Tap::Any | Tap::Serial(_))
    }

    /// Whether CAN frames can come of it: adapters that speak slcan are serial ports.
    pub const fn may_be_can(self) -> bool {
        matches!(self, Tap::Any | Tap::Can(_))
    }
}

/// What can be tapped now. Nobody is asked who holds a port: listing must be fast.
pub fn ports() -> Ports {
    Machine::at_a_glance().ports(&[])
}

/// The source that a capture is of, as commands name it.
///
/// # Errors
/// Nothing tells which one, and what to do.
pub fn source(call: &Call) -> Result<String, String> {
    let interface = call.interface();
    match Tap::named(interface) {
        Some(Tap::Serial(port)) => {
            let kind = if call.value("--adapter") == Some("slcan") { "slcan" } else { "serial" };
            let folder = if cfg!(windows) { "" } else { "/dev/" };
            Ok(format!("{kind}:{folder}{port}"))
        }
        Some(Tap::Can(name)) => Ok(format!("can:{name}")),
        Some(Tap::Any) => chosen(call),
        None => Err(format!("there is no interface {interface}: `fieldtap ports` lists them")),
    }
}

fn chosen(call: &Call) -> Result<String, String> {
    let tap = || call.value("--tap").filter(|tap| *tap != NO_PORT);
    if let Some(source) = call.value("--source").or_else(tap) {
        return Ok(source.to_owned());
    }
    Err(choose(ports()))
}

/// How a source is chosen. The only one there is is not taken for the one that is meant: a computer
/// may have a port of its own, and who waits for it to speak sees nothing at all.
fn choose(ports: Ports) -> String {
    let sources = ports.serial.into_iter().map(|port| port.source);
    let sources: Vec<String> = sources.chain(ports.can.into_iter().map(|can| can.source)).collect();
    let first = sources.first().map_or("serial:/dev/ttyUSB0", String::as_str);
    let there = match &sources[..] {
        [] => "there is neither a serial port nor a CAN interface now".to_owned(),
        sources => format!("there is {}", sources.join(", ")),
    };
    format!(
        "choose a source: -o extcap.fieldtap.source:{first} with tshark, the options of the interface \
         in Wireshark; {there}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source_of(line: &str) -> Result<String, String> {
        source(&Call::of(line.split(' ').map(Into::into)).expect("a call"))
    }

    #[test]
    fn the_interface_names_the_source() {
        let of = |interface: &str| {
            source_of(&format!("--capture --extcap-interface {interface} --fifo f"))
        };
        assert_eq!(of("fieldtap-can-can0").as_deref(), Ok("can:can0"));
        let slcan = of("fieldtap-serial-ttyACM0 --adapter slcan");
        let serial = of("fieldtap-serial-ttyUSB0 --adapter rs485");
        if cfg!(unix) {
            assert_eq!(slcan.as_deref(), Ok("slcan:/dev/ttyACM0"));
            assert_eq!(serial.as_deref(), Ok("serial:/dev/ttyUSB0"));
        }
        assert!(of("eth0").is_err());
    }

    #[test]
    fn a_source_that_is_named_goes_before_the_port_that_is_chosen() {
        let any = "--capture --extcap-interface fieldtap --fifo f --tap can:can0";
        assert_eq!(source_of(any).as_deref(), Ok("can:can0"));
        let named = format!("{any} --source a.pcapng");
        assert_eq!(source_of(&named).as_deref(), Ok("a.pcapng"));
    }

    #[test]
    fn nothing_is_listened_to_that_nobody_chose() {
        let any = "--capture --extcap-interface fieldtap --fifo f --baud auto";
        let told = source_of(any).expect_err("nobody said what");
        assert!(told.starts_with("choose a source: -o extcap.fieldtap.source:"), "{told}");
        let none = choose(Ports { serial: Vec::new(), can: Vec::new() });
        assert!(none.contains("source:serial:/dev/ttyUSB0 with tshark"), "{none}");
    }
}
