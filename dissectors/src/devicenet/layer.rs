//! What a DeviceNet record knows: its kinds and its fields.

use super::allocation::{Allocation, Choice};
use super::cip::{self, class};
use super::defect::Defect;
use super::encoder::{Assembly, Flags, Reading};
use super::identifier::{MacId, Place};
use super::members::{LaidOut, MEMBER_FIELDS};
use super::message::{Fragment, Identity, Service, Target, service};
use super::names::Names;
use super::transactions::Kept;
use crate::can::{self, FrameFields};
use crate::field::{Field, FieldId, Kind, List, Value, fields, joined};
use crate::record::Turn;
use crate::station::{Resolution, Station, Stations};

/// The kinds of records.
pub(super) mod kind {
    pub const DUP_MAC_REQUEST: &str = "dup-mac-request";
    pub const DUP_MAC_RESPONSE: &str = "dup-mac-response";
    pub const UNCONNECTED_REQUEST: &str = "unconnected-request";
    pub const UNCONNECTED_RESPONSE: &str = "unconnected-response";
    pub const EXPLICIT_REQUEST: &str = "explicit-request";
    pub const EXPLICIT_RESPONSE: &str = "explicit-response";
    pub const POLL_COMMAND: &str = "poll-command";
    pub const POLL_RESPONSE: &str = "poll-response";
    pub const STROBE_COMMAND: &str = "strobe-command";
    pub const STROBE_RESPONSE: &str = "strobe-response";
    pub const COS: &str = "cos";
    pub const CYCLIC: &str = "cyclic";
    pub const IO_ACK: &str = "io-ack";
    pub const MULTICAST_POLL_COMMAND: &str = "multicast-poll-command";
    pub const MULTICAST_POLL_RESPONSE: &str = "multicast-poll-response";
    pub const UCMM_REQUEST: &str = "ucmm-request";
    pub const UCMM_RESPONSE: &str = "ucmm-response";
    pub const HEARTBEAT: &str = "heartbeat";
    pub const SHUTDOWN: &str = "shutdown";
    pub const OWNERSHIP_REQUEST: &str = "offline-ownership-request";
    pub const OWNERSHIP_RESPONSE: &str = "offline-ownership-response";
    pub const COMM_FAULT_REQUEST: &str = "comm-fault-request";
    pub const COMM_FAULT_RESPONSE: &str = "comm-fault-response";
    pub const IO: &str = "io";
    pub const RESERVED: &str = "reserved";
    pub const FOREIGN: &str = "foreign";
    pub const CAN_ERROR: &str = "can-error";
}

/// All of them.
pub(super) static KINDS: [&str; 29] = [
    kind::DUP_MAC_REQUEST,
    kind::DUP_MAC_RESPONSE,
    kind::UNCONNECTED_REQUEST,
    kind::UNCONNECTED_RESPONSE,
    kind::EXPLICIT_REQUEST,
    kind::EXPLICIT_RESPONSE,
    kind::POLL_COMMAND,
    kind::POLL_RESPONSE,
    kind::STROBE_COMMAND,
    kind::STROBE_RESPONSE,
    kind::COS,
    kind::CYCLIC,
    kind::IO_ACK,
    kind::MULTICAST_POLL_COMMAND,
    kind::MULTICAST_POLL_RESPONSE,
    kind::UCMM_REQUEST,
    kind::UCMM_RESPONSE,
    kind::HEARTBEAT,
    kind::SHUTDOWN,
    kind::OWNERSHIP_REQUEST,
    kind::OWNERSHIP_RESPONSE,
    kind::COMM_FAULT_REQUEST,
    kind::COMM_FAULT_RESPONSE,
    kind::IO,
    kind::RESERVED,
    kind::FOREIGN,
    kind::CAN_ERROR,
    "lost",
    "event",
];

/// What kind of connection a message travels on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Link {
    Explicit,
    Poll,
    Strobe,
    Cos,
    Cyclic,
    Multicast,
    Ucmm,
    Unconnected,
}

const LINKS: [&str; 8] =
    ["explicit", "poll", "strobe", "cos", "cyclic", "multicast", "ucmm", "unconnected"];

impl Link {
    /// The name that records carry.
    pub const fn name(self) -> &'static str {
        LINKS[self as usize]
    }
}

/// What was not seen but taken.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct Assumed(u8);

const ASSUMED: [&str; 4] = ["body_format", "allocation", "size", "start"];

impl Assumed {
    pub const BODY_FORMAT: Assumed = Assumed(1);
    pub const ALLOCATION: Assumed = Assumed(2);
    pub const SIZE: Assumed = Assumed(4);
    /// The beginning of the connection or message.
    pub const START: Assumed = Assumed(8);

    /// This as well.
    pub const fn add(&mut self, other: Assumed) {
        self.0 |= other.0;
    }
}

impl List for Assumed {
    fn len(&self) -> usize {
        self.0.count_ones() as usize
    }

    fn get(&self, index: usize) -> Value<'_> {
        let mut names = (0..).zip(ASSUMED).filter(|(bit, _)| self.0 >> bit & 1 == 1);
        names.nth(index).map(|(_, name)| name).into()
    }
}

/// Bytes that a record shows: of its own frame, or of the message that it completes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Bytes {
    /// The assembly that holds them, or the frame.
    pub assembly: Option<usize>,
    /// Where they begin; they go to the end.
    pub start: usize,
}

/// What was found out about one frame, or about an event.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facts {
    pub kind: &'static str,
    pub turn: Turn,
    pub place: Option<Place>,
    pub station: Option<MacId>,
    pub source: Option<MacId>,
    pub destination: Option<MacId>,
    pub link: Option<Link>,
    pub assumed: Assumed,
    pub xid: Option<bool>,
    pub fragment: Option<Fragment>,
    pub status: Option<u8>,
    /// The assembly whose message this frame completes.
    pub completes: Option<usize>,
    pub service: Option<Service>,
    pub target: Target,
    pub data: Option<Bytes>,
    /// On the answer to a Set that was done: what was written.
    pub written: Option<Kept>,
    pub error: Option<(u8, u8)>,
    pub allocation: Option<Allocation>,
    pub body_format: Option<u8>,
    pub identity: Option<Identity>,
    pub port: Option<u8>,
    pub request: Option<u64>,
    pub response_time: Option<i64>,
    pub io: Option<Bytes>,
    pub defect: Option<Defect>,
}

impl Facts {
    /// Nothing but what kind it is.
    pub const fn new(kind: &'static str) -> Self {
        Facts {
            kind,
            turn: Turn::Neither,
            place: None,
            station: None,
            source: None,
            destination: None,
            link: None,
            assumed: Assumed(0),
            xid: None,
            fragment: None,
            status: None,
            completes: None,
            service: None,
            target: Target { class: None, instance: None, attribute: None },
            data: None,
            written: None,
            error: None,
            allocation: None,
            body_format: None,
            identity: None,
            port: None,
            request: None,
            response_time: None,
            io: None,
            defect: None,
        }
    }

    /// Takes note of what is malformed: the first defect is the one that is told.
    pub fn blame(&mut self, defect: Option<Defect>) {
        self.defect = self.defect.or(defect);
    }
}

/// The protocol's part of a record.
pub(super) struct Message<'a> {
    pub frame: FrameFields<'a>,
    pub facts: Facts,
    /// Service data, or of a fragment what its own frame shows.
    pub data: Option<&'a [u8]>,
    /// What the data means, where the attribute is known.
    pub value: Option<cip::Value<'a>>,
    /// I/O data.
    pub io: Option<&'a [u8]>,
    /// What the I/O data of an encoder says.
    pub reading: Option<(Assembly, Reading)>,
    /// What the maker's description says that the I/O data is.
    pub laid_out: Option<LaidOut<'a>>,
    /// How the station's objects are read.
    pub names: Names<'a>,
    /// What the user knows of the stations.
    pub stations: &'a Stations,
    /// Numbers of the records that make up the message.
    pub fragments: &'a [u64],
}

/// The fields of a frame, and then those of a message.
pub static FIELDS: [Field; can::FIELDS.len() + OWN.len()] = joined(can::FIELDS, OWN);

/// The fields that findings ask their record for.
pub(super) const DEFECT: FieldId = can::FIELDS.len();
pub(super) const CONNECTION: FieldId = can::FIELDS.len() + 1;

const BYTE: Kind = Kind::Int(0, 255);
const WORD: Kind = Kind::Int(0, 65_535);
const MAC: Kind = Kind::Int(0, 63);
const NUMBER: Kind = Kind::Int(1, i64::MAX);

fields! {
    static OWN of Message {
        "devicenet.defect" (Kind::Text, "", Plain) "what is malformed"
            => |t| t.facts.defect.map(Defect::text).into();
        "devicenet.connection" (Kind::OneOf(&LINKS), "", Plain) "what kind of connection"
            => |t| t.facts.link.map(Link::name).into();
        "devicenet.group" (Kind::Int(1, 4), "", Plain) "message group of the identifier"
            => |t| t.facts.place.map(|place| i64::from(place.group)).into();
        "devicenet.message_id" (Kind::Int(0, 47), "", Plain) "message id within the group"
            => |t| t.facts.place.map(|place| i64::from(place.message_id)).into();
        "devicenet.mac" (MAC, "", Plain) "MAC ID in the identifier, of source or destination"
            => |t| mac(t.facts.place.and_then(|place| place.mac));
        "devicenet.name" (Kind::Text, "", Plain) "name of the station (with --stations)"
            => |t| t.name().into();
        "devicenet.source" (MAC, "", Source) "MAC ID of who sent it, where that is known"
            => |t| mac(t.facts.source);
        "devicenet.destination" (MAC, "", Destination)
            "MAC ID of who it is for, where that is known"
            => |t| mac(t.facts.destination);
        "devicenet.assumed" (Kind::List(&Kind::OneOf(&ASSUMED)), "", Plain)
            "what was not seen but taken"
            => |t| if t.facts.assumed.is_empty() {
                Value::Absent
            } else {
                Value::List(&t.facts.assumed)
            };
        "devicenet.xid" (Kind::Int(0, 1), "", Plain) "transaction id of an explicit message"
            => |t| t.facts.xid.map(i64::from).into();
        "devicenet.fragment.type" (Kind::OneOf(&["first", "middle", "last", "ack"]), "", Plain)
            "which part of a message"
            => |t| t.facts.fragment.map(|fragment| fragment.part.name()).into();
        "devicenet.fragment.count" (Kind::Int(0, 63), "", Plain) "fragment count"
            => |t| t.facts.fragment.map(|fragment| i64::from(fragment.count)).into();
        "devicenet.fragment.status" (BYTE, "", Plain)
            "status of an acknowledgement: 0 taken, 1 too much data"
            => |t| t.facts.status.map(i64::from).into();
        "devicenet.fragments" (Kind::List(&NUMBER), "", Plain)
            "on the last fragment: records of the whole message"
            => |t| if t.fragments.is_empty() { Value::Absent } else { Value::List(t) };
        "devicenet.service_code" (Kind::Int(0, 127), "", Plain) "service without the R/R bit"
            => |t| t.facts.service.map(|service| i64::from(service.code)).into();
        "devicenet.service" (Kind::Text, "", Service) "name of the service"
            => |t| t.service_name().into();
        "devicenet.response" (Kind::Bool, "", Plain) "the R/R bit: true in a response"
            => |t| t.facts.service.map_or(Value::Absent, |it| Value::Bool(it.is_response));
        "devicenet.class" (WORD, "", Plain) "object class; in a response the request's"
            => |t| t.facts.target.class.map(i64::from).into();
        "devicenet.class_name" (Kind::Text, "", Plain) "name of the class"
            => |t| t.facts.target.class.and_then(|class| t.names.class(class)).into();
        "devicenet.instance" (WORD, "", Plain) "instance; 0 is the class itself"
            => |t| t.facts.target.instance.map(i64::from).into();
        "devicenet.attribute" (WORD, "", Plain) "attribute"
            => |t| t.facts.target.attribute.map(i64::from).into();
        "devicenet.attribute_name" (Kind::Text, "", Plain) "name of the attribute"
            => |t| t.attribute_name().into();
        "devicenet.data" (Kind::Hex, "", Plain)
            "service data after class, instance and attribute"
            => |t| t.data.map_or(Value::Absent, Value::Hex);
        "devicenet.value" (Kind::Any, "", Plain) "the value that was read or written"
            => |t| t.value.as_ref().map_or(Value::Absent, cip::Value::field);
        "devicenet.error.general" (BYTE, "", Plain) "general status of an error response"
            => |t| t.facts.error.map(|(general, _)| i64::from(general)).into();
        "devicenet.error.additional" (BYTE, "", Plain)
            "additional status of an error response; 255: none"
            => |t| t.facts.error.map(|(_, additional)| i64::from(additional)).into();
        "devicenet.error.name" (Kind::Text, "", Plain) "what the general status means"
            => |t| t.facts.error.map(|(general, _)| cip::status_name(general)).into();
        "devicenet.allocation.choice" (BYTE, "", Plain) "allocation or release choice"
            => |t| t.facts.allocation.map(|it| i64::from(it.choice.byte())).into();
        "devicenet.allocation.connections" (Kind::List(&Kind::OneOf(&LINKS)), "", Plain)
            "the connections of the choice"
            => |t| t.facts.allocation.as_ref().map_or(Value::Absent, |it| connections(&it.choice));
        "devicenet.allocation.allocator" (MAC, "", Plain) "MAC ID of the master"
            => |t| t.facts.allocation
                .and_then(|it| it.allocator)
                .and_then(MacId::new)
                .map(|mac| i64::from(mac.get()))
                .into();
        "devicenet.body_format" (Kind::Int(0, 15), "", Plain) "message body format that was agreed"
            => |t| t.facts.body_format.map(i64::from).into();
        "devicenet.vendor" (WORD, "", Plain) "vendor id of the node"
            => |t| t.facts.identity.map(|it| i64::from(it.vendor)).into();
        "devicenet.serial" (Kind::Int(0, 4_294_967_295), "", Plain) "serial number of the node"
            => |t| t.facts.identity.map(|it| i64::from(it.serial)).into();
        "devicenet.port" (Kind::Int(0, 127), "", Plain) "physical port of the node"
            => |t| t.facts.port.map(i64::from).into();
        "devicenet.request" (NUMBER, "", Request) "number of the request that is answered"
            => |t| t.facts.request.map(u64::cast_signed).into();
        "devicenet.response_time_ns" (Kind::Int(i64::MIN, i64::MAX), "ns", ResponseTime)
            "stamp of the request to stamp of the response"
            => |t| t.facts.response_time.into();
        "devicenet.io.position" (Kind::Int(0, 4_294_967_295), "steps", Position)
            "position of an encoder whose profile is known"
            => |t| t.reading.map(|(_, reading)| i64::from(reading.position)).into();
        "devicenet.io.turns" (Kind::Int(0, 4_294_967_295), "turns", Plain)
            "whole turns, clockwise (with --stations)"
            => |t| t.place().and_then(|(it, position)| it.turns(position)).map(i64::from).into();
        "devicenet.io.angle" (Kind::Float, "degrees", Plain)
            "angle within the turn, clockwise (with --stations)"
            => |t| t.place()
                .and_then(|(it, position)| it.angle(position))
                .map_or(Value::Absent, Value::Float);
        "devicenet.io.alarm" (Kind::Bool, "", Plain) "alarm flag, where the assembly has one"
            => |t| t.flag(Flags::alarm);
        "devicenet.io.warning" (Kind::Bool, "", Plain) "warning flag, where the assembly has one"
            => |t| t.flag(Flags::warning);
        "devicenet.io.assembly" (WORD, "", Plain) "assembly instance, by the size of the data"
            => |t| t.reading.map(|(assembly, _)| i64::from(assembly.instance())).into();
        "devicenet.io.name" (Kind::Text, "", Plain) "what the EDS calls the data"
            => |t| t.laid_out.map(|it| it.name).filter(|name| !name.is_empty()).into();
        "devicenet.io.members" (Kind::Rows(&MEMBER_FIELDS), "", Plain)
            "what stands in the data, by the EDS"
            => |t| t.laid_out
                .as_ref()
                .and_then(|it| it.members.as_ref())
                .map_or(Value::Absent, |members| Value::Rows(members));
        "devicenet.io.data" (Kind::Hex, "", Plain) "I/O data of which nothing else is known"
            => |t| t.io
                .filter(|_| t.reading.is_none())
                .map_or(Value::Absent, Value::Hex);
    }
}

fn mac(mac: Option<MacId>) -> Value<'static> {
    mac.map(|mac| i64::from(mac.get())).into()
}

fn connections(choice: &Choice) -> Value<'_> {
    Value::List(choice)
}

/// The records of the whole message.
impl List for Message<'_> {
    fn len(&self) -> usize {
        self.fragments.len()
    }

    fn get(&self, index: usize) -> Value<'_> {
        self.fragments.get(index).map(|n| n.cast_signed()).into()
    }
}

impl Facts {
    /// What the data means: a value that was read or is to be written.
    pub fn value<'a>(&self, data: Option<&'a [u8]>, names: &Names<'_>) -> Option<cip::Value<'a>> {
        let Service { code, is_response } = self.service?;
        if code == cip::service::GET_ATTRIBUTES_ALL
            && is_response
            && self.target.is(class::IDENTITY, 1)
        {
            let (_, identity) = cip::DeviceIdentity::parse(data?).ok()?;
            return Some(cip::Value::Identity(identity));
        }
        // Who sets a packet rate is told in the answer to what the slave rounded it.
        let carries = matches!((code, is_response), (service::GET, true) | (service::SET, _));
        let data = data.filter(|_| carries)?;
        names.decode(self.target, data)
    }
}

impl Message<'_> {
    fn service_name(&self) -> Option<&'static str> {
        let code = self.facts.service?.code;
        match self.facts.kind {
            kind::UCMM_REQUEST | kind::UCMM_RESPONSE | kind::HEARTBEAT | kind::SHUTDOWN => {
                cip::unconnected_service_name(code)
            }
            _ => cip::service_name(code, self.facts.target.class),
        }
    }

    /// What the user calls the record's station.
    pub fn name(&self) -> Option<&str> {
        self.station()?.name.as_deref()
    }

    fn station(&self) -> Option<&Station> {
        self.stations.get(&self.facts.station?.get().into())
    }

    /// The position of an encoder whose resolution the user knows.
    pub fn place(&self) -> Option<(Resolution, u32)> {
        self.station()?.resolution.zip(self.reading.map(|(_, reading)| reading.position))
    }

    fn attribute_name(&self) -> Option<&str> {
        self.names.attribute_name(self.facts.target)
    }

    fn flag(&self, which: fn(Flags) -> Option<bool>) -> Value<'_> {
        let flag = self.reading.and_then(|(_, reading)| which(reading.flags));
        flag.map_or(Value::Absent, Value::Bool)
    }

    /// What is known of a service and what it is about, for the sentence.
    pub fn service_and_target(&self, out: &mut dyn core::fmt::Write) -> core::fmt::Result {
        let Some(service) = self.facts.service else { return write!(out, "no service") };
        match (service.code, self.service_name()) {
            (service::GET, _) => write!(out, "Get")?,
            (service::SET, _) => write!(out, "Set")?,
            (service::ALLOCATE, Some(_)) if self.facts.target.is(3, 1) => {
                return write!(out, "Allocate");
            }
            (service::RELEASE, Some(_)) if self.facts.target.is(3, 1) => {
                return write!(out, "Release");
            }
            (_, Some(name)) => write!(out, "{name}")?,
            (code, None) => write!(out, "service {code:02X}h")?,
        }
        self.say_target(out)
    }

    /// What a service is about: by name as far as that is known, else by number.
    fn say_target(&self, out: &mut dyn core::fmt::Write) -> core::fmt::Result {
        let Target { class, instance, attribute } = self.facts.target;
        match (self.attribute_name(), attribute) {
            (Some(name), _) => write!(out, " {name}")?,
            (None, Some(number)) => write!(out, " attribute {number}")?,
            (None, None) => {}
        }
        let Some(number) = class else { return Ok(()) };
        // Of most classes there is one instance; which connection it is matters.
        let is_told = self.attribute_name().is_some() && instance == Some(1);
        match (self.names.class(number), instance) {
            _ if is_told && number != class::CONNECTION => Ok(()),
            (Some(name), Some(1)) if number != class::CONNECTION => write!(out, " {name}"),
            (Some(name), Some(instance)) => write!(out, " {name} {instance}"),
            (Some(name), None) => write!(out, " {name}"),
            (None, Some(instance)) => write!(out, " class {number:02X}h instance {instance}"),
            (None, None) => write!(out, " class {number:02X}h"),
        }
    }
}
