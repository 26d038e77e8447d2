//! Ctrl-C, `kill` and a closed terminal: a run ends with its last lines. A second Ctrl-C ends it at
//! once.

use std::io::{self, Read};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// Signals come to the process as a whole.
static CAME: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Those that end a run: Ctrl-C, `kill`, and a terminal that is closed.
#[cfg(unix)]
const SIGNALS: [i32; 3] =
    [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM, signal_hook::consts::SIGHUP];
#[cfg(not(unix))]
const SIGNALS: [i32; 2] = [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM];

/// Catches the signals that end a run from here on. A second Ctrl-C ends the program with this status.
/// What whoever started it has it ignore (`nohup` SIGHUP, a script SIGINT of `command &`) stays ignored.
pub fn catch(status: u8) {
    let came = CAME.get_or_init(Arc::default);
    let ignored = ignored();
    for signal in SIGNALS.into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0) {
        // Where signals cannot be caught, they end the run without last lines.
        if signal == signal_hook::consts::SIGINT {
            let _ = end_at_once(signal, status, Arc::clone(came));
        }
        let _ = signal_hook::flag::register(signal, Arc::clone(came));
    }
}

/// The signals that this process ignores: bit 0 is signal 1 (proc_pid_status(5), `SigIgn`). None where
/// the system does not tell.
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

/// Ends the program with this status where another signal came before. Only a user who presses Ctrl-C
/// once more wants that: a closed terminal sends SIGHUP twice, from the kernel and from the shell.
fn end_at_once(signal: i32, status: u8, came: Arc<AtomicBool>) -> io::Result<()> {
    let status = i32::from(status);
    signal_hook::flag::register_conditional_shutdown(signal, status, came).map(drop)
}

/// From here on, a run also ends when it is told that nobody reads its output. Where that is told
/// by a signal: Wireshark sends it while nothing is being written.
pub fn catch_closed_pipe() {
    #[cfg(unix)]
    {
        let came = CAME.get_or_init(Arc::default);
        let _ = signal_hook::flag::register(signal_hook::consts::SIGPIPE, Arc::clone(came));
    }
}

/// A file that grows beyond what the user's limits allow is an error of writing it, and not the end
/// of the program.
pub fn outlive_limits() {
    #[cfg(unix)]
    {
        // Where the signal cannot be caught, the limit ends the program.
        let nobody = Arc::default();
        let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, nobody);
    }
}

/// Whether one came.
pub fn came() -> bool {
    CAME.get().is_some_and(|came| came.load(Ordering::Relaxed))
}

/// Standard input, a pipe or a device: it ends when the user interrupts, even while nothing comes.
pub struct Live<F>(pub F);

#[cfg(unix)]
impl<F: std::os::fd::AsFd> Read for Live<F> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        use rustix::event::{PollFd, PollFlags, Timespec, poll};
        // A signal ends the wait at once; the time is for one that comes just before it.
        let wait = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };
        while !came() {
            let mut waiting = [PollFd::new(&self.0, PollFlags::IN)];
            match poll(&mut waiting, Some(&wait)) {
                Ok(0) | Err(rustix::io::Errno::INTR) => {}
                // Data, the end, or an error: all of them are for read to tell. Not that of the
                // standard library, whose buffer would hold back what poll waits for.
                Ok(_) | Err(_) => match rustix::io::read(&self.0, &mut *buffer) {
                    // Another reader of the same pipe was faster.
                    Err(rustix::io::Errno::AGAIN) => {}
                    read => return Ok(read?),
                },
            }
        }
        Ok(0)
    }
}

#[cfg(not(unix))]
impl<F: Read> Read for Live<F> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read(buffer)
    }
}
