//! The verbs that draw, in a program built without pictures: they take any arguments and say what is missing.

/// One verb: its module as the others have theirs, what it does, and what is missing.
macro_rules! missing {
    ($verb:ident, $about:literal, $feature:literal, $what:literal) => {
        #[doc = concat!("`terrasoar ", stringify!($verb), "`.")]
        pub(super) mod $verb {
            #[doc = concat!($about, " (this program was built without ", $what, ").")]
            #[derive(Debug, clap::Args)]
            #[command(disable_help_flag = true)]
            pub(crate) struct Args {
                /// Ignored
                #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
                ignored: Vec<std::ffi::OsString>,
            }

            pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
                super::refuse(stringify!($verb), &args.ignored, [$what, $feature])
            }
        }
    };
}

#[cfg(not(feature = "pictures"))]
missing!(snapshot, "Draw a picture of a terrain as PNG", "pictures", "pictures");
#[cfg(not(feature = "pictures"))]
missing!(movie, "Draw a flight as a movie", "pictures", "pictures");
missing!(view, "Fly over a terrain in a window", "view", "a window");

fn refuse(verb: &str, _: &[std::ffi::OsString], [what, feature]: [&str; 2]) -> anyhow::Result<()> {
    anyhow::bail!(
        "this program was built without {what}, which {verb} needs; build it with the feature {feature} (cargo build --release does)"
    )
}
