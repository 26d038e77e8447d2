//! pcapng with LINKTYPE_RTAC_SERIAL: runs of characters as blocks, stamped to the nanosecond.

use super::line::Parity;
use super::receiver::{Heard, Setup, State};
use super::tap::{Characters, Loss};
use crate::simulate::pcapng::{Blocks, Interface};
use crate::simulate::time::{Clock, NS, Ps};
use anyhow::{Context, Result};
use std::io::Write;

/// LINKTYPE_RTAC_SERIAL of the tcpdump registry.
const RTAC_SERIAL: u32 = 250;

/// Longest run of characters in one block.
const LONGEST: usize = 256;

/// A capture of this form.
pub struct Pcapng<W: Write> {
    out: Blocks<W>,
    /// The tap's own clock, by which readers place the characters of a block.
    clock: Clock,
    /// Duration of a character in bits.
    bits: f64,
    /// ± of the stamps.
    tolerance: Ps,
    /// A run of good characters that is not written yet: its start and bytes.
    run: (Ps, Vec<u8>),
}

/// What happened, as the link type numbers it.
#[derive(Clone, Copy)]
enum Event {
    Data = 0x02,
    Lost = 0x05,
    FramingError = 0x07,
    ParityError = 0x08,
    Break = 0x09,
    Overflow = 0x0A,
}

impl<W: Write> Pcapng<W> {
    /// Begins a capture of the interface `name`.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(out: W, name: &str, setup: Setup, start: u64) -> Result<Self> {
        let clock = Clock::exact(setup.baud);
        // A tap that looks at the line ten times a bit.
        let tolerance = clock.bits(0.1);
        let comment = Some(comment(setup, tolerance));
        let interface = Interface { link: RTAC_SERIAL, name, rate: setup.baud, comment };
        let out = Blocks::new(out, interface, start)?;
        let bits = if setup.parity == Parity::None { 10.0 } else { 11.0 };
        Ok(Pcapng { out, clock, bits, tolerance, run: (0, Vec::new()) })
    }

    /// Whether a reader who places the characters of the run one behind the other comes out right
    /// with this one, too.
    fn continues(&self, heard: &Heard) -> bool {
        let (start, bytes) = &self.run;
        let rebuilt = start + self.clock.bits(self.bits * bytes.len() as f64);
        !bytes.is_empty()
            && bytes.len() < LONGEST
            && (heard.start - rebuilt).abs() <= self.tolerance
    }

    fn write_run(&mut self) -> Result<()> {
        let (start, bytes) = std::mem::take(&mut self.run);
        if bytes.is_empty() { Ok(()) } else { self.write(Event::Data, start, &bytes) }
    }

    fn write(&mut self, event: Event, at: Ps, bytes: &[u8]) -> Result<()> {
        let time = self.out.date(at);
        let seconds = u32::try_from(time.as_secs()).context("beyond the year 2106")?;
        let mut data = Vec::with_capacity(12 + bytes.len());
        data.extend(seconds.to_be_bytes());
        data.extend(time.subsec_micros().to_be_bytes());
        data.extend([event as u8, 0, 0, 0]);
        data.extend(bytes);
        self.out.packet(at, &data, data.len(), Vec::new())
    }
}

/// What the stamps are worth, for readers that know.
fn comment(setup: Setup, tolerance: Ps) -> String {
    let (parity, format) = match setup.parity {
        Parity::None => ("none", "8N1"),
        Parity::Even => ("character", "8E1"),
        Parity::Odd => ("character", "8O1"),
    };
    format!("fieldtap-tap: clock=hardware pm_ns={} parity={parity} format={format}", tolerance / NS)
}

impl<W: Write> Characters for Pcapng<W> {
    fn character(&mut self, heard: &Heard) -> Result<()> {
        if heard.state.is_good() {
            if !self.continues(heard) {
                self.write_run()?;
                self.run.0 = heard.start;
            }
            self.run.1.push(heard.byte);
            return Ok(());
        }
        self.write_run()?;
        match heard.state {
            State::ParityError => self.write(Event::ParityError, heard.start, &[heard.byte]),
            State::FramingError => self.write(Event::FramingError, heard.start, &[heard.byte]),
            _ => self.write(Event::Break, heard.start, &[]),
        }
    }

    fn loss(&mut self, loss: Loss, at: Ps) -> Result<()> {
        self.write_run()?;
        let event = match loss {
            Loss::Overrun => Event::Overflow,
            Loss::Lost => Event::Lost,
        };
        self.write(event, at, &[])
    }

    fn end(mut self, at: Ps) -> Result<()> {
        self.write_run()?;
        self.out.end(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcap_file::pcapng::{Block, PcapNgReader};
    use std::time::Duration;

    const SETUP: Setup = Setup { baud: 115_200, parity: Parity::Even, is_swapped: false };

    fn blocks(file: &[u8]) -> Vec<(Duration, Vec<u8>)> {
        let mut reader = PcapNgReader::new(file).unwrap();
        let mut blocks = Vec::new();
        while let Some(block) = reader.next_block() {
            if let Block::EnhancedPacket(packet) = block.unwrap().0 {
                blocks.push((packet.timestamp, packet.data.into_owned()));
            }
        }
        blocks
    }

    #[test]
    fn a_block_is_a_run_that_a_reader_can_place() {
        let mut file = Vec::new();
        let mut pcapng = Pcapng::new(&mut file, "BUS", SETUP, 1_000).unwrap();
        let character = Clock::exact(115_200).characters(1.0);
        // The third comes 1 µs late, more than a tenth of a bit (0.868 µs).
        for (start, byte, state) in [
            (0, 0x1A, State::Good),
            (character, 0x01, State::Good),
            (2 * character + 1_000 * NS, 0x90, State::Good),
            (9 * character, 0x12, State::ParityError),
        ] {
            pcapng.character(&Heard { start, byte, state }).unwrap();
        }
        pcapng.loss(Loss::Overrun, 20 * character).unwrap();
        pcapng.end(30 * character).unwrap();
        let blocks = blocks(&file);
        let data: Vec<&[u8]> = blocks.iter().map(|(_, data)| &data[8..]).collect();
        let expected: [&[u8]; 4] = [
            &[0x02, 0, 0, 0, 0x1A, 0x01],
            &[0x02, 0, 0, 0, 0x90],
            &[0x08, 0, 0, 0, 0x12],
            &[0x0A, 0, 0, 0],
        ];
        assert_eq!(data, expected);
        // 9 characters of 95.486111 µs after 1000 s: 859375 ns.
        assert_eq!(blocks[2].0, Duration::new(1_000, 859_375));
        assert_eq!(blocks[2].1[..8], [0, 0, 0x03, 0xE8, 0, 0, 0x03, 0x5B]);
    }
}
