//! Reading sysfs: one value a file, relations as links.

use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Most bytes of an attribute that are believed: sysfs holds a page.
const LONGEST: usize = 4096;

/// The text of an attribute; `None` where there is none, or it is empty.
pub fn text(directory: &Path, name: &str) -> Option<String> {
    let bytes = fs::read(directory.join(name)).ok()?;
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(LONGEST)]).trim().to_owned();
    (!text.is_empty()).then_some(text)
}

/// A number in decimal.
pub fn number<T: FromStr>(directory: &Path, name: &str) -> Option<T> {
    text(directory, name)?.parse().ok()
}

/// A number in hexadecimal, with or without `0x`.
pub fn hex(directory: &Path, name: &str) -> Option<u32> {
    let text = text(directory, name)?;
    u32::from_str_radix(text.trim_start_matches("0x"), 16).ok()
}

/// The last name of what a link leads to.
pub fn link(directory: &Path, name: &str) -> Option<String> {
    let target = fs::read_link(directory.join(name)).ok()?;
    Some(target.file_name()?.to_string_lossy().into_owned())
}

/// What is in a directory, sorted by name with numbers in their order: ttyUSB2 before ttyUSB10.
pub fn entries(directory: &Path) -> Vec<(String, PathBuf)> {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    let mut entries: Vec<(String, PathBuf)> = entries
        .map(|entry| (entry.file_name().to_string_lossy().into_owned(), entry.path()))
        .collect();
    entries.sort_by_cached_key(|(name, _)| {
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
        (stem.to_owned(), name[stem.len()..].parse::<u64>().unwrap_or(0), name.clone())
    });
    entries
}

/// The directory and those above it, to the top.
pub fn upwards(directory: &Path) -> impl Iterator<Item = &Path> {
    directory.ancestors()
}
