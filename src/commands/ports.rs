//! `ports`: what can be tapped here, and how good it is.

use crate::ports::{CanPort, Counters, Granularity, Machine, Obstacle, Ports, SerialPort};
use crate::say;
use crate::terminal::clean;
use clap::{Args, ValueEnum};
use std::process::ExitCode;

/// What a listing cannot tell.
const ONLY_OPENED: &str = "No port is opened: that raises RTS and DTR. Only the opened port tells \
                           whether it keeps parity and rate as they were set (a pseudo terminal \
                           does not), whether another user's program has locked it, and, of \
                           drivers that fieldtap does not know, what they mark and count. The \
                           processes that hold a port are seen as far as the user may see them.";

/// How to list.
#[derive(Args, Debug)]
#[command(after_help = ONLY_OPENED)]
pub struct Arguments {
    /// Form of the list.
    #[arg(long, value_name = "FORM", default_value = "text")]
    format: Form,

    /// Tell what becomes of this rate, in Bd (repeatable).
    #[arg(long, value_name = "N", default_values_t = [115_200, 345_594])]
    baud: Vec<u32>,
}

/// The forms of a list.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Form {
    /// For people.
    Text,
    /// One JSON object.
    Json,
}

/// Lists them.
pub fn run(arguments: &Arguments) -> ExitCode {
    let ports = Machine::this().ports(&arguments.baud);
    match arguments.format {
        Form::Text => {
            if ports.serial.is_empty() && ports.can.is_empty() {
                say!("fieldtap: there is neither a serial port nor a CAN interface");
            }
            super::print(&text(&ports))
        }
        Form::Json => match serde_json::to_string_pretty(&ports) {
            Ok(json) => super::print(&(json + "\n")),
            Err(error) => {
                say!("fieldtap: {error}");
                ExitCode::from(crate::decode::FAILED)
            }
        },
    }
}

fn text(ports: &Ports) -> String {
    let serial = ports.serial.iter().map(serial_text);
    serial.chain(ports.can.iter().map(can_text)).collect::<Vec<_>>().join("\n")
}

fn serial_text(port: &SerialPort) -> String {
    let mut lines = Lines::headed(&port.source, &port.title(), port.is_usable);
    let usb = port.usb.iter().flat_map(|usb| {
        let number = usb.serial.as_ref().map(|serial| format!("serial number {serial}"));
        [Some(format!("USB {}", usb.id)), number].into_iter().flatten()
    });
    let driver = port.driver.iter().map(|driver| format!("driver {driver}"));
    lines.tell("adapter", driver.chain(usb).collect::<Vec<_>>().join(", "));
    lines.tell("parity", parity(port.parity));
    lines.tell("errors", counters(port.counters));
    if let Some(latency) = port.latency_timer_ms {
        lines.tell("latency", format!("timer of the chip at {latency} ms"));
    }
    if let Some(bytes) = port.rx_trigger_bytes {
        lines.tell("latency", format!("handed over by {bytes} characters"));
    }
    let rates = port.rates.iter().map(|rate| match (rate.real, rate.error_percent) {
        (Some(real), Some(error)) => format!("{} Bd is {real} ({error:+.2} %)", rate.asked),
        _ => format!("{} Bd cannot be had", rate.asked),
    });
    let rates: Vec<String> = rates.collect();
    if !rates.is_empty() {
        lines.tell("rate", format!("{}; computed, not measured", rates.join(", ")));
    }
    if let Some(name) = &port.stays {
        lines.tell("stays", name);
    }
    lines.end(&port.obstacles)
}

const fn parity(granularity: Granularity) -> &'static str {
    match granularity {
        Granularity::Character => "an error is marked at its character",
        Granularity::Packet => "an error marks all characters of its USB packet: they are suspect",
        Granularity::Never => "errors are not marked: parity stays unknown",
        Granularity::None => "none: parity stays unknown",
        Granularity::Unknown => "only the opened port tells",
    }
}

const fn counters(counters: Counters) -> &'static str {
    match counters {
        Counters::Available => "parity, framing, overrun and break are counted by the driver",
        Counters::Missing => "not counted by the driver: overruns go unnoticed",
        Counters::Unknown => "only the opened port tells whether they are counted",
    }
}

fn can_text(port: &CanPort) -> String {
    let mut lines = Lines::headed(&port.source, &port.title(), port.is_usable);
    let link = port.link.clone().unwrap_or_default();
    let mode = link.listen_only.map(|only| if only { "listen-only" } else { "not listen-only" });
    let state = [
        Some(if port.is_up { "up" } else { "down" }.to_owned()),
        link.state.map(str::to_owned),
        link.bitrate.map(|rate| format!("{rate} bit/s")),
        mode.map(str::to_owned),
    ];
    lines.tell("state", state.into_iter().flatten().collect::<Vec<_>>().join(", "));
    let counted = port.counters;
    lines.tell(
        "frames",
        format!(
            "{} received, {} dropped, {} overran, {} errors, {} sent",
            counted.rx_packets,
            counted.rx_dropped,
            counted.rx_over_errors,
            counted.rx_errors,
            counted.tx_packets
        ),
    );
    if let Some(errors) = link.errors {
        let counters = format!("receive {}, transmit {}", errors.receive, errors.transmit);
        lines.tell("errors", format!("counters of the controller: {counters}"));
    }
    lines.end(&port.obstacles)
}

/// The lines of a port. Adapters say their names themselves: they must not steer the terminal.
struct Lines(String);

impl Lines {
    fn headed(source: &str, title: &str, is_usable: bool) -> Self {
        let verdict = if is_usable { "" } else { "  CANNOT BE USED NOW" };
        Lines(format!("{}  {}{verdict}\n", clean(source), clean(title)))
    }

    fn tell(&mut self, what: &str, value: impl AsRef<str>) {
        if !value.as_ref().is_empty() {
            self.0.push_str(&format!("  {what:<8} {}\n", clean(value.as_ref())));
        }
    }

    fn end(mut self, obstacles: &[Obstacle]) -> String {
        for Obstacle { what, remedy, is_warning } in obstacles {
            let mark = if *is_warning { "W" } else { "E" };
            self.0.push_str(&format!("  {mark} {}\n    -> {}\n", clean(what), clean(remedy)));
        }
        self.0
    }
}
