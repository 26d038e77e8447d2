//! Who has a port open: two readers of one port share its characters out between them.

use std::fs;
use std::path::Path;

/// The other processes that have this device open, such as `minicom (4711)`. Those of other users
/// stay hidden, unless fieldtap runs as root.
pub fn holders(device: &Path) -> Vec<String> {
    let own = std::process::id().to_string();
    let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
    processes
        .filter_map(|process| {
            let number = process.file_name().into_string().ok()?;
            let is_process = number.bytes().all(|byte| byte.is_ascii_digit());
            if !is_process || number == own {
                return None;
            }
            let mut files = fs::read_dir(process.path().join("fd")).ok()?.flatten();
            let holds = files.any(|file| fs::read_link(file.path()).is_ok_and(|to| to == device));
            let name = || fs::read_to_string(process.path().join("comm")).unwrap_or_default();
            holds.then(|| format!("{} ({number})", name().trim()))
        })
        .collect()
}
