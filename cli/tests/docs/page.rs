//! The Markdown files of the repository, taken apart: headings, links, blocks of code, tables, and what hidden comments say.
//!
//! A comment `<!-- not run: why -->` before a block keeps it from being run, `<!-- code: file part -->` says which file it shows. `<!-- fields: command -->` and `<!-- columns: command ; file -->` say
//! which output the section that they stand in explains.

use pulldown_cmark::{BrokenLink, CodeBlockKind, CowStr, Event, LinkType, Options, Parser, Tag, TagEnd};
use std::cell::RefCell;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A Markdown file.
#[derive(Debug, Default)]
pub struct Page {
    /// Its path from the repository's root, with `/`.
    pub name: String,
    pub text: String,
    /// Anchors of its headings.
    pub anchors: Vec<String>,
    pub links: Vec<Link>,
    /// References that are nowhere defined.
    pub dangling: Vec<String>,
    pub blocks: Vec<Block>,
    pub tables: Vec<Table>,
    pub orders: Vec<Order>,
    /// Code spans outside blocks.
    pub spans: Vec<String>,
}

#[derive(Debug)]
pub struct Link {
    pub to: String,
    /// Anchor of the heading above it.
    pub section: String,
}

/// A block of code.
#[derive(Debug)]
pub struct Block {
    /// The words behind the fence; none of an indented block.
    pub words: Vec<String>,
    /// Where its text is in the page.
    pub body: Range<usize>,
    /// Why it is not run.
    pub not_run: Option<String>,
    /// The file, and perhaps the part of it, that it shows.
    pub code: Option<String>,
}

#[derive(Debug, Default)]
pub struct Table {
    /// Anchor of the heading above it.
    pub section: String,
    /// Rows below the head.
    pub rows: Vec<Vec<Cell>>,
}

#[derive(Debug, Default)]
pub struct Cell {
    pub text: String,
    pub codes: Vec<String>,
    pub links: Vec<String>,
}

/// What a comment asks for.
#[derive(Debug)]
pub struct Order {
    /// `fields` or `columns`.
    pub what: String,
    /// The command.
    pub command: String,
    /// The file that is looked at, instead of what the command prints.
    pub file: Option<String>,
    /// Anchor of the heading above it.
    pub section: String,
}

/// The repository's root.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// All Markdown files, sorted by name; what is built or hidden left out.
pub fn all() -> Vec<Page> {
    let mut left = vec![root()];
    let mut pages = Vec::new();
    while let Some(folder) = left.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                // A folder beside the fuzzer's targets may hold its findings.
                if !["target", "demo-out", "corpus", "artifacts"].contains(&name.as_str())
                    && !name.starts_with('.')
                {
                    left.push(path);
                }
            } else if name.ends_with(".md") {
                pages.push(Page::read(&path));
            }
        }
    }
    assert!(pages.len() > 20, "only {} Markdown files were found", pages.len());
    pages.sort_by(|a, b| a.name.cmp(&b.name));
    pages
}

/// The anchor of a heading, as forges make it.
fn anchor(heading: &str, taken: &[String]) -> String {
    let kept = heading.to_lowercase();
    let kept = kept.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    let plain: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
    let again = (1..).map(|n| format!("{plain}-{n}"));
    let mut names = std::iter::once(plain.clone()).chain(again);
    names.find(|name| !taken.contains(name)).unwrap_or(plain)
}

impl Page {
    pub fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap().replace("\r\n", "\n");
        let name = path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
        Self::of(name, text)
    }

    pub fn of(name: String, text: String) -> Self {
        let dangling = RefCell::new(Vec::new());
        let mut page = Reader::default().page(&text, &dangling);
        (page.name, page.text, page.dangling) = (name, text, dangling.into_inner());
        page
    }

    /// Whether its commands are run: README.md, and all pages of the book.
    pub fn is_run(&self) -> bool {
        self.name == "README.md" || self.name.starts_with("docs/")
    }

    /// Whether nothing is left of it where nothing can be drawn.
    pub fn only_draws(&self) -> bool {
        ["docs/manual/snapshot.md", "docs/manual/movie.md"].contains(&self.name.as_str())
    }

    /// What was true once and stays as it was.
    pub fn is_history(&self) -> bool {
        self.name == "CHANGELOG.md" || self.name.starts_with("benches/runs/")
    }

    /// The folder it is in, from the root.
    pub fn folder(&self) -> &Path {
        Path::new(&self.name).parent().unwrap()
    }
}

/// What the parser has told so far.
#[derive(Default)]
struct Reader {
    page: Page,
    section: String,
    heading: Option<String>,
    cell: Option<Cell>,
    /// What a comment said of the block that follows.
    not_run: Option<String>,
    /// Which file a comment said that the block that follows shows.
    code: Option<String>,
    is_in_block: bool,
}

impl Reader {
    fn page(mut self, text: &str, dangling: &RefCell<Vec<String>>) -> Page {
        let missing = |link: BrokenLink<'_>| -> Option<(CowStr<'_>, CowStr<'_>)> {
            // Other brackets are brackets.
            if link.link_type == LinkType::Reference {
                dangling.borrow_mut().push(link.reference.to_string());
            }
            None
        };
        let options = Options::ENABLE_TABLES;
        let parser = Parser::new_with_broken_link_callback(text, options, Some(missing));
        for (event, range) in parser.into_offset_iter() {
            self.take(event, range);
        }
        self.page
    }

    fn take(&mut self, event: Event<'_>, range: Range<usize>) {
        match event {
            Event::Start(tag) => self.begin(tag),
            Event::End(tag) => self.end(tag),
            Event::Code(code) => {
                if let Some(cell) = &mut self.cell {
                    cell.codes.push(code.to_string());
                }
                self.page.spans.push(code.to_string());
                self.words(&code);
            }
            Event::Text(text) if self.is_in_block => {
                let block = self.page.blocks.last_mut().unwrap();
                let start = if block.body.is_empty() { range.start } else { block.body.start };
                block.body = start..range.end;
                let _ = text;
            }
            Event::Text(text) => self.words(&text),
            Event::SoftBreak => self.words(" "),
            Event::Html(html) | Event::InlineHtml(html) => self.comment(&html),
            _ => {}
        }
    }

    fn words(&mut self, words: &str) {
        if let Some(heading) = &mut self.heading {
            heading.push_str(words);
        }
        if let Some(cell) = &mut self.cell {
            cell.text.push_str(words);
        }
    }

    fn begin(&mut self, tag: Tag<'_>) {
        let (not_run, code) = (self.not_run.take(), self.code.take());
        match tag {
            Tag::Heading { .. } => self.heading = Some(String::new()),
            Tag::CodeBlock(kind) => {
                let words = match &kind {
                    CodeBlockKind::Fenced(words) => {
                        words.split([' ', ',']).map(str::to_owned).filter(|w| !w.is_empty()).collect()
                    }
                    CodeBlockKind::Indented => Vec::new(),
                };
                self.page.blocks.push(Block { words, body: 0..0, not_run, code });
                self.is_in_block = true;
            }
            Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. } => {
                if let Some(cell) = &mut self.cell {
                    cell.links.push(dest_url.to_string());
                }
                self.page.links.push(Link { to: dest_url.to_string(), section: self.section.clone() });
            }
            Tag::Table(_) => {
                self.page.tables.push(Table { section: self.section.clone(), ..Table::default() });
            }
            Tag::TableRow => self.page.tables.last_mut().unwrap().rows.push(Vec::new()),
            Tag::TableCell => self.cell = Some(Cell::default()),
            // A comment's own block.
            Tag::HtmlBlock => self.not_run = not_run,
            _ => {}
        }
    }

    fn end(&mut self, tag: TagEnd) {
        match tag {
            TagEnd::Heading(_) => {
                self.section = anchor(&self.heading.take().unwrap(), &self.page.anchors);
                self.page.anchors.push(self.section.clone());
            }
            TagEnd::CodeBlock => self.is_in_block = false,
            TagEnd::TableCell => {
                let cell = self.cell.take().unwrap();
                // The head has no row.
                if let Some(row) = self.page.tables.last_mut().unwrap().rows.last_mut() {
                    row.push(cell);
                }
            }
            _ => {}
        }
    }

    fn comment(&mut self, html: &str) {
        let Some(said) = html.trim().strip_prefix("<!--").and_then(|rest| rest.strip_suffix("-->")) else {
            return;
        };
        let Some((what, said)) = said.trim().split_once(": ") else { return };
        if what == "not run" {
            self.not_run = Some(said.to_owned());
        } else if what == "code" {
            self.code = Some(said.to_owned());
        } else if ["fields", "columns"].contains(&what) {
            let (command, file) = match said.rsplit_once(" ; ") {
                Some((command, file)) => (command, Some(file.trim().to_owned())),
                None => (said, None),
            };
            self.page.orders.push(Order {
                what: what.to_owned(),
                command: command.trim().to_owned(),
                file,
                section: self.section.clone(),
            });
        }
    }
}
