//! `simulate`: a table of concrete cases becomes a table of outcomes.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{Decimal128Type, Float16Type, Float32Type, Float64Type};
use arrow_array::{
    Array, ArrayRef, Float64Array, Int64Array, RecordBatch, StringArray, UInt64Array, downcast_integer_array,
};
use arrow_schema::{DataType, Field, Schema};
use arrow_select::take::take;
use lanesweep::cli::embedded;
use lanesweep::engine::{Headway, OpenBackend};
use lanesweep::model::driver::ModelId;
use lanesweep::model::plausibility::Implausible;
use lanesweep::model::profile::Profile;
use lanesweep::report::lanes::{case_columns, case_row};
use lanesweep::run::cases::Cases;
use lanesweep::scenario::{CaseParameters, CaseQuantity, Category, NamedNumber, Written};
use lanesweep::support::plain_text::nearest;
use lanesweep::support::readable::counted;
use lanesweep::support::table::{ArrowRows, ColumnKind};
use lanesweep::{Error, Place, Result};
use pyo3::prelude::*;

use crate::error::input_error;
use crate::frame::{Frame, stream_of};
use crate::verb::watched;

/// Cases that are planned and run together: memory does not grow with the table beyond its result.
const CASES: usize = 1 << 16;

/// A column of a batch as numbers; null is a missing value.
fn numbers(array: &dyn Array) -> Option<Vec<Option<f64>>> {
    Some(downcast_integer_array! {
        array => array.iter().map(|v| v.map(|v| v as f64)).collect(),
        DataType::Float64 => array.as_primitive::<Float64Type>().iter().collect(),
        DataType::Float32 => array.as_primitive::<Float32Type>().iter().map(|v| v.map(f64::from)).collect(),
        DataType::Float16 => array.as_primitive::<Float16Type>().iter().map(|v| v.map(f64::from)).collect(),
        DataType::Decimal128(_, scale) => {
            let unit = 10_f64.powi((*scale).into());
            array.as_primitive::<Decimal128Type>().iter().map(|v| v.map(|v| v as f64 / unit)).collect()
        }
        DataType::Null => vec![None; array.len()],
        DataType::Dictionary(..) => of_names(array, numbers)?,
        _ => return None,
    })
}

/// A column of a batch as texts.
fn texts(array: &dyn Array) -> Option<Vec<Option<String>>> {
    let owned = |text: Option<&str>| text.map(str::to_owned);
    Some(match array.data_type() {
        DataType::Utf8 => array.as_string::<i32>().iter().map(owned).collect(),
        DataType::LargeUtf8 => array.as_string::<i64>().iter().map(owned).collect(),
        DataType::Utf8View => array.as_string_view().iter().map(owned).collect(),
        DataType::Dictionary(..) => of_names(array, texts)?,
        _ => return None,
    })
}

/// The values of a dictionary, row by row.
fn of_names<T: Clone>(array: &dyn Array, of: fn(&dyn Array) -> Option<Vec<Option<T>>>) -> Option<Vec<Option<T>>> {
    let names = array.as_any_dictionary_opt()?;
    let values = of(names.values().as_ref())?;
    if values.is_empty() {
        return Some(vec![None; array.len()]);
    }
    let keys = names.normalized_keys();
    Some((0..array.len()).map(|row| if array.is_null(row) { None } else { values[keys[row]].clone() }).collect())
}

fn of_column(name: &str, problem: String, help: &str) -> Error {
    Error::input(Place::default().column(name), problem, help)
}

/// A column that the result repeats in every row of its case: numbers and texts as ours, other types as they are.
fn carried_values(array: &ArrayRef) -> ArrayRef {
    let values = array.as_ref();
    if values.data_type().is_integer()
        && let Some(values) = numbers(values)
    {
        return Arc::new(values.into_iter().map(|value| value.map(|value| value as i64)).collect::<Int64Array>());
    }
    let found = numbers(values).map(|values| Arc::new(Float64Array::from(values)) as ArrayRef);
    found.or_else(|| Some(Arc::new(StringArray::from(texts(values)?)))).unwrap_or_else(|| array.clone())
}

/// A note on columns of numbers that are repeated although they look like quantities of a case.
fn looks_like_a_quantity(name: &str, array: &dyn Array) -> Option<String> {
    const WORDS: [&str; 8] = ["speed", "gap", "accel", "decel", "headway", "lateral", "length", "width"];
    const UNITS: [&str; 4] = ["kmh", "mps", "mps2", "thw"];
    let name_lower = name.to_lowercase();
    let looks =
        WORDS.iter().any(|word| name_lower.contains(word)) || name_lower.split('_').any(|part| UNITS.contains(&part));
    (looks && array.data_type().is_numeric()).then(|| {
        format!(
            "column `{name}` is repeated and not used: no quantity of a case has this name (the others are `{}`)",
            NamedNumber::names().join("`, `")
        )
    })
}

/// The columns of a batch that say nothing of a case: its id, and others.
fn carried(batch: &RecordBatch, outcome: &Schema) -> Result<Vec<(String, ArrayRef)>> {
    let is_own = |name: &str| name == "category" || matches!(NamedNumber::find(name), Err(_) | Ok(Some(_)));
    let columns = batch.schema();
    let columns = columns.fields().iter().zip(batch.columns()).filter(|(field, _)| !is_own(field.name()));
    let of = |(field, array): (&Arc<Field>, &ArrayRef)| {
        let name = field.name();
        if outcome.index_of(name).is_ok() {
            return Err(of_column(
                name,
                "the result has a column of this name".to_owned(),
                "rename it, or leave it out",
            ));
        }
        let refuse = |help| Err(of_column(name, "a row cannot choose it here".to_owned(), help));
        match name.as_str() {
            "models" => return refuse("give the argument `models`, which holds for all rows"),
            "rate_hz" => return refuse("leave it out: rows run exactly, without samples"),
            _ => {}
        }
        let known = NamedNumber::names();
        if name != "id"
            && let Some(near) = nearest(name, known.iter().map(AsRef::as_ref), 0.92)
        {
            let help = format!("call it `{near}` if this is meant; a column of your own needs another name");
            return Err(of_column(name, "there is no such column".to_owned(), &help));
        }
        Ok((name.clone(), carried_values(array)))
    };
    columns.map(of).collect()
}

/// The cases of a batch. `ids` has the row of every id so far.
fn rows_of(
    batch: &RecordBatch,
    category: Option<&str>,
    first_row: u64,
    ids: &mut HashMap<String, u64>,
) -> Result<Vec<CaseParameters>> {
    let blank = CaseParameters { category: category.map(str::to_owned), ..CaseParameters::default() };
    let mut rows = vec![blank; batch.num_rows()];
    let mut seen: HashMap<&str, &str> = HashMap::new();
    for (field, array) in batch.schema_ref().fields().iter().zip(batch.columns()) {
        let name = field.name().as_str();
        let place = |at: usize| Place::item(format!("row {}", first_row + at as u64)).column(name);
        let of_type =
            |expected: &str| of_column(name, format!("holds values of the type {}", array.data_type()), expected);
        if name == "id" {
            let as_texts = || Some(numbers(array.as_ref())?.into_iter().map(|id| Some(id?.to_string())).collect());
            let found = texts(array.as_ref()).or_else(as_texts).ok_or_else(|| of_type("expected texts or numbers"))?;
            for (at, id) in found.into_iter().enumerate().filter_map(|(at, id)| Some((at, id?))) {
                if let Some(first) = ids.insert(id, first_row + at as u64) {
                    let problem = format!("this id belongs to row {first} too, but every case needs its own id");
                    return Err(Error::input(place(at), problem, "rename one of the two"));
                }
            }
            continue;
        }
        if name == "category" {
            if category.is_some() {
                let problem = "the argument `category` is given too".to_owned();
                return Err(of_column(name, problem, "leave out one of the two"));
            }
            let found = texts(array.as_ref()).ok_or_else(|| of_type("expected texts: cut-in, cut-out or lvd"))?;
            rows.iter_mut().zip(found).for_each(|(row, text)| row.category = text);
            continue;
        }
        let at_place = |place: Place, error: Error| match error {
            Error::Usage { problem, help, .. } => Error::input(place, problem, help),
            other => other,
        };
        let found = NamedNumber::find(name).map_err(|error| at_place(Place::default().column(name), error));
        // The result repeats other columns.
        let Some(number) = found? else { continue };
        if let Some(other) = seen.insert(number.key(), name) {
            return Err(of_column(name, format!("column `{other}` says the same"), "leave out one of the two"));
        }
        let set = |(at, row, written): (usize, &mut CaseParameters, Written<'_>)| {
            number.set(row, written).map_err(|error| at_place(place(at), error))
        };
        if let Some(values) = numbers(array.as_ref()) {
            for (at, (row, value)) in rows.iter_mut().zip(values).enumerate() {
                match value {
                    Some(value) if !value.is_finite() => {
                        let help = "give a finite number, or null for a value that is not given";
                        return Err(Error::input(place(at), format!("{value} is no number"), help));
                    }
                    Some(value) => set((at, row, Written::Number(value)))?,
                    None => {}
                }
            }
        } else if let Some(values) = texts(array.as_ref()) {
            for (at, (row, text)) in rows.iter_mut().zip(values).enumerate() {
                text.map_or(Ok(()), |text| set((at, row, Written::Text(&text))))?;
            }
        } else {
            return Err(of_type("expected numbers, or texts with units"));
        }
    }
    Ok(rows)
}

/// The rows without a speed, in a table that has speeds or of cut-ins: the ego's is taken.
fn without_speed(rows: &[CaseParameters]) -> impl Iterator<Item = usize> + '_ {
    let has_speeds = rows.iter().any(|row| row[CaseQuantity::OtherSpeed].is_some());
    let is_cut_in = |row: &CaseParameters| row.category.as_deref().and_then(Category::parse) == Some(Category::CutIn);
    let is_doubtful =
        move |row: &CaseParameters| row[CaseQuantity::OtherSpeed].is_none() && (has_speeds || is_cut_in(row));
    rows.iter().enumerate().filter(move |(_, row)| is_doubtful(row)).map(|(at, _)| at)
}

/// What all cases share.
struct Options {
    category: Option<String>,
    models: Vec<ModelId>,
    headways: Vec<Headway>,
    profile: Profile,
    backend: OpenBackend,
    implausible: Implausible,
}

/// A headway as Python gives it: seconds, or a text with its unit.
pub fn headway_of(text: &str) -> Result<Headway> {
    let parsed = Headway::parse(text).or_else(|| Headway::parse(&format!("{text}s")));
    parsed.filter(|headway| *headway != Headway::Observed).ok_or_else(|| {
        let help = "give seconds of at least 0, or a text such as 1.2s, 30m, r157";
        Error::usage(Place::option("thw"), format!("`{text}` is no headway"), help)
    })
}

/// The model of a name.
pub fn model_of(name: &str) -> Result<ModelId> {
    let names = ModelId::ALL.map(ModelId::name);
    let unknown = || Error::unknown(Place::option("models"), "driver model", name, names, ", or a Driver");
    ModelId::parse(name).ok_or_else(unknown)
}

/// The keyword arguments of `lanesweep.simulate`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Arguments {
    category: Option<String>,
    models: Vec<String>,
    thw: Vec<String>,
    profile: String,
    dt: Option<f64>,
    backend: String,
    device: Option<String>,
    reference: bool,
    accept_implausible: bool,
}

impl Arguments {
    fn options(self) -> Result<Options> {
        let mut profile = Profile::load(&self.profile)?;
        if let Some(dt_s) = self.dt {
            profile = profile.with_dt(dt_s)?;
        }
        let models = self.models.iter().map(|name| model_of(name)).collect::<Result<Vec<_>>>()?;
        let opened = match self.reference {
            true if self.backend == "gpu" || self.device.is_some() => {
                let problem = "binary64 runs on the CPU";
                return Err(Error::usage(Place::option("reference"), problem, "leave out the device, or `reference`"));
            }
            true => OpenBackend::reference(),
            false => OpenBackend::open(self.backend.parse()?, self.device.as_deref())?,
        };
        Ok(Options {
            category: self.category,
            models: if models.is_empty() { ModelId::ALL.to_vec() } else { models },
            headways: self.thw.iter().map(|text| headway_of(text)).collect::<Result<_>>()?,
            profile,
            backend: opened.with_cancel(embedded::token()),
            implausible: if self.accept_implausible { Implausible::Accepted } else { Implausible::Refused },
        })
    }
}

/// Appends the outcomes of some cases; returns notes about their values.
fn run(rows: Vec<CaseParameters>, first_row: u64, options: &Options, to: &mut ArrowRows) -> Result<Vec<String>> {
    let Options { models, headways, profile, implausible, .. } = options;
    let cases = Cases::plan(rows, first_row, profile, models, headways, *implausible)?;
    let outcomes = cases.run(&options.backend.executor())?;
    let plan = cases.lane_plan();
    let per_row = plan.headways.len() * models.len();
    for (at, (outcome, is_robust)) in outcomes.iter().zip(cases.robust(&outcomes)).enumerate() {
        let (row, headway, model) = (at / per_row, at / models.len() % plan.headways.len(), at % models.len());
        let row = first_row + row as u64;
        let lane = (row, plan.headways[headway], models[model].name());
        to.row(&case_row(lane, outcome, is_robust, profile.frame.dt_s))?;
    }
    Ok(cases.notes)
}

/// Runs a table of concrete cases. See `lanesweep.simulate`.
#[pyfunction]
#[pyo3(signature = (cases, arguments, on_message=None))]
pub fn simulate(
    py: Python<'_>,
    cases: &Bound<'_, PyAny>,
    arguments: Arguments,
    on_message: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Frame, Vec<String>)> {
    let stream = stream_of(cases)?;
    let batches: Vec<RecordBatch> = stream
        .collect::<std::result::Result<_, _>>()
        .map_err(|error| input_error(format!("the table cannot be read: {error}")))?;
    watched(py, None, on_message, move || {
        embedded::exclusively(|| {
            let value = if arguments.reference { ColumnKind::Binary64 } else { ColumnKind::Binary32 };
            let options = arguments.options()?;
            let mut rows = ArrowRows::new(&case_columns(value), HashMap::new());
            let outcome = rows.schema();
            let mut schema = outcome.clone();
            let (mut frames, mut notes, mut first_row, mut ids) = (Vec::new(), Vec::new(), 0, HashMap::new());
            let mut speedless: Option<(u64, usize)> = None;
            let pieces = batches.iter().flat_map(|batch| {
                (0..batch.num_rows().div_ceil(CASES))
                    .map(|k| batch.slice(k * CASES, CASES.min(batch.num_rows() - k * CASES)))
            });
            for piece in pieces {
                let of_piece = rows_of(&piece, options.category.as_deref(), first_row, &mut ids)?;
                for at in without_speed(&of_piece) {
                    speedless.get_or_insert((first_row + at as u64, 0)).1 += 1;
                }
                if first_row == 0 {
                    let columns = piece.schema_ref().fields().iter().zip(piece.columns());
                    let own = columns.filter(|(field, _)| matches!(NamedNumber::find(field.name()), Ok(None)));
                    notes.extend(own.filter_map(|(field, array)| looks_like_a_quantity(field.name(), array.as_ref())));
                }
                notes.extend(run(of_piece, first_row, &options, &mut rows)?);
                first_row += piece.num_rows() as u64;
                let batch = rows.batch()?;
                let of_result = carried(&piece, &outcome)?;
                let times = batch.num_rows() / piece.num_rows().max(1);
                let (mut fields, mut columns) = (outcome.fields().to_vec(), batch.columns().to_vec());
                let rows: UInt64Array =
                    (0..piece.num_rows() as u64).flat_map(|row| std::iter::repeat_n(row, times)).collect();
                for (name, values) in of_result {
                    columns.push(
                        take(&values, &rows, None)
                            .map_err(|error| of_column(&name, error.to_string(), "leave it out"))?,
                    );
                    fields.push(Arc::new(Field::new(name, columns[columns.len() - 1].data_type().clone(), true)));
                }
                schema = Arc::new(Schema::new_with_metadata(fields, outcome.metadata().clone()));
                let joined = RecordBatch::try_new(schema.clone(), columns);
                frames.push(joined.map_err(|error| Error::Internal(format!("a table: {error}")))?);
            }
            notes.extend(speedless.map(|(first, missing)| {
                let rows = counted(missing, "row");
                format!(
                    "column `speed`: {rows} without a value, the first of them row {first}: the ego's speed is used"
                )
            }));
            if first_row == 0 {
                return Err(Error::input(Place::item("cases"), "the table has no rows", "give at least one case"));
            }
            Ok((Frame::new(schema, frames), notes))
        })
    })
}
