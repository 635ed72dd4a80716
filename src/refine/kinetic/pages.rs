//! Places in the bin-tree array and its triangle slots, dealt out in pages of [`PAGE`] nodes.
//!
//! A page is also the cluster that culling works on: its triangles' slots are one range, and it has bounds. Two ways of dealing:
//! *packed* fills whatever page has room, so that the array is as short as can be; *near* puts a child into its parent's page, or into
//! the page that this one spills into when it is full, so that a page's triangles lie together on the ground.
//!
//! Invariant: a page's bounds contain all triangles that its slots show. Cost: a few bit operations a node.

use super::bounds::{Bounds, BoundsColumns};
use crate::metric::{BoxPlane, PLANES};
use std::ops::Range;

/// Nodes of a page.
pub(super) const PAGE: usize = 128;
/// No page.
const NONE: u32 = u32::MAX;

#[derive(Debug, Clone, Copy)]
struct Page {
    /// Bit i: place i is taken.
    taken: u128,
    /// Bit i of side s: slot 2 i + s has changed.
    written: [u128; 2],
    /// Where children go when this page is full, and which use of that page is meant.
    spill: (u32, u32),
    /// How often the page has been emptied.
    use_count: u32,
}

/// How places are dealt out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Dealing {
    Packed,
    Near,
}

/// The pages of one array.
#[derive(Debug)]
pub(super) struct Pages {
    dealing: Dealing,
    pages: Vec<Page>,
    /// Bounds of each page.
    bounds: BoundsColumns,
    /// Packed: no page before this one has room.
    first_open: usize,
    /// Near: empty pages. May hold others as well.
    empty: Vec<u32>,
    /// Pages with slots that have changed.
    written: Vec<u32>,
    taken: usize,
}

impl Pages {
    pub(super) fn new(dealing: Dealing) -> Self {
        Self {
            dealing,
            pages: Vec::new(),
            bounds: BoundsColumns::default(),
            first_open: 0,
            empty: Vec::new(),
            written: Vec::new(),
            taken: 0,
        }
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        self.pages.capacity() * size_of::<Page>()
            + self.bounds.bytes()
            + (self.empty.capacity() + self.written.capacity()) * size_of::<u32>()
    }

    /// Places in all pages.
    pub(super) fn places(&self) -> usize {
        self.pages.len() * PAGE
    }

    /// Places taken.
    pub(super) fn taken(&self) -> usize {
        self.taken
    }

    /// Takes a place: anywhere, or beside the place `beside`.
    pub(super) fn take(&mut self, beside: u32) -> u32 {
        let page = match self.dealing {
            Dealing::Packed => self.page_with_room(),
            Dealing::Near => self.page_near(beside as usize / PAGE),
        };
        self.take_in(page)
    }

    /// Takes a place in the page of the place `beside`, if it has room and is not page `other`.
    pub(super) fn take_in_page_of(&mut self, beside: u32, other: usize) -> Option<u32> {
        let page = beside as usize / PAGE;
        (page != other && self.pages.get(page)?.taken != u128::MAX).then(|| self.take_in(page))
    }

    fn take_in(&mut self, page: usize) -> u32 {
        let place = (!self.pages[page].taken).trailing_zeros();
        self.pages[page].taken |= 1 << place;
        self.taken += 1;
        (page * PAGE) as u32 + place
    }

    /// The first page with room.
    fn page_with_room(&mut self) -> usize {
        let full = self.pages[self.first_open..].iter().take_while(|page| page.taken == u128::MAX).count();
        self.first_open += full;
        if self.first_open == self.pages.len() { self.new_page() } else { self.first_open }
    }

    fn page_near(&mut self, page: usize) -> usize {
        let Some(Page { taken, spill: (spill, use_count), .. }) = self.pages.get(page).copied() else {
            return self.new_page();
        };
        if taken != u128::MAX {
            return page;
        }
        if let Some(other) = self.pages.get(spill as usize)
            && other.use_count == use_count
            && other.taken != u128::MAX
        {
            return spill as usize;
        }
        let other = self.empty_page();
        self.pages[page].spill = (other as u32, self.pages[other].use_count);
        other
    }

    fn empty_page(&mut self) -> usize {
        while let Some(page) = self.empty.pop() {
            if self.pages.get(page as usize).is_some_and(|page| page.taken == 0) {
                return page as usize;
            }
        }
        self.new_page()
    }

    fn new_page(&mut self) -> usize {
        self.pages.push(Page { taken: 0, written: [0; 2], spill: (NONE, 0), use_count: 0 });
        self.bounds.push_empty();
        self.pages.len() - 1
    }

    /// Gives a place back.
    pub(super) fn give_back(&mut self, place: u32) {
        let index = place as usize / PAGE;
        let page = &mut self.pages[index];
        page.taken &= !(1 << (place as usize % PAGE));
        self.taken -= 1;
        if page.taken == 0 {
            page.use_count = page.use_count.wrapping_add(1);
            self.bounds.set(index, Bounds::EMPTY);
        }
        if self.dealing == Dealing::Packed {
            self.first_open = self.first_open.min(index);
        } else if page.taken == 0 {
            self.empty.push(index as u32);
        }
    }

    /// Gives up empty pages at the end whose slots have been told; whether there were any.
    pub(super) fn give_up_empty_end(&mut self) -> bool {
        let before = self.pages.len();
        while self.pages.last().is_some_and(|page| page.taken == 0 && page.written == [0; 2]) {
            self.pages.pop();
            self.bounds.pop();
        }
        self.first_open = self.first_open.min(self.pages.len());
        self.pages.len() < before
    }

    /// Notes that the slot of a place's side shows something else now.
    #[inline(always)]
    pub(super) fn touch(&mut self, place: u32, side: usize) {
        let index = place as usize / PAGE;
        let page = &mut self.pages[index];
        if page.written == [0; 2] {
            self.written.push(index as u32);
        }
        page.written[side] |= 1 << (place as usize % PAGE);
    }

    /// Hands out the slots that have changed, as places and sides, page by page in order.
    pub(super) fn take_written(&mut self, mut each: impl FnMut(u32, usize)) {
        for index in self.written.drain(..) {
            let written = std::mem::take(&mut self.pages[index as usize].written);
            let mut either = written[0] | written[1];
            while either != 0 {
                let place = either.trailing_zeros();
                either &= either - 1;
                for (side, written) in written.iter().enumerate() {
                    if written >> place & 1 == 1 {
                        each(index * PAGE as u32 + place, side);
                    }
                }
            }
        }
    }

    /// How places are dealt out.
    pub(super) fn dealing(&self) -> Dealing {
        self.dealing
    }

    /// Whether bounds are kept: packed pages lie anywhere.
    #[inline(always)]
    pub(super) fn has_bounds(&self) -> bool {
        self.dealing == Dealing::Near
    }

    /// Widens the bounds of a place's page.
    #[inline(always)]
    pub(super) fn cover(&mut self, place: u32, points: &[[f32; 3]]) {
        let page = place as usize / PAGE;
        let mut bounds = self.bounds.get(page);
        points.iter().for_each(|p| bounds.include(*p));
        self.bounds.set(page, bounds);
    }

    /// Sets the bounds of a page.
    pub(super) fn set_bounds(&mut self, page: usize, bounds: Bounds) {
        self.bounds.set(page, bounds);
    }

    /// Number of pages.
    pub(super) fn len(&self) -> usize {
        self.pages.len()
    }

    /// Places taken in a page.
    pub(super) fn places_of(&self, page: usize) -> impl Iterator<Item = u32> + use<> {
        let mut taken = self.pages[page].taken;
        std::iter::from_fn(move || {
            let place = taken.trailing_zeros();
            (taken != 0).then(|| {
                taken &= taken - 1;
                (page * PAGE) as u32 + place
            })
        })
    }

    /// Bounds and triangle slots of every page that is in use.
    pub(super) fn clusters(&self) -> impl Iterator<Item = (Bounds, Range<u32>)> {
        let used = self.pages.iter().enumerate().filter(|(_, page)| page.taken != 0);
        used.map(|(index, page)| (self.bounds.get(index), slots_of(index, page)))
    }

    /// Calls `draw` with the triangle slots of every page that is in use and may be seen.
    pub(super) fn cull(&mut self, planes: &[BoxPlane; PLANES], mut draw: impl FnMut(Range<u32>)) {
        let is_seen = self.bounds.cull(planes);
        for (index, page) in self.pages.iter().enumerate() {
            if page.taken != 0 && is_seen(index) {
                draw(slots_of(index, page));
            }
        }
    }
}

/// The triangle slots from a page's first place taken to its last.
fn slots_of(index: usize, page: &Page) -> Range<u32> {
    let first = (index * PAGE) as u32;
    let (from, to) = (page.taken.trailing_zeros(), PAGE as u32 - page.taken.leading_zeros());
    2 * (first + from)..2 * (first + to)
}
