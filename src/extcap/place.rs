//! Where Wireshark looks for programs that capture, and how fieldtap gets there.

use anyhow::{Context, Result, bail};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Programs that know where Wireshark looks; the last two are not in the search path of most.
const PROGRAMS: [&str; 4] = [
    "tshark",
    "wireshark",
    "/Applications/Wireshark.app/Contents/MacOS/tshark",
    r"C:\Program Files\Wireshark\tshark.exe",
];

/// The user's own folder, as this Wireshark has it.
///
/// # Errors
/// There is no Wireshark, or it does not tell.
pub fn folder() -> Result<PathBuf> {
    let told = PROGRAMS.iter().find_map(|program| {
        let mut command = Command::new(program);
        let command = command.args(["-G", "folders"]).stdin(Stdio::null()).stderr(Stdio::null());
        command.output().ok()
    });
    let told = told.context(
        "neither tshark nor wireshark is among the commands: install Wireshark, or say with \
         --dir where its extcap folder is (Help, About Wireshark, Folders)",
    )?;
    personal(&String::from_utf8_lossy(&told.stdout)).context(
        "`tshark -G folders` names no folder of the user: say with --dir where the extcap folder \
         is (Help, About Wireshark, Folders)",
    )
}

/// The user's folder among those that `-G folders` prints. Since Wireshark 4.2 it is named; before,
/// it is below the personal configuration.
fn personal(told: &str) -> Option<PathBuf> {
    let named = |wanted: &str| {
        let mut lines = told.lines().filter_map(|line| line.split_once(':'));
        let (_, path) = lines.find(|(name, _)| name.trim().eq_ignore_ascii_case(wanted))?;
        Some(path.trim()).filter(|path| !path.is_empty())
    };
    let new = named("Personal Extcap path").map(PathBuf::from);
    new.or_else(|| Some(Path::new(named("Personal configuration")?).join("extcap")))
}

/// What stands in the folder: a link, or on Windows a batch file.
const NAME: &str = if cfg!(windows) { "fieldtap.bat" } else { "fieldtap" };

/// Puts `program` into the folder. Tells what is there now.
///
/// # Errors
/// The folder cannot be written, or something else has the name.
pub fn install(folder: &Path, program: &Path) -> Result<PathBuf> {
    let place = folder.join(NAME);
    let failed = || format!("{}: cannot be written", place.display());
    fs::create_dir_all(folder).with_context(failed)?;
    remove_ours(&place)?;
    put(program, &place).with_context(failed)?;
    Ok(place)
}

/// Takes it out of the folder. `None` if it was not there.
///
/// # Errors
/// It cannot be removed, or something else has the name.
pub fn uninstall(folder: &Path) -> Result<Option<PathBuf>> {
    let place = folder.join(NAME);
    Ok(remove_ours(&place)?.then_some(place))
}

/// Removes what we put there; false if nothing is there.
fn remove_ours(place: &Path) -> Result<bool> {
    if let Err(error) = fs::symlink_metadata(place)
        && error.kind() == io::ErrorKind::NotFound
    {
        return Ok(false);
    }
    if !is_ours(place) {
        bail!("{}: this is not fieldtap's: it is left as it is", place.display());
    }
    fs::remove_file(place).with_context(|| format!("{}: cannot be removed", place.display()))?;
    Ok(true)
}

#[cfg(unix)]
fn put(program: &Path, place: &Path) -> io::Result<()> {
    std::os::unix::fs::symlink(program, place)
}

/// A link to a program of this name, wherever it leads and even if nothing is there any more.
#[cfg(unix)]
fn is_ours(place: &Path) -> bool {
    fs::read_link(place).is_ok_and(|target| target.file_stem().is_some_and(|name| name == NAME))
}

/// The first line of our batch file.
#[cfg(not(unix))]
const MARK: &str = "@rem fieldtap for Wireshark\r\n";

#[cfg(not(unix))]
fn put(program: &Path, place: &Path) -> io::Result<()> {
    fs::write(place, format!("{MARK}@\"{}\" %*\r\n", program.display()))
}

#[cfg(not(unix))]
fn is_ours(place: &Path) -> bool {
    fs::read_to_string(place).is_ok_and(|text| text.starts_with(MARK))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As tshark 4.0.17 prints it, and with the lines that 4.2 has instead of the last.
    #[test]
    fn the_folder_is_where_this_wireshark_has_it() {
        let before = "Temp:                	/tmp\nPersonal configuration:	/home/a/.config/wireshark\n\
                      Global configuration:	/usr/share/wireshark\n";
        let old = format!("{before}Extcap path:         	/usr/lib/wireshark/extcap\n");
        assert_eq!(personal(&old), Some("/home/a/.config/wireshark/extcap".into()));
        let new = format!(
            "{before}Personal Extcap path:	/home/a/.local/lib/wireshark/extcap\nGlobal Extcap \
             path:	/usr/lib/wireshark/extcap\n"
        );
        assert_eq!(personal(&new), Some("/home/a/.local/lib/wireshark/extcap".into()));
        assert_eq!(personal(""), None);
        let windows = "Personal Extcap path:\tC:\\Users\\a\\extcap\n";
        assert_eq!(personal(windows), Some("C:\\Users\\a\\extcap".into()));
    }

    #[cfg(unix)]
    #[test]
    fn what_is_not_ours_stays() {
        let scratch = tempfile::tempdir().expect("temporary files can be made");
        let folder = scratch.path().join("wireshark/extcap");
        assert_eq!(uninstall(&folder).expect("nothing is there"), None);
        // An older program that is gone by now is replaced.
        install(&folder, Path::new("/gone/fieldtap")).expect("it is empty");
        let place = install(&folder, Path::new("/new/fieldtap")).expect("it was ours");
        assert_eq!(fs::read_link(&place).expect("a link"), Path::new("/new/fieldtap"));
        assert_eq!(uninstall(&folder).expect("it is ours"), Some(place.clone()));

        fs::write(&place, "#!/bin/sh\n").expect("it can be written");
        let program = Path::new("/new/fieldtap");
        assert!(install(&folder, program).is_err() && uninstall(&folder).is_err());
        assert_eq!(fs::read_to_string(&place).expect("it is there"), "#!/bin/sh\n");
    }
}
