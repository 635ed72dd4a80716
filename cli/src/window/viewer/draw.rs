//! The picture: refined, drawn, covered by the panels, shown; and how long that took.

use super::Viewer;
use crate::window::history::Figures;
use crate::window::keep;
use crate::window::overlay::{Layer, Overlay};
use anyhow::Result;
use std::path::Path;
use std::time::{Duration, Instant};
use terrasoar::ground::Refined;
use terrasoar::view::View;
use terrasoar_render::{Offscreen, RenderError, Target, wgpu};
use terrasoar_scene::scene::Drawn;

impl Viewer {
    /// Refines, draws and shows a frame. What goes wrong becomes a note.
    pub(super) fn show(&mut self, layer: &mut Layer, passed: Option<Duration>, begun: Instant) {
        if self.plan.lose_device_after_frames == Some(self.frames) {
            self.plan.lose_device_after_frames = None;
            self.screen.gpu.device.destroy();
        }
        let shown = self.try_show(layer, passed, begun);
        // Whatever became of the frame: textures come once, and are the overlay's by now or gone with it.
        self.overlay.take_textures(&self.screen, layer);
        self.overlay.settle(layer);
        if let Err(error) = shown {
            let is_lost = error
                .downcast_ref::<RenderError>()
                .is_some_and(|e| matches!(e, RenderError::DeviceLost { .. }));
            if is_lost {
                self.recover(&error);
            } else {
                self.trouble(format!("{error:#}"));
            }
        }
        self.frames += 1;
    }

    fn try_show(&mut self, layer: &mut Layer, passed: Option<Duration>, begun: Instant) -> Result<()> {
        let before = Instant::now();
        let view = self.view();
        let refined = match self.frozen {
            Some(_) => None,
            None => Some(self.stage.update(&view)),
        };
        let update = before.elapsed();
        // A device that went while nothing was drawn says so when it is asked.
        let _ = self.screen.gpu.device.poll(wgpu::PollType::Poll);
        self.screen.gpu.watch.check()?;
        let picture = self.screen.acquire()?;
        self.unshown = picture.is_none();
        let Some(picture) = picture else {
            return Ok(());
        };
        let target = picture.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = self.screen.gpu.device.create_command_encoder(&Default::default());
        let size_px = self.screen.size_px();
        let onto = Target { view: &target, size_px, format: self.screen.format() };
        let drawn = self.draw(&mut encoder, onto, &view)?;
        let first = self.overlay.paint(&self.screen, &mut encoder, &target, layer);
        self.screen.gpu.queue.submit(first.into_iter().chain([encoder.finish()]));
        self.window.pre_present_notify();
        self.screen.gpu.queue.present(picture);
        self.screen.gpu.watch.check()?;
        let waiting = self.stage.is_waiting();
        self.unsettled = waiting || (drawn.tiles_missing > 0 && drawn.tiles[0] > 0);
        while let Some(error) = self.stage.take_error() {
            self.trouble(format!("{error}; the ground stays coarse there"));
        }
        self.count(refined, drawn, update, passed.unwrap_or_else(|| begun.elapsed()));
        Ok(())
    }

    fn draw(&mut self, encoder: &mut wgpu::CommandEncoder, target: Target<'_>, view: &View) -> Result<Drawn> {
        let mut look = self.settings.look();
        let heights_m = self.stage.terrain().header().height_range_m.map(|metres| metres as f32);
        look.tint_range_m = Some(look.ramp.range_m(heights_m));
        let frozen = self.frozen;
        self.stage.draw(encoder, target, view, &look, frozen.as_ref())
    }

    fn count(&mut self, refined: Option<Refined>, drawn: Drawn, update: Duration, frame: Duration) {
        // A frozen mesh is the last one that was refined.
        let frozen = self.history.last().map_or(0, |figures| figures.triangles);
        let triangles = refined.map_or(frozen, |refined| refined.triangles);
        let refined = refined.unwrap_or_default();
        self.history.push(Figures {
            frame_ms: 1e3 * frame.as_secs_f64(),
            update_ms: 1e3 * update.as_secs_f64(),
            triangles,
            tests: refined.work.tests,
            changes: refined.work.splits + refined.work.merges,
            patch_bytes: drawn.upload.bytes,
            pages: refined.pages_read,
            record_bytes: refined.record_bytes_read,
            pages_come: refined.pages_come,
            image_bytes: drawn.image.bytes,
            late: refined.work.late,
        });
    }

    /// Draws the picture again without the overlay, and keeps it.
    pub(super) fn take_picture(&mut self, path: &Path) -> Result<()> {
        let view = self.view();
        let picture = Offscreen::new(&self.screen.gpu.device, self.screen.size_px())?;
        let mut encoder = self.screen.gpu.device.create_command_encoder(&Default::default());
        self.draw(&mut encoder, picture.target(), &view)?;
        self.screen.gpu.queue.submit([encoder.finish()]);
        self.screen.gpu.watch.check()?;
        keep::picture(&picture, &self.screen.gpu.device, &self.screen.gpu.queue, path)
    }

    /// Goes on with another device.
    fn recover(&mut self, loss: &anyhow::Error) {
        let recovered = self.screen.renew().and_then(|()| {
            self.overlay = Overlay::new(&self.window, &self.display, &self.screen);
            Ok(self.stage.scene.recover(&self.screen.gpu)?)
        });
        match recovered {
            Ok(()) => {
                self.news("The graphics device was lost; another was taken.");
                if let Some(words) = self.settings.suit(&self.screen.gpu.capabilities) {
                    self.news(words);
                }
                self.tell("recovered");
            }
            Err(error) => {
                // Without a device nothing can be said in the window.
                self.failure = Some(error.context(format!("{loss:#}")));
                self.ending = true;
            }
        }
    }
}
