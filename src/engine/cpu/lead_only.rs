//! Lanes with two vehicles ahead of which only the farther one, the lead, still matters.
//!
//! A vehicle that cuts out may reach a position beside the lane where no contact, criterion or reaction is possible,
//! and stay there. The lane then continues with the other vehicle only. Verdict-only batches make these steps together
//! with single-vehicle lanes, at half the cost.

use lanesweep_model::driver::DriverModel;
use lanesweep_model::scalar::Flag;

use crate::cpu::ROWS;
use crate::cpu::batch_arrays::{NEVER_LEAVES, Track, VehicleTracks};
use crate::cpu::fast_forward::is_out_of_the_way;
use crate::frame::Simulation;
use crate::lane_step::{LaneConstants, OtherState};

/// The first step from which only the second vehicle matters under this model, and the driver attends to it.
/// [`NEVER_LEAVES`] if there is none, or if the second vehicle may leave or is not evaluated. `tracks` index `entries`.
pub(crate) fn lead_only_from<M: DriverModel<f32>>(
    simulation: &Simulation<f32, M>,
    lane: &LaneConstants<f32>,
    tracks: &[VehicleTracks; 2],
    entries: &[f32],
) -> u32 {
    let [principal, second] = &lane.others;
    if second.present_until < Flag::LATEST_STEP || !second.judged.holds() {
        return NEVER_LEAVES;
    }
    let [_, position, towards] = tracks[0];
    // Up to `count` entries from a step on; the last entry is repeated.
    let at = |track: Track, step: u32, count: usize| {
        let from = (track.first + step.min(track.last)) as usize;
        &entries[from..from + count]
    };
    // Whether the vehicle is beside the lane at all these steps. Without a branch, so that the compiler vectorizes it.
    let is_out = |step: u32, count: usize| {
        let mut is_out = Flag::TRUE;
        for (&position, &towards) in at(position, step, count).iter().zip(at(towards, step, count)) {
            let place = OtherState { speed: 0.0, position, towards };
            is_out = is_out & is_out_of_the_way(simulation, lane, principal, &place);
        }
        is_out.holds()
    };
    let gone_from = if principal.present_from == Flag::LATEST_STEP { 0 } else { principal.present_until };
    // Searches backwards for the last step at which the vehicle is in the way.
    let mut from = position.last.max(towards.last).min(gone_from);
    if from < gone_from && !is_out(from, 1) {
        from = gone_from;
    }
    while from >= ROWS as u32 && is_out(from - ROWS as u32, ROWS) {
        from -= ROWS as u32;
    }
    while from > 0 && is_out(from - 1, 1) {
        from -= 1;
    }
    from.max(second.present_from).max(second.attend_from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::series::Series;
    use crate::drivers::Constants;
    use crate::frame::Start;
    use crate::lane_case::LaneCase;
    use crate::lane_step::{LaneState, advance};
    use crate::scene::Scene;
    use lanesweep_model::criterion::Criteria;
    use lanesweep_model::driver::ModelId;
    use lanesweep_model::profile::Profile;
    use lanesweep_model::scenario::parameterization::{Parameterization, ParameterizationOptions, recorded_case};
    use lanesweep_model::scenario::{Category, Tables};
    use lanesweep_traffic::mining::{MiningOptions, mine_generated};
    use lanesweep_traffic::trajectory::generator::GeneratorOptions;

    /// Recorded and kinematic cut-outs of a synthetic recording.
    fn cut_outs(profile: &Profile) -> (Vec<LaneCase<f32>>, Tables<f32>) {
        let generator = GeneratorOptions { recordings: 1, ..GeneratorOptions::default() };
        let mined = mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap();
        let kept = mined.scenarios.iter().filter(|scenario| scenario.kept && scenario.category == Category::CutOut);
        let (mut tables, options) = (Tables::default(), ParameterizationOptions::default());
        let kinematic = Parameterization::find(Category::CutOut, "b").unwrap();
        let mut cases = Vec::new();
        for scenario in kept {
            let recorded = recorded_case(scenario, profile.frame.dt_s).unwrap();
            let kinematic = kinematic.case(scenario, profile.frame.dt_s, &options, None).unwrap();
            cases.extend([recorded, kinematic].map(|case| LaneCase::encode(&case, profile, &mut tables)));
        }
        (cases.iter().map(LaneCase::cast).collect(), tables.cast())
    }

    /// Steps two lanes together: one with both vehicles, and one with only the second vehicle after it leaves. Ego,
    /// gap, criteria and end agree at every step. Returns the number of steps with only the second vehicle.
    fn steps_side_by_side<M: DriverModel<f32>>(
        pair: &Simulation<f32, M>,
        case: &LaneCase<f32>,
        tables: &Tables<f32>,
        name: &str,
    ) -> u32 {
        let cases = std::slice::from_ref(case);
        let lead_only = &Simulation { scene: Scene::of_lead_only(cases), ..*pair };
        assert!(lead_only.scene.in_lane, "{name}");
        let mut series = Series::default();
        let tracks = series.unroll(case, tables, pair.frame.step_cap);
        let constants = LaneConstants::new(pair, case);
        let from = lead_only_from(pair, &constants, &tracks, series.entries());
        let second = constants.others[1];
        let on_its_own = LaneConstants { others: [second; 2], ..constants };
        let mut state = LaneState::new(pair, case, Start::Headway(1.4));
        let mut other: Option<LaneState<f32>> = None;
        let mut saved = 0;
        while !state.over.holds() && state.index < pair.frame.step_cap {
            let places = [0, 1].map(|k: usize| OtherState::of(&case.others[k].motion, tables, state.index));
            if state.index >= from && other.is_none() {
                other = Some(LaneState { gaps: [state.gaps[1]; 2], ..state });
            }
            state = advance(pair, &constants, &state, &places).state;
            if let Some(other) = &mut other {
                *other = advance(lead_only, &on_its_own, other, &[places[1]; 2]).state;
                let same = LaneState { gaps: [state.gaps[1]; 2], ..state };
                assert_eq!(LaneState { gaps: [other.gaps[0]; 2], ..*other }, same, "{name}");
                saved += 1;
            }
        }
        // The step before may matter: the first vehicle is in the way, or the second is absent or not attended to.
        if from != NEVER_LEAVES && from > second.present_from.max(second.attend_from) {
            let first = OtherState::of(&case.others[0].motion, tables, from - 1);
            let present = from - 1 < constants.others[0].present_until;
            let is_out = is_out_of_the_way(pair, &constants, &constants.others[0], &first).holds();
            assert!(present && !is_out, "{name}");
        }
        let ignores = pair.model.ignores(10.0, 0.0, 0.8).holds();
        let comes = constants.others[0].present_from < Flag::LATEST_STEP;
        assert!(ignores || !comes || other.is_none(), "{name}");
        saved
    }

    #[test]
    fn from_there_on_the_second_vehicle_alone_decides() {
        for name in Profile::names() {
            let profile = Profile::load(name).unwrap();
            let (cases, tables) = cut_outs(&profile);
            let constants = Constants::<f32>::resolve(&profile, Category::CutOut);
            let criteria = &Criteria { keeps_values: false, ..constants.criteria };
            let (mut saved, mut lead_only, mut all) = (0, 0, 0);
            for id in ModelId::ALL {
                for (at, case) in cases.iter().enumerate() {
                    let (frame, model_index) = (&constants.frames[id.index()], id.index());
                    let what = format!("{name}, {}, case {at}", id.name());
                    macro_rules! run {
                        ($model:ident) => {{
                            let (model, scene) = (&constants.$model, Scene::unknown(true));
                            let pair = Simulation { frame, criteria, model, model_index, scene };
                            steps_side_by_side(&pair, case, &tables, &what)
                        }};
                    }
                    let steps = match id {
                        ModelId::Reg157 => run!(reg157),
                        ModelId::Cchdm => run!(cchdm),
                        ModelId::Rss => run!(rss),
                        ModelId::Fsm => run!(fsm),
                        ModelId::Foreign(_) => continue,
                    };
                    (saved, lead_only, all) = (saved + steps, lead_only + u32::from(steps > 0), all + 1);
                }
            }
            assert!(lead_only * 2 > all && saved > 100 * all, "{name}: {lead_only} of {all}, {saved}");
        }
    }
}
