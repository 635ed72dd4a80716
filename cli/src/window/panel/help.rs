//! The list of keys.

use crate::window::keys::ROWS;
use egui::{Align2, Context, Grid, RichText, ScrollArea, Window};

/// The list, while it is wanted.
pub(super) fn show(context: &Context, open: &mut bool) {
    let window = Window::new("Keys").open(open).collapsible(false).resizable(false);
    window.anchor(Align2::CENTER_CENTER, [0.0, 0.0]).show(context, |ui| {
        let most = context.content_rect().height() - 90.0;
        ScrollArea::vertical().max_height(most.max(120.0)).min_scrolled_height(most.max(120.0)).show(
            ui,
            |ui| {
                Grid::new("keys").num_columns(2).spacing([18.0, 5.0]).striped(true).show(ui, |ui| {
                    for row in ROWS {
                        ui.label(RichText::new(row.keys).strong());
                        ui.label(row.does);
                        ui.end_row();
                    }
                });
            },
        );
    });
}
