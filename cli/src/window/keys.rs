//! Every key and what it does: one table drives the window, its list of keys and `--help`.
//!
//! Keys are named by their place on a US keyboard, so that W, A, S and D lie as they should on any other.

use winit::keyboard::KeyCode;

/// What a key press does at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Action {
    Help,
    Panel,
    Figures,
    FullScreen,
    Follow,
    Circle,
    Overview,
    GoTo,
    Freeze,
    NextStyle,
    Contours,
    Wireframe,
    NextTool,
    SmallerTool,
    LargerTool,
    Undo,
    Redo,
    Rain,
    Screenshot,
    Record,
    Play,
    StepBack,
    StepForward,
    Cancel,
    Quit,
}

/// A line of the list.
#[derive(Debug)]
pub(crate) struct Row {
    /// The keys as they are written.
    pub keys: &'static str,
    /// What they do.
    pub does: &'static str,
    /// What happens at a press; none for what is held or done by mouse.
    pub action: Option<Action>,
    /// The keys themselves.
    pub codes: &'static [KeyCode],
}

const fn held(keys: &'static str, does: &'static str) -> Row {
    Row { keys, does, action: None, codes: &[] }
}

const fn pressed(keys: &'static str, does: &'static str, action: Action, codes: &'static [KeyCode]) -> Row {
    Row { keys, does, action: Some(action), codes }
}

/// All of them.
pub(crate) const ROWS: &[Row] = &[
    held("W A S D", "fly forward, left, back and right; the arrow keys do too"),
    held("E Q", "up and down; Page Up and Page Down too"),
    held("Shift", "five times faster"),
    held("Wheel", "change the speed"),
    held("Left drag", "look around"),
    held("Right drag", "go round the point under the cursor"),
    held("Double click", "fly to the point under the cursor"),
    pressed("T", "keep the height above the ground, or no longer", Action::Follow, &[KeyCode::KeyT]),
    pressed("O", "circle the point in the middle, or no longer", Action::Circle, &[KeyCode::KeyO]),
    pressed("Home", "see the whole terrain", Action::Overview, &[KeyCode::Home]),
    pressed("G", "type coordinates to go to", Action::GoTo, &[KeyCode::KeyG]),
    pressed("F", "freeze the mesh and look at it from elsewhere", Action::Freeze, &[KeyCode::KeyF]),
    pressed("V", "next style", Action::NextStyle, &[KeyCode::KeyV]),
    pressed("C", "contour lines", Action::Contours, &[KeyCode::KeyC]),
    pressed("X", "edges of the triangles", Action::Wireframe, &[KeyCode::KeyX]),
    pressed(
        "B",
        "next tool for the left button: craters, brushes, or none",
        Action::NextTool,
        &[KeyCode::KeyB],
    ),
    pressed("[ ]", "a smaller tool, a larger one", Action::SmallerTool, &[KeyCode::BracketLeft]),
    pressed("Ctrl+Z", "take the last edit of the ground back", Action::Undo, &[]),
    pressed("Ctrl+Y", "bring it back", Action::Redo, &[]),
    pressed("K", "a rain of craters, or no longer", Action::Rain, &[KeyCode::KeyK]),
    pressed("R", "record a flight, or end and keep it", Action::Record, &[KeyCode::KeyR]),
    pressed("Space", "play the flight, or pause", Action::Play, &[KeyCode::Space]),
    pressed(", .", "one frame of the flight back, one on", Action::StepBack, &[KeyCode::Comma]),
    pressed("P", "keep a picture of the terrain (PNG)", Action::Screenshot, &[KeyCode::KeyP, KeyCode::F12]),
    pressed("Tab", "show or hide the panel", Action::Panel, &[KeyCode::Tab]),
    pressed("I", "show or hide the figures", Action::Figures, &[KeyCode::KeyI]),
    pressed("F11", "full screen, or a window again", Action::FullScreen, &[KeyCode::F11]),
    pressed("F1 ?", "this list", Action::Help, &[KeyCode::F1, KeyCode::Slash]),
    pressed("Esc", "stop what goes on by itself; close the list", Action::Cancel, &[KeyCode::Escape]),
    pressed("Ctrl+Q", "quit", Action::Quit, &[]),
];

/// What a press of `code` does, Ctrl held or not.
pub(crate) fn action(code: KeyCode, ctrl: bool) -> Option<Action> {
    match (ctrl, code) {
        (true, KeyCode::KeyQ) => Some(Action::Quit),
        (true, KeyCode::KeyZ) => Some(Action::Undo),
        (true, KeyCode::KeyY) => Some(Action::Redo),
        (true, _) => None,
        (false, KeyCode::Period) => Some(Action::StepForward),
        (false, KeyCode::BracketRight) => Some(Action::LargerTool),
        (false, _) => ROWS.iter().find(|row| row.codes.contains(&code)).and_then(|row| row.action),
    }
}

/// How the keys of an action are written.
pub(crate) fn name(action: Action) -> &'static str {
    ROWS.iter().find(|row| row.action == Some(action)).map_or("", |row| row.keys)
}

/// Right, forward and up of a key that is held; none for other keys.
pub(crate) fn thrust(code: KeyCode) -> Option<[f64; 3]> {
    Some(match code {
        KeyCode::KeyW | KeyCode::ArrowUp => [0.0, 1.0, 0.0],
        KeyCode::KeyS | KeyCode::ArrowDown => [0.0, -1.0, 0.0],
        KeyCode::KeyA | KeyCode::ArrowLeft => [-1.0, 0.0, 0.0],
        KeyCode::KeyD | KeyCode::ArrowRight => [1.0, 0.0, 0.0],
        KeyCode::KeyE | KeyCode::PageUp => [0.0, 0.0, 1.0],
        KeyCode::KeyQ | KeyCode::PageDown => [0.0, 0.0, -1.0],
        _ => return None,
    })
}

/// The list as text, for `--help`.
pub(crate) fn list() -> String {
    let width = ROWS.iter().map(|row| row.keys.len()).max().unwrap_or(0) + 2;
    ROWS.iter().map(|row| format!("  {:width$}{}\n", row.keys, row.does)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_does_two_things() {
        let codes: Vec<KeyCode> = ROWS.iter().flat_map(|row| row.codes).copied().collect();
        for (i, code) in codes.iter().enumerate() {
            assert!(!codes[..i].contains(code), "{code:?}");
            assert_eq!(thrust(*code), None, "{code:?}");
        }
        assert_eq!(action(KeyCode::KeyQ, false), None);
        assert_eq!(action(KeyCode::KeyQ, true), Some(Action::Quit));
        assert_eq!(action(KeyCode::KeyT, true), None);
        assert_eq!(action(KeyCode::KeyZ, true), Some(Action::Undo));
        assert_eq!(action(KeyCode::BracketRight, false), Some(Action::LargerTool));
    }

    #[test]
    fn the_manual_lists_the_same_keys() {
        let table: String = ROWS.iter().map(|row| format!("| {} | {} |\n", row.keys, row.does)).collect();
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/manual/view.md");
        let page = std::fs::read_to_string(page).unwrap();
        assert!(page.contains(&table), "docs/manual/view.md needs this table:\n{table}");
    }
}
