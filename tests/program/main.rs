//! What a user would try, through the built program.

mod captures;
mod endings;
mod harness;
mod live;
mod real_captures;
mod selection;
mod simulate;
mod telegrams;
mod truth;
