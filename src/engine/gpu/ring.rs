//! The ring of buffers: while the host reads the results of one job, the device computes the next.

use std::sync::mpsc;
use std::time::Instant;

use bytemuck::Zeroable;

use super::device::{Device, Kernel, PipelineSpec};
use super::generator::Inputs;
use super::pacing::Sharing;
use super::records::{Launch, OutcomeRecord, Tally};
use super::shader::{LONGEST_BURST, WORKGROUP};
use lanesweep_support::{Error, Result, option};

/// Maximum number of jobs in flight.
pub(super) const RING: usize = 3;

/// One job of the device: the lanes of consecutive units of one block, for every model.
#[derive(Debug, Clone)]
pub(super) struct Job {
    /// Its dispatches: every model with every case.
    pub dispatches: Vec<Dispatch>,
    /// Number of models.
    pub models: usize,
    /// Index of the first case in the buffer of cases.
    pub first_case: u32,
    /// Number of cases: units × variants.
    pub cases: u32,
    /// Number of variants of each unit.
    pub variants: u32,
    /// Number of headways of each case.
    pub headways: u32,
    /// Whether the pipelines write outcomes.
    pub has_outcomes: bool,
    /// Counts the lanes after them.
    pub tally: Option<TallyJob>,
}

/// The counting of a job.
#[derive(Debug, Clone)]
pub(super) struct TallyJob {
    pub pipeline: PipelineSpec,
    /// Number of counts.
    pub counts: usize,
}

/// The lanes of one model with all cases of a job, or with those of one variant.
#[derive(Debug, Clone)]
pub(super) struct Dispatch {
    pub pipeline: PipelineSpec,
    /// Position of the model in the plan.
    pub model: usize,
    /// The variant; `None`: all.
    pub variant: Option<u32>,
}

impl Job {
    /// Number of lanes per model.
    fn lanes(&self) -> u32 {
        self.cases * self.headways
    }

    /// The lanes of a dispatch; `at` is its position. The device decides how invocations share them.
    fn launch(&self, at: usize) -> Launch {
        let Dispatch { model, variant, .. } = &self.dispatches[at];
        let step = if variant.is_some() { self.variants } else { 1 };
        let first = variant.unwrap_or(0);
        Launch {
            lanes: self.lanes() / step,
            headways: self.headways,
            first_case: self.first_case + first,
            case_step: step,
            first_lane: first * self.headways,
            lanes_between: (step - 1) * self.headways,
            first_word: (model * self.words()) as u32,
            first_outcome: (model * self.records()) as u32,
            finished_word: at as u32,
            lanes_per_group: WORKGROUP,
            burst_from: 0,
        }
    }

    fn words(&self) -> usize {
        self.lanes().div_ceil(8) as usize
    }

    fn records(&self) -> usize {
        if self.has_outcomes { self.lanes() as usize } else { 0 }
    }
}

/// Results of a job, model by model.
#[derive(Debug)]
pub(super) struct Answer {
    /// Verdict words of each model.
    pub words: Vec<Vec<u32>>,
    /// Outcomes of each model, if requested.
    pub outcomes: Vec<Vec<OutcomeRecord>>,
    /// Counts, if requested.
    pub counts: Vec<u32>,
    /// Time of each dispatch, s, if the device measures it.
    pub seconds: Vec<f64>,
    /// Time of the slowest dispatch, s.
    pub slowest_s: f64,
    /// Time of all dispatches, s.
    pub device_s: f64,
}

/// The buffers of one job in flight. Later jobs reuse them unless they need more room.
#[derive(Default)]
pub(super) struct Slot {
    buffers: Option<Buffers>,
}

struct Buffers {
    launches: wgpu::Buffer,
    /// In the order of [`RESULTS`].
    results: [wgpu::Buffer; 4],
    tally: wgpu::Buffer,
    readback: wgpu::Buffer,
    timing: Option<(wgpu::QuerySet, wgpu::Buffer)>,
    dispatches: usize,
}

/// Results of a job. The last are counts of samples.
const RESULTS: [&str; 4] = ["verdicts", "outcomes", "finished", "counts"];

/// Size of each part of a job's results, bytes. The parts are consecutive in the read-back buffer, the times last.
#[derive(Clone, Copy)]
struct ResultSizes {
    results: [u64; 4],
    times: u64,
}

impl ResultSizes {
    fn of(job: &Job) -> ResultSizes {
        let outcomes = job.models * job.records() * size_of::<OutcomeRecord>();
        let counts = job.tally.as_ref().map_or(0, |tally| tally.counts * 4);
        let results = [job.models * job.words() * 4, outcomes, job.dispatches.len() * 4, counts];
        ResultSizes { results: results.map(|bytes| bytes as u64), times: (job.dispatches.len() * 16) as u64 }
    }

    fn total(&self) -> u64 {
        // Times are 64-bit words, so they start at a multiple of 8 bytes.
        self.results.iter().sum::<u64>().next_multiple_of(8) + self.times
    }
}

/// A job in flight.
pub(super) struct Flight {
    job: Job,
    /// Of each dispatch.
    sharings: Vec<Sharing>,
    parts: ResultSizes,
    submission: wgpu::SubmissionIndex,
    mapped: mpsc::Receiver<std::result::Result<(), wgpu::BufferAsyncError>>,
    since: Instant,
}

impl Slot {
    /// Submits a job to the device.
    pub(super) fn submit(&mut self, device: &mut Device, inputs: &Inputs, job: Job) -> Result<Flight> {
        let dispatches = job.dispatches.len();
        let parts = ResultSizes::of(&job);
        self.grow(device, &parts, dispatches);
        let specs = job.dispatches.iter().map(|dispatch| &dispatch.pipeline);
        let pipelines = device.pipelines(specs.chain(job.tally.iter().map(|tally| &tally.pipeline)))?;
        let buffers = self.buffers.as_ref().ok_or_else(|| device.failed("it has no buffers"))?;
        let stride = launch_stride(device);
        let mut launches = vec![0_u8; stride as usize * dispatches];
        let (mut groups, mut sharings) = (Vec::new(), Vec::new());
        for at in 0..dispatches {
            let mut launch = job.launch(at);
            let sharing = device.sharing(&job.dispatches[at].pipeline, launch.lanes);
            launch.lanes_per_group = WORKGROUP * sharing.lanes;
            launch.burst_from = LONGEST_BURST - sharing.burst;
            sharings.push(sharing);
            groups.push(launch.lanes.div_ceil(launch.lanes_per_group));
            let place = stride as usize * at;
            launches[place..place + size_of::<Launch>()].copy_from_slice(bytemuck::bytes_of(&launch));
        }
        device.queue.write_buffer(&buffers.launches, 0, &launches);
        let [verdicts, outcomes, finished, counts] = &buffers.results;
        let launch = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &buffers.launches,
            offset: 0,
            size: wgpu::BufferSize::new(size_of::<Launch>() as u64),
        });
        let others = [&inputs.cases, &inputs.starts, &inputs.speed, &inputs.lateral, verdicts, outcomes, finished];
        let Some(first) = job.dispatches.first() else { return Err(device.failed("a job has no lanes")) };
        let group = device.bind(first.pipeline.kernel, launch, &others);
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("job") });
        // The kernels add bits and counts to these words, so the words must start at zero.
        let results = || buffers.results.iter().zip(parts.results).filter(|(_, bytes)| *bytes > 0);
        for (buffer, bytes) in results() {
            encoder.clear_buffer(buffer, 0, Some(bytes));
        }
        for (at, (pipeline, groups)) in pipelines.iter().zip(groups).enumerate() {
            let timestamp_writes = buffers.timing.as_ref().map(|(set, _)| wgpu::ComputePassTimestampWrites {
                query_set: set,
                beginning_of_pass_write_index: Some(2 * at as u32),
                end_of_pass_write_index: Some(2 * at as u32 + 1),
            });
            device.dispatch(&mut encoder, pipeline, (&group, &[at as u32 * stride]), groups, timestamp_writes);
        }
        if let Some(pipeline) = pipelines.get(dispatches) {
            let samples = job.cases;
            let record = Tally { samples, first_drawn: job.first_case, words: job.words() as u32 };
            device.queue.write_buffer(&buffers.tally, 0, bytemuck::bytes_of(&record));
            let others = [&inputs.drawn, verdicts, counts];
            let group = device.bind(Kernel::Count, buffers.tally.as_entire_binding(), &others);
            device.dispatch(&mut encoder, pipeline, (&group, &[]), samples.div_ceil(WORKGROUP), None);
        }
        let mut at = 0;
        for (buffer, bytes) in results() {
            encoder.copy_buffer_to_buffer(buffer, 0, &buffers.readback, at, bytes);
            at += bytes;
        }
        if let Some((set, resolved)) = &buffers.timing {
            encoder.resolve_query_set(set, 0..2 * dispatches as u32, resolved, 0);
            encoder.copy_buffer_to_buffer(resolved, 0, &buffers.readback, at.next_multiple_of(8), parts.times);
        }
        let (sender, mapped) = mpsc::channel();
        encoder.map_buffer_on_submit(&buffers.readback, wgpu::MapMode::Read, 0..parts.total(), move |result| {
            // The receiver is gone if the job was abandoned.
            let _ = sender.send(result);
        });
        let since = Instant::now();
        let submission = device.queue.submit([encoder.finish()]);
        device.untroubled()?;
        Ok(Flight { job, sharings, parts, submission, mapped, since })
    }

    /// Waits for a job and reads its results. `previous` is the time at which the previous job ended.
    ///
    /// # Errors
    /// The outer error means that the state of the device is unknown; the inner error means that only this job failed.
    pub(super) fn finish(
        &mut self,
        device: &mut Device,
        flight: Flight,
        previous: Option<Instant>,
    ) -> Result<Result<Answer>> {
        let wait = wgpu::PollType::Wait {
            submission_index: Some(flight.submission.clone()),
            timeout: Some(device.options.timeout),
        };
        device.device.poll(wait).map_err(|error| match error {
            wgpu::PollError::Timeout => {
                device.failed(format!("it did not respond within {:?}", device.options.timeout))
            }
            error => device.failed(error.to_string()),
        })?;
        device.untroubled()?;
        // The time of this job excludes its time in the queue behind the previous job.
        let began = previous.map_or(flight.since, |done| done.max(flight.since));
        let wall_s = began.elapsed().as_secs_f64();
        let mapped = flight.mapped.recv_timeout(device.options.timeout);
        mapped
            .map_err(|_| device.failed("its results were not returned"))?
            .map_err(|e| device.failed(e.to_string()))?;
        let buffers = self.buffers.as_ref().ok_or_else(|| device.failed("it has no buffers"))?;
        let answer = {
            let view =
                buffers.readback.get_mapped_range(0..flight.parts.total()).map_err(|e| device.failed(e.to_string()))?;
            read(device, &flight, &view, wall_s)
        };
        buffers.readback.unmap();
        let seconds = answer.iter().flat_map(|answer| &answer.seconds);
        for ((at, dispatch), &seconds) in flight.job.dispatches.iter().enumerate().zip(seconds) {
            device.observe(&dispatch.pipeline, flight.job.launch(at).lanes, flight.sharings[at], seconds);
        }
        Ok(answer)
    }

    fn grow(&mut self, device: &Device, parts: &ResultSizes, dispatches: usize) {
        use wgpu::BufferUsages as Use;
        let enough = self.buffers.as_ref().is_some_and(|b| {
            b.dispatches == dispatches
                && b.readback.size() >= parts.total()
                && b.results.iter().zip(parts.results).all(|(buffer, bytes)| buffer.size() >= bytes)
        });
        if enough {
            return;
        }
        let (max_binding, max_size) = (device.max_binding(), device.device.limits().max_buffer_size);
        // Sizes are powers of two, so that buffers are rarely replaced; the device's limit is the maximum.
        let room = |bytes: u64, max_bytes: u64| bytes.next_power_of_two().min(max_bytes).max(bytes);
        let results = Use::STORAGE | Use::COPY_SRC | Use::COPY_DST;
        let stride = u64::from(launch_stride(device));
        self.buffers = Some(Buffers {
            launches: device.buffer("launches", stride * dispatches as u64, Use::UNIFORM | Use::COPY_DST),
            results: std::array::from_fn(|at| {
                device.buffer(RESULTS[at], room(parts.results[at], max_binding), results)
            }),
            tally: device.buffer("tally", size_of::<Tally>() as u64, Use::UNIFORM | Use::COPY_DST),
            readback: device.buffer("results", room(parts.total(), max_size), Use::MAP_READ | Use::COPY_DST),
            timing: device.timestamps.then(|| {
                let set = device.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("times"),
                    ty: wgpu::QueryType::Timestamp,
                    count: 2 * dispatches as u32,
                });
                let resolved = device.buffer("times", 16 * dispatches as u64, Use::QUERY_RESOLVE | Use::COPY_SRC);
                (set, resolved)
            }),
            dispatches,
        });
    }
}

fn launch_stride(device: &Device) -> u32 {
    (size_of::<Launch>() as u32).next_multiple_of(device.device.limits().min_uniform_buffer_offset_alignment)
}

/// Converts the bytes of the read-back buffer to results.
///
/// # Errors
/// [`Error::Device`] if the device did not complete every lane.
fn read(device: &Device, flight: &Flight, bytes: &[u8], wall_s: f64) -> Result<Answer> {
    let Flight { job, parts, .. } = flight;
    let models = job.models;
    let mut rest = bytes;
    let [verdicts, outcomes, finished, counts] = parts.results.map(|bytes| {
        let (part, after) = rest.split_at(bytes as usize);
        rest = after;
        part
    });
    let finished: Vec<u32> = bytemuck::pod_collect_to_vec(finished);
    let times = &bytes[(parts.total() - parts.times) as usize..parts.total() as usize];
    let expected = |at: usize| job.launch(at).lanes;
    if let Some(at) = (0..finished.len()).find(|&at| finished[at] != expected(at)) {
        let (name, lanes) = (job.dispatches[at].pipeline.kernel.name(), expected(at));
        let problem = format!("it completed {} of {lanes} lanes of {name}", finished[at]);
        let help = format!(
            "use {}; if lanes have very many steps, a larger time step ({}) may help",
            option("backend = cpu"),
            option("dt")
        );
        return Err(Error::device(&device.name, problem, help));
    }
    fn per_model(part: &[u8], models: usize, model: usize) -> &[u8] {
        let length = part.len() / models;
        &part[model * length..(model + 1) * length]
    }
    let times: Vec<u64> = bytemuck::pod_collect_to_vec(times);
    let period_s = f64::from(device.queue.get_timestamp_period()) * 1e-9;
    let dispatches = times.chunks_exact(2).map(|t| t[1].saturating_sub(t[0]) as f64 * period_s);
    let measured: Vec<f64> = if device.timestamps { dispatches.collect() } else { Vec::new() };
    let device_s: f64 = measured.iter().sum();
    let slowest_s = measured.iter().fold(0.0, |a: f64, b| a.max(*b));
    // If the timestamps do not work, the wall-clock time is used; it is an upper bound.
    let timed = slowest_s > 0.0;
    Ok(Answer {
        words: (0..models).map(|m| bytemuck::pod_collect_to_vec(per_model(verdicts, models, m))).collect(),
        outcomes: (0..models)
            .map(|m| {
                let part = per_model(outcomes, models, m);
                let mut records = vec![OutcomeRecord::zeroed(); part.len() / size_of::<OutcomeRecord>()];
                bytemuck::cast_slice_mut(&mut records).copy_from_slice(part);
                records
            })
            .collect(),
        counts: bytemuck::pod_collect_to_vec(counts),
        slowest_s: if timed { slowest_s } else { wall_s },
        device_s: if timed { device_s } else { wall_s },
        seconds: if timed { measured } else { Vec::new() },
    })
}
