//! The JSON Schema of a configuration, from the types.

use serde_json::{Map, Value};

use super::Settings;
use crate::support::ranges;

/// JSON Schema (draft 2020-12) of a configuration file.
pub fn settings_schema() -> Value {
    let mut schema = ranges::schema_of::<Settings>();
    for_toml(&mut schema);
    // The tables' defaults are those of their keys.
    if let Some(tables) = schema["properties"].as_object_mut() {
        tables.values_mut().for_each(without_table_defaults);
    }
    schema
}

/// What TOML has no word for, and what only a reader of the source can follow, goes.
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
            // Sizes of the program's own integers say nothing to whoever writes a file.
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

/// Without the links of the documentation, in one line.
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
