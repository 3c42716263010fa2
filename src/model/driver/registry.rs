//! The registry of driver models: one line each.

/// Calls a macro with a line per driver model, in the order of every table: its file (here and, as `.wgsl`,
/// in `shaders/`; also its table in a profile), its type, the type of its constants in a profile, its name.
///
/// Attributes before a line go on the model's field in [`Profile`](crate::model::profile::Profile) and nowhere else:
/// with `#[serde(default)]` a profile may leave the model's table out, where the constants have defaults. The
/// models below have none, so that no profile forgets one of their constants.
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
