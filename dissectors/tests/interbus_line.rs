//! Lines of rings with a format nobody was told: made from a random profile, heard as levels, and
//! found out. What is claimed has to be right; what cannot be known has to be said.

mod ring;

use fieldtap_dissectors::device::Profile as DeviceProfile;
use fieldtap_dissectors::interbus::line::RingDevice;
use fieldtap_dissectors::protocol::Settings;
use fieldtap_dissectors::setting::{Origin, Setting};
use ring::{Chance, Fault, Heard, Plan, hear, hear_wires, settings};

fn setting<'a>(heard: &'a Heard, key: &str) -> &'a Setting {
    heard.settings.iter().find(|setting| setting.key == key).expect("a known key")
}

/// What a profile has to come out as, with the wrong claims: only what was found is a claim.
fn compare(plan: &Plan, heard: &Heard) -> (usize, usize, Vec<String>) {
    let (mut right, mut all, mut wrong) = (0, 0, Vec::new());
    for (key, expected) in plan.truth() {
        all += 1;
        let setting = setting(heard, key);
        let value = setting.value.as_deref();
        if value == Some(expected.as_str()) {
            right += 1;
        } else if setting.origin == Origin::Found && value.is_some() {
            wrong.push(format!("{key}: {value:?}, not {expected}: {}", setting.evidence));
        }
    }
    (right, all, wrong)
}

#[test]
fn random_profiles_are_recovered_blind_and_nothing_wrong_is_claimed() {
    let count = 240;
    let (mut whole, mut right, mut all) = (0, 0, 0);
    let mut lost = std::collections::BTreeMap::<&str, u32>::new();
    for seed in 0..count {
        let plan = Plan::random(&mut Chance::new(seed));
        let heard = hear(&plan, &plan.record(200, &mut Chance::new(seed)));
        let (good, keys, wrong) = compare(&plan, &heard);
        assert!(wrong.is_empty(), "seed {seed}: {wrong:#?}\n{plan:#?}");
        let loud: Vec<_> = heard.findings.iter().collect();
        assert!(loud.is_empty(), "seed {seed}: {loud:?}\n{plan:#?}");
        assert_eq!(heard.crc("bad"), 0, "seed {seed}");
        for (key, expected) in plan.truth() {
            if setting(&heard, key).value.as_deref() != Some(expected.as_str()) {
                *lost.entry(key).or_default() += 1;
            }
        }
        right += good;
        all += keys;
        whole += usize::from(good == keys);
    }
    println!("{whole} of {count} profiles whole, {right} of {all} answers: {lost:?}");
    assert!(whole * 100 >= count as usize * 90, "{whole} of {count}: {lost:?}");
}

/// What was found of a plain ring in which this went wrong.
fn heard_with(faults: &[(usize, Fault)]) -> Heard {
    let plan = Plan::plain();
    hear(&plan, &plan.record_with(120, faults, &mut Chance::new(7)).0)
}

fn value<'a>(heard: &'a Heard, key: &str) -> Option<&'a str> {
    setting(heard, key).value.as_deref()
}

#[test]
fn a_plain_ring_is_told_cycle_by_cycle() {
    let heard = heard_with(&[]);
    assert_eq!((heard.of_kind("id-cycle"), heard.of_kind("data-cycle")), (4, 120));
    assert_eq!(heard.crc("ok"), 124);
    assert_eq!(value(&heard, "ring"), Some("32:0203 32:0233 16:0132"));
    assert!(heard.findings.is_empty(), "{:?}", heard.findings);
}

#[test]
fn a_standing_machine_proves_nothing_about_the_checksum() {
    let plan = Plan { is_standing: true, ..Plan::plain() };
    let heard = hear(&plan, &plan.record(300, &mut Chance::new(1)));
    assert_eq!(heard.crc("unverified"), 304);
    assert_eq!(value(&heard, "crc.poly"), None);
    let told = heard.conclusions.iter().find(|it| it.subject == "crc").unwrap();
    assert!(told.value.is_none() && told.evidence.contains("unverified"), "{told:?}");
    // Both wires show the loopback word even so.
    assert_eq!((value(&heard, "lbw"), value(&heard, "lbw_bit")), (Some("B5E3"), Some("0")));
}

#[test]
fn too_few_cycles_say_so() {
    let plan = Plan { id_cycles: 0, ..Plan::plain() };
    let heard = hear(&plan, &plan.record(12, &mut Chance::new(1)));
    assert_eq!(value(&heard, "lbw"), None);
    assert_eq!(setting(&heard, "lbw").evidence, "only 12 cycles of equal length");
    assert_eq!((value(&heard, "ring"), value(&heard, "id_value")), (None, None));
    assert_eq!(heard.of_kind("data-cycle"), 12);
}

/// 2 x 13 characters a cycle: with the loopback word, 10 bytes of registers, and 4 of checks.
#[test]
fn one_wire_alone_is_read_as_far_as_it_goes() {
    for seed in 0..60 {
        let chance = &mut Chance::new(1_000 + seed);
        let plan = Plan::random(chance);
        let recording = plan.record(200, chance);
        for wire in [0, 1] {
            let heard = hear_wires(&plan, &recording, &[wire], settings(), 100_000);
            let truth = plan.truth();
            let length: usize = plan.devices.iter().map(|device| device.bits).sum();
            for (key, expected) in truth {
                let expected = match (key, wire) {
                    ("lbw_bit", 1) => length.to_string(),
                    _ => expected,
                };
                let setting = setting(&heard, key);
                let is_claim = setting.origin == Origin::Found;
                if let Some(told) = setting.value.as_deref().filter(|_| is_claim) {
                    assert_eq!(told, expected, "seed {seed} wire {wire} {key}: {plan:#?}");
                }
            }
            assert_eq!(heard.crc("bad"), 0, "seed {seed} wire {wire}");
            assert!(heard.findings.is_empty(), "seed {seed} wire {wire}: {:?}", heard.findings);
        }
    }
}

#[test]
fn a_tap_further_down_shows_where_it_is() {
    for seed in 0..40 {
        let chance = &mut Chance::new(2_000 + seed);
        let random = Plan::random(chance);
        let upstream = chance.below(random.devices.len() as u64 + 1) as usize;
        let plan = Plan { upstream, ..random };
        let heard = hear(&plan, &plan.record(200, chance));
        let (_, _, wrong) = compare(&plan, &heard);
        assert!(wrong.is_empty(), "seed {seed}: {wrong:#?}\n{plan:#?}");
        assert!(heard.findings.is_empty(), "seed {seed}: {:?}\n{plan:#?}", heard.findings);
        assert_eq!(value(&heard, "lbw_bit"), Some(&*plan.truth()[7].1), "seed {seed}");
    }
}

fn with_device(number: u16) -> Settings {
    let profile = DeviceProfile::parse("la66").expect("a profile");
    Settings { devices: [(number, profile)].into(), ..settings() }
}

#[test]
fn a_device_that_the_user_named_has_a_record_a_cycle() {
    let plan = Plan::plain();
    let (recording, told) = plan.record_with(120, &[], &mut Chance::new(3));
    let heard = hear_wires(&plan, &recording, &[0, 1], with_device(2), 40_000);
    let expected: Vec<_> = told.into_iter().map(|words| (2, words)).collect();
    assert_eq!(heard.stations, expected);
    // Swapped wires carry the same.
    let swapped = hear_wires(&plan, &recording, &[1, 0], with_device(2), 40_000);
    assert_eq!(swapped.stations, expected);
    // Where no ID cycle was heard, the user has to describe the ring.
    let plan = Plan { id_cycles: 0, ..plan };
    let (recording, told) = plan.record_with(120, &[], &mut Chance::new(3));
    let mut settings = with_device(2);
    let hear = |settings| hear_wires(&plan, &recording, &[0, 1], settings, 40_000);
    assert!(hear(settings.clone()).stations.is_empty());
    let ring = [32, 32, 16].map(|width_bits| RingDevice { width_bits, name: None });
    settings.interbus.line.ring = ring.to_vec();
    let expected: Vec<_> = told.into_iter().map(|words| (2, words)).collect();
    assert_eq!(hear(settings.clone()).stations, expected);
    // Another ring than it is decodes nothing.
    settings.interbus.line.ring[0].width_bits = 16;
    assert!(hear(settings).stations.is_empty());
}

#[test]
fn what_is_wrong_with_a_cycle_is_told_once() {
    let told = |faults: &[(usize, Fault)]| {
        let findings = heard_with(faults).findings;
        findings.into_iter().map(|(code, text)| format!("{code} {text}")).collect::<Vec<_>>()
    };
    for wire in [0, 1] {
        let bad = told(&[(60, Fault::Bit(wire))]);
        assert_eq!(bad.len(), 1, "{bad:?}");
        assert!(bad[0].starts_with("interbus.crc CRC "), "{bad:?}");
        assert_eq!(told(&[(60, Fault::Cut(wire))]), ["interbus.line cut after 5 characters"]);
    }
    let stop = "interbus.line 1 character without stop bit";
    assert_eq!(told(&[(60, Fault::Stop)])[..1], [stop]);
    assert_eq!(told(&[(60, Fault::Missing)]), ["interbus.line on one of the two wires only"]);
    assert_eq!(
        told(&[(60, Fault::Control)]),
        ["interbus.line control word 0040, was 0000"],
        "and not once more when it is what it was"
    );
    assert_eq!(
        told(&[(60, Fault::Loopback)]),
        ["interbus.line loopback word B5E3 came back as B4E3"]
    );
    assert_eq!(told(&[(60, Fault::Shorter)]), ["interbus.line 8 bytes go round, were 10"]);
}

/// Loopback word, 10 bytes of registers, checksum and control word are 16 characters.
#[test]
fn characters_that_are_lost_or_too_many_are_told_in_their_cycle_alone() {
    let told = |faults: &[(usize, Fault)]| {
        let findings = heard_with(faults).findings.into_iter();
        let told =
            findings.map(|(code, text)| if code == "interbus.line" { text } else { code.into() });
        told.collect::<Vec<_>>()
    };
    for (fault, text) in [
        (Fault::Lost(0), "15 characters sent, 16 came back"),
        (Fault::Lost(1), "16 characters sent, 15 came back"),
        (Fault::Extra(0), "17 characters sent, 16 came back"),
        (Fault::Extra(1), "16 characters sent, 17 came back"),
    ] {
        assert_eq!(told(&[(60, fault)]), ["interbus.crc", text], "{fault:?}");
    }
    let both = [(60, Fault::Extra(0)), (60, Fault::Extra(1))];
    assert_eq!(told(&both), ["interbus.crc", "11 bytes go round, were 10"]);
}

#[test]
fn nothing_is_open_and_given_at_once() {
    for id_cycles in [0, 4] {
        let plan = Plan { id_cycles, ..Plan::plain() };
        let heard = hear(&plan, &plan.record(12, &mut Chance::new(1)));
        let open = heard.settings.iter().filter(|setting| setting.value.is_none());
        assert!(open.clone().count() > 0);
        assert!(open.clone().all(|setting| setting.origin == Origin::Default));
    }
}

#[test]
fn silence_resets_the_ring_once_its_time_is_over() {
    // 25 ms are 12,500 bits; the idle line around it adds none.
    let heard = heard_with(&[(60, Fault::Silence(12_400.0))]);
    assert!(heard.findings.is_empty());
    let heard = heard_with(&[(60, Fault::Silence(13_000.0))]);
    let reset = ("interbus.reset", "silent for more than 25.0 ms: all devices reset".to_owned());
    assert_eq!(heard.findings, [reset]);
    assert_eq!((heard.of_kind("id-cycle"), heard.of_kind("event")), (8, 1));
}

/// A capture that begins with data cycles, and knows ID cycles only behind a reset.
#[test]
fn a_ring_that_starts_anew_is_learned_then() {
    for seed in 0..40 {
        let chance = &mut Chance::new(3_000 + seed);
        let plan = Plan { id_cycles: 0, ..Plan::random(chance) };
        let faults = [(100, Fault::Silence(60_000.0))];
        let heard = hear(&plan, &plan.record_with(200, &faults, chance).0);
        let (right, all, wrong) = compare(&plan, &heard);
        assert!(wrong.is_empty(), "seed {seed}: {wrong:#?}\n{plan:#?}");
        assert!(right + 2 >= all, "seed {seed}: {right} of {all}");
        let codes: Vec<_> = heard.findings.iter().map(|(code, _)| *code).collect();
        assert_eq!(codes, ["interbus.reset"], "seed {seed}: {:?}\n{plan:#?}", heard.findings);
    }
}

#[test]
fn records_do_not_depend_on_how_the_line_comes_in_pieces() {
    let plan = Plan { jitter: 0.05, pause: 0.7, ..Plan::plain() };
    let faults = [(50, Fault::Bit(1)), (60, Fault::Silence(20_000.0)), (90, Fault::Cut(0))];
    let recording = plan.record_with(400, &faults, &mut Chance::new(5)).0;
    let hear = |block| hear_wires(&plan, &recording, &[0, 1], with_device(2), block);
    let whole = hear(u64::MAX / 4);
    assert!(whole.records.len() > 700);
    for block in [500, 4_001, 65_536] {
        let pieces = hear(block);
        assert_eq!(pieces.records, whole.records, "{block}");
        assert_eq!(pieces.findings, whole.findings, "{block}");
        assert_eq!(pieces.settings, whole.settings, "{block}");
    }
}

#[test]
fn a_wire_is_recognized_without_being_told_what_it_is() {
    for seed in 0..20 {
        let chance = &mut Chance::new(4_000 + seed);
        let plan = Plan::random(chance);
        let recording = plan.record(150, chance);
        for wire in [0, 1] {
            let heard = hear_wires(&plan, &recording, &[wire], Settings::default(), 10_000);
            assert_eq!(
                heard.protocol,
                Some("interbus"),
                "seed {seed} {wire}: {} {} {plan:#?}",
                recording.edges[wire].len(),
                recording.until
            );
        }
    }
}

/// Levels without any order, and a ring under heavy noise: whatever is made of them, nothing is
/// claimed that is wrong, and nothing panics.
#[test]
fn noise_is_no_ring() {
    for seed in 0..30 {
        let chance = &mut Chance::new(5_000 + seed);
        let plan = Plan::plain();
        let mut noise = ring::Recording::default();
        for edges in &mut noise.edges {
            let mut now = 0;
            while edges.len() < 6_000 {
                now += 1 + chance.below(60);
                edges.push(now);
            }
            noise.until = noise.until.max(now + 1);
        }
        let heard = hear(&plan, &noise);
        assert_eq!(value(&heard, "crc.poly"), None, "seed {seed}");
        let auto = hear_wires(&plan, &noise, &[0], Settings::default(), 10_000);
        assert_ne!(auto.protocol, Some("interbus"), "seed {seed}");
        let mut recording = plan.record(200, chance);
        for edges in &mut recording.edges {
            for _ in 0..200 {
                let place = chance.below(edges.len() as u64 - 1) as usize;
                edges.drain(place..place + 2);
            }
        }
        let heard = hear(&plan, &recording);
        let (_, _, wrong) = compare(&plan, &heard);
        assert!(wrong.is_empty(), "seed {seed}: {wrong:#?}");
    }
}

/// Any clock, any edges, up to the last tick there is: nothing panics.
#[test]
fn levels_of_any_clock_do_no_harm() {
    for seed in 0..80 {
        let chance = &mut Chance::new(6_000 + seed);
        let plan = Plan { bitrate: 1 << (seed % 31), samples: 1.0, ..Plan::plain() };
        let mut recording = ring::Recording::default();
        for edges in &mut recording.edges {
            let mut now = if seed % 3 == 0 { u64::MAX - 1_000_000 } else { 0 };
            for _ in 0..3_000 {
                now = now.saturating_add(1 + chance.below(1 << (1 + seed % 11)));
                edges.push(now.min(u64::MAX - 1));
            }
            recording.until = u64::MAX;
        }
        hear_wires(&plan, &recording, &[0, 1], with_device(1), u64::MAX);
        hear_wires(&plan, &recording, &[1], Settings::default(), u64::MAX);
    }
}
