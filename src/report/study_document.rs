//! A study as one JSON document: the tables that the terminal shows, for programs.

use serde_json::Value;

use super::csv;
use super::records::{document, records};
use super::study::StudyReport;
use crate::Result;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::score::{published_failures, published_lvd_f1};
use crate::scenario::Category;
use crate::scenario::parameterization::ParameterizationId;

impl StudyReport {
    /// The same tables as one JSON document, undefined values null; the published numbers where they were asked for.
    ///
    /// # Errors
    /// None for what this program made.
    pub fn json(&self) -> Result<String> {
        let mut value = serde_json::json!({
            "program": self.run.program,
            "data": self.run.data,
            "synthetic": self.run.synthetic,
            "plan_sha256": self.run.plan_sha256,
            "lanes": self.run.lanes,
            "left_out": self.run.left_out,
            "failures": records(&csv::failures(&self.scores, "")?)?,
            "f1": records(&csv::f1_scores(&self.scores, "")?)?,
            "claims": records(&csv::claims(&self.claims, "")?)?,
        });
        if self.published {
            value["published"] = published();
        }
        if let Some(comparison) = &self.comparison {
            value["reference"] = records(comparison.csv().as_bytes())?;
        }
        document(&value)
    }
}

/// The paper's numbers, of highD.
fn published() -> Value {
    let cells = || ModelId::ALL.into_iter().flat_map(|model| Criterion::ALL.into_iter().map(move |c| (model, c)));
    let failures = Category::ALL.into_iter().flat_map(|category| {
        cells().filter_map(move |(model, criterion)| {
            let theirs = published_failures(category, model, criterion)?;
            Some(serde_json::json!({
                "category": category.key(), "model": model.name(), "criterion": criterion.key(),
                "failures": theirs.failures, "simulations": theirs.simulations,
            }))
        })
    });
    let lvd = ParameterizationId::of(Category::Lvd);
    let f1 = lvd.flat_map(|id| {
        cells().filter_map(move |(model, criterion)| {
            let theirs = published_lvd_f1(&id.key, model, criterion)?;
            Some(serde_json::json!({
                "category": id.category.key(), "parameterization": id.key, "model": model.name(),
                "criterion": criterion.key(), "f1": theirs,
            }))
        })
    });
    serde_json::json!({"data": "highD", "failures": failures.collect::<Vec<_>>(), "f1": f1.collect::<Vec<_>>()})
}
