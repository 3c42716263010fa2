//! Reads scenarios written by `export xosc`: the paths of the other vehicles become series, and the ego gets its
//! initial speed. Scenarios of other tools are refused, because their actions would have to be simulated.

use std::path::Path;

use super::xml_at::At;
use super::xml_tree::{Node, read_tree};
use crate::scenario::{Category, Ego, Other, Scenario, Side};
use crate::{Error, Place, Result};

const OURS: &str = "give a file that `lanesweep export xosc` wrote; scenarios of other tools are not read";

/// One vehicle of a file.
struct Read {
    length_m: f64,
    width_m: f64,
    speed_mps: f64,
    /// Longitudinal and lateral position of the centre, m, world coordinates; the start first.
    path: Vec<(f64, f64)>,
}

/// Reads a scenario as if it had been recorded: samples at the lane's time step, initial gap and speeds.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] with file, line and element for a file that this program did not write.
pub fn read_scenario(path: &Path) -> Result<Scenario> {
    let root = read_tree(path)?;
    let root = At { node: &root, path };
    let header = root.only("FileHeader").map_err(|_| Error::input(Place::file(path), "it is not a scenario", OURS))?;
    if !header.text("author")?.starts_with("lanesweep ") {
        return Err(header.wrong(format!("the author is `{}`", header.text("author")?), OURS));
    }
    let properties = header.only("Properties")?;
    let property = |name: &str| -> Result<&str> {
        let is = |child: &At| child.text("name").is_ok_and(|n| n.strip_prefix("lanesweep.") == Some(name));
        let found = properties.all().find(is);
        found.ok_or_else(|| properties.wrong(format!("the property lanesweep.{name} is missing"), OURS))?.text("value")
    };
    let described = header.text("description")?.trim_start_matches("SYNTHETIC DATA: ");
    let category = described.split(' ').next().and_then(Category::parse);
    let category = category.ok_or_else(|| header.wrong("its description names no kind of scenario", OURS))?;
    let dt_s = property("dt_s")?.parse::<f64>().ok().filter(|dt| *dt > 0.0 && *dt <= 1.0);
    let dt_s = dt_s.ok_or_else(|| properties.wrong("lanesweep.dt_s is not a time step", OURS))?;
    let vehicles = |name| vehicle(root, name, dt_s);
    let (ego, target) = (vehicles("Ego")?, vehicles("Other")?);
    let ahead = if category == Category::CutOut { Some(vehicles("Ahead")?) } else { None };
    let gap =
        |behind: &Read, front: &Read| front.path[0].0 - behind.path[0].0 - (behind.length_m + front.length_m) / 2.0;
    // The scenario's positions are positive on the side the vehicle comes from or leaves to.
    let first_y = target.path.iter().find(|(_, y)| *y != 0.0).map_or(0.0, |(_, y)| *y);
    let side = if first_y < 0.0 { Side::Right } else { Side::Left };
    let other = |read: &Read| {
        let steps = read.path.windows(2).map(|pair| ((pair[1].0 - pair[0].0) / dt_s * 1e9).round() / 1e9);
        Other {
            length: read.length_m,
            width: read.width_m,
            v: std::iter::once(read.speed_mps).chain(steps).collect(),
            y: read.path.iter().map(|(_, y)| side.sign() * y + 0.0).collect(),
        }
    };
    let id = property("lane")?.to_owned();
    Ok(Scenario {
        id,
        category,
        recording: String::new(),
        ego_id: 0,
        target_id: 0,
        lead_id: None,
        frame0: 0,
        frame1: target.path.len() as i64 - 1,
        fps: 1.0 / dt_s,
        kept: true,
        reason: String::new(),
        ego: Ego { v0: ego.speed_mps, length: ego.length_m, width: ego.width_m },
        lane_width: 3.5,
        side,
        gap0: Some(gap(&ego, &target)),
        thw0: None,
        lead_gap: ahead.as_ref().map(|ahead| gap(&target, ahead)),
        lead: ahead.as_ref().map(other),
        target: other(&target),
        peak_decel: None,
        truncated_start: None,
        end_cause: None,
        frame_switch: None,
        tag_frames: None,
        synthetic: header.text("description")?.starts_with("SYNTHETIC DATA"),
        replays: Vec::new(),
    })
}

/// A vehicle's size, start and path.
fn vehicle(root: At, name: &str, dt_s: f64) -> Result<Read> {
    let of = |child: &At, key: &str| child.text(key).is_ok_and(|value| value == name);
    let entities = root.only("Entities")?;
    let entity = entities.all().find(|child| of(child, "name"));
    let entity = entity.ok_or_else(|| entities.wrong(format!("there is no vehicle `{name}`"), OURS))?;
    let bounding = entity.only("Vehicle")?.only("BoundingBox")?;
    let (centre_m, size) = (bounding.only("Center")?.number("x")?, bounding.only("Dimensions")?);
    let storyboard = root.only("Storyboard")?;
    let init = storyboard.only("Init")?.only("Actions")?;
    let start = init.all().find(|child| of(child, "entityRef"));
    let start = start.ok_or_else(|| init.wrong(format!("`{name}` has no start"), OURS))?;
    let position = |at: At| -> Result<(f64, f64)> { Ok((at.number("x")? + centre_m, at.number("y")?)) };
    let mut path = Vec::new();
    for group in below(storyboard, "ManeuverGroup") {
        if !below(group, "EntityRef").iter().any(|child| of(child, "entityRef")) {
            continue;
        }
        for vertex in below(group, "Vertex") {
            let expected_s = path.len() as f64 * dt_s;
            if (vertex.number("time")? - expected_s).abs() > 1e-6 {
                let problem = format!("the time is {}, after {} steps of {dt_s} s", vertex.text("time")?, path.len());
                return Err(vertex.wrong(problem, "every step needs its vertex: export the scenario again"));
            }
            path.push(position(vertex.only("Position")?.only("WorldPosition")?)?);
        }
    }
    let first = below(start, "WorldPosition");
    let first = first.first().ok_or_else(|| start.wrong(format!("`{name}` has no position"), OURS))?;
    if path.is_empty() {
        path.push(position(*first)?);
    }
    let speed = below(start, "AbsoluteTargetSpeed");
    let speed = speed.first().ok_or_else(|| start.wrong(format!("`{name}` has no speed"), OURS))?;
    let speed_mps = match speed.text("value") {
        Ok(_) => speed.number("value")?,
        // For an external ego: a parameter of the file.
        Err(_) => declared(root, "ego_speed_mps")?,
    };
    let finite = |value: f64| value.is_finite().then_some(value).ok_or_else(|| entity.wrong("not finite", OURS));
    Ok(Read {
        length_m: finite(size.number("length")?)?,
        width_m: finite(size.number("width")?)?,
        speed_mps: finite(speed_mps)?.max(0.0),
        path,
    })
}

/// The value of a declared parameter.
fn declared(root: At, name: &str) -> Result<f64> {
    let list = root.only("ParameterDeclarations")?;
    let found = list.all().find(|child| child.text("name").is_ok_and(|n| n == name));
    found.ok_or_else(|| list.wrong(format!("the parameter `{name}` is missing"), OURS))?.number("value")
}

/// All descendants of this name, in the file's order.
fn below<'a>(at: At<'a>, name: &str) -> Vec<At<'a>> {
    fn collect<'a>(node: &'a Node, path: &'a Path, name: &str, found: &mut Vec<At<'a>>) {
        for child in &node.children {
            if child.name == name {
                found.push(At { node: child, path });
            }
            collect(child, path, name, found);
        }
    }
    let mut found = Vec::new();
    collect(at.node, at.path, name, &mut found);
    found
}
