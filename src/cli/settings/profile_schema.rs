//! The JSON Schema of a profile, from the profiles that ship: every key is there in each of them.

use serde_json::{Map, Value, json};

use crate::model::driver::Bound;
use crate::model::profile::Profile;
use crate::{Error, Result};

/// JSON Schema (draft 2020-12) of a profile file. Names of options have the values of the profiles that ship as examples.
///
/// # Errors
/// None for what this program is built with.
pub fn profile_schema() -> Result<Value> {
    let profiles = Profile::names().map(Profile::load).collect::<Result<Vec<_>>>()?;
    let bounds: Vec<(String, Bound)> =
        profiles.iter().flat_map(Profile::bounds).map(|(key, _, bound)| (key, bound)).collect();
    let unwritten = |e: serde_json::Error| Error::Internal(format!("a profile cannot be written: {e}"));
    let values =
        profiles.iter().map(serde_json::to_value).collect::<std::result::Result<Vec<_>, _>>().map_err(unwritten)?;
    let files = Profile::files().map(toml::from_str::<Value>).collect::<std::result::Result<Vec<_>, _>>();
    let files = files.map_err(|e| Error::Internal(format!("a profile that ships is no TOML: {e}")))?;
    let mut schema = of(&values.iter().collect::<Vec<_>>(), &files.iter().collect::<Vec<_>>(), "", &bounds);
    schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    schema["title"] = json!("lanesweep profile");
    Ok(schema)
}

/// `values` are a key's values in the profiles that ship; `files` the same as their files have them: a key that they leave
/// out (of a model with defaults) is not required.
fn of(values: &[&Value], files: &[&Value], name: &str, bounds: &[(String, Bound)]) -> Value {
    match values {
        [Value::Object(first), ..] => {
            let property = |key: &String| {
                let inner: Vec<&Value> =
                    values.iter().filter_map(|value| value.get(key)).filter(|value| !value.is_null()).collect();
                let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                let written: Vec<&Value> = files.iter().filter_map(|file| file.get(key)).collect();
                (key.clone(), of(&inner, &written, &name, bounds))
            };
            let is_written = |key: &&String| !files.is_empty() && files.iter().all(|file| file.get(key).is_some());
            let properties: Map<String, Value> = first.keys().map(property).collect();
            let required: Vec<&String> = first.keys().filter(is_written).collect();
            json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
        }
        [Value::Array(_), ..] => json!({ "type": "array", "items": { "type": "string" } }),
        [first, ..] => {
            let mut schema = json!({ "type": match first {
                Value::Bool(_) => "boolean",
                Value::Number(n) if n.is_f64() => "number",
                Value::Number(_) => "integer",
                _ => "string",
            }});
            if let Some((_, bound)) = bounds.iter().find(|(key, _)| key == name) {
                let [least, most] = bound.ends();
                (schema["minimum"], schema["maximum"]) = (json!(least), json!(most));
                schema["description"] = json!(bound.to_string());
            }
            let mut examples: Vec<&Value> = Vec::new();
            for value in values {
                if !examples.contains(value) {
                    examples.push(value);
                }
            }
            if first.is_string() {
                schema["examples"] = json!(examples);
            }
            schema
        }
        [] => json!({}),
    }
}
