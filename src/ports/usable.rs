//! Why something cannot be used, and what to do.

use super::Machine;
use super::holder::holders_among;
use serde::Serialize;
use std::fs;
use std::path::Path;

/// What stands in the way.
#[derive(Serialize, Clone, PartialEq, Eq, Debug)]
pub struct Obstacle {
    /// What is the matter.
    pub what: String,
    /// What to do about it: a command, or a word of advice.
    pub remedy: String,
    /// Whether it can be listened to all the same.
    pub is_warning: bool,
}

impl Obstacle {
    /// Something that keeps it from being used.
    pub fn stop(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Obstacle { what: what.into(), remedy: remedy.into(), is_warning: false }
    }

    /// Something to know before using it.
    pub fn warning(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Obstacle { what: what.into(), remedy: remedy.into(), is_warning: true }
    }
}

/// Whether nothing keeps it from being listened to.
pub fn is_usable(obstacles: &[Obstacle]) -> bool {
    obstacles.iter().all(|obstacle| obstacle.is_warning)
}

/// Whether the user may read and write: told without opening anything.
#[cfg(target_os = "linux")]
pub fn may_use(path: &Path) -> bool {
    use rustix::fs::{Access, AtFlags, CWD, accessat};
    accessat(CWD, path, Access::READ_OK | Access::WRITE_OK, AtFlags::EACCESS).is_ok()
}

/// Whether the user may read and write: other systems tell only when it is opened.
#[cfg(not(target_os = "linux"))]
pub fn may_use(_path: &Path) -> bool {
    true
}

/// What keeps the user from a device, if something does.
#[cfg(target_os = "linux")]
pub fn obstacle(machine: &Machine, device: &Path) -> Option<Obstacle> {
    let shown = format!("/{}", device.strip_prefix(&machine.root).unwrap_or(device).display());
    if !device.exists() {
        let remedy = "in a container, pass the device in; else see what udev says: udevadm trigger";
        return Some(Obstacle::stop(format!("there is no {shown}"), remedy));
    }
    if !(machine.may_use)(device) {
        return Some(refusal(&shown, group_of(machine, device)));
    }
    if !machine.asks_who_holds {
        return None;
    }
    let holders = holders_among(&machine.path("proc"), Path::new(&shown));
    (!holders.is_empty()).then(|| {
        let what = format!("in use by {}", holders.join(", "));
        Obstacle::stop(what, "end it: two that read a port get half of the characters each")
    })
}

fn refusal(device: &str, group: Option<String>) -> Obstacle {
    match group {
        Some(group) => Obstacle::stop(
            format!("you may not open it: that is for group {group}"),
            format!("sudo usermod -aG {group} $USER, then log out and in again"),
        ),
        None => Obstacle::stop(
            "you may not open it: that is for its owner only",
            format!("sudo chmod g+rw {device}, or a rule of udev that gives it to a group"),
        ),
    }
}

/// The group that may read from and write to a device.
#[cfg(target_os = "linux")]
fn group_of(machine: &Machine, device: &Path) -> Option<String> {
    use std::os::unix::fs::MetadataExt;
    const GROUP_READS_AND_WRITES: u32 = 0o060;
    let metadata = fs::metadata(device).ok()?;
    let is_open = metadata.mode() & GROUP_READS_AND_WRITES == GROUP_READS_AND_WRITES;
    is_open.then(|| group_name(machine, metadata.gid()))
}

/// The name of a group, else its number.
fn group_name(machine: &Machine, number: u32) -> String {
    let groups = fs::read_to_string(machine.path("etc/group")).unwrap_or_default();
    let name = groups.lines().find_map(|line| {
        let mut parts = line.split(':');
        let name = parts.next()?;
        (parts.nth(1)?.parse() == Ok(number)).then(|| name.to_owned())
    });
    name.unwrap_or_else(|| number.to_string())
}
