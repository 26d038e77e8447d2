//! Which device is where: vendor and serial number tell one from all others.
//!
//! DeviceNet specification (CIP Vol. 3), chapter 6: no two devices have the same.

use super::identifier::{MAC_IDS, MacId};
use super::ledger::Ledger;
use super::message::Identity;
use crate::protocol::Conclusion;
use alloc::{format, vec::Vec};

impl Ledger {
    /// The nodes that told the same vendor and serial number as another: a device that was given
    /// another MAC ID, or two that must not be alike. It is no finding: nothing on the bus suffers.
    pub fn twins(&self) -> Vec<Conclusion> {
        let identities = (0..MAC_IDS as u8).map(MacId::of).filter_map(|mac| {
            let identity = self.nodes[mac.index()].identity?;
            Some((mac, identity))
        });
        identities.filter_map(|(mac, identity)| self.twin(mac, identity)).collect()
    }

    fn twin(&self, mac: MacId, identity: Identity) -> Option<Conclusion> {
        let alike = || {
            let all = (0..MAC_IDS as u8).map(|number| &self.nodes[usize::from(number)]);
            all.filter(|node| node.identity == Some(identity))
        };
        if alike().count() < 2 {
            return None;
        }
        let last = alike().max_by_key(|node| node.identified.ns())?.identified;
        let evidence = if alike().any(|node| node.identified != last && node.heard.is_after(last)) {
            "the first was heard after the last came: two devices with one serial number"
        } else {
            "the first was not heard after the last came: a device that has another MAC ID now"
        };
        let Identity { vendor, serial } = identity;
        Some(Conclusion {
            subject: "serial number",
            station: Some(u16::from(mac.get())),
            value: Some(format!("{serial:08X}h of vendor {vendor}")),
            evidence: evidence.into(),
        })
    }
}
