//! The explorer: the part of a map's page that computes further maps where it is read, with the program's own shaders, and
//! shows those of the run where it cannot.

use serde_json::{Value, json};

use super::html::App;
use super::map::MapReport;
use super::map_sheet::{BOUNDARY, colour};
use super::plot::Look;
use super::records::sorted;
use lanesweep_engine::LaneCase;
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_run::explorer::explorer;
use lanesweep_run::grid::{CellOutcome, MappedGrid};
use lanesweep_support::Result;

/// Maps with more text than this stay in cells.csv, so that the page stays below half a megabyte.
const MAX_MAPS_BYTES: usize = 170_000;

const SCRIPT: [&str; 6] = [
    include_str!("templates/explorer/state.js"),
    include_str!("templates/explorer/gpu.js"),
    include_str!("templates/explorer/maps.js"),
    include_str!("templates/explorer/picture.js"),
    include_str!("templates/explorer/case.js"),
    include_str!("templates/explorer/main.js"),
];

impl MapReport {
    /// The explorer of a run: its profile first, then the others that the program has.
    pub(super) fn explorer(&self) -> Result<App> {
        let mut profiles = vec![self.profile.clone()];
        for name in Profile::names().filter(|name| *name != self.profile.name) {
            profiles.push(Profile::load(name)?);
        }
        let fixed = self.grids.first().map(|mapped| mapped.plan.grid.fixed.clone()).unwrap_or_default();
        let mut data = explorer(&profiles, &fixed)?;
        let colour_of = |at| Look::of(at, ModelId::ALL.len()).colour;
        for (at, driver) in data["drivers"].as_array_mut().into_iter().flatten().enumerate() {
            driver["colour"] = json!(colour_of(at));
        }
        let outcome =
            |of: &CellOutcome| json!({ "key": format!("{of:?}"), "label": of.label(), "colour": colour(*of) });
        let criterion = |of: &Criterion| json!({ "key": of.key(), "label": of.label(), "bit": of.index() });
        data["outcomes"] = CellOutcome::ALL.iter().map(outcome).collect();
        data["criteria"] = Criterion::ALL.iter().map(criterion).collect();
        data["criterion"] = json!(self.criterion.key());
        let category = |mapped: &MappedGrid| mapped.plan.grid.category.label().to_ascii_lowercase();
        data["category"] = json!(self.grids.first().map(category));
        data["boundary"] = json!(BOUNDARY);
        data["caseWords"] = json!(size_of::<LaneCase<f32>>() / 4);
        // What the constants of lanes that keep their steps have else.
        data["traced"] = json!({ "frame_values": 1, "frame_skip": 0 });
        let shown = self.shown_outcomes();
        let grid = |mapped: &MappedGrid| {
            let mut grid = sorted(&self.grid_record(mapped, &shown));
            grid["models"] = mapped.map.models.iter().map(|model| model.name()).collect();
            grid["outcomes"] = outcomes(mapped);
            grid
        };
        let grids: Vec<Value> = self.grids.iter().map(grid).collect();
        let is_short = grids.iter().map(|grid| grid.to_string().len()).sum::<usize>() <= MAX_MAPS_BYTES;
        data["grids"] = json!(if is_short { grids } else { Vec::new() });
        Ok(App {
            markup: include_str!("templates/explorer/page.html"),
            style: include_str!("templates/explorer/style.css"),
            script: format!("{{\n{}}}", SCRIPT.concat()),
            // No text of the data ends its element.
            data: data.to_string().replace("</", "<\\/").replace("<!", "<\\u0021"),
        })
    }
}

/// The outcomes of every cell: by criterion and model, in run lengths.
fn outcomes(MappedGrid { map, .. }: &MappedGrid) -> Value {
    let of = |criterion: Criterion| -> Vec<String> {
        let of = |model| run_lengths((0..map.cell_count()).map(|cell| map.outcome(model, cell, criterion) as u8));
        (0..map.models.len()).map(of).collect()
    };
    Value::from_iter(Criterion::ALL.map(|criterion| (criterion.key(), of(criterion))))
}

/// Letters from `a` on, each after its count if that is not 1.
fn run_lengths(codes: impl Iterator<Item = u8>) -> String {
    let codes: Vec<u8> = codes.collect();
    let run = |run: &[u8]| {
        let letter = char::from(b'a' + run[0]);
        if run.len() == 1 { letter.to_string() } else { format!("{}{letter}", run.len()) }
    };
    codes.chunk_by(|a, b| a == b).map(run).collect()
}
