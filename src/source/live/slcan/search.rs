//! Finding the bit rate by listening at each that DeviceNet has. At another rate than that of the
//! bus, a controller hears no frame, only errors.

use super::adapter::Rate;
use dissectors::can::{ErrorDetail, Frame, FrameKind};
use std::time::{Duration, Instant};

/// The rates of DeviceNet (CIP Vol 3 §8), the usual one first.
const RATES: [u32; 3] = [125_000, 250_000, 500_000];

/// How long each is listened to.
const WINDOW: Duration = Duration::from_secs(2);

/// Most frames that are kept to be told once the rate is known. The shortest one has 47 bits: at
/// 500 kbit/s 21,276 of them come in that time. Those that come besides, because they waited on the
/// port or no bus sent them, are counted.
const MOST: usize = 32_768;

/// What is said of it at the beginning.
pub fn told() -> String {
    let rates = RATES.map(|rate| (rate / 1_000).to_string()).join(", ");
    format!("looking for the bit rate: {rates} kbit/s, {} s each at most", WINDOW.as_secs())
}

/// Listening at one rate after the other.
pub struct Search {
    rate: usize,
    until: Instant,
    /// What was heard at this rate.
    frames: Vec<Frame>,
    /// Frames that there was no room for.
    dropped: u64,
    errors: u64,
    /// The adapter said something that is no slcan.
    is_misread: bool,
    /// Frames and errors at the rates before.
    heard: Vec<(usize, u64)>,
}

/// What comes next.
pub enum Step {
    /// Go on listening.
    Wait,
    /// Listen at the next rate.
    Next(Rate),
    /// This is the rate; the adapter listens at it, and heard these frames, then so many more that
    /// were dropped.
    Found(Vec<Frame>, u64),
    /// This may be the rate: frames came, and errors too. The adapter listens at another one.
    Likely(Rate),
    /// None is: why.
    Failed(String),
}

impl Search {
    /// Begins with the first rate.
    pub fn begin(now: Instant) -> Self {
        let (frames, heard) = (Vec::new(), Vec::new());
        Search {
            rate: 0,
            until: now + WINDOW,
            frames,
            dropped: 0,
            errors: 0,
            is_misread: false,
            heard,
        }
    }

    /// The rate that is listened to.
    pub fn rate(&self) -> Rate {
        rate(self.rate)
    }

    /// Begins to listen at the rate.
    pub fn begin_window(self, now: Instant) -> Self {
        Search { until: now + WINDOW, ..self }
    }

    /// A frame was heard, or an error frame.
    pub fn hear(&mut self, frame: Frame) {
        match frame.kind {
            FrameKind::Error => {
                let detail = ErrorDetail::of(&frame);
                if !detail.is_some_and(|detail| detail.is_recovery()) {
                    self.err();
                }
            }
            _ if self.frames.len() < MOST => self.frames.push(frame),
            _ => self.dropped = self.dropped.saturating_add(1),
        }
    }

    /// The adapter said something that is no slcan.
    pub fn misread(&mut self) {
        self.is_misread = true;
        self.err();
    }

    /// An error was heard.
    fn err(&mut self) {
        self.errors = self.errors.saturating_add(1);
    }

    /// What is to be done now.
    pub fn step(&mut self, now: Instant) -> Step {
        if now < self.until {
            return Step::Wait;
        }
        let frames = std::mem::take(&mut self.frames);
        let dropped = std::mem::take(&mut self.dropped);
        let errors = std::mem::take(&mut self.errors);
        if !frames.is_empty() && errors == 0 {
            return Step::Found(frames, dropped);
        }
        self.heard.push((frames.len(), errors));
        self.rate += 1;
        if self.rate < RATES.len() {
            return Step::Next(self.rate());
        }
        let best = (0..RATES.len()).max_by_key(|index| (self.heard[*index].0, RATES.len() - index));
        match best {
            Some(best) if self.heard[best].0 > 0 => Step::Likely(rate(best)),
            _ => Step::Failed(self.failure()),
        }
    }

    /// It ends before its time: what was heard at this rate, where that proves it, else why it is
    /// not known.
    pub fn cut_short(mut self) -> Result<Vec<Frame>, String> {
        if self.errors == 0 && !self.frames.is_empty() {
            return Ok(self.frames);
        }
        self.heard.push((self.frames.len(), self.errors));
        Err(format!("the bit rate was not found before the end: {}", self.account()))
    }

    fn account(&self) -> String {
        let told =
            RATES.iter().zip(&self.heard).map(|(rate, (frames, errors))| match (frames, errors) {
                (0, 0) => format!("nothing at {rate}"),
                (frames @ 1.., errors) => {
                    format!("frames ({frames}) and errors ({errors}) at {rate}")
                }
                (0, errors) => format!("{errors} errors at {rate}"),
            });
        format!("{} bit/s", told.collect::<Vec<_>>().join(", "))
    }

    fn failure(&self) -> String {
        if self.is_misread {
            return format!(
                "no frame was heard: {}. The adapter sends, but not slcan: is it the right port, at \
                 the right rate, with firmware that speaks slcan?",
                self.account()
            );
        }
        format!(
            "no frame was heard: {}. Is the bus running, CAN_H and CAN_L not swapped? A bus \
             that is silent for a while, or has another rate, needs --bitrate",
            self.account()
        )
    }
}

fn rate(index: usize) -> Rate {
    let bitrate = RATES[index.min(RATES.len() - 1)];
    Rate::new(bitrate).unwrap_or_else(|what| unreachable!("{what}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dissectors::can::Identifier;
    use dissectors::event::Moment;

    const FRAME: Frame =
        Frame::new(Moment::UNKNOWN, 0, FrameKind::Data, Identifier::Standard(0x40D), 0);
    const ERROR: Frame =
        Frame::new(Moment::UNKNOWN, 0, FrameKind::Error, Identifier::Extended(0x80), 8);

    /// What comes of so many frames and errors at the three rates.
    fn search(heard: [(usize, usize); 3]) -> String {
        let begin = Instant::now();
        let mut search = Search::begin(begin);
        for (window, (frames, errors)) in (1..).zip(heard) {
            assert!(matches!(search.step(begin), Step::Wait));
            (0..frames).for_each(|_| search.hear(FRAME));
            (0..errors).for_each(|_| search.hear(ERROR));
            match search.step(begin + WINDOW * window) {
                Step::Wait => panic!("the time is up"),
                Step::Next(_) => search = search.begin_window(begin + WINDOW * window),
                Step::Found(frames, dropped) => {
                    return format!("{} {} {dropped}", search.rate().get(), frames.len());
                }
                Step::Likely(rate) => return format!("likely {}", rate.get()),
                Step::Failed(why) => return why,
            }
        }
        panic!("it goes on for ever")
    }

    #[test]
    fn the_first_rate_with_frames_and_no_errors_is_it() {
        assert_eq!(search([(1, 0), (0, 0), (0, 0)]), "125000 1 0");
        assert_eq!(search([(0, 9), (7, 0), (0, 0)]), "250000 7 0");
    }

    /// 47 bits are a frame without data, 44, and what lies between two, 3 (ISO 11898-1).
    #[test]
    fn as_many_as_a_bus_can_carry_are_kept_and_what_is_beyond_is_counted() {
        let full = 2 * 500_000 / 47;
        assert_eq!(search([(0, 0), (0, 9), (full, 0)]), "500000 21276 0");
        assert_eq!(search([(0, 0), (0, 9), (MOST + 7, 0)]), format!("500000 {MOST} 7"));
    }

    #[test]
    fn a_disturbed_bus_still_has_frames_at_its_rate_alone() {
        assert_eq!(search([(0, 50), (100, 3), (0, 50)]), "likely 250000");
    }

    #[test]
    fn what_was_heard_before_it_ends_counts() {
        let mut search = Search::begin(Instant::now());
        search.hear(FRAME);
        assert!(search.cut_short().is_ok_and(|frames| frames == [FRAME]));
        let mut search = Search::begin(Instant::now());
        search.hear(FRAME);
        search.hear(ERROR);
        let why = search.cut_short().unwrap_err();
        assert!(
            why.ends_with("before the end: frames (1) and errors (1) at 125000 bit/s"),
            "{why}"
        );
    }

    #[test]
    fn a_silent_bus_has_none() {
        let why = search([(0, 0), (0, 4), (0, 0)]);
        let told = "nothing at 125000, 4 errors at 250000, nothing at 500000 bit/s";
        assert!(why.contains(told), "{why}");
    }

    #[test]
    fn an_adapter_that_cannot_be_read_is_no_silent_bus() {
        let begin = Instant::now();
        let mut search = Search::begin(begin);
        search.misread();
        let last = (1..=3).map(|window| search.step(begin + WINDOW * window)).last();
        let Some(Step::Failed(why)) = last else { panic!("nothing was found") };
        assert!(why.contains("1 errors at 125000") && why.contains("not slcan"), "{why}");
        assert!(!why.contains("CAN_H"), "{why}");
    }
}
