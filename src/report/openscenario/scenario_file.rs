//! The scenario file: ASAM OpenSCENARIO XML 1.2, the first revision whose header has properties.
//!
//! Every vehicle except an external ego follows a polyline with one vertex per time step, in simulation time. The
//! heading is always 0: the boxes of a lane are parallel to the road, so vehicles touch at the same time and place as
//! in the lane.
//!
//! A folder of exported scenarios has a scenario file and a road file per lane, and an index.

use std::path::Path;

use super::DATE;
use super::concrete::{Concrete, EgoMotion, PlayedVehicle, Vertex, number};
use super::road::road_file;
use crate::records::PROGRAM;
use lanesweep_support::Result;
use lanesweep_support::plain_text::escape_markup;
use lanesweep_support::run_folder::RunFolder;
use lanesweep_support::table::Table;

/// Name of the parameter for the initial speed of an external ego.
const EGO_SPEED: &str = "ego_speed_mps";

/// Property for an overlap of two vehicles other than the ego: its time, s.
const OTHERS_OVERLAP: &str = "others_overlap_s";

/// Height of every vehicle, m; lanes have no height.
const HEIGHT_M: f64 = 1.5;

/// Builds the scenario file; `road` is the name of the road file in the same folder.
///
/// # Errors
/// As [`Concrete::check`].
fn scenario_file(scenario: &Concrete, road: &str) -> Result<String> {
    scenario.check()?;
    let declared = scenario.parameters.iter().map(|(name, value)| {
        let (name, value) = (identifier(name), number(*value));
        format!("    <ParameterDeclaration name=\"{name}\" parameterType=\"double\" value=\"{value}\"/>\n")
    });
    let synthetic = if scenario.is_synthetic { "SYNTHETIC DATA: " } else { "" };
    let overlap_s = scenario.others_overlap_s().map(number);
    let overlap = overlap_s.as_ref().map_or(String::new(), |time_s| {
        format!(
            "; Other drives through Ahead from {time_s} s on: a player that checks all vehicles reports a collision of \
             these two, which is none of Ego's"
        )
    });
    let description = format!("{synthetic}{} {}{overlap}", scenario.category.label(), scenario.key);
    let own = scenario.properties.iter().map(|(name, value)| (*name, value));
    let properties = own
        .chain(overlap_s.iter().map(|time_s| (OTHERS_OVERLAP, time_s)))
        .map(|(name, value)| format!("      <Property name=\"lanesweep.{name}\" value=\"{}\"/>\n", escaped(value)));
    let skipped = usize::from(scenario.ego == EgoMotion::External);
    let followers = scenario.vehicles.iter().skip(skipped);
    Ok(format!(
        include_str!("../templates/openscenario/scenario.xosc"),
        date = DATE,
        program = PROGRAM,
        description = escaped(&description),
        properties = properties.collect::<String>(),
        declared = declared.collect::<String>(),
        road = escaped(road),
        entities = scenario.vehicles.iter().map(entity).collect::<String>(),
        starts = (0..scenario.vehicles.len()).map(|at| start(scenario, at)).collect::<String>(),
        paths = followers.map(|vehicle| path(scenario, vehicle)).collect::<String>(),
        end = number(scenario.end_s()),
    ))
}

fn entity(vehicle: &PlayedVehicle) -> String {
    format!(
        include_str!("../templates/openscenario/vehicle.xml"),
        name = vehicle.name,
        centre = number(vehicle.centre_offset_m()),
        middle = HEIGHT_M / 2.0,
        height = HEIGHT_M,
        width = number(vehicle.width_m),
        length = number(vehicle.length_m),
        track = number(0.85 * vehicle.width_m),
        // The axles are symmetric about the centre.
        wheelbase = number(2.0 * vehicle.centre_offset_m()),
    )
}

/// The initial position and speed of a vehicle.
fn start(scenario: &Concrete, at: usize) -> String {
    let vehicle = &scenario.vehicles[at];
    let Some(first) = vehicle.path.first() else { return String::new() };
    let is_declared = at == 0 && scenario.parameters.iter().any(|(name, _)| name == EGO_SPEED);
    let is_free = is_declared && scenario.ego == EgoMotion::External;
    format!(
        include_str!("../templates/openscenario/start.xml"),
        name = vehicle.name,
        position = position(scenario, vehicle, first),
        speed = if is_free { format!("${EGO_SPEED}") } else { number(first.v_mps) },
    )
}

/// The path of a vehicle.
fn path(scenario: &Concrete, vehicle: &PlayedVehicle) -> String {
    let vertex = |v: &Vertex| {
        let (time_s, position) = (number(v.time_s), position(scenario, vehicle, v));
        format!("{:30}<Vertex time=\"{time_s}\">{position}</Vertex>\n", "")
    };
    format!(
        include_str!("../templates/openscenario/path.xml"),
        name = vehicle.name,
        vertices = vehicle.path.iter().map(vertex).collect::<String>(),
    )
}

/// The position of a vehicle's reference point.
fn position(scenario: &Concrete, vehicle: &PlayedVehicle, centre: &Vertex) -> String {
    let (x_m, y_m) = (number(centre.x_m - vehicle.centre_offset_m()), number(scenario.world_y_m(centre.y_m)));
    format!("<Position><WorldPosition x=\"{x_m}\" y=\"{y_m}\" z=\"0\" h=\"0\"/></Position>")
}

/// A text as the value of an attribute. A leading `$` would be a parameter.
fn escaped(text: &str) -> String {
    let blank = if text.starts_with('$') { " " } else { "" };
    format!("{blank}{}", escape_markup(text).replace('\n', "&#10;"))
}

/// A valid identifier: letters, digits and `_`, not starting with a digit.
fn identifier(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if plain.starts_with(|c: char| c.is_ascii_digit()) { format!("_{plain}") } else { plain }
}

/// File name of the index, the record of an export.
pub const INDEX: &str = "index.csv";

/// Writes every scenario with its road, and the index, to a folder; replaces an earlier export.
///
/// # Errors
/// As `scenario_file`; [`lanesweep_support::Error::Io`].
pub fn export_folder(dir: &Path, scenarios: &[Concrete]) -> Result<()> {
    // Everything is built before the first file is written, so that an error leaves the folder unchanged.
    let stem = |(at, scenario): (usize, &Concrete)| format!("{:03}-{}", at + 1, safe(&scenario.key));
    let stems: Vec<String> = scenarios.iter().enumerate().map(stem).collect();
    let texts = scenarios.iter().zip(&stems).map(|(scenario, stem)| scenario_file(scenario, &format!("{stem}.xodr")));
    let texts = texts.collect::<Result<Vec<_>>>()?;
    let folder = RunFolder::open(dir, INDEX)?;
    let mut results = folder.results()?;
    for ((scenario, stem), text) in scenarios.iter().zip(&stems).zip(&texts) {
        results.add(&format!("{stem}.xodr"), road_file(scenario).as_bytes())?;
        results.add(&format!("{stem}.xosc"), text.as_bytes())?;
    }
    // All have the same properties.
    let properties = 1..scenarios.first().map_or(1, |scenario| scenario.properties.len());
    let table = Table::of(stems.iter().zip(scenarios))
        .column("file", |(stem, _)| format!("{stem}.xosc"))
        .column("road", |(stem, _)| format!("{stem}.xodr"))
        .column("lane", |(_, scenario)| scenario.key.as_str())
        .column("category", |(_, scenario)| scenario.category.key())
        .columns(properties, |at| scenarios[0].properties[at].0, |(_, of), at| of.properties[at].1.as_str())
        .build();
    results.publish(table.csv().as_bytes())
}

/// A lane key as part of a file name that is valid on every system.
fn safe(key: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-') { c } else { '_' };
    let name: String = key.chars().map(plain).take(100).collect();
    name.trim_matches(['.', '_']).to_owned()
}
