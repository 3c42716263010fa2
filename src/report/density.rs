//! Densities as terminal tables.

use std::path::Path;

use serde::Serialize;

use super::records::{record, sorted};
use lanesweep_stats::density::{DensityModel, Exposure, Rate, Refused, SearchEnd, ValidFraction, standard_deviation};
use lanesweep_support::readable::{count, significant};
use lanesweep_support::table::{Column, Digits, Table};

/// One density without its kernels.
pub fn text(model: &DensityModel) -> String {
    let id = model.space.id();
    let provenance = &model.provenance;
    let (category, key, description) = (id.category.label(), id.key, id.description());
    let [found, kept, left_out] = [provenance.found, provenance.kept, provenance.left_out].map(count);
    let (scenarios, parameters) = (count(model.kde.points().len()), parameters(model).text());
    let bandwidth = model.kde.bandwidth();
    let end = match bandwidth.end {
        SearchEnd::Inside => "",
        SearchEnd::Lower => "; the search ended at the rule's lower end",
        SearchEnd::Upper => "; the search ended at the rule's upper end",
    };
    let likelihood = bandwidth.likelihood.map_or(String::new(), |of| {
        let [best, low, high] = [of.best, of.low, of.high].map(short);
        format!("; the likelihood's best is {best} [{low}, {high}]")
    });
    let ([value, silverman], rule) = ([bandwidth.value, bandwidth.silverman].map(short), bandwidth.rule.key());
    let ValidFraction { estimate, low, high, seed, .. } = model.valid;
    let [valid, draws] = [model.valid.valid, model.valid.draws].map(count);
    let refused = match &model.valid.refused[..] {
        [] => String::new(),
        _ => format!("refused    {}\n", refused(&model.valid)),
    };
    format!(
        "{category} {key} ({description}): density over {scenarios} scenarios; {found} found, {kept} kept, {left_out} left out\n\
         {parameters}bandwidth  {value} (rule `{rule}`; Silverman's {silverman}){end}{likelihood}\n\
         P_valid    {estimate:.4} [{low:.4}, {high:.4}], {valid} of {draws} draws, seed {seed}\n\
         {refused}exposure   {}\n",
        model.exposure.as_ref().map_or(UNKNOWN.to_owned(), exposure)
    )
}

/// The same as [`text`], with its file, as JSON; unknown values are null.
pub fn record(model: &DensityModel, file: &Path) -> impl Serialize {
    let id = model.space.id();
    let provenance = &model.provenance;
    let mut parameters = parameters(model);
    parameters.columns[0].name = "name".into();
    record! {
        bandwidth: sorted(model.kde.bandwidth()),
        category: id.category.key(),
        description: id.description(),
        exposure: sorted(&model.exposure),
        file: file.display().to_string(),
        found: provenance.found,
        kept: provenance.kept,
        left_out: provenance.left_out,
        parameterization: id.key,
        parameters: parameters.records(),
        scenarios: model.kde.points().len(),
        valid: sorted(&model.valid),
    }
}

/// Location, spread and bounds of every parameter.
fn parameters(model: &DensityModel) -> Table {
    let values = |j: usize| model.kde.points().iter().map(|p| p[j]).collect::<Vec<f64>>();
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    Table::of(model.space.parameters().iter().enumerate())
        .column("parameter", |(_, parameter)| parameter.name.as_str())
        .column("unit", |(_, parameter)| parameter.unit.as_str())
        .column(number("mean"), |(j, _)| mean(values(j)))
        .column(number("deviation"), |(j, _)| standard_deviation(&values(j)))
        .column(number("scale"), |(j, _)| model.kde.scale()[j])
        .column(number("kernel"), |(j, _)| model.kde.spread()[j])
        .column("valid", |(_, parameter)| parameter.bounds_text())
        .build()
}

/// Fraction of the draws that each bound rejects.
fn refused(valid: &ValidFraction) -> String {
    let of = |refused: &Refused| {
        let percent = 100.0 * refused.draws as f64 / valid.draws as f64;
        format!("{} % of the draws by {} (valid is {})", significant(percent, 2), refused.parameter, refused.bound)
    };
    valid.refused.iter().map(of).collect::<Vec<_>>().join("\n           ")
}

const UNKNOWN: &str = "unknown: the hours and kilometres driven for these scenarios were not given";

fn exposure(exposure: &Exposure) -> String {
    let mut parts = vec![format!("{} events", count(exposure.events))];
    let mut rate = |rate: &Option<Rate>, driven: Option<f64>, unit: &str| {
        if let (Some(rate), Some(driven)) = (rate, driven) {
            let numbers = [driven, rate.estimate, rate.standard_deviation, rate.low, rate.high];
            let [driven, mean, deviation, low, high] = numbers.map(short);
            parts.push(format!("in {driven} {unit}: {mean} per {unit} ± {deviation} (√n), [{low}, {high}] exact"));
        }
    };
    rate(&exposure.per_hour, exposure.driven.hours, "h");
    rate(&exposure.per_kilometre, exposure.driven.kilometres, "km");
    parts.join("\n           ")
}

/// One row per density.
pub fn summary(models: &[&DensityModel]) -> String {
    let rows = Table::of(models.iter().copied())
        .column("density", |model| format!("{} {}", model.space.id().category.label(), model.space.id().key))
        .column("parameters", |model| model.space.dimensions())
        .column("scenarios", |model| model.kde.points().len())
        .column(number("bandwidth"), |model| model.kde.bandwidth().value)
        .column(number("P_valid").digits(Digits::Fixed(4)), |model| model.valid.estimate);
    format!("All densities\n{}", rows.build().text())
}

fn number(name: &'static str) -> Column {
    Column::from(name).digits(Digits::Significant(4))
}

fn short(value: f64) -> String {
    significant(value, 4)
}
