//! What a user would try, through the built program.

mod account;
mod can;
mod captures;
mod conversions;
mod devicenet;
mod devices;
mod endings;
mod harness;
mod healthy;
mod lines;
mod live;
mod peers;
mod process_words;
mod real_captures;
mod ring_logs;
mod rings;
mod selection;
mod set_ups;
mod simulate;
mod snapshots;
mod streams;
mod telegrams;
mod truth;
mod wireshark;
