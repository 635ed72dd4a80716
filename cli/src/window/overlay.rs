//! The panels over the terrain: egui between the window's events and the frame's encoder.
//!
//! Keys go to the panels only while something is typed there. Otherwise keys fly.

use egui::epaint::ClippedPrimitive;
use egui::{Color32, CornerRadius, Stroke, Theme, ViewportId, Visuals};
use std::time::Duration;
use terrasoar_render::wgpu;
use winit::event::{ElementState, WindowEvent};
use winit::event_loop::OwnedDisplayHandle;
use winit::window::Window;

use super::screen::Screen;

/// egui, its window state and its painter.
pub(crate) struct Overlay {
    /// What knows where the pointer is and what is typed.
    pub context: egui::Context,
    state: egui_winit::State,
    painter: egui_wgpu::Renderer,
}

/// What is to be painted over a frame.
pub(crate) struct Layer {
    primitives: Vec<ClippedPrimitive>,
    textures: egui::TexturesDelta,
    pixels_per_point: f32,
    /// When it wants to be painted again, events apart.
    pub again: Duration,
}

impl Overlay {
    /// On a screen's device. To be made anew with the device.
    pub(crate) fn new(window: &Window, display: &OwnedDisplayHandle, screen: &Screen) -> Self {
        let context = egui::Context::default();
        context.set_theme(Theme::Dark);
        context.set_visuals_of(Theme::Dark, visuals());
        let most = screen.gpu.device.limits().max_texture_dimension_2d as usize;
        let state = egui_winit::State::new(
            context.clone(),
            ViewportId::ROOT,
            display,
            Some(window.scale_factor() as f32),
            Some(winit::window::Theme::Dark),
            Some(most),
        );
        let painter = egui_wgpu::Renderer::new(
            &screen.gpu.device,
            screen.format(),
            egui_wgpu::RendererOptions { msaa_samples: 1, ..Default::default() },
        );
        Self { context, state, painter }
    }

    /// Whether keys are typed into the overlay.
    pub(crate) fn is_typing(&self) -> bool {
        self.context.egui_wants_keyboard_input()
    }

    /// Whether the pointer is over the overlay or drags something of it.
    pub(crate) fn has_pointer(&self) -> bool {
        self.context.egui_is_using_pointer() || self.context.is_pointer_over_egui()
    }

    /// Hears an event; says whether it asks for a new picture.
    pub(crate) fn hear(&mut self, window: &Window, event: &WindowEvent) -> bool {
        // Being drawn is no reason to be drawn again.
        if matches!(event, WindowEvent::RedrawRequested) {
            return false;
        }
        if let WindowEvent::KeyboardInput { event: key, .. } = event
            && key.state == ElementState::Pressed
            && !self.is_typing()
        {
            return false;
        }
        self.state.on_window_event(window, event).repaint
    }

    /// Lays the overlay out.
    pub(crate) fn lay_out(&mut self, window: &Window, show: impl FnMut(&mut egui::Ui)) -> Layer {
        let input = self.state.take_egui_input(window);
        let output = self.context.run_ui(input, show);
        self.state.handle_platform_output(window, output.platform_output);
        let again =
            output.viewport_output.get(&ViewportId::ROOT).map_or(Duration::MAX, |out| out.repaint_delay);
        Layer {
            primitives: self.context.tessellate(output.shapes, output.pixels_per_point),
            textures: output.textures_delta,
            pixels_per_point: output.pixels_per_point,
            again,
        }
    }

    /// Paints over `target`; gives what is to be submitted before the encoder.
    pub(crate) fn paint(
        &mut self,
        screen: &Screen,
        encoder: &mut wgpu::CommandEncoder,
        target: &wgpu::TextureView,
        layer: &mut Layer,
    ) -> Vec<wgpu::CommandBuffer> {
        let (device, queue) = (&screen.gpu.device, &screen.gpu.queue);
        self.take_textures(screen, layer);
        let size = egui_wgpu::ScreenDescriptor {
            size_in_pixels: screen.size_px(),
            pixels_per_point: layer.pixels_per_point,
        };
        let first = self.painter.update_buffers(device, queue, encoder, &layer.primitives, &size);
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("overlay"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
            })],
            depth_stencil_attachment: None,
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        self.painter.render(&mut pass.forget_lifetime(), &layer.primitives, &size);
        first
    }

    /// Takes a layer's textures to the device, painted or not: they come once.
    pub(crate) fn take_textures(&mut self, screen: &Screen, layer: &mut Layer) {
        for (id, deltas) in layer.textures.set.drain() {
            for delta in &deltas {
                self.painter.update_texture(&screen.gpu.device, &screen.gpu.queue, id, delta);
            }
        }
    }

    /// Lets go of textures after the frame that used them last.
    pub(crate) fn settle(&mut self, layer: &mut Layer) {
        for id in layer.textures.free.drain() {
            self.painter.free_texture(&id);
        }
    }
}

/// Dark, a little see-through, blue where something is chosen.
fn visuals() -> Visuals {
    let mut visuals = Visuals::dark();
    let accent = Color32::from_rgb(0x3d, 0x86, 0xc6);
    visuals.panel_fill = PANEL;
    visuals.window_fill = PANEL;
    visuals.window_stroke = Stroke::new(1.0, Color32::from_gray(64));
    visuals.window_corner_radius = CornerRadius::same(8);
    visuals.selection.bg_fill = accent;
    visuals.selection.stroke = Stroke::new(1.0, Color32::WHITE);
    visuals.slider_trailing_fill = true;
    visuals.override_text_color = Some(Color32::from_gray(222));
    visuals
}

/// What panels are filled with.
pub(crate) const PANEL: Color32 = Color32::from_rgba_unmultiplied_const(0x18, 0x1b, 0x20, 0xe8);
