//! Where something is refused: the flag that would help.
//!
//! The libraries say in words what to change, and give the same as a [`Remedy`]. Here it becomes a flag. A flag is named only if
//! the verb that was typed has it.

use super::{Typed, message};
use clap::CommandFactory;
use terrasoar_lab::iobench::IoBenchError;
use terrasoar_layout::dem::Warning;
use terrasoar_layout::{LayoutError, Remedy};

/// The error's words, and the flag that would mend it in brackets.
pub(super) fn spoken(error: &anyhow::Error) -> String {
    let flag = error.chain().find_map(remedy_of).and_then(|remedy| flag(remedy, &flags_of_this_verb()));
    match flag {
        Some(flag) => format!("{} ({flag})", message(error)),
        None => message(error),
    }
}

fn remedy_of(cause: &(dyn std::error::Error + 'static)) -> Option<Remedy> {
    let of_layout = cause.downcast_ref::<LayoutError>().and_then(LayoutError::remedy);
    of_layout.or_else(|| cause.downcast_ref::<IoBenchError>().and_then(IoBenchError::remedy))
}

/// A warning's words, and what to type against it in brackets.
pub(super) fn warned(warning: &Warning) -> String {
    let typed = warning.mended_by.as_ref().and_then(|(remedy, value)| {
        let typed = flag(*remedy, &flags_of_this_verb())?;
        let name = typed.split(' ').next()?.to_owned();
        Some(if value.is_empty() { typed } else { format!("{name} {value}") })
    });
    match typed {
        Some(typed) => format!("warning: {} ({typed})", warning.words),
        None => format!("warning: {}", warning.words),
    }
}

/// What to type for a remedy, if it is one of the flags `known`.
fn flag(remedy: Remedy, known: &[String]) -> Option<String> {
    let (name, value) = match remedy {
        Remedy::Spacing => ("spacing", "M".into()),
        Remedy::Nodata => ("nodata", "VALUE".into()),
        Remedy::HeightFactor => ("z-scale", "S".into()),
        Remedy::HeightStep => ("height-step", "M".into()),
        Remedy::Memory { enough_mib: None } => ("memory", "MIB".into()),
        Remedy::Memory { enough_mib: Some(enough) } => ("memory", enough.to_string()),
        Remedy::Image => ("image", "IMG".into()),
        Remedy::Extent => ("extent", "W,S,E,N".into()),
        Remedy::Stretch => ("stretch", "2,98".into()),
        Remedy::TileFormat => ("format", "FORMAT".into()),
        Remedy::Overlay => ("overlay", "FILE.iqo".into()),
        Remedy::ScratchFolder => ("scratch", "FOLDER".into()),
        Remedy::HeightUnit => ("height-unit", "UNIT".into()),
        Remedy::Direction => ("positive", "down".into()),
        Remedy::Band => ("band", "BAND".into()),
        Remedy::Decode => ("decode", "PACKING".into()),
        Remedy::Zoom => ("zoom", "Z".into()),
        Remedy::Bounds => ("bounds", "W,S,E,N".into()),
        Remedy::ReferenceSystem => ("crs", "SYSTEM".into()),
        Remedy::RawShape => ("raw", "SHAPE".into()),
        Remedy::Reproject => ("reproject", "SYSTEM".into()),
        Remedy::Resolution => ("resolution", "M".into()),
        // One that this program does not know yet has no flag either.
        _ => return None,
    };
    let value: String = value;
    known.iter().any(|flag| flag == name).then(|| format!("--{name} {value}"))
}

/// Long flags of the verb on the command line.
fn flags_of_this_verb() -> Vec<String> {
    let command = Typed::command();
    let Ok(matches) = command.clone().try_get_matches() else { return Vec::new() };
    let (mut verb, mut typed) = (&command, &matches);
    while let Some((name, rest)) = typed.subcommand() {
        let Some(found) = verb.find_subcommand(name) else { break };
        (verb, typed) = (found, rest);
    }
    flags_of(verb)
}

fn flags_of(verb: &clap::Command) -> Vec<String> {
    verb.get_arguments().filter_map(|argument| argument.get_long()).map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(verb: &str) -> Vec<String> {
        flags_of(Typed::command().find_subcommand(verb).unwrap())
    }

    /// A flag that is renamed takes its remedy along.
    #[test]
    fn every_remedy_has_a_flag_of_the_verb_it_is_for() {
        for (verb, remedy, typed) in [
            ("build", Remedy::Spacing, "--spacing M"),
            ("build", Remedy::Nodata, "--nodata VALUE"),
            ("build", Remedy::HeightFactor, "--z-scale S"),
            ("build", Remedy::HeightStep, "--height-step M"),
            ("build", Remedy::HeightUnit, "--height-unit UNIT"),
            ("build", Remedy::Direction, "--positive down"),
            ("build", Remedy::Band, "--band BAND"),
            ("build", Remedy::Decode, "--decode PACKING"),
            ("build", Remedy::Zoom, "--zoom Z"),
            ("drape", Remedy::Bounds, "--bounds W,S,E,N"),
            ("build", Remedy::ReferenceSystem, "--crs SYSTEM"),
            ("build", Remedy::RawShape, "--raw SHAPE"),
            ("build", Remedy::Reproject, "--reproject SYSTEM"),
            ("build", Remedy::Resolution, "--resolution M"),
            ("build", Remedy::Memory { enough_mib: Some(470) }, "--memory 470"),
            ("drape", Remedy::Memory { enough_mib: None }, "--memory MIB"),
            ("drape", Remedy::Image, "--image IMG"),
            ("drape", Remedy::Extent, "--extent W,S,E,N"),
            ("drape", Remedy::Stretch, "--stretch 2,98"),
            ("drape", Remedy::TileFormat, "--format FORMAT"),
            ("edit", Remedy::Overlay, "--overlay FILE.iqo"),
            ("iobench", Remedy::ScratchFolder, "--scratch FOLDER"),
        ] {
            assert_eq!(flag(remedy, &known(verb)).as_deref(), Some(typed), "{verb}");
        }
    }

    #[test]
    fn no_flag_is_named_that_the_verb_does_not_have() {
        assert_eq!(flag(Remedy::Spacing, &known("drape")), None);
        assert_eq!(flag(Remedy::Memory { enough_mib: Some(470) }, &known("undo")), None);
    }

    #[test]
    fn remedies_are_found_behind_what_was_added_to_an_error() {
        let refused = LayoutError::Usage("too little".into()).mended_by(Remedy::Memory { enough_mib: None });
        let error = anyhow::Error::from(refused).context("no terrain");
        assert_eq!(error.chain().find_map(remedy_of), Some(Remedy::Memory { enough_mib: None }));
        assert_eq!(anyhow::anyhow!("else").chain().find_map(remedy_of), None);
    }
}
