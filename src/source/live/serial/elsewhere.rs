//! A serial port where there is no Linux: what `serialport` offers. Damaged characters are not
//! marked there, nothing is counted, and what the adapter keeps back is not known.

use super::Terms;
use super::counters::Counters;
use dissectors::uart::{Baud, Format, ParityMarks, ParityRule};
use serialport::{DataBits, FlowControl, Parity, SerialPort, StopBits};
use std::io::{self, Read};
use std::path::Path;
use std::time::Duration;

/// The latency timer of an FTDI adapter as it comes, and the host's part.
const UNCERTAINTY: Duration = Duration::from_millis(18);

/// A port that is listened to.
pub struct Port {
    port: Box<dyn SerialPort>,
    baud: Baud,
    format: Format,
}

impl Port {
    /// Opens and sets a port.
    ///
    /// # Errors
    /// It cannot be listened to: why.
    pub fn open(path: &Path, baud: Baud, format: Format) -> Result<Port, String> {
        let data_bits = match format.data_bits() {
            5 => DataBits::Five,
            6 => DataBits::Six,
            7 => DataBits::Seven,
            _ => DataBits::Eight,
        };
        let parity = match format.parity() {
            ParityRule::None => Parity::None,
            ParityRule::Even => Parity::Even,
            ParityRule::Odd => Parity::Odd,
            _ => return Err("mark and space parity can be set on Linux only".to_owned()),
        };
        let mut port = serialport::new(path.to_string_lossy(), baud.get())
            .data_bits(data_bits)
            .parity(parity)
            .stop_bits(StopBits::One)
            .flow_control(FlowControl::None)
            .dtr_on_open(false)
            .open()
            .map_err(|error| error.to_string())?;
        // A pseudo terminal has no modem lines.
        let _ = port.write_request_to_send(false);
        Ok(Port { port, baud, format })
    }

    /// Sets another rate.
    ///
    /// # Errors
    /// The port does not take it.
    pub fn set_baud(&mut self, baud: Baud) -> Result<(), String> {
        self.baud = baud;
        self.port.set_baud_rate(baud.get()).map_err(|error| error.to_string())
    }

    /// Waits for characters, for this long at most, and reads what there is: 0 where nothing came.
    ///
    /// # Errors
    /// The port is gone.
    pub fn read(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        self.port.set_timeout(patience)?;
        match self.port.read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::TimedOut => Ok(0),
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            read => read,
        }
    }

    /// Nothing is counted.
    pub fn counters(&self) -> Option<Counters> {
        None
    }

    /// What can be expected of it.
    pub fn terms(&self) -> Terms {
        Terms {
            is_marked: false,
            parity: ParityMarks::None,
            uncertainty: UNCERTAINTY,
            longest_wait: UNCERTAINTY,
        }
    }

    /// What was asked for, in a line.
    pub fn description(&self) -> String {
        format!("{} {}", self.baud, self.format)
    }

    /// What nobody can know of it, and how to find out.
    pub fn doubt(&self) -> Option<String> {
        None
    }

    /// What the user should know before believing what is heard.
    pub fn warnings(&self) -> Vec<String> {
        vec![
            "parity errors are marked on Linux only: the parity of characters is unknown"
                .to_owned(),
        ]
    }
}
