//! The program `terrasoar`. What it does is in the library; how it is asked to is in [`cli`].

mod cli;

fn main() -> std::process::ExitCode {
    cli::run()
}
