//! The GPUs that a cluster's environment allows a job to use. Vulkan ignores `CUDA_VISIBLE_DEVICES`, so its entries
//! are resolved to PCI bus ids here.
//!
//! The first variable that is set decides:
//!
//! 1. `CUDA_VISIBLE_DEVICES`: entries have CUDA's numbering. Inside a device cgroup Slurm renumbers them from 0; CUDA
//!    numbers only the GPUs that it can open, and so does this. It has priority over Slurm's variables, because task
//!    binding and users narrow it.
//! 2. `SLURM_STEP_GPUS`, then `SLURM_JOB_GPUS`: numbers of the node, never renumbered. They are the numbers of the
//!    device files (`/dev/nvidia3` is 3, `Device Minor`), which may differ from the order on the bus.
//!
//! CUDA's indices follow the PCI bus here, as those of nvidia-smi and Slurm do. CUDA itself does so with
//! `CUDA_DEVICE_ORDER=PCI_BUS_ID`; by default (`FASTEST_FIRST`) the fastest model is first, which other programs
//! cannot determine. If the GPUs differ in model and the order is not fixed, a warning names the chosen order; UUIDs
//! are never ambiguous.

use std::path::Path;

use crate::engine::device_choice::pci_bus_id;
use crate::{Error, Place, Result};

const CUDA: &str = "CUDA_VISIBLE_DEVICES";
const VARIABLES: [&str; 3] = [CUDA, "SLURM_STEP_GPUS", "SLURM_JOB_GPUS"];

/// One GPU of the NVIDIA driver, from `/proc/driver/nvidia/gpus/*/information`.
#[derive(Debug, Clone)]
struct NvidiaGpu {
    bus: String,
    uuid: String,
    model: String,
    minor: Option<u32>,
}

/// `visible()` of this process and this machine.
///
/// Call it after listing the devices: opening the driver's device files is fast only while they are already open.
///
/// # Errors
/// As `visible()`.
pub fn visible_here() -> Result<Option<Vec<String>>> {
    let env = |name: &str| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned());
    visible(&env, Path::new("/"))
}

/// PCI bus ids (`pci_bus_id`) of the devices that the environment allows, in its order; `None` without restriction.
/// `env` reads a variable, `root` is the folder above `proc` and `dev`.
///
/// Also `None` if the driver lists no NVIDIA GPU, because the variables refer to NVIDIA devices only. An empty value,
/// `-1` and Slurm's `NoDevFiles` hide every GPU, or all after them in a list, as in CUDA.
///
/// # Errors
/// [`Error::Usage`] for an entry that is unknown, ambiguous, named twice or a MIG instance. CUDA hides that entry and
/// all after it silently; this returns an error.
fn visible(env: &dyn Fn(&str) -> Option<String>, root: &Path) -> Result<Option<Vec<String>>> {
    let Some((variable, value)) = VARIABLES.iter().find_map(|&v| Some((v, env(v)?))) else { return Ok(None) };
    let mut gpus = nvidia_gpus(root);
    if gpus.is_empty() {
        return Ok(None);
    }
    if variable == CUDA {
        keep_those_that_open(&mut gpus, root);
    }
    let mut allowed: Vec<String> = Vec::new();
    let mut by_index = false;
    for entry in value.split(',').map(str::trim) {
        if entry.is_empty() && allowed.is_empty() || entry == "-1" || entry == "NoDevFiles" {
            break;
        }
        by_index |= !entry.starts_with("GPU-");
        let gpu = resolve(variable, entry, &gpus)?;
        if allowed.contains(&gpu.bus) {
            return Err(unusable(variable, format!("`{entry}` names pci:{} a second time", gpu.bus), &gpus));
        }
        allowed.push(gpu.bus.clone());
    }
    let one_model = gpus.iter().all(|gpu| gpu.model == gpus[0].model);
    if variable == CUDA && by_index && !one_model && env("CUDA_DEVICE_ORDER").as_deref() != Some("PCI_BUS_ID") {
        tracing::warn!(
            "{CUDA}={value} counts the GPUs along the PCI bus here; they differ in model, and CUDA may count the \
             fastest first: set CUDA_DEVICE_ORDER=PCI_BUS_ID or name them by UUID"
        );
    }
    Ok(Some(allowed))
}

fn resolve<'a>(variable: &str, entry: &str, gpus: &'a [NvidiaGpu]) -> Result<&'a NvidiaGpu> {
    let fail = |problem: String| Err(unusable(variable, problem, gpus));
    if entry.starts_with("MIG-") {
        return Err(Error::usage(
            Place::item(variable),
            format!("`{entry}` is a part of a GPU (MIG), which Vulkan cannot select"),
            "ask the cluster for a whole GPU, or use the processor: option `backend = cpu`",
        ));
    }
    if entry.starts_with("GPU-") {
        let wanted = entry.to_ascii_lowercase();
        let mut matching = gpus.iter().filter(|gpu| gpu.uuid.to_ascii_lowercase().starts_with(&wanted));
        return match (matching.next(), matching.next()) {
            (Some(gpu), None) => Ok(gpu),
            (Some(_), Some(_)) => fail(format!("`{entry}` begins the UUID of more than one GPU")),
            (None, _) => fail(format!("no GPU has the UUID `{entry}`")),
        };
    }
    let Ok(number) = entry.parse::<u32>() else {
        return fail(format!("`{entry}` is neither an index nor a UUID (GPU-…)"));
    };
    let found = gpus.iter().enumerate().find(|&(at, gpu)| number_of(variable, at, gpu, gpus) == number as usize);
    match found {
        Some((_, gpu)) => Ok(gpu),
        None => fail(format!("there is no GPU {entry}")),
    }
}

/// The variable's number for the GPU at this position on the bus. Slurm's numbers are device files; without them the
/// order on the bus is assumed.
fn number_of(variable: &str, at: usize, gpu: &NvidiaGpu, gpus: &[NvidiaGpu]) -> usize {
    match gpu.minor {
        Some(minor) if variable != CUDA && gpus.iter().all(|gpu| gpu.minor.is_some()) => minor as usize,
        _ => at,
    }
}

fn unusable(variable: &str, problem: String, gpus: &[NvidiaGpu]) -> Error {
    let known: Vec<String> = gpus
        .iter()
        .enumerate()
        .map(|(at, gpu)| format!("{} = {} = pci:{}", number_of(variable, at, gpu, gpus), gpu.uuid, gpu.bus))
        .collect();
    Error::usage(
        Place::item(variable),
        problem,
        format!("correct the variable or unset it; the NVIDIA driver has: {}", known.join(", ")),
    )
}

/// The driver's GPUs in the order of the PCI bus; none if there is no such driver or it cannot be read.
fn nvidia_gpus(root: &Path) -> Vec<NvidiaGpu> {
    let Ok(folders) = std::fs::read_dir(root.join("proc/driver/nvidia/gpus")) else { return Vec::new() };
    let mut gpus: Vec<NvidiaGpu> = folders
        .filter_map(|folder| {
            let folder = folder.ok()?;
            let text = std::fs::read_to_string(folder.path().join("information")).unwrap_or_default();
            let line = |key: &str| {
                let value = text.lines().find_map(|line| line.strip_prefix(key)?.trim_start().strip_prefix(':'));
                value.unwrap_or_default().trim()
            };
            Some(NvidiaGpu {
                bus: pci_bus_id(line("Bus Location")).or_else(|| pci_bus_id(&folder.file_name().to_string_lossy()))?,
                uuid: line("GPU UUID").to_owned(),
                model: line("Model").to_owned(),
                minor: line("Device Minor").parse().ok(),
            })
        })
        .collect();
    gpus.sort_by(|a, b| (a.bus.len(), &a.bus).cmp(&(b.bus.len(), &b.bus)));
    gpus
}

/// Removes the GPUs whose device file a cgroup or container denies; `/proc` still lists them. If no file opens, the
/// files may be created on first use, and all GPUs stay.
fn keep_those_that_open(gpus: &mut Vec<NvidiaGpu>, root: &Path) {
    let opens = |gpu: &NvidiaGpu| {
        let Some(minor) = gpu.minor else { return true };
        std::fs::File::options().read(true).write(true).open(root.join(format!("dev/nvidia{minor}"))).is_ok()
    };
    let open: Vec<bool> = gpus.iter().map(opens).collect();
    if open.contains(&true) {
        let mut open = open.into_iter();
        gpus.retain(|_| open.next().unwrap_or(true));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UUIDS: [&str; 3] = ["GPU-1111aaaa-0000", "GPU-1111bbbb-0000", "GPU-2222cccc-0000"];
    const BUSES: [&str; 3] = ["0000:17:00.0", "0000:65:00.0", "0000:ca:00.0"];

    /// A node with three GPUs whose device files have the reverse order of the bus: 2, 1, 0.
    fn node() -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for at in 0..3 {
            let folder = root.path().join("proc/driver/nvidia/gpus").join(BUSES[at]);
            std::fs::create_dir_all(&folder).unwrap();
            let information = format!(
                "Model: \t\t NVIDIA H200\nIRQ:   \t\t 63\nGPU UUID: \t {}\nBus Location: \t {}\nDevice Minor: \t {}\n",
                UUIDS[at],
                BUSES[at].to_uppercase(),
                2 - at
            );
            std::fs::write(folder.join("information"), information).unwrap();
        }
        root
    }

    fn on(root: &Path, variables: &[(&str, &str)]) -> Result<Option<Vec<String>>> {
        visible(&|name| variables.iter().find(|v| v.0 == name).map(|v| v.1.to_owned()), root)
    }

    fn cuda(value: &str) -> Result<Option<Vec<String>>> {
        on(node().path(), &[(CUDA, value)])
    }

    fn buses<const N: usize>(at: [usize; N]) -> Option<Vec<String>> {
        Some(at.iter().map(|&k| BUSES[k].to_owned()).collect())
    }

    fn problem(result: Result<Option<Vec<String>>>) -> String {
        match result {
            Err(error @ Error::Usage { .. }) => format!("{error}; {}", error.help().unwrap()),
            other => panic!("{other:?} is no usage error"),
        }
    }

    #[test]
    fn without_a_variable_nothing_is_restricted() {
        assert_eq!(on(node().path(), &[]).unwrap(), None);
    }

    #[test]
    fn indices_follow_the_bus_and_keep_the_order_of_the_list() {
        assert_eq!(cuda("0").unwrap(), buses([0]));
        assert_eq!(cuda("2,0").unwrap(), buses([2, 0]));
        assert_eq!(cuda(" 1 , 2 ").unwrap(), buses([1, 2]));
    }

    #[test]
    fn a_uuid_may_be_cut_short_as_long_as_it_means_one_gpu() {
        assert_eq!(cuda("GPU-2222").unwrap(), buses([2]));
        assert_eq!(cuda("GPU-1111BBBB-0000,0").unwrap(), buses([1, 0]));
        assert!(problem(cuda("GPU-1111")).contains("more than one GPU"));
        assert!(problem(cuda("GPU-3333")).contains("no GPU has the UUID `GPU-3333`"));
    }

    #[test]
    fn what_cuda_takes_for_no_device_hides_all_that_follow() {
        for value in ["", "-1", "NoDevFiles", "-1,0", ","] {
            assert_eq!(cuda(value).unwrap(), buses([]), "{value:?}");
        }
        assert_eq!(cuda("0,2,-1,1").unwrap(), buses([0, 2]));
    }

    #[test]
    fn an_entry_that_means_nothing_is_an_error_that_lists_what_there_is() {
        for (value, says) in [
            ("3", "there is no GPU 3"),
            ("0,0", "`0` names pci:0000:17:00.0 a second time"),
            ("all", "neither an index nor a UUID"),
            ("0,,1", "neither an index nor a UUID"),
        ] {
            let problem = problem(cuda(value));
            assert!(problem.contains(says) && problem.contains(CUDA), "{value}: {problem}");
            assert!(problem.contains("2 = GPU-2222cccc-0000 = pci:0000:ca:00.0"), "{problem}");
        }
    }

    #[test]
    fn a_part_of_a_gpu_is_refused_with_what_to_do_instead() {
        let problem = problem(cuda("MIG-41b2e1f0-0000"));
        assert!(problem.contains("Vulkan cannot select") && problem.contains("option `backend = cpu`"), "{problem}");
    }

    #[test]
    fn slurm_counts_device_files_where_cuda_counts_along_the_bus() {
        let node = node();
        assert_eq!(on(node.path(), &[("SLURM_JOB_GPUS", "0,1")]).unwrap(), buses([2, 1]));
        assert_eq!(on(node.path(), &[(CUDA, "0,1")]).unwrap(), buses([0, 1]));
        let problem = problem(on(node.path(), &[("SLURM_JOB_GPUS", "7")]));
        assert!(problem.contains("0 = GPU-2222cccc-0000 = pci:0000:ca:00.0"), "{problem}");
    }

    #[test]
    fn cuda_wins_over_slurm_and_the_step_over_the_job() {
        let node = node();
        let (job, step) = (("SLURM_JOB_GPUS", "0,1,2"), ("SLURM_STEP_GPUS", "1"));
        assert_eq!(on(node.path(), &[job, step]).unwrap(), buses([1]));
        assert_eq!(on(node.path(), &[job, step, (CUDA, "2")]).unwrap(), buses([2]));
        assert_eq!(on(node.path(), &[job, (CUDA, "")]).unwrap(), buses([]));
    }

    #[test]
    fn a_job_confined_to_one_gpu_finds_it_under_index_0() {
        let node = node();
        std::fs::create_dir(node.path().join("dev")).unwrap();
        // The cgroup allows only the file of the last GPU on the bus.
        std::fs::write(node.path().join("dev/nvidia0"), "").unwrap();
        assert_eq!(on(node.path(), &[(CUDA, "0")]).unwrap(), buses([2]));
        assert_eq!(on(node.path(), &[(CUDA, "0"), ("SLURM_JOB_GPUS", "0")]).unwrap(), buses([2]));
        assert_eq!(on(node.path(), &[("SLURM_JOB_GPUS", "0")]).unwrap(), buses([2]));
        assert!(problem(on(node.path(), &[(CUDA, "1")])).contains("there is no GPU 1"));
    }

    #[test]
    fn without_a_gpu_of_nvidia_the_variables_say_nothing() {
        let root = tempfile::tempdir().unwrap();
        for value in ["0", "", "MIG-1", "nonsense"] {
            assert_eq!(on(root.path(), &[(CUDA, value)]).unwrap(), None, "no driver, {value:?}");
        }
        std::fs::create_dir_all(root.path().join("proc/driver/nvidia/gpus")).unwrap();
        assert_eq!(on(root.path(), &[(CUDA, "0")]).unwrap(), None, "a driver without a GPU");
    }
}
