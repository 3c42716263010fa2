//! The decisions of the threshold set, and the starts of its cases.

use crate::Headway;

/// The starts: for one of them, a case's `gap_offset` puts the vehicle on its threshold.
pub(super) const HEADWAYS: [Headway; 4] =
    [Headway::GapM(0.0), Headway::ThwS(0.0), Headway::GapM(10.0), Headway::ThwS(1.0)];

/// A decision of a lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Threshold {
    /// TTC criterion: gap = threshold·dv.
    Ttc,
    /// BTN criterion at its threshold.
    Btn,
    /// BTN: no distance left after the ramp.
    BtnRoom,
    /// Reg157: |g| = |dv|·(dv/(2·6) + c).
    Reg157Ttc,
    /// Reg157: lateral gap at its gate.
    Reg157Gate,
    /// CCHDM: |g| = 2 s·|dv|.
    CchdmTtc,
    /// CCHDM: lateral gap at its gate.
    CchdmGate,
    /// RSS: g = d_lon.
    RssLongitudinal,
    /// RSS: h = d_lat.
    RssLateral,
    /// FSM: PFS at its safe distance.
    PfsSafe,
    /// FSM: PFS at its unsafe distance.
    PfsUnsafe,
    /// FSM: CFS at its safe distance.
    CfsSafe,
    /// FSM: CFS at its unsafe distance.
    CfsUnsafe,
    /// FSM: lateral gate, h·dv = w·(D + 0.1·dv).
    FsmGate,
    /// FSM: lateral speed 0 beside the ego.
    LateralSpeed,
    /// Lateral gap 0: contact across the road, and every gate `overlap`.
    LateralGap,
    /// |y| = width of the ego: gate of TTC and BTN.
    EgoWidth,
    /// Gap 0: contact along the road.
    Gap,
    /// Gap −(L_e + L_o): the other vehicle has just fallen behind.
    Behind,
    /// Gap −(L_e + L_o)/2: the centres are side by side.
    Centres,
    /// dv = 0 from the start.
    EqualSpeeds,
    /// v_ego = 0 from the start.
    StandingEgo,
    /// First step of a model's attention.
    Attention,
    /// First step at which the vehicle is present.
    Appearance,
    /// First step at which it is absent: the step of the contact.
    Disappearance,
    /// Speed change that ends on a step.
    SpeedEvent,
    /// Lateral motion that ends on a step.
    LateralEvent,
    /// Horizon of a lane that is settled from the start.
    Horizon,
    /// Horizon at the step cap.
    StepCap,
}

impl Threshold {
    /// All, in the order of the units.
    pub const ALL: [Threshold; 29] = [
        Threshold::Ttc,
        Threshold::Btn,
        Threshold::BtnRoom,
        Threshold::Reg157Ttc,
        Threshold::Reg157Gate,
        Threshold::CchdmTtc,
        Threshold::CchdmGate,
        Threshold::RssLongitudinal,
        Threshold::RssLateral,
        Threshold::PfsSafe,
        Threshold::PfsUnsafe,
        Threshold::CfsSafe,
        Threshold::CfsUnsafe,
        Threshold::FsmGate,
        Threshold::LateralSpeed,
        Threshold::LateralGap,
        Threshold::EgoWidth,
        Threshold::Gap,
        Threshold::Behind,
        Threshold::Centres,
        Threshold::EqualSpeeds,
        Threshold::StandingEgo,
        Threshold::Attention,
        Threshold::Appearance,
        Threshold::Disappearance,
        Threshold::SpeedEvent,
        Threshold::LateralEvent,
        Threshold::Horizon,
        Threshold::StepCap,
    ];

    /// Name in keys: `reg157-ttc`.
    pub fn name(self) -> String {
        let name = format!("{self:?}");
        let lower = name.chars().flat_map(|c| c.is_uppercase().then_some('-').into_iter().chain(c.to_lowercase()));
        lower.skip(1).collect()
    }

    /// The threshold of a unit of any category.
    pub fn of_unit(unit: u64) -> Threshold {
        Threshold::ALL[(unit % Threshold::ALL.len() as u64) as usize]
    }
}
