//! The compute devices of this machine.
//!
//! Here live the list of devices with what matters of each, the choice of the one that a user means, and what
//! the environment of a cluster job allows. Here lives no physics: a lane means the same on every device. Device
//! names come from the command line; the adapter goes to the backend that computes lanes on it.

mod adapters;
mod choice;
mod visible;

pub use adapters::{AdapterCard, AdapterLimits, Adapters, Api, DeviceKind, pci_bus_id};
pub use choice::{BackendChoice, DeviceName, choose};
pub use visible::{visible, visible_here};
