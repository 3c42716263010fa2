//! Renders a table as plain text for the terminal.

use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Width, presets};

use super::Table;

/// Default width of tables, in characters, if the terminal's width is unknown.
pub const WIDTH: usize = 120;

/// A non-breaking space.
const NO_BREAK: char = '\u{a0}';

impl Table {
    /// The table in 120 characters: numbers aligned right, leading text columns left. Cells break between words; if a
    /// word or number does not fit, the table is wider.
    pub fn text(&self) -> String {
        let (header, rows) = self.shown();
        drawn(header, rows, self.words(), WIDTH)
    }

    /// The table within a width in characters. If it is too wide it becomes several tables, each with the first `keys`
    /// columns, so that no number and no interval breaks.
    pub fn fitted(&self, keys: usize, width: usize) -> String {
        let (header, rows) = self.shown();
        // Brackets do not break, and no table is narrower than its words.
        let [header, rows @ ..] = &[vec![header], rows].concat().iter().map(|row| held(row)).collect::<Vec<_>>()[..]
        else {
            return String::new();
        };
        let cells = |at: usize| std::iter::once(header).chain(rows).filter_map(move |row| row.get(at));
        // Including the bars and spaces of the style.
        let longest = |at: usize, breaks: &[char]| {
            let parts = cells(at).flat_map(|cell| cell.split(breaks)).map(|part| part.chars().count());
            parts.max().unwrap_or(0) + 3
        };
        let column = |at: usize| longest(at, &['\n']);
        let fixed: usize = 1 + (0..keys).map(column).sum::<usize>();
        let (mut parts, mut used) = (vec![(0..keys).collect::<Vec<usize>>()], fixed);
        for at in keys..header.len() {
            let last = parts.len() - 1;
            if used + column(at) > width && parts[last].len() > keys {
                (used, _) = (fixed, parts.push((0..keys).collect()));
            }
            used += column(at);
            let last = parts.len() - 1;
            parts[last].push(at);
        }
        let text = |columns: &Vec<usize>| {
            let of = |row: &Vec<String>| columns.iter().map(|&at| row[at].clone()).collect::<Vec<_>>();
            let min_width = fixed + columns.iter().skip(keys).map(|at| longest(*at, &[' ', '\n'])).sum::<usize>();
            let words = columns.iter().filter(|at| **at < self.words()).count();
            drawn(of(header), rows.iter().map(of).collect(), words, width.max(min_width)).replace(NO_BREAK, " ")
        };
        parts.iter().map(text).collect::<Vec<_>>().join("\n")
    }
}

/// Replaces the spaces in brackets by non-breaking ones.
fn held(row: &[String]) -> Vec<String> {
    let held = |cell: &String| {
        let mut depth = 0;
        let hold = |c: char| {
            depth += i32::from(c == '[') - i32::from(c == ']');
            if c == ' ' && depth > 0 { NO_BREAK } else { c }
        };
        cell.chars().map(hold).collect::<String>()
    };
    row.iter().map(held).collect()
}

/// Draws a table whose cells break, with the first `words` columns aligned left.
fn drawn(header: Vec<String>, rows: Vec<Vec<String>>, words: usize, width: usize) -> String {
    let mut table = comfy_table::Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(width as u16);
    let widths = column_widths(&header, &rows, width);
    table.set_header(header).add_rows(rows);
    for ((at, column), width) in table.column_iter_mut().enumerate().zip(widths) {
        // Plus a space on either side.
        column.set_constraint(ColumnConstraint::Absolute(Width::Fixed(width as u16 + 2)));
        column.set_cell_alignment(if at < words { CellAlignment::Left } else { CellAlignment::Right });
    }
    format!("{table}\n")
}

/// Widths of the columns' texts: each fits its longest word, and columns with longer lines divide the remaining width.
fn column_widths(header: &[String], rows: &[Vec<String>], width: usize) -> Vec<usize> {
    let longest = |at: usize, of: fn(&str) -> usize| {
        let cells = std::iter::once(&header[at]).chain(rows.iter().filter_map(|row| row.get(at)));
        cells.map(|cell| of(cell)).max().unwrap_or(0)
    };
    fn widest<'a>(parts: impl Iterator<Item = &'a str>) -> usize {
        parts.map(|part| part.chars().count()).max().unwrap_or(0)
    }
    let sizes: Vec<[usize; 2]> = (0..header.len())
        .map(|at| [longest(at, |cell| widest(cell.split_ascii_whitespace())), longest(at, |cell| widest(cell.lines()))])
        .collect();
    let words: usize = sizes.iter().map(|[word, _]| word).sum();
    let wanted: usize = sizes.iter().map(|[word, line]| line - word).sum();
    let left = wanted.min(width.saturating_sub(3 * sizes.len() + 1 + words));
    sizes.iter().map(|[word, line]| word + (line - word) * left / wanted.max(1)).collect()
}
