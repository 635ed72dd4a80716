//! Whether links lead somewhere: files that are there, anchors of headings in them. Links into the web are not followed.

use crate::Wrong;
use crate::page::{Page, root};
use std::path::{Component, Path, PathBuf};

/// Links to the repository's own pages on its forge, which are here too.
const REPOSITORY: &str = "https://github.com/terrasoar/terrasoar/blob/main/";

/// Folders that a path in a code span begins with.
const FOLDERS: [&str; 12] = [
    "benches/",
    "cli/",
    "data-scripts/",
    "docs/",
    "examples/",
    "fuzz/",
    "import/",
    "lab/",
    "layout/",
    "render/",
    "scene/",
    "src/",
];

/// What is wrong with all links.
pub fn wrong(pages: &[Page]) -> Wrong {
    let mut wrong = Vec::new();
    let mut looked_at = 0;
    for page in pages {
        wrong.extend(page.dangling.iter().map(|name| format!("{}: [{name}] is nowhere defined", page.name)));
        for link in &page.links {
            let (base, to) = match link.to.strip_prefix(REPOSITORY) {
                Some(to) => (Path::new(""), to),
                None => (page.folder(), link.to.as_str()),
            };
            if to.contains("://") || to.starts_with("mailto:") {
                continue;
            }
            looked_at += 1;
            if let Some(why) = fault(pages, page, base, to) {
                wrong.push(format!("{}: the link {} {why}", page.name, link.to));
            }
        }
    }
    assert!(looked_at > 100, "only {looked_at} links were found");
    wrong
}

/// Why a link leads nowhere.
pub fn fault(pages: &[Page], page: &Page, base: &Path, to: &str) -> Option<String> {
    let (file, anchor) = to.split_once('#').unwrap_or((to, ""));
    let path = match file {
        "" => PathBuf::from(&page.name),
        file => match plain(&base.join(file)) {
            Some(path) => path,
            None => return Some("leads out of the repository".into()),
        },
    };
    if !file.is_empty() && !root().join(&path).exists() {
        return Some(format!("leads to {}, which is not there", path.display()));
    }
    if anchor.is_empty() {
        return None;
    }
    if anchor.contains("--") {
        return Some(
            "leads to a heading with marks in it, of which forges and the book make other anchors".into(),
        );
    }
    let name = path.to_string_lossy().replace('\\', "/");
    let Some(other) = pages.iter().find(|other| other.name == name) else {
        return Some("has an anchor in what is no Markdown".into());
    };
    (!other.anchors.iter().any(|known| known == anchor))
        .then(|| format!("leads to none of the headings of {name}: {}", other.anchors.join(" ")))
}

/// `path` without `..`; none if that leads out of the root.
fn plain(path: &Path) -> Option<PathBuf> {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => plain.pop().then_some(())?,
            Component::CurDir => {}
            other => plain.push(other),
        }
    }
    Some(plain)
}

/// What is wrong with paths of files in code spans, counted from the root or from the page's own folder.
pub fn wrong_paths(pages: &[Page]) -> Wrong {
    let mut wrong = Vec::new();
    for page in pages.iter().filter(|page| !page.is_history()) {
        for span in &page.spans {
            let is_path = FOLDERS.iter().any(|folder| span.starts_with(folder))
                && [".rs", ".md", ".svg", ".py"].iter().any(|ending| span.ends_with(ending))
                && !span.contains([' ', '*', '{', '<']);
            let here = [root(), root().join(page.folder())];
            if is_path && !here.iter().any(|folder| folder.join(span).exists()) {
                wrong.push(format!("{}: {span} is not there", page.name));
            }
        }
    }
    wrong
}
