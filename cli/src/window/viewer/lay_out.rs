//! The panels of a frame: they are laid out, what they ask for is done, and changed settings take effect.

use super::Viewer;
use crate::window::overlay::Layer;
use crate::window::panel::{self, Facts};
use crate::window::settings::Settings;
use terrasoar::flight::generate::Ground;

impl Viewer {
    /// Lays the panels out and grants their wishes.
    pub(super) fn lay_out(&mut self) -> Layer {
        let before = self.settings.clone();
        let (mut settings, mut wishes) = (self.settings.clone(), Vec::new());
        let adapter = self.screen.gpu.capabilities.adapter.clone();
        let extent_m = self.stage.heights().extent_m();
        let works = self.works();
        let facts = Facts {
            terrain: &self.terrain_name,
            extent_m,
            coordinates: &self.coordinates,
            has_image: self.stage.scene.has_image(),
            adapter: &adapter,
            under: self.under,
            eye_m: self.rig.camera.eye_m.to_array(),
            speed_m_s: self.rig.speed_m_s,
            follow_m: self.rig.follow_m,
            circling: self.rig.circling.is_some(),
            frozen: self.frozen.is_some(),
            recorder: self.recorder.as_ref(),
            player: self.player.as_ref(),
            history: &self.history,
            tools: self.tools,
            ring: self.ring(),
            raining: self.rain.is_some(),
            saving: self.is_saving(),
            works,
            notes: &self.notes,
        };
        let memory = &mut self.memory;
        let layer = self.overlay.lay_out(&self.window, |ui| {
            wishes.extend(panel::show(ui, &facts, &mut settings, memory));
        });
        self.settings = settings;
        wishes.into_iter().for_each(|wish| self.grant(wish));
        self.touched |= self.settings != before;
        self.follow_settings(&before);
        layer
    }

    /// What is done in the background, and which part of it is done.
    fn works(&self) -> Vec<(String, f32)> {
        let building = self.job.as_ref().map(|job| {
            let (stage, part) = job.progress();
            let name = job.input.file_name().unwrap_or_default().to_string_lossy();
            (format!("building {}: {stage}", terrasoar_layout::printable::line(&name)), part)
        });
        let widening = self.widening.as_ref().map(|meter| {
            let (stage, part) = meter.read();
            let name = terrasoar_layout::printable::line(&self.terrain_name);
            (format!("making room in {name} for this edit: {stage}. What you edit meanwhile follows."), part)
        });
        building.into_iter().chain(widening).collect()
    }

    /// What other settings mean beyond the picture.
    fn follow_settings(&mut self, before: &Settings) {
        let now = self.settings.exaggeration;
        if now != before.exaggeration {
            let rig = &mut self.rig;
            rig.exaggerate(&self.stage.heights(), before.exaggeration, now);
        }
        if self.settings.culling != before.culling {
            if let Err(error) = self.stage.set_culling(self.settings.culling()) {
                self.settings.culling.clone_from(&before.culling);
                self.trouble(format!("{error:#}"));
            }
            self.frozen = None;
        }
    }
}
