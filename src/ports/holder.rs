//! Who has a port open: two readers of one port share its characters out between them.

use super::tree;
use std::fs;
use std::path::Path;

/// The other processes that have this device open, such as `minicom (process 4711)`. Those of other
/// users stay hidden, unless fieldtap runs as root.
pub fn holders(device: &Path) -> Vec<String> {
    holders_among(Path::new("/proc"), device)
}

/// The same, of the processes in this folder.
pub fn holders_among(processes: &Path, device: &Path) -> Vec<String> {
    let own = std::process::id().to_string();
    let is_other = |number: &str| number.bytes().all(|byte| byte.is_ascii_digit()) && number != own;
    tree::entries(processes)
        .into_iter()
        .filter(|(number, process)| is_other(number) && holds(process, device))
        .map(|(number, process)| match tree::text(&process, "comm") {
            Some(name) => format!("{name} (process {number})"),
            None => format!("process {number}"),
        })
        .collect()
}

fn holds(process: &Path, device: &Path) -> bool {
    let mut files = fs::read_dir(process.join("fd")).into_iter().flatten().flatten();
    files.any(|file| fs::read_link(file.path()).is_ok_and(|target| target == device))
}
