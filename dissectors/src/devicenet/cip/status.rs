//! General status codes of error responses (CIP Vol. 1, appendix B).

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

/// What the additional code of a refused Allocate or Release says. A slave that passed the
/// conformance test sends these.
#[must_use]
pub const fn allocation_error_name(additional: u8) -> Option<&'static str> {
    Some(match additional {
        0x01 => "another master owns the slave",
        0x02 => "invalid choice of connections",
        0x03 => "service not allowed on the unconnected port",
        0x04 => "a resource that the choice needs is missing",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_the_worked_examples() {
        // X02: 94 08 FF. X24: 94 02 03.
        assert_eq!(status_name(0x08), "service not supported");
        assert_eq!(status_name(0x02), "resource unavailable");
        let refused = allocation_error_name(0x03);
        assert_eq!(refused, Some("service not allowed on the unconnected port"));
        assert_eq!(allocation_error_name(0xFF), None);
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
