//! Where a capture goes, and in which form: what every bus has.

use super::frequency;
use crate::decode::INTERRUPTED;
use crate::interrupt;
use crate::output::Output;
use crate::simulate::{Sampler, Samples, Sr, Vcd};
use anyhow::{Context, Result, ensure};
use clap::{Args, ValueEnum};
use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The forms that a bus can be captured in.
pub trait Form: ValueEnum + Send + Sync + 'static {
    /// Their endings, in words.
    const ENDINGS: &'static str;

    /// How it holds the levels of the line, if it does.
    fn levels(&self) -> Option<Levels>;
}

/// The forms that hold levels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Levels {
    /// A sigrok session.
    Sr,
    /// Text.
    Vcd,
}

/// Where to write, and how.
#[derive(Args, Debug)]
pub struct Destination<F: Form> {
    /// Where to write the capture: a file, or - for standard output. The ending names the form.
    #[arg(short, long, value_name = "FILE", required_unless_present = "list_faults")]
    output: Option<PathBuf>,

    /// Form of the capture, instead of what the ending says.
    #[arg(long, value_name = "FORM")]
    output_format: Option<F>,

    /// Write what was sent and what must be found, as JSON Lines.
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,

    /// Say less: only errors on standard error.
    #[arg(short, long)]
    pub quiet: bool,

    /// Sample rate of line levels, such as 4M or 500k.
    #[arg(long, value_name = "HZ", default_value = "4M", value_parser = frequency, help_heading = "Capture")]
    samplerate: u64,

    /// Write line levels upside down, as a logic analyzer on the other line sees them.
    #[arg(long, help_heading = "Capture")]
    inverted: bool,
}

impl<F: Form> Destination<F> {
    /// The form of the capture.
    ///
    /// # Errors
    /// Neither option nor ending names one.
    pub fn form(&self) -> Result<F> {
        if let Some(form) = &self.output_format {
            return Ok(form.clone());
        }
        let ending = self.path().extension().and_then(OsStr::to_str);
        let form = ending.and_then(|ending| F::from_str(ending, true).ok());
        form.with_context(|| {
            let endings = F::ENDINGS;
            format!("the output's ending names no form: name it {endings}, or say --output-format")
        })
    }

    /// Refuses what the form cannot hold, of a line with this rate that takes so many samples a
    /// bit.
    ///
    /// # Errors
    /// The reason, in words.
    pub fn check(&self, rate: u32, unit: &str, samples: u64) -> Result<()> {
        let levels = self.form()?.levels();
        ensure!(
            !self.inverted || levels.is_some(),
            "--inverted is for line levels: write .sr or .vcd"
        );
        ensure!(
            levels.is_none() || self.samplerate >= samples * u64::from(rate),
            "--samplerate is too low for {rate} {unit}: take {samples} samples a bit at least"
        );
        ensure!(
            !self.is_stdout() || levels != Some(Levels::Sr),
            ".sr cannot be written to standard output: name a file"
        );
        Ok(())
    }

    /// Begins to write.
    ///
    /// # Errors
    /// A file cannot be made.
    pub fn open(&self) -> Result<Files> {
        interrupt::catch(INTERRUPTED);
        let capture = if self.is_stdout() { None } else { Some(Output::create(self.path())?) };
        let is_stdout = self.truth.as_deref() == Some(Path::new("-"));
        let truth = self.truth.as_deref().filter(|_| !is_stdout).map(Output::create).transpose()?;
        let is_told = Arc::default();
        Ok(Files { capture, truth, is_truth_on_stdout: is_stdout, is_told })
    }

    /// A tap that samples these channels into the capture. A tap that was swapped sees them upside
    /// down.
    ///
    /// # Errors
    /// The capture cannot be begun.
    pub fn sampler(
        &self,
        files: &Files,
        form: Levels,
        channels: &[&str],
        is_swapped: bool,
    ) -> Result<Sampler> {
        let rate = self.samplerate;
        let capture: Box<dyn Samples> = match form {
            Levels::Sr => {
                let file = BufWriter::new(files.stoppable(files.seekable()?));
                Box::new(Sr::new(file, channels, rate)?)
            }
            Levels::Vcd => Box::new(Vcd::new(files.capture()?, channels, rate)?),
        };
        Ok(Sampler::new(rate, channels.len(), self.inverted != is_swapped, capture))
    }

    /// Where the capture goes.
    pub fn path(&self) -> &Path {
        self.output.as_deref().unwrap_or(Path::new("-"))
    }

    fn is_stdout(&self) -> bool {
        self.path() == Path::new("-")
    }
}

/// The files of a run. They get their names when all of it is written.
pub struct Files {
    /// Standard output if there is none.
    capture: Option<Output>,
    truth: Option<Output>,
    is_truth_on_stdout: bool,
    /// Whether a writer has told of the user's interruption.
    is_told: Arc<AtomicBool>,
}

impl Files {
    /// What to write the capture to.
    ///
    /// # Errors
    /// The system does not let it be written.
    pub fn capture(&self) -> Result<Box<dyn Write>> {
        match &self.capture {
            None => Ok(Box::new(BufWriter::new(self.stoppable(io::stdout())))),
            Some(output) => self.writer(output),
        }
    }

    /// What to write the truth to, if anybody wants to know.
    ///
    /// # Errors
    /// The system does not let it be written.
    pub fn truth(&self) -> Result<Option<Box<dyn Write>>> {
        if self.is_truth_on_stdout {
            return Ok(Some(Box::new(BufWriter::new(io::stdout()))));
        }
        self.truth.as_ref().map(|output| self.writer(output)).transpose()
    }

    fn writer(&self, output: &Output) -> Result<Box<dyn Write>> {
        Ok(Box::new(BufWriter::new(self.stoppable(output.file().try_clone()?))))
    }

    fn stoppable<W>(&self, inner: W) -> Stoppable<W> {
        Stoppable { inner, is_told: Arc::clone(&self.is_told) }
    }

    fn seekable(&self) -> Result<File> {
        let output = self.capture.as_ref().context("name a file")?;
        Ok(output.file().try_clone()?)
    }

    /// All is written.
    ///
    /// # Errors
    /// A file cannot get its name, or the user interrupted before all was written.
    pub fn keep(self) -> Result<()> {
        ensure!(!interrupt::came(), "interrupted");
        self.capture.map(Output::replace).transpose()?;
        self.truth.map(Output::replace).transpose()?;
        Ok(())
    }
}

/// What is written to until the user interrupts: that is an error, once for all files. What follows
/// is lost, for an archive that is ended in haste would only complain.
struct Stoppable<W> {
    inner: W,
    is_told: Arc<AtomicBool>,
}

impl<W: Write> Write for Stoppable<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if !interrupt::came() {
            return self.inner.write(bytes);
        }
        match self.is_told.swap(true, Ordering::Relaxed) {
            true => Ok(bytes.len()),
            false => Err(io::Error::other("interrupted")),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<W: Seek> Seek for Stoppable<W> {
    fn seek(&mut self, place: SeekFrom) -> io::Result<u64> {
        self.inner.seek(place)
    }
}
