//! Traffic: recordings as read, and the scenarios found in them.
//!
//! [`trajectory`] reads recordings (highD's format) and makes synthetic ones; [`mining`] finds cut-ins, cut-outs and leader
//! decelerations. Scenarios go to [`scenario`](crate::scenario).

pub mod mining;
pub mod trajectory;
