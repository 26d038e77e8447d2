//! What a user would try, through the built program.

mod harness;
mod real_captures;
mod telegrams;
