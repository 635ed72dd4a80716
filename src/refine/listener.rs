//! Whoever hears an engine, as one type: so an engine is compiled once a store, and not once more for each kind of listener.
//!
//! Invariant: a listener hears what its [`Probe`] would hear. Cost: a call by way of a table for each read that is heard, and none for those that are not.

use super::{Phase, Probe};

/// A [`Probe`] whose type is forgotten.
pub(crate) struct Listener<'p> {
    probe: &'p mut dyn Hear,
    hears_reads: bool,
    hears_foreseen: bool,
}

/// What every [`Probe`] can hear. Unlike that it has no constants, so that it can stand behind a table.
trait Hear {
    fn read(&mut self, slot: u64);
    fn foreseen(&mut self, slot: u64);
    fn phase(&mut self, phase: Phase);
}

impl<P: Probe> Hear for P {
    fn read(&mut self, slot: u64) {
        Probe::read(self, slot);
    }

    fn foreseen(&mut self, slot: u64) {
        Probe::foreseen(self, slot);
    }

    fn phase(&mut self, phase: Phase) {
        Probe::phase(self, phase);
    }
}

impl<'p> Listener<'p> {
    pub(crate) fn new<P: Probe>(probe: &'p mut P) -> Self {
        Self { probe, hears_reads: P::HEARS_READS, hears_foreseen: P::HEARS_FORESEEN }
    }

    /// Whether [`Listener::read`] does anything.
    #[inline(always)]
    pub(crate) fn hears_reads(&self) -> bool {
        self.hears_reads
    }

    /// Whether all that can be foreseen is to be told.
    #[inline(always)]
    pub(crate) fn hears_foreseen(&self) -> bool {
        self.hears_foreseen
    }

    /// The record at a slot was read.
    #[inline(always)]
    pub(crate) fn read(&mut self, slot: u64) {
        if self.hears_reads {
            self.probe.read(slot);
        }
    }

    /// The record at a slot was left unread.
    pub(crate) fn foreseen(&mut self, slot: u64) {
        self.probe.foreseen(slot);
    }

    /// The update goes on to its next part.
    pub(crate) fn phase(&mut self, phase: Phase) {
        self.probe.phase(phase);
    }
}
