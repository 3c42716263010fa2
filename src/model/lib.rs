//! The simulated system: drivers, criteria, the profile with every constant, the concrete case, the motion of its
//! vehicles, and the lane arithmetic.
//!
//! The only files read here are a profile and the sources of its constants. Nothing is simulated here: the engine steps
//! these definitions.

pub mod assumptions;
pub mod case;
pub mod category;
pub mod criterion;
#[macro_use]
pub mod driver;
pub mod motion;
pub mod plausibility;
pub mod profile;
pub mod scalar;
pub mod scenario;
