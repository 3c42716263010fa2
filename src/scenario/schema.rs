//! The fields of a scenario line and what each holds: used to name the field that a line was refused for
//! (`serde_json` says what is wrong and at which character, but not in which field of a long line).

use serde_json::Value;

/// Whether a field must be there.
#[derive(Clone, Copy, PartialEq)]
enum Presence {
    Required,
    /// May be absent; if there, it has a value.
    Defaulted,
    /// May be absent or null.
    Optional,
}

/// What a field holds.
#[derive(Clone, Copy)]
enum Content {
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

type Field = (&'static str, Presence, Content);

use Content::{Frame, Number, Object, OneOf, Series, Text, TwoFrames, VehicleId, YesNo};
use Presence::{Defaulted, Optional, Required};

const FIELDS: &[Field] = &[
    ("id", Required, Text),
    ("category", Required, OneOf(&["cut_in", "cut_out", "lvd"])),
    ("recording", Defaulted, Text),
    ("ego_id", Defaulted, VehicleId),
    ("target_id", Defaulted, VehicleId),
    ("lead_id", Optional, VehicleId),
    ("frame0", Defaulted, Frame),
    ("frame1", Defaulted, Frame),
    ("fps", Required, Number),
    ("kept", Defaulted, YesNo),
    ("reason", Defaulted, Text),
    ("ego", Required, Object(EGO)),
    ("lane_width", Defaulted, Number),
    ("side", Required, OneOf(&["left", "right"])),
    ("target", Required, Object(OTHER)),
    ("lead", Optional, Object(OTHER)),
    ("thw0", Optional, Number),
    ("gap0", Optional, Number),
    ("D", Optional, Number),
    ("peak_decel", Optional, Number),
    ("truncated_start", Optional, YesNo),
    ("end_cause", Optional, Text),
    ("frame_switch", Optional, Frame),
    ("tag_frames", Optional, TwoFrames),
];

const EGO: &[Field] = &[("v0", Required, Number), ("length", Required, Number), ("width", Required, Number)];

const OTHER: &[Field] =
    &[("length", Required, Number), ("width", Required, Number), ("v", Required, Series), ("y", Required, Series)];

/// The first field of a line that is not what it must be, and what is wrong with it.
pub(super) fn wrong_field(line: &Value) -> Option<(String, String)> {
    line.is_object().then(|| wrong_in(line, "", FIELDS)).flatten()
}

fn wrong_in(object: &Value, prefix: &str, fields: &[Field]) -> Option<(String, String)> {
    fields.iter().find_map(|&(name, presence, content)| {
        let field = format!("{prefix}{name}");
        match (object.get(name), presence) {
            (None, Required) => Some((field, "missing".to_owned())),
            (None, _) | (Some(Value::Null), Optional) => None,
            (Some(value), _) => wrong_content(value, field, content),
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

    /// A field added to the scenario must be added here too.
    #[test]
    fn every_written_field_is_known() {
        let line = r#"{"id": "a", "category": "lvd", "fps": 25.0, "side": "left", "ego": {"v0": 1.0, "length": 4.0,
            "width": 2.0}, "target": {"length": 4.0, "width": 2.0, "v": [1.0], "y": [0.0]}, "truncated_start": true,
            "end_cause": "leader", "frame_switch": 1, "tag_frames": [1, 2]}"#;
        let scenario: Scenario = serde_json::from_str(line).unwrap();
        let Ok(Value::Object(written)) = serde_json::to_value(scenario) else { panic!("not an object") };
        let mut written: Vec<&str> = written.keys().map(String::as_str).collect();
        let mut known: Vec<&str> = FIELDS.iter().map(|f| f.0).collect();
        written.sort_unstable();
        known.sort_unstable();
        assert_eq!(written, known);
    }
}
