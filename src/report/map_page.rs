//! A `map` run as one page.

use super::html::{Page, PageFigure, Section};
use super::map::MapReport;
use super::records::PROGRAM;
use crate::support::readable::count;

impl MapReport {
    /// Renders the run as one page.
    pub(super) fn html(&self, figures: Vec<PageFigure>) -> String {
        let is_known = self.grids.iter().any(|mapped| mapped.known_percent.iter().any(Option::is_some));
        let shares = Section::new("shares", "Shares")
            .intro(if is_known { "Known shares are those of the JRC's evidence." } else { "" })
            .text(self.text());
        let hashes = self.grids.iter().flat_map(|mapped| {
            let name = format!("SHA-256 of the plan of {}", mapped.plan.grid.name());
            mapped.plan.parts.iter().map(move |part| (name.clone(), part.plan.hash()))
        });
        let reproduction = Section::new("reproduction", "Reproduction")
            .intro("The same grid and profile give the same cells, on any machine. map.json holds all of it.")
            .fact("program", PROGRAM)
            .fact("profile", &self.profile.name)
            .facts(hashes)
            .host(self.host.facts())
            .parts([Section::options("Profile", &self.profile)])
            .folded();
        Page {
            title: "Outcomes over a grid".to_owned(),
            lead: format!(
                "{} simulations: {} over a grid of parameters, profile {}.",
                count(self.simulations()),
                self.criterion.label(),
                self.profile.name
            ),
            sections: vec![shares, Section::new("maps", "Maps").figures(figures), reproduction],
            ..Page::default()
        }
        .html()
    }
}
