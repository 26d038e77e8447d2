//! The virtual machine: two emulated CAN cards on one bus, and a stock kernel with its modules.
//!
//! It is emulated throughout (TCG): machines that run tests seldom let others in.

use crate::archive::Archive;
use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What it takes: a program, and the package that has it.
const TOOLS: [(&str, &str); 2] =
    [("qemu-system-x86_64", "qemu-system-x86"), ("busybox", "busybox-static")];

/// A machine that hangs is ended after so many seconds, and those of a soak.
const PATIENCE: u64 = 300;

/// What QEMU returns when the guest says 0 at its exit port: twice that, and one.
const PASSED: i32 = 1;

/// Its first program. It ends with the status of the scenarios, as a byte at the exit port.
const INIT: &str = r#"#!/bin/busybox sh
/bin/busybox --install -s /bin
export PATH=/bin
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t devtmpfs dev /dev
mkdir /dev/pts; mount -t devpts pts /dev/pts
while read -r module; do insmod "$module"; done </modules/order
FIELDTAP_LAB=guest RUST_BACKTRACE=0 "#;
const LAST_WORDS: &str = r#"
status=$?
printf "\\$(printf %03o $status)" | dd of=/dev/port bs=1 seek=244 2>/dev/null
poweroff -f
"#;

pub struct Machine {
    /// Kernel, modules and initramfs.
    lab: PathBuf,
}

impl Machine {
    /// The machine, or nothing if what it takes may be absent and is.
    pub fn find() -> Option<Self> {
        let lab = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/lab");
        let missing = TOOLS.iter().find(|(tool, _)| !is_there(tool));
        let missing = match missing {
            Some((tool, package)) => format!("{tool} is missing: apt-get install {package}"),
            None if !lab.join("modules").exists() => "no kernel yet: run tests/lab/kernel".into(),
            None => return Some(Machine { lab }),
        };
        assert!(
            std::env::var_os("FIELDTAP_PEERS").is_none_or(|peers| peers != "required"),
            "{missing}"
        );
        say(&format!("skipped: {missing}"));
        None
    }

    /// Runs the scenarios of these names in it, all of them where there is none.
    pub fn run(&self, scenarios: &[&str]) {
        let initramfs = self.lab.join("initramfs");
        self.pack(scenarios).write(&initramfs);
        let mut qemu = Command::new("timeout");
        let seconds = PATIENCE + soak().unwrap_or_default();
        qemu.args(["--signal=KILL", &seconds.to_string(), "qemu-system-x86_64"])
            .args(["-machine", "pc", "-accel", "tcg", "-cpu", "max", "-smp", "2", "-m", "512"])
            .args(["-display", "none", "-nodefaults", "-no-user-config", "-no-reboot"])
            .args(["-serial", "stdio", "-monitor", "none"])
            .args(["-device", "isa-debug-exit,iobase=0xf4,iosize=0x04"])
            .args(["-object", "can-bus,id=bus"])
            .args(["-device", "kvaser_pci,canbus=bus", "-device", "kvaser_pci,canbus=bus"])
            .args(["-append", "console=ttyS0 panic=-1 loglevel=2"])
            .arg("-kernel")
            .arg(self.lab.join("vmlinuz"))
            .arg("-initrd")
            .arg(&initramfs)
            .stdin(Stdio::null())
            .stdout(Stdio::piped());
        let mut running = qemu.spawn().expect("QEMU starts");
        let console = BufReader::new(running.stdout.take().expect("it is piped"));
        for line in console.split(b'\n') {
            let line = line.expect("the console can be read");
            say(&format!("  lab: {}", String::from_utf8_lossy(&line).trim_end()));
        }
        let status = running.wait().expect("it ends");
        assert_eq!(status.code(), Some(PASSED), "a scenario failed, or the machine did: see above");
    }

    fn pack(&self, scenarios: &[&str]) -> Archive {
        let mut archive = Archive::default();
        for directory in ["/proc", "/sys", "/dev", "/tmp"] {
            archive.directory(directory);
        }
        let busybox = found("busybox").expect("it was there");
        archive.copy(&busybox, "/bin/busybox");

        let modules = fs::read_to_string(self.lab.join("modules")).expect("they are listed");
        let mut order = String::new();
        for module in modules.lines() {
            let (_, name) = module.rsplit_once('/').expect("a path");
            let place = format!("/modules/{name}");
            archive.copy(&self.lab.join(module), &place);
            order += &format!("{place}\n");
        }
        archive.file("/modules/order", order.as_bytes());

        let scenarist = std::env::current_exe().expect("this program has a path");
        let programs = [Path::new(env!("CARGO_BIN_EXE_fieldtap")), &scenarist];
        for program in programs {
            archive.copy(&self.stripped(program), text(program));
        }
        for library in programs.into_iter().flat_map(libraries).collect::<BTreeSet<_>>() {
            archive.copy(Path::new(&library), &library);
        }
        let soak = soak().map_or(String::new(), |seconds| format!("FIELDTAP_SOAK={seconds} "));
        let (scenarist, scenarios) = (text(&scenarist), scenarios.join(" "));
        let run = format!("{soak}{scenarist} --ignored --test-threads=1 {scenarios}");
        archive.file("/init", [INIT, &run, LAST_WORDS].concat().as_bytes());
        archive
    }

    /// Without what only a debugger needs, which is most of it.
    fn stripped(&self, program: &Path) -> PathBuf {
        let to = self.lab.join(program.file_name().expect("a program has a name"));
        let strip = Command::new("strip").arg("-o").arg(&to).arg(program).status();
        if strip.is_ok_and(|status| status.success()) { to } else { program.to_owned() }
    }
}

/// Seconds that the long scenarios may take, if that was said.
fn soak() -> Option<u64> {
    std::env::var("FIELDTAP_SOAK").ok().map(|seconds| seconds.parse().expect("seconds"))
}

/// The libraries that a program loads, by their paths.
fn libraries(program: &Path) -> Vec<String> {
    let told = Command::new("ldd").arg(program).output().expect("the C library has ldd");
    let told = String::from_utf8(told.stdout).expect("paths are UTF-8");
    let paths = told.split_whitespace().filter(|word| word.starts_with('/'));
    paths.map(str::to_owned).collect()
}

fn is_there(tool: &str) -> bool {
    found(tool).is_some()
}

fn found(tool: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).map(|directory| directory.join(tool)).find(|file| file.exists())
}

fn text(path: &Path) -> &str {
    path.to_str().expect("paths here are UTF-8")
}

/// Says something that a passing test does not swallow.
fn say(message: &str) {
    std::io::stderr().write_all(format!("{message}\n").as_bytes()).expect("stderr is there");
}
