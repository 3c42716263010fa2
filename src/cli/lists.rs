//! Lists of models, headways and parameterizations as several verbs take them.

use crate::engine::Headway;
use crate::model::driver::ModelId;
use crate::scenario::Category;
use crate::scenario::parameterization::ParameterizationId;
use crate::{Error, Place, Result};

/// The models of `--models`, in the order of every table; all where none is given.
///
/// # Errors
/// [`Error::Usage`] for a model that there is not.
pub fn models(list: &[String]) -> Result<Vec<ModelId>> {
    if list.is_empty() {
        return Ok(ModelId::ALL.to_vec());
    }
    let parse = |text: &String| {
        ModelId::parse(text.trim()).ok_or_else(|| {
            let names: Vec<&str> = ModelId::ALL.iter().map(|m| m.name()).collect();
            let problem = format!("there is no driver model `{text}`");
            Error::usage(Place::item("--models"), problem, format!("use {}", names.join(", ")))
        })
    };
    let mut models = list.iter().map(parse).collect::<Result<Vec<_>>>()?;
    models.sort();
    models.dedup();
    Ok(models)
}

/// The headways of `--thw`, s. `words` are what else the flag takes, for the message.
///
/// # Errors
/// [`Error::Usage`] for one that is not above 0.
pub fn headways(list: &str, words: &str) -> Result<Vec<Headway>> {
    let parse = |text: &str| {
        let value = text.trim().parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0 && *v < 1e4);
        value.map(Headway::ThwS).ok_or_else(|| {
            let problem = format!("`{text}` is no time headway");
            let help = format!("give seconds above 0, separated by commas, or {words}");
            Error::usage(Place::item("--thw"), problem, help)
        })
    };
    list.split(',').map(parse).collect()
}

/// The same, or `paper`: the ten of the paper.
///
/// # Errors
/// As [`headways`].
pub fn paper_or_headways(text: &str) -> Result<Vec<Headway>> {
    match text.trim() {
        "paper" => Ok(Headway::paper()),
        list => headways(list, "`paper`"),
    }
}

/// The parameterizations of `--parameterization` among those of some categories, in the registry's order; all where
/// none is given.
///
/// # Errors
/// [`Error::Usage`] for one that the categories do not have.
pub fn parameterizations(categories: &[Category], list: &[String]) -> Result<Vec<ParameterizationId>> {
    let of_categories = || ParameterizationId::ALL.into_iter().filter(|p| categories.contains(&p.category));
    let wanted: Vec<&str> = list.iter().map(|key| key.trim()).collect();
    if wanted.is_empty() || wanted.contains(&"all") {
        return Ok(of_categories().collect());
    }
    if let Some(unknown) = wanted.iter().find(|key| of_categories().all(|p| p.key != **key)) {
        let of = |c: &Category| {
            let keys: Vec<&str> = ParameterizationId::of(*c).map(|p| p.key).collect();
            format!("{}: {}", c.label(), keys.join(" "))
        };
        let names: Vec<&str> = categories.iter().map(|c| c.label()).collect();
        return Err(Error::usage(
            Place::item("--parameterization"),
            format!("there is no parameterization `{unknown}` of {}", names.join(", ")),
            format!("use {}, or all", Category::ALL.iter().map(of).collect::<Vec<_>>().join("; ")),
        ));
    }
    Ok(of_categories().filter(|p| wanted.contains(&p.key)).collect())
}
