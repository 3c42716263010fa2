// Entry point after the generator, of the page of `map`: marks cut-outs without possible traffic. Twin of
// `Case::drives_through_s` in src/model/case.rs.

// Component of a sample whose cutting-out vehicle drives through the one ahead of it. Given points have component 0.
const DRIVES_THROUGH: u32 = 1u;
// A lane has no more steps.
const MAX_TRAFFIC_STEPS: u32 = 1000000u;

@compute @workgroup_size(WORKGROUP)
fn mark_traffic(@builtin(global_invocation_id) invocation: vec3<u32>) {
    let at = invocation.x;
    if at >= generation.count {
        return;
    }
    if recipe_pair & (drawn_records[at].tries <= ATTEMPTS) {
        if drives_through(cases[at]) {
            drawn_records[at].component = DRIVES_THROUGH;
        }
    }
}

fn drives_through(lane: LaneCase) -> bool {
    let cutter = lane.others[0].motion;
    let front = lane.others[1].motion;
    let half_lengths = recipe.half_lengths[1] - recipe.half_lengths[0] + recipe.principal_length;
    let half_widths = recipe.half_widths[0] + recipe.half_widths[1] - recipe.ego_width;
    let place = Between(0u, 0.0);
    var apart = (lane.others[1].gap_offset - lane.others[0].gap_offset - recipe.principal_length) + half_lengths;
    for (var step = 0u; step < MAX_TRAFFIC_STEPS; step++) {
        if step >= recipe.step_cap {
            break;
        }
        if step > 0u {
            let change = motion_speed(front, MOTION_ANALYTIC, step, place) - motion_speed(cutter, made_speed(), step, place);
            apart = apart + change * recipe.dt;
        }
        // The vehicle ahead stays in the middle of the lane.
        let beside = motion_lateral(cutter, made_lateral(), step, place, 0.0).position;
        let is_beside = abs(beside) >= half_widths;
        if (abs(apart) < half_lengths) & !is_beside {
            return true;
        }
        // After its last event each stays where it is across the road.
        if is_beside & (step > lane.horizon + 1u) {
            break;
        }
    }
    return false;
}
