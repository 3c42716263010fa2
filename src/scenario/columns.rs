//! Which fields of a scenario the columns of a user's table are.

use crate::support::error::{Error, Result};
use crate::support::table::{Named, Resolved, TableReader, nearest, resolve};

/// Where users read about the columns.
pub(super) const HELP: &str = "the chapter on tables lists the columns (docs/src/tables.md)";

/// Says which fields the columns of a table are, and takes only those.
///
/// # Errors
/// [`Error::Input`] for a column in a unit that cannot be used, two columns of one field, and a name so near to that of
/// a field which is missing that it is misspelt; where `others` are not let be, for every unknown one.
pub(super) fn choose(
    table: &mut TableReader,
    known: &[Named],
    field_of: impl Fn(usize) -> usize,
    others_are_let_be: bool,
) -> Result<Vec<Chosen>> {
    let mut chosen: Vec<Chosen> = Vec::new();
    let mut unknown = Vec::new();
    for (at, column) in table.columns().iter().enumerate() {
        let refused = |problem: String, help: String| Err(Error::input(table.header().column(column), problem, help));
        match resolve(column, known) {
            Resolved::Field(known, divisor) => {
                let field = field_of(known);
                if let Some(other) = chosen.iter().find(|other| other.field == field) {
                    let problem = format!("holds the same as the column `{}`", other.column);
                    return refused(problem, "remove one of the two".to_owned());
                }
                chosen.push(Chosen { at, column: column.clone(), known, field, divisor });
            }
            Resolved::WrongUnit(problem, help) => return refused(problem, help),
            // The index that pandas keeps.
            Resolved::Unknown if column.is_empty() || column.starts_with("__") || column.starts_with("Unnamed") => {}
            Resolved::Unknown => unknown.push(column),
        }
    }
    for column in unknown {
        let missing = (0..known.len()).filter(|&at| !chosen.iter().any(|other| other.field == field_of(at)));
        let near = nearest(column, missing.map(|at| known[at].name.as_str()));
        let help = match near {
            Some(near) => format!("did you mean `{near}`? {HELP}"),
            None if others_are_let_be => continue,
            None => format!("remove it; {HELP}"),
        };
        return Err(Error::input(table.header().column(column), "there is no such column", help));
    }
    let at: Vec<usize> = chosen.iter().map(|column| column.at).collect();
    table.want(&at)?;
    Ok(chosen)
}

/// A column whose field is known.
pub(super) struct Chosen {
    pub at: usize,
    /// As the file names it.
    pub column: String,
    /// Under which name it was understood.
    pub known: usize,
    pub field: usize,
    pub divisor: f64,
}
