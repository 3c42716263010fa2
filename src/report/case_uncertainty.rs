//! Uncertain inputs on a sheet: how often each answer is, which input matters most, and how many errors the case is away
//! from another answer.

use serde_json::{Value, json};

use super::case_sheet::{CaseSheet, nearest, signed};
use super::html::Section;
use super::tables::{WIDTH, wrap};
use crate::model::driver::ModelId;
use crate::run::check::{Answer, UNCERTAIN_LEVEL, UncertainInput, Uncertainty, Verdict};
use crate::scenario::KMH;
use crate::stats::estimate::{FirstOrder, Interval, clopper_pearson};
use crate::support::readable::{count, counted, value};
use crate::support::table::{NumberText, Table};

/// What the columns of the inputs show.
const INPUTS: &str = "Index: the fraction of the variance of the answer (1 where a draw has the answer of the case without errors, \
     else 0) that the error of this input alone explains; the inputs together explain the rest. –: too few draws have another \
     answer. Away: from the value to the nearest one at which the verdict changes, all else equal, in units of the error. –: no \
     change found, or not searched";

/// How many of some draws.
struct Fraction {
    name: &'static str,
    draws: u64,
    of: u64,
}

impl Fraction {
    fn interval(&self) -> Interval {
        clopper_pearson(self.draws, self.of, UNCERTAIN_LEVEL)
    }

    /// The fraction in per cent; `None` of no draws.
    fn percent(&self) -> Option<f64> {
        (self.of > 0).then(|| 100.0 * self.draws as f64 / self.of as f64)
    }

    fn record(&self) -> Value {
        let Interval { low, high, .. } = self.interval();
        let fraction = self.percent().map(|percent| percent / 100.0);
        json!({"name": self.name, "draws": self.draws, "of": self.of, "fraction": fraction, "low": low, "high": high})
    }
}

/// Each answer, of the draws that are a case.
fn answers(of: &Uncertainty) -> Vec<Fraction> {
    // The sheet's word is also that of an answer that is not robust, which a draw has not.
    let name = |answer: &Answer| if *answer == Answer::Open { "open" } else { answer.label() };
    let fraction = |(answer, draws): (&Answer, u64)| Fraction { name: name(answer), draws, of: of.valid() };
    let outside = Fraction { name: "conflict or open, outside Annex 3", draws: of.outside_annex, of: of.valid() };
    let outside = (of.outside_annex > 0).then_some(outside);
    Answer::ALL.iter().zip(of.answers).map(fraction).chain(outside).collect()
}

/// Each driver that avoids the collision, of the draws with a conflict.
fn drivers(of: &Uncertainty) -> Vec<Fraction> {
    let fraction = |(model, draws): (&ModelId, u64)| Fraction { name: model.name(), draws, of: of.conflicts() };
    ModelId::ALL.iter().zip(of.avoids).map(fraction).collect()
}

fn fractions(rows: &[Fraction], name: &'static str, of: &'static str) -> Table {
    let interval = |of: &Fraction| {
        let Interval { low, high, .. } = of.interval();
        NumberText(format!("{:.3} … {:.3}", 100.0 * low, 100.0 * high))
    };
    Table::of(rows)
        .column(name, |of| of.name)
        .column("draws", |of| of.draws)
        .column(of, |of| of.of)
        .column("%", |of| of.percent().map(|percent| NumberText(format!("{percent:.3}"))))
        .column("95 % interval, %", interval)
        .build()
}

/// A value in the unit of the reader.
fn shown(input: &UncertainInput, si: f64) -> String {
    let number = input.quantity.number();
    let (shown, unit) = if number.needs_unit() { (si * KMH, "km/h") } else { (si, number.unit()) };
    format!("{} {unit}", value(shown))
}

/// The error as it is drawn.
fn error(input: &UncertainInput) -> String {
    format!("{}{}", if input.is_bound { "± " } else { "" }, shown(input, input.error))
}

impl CaseSheet<'_> {
    /// How many errors the nearest other answer is away along an input.
    fn errors_away(&self, input: &UncertainInput) -> Option<f64> {
        let boundary = self.first().boundaries.iter().find(|of| of.parameter.quantity == input.quantity)?;
        let at = nearest(&boundary.answer, boundary.value)?;
        Some(boundary.parameter.si(at - boundary.value) / input.error)
    }

    fn inputs(&self, of: &Uncertainty) -> Table {
        let rows = of.uncertain.inputs.iter().zip(&of.indices);
        Table::of(rows)
            .column("input", |(input, _)| input.quantity.number().label)
            .column("value", |(input, _)| self.subject.point().get(input.quantity).map(|si| shown(input, si)))
            .column("error", |(input, _)| error(input))
            .column("index", |(_, found)| found.map_or("–".to_owned(), |of| format!("{:.3}", of.index)))
            .column("95 % interval", |(_, found)| {
                found.map_or("–".to_owned(), |of| format!("{:.3} … {:.3}", of.low, of.high))
            })
            .column("away", |(input, _)| self.errors_away(input).map_or("–".to_owned(), signed))
            .build()
    }

    /// What was drawn, what was left out, and which input matters most.
    fn of_draws(&self, of: &Uncertainty) -> Vec<String> {
        let uncertain = &of.uncertain;
        let mut all = vec![format!(
            "{} under {} (seed {}): the inputs below have errors that are independent of one another, normal with the \
             standard error of the table, or uniform where it has ±. Fractions are of these draws; their intervals cover the \
             number of draws, not the assumed errors. Each draw counts as computed: a stop that touches counts as avoided",
            counted(uncertain.draws as usize, "draw"),
            self.first().profile,
            uncertain.seed
        )];
        if self.first().verdict() == Verdict::Undecided {
            all.push("The answer of the case is undecided, and no fraction decides it".to_owned());
        }
        let invalid =
            of.invalid.iter().map(|(reason, draws)| format!("{} ({reason})", counted(*draws as usize, "draw")));
        let invalid: Vec<String> = invalid.collect();
        if !invalid.is_empty() {
            all.push(format!("No case, and in no fraction: {}, by what has no possible value", invalid.join(", ")));
        }
        if of.outside_annex > 0 {
            all.push(
                "Annex 3 does not describe the draws of the last row; the rows above count them by the answer computed"
                    .to_owned(),
            );
        }
        let mut found: Vec<_> =
            uncertain.inputs.iter().zip(&of.indices).filter_map(|(of, index)| Some((of, (*index)?))).collect();
        found.sort_by(|(_, a), (_, b)| b.index.total_cmp(&a.index));
        let name = |input: &UncertainInput| format!("the {}", input.quantity.number().label.to_lowercase());
        if let Some((first, top)) = found.first() {
            let near =
                found[1..].iter().filter(|(_, of)| of.high >= top.low).map(|(of, _)| name(of)).collect::<Vec<_>>();
            let apart = match &near[..] {
                [] => String::new(),
                near => format!("; its interval does not tell it from {}", near.join(" and ")),
            };
            all.push(format!(
                "The input whose error matters most is {}: index {:.3} [{:.3}, {:.3}] ({} pairs of draws per input){apart}",
                name(first),
                top.index,
                top.low,
                top.high,
                count(of.pairs)
            ));
        }
        all
    }

    /// As text; empty without uncertain inputs.
    pub(super) fn uncertainty_text(&self) -> String {
        let Some(of) = self.uncertainty else { return String::new() };
        let sentences = self.of_draws(of).join(". ");
        format!(
            "{}\n{}{}{}\n{}",
            wrap(&format!("\nUncertain inputs. {sentences}."), WIDTH),
            fractions(&answers(of), "answer", "of valid draws").text(),
            fractions(&drivers(of), "avoids", "of draws with a conflict").text(),
            wrap(INPUTS, WIDTH),
            self.inputs(of).text()
        )
    }

    /// As a chapter.
    pub(super) fn uncertainty_section(&self, of: &Uncertainty) -> Section {
        Section::new("uncertain", "Uncertain inputs")
            .intro(format!("{}. {INPUTS}.", self.of_draws(of).join(". ")))
            .tables([
                fractions(&answers(of), "answer", "of valid draws").captioned("Draws by answer"),
                fractions(&drivers(of), "avoids", "of draws with a conflict")
                    .captioned("Draws in which a driver avoids the collision"),
                self.inputs(of).captioned("Inputs"),
            ])
    }

    /// As a record; errors and distances in SI units and in errors.
    pub(super) fn uncertainty_record(&self, of: &Uncertainty) -> Value {
        let input = |(input, found): (&UncertainInput, &Option<FirstOrder>)| {
            json!({
                "input": input.quantity.number().key,
                "value": self.subject.point().get(input.quantity),
                "error": input.error,
                "distribution": if input.is_bound { "uniform" } else { "normal" },
                "first_order": found.map(|of| json!({"index": of.index, "low": of.low, "high": of.high})),
                "errors_away": self.errors_away(input),
            })
        };
        let invalid = of.invalid.iter().map(|(reason, draws)| json!({"reason": reason, "draws": draws}));
        json!({
            "profile": self.first().profile,
            "draws": of.uncertain.draws,
            "seed": of.uncertain.seed,
            "level": UNCERTAIN_LEVEL,
            "valid": of.valid(),
            "invalid": invalid.collect::<Vec<_>>(),
            "outside_annex_3": of.outside_annex,
            "answers": answers(of).iter().map(Fraction::record).collect::<Vec<_>>(),
            "avoids": drivers(of).iter().map(Fraction::record).collect::<Vec<_>>(),
            "pairs": of.pairs,
            "inputs": of.uncertain.inputs.iter().zip(&of.indices).map(input).collect::<Vec<_>>(),
        })
    }
}
