//! Annex 3 of UN R157 and a profile: the danger that the profile's CCHDM detects, the cases that the annex does not
//! describe, and our interpretations where the annex is silent. The last two exist only for a profile with the annex's
//! rules.

use std::borrow::Cow;

use super::subject::{Lane, Subject};
use crate::grid::Point;
use lanesweep_model::driver::{BelowTrigger, CutInBraking, ModelId, NEVER};
use lanesweep_model::profile::{CutOutTarget, Profile};
use lanesweep_model::scenario::{CaseQuantity, Category, SPEED_ERROR_MPS};
use lanesweep_support::Result;
use lanesweep_support::readable::value;

/// Returns the condition under which CCHDM detects a danger, in a few words.
pub(super) fn danger(profile: &Profile, category: Category) -> String {
    let cchdm = &profile.cchdm;
    let trigger_mps2 = cchdm.lead_deceleration_trigger_mps2;
    match category {
        Category::CutOut if cchdm.cut_out_headway_s > 0.0 => format!("headway ≤ {} s", value(cchdm.cut_out_headway_s)),
        Category::Lvd if trigger_mps2 > 0.0 => {
            let below = match cchdm.lvd_below_threshold {
                BelowTrigger::Never => "no reaction",
                BelowTrigger::DelayOnly => "the delay only",
                BelowTrigger::AtOnce => "at once",
            };
            format!("leader beyond {} m/s², else {below}", value(trigger_mps2))
        }
        category if cchdm.always_unsafe.contains(&category) => "brakes without a test".to_owned(),
        _ if cchdm.ttc_only_while_closing => format!("TTC ≤ {} s", value(cchdm.ttc_s)),
        _ => format!("|TTC| ≤ {} s, of an opening gap too", value(cchdm.ttc_s)),
    }
}

/// Returns why Annex 3 does not describe the case; `None` if it does. Only the initial speeds of an LVD and the headway
/// of a cut-out are checked.
pub(super) fn outside(profile: &Profile, category: Category, point: &Point) -> Option<String> {
    let cchdm = &profile.cchdm;
    let ego_mps = point.get(CaseQuantity::EgoSpeed)?;
    match category {
        Category::Lvd if cchdm.lead_deceleration_trigger_mps2 > 0.0 => {
            let lead_mps = point.get(CaseQuantity::OtherSpeed)?;
            // Equal up to the error of a speed; a thousandth more, for rounding.
            ((ego_mps - lead_mps).abs() > 1.001 * SPEED_ERROR_MPS).then(|| {
                let word = if ego_mps > lead_mps { "faster" } else { "slower" };
                format!(
                    "the ego is {word} than the leader at the start; the annex starts at equal speeds, and its driver \
                     reacts to a deceleration only"
                )
            })
        }
        Category::CutOut if cchdm.cut_out_headway_s > 0.0 => {
            let headway_s = cchdm.cut_out_headway_s;
            let (gap_m, thw_s) = (point.get(CaseQuantity::Gap), point.get(CaseQuantity::Thw));
            let gap_m = gap_m.or_else(|| thw_s.map(|thw_s| thw_s * ego_mps))?;
            (gap_m > headway_s * ego_mps + cchdm.cut_out_headway_tolerance_m + 1e-9).then(|| {
                format!(
                    "the headway of {} s is longer than the {} s at which the annex follows and its driver sees a danger \
                     (to the error of gap and speed)",
                    value(gap_m / ego_mps),
                    value(headway_s)
                )
            })
        }
        Category::CutIn | Category::CutOut | Category::Lvd => None,
    }
}

/// One of our interpretations where the annex is silent, and another one.
pub(super) struct Reading {
    /// Ours, as a sentence.
    pub sentence: String,
    /// The other one: the key of the profile with its value.
    pub instead: &'static str,
    /// The profile with the other one.
    pub profile: Profile,
    /// CCHDM tests the danger once, at the end of perception.
    pub tests_once: bool,
}

/// The profile as a driver reads it in a lane: if CCHDM tests once and sees no danger then, it never brakes.
pub(super) fn read_in<'p>(profile: &'p Profile, tests_once: bool, lane: &Lane, category: Category) -> Cow<'p, Profile> {
    let attends_from = lane.case.others[0].attend_from[ModelId::Cchdm.index()];
    if !tests_once || lane.run(profile, category, ModelId::Cchdm).outcome.reaction_step <= attends_from {
        return Cow::Borrowed(profile);
    }
    let mut never = profile.clone();
    never.cchdm.ttc_s = f64::from(f32::MIN_POSITIVE);
    Cow::Owned(never)
}

/// Returns our interpretations where the annex is silent on the case.
///
/// # Errors
/// As [`Subject::lane`].
pub(super) fn readings_where_silent(profile: &Profile, subject: &Subject) -> Result<Vec<Reading>> {
    let mut all = Vec::new();
    let (coasting_mps2, ttc_s) = (value(profile.cchdm.coasting_mps2), value(profile.cchdm.ttc_s));
    let mut other = |sentence: String, instead: &'static str, change: &dyn Fn(&mut Profile)| {
        let mut other = profile.clone();
        change(&mut other);
        if other != *profile {
            all.push(Reading { sentence, instead, profile: other, tests_once: false });
        }
    };
    // `wandering_m` is the lateral deviation that the annex regards as normal. A profile without it does not follow the
    // annex, so it has no interpretations of the annex.
    if profile.cchdm.wandering_m <= 0.0 {
        return Ok(all);
    }
    let coasts = format!("CCHDM coasts at {coasting_mps2} m/s² during its delay (the JRC's; the annex gives no value)");
    other(coasts, "cchdm.coasting_mps2 = 0", &|other| other.cchdm.coasting_mps2 = 0.0);
    match subject.category() {
        Category::CutIn => {
            let brakes = format!("CCHDM brakes until the speeds are equal, not only while TTC ≤ {ttc_s} s (ours)");
            let instead = "cchdm.cut_in_braking = while-unsafe";
            other(brakes, instead, &|other| other.cchdm.cut_in_braking = CutInBraking::WhileUnsafe);
            if profile.reg157.lane_intrusion_m > 0.0 {
                let tyre =
                    "the vehicle's box is the first to intrude into the lane, not a front tyre 0.1 m within it (ours)";
                let instead = "front tyre 0.1 m within the box";
                other(tyre.to_owned(), instead, &|other| other.reg157.lane_intrusion_m += 0.1);
            }
            let sentence =
                format!("CCHDM tests TTC ≤ {ttc_s} s until it holds, not once at the end of perception (ours)");
            all.push(Reading { sentence, instead: "CCHDM tests TTC once", profile: profile.clone(), tests_once: true });
        }
        // A driver that ignores a softer leader and perceives this one: the annex is not silent on it.
        Category::Lvd if exceeds_trigger(profile, subject)? => {}
        Category::Lvd => {
            for (below, instead) in [
                (BelowTrigger::Never, "cchdm.lvd_below_threshold = never"),
                (BelowTrigger::DelayOnly, "cchdm.lvd_below_threshold = delay-only"),
                (BelowTrigger::AtOnce, "cchdm.lvd_below_threshold = at-once"),
            ] {
                let reacts = "CCHDM reacts to a leader that never exceeds the trigger by `lvd_below_threshold` (ours)";
                other(reacts.to_owned(), instead, &|other| other.cchdm.lvd_below_threshold = below);
            }
        }
        Category::CutOut => {
            let nearer =
                "of two unsafe vehicles the nearer one sets the demand, not the larger demand (ours)".to_owned();
            let instead = "frame.cut_out_target = largest-demand";
            other(nearer, instead, &|other| other.frame.cut_out_target = CutOutTarget::LargestDemand);
        }
    }
    Ok(all)
}

/// Whether the leader decelerates beyond the trigger of CCHDM.
fn exceeds_trigger(profile: &Profile, subject: &Subject) -> Result<bool> {
    let mut profile = profile.clone();
    profile.cchdm.lvd_below_threshold = BelowTrigger::Never;
    let lane = subject.lane(&profile, subject.point())?;
    Ok(lane.case.others[0].attend_from[ModelId::Cchdm.index()] != NEVER)
}

/// Returns a sentence on a vehicle that cuts in and overlaps the ego's path at the start. The annex perceives a cut-in
/// by the deviation from the lane centre and does not say when this vehicle is perceived. We interpret: at once.
pub(super) fn attends_at_once(profile: &Profile, category: Category, lane: &Lane) -> Option<&'static str> {
    let other = &lane.case.others[0];
    let overlaps = other.motion.lateral(&lane.tables, 0).position.abs() <= other.half_widths;
    let applies = category == Category::CutIn && profile.cchdm.wandering_m > 0.0 && overlaps;
    applies.then_some("CCHDM attends at once to a vehicle that overlaps the ego's path at the start (ours)")
}
