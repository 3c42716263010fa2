//! Units and meanings of the columns of results: what the chapter of files and tables says of them.

use std::sync::LazyLock;

use lanesweep_support::table::{ColumnKind, Table};

const CHAPTER: &str = include_str!("../../docs/src/tables.md");

/// Units by the ends of names; the longest first.
const UNITS: [(&str, &str); 8] = [
    ("_per_hour", "1/h"),
    ("_mps2", "m/s²"),
    ("_mps", "m/s"),
    ("_kmh", "km/h"),
    ("_s2", "s²"),
    ("_m", "m"),
    ("_s", "s"),
    ("_percent", "%"),
];

/// Names of columns, which may have an ellipsis for a part, and what they mean.
static MEANINGS: LazyLock<Vec<(Vec<&'static str>, String)>> = LazyLock::new(|| {
    let rows = CHAPTER.lines().filter(|line| line.starts_with("| `"));
    let meaning = |line: &'static str| {
        let cells: Vec<&str> = line.trim_matches('|').split(" | ").map(str::trim).collect();
        // Tables of types have the meaning fourth, the others second.
        let text = cells.get(if cells.len() > 3 { 3 } else { 1 })?;
        Some((cells[0].split(", ").map(|name| name.trim_matches('`')).collect(), without_links(text)))
    };
    rows.filter_map(meaning).collect()
});

/// Gives every column that says nothing of itself its unit and meaning.
pub fn explain(table: &mut Table) {
    for column in &mut table.columns {
        let name = column.name.as_ref();
        let is_number = !matches!(column.kind, ColumnKind::Text | ColumnKind::Name | ColumnKind::Flag);
        let unit = UNITS.iter().find(|(end, _)| name.ends_with(end)).map_or("1", |(_, unit)| *unit);
        let is_meant = |known: &&str| match known.split_once('…') {
            Some((start, end)) => start.len() + end.len() > 0 && name.starts_with(start) && name.ends_with(end),
            None => *known == name,
        };
        let meaning = MEANINGS.iter().find(|(names, _)| names.iter().any(&is_meant));
        if column.description.is_empty()
            && let Some((_, meaning)) = meaning
        {
            column.description = meaning.as_str().into();
        }
        if column.unit.is_empty() && is_number {
            column.unit = unit.into();
        }
    }
}

/// A text of the book without the addresses of its links.
fn without_links(text: &str) -> String {
    let mut parts = text.split("](");
    let first = parts.next().unwrap_or_default().to_owned();
    let rest = parts.map(|part| part.split_once(')').map_or(part, |(_, after)| after));
    rest.fold(first, |text, part| text + part).replace(['[', '`'], "")
}
