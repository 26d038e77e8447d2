//! The taps on real kernels: a small virtual machine with CAN interfaces and serial adapters.
//!
//! This program is there twice. On the host it builds an initramfs of itself, `fieldtap` and the
//! modules of a stock kernel, and boots it. In the machine it runs the scenarios, which are tests
//! that are ignored anywhere else. `FIELDTAP_LAB=vcan cargo test --test lab` runs those of that name.
#![cfg(target_os = "linux")]

mod archive;
mod guest;
mod machine;

#[test]
fn the_taps_hold_on_real_kernels() {
    let scenarios = std::env::var("FIELDTAP_LAB").unwrap_or_default();
    if let Some(machine) = machine::Machine::find() {
        machine.run(&scenarios.split_whitespace().collect::<Vec<_>>());
    }
}
