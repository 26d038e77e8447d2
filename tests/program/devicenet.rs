//! Thousands of random exchanges on DeviceNet: each frame is told as it was meant, each fault that
//! the simulator injects is found, and nothing else.

use crate::account::{Compared, check};

const MODES: [&str; 4] = ["poll", "cos", "cyclic", "strobe"];

/// Runs of `check`, on as many threads as there are processors, and how much they compared.
fn check_all(runs: &[(&str, String, Vec<String>)]) -> Compared {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let check_some = |turn: usize| {
        let mut sum = Compared::default();
        for (form, simulate, read) in runs.iter().skip(turn).step_by(threads) {
            let simulate: Vec<&str> = simulate.split_whitespace().collect();
            let read: Vec<&str> = read.iter().map(String::as_str).collect();
            sum.add(&check(form, &simulate, &read));
        }
        sum
    };
    std::thread::scope(|scope| {
        let check_some = &check_some;
        let spawn = |turn| scope.spawn(move || check_some(turn));
        let workers: Vec<_> = (0..threads).map(spawn).collect();
        let mut sum = Compared::default();
        for worker in workers {
            sum.add(&worker.join().expect("what was told is what happened"));
        }
        sum
    })
}

/// Encoders that must be known as such although the capture does not show what they are.
fn devices(macs: &[u8]) -> Vec<String> {
    let named = macs.iter().map(|mac| format!("{mac}=baumer-encoder"));
    named.flat_map(|device| ["--device".to_owned(), device]).collect()
}

#[test]
fn a_healthy_bus_is_told_as_it_is_in_every_mode() {
    let mut runs = Vec::new();
    for (seed, mode) in (1..).zip(MODES) {
        for (turn, options) in [
            "",
            "--no-acknowledge --steps-per-turn 3600 --total-resolution 921600",
            "--bitrate 500k --heartbeat 1 --packet-rate 203 --assembly 2 --master 62",
            "--errands 60 --motion still",
        ]
        .into_iter()
        .enumerate()
        {
            let seed = 10 * seed + turn;
            let plan = format!("--mode {mode} --seed {seed} --scan 40 --duration 9 {options}");
            runs.push(("log", plan.clone(), Vec::new()));
            if turn == 1 {
                runs.push(("log", format!("{plan} --late-start"), devices(&[5, 7, 23])));
            }
        }
    }
    let compared = check_all(&runs);
    assert_eq!((compared.faults, compared.findings), (0, 0));
    assert!(compared.frames > 12_000 && compared.answers > 6_000, "{compared:?}");
    assert!(compared.values > 600 && compared.messages > 100, "{compared:?}");
}

/// Each fault alone: its order, for how long, and what else it needs.
const FAULTS: [(&str, u32, &str); 49] = [
    ("error-frame=0.05", 8, ""),
    ("stuff=0.05", 8, ""),
    ("form=0.05", 8, ""),
    ("crc=0.05", 8, ""),
    ("overload=0.05", 8, ""),
    ("malformed=0.5", 8, ""),
    ("reserved-id=0.3", 8, ""),
    ("foreign-frame=0.3", 8, ""),
    ("duplicate-mac=0.3", 16, ""),
    ("node-restart=0.2", 20, ""),
    ("shutdown=0.2", 20, ""),
    ("device-fault=0.5", 12, ""),
    ("allocation-refused=0.3", 8, ""),
    ("allocation-invalid=0.3", 8, ""),
    ("no-response=0.3", 12, ""),
    ("late-response=0.3", 12, ""),
    ("unsolicited-response=0.3", 8, ""),
    ("error-response=0.5", 8, ""),
    ("xid-busy=0.5", 8, ""),
    ("fragment-sequence=0.5", 16, "--motion still"),
    ("fragment-retry=0.5", 16, "--motion still"),
    ("fragment-unacknowledged=0.5", 16, "--motion still"),
    ("fragment-rejected=0.5", 16, "--motion still"),
    ("no-poll-response=0.05", 8, ""),
    ("no-strobe-response=0.05", 8, "--mode strobe"),
    ("size-mismatch=0.05", 8, ""),
    ("size-mismatch=0.05", 8, "--mode cos"),
    ("idle=0.05", 8, ""),
    ("idle=0.05", 8, "--mode cyclic"),
    ("connection-timeout=0.5", 14, ""),
    ("connection-timeout=0.5", 14, "--mode strobe"),
    ("not-allocated=0.5", 12, ""),
    ("not-allocated=0.5", 12, "--mode cos"),
    ("late-production=0.1", 12, "--mode cyclic"),
    ("late-production=0.1", 12, "--mode cos"),
    ("inhibit-violated=0.02", 10, "--mode cos"),
    ("delta-ignored=0.02", 10, "--mode cos"),
    ("io-unacknowledged=0.1", 10, "--mode cos"),
    ("unexpected-ack=0.1", 10, "--mode cyclic --no-acknowledge"),
    ("alarm=0.2", 14, ""),
    ("warning=0.2", 14, "--mode cos"),
    ("position-out-of-range=0.02", 8, "--steps-per-turn 4096 --total-resolution 1048576"),
    ("turns-not-power-of-two@23", 8, ""),
    ("value-out-of-range=0.5", 10, ""),
    ("not-settable=0.5", 10, ""),
    ("unsaved-parameter=0.5", 20, "--motion still"),
    ("preset-while-moving=0.7", 12, ""),
    ("written=0.5", 10, "--motion still"),
    ("io-flood@23", 9, ""),
];

#[test]
fn each_fault_is_found_where_it_struck_and_nothing_else() {
    let mut runs = Vec::new();
    for (turn, (fault, seconds, more)) in FAULTS.iter().enumerate() {
        let bus = "--encoders 7,23 --scan 80 --errands 250 --assembly 2";
        let seed = turn + 51;
        let plan = format!("{bus} {more} --seed {seed} --duration {seconds} --fault {fault}");
        // How busy a bus is is only known with its bit rate, which a log does not tell.
        let form = if fault.starts_with("io-flood") { "pcapng" } else { "log" };
        runs.push((form, plan, Vec::new()));
    }
    let compared = check_all(&runs);
    assert!(compared.frames > 25_000 && compared.faults > 250, "{compared:?}");
}

/// What the tap misses is a gap: nothing is judged across it, and nothing is made up.
#[test]
fn faults_of_the_tap_are_no_faults_of_the_bus() {
    let mut runs = Vec::new();
    for (seed, mode) in (1..).zip(MODES) {
        for (form, fault) in [
            ("log", "bus-off=0.02"),
            ("log", "dropped=0.02"),
            ("pcapng", "dropped=0.02"),
            ("pcapng", "truncated=0.05"),
        ] {
            let bus = "--encoders 7,23 --scan 60 --errands 150 --assembly 2 --duration 9";
            let plan = format!("{bus} --mode {mode} --seed {seed} --fault {fault}");
            runs.push((form, plan, devices(&[7, 23])));
        }
    }
    let compared = check_all(&runs);
    assert!(compared.faults > 60, "{compared:?}");
}

/// Faults that may strike together, and how often each.
const MIXED: [(&str, f64); 34] = [
    ("error-frame", 0.02),
    ("stuff", 0.02),
    ("form", 0.02),
    ("crc", 0.02),
    ("overload", 0.02),
    ("malformed", 0.3),
    ("reserved-id", 0.2),
    ("foreign-frame", 0.2),
    ("duplicate-mac", 0.1),
    ("node-restart", 0.1),
    ("shutdown", 0.1),
    ("device-fault", 0.3),
    ("allocation-refused", 0.2),
    ("allocation-invalid", 0.2),
    ("no-response", 0.1),
    ("late-response", 0.1),
    ("unsolicited-response", 0.1),
    ("error-response", 0.2),
    ("xid-busy", 0.2),
    ("fragment-sequence", 0.3),
    ("fragment-retry", 0.2),
    ("fragment-unacknowledged", 0.2),
    ("fragment-rejected", 0.2),
    ("size-mismatch", 0.02),
    ("idle", 0.02),
    ("alarm", 0.1),
    ("position-out-of-range", 0.01),
    ("value-out-of-range", 0.2),
    ("not-settable", 0.2),
    ("unsaved-parameter", 0.2),
    ("preset-while-moving", 0.3),
    ("written", 0.3),
    ("reserved-id", 0.1),
    ("stuff", 0.01),
];

/// Those of one way to get positions.
const OF_MODE: [[&str; 2]; 4] = [
    ["no-poll-response", "connection-timeout"],
    ["inhibit-violated", "delta-ignored"],
    ["late-production", "io-unacknowledged"],
    ["no-strobe-response", "connection-timeout"],
];

#[test]
fn faults_that_strike_together_are_told_apart() {
    let runs: Vec<_> = (0..12_usize)
        .map(|turn| {
            let mode = turn % MODES.len();
            let [one, other] =
                [7 * turn, 7 * turn + 5 + 3 * (turn / MIXED.len())].map(|n| MIXED[n % MIXED.len()]);
            let of_mode = (OF_MODE[mode][turn / MODES.len() % 2], 0.02);
            let faults = [one, other, of_mode]
                .map(|(name, probability)| format!("--fault {name}={probability}"));
            let motion = ["still", "stop-and-go", "steady", "reversing"][turn / 4 % 4];
            let rate = ["125k", "250k", "500k"][turn % 3];
            let bus = "--encoders 7,23,41 --assembly 2 --scan 50 --errands 150 --duration 20";
            let ring = "--steps-per-turn 4096 --total-resolution 1048576";
            let (mode, faults, seed) = (MODES[mode], faults.join(" "), turn + 1);
            let how = format!("--mode {mode} --motion {motion} --bitrate {rate} --seed {seed}");
            ("log", format!("{bus} {ring} {how} {faults}"), Vec::new())
        })
        .collect();
    let compared = check_all(&runs);
    assert!(compared.frames > 20_000 && compared.faults > 400, "{compared:?}");
}
