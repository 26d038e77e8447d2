//! A live tap that was named as if it were a file.

use std::fs;
use std::path::Path;

/// What a CAN interface is to the kernel (`ARPHRD_CAN`, linux/if_arp.h).
const CAN_INTERFACE: &str = "280";

/// How the names of serial ports begin where they are known by name alone: Linux, and macOS.
const SERIAL: [&str; 9] =
    ["ttyUSB", "ttyACM", "ttyAMA", "ttyS", "ttymxc", "ttyTHS", "tty.usb", "cu.usb", "rfcomm"];

/// How those of CAN interfaces begin.
const CAN: [&str; 3] = ["can", "vcan", "slcan"];

/// What to write instead, if the file of that name is a serial port. It is not opened: that alone
/// raises RTS and DTR, and may enable the transmitter of an RS485 adapter.
#[cfg(unix)]
pub fn serial_port(name: &str) -> Option<String> {
    use std::os::unix::fs::{FileTypeExt, MetadataExt};
    let metadata = fs::metadata(name).ok().filter(|it| it.file_type().is_char_device())?;
    let (major, minor) = (rustix::fs::major(metadata.rdev()), rustix::fs::minor(metadata.rdev()));
    is_terminal(name, major, minor).then(|| of_serial(name))
}

/// Windows opens a port of that name as a file.
#[cfg(not(unix))]
pub fn serial_port(name: &str) -> Option<String> {
    is_com_port(name.trim_start_matches(r"\\.\")).then(|| of_serial(name))
}

fn of_serial(name: &str) -> String {
    format!("this is a serial port: write serial:{name} (slcan:{name} for a CAN adapter)")
}

/// Pseudo terminals have no directory in sysfs, but majors of their own (devices.txt: 136 to 143).
#[cfg(target_os = "linux")]
fn is_terminal(_: &str, major: u32, minor: u32) -> bool {
    let class = fs::read_link(format!("/sys/dev/char/{major}:{minor}/subsystem"));
    (136..=143).contains(&major) || class.is_ok_and(|class| class.ends_with("tty"))
}

/// Other systems tell it by the name of the device.
#[cfg(all(unix, not(target_os = "linux")))]
fn is_terminal(name: &str, _: u32, _: u32) -> bool {
    let file = Path::new(name).file_name().unwrap_or_default().to_string_lossy();
    ["tty", "cu"].iter().any(|start| file.starts_with(start))
}

/// What to write instead, if there is no file of that name, but an interface or a port that is
/// called so, or might be.
pub fn tap(name: &str) -> Option<String> {
    tap_below(Path::new("/"), name)
}

/// The same, with the system's directories below `root`.
fn tap_below(root: &Path, name: &str) -> Option<String> {
    let bare = name.strip_prefix("/dev/").unwrap_or(name);
    if bare.is_empty() || bare.starts_with('.') || bare.contains(['/', '\\']) {
        return None;
    }
    let kind = fs::read_to_string(root.join("sys/class/net").join(bare).join("type"));
    let is_can = kind.is_ok_and(|kind| kind.trim() == CAN_INTERFACE);
    let (what, source) = if is_can || (bare == name && is_numbered(bare, &CAN)) {
        ("CAN interface", format!("can:{bare}"))
    } else if is_com_port(bare) {
        ("serial port", format!("serial:{bare}"))
    } else if is_numbered(bare, &SERIAL) || is_terminal_below(root, bare) {
        ("serial port", format!("serial:/dev/{bare}"))
    } else {
        return None;
    };
    Some(format!("for a {what} write {source}; `fieldtap ports` lists what there is"))
}

/// Whether a number follows one of these.
fn is_numbered(name: &str, starts: &[&str]) -> bool {
    let is_number = |rest: &str| !rest.is_empty() && rest.chars().all(|c| c.is_ascii_digit());
    starts.iter().any(|start| name.strip_prefix(start).is_some_and(is_number))
}

fn is_com_port(name: &str) -> bool {
    is_numbered(&name.to_ascii_uppercase(), &["COM"])
}

fn is_terminal_below(root: &Path, name: &str) -> bool {
    root.join("sys/class/tty").join(name).exists() && root.join("dev").join(name).exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interface_and_a_port_are_known_by_what_they_are() {
        let root = tempfile::tempdir().expect("temporary files can be made");
        let write = |path: &str, content: &str| {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().expect("it has one")).expect("it can be made");
            fs::write(path, content).expect("it can be written");
        };
        write("sys/class/net/drives/type", "280\n");
        write("sys/class/net/eth0/type", "1\n");
        write("sys/class/tty/ttyXR7/dev", "");
        write("dev/ttyXR7", "");
        let told = |name: &str| tap_below(root.path(), name);
        let lists = "`fieldtap ports` lists what there is";
        assert_eq!(told("drives"), Some(format!("for a CAN interface write can:drives; {lists}")));
        assert_eq!(
            told("ttyXR7"),
            Some(format!("for a serial port write serial:/dev/ttyXR7; {lists}"))
        );
        for other in ["eth0", "bus.sr", "", "..", "captures/can0"] {
            assert_eq!(told(other), None, "{other}");
        }
    }

    #[test]
    fn what_is_not_plugged_in_is_known_by_its_name() {
        let told = |name: &str| tap_below(Path::new("/nowhere"), name).unwrap_or_default();
        for (name, source) in [
            ("can0", "can:can0;"),
            ("vcan1", "can:vcan1;"),
            ("ttyUSB0", "serial:/dev/ttyUSB0;"),
            ("/dev/ttyACM3", "serial:/dev/ttyACM3;"),
            ("COM3", "serial:COM3;"),
        ] {
            assert!(told(name).contains(source), "{name}: {}", told(name));
        }
        for other in ["can", "canopen.log", "can0.log", "ttyUSB", "COMPARE"] {
            assert_eq!(told(other), "", "{other}");
        }
    }
}
