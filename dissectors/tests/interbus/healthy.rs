//! A healthy LA-66 under a healthy program: whatever of it a log shows, nothing is wrong. And rows
//! that are nothing at all.

use crate::listener::{Told, Words, codes, every_cycle, hear, hear_rows};
use fieldtap_dissectors::event::Moment;
use fieldtap_dissectors::interbus::{Content, Device, Row};
use fieldtap_dissectors::protocol::Settings;
use fieldtap_dissectors::record::Turn;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

/// A program that asks for one service after the other, and an axis that stops and goes.
#[derive(Clone, Debug)]
struct Machine {
    /// µs.
    cycle: i64,
    /// Cycles that the program rests between two services, give or take some: rows that kept step
    /// with a program would show the same place of every handshake.
    pause: u32,
    /// Cycles that the device needs for each service.
    effort: Vec<u32>,
    /// What is asked for: access and service as in bits 31 to 24, and data.
    services: Vec<(u32, u32)>,
    /// OUT is left standing when the request is withdrawn.
    leaves_standing: bool,
    /// Cycles that the axis moves and rests, and its top speed in steps a cycle.
    moves: Vec<(u32, u32, i64)>,
}

/// The device: one cycle behind, as INTERBUS is.
struct Encoder {
    position: i64,
    offset: i64,
    values: [u32; 16],
    busy: u32,
    input: u32,
}

impl Encoder {
    fn cycle(&mut self, out: u32, effort: u32) {
        let position = (self.position + self.offset).rem_euclid(1 << 24) as u32;
        let is_asked = out >> 31 == 1;
        let is_done = self.input >> 31 == 1;
        if is_asked && !is_done {
            self.busy += 1;
            self.input = position;
            if self.busy > effort {
                self.busy = 0;
                self.input = self.answer(out);
            }
        } else if !is_asked {
            self.busy = 0;
            self.input = position;
        }
    }

    fn answer(&mut self, out: u32) -> u32 {
        let (service, data) = ((out >> 24 & 0xF) as usize, out & 0xFF_FFFF);
        if out >> 30 & 1 == 0 {
            return out & 0xFF00_0000 | self.values[service];
        }
        match service {
            6 => self.offset = i64::from(data) - self.position,
            _ => self.values[service] = data,
        }
        out
    }
}

impl Machine {
    /// Rows of so many cycles.
    fn run(&self, cycles: usize) -> Vec<Words> {
        let mut encoder =
            Encoder { position: 30_000, offset: 0, values: [0; 16], busy: 0, input: 30_000 };
        encoder.values[2] = 50_000;
        let (mut out, mut asked, mut rest) = (0_u32, 0, 3);
        let (mut leg, mut left, mut speed) = (0, 0_u32, 0_i64);
        let (mut rows, mut chance) = (Vec::new(), self.pause);
        for n in 0..cycles as i64 {
            rows.push((n * self.cycle, out, encoder.input));
            // The program sees IN and decides what OUT is next; the device sees OUT of now.
            let (sent, input) = (out, encoder.input);
            let (code, data) = self.services[asked % self.services.len()];
            let word = code << 24 | data;
            out = match (out >> 31 == 1, input >> 31 == 1) {
                (true, true) => {
                    asked += 1;
                    chance = chance.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    rest = self.pause + (chance >> 28);
                    if self.leaves_standing { out & 0x7FFF_FFFF } else { 0 }
                }
                (true, false) | (false, true) => out,
                (false, false) if rest > 0 => {
                    rest -= 1;
                    out
                }
                (false, false) if out != word & 0x7FFF_FFFF => word & 0x7FFF_FFFF,
                (false, false) => word,
            };
            let (moving, resting, top) = self.moves[leg % self.moves.len()];
            let wanted = if left > resting { top } else { 0 };
            speed += (wanted - speed).clamp(-5, 5);
            encoder.position = (encoder.position + speed).clamp(0, 60_000);
            left = match left {
                0 => {
                    leg += 1;
                    moving + resting
                }
                left => left - 1,
            };
            encoder.cycle(sent, self.effort[asked % self.effort.len()]);
        }
        rows
    }
}

fn machine() -> impl Strategy<Value = Machine> {
    let service = prop_oneof![
        (select(vec![0xC1_u32]), 0..2_u32),
        (select(vec![0xC2_u32]), 20_000..60_000_u32),
        (select(vec![0xC4_u32, 0xC6]), 0..60_000_u32),
        (select(vec![0x81_u32, 0x82, 0x84, 0x88]), Just(0_u32)),
    ];
    let cycle = select(vec![500_i64, 1_000, 2_000, 4_000, 10_000]);
    let moves = vec((1..60_u32, 1..60_u32, -60..60_i64), 1..6);
    (cycle, 0..200_u32, vec(0..30_u32, 1..6), vec(service, 1..12), any::<bool>(), moves).prop_map(
        |(cycle, pause, effort, services, leaves_standing, moves)| Machine {
            cycle,
            pause,
            effort,
            services,
            leaves_standing,
            moves,
        },
    )
}

/// What is wrong in these records. Writing one value for a minute is wrong of a program.
fn wrong(told: &[Told]) -> Vec<(u64, &'static str)> {
    let bad = told.iter().flat_map(|it| it.bad.iter().map(|code| (it.n, *code)));
    bad.filter(|(_, code)| *code != "interbus.repeated-write").collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_healthy_bus_is_healthy_at_every_cycle(machine in machine()) {
        let rows = machine.run(3_000);
        for settings in [Settings::default(), every_cycle()] {
            let (told, _) = hear(&rows, settings);
            prop_assert_eq!(wrong(&told), []);
            let asked = told.iter().filter(|it| it.turn == Turn::Asks).count();
            let answered = told.iter().filter(|it| it.turn == Turn::Answers).count();
            prop_assert!(asked - answered <= 1 && asked > 0, "{asked} {answered}");
        }
    }

    #[test]
    fn and_so_it_is_in_a_coarser_log(
        machine in machine(),
        every in prop_oneof![2..12_usize, 12..120_usize],
        offset in 0..12_usize,
    ) {
        let rows = machine.run(20_000);
        let coarse: Vec<Words> = rows.into_iter().skip(offset).step_by(every).collect();
        let (told, _) = hear(&coarse, Settings::default());
        prop_assert_eq!(wrong(&told), [], "every {}", every);
    }

    /// Rows 50 ms apart, however fast the bus is.
    #[test]
    fn and_in_a_log_of_50_ms(machine in machine(), offset in 0..50_usize) {
        let every = (50_000 / machine.cycle) as usize;
        let rows = machine.run(30_000);
        let coarse: Vec<Words> = rows.into_iter().skip(offset).step_by(every).collect();
        let (told, _) = hear(&coarse, Settings::default());
        prop_assert_eq!(wrong(&told), []);
    }

    #[test]
    fn rows_that_are_nothing_are_records(
        rows in vec((any::<Option<u16>>(), any::<Option<u32>>(), any::<Option<u32>>(), any::<i64>()), 1..300),
        is_every_cycle in any::<bool>(),
    ) {
        let rows: Vec<Row> = rows.into_iter().map(|(device, out, input, time)| {
            let device = device.and_then(|number| Device::new(number % 600));
            let input = if out.is_none() { input.or(Some(0)) } else { input };
            let content = Content::Process { out, input };
            Row::new(device, content).at(Moment::from_ns(time), (time % 1_000) as u32)
        }).collect();
        let settings = if is_every_cycle { every_cycle() } else { Settings::default() };
        let (told, conclusions) = hear_rows(&rows, settings);
        let of_rows: Vec<&Told> = told.iter().filter(|it| it.kind != "event").collect();
        prop_assert_eq!(of_rows.len(), rows.len());
        // One each at most of device, resolution and handshakes, for 512 devices and none.
        prop_assert!(conclusions.len() <= 3 * 513);
        for it in &told {
            let mut once = it.codes.clone();
            once.sort_unstable();
            once.dedup();
            prop_assert_eq!(once.len(), it.codes.len(), "{:?}", &it.codes);
            prop_assert!(it.position.is_none_or(|position| (0..1 << 24).contains(&position)));
        }
    }
}

#[test]
fn a_log_of_positions_alone_is_healthy() {
    let rows: Vec<Words> =
        (0..1_000).map(|n| (n * 50_000, 0, 5_000 + (n as u32 % 100) * 20)).collect();
    let (told, conclusions) = hear(&rows, Settings::default());
    assert_eq!(codes(&told), []);
    assert!(told.iter().all(|it| it.kind == "normal" && it.withheld.is_empty()));
    assert_eq!(conclusions.len(), 2, "protocol and device: {conclusions:?}");
}
