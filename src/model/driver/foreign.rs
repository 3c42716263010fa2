//! Drivers outside the registry: a function that gets all running lanes at one step, in rows of numbers, and writes an
//! acceleration per lane. A program registers its driver under a name and uses it like the built-in ones.

use std::sync::{Arc, RwLock};

use super::ModelId;
use lanesweep_support::{Error, Place, Result};

/// Largest magnitude of an acceleration, m/s²: a larger one is an error of the driver.
pub const MAX_ACCELERATION_MPS2: f32 = 100.0;

/// Rows of [`LaneColumns::rows`]: the ego's, then those of the principal vehicle, then those of the one ahead of it in a
/// cut-out. Numbers are m, m/s and m/s²; flags are 1 or 0.
pub mod row {
    /// Speed of the ego.
    pub const EGO_SPEED: usize = 0;
    /// Acceleration of the ego over the last step; 0 at the start.
    pub const EGO_ACCELERATION: usize = 1;
    /// First row of each other vehicle; the following rows are counted from it.
    pub const VEHICLES: [usize; 2] = [2, 9];
    /// Flag: the vehicle is there for the ego. Where it is not, its other rows have no meaning.
    pub const PRESENT: usize = 0;
    /// Flag: it is there, and the driver may react to it: the attention rule of the model whose place the driver takes.
    pub const ATTENDED: usize = 1;
    /// Speed.
    pub const SPEED: usize = 2;
    /// Gap, bumper to bumper; negative when the vehicles overlap along the road.
    pub const GAP: usize = 3;
    /// Lateral gap; negative when the vehicles overlap laterally.
    pub const LATERAL_GAP: usize = 4;
    /// Lateral speed towards the ego.
    pub const LATERAL_SPEED: usize = 5;
    /// Half the sum of both lengths: the distance of the centres is the gap plus this.
    pub const HALF_LENGTHS: usize = 6;
    /// Number of rows.
    pub const COUNT: usize = 16;
}

/// All running lanes of a batch at one step.
#[derive(Debug, Default, Clone)]
pub struct LaneColumns {
    /// Index of the step.
    pub step: u32,
    /// Time step, s.
    pub dt_s: f64,
    /// Position of each running lane in its batch: where a driver keeps the lane's state. In no order.
    pub lane: Vec<i64>,
    /// Entries of a row, at least one per running lane; the others have no meaning.
    pub stride: usize,
    /// What the drivers see: the rows of [`row`], one after the other. A driver may take them away.
    pub rows: Vec<f32>,
    /// Rows of the drivers' own ([`VectorDriver::state_rows`]), which move with the lanes; 0 at the start.
    pub state: Vec<f32>,
}

impl LaneColumns {
    /// A row, with an entry per running lane.
    pub fn row(&self, row: usize) -> &[f32] {
        &self.rows[row * self.stride..][..self.lane.len()]
    }
}

/// Writes an acceleration, m/s², for every running lane of the columns.
pub type Accelerations<'a> = Box<dyn FnMut(&mut LaneColumns, &mut [f32]) -> Result<()> + 'a>;

/// A driver of many lanes at once.
pub trait VectorDriver: Send + Sync {
    /// The model whose attention rule and frame apply.
    fn stands_for(&self) -> ModelId {
        ModelId::Fsm
    }
    /// Whether the driver may accelerate. Lanes then run to a contact or the time cap; otherwise they also end once no
    /// further event is possible, like those of the built-in drivers.
    fn may_accelerate(&self) -> bool;
    /// Maximum number of lanes of a batch. Batches run in threads, each with a function of its own; without a maximum, one
    /// after the other.
    fn batch_lanes(&self) -> usize {
        usize::MAX
    }
    /// Number of the rows of [`LaneColumns::state`].
    fn state_rows(&self) -> usize {
        0
    }
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
    /// [`Error::Usage`] that names the driver, `what` cannot run it, and what can.
    pub fn refuse_foreign(models: &[ModelId], what: &str, instead: &str) -> Result<()> {
        match models.iter().find(|model| model.foreign().is_some()) {
            None => Ok(()),
            Some(model) => {
                let problem = format!("driver {} is a function of this process, which {what} cannot run", model.name());
                Err(Error::usage(Place::option("models"), problem, format!("{instead}, or use a built-in model")))
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
