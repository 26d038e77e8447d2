//! Lines of rings with a format nobody was told: made from a random profile, heard as levels, and
//! found out. What is claimed has to be right; what cannot be known has to be said.

mod ring;

use fieldtap_dissectors::setting::{Origin, Setting};
use ring::{Chance, Heard, Plan, hear};

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
