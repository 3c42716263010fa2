//! The version of the lane arithmetic, and the canonical bytes that plan hashes are computed from.
//!
//! Every plan hash and every sealed file begins with [`ENGINE_VERSION`]. Numbers and texts are hashed in the form
//! below, never as formatted text.

use serde::Serialize;
use sha2::{Digest, Sha256};

use super::generated::{Generator, PointSource};
use super::lane_case::{LaneCase, LaneOther};
use lanesweep_model::scenario::{Motion, Tables};
use lanesweep_support::plain_text::hex;

/// Version of the lane computation, from a scenario or a sample's index to its verdicts and values. Raise it whenever a
/// bit of any lane can change: plans, parts, journals and records of another version are refused. Package versions with
/// the same engine version continue and merge each other's runs.
pub const ENGINE_VERSION: u64 = 5;

/// A hash over numbers and texts: little-endian, texts and lists preceded by their length, floats as bits.
pub struct Canonical(Sha256);

impl Canonical {
    /// Begins with the engine version and the kind of content.
    pub fn new(what: &str) -> Canonical {
        let mut canonical = Canonical(Sha256::new());
        canonical.text("lanesweep");
        canonical.word(ENGINE_VERSION);
        canonical.text(what);
        canonical
    }

    /// Adds a number.
    pub fn word(&mut self, word: u64) {
        self.0.update(word.to_le_bytes());
    }

    fn words(&mut self, words: &[u32]) {
        self.word(words.len() as u64);
        words.iter().for_each(|word| self.0.update(word.to_le_bytes()));
    }

    fn floats(&mut self, floats: &[f32]) {
        self.word(floats.len() as u64);
        floats.iter().for_each(|value| self.0.update(value.to_bits().to_le_bytes()));
    }

    /// Adds a text with its length.
    pub fn text(&mut self, text: &str) {
        self.word(text.len() as u64);
        self.0.update(text.as_bytes());
    }

    /// A serializable value: every value with its kind, the fields of a structure with their names, sorted by name.
    pub fn value(&mut self, value: &impl Serialize) -> lanesweep_support::Result<()> {
        let value = serde_json::to_value(value).map_err(|e| {
            lanesweep_support::Error::Internal(format!("a plan has something that cannot be hashed: {e}"))
        })?;
        self.json(&value);
        Ok(())
    }

    fn json(&mut self, value: &serde_json::Value) {
        use serde_json::Value;
        match value {
            Value::Null => self.word(0),
            Value::Bool(value) => self.word(1 + u64::from(*value)),
            Value::Number(number) => match (number.as_u64(), number.as_i64()) {
                (Some(whole), _) => [3, whole].into_iter().for_each(|word| self.word(word)),
                (_, Some(whole)) => [4, whole.cast_unsigned()].into_iter().for_each(|word| self.word(word)),
                _ => [5, number.as_f64().unwrap_or(f64::NAN).to_bits()].into_iter().for_each(|word| self.word(word)),
            },
            Value::String(text) => {
                self.word(6);
                self.text(text);
            }
            Value::Array(list) => {
                [7, list.len() as u64].into_iter().for_each(|word| self.word(word));
                list.iter().for_each(|value| self.json(value));
            }
            Value::Object(fields) => {
                [8, fields.len() as u64].into_iter().for_each(|word| self.word(word));
                let mut names: Vec<&String> = fields.keys().collect();
                names.sort_unstable();
                for name in names {
                    self.text(name);
                    self.json(&fields[name]);
                }
            }
        }
    }

    /// The series that cases index.
    pub(super) fn tables(&mut self, tables: &Tables<f64>) {
        for list in [&tables.speed[..], tables.lateral.as_flattened()] {
            self.word(list.len() as u64);
            list.iter().for_each(|value| self.0.update(value.to_bits().to_le_bytes()));
        }
    }

    /// A case, field by field.
    pub(crate) fn case(&mut self, case: &LaneCase<f64>) {
        let LaneCase { others, ego_speed, ego_width, lane_width, horizon, pair } = case;
        let mut bytes = Vec::with_capacity(320);
        for other in others {
            put_other(&mut bytes, other);
        }
        put_floats(&mut bytes, &[*ego_speed, *ego_width, *lane_width]);
        put_words(&mut bytes, &[*horizon, *pair]);
        self.0.update(&bytes);
    }

    /// A generator of cases.
    pub(crate) fn generator(&mut self, generator: &Generator) {
        let Generator { points, recipe, basis } = generator;
        match &points.source {
            PointSource::Random(stream) => {
                [0, stream.seed, stream.purpose.into()].into_iter().for_each(|word| self.word(word));
            }
            PointSource::Given => self.word(2),
        }
        self.word(points.dimensions as u64);
        self.floats(&points.means);
        self.floats(&points.deviations);
        // Words and floats without padding: a device gets the same record.
        self.words(bytemuck::cast_slice(std::slice::from_ref(recipe)));
        self.floats(basis);
    }

    /// The hash in hexadecimal.
    pub fn finish(self) -> String {
        hex(&self.0.finalize())
    }
}

fn put_words(bytes: &mut Vec<u8>, words: &[u32]) {
    words.iter().for_each(|word| bytes.extend(word.to_le_bytes()));
}

fn put_floats(bytes: &mut Vec<u8>, floats: &[f64]) {
    floats.iter().for_each(|value| bytes.extend(value.to_bits().to_le_bytes()));
}

fn put_other(bytes: &mut Vec<u8>, other: &LaneOther<f64>) {
    let LaneOther {
        motion,
        half_lengths,
        half_widths,
        gap_offset,
        present_from,
        present_until,
        attend_from,
        used,
        judged,
    } = other;
    let Motion {
        kind,
        speed_offset,
        speed_len,
        lateral_offset,
        lateral_len,
        speed_until,
        lateral_until,
        speed_initial,
        speed_per_step,
        speed_end,
        lateral_initial,
        lateral_per_step,
        lateral_end,
        lateral_towards,
        reserved,
    } = motion;
    let motion = [*kind, *speed_offset, *speed_len, *lateral_offset, *lateral_len, *speed_until, *lateral_until];
    put_words(bytes, &motion);
    put_words(bytes, reserved);
    put_words(bytes, &[*present_from, *present_until, *used, *judged]);
    put_words(bytes, attend_from);
    put_floats(bytes, &[*speed_initial, *speed_per_step, *speed_end, *lateral_initial, *lateral_per_step]);
    put_floats(bytes, &[*lateral_end, *lateral_towards, *half_lengths, *half_widths, *gap_offset]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_is_hashed_changes_the_hash_and_formatting_does_not() {
        let of = |feed: &dyn Fn(&mut Canonical)| {
            let mut canonical = Canonical::new("test");
            feed(&mut canonical);
            canonical.finish()
        };
        let value = |value: serde_json::Value| of(&|canonical| canonical.value(&value).unwrap());
        assert_eq!(
            value(serde_json::json!({"a": 1.5, "b": [1, 2]})),
            value(serde_json::json!({"b": [1, 2], "a": 1.5}))
        );
        let others = [
            serde_json::json!({"a": 1.5, "b": [1, 2]}),
            serde_json::json!({"a": 1.5, "b": [2, 1]}),
            serde_json::json!({"a": 1.500_000_000_000_000_2, "b": [1, 2]}),
            serde_json::json!({"b": 1.5, "a": [1, 2]}),
            serde_json::json!([["a", 1.5], ["b", 1, 2]]),
            serde_json::json!({"a": 1.5, "b": ["1", 2]}),
            serde_json::json!({"a": 1.5, "b": [1.0, 2]}),
            serde_json::json!({"a": 1.5, "b": [true, 2]}),
            serde_json::json!(null),
        ];
        let hashes: std::collections::BTreeSet<String> = others.iter().cloned().map(value).collect();
        assert_eq!(hashes.len(), others.len());
        assert_ne!(
            of(&|c| ["ab", "c"].iter().for_each(|t| c.text(t))),
            of(&|c| ["a", "bc"].iter().for_each(|t| c.text(t)))
        );
    }
}
