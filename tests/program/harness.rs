//! Runs the built program.

use jsonschema::Validator;
use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use tempfile::TempDir;

/// What a run printed, and its exit status.
#[derive(Debug)]
pub struct Run {
    pub stdout: String,
    pub stderr: String,
    pub status: i32,
}

impl Run {
    /// The records of a run with `--format json`, each checked against the schemas.
    pub fn records(&self) -> Vec<Value> {
        let record = |line: &str| {
            let record = serde_json::from_str(line).expect(line);
            for schema in schemas() {
                if let Err(error) = schema.validate(&record) {
                    panic!("{error} in {line}");
                }
            }
            record
        };
        self.stdout.lines().map(record).collect()
    }

    /// The same, of a run that must have succeeded.
    pub fn good(self) -> Run {
        assert_eq!(self.status, 0, "{}", self.stderr);
        self
    }
}

/// The program's own schema of records, and the contract's where it is at hand: it is named by
/// `FIELDTAP_RECORD_SCHEMA`, or looked for beside the project.
fn schemas() -> &'static [Validator] {
    static SCHEMAS: OnceLock<Vec<Validator>> = OnceLock::new();
    SCHEMAS.get_or_init(|| {
        let mut texts = vec![fieldtap(["fields", "--schema"]).good().stdout];
        let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/record.schema.json");
        let contract = std::env::var_os("FIELDTAP_RECORD_SCHEMA").unwrap_or(beside.into());
        match std::fs::read_to_string(&contract) {
            Ok(text) => texts.push(text),
            Err(error) => say(&format!("skipped: no schema at {}: {error}", contract.display())),
        }
        let schema = |text: String| serde_json::from_str(&text).expect("a schema is JSON");
        texts
            .into_iter()
            .map(|t| jsonschema::validator_for(&schema(t)).expect("a schema"))
            .collect()
    })
}

/// Says something that a passing test does not swallow.
pub fn say(message: &str) {
    std::io::stderr().write_all(format!("{message}\n").as_bytes()).expect("stderr is there");
}

/// Runs the program with these arguments.
pub fn fieldtap<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> Run {
    fieldtap_fed(arguments, &[])
}

/// The same, with something on standard input.
pub fn fieldtap_fed<S: AsRef<std::ffi::OsStr>>(
    arguments: impl IntoIterator<Item = S>,
    input: &[u8],
) -> Run {
    let mut child = Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there");
    let mut stdin = child.stdin.take().expect("it is piped");
    let input = input.to_vec();
    let feeder = std::thread::spawn(move || {
        // The program need not read all of it.
        let _ = stdin.write_all(&input);
    });
    let output = child.wait_with_output().expect("it ends");
    feeder.join().expect("the feeder does not panic");
    Run {
        stdout: String::from_utf8(output.stdout).expect("the trace is UTF-8"),
        stderr: String::from_utf8(output.stderr).expect("messages are UTF-8"),
        status: output.status.code().expect("it was not killed"),
    }
}

/// A directory for a test's files, and a file in it.
pub struct Scratch(TempDir);

impl Scratch {
    pub fn new() -> Self {
        Scratch(tempfile::tempdir().expect("temporary files can be made"))
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, content).expect("temporary files can be written");
        path
    }
}

/// A file of the project.
pub fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// A path as an argument.
pub fn argument(path: &Path) -> &str {
    path.to_str().expect("test paths are UTF-8")
}

/// The codes of a record's findings, sorted.
pub fn codes(record: &Value) -> Vec<String> {
    let findings = record["findings"].as_array().expect("findings are an array");
    let code = |finding: &Value| finding["code"].as_str().expect("a code is text").to_owned();
    let mut codes: Vec<String> = findings.iter().map(code).collect();
    codes.sort();
    codes
}
