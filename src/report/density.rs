//! Densities as terminal tables.

use std::fmt::Write;

use super::tables::{aligned, table};
use crate::stats::density::{
    DensityModel, Exposure, Rate, Refused, Representativeness, SearchEnd, ValidShare, standard_deviation,
};
use crate::support::readable::{count, count_of, significant};

/// Everything of one density but its kernels.
pub fn text(model: &DensityModel) -> String {
    let id = model.space.id();
    let provenance = &model.provenance;
    let mut text = format!(
        "{} {} ({}): density over {} scenarios; {} found, {} kept, {} left out\n",
        id.category.label(),
        id.key,
        id.description(),
        count_of(model.kde.points().len()),
        count(provenance.found),
        count(provenance.kept),
        count(provenance.left_out)
    );
    let header = ["parameter", "unit", "mean", "deviation", "scale", "kernel", "valid"];
    let mut parameters = table(header.map(str::to_owned).to_vec());
    for (j, parameter) in model.space.parameters().iter().enumerate() {
        let values: Vec<f64> = model.kde.points().iter().map(|p| p[j]).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let numbers = [mean, standard_deviation(&values), model.kde.scale()[j], model.kde.spread()[j]];
        let mut row = vec![parameter.name.clone(), parameter.unit.clone()];
        row.extend(numbers.map(short));
        row.push(parameter.bounds_text());
        parameters.add_row(row);
    }
    text.push_str(&aligned(parameters, 2));
    let bandwidth = model.kde.bandwidth();
    let end = match bandwidth.end {
        SearchEnd::Inside => "",
        SearchEnd::Lower => "; the search ended at the rule's lower end",
        SearchEnd::Upper => "; the search ended at the rule's upper end",
    };
    let _ = writeln!(
        text,
        "bandwidth  {} (rule `{}`; Silverman's {}){end}",
        short(bandwidth.value),
        bandwidth.rule.key(),
        short(bandwidth.silverman)
    );
    let valid = &model.valid;
    let _ = writeln!(
        text,
        "P_valid    {:.4} [{:.4}, {:.4}], {} of {} draws, seed {}",
        valid.estimate,
        valid.low,
        valid.high,
        count(valid.valid),
        count(valid.draws),
        valid.seed
    );
    if !valid.refused.is_empty() {
        let _ = writeln!(text, "refused    {}", refused(valid));
    }
    let _ = writeln!(text, "exposure   {}", model.exposure.as_ref().map_or(UNKNOWN.to_owned(), exposure));
    if let Some(representativeness) = &model.representativeness {
        text.push_str(&compared(representativeness));
    }
    text
}

/// The same as [`text`], as JSON; what is not known is null.
pub fn record(model: &DensityModel) -> serde_json::Value {
    let id = model.space.id();
    let provenance = &model.provenance;
    let parameters = model.space.parameters().iter().enumerate().map(|(j, parameter)| {
        let values: Vec<f64> = model.kde.points().iter().map(|p| p[j]).collect();
        serde_json::json!({
            "name": parameter.name,
            "unit": parameter.unit,
            "mean": values.iter().sum::<f64>() / values.len() as f64,
            "deviation": standard_deviation(&values),
            "scale": model.kde.scale()[j],
            "kernel": model.kde.spread()[j],
            "valid": parameter.bounds_text(),
        })
    });
    serde_json::json!({
        "category": id.category.key(),
        "parameterization": id.key,
        "description": id.description(),
        "scenarios": model.kde.points().len(),
        "found": provenance.found,
        "kept": provenance.kept,
        "left_out": provenance.left_out,
        "parameters": parameters.collect::<Vec<_>>(),
        "bandwidth": model.kde.bandwidth(),
        "valid": model.valid,
        "exposure": model.exposure,
        "representativeness": model.representativeness,
    })
}

/// Which fraction of the draws every bound refuses.
fn refused(valid: &ValidShare) -> String {
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
            parts.push(format!(
                "in {} {unit}: {} per {unit} ± {} (√n), [{}, {}] exact",
                short(driven),
                short(rate.estimate),
                short(rate.standard_deviation),
                short(rate.low),
                short(rate.high)
            ));
        }
    };
    rate(&exposure.per_hour, exposure.driven.hours, "h");
    rate(&exposure.per_kilometre, exposure.driven.kilometres, "km");
    parts.join("\n           ")
}

fn compared(r: &Representativeness) -> String {
    format!(
        "M          {} ± {} over {} splits of {} training and {} test scenarios, seed {}\n           W(gen, test) \
         {}, W(gen, train) {}, W(train, test) {}\n",
        short(r.metric),
        short(r.metric_deviation),
        r.repetitions,
        r.train,
        r.test,
        r.seed,
        short(r.generated_test),
        short(r.generated_train),
        short(r.train_test)
    )
}

/// One row per density.
pub fn summary(models: &[&DensityModel]) -> String {
    let header = ["density", "parameters", "scenarios", "bandwidth", "P_valid", "M", "W(gen, test)", "W(train, test)"];
    let mut rows = table(header.map(str::to_owned).to_vec());
    for model in models {
        let id = model.space.id();
        let of = |value: fn(&Representativeness) -> f64| {
            model.representativeness.as_ref().map_or("-".to_owned(), |r| short(value(r)))
        };
        rows.add_row([
            format!("{} {}", id.category.label(), id.key),
            model.space.dimensions().to_string(),
            count_of(model.kde.points().len()),
            short(model.kde.bandwidth().value),
            format!("{:.4}", model.valid.estimate),
            of(|r| r.metric),
            of(|r| r.generated_test),
            of(|r| r.train_test),
        ]);
    }
    format!(
        "All densities. M and W compare SVD parameterizations of one category with each other; those of kinematic \
         ones\nhave their own units each.\n{}",
        aligned(rows, 1)
    )
}

fn short(value: f64) -> String {
    significant(value, 4)
}
