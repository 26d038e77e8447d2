//! What the kernel tells of a port through no safe call.
//!
//! Every structure here is the kernel's (`linux/serial.h`), which has not changed in decades.

#![allow(unsafe_code)]

use super::counters::Counters;
use rustix::fd::BorrowedFd;
use rustix::io;
use rustix::ioctl::{Getter, Opcode, Setter, ioctl};
use serialport::TTYPort;
use std::os::fd::AsRawFd;

const GET_COUNTERS: Opcode = libc::TIOCGICOUNT as Opcode;
const GET_SERIAL: Opcode = libc::TIOCGSERIAL as Opcode;
const SET_SERIAL: Opcode = libc::TIOCSSERIAL as Opcode;

const CLEAR_LINES: Opcode = libc::TIOCMBIC as Opcode;

/// `ASYNC_LOW_LATENCY`: hand characters over as they come.
const LOW_LATENCY: i32 = 1 << 13;

/// `struct serial_icounter_struct`.
#[repr(C)]
struct Icounter {
    _modem_lines: [i32; 4],
    _rx_tx: [i32; 2],
    frame: i32,
    overrun: i32,
    parity: i32,
    brk: i32,
    buf_overrun: i32,
    _reserved: [i32; 9],
}

/// `struct serial_struct`, handed back to the kernel as it came but for its flags.
#[repr(C)]
struct SerialStruct {
    _type: i32,
    _line: i32,
    _port: u32,
    _irq: i32,
    flags: i32,
    _xmit_fifo_size: i32,
    _custom_divisor: i32,
    _baud_base: i32,
    _close_delay: u16,
    _io_type: [u8; 2],
    _hub6: i32,
    _closing_wait: [u16; 2],
    _iomem_base: usize,
    _iomem_reg_shift: u16,
    _port_high: u32,
    _iomap_base: libc::c_ulong,
}

/// The file descriptor of an open port.
pub fn descriptor(port: &TTYPort) -> BorrowedFd<'_> {
    // SAFETY: the port keeps it open for as long as it is borrowed.
    unsafe { BorrowedFd::borrow_raw(port.as_raw_fd()) }
}

/// Drops RTS and DTR, both at once. What has no modem lines, such as a pseudo terminal, needs none
/// dropped.
///
/// # Errors
/// They stay as they are.
pub fn drop_lines(port: &TTYPort) -> io::Result<()> {
    let lines = libc::TIOCM_RTS | libc::TIOCM_DTR;
    // SAFETY: TIOCMBIC reads an int, the modem lines to be dropped.
    let dropped = unsafe { ioctl(descriptor(port), Setter::<CLEAR_LINES, i32>::new(lines)) };
    match dropped {
        Err(io::Errno::NOTTY | io::Errno::INVAL) => Ok(()),
        dropped => dropped,
    }
}

/// What the driver counted since it was loaded.
///
/// # Errors
/// The driver does not count.
pub fn counters(port: &TTYPort) -> io::Result<Counters> {
    // SAFETY: TIOCGICOUNT fills a `serial_icounter_struct` and does nothing else.
    let counted = unsafe { ioctl(descriptor(port), Getter::<GET_COUNTERS, Icounter>::new()) }?;
    // They are ints that run over.
    let count = i32::cast_unsigned;
    Ok(Counters {
        parity: count(counted.parity),
        framing: count(counted.frame),
        overrun: count(counted.overrun),
        buffer_overrun: count(counted.buf_overrun),
        breaks: count(counted.brk),
    })
}

/// Asks the driver to hand characters over as they come. Whether it says that it does.
///
/// # Errors
/// The driver has no such setting, or this user may not change it.
pub fn set_low_latency(port: &TTYPort) -> io::Result<bool> {
    let get = || {
        // SAFETY: TIOCGSERIAL fills a `serial_struct` and does nothing else.
        unsafe { ioctl(descriptor(port), Getter::<GET_SERIAL, SerialStruct>::new()) }
    };
    let mut settings = get()?;
    if settings.flags & LOW_LATENCY == 0 {
        settings.flags |= LOW_LATENCY;
        // SAFETY: TIOCSSERIAL reads a `serial_struct`, here the driver's own with one flag more.
        unsafe { ioctl(descriptor(port), Setter::<SET_SERIAL, SerialStruct>::new(settings)) }?;
    }
    Ok(get()?.flags & LOW_LATENCY != 0)
}
