//! Devices in a ring that fieldtap knows. The ring never tells maker or product (an ID word says
//! "two words in and out" and no more), so that the user has to.

/// How a device's process words are read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Profile {
    /// TR-Electronic's linear encoder LA-66.
    La66 {
        /// The measuring length on the label of its rod, in µm.
        measuring_length_um: Option<u32>,
    },
}

impl Profile {
    /// How it is written.
    pub const FORM: &'static str = "la66:500mm";

    /// Reads `la66`, or `la66:` and the measuring length in mm.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let length = match text.split_once(':') {
            None => (text == "la66").then_some(None)?,
            Some(("la66", length)) => Some(micrometres(length)?),
            Some(_) => return None,
        };
        Some(Profile::La66 { measuring_length_um: length })
    }
}

/// A length in mm with at most three decimals, more than zero, in µm.
fn micrometres(text: &str) -> Option<u32> {
    let text = text.strip_suffix("mm")?.trim_end();
    let (whole, decimals) = text.split_once('.').unwrap_or((text, ""));
    let is_number = |digits: &str| digits.bytes().all(|digit| digit.is_ascii_digit());
    if whole.is_empty() || decimals.len() > 3 || !is_number(whole) || !is_number(decimals) {
        return None;
    }
    let thousandths = decimals.bytes().chain(core::iter::repeat(b'0')).take(3);
    let fraction = thousandths.fold(0, |sum, digit| sum * 10 + u32::from(digit - b'0'));
    let length = whole.parse::<u32>().ok()?.checked_mul(1000)?.checked_add(fraction)?;
    (length > 0).then_some(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_measuring_length_is_that_of_the_rod() {
        let length = |text: &str| match Profile::parse(text) {
            Some(Profile::La66 { measuring_length_um }) => measuring_length_um,
            None => Some(0),
        };
        assert_eq!(length("la66"), None);
        assert_eq!(length("la66:500mm"), Some(500_000));
        assert_eq!(length("la66:1250.5mm"), Some(1_250_500));
        for wrong in ["la66:", "la66:mm", "la66:0mm", "la66:500", "la66:5.1234mm", "la66:-5mm"] {
            assert_eq!(length(wrong), Some(0), "{wrong}");
        }
    }
}
