//! A terrain whose newest header is damaged: all verbs warn, and none replaces it unasked.

use crate::edit::{read, with_script};
use crate::support::text;

/// A script of one batch, the file or overlay that it goes to, and the verbs' flags for it.
const PLACES: [(&str, &[&str]); 2] = [("land.iqt", &[]), ("dam.iqo", &["--overlay", "dam.iqo"])];

/// CRC-32, bit by bit.
fn checksum(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |sum, byte| {
        (0..8).fold(
            sum ^ u32::from(*byte),
            |sum, _| if sum & 1 == 1 { sum >> 1 ^ 0xedb8_8320 } else { sum >> 1 },
        )
    })
}

#[test]
fn verbs_tell_of_a_damaged_newest_header_once() {
    for (file, flags) in PLACES {
        let bench = with_script("set rect 10,10,20,20 to 100\n");
        let built = read(&bench, "land.iqt");
        let before = bench.good(&["height", "land.iqt", "--at", "300,300"]);
        bench.good(&[&["edit", "land.iqt", "--script", "a.edits"], flags].concat());
        let at = [&["height", "land.iqt", "--at", "300,300"], flags].concat();
        assert_eq!(bench.good(&at), "100 m\n");
        let mut bytes = read(&bench, file);
        bytes[4096 + 0x85] ^= 1;
        std::fs::write(bench.path(file), &bytes).unwrap();
        let told = format!("warning: {file}: the newest header, on page 1, is damaged");
        for verb in [&at[..], &[&["info", "land.iqt"], flags].concat()] {
            let output = bench.run(verb);
            let said = text(&output.stderr);
            assert!(output.status.success() && said.matches(&told).count() == 1, "{verb:?}: {said}");
        }
        assert_eq!(text(&bench.run(&at).stdout), before);
        let output = bench.run(&[&["verify", "land.iqt"], flags].concat());
        let said = text(&output.stderr);
        assert!(output.status.code() == Some(1) && output.stdout.is_empty(), "{said}");
        assert!(said.contains("is damaged; the state before it, which is read instead, is sound"), "{said}");
        assert!(said.starts_with("error: ") && said.matches("is damaged").count() == 1, "{said}");
        // So does a page of zeros, which is all that a file without commits has there.
        let mut zeroed = bytes.clone();
        zeroed[4096..8192].fill(0);
        std::fs::write(bench.path(file), &zeroed).unwrap();
        let said = text(&bench.run(&at).stderr).to_owned();
        assert!(said.contains(&told) && said.contains("which was saved"), "{said}");
        assert_eq!(bench.run(&[&["verify", "land.iqt"], flags].concat()).status.code(), Some(1));
        // A power cut in the middle of the edit: the file says itself that it was never saved.
        let mut cut = bytes.clone();
        let mark = cut.len() - 64;
        cut[mark + 0x0c] = 1;
        let sum = checksum(&cut[mark..mark + 0x3c]).to_le_bytes();
        cut[mark + 0x3c..].copy_from_slice(&sum);
        std::fs::write(bench.path(file), &cut).unwrap();
        let note = format!("note: {file}: the last edit, undo or picture was cut off before it was saved");
        let output = bench.run(&[&["verify", "land.iqt"], flags].concat());
        assert!(output.status.success() && text(&output.stdout).contains("sound: "));
        assert_eq!(text(&output.stderr).matches(&note).count(), 1, "{}", text(&output.stderr));
        let output = bench.run(&at);
        assert!(text(&output.stdout) == before && text(&output.stderr).starts_with(&note));
        std::fs::write(bench.path(file), &bytes).unwrap();
        // Of a file that is not sound either, it is said once, too.
        let terrain = read(&bench, "land.iqt");
        let mut worse = terrain.clone();
        worse[built.len() / 2] ^= 1;
        std::fs::write(bench.path("land.iqt"), &worse).unwrap();
        let said = text(&bench.run(&[&["verify", "land.iqt"], flags].concat()).stderr).to_owned();
        assert!(said.contains("is damaged, too") && said.matches("the newest header").count() == 1, "{said}");
        std::fs::write(bench.path("land.iqt"), &terrain).unwrap();
        if file == "land.iqt" {
            for verb in ["pack", "compact"] {
                let output = bench.run(&[verb, "land.iqt", "-o", "out.iqt", "--force"]);
                assert!(output.status.success() && text(&output.stderr).contains(&told), "{verb}");
            }
            let output = bench.run(&["compact", "land.iqt"]);
            assert!(text(&output.stderr).contains("would be gone") && !output.status.success());
            let said = bench.bad(1, &["build", "land.tif", "-o", "land.iqt"]);
            assert!(said.contains("a terrain that holds a damaged header"), "{said}");
        }
        assert!(read(&bench, file) == bytes);
        // The next edit writes the header anew.
        let edited = bench.run(&[&["edit", "land.iqt", "--script", "a.edits"], flags].concat());
        assert!(edited.status.success() && text(&edited.stderr).contains(&told));
        bench.good(&[&["verify", "land.iqt"], flags].concat());
        assert_eq!(text(&bench.run(&at).stderr), "");
    }
}
