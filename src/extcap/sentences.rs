//! What we tell Wireshark of ourselves: sentences of words and values in braces, one a line.

use super::tap::{self, NO_PORT, Tap};
use crate::ports::Ports;
use dissectors::protocol::PROTOCOLS;
use dissectors::slin::Profile;
use std::fmt::Write;

/// The control that is the log of the toolbar.
pub const LOG: u8 = 0;

/// The interfaces.
pub fn interfaces() -> String {
    interfaces_of(&tap::ports())
}

fn interfaces_of(ports: &Ports) -> String {
    let mut text = format!(
        "extcap {{version={}}}{{help={}}}{{display=fieldtap}}\n",
        env!("CARGO_PKG_VERSION"),
        env!("CARGO_PKG_REPOSITORY")
    );
    let mut tell = |tap: Tap<'_>, display: String| {
        let _ = writeln!(
            text,
            "interface {{value={}}}{{display={}}}",
            tap.interface(),
            plain(&display)
        );
    };
    for port in &ports.serial {
        tell(Tap::Serial(last_name(&port.name)), format!("fieldtap: {}", port.title()));
    }
    for port in &ports.can {
        tell(Tap::Can(&port.name), format!("fieldtap: {}", port.title()));
    }
    tell(Tap::Any, "fieldtap: field bus".to_owned());
    let _ = writeln!(
        text,
        "control {{number={LOG}}}{{type=button}}{{role=logger}}{{display=Log}}{{tooltip=What fieldtap found out}}"
    );
    text
}

/// The link types of an interface. The capture itself says which it is.
pub fn link_types(interface: &str) -> String {
    let Some(tap) = Tap::named(interface) else { return String::new() };
    let serial = "dlt {number=250}{name=RTAC_SERIAL}{display=serial line}\n";
    let can = "dlt {number=227}{name=CAN_SOCKETCAN}{display=CAN}\n";
    let serial = if tap.may_be_serial() { serial } else { "" };
    let can = if tap.may_be_can() { can } else { "" };
    format!("{serial}{can}")
}

/// The options of an interface.
pub fn options(interface: &str) -> String {
    let Some(tap) = Tap::named(interface) else { return String::new() };
    let mut options = Options::default();
    if tap == Tap::Any {
        options.arg(
            "--tap",
            "Port",
            "{type=selector}{reload=true}{placeholder=Look again}{tooltip=The port to listen on}",
        );
        options.text.push_str(&ports_of(&tap::ports()));
        options.arg(
            "--source",
            "Or any source",
            "{type=string}{tooltip=As fieldtap names it: serial:/dev/ttyUSB0, can:can0, \
             slcan:/dev/ttyACM0, a saved capture. Goes before the port}",
        );
    }
    if let Tap::Serial(_) = tap {
        options.arg("--adapter", "Adapter", "{type=selector}{tooltip=What the port is}");
        options.value("rs485", "RS485: SLIN", true);
        options.value("slcan", "CAN adapter that speaks slcan", false);
    }
    options.arg("--protocol", "Protocol", "{type=selector}{tooltip=What is spoken on the bus}");
    options.value("auto", "auto", true);
    PROTOCOLS.iter().for_each(|protocol| options.value(protocol.name, protocol.name, false));
    if tap.may_be_serial() {
        options.arg("--baud", "Baud rate", &rate("In Bd, such as 115200 or 345594, or auto"));
        options.arg("--profile", "SLIN encoders", "{type=selector}{tooltip=Whose they are}");
        for (name, _) in Profile::NAMES {
            options.value(name, name, name == "auto");
        }
        let bitrate = "Of a CAN adapter on a serial port, in bit/s, such as 125k, or auto";
        options.arg("--bitrate", "CAN bit rate", &rate(bitrate));
    }
    if tap.may_be_can() {
        options.arg(
            "--allow-active",
            "Take part in the traffic",
            "{type=boolflag}{default=false}{tooltip=Listen on a CAN interface that is not \
             listen-only: it acknowledges frames}",
        );
    }
    options.arg(
        "--reconnect",
        "Wait for a tap that vanishes",
        "{type=boolflag}{default=false}{tooltip=And go on when it is back}",
    );
    options.arg(
        "--stations",
        "Stations",
        "{type=fileselect}{mustexist=true}{tooltip=Names and resolutions of stations (TOML)}",
    );
    options.text
}

fn rate(tooltip: &str) -> String {
    // Wireshark wants its backslashes twice.
    format!(
        "{{type=string}}{{default=auto}}{{validation=^(auto|[0-9]+[kM]?)$}}{{tooltip={tooltip}}}"
    )
}

/// The ports as they are now, for the button that looks again.
pub fn ports_now() -> String {
    ports_of(&tap::ports())
}

/// The first option of the interface for all: its number is 0.
fn ports_of(ports: &Ports) -> String {
    let serial = ports.serial.iter().map(|port| (port.source.clone(), port.title()));
    let can = ports.can.iter().map(|port| (port.source.clone(), port.title()));
    let mut values: Vec<(String, String)> = serial.chain(can).collect();
    if values.is_empty() {
        values.push((NO_PORT.to_owned(), "no port: plug one in and look again".to_owned()));
    }
    let mut text = String::new();
    for (index, (source, title)) in values.iter().enumerate() {
        let display = if source == NO_PORT { title.clone() } else { format!("{source} {title}") };
        let is_first = if index == 0 { "{default=true}" } else { "" };
        let _ = writeln!(
            text,
            "value {{arg=0}}{{value={}}}{{display={}}}{is_first}",
            plain(source),
            plain(&display)
        );
    }
    text
}

#[derive(Default)]
struct Options {
    text: String,
    count: usize,
}

impl Options {
    fn arg(&mut self, call: &str, display: &str, rest: &str) {
        let number = self.count;
        self.count += 1;
        let _ = writeln!(
            self.text,
            "arg {{number={number}}}{{call={call}}}{{display={display}}}{rest}"
        );
    }

    /// A value of the option before.
    fn value(&mut self, value: &str, display: &str, is_default: bool) {
        let number = self.count - 1;
        let default = if is_default { "{default=true}" } else { "" };
        let _ = writeln!(
            self.text,
            "value {{arg={number}}}{{value={value}}}{{display={display}}}{default}"
        );
    }
}

/// Adapters say their names themselves: these must end neither the value nor the line.
fn plain(text: &str) -> String {
    crate::terminal::clean(text).replace('{', "(").replace('}', ")")
}

/// Some systems name ports by their whole path, which is no name of an interface.
fn last_name(port: &str) -> &str {
    port.rsplit('/').next().unwrap_or(port)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sentence_is_a_line_of_words_and_values() {
        for interface in ["fieldtap", "fieldtap-serial-ttyUSB0", "fieldtap-can-can0"] {
            let text = [interfaces(), link_types(interface), options(interface)].concat();
            assert!(text.ends_with('\n'));
            for line in text.lines() {
                let (word, values) = line.split_once(' ').expect("a word and values");
                assert!(["extcap", "interface", "control", "dlt", "arg", "value"].contains(&word));
                assert!(values.starts_with('{') && values.ends_with('}'), "{line}");
                let values = &values[1..values.len() - 1];
                for value in values.split("}{") {
                    let (name, value) = value.split_once('=').expect("a name and a value");
                    assert!(!name.is_empty() && !value.contains(['{', '}']), "{line}");
                }
            }
        }
    }

    /// tshark passes only options that have a default, and numbers must go up from 0.
    #[test]
    fn options_are_numbered_and_what_a_capture_needs_has_a_default() {
        let options = options("fieldtap");
        let numbers: Vec<&str> = options.lines().filter(|line| line.starts_with("arg ")).collect();
        for (number, line) in numbers.iter().enumerate() {
            assert!(line.starts_with(&format!("arg {{number={number}}}")), "{line}");
        }
        assert!(options.contains("value {arg=0}{value="), "{options}");
        assert!(options.contains("{call=--baud}{display=Baud rate}{type=string}{default=auto}"));
    }

    #[test]
    fn an_adapter_cannot_break_out_of_its_sentence() {
        assert_eq!(plain("FT}{default=x\nvalue"), "FT)(default=x·value");
    }

    #[test]
    fn what_is_not_ours_has_nothing() {
        assert_eq!(options("eth0") + &link_types("eth0"), "");
    }
}
