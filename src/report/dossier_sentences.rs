//! The sentences of a dossier. Each names its subject, because it may be quoted alone.

use super::dossier::{DossierReport, share};
use crate::engine::{CLOSE_HEADWAY_S, Headway};
use crate::run::justify::{Conclusion, Need, REGULATION, Share};
use crate::support::readable::{count, value};

/// A line to be filled in by hand.
const BLANK: &str = "______________________________";

impl DossierReport<'_> {
    /// The conclusion in one sentence.
    pub fn answer(&self) -> String {
        let dossier = self.dossier;
        format!(
            "Under profile {}, {} is {} for {} and {} on this data ({} scenarios, {} simulations of S from {})",
            self.profile.name,
            match dossier.parameterization.fitted_basis() {
                Some(_) => format!("{} ({})", dossier.parameterization.name(), dossier.parameterization.description()),
                None => dossier.parameterization.name(),
            },
            dossier.conclusion.text().to_uppercase(),
            dossier.model.name(),
            dossier.criterion.label(),
            count(dossier.scenarios),
            count(dossier.lanes),
            self.headways()
        )
    }

    /// The headways in words.
    fn headways(&self) -> String {
        match &self.dossier.headways[..] {
            list if Headway::is_observed(list) => "the recorded gaps".to_owned(),
            [one] => format!("the imposed headway {one}"),
            list => format!("{} imposed headways", list.len()),
        }
    }

    /// Recall under the profile, and under the regulation's profile for comparison.
    pub(super) fn recall(&self) -> String {
        let (profile, ours) = (&self.profile.name, self.recall_of(&self.dossier.scored.recall));
        match &self.dossier.regulation {
            None => format!("Recall is {ours} under {profile}, the profile of the regulation."),
            Some(scored) => format!(
                "Recall is {ours} under {profile}, and {} under {REGULATION}, the profile of the regulation. The conclusion is \
                 that of {profile}.",
                self.recall_of(&scored.recall)
            ),
        }
    }

    fn recall_of(&self, recall: &Share) -> String {
        match (recall.value, recall.interval) {
            (None, _) => "unknown (S never fails)".to_owned(),
            (Some(one), None) => format!("{one:.3} (too few failing scenarios for an interval)"),
            (Some(_), Some(_)) => share(recall),
        }
    }

    /// Number of failures from close following; empty if unknown or if S never fails.
    pub(super) fn close_following(&self) -> String {
        let Some(close) = &self.dossier.close_following else { return String::new() };
        let cell = close.failures.get(self.dossier.criterion.index());
        let Some([failures, all]) = cell.filter(|[_, all]| *all > 0) else { return String::new() };
        let whose = if Headway::is_observed(&self.dossier.headways) { "recorded" } else { "imposed" };
        format!(
            "{} of {} failures of S come from headways below {CLOSE_HEADWAY_S} s, which {} of {} {whose} simulations of S start from.",
            count(*failures),
            count(*all),
            count(close.close_lanes),
            count(close.lanes)
        )
    }

    /// How much more data would decide the undecided rules.
    pub(super) fn need(&self) -> Option<String> {
        if self.dossier.conclusion != Conclusion::Undecided {
            return None;
        }
        if self.dossier.scored.counts.tp + self.dossier.scored.counts.fn_ == 0 {
            return Some(
                "S never fails, so the data does not tell how many scenarios would decide: use more, or more severe ones."
                    .to_owned(),
            );
        }
        let times = self.dossier.findings.iter().filter_map(|finding| finding.need).map(|Need { times }| times);
        let times = times.fold(None, |max: Option<f64>, times| Some(max.map_or(times, |max| max.max(times))))?;
        let more = (times * self.dossier.scenarios as f64).ceil();
        Some(if times < 1000.0 {
            format!(
                "At least about {} scenarios ({} times as many) would decide, if the rates stay as they are: an interval narrows with \
                 the square root of their number.",
                count(more as u64),
                value(times)
            )
        } else {
            "The value lies on the limit: no realistic amount of data decides.".to_owned()
        })
    }

    /// Results of other simulators' tables for these lanes.
    pub(super) fn conformance_words(&self) -> String {
        let (category, profile) = (self.dossier.parameterization.category.label(), &self.profile.name);
        let own = "`lanesweep verify conformance` takes tables of your own.";
        if self.conformance.is_empty() {
            return format!(
                "No table of another simulator for {category} under {profile} ships with the program: nothing outside this \
                 program was compared with these lanes. {own}"
            );
        }
        format!(
            "Tables of the JRC's public simulator for {category} under {profile} that ship with the program, and its functions, \
             computed in this run. {own}"
        )
    }

    /// Purposes that the conclusion does not support.
    pub(super) fn limits(&self) -> Vec<(String, String)> {
        let model = self.dossier.model.name();
        let headways = if Headway::is_observed(&self.dossier.headways) {
            "each scenario starts from its recorded gap; other traffic has others".to_owned()
        } else {
            format!("{}: rates and scores are those of these headways, not of traffic", self.headways())
        };
        let limit = |name: &str, words: String| (name.to_owned(), words);
        vec![
            limit("data", format!("these {} scenarios; no other road, country or year", count(self.dossier.scenarios))),
            limit("headways", headways),
            limit(
                "profile",
                format!(
                    "the constants of {}; under another profile, model or criterion the conclusion can be another",
                    self.profile.name
                ),
            ),
            limit(
                "system",
                format!("{model} is a reference driver: nothing here is measured on the system to be assessed"),
            ),
            limit("other vehicles", "they move as recorded or drawn and do not react to the ego".to_owned()),
            limit(
                "intervals",
                "over scenarios: they hold neither the choice of recordings nor errors of mining, profile or model"
                    .to_owned(),
            ),
        ]
    }

    /// Signatory and date, given or blank.
    pub(super) fn signature(&self) -> Vec<(String, String)> {
        let or_blank = |text: &Option<String>| text.clone().unwrap_or_else(|| BLANK.to_owned());
        let line = |name: &str, text: String| (name.to_owned(), text);
        vec![
            line("author", or_blank(&self.author)),
            line("date", or_blank(&self.date)),
            line("signature", BLANK.to_owned()),
        ]
    }
}
