//! The frame around a lane's steps: time and end rules, the headway it starts from, and what all lanes of one
//! model have in common.

use crate::model::criterion::Criteria;
use crate::model::profile::FrameProfile;
use crate::model::scalar::Real;

use super::scene::Scene;

/// Constants of the frame at one time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<R> {
    /// Time step, s.
    pub dt: R,
    /// 1/dt, 1/s.
    pub inverse_dt: R,
    /// Number of steps that are evaluated at most.
    pub step_cap: u32,
    /// Index 0 is one step after the nominal start.
    pub start_shift: bool,
    /// End where nothing can happen any more.
    pub end_when_settled: bool,
    /// Abort at lateral overlap with |TTC| above this, s (the JRC's rule for CCHDM); off where not positive.
    pub abort_above_ttc: R,
}

impl<R: Real> Frame<R> {
    /// Plain constants; `abort_above_ttc_s` is the driver model's.
    pub fn resolve(profile: &FrameProfile, abort_above_ttc_s: f64) -> Self {
        Frame {
            dt: R::from_f64(profile.dt_s),
            inverse_dt: R::from_f64(1.0 / profile.dt_s),
            step_cap: profile.step_cap(),
            start_shift: profile.start_shift,
            end_when_settled: profile.end_when_settled,
            abort_above_ttc: R::from_f64(abort_above_ttc_s),
        }
    }

    /// The constants by the names that the shaders give them; flags are 0 or 1.
    pub fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("frame_dt", self.dt.to_f64()),
            ("frame_inverse_dt", self.inverse_dt.to_f64()),
            ("frame_step_cap", f64::from(self.step_cap.max(1))),
            ("frame_start_shift", f64::from(u8::from(self.start_shift))),
            ("frame_end_when_settled", f64::from(u8::from(self.end_when_settled))),
            ("frame_abort_above_ttc", self.abort_above_ttc.to_f64()),
        ]
    }
}

/// The headway of a lane: it sets the initial gap, bumper to bumper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start<R> {
    /// Time headway, s: the gap is this times the ego's speed.
    Headway(R),
    /// Gap, m.
    Gap(R),
}

/// What all lanes of one model have in common.
#[derive(Debug, Clone, Copy)]
pub struct Simulation<'a, R, M> {
    /// Time and end rules.
    pub frame: &'a Frame<R>,
    /// Criteria.
    pub criteria: &'a Criteria<R>,
    /// The ego's driver.
    pub model: &'a M,
    /// Its position in the registry: selects the attention windows.
    pub model_index: usize,
    /// What is known of the other vehicles.
    pub scene: Scene,
}
