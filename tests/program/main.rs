//! What a user would try, through the built program.

mod captures;
mod conversions;
mod endings;
mod harness;
mod live;
mod peers;
mod real_captures;
mod selection;
mod simulate;
mod snapshots;
mod telegrams;
mod truth;
