//! The program: everything is in the library's [`lanesweep::cli`].

fn main() -> std::process::ExitCode {
    lanesweep::cli::main()
}
