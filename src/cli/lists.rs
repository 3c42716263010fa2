//! Lists of categories, models, headways and parameterizations, as flags give them. A plural flag takes a list; without it all
//! values are used. Also the flags of verbs that can be split and resumed.

use std::path::{Path, PathBuf};

use clap::Args;

use lanesweep_engine::Headway;
use lanesweep_model::driver::ModelId;
use lanesweep_model::plausibility::Quantity;
use lanesweep_model::scenario::Category;
use lanesweep_model::scenario::parameterization::Parameterization;
use lanesweep_run::parts::Shard;
use lanesweep_support::files::check_folder;
use lanesweep_support::plain_text::nearest;
use lanesweep_support::ranges::refuse_repeats;
use lanesweep_support::run_folder::RunFolder;
use lanesweep_support::{Error, Place, Result, option};

/// `--categories`.
#[derive(Debug, Clone, Args)]
pub(super) struct CategoriesFlag {
    /// Kinds of scenario: cut-in, cut-out, lvd [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Scenario")]
    categories: Vec<String>,
}

impl CategoriesFlag {
    /// In the order of every table; all if the list is empty.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown or repeated category.
    pub(super) fn list(&self) -> Result<Vec<Category>> {
        let (list, place) = (&self.categories, || Place::option("categories"));
        if list.is_empty() {
            return Ok(Category::ALL.to_vec());
        }
        let mut found = list.iter().map(|text| Category::named(text.trim(), place())).collect::<Result<Vec<_>>>()?;
        refuse_repeats(place, found.iter().zip(list.iter().map(|text| text.trim())))?;
        found.sort();
        Ok(found)
    }
}

/// The parameterizations of the categories, in the registry's order; all if the list is empty.
///
/// # Errors
/// [`Error::Usage`] for an unknown or repeated parameterization.
pub(super) fn parameterizations(list: &[String], categories: &[Category]) -> Result<Vec<Parameterization>> {
    let of_categories = || Parameterization::ALL.into_iter().filter(|p| categories.contains(&p.category));
    let wanted: Vec<&str> = list.iter().map(|key| key.trim()).collect();
    refuse_repeats(|| Place::option("parameterizations"), wanted.iter().map(|key| (*key, *key)))?;
    if wanted.is_empty() || wanted.contains(&"all") {
        return Ok(of_categories().collect());
    }
    if let Some(unknown) = wanted.iter().find(|key| of_categories().all(|p| p.key != **key)) {
        let of = |c: &Category| {
            let keys: Vec<_> = Parameterization::of(*c).map(|p| p.key).collect();
            format!("{}: {}", c.label(), keys.join(" "))
        };
        let names: Vec<&str> = categories.iter().map(|c| c.label()).collect();
        let problem = format!("there is no parameterization `{unknown}` of {}", names.join(", "));
        let help = format!("use {}, or all", Category::ALL.iter().map(of).collect::<Vec<_>>().join("; "));
        return Err(Error::usage(Place::option("parameterizations"), problem, help));
    }
    Ok(of_categories().filter(|p| wanted.contains(&p.key)).collect())
}

/// `--models`.
#[derive(Debug, Clone, Args)]
pub(super) struct ModelsFlag {
    #[arg(long, value_name = "LIST", value_delimiter = ',', help = models_help(), help_heading = "Models and criteria")]
    models: Vec<String>,
}

impl ModelsFlag {
    /// The models in the order of every table; all if none is named.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown model.
    pub(super) fn list(&self) -> Result<Vec<ModelId>> {
        let mut list = models(self.models.iter().map(String::as_str), "models")?;
        list.sort();
        Ok(list)
    }

    /// The named models; `None` if none is named.
    ///
    /// # Errors
    /// As [`ModelsFlag::list`].
    pub(super) fn named(&self) -> Result<Option<Vec<ModelId>>> {
        (!self.models.is_empty()).then(|| self.list()).transpose()
    }
}

/// Help of `--models`.
pub(super) fn models_help() -> String {
    format!("Driver models: {} [default: all]", ModelId::names())
}

/// Parses model names, in the given order; `all` or an empty list means every model. `option` is the place in errors.
///
/// # Errors
/// [`Error::Usage`] for an unknown or repeated model.
pub(super) fn models<'a>(list: impl IntoIterator<Item = &'a str>, option: &'static str) -> Result<Vec<ModelId>> {
    let mut named: Vec<(ModelId, &str)> = Vec::new();
    for text in list.into_iter().map(str::trim) {
        match ModelId::parse(text) {
            Some(model) => named.push((model, text)),
            None if text == "all" => named.extend(ModelId::ALL.map(|model| (model, text))),
            None => {
                let names = ModelId::ALL.map(ModelId::name);
                return Err(Error::unknown(Place::option(option), "driver model", text, names, ", all"));
            }
        }
    }
    refuse_repeats(|| Place::option(option), named.iter().copied())?;
    Ok(if named.is_empty() { ModelId::ALL.to_vec() } else { named.into_iter().map(|(model, _)| model).collect() })
}

/// Parses the headways of `--thw`, s.
///
/// # Errors
/// [`Error::Usage`] for a value that is not above 0, or a repeated value.
pub(super) fn headways(list: &[String]) -> Result<Vec<Headway>> {
    if let [one] = list
        && one.trim() == "paper"
    {
        return Ok(Headway::paper());
    }
    let parse = |text: &String| {
        let text = text.trim();
        if Headway::parse(text) == Some(Headway::MinFollowing) {
            return Ok(Headway::MinFollowing);
        }
        let number = text.strip_suffix('s').unwrap_or(text).trim_end().parse::<f64>().ok();
        let value = number.filter(|v| *v > 0.0 && *v < 1e4);
        if let Some(value) = value.filter(|value| !Quantity::Headway.is_plausible(*value)) {
            tracing::warn!("{}: {} (used as it is)", option("thw"), Quantity::Headway.describe(value));
        }
        value.map(Headway::thw).ok_or_else(|| {
            let problem = format!("`{text}` is not a time headway");
            let near = nearest(text, ["r157", "paper", "observed"], 0.6).filter(|_| !text.starts_with('-'));
            let near = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
            let help = "give seconds above 0 with commas, `r157`, `paper` or `observed`";
            Error::usage(Place::option("thw"), problem, near + help)
        })
    };
    if list.iter().any(|text| Headway::parse(text.trim()) == Some(Headway::Observed)) {
        let problem =
            "`observed` starts each scenario from its recorded gap and cannot be combined with other headways";
        return Err(Error::usage(Place::option("thw"), problem, "give `observed`, or a list of headways without it"));
    }
    let found = list.iter().map(parse).collect::<Result<Vec<_>>>()?;
    let meanings = found.iter().map(|headway| headway.identity());
    refuse_repeats(|| Place::option("thw"), meanings.zip(list.iter().map(|text| text.trim())))?;
    Ok(found)
}

/// Flags of every verb that can be split.
#[derive(Debug, Clone, Args)]
pub(super) struct ShardFlags {
    /// Compute shard I of N (from 0); `merge` merges them
    ///
    /// The part is written to --out. `auto/N` takes I from a Kubernetes Indexed Job or a Slurm array.
    #[arg(long, value_name = "I/N", help_heading = "Run")]
    pub shard: Option<Shard>,
    /// Run a plan that --plan-only wrote
    #[arg(long, value_name = "FILE", conflicts_with = "plan_only", help_heading = "Run")]
    pub plan: Option<PathBuf>,
    /// Write the plan, plan.json in --out, and stop
    #[arg(long, conflicts_with = "shard", help_heading = "Run")]
    pub plan_only: bool,
}

impl ShardFlags {
    /// Whether this is not a run in one piece.
    pub(super) fn is_split(&self) -> bool {
        self.plan_only || self.shard.is_some()
    }

    /// Checks the folder before the work: parts share it, a run in one piece has it alone.
    pub(super) fn check_folder(&self, out: &Path, record: &'static str) -> Result<()> {
        if self.is_split() { check_folder(out) } else { RunFolder::open(out, record).map(drop) }
    }
}
