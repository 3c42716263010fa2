//! The JRC's function table: surrogates, distances and thresholds as plain values.

use super::table::Table;
use super::tally::Tally;
use crate::model::driver::DriverProfile;
use crate::model::profile::Profile;
use crate::run::grid::jrc_case::{NATIVE_THW_S, native_distance_fsm, native_distance_rss};
use crate::scenario::Category;
use crate::{Error, Result};

/// Compares every row of a function table with the profile's own functions; one tally per function.
pub fn compare_functions(table: &Table, profile: &Profile) -> Result<Vec<Tally>> {
    let dt = profile.frame.dt_s;
    let fsm = profile.fsm.resolve::<f64>(dt, Category::CutIn);
    let rss = profile.rss.resolve::<f64>(dt, Category::CutIn);
    let reg157 = profile.reg157.resolve::<f64>(dt, Category::CutIn);
    let mut tallies: Vec<Tally> = Vec::new();
    for row in table.rows() {
        let name = row.text("fn")?;
        let v_ego = row.number("v_ego")?;
        let ours = match name {
            "PFS" => fsm.pfs(v_ego, row.number("v_lead")?, row.number("gap")?),
            "CFS" => fsm.cfs(v_ego, row.number("v_lead")?, row.number("gap")?, row.number("a_ego")?),
            "RSS_dlon" => rss.longitudinal_distance(v_ego, row.number("v_lead")?),
            "RSS_dlat" => rss.lateral_distance(v_ego),
            "Reg157_ttc_thr_JRC" => reg157.ttc_threshold(v_ego - row.number("v_lead")?),
            "init_dist_FSM" => native_distance_fsm(profile, v_ego),
            "init_dist_RSS" => native_distance_rss(profile, v_ego),
            "init_dist_CC" => NATIVE_THW_S * v_ego,
            other => {
                return Err(Error::input(
                    row.place("fn"),
                    format!("there is no function `{other}`"),
                    "known: PFS, CFS, RSS_dlon, RSS_dlat, Reg157_ttc_thr_JRC, init_dist_FSM, init_dist_RSS, \
                     init_dist_CC",
                ));
            }
        };
        let theirs = row.number("value")?;
        let at = match tallies.iter().position(|t| t.label == name) {
            Some(at) => at,
            None => {
                tallies.push(Tally::new(name, None));
                tallies.len() - 1
            }
        };
        let tally = &mut tallies[at];
        tally.rows += 1;
        tally.robust += 1;
        tally.labels_equal += 1;
        tally.types_equal += 1;
        tally.value("value", true, Some(ours), Some(theirs), &|| row.place("value").to_string());
    }
    Ok(tallies)
}
