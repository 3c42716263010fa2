//! The GPU as a backend, opened once and used by any number of sessions. A session is a plan on the device: it divides
//! units into jobs, keeps the ring filled, and restores the plan's order in the results.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::JoinHandle;

use rayon::prelude::*;

use super::adapters::{AdapterCard, Adapters, DeviceKind};
use super::device::{GpuOptions, Kernel, PipelineSpec, Tampering};
use super::generator::GeneratorSetup;
use super::owner::{self, Cases, Command, Prepared, Request, Setup};
use super::pacing::Pacer;
use super::records::StartRecord;
use super::ring::{Answer, Dispatch, Job, RING, TallyJob};
use super::shader::{self, Specialization};
use super::tally::{MAX_COUNTED, counter};
use crate::counting::PackedLanes;
use crate::generated::Generator;
use crate::{
    Backend, Chunk, Constants, CountLayout, Counted, DeviceRecord, DeviceScene, LaneCase, LanePlan, Outcome, Session,
    Verdicts, Wanted,
};
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Tables;
use lanesweep_support::{Error, Result, option};

/// Jobs per chunk, so that the ring stays full: about three seconds with four models. Before the first measurement a
/// chunk is one job.
const JOBS_PER_CHUNK: u64 = 8;

/// Steps per model of the first job, if each lane makes every step.
const FIRST_STEPS: u64 = 1 << 26;

pub(super) struct GpuSession<'p> {
    plan: &'p LanePlan,
    device: String,
    commands: Sender<Command>,
    prepared: Prepared,
    /// One per block.
    constants: Vec<Constants<f32>>,
    /// An invocation computes several lanes.
    queue: bool,
    pacer: Pacer,
    /// The variants of a scenario get a dispatch each if they have different scenes.
    split_scenes: bool,
    /// The highest speed of the tables, m/s.
    fastest: f32,
    /// The scene of all samples, if the device makes the cases.
    made_scene: Option<DeviceScene>,
    /// The cases on the device: block, its units, and the scenes of their variants, or one of all.
    window: Option<(usize, Range<u64>, Vec<DeviceScene>)>,
    /// Time of all dispatches so far, s.
    device_s: f64,
    /// How the device counts lanes, if it can.
    counting: Option<(CountLayout, TallyJob)>,
    /// Units of the call after the next one.
    announced: Option<Range<u64>>,
    /// Jobs of announced units.
    ahead: Option<Ahead>,
}

/// Jobs that were sent before their call.
struct Ahead {
    wanted: Wanted,
    /// Plan units, from the first to the last that was sent.
    units: Range<u64>,
    pieces: VecDeque<Piece>,
}

/// Part of a run in flight.
struct Piece {
    block: usize,
    /// Units within the block.
    units: Range<u64>,
    answer: Receiver<Result<Answer>>,
}

impl<'p> GpuSession<'p> {
    fn new(plan: &'p LanePlan, device: String, commands: Sender<Command>, options: &GpuOptions) -> Result<Self> {
        ModelId::refuse_foreign(&plan.models, "a device", &format!("use {}", option("backend = cpu")))?;
        let queue = options.lanes_per_invocation != Some(1);
        let constants: Vec<Constants<f32>> =
            plan.blocks.iter().map(|b| Constants::resolve(&plan.profile, b.category)).collect();
        let tables: Tables<f32> = if plan.generator().is_some() { Tables::default() } else { plan.tables().cast() };
        let fastest = tables.speed.par_iter().copied().reduce(|| 0.0, f32::max);
        let mut pipelines = Vec::new();
        let made_scene = plan.generator().map(Generator::scene);
        if let Some(scene) = made_scene {
            for resolved in &constants {
                pipelines.extend(specs(plan, resolved, Specialization { scene, values: false, queue }));
            }
        }
        let setup = Box::new(Setup {
            starts: plan.headways.iter().map(|h| StartRecord::from(h.start::<f32>())).collect(),
            speed: tables.speed,
            lateral: tables.lateral,
            generator: plan.generator().map(GeneratorSetup::new),
            models: plan.models.len() as u64,
            pipelines,
        });
        let (reply, answer) = mpsc::channel();
        commands.send(Command::Prepare { setup, reply }).map_err(|_| owner::gone(&device))?;
        let prepared = answer.recv().map_err(|_| owner::gone(&device))??;
        let pacer = Pacer::new(options.first_lanes.min(FIRST_STEPS / u64::from(plan.profile.step_cap().max(1))));
        let counting = counter(plan);
        let split_scenes = options.split_scenes.unwrap_or(true);
        let (window, device_s, announced, ahead) = (None, 0.0, None, None);
        Ok(GpuSession {
            plan,
            device,
            commands,
            prepared,
            constants,
            queue,
            pacer,
            split_scenes,
            fastest,
            made_scene,
            window,
            device_s,
            counting,
            announced,
            ahead,
        })
    }

    fn max_lanes(&self, wanted: Wanted) -> u64 {
        self.prepared.max_lanes[usize::from(wanted == Wanted::Outcomes)]
    }

    /// Sends one job of units from the start of `units`; returns its end.
    fn send(&mut self, block: usize, units: Range<u64>, wanted: Wanted) -> Result<Piece> {
        let plan = self.plan;
        let variants = plan.blocks[block].variants.len() as u64;
        let per_unit = variants * plan.headways.len() as u64;
        let max_lanes = self.max_lanes(wanted);
        if per_unit > max_lanes || variants > self.prepared.max_cases {
            let problem =
                format!("one scenario has {per_unit} lanes per model, but the device holds at most {max_lanes}");
            return Err(Error::device(
                &self.device,
                problem,
                format!("use {}, or fewer headways", option("backend = cpu")),
            ));
        }
        let inside = matches!(&self.window, Some((at, held, _)) if *at == block && held.contains(&units.start));
        let mut cases = None;
        if !inside {
            let room = self.prepared.max_cases / variants;
            let end = (units.start + room).min(plan.blocks[block].units.held().end);
            // Within the requested units, because a generator's samples have no end.
            let end = if plan.generator().is_some() { end.min(units.end) } else { end };
            let scenes = if let Some(scene) = self.made_scene {
                cases = Some(Cases::Made(units.start, (end - units.start) as u32));
                vec![scene]
            } else {
                let upload = cases_of(plan, block, units.start..end);
                let scenes = self.scenes(&upload, variants as usize);
                cases = Some(Cases::Given(upload));
                scenes
            };
            self.window = Some((block, units.start..end, scenes));
        }
        let Some((_, held, scenes)) = &self.window else {
            return Err(Error::Internal("no cases are on the device".to_owned()));
        };
        let has_outcomes = wanted == Wanted::Outcomes;
        let tally = self.counting.as_ref().filter(|_| wanted == Wanted::Counts).map(|(_, tally)| tally.clone());
        let count = self.pacer.units(per_unit, max_lanes).min(if tally.is_some() { MAX_COUNTED } else { u64::MAX });
        let end = units.end.min(units.start + count).min(held.end);
        let constants = &self.constants[block];
        let mut dispatches = Vec::new();
        for (variant, &known) in (0..).zip(scenes) {
            // A void sample has no vehicle: its values tell.
            let is_void_told = has_outcomes && self.made_scene.is_some();
            let of_values = DeviceScene { is_all_paired: false, always_there: false, ..known };
            let scene = if is_void_told { of_values } else { known };
            let specialization = Specialization { scene, values: has_outcomes, queue: self.queue };
            let variant = (scenes.len() > 1).then_some(variant);
            let pipelines = specs(plan, constants, specialization).into_iter().enumerate();
            dispatches.extend(pipelines.map(|(model, pipeline)| Dispatch { pipeline, model, variant }));
        }
        let job = Job {
            dispatches,
            models: plan.models.len(),
            first_case: ((units.start - held.start) * variants) as u32,
            cases: ((end - units.start) * variants) as u32,
            variants: variants as u32,
            headways: plan.headways.len() as u32,
            has_outcomes,
            tally,
        };
        let (reply, answer) = mpsc::channel();
        let request = Box::new(Request { session: self.prepared.session, cases, job, reply });
        self.commands.send(Command::Run(request)).map_err(|_| owner::gone(&self.device))?;
        Ok(Piece { block, units: units.start..end, answer })
    }

    /// The scenes of cases, by variant if these differ.
    fn scenes(&self, cases: &[LaneCase<f32>], variants: usize) -> Vec<DeviceScene> {
        let (dt, fastest) = (self.plan.profile.frame.dt_s as f32, self.fastest);
        let of_variant = |variant: usize| {
            let cases = cases.iter().skip(variant).step_by(variants);
            cases.map(|case| DeviceScene::of(case, fastest, dt)).reduce(DeviceScene::join)
        };
        let mut scenes: Vec<DeviceScene> = (0..variants).into_par_iter().filter_map(of_variant).collect();
        if !self.split_scenes || scenes.windows(2).all(|two| two[0] == two[1]) {
            scenes = scenes.into_iter().reduce(DeviceScene::join).into_iter().collect();
        }
        scenes
    }

    /// Waits for a piece and stores its results.
    fn collect(&mut self, piece: Piece, chunk: &mut Chunk, wanted: Wanted) -> Result<()> {
        let answer = piece.answer.recv().map_err(|_| owner::gone(&self.device))??;
        let plan = self.plan;
        let block = &plan.blocks[piece.block];
        let models = plan.models.len();
        let per_unit = plan.lanes_per_unit(block);
        let lanes = ((piece.units.end - piece.units.start) * per_unit) as usize;
        self.pacer.observe(lanes as u64 / models as u64, answer.slowest_s);
        self.device_s += answer.device_s;
        let from = (block.first_lane + piece.units.start * per_unit - chunk.first_lane) as usize;
        if let Some(counted) = &mut chunk.counted {
            for (sum, count) in counted.counts.iter_mut().zip(answer.counts) {
                *sum += u64::from(count);
            }
            counted.packed.push(PackedLanes { first: (from / models) as u64, words: answer.words });
            return Ok(());
        }
        spread(&answer.words, &mut chunk.verdicts[from..from + lanes]);
        if wanted == Wanted::Outcomes {
            let criteria = &self.constants[piece.block].criteria;
            let outcomes: Option<Vec<Outcome<f64>>> = (0..lanes)
                .into_par_iter()
                .map(|at| Some(answer.outcomes[at % models][at / models].outcome(criteria)?.widen()))
                .collect();
            let outcomes = outcomes.ok_or_else(|| {
                Error::device(&self.device, "it did not write a lane", format!("use {}", option("backend = cpu")))
            })?;
            // Pieces come in the plan's order.
            chunk.outcomes.extend(outcomes);
        }
        Ok(())
    }

    /// Sends one job of plan units; returns it and the first unit after it.
    fn send_next(&mut self, units: Range<u64>, wanted: Wanted) -> Result<Option<(Piece, u64)>> {
        let Some((block, inside)) = self.plan.segments(units.clone()).into_iter().next() else { return Ok(None) };
        let piece = self.send(block, inside.clone(), wanted)?;
        let end = units.start + (piece.units.end - inside.start);
        Ok(Some((piece, end)))
    }

    /// The jobs of an interval of units that an announcement has sent; waits for others and drops them.
    fn take_ahead(&mut self, units: &Range<u64>, wanted: Wanted) -> (VecDeque<Piece>, u64) {
        match self.ahead.take() {
            Some(Ahead { wanted: theirs, units: sent, pieces })
                if theirs == wanted && sent.start == units.start && sent.end <= units.end =>
            {
                (pieces, sent.end)
            }
            other => {
                for piece in other.into_iter().flat_map(|ahead| ahead.pieces) {
                    // Nobody wants its results, nor its error: the next job has it too.
                    let _ = piece.answer.recv();
                }
                (VecDeque::new(), units.start)
            }
        }
    }

    /// Fills the ring with jobs of announced units beside `flying` others.
    fn send_ahead(&mut self, flying: usize, wanted: Wanted) {
        let Some(announced) = self.announced.clone() else { return };
        let start = announced.start;
        let mut ahead =
            self.ahead.take().unwrap_or_else(|| Ahead { wanted, units: start..start, pieces: VecDeque::new() });
        while flying + ahead.pieces.len() < RING {
            match self.send_next(ahead.units.end..announced.end, wanted) {
                Ok(Some((piece, end))) => {
                    ahead.pieces.push_back(piece);
                    ahead.units.end = end;
                }
                Ok(None) => break,
                Err(_) => {
                    // The call of these units sends them again and returns the error.
                    self.announced = None;
                    break;
                }
            }
        }
        self.ahead = Some(ahead);
    }

    /// Sends the jobs of an interval of units and collects their results.
    fn run_jobs(&mut self, units: Range<u64>, wanted: Wanted) -> Result<Chunk> {
        let plan = self.plan;
        let first_lane = plan.first_lane_of(units.start);
        let lanes = (plan.first_lane_of(units.end) - first_lane) as usize;
        let counted = self.counting.as_ref().filter(|_| wanted == Wanted::Counts).map(|(layout, _)| Counted {
            layout: *layout,
            counts: vec![0; layout.total()],
            packed: Vec::new(),
        });
        let mut chunk = Chunk {
            units: units.clone(),
            first_lane,
            verdicts: vec![Verdicts::default(); if counted.is_some() { 0 } else { lanes }],
            outcomes: Vec::new(),
            counted,
            redone_and_rechecked: [0; 2],
        };
        let (mut pending, mut from) = self.take_ahead(&units, wanted);
        loop {
            while pending.len() < RING
                && let Some((piece, end)) = self.send_next(from..units.end, wanted)?
            {
                from = end;
                pending.push_back(piece);
            }
            if from == units.end {
                self.send_ahead(pending.len(), wanted);
            }
            let Some(oldest) = pending.pop_front() else { break };
            self.collect(oldest, &mut chunk, wanted)?;
        }
        Ok(chunk)
    }
}

impl Session for GpuSession<'_> {
    fn run(&mut self, units: Range<u64>, wanted: Wanted) -> Result<Chunk> {
        let chunk = self.run_jobs(units, wanted);
        self.announced = None;
        if chunk.is_err() {
            // It is unknown whether the failed job copied its cases to the device.
            self.window = None;
            self.ahead = None;
        }
        chunk
    }

    fn announce(&mut self, units: Range<u64>) {
        self.announced = Some(units);
    }

    fn chunk_lanes(&self, wanted: Wanted) -> u64 {
        let max_lanes = if wanted == Wanted::Outcomes { 1 << 20 } else { 1 << 27 };
        let jobs = if self.device_s > 0.0 { JOBS_PER_CHUNK } else { 1 };
        (self.pacer.lanes() * self.plan.models.len() as u64 * jobs).clamp(1, max_lanes)
    }

    fn device_seconds(&self) -> Option<f64> {
        Some(self.device_s)
    }
}

impl Drop for GpuSession<'_> {
    fn drop(&mut self) {
        // If the thread has ended, its session has ended too.
        let _ = self.commands.send(Command::Close { session: self.prepared.session });
    }
}

/// The pipelines of a block, one per model of the plan.
fn specs(plan: &LanePlan, resolved: &Constants<f32>, specialization: Specialization) -> Vec<PipelineSpec> {
    let spec = |&model| PipelineSpec {
        kernel: Kernel::Lanes(model),
        constants: shader::constants(resolved, model, specialization),
    };
    plan.models.iter().map(spec).collect()
}

/// Cases in the order of the lanes: unit, variant.
fn cases_of(plan: &LanePlan, block: usize, units: Range<u64>) -> Vec<LaneCase<f32>> {
    let variants = plan.blocks[block].variants.len();
    units
        .into_par_iter()
        .flat_map_iter(|unit| (0..variants).map(move |variant| plan.case(block, unit, variant).cast()))
        .collect()
}

/// Writes the verdict words of each model in the plan's order, the model innermost.
fn spread(words: &[Vec<u32>], lanes: &mut [Verdicts]) {
    let models = words.len();
    lanes.par_chunks_mut(8 * models).enumerate().for_each(|(word, lanes)| {
        for (at, lane) in lanes.iter_mut().enumerate() {
            *lane = Verdicts((words[at % models][word] >> (4 * (at / models)) & 0xf) as u8);
        }
    });
}

/// Lanes as invocations of a WGSL kernel on one device.
#[derive(Debug)]
pub struct GpuBackend {
    card: AdapterCard,
    exact: bool,
    options: GpuOptions,
    commands: Sender<Command>,
    thread: Option<JoinHandle<()>>,
}

impl GpuBackend {
    /// Opens the device with this index.
    ///
    /// # Errors
    /// [`lanesweep_support::Error::Device`] if its driver refuses.
    pub fn open(adapters: &Adapters, index: usize, options: GpuOptions) -> Result<GpuBackend> {
        GpuBackend::open_tampered(adapters, index, options, Tampering::default())
    }

    /// The same, with faults that a test injects.
    ///
    /// # Errors
    /// As [`GpuBackend::open`].
    #[doc(hidden)]
    pub fn open_tampered(
        adapters: &Adapters,
        index: usize,
        mut options: GpuOptions,
        tampering: Tampering,
    ) -> Result<GpuBackend> {
        let adapter = adapters.take(index)?;
        let card = adapters.cards()[index].clone();
        if card.kind == DeviceKind::Software {
            // A software device has no warps that wait for their longest lane, and llvmpipe limits the turns of an
            // invocation.
            options.lanes_per_invocation.get_or_insert(1);
            options.split_scenes.get_or_insert(false);
        }
        let (commands, exact, thread) = owner::start(adapter, card.clone(), options.clone(), tampering)?;
        Ok(GpuBackend { card, exact, options, commands, thread: Some(thread) })
    }

    /// Description of the device.
    pub fn card(&self) -> &AdapterCard {
        &self.card
    }

    /// Description of the device for the record of a run.
    pub(crate) fn record(&self) -> DeviceRecord {
        DeviceRecord {
            name: self.card.name.clone(),
            api: self.card.api.label(),
            driver: self.driver(),
            pci_bus_id: self.card.pci_bus_id.clone(),
            exact_path: self.exact,
        }
    }

    fn driver(&self) -> String {
        [&self.card.driver[..], &self.card.driver_info].join(" ").trim().to_owned()
    }

    /// Float operations reach the driver unchanged, so that equality is guaranteed and not only checked.
    pub fn is_exact(&self) -> bool {
        self.exact
    }
}

impl Drop for GpuBackend {
    fn drop(&mut self) {
        // A session may outlive the backend and holds a sender, so a join before the last sender is dropped would
        // never return.
        let _ = self.commands.send(Command::End);
        if let Some(thread) = self.thread.take() {
            // Callers have already received the panic of that thread.
            let _ = thread.join();
        }
    }
}

impl Backend for GpuBackend {
    fn describe(&self) -> String {
        let path = if self.exact { "exact" } else { "plain" };
        format!("GPU {} ({}, {}), binary32, {path} path", self.card.name, self.card.api, self.driver())
    }

    fn prepare<'p>(&self, plan: &'p LanePlan) -> Result<Box<dyn Session + 'p>> {
        let commands = self.commands.clone();
        Ok(Box::new(GpuSession::new(plan, self.card.name.clone(), commands, &self.options)?))
    }
}
