//! Faults that are made up must be found: a made-up page is taken apart as it should be, and output that differs is told from output that does not.

use crate::page::Page;
use crate::shown::shows;
use crate::{Wrong, code, fields, links, text};

const PAGE: &str = "\
# One heading: `--flags` & more
## Flags
| flag | without it | what |
|---|---|---|
| `-o`, `--output <A\\|B>` | | writes |

[away](nowhere.md) [back](#one-heading---flags--more) [missing][gone]

## Flags
<!-- fields: terrasoar info a.iqt --json ; b.json -->

| field | meaning |
|---|---|
| `a` | of `b` |

<!-- code: examples/none.rs part -->
```rust
fn a() {}
```

<!-- not run: it takes a year -->
```sh
terrasoar info
```

```console figures
$ terrasoar info
1
```

    terrasoar info
";

/// What is not found of what is there.
pub fn wrong() -> Wrong {
    let mut wrong = Vec::new();
    let mut ensure = |holds: bool, what: &str| {
        if !holds {
            wrong.push(format!("of made-up text: {what}"));
        }
    };
    let page = Page::of("docs/made-up.md".into(), PAGE.into());
    ensure(page.anchors == ["one-heading---flags--more", "flags", "flags-1"], "anchors");
    ensure(
        page.links.iter().map(|link| link.to.as_str()).eq(["nowhere.md", "#one-heading---flags--more"]),
        "links",
    );
    ensure(page.dangling == ["gone"], "references");
    ensure(page.tables.len() == 2 && page.tables[1].section == "flags-1", "tables");
    ensure(page.tables[0].rows[0][0].codes == ["-o", "--output <A|B>"], "cells");
    let [rust, script, console, indented] = &page.blocks[..] else {
        return vec!["blocks of a made-up page".into()];
    };
    ensure(
        rust.code.as_deref() == Some("examples/none.rs part") && script.code.is_none(),
        "the file that a block shows",
    );
    let source = "a\n    // begin: part\n    b\n        // end: part\n    c\n    // begin: other\n    d\n    // end: other\n    // end: part\n";
    ensure(code::part(source, Some("part")).is_none(), "a part that ends twice");
    ensure(code::part(&source[..48], Some("part")).as_deref() == Some("b\n"), "a part of a file");
    ensure(code::part(source, None).as_deref() == Some("a\n    b\n    c\n    d\n"), "a file without marks");
    ensure(code::part(source, Some("none")).is_none(), "a part that is not there");
    ensure(script.words == ["sh"] && script.not_run.as_deref() == Some("it takes a year"), "what is not run");
    ensure(console.words == ["console", "figures"] && console.not_run.is_none(), "what is run");
    ensure(&page.text[console.body.clone()] == "$ terrasoar info\n1\n", "the text of a block");
    ensure(indented.words.is_empty(), "an indented block");
    let order = &page.orders[0];
    ensure(
        order.command == "terrasoar info a.iqt --json"
            && order.file.as_deref() == Some("b.json")
            && order.section == "flags-1",
        "orders",
    );
    let pages = [page];
    ensure(
        links::fault(&pages, &pages[0], "docs".as_ref(), "nowhere.md").is_some(),
        "a link that leads nowhere",
    );
    ensure(
        links::fault(&pages, &pages[0], "docs".as_ref(), "#flag").is_some(),
        "an anchor that is not there",
    );
    ensure(links::fault(&pages, &pages[0], "docs".as_ref(), "#flags-1").is_none(), "an anchor that is there");
    ensure(
        links::fault(&pages, &pages[0], "docs".as_ref(), "../../a.md").is_some(),
        "a link out of the repository",
    );
    ensure(
        text::wrong_blocks(&pages).iter().any(|told| told.contains("marked sh or console")),
        "a hidden command",
    );
    let told = |output: &str| fields::wrong_fields(&pages[0], &pages[0].orders[0], output).len();
    ensure(told(r#"{"a": 1}"#) == 0, "fields that are explained");
    ensure(told(r#"{"a": 1, "b": 2}"#) == 1, "a field that is not explained");
    ensure(told(r#"{"b": null}"#) == 2, "a field that is not there");
    for (shown, printed, figures, same) in [
        ("a 1", "a 1", false, true),
        ("a 1", "a 2", false, false),
        ("a 1", "a  2.5", true, true),
        ("in 0.1 s (2 k edits/s)", "in 1.25 s (900 edits/s)", false, true),
        ("1 sample", "2 sample", false, false),
        ("a … c", "a bb c", false, true),
        ("a …", "b c", false, false),
        ("a\n…", "a\nb\nc", false, true),
        ("a", "a\nb", false, false),
    ] {
        let lines = |text: &'static str| text.lines().collect::<Vec<_>>();
        ensure(shows(&lines(shown), &lines(printed), figures) == same, &format!("{shown:?} for {printed:?}"));
    }
    wrong
}
