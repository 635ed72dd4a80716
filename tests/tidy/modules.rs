//! The modules of a package: which there are, and which names in them lead where.
//!
//! A path is followed through modules, through what `use` brings and through what is re-exported, to the module that its item is in. Modules for tests
//! are left out. What a macro makes is not seen.

use super::lex::words;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A module.
#[derive(Default)]
struct Module {
    /// Names from the root to it.
    path: Vec<String>,
    parent: Option<usize>,
    children: BTreeMap<String, usize>,
    /// Names that it defines, and modules apart.
    items: BTreeSet<String>,
    /// What it brings in: the name here, and the path.
    imports: Vec<(String, Vec<String>)>,
    /// Paths written in it.
    paths: Vec<Vec<String>>,
}

/// All modules of a package.
#[derive(Default)]
pub struct Modules {
    all: Vec<Module>,
}

/// One module's use of another, both by their paths.
pub type Edge = (Vec<String>, Vec<String>);

impl Modules {
    /// Reads a package from its root file on.
    pub fn read(root: &Path) -> Self {
        let mut modules = Self::default();
        modules.all.push(Module::default());
        modules.read_file(0, root, root.parent().unwrap());
        modules
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.all.len()
    }

    /// Reads the file of a module, whose children lie in `folder`.
    fn read_file(&mut self, module: usize, file: &Path, folder: &Path) {
        let words = words(&fs::read_to_string(file).unwrap());
        let mut parts = vec![(module, folder.to_owned(), 0)];
        let (mut depth, mut i) = (0, 0);
        while i < words.len() {
            let (module, folder, floor) = parts.last().unwrap().clone();
            let word = |n: usize| words.get(i + n).map_or("", String::as_str);
            match word(0) {
                "{" => depth += 1,
                "}" => {
                    depth -= 1;
                    if depth == floor && parts.len() > 1 {
                        parts.pop();
                    }
                }
                "mod" if matches!(word(2), ";" | "{") => {
                    let (name, is_file) = (word(1).to_owned(), word(2) == ";");
                    if is_for_tests(&words[..i]) {
                        i = if is_file { i + 2 } else { end_of_block(&words, i + 2) };
                    } else {
                        let child = self.add(module, &name);
                        let inner = folder.join(&name);
                        if is_file {
                            let file = file_of(&folder, &name);
                            self.read_file(child, &file, &inner);
                        } else {
                            parts.push((child, inner, depth));
                            depth += 1;
                        }
                        i += 2;
                    }
                }
                "use" if word(1) != "<" => {
                    let end = i + words[i..].iter().position(|w| w == ";").unwrap();
                    let absolute = usize::from(word(1) == "::");
                    self.brought(module, &words[i + 1 + absolute..end], &mut 0, &[]);
                    i = end;
                }
                "fn" | "struct" | "enum" | "trait" | "const" | "static" | "type" | "union"
                    if depth == floor + usize::from(parts.len() > 1) =>
                {
                    self.all[module].items.insert(word(1).to_owned());
                }
                _ if word(1) == "::" && is_name(word(0)) && !matches!(before(&words, i), "::" | ".") => {
                    let mut path = vec![word(0).to_owned()];
                    while word(2 * path.len() - 1) == "::" && is_name(word(2 * path.len())) {
                        path.push(word(2 * path.len()).to_owned());
                    }
                    i += 2 * (path.len() - 1);
                    self.all[module].paths.push(path);
                }
                _ => {}
            }
            i += 1;
        }
    }

    fn add(&mut self, parent: usize, name: &str) -> usize {
        let path = [&self.all[parent].path[..], &[name.to_owned()]].concat();
        self.all.push(Module { path, parent: Some(parent), ..Module::default() });
        let child = self.all.len() - 1;
        // One of several, under different conditions, is enough.
        self.all[parent].children.entry(name.to_owned()).or_insert(child);
        child
    }

    /// Takes in a `use` tree from word `at` on.
    fn brought(&mut self, module: usize, words: &[String], at: &mut usize, before: &[String]) {
        let mut path = before.to_vec();
        while let Some(word) = words.get(*at) {
            *at += 1;
            match word.as_str() {
                "::" => {}
                "{" => {
                    while words.get(*at).is_some_and(|w| w != "}") {
                        self.brought(module, words, at, &path);
                        *at += usize::from(words.get(*at).is_some_and(|w| w == ","));
                    }
                    *at += 1;
                    return;
                }
                "," | "}" => {
                    *at -= 1;
                    break;
                }
                "as" => {
                    let name = words[*at].clone();
                    *at += 1;
                    self.all[module].imports.push((name, path));
                    return;
                }
                "self" if path.len() > before.len() || !before.is_empty() => {}
                name => path.push(name.to_owned()),
            }
        }
        let name = path.last().cloned().unwrap_or_default();
        self.all[module].imports.push((name, path));
    }

    /// Every use of one module by another.
    pub fn edges(&self) -> BTreeSet<Edge> {
        let mut edges = BTreeSet::new();
        for (number, module) in self.all.iter().enumerate() {
            let brought = module.imports.iter().map(|(_, path)| path);
            for path in brought.chain(&module.paths) {
                if let Some((to, rest)) = self.followed(number, path, 0) {
                    let home = self.home(to, &rest);
                    edges.insert((module.path.clone(), self.all[home].path.clone()));
                }
            }
        }
        edges
    }

    /// The module that a path leads to, and what is left of it there; `None` out of the package.
    fn followed(&self, from: usize, path: &[String], steps: usize) -> Option<(usize, Vec<String>)> {
        let (first, mut rest) = path.split_first()?;
        let mut at = match first.as_str() {
            "crate" => 0,
            "self" => from,
            "super" => self.all[from].parent?,
            name => {
                let module = &self.all[from];
                if let Some(child) = module.children.get(name) {
                    *child
                } else if module.items.contains(name) {
                    return Some((from, path.to_vec()));
                } else {
                    // What is brought in by that name, unless by this very path.
                    let brought =
                        module.imports.iter().find(|(known, by)| known == name && by[..] != path[..1])?;
                    if steps > 16 {
                        return None;
                    }
                    let (to, left) = self.followed(from, &brought.1, steps + 1)?;
                    if !left.is_empty() {
                        return Some((to, [left, rest.to_vec()].concat()));
                    }
                    to
                }
            }
        };
        while let Some((name, behind)) = rest.split_first() {
            if name == "super" {
                at = self.all[at].parent?;
            } else if let Some(child) =
                self.all[at].children.get(name).filter(|_| !behind.is_empty() || !self.shows(at, name))
            {
                at = *child;
            } else {
                break;
            }
            rest = behind;
        }
        Some((at, rest.to_vec()))
    }

    /// Whether a module has an item of a name, its own or brought in, beside a child of that name.
    fn shows(&self, module: usize, name: &String) -> bool {
        let module = &self.all[module];
        module.items.contains(name)
            || module.imports.iter().any(|(known, path)| known == name && path.len() > 1)
    }

    /// The module that an item is defined in, re-exports followed.
    fn home(&self, mut at: usize, rest: &[String]) -> usize {
        let mut rest = rest.to_vec();
        for _ in 0..16 {
            let Some(name) = rest.first() else { break };
            if self.all[at].items.contains(name) {
                break;
            }
            let Some((_, path)) = self.all[at].imports.iter().find(|(known, _)| known == name) else { break };
            let Some((to, left)) = self.followed(at, path, 0) else { break };
            if to == at && left == rest {
                break;
            }
            (at, rest) = (to, [left, rest[1..].to_vec()].concat());
        }
        at
    }
}

fn is_name(word: &str) -> bool {
    word.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

fn before(words: &[String], i: usize) -> &str {
    i.checked_sub(1).map_or("", |i| words[i].as_str())
}

/// Whether the attributes that `words` end with say that what follows is for tests.
fn is_for_tests(mut words: &[String]) -> bool {
    loop {
        match words {
            [rest @ .., last] if last == "pub" => words = rest,
            [.., open, _, close] if open == "(" && close == ")" => words = &words[..words.len() - 3],
            [.., close] if close == "]" => {
                let Some(start) = words.iter().rposition(|w| w == "#") else { return false };
                if words[start..].iter().any(|w| w == "test") {
                    return true;
                }
                words = &words[..start];
            }
            _ => return false,
        }
    }
}

/// The brace that ends the block which begins at `start`.
fn end_of_block(words: &[String], start: usize) -> usize {
    let mut depth = 0;
    for (i, word) in words.iter().enumerate().skip(start) {
        match word.as_str() {
            "{" => depth += 1,
            "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return i;
        }
    }
    words.len()
}

fn file_of(folder: &Path, name: &str) -> PathBuf {
    let flat = folder.join(name).with_extension("rs");
    if flat.exists() { flat } else { folder.join(name).join("mod.rs") }
}
