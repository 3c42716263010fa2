//! Drivers outside the registry: a function that gets all running lanes at one step, in columns, and returns an
//! acceleration per lane. A program registers its driver under a name and uses it like the built-in ones.

use std::sync::{Arc, RwLock};

use super::ModelId;
use lanesweep_support::{Error, Place, Result, option};

/// Largest magnitude of an acceleration, m/s²: a larger one is an error of the driver.
pub const MAX_ACCELERATION_MPS2: f32 = 100.0;

/// One other vehicle as the drivers of all running lanes see it; an entry per lane.
#[derive(Debug, Default, Clone)]
pub struct VehicleColumns {
    /// The vehicle is there for the ego. Where it is not, the other entries have no meaning.
    pub present: Vec<bool>,
    /// It is there, and the driver may react to it: the attention rule of the model whose place the driver takes.
    pub attended: Vec<bool>,
    /// Speed, m/s.
    pub speed: Vec<f32>,
    /// Gap, bumper to bumper, m; negative when the vehicles overlap along the road.
    pub gap: Vec<f32>,
    /// Lateral gap, m; negative when the vehicles overlap laterally.
    pub lateral_gap: Vec<f32>,
    /// Lateral speed towards the ego, m/s.
    pub lateral_speed: Vec<f32>,
    /// Half the sum of both lengths, m: the distance of the centres is the gap plus this.
    pub half_lengths: Vec<f32>,
}

/// All running lanes of a batch at one step; an entry per lane.
#[derive(Debug, Default, Clone)]
pub struct LaneColumns {
    /// Index of the step.
    pub step: u32,
    /// Time since the start, s.
    pub time_s: f64,
    /// Position of each lane in its batch: where a driver keeps the lane's state. Ascending.
    pub lane: Vec<i64>,
    /// Speed of the ego, m/s.
    pub ego_speed: Vec<f32>,
    /// Acceleration of the ego over the last step, m/s²; 0 at the start.
    pub ego_acceleration: Vec<f32>,
    /// The principal vehicle, and the one ahead of it in a cut-out.
    pub vehicles: [VehicleColumns; 2],
}

/// Returns an acceleration, m/s², for every lane of the columns.
pub type Accelerations<'a> = Box<dyn FnMut(LaneColumns) -> Result<Vec<f32>> + 'a>;

/// A driver of many lanes at once.
pub trait VectorDriver: Send + Sync {
    /// The model whose attention rule and frame apply.
    fn stands_for(&self) -> ModelId {
        ModelId::Fsm
    }
    /// Whether the driver may accelerate. Lanes then run to a contact or the time cap; otherwise they also end once no
    /// further event is possible, like those of the built-in drivers.
    fn may_accelerate(&self) -> bool;
    /// Starts a batch of lanes with a time step of `dt_s`; the function keeps the state of their drivers.
    ///
    /// # Errors
    /// Those of the driver.
    fn start(&self, lanes: usize, dt_s: f64) -> Result<Accelerations<'_>>;
}

/// A registered driver: its position in the list of this process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ForeignId(u32);

struct Registered {
    name: &'static str,
    /// Name and fingerprint.
    identity: &'static str,
    stands_for: ModelId,
    driver: Arc<dyn VectorDriver>,
}

/// Never shrinks: an id stays valid.
static REGISTERED: RwLock<Vec<Registered>> = RwLock::new(Vec::new());

impl ModelId {
    /// Registers a driver under a name, which tables, files and lane keys have from then on. A later driver of the same
    /// name replaces it for later runs. `fingerprint` distinguishes drivers of one name in plans and journals: of two
    /// with equal fingerprints, results are taken for each other.
    ///
    /// # Errors
    /// [`Error::Usage`] for the name of a built-in model, a name that is not a word of letters, digits, `_`, `-` and
    /// `.`, and for more than 2³² drivers.
    pub fn register(name: &str, fingerprint: &str, driver: Arc<dyn VectorDriver>) -> Result<ModelId> {
        let place = || Place::item(format!("driver `{}`", lanesweep_support::plain_text::cut(name)));
        let is_word = |text: &str| text.bytes().all(|b| b.is_ascii_alphanumeric() || b"_-.".contains(&b));
        if name.is_empty() || name.len() > 40 || !is_word(name) || !is_word(fingerprint) {
            let help = "use a word of at most 40 letters, digits, `_`, `-` and `.`";
            return Err(Error::usage(place(), "a driver cannot be called so", help));
        }
        if ModelId::built_in(name).is_some() || name.eq_ignore_ascii_case("all") {
            return Err(Error::usage(place(), "a built-in model has this name", "choose another name"));
        }
        let stands_for = driver.stands_for();
        if matches!(stands_for, ModelId::Foreign(_)) {
            return Err(Error::usage(place(), "it stands for a driver that is not built in", "name a built-in model"));
        }
        let mut registered = REGISTERED.write().unwrap_or_else(std::sync::PoisonError::into_inner);
        let id = u32::try_from(registered.len());
        let id = id.map_err(|_| Error::usage(place(), "too many drivers are registered", "start a new process"))?;
        let (name, identity) = (name.to_owned(), format!("{name}@{fingerprint}"));
        registered.push(Registered { name: name.leak(), identity: identity.leak(), stands_for, driver });
        Ok(ModelId::Foreign(ForeignId(id)))
    }

    /// The last driver registered under a name, ignoring case, or under a name and fingerprint.
    pub(super) fn registered(text: &str) -> Option<ModelId> {
        let registered = REGISTERED.read().unwrap_or_else(std::sync::PoisonError::into_inner);
        let at = registered.iter().rposition(|one| one.name.eq_ignore_ascii_case(text) || one.identity == text)?;
        u32::try_from(at).ok().map(|id| ModelId::Foreign(ForeignId(id)))
    }

    /// The driver, if it is not built in.
    pub fn foreign(self) -> Option<Arc<dyn VectorDriver>> {
        match self {
            ModelId::Foreign(id) => Some(id.with(|one| one.driver.clone())),
            _ => None,
        }
    }

    /// Refuses drivers outside the registry where only built-in ones can run.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the driver and `what` cannot run it.
    pub fn refuse_foreign(models: &[ModelId], what: &str) -> Result<()> {
        match models.iter().find(|model| model.foreign().is_some()) {
            None => Ok(()),
            Some(model) => {
                let problem = format!("driver {} is a function of this process, which {what} cannot run", model.name());
                Err(Error::usage(
                    Place::option("models"),
                    problem,
                    format!("use {}, or a built-in model", option("backend = cpu")),
                ))
            }
        }
    }
}

impl ForeignId {
    fn with<T>(self, of: impl FnOnce(&Registered) -> T) -> T {
        let registered = REGISTERED.read().unwrap_or_else(std::sync::PoisonError::into_inner);
        of(&registered[self.0 as usize])
    }

    /// Name in tables, files and lane keys.
    pub(super) fn name(self) -> &'static str {
        self.with(|one| one.name)
    }

    /// Name and fingerprint, as plans have them.
    pub(super) fn identity(self) -> &'static str {
        self.with(|one| one.identity)
    }

    /// Index of the model whose attention rule and frame apply.
    pub(super) fn index(self) -> usize {
        self.with(|one| one.stands_for).index()
    }
}
