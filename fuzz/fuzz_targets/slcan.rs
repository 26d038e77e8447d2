#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fieldtap::source::live::fuzz_slcan(bytes);
});
