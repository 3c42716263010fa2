// Collision: the boxes overlap along and across the road. Twin of src/criterion/collision.rs.

const CONTACT_NONE: u32 = 0u;
// The other vehicle hits the ego from the side or behind (centres).
const CONTACT_BY_SIDE: u32 = 1u;
// The ego's front hits the other vehicle.
const CONTACT_FRONTAL: u32 = 2u;

// Contact at one step, strict: h < 0 and |x_o − x_e| < (L_e + L_o)/2, with the signed gap `gap`.
fn contact(gap: f32, half_lengths: f32, lateral_gap: f32) -> u32 {
    let overlap_along = (gap < 0.0) & (gap + half_lengths + half_lengths > 0.0);
    let kind = select(CONTACT_FRONTAL, CONTACT_BY_SIDE, gap + half_lengths < 0.0);
    return select(CONTACT_NONE, kind, (lateral_gap < 0.0) & overlap_along);
}
