//! What runs in the machine: a file for each thing that is listened to.

mod adapters;
mod can;
mod kvaser;
mod serial;
mod soak;
mod tap;
mod usbip;
mod vcan;

/// Scenarios set up interfaces and load drivers: not on anybody's host.
fn only_in_the_machine() {
    let place = std::env::var("FIELDTAP_LAB").unwrap_or_default();
    assert_eq!(place, "guest", "this runs in the virtual machine: cargo test --test lab");
}
