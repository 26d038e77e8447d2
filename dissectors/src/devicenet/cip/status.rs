//! Status codes of error responses (CIP Vol. 1, appendix B), and the additional ones of Allocate
//! and Release (CIP Vol. 3, chapter 5: DeviceNet object).

use core::fmt;

/// What a general status code says.
#[must_use]
pub const fn status_name(general: u8) -> &'static str {
    match general {
        0x00 => "success",
        0x01 => "connection failure",
        0x02 => "resource unavailable",
        // Old devices; 20h took its place.
        0x03 => "invalid parameter value",
        0x04 => "path segment error",
        0x05 => "path destination unknown",
        0x06 => "partial transfer",
        0x07 => "connection lost",
        0x08 => "service not supported",
        0x09 => "invalid attribute value",
        0x0A => "attribute list error",
        0x0B => "already in requested mode or state",
        0x0C => "object state conflict",
        0x0D => "object already exists",
        0x0E => "attribute not settable",
        0x0F => "privilege violation",
        0x10 => "device state conflict",
        0x11 => "reply data too large",
        0x12 => "fragmentation of a primitive value",
        0x13 => "not enough data",
        0x14 => "attribute not supported",
        0x15 => "too much data",
        0x16 => "object does not exist",
        0x17 => "service fragmentation not in progress",
        0x18 => "no stored attribute data",
        0x19 => "store operation failure",
        0x1A => "request too large to route",
        0x1B => "response too large to route",
        0x1C => "missing attribute list entry",
        0x1D => "invalid attribute value list",
        0x1E => "embedded service error",
        0x1F => "vendor specific error",
        0x20 => "invalid parameter",
        0x21 => "write-once value already written",
        0x22 => "invalid reply received",
        0x23 => "buffer overflow",
        0x24 => "message format error",
        0x25 => "key failure in path",
        0x26 => "path size invalid",
        0x27 => "unexpected attribute in list",
        0x28 => "invalid member ID",
        0x29 => "member not settable",
        // In place of 08h, 0Eh and 14h, and from Group 2 only servers alone.
        0x2A => "group 2 only server general failure",
        0x2B => "unknown Modbus error",
        0x2C => "attribute not gettable",
        0x2D => "instance not deletable",
        0x2E => "service not supported for the path",
        0x2F..=0xCF => "reserved status",
        0xD0..=0xFF => "object class specific error",
    }
}

/// The status of an error response. In words it says what the codes mean, and the additional one
/// where it is known: `0Ch, object state conflict (01h, another master owns the slave)`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Refusal {
    /// General status.
    pub general: u8,
    /// Additional status; FFh is none.
    pub additional: u8,
    /// It answers what was asked of the DeviceNet object: Allocate, Release, or another service on
    /// the unconnected port.
    pub is_of_allocation: bool,
}

impl Refusal {
    /// What the additional status says, where that is known: a slave that passed the conformance
    /// test sends these.
    #[must_use]
    pub const fn detail(self) -> Option<&'static str> {
        if !self.is_of_allocation {
            return None;
        }
        Some(match (self.general, self.additional) {
            (0x02, 0x02) => "connection type not supported",
            (0x0B, 0x02) => "connection is allocated, or released, already",
            (_, 0x01) => "another master owns the slave",
            (_, 0x02) => "invalid choice of connections",
            (_, 0x03) => "service not allowed on the unconnected port",
            (_, 0x04) => "a resource that the choice needs is missing",
            _ => return None,
        })
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Refusal { general, additional, .. } = *self;
        write!(out, "{general:02X}h, {}", status_name(general))?;
        match (additional, self.detail()) {
            (0xFF, _) => Ok(()),
            (_, Some(detail)) => write!(out, " ({additional:02X}h, {detail})"),
            (_, None) => write!(out, " ({additional:02X}h)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    #[test]
    fn codes_of_the_worked_examples() {
        // X02: 94 08 FF. X24: 94 02 03.
        assert_eq!(status_name(0x08), "service not supported");
        assert_eq!(status_name(0x02), "resource unavailable");
        let refused = Refusal { general: 0x08, additional: 0xFF, is_of_allocation: false };
        assert_eq!(refused.to_string(), "08h, service not supported");
    }

    #[test]
    fn what_a_conformant_slave_answers_to_allocate_and_release() {
        for (general, additional, detail) in [
            (0x0C, 0x01, "another master owns the slave"),
            (0x09, 0x02, "invalid choice of connections"),
            (0x02, 0x02, "connection type not supported"),
            (0x0B, 0x02, "connection is allocated, or released, already"),
            (0x02, 0x03, "service not allowed on the unconnected port"),
            (0x02, 0x04, "a resource that the choice needs is missing"),
        ] {
            let refused = Refusal { general, additional, is_of_allocation: true };
            assert_eq!(refused.detail(), Some(detail));
            assert_eq!(Refusal { is_of_allocation: false, ..refused }.detail(), None);
        }
        let refused = Refusal { general: 0x0C, additional: 0x01, is_of_allocation: true };
        let words = "0Ch, object state conflict (01h, another master owns the slave)";
        assert_eq!(refused.to_string(), words);
        // Elsewhere the additional status is the object's own.
        let other = Refusal { is_of_allocation: false, ..refused };
        assert_eq!(other.to_string(), "0Ch, object state conflict (01h)");
    }

    #[test]
    fn every_code_of_the_table_has_a_name_of_its_own() {
        for code in 0x00..=0x2E_u8 {
            assert!((0..code).all(|other| status_name(other) != status_name(code)), "{code:02X}");
        }
        for code in 0x2F..=0xCF {
            assert_eq!(status_name(code), "reserved status");
        }
        for code in 0xD0..=0xFF {
            assert_eq!(status_name(code), "object class specific error");
        }
    }
}
