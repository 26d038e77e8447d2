//! The calls that Wireshark makes. Versions add options of their own, and so what is not known is
//! ignored.

use std::ffi::OsString;
use std::path::Path;

/// What is asked for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Verb {
    /// Which interfaces there are.
    Interfaces,
    /// Which link types an interface has.
    Dlts,
    /// Which options an interface has.
    Config,
    /// To capture.
    Capture,
    /// Something that later versions ask.
    Other,
}

/// A call.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Call {
    /// What is asked for.
    pub verb: Verb,
    /// Options that have a value, in their order.
    values: Vec<(String, String)>,
    /// Options without one.
    flags: Vec<String>,
}

/// How the options of calls begin.
const MARKS: [&str; 2] = ["--extcap-", "--capture"];

impl Call {
    /// The call that a command line is, if it is one: `extcap` first, or, as Wireshark does it, no
    /// subcommand at all. `arguments` are those behind the program's name.
    pub fn of(arguments: impl IntoIterator<Item = OsString>) -> Option<Call> {
        let arguments = arguments.into_iter().map(|a| a.to_string_lossy().into_owned());
        let mut arguments: Vec<String> = arguments.collect();
        if arguments.first().is_some_and(|first| first == "extcap") {
            arguments.remove(0);
        }
        let is_mark = |argument: &String| MARKS.iter().any(|mark| argument.starts_with(mark));
        let begins_with_option = arguments.first().is_some_and(|first| first.starts_with("--"));
        (begins_with_option && arguments.iter().any(is_mark)).then(|| Call::parse(&arguments))
    }

    fn parse(arguments: &[String]) -> Call {
        let mut call = Call { verb: Verb::Other, values: Vec::new(), flags: Vec::new() };
        let mut rest = arguments.iter().peekable();
        while let Some(argument) = rest.next() {
            let verb = match argument.as_str() {
                "--extcap-interfaces" => Verb::Interfaces,
                "--extcap-dlts" => Verb::Dlts,
                "--extcap-config" => Verb::Config,
                "--capture" => Verb::Capture,
                _ => Verb::Other,
            };
            if verb != Verb::Other {
                call.verb = verb;
            } else if let Some((name, value)) = argument.split_once('=') {
                call.values.push((name.to_owned(), value.to_owned()));
            } else if let Some(value) = rest.next_if(|next| !next.starts_with("--")) {
                call.values.push((argument.clone(), value.clone()));
            } else {
                call.flags.push(argument.clone());
            }
        }
        call
    }

    /// The value of an option; `None` where it is absent or empty.
    pub fn value(&self, name: &str) -> Option<&str> {
        let (_, value) = self.values.iter().rev().find(|(known, _)| known == name)?;
        Some(value.as_str()).filter(|value| !value.is_empty())
    }

    /// Whether a switch is on. Some versions pass switches with a truth behind them.
    pub fn is_on(&self, name: &str) -> bool {
        self.flags.iter().any(|flag| flag == name) || self.value(name) == Some("true")
    }

    /// The interface that is meant, if any.
    pub fn interface(&self) -> &str {
        self.value("--extcap-interface").unwrap_or_default()
    }

    /// The pipe to write to.
    pub fn fifo(&self) -> Option<&Path> {
        self.value("--fifo").map(Path::new)
    }

    /// The pipes of the toolbar: what it tells us, and what we tell it.
    pub fn controls(&self) -> Option<(&Path, &Path)> {
        let pipe = |name| self.value(name).map(Path::new);
        pipe("--extcap-control-in").zip(pipe("--extcap-control-out"))
    }

    /// Whether the values of one option are to be told anew, for the button that asks for it.
    pub fn asks_for_ports_anew(&self) -> bool {
        self.value("--extcap-reload-option").is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn call(line: &str) -> Option<Call> {
        Call::of(line.split(' ').map(OsString::from))
    }

    /// As tshark 4.0.17 makes them.
    #[test]
    fn calls_are_known_with_and_without_the_subcommand() {
        for before in ["", "extcap "] {
            let verb = |line: &str| call(&format!("{before}{line}")).expect("a call").verb;
            assert_eq!(verb("--extcap-interfaces --extcap-version=4.0"), Verb::Interfaces);
            assert_eq!(verb("--extcap-dlts --extcap-interface fieldtap-can-can0"), Verb::Dlts);
            assert_eq!(verb("--extcap-config --extcap-interface fieldtap"), Verb::Config);
            assert_eq!(verb("--extcap-cleanup-postkill"), Verb::Other);
        }
        for none in ["read --count 3 a.pcapng", "--help", "extcap install", "extcap", ""] {
            assert_eq!(call(none), None, "{none}");
        }
    }

    #[test]
    fn a_capture_has_its_pipes_and_options_and_ignores_what_it_does_not_know() {
        let call = call(
            "--capture --extcap-interface fieldtap-serial-ttyUSB0 --extcap-new thing --fifo /tmp/f \
             --baud 345594 --allow-active --reconnect false --log --extcap-control-in /tmp/i \
             --extcap-control-out /tmp/o",
        )
        .expect("a call");
        assert_eq!(call.verb, Verb::Capture);
        assert_eq!(call.interface(), "fieldtap-serial-ttyUSB0");
        assert_eq!(call.fifo(), Some(Path::new("/tmp/f")));
        assert_eq!(call.controls(), Some((Path::new("/tmp/i"), Path::new("/tmp/o"))));
        assert_eq!((call.value("--baud"), call.value("--profile")), (Some("345594"), None));
        assert!(call.is_on("--allow-active") && !call.is_on("--reconnect"));
    }

    #[test]
    fn an_empty_value_is_none() {
        let arguments = ["--capture", "--stations", "", "--fifo", "f"].map(OsString::from);
        let call = Call::of(arguments).expect("a call");
        assert_eq!(call.value("--stations"), None);
        assert_eq!(call.fifo(), Some(Path::new("f")));
    }
}
