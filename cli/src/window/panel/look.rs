//! How the terrain looks, and how fine its mesh is.

use super::{Facts, Wish, button};
use crate::window::keys::Action;
use crate::window::settings::{CONTOUR_INTERVAL_M, EXAGGERATION, Settings, TOLERANCE_PX};
use egui::{ComboBox, Slider, Ui};
use terrasoar::refine::Culling;
use terrasoar::view::ErrorMetric;
use terrasoar_render::LOOKS;
use terrasoar_render::ramps::RAMPS;

/// Style, colours, sun, lines.
pub(super) fn show(ui: &mut Ui, facts: &Facts<'_>, settings: &mut Settings) {
    let before = settings.style.clone();
    ComboBox::from_label("style").width(150.0).selected_text(&before).show_ui(ui, |ui| {
        for (name, about) in LOOKS {
            if ui.selectable_label(before == *name, *name).on_hover_text(*about).clicked() {
                settings.set_style(name);
            }
        }
    });
    let shown = settings.ramp.clone().unwrap_or_else(|| "of the style".to_owned());
    ComboBox::from_label("ramp").width(150.0).selected_text(shown).show_ui(ui, |ui| {
        ui.selectable_value(&mut settings.ramp, None, "of the style");
        for ramp in RAMPS {
            ui.selectable_value(&mut settings.ramp, Some(ramp.name.to_owned()), ramp.name)
                .on_hover_text(ramp.about);
        }
    });
    if facts.has_image {
        ui.add(Slider::new(&mut settings.image, 0.0..=1.0).fixed_decimals(2).text("image"))
            .on_hover_text("How much of the terrain's image shows");
    }
    ui.add(
        Slider::new(&mut settings.sun_azimuth_deg, 0.0..=360.0)
            .suffix("°")
            .fixed_decimals(0)
            .text("sun from"),
    );
    ui.add(
        Slider::new(&mut settings.sun_elevation_deg, 0.0..=90.0)
            .suffix("°")
            .fixed_decimals(0)
            .text("sun height"),
    );
    ui.horizontal(|ui| {
        ui.checkbox(&mut settings.haze, "haze");
        ui.checkbox(&mut settings.wireframe, "edges");
        ui.checkbox(&mut settings.smooth_edges, "smooth")
            .on_hover_text("Four samples a pixel; slow without graphics hardware");
    });
    ui.horizontal(|ui| {
        ui.checkbox(&mut settings.contours, "contours");
        let [least, most] = CONTOUR_INTERVAL_M.map(|m| m as f32);
        let drag = egui::DragValue::new(&mut settings.contour_interval_m).range(least..=most).suffix(" m");
        ui.add_enabled(settings.contours, drag.prefix("every "));
    });
}

/// Tolerance and how it is measured, exaggeration, culling, freezing.
pub(super) fn mesh(ui: &mut Ui, facts: &Facts<'_>, settings: &mut Settings, wishes: &mut Vec<Wish>) {
    let [least, most] = TOLERANCE_PX;
    let mut tolerance_px = settings.tolerance_px();
    let tolerance = Slider::new(&mut tolerance_px, least..=most).logarithmic(true);
    if ui
        .add(tolerance.suffix(" px").text("tolerance"))
        .on_hover_text("Largest error on the screen")
        .changed()
    {
        settings.tolerance_px = Some(tolerance_px);
    }
    ComboBox::from_label("errors by").width(80.0).selected_text(&settings.metric).show_ui(ui, |ui| {
        for (metric, means) in ErrorMetric::ALL.into_iter().zip([
            "As if every error were seen from the side",
            "Along the line of sight: the steeper one looks down, the less of a height shows",
        ]) {
            ui.selectable_value(&mut settings.metric, metric.name().to_owned(), metric.name())
                .on_hover_text(means);
        }
    });
    let [least, most] = EXAGGERATION;
    let exaggeration = Slider::new(&mut settings.exaggeration, least..=most).logarithmic(true);
    ui.add(exaggeration.prefix("x ").text("heights"));
    ui.horizontal(|ui| {
        ui.checkbox(&mut settings.morph, "morph")
            .on_hover_text("Vertices move into place instead of popping up");
        ComboBox::from_label("culling").width(80.0).selected_text(&settings.culling).show_ui(ui, |ui| {
            for culling in Culling::ALL {
                ui.selectable_value(&mut settings.culling, culling.name().to_owned(), culling.name());
            }
        });
    });
    ui.horizontal(|ui| {
        let label = if facts.frozen { "Thaw the mesh" } else { "Freeze the mesh" };
        button(ui, label, Action::Freeze, wishes);
    });
}
