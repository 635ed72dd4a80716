//! The fields and columns that a page explains, against those of real output.
//!
//! A section explains what a comment in it names. Fields are written as paths: `a`, `a.b` in an object, `a[].b` in each object of a list. A row or a paragraph may lead to the
//! fields of another section by a link, below the path that stands before it.

use crate::page::{Order, Page, root};
use crate::{Wrong, shell};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// What is wrong with the sections of a page that explain output. The page's commands have been run in `folder`.
pub fn wrong(page: &Page, folder: &Path) -> Wrong {
    let mut wrong = Vec::new();
    for order in &page.orders {
        if shell::draws(&order.command) && !shell::can_draw() {
            continue;
        }
        match output(order, folder) {
            Err(why) => wrong.push(format!("{}#{}: {why}", page.name, order.section)),
            Ok(output) if order.what == "columns" => wrong.extend(wrong_columns(page, order, &output)),
            Ok(output) => wrong.extend(wrong_fields(page, order, &output)),
        }
    }
    wrong
}

/// What a command prints or writes.
fn output(order: &Order, folder: &Path) -> Result<String, String> {
    // Remarks go elsewhere, so that an object stands alone.
    let ended = shell::run(&format!("{} 2>/dev/null", order.command), folder);
    if !ended.is_good {
        let again = shell::run(&order.command, folder);
        return Err(format!("`{}` fails: {}", order.command, again.said));
    }
    match &order.file {
        None => Ok(ended.said),
        Some(file) => std::fs::read_to_string(folder.join(file)).map_err(|why| format!("{file}: {why}")),
    }
}

fn wrong_columns(page: &Page, order: &Order, output: &str) -> Wrong {
    let head = output.lines().find(|line| !line.starts_with('#')).unwrap_or_default();
    let real: Vec<&str> = head.split(',').collect();
    let (told, mut wrong) = named(page, &order.section);
    if told != real {
        wrong.push(format!("{}#{}: explains {told:?}, the columns are {real:?}", page.name, order.section));
    }
    wrong
}

/// What is wrong with the fields that a section explains, against those of `output`.
pub fn wrong_fields(page: &Page, order: &Order, output: &str) -> Wrong {
    let at = format!("{}#{}", page.name, order.section);
    let value: Value = match serde_json::from_str(output) {
        Ok(value) => value,
        Err(why) => return vec![format!("{at}: `{}`: {why}: {output}", order.command)],
    };
    let mut real = Fields::default();
    real.add(&value, "");
    let (told, mut wrong) = named(page, &order.section);
    let names: BTreeSet<String> = told.iter().cloned().collect();
    if names.len() != told.len() {
        wrong.push(format!("{at}: a field is explained twice"));
    }
    for name in real.all.difference(&names) {
        wrong.push(format!("{at}: does not explain {name}"));
    }
    for name in names.difference(&real.all) {
        if !real.is_below_null(name) {
            wrong.push(format!("{at}: explains {name}, which `{}` does not print", order.command));
        }
    }
    wrong
}

/// The fields of an object.
#[derive(Default)]
struct Fields {
    all: BTreeSet<String>,
    /// Those that hold something somewhere.
    some: BTreeSet<String>,
}

impl Fields {
    fn add(&mut self, value: &Value, path: &str) {
        match value {
            Value::Object(fields) => {
                for (name, value) in fields {
                    let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                    if !value.is_null() {
                        self.some.insert(path.clone());
                    }
                    self.add(value, &path);
                    self.all.insert(path);
                }
            }
            Value::Array(items) => {
                items
                    .iter()
                    .filter(|item| item.is_object())
                    .for_each(|item| self.add(item, &format!("{path}[]")));
            }
            _ => {}
        }
    }

    /// Whether something that `name` is a part of is null here.
    fn is_below_null(&self, name: &str) -> bool {
        let dots = name.match_indices('.').map(|(at, _)| &name[..at]);
        dots.filter(|above| !above.ends_with("[]"))
            .any(|above| self.all.contains(above) && !self.some.contains(above))
    }
}

/// The names that a section explains, in order, and what is wrong with its tables.
fn named(page: &Page, section: &str) -> (Vec<String>, Wrong) {
    let (mut names, mut wrong) = (Vec::new(), Vec::new());
    let tables: Vec<_> = page.tables.iter().filter(|table| table.section == section).collect();
    for row in tables.iter().flat_map(|table| &table.rows) {
        let first = &row[0];
        let name = first.codes.first().cloned().unwrap_or_default();
        match first.links.first() {
            Some(link) => lead(page, link, &name, &mut names, &mut wrong),
            None if first.codes.len() == 1 && first.text == name => {
                if row.iter().skip(1).all(|cell| cell.text.trim().is_empty()) {
                    wrong.push(format!("{}#{section}: says nothing of {name}", page.name));
                }
                names.push(name);
            }
            None => wrong.push(format!("{}#{section}: `{}` is no name", page.name, first.text)),
        }
    }
    if tables.is_empty() {
        for link in page.links.iter().filter(|link| link.section == section && link.to.contains('#')) {
            lead(page, &link.to, "", &mut names, &mut wrong);
        }
    }
    if names.is_empty() && wrong.is_empty() {
        wrong.push(format!("{}#{section}: explains nothing", page.name));
    }
    (names, wrong)
}

/// Adds the names of the section that a link leads to, below `path`.
fn lead(page: &Page, link: &str, path: &str, names: &mut Vec<String>, wrong: &mut Wrong) {
    let Some((file, section)) = link.split_once('#') else {
        wrong.push(format!("{}: the link {link} leads to no section", page.name));
        return;
    };
    let other = match file {
        "" => page.name.clone(),
        file => page.folder().join(file).to_string_lossy().into_owned(),
    };
    let (found, told) = named(&Page::read(&root().join(other)), section);
    let above = if path.is_empty() { String::new() } else { format!("{path}.") };
    names.extend(found.into_iter().map(|name| format!("{above}{name}")));
    wrong.extend(told);
}
