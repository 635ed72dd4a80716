//! The line at the bottom: what is under the cursor, and what is being done.

use super::{Facts, Wish, length};
use crate::window::keys::Action;
use egui::{Align, Color32, Frame, Layout, Margin, RichText, Ui};

/// The line.
pub(super) fn show(ui: &mut Ui, facts: &Facts<'_>, wishes: &mut Vec<Wish>) {
    let frame = Frame::new().fill(crate::window::overlay::PANEL).inner_margin(Margin::symmetric(10, 4));
    egui::Panel::bottom("status").resizable(false).frame(frame).show(ui, |ui| {
        ui.horizontal(|ui| {
            ui.label(under(facts));
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                if ui.small_button("F1 keys").clicked() {
                    wishes.push(Wish::Act(Action::Help));
                }
                if facts.frozen {
                    ui.label(RichText::new("mesh frozen").color(Color32::from_rgb(0x8f, 0xc7, 0xf2)));
                }
                if facts.recorder.is_some() {
                    ui.label(RichText::new("recording").color(Color32::from_rgb(0xf0, 0x6a, 0x5a)));
                }
            });
        });
    });
}

fn under(facts: &Facts<'_>) -> String {
    let Some(hit) = facts.under else { return "sky".to_owned() };
    let slope = hit.slope_deg.map_or_else(String::new, |deg| format!("   slope {deg:.0}°"));
    let at = facts.coordinates.shown([hit.at_m.x, hit.at_m.y]);
    format!("{at}   height {:.1} m{slope}   {} away", hit.height_m, length(hit.distance_m))
}
