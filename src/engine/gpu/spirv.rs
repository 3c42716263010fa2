//! The exact path on Vulkan: WGSL with resolved constants as SPIR-V, in which no float operation may be contracted or
//! reassociated (`NoContraction`). Drivers receive it unchanged.

use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{Capabilities, ValidationFlags, Validator};

use crate::{Error, Result};

/// SPIR-V opcodes that this file uses.
mod op {
    pub(super) const DECORATE: u32 = 71;
    pub(super) const MEMBER_DECORATE: u32 = 72;
    /// Arithmetic with float results: FNegate, FAdd, FSub, FMul, FDiv, FRem, FMod, VectorTimesScalar, Dot.
    pub(super) const FLOAT: [u32; 9] = [127, 129, 131, 133, 136, 140, 141, 142, 148];
    /// The decoration `NoContraction`.
    pub(super) const NO_CONTRACTION: u32 = 42;
    /// Words before the first instruction.
    pub(super) const HEADER: usize = 5;
}

/// Compiles the entry point of a pipeline's source with its constants. Indices are clamped and divisors tested, so that
/// behaviour is always defined.
///
/// # Errors
/// [`Error::Internal`] if naga refuses the source, which is an error of the shaders.
pub fn exact_spirv(source: &str, entry: &str, constants: &[(&str, f64)]) -> Result<Vec<u32>> {
    let defect = |stage: &str, what: String| Error::Internal(format!("a shader does not {stage}: {what}"));
    let module = naga::front::wgsl::parse_str(source).map_err(|e| defect("parse", e.emit_to_string(source)))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|e| defect("validate", e.emit_to_string(source)))?;
    let values = constants.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
    let stage = Some((naga::ShaderStage::Compute, entry));
    let (module, info) = naga::back::pipeline_constants::process_overrides(&module, &info, stage, &values)
        .map_err(|e| defect("take its constants", e.to_string()))?;
    let policy = BoundsCheckPolicy::Restrict;
    let options = spv::Options {
        lang_version: (1, 3),
        flags: spv::WriterFlags::empty(),
        fake_missing_bindings: true,
        bounds_check_policies: BoundsCheckPolicies {
            index: policy,
            buffer: policy,
            image_load: policy,
            binding_array: policy,
        },
        // Every loop ends at a constant or at the step cap; a test checks the shaders for this.
        force_loop_bounding: false,
        emit_int_div_checks: true,
        ..spv::Options::default()
    };
    let pipeline = spv::PipelineOptions { shader_stage: naga::ShaderStage::Compute, entry_point: entry.to_owned() };
    let words = spv::write_vec(&module, &info, &options, Some(&pipeline))
        .map_err(|e| defect("become SPIR-V", e.to_string()))?;
    forbid_contraction(&words)
}

/// Decorates every float operation with `NoContraction`.
fn forbid_contraction(words: &[u32]) -> Result<Vec<u32>> {
    let defect = |what: &str| Error::Internal(format!("SPIR-V cannot be read: {what}"));
    let mut decorations = Vec::new();
    let mut first_decoration = None;
    let mut at = op::HEADER;
    while at < words.len() {
        let (opcode, length) = (words[at] & 0xffff, (words[at] >> 16) as usize);
        if length == 0 || at + length > words.len() {
            return Err(defect("an instruction ends beyond the module"));
        }
        if first_decoration.is_none() && [op::DECORATE, op::MEMBER_DECORATE].contains(&opcode) {
            first_decoration = Some(at);
        }
        if op::FLOAT.contains(&opcode) {
            // Word 1 is the result's type, word 2 the result.
            decorations.extend([op::DECORATE | (3 << 16), words[at + 2], op::NO_CONTRACTION]);
        }
        at += length;
    }
    let place = first_decoration.ok_or_else(|| defect("no decoration"))?;
    let mut exact = Vec::with_capacity(words.len() + decorations.len());
    exact.extend_from_slice(&words[..place]);
    exact.extend_from_slice(&decorations);
    exact.extend_from_slice(&words[place..]);
    Ok(exact)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::gpu::shader;
    use crate::engine::{Constants, DeviceScene};
    use crate::model::driver::ModelId;
    use crate::model::profile::Profile;
    use crate::scenario::Category;

    fn count(words: &[u32], wanted: impl Fn(u32, &[u32]) -> bool) -> usize {
        let (mut at, mut found) = (op::HEADER, 0);
        while at < words.len() {
            let length = (words[at] >> 16) as usize;
            found += usize::from(wanted(words[at] & 0xffff, &words[at..at + length]));
            at += length;
        }
        found
    }

    #[test]
    fn every_float_operation_of_every_model_may_not_be_contracted() {
        let scene = DeviceScene::unknown(true);
        let every = shader::Specialization { scene, values: true, watched: true, queue: true };
        for name in Profile::names() {
            let profile = Profile::load(name).unwrap();
            for model in ModelId::ALL {
                let resolved = Constants::resolve(&profile, Category::CutOut);
                let constants = shader::constants(&resolved, model, every);
                let words = exact_spirv(&shader::assemble(model), shader::ENTRY, &constants).unwrap();
                let floats = count(&words, |opcode, _| op::FLOAT.contains(&opcode));
                let decorated = count(&words, |opcode, w| opcode == op::DECORATE && w[2] == op::NO_CONTRACTION);
                assert!(floats > 40, "{name} {model:?}: only {floats} float operations");
                assert_eq!(floats, decorated, "{name} {model:?}");
                // GLSL.std.450 fma is extended instruction 50 and must not occur.
                assert_eq!(count(&words, |opcode, w| opcode == 12 && w[4] == 50), 0);
            }
        }
    }
}
