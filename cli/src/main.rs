//! The program `terrasoar`. What it does is in the library; how it is asked to is in [`cli`](verbs).

mod verbs;
#[cfg(feature = "view")]
mod window;

fn main() -> std::process::ExitCode {
    verbs::run()
}
