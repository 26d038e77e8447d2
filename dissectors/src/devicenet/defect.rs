//! What can be wrong with the form of a message.

/// Why a message is malformed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Defect {
    /// The message header is missing.
    NoHeader,
    /// The service byte is missing.
    NoService,
    /// The fragment byte is missing.
    NoFragmentByte,
    /// Class, instance, attribute or value is not complete.
    Missing,
    /// There are more bytes than the service has.
    Excess,
    /// A service code that is reserved.
    ReservedService,
    /// A response where only requests are sent.
    ResponseOnRequestPort,
    /// A request where only responses are sent.
    RequestOnResponsePort,
    /// A service that this port must refuse.
    RefusedService,
    /// A fragment on a port whose messages are never fragmented.
    Fragmented,
    /// Bits that must be 0.
    ReservedBits,
    /// A value that is reserved.
    ReservedValue,
    /// A message body format that is reserved.
    ReservedFormat,
    /// Message ids that an Open must not ask for or give.
    MessageId,
    /// A path that makes no sense.
    Path,
    /// The header does not name the other end of the connection.
    WrongEnd,
    /// An acknowledgement is three bytes long.
    Acknowledgement,
    /// A message that is longer than what is kept of one.
    TooLong,
    /// A frame whose length is fixed has another.
    Length,
}

impl Defect {
    /// In words.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Defect::NoHeader => "the message header is missing",
            Defect::NoService => "the service is missing",
            Defect::NoFragmentByte => "the fragment byte is missing",
            Defect::Missing => "bytes are missing",
            Defect::Excess => "more bytes than the service has",
            Defect::ReservedService => "the service code is reserved",
            Defect::ResponseOnRequestPort => "a response on an identifier for requests",
            Defect::RequestOnResponsePort => "a request on an identifier for responses",
            Defect::RefusedService => "a service that this port must refuse",
            Defect::Fragmented => "a fragment where none is allowed",
            Defect::ReservedBits => "reserved bits are set",
            Defect::ReservedValue => "a value is reserved",
            Defect::ReservedFormat => "the message body format is reserved",
            Defect::MessageId => "message ids that an Open must not use",
            Defect::Path => "the path makes no sense",
            Defect::WrongEnd => "the header does not name the other end",
            Defect::Acknowledgement => "the acknowledgement has not three bytes",
            Defect::TooLong => "the message is longer than any DeviceNet message",
            Defect::Length => "the length is not that of such a frame",
        }
    }
}
