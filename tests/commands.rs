//! The program: its commands, runs that are killed and resumed, devices, the book.

mod common;
mod device;
mod program;
mod runs;
