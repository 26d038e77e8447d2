//! Services by code, without the bit that marks a response (CIP Vol. 1, appendix A).

use super::{Range, class, service};

/// The name of a service, as CIP prints it. What 4Bh to 63h mean depends on the class.
#[must_use]
pub fn service_name(code: u8, class: Option<u16>) -> Option<&'static str> {
    common_name(code).or_else(|| class_specific_name(code, class?))
}

/// The name of a service of the ports that take no connection: unconnected messages of nodes with
/// dynamic connections, and what a node says unasked.
#[must_use]
pub const fn unconnected_service_name(code: u8) -> Option<&'static str> {
    Some(match code {
        0x4B => "Open_Explicit_Messaging_Connection",
        0x4C => "Close_Connection",
        0x4D => "Device_Heartbeat_Message",
        0x4E => "Device_Shutdown_Message",
        service::ERROR_RESPONSE => "Error_Response",
        _ => return None,
    })
}

/// Whose service a code is: 00-31h CIP's, 32-4Ah the vendor's, 4B-63h the class's, 64-7Fh
/// nobody's. Of CIP's range 00h and 1Eh to 31h are reserved.
#[must_use]
pub const fn service_range(code: u8) -> Range {
    match code {
        0x01..=0x1D => Range::Open,
        0x32..=0x4A => Range::Vendor,
        0x4B..=0x63 => Range::ClassSpecific,
        _ => Range::Reserved,
    }
}

const fn common_name(code: u8) -> Option<&'static str> {
    Some(match code {
        service::GET_ATTRIBUTES_ALL => "Get_Attributes_All",
        0x02 => "Set_Attributes_All",
        0x03 => "Get_Attribute_List",
        0x04 => "Set_Attribute_List",
        service::RESET => "Reset",
        0x06 => "Start",
        0x07 => "Stop",
        0x08 => "Create",
        0x09 => "Delete",
        0x0A => "Multiple_Service_Packet",
        0x0D => "Apply_Attributes",
        service::GET_ATTRIBUTE_SINGLE => "Get_Attribute_Single",
        service::SET_ATTRIBUTE_SINGLE => "Set_Attribute_Single",
        0x11 => "Find_Next_Object_Instance",
        service::ERROR_RESPONSE => "Error_Response",
        service::RESTORE => "Restore",
        service::SAVE => "Save",
        0x17 => "No_Operation",
        0x18 => "Get_Member",
        0x19 => "Set_Member",
        0x1A => "Insert_Member",
        0x1B => "Remove_Member",
        0x1C => "Group_Sync",
        0x1D => "Get_Connection_Point_Member_List",
        _ => return None,
    })
}

const fn class_specific_name(code: u8, class: u16) -> Option<&'static str> {
    Some(match (class, code) {
        (class::DEVICENET, service::ALLOCATE) => "Allocate_Master/Slave_Connection_Set",
        (class::DEVICENET, service::RELEASE) => "Release_Master/Slave_Connection_Set",
        (class::ACKNOWLEDGE_HANDLER, 0x4B) => "Add_AckData_Path",
        (class::ACKNOWLEDGE_HANDLER, 0x4C) => "Remove_AckData_Path",
        (class::PARAMETER, 0x4B) => "Get_Enum_String",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn services_of_the_manual() {
        for (code, name) in [
            (0x0E, "Get_Attribute_Single"),
            (0x10, "Set_Attribute_Single"),
            (0x05, "Reset"),
            (0x15, "Restore"),
            (0x16, "Save"),
        ] {
            assert_eq!(service_name(code, Some(0x2F)), Some(name));
            assert_eq!(service_name(code, None), Some(name));
        }
    }

    #[test]
    fn one_code_is_another_service_in_another_class() {
        let name = |class| service_name(0x4B, Some(class));
        assert_eq!(name(0x03), Some("Allocate_Master/Slave_Connection_Set"));
        assert_eq!(name(0x2B), Some("Add_AckData_Path"));
        assert_eq!(name(0x0F), Some("Get_Enum_String"));
        // X12 and others: classes of vendors have services of their own.
        assert_eq!((name(0x356), service_name(0x4B, None)), (None, None));
        assert_eq!(unconnected_service_name(0x4B), Some("Open_Explicit_Messaging_Connection"));
        assert_eq!(unconnected_service_name(0x4D), Some("Device_Heartbeat_Message"));
    }

    #[test]
    fn reserved_are_00_and_1e_to_31_and_64_to_7f() {
        for code in 0..=0x7F {
            let is_reserved = code == 0 || matches!(code, 0x1E..=0x31 | 0x64..=0x7F);
            assert_eq!(service_range(code) == Range::Reserved, is_reserved, "{code:02X}");
        }
        // X07: service 32h of an encoder saves its parameters.
        assert_eq!(service_range(0x32), Range::Vendor);
        assert_eq!(service_range(0x4A), Range::Vendor);
        assert_eq!(service_range(0x4B), Range::ClassSpecific);
    }

    #[test]
    fn the_common_services_are_24() {
        assert_eq!((0..=0x7F).filter(|code| common_name(*code).is_some()).count(), 24);
    }
}
