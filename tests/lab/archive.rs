//! Archives as the kernel unpacks them into its first file system: cpio, "newc"
//! (`Documentation/driver-api/early-userspace/buffer-format.rst`).

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

const DIRECTORY: u32 = 0o040_755;
const PROGRAM: u32 = 0o100_755;

/// The end is a file of this name.
const END: &str = "TRAILER!!!";

#[derive(Default)]
pub struct Archive {
    bytes: Vec<u8>,
    directories: BTreeSet<String>,
}

impl Archive {
    /// A directory and those that it lies in.
    pub fn directory(&mut self, path: &str) {
        let parts = path.match_indices('/').map(|(end, _)| &path[..end]).chain([path]);
        for directory in parts.filter(|part| !part.is_empty()) {
            if self.directories.insert(directory.to_owned()) {
                self.entry(directory, DIRECTORY, &[]);
            }
        }
    }

    /// A file that may be run, by its absolute path.
    pub fn file(&mut self, path: &str, content: &[u8]) {
        let (directory, _) = path.rsplit_once('/').expect("it is absolute");
        self.directory(directory);
        self.entry(path, PROGRAM, content);
    }

    /// One of the host, at a path.
    pub fn copy(&mut self, from: &Path, path: &str) {
        let content = fs::read(from).unwrap_or_else(|error| panic!("{}: {error}", from.display()));
        self.file(path, &content);
    }

    pub fn write(mut self, to: &Path) {
        self.entry(END, 0, &[]);
        fs::write(to, self.bytes).expect("there is room");
    }

    fn entry(&mut self, path: &str, mode: u32, content: &[u8]) {
        let name = path.trim_start_matches('/');
        let number = self.bytes.len();
        // Number, mode, owner, group, links, time, size, device twice in two parts each, length of
        // the name with its zero, checksum (none).
        let fields =
            [number, mode as usize, 0, 0, 1, 0, content.len(), 0, 0, 0, 0, name.len() + 1, 0];
        self.bytes.extend(b"070701");
        for field in fields {
            self.bytes.extend(format!("{field:08X}").as_bytes());
        }
        self.bytes.extend(name.as_bytes());
        self.bytes.push(0);
        self.pad();
        self.bytes.extend(content);
        self.pad();
    }

    fn pad(&mut self) {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
    }
}
