//! The verbs that draw, in a program built without them: they take any arguments and say what is missing.

/// `terrasoar snapshot`.
pub(super) mod snapshot {
    /// Draw a picture of a terrain as PNG (this program was built without pictures).
    #[derive(Debug, clap::Args)]
    #[command(disable_help_flag = true)]
    pub(crate) struct Args {
        /// Ignored
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
        ignored: Vec<std::ffi::OsString>,
    }

    pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
        super::refuse("snapshot", &args.ignored)
    }
}

/// `terrasoar movie`.
pub(super) mod movie {
    /// Draw a flight as a movie (this program was built without pictures).
    #[derive(Debug, clap::Args)]
    #[command(disable_help_flag = true)]
    pub(crate) struct Args {
        /// Ignored
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
        ignored: Vec<std::ffi::OsString>,
    }

    pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
        super::refuse("movie", &args.ignored)
    }
}

/// `terrasoar view`.
pub(super) mod view {
    /// Fly over a terrain in a window (this program was built without pictures).
    #[derive(Debug, clap::Args)]
    #[command(disable_help_flag = true)]
    pub(crate) struct Args {
        /// Ignored
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
        ignored: Vec<std::ffi::OsString>,
    }

    pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
        super::refuse("view", &args.ignored)
    }
}

fn refuse(verb: &str, _: &[std::ffi::OsString]) -> anyhow::Result<()> {
    anyhow::bail!(
        "this program was built without pictures, which {verb} draws; build it with the feature view (cargo build --release does)"
    )
}
