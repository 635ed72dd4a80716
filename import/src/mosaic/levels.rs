//! What the heights of files are measured from: one level that is kept, and a warning where there are several.
//!
//! Nothing is shifted: the shapes of geoids are not here. Files that say nothing of it are taken to be like the others. Cost: a comparison a file and level.

use super::source::Source;
use crate::crs::Vertical;
use terrasoar_layout::dem::Warning;
use terrasoar_layout::words::harmless;

/// Levels that are named, at most.
const MOST_NAMED: usize = 4;

/// Whether two levels are one.
fn is_same(a: &Vertical, b: &Vertical) -> bool {
    match (a.code, b.code) {
        (Some(a), Some(b)) => a == b,
        _ => a.name.eq_ignore_ascii_case(&b.name),
    }
}

/// The level that most samples are measured from, of as many the first path's; and what is said where there are others.
pub(super) fn of(sources: &[Source]) -> (Option<Vertical>, Option<Warning>) {
    // Each level with its samples, its first file and how many files it has.
    let mut levels: Vec<(&Vertical, u64, &Source, usize)> = Vec::new();
    for source in sources {
        let Some(level) = source.level.as_ref().filter(|level| !level.name.is_empty()) else { continue };
        let samples = u64::from(source.samples[0]) * u64::from(source.samples[1]);
        match levels.iter_mut().find(|(known, ..)| is_same(known, level)) {
            Some((_, all, _, files)) => (*all, *files) = (*all + samples, *files + 1),
            None => levels.push((level, samples, source, 1)),
        }
    }
    let most = levels.iter().map(|(_, samples, ..)| *samples).max();
    let main =
        levels.iter().find(|(_, samples, ..)| Some(*samples) == most).map(|(level, ..)| (*level).clone());
    let warning = (levels.len() > 1).then(|| {
        let named = levels.iter().take(MOST_NAMED).map(|(level, _, first, files)| {
            let file = first.path.file_name().unwrap_or(first.path.as_os_str()).to_string_lossy();
            let more = if *files > 1 { format!(" and {} more", files - 1) } else { String::new() };
            format!("{} ({}{more})", harmless(&level.name, 60), harmless(&file, 40))
        });
        let rest = if levels.len() > MOST_NAMED { ", and others" } else { "" };
        Warning::new(format!(
            "the files measure heights from unlike levels: {}{rest}; none was shifted, so that steps remain where they meet; bring them to one level first: gdalwarp -t_srs EPSG:n+m INPUT output.tif",
            named.collect::<Vec<_>>().join(", ")
        ))
    });
    (main, warning)
}
