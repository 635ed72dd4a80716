//! The program `terrasoar`. What it does is in the library; how it is asked to is in [`cli`].

#[cfg(feature = "view")]
mod app;
mod cli;
#[cfg(feature = "view")]
mod window;

fn main() -> std::process::ExitCode {
    cli::run()
}
