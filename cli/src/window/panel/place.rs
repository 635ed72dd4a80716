//! Where the eye is, and coordinates to go to.

use super::{Facts, Memory, Wish, button, length};
use crate::window::keys::Action;
use egui::{Key, TextEdit, Ui};

/// The eye's place, a field for another, ways to move.
pub(super) fn show(ui: &mut Ui, facts: &Facts<'_>, memory: &mut Memory, wishes: &mut Vec<Wish>) {
    let [east, north, up] = facts.eye_m;
    ui.label(format!("eye {east:.0}, {north:.0}, {up:.0} m"));
    ui.weak(facts.coordinates.shown([east, north]));
    let speed = format!("speed {}/s", length(facts.speed_m_s));
    ui.label(match facts.follow_m {
        Some(height_m) => format!("{speed}, {} above ground", length(height_m)),
        None => speed,
    });
    ui.horizontal(|ui| {
        let hint = facts.coordinates.hint();
        let field = TextEdit::singleline(&mut memory.place).hint_text(hint).desired_width(140.0);
        let field = ui.add(field).on_hover_text(
            "The DEM's coordinates, east before north; latitude and longitude, such as 45.9763 N 7.6586 E; or metres from the south-west corner, such as 1500 m, 820 m",
        );
        if std::mem::take(&mut memory.focus_place) {
            field.request_focus();
        }
        let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
        if (ui.button("Go there").clicked() || entered) && !memory.place.trim().is_empty() {
            wishes.push(Wish::GoTo(memory.place.clone()));
        }
    });
    ui.horizontal(|ui| {
        button(ui, "Whole terrain", Action::Overview, wishes);
        button(
            ui,
            if facts.follow_m.is_some() { "Free height" } else { "Keep height" },
            Action::Follow,
            wishes,
        );
        button(ui, if facts.circling { "Stop" } else { "Circle" }, Action::Circle, wishes);
    });
}
