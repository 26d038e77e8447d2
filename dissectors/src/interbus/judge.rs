//! What the words of a handshake are judged by: each check leaves a finding or not.

use super::codes;
use super::service::{MAGNET, STATUS, Service};
use super::word::{Access, Word};
use crate::finding::{Code, Finding};
use alloc::vec::Vec;
use core::mem::replace;

/// What was told of a request.
#[derive(Clone, Copy, Default, Debug)]
pub struct Asked {
    reserved_bits: bool,
    undefined_service: bool,
    access: bool,
    out_of_range: bool,
}

/// What was found out about one row. It is kept from row to row, so that rows cost no memory.
#[derive(Default, Debug)]
pub struct Judgement {
    /// What was found.
    pub findings: Vec<Finding>,
    /// States that were told before and go on.
    pub ongoing: Vec<&'static Code>,
    /// What could not be judged.
    pub withheld: Vec<&'static Code>,
}

impl Judgement {
    /// Nothing found yet.
    pub fn clear(&mut self) {
        self.findings.clear();
        self.ongoing.clear();
        self.withheld.clear();
    }

    /// Tells a finding; a code stands once in a record.
    pub fn find(&mut self, finding: Finding) {
        if self.findings.iter().all(|known| known.code != finding.code) {
            self.findings.push(finding);
        }
    }

    /// Tells it, or that it could not be judged.
    pub fn find_if(&mut self, can_tell: bool, finding: Finding) {
        if can_tell {
            self.find(finding);
        } else if !self.withheld.contains(&finding.code) {
            self.withheld.push(finding.code);
        }
    }

    /// What is asked for: whether the LA-66 has such a service, in this direction, with this value.
    /// Each is told once of a request, however often that is changed.
    pub fn judge_request(&mut self, out: Word, asked: &mut Asked) {
        if out.has_reserve_bit() && !replace(&mut asked.reserved_bits, true) {
            self.find(Finding::new(&codes::RESERVED_BITS).actual(i64::from(out.code())));
        }
        let Some(service) = Service::numbered(out.service()) else {
            if !replace(&mut asked.undefined_service, true) {
                let service = i64::from(out.service());
                self.find(Finding::new(&codes::UNDEFINED_SERVICE).actual(service));
            }
            return;
        };
        if !service.allows(out.access()) {
            if !replace(&mut asked.access, true) {
                self.find(Finding::new(&codes::ACCESS).actual(i64::from(out.code())));
            }
        } else if out.access() == Access::Write
            && out.data() > service.highest
            && !replace(&mut asked.out_of_range, true)
        {
            self.judge_value(service, out.data());
        }
    }

    /// What was read: the bits that the manual defines, and no others.
    pub fn judge_answer(&mut self, service: &'static Service, data: u32) {
        if service.number != STATUS {
            return self.judge_value(service, data);
        }
        if data & !MAGNET != 0 {
            self.find(Finding::new(&codes::RESERVED_BITS).actual(i64::from(data)));
        }
        if data & MAGNET != 0 {
            self.find(Finding::new(&codes::MAGNET).actual(i64::from(data)));
        }
    }

    fn judge_value(&mut self, service: &'static Service, data: u32) {
        if data > service.highest {
            let finding = Finding::new(&codes::VALUE_OUT_OF_RANGE).actual(i64::from(data));
            self.find(finding.limit(i64::from(service.highest)));
        }
    }
}
