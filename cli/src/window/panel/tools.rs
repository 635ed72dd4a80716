//! Changing the ground: which tool, how large, how strong; undo; the ring under the cursor.

use super::{Facts, Wish, button};
use crate::window::keys::Action;
use crate::window::tool::{RADII_M, Tool};
use egui::{Color32, ComboBox, Pos2, Slider, Stroke, Ui};

/// Tools, sliders and buttons.
pub(super) fn show(ui: &mut Ui, facts: &Facts<'_>, wishes: &mut Vec<Wish>) {
    let mut tools = facts.tools;
    ComboBox::from_label("left button").selected_text(tools.tool.name()).show_ui(ui, |ui| {
        for tool in Tool::ALL {
            ui.selectable_value(&mut tools.tool, tool, tool.name());
        }
    });
    let [least, largest] = RADII_M;
    ui.add(Slider::new(&mut tools.radius_m, least..=largest).logarithmic(true).text("radius").suffix(" m"));
    ui.add(Slider::new(&mut tools.strength, 0.02..=1.0).text("strength"));
    ui.horizontal(|ui| {
        button(ui, "Undo", Action::Undo, wishes);
        button(ui, "Redo", Action::Redo, wishes);
        button(ui, if facts.raining { "End rain" } else { "Rain of craters" }, Action::Rain, wishes);
    });
    if facts.saving {
        ui.weak("saving ...");
    }
    if tools != facts.tools {
        wishes.push(Wish::Tools(tools));
    }
}

/// The ring on the ground within which the tool works.
pub(super) fn ring(ui: &Ui, facts: &Facts<'_>) {
    let points = facts.ring.iter().map(|[x, y]| Pos2::new(*x, *y)).collect::<Vec<_>>();
    if points.len() > 1 {
        // Dark below light, to be seen on any ground.
        let painter = ui.painter();
        painter.line(points.clone(), Stroke::new(3.0, Color32::from_black_alpha(140)));
        painter.line(points, Stroke::new(1.5, Color32::from_rgb(255, 214, 90)));
    }
}
