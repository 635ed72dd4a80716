//! The window's events, one by one, until it is closed.
//!
//! The event loop sleeps while nothing moves. An error before the first picture ends the program. The viewer reports later ones.

use super::Plan;
use super::display::plain;
use super::settings::Settings;
use super::viewer::{Next, Viewer};
use super::wake::Wake;
use anyhow::{Result, anyhow};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use terrasoar::flight::Flight;
use terrasoar_layout::read::terrain::Terrain;
use winit::application::ApplicationHandler;
use winit::dpi::{LogicalSize, PhysicalSize, Size};
use winit::event::{ElementState, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::keyboard::PhysicalKey;
use winit::window::{Window, WindowId};

/// Runs the loop.
pub(super) fn run(
    event_loop: EventLoop<Wake>,
    plan: Plan,
    terrain: Terrain,
    flight: Option<Flight>,
) -> Result<()> {
    let closing = Arc::new(AtomicBool::new(false));
    #[cfg(unix)]
    crate::asked::first({
        let (closing, proxy) = (Arc::clone(&closing), event_loop.create_proxy());
        move || {
            closing.store(true, Ordering::SeqCst);
            let _ = proxy.send_event(Wake);
        }
    });
    let mut session = Session {
        closing,
        proxy: event_loop.create_proxy(),
        settings_path: Settings::path(),
        waiting: Some((plan, terrain, flight)),
        viewer: None,
        failure: None,
    };
    let ended = event_loop.run_app(&mut session);
    if let Err(error) = ended {
        // Where the display is gone, edits are saved all the same.
        let saved = session.viewer.as_mut().map_or(Ok(()), Viewer::close_workshop);
        let words = anyhow!("the window's events came to an end: {}", plain(&error));
        return Err(match saved {
            Ok(()) => words,
            Err(lost) => words.context(format!("the last edits could not be saved: {lost}")),
        });
    }
    session.failure.map_or(Ok(()), Err)
}

struct Session {
    /// Whether a signal asks the program to end.
    closing: Arc<AtomicBool>,
    proxy: EventLoopProxy<Wake>,
    settings_path: Option<PathBuf>,
    /// What the viewer is made of, once there may be a window.
    waiting: Option<(Plan, Terrain, Option<Flight>)>,
    viewer: Option<Viewer>,
    failure: Option<anyhow::Error>,
}

impl Session {
    fn begin(&self, event_loop: &ActiveEventLoop, parts: (Plan, Terrain, Option<Flight>)) -> Result<Viewer> {
        let (plan, terrain, flight) = parts;
        let (mut settings, word) = match &self.settings_path {
            Some(path) => Settings::load(path),
            None => (Settings::default(), None),
        };
        if let Some(style) = &plan.style {
            settings.set_style(style);
        }
        settings.ramp = plan.ramp.clone().or(settings.ramp);
        settings.tolerance_px = plan.tolerance_px.or(settings.tolerance_px);
        if let Some(metric) = plan.metric {
            settings.metric = metric.name().to_owned();
        }
        settings.exaggeration = plan.exaggeration.unwrap_or(settings.exaggeration);
        let size: Size = match plan.size_px {
            Some([width, height]) => PhysicalSize::new(width, height).into(),
            None => {
                let [width, height] = settings.window_on(screen_points(event_loop));
                LogicalSize::new(width, height).into()
            }
        };
        let attributes = Window::default_attributes()
            .with_title("Terrasoar")
            .with_inner_size(size)
            .with_min_inner_size(LogicalSize::new(320, 240));
        let window = event_loop
            .create_window(attributes)
            .map_err(|e| anyhow!("no window can be opened: {}", plain(&e)))?;
        let display = event_loop.owned_display_handle();
        let mut viewer =
            Viewer::new(Arc::new(window), display, self.proxy.clone(), plan, settings, terrain, flight)?;
        if let Some(word) = word {
            viewer.trouble(word);
        }
        Ok(viewer)
    }

    fn end(&mut self, event_loop: &ActiveEventLoop) {
        if let Some(viewer) = &mut self.viewer {
            viewer.end_recording();
            let closed = viewer.close_workshop();
            self.failure = viewer.failure.take();
            if let Err(words) = closed {
                self.failure.get_or_insert(anyhow!("the last edits could not be saved: {words}"));
            }
            if let Some(path) = &self.settings_path
                && let Err(error) = viewer.settings_to_keep().save(path)
            {
                self.failure.get_or_insert(error);
            }
        }
        event_loop.exit();
    }
}

/// Size of the screen in points, where it can be known.
fn screen_points(event_loop: &ActiveEventLoop) -> Option<[f64; 2]> {
    let monitor = event_loop.primary_monitor().or_else(|| event_loop.available_monitors().next())?;
    let size = monitor.size().to_logical::<f64>(monitor.scale_factor());
    (size.width > 0.0 && size.height > 0.0).then_some([size.width, size.height])
}

impl ApplicationHandler<Wake> for Session {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        let Some(parts) = self.waiting.take() else { return };
        match self.begin(event_loop, parts) {
            Ok(viewer) => {
                viewer.window().request_redraw();
                self.viewer = Some(viewer);
            }
            Err(error) => {
                self.failure = Some(error);
                event_loop.exit();
            }
        }
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, _: Wake) {
        if self.closing.swap(false, Ordering::SeqCst) {
            let Some(viewer) = &mut self.viewer else { return event_loop.exit() };
            viewer.quit();
            if viewer.may_end() {
                return self.end(event_loop);
            }
        }
        if let Some(viewer) = &self.viewer {
            viewer.window().request_redraw();
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, cause: winit::event::StartCause) {
        if let (winit::event::StartCause::ResumeTimeReached { .. }, Some(viewer)) = (cause, &self.viewer) {
            viewer.window().request_redraw();
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(viewer) = &mut self.viewer else { return };
        if viewer.overlay_hears(&event) {
            viewer.window().request_redraw();
        }
        match event {
            WindowEvent::CloseRequested => {
                viewer.quit();
                if viewer.may_end() {
                    return self.end(event_loop);
                }
            }
            WindowEvent::Resized(size) => viewer.resize(size.width, size.height),
            WindowEvent::Occluded(hidden) => viewer.hide(hidden),
            WindowEvent::Focused(false) => viewer.hand.release(),
            WindowEvent::DroppedFile(path) => viewer.open(path),
            WindowEvent::ModifiersChanged(modifiers) => {
                viewer.hand.shift = modifiers.state().shift_key();
                viewer.hand.ctrl = modifiers.state().control_key();
            }
            // A key that was held when the window got the keyboard was pressed for another, or is about to be heard of by itself.
            WindowEvent::KeyboardInput { event: key, is_synthetic, .. } => {
                let is_pressed_for_us = !is_synthetic || key.state == ElementState::Released;
                if let (PhysicalKey::Code(code), true) = (key.physical_key, is_pressed_for_us) {
                    viewer.key(code, key.state == ElementState::Pressed, key.repeat);
                }
            }
            WindowEvent::CursorMoved { position, .. } => viewer.hand.move_to([position.x, position.y]),
            WindowEvent::CursorLeft { .. } if !viewer.hand.is_dragging() => viewer.hand.pointer = None,
            WindowEvent::MouseInput { state, button, .. } => {
                viewer.button(button, state == ElementState::Pressed);
            }
            WindowEvent::MouseWheel { delta, .. } => viewer.wheel(match delta {
                MouseScrollDelta::LineDelta(_, lines) => f64::from(lines),
                MouseScrollDelta::PixelDelta(pixels) => pixels.y / 50.0,
            }),
            WindowEvent::RedrawRequested => match viewer.frame() {
                Next::AtOnce => {
                    event_loop.set_control_flow(ControlFlow::Wait);
                    viewer.window().request_redraw();
                }
                Next::In(wait) => event_loop.set_control_flow(
                    Instant::now().checked_add(wait).map_or(ControlFlow::Wait, ControlFlow::WaitUntil),
                ),
                Next::End => self.end(event_loop),
            },
            _ => {}
        }
        if let Some(viewer) = &self.viewer
            && viewer.is_touched()
        {
            viewer.window().request_redraw();
        }
    }
}
