//! Wireshark captures through us: real tshark, in a home of the test's own.

use crate::harness::{Scratch, argument, fieldtap, here, say};
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_fieldtap");

/// A home in which Wireshark knows us.
struct Home(Scratch);

impl Home {
    /// `None` where tshark may be absent and is.
    fn new() -> Option<Home> {
        crate::peers::ask("tshark", "tshark", &["--version"])?;
        let home = Home(Scratch::new());
        let installed = home.run(PROGRAM, &["extcap", "install"]);
        assert!(installed.status.success(), "{installed:?}");
        Some(home)
    }

    fn command(&self, program: &str, arguments: &[&str]) -> Command {
        let mut command = Command::new(program);
        command.args(arguments).env("HOME", self.0.path(""));
        for folder in ["XDG_CONFIG_HOME", "XDG_DATA_HOME", "WIRESHARK_EXTCAP_DIR"] {
            command.env_remove(folder);
        }
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn run(&self, program: &str, arguments: &[&str]) -> Output {
        self.command(program, arguments).output().expect("it is there")
    }

    /// tshark capturing from any source, with options of ours.
    fn capture(&self, options: &[(&str, &str)], more: &[&str]) -> Command {
        let set = |(name, value): &(&str, &str)| format!("extcap.fieldtap.{name}:{value}");
        let options: Vec<String> = options.iter().map(set).collect();
        let options = options.iter().flat_map(|option| ["-o", option.as_str()]);
        let arguments = ["-i", "fieldtap", "-l"].into_iter().chain(options).chain(more.to_vec());
        self.command("tshark", &arguments.collect::<Vec<_>>())
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// What a child prints, if it ends in this time.
fn output_within(mut child: Child, limit: Duration) -> Output {
    let begin = Instant::now();
    let (mut stdout, mut stderr) = (child.stdout.take(), child.stderr.take());
    let reader = std::thread::spawn(move || {
        let (mut out, mut err) = (Vec::new(), Vec::new());
        let _ = stdout.as_mut().map(|pipe| pipe.read_to_end(&mut out));
        let _ = stderr.as_mut().map(|pipe| pipe.read_to_end(&mut err));
        (out, err)
    });
    loop {
        if let Some(status) = child.try_wait().expect("it is ours") {
            let (stdout, stderr) = reader.join().expect("it does not panic");
            return Output { status, stdout, stderr };
        }
        if begin.elapsed() > limit {
            child.kill().expect("it is ours");
            panic!("it hangs: {:?}", reader.join().map(|(out, err)| (text(&out), text(&err))));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn end(child: &Child, signal: &str) {
    let killed = Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(killed.expect("kill is there").success());
}

#[test]
fn wireshark_lists_us_where_we_were_installed_and_not_after_we_are_gone() {
    let Some(home) = Home::new() else { return };
    let listed = || text(&home.run("tshark", &["-D"]).stdout);
    assert!(listed().lines().any(|line| line.ends_with("fieldtap (fieldtap: field bus)")));
    // Every sentence is understood: tshark says which are not.
    let told = text(&home.run("tshark", &["-D"]).stderr);
    assert!(!told.contains("invalid") && !told.contains("extcap"), "{told}");
    let removed = home.run(PROGRAM, &["extcap", "install", "--uninstall"]);
    assert!(text(&removed.stdout).starts_with("removed "), "{removed:?}");
    assert!(!listed().contains("fieldtap"));
}

/// Whoever asks for interfaces and options touches no port: opening one raises RTS and DTR.
#[test]
fn listing_opens_no_port() {
    for call in [
        &["--extcap-interfaces", "--extcap-version=4.0"][..],
        &["--extcap-config", "--extcap-interface", "fieldtap"],
        &["--extcap-config", "--extcap-interface", "fieldtap-serial-ttyS0"],
        &["--extcap-dlts", "--extcap-interface", "fieldtap-serial-ttyS0"],
        &["ports"],
    ] {
        let trace = Scratch::new();
        let log = trace.path("calls");
        let strace = ["-f", "-e", "trace=open,openat,openat2,ioctl", "-o", argument(&log), PROGRAM];
        if crate::peers::ask("strace", "strace", &[&strace[..], call].concat()).is_none() {
            return;
        }
        let calls = std::fs::read_to_string(&log).expect("strace wrote it");
        assert!(calls.contains("+++ exited with 0 +++"), "{calls}");
        // What a terminal is asked of standard input and output is no port's business.
        let is_asked_of_a_port = |line: &str| {
            line.contains("ioctl(") && !["(0,", "(1,", "(2,"].iter().any(|fd| line.contains(fd))
        };
        let touched =
            calls.lines().filter(|line| line.contains("\"/dev/tty") || is_asked_of_a_port(line));
        let touched: Vec<&str> = touched.collect();
        assert!(touched.is_empty(), "{call:?}: {touched:?}");
    }
}

/// A SLIN and a CAN capture through `tshark -i`: as many of our comments as we find ourselves.
#[test]
fn wireshark_shows_our_comments_on_what_it_captures() {
    let Some(home) = Home::new() else { return };
    for (capture, code) in [
        ("captures/slin-checksum/checksum.pcapng", "slin.checksum"),
        ("captures/devicenet-error-response/error-response.log", "devicenet.error-response"),
    ] {
        let capture = here(capture);
        let filter = format!("frame.comment contains \"{code}]\"");
        let source = [("source", argument(&capture))];
        let captured =
            home.capture(&source, &["-Y", &filter, "-T", "fields", "-e", "frame.comment"]);
        let captured = { captured }.spawn().expect("tshark is there");
        let captured = output_within(captured, Duration::from_secs(30));
        let shown = text(&captured.stdout);
        let read = fieldtap(["read", "--format", "json", argument(&capture)]).good();
        let has_code = |record: &serde_json::Value| {
            crate::harness::codes(record).iter().any(|found| found == code)
        };
        let ours = read.records().iter().filter(|record| has_code(record)).count();
        let errors = text(&captured.stderr);
        assert!(ours > 0, "{code}");
        assert_eq!(shown.lines().count(), ours, "{shown}{errors}");
        assert!(shown.lines().all(|line| line.starts_with("fieldtap: ")), "{shown}");
        assert!(!errors.contains("Error"), "{errors}");
    }
}

/// Encoder 0 answers 154 (TR SLIN §6), and the next request, which shows that the answer is over.
const HEARD: &str = "time,byte,parity\n0.000000000,80,ok\n0.000345486,1A,ok\n0.000440972,01,ok\n\
                     0.000536458,98,ok\n0.010000000,80,ok\n";

/// A source that goes on: what is written to it is heard at once.
fn line(scratch: &Scratch) -> (PathBuf, File) {
    let path = scratch.path("line");
    let made = Command::new("mkfifo").arg(&path).status().expect("mkfifo is there");
    assert!(made.success());
    // For reading too: opening it does not wait for who reads.
    let file = OpenOptions::new().read(true).write(true).open(&path).expect("it was made");
    (path, file)
}

const SLIN: [(&str, &str); 3] = [("protocol", "slin"), ("profile", "baumer"), ("baud", "115200")];

#[test]
fn packets_come_while_the_bus_goes_on_and_wireshark_stops_us_at_once() {
    let Some(home) = Home::new() else { return };
    let scratch = Scratch::new();
    let (path, mut line) = line(&scratch);
    let options = [&SLIN[..], &[("source", argument(&path))]].concat();
    let mut child = home
        .capture(&options, &["-T", "fields", "-e", "frame.comment"])
        .spawn()
        .expect("tshark is there");
    line.write_all(HEARD.as_bytes()).expect("there is room");
    let mut shown = BufReader::new(child.stdout.take().expect("it is piped")).lines();
    let mut next = || shown.next().expect("there is a packet").expect("it is UTF-8");
    assert!(next().contains("master asks 0"));
    assert!(next().contains("0 answers 154"));
    // Nothing more comes, and the line is still there.
    end(&child, "-INT");
    let begin = Instant::now();
    let ended = output_within(child, Duration::from_secs(10));
    let took = begin.elapsed();
    assert!(took < Duration::from_secs(1), "{took:?}: {}", text(&ended.stderr));
    assert!(!text(&ended.stderr).contains("Error"), "{}", text(&ended.stderr));
}

/// Whether a process of this argument still runs.
fn is_left(argument: &str) -> bool {
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let lines = processes.filter_map(|process| std::fs::read(process.path().join("cmdline")).ok());
    lines.into_iter().any(|line| text(&line).contains(argument))
}

/// A silent bus: there is no packet yet, and not even an interface, when Wireshark stops us.
#[test]
fn wireshark_stops_us_while_nothing_was_heard() {
    let Some(home) = Home::new() else { return };
    let scratch = Scratch::new();
    let (path, _line) = line(&scratch);
    let child = home.capture(&[("source", argument(&path))], &[]).spawn().expect("it is there");
    // tshark's own command line has the path too: it is ours that has both.
    let ours = format!("--source\0{}", argument(&path));
    let begin = Instant::now();
    while !is_left(&ours) && begin.elapsed() < Duration::from_secs(10) {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(500));
    assert!(is_left(&ours), "it listens");
    end(&child, "-INT");
    let begin = Instant::now();
    let ended = output_within(child, Duration::from_secs(10));
    assert!(begin.elapsed() < Duration::from_secs(1), "{:?}", begin.elapsed());
    assert!(!text(&ended.stderr).contains("Error"), "{}", text(&ended.stderr));
    assert!(!is_left(&ours), "it ended before tshark did");
}

#[test]
fn wireshark_shows_what_is_wrong_and_does_not_hang() {
    let Some(home) = Home::new() else { return };
    for (options, told) in [
        (&[("source", "/nowhere/bus.sr")][..], "/nowhere/bus.sr: there is no such file"),
        (&[], "choose a source: -o extcap.fieldtap.source:"),
        (&[("source", "can:nosuchcan0")], "fieldtap: "),
        (&[("source", "a.pcapng"), ("baud", "12x")], "not a rate in Bd"),
    ] {
        let child = home.capture(options, &[]).spawn().expect("tshark is there");
        let ended = output_within(child, Duration::from_secs(10));
        let errors = text(&ended.stderr);
        assert!(errors.contains(told), "{errors}");
    }
}

fn capture_into(fifo: &std::path::Path, source: &std::path::Path) -> Child {
    Command::new(PROGRAM)
        .args(["extcap", "--capture", "--extcap-interface", "fieldtap", "--extcap-future", "1"])
        .args(["--fifo", argument(fifo), "--source", argument(source), "--protocol", "slin"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there")
}

/// Wireshark waits for us to end while it does not read: a full pipe must not hold us.
#[test]
fn a_full_pipe_does_not_keep_us_from_stopping() {
    let scratch = Scratch::new();
    let (fifo, _reader) = line(&scratch);
    let log = "time,byte,parity\n".to_owned()
        + &(0..20_000).map(|n| format!("{n}.0,80,ok\n")).collect::<String>();
    let source = scratch.file("bus.chars", log);
    let mut child = capture_into(&fifo, &source);
    // 64 KiB are in the pipe, and nobody takes them.
    std::thread::sleep(Duration::from_secs(2));
    assert!(child.try_wait().expect("it is ours").is_none(), "it waits for the pipe");
    end(&child, "-TERM");
    let begin = Instant::now();
    let ended = output_within(child, Duration::from_secs(10));
    assert!(begin.elapsed() < Duration::from_secs(1), "{:?}", begin.elapsed());
    assert_eq!((ended.status.code(), text(&ended.stderr)), (Some(0), String::new()));
}

/// Standard error is shown as an error at the end, even of a good capture: warnings must not be
/// there.
#[test]
fn warnings_are_comments_and_never_on_standard_error() {
    let scratch = Scratch::new();
    // A line that is no frame is a warning.
    let log = "(1.000000) can0 42C#010E010101\nnot a frame\n(2.000000) can0 42B#018E3600\n";
    let source = scratch.file("bus.log", log);
    let warned = fieldtap(["read", argument(&source)]);
    assert!(warned.stderr.contains("warning"), "{}", warned.stderr);
    let packets = scratch.file("packets.pcapng", "");
    let ended = output_within(capture_into(&packets, &source), Duration::from_secs(10));
    assert_eq!((ended.status.code(), text(&ended.stderr)), (Some(0), String::new()));
    let bytes = std::fs::read(&packets).expect("it was written");
    assert!(text(&bytes).contains("fieldtap: warning: "), "{}", text(&bytes));
}

/// The log of the toolbar waits until Wireshark is ready for it.
#[test]
fn the_log_of_the_toolbar_tells_what_was_found_out() {
    let scratch = Scratch::new();
    let (from, to) = (scratch.path("from"), scratch.path("to"));
    for pipe in [&from, &to] {
        assert!(Command::new("mkfifo").arg(pipe).status().expect("mkfifo is there").success());
    }
    let open = |path| OpenOptions::new().read(true).write(true).open(path).expect("it was made");
    let (mut toolbar, log) = (open(&from), open(&to));
    toolbar.write_all(b"T\x00\x00\x02\x00\x00").expect("there is room");
    let capture = here("captures/slin-parity/one-station.pcapng");
    let fifo = scratch.file("packets.pcapng", "");
    let ended = Command::new(PROGRAM)
        .args(["--capture", "--extcap-interface", "fieldtap", "--fifo", argument(&fifo)])
        .args(["--extcap-control-in", argument(&from), "--extcap-control-out", argument(&to)])
        .args(["--source", argument(&capture)])
        .output()
        .expect("the program is there");
    assert_eq!((ended.status.code(), text(&ended.stderr)), (Some(0), String::new()));
    let mut told = vec![0; 65_536];
    let count = { log }.read(&mut told).expect("it is ours");
    let told = text(&told[..count]);
    // Add (2) to the log, control 0.
    assert!(told.starts_with('T') && told.contains("\u{0}\u{2}listening to "), "{told}");
    assert!(told.contains("WRONG  3: 17 x parity"), "{told}");
}

/// With tshark, an option without a default is not passed: which port it is must be asked for.
#[test]
fn what_is_listed_is_one_interface_a_port_and_one_for_all() {
    let listed = fieldtap(["--extcap-interfaces", "--extcap-version=4.0"]).good().stdout;
    let interfaces = listed.lines().filter(|line| line.starts_with("interface ")).count();
    let ports = fieldtap(["ports", "--format", "json"]).good().stdout;
    let ports: serde_json::Value = serde_json::from_str(&ports).expect("JSON");
    let count = |kind: &str| ports[kind].as_array().expect("a list").len();
    assert_eq!(interfaces, count("serial") + count("can") + 1, "{listed}");
    assert!(listed.contains("interface {value=fieldtap}"), "{listed}");
    if count("serial") == 0 {
        say("no serial port is here: their interfaces were not seen");
    }
}

#[test]
fn the_manual_and_completions_know_both_commands() {
    let scratch = Scratch::new();
    fieldtap(["man", "--to", argument(&scratch.path(""))]).good();
    let page = |name: &str| std::fs::read_to_string(scratch.path(name)).expect("it was written");
    assert!(page("fieldtap-ports.1").contains("RTS"));
    assert!(page("fieldtap-extcap-install.1").contains("uninstall"));
    let completions = fieldtap(["completions", "bash"]).good().stdout;
    assert!(
        completions.contains("fieldtap__subcmd__ports") || completions.contains("fieldtap__ports")
    );
    assert!(completions.contains("--uninstall"));
}
