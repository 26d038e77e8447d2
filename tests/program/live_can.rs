//! Live CAN taps. Adapters are played on a pseudo terminal, and every byte they are sent is kept.
//! Interfaces need a kernel with CAN.

use crate::harness::{Scratch, argument, codes, fieldtap};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use serde_json::Value;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// An adapter on a pseudo terminal.
struct Adapter {
    path: String,
    heard: Arc<Mutex<Vec<u8>>>,
    is_unplugged: Arc<AtomicBool>,
    player: Option<JoinHandle<()>>,
}

impl Adapter {
    /// One that answers a command with what the script says.
    fn play(mut answer: impl FnMut(&str) -> Vec<u8> + Send + 'static) -> Self {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).expect("there are pseudo terminals");
        grantpt(&master).expect("it is ours");
        unlockpt(&master).expect("it is ours");
        let path = ptsname(&master, Vec::new()).expect("it has a name");
        let path = path.into_string().expect("it is UTF-8");
        rustix::io::ioctl_fionbio(&master, true).expect("it need not wait");
        let heard = Arc::new(Mutex::new(Vec::new()));
        let is_unplugged = Arc::new(AtomicBool::new(false));
        let (keep, is_over) = (Arc::clone(&heard), Arc::clone(&is_unplugged));
        let player = thread::spawn(move || {
            let (mut buffer, mut line) = ([0; 64], Vec::new());
            while !is_over.load(Ordering::Relaxed) {
                // Nothing was written, or nobody has it open yet, or any more.
                let Ok(count) = rustix::io::read(&master, &mut buffer) else {
                    thread::sleep(Duration::from_millis(1));
                    continue;
                };
                keep.lock().expect("nobody panicked").extend(&buffer[..count]);
                for byte in &buffer[..count] {
                    line.push(*byte);
                    if *byte == b'\r' {
                        let command = String::from_utf8_lossy(&line).into_owned();
                        let told = answer(command.trim_end());
                        assert_eq!(rustix::io::write(&master, &told), Ok(told.len()));
                        line.clear();
                    }
                }
            }
        });
        Adapter { path, heard, is_unplugged, player: Some(player) }
    }

    fn source(&self) -> String {
        format!("slcan:{}", self.path)
    }

    /// Every byte that it was sent, with a blank for each end of a command.
    fn heard(&self) -> String {
        let heard = self.heard.lock().expect("nobody panicked");
        String::from_utf8_lossy(&heard).replace('\r', " ")
    }

    /// Waits until it was sent this.
    fn wait_for(&self, told: &str) {
        let begin = Instant::now();
        while !self.heard().ends_with(told) {
            assert!(begin.elapsed() < Duration::from_secs(20), "it heard {}", self.heard());
            thread::sleep(Duration::from_millis(5));
        }
    }

    fn unplug(&mut self) {
        self.is_unplugged.store(true, Ordering::Relaxed);
        if let Some(player) = self.player.take() {
            player.join().expect("it played well");
        }
    }
}

impl Drop for Adapter {
    fn drop(&mut self) {
        self.unplug();
    }
}

/// An adapter that knows every command, and hears this at that bit rate.
fn good(rate: &'static str, hears: &'static [u8]) -> Adapter {
    let mut set = String::new();
    Adapter::play(move |command| match command {
        "V" => b"V1013\r".to_vec(),
        "N" => b"NA123\r".to_vec(),
        "L" if set == rate => [b"\r", hears].concat(),
        command => {
            if command.starts_with('S') {
                set = command.to_owned();
            }
            b"\r".to_vec()
        }
    })
}

fn start(adapter: &Adapter, options: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(["read", &adapter.source(), "--protocol", "can"])
        .args(options)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there")
}

fn interrupt(child: &Child) {
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.expect("kill is there").success());
}

/// Standard output, standard error and exit status.
fn end(child: Child) -> (String, String, Option<i32>) {
    let output = child.wait_with_output().expect("it ends");
    let text = |bytes| String::from_utf8(bytes).expect("it is UTF-8");
    (text(output.stdout), text(output.stderr), output.status.code())
}

#[test]
fn an_adapter_is_set_to_listen_and_its_frames_have_its_times() {
    let adapter = good("S4", b"t3C15F97E1E0000EA5A\rt40D00005\rT1FFFFFFF1000037\r");
    let mut args = vec!["read".to_owned(), adapter.source()];
    let options = "--protocol can --bitrate 125k --format json --count 3";
    args.extend(options.split(' ').map(str::to_owned));
    let run = fieldtap(args).good();
    let records = run.records();
    let of = |key: &str| -> Vec<Value> { records.iter().map(|r| r["can"][key].clone()).collect() };
    assert_eq!(of("id"), [0x3C1, 0x40D, 0x1FFF_FFFF]);
    assert_eq!(of("data"), ["F97E1E0000", "", "00"]);
    let time = |index: usize| records[index]["time_ns"].as_i64().expect("it has a time");
    // From 59994 over the end of the minute to 5, and on to 55.
    assert_eq!([time(1) - time(0), time(2) - time(1)], [11_000_000, 50_000_000]);
    assert!(records.iter().all(|r| r["clock"] == "hardware" && r["uncertainty_ns"] == 1_000_000));
    let note = "adapter V1013 NA123, listen-only, 125000 bit/s, its own time stamps ±1 ms";
    assert!(run.stderr.contains(note), "{}", run.stderr);
    adapter.wait_for("L C ");
    assert_eq!(adapter.heard(), "C V N S4 Z1 L C ");
}

#[test]
fn an_interruption_ends_well_and_takes_the_adapter_off_the_bus() {
    let adapter = good("S6", b"t1230\rt45612\r");
    let child = start(&adapter, &["--bitrate", "500k", "--format", "json"]);
    adapter.wait_for("L ");
    thread::sleep(Duration::from_millis(300));
    interrupt(&child);
    let (trace, told, status) = end(child);
    assert_eq!(status, Some(130), "{told}");
    let kinds: Vec<bool> = trace.lines().map(|line| line.contains("\"kind\":\"lost\"")).collect();
    assert_eq!(kinds, [false, true], "a frame and a loss: {trace}{told}");
    // An odd number of digits.
    assert!(told.contains("not a frame: \"t45612\". Bytes are lost on the port"), "{told}");
    adapter.wait_for("L C ");
    assert_eq!(adapter.heard(), "C V N S6 Z1 L C ");
}

#[test]
fn an_adapter_that_cannot_listen_only_is_refused() {
    let adapter = Adapter::play(|command| match command {
        "L" => b"\x07".to_vec(),
        _ => b"\r".to_vec(),
    });
    let (trace, told, status) = end(start(&adapter, &["--bitrate", "125k", "--allow-active"]));
    assert_eq!((trace.as_str(), status), ("", Some(3)));
    assert!(told.contains("the adapter refuses L, to listen only"), "{told}");
    adapter.wait_for("L C ");
    assert!(!adapter.heard().contains('O'), "{}", adapter.heard());
}

#[test]
fn the_bit_rate_is_found_by_listening() {
    let adapter = good("S5", b"t1230\rt4560\r");
    let (trace, told, status) = end(start(&adapter, &["--count", "2", "--format", "json"]));
    assert_eq!((trace.lines().count(), status), (2, Some(0)), "{told}");
    assert!(told.contains("listen-only, 250000 bit/s"), "{told}");
    adapter.wait_for("L C ");
    assert_eq!(adapter.heard(), "C V N S4 Z1 L C V N S5 Z1 L C ");
}

#[test]
fn an_adapter_that_is_unplugged_is_told() {
    let mut adapter = good("S4", b"t1230\r");
    let child = start(&adapter, &["--bitrate", "125k"]);
    adapter.wait_for("L ");
    thread::sleep(Duration::from_millis(200));
    adapter.unplug();
    let (trace, told, status) = end(child);
    assert_eq!(status, Some(3));
    assert!(trace.contains("123h"), "what came before is good: {trace}");
    assert!(told.contains("the adapter is gone: was it unplugged?"), "{told}");
}

/// A program that listens to what a link leads to, as udev's names do.
fn start_waiting(link: &Path, options: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(["read", &format!("slcan:{}", argument(link)), "--protocol", "can", "--reconnect"])
        .args(options)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there")
}

#[test]
fn an_adapter_that_comes_back_is_listened_to_again() {
    let scratch = Scratch::new();
    let link = scratch.path("adapter");
    let mut first = good("S4", b"t1230\r");
    symlink(&first.path, &link).expect("links can be made");
    let child = start_waiting(&link, &["--bitrate", "125k", "--format", "json"]);
    first.wait_for("L ");
    thread::sleep(Duration::from_millis(300));
    std::fs::remove_file(&link).expect("it is there");
    first.unplug();
    thread::sleep(Duration::from_millis(700));
    let second = good("S4", b"t4560\r");
    symlink(&second.path, &link).expect("links can be made");
    second.wait_for("L ");
    thread::sleep(Duration::from_millis(300));
    interrupt(&child);
    let (trace, told, status) = end(child);
    assert_eq!(status, Some(130), "{told}");
    let records: Vec<Value> =
        trace.lines().map(|line| serde_json::from_str(line).expect("it is JSON")).collect();
    let kinds: Vec<&str> = records.iter().filter_map(|record| record["kind"].as_str()).collect();
    assert_eq!(kinds, ["frame", "lost", "frame"], "{trace}");
    assert_eq!([&records[0]["can"]["id"], &records[2]["can"]["id"]], [0x123, 0x456]);
    assert_eq!(codes(&records[1]), ["can.dropped"]);
    assert!(records[1]["summary"].as_str().expect("text").starts_with("nobody listened"));
    assert!(told.contains("waiting for it to come back"), "{told}");
    assert!(told.contains("the adapter is back"), "{told}");
    assert!(told.contains("-> nobody listened meanwhile: check plug and supply"), "{told}");
    assert!(told.contains("what was on the line while nobody listened, 1 x"), "{told}");
    second.wait_for("L C ");
    assert_eq!(second.heard(), "C V N S4 Z1 L C ");
}

#[test]
fn an_adapter_that_vanishes_while_the_rate_is_looked_for_is_waited_for() {
    let scratch = Scratch::new();
    let link = scratch.path("adapter");
    let mut first = good("S5", b"");
    symlink(&first.path, &link).expect("links can be made");
    let child = start_waiting(&link, &["--count", "1"]);
    first.wait_for("L ");
    std::fs::remove_file(&link).expect("it is there");
    first.unplug();
    // One that cannot listen only is told, and not listened to.
    let mut wrong = Adapter::play(|command| match command {
        "L" => b"\x07".to_vec(),
        _ => b"\r".to_vec(),
    });
    symlink(&wrong.path, &link).expect("links can be made");
    wrong.wait_for("L C ");
    std::fs::remove_file(&link).expect("it is there");
    wrong.unplug();
    let second = good("S4", b"t4560\r");
    symlink(&second.path, &link).expect("links can be made");
    let (trace, told, status) = end(child);
    assert_eq!(status, Some(0), "{told}");
    assert!(trace.contains("456h"), "{trace}");
    let refused = told.matches("it is back, but the adapter refuses L").count();
    assert_eq!(refused, 1, "{told}");
    second.wait_for("L C ");
}

#[test]
fn the_device_that_makes_terminals_is_no_port() {
    for source in ["slcan:/dev/ptmx", "serial:/dev/ptmx"] {
        let run = fieldtap(["read", source]);
        assert_eq!((run.status, run.stdout.as_str()), (3, ""));
        assert!(run.stderr.contains(": this is no serial port: "), "{}", run.stderr);
    }
}

/// It answers each command late, and the last with a refusal.
#[test]
fn a_refusal_after_late_answers_is_a_refusal() {
    let adapter = Adapter::play(|command| {
        thread::sleep(Duration::from_millis(550));
        match command {
            "L" => b"\x07".to_vec(),
            _ => b"\r".to_vec(),
        }
    });
    let (trace, told, status) = end(start(&adapter, &["--bitrate", "125k"]));
    assert_eq!((trace.as_str(), status), ("", Some(3)), "{told}");
    assert!(told.contains("the adapter refuses L, to listen only"), "{told}");
    assert!(!told.contains("listen-only, "), "{told}");
}

/// Bytes that are no slcan: the first bus it could be is not called silent.
#[test]
fn an_adapter_that_cannot_be_read_is_not_called_silent() {
    let adapter = good("S4", b"garbage\r\x07more\r");
    let child = start(&adapter, &["--bitrate", "125k"]);
    adapter.wait_for("L ");
    thread::sleep(Duration::from_millis(1300));
    interrupt(&child);
    let (_, told, _) = end(child);
    assert!(told.contains("bad: no frames that can be read, 1 loss"), "{told}");
    assert!(told.contains("2 lines could not be read"), "{told}");
}

#[test]
fn a_port_and_an_interface_that_are_not_there_are_told() {
    let run = fieldtap(["read", "slcan:/dev/nothere"]);
    assert_eq!(run.status, 3);
    assert!(run.stderr.contains("slcan:/dev/nothere: there is no"), "{}", run.stderr);

    let run = fieldtap(["read", "can:nothere"]);
    assert_eq!((run.status, run.stdout.as_str()), (3, ""));
    let told = "can:nothere: there is no interface nothere; ";
    assert!(run.stderr.contains(told), "{}", run.stderr);
}
