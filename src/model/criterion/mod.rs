//! The criteria evaluated in a lane: collision, time to collision, Brake Threat Number.
//!
//! Each keeps a continuous value and a verdict; the verdict comes from its own predicate, never from comparing a
//! printed value. This module has no time loop. Constants come from a profile; verdicts go to the lane's outcome.
//!
//! [`Measures`] are values without a verdict.
//!
//! To add a criterion: one file here, its twin in `shaders/`, one line in [`Criterion`], and the code that counts
//! verdicts. The chapter `docs/src/extend.md` lists every place.

mod btn;
mod collision;
mod measures;
mod ttc;

pub use btn::{BrakeThreat, BrakeThreatMaximum, BtnContact, BtnForm};
pub use collision::{Contact, contact, held_in_contact, overlaps_along};
pub use measures::Measures;
pub use ttc::{TimeToCollision, TtcMinimum};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scalar::{Flag, Real};

/// The registry of criteria, in the order of every table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// The vehicles touch.
    Collision,
    /// The time to collision falls below its threshold.
    Ttc,
    /// The Brake Threat Number exceeds its threshold.
    Btn,
}

impl Criterion {
    /// All criteria, in the order of every table.
    pub const ALL: [Criterion; 3] = [Criterion::Collision, Criterion::Ttc, Criterion::Btn];

    /// Name in files and keys.
    pub fn key(self) -> &'static str {
        match self {
            Criterion::Collision => "collision",
            Criterion::Ttc => "ttc",
            Criterion::Btn => "btn",
        }
    }

    /// Parses a name, ignoring case.
    pub fn parse(text: &str) -> Option<Criterion> {
        Criterion::ALL.into_iter().find(|criterion| criterion.key().eq_ignore_ascii_case(text))
    }

    /// Name in tables and figures.
    pub fn label(self) -> &'static str {
        match self {
            Criterion::Collision => "Collision",
            Criterion::Ttc => "TTC",
            Criterion::Btn => "BTN",
        }
    }

    /// Position in [`Criterion::ALL`]; also the bit of the verdict word.
    pub fn index(self) -> usize {
        self as usize
    }
}

/// Which vehicles TTC and BTN evaluate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LateralGate {
    /// `|y_o − y_e| ≤ W_ego` (the paper).
    EgoWidth,
    /// h < 0: the vehicles overlap across the road (the JRC's tables).
    Overlap,
}

/// Constants of the criteria as a profile gives them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CriteriaProfile {
    /// TTC below this fails, s (1).
    pub ttc_threshold_s: f64,
    /// BTN above this fails (0.8).
    pub btn_threshold: f64,
    /// Which vehicles TTC and BTN evaluate.
    pub gate: LateralGate,
    /// Form of the Brake Threat Number.
    pub btn: BtnForm,
    /// Whether a side contact fails BTN.
    pub btn_contact: BtnContact,
    /// Largest available deceleration of the ego, m/s² (0.774 g).
    pub max_deceleration_mps2: f64,
    /// Jerk of the ramp up to it, m/s³ (12.65).
    pub jerk_mps3: f64,
    /// TET and TIT count a TTC below this, s (3).
    #[serde(default = "default_tet_threshold_s")]
    pub tet_threshold_s: f64,
}

/// Profiles from before this key have none.
fn default_tet_threshold_s() -> f64 {
    3.0
}

/// The criteria of a lane, in its arithmetic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria<R> {
    /// Gate of TTC and BTN.
    pub gate: LateralGate,
    /// A side contact fails BTN too.
    pub btn_contact: BtnContact,
    /// Time to collision.
    pub ttc: TimeToCollision<R>,
    /// Brake Threat Number.
    pub btn: BrakeThreat<R>,
    /// TTC below which TET and TIT count a step, s.
    pub tet_threshold: R,
    /// Whether minimum TTC and maximum BTN are computed; verdicts do not need them.
    pub keeps_values: bool,
    /// Whether [`Measures`] are computed too. Some loops keep values where only verdicts are returned.
    pub keeps_measures: bool,
}

impl CriteriaProfile {
    /// Resolves the constants into the lane arithmetic.
    pub fn resolve<R: Real>(&self) -> Criteria<R> {
        Criteria {
            gate: self.gate,
            btn_contact: self.btn_contact,
            ttc: TimeToCollision { threshold: R::from_f64(self.ttc_threshold_s) },
            btn: BrakeThreat::new(self.btn, self.btn_threshold, self.max_deceleration_mps2, self.jerk_mps3),
            tet_threshold: R::from_f64(self.tet_threshold_s),
            keeps_values: true,
            keeps_measures: true,
        }
    }
}

impl<R: Real> Criteria<R> {
    /// The constants by their names in the shaders; flags are 0 or 1, alternatives are numbered from 0.
    pub fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        let mut all = vec![
            ("criteria_gate", f64::from(self.gate as u32)),
            ("criteria_any_contact", f64::from(u8::from(self.btn_contact == BtnContact::Any))),
            ("criteria_ttc_threshold", self.ttc.threshold.to_f64()),
            ("criteria_tet_threshold", self.tet_threshold.to_f64()),
        ];
        all.extend(self.btn.shader_constants());
        all
    }

    /// Whether TTC and BTN evaluate a vehicle at this position: its centre is in front, and the lateral gate holds.
    #[inline(always)]
    pub fn sees(&self, gap: R, half_lengths: R, lateral_gap: R, lateral_position: R, ego_width: R) -> Flag {
        let near = match self.gate {
            LateralGate::EgoWidth => lateral_position.abs().is_at_most(ego_width),
            LateralGate::Overlap => lateral_gap.is_negative(),
        };
        !(gap + half_lengths).is_negative() & near
    }
}
