//! How another vehicle moves: a pure function of the step index, in a fixed-size record over shared tables. It has no
//! closure and no accumulation; every backend decodes it alike.

use crate::scalar::Real;

/// Speed along the road as the host describes it.
#[derive(Debug, Clone, PartialEq)]
pub enum Speed {
    /// `max(initial + acceleration·t, 0)` up to `until_s`, then held.
    Kinematic {
        /// Speed at t = 0, m/s.
        initial_mps: f64,
        /// Constant acceleration, m/s².
        acceleration_mps2: f64,
        /// End of the acceleration, s.
        until_s: f64,
    },
    /// One value per step, m/s; the last is held.
    Sampled(Vec<f64>),
}

impl Speed {
    /// Constant speed.
    pub fn constant(speed_mps: f64) -> Self {
        Speed::Kinematic { initial_mps: speed_mps, acceleration_mps2: 0.0, until_s: 0.0 }
    }
}

/// Lateral position and speed as the host describes them. Positions are of the vehicle's centre relative to the middle
/// of the ego's lane; the speed is positive **towards** the ego.
#[derive(Debug, Clone, PartialEq)]
pub enum Lateral {
    /// Always in the middle of the ego's lane.
    Centred,
    /// From `start_m` to `end_m` at constant speed, then held.
    Kinematic {
        /// Position at t = 0, m.
        start_m: f64,
        /// Speed along y, m/s, signed.
        rate_mps: f64,
        /// Position that ends the motion, m.
        end_m: f64,
    },
    /// One value per step; the last position is held and the lateral speed is then 0.
    Sampled {
        /// Position, m.
        position_m: Vec<f64>,
        /// Speed towards the ego, m/s.
        towards_mps: Vec<f64>,
    },
}

/// Series used by many lanes.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct Tables<R> {
    /// Speeds, m/s, one per step.
    pub speed: Vec<R>,
    /// Lateral position, m, and speed towards the ego, m/s, one pair per step.
    pub lateral: Vec<[R; 2]>,
}

impl Tables<f64> {
    /// Rounds the series once to the lane arithmetic.
    pub fn cast<R: Real>(&self) -> Tables<R> {
        Tables {
            speed: self.speed.iter().map(|&v| R::from_f64(v)).collect(),
            lateral: self.lateral.iter().map(|&[y, w]| [R::from_f64(y), R::from_f64(w)]).collect(),
        }
    }
}

/// [`Motion::kind`] bit: the speed is a table.
pub const SPEED_SAMPLED: u32 = 1;
/// [`Motion::kind`] bit: the lateral motion is a table.
pub const LATERAL_SAMPLED: u32 = 2;

/// The motion record that a lane decodes; 64 bytes in f32. The default is at rest in the middle of the ego's lane.
#[repr(C)]
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct Motion<R> {
    /// Bits [`SPEED_SAMPLED`] and [`LATERAL_SAMPLED`].
    pub kind: u32,
    /// First entry of the speed table.
    pub speed_offset: u32,
    /// Number of entries, at least 1 where the speed is sampled.
    pub speed_len: u32,
    /// First entry of the lateral table.
    pub lateral_offset: u32,
    /// Number of entries, at least 1 where the lateral motion is sampled.
    pub lateral_len: u32,
    /// Kinematic: last step of the acceleration.
    pub speed_until: u32,
    /// Kinematic: last step of the lateral motion.
    pub lateral_until: u32,
    /// Kinematic: speed at step 0, m/s.
    pub speed_initial: R,
    /// Kinematic: change of speed per step, m/s.
    pub speed_per_step: R,
    /// Kinematic: speed afterwards, m/s.
    pub speed_end: R,
    /// Kinematic: lateral position at step 0, m.
    pub lateral_initial: R,
    /// Kinematic: change of lateral position per step, m.
    pub lateral_per_step: R,
    /// Kinematic: lateral position afterwards, m.
    pub lateral_end: R,
    /// Kinematic: lateral speed towards the ego while the motion lasts, m/s.
    pub lateral_towards: R,
    /// Fills the record to 64 bytes in f32.
    pub reserved: [u32; 2],
}

/// Lateral position and speed towards the ego at one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LateralState<R> {
    /// m, signed.
    pub position: R,
    /// m/s, > 0 towards the ego.
    pub towards: R,
}

impl<R: Real> Motion<R> {
    /// Speed at a step, m/s, ≥ 0.
    #[inline(always)]
    pub fn speed(&self, tables: &Tables<R>, step: u32) -> R {
        if self.kind & SPEED_SAMPLED != 0 {
            let at = if step < self.speed_len { step } else { self.speed_len - 1 };
            tables.speed[(self.speed_offset + at) as usize]
        } else if step <= self.speed_until {
            (self.speed_initial + R::from_step(step) * self.speed_per_step).larger(R::ZERO)
        } else {
            self.speed_end
        }
    }

    /// Lateral position and speed at a step.
    #[inline(always)]
    pub fn lateral(&self, tables: &Tables<R>, step: u32) -> LateralState<R> {
        if self.kind & LATERAL_SAMPLED != 0 {
            let inside = step < self.lateral_len;
            let at = if inside { step } else { self.lateral_len - 1 };
            let [position, towards] = tables.lateral[(self.lateral_offset + at) as usize];
            LateralState { position, towards: if inside { towards } else { R::ZERO } }
        } else if step <= self.lateral_until {
            LateralState {
                position: self.lateral_initial + R::from_step(step) * self.lateral_per_step,
                towards: self.lateral_towards,
            }
        } else {
            LateralState { position: self.lateral_end, towards: R::ZERO }
        }
    }
}

impl Motion<f64> {
    /// Encodes a described motion at time step `dt_s`; sampled series go to the end of `tables`.
    pub fn encode(speed: &Speed, lateral: &Lateral, dt_s: f64, tables: &mut Tables<f64>) -> Self {
        let mut motion = Motion::default();
        motion.set_speed(speed, dt_s, tables);
        motion.set_lateral(lateral, dt_s, tables);
        motion
    }

    /// Sets the motion along the road.
    pub fn set_speed(&mut self, speed: &Speed, dt_s: f64, tables: &mut Tables<f64>) {
        match speed {
            Speed::Kinematic { initial_mps, acceleration_mps2, until_s } => {
                self.kind &= !SPEED_SAMPLED;
                self.speed_initial = initial_mps.max(0.0);
                self.speed_per_step = acceleration_mps2 * dt_s;
                self.speed_until = last_step_before(*until_s, dt_s);
                self.speed_end = (initial_mps + acceleration_mps2 * until_s).max(0.0);
            }
            Speed::Sampled(series) => {
                self.kind |= SPEED_SAMPLED;
                self.speed_offset = tables.speed.len() as u32;
                self.speed_len = series.len() as u32;
                tables.speed.extend_from_slice(series);
            }
        }
    }

    /// Sets the motion across the road; [`Lateral::Centred`] changes nothing.
    pub fn set_lateral(&mut self, lateral: &Lateral, dt_s: f64, tables: &mut Tables<f64>) {
        match lateral {
            Lateral::Centred => {}
            Lateral::Kinematic { start_m, rate_mps, end_m } => {
                let duration_s = if *rate_mps == 0.0 { 0.0 } else { (end_m - start_m) / rate_mps };
                self.kind &= !LATERAL_SAMPLED;
                self.lateral_initial = *start_m;
                self.lateral_per_step = rate_mps * dt_s;
                self.lateral_until = last_step_before(duration_s, dt_s);
                self.lateral_end = *end_m;
                // A lateral motion towards the ego leads towards y = 0.
                self.lateral_towards = if start_m.abs() > end_m.abs() { rate_mps.abs() } else { -rate_mps.abs() };
                if duration_s <= 0.0 {
                    self.lateral_initial = *end_m;
                    self.lateral_per_step = 0.0;
                    self.lateral_towards = 0.0;
                }
            }
            Lateral::Sampled { position_m, towards_mps } => {
                self.kind |= LATERAL_SAMPLED;
                self.lateral_offset = tables.lateral.len() as u32;
                self.lateral_len = position_m.len() as u32;
                tables.lateral.extend(position_m.iter().zip(towards_mps).map(|(&y, &w)| [y, w]));
            }
        }
    }

    /// Rounds the record once to the lane arithmetic.
    pub fn cast<R: Real>(&self) -> Motion<R> {
        Motion {
            kind: self.kind,
            speed_offset: self.speed_offset,
            speed_len: self.speed_len,
            lateral_offset: self.lateral_offset,
            lateral_len: self.lateral_len,
            speed_until: self.speed_until,
            lateral_until: self.lateral_until,
            speed_initial: R::from_f64(self.speed_initial),
            speed_per_step: R::from_f64(self.speed_per_step),
            speed_end: R::from_f64(self.speed_end),
            lateral_initial: R::from_f64(self.lateral_initial),
            lateral_per_step: R::from_f64(self.lateral_per_step),
            lateral_end: R::from_f64(self.lateral_end),
            lateral_towards: R::from_f64(self.lateral_towards),
            reserved: [0; 2],
        }
    }
}

/// Last step strictly before a time, 0 if there is none. At the end time itself the end value applies and the lateral
/// speed is 0, because the change is over.
fn last_step_before(time_s: f64, dt_s: f64) -> u32 {
    let steps = (time_s / dt_s - 1e-9).ceil() - 1.0;
    if steps < 0.0 { 0 } else { steps as u32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_record_has_64_bytes_in_the_lane_arithmetic() {
        assert_eq!(std::mem::size_of::<Motion<f32>>(), 64);
    }

    #[test]
    fn a_kinematic_motion_stops_at_standstill_and_holds_its_end() {
        let mut tables = Tables::default();
        let speed = Speed::Kinematic { initial_mps: 1.0, acceleration_mps2: -2.0, until_s: 1.0 };
        let lateral = Lateral::Kinematic { start_m: 3.5, rate_mps: -1.0, end_m: 0.0 };
        let motion = Motion::encode(&speed, &lateral, 0.1, &mut tables);
        assert_eq!(motion.speed(&tables, 0), 1.0);
        assert!((motion.speed(&tables, 3) - 0.4).abs() < 1e-12);
        assert_eq!(motion.speed(&tables, 7), 0.0);
        assert_eq!(motion.speed(&tables, 70), 0.0);
        assert_eq!(motion.lateral(&tables, 35), LateralState { position: 0.0, towards: 0.0 });
        assert_eq!(motion.lateral(&tables, 34).towards, 1.0);
    }

    #[test]
    fn a_sampled_motion_holds_its_last_value_without_lateral_speed() {
        let mut tables = Tables::default();
        let speed = Speed::Sampled(vec![10.0, 9.0]);
        let lateral = Lateral::Sampled { position_m: vec![2.0, 1.9], towards_mps: vec![1.0, 1.0] };
        let motion = Motion::encode(&speed, &lateral, 0.1, &mut tables);
        assert_eq!(motion.speed(&tables, 9), 9.0);
        assert_eq!(motion.lateral(&tables, 1).towards, 1.0);
        assert_eq!(motion.lateral(&tables, 2), LateralState { position: 1.9, towards: 0.0 });
    }
}
