//! The JSON Schemas of a configuration, from the settings types, and of a profile, from the shipped profiles, each of
//! which has every key.

use serde_json::{Map, Value, json};

use super::Settings;
use lanesweep_model::assumptions::Constant;
use lanesweep_model::driver::Bound;
use lanesweep_model::profile::Profile;
use lanesweep_support::ranges;
use lanesweep_support::{Error, Result};

/// JSON Schema (draft 2020-12) of a configuration file.
pub(crate) fn settings_schema() -> Value {
    let mut schema = ranges::schema_of::<Settings>();
    for_toml(&mut schema);
    // The defaults of the tables are those of their keys.
    if let Some(tables) = schema["properties"].as_object_mut() {
        tables.values_mut().for_each(without_table_defaults);
    }
    schema
}

/// Removes what TOML cannot express, and what only readers of the source understand.
fn for_toml(schema: &mut Value) {
    match schema {
        Value::Object(object) => {
            if let Some(Value::Array(types)) = object.get("type")
                && let Some(one) = types.iter().find(|kind| *kind != "null").cloned()
            {
                object.insert("type".to_owned(), one);
            }
            if object.get("default").is_some_and(Value::is_null) {
                object.remove("default");
            }
            // The integer sizes of the program are of no use to authors of files.
            object.remove("format");
            if let Some(Value::String(text)) = object.get_mut("description") {
                *text = plain(text);
            }
            object.values_mut().for_each(for_toml);
        }
        Value::Array(items) => items.iter_mut().for_each(for_toml),
        _ => (),
    }
}

/// The text in one line, without the links of the documentation.
fn plain(text: &str) -> String {
    text.replace("[`", "`").replace("`]", "`").split_whitespace().collect::<Vec<_>>().join(" ")
}

fn without_table_defaults(table: &mut Value) {
    let Value::Object(object) = table else { return };
    if object.contains_key("properties") {
        object.remove("default");
    }
    let inner = object.get_mut("properties").and_then(Value::as_object_mut).into_iter().flat_map(Map::values_mut);
    inner.for_each(without_table_defaults);
}

/// JSON Schema (draft 2020-12) of a profile file. The values of options in the shipped profiles are its examples.
///
/// # Errors
/// None for the shipped profiles.
pub(crate) fn profile_schema() -> Result<Value> {
    let profiles = Profile::names().map(Profile::load).collect::<Result<Vec<_>>>()?;
    let bounds: Vec<(String, Bound)> =
        profiles.iter().flat_map(Profile::bounds).map(|(key, _, bound)| (key, bound)).collect();
    let unwritten = |e: serde_json::Error| Error::Internal(format!("a profile cannot be written: {e}"));
    let values =
        profiles.iter().map(serde_json::to_value).collect::<std::result::Result<Vec<_>, _>>().map_err(unwritten)?;
    let files = Profile::files().map(toml::from_str::<Value>).collect::<std::result::Result<Vec<_>, _>>();
    let files = files.map_err(|e| Error::Internal(format!("a profile that ships is no TOML: {e}")))?;
    let mut schema = profile_part(&values.iter().collect::<Vec<_>>(), &files.iter().collect::<Vec<_>>(), "", &bounds);
    schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    schema["title"] = json!("lanesweep profile");
    for Constant { key, meaning, .. } in Constant::all() {
        let path = format!("/properties/{}", key.replace('.', "/properties/"));
        let Some(property) = schema.pointer_mut(&path) else { continue };
        let range = property.get("description").and_then(Value::as_str).map(|range| format!("; {range}"));
        property["description"] = json!(meaning + &range.unwrap_or_default());
    }
    Ok(schema)
}

/// `values` are a key's values in the shipped profiles, `files` those that their files contain. A key missing in a file
/// (of a model with defaults) is not required.
fn profile_part(values: &[&Value], files: &[&Value], name: &str, bounds: &[(String, Bound)]) -> Value {
    match values {
        [Value::Object(first), ..] => {
            let property = |key: &String| {
                let inner: Vec<&Value> =
                    values.iter().filter_map(|value| value.get(key)).filter(|value| !value.is_null()).collect();
                let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                let written: Vec<&Value> = files.iter().filter_map(|file| file.get(key)).collect();
                (key.clone(), profile_part(&inner, &written, &name, bounds))
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
                let [min, max] = bound.ends();
                (schema["minimum"], schema["maximum"]) = (json!(min), json!(max));
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
