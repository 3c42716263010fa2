// Surrogate measures of safety: values of a lane without a verdict. Twin of src/model/criterion/measures.rs.

// s
override criteria_tet_threshold: f32;

// Measures over the steps so far. Extreme quotients are kept as numerator and denominator.
struct Measures {
    thw_gap: f32,
    thw_speed: f32,
    drac_numerator: f32,
    drac_denominator: f32,
    tet_steps: u32,
    tit_sum: f32,
    pet_begun: bool,
    pet_distance: f32,
    // Negative if there is no place of encroachment.
    pet_speed: f32,
    pet_steps: u32,
}

// Initial values: infinite THW, no PET, 0 otherwise.
fn measures_nothing() -> Measures {
    return Measures(1.0, 0.0, 0.0, 1.0, 0u, 0.0, false, 0.0, -1.0, 0u);
}

// Takes one step of a vehicle that is `seen` into account: THW and DRAC.
fn measures_update(before: Measures, seen: bool, v_ego: f32, gap: f32, closing: f32) -> Measures {
    var measures = before;
    let room = larger(gap, 0.0);
    if seen & (v_ego > 0.0) & (room * before.thw_speed < before.thw_gap * v_ego) {
        measures.thw_gap = room;
        measures.thw_speed = v_ego;
    }
    let numerator = closing * closing;
    let denominator = room + room;
    let higher = numerator * before.drac_denominator > before.drac_numerator * denominator;
    if seen & (closing > 0.0) & higher {
        measures.drac_numerator = numerator;
        measures.drac_denominator = denominator;
    }
    return measures;
}

// Takes the smallest TTC of one step into account, which is infinite if no vehicle was approached: TET and TIT.
fn measures_expose(before: Measures, nearest: TtcMinimum) -> Measures {
    var measures = before;
    if nearest.closing > 0.0 {
        let ttc = exact_div(nearest.gap, nearest.closing);
        if ttc < criteria_tet_threshold {
            measures.tet_steps = before.tet_steps + 1u;
            measures.tit_sum = before.tit_sum + (criteria_tet_threshold - ttc);
        }
    }
    return measures;
}

// Takes one step into account for the PET. `overlaps`: the principal vehicle overlaps the ego's path. `is_ahead`: if that
// begins now, its rear bumper is the place of encroachment. `way`: of the ego in this step, m.
fn measures_encroach(
    before: Measures,
    overlaps: bool,
    is_ahead: bool,
    gap: f32,
    v_ego: f32,
    way: f32,
) -> Measures {
    var measures = before;
    if before.pet_distance > 0.0 {
        measures.pet_distance = before.pet_distance - way;
        measures.pet_speed = v_ego;
        measures.pet_steps = before.pet_steps + 1u;
    }
    if overlaps & is_ahead & !before.pet_begun {
        measures.pet_distance = gap;
        measures.pet_speed = v_ego;
    }
    measures.pet_begun = before.pet_begun | overlaps;
    return measures;
}

// Bits of the smallest THW, s.
fn measures_min_thw_bits(measures: Measures) -> u32 {
    var bits = INFINITY_BITS;
    if measures.thw_speed > 0.0 {
        bits = bitcast<u32>(exact_div(measures.thw_gap, measures.thw_speed));
    }
    return bits;
}

// Bits of the largest DRAC, m/s².
fn measures_max_drac_bits(measures: Measures) -> u32 {
    var bits = INFINITY_BITS;
    if measures.drac_denominator > 0.0 {
        bits = bitcast<u32>(exact_div(measures.drac_numerator, measures.drac_denominator));
    }
    return bits;
}

// Bits of the PET, s; NO_STEP if there is none.
fn measures_pet_bits(measures: Measures) -> u32 {
    let driven = f32(measures.pet_steps) * frame_dt;
    var bits = bitcast<u32>(driven);
    if measures.pet_speed < 0.0 {
        bits = NO_STEP;
    } else if measures.pet_speed > 0.0 {
        // Negative past the place: less than one step, but for rounding.
        bits = bitcast<u32>(larger(driven + exact_div(measures.pet_distance, measures.pet_speed), 0.0));
    } else if measures.pet_distance > 0.0 {
        bits = INFINITY_BITS;
    }
    return bits;
}
