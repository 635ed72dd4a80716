//! Modules that use each other in a ring.
//!
//! Compared are neighbours in a folder, each with all that lies in it: so a package reads like a list at every level. What a module and its own parts do with each other is
//! their affair.

use super::modules::Modules;
use std::collections::{BTreeMap, BTreeSet};

/// Uses among the modules of one folder, and an example of each.
type Uses = BTreeMap<(String, String), String>;

/// The rings of a package, in words.
pub fn of(modules: &Modules) -> Vec<String> {
    let mut folders: BTreeMap<Vec<String>, Uses> = BTreeMap::new();
    for (from, to) in modules.edges() {
        let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
        if let (Some(a), Some(b)) = (from.get(shared), to.get(shared)) {
            let example = format!("{} uses {}", from.join("::"), to.join("::"));
            let uses = folders.entry(from[..shared].to_vec()).or_default();
            uses.entry((a.clone(), b.clone())).or_insert(example);
        }
    }
    folders.iter().flat_map(|(folder, uses)| in_folder(folder, uses)).collect()
}

fn in_folder(folder: &[String], uses: &Uses) -> Vec<String> {
    let names: BTreeSet<&String> = uses.keys().flat_map(|(a, b)| [a, b]).collect();
    let reach: BTreeMap<&String, BTreeSet<&String>> =
        names.iter().map(|name| (*name, reached(name, uses))).collect();
    let mut told = BTreeSet::new();
    let mut rings = Vec::new();
    for name in &names {
        let ring: Vec<&String> = names
            .iter()
            .copied()
            .filter(|other| reach[*name].contains(other) && reach[other].contains(*name))
            .collect();
        if ring.len() > 1 && told.insert(ring.clone()) {
            let within = |(a, b): &(String, String)| ring.contains(&a) && ring.contains(&b);
            let examples: Vec<&str> =
                uses.iter().filter(|(use_, _)| within(use_)).map(|(_, e)| e.as_str()).collect();
            let words: Vec<&str> = ring.iter().map(|name| name.as_str()).collect();
            rings.push(format!(
                "{{{}}} in {}:\n    {}",
                words.join(", "),
                place(folder),
                examples.join("\n    ")
            ));
        }
    }
    rings
}

fn place(folder: &[String]) -> String {
    if folder.is_empty() { "the root".into() } else { folder.join("::") }
}

/// All that a module uses, directly or not.
fn reached<'u>(name: &str, uses: &'u Uses) -> BTreeSet<&'u String> {
    let mut found = BTreeSet::new();
    let mut left = vec![name];
    while let Some(name) = left.pop() {
        for (_, to) in uses.keys().filter(|(from, _)| from == name) {
            if found.insert(to) {
                left.push(to);
            }
        }
    }
    found
}
