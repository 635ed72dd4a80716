//! A speed that changes gradually, so that the eye starts and stops without a jerk.
//!
//! The difference to the wanted velocity decays with a time constant, and the way is its exact integral, so two half steps are one step.

use glam::DVec3;

/// Time constant in seconds.
const TAU_S: f64 = 0.12;

/// Metres a second, east, north and up.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Velocity(DVec3);

impl Velocity {
    /// Approaches `wanted_m_s` for `span_s` seconds; gives the way made meanwhile, in metres.
    pub(super) fn advance(&mut self, span_s: f64, wanted_m_s: DVec3) -> DVec3 {
        let kept = (-span_s / TAU_S).exp();
        let lag = self.0 - wanted_m_s;
        self.0 = wanted_m_s + lag * kept;
        wanted_m_s * span_s + lag * (TAU_S * (1.0 - kept))
    }

    /// Whether it is as good as nothing beside `speed_m_s`.
    pub(super) fn is_rest(&self, speed_m_s: f64) -> bool {
        self.0.length() < 1e-3 * speed_m_s
    }
}
