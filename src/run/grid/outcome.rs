//! What a map says of one driver in one cell.

use crate::run::check::Answer;

/// What a map says of a model's cell. Without a conflict nothing collides even if the ego never reacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellOutcome {
    /// There is no conflict, and the driver does not collide. Maps of collisions alone have it.
    NoConflict,
    /// The driver passes; in a map of collisions, one threatens.
    Pass,
    /// The driver fails; in a map of collisions, one threatens.
    Fail,
    /// There is no conflict, but the driver reacts and collides.
    FailByReaction,
    /// A perturbation changes the verdict, or whether there is a conflict.
    Undecided,
}

impl CellOutcome {
    /// All, in the order of tables and legends.
    pub const ALL: [CellOutcome; 5] = [
        CellOutcome::NoConflict,
        CellOutcome::Pass,
        CellOutcome::Fail,
        CellOutcome::FailByReaction,
        CellOutcome::Undecided,
    ];

    /// The word of tables, legends and files; that of a case without a conflict is the one of its sheet.
    pub fn label(self) -> &'static str {
        match self {
            CellOutcome::NoConflict => Answer::NoConflict.label(),
            CellOutcome::Pass => "pass",
            CellOutcome::Fail => "fail",
            CellOutcome::FailByReaction => "fail by reaction",
            CellOutcome::Undecided => "undecided",
        }
    }
}
