//! The registry of driver models: one line each.

/// Calls a macro with a line per driver model, in the order of every table: its file (here and, as `.wgsl`,
/// in `shaders/`; also its table in a profile), its type, the type of its constants in a profile, its name.
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
