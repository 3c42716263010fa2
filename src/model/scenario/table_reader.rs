//! Scenarios from tables of this or any other program: one row per scenario with series as lists, one row per scenario
//! and instant, or one row per concrete case ([`super::parameter_table`]). The columns determine which. A table of
//! tracks is recognised and refused, because recordings must be mined first.

use std::path::Path;

use serde_json::{Map, Value};

use super::check::name;
use super::columns::{Chosen, HELP, Leaf, choose, leaves, names, number};
use super::found::{ScenarioFile, ScenariosRead};
use super::schema::wrong_field;
use super::{Scenario, parameter_table};
use crate::plausibility::Implausible;
use lanesweep_support::error::{Error, Place, Result};
use lanesweep_support::table::{Named, Resolved, Row, TableFormat, TableReader, resolve};

/// Reads a table of scenarios.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] naming file, row, scenario and column.
pub(super) fn read(path: &Path, format: TableFormat, implausible: Implausible) -> Result<ScenarioFile> {
    let table = TableReader::open(path, format)?;
    refuse_tracks(&table)?;
    let leaves = leaves();
    let names = names(&leaves);
    let mut known: Vec<Named> = names.iter().map(|(named, ..)| named.clone()).collect();
    let is = |column: &String, field: &str| match resolve(column, &known) {
        Resolved::Field(at, _) => leaves[names[at].1].flat == field,
        _ => false,
    };
    let has_series = table.columns().iter().any(|column| is(column, "target_v") || is(column, "target_y"));
    // A case has no series, and `t` is no time of it.
    let time = ["time", "t"].map(|name| Named { name: name.to_owned(), unit: "s", needs_unit: false });
    let time = &time[..if has_series { 2 } else { 1 }];
    let has_time = table.columns().iter().any(|column| matches!(resolve(column, time), Resolved::Field(..)));
    if !has_time && !has_series {
        return parameter_table::read(table, implausible);
    }
    known.extend(time.iter().filter(|_| has_time).cloned());
    let mut reader = Reader::new(table, leaves, &known, &names, implausible)?;
    while let Some(row) = reader.table.rows.next_row()? {
        if has_time { reader.instant(row) } else { reader.scenario(row) }
    }
    reader.end();
    let file = reader.table.file();
    reader.found.finish(file, HELP)
}

struct Reader {
    table: TableReader,
    leaves: Vec<Leaf>,
    chosen: Vec<Chosen>,
    /// Per selected column: whether its value may change within a scenario.
    may_change: Vec<bool>,
    found: ScenariosRead,
    /// The scenario whose instants are being read.
    open: Option<Open>,
    /// Id of the scenario that is skipped because one of its instants is unusable.
    refused: Option<Value>,
}

/// Instants read so far of one scenario.
struct Open {
    /// Row of every instant.
    rows: Vec<u64>,
    id: Value,
    /// Values of the first row, per selected column.
    first: Vec<Value>,
    /// Values per selected column that is a series.
    series: Vec<Vec<Value>>,
    times_s: Vec<f64>,
}

impl Reader {
    fn new(
        mut table: TableReader,
        leaves: Vec<Leaf>,
        known: &[Named],
        names: &[(Named, usize, bool)],
        implausible: Implausible,
    ) -> Result<Reader> {
        // The entry after the names is the time.
        let field_of = |at: usize| names.get(at).map_or(leaves.len(), |name| name.1);
        let chosen = choose(&mut table, known, field_of, true)?;
        let has_time = chosen.iter().any(|column| column.field == leaves.len());
        let is_there = |at: usize| chosen.iter().any(|column| column.field == at);
        let is_needed = |leaf: &Leaf| leaf.is_required && !(has_time && leaf.flat == "fps");
        let missing: Vec<String> = leaves
            .iter()
            .enumerate()
            .filter(|(at, leaf)| is_needed(leaf) && !is_there(*at))
            .map(|(_, leaf)| format!("`{}`", leaf.flat))
            .collect();
        if !missing.is_empty() {
            let problem = format!("no column {}", missing.join(", "));
            return Err(Error::input(table.header(), problem, HELP));
        }
        let may_change = chosen.iter().map(|column| names.get(column.known).is_none_or(|name| name.2)).collect();
        let found = ScenariosRead::new(implausible, "rename one of the two; rows of one scenario must be adjacent");
        Ok(Reader { table, leaves, chosen, may_change, found, open: None, refused: None })
    }

    /// Reads a row that is a scenario.
    fn scenario(&mut self, row: Row) {
        let id = self.id_of(&row.values);
        let values = match self.typed(row.number, &id, row.values) {
            Ok(values) => values,
            Err(error) => return self.found.refuse(error),
        };
        let mut scenario = Map::new();
        for (column, value) in self.chosen.iter().zip(values) {
            self.leaves[column.field].put(&mut scenario, value);
        }
        self.take(scenario, &[row.number]);
    }

    /// The id in a row.
    fn id_of(&self, values: &[Value]) -> Value {
        let is_id = |column: &Chosen| self.leaves.get(column.field).is_some_and(|leaf| leaf.flat == "id");
        let id = self.chosen.iter().position(is_id).map_or(Value::Null, |at| values[at].clone());
        // Some programs write ids as numbers.
        if id.is_number() { Value::from(id.to_string()) } else { id }
    }

    /// The values of a row in the fields' types and units.
    fn typed(&self, row: u64, id: &Value, values: Vec<Value>) -> Result<Vec<Value>> {
        let typed = |(column, value): (&Chosen, Value)| {
            let typed = match self.leaves.get(column.field) {
                Some(leaf) => leaf.typed(value, column.unit),
                None => number(value, "s", column.unit),
            };
            typed.map_err(|unusable| {
                let place = self.table.place(row, id.as_str().map(name)).column(&column.column);
                let help = unusable.help(&column.column);
                Error::input(place, unusable.problem, help)
            })
        };
        self.chosen.iter().zip(values).map(typed).collect()
    }

    /// Reads a row that is an instant of a scenario.
    fn instant(&mut self, row: Row) {
        let id = self.id_of(&row.values);
        if self.refused.as_ref() == Some(&id) {
            return;
        }
        if self.open.as_ref().is_some_and(|open| open.id != id) {
            self.end();
        }
        let values = self.typed(row.number, &id, row.values);
        if let Err(error) = values.and_then(|values| self.add_instant(row.number, &id, values)) {
            self.found.refuse(error);
            (self.open, self.refused) = (None, Some(id));
        }
    }

    /// Appends an instant to the open scenario, or opens one.
    fn add_instant(&mut self, row: u64, id: &Value, values: Vec<Value>) -> Result<()> {
        let item = id.as_str().map(name);
        let at = self.chosen.iter().position(|column| column.field == self.leaves.len());
        let time = at.map_or(&Value::Null, |at| &values[at]);
        let Some(time_s) = time.as_f64() else {
            let problem = format!("is {time}; expected a time in seconds");
            return Err(Error::input(self.table.place(row, item).column("time_s"), problem, HELP));
        };
        let Some(open) = &mut self.open else {
            let series = |column: &Chosen, value: &Value| {
                let is_series = self.leaves.get(column.field).is_some_and(Leaf::is_series);
                if is_series { vec![value.clone()] } else { Vec::new() }
            };
            let series = self.chosen.iter().zip(&values).map(|(column, value)| series(column, value)).collect();
            self.open = Some(Open { rows: vec![row], id: id.clone(), first: values, series, times_s: vec![time_s] });
            return Ok(());
        };
        for (at, (column, value)) in self.chosen.iter().zip(values).enumerate() {
            match self.leaves.get(column.field) {
                Some(leaf) if leaf.is_series() => open.series[at].push(value),
                Some(_) if !self.may_change[at] && !value.is_null() && value != open.first[at] => {
                    let problem = format!("is {value}, but {} at the scenario's first instant", open.first[at]);
                    let place = self.table.place(row, item).column(&column.column);
                    let help =
                        "a value of a whole scenario must be equal in all its rows, or given in the first row only";
                    return Err(Error::input(place, problem, help));
                }
                _ => {}
            }
        }
        open.rows.push(row);
        open.times_s.push(time_s);
        Ok(())
    }

    /// Builds the scenario from its instants.
    fn end(&mut self) {
        let Some(open) = self.open.take() else { return };
        let mut scenario = Map::new();
        let mut has_rate = false;
        for (at, (column, first)) in self.chosen.iter().zip(open.first).enumerate() {
            let Some(leaf) = self.leaves.get(column.field) else { continue };
            has_rate |= leaf.flat == "fps" && !first.is_null();
            let series = &open.series[at];
            // An absent vehicle has no series.
            let value = match leaf.is_series() {
                true if series.iter().all(Value::is_null) => Value::Null,
                true => Value::from(series.clone()),
                false => first,
            };
            leaf.put(&mut scenario, value);
        }
        let place = |at: usize| self.table.place(open.rows[at], open.id.as_str().map(name)).column("time_s");
        match rate_hz(&open.times_s) {
            Err((at, problem)) => {
                let help = "give every scenario rows in order with equal time steps";
                return self.found.refuse(Error::input(place(at), problem, help));
            }
            Ok(rate_hz) if !has_rate => drop(scenario.insert("fps".to_owned(), Value::from(rate_hz))),
            Ok(_) => {}
        }
        self.take(scenario, &open.rows);
    }

    /// Builds the scenario from one row, or from one row per instant.
    fn take(&mut self, scenario: Map<String, Value>, rows: &[u64]) {
        let value = Value::Object(scenario);
        let item = value.get("id").and_then(Value::as_str).map(name);
        let (table, leaves, chosen) = (&self.table, &self.leaves, &self.chosen);
        let row = rows[0];
        let place = |field: &str| -> Place {
            let instant = rows.get(1).and_then(|_| field.split_once('[')?.1.strip_suffix(']')?.parse::<usize>().ok());
            match instant.and_then(|at| rows.get(at)) {
                Some(row) => {
                    let column = column_of(leaves, chosen, field.split('[').next().unwrap_or_default());
                    table.place(*row, item.clone()).column(column)
                }
                None => table.place(row, item.clone()).column(column_of(leaves, chosen, field)),
            }
        };
        if let Some((field, problem)) = wrong_field(&value) {
            return self.found.refuse(Error::input(place(&field), problem, HELP));
        }
        match serde_json::from_value::<Scenario>(value) {
            Ok(scenario) => self.found.take(scenario, None, row, table.word(), place),
            Err(e) => {
                let problem = format!("not a scenario: {e}");
                self.found.refuse(Error::input(table.place(row, item.clone()), problem, HELP));
            }
        }
    }
}

/// The column of a field, as the file names it; `target.v[3]` is the fourth value in `target_v`.
fn column_of(leaves: &[Leaf], chosen: &[Chosen], field: &str) -> String {
    let (stem, index) = field.find('[').map_or((field, ""), |at| field.split_at(at));
    let flat = stem.replace('.', "_");
    let is = |column: &&Chosen| leaves.get(column.field).is_some_and(|leaf| leaf.flat == flat);
    // Without a column for the rate, it is that of the times.
    let absent = if flat == "fps" { "time_s" } else { &flat };
    format!("{}{index}", chosen.iter().find(is).map_or(absent, |column| &column.column))
}

/// Samples per second of equidistant instants; at least one instant. An error gives the index of the deviating instant.
fn rate_hz(times_s: &[f64]) -> std::result::Result<f64, (usize, String)> {
    let end = times_s.len() - 1;
    let (first, last) = (times_s[0], times_s[end]);
    if end == 0 {
        return Err((0, "one instant, but a scenario needs a duration".to_owned()));
    }
    let step_s = (last - first) / end as f64;
    if step_s.is_nan() || step_s <= 0.0 {
        return Err((end, format!("the last instant, {last} s, is not after the first, {first} s")));
    }
    // Times are often rounded to two or three digits.
    let is_off = |(k, time_s): (usize, &f64)| (time_s - (first + k as f64 * step_s)).abs() > 0.05 * step_s;
    if times_s.iter().enumerate().any(is_off) {
        let (at, usual_s) = odd_instant(times_s);
        let (before, time_s) = (times_s[at - 1], times_s[at]);
        return Err((
            at,
            format!("{time_s} s after {before} s; most time steps are {usual_s:.4} s: they must be equal"),
        ));
    }
    // Removes rounding errors of the times: the result is 25 Hz, not 25.0000001 Hz.
    Ok((1e6 / step_s).round() / 1e6)
}

/// The first instant whose distance from the previous one deviates from the typical distance, and that distance. A
/// single wrong time also changes the mean distance. Needs at least two instants.
fn odd_instant(times_s: &[f64]) -> (usize, f64) {
    let steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual_s = sorted[(sorted.len() - 1) / 2];
    let off = |step: &f64| (step - usual_s).abs();
    let largest = steps.iter().map(off).fold(0.0, f64::max);
    (1 + steps.iter().position(|step| off(step) >= 0.5 * largest).unwrap_or(0), usual_s)
}

/// Column names of recordings, in lower case without punctuation: vehicle, instant, longitudinal and lateral position.
const VEHICLE: &str = "id trackid vehicleid carid objectid idx";
const INSTANT: &str = "frame frameid framenum frameindex time times timesteptime timestep totalnanos timestamp";
const ALONG: &str = "x xm xcenter vehiclex localx posx xloc xlockf carcenterx";
const ACROSS: &str = "y ym ycenter vehicley localy posy yloc ylockf carcentery";
/// Columns that a table of scenarios has and a recording does not.
const SCENARIO: &str = "category targetv targetvmps targety targetym";

const TRACKS_HELP: &str = "scenarios are mined from recordings: give the folder of the recording, or its file, as data, or mine it first \
                           (`mine`) and give the scenarios that it writes; `tracks` says how it is read";

/// Refuses the columns of a recording.
///
/// # Errors
/// [`Error::Input`] at the header, naming the columns typical of recordings.
pub(super) fn refuse_tracks(table: &TableReader) -> Result<()> {
    let plain = |name: &str| name.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_ascii_lowercase();
    let find = |known: &str| table.columns().iter().find(|column| known.split(' ').any(|name| name == plain(column)));
    let (Some(vehicle), Some(instant), Some(along), Some(across), None) =
        (find(VEHICLE), find(INSTANT), find(ALONG), find(ACROSS), find(SCENARIO))
    else {
        return Ok(());
    };
    let problem = format!(
        "this is a table of tracks, not of scenarios: it has a vehicle (`{vehicle}`), its instants (`{instant}`) and its places \
         (`{along}`, `{across}`)"
    );
    Err(Error::input(table.header(), problem, TRACKS_HELP))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_instant_that_is_wrong_is_named_wherever_it_stands() {
        let good: Vec<f64> = (0..8).map(|k| f64::from(k) * 0.04).collect();
        assert_eq!(rate_hz(&good), Ok(25.0));
        for at in 1..8 {
            let mut times = good.clone();
            times[at] += 0.013;
            let (found, problem) = rate_hz(&times).unwrap_err();
            assert_eq!(found, at, "{problem}");
        }
        // 25 Hz needs two digits; 30 Hz needs three.
        let rounded: Vec<f64> = (0..91).map(|k| (f64::from(k) * 1000.0 / 30.0).round() / 1000.0).collect();
        assert_eq!(rate_hz(&rounded).map(f64::round), Ok(30.0));
        assert_eq!(rate_hz(&[1.0]).unwrap_err().0, 0);
        assert_eq!(rate_hz(&[1.0, 0.5]).unwrap_err().0, 1);
    }
}
