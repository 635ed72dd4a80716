//! Whether what a page shows is what was printed.
//!
//! A `…` stands for anything in its line, and alone in a line for any lines. Numbers before a unit of time or of speed are the machine's. In blocks marked `figures` all numbers
//! are, and so is the width of columns.

/// Units whose numbers differ from run to run.
const UNITS: [&str; 8] =
    ["s", "ms", "us", "edits/s", "k edits/s", "M samples/s", "k samples/s", "MB of RGB/s"];

/// Whether `shown` shows `printed`.
pub fn shows(shown: &[&str], printed: &[&str], figures: bool) -> bool {
    match (shown, printed) {
        ([], []) => true,
        (["…", rest @ ..], _) => {
            (0..=printed.len()).any(|skipped| shows(rest, &printed[skipped..], figures))
        }
        ([line, shown @ ..], [other, printed @ ..]) => {
            shows_line(&steady(line, figures), &steady(other, figures)) && shows(shown, printed, figures)
        }
        _ => false,
    }
}

fn shows_line(shown: &str, printed: &str) -> bool {
    let Some((start, rest)) = shown.split_once('…') else { return shown == printed };
    let Some(mut left) = printed.strip_prefix(start) else { return false };
    let mut parts: Vec<&str> = rest.split('…').collect();
    let end = parts.pop().unwrap_or_default();
    for part in parts {
        let Some((_, behind)) = left.split_once(part) else { return false };
        left = behind;
    }
    left.ends_with(end)
}

/// A line without what differs from run to run.
fn steady(line: &str, figures: bool) -> String {
    let mut steady = String::new();
    let mut left = line;
    while let Some(at) = left.find(|c: char| c.is_ascii_digit()) {
        let rest = &left[at..];
        let length = rest.find(|c: char| !(c.is_ascii_digit() || ".,".contains(c))).unwrap_or(rest.len());
        let length = rest[..length].trim_end_matches(['.', ',']).len();
        let (number, behind) = rest.split_at(length);
        steady.push_str(&left[..at]);
        let is_measured = has_unit(behind);
        steady.push_str(if figures || is_measured { "#" } else { number });
        // Thousands and millions are the machine's too.
        left = [" k", " M"]
            .iter()
            .find_map(|size| behind.strip_prefix(size))
            .filter(|_| is_measured)
            .unwrap_or(behind);
    }
    steady.push_str(left);
    if figures {
        steady = steady.split_whitespace().collect::<Vec<_>>().join(" ");
    }
    steady
}

fn has_unit(behind: &str) -> bool {
    let ends = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || "/".contains(c));
    let unit = behind.strip_prefix(' ');
    unit.is_some_and(|rest| UNITS.iter().any(|unit| rest.strip_prefix(unit).is_some_and(ends)))
}
