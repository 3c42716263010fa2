//! The flags of uncertain inputs of one case.

use clap::Args;

use super::arguments::from_arguments;
use crate::run::check::{Subject, UNCERTAIN_DRAWS, Uncertain, UncertainInput};
use crate::scenario::{NamedNumber, Written};
use crate::{Error, Place, Result};

/// The list that has every input.
const ALL: &str = "all";
/// Maximum number of draws: some hours.
const MAX_DRAWS: u64 = 1_000_000_000;

#[derive(Debug, Args)]
pub(super) struct UncertainFlags {
    /// Draw errors of these inputs, else of all, and count the answers
    ///
    /// LIST is `gap=0.5m,ego_speed=1km/h`: independent normal errors with these standard errors. A name alone has its usual
    /// error, `gap=+-0.5m` is uniform in ± 0.5 m. Without a LIST, or with `all`, every input has its usual error. FILE stands before it.
    #[arg(long, value_name = "LIST", num_args = 0..=1, default_missing_value = ALL, value_delimiter = ',', help_heading = "Scenario")]
    uncertain: Vec<String>,
    /// With --uncertain: number of draws
    #[arg(long, value_name = "N", default_value_t = UNCERTAIN_DRAWS, value_parser = super::arguments::whole::<u64>, help_heading = "Scenario", hide_short_help = true)]
    draws: u64,
    /// With --uncertain: seed of the draws
    #[arg(long, value_name = "N", default_value_t = 157, help_heading = "Scenario", hide_short_help = true)]
    seed: u64,
}

from_arguments!(UncertainFlags { uncertain, draws, seed });

impl UncertainFlags {
    pub(super) fn is_given(&self) -> bool {
        !self.uncertain.is_empty()
    }

    /// The errors of a case's inputs; `None` without the flag.
    ///
    /// # Errors
    /// [`Error::Usage`] for a name that is no input of the case, a repeated one, a value that is no error, and a number of
    /// draws out of range.
    pub(super) fn of(&self, subject: &Subject) -> Result<Option<Uncertain>> {
        if !self.is_given() {
            return Ok(None);
        }
        if !(1..=MAX_DRAWS).contains(&self.draws) {
            let problem = format!("{} is out of range", self.draws);
            return Err(Error::usage(Place::option("draws"), problem, format!("give 1 to {MAX_DRAWS}")));
        }
        let inputs = match &self.uncertain[..] {
            [all] if all == ALL => UncertainInput::all(subject),
            list => list.iter().map(|text| input(text.trim(), subject)).collect::<Result<Vec<_>>>()?,
        };
        if let Some(at) =
            (1..inputs.len()).find(|at| inputs[..*at].iter().any(|of| of.quantity == inputs[*at].quantity))
        {
            let problem = format!("`{}` stands twice", inputs[at].quantity.number().key);
            return Err(refused(problem, "keep one of them"));
        }
        Ok(Some(Uncertain { inputs, draws: self.draws, seed: self.seed }))
    }
}

fn refused(problem: String, help: impl Into<String>) -> Error {
    Error::usage(Place::option("uncertain"), problem, help)
}

/// An input as it is written: `gap`, `gap=0.5m` or `gap=+-0.5m`.
fn input(text: &str, subject: &Subject) -> Result<UncertainInput> {
    let (name, error) = text.split_once('=').map_or((text, None), |(name, error)| (name.trim(), Some(error.trim())));
    let found = NamedNumber::find(name)?;
    let Some(number) = found.filter(|of| subject.point().get(of.number().quantity).is_some()) else {
        let inputs: Vec<&str> = UncertainInput::all(subject).iter().map(|of| of.quantity.number().key).collect();
        let help = format!("its inputs are {}; FILE stands before the option", inputs.join(", "));
        return Err(refused(format!("the case has no input `{name}`"), help));
    };
    let quantity = number.number().quantity;
    let Some(error) = error else {
        let usual = UncertainInput::usual(subject, quantity);
        return usual.ok_or_else(|| refused(format!("`{name}` has no usual error"), format!("give one: {name}=…")));
    };
    let bound = ["+-", "±"].iter().find_map(|sign| error.strip_prefix(sign));
    let si = number.si(Written::Text(bound.unwrap_or(error)))?;
    if si <= 0.0 {
        return Err(refused(format!("the error of `{name}` is {si}"), "give an error above 0"));
    }
    Ok(UncertainInput { quantity, error: si, is_bound: bound.is_some() })
}
