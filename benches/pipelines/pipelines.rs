//! Every kernel as a Vulkan driver compiles it: registers, spills, instructions and machine code. No lane runs, so a
//! driver without its chip is sufficient (`.ci/compilers` names Mesa's).
//!
//! `cargo run --release -p lanesweep-pipelines -- --out FOLDER [--profile NAME]...` writes every kernel as WGSL with
//! its constants, SPIR-V, HLSL and MSL to FOLDER, and below it the machine code of each device that gives it. CSV rows go to stdout: one per
//! device, kernel and statistic of the driver. All profiles are compiled unless some are named; a kernel that two
//! profiles share is compiled once. `--sources` ends once the sources are written and needs no driver. `--plant fused`, `spill` or `wgsl` puts in a defect that a check must find. `--steps` prints how many steps
//! lanes of a study and of densities and their warps make instead, and how many if quiescent ones were skipped.

// Vulkan's functions are unsafe: every handle comes from this file and outlives its use.
#![allow(clippy::undocumented_unsafe_blocks, unsafe_code)]

#[path = "../common/mod.rs"]
mod common;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::ffi::CStr;
use std::fs;
use std::path::{Path, PathBuf};

use ash::{khr::pipeline_executable_properties as executables, vk};
use common::{density, paper_size_scenarios};
use lanesweep::engine::gpu::{exact_spirv, shader};
use lanesweep::engine::{Constants, CountLayout, DeviceScene, Headway, LanePlan, LaneRunner, Step};
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::sampling::{Estimator, SampleHeadways, SampleOptions, plan_samples};
use lanesweep::run::study::{StudyOptions, plan_study};
use lanesweep::scenario::Category;
use lanesweep::scenario::parameterization::Parameterization;
use rayon::prelude::*;

/// One kernel with its constants.
struct Kernel {
    name: String,
    entry: &'static str,
    source: String,
    constants: Vec<(&'static str, f64)>,
    /// Bindings; the first is a uniform buffer, the others are storage buffers.
    bindings: u32,
    words: Vec<u32>,
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let values = |flag: &str| -> Vec<&str> {
        args.windows(2).filter(|pair| pair[0] == flag).map(|pair| pair[1].as_str()).collect()
    };
    let mut profiles = values("--profile");
    if profiles.is_empty() {
        profiles = Profile::names().collect();
    }
    if args.iter().any(|arg| arg == "--steps") {
        return print_steps();
    }
    let out = PathBuf::from(*values("--out").last().expect("--out FOLDER"));
    let mut kernels = kernels(&profiles, args.iter().any(|arg| arg == "--values"));
    if let Some(defect) = values("--plant").last() {
        plant(&mut kernels, defect);
    }
    fs::create_dir_all(&out).expect("a folder that can be written");
    for kernel in &kernels {
        write_sources(kernel, &out);
    }
    eprintln!("{} kernels of {} profiles", kernels.len(), profiles.len());
    if args.iter().any(|arg| arg == "--sources") {
        return;
    }
    println!("device,kernel,statistic,value");
    // SAFETY: the loader is Vulkan's; the instance and all devices are destroyed after their last use.
    unsafe { compile_all(&kernels, &out) };
}

/// The generator, and every model with the constants of every profile and category. A cut-out has a second vehicle.
fn kernels(profiles: &[&str], values: bool) -> Vec<Kernel> {
    let mut all: Vec<Kernel> = Vec::new();
    let mut add = |name: String, entry, source: String, constants: Vec<(&'static str, f64)>, bindings| {
        let words = exact_spirv(&source, entry, &constants, true).expect("SPIR-V");
        if !all.iter().any(|known| known.words == words) {
            all.push(Kernel { name, entry, source, constants, bindings, words });
        }
    };
    let plans = sampled_plans(1000);
    for (id, plan) in &plans {
        let generator = plan.generator().expect("a plan of samples");
        let name = format!("generator.{}.{}", id.category.label(), id.key);
        add(name, shader::GENERATE, shader::assemble_generator(), generator.shader_constants(), 9);
    }
    let (_, plan) = &plans[0];
    let constants = CountLayout::new(plan).shader_constants();
    add("tally".to_owned(), shader::COUNT, shader::assemble_tally(), constants, 4);
    for profile_name in profiles {
        let profile = Profile::load(profile_name).expect("a profile");
        for model in ModelId::ALL {
            for category in Category::ALL {
                let resolved = Constants::resolve(&profile, category);
                let of_samples = plans
                    .iter()
                    .filter(|(id, _)| id.category == category)
                    .map(|(id, plan)| (id.key, plan.generator().expect("a plan of samples").scene()));
                let any = ("any", DeviceScene::unknown(category == Category::CutOut));
                for (scene_name, scene) in of_samples.chain([any]) {
                    let specialization = shader::Specialization { scene, values, queue: true };
                    let constants = shader::constants(&resolved, model, specialization);
                    let name = format!("{profile_name}.{}.{}.{scene_name}", category.label(), model.name());
                    add(name, shader::ENTRY, shader::assemble(model), constants, 8);
                }
            }
        }
    }
    all
}

/// Sampled lanes of densities that differ in their generators.
fn sampled_plans(samples: u64) -> Vec<(Parameterization, LanePlan)> {
    let scenarios = paper_size_scenarios();
    let keys = [
        (Category::CutIn, "2"),
        (Category::CutIn, "6"),
        (Category::CutOut, "b"),
        (Category::CutOut, "f"),
        (Category::Lvd, "i"),
        (Category::Lvd, "ii"),
        (Category::Lvd, "iv"),
    ];
    let plan = |(category, key)| {
        let density = density(category, key, &scenarios);
        let headways = SampleHeadways::Each(vec![Headway::ThwS(1.0)]);
        let options = SampleOptions::new(Estimator::Crude, samples, headways);
        let profile = Profile::load("paper").expect("a profile");
        (*density.space.id(), plan_samples(&density, &profile, &options).expect("a plan"))
    };
    keys.into_iter().map(plan).collect()
}

/// Puts a defect into the kernels, so that a check of what compilers make of them can be seen to fail.
fn plant(kernels: &mut Vec<Kernel>, defect: &str) {
    let lines = |of: fn(usize) -> String| (0..300).map(of).collect::<String>();
    let source = match defect {
        // Float operations that may be fused again.
        "fused" => return kernels.iter_mut().for_each(|kernel| kernel.words = contractible(&kernel.words)),
        // More values at a time than a lane has registers.
        "spill" => {
            let begin = lines(|k| format!("var x{k} = source[{k}u + n];\n"));
            let step = lines(|k| format!("x{k} = x{k} * x{} + x{};\n", (k + 7) % 300, (k + 151) % 300));
            let end = lines(|k| format!("target_[{k}u + n] = x{k};\n"));
            format!("{begin}for (var i = 0u; i < 9999u; i++) {{\n{step}}}\n{end}")
        }
        // Chrome's compiler alone says that the second line is never reached.
        "wgsl" => "if n < 4u { return; target_[n] = 1.0; }\ntarget_[n] = source[n];\n".to_owned(),
        other => panic!("--plant fused, spill or wgsl, not {other}"),
    };
    let source = format!(
        "@group(0) @binding(0) var<uniform> count: u32;\n\
         @group(0) @binding(1) var<storage, read> source: array<f32>;\n\
         @group(0) @binding(2) var<storage, read_write> target_: array<f32>;\n\
         @compute @workgroup_size(64) fn lanes(@builtin(local_invocation_index) inside: u32) {{\n\
         let n = inside * count;\n{source}}}\n"
    );
    let words = exact_spirv(&source, shader::ENTRY, &[], true).expect("SPIR-V");
    let name = format!("planted.{defect}");
    kernels.push(Kernel { name, entry: shader::ENTRY, source, constants: Vec::new(), bindings: 3, words });
}

/// SPIR-V without the decoration `NoContraction`.
fn contractible(words: &[u32]) -> Vec<u32> {
    let (mut kept, mut at) = (words[..5].to_vec(), 5);
    while at < words.len() {
        let length = (words[at] >> 16) as usize;
        if words[at] & 0xffff != 71 || words[at + 2] != 42 {
            kept.extend(&words[at..at + length]);
        }
        at += length;
    }
    kept
}

/// Steps of the lanes of a study of the paper's size and of default densities, alone and in warps of 32 and 64, for some
/// numbers of lanes per invocation; and the same if every quiescent step were skipped. Prints rows of CSV.
fn print_steps() {
    println!(
        "lanes_of,model,lanes,lane_steps,lane_steps_skipping,warp,lanes_per_invocation,warp_steps,warp_steps_skipping,fewer"
    );
    let profile = Profile::load("paper").expect("a profile");
    let scenarios = paper_size_scenarios();
    for category in Category::ALL {
        for model in ModelId::ALL {
            let options = StudyOptions { categories: vec![category], models: vec![model], ..StudyOptions::default() };
            let plan = plan_study(&scenarios, &profile, &options).expect("a plan");
            print_steps_of(&format!("study {}", category.label()), &plan, 0);
        }
    }
    for (id, plan) in sampled_plans(20_000) {
        for model in 0..plan.models.len() {
            print_steps_of(&format!("{} {}", id.category.label(), id.key), &plan, model);
        }
    }
}

fn print_steps_of(name: &str, plan: &LanePlan, model: usize) {
    let runner = LaneRunner::<f32>::new(plan);
    let constants: Vec<Constants<f32>> =
        plan.blocks.iter().map(|block| Constants::resolve(&plan.profile, block.category)).collect();
    let lanes: Vec<[u64; 2]> = (0..plan.lane_count())
        .into_par_iter()
        .filter_map(|lane| {
            let key = plan.key(lane).filter(|key| key.model == model)?;
            let (case, tables) = runner.case(key.block, key.unit, key.variant);
            let mut turns = Turns::default();
            let start = plan.headways[key.headway].start();
            let observe = &mut |step: &Step<f32>| turns.step(step);
            constants[key.block].run(plan.models[model], &case, &tables, start, observe);
            turns.end();
            Some([turns.all, turns.skipping])
        })
        .collect();
    let [all, skipping] = [0, 1].map(|which| lanes.iter().map(|steps| steps[which]).collect::<Vec<u64>>());
    let (total, total_skipping) = (all.iter().sum::<u64>(), skipping.iter().sum::<u64>());
    for warp in [32, 64] {
        for per_invocation in [1, 8, 16, 32] {
            let spent = |steps: &[u64]| -> u64 {
                steps.chunks(WORKGROUP * per_invocation).map(|group| warp_steps(group, warp)).sum()
            };
            let (made, left) = (spent(&all), spent(&skipping));
            let fewer = 1.0 - left as f64 / made as f64;
            let model = plan.models[model].name();
            println!(
                "{name},{model},{},{total},{total_skipping},{warp},{per_invocation},{made},{left},{fewer:.3}",
                lanes.len()
            );
        }
    }
}

/// Turns of a lane: each step, and the same if steps in which only the gap changes were skipped. More would not be skipped: near
/// the driver's or a criterion's limit every step must be made.
#[derive(Default)]
struct Turns {
    all: u64,
    skipping: u64,
    /// Steps since something other than the gap changed.
    quiescent: u64,
    before: Option<[f32; 6]>,
}

impl Turns {
    /// Fewer quiescent steps are cheaper to make than to skip, as on the CPU.
    const LEAST: u64 = 64;
    /// Turns for deciding on a jump and making it.
    const JUMP: u64 = 2;

    fn step(&mut self, step: &Step<f32>) {
        self.all += 1;
        let [first, second] = &step.seen;
        let now = [
            step.v_ego,
            first.view.v_other,
            first.lateral,
            second.view.v_other,
            second.lateral,
            first.view.lateral_towards,
        ];
        if self.before == Some(now) && !step.hazard.is_unsafe.holds() {
            self.quiescent += 1;
        } else {
            self.end();
        }
        self.before = Some(now);
        self.skipping += 1;
    }

    fn end(&mut self) {
        // One burst remains at the end.
        if self.quiescent >= Self::LEAST {
            self.skipping -= self.quiescent - u64::from(shader::BURST) - Self::JUMP;
        }
        self.quiescent = 0;
    }
}

/// Invocations of a workgroup.
const WORKGROUP: usize = shader::WORKGROUP as usize;

/// Steps that the warps of a workgroup make, times their invocations: an invocation whose lane has ended takes the next at the
/// end of a burst.
fn warp_steps(lanes: &[u64], warp: usize) -> u64 {
    let burst = u64::from(shader::BURST);
    let mut pending = lanes.iter();
    let mut free: BinaryHeap<Reverse<(u64, usize)>> = (0..WORKGROUP).map(|at| Reverse((0, at))).collect();
    let mut ends = vec![0; WORKGROUP / warp];
    while let Some(Reverse((step, at))) = free.pop() {
        match pending.next() {
            Some(steps) => free.push(Reverse((step + steps.next_multiple_of(burst), at))),
            None => ends[at / warp] = step.max(ends[at / warp]),
        }
    }
    ends.iter().sum::<u64>() * warp as u64
}

/// SPIR-V with its decorations, and what the other interfaces get.
fn write_sources(kernel: &Kernel, out: &Path) {
    let path = |extension: &str| out.join(format!("{}.{extension}", kernel.name));
    fs::write(path("spv"), bytemuck::cast_slice::<u32, u8>(&kernel.words)).expect("a file that can be written");
    let module = naga::front::wgsl::parse_str(&kernel.source).expect("WGSL");
    let validate = |module: &naga::Module| {
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty())
            .validate(module)
            .expect("a valid module")
    };
    let info = validate(&module);
    let values = kernel.constants.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
    let stage = Some((naga::ShaderStage::Compute, kernel.entry));
    let (module, info) =
        naga::back::pipeline_constants::process_overrides(&module, &info, stage, &values).expect("constants");
    fs::write(path("wgsl"), &kernel.source).expect("a file that can be written");
    let constants: BTreeMap<_, _> = kernel.constants.iter().copied().collect();
    let constants = serde_json::to_string(&constants).expect("JSON");
    fs::write(path("constants.json"), constants).expect("a file that can be written");
    let mut hlsl = String::new();
    let options = naga::back::hlsl::Options::default();
    let pipeline = naga::back::hlsl::PipelineOptions { entry_point: stage.map(|(s, n)| (s, n.to_owned())) };
    naga::back::hlsl::Writer::new(&mut hlsl, &options, &pipeline).write(&module, &info, None).expect("HLSL");
    fs::write(path("hlsl"), hlsl).expect("a file that can be written");
    // As in SPIR-V.
    let options = naga::back::msl::Options { force_loop_bounding: false, ..Default::default() };
    let pipeline = naga::back::msl::PipelineOptions::default();
    let (msl, _) = naga::back::msl::write_string(&module, &info, &options, &pipeline).expect("MSL");
    fs::write(path("metal"), msl).expect("a file that can be written");
}

/// Compiles all kernels on all devices.
unsafe fn compile_all(kernels: &[Kernel], out: &Path) {
    unsafe {
        let entry = ash::Entry::load().expect("libvulkan.so.1");
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let instance = entry
            .create_instance(&vk::InstanceCreateInfo::default().application_info(&application), None)
            .expect("an instance of Vulkan 1.3");
        for physical in instance.enumerate_physical_devices().expect("devices") {
            let properties = instance.get_physical_device_properties(physical);
            let name = properties.device_name_as_c_str().expect("a name").to_string_lossy().into_owned();
            let extensions = instance.enumerate_device_extension_properties(physical).expect("extensions");
            if !extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(executables::NAME)) {
                eprintln!("SKIPPED: {name} has no {}", executables::NAME.to_string_lossy());
                continue;
            }
            compile_on(&instance, physical, &name, kernels, out);
        }
        instance.destroy_instance(None);
    }
}

unsafe fn compile_on(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    name: &str,
    kernels: &[Kernel],
    out: &Path,
) {
    unsafe {
        let queue = [vk::DeviceQueueCreateInfo::default().queue_family_index(0).queue_priorities(&[1.0])];
        let extensions = [executables::NAME.as_ptr()];
        let mut executable =
            vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
        let create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queue)
            .enabled_extension_names(&extensions)
            .push_next(&mut executable);
        let device = instance.create_device(physical, &create, None).expect("a device");
        let reader = executables::Device::new(instance, &device);
        // A file name of letters, digits and single dashes.
        let words: Vec<&str> = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty()).collect();
        let folder = out.join(words.join("-").to_lowercase());
        fs::create_dir_all(&folder).expect("a folder that can be written");
        for kernel in kernels {
            let facts = compile(&device, &reader, kernel);
            for (statistic, value) in &facts.statistics {
                println!("{},{},{statistic},{value}", name.replace(',', ";"), kernel.name);
            }
            for (representation, text) in &facts.representations {
                let file = format!("{}.{}", kernel.name, representation.to_lowercase().replace(' ', "-"));
                fs::write(folder.join(file), text).expect("a file that can be written");
            }
        }
        device.destroy_device(None);
    }
}

/// What a driver tells of a compiled kernel.
#[derive(Default)]
struct Facts {
    statistics: BTreeMap<String, String>,
    representations: BTreeMap<String, String>,
}

unsafe fn compile(device: &ash::Device, reader: &executables::Device, kernel: &Kernel) -> Facts {
    unsafe {
        let bindings: Vec<_> = (0..kernel.bindings)
            .map(|binding| {
                let kind =
                    if binding == 0 { vk::DescriptorType::UNIFORM_BUFFER } else { vk::DescriptorType::STORAGE_BUFFER };
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(kind)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let sets = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        let sets = [device.create_descriptor_set_layout(&sets, None).expect("a descriptor set layout")];
        let layout = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
        let layout = device.create_pipeline_layout(&layout, None).expect("a pipeline layout");
        let module = vk::ShaderModuleCreateInfo::default().code(&kernel.words);
        let module = device.create_shader_module(&module, None).expect("a shader module");
        let entry = std::ffi::CString::new(kernel.entry).expect("a name");
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(&entry);
        let capture = vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR
            | vk::PipelineCreateFlags::CAPTURE_INTERNAL_REPRESENTATIONS_KHR;
        let create = vk::ComputePipelineCreateInfo::default().flags(capture).stage(stage).layout(layout);
        let pipelines = device.create_compute_pipelines(vk::PipelineCache::null(), &[create], None);
        let pipeline = pipelines.unwrap_or_else(|(_, e)| panic!("{}: {e}", kernel.name))[0];
        let facts = read(reader, pipeline);
        device.destroy_pipeline(pipeline, None);
        device.destroy_shader_module(module, None);
        device.destroy_pipeline_layout(layout, None);
        device.destroy_descriptor_set_layout(sets[0], None);
        facts
    }
}

unsafe fn read(reader: &executables::Device, pipeline: vk::Pipeline) -> Facts {
    unsafe {
        let mut facts = Facts::default();
        let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
        let properties = reader.get_pipeline_executable_properties(&info).expect("executables");
        for (index, property) in properties.iter().enumerate() {
            facts.statistics.insert("Subgroup size".to_owned(), property.subgroup_size.to_string());
            let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(index as u32);
            for statistic in reader.get_pipeline_executable_statistics(&info).expect("statistics") {
                facts.statistics.insert(text(&statistic.name), value(&statistic));
            }
            let sizes = reader.get_pipeline_executable_internal_representations(&info).expect("representations");
            let mut texts: Vec<Vec<u8>> = sizes.iter().map(|r| vec![0; r.data_size]).collect();
            let mut filled = sizes.clone();
            for (representation, bytes) in filled.iter_mut().zip(&mut texts) {
                representation.p_data = bytes.as_mut_ptr().cast();
            }
            let mut count = filled.len() as u32;
            // The wrapper asks for sizes only.
            (reader.fp().get_pipeline_executable_internal_representations_khr)(
                reader.device(),
                &info,
                &mut count,
                filled.as_mut_ptr(),
            )
            .result()
            .expect("representations");
            for (representation, bytes) in sizes.iter().zip(&texts) {
                let content = String::from_utf8_lossy(bytes).trim_end_matches('\0').to_owned();
                facts.representations.insert(text(&representation.name), content);
            }
        }
        facts
    }
}

unsafe fn value(statistic: &vk::PipelineExecutableStatisticKHR<'_>) -> String {
    unsafe {
        match statistic.format {
            vk::PipelineExecutableStatisticFormatKHR::BOOL32 => statistic.value.b32.to_string(),
            vk::PipelineExecutableStatisticFormatKHR::INT64 => statistic.value.i64.to_string(),
            vk::PipelineExecutableStatisticFormatKHR::UINT64 => statistic.value.u64.to_string(),
            _ => statistic.value.f64.to_string(),
        }
    }
}

/// A text of a fixed field, without commas.
fn text(field: &[std::ffi::c_char]) -> String {
    let bytes: Vec<u8> = field.iter().map(|&c| c as u8).collect();
    let text = CStr::from_bytes_until_nul(&bytes).map(|s| s.to_string_lossy().into_owned());
    text.unwrap_or_default().replace(',', ";")
}
