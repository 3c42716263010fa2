//! Concrete cases from flags, a TOML file or a table.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;

use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};

use lanesweep_engine::Headway;
use lanesweep_model::driver::ModelId;
use lanesweep_model::plausibility::{Doubts, Implausible};
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::{
    CaseFile, CaseNumber, CaseParameters, CaseQuantity, CaseRow, NUMBERS, ParameterRows, PlainCase, RowPlace, Written,
    si,
};
use lanesweep_run::check::Subject;
use lanesweep_run::reopen::TracedCase;
use lanesweep_support::input_file::{self, plain_name};
use lanesweep_support::table::{NameUnit, TableFormat, TableReader};
use lanesweep_support::{Error, Place, Result, option};

/// A case as it is given: by flags, one per number, by a file or by a row of a table.
#[derive(Debug, Default)]
pub(super) struct GivenCase {
    parameters: CaseParameters,
    models: Option<String>,
    /// Its key in a table.
    pub id: Option<String>,
    /// The place of a row's values.
    row: Option<RowPlace>,
}

/// The numbers that have a flag; a duration is of files only.
fn numbers() -> impl Iterator<Item = &'static CaseNumber> {
    NUMBERS.iter().filter(|number| number.key != "duration")
}

/// Checks a number as it is written.
fn written(number: &'static CaseNumber) -> impl Fn(&str) -> std::result::Result<String, String> + Clone {
    move |text| number.set_text(&mut CaseParameters::default(), text).map(|()| text.to_owned())
}

impl Args for GivenCase {
    fn augment_args(command: Command) -> Command {
        let category = Arg::new("category").value_name("NAME").help("Kind of scenario: cut-in, cut-out, lvd");
        let models = Arg::new("models").value_name("LIST").action(ArgAction::Append).value_delimiter(',');
        let models = models.help(super::lists::models_help());
        let command = command
            .arg(category.long("category").help_heading("Scenario"))
            .arg(models.long("models").help_heading("Models and criteria"));
        numbers().fold(command, |command, number| {
            let arg = Arg::new(number.key)
                .long(number.key.replace('_', "-"))
                .value_name(if number.needs_unit() { "km/h|m/s" } else { number.unit() })
                .value_parser(written(number))
                // Of what may be negative.
                .allow_hyphen_values(number.unit().starts_with("m/s"))
                .help(number.help)
                .help_heading("Scenario");
            command.arg(if number.key == "gap" { arg.conflicts_with("thw") } else { arg })
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for GivenCase {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<GivenCase, clap::Error> {
        let category = matches.get_one::<String>("category").cloned();
        let mut parameters = CaseParameters { category, ..CaseParameters::default() };
        for number in numbers() {
            let Some(text) = matches.get_one::<String>(number.key) else { continue };
            let kind = clap::error::ErrorKind::ValueValidation;
            number.set_text(&mut parameters, text).map_err(|problem| clap::Error::raw(kind, problem))?;
        }
        let models = matches.get_many::<String>("models").map(|names| names.cloned().collect::<Vec<_>>().join(","));
        Ok(GivenCase { parameters, models, ..GivenCase::default() })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = GivenCase::from_arg_matches(matches)?;
        Ok(())
    }
}

impl GivenCase {
    /// Width of the lanes, m, if given.
    pub(super) fn lane_width_m(&self) -> Option<f64> {
        self.parameters[CaseQuantity::LaneWidth]
    }

    /// Values of `self` where given, otherwise those of a file.
    pub(super) fn over(&self, file: GivenCase) -> GivenCase {
        GivenCase {
            row: file.row.map(|row| row.without(&self.parameters.given())),
            models: self.models.clone().or(file.models),
            id: file.id,
            parameters: self.parameters.clone().over(&file.parameters),
        }
    }

    /// The initial distance, if given.
    pub(super) fn start(&self) -> Result<Option<Headway>> {
        let is_given = [CaseQuantity::Gap, CaseQuantity::Thw].iter().any(|start| self.parameters[*start].is_some());
        is_given.then(|| self.headway()).transpose()
    }

    /// Whether it gives a value of the case other than these.
    pub(super) fn gives_more_than(&self, keys: &[&str]) -> bool {
        self.parameters.given().iter().any(|key| !keys.contains(key))
    }

    /// The named models; `None` if none is named.
    pub(super) fn named_models(&self) -> Result<Option<Vec<ModelId>>> {
        self.models.as_ref().map(|list| super::lists::models(list.split(','), "models")).transpose()
    }

    /// Whether it gives no value of the case.
    pub(super) fn is_empty(&self) -> bool {
        self.parameters == CaseParameters::default()
    }

    /// The named models in the given order; all if none is named.
    fn models(&self) -> Result<Vec<ModelId>> {
        let names = self.models.iter().flat_map(|list| list.split(','));
        self.located(super::lists::models(names, "models"))
    }

    /// Adds the place of a table's value to its error.
    pub(super) fn located<T>(&self, result: Result<T>) -> Result<T> {
        result.map_err(|error| match &self.row {
            Some(row) => row.locate(error),
            None => error,
        })
    }

    pub(super) fn headway(&self) -> Result<Headway> {
        let (gap, thw) = (self.parameters[CaseQuantity::Gap], self.parameters[CaseQuantity::Thw]);
        self.located(self.parameters.check_start())?;
        let start = gap.map(Headway::GapM).or(thw.map(Headway::thw));
        self.located(start.ok_or_else(|| {
            let help = format!("give {} in metres or {} in seconds", option("gap"), option("thw"));
            Error::usage(Place::item("gap, thw"), "the initial distance is missing", help)
        }))
    }

    /// Runs the case with each of its models; warns about doubtful values.
    pub(super) fn traced(&self, profile: &Profile, implausible: Implausible) -> Result<TracedCase> {
        let mut doubts = Doubts::new(implausible);
        let plain = self.plain_case(profile, &mut doubts)?;
        doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
        let case = self.located(plain.case(profile.frame.time_cap_s))?;
        TracedCase::run(&case, self.headway()?, profile, &self.models()?)
    }

    /// The case as a check takes it.
    pub(super) fn subject(&self, profile: &Profile, doubts: &mut Doubts) -> Result<Subject> {
        Ok(Subject::plain(&self.plain_case(profile, doubts)?, self.headway()?))
    }

    /// The numbers of the case.
    pub(super) fn plain_case(&self, profile: &Profile, doubts: &mut Doubts) -> Result<PlainCase> {
        let place = |key: &str| self.row.as_ref().map_or(key.to_owned(), |row| row.of(key).to_string());
        let (mut parameters, frame) = (self.parameters.clone(), &profile.frame);
        let size_m = [frame.default_length_m, frame.default_width_m];
        let plain = parameters.checked_case(size_m, frame.time_cap_s, doubts, &place);
        let plain = self.located(plain)?;
        self.headway()?;
        Ok(plain)
    }
}

/// A time in s, with or without its unit: `1.2`, `1.2s`.
pub(super) fn time_s(text: &str) -> std::result::Result<f64, String> {
    si(Written::Text(text), "s", NameUnit::Customary).map_err(|unusable| format!("write {}", unusable.write))
}

/// Reads a case from a TOML file.
pub(super) fn from_toml(path: &Path) -> Result<GivenCase> {
    let help = "the keys are the flags of `simulate --help` with `_`";
    let CaseFile { models, parameters } = input_file::read_toml(path, help)?;
    Ok(GivenCase { parameters, models, ..GivenCase::default() })
}

/// A CSV or Parquet table of cases.
pub(super) struct GivenCases {
    rows: ParameterRows,
    row: usize,
    /// Where each id was first.
    lines: HashMap<String, u64>,
    /// Where each id of several rows was last.
    doubled: HashMap<String, u64>,
    /// First row of each case, by the hash of its values.
    cases: HashMap<u64, usize>,
    /// Rows that are equal to an earlier one but for their ids, with that one.
    copies: Vec<[usize; 2]>,
}

impl GivenCases {
    pub(super) fn open(path: &Path) -> Result<GivenCases> {
        let format = TableFormat::of(&plain_name(path), &[TableFormat::Csv, TableFormat::Parquet], &option("table"))?;
        let rows = ParameterRows::new(TableReader::open(path, format)?)?;
        let (row, lines, doubled, cases, copies) = Default::default();
        Ok(GivenCases { rows, row, lines, doubled, cases, copies })
    }

    /// Number of the last row, from 1 after the header.
    pub(super) fn row(&self) -> usize {
        self.row
    }

    /// The error for the first row of an id that several rows have: it is unknown which one is meant.
    pub(super) fn refused_later(&self, id: &str) -> Option<Error> {
        let (first, next) = (self.lines.get(id)?, self.doubled.get(id)?);
        Some(self.rows.row_place(*first).locate(self.doubled_with(*next)))
    }

    /// Warnings about the rows so far.
    pub(super) fn notes(&self) -> Vec<String> {
        let number = self.copies.len();
        let copies = self.copies.first().map(|[row, earlier]| {
            format!("{number} row(s) are equal to another one but for their ids and count again, the first: row {row} is row {earlier}")
        });
        self.rows.notes().into_iter().chain(copies).collect()
    }

    fn doubled_with(&self, line: u64) -> Error {
        let problem = format!("this id belongs to {} {line} too, but every case needs its own id", self.rows.word());
        Error::usage(Place::item("id"), problem, "rename one of the two: neither is used")
    }

    /// The next row, or its error, which names file, line and column.
    pub(super) fn next(&mut self) -> Result<Option<Result<GivenCase>>> {
        let Some((line, row)) = self.rows.next_row()? else { return Ok(None) };
        self.row += 1;
        let row = row.and_then(|CaseRow { id, models, parameters, .. }| {
            let given = GivenCase { parameters, models, id, row: Some(self.rows.row_place(line)) };
            if let Some((id, first)) = given.id.as_ref().and_then(|id| Some((id, *self.lines.get(id)?))) {
                self.doubled.insert(id.clone(), line);
                given.located::<()>(Err(self.doubled_with(first)))?;
            }
            self.lines.extend(given.id.clone().map(|id| (id, line)));
            let mut hash = DefaultHasher::new();
            (&given.models, &given.parameters.category).hash(&mut hash);
            given.parameters.numbers.map(|number| number.map(f64::to_bits)).hash(&mut hash);
            let first = *self.cases.entry(hash.finish()).or_insert(self.row);
            self.copies.extend((first < self.row).then_some([self.row, first]));
            Ok(given)
        });
        Ok(Some(row))
    }
}

/// Reads a case from a row of a table; rows count from 1 after the header. Without a number the table has one row.
pub(super) fn from_table(path: &Path, row: Option<usize>) -> Result<GivenCase> {
    let mut table = GivenCases::open(path)?;
    let (wanted, help) = (row.unwrap_or(1), "rows count from 1 after the header");
    let missing = || Error::usage(Place::file(path), format!("there is no row {wanted}"), help);
    for _ in 1..wanted {
        drop(table.next()?.ok_or_else(missing)?);
    }
    let found = if wanted == 0 { None } else { table.next()? }.ok_or_else(missing)??;
    if row.is_none() && table.next()?.is_some() {
        let help = format!("name one: {}, from 1 after the header", option("row = N"));
        return Err(Error::usage(Place::file(path), "the table has several cases", help));
    }
    Ok(found)
}
