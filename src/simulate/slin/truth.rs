//! What an observer who misses nothing must find: the generator's own account of the bus.
//!
//! `--truth` is JSON Lines. The first line is the bus, `{"bus":{…}}`: what was ordered, what
//! chance made of it (clock errors in ppm), and `expect`: the codes that the capture must raise once
//! as a whole. Then follows a line an exchange, in the order of time:
//!
//! | key | meaning |
//! |---|---|
//! | `exchange` | number, from 1 |
//! | `time_ns`, `end_ns` | start bit of the request, end of the last stop bit that belongs to it: ns since the Unix epoch, or since the capture's start where the form has no date |
//! | `asked` | the address in the request |
//! | `address` | the address in the footer, if one was sent |
//! | `position` | what the answer says, where its words can be told; low word first |
//! | `bytes` | request and answer as they arrive, flipped bits included, upper-case hex |
//! | `stray` | bytes of somebody else in the same time: after the exchange, or over it |
//! | `response_time_ns` | end of the request's stop bit to the answer's first start bit |
//! | `fault` | what was injected; absent if nothing was |
//! | `about` | the exchange that an expected `slin.position-jump` is about |
//! | `state` | `begin` or `end`, if `slin.no-response` is told as a state here |
//! | `expect` | the codes that must be told between this `time_ns` and the next line's, sorted |
//! | `may` | codes that may be told besides, or `"any"`, where damage leaves it open |

use super::memory::Silence;
use serde::Serialize;

/// A code that must be told.
pub type Code = &'static str;

/// A line of the account.
#[derive(Clone, Default, Debug, Serialize)]
pub struct Told {
    /// Number of the exchange.
    pub exchange: u64,
    /// When it began, in ns.
    pub time_ns: i64,
    /// When it ended.
    pub end_ns: i64,
    /// Which address was asked.
    pub asked: u8,
    /// Which address the footer names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub address: Option<u8>,
    /// What the answer says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<u32>,
    /// Request and answer as they arrive.
    pub bytes: String,
    /// Bytes of somebody else.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stray: Option<String>,
    /// How long the answer took to begin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub response_time_ns: Option<i64>,
    /// What was injected.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault: Option<String>,
    /// Which exchange a jump is about.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub about: Option<u64>,
    /// Whether a state begins or ends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<&'static str>,
    /// What must be told.
    pub expect: Vec<Code>,
    /// What may be told.
    #[serde(skip_serializing_if = "May::is_nothing")]
    pub may: May,
}

impl Told {
    /// This must be told.
    pub fn expect(&mut self, code: Code) {
        if let Err(place) = self.expect.binary_search(&code) {
            self.expect.insert(place, code);
        }
    }

    /// This must be told of a silence.
    pub fn expect_silence(&mut self, silence: Option<Silence>) {
        let Some(silence) = silence else { return };
        self.expect(match silence {
            Silence::Never => "slin.never-answered",
            Silence::Once | Silence::Begin | Silence::End => "slin.no-response",
        });
        self.state = match silence {
            Silence::Begin => Some("begin"),
            Silence::End => Some("end"),
            Silence::Never | Silence::Once => None,
        };
    }
}

/// What may be told besides.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
#[serde(untagged)]
pub enum May {
    /// These codes.
    Codes(Vec<Code>),
    /// Whatever.
    Any(Any),
}

/// Whatever.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Any {
    /// The word for it.
    Any,
}

impl May {
    /// Anything may be told.
    pub const ANY: May = May::Any(Any::Any);

    /// This may be told, too.
    pub fn add(&mut self, code: Code) {
        if let May::Codes(codes) = self {
            codes.push(code);
        }
    }

    fn is_nothing(&self) -> bool {
        *self == May::default()
    }
}

impl Default for May {
    fn default() -> Self {
        May::Codes(Vec::new())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::hex;

    #[test]
    fn a_line_has_only_what_applies() {
        let mut told =
            Told { exchange: 7, bytes: hex([0x80, 0x1A].into_iter()), ..Told::default() };
        told.expect("slin.parity");
        told.expect("slin.checksum");
        told.expect("slin.parity");
        let line = serde_json::to_string(&told).unwrap();
        let expected = r#"{"exchange":7,"time_ns":0,"end_ns":0,"asked":0,"bytes":"801A","expect":["slin.checksum","slin.parity"]}"#;
        assert_eq!(line, expected);
        told.may = May::ANY;
        assert!(serde_json::to_string(&told).unwrap().ends_with(r#""may":"any"}"#));
    }
}
