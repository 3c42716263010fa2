//! The GPU as a backend: opened once, used by any number of sessions.

use std::sync::mpsc::Sender;
use std::thread::JoinHandle;

use super::adapters::{AdapterCard, Adapters};
use super::device::GpuOptions;
use super::owner::{self, Command};
use super::session::GpuSession;
use crate::Result;
use crate::engine::{Backend, LanePlan, Session};

/// Lanes as invocations of a WGSL kernel on one device.
#[derive(Debug)]
pub struct GpuBackend {
    card: AdapterCard,
    exact: bool,
    options: GpuOptions,
    commands: Sender<Command>,
    thread: Option<JoinHandle<()>>,
}

impl std::fmt::Debug for Command {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Command")
    }
}

impl GpuBackend {
    /// Opens the device with this index.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if its driver refuses.
    pub fn open(adapters: &Adapters, index: usize, options: GpuOptions) -> Result<GpuBackend> {
        let adapter = adapters.take(index)?;
        let card = adapters.cards()[index].clone();
        let (commands, opened, thread) = owner::start(adapter, card.clone(), options.clone())?;
        Ok(GpuBackend { card, exact: opened.exact, options, commands, thread: Some(thread) })
    }

    /// Description of the device.
    pub fn card(&self) -> &AdapterCard {
        &self.card
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
        let driver = [&self.card.driver[..], &self.card.driver_info].join(" ").trim().to_owned();
        format!("GPU {} ({}, {driver}), binary32, {path} path", self.card.name, self.card.api)
    }

    fn prepare<'p>(&self, plan: &'p LanePlan) -> Result<Box<dyn Session + 'p>> {
        let commands = self.commands.clone();
        Ok(Box::new(GpuSession::new(plan, self.card.name.clone(), commands, self.options.first_lanes)?))
    }
}
