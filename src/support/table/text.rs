//! Renders a table as plain text for the terminal.

use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Width, presets};

use super::Table;

/// Default width of tables, in characters, if the terminal's width is unknown.
pub const WIDTH: usize = 120;

impl Table {
    /// The table in 120 characters: numbers aligned right, leading text columns left. Cells break between words; if a
    /// word or number does not fit, the table is wider.
    pub fn text(&self) -> String {
        let (header, rows) = self.shown();
        let mut table = comfy_table::Table::new();
        table.load_style(presets::ASCII_MARKDOWN);
        table.set_content_arrangement(ContentArrangement::Dynamic).set_width(WIDTH as u16);
        let widths = column_widths(&header, &rows, WIDTH);
        table.set_header(header).add_rows(rows);
        for ((at, column), width) in table.column_iter_mut().enumerate().zip(widths) {
            // Plus a space on either side.
            column.set_constraint(ColumnConstraint::Absolute(Width::Fixed(width as u16 + 2)));
            let alignment = if at < self.words() { CellAlignment::Left } else { CellAlignment::Right };
            column.set_cell_alignment(alignment);
        }
        format!("{table}\n")
    }
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
