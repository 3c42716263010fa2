//! The registry of driver models: one line each.

/// Calls a macro with one line per driver model, in the order of every table. A line has the file (here, as `.wgsl` in
/// `shaders/`, and as the table in a profile), the type, the type of its constants in a profile, and the name.
///
/// Attributes before a line apply only to the model's field in [`Profile`](crate::profile::Profile). With
/// `#[serde(default)]` a profile may omit the model's table if the constants have defaults. The models below have none,
/// so that a profile must give all their constants.
#[macro_export]
macro_rules! for_every_driver_model {
    ($callback:ident) => {
        $callback! {
            reg157, Reg157, Reg157Profile, "Reg157";
            cchdm, Cchdm, CchdmProfile, "CCHDM";
            rss, Rss, RssProfile, "RSS";
            fsm, Fsm, FsmProfile, "FSM";
        }
    };
}
