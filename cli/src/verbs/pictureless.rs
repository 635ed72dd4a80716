//! The verbs that draw, in a program built without them: they take any arguments and say what is missing.

/// One verb: its module as the others have theirs.
macro_rules! missing {
    ($verb:ident, $about:literal) => {
        #[doc = concat!("`terrasoar ", stringify!($verb), "`.")]
        pub(super) mod $verb {
            #[doc = $about]
            #[derive(Debug, clap::Args)]
            #[command(disable_help_flag = true)]
            pub(crate) struct Args {
                /// Ignored
                #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
                ignored: Vec<std::ffi::OsString>,
            }

            pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
                super::refuse(stringify!($verb), &args.ignored)
            }
        }
    };
}

missing!(snapshot, "Draw a picture of a terrain as PNG (this program was built without pictures).");
missing!(movie, "Draw a flight as a movie (this program was built without pictures).");
missing!(view, "Fly over a terrain in a window (this program was built without pictures).");

fn refuse(verb: &str, _: &[std::ffi::OsString]) -> anyhow::Result<()> {
    anyhow::bail!(
        "this program was built without pictures, which {verb} draws; build it with the feature view (cargo build --release does)"
    )
}
