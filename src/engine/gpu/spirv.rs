//! The exact path on Vulkan: WGSL with resolved constants as SPIR-V, in which no float operation may be contracted or
//! reassociated (`NoContraction`). Drivers receive it unchanged.

use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{Capabilities, ValidationFlags, Validator};

use lanesweep_support::{Error, Result};

/// SPIR-V opcodes that this file uses.
mod op {
    pub(super) const DECORATE: u32 = 71;
    pub(super) const MEMBER_DECORATE: u32 = 72;
    /// Arithmetic with float results: FNegate, FAdd, FSub, FMul, FDiv, FRem, FMod, VectorTimesScalar, Dot.
    pub(super) const FLOAT: [u32; 9] = [127, 129, 131, 133, 136, 140, 141, 142, 148];
    /// The decoration `NoContraction`.
    pub(super) const NO_CONTRACTION: u32 = 42;
    pub(super) const EXTENSION: u32 = 10;
    pub(super) const EXT_INST_IMPORT: u32 = 11;
    pub(super) const MEMORY_MODEL: u32 = 14;
    pub(super) const ENTRY_POINT: u32 = 15;
    pub(super) const EXECUTION_MODE: u32 = 16;
    pub(super) const CAPABILITY: u32 = 17;
    /// The capability and the execution mode `SignedZeroInfNanPreserve`.
    pub(super) const PRESERVE_CAPABILITY: u32 = 4466;
    pub(super) const PRESERVE_MODE: u32 = 4461;
    /// Words before the first instruction.
    pub(super) const HEADER: usize = 5;
}

/// Compiles the entry point of a pipeline's source with its constants. `preserve`: the driver must keep signed zeros,
/// infinities and NaN, which it [can](super::AdapterCard::float_controls). Indices are clamped and divisors tested, so that
/// behaviour is always defined.
///
/// # Errors
/// [`Error::Internal`] if naga refuses the source, which is an error of the shaders.
pub fn exact_spirv(source: &str, entry: &str, constants: &[(&str, f64)], preserve: bool) -> Result<Vec<u32>> {
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
    let words = forbid_contraction(&words)?;
    Ok(if preserve { preserve_special_values(&words) } else { words })
}

/// Declares that signed zeros, infinities and NaN of binary32 are kept.
fn preserve_special_values(words: &[u32]) -> Vec<u32> {
    let instruction =
        |opcode: u32, operands: &[u32]| [&[opcode | (operands.len() as u32 + 1) << 16], operands].concat();
    let mut name = *b"SPV_KHR_float_controls\0\0";
    let name: Vec<u32> = name.as_chunks_mut::<4>().0.iter().map(|four| u32::from_le_bytes(*four)).collect();
    let mut declared = words[..op::HEADER].to_vec();
    declared.extend(instruction(op::CAPABILITY, &[op::PRESERVE_CAPABILITY]));
    let (mut at, mut has_extension, mut entry) = (op::HEADER, false, None);
    while at < words.len() {
        let (opcode, length) = (words[at] & 0xffff, (words[at] >> 16) as usize);
        // Extensions come after the capabilities, execution modes after the entry point.
        if !has_extension && [op::EXTENSION, op::EXT_INST_IMPORT, op::MEMORY_MODEL].contains(&opcode) {
            declared.extend(instruction(op::EXTENSION, &name));
            has_extension = true;
        }
        if opcode == op::ENTRY_POINT {
            entry = Some(words[at + 2]);
        }
        if opcode == op::EXECUTION_MODE
            && let Some(entry) = entry.take()
        {
            declared.extend(instruction(op::EXECUTION_MODE, &[entry, op::PRESERVE_MODE, 32]));
        }
        declared.extend_from_slice(&words[at..at + length]);
        at += length;
    }
    declared
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
    use crate::gpu::shader;
    use crate::{Constants, DeviceScene};
    use lanesweep_model::driver::ModelId;
    use lanesweep_model::profile::Profile;
    use lanesweep_model::scenario::Category;

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
        let every = shader::Specialization { scene, values: true, queue: true };
        for name in Profile::names() {
            let profile = Profile::load(name).unwrap();
            for model in ModelId::ALL {
                let resolved = Constants::resolve(&profile, Category::CutOut);
                let constants = shader::constants(&resolved, model, every);
                let words = exact_spirv(&shader::assemble(model), shader::ENTRY, &constants, false).unwrap();
                let floats = count(&words, |opcode, _| op::FLOAT.contains(&opcode));
                let decorated = count(&words, |opcode, w| opcode == op::DECORATE && w[2] == op::NO_CONTRACTION);
                assert!(floats > 40, "{name} {model:?}: only {floats} float operations");
                assert_eq!(floats, decorated, "{name} {model:?}");
                let preserving = exact_spirv(&shader::assemble(model), shader::ENTRY, &constants, true).unwrap();
                // A capability of two words, an extension of seven, a mode of four.
                assert_eq!(preserving.len(), words.len() + 13);
                let mode = |opcode, w: &[u32]| opcode == op::EXECUTION_MODE && w[2..] == [op::PRESERVE_MODE, 32];
                assert_eq!((count(&preserving, mode), count(&words, mode)), (1, 0));
                // GLSL.std.450 fma is extended instruction 50 and must not occur.
                assert_eq!(count(&words, |opcode, w| opcode == 12 && w[4] == 50), 0);
            }
        }
    }
}
