//! Other contents put into pages, as undo does. All that can fail comes before the file changes; what follows cannot fail.

use super::Core;
use crate::edit::Changes;
use crate::error::LayoutError;
use crate::file::bytes::Page;
use crate::file::entries::Entry;
use crate::file::header::Header;
use crate::grid::record::RecordCodec;

/// Contents for pages that are in the file at other places, ready to be put in.
#[derive(Debug)]
pub(crate) struct Replacement {
    pages: Vec<NewPage>,
    range: ([f64; 2], f64),
}

#[derive(Debug)]
struct NewPage {
    logical: u64,
    entry: Entry,
    now: Box<Page>,
    new: Box<Page>,
}

impl<C: RecordCodec> Core<C> {
    pub(crate) fn replacement(
        &mut self,
        places: &[(u64, Entry)],
        header: &Header,
    ) -> Result<Replacement, LayoutError> {
        if !self.pages.is_committed() {
            return Err(LayoutError::Usage(
                "edits that are not committed are in the way; commit them or take them back first".into(),
            ));
        }
        let mut pages = Vec::with_capacity(places.len());
        for (logical, entry) in places {
            // What is there now is compared with it, and must not fail to come then.
            let now = Box::new(*self.pages.page(*logical)?);
            pages.push(NewPage {
                logical: *logical,
                entry: *entry,
                now,
                new: self.pages.read_at(*logical, *entry)?,
            });
        }
        Ok(Replacement { pages, range: (header.height_range_m, header.scale.error_top_m) })
    }

    pub(crate) fn replace(&mut self, replacement: Replacement) -> Changes {
        let mut changes = Changes::default();
        for NewPage { logical, entry, now, new } in replacement.pages {
            self.pages.replace(logical, entry, new);
            self.note_differences(logical, &now, &mut changes);
        }
        self.set_range(replacement.range);
        self.committed = replacement.range;
        self.end_replacing(changes)
    }
}
