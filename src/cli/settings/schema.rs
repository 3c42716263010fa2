//! The JSON Schemas of a configuration and of a profile, from their types.

use serde_json::{Map, Value, json};

use super::Settings;
use lanesweep_model::assumptions::Constant;
use lanesweep_model::profile::Profile;
use lanesweep_support::Result;
use lanesweep_support::ranges;

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

/// JSON Schema (draft 2020-12) of a profile file, with the meaning and the range of every constant.
///
/// # Errors
/// None for the shipped profiles.
pub(crate) fn profile_schema() -> Result<Value> {
    let mut schema = ranges::schema_of::<Profile>();
    for_toml(&mut schema);
    schema["title"] = json!("lanesweep profile");
    let place = |key: &str| format!("/properties/{}", key.replace('.', "/properties/"));
    for Constant { key, meaning, .. } in Constant::all() {
        if let Some(property) = schema.pointer_mut(&place(&key)) {
            property["description"] = json!(meaning);
        }
    }
    for (key, _, bound) in Profile::load("paper")?.bounds() {
        let Some(property) = schema.pointer_mut(&place(&key)) else { continue };
        let meaning = property["description"].as_str().unwrap_or_default();
        property["description"] = json!(format!("{meaning}; {bound}"));
        let [min, max] = bound.ends();
        (property["minimum"], property["maximum"]) = (json!(min), json!(max));
    }
    Ok(schema)
}
