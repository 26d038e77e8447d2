//! Devices that the user named: how the data of a station is to be read.

use crate::{devicenet, interbus};
use alloc::collections::BTreeMap;

/// Stations whose device is known, by MAC ID or device number.
pub type Devices = BTreeMap<u16, Profile>;

/// What kind of device a station is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Profile {
    /// One on DeviceNet.
    DeviceNet(devicenet::encoder::Profile),
    /// One in an INTERBUS ring.
    Interbus(interbus::Profile),
}

impl Profile {
    /// How profiles are written.
    pub const FORMS: [&'static str; 3] =
        ["baumer-encoder", "position-sensor", interbus::Profile::FORM];

    /// The profile of that name, with what stands behind a colon.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let on_devicenet = devicenet::encoder::Profile::named(text).map(Profile::DeviceNet);
        on_devicenet.or_else(|| interbus::Profile::parse(text).map(Profile::Interbus))
    }

    /// Whether its bus can have a station of this number.
    #[must_use]
    pub fn may_be_at(self, station: u16) -> bool {
        match self {
            Profile::DeviceNet(_) => station <= 63,
            Profile::Interbus(_) => interbus::Device::new(station).is_some(),
        }
    }

    /// The name of the protocol that such a device speaks.
    #[must_use]
    pub const fn protocol(self) -> &'static str {
        match self {
            Profile::DeviceNet(_) => "devicenet",
            Profile::Interbus(_) => "interbus",
        }
    }

    /// The profile, where it is one of DeviceNet.
    #[must_use]
    pub const fn on_devicenet(self) -> Option<devicenet::encoder::Profile> {
        if let Profile::DeviceNet(profile) = self { Some(profile) } else { None }
    }

    /// The profile, where it is one of INTERBUS.
    #[must_use]
    pub const fn on_interbus(self) -> Option<interbus::Profile> {
        if let Profile::Interbus(profile) = self { Some(profile) } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profiles_by_name() {
        let encoder = devicenet::encoder::Profile::BaumerEncoder;
        assert_eq!(Profile::parse("baumer-encoder"), Some(Profile::DeviceNet(encoder)));
        // 500 mm is 500 000 µm.
        let la66 = interbus::Profile::La66 { measuring_length_um: Some(500_000) };
        assert_eq!(Profile::parse("la66:500mm"), Some(Profile::Interbus(la66)));
        assert_eq!(Profile::parse("la67"), None);
        for profile in [Profile::DeviceNet(encoder), Profile::Interbus(la66)] {
            assert!(crate::protocol::Protocol::named(profile.protocol()).is_some());
        }
    }

    #[test]
    fn stations_are_those_of_the_bus() {
        let encoder = Profile::parse("baumer-encoder").unwrap();
        assert!(encoder.may_be_at(0) && encoder.may_be_at(63) && !encoder.may_be_at(64));
        let la66 = Profile::parse("la66").unwrap();
        assert!(!la66.may_be_at(0) && la66.may_be_at(1) && la66.may_be_at(512));
        assert!(!la66.may_be_at(513));
    }
}
