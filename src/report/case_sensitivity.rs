//! Which driver decides: the verdict of a sheet by rule, reading and profile.

use super::case_sheet::CaseSheet;
use super::html::Section;
use super::tables::{WIDTH, wrap};
use lanesweep_run::check::{DriverRule, RuleVerdicts};
use lanesweep_support::table::Table;

/// What the columns of the rules show.
const RULES: &str = "The verdict if this driver alone decides; if any of the reference drivers suffices (in force); if all of them \
     have to avoid the collision. A row per profile with reference drivers, as it is and with each other reading where Annex 3 \
     is silent. *: differs from the answer of the sheet. Each verdict is robust or undecided as on the sheet";

impl CaseSheet<'_> {
    /// The rows of every profile.
    fn rules(&self) -> impl Iterator<Item = (&str, &RuleVerdicts)> {
        self.judgements.iter().flat_map(|of| of.by_rule.iter().map(move |rules| (of.profile.as_str(), rules)))
    }

    /// What each reference driver alone says, and the rule that is in force with its source.
    pub(super) fn rule(&self) -> Vec<String> {
        let Some(RuleVerdicts { verdicts, .. }) = self.first().by_rule.first() else { return Vec::new() };
        let alone = verdicts.iter().filter_map(|(rule, verdict)| match rule {
            DriverRule::Alone(model) => Some(format!("{}: {}", model.name(), verdict.label())),
            DriverRule::Any | DriverRule::All => None,
        });
        let alone = alone.collect::<Vec<_>>().join("; ");
        vec![format!(
            "If one driver alone decides: {alone}. In force: a collision is preventable where any reference driver avoids it. {}",
            DriverRule::SOURCE
        )]
    }

    /// A row per profile and reading, a column per rule.
    fn by_rule(&self) -> Table {
        let mut rules: Vec<DriverRule> = Vec::new();
        for (_, row) in self.rules() {
            rules.extend(
                row.verdicts.iter().map(|(rule, _)| rule).filter(|rule| !rules.contains(rule)).collect::<Vec<_>>(),
            );
        }
        // The drivers first; a profile may have others than the first one.
        rules.sort_by_key(|rule| !matches!(rule, DriverRule::Alone(_)));
        let in_force = self.first().verdict();
        let verdict = |row: &RuleVerdicts, rule: &DriverRule| {
            let (_, verdict) = row.verdicts.iter().find(|(of, _)| of == rule)?;
            Some(format!("{}{}", verdict.label(), if *verdict == in_force { "" } else { "*" }))
        };
        Table::of(self.rules().collect::<Vec<_>>())
            .column("profile", |(profile, _)| profile)
            .column("reading", |(_, row)| row.reading.unwrap_or("as it is"))
            .columns(&rules, |rule| rule.label(), |(_, row), rule| verdict(row, rule))
            .build()
    }

    /// The same as text; empty without reference drivers.
    pub(super) fn by_rule_text(&self) -> String {
        if self.rules().next().is_none() {
            return String::new();
        }
        format!("{}\n{}", wrap(&format!("\nWhich driver decides. {RULES}"), WIDTH), self.by_rule().text())
    }

    /// The same as a chapter.
    pub(super) fn by_rule_section(&self) -> Option<Section> {
        self.rules().next()?;
        let intro = self.rule().into_iter().map(|sentence| format!("{sentence}. ")).collect::<String>();
        let table = self.by_rule().captioned("Verdict by rule, reading and profile");
        Some(Section::new("rule", "Which driver decides").intro(format!("{intro}{RULES}.")).tables([table]))
    }

    /// The same with a row per profile, reading and rule.
    pub(super) fn rule_rows(&self) -> Table {
        let in_force = self.first().verdict();
        Table::of(self.rules().flat_map(|(profile, row)| row.verdicts.iter().map(move |of| (profile, row.reading, of))))
            .column("profile", |(profile, ..)| profile)
            .column("reading", |(_, reading, _)| reading)
            .column("rule", |(.., (rule, _))| rule.label())
            .column("verdict", |(.., (_, verdict))| verdict.label())
            .column("differs", |(.., (_, verdict))| *verdict != in_force)
            .build()
    }
}
