//! What every decoding command does: read the sources, pass records on, and end well.

use crate::cli::{Auto, Decoding, Invert};
use crate::export::Export;
use crate::pipeline::Pipeline;
use crate::source::{self, SourceOptions};
use dissectors::protocol::Settings;
use dissectors::slin;
use dissectors::uart::LineSettings;
use std::process::ExitCode;

/// How a run ended.
#[derive(Default, Debug)]
pub struct Outcome {
    has_source_failed: bool,
    is_interrupted: bool,
    has_findings: bool,
    is_pipe_closed: bool,
}

impl Outcome {
    /// 3 outranks 130 outranks 1; a closed pipe is none of these.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Outcome { is_pipe_closed: true, .. } => 0,
            Outcome { has_source_failed: true, .. } => 3,
            Outcome { is_interrupted: true, .. } => 130,
            Outcome { has_findings: true, .. } => 1,
            _ => 0,
        })
    }
}

/// Decodes the sources into `export`.
pub fn decode(decoding: &Decoding, export: &mut dyn Export) -> Outcome {
    let mut outcome = Outcome::default();
    let mut pipeline = Pipeline::new(settings(decoding));
    let options = source_options(decoding);
    for name in &decoding.sources {
        let passed = source::open(name, &options)
            .and_then(|mut source| pipeline.pass(&mut *source, export, || true));
        if let Err(error) = passed {
            eprintln!("fieldtap: {error}");
            outcome.has_source_failed = true;
            break;
        }
    }
    pipeline.finish(export);
    outcome
}

/// What the user says about the sources.
pub fn source_options(decoding: &Decoding) -> SourceOptions {
    SourceOptions {
        format: decoding.input_format,
        channels: decoding.channel.clone(),
        samplerate: decoding.samplerate,
        unitsize: usize::from(decoding.unitsize),
        baud: decoding.baud.given(),
    }
}

/// What the user decided about the bus.
pub fn settings(decoding: &Decoding) -> Settings {
    let inverted = match decoding.invert {
        Invert::Auto => None,
        Invert::Yes => Some(true),
        Invert::No => Some(false),
    };
    let line =
        LineSettings { baud: decoding.baud.given(), format: decoding.frame.given(), inverted };
    let checksum = decoding.checksum.unwrap_or_default();
    Settings {
        protocol: match decoding.protocol {
            Auto::Given(protocol) => Some(protocol),
            Auto::Auto => None,
        },
        line,
        slin: slin::Settings { profile: decoding.profile, checksum },
        ..Settings::default()
    }
}
