//! The options of live taps.

use crate::source::LiveOptions;
use clap::Args;

/// How a live tap is listened to.
#[derive(Args, Debug)]
#[command(next_help_heading = "Live taps")]
pub struct Live {
    /// Listen on a CAN interface that is not listen-only: it acknowledges frames, and so takes part
    /// in the traffic. Or through an adapter that does not say whether it is.
    #[arg(long)]
    pub allow_active: bool,

    /// Wait for a tap that vanishes, and go on.
    #[arg(long)]
    pub reconnect: bool,
}

impl Live {
    /// What the tap is told. A CAN adapter is set to `bitrate`.
    pub fn options(&self, bitrate: Option<u32>) -> LiveOptions {
        LiveOptions { allow_active: self.allow_active, reconnect: self.reconnect, bitrate }
    }
}
