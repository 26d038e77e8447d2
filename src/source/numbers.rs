//! Numbers of text captures, exact to the nanosecond.

use dissectors::event::Moment;
use nom::branch::alt;
use nom::bytes::complete::{tag, take_while_m_n, take_while1};
use nom::character::complete::{char, digit0, digit1};
use nom::combinator::{all_consuming, map_opt, opt, recognize};
use nom::sequence::preceded;
use nom::{IResult, Parser};

/// A time in seconds, and what its last digit is worth in ns.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Stamp {
    /// The time.
    pub time: Moment,
    /// Its resolution in ns, at least 1.
    pub resolution: u32,
}

/// Seconds as a decimal number, such as `12.345678901`; digits beyond the ninth are rounded.
pub fn seconds(input: &[u8]) -> IResult<&[u8], Stamp> {
    let (input, sign) = opt(alt((char('-'), char('+')))).parse(input)?;
    let (input, whole) = map_opt(digit1, number).parse(input)?;
    let (input, fraction) = opt(preceded(char('.'), digit0)).parse(input)?;
    let (input, exponent) = opt(exponent).parse(input)?;
    let digits = fraction.unwrap_or_default();
    let stamp = stamp(sign == Some('-'), whole, digits, exponent.unwrap_or(0));
    match stamp {
        Some(stamp) => Ok((input, stamp)),
        None => {
            Err(nom::Err::Error(nom::error::make_error(input, nom::error::ErrorKind::TooLarge)))
        }
    }
}

/// Seconds, in ns.
pub fn seconds_in_ns(text: &str) -> Option<i64> {
    whole(seconds, text.as_bytes())?.time.ns()
}

/// A frequency in Hz: `12000000`, `500k`, `4M`, `4 MHz`, `1.5 MHz`.
pub fn frequency(text: &str) -> Option<u64> {
    let text = text.trim();
    let text = text.strip_suffix("Hz").or(text.strip_suffix("hz")).unwrap_or(text);
    let (digits, power) = match text.char_indices().last()? {
        (end, 'k' | 'K') => (&text[..end], 3),
        (end, 'm' | 'M') => (&text[..end], 6),
        (end, 'g' | 'G') => (&text[..end], 9),
        _ => (text, 0),
    };
    let (whole, fraction) = digits.trim_end().split_once('.').unwrap_or((digits.trim_end(), ""));
    let fraction = fraction.trim_end_matches('0');
    let is_number = |digits: &str| digits.bytes().all(|byte| byte.is_ascii_digit());
    if whole.is_empty() || !is_number(whole) || !is_number(fraction) || fraction.len() > power {
        return None;
    }
    let digits: u64 = format!("{whole}{fraction}").parse().ok()?;
    let zeros = u32::try_from(power - fraction.len()).ok()?;
    digits.checked_mul(10_u64.pow(zeros)).filter(|frequency| *frequency > 0)
}

/// A byte as two hex digits, or up to `max` of them.
pub fn hex(max: usize) -> impl Fn(&[u8]) -> IResult<&[u8], u16> {
    move |input| {
        let digits = take_while_m_n(1, max, |byte: u8| byte.is_ascii_hexdigit());
        map_opt(digits, |digits: &[u8]| {
            u16::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()
        })
        .parse(input)
    }
}

/// A whole field: nothing may be left over.
pub fn whole<'a, T>(
    parser: impl Parser<&'a [u8], Output = T, Error = nom::error::Error<&'a [u8]>>,
    input: &'a [u8],
) -> Option<T> {
    all_consuming(parser).parse(input).ok().map(|(_, value)| value)
}

fn exponent(input: &[u8]) -> IResult<&[u8], i32> {
    let (input, _) = alt((tag("e"), tag("E"))).parse(input)?;
    map_opt(
        recognize((opt(alt((char('-'), char('+')))), take_while1(|b: u8| b.is_ascii_digit()))),
        |digits: &[u8]| std::str::from_utf8(digits).ok()?.parse::<i16>().ok().map(i32::from),
    )
    .parse(input)
}

fn number(digits: &[u8]) -> Option<i64> {
    digits
        .iter()
        .try_fold(0_i64, |value, digit| value.checked_mul(10)?.checked_add(i64::from(digit - b'0')))
}

/// Puts sign, whole seconds, decimals and exponent together, in ns.
fn stamp(is_negative: bool, whole: i64, digits: &[u8], exponent: i32) -> Option<Stamp> {
    let decimals = i32::try_from(digits.len()).ok()?;
    // Value = (whole, digits as one number) * 10^(exponent - decimals) s.
    let kept = digits.get(..18).unwrap_or(digits);
    let dropped = decimals - i32::try_from(kept.len()).ok()?;
    let scale = exponent.checked_sub(decimals)?.checked_add(9 + dropped)?;
    let mantissa = kept.iter().try_fold(i128::from(whole), |value, digit| {
        value.checked_mul(10)?.checked_add(i128::from(digit - b'0'))
    })?;
    let ns = if scale >= 0 {
        mantissa.checked_mul(10_i128.checked_pow(scale.unsigned_abs())?)?
    } else {
        match 10_i128.checked_pow(scale.unsigned_abs()) {
            Some(divisor) => (mantissa + divisor / 2) / divisor,
            None => 0,
        }
    };
    let ns = i64::try_from(ns).ok()?;
    let worth = exponent - decimals + 9;
    let resolution = 10_u32.checked_pow(worth.max(0).unsigned_abs()).unwrap_or(u32::MAX);
    Some(Stamp { time: Moment::from_ns(if is_negative { -ns } else { ns }), resolution })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<(i64, u32)> {
        whole(seconds, text.as_bytes()).map(|stamp| (stamp.time.ns().unwrap(), stamp.resolution))
    }

    #[test]
    fn seconds_are_exact_to_the_nanosecond() {
        assert_eq!(read("0"), Some((0, 1_000_000_000)));
        assert_eq!(read("1.5"), Some((1_500_000_000, 100_000_000)));
        assert_eq!(read("1700000000.123456789"), Some((1_700_000_000_123_456_789, 1)));
        assert_eq!(read("-0.000001"), Some((-1_000, 1_000)));
        // Saleae: 15 decimals, sometimes with a trace of binary fractions, or an exponent.
        assert_eq!(read("0.042909760000000"), Some((42_909_760, 1)));
        assert_eq!(read("0.0003731000000000001"), Some((373_100, 1)));
        assert_eq!(read("2.00000068e-09"), Some((2, 1)));
        assert_eq!(read("1e3"), Some((1_000_000_000_000, u32::MAX)));
    }

    #[test]
    fn what_is_not_a_time_is_refused() {
        for text in
            ["", ".5", "1.5s", "abc", "1,5", "99999999999999999999", "1e99", "1e2147483647", "--1"]
        {
            assert_eq!(read(text), None, "{text}");
        }
    }

    #[test]
    fn frequencies_are_read_as_people_write_them() {
        for (text, hertz) in [
            ("12000000", 12_000_000),
            ("500k", 500_000),
            ("500 kHz", 500_000),
            ("4M", 4_000_000),
            ("4 MHz", 4_000_000),
            ("1.5 MHz", 1_500_000),
            ("1 GHz", 1_000_000_000),
            ("1.50 kHz", 1_500),
        ] {
            assert_eq!(frequency(text), Some(hertz), "{text}");
        }
        for text in ["", "0", "k", "-1", "1.5", "1.2345k", "4 M Hz", "MHz", "1e6"] {
            assert_eq!(frequency(text), None, "{text}");
        }
    }

    #[test]
    fn hex_fields_have_as_many_digits_as_said() {
        assert_eq!(whole(hex(2), b"1A"), Some(0x1A));
        assert_eq!(whole(hex(2), b"f"), Some(0x0F));
        assert_eq!(whole(hex(2), b"1AB"), None);
        assert_eq!(whole(hex(3), b"1AB"), Some(0x1AB));
        assert_eq!(whole(hex(2), b"0x"), None);
    }
}
