//! `fieldtap`, listening.

use serde_json::Value;
use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// How long anything may take here: the machine is emulated, and its host has other things to do.
pub const PATIENCE: Duration = Duration::from_secs(20);

/// Who may do nothing.
const NOBODY: u32 = 65534;

const PROGRAM: &str = env!("CARGO_BIN_EXE_fieldtap");

/// A run of the program that goes on.
pub struct Tap {
    program: Child,
    stdout: PathBuf,
    stderr: PathBuf,
}

/// What a run printed, and its exit status.
#[derive(Debug)]
pub struct Run {
    pub records: Vec<Value>,
    pub stderr: String,
    pub status: Option<i32>,
}

impl Tap {
    /// Starts it with these arguments.
    pub fn start(arguments: &[&str]) -> Tap {
        Tap::spawn(&mut reading(arguments))
    }

    /// Starts another command.
    pub fn run(command: &[&str]) -> Tap {
        Tap::spawn(Command::new(PROGRAM).args(command))
    }

    /// The same, and waits until it says that it listens, with these words.
    pub fn listen(arguments: &[&str], words: &str) -> Tap {
        let mut tap = Tap::start(arguments);
        tap.wait_for_words(words);
        tap
    }

    /// The same, without any rights.
    pub fn listen_as_nobody(arguments: &[&str], words: &str) -> Tap {
        let mut tap = Tap::spawn(reading(arguments).uid(NOBODY));
        tap.wait_for_words(words);
        tap
    }

    fn spawn(command: &mut Command) -> Tap {
        super::only_in_the_machine();
        static RUNS: AtomicU32 = AtomicU32::new(0);
        let run = RUNS.fetch_add(1, Ordering::Relaxed);
        let (stdout, stderr) = (format!("/tmp/{run}.stdout"), format!("/tmp/{run}.stderr"));
        let file = |path: &str| File::create(path).expect("there is room");
        let program = command
            .stdin(Stdio::null())
            .stdout(file(&stdout))
            .stderr(file(&stderr))
            .spawn()
            .expect("the program is there");
        Tap { program, stdout: stdout.into(), stderr: stderr.into() }
    }

    /// Waits until it says this.
    pub fn wait_for_words(&mut self, words: &str) {
        self.wait_until(words, |tap| tap.stderr().contains(words));
    }

    /// Waits for so many records of a kind.
    pub fn wait_for(&mut self, count: usize, kind: &str) {
        let key = format!("\"kind\":\"{kind}\"");
        self.wait_until(&format!("{count} of kind {kind}"), |tap| {
            tap.stdout().matches(&key).count() >= count
        });
    }

    /// Waits until something is so.
    pub fn wait_until(&mut self, what: &str, mut is_so: impl FnMut(&Tap) -> bool) {
        let begin = Instant::now();
        while !is_so(self) {
            let status = self.program.try_wait().expect("it can be asked");
            assert!(
                status.is_none() && begin.elapsed() < PATIENCE,
                "waited for {what}: {status:?} {}\n{:?}",
                self.stderr(),
                self.records().last()
            );
            thread::sleep(Duration::from_millis(50));
        }
    }

    /// What it has printed so far; a line that is being written is left out.
    pub fn records(&self) -> Vec<Value> {
        let text = self.stdout();
        let whole = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
        whole.map(|line| serde_json::from_str(line).expect(line)).collect()
    }

    /// The last of them.
    pub fn last(&self) -> Vec<Value> {
        let text = self.stdout();
        let (whole, _) = text.rsplit_once('\n').unwrap_or_default();
        whole
            .lines()
            .last()
            .map(|line| serde_json::from_str(line).expect(line))
            .into_iter()
            .collect()
    }

    fn stdout(&self) -> String {
        fs::read_to_string(&self.stdout).expect("it is there")
    }

    pub fn stderr(&self) -> String {
        fs::read_to_string(&self.stderr).expect("it is there")
    }

    /// What it holds in memory, in KiB.
    pub fn memory(&self) -> u64 {
        let path = format!("/proc/{}/status", self.program.id());
        let status = fs::read_to_string(path).expect("it runs");
        let line = status.lines().find(|line| line.starts_with("VmRSS:")).expect("it is told");
        line.split_whitespace().nth(1).and_then(|kib| kib.parse().ok()).expect("a number")
    }

    /// Processor time that it took so far, its own and the system's (fields 14 and 15 of `proc(5)`).
    /// The kernel counts it in hundredths of a second.
    pub fn processor_time(&self) -> Duration {
        let path = format!("/proc/{}/stat", self.program.id());
        let stat = fs::read_to_string(path).expect("it runs");
        let (_, fields) = stat.rsplit_once(") ").expect("its name is in parentheses");
        let ticks = fields.split(' ').skip(11).take(2).map(|ticks| ticks.parse::<u64>());
        Duration::from_millis(10 * ticks.map(|ticks| ticks.expect("a number")).sum::<u64>())
    }

    pub fn signal(&self, signal: libc::c_int) {
        let id = libc::pid_t::try_from(self.program.id()).expect("an id");
        // SAFETY: no memory is involved.
        assert_eq!(unsafe { libc::kill(id, signal) }, 0);
    }

    /// Interrupts it as Ctrl-C does.
    pub fn stop(self) -> Run {
        self.signal(libc::SIGINT);
        self.ends()
    }

    /// Waits for its end.
    pub fn ends(mut self) -> Run {
        let begin = Instant::now();
        let status = loop {
            if let Some(status) = self.program.try_wait().expect("it can be asked") {
                break status.code();
            }
            assert!(begin.elapsed() < PATIENCE, "it does not end: {}", self.stderr());
            thread::sleep(Duration::from_millis(20));
        };
        // Only `read` prints records.
        let stdout = self.stdout();
        let records = if stdout.starts_with('{') { self.records() } else { Vec::new() };
        Run { records, stderr: self.stderr(), status }
    }
}

fn reading(arguments: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.args(["read", "--format", "json"]).args(arguments);
    command
}

impl Drop for Tap {
    fn drop(&mut self) {
        // It has ended, unless its test failed.
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

/// The sum of what records say was lost.
pub fn lost(records: &[Value]) -> u64 {
    records.iter().filter_map(|record| record["lost"].as_u64()).sum()
}

/// Those of a kind.
pub fn of_kind<'a>(records: &'a [Value], kind: &str) -> Vec<&'a Value> {
    records.iter().filter(|record| record["kind"] == kind).collect()
}

/// The last lines of a recording.
pub fn recorded(tape: &str) -> String {
    let files = fs::read_dir(tape).expect("it was recorded");
    let files: Vec<String> = files
        .map(|file| file.expect("it is there").path().to_str().expect("UTF-8").to_owned())
        .collect();
    let mut arguments = vec!["stats", "--protocol", "can"];
    arguments.extend(files.iter().map(String::as_str));
    Tap::run(&arguments).ends().stderr
}
