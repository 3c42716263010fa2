//! The version of the lane arithmetic, and the canonical bytes that plan hashes are computed from.
//!
//! Every plan hash and every sealed file begins with [`ENGINE_VERSION`]. Numbers and texts are hashed in the form
//! below, never as formatted text.

use serde::Serialize;
use sha2::{Digest, Sha256};

use super::generated::{Generator, PointSource};
use super::lane_case::{LaneCase, LaneOther};
use crate::scenario::{Motion, Tables};
use crate::support::plain_text::hex;

/// Version of the lane computation, from a scenario or a sample's index to its verdicts and values. Raise it whenever a
/// bit of any lane can change: plans, parts, journals and records of another version are refused. Package versions with
/// the same engine version continue and merge each other's runs.
pub const ENGINE_VERSION: u64 = 5;

/// A version, and the SHA-256 of a small set of lanes computed with it. A test uses it to detect that
/// [`ENGINE_VERSION`] must be raised.
#[cfg(test)]
const PINNED_LANES: (u64, &str) = (5, "8f4403ba050f053642e79786f40be37d4764dc0a2eaeedb11b8e7b4e34a03f42");

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

    pub fn text(&mut self, text: &str) {
        self.word(text.len() as u64);
        self.0.update(text.as_bytes());
    }

    /// A serializable value: every value with its kind, the fields of a structure with their names, sorted by name.
    pub fn value(&mut self, value: &impl Serialize) -> crate::Result<()> {
        let value = serde_json::to_value(value)
            .map_err(|e| crate::Error::Internal(format!("a plan has something that cannot be hashed: {e}")))?;
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
    pub fn tables(&mut self, tables: &Tables<f64>) {
        for list in [&tables.speed[..], tables.lateral.as_flattened()] {
            self.word(list.len() as u64);
            list.iter().for_each(|value| self.0.update(value.to_bits().to_le_bytes()));
        }
    }

    /// A case, field by field.
    pub fn case(&mut self, case: &LaneCase<f64>) {
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
    pub fn generator(&mut self, generator: &Generator) {
        let Generator { points, recipe, basis } = generator;
        match &points.source {
            PointSource::Random(stream) => {
                [0, stream.seed, stream.purpose.into()].into_iter().for_each(|word| self.word(word));
            }
            PointSource::Sobol(sobol) => {
                self.word(1);
                self.words(sobol.table().as_flattened());
            }
            PointSource::Given => self.word(2),
        }
        self.word(points.dimensions as u64);
        self.words(points.weights.as_ref().map_or(&[], |weights| weights.table().as_flattened()));
        self.floats(&points.means);
        self.words(&points.factor_of);
        self.floats(&points.factors);
        if !points.knots.is_empty() {
            self.floats(&points.knots);
        }
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
    use crate::engine::verify::{RandomOptions, ThresholdOptions, random_plan, threshold_plan};
    use crate::engine::{Backend, Constants, CpuBackend, Headway, LanePlan, Silent, Start, Wanted, words};
    use crate::model::driver::ModelId;
    use crate::model::profile::Profile;
    use crate::run::sampling::{SampleSource, generator_of};
    use crate::run::study::plan_file::{BlockHead, StudyHead, stripped};
    use crate::scenario::parameterization::{Parameterization, ParameterizationOptions, Reduction, Sizes, SvdBasis};
    use crate::scenario::{Category, Scenario};
    use crate::stats::density::{Mixture, ParameterSpace};

    /// Formulas instead of recordings and fits, so that the bits are the same on every machine.
    fn scenario(category: Category, number: u32) -> Scenario {
        let k = f64::from(number);
        let series = |of: &dyn Fn(f64) -> f64| (0..61).map(|i| of(f64::from(i))).collect::<Vec<f64>>();
        let speed = series(&|i| 22.0 + k - 0.0625 * i * (k + 1.0));
        let across = match category {
            Category::CutIn => series(&|i| 3.5 - 3.5 * (i / 60.0) * (2.0 - i / 60.0)),
            _ => series(&|i| 3.25 * (i / 60.0) * (i / 60.0)),
        };
        let vehicle = serde_json::json!({"length": 4.5 + k / 8.0, "width": 1.875, "v": speed, "y": across});
        let lead = serde_json::json!({
            "length": 5.0, "width": 2.0, "v": series(&|i| 9.0 + 0.03125 * i), "y": series(&|_| 0.0),
        });
        let is_cut_out = category == Category::CutOut;
        let text = serde_json::json!({
            "id": format!("{}_{number}", category.key()), "category": category, "fps": 25.0,
            "ego": {"v0": 27.0 + k, "length": 4.25, "width": 1.75}, "side": if number == 0 { "left" } else { "right" },
            "target": vehicle, "lead": is_cut_out.then_some(lead), "D": is_cut_out.then_some(20.0 + 4.0 * k),
        });
        serde_json::from_value(text).unwrap()
    }

    /// The models of every version; a new model changes no lane of these.
    fn models() -> Vec<ModelId> {
        ["Reg157", "CCHDM", "RSS", "FSM"].map(|name| ModelId::parse(name).unwrap()).to_vec()
    }

    fn reduction(category: Category, options: &ParameterizationOptions) -> Reduction {
        let (series, extras): (&[f64], &[f64]) = match category {
            Category::CutIn => (&[1.5, 21.0], &[28.0, 2.5]),
            Category::CutOut => (&[1.0, 21.0, 10.0], &[28.0, 22.0, 2.5]),
            Category::Lvd => (&[21.0], &[2.5]),
        };
        let spread = |value: &f64| std::iter::repeat_n(*value, options.svd_instants);
        let mean: Vec<f64> = series.iter().flat_map(spread).chain(extras.iter().copied()).collect();
        let direction = |j: usize| (0..mean.len()).map(|c| ((c * 7 + j * 13) % 11) as f64 / 256.0 - 0.02).collect();
        let directions = (0..7).map(direction).collect();
        let weights = vec![0.5; mean.len()];
        let mean = mean.iter().map(|value| value * 0.5).collect();
        let basis = SvdBasis { weights, mean, singular_values: Vec::new(), directions, rows: 8 };
        Reduction::from_parts(category, basis, options).unwrap()
    }

    /// Two scenarios of every category with every parameterization.
    fn study(profile: &Profile) -> LanePlan {
        let options = ParameterizationOptions::default();
        let (mut held, mut blocks) = (Vec::new(), Vec::new());
        for category in Category::ALL {
            held.extend((0..2).map(|number| stripped(&scenario(category, number), None)));
            blocks.push(BlockHead::new(category, 2, Some(&reduction(category, &options)), Vec::new()));
        }
        let headways = vec![Headway::ThwS(1.2), Headway::ThwS(0.4), Headway::GapM(9.0)];
        let head = StudyHead::new(profile.clone(), models(), headways, options, blocks, &held).unwrap();
        head.with_scenarios(0, held).unwrap().window(0..6).unwrap()
    }

    fn lanes(digest: &mut Sha256, plan: &LanePlan) -> usize {
        let (narrow, wide) = (CpuBackend::scalar(), CpuBackend::reference());
        let backends: [&dyn Backend; 2] = [&narrow, &wide];
        for backend in backends {
            let chunk = backend.prepare(plan).unwrap().run(0..plan.unit_count(), Wanted::Outcomes).unwrap();
            for word in chunk.outcomes.iter().flat_map(words) {
                digest.update(word.to_le_bytes());
            }
        }
        plan.lane_count() as usize
    }

    /// Points of generators of every category, and the lanes of their cases.
    fn samples(digest: &mut Sha256, profile: &Profile) {
        let options = ParameterizationOptions::default();
        for (category, key) in
            [(Category::CutIn, "2"), (Category::CutOut, "a"), (Category::Lvd, "ii"), (Category::CutIn, "6")]
        {
            let id = Parameterization::find(category, key).unwrap();
            let reduction = id.coefficients().is_some().then(|| reduction(category, &options));
            let space = ParameterSpace::new(id, &options, reduction.as_ref(), false).unwrap();
            let d = space.dimensions();
            let mean = |k: usize| (0..d).map(|at| 1.0 + ((at * 5 + k * 3) % 7) as f64).collect::<Vec<f64>>();
            let factor = nalgebra::DMatrix::from_fn(d, d, |row, column| match row.cmp(&column) {
                std::cmp::Ordering::Equal => 0.75,
                std::cmp::Ordering::Greater => 0.125,
                std::cmp::Ordering::Less => 0.0,
            });
            let mixture = Mixture::new(vec![1.0, 2.0, 5.0], (0..3).map(mean).collect(), vec![factor], vec![0; 3]);
            let mixture = mixture.unwrap();
            let sizes = Sizes::of(&scenario(Category::CutOut, 0));
            for source in [SampleSource::Random, SampleSource::Sobol] {
                let generator = generator_of(&space, &mixture, &sizes, profile, source, 157).unwrap();
                let constants = Constants::<f32>::resolve(profile, category);
                for index in 0..64 {
                    let drawn = generator.draw(index);
                    digest.update(drawn.tries.to_le_bytes());
                    drawn.values.iter().for_each(|value| digest.update(value.to_bits().to_le_bytes()));
                    let mut tables = Tables::default();
                    let case = generator.case(index, &mut tables);
                    for model in models() {
                        let outcome = constants.run(model, &case, &tables, Start::Headway(0.8), &mut Silent);
                        words(&outcome.widen()).iter().for_each(|word| digest.update(word.to_le_bytes()));
                    }
                }
            }
        }
    }

    #[test]
    fn the_bits_of_lanes_are_those_of_the_engine_version() {
        let mut digest = Sha256::new();
        let mut count = 0;
        for name in Profile::names() {
            for dt_s in [0.04, 0.1] {
                let profile = Profile::load(name).unwrap().with_dt(dt_s).unwrap();
                let random =
                    RandomOptions { lanes_per_model_and_category: 80, models: models(), ..RandomOptions::default() };
                count += lanes(&mut digest, &random_plan(&profile, &random).unwrap());
                let thresholds =
                    ThresholdOptions { units_per_threshold: 1, models: models(), ..ThresholdOptions::default() };
                count += lanes(&mut digest, &threshold_plan(&profile, &thresholds).unwrap());
                count += lanes(&mut digest, &study(&profile));
                if name != "jrc-2021" {
                    samples(&mut digest, &profile);
                }
            }
        }
        assert!(count > 10_000, "{count}");
        let found = hex(&digest.finalize());
        assert_eq!(
            (ENGINE_VERSION, found.as_str()),
            PINNED_LANES,
            "\nLanes have other bits than those of engine {}. If that is meant: raise ENGINE_VERSION in \
             src/engine/version.rs, set PINNED_LANES to the new version and the digest above, and say so in CHANGELOG.md",
            PINNED_LANES.0,
        );
    }

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
