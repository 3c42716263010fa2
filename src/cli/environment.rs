//! The environment that drivers read, before any of them is asked.

#![allow(unsafe_code)] // changing the environment is unsafe where other threads may read it

/// Mesa's device-select layer complains on stderr of a missing `XDG_RUNTIME_DIR`, as if something had failed, and
/// reorders devices that lanesweep orders itself. Called first, before any thread is started.
pub fn quiet_drivers() {
    if std::env::var_os("NODEVICE_SELECT").is_none() {
        // SAFETY: the first thing that the program does; there is no other thread.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}
