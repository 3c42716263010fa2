//! Random numbers as pure functions of seed and index. The rooms that its modules may use stand below; `lanesweep` is the crate for users.

#[path = "mod.rs"]
pub mod random;
