use crate::Result;
use crate::model::profile::Profile;
use crate::run::grid::{MapQuantity, Point};

#[derive(Clone, Copy)]
pub enum Perturbation {
    HalfStep,
    Shift(MapQuantity, f64, &'static str),
}

impl Perturbation {
    pub fn all() -> Vec<Perturbation> {
        use MapQuantity as Of;
        let mut all = vec![Perturbation::HalfStep];
        for (quantity, by, up, down) in [
            (Of::Gap, 0.01, "gap + 1 cm", "gap - 1 cm"),
            (Of::EgoSpeed, 0.1 / 3.6, "ego + 0.1 km/h", "ego - 0.1 km/h"),
            (Of::OtherSpeed, 0.1 / 3.6, "other + 0.1 km/h", "other - 0.1 km/h"),
        ] {
            all.push(Perturbation::Shift(quantity, by, up));
            all.push(Perturbation::Shift(quantity, -by, down));
        }
        all
    }

    pub fn label(&self) -> &'static str {
        match self {
            Perturbation::HalfStep => "half the time step",
            Perturbation::Shift(_, _, label) => label,
        }
    }

    pub fn profile(&self, profile: &Profile) -> Result<Profile> {
        match self {
            Perturbation::HalfStep => profile.clone().with_dt(profile.frame.dt_s / 2.0),
            Perturbation::Shift(..) => Ok(profile.clone()),
        }
    }

    pub fn point(&self, point: &Point) -> Option<Point> {
        match self {
            Perturbation::HalfStep => Some(*point),
            Perturbation::Shift(quantity, by, _) => {
                let value = point.get(*quantity)? + by;
                (value >= 0.0).then(|| point.with(*quantity, value))
            }
        }
    }
}
