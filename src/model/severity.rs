//! How severe a contact is: the change of each vehicle's speed, and the probability of an injury by published curves.
//!
//! A contact is central and in line, as of two bodies on one path: what a rear-end contact of boxes can say. The curves were
//! fitted to occupants of passenger cars in crashes on roads; beyond the speeds of their data they are not evaluated.

use crate::model::criterion::Contact;
use crate::{Error, Place, Result};

/// Mass of a passenger car, kg (ours: a mid-size car with its driver).
pub const CAR_KG: f64 = 1500.0;
/// Mass of a heavy vehicle, kg (ours: a partly laden truck of 16 t).
pub const TRUCK_KG: f64 = 16_000.0;
/// Length from which a vehicle is a heavy one, m (ours; the data of motorways have no cars as long).
pub const TRUCK_FROM_M: f64 = 6.5;
/// Coefficient of restitution: 0 is a plastic contact, in which both vehicles leave with one speed (ours; the smallest ΔV).
pub const RESTITUTION: f64 = 0.0;

/// Mass of a vehicle by its length, kg.
pub fn mass_kg(length_m: f64) -> f64 {
    if length_m >= TRUCK_FROM_M { TRUCK_KG } else { CAR_KG }
}

/// Change of a vehicle's speed in a central contact, m/s, by conservation of momentum:
/// (1 + e) · m_other/(m_own + m_other) · closing speed.
pub fn delta_v_mps(closing_mps: f64, own_kg: f64, other_kg: f64) -> f64 {
    (1.0 + RESTITUTION) * other_kg / (own_kg + other_kg) * closing_mps.abs()
}

/// Changes of speed of ego and other vehicle of these lengths in a contact, m/s; `None` unless it is central: a side contact, and a
/// vehicle that drives away, are not.
pub fn contact_delta_v_mps(contact: Contact, closing_mps: f64, lengths_m: [f64; 2]) -> Option<[f64; 2]> {
    let [ego_kg, other_kg] = lengths_m.map(mass_kg);
    let both = [delta_v_mps(closing_mps, ego_kg, other_kg), delta_v_mps(closing_mps, other_kg, ego_kg)];
    (contact == Contact::Frontal && closing_mps > 0.0).then_some(both)
}

/// A published curve of the probability of an injury over the change of speed of the occupant's vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InjuryCurve {
    /// Name in options and files.
    pub name: &'static str,
    /// Injury: MAIS3+ is a maximum of at least 3, serious, on the Abbreviated Injury Scale.
    pub injury: &'static str,
    /// Source, with table or equation.
    pub source: &'static str,
    /// Whose occupants, in which crashes.
    pub of: &'static str,
    /// Largest change of speed that the source covers, m/s: that of its data, or of its formula.
    pub valid_to_mps: f64,
    form: Form,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Form {
    /// 1/(1 + exp(−(a + b ΔV))), ΔV in units of m/s times the last number.
    Logistic(f64, f64, f64),
    /// (ΔV/v)^4, v in m/s.
    FourthPower(f64),
}

/// Miles per hour in one metre per second.
const MPH: f64 = 1.0 / 0.447_04;

/// A curve of frontal crashes by NHTSA, whose data reach 60 mph.
const fn nhtsa(name: &'static str, injury: &'static str, (a, b): (f64, f64)) -> InjuryCurve {
    let source =
        "Wang, MAIS(05/08) injury probability curves as functions of delta V, NHTSA DOT HS 813 219, 2022, table A-6";
    let of = "occupants of cars in frontal crashes, United States, 2010 to 2015";
    InjuryCurve { name, injury, source, of, valid_to_mps: 60.0 / MPH, form: Form::Logistic(a, b, MPH) }
}

#[rustfmt::skip] // a table: one line per curve
/// All curves.
pub const INJURY_CURVES: [InjuryCurve; 3] = [
    nhtsa("nhtsa-2022-frontal-mais3", "MAIS3+", (-6.9774, 0.1620)),
    nhtsa("nhtsa-2022-frontal-fatal", "death", (-9.0422, 0.1571)),
    InjuryCurve {
        name: "joksch-1993-fatal",
        injury: "death",
        source: "Joksch, Velocity change and fatality risk in a crash: a rule of thumb, Accident Analysis and Prevention 25(1), 1993",
        of: "drivers of cars in crashes of two vehicles, United States, 1980 to 1986",
        valid_to_mps: 71.0 / MPH,
        form: Form::FourthPower(71.0 / MPH),
    },
];

impl InjuryCurve {
    /// Finds a curve by name.
    ///
    /// # Errors
    /// [`Error::Usage`] with the names that there are.
    pub fn find(name: &str) -> Result<&'static InjuryCurve> {
        INJURY_CURVES.iter().find(|curve| curve.name == name.trim()).ok_or_else(|| {
            let help = format!("there are {}", INJURY_CURVES.map(|curve| curve.name).join(", "));
            Error::usage(Place::option("injury"), format!("there is no curve `{name}`"), help)
        })
    }

    /// The risk of the ego's occupants in a contact with these [changes of speed](contact_delta_v_mps); `None` beyond the data, and for
    /// a truck, of which the curves are not.
    pub fn ego_risk(&self, delta_v_mps: Option<[f64; 2]>, ego_length_m: f64) -> Option<f64> {
        self.risk(delta_v_mps.filter(|_| mass_kg(ego_length_m) == CAR_KG)?[0])
    }

    /// Probability of the injury at a change of speed, m/s; `None` beyond the data.
    fn risk(&self, delta_v_mps: f64) -> Option<f64> {
        (delta_v_mps <= self.valid_to_mps).then(|| match self.form {
            Form::Logistic(a, b, per_mps) => 1.0 / (1.0 + libm::exp(-(a + b * delta_v_mps * per_mps))),
            Form::FourthPower(v_mps) => (delta_v_mps / v_mps).powi(4),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 36 km/h into a car of the same mass, plastic: both change by 18 km/h. Into a truck of 16 t: nearly all of it.
    #[test]
    fn momentum_divides_the_closing_speed_by_the_masses() {
        assert_eq!(delta_v_mps(10.0, CAR_KG, CAR_KG), 5.0);
        assert!((delta_v_mps(10.0, CAR_KG, TRUCK_KG) - 10.0 * 16_000.0 / 17_500.0).abs() < 1e-12);
        let both = delta_v_mps(10.0, CAR_KG, TRUCK_KG) * CAR_KG - delta_v_mps(10.0, TRUCK_KG, CAR_KG) * TRUCK_KG;
        assert!(both.abs() < 1e-9, "the momentum that one loses the other gains");
        assert_eq!((mass_kg(4.3), mass_kg(12.0)), (CAR_KG, TRUCK_KG));
    }

    /// The numbers of the sources by hand: at 30 mph 1/(1 + exp(6.9774 − 4.86)) = 0.1074; at half of 71 mph 1/16.
    #[test]
    fn a_curve_has_the_numbers_of_its_source_and_none_beyond_its_data() {
        let risk = |name: &str, mph: f64| InjuryCurve::find(name).unwrap().risk(mph / MPH);
        assert!((risk("nhtsa-2022-frontal-mais3", 30.0).unwrap() - 0.1074).abs() < 1e-4);
        assert!((risk("nhtsa-2022-frontal-fatal", 55.0).unwrap() - 0.4009).abs() < 1e-4);
        assert!((risk("joksch-1993-fatal", 35.5).unwrap() - 1.0 / 16.0).abs() < 1e-12);
        assert_eq!((risk("nhtsa-2022-frontal-mais3", 61.0), risk("joksch-1993-fatal", 72.0)), (None, None));
        for curve in &INJURY_CURVES {
            let risks: Vec<f64> = (0..60).filter_map(|mph| curve.risk(f64::from(mph) / MPH)).collect();
            assert!(risks.windows(2).all(|pair| pair[0] < pair[1]), "{}", curve.name);
        }
    }
}
