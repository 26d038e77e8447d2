//! Many channels of a logic analyzer, of which one carries a bus.

use crate::harness::{Scratch, argument, fieldtap};

const SAMPLES: usize = 400_000;

/// Eight channels at 1 MHz: on D0 encoder 0 is asked every 2 ms and answers 154 (80, 1A 01 98h; TR
/// SLIN §6) at 115200 Bd; D1 to D6 change their level now and then, as a
/// multiplicative generator has it; D7 never does.
fn samples() -> Vec<u8> {
    let mut line = vec![true; SAMPLES];
    let mut send = |start: f64, byte: u8| {
        let data = (0..8).map(|bit| byte >> bit & 1 == 1);
        let parity = byte.count_ones() % 2 == 1;
        let bits = std::iter::once(false).chain(data).chain([parity, true]);
        for (index, level) in bits.enumerate() {
            let edge = |bit: usize| (start + bit as f64 * 1e6 / 115_200.0) as usize;
            line[edge(index)..edge(index + 1)].fill(level);
        }
    };
    let character = 11.0 * 1e6 / 115_200.0;
    for exchange in 0..SAMPLES / 2_000 - 1 {
        let start = 1_000.0 + 2_000.0 * exchange as f64;
        send(start, 0x80);
        for (index, byte) in [0x1A, 0x01, 0x98].into_iter().enumerate() {
            send(start + 250.0 + character * (1.0 + index as f64), byte);
        }
    }
    let mut samples: Vec<u8> = line.into_iter().map(u8::from).collect();
    let mut number = 5_u64;
    for channel in 1..7 {
        let (mut time, mut level) = (0, 0);
        while time < SAMPLES {
            // Lewis, Goodman and Miller, 1969.
            number = number * 16_807 % 2_147_483_647;
            let until = (time + 100 + number as usize % 19_900).min(SAMPLES);
            samples[time..until].iter_mut().for_each(|sample| *sample |= level << channel);
            (time, level) = (until, 1 - level);
        }
    }
    samples
}

#[test]
fn channels_that_cannot_be_read_are_told_together() {
    let scratch = Scratch::new();
    let capture = scratch.file("bus.bin", samples());
    let logic = ["--input-format", "logic", "--samplerate", "1M"];
    let run = fieldtap(["read"].iter().chain(&logic).chain(&[argument(&capture)])).good();
    let line = |heading: &str| {
        let line = run.stderr.lines().find(|line| line.starts_with(heading));
        line.expect("it is among the last").to_owned()
    };
    // 199 exchanges of four characters.
    assert_eq!(
        line("LINE"),
        "LINE   D0 ok: 115200 8E1, 796 characters, 0 damaged (0.00 %); D1 to D6: nothing that can \
         be read"
    );
    assert_eq!(
        line("OPEN"),
        "OPEN   D0 checksum undecided for 0; D1 to D6: nothing that can be read"
    );
}
