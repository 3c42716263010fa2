//! The scenario file: ASAM OpenSCENARIO XML 1.2, the first revision whose header has properties.
//!
//! Every vehicle except an external ego follows a polyline with one vertex per time step, in simulation time. The
//! heading is always 0: the boxes of a lane are parallel to the road, so vehicles touch at the same time and place as
//! in the lane.
//!
//! A folder of exported scenarios has a scenario file and a road file per lane, and an index.

use std::path::Path;

use super::concrete::{Concrete, EgoMotion, PlayedVehicle};
use super::elements::{Attribute, Element, Elements, number, plain};
use super::road::{Road, road_file};
use super::{AUTHOR, DATE};
use crate::Result;
use crate::support::run_dir::OutputDir;
use crate::support::table::Table;

/// Name of the parameter for the initial speed of an external ego.
const EGO_SPEED: &str = "ego_speed_mps";

/// Property for an overlap of two vehicles other than the ego: its time, s.
const OTHERS_OVERLAP: &str = "lanesweep.others_overlap_s";

/// Height of every vehicle, m; lanes have no height.
const HEIGHT_M: f64 = 1.5;

/// Builds the scenario file; `road` is the name of the road file in the same folder.
///
/// # Errors
/// As [`Concrete::check`].
fn scenario_file(scenario: &Concrete, road: &str) -> Result<Vec<u8>> {
    scenario.check()?;
    let mut xml = Elements::new()?;
    xml.open("OpenSCENARIO", vec![])?;
    header(&mut xml, scenario)?;
    xml.open("ParameterDeclarations", vec![])?;
    for (name, value) in &scenario.parameters {
        let declared = vec![text("name", &identifier(name)), text("parameterType", "double"), float("value", *value)];
        xml.empty("ParameterDeclaration", declared)?;
    }
    xml.close()?;
    xml.empty("CatalogLocations", vec![])?;
    xml.open("RoadNetwork", vec![])?;
    xml.empty("LogicFile", vec![text("filepath", road)])?;
    xml.close()?;
    xml.open("Entities", vec![])?;
    for vehicle in &scenario.vehicles {
        entity(&mut xml, vehicle)?;
    }
    xml.close()?;
    xml.open("Storyboard", vec![])?;
    init(&mut xml, scenario)?;
    story(&mut xml, scenario)?;
    xml.open("StopTrigger", vec![])?;
    at_time(&mut xml, "end", scenario.end_s())?;
    xml.finish()
}

fn header(xml: &mut Elements, scenario: &Concrete) -> Result<()> {
    let synthetic = if scenario.is_synthetic { "SYNTHETIC DATA: " } else { "" };
    let overlap_s = scenario.others_overlap_s();
    let overlap = overlap_s.map_or(String::new(), |time_s| {
        format!(
            "; Other drives through Ahead from {} s on: a player that checks all vehicles reports a collision of these two, \
             which is none of Ego's",
            number(time_s)
        )
    });
    let description = format!("{synthetic}{} {}{overlap}", scenario.category.label(), scenario.key);
    xml.open(
        "FileHeader",
        vec![
            text("revMajor", "1"),
            text("revMinor", "2"),
            text("date", DATE),
            text("description", &description),
            text("author", AUTHOR),
        ],
    )?;
    xml.open("Properties", vec![])?;
    for (name, value) in &scenario.properties {
        xml.empty("Property", vec![text("name", name), text("value", value)])?;
    }
    if let Some(time_s) = overlap_s {
        xml.empty("Property", vec![text("name", OTHERS_OVERLAP), text("value", &number(time_s))])?;
    }
    xml.close()?;
    xml.close()
}

fn entity(xml: &mut Elements, vehicle: &PlayedVehicle) -> Result<()> {
    let (length, width) = (vehicle.length_m, vehicle.width_m);
    xml.open("ScenarioObject", vec![text("name", vehicle.name)])?;
    xml.open("Vehicle", vec![text("name", vehicle.name), text("vehicleCategory", "car")])?;
    xml.open("BoundingBox", vec![])?;
    let centre = vec![float("x", vehicle.centre_offset_m()), float("y", 0.0), float("z", HEIGHT_M / 2.0)];
    xml.empty("Center", centre)?;
    let dimensions = vec![float("width", width), float("length", length), float("height", HEIGHT_M)];
    xml.empty("Dimensions", dimensions)?;
    xml.close()?;
    let limits = vec![float("maxSpeed", 150.0), float("maxAcceleration", 10.0), float("maxDeceleration", 50.0)];
    xml.empty("Performance", limits)?;
    xml.open("Axles", vec![])?;
    let axle = |at_m: f64, steering: f64| {
        vec![
            float("maxSteering", steering),
            float("wheelDiameter", 0.6),
            float("trackWidth", 0.85 * width),
            float("positionX", at_m),
            float("positionZ", 0.3),
        ]
    };
    xml.empty("FrontAxle", axle(vehicle.wheelbase_m(), 0.5))?;
    xml.empty("RearAxle", axle(0.0, 0.0))?;
    xml.close()?;
    xml.empty("Properties", vec![])?;
    xml.close()?;
    xml.close()
}

/// Writes the initial positions and speeds.
fn init(xml: &mut Elements, scenario: &Concrete) -> Result<()> {
    xml.open("Init", vec![])?;
    xml.open("Actions", vec![])?;
    for (at, vehicle) in scenario.vehicles.iter().enumerate() {
        let Some(first) = vehicle.path.first() else { continue };
        xml.open("Private", vec![text("entityRef", vehicle.name)])?;
        xml.nested(&[
            ("PrivateAction", vec![]),
            ("TeleportAction", vec![]),
            ("Position", vec![]),
            world(scenario, vehicle, first.x_m, first.y_m),
        ])?;
        let is_declared = at == 0 && scenario.parameters.iter().any(|(name, _)| name == EGO_SPEED);
        let is_free = is_declared && scenario.ego == EgoMotion::External;
        let speed = if is_free { ("value", format!("${EGO_SPEED}")) } else { float("value", first.v_mps) };
        xml.open("PrivateAction", vec![])?;
        xml.open("LongitudinalAction", vec![])?;
        xml.open("SpeedAction", vec![])?;
        xml.empty(
            "SpeedActionDynamics",
            vec![text("dynamicsShape", "step"), float("value", 0.0), text("dynamicsDimension", "time")],
        )?;
        xml.nested(&[("SpeedActionTarget", vec![]), ("AbsoluteTargetSpeed", vec![speed])])?;
        for _ in 0..4 {
            xml.close()?;
        }
    }
    xml.close()?;
    xml.close()
}

/// Writes the paths of the vehicles.
fn story(xml: &mut Elements, scenario: &Concrete) -> Result<()> {
    xml.open("Story", vec![text("name", "story")])?;
    xml.open("Act", vec![text("name", "act")])?;
    let skipped = usize::from(scenario.ego == EgoMotion::External);
    for vehicle in scenario.vehicles.iter().skip(skipped) {
        let name = vehicle.name;
        let named = |what: &str| text("name", &format!("{name} {what}"));
        xml.open("ManeuverGroup", vec![text("maximumExecutionCount", "1"), named("group")])?;
        xml.open("Actors", vec![text("selectTriggeringEntities", "false")])?;
        xml.empty("EntityRef", vec![text("entityRef", name)])?;
        xml.close()?;
        xml.open("Maneuver", vec![named("maneuver")])?;
        xml.open("Event", vec![named("event"), text("priority", "parallel"), text("maximumExecutionCount", "1")])?;
        xml.open("Action", vec![named("action")])?;
        xml.open("PrivateAction", vec![])?;
        xml.open("RoutingAction", vec![])?;
        xml.open("FollowTrajectoryAction", vec![])?;
        xml.open("TrajectoryRef", vec![])?;
        xml.open("Trajectory", vec![named("trajectory"), text("closed", "false")])?;
        xml.open("Shape", vec![])?;
        xml.open("Polyline", vec![])?;
        for v in &vehicle.path {
            let vertex = ("Vertex", vec![float("time", v.time_s)]);
            xml.nested(&[vertex, ("Position", vec![]), world(scenario, vehicle, v.x_m, v.y_m)])?;
        }
        for _ in 0..4 {
            xml.close()?;
        }
        let timing = vec![text("domainAbsoluteRelative", "absolute"), float("scale", 1.0), float("offset", 0.0)];
        xml.nested(&[("TimeReference", vec![]), ("Timing", timing)])?;
        xml.empty("TrajectoryFollowingMode", vec![text("followingMode", "position")])?;
        for _ in 0..4 {
            xml.close()?;
        }
        xml.open("StartTrigger", vec![])?;
        at_time(xml, &format!("{name} start"), 0.0)?;
        for _ in 0..4 {
            xml.close()?;
        }
    }
    xml.open("StartTrigger", vec![])?;
    at_time(xml, "act start", 0.0)?;
    xml.close()?;
    xml.close()?;
    xml.close()
}

/// The condition that the simulation time has reached a value.
fn at_time(xml: &mut Elements, name: &str, time_s: f64) -> Result<()> {
    xml.open("ConditionGroup", vec![])?;
    xml.nested(&[
        ("Condition", vec![text("name", name), float("delay", 0.0), text("conditionEdge", "none")]),
        ("ByValueCondition", vec![]),
        ("SimulationTimeCondition", vec![float("value", time_s), text("rule", "greaterOrEqual")]),
    ])?;
    xml.close()
}

/// Converts a position of a vehicle's centre to that of its reference point.
fn world<'a>(scenario: &Concrete, vehicle: &PlayedVehicle, x_m: f64, y_m: f64) -> Element<'a> {
    let x_m = x_m - vehicle.centre_offset_m();
    let place = vec![float("x", x_m), float("y", scenario.world_y_m(y_m)), float("z", 0.0), float("h", 0.0)];
    ("WorldPosition", place)
}

fn text<'a>(name: &'a str, value: &str) -> Attribute<'a> {
    (name, plain(value).into_owned())
}

fn float(name: &str, value: f64) -> Attribute<'_> {
    (name, number(value))
}

/// A valid identifier: letters, digits and `_`, not starting with a digit.
fn identifier(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if plain.starts_with(|c: char| c.is_ascii_digit()) { format!("_{plain}") } else { plain }
}

/// File name of the index.
const INDEX: &str = "index.csv";

/// One line of the index.
#[derive(Debug, Clone, PartialEq)]
pub struct IndexRow {
    /// File of the scenario.
    pub file: String,
    /// File of the road.
    pub road: String,
    /// Lane key.
    pub lane: String,
}

/// Writes every scenario with its road, and the index, to a folder; replaces an earlier export.
///
/// # Errors
/// As `scenario_file`; [`crate::Error::Io`].
pub fn export_folder(dir: &Path, scenarios: &[Concrete]) -> Result<Vec<IndexRow>> {
    // Everything is built before the first file is written, so that an error leaves the folder unchanged.
    let mut made = Vec::new();
    for (at, scenario) in scenarios.iter().enumerate() {
        let stem = format!("{:03}-{}", at + 1, safe(&scenario.key));
        let row = IndexRow { file: format!("{stem}.xosc"), road: format!("{stem}.xodr"), lane: scenario.key.clone() };
        made.push((scenario_file(scenario, &row.road)?, road_file(&Road::around(scenario))?, row));
    }
    let folder = OutputDir::open(dir, INDEX)?;
    let mut results = folder.results()?;
    // The lane already has its own column.
    let names: Vec<String> = scenarios.first().map_or(Vec::new(), |s| {
        s.properties.iter().map(|(name, _)| name.clone()).filter(|name| name != "lanesweep.lane").collect()
    });
    let mut rows = Vec::new();
    for (text, road, row) in made {
        results.add(&row.road, &road)?;
        results.add(&row.file, &text)?;
        rows.push(row);
    }
    let property = |scenario: &Concrete, name: &String| {
        scenario.properties.iter().find(|(n, _)| n == name).map(|(_, value)| value.clone())
    };
    let table = Table::of(rows.iter().zip(scenarios))
        .column("file", |(row, _)| row.file.as_str())
        .column("road", |(row, _)| row.road.as_str())
        .column("lane", |(row, _)| row.lane.as_str())
        .column("category", |(_, scenario)| scenario.category.key())
        .columns(&names, |name| property_text(name), |(_, scenario), name| property(scenario, name))
        .build();
    results.publish(table.csv().as_bytes())?;
    Ok(rows)
}

/// The column name of a property.
fn property_text(property: &str) -> String {
    property.strip_prefix("lanesweep.").unwrap_or(property).to_owned()
}

/// A lane key as part of a file name that is valid on every system.
fn safe(key: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-') { c } else { '_' };
    let name: String = key.chars().map(plain).take(100).collect();
    name.trim_matches(['.', '_']).to_owned()
}
