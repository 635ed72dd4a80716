//! Recording a flight, playing and scrubbing one, keeping a picture.

use super::{Facts, Wish, button};
use crate::window::keys::Action;
use egui::{Slider, Ui};

/// Buttons, and a slider along the flight.
pub(super) fn show(ui: &mut Ui, facts: &Facts<'_>, wishes: &mut Vec<Wish>) {
    ui.horizontal(|ui| {
        match facts.recorder {
            Some(_) => button(ui, "End recording", Action::Record, wishes),
            None => button(ui, "Record", Action::Record, wishes),
        }
        if let Some(player) = facts.player {
            button(ui, if player.is_playing() { "Pause" } else { "Play" }, Action::Play, wishes);
        }
        button(ui, "Picture", Action::Screenshot, wishes);
    });
    if let Some(recorder) = facts.recorder {
        ui.label(format!("recording: {:.1} s, {} frames", recorder.seconds(), recorder.frames()));
    }
    let Some(player) = facts.player else {
        ui.weak("No flight yet: record one, or drop a .flight file here.");
        return;
    };
    let mut frame = player.frame();
    ui.horizontal(|ui| {
        ui.spacing_mut().slider_width = 190.0;
        let slider = Slider::new(&mut frame, 0..=player.len() - 1).show_value(false);
        if ui.add(slider).changed() {
            wishes.push(Wish::Seek(frame));
        }
        if ui.small_button("Close").on_hover_text("Put the flight away").clicked() {
            wishes.push(Wish::CloseFlight);
        }
    });
    let [now_s, end_s] = player.times_s();
    ui.label(format!("frame {frame} of {}, {now_s:.1} of {end_s:.1} s", player.len() - 1));
}
