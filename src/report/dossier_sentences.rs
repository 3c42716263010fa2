//! The sentences of a dossier. Each names its subject, because it may be quoted alone.

use super::dossier::{DossierReport, share};
use crate::engine::{CLOSE_HEADWAY_S, Headway};
use crate::run::justify::{Conclusion, LIMITS, Need, REGULATION, Share};
use crate::support::readable::{count, value};
use crate::support::table::{NumberText, Table};

/// A line to be filled in by hand.
const BLANK: &str = "______________________________";

impl DossierReport<'_> {
    /// The conclusion in one sentence.
    pub(super) fn answer(&self) -> String {
        let dossier = self.dossier;
        format!(
            "Under profile {}, {} is {} for {} and {} on this data ({} of {} found scenarios, {} simulations of S from {})",
            self.profile.name,
            match dossier.parameterization.fitted_basis() {
                Some(_) => format!("{} ({})", dossier.parameterization.name(), dossier.parameterization.description()),
                None => dossier.parameterization.name(),
            },
            dossier.conclusion.text().to_uppercase(),
            dossier.model.name(),
            dossier.criterion.label(),
            count(dossier.scenarios),
            count(dossier.found),
            count(dossier.lanes),
            self.headways()
        )
    }

    /// The rules in words, beside their findings.
    pub(super) fn rule(&self) -> String {
        format!(
            "A rule passes where the whole interval lies within its limits, and fails where the whole interval lies outside. Where \
             the interval contains a limit, neither is shown: undecided. So are recall and precision with fewer than {} failing \
             scenarios. Coverage is a count without an interval. One rule that fails makes the parameterization not appropriate; \
             all have to pass for appropriate.",
            self.options.score.min_failures
        )
    }

    /// Every limit: key, value, who set it, reason of the default.
    fn limits_set(&self) -> impl Iterator<Item = (&'static str, String, &str, &'static str)> {
        let of = |(key, reason)| (self.host.settings.iter().find(|setting| setting.key == key), key, reason);
        LIMITS.into_iter().map(of).filter_map(|(setting, key, reason)| {
            let setting = setting?;
            Some((key, setting.value.to_string(), setting.source.as_str(), reason))
        })
    }

    /// Whose the limits are, and what they are.
    pub(super) fn limits_of_rules(&self) -> String {
        let all: Vec<String> =
            self.limits_set().map(|(key, value, source, _)| format!("{key} = {value} ({source})")).collect();
        format!(
            "The limits are the user's; a default is a convention of this program, not of a standard: {}.",
            all.join(", ")
        )
    }

    /// The limits with the reasons of their defaults.
    pub(super) fn limits_table(&self) -> Table {
        let limits: Vec<_> = self.limits_set().collect();
        let table = Table::of(&limits)
            .column("key", |row| row.0)
            .column("set by", |row| row.2)
            .column("reason of the default", |row| row.3)
            .column("limit", |row| NumberText(row.1.clone()));
        table.build().captioned("Limits of appropriate")
    }

    /// Coverage of the kept and of the found scenarios; empty if there is no density.
    pub(super) fn coverage(&self) -> String {
        let Some(coverage) = &self.dossier.coverage else { return String::new() };
        let Some((of_kept, of_found)) = coverage.of_kept().zip(coverage.of_found()) else { return String::new() };
        let filters = match coverage.found - coverage.kept {
            0 => String::new(),
            1 => " The filters of mining left out one, about which nothing is said here.".to_owned(),
            dropped => format!(" The filters of mining left out {}, about which nothing is said here.", count(dropped)),
        };
        format!(
            "{} of {} kept scenarios are points of the parameter space (coverage {}), which is {} of the {} found ones.{filters}",
            count(coverage.points),
            count(coverage.kept),
            value(of_kept),
            value(of_found),
            count(coverage.found)
        )
    }

    /// Why some of the first hidden failures have no TTC; empty if all have one.
    pub(super) fn beside(&self, max_rows: usize) -> String {
        let mut shown = self.dossier.hidden.iter().take(max_rows);
        match shown.any(|of| of.recorded.approach_ttc().is_none() || of.parameterized.approach_ttc().is_none()) {
            true => "TTC –: the vehicles met beside each other, without an approach along one path.".to_owned(),
            false => String::new(),
        }
    }

    /// The headways in words.
    fn headways(&self) -> String {
        match &self.dossier.headways[..] {
            list if Headway::is_observed(list) => "the recorded gaps".to_owned(),
            [one] => format!("the imposed headway {one}"),
            list => format!("{} imposed headways", list.len()),
        }
    }

    /// Recall under the profile, and under the reading of the regulation for comparison.
    pub(super) fn recall(&self) -> String {
        let (profile, ours) = (&self.profile.name, self.recall_of(&self.dossier.scored.recall));
        match &self.dossier.regulation {
            None => format!("Recall is {ours} under {profile}, a reading of UN R157."),
            Some(scored) => format!(
                "Recall is {ours} under {profile}, and {} under {REGULATION}, a reading of UN R157. The conclusion is that of \
                 {profile}.",
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
                "At least about {} kept scenarios ({} times as many) would decide, if the rates stay as they are: an interval narrows with \
                 the square root of their number.",
                count(more as u64),
                value(times)
            )
        } else {
            "The value lies on the limit: no realistic amount of data decides.".to_owned()
        })
    }

    /// Purposes that the conclusion does not support.
    pub(super) fn limits(&self) -> [(&'static str, String); 4] {
        let headways = if Headway::is_observed(&self.dossier.headways) {
            "each scenario starts from its recorded gap; other traffic has others".to_owned()
        } else {
            format!("{}: rates and scores are those of these headways, not of traffic", self.headways())
        };
        let profile = &self.profile.name;
        let (scenarios, found) = (count(self.dossier.scenarios), count(self.dossier.found));
        let data = format!("these {scenarios} scenarios of {found} found; no other road, country or year");
        let profile = format!(
            "the constants of {profile}; under another profile, model or criterion the conclusion can be another"
        );
        let intervals =
            "over scenarios: they hold neither the choice of recordings nor errors of mining, profile or model";
        [("data", data), ("headways", headways), ("profile", profile), ("intervals", intervals.to_owned())]
    }

    /// Signatory and date, given or blank.
    pub(super) fn signature(&self) -> [(&'static str, &str); 3] {
        let (author, date) = (self.author.as_deref(), self.date.as_deref());
        [("author", author.unwrap_or(BLANK)), ("date", date.unwrap_or(BLANK)), ("signature", BLANK)]
    }
}
