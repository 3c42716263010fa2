// Collision: the boxes overlap along and across the road. Twin of src/model/criterion/collision.rs.

const CONTACT_NONE: u32 = 0u;
// The other vehicle hits the ego from the side or behind (centres).
const CONTACT_BY_SIDE: u32 = 1u;
// The ego's front hits the other vehicle.
const CONTACT_FRONTAL: u32 = 2u;

// The gap after a step between vehicles that overlap across the road at its end. If their centres pass each other in
// the step, the gap is held in contact.
fn held_in_contact(before: f32, after: f32, half_lengths: f32) -> f32 {
    let was_behind = before + half_lengths + half_lengths <= 0.0;
    let passes = after + half_lengths >= 0.0;
    let from_behind = select(after, -(half_lengths * 1.5), was_behind & passes);
    return select(larger(after, -half_lengths), from_behind, before < 0.0);
}

// Contact at one step, strict: h < 0 (`across`) and |x_o − x_e| < (L_e + L_o)/2, with the signed gap `gap`.
fn overlaps(gap: f32, half_lengths: f32, across: bool) -> bool {
    return across & (gap < 0.0) & (gap + half_lengths + half_lengths > 0.0);
}

// What touches what, if the vehicles overlap.
fn contact(gap: f32, half_lengths: f32) -> u32 {
    return select(CONTACT_FRONTAL, CONTACT_BY_SIDE, gap + half_lengths < 0.0);
}
