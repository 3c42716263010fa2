//! The fields of a scenario and their types. They name the field for which a line was refused (`serde_json` gives the
//! character, but not the field), and they are the columns of tables.

use serde_json::Value;

/// Whether a field is required.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Presence {
    Required,
    /// May be absent; if present, it has a value.
    Defaulted,
    /// May be absent or null.
    Optional,
}

/// Type of a field.
#[derive(Clone, Copy)]
pub(super) enum Content {
    Text,
    OneOf(&'static [&'static str]),
    Number,
    /// A vehicle's number.
    VehicleId,
    Frame,
    TwoFrames,
    YesNo,
    Series,
    Object(&'static [Field]),
}

/// A field, with the facts that a user of a table needs.
pub(super) struct Field {
    pub name: &'static str,
    pub presence: Presence,
    pub content: Content,
    /// Empty for a field that is not numeric.
    pub unit: &'static str,
    pub about: &'static str,
}

use Content::{Frame, Number, Object, OneOf, Series, Text, TwoFrames, VehicleId, YesNo};
use Presence::{Defaulted, Optional, Required};

const fn field(
    name: &'static str,
    presence: Presence,
    content: Content,
    unit: &'static str,
    about: &'static str,
) -> Field {
    Field { name, presence, content, unit, about }
}

const CATEGORIES: Content = OneOf(&["cut_in", "cut_out", "lvd"]);

#[rustfmt::skip] // a table: one line per field
pub(super) const FIELDS: &[Field] = &[
    field("id", Required, Text, "", "Key of the scenario, of its own in the file."),
    field("category", Required, CATEGORIES, "", "Kind of scenario: cut_in, cut_out or lvd (leader decelerates)."),
    field("recording", Defaulted, Text, "", "Recording it was found in."),
    field("ego_id", Defaulted, VehicleId, "1", "Ego vehicle in the recording."),
    field("target_id", Defaulted, VehicleId, "1", "Cutter, cutting-out vehicle or leader in the recording."),
    field("lead_id", Optional, VehicleId, "1", "Cut-out: the vehicle ahead of the target in the recording."),
    field("frame0", Defaulted, Frame, "1", "First frame of the series in the recording."),
    field("frame1", Defaulted, Frame, "1", "Last frame of the series in the recording."),
    field("fps", Required, Number, "Hz", "Samples per second of the series."),
    field("kept", Defaulted, YesNo, "", "Passed the filters of its category; others are not simulated."),
    field("reason", Defaulted, Text, "", "Why it was kept or not."),
    field("ego", Required, Object(EGO), "", ""),
    field("lane_width", Defaulted, Number, "m", "Width of the ego's lane."),
    field("side", Required, OneOf(&["left", "right"]), "", "Where the target comes from or leaves to."),
    field("target", Required, Object(OTHER), "", ""),
    field("lead", Optional, Object(OTHER), "", ""),
    field("thw0", Optional, Number, "s", "Observed time headway at the start, bumper to bumper."),
    field("gap0", Optional, Number, "m", "Observed gap at the start, bumper to bumper."),
    field("D", Optional, Number, "m", "Cut-out: gap from the target to the vehicle ahead of it at the start."),
    field("peak_decel", Optional, Number, "m/s²", "Largest recorded deceleration of the target."),
    field("truncated_start", Optional, YesNo, "", "The lane change began before the ego's data."),
    field("end_cause", Optional, Text, "", "What ended the scenario: lc_end, leader, ego_lane, data_end."),
    field("frame_switch", Optional, Frame, "1", "First frame in which the target is, or is no longer, the leader."),
    field("tag_frames", Optional, TwoFrames, "1", "LVD: first frame with the tags and first frame without."),
    field("synthetic", Defaulted, YesNo, "", "Made up by the program: no statement about real traffic."),
];

#[rustfmt::skip]
const EGO: &[Field] = &[
    field("v0", Required, Number, "m/s", "Speed of the ego at the start."),
    field("length", Required, Number, "m", "Length of the ego."),
    field("width", Required, Number, "m", "Width of the ego."),
];

#[rustfmt::skip]
const OTHER: &[Field] = &[
    field("length", Required, Number, "m", "Length of the vehicle."),
    field("width", Required, Number, "m", "Width of the vehicle."),
    field("v", Required, Series, "m/s", "Speed along the road, one value per sample."),
    field("y", Required, Series, "m", "Lateral position from the middle of the ego's lane, > 0 on `side`."),
];

/// The first invalid field of a line, and its problem.
pub(super) fn wrong_field(line: &Value) -> Option<(String, String)> {
    line.is_object().then(|| wrong_in(line, "", FIELDS)).flatten()
}

fn wrong_in(object: &Value, prefix: &str, fields: &[Field]) -> Option<(String, String)> {
    fields.iter().find_map(|of| {
        let field = format!("{prefix}{}", of.name);
        match (object.get(of.name), of.presence) {
            (None, Required) => Some((field, "missing".to_owned())),
            (None, _) | (Some(Value::Null), Optional) => None,
            (Some(value), _) => wrong_content(value, field, of.content),
        }
    })
}

fn wrong_content(value: &Value, field: String, content: Content) -> Option<(String, String)> {
    let expected = match content {
        Text if !value.is_string() => "a text".to_owned(),
        OneOf(names) if !value.as_str().is_some_and(|text| names.contains(&text)) => {
            format!("one of {}", names.iter().map(|n| format!("\"{n}\"")).collect::<Vec<_>>().join(", "))
        }
        Number if !value.is_number() => "a number".to_owned(),
        VehicleId if value.as_u64().is_none_or(|id| id > u64::from(u32::MAX)) => {
            "a vehicle's number (whole, at least 0)".to_owned()
        }
        Frame if !value.is_i64() => "a frame (a whole number)".to_owned(),
        TwoFrames if !value.as_array().is_some_and(|a| a.len() == 2 && a.iter().all(Value::is_i64)) => {
            "two frames in brackets".to_owned()
        }
        YesNo if !value.is_boolean() => "true or false".to_owned(),
        Series => match value.as_array() {
            None => "a series of numbers in brackets".to_owned(),
            Some(values) => {
                let (k, value) = values.iter().enumerate().find(|(_, x)| !x.is_number())?;
                return Some((format!("{field}[{k}]"), format!("is {value}; expected a number")));
            }
        },
        Object(_) if !value.is_object() => "an object".to_owned(),
        Object(fields) => return wrong_in(value, &format!("{field}."), fields),
        _ => return None,
    };
    let shown = value.to_string();
    let shown = if shown.chars().count() > 40 { shown.chars().take(40).collect::<String>() + "…" } else { shown };
    Some((field, format!("is {shown}; expected {expected}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    /// A field added to [`Scenario`](super::Scenario) must be added here too.
    #[test]
    fn every_written_field_is_known() {
        let line = r#"{"id": "a", "category": "lvd", "fps": 25.0, "side": "left", "ego": {"v0": 1.0, "length": 4.0,
            "width": 2.0}, "target": {"length": 4.0, "width": 2.0, "v": [1.0], "y": [0.0]}, "truncated_start": true,
            "end_cause": "leader", "frame_switch": 1, "tag_frames": [1, 2], "synthetic": true}"#;
        let scenario: Scenario = serde_json::from_str(line).unwrap();
        let Ok(Value::Object(written)) = serde_json::to_value(scenario) else { panic!("not an object") };
        let mut written: Vec<&str> = written.keys().map(String::as_str).collect();
        let mut known: Vec<&str> = FIELDS.iter().map(|f| f.name).collect();
        written.sort_unstable();
        known.sort_unstable();
        assert_eq!(written, known);
    }
}
