//! What is simulated: the drivers, the criteria that judge them, the profile with every constant, the concrete case and
//! the motion of its vehicles, and the numbers that lanes compute with.
//!
//! No file is read here but a profile, and nothing is run: [`engine`](crate::engine) steps what is defined here.

pub mod case;
#[macro_use]
pub mod driver;
pub mod criterion;
pub mod motion;
pub mod profile;
pub mod scalar;
