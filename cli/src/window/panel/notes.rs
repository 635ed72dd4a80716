//! Notes: where a file was written, what went wrong, how far a build or a rewriting has come.
//!
//! News disappears by itself after a while. Errors stay until they are closed.

use super::{Facts, Wish};
use crate::window::overlay::PANEL;
use egui::{Align2, Area, Color32, Context, Frame, Id, Margin, ProgressBar, Rect, Stroke, vec2};
use std::time::{Duration, Instant};
use terrasoar_layout::printable;

/// How long news is shown.
const SHOWN: Duration = Duration::from_secs(8);

/// Something to be said.
#[derive(Debug, Clone)]
pub(crate) struct Note {
    /// The words.
    pub text: String,
    /// When it goes; what went wrong stays.
    pub until: Option<Instant>,
}

impl Note {
    /// Something that went well.
    pub(crate) fn news(text: impl Into<String>) -> Self {
        Self { text: shown(text.into()), until: Some(Instant::now() + SHOWN) }
    }

    /// Something that went wrong.
    pub(crate) fn trouble(text: impl Into<String>) -> Self {
        Self { text: shown(text.into()), until: None }
    }
}

/// What files and names say, harmlessly.
fn shown(text: String) -> String {
    printable::lines(&text).into_owned()
}

/// Everything in the upper right corner of `room`.
pub(super) fn show(context: &Context, facts: &Facts<'_>, room: Rect, wishes: &mut Vec<Wish>) {
    let width = (room.width() - 24.0).clamp(120.0, 400.0);
    let area = Area::new(Id::unique("notes")).pivot(Align2::RIGHT_TOP).default_width(width);
    area.fixed_pos(room.right_top() + vec2(-12.0, 12.0)).show(context, |ui| {
        ui.set_max_width(width);
        for (words, part) in &facts.works {
            frame(Color32::from_rgb(0x3d, 0x86, 0xc6)).show(ui, |ui| {
                ui.add(egui::Label::new(words).wrap());
                ui.add(ProgressBar::new(*part).desired_width(width - 24.0).show_percentage());
            });
        }
        for (i, note) in facts.notes.iter().enumerate() {
            let colour = match note.until {
                Some(_) => Color32::from_rgb(0x58, 0xa8, 0x6a),
                None => Color32::from_rgb(0xd0, 0x5a, 0x4a),
            };
            frame(colour).show(ui, |ui| {
                ui.horizontal_top(|ui| {
                    let close = ui.small_button("x");
                    ui.add(egui::Label::new(&note.text).wrap());
                    if close.clicked() {
                        wishes.push(Wish::Dismiss(i));
                    }
                });
            });
        }
    });
}

fn frame(colour: Color32) -> Frame {
    Frame::new().fill(PANEL).stroke(Stroke::new(1.0, colour)).corner_radius(6).inner_margin(Margin::same(8))
}
