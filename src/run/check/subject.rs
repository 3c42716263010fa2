//! The checked case and its neighbours: the same case with one number changed.

use crate::grid::{CaseQuantity, Point, without_reaction};
use lanesweep_engine::{Constants, Headway, LaneCase, Outcome, Step, Trace};
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::parameterization::{TimeGrid, recorded_case};
use lanesweep_model::scenario::{Case, Category, Lateral, PlainCase, Scenario, Speed, Tables};
use lanesweep_support::{Error, Place, Result, option};

/// A concrete case.
#[derive(Debug, Clone, PartialEq)]
pub enum Subject {
    /// Constant speeds, one deceleration, a lane change at constant lateral speed: the case, and its numbers.
    Plain(PlainCase, Point),
    /// A scenario whose other vehicles follow their series. The point has the ego's speed, the first speed and lateral
    /// position of the other vehicle, the initial gap, the sizes of both and the lane's width.
    Recorded(Box<Scenario>, Point),
}

/// A case as a lane runs it.
pub struct Lane {
    /// The lane record.
    pub case: LaneCase<f64>,
    /// Its series.
    pub tables: Tables<f64>,
    /// The initial headway or gap.
    pub headway: Headway,
}

/// A run of a lane.
pub struct LaneRun {
    /// Its outcome.
    pub outcome: Outcome<f64>,
    /// Smallest gap to a vehicle ahead that overlaps the ego laterally, m; infinite without one.
    pub min_gap_m: f64,
    /// At the last step the gap closes to a vehicle ahead that is in the path or comes into it.
    pub still_closes: bool,
}

impl Subject {
    /// From plain numbers.
    pub fn plain(case: &PlainCase, headway: Headway) -> Subject {
        let (is_lateral, is_pair) = (case.category != Category::Lvd, case.category == Category::CutOut);
        let (start, start_si) = start(headway, case.ego_speed_mps);
        let point = Point::of([
            (CaseQuantity::EgoSpeed, Some(case.ego_speed_mps)),
            (CaseQuantity::OtherSpeed, Some(case.speed_mps)),
            (start, Some(start_si)),
            (CaseQuantity::Length, Some(case.length_m)),
            (CaseQuantity::Width, Some(case.width_m)),
            (CaseQuantity::EgoLength, Some(case.ego_length_m)),
            (CaseQuantity::EgoWidth, Some(case.ego_width_m)),
            (CaseQuantity::Deceleration, Some(-case.acceleration_mps2).filter(|a| *a != 0.0)),
            (CaseQuantity::EndSpeed, case.end_speed_mps),
            (CaseQuantity::LateralSpeed, Some(case.lateral_speed_mps).filter(|_| is_lateral)),
            (CaseQuantity::LateralDistance, Some(case.lateral_distance_m).filter(|_| is_lateral)),
            (CaseQuantity::LaneWidth, Some(case.lane_width_m).filter(|_| is_lateral)),
            (CaseQuantity::AheadSpeed, Some(case.ahead_speed_mps).filter(|_| is_pair)),
            (CaseQuantity::AheadGap, Some(case.ahead_gap_m).filter(|_| is_pair)),
        ]);
        Subject::Plain(*case, point)
    }

    /// From a recorded scenario; it starts as recorded unless a headway is given.
    ///
    /// # Errors
    /// [`Error::Usage`] if neither is known.
    pub fn recorded(scenario: Scenario, headway: Option<Headway>) -> Result<Subject> {
        let missing = || {
            let problem = format!("scenario {} has no observed gap", scenario.id);
            Error::usage(
                Place::item("gap, thw"),
                problem,
                format!("give {} in metres or {} in seconds", option("gap"), option("thw")),
            )
        };
        let other_mps = scenario.target.v.first().copied().unwrap_or(0.0).max(0.0);
        let ego_mps = if scenario.category == Category::Lvd { other_mps } else { scenario.ego.v0 };
        let (start, start_si) = match headway {
            Some(headway) => start(headway, ego_mps),
            None => (CaseQuantity::Gap, scenario.gap0.filter(|gap| gap.is_finite()).ok_or_else(missing)?),
        };
        let y_m = scenario.target.y.first().filter(|_| scenario.category != Category::Lvd);
        let point = Point::of([
            (CaseQuantity::EgoSpeed, Some(ego_mps)),
            (CaseQuantity::OtherSpeed, Some(other_mps)),
            (start, Some(start_si)),
            (CaseQuantity::Length, Some(scenario.target.length)),
            (CaseQuantity::Width, Some(scenario.target.width)),
            (CaseQuantity::EgoLength, Some(scenario.ego.length)),
            (CaseQuantity::EgoWidth, Some(scenario.ego.width)),
            (CaseQuantity::LateralDistance, y_m.map(|y_m| y_m.abs())),
            (CaseQuantity::LaneWidth, y_m.map(|_| scenario.lane_width)),
        ]);
        Ok(Subject::Recorded(Box::new(scenario), point))
    }

    /// Kind of scenario.
    pub fn category(&self) -> Category {
        match self {
            Subject::Plain(case, _) => case.category,
            Subject::Recorded(scenario, _) => scenario.category,
        }
    }

    /// Duration after which the other vehicles keep their speed and lateral position, s; `None` if not given.
    pub fn duration_s(&self) -> Option<f64> {
        match self {
            Subject::Plain(case, _) => case.duration_s,
            Subject::Recorded(..) => None,
        }
    }

    /// The numbers of the case.
    pub fn point(&self) -> &Point {
        match self {
            Subject::Plain(_, point) | Subject::Recorded(_, point) => point,
        }
    }

    /// The case with the numbers of a point.
    ///
    /// # Errors
    /// As [`Subject::lane`].
    pub(super) fn case(&self, profile: &Profile, point: &Point) -> Result<Case> {
        match self {
            Subject::Plain(case, _) => plain(case, point, profile),
            Subject::Recorded(scenario, recorded) => {
                let mut case = recorded_case(scenario, TimeGrid::of(profile))?;
                move_to(&mut case, recorded, point);
                Ok(case)
            }
        }
    }

    /// As [`Case::drives_through_s`].
    ///
    /// # Errors
    /// As [`Subject::lane`].
    pub fn drives_through_s(&self, profile: &Profile) -> Result<Option<f64>> {
        Ok(self.case(profile, self.point())?.drives_through_s(profile))
    }

    /// The case with the numbers of a point, ready to run.
    ///
    /// # Errors
    /// [`Error::Usage`] for contradictory numbers; [`Error::Input`] for a cut-out without a vehicle ahead.
    pub fn lane(&self, profile: &Profile, point: &Point) -> Result<Lane> {
        let mut tables = Tables::default();
        let case = LaneCase::encode(&self.case(profile, point)?, profile, &mut tables);
        Ok(Lane { case, tables, headway: headway(point) })
    }

    /// The case with its initial gap, for a plan whose lanes start where their cases do.
    ///
    /// # Errors
    /// As [`Subject::lane`].
    pub(super) fn encode(&self, profile: &Profile, tables: &mut Tables<f64>) -> Result<LaneCase<f64>> {
        let case = self.case(profile, self.point())?;
        let gap_m = headway(self.point()).start().gap(case.ego_speed_mps);
        Ok(LaneCase::encode(&case, profile, tables).ahead_by(gap_m))
    }
}

/// The initial headway or gap of a point.
fn headway(point: &Point) -> Headway {
    match (point.get(CaseQuantity::Thw), point.get(CaseQuantity::Gap)) {
        (Some(thw_s), _) => Headway::ThwS(thw_s),
        (None, gap_m) => Headway::GapM(gap_m.unwrap_or(0.0)),
    }
}

/// The quantity and value that a headway sets; the regulation's distance is a gap.
fn start(headway: Headway, ego_mps: f64) -> (CaseQuantity, f64) {
    match headway {
        Headway::ThwS(thw_s) => (CaseQuantity::Thw, thw_s),
        Headway::GapM(_) | Headway::MinFollowing | Headway::Observed => {
            (CaseQuantity::Gap, headway.start().gap(ego_mps))
        }
    }
}

fn plain(of: &PlainCase, point: &Point, profile: &Profile) -> Result<Case> {
    let case = PlainCase {
        // A map has only decelerations and no durations.
        acceleration_mps2: point.get(CaseQuantity::Deceleration).map_or(0.0, |a| 0.0 - a),
        duration_s: of.duration_s,
        ..point.plain_case(of.category, profile)?
    };
    case.case(profile.frame.time_cap_s)
}

/// Changes the first values and the sizes of a recorded case; series keep their shape.
fn move_to(case: &mut Case, from: &Point, to: &Point) {
    let change = |quantity| to.get(quantity).zip(from.get(quantity)).map_or(0.0, |(to, from)| to - from);
    case.ego_speed_mps = (case.ego_speed_mps + change(CaseQuantity::EgoSpeed)).max(0.0);
    let by_mps = change(CaseQuantity::OtherSpeed);
    if let Speed::Sampled(series) = &mut case.principal.speed
        && by_mps != 0.0
    {
        series.iter_mut().for_each(|v| *v = (*v + by_mps).max(0.0));
    }
    let by_m = change(CaseQuantity::LateralDistance);
    if let Lateral::Sampled { position_m, .. } = &mut case.principal.lateral
        && by_m != 0.0
    {
        let side = position_m.first().map_or(1.0, |y| y.signum());
        position_m.iter_mut().for_each(|y| *y += side * by_m);
    }
    case.ego_length_m += change(CaseQuantity::EgoLength);
    case.ego_width_m += change(CaseQuantity::EgoWidth);
    case.principal.length_m += change(CaseQuantity::Length);
    case.principal.width_m += change(CaseQuantity::Width);
    case.lane_width_m += change(CaseQuantity::LaneWidth);
}

impl Lane {
    /// Runs a model.
    pub fn run(&self, profile: &Profile, category: Category, model: ModelId) -> LaneRun {
        let constants = Constants::<f64>::resolve(profile, category);
        let (mut min_gap_m, mut still_closes) = (f64::INFINITY, false);
        let mut see = |step: &Step<f64>| {
            still_closes = false;
            for seen in step.seen.iter().filter(|seen| seen.present.holds() && !seen.view.is_behind().holds()) {
                let is_in_path = seen.view.lateral_gap < 0.0;
                if is_in_path {
                    min_gap_m = min_gap_m.min(seen.view.gap);
                }
                still_closes |= seen.view.closing() > 0.0 && (is_in_path || seen.view.lateral_towards > 0.0);
            }
        };
        let outcome = constants.run(model, &self.case, &self.tables, self.headway.start(), &mut see);
        LaneRun { outcome, min_gap_m, still_closes }
    }

    /// The same with every step.
    pub(super) fn trace(&self, profile: &Profile, category: Category, model: ModelId) -> Trace {
        Trace::record(profile, category, &self.case, &self.tables, self.headway, model)
    }

    /// Every step of an ego that never reacts.
    pub(super) fn unreacting(&self, profile: &Profile, category: Category) -> Trace {
        self.trace(&without_reaction(profile), category, ModelId::Reg157)
    }
}
