//! What a user would try, through the built program.

mod can;
mod captures;
mod conversions;
mod endings;
mod harness;
mod live;
mod peers;
mod real_captures;
mod record;
mod selection;
mod set_ups;
mod simulate;
mod snapshots;
mod streams;
mod telegrams;
mod truth;
