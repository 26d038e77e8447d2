//! The settings of a port: everything raw, the format, the rate, marks. What was asked for is read
//! back, for drivers drop settings without a word.

use dissectors::uart::{Baud, Format, ParityRule};
use rustix::termios::{
    ControlModes, InputModes, LocalModes, OptionalActions, OutputModes, SpecialCodeIndex, Termios,
    tcgetattr, tcsetattr,
};
use rustix::{fd::BorrowedFd, io};

/// Rates that differ by more are different, in percent: a receiver stands some 4 %.
const SAME_RATE: u64 = 2;

/// What a port made of its settings. It can be listened to.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Kept {
    /// The rate it says that it has.
    pub baud: u32,
    /// It checks parity as asked, and marks what fails.
    pub checks_parity: bool,
    /// It marks what fails.
    pub marks: bool,
    /// What else it did not keep, with the consequences.
    pub losses: Vec<String>,
}

/// Why a port cannot be listened to.
#[derive(Debug)]
pub enum Refusal {
    /// It does not take settings at all.
    Failed(io::Errno),
    /// It does not take what cannot be done without: what, and the consequences.
    Needed(String),
}

/// Input modes that change, swallow or hide what comes.
const HARMFUL_INPUT: [(InputModes, &str); 10] = [
    (InputModes::ISTRIP, "ISTRIP (80h becomes 00h)"),
    (InputModes::IXON, "IXON (11h and 13h are swallowed)"),
    (InputModes::IXOFF, "IXOFF (it sends 11h and 13h of its own)"),
    (InputModes::IXANY, "IXANY"),
    (InputModes::ICRNL, "ICRNL (0Dh becomes 0Ah)"),
    (InputModes::INLCR, "INLCR (0Ah becomes 0Dh)"),
    (InputModes::IGNCR, "IGNCR (0Dh is swallowed)"),
    (InputModes::IUCLC, "IUCLC (41h to 5Ah become 61h to 7Ah)"),
    (InputModes::IGNPAR, "IGNPAR (damaged characters are swallowed)"),
    (InputModes::BRKINT, "BRKINT (a break throws away what came before)"),
];

/// Local modes that answer, or wait for lines.
const HARMFUL_LOCAL: [(LocalModes, &str); 5] = [
    (LocalModes::ECHO, "ECHO (it sends back what it hears)"),
    (LocalModes::ECHONL, "ECHONL (it sends back what it hears)"),
    (LocalModes::ICANON, "ICANON (it waits for lines of text)"),
    (LocalModes::ISIG, "ISIG (03h is taken for Ctrl-C)"),
    (LocalModes::IEXTEN, "IEXTEN (16h is swallowed)"),
];

/// Sets a port and reads back what it made of that.
///
/// # Errors
/// The port cannot be listened to so.
pub fn apply(port: BorrowedFd<'_>, baud: Baud, format: Format) -> Result<Kept, Refusal> {
    let mut settings = tcgetattr(port).map_err(Refusal::Failed)?;
    ask_for(&mut settings, baud, format).map_err(Refusal::Failed)?;
    // Nothing of the driver may be taken over from before: it answers with what it can.
    tcsetattr(port, OptionalActions::Now, &settings).map_err(Refusal::Failed)?;
    judge(&settings, &tcgetattr(port).map_err(Refusal::Failed)?)
}

fn ask_for(settings: &mut Termios, baud: Baud, format: Format) -> io::Result<()> {
    settings.make_raw();
    settings.input_modes -=
        HARMFUL_INPUT.iter().fold(InputModes::IGNBRK, |all, (mode, _)| all | *mode);
    settings.local_modes -=
        HARMFUL_LOCAL.iter().fold(LocalModes::TOSTOP, |all, (mode, _)| all | *mode);
    // Framing errors are marked by these as well, where there is no parity.
    settings.input_modes |= InputModes::INPCK | InputModes::PARMRK;
    settings.output_modes -= OutputModes::OPOST;
    let control = &mut settings.control_modes;
    *control -= ControlModes::CSIZE
        | ControlModes::CSTOPB
        | ControlModes::PARENB
        | ControlModes::PARODD
        | ControlModes::CMSPAR
        | ControlModes::CRTSCTS;
    *control |= ControlModes::CREAD | ControlModes::CLOCAL | format_modes(format);
    settings.special_codes[SpecialCodeIndex::VMIN] = 1;
    settings.special_codes[SpecialCodeIndex::VTIME] = 0;
    settings.set_speed(baud.get())
}

fn format_modes(format: Format) -> ControlModes {
    let size = match format.data_bits() {
        5 => ControlModes::CS5,
        6 => ControlModes::CS6,
        7 => ControlModes::CS7,
        _ => ControlModes::CS8,
    };
    let parity = match format.parity() {
        ParityRule::None => ControlModes::empty(),
        ParityRule::Even => ControlModes::PARENB,
        ParityRule::Odd => ControlModes::PARENB | ControlModes::PARODD,
        ParityRule::Space => ControlModes::PARENB | ControlModes::CMSPAR,
        ParityRule::Mark => ControlModes::PARENB | ControlModes::CMSPAR | ControlModes::PARODD,
    };
    // A receiver looks at the first stop bit only: one more would be asked for in vain.
    size | parity
}

/// What became of the settings.
fn judge(asked: &Termios, got: &Termios) -> Result<Kept, Refusal> {
    let harmful_input = HARMFUL_INPUT.iter().filter(|(mode, _)| got.input_modes.contains(*mode));
    let harmful_local = HARMFUL_LOCAL.iter().filter(|(mode, _)| got.local_modes.contains(*mode));
    let mut harmful: Vec<&str> = harmful_input.map(|(_, what)| *what).collect();
    harmful.extend(harmful_local.map(|(_, what)| *what));
    if got.control_modes.contains(ControlModes::CRTSCTS) {
        harmful.push("CRTSCTS (it switches RTS, and with that an RS485 transmitter)");
    }
    if !harmful.is_empty() {
        return Err(Refusal::Needed(format!("the port keeps {} on", harmful.join(", "))));
    }
    let (wanted, baud) = (asked.output_speed(), got.output_speed());
    if u64::from(wanted.abs_diff(baud)) * 100 > u64::from(wanted) * SAME_RATE {
        let what = format!("the port does not take {wanted} Bd: it stays at {baud} Bd");
        return Err(Refusal::Needed(what));
    }
    let size = |settings: &Termios| settings.control_modes & ControlModes::CSIZE;
    if size(got) != size(asked) {
        let what = "the port does not take so many data bits, and would cut characters in the \
                    wrong place";
        return Err(Refusal::Needed(what.to_owned()));
    }
    let parity = |settings: &Termios| {
        let all = ControlModes::PARENB | ControlModes::PARODD | ControlModes::CMSPAR;
        settings.control_modes & all
    };
    let mut losses = Vec::new();
    let has_parity = asked.control_modes.contains(ControlModes::PARENB);
    let keeps_parity = parity(got) == parity(asked);
    if has_parity && !keeps_parity {
        losses.push("it does not keep the parity setting: the parity of characters is unknown, and a damaged one may pass for good".to_owned());
    }
    let marks = InputModes::INPCK | InputModes::PARMRK;
    let keeps_marks = got.input_modes.contains(marks);
    if !keeps_marks {
        losses.push(
            "it does not keep INPCK and PARMRK: damaged characters are not marked".to_owned(),
        );
    }
    if got.special_codes[SpecialCodeIndex::VMIN] != 1 {
        losses.push("it does not keep VMIN: characters may come late".to_owned());
    }
    Ok(Kept { baud, checks_parity: keeps_parity && keeps_marks, marks: keeps_marks, losses })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::pty::{OpenptFlags, openpt};

    fn termios() -> Termios {
        tcgetattr(openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap())
            .unwrap()
    }

    fn asked(baud: u32, format: &str) -> Termios {
        let mut settings = termios();
        ask_for(&mut settings, Baud::new(baud).unwrap(), format.parse().unwrap()).unwrap();
        settings
    }

    fn refused(got: &Termios) -> String {
        match judge(&asked(115_200, "8E1"), got) {
            Err(Refusal::Needed(what)) => what,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_the_port_keeps_is_good() {
        for (baud, format) in [(345_594, "8E1"), (9_600, "7O1"), (115_200, "8N1"), (19_200, "8M1")]
        {
            let settings = asked(baud, format);
            let kept = Kept { baud, checks_parity: true, marks: true, losses: Vec::new() };
            assert_eq!(judge(&settings, &settings).unwrap(), kept, "{format}");
        }
    }

    #[test]
    fn a_parity_that_sticks_from_before_is_cleared() {
        let mut settings = termios();
        settings.control_modes |= ControlModes::CMSPAR | ControlModes::PARODD;
        settings.input_modes |= InputModes::IGNPAR | InputModes::ISTRIP | InputModes::IXON;
        ask_for(&mut settings, Baud::new(115_200).unwrap(), Format::FT12).unwrap();
        let parity = ControlModes::PARENB | ControlModes::PARODD | ControlModes::CMSPAR;
        assert_eq!(settings.control_modes & parity, ControlModes::PARENB);
        assert_eq!(settings.input_modes, InputModes::INPCK | InputModes::PARMRK);
    }

    #[test]
    fn a_port_without_parity_is_used_and_it_is_said() {
        let asked = asked(115_200, "8E1");
        let mut got = asked.clone();
        got.control_modes -= ControlModes::PARENB;
        let kept = judge(&asked, &got).unwrap();
        assert!(!kept.checks_parity);
        assert!(kept.losses[0].contains("the parity of characters is unknown"), "{kept:?}");
    }

    #[test]
    fn what_falsifies_is_refused() {
        // An 8250 says yes to 345594 Bd and stays where it was.
        let mut got = asked(115_200, "8E1");
        got.set_speed(9_600).unwrap();
        assert_eq!(refused(&got), "the port does not take 115200 Bd: it stays at 9600 Bd");
        let mut got = asked(115_200, "8E1");
        got.local_modes |= LocalModes::ECHO;
        assert_eq!(refused(&got), "the port keeps ECHO (it sends back what it hears) on");
        assert!(refused(&asked(115_200, "7E1")).contains("data bits"));
    }
}
