//! A first preset for a table that no preset knows, from the names of its columns.

use std::fmt::Write as _;
use std::path::Path;

use super::columns_of;
use super::preset::Preset;
use super::roles::{Role, units};
use super::rows::letters;
use crate::Result;
use crate::support::files::file_name;
use crate::support::input_file::unpacked;

/// Units, and what names of columns say for them.
const UNITS: [(&str, &[&str]); 8] = [
    ("km/h", &["km/h", "kmh", "kph"]),
    ("mph", &["mph"]),
    ("ft/s", &["ft/s"]),
    ("ft", &["feet", "_ft", "[ft]"]),
    ("cm", &["_cm", "[cm]", "(cm)"]),
    ("mm", &["_mm", "[mm]", "(mm)"]),
    ("ms", &["_ms"]),
    ("rad", &["rad"]),
];

/// The text of a preset with the columns whose names tell what they are. What no name tells is a question, `"?"`: its user
/// answers it before the preset can be read.
///
/// # Errors
/// Those of the file; [`crate::Error::Input`] for a file whose format is unknown.
pub fn draft(path: &Path) -> Result<String> {
    let (header, format) = columns_of(path)?;
    let generic = Preset::load("generic")?;
    let name = file_name(path);
    let stem = unpacked(&name).rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem);
    let mut text = format!(
        "# A first preset for {}. Answer each \"?\" and check every line; the chapter on tracks explains the keys.\n\
         name = {}\ntitle = {}\nformat = {}\n\
         # Point that x and y describe: centre, front, rear, corner.\nreference = \"?\"\n",
        quoted(&name),
        quoted(stem),
        quoted(&format!("tracks like {stem}")),
        serde_json::json!(format)
    );
    let guesses: Vec<[String; 3]> = header.iter().map(|header| guesses(header)).collect();
    let mut used: Vec<&str> = Vec::new();
    let mut columns = String::new();
    let mut missing: Vec<&str> = Vec::new();
    for role in Role::ALL {
        let Some(column) = generic.columns.get(&role) else { continue };
        let find = |name: &String| {
            let name = letters(name);
            guesses.iter().position(|guesses| guesses.contains(&name)).map(|at| &header[at])
        };
        match column.names().iter().find_map(find) {
            Some(header) if !used.contains(&header.as_str()) => {
                used.push(header);
                let lower = header.to_lowercase();
                let fits = |unit: &str| units(role.dimension()).iter().any(|(known, _)| *known == unit);
                let says =
                    |(unit, signs): &&(&str, &[&str])| fits(unit) && signs.iter().any(|sign| lower.contains(sign));
                let unit = UNITS.iter().find(says);
                let name = quoted(header);
                let _ = match unit {
                    Some((unit, _)) => writeln!(columns, "{} = {{ name = {name}, unit = {unit:?} }}", role.key()),
                    None => writeln!(columns, "{} = {name}", role.key()),
                };
            }
            _ => missing.push(role.key()),
        }
    }
    if columns.contains("frame =") && !columns.contains("time =") {
        text.push_str(
            "# Frames per second: frames have no time, and nothing in the file tells it.\nframe_rate_hz = \"?\"\n",
        );
    }
    text.push_str("# Texts that stand for no value, in any column.\nnone = [\"\", \"NA\"]\n");
    text.push_str("\n[axes]\n# Side of +x on which +y lies: left, or right in images.\ny = \"?\"\n");
    let _ = write!(text, "\n[columns]\n{columns}");
    let has_time = columns.contains("time =") || columns.contains("frame =");
    for key in ["vehicle", "time", "x", "y"] {
        if if key == "time" { !has_time } else { missing.contains(&key) } {
            let or = if key == "time" { ", or name `frame` instead" } else { "" };
            let _ = writeln!(text, "{key} = \"?\"  # no usual name was recognized: name the column{or}");
        }
    }
    let unused: Vec<String> =
        header.iter().filter(|header| !used.contains(&header.as_str())).map(|name| quoted(name)).collect();
    if !unused.is_empty() {
        let _ = writeln!(text, "# Not used: {}", unused.join(", "));
    }
    let others: Vec<&str> =
        Role::ALL.iter().map(|role| role.key()).filter(|key| !columns.contains(&format!("{key} ="))).collect();
    let _ = writeln!(text, "# Other roles: {}", others.join(", "));
    let _ = writeln!(
        text,
        "# With a unit: speed = {{ name = \"Speed\", unit = \"km/h\" }}; m, ft, cm, mm; m/s, km/h, mph; deg, rad; s, ms, ns, date"
    );
    let words = |list: &[String]| list.iter().map(|word| format!("{word:?}")).collect::<Vec<_>>().join(", ");
    let _ = write!(
        text,
        "\n[classes]\n# How the texts of lorries, and of what is left out, begin; without a class, lorries are 7 m and longer.\n\
         truck = [{}]\nignored = [{}]\n",
        words(&generic.classes.truck),
        words(&generic.classes.ignored)
    );
    Ok(text)
}

/// A text between quotation marks as TOML has it, on one line: as JSON, which leaves one character that TOML forbids.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string().replace('\u{7f}', "\\u007f")
}

/// What a column may be named: its name, without a unit in brackets, without one after a mark.
fn guesses(header: &str) -> [String; 3] {
    let bare = header.split(['[', '(']).next().unwrap_or(header).trim();
    let lower = bare.to_lowercase();
    let units = ["_kmh", "_mps", "_kph", "_mph", "_deg", "_rad", "_ms", "_ft", "_cm", "_mm", "_m", "_s"];
    let without_unit = units.iter().find_map(|unit| lower.strip_suffix(unit)).unwrap_or(&lower);
    [letters(header), letters(bare), letters(without_unit)]
}
