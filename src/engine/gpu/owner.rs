//! One thread owns the device. It submits jobs while the ring has space, and waits for the oldest.

use std::collections::{HashMap, VecDeque};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, Receiver, Sender, TryRecvError};
use std::thread::JoinHandle;
use std::time::Instant;

use super::adapters::AdapterCard;
use super::device::{Device, GpuOptions, PipelineSpec, Tampering};
use super::generator::{GeneratorSetup, Inputs, generate};
use super::records::StartRecord;
use super::ring::{Answer, Flight, Job, RING, Slot};
use crate::LaneCase;
use lanesweep_support::{Error, Result, option};

/// Requirements of a session on the device.
pub(super) struct Setup {
    pub starts: Vec<StartRecord>,
    pub speed: Vec<f32>,
    pub lateral: Vec<[f32; 2]>,
    /// Makes the cases on the device, if the host does not.
    pub generator: Option<GeneratorSetup>,
    /// Models of a job.
    pub models: u64,
    /// Compiled before the first job, if they are known then.
    pub pipelines: Vec<PipelineSpec>,
}

/// The cases that a session holds from now on.
pub(super) enum Cases {
    /// From the host.
    Given(Vec<LaneCase<f32>>),
    /// Made on the device: first sample, number of samples.
    Made(u64, u32),
}

/// A job and its cases, unless the device already has them.
pub(super) struct Request {
    pub session: u64,
    pub cases: Option<Cases>,
    pub job: Job,
    pub reply: Sender<Result<Answer>>,
}

pub(super) enum Command {
    Prepare {
        setup: Box<Setup>,
        reply: Sender<Result<Prepared>>,
    },
    Run(Box<Request>),
    Close {
        session: u64,
    },
    /// The backend ends; remaining sessions get an error.
    End,
}

/// A session on the device.
#[derive(Debug, Clone, Copy)]
pub(super) struct Prepared {
    pub session: u64,
    /// Maximum number of lanes per model of a job: verdicts, outcomes.
    pub max_lanes: [u64; 2],
    /// Maximum number of cases on the device.
    pub max_cases: u64,
}

/// Starts the thread and opens the device in it. Returns also whether float operations reach the driver unchanged.
pub(super) fn start(
    adapter: wgpu::Adapter,
    card: AdapterCard,
    options: GpuOptions,
    tampering: Tampering,
) -> Result<(Sender<Command>, bool, JoinHandle<()>)> {
    let (sender, commands) = mpsc::channel();
    let (opened_sender, opened) = mpsc::channel();
    let name = card.name.clone();
    let work = move || match Device::open(&adapter, &card, options, tampering) {
        Ok(device) => {
            let _ = opened_sender.send(Ok(device.exact));
            DeviceOwner::new(device).serve(&commands);
        }
        Err(error) => {
            let _ = opened_sender.send(Err(error));
        }
    };
    // A panic in a driver binding ends the thread; every pending call then returns an error.
    let guarded = move || drop(catch_unwind(AssertUnwindSafe(work)));
    let thread = std::thread::Builder::new()
        .name("lanesweep device".to_owned())
        .spawn(guarded)
        .map_err(|e| Error::io("the device's thread", "start", e))?;
    let opened = opened.recv().map_err(|_| gone(&name))??;
    Ok((sender, opened, thread))
}

/// The error of a thread that ended.
pub(super) fn gone(device: &str) -> Error {
    Error::device(
        device,
        "it is closed, or its driver failed and ended its thread",
        format!("use {}", option("backend = cpu")),
    )
}

struct DeviceOwner {
    device: Device,
    sessions: HashMap<u64, Inputs>,
    next_session: u64,
    jobs: u64,
    free: Vec<Slot>,
    flying: VecDeque<(Slot, Flight, Sender<Result<Answer>>)>,
    /// End of the last job.
    last_done: Option<Instant>,
    /// The error after which no further job is submitted.
    dead: Option<String>,
}

impl DeviceOwner {
    fn new(device: Device) -> DeviceOwner {
        let free = (0..RING).map(|_| Slot::default()).collect();
        let (sessions, flying) = (HashMap::new(), VecDeque::new());
        DeviceOwner { device, sessions, next_session: 0, jobs: 0, free, flying, last_done: None, dead: None }
    }

    fn serve(&mut self, commands: &Receiver<Command>) {
        loop {
            let command = if self.flying.is_empty() {
                commands.recv().map_err(|_| TryRecvError::Disconnected)
            } else if self.free.is_empty() {
                Err(TryRecvError::Empty)
            } else {
                commands.try_recv()
            };
            match command {
                Ok(Command::End) | Err(TryRecvError::Disconnected) => {
                    while !self.flying.is_empty() {
                        self.finish_oldest();
                    }
                    return;
                }
                Ok(command) => self.obey(command),
                Err(TryRecvError::Empty) => self.finish_oldest(),
            }
        }
    }

    fn obey(&mut self, command: Command) {
        match command {
            Command::Prepare { setup, reply } => {
                let prepared = self.prepare(&setup);
                let _ = reply.send(prepared);
            }
            Command::Run(request) => {
                let Request { session, cases, job, reply } = *request;
                match self.submit(session, cases, job) {
                    Ok((slot, flight)) => self.flying.push_back((slot, flight, reply)),
                    Err(error) => {
                        let _ = reply.send(Err(error));
                    }
                }
            }
            Command::Close { session } => {
                self.sessions.remove(&session);
            }
            Command::End => (),
        }
    }

    fn prepare(&mut self, setup: &Setup) -> Result<Prepared> {
        self.alive()?;
        self.device.pipelines(setup.pipelines.iter())?;
        let generator = setup.generator.as_ref().map(|g| g.upload(&mut self.device)).transpose()?;
        let sample_bytes = setup.generator.as_ref().map_or(size_of::<LaneCase<f32>>() as u64, |g| g.sample_bytes());
        let inputs = Inputs {
            starts: self.device.upload("headways", &setup.starts)?,
            speed: self.device.upload("speeds", &setup.speed)?,
            lateral: self.device.upload("lateral motions", &setup.lateral)?,
            cases: self.device.upload::<LaneCase<f32>>("cases", &[])?,
            drawn: self.device.upload::<u32>("drawn samples", &[])?,
            generator,
        };
        let session = self.next_session;
        self.next_session += 1;
        self.sessions.insert(session, inputs);
        let models = setup.models;
        let record = size_of::<super::records::OutcomeRecord>() as f64;
        let max_lanes = [0.5, record + 0.5].map(|bytes| self.device.max_lanes(models, bytes));
        let max_bytes = if setup.generator.is_some() { self.device.max_made_bytes } else { MAX_CASE_BYTES };
        let max_bytes = self.device.max_binding().min(max_bytes);
        Ok(Prepared { session, max_lanes, max_cases: (max_bytes / sample_bytes).max(1) })
    }

    fn submit(&mut self, session: u64, cases: Option<Cases>, job: Job) -> Result<(Slot, Flight)> {
        self.alive()?;
        let device = &mut self.device;
        if let Some(before_job) = &device.tampering.before_job {
            before_job(self.jobs, &device.device).map_err(|problem| device.failed(problem))?;
        }
        self.jobs += 1;
        let inputs = self.sessions.get_mut(&session).ok_or_else(|| device.failed("the session is closed"))?;
        match cases {
            None => (),
            Some(Cases::Made(first, count)) => generate(device, inputs, first, count)?,
            Some(Cases::Given(cases)) => {
                let bytes: &[u8] = bytemuck::cast_slice(&cases);
                if inputs.cases.size() >= bytes.len() as u64 {
                    // Ordered after the jobs in flight, which still read the old ones.
                    device.queue.write_buffer(&inputs.cases, 0, bytes);
                } else {
                    inputs.cases = device.upload("cases", &cases)?;
                }
            }
        }
        let mut slot = self.free.pop().unwrap_or_default();
        match slot.submit(device, inputs, job) {
            Ok(flight) => Ok((slot, flight)),
            Err(error) => {
                // Its buffers may be incomplete.
                self.free.push(Slot::default());
                self.dead = Some(error.to_string());
                Err(error)
            }
        }
    }

    fn finish_oldest(&mut self) {
        let Some((mut slot, flight, reply)) = self.flying.pop_front() else { return };
        let finished = self.alive().and_then(|()| slot.finish(&mut self.device, flight, self.last_done));
        self.last_done = Some(Instant::now());
        let answer = match finished {
            Ok(answer) => {
                self.free.push(slot);
                answer
            }
            Err(error) => {
                self.free.push(Slot::default());
                self.dead.get_or_insert_with(|| error.to_string());
                Err(error)
            }
        };
        let _ = reply.send(answer);
    }

    /// After a failure the device's state is unknown: no further job is submitted.
    fn alive(&self) -> Result<()> {
        match &self.dead {
            None => Ok(()),
            Some(why) => Err(self.device.failed(format!("it failed earlier ({why})"))),
        }
    }
}

/// Maximum size of the cases on the device, bytes.
const MAX_CASE_BYTES: u64 = 64 << 20;
