//! Which options of decoding have no effect on a recording.

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Args, Command};

/// How levels are decoded, which are not recorded, and how records are shown.
const IDLE: [&str; 5] = ["samplerate", "unitsize", "invert", "color", "verbose"];

/// Those that would choose among what is heard: `record` itself says why it does not.
const REFUSED: [&str; 4] = ["from", "to", "count", "fail_on"];

/// Whether an option has no effect. Rings are not recorded either.
pub fn is_idle(option: &Arg) -> bool {
    let of_rings = super::Interbus::augment_args(Command::new("rings"));
    let is_of_rings = of_rings.get_arguments().any(|it| it.get_id() == option.get_id());
    IDLE.contains(&option.get_id().as_str()) || is_of_rings
}

/// Whether an option is refused with a reason of its own.
pub fn is_refused(option: &Arg) -> bool {
    REFUSED.contains(&option.get_id().as_str())
}

/// An option without effect that was given to `record`.
pub fn idle_option(command: &Command, matches: &ArgMatches) -> Option<String> {
    let given = matches.subcommand_matches("record")?;
    let is_given = |option: &&Arg| {
        given.value_source(option.get_id().as_str()) == Some(ValueSource::CommandLine)
    };
    let options = command.find_subcommand("record")?.get_arguments();
    let option = options.filter(|option| is_idle(option)).find(is_given)?;
    Some(option.get_long().unwrap_or(option.get_id().as_str()).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_shows_what_has_an_effect() {
        let mut command = crate::cli::command();
        let record = command.find_subcommand_mut("record").unwrap();
        let ids: Vec<&str> = record.get_arguments().map(|it| it.get_id().as_str()).collect();
        assert!(IDLE.iter().chain(&REFUSED).all(|id| ids.contains(id)), "{ids:?}");
        let help = record.render_long_help().to_string();
        for hidden in ["--count", "--color", "--columns", "--verbose", "--invert", "--from"] {
            assert!(!help.contains(&format!("{hidden} ")), "{hidden}");
        }
        for shown in ["--ring", "--trigger", "--baud", "--protocol", "--limit", "--quiet"] {
            assert!(help.contains(shown), "{shown}");
        }
        assert_eq!(help.matches("    fieldtap record ").count(), 2, "two examples: {help}");
        assert!(crate::cli::command().render_help().to_string().contains("or of a live tap"));
    }
}
