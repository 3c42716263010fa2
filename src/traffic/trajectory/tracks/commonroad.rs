//! CommonRoad XML (2020a): dynamic obstacles with their states, and the boundaries of lanelets.

use std::path::Path;

use quick_xml::XmlVersion;
use quick_xml::events::Event;
use quick_xml::reader::Reader;

use super::raw::{RawFile, RawRecording, RawSample, RawVehicle};
use super::roles::Role;
use crate::support::input_file;
use crate::traffic::trajectory::csv_table::FileChecksum;
use crate::traffic::trajectory::number;
use crate::{Error, Place, Result};

/// Maximum size of a file, bytes: it is held in memory.
const MAX_BYTES: u64 = 256 << 20;
const HELP: &str = "give CommonRoad 2020a (XML); CommonRoad's own tools convert older files";
/// Maximum nesting of elements.
const DEEPEST: usize = 32;

/// Reads the obstacles of a scene as one recording.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for a file that is not well-formed or has another time step than a number.
pub(super) fn read(path: &Path, id: &str) -> Result<RawFile> {
    let not_text = |_| Error::input(Place::file(path), "not UTF-8 text", "save the file as UTF-8");
    let text = String::from_utf8(input_file::read_unpacked(path, MAX_BYTES)?).map_err(not_text)?;
    let mut scene = Scene {
        recording: RawRecording { id: id.to_owned(), has_frames: true, ..RawRecording::default() },
        ..Scene::default()
    };
    let mut reader = Reader::from_str(text.trim_start_matches('\u{feff}'));
    let mut around: Vec<String> = Vec::new();
    loop {
        let at = reader.buffer_position();
        let bad = |problem: String| {
            let row = 1 + text.bytes().take(at as usize).filter(|byte| *byte == b'\n').count() as u64;
            Error::input(Place::file(path).row(row), problem, HELP)
        };
        match reader.read_event().map_err(|error| bad(format!("not well-formed XML: {error}")))? {
            Event::Start(start) => {
                let name = start.name().as_ref().to_owned();
                if around.len() >= DEEPEST {
                    return Err(bad(format!("more than {DEEPEST} elements within one another")));
                }
                for attribute in start.attributes().with_checks(false).flatten() {
                    let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|e| bad(e.to_string()))?;
                    scene.attribute(&name, attribute.key.as_ref(), &value).map_err(&bad)?;
                }
                around.push(name);
            }
            Event::End(_) => {
                if let Some(name) = around.pop() {
                    scene.end(&name);
                }
            }
            Event::Text(piece) => {
                let words = piece.into_inner();
                if !words.trim().is_empty() {
                    scene.text(&around, words.trim()).map_err(bad)?;
                }
            }
            Event::Eof if around.is_empty() => break,
            Event::Eof => return Err(bad("it ends inside an element: the file is truncated".to_owned())),
            _ => (),
        }
    }
    if scene.recording.frame_rate_hz.is_none() {
        let problem = "the root has no `timeStepSize`";
        return Err(Error::input(Place::file(path), problem, HELP));
    }
    let checksum = FileChecksum::of(path)?;
    let rows = scene.recording.vehicles.iter().map(|vehicle| vehicle.samples.len() as u64).sum();
    let elements = [
        (Role::Vehicle, "dynamicObstacle"),
        (Role::Frame, "time"),
        (Role::X, "x"),
        (Role::Y, "y"),
        (Role::Heading, "orientation"),
        (Role::Speed, "velocity"),
        (Role::Acceleration, "acceleration"),
        (Role::Class, "type"),
        (Role::Length, "length"),
        (Role::Width, "width"),
    ];
    let roles = elements.map(|(role, name)| (role, name.to_owned())).to_vec();
    Ok(RawFile { recordings: vec![scene.recording], checksums: vec![checksum], rows, roles, unused: Vec::new() })
}

#[derive(Default)]
struct Scene {
    recording: RawRecording,
    vehicle: RawVehicle,
    sample: Option<RawSample>,
    boundary: Vec<[f64; 2]>,
    point: [f64; 2],
}

impl Scene {
    fn attribute(&mut self, element: &str, name: &str, value: &str) -> std::result::Result<(), String> {
        match (element, name) {
            ("commonRoad", "commonRoadVersion") if ["2017", "2018"].iter().any(|year| value.starts_with(year)) => {
                return Err(format!("the format is CommonRoad {value}, whose obstacles and lanes have other elements"));
            }
            ("commonRoad", "timeStepSize") => {
                let step_s = value.parse::<f64>().ok().filter(|step| (1e-4..=10.0).contains(step));
                let step_s = step_s.ok_or_else(|| format!("`timeStepSize` {value} is no time step"))?;
                self.recording.frame_rate_hz = Some(1.0 / step_s);
            }
            ("dynamicObstacle", "id") => self.vehicle = RawVehicle { key: value.to_owned(), ..RawVehicle::default() },
            _ => (),
        }
        Ok(())
    }

    fn text(&mut self, around: &[String], words: &str) -> std::result::Result<(), String> {
        let inside = |name: &str| around.iter().any(|element| element == name);
        let number = || {
            let value = number::real(words.as_bytes()).filter(|value| value.abs() <= number::REAL_LIMIT);
            value.ok_or_else(|| format!("`{}` is not a finite number", words.chars().take(40).collect::<String>()))
        };
        let [.., parent, element] = around else { return Ok(()) };
        if inside("lanelet") {
            match element.as_str() {
                "x" => self.point[0] = number()?,
                "y" => self.point[1] = number()?,
                _ => (),
            }
            return Ok(());
        }
        if !inside("dynamicObstacle") || inside("occupancySet") {
            return Ok(());
        }
        match (parent.as_str(), element.as_str()) {
            ("dynamicObstacle", "type") => self.vehicle.class = Some(words.to_owned()),
            ("rectangle", "length") => self.vehicle.lengths_m = vec![number()?],
            ("rectangle", "width") => self.vehicle.widths_m = vec![number()?],
            _ if inside("initialState") || inside("state") => {
                let sample = self.sample.get_or_insert_with(RawSample::unknown);
                match (parent.as_str(), element.as_str()) {
                    ("point", "x") => sample.xy_m[0] = number()?,
                    ("point", "y") => sample.xy_m[1] = number()?,
                    ("orientation", "exact") => {
                        let angle = number()?;
                        sample.heading = [libm::cos(angle), libm::sin(angle)];
                    }
                    ("time", "exact") => sample.at = number()?,
                    ("velocity", "exact") => sample.speed_mps = number()?,
                    ("acceleration", "exact") => sample.acceleration_mps2 = number()?,
                    _ => (),
                }
            }
            _ => (),
        }
        Ok(())
    }

    fn end(&mut self, name: &str) {
        match name {
            "point" if self.sample.is_none() => self.boundary.push(self.point),
            "leftBound" | "rightBound" => self.recording.boundaries.push(std::mem::take(&mut self.boundary)),
            "initialState" | "state" => {
                if let Some(sample) = self.sample.take() {
                    if sample.at.is_finite() && sample.xy_m.iter().all(|value| value.is_finite()) {
                        self.vehicle.samples.push(&sample);
                    } else {
                        self.recording.incomplete += 1;
                    }
                }
                self.boundary.clear();
            }
            "dynamicObstacle" => self.recording.vehicles.push(std::mem::take(&mut self.vehicle)),
            _ => (),
        }
    }
}
