//! The command line, as the user writes it. What it means is decided in `commands`.

mod interbus;
mod live;
mod record;

pub use interbus::Interbus;
pub use live::Live;

use crate::clock::At;
use crate::source::InputFormat;
use clap::builder::styling::{AnsiColor, Styles};
use clap::error::ErrorKind;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use dissectors::device::Profile as DeviceProfile;
use dissectors::limit::{Limit, limits};
use dissectors::protocol::{PROTOCOLS, Protocol};
use dissectors::slin::checksum::Rule;
use dissectors::slin::{ChecksumChoice, Profile};
use dissectors::uart::{Baud, Format};
use std::path::PathBuf;

const STYLES: Styles = Styles::styled()
    .header(AnsiColor::Yellow.on_default().bold())
    .usage(AnsiColor::Yellow.on_default().bold())
    .literal(AnsiColor::Green.on_default())
    .placeholder(AnsiColor::Cyan.on_default());

/// Listen to encoder field buses and say what went over the wire, whether it was right, and why
/// not.
#[derive(Parser, Debug)]
#[command(name = "fieldtap", version, styles = STYLES, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Subcommand, Debug)]
pub enum Command {
    /// Print the decoded trace of a capture, or of a live tap while it is listened to.
    Read(crate::commands::read::Arguments),
    /// Write what a tap hears to disk, for days: with ring files, or only around events.
    Record(crate::commands::record::Arguments),
    /// Sum a capture up: stations, findings, response times.
    Stats(crate::commands::stats::Arguments),
    /// Write a capture in another container, or several as one.
    Convert(crate::commands::convert::Arguments),
    /// Write a bus with chosen faults as a capture.
    Simulate(crate::commands::simulate::Arguments),
    /// List what can be tapped here: serial ports and CAN interfaces, how good they are, and what to
    /// do where one cannot be used. Opens none of them.
    Ports(crate::commands::ports::Arguments),
    /// Be a capture source of Wireshark.
    ///
    /// `extcap install` makes Wireshark list the serial ports and CAN interfaces of this machine; the
    /// calls that it makes then (--extcap-interfaces, --extcap-config, --capture and so on) are
    /// answered with and without this subcommand.
    Extcap(crate::commands::extcap::Arguments),
    /// Explain a finding: what it means, the rule, what to do at the machine.
    Explain(crate::commands::explain::Arguments),
    /// List every field a column or a script can name.
    Fields(crate::commands::fields::Arguments),
    /// Print completions for a shell.
    Completions(crate::commands::completions::Arguments),
    /// Print the manual page.
    Man(crate::commands::man::Arguments),
}

/// How captures are read: shared by every command that decodes.
#[derive(Args, Debug)]
pub struct Decoding {
    /// Format of the captures, instead of finding it from their content.
    #[arg(long, value_name = "FORMAT", help_heading = "Source")]
    pub input_format: Option<InputFormat>,

    /// Decode only this channel or interface (repeatable). Default: every one with traffic.
    #[arg(long, value_name = "NAME", help_heading = "Source")]
    pub channel: Vec<String>,

    /// Sample rate of captures that do not tell it, such as 4M or 500k.
    #[arg(long, value_name = "HZ", value_parser = frequency, help_heading = "Source")]
    pub samplerate: Option<u64>,

    /// Bytes a sample in raw logic captures.
    #[arg(long, value_name = "BYTES", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=64), help_heading = "Source")]
    pub unitsize: u8,

    /// Protocol on the bus, or auto.
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = protocol_or_auto(), help_heading = "Bus")]
    pub protocol: Auto<&'static Protocol>,

    /// Rate in Bd, or auto.
    #[arg(long, value_name = "N", default_value = "auto", value_parser = auto_or(baud), help_heading = "Bus")]
    pub baud: Auto<Baud>,

    /// CAN: bit rate in bit/s, such as 125k or 500000, or auto.
    #[arg(long, value_name = "N", default_value = "auto", value_parser = auto_or(bitrate), help_heading = "Bus")]
    pub bitrate: Auto<Baud>,

    /// Character format such as 8E1, or auto.
    #[arg(long, value_name = "FORMAT", default_value = "auto", value_parser = auto_or(format), help_heading = "Bus")]
    pub frame: Auto<Format>,

    /// Whether the line is upside down.
    #[arg(long, value_name = "WHEN", default_value = "auto", help_heading = "Bus")]
    pub invert: Invert,

    /// SLIN: whose encoders these are.
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = named(&Profile::NAMES), help_heading = "SLIN")]
    pub profile: Profile,

    /// SLIN: how encoders add up their checksum. Default: as the profile says; with --profile auto
    /// it is found from the traffic, as it is with auto here.
    #[arg(long, value_name = "RULE", value_parser = named(&CHECKSUMS), help_heading = "SLIN")]
    pub checksum: Option<ChecksumChoice>,

    /// Names and resolutions of stations (TOML).
    #[arg(long, value_name = "FILE", help_heading = "Bus")]
    pub stations: Option<PathBuf>,

    /// What a station is, such as 23=baumer-encoder or 1=la66:500mm (repeatable).
    #[arg(long = "device", value_name = "STATION=PROFILE", value_parser = device, help_heading = "Bus")]
    pub devices: Vec<(u16, DeviceProfile)>,

    /// Another limit than the usual one, such as late-response=800. DeviceNet: late-response,
    /// no-response, poll-response, fragment-acknowledge, io-acknowledge, first-timeout, check,
    /// check-spacing, restart in ms; late-production in % of the packet rate; flood in % of the bit
    /// rate. INTERBUS: no-acknowledge, no-release in ms (repeatable).
    #[arg(long = "limit", value_name = "NAME=NUMBER", value_parser = limit, help_heading = "Bus")]
    pub limits: Vec<(&'static Limit, u32)>,

    /// DeviceNet: the maker's description of a device, an EDS file (repeatable).
    #[arg(long, value_name = "FILE", help_heading = "DeviceNet")]
    pub eds: Vec<PathBuf>,

    /// How live taps are listened to.
    #[command(flatten)]
    pub live: Live,

    /// What only INTERBUS has.
    #[command(flatten)]
    pub interbus: Interbus,

    /// How the table shows times.
    #[arg(long, value_name = "STYLE", default_value = "relative", help_heading = "Output")]
    pub time: TimeStyle,

    /// When to use colour.
    #[arg(long, value_name = "WHEN", default_value = "auto", help_heading = "Output")]
    pub color: clap::ColorChoice,

    /// Only records that begin at this time or later: seconds, as the trace shows them, or a time
    /// of day such as 10:41:07 (UTC).
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, help_heading = "Selection")]
    pub from: Option<At>,

    /// Only records that begin before this time.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, help_heading = "Selection")]
    pub to: Option<At>,

    /// Stop after so many records were shown.
    #[arg(long, value_name = "N", help_heading = "Selection")]
    pub count: Option<u64>,

    /// End with exit status 1 if there is a finding at least this bad.
    #[arg(long, value_name = "SEVERITY")]
    pub fail_on: Option<FailOn>,

    /// Say less: only errors on standard error.
    #[arg(short, long)]
    pub quiet: bool,

    /// Say more: the characters below each telegram.
    #[arg(short, long)]
    pub verbose: bool,
}

/// A value, or `auto` to find it out.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Auto<T> {
    /// To be found out.
    Auto,
    /// Given.
    Given(T),
}

impl<T> Auto<T> {
    /// What was given.
    pub fn given(self) -> Option<T> {
        match self {
            Auto::Auto => None,
            Auto::Given(value) => Some(value),
        }
    }
}

/// Whether a line is upside down.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum Invert {
    /// Find out.
    Auto,
    /// It is.
    Yes,
    /// It is not.
    No,
}

/// The severity from which on the exit status is 1.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum FailOn {
    /// Errors.
    Error,
    /// Errors and warnings.
    Warning,
}

/// How times are shown.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum TimeStyle {
    /// Seconds since the capture's start; where it has dates, since its first record.
    Relative,
    /// Date and time of day, where the source has them.
    Absolute,
    /// Seconds since the record before.
    Delta,
}

const CHECKSUMS: [(&str, ChecksumChoice); 4] = [
    ("auto", ChecksumChoice::Auto),
    ("add", ChecksumChoice::Rule(Rule::Add)),
    ("addc", ChecksumChoice::Rule(Rule::Addc)),
    ("addc-sent", ChecksumChoice::Rule(Rule::AddcSent)),
];

/// Parses one of a few names.
fn named<T: Copy + Send + Sync + 'static>(
    names: &'static [(&'static str, T)],
) -> impl clap::builder::TypedValueParser<Value = T> {
    use clap::builder::TypedValueParser;
    clap::builder::PossibleValuesParser::new(names.iter().map(|(name, _)| *name)).map(|name| {
        let found = names.iter().find(|(known, _)| *known == name);
        found.unwrap_or(&names[0]).1
    })
}

/// The command line, without the options that have no effect on what they would stand beside.
pub fn command() -> clap::Command {
    let hide = |argument: clap::Arg| {
        let is_idle = record::is_idle(&argument) || record::is_refused(&argument);
        argument.hide(is_idle)
    };
    Cli::command().mut_subcommand("record", |record| record.mut_args(hide))
}

/// Reads the command line; what is wrong with it is told, and ends the program.
pub fn parse() -> Cli {
    let mut command = with_negative_numbers(command());
    let matches = command.get_matches_mut();
    if let Some(option) = record::idle_option(&command, &matches) {
        let what = format!(
            "--{option} has no effect on a recording, which is not decoded: give it to `read`"
        );
        command.error(ErrorKind::ArgumentConflict, what).exit();
    }
    Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
}

/// Lets -5 be the value of an option, be it to hear what range there is: no option is a digit.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let option = |argument: clap::Arg| match argument.is_positional() {
        true => argument,
        false => {
            let takes_values = argument.get_action().takes_values();
            argument.allow_negative_numbers(takes_values)
        }
    };
    command.mut_args(option).mut_subcommands(with_negative_numbers)
}

fn protocol_or_auto() -> impl clap::builder::TypedValueParser<Value = Auto<&'static Protocol>> {
    use clap::builder::TypedValueParser;
    let names = PROTOCOLS.iter().map(|protocol| protocol.name).chain(["auto"]);
    clap::builder::PossibleValuesParser::new(names)
        .map(|name| Protocol::named(&name).map_or(Auto::Auto, Auto::Given))
}

fn auto_or<T>(
    parse: impl Fn(&str) -> Result<T, String> + Clone,
) -> impl Fn(&str) -> Result<Auto<T>, String> + Clone {
    move |text| if text == "auto" { Ok(Auto::Auto) } else { parse(text).map(Auto::Given) }
}

fn baud(text: &str) -> Result<Baud, String> {
    let rate = text.parse().ok().and_then(Baud::new);
    rate.ok_or_else(|| "not a rate in Bd, such as 115200".to_owned())
}

fn bitrate(text: &str) -> Result<Baud, String> {
    let rate = crate::source::frequency(text).and_then(|rate| u32::try_from(rate).ok());
    let is_possible = |rate: &u32| *rate <= 1_000_000;
    let rate = rate.filter(is_possible).and_then(Baud::new);
    rate.ok_or_else(|| "not a bit rate of CAN, such as 125000 or 500k".to_owned())
}

fn format(text: &str) -> Result<Format, String> {
    text.parse().map_err(|error: dissectors::uart::FormatError| error.to_string())
}

/// The name of a limit and its number.
fn limit(text: &str) -> Result<(&'static Limit, u32), String> {
    let wrong = || {
        let names = limits().map(|limit| format!("{} ({})", limit.name, limit.unit));
        let names: Vec<String> = names.collect();
        format!("not a limit and its number, such as late-response=800: {}", names.join(", "))
    };
    let (name, number) = text.split_once('=').ok_or_else(wrong)?;
    Limit::named(name).zip(number.parse().ok()).ok_or_else(wrong)
}

/// The number of a station and its profile.
fn device(text: &str) -> Result<(u16, DeviceProfile), String> {
    let forms = DeviceProfile::FORMS.join(", ");
    let wrong = || format!("not a station and its profile, such as 23=baumer-encoder: {forms}");
    let (station, profile) = text.split_once('=').ok_or_else(wrong)?;
    let (station, profile): (u16, _) =
        station.parse().ok().zip(DeviceProfile::parse(profile)).ok_or_else(wrong)?;
    match profile.may_be_at(station) {
        true => Ok((station, profile)),
        false => Err(format!("there is no station {station} on the bus of this device")),
    }
}

fn frequency(text: &str) -> Result<u64, String> {
    crate::source::frequency(text)
        .ok_or_else(|| "not a frequency, such as 4M, 500k or 12000000".to_owned())
}
