//! Each finding: where it is told, once, and where it is not.

use crate::listener::{Words, codes, every_cycle, hear, hear_rows, told};
use fieldtap_dissectors::event::Moment;
use fieldtap_dissectors::finding::State;
use fieldtap_dissectors::interbus::diagnostic::{Generation, Order};
use fieldtap_dissectors::interbus::{Content, Device, Row};
use fieldtap_dissectors::protocol::Settings;
use fieldtap_dissectors::record::Turn;

/// A handshake, a row a state, from and to rest: the answer to this OUT is that IN.
fn handshake(out: u32, input: u32) -> Vec<(u32, u32)> {
    let laid_out = out & 0x7FFF_FFFF;
    vec![(0, 5), (laid_out, 5), (out, 5), (out, 5), (out, input), (0, input), (0, 5)]
}

fn found(rows: &[(u32, u32)]) -> Vec<(u64, &'static str)> {
    codes(&told(rows, every_cycle()))
}

#[test]
fn what_the_la_66_does_not_have() {
    for service in [0, 3, 5, 7, 9, 0xA, 0xF] {
        let out = 0x8000_0000 | service << 24;
        assert_eq!(found(&handshake(out, out)), [(3, "interbus.undefined-service")], "{service}");
    }
    assert_eq!(found(&handshake(0x8600_0000, 0x8600_0000)), [(3, "interbus.access")]);
    assert_eq!(found(&handshake(0xC800_0000, 0xC800_0000)), [(3, "interbus.access")]);
    assert_eq!(
        found(&handshake(0xC100_0002, 0xE100_0002)),
        [(3, "interbus.value-out-of-range"), (5, "interbus.error-bit"), (7, "interbus.error-bit")]
    );
    assert_eq!(found(&handshake(0x8100_0000, 0x8100_0002)), [(5, "interbus.value-out-of-range")]);
    assert_eq!(found(&handshake(0x9100_0000, 0x8100_0000)), [(3, "interbus.reserved-bits")]);
    assert_eq!(found(&handshake(0x8800_0000, 0x8801_0000)), [(5, "interbus.reserved-bits")]);
}

#[test]
fn bits_beside_a_position_are_told_when_they_come() {
    let rows = [(0, 1), (0, 0x0100_0001), (0, 0x0100_0002), (0, 3), (0, 0x5000_0003)];
    assert_eq!(found(&rows), [(2, "interbus.reserved-bits"), (5, "interbus.reserved-bits")]);
}

#[test]
fn acknowledgements_that_do_not_fit() {
    assert_eq!(found(&handshake(0xC200_1388, 0xC400_1388)), [(5, "interbus.service-mismatch")]);
    assert_eq!(found(&handshake(0xC200_1388, 0x8200_1388)), [(5, "interbus.service-mismatch")]);
    // 1288h, as the manual misprints it, is 4744.
    assert_eq!(found(&handshake(0xC200_1388, 0xC200_1288)), [(5, "interbus.echo-mismatch")]);
    // Refused: what IN holds then, no manual says.
    assert_eq!(
        found(&handshake(0xC200_1388, 0xE2FF_FFFF)),
        [(5, "interbus.error-bit"), (7, "interbus.error-bit")]
    );
}

#[test]
fn an_acknowledgement_that_nobody_asked_for() {
    let rows = [(0, 5), (0, 5), (0, 0xC200_1388), (0, 0xC200_1388), (0, 5)];
    assert_eq!(found(&rows), [(3, "interbus.unrequested-acknowledge")]);
    // A log that may have skipped the request: withheld, and what was done is told.
    let told = told(&rows, Settings::default());
    assert_eq!(codes(&told), [(3, "interbus.written")]);
    assert_eq!(told[2].withheld, ["interbus.unrequested-acknowledge"]);
}

#[test]
fn an_error_bit_is_a_state() {
    let mut rows: Vec<Words> = (0..10).map(|n| (n * 1_000, 0, 0x12345)).collect();
    rows[3..8].iter_mut().for_each(|row| row.2 = 0x2001_2345);
    let (told, _) = hear(&rows, Settings::default());
    assert_eq!(codes(&told), [(4, "interbus.error-bit"), (9, "interbus.error-bit")]);
    assert_eq!(told[3].state, Some(State::Begin));
    assert_eq!(told[3].position, Some(0x12345));
    assert_eq!(
        told[3].messages,
        ["error bit: the only defined cause is the magnet outside the range"]
    );
    // Rows 4 to 7 repeat it; from row 3 to row 8 are 5 ms.
    assert_eq!(told.iter().map(|it| it.ongoing).sum::<usize>(), 4);
    assert_eq!(told[8].state, Some(State::End(Some(5_000_000))));
    assert_eq!(told[8].bad, [""; 0]);
}

#[test]
fn the_error_status_names_the_magnet_while_the_error_bit_stands() {
    let position = 0x2001_2345;
    let rows = [
        (0, position),
        (0x0800_0000, position),
        (0x8800_0000, position),
        (0x8800_0000, 0xA800_0020),
        (0, 0xA800_0020),
        (0, position),
    ];
    assert_eq!(found(&rows), [(1, "interbus.error-bit"), (4, "interbus.magnet")]);
}

/// Reading the error status is itself done without an error: 88000020 has no bit 29.
#[test]
fn an_acknowledgement_without_the_error_bit_does_not_end_the_error() {
    let position = 0x2001_2345;
    let rows = [
        (0, 0x12345),
        (0x0800_0000, position),
        (0x8800_0000, position),
        (0x8800_0000, 0x8800_0020),
        (0, 0x8800_0020),
        (0, position),
        (0, 0x12345),
    ];
    assert_eq!(
        found(&rows),
        [(2, "interbus.error-bit"), (4, "interbus.magnet"), (7, "interbus.error-bit")]
    );
    let told = told(&rows, every_cycle());
    assert_eq!(told[6].state, Some(State::End(Some(5_000_000))));
    assert_eq!(
        told[6].messages,
        ["over: error bit (the last service before was 88h), after 5.00 ms"]
    );
}

/// 00C4 is a bus error, 00D4 one that is being located, 40E0 poor quality (00E0 is a ring that runs).
#[test]
fn trouble_that_the_master_reports_is_told_when_it_comes() {
    let codes_of = |contents: &[(Option<u16>, Content)], settings| {
        let rows = contents.iter().map(|(device, content)| {
            Row::new(device.and_then(Device::new), *content).at(Moment::from_ns(0), 0)
        });
        codes(&hear_rows(&rows.collect::<Vec<_>>(), settings).0)
    };
    let status = |status| (None, Content::Diagnostic { status, parameter: None });
    let rows = [0x00E0, 0x00D4, 0x00C4, 0x00E0, 0x40E0, 0x00C4, 0x00EA].map(status);
    let line = "interbus.line";
    assert_eq!(codes_of(&rows, Settings::default()), [(2, line), (5, line), (6, line)]);
    // 08 is an error at W1, 02 one of the module behind it.
    let slave = |device, byte| (Some(device), Content::SlaveDiagnostic(byte));
    let rows = [slave(1, 0x02), slave(1, 0x08), slave(2, 0x08), slave(1, 0x08), slave(2, 0)];
    assert_eq!(codes_of(&rows, Settings::default()), [(2, line), (3, line)]);
    // Generation 3: bit 2 is RB if the order is as assumed, which nobody has said.
    let mut settings = Settings::default();
    settings.interbus.master.generation = Some(Generation::Three);
    assert_eq!(codes_of(&[status(4)], settings.clone()), []);
    settings.interbus.master.third = Order::parse("MOD,LB,RB,CTRL,BSA,RUN,BASP,READY").unwrap();
    assert_eq!(codes_of(&[status(4)], settings), [(1, line)]);
}

/// What the log does not have cannot be missed.
#[test]
fn a_log_of_one_side_misses_nothing_of_the_other() {
    let side = |is_out: bool| {
        let rows = standing(&[(0, 5), (0x0100_0000, 5)], (0x8100_0000, 5), 40);
        let rows = rows.into_iter().map(|(us, out, input)| {
            let (out, input) = (Some(out).filter(|_| is_out), Some(input).filter(|_| !is_out));
            Row::new(Some(Device::FIRST), Content::Process { out, input })
                .at(Moment::from_ns(us * 1_000), 0)
        });
        hear_rows(&rows.collect::<Vec<_>>(), Settings::default()).0
    };
    let told = side(true);
    assert_eq!(codes(&told), []);
    assert_eq!(told[2].withheld, ["interbus.no-acknowledge"]);
    assert!(told.iter().all(|it| it.turn == Turn::Neither));
    assert_eq!(codes(&side(false)), []);
}

/// Rows every 100 ms: a state that stands for so many.
fn standing(before: &[(u32, u32)], row: (u32, u32), count: usize) -> Vec<Words> {
    let rows = before.iter().copied().chain(std::iter::repeat_n(row, count));
    (0..).zip(rows).map(|(n, (out, input))| (n * 100_000, out, input)).collect()
}

#[test]
fn no_acknowledge_is_told_on_the_first_row_past_the_limit() {
    let mut rows = standing(&[(0, 5), (0x0100_0000, 5)], (0x8100_0000, 5), 15);
    let end = rows.last().unwrap().0;
    rows.extend([(end + 100_000, 0, 5), (end + 200_000, 0, 5)]);
    for settings in [Settings::default(), every_cycle()] {
        let (told, _) = hear(&rows, settings);
        // Row 3 asks at 0.2 s: at 1.2 s it is not beyond 1 s, at 1.3 s, row 14, it is.
        assert_eq!(codes(&told), [(14, "interbus.no-acknowledge")]);
        assert!(told.iter().all(|it| it.withheld.is_empty()));
    }
}

#[test]
fn no_release_is_told_on_the_first_row_past_the_limit() {
    let before = [(0, 5), (0x0100_0000, 5), (0x8100_0000, 5), (0x8100_0000, 0x8100_0001)];
    let rows = standing(&before, (0, 0x8100_0001), 14);
    // Row 5 withdraws at 0.4 s: at 1.5 s, row 16, it is more than 1 s.
    assert_eq!(codes(&hear(&rows, Settings::default()).0), [(16, "interbus.no-release")]);
}

#[test]
fn data_and_service_bit_at_once() {
    let rows = [(0, 5), (0xC200_1388, 5), (0xC200_1388, 0xC200_1388)];
    assert_eq!(found(&rows), [(2, "interbus.data-with-service-bit"), (3, "interbus.written")]);
    let told = told(&rows, Settings::default());
    assert_eq!(told[1].withheld, ["interbus.data-with-service-bit"]);
    assert_eq!(codes(&told), [(3, "interbus.written")]);
    // A read service has no data: what stands there may change.
    let rows = [(0x0100_0007, 5), (0x8100_0000, 5), (0x8100_0000, 0x8100_0000)];
    assert_eq!(found(&rows), []);
}

#[test]
fn a_request_that_changes_is_told_once() {
    let rows = [
        (0, 5),
        (0x4200_1388, 5),
        (0xC200_1388, 5),
        (0xC200_1389, 5),
        (0xC200_138A, 5),
        (0xC200_138A, 0xC200_1388),
        (0, 0xC200_1388),
        (0, 5),
    ];
    assert_eq!(found(&rows), [(4, "interbus.request-changed"), (6, "interbus.written")]);
    // Rows a ms apart skip no handshake.
    assert_eq!(codes(&told(&rows, Settings::default()))[0], (4, "interbus.request-changed"));
    // 50 ms apart they may, until IN acknowledges what OUT held at first.
    let coarse: Vec<Words> =
        (0..).zip(rows).map(|(n, (out, input))| (n * 50_000, out, input)).collect();
    let (told, _) = hear(&coarse, Settings::default());
    assert_eq!(codes(&told), [(6, "interbus.request-changed"), (6, "interbus.written")]);
    assert_eq!(told[3].withheld, ["interbus.request-changed"]);
}

#[test]
fn what_a_request_is_changed_to_is_judged_as_well() {
    let changed = |to: &[u32]| {
        let mut rows = vec![(0, 5), (0x4200_1388, 5), (0xC200_1388, 5)];
        rows.extend(to.iter().map(|out| (*out, 5)));
        let found = found(&rows);
        assert_eq!(found[0], (4, "interbus.request-changed"));
        found[1..].to_vec()
    };
    assert_eq!(changed(&[0xC200_1389]), []);
    assert_eq!(changed(&[0xC800_0000]), [(4, "interbus.access")]);
    assert_eq!(changed(&[0xC100_0002]), [(4, "interbus.value-out-of-range")]);
    assert_eq!(changed(&[0xD200_1388]), [(4, "interbus.reserved-bits")]);
    // A value that runs on: each of them once.
    assert_eq!(
        changed(&[0xD500_0001, 0xD500_0002, 0xC600_0001, 0x8600_0001, 0x8600_0002]),
        [(4, "interbus.reserved-bits"), (4, "interbus.undefined-service"), (7, "interbus.access")]
    );
}

#[test]
fn a_request_that_is_withdrawn_too_early() {
    let rows = [(0, 5), (0x0100_0000, 5), (0x8100_0000, 5), (0, 5), (0, 0x8100_0000), (0, 5)];
    assert_eq!(found(&rows), [(4, "interbus.withdrawn")]);
    let coarse: Vec<Words> =
        (0..).zip(rows).map(|(n, (out, input))| (n * 50_000, out, input)).collect();
    let (told, _) = hear(&coarse, Settings::default());
    assert!(told.iter().all(|it| it.bad.is_empty()), "{:?}", codes(&told));
    assert_eq!(told[3].withheld, ["interbus.withdrawn"]);
    // A controller that logs what it has just decided shows no row with both bits.
    let rows = [(0, 5), (0x0100_0000, 5), (0x8100_0000, 5), (0, 0x8100_0000), (0, 5)];
    assert_eq!(found(&rows), []);
}

#[test]
fn a_fine_log_shows_itself() {
    // Rows 5 ms apart: after two whole handshakes a withdrawn request is one.
    let mut rows = handshake(0x8100_0000, 0x8100_0000);
    rows.extend(handshake(0x8100_0000, 0x8100_0000));
    rows.extend([(0x0100_0000, 5), (0x8100_0000, 5), (0, 5)]);
    let rows: Vec<Words> =
        (0..).zip(rows).map(|(n, (out, input))| (n * 5_000, out, input)).collect();
    let (told, conclusions) = hear(&rows, Settings::default());
    assert_eq!(codes(&told), [(17, "interbus.withdrawn")]);
    let grain = conclusions.iter().find(|it| it.subject == "handshakes").unwrap();
    assert_eq!(grain.value.as_deref(), Some("state by state"));
}

#[test]
fn repeated_writes_wear_the_eeprom_out() {
    let mut rows = Vec::new();
    for _ in 0..12 {
        rows.extend(handshake(0xC400_0064, 0xC400_0064));
    }
    let codes = codes(&told(&rows, every_cycle()));
    let repeated = codes.iter().filter(|(_, code)| *code == "interbus.repeated-write");
    // The fifth row of the tenth handshake: 9 · 7 + 5.
    assert_eq!(repeated.collect::<Vec<_>>(), [&(68, "interbus.repeated-write")]);
    assert_eq!(codes.iter().filter(|(_, code)| *code == "interbus.written").count(), 12);
}

/// Positions that go up by 3 a row.
fn moving(count: u32) -> Vec<(u32, u32)> {
    (0..count).map(|n| (0, 20_000 + 3 * n)).collect()
}

#[test]
fn a_jump_is_an_event_about_its_row() {
    let mut rows = moving(60);
    rows[30..].iter_mut().for_each(|row| row.1 += 4_000);
    let told = told(&rows, Settings::default());
    let jumps: Vec<_> = told.iter().filter(|it| it.kind == "event").collect();
    assert_eq!(jumps.len(), 1);
    assert_eq!((jumps[0].about, jumps[0].station), (Some(31), Some(1)));
    // 20000 + 3 · 30 + 4000 = 24090, and 20090 was due.
    assert_eq!(jumps[0].summary, "1 jumps to 24090, the ones before lead to 20090");
}

#[test]
fn a_jump_to_preset_value_1_is_the_external_input() {
    let mut rows = handshake(0x8400_0000, 0x8400_0064);
    rows.iter_mut().filter(|row| row.1 == 5).for_each(|row| row.1 = 20_000);
    rows.extend(moving(40));
    rows.extend([(0, 100); 20]);
    let told = told(&rows, every_cycle());
    let jumps: Vec<_> = told.iter().filter(|it| it.kind == "event").collect();
    assert_eq!(jumps.len(), 1);
    assert_eq!(jumps[0].summary, "1 at 100: external preset input (preset value 1)");
    // Seven rows of the handshake, 40 that move: it is in row 48. Nothing is wrong with that.
    assert_eq!((jumps[0].about, &jumps[0].codes[..]), (Some(48), &[][..]));
    // A value that was there for one row only was not set. The event comes behind the row after it.
    let spike = rows.len() - 10;
    rows[47..].iter_mut().for_each(|row| row.1 = 20_120);
    rows[spike].1 = 100;
    assert_eq!(found(&rows), [(spike as u64 + 3, "interbus.position-jump")]);
}

#[test]
fn a_commanded_preset_is_no_jump() {
    let mut rows = moving(40);
    rows.extend([(0x4600_0064, 20_120), (0xC600_0064, 20_120), (0xC600_0064, 0xC600_0064)]);
    rows.extend([(0x4600_0064, 0xC600_0064), (0x4600_0064, 100)]);
    rows.extend([(0x4600_0064, 100); 30]);
    let codes = found(&rows);
    assert_eq!(codes, [(43, "interbus.written")]);
    // Nor where the log shows nothing of the handshake but what OUT holds.
    let mut rows = moving(40);
    rows.extend([(0x4600_0064, 100_000); 30]);
    let rows: Vec<Words> =
        (0..).zip(rows).map(|(n, (out, input))| (n * 10_000, out, input)).collect();
    assert_eq!(crate::listener::codes(&hear(&rows, Settings::default()).0), []);
}
