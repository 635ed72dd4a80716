//! What is shown over the terrain: facts in, wishes out.
//!
//! Panels change [`Settings`] at once and ask for everything else by a [`Wish`]; they own nothing and open nothing.

mod figures;
mod flights;
mod help;
mod look;
mod notes;
mod place;
mod status;
mod tools;

use super::coordinates::Coordinates;
use super::flights::{Player, Recorder};
use super::history::History;
use super::keys::Action;
use super::pick::Hit;
use super::settings::Settings;
use super::tool::ToolBox;
use egui::{CollapsingHeader, Frame, Margin, ScrollArea, Ui};

pub(crate) use notes::Note;

/// Width of the panel in points.
pub(crate) const WIDTH: f64 = 286.0;

/// What a panel asks for.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Wish {
    /// What a key would do.
    Act(Action),
    /// To fly to a place that was typed.
    GoTo(String),
    /// A frame of the flight.
    Seek(usize),
    /// To fly by itself no longer: the flight is put away.
    CloseFlight,
    /// Another tool, or another size of it.
    Tools(ToolBox),
    /// A note is read.
    Dismiss(usize),
}

/// What there is to show.
pub(crate) struct Facts<'a> {
    /// Name of the terrain file.
    pub terrain: &'a str,
    /// Metres from the south-west to the north-east sample.
    pub extent_m: [f64; 2],
    /// Its places in words.
    pub coordinates: &'a Coordinates,
    /// Whether an image is draped over it.
    pub has_image: bool,
    /// The adapter's name.
    pub adapter: &'a str,
    /// The point under the cursor.
    pub under: Option<Hit>,
    /// Eye, metres east, north and up.
    pub eye_m: [f64; 3],
    /// Metres a second.
    pub speed_m_s: f64,
    /// Height that is kept above the ground.
    pub follow_m: Option<f64>,
    /// Whether a point is circled.
    pub circling: bool,
    /// Whether refinement is frozen.
    pub frozen: bool,
    /// The recording under way.
    pub recorder: Option<&'a Recorder>,
    /// The flight that can be played.
    pub player: Option<&'a Player>,
    /// Figures of the latest frames.
    pub history: &'a History,
    /// What the left button does.
    pub tools: ToolBox,
    /// The ring within which it does, in points of the window.
    pub ring: Vec<[f32; 2]>,
    /// Whether craters rain.
    pub raining: bool,
    /// Whether edits are on their way to the disk.
    pub saving: bool,
    /// What is done in the background, in words, and which part of it is done.
    pub works: Vec<(String, f32)>,
    /// What is to be said.
    pub notes: &'a [Note],
}

/// What panels remember from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    /// Whether the list of keys is shown.
    pub help: bool,
    /// Coordinates being typed.
    pub place: String,
    /// Whether the field for them is to be typed into.
    pub focus_place: bool,
}

/// Lays everything out.
pub(crate) fn show(
    ui: &mut Ui,
    facts: &Facts<'_>,
    settings: &mut Settings,
    memory: &mut Memory,
) -> Vec<Wish> {
    let mut wishes = Vec::new();
    tools::ring(ui, facts);
    status::show(ui, facts, &mut wishes);
    if settings.panel {
        let frame = Frame::new().fill(super::overlay::PANEL).inner_margin(Margin::same(10));
        egui::Panel::left("panel").exact_size(WIDTH as f32).resizable(false).frame(frame).show(ui, |ui| {
            ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                ui.spacing_mut().slider_width = 132.0;
                title(ui, facts);
                section(ui, "Look", true, |ui| look::show(ui, facts, settings));
                section(ui, "Mesh", true, |ui| look::mesh(ui, facts, settings, &mut wishes));
                section(ui, "Place", true, |ui| place::show(ui, facts, memory, &mut wishes));
                section(ui, "Ground", true, |ui| tools::show(ui, facts, &mut wishes));
                section(ui, "Flight", true, |ui| flights::show(ui, facts, &mut wishes));
            });
        });
    }
    let room = ui.available_rect_before_wrap();
    if settings.figures && room.width() > 420.0 && room.height() > 400.0 {
        figures::show(ui.ctx(), facts.history, room);
    }
    notes::show(ui.ctx(), facts, room, &mut wishes);
    help::show(ui.ctx(), &mut memory.help);
    wishes
}

fn title(ui: &mut Ui, facts: &Facts<'_>) {
    ui.heading(facts.terrain);
    let [east, north] = facts.extent_m.map(length);
    ui.weak(format!("{east} x {north} on {}", facts.adapter));
    ui.add_space(4.0);
}

fn section(ui: &mut Ui, name: &str, open: bool, show: impl FnOnce(&mut Ui)) {
    CollapsingHeader::new(egui::RichText::new(name).strong()).default_open(open).show_unindented(ui, |ui| {
        show(ui);
        ui.add_space(4.0);
    });
}

/// A button with the key that does the same.
fn button(ui: &mut Ui, label: &str, action: Action, wishes: &mut Vec<Wish>) {
    let key = super::keys::name(action);
    if ui.button(label).on_hover_text(format!("Key {key}")).clicked() {
        wishes.push(Wish::Act(action));
    }
}

/// A length in words.
pub(super) fn length(m: f64) -> String {
    match m.abs() {
        a if a >= 100_000.0 => format!("{:.0} km", m / 1000.0),
        a if a >= 10_000.0 => format!("{:.1} km", m / 1000.0),
        a if a >= 100.0 => format!("{m:.0} m"),
        _ => format!("{m:.1} m"),
    }
}
