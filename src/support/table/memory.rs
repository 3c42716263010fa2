//! A table in memory, rendered as terminal text, CSV, JSON, a page or a file of any format.

use std::path::Path;

use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Width, presets};
use serde_json::{Map, Value};

use super::writer::{append_csv, csv_header};
use super::{Cell, Column, ColumnKind, TableFormat, TableMetadata, TableWriter, writer};
use crate::{Result, readable};

/// Default width of tables, in characters, if the terminal's width is unknown.
pub const WIDTH: usize = 120;

/// Columns and rows; every row has one cell per column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// Caption; only pages show it.
    pub caption: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows.
    pub rows: Vec<Vec<Cell<'static>>>,
}

/// The name of a column, or a part of it, and the value that an item has there.
pub type NamedValue<T, V> = (&'static str, fn(&T) -> V);

/// A table under construction: each added column has a value per item.
pub struct TableOf<T> {
    items: Vec<T>,
    table: Table,
}

impl Table {
    /// A table with one row per item and no column yet.
    pub fn of<T: Copy>(items: impl IntoIterator<Item = T>) -> TableOf<T> {
        let items: Vec<T> = items.into_iter().collect();
        let rows = items.iter().map(|_| Vec::new()).collect();
        TableOf { items, table: Table { rows, ..Table::default() } }
    }

    /// The same table under a caption.
    pub fn captioned(self, caption: impl Into<String>) -> Table {
        Table { caption: caption.into(), ..self }
    }

    /// The table as CSV: numbers in full precision, null as an empty field.
    pub fn csv(&self) -> String {
        let mut text = csv_header(&self.columns);
        self.rows.iter().for_each(|row| append_csv(&mut text, &self.columns, row));
        text
    }

    /// The rows as a list of objects. JSON has neither NaN nor infinity: NaN becomes null, infinity the text `Infinity`.
    /// The column `data` is skipped: a document names its data once.
    pub fn records(&self) -> Value {
        let record = |row: &Vec<Cell>| {
            let fields = self.columns.iter().zip(row).filter(|(column, _)| column.name != "data");
            let fields = fields.map(|(column, cell)| (column.name.to_string(), writer::json_value(column.kind, cell)));
            Value::Object(fields.collect::<Map<_, _>>())
        };
        Value::Array(self.rows.iter().map(record).collect())
    }

    /// Writes the table to a file in the format of the file name's ending.
    ///
    /// # Errors
    /// As [`TableFormat::of`] and [`TableWriter::row`].
    pub fn save(&self, path: &Path, facts: &TableMetadata) -> Result<()> {
        let format = TableFormat::of(path, &TableFormat::EVERY, "table")?;
        let mut file = TableWriter::create(path, format, self.columns.clone(), facts)?;
        self.rows.iter().try_for_each(|row| file.row(row))?;
        file.finish()
    }

    /// Number of leading text columns; they are aligned left, the others right.
    pub fn words(&self) -> usize {
        self.columns.iter().take_while(|c| matches!(c.kind, ColumnKind::Text | ColumnKind::Name)).count()
    }

    /// Column names and rows as people read them.
    pub fn shown(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let row = |row: &Vec<Cell>| self.columns.iter().zip(row).map(|(column, cell)| shown(column, cell)).collect();
        (self.columns.iter().map(|column| column.name.to_string()).collect(), self.rows.iter().map(row).collect())
    }

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

impl<T: Copy> TableOf<T> {
    /// Adds a column with a value per item; the value's type determines the column's.
    pub fn column<V: CellValue>(mut self, column: impl Into<Column>, value: impl Fn(T) -> V) -> TableOf<T> {
        self.table.columns.push(Column { kind: V::KIND, ..column.into() });
        for (row, item) in self.table.rows.iter_mut().zip(&self.items) {
            row.push(value(*item).cell());
        }
        self
    }

    /// Adds one column of the same type per key.
    pub fn columns<K: Copy, C: Into<Column>, V: CellValue>(
        self,
        keys: impl IntoIterator<Item = K>,
        name: impl Fn(K) -> C,
        value: impl Fn(T, K) -> V,
    ) -> TableOf<T> {
        keys.into_iter().fold(self, |table, key| table.column(name(key), |item| value(item, key)))
    }

    /// Builds the table.
    pub fn build(self) -> Table {
        self.table
    }
}

/// A value that a cell can hold.
pub trait CellValue {
    /// The column's type.
    const KIND: ColumnKind;

    /// The cell.
    fn cell(self) -> Cell<'static>;
}

/// Formatted numbers, such as an interval or a part of a whole.
pub struct NumberText(pub String);

/// Types of values, the kind of their column, and the cell of a value.
macro_rules! cell_values {
    ($($($of:ty),* => $kind:ident, $cell:expr;)*) => {$($(
        impl CellValue for $of {
            const KIND: ColumnKind = ColumnKind::$kind;

            fn cell(self) -> Cell<'static> {
                let cell: fn($of) -> Cell<'static> = $cell;
                cell(self)
            }
        }
    )*)*};
}
cell_values! {
    NumberText => Binary64, |number| Cell::text(number.0);
    // An empty text is null.
    String => Text, |text| if text.is_empty() { Cell::Null } else { Cell::text(text) };
    &str => Text, |text| text.to_owned().cell();
    bool => Flag, Cell::Flag;
    f64 => Binary64, Cell::Number;
    u8, u32, u64, usize, i64 => Whole, whole;
}

/// A count; null above 63 bits.
fn whole(count: impl TryInto<i64>) -> Cell<'static> {
    count.try_into().map_or(Cell::Null, Cell::Whole)
}

impl<V: CellValue> CellValue for Option<V> {
    const KIND: ColumnKind = V::KIND;

    fn cell(self) -> Cell<'static> {
        self.map_or(Cell::Null, CellValue::cell)
    }
}

/// A cell as people read it.
fn shown(column: &Column, cell: &Cell) -> String {
    match cell {
        Cell::Null => column.null.to_owned(),
        Cell::Text(text) => text.to_string(),
        Cell::Flag(flag) => if *flag { "yes" } else { "no" }.to_owned(),
        Cell::Whole(number) => readable::count(*number),
        Cell::Number(number) => column.digits.text(*number),
        Cell::Series(series) => series.iter().map(|number| column.digits.text(*number)).collect::<Vec<_>>().join(" "),
        Cell::Wholes(numbers) => numbers.iter().map(|number| readable::count(*number)).collect::<Vec<_>>().join(" "),
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
