//! Places in the bin-tree array and its triangle slots, dealt out in pages of [`PAGE`] nodes.
//!
//! A page is also the cluster that culling works on: its triangles' slots are one range, and it has bounds. Two ways of dealing:
//! *packed* fills whatever page has room, so that the array is as short as can be; *near* puts a child into its parent's page, or into
//! the page that this one spills into when it is full, so that a page's triangles lie together on the ground.
//!
//! Invariant: a page's bounds contain all triangles that its slots show. Cost: a few bit operations a node.

use std::ops::Range;

/// Nodes of a page.
pub(super) const PAGE: usize = 128;
/// No page.
const NONE: u32 = u32::MAX;

/// A box around a cluster, in grid steps (padding folded) and metres of height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least column, row and height.
    pub least: [f32; 3],
    /// Largest column, row and height.
    pub largest: [f32; 3],
}

impl Bounds {
    /// The box around nothing.
    pub(super) const EMPTY: Self = Self { least: [f32::INFINITY; 3], largest: [f32::NEG_INFINITY; 3] };

    /// Widens the box to contain a point.
    #[inline(always)]
    pub(super) fn include(&mut self, p: [f32; 3]) {
        for (i, p) in p.into_iter().enumerate() {
            self.least[i] = self.least[i].min(p);
            self.largest[i] = self.largest[i].max(p);
        }
    }
}

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
    bounds: Vec<Bounds>,
    /// Packed: pages with room, newest last; near: empty pages. May hold others as well.
    open: Vec<u32>,
    /// Pages with slots that have changed.
    written: Vec<u32>,
    taken: usize,
}

impl Pages {
    pub(super) fn new(dealing: Dealing) -> Self {
        Self {
            dealing,
            pages: Vec::new(),
            bounds: Vec::new(),
            open: Vec::new(),
            written: Vec::new(),
            taken: 0,
        }
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        self.pages.capacity() * size_of::<Page>()
            + self.bounds.capacity() * size_of::<Bounds>()
            + (self.open.capacity() + self.written.capacity()) * size_of::<u32>()
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
        let place = (!self.pages[page].taken).trailing_zeros();
        self.pages[page].taken |= 1 << place;
        self.taken += 1;
        (page * PAGE) as u32 + place
    }

    /// Takes the place `place`. If somebody is there, takes another place for him and returns it.
    pub(super) fn clear(&mut self, place: u32) -> Option<u32> {
        let (page, bit) = (place as usize / PAGE, 1 << (place as usize % PAGE));
        if self.pages[page].taken & bit == 0 {
            self.pages[page].taken |= bit;
            self.taken += 1;
            return None;
        }
        // Moving him gives the place back, so it is taken twice over until then: once for him, once for who comes.
        Some(self.take(place))
    }

    fn page_with_room(&mut self) -> usize {
        while let Some(page) = self.open.last() {
            if self.pages[*page as usize].taken != u128::MAX {
                return *page as usize;
            }
            self.open.pop();
        }
        let page = self.new_page();
        self.open.push(page as u32);
        page
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
        while let Some(page) = self.open.pop() {
            if self.pages[page as usize].taken == 0 {
                return page as usize;
            }
        }
        self.new_page()
    }

    fn new_page(&mut self) -> usize {
        self.pages.push(Page { taken: 0, written: [0; 2], spill: (NONE, 0), use_count: 0 });
        self.bounds.push(Bounds::EMPTY);
        self.pages.len() - 1
    }

    /// Gives a place back.
    pub(super) fn give_back(&mut self, place: u32) {
        let index = place as usize / PAGE;
        let page = &mut self.pages[index];
        let was_full = page.taken == u128::MAX;
        page.taken &= !(1 << (place as usize % PAGE));
        self.taken -= 1;
        if page.taken == 0 {
            page.use_count = page.use_count.wrapping_add(1);
            self.bounds[index] = Bounds::EMPTY;
        }
        if (self.dealing == Dealing::Packed && was_full) || (self.dealing == Dealing::Near && page.taken == 0)
        {
            self.open.push(index as u32);
        }
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
        let bounds = &mut self.bounds[place as usize / PAGE];
        points.iter().for_each(|p| bounds.include(*p));
    }

    /// Sets the bounds of a page.
    pub(super) fn set_bounds(&mut self, page: usize, bounds: Bounds) {
        self.bounds[page] = bounds;
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
    pub(super) fn clusters(&self) -> impl Iterator<Item = (&Bounds, Range<u32>)> {
        self.pages.iter().zip(&self.bounds).enumerate().filter(|(_, (page, _))| page.taken != 0).map(
            |(index, (page, bounds))| {
                let first = (index * PAGE) as u32;
                let (from, to) = (page.taken.trailing_zeros(), PAGE as u32 - page.taken.leading_zeros());
                (bounds, 2 * (first + from)..2 * (first + to))
            },
        )
    }
}
