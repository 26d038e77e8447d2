//! Process words of an LA-66: handshakes and positions as a controller logs them.

mod findings;
mod handshakes;
mod healthy;
mod listener;
