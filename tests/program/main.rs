//! What a user would try, through the built program.

mod endings;
mod harness;
mod real_captures;
mod selection;
mod telegrams;
mod truth;
