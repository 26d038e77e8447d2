//! The socket of an interface. It is read, and nothing else.

use super::super::PATIENCE;
use super::receiver::Receiver;
use socketcan::{CanFdSocket, Socket, SocketOptions};
use std::io;

/// Opens it: every frame, CAN FD frames too, and everything the controller reports of errors.
///
/// # Errors
/// The kernel has no CAN, or the interface is gone.
pub fn open(interface: &str) -> io::Result<Receiver<CanFdSocket>> {
    let socket = CanFdSocket::open(interface)?;
    socket.set_error_filter_accept_all()?;
    socket.set_read_timeout(PATIENCE)?;
    Receiver::new(socket)
}
