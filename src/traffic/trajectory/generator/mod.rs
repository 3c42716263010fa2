//! Generator of synthetic motorway recordings, the default data of the program.
//!
//! This module simulates traffic and records the view of a camera above the road. It has no scenarios: it schedules
//! lane changes and braking, and mining finds scenarios as in any recording. Input is [`GeneratorOptions`] with
//! random numbers; output is [`Recording`]s.
//!
//! # What is modelled
//! A straight road of 420 m in view (350 m before it, 250 m after it simulated as well), two carriageways
//! of two or three lanes, 25 samples a second. In the order of the data:
//!
//! | file | what | published figure it is set by (highD, where nothing else is said) |
//! |---|---|---|
//! | `inflow` | arrivals per lane in platoons: followers at their own headway and nearly the leader's speed, others freely | 3,350 veh/h per direction, 11–17 veh/km and lane, about 20 % trucks |
//! | `vehicle` | sizes, desired speeds, lognormal time headways | speed peaks near 23 m/s (trucks) and 33 m/s (cars); car IDM a 0.55 m/s², s0 3.4 m, T ≈ 1.5 s; sizes as in DLR-HT |
//! | `idm` | car-following: IDM with constant-acceleration heuristic | as above |
//! | `traffic` | correlated (Ornstein–Uhlenbeck) acceleration noise, lag, opening of the gap after a cut-in | noise sd 0.20–0.24 m/s², correlation 1.5 s |
//! | `lane_change` | motives (a faster lane, keeping right, letting a close follower pass) and gap acceptance; some drivers let a follower brake and accelerate | 0.24 line crossings per vehicle and km; cut-in THW mode 0.8–1.0 s, bulk 0.5–2.5 s, 4 % below 0.5 s; 362 of 2,992 cut-ins kept, 819 of 3,069 cut-outs |
//! | `lateral` | quintic lane changes with a mild asymmetry, wander in the lane | duration 2.9–7.3 s, profile close to a quintic |
//! | `braking` | scheduled hard brakings of one or two phases with an exponential tail | 482 of 20,351 leader decelerations above 2 m/s²; the paper's failure fractions of LVD |
//! | `options` | the numbers on which failures depend most, fitted by `benches/calibrate_generator` | the paper's 36 failure fractions of S |
//! | `events` | the hazards of lane changes and brakings, and the rate factor | 2,992 cut-ins, 3,069 cut-outs, 482 LVD above 2 m/s² in 109,986 data sets |
//!
//! `tests/traffic/generator_calibration.rs` prints these figures beside ours and fails if the difference exceeds its
//! limit. It names the figures that are outside.
//!
//! # What is fitted
//! The numbers of [`Behaviour`] are fitted, all others are set by hand to published traffic figures. The fit uses the
//! paper's 36 failure fractions of S, the numbers of scenarios found and kept, the density, the speeds of cars and
//! trucks, and overlapping vehicles. It never uses an F1 or a claim of the paper: those are predictions. Its recordings
//! have another seed than the default ones. Some fractions are not reached: `docs/src/validation.md` lists them.
//!
//! # The rate factor
//! At [`event_rate_factor`](GeneratorOptions::event_rate_factor) 1 scenarios are about as rare as published, but kept
//! LVDs twice as frequent. The default of 3 multiplies the *rate* of lane changes and hard braking in view. In a third
//! of the time, the default recordings then have as many kept cut-outs as the paper, a third more cut-ins and three
//! times as many LVDs. Rates increase slightly less than the factor, because lane changes obstruct each other. Gentle
//! decelerations are not raised, so a larger fraction of LVDs is kept. The numbers are fitted at this factor; 1 and 8
//! fit the published failures worse. At 8, lane changes disturb the traffic so much that closing speeds and brakings
//! become those of congestion.
//!
//! # Limits
//! The data contains no row of highD and was fitted to published figures only. It says nothing about real
//! traffic: do not quote exposure, risk or comparisons of driver models from it. Drivers are never distracted and
//! never abort a lane change; some braking has no visible cause. Vehicles that accelerate in a lane change do so with up
//! to 2.8 m/s², cars up to 1.5 times their desired speed: more than most can. There is no stop-and-go traffic other than
//! behind hard brakings, and there are no ramps, curves, motorcycles, weather or measurement errors.
//!
//! # Reproducibility
//! Random numbers are counter-based and named by (seed, recording, carriageway, purpose);
//! transcendentals come from `libm`; nothing depends on the order of a hash map or on threads; the time step is
//! fixed.

mod braking;
mod events;
mod idm;
mod inflow;
mod lane_change;
mod lateral;
mod options;
mod random;
mod recording;
mod traffic;
mod vehicle;

pub use options::{Behaviour, GeneratorOptions};

use rayon::prelude::*;

use crate::trajectory::Recording;
use lanesweep_support::error::{Error, Place, Result};

/// All recordings of these options, in order. The result does not depend on the number of threads.
pub fn generate(options: &GeneratorOptions) -> Result<Vec<Recording>> {
    options.validate()?;
    (0..options.recordings).into_par_iter().map(|index| recording::record(options, index)).collect()
}

/// The recording with this index (from 0), equal to that of [`generate`].
pub fn generate_one(options: &GeneratorOptions, index: usize) -> Result<Recording> {
    options.validate()?;
    if index >= options.recordings {
        let problem = format!("the options ask for {} recordings, counted from 0", options.recordings);
        let help = "raise `recordings` or choose a smaller index";
        return Err(Error::usage(Place::item(format!("generated recording {index}")), problem, help));
    }
    recording::record(options, index)
}
