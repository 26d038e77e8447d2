//! Frames that were on the bus and did not get here, from the three places that know of some:
//!
//! * the socket, where this program was too slow (`SO_RXQ_OVFL` with a frame, `SO_MEMINFO` at any
//!   time: the same count);
//! * the interface's statistics, where the driver found no room (`rx_fifo_errors`, `rx_dropped`) or
//!   the controller was overrun (`rx_over_errors`);
//! * error frames of the class CRTL, with which a driver tells of such an overrun as well.
//!
//! None is counted twice.

/// Those of the socket.
#[derive(Clone, Copy, Default, Debug)]
pub struct SocketDrops {
    told: u32,
}

impl SocketDrops {
    /// How many are new at this count, which wraps. The count of a frame is that of the time when
    /// it was queued, and so may be older than one that was told: then none.
    pub fn until(&mut self, count: u32) -> Option<u64> {
        let new = count.wrapping_sub(self.told);
        if new == 0 || new > u32::MAX / 2 {
            return None;
        }
        self.told = count;
        Some(u64::from(new))
    }
}

/// An interface's statistics of what it lost, since it was made (`linux/if_link.h`).
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Statistics {
    /// Overruns of the controller. An overrun is one or more frames.
    pub over: u64,
    /// Frames for which a queue of the driver had no room.
    pub fifo: u64,
    /// Frames for which there was no memory, or no room in a queue of the kernel.
    pub dropped: u64,
}

/// What the statistics tell that nothing else did.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Lost {
    /// Overruns that no error frame told.
    pub overruns: u64,
    /// Frames, as the driver counted them.
    pub frames: u64,
}

/// Those of the interface.
#[derive(Clone, Copy, Debug)]
pub struct InterfaceDrops {
    told: Statistics,
    /// As they were last time: what they had then, and no error frame told since, is told now. An
    /// error frame may still be queued while the statistics have its overrun.
    settled: Statistics,
    /// Overruns told by error frames that the statistics have not shown yet.
    ahead: u64,
}

impl InterfaceDrops {
    /// From here on.
    pub fn new(now: Statistics) -> Self {
        InterfaceDrops { told: now, settled: now, ahead: 0 }
    }

    /// An error frame told of an overrun.
    pub fn tell_overrun(&mut self) {
        self.ahead = self.ahead.saturating_add(1);
    }

    /// What is new, up to when this was asked last.
    pub fn until(&mut self, now: Statistics) -> Lost {
        let Statistics { over, fifo, dropped } = self.settled;
        let overruns = over.saturating_sub(self.told.over);
        let by_frame = overruns.min(self.ahead);
        self.ahead -= by_frame;
        // Most drivers count a frame without room in both (`can_rx_offload_offload_one`).
        let no_room = fifo.saturating_sub(self.told.fifo);
        let frames = no_room.max(dropped.saturating_sub(self.told.dropped));
        (self.told, self.settled) = (self.settled, now);
        Lost { overruns: overruns - by_frame, frames }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ZERO: Statistics = Statistics { over: 0, fifo: 0, dropped: 0 };
    const NOTHING: Lost = Lost { overruns: 0, frames: 0 };

    #[test]
    fn the_sockets_count_is_told_once_also_where_it_wraps() {
        let mut drops = SocketDrops::default();
        let told = [0, 5, 5, 3, 9].map(|count| drops.until(count));
        assert_eq!(told, [None, Some(5), None, None, Some(4)]);

        let mut drops = SocketDrops { told: u32::MAX - 1 };
        assert_eq!(drops.until(3), Some(5));
    }

    #[test]
    fn an_overrun_that_an_error_frame_told_is_not_told_again() {
        let once = Statistics { over: 1, ..ZERO };
        // The frame comes before the statistics are read, or after.
        for is_early in [true, false] {
            let mut drops = InterfaceDrops::new(ZERO);
            if is_early {
                drops.tell_overrun();
            }
            assert_eq!(drops.until(once), NOTHING);
            if !is_early {
                drops.tell_overrun();
            }
            assert_eq!([drops.until(once), drops.until(once)], [NOTHING; 2]);
        }
    }

    #[test]
    fn overruns_that_no_error_frame_told_are_told_once() {
        let mut drops = InterfaceDrops::new(Statistics { over: 100, ..ZERO });
        let later = Statistics { over: 103, ..ZERO };
        drops.tell_overrun();
        assert_eq!(drops.until(later), NOTHING);
        assert_eq!(drops.until(later), Lost { overruns: 2, frames: 0 });
        assert_eq!(drops.until(later), NOTHING);
    }

    #[test]
    fn a_frame_that_a_driver_counts_in_two_places_is_one() {
        let mut drops = InterfaceDrops::new(ZERO);
        drops.until(Statistics { fifo: 7, dropped: 7, ..ZERO });
        let last = Statistics { fifo: 7, dropped: 9, ..ZERO };
        assert_eq!(drops.until(last), Lost { overruns: 0, frames: 7 });
        assert_eq!(drops.until(last), Lost { overruns: 0, frames: 2 });
    }

    #[test]
    fn statistics_that_begin_anew_tell_nothing() {
        let mut drops = InterfaceDrops::new(Statistics { over: 9, fifo: 9, dropped: 9 });
        assert_eq!([drops.until(ZERO), drops.until(ZERO)], [NOTHING; 2]);
    }
}
