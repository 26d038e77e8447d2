//! How late a character may come, and so what its stamp is worth.

use super::adapter::Adapter;
use super::ioctl;
use serialport::TTYPort;
use std::time::Duration;

/// ± of a stamp for the host's part: a reader that is woken a scheduler tick late (4 ms at 250 Hz)
/// between two stamps falsifies what lies between them by twice this.
const HOST: Duration = Duration::from_millis(2);

/// How late characters may come.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Latency {
    /// What the adapter may keep a character for.
    pub adapter: Duration,
    /// What there is to say of it.
    pub told: String,
}

impl Latency {
    /// Shortens it as far as driver and rights allow, and looks what is in force.
    pub fn shorten(port: &TTYPort, adapter: &Adapter, character: Duration) -> Latency {
        let is_low = ioctl::set_low_latency(port);
        let set = |timer: &Duration| *timer > Duration::from_millis(1);
        if adapter.latency_timer().as_ref().is_some_and(set) {
            adapter.shorten_latency_timer();
        }
        let mut told = match is_low {
            Ok(true) => "low latency on".to_owned(),
            Ok(false) => "low latency not taken".to_owned(),
            Err(_) => "low latency not available".to_owned(),
        };
        if let Some(timer) = adapter.latency_timer() {
            told += &format!(", latency timer {} ms", timer.as_millis());
            if set(&timer) {
                told += " (this user may not set it: 1 ms would make times sharper)";
            }
        }
        Latency { told, ..Latency::default() }.at(adapter, character)
    }

    /// The same with characters of this length, which fill a receiver's buffer.
    pub fn at(self, adapter: &Adapter, character: Duration) -> Latency {
        Latency { adapter: adapter.wait(character), ..self }
    }

    /// ± of a stamp.
    pub fn uncertainty(&self) -> Duration {
        self.adapter + HOST
    }

    /// What came longer ago has arrived.
    pub fn longest(&self) -> Duration {
        self.adapter + 2 * HOST
    }
}
