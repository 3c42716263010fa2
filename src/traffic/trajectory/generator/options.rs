//! Options of the synthetic recordings, and the numbers on which the failures of recorded scenarios depend most. The
//! defaults are those of a study without data.

use lanesweep_support::{Result, config_tables, ranges};

config_tables! {
    /// Options of the generator. `lanesweep study` without data uses the default.
    pub struct GeneratorOptions {
        /// Seed of every random number. Same seed and options, same bits.
        pub seed: u64 = 20_240_901,
        /// Number of generated recordings. They are called `01`, `02`, ….
        #[schemars(range(min = 1, max = 99))]
        #[schemars(extend("x-flag" = "synth_recordings", "x-verbs" = ["study", "fit", "verify", "show", "tracks"]))]
        #[schemars(extend("x-heading" = "Data"))]
        pub recordings: usize = 84,
        /// Length of each recording, s.
        #[schemars(range(min = 1.0, max = 7200.0))]
        pub duration_s: f64 = 245.0,
        /// Samples per second; the simulation step is the largest fraction of a sample ≤ 0.04 s.
        #[schemars(range(min = 1.0, max = 200.0))]
        pub frame_rate_hz: f64 = 25.0,
        /// Length of road that the camera sees, m.
        #[schemars(range(min = 50.0, max = 5000.0))]
        pub window_m: f64 = 420.0,
        /// Mean flow per direction of travel, vehicles per hour, for roads with the default mix of two and
        /// three lanes (published: 3,350).
        #[schemars(range(min = 60.0, max = 4500.0))]
        pub flow_vehph: f64 = 3350.0,
        /// Fraction of trucks among all vehicles, 0 to 0.5 (published: about 0.2).
        #[schemars(range(min = 0.0, max = 0.5))]
        pub truck_fraction: f64 = 0.2,
        /// Factor on the rates of lane changes and hard braking in the camera's view. 1 stands for the published rates,
        /// which the traffic meets in part (`docs/src/validation.md`). The default gives as many kept cut-outs as the
        /// paper has, more cut-ins and LVDs, in a third of highD's time. A larger one disturbs the traffic: vehicles
        /// brake for lane changes of others.
        #[schemars(range(min = 0.0, max = 20.0))]
        pub event_rate_factor: f64 = 3.0,
        /// How scenarios arise.
        pub behaviour: Behaviour = Behaviour::default(),
    }

    /// How drivers change lanes and brake. Rates and fractions are those at rate factor 1.
    ///
    /// The defaults are fitted to the paper's 36 failure rates of S and to published traffic figures
    /// (`benches/calibrate_generator`, which also prints what other numbers give); four were then moved by hand.
    /// The fit never saw an F1, a claim of the paper or the seed of the default recordings.
    #[derive(Copy)]
    pub struct Behaviour {
        /// Factor on the desired speeds of cars.
        #[schemars(range(min = 0.5, max = 1.5))]
        pub car_speed_factor: f64 = 0.896,
        /// Braking of the new follower that reduces the acceptance of a gap by a factor e, m/s².
        #[schemars(range(min = 0.001, max = 10.0))]
        pub follower_braking_mps2: f64 = 0.00556,
        /// Fraction of decisions by a driver who accelerates during the change and lets a faster follower brake, 0 to
        /// 1.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub accelerating_fraction: f64 = 0.0464,
        /// The same braking of the new follower, for such a driver, m/s².
        #[schemars(range(min = 0.001, max = 10.0))]
        pub accelerating_follower_braking_mps2: f64 = 9.0,
        /// Mean acceleration of such a driver during the change where there is room, before values outside of 0 to 2.8
        /// m/s² are drawn again, m/s².
        #[schemars(range(min = 0.0, max = 2.8))]
        pub change_acceleration_mps2: f64 = 2.35,
        /// Median duration of lane changes, before those outside of the published 2.9 to 7.3 s are left out, s.
        #[schemars(range(min = 2.9, max = 7.3))]
        pub change_duration_s: f64 = 6.45,
        /// Factor on the rate at which trucks change lanes.
        #[schemars(range(min = 0.0, max = 20.0))]
        pub truck_change_factor: f64 = 1.2,
        /// Fraction of the time headway that a driver keeps to the new leader during a lane change.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub change_headway_fraction: f64 = 0.203,
        /// Rate of hard brakings of a vehicle with a follower, 1/s.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub brakings_per_s: f64 = 0.00009,
        /// Median time for which a hard braking is held, s.
        #[schemars(range(min = 0.1, max = 60.0))]
        pub braking_hold_s: f64 = 9.0,
        /// Mean excess of its peak over 2 m/s², m/s².
        #[schemars(range(min = 0.0, max = 5.0))]
        pub braking_excess_mps2: f64 = 0.543,
        /// How much harder than needed a driver brakes where the gap is too short, as a fraction of the comfortable
        /// deceleration.
        #[schemars(range(min = 0.0, max = 2.0))]
        pub overreaction: f64 = 0.226,
    }
}

impl GeneratorOptions {
    /// Checks every option; the error names the first one outside its range.
    pub(crate) fn validate(&self) -> Result<()> {
        ranges::check("generator", self)
    }

    /// Simulation steps per sample: the minimum with a step of at most 0.04 s.
    pub(super) fn steps_per_sample(&self) -> usize {
        // The small term keeps 25 Hz at one step although 0.04 is not exact in binary.
        ((25.0 / self.frame_rate_hz - 1e-9).ceil() as usize).max(1)
    }

    /// Samples per recording.
    pub(super) fn samples(&self) -> usize {
        (self.duration_s * self.frame_rate_hz).round() as usize
    }
}
