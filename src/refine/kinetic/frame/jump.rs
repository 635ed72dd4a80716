//! A jump of the eye: where most words are over at once, the mesh is made anew instead of being changed vertex by vertex.
//!
//! Clocks tell how far the eye has come, and the queue which of its slots are over as a whole, before any entry is looked at. If that is most of all entries, everything is given up in a few
//! steps, and the frame goes on as the first one does: from four triangles, all at once ([`Kinetic::build`]) or as far as a budget allows. So a frame with a budget
//! never walks a mesh that is of no use any more, and what a budget leaves undone is fine detail.
//!
//! Invariant: the mesh is the same as without. Receivers of patches are not told of a jump: slots that the mesh before it filled are told as the new one comes to them, and no range that is drawn has
//! others. Cost: a look at the wheels of all clocks that have moved, some microseconds; a jump, in proportion to a hundredth of the nodes.

use crate::refine::kinetic::Kinetic;
use crate::refine::kinetic::capacity::give_back;
use crate::refine::kinetic::frame::collect::each_clock;
use crate::refine::kinetic::time::queue::Queue;
use terrasoar_layout::read::store::RecordStore;

/// Meshes with fewer words are changed vertex by vertex, whatever happens: that takes no time to speak of.
const LEAST: usize = 1024;
/// A jump is where more than so many quarters of the words are over.
const QUARTERS: usize = 3;
/// Memory is given back after a jump to a mesh that needs less than one part in so many.
const ROOMY: usize = 4;

impl<S: RecordStore> Kinetic<S> {
    /// Whether most words are over, the clocks `moved` having moved on.
    pub(crate) fn has_jumped(&self, moved: u128) -> bool {
        let entries = self.queue.len() + self.ahead.as_ref().map_or(0, |ahead| ahead.far.len());
        if entries < LEAST {
            return false;
        }
        let queues = [Some(&self.queue), self.ahead.as_ref().map(|ahead| &ahead.far)];
        let is_most = |over: fn(&Queue, usize, u64) -> usize| {
            let mut sum = 0;
            each_clock(moved, |clock| {
                let now = self.clocks.now(clock);
                sum += queues.into_iter().flatten().map(|queue| over(queue, clock, now)).sum::<usize>();
            });
            4 * sum > QUARTERS * entries
        };
        // Hardly ever is there anything to be counted.
        is_most(Queue::most_over) && is_most(Queue::count_over)
    }

    /// Gives up the whole mesh and all that was to be done with it.
    pub(crate) fn uproot(&mut self) {
        self.nodes.all.clear();
        self.nodes.rings.clear();
        self.nodes.clusters.clear();
        self.vertices.clear();
        (self.triangles, self.stale, self.sparse) = (0, 0, 0);
        self.queue.clear();
        if let Some(ahead) = &mut self.ahead {
            ahead.clear();
        }
        let lists = [&mut self.unread, &mut self.due, &mut self.late, &mut self.fresh];
        lists.into_iter().chain(&mut self.to_split).chain(&mut self.to_merge).for_each(Vec::clear);
        self.edits.loose = 0;
        self.is_roomy = true;
    }

    /// Gives back what the mesh before a jump had and this one has no use for, once this one is all there.
    pub(crate) fn give_back_room(&mut self) {
        if !self.is_roomy || self.work.late > 0 {
            return;
        }
        self.is_roomy = false;
        give_back(&mut self.nodes.all, ROOMY);
        self.nodes.rings.give_back(ROOMY);
        self.vertices.give_back(ROOMY);
        self.queue.give_back();
        if let Some(ahead) = &mut self.ahead {
            ahead.far.give_back();
        }
    }
}
