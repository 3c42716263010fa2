//! A `map` run as one page.

use super::html::{Page, PageFigure, Section};
use super::map::MapReport;
use super::records::PROGRAM;
use crate::support::readable::count;

impl MapReport {
    /// Renders the run as one page.
    pub(super) fn html(&self, figures: Vec<PageFigure>) -> String {
        let shares = Section {
            intro: if self.grids.iter().any(|mapped| mapped.known_percent.iter().any(Option::is_some)) {
                "Known shares are those of the JRC's evidence.".to_owned()
            } else {
                String::new()
            },
            text: self.text(),
            ..Section::new("shares", "Shares")
        };
        let sheets = Section { figures, ..Section::new("maps", "Maps") };
        let hashes = self.grids.iter().flat_map(|mapped| {
            let parts = mapped.plan.parts.iter();
            parts.map(|part| {
                (format!("SHA-256 of the plan of {}", mapped.plan.grid.name()), part.plan.hash().to_owned())
            })
        });
        let mut host = vec![("computed by".to_owned(), self.host.backend.clone())];
        host.extend(self.host.device.iter().map(|device| ("device".to_owned(), device.line())));
        let reproduction = Section {
            intro: "The same grid and profile give the same cells, on any machine. map.json holds all of it."
                .to_owned(),
            facts: [("program".to_owned(), PROGRAM.to_owned()), ("profile".to_owned(), self.profile.name.clone())]
                .into_iter()
                .chain(hashes)
                .collect(),
            host,
            parts: vec![Section::options("Profile", &self.profile)],
            is_folded: true,
            ..Section::new("reproduction", "Reproduction")
        };
        let page = Page {
            title: "Outcomes over a grid".to_owned(),
            lead: format!(
                "{} simulations: {} over a grid of parameters, profile {}.",
                count(self.simulations()),
                self.criterion.label(),
                self.profile.name
            ),
            sections: vec![shares, sheets, reproduction],
            ..Page::default()
        };
        page.html()
    }
}
