//! Tables as other programs write them.

pub mod made;
