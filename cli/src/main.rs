//! The program `terrasoar`. The work is done in libraries; the command line is in [`verbs`].

#[cfg(all(unix, feature = "view"))]
mod asked;
mod beside;
mod fit;
mod lost;
mod numbers;
mod verbs;
#[cfg(feature = "view")]
mod window;

fn main() -> std::process::ExitCode {
    verbs::run()
}
