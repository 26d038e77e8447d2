//! CAN frames: logs of text, one file a format, and the packets of captures.

pub mod packet;
