//! Live graphs of what frames take: each its own scale, from nothing to the largest shown.

use crate::window::history::{FRAMES, History, SERIES, Series};
use egui::{
    Align2, Area, Color32, Context, FontId, Frame, Id, Margin, Pos2, Rect, Sense, Shape, Stroke, Ui, vec2,
};

const WIDTH: f32 = 236.0;
const HEIGHT: f32 = 36.0;
/// Room for words above the line.
const WORDS: f32 = 15.0;

/// All graphs in the lower right corner of `room`.
pub(super) fn show(context: &Context, history: &History, room: Rect) {
    let at = Area::new(Id::unique("figures")).pivot(Align2::RIGHT_BOTTOM);
    at.fixed_pos(room.right_bottom() - vec2(12.0, 12.0)).interactable(false).show(context, |ui| {
        let frame =
            Frame::new().fill(crate::window::overlay::PANEL).corner_radius(8).inner_margin(Margin::same(8));
        frame.show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 3.0;
            SERIES.iter().for_each(|series| graph(ui, history, series));
        });
    });
}

fn graph(ui: &mut Ui, history: &History, (name, unit, value): &Series) {
    let (rect, _) = ui.allocate_exact_size(vec2(WIDTH, HEIGHT), Sense::hover());
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 3, Color32::from_black_alpha(90));
    let most = history.iter().map(value).fold(0.0, f64::max);
    let first = FRAMES - history.iter().len();
    let point = |(i, figures): (usize, &_)| {
        let x = rect.left() + rect.width() * (first + i) as f32 / (FRAMES - 1) as f32;
        let part = if most > 0.0 { (value(figures) / most) as f32 } else { 0.0 };
        Pos2::new(x, rect.bottom() - 2.0 - part * (rect.height() - WORDS - 4.0))
    };
    let points: Vec<Pos2> = history.iter().enumerate().map(point).collect();
    painter.add(Shape::line(points, Stroke::new(1.2, Color32::from_rgb(0x6f, 0xb4, 0xe8))));
    let font = FontId::proportional(11.5);
    let shadow = Color32::from_black_alpha(200);
    let text = |at: Pos2, align: Align2, words: String, colour: Color32| {
        painter.text(at + vec2(1.0, 1.0), align, &words, font.clone(), shadow);
        painter.text(at, align, words, font.clone(), colour);
    };
    let now = history.last().map_or(0.0, value);
    text(rect.left_top() + vec2(5.0, 2.0), Align2::LEFT_TOP, (*name).to_owned(), Color32::from_gray(190));
    let words = format!("{}  (max {})", amount(now, unit), amount(most, unit));
    text(rect.right_top() + vec2(-5.0, 2.0), Align2::RIGHT_TOP, words, Color32::from_gray(235));
}

/// A number in three digits or so, with its unit.
fn amount(value: f64, unit: &str) -> String {
    let text = match value {
        v if v >= 1e9 => format!("{:.2} G", v / 1e9),
        v if v >= 1e6 => format!("{:.2} M", v / 1e6),
        v if v >= 1e4 => format!("{:.1} k", v / 1e3),
        v if unit == "ms" => format!("{v:.1} "),
        v => format!("{v:.0} "),
    };
    format!("{text}{unit}").trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_are_short() {
        assert_eq!(amount(0.0, ""), "0");
        assert_eq!(amount(3.456, "ms"), "3.5 ms");
        assert_eq!(amount(12_345.0, "B"), "12.3 kB");
        assert_eq!(amount(2.5e6, ""), "2.50 M");
    }
}
