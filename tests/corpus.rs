//! What the fuzz targets ever tripped over, what they begin with, and the sample captures: none of
//! it may panic. Stable Rust is enough for this.

#[path = "../fuzz/src/lib.rs"]
mod fuzz;

use fieldtap::source::InputFormat;
use std::path::Path;

/// Runs what is in the corpus of a target, and returns how much that is.
fn run(target: &str, with: impl Fn(&[u8])) -> usize {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let mut count = 0;
    for entry in std::fs::read_dir(&folder).unwrap_or_else(|_| panic!("{}", folder.display())) {
        let path = entry.expect("an entry").path();
        println!("{}", path.display());
        with(&std::fs::read(path).expect("it can be read"));
        count += 1;
    }
    count
}

/// Every prefix of a short capture, and every capture with a byte changed here and there.
fn battered(format: InputFormat, bytes: &[u8]) {
    fuzz::capture(format, bytes);
    for end in (0..bytes.len().min(600)).step_by(7) {
        fuzz::capture(format, &bytes[..end]);
    }
    let mut changed = bytes.to_vec();
    for at in (0..bytes.len().min(2_000)).step_by(31) {
        changed[at] ^= 0xFF;
        fuzz::capture(format, &changed);
        changed[at] ^= 0x81;
    }
}

/// The bytes, and with one of them changed here and there.
fn changed(bytes: &[u8], with: impl Fn(&[u8])) {
    with(bytes);
    let mut changed = bytes.to_vec();
    for at in (0..bytes.len()).step_by(1 + bytes.len() / 60) {
        changed[at] ^= 0x55;
        with(&changed);
    }
}

#[test]
fn nothing_saved_trips_a_target() {
    use InputFormat::{
        Asc, Bytes, Candump, CandumpText, Chars, InterbusDiagnostic, InterbusId, InterbusLog,
        Logic, Parmrk, Pcap, Pcapng, SaleaeBin, SaleaeCsv, SaleaeTable, Sr, Trc, Uart9, Vcd,
    };
    for (target, format) in [
        ("asc", Asc),
        ("bytes", Bytes),
        ("candump", Candump),
        ("candump_text", CandumpText),
        ("chars", Chars),
        ("interbus_diagnostic", InterbusDiagnostic),
        ("interbus_id", InterbusId),
        ("interbus_log", InterbusLog),
        ("logic", Logic),
        ("parmrk", Parmrk),
        ("pcap", Pcap),
        ("saleae_bin", SaleaeBin),
        ("saleae_csv", SaleaeCsv),
        ("saleae_table", SaleaeTable),
        ("trc", Trc),
        ("uart9", Uart9),
        ("vcd", Vcd),
    ] {
        assert!(run(target, |bytes| battered(format, bytes)) > 0, "{target}");
    }
    let captures = Path::new(env!("CARGO_MANIFEST_DIR")).join("captures/good");
    for (name, format) in
        [("tr-115200.pcapng", Pcapng), ("tr.sr", Sr), ("tr.vcd", Vcd), ("tr.chars", Chars)]
    {
        battered(format, &std::fs::read(captures.join(name)).expect("it is there"));
    }
    assert!(run("characters", fuzz::characters) > 0);
    assert!(run("levels", fuzz::levels) > 0);
    assert!(run("frames", fuzz::frames) > 0);
    assert!(run("eds", fuzz::eds) > 0);
    assert!(run("rows", |bytes| changed(bytes, fuzz::rows)) > 0);
    assert!(run("ring_lines", |bytes| changed(bytes, fuzz::ring_lines)) > 0);
}
